"""Flight software in Python without rso_lidar: pyzmq, json and numpy only. The twin of pointing.c.

rso-lidar serve tumbling_stage.toml &
python pointing.py tcp://127.0.0.1:5571
"""

import json
import math
import sys

import numpy as np
import zmq

GATE_M, LEAST_RETURNS = 15.0, 4


def ask(socket, kind, **fields):
    """Send a request, and return the header and the arrays of its reply."""
    socket.send_json({"request": kind, **fields})
    header, *parts = socket.recv_multipart()
    header = json.loads(header)
    if not header["ok"]:
        raise SystemExit(header["error"]["message"])
    arrays = {
        entry["name"]: np.frombuffer(part, entry["dtype"]).reshape(entry["shape"])
        for entry, part in zip(header["arrays"], parts, strict=True)
    }
    return header, arrays


def aim(range_m, sight, measured_rad):
    """Return the number of returns of the target, its angle off boresight [rad], and the command."""
    seen = np.abs(range_m - np.nanmedian(range_m)) <= GATE_M if np.isfinite(range_m).any() else np.zeros(0)
    if seen.sum() < LEAST_RETURNS:
        return 0, math.nan, None
    right, down, ahead = sight[seen].sum(axis=0).tolist()  # lidar axes
    pan_rad, tilt_rad = measured_rad.tolist()
    x, y, z = ahead, -right, -down  # PTU axes at the measured angles
    forward, up = x * math.cos(tilt_rad) - z * math.sin(tilt_rad), x * math.sin(tilt_rad) + z * math.cos(tilt_rad)
    command = {"pan_rad": pan_rad + math.atan2(y, forward), "tilt_rad": math.atan2(up, math.hypot(forward, y))}
    return int(seen.sum()), math.atan2(math.hypot(right, down), ahead), command


def main(endpoint):
    socket = zmq.Context.instance().socket(zmq.REQ)
    socket.setsockopt(zmq.RCVTIMEO, 60_000)
    socket.setsockopt(zmq.LINGER, 0)
    socket.connect(endpoint)
    ask(socket, "hello", version=1, client="pointing.py")
    command, sight, is_over = None, None, False
    while not is_over:
        header, arrays = ask(socket, "step", command=command)
        is_over = header["is_over"]
        sight = arrays.get("line_of_sight", sight)
        if "reading/range_m" not in arrays:
            continue  # the reading was lost on the link, and the last command stays
        returns, off_rad, found = aim(arrays["reading/range_m"], sight, arrays["pan_tilt_rad"])
        command = found or command
        print(f"{header['frame']['time_s']:.3f} {returns} {off_rad * 180 / math.pi:.4f}")
    ask(socket, "shutdown")


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "tcp://127.0.0.1:5571")

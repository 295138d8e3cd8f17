"""Space packets (CCSDS 133.0-B-2) between the lidar and a cFS application. README.md states them byte by byte."""

import functools
import operator
import struct
from collections import Counter

import numpy as np
from spacepackets.ccsds.spacepacket import PacketType, SequenceFlags, SpacePacketHeader

import rso_lidar as rl

READING, POINTS, SAMPLE, HOUSEKEEPING, COMMAND = (
    0x1A0,
    0x1A1,
    0x1A2,
    0x1A3,
    0x1A8,
)  # APIDs: change them to your mission's
NOOP, RESET_COUNTERS, STEP, STEP_UNTIL, POINT, INPUTS, MODE, SHUT_DOWN = range(8)  # function codes
PAYLOAD = {NOOP: "", RESET_COUNTERS: "", STEP: "I", STEP_UNTIL: "Q", POINT: "dd", MODE: "B", SHUT_DOWN: ""}
STATUS = {"delivered": 0, "dropped": 1, "skipped": 2}
REASONS = ("length", "apid", "checksum", "function", "failed")  # why a telecommand is refused
KINDS = (  # of SAMPLE packets, from 1
    rl.records.GyroSamples,
    rl.records.AccelerometerSamples,
    rl.records.GnssSamples,
    rl.records.RelativeGnssSamples,
    rl.records.StarTrackerSamples,
    rl.records.WheelSamples,
    rl.records.ThrusterSamples,
)
MOST_BYTES = 768  # CI_LAB_MAX_INGEST: the longest datagram that cFS's CI_LAB takes
TM_HEADER, TC_HEADER, BODY_NAME = 16, 8, 24  # bytes
GATE_M = 15.0  # about the median range: outside it a return is no part of the target

_READING = struct.Struct(">IBBHqqddIfffffHH4x")
_POINT = np.dtype(
    [("row", ">u2"), ("col", ">u2"), ("xyz_m", ">f4", 3), ("intensity", ">u2"), ("saturated", "u1"), ("", "u1")]
)
_MOST_POINTS = (MOST_BYTES - TM_HEADER - 8) // _POINT.itemsize


class RefusedError(Exception):
    """A telecommand that is not carried out: `reason` is one of `REASONS`."""

    def __init__(self, reason, message):
        super().__init__(message)
        self.reason = reason


class Telemetry:
    """Packs telemetry, and counts the packets of each APID."""

    def __init__(self):
        self.sent = Counter()

    def pack(self, apid, time_ns, data, flags=SequenceFlags.UNSEGMENTED):
        """Return a packet with the telemetry header of cFS: its time has 4 bytes of seconds and 2 of 1/65536 s."""
        seconds, rest_ns = divmod(time_ns, 1_000_000_000)
        count, self.sent[apid] = self.sent[apid] % 16384, self.sent[apid] + 1
        header = SpacePacketHeader(PacketType.TM, apid, count, TM_HEADER - 6 + len(data) - 1, True, flags)
        return bytes(header.pack()) + struct.pack(">IH4x", seconds, rest_ns * 65536 // 1_000_000_000) + data

    def pack_reading(self, flash, is_over, time_ns):
        """Return the packets of a flash: POINTS, and READING last."""
        observation, none = flash.observation, float("nan")
        points = np.zeros(0, _POINT) if observation is None else list_points(observation)
        blocks = [points[first : first + _MOST_POINTS] for first in range(0, len(points), _MOST_POINTS)]
        packets = []
        for number, block in enumerate(blocks):
            flags = 2 * (number == len(blocks) - 1) + (number == 0)  # 1 first, 0 continuation, 2 last, 3 alone
            data = struct.pack(">IHxx", flash.index, len(block)) + block.tobytes()
            packets.append(self.pack(POINTS, time_ns, data, SequenceFlags(flags)))
        median_m = nearest_m = none
        direction = np.full(3, none)
        if len(points):
            ranges_m = np.linalg.norm(points["xyz_m"].astype(float), axis=1)
            median_m, nearest_m = float(np.median(ranges_m)), float(ranges_m.min())
            near = np.abs(ranges_m - median_m) <= GATE_M
            total = (points["xyz_m"][near] / ranges_m[near, None]).sum(axis=0)
            direction = total / np.linalg.norm(total)
        has_ptu = observation is not None and observation.pan_tilt_rad is not None
        pan, tilt = observation.pan_tilt_rad.tolist() if has_ptu else (none, none)
        is_known = flash.t_available_ns is not None
        head = _READING.pack(
            flash.index,
            STATUS[flash.status],
            is_over | is_known << 1 | bool(len(points)) << 2 | has_ptu << 3,
            len(blocks),
            flash.t_emission_ns,
            flash.t_available_ns if is_known else -1,
            pan,
            tilt,
            len(points),
            median_m,
            nearest_m,
            *direction,
            int(points["intensity"].max(initial=0)),
            int(points["saturated"].sum()),
        )
        return [*packets, self.pack(READING, time_ns, head)]

    def pack_samples(self, samples, time_ns):
        """Return a SAMPLE packet for each sample of the other sensors, in the order in which they became available."""
        found = []
        for number, (_, series) in enumerate(sorted(samples.items())):
            if type(series) not in KINDS:
                continue  # a user's own record
            kind, common = KINDS.index(type(series)) + 1, rl.records.specs(rl.records.SensorSamples)
            own = [getattr(series, name) for name in rl.records.specs(type(series)) if name not in common]
            for k, (at_s, available_s) in enumerate(zip(series.time_s, series.available_s, strict=True)):
                values = np.concatenate([np.ravel(one[k]) for one in own]).astype(">f8")
                times = round(at_s * 1e9), round(available_s * 1e9)
                head = struct.pack(">BBBB4xqq", number, kind, bool(series.valid[k]), len(values), *times)
                found.append((times[1], number, head + values.tobytes()))
        return [self.pack(SAMPLE, time_ns, data) for *_, data in sorted(found)]

    def pack_housekeeping(self, accepted, refused, lost, function, mode, time_ns):
        """Return a packet with the counters of telecommands, and the last function code that was carried out."""
        counters = (accepted, *(refused[reason] for reason in REASONS), lost)
        return self.pack(HOUSEKEEPING, time_ns, struct.pack(">7IBBxxq", *counters, function, mode, time_ns))


def list_points(observation):
    """Return the pixels with a return, row by row: their place, point in lidar axes [m], and intensity [counts]."""
    reading = observation.reading
    rows, cols = np.nonzero(np.isfinite(reading.range_m))
    points = np.zeros(len(rows), _POINT)
    points["row"], points["col"], points["xyz_m"] = rows, cols, observation.points_m[rows, cols]
    points["intensity"], points["saturated"] = reading.intensity_counts[rows, cols], reading.saturated[rows, cols]
    return points


def checksum(packet):
    """Return the exclusive or of 0xFF and all bytes: 0 for a packet with a right checksum (CFE_MSG_ComputeCheckSum)."""
    return functools.reduce(operator.xor, packet, 0xFF)


def pack_command(function, *values, count=0, apid=COMMAND):
    """Return a telecommand with the command header of cFS: function code and checksum."""
    if function == INPUTS:
        body, *inputs = values
        data = struct.pack(f">{BODY_NAME}sB7x{len(inputs)}d", body.encode(), len(inputs), *inputs)
    else:
        data = struct.pack(">" + PAYLOAD[function], *values)
    header = bytes(SpacePacketHeader(PacketType.TC, apid, count, 2 + len(data) - 1, True).pack())
    return header + bytes([function, checksum(header + bytes([function]) + data)]) + data


def read_command(packet, expected_count):
    """Return function code, values and sequence count of a telecommand, and the number of packets lost before it.

    A count of 0 is not compared with the expected one: cFS does not count the commands that its applications send.
    """
    if len(packet) < TC_HEADER or (header := SpacePacketHeader.unpack(packet)).packet_len != len(packet):
        raise RefusedError(
            "length", f"{len(packet)} bytes are not what the header states; a telecommand has at least 8"
        )
    if (
        header.ccsds_version
        or not header.sec_header_flag
        or (header.packet_type, header.apid) != (PacketType.TC, COMMAND)
    ):
        raise RefusedError(
            "apid", f"stream 0x{packet[0]:02X}{packet[1]:02X} is not 0x{0x1800 | COMMAND:04X}; see README.md"
        )
    if header.seq_flags != SequenceFlags.UNSEGMENTED:
        raise RefusedError("length", "is segmented; send telecommands whole")
    if checksum(packet):
        raise RefusedError("checksum", f"checksum 0x{packet[7]:02X} is wrong; call CFE_MSG_GenerateChecksum")
    lost = (header.seq_count - expected_count) % 16384 if header.seq_count and expected_count is not None else 0
    function, data = packet[6], packet[TC_HEADER:]
    if function == INPUTS and len(data) >= BODY_NAME + 8 and len(data) == BODY_NAME + 8 + 8 * data[BODY_NAME]:
        body = data[:BODY_NAME].rstrip(b"\0").decode("ascii", "replace")
        values = (body, *struct.unpack_from(f">{data[BODY_NAME]}d", data, BODY_NAME + 8))
    elif function in PAYLOAD and len(data) == struct.calcsize(">" + PAYLOAD[function]):
        values = struct.unpack(">" + PAYLOAD[function], data)
    else:
        raise RefusedError("function", f"function code {function} with {len(data)} bytes is not in README.md")
    return function, values, header.seq_count, lost

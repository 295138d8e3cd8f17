"""Whatever a client sends, the server answers in one line or drops the connection, and goes on."""

import json
import re
import signal
import socket
import subprocess
import sys
import time
from contextlib import contextmanager

import pytest

import rso_lidar as rl
from tests.loop.service.serving import EXAMPLES, SMALL, serving

zmq = pytest.importorskip("zmq", reason="pyzmq is not installed: the extra 'loop'")

HELLO = {"request": "hello", "version": 1}
PATIENCE_MS = 30_000


@contextmanager
def connected(endpoint, kind=None, **options):
    """Yield a plain socket connected to a server; options count only if they are set before."""
    with zmq.Context() as context, context.socket(kind or zmq.REQ) as plug:
        plug.setsockopt(zmq.RCVTIMEO, PATIENCE_MS)
        plug.setsockopt(zmq.LINGER, 0)
        for name, value in options.items():
            plug.setsockopt(getattr(zmq, name), value)
        plug.connect(endpoint)
        yield plug


def ask(plug, request):
    """Return the header of the reply to a request, given as a dict or as bytes."""
    plug.send(request if isinstance(request, bytes) else json.dumps(request).encode())
    return json.loads(plug.recv_multipart()[0])


@pytest.fixture(scope="module")
def server(scenario):
    with serving(scenario) as made:
        yield made


BAD = {
    b"": "is not JSON in UTF-8",
    b"\xff\xfe\x00": "is not JSON in UTF-8",
    '{"request": "describe"}'.encode("utf-16"): "is not JSON in UTF-8",  # which json.loads would detect
    '{"request": "describe"}'.encode("utf-8-sig"): "is not JSON in UTF-8",  # RFC 8259, sec. 8.1: no byte order mark
    b"[1, 2]": "is list and not an object",
    b'{"request": "step"': "is not JSON in UTF-8",
    b"[" * 60_000: "is nested too deeply|is not JSON",
    b'{"request": "stpe"}': "did you mean 'step'",
    b'{"request": 7}': "7 is not known",
    b'{"request": "\\ud800"}': r"'.ud800' is not known",  # a lone surrogate, which UTF-8 has no bytes for
    b'{"request": "restore", "state": "\\udfff"}': "state",
    b'{"request": "describe", "\\ud800": 1}': "unable to parse raw data as a unicode string",
    b'{"request": "step", "request": "step"}': "occurs twice",
    b'{"request": "step", "command": {"pan_rad": NaN}}': "NaN is no JSON number",
    b'{"request": "step", "command": {"pan_rad": 1e999}}': "command.pan_rad",
    b'{"request": "step", "command": {"pan_rad": "0.1"}}': "command.pan_rad",
    b'{"request": "step", "command": {"pan_rad": true}}': "command.pan_rad",
    b'{"request": "step", "command": {"pan": 0.1}}': "unknown key 'pan'",
    b'{"request": "step", "command": [0.1, 0.2]}': "command",
    b'{"request": "step", "command": {"inputs": {"stage": [1, 2]}}}': "inputs are given for 'stage'",
    b'{"request": "step", "command": {"energy_j": -1.0}}': "command.energy_j",
    b'{"request": "step", "dt_ns": 0}': "dt_ns",
    b'{"request": "step", "dt_ns": 1e9}': "dt_ns",
    b'{"request": "step", "dt_ns": ' + b"9" * 5000 + b"}": "digits|dt_ns",
    b'{"request": "step", "dt_ns": 10000000000}': "contains two flashes",
    b'{"request": "step", "stamp_ns": -1}': "stamp_ns",
    b'{"request": "reset", "seed": -1}': "seed",
    b'{"request": "restore", "state": "../../etc/passwd"}': "no state",
    b'{"request": "hello", "version": 2}': "version",
}


def test_what_is_wrong_has_an_answer_of_one_line_and_changes_nothing(server):
    with connected(server.endpoint) as plug:
        refused = ask(plug, {"request": "step"})
        assert (refused["ok"], refused["error"]["code"]) == (False, "no_session")
        assert ask(plug, HELLO)["ok"]
        assert ask(plug, {"request": "reset"})["ok"]
        for text, message in BAD.items():
            reply = ask(plug, text)
            assert not reply["ok"], text[:80]
            assert reply["error"]["code"] == "bad_request"
            assert "\n" not in reply["error"]["message"] and len(reply["error"]["message"]) < 400
            assert re.search(message, reply["error"]["message"]), (text[:80], reply["error"]["message"])
        reply = ask(plug, {"request": "step", "sequence": 77})
        assert reply["ok"] and reply["frame"]["index"] == 0 and reply["request_sequence"] == 77
        plug.send_multipart([b'{"request": "step"}', b"more"])
        assert "has 2 parts" in json.loads(plug.recv_multipart()[0])["error"]["message"]


def test_who_sends_no_envelope_or_too_much_cannot_stop_the_others(server):
    with connected(server.endpoint, zmq.DEALER) as odd, connected(server.endpoint, zmq.DEALER) as big:
        odd.send(b"no empty part before this")
        odd.send_multipart([b"x"] * 50)
        big.send_multipart([b"", b" " * 10_000_000])  # over ZMQ_MAXMSGSIZE: libzmq closes the connection
        assert not big.poll(300)
    host, port = server.endpoint.removeprefix("tcp://").split(":")
    for garbage in (b"GET / HTTP/1.1\r\n\r\n", b"\xff" * 100, b"\xff\x00\x00\x00\x00\x00\x00\x00\x01\x7f", b""):
        with socket.create_connection((host, int(port)), timeout=10) as raw:
            raw.sendall(garbage)
    with connected(server.endpoint) as plug:
        assert ask(plug, HELLO)["ok"]
        assert ask(plug, {"request": "describe"})["ok"]


def test_requests_sent_without_waiting_are_answered_or_refused(scenario):
    """A flood from one client: bounded queues, and the next client is served."""
    with serving(scenario) as server:
        with connected(server.endpoint, zmq.DEALER) as flood:
            flood.send_multipart([b"", json.dumps(HELLO).encode()])
            for _ in range(2000):
                if flood.poll(100, zmq.POLLOUT):
                    flood.send_multipart([b"", b'{"request": "describe"}'], zmq.NOBLOCK)
        with connected(server.endpoint) as plug:
            deadline = time.monotonic() + 30.0
            while not (reply := ask(plug, HELLO))["ok"] and time.monotonic() < deadline:
                time.sleep(0.05)  # until the server has read that the other has gone
            assert reply["ok"]


def test_a_client_that_is_killed_leaves_the_simulation_to_the_next(scenario):
    program = (
        "import json, sys, time, zmq\n"
        "plug = zmq.Context().socket(zmq.REQ); plug.connect(sys.argv[1])\n"
        f"plug.send_json({HELLO}); plug.recv_multipart()\n"
        "plug.send_json({'request': 'step'}); plug.recv_multipart()\n"
        "plug.send_json({'request': 'step'}); print('sent', flush=True); time.sleep(60)\n"
    )
    with serving(scenario) as server:
        child = subprocess.Popen([sys.executable, "-c", program, server.endpoint], stdout=subprocess.PIPE, text=True)
        with child:
            assert child.stdout.readline() == "sent\n"
            child.kill()
        with connected(server.endpoint) as plug:
            deadline = time.monotonic() + 30.0
            while not (reply := ask(plug, HELLO))["ok"] and time.monotonic() < deadline:
                assert reply["error"]["code"] == "busy"
                time.sleep(0.05)
            # The second step counts only if it left the client before its end.
            assert ask(plug, {"request": "step"})["frame"]["index"] in (1, 2)


@pytest.mark.slow
def test_a_slow_subscriber_slows_nothing_and_a_killed_server_leaves_its_frames(tmp_path):
    """Served by a process of its own, with a reader of the stream that reads nothing, and killed in the middle.

    A message has 115 kB. The 100 steps send more than can wait: 16 messages in the server, 4 MB in its kernel (the greatest
    default of Linux), and one message and 4 kB in the reader.
    """
    steps, size = 100, ("lidar.receiver.n_rows=128", "lidar.receiver.n_cols=128", "time.duration_s=100")
    settings = [word for setting in (*SMALL, *size) for word in ("--set", setting)]
    command = [sys.executable, "-m", "rso_lidar", "serve", str(EXAMPLES / "closed_loop.toml"), *settings]
    command += ["--bind", "tcp://127.0.0.1:*", "--publish", "tcp://127.0.0.1:*", "-o", str(tmp_path / "a.h5")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as child:
        try:
            for line in child.stdout:
                if line.startswith("serving"):
                    break
            endpoint, stream = line.split(" at ")[1].split(";")[0], line.split(" at ")[2].strip()
            with connected(stream, zmq.SUB, RCVHWM=1, RCVBUF=4096, SUBSCRIBE=b"reading") as idle:
                time.sleep(0.3)
                with rl.loop.Client(endpoint, timeout_s=30) as client:
                    for _ in range(steps):
                        client.step()
                    kept = []
                    while idle.poll(500):
                        topic, header, *arrays = idle.recv_multipart()
                        assert topic == b"reading"
                        assert len(json.loads(header)["arrays"]) == len(arrays) >= 4
                        kept.append(json.loads(header)["frame"]["index"])
                    assert kept == sorted(set(kept)) and kept[0] == 0  # whole messages in their order
                    assert 1 < len(kept) < steps  # the rest were dropped, and no step waited
                    child.send_signal(signal.SIGKILL)
                    child.wait(10)
                    with pytest.raises(rl.RunError, match="the server has ended"):
                        client.step()
        finally:
            child.kill()
    (left,) = tmp_path.glob("a.h5.tmp-*")
    with rl.open(left) as recording:
        assert len(recording) == steps
        assert recording[steps - 1].index == steps - 1


def test_no_server_is_said_in_a_line():
    with socket.socket() as closed:
        closed.bind(("127.0.0.1", 0))
        port = closed.getsockname()[1]
    with pytest.raises(rl.RunError, match="no server answers there"):
        rl.loop.Client(f"tcp://127.0.0.1:{port}", timeout_s=0.3)
    with pytest.raises(rl.ScenarioError, match="is not an address"):
        rl.loop.Client("nowhere")

"""A client cannot use up the memory or the time of a server, and is not kept from sending what is right."""

import json
import socket
import struct
import time
from contextlib import ExitStack, contextmanager

import pytest

import rso_lidar as rl
from rso_lidar.loop.service import gateway
from rso_lidar.loop.service.gateway import FrameLimits, Gateway
from tests.loop.service.serving import serving

zmq = pytest.importorskip("zmq", reason="pyzmq is not installed: the extra 'loop'")

# RFC 23: signature, version 3.0, mechanism, as-server, filler; then the command READY.
GREETING = b"\xff" + bytes(8) + b"\x7f\x03\x00" + b"NULL".ljust(20, b"\0") + bytes(32)
_READY = b"\x05READY\x0bSocket-Type" + struct.pack(">I", 6) + b"DEALER"
READY = bytes([4, len(_READY)]) + _READY
PING = b"\x04\x07\x04PING\x00\x00"


def frame(size, flags=0):
    """Return a frame of zeros."""
    return bytes([flags | 2]) + struct.pack(">Q", size) + bytes(size)


def admits(limits, *blocks):
    """Return whether bytes are within the limits, which are the same for any division into blocks."""
    return all(limits.admits(memoryview(block)) for block in blocks)


@contextmanager
def raw(endpoint, *blocks):
    """Yield a plain connection to a server, over which some bytes were sent."""
    host, port = endpoint.removeprefix("tcp://").split(":")
    with socket.create_connection((host, int(port)), timeout=10) as plug:
        for block in blocks:
            plug.sendall(block)
        yield plug


def is_closed(plug):
    """Return whether the server closes a connection within 10 s."""
    try:
        while plug.recv(65_536):
            pass
    except ConnectionResetError:
        return True
    except TimeoutError:
        return False
    return True


@pytest.fixture(scope="module")
def server(scenario):
    with serving(scenario, security=rl.loop.Security(token="0123456789abcdef")) as made:
        yield made


def step_once(endpoint):
    """Return the time that another client waits for a flash [s]."""
    start_s = time.monotonic()
    with rl.loop.Client(endpoint, token="0123456789abcdef", timeout_s=10) as client:
        client.reset()
        assert client.step().index == 0
    return time.monotonic() - start_s


@pytest.mark.parametrize(
    "part", [frame(60_000, flags=1), b"\x01\x00" * 1000, PING + b"\x01\x00" * 15, frame(65_537), b"\x05\x01\x00"]
)
def test_a_message_without_an_end_closes_its_connection_and_delays_nobody(server, part):
    with raw(server.endpoint, GREETING, READY) as plug:
        with pytest.raises(OSError):  # reset, or broken pipe
            for _ in range(2000):  # of 120 MB, of which the kernel holds a few
                plug.sendall(part)
        assert step_once(server.endpoint) < 5.0


@pytest.mark.parametrize("start", [b"", GREETING[:5], GREETING[:10], GREETING, GREETING + READY[:9]])
def test_half_a_greeting_delays_nobody(server, start):
    with raw(server.endpoint, start):
        assert step_once(server.endpoint) < 5.0


@pytest.mark.parametrize(
    "start",
    [
        b"GET / HTTP/1.1\r\n\r\n",
        GREETING[:10] + b"\x01\x05\x00\x00",  # ZMTP 2.0
        GREETING[:12] + b"PLAIN".ljust(20, b"\0") + bytes(32),
    ],
)
def test_another_protocol_is_not_forwarded(server, start):
    with raw(server.endpoint, start) as plug:
        assert is_closed(plug)


def test_a_request_in_single_bytes_is_answered(server):
    text = b'{"request": "describe", "sequence": 7}'
    request = GREETING + READY + b"\x01\x00" + bytes([0, len(text)]) + text
    with raw(server.endpoint, *(request[k : k + 1] for k in range(len(request)))) as plug:
        got = b""
        while b"no_session" not in got:
            assert (block := plug.recv(4096))
            got += block
        assert b'"request_sequence": 7' in got or b'"request_sequence":7' in got


def test_connections_beyond_the_limit_wait_until_one_ends(server, monkeypatch):
    monkeypatch.setattr(gateway, "_MOST_CONNECTIONS", 8)
    with ExitStack() as open_ones:
        for _ in range(7):
            open_ones.enter_context(raw(server.endpoint, GREETING[:10]))
        with rl.loop.Client(server.endpoint, token="0123456789abcdef", timeout_s=10) as client:
            with raw(server.endpoint) as late:
                late.settimeout(0.2)
                with pytest.raises(TimeoutError):  # no greeting of the server
                    late.recv(1)
                client.reset()
                assert client.step().index == 0  # and who is connected is served
                open_ones.close()
                late.settimeout(10.0)
                assert late.recv(1) == b"\xff"


def test_a_message_has_at_most_16_parts_and_66560_bytes():
    parts = [b"\x01\x00"] * 15
    assert admits(FrameLimits(), GREETING, READY, *(parts + [frame(65_536)]) * 3)
    assert not admits(FrameLimits(), GREETING, READY, *parts, b"\x01\x00\x00\x00")
    assert admits(FrameLimits(), GREETING, READY, frame(1_024, flags=1), frame(65_536))
    assert not admits(FrameLimits(), GREETING, READY, frame(1_025, flags=1), frame(65_536)[:9])
    assert not admits(FrameLimits(), GREETING, READY, frame(65_537)[:9])
    assert not admits(FrameLimits(), GREETING, READY, b"\x08\x00")  # a reserved flag
    assert not admits(FrameLimits(), GREETING, READY, b"\x04\x00\x00")  # a command without a name


def test_a_subscriber_sends_1024_subscriptions_and_any_number_of_pings():
    subscribe = b"\x00\x03\x01ab"
    limits = FrameLimits(is_stream=True)
    assert admits(limits, GREETING, READY, *[subscribe, PING] * 1024, PING * 5000)
    assert not admits(limits, subscribe)


def test_an_encrypted_client_sends_10000_frames_or_8_mib_before_an_answer():
    greeting = GREETING.replace(b"NULL\0", b"CURVE")
    box = b"\x00\x21" + bytes(33)
    limits = FrameLimits(is_curve=True)
    assert admits(limits, greeting, box * 10_000)
    limits.note_answer()
    assert admits(limits, box * 10_000) and not admits(limits, box)
    assert admits(FrameLimits(is_curve=True), greeting, frame(65_536) * 128)
    assert not admits(FrameLimits(is_curve=True), greeting, frame(65_536) * 128, box)
    assert not admits(FrameLimits(is_curve=True), GREETING)


def test_a_socket_file_is_reused_and_another_file_is_kept(tmp_path, scenario):
    if not zmq.has("ipc"):
        pytest.skip("this libzmq has no ipc")
    path = tmp_path / "lidar"
    path.write_text("notes")
    with Gateway() as made, pytest.raises(OSError, match="in use"):
        made.open(f"ipc://{path}", "", FrameLimits)
    assert path.read_text() == "notes"
    path.unlink()
    with socket.socket(socket.AF_UNIX) as killed:
        killed.bind(str(path))
    session = rl.loop.Session(rl.Simulation(scenario, threads=1))
    with rl.loop.Server(session, f"ipc://{path}") as served:
        assert served.endpoint == f"ipc://{path}"
        with zmq.Context() as context, context.socket(zmq.REQ) as plug:
            plug.setsockopt(zmq.LINGER, 0)
            plug.connect(served.endpoint)
            plug.send(b'{"request": "hello", "version": 1}')
            served.run(lambda: bool(plug.poll(100)))
            assert json.loads(plug.recv_multipart()[0])["ok"]
    assert not path.exists()

"""A client cannot use up the memory or the time of a server, and is not kept from sending what is right."""

import socket
import struct
import threading
import time
from contextlib import contextmanager, suppress

import pytest

import rso_lidar as rl
from rso_lidar.loop.service import server as server_module
from rso_lidar.loop.service.frame_limits import FrameLimits
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


@contextmanager
def introduced(endpoint):
    """Yield a plain connection after the handshake: libzmq accepts no message before it has sent its own READY."""
    with raw(endpoint, *(bytes([byte]) for byte in GREETING + READY)) as plug:
        got = b""
        while b"ROUTER" not in got or not got.endswith(b"Identity" + bytes(4)):
            block = plug.recv(4096)
            assert block
            got += block
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
    """Have another client wait for a flash, in vain if it takes 10 s."""
    with rl.loop.Client(endpoint, token="0123456789abcdef", timeout_s=10) as client:
        client.reset()
        assert client.step().index == 0


def send_until_closed(plug, part):
    """Return the number of bytes that are sent before the server closes the connection, in at most 10 s."""
    sent, end_s = 0, time.monotonic() + 10
    with suppress(ConnectionResetError, BrokenPipeError):
        while time.monotonic() < end_s:
            plug.sendall(part)
            sent += len(part)
        pytest.fail("the connection is still open")
    return sent


@pytest.mark.parametrize(
    "part", [frame(60_000, flags=1), b"\x01\x00" * 1000, PING + b"\x01\x00" * 15, frame(65_537), b"\x05\x01\x00"]
)
def test_a_message_without_an_end_closes_its_connection_and_delays_nobody(server, part):
    with introduced(server.endpoint) as plug:
        # Linux buffers at most 4 MiB of a sender and 6 MiB of a receiver.
        assert send_until_closed(plug, part) < 10 * 2**20
        step_once(server.endpoint)


def test_a_flood_of_whole_messages_keeps_nobody_waiting(server):
    with introduced(server.endpoint) as plug:
        plug.setblocking(False)
        stopped = threading.Event()

        def flood():
            while not stopped.wait(0.001):
                with suppress(BlockingIOError):
                    plug.send(b"\x00\x00" * 50_000)

        thread = threading.Thread(target=flood)
        thread.start()
        try:
            time.sleep(0.2)
            step_once(server.endpoint)
        finally:
            stopped.set()
            thread.join()


@pytest.mark.parametrize("start", [b"", GREETING[:5], GREETING[:10], GREETING, GREETING + READY[:9]])
def test_half_a_greeting_delays_nobody(server, start):
    with raw(server.endpoint, start):
        step_once(server.endpoint)


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
    with introduced(server.endpoint) as plug:
        for byte in b"\x01\x00" + bytes([0, len(text)]) + text:
            plug.sendall(bytes([byte]))
        got = b""
        while b"no_session" not in got:
            block = plug.recv(4096)
            assert block
            got += block
        assert b'"request_sequence": 7' in got or b'"request_sequence":7' in got


def test_a_message_has_at_most_16_parts_and_66560_bytes():
    parts = [b"\x01\x00"] * 15
    assert admits(FrameLimits(), GREETING, READY, *[*parts, frame(65_536)] * 3)
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


def test_the_topics_of_a_subscriber_have_16_kib():
    limits = FrameLimits(is_stream=True)
    assert admits(limits, GREETING, READY, frame(16_384 - len(_READY)))
    assert not admits(limits, frame(1))


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


def test_a_connection_without_a_handshake_ends(scenario, monkeypatch):
    monkeypatch.setattr(server_module, "_HANDSHAKE_MS", 300)
    with serving(scenario) as made:
        for start in (b"", GREETING):
            with raw(made.endpoint, start) as plug:
                assert is_closed(plug)

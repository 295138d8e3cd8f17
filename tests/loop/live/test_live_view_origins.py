"""Only pages of the viewers, and of origins on the list, watch a live view."""

import socket

import pytest

import rso_lidar as rl
from rso_lidar.loop.live.live_view import HandshakeCheck, parse_origin

HANDSHAKE = (
    "GET / HTTP/1.1\r\nHost: 127.0.0.1:8765\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n{origin}"
    "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n"
    "Sec-WebSocket-Protocol: foxglove.sdk.v1\r\n\r\n"
)


def shake_hands(port, *origins, pieces=1):
    """Return the first line of the server's answer to a handshake, and the bytes after it."""
    text = HANDSHAKE.format(origin="".join(f"Origin: {origin}\r\n" for origin in origins)).encode()
    step = -(-len(text) // pieces)
    got = b""
    with socket.create_connection(("127.0.0.1", port), timeout=10) as plug:
        plug.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        for start in range(0, len(text), step):
            plug.sendall(text[start : start + step])
        while b"serverInfo" not in got and (block := plug.recv(4096)):
            got += block
    first, _, rest = got.partition(b"\r\n")
    return first.decode(), rest


def test_pages_off_the_list_receive_nothing():
    pytest.importorskip("foxglove", reason="the extra live is not installed")
    from tests.conftest import BENCH

    lines = []
    scenario = rl.Scenario.loads(BENCH)
    with rl.loop.LiveView(scenario, "127.0.0.1:0", origins=["http://localhost:8080"], log=lines.append) as view:
        for origins in ([], ["https://app.foxglove.dev"], ["file://"], ["http://localhost:8080"]):
            first, rest = shake_hands(view.address.port, *origins)
            assert first == "HTTP/1.1 101 Switching Protocols"
            assert b"serverInfo" in rest
        for origins in (
            ["http://evil.example"],
            ["http://evil.example", "https://app.foxglove.dev"],
            ["https://app.foxglove.dev.evil.example"],
            ["http://app.foxglove.dev"],
            ["http://localhost:8081"],
            ["null"],
            [""],
        ):
            for pieces in (1, 100):
                first, rest = shake_hands(view.address.port, *origins, pieces=pieces)
                assert first == "HTTP/1.1 403 Forbidden"
                assert b"serverInfo" not in rest
    assert len(lines) == 6  # one for each origin
    assert lines[0] == ("live view   refused a web page of 'http://evil.example'; --live-origin allows an origin")


@pytest.mark.parametrize(
    ("text", "origin"),
    [
        ("http://LOCALHOST:8080", "http://localhost:8080"),
        ("https://viewer.example:443", "https://viewer.example"),
        ("http://[::1]:80", "http://[::1]"),
        ("https://viewer.example:80", "https://viewer.example:80"),
        ("app://viewer", "app://viewer"),
    ],
)
def test_an_origin_is_written_as_browsers_do(text, origin):
    assert parse_origin(text) == origin


@pytest.mark.parametrize(
    "text", ["", "*", "null", "viewer.example", "http://", "http://a/", "http://a:b", "http://a:65536", "http://a b"]
)
def test_other_texts_are_no_origins(text):
    with pytest.raises(rl.ScenarioError, match="is not an origin; write for example http://localhost:8080"):
        parse_origin(text)


def test_a_request_has_at_most_16_kib():
    line = b"X: " + b"a" * 1_000 + b"\r\n"
    check = HandshakeCheck(lambda origin: True)
    assert all(check.admits(memoryview(line)) for _ in range(16))
    assert not check.admits(memoryview(line))
    opened = HandshakeCheck(lambda origin: False)
    assert opened.admits(memoryview(b"GET / HTTP/1.1\r\nX: Origin: http://evil.example\r\n\r\n"))
    assert opened.admits(memoryview(bytes(100_000)))  # the messages of the viewer

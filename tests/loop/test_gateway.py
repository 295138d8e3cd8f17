"""The gateway forwards bytes between its clients and a server, and refuses what the limits of a connection refuse."""

import json
import socket
import threading
import time
from contextlib import ExitStack, contextmanager, suppress

import pytest

import rso_lidar as rl
from rso_lidar.loop import gateway
from rso_lidar.loop.gateway import Gateway


class NoBang:
    """Limits that refuse an exclamation mark."""

    refusal = b"no"

    def admits(self, data):
        return b"!" not in bytes(data)

    def note_answer(self):
        pass


@contextmanager
def open_gateway(serve):
    """Yield the port of a gateway to a server, which handles each of its connections by a function in a thread."""
    with socket.create_server(("127.0.0.1", 0)) as listener, ExitStack() as ended:
        threads = []

        def handle(plug):
            with plug, suppress(OSError):
                serve(plug)

        def accept():
            with suppress(OSError):
                while True:
                    threads.append(threading.Thread(target=handle, args=listener.accept()[:1]))
                    threads[-1].start()

        threads.append(threading.Thread(target=accept))
        threads[0].start()
        ended.callback(lambda: [thread.join(10) for thread in threads])
        ended.callback(listener.shutdown, socket.SHUT_RDWR)  # ends the thread that accepts
        with Gateway() as made:
            public = made.open("tcp://127.0.0.1:0", f"tcp://127.0.0.1:{listener.getsockname()[1]}", NoBang)
            made.start()
            yield int(public.rpartition(":")[2])


def connect(port):
    return socket.create_connection(("127.0.0.1", port), timeout=10)


def echo(plug):
    """Send back what comes, until nothing does."""
    while data := plug.recv(65_536):
        plug.sendall(data)


def test_bytes_go_both_ways_and_refused_ones_do_not_arrive():
    arrived = []

    def keep(plug):
        while data := plug.recv(65_536):
            arrived.append(data)
            plug.sendall(data.upper())
        arrived.append(b"end")

    with open_gateway(keep) as port, connect(port) as client:
        client.sendall(b"a")
        assert client.recv(10) == b"A"
        client.sendall(b"b!")
        assert client.recv(10) == b"no"
        assert client.recv(10) == b""
        end_s = time.monotonic() + 10
        while arrived[-1] != b"end" and time.monotonic() < end_s:
            time.sleep(0.01)
    assert arrived == [b"a", b"end"]


def test_a_slow_reader_receives_every_byte_also_after_the_server_has_ended():
    sent = bytes(range(251)) * 80_000  # 20 MB: more than the buffers of the kernel hold

    def send(plug):
        plug.sendall(sent)

    with open_gateway(send) as port, connect(port) as client:
        time.sleep(0.2)
        parts = []
        while data := client.recv(2**20):
            parts.append(data)
    assert b"".join(parts) == sent


def test_connections_beyond_the_limit_wait_until_one_ends(monkeypatch):
    monkeypatch.setattr(gateway, "_MOST_CONNECTIONS", 2)
    with open_gateway(echo) as port, connect(port) as first, connect(port) as second:
        for client in (first, second):
            client.sendall(b"a")
            assert client.recv(10) == b"a"
        with connect(port) as late:
            late.sendall(b"b")
            late.settimeout(0.2)
            with pytest.raises(TimeoutError):
                late.recv(10)
            second.sendall(b"c")
            assert second.recv(10) == b"c"  # who is connected is served
            first.close()
            late.settimeout(10)
            assert late.recv(10) == b"b"


def test_a_gateway_without_descriptors_waits_and_tries_again(monkeypatch):
    monkeypatch.setattr(gateway, "_RETRY_S", 0.3)
    tried_s = []
    make = gateway._connect

    def fail_once(backend):
        tried_s.append(time.monotonic())
        if len(tried_s) == 1:
            raise OSError(24, "Too many open files")
        return make(backend)

    monkeypatch.setattr(gateway, "_connect", fail_once)
    with open_gateway(echo) as port:
        with connect(port) as dropped:
            assert dropped.recv(10) == b""
        with connect(port) as client:
            client.sendall(b"a")
            assert client.recv(10) == b"a"
    assert len(tried_s) == 2
    assert tried_s[1] - tried_s[0] >= 0.3


def test_a_socket_file_is_reused_and_another_file_is_kept(tmp_path):
    zmq = pytest.importorskip("zmq", reason="pyzmq is not installed: the extra 'loop'")
    if not zmq.has("ipc"):
        pytest.skip("this libzmq has no ipc")
    path = tmp_path / "lidar"
    path.write_text("notes")
    with Gateway() as made, pytest.raises(OSError, match="in use"):
        made.open(f"ipc://{path}", "", NoBang)
    assert path.read_text() == "notes"
    path.unlink()
    with socket.socket(socket.AF_UNIX) as killed:
        killed.bind(str(path))
    from tests.loop.service.serving import EXAMPLES, SMALL

    session = rl.loop.Session(rl.Simulation(rl.Scenario.load(EXAMPLES / "closed_loop.toml", settings=SMALL), threads=1))
    with rl.loop.Server(session, f"ipc://{path}") as served:
        assert served.endpoint == f"ipc://{path}"
        with zmq.Context() as context, context.socket(zmq.REQ) as plug:
            plug.setsockopt(zmq.LINGER, 0)
            plug.connect(served.endpoint)
            plug.send(b'{"request": "hello", "version": 1}')
            served.run(lambda: bool(plug.poll(100)))
            assert json.loads(plug.recv_multipart()[0])["ok"]
    assert not path.exists()

"""A gateway before the sockets of a server: it forwards bytes, and closes the connection of a client that sends too much.

The libraries that serve flight software and viewers read what a client sends before anything here can. The gateway shows
every byte to the limits of its connection first.
"""

from __future__ import annotations

import selectors
import socket
import stat
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol, Self

_MOST_CONNECTIONS = 128  # to one socket, with three descriptors each
_CHUNK = 2**16  # bytes read at a time: other connections wait for as long as it takes to count them
_RETRY_S = 1.0  # after which a connection is accepted again, where descriptors were missing
_ENDS_S = 1.0  # to send the last replies


class Limits(Protocol):
    """Limits on what one client sends."""

    refusal: bytes  # is sent to a client before its connection is closed

    def admits(self, data: memoryview) -> bool:
        """Count the next bytes of the client, and return whether the server may have them."""

    def note_answer(self) -> None:
        """Count anew: the server has answered."""


@dataclass(eq=False)
class _Listener:
    """A public address, and the private one to which its clients are connected."""

    socket: socket.socket
    backend: str
    make_limits: Callable[[], Limits]
    count: int = 0
    is_watched: bool = False
    rests_until_s: float = 0.0


@dataclass(eq=False)
class _Connection:
    """The sockets of a client and of its counterpart in the server, and the bytes that wait to be sent to each."""

    listener: _Listener
    sockets: tuple[socket.socket, socket.socket]  # of the client and of the server
    limits: Limits
    waiting: list[bytes] = field(default_factory=lambda: [b"", b""])
    watched: list[int] = field(default_factory=lambda: [0, 0])  # events of each socket
    ends: bool = False  # one side has ended; what waits is still sent


class Gateway:
    """Forwards connections from public addresses to private ones, in a thread; a context manager."""

    def __init__(self) -> None:
        self._selector = selectors.DefaultSelector()
        self._listeners: list[_Listener] = []
        self._connections: set[_Connection] = set()
        self._buffer = memoryview(bytearray(_CHUNK))
        self._wakes, self._wake = socket.socketpair()
        self._selector.register(self._wakes, selectors.EVENT_READ)
        self._thread = threading.Thread(target=self._run, name="gateway", daemon=True)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        """End, after the last bytes of the server have been sent."""
        self._wake.close()
        if self._thread.ident is not None:
            self._thread.join()
        for listener in self._listeners:
            name = listener.socket.getsockname()
            listener.socket.close()
            if isinstance(name, str):
                Path(name).unlink(missing_ok=True)
        self._wakes.close()
        self._selector.close()

    def open(self, public: str, backend: str, make_limits: Callable[[], Limits]) -> str:
        """Open a public address, and return it with the number of its port; before `start`.

        Parameters
        ----------
        public : such as ``tcp://127.0.0.1:5571``, with a numeric host and port 0 for a free one, or ``ipc://lidar``

        Raises
        ------
        OSError
            If the address cannot be used.
        """
        scheme, _, place = public.partition("://")
        if scheme == "ipc":
            plug = socket.socket(socket.AF_UNIX)
            try:
                if Path(place).exists() and stat.S_ISSOCK(Path(place).stat().st_mode):  # a killed server leaves it
                    Path(place).unlink()
                plug.bind(place)
                plug.listen(_MOST_CONNECTIONS)
            except OSError:
                plug.close()
                raise
            bound = public
        else:
            host, _, port = place.rpartition(":")
            family = socket.AF_INET6 if "[" in host else socket.AF_INET
            is_dual = host == "[::]" and socket.has_dualstack_ipv6()  # as libzmq does
            plug = socket.create_server(
                (host.strip("[]"), int(port)), family=family, backlog=_MOST_CONNECTIONS, dualstack_ipv6=is_dual
            )
            bound = f"tcp://{host}:{plug.getsockname()[1]}"
        plug.setblocking(False)
        self._listeners.append(_Listener(plug, backend, make_limits))
        return bound

    def start(self) -> None:
        """Start to forward."""
        self._thread.start()

    # ------------------------------------------------------------------------------------------------- the thread

    def _run(self) -> None:
        is_open = True
        while is_open:
            now_s = time.monotonic()
            for listener in self._listeners:
                has_room = listener.count < _MOST_CONNECTIONS and now_s >= listener.rests_until_s
                if has_room and not listener.is_watched:
                    self._selector.register(listener.socket, selectors.EVENT_READ, listener)
                    listener.is_watched = True
            is_open = self._forward(_RETRY_S)
        end_s = time.monotonic() + _ENDS_S
        self._selector.unregister(self._wakes)
        for listener in self._listeners:
            self._leave_alone(listener)
        while self._connections and time.monotonic() < end_s:  # until the server's last bytes have been sent
            self._forward(end_s - time.monotonic())
        for connection in tuple(self._connections):
            self._close(connection)

    def _forward(self, timeout_s: float) -> bool:
        """Wait for events and handle them; return whether the gateway is to go on.

        Parameters
        ----------
        timeout_s : longest wait [s]
        """
        goes_on = True
        for key, events in self._selector.select(max(timeout_s, 0.0)):
            if key.data is None:
                goes_on = False
            elif isinstance(key.data, _Listener):
                self._accept(key.data)
            else:
                connection, side = key.data
                if connection in self._connections:
                    self._move(connection, side, events)
        return goes_on

    def _leave_alone(self, listener: _Listener, rest_s: float = 0.0) -> None:
        """Accept no more connections for the present; they wait in the kernel."""
        listener.rests_until_s = time.monotonic() + rest_s
        if listener.is_watched:
            self._selector.unregister(listener.socket)
            listener.is_watched = False

    def _accept(self, listener: _Listener) -> None:
        """Accept a connection, and connect it to the server."""
        try:
            client = listener.socket.accept()[0]
        except (BlockingIOError, ConnectionError):  # who has gone meanwhile
            return
        except OSError:  # no descriptor is left
            self._leave_alone(listener, _RETRY_S)
            return
        try:
            server = _connect(listener.backend)
        except OSError:
            client.close()
            self._leave_alone(listener, _RETRY_S)
            return
        for plug in (client, server):
            plug.setblocking(False)
            if plug.family in (socket.AF_INET, socket.AF_INET6):
                plug.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                _keep_alive(plug)
        connection = _Connection(listener, (client, server), listener.make_limits())
        self._connections.add(connection)
        listener.count += 1
        self._watch(connection)
        if listener.count >= _MOST_CONNECTIONS:
            self._leave_alone(listener)

    def _move(self, connection: _Connection, side: int, events: int) -> None:
        """Send what waits for one side of a connection, and forward what comes from it.

        Parameters
        ----------
        connection, side : the connection, and the number of its socket: 0 is the client, 1 the server
        events : of that socket, flags of `selectors`
        """
        try:
            if events & selectors.EVENT_WRITE:
                sent = connection.sockets[side].send(connection.waiting[side])
                connection.waiting[side] = connection.waiting[side][sent:]
            if events & selectors.EVENT_READ:
                self._forward_from(connection, side)
        except BlockingIOError:
            pass
        except OSError:  # a reset, or the other side has gone
            self._close(connection)
            return
        if connection.ends and not any(connection.waiting):
            self._close(connection)
        elif connection in self._connections:
            self._watch(connection)

    def _forward_from(self, connection: _Connection, side: int) -> None:
        """Read from one side, and send to the other as much as it takes; the rest waits.

        Parameters
        ----------
        connection, side : the connection, and the socket that is read (0: the client's, 1: the library's)
        """
        count = connection.sockets[side].recv_into(self._buffer)
        if not count:
            connection.ends = True
            connection.waiting[side] = b""
            return
        data = self._buffer[:count]
        if side == 0 and not connection.limits.admits(data):
            with suppress(OSError):
                connection.sockets[0].send(connection.limits.refusal)
            self._close(connection)
            return
        if side == 1:
            connection.limits.note_answer()
        try:
            sent = connection.sockets[1 - side].send(data)
        except BlockingIOError:
            sent = 0
        connection.waiting[1 - side] = bytes(data[sent:])

    def _watch(self, connection: _Connection) -> None:
        """Wait for bytes from each side whose last ones were sent, and for room for those that wait."""
        for side, plug in enumerate(connection.sockets):
            reads = not connection.ends and not connection.waiting[1 - side]
            events = reads * selectors.EVENT_READ | bool(connection.waiting[side]) * selectors.EVENT_WRITE
            if events == connection.watched[side]:
                continue
            if not connection.watched[side]:
                self._selector.register(plug, events, (connection, side))
            elif not events:
                self._selector.unregister(plug)
            else:
                self._selector.modify(plug, events, (connection, side))
            connection.watched[side] = events

    def _close(self, connection: _Connection) -> None:
        """Close both sockets of a connection."""
        if connection not in self._connections:
            return
        self._connections.remove(connection)
        connection.listener.count -= 1
        for side, plug in enumerate(connection.sockets):
            if connection.watched[side]:
                self._selector.unregister(plug)
            plug.close()


def _connect(backend: str) -> socket.socket:
    """Return a connection to a private address, whose host is a number."""
    scheme, _, place = backend.partition("://")
    host, _, port = place.rpartition(":")
    plug = socket.socket(socket.AF_INET if scheme == "tcp" else socket.AF_UNIX)
    try:
        plug.settimeout(1.0)
        plug.connect((host, int(port)) if scheme == "tcp" else place)
    except OSError:
        plug.close()
        raise
    return plug


def _keep_alive(plug: socket.socket) -> None:
    """Let the kernel look for clients that have vanished; it answers for a process that is stopped in a debugger, too."""
    plug.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    for name, value in (("TCP_KEEPIDLE", 10), ("TCP_KEEPINTVL", 5), ("TCP_KEEPCNT", 3)):
        if hasattr(socket, name):
            plug.setsockopt(socket.IPPROTO_TCP, getattr(socket, name), value)

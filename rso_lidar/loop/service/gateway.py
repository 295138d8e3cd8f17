"""A gateway before the sockets of a server: it forwards bytes, and closes the connection of a client that sends too much.

libzmq limits the size of one part of a message (ZMQ_MAXMSGSIZE), and keeps a message in memory until its last part has
arrived. It does not limit the number of parts, so that a client which never ends its message would use up the memory. The
gateway reads the headers of the frames (ZMTP 3, rfc.zeromq.org/spec/23) before libzmq does.
"""

from __future__ import annotations

import selectors
import socket
import stat
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Self

MOST_REQUEST_BYTES = 65_536  # of a header
MOST_PARTS = 16  # of a message, with the envelope of proxies
_MOST_MESSAGE_BYTES = MOST_REQUEST_BYTES + 1_024  # with the envelope
MOST_SUBSCRIPTIONS = 1_024  # sent over one connection to the stream
# Encryption hides the ends of messages. A client can fill the queue of the server and the buffers of the kernel, which hold
# less, before the server answers it.
_MOST_UNANSWERED_FRAMES, _MOST_UNANSWERED_BYTES = 10_000, 8 * 2**20
_MOST_CONNECTIONS = 128  # to one socket, with three descriptors each
_CHUNK = 2**18  # bytes read at a time
_RETRY_S = 1.0  # after which a connection is accepted again, where descriptors were missing
_ENDS_S = 1.0  # to send the last replies
_GREETING_BYTES = 64
_MORE, _LONG, _COMMAND = 1, 2, 4  # flags of a frame


class FrameLimits:
    """Limits on what one client sends: the frames of a connection are counted as they arrive.

    Parameters
    ----------
    is_curve : whether the connection is encrypted, so that the ends of messages cannot be seen.
    is_stream : whether the client subscribes, and sends subscriptions only.
    """

    def __init__(self, *, is_curve: bool = False, is_stream: bool = False) -> None:
        mechanism = (b"CURVE" if is_curve else b"NULL").ljust(20, b"\0")
        self._greeting = {0: 0xFF, 9: 0x7F, **{12 + k: byte for k, byte in enumerate(mechanism)}}
        self._is_curve, self._is_stream = is_curve, is_stream
        self._greeted = 0  # bytes of the greeting so far
        self._header = bytearray()  # of a frame, until it is complete
        self._left = 0  # bytes of the present frame that are still to come
        self._parts = self._bytes = 0  # of the present message, or since the last answer
        self._subscriptions = 0

    def admits(self, data: memoryview) -> bool:
        """Count the next bytes, and return whether they are within the limits.

        Parameters
        ----------
        data : from the client.
        """
        at = min(len(data), _GREETING_BYTES - self._greeted)
        if at and not self._admits_greeting(data[:at]):
            return False
        while at < len(data):
            if self._left:
                step = min(self._left, len(data) - at)
                self._left -= step
                at += step
                continue
            self._header.append(data[at])
            at += 1
            flags = self._header[0]
            size_end = 9 if flags & _LONG else 2
            if len(self._header) < size_end + bool(flags & _COMMAND):  # the name of a command begins with its length
                continue
            if not self._admits_frame(flags, int.from_bytes(self._header[1:size_end]), self._header[-1]):
                return False
            self._header.clear()
        return True

    def note_answer(self) -> None:
        """Count anew: the server has answered."""
        if self._is_curve:
            self._parts = self._bytes = 0

    def _admits_greeting(self, data: memoryview) -> bool:
        for byte in data:
            if self._greeting.get(self._greeted, byte) != byte or (self._greeted == 10 and byte < 3):
                return False  # other mechanisms, and ZMTP before version 3, whose frames differ
            self._greeted += 1
        return True

    def _admits_frame(self, flags: int, size: int, name_length: int) -> bool:
        """Count a frame, and return whether it is within the limits.

        Parameters
        ----------
        flags, size : of its header.
        name_length : first byte of a command.
        """
        is_command = bool(flags & _COMMAND)
        if flags > 7 or size > MOST_REQUEST_BYTES or (is_command and (flags & _MORE or not size)):
            return False
        self._left = size - is_command
        if self._is_stream and not self._is_curve and not (is_command and name_length == 4):  # PING and PONG are free
            self._subscriptions += 1
            if self._subscriptions > MOST_SUBSCRIPTIONS + 1:  # and READY
                return False
        if self._is_curve:
            self._parts += 1
            self._bytes += size
            return self._parts <= _MOST_UNANSWERED_FRAMES and self._bytes <= _MOST_UNANSWERED_BYTES
        if is_command:  # libzmq can take one between the parts of a message
            return True
        self._parts += 1
        self._bytes += size
        if self._parts > MOST_PARTS or self._bytes > _MOST_MESSAGE_BYTES:
            return False
        if not flags & _MORE:
            self._parts = self._bytes = 0
        return True


@dataclass(eq=False)
class _Listener:
    """A public address, and the private one to which its clients are connected."""

    socket: socket.socket
    backend: str
    make_limits: Callable[[], FrameLimits]
    count: int = 0
    is_watched: bool = False


@dataclass(eq=False)
class _Connection:
    """The sockets of a client and of its counterpart in the server, and the bytes that wait to be sent to each."""

    listener: _Listener
    sockets: tuple[socket.socket, socket.socket]  # of the client and of the server
    limits: FrameLimits
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

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
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

    def open(self, public: str, backend: str, make_limits: Callable[[], FrameLimits]) -> str:
        """Open a public address, and return it with the number of its port; before `start`.

        Parameters
        ----------
        public : such as ``tcp://127.0.0.1:5571``, with a numeric host and port 0 for a free one, or ``ipc://lidar``.
        backend : of the socket of the server.
        make_limits : makes the limits of one connection.

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
            plug = socket.create_server((host.strip("[]"), int(port)), family=family, backlog=_MOST_CONNECTIONS)
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
            for listener in self._listeners:
                if not listener.is_watched and listener.count < _MOST_CONNECTIONS:
                    self._selector.register(listener.socket, selectors.EVENT_READ, listener)
                    listener.is_watched = True
            is_open = self._forward(_RETRY_S)
        end_s = time.monotonic() + _ENDS_S
        self._selector.unregister(self._wakes)
        for listener in self._listeners:
            self._leave_alone(listener)
        while (
            self._connections and time.monotonic() < end_s
        ):  # until libzmq and then the gateway have sent their last bytes
            self._forward(end_s - time.monotonic())
        for connection in tuple(self._connections):
            self._close(connection)

    def _forward(self, timeout_s: float) -> bool:
        """Wait for events and handle them; return whether the gateway is to go on.

        Parameters
        ----------
        timeout_s : longest wait [s].
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

    def _leave_alone(self, listener: _Listener) -> None:
        """Accept no more connections for the present; they wait in the kernel."""
        if listener.is_watched:
            self._selector.unregister(listener.socket)
            listener.is_watched = False

    def _accept(self, listener: _Listener) -> None:
        """Accept a connection, and connect it to the server."""
        try:
            client = listener.socket.accept()[0]
        except BlockingIOError:
            return
        except OSError:  # no descriptor is left
            self._leave_alone(listener)
            return
        try:
            server = _connect(listener.backend)
        except OSError:
            client.close()
            self._leave_alone(listener)
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
        connection, side : the connection, and the number of its socket: 0 is the client, 1 the server.
        events : of that socket.
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
        connection, side : the connection, and the number of the socket that is read.
        """
        count = connection.sockets[side].recv_into(self._buffer)
        if not count:
            connection.ends = True
            connection.waiting[side] = b""
            return
        data = self._buffer[:count]
        if side == 0 and not connection.limits.admits(data):
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
    """Return a connection to a private address."""
    scheme, _, place = backend.partition("://")
    if scheme == "tcp":
        host, _, port = place.rpartition(":")
        return socket.create_connection((host, int(port)), timeout=1.0)
    plug = socket.socket(socket.AF_UNIX)
    try:
        plug.settimeout(1.0)
        plug.connect(place)
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

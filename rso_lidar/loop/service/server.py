"""The server: sockets around a session, one driver at a time, deadlines of the wall clock, and a stream of readings."""

from __future__ import annotations

import socket
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from tempfile import TemporaryDirectory
from typing import Any, Self

from rso_lidar.errors import RsoLidarError, RunError, ScenarioError
from rso_lidar.loop.gateway import Gateway
from rso_lidar.loop.service.deadlines import Deadlines
from rso_lidar.loop.service.endpoints import Security, import_zmq, load_keys, resolve_host
from rso_lidar.loop.service.frame_limits import MOST_REQUEST_BYTES, FrameLimits
from rso_lidar.loop.service.multipart import receive_parts, send_parts
from rso_lidar.loop.service.peers import Peers, RefusalError
from rso_lidar.loop.service.requests import HelloRequest, Request, find_sequence, parse_request
from rso_lidar.loop.service.session import Answer, Session
from rso_lidar.loop.service.struct_head import encode_struct
from rso_lidar.loop.service.wire_format import WireArray, encode

_WAITING = 16  # messages queued for one client; a slow reader of the stream loses further ones
_POLL_S = 0.1  # within which a signal is noticed
_SLEEP_S = 0.002  # last part of a wait, for which polling is too coarse
_LINGER_MS = 500  # to send the last reply
_HANDSHAKE_MS = 10_000  # after which libzmq closes the connection of a client that has not introduced itself


@dataclass
class _Due:
    """A reply that is ready and waits for its deadline."""

    due_s: float
    envelope: list[bytes]
    parts: list[Any]
    published: list[list[Any]]  # messages of the stream


class Server:
    """Serves a session on a request socket and, where asked for, a stream of readings; a context manager.

    Parameters
    ----------
    session : answers the requests
    bind : address of the request socket

    Other Parameters
    ----------------
    publish : address of the stream; None for none
    security : who may connect
    deadlines : deadlines of the wall clock; None for lock-step as fast as it goes
    log : prints a line of the log
    """

    def __init__(
        self,
        session: Session,
        bind: str = "tcp://127.0.0.1:5571",
        *,
        publish: str | None = None,
        security: Security | None = None,
        deadlines: Deadlines | None = None,
        log: Callable[[str], None] = lambda line: None,
    ) -> None:
        self._session, self._deadlines = session, deadlines
        self._security = security or Security()
        self._security.check("--bind", bind)
        if publish is not None:
            self._security.check("--publish", publish, is_stream=True)
        self._bind, self._publish = bind, publish
        self._zmq = import_zmq("serve")
        self._open = ExitStack()
        self._peers = Peers(self._security, tuple(session.cameras), log)
        self._due: _Due | None = None
        self._sequence = self._published = 0
        self.endpoint, self.stream = bind, publish  # as bound, with the numbers of ports
        self._timeout_ms = -1  # of the request socket
        self._is_done = False

    def __enter__(self) -> Self:
        with ExitStack() as undone:
            gateway = undone.enter_context(Gateway())
            folder = undone.enter_context(TemporaryDirectory(prefix="rso-lidar-"))  # which only this user can enter
            context = undone.enter_context(self._zmq.Context())
            context.set(self._zmq.MAX_SOCKETS, 64)
            self._authenticate(context, undone)
            self._requests = self._make_socket(context, undone, self._zmq.ROUTER)
            self._requests.set(self._zmq.ROUTER_MANDATORY, 1)  # a reply to a client that has disconnected is an error
            self._monitor = self._requests.get_monitor_socket(self._zmq.Event.DISCONNECTED)
            undone.enter_context(self._monitor)
            undone.callback(self._requests.disable_monitor)
            self.endpoint = self._bind_socket(gateway, self._requests, folder, "--bind", self._bind)
            self._stream: Any = None
            if self._publish is not None:
                self._stream = self._make_socket(context, undone, self._zmq.PUB)
                self.stream = self._bind_socket(gateway, self._stream, folder, "--publish", self._publish)
            gateway.start()
            self._open = undone.pop_all()
        return self

    def __exit__(self, *error: object) -> None:
        self._open.close()

    def _authenticate(self, context: Any, undone: ExitStack) -> None:
        """Accept only clients with known CURVE keys, where keys are given."""
        if self._security.client_keys is None:
            return
        from zmq.auth.thread import ThreadAuthenticator

        if not self._security.client_keys.is_dir():
            raise ScenarioError(
                f"--curve-clients {self._security.client_keys}: is no folder; name that of the .key files"
            )
        authenticator = ThreadAuthenticator(context)
        authenticator.start()
        undone.callback(authenticator.stop)
        try:
            authenticator.configure_curve(domain="*", location=str(self._security.client_keys))
        except (OSError, ValueError) as failure:
            raise ScenarioError(
                f"--curve-clients {self._security.client_keys}: {failure}; mend the .key file"
            ) from None

    def _make_socket(self, context: Any, undone: ExitStack, kind: int) -> Any:
        """Make a socket of the server, with limits on the size of a part and on the number of messages that wait."""
        zmq = self._zmq
        zmq_socket = undone.enter_context(context.socket(kind))
        zmq_socket.setsockopt(zmq.MAXMSGSIZE, MOST_REQUEST_BYTES)
        zmq_socket.setsockopt(zmq.SNDHWM, _WAITING)
        zmq_socket.setsockopt(zmq.RCVHWM, _WAITING)
        zmq_socket.setsockopt(zmq.LINGER, _LINGER_MS)
        zmq_socket.setsockopt(zmq.HANDSHAKE_IVL, _HANDSHAKE_MS)
        if self._security.server_key is not None:
            zmq_socket.curve_publickey, zmq_socket.curve_secretkey = load_keys(self._security.server_key)
            zmq_socket.curve_server = True
        return zmq_socket

    def _bind_socket(self, gateway: Gateway, zmq_socket: Any, folder: str, option: str, endpoint: str) -> str:
        """Bind a socket to a private address behind the gateway, and return the public one.

        Parameters
        ----------
        gateway : the `Gateway` to the socket
        """
        has_ipc = self._zmq.has("ipc") and hasattr(socket, "AF_UNIX")
        zmq_socket.bind(f"ipc://{folder}/{option.strip('-')}" if has_ipc else "tcp://127.0.0.1:*")
        backend: str = zmq_socket.get(self._zmq.LAST_ENDPOINT).rstrip(b"\0").decode()
        is_stream = option == "--publish"
        is_curve = self._security.server_key is not None
        try:
            public = resolve_host(self._zmq, endpoint)
            return gateway.open(public, backend, lambda: FrameLimits(is_curve=is_curve, is_stream=is_stream))
        except (OSError, self._zmq.ZMQError) as error:
            raise ScenarioError(f"{option} {endpoint}: cannot be used ({error.strerror}); choose another") from None

    # ---------------------------------------------------------------------------------------------------- the loop

    def run(self, is_stopped: Callable[[], bool] = lambda: False) -> None:
        """Serve until a client shuts the server down.

        Parameters
        ----------
        is_stopped : asked ten times a second whether to end

        Raises
        ------
        RunError
            If a deadline was missed under the policy ``fail``, or a recording cannot be written.
        """
        while not self._is_done and not is_stopped():
            self._receive(self._find_timeout_ms())
            self._send_due()
        if self._stream is not None:
            self._publish_event("shutdown")

    def _find_timeout_ms(self) -> int:
        left_s = _POLL_S if self._due is None else min(_POLL_S, self._due.due_s - time.monotonic() - _SLEEP_S)
        return max(0, int(left_s * 1e3))

    def _send_due(self) -> None:
        """Send the reply that waits, if its time has come."""
        if self._due is None:
            return
        left_s = self._due.due_s - time.monotonic()
        if left_s > _SLEEP_S:
            return
        if left_s > 0.0:
            time.sleep(left_s)
        due, self._due = self._due, None
        self._send(due.envelope, due.parts)
        for message in due.published:
            self._published += 1
            send_parts(self._stream, message)

    def _note_disconnections(self) -> None:
        """Remove the clients whose connections have ended."""
        from zmq.utils.monitor import recv_monitor_message

        while self._monitor.poll(0):
            connection = int(recv_monitor_message(self._monitor)["value"])
            for identity in self._peers.find(connection):
                self._remove(identity, "has disconnected")

    def _remove(self, identity: bytes, reason: str) -> None:
        """Remove a client, and the reply that waits for it."""
        if self._due is not None and self._due.envelope[0] == identity:
            self._due = None
        self._peers.remove(identity, reason)

    # ------------------------------------------------------------------------------------------------ one request

    def _receive(self, timeout_ms: int) -> None:
        """Wait for one message and answer it."""
        if timeout_ms != self._timeout_ms:
            self._requests.setsockopt(self._zmq.RCVTIMEO, timeout_ms)
            self._timeout_ms = timeout_ms
        try:
            frames = receive_parts(self._requests)
        except self._zmq.Again:
            self._note_disconnections()
            return
        asked_s = time.monotonic()
        parts = [frame.bytes for frame in frames]
        # A request socket sends an empty part before the request; what is before it goes back with the reply.
        split = parts.index(b"", 1) + 1 if b"" in parts[1:] else 1
        envelope, body = parts[:split], parts[split:]
        sequence = 0
        try:
            if len(body) != 1:
                raise RefusalError(
                    "bad_request", f"request: has {len(body)} parts and not 1; send an empty part and the header"
                )
            request = parse_request(body[0])
            sequence = request.sequence
            if isinstance(request, HelloRequest):
                self._note_disconnections()  # libzmq reports a disconnection before it uses the socket's number again
            self._peers.admit(envelope[0], frames[-1].get(self._zmq.SRCFD), request)
            if self._due is not None and self._due.envelope[0] == envelope[0]:
                raise RefusalError("busy", f"{request.request}: comes before the reply to the one before; wait for it")
            self._answer(envelope, request, asked_s)
        except RefusalError as refusal:
            self._refuse(envelope, sequence, refusal.code, str(refusal))
        except RunError as error:
            self._refuse(envelope, sequence, "failed", str(error))
            raise
        except RsoLidarError as error:
            self._refuse(envelope, sequence or find_sequence(body[0]), "bad_request", str(error))

    def _answer(self, envelope: list[bytes], request: Request, asked_s: float) -> None:
        """Answer a request at once, or hold the answer until its deadline.

        Parameters
        ----------
        asked_s : when it arrived on the clock [s]
        """
        next_ns = self._session.linked.next_flash_ns
        skip = self._deadlines is not None and next_ns is not None and self._deadlines.has_passed(next_ns)
        answer = self._session.answer(request, skip=skip)
        due_s = asked_s
        if self._deadlines is not None and answer.is_step:
            due_s = self._deadlines.time_reply(self._session.linked.time_ns, asked_s, skipped=answer.is_skipped)
        if request.request in ("reset", "restore"):
            if self._deadlines is not None:
                self._deadlines.begin()
            self._publish_event(request.request)
        completed = replace(answer, header=self._complete(answer, request))
        own = completed.with_images(self._peers.find_cameras(envelope[0]))
        parts = self._encode(envelope, own.header, own.arrays)
        self._is_done = answer.ends
        if answer.is_step:
            is_published = answer.has_reading and self._stream is not None
            self._due = _Due(due_s, envelope, parts, _list_published(completed) if is_published else [])
        else:
            self._send(envelope, parts)

    def _encode(self, envelope: list[bytes], header: dict[str, Any], arrays: Sequence[WireArray] = ()) -> list[Any]:
        """Return the parts of a reply, with the head for which its client has asked."""
        return (encode_struct if self._peers.takes_structs(envelope[0]) else encode)(header, arrays)

    def _complete(self, answer: Answer, request: Request) -> dict[str, Any]:
        """Return the header of the reply to a request."""
        return {
            "reply": request.request,
            "ok": True,
            "sequence": self._count(),
            "request_sequence": request.sequence,
            "overruns": self._deadlines.overruns if self._deadlines else 0,
            **answer.header,
        }

    def _count(self) -> int:
        self._sequence += 1
        return self._sequence

    def _refuse(self, envelope: list[bytes], sequence: int, code: str, message: str) -> None:
        """Send an error reply."""
        sendable = message.encode(errors="backslashreplace").decode()  # a request can hold a lone surrogate
        error = {"code": code, "message": sendable}
        header = {
            "reply": "error",
            "ok": False,
            "sequence": self._count(),
            "request_sequence": sequence,
            "error": error,
        }
        self._send(envelope, self._encode(envelope, header))

    def _send(self, envelope: list[bytes], parts: list[Any]) -> None:
        """Send a reply; a client that has disconnected, or does not read, is removed."""
        try:
            send_parts(self._requests, [*envelope, *parts])
        except self._zmq.Again:
            self._remove(envelope[0], "does not read its replies")
        except self._zmq.ZMQError:  # EHOSTUNREACH
            self._remove(envelope[0], "has disconnected")

    def _publish_event(self, event: str) -> None:
        if self._stream is not None:
            self._published += 1
            header = {"event": event, "sequence": self._published}
            send_parts(self._stream, [b"event", *encode(header)])


def _list_published(answer: Answer) -> list[list[Any]]:
    """List the messages of the stream, in JSON whatever the driver takes: the reading, then the image of each camera."""
    messages = [[b"reading", *encode(answer.header, answer.arrays)]]
    bare = replace(answer, header=answer.header | {"records": {}}, arrays=[])
    for name in answer.images:
        image = bare.with_images([name])
        messages.append([f"camera/{name}".encode(), *encode(image.header, image.arrays)])
    return messages

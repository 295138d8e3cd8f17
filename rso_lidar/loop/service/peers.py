"""The clients of a server: their names and roles, and the requests that each may make."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from rso_lidar.errors import did_you_mean
from rso_lidar.loop.service.endpoints import Security
from rso_lidar.loop.service.requests import HelloRequest, Request

MOST_CLIENTS = 64
_FOR_OBSERVERS = ("hello", "describe", "observation", "truth")


class RefusalError(Exception):
    """A request that is refused; `code` is the reason for programs."""

    def __init__(self, code: str, message: str) -> None:
        super().__init__(message)
        self.code = code


@dataclass(frozen=True)
class _Peer:
    """A client that has sent hello."""

    name: str
    is_driver: bool
    connection: int  # number of its socket, by which libzmq reports the end of a connection
    takes_structs: bool  # as the heads of its replies; else JSON
    cameras: tuple[str, ...]  # whose images it takes


class Peers:
    """The clients that have sent hello, with one driver at a time.

    Parameters
    ----------
    security : who may connect
    cameras : names of those whose images can be served
    log : prints a line of the log
    """

    def __init__(self, security: Security, cameras: Sequence[str], log: Callable[[str], None]) -> None:
        self._security, self._cameras, self._log = security, tuple(cameras), log
        self._peers: dict[bytes, _Peer] = {}

    def admit(self, identity: bytes, connection: int, request: Request) -> None:
        """Check that a client may make a request, and register a client that sends hello.

        Raises
        ------
        RefusalError
            If it may not.
        """
        if isinstance(request, HelloRequest):
            self._register(identity, connection, request)
            return
        kind = request.request
        if (peer := self._peers.get(identity)) is None:
            raise RefusalError("no_session", f"{kind}: comes from a client that has not sent hello; send hello first")
        if not peer.is_driver and kind not in _FOR_OBSERVERS:
            raise RefusalError("forbidden", f"{kind}: is for the driver, and this client is an observer")

    def _register(self, identity: bytes, connection: int, request: HelloRequest) -> None:
        """Register a client as a driver or an observer."""
        if not self._security.accepts(request.token):
            raise RefusalError("forbidden", "hello: has no token, or a wrong one; give the token of the server")
        is_driver = request.role == "driver"
        drivers = [peer.name for key, peer in self._peers.items() if peer.is_driver and key != identity]
        if is_driver and drivers:
            raise RefusalError(
                "busy", f"hello: {drivers[0]!r} is the driver already; end it first, or connect as an observer"
            )
        if identity not in self._peers and len(self._peers) >= MOST_CLIENTS:
            raise RefusalError("busy", f"hello: {MOST_CLIENTS} clients are connected already; end one first")
        cameras = self._choose_cameras(request)
        self._peers[identity] = _Peer(request.client, is_driver, connection, request.head == "struct", cameras)
        self._log(f"client      {request.client} has connected as {request.role}")

    def _choose_cameras(self, request: HelloRequest) -> tuple[str, ...]:
        """Return the names of the cameras that a client asks for, in the order of the scenario."""
        if request.cameras == "all":
            return self._cameras
        for name in request.cameras:
            if name not in self._cameras:
                known = f"known: {', '.join(self._cameras)}" if self._cameras else "the scenario has none"
                raise RefusalError(
                    "bad_request", f"hello: cameras: no '{name:.60}'{did_you_mean(name, self._cameras)} ({known})"
                )
        return tuple(name for name in self._cameras if name in request.cameras)

    def find_cameras(self, identity: bytes) -> tuple[str, ...]:
        """Return the names of the cameras whose images a client takes."""
        peer = self._peers.get(identity)
        return () if peer is None else peer.cameras

    def takes_structs(self, identity: bytes) -> bool:
        """Return whether a client has asked for heads of structures."""
        peer = self._peers.get(identity)
        return peer is not None and peer.takes_structs

    def find(self, connection: int) -> list[bytes]:
        """Return the identities of the clients on a connection."""
        return [identity for identity, peer in self._peers.items() if peer.connection == connection]

    def remove(self, identity: bytes, reason: str) -> None:
        """Remove a client, if it is known."""
        if (peer := self._peers.pop(identity, None)) is not None:
            waits = "; the simulation waits for another" if peer.is_driver else ""
            self._log(f"client      {peer.name} {reason}{waits}")

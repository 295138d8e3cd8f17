"""A live view: a server that shows frames to viewers of the Foxglove protocol while they are made.

A viewer that joins late receives the meshes and the latest frame at once.
"""

from __future__ import annotations

import re
import secrets
import socket
from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from rso_lidar.errors import RecordingError, ScenarioError, warn
from rso_lidar.export import list_cameras
from rso_lidar.loop.gateway import Gateway
from rso_lidar.loop.live.frame_messages import (
    IMAGE,
    PTU_SCHEMA,
    TARGETS,
    WRITERS,
    list_camera_writers,
    stamp_of,
    write_targets,
)
from rso_lidar.loop.live.queued_view import QueuedView
from rso_lidar.loop.network_address import parse_address, require_loopback
from rso_lidar.picture import Shape
from rso_lidar.records import Frame
from rso_lidar.scenario import Scenario

DEFAULT_ADDRESS = "127.0.0.1:8765"  # the port of the Foxglove protocol
_MESSAGES = 64  # that wait for one viewer in the library, which drops the oldest of more
_MOST_REPORTED = 16  # origins of refused pages
# Foxglove in a browser; Lichtblick and Foxglove as desktop programs, whose page is a file of theirs
_VIEWER_ORIGINS = ("https://app.foxglove.dev", "file://")
_MOST_HEAD_BYTES = 16_384  # of the request that opens a connection
_DEFAULT_PORTS = {"http": ":80", "https": ":443"}  # which browsers leave out


class LiveView(QueuedView):
    """A server for viewers of the Foxglove protocol, such as Lichtblick and Foxglove; a context manager.

    >>> with LiveView(scenario) as view:  # doctest: +SKIP
    ...     for frame in rl.simulate(scenario):
    ...         view.show(frame)

    Only this machine can connect, because the protocol does not ask who does. Of the pages in its browsers, only those of
    the viewers and of `origins` can. Viewers can watch, and change nothing.
    """

    def __init__(
        self,
        scenario: Scenario,
        address: str = DEFAULT_ADDRESS,
        *,
        shapes: Sequence[Shape] | None = None,
        origins: Sequence[str] = (),
        log: Callable[[str], None] = lambda line: None,
    ) -> None:
        """Open the server.

        Parameters
        ----------
        scenario : that is flown, with the meshes of its targets
        address : ``HOST:PORT`` of the server, a loopback address; port 0 takes a free one
        shapes : meshes to show (None: those of the scenario)
        origins : of further web pages that may watch, such as ``http://localhost:8080``
        log : prints a line about a page that was refused

        Raises
        ------
        ScenarioError
            For an address of another kind, for one that is in use, and for what is no origin.
        RecordingError
            Where the library is missing, which is an extra.
        """
        where = "live view:"
        asked = parse_address(address, where)
        require_loopback(asked, where, "the live view")
        self._origins = {*_VIEWER_ORIGINS, *map(parse_origin, origins)}
        self._refused: set[str] = set()
        self._log = log
        fox = _import_foxglove()
        super().__init__()
        if shapes is None:
            shapes = [Shape(surface.name, surface.corners) for surface in scenario.surfaces]
        self._shapes = tuple(shapes)
        cameras = list_cameras(Path("live view"), scenario.source.scenario) if scenario.camera else []
        of_cameras = list_camera_writers(cameras)
        self._writers = WRITERS | of_cameras
        self._latest: Frame | None = None
        self._targets: Any = None
        self._context = context = fox.Context()  # channels are advertised only while it lives
        with ExitStack() as undone:
            gateway = undone.enter_context(Gateway())
            private = _find_private_host()
            try:
                server = fox.start_server(
                    name=scenario.name,
                    host=private,
                    port=0,
                    capabilities=[fox.Capability.Time],
                    server_listener=_make_listener(self),
                    context=context,
                    message_backlog_size=_MESSAGES,
                )
                undone.callback(server.stop)
                url = gateway.open(
                    f"tcp://{asked.text}", f"tcp://{private}:{server.port}", lambda: HandshakeCheck(self._accepts)
                )
            except (RuntimeError, OSError, ValueError) as error:
                reason = getattr(error, "strerror", None) or " ".join(str(error).split())
                raise ScenarioError(
                    f"live view: {asked.text}: cannot be opened ({reason}); choose another port"
                ) from None
            gateway.start()
            self._open = undone.pop_all()
        self.address = parse_address(url.removeprefix("tcp://"), where)
        self._broadcast_time = server.broadcast_time
        self._channels = _make_channels(context, of_cameras, has_ptu=scenario.ptu is not None)
        self._start()

    @property
    def url(self) -> str:
        """Address for the viewer, such as ``ws://127.0.0.1:8765``."""
        return f"ws://{self.address.text}"

    def _stop(self) -> None:
        """Close the server."""
        for channel in self._channels.values():
            channel.close()
        self._open.close()

    def _accepts(self, origin: str) -> bool:
        """Return whether a page may watch, and report the first refusal of each origin."""
        if origin in self._origins:
            return True
        if origin not in self._refused and len(self._refused) < _MOST_REPORTED:
            self._refused.add(origin)
            self._log(f"live view   refused a web page of {origin!r:.80}; --live-origin allows an origin")
        return False

    def _publish(self, frame: Frame) -> None:
        """Publish one frame to all viewers that subscribe to a topic of it."""
        first, self._latest = self._latest is None, frame
        self._broadcast_time(stamp_of(frame))
        for topic, channel in self._channels.items():
            if channel.has_sinks() and (topic != TARGETS or first):
                self._send(topic, frame)

    def _send(self, topic: str, frame: Frame, client: int | None = None) -> None:
        """Send the message of a topic.

        Parameters
        ----------
        client : number of the only viewer that receives it (None: all)
        """
        if topic == TARGETS:
            self._targets = message = self._targets or write_targets(frame, self._shapes)
        else:
            message = self._writers[topic](frame)
        if message is not None:
            self._channels[topic].log(message, log_time=stamp_of(frame), sink_id=client)

    def resend(self, topic: str, client: int) -> None:
        """Send the latest message of a topic to a viewer that has just subscribed to it.

        Parameters
        ----------
        topic, client : the topic, and the number of the viewer
        """
        frame = self._latest
        if frame is not None and topic in self._channels:
            self._send(topic, frame, client)


def _make_listener(view: LiveView) -> Any:
    """Return a listener of the server that sends the latest messages to viewers that subscribe."""
    from foxglove.websocket import ServerListener

    class Subscriptions(ServerListener):
        def on_subscribe(self, client: Any, channel: Any) -> None:
            try:
                view.resend(channel.topic, client.id)
            except Exception as error:  # the library would print a traceback
                warn(f"live view: {channel.topic} could not be sent again ({' '.join(str(error).split()):.120})")

    return Subscriptions()


def _import_foxglove() -> Any:
    """Import the library of the protocol, which is an extra."""
    try:
        import foxglove
    except ImportError:
        raise RecordingError(
            "live view: the Foxglove library is an extra: pip install rso-lidar[live], or leave the live view out"
        ) from None
    return foxglove


def _find_private_host() -> str:
    """Return a loopback address that no web page can guess, or 127.0.0.1 where the system has no other."""
    host = f"127.{1 + secrets.randbelow(254)}.{secrets.randbelow(256)}.{1 + secrets.randbelow(254)}"
    try:
        socket.create_server((host, 0)).close()
    except OSError:  # macOS
        return "127.0.0.1"
    return host


def _make_channels(context: Any, of_cameras: Iterable[str], *, has_ptu: bool) -> dict[str, Any]:
    """Make the channels by topic; those of cameras beside the lidar are given."""
    from foxglove import Channel, channels

    by_topic = {
        "/tf": channels.FrameTransformsChannel("/tf", context=context),
        "/lidar/range": channels.RawImageChannel("/lidar/range", context=context),
        "/lidar/intensity": channels.RawImageChannel("/lidar/intensity", context=context),
        "/lidar/points": channels.PointCloudChannel("/lidar/points", context=context),
        "/lidar/calibration": channels.CameraCalibrationChannel("/lidar/calibration", context=context),
        TARGETS: channels.SceneUpdateChannel(TARGETS, context=context),
        "/log": channels.LogChannel("/log", context=context),
    }
    if has_ptu:
        by_topic["/ptu"] = Channel("/ptu", schema=PTU_SCHEMA, context=context)
    for topic in of_cameras:
        kind = channels.RawImageChannel if topic.endswith(f"/{IMAGE}") else channels.CameraCalibrationChannel
        by_topic[topic] = kind(topic, context=context)
    return by_topic


def parse_origin(text: str) -> str:
    """Return an origin as browsers write it; raise `ScenarioError` if it is no origin.

    Parameters
    ----------
    text : such as ``http://localhost:8080``

    >>> parse_origin("HTTP://LocalHost:80")
    'http://localhost'
    """
    match = re.fullmatch(r"([a-z][a-z0-9+.\-]*)://((?:\[[0-9a-f:.]+\]|[a-z0-9.\-]+)(?::(\d{1,5}))?)", text.lower())
    if match is None or int(match[3] or 0) > 65535:
        raise ScenarioError(f"--live-origin {text:.80}: is not an origin; write for example http://localhost:8080")
    scheme, place = match[1], match[2]
    return f"{scheme}://{place.removesuffix(_DEFAULT_PORTS.get(scheme, '/'))}"


class HandshakeCheck:
    """Limits of one connection: the request that opens it is short, and comes from no page that is not accepted.

    A browser states the origin of a page, which the page can neither choose nor leave out (RFC 6455, sec. 10.2). Programs
    outside a browser state none, or whatever they like.
    """

    refusal = b"HTTP/1.1 403 Forbidden\r\nConnection: close\r\nContent-Length: 0\r\n\r\n"

    def __init__(self, accepts: Callable[[str], bool]) -> None:
        self._accepts = accepts
        self._head: bytearray | None = bytearray()  # until it is complete

    def admits(self, data: memoryview) -> bool:
        """Read the header of the request, and return whether the server may have the next bytes."""
        if self._head is None:
            return True
        self._head += data
        end = re.search(rb"\n\r?\n", self._head)
        if (end.start() if end else len(self._head)) > _MOST_HEAD_BYTES:
            return False
        if end is None:
            return True
        fields = [line.partition(b":") for line in self._head[: end.start()].splitlines()]
        self._head = None
        origins = [value.strip() for name, _, value in fields if name.strip().lower() == b"origin"]
        return all(self._accepts(origin.decode("latin-1").lower()) for origin in origins)

    def note_answer(self) -> None:
        """Do nothing: answers change no limit."""

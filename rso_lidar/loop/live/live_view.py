"""A live view: a server that shows frames to viewers of the Foxglove protocol while they are made.

A viewer that joins late receives the meshes and the latest frame at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rso_lidar.errors import RecordingError, ScenarioError, warn
from rso_lidar.loop.live.frame_messages import PTU_SCHEMA, TARGETS, WRITERS, stamp_of, write_targets
from rso_lidar.loop.live.queued_view import QueuedView
from rso_lidar.loop.network_address import NetworkAddress, parse_address, require_loopback
from rso_lidar.picture.viewers.shape import Shape
from rso_lidar.records import Frame
from rso_lidar.scenario import Scenario

DEFAULT_ADDRESS = "127.0.0.1:8765"  # the port of the Foxglove protocol
_MESSAGES = 64  # that wait for one viewer in the library, which drops the oldest of more


class LiveView(QueuedView):
    """A server for viewers of the Foxglove protocol, such as Lichtblick and Foxglove; a context manager.

    >>> with LiveView(scenario) as view:  # doctest: +SKIP
    ...     for frame in rl.simulate(scenario):
    ...         view.show(frame)

    Only this machine can connect, because the protocol does not ask who does. A page in a browser of this machine can,
    too. Viewers can watch, and change nothing.
    """

    def __init__(
        self, scenario: Scenario, address: str = DEFAULT_ADDRESS, *, shapes: Sequence[Shape] | None = None
    ) -> None:
        """Open the server.

        Parameters
        ----------
        scenario : that is flown, with the meshes of its targets.
        address : ``HOST:PORT`` of the server, a loopback address; port 0 takes a free one.
        shapes : meshes to show (None: those of the scenario).

        Raises
        ------
        ScenarioError
            For an address of another kind, and for one that is in use.
        RecordingError
            Where the library is missing, which is an extra.
        """
        where = "live view:"
        asked = parse_address(address, where)
        require_loopback(asked, where, "the live view")
        fox = _import_foxglove()
        super().__init__()
        if shapes is None:
            shapes = [Shape(surface.name, surface.corners) for surface in scenario.surfaces]
        self._shapes = tuple(shapes)
        self._latest: Frame | None = None
        self._targets: Any = None
        self._context = context = fox.Context()  # channels are advertised only while it lives
        try:
            self._server = fox.start_server(
                name=scenario.name,
                host=asked.host,
                port=asked.port,
                capabilities=[fox.Capability.Time],
                server_listener=_make_listener(self),
                context=context,
                message_backlog_size=_MESSAGES,
            )
        except (RuntimeError, OSError, ValueError) as error:
            reason = " ".join(str(error).split())
            raise ScenarioError(f"live view: {asked.text}: cannot be opened ({reason}); choose another port") from None
        self.address = NetworkAddress(asked.host, int(self._server.port))
        self._channels = _make_channels(context, has_ptu=scenario.ptu is not None)
        self._start()

    @property
    def url(self) -> str:
        """Address for the viewer, such as ``ws://127.0.0.1:8765``."""
        return f"ws://{self.address.text}"

    def _stop(self) -> None:
        """Close the server."""
        for channel in self._channels.values():
            channel.close()
        self._server.stop()

    def _publish(self, frame: Frame) -> None:
        """Publish one frame to all viewers that subscribe to a topic of it."""
        first, self._latest = self._latest is None, frame
        self._server.broadcast_time(stamp_of(frame))
        for topic, channel in self._channels.items():
            if channel.has_sinks() and (topic != TARGETS or first):
                self._send(topic, frame)

    def _send(self, topic: str, frame: Frame, client: int | None = None) -> None:
        """Send the message of a topic.

        Parameters
        ----------
        topic, frame : the topic, and the frame that it is about.
        client : number of the only viewer that receives it (None: all).
        """
        if topic == TARGETS:
            self._targets = message = self._targets or write_targets(frame, self._shapes)
        else:
            message = WRITERS[topic](frame)
        if message is not None:
            self._channels[topic].log(message, log_time=stamp_of(frame), sink_id=client)

    def resend(self, topic: str, client: int) -> None:
        """Send the latest message of a topic to a viewer that has just subscribed to it.

        Parameters
        ----------
        topic, client : the topic, and the number of the viewer.
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


def _make_channels(context: Any, *, has_ptu: bool) -> dict[str, Any]:
    """Make the channels by topic.

    Parameters
    ----------
    context : of the library.
    has_ptu : whether there is a PTU.
    """
    from foxglove import Channel, channels

    made = {
        "/tf": channels.FrameTransformsChannel("/tf", context=context),
        "/lidar/range": channels.RawImageChannel("/lidar/range", context=context),
        "/lidar/intensity": channels.RawImageChannel("/lidar/intensity", context=context),
        "/lidar/points": channels.PointCloudChannel("/lidar/points", context=context),
        "/lidar/calibration": channels.CameraCalibrationChannel("/lidar/calibration", context=context),
        TARGETS: channels.SceneUpdateChannel(TARGETS, context=context),
        "/log": channels.LogChannel("/log", context=context),
    }
    if has_ptu:
        made["/ptu"] = Channel("/ptu", schema=PTU_SCHEMA, context=context)
    return made

"""A client of the server that reads like a `Simulation`: flight software in Python, in a process of its own."""

from __future__ import annotations

import os
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, Self

import numpy as np

from rso_lidar.errors import RunError, ScenarioError
from rso_lidar.loop.service.endpoints import import_zmq, load_keys, load_public_key
from rso_lidar.loop.service.linked_simulation import Delivery
from rso_lidar.loop.service.multipart import receive_parts, send_parts
from rso_lidar.loop.service.wire_format import (
    build_observation,
    build_samples,
    build_truth,
    check_reply,
    decode,
    encode_request,
)
from rso_lidar.records import Command, Observation, SensorSamples, Truth, join_samples
from rso_lidar.units import NS_PER_S

_MOST_STEPS = 10_000  # whose samples are kept until the next reading
_LOOK_MS = 100  # period at which a client that waits checks the connection
_CONNECT_S = 10.0  # longest wait for the connection itself


class Client:
    """A simulation in another process, stepped over a socket; a context manager.

    It has the methods and properties of `Simulation`, without labels::

        with rl.loop.Client("tcp://127.0.0.1:5571") as simulation:
            flash = simulation.step()
            while not simulation.is_over:
                flash = simulation.step(decide(simulation.observation))

    Parameters
    ----------
    endpoint : address of the server

    Other Parameters
    ----------------
    role : ``driver`` steps the simulation; ``observer`` only reads
    timeout_s : longest wait for a reply [s]
    name : in the server's log
    token : secret that the server requires
    key : file of this client's CURVE keys (``.key_secret``)
    server_key : file of the server's public key
    cameras : names of the cameras beside the lidar whose images the observations hold, or ``all``
    """

    def __init__(
        self,
        endpoint: str = "tcp://127.0.0.1:5571",
        *,
        role: Literal["driver", "observer"] = "driver",
        timeout_s: float = 60.0,
        name: str = "",
        token: str | None = None,
        key: str | os.PathLike[str] | None = None,
        server_key: str | os.PathLike[str] | None = None,
        cameras: Sequence[str] | Literal["all"] = (),
    ) -> None:
        self.endpoint, self.timeout_s = endpoint, timeout_s
        self._zmq = import_zmq("Client")
        if (key is None) != (server_key is None):
            raise ScenarioError("Client: key and server_key need each other; give both or none")
        self._context = self._zmq.Context()
        self._socket = self._context.socket(self._zmq.DEALER)
        self._sequence = 0
        self._time_ns, self._is_over, self._overruns, self._dropped = 0, False, 0, 0
        self._next_flash_ns: int | None = None
        self._sight: np.ndarray | None = None
        self._observation: Observation | None = None
        self._samples: Mapping[str, SensorSamples] = {}
        self._since: deque[Mapping[str, SensorSamples]] = deque(maxlen=_MOST_STEPS)  # the reading before it
        try:
            self._socket.setsockopt(self._zmq.LINGER, 0)
            self._socket.setsockopt(self._zmq.IPV6, "[" in endpoint)
            if key is not None and server_key is not None:
                self._socket.curve_publickey, self._socket.curve_secretkey = load_keys(Path(key))
                self._socket.curve_serverkey = load_public_key(Path(server_key))
            self._monitor = self._socket.get_monitor_socket()
            self._socket.rcvtimeo = min(_LOOK_MS, max(1, int(1e3 * self.timeout_s)))
            self._connect()
            hello: dict[str, Any] = {"version": 1, "role": role, "client": name or f"Python, process {os.getpid()}"}
            asked = cameras if isinstance(cameras, str) else list(cameras)
            self.description: dict[str, Any] = self._ask(
                "hello", lambda header, _: dict(header["describe"]), **hello, token=token, cameras=asked or None
            )
        except BaseException:
            self.close()
            raise

    def _connect(self) -> None:
        """Connect to the server."""
        try:
            self._socket.connect(self.endpoint)
        except self._zmq.ZMQError as error:
            raise ScenarioError(f"Client: {self.endpoint!r:.80} is not an address ({error.strerror})") from None
        events = self._zmq.Event
        end_s = time.monotonic() + min(_CONNECT_S, self.timeout_s)
        while (left_s := end_s - time.monotonic()) > 0.0 and self._monitor.poll(int(left_s * 1e3)):
            happened = self._read_event()
            if happened == events.HANDSHAKE_SUCCEEDED:
                return
            if happened in (events.HANDSHAKE_FAILED_AUTH, events.HANDSHAKE_FAILED_PROTOCOL):
                raise ScenarioError(f"{self.endpoint}: refused the connection; check the CURVE keys of both sides")
        raise RunError(
            f"{self.endpoint}: no server answers there; start one with rso-lidar serve, or check the address"
        )

    def _read_event(self) -> int:
        """Return the next event of the connection."""
        from zmq.utils.monitor import recv_monitor_message

        return int(recv_monitor_message(self._monitor)["event"])

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """End the connection; the server keeps the simulation for another client."""
        self._context.destroy(linger=0)

    @property
    def time_s(self) -> float:
        """Present time of the simulation [s since start_utc]."""
        return self._time_ns / NS_PER_S

    @property
    def next_flash_s(self) -> float | None:
        """Time of the next flash [s since start_utc]; None after the last."""
        return None if self._next_flash_ns is None else self._next_flash_ns / NS_PER_S

    @property
    def is_over(self) -> bool:
        """Whether the last flash has been made, and its reading has arrived."""
        return self._is_over

    @property
    def overruns(self) -> int:
        """Number of deadlines that a server on the wall clock has missed."""
        return self._overruns

    @property
    def dropped(self) -> int:
        """Number of readings that the link has lost since t = 0, also where no step has returned their loss."""
        return self._dropped

    @property
    def observation(self) -> Observation | None:
        """The latest reading that has arrived; None before the first."""
        return self._observation

    @property
    def samples(self) -> Mapping[str, SensorSamples]:
        """Samples of the other sensors that became available in the last step, by name."""
        return self._samples

    @property
    def truth(self) -> Truth:
        """Poses of all bodies at the present time, from a server that was started with ``--truth``."""
        truth: Truth = self._ask("truth", build_truth)
        return truth

    def step(
        self, command: Command | None = None, *, dt_s: float | None = None, stamp_s: float | None = None
    ) -> Delivery | None:
        """Go to the next flash, or go on by a time.

        Parameters
        ----------
        command : as for `Simulation.step`; over a link with a latency it acts until the next command does
        dt_s : length of the step [s] (None: to the next flash)
        stamp_s : when the command was given [s since start_utc] (None: as soon as it could have been)

        Returns
        -------
        the flash of a step to the next flash; the reading that arrived, if any, of a step by a time.

        Raises
        ------
        ScenarioError
            If the request is not possible. The simulation is then as before.
        RunError
            If the server has ended, or does not answer in time.
        """
        fields = {"dt_ns": _to_ns("dt_s", dt_s), "stamp_ns": _to_ns("stamp_s", stamp_s)}
        asked = None if command is None else _list_fields(command)
        delivery: Delivery | None = self._ask("step", self._read_step, command=asked, **fields)
        return delivery

    def read(self) -> Delivery | None:
        """Ask for the latest reading once more, as an observer does; None before the first."""
        delivery: Delivery | None = self._ask("observation", self._read_observation)
        return delivery

    def reset(self, seed: int | None = None) -> None:
        """Go back to t = 0, before the first flash.

        Parameters
        ----------
        seed : of all noise (None: the scenario's)
        """
        self._ask("reset", seed=seed)
        self._observation, self._samples = None, {}
        self._since.clear()

    def save(self) -> str:
        """Save the present state on the server, and return its name."""
        name: str = self._ask("save", lambda header, arrays: str(header["state"]))
        return name

    def restore(self, state: str, *, delete: bool = False) -> None:
        """Go on from a state that was saved on the server.

        Parameters
        ----------
        state : its name, from `save`
        delete : whether the server deletes it afterwards
        """
        self._ask("restore", state=state, delete=delete)
        self._observation = None
        self.read()

    def shut_down(self) -> None:
        """End the server; a recording is completed."""
        self._ask("shutdown")

    def _read_observation(self, header: dict[str, Any], arrays: dict[str, np.ndarray]) -> Delivery | None:
        """Return the flash in a reply that holds all samples since the reading before, and keep its reading."""
        self._since.clear()
        return self._read_step(header, arrays)

    def _read_step(self, header: dict[str, Any], arrays: dict[str, np.ndarray]) -> Delivery | None:
        """Return the flash in a reply that holds the samples of a step, if there is a flash, and keep its reading."""
        self._sight = arrays.get("line_of_sight", self._sight)
        self._samples = build_samples(header, arrays)
        self._since.append(self._samples)
        frame = header["frame"]
        if frame is None:
            return None
        observation = None
        if frame["status"] == "delivered":
            if self._sight is None:
                raise RunError(f"{self.endpoint}: sent a reading without a line of sight; use equal versions")
            since = join_samples(list(self._since))
            observation = self._observation = build_observation(header, arrays, self._sight, since)
            self._since.clear()
        return Delivery(frame["index"], frame["status"], frame["t_emission_ns"], frame["t_available_ns"], observation)

    def _ask(
        self, kind: str, read: Callable[[dict[str, Any], dict[str, np.ndarray]], Any] | None = None, **fields: Any
    ) -> Any:
        """Send a request, and return what `read` makes of its reply.

        Parameters
        ----------
        read : function of the header and the arrays of the reply (None: nothing is read)
        **fields : of the request; None is left out
        """
        if self._socket.closed:
            raise ScenarioError("Client: is closed; make a new one")
        self._sequence += 1
        try:
            send_parts(self._socket, [b"", encode_request(kind, self._sequence, fields)])
        except self._zmq.Again:  # a thousand requests wait
            raise RunError(
                f"{self.endpoint}: does not read '{kind}'; check the server, and make a new Client"
            ) from None
        while True:
            header, arrays = decode(self._receive(kind)[1:])
            if header.get("request_sequence") == self._sequence:  # else a late reply to a request given up before
                break
        with check_reply(self.endpoint):
            if header["ok"]:
                self._time_ns, self._is_over = int(header["time_ns"]), bool(header["is_over"])
                self._next_flash_ns = None if header["next_flash_ns"] is None else int(header["next_flash_ns"])
                self._overruns, self._dropped = int(header["overruns"]), int(header.get("dropped", 0))
                return None if read is None else read(header, arrays)
            code, message = str(header["error"]["code"]), str(header["error"]["message"])
        raise (RunError if code == "failed" else ScenarioError)(f"{self.endpoint}: {message}")

    def _receive(self, kind: str) -> list[Any]:
        """Return the parts of the next message, or raise `RunError` where none comes."""
        end_s = time.monotonic() + self.timeout_s
        while time.monotonic() < end_s:
            try:
                return receive_parts(self._socket)
            except self._zmq.Again:
                pass
            if self._monitor.poll(0) and self._read_event() == self._zmq.Event.DISCONNECTED:
                raise RunError(f"{self.endpoint}: the server has ended; start it again, and make a new Client")
        raise RunError(
            f"{self.endpoint}: did not answer '{kind}' within {self.timeout_s:g} s; "
            "check the server, or raise timeout_s"
        )


def _to_ns(name: str, time_s: float | None) -> int | None:
    """Return a time in whole nanoseconds."""
    if time_s is None:
        return None
    if not isinstance(time_s, int | float | np.floating | np.integer) or not 0.0 <= time_s < 1e9:
        raise ScenarioError(f"{name}: {time_s!r:.40} is no time; give seconds from 0")
    return round(float(time_s) * NS_PER_S)


def _list_fields(command: Command) -> dict[str, Any]:
    """Return the fields of a command as JSON takes them."""
    fields = {name: value for name, value in vars(command).items() if value is not None}
    if command.inputs is not None:
        fields["inputs"] = {name: np.asarray(row, dtype=float).ravel().tolist() for name, row in command.inputs.items()}
    return fields

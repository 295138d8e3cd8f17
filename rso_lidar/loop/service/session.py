"""Answers to the requests of flight software, without sockets: a simulation, the states that are kept, a recording."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np

from rso_lidar.errors import ScenarioError
from rso_lidar.export import list_cameras
from rso_lidar.loop.service.flight_recorder import FlightRecorder
from rso_lidar.loop.service.linked_simulation import Delivery, LinkedSimulation, LinkedState
from rso_lidar.loop.service.requests import (
    DescribeRequest,
    HelloRequest,
    ObservationRequest,
    Request,
    ResetRequest,
    RestoreRequest,
    SaveRequest,
    ShutdownRequest,
    StepRequest,
    TruthRequest,
)
from rso_lidar.loop.service.wire_format import WireArray, list_images, list_reading, list_truth
from rso_lidar.records import CameraImage, Frame, Observation, SensorSamples, specs
from rso_lidar.simulation import Simulation

MOST_STATES = 64  # kept at once; each holds a frame
_SIGHT = "line_of_sight"


@dataclass(frozen=True, eq=False)
class Answer:
    """An answer to a request: header and arrays of the message, and flags for the server.

    `images` holds those of all cameras beside the lidar that come with the reading, by name, and `cameras` describes the
    cameras; `with_images` adds what a client takes of both.
    """

    header: dict[str, Any]
    arrays: list[WireArray] = field(default_factory=list)
    is_step: bool = False
    is_skipped: bool = False
    has_reading: bool = False
    ends: bool = False
    images: Mapping[str, CameraImage] = field(default_factory=dict)
    cameras: Mapping[str, dict[str, Any]] = field(default_factory=dict)

    def with_images(self, cameras: Sequence[str]) -> Self:
        """Return the answer with images and descriptions of some cameras.

        Parameters
        ----------
        cameras : their names
        """
        header, arrays = self.header, self.arrays
        if images := {name: self.images[name] for name in cameras if name in self.images}:
            classes, more = list_images(images)
            header, arrays = header | {"records": header["records"] | classes}, [*arrays, *more]
        if described := [self.cameras[name] for name in cameras if name in self.cameras]:
            header = header | {"describe": header["describe"] | {"cameras": described}}
        return replace(self, header=header, arrays=arrays)


class Session:
    """A simulation that answers requests.

    Parameters
    ----------
    simulation : under commands
    serves_truth : whether requests for the truth are answered
    recorder : of all frames made; None for none
    show : called with every frame made, such as by a live view; None for nothing
    """

    def __init__(
        self,
        simulation: Simulation,
        *,
        serves_truth: bool = False,
        recorder: FlightRecorder | None = None,
        show: Callable[[Frame], object] | None = None,
    ) -> None:
        self.linked = LinkedSimulation(simulation)
        self.serves_truth, self._recorder, self._show = serves_truth, recorder, show
        self._seed = simulation.scenario.seed
        self._states: dict[str, LinkedState] = {}
        self._names = 0
        self._sight: np.ndarray | None = None  # the line of sight that the driver has

    @cached_property
    def cameras(self) -> dict[str, dict[str, Any]]:
        """Descriptions of the cameras beside the lidar, by name."""
        scenario = self.linked.simulation.scenario
        listed = list_cameras(Path("describe"), scenario.source.scenario) if scenario.camera else []
        return {camera.name: camera.describe() for camera in listed}

    def answer(self, request: Request, *, skip: bool = False) -> Answer:
        """Answer a request.

        Parameters
        ----------
        request : from `parse_request`
        skip : whether the flash of a step is left out

        Returns
        -------
        Answer

        Raises
        ------
        ScenarioError
            If the request is not possible; the simulation is then as before.
        RunError
            If the recording cannot be written.
        """
        match request:
            case StepRequest():
                return self._step(request, skip=skip)
            case HelloRequest() | DescribeRequest():
                self._sight = None if isinstance(request, HelloRequest) and request.role == "driver" else self._sight
                header = self._state() | {"describe": self._describe()}
                return Answer(header, self._list_sight(), cameras=self.cameras)
            case ObservationRequest():
                return self._observe()
            case TruthRequest():
                return self._list_truth()
            case ResetRequest():
                return self._reset(request.seed)
            case SaveRequest():
                return self._save()
            case RestoreRequest():
                return self._restore(request)
            case ShutdownRequest():
                return Answer(self._state(), ends=True)
        raise ScenarioError(f"request: {type(request).__name__} has no answer")

    def _state(self) -> dict[str, Any]:
        """Return the keys of every answer."""
        linked = self.linked
        return {
            "time_ns": linked.time_ns,
            "next_flash_ns": linked.next_flash_ns,
            "is_over": linked.is_over,
            "dropped": linked.dropped,
        }

    def _describe(self) -> dict[str, Any]:
        """Return what does not change, as far as flight software may know it."""
        scenario = self.linked.simulation.scenario
        receiver = scenario.lidar.receiver
        return {
            "title": scenario.name,
            "start_utc": scenario.time.start_utc.isoformat(),
            "n_frames": scenario.time.n_frames,
            "frame_rate_hz": scenario.time.frame_rate_hz,
            "n_rows": receiver.n_rows,
            "n_cols": receiver.n_cols,
            "has_ptu": scenario.ptu is not None,
            "seed": scenario.seed,
            "link": self.linked.link.model_dump(),
            "serves_truth": self.serves_truth,
            "is_recorded": self._recorder is not None,
        }

    def _list_sight(self) -> list[WireArray]:
        """List the line of sight of the latest reading, or else the one that the scenario plans now."""
        simulation, delivered = self.linked.simulation, self.linked.delivered
        if delivered is not None and delivered.observation is not None:
            values = delivered.observation.line_of_sight
        else:
            values = simulation.scenario.instrument.at(simulation.time_s).receiver.line_of_sight
        return [WireArray(_SIGHT, specs(Observation)[_SIGHT], values)]

    def _step(self, request: StepRequest, *, skip: bool) -> Answer:
        """Step, and record a frame that was made."""
        command = request.command.to_command() if request.command else None
        delivery = self.linked.step(
            command, dt_ns=request.dt_ns, stamp_ns=request.stamp_ns, skip=skip and request.dt_ns is None
        )
        if self._recorder is not None:
            self._recorder.write(self.linked.frame, self.linked.steps, self.linked.simulation)
        if self.linked.frame is not None and self._show is not None:
            self._show(self.linked.frame)
        return self._deliver(delivery, self.linked.samples, is_step=True)

    def _observe(self) -> Answer:
        """Return the latest reading once more, with the samples of its observation."""
        latest = self.linked.delivered
        return self._deliver(latest, latest.observation.sensors if latest and latest.observation else {}, is_step=False)

    def _deliver(self, delivery: Delivery | None, samples: Mapping[str, SensorSamples], *, is_step: bool) -> Answer:
        """Return the answer that holds samples, and a reading if there is one.

        Parameters
        ----------
        is_step : whether it answers a step; else it holds the line of sight, changed or not
        """
        header = self._state() | {"frame": None}
        observation = delivery.observation if delivery else None
        is_new = not is_step
        if delivery is not None:
            header["frame"] = {
                "index": delivery.index,
                "status": delivery.status,
                "t_emission_ns": delivery.t_emission_ns,
                "t_available_ns": delivery.t_available_ns,
            }
        if observation is not None:
            header["frame"]["time_s"] = observation.time_s
            header["frame"]["settings"] = dict(observation.settings)
            sight = observation.line_of_sight
            if is_step:
                is_new = self._sight is None or not _are_equal(sight, self._sight)
                self._sight = sight
        header["records"], arrays = list_reading(observation, samples, with_line_of_sight=is_new)
        return Answer(
            header,
            arrays,
            is_step=is_step,
            is_skipped=delivery is not None and delivery.status == "skipped",
            has_reading=observation is not None,
            images={} if observation is None else observation.camera,
        )

    def _list_truth(self) -> Answer:
        if not self.serves_truth:
            raise ScenarioError(
                "truth: requests for the truth are refused; start the server with --truth to answer them"
            )
        truth = self.linked.simulation.truth
        header = self._state() | {
            "time_s": float(truth.time_s),
            "parents": {name: truth.poses.parent(name) for name in truth.poses},
            "sunlit": {name: float(share) for name, share in truth.sunlit.items()},
        }
        return Answer(header, list_truth(truth))

    def _reset(self, seed: int | None) -> Answer:
        if self._recorder is not None:
            self._recorder.check_next()
            self._recorder.complete()
        self.linked.reset(self._seed if seed is None else seed)
        self._sight = None
        return Answer(self._state() | {"seed": self.linked.simulation.scenario.seed})

    def _save(self) -> Answer:
        if len(self._states) >= MOST_STATES:
            raise ScenarioError(f"save: {MOST_STATES} states are kept already; restore one with delete = true")
        self._names += 1
        name = f"state-{self._names}"
        self._states[name] = self.linked.save()
        return Answer(self._state() | {"state": name})

    def _restore(self, request: RestoreRequest) -> Answer:
        if self._recorder is not None:
            raise ScenarioError(
                "restore: a recording goes on from frame to frame; start the server without -o to go back"
            )
        if request.state not in self._states:
            raise ScenarioError(f"restore: no state '{request.state:.40}' is kept; give the name that save returned")
        state = self._states.pop(request.state) if request.delete else self._states[request.state]
        self.linked.restore(state)
        self._sight = None
        return Answer(self._state())


def _are_equal(first: np.ndarray, other: np.ndarray) -> bool:
    """Return whether two read-only arrays are equal; views of all of one array are, without a look at their values."""
    base = first.base
    if base is None or base is not other.base:
        return np.array_equal(first, other)
    is_whole = first.shape == other.shape == base.shape and first.strides == other.strides
    return is_whole or np.array_equal(first, other)

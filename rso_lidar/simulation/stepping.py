"""A scenario flown step by step, from flash to flash and between the flashes."""

from __future__ import annotations

import operator
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Self, overload

import numpy as np

from rso_lidar import motion, sensors
from rso_lidar.errors import ScenarioError
from rso_lidar.records import Command, Frame, Observation, SensorSamples, Truth, join_samples
from rso_lidar.scenario import Lidar, Scenario, require_scenario
from rso_lidar.sensors import BEFORE_ALL_S
from rso_lidar.simulation.first_start import compile_ahead
from rso_lidar.simulation.laser_flash import check_kept, flash
from rso_lidar.simulation.state import SimulationState, check_state, digest_scenario
from rso_lidar.units import NS_PER_S

DETECTION, POINTING = 0, 1  # the stages that draw noise, each from a generator of its own


@dataclass(frozen=True, eq=False)
class Moment:
    """What a flash needs: poses of all bodies, the instrument in force, the generator of its noise, and the samples of the
    other sensors since the flash before, by name.
    """

    index: int
    truth: Truth
    lidar: Lidar
    rng: np.random.Generator
    sensors: Mapping[str, SensorSamples]


class Simulation:
    """A scenario flown step by step, under commands of the caller; a context manager.

    A flash is made at each epoch of the scenario. A step goes to the next flash and makes it, or goes on by a time, for
    flight software that runs faster than the flashes::

        with rl.Simulation(scenario) as simulation:
            frame = simulation.step()  # the first flash, at t = 0
            while not simulation.is_over:
                frame = simulation.step(decide(frame.observation))

    A command acts from the beginning of the step to which it is given until its end, and its `inputs` until others replace
    them. Frame k depends on scenario, seed, k and the commands before it, and has the same bits with and without steps in
    between.
    """

    def __init__(
        self,
        scenario: Scenario,
        *,
        frames: slice | Iterable[int] | None = None,
        commanded: bool = True,
        threads: int | None = None,
        keep: Iterable[str] = (),
    ) -> None:
        """Begin at t = 0, before the first flash.

        Parameters
        ----------
        scenario : to be flown

        Other Parameters
        ----------------
        frames : as for `simulate`; with a choice of frames there can be no commands
        commanded : whether commands may be given. If False, the motion is computed for all flashes in one batch
        threads : number of threads of a flash (None: one per core). The result is bit for bit the same
        keep : as for `simulate`

        Raises
        ------
        ScenarioError
            If the arguments contradict each other, or the scenario cannot be simulated.
        """
        require_scenario(scenario, "Simulation")
        check_count("threads", threads)
        if commanded and frames is not None:
            raise ScenarioError("frames: depend on history under commands; leave out frames, or give commanded=False")
        self.keep = check_kept(keep, scenario)
        self.threads = threads or os.cpu_count() or 1
        self.scenario, self._commanded = scenario, commanded
        self._numbers = scenario.time.choose_frames(frames)
        # Computed once, before threads and processes share them.
        _ = scenario.surfaces, scenario.source, scenario.instrument, scenario.exposure, scenario.camera_surfaces
        _ = scenario.carried_points
        with scenario.locate_errors():
            world: Any = {"local": scenario.is_local, "sun_direction": scenario.world.sun_direction}
            exposure_s = scenario.lidar.exposure_s
            self._epochs = epochs = scenario.epochs(self._numbers)
            self._course = motion.Course(scenario.bodies, epochs, commanded=commanded, exposure_s=exposure_s, **world)
            self._aim = motion.Aim(
                scenario.pan_tilt,
                scenario.lidar.mount,
                scenario.bodies,
                *scenario.span,
                flights=self._course.flights,
                exposure_s=exposure_s,
                cameras={camera.name: (camera.carrier, camera.mount) for camera in scenario.camera},
                **world,
            )
        self._flashes_ns = np.rint(epochs.time_s * NS_PER_S).astype(np.int64)
        self._follower = motion.FollowerMotion(self._course)
        self._suite = sensors.SensorSuite(scenario.sensor, scenario.seed)
        self._measured_s = BEFORE_ALL_S
        self._flash_samples: list[Mapping[str, SensorSamples]] = []  # since the flash before
        self._step_samples: list[Mapping[str, SensorSamples]] = []
        self.digest = digest_scenario(scenario, self._numbers, commanded=commanded)
        self._row, self._now_ns, self._is_closed = 0, 0, False
        self._frame: Frame | None = None
        self._beginning = self.save()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """End the simulation; a step after this is an error."""
        self._is_closed = True

    def reset(self, seed: int | None = None) -> None:
        """Go back to t = 0, before the first flash.

        Parameters
        ----------
        seed : of all noise from here on (None: as before)

        Raises
        ------
        ScenarioError
            If the seed is not a whole number from 0.
        """
        try:
            chosen = self.scenario.seed if seed is None else operator.index(seed)
        except TypeError:
            raise ScenarioError(f"seed: {seed!r:.40} is no seed; give a whole number from 0") from None
        self.restore(replace(self._beginning, seed=chosen))

    @property
    def time_s(self) -> float:
        """Present time [s since start_utc]."""
        return self._now_ns / NS_PER_S

    @property
    def next_flash_s(self) -> float | None:
        """Time of the next flash [s since start_utc]; None after the last."""
        return None if self.is_over else float(self._epochs.time_s[self._row])

    @property
    def is_over(self) -> bool:
        """Whether the last flash has been made."""
        return self._row == len(self._numbers)

    @property
    def observation(self) -> Observation | None:
        """What the spacecraft could know of the latest flash; None before the first."""
        return None if self._frame is None else self._frame.observation

    @property
    def samples(self) -> Mapping[str, SensorSamples]:
        """Samples of the other sensors that became available in the last step, by name."""
        return self._suite.complete(join_samples(self._step_samples), self._follower.find)

    @property
    def truth(self) -> Truth:
        """Poses of all bodies at the present time. Between flashes the lidar's are without jitter."""
        if self._frame is not None and self._frame.time_s == self.time_s:
            return self._frame.truth
        with self.scenario.locate_errors():
            return self._aim.now(self._course.now(self.time_s))

    @overload
    def step(self, command: Command | None = None) -> Frame: ...
    @overload
    def step(self, command: Command | None = None, *, dt_s: float) -> Frame | None: ...
    def step(self, command: Command | None = None, *, dt_s: float | None = None) -> Frame | None:
        """Go to the next flash and make it, or go on by a time.

        Parameters
        ----------
        command : acts until the end of the step. An axis or a setting that is None is the scenario's
        dt_s : length of the step [s], rounded to 1 ns (None: to the next flash). It must not contain two flashes

        Returns
        -------
        frame of the flash in the step, its end included; None without one.

        Raises
        ------
        ScenarioError
            If the simulation is over, or the step or the command is not possible. The simulation is then as before.
        """
        before, self._step_samples = self.save(), []
        try:
            return self._flash(command) if dt_s is None else self._go_on(command, _check_length_ns(dt_s))
        except BaseException:
            self.restore(before)
            raise

    def _go_on(self, command: Command | None, length_ns: int) -> Frame | None:
        """Go on by a time [ns], and make the flash that it contains."""
        self._check_step(command)
        end_ns = self._now_ns + length_ns
        due_ns = self._flashes_ns[self._row : self._row + 2].tolist()
        if len(due_ns) == 2 and due_ns[1] <= end_ns:
            raise ScenarioError(
                f"dt_s: a step of {length_ns / NS_PER_S:g} s at {self.time_s:g} s contains two flashes; "
                "a step contains at most one"
            )
        frame = self._flash(command) if due_ns[0] <= end_ns else None
        if end_ns > self._now_ns and not self.is_over:
            with self.scenario.locate_errors():
                self._course.advance(end_ns / NS_PER_S, command)
                self._aim.advance(end_ns / NS_PER_S, command)
                self._measure(self._measured_s, end_ns / NS_PER_S)
            self._now_ns = end_ns
        return frame

    def _flash(self, command: Command | None) -> Frame:
        """Go to the next flash and make it."""
        if self.threads > 1:
            compile_ahead()
        moment = self.advance(command)
        self._frame = frame = flash(
            self.scenario,
            moment.truth,
            moment.rng,
            self.threads,
            lidar=moment.lidar,
            index=moment.index,
            keep=self.keep,
            sensors=moment.sensors,
        )
        return frame

    def advance(self, command: Command | None = None) -> Moment:
        """Go to the next flash, and return what it needs without making it.

        Parameters
        ----------
        command : as for `step`

        Returns
        -------
        Moment

        Raises
        ------
        ScenarioError
            As `step`.
        """
        self._check_step(command)
        self._step_samples = []
        scenario, k = self.scenario, int(self._numbers[self._row])
        with scenario.locate_errors():
            truth = self._aim.at(self._course.at(self._row, command), command, scenario.rng(k, POINTING))
            lidar = scenario.instrument.at(truth.time_s, command)
            if scenario.exposure:
                truth = scenario.exposure.follow(truth, self._course, self._aim, self._row, lidar)
            before_s = float(scenario.epochs(np.array([k - 1])).time_s[0]) if k else BEFORE_ALL_S
            self._measure(max(before_s, self._measured_s), truth.time_s)
            samples = self._suite.complete(join_samples(self._flash_samples), self._follower.find)
        self._row, self._now_ns = self._row + 1, int(self._flashes_ns[self._row])
        self._flash_samples = []
        return Moment(k, truth, lidar, scenario.rng(k, DETECTION), samples)

    def _measure(self, after_s: float, until_s: float) -> None:
        """Measure the samples of the other sensors that become available in an interval."""
        if not self.scenario.sensor:
            return
        measured = self._suite.measure(after_s, until_s, self._follower.find)
        self._measured_s = until_s
        self._flash_samples.append(measured)
        self._step_samples.append(measured)

    def _check_step(self, command: Command | None) -> None:
        """Refuse a step after the last flash, and what is not a possible command."""
        if self._is_closed:
            raise ScenarioError("Simulation: is closed; make a new one")
        if self.is_over:
            raise ScenarioError(f"Simulation: the last flash was at {self.time_s:g} s; call reset() to fly again")
        if command is None:
            return
        if not self._commanded:
            raise ScenarioError("Simulation: was made with commanded=False, and a command was given; leave one out")
        if not isinstance(command, Command):
            raise ScenarioError(f"Simulation: {command!r:.60} is not a command; give a Command or None")
        if self.scenario.ptu is None and (command.pan_rad is not None or command.tilt_rad is not None):
            raise ScenarioError("command: pan or tilt of a PTU is given and the scenario has none; add [ptu]")

    def check_command(self, command: Command | None) -> None:
        """Check a command without giving it, such as one that waits for its time.

        Parameters
        ----------
        command : as for `step`

        Raises
        ------
        ScenarioError
            If `step` would refuse it at the present time.
        """
        self._check_step(command)
        with self.scenario.locate_errors():
            motion.check_angles(command or Command())
            self._course.read_inputs(command)
            self.scenario.instrument.at(self.time_s, command)

    def save(self) -> SimulationState:
        """Return the present state, from which `restore` goes on."""
        return SimulationState(
            scenario=self.digest,
            seed=self.scenario.seed,
            row=self._row,
            time_ns=self._now_ns,
            course=self._course.save(),
            aim=self._aim.save(),
            sensors=self._suite.save(),
            measured_s=self._measured_s,
            samples=tuple(self._flash_samples),
            frame=self._frame,
        )

    def restore(self, state: SimulationState) -> None:
        """Go on from a state that a simulation of the same scenario saved. The same steps give the same bits.

        Parameters
        ----------
        state : from `save`, of this process or another

        Raises
        ------
        ScenarioError
            If the state is not one of this scenario.
        """
        check_state(state, self.digest, len(self._numbers))
        scenario = self.scenario if state.seed == self.scenario.seed else self.scenario.with_seed(state.seed)
        suite = sensors.SensorSuite(scenario.sensor, state.seed)
        suite.restore(state.sensors)
        before = self._course.save()
        self._course.restore(state.course)
        try:
            self._aim.restore(state.aim)
        except ScenarioError:
            self._course.restore(before)
            raise
        self.scenario, self._suite = scenario, suite
        self._row, self._now_ns, self._frame = state.row, state.time_ns, state.frame
        self._measured_s, self._flash_samples, self._step_samples = state.measured_s, list(state.samples), []


def _check_length_ns(dt_s: float) -> int:
    """Return the length of a step in whole nanoseconds."""
    if not isinstance(dt_s, int | float | np.floating | np.integer) or isinstance(dt_s, bool) or not 0.0 < dt_s < 1e9:
        raise ScenarioError(f"dt_s: {dt_s!r:.40} is no length of a step; give a time in seconds, greater than 0")
    return max(1, round(dt_s * NS_PER_S))


def check_count(name: str, count: int | None) -> None:
    """Check a number of threads or processes; raise `ScenarioError` for one that is not a whole number from 1."""
    if count is not None and (not isinstance(count, int) or isinstance(count, bool) or count < 1):
        raise ScenarioError(f"{name}: needs a whole number from 1, not {count!r}; or leave it out")

"""A simulation behind a link: readings arrive late or not at all, and a command acts after its time stamp and a latency."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from rso_lidar.errors import ScenarioError
from rso_lidar.loop.service.command_log import FlownStep
from rso_lidar.records import Command, Frame, Observation, SensorSamples, join_samples
from rso_lidar.scenario import DataLink
from rso_lidar.simulation import Simulation, SimulationState
from rso_lidar.units import NS_PER_S

LINK = 2  # stage of the draws of the link, beside those of detection (0) and pointing (1)
MOST_COMMANDS = 10_000  # that wait for their time


@dataclass(frozen=True, eq=False)
class Delivery:
    """One flash as it is delivered to flight software.

    `t_emission_ns` is the time of the flash, and `t_available_ns` the time at which flight software has the reading, both
    since start_utc. `observation` is None where the reading was lost on the link (``dropped``), or the flash was left out
    because the machine was late (``skipped``).
    """

    index: int
    status: Literal["delivered", "dropped", "skipped"]
    t_emission_ns: int
    t_available_ns: int | None
    observation: Observation | None


@dataclass(frozen=True, eq=False)
class LinkedState:
    """State of a linked simulation at an instant: that of the simulation, and the commands and readings in transit."""

    simulation: SimulationState
    active: Command | None
    commands: tuple[tuple[int, Command | None], ...]
    readings: tuple[Delivery, ...]
    delivered: Delivery | None
    dropped: int


class LinkedSimulation:
    """A simulation and the link of its scenario.

    A step to the next flash returns that flash at once, ahead of the time at which its reading is available. A command
    without a time stamp then counts as given when that reading was available, and not before. A step by a time returns the
    reading that became available by its end. A reading that is lost never arrives; `dropped` counts those so far.

    Parameters
    ----------
    simulation : to be stepped
    """

    def __init__(self, simulation: Simulation) -> None:
        self.simulation = simulation
        self.link = simulation.scenario.link or DataLink()
        self._has_link = self.link != DataLink()
        self.frame: Frame | None = None  # of the last step, for those that record
        self.steps: list[FlownStep] = []  # of the simulation in the last step, for those that record
        self._active: Command | None = None
        self._commands: list[tuple[int, Command | None]] = []  # with the instant from which each acts, in order
        self._readings: list[Delivery] = []  # in transit, in the order of their arrival
        self.delivered: Delivery | None = None  # latest reading that flight software has
        self.dropped = 0  # readings that the link has lost since t = 0
        self._samples: list[Mapping[str, SensorSamples]] = []  # of the last step, by its parts

    @property
    def samples(self) -> Mapping[str, SensorSamples]:
        """Samples of the other sensors that became available in the last step, by name."""
        return join_samples(self._samples)

    @property
    def time_ns(self) -> int:
        """Present time [ns since start_utc]."""
        return round(self.simulation.time_s * NS_PER_S)

    @property
    def next_flash_ns(self) -> int | None:
        """Time of the next flash [ns since start_utc]; None after the last."""
        time_s = self.simulation.next_flash_s
        return None if time_s is None else round(time_s * NS_PER_S)

    @property
    def is_over(self) -> bool:
        """Whether the last flash has been made, and no reading is in transit."""
        return self.simulation.is_over and not self._readings

    def reset(self, seed: int | None = None) -> None:
        """Go back to t = 0, before the first flash.

        Parameters
        ----------
        seed : as for `Simulation.reset`
        """
        self.simulation.reset(seed)
        self._active, self._commands, self._readings, self._samples = None, [], [], []
        self.frame = self.delivered = None
        self.dropped = 0

    def step(
        self,
        command: Command | None = None,
        *,
        dt_ns: int | None = None,
        stamp_ns: int | None = None,
        skip: bool = False,
    ) -> Delivery | None:
        """Go to the next flash, or go on by a time.

        Parameters
        ----------
        command : acts from `stamp_ns` plus the latency of commands on, until the next one acts. None is an empty command
        dt_ns : length of the step [ns] (None: to the next flash)
        stamp_ns : when flight software gave the command [ns since start_utc] (None: as soon as it could)
        skip : whether the next flash is left out. It needs a step to the next flash

        Returns
        -------
        the flash of a step to the next flash; the reading that arrived, if any, of a step by a time.

        Raises
        ------
        ScenarioError
            As `Simulation.step`, and for more commands than can wait. Everything is then as before.
        """
        before = self.save()
        try:
            self._queue(command, stamp_ns)
            self.frame, self._samples, self.steps = None, [], []
            end_ns = self.next_flash_ns if dt_ns is None else self.time_ns + dt_ns
            if dt_ns is None:
                return self._fly_to_flash(end_ns, skip=skip)
            if not self.simulation.is_over:
                self._fly(self.time_ns + dt_ns)
            elif not self._readings:
                self.simulation.step(dt_s=dt_ns / NS_PER_S)  # raises the error that it is over
            else:
                end_ns = self._readings[0].t_available_ns
            return self._receive(end_ns)
        except BaseException:
            self.restore(before)
            raise

    def _queue(self, command: Command | None, stamp_ns: int | None) -> None:
        """Put a command in the queue of those that wait for their time."""
        if not self.simulation.is_over:
            self.simulation.check_command(command)  # a command that cannot be given must not wait in the queue
        if len(self._commands) >= MOST_COMMANDS:
            raise ScenarioError(
                f"command: {MOST_COMMANDS} commands wait for their time already; give commands with earlier time stamps"
            )
        if stamp_ns is None:
            known = self.delivered.t_available_ns if self.delivered else None
            stamp_ns = max(self.time_ns, known or 0)
        self._commands.append((stamp_ns + round(self.link.command_latency_s * NS_PER_S), command))
        self._commands.sort(key=lambda entry: entry[0])  # stable: of equal ones the last given acts

    def _take_command(self) -> int | None:
        """Activate the commands whose time has come, and return the time of the next one [ns]; None for none."""
        while self._commands and self._commands[0][0] <= self.time_ns:
            self._active = self._commands.pop(0)[1]
        return self._commands[0][0] if self._commands else None

    def _fly_to_flash(self, end_ns: int | None, *, skip: bool) -> Delivery:
        """Go to the next flash and make it, or leave it out."""
        while (change_ns := self._take_command()) is not None and end_ns is not None and change_ns < end_ns:
            self._go_on(change_ns)
        self.steps.append(FlownStep(self.time_ns, None, self._active, skip))
        if skip:
            moment = self.simulation.advance(self._active)
            self._samples.append(self.simulation.samples)
            return Delivery(moment.index, "skipped", self.time_ns, None, None)
        self.frame = self.simulation.step(self._active)
        self._samples.append(self.simulation.samples)
        delivery = self._send(self.frame)
        if delivery.observation is not None:
            self.delivered = delivery
        return delivery

    def _fly(self, end_ns: int) -> None:
        """Go on to a time, and make the flash on the way."""
        while self.time_ns < end_ns and not self.simulation.is_over:
            change_ns = self._take_command()
            stop_ns = end_ns if change_ns is None else min(change_ns, end_ns)
            if (frame := self._go_on(stop_ns)) is None:
                continue
            if self.frame is not None:
                raise ScenarioError(
                    f"dt: a step that ends at {end_ns / NS_PER_S:g} s contains two flashes; a step contains at most one"
                )
            self.frame = frame
            if (delivery := self._send(frame)).observation is not None:
                self._readings.append(delivery)
                self._readings.sort(key=lambda reading: reading.t_available_ns or 0)

    def _go_on(self, end_ns: int) -> Frame | None:
        """Go on to a time under the active command; return the frame of a flash on the way."""
        length_ns = end_ns - self.time_ns
        self.steps.append(FlownStep(self.time_ns, length_ns, self._active))
        frame = self.simulation.step(self._active, dt_s=length_ns / NS_PER_S)
        self._samples.append(self.simulation.samples)
        return frame

    def _send(self, frame: Frame) -> Delivery:
        """Send a frame through the link."""
        emitted_ns = round(frame.time_s * NS_PER_S)
        delay_s, is_lost = 0.0, False
        if self._has_link:
            delay_s, is_lost = self.link.draw(self.simulation.scenario.rng(frame.index, LINK))
        if is_lost:
            self.dropped += 1
            return Delivery(frame.index, "dropped", emitted_ns, None, None)
        return Delivery(frame.index, "delivered", emitted_ns, emitted_ns + round(delay_s * NS_PER_S), frame.observation)

    def _receive(self, now_ns: int | None) -> Delivery | None:
        """Return the reading that has arrived by now, if any; a second one follows with the next step."""
        if not self._readings or now_ns is None or (self._readings[0].t_available_ns or 0) > now_ns:
            return None
        self.delivered = self._readings.pop(0)
        return self.delivered

    def save(self) -> LinkedState:
        """Return the present state, from which `restore` goes on."""
        return LinkedState(
            self.simulation.save(),
            self._active,
            tuple(self._commands),
            tuple(self._readings),
            self.delivered,
            self.dropped,
        )

    def restore(self, state: LinkedState) -> None:
        """Go on from a state that was saved.

        Parameters
        ----------
        state : from `save`
        """
        self.simulation.restore(state.simulation)
        self._active, self.delivered, self.frame = state.active, state.delivered, None
        self._commands, self._readings, self._samples = list(state.commands), list(state.readings), []
        self.dropped = state.dropped

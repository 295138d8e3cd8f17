"""The course of a run: motions and attitudes of the bodies at all flashes, with or without commands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rso_lidar.errors import ScenarioError, did_you_mean, suppress_warnings
from rso_lidar.motion.attitudes.slew import Slew
from rso_lidar.motion.bodies.body import Body
from rso_lidar.motion.bodies.order import list_dependencies
from rso_lidar.motion.body_truth import truth
from rso_lidar.motion.dynamics.commands import CommandedFlight
from rso_lidar.orbit import Epochs
from rso_lidar.records import Command, Truth

_BLOCK = 4096  # instants in one evaluation of an exposure; bounds memory
_MOST_BLOCKS = 4


@dataclass(frozen=True)
class CourseState:
    """State of a course: the present instant [s], and the states of commanded flights by name."""

    now_s: float
    flights: Mapping[str, Any]


class Course:
    """Truth of the bodies at each flash, without PTU and lidar.

    Without state-space models or FMUs under command, the truth of all flashes is computed in one batch. With them, each
    flash is computed separately, because the inputs of the controller change the motion.

    Parameters
    ----------
    bodies : all bodies
    epochs : of the flashes
    local : whether the world is local, without an Earth
    sun_direction : direction to the Sun of a local world; None for none
    commanded : whether a controller may give inputs to state-space models and FMUs
    exposure_s : time during which the pulses of a flash are sent, half of it before and half after its epoch [s]
    """

    def __init__(
        self,
        bodies: Sequence[Body],
        epochs: Epochs,
        *,
        local: bool,
        sun_direction: Sequence[float] | None = None,
        commanded: bool = False,
        exposure_s: float = 0.0,
    ) -> None:
        self.bodies, self.is_local, self.start_utc = bodies, local, epochs.start_utc
        self._epochs, self._sun = epochs, sun_direction
        self.flights: dict[str, CommandedFlight] = {}
        if commanded:
            self.flights = {name: model.begin_flight() for body in bodies for name, model in body.models.items()}
        _check_slews(bodies, self.flights)
        self._whole = None if self.flights else self._at(epochs)
        if exposure_s > 0.0:  # a motion that ends during the last exposure is an error now
            self._near(slice(-1, None) if self._whole else slice(0, 1), np.array([-0.5, 0.5]) * exposure_s)
        self._blocks: dict[tuple[int, bytes], Truth] = {}
        self._needed: dict[str, Sequence[Body]] = {}
        self._now_s = 0.0

    def at(self, row: int, command: Command | None) -> Truth:
        """Return the truth of one flash, without PTU and lidar.

        Parameters
        ----------
        row : number of the flash
        command : given at the present instant, which is that of the previous call. Its inputs hold from there on

        Raises
        ------
        ScenarioError
            If the command gives inputs to an unknown model, or inputs of the wrong number
        """
        self.advance(float(self._epochs.time_s[row]), command)
        if self._whole is not None:
            return self._whole.at(row)
        if row == 0:
            return self._at(self._epochs.at(row)).at(0)
        with suppress_warnings():  # the first flash has given all warnings
            return self._at(self._epochs.at(row)).at(0)

    def advance(self, time_s: float, command: Command | None) -> None:
        """Go on to an instant under a command.

        Parameters
        ----------
        time_s : instant [s], the present one from here on
        command : as for `at`

        Raises
        ------
        ScenarioError
            As `at`
        """
        for name, inputs in self.read_inputs(command).items():
            self.flights[name].hold(self._now_s, inputs)
        self._now_s = max(self._now_s, time_s)

    def read_inputs(self, command: Command | None) -> dict[str, np.ndarray]:
        """Return the inputs (m,) that a command gives, by name of the model.

        Parameters
        ----------
        command : as for `at`

        Raises
        ------
        ScenarioError
            As `at`
        """
        given = None if command is None else command.inputs
        if given is not None and not isinstance(given, Mapping):
            raise ScenarioError(
                f"command: inputs are {given!r:.60}; give a dictionary with a row of numbers for each body"
            )
        for name in given or {}:
            if name not in self.flights:
                guess = did_you_mean(str(name), self.flights)
                raise ScenarioError(
                    f"command: inputs are given for '{name}', which has no state-space model or FMU with inputs{guess} "
                    f"(known: {', '.join(self.flights) or 'none'})"
                )
        return {name: self.flights[name].check_inputs(_read_inputs(name, row)) for name, row in (given or {}).items()}

    def now(self, time_s: float) -> Truth:
        """Return the truth at an instant that is not after the present one, without PTU and lidar.

        Parameters
        ----------
        time_s : the instant [s]
        """
        return self.moving(np.array([time_s])).at(0)

    def moving(self, time_s: np.ndarray, *, for_body: Body | None = None) -> Truth:
        """Return the batch of truths at instants that are not after the present one, without PTU and lidar.

        Parameters
        ----------
        time_s : (time) instants [s]
        for_body : the only body that is needed, with those on which it depends (None: all)
        """
        bodies = self.bodies
        if for_body is not None:
            if for_body.name not in self._needed:
                needed = {dependency.name: dependency for dependency in list_dependencies(for_body, self.bodies)}
                self._needed[for_body.name] = [*(needed | {for_body.name: for_body}).values()]
            bodies = self._needed[for_body.name]
        with suppress_warnings():  # the flashes themselves have given all warnings
            return self._at(Epochs(self.start_utc, time_s), bodies)

    def flights_of(self, body: Body) -> dict[str, CommandedFlight]:
        """Return the flights of a body's commanded models, as ``motion`` and ``attitude``.

        Parameters
        ----------
        body : one of the bodies
        """
        flights = {}
        for name, model in body.models.items():
            place = "motion" if model is body.motion else "attitude"
            flights[place] = self.flights.get(name) or model.fly_open_loop()
        return flights

    def save(self) -> CourseState:
        """Return the present state, from which `restore` goes on."""
        return CourseState(self._now_s, {name: flight.save() for name, flight in self.flights.items()})

    def restore(self, state: CourseState) -> None:
        """Go on from a saved state.

        Parameters
        ----------
        state : from `save`, of a course with the same bodies

        Raises
        ------
        ScenarioError
            If the state has other state-space models
        """
        if state.flights.keys() != self.flights.keys():
            raise ScenarioError(
                f"restore: the state has the state-space models {sorted(state.flights)}, the scenario "
                f"{sorted(self.flights)}; give a state of this scenario"
            )
        self._now_s, self._blocks = state.now_s, {}
        for name, flight in self.flights.items():
            flight.restore(state.flights[name])

    def during(self, row: int, offsets_s: np.ndarray) -> Truth:
        """Return the truths, without PTU and lidar, about the flash of the last call of `at`, under the same command.

        Without commands it is computed for a block of flashes in one batch.

        Parameters
        ----------
        row : number of the flash
        offsets_s : (time) instants after the flash, ascending; negative ones are before it [s]
        """
        self._now_s = max(self._now_s, float(self._epochs.time_s[row] + offsets_s[-1]))
        if self._whole is None:
            return self._near(slice(row, row + 1), offsets_s)
        rows = max(1, _BLOCK // len(offsets_s))
        key = row // rows, offsets_s.tobytes()
        if key not in self._blocks:
            while len(self._blocks) >= _MOST_BLOCKS:
                del self._blocks[next(iter(self._blocks))]
            self._blocks[key] = self._near(slice(key[0] * rows, (key[0] + 1) * rows), offsets_s)
        first = (row % rows) * len(offsets_s)
        return self._blocks[key].some(slice(first, first + len(offsets_s)))

    def _near(self, rows: slice, offsets_s: np.ndarray) -> Truth:
        """Compute the truth at instants about some flashes, flash by flash."""
        return self.moving(np.add.outer(self._epochs.time_s[rows], offsets_s).ravel())

    def _at(self, epochs: Epochs, bodies: Sequence[Body] | None = None) -> Truth:
        return truth(bodies or self.bodies, epochs, local=self.is_local, sun_direction=self._sun, flights=self.flights)


def _check_slews(bodies: Sequence[Body], flights: dict[str, CommandedFlight]) -> None:
    """Refuse slews that depend on a body under command, whose future position is unknown when the slew is planned."""
    for body in bodies:
        if not isinstance(body.attitude, Slew):
            continue
        moved = [
            dependency.name
            for dependency in list_dependencies(body, bodies)
            if dependency.name in flights or f"{dependency.name}.attitude" in flights
        ]
        if moved:
            raise ScenarioError(
                f"{body.name}.attitude: a slew is planned ahead, and a controller moves '{moved[0]}', on which it depends; "
                "use one law, or turn the body by a 'state_space' attitude"
            )


def _read_inputs(name: str, inputs: object) -> np.ndarray:
    try:
        return np.array(inputs, dtype=float, ndmin=1)
    except (TypeError, ValueError):
        raise ScenarioError(f"command: inputs for '{name}' are {inputs!r:.60}; give a row of numbers") from None

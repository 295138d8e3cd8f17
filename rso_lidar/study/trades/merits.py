"""Figures of merit: single numbers that evaluate a run of a scenario, each with its unit and the better direction."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any, Literal

import numpy as np

from rso_lidar import units
from rso_lidar.evaluation import Tracking, tracking
from rso_lidar.mission_analysis import fly_open_loop, in_field_fraction
from rso_lidar.records import Frame, compute_viewing_geometry
from rso_lidar.scenario import Scenario, cast_surfaces, find_probability
from rso_lidar.simulation import simulate
from rso_lidar.study.trades.run_sums import RunSums

_ONE_SIGMA = math.erf(math.sqrt(0.5))  # share of a normal distribution within one standard deviation
_WHOLE = 0.999  # share of a target's bounds in the field from which the whole target counts as in the field


class CountedFrames(Sequence[Frame]):
    """The frames of a run as a sequence that hands each to a function and keeps none; a single one is simulated anew."""

    def __init__(
        self,
        scenario: Scenario,
        numbers: np.ndarray,
        threads: int | None,
        add: Callable[[Frame], None],
        executor: Executor | None = None,
    ) -> None:
        """Start a run."""
        self._fly = partial(simulate, scenario, threads=threads, executor=executor)
        self._numbers, self._add = numbers.tolist(), add
        self._made = self._fly(frames=self._numbers)
        self._first = next(self._made)

    def __len__(self) -> int:
        return len(self._numbers)

    def __getitem__(self, index: Any) -> Any:
        return self._first if index == 0 else next(self._fly(frames=[self._numbers[index]]))

    def __iter__(self) -> Iterator[Frame]:
        self._add(self._first)
        yield self._first
        for frame in self._made:
            self._add(frame)
            yield frame


@dataclass(frozen=True, eq=False)
class Run:
    """One run of a scenario, evaluated for one target: the sums over its simulated frames, if any.

    `frames` are the indices of the frames that a study selects, rendered or not.
    `tracker_error_m` (frame) is the length of the filter's position error [m], NaN before the first fix.
    """

    scenario: Scenario
    number: int
    sums: RunSums
    tracker_error_m: np.ndarray
    frames: np.ndarray

    @cached_property
    def truth(self) -> Any:
        """Truth of all frames of the scenario as one batch, without simulating a flash."""
        return fly_open_loop(self.scenario)[0]

    @property
    def target(self) -> str:
        """Name of the target."""
        return self.scenario.target[self.number].name


@dataclass(frozen=True)
class Merit:
    """One figure of merit: `needs` states what must be computed for it, and `better` the better direction.

    Values are rounded to `decimals`, so that rounding errors decide no ranking. With `of_detected` it describes the pixels
    that report the target, and ranks a point only where enough of them do. `noise` states how the noise of frames enters:
    not at all, in a proportion or a count, in other sums over frames, or in a tracker that follows from frame to frame.
    """

    name: str
    unit: str
    better: Literal["more", "less"]
    needs: Literal["truth", "frames", "tracker"]
    meaning: str
    value: Callable[[Run], float]
    decimals: int = 6
    of_detected: bool = False
    noise: Literal["none", "proportion", "count", "frames", "track"] = "none"

    def of(self, run: Run) -> float:
        """Return the value of a run, to `decimals`."""
        return round(float(self.value(run)), self.decimals) + 0.0  # no -0

    @property
    def sign(self) -> float:
        """1 where more is better, else −1."""
        return 1.0 if self.better == "more" else -1.0


def _ratio(over: float, under: float) -> float:
    return over / under if under else math.nan


def _rms(values: np.ndarray) -> float:
    known = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(known**2))) if known.size else math.nan


def _off_boresight_deg(run: Run) -> float:
    return _rms(compute_viewing_geometry(run.truth, run.target).off_boresight_rad) / units.DEG


def _time_in_field_s(run: Run) -> float:
    whole = in_field_fraction(run.scenario, run.truth, run.number) >= _WHOLE
    return float(np.sum(whole)) / run.scenario.time.frame_rate_hz


def _found_probability(run: Run) -> float:
    truth = fly_open_loop(run.scenario, run.frames)[0]
    probabilities = []
    for row in range(len(run.frames)):
        there = truth.at(row)
        lidar = run.scenario.instrument.at(float(there.time_s))
        seen = cast_surfaces(lidar, run.scenario.surfaces, there, run.number)
        probabilities.append(find_probability(lidar, seen, run.scenario.finding, stream=int(run.frames[row])))
    return float(np.mean(probabilities))


MERITS = {
    merit.name: merit
    for merit in (
        Merit(
            "pixels_on_target", "pixels", "more", "frames",
            "pixels with lit surface of the target in them, mean of the flashed frames",
            lambda run: _ratio(run.sums.pixels, run.sums.frames),
        ),
        Merit(
            "returns_on_target", "pixels", "more", "frames",
            "pixels on the target that report its range, mean of the flashed frames",
            lambda run: _ratio(run.sums.found, run.sums.frames),
            of_detected=True,
            noise="frames",
        ),
        Merit(
            "detection_fraction", "1", "more", "frames",
            "of all pixels on the target, the share that reports its range",
            lambda run: _ratio(run.sums.found, run.sums.pixels),
            decimals=9,
            noise="proportion",
        ),
        Merit(
            "found_fraction", "1", "more", "frames",
            "of the flashed frames, the share in which at least `finding.pixels` of the scenario report the target's range",
            lambda run: _ratio(run.sums.hits, run.sums.frames),
            decimals=9,
            noise="proportion",
        ),
        Merit(
            "found_probability", "1", "more", "truth",
            "probability that the whole target is found, as `finding` of the scenario says; from the light of the flashed "
            "frames, mean of all",
            _found_probability,
            decimals=9,
        ),
        Merit(
            "photons_per_pixel", "photons", "more", "frames",
            "expected photons of a pixel on the target, mean of all",
            lambda run: _ratio(run.sums.photons, run.sums.pixels),
            decimals=9,
        ),
        Merit(
            "range_error_m", "m", "less", "frames",
            "68.3 % of the pixels that report the target's range are within this of the true one: 1 sigma, but for "
            "the tails",
            lambda run: run.sums.error_within_m(_ONE_SIGMA),
            of_detected=True,
            noise="frames",
        ),
        Merit(
            "range_rms_m", "m", "less", "frames",
            "rms of reported less true range of those pixels, with edges, where a pixel sees two surfaces",
            lambda run: math.sqrt(_ratio(run.sums.squared_m2, run.sums.found)),
            of_detected=True,
            noise="frames",
        ),
        Merit(
            "false_returns", "pixels", "less", "frames",
            "pixels that report a range where no target is, mean of the flashed frames",
            lambda run: _ratio(run.sums.false, run.sums.frames),
            noise="count",
        ),
        Merit(
            "tracker_error_m", "m", "less", "tracker",
            "rms distance of the constant-velocity filter's estimate (`rso-lidar track`) from the target's origin, over the "
            "flashed frames from the first fix. Of several targets in the field, the filter follows the nearest",
            lambda run: _rms(run.tracker_error_m),
            of_detected=True,
            noise="track",
        ),
        Merit(
            "time_in_field_s", "s", "more", "truth",
            "how long the target's bounds are wholly in the field; from all frames of the scenario, none of them flashed",
            _time_in_field_s,
        ),
        Merit(
            "off_boresight_deg", "deg", "less", "truth",
            "rms angle from the boresight to the target's origin; from all frames of the scenario, none of them flashed",
            _off_boresight_deg,
        ),
    )
}  # fmt: skip


DETECTION = "detection_fraction"


def list_evaluated(names: Sequence[str]) -> tuple[str, ...]:
    """List the figures of merit of a run: those requested, and the detection fraction where one depends on it."""
    lacks_detection = any(MERITS[name].of_detected for name in names) and DETECTION not in names
    return (*names, DETECTION) if lacks_detection else tuple(names)


def evaluate(
    scenario: Scenario,
    names: Sequence[str],
    number: int,
    frames: np.ndarray,
    *,
    folder: Path | None = None,
    threads: int | None = None,
) -> dict[str, float]:
    """Compute figures of merit by name, NaN where one has no meaning; frames are simulated only where one needs them.

    Parameters
    ----------
    names : keys of `MERITS`
    number : index of the evaluated target
    frames : indices of the simulated frames
    folder : folder of the mesh files that the scenario names
    threads : number of threads (None: one for each core); the result does not depend on it
    """
    needs = {MERITS[name].needs for name in names}
    sums = RunSums(number, bounding_diagonal_m(scenario, number), scenario.finding.pixels)
    error_m = np.empty(0)
    if needs & {"frames", "tracker"}:
        passing = CountedFrames(scenario, frames, threads, sums.add)
        if "tracker" in needs:
            table = tracking(passing, scenario.target[number].name, folder=folder, poses=False).table
            error_m = measure_tracker_error_m(table)
        else:
            for _ in passing:
                pass
    run = Run(scenario, number, sums, error_m, frames)
    return {name: MERITS[name].of(run) for name in names}


def measure_tracker_error_m(table: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return the length (frame) [m] of the position error of the constant-velocity filter in a table of `tracking`."""
    error_m: np.ndarray = np.linalg.norm([table[f"cv_error_{axis}_m"] for axis in Tracking.AXES], axis=0)
    return error_m


def bounding_diagonal_m(scenario: Scenario, number: int) -> float:
    """Return the diagonal of a target's bounding box [m] with hinges at zero, at least 1 m."""
    corners = scenario.corners_of(number).reshape(-1, 3)
    return max(float(np.linalg.norm(corners.max(axis=0) - corners.min(axis=0))), 1.0)

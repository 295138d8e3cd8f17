"""A mission flown many times with errors: probabilities, spreads of the path, and what they come from."""

from __future__ import annotations

import hashlib
import importlib.metadata
import zipfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np

from rso_lidar import units
from rso_lidar.confidence_intervals import clopper_pearson_bounds
from rso_lidar.errors import ScenarioError, suppress_warnings
from rso_lidar.files import write_atomically
from rso_lidar.motion import proximity
from rso_lidar.motion.motions.motion import chief_of, has_orbit
from rso_lidar.motion.truth import Chief
from rso_lidar.orbit import Epochs
from rso_lidar.picture.plots.dispersion import dispersion_figure
from rso_lidar.picture.style.output import save_figure_or_table
from rso_lidar.picture.style.palette import LIGHT, Scheme
from rso_lidar.processes import Processes
from rso_lidar.rpo.dispersed.dispersed_paths import SOURCES, Disperser
from rso_lidar.rpo.plans.keep_out import KeepOutSphere
from rso_lidar.scenario import Dispersion, Scenario, require_scenario
from rso_lidar.study.dispersions.outcomes import (
    find_nearest_m,
    find_off_axis_rad,
    make_detection,
)

_BLOCK = 250  # runs that are flown together
_MOST_RUNS, _MOST_SAMPLES = 1_000_000, 600
_DRAWS = 7  # spawn key of the numbers of a run
_CONFIDENCE = 0.95
PERCENTILES = (2.5, 50.0, 97.5)
_AXES = ("radial", "along", "cross")
Block = dict[str, np.ndarray]


@dataclass(frozen=True, eq=False)
class DispersedMission:
    """Runs of a mission with errors.

    Parameters
    ----------
    title, target : of the scenario, and name of the target
    table : columns (run) by name: nearest approach, collision, keep-out, field, detection and delta-v of each run
    tubes : columns (time) by name: the flight without errors, standard deviations by runs and by linear covariance with
        their shares by source, percentiles, and the probability that the target was detected by then
    hard_body_radius_m, keep_out_m : distances that count as a collision and as a violation [m]
    omits : what the runs leave out, in sentences
    """

    title: str
    target: str
    table: dict[str, np.ndarray]
    tubes: dict[str, np.ndarray]
    hard_body_radius_m: float
    keep_out_m: float
    omits: tuple[str, ...] = ()

    @property
    def n_runs(self) -> int:
        """Number of runs."""
        return len(self.table["run"])

    def probability(self, column: str) -> tuple[float, float, float]:
        """Return the share of runs with an event, and the bounds of its 95 % confidence interval.

        Parameters
        ----------
        column : of `table` with 0 or 1 for each run, such as ``collision``
        """
        share = float(np.mean(self.table[column]))
        one_sided = 0.5 + 0.5 * _CONFIDENCE
        low, high = clopper_pearson_bounds(share, self.n_runs, one_sided)
        return share, low, high

    def describe(self) -> str:
        """Describe probabilities and spreads in lines of text."""
        last = {key: float(values[-1]) for key, values in self.tubes.items()}
        rows = [
            ("collision", "collision", f"nearer than {self.hard_body_radius_m:.3g} m"),
            ("collision, no burn made", "collision_without_burns", "the first burn and all after it fail"),
        ]
        if self.keep_out_m > 0.0:
            rows.append(("keep-out entered", "keep_out", f"{self.keep_out_m:g} m"))
        rows.append(("held in the field", "held_always", "in every sample"))
        lines = [f"{self.title}: {self.n_runs:,} runs about {self.target}"]
        for word, column, about in rows:
            share, low, high = self.probability(column)
            lines.append(f"  P({word}) {share:.4g}  (95 %: {low:.4g} to {high:.4g}; {about})")
        lines.append(f"  P(detected by the end) {last['detected_probability']:.4g}")
        nearest = np.percentile(self.table["nearest_m"], PERCENTILES)
        lines.append("  nearest approach  " + " / ".join(f"{one:,.1f}" for one in nearest) + " m (2.5, 50, 97.5 %)")
        spent = np.percentile(self.table["delta_v_m_s"], PERCENTILES)
        lines.append("  delta-v of burns  " + " / ".join(f"{one:,.4f}" for one in spent) + " m/s (2.5, 50, 97.5 %)")
        lines.append("  at the end            runs    linear  " + "".join(f"{name:>12}" for name in SOURCES))
        for axis in _AXES:
            shares = "".join(f"{100.0 * last[f'{axis}_{name}_share']:10.1f} %" for name in SOURCES)
            lines.append(
                f"    {axis:6} sigma {last[f'{axis}_sigma_m']:11.3f} {last[f'{axis}_linear_sigma_m']:9.3f} m{shares}"
            )
        return "\n".join([*lines, *(f"  {line}" for line in self.omits)])

    def figure(self) -> Any:
        """Return a matplotlib Figure: the tubes of the path, the range, and the probability of detection over time."""
        return dispersion_figure(
            self.tubes, self.table, self.target, self.title, self.keep_out_m, self.hard_body_radius_m
        )

    def save(self, path: str | Path, scheme: Scheme = LIGHT) -> Path:
        """Write the table of runs, or the picture; an existing file is replaced.

        Parameters
        ----------
        path : of the output, .csv, .png, .pdf or .svg
        scheme : of a picture, `LIGHT` or `DARK`
        """
        return save_figure_or_table(path, self.figure, self.table, scheme)

    def save_tubes(self, path: str | Path) -> Path:
        """Write the table of spreads over time as CSV; an existing file is replaced."""
        return save_figure_or_table(path, self.figure, self.tubes, LIGHT)


class MissionDisperser:
    """The runs of one scenario, block by block. A worker process makes its own from the scenario.

    Parameters
    ----------
    scenario : what is flown
    target : name of the target
    """

    def __init__(self, scenario: Scenario, target: str) -> None:
        self.scenario, self.target = scenario, target
        self.dispersion = scenario.dispersion or Dispersion()

    def __getstate__(self) -> dict[str, Any]:
        return {"scenario": self.scenario, "target": self.target, "dispersion": self.dispersion}

    @cached_property
    def sample_s(self) -> np.ndarray:
        """Instants of the samples (time,) [s]: those of all frames, or of 600 of them."""
        time_s = self.scenario.epochs().time_s
        chosen = np.unique(np.linspace(0, len(time_s) - 1, min(len(time_s), _MOST_SAMPLES)).round().astype(int))
        picked: np.ndarray = time_s[chosen]
        return picked

    @cached_property
    def flashes(self) -> np.ndarray:
        """Number of flashes (time,) from each sample to the next."""
        counted = np.diff(self.sample_s, append=self.sample_s[-1]) * self.scenario.time.frame_rate_hz
        made: np.ndarray = np.maximum(counted.round(), 1.0)
        return made

    @cached_property
    def disperser(self) -> Disperser:
        """The flight that is dispersed."""
        bodies, start_utc = self.scenario.bodies, self.scenario.time.start_utc
        with self.scenario.locate_errors(), suppress_warnings():
            found = proximity.find_nominal_flight(bodies[-1], bodies, start_utc, self.target, float(self.sample_s[-1]))
            found = replace(
                found,
                thrusters=self.dispersion.thrusters or found.thrusters,
                navigation=self.dispersion.navigation or found.navigation,
            )
            return Disperser(found, self.sample_s, self.dispersion.start_covariance)

    @cached_property
    def nominal_m(self) -> np.ndarray:
        """Positions (time, 3) of the flight without errors [m], in the rtn axes of the target."""
        flight = self.disperser.flight
        axes, _ = flight.chief_axes(self.sample_s)
        chief = Chief(self.scenario.bodies, self.target).states(Epochs(flight.start_utc, self.sample_s))
        made: np.ndarray = np.einsum("tji,tj->ti", axes, flight.craft_m(self.sample_s) - chief.position_m)
        return made

    @cached_property
    def keep_out(self) -> KeepOutSphere:
        """The keep-out sphere of the plan, or of the scenario's constraints."""
        limits, flown = self.scenario.constraints, self.scenario.follower.motion
        found = getattr(getattr(flown, "plan", flown), "keep_out", None)
        if isinstance(found, KeepOutSphere) and found.radius_m > 0.0:
            return found
        return KeepOutSphere((limits.radius_m(self.target) if limits is not None else None) or 0.0)

    @cached_property
    def hard_body_radius_m(self) -> float:
        """Distance from the target's origin that counts as a collision [m]."""
        if self.dispersion.hard_body_radius_m is not None:
            return self.dispersion.hard_body_radius_m
        return next(one.radius_m for one in self.scenario.surfaces if one.body == self.target)

    def draw(self, runs: range) -> np.ndarray:
        """Return standard normal numbers (run, number): three of the instrument, then those of the flight."""
        count = 3 + self.disperser.n_numbers
        return np.stack(
            [
                np.random.Generator(
                    np.random.Philox(np.random.SeedSequence(self.scenario.seed, spawn_key=(_DRAWS, run)))
                ).standard_normal(count)
                for run in runs
            ]
        )

    def fly(self, runs: range) -> Block:
        """Fly some runs, and return columns (run, …) by name."""
        numbers = self.draw(runs)
        paths = self.disperser.fly(numbers[:, 3:])
        drifts = self.disperser.fly(numbers[:, 3:], without_burns=True)
        position = self.nominal_m + paths.deviation_m
        nearest, place = find_nearest_m(position)
        drifting, _ = find_nearest_m(self.nominal_m + drifts.deviation_m)
        half_field = np.array(
            [
                float(np.arctan(self.scenario.instrument.at(float(at_s)).receiver.field_edge).min())
                for at_s in self.sample_s
            ]
        )
        bias = self.dispersion.pointing_sigma_deg * units.DEG * numbers[:, :2]
        off = find_off_axis_rad(position, self.nominal_m, bias, follows_target=self.dispersion.pointing == "target")
        held = off <= half_field
        energy = np.maximum(1.0 + self.dispersion.energy_sigma_fraction * numbers[:, 2], 0.05)
        range_m = np.sqrt(np.sum(position**2, axis=2))
        missed = np.ones((len(numbers), len(self.sample_s)))
        left = np.ones(len(numbers))
        for k, flashes in enumerate(self.flashes):
            chance = np.where(held[:, k], self._detect(k, range_m[:, k], energy), 0.0)
            left = left * (1.0 - chance) ** flashes
            missed[:, k] = left
        return {
            "run": np.arange(runs.start, runs.stop),
            "nearest_m": nearest,
            "nearest_s": np.interp(place, np.arange(len(self.sample_s)), self.sample_s),
            "collision": (nearest < self.hard_body_radius_m).astype(int),
            "nearest_without_burns_m": drifting,
            "collision_without_burns": (drifting < self.hard_body_radius_m).astype(int),
            "keep_out": (self.keep_out.clear_m(position) < 0.0).any(axis=1).astype(int),
            "held_fraction": held.mean(axis=1),
            "held_always": held.all(axis=1).astype(int),
            "detected_probability": 1.0 - missed[:, -1],
            "delta_v_m_s": paths.delta_v_m_s,
            "deviation_m": paths.deviation_m,
            "missed": missed,
        }

    @cached_property
    def _detect(self) -> Callable[[int, np.ndarray, np.ndarray], np.ndarray]:
        """The probability that a flash detects the target, by sample, range and energy."""
        distance = np.linalg.norm(self.nominal_m, axis=1)
        span_m = max(0.05 * float(distance.min()), 1.0), 2.0 * float(distance.max()) + 100.0
        return make_detection(self.scenario, self.sample_s, span_m)

    def join(self, block: Block) -> DispersedMission:
        """Return the result of all runs."""
        position = self.nominal_m + block.pop("deviation_m")
        missed = block.pop("missed")
        linear = self.disperser.find_linear()
        range_m = np.sqrt(np.sum(position**2, axis=2))
        tubes: dict[str, np.ndarray] = {"time_s": self.sample_s}
        sigma = np.sqrt(np.diagonal(linear.covariance, axis1=1, axis2=2))
        total = np.maximum(sigma[:, :3] ** 2, 1e-300)
        for k, axis in enumerate(_AXES):
            tubes[f"{axis}_m"] = self.nominal_m[:, k]
            tubes[f"{axis}_sigma_m"] = position[:, :, k].std(axis=0, ddof=1)
            tubes[f"{axis}_linear_sigma_m"] = sigma[:, k]
            for name in SOURCES:
                tubes[f"{axis}_{name}_share"] = linear.shares[name][:, k] / total[:, k]
            for level, row in zip(PERCENTILES, np.percentile(position[:, :, k], PERCENTILES, axis=0), strict=True):
                tubes[f"{axis}_p{level:g}_m"] = row
        for level, row in zip(PERCENTILES, np.percentile(range_m, PERCENTILES, axis=0), strict=True):
            tubes[f"range_p{level:g}_m"] = row
        tubes["detected_probability"] = 1.0 - missed.mean(axis=0)
        return DispersedMission(
            self.scenario.name, self.target, block, tubes, self.hard_body_radius_m, self.keep_out.radius_m, _OMITS
        )


_OMITS = (
    "left out: errors of the target's own orbit and attitude, and the change of drag, sunlight and tides over a deviation",
)


def disperse(
    scenario: Scenario,
    runs: int = 1000,
    *,
    target: str | None = None,
    workers: int | None = None,
    working: str | Path | None = None,
    on_runs: Callable[[int, int], None] | None = None,
) -> DispersedMission:
    """Fly a mission many times with errors, and propagate its linear covariance beside.

    Each run draws its errors from the scenario's seed and its own number, so that runs do not depend on how many there are,
    nor on workers. All runs of a block are integrated together; deviations are not linearised.

    Parameters
    ----------
    scenario : with the table `dispersion`
    runs : number of runs, from 2
    target : name of the target (None: the body that the follower approaches, else the first target)
    workers : number of processes (None: this one alone)
    working : file in which finished runs are kept; an interrupted study, or one of fewer runs, continues from it. Its name
        is extended by eight hex digits that identify the scenario.
    on_runs : called with the number of finished runs and that of all, at the start and after each block

    Raises
    ------
    ScenarioError
        If the scenario has no `dispersion`, no orbit or no such target, or numbers are outside their limits.
    """
    require_scenario(scenario, "disperse")
    if not isinstance(runs, int) or isinstance(runs, bool) or not 2 <= runs <= _MOST_RUNS:
        raise ScenarioError(f"runs: needs a whole number from 2 to {_MOST_RUNS:,}, not {runs!r}")
    if workers is not None and (not isinstance(workers, int) or isinstance(workers, bool) or workers < 1):
        raise ScenarioError(f"workers: needs a whole number from 1, not {workers!r}; or leave it out")
    made = MissionDisperser(scenario, _find_target(scenario, target))
    kept = None if working is None else Path(f"{working}.{identify(scenario, made.target)}.npz")
    blocks = _read_blocks(kept) if kept is not None else {}
    tell = on_runs or (lambda done, count: None)
    wanted = list(range(0, runs, _BLOCK))
    tell(min(_BLOCK * sum(begin in blocks for begin in wanted), runs), runs)
    for begin, block in _fly_blocks(made, [one for one in wanted if one not in blocks], workers):
        blocks[begin] = block
        if kept is not None:
            _write_blocks(kept, blocks)
        tell(min(_BLOCK * sum(one in blocks for one in wanted), runs), runs)
    joined = {name: np.concatenate([blocks[begin][name] for begin in wanted])[:runs] for name in blocks[wanted[0]]}
    return made.join(joined)


def identify(scenario: Scenario, target: str) -> str:
    """Return eight hex digits that identify the runs of a scenario: SHA-256 of it, of the target and of the version.

    Parameters
    ----------
    scenario : what is flown
    target : name of the target
    """
    version = importlib.metadata.version("rso-lidar"), scenario.source.versions["arithmetic"]
    return hashlib.sha256("\0".join((scenario.source.scenario, target, *version)).encode()).hexdigest()[:8]


def _find_target(scenario: Scenario, target: str | None) -> str:
    if scenario.dispersion is None:
        raise ScenarioError("disperse: the scenario has no table dispersion; add [dispersion] with the errors")
    names = [one.name for one in scenario.target]
    chief = chief_of(scenario.bodies[-1].motion)
    name = target or (chief if chief in names else next(iter(names), ""))
    if name not in names:
        raise ScenarioError(f"target: no target '{name}' (known: {', '.join(names) or 'none'})")
    moving = {body.name: body.motion for body in scenario.bodies}
    if scenario.is_local or not all(has_orbit(moving[one]) for one in (name, scenario.bodies[-1].name)):
        raise ScenarioError("disperse: needs orbits about the Earth, of the follower and of the target")
    return name


def _fly_blocks(made: MissionDisperser, begins: list[int], workers: int | None) -> Iterator[tuple[int, Block]]:
    """Fly blocks of runs, and yield each with its first run when it is finished.

    Parameters
    ----------
    made : of the scenario
    begins : first runs of the blocks
    workers : number of processes
    """
    if workers is None or workers < 2 or len(begins) < 2:
        yield from ((begin, made.fly(range(begin, begin + _BLOCK))) for begin in begins)
        return
    with Processes(min(workers, len(begins)), partial(_fly_block, made)) as processes:
        yield from processes.map_unordered(begins)


def _fly_block(made: MissionDisperser, begin: int) -> tuple[int, Block]:
    return begin, made.fly(range(begin, begin + _BLOCK))


def _read_blocks(path: Path) -> dict[int, Block]:
    """Read the finished blocks of a file; a damaged one has none."""
    blocks: dict[int, Block] = {}
    with suppress(OSError, ValueError, KeyError, zipfile.BadZipFile), np.load(path, allow_pickle=False) as file:
        for name in file.files:
            begin, _, column = name.partition(":")
            blocks.setdefault(int(begin), {})[column] = file[name]
    return blocks


def _write_blocks(path: Path, blocks: dict[int, Block]) -> None:
    """Write the finished blocks, whole or not at all.

    Parameters
    ----------
    path : of the file
    blocks : by their first runs
    """
    columns: dict[str, Any] = {
        f"{begin}:{name}": value for begin, block in blocks.items() for name, value in block.items()
    }
    with write_atomically(path) as draft, draft.open("wb") as file:
        np.savez(file, **columns)

"""The runs of a mission with errors, block by block."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from rso_lidar import units
from rso_lidar.errors import suppress_warnings
from rso_lidar.motion import Chief, truth
from rso_lidar.orbit import Epochs
from rso_lidar.rpo import KeepOutSphere, NavigationErrors
from rso_lidar.scenario import Scenario
from rso_lidar.study.dispersions.dispersed_flight import DispersedFlight
from rso_lidar.study.dispersions.dispersed_paths import DispersedPaths, Disperser
from rso_lidar.study.dispersions.nominal_flight import find_nominal_flight
from rso_lidar.study.dispersions.outcomes import Sight, find_nearest_m, make_detection
from rso_lidar.study.dispersions.start_errors import resolve_start_errors
from rso_lidar.study.dispersions.target_errors import TargetAttitude

BLOCK = 250  # runs that are flown together
_MOST_SAMPLES = 600
_DRAWS, _FIXES = 7, 8  # spawn keys of the numbers of a run, and of its fixes for pointing
Block = dict[str, np.ndarray]


class MissionDisperser:
    """The runs of one scenario, block by block. A worker process makes its own from the scenario.

    Parameters
    ----------
    scenario : what is flown
    target : name of the target
    """

    def __init__(self, scenario: Scenario, target: str) -> None:
        self.scenario, self.target = scenario, target
        self.dispersion = resolve_start_errors(scenario, target)

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
        n_flashes: np.ndarray = np.maximum(counted.round(), 1.0)
        return n_flashes

    @cached_property
    def disperser(self) -> Disperser:
        """The flight that is dispersed."""
        bodies, start_utc = self.scenario.bodies, self.scenario.time.start_utc
        with self.scenario.locate_errors(), suppress_warnings():
            nominal = find_nominal_flight(bodies[-1], bodies, start_utc, self.target, float(self.sample_s[-1]))
            nominal = replace(
                nominal,
                thrusters=self.dispersion.thrusters or nominal.thrusters,
                navigation=self.dispersion.navigation or nominal.navigation,
            )
            return Disperser(DispersedFlight(nominal, self.sample_s, *self._find_covariances()))

    def _find_covariances(self) -> tuple[np.ndarray, np.ndarray | None, np.ndarray | None]:
        """Return the covariances (6, 6) of the follower's start, of the target's, and of the one with the other."""
        given, errors = self.dispersion, self.dispersion.target
        own = given.start_covariance
        if errors is None or not np.any(errors.start_covariance):
            return own, None, None
        beside = errors.start_covariance
        if given.relative_to_target:  # follower = target + relative state, the two independent
            return own + beside, beside, beside
        return own, beside, None if given.cross_covariance is None else np.array(given.cross_covariance)

    @cached_property
    def attitude(self) -> TargetAttitude | None:
        """Errors of the target's attitude; None for none."""
        errors, scenario = self.dispersion.target, self.scenario
        if errors is None or not errors.has_attitude:
            return None
        with scenario.locate_errors(), suppress_warnings():
            poses = truth(scenario.bodies, Epochs(scenario.time.start_utc, self.sample_s)).poses
        turn = poses.link(self.target, f"{self.target}.rtn").matrix
        return TargetAttitude(errors, np.broadcast_to(turn, (len(self.sample_s), 3, 3)), self.sample_s)

    @cached_property
    def nominal_m(self) -> np.ndarray:
        """Positions (time, 3) of the flight without errors [m], in the rtn axes of the target."""
        flight = self.disperser.flight
        axes, _ = flight.chief_axes(self.sample_s)
        chief = Chief(self.scenario.bodies, self.target).states(Epochs(flight.start_utc, self.sample_s))
        position_m: np.ndarray = np.einsum("tji,tj->ti", axes, flight.craft_m(self.sample_s) - chief.position_m)
        return position_m

    @cached_property
    def keep_out(self) -> KeepOutSphere:
        """The keep-out sphere of the plan, or of the scenario's constraints."""
        limits, flown = self.scenario.constraints, self.scenario.follower.motion
        keep_out = getattr(getattr(flown, "plan", flown), "keep_out", None)
        if isinstance(keep_out, KeepOutSphere) and keep_out.radius_m > 0.0:
            return keep_out
        return KeepOutSphere((limits.radius_m(self.target) if limits is not None else None) or 0.0)

    @cached_property
    def hard_body_radius_m(self) -> float:
        """Distance from the target's origin that counts as a collision [m]."""
        if self.dispersion.hard_body_radius_m is not None:
            return self.dispersion.hard_body_radius_m
        return next(surface.radius_m for surface in self.scenario.surfaces if surface.body == self.target)

    @cached_property
    def pointing(self) -> str:
        """What the lidar is pointed by: "target", "navigation" or "plan"."""
        navigation = self.disperser.flight.navigation
        exact = isinstance(navigation, NavigationErrors) and not np.any(navigation.sigma)
        if self.dispersion.pointing == "navigation" and exact:
            return "target"
        return self.dispersion.pointing or ("target" if exact else "navigation")

    @cached_property
    def sight(self) -> Sight:
        """What of the target is in the field."""
        with self.scenario.locate_errors(), suppress_warnings():
            return Sight(self.scenario, self.target, _MOST_SAMPLES)

    def _find_aim_m(self, runs: range, position_m: np.ndarray, paths: DispersedPaths) -> np.ndarray:
        """Return where pointing takes the follower of each run to be (run, time, 3), or of all (time, 3) [m].

        Parameters
        ----------
        runs : (run) numbers of the runs, from 0
        position_m : (run, time, 3) where they are
        """
        navigation = self.disperser.flight.navigation
        if self.pointing == "plan":
            return self.nominal_m
        if self.pointing == "target":
            return position_m
        if paths.knowledge is not None:
            known: np.ndarray = position_m + paths.knowledge.error_m
            return known
        assert isinstance(navigation, NavigationErrors)
        errors = self._draw_normal(_FIXES, runs, position_m.shape[1:])
        aim_m: np.ndarray = position_m + navigation.position_sigma_m * errors
        return aim_m

    def draw(self, runs: range) -> np.ndarray:
        """Return standard normal numbers (run, number): three of the instrument, those of the flight, those of attitude."""
        count = 3 + self.disperser.n_numbers + (0 if self.attitude is None else self.attitude.n_numbers)
        return self._draw_normal(_DRAWS, runs, (count,))

    def _draw_normal(self, purpose: int, runs: range, shape: tuple[int, ...]) -> np.ndarray:
        """Return standard normal numbers (run, …) of a shape for each run."""
        seeds = [np.random.SeedSequence(self.scenario.seed, spawn_key=(purpose, run)) for run in runs]
        return np.stack([np.random.Generator(np.random.Philox(seed)).standard_normal(shape) for seed in seeds])

    def fly(self, runs: range) -> Block:
        """Fly some runs, and return columns (run, …) by name."""
        numbers = self.draw(runs)
        flight = numbers[:, 3 : 3 + self.disperser.n_numbers]
        paths = self.disperser.fly(flight)
        drifts = self.disperser.fly(flight, without_burns=True)
        position = self.nominal_m + paths.deviation_m
        nearest, place = find_nearest_m(position)
        drifting, _ = find_nearest_m(self.nominal_m + drifts.deviation_m)
        bias = self.dispersion.pointing_sigma_deg * units.DEG * numbers[:, :2]
        held, whole = self.sight.find_held(position, self._find_aim_m(runs, position, paths), bias)
        energy = np.maximum(1.0 + self.dispersion.energy_sigma_fraction * numbers[:, 2], 0.05)
        range_m = np.sqrt(np.sum(position**2, axis=2))
        missed = np.ones((len(numbers), len(self.sample_s)))
        left = np.ones(len(numbers))
        for k, flashes in enumerate(self.flashes):
            chance = np.where(held[:, k], self.detect(k, range_m[:, k], energy), 0.0)
            left = left * (1.0 - chance) ** flashes
            missed[:, k] = left
        in_body = {}
        if self.attitude is not None:
            placed = self.attitude.place_runs(position, numbers[:, 3 + self.disperser.n_numbers :])
            in_body = {f"body_{axis}_m": placed[:, -1, k] for k, axis in enumerate("xyz")} | {"in_body_m": placed}
        block = {
            "run": np.arange(runs.start, runs.stop),
            "nearest_m": nearest,
            "nearest_s": np.interp(place, np.arange(len(self.sample_s)), self.sample_s),
            "collision": (nearest < self.hard_body_radius_m).astype(int),
            "nearest_without_burns_m": drifting,
            "collision_without_burns": (drifting < self.hard_body_radius_m).astype(int),
            "keep_out": (self.keep_out.clear_m(position) < 0.0).any(axis=1).astype(int),
            "held_fraction": held.mean(axis=1),
            "held_always": held.all(axis=1).astype(int),
            "whole_held_fraction": whole.mean(axis=1),
            "whole_held_always": whole.all(axis=1).astype(int),
            "detected_probability": 1.0 - missed[:, -1],
            "delta_v_m_s": paths.delta_v_m_s,
            "deviation_m": paths.deviation_m,
            "missed": missed,
            **in_body,
        }
        if (known := paths.knowledge) is not None:
            block |= {"knowledge_error_m": known.error_m, "filter_sigma_m": known.sigma_m, "nees": known.nees}
        return block

    @cached_property
    def detect(self) -> Callable[[int, np.ndarray, np.ndarray], np.ndarray]:
        """The probability that a flash detects the target, by sample, range and energy."""
        distance = np.linalg.norm(self.nominal_m, axis=1)
        span_m = max(0.05 * float(distance.min()), 1.0), 2.0 * float(distance.max()) + 100.0
        return make_detection(self.scenario, self.sample_s, span_m)

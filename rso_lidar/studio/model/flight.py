"""A scenario flown ahead: what its flashes need, kept, so that a browser can ask for any of its frames at once."""

from __future__ import annotations

import hashlib
import time
from collections import OrderedDict
from functools import cached_property
from threading import Lock

import numpy as np

from rso_lidar.orbit import format_utc
from rso_lidar.picture import even_indices
from rso_lidar.records import Frame, Truth
from rso_lidar.scenario import Scenario
from rso_lidar.simulation import DETECTION, Simulation, flash
from rso_lidar.studio.model.target_colours import find_part_colours

_MOST_FRAMES, _MOST_FLIGHTS, _MOST_FACETS = 400, 4, 150_000
_flights: OrderedDict[str, PreviewFlight] = OrderedDict()
_flights_lock = Lock()


class PreviewFlight:
    """The moments of at most 400 frames of a scenario, evenly chosen with both ends; row k is frame `numbers[k]`."""

    def __init__(self, scenario: Scenario) -> None:
        """Fly a scenario without making its frames."""
        begin = time.perf_counter()
        self.scenario, self.numbers = scenario, even_indices(scenario.time.n_frames, _MOST_FRAMES)
        with Simulation(scenario, frames=self.numbers, commanded=False) as simulation:
            self.moments = [simulation.advance() for _ in self.numbers]
        self.built_s = time.perf_counter() - begin
        self.targets = tuple(target.name for target in scenario.target)
        poses, base = self.moments[0].truth.poses, self.targets[0] if self.targets else "follower"
        self.base = base  # the body that views in space are about
        self.axes = f"{base}.rtn" if f"{base}.rtn" in poses else poses.parent(base)

    @classmethod
    def of(cls, text: str, scenario: Scenario) -> PreviewFlight:
        """Return the flight of a scenario, kept by its text for all tabs; the last four are kept."""
        with _flights_lock:
            if text not in _flights:
                _flights[text] = cls(scenario)
                while len(_flights) > _MOST_FLIGHTS:
                    _flights.popitem(last=False)
            _flights.move_to_end(text)
            return _flights[text]

    def frame(self, row: int, keep: tuple[str, ...] = (), cameras: tuple[str, ...] | None = None) -> Frame:
        """Make the frame of a row, bit for bit that of a run, with the images of some cameras (None: all)."""
        at, traits = self.moments[row], self.scenario.lidar.detector.traits
        lacking = {name for name, has in (("waveforms", traits.has_waveforms), ("taps", traits.has_taps)) if not has}
        rng = self.scenario.rng(at.index, DETECTION)
        kept = tuple(name for name in keep if name not in lacking)
        return flash(
            self.scenario,
            at.truth,
            rng,
            lidar=at.lidar,
            index=at.index,
            keep=kept,
            sensors=at.sensors,
            cameras=cameras,
        )

    def truth(self, row: int) -> Truth:
        """Return where everything is at a row."""
        return self.moments[row].truth

    def find_row(self, time_s: float) -> int:
        """Return the row whose frame is nearest to a time."""
        return int(np.argmin([abs(at.truth.time_s - time_s) for at in self.moments]))

    def matrix(self, row: int, name: str) -> np.ndarray:
        """Return the pose (4, 4) of axes in those that views in space are in."""
        matrix: np.ndarray = self.truth(row).pose(self.axes, name).as_matrix()
        return matrix

    def range_m(self, row: int) -> float:
        """Return the distance from the lidar to the first target [m], NaN without one."""
        if not self.targets:
            return float("nan")
        return float(np.linalg.norm(self.truth(row).pose("lidar", self.base).translation))

    def describe_moment(self, row: int) -> str:
        """Return number, time and UTC of the frame of a row, and the true range, in one line."""
        seconds = self.truth(row).time_s
        far = f"range {self.range_m(row):,.2f} m" if self.targets else "no target"
        utc = format_utc(self.scenario.time.start_utc, seconds)
        return f"frame {self.numbers[row]}  ·  {seconds:,.3f} s  ·  {utc}  ·  {far}"

    @cached_property
    def path_m(self) -> np.ndarray:
        """Positions of the follower (row, xyz) [m] in the axes of views in space."""
        return np.stack([self.matrix(row, "follower")[:3, 3] for row in range(len(self.numbers))])

    @cached_property
    def models(self) -> dict[str, tuple[str, bytes]]:
        """Models of the surfaces for a browser, by the surface's name: the hash of the bytes, and the bytes.

        These are the corners (facet, 3, xyz) f4 [m], then the colours (facet, rgb) u1; of many facets, the largest.
        """
        models, targets = {}, {target.name: target for target in self.scenario.target}
        for surface in self.scenario.surfaces:
            colours = find_part_colours(targets[surface.body], surface.mesh)
            shown = np.argsort(-surface.areas_m2)[:_MOST_FACETS]
            packed = surface.corners[shown].astype("<f4").tobytes() + colours[surface.part[shown]].tobytes()
            models[surface.name] = hashlib.sha256(packed).hexdigest(), packed
        return models

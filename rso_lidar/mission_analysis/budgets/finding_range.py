"""How far a body is found: the probability over its attitudes and places in the pixel grid, against range."""

from __future__ import annotations

import datetime
import math
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import Any

import numpy as np

from rso_lidar.errors import ScenarioError
from rso_lidar.mission_analysis.budgets.attitude_search import AttitudeSearch, describe_facing
from rso_lidar.mission_analysis.budgets.finding_figure import finding_figure
from rso_lidar.mission_analysis.budgets.inputs import GATED_TO_M, check_probability, select_camera
from rso_lidar.mission_analysis.budgets.range_curve import FARTHEST_M
from rso_lidar.motion import Fixed
from rso_lidar.picture import SavedResult
from rso_lidar.pose import quaternion_xyzw
from rso_lidar.processes import check_workers
from rso_lidar.scenario import Finding, Follower, Lidar, Scenario, Target, Time, World

_SCAN_RATIO, _SCANNED_ATTITUDES = 1.35, 24  # of the ranges of the first scan, and attitudes at each
_DRAWN = 13  # ranges at which the curve is computed, from almost always to almost never found
_SURE = 0.995
_WORST_PLACES = 32  # places in the pixel grid, of the curve of the worst attitude
_WITHIN = 2e-3  # relative error of solved ranges
_NEAREST = 2.0  # radii of the body: the least range
_AHEAD_M = 1000.0  # where the body stands before it is moved; any range does


@dataclass(frozen=True, eq=False)
class FoundRange(SavedResult):
    """How far a body is found with a wanted probability, over its attitudes and its places in the pixel grid.

    `range_m` and `found_probability` (range) are the curve over all attitudes, `worst_probability` (range) that of the
    worst attitude. `max_range_m` is the greatest range with the wanted probability, NaN where none has it, and
    `worst_range_m` that of the worst attitude. `is_limited` states that the range ends with the detector's window or with
    the farthest range given. `worst_attitude` is lidar_from_body as a matrix (3, 3), None where the body is never found,
    and `worst_there` its probability at `max_range_m`. `is_by_pixel` states that
    the detector gives the probability of each pixel, so that no flash was simulated.
    """

    camera: str
    body: str
    finding: Finding
    probability: float
    attitudes: int
    range_m: np.ndarray
    found_probability: np.ndarray
    worst_probability: np.ndarray
    max_range_m: float
    is_limited: bool
    worst_range_m: float
    worst_attitude: np.ndarray | None
    worst_there: float
    is_by_pixel: bool
    notes: tuple[str, ...]

    @property
    def worst_quaternion_xyzw(self) -> np.ndarray | None:
        """Worst attitude as the quaternion (x, y, z, w) of lidar_from_body; None where the body is never found."""
        from scipy.spatial.transform import Rotation

        return None if self.worst_attitude is None else quaternion_xyzw(Rotation.from_matrix(self.worst_attitude))

    def about(self) -> str:
        """Describe the question in a line."""
        how = "from each pixel's probability" if self.is_by_pixel else "simulated flashes"
        return f"{self.body} found by {self.finding.describe()}; {self.attitudes} attitudes and places, {how}"

    def table(self) -> str:
        """Return the answer in a few lines: the range, the worst attitude, and ranges of other probabilities."""
        lines = [f"{self.camera}: {self.about()}"]
        if math.isnan(self.max_range_m):
            best = float(self.found_probability.max())
            lines.append(f"  P = {self.probability:g}: never; at most {best:.3f}, at {self._best_range_m():,.0f} m")
            return "\n".join([*lines, *(f"  {note}" for note in self.notes)])
        limit = " (no farther range was asked for, or the detector sees none)" if self.is_limited else ""
        lines.append(f"  P = {self.probability:g}: to {self.max_range_m:,.0f} m{limit}")
        others = [(level, self.range_of(level)) for level in (0.99, 0.9, 0.5, 0.1) if level != self.probability]
        lines.append(
            "  other probabilities: "
            + ", ".join(f"P = {level:g} to {at:,.0f} m" for level, at in others if math.isfinite(at))
        )
        if self.worst_attitude is not None:
            from scipy.spatial.transform import Rotation

            # At gimbal lock the third angle is set to zero; the angles still describe the attitude.
            turned = Rotation.from_matrix(self.worst_attitude)
            euler_deg = turned.as_euler("ZYX", degrees=True, suppress_warnings=True)
            alone = "never" if math.isnan(self.worst_range_m) else f"to {self.worst_range_m:,.0f} m"
            lines += [
                f"  worst attitude: {describe_facing(self.worst_attitude)}; P = {self.probability:g} {alone}, and at "
                f"{self.max_range_m:,.0f} m P = {self.worst_there:.2f}",
                f"    lidar_from_body: quaternion_xyzw = {_format_numbers(self.worst_quaternion_xyzw, 4)}, "
                f"euler_zyx_deg = {_format_numbers(euler_deg, 1)}",
            ]
        return "\n".join([*lines, *(f"  {note}" for note in self.notes)])

    def range_of(self, probability: float) -> float:
        """Return the greatest range [m] with a probability, interpolated along the curve; NaN where none has it.

        Parameters
        ----------
        probability : that the body is found
        """
        reached = np.flatnonzero(self.found_probability >= probability)
        if not reached.size:
            return math.nan
        last = int(reached[-1])
        if last == len(self.range_m) - 1:
            return float(self.range_m[last])
        high, low = self.found_probability[last], self.found_probability[last + 1]
        share = float((high - probability) / (high - low))
        return float(self.range_m[last] * (self.range_m[last + 1] / self.range_m[last]) ** share)

    def figure(self) -> Any:
        """Return the figure of the probability against range."""
        return finding_figure(
            self.range_m,
            self.found_probability,
            self.worst_probability,
            title=f"{self.body} found by {self.camera}",
            note=self.about(),
            probability=self.probability,
            max_range_m=self.max_range_m,
            worst=None if self.worst_attitude is None else describe_facing(self.worst_attitude),
            small_print=self.notes,
        )

    def columns(self) -> dict[str, np.ndarray]:
        """Return the columns of the table by name."""
        return {name: getattr(self, name) for name in ("range_m", "found_probability", "worst_probability")}

    def _best_range_m(self) -> float:
        return float(self.range_m[int(self.found_probability.argmax())])


def find_range(
    camera: Lidar | Scenario | str,
    body: str | None = None,
    *,
    finding: Finding | None = None,
    probability: float = 0.9,
    range_m: tuple[float, float] | None = None,
    attitudes: int = 256,
    in_run: bool = False,
    executor: Executor | None = None,
) -> FoundRange:
    """Solve how far a body is found: at least m pixels report it, in at least k of n flashes.

    Its attitudes are spread evenly over all rotations, and its places over one pixel about the boresight. The pixels there
    have the thresholds of the camera.

    Parameters
    ----------
    camera : a lidar, a scenario (its instrument at the start), or the name of a shipped camera
    body : name of a target of the scenario, name of a model, or path of a mesh (None: the scenario's first target)
    finding : when the body counts as found (None: as the scenario says, or one pixel of one flash)
    probability : that it is found, for which the greatest range is solved

    Other Parameters
    ----------------
    range_m : nearest and farthest range [m] (None: as far as the detector sees)
    attitudes : number of attitudes, each at one place in the pixel grid
    in_run : take the attitudes that the scenario's target has to the line of sight in the run, instead of all
    executor : in the manner of `concurrent.futures`, whose workers try the attitudes in place of threads of this process: a
        pool of processes, or ``client.get_executor()`` of dask. It changes no bit of the result

    Returns
    -------
    FoundRange
        The range, the curve, and the worst attitude.

    Raises
    ------
    ScenarioError
        For values outside their limits, and a body that is not known.

    >>> bench = Scenario.load("examples/bench_plate.toml")
    >>> far = find_range(bench, in_run=True, attitudes=4, range_m=(3000.0, 9000.0))
    >>> round(far.max_range_m, -2)
    3700.0
    """
    check_workers(None, executor)
    lidar, scenario, name = select_camera(camera)
    probability = check_probability(probability)
    if not isinstance(attitudes, int) or isinstance(attitudes, bool) or not 1 <= attitudes <= 100_000:
        raise ScenarioError(
            f"attitudes: {attitudes}: is not a number of attitudes; give a whole number from 1 to 100000"
        )
    flown, number = choose_body(lidar, scenario, body)
    if in_run and flown is not scenario:
        raise ScenarioError(
            "attitudes of the run: the body is not of a scenario; name one of its targets, or leave it out"
        )
    finding = finding or (Finding() if scenario is None else scenario.finding)
    rows, cols = lidar.receiver.shape
    if finding.pixels > rows * cols:
        raise ScenarioError(
            f"finding.pixels: {finding.pixels} is more than the {rows * cols} pixels of the receiver, so no body could be "
            "found; lower it"
        )
    with AttitudeSearch(lidar, flown, number, finding, attitudes, in_run=in_run, executor=executor) as search:
        near_m, far_m = _choose_span_m(lidar, range_m, search.radius_m)
        scan_m, scan = _scan_inward(lambda at: search.over_attitudes(at, _SCANNED_ATTITUDES), near_m, far_m)
        curve_m = _choose_curve_m(scan_m, scan)
        curve = np.array([search.over_attitudes(at, attitudes) for at in curve_m.tolist()])
        outside = (scan_m < curve_m[0]) | (scan_m > curve_m[-1])
        order = np.argsort(np.concatenate([scan_m[outside], curve_m]))
        along_m = np.concatenate([scan_m[outside], curve_m])[order]
        found_probability = np.concatenate([scan[outside], curve])[order]
        most_m, limited = _solve_m(
            lambda at: search.over_attitudes(at, attitudes), along_m, found_probability, probability
        )
        worst: np.ndarray | None = None
        there, alone_m, below = math.nan, math.nan, np.full(len(along_m), np.nan)
        if math.isfinite(most_m):
            attitude = search.find_worst(most_m)
            worst, there = attitude[1], search.of_attitude(attitude, most_m, _WORST_PLACES)
            below = np.array([search.of_attitude(attitude, at, _WORST_PLACES) for at in along_m.tolist()])
            alone_m, _ = _solve_m(
                lambda at: search.of_attitude(attitude, at, _WORST_PLACES), along_m, below, probability
            )
        return FoundRange(
            camera=name,
            body=flown.target[number].name if flown is scenario else flown.target[number].shape,
            finding=finding,
            probability=probability,
            attitudes=attitudes,
            range_m=along_m,
            found_probability=found_probability,
            worst_probability=below,
            max_range_m=most_m,
            is_limited=limited,
            worst_range_m=alone_m,
            worst_attitude=worst,
            worst_there=there,
            is_by_pixel=search.is_by_pixel(math.sqrt(near_m * far_m)),
            notes=_describe_notes(lidar, in_run=in_run, has_retros=_has_retros(flown, number)),
        )


def _choose_span_m(lidar: Lidar, given: Any, radius_m: float) -> tuple[float, float]:
    """Return the nearest and the farthest range [m], as given or by the lidar and the body's radius [m]."""
    traits = lidar.detector.traits
    if given is None:
        far_m = GATED_TO_M if traits.is_gated else min(traits.sees_to_m, FARTHEST_M)
        near_m = max(_NEAREST * radius_m, 0.0 if traits.is_gated else traits.sees_from_m, far_m * 1e-4)
        return near_m, max(far_m, 2.0 * near_m)
    ends = np.asarray(given, dtype=float).ravel()
    if len(ends) != 2 or not np.all(np.isfinite(ends)) or not 0.0 < ends[0] < ends[1] <= FARTHEST_M:
        shown = ", ".join(f"{end:g}" for end in ends[:4])
        raise ScenarioError(f"range_m: {shown}: not two ranges; give a near and a farther one, above 0")
    return float(ends[0]), float(ends[1])


def _scan_inward(probability: Callable[[float], float], near_m: float, far_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Scan ranges [m] inward to where the body is almost always found; return them ascending, and probabilities."""
    scanned: dict[float, float] = {}
    n = max(math.ceil(math.log(far_m / near_m) / math.log(_SCAN_RATIO)), 4) + 1
    for at in np.geomspace(far_m, near_m, n).tolist():
        scanned[at] = probability(at)
        if len(scanned) > 1 and min(list(scanned.values())[-2:]) >= _SURE:
            break
    return np.array([*scanned])[::-1], np.array([*scanned.values()])[::-1]


def _choose_curve_m(scan_m: np.ndarray, scan: np.ndarray) -> np.ndarray:
    """Return the ranges of the curve [m]: from where the body is almost always found to where it almost never is."""
    seen = np.flatnonzero(scan > 1.0 - _SURE)
    if not seen.size:
        return np.geomspace(scan_m[0], scan_m[-1], _DRAWN)
    last = min(int(seen[-1]) + 1, len(scan) - 1)
    sure = np.flatnonzero(scan[:last] >= _SURE)
    first = int(sure[-1]) if sure.size else 0
    return np.geomspace(scan_m[first], scan_m[last], _DRAWN)


def _solve_m(
    probability: Callable[[float], float], range_m: np.ndarray, known: np.ndarray, wanted: float
) -> tuple[float, bool]:
    """Solve the greatest range [m] with the wanted probability, and whether it is the farthest; NaN without any."""
    reached = np.flatnonzero(known >= wanted)
    if not reached.size:
        return math.nan, False
    last = int(reached[-1])
    if last == len(known) - 1:
        return float(range_m[-1]), True
    from scipy.optimize import brentq

    ends = math.log(range_m[last]), math.log(range_m[last + 1])
    between = {ends[0]: float(known[last]), ends[1]: float(known[last + 1])}

    def lack(x: float) -> float:
        return (between[x] if x in between else probability(math.exp(x))) - wanted

    if lack(ends[0]) == 0.0:
        return float(range_m[last]), False
    return float(math.exp(brentq(lack, *ends, xtol=_WITHIN))), False


def _has_retros(scenario: Scenario, number: int) -> bool:
    """Return whether a target has retro-reflectors."""
    return any(material.is_retro for surface in scenario.surfaces_of(number) for material in surface.materials)


def _describe_notes(lidar: Lidar, *, in_run: bool, has_retros: bool) -> tuple[str, ...]:
    """Describe what the answer assumes."""
    notes = [
        "attitudes of the run" if in_run else "attitudes: all rotations, evenly; places: one pixel about the boresight"
    ]
    if has_retros:
        notes.append("its retro-reflectors count; part_materials of a scenario's target can replace them")
    if lidar.receiver.filter_width_nm is not None:
        notes.append("not counted: sunlight")
    if lidar.detector.traits.is_gated:
        notes.append("the gate follows the body")
    return tuple(notes)


def _format_numbers(values: Any, digits: int) -> str:
    return "[" + ", ".join(f"{float(value) + 0.0:.{digits}f}" for value in values) + "]"


def choose_body(lidar: Lidar, scenario: Scenario | None, body: str | None) -> tuple[Scenario, int]:
    """Choose a body by name: a target of the scenario, or else a model or a mesh alone before the camera.

    Parameters
    ----------
    scenario : the scenario of the camera, if any
    body : name of a target or of a model, or path of a mesh (None: the scenario's first target)

    Returns
    -------
    the scenario of the body, and its index there.

    Raises
    ------
    ScenarioError
        If there is no such body.
    """
    names = [] if scenario is None else [target.name for target in scenario.target]
    if body is None:
        if scenario is None or not names:
            where = "a camera alone has no body" if scenario is None else "the scenario has no target"
            raise ScenarioError(f"body: {where}; name a model, such as cubesat_3u, or the path of a mesh")
        return scenario, 0
    if not isinstance(body, str) or not body.strip():
        raise ScenarioError(f"body: {body!r:.60}: is not a name; give a target, a model or the path of a mesh")
    if scenario is not None and body in names:
        return scenario, names.index(body)
    try:
        alone = _build_bench(lidar, body)
        _ = alone.surfaces
    except ScenarioError as error:
        raise ScenarioError(f"body: {body}: {_explain(str(error), names)}") from None
    return alone, 0


def _build_bench(lidar: Lidar, model: str) -> Scenario:
    """Build a scenario without an Earth in which a model stands before a lidar, for one frame that holds all its pulses."""
    frame_s = max(1.0, 2.0 * lidar.exposure_s)
    return Scenario(
        version=1,
        name=model,
        world=World(axes="local"),
        time=Time(
            start_utc=datetime.datetime(2000, 1, 1, tzinfo=datetime.UTC),
            duration_s=frame_s,
            frame_rate_hz=1.0 / frame_s,
        ),
        target=(Target(name="body", model=model, motion=Fixed(position_m=(_AHEAD_M, 0.0, 0.0))),),
        follower=Follower(motion=Fixed(position_m=(0.0, 0.0, 0.0))),
        lidar=lidar,
    )


def _explain(message: str, names: list[str]) -> str:
    """Return what is wrong with a body, and the targets that a scenario has."""
    text = message.rpartition("target body: ")[2]
    return f"no target of that name (targets: {', '.join(names)}), and no model: {text}" if names else text

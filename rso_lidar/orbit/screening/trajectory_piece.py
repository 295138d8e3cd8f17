"""Pieces of trajectories: smooth paths between two breaks, with bounds that are measured along them.

A trajectory is known by its states alone. It is cut at its `breaks_s`, such as impulses and the begin and end of burns,
and where its states begin or end. Within a piece it is sampled every 37.5 s, an eighth of the coarse step. From the samples
follow the shell, the greatest speed, and the error of the cubic through two samples that are one coarse step apart. The
sieve doubles this error. Eight samples within each such step, at every phase, also show thrust that no break announces.

Beyond its ends a piece is continued by two-body motion, so that the coarse grid and difference quotients need no special
case there. Nothing is reported from the continuation.
"""

from __future__ import annotations

import datetime
import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rso_lidar import units
from rso_lidar.errors import PropagationError, ScenarioError, suppress_warnings
from rso_lidar.orbit.central_body import EARTH, check_trajectory, find_center
from rso_lidar.orbit.epochs import Epochs, format_utc
from rso_lidar.orbit.sets.teme import gcrs_from_teme
from rso_lidar.orbit.trajectory import Trajectory, find_breaks_s
from rso_lidar.orbit.two_body.kepler import propagate_two_body
from rso_lidar.pose import rotate_vectors

CUT = 8  # sub-intervals of a step of the coarse grid
SWITCH_S = 1e-4  # a piece or set ends this long before the next begins, so that each instant has one
BRIEF_S = 1e-3  # pieces and sets that apply for less than this are ignored
NO_STATE = -1  # error code of an instant without a state
_AFTER_S = 1e-6  # a piece begins this long after a break, so that its state is the one after it
_AT_ONCE = 50_000  # states asked for at a time


@dataclass(frozen=True)
class NamedTrajectory:
    """A trajectory with the name under which a search lists it.

    Parameters
    ----------
    name : of the object
    trajectory : anything that answers `states`
    norad_id : catalogue number, 0 for none
    source : file that it was read from; trajectories of one name and source are the same object
    name_in_source : its name in that file, where it is listed under another one
    """

    name: str
    trajectory: Trajectory
    norad_id: int = 0
    source: str = ""
    name_in_source: str = ""

    def __post_init__(self) -> None:
        check_trajectory(self.trajectory, self.name)

    @property
    def label(self) -> str:
        """Name of the object."""
        return self.name

    def states(self, epochs: Epochs) -> Any:
        """Return position [m] and velocity [m/s] (time, 3) in GCRS axes, those of the trajectory."""
        return self.trajectory.states(epochs)

    def breaks_s(self, epochs: Epochs) -> np.ndarray:
        """Return the instants [s] at which the states jump or have a corner, those of the trajectory.

        Parameters
        ----------
        epochs : instants that matter
        """
        return find_breaks_s(self.trajectory, epochs)


@dataclass(frozen=True)
class PieceBounds:
    """Bounds along a piece, the continuation of one coarse step beyond both ends included.

    Parameters
    ----------
    perigee_m, apogee_m : of the distance from the Earth's centre [m]
    speed_m_s : greatest speed [m/s]
    off_m : error of the cubic through two states one coarse step apart [m], doubled
    """

    perigee_m: float
    apogee_m: float
    speed_m_s: float
    off_m: float


@dataclass(frozen=True, eq=False)
class TrajectoryPiece:
    """A smooth piece of a trajectory, from `from_s` to `to_s` [s since the start].

    Parameters
    ----------
    entry : the trajectory
    label, name, norad_id : what it is listed as
    start_utc : instant from which seconds are counted
    from_s, to_s : its begin and end [s]
    ends : position [m] and velocity [m/s] (2, 3) at its begin, and at its end, in GCRS axes
    beyond_s : how long it is continued beyond its ends [s]
    """

    entry: Trajectory
    label: str
    name: str
    norad_id: int
    start_utc: datetime.datetime
    from_s: float
    to_s: float
    ends: tuple[np.ndarray, np.ndarray]
    beyond_s: float

    def states(self, time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return position [m] and velocity [m/s] (time, 3) in TEME axes at times since the start, or NaN beyond."""
        position, velocity = np.full((len(time_s), 3), np.nan), np.full((len(time_s), 3), np.nan)
        inside = np.flatnonzero((time_s >= self.from_s) & (time_s <= self.to_s))
        if len(inside):
            position[inside], velocity[inside] = sample_states(self.entry, self.start_utc, time_s[inside])[:2]
        before = (time_s < self.from_s) & (time_s >= self.from_s - self.beyond_s)
        after = (time_s > self.to_s) & (time_s <= self.to_s + self.beyond_s)
        for outside, edge_s, end in ((before, self.from_s, self.ends[0]), (after, self.to_s, self.ends[1])):
            if outside.any():
                position[outside], velocity[outside] = _continue_freely(end, time_s[outside] - edge_s)
        known = np.flatnonzero(np.isfinite(position[:, 0]))
        teme_from_gcrs = np.swapaxes(gcrs_from_teme(Epochs(self.start_utc, time_s[known])), -1, -2)
        position[known] = rotate_vectors(teme_from_gcrs, position[known])
        velocity[known] = rotate_vectors(teme_from_gcrs, velocity[known])
        return position, velocity

    def measure_bounds(self, step_s: float) -> PieceBounds:
        """Measure the bounds of the piece."""
        sub_s = step_s / CUT
        last = int(np.ceil((self.to_s - self.from_s) / sub_s)) + CUT
        low, high, fastest, off = np.inf, 0.0, 0.0, 0.0
        for begin in range(-CUT, last, _AT_ONCE):  # each lot overlaps the next by one coarse step
            numbers = np.arange(begin, min(begin + _AT_ONCE, last) + CUT + 1)
            position, velocity = self.states(self.from_s + sub_s * numbers[numbers <= last])
            radius = np.sqrt(np.einsum("ti,ti->t", position, position))
            with np.errstate(invalid="ignore"):
                chord = np.sqrt(np.einsum("ti,ti->t", *[np.diff(position, axis=0)] * 2)) / sub_s
            speed = np.sqrt(np.einsum("ti,ti->t", velocity, velocity))
            low, high = np.fmin(low, np.fmin.reduce(radius)), np.fmax(high, np.fmax.reduce(radius))
            fastest = np.fmax(fastest, np.fmax(np.fmax.reduce(speed), np.fmax.reduce(chord, initial=0.0)))
            off = np.fmax(off, _measure_cubic(position, velocity, sub_s))
        gravity_m_s2 = units.EARTH_GM_M3_S2 / max(float(low), 0.5 * units.EARTH_RADIUS_M) ** 2
        bend_m = 2.0 * gravity_m_s2 * sub_s**2 / 8.0 + 2.0 * float(off)  # of the radius between two samples
        return PieceBounds(
            max(float(low) - bend_m, 0.0), float(high) + bend_m, float(fastest) + gravity_m_s2 * sub_s, 2.0 * float(off)
        )


def find_pieces(
    entry: Trajectory, number: int, start_utc: datetime.datetime, duration_s: float, step_s: float
) -> tuple[list[TrajectoryPiece], list[str]]:
    """Cut a trajectory into smooth pieces over a span.

    Returns
    -------
    pieces in the order of time, and a line for each part of the span without a state

    Raises
    ------
    ScenarioError
        if it orbits about the Moon
    """
    label = str(getattr(entry, "label", "") or f"object {number + 1}")
    if find_center(entry) is not EARTH:
        raise ScenarioError(
            f"{label}: orbits about {find_center(entry).name}, and encounters are searched about the Earth; leave it out"
        )
    named = label, str(getattr(entry, "name", "") or label), int(getattr(entry, "norad_id", 0) or 0)
    with suppress_warnings():
        breaks = np.unique(find_breaks_s(entry, Epochs(start_utc, np.array([0.0, duration_s]))))
    inner = breaks[(breaks > 0.0) & (breaks < duration_s)].tolist()
    at_start = bool(np.any(breaks == 0.0))
    pieces: list[TrajectoryPiece] = []
    edges = [0.0, *inner, duration_s]
    reasons: list[str] = []
    for k, (begin_s, end_s) in enumerate(itertools.pairwise(edges)):
        first_s = begin_s + (_AFTER_S if k or at_start else 0.0)
        last_s = end_s - (SWITCH_S if k < len(edges) - 2 else 0.0)
        if last_s - first_s < BRIEF_S and len(edges) > 2:
            continue
        runs, why = _find_runs(entry, start_utc, first_s, last_s, step_s / CUT)
        reasons += why
        for from_s, to_s in runs:
            position, velocity, _ = sample_states(entry, start_utc, np.array([from_s, to_s]))
            ends = np.stack([position[0], velocity[0]]), np.stack([position[1], velocity[1]])
            pieces.append(TrajectoryPiece(entry, *named, start_utc, from_s, to_s, ends, 1.01 * step_s + 1.0))
    return pieces, _describe_gaps(pieces, start_utc, duration_s, reasons)


def sample_states(
    entry: Trajectory, start_utc: datetime.datetime, time_s: np.ndarray
) -> tuple[np.ndarray, np.ndarray, str]:
    """Return position [m] and velocity [m/s] (time, 3) in GCRS axes, NaN without a state, and the reason."""
    position, velocity = np.full((len(time_s), 3), np.nan), np.full((len(time_s), 3), np.nan)
    good, why = np.ones(len(time_s), dtype=bool), ""
    for _ in range(2):  # a trajectory without a state at some epochs is asked again for the others
        if not good.any():
            break
        try:
            with suppress_warnings():
                state = entry.states(Epochs(start_utc, time_s[good]))
        except PropagationError as error:
            if why or len(error.bad) != int(good.sum()) or not error.bad.any():
                raise
            why = str(error)
            good[np.flatnonzero(good)[error.bad]] = False
            continue
        vectors = np.asarray(state.position_m, dtype=float), np.asarray(state.velocity_m_s, dtype=float)
        for part in vectors:
            if part.shape != (int(good.sum()), 3):
                label = getattr(entry, "label", type(entry).__name__)
                raise ScenarioError(f"{label}: states has the shape {part.shape}; return (time, 3) for each epoch")
        position[good], velocity[good] = vectors
        break
    lost = ~(np.isfinite(position).all(axis=1) & np.isfinite(velocity).all(axis=1))
    position[lost], velocity[lost] = np.nan, np.nan
    return position, velocity, why


def _find_runs(
    entry: Trajectory, start_utc: datetime.datetime, first_s: float, last_s: float, sub_s: float
) -> tuple[list[tuple[float, float]], list[str]]:
    """Find the spans with states between two breaks, each to 0.1 ms, and reasons for what is missing."""
    time_s = np.linspace(first_s, last_s, max(int(np.ceil((last_s - first_s) / sub_s)), 1) + 1)
    known, reasons = np.empty(0, dtype=bool), []
    for begin in range(0, len(time_s), _AT_ONCE):
        position, _, why = sample_states(entry, start_utc, time_s[begin : begin + _AT_ONCE])
        known = np.append(known, np.isfinite(position[:, 0]))
        reasons += [why] if why else []
    runs = []
    edges = np.flatnonzero(np.diff(known.astype(int)))
    starts = [0, *(edges + 1).tolist()]
    for begin, end in zip(starts, [*edges.tolist(), len(known) - 1], strict=True):
        if not known[begin]:
            continue
        from_s = time_s[begin] if begin == 0 else _bisect(entry, start_utc, time_s[begin], time_s[begin - 1])
        to_s = time_s[end] if end == len(known) - 1 else _bisect(entry, start_utc, time_s[end], time_s[end + 1])
        runs.append((float(from_s), float(to_s)))
    return runs, reasons


def _bisect(entry: Trajectory, start_utc: datetime.datetime, known_s: float, unknown_s: float) -> float:
    """Return the last instant [s] with a state between one with and one without, to 0.1 ms."""
    while abs(unknown_s - known_s) > SWITCH_S:
        middle = 0.5 * (known_s + unknown_s)
        if np.isfinite(sample_states(entry, start_utc, np.array([middle]))[0][0, 0]):
            known_s = middle
        else:
            unknown_s = middle
    return known_s


def _describe_gaps(
    pieces: Sequence[TrajectoryPiece], start_utc: datetime.datetime, duration_s: float, reasons: Sequence[str]
) -> list[str]:
    """Describe the parts of a span without a state."""
    if not pieces:
        return [f"has no state in the span ({reasons[0] if reasons else 'its states are not finite'})"]
    ends = [0.0, *(second for piece in pieces for second in (piece.from_s, piece.to_s)), duration_s]
    return [
        f"has no state from {format_utc(start_utc, to_s)} to {format_utc(start_utc, from_s)}"
        for to_s, from_s in zip(ends[::2], ends[1::2], strict=True)
        if from_s - to_s > 2.0 * BRIEF_S
    ]


def _continue_freely(end: np.ndarray, dt_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Continue a state (2, 3) by two-body motion; NaN where Kepler's equation has no solution."""
    try:
        return propagate_two_body(end[0], end[1], dt_s)
    except PropagationError:
        return np.full((len(dt_s), 3), np.nan), np.full((len(dt_s), 3), np.nan)


def _measure_cubic(position_m: np.ndarray, velocity_m_s: np.ndarray, sub_s: float) -> float:
    """Return the greatest error [m] of cubics through states (time, 3) a coarse step apart, at samples between them."""
    if len(position_m) <= CUT:
        return 0.0
    p0, v0, p1, v1 = position_m[:-CUT], velocity_m_s[:-CUT], position_m[CUT:], velocity_m_s[CUT:]
    worst = 0.0
    for k in range(1, CUT):
        u = k / CUT
        cubic = (1 + 2 * u) * (1 - u) ** 2 * p0 + u**2 * (3 - 2 * u) * p1
        cubic += CUT * sub_s * (u * (1 - u) ** 2 * v0 - u**2 * (1 - u) * v1)
        apart = position_m[k : k - CUT] - cubic
        worst = np.fmax(worst, np.fmax.reduce(np.einsum("ti,ti->t", apart, apart)))
    return float(np.sqrt(worst))

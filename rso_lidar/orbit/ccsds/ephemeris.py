"""Ephemerides, read and written: CCSDS OEM (502.0-B, keyword = value or XML) and CSV, with a stated interpolation.

Hermite's polynomial meets the positions and velocities of the rows around an instant, and its derivative is the velocity.
Lagrange's polynomial meets the positions, and another one the velocities where there are any.
"""

from __future__ import annotations

import datetime
import functools
import itertools
import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from rso_lidar import units
from rso_lidar.errors import PropagationError, ScenarioError
from rso_lidar.orbit.ccsds.csv_table import elapsed_from_ps, elapsed_s, read_csv_table
from rso_lidar.orbit.ccsds.interpolation import GREATEST_DEGREE, interpolate_hermite, interpolate_lagrange
from rso_lidar.orbit.ccsds.message import (
    Message,
    Segment,
    check_increasing,
    list_objects,
    parse_number,
    select_segments,
    usable_span_s,
)
from rso_lidar.orbit.ccsds.reader import find_table, is_message, read_message, read_table_text
from rso_lidar.orbit.ccsds.reference_frames import parse_frame
from rso_lidar.orbit.earth.axes import EarthAxes, convert_states
from rso_lidar.orbit.earth.earth_orientation import UNCERTAINTY_WITHOUT_RAD, EarthOrientation
from rso_lidar.orbit.epochs import Epochs, format_utc, parse_epoch_ps
from rso_lidar.part import Part, Text, Whole
from rso_lidar.records import BodyState

DEGREE = 7
EDGE_S = 1e-8  # an epoch this close outside an edge counts as on it, because dates are rounded
ROUGH_M = 1.0
PLACES = (("x_m", "y_m", "z_m"), ("x_km", "y_km", "z_km"))
SPEEDS = (("vx_m_s", "vy_m_s", "vz_m_s"), ("vx_km_s", "vy_km_s", "vz_km_s"))


class Ephemeris(Part):
    """Interpolation of a table of states: a CCSDS OEM (keyword = value or XML) or CSV, recognised by content.

    An OEM is about the Earth, in GCRF, ICRF, EME2000, MOD, TOD, TEME or ITRF, and in UTC, TAI, TT or GPS time. Each of
    its segments applies in its usable span. Nothing is interpolated across an edge, and where two segments meet the
    later one applies. An OEM in ITRF needs the Earth's orientation to the metre: see `earth_orientation_file`.

    A CSV table is in GCRS axes. Its columns are time_s (of the run), utc or epoch; x_m, y_m, z_m or x_km ...; and
    optionally vx_m_s ... or vx_km_s ....

    `interpolation` and `degree` default to those of the file, else to "hermite" with velocities, "lagrange" without,
    and 7. In low orbit, Hermite's interpolation of degree 7 is good to 3 cm with steps of 5 minutes, and to 1 um with 1
    minute. `validity` estimates the error for any table.
    """

    type: Literal["ephemeris"] = "ephemeris"
    file: Text = Field(
        description=(
            "Path of a CCSDS OEM (KVN or XML), or of a CSV file. The CSV file has one of the columns time_s, utc or epoch, "
            "positions x_m ... or x_km ..., and optionally velocities vx_m_s ... or vx_km_s ...."
        )
    )
    object: Text | None = Field(
        default=None, description="Name or identifier of one object, for a file that holds several."
    )
    interpolation: Literal["hermite", "lagrange"] | None = Field(
        default=None,
        description=(
            "Interpolation: `hermite` through positions and velocities, or `lagrange`. If omitted, the file's, else "
            "`hermite` for a file with velocities."
        ),
    )
    degree: Annotated[Whole, Field(ge=1, le=GREATEST_DEGREE)] | None = Field(
        default=None, description="Degree of the interpolating polynomial. If omitted, the file's, else 7."
    )
    earth_orientation_file: Text | None = Field(
        default=None,
        description=(
            "Path of the IERS file finals2000A.all, with polar motion and UT1, for an OEM in ITRF. If omitted, a position "
            "is wrong by up to 0.9 arcsecond of its distance: 30 m in low orbit, 180 m in GEO."
        ),
    )

    def states(self, epochs: Epochs) -> BodyState:
        """Return position [m] and velocity [m/s] (time, 3) in GCRS axes.

        Raises
        ------
        PropagationError
            if epochs are outside the table; its `bad` masks them
        """
        return self._states(epochs, 0)

    def span_utc(self, start_utc: datetime.datetime) -> tuple[str, str]:
        """Return the first and the last instant of the ephemeris as UTC text.

        Parameters
        ----------
        start_utc : start of the run, from which a table with the column time_s counts
        """
        arcs = self._arcs()
        first, last = arcs[0], arcs[-1]
        return (
            format_utc(first.start_utc or start_utc, first.begin_s),
            format_utc(last.start_utc or start_utc, last.end_s),
        )

    def validity(self, epochs: Epochs) -> list[str]:
        """Check that the rows are close enough for the interpolation.

        A polynomial of two degrees more must agree within a metre.

        An ITRF file without the Earth's orientation is off by some metres, too.

        Parameters
        ----------
        epochs : instants

        Returns
        -------
        one sentence for each; otherwise empty
        """
        states, other = self._states(epochs, 0), self._states(epochs, 2)
        found = []
        off_m = float(np.linalg.norm(states.position_m - other.position_m, axis=1).max(initial=0.0))
        if off_m > ROUGH_M:
            found.append(
                f"ephemeris {self.file}: its rows are far apart: interpolation may be off by some {off_m:.3g} m; take a "
                "finer table, or 'numerical' from one of its states"
            )
        if self.earth_orientation_file is None and any(arc.frame == "itrs" for arc in self._arcs()):
            off_m = UNCERTAINTY_WITHOUT_RAD * float(np.linalg.norm(states.position_m, axis=1).max(initial=0.0))
            found.append(
                f"ephemeris {self.file}: is in ITRF, and without polar motion and UT1 it is off by up to {off_m:.0f} m: "
                "name finals2000A.all of the IERS as earth_orientation_file"
            )
        return found

    def breaks_s(self, epochs: Epochs) -> np.ndarray:
        """Return the instants at which segments begin and end.

        Parameters
        ----------
        epochs : instants

        Returns
        -------
        times since the `start_utc` of `epochs` [s]
        """
        arcs, start = self._arcs(), epochs.at(slice(0, 1))
        begin_s = [arc.begin_s - float(elapsed_s(start, arc.start_utc)[0]) + float(start.time_s[0]) for arc in arcs]
        ends_s = [begin + arc.end_s - arc.begin_s for begin, arc in zip(begin_s, arcs, strict=True)]
        open_ = [end + 2.0 * EDGE_S for end, after in zip(ends_s, [*begin_s[1:], math.inf], strict=True) if end < after]
        return np.array([begin - 2.0 * EDGE_S for begin in begin_s[:1]] + begin_s[1:] + open_)

    def _states(self, epochs: Epochs, more: int) -> BodyState:
        """Interpolate the states.

        Parameters
        ----------
        epochs : instants
        more : degrees added to the polynomials (or removed, where the rows do not suffice), for an estimate of the error
        """
        arcs = self._arcs()
        position, velocity = np.full((len(epochs), 3), np.nan), np.full((len(epochs), 3), np.nan)
        which = np.full(len(epochs), -1)
        for number, arc in enumerate(arcs):
            time_s = elapsed_s(epochs, arc.start_utc)
            which[(time_s >= arc.begin_s - EDGE_S) & (time_s <= arc.end_s + EDGE_S)] = number
        bad = which < 0
        if bad.any():
            first, last = self.span_utc(epochs.start_utc)
            pieces = f" in {len(arcs)} segments" if len(arcs) > 1 else ""
            at = epochs.time_s[np.argmax(bad)]
            raise PropagationError(
                f"ephemeris {self.file}: does not cover {int(bad.sum())} of {len(bad)} epochs, first at time_s = {at:g} "
                f"({format_utc(epochs.start_utc, at)}): it spans {first} to {last}{pieces}; shift or shorten the run",
                bad,
            )
        for number in np.unique(which):
            rows = np.flatnonzero(which == number)
            some = epochs.at(rows)
            place, speed = arcs[number].states(
                elapsed_s(some, arcs[number].start_utc), self.interpolation, self.degree, more
            )
            found = convert_states(
                BodyState(place, speed), some, from_axes=arcs[number].frame, orientation=self._orientation()
            )
            position[rows], velocity[rows] = found.position_m, found.velocity_m_s
        return BodyState(position, velocity)

    def _orientation(self) -> EarthOrientation | None:
        file = self.earth_orientation_file
        return None if file is None else EarthOrientation.from_file(file)

    def _arcs(self) -> tuple[EphemerisArc, ...]:
        return _read(*find_table(self.file), self.object)


@dataclass(frozen=True, eq=False)
class EphemerisArc:
    """One segment of an ephemeris: rows at `time_s` from `start_utc`, usable from `begin_s` to `end_s`.

    Parameters
    ----------
    where : file and line, for messages
    start_utc : instant from which seconds count, None for the start of the run
    begin_s, end_s : usable span [s]
    time_s : (row,) [s]
    position_m, velocity_m_s : (row, 3) [m], [m/s]; the velocity may be None
    frame : its axes, see `parse_frame`
    interpolation, degree : those of the file, None if it states none
    """

    where: str
    start_utc: datetime.datetime | None
    begin_s: float
    end_s: float
    time_s: np.ndarray
    position_m: np.ndarray
    velocity_m_s: np.ndarray | None
    frame: EarthAxes = "gcrs"
    interpolation: str | None = None
    degree: int | None = None

    def states(
        self, time_s: np.ndarray, interpolation: str | None, degree: int | None, more: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Interpolate position [m] and velocity [m/s] (time, 3) in the segment's own frame.

        Parameters
        ----------
        time_s : (time,) instants since the segment's start [s]
        interpolation, degree : choice of the part; None for that of the file
        more : degrees to add, for an estimate of the error

        Returns
        -------
        position [m] and velocity [m/s], each (time, 3), in the frame of the segment

        Raises
        ------
        ScenarioError
            if the method is unknown, or needs velocities that are missing
        """
        method = interpolation or self.interpolation or ("lagrange" if self.velocity_m_s is None else "hermite")
        order = degree or self.degree or DEGREE
        conditions = len(self.time_s) * (2 if method == "hermite" else 1)
        order = order + more if order + more < conditions else max(min(order, conditions - 1) - more, 1)
        inside = np.clip(time_s, self.begin_s, self.end_s)
        if method == "lagrange":
            place, speed = interpolate_lagrange(inside, self.time_s, self.position_m, order)
            if self.velocity_m_s is not None:
                speed = interpolate_lagrange(inside, self.time_s, self.velocity_m_s, order)[0]
            return place, speed
        if method != "hermite":
            raise ScenarioError(
                f"{self.where}: INTERPOLATION {method} is not supported: set `interpolation` to choose one"
            )
        if self.velocity_m_s is None:
            raise ScenarioError(f"{self.where}: 'hermite' needs velocities, which it lacks: choose 'lagrange'")
        return interpolate_hermite(inside, self.time_s, self.position_m, self.velocity_m_s, order)


def list_ephemeris_objects(file: str) -> list[str]:
    """List the names of the objects of an OEM; none for a CSV table, which holds one object without a name.

    Raises
    ------
    ScenarioError
        if the file is invalid
    """
    path = find_table(file)[0]
    text = read_table_text(path)
    return list_objects(read_message(text, "OEM", str(path))) if is_message(text) else []


@functools.lru_cache(maxsize=16)
def _read(path: Path, _modified_ns: int, _size: int, wanted: str | None) -> tuple[EphemerisArc, ...]:
    """Read an ephemeris, cached until its modification time or size changes.

    Parameters
    ----------
    path : path of the file
    _modified_ns, _size : modification time and size of the file, the key of the cache
    wanted : name or identifier of one object of a message; None for the only one

    Returns
    -------
    segments in the order of time

    Raises
    ------
    ScenarioError
        if the file is invalid or its segments overlap, or if `wanted` is given for a CSV table
    """
    text = read_table_text(path)
    if is_message(text):
        arcs = _read_message(read_message(text, "OEM", str(path)), wanted)
    elif wanted is not None:
        raise ScenarioError(f"{path}: a CSV table holds one object and no name: leave out object '{wanted}'")
    else:
        arcs = [_read_csv(text, str(path))]
    arcs.sort(key=lambda arc: arc.begin_s)
    for before, after in itertools.pairwise(arcs):
        if after.begin_s < before.end_s - EDGE_S:
            raise ScenarioError(f"{after.where}: overlaps the segment of {before.where}: correct their USEABLE_ times")
    return tuple(arcs)


def _read_csv(text: str, where: str) -> EphemerisArc:
    table = read_csv_table(text, where, (*PLACES, *SPEEDS), PLACES)
    metres, kilometres = table.stack(PLACES[0]), table.stack(PLACES[1])
    position = metres if metres is not None else np.asarray(kilometres) * units.KM
    speeds = [table.stack(names) for names in SPEEDS]
    if speeds[0] is not None and speeds[1] is not None:
        raise ScenarioError(f"{where}: has velocities in m/s and in km/s: give one set of columns")
    velocity = speeds[0] if speeds[1] is None else speeds[1] * units.KM
    time_s = table.time_s
    return EphemerisArc(where, table.start_utc, time_s[0], time_s[-1], time_s, position, velocity)


def _read_message(message: Message, wanted: str | None) -> list[EphemerisArc]:
    arcs: list[EphemerisArc] = []
    for segment in select_segments(message, wanted):
        arcs.append(_read_segment(message, segment, arcs[0].start_utc if arcs else None))
    return arcs


def _read_segment(message: Message, segment: Segment, start_utc: datetime.datetime | None) -> EphemerisArc:
    """Read one segment of an OEM.

    Parameters
    ----------
    message : the whole message
    segment : the segment
    start_utc : instant from which all times count; None for the first row of this segment

    Returns
    -------
    states of the segment in its own frame

    Raises
    ------
    ScenarioError
        if the centre is not the Earth, the frame is not supported, or a row is invalid
    """
    at = f"{message.where}: line {segment.line}"
    center = message.require(segment, "CENTER_NAME")
    if center.value.upper() not in ("EARTH", "EARTH CENTER"):
        raise ScenarioError(f"{message.where}: line {center.line}: CENTER_NAME {center.value}: only EARTH is supported")
    reference = message.require(segment, "REF_FRAME")
    frame = parse_frame(reference.value, f"{message.where}: line {reference.line}")
    fixed = segment.meta.get("REF_FRAME_EPOCH")
    if frame in ("teme", "mod", "tod") and fixed is not None:
        here = f"{message.where}: line {fixed.line}"
        raise ScenarioError(f"{here}: {frame.upper()} of a fixed epoch: only {frame.upper()} of date is supported")
    system = message.time_system(segment)
    if len(segment.rows) < 2:
        raise ScenarioError(f"{at}: the segment has {len(segment.rows)} rows: it needs at least two")
    stamps, values = [], []
    for line, cells in segment.rows:
        here = f"{message.where}: line {line}"
        if len(cells) not in (7, 10):
            raise ScenarioError(f"{here}: has {len(cells)} words: a row is an epoch, 3 km, 3 km/s (and 3 km/s2)")
        stamps.append(parse_epoch_ps(cells[0], system, here))
        names = ("X", "Y", "Z", "X_DOT", "Y_DOT", "Z_DOT")
        values.append([parse_number(here, name, cell) for name, cell in zip(names, cells[1:7], strict=True)])
    check_increasing(message.where, stamps, [line for line, _ in segment.rows])
    start, time_s = elapsed_from_ps(stamps, start_utc)
    begin_s, end_s = usable_span_s(message, segment, system, stamps[0], time_s)
    numbers = np.array(values) * units.KM
    method = segment.meta.get("INTERPOLATION")
    degree = segment.meta.get("INTERPOLATION_DEGREE")
    order = None
    if degree is not None:
        if not re.fullmatch(r"[0-9]{1,4}", degree.value) or not 1 <= int(degree.value) <= GREATEST_DEGREE:
            raise ScenarioError(
                f"{message.where}: line {degree.line}: INTERPOLATION_DEGREE {degree.value}: write 1 to {GREATEST_DEGREE}"
            )
        order = int(degree.value)
    word = method.value.lower() if method is not None else None
    if word == "linear":
        word, order = "lagrange", 1
    return EphemerisArc(at, start, begin_s, end_s, time_s, numbers[:, :3], numbers[:, 3:], frame, word, order)

"""Segments of an ephemeris as read from a file: CCSDS OEM (502.0-B, keyword = value or XML) or CSV."""

from __future__ import annotations

import datetime
import functools
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.orbit.ccsds.csv_table import elapsed_from_ps, read_csv_table
from rso_lidar.orbit.ccsds.interpolation import GREATEST_DEGREE, interpolate_hermite, interpolate_lagrange
from rso_lidar.orbit.ccsds.message import (
    CcsdsMessage,
    CcsdsSegment,
    check_center,
    check_increasing,
    list_objects,
    parse_number,
    select_segments,
    usable_span_s,
)
from rso_lidar.orbit.ccsds.reader import find_table, is_message, read_message, read_table_text
from rso_lidar.orbit.ccsds.reference_frames import freeze_axes, parse_frame
from rso_lidar.orbit.ccsds.table_segment import TableSegment, sort_segments
from rso_lidar.orbit.central_body import EARTH
from rso_lidar.orbit.earth.axes import EarthAxes
from rso_lidar.orbit.epochs import format_utc, parse_epoch_ps
from rso_lidar.pose import length

DEGREE = 7
PLACES = (("x_m", "y_m", "z_m"), ("x_km", "y_km", "z_km"))
SPEEDS = (("vx_m_s", "vy_m_s", "vz_m_s"), ("vx_km_s", "vy_km_s", "vz_km_s"))
_LOWEST = 0.5  # Earth radii; a table whose rows are all below is of another unit
_GROUND_M = EARTH.radius_m * (1.0 - units.EARTH_FLATTENING) - 1e3  # a kilometre below the poles: no ground is there
_LEAST_HERMITE = 3  # the cubic through two rows; one row alone does not interpolate


@dataclass(frozen=True, eq=False)
class EphemerisArc(TableSegment):
    """One segment of an ephemeris.

    Parameters
    ----------
    position_m, velocity_m_s : (row, 3) [m], [m/s]; the velocity may be None
    frame : its axes, see `parse_frame`
    interpolation, degree : those of the file, None if it states none
    """

    position_m: np.ndarray
    velocity_m_s: np.ndarray | None
    frame: EarthAxes = "gcrs"
    interpolation: str | None = None
    degree: int | None = None

    def choose(self, interpolation: str | None, degree: int | None) -> tuple[str, int]:
        """Choose the method, "lagrange" or "hermite", and the degree that the rows allow; None is the choice of the file."""
        method = interpolation or self.interpolation or ("lagrange" if self.velocity_m_s is None else "hermite")
        order = degree or self.degree or DEGREE
        if method == "lagrange":
            return method, min(order, len(self.time_s) - 1)
        if method != "hermite":
            raise ScenarioError(
                f"{self.where}: INTERPOLATION {method} is not supported; set `interpolation` to choose one"
            )
        if self.velocity_m_s is None:
            raise ScenarioError(f"{self.where}: 'hermite' needs velocities, which it lacks; choose 'lagrange'")
        return method, min(max(order, _LEAST_HERMITE), 2 * len(self.time_s) - 1)

    def interpolate(self, time_s: np.ndarray, method: str, degree: int) -> tuple[np.ndarray, np.ndarray]:
        """Interpolate position [m] and velocity [m/s] (time, 3) in the segment's own frame, within its rows."""
        if method == "hermite":
            assert self.velocity_m_s is not None
            return interpolate_hermite(time_s, self.time_s, self.position_m, self.velocity_m_s, degree)
        place, speed = interpolate_lagrange(time_s, self.time_s, self.position_m, degree)
        if self.velocity_m_s is not None:
            speed = interpolate_lagrange(time_s, self.time_s, self.velocity_m_s, degree)[0]
        return place, speed


def list_ephemeris_objects(file: str) -> list[str]:
    """List the names of the objects of an ephemeris.

    Parameters
    ----------
    file : path of an OEM or of a CSV table, in the working folder or among the shipped data

    Returns
    -------
    list of str
        names in the order of the file; empty for a CSV table, which holds one object without a name

    Raises
    ------
    ScenarioError
        if the file is invalid
    """
    path = find_table(file)[0]
    text = read_table_text(path)
    return list_objects(read_message(text, "OEM", str(path))) if is_message(text) else []


@functools.lru_cache(maxsize=16)
def read_arcs(path: Path, _modified_ns: int, _size: int, wanted: str | None) -> tuple[EphemerisArc, ...]:
    """Read an ephemeris, cached until its modification time or size changes.

    Parameters
    ----------
    wanted : name or identifier of one object of a message; None for the only one

    Raises
    ------
    ScenarioError
        if the file is invalid or its segments overlap, or if `wanted` is given for a CSV table
    """
    text = read_table_text(path)
    if is_message(text):
        arcs = _read_message(read_message(text, "OEM", str(path)), wanted)
    elif wanted is not None:
        raise ScenarioError(f"{path}: a CSV table holds one object and no name; leave out object '{wanted}'")
    else:
        arcs = [_read_csv(text, str(path))]
    for arc in arcs:
        _check_distance(arc)
    return sort_segments(arcs)


def _check_distance(arc: EphemerisArc) -> None:
    """Raise `ScenarioError` where all positions are inside the Earth or beyond its reach, as in another unit."""
    radius_m = length(arc.position_m)
    low_m, high_m = float(radius_m.min()), float(radius_m.max())
    if high_m < _LOWEST * EARTH.radius_m or low_m > EARTH.reach_m:
        raise ScenarioError(
            f"{arc.where}: its positions are {low_m / units.KM:,.0f} to {high_m / units.KM:,.0f} km from the Earth's "
            "centre, where nothing orbits it; correct their unit"
        )


def describe_buried_rows(arcs: Sequence[EphemerisArc]) -> str:
    """Describe the rows that are inside the Earth, below the ground of its poles; empty where there are none."""
    where = [np.flatnonzero(length(arc.position_m) < _GROUND_M) for arc in arcs]
    count = sum(map(len, where))
    if not count:
        return ""
    arc, rows = next((arc, rows) for arc, rows in zip(arcs, where, strict=True) if len(rows))
    first, time_s = int(rows[0]), float(arc.time_s[rows[0]])
    at = f"time_s = {time_s:g}" if arc.start_utc is None else format_utc(arc.start_utc, time_s)
    radius_km = float(length(arc.position_m[first : first + 1])[0]) / units.KM
    return (
        f"{count:,} of {sum(len(arc.time_s) for arc in arcs):,} rows are inside the Earth, first at "
        f"{at}, {radius_km:,.0f} km from its centre; correct them"
    )


def _read_csv(text: str, where: str) -> EphemerisArc:
    table = read_csv_table(text, where, (*PLACES, *SPEEDS), PLACES)
    metres, kilometres = table.stack(PLACES[0]), table.stack(PLACES[1])
    position = metres if metres is not None else np.asarray(kilometres) * units.KM
    speeds = [table.stack(names) for names in SPEEDS]
    if speeds[0] is not None and speeds[1] is not None:
        raise ScenarioError(f"{where}: has velocities in m/s and in km/s; give one set of columns")
    velocity = speeds[0] if speeds[1] is None else speeds[1] * units.KM
    time_s = table.time_s
    return EphemerisArc(where, table.start_utc, time_s[0], time_s[-1], time_s, position, velocity)


def _read_message(message: CcsdsMessage, wanted: str | None) -> list[EphemerisArc]:
    arcs: list[EphemerisArc] = []
    for segment in select_segments(message, wanted):
        arcs.append(_read_segment(message, segment, arcs[0].start_utc if arcs else None))
    return arcs


def _read_segment(message: CcsdsMessage, segment: CcsdsSegment, start_utc: datetime.datetime | None) -> EphemerisArc:
    """Read one segment of an OEM, whose times count from its first row by default."""
    at = f"{message.where}: line {segment.line}"
    check_center("CENTER_NAME", message.require(segment, "CENTER_NAME"), message.where)
    reference = message.require(segment, "REF_FRAME")
    frame = parse_frame(reference.value, f"{message.where}: line {reference.line}")
    system = message.time_system(segment)
    if len(segment.rows) < 2:
        raise ScenarioError(f"{at}: the segment has {len(segment.rows)} rows; it needs at least two")
    stamps, values = [], []
    for line, cells in segment.rows:
        here = f"{message.where}: line {line}"
        if len(cells) not in (7, 10):
            raise ScenarioError(f"{here}: has {len(cells)} words; a row is an epoch, 3 km, 3 km/s (and 3 km/s2)")
        stamps.append(parse_epoch_ps(cells[0], system, here))
        names = ("X", "Y", "Z", "X_DOT", "Y_DOT", "Z_DOT")
        values.append([parse_number(here, name, cell) for name, cell in zip(names, cells[1:7], strict=True)])
    check_increasing(message.where, stamps, [line for line, _ in segment.rows])
    start, time_s = elapsed_from_ps(stamps, start_utc)
    begin_s, end_s = usable_span_s(message, segment, system, stamps[0], time_s)
    numbers = np.array(values) * units.KM
    position_m, velocity_m_s = numbers[:, :3], numbers[:, 3:]
    fixed = segment.meta.get("REF_FRAME_EPOCH")
    if fixed is not None and frame in ("mod", "tod", "teme"):
        position_m, velocity_m_s = freeze_axes(position_m, velocity_m_s, frame, message.stamp(fixed, system))
        frame = "gcrs"
    method = segment.meta.get("INTERPOLATION")
    degree = segment.meta.get("INTERPOLATION_DEGREE")
    order = None
    if degree is not None:
        if not re.fullmatch(r"[0-9]{1,4}", degree.value) or not 1 <= int(degree.value) <= GREATEST_DEGREE:
            raise ScenarioError(
                f"{message.where}: line {degree.line}: INTERPOLATION_DEGREE {degree.value}; write 1 to {GREATEST_DEGREE}"
            )
        order = int(degree.value)
    word = method.value.lower() if method is not None else None
    if word == "linear":
        word, order = "lagrange", 1
    return EphemerisArc(at, start, begin_s, end_s, time_s, position_m, velocity_m_s, frame, word, order)

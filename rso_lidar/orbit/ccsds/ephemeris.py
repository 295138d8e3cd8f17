"""Ephemerides, read and written: CCSDS OEM (502.0-B, keyword = value or XML) and CSV, with a stated interpolation.

Hermite's polynomial meets the positions and velocities of the rows around an instant, and its derivative is the velocity.
Lagrange's polynomial meets the positions, and another one the velocities where there are any.
"""

from __future__ import annotations

import datetime
import functools
import math
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from rso_lidar.errors import PropagationError, warn_of_input
from rso_lidar.orbit.ccsds.ephemeris_arc import EphemerisArc, describe_buried_rows, read_arcs
from rso_lidar.orbit.ccsds.interpolation import GREATEST_DEGREE
from rso_lidar.orbit.ccsds.interpolation_error import check_row_spacing
from rso_lidar.orbit.ccsds.reader import find_table
from rso_lidar.orbit.ccsds.reference_frames import warn_without_orientation
from rso_lidar.orbit.ccsds.table_segment import EDGE_S, locate_epochs
from rso_lidar.orbit.earth.axes import convert_states
from rso_lidar.orbit.earth.earth_orientation import EarthOrientation
from rso_lidar.orbit.epochs import Epochs, format_utc
from rso_lidar.part import Part, Text, Whole
from rso_lidar.pose import length
from rso_lidar.records import BodyState


class Ephemeris(Part):
    """Interpolation of a table of states: a CCSDS OEM (keyword = value or XML) or CSV, recognised by content.

    An OEM is about the Earth, in GCRF, ICRF, EME2000, MOD, TOD, TEME or ITRF, and in UTC, TAI, TT or GPS time. Each of
    its segments applies in its usable span. Nothing is interpolated across an edge, and where two segments meet the
    later one applies. An OEM in ITRF needs the Earth's orientation to the metre: see `earth_orientation_file`.

    A CSV table is in GCRS axes. Its columns are time_s (of the run), utc or epoch; x_m, y_m, z_m or x_km ...; and
    optionally vx_m_s ... or vx_km_s ....

    `interpolation` and `degree` default to those of the file, else to "hermite" with velocities, "lagrange" without,
    and 7. In low orbit, Hermite's interpolation of degree 7 is good to 3 cm with steps of 5 minutes, and to 1 um with 1
    minute. With velocities the least degree is 3, the cubic through two rows.

    When a file is opened, its interpolation is compared with orbital motion between the rows. Above 5 cm, the precision of
    a range, a warning states the error and the remedy. Above 0.001 of the distance from the Earth's centre (7 km in low
    orbit) the file is refused.
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
        default=None,
        description="Degree of the interpolating polynomial, at least 3 for `hermite`. If omitted, the file's, else 7.",
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
        arcs = self._arcs()
        position, velocity = np.full((len(epochs), 3), np.nan), np.full((len(epochs), 3), np.nan)
        which = locate_epochs(arcs, epochs)
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
            arc = arcs[number]
            place, speed = arc.interpolate(arc.clip_s(some), *arc.choose(self.interpolation, self.degree))
            inertial = convert_states(
                BodyState(place, speed), some, from_axes=arc.frame, orientation=self._orientation()
            )
            position[rows], velocity[rows] = inertial.position_m, inertial.velocity_m_s
        return BodyState(position, velocity)

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

    def breaks_s(self, epochs: Epochs) -> np.ndarray:
        """Return the instants at which segments begin and end, as times since the `start_utc` of `epochs` [s].

        Parameters
        ----------
        epochs : instants
        """
        arcs, start = self._arcs(), epochs.at(slice(0, 1))
        begin_s = [arc.begin_s - float(arc.elapsed_s(start)[0]) + float(start.time_s[0]) for arc in arcs]
        ends_s = [begin + arc.end_s - arc.begin_s for begin, arc in zip(begin_s, arcs, strict=True)]
        open_ = [end + 2.0 * EDGE_S for end, after in zip(ends_s, [*begin_s[1:], math.inf], strict=True) if end < after]
        return np.array([begin - 2.0 * EDGE_S for begin in begin_s[:1]] + begin_s[1:] + open_)

    def _orientation(self) -> EarthOrientation | None:
        file = self.earth_orientation_file
        return None if file is None else EarthOrientation.from_file(file)

    def _arcs(self) -> tuple[EphemerisArc, ...]:
        """Return the segments, and warn where interpolation or a missing Earth orientation puts states off."""
        arcs, remarks, fixed_m = _open(*find_table(self.file), self.object, self.interpolation, self.degree)
        for remark in remarks:
            warn_of_input(f"ephemeris {self.file}: {remark}")
        if len(fixed_m) and self.earth_orientation_file is None:
            cure = "name finals2000A.all of the IERS as earth_orientation_file"
            warn_without_orientation(f"ephemeris {self.file}", fixed_m, cure)
        return arcs


@functools.lru_cache(maxsize=16)
def _open(
    path: Path, modified_ns: int, size: int, wanted: str | None, interpolation: str | None, degree: int | None
) -> tuple[tuple[EphemerisArc, ...], list[str], np.ndarray]:
    """Read an ephemeris and compare its interpolation with orbital motion, cached until the file changes.

    Parameters
    ----------
    wanted : name or identifier of one object of a message; None for the only one
    interpolation, degree : choice of the part; None for that of the file

    Returns
    -------
    segments in the order of time, lines to warn of, and the farthest position (arc, 3) of each segment in ITRF [m]
    """
    arcs = read_arcs(path, modified_ns, size, wanted)
    fixed = [arc.position_m for arc in arcs if arc.frame == "itrs"]
    farthest_m = np.array([rows[int(np.argmax(length(rows)))] for rows in fixed]).reshape(-1, 3)
    remarks = describe_buried_rows(arcs), check_row_spacing(arcs, interpolation, degree)
    return arcs, [remark for remark in remarks if remark], farthest_m

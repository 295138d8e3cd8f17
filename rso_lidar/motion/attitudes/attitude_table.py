"""Attitude interpolated from a table of quaternions."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from rso_lidar.errors import PropagationError, ScenarioError
from rso_lidar.motion.attitudes.situation import Orientation, Situation
from rso_lidar.orbit import format_utc, locate_epochs, read_attitudes
from rso_lidar.part import Part, Text


class AttitudeTable(Part):
    """Attitude from a table of quaternions: a CCSDS AEM (keyword = value or XML) or a CSV file.

    The content of the file decides which of the two it is. Consecutive rows must differ by less than half a turn,
    because interpolation takes the shorter way.

    An AEM has the type QUATERNION; additional rates and derivatives are ignored. It relates SC_BODY to GCRF, ICRF,
    EME2000 or RTN, in either direction, in UTC, TAI, TT or GPS time. `object` selects an object by name or identifier.

    A CSV file has the columns time_s (of the run), utc or epoch, and qx, qy, qz, qw. The quaternions rotate body axes
    into `axes`: "inertial" (those of the root), "rtn" or "lvlh_ccsds".

    `interpolation` "spline" is scipy's RotationSpline through all rows of a segment. "slerp" has a constant rate
    between rows.
    """

    type: Literal["table"] = "table"
    file: Text = Field(
        description=(
            "Path of a CCSDS AEM of quaternions (KVN or XML), or of a CSV file with one of the columns time_s, utc or "
            "epoch, and qx, qy, qz, qw."
        )
    )
    object: Text | None = Field(
        default=None, description="Name or identifier of one object, for a file that holds several."
    )
    axes: Literal["inertial", "rtn", "lvlh_ccsds"] | None = Field(
        default=None,
        description=(
            "Axes into which the quaternions of a CSV file turn body axes. If omitted, `inertial`, the root axes. An "
            "AEM states its own."
        ),
    )
    interpolation: Literal["spline", "slerp"] = Field(
        default="spline",
        description=(
            "Interpolation between rows. `spline` has continuous rate and acceleration; `slerp` has a constant rate "
            "between rows."
        ),
    )

    def orient(self, situation: Situation) -> Orientation:
        """Interpolate the attitude of the body.

        Returns
        -------
        attitude and body rates in the axes of the table: root or rtn

        Raises
        ------
        PropagationError
            If an epoch is outside the table
        ScenarioError
            If the table is in rtn axes and the body has no orbit, or if the file is invalid
        """
        from scipy.spatial.transform import Rotation

        epochs, arcs = situation.epochs, read_attitudes(self.file, self.object, self.axes)
        which = locate_epochs(arcs, epochs)
        bad = which < 0
        if bad.any():
            at = epochs.time_s[np.argmax(bad)]
            first, last = arcs[0], arcs[-1]
            raise PropagationError(
                f"table {self.file}: has no attitude at {int(bad.sum())} of {len(bad)} epochs, first at time_s = {at:g}; it "
                f"spans {format_utc(first.start_utc or epochs.start_utc, first.begin_s)} to "
                f"{format_utc(last.start_utc or epochs.start_utc, last.end_s)}; shift or shorten the run",
                bad,
            )
        if arcs[0].in_origin and not situation.orbits:
            raise ScenarioError(f"table {self.file}: is in rtn axes, and this body does not orbit; use inertial ones")
        quaternion, rate = np.empty((len(epochs), 4)), np.empty((len(epochs), 3))
        for number in np.unique(which):
            rows = which == number
            arc = arcs[number]
            rotation, rate[rows] = arc.interpolate(arc.clip_s(epochs)[rows], self.interpolation)
            quaternion[rows] = rotation.as_quat()
        return Orientation(Rotation.from_quat(quaternion), rate, in_origin=arcs[0].in_origin)

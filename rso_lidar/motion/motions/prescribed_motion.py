"""Motions that are given in advance: a fixed position, and a table of positions and attitudes."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np
from pydantic import Field

from rso_lidar.errors import PropagationError, ScenarioError
from rso_lidar.files import MOST_BYTES, explain_unreadable, read_text
from rso_lidar.motion.attitudes.situation import Orientation, Situation
from rso_lidar.motion.dynamics.commands import CommandedFlight
from rso_lidar.motion.motions.placement import Place, PlacedMotion
from rso_lidar.orbit import Epochs, read_csv_table
from rso_lidar.part import Name, Text, Vector
from rso_lidar.shipped import find

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

PLACE = ("x_m", "y_m", "z_m")
TURN = ("qx", "qy", "qz", "qw")


class Fixed(PlacedMotion):
    """A fixed position in the body axes of `relative_to`, or in root axes."""

    is_attached: ClassVar[bool] = True
    type: Literal["fixed"] = "fixed"
    position_m: Vector = Field(description="Position in the body axes of `relative_to`, or in root axes [m].")
    relative_to: Name | None = Field(
        default=None, description="Body to whose axes the position refers. If omitted, the root axes."
    )

    def place(self, epochs: Epochs, flight: CommandedFlight | None) -> Place:
        """Return the constant position in the parent's axes."""
        return Place(*self.positions(epochs.time_s))

    def positions(self, time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the constant position [m] in the parent's axes, and zero velocity [m/s], each (time, 3).

        Parameters
        ----------
        time_s : instants (time,) [s]
        """
        shape = (len(time_s), 3)
        return np.broadcast_to(np.array(self.position_m), shape), np.zeros(shape)


class Table(PlacedMotion):
    """Positions, and optionally attitudes, from a CSV file, in the body axes of `relative_to` or in root axes.

    The header names the columns time_s, x_m, y_m, z_m and, for attitudes, qx, qy, qz, qw (parent_from_body), in any
    order. Positions follow the not-a-knot cubic spline through all rows, which is twice continuously differentiable,
    and velocities its derivative. Attitudes and body rates follow scipy's RotationSpline. Two rows give uniform motion.
    An epoch outside the rows is an error.
    """

    is_attached: ClassVar[bool] = True
    type: Literal["table"] = "table"
    file: Text = Field(
        description="Path of a CSV file with the columns time_s, x_m, y_m, z_m and, optionally, qx, qy, qz, qw."
    )
    relative_to: Name | None = Field(
        default=None, description="Body to whose axes the positions refer. If omitted, the root axes."
    )

    def place(self, epochs: Epochs, flight: CommandedFlight | None) -> Place:
        """Interpolate position and velocity in the parent's axes."""
        return Place(*self.positions(epochs.time_s))

    def positions(self, time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Interpolate position and velocity in the parent's axes.

        Parameters
        ----------
        time_s : instants (time,) [s]

        Returns
        -------
        position [m] and velocity [m/s], each (time, 3)

        Raises
        ------
        PropagationError
            If an instant is outside the table
        ScenarioError
            If the file is invalid
        """
        from scipy.interpolate import CubicSpline

        rows = self._rows()
        times = self._inside(time_s, rows)
        spline = CubicSpline(rows.time_s, rows.position_m)
        return spline(times), spline(times, 1)

    def orient(self, situation: Situation) -> Orientation | None:
        """Interpolate the attitude in the parent's axes."""
        turning = self.orientations(situation.epochs.time_s)
        return None if turning is None else Orientation(*turning, in_origin=True)

    def orientations(self, time_s: np.ndarray) -> tuple[Rotation, np.ndarray] | None:
        """Interpolate the attitude in the parent's axes.

        Parameters
        ----------
        time_s : instants (time,) [s]

        Returns
        -------
        parent_from_body (time), and the body rates (time, 3) [rad/s]; None for a table without quaternions

        Raises
        ------
        PropagationError
            If an instant is outside the table
        """
        from scipy.spatial.transform import Rotation, RotationSpline

        rows = self._rows()
        if rows.quaternion is None:
            return None
        times = self._inside(time_s, rows)
        spline = RotationSpline(rows.time_s, Rotation.from_quat(rows.quaternion))
        return spline(times), spline(times, 1)

    def _rows(self) -> TableRows:
        path = find(self.file)
        if path is None:
            raise ScenarioError(f"{self.file}: no such file; check the path of this table")
        return read_table(path)

    def _inside(self, time_s: np.ndarray, rows: TableRows) -> np.ndarray:
        times = np.atleast_1d(np.asarray(time_s, dtype=float))
        bad = ~((times >= rows.time_s[0]) & (times <= rows.time_s[-1]))
        if bad.any():
            raise PropagationError(
                f"{self.file}: does not cover {int(bad.sum())} of {len(bad)} epochs, first at time_s = "
                f"{times[np.argmax(bad)]:g}: it spans {rows.time_s[0]:g} to {rows.time_s[-1]:g} s; lengthen the table or "
                "shorten the run",
                bad,
            )
        return times


@dataclass(frozen=True, eq=False)
class TableRows:
    """Rows of a table.

    Parameters
    ----------
    time_s : (row) [s]
    position_m : (row, 3) [m]
    quaternion : parent_from_body (row, 4) x, y, z, w; None if the table has none
    """

    time_s: np.ndarray
    position_m: np.ndarray
    quaternion: np.ndarray | None


def read_table(path: str | Path) -> TableRows:
    """Read and check a CSV table; errors in it are `ScenarioError` with file and line."""
    path = Path(path)
    try:
        status = path.stat()
        return _read_file(path, status.st_mtime_ns, status.st_size)
    except (OSError, ValueError) as error:
        if isinstance(error, ScenarioError):
            raise
        raise ScenarioError(explain_unreadable(path, error)) from None


@functools.lru_cache(maxsize=16)
def _read_file(path: Path, _modified_ns: int, _size: int) -> TableRows:
    """Read a table, cached until its modification time or size changes."""
    text = read_text(path, MOST_BYTES, ScenarioError, "CSV file")
    if "\0" in text:
        raise ScenarioError(f"{path}: is not UTF-8 text; name a CSV file")
    if not text.strip():
        raise ScenarioError(f"{path}: is empty; give a header line and at least two rows")
    table = read_csv_table(text, str(path), (PLACE, TURN), (PLACE,))
    if table.start_utc is not None:
        raise ScenarioError(f"{path}: line 1: a table of positions needs the column time_s; give it, in seconds")
    position_m = table.stack(PLACE)
    assert position_m is not None
    quaternion = table.stack_unit_quaternions(TURN) if TURN[0] in table.columns else None
    return TableRows(table.time_s, position_m, quaternion)

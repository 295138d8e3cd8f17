"""Facet tables: force and torque of sunlight and of air on a body, tabulated over directions in its body axes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rso_lidar.records.schema import Record, array


@dataclass(frozen=True, eq=False, repr=False)
class FacetTable(Record):
    """Force and torque of sunlight and of air on a body, over directions in its body axes.

    Row i is at the polar angle (i + 1/2) pi / n from body +z, column j at the azimuth 2 pi j / m from +x toward +y; m is
    even. A direction points from the body toward the Sun, or the way in which the body moves through the air. Between the
    directions, cubic splines interpolate, which continue smoothly across the poles.
    """

    light_force_m2: np.ndarray = array("polar azimuth xyz", "f8", "m2", "force of sunlight over its pressure")
    light_torque_m3: np.ndarray = array("polar azimuth xyz", "f8", "m3", "torque of sunlight over its pressure")
    air_force_m2: np.ndarray = array("polar azimuth xyz", "f8", "m2", "force of air over its dynamic pressure")
    air_torque_m3: np.ndarray = array("polar azimuth xyz", "f8", "m3", "torque of air over its dynamic pressure")

    @property
    def directions(self) -> np.ndarray:
        """Unit vectors (polar, azimuth, xyz) of the table, in body axes."""
        return grid_directions(*self.light_force_m2.shape[:2])

    def find_light_load(self, direction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Interpolate force and torque of sunlight.

        Parameters
        ----------
        direction : (…, 3) unit vectors toward the Sun, in body axes

        Returns
        -------
        force over the pressure of sunlight (…, 3) [m2], and torque about the body's origin over it (…, 3) [m3]
        """
        load = self._interpolate(self._splines[0], np.asarray(direction, dtype=float))
        return load[..., :3], load[..., 3:]

    def find_air_load(self, direction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Interpolate force and torque of the air.

        Parameters
        ----------
        direction : (…, 3) unit vectors along the velocity through the air, in body axes

        Returns
        -------
        force over the dynamic pressure (…, 3) [m2], and torque about the body's origin over it (…, 3) [m3]
        """
        load = self._interpolate(self._splines[1], np.asarray(direction, dtype=float))
        return load[..., :3], load[..., 3:]

    @cached_property
    def _splines(self) -> tuple[np.ndarray, np.ndarray]:
        """Coefficients (polar, azimuth, 6) of cubic B-splines for light and air, over two turns of the polar angle."""
        from scipy.ndimage import spline_filter1d

        splines = []
        for force, torque in (
            (self.light_force_m2, self.light_torque_m3),
            (self.air_force_m2, self.air_torque_m3),
        ):
            load = np.concatenate([force, torque], axis=2)
            beyond = np.roll(load[::-1], load.shape[1] // 2, axis=1)  # the same sphere, past the pole
            torus = np.concatenate([load, beyond])
            for axis in (0, 1):
                torus = spline_filter1d(torus, 3, axis, mode="grid-wrap")
            splines.append(torus)
        return splines[0], splines[1]

    def _interpolate(self, spline: np.ndarray, direction: np.ndarray) -> np.ndarray:
        """Evaluate a spline (polar, azimuth, 6) at unit vectors (…, 3)."""
        rows, columns = spline.shape[:2]
        x, y, z = direction[..., 0], direction[..., 1], direction[..., 2]
        polar = np.arctan2(np.hypot(x, y), z) * (rows / (2.0 * np.pi)) - 0.5
        azimuth = np.arctan2(y, x) * (columns / (2.0 * np.pi))
        row, column = np.floor(polar), np.floor(azimuth)
        near = np.arange(-1, 3)
        down = (row[..., None].astype(int) + near) % rows
        along = (column[..., None].astype(int) + near) % columns
        weights = np.einsum("...i,...j->...ij", _weigh(polar - row), _weigh(azimuth - column))
        load: np.ndarray = np.einsum("...ij,...ijk->...k", weights, spline[down[..., :, None], along[..., None, :]])
        return load


def grid_directions(rows: int, columns: int) -> np.ndarray:
    """Return the unit vectors of a facet table.

    Parameters
    ----------
    rows, columns : of the table

    Returns
    -------
    (polar, azimuth, xyz) f8
    """
    polar = (np.arange(rows)[:, None] + 0.5) * np.pi / rows
    azimuth = 2.0 * np.pi * np.arange(columns)[None] / columns
    return np.stack(
        np.broadcast_arrays(np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)), -1
    )


def _weigh(t: np.ndarray) -> np.ndarray:
    """Return the weights (…, 4) of a uniform cubic B-spline at places t (…) from 0 to 1 between the middle two."""
    s = 1.0 - t
    return np.stack([s**3 / 6.0, 2.0 / 3.0 - t**2 + t**3 / 2.0, 2.0 / 3.0 - s**2 + s**3 / 2.0, t**3 / 6.0], axis=-1)

"""Viewing geometry over time: range, directions and Sun angles of a target seen from the lidar; and the truth as a table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rso_lidar.pose import ROOT, quaternion_xyzw, rotate_vectors
from rso_lidar.records.schema import specs
from rso_lidar.records.truth import PtuAngles, Truth

XYZ = ("x", "y", "z")
DARK = 0.5  # visible share of the Sun's disc below which a body is in shadow


@dataclass(frozen=True, eq=False)
class ViewingGeometry:
    """The line of sight from the lidar's origin to a target's origin; arrays (time), SI.

    `time_s` counts from the start of the scenario; `range_m` is the distance and `range_rate_m_s` its rate.
    `azimuth_rad` (left positive) and `elevation_rad` (up positive) are in the follower's body axes, NaN without a follower.
    `off_boresight_rad` is the angle from the boresight to the target, and `sun_off_boresight_rad` to the Sun.
    `phase_rad` is the angle Sun-target-lidar, 0 with the Sun behind the lidar. The Sun's angles are NaN without a Sun.
    `sunlit` is the share of the Sun's disc that the target sees, NaN where unknown.
    """

    time_s: np.ndarray
    range_m: np.ndarray
    range_rate_m_s: np.ndarray
    azimuth_rad: np.ndarray
    elevation_rad: np.ndarray
    off_boresight_rad: np.ndarray
    sun_off_boresight_rad: np.ndarray
    phase_rad: np.ndarray
    sunlit: np.ndarray


def compute_viewing_geometry(truth: Truth, target: str) -> ViewingGeometry:
    """Compute the viewing geometry of a target at one epoch or at a batch of epochs.

    The relative velocity includes the lidar's rotation. That part is across the line of sight and changes no range rate.

    Parameters
    ----------
    truth : where everything is
    target : name of the target

    Returns
    -------
    ViewingGeometry
        its arrays are (time,), of length 1 for one epoch
    """
    time_s = np.atleast_1d(np.asarray(truth.time_s, dtype=float))
    shape = (time_s.size, 3)
    line_m = np.broadcast_to(truth.pose("lidar", target).translation, shape)
    velocity_m_s = np.broadcast_to(truth.rates("lidar", target)[0], shape)
    range_m = np.sqrt(np.sum(line_m**2, axis=-1))
    toward = line_m / np.where(range_m > 0.0, range_m, np.inf)[:, None]  # at the target itself there is no direction
    in_follower = np.full(shape, np.nan)
    if "follower" in truth.poses:
        in_follower[:] = rotate_vectors(truth.pose("follower", "lidar").rotation, toward)
    x, y, z = in_follower.T
    sun = rotate_vectors(truth.pose("lidar", ROOT).rotation, truth.sun_direction)
    sun = np.broadcast_to(sun, shape)
    lit = truth.sunlit.get(target, np.nan)
    return ViewingGeometry(
        time_s=time_s,
        range_m=range_m,
        range_rate_m_s=np.sum(toward * velocity_m_s, axis=-1),
        azimuth_rad=np.arctan2(y, x),
        elevation_rad=np.arctan2(z, np.hypot(x, y)),
        off_boresight_rad=np.arctan2(np.hypot(toward[:, 0], toward[:, 1]), toward[:, 2]),
        sun_off_boresight_rad=np.arctan2(np.hypot(sun[:, 0], sun[:, 1]), sun[:, 2]),
        phase_rad=_between(-toward, sun),
        sunlit=np.array(np.broadcast_to(np.asarray(lit, dtype=float), time_s.shape)),
    )


def tabulate_truth(
    truth: Truth, targets: Sequence[str], utc: np.ndarray, angles: Sequence[PtuAngles] = ()
) -> dict[str, np.ndarray]:
    """Tabulate a batch of truth: columns (time) by name, with units in the names.

    Positions and velocities of bodies are inertial (GCRS, or the root of a local world). ``lidar_from_<target>`` is the
    target's position in lidar axes, with the quaternion that takes target coordinates to lidar coordinates.
    `ViewingGeometry` defines the angles. Without a Sun, or a PTU, their columns are missing.

    Parameters
    ----------
    truth : where everything is, a batch of epochs
    targets : names of the targets to tabulate
    utc : the instants as text (time)
    angles : PTU angles at each instant

    Returns
    -------
    The columns; ``utc`` is text, and all others are numbers
    """
    n = truth.time_s.size
    table: dict[str, np.ndarray] = {"time_s": truth.time_s, "utc": utc}

    def vectors(name: str, values: np.ndarray, unit: str = "") -> None:
        for axis, column in zip(XYZ, np.broadcast_to(values, (n, 3)).T, strict=True):
            table[f"{name}_{axis}{unit}"] = column

    for name, state in truth.states.items():
        vectors(f"{name}_position", state.position_m, "_m")
        vectors(f"{name}_velocity", state.velocity_m_s, "_m_s")
    for name in targets:
        lidar_from_target = truth.pose("lidar", name)
        seen = compute_viewing_geometry(truth, name)
        vectors(f"lidar_from_{name}", lidar_from_target.translation, "_m")
        quaternion = np.broadcast_to(quaternion_xyzw(lidar_from_target.rotation), (n, 4))
        for axis, column in zip((*XYZ, "w"), quaternion.T, strict=True):
            table[f"lidar_from_{name}_quaternion_{axis}"] = column
        table[f"{name}_range_m"] = seen.range_m
        table[f"{name}_range_rate_m_s"] = seen.range_rate_m_s
        table[f"{name}_azimuth_rad"], table[f"{name}_elevation_rad"] = seen.azimuth_rad, seen.elevation_rad
        table[f"{name}_off_boresight_rad"] = seen.off_boresight_rad
        if np.isfinite(seen.phase_rad).any():
            table[f"{name}_phase_rad"] = seen.phase_rad
            table["sun_off_boresight_rad"] = seen.sun_off_boresight_rad
    for spec in specs(PtuAngles) if angles else ():
        stem, unit = spec.split("_", 1)
        for place, axis in enumerate(("pan", "tilt")):
            table[f"{axis}_{stem}_{unit}"] = np.array([getattr(angle, spec)[place] for angle in angles])
    if np.isfinite(truth.sun_direction).all():
        vectors("sun_direction", truth.sun_direction)
    for name, share in truth.sunlit.items():
        table[f"{name}_sunlit_fraction"] = np.asarray(share)
    return table


def find_shadow_spans_s(time_s: np.ndarray, sunlit: np.ndarray) -> list[tuple[float, float]]:
    """Find the spans in shadow from the visible share of the Sun's disc, to half a step between instants.

    A span begins and ends midway between two instants, or at the first or last instant. Shadow that falls between two
    instants is missed.

    Parameters
    ----------
    time_s : (time,) ascending instants [s]
    sunlit : (time,) visible share of the disc, 0 to 1

    Returns
    -------
    list of (float, float)
        begin and end of each span [s], in the order of time
    """
    dark = np.concatenate([[False], np.asarray(sunlit) < DARK, [False]])
    turns = np.flatnonzero(dark[1:] != dark[:-1])
    middle_s = np.concatenate([time_s[:1], 0.5 * (time_s[1:] + time_s[:-1]), time_s[-1:]])
    return [(float(middle_s[k]), float(middle_s[m])) for k, m in zip(turns[::2], turns[1::2], strict=True)]


def _between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the angles (time) [rad] between unit vectors (time, 3); exact near 0 and pi as well."""
    angle: np.ndarray = np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), np.sum(a * b, axis=-1))
    return angle

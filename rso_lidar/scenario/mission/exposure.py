"""The exposure of a frame: how far the scene moves while its pulses are sent, and at how many epochs it is cast for that."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from rso_lidar import units
from rso_lidar.motion import Aim, Course
from rso_lidar.optics import assign_pulses
from rso_lidar.pose import PoseTree, cross, dot, length, rotate_vectors
from rso_lidar.records import Truth
from rso_lidar.scenario.tables.lidar import Lidar
from rso_lidar.scene import Surface

# Greatest motion from one epoch to the next. An edge that crosses the border of a pixel between epochs d pixels apart leaves
# an error of d / (8 n) of a full pixel's light, n epochs in all: 1.6 % for one epoch, 0.8 % at most for more.
PIXELS, PULSE_LENGTHS, TURN_RAD = 0.125, 0.125, 0.5 * units.DEG
MOST_EPOCHS = 64  # of one frame
_PROBES = 5  # instants of an exposure at which rates are read
_MOST_POINTS = 256  # of one surface


class Smear(NamedTuple):
    """Greatest motion of a point of the targets during an exposure, as the lidar sees it; each (time) or a number.

    `pixels` is across the line of sight, `depth_m` along it, and `turn_rad` is how far the line of sight turns on a target.
    """

    pixels: np.ndarray
    depth_m: np.ndarray
    turn_rad: np.ndarray


@dataclass(frozen=True, eq=False)
class Exposure:
    """The pulses of a frame, sent one after another, and what can move meanwhile.

    Parameters
    ----------
    pulses : number of pulses of a frame, at least two
    length_s : time from the first to the last of them [s]
    surfaces : surfaces of all targets
    """

    pulses: int
    length_s: float
    surfaces: Sequence[Surface]

    def follow(self, truth: Truth, course: Course, aim: Aim, row: int, lidar: Lidar) -> Truth:
        """Add the epochs at which the pulses of a frame are cast to its truth, if the scene moves enough between them.

        Parameters
        ----------
        truth : in the middle of the exposure
        course, aim : where bodies and lidar are, the frame being their last
        row : number of the frame in the course
        lidar : with the settings in force

        Returns
        -------
        the truth, with an `exposure` of at least two epochs, or without.
        """
        probed = aim.during(course.during(row, np.linspace(-0.5, 0.5, _PROBES) * self.length_s))
        count = self.count_epochs(self.measure(probed.poses, lidar), lidar)
        if count == 1:
            return truth
        return replace(truth, exposure=aim.during(course.during(row, self.offsets_s(count))))

    def offsets_s(self, count: int) -> np.ndarray:
        """Return the epochs at which pulses are cast, after the middle of the exposure [s]: the mean time of their pulses.

        Parameters
        ----------
        count : number of epochs, at most that of pulses
        """
        sent_s = np.linspace(-0.5, 0.5, self.pulses) * self.length_s
        of = assign_pulses(self.pulses, count)
        mean_s: np.ndarray = np.bincount(of, sent_s) / np.bincount(of)
        return mean_s

    def count_epochs(self, smear: Smear, lidar: Lidar) -> int:
        """Return the number of epochs at which the pulses of a frame are cast.

        From one to the next no point moves by more than an eighth of a pixel or of the pulse's length, and no
        line of sight turns by more than half a degree on its target. There are at most as many as pulses, and at most 64.
        """
        wanted = self.count_wanted(smear, lidar)
        if wanted <= 1.0:
            return 1
        together = max(1, math.floor((self.pulses - 1) / wanted), math.ceil(self.pulses / MOST_EPOCHS))
        return math.ceil(self.pulses / together)

    def count_wanted(self, smear: Smear, lidar: Lidar) -> float:
        """Return the number of epochs that the rule asks for, whatever the number of pulses."""
        pulse_m = lidar.laser.pulse_fwhm_s * units.RANGE_PER_DELAY_M_S
        steps = (PIXELS, PULSE_LENGTHS * pulse_m, TURN_RAD)
        return max(1.0, *(float(np.max(moved)) / step for moved, step in zip(smear, steps, strict=True)))

    def measure(self, poses: PoseTree, lidar: Lidar) -> Smear:
        """Measure how far the scene would move during an exposure at the rates that it has at some instants.

        Parameters
        ----------
        poses : tree with the lidar in it, at these instants (time) or one
        lidar : gives the pixels and the field

        Returns
        -------
        the smear at each instant; zeros where nothing is in front of the lidar.
        """
        smears = [self._measure_surface(poses, name, points, lidar) for name, points in self._points.items()]
        if not smears:
            return Smear(np.zeros(1), np.zeros(1), np.zeros(1))
        return Smear(*(np.max(np.broadcast_arrays(*values), axis=0) for values in zip(*smears, strict=True)))

    @cached_property
    def _points(self) -> dict[str, np.ndarray]:
        """Some points (point, 1, xyz) of each surface [m], by its axes: its hull, and facets spread over it."""
        points = {}
        for surface in self.surfaces:
            some = np.linspace(0, len(surface.corners) - 1, _MOST_POINTS // 2).astype(int)
            hull = surface.outline[:: max(1, math.ceil(len(surface.outline) / (_MOST_POINTS // 2)))]
            points[surface.name] = np.concatenate([hull, surface.corners[np.unique(some), 0]])[:, None]
        return points

    def _measure_surface(self, poses: PoseTree, name: str, points: np.ndarray, lidar: Lidar) -> Smear:
        """Measure how far points (point, 1, xyz) [m] of one surface would move, those in front of the lidar."""
        link = poses.link("lidar", name)
        at_m = link.translation_m + rotate_vectors(link.matrix, points)
        rate_m_s = link.velocity_m_s + rotate_vectors(link.matrix, cross(link.angular_velocity_rad_s, points))
        range_m = np.maximum(length(at_m), 1e-9)
        along_m_s = dot(at_m, rate_m_s) / range_m
        across_rad_s = length(cross(at_m, rate_m_s)) / range_m**2
        edge = float(np.hypot(*lidar.receiver.field_edge))
        off = np.hypot(at_m[..., 0], at_m[..., 1]) / np.where(at_m[..., 2] > 0.0, at_m[..., 2], np.nan)
        nearest = np.where(np.isnan(off), np.inf, off).min(axis=0)
        seen = off <= np.maximum(edge, nearest)  # a point of a wide surface that has none in the field
        back = link.inv()
        turn_rad_s = (
            length(cross(back.translation_m, back.velocity_m_s)) / np.maximum(length(back.translation_m), 1e-9) ** 2
        )
        pixels = across_rad_s / lidar.receiver.ifov_rad
        return Smear(
            np.where(seen, pixels, 0.0).max(axis=0) * self.length_s,
            np.where(seen, np.abs(along_m_s), 0.0).max(axis=0) * self.length_s,
            np.where(seen.any(axis=0), turn_rad_s, 0.0) * self.length_s,
        )

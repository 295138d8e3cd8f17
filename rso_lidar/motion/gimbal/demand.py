"""Demanded angles of a pan-tilt unit as a function of time.

A demand is a callable ``demand(time_s (time,)) -> (time, 2)`` that returns pan and tilt [rad]: `FixedPoint.demand`,
`ScanPoint.demand`, or a `DemandCurve`. Its result at one instant has the same bits whichever others are requested.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Literal, Self

import numpy as np
from pydantic import Field, model_validator

from rso_lidar import units
from rso_lidar.part import NotNegative, Number, Part, Positive, Text

Demand = Callable[[np.ndarray], np.ndarray]


class _Point(Part):
    """Base of all laws of pointing."""

    @property
    def tracked_name(self) -> str | None:
        """Name of the body or axes that the PTU tracks; None if it tracks nothing."""
        return None


class FixedPoint(_Point):
    """Point in a fixed direction in the axes of the mount."""

    type: Literal["fixed"] = "fixed"
    pan_deg: Number = Field(default=0.0, description="Pan angle, positive to the left [deg].")
    tilt_deg: Number = Field(default=0.0, description="Tilt angle, positive upward [deg].")

    def demand(self, time_s: np.ndarray) -> np.ndarray:
        """Return the demand (time, 2) [rad], which is constant.

        Parameters
        ----------
        time_s : instants (time,) [s]
        """
        return np.tile(np.array([self.pan_deg, self.tilt_deg]) * units.DEG, (len(time_s), 1))


class TrackPoint(_Point):
    """Point the PTU's +x at the true position of a body, or of axes that a body declares, like a perfect tracker.

    If `[lidar] mount` rotates the lidar away from the PTU's +x, the lidar points beside the target.
    """

    type: Literal["track"] = "track"
    at: Text = Field(
        description="Name of the body to track, or of axes that a body declares. Its true position is tracked."
    )

    @property
    def tracked_name(self) -> str:
        """Name of the body or axes that the PTU tracks."""
        return self.at


class ScanPoint(_Point):
    """Scan about a centre at a constant rate in pan and tilt, forward and backward, without end.

    A `raster` has lines along pan, at most `step_deg` apart, and runs from the upper left down and back the same way. A
    `spiral` runs from the centre out to `radius_deg` and back, with `step_deg` between its turns.
    """

    type: Literal["scan"] = "scan"
    pattern: Literal["raster", "spiral"] = Field(
        description="Scan pattern: `raster`, lines along pan, or `spiral`, outward from the centre."
    )
    pan_deg: Number = Field(default=0.0, description="Pan angle of the centre [deg].")
    tilt_deg: Number = Field(default=0.0, description="Tilt angle of the centre [deg].")
    half_width_deg: Positive | None = Field(default=None, description="Half extent of a raster in pan [deg].")
    half_height_deg: NotNegative | None = Field(default=None, description="Half extent of a raster in tilt [deg].")
    radius_deg: Positive | None = Field(default=None, description="Outer radius of a spiral [deg].")
    step_deg: Positive = Field(
        description="Greatest distance between lines of a raster, or between turns of a spiral [deg]."
    )
    rate_deg_s: Positive = Field(description="Angular rate along the pattern [deg/s].")

    @model_validator(mode="after")
    def _check_size(self) -> Self:
        box = (self.half_width_deg, self.half_height_deg)
        if self.pattern == "raster" and (None in box or self.radius_deg is not None):
            raise ValueError("a raster has a size of half_width_deg and half_height_deg; give those two only")
        if self.pattern == "spiral" and (self.radius_deg is None or box != (None, None)):
            raise ValueError("a spiral has a size of radius_deg; give that only")
        if max(self.half_height_deg or 0.0, self.radius_deg or 0.0) > 1e5 * self.step_deg:
            raise ValueError("step_deg makes over 100,000 lines or turns; make it larger")
        return self

    def demand(self, time_s: np.ndarray) -> np.ndarray:
        """Compute the demand along the pattern.

        Parameters
        ----------
        time_s : instants (time,) [s]

        Returns
        -------
        pan and tilt (time, 2) [rad]
        """
        way = np.abs(np.asarray(time_s, dtype=float)) * self.rate_deg_s
        offset = self._trace_raster(way) if self.pattern == "raster" else self._trace_spiral(way)
        angles: np.ndarray = (np.array([self.pan_deg, self.tilt_deg]) + offset) * units.DEG
        return angles

    def _trace_raster(self, way: np.ndarray) -> np.ndarray:
        width, height = self.half_width_deg or 0.0, self.half_height_deg or 0.0
        lines = 1 + math.ceil(2.0 * height / self.step_deg - 1e-9)
        tilt = np.repeat(np.linspace(height, -height, lines) if lines > 1 else [0.0], 2)
        pan = np.tile([width, -width, -width, width], (lines + 1) // 2)[: 2 * lines]
        corners = np.append(0.0, np.cumsum(np.abs(np.diff(pan)) + np.abs(np.diff(tilt))))
        folded = _fold(way, float(corners[-1]))
        return np.stack([np.interp(folded, corners, pan), np.interp(folded, corners, tilt)], axis=-1)

    def _trace_spiral(self, way: np.ndarray) -> np.ndarray:
        """Invert the arc length b / 2 (theta sqrt(1 + theta^2) + asinh theta) of Archimedes' spiral r = b theta."""
        growth = self.step_deg / (2.0 * math.pi)
        last = (self.radius_deg or 0.0) / growth
        length = 0.5 * growth * (last * math.hypot(1.0, last) + math.asinh(last))
        scaled = 2.0 * _fold(way, length) / growth
        theta = scaled / np.sqrt(4.0 + scaled)
        for _ in range(6):  # Newton: the start is exact at both ends, and four steps already give 1e-15
            root = np.sqrt(1.0 + theta * theta)
            theta = theta - (theta * root + np.arcsinh(theta) - scaled) / (2.0 * root)
        offset: np.ndarray = growth * np.stack([theta * np.cos(theta), theta * np.sin(theta)], axis=-1)
        return offset


def _fold(way: np.ndarray, length: float) -> np.ndarray:
    """Fold a distance into [0, length], forward and backward."""
    around = np.mod(way, 2.0 * length)
    folded: np.ndarray = np.minimum(around, 2.0 * length - around)
    return folded


def find_pan_tilt(direction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find pan in (-pi, pi] and tilt [rad] that point the boresight along `direction` (…, 3), any length, mount axes.

    >>> [angle.round(6) for angle in find_pan_tilt(np.array([0.0, 2.0, 0.0]))]
    [np.float64(1.570796), np.float64(0.0)]
    """
    x, y, z = np.moveaxis(np.asarray(direction, dtype=float), -1, 0)
    return np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))


class DemandCurve:
    """A demand of pan and tilt [rad] that follows directions: cubics between knots 0.05 s apart, from t = 0.

    The cubics are Hermite's with central differences as slopes (Catmull-Rom). For an angle f the error is below
    0.017 h^3 max|f'''|, which is 5 nrad at a flyby of 6 deg/s. The last cubic continues past the last knot, for at most
    one interval. Pan is unwrapped from t = 0.

    Knots are computed in fixed blocks of 4096, of which two are kept. A run of any length therefore takes constant
    memory, and the result at one instant has the same bits whichever others are requested.

    Parameters
    ----------
    directions : ``directions(time_s (knot,)) -> (knot, 3)`` from the PTU to its target, mount axes, any length
    end_s : last instant [s] at which `directions` may be evaluated
    """

    KNOT_S = 0.05
    BLOCK = 4096

    def __init__(self, directions: Callable[[np.ndarray], np.ndarray], end_s: float) -> None:
        self._directions = directions
        self._last = max(0, math.floor(end_s / self.KNOT_S + 1e-9))
        self._pan_at_block = [0.0]  # unwrapped pan at the first knot of each block reached; 0 does not shift the first
        self._blocks: dict[int, np.ndarray] = {}

    def __call__(self, time_s: np.ndarray) -> np.ndarray:
        """Return pan and tilt (time, 2) [rad] at `time_s` (time,) [s]."""
        place = np.asarray(time_s, dtype=float) / self.KNOT_S
        knot = np.minimum(np.maximum(np.floor(place), 0.0), max(0, self._last - 1)).astype(int)
        s = (place - knot)[:, None]
        block_of = knot // self.BLOCK
        blocks = range(int(block_of.min()), int(block_of.max()) + 1) if len(place) else ()
        if len(blocks) == 1:
            return _cubic(self._block(blocks[0])[knot - blocks[0] * self.BLOCK], s)
        angles = np.empty((len(place), 2))
        for block in blocks:
            rows = np.flatnonzero(block_of == block)
            if len(rows):
                angles[rows] = _cubic(self._block(block)[knot[rows] - block * self.BLOCK], s[rows])
        return angles

    def _block(self, block: int) -> np.ndarray:
        """Return the coefficients (knot, 4, 2) of the cubics of pan and tilt that begin at the knots of a block."""
        for earlier in range(len(self._pan_at_block) - 1, block):
            self._block(earlier)
        if block not in self._blocks:
            first, end = block * self.BLOCK, min((block + 1) * self.BLOCK, self._last)
            low, high = max(first - 1, 0), min(end + 1, self._last)
            pan, tilt = find_pan_tilt(self._directions(np.arange(low, high + 1) * self.KNOT_S))
            pan = np.unwrap(pan)
            full = 2.0 * math.pi
            pan = pan + full * round((self._pan_at_block[block] - float(pan[first - low])) / full)
            if len(self._pan_at_block) == block + 1:
                self._pan_at_block.append(float(pan[end - low]))
            values = np.stack([pan, tilt], axis=-1)
            if len(values) == 1:  # a run shorter than one interval has a constant demand
                values = np.repeat(values, 2, axis=0)
            slopes = np.gradient(values, axis=0, edge_order=2 if len(values) > 2 else 1)
            while len(self._blocks) > 1:
                del self._blocks[next(iter(self._blocks))]
            self._blocks[block] = _cubics(values[first - low :], slopes[first - low :])
        return self._blocks[block]


def _cubics(values: np.ndarray, slopes: np.ndarray) -> np.ndarray:
    """Compute the coefficients (interval, 4, 2) of Hermite's cubics from values and slopes (knot, 2)."""
    begin, end, rise = slopes[:-1], slopes[1:], values[1:] - values[:-1]
    return np.stack([values[:-1], begin, 3.0 * rise - 2.0 * begin - end, begin + end - 2.0 * rise], axis=1)


def _cubic(coefficients: np.ndarray, s: np.ndarray) -> np.ndarray:
    """Evaluate cubics (time, 4, 2) at s (time, 1)."""
    a, b, c, d = coefficients[:, 0], coefficients[:, 1], coefficients[:, 2], coefficients[:, 3]
    value: np.ndarray = a + s * (b + s * (c + s * d))
    return value

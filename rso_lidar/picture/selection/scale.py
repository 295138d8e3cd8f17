"""Colour limits shared by all pictures of a sequence, and the same limits in words."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rso_lidar.picture.selection.sequence import Thumbnail
from rso_lidar.picture.style.colour_maps import INTENSITY_RAMP, RANGE_RAMP, apply_ramp
from rso_lidar.picture.style.palette import NO_LIGHT, NO_RETURN

RELATIVE_BELOW = 0.25  # ratio of a frame's span to the sequence's, below which colours are relative to each median
LOG_ABOVE = 8.0  # ratio of brightest frame to faintest, or glints to median, above which the scale is logarithmic


ROUND = (1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)


def nice_up(value: float) -> float:
    """Return the smallest round number, one of `ROUND` times a power of ten, that is at least `value`.

    >>> [nice_up(v) for v in (0.13, 2.1, 7.0)]
    [0.15, 2.5, 8.0]
    """
    if not value > 0:
        return 1.0
    power = math.floor(math.log10(value) + 1e-12)
    for step in ROUND:
        if step * 10.0**power >= value * (1 - 1e-9):
            return float(f"{step * 10.0**power:.6g}")
    return float(10.0 ** (power + 1))


def nice_down(value: float) -> float:
    """Return the greatest of 1, 2 and 5 times a power of ten that is at most a positive `value`.

    >>> [nice_down(v) for v in (0.13, 2.1, 7.0)]
    [0.1, 2.0, 5.0]
    """
    power = math.floor(math.log10(value) + 1e-12)
    step = max(step for step in (1.0, 2.0, 5.0) if step * 10.0**power <= value * (1 + 1e-9))
    return float(f"{step * 10.0**power:.6g}")


@dataclass(frozen=True)
class Scale:
    """Colour limits of a sequence: range [m], about each frame's median if `relative`, and intensity [counts]."""

    relative: bool
    low_m: float
    high_m: float
    low_counts: float
    high_counts: float
    logarithmic: bool

    @staticmethod
    def of(thumbnails: Sequence[Thumbnail]) -> Scale:
        """Find the limits that suit all of some thumbnails.

        Colours are relative where the ranges within a frame span little against the ranges over the sequence, as in an
        approach; else absolute. Where no frame has a return from a target, all returns count.
        """
        any_target = any(thumbnail.on_target.any() for thumbnail in thumbnails)
        masks = [thumbnail.on_target if any_target else np.isfinite(thumbnail.range_m) for thumbnail in thumbnails]
        ranges_m = [thumbnail.range_m[mask] for thumbnail, mask in zip(thumbnails, masks, strict=True)]
        ranges_m = [seen for seen in ranges_m if seen.size]
        counts = [thumbnail.intensity_counts[mask] for thumbnail, mask in zip(thumbnails, masks, strict=True)]
        low_counts, high_counts, logarithmic = count_limits([seen for seen in counts if seen.size])
        if not ranges_m:
            return Scale(True, -1.0, 1.0, low_counts, high_counts, logarithmic)
        medians_m = np.array([np.median(seen) for seen in ranges_m])
        half_m = max(
            float(np.percentile(np.abs(seen - middle), 92)) for seen, middle in zip(ranges_m, medians_m, strict=True)
        )
        if any_target and 2 * half_m < RELATIVE_BELOW * float(np.ptp(medians_m)):
            half_m = nice_up(half_m)
            return Scale(True, -half_m, half_m, low_counts, high_counts, logarithmic)
        low_m = float(min(np.percentile(seen, 1) for seen in ranges_m))
        high_m = float(max(np.percentile(seen, 99) for seen in ranges_m))
        step = nice_up(max(high_m - low_m, 0.1)) / 10
        low_m, high_m = math.floor(low_m / step) * step, math.ceil(high_m / step) * step
        return Scale(False, low_m, high_m, low_counts, high_counts, logarithmic)

    def range_rgb(self, range_m: np.ndarray, median_m: float) -> np.ndarray:
        """Return the colours (…, rgb) of ranges [m] in a frame with the given median [m]."""
        zero_m = (median_m if math.isfinite(median_m) else 0.0) if self.relative else 0.0
        return apply_ramp((range_m - zero_m - self.low_m) / (self.high_m - self.low_m), RANGE_RAMP, NO_RETURN)

    def intensity_rgb(self, counts: np.ndarray) -> np.ndarray:
        """Return the greys (…, rgb) of intensities [counts]; no return is black."""
        return apply_ramp(self.intensity_fraction(counts), INTENSITY_RAMP, NO_LIGHT)

    def intensity_fraction(self, counts: np.ndarray) -> np.ndarray:
        """Return intensities [counts] as fractions: 0 to 1 between the limits, NaN where nothing came back."""
        value = np.where(counts > 0, counts, np.nan).astype(float)
        if self.logarithmic:
            fraction: np.ndarray = np.log(value / self.low_counts) / math.log(self.high_counts / self.low_counts)
            return fraction
        return (value - self.low_counts) / (self.high_counts - self.low_counts)

    @property
    def range_words(self) -> tuple[str, str, str]:
        """Meaning of the range colours, and the words at their low and high end."""
        if self.relative:
            return "Range minus the frame's median", f"≤ −{-self.low_m:g} m", f"≥ +{self.high_m:g} m"
        return "Range", f"{self.low_m:,.6g} m", f"{self.high_m:,.6g} m"

    @property
    def intensity_words(self) -> tuple[str, str, str]:
        """Meaning of the greys, and the words at their low and high end."""
        kind = "Intensity, logarithmic" if self.logarithmic else "Intensity"
        return kind, f"{self.low_counts:,.0f}", f"{self.high_counts:,.0f} counts"


def count_limits(seen: list[np.ndarray]) -> tuple[float, float, bool]:
    """Find the low and high limit [counts], and whether the span needs a logarithm."""
    if not seen:
        return 0.0, 1.0, False
    high = max(float(np.percentile(counts, 99.5)) for counts in seen)
    low = min(float(np.percentile(counts, 2)) for counts in seen)
    bright = [float(np.percentile(counts, 90)) for counts in seen]
    middle = float(np.median([np.median(counts) for counts in seen]))
    if max(bright) > LOG_ABOVE * max(min(bright), 1.0) or high > LOG_ABOVE * max(middle, 1.0):
        low = max(math.floor(low), 1.0)
        return low, max(math.ceil(high), 2 * low), True
    return 0.0, max(math.ceil(high), 1.0), False

"""Colour limits shared by all pictures of a sequence, and the same limits in words."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rso_lidar.picture.selection.sequence import Thumbnail, find_target_returns
from rso_lidar.picture.style.colour_maps import INTENSITY_RAMP, RANGE_RAMP, apply_ramp
from rso_lidar.picture.style.figures import round_up
from rso_lidar.picture.style.palette import NO_LIGHT, NO_RETURN
from rso_lidar.records import Frame

RELATIVE_BELOW = 0.25  # ratio of a frame's span to the sequence's, below which colours are relative to each median
LOG_ABOVE = 8.0  # ratio of brightest frame to faintest, or glints to median, above which the scale is logarithmic


@dataclass(frozen=True)
class Scale:
    """Colour limits of a sequence: range [m], about each frame's median if `relative`, and intensity [counts].

    Parameters
    ----------
    relative : whether colours show the range minus the median of its frame
    low_m, high_m : range, or range minus median, at the ends of the ramp [m]
    low_counts, high_counts : intensity at the ends of the ramp [counts]
    logarithmic : whether greys follow the logarithm of the intensity
    """

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

        Parameters
        ----------
        thumbnails : excerpts of the frames that share the limits, in the order of time

        Returns
        -------
        Scale
            Limits rounded outward; those of intensity leave out the faintest 2 % and the brightest 0.5 % of returns.
        """
        any_target = any(thumbnail.on_target.any() for thumbnail in thumbnails)
        masks = [thumbnail.on_target if any_target else np.isfinite(thumbnail.range_m) for thumbnail in thumbnails]
        ranges_m = [thumbnail.range_m[mask] for thumbnail, mask in zip(thumbnails, masks, strict=True)]
        ranges_m = [seen for seen in ranges_m if seen.size]
        counts = [thumbnail.intensity_counts[mask] for thumbnail, mask in zip(thumbnails, masks, strict=True)]
        low_counts, high_counts, logarithmic = _limit_counts([seen for seen in counts if seen.size])
        if not ranges_m:
            return Scale(True, -1.0, 1.0, low_counts, high_counts, logarithmic)
        medians_m = np.array([np.median(seen) for seen in ranges_m])
        half_m = max(
            float(np.percentile(np.abs(seen - middle), 92)) for seen, middle in zip(ranges_m, medians_m, strict=True)
        )
        if any_target and 2 * half_m < RELATIVE_BELOW * float(np.ptp(medians_m)):
            half_m = round_up(half_m)
            return Scale(True, -half_m, half_m, low_counts, high_counts, logarithmic)
        low_m = float(min(np.percentile(seen, 1) for seen in ranges_m))
        high_m = float(max(np.percentile(seen, 99) for seen in ranges_m))
        step = round_up(max(high_m - low_m, 0.1)) / 10
        low_m, high_m = math.floor(low_m / step) * step, math.ceil(high_m / step) * step
        return Scale(False, low_m, high_m, low_counts, high_counts, logarithmic)

    @staticmethod
    def of_frames(*frames: Frame) -> Scale:
        """Find the limits of single frames, drawn side by side or alone, with ranges as they are.

        Where no frame has a return from a target, all returns count.

        Parameters
        ----------
        *frames : frames that share the limits, at least one

        Returns
        -------
        Scale
            Range from the 1st to the 99th percentile of each frame, over all of them, at least 0.1 m apart; intensity to
            the brightest pixel, or in logarithms where a few glints outshine the rest.
        """
        masks = [find_target_returns(frame) for frame in frames]
        if not any(mask.any() for mask in masks):
            masks = [np.asarray(frame.valid) for frame in frames]
        lit = [(frame, mask) for frame, mask in zip(frames, masks, strict=True) if mask.any()]
        ends_m = [np.percentile(frame.range_m[mask], [1, 99]) for frame, mask in lit]
        low_m, high_m = min((end[0] for end in ends_m), default=0.0), max((end[1] for end in ends_m), default=1.0)
        if high_m - low_m < 0.1:  # a flat target: its noise does not fill the ramp
            low_m, high_m = low_m - 0.05, high_m + 0.05
        low, high, logarithmic = _limit_counts([frame.intensity_counts[mask].astype(float) for frame, mask in lit])
        if not logarithmic:
            high = max(1.0, *(float(frame.intensity_counts.max()) for frame in frames))
        return Scale(False, float(low_m), float(high_m), low, high, logarithmic)

    def range_rgb(self, range_m: np.ndarray, median_m: float) -> np.ndarray:
        """Return the colours (…, rgb), as bytes, of ranges in one frame.

        Parameters
        ----------
        range_m : (…) [m], NaN for no return
        median_m : median range of the frame [m], from which relative colours count; NaN counts as 0
        """
        zero_m = (median_m if math.isfinite(median_m) else 0.0) if self.relative else 0.0
        return apply_ramp((range_m - zero_m - self.low_m) / (self.high_m - self.low_m), RANGE_RAMP, NO_RETURN)

    def intensity_rgb(self, counts: np.ndarray) -> np.ndarray:
        """Return the greys (…, rgb), as bytes, of intensities; no return is black.

        Parameters
        ----------
        counts : (…) [counts], 0 for no return
        """
        return apply_ramp(self.intensity_fraction(counts), INTENSITY_RAMP, NO_LIGHT)

    def intensity_fraction(self, counts: np.ndarray) -> np.ndarray:
        """Return intensities as fractions: 0 to 1 between the limits, NaN where nothing came back.

        Parameters
        ----------
        counts : (…) [counts], 0 for no return
        """
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


def _limit_counts(seen: list[np.ndarray]) -> tuple[float, float, bool]:
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

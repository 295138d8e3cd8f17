"""Two frames compared pixel by pixel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rso_lidar.errors import RecordingError
from rso_lidar.records import Frame

_NORMAL_MAD = 1.4826  # standard deviation of a normal distribution over its median absolute deviation, 1 / 0.67449


@dataclass(frozen=True)
class FrameDifference:
    """Statistics of the pixels of two frames, second minus first; NaN where no pixel is reported by both.

    `robust_range_m` is the standard deviation of the range that the median absolute deviation implies for normal noise:
    pixels that see the edge of a part in one frame only do not dominate it.
    """

    both: int
    first_only: int
    second_only: int
    mean_range_m: float
    rms_range_m: float
    median_range_m: float
    robust_range_m: float
    mean_counts: float
    std_counts: float

    def describe(self) -> str:
        """Return the statistics in one to three lines."""
        lines = [
            f"Reported by both {self.both:,}, by A only {self.first_only:,}, by B only {self.second_only:,} pixels."
        ]
        if self.both:
            lines += [
                f"Range: mean {self.mean_range_m:+.3f} m, rms {self.rms_range_m:.3f} m; "
                f"median {self.median_range_m:+.3f} m, robust standard deviation {self.robust_range_m:.3f} m.",
                f"Intensity: mean {self.mean_counts:+.1f}, standard deviation {self.std_counts:.1f} counts.",
            ]
        return "\n".join(lines)


def compare_frames(first: Frame, second: Frame) -> FrameDifference:
    """Compare the measured range and intensity of two frames, pixel by pixel.

    Parameters
    ----------
    first, second : of scenarios or recordings

    Returns
    -------
    FrameDifference

    Raises
    ------
    RecordingError
        If they have different numbers of pixels.
    """
    if first.range_m.shape != second.range_m.shape:
        sizes = (f"{rows} x {cols}" for rows, cols in (first.range_m.shape, second.range_m.shape))
        raise RecordingError(f"frames: {' and '.join(sizes)} pixels cannot be compared; fly both with one detector")
    both = first.valid & second.valid
    range_m = np.asarray(second.range_m, float)[both] - first.range_m[both]
    counts = np.asarray(second.intensity_counts, float)[both] - first.intensity_counts[both]
    numbers = [np.nan] * 6
    if range_m.size:
        median_m = np.median(range_m)
        robust_m = _NORMAL_MAD * np.median(np.abs(range_m - median_m))
        numbers = [range_m.mean(), np.sqrt(np.mean(range_m**2)), median_m, robust_m, counts.mean(), counts.std()]
    only = (int((first.valid & ~second.valid).sum()), int((second.valid & ~first.valid).sum()))
    return FrameDifference(int(both.sum()), *only, *(float(number) for number in numbers))

"""Report of each pixel's returns over the focal plane."""

import numpy as np

from rso_lidar.kernels import kernel, packed
from rso_lidar.records import Reading

FIRST, STRONGEST, LAST = range(3)  # of the returns, is reported as range and intensity
_CHOICES = {"first": FIRST, "strongest": STRONGEST, "last": LAST}


def report_returns(
    shape: tuple[int, int],
    pixel: np.ndarray,
    range_m: np.ndarray,
    amplitude: np.ndarray,
    clipped: np.ndarray,
    *,
    returns: str,
    max_returns: int,
    full_scale_counts: int,
) -> Reading:
    """Return the reading of a focal plane; one of a pixel's returns is its range and intensity.

    Parameters
    ----------
    shape : rows and columns
    pixel : (trace) number of the pixel
    range_m, amplitude : (trace, return) [m] and [counts], near to far, NaN and 0 where there are fewer
    clipped : (trace, sample) whether a sample is at the rail
    returns : which one is reported: first, strongest or last
    max_returns : how many are listed beside it; 1 lists none
    """
    n_pixels = shape[0] * shape[1]
    most = max_returns if max_returns > 1 else 0
    one_m, one_counts = np.full(n_pixels, np.nan, np.float32), np.zeros(n_pixels, np.uint16)
    saturated = np.zeros(n_pixels, np.uint8)
    several_m, several_counts = np.full((n_pixels, most), np.nan, np.float32), np.zeros((n_pixels, most), np.uint16)
    report_traces(
        packed(pixel, np.int64),
        packed(range_m, np.float64),
        packed(amplitude, np.float64),
        packed(clipped, np.bool_),
        _CHOICES[returns],
        float(full_scale_counts),
        one_m,
        one_counts,
        saturated,
        several_m,
        several_counts,
    )
    several = (several_m.reshape(*shape, most), several_counts.reshape(*shape, most)) if most else ()
    return Reading(one_m.reshape(shape), one_counts.reshape(shape), saturated.reshape(shape), *several)


@kernel
def report_traces(
    pixel: np.ndarray,
    range_m: np.ndarray,
    amplitude: np.ndarray,
    clipped: np.ndarray,
    choice: int,
    full_scale: float,
    one_m: np.ndarray,
    one_counts: np.ndarray,
    saturated: np.ndarray,
    several_m: np.ndarray,
    several_counts: np.ndarray,
) -> None:
    """Fill the report of each pixel: one return as range and intensity, and lists as many as `several` can hold.

    What is filled holds NaN and 0 before.

    Parameters
    ----------
    pixel : (trace) number of the pixel
    range_m, amplitude : (trace, return), near to far
    clipped : (trace, sample) whether a sample is at the rail
    full_scale : greatest amplitude [counts]
    one_m, one_counts, saturated : (pixel) filled
    several_m, several_counts : (pixel, return) filled
    """
    for trace in range(range_m.shape[0]):
        at, chosen = pixel[trace], -1
        for k in range(range_m.shape[1]):
            if not np.isfinite(range_m[trace, k]):
                continue
            better = choice == LAST or (choice == STRONGEST and amplitude[trace, k] > amplitude[trace, max(chosen, 0)])
            chosen = k if chosen < 0 or better else chosen
            if k < several_m.shape[1]:
                several_m[at, k] = range_m[trace, k]
                several_counts[at, k] = min(max(np.rint(amplitude[trace, k]), 1.0), full_scale)
        if chosen < 0:
            continue
        one_m[at] = range_m[trace, chosen]
        counts = min(max(np.rint(amplitude[trace, chosen]), 1.0), full_scale)
        one_counts[at] = counts
        some = counts >= full_scale
        for sample in range(clipped.shape[1]):
            some = some or clipped[trace, sample]
        saturated[at] = some

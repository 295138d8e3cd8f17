"""Places of clipped pulses in NumPy and SciPy: the oracle of `rso_lidar.detector.ranging.clipped_pulse.place_by_edges`."""

import numpy as np
from scipy import optimize


def place_by_edges(samples, clipped, traces, peak, sigma, rise, fall, per_neper, place):
    """Return the places (trace) [samples]: for `traces` from the edges of their plateaus, else unchanged."""
    depth = np.arange(len(rise)) / per_neper  # nepers below the peak
    place = np.array(place, float)

    def rising(level):
        return np.interp(-level, depth, rise)

    def falling(level):
        return np.interp(-level, depth, fall)

    for trace in traces:
        values, on_rail = np.asarray(samples[trace], float), clipped[trace]
        low = high = peak[trace]
        while low > 0 and on_rail[low - 1]:
            low -= 1
        while high < len(values) - 1 and on_rail[high + 1]:
            high += 1
        if low == 0:
            continue
        level = values[peak[trace]]
        before = np.log(np.clip(values[low - 1], 4.0 * sigma, level) / level)
        heights = np.linspace(0.02, 23.0, 256)  # of the peak over the level, in nepers
        first = low - 1 - rising(before - heights)
        if high < len(values) - 1:
            after = np.log(np.clip(values[high + 1], 4.0 * sigma, level) / level)

            def apart(height, before=before, after=after, low=low, high=high):
                return (high + 1 - falling(after - height)) - (low - 1 - rising(before - height))

            ends = apart(heights[0]), apart(heights[-1])
            height = heights[0] if ends[0] <= 0 else heights[-1] if ends[1] >= 0 else None
            height = optimize.brentq(apart, heights[0], heights[-1]) if height is None else height
            place[trace] = low - 1 - rising(before - height) + 0.5 * apart(height)
            continue
        seen_end = (first + falling(-heights) >= len(values) - 1) & (low >= 2)
        expected = level * np.exp(np.minimum(heights - np.interp(first - low + 2, -rise, depth), 0.0))
        variance = sigma**2 + 1.0 / 12.0 + (0.02 * expected) ** 2
        weight = seen_end * 0.5 ** np.log10(np.exp(heights))  # stronger returns are rarer
        weight = weight * np.exp(-0.5 * (values[low - 2] - expected) ** 2 / variance)
        place[trace] = (weight * first).sum() / weight.sum() if weight.sum() > 0.0 else first[-1]
    return place

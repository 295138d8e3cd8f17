"""Leaks: numbers that reveal the class, or the presence of a target, without its shape.

A column of numbers leaks if its distribution in one class differs from that in all others. Two tests look for this: a
two-sample Kolmogorov-Smirnov test, and a test of both ends of the range of the class. The second computes how probable it
is that no sample of the class lies beyond its extreme value, given the share of the other samples beyond it. Both are
corrected for the number of tests.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

_CHANCE = 1e-3  # of a false alarm in a whole check
_LEAST_DIFFERENCE = 0.15  # greatest difference of two cumulative distributions that training can ignore; assumed
_LEAST_SAMPLES = 8  # of a class; assumed: fewer prove no difference at this probability of a false alarm
_CENTRED_PX = 2.0  # from the centre of the image; assumed
_CENTRED_SHARE = 0.9  # of the frames with a target; assumed


def find_leaks(columns: Mapping[str, np.ndarray], group: np.ndarray, names: Sequence[str]) -> list[str]:
    """Find columns whose values reveal the group.

    Parameters
    ----------
    columns : numbers (sample) by name, NaN where there is none
    group : (sample) index of the group, such as the class

    Returns
    -------
    One line for each leak.
    """
    from scipy.stats import ks_2samp

    lines = []
    tests = max(1, 3 * len(columns) * len(names))
    for column, values in columns.items():
        known = np.isfinite(values)
        for k, name in enumerate(names):
            inside, outside = values[known & (group == k)], values[known & (group != k)]
            if min(len(inside), len(outside)) < _LEAST_SAMPLES:
                continue
            test = ks_2samp(inside, outside)
            if test.pvalue * tests < _CHANCE and test.statistic > _LEAST_DIFFERENCE:
                lines.append(
                    f"{column} tells the class: its distribution in '{name}' differs from that in the others (Kolmogorov-"
                    f"Smirnov {test.statistic:.2f}, median {np.median(inside):.4g} against {np.median(outside):.4g})"
                )
                continue
            for end, beyond in (("begins", outside < inside.min()), ("ends", outside > inside.max())):
                if len(inside) * np.log1p(-beyond.mean() * (1.0 - 1e-12)) < np.log(_CHANCE / tests):
                    at = inside.min() if end == "begins" else inside.max()
                    lines.append(
                        f"{column} tells the class: in '{name}' it {end} at {at:.4g}, and {beyond.mean():.0%} of the others "
                        "are beyond"
                    )
    return lines


def find_constants(offset_px: np.ndarray, reporting: np.ndarray) -> list[str]:
    """Find a target that is always centred, and frames without returns.

    Parameters
    ----------
    offset_px : (frame) distance of the target's origin from the centre of the image [px], NaN without a target
    reporting : (frame) number of pixels that reported the target, negative without a target

    Returns
    -------
    One line for each finding.
    """
    lines = []
    known = offset_px[np.isfinite(offset_px)]
    if len(known) >= _LEAST_SAMPLES and np.mean(known < _CENTRED_PX) > _CENTRED_SHARE:
        lines.append(
            f"the target is centred in {np.mean(known < _CENTRED_PX):.0%} of the frames, and a network can learn that; "
            "widen view.offset_fraction, or, with a PTU, vary its pointing"
        )
    shown = reporting[reporting >= 0]
    if len(shown) and np.mean(shown == 0) > 0.0:
        lines.append(f"{np.mean(shown == 0):.1%} of the frames with a target have no return from it")
    return lines

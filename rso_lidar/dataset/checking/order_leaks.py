"""Leaks of the order: where the number or the place of a sample in the files tells its class.

A rule is found with one half of the samples: the most frequent class for each number modulo n, for each block of
consecutive samples, or after each class. It is then tried on the other half. If the order is random, it is right there
with the share of the most frequent class at most, and the binomial distribution bounds the number of its hits.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

_CHANCE = 1e-3  # of a false alarm in a whole check, over all rules and orders
_MOST_PERIOD = 64  # of the numbers modulo n that are tried; assumed
_BLOCKS = (2, 4, 8, 16, 32, 64, 128)
_LEAST_IN_CELL = 4  # samples for each value of a rule, on average; fewer find no rule


class _RuleTest(NamedTuple):
    """A rule that was tried: what it is, its hits among the samples that it was not found with, and their number."""

    rule: str
    hits: int
    tried: int


def find_order_leaks(orders: Mapping[str, np.ndarray], group: np.ndarray) -> list[str]:
    """Find orders of samples from which their class can be predicted.

    Parameters
    ----------
    orders : whole numbers (sample) by name, such as places in a file; -1 for samples that are not in it
    group : (sample) class of each sample, from 0

    Returns
    -------
    One line for each leak, with the rule that is the least probable by chance.
    """
    from scipy.stats import binom

    trials = {name: list(_try_rules(values[values >= 0], group[values >= 0])) for name, values in orders.items()}
    tests = sum(map(len, trials.values()))
    lines = []
    for name, tried in trials.items():
        if not tried:
            continue
        counts = np.bincount(group[orders[name] >= 0])
        guess = float(counts.max() / counts.sum())
        chances = [float(binom.sf(trial.hits - 1, trial.tried, guess)) for trial in tried]
        best = int(np.argmin(chances))
        if chances[best] * tests < _CHANCE:
            rule, hits, count = tried[best]
            lines.append(
                f"{name} tells the class: {rule} predicts it in {hits / count:.0%} of {count:,} samples, and the most "
                f"frequent class is right in {guess:.0%}; shuffle the samples before they are numbered"
            )
    return lines


def _try_rules(order: np.ndarray, group: np.ndarray) -> Iterator[_RuleTest]:
    """Yield the trials of all rules on one order: whole numbers and classes (sample)."""
    count = len(order)
    if not count or len(np.unique(group)) < 2:
        return
    sequence = np.argsort(order, kind="stable")
    order, group = order[sequence], group[sequence]
    is_found_with = np.random.default_rng(0).permutation(count) % 2 == 0  # the halves depend on no class
    for period in range(2, min(_MOST_PERIOD, count // _LEAST_IN_CELL) + 1):
        yield _try_rule(f"its number modulo {period}", order % period, group, is_found_with)
    for blocks in _BLOCKS:
        if blocks * _LEAST_IN_CELL <= count:
            cell = np.arange(count) * blocks // count
            yield _try_rule(f"its place in one of {blocks} blocks", cell, group, is_found_with)
    pairs = count // 2  # without a common sample, so that they are independent
    if pairs >= _LEAST_IN_CELL:
        before, after = group[: 2 * pairs : 2], group[1 : 2 * pairs : 2]
        yield _try_rule("the class of the sample before it", before, after, is_found_with[:pairs])


def _try_rule(rule: str, cell: np.ndarray, group: np.ndarray, is_found_with: np.ndarray) -> _RuleTest:
    """Find the most frequent class of each cell with some samples, and count how often it is right for the others.

    Parameters
    ----------
    rule : what the cells are, such as "its number modulo 7"
    cell, group : (sample) numbers of the cells, and classes
    is_found_with : (sample) samples that the rule is found with
    """
    classes = int(group.max()) + 1
    known = np.bincount(cell[is_found_with] * classes + group[is_found_with], minlength=(int(cell.max()) + 1) * classes)
    predicted = known.reshape(-1, classes).argmax(axis=1)
    others = ~is_found_with
    return _RuleTest(rule, int((predicted[cell[others]] == group[others]).sum()), int(others.sum()))

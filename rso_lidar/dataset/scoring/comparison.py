"""Two algorithms on the same frames: which figures of merit got better or worse, and which changes are chance.

The same encounters are drawn for both, so that what is hard for both cancels. A figure of merit is worse if the bootstrap
says so, and for a share of frames also the exact test in which the two answers of an encounter change places at random,
which is McNemar's exact test where an encounter has one frame (McNemar, *Psychometrika* 12, 153, 1947). Holm's correction
(*Scand. J. Statist.* 6, 65, 1979) keeps the chance of any wrong "worse" among all figures of merit at the level.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from rso_lidar.confidence_intervals import percentile_interval
from rso_lidar.dataset.metrics.merits import HIGHER, FigureOfMerit
from rso_lidar.dataset.metrics.resampling import FEWEST_ENCOUNTERS
from rso_lidar.dataset.metrics.weighted_statistics import Ratios, Statistic
from rso_lidar.dataset.scoring.scorecard import Scorecard
from rso_lidar.errors import DatasetError, did_you_mean

BETTER, WORSE, SAME, UNKNOWN = "better", "worse", "no difference", "too few encounters"
_MOST_EXACT = 4000  # answers that differ, up to which the exact distribution is computed
_RUN_KEY = 17


@dataclass(frozen=True)
class Change:
    """Change of one figure of merit.

    `difference` is new minus old, `low` and `high` its interval at twice the level, `p_worse` and `p_better` the
    chances of so large a loss or gain without and with Holm's correction, and `margin` the change that does not matter.
    """

    name: str
    unit: str
    better: str
    old: float
    new: float
    difference: float
    low: float
    high: float
    p_worse: float
    p_better: float
    margin: float
    verdict: str
    p_worse_corrected: float = float("nan")
    p_better_corrected: float = float("nan")


@dataclass(frozen=True, eq=False)
class Comparison:
    """Comparison of two scorecards: the changes, and the frames whose predicted class became wrong or right.

    `LEVEL` is the default of `level`, the probability of any wrong "worse".
    """

    LEVEL: ClassVar[float] = 0.05

    new: Scorecard
    old: Scorecard
    level: float
    changes: tuple[Change, ...]
    broken: np.ndarray
    repaired: np.ndarray

    @property
    def is_worse(self) -> bool:
        """Whether any figure of merit got worse."""
        return any(change.verdict == WORSE for change in self.changes)


def compare(
    new: Scorecard, old: Scorecard, margins: Mapping[str, float] | None = None, level: float = Comparison.LEVEL
) -> Comparison:
    """Compare two algorithms on the same frames.

    Parameters
    ----------
    new, old : scorecards on the same split, with the same number of replicates
    margins : change of a figure of merit that does not matter, by name, in its unit; 0 by default
    level : probability of any wrong "worse", and of any wrong "better"

    Returns
    -------
    Comparison

    Raises
    ------
    DatasetError
        If the frames differ, if `old` predicts what `new` does not, or a margin is of no figure of merit that is compared.
    """
    margins = dict(margins or {})
    if not np.array_equal(_list_keys(new), _list_keys(old)) or new.replicates != old.replicates:
        raise DatasetError("compare: the two were scored on other frames; score both on one split of one dataset")
    is_single = len(new.runs) == len(old.runs) == 1
    places = {merit.name: k for k, merit in enumerate(new.runs[0].merits)}
    compared = [(k, merit) for k, merit in enumerate(old.runs[0].merits) if merit.is_compared]
    lost = [merit.name for _, merit in compared if merit.name not in places]
    if lost:
        raise DatasetError(
            f"{new.runs[0].name}: does not predict {', '.join(lost)}, which {old.runs[0].name} does; add it, or take it out "
            "of both"
        )
    names = [merit.name for _, merit in compared]
    for name, margin in margins.items():
        if name not in names:
            raise DatasetError(
                f"margin of {name}: no figure of merit of that name is compared{did_you_mean(name, names)} (known: "
                f"{', '.join(names)})"
            )
        if not 0.0 <= margin < np.inf:
            raise DatasetError(
                f"margin of {name}: {margin:g} is not a number from 0; give the change that does not matter"
            )
    at, before = [places[merit.name] for _, merit in compared], [k for k, _ in compared]
    drawn = _average_runs(new.draw(at), 0), _average_runs(old.draw(before), 1)
    values = new.evaluate(at), old.evaluate(before)
    rows = [
        _compare_one(
            merit, old.runs[0].merits[k].statistic if is_single else None, (new_value, old_value), replicates,
            margins.get(merit.name, 0.0), level,
        )
        for merit, k, new_value, old_value, *replicates in zip(
            [new.runs[0].merits[place] for place in at], before, *(part.tolist() for part in values), *drawn, strict=True
        )
    ]  # fmt: skip
    changes = _judge(rows, level)
    broken, repaired = _find_changed(new, old)
    return Comparison(new, old, level, changes, broken, repaired)


def correct_by_holm(p: np.ndarray) -> np.ndarray:
    """Return p-values corrected by Holm's step-down method.

    Parameters
    ----------
    p : (test) p-values

    >>> correct_by_holm(np.array([0.01, 0.04, 0.03])).round(3).tolist()
    [0.03, 0.06, 0.06]
    """
    order = np.argsort(p, kind="stable")
    scaled = p[order] * (len(p) - np.arange(len(p)))
    corrected = np.empty(len(p))
    corrected[order] = np.minimum(np.maximum.accumulate(scaled), 1.0) if len(p) else scaled
    return corrected


def find_exchange_probability(differences: np.ndarray) -> float:
    """Return the probability that random signs give a sum as low as this one, or lower.

    Under the hypothesis that two algorithms are alike, the answers of each encounter could as well stand the other way
    round. With differences of one it is McNemar's exact test on one side.

    Parameters
    ----------
    differences : (encounter) whole numbers, new minus old

    >>> find_exchange_probability(np.array([-1, -1, -1, -1, 0]))
    0.0625
    """
    sizes = np.abs(differences[differences != 0]).astype(np.int64)
    total, net = int(sizes.sum()), int(differences.sum())
    if total > _MOST_EXACT:
        from scipy.special import ndtr

        return float(ndtr((net + 1.0) / np.sqrt(float((sizes.astype(float) ** 2).sum()))))
    chance = np.ones(1)  # of the sum of the positive sizes, 0 to total
    for size in sizes.tolist():
        longer = np.zeros(len(chance) + size)
        longer[: len(chance)] += 0.5 * chance
        longer[size:] += 0.5 * chance
        chance = longer
    return min(1.0, float(chance[: (total + net) // 2 + 1].sum()))


def _list_keys(card: Scorecard) -> np.ndarray:
    """Return sample, step and draw (frame, 3) of the frames of a scorecard."""
    truth = card.benchmark.truth
    return np.stack([truth.sample, truth.step, truth.draw], axis=1)


def _compare_one(
    merit: FigureOfMerit,
    old: Statistic | None,
    values: tuple[float, float],
    replicates: Sequence[np.ndarray],
    margin: float,
    level: float,
) -> Change:
    """Compare one figure of merit; its verdict is still open.

    Parameters
    ----------
    old : statistic of the old one; None where there are several runs, for which there is no exact test
    replicates : (replicate) values of a bootstrap of both, with the same draws
    margin : change that does not matter
    """
    sign = 1.0 if merit.better == HIGHER else -1.0
    difference = float(_subtract(np.array(values[0]), np.array(values[1])))
    drawn = _subtract(*replicates)
    gain = np.where(np.isnan(drawn), 0.0, sign * drawn)
    count = len(gain) + 1
    p_worse = (1 + int((gain >= -margin).sum())) / count
    p_better = (1 + int((gain <= margin).sum())) / count
    exact = None if old is None else _find_differences(merit.statistic, old)
    if exact is not None:
        p_worse = max(p_worse, find_exchange_probability(exact))
        p_better = max(p_better, find_exchange_probability(-exact))
    verdict, (low, high) = SAME, percentile_interval(drawn, 1.0 - 2.0 * level)
    if merit.statistic.count()[1] < FEWEST_ENCOUNTERS:
        verdict, low, high = UNKNOWN, np.nan, np.nan
    return Change(
        merit.name, merit.unit, merit.better, values[1], values[0], difference, low, high, p_worse, p_better, margin,
        verdict,
    )  # fmt: skip


def _judge(rows: list[Change], level: float) -> tuple[Change, ...]:
    """Return changes with their verdicts after Holm's correction."""
    open_rows = [row for row in rows if row.verdict != UNKNOWN]
    worse = correct_by_holm(np.array([row.p_worse for row in open_rows]))
    better = correct_by_holm(np.array([row.p_better for row in open_rows]))
    judged = {
        row.name: replace(
            row,
            verdict=WORSE if p_worse <= level else BETTER if p_better <= level else SAME,
            p_worse_corrected=p_worse,
            p_better_corrected=p_better,
        )
        for row, p_worse, p_better in zip(open_rows, worse.tolist(), better.tolist(), strict=True)
    }
    return tuple(judged.get(row.name, row) for row in rows)


def _subtract(new: np.ndarray, old: np.ndarray) -> np.ndarray:
    """Return differences; zero where both are infinite."""
    with np.errstate(invalid="ignore"):
        return np.where(np.isinf(new) & (new == old), 0.0, new - old)


def _average_runs(drawn: np.ndarray, side: int) -> np.ndarray:
    """Return replicates (merit, replicate) of the mean over runs (run, merit, replicate), drawn too where several."""
    count = len(drawn)
    if count == 1:
        only: np.ndarray = drawn[0]
        return only
    rng = np.random.Generator(np.random.Philox(key=[_RUN_KEY, side]))
    weights = rng.multinomial(count, np.full(count, 1.0 / count), size=drawn.shape[2]) / count
    mean: np.ndarray = np.where(weights.T[:, None] > 0, drawn * weights.T[:, None], 0.0).sum(axis=0)
    return mean


def _find_differences(new: Statistic, old: Statistic) -> np.ndarray | None:
    """Return differences (encounter) of the successes of two shares of the same frames; None for other statistics."""
    if not isinstance(new, Ratios) or not isinstance(old, Ratios) or not new.is_proportion:
        return None
    if not np.array_equal(new.below, old.below):
        return None
    difference: np.ndarray = new.encounters.sum_by(new.above) - old.encounters.sum_by(old.above)
    return difference


def _find_changed(new: Scorecard, old: Scorecard) -> tuple[np.ndarray, np.ndarray]:
    """Return the frames whose class became wrong, and those whose class became right, of the first run of each side."""
    new_class, old_class, truth = new.runs[0].class_id, old.runs[0].class_id, new.benchmark.truth
    if new_class is None or old_class is None:
        return np.empty(0, np.int64), np.empty(0, np.int64)
    right, was_right = (truth.is_lit & (chosen == truth.class_id) for chosen in (new_class, old_class))
    return np.flatnonzero(was_right & ~right), np.flatnonzero(right & ~was_right)

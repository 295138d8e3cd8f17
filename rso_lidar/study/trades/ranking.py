"""The ranking of points of a trade study, by single figures of merit and by all of them."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from rso_lidar.study.trades.merits import DETECTION, MERITS, Merit
from rso_lidar.study.trades.results import TradeTable
from rso_lidar.study.trades.trade_figures import format_value

_AMBIGUOUS_END = re.compile(r"\d+|type|name|file|at")  # ends of a place that are ambiguous alone


def rank_points(trade: TradeTable, name: str) -> np.ndarray:
    """Rank points by a figure of merit, averaged over seeds, the best first; points that it does not rank are omitted."""
    values = MERITS[name].sign * trade.of_points(name)[0]
    order = np.argsort(-values, kind="stable")
    points: np.ndarray = order[trade.ranked(name)[order]]
    return points


def find_pareto_front(trade: TradeTable) -> np.ndarray:
    """Return a mask (point) of the Pareto front: points that no other point dominates.

    A point dominates another if it is at least as good in every figure of merit and better in one. Only points that every
    figure of merit ranks are compared.
    """
    values = np.stack([MERITS[name].sign * trade.of_points(name)[0] for name in trade.study.merits], axis=1)
    stands: np.ndarray = np.all([trade.ranked(name) for name in trade.study.merits], axis=0)
    rivals = values[stands]
    for point in np.flatnonzero(stands).tolist():
        own = values[point]
        stands[point] = not np.any(np.all(rivals >= own, axis=1) & np.any(rivals > own, axis=1))
    return stands


def describe_unranked(trade: TradeTable) -> str:
    """Describe in one line the points that are not ranked for lack of detections; empty without any."""
    if not trade.needs_detection:
        return ""
    mean = trade.of_points(DETECTION)[0]
    flown = np.isfinite(mean)
    count, limit = int(np.sum(flown & ~trade.detected)), trade.study.min_detection_fraction
    if not count:
        return ""
    names = ", ".join(name for name in trade.study.merits if MERITS[name].of_detected)
    why = f"detection_fraction below {limit:g} (min_detection_fraction)"
    if count == int(flown.sum()):
        return f"no point is ranked in {names}: all {count:,} have a {why}, {format_value(float(mean[flown].max()))} at most"
    return f"{count:,} of {mean.size:,} points are not ranked in {names}: {why}"


def name_merit(merit: Merit) -> str:
    """Format the name of a figure of merit, with its unit."""
    unit = "" if merit.unit == "1" else f" [{merit.unit}]"
    name = merit.name.removesuffix(f"_{merit.unit}").replace("_", " ")
    return f"{name[0].upper()}{name[1:]}{unit}"


def choose_pictured(trade: TradeTable) -> list[tuple[int, str]]:
    """Choose the points whose frames are shown: best, worst, and evenly spaced ones by the first figure of merit."""
    points = rank_points(trade, trade.study.merits[0])
    count = min(trade.study.report.pictures, points.size)
    places = np.linspace(0, points.size - 1, count).round().astype(int).tolist() if count > 1 else [0] * count
    ranks = ["the best", *(f"place {place + 1} of {points.size}" for place in places[1:-1]), "the worst"]
    name = name_merit(MERITS[trade.study.merits[0]])
    return [(int(points[place]), f"{name}: {why}") for place, why in zip(places, ranks, strict=False)]


def summarize_trade(trade: TradeTable) -> list[str]:
    """Summarize a trade study in a few lines: the number of runs, and the best point by each figure of merit."""
    study = trade.study
    failed = int(np.sum(trade.table["error"] != ""))
    lines = [f"{study.name}: {study.n_rows:,} runs" + (f", {failed:,} could not be flown" if failed else "")]
    for name in study.merits:
        points = rank_points(trade, name)
        if not points.size:
            lines.append(f"{name_merit(MERITS[name]):<28} {explain_no_best(trade, name)}")
            continue
        values = trade.of_points(name)[0][points]
        row, value = int(points[0]) * study.seeds, format_value(float(values[0]))
        if points.size > 1 and np.all(values == values[0]):
            lines.append(
                f"{name_merit(MERITS[name]):<28} is {value} at all {points.size:,} points, so that none is best"
            )
            continue
        places = ((place, head, trade.table[place][row]) for place, head in shorten_places(study.places).items())
        at = ", ".join(
            f"{head} {format_value(float(value)) if is_number(trade, place) else value}"
            for place, head, value in places
        )
        lines.append(
            f"{name_merit(MERITS[name]):<28} {MERITS[name].better} is better, best {value:>8} at row {row}: {at}"
        )
    if unranked := describe_unranked(trade):
        lines.append(unranked)
    if failed:
        lines.append(f"not flown: {next(text for text in trade.table['error'].tolist() if text)}")
    return lines


def explain_no_best(trade: TradeTable, name: str) -> str:
    """Explain why no point is the best by a figure of merit."""
    known = np.isfinite(trade.of_points(name)[0]).any()
    return "ranks no point: too little is detected at all of them" if known else "has no meaning at any point"


def shorten_places(places: Sequence[str]) -> dict[str, str]:
    """Shorten places to column heads: the shortest ends that are meaningful and distinct.

    >>> shorten_places(("follower.motion.position_m.1", "target.a.material", "target.b.material", "lidar.detector.type"))
    ... # doctest: +NORMALIZE_WHITESPACE
    {'follower.motion.position_m.1': 'position_m.1', 'target.a.material': 'a.material',
     'target.b.material': 'b.material', 'lidar.detector.type': 'detector.type'}
    """
    steps = {place: place.split(".") for place in places}
    count = {place: 1 + bool(_AMBIGUOUS_END.fullmatch(steps[place][-1])) for place in places}
    while True:
        ends = {place: ".".join(steps[place][-count[place] :]) for place in places}
        shared = [place for place in places if list(ends.values()).count(ends[place]) > 1]
        longer = [place for place in shared if count[place] < len(steps[place])]
        if not longer:
            return ends
        for place in longer:
            count[place] += 1


def is_number(trade: TradeTable, place: str) -> bool:
    """Return whether the values of a field are numbers."""
    return trade.table[place].dtype.kind in "fiu"

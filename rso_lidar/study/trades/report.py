"""The report of a trade study: one HTML file without network access and scripts."""

from __future__ import annotations

import math
import os
import shlex
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path

import numpy as np

from rso_lidar.errors import RsoLidarError, ScenarioError, did_you_mean, suppress_warnings
from rso_lidar.export import write_parquet
from rso_lidar.files import write_columns, write_text
from rso_lidar.picture import LIGHT, Scheme, frame_figure, html_page, rank_parts
from rso_lidar.records import Frame
from rso_lidar.simulation import simulate
from rso_lidar.study.trades.definition import Axis, Grid, write_toml_value
from rso_lidar.study.trades.merits import DETECTION, MERITS
from rso_lidar.study.trades.ranking import (
    choose_pictured,
    describe_unranked,
    explain_no_best,
    find_pareto_front,
    is_number,
    name_merit,
    rank_points,
    shorten_places,
)
from rso_lidar.study.trades.results import TradeTable
from rso_lidar.study.trades.trade_figures import Quantity, against_figure, effects_figure, format_value, maps_figure

TRADE_SUFFIXES = (".csv", ".parquet", ".html")
_LISTED = 12  # greatest number of rows in a table of points
_MOST_ERRORS = 10
_DECADES = 30.0  # greatest over least value from which the scale of a figure of merit is logarithmic


def save_trade(trade: TradeTable, place: Path, scheme: Scheme = LIGHT) -> Path:
    """Write a trade's table or report, by the suffix, and return the path."""
    suffix = place.suffix.lower()
    if suffix == ".csv":
        return write_columns(place, trade.table)
    if suffix == ".parquet":
        return write_parquet(
            place, trade.table, {"study": trade.study.model_dump_json(), "scenario": trade.base.dumps()}
        )
    if suffix == ".html":
        return write_text(place, write_report(trade, scheme), overwrite=True)
    guess = did_you_mean(suffix, TRADE_SUFFIXES)
    raise ScenarioError(
        f"{place}: a trade is not written as '{place.suffix}'{guess} (known: {', '.join(TRADE_SUFFIXES)})"
    )


def write_report(trade: TradeTable, scheme: Scheme = LIGHT) -> str:
    """Return the report as HTML with embedded pictures.

    It is the same for the same study, scenario, versions and working folder.
    """
    study = trade.study
    failed = np.flatnonzero(trade.table["error"] != "")
    body = [
        f"<h1>{escape(study.name)}</h1>",
        f'<p class="quiet">A trade study of <b>{escape(trade.base.name)}</b> ({escape(trade.plan.where)}): '
        f"{_describe_points(trade)}; {failed.size:,} of {study.n_rows:,} could not be flown.</p>",
        "<h2>What was asked</h2>",
        _tabulate_axes(trade),
        _tabulate_merits(study.merits),
        *_explain_ranking(trade),
        f'<p class="quiet">{_describe_frames(trade)}</p>',
        "<h2>Best points</h2>",
        *_write_best(trade),
        "<h2>Along each axis</h2>",
        *_draw_plots(trade, scheme),
        *_draw_frames(trade, scheme),
        *_tabulate_failures(trade, failed),
        "<h2>How to get this again</h2>",
        *_write_origin(trade),
    ]
    return html_page.write_page(study.name, body, scheme)


# --------------------------------------------------------------------------------------------------------- the parts


def _describe_points(trade: TradeTable) -> str:
    study = trade.study
    seeds = f" x {study.seeds} seeds" if study.seeds > 1 else ""
    how = study.sampling.type.replace("_", " ")
    return f"{len(trade.plan.points):,} points ({how}){seeds}, target {escape(_name_target(trade))}"


def _name_target(trade: TradeTable) -> str:
    return trade.base.target[trade.study.number(trade.base)].name


def _describe_frames(trade: TradeTable) -> str:
    frames = trade.study.frames
    said_so = "all frames" if frames is None else f"frames {escape(str(frames))}"
    if not any(MERITS[name].needs != "truth" for name in trade.study.merits):
        return "No frame was flashed: truth alone answers."
    return f"Of each run {said_so} were flashed."


def _tabulate_axes(trade: TradeTable) -> str:
    rows = []
    for axis in trade.study.axis:
        places = "<br>".join(f"<code>{escape(field)}</code>" for field in axis.field)
        rows.append((places, escape(_describe_values(axis, isinstance(trade.study.sampling, Grid)))))
    return html_page.write_table([("axis", False), ("values", False)], rows)


def _describe_values(axis: Axis, grid: bool) -> str:
    if axis.values is not None or grid:
        values = [
            format_value(value) if type(value) in (int, float) else write_toml_value(value) for value in axis.grid()
        ]
        return ", ".join(values if len(values) <= 24 else [*values[:12], "…", *values[-3:]])
    assert axis.low is not None
    assert axis.high is not None
    return f"{format_value(axis.low)} to {format_value(axis.high)}, {axis.scale}"


def _tabulate_merits(names: Sequence[str]) -> str:
    rows = [
        (f"<code>{name}</code>", escape(merit.unit), merit.better, escape(merit.meaning).replace("`", ""))
        for name in names
        for merit in [MERITS[name]]
    ]
    return html_page.write_table(
        [("figure of merit", False), ("unit", False), ("better", False), ("what it is", False)], rows
    )


def _write_best(trade: TradeTable) -> list[str]:
    names = trade.study.merits
    leaders = [(name, rank_points(trade, name)) for name in names]
    fragments = [
        "<h3>The best of each figure of merit</h3>",
        _tabulate_points(
            trade, [(_describe_lead(trade, name, points), int(points[0])) for name, points in leaders if points.size]
        ),
        *(
            f"<p>{escape(name_merit(MERITS[name]))} {explain_no_best(trade, name)}.</p>"
            for name, points in leaders
            if not points.size
        ),
    ]
    if len(names) > 1:
        stand = find_pareto_front(trade)
        points = [point for point in leaders[0][1].tolist() if stand[point]]
        more = f" (the first {_LISTED} of {len(points):,})" if len(points) > _LISTED else ""
        fragments.append(f"<h3>Points that no other beats in every figure of merit{more}</h3>")
        fragments.append(
            _tabulate_points(trade, [("", point) for point in points[:_LISTED]])
            if points
            else "<p>None is ranked in all of them.</p>"
        )
    if unranked := describe_unranked(trade):
        left = np.flatnonzero(np.isfinite(trade.of_points(DETECTION)[0]) & ~trade.detected).tolist()
        more = f" (the first {_LISTED} of {len(left):,})" if len(left) > _LISTED else ""
        fragments.append(f"<h3>Points that are not ranked{more}</h3><p>{escape(unranked)}.</p>")
        fragments.append(_tabulate_points(trade, [("", point) for point in left[:_LISTED]]))
    return fragments


def _explain_ranking(trade: TradeTable) -> list[str]:
    """Explain the detection fraction that a point needs to be ranked."""
    if not trade.needs_detection:
        return []
    return [
        "<p>A figure of merit that depends on detection ranks a point only if its detection fraction is "
        f"{trade.study.min_detection_fraction:g} or more (<code>min_detection_fraction</code>). Below that, a minority of "
        "the pixels reports, chosen by brightness and noise, and its figures are not the camera's.</p>"
    ]


def _describe_lead(trade: TradeTable, name: str, points: np.ndarray) -> str:
    """Describe the figure of merit by which points are the best, and the number of equal ones."""
    means = trade.of_points(name)[0][points]
    alike = int(np.sum(means == means[0])) - 1
    return escape(name_merit(MERITS[name])) + (f" ({alike:,} more are as good)" if alike else "")


def _tabulate_points(trade: TradeTable, points: Sequence[tuple[str, int]]) -> str:
    """Tabulate points: a word, their settings, and their figures of merit averaged over seeds."""
    columns = shorten_places(trade.study.places)
    heads = [("best in", False)] if any(word for word, _ in points) else []
    heads += [("row", True)]
    heads += [(f"<code>{escape(head)}</code>", is_number(trade, place)) for place, head in columns.items()]
    heads += [(escape(name_merit(MERITS[name])), True) for name in trade.study.judged_by]
    first = [[word] if len(heads) and heads[0][0] == "best in" else [] for word, _ in points]
    rows = [[*begin, *_format_cells(trade, point)] for begin, (_, point) in zip(first, points, strict=True)]
    return html_page.write_table(heads, rows)


def _format_cells(trade: TradeTable, point: int) -> Iterable[str]:
    seeds = trade.study.seeds
    yield f"{point * seeds}" + (f"–{point * seeds + seeds - 1}" if seeds > 1 else "")
    for place in trade.study.places:
        value = trade.table[place][point * seeds]
        yield format_value(float(value)) if is_number(trade, place) else f"<code>{escape(str(value))}</code>"
    for name in trade.study.judged_by:
        mean, spread = (float(values[point]) for values in trade.of_points(name))
        yield format_value(mean) + (f" ± {format_value(spread, 2)}" if math.isfinite(spread) else "")


def _draw_plots(trade: TradeTable, scheme: Scheme) -> list[str]:
    """Draw main effects, maps over pairs of axes of a grid, and figures of merit against each other."""
    axes = [_build_quantity(trade, axis) for axis in trade.study.axis]
    fragments, shown = [], []
    for merit in (MERITS[name] for name in trade.study.merits):
        values = trade.table[merit.name]
        alike = _find_common_value(values)
        if alike is None:
            held = ~np.repeat(trade.ranked(merit.name), trade.study.seeds)
            shown.append((Quantity(name_merit(merit), values, _spans_decades(values), unranked=held), merit))
        elif math.isfinite(alike):
            fragments.append(f"<p>{escape(name_merit(merit))} is {format_value(alike)} at all points.</p>")
    for value, merit in shown:
        figure = effects_figure(value, axes, merit.better)
        fragments.append(html_page.embed_figure(figure, f"{value.name} along each axis", scheme=scheme))
    if isinstance(trade.study.sampling, Grid):
        maps = [(maps_figure(value, axes, merit.better), value.name) for value, merit in shown]
        drawn = [
            html_page.embed_figure(f, f"{name} over pairs of axes", scheme=scheme) for f, name in maps if f is not None
        ]
        fragments += ["<h2>Over pairs of axes</h2>", *drawn] if drawn else []
    means = [
        Quantity(value.name, trade.of_points(merit.name)[0], value.log, unranked=~trade.ranked(merit.name))
        for value, merit in shown
    ]
    by = Quantity(axes[0].name, axes[0].values[:: trade.study.seeds], axes[0].log)
    against = against_figure(means, [merit.better for _, merit in shown], by, find_pareto_front(trade))
    if against is not None:
        words = "Figures of merit against each other"
        fragments += ["<h2>Against each other</h2>", html_page.embed_figure(against, words, scheme=scheme)]
    return fragments


def _find_common_value(values: np.ndarray) -> float | None:
    """Return the value that is common to all rows with a value (NaN: no row has one); None where values differ."""
    known = values[np.isfinite(values)]
    if not known.size:
        return math.nan
    return float(known[0]) if np.all(known == known[0]) else None


def _build_quantity(trade: TradeTable, axis: Axis) -> Quantity:
    values = trade.table[axis.name]
    more = f" (and {len(axis.field) - 1} more)" if len(axis.field) > 1 else ""
    log = axis.numeric and (axis.scale == "log" or _is_geometric(values))
    drawn = 0 if isinstance(trade.study.sampling, Grid) else trade.study.sampling.points
    return Quantity(axis.name + more, values, log, drawn)


def _is_geometric(values: np.ndarray) -> bool:
    """Return whether values look geometrically spaced: over a wide span, and more regular in their logarithms."""
    if values.dtype.kind not in "fiu" or not np.all(values > 0.0):
        return False
    levels = np.unique(values).astype(float)
    if len(levels) < 3 or levels[-1] < 5.0 * levels[0]:
        return False
    even = [float(np.std(steps) / np.mean(steps)) for steps in (np.diff(levels), np.diff(np.log(levels)))]
    return even[1] < even[0]


def _spans_decades(values: np.ndarray) -> bool:
    known = values[np.isfinite(values)]
    return bool(known.size and known.min() > 0.0 and known.max() > _DECADES * known.min())


def _tabulate_failures(trade: TradeTable, failed: np.ndarray) -> list[str]:
    if not failed.size:
        return []
    why, count = np.unique(trade.table["error"][failed], return_counts=True)
    order = np.argsort(-count, kind="stable")[:_MOST_ERRORS]
    first = {text: int(np.flatnonzero(trade.table["error"] == text)[0]) for text in why[order].tolist()}
    rows = [(f"{count[k]:,}", f"{first[str(why[k])]}", escape(str(why[k]))) for k in order]
    return [
        "<h2>Points that could not be flown</h2>",
        html_page.write_table([("rows", True), ("first", True), ("why", False)], rows),
    ]


def _write_origin(trade: TradeTable) -> list[str]:
    import tomli_w

    source = trade.base.source
    versions = ", ".join(f"{name} {version}" for name, version in source.versions.items())
    seeds = f"sampling {trade.study.seed}; scenario {trade.plan.seed}"
    seeds += f" to {trade.plan.seed + trade.study.seeds - 1}, the same at each point" if trade.study.seeds > 1 else ""
    asked = tomli_w.dumps(trade.study.model_dump(exclude_none=True))
    return [
        f"<p>Seeds: {seeds}. Versions: {escape(versions)}.</p>",
        f"<details><summary>The study</summary><pre>{escape(asked)}</pre></details>",
        f"<details><summary>The scenario before any axis</summary><pre>{escape(source.scenario)}</pre></details>",
    ]


# ------------------------------------------------------------------------------------------------------- the pictures


def _draw_frames(trade: TradeTable, scheme: Scheme) -> list[str]:
    fragments = []
    frames = {point: _try_frame(trade, point * trade.study.seeds) for point, _ in choose_pictured(trade)}
    parts = rank_parts([frame for frame in frames.values() if isinstance(frame, Frame)])
    for point, why in choose_pictured(trade):
        row, frame = point * trade.study.seeds, frames[point]
        fragments.append(f"<h3>{escape(why)} (row {row})</h3>")
        if isinstance(frame, RsoLidarError):
            fragments.append(f"<p>{escape(str(frame))}</p>")
            continue
        with suppress_warnings():
            merits = ", ".join(
                f"{name_merit(MERITS[name])} {format_value(float(trade.table[name][row]))}"
                for name in trade.study.merits
            )
            command = escape(_write_command(trade, row, frame.index))
            caption = f"{escape(merits)}, over the whole run.<br><code>{command}</code>"
            fragments.append(
                html_page.embed_figure(frame_figure(frame, parts), f"frame {frame.index} of row {row}", caption, scheme)
            )
    return ["<h2>Frames</h2>", *fragments] if fragments else []


def _write_command(trade: TradeTable, row: int, frame: int) -> str:
    """Return the command that reproduces a frame of a row."""
    changes = (*trade.study.set, *(f"{place}={value}" for place, value in trade.plan.settings(row).items()))
    settings = " ".join(f"--set {shlex.quote(change)}" for change in changes)
    file = shlex.quote(_relative_path(trade.plan.folder / trade.plan.where))
    return f"rso-lidar run {file} {settings} --frames {frame}:{frame + 1} -o frame.h5"


def _relative_path(file: Path) -> str:
    """Return the path of a file relative to the working folder, or absolute on another drive."""
    file = file.resolve()
    try:
        return os.path.relpath(file, Path.cwd().resolve())
    except ValueError:  # another drive
        return str(file)


def _try_frame(trade: TradeTable, row: int) -> Frame | RsoLidarError:
    """Return the frame that is shown of a row, or the error that prevents it."""
    with suppress_warnings():
        try:
            return _make_frame(trade, row)
        except RsoLidarError as error:
            return error


def _make_frame(trade: TradeTable, row: int) -> Frame:
    """Simulate the frame that is shown of a row: the study's choice, or the middle one of its frames."""
    scenario = trade.plan.scenario(row)
    numbers = trade.study.numbers(scenario)
    wanted = trade.study.report.frame
    number = int(numbers[(len(numbers) - 1) // 2]) if wanted is None else min(wanted, scenario.time.n_frames - 1)
    return next(simulate(scenario, frames=[number], threads=1))

"""Reports of scores: a table for a terminal, JSON with all numbers, one HTML page, and a folder of pictures."""

from __future__ import annotations

import json
from html import escape
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from rso_lidar.dataset.metrics.merits import Value
from rso_lidar.dataset.scoring.comparison import Comparison
from rso_lidar.dataset.scoring.score_figures import ScoreFigure, describe_frames, draw_comparison, list_figures
from rso_lidar.dataset.scoring.scorecard import Scorecard
from rso_lidar.errors import DatasetError, did_you_mean
from rso_lidar.files import align_columns, check_writable, write_text
from rso_lidar.picture import LIGHT, Scheme, html_page, save_figure

SUFFIXES = (".html", ".json")
_MOST_POINTS = 400  # of a curve in JSON


def check_score_report(path: str | Path, *, overwrite: bool = False) -> Path:
    """Check that a score report may be written at a path, before the work begins.

    Parameters
    ----------
    path : an .html or .json file, or a folder for pictures, which is created if it is new
    overwrite : whether existing files may be replaced

    Returns
    -------
    Path

    Raises
    ------
    DatasetError
        For another suffix, a folder that is absent or already holds pictures, and a file that exists.
    """
    place = Path(path)
    if not place.suffix or place.is_dir():
        if place.exists() and not place.is_dir():
            raise DatasetError(f"{place}: is a file without a suffix; name an .html, a .json or a folder")
        if not place.parent.is_dir():
            raise DatasetError(f"{place}: there is no folder {place.parent}; create it first")
        if place.is_dir() and not overwrite and any(place.glob("*.png")):
            raise DatasetError(f"{place}: holds pictures; choose another folder, or allow it with --overwrite")
        return place
    if place.suffix.lower() not in SUFFIXES:
        guess = did_you_mean(place.suffix.lower(), SUFFIXES)
        raise DatasetError(
            f"{place}: scores are not written as '{place.suffix}'{guess} (known: {', '.join(SUFFIXES)}, or a folder)"
        )
    return check_writable(place, SUFFIXES, overwrite=overwrite)


def save_score_report(
    card: Scorecard,
    path: str | Path,
    comparison: Comparison | None = None,
    scheme: Scheme = LIGHT,
    *,
    overwrite: bool = False,
) -> list[Path]:
    """Write a score report: all numbers as JSON, one HTML page, or pictures in a folder, by the suffix of the path.

    Parameters
    ----------
    card : of the predictions, from `score`
    path : an .html or .json file, or a folder for pictures, which is created if it is new
    comparison : with another algorithm, from `compare` (None: the report has the scores alone)
    scheme : of pictures and pages, `LIGHT` or `DARK` of `rso_lidar.picture`
    overwrite : whether existing files may be replaced

    Returns
    -------
    list of Path
        The files that were written.

    Raises
    ------
    DatasetError
        As `check_score_report`.
    """
    place = check_score_report(path, overwrite=overwrite)
    if place.suffix.lower() == ".json":
        text = json.dumps(describe(card, comparison), indent=1, allow_nan=False) + "\n"
    elif place.suffix.lower() == ".html":
        text = write_html(card, comparison, scheme)
    else:
        place.mkdir(exist_ok=True)
        figures = _list_all(card, comparison)
        return [save_figure(figure.draw(), place / f"{figure.stem}.png", scheme=scheme) for figure in figures]
    return [write_text(place, text, overwrite=True)]


def format_scores(card: Scorecard) -> list[str]:
    """Format the figures of merit of a scorecard as lines of a table, each with its confidence interval.

    Parameters
    ----------
    card : of the predictions, from `score`

    Returns
    -------
    list of str
    """
    several = len(card.runs) > 1
    truth = card.benchmark.truth
    lines = [describe_frames(card)]
    lines += [
        f"{run.name}: {int(run.missing.sum()):,} of {len(truth):,} frames have no prediction; they count as failures"
        for run in card.runs
        if run.missing.any()
    ]
    faint = int(((truth.present > 0) & (truth.lit_pixels < truth.min_lit_pixels)).sum())
    if faint:
        what = "no lit pixel" if truth.min_lit_pixels == 1 else f"fewer than {truth.min_lit_pixels} lit pixels"
        lines.append(f"{faint:,} frames of a target with {what} are left out")
    rows = [("", "value", f"{card.confidence:.0%} interval", *(["sd of runs"] if several else []), "frames")]
    for merit in card.merits:
        spread = [_format_number(merit.spread)] if several else []
        rows.append(
            (
                f"{merit.name}{'' if merit.unit == '1' else f' [{merit.unit}]'}", _format_number(merit.value.value),
                _format_ends(merit.value), *spread, f"{merit.value.frames:,}",
            )
        )  # fmt: skip
    return [*lines, *align_columns(rows)]


def format_comparison(comparison: Comparison) -> list[str]:
    """Format a comparison as lines of a table, the last of which states the result.

    Parameters
    ----------
    comparison : of two algorithms, from `compare`

    Returns
    -------
    list of str
    """
    share = 1.0 - 2.0 * comparison.level
    rows = [("", "old", "new", "new - old", f"{share:.0%} interval", "p worse", "p better", "verdict")]
    rows += [
        (
            f"{change.name}{'' if change.unit == '1' else f' [{change.unit}]'}", _format_number(change.old),
            _format_number(change.new), _format_number(change.difference, sign=True),
            _format_pair(change.low, change.high, sign=True), _format_number(change.p_worse_corrected, digits=2),
            _format_number(change.p_better_corrected, digits=2),
            change.verdict,
        )
        for change in comparison.changes
    ]  # fmt: skip
    lines = align_columns(rows)
    if len(comparison.broken) or len(comparison.repaired):
        lines.append(
            f"class: {len(comparison.broken):,} frames were right and are wrong, {len(comparison.repaired):,} the other way"
        )
    if len(comparison.new.runs) == len(comparison.old.runs) == 1:
        lines.append(
            "one training run of each: how much another run of the same training would differ is not in the intervals"
        )
    return [*lines, describe_result(comparison)]


def describe_result(comparison: Comparison) -> str:
    """Describe the result of a comparison in a line."""
    worse = [change.name for change in comparison.changes if change.verdict == "worse"]
    better = [change.name for change in comparison.changes if change.verdict == "better"]
    words = [f"{word}: {', '.join(names)}" for word, names in (("worse", worse), ("better", better)) if names]
    chance = f"at {comparison.level:.0%} over all figures of merit, with Holm's correction"
    return f"{'; '.join(words) or 'no significant difference'} ({chance})"


def describe(card: Scorecard, comparison: Comparison | None = None) -> dict[str, Any]:
    """Return all numbers of a report, as JSON has them: null for none, and the text "inf" for infinity.

    Parameters
    ----------
    card : the scorecard
    comparison : with another algorithm, if any
    """
    truth = card.benchmark.truth
    report: dict[str, Any] = {
        "schema": 1,
        "rso_lidar": version("rso-lidar"),
        "dataset": card.benchmark.identity,
        "split": card.benchmark.split,
        "frames": len(truth),
        "encounters": truth.encounters.count,
        "min_lit_pixels": truth.min_lit_pixels,
        "confidence": card.confidence,
        "replicates": card.replicates,
        "predictions": [{"name": run.name, "missing": int(run.missing.sum())} for run in card.runs],
        "merits": [
            {
                "name": merit.name, "unit": merit.unit, "better": merit.better, "meaning": merit.meaning,
                **_describe_value(merit.value), "interval": merit.value.method,
                "runs": [_plain(number) for number in merit.of_runs], "sd_over_runs": _plain(merit.spread),
            }
            for merit in card.merits
        ],
        "bins": [
            {
                "name": bins.name, "quantity": bins.quantity, "unit": bins.unit, "edges": _plain(bins.edges),
                "series": {name: [_describe_value(figure) for figure in values] for name, values in of_series.items()},
            }
            for bins, of_series in card.binned
        ],
        "confusions": [
            {
                "quantity": confusion.quantity, "unit": confusion.unit, "edges": _plain(confusion.edges),
                "classes": list(truth.classes), "counts": confusion.counts.tolist(),
            }
            for confusion in card.confusions
        ],
        "curves": {name or "present": _describe_curves(card, name) for name in ("", *truth.classes) if card.curves(name)},
    }  # fmt: skip
    if comparison is not None:
        report["comparison"] = _describe_comparison(comparison)
    return report


def write_html(card: Scorecard, comparison: Comparison | None = None, scheme: Scheme = LIGHT) -> str:
    """Return a report as one HTML page with embedded pictures, without network access and scripts."""
    names = ", ".join(run.name for run in card.runs)
    body = [f"<h1>Scores of {escape(names)}</h1>", f'<p class="quiet">{escape(describe_frames(card))}</p>']
    if comparison is not None:
        old = ", ".join(run.name for run in comparison.old.runs)
        body += [f"<h2>Against {escape(old)}</h2>", f"<p><b>{escape(describe_result(comparison))}</b></p>"]
        body.append(html_page.embed_figure(draw_comparison(comparison), "gain of each figure of merit", scheme=scheme))
        body.append("<pre>" + escape("\n".join(format_comparison(comparison))) + "</pre>")
    body.append("<h2>Figures of merit</h2>")
    body += [f'<p class="quiet">{escape(line)}</p>' for line in format_scores(card)[1 : -len(card.merits) - 1]]
    body.append(_tabulate(card))
    for figure in list_figures(card):
        body.append(html_page.embed_figure(figure.draw(), figure.caption, escape(figure.caption), scheme))
    body.append("<h2>How to read this</h2>")
    body.append(
        "<p>What is independent in a dataset is the encounter, not the frame: intervals are over encounters. Shares have "
        "Wilson's interval with the design effect of encounters, everything else a bootstrap of "
        f"{card.replicates:,} draws. A frame without a prediction counts as a failure.</p>"
        f'<p class="quiet">dataset <code>{escape(card.benchmark.identity)}</code>, rso_lidar {version("rso-lidar")}</p>'
    )
    return html_page.write_page(f"Scores of {names}", body, scheme)


def _list_all(card: Scorecard, comparison: Comparison | None) -> list[ScoreFigure]:
    """Return the figures of a scorecard, and that of a comparison."""
    figures = list_figures(card)
    if comparison is not None:
        figures.append(ScoreFigure("comparison", "New against old.", lambda: draw_comparison(comparison)))
    return figures


def _tabulate(card: Scorecard) -> str:
    """Return the table of figures of merit as HTML."""
    several = len(card.runs) > 1
    heads = [("figure of merit", False), ("value", True), (f"{card.confidence:.0%} interval", True)]
    heads += [("sd of runs", True)] * several + [
        ("frames", True),
        ("encounters", True),
        ("better", False),
        ("what it is", False),
    ]
    rows = []
    for merit in card.merits:
        unit = "" if merit.unit == "1" else f" [{escape(merit.unit)}]"
        rows.append(
            [
                f"<code>{escape(merit.name)}</code>{unit}", _format_number(merit.value.value), _format_ends(merit.value),
                *([_format_number(merit.spread)] if several else []), f"{merit.value.frames:,}",
                f"{merit.value.encounters:,}", merit.better, escape(merit.meaning),
            ]
        )  # fmt: skip
    return html_page.write_table(heads, rows)


def _describe_value(value: Value) -> dict[str, Any]:
    return {
        "value": _plain(value.value), "low": _plain(value.low), "high": _plain(value.high),
        "frames": value.frames, "encounters": value.encounters,
    }  # fmt: skip


def _describe_curves(card: Scorecard, name: str) -> list[dict[str, Any]]:
    """Return the curves of a class for JSON, thinned to a number of points."""
    curves = []
    for curve in card.curves(name):
        count = len(curve.recall)
        at = np.unique(np.linspace(0, count - 1, min(count, _MOST_POINTS)).round().astype(int))
        curves.append(
            {
                word: _plain(getattr(curve, word)[at])
                for word in ("threshold", "precision", "recall", "false_alarm_rate")
            }
        )
    return curves


def _describe_comparison(comparison: Comparison) -> dict[str, Any]:
    truth = comparison.new.benchmark.truth
    return {
        "against": [run.name for run in comparison.old.runs],
        "level": comparison.level,
        "is_worse": comparison.is_worse,
        "changes": [{name: _plain(value) for name, value in vars(change).items()} for change in comparison.changes],
        **{
            word: [[int(of[row]) for of in (truth.sample, truth.step, truth.draw)] for row in rows.tolist()]
            for word, rows in (("broken", comparison.broken), ("repaired", comparison.repaired))
        },
    }


def _plain(value: Any) -> Any:
    """Return a value as JSON can hold it."""
    if isinstance(value, np.ndarray):
        return [_plain(number) for number in value.tolist()]
    if not isinstance(value, float) or np.isfinite(value):
        return value
    return None if np.isnan(value) else "inf" if value > 0 else "-inf"


def _format_number(value: float, sign: bool = False, digits: int = 4) -> str:
    """Format a number; a hyphen for NaN."""
    if np.isnan(value):
        return "-"
    return f"{value:{'+' if sign else ''}.{digits}g}" if abs(value) < 1e4 or np.isinf(value) else f"{value:,.0f}"


def _format_pair(low: float, high: float, sign: bool = False) -> str:
    """Format the ends of an interval; a hyphen for NaN."""
    if np.isnan(low):
        return "-"
    return f"{_format_number(low, sign)} to {_format_number(high, sign)}"


def _format_ends(value: Value) -> str:
    return _format_pair(value.low, value.high)

"""Figures of a scorecard and of a comparison, drawn by `picture`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from rso_lidar.dataset.metrics.merits import HIGHER, Bins, Value
from rso_lidar.dataset.scoring.binned_figure import BinnedPanel, binned_figure
from rso_lidar.dataset.scoring.classification import ALL, RELIABLE_RECALL, Confusions
from rso_lidar.dataset.scoring.classification_figure import confusion_figure, precision_recall_figure, presence_figure
from rso_lidar.dataset.scoring.comparison import Comparison
from rso_lidar.dataset.scoring.scorecard import Scorecard
from rso_lidar.picture import figures, palette

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_QUANTITIES = {
    "lit_pixels": "Lit pixels on the target",
    "range": "Range [m]",
    "total_photons": "Expected photons from the target",
}
_MEASURES = {
    "recall": "Recall",
    "rotation_error_deg": "Median rotation error [deg]",
    "translation_error_m": "Median translation error [m]",
    "pose_recall": "Share of correct poses",
    "mean_iou": "Mean IoU of the parts",
    "fine_range_rms_m": "rms range error [m]",
}
_WIDE = 8.0  # greatest over least edge from which an axis is logarithmic
_TITLES = {
    "recall": "Recall against light and range",
    "pose_range": "Errors of poses against range",
    "pose_lit_pixels": "Errors of poses against light",
    "mean_iou": "Parts against light",
    "fine_range_rms_m": "Fine ranges against light",
}
_COLOURS = {"better": palette.GREEN, "worse": palette.RED}
_ROW_IN = 0.36
_SPAN = 4.0  # half-widths of an interval that the axis shows


@dataclass(frozen=True, eq=False)
class ScoreFigure:
    """A figure with the stem of its file and a caption."""

    stem: str
    caption: str
    draw: Callable[[], Any]


def list_figures(card: Scorecard) -> list[ScoreFigure]:
    """Return the figures of a scorecard.

    Returns
    -------
    The figures of the tasks that the predictions have, in the order of a report; each is drawn when it is asked for.
    """
    note = describe_frames(card)
    merits = {merit.name: merit.value for merit in card.merits}
    drawn: list[ScoreFigure] = []
    curves = {name: runs for name in card.benchmark.truth.classes if (runs := card.curves(name))}
    if curves:
        labels = {name: f"{name}   AP {format_interval(merits[f'average_precision.{name}'])}" for name in curves}
        traces = {name: [(curve.recall, curve.precision) for curve in runs] for name, runs in curves.items()}
        drawn.append(
            ScoreFigure(
                "precision_recall", "Precision over recall of each class against the rest (as Fuller et al., fig. 16).",
                lambda: precision_recall_figure(traces, labels, "Precision and recall by class", note),
            )
        )  # fmt: skip
    groups: dict[str, list[tuple[Bins, dict[str, tuple[Value, ...]]]]] = {}
    for bins, values in card.binned:
        is_pose = bins.name in ("rotation_error_deg", "translation_error_m", "pose_recall")
        groups.setdefault(f"pose_{bins.quantity}" if is_pose else bins.name, []).append((bins, values))
    for group, members in groups.items():
        panels = [_make_panel(bins, values, merits) for bins, values in members]
        drawn.append(ScoreFigure(group, _caption(group), partial(binned_figure, panels, _TITLES[group], note)))
    if card.confusions:
        drawn.append(
            ScoreFigure(
                "confusion", "Confusion matrices: over all frames, and in thirds of range and of light. Shares in per cent.",
                lambda: confusion_figure(
                    card.benchmark.truth.classes, list(_label_matrices(card.confusions)), "Confusion of classes", note
                ),
            )
        )  # fmt: skip
    detector = card.curves("")
    if detector:
        precision = [(curve.recall, curve.precision) for curve in detector]
        detections = [(curve.false_alarm_rate, curve.recall) for curve in detector]
        words = (
            f"AP {format_interval(merits['presence_average_precision'])}",
            f"area {format_interval(merits['presence_roc_area'])}",
        )
        drawn.append(
            ScoreFigure(
                "presence", "Whether a target is there: precision over recall, and recall over the rate of false alarms.",
                lambda: presence_figure(precision, detections, words, "Target present or absent", note),
            )
        )  # fmt: skip
    return drawn


def draw_comparison(comparison: Comparison) -> Figure:
    """Draw the gain of each figure of merit, positive where the new algorithm is better, in half-widths of its interval."""
    changes = [change for change in comparison.changes if not np.isnan(change.difference)]
    share = 1.0 - 2.0 * comparison.level
    note = f"{describe_frames(comparison.new)}   ·   {share:.0%} intervals, paired bootstrap over encounters"
    figure = figures.new_figure(10.0, 1.5 + _ROW_IN * len(changes), "New against old", note)
    axes = figure.subplots()
    axes.axvline(0.0, color=palette.INK, lw=figures.THIN_PT)
    for place, change in enumerate(changes):
        sign = 1.0 if change.better == HIGHER else -1.0
        gain, (low, high) = sign * change.difference, sorted((sign * change.low, sign * change.high))
        half = 0.5 * (high - low)
        if not np.isfinite(half) or half <= 0:
            centre, ends = float(np.sign(gain)) if np.isfinite(gain) else 0.0, (0.0, 0.0)
        else:
            centre, ends = gain / half, ((gain - low) / half, (high - gain) / half)
        centre = float(np.clip(centre, -_SPAN, _SPAN))
        axes.errorbar(
            [centre], [place], xerr=[[max(ends[0], 0.0)], [max(ends[1], 0.0)]], fmt="o", ms=6,
            color=_COLOURS.get(change.verdict, palette.RULE), lw=figures.THICK_PT, capsize=3,
        )  # fmt: skip
        words = f"{change.old:.4g} → {change.new:.4g}{'' if change.unit == '1' else f' {change.unit}'}"
        ink = palette.INK if change.verdict in _COLOURS else palette.QUIET
        axes.annotate(
            f"{words}   {change.verdict}", (1.01, place), xycoords=("axes fraction", "data"), va="center",
            fontsize=figures.SMALL_PT, color=ink, annotation_clip=False,
        )  # fmt: skip
    axes.set_ylim(len(changes) - 0.5, -0.5)
    axes.set_xlim(-_SPAN - 1.2, _SPAN + 1.2)
    figures.style_axes(axes, x="worse   ←   gain, in half-widths of its interval   →   better")
    axes.set_yticks(range(len(changes)), [change.name for change in changes])
    axes.tick_params(axis="y", length=0)
    axes.grid(axis="y", color=palette.GRID, lw=figures.HAIR_PT)
    return figure


def describe_frames(card: Scorecard) -> str:
    """Describe the frames that were scored, and the runs."""
    truth = card.benchmark.truth
    runs = f"   ·   {len(card.runs)} runs" if len(card.runs) > 1 else ""
    return f"{len(truth):,} frames of {truth.encounters.count:,} encounters, split '{card.benchmark.split}'{runs}"


def format_interval(value: Value) -> str:
    """Format a share with its interval.

    >>> format_interval(Value(0.912, 0.881, 0.94, "", 1, 1))
    '0.912 (0.881 to 0.940)'
    """
    if not np.isfinite(value.low):
        return f"{value.value:.3f}"
    return f"{value.value:.3f} ({value.low:.3f} to {value.high:.3f})"


def _caption(group: str) -> str:
    """Return the caption of a group of binned figures."""
    if group == "recall":
        return (
            "Recall in bins, with intervals over encounters for all classes (as Fuller et al., fig. 17). The dashed line "
            f"marks the lit pixels from which the recall is {RELIABLE_RECALL:.0%}, by isotonic regression."
        )
    return f"{_TITLES[group]}, in bins, with intervals over encounters. Errors beyond the axis are those of missing frames."


def _make_panel(bins: Bins, values: Mapping[str, Sequence[Value]], merits: Mapping[str, Value]) -> BinnedPanel:
    """Make a panel of figures in bins."""
    is_recall = bins.name == "recall"
    series = {
        name: np.array([(figure.value, figure.low, figure.high) for figure in of_series])
        for name, of_series in values.items()
    }
    mark = None
    if is_recall and bins.quantity == "lit_pixels":
        reached = merits["pixels_for_recall_90"]
        mark = (reached.value, reached.low, reached.high)
    first = next(iter(values.values()))
    return BinnedPanel(
        x=_QUANTITIES[bins.quantity],
        y=_MEASURES[bins.name],
        edges=bins.edges,
        series={ALL: series.pop(ALL), **series} if ALL in series else series,
        frames=np.array([figure.frames for figure in first]),
        is_log=bins.edges[0] > 0 and bins.edges[-1] > _WIDE * bins.edges[0],
        is_share=bins.name in ("recall", "mean_iou", "pose_recall"),
        level=RELIABLE_RECALL if is_recall else None,
        mark=mark,
    )


def _label_matrices(confusions: Sequence[Confusions]) -> list[tuple[str, np.ndarray]]:
    """Return the title and the counts of each confusion matrix."""
    matrices = []
    for confusion in confusions:
        if confusion.quantity == "all":
            matrices.append(("All frames", confusion.counts[0]))
            continue
        word, unit = ("Range", " m") if confusion.quantity == "range" else ("Photons", "")
        matrices += [
            (f"{word} {low:,.0f} to {high:,.0f}{unit}", counts)
            for low, high, counts in zip(confusion.edges[:-1], confusion.edges[1:], confusion.counts, strict=True)
        ]
    return matrices

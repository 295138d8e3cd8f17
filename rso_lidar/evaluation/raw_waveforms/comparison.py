"""Waveforms of a recording beside those of a simulated camera: noise, pulse shape and saturation."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from rso_lidar import units
from rso_lidar.detector import simulate_long_traces
from rso_lidar.errors import ScenarioError
from rso_lidar.evaluation.raw_waveforms.pixset import GAINS, read_pixset
from rso_lidar.evaluation.raw_waveforms.waveform_set import RawWaveforms
from rso_lidar.evaluation.raw_waveforms.waveform_statistics import LAGS, WaveformStatistics, measure_waveforms
from rso_lidar.files import align_columns, check_writable, write_text
from rso_lidar.picture import FIGURE_SUFFIXES, LIGHT, Scheme, figures, html_page, save_figure
from rso_lidar.scenario import Lidar

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_SAME_CLOCK = 0.01  # relative difference of the times between samples that counts as none
_TRACES = 2048  # simulated waveforms: half below saturation, half above
_ROWS: tuple[tuple[str, str, Callable[[WaveformStatistics], float]], ...] = (
    ("waveforms", "", lambda s: s.traces),
    ("time between samples", "ns", lambda s: s.sample_s / units.NS),
    ("noise, rms", "counts", lambda s: s.noise_counts),
    ("noise, excess kurtosis", "", lambda s: s.noise_kurtosis),
    ("noise, samples until correlation 0.5", "", lambda s: _find_half(s.noise_correlation)),
    ("pulses that do not clip", "", lambda s: s.pulses),
    ("full width at half maximum", "ns", lambda s: s.fwhm_s / units.NS),
    ("rise, 10 to 90 %", "ns", lambda s: s.rise_s / units.NS),
    ("fall, 90 to 10 %", "ns", lambda s: s.fall_s / units.NS),
    ("waveforms that clip", "", lambda s: s.clipped),
    ("clip level over noise", "", lambda s: s.clip_over_noise),
    ("from the last clipped sample to half", "ns", lambda s: s.recovery_s / units.NS),
)


@dataclass(frozen=True, eq=False)
class WaveformComparison:
    """Statistics of the waveforms of a recording, and of a camera's simulated chain.

    `recording` is the name of the recording, and `measured` has the statistics of its gains. `simulated` are those of the
    simulated camera, below and above saturation. `gain_ratio` is the median amplitude of a return in the higher gain over
    that in the lower, NaN where none is whole in both. `SUFFIXES` are those of the files that `save` writes.
    """

    SUFFIXES: ClassVar[tuple[str, ...]] = (".html", *FIGURE_SUFFIXES)

    recording: str
    measured: tuple[WaveformStatistics, ...]
    simulated: WaveformStatistics
    gain_ratio: float

    def shape_difference(self, measured: WaveformStatistics) -> float:
        """Return the rms difference of a measured mean pulse from the simulated, over their peak, both as wide.

        Parameters
        ----------
        measured : one of `measured`
        """
        return float(np.sqrt(np.mean((measured.shape - self.simulated.shape) ** 2)))

    def rows(self) -> list[tuple[str, ...]]:
        """Return the table: heads, then each quantity with its values and its unit."""
        columns = [*self.measured, self.simulated]
        rows = [("", *(column.name for column in columns), "unit")]
        rows += [(name, *(_format(read(column)) for column in columns), unit) for name, unit, read in _ROWS]
        different = [_format(self.shape_difference(column)) for column in self.measured]
        rows.append(("shape, rms difference over the peak", *different, "", ""))
        return [*rows, ("amplitude, high over low gain", *[_format(self.gain_ratio)], *[""] * len(columns))]

    def table(self) -> str:
        """Return the table as text."""
        return "\n".join(align_columns(self.rows(), left=(0, len(self.measured) + 2)))

    def figure(self) -> Figure:
        """Return the figure of noise correlation and pulse shape."""
        small = ("Noise: before the light. Pulse: mean of the narrowest quarter, over their peak and width.",)
        figure = figures.new_figure(figures.PAGE_IN, 4.4, f"Waveforms of {self.recording}", "", small)
        noise, pulse = figure.subplots(1, 2)
        for number, column in enumerate([self.simulated, *self.measured]):
            style: dict[str, Any] = {
                "color": figures.colour_of(number)[0],
                "lw": figures.LINE_PT
                if number
                else figures.WIDE_PT,  # the simulated curve lies below the measured ones
                "ls": "--" if number else "-",
                "label": column.name,
            }
            lag_ns = np.arange(LAGS + 1) * column.sample_s / units.NS
            noise.plot(lag_ns, [1.0, *column.noise_correlation], marker="o", ms=3, **style)
            pulse.plot(column.shape_s / max(column.fwhm_s, 1e-30), column.shape, **style)
        figures.style_axes(noise, "Noise", "Time between samples [ns]", "Correlation")
        figures.style_axes(pulse, "Pulse", "Time from the peak [full widths]", "Over the peak")
        figures.draw_legend(noise)
        return figure

    def save(self, path: str | Path, *, overwrite: bool = False, scheme: Scheme = LIGHT) -> Path:
        """Write the comparison as a page (.html) or its picture alone (.png, .pdf, .svg).

        Parameters
        ----------
        path : of the output
        overwrite : whether an existing file may be replaced
        scheme : `LIGHT` or `DARK`

        Returns
        -------
        Path

        Raises
        ------
        RecordingError
            For another suffix, a file that exists already, or a place that may not be written.
        """
        place = check_writable(path, self.SUFFIXES, overwrite=overwrite)
        if place.suffix.lower() != ".html":
            return save_figure(self.figure(), place, scheme=scheme)
        title = f"Waveforms of {self.recording}"
        head, *rows = self.rows()
        heads = [(escape(name), number > 0) for number, name in enumerate(head)]
        body = [
            f"<h1>{escape(title)}</h1>",
            html_page.embed_figure(self.figure(), "correlation of the noise, and shape of the pulse", scheme=scheme),
            html_page.write_table(heads, [tuple(map(escape, row)) for row in rows]),
        ]
        return write_text(place, html_page.write_page(title, body, scheme), overwrite=overwrite)


def compare_waveforms(recording: str | Path, lidar: Lidar, *, flashes: int = 20) -> WaveformComparison:
    """Compare the waveforms of a PixSet recording with those of a simulated camera.

    Parameters
    ----------
    recording : folder of a PixSet recording, or its file of waveforms
    lidar : of type `gsfl`, with the pulse and the time between samples of the recorded camera
    flashes : most flashes of the recording to read

    Returns
    -------
    WaveformComparison

    Raises
    ------
    ScenarioError
        If the recording cannot be read, or the detector has no waveforms or another time between samples.
    """
    sets = list(read_pixset(recording, flashes=flashes))
    measured = tuple(measure_waveforms(f"{gain} gain", [raw for raw in sets if raw.gain == gain]) for gain in GAINS)
    dark_samples = min(raw.dark_samples for raw in sets)
    waveforms, dark_samples = simulate_long_traces(lidar.detector, lidar.pulse, _TRACES, dark_samples)
    recorded_s, own_s = measured[0].sample_s, lidar.detector.traits.clock_s
    if not math.isclose(recorded_s, own_s, rel_tol=_SAME_CLOCK):
        raise ScenarioError(
            f"{recording}: has samples every {recorded_s / units.NS:.4g} ns, and the camera every {own_s / units.NS:.4g}; "
            f"set lidar.detector.readout.sample_ns={recorded_s / units.NS:.4g}"
        )
    simulated = RawWaveforms(
        "simulated", waveforms.samples_counts.astype(float), waveforms.sample_s, waveforms.start_s, dark_samples
    )
    name = Path(recording).resolve()
    return WaveformComparison(
        name.name if name.is_dir() else name.stem,
        measured,
        measure_waveforms("simulated", [simulated]),
        _measure_gain_ratio(sets, measured),
    )


def _measure_gain_ratio(sets: Sequence[RawWaveforms], measured: Sequence[WaveformStatistics]) -> float:
    """Return the median amplitude in the high gain over that in the low, of returns clear in low and whole in high."""
    ratios = []
    for low, high in zip(sets[::2], sets[1::2], strict=True):
        n = min(len(low.samples_counts), len(high.samples_counts))
        tops = [
            raw.samples_counts[:n].max(axis=1) - raw.samples_counts[:n, : raw.dark_samples].mean(axis=1)
            for raw in (low, high)
        ]
        clear = tops[0] > 20.0 * measured[0].noise_counts
        whole = tops[1] < (0.95 * measured[1].clip_counts if math.isfinite(measured[1].clip_counts) else math.inf)
        ratios.append(tops[1][clear & whole] / tops[0][clear & whole])
    together = np.concatenate(ratios)
    return float(np.median(together)) if len(together) else math.nan


def _find_half(correlation: np.ndarray) -> float:
    """Return the lag, interpolated, at which a correlation has fallen to a half; NaN if it stays above."""
    values = np.concatenate([[1.0], correlation])
    below = np.flatnonzero(values <= 0.5)
    if not len(below):
        return math.nan
    k = int(below[0])
    return float(k - (0.5 - values[k]) / (values[k - 1] - values[k]))


def _format(value: float) -> str:
    """Write a number with four digits, and nothing for NaN."""
    return "–" if math.isnan(value) else f"{value:,.0f}" if value == int(value) else f"{value:.4g}"

"""One pixel of a frame: what was there, what was measured, and its waveform from light to fitted pulse."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from rso_lidar.detector import Pulse
from rso_lidar.picture import find_part_name
from rso_lidar.records import Frame
from rso_lidar.scenario import Lidar
from rso_lidar.units import NS, RANGE_PER_DELAY_M_S


@dataclass(frozen=True, eq=False)
class PixelReport:
    """What is known of one pixel of a frame.

    `numbers` are pairs of a name and a value in words. `curves` are parts of the waveform by name, each (n, 2): time since
    emission [ns] and counts, or photoelectrons per step. `instants_ns` are the trigger, the truth and the reported return
    [ns since emission]. `note` says why there are no curves.
    """

    numbers: tuple[tuple[str, str], ...]
    curves: dict[str, np.ndarray]
    instants_ns: dict[str, float]
    note: str = ""


def report_pixel(frame: Frame, lidar: Lidar, pixel: tuple[int, int]) -> PixelReport:
    """Report one pixel.

    Parameters
    ----------
    frame : made with "waveforms" and "taps" kept, where its detector has them
    lidar : settings in force
    pixel : row and column

    Returns
    -------
    PixelReport
    """
    labels, number = frame.labels, pixel[0] * frame.valid.shape[1] + pixel[1]
    target, part, true_m = int(labels.target[pixel]), int(labels.part[pixel]), float(labels.range_m[pixel])
    measured_m, counts = float(frame.range_m[pixel]), int(frame.intensity_counts[pixel])
    there, valid = target >= 0, bool(frame.valid[pixel])
    clipped = ", saturated" if frame.saturated[pixel] else ""
    numbers = (
        ("Photons expected", f"{float(labels.photons[pixel]):,.1f}"),
        ("Target", frame.source.targets[target].name if there else "sky"),
        ("Part", find_part_name(frame, target, part) if there else "none"),
        ("True range", f"{true_m:,.3f} m" if there else "none"),
        ("Measured range", f"{measured_m:,.3f} m" if valid else "no return"),
        ("Error", f"{100.0 * (measured_m - true_m):+,.1f} cm" if there and valid else "none"),
        ("Intensity", f"{counts:,} counts{clipped}" if valid else "none"),
        ("Cosine of incidence", f"{float(labels.cos_incidence[pixel]):.3f}" if there else "none"),
        ("Clusters", f"{int(labels.cluster_count[pixel])}"),
    )
    instants = {"truth": true_m / RANGE_PER_DELAY_M_S / NS, "reported": measured_m / RANGE_PER_DELAY_M_S / NS}
    curves: dict[str, np.ndarray] = {}
    waveforms: Any = frame.kept.get("waveforms")
    taps: Any = frame.kept.get("taps")
    detector: Any = lidar.detector
    if waveforms is None:
        kind = getattr(detector, "type", type(detector).__name__)
        return PixelReport(numbers, {}, {}, f'The detector "{kind}" stores no waveforms.')
    trace = np.flatnonzero(waveforms.pixel == number)
    if not trace.size:
        return PixelReport(numbers, {}, {}, "No signal passed the threshold: the pixel stored no samples.")
    k = int(trace[0])
    samples = waveforms.samples_counts[k]
    time_s = waveforms.start_s[k] + waveforms.sample_s * np.arange(len(samples))
    curves["samples"] = np.column_stack([time_s / NS, samples])
    instants["trigger"] = float(waveforms.latch_s[k]) / NS
    base, gain = waveforms.baseline_counts, detector.readout.electrons_per_count
    which = np.flatnonzero(taps.pixel == number) if taps is not None else np.zeros(0, int)
    if taps is not None and len(which):
        at = int(which[0])
        fine_ns = (taps.start_s[at] + taps.step_s * np.arange(taps.primaries.shape[1])) / NS
        curves["amplifier"] = np.column_stack([fine_ns, base + taps.amplitude_electrons[at] / gain])
        curves["light (photoelectrons per step)"] = np.column_stack([fine_ns, taps.primaries[at]])
        level = base + float(taps.threshold_electrons[at]) / gain
        curves["threshold"] = np.array([[fine_ns[0], level], [fine_ns[-1], level]])
    if valid:
        step_s, power = lidar.laser.pulse
        pulse = Pulse.after(step_s, power, detector.amplifier.pole_s, detector.amplifier.integration_s)
        fine_s = np.linspace(time_s[0], time_s[-1], 400)
        shape = pulse.amplitude(fine_s - measured_m / RANGE_PER_DELAY_M_S) / pulse.peak
        curves["reported pulse"] = np.column_stack(
            [fine_s / NS, base + counts * detector.readout.counts_per_intensity * shape]
        )
    return PixelReport(numbers, curves, {name: at for name, at in instants.items() if np.isfinite(at)})

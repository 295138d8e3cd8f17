"""Draw the figures of the pages in docs: ``python docs/figures.py`` writes docs/pictures/.

Each is written twice: NAME.png on white and NAME_dark.png on a dark page. It takes a minute or two on one core. Every curve
of the instrument is what the detector's chain makes of a plate on the bench, with fixed seeds; nothing is drawn from a
formula but what says so. A name or two on the command line draws these figures only.
"""

from __future__ import annotations

import datetime
import math
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import rso_lidar as rl
from rso_lidar import picture, units
from rso_lidar.detector import Pulse, Trial, detect, make_plate, make_point_returns, run_trial
from rso_lidar.detector.analysis.array_load import simulate_array_load
from rso_lidar.detector.bench.calibration import REFERENCE_FWHM_S, make_reference_pulse
from rso_lidar.detector.bench.range_resolution import simulate_pairs
from rso_lidar.detector.chain.analog import simulate_analog
from rso_lidar.detector.chain.camera import camera_of
from rso_lidar.detector.chain.measurement import measure
from rso_lidar.detector.chain.traces import arm_rows, latch_rows
from rso_lidar.detector.ranging.location import Locator, locate
from rso_lidar.detector.ranging.pulse import crlb_s, noise_covariance
from rso_lidar.detector.settings.apd import noise_rms
from rso_lidar.detector.stages.crossing_rate import false_alarm_rate, rice_rate
from rso_lidar.detector.stages.sampling import convert
from rso_lidar.detector.stages.time_axis import place_rows
from rso_lidar.evaluation import CurvesFile, fit_camera
from rso_lidar.evaluation.camera_calibration.fit_report import draw_camera_fit
from rso_lidar.mission_analysis import fly_open_loop
from rso_lidar.optics.rays.contour_images import cut_contours, image_contours
from rso_lidar.picture import colour_maps, figures, palette
from rso_lidar.picture.style.output import save_small_figure
from rso_lidar.pose import Link, PoseTree
from rso_lidar.records import Photons, Rays, Truth, Waveforms
from rso_lidar.rpo import clohessy_wiltshire
from rso_lidar.sampling import cast_pixels
from rso_lidar.scenario import build_whole_surface
from rso_lidar.scene import render_portrait
from rso_lidar.shipped import shipped

FOLDER = Path(__file__).resolve().parent / "pictures"
STILL = rl.detector.Timing(pixel_jitter_ns=0.0)
ALGORITHMS = {
    "matched_filter": palette.BLUE,
    "constant_fraction": palette.ORANGE,
    "centroid": palette.GREEN,
    "parabola": palette.PINK,
    "leading_edge": palette.RED,
}
NEAREST_FRAME = 539  # the last of tdrs_approach: its target at 300 m
CM = units.RANGE_PER_DELAY_M_S / units.CM  # a delay in seconds as a range in cm


def seen(
    detector: Any, photons: float, n: int, seed: int = 0, pulse_fwhm_ns: float = 8.0, range_m: float = 3000.0
) -> Trial:
    """Return what `n` pixels of a detector make of so many photons."""
    laser = rl.Laser(pulse_fwhm_ns=pulse_fwhm_ns)
    rng = np.random.Generator(np.random.Philox(np.random.SeedSequence(20_240_917, spawn_key=(seed, round(photons)))))
    return run_trial(detector, make_plate(photons, n, laser.pulse, laser.pulse_fwhm_s, range_m), rng)


def binomial_bars(found: int, n: int) -> tuple[float, float, float]:
    """Return share and the two lengths of its 95 % interval (Wilson 1927)."""
    z2, share = 1.96**2, found / n
    middle = (share + 0.5 * z2 / n) / (1.0 + z2 / n)
    half = 1.96 * math.sqrt(share * (1.0 - share) / n + 0.25 * z2 / n**2) / (1.0 + z2 / n)
    return share, max(share - middle + half, 0.0), max(middle + half - share, 0.0)


def key(axes: Any, where: str = "best", **more: Any) -> None:
    """Put a legend in quiet ink."""
    axes.legend(fontsize=figures.SMALL_PT, frameon=False, loc=where, labelcolor=palette.QUIET, **more)


# --------------------------------------------------------------------------------------------------------- figures


def counts() -> Any:
    """Return photons to counts, and how they scatter (Fuller et al., fig. 13)."""
    figure = figures.new_figure(
        9.6, 4.4, "Photons to counts",
        "default detector, 8 ns pulse on a facing plate; compare Fuller et al., fig. 13",
    )  # fmt: skip
    mean_of, noise_of = figure.subplots(1, 2)
    levels = np.geomspace(900, 1e6, 28)
    kinds = {
        "default: the converter clips": (rl.Gsfl(), palette.BLUE),
        "amplifier saturates first (saturation on)": (rl.Gsfl(saturation=rl.detector.Saturation()), palette.ORANGE),
    }
    for label, (detector, colour) in kinds.items():
        trials = [seen(detector, level, 1500).intensity_counts for level in levels]
        mean = np.array([one.mean() for one in trials])
        spread = np.array([one.std() for one in trials])
        mean_of.plot(levels, mean, ".-", color=colour, label=label, ms=4, lw=figures.LINE_PT)
        noise_of.plot(levels, spread, ".-", color=colour, label=label, ms=4, lw=figures.LINE_PT)
    fast = rl.Empirical()
    mean_of.plot(
        levels,
        fast.counts(levels),
        "--",
        color=palette.INK,
        lw=figures.THIN_PT,
        label="empirical, fitted to the default",
    )
    mean_of.set(xscale="log", yscale="log")
    noise_of.set(xscale="log", ylim=(0, None))
    figures.format_thousands(mean_of.xaxis, mean_of.yaxis, noise_of.xaxis)
    figures.style_axes(mean_of, "Mean", x="Photons on the pixel", y="Intensity [counts]")
    figures.style_axes(noise_of, "Standard deviation", x="Photons on the pixel", y="[counts]")
    key(mean_of)
    key(noise_of)
    return figure


def detection() -> Any:
    """Return the probability of detection over photons."""
    figure = figures.new_figure(
        9.6, 4.4, "Probability of detection",
        "share of 4000 pixels that report the plate, with 95 % intervals (Wilson); 1000 photons, 95 %: Fuller et al.",
    )  # fmt: skip
    by_preset, by_pulse = figure.subplots(1, 2, sharey=True)
    levels, n = np.arange(500, 1301, 50), 4000

    def draw(axes: Any, detector: Any, colour: str, label: str, pulse_fwhm_ns: float = 8.0) -> None:
        found = [int(seen(detector, level, n, 1, pulse_fwhm_ns).detected.sum()) for level in levels]
        share, low, high = np.array([binomial_bars(count, n) for count in found]).T
        axes.errorbar(
            levels, share, [low, high], fmt=".-", color=colour, ms=4, lw=figures.THIN_PT, capsize=2, label=label
        )

    draw(by_preset, rl.Gsfl(), palette.BLUE, "noise_limited")
    draw(by_preset, rl.Gsfl(preset="offset_limited"), palette.ORANGE, "offset_limited")
    fast = rl.Empirical().detection_probability(levels.astype(float))
    by_preset.plot(
        levels, fast, "--", color=palette.INK, lw=figures.THIN_PT, label="empirical, fitted to noise_limited"
    )
    for fwhm_ns, colour in ((6.0, palette.GREEN), (8.0, palette.BLUE), (10.0, palette.RED)):
        draw(by_pulse, rl.Gsfl(), colour, f"{fwhm_ns:g} ns", fwhm_ns)
    for axes in (by_preset, by_pulse):
        axes.axhline(0.95, color=palette.RULE, lw=figures.THIN_PT)
        axes.axvline(1000, color=palette.RULE, lw=figures.THIN_PT)
    figures.style_axes(by_preset, "Presets", x="Photons on the pixel", y="Probability of detection")
    figures.style_axes(by_pulse, "Length of the pulse, noise_limited", x="Photons on the pixel")
    figures.format_thousands(by_preset.xaxis, by_pulse.xaxis)
    key(by_preset)
    key(by_pulse)
    return figure


def false_alarms() -> Any:
    """Return how often noise crosses the threshold, Gaussian and with avalanches."""
    figure = figures.new_figure(
        9.6, 4.8, "False alarms of one pixel",
        "Rice's formula for Gaussian noise, and with McIntyre's avalanches of 1 nA of dark current; "
        "dots: the presets' thresholds",
    )  # fmt: skip
    axes = figure.subplots()
    over = np.linspace(3.0, 18.0, 121)
    for preset, style in (("noise_limited", "-"), ("offset_limited", "--")):
        for k, colour in ((0.02, palette.GREEN), (0.2, palette.BLUE), (0.4, palette.RED)):
            detector = rl.Gsfl(preset=preset, apd=rl.detector.Apd(ionisation_ratio=k))
            amplifier, apd = detector.amplifier, detector.apd
            known = {"noise_electrons": amplifier.noise_electrons, "pole_s": amplifier.pole_s}
            rate_per_s = np.array(apd.dark_electrons_per_s)
            sigma = noise_rms(apd, rate_per_s, integration_s=amplifier.integration_s, **known)
            rate = false_alarm_rate(
                over * sigma, apd=apd, rate_per_s=rate_per_s, integration_s=amplifier.integration_s, **known
            )
            rate = np.maximum(rate, 1e-30)
            axes.plot(over, rate, style, color=colour, lw=figures.LINE_PT, label=f"{preset}, k = {k:g}")
            own = detector.threshold_over_noise
            axes.plot(own, np.exp(np.interp(own, over, np.log(rate))), "o", color=colour, ms=5)
    axes.plot(
        over,
        rice_rate(over, 1.0, rl.detector.Amplifier().pole_s),
        color=palette.INK,
        lw=figures.THICK_PT,
        label="Gaussian (Rice)",
    )
    axes.set(yscale="log", ylim=(1e-6, 1e7), xlim=(3, 18.5))
    figures.style_axes(axes, x="Threshold over the rms noise in the dark", y="False alarms of an armed pixel [1/s]")
    key(axes)
    return figure


def precision() -> Any:
    """Return range noise per algorithm: in amplifier noise with the bound, and through the whole chain."""
    figure = figures.new_figure(
        9.6, 4.6, "Range precision",
        "left: samples of a known pulse in the amplifier's noise alone; right: the whole chain, preset noise_limited",
    )  # fmt: skip
    bench, whole = figure.subplots(1, 2)
    pulse, sample_s, pole_s, sigma = _pulse(), rl.detector.Readout().sample_s, rl.detector.Amplifier().pole_s, 5.0
    covariance = noise_covariance(20, sample_s, pole_s, sigma)
    root, rng, n = np.linalg.cholesky(covariance), np.random.Generator(np.random.Philox(46)), 4000
    snrs = np.geomspace(5, 200, 12)
    phase = (np.arange(n) + 0.5) / n - 0.5
    time_s = (np.arange(20) - 10 - phase[:, None]) * sample_s + pulse.peak_s
    clean, start = pulse.amplitude(time_s) / pulse.peak, np.full(n, 8)
    noise = np.einsum("ij,nj->ni", root, rng.standard_normal((n, 20)))
    truth = (10 + phase) * sample_s - pulse.peak_s
    known = {"sample_s": sample_s, "sigma_counts": sigma, "pole_s": pole_s}
    for name, colour in ALGORITHMS.items():
        spread = []
        for snr in snrs:
            samples = (snr * sigma * clean + noise).astype(np.float32)
            ranging = rl.detector.Ranging(algorithm=name)
            found, _ = locate(samples, start, Locator.of(pulse, ranging, threshold_counts=2.5 * sigma, **known))
            spread.append(np.nanstd((found - truth) * CM))
        bench.plot(snrs, spread, ".-", color=colour, ms=4, lw=figures.LINE_PT, label=name)
    bound = [
        math.sqrt(
            np.mean([crlb_s(pulse, snr * sigma, sample_s, covariance, p) ** 2 for p in np.linspace(-0.5, 0.5, 9)])
        )
        for snr in snrs
    ]
    bench.plot(snrs, np.array(bound) * CM, color=palette.INK, lw=figures.THICK_PT, label="Cramér–Rao bound")
    levels = np.geomspace(700, 60_000, 12)
    for name, colour in ALGORITHMS.items():
        detector = rl.Gsfl(timing=STILL, ranging=rl.detector.Ranging(algorithm=name, walk_correction=True))
        spread = [seen(detector, level, 1500, 2).range_noise_m / units.CM for level in levels]
        whole.plot(levels, spread, ".-", color=colour, ms=4, lw=figures.LINE_PT)
    spread = [seen(rl.Gsfl(), level, 4000, 3).range_noise_m / units.CM for level in levels]
    whole.plot(
        levels, spread, "--", color=palette.BLUE, lw=figures.THICK_PT, label="matched_filter, default jitter: 5 cm"
    )
    for axes in (bench, whole):
        axes.set(xscale="log", yscale="log")
        figures.format_thousands(axes.xaxis, axes.yaxis)
    figures.style_axes(bench, "Amplifier noise alone", x="Amplitude over rms noise", y="Range, 1 sigma [cm]")
    figures.style_axes(
        whole, "Whole chain, jitter off, walk corrected", x="Photons on the pixel", y="Range, 1 sigma [cm]"
    )
    key(bench)
    key(whole)
    return figure


def _pulse() -> Pulse:
    step_s, power = make_reference_pulse()
    amplifier = rl.detector.Amplifier()
    return Pulse.after(step_s, power, amplifier.pole_s, amplifier.integration_s)


def walk() -> Any:
    """Return the bias of range over photons, raw and corrected."""
    figure = figures.new_figure(
        9.6, 4.6, "Range walk",
        "mean error over 2000 pixels, jitter off, with 95 % intervals; linear within 5 cm; "
        "beyond 100,000 photons the converter clips",
    )  # fmt: skip
    from matplotlib.ticker import NullLocator

    both = figure.subplots(1, 2, sharey=True)
    levels = np.geomspace(800, 400_000, 16)
    for axes, corrected in zip(both, (False, True), strict=True):
        for name, colour in ALGORITHMS.items():
            ranging = rl.detector.Ranging(algorithm=name, walk_correction=corrected)
            detector = rl.Gsfl(timing=STILL, ranging=ranging)
            trials = [seen(detector, level, 2000, 4) for level in levels]
            bias = np.array([one.range_bias_m for one in trials]) / units.CM
            bar = [1.96 * one.range_error_m.std() / math.sqrt(len(one.range_error_m)) / units.CM for one in trials]
            axes.errorbar(levels, bias, bar, fmt=".-", color=colour, ms=4, lw=figures.LINE_PT, label=name)
        axes.axhline(0.0, color=palette.INK, lw=figures.THIN_PT)
        axes.set(xscale="log", ylim=(-160, 100))
        axes.set_yscale("symlog", linthresh=5.0, linscale=1.2)
        axes.set_yticks([-100, -50, -20, -10, -5, -2, 0, 2, 5, 10, 20, 50])
        axes.yaxis.set_minor_locator(NullLocator())
        figures.format_thousands(axes.xaxis, axes.yaxis)
    figures.style_axes(both[0], "Raw", x="Photons on the pixel", y="Range minus truth [cm]")
    figures.style_axes(both[1], "walk_correction = true", x="Photons on the pixel")
    key(both[1], "lower left")
    return figure


def strong_returns() -> Any:
    """Return the walk of readouts for strong returns over 1 : 250,000 in light, and the counts of one gain and of two."""
    from matplotlib.ticker import NullLocator

    figure = figures.new_figure(
        9.6, 4.8, "Strong returns",
        "facing plates that fill 512 pixels, 8 ns pulse, jitter off; bands: 1 sigma of a pixel",
    )  # fmt: skip
    bias, heights = figure.subplots(1, 2)
    laser, low = rl.Laser(), rl.detector.LowGain()
    pulse = rl.detector.LaserPulse(*laser.pulse, laser.pulse_fwhm_s)
    kinds = {
        "default, 20 samples": (rl.Gsfl(timing=STILL), palette.BLUE),
        "40 samples": (rl.Gsfl(timing=STILL, readout=rl.detector.Readout(samples=40)), palette.GREEN),
        "two gains, 64 : 1": (rl.Gsfl(timing=STILL, readout=rl.detector.Readout(low_gain=low)), palette.ORANGE),
        "zero crossing": (rl.Gsfl(timing=STILL, zero_crossing=rl.detector.ZeroCrossing()), palette.RED),
    }
    for label, (detector, colour) in kinds.items():
        curve = rl.detector.simulate_walk_curve(detector, pulse, pixels=512)
        middle, spread = curve.bias_m / units.CM, curve.noise_m / units.CM
        bias.fill_between(curve.photons, middle - spread, middle + spread, color=colour, alpha=0.15, lw=0)
        bias.plot(curve.photons, middle, ".-", color=colour, ms=4, lw=figures.LINE_PT, label=label)
        if label.startswith(("default", "two")):
            trials = [seen(detector, level, 64).intensity_counts.mean() for level in curve.photons]
            unit = detector.readout.counts_per_intensity
            name = f"{label.partition(',')[0]}: {unit} converter count{'s' * (unit > 1)} in one"
            heights.plot(curve.photons, trials, ".-", color=colour, ms=4, lw=figures.LINE_PT, label=name)
    bias.axhline(0.0, color=palette.INK, lw=figures.THIN_PT)
    bias.set(xscale="log", ylim=(-60, 60))
    bias.set_yscale("symlog", linthresh=1.0, linscale=0.6)
    bias.set_yticks([-50, -20, -10, -5, -2, -1, 0, 1, 2, 5, 10, 20, 50])
    bias.yaxis.set_minor_locator(NullLocator())
    heights.set(xscale="log", yscale="log")
    figures.format_thousands(bias.yaxis, heights.yaxis)
    figures.style_axes(bias, "Range walk over 1 : 250,000", x="Photons on the pixel", y="Range minus truth [cm]")
    figures.style_axes(heights, "Intensity", x="Photons on the pixel", y="Intensity [counts]")
    key(bias, "lower left")
    key(heights)
    return figure


def pixel() -> Any:
    """Return the life of one pixel at an edge, stage by stage."""
    figure = figures.new_figure(
        9.6, 8.2, "One pixel at an edge, from light to two ranges",
        "2500 photons from 100.0 m and 4000 from 102.6 m in one pixel; preset noise_limited, max_returns = 2, jitter off",
    )  # fmt: skip
    detector = rl.Gsfl(max_returns=2, timing=STILL)
    photons = _edge((100.0, 102.6), (2500.0, 4000.0))
    rng = np.random.Generator(np.random.Philox(9))
    camera = camera_of(detector, photons)
    plan, front, comparators = camera.plan(0.0), camera.front, camera.comparators
    rows, arming = arm_rows(comparators, place_rows(photons, plan), plan.step_s)
    axis, per = camera.axis(rows.length), plan.steps_per_sample
    made = simulate_analog(front, axis, photons, rows, rng)
    threshold = np.array([detector.trigger.threshold_electrons * front.pixels.threshold[0]], np.float32)
    base, before = front.base_rate_per_s(photons)[rows.pixel], detector.readout.pretrigger_samples * per
    latch = float(latch_rows(comparators, axis, made, threshold[rows.pixel], base, arming, before, rng)[0])
    sample = math.floor((rows.start[0] + latch) / per) - detector.readout.pretrigger_samples
    at = sample * per - rows.start[0] + per * np.arange(detector.readout.samples)
    samples = convert(detector.readout, made.amplitude[0, at])[None]
    waveforms = Waveforms(
        shape=(1, 1),
        sample_s=detector.readout.sample_s,
        baseline_counts=detector.readout.baseline_counts,
        pixel=np.zeros(1, int),
        start_s=np.array([sample * detector.readout.sample_s]),
        latch_s=np.array([(rows.start[0] + latch) * plan.step_s]),
        samples_counts=samples,
    )
    reading = measure(camera.processor, waveforms, rng)

    light, current, voltage, stored = figure.subplots(4, 1, sharex=True)
    range_m = (rows.start[0] + np.arange(rows.length)) * plan.step_s * units.RANGE_PER_DELAY_M_S
    light.stem(
        range_m[made.light[0] > 1.0],
        made.light[0][made.light[0] > 1.0],
        basefmt=" ",
        linefmt=palette.BLUE,
        markerfmt=".",
    )
    figures.style_axes(
        light, "Light", y="Photons", note="expected, each return as a flash of no length, shared among steps"
    )
    current.plot(
        range_m,
        detector.apd.gain * made.primaries[0],
        color=palette.INK,
        lw=figures.LINE_PT,
        label="gain × expected photoelectrons",
    )
    current.step(
        range_m,
        made.electrons[0],
        where="mid",
        color=palette.ORANGE,
        lw=figures.LINE_PT,
        label="drawn: Poisson, avalanche, dark current",
    )
    figures.style_axes(current, "APD", y="Electrons in a step", note=f"steps of {plan.step_s / units.NS:.2f} ns")
    key(current)
    voltage.plot(range_m, made.mean()[0], color=palette.INK, lw=figures.THIN_PT, label="without noise")
    voltage.plot(range_m, made.amplitude[0], color=palette.BLUE, lw=figures.LINE_PT, label="amplitude")
    voltage.axhline(threshold[0], color=palette.RED, lw=figures.THIN_PT, ls="--", label="threshold of this pixel")
    voltage.axvline(
        np.interp(latch, np.arange(rows.length), range_m), color=palette.RED, lw=figures.THIN_PT, label="latch"
    )
    figures.style_axes(voltage, "Amplifier and trigger", y="Electrons")
    key(voltage)
    counts_at = samples[0] - detector.readout.baseline_counts
    stored.plot(range_m[at], counts_at, "o", color=palette.BLUE, ms=4, label="20 samples, less the baseline")
    pulse = camera.pulse
    fine = np.linspace(range_m[at[0]], range_m[at[-1]], 600)
    found_m, height = reading.return_range_m[0, 0], reading.return_intensity_counts[0, 0]
    fit = [
        tall * pulse.amplitude((fine - where) / units.RANGE_PER_DELAY_M_S) / pulse.peak
        for where, tall in zip(found_m.astype(float), height.astype(float), strict=True)
        if np.isfinite(where)
    ]
    for k, one in enumerate(fit):
        stored.plot(fine, one, color=palette.PINK, lw=figures.LINE_PT, ls="--", label="" if k else "the pulses fitted")
    stored.plot(fine, np.sum(fit, axis=0), color=palette.GREEN, lw=figures.LINE_PT, label="and their sum")
    for where in found_m[np.isfinite(found_m)]:
        stored.axvline(where, color=palette.GREEN, lw=figures.THIN_PT)
        stored.text(
            where,
            1.02,
            f"{where:.2f} m",
            transform=stored.get_xaxis_transform(),
            fontsize=figures.SMALL_PT,
            ha="center",
            color=palette.GREEN,
        )
    figures.style_axes(
        stored,
        "Samples and fit",
        x="Two-way delay as a range [m]; the amplifier's own delay shows, and is taken off",
        y="Counts",
    )
    key(stored)
    figures.format_thousands(light.yaxis, current.yaxis, voltage.yaxis)
    stored.set_xlim(range_m[at[0]] - 0.3, range_m[at[-1]] + 0.3)
    figure.align_ylabels([light, current, voltage, stored])
    return figure


def _edge(ranges_m: Sequence[float], photons: Sequence[float]) -> Photons:
    pixel = np.zeros(len(ranges_m), int)
    return make_point_returns(
        (1, 1), make_reference_pulse(), REFERENCE_FWHM_S, pixel, np.array(ranges_m), np.array(photons)
    )


def gate() -> Any:
    """Return detection under a range gate over photons, and at 30 photons over pulses averaged."""
    figure = figures.new_figure(
        9.6, 5.0, "Range gate: what 30 photons take",
        "gate of 47.6 ns, threshold for 0.1 % of false alarms a pixel, avalanches reckoned with; measured in the legend",
    )  # fmt: skip
    single, averaged = figure.subplots(1, 2, sharey=True)
    quiet = rl.detector.Amplifier(noise_electrons=60.0)
    fine = rl.detector.Readout(electrons_per_count=10.0)
    presets = {
        "noise_limited": (rl.Gsfl(), palette.BLUE),
        "offset_limited": (rl.Gsfl(preset="offset_limited"), palette.ORANGE),
        "60 electrons of amplifier noise": (rl.Gsfl(amplifier=quiet, readout=fine), palette.GREEN),
        "the same with 0.01 nA of dark current": (
            rl.Gsfl(amplifier=quiet, readout=fine, apd=rl.detector.Apd(dark_current_na=0.01)),
            palette.PINK,
        ),
    }
    n = 1000
    middle_m = 3000.0
    delay_ns = middle_m / units.RANGE_PER_DELAY_M_S / units.NS - 22.0
    for name, (detector, colour) in presets.items():
        dark = detector.replace(gate=rl.detector.Gate(delay_ns=delay_ns))
        false = seen(dark, 1e-9, 16_384, 5, range_m=middle_m).probability
        label = f"{name}: false alarms {100.0 * false:.1f} %"
        for axes, levels in ((single, np.geomspace(10, 1000, 13)), (averaged, np.array([1, 2, 4, 8, 16, 32, 64]))):
            points = []
            for level in levels:
                pulses, photons = (1, float(level)) if axes is single else (int(level), 30.0)
                gated = detector.replace(gate=rl.detector.Gate(delay_ns=delay_ns, pulses=pulses))
                points.append(
                    binomial_bars(int(seen(gated, photons, n, 5 + pulses, range_m=middle_m).detected.sum()), n)
                )
            share, low, high = np.array(points).T
            axes.errorbar(
                levels, share, [low, high], fmt=".-", color=colour, ms=4, lw=figures.THIN_PT, capsize=2, label=label
            )
    for axes in (single, averaged):
        axes.set(xscale="log", ylim=(-0.03, 1.03))
        figures.format_thousands(axes.xaxis)
    single.axvline(30, color=palette.RULE, lw=figures.THIN_PT)
    figures.style_axes(single, "One pulse", x="Photons on the pixel", y="Probability of detection")
    figures.style_axes(averaged, "30 photons a pulse", x="Pulses averaged")
    lines, labels = single.get_legend_handles_labels()
    figure.legend(
        lines,
        labels,
        loc="outside lower center",
        ncols=2,
        fontsize=figures.SMALL_PT,
        frameon=False,
        labelcolor=palette.QUIET,
    )
    return figure


def droop() -> Any:
    """Return the range error that the droop of two arrays makes, over the pixels that are lit and over the light."""
    figure = figures.new_figure(
        9.6, 4.6, "Range error under droop",
        "128 x 128 pixels, a facing plate, pulse 8 ns, no jitter; error about the true range, bias and noise, rms",
    )  # fmt: skip
    over_lit, over_light = figure.subplots(1, 2)
    lit = np.array([16, 164, 820, 1638, 4096, 8192, 12_288, 16_384])
    for name, gain, colour in (("small_junctions", 20.0, palette.RED), ("large_junctions", 10.0, palette.BLUE)):
        detector = rl.Gsfl(droop=rl.detector.Droop(preset=name), apd={"gain": gain}, timing=STILL)
        bound_cm = (
            CM * math.sqrt(detector.apd.excess_noise_factor / 0.8) * 8.0 * units.NS / math.sqrt(8.0 * math.log(2.0))
        )
        errors = [_drooped_error_cm(detector, n, 20_000.0) for n in lit]
        over_lit.plot(lit, errors, ".-", color=colour, ms=4, lw=figures.LINE_PT, label=f"{name}, gain {gain:g}")
        over_lit.axhline(bound_cm / math.sqrt(20_000.0), color=colour, lw=figures.THIN_PT, ls="--")
        sys.stdout.write(f"{name}, 20,000 photons: {np.round(errors, 2).tolist()} cm at {lit.tolist()} pixels, ")
        sys.stdout.write(f"bound {bound_cm / math.sqrt(20_000.0):.2f} cm\n")
        for share, line in ((1.0, "-"), (0.1, ":")):
            levels = np.geomspace(2000.0, 40_000.0 if gain == 20.0 else 80_000.0, 9)
            ratios = [_drooped_error_cm(detector, round(share * 16_384), n) / (bound_cm / math.sqrt(n)) for n in levels]
            over_light.plot(
                levels, ratios, line, color=colour, lw=figures.LINE_PT, label=f"{name}, {share:.0%} of the pixels lit"
            )
            sys.stdout.write(
                f"{name}, {share:.0%} lit, over bound: {np.round(ratios, 2).tolist()} at {levels.round().tolist()}\n"
            )
    over_lit.set(xscale="log", ylim=(0, None))
    figures.format_thousands(over_lit.xaxis)
    figures.style_axes(over_lit, "20,000 photons a pixel; dashed: bound", x="Pixels lit", y="Range error, rms [cm]")
    key(over_lit, "upper left")
    over_light.axhline(
        2.5 / 0.6, color=palette.INK, lw=figures.THIN_PT, ls="--", label="measured (Appl. Opt. 45, 6154)"
    )
    over_light.set(xscale="log", xlim=(1000, 100_000), ylim=(0, 12))
    figures.format_thousands(over_light.xaxis)
    figures.style_axes(over_light, "Error over the bound of shot noise", x="Photons on each lit pixel", y="Ratio")
    key(over_light, "upper left")
    return figure


def _drooped_error_cm(detector: Any, n_lit: int, photons: float) -> float:
    """Return the rms range error of a frame [cm] in which so many of 128 x 128 pixels see a plate at 50 m."""
    laser, pixel = rl.Laser(), np.arange(n_lit) * 16_384 // n_lit
    range_m = 50.0 + 0.05 * np.random.default_rng(1).random(n_lit)  # a twentieth of the pulse: charges flow together
    light = make_point_returns(
        (128, 128), laser.pulse, laser.pulse_fwhm_s, pixel, range_m, np.full(n_lit, photons), np.inf
    )
    threshold = rl.detector.Trigger(threshold_electrons=625.0 * detector.apd.gain)  # of as many photons at each gain
    armed = detector.replace(trigger=threshold, armed_from_m=46.0, armed_to_m=60.0)
    frames = [
        detect(light, armed, np.random.default_rng(seed))[0].range_m.ravel()[pixel]
        for seed in range(20 if n_lit < 1000 else 1)
    ]
    return float(np.sqrt(np.nanmean((np.array(frames) - range_m) ** 2))) / units.CM


def shared() -> Any:
    """Return what droop and crosstalk do against light and against the share of the array that is lit."""
    figure = figures.new_figure(
        9.6, 4.6, "What the pixels of a flash do to each other",
        "128 x 128 pixels, a facing plate at 50 m in some of them, Droop() and Crosstalk() with their defaults",
    )  # fmt: skip
    sag, scatter = figure.subplots(1, 2)
    levels, n = np.geomspace(1000, 100_000, 7), 128 * 128
    for share, colour in ((1.0, palette.RED), (0.25, palette.ORANGE), (0.05, palette.BLUE)):
        lit = np.flatnonzero(np.arange(n) % round(1.0 / share) == 0)
        loads = [simulate_array_load(rl.Gsfl(droop=rl.detector.Droop()), _flat(lit, level)) for level in levels]
        lost = [100.0 * (1.0 - one.gain[lit].mean()) for one in loads]
        sag.plot(levels, lost, ".-", color=colour, ms=4, lw=figures.LINE_PT, label=f"{share:.0%} of the array is lit")
        sys.stdout.write(
            f"droop, {share:.0%} lit: {np.round(lost, 2).tolist()} % at {levels.round().tolist()} photons\n"
        )
    sag.set(xscale="log", yscale="log", ylim=(0.002, 50.0))
    figures.format_thousands(sag.xaxis)
    figures.style_axes(sag, "Droop: gain lost, mean over the pulse", x="Photons on each lit pixel", y="Lost [%]")
    key(sag)
    shares = np.array([0.01, 0.1, 0.25, 0.5, 0.75, 1.0])
    for name, detector, colour in (
        ("default jitter, Crosstalk()", rl.Gsfl(crosstalk=rl.detector.Crosstalk()), palette.BLUE),
        ("default jitter alone", rl.Gsfl(), palette.GREEN),
    ):
        spread = []
        for share in shares:
            lit = np.flatnonzero(np.modf(np.arange(n) * share)[0] < share)
            reading, _ = detect(_flat(lit, 30_000.0), detector, np.random.Generator(np.random.Philox(5)))
            low, high = np.quantile(reading.range_m.ravel()[lit], [0.25, 0.75])
            spread.append((high - low) / 1.349 / units.CM)
        scatter.plot(shares, spread, ".-", color=colour, ms=4, lw=figures.LINE_PT, label=name)
        sys.stdout.write(f"{name}: {np.round(spread, 2).tolist()} cm at {shares.tolist()}\n")
    scatter.plot([0.5], [8.04], "D", color=palette.INK, ms=6, label="published (Opt. Eng. 60, 083101)")
    scatter.set(ylim=(0, 16), xlim=(0, 1.03))
    figures.style_axes(scatter, "Crosstalk: range, 1 sigma", x="Share of the array that latches together", y="[cm]")
    key(scatter, "upper left")
    return figure


def neighbours() -> Any:
    """A satellite in one frame without and with crosstalk in amplitude, and the row of its brightest pixel."""
    from matplotlib.colors import LogNorm

    scenario = _load_approach()
    figure = figures.new_figure(
        9.6, 4.4, "Crosstalk in amplitude",
        "tdrs_approach at its nearest, one frame with the same noise: Gsfl() without and with amplitude_crosstalk = {}",
    )  # fmt: skip
    *images, profile = figure.subplots(1, 3, width_ratios=(1.0, 1.0, 1.25))
    parts = (None, rl.detector.AmplitudeCrosstalk())
    frames = [_fly_nearest(scenario, amplitude_crosstalk=part) for part in parts]
    row, col = np.unravel_index(np.argmax(frames[0].labels.photons), frames[0].range_m.shape)
    left, top = min(col - 32, 128 - 64) - 0.5, min(row - 32, 128 - 64) - 0.5
    for frame, axes, name in zip(frames, images, ("without", "with"), strict=True):
        counts = np.where(frame.valid, frame.intensity_counts, np.nan)
        shown = axes.imshow(counts, cmap=colour_maps.AMOUNT_RAMP, norm=LogNorm(20.0, 4100.0), interpolation="none")
        axes.set(xlim=(left, left + 64), ylim=(top + 64, top), xticks=[], yticks=[])
        figures.style_axes(axes, name, note=f"{int(frame.valid.sum()):,} pixels report")
        axes.grid(visible=False)
    bar = figure.colorbar(shown, ax=images, shrink=0.8, pad=0.01)
    figures.style_bar(bar, "Counts")
    threshold = (
        scenario.lidar.detector.trigger.threshold_electrons / scenario.lidar.detector.readout.electrons_per_count
    )
    for frame, colour, name in zip(frames, (palette.BLUE, palette.ORANGE), ("without", "with"), strict=True):
        counts = np.where(frame.valid[row], frame.intensity_counts[row], np.nan)
        profile.plot(counts, ".-", color=colour, ms=4, lw=figures.THIN_PT, label=name)
        sys.stdout.write(f"crosstalk in amplitude, {name}: {int(frame.valid.sum())} pixels report\n")
    profile.axhline(threshold, color=palette.RED, lw=figures.THIN_PT, ls="--", label="threshold")
    profile.set(yscale="log", ylim=(2.0, 6000.0), xlim=(left, left + 64))
    figures.style_axes(profile, "Row of the brightest pixel", x="Column", y="Counts")
    key(profile, "lower left")
    return figure


def _load_approach() -> rl.Scenario:
    """Load the example tdrs_approach."""
    return rl.Scenario.load(Path(__file__).resolve().parent.parent / "examples" / "tdrs_approach.toml")


def _fly_nearest(scenario: rl.Scenario, **changes: Any) -> rl.Frame:
    """Simulate the last frame of tdrs_approach with a changed detector."""
    changed = scenario.lidar.replace(detector=scenario.lidar.detector.replace(**changes))
    return next(iter(rl.simulate(scenario.replace(lidar=changed), frames=[NEAREST_FRAME])))


def report() -> Any:
    """Return a frame as measured and as an import script reads its words, with its flags and what is true of them."""
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    words = rl.detector.ReportWords(range_quantum_m=1.0, range_bits=10, no_return_word=320, flags=True)
    frame = _fly_nearest(_load_approach(), amplitude_crosstalk=rl.detector.AmplitudeCrosstalk(), report=words)
    figure = figures.new_figure(
        9.6, 6.6, "A frame and its report",
        "tdrs_approach at its nearest with amplitude_crosstalk = {}; words of 1 m, coarse to be seen; 320 without a return",
    )  # fmt: skip
    (measured, reported), (said, true) = figure.subplots(2, 2)
    range_m = np.where(frame.valid, frame.range_m, np.nan)
    read_m = (words.encode(frame.observation.reading)[0] >> words.intensity_bits & (2**words.range_bits - 1)).astype(
        float
    )
    for axes, image, name in ((measured, range_m, "Range, measured"), (reported, read_m, "Range, from the words")):
        shown = axes.imshow(image, cmap=colour_maps.RANGE_RAMP, vmin=300.0, vmax=320.0, interpolation="none")
        figures.style_axes(axes, name)
    figures.style_bar(figure.colorbar(shown, ax=[measured, reported], shrink=0.9, pad=0.01), "[m]")
    names = ("no return", "no flag", "crosstalk", "saturated", "superimposed")
    colours = (palette.NO_RETURN, palette.OTHER_PART, *palette.PARTS[:3])  # as they are on both pages
    for axes, flags, name in (
        (said, frame.observation.reading, "Flags, as the sensor says"),
        (true, frame.labels, "Flags, as labels know"),
    ):
        image = frame.valid.astype(int)
        for number, flag in enumerate(names[2:], 2):
            image[frame.valid & getattr(flags, flag).astype(bool)] = number
            sys.stdout.write(f"{name}: {flag} {int(getattr(flags, flag)[frame.valid].sum())}\n")
        axes.imshow(image, cmap=ListedColormap(colours), vmin=-0.5, vmax=4.5, interpolation="none")
        figures.style_axes(axes, name)
    true.legend(
        handles=[Patch(color=colour, label=label) for colour, label in zip(colours, names, strict=True)],
        loc="center left",
        bbox_to_anchor=(1.01, 0.5),
        frameon=False,
        fontsize=figures.TEXT_PT,
    )
    for axes in figure.axes[:4]:
        axes.set(xticks=[], yticks=[])
        axes.grid(visible=False)
    return figure


def _flat(pixel: np.ndarray, photons: float) -> Photons:
    """Return the light of a facing plate at 50 m in some pixels of 128 x 128."""
    one = make_plate(photons, len(pixel), make_reference_pulse(), REFERENCE_FWHM_S)
    return replace(
        one,
        shape=(128, 128),
        pixel=pixel,
        cluster_pixel=pixel,
        delay_s=np.full(len(pixel), 50.0 / units.RANGE_PER_DELAY_M_S),
    )


def separation() -> Any:
    """Return how often both of two returns of a pixel are listed, against their separation."""
    figure = figures.new_figure(
        9.6, 4.6, "Two returns of a pixel",
        "share of 300 pixels that list both, max_returns = 2, pulse 8 ns; left: trace of 20 samples; right: longer traces",
    )  # fmt: skip
    by_light, by_trace = figure.subplots(1, 2, sharey=True)
    detector = rl.Gsfl(max_returns=2)
    for over, colour in ((2.0, palette.SKY), (5.0, palette.BLUE), (20.0, palette.ORANGE), (100.0, palette.RED)):
        photons = over * detector.traits.threshold_photons
        _both(by_light, detector, np.arange(0.6, 4.3, 0.1), photons, f"{photons:,.0f} photons each", colour)
    for samples, colour in ((20, palette.BLUE), (28, palette.GREEN), (44, palette.PINK)):
        longer = detector.replace(readout=rl.detector.Readout(samples=samples))
        deep = np.arange(0.6, longer.stored_behind_m + 0.2, 0.1)
        _both(by_trace, longer, deep, 5.0 * detector.traits.threshold_photons, f"{samples} samples", colour)
    for axes, title in (
        (by_light, "20 samples"),
        (by_trace, f"{5.0 * detector.traits.threshold_photons:,.0f} photons each"),
    ):
        axes.set(ylim=(-0.03, 1.03))
        figures.style_axes(axes, title, x="Separation in range [m]", y="Both are listed" if axes is by_light else "")
        key(axes, "upper center", bbox_to_anchor=(0.5, -0.14), ncols=2)
    return figure


def _both(axes: Any, detector: Any, separation_m: np.ndarray, photons: float, label: str, colour: str) -> None:
    pulse, fwhm_s = make_reference_pulse(), REFERENCE_FWHM_S
    made = simulate_pairs(detector, pulse, fwhm_s, separation_m, (photons, photons), 300)
    axes.plot(made.separation_m, made.probability, ".-", color=colour, ms=4, lw=figures.LINE_PT, label=label)
    listed = [[round(float(end), 2) for end in made.interval_m(share) or ()] for share in (0.5, 0.9)]
    sys.stdout.write(
        f"two returns, {label}, {detector.readout.samples} samples: half the time {listed[0]} m, 90 % {listed[1]} m\n"
    )


# ------------------------------------------------------------------------------------------- figures of orbits.md

START = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)


def _low_orbit(e: float = 0.0, perigee_km: float = 6778.137) -> rl.Kepler:
    """Return a low orbit inclined by 51.6 degrees."""
    return rl.Kepler(
        epoch_utc=START, semi_major_axis_km=perigee_km / (1.0 - e), eccentricity=e, inclination_deg=51.6,
        raan_deg=40.0, argument_of_perigee_deg=15.0, true_anomaly_deg=30.0,
    )  # fmt: skip


def _operations() -> dict[str, tuple[rl.rpo.ProximityOperation, str]]:
    """Return operations about a body in low orbit by name, and the plane to draw each in: "rt" or "nr"."""
    to: dict[str, Any] = {"relative_to": "station"}
    return {
        "v_bar_approach": (rl.rpo.VBarApproach(**to, from_m=-500.0, to_m=-50.0, speed_m_s=0.1), "rt"),
        "v_bar_approach, hops": (rl.rpo.VBarApproach(**to, from_m=-500.0, to_m=-50.0, hops=3), "rt"),
        "r_bar_approach": (rl.rpo.RBarApproach(**to, from_m=-500.0, to_m=-50.0, speed_m_s=0.2), "rt"),
        "hop, one revolution": (
            rl.rpo.Hop(**to, from_m=(0.0, -500.0, 0.0), to_m=(0.0, -50.0, 0.0), duration_s=5553.6), "rt",
        ),
        "co_elliptic": (rl.rpo.CoElliptic(**to, radial_m=-200.0, from_m=-1500.0, to_m=500.0), "rt"),
        "circumnavigation": (rl.rpo.Circumnavigation(**to, radial_m=100.0, cross_track_m=50.0), "rt"),
        "safety_ellipse": (
            rl.rpo.SafetyEllipse(
                **to, radial_m=120.0, cross_track_m=90.0, drift_m=200.0, center_along_track_m=-300.0, duration_s=3 * 5553.6
            ), "rt",
        ),
        "safety_ellipse, across": (
            rl.rpo.SafetyEllipse(
                **to, radial_m=120.0, cross_track_m=90.0, drift_m=200.0, center_along_track_m=-300.0, duration_s=3 * 5553.6
            ), "nr",
        ),
        "teardrop": (rl.rpo.Teardrop(**to, cusp_m=400.0, turn_m=100.0, loops=3), "rt"),
        "forced_circumnavigation": (rl.rpo.ForcedCircumnavigation(**to, radius_m=100.0, period_s=1800.0), "rt"),
        "waypoints": (
            rl.rpo.Waypoints(
                **to,
                positions_m=((0.0, -600.0, 0.0), (-200.0, -300.0, 0.0), (-150.0, 100.0, 0.0), (0.0, 200.0, 0.0)),
                speed_m_s=0.5,
            ), "rt",
        ),
        "lambert": (
            rl.rpo.Lambert(**to, from_m=(-2000.0, -30_000.0, 500.0), to_m=(0.0, -100.0, 0.0), duration_s=3300.0), "rt",
        ),
    }  # fmt: skip


def operations() -> Any:
    """Return the proximity operations by name, each in a plane of the body's rtn axes."""
    figure = figures.new_figure(
        11.0, 10.2, "Proximity operations by name",
        "about a body on a circle 400 km high. Line: as planned, thick where thrust holds it; dot: start; "
        "triangles: impulses; dashes: drift after the worst failure",
    )  # fmt: skip
    station = _low_orbit()
    for axes, (name, (part, plane)) in zip(figure.subplots(4, 3).flat, _operations().items(), strict=True):
        plan = part.plan(START, station)
        right, up = (1, 0) if plane == "rt" else (2, 0)
        unit = units.KM if name.startswith("lambert") else 1.0
        safety = plan.passive_safety(plan.revolution_s)
        for leg, begin_s, end_s in plan.stretches():
            if end_s > begin_s:
                path = leg.path(np.linspace(0.0, end_s - begin_s, 400))[0] / unit
                axes.plot(
                    path[:, right],
                    path[:, up],
                    color=palette.BLUE,
                    lw=figures.THICK_PT if leg.acceleration_m_s2 else figures.LINE_PT,
                )
        impulses = [impulse for impulse in plan.impulses if impulse.size_m_s > 0.0]
        if impulses:
            places = plan.relative(np.array([impulse.time_s for impulse in impulses]))[0] / unit
            axes.plot(places[:, right], places[:, up], "^", color=palette.RED, ms=5, zorder=4)
        if impulses or plan.thrust:
            drift = _adrift(plan, safety.failure_s) / unit
            axes.plot(drift[:, right], drift[:, up], "--", color=palette.ORANGE, lw=figures.THIN_PT, zorder=1)
        start = plan.relative(np.zeros(1))[0][0] / unit
        axes.plot(start[right], start[up], "o", color=palette.INK, ms=4, zorder=5)
        axes.plot(0.0, 0.0, "s", color=palette.GREEN, ms=6, zorder=5)
        _frame(axes, plan.relative(np.linspace(0.0, plan.duration_s, 400))[0][:, [right, up]] / unit)
        cost = f"{plan.delta_v_m_s:.3g} m/s" if plan.delta_v_m_s > 0.0 else "free"
        letters = "km" if unit != 1.0 else "m"
        figures.style_axes(
            axes, name, x=f"{'Along-track' if plane == 'rt' else 'Across'} [{letters}]", y=f"Radial [{letters}]"
        )
        _write_in_corner(axes, f"{cost}\nsafe {safety.distance_m:.0f} m")
    return figure


def _write_in_corner(axes: Any, text: str) -> None:
    """Write two short lines in the corner of a plot that its curves leave most free."""
    lines = [axes.transAxes.inverted().transform(axes.transData.transform(line.get_xydata())) for line in axes.lines]
    points = np.vstack(lines)
    corners = [(right, top) for top in (0.0, 1.0) for right in (0.0, 1.0)]
    counts = [np.sum(np.all(np.abs(points - corner) < (0.38, 0.3), axis=1)) for corner in corners]
    right, top = corners[int(np.argmin(counts))]
    axes.text(
        0.03 + 0.94 * right, 0.05 + 0.9 * top, text, transform=axes.transAxes, fontsize=figures.SMALL_PT,
        color=palette.QUIET, ha="right" if right else "left", va="top" if top else "bottom",
    )  # fmt: skip


def _adrift(plan: rl.rpo.Plan, failure_s: float) -> np.ndarray:
    """Return the drift (time, 3) [m] for a revolution after thrust stops at an instant: its impulse does not come."""
    place, velocity = (rows[0] for rows in plan.relative(np.array([failure_s])))
    for impulse in plan.impulses:
        if abs(impulse.time_s - failure_s) < 1e-3:
            velocity = velocity - impulse.delta_v_m_s
    n, time_s = plan.mean_motion_rad_s, np.linspace(0.0, plan.revolution_s, 400)
    drift: np.ndarray = clohessy_wiltshire(place, velocity, time_s, n)[0]
    return drift


def _frame(axes: Any, places: np.ndarray) -> None:
    """Set equal scales about a path (time, 2) and the body at the origin, with room for where it drifts to."""
    both = np.vstack([places, np.zeros((1, 2))])
    low, high = both.min(axis=0), both.max(axis=0)
    half = 0.62 * max(float((high - low).max()), 1e-9)
    middle = 0.5 * (low + high)
    axes.set_aspect("equal", adjustable="box")
    axes.set(xlim=(middle[0] - 1.55 * half, middle[0] + 1.55 * half), ylim=(middle[1] - half, middle[1] + half))


def safety_ellipse() -> Any:
    """Return a walking safety ellipse in the target's rtn axes with a keep-out sphere, as `rso-lidar truth` draws it."""
    scenario = rl.Scenario(
        version=1,
        name="Walking safety ellipse",
        time=rl.Time(start_utc=START, duration_s=4 * 5553.6, frame_rate_hz=0.02),
        target=(rl.Target(name="station", model="juno", motion=_low_orbit()),),
        follower=rl.Follower(
            motion=rl.rpo.SafetyEllipse(
                relative_to="station", radial_m=120.0, cross_track_m=90.0, drift_m=150.0, center_along_track_m=-300.0
            )
        ),
        lidar=rl.Lidar(receiver=rl.Receiver(fov_deg=2.5, f_number=2.8)),
    )
    return picture.orbit_figure(
        fly_open_loop(scenario)[0],
        "station",
        keep_out_m=50.0,
        title="A safety ellipse walks by: four revolutions",
    )


def relative_models() -> Any:
    """Return the error of the relative models over a revolution: over separation, eccentricity, and with flattening."""
    figure = figures.new_figure(
        11.0, 4.6, "Relative models: greatest error in one revolution",
        "a body behind on the chief's orbit, with a relative ellipse of a tenth of that; perigee 622 km high",
    )  # fmt: skip
    apart, eccentric, flattened = figure.subplots(1, 3)
    separations, eccentricities = np.geomspace(10.0, 1e6, 16), np.geomspace(1e-4, 0.7, 16)
    panels = {
        apart: ([(0.0, rho, None) for rho in separations], separations),
        eccentric: ([(e, 1000.0, None) for e in eccentricities], eccentricities),
        flattened: ([(0.001, rho, rl.orbit.Forces(zonal_degree=6)) for rho in separations[:13]], separations[:13]),
    }
    drawn = {"hill": palette.RED, "hill, curvilinear": palette.ORANGE, "yamanaka_ankersen": palette.BLUE}
    for axes, (cases, over) in panels.items():
        errors = [_errors(*case) for case in cases]
        more = {"nonlinear, two bodies": palette.INK, "relative_elements": palette.GREEN} if axes is flattened else {}
        for name, colour in (drawn | more).items():
            line = [error[name] for error in errors]
            axes.plot(over, line, ".-", color=colour, ms=4, lw=figures.LINE_PT, label=name)
        axes.set(xscale="log", yscale="log", ylim=(1e-4, 1e7))
    apart.plot(
        separations,
        6 * math.pi * separations**2 / 7e6,
        "--",
        color=palette.QUIET,
        lw=figures.THIN_PT,
        label="6π ρ² / r",
    )
    eccentric.plot(
        eccentricities, 3e4 * eccentricities, "--", color=palette.QUIET, lw=figures.THIN_PT, label="30 e × 1 km"
    )
    figures.style_axes(apart, "Two bodies, e = 0", x="Behind by [m]", y="Error [m]")
    figures.style_axes(eccentric, "Two bodies, 1 km", x="Eccentricity of the chief")
    figures.style_axes(flattened, "With J2 to J6, e = 0.001", x="Behind by [m]")
    for axes in (apart, eccentric, flattened):
        key(axes, "upper left")
    return figure


def _errors(e: float, behind_m: float, forces: rl.orbit.Forces | None) -> dict[str, float]:
    """Return each model's greatest distance [m] from the difference of two orbits over a revolution of the chief."""
    chief = _low_orbit(e, 7000.0)
    period_s = math.tau * math.sqrt((7e6 / (1.0 - e)) ** 3 / units.EARTH_GM_M3_S2)
    epochs = rl.orbit.Epochs(START, np.linspace(0.0, period_s, 181))
    shape = {"delta_lambda_m": -behind_m, "delta_ex_m": 0.1 * behind_m, "delta_ix_m": 0.1 * behind_m}
    elements = rl.rpo.RelativeElements(relative_to="chief", **shape, j2=forces is not None)
    position, velocity = (rows[0].tolist() for rows in elements.relative(rl.orbit.Epochs(START, np.zeros(1)), chief))
    known: dict[str, Any] = {"relative_to": "chief", "position_m": position, "velocity_m_s": velocity}
    truth = rl.rpo.Nonlinear(**known, forces=forces).relative(epochs, chief)[0]
    models = {
        "hill": rl.Hill(**known),
        "hill, curvilinear": rl.Hill(**known, curvilinear=True),
        "yamanaka_ankersen": rl.rpo.YamanakaAnkersen(**known),
        "nonlinear, two bodies": rl.rpo.Nonlinear(**known),
        "relative_elements": elements,
    }
    return {
        name: float(np.linalg.norm(model.relative(epochs, chief)[0] - truth, axis=1).max())
        for name, model in models.items()
    }


def finding() -> Any:
    """How far a 3U CubeSat is found by the camera of Fuller et al. (closed form on cast light)."""
    return rl.study.find_range("gsfl_1064", "cubesat_3u").figure()


def my_camera() -> Any:
    """The data sheet of the camera that docs/camera.md describes, by trials and closed forms."""
    text = (FOLDER.parent / "camera.md").read_text(encoding="utf-8")
    scenario = rl.Scenario.loads(text.partition("```toml\n")[2].partition("```")[0])
    return replace(rl.study.data_sheet(scenario), camera="a camera of 64 x 64 pixels at 850 nm").figure()


def events() -> Any:
    """The day of docs/events.md: two craft in formation, near, lit, looked at, and over a station."""
    graz = rl.orbit.GroundStation(47.07, 15.49, 540.0, least_elevation_deg=10.0, name="Graz")
    when = {
        "near": "range < 5km",
        "lit": "lit and visible",
        "look": "range < 5km and lit and sun > 30deg",
        "contact": "contact(Graz)",
    }
    begin = datetime.datetime(2024, 9, 17, tzinfo=datetime.UTC)
    return rl.study.events(shipped("tle/flyby.tle"), 99003, when, start_utc=begin, days=1.0, stations=[graz]).figure()


def link_budget() -> Any:
    """The link budget of the first example for three materials, facing and tilted (closed form)."""
    scenario = rl.Scenario.load(FOLDER.parents[1] / "examples" / "tdrs_approach.toml")
    return rl.budget(scenario, materials=[0.3, "white_paint", "black_paint"], tilt_deg=[0, 45]).figure()


def dispersion() -> Any:
    """A hop flown a thousand times with errors of start, burns and navigation, beside its linear covariance."""
    return rl.study.disperse(rl.Scenario.load(FOLDER.parents[1] / "examples" / "dispersed_hop.toml")).figure()


SHAPE_FROM = {  # where a model is looked at from; the others from ahead, the right and above
    "tdrs": (0.5, -1.1, 0.8),
    "juno": (0.6, -0.9, 0.9),
    "envisat": (-0.8, 1.0, -0.55),
    "zenit_stage": (-1.0, -1.2, 0.6),
    "rocket_body": (-1.0, -1.2, 0.6),
    "capsule": (0.7, -1.0, 0.6),
    "debris_plate": (1.0, -1.2, -0.9),
    "plate": (1.0, 0.7, 0.4),
}
SHAPE_PIXELS = (264, 198)  # of one model's picture


def _shape(name: str) -> tuple[np.ndarray, float]:
    """Return a model as an image (row, col, rgb), parts in the colour of their material, and its width [m]."""
    from PIL import Image

    entry, known = rl.scene.model(name), rl.scene.load_materials()
    surface = build_whole_surface(
        rl.Target(name=name, model=name, motion=rl.Fixed(position_m=(0.0, 0.0, 0.0))), Path, 1064e-9
    )
    toward = np.array(SHAPE_FROM.get(name, (1.0, -1.2, 0.7))) / np.linalg.norm(SHAPE_FROM.get(name, (1.0, -1.2, 0.7)))
    view = render_portrait(surface, tuple(toward.tolist()), (0.0, 0.0, 1.0), cells=1200)
    right = np.cross((0.0, 0.0, 1.0), toward) / math.hypot(toward[0], toward[1])
    lamp = 0.70 * toward - 0.45 * right + 0.55 * np.cross(toward, right)
    facing = np.einsum("i,irc->rc", lamp, np.stack([surface.planes[axis][view.facet] for axis in range(3)]))
    shade = 0.33 + 0.20 * view.cosine + 0.60 * np.clip(facing, 0.0, 1.0)
    colours = np.array([known[entry.parts[part]]["display_rgb"] for part in surface.mesh.part_names])
    rgb = np.clip(colours[surface.part[view.facet]] ** 0.8 * shade[..., None], 0.0, 1.0)
    image = (255.0 * np.concatenate([rgb, view.covered[..., None]], axis=-1)).astype(np.uint8)  # clear where nothing is
    rows, cols = (np.flatnonzero(view.covered.any(axis=axis)) for axis in (1, 0))
    wide, high = SHAPE_PIXELS
    times = 1.06 * max((cols[-1] - cols[0] + 1) / wide, (rows[-1] - rows[0] + 1) / high)  # cells to a pixel
    left, top = 0.5 * (cols[0] + cols[-1] - times * wide), 0.5 * (rows[0] + rows[-1] - times * high)
    padded = Image.fromarray(np.pad(image, ((1200, 1200), (1200, 1200), (0, 0)), constant_values=0), mode="RGBA")
    window = (1200 + left, 1200 + top, 1200 + left + times * wide, 1200 + top + times * high)
    small = np.asarray(padded.resize(SHAPE_PIXELS, Image.Resampling.BOX, box=window))
    return small // 8 * 8 + small // 32, times * wide * view.cell_m  # fewer colours, a smaller file


def models() -> Any:
    """Every shipped model from one side, with a bar of its own scale."""
    names = list(rl.scene.library.models())
    columns = 5
    rows = -(-len(names) // columns)
    figure = figures.new_figure(
        2.3 * columns,
        2.05 * rows + 0.7,
        "The shipped models",
        "each at its own scale; parts in the display colour of their material",
    )
    for k, name in enumerate(names):
        axes = figure.add_subplot(rows, columns, k + 1)
        image, width_m = _shape(name)
        axes.imshow(image, interpolation="none")
        axes.set_axis_off()
        axes.set_title(name, fontsize=figures.TEXT_PT, color=palette.INK, pad=2)
        bar_m = figures.round_down(0.35 * width_m)
        wide, high = SHAPE_PIXELS
        axes.set_ylim(high + 26, 0)  # the bar stands below the picture: a craft may reach into every corner of that
        foot = high + 22
        axes.plot(
            [4, 4 + bar_m / width_m * wide], [foot, foot], color=palette.INK, lw=figures.THICK_PT, solid_capstyle="butt"
        )
        text = f"{bar_m:g} m" if bar_m >= 1.0 else f"{100 * bar_m:g} cm"
        axes.text(4, foot - 5, text, fontsize=figures.SMALL_PT, color=palette.QUIET, va="bottom")
    return figure


def published_arrays() -> Any:
    """Return published errors of two linear-mode arrays with what the full detector makes of them (calibration.md)."""
    sys.path.insert(0, str(FOLDER.parents[1]))
    from tests.physics import published_arrays as known

    figure = figures.new_figure(
        9.6,
        4.6,
        "Published linear-mode arrays and the full detector",
        "dashed: published; lines and dots: simulated; sources in calibration.md",
    )
    cells, counts = figure.subplots(1, 2)
    spreads_ns = np.linspace(0.0, 1.5, 9)
    errors = np.array([known.cell_errors_cm(known.JORDAN_PHOTONS[121], t0_ns=spread) for spread in spreads_ns])
    for column, (label, colour, published_cm) in enumerate(
        (
            ("highest cell", palette.RED, known.JORDAN_RAW_CM[121]),
            ("peak of a spline", palette.BLUE, known.JORDAN_SPLINE_CM[121]),
        )
    ):
        cells.plot(spreads_ns, errors[:, column], ".-", color=colour, ms=4, lw=figures.LINE_PT, label=label)
        cells.axhline(published_cm, color=colour, lw=figures.THIN_PT, ls="--")
    alone_cm = known.CELL_NS * units.NS * CM / math.sqrt(12.0)
    cells.plot([0.0], [alone_cm], "D", color=palette.INK, ms=6, label="cells of 1.876 ns alone")
    cells.set(ylim=(0, 30))
    figures.style_axes(
        cells, "An early ladar, 121 pixels: range, rms error", x="Spread of the time origins, 1 sigma [ns]", y="[cm]"
    )
    key(cells, "upper left")
    levels = np.geomspace(2.0, 1200.0, 12)
    noise_cm = [known.pixell_trial(level).range_noise_m / units.CM for level in levels]
    counts.plot(levels, noise_cm, ".-", color=palette.BLUE, ms=4, lw=figures.LINE_PT, label="simulated")
    counts.plot(
        [known.PIXELL_COUNTS, levels[-1]],
        [known.PIXELL_FLOOR_CM] * 2,
        "--",
        color=palette.INK,
        lw=figures.LINE_PT,
        label="published: 0.6 cm above 60 counts",
    )
    low = levels[levels < known.PIXELL_COUNTS]
    counts.plot(low, noise_cm[0] * low[0] / low, ":", color=palette.INK, lw=figures.LINE_PT, label="1 / amplitude")
    counts.set(xscale="log", yscale="log", ylim=(0.1, 10.0))
    figures.format_thousands(counts.xaxis)
    figures.style_axes(counts, "Pixell: range, 1 sigma", x="Amplitude [counts]", y="[cm]")
    key(counts)
    sys.stdout.write(f"cells: {np.round(errors, 1).tolist()} cm at {spreads_ns.round(2).tolist()} ns\n")
    sys.stdout.write(f"Pixell: {np.round(noise_cm, 2).tolist()} cm at {levels.round().tolist()} counts\n")
    return figure


def published() -> Any:
    """Return four published measurements with what the detectors make of them (calibration.md)."""
    sys.path.insert(0, str(FOLDER.parents[1]))
    from tests.physics import published_cameras as known

    figure = figures.new_figure(
        9.6,
        8.0,
        "Published cameras and the simulated detectors",
        "dots: published; lines: simulated; sources in calibration.md",
    )
    (walk, counts), (sigma, reach) = figure.subplots(2, 2)
    range_m, zones = known.tmf_deviations(known.TMF_ITERATIONS)
    for (zone, (photons, measured_m, _)), colour in zip(zones.items(), palette.LINES, strict=False):
        walk.plot(photons, 1e3 * measured_m, "o", color=colour, ms=3.5, label=f"zone {zone}")
        root = 1.0 / np.sqrt(photons)
        far = range_m > 0.095
        counts.plot(range_m, root, "o", color=colour, ms=3.5)
        counts.plot(
            range_m, np.polyval(np.polyfit(range_m[far], root[far], 1), range_m), "-", color=colour, lw=figures.LINE_PT
        )
    level, _, walk_m = known.tmf_walk()
    walk.plot(level, 1e3 * walk_m, color=palette.INK, lw=figures.THICK_PT, label="simulated")
    figures.style_axes(
        walk, "TMF8820: range walk", x="Photons of a zone in an iteration", y="Range minus a straight line [mm]"
    )
    key(walk)
    figures.style_axes(
        counts, "TMF8820: light; lines 1 / (R + d)² beyond 0.1 m", x="Range R [m]", y="1 / √photons of an iteration"
    )
    n = known.MIT_DETECTIONS
    sigma.plot(n, known.MIT_SIGMA_PS, "o", color=palette.BLUE, ms=5, label="measured (quartiles)")
    for gaussian, colour, label in (
        (False, palette.INK, "simulated, measured response"),
        (True, palette.ORANGE, "authors' Gaussian"),
    ):
        sigma.plot(
            n, [known.mit_sigma_ps(int(k), gaussian)[0] for k in n], "-", color=colour, lw=figures.THICK_PT, label=label
        )
    sigma.set(xscale="log", yscale="log")
    sigma.minorticks_off()
    sigma.set_xticks(n, [f"{k}" for k in n])
    sigma.set_yticks([50, 100, 200, 400], ["50", "100", "200", "400"])
    figures.style_axes(sigma, "A scanned SPAD: precision", x="Detections in the gate", y="Time, 1 sigma [ps]")
    key(sigma)
    simulated_m = known.vl53_reaches_m()
    for place, (case, measured_m) in enumerate(known.VL53_REACH_M.items()):
        free = case in known.VL53_FREE
        reach.plot(
            simulated_m[case], place, "|", color=palette.INK, ms=14, mew=1.6, label=None if place else "simulated"
        )
        face = "none" if free else palette.BLUE
        label = {0: "published, used to set signal and sunlight", 1: "published"}.get(place)
        reach.plot(measured_m, place, "o", color=palette.BLUE, mfc=face, ms=6, label=label)
    names = [f"{zones}, {target}, {'5 klux' if lit else 'dark'}" for zones, target, lit in known.VL53_REACH_M]
    reach.set_yticks(range(len(names)), names, fontsize=figures.SMALL_PT)
    reach.set(xlim=(0.0, 3.3), ylim=(len(names) + 2.2, -0.5))  # room for the legend
    figures.style_axes(reach, "VL53L5CX: reach", x="Range of 90 % detection [m]")
    key(reach, "lower left")
    return figure


def camera_fit() -> Any:
    """Return measured curves of an invented camera of silicon pixels over the fitted ones (camera_fit.md)."""
    sheet = rl.Gsfl(
        quantum_efficiency=0.7,
        armed_to_m=500.0,
        apd=rl.detector.Apd(gain=80.0, ionisation_ratio=0.02, dark_current_na=0.05),
        amplifier=rl.detector.Amplifier(noise_electrons=1000.0, bandwidth_mhz=150.0),
        trigger=rl.detector.Trigger(threshold_electrons=9000.0),
        readout=rl.detector.Readout(sample_ns=1.5),
    )
    camera = sheet.replace(
        amplifier=sheet.amplifier.replace(noise_electrons=1600.0),
        trigger=sheet.trigger.replace(threshold_electrons=12_000.0),
        readout=sheet.readout.replace(electrons_per_count=310.0),
        timing=rl.detector.Timing(pixel_jitter_ns=0.15),
    )
    lines = ["photons,hits,sigma_m,counts,counts_sigma"]
    for level in np.geomspace(120.0, 4000.0, 14):
        trial = seen(camera, level, 2000, pulse_fwhm_ns=5.0, range_m=20.0)
        error_m, n = trial.range_error_m, trial.intensity_counts
        kept = np.abs(error_m - np.median(error_m)) < 5.0 * trial.range_noise_m
        lines.append(f"{level},{kept.sum()},{error_m[kept].std()},{n[kept].mean()},{n[kept].std()}")
    measured = {
        "detection_rate": 'value = "hits"\nunit = "hits"\ntrials = 2000',
        "range_scatter": 'value = "sigma_m"\ntrials = "hits"',
        "counts_mean": 'value = "counts"\ntrials = "hits"',
        "counts_scatter": 'value = "counts_sigma"\ntrials = "hits"',
    }
    free = ("amplifier.noise_electrons", "trigger.threshold_electrons", "timing.pixel_jitter_ns")
    text = f'version = 1\nname = "silicon_64"\nconstants = {[*free, "readout.electrons_per_count"]}\n'
    for quantity, columns in measured.items():
        text += f'[[curve]]\nquantity = "{quantity}"\nfile = "plate.csv"\nphotons = "photons"\n{columns}\n'
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "plate.csv").write_text("\n".join(lines), encoding="utf-8")
        laser = rl.Laser(wavelength_nm=850.0, pulse_fwhm_ns=5.0)
        lidar = rl.Lidar(laser=laser, receiver=rl.Receiver(fov_deg=6.0, f_number=2.0), detector=sheet)
        fitted = fit_camera(lidar, CurvesFile.loads(text, folder=Path(folder)))
    sys.stdout.write(f"{fitted.table()}\n")
    return draw_camera_fit(fitted)


def _invent_camera() -> tuple[rl.Lidar, Any]:
    """Return the lidar of camera.md, and the camera that stands for the real one: noisier, with other scales."""
    text = (FOLDER.parent / "camera.md").read_text(encoding="utf-8")
    lidar = rl.Scenario.loads(text.partition("```toml\n")[2].partition("```")[0]).instrument
    sheet: Any = lidar.detector
    return lidar, sheet.replace(
        amplifier=sheet.amplifier.replace(noise_electrons=1.25 * sheet.amplifier.noise_electrons, bandwidth_mhz=165.0),
        readout=sheet.readout.replace(electrons_per_count=430.0, baseline_counts=70.0),
    )


def camera_maps() -> Any:
    """Return measured maps of an invented camera beside the fitted ones, by the simulator (camera_fit.md)."""
    lidar, camera = _invent_camera()
    n, shape, pulse = 64 * 64, (64, 64), lidar.pulse
    row, col = np.mgrid[:64, :64] / 63.0
    rng = np.random.Generator(np.random.Philox(7))
    dead = rng.random(shape) < 0.004
    truth = {  # a gain that falls toward the corners, and clocks that come later along the rows, each with a scatter
        "gain_factor": 1.12 - 0.5 * ((row - 0.5) ** 2 + (col - 0.5) ** 2) + 0.02 * rng.standard_normal(shape),
        "t0_ns": 0.8 * (col - 0.5) + 0.1 * np.cos(np.pi * np.arange(64))[:, None] + 0.05 * rng.standard_normal(shape),
    }
    arrays: dict[str, np.ndarray] = {}
    text = 'version = 1\nname = "silicon_64"\npixel_constants = ["gain", "t0"]\n'
    with tempfile.TemporaryDirectory() as folder:
        shared = lidar.replace(detector=camera)  # whose constants the raw shots tell
        rl.detector.PixelMaps(shape, truth, {}, dead, np.zeros(shape, bool)).save(Path(folder) / "truth.npz")
        camera = camera.replace(maps=rl.detector.Maps(file=str(Path(folder) / "truth.npz")))
        for photons in (1500, 6000):
            counts, range_m = np.zeros((40, *shape)), np.zeros((40, *shape))
            for k in range(40):
                at_m = 300.0 + k * 0.618_034 % 1.0
                light = make_point_returns(
                    shape,
                    (pulse.step_s, pulse.power_per_s),
                    pulse.fwhm_s,
                    np.arange(n),
                    np.full(n, at_m),
                    np.full(n, float(photons)),
                )
                reading, _ = detect(light, camera, rng)
                counts[k], range_m[k] = reading.intensity_counts, reading.range_m - at_m + 300.0
            arrays |= {f"counts_{photons}": counts, f"range_{photons}": range_m}
            for quantity, name in (("counts_mean", "counts"), ("range_mean", "range")):
                text += f'[[map]]\nquantity = "{quantity}"\nfile = "flat.npz"\nvalue = "{name}_{photons}"\n'
                text += f"photons = {photons}\nrange_m = 300\n"
        np.savez(Path(folder) / "flat.npz", **arrays)
        fitted = fit_camera(shared, CurvesFile.loads(text, folder=Path(folder)))
    sys.stdout.write(f"{fitted.table()}\n")
    return draw_camera_fit(fitted)


def camera_shots() -> Any:
    """Return the pulses, their area and its variance of raw shots of an invented camera (camera_fit.md)."""
    lidar, camera = _invent_camera()
    pulse = lidar.pulse
    camera = camera.replace(trigger=camera.trigger.replace(threshold_spread_fraction=0.0))
    dark = camera.replace(gate=rl.detector.Gate(delay_ns=200.0, width_ns=48.0, pulses=1))
    samples, photons = [], []
    for level in (0.0, 800.0, 2000.0, 6000.0, 60_000.0):
        light = make_plate(max(level, 1e-9), 500, (pulse.step_s, pulse.power_per_s), pulse.fwhm_s, 15.0)
        _, waveforms = detect(light, camera if level else dark, np.random.Generator(np.random.Philox(int(level))))
        assert waveforms is not None
        samples.append(waveforms.samples_counts)
        photons.append(np.full(len(samples[-1]), level))
    free = ("amplifier.noise_electrons", "amplifier.bandwidth_mhz", "readout.electrons_per_count")
    text = f'version = 1\nname = "silicon_64"\nconstants = {[*free, "readout.baseline_counts"]}\n[[waveform]]\n'
    text += 'file = "shots.npz"\nsamples = "samples"\nsample_ns = 1.0\nphotons = "photons"\n'
    with tempfile.TemporaryDirectory() as folder:
        np.savez(Path(folder) / "shots.npz", samples=np.concatenate(samples), photons=np.concatenate(photons))
        fitted = fit_camera(lidar, CurvesFile.loads(text, folder=Path(folder)))
    sys.stdout.write(f"{fitted.table()}\n")
    return draw_camera_fit(fitted)


def stray_light() -> Any:
    """Steady light and laser light of the example with ghosts and glare, as the Sun passes behind the satellite."""
    from matplotlib.colors import LogNorm

    scenario = rl.Scenario.load(FOLDER.parents[1] / "examples" / "ghosts_and_glare.toml")
    frames = list(rl.simulate(scenario, frames=[1, 9, 15, 18], keep=["photons"]))
    figure = figures.new_figure(
        11.0,
        6.1,
        "The Sun passes behind a satellite: images, ghosts, veil and halo",
        "expected photons in four frames of the example ghosts_and_glare; upper row without the laser",
    )
    rows = figure.subplots(2, len(frames), sharex=True, sharey=True)
    for column, frame in zip(rows.T, frames, strict=True):
        photons = frame.kept["photons"]
        steady = photons.background_photons_per_s
        pulse = np.bincount(photons.pixel, photons.photons, steady.size).reshape(steady.shape)
        drawn = (
            (steady, LogNorm(1e7, 1e14), colour_maps.AMOUNT_RAMP),
            (np.maximum(pulse, 1e-2), LogNorm(0.1, 1e5), colour_maps.AMOUNT_RAMP),
        )
        for axes, (image, norm, colours), row, label in zip(
            column, drawn, rows, ("steady light [photons/s]", "laser light [photons]"), strict=True
        ):
            shown = axes.imshow(image, norm=norm, cmap=colours, interpolation="none")
            axes.set_xticks([])
            axes.set_yticks([])
            if frame is frames[-1]:
                figure.colorbar(shown, ax=list(row), label=label, pad=0.01)
        column[0].set_title(f"{frame.time_s:.0f} s", fontsize=figures.TEXT_PT, color=palette.INK)
    return figure


SAMPLED = ("tdrs", 1000.0, 1)  # model, range [m] and number of the attitude
SAMPLED_PIXEL = (58, 66)


def scan_lines() -> Any:
    """One pixel of a shipped craft: contours over what it sees, and the slabs, scan lines and rays that sample it."""
    from matplotlib.collections import LineCollection, PatchCollection
    from matplotlib.lines import Line2D
    from matplotlib.patches import Rectangle

    receiver, laser, (surface, truth) = rl.Receiver(fov_deg=2.5, f_number=2.8), rl.Laser(), _place_craft(*SAMPLED)
    row, col = SAMPLED_PIXEL
    pixel = row * receiver.n_cols + col

    def measure_light(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return the photons of a whole pixel that is as bright as points of this one, from 0 to 1 right and down."""
        right, down = receiver.tangents_at(np.ravel(col + x), np.ravel(row + y))
        direction = np.stack([right, down, np.ones(x.size)], axis=-1)
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        rays = Rays(receiver.shape, direction, np.full(x.size, pixel, np.int32), np.ones(x.size))
        hits, light = rl.scene.cast(rays, [surface], truth), np.zeros(x.size)
        light[hits.ray] = rl.optics.pixel_photons(hits, laser, receiver)
        return light.reshape(x.shape)

    # Contours in short pieces, which are visible where the light on their two sides differs.
    least_step = 5.0 * receiver.sampling_error
    contours = rl.scene.contours([surface], truth, least_step)
    images = image_contours(receiver, laser, contours)
    _, within, _ = cut_contours(
        *images, np.ones((1, 1), np.int64), row, col, np.empty((4, 0, 0)), 0
    )  # hidden ones, too
    starts, along = within[:, None, :2], within[:, None, 2:4] - within[:, None, :2]
    share = np.arange(60)[:, None] / 60.0
    pieces = np.stack([starts + share * along, starts + (share + 1.0 / 60.0) * along], axis=2).reshape(-1, 2, 2)
    across = (pieces[:, 1] - pieces[:, 0])[:, ::-1] * (-1.0, 1.0)
    across *= 2e-3 / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-9)
    one, other = (measure_light(*(pieces.mean(axis=1) + side * across).T) for side in (-1.0, 1.0))
    is_visible = np.abs(one - other) > least_step * np.maximum(one, other)

    rays = cast_pixels(receiver, laser, [surface], truth).rays
    direction, weight = rays.direction[rays.pixel == pixel], rays.weight[rays.pixel == pixel]
    x, y = (
        direction[:, axis] / direction[:, 2] / receiver.pixel_tangent + 0.5 * n - first
        for axis, n, first in ((0, receiver.n_cols, col), (1, receiver.n_rows, row))
    )
    light = measure_light(x, y)
    lines, of_line = np.unique(y.round(9), return_inverse=True)
    height = np.bincount(of_line, weight)
    top, width = np.cumsum(height) - height, weight / height[of_line]
    left = np.concatenate([np.cumsum(width[of_line == k]) - width[of_line == k] for k in range(len(lines))])

    figure = figures.new_figure(
        figures.PAGE_IN,
        5.0,
        "How rays sample one pixel",
        f"model {SAMPLED[0]} at {SAMPLED[1] / 1000.0:g} km in a random attitude, sampling_error = "
        f"{100.0 * receiver.sampling_error:g} %; brightness as the photons of a whole pixel",
    )
    seen_by, sampled = figure.subplots(1, 2)
    fine = (np.arange(900) + 0.5) / 900.0
    image = measure_light(*np.meshgrid(fine, fine))
    scale = {"cmap": colour_maps.AMOUNT_RAMP, "vmin": 0.0, "vmax": float(image.max())}
    shown = seen_by.imshow(image, extent=(0, 1, 1, 0), interpolation="none", **scale)
    kinds = (
        ("visible contour", palette.IMAGE_MARK, figures.THICK_PT, is_visible),
        ("hidden contour", palette.IMAGE_WHITE, figures.THIN_PT, ~is_visible),
    )
    for _, colour, width_pt, chosen in reversed(kinds):
        seen_by.add_collection(LineCollection(list(pieces[chosen]), colors=colour, linewidths=width_pt))
    handles = [Line2D([], [], color=colour, lw=width_pt, label=label) for label, colour, width_pt, _ in kinds]
    on_image = {"fontsize": figures.SMALL_PT, "color": palette.IMAGE_WHITE}
    seen_by.legend(
        handles=handles, fontsize=figures.SMALL_PT, frameon=False, loc="upper left", labelcolor=palette.IMAGE_WHITE
    )
    intervals = [Rectangle((left[k], top[line]), width[k], height[line]) for k, line in enumerate(of_line)]
    filled = PatchCollection(intervals, edgecolor="none", cmap=scale["cmap"])
    filled.set_array(light)
    filled.set_clim(scale["vmin"], scale["vmax"])
    sampled.add_collection(filled)
    sampled.hlines(top[1:], 0, 1, color=palette.IMAGE_WHITE, lw=figures.LINE_PT)
    sampled.hlines(lines, 0, 1, color=palette.IMAGE_WHITE, lw=figures.THIN_PT, ls=(0, (4, 3)))
    sampled.scatter(x, y, c=light, s=24, edgecolor=palette.IMAGE_WHITE, lw=figures.THIN_PT, zorder=3, **scale)
    sampled.text(x[0], lines[0] - 0.03, "ray", ha="center", va="bottom", **on_image)
    sampled.text(0.5 * (x[0] + x[1]), lines[0] - 0.015, "scan line", ha="center", va="bottom", **on_image)
    sampled.text(0.02, top[1] - 0.015, "edge of a slab", va="bottom", **on_image)
    known, true = float(np.sum(weight * light)), float(image.mean())
    for axes, title in (
        (seen_by, f"Image: {true:,.0f} photons"),
        (sampled, f"{len(x)} rays on {len(lines)} lines: {known:,.0f} photons"),
    ):
        figures.style_axes(axes, title)
        axes.set(xlim=(0, 1), ylim=(1, 0), aspect="equal", xticks=[], yticks=[])
        axes.grid(visible=False)
    bar = figure.colorbar(shown, ax=[seen_by, sampled], shrink=0.8, pad=0.015)
    figures.style_bar(bar, "Light [photons]")
    figures.format_thousands(bar.ax.yaxis)
    return figure


def _place_craft(
    name: str, range_m: float, attitude: int, material: str | None = None
) -> tuple[rl.scene.Surface, Truth]:
    """Return a shipped craft in the middle of the field, and the truth of its pose.

    Parameters
    ----------
    attitude : number of a random attitude
    material : of all of its parts (None: the catalogue's)
    """
    from scipy.spatial.transform import RigidTransform, Rotation

    target = rl.Target(name="craft", model=name, material=material, motion=rl.Fixed(position_m=(0.0, 0.0, 0.0)))
    turn = Rotation.random(rng=np.random.default_rng(attitude))
    links = {"lidar": Link.still(), "craft": Link.still(RigidTransform.from_components([0.0, 0.0, range_m], turn))}
    truth = Truth(0.0, PoseTree({"lidar": "inertial", "craft": "lidar"}, links), {}, np.full(3, np.nan))
    return build_whole_surface(target, Path, 1064e-9), truth


BOUNCING = ("tdrs", "juno", "dawn", "rosetta", "stardust", "lro", "suomi_npp", "comsat", "rocket_body")
FOIL_ATTITUDE = 4  # frame of the example


def second_bounce() -> Any:
    """Return the light of the second bounce: of one frame by pixel, and of shipped craft over its depth."""
    scenario = rl.Scenario.load(Path(__file__).resolve().parents[1] / "examples" / "second_bounce.toml")
    lidar = scenario.lidar.replace(receiver=scenario.lidar.receiver.replace(rays_per_pixel=400))
    scenario, alone = (scenario.replace(lidar=lidar.replace(bounces=n)) for n in (2, 1))
    (first,), (both,) = (tuple(rl.simulate(one, frames=[FOIL_ATTITUDE])) for one in (alone, scenario))
    figure = figures.new_figure(
        11.0,
        4.6,
        "Light that meets two surfaces",
        "a craft in gold foil at 320 m (examples/second_bounce), and nine shipped craft in six random attitudes each",
    )
    direct, second = first.labels.photons, both.labels.photons - first.labels.photons
    rows, cols = (np.flatnonzero((both.labels.photons > 0).any(axis=axis)) for axis in (1, 0))
    window = slice(rows[0] - 2, rows[-1] + 3), slice(cols[0] - 2, cols[-1] + 3)
    panels = ((0.46, direct, "first bounce"), (0.06, second, "second bounce"))
    for low, photons, title in panels:
        axes = figure.add_axes((0.03, low, 0.50, 0.30))
        image = np.log10(np.maximum(photons[window], 1.0))
        shown = axes.imshow(
            np.where(photons[window] > 0, image, np.nan), cmap=colour_maps.AMOUNT_RAMP, vmin=1.0, vmax=4.5
        )
        axes.set_title(
            f"{title}: {photons.sum(dtype=float) / 1e6:.1f} million photons",
            fontsize=figures.TEXT_PT,
            color=palette.INK,
        )
        axes.set_axis_off()
    bar = figure.colorbar(shown, cax=figure.add_axes((0.545, 0.12, 0.012, 0.55)), ticks=[1, 2, 3, 4])
    bar.ax.set_yticklabels(["10", "100", "1,000", "10⁴"], fontsize=figures.SMALL_PT)
    bar.ax.set_title("photons", fontsize=figures.SMALL_PT, color=palette.QUIET)
    axes = figure.add_axes((0.675, 0.15, 0.305, 0.61))
    for material, label, colour in (
        (None, "catalogue's materials", palette.BLUE),
        ("mli_gold", "gold foil all over", palette.ORANGE),
    ):
        points = np.array([_bounced_share(name, material, k) for name in BOUNCING for k in range(6)])
        axes.plot(100.0 * points[:, 0], points[:, 1], "o", ms=4, color=colour, alpha=0.75, label=label)
    axes.set_xscale("log")
    axes.set_xlim(0.8, 400.0)
    axes.set_xticks([1, 10, 100], ["1 %", "10 %", "100 %"])
    figures.style_axes(axes, x="light of the second bounce over that of the first", y="mean depth behind the first [m]")
    key(axes, "upper left")
    return figure


def _bounced_share(name: str, material: str | None, attitude: int) -> tuple[float, float]:
    """Return the light of a craft's second bounce over that of the first, and its depth behind it in the same pixels [m].

    Parameters
    ----------
    name, material : the model, and the material of all of its parts (None: the catalogue's).
    attitude : number of a random attitude, at 300 m.
    """
    surface, truth = _place_craft(name, 300.0, attitude, material)
    receiver, laser = rl.Receiver(fov_deg=6.0, f_number=2.8), rl.Laser(divergence_deg=6.0)
    hits = rl.scene.cast(rl.optics.pixel_rays(receiver, laser, rl.scene.extent([surface], truth)), [surface], truth)
    paths = rl.scene.bounce(hits, [surface], truth, np.array([16, attitude], np.uint32))
    n = receiver.n_rows * receiver.n_cols
    (first, first_s), (light, light_s) = (
        (np.bincount(one.pixel, one.photons, n), np.bincount(one.pixel, one.photons * one.delay_s, n))
        for one in (rl.optics.collect(hits, laser, receiver, bounces=given) for given in (None, paths))
    )
    on = first > 0.0
    second, second_s = (light - first)[on], (light_s - first_s)[on]
    late_s = (second_s - second * first_s[on] / first[on]).sum() / max(second.sum(), 1e-9)
    return float(second.sum() / first.sum()), float(late_s * units.RANGE_PER_DELAY_M_S)


def smear() -> Any:
    """A satellite in four averaged frames: still, moving across and along the line of sight, and spinning."""
    bench = """
        version = 1
        name = "smear"
        world = { axes = "local" }
        time = { start_utc = 2024-09-17T12:00:00Z, duration_s = 1, frame_rate_hz = 1 }
        follower = { motion = { type = "fixed", position_m = [0, 0, 0] } }
        [lidar]
        laser = { energy_mj = 1, pulse_fwhm_ns = 4, divergence_deg = 4, pulse_rate_hz = 100 }
        receiver = { fov_deg = 2.6, n_rows = 64, n_cols = 64, f_number = 2.8, rays_per_pixel = 36 }
        detector = { type = "gsfl", gate = { delay_ns = 1860, width_ns = 280, pulses = 50 } }
        [[target]]
        name = "craft"
        model = "suomi_npp"
        motion = { type = "fixed", position_m = [300, 0, 0] }
    """
    from matplotlib.colors import LogNorm

    still = rl.Scenario.loads(bench)
    cases: dict[str, dict[str, Any]] = {
        "still": {},
        "4 m/s across": {"motion": _coast([300.0, -0.98, 0.0], [0.0, 4.0, 0.0])},
        "6 m/s along": {"motion": _coast([298.53, 0.0, 0.0], [6.0, 0.0, 0.0])},
        "40 deg/s of spin": {"attitude": {"type": "spin", "axis": [1, 0, 0], "rate_deg_s": 40}},
    }
    figure = figures.new_figure(
        11.0, 5.6, "Fifty pulses in half a second, averaged",
        "photons of the mean pulse, and the mean samples of all lit pixels; suomi_npp at 300 m, 50 pulses at 100 Hz",
    )  # fmt: skip
    images, traces = figure.subplots(2, 4, sharex="row", sharey="row")
    for image, trace, (name, changed) in zip(images, traces, cases.items(), strict=True):
        scenario = still.replace(target=(still.target[0].replace(**changed),))
        (frame,) = rl.simulate(scenario, keep=["waveforms"])
        shown = image.imshow(
            np.maximum(frame.labels.photons, 1.0),
            cmap=colour_maps.AMOUNT_RAMP,
            norm=LogNorm(1.0, 1e3),
            interpolation="none",
        )
        epochs = len(frame.truth.cast_epochs)
        image.set_title(
            f"{name}\ncast at {epochs} epoch{'s' * (epochs > 1)}", fontsize=figures.TEXT_PT, color=palette.INK
        )
        image.set_xticks([])
        image.set_yticks([])
        stored = frame.kept["waveforms"]
        lit = frame.labels.photons.ravel()[stored.pixel] > 0.0
        samples = stored.samples_counts[lit].mean(axis=0) - stored.baseline_counts
        range_m = (stored.start_s[0] + np.arange(len(samples)) * stored.sample_s) * units.RANGE_PER_DELAY_M_S
        trace.plot(range_m, samples, ".-", color=palette.BLUE, ms=3, lw=figures.THIN_PT)
        figures.style_axes(trace, "", x="Range [m]", y="Mean sample [counts]" if trace is traces[0] else "")
        trace.set_xlim(295.0, 305.0)
    figure.colorbar(shown, ax=list(images), label="expected photons", pad=0.01)
    return figure


def _coast(position_m: list[float], velocity_m_s: list[float]) -> dict[str, Any]:
    """Return a motion at constant velocity from a position on."""
    state = (*position_m, *velocity_m_s)
    return {"type": "state_space", "axes": "local", "dynamics": _fall_free, "initial_state": state}


def _fall_free(_time_s: float, state: np.ndarray, _inputs: np.ndarray) -> np.ndarray:
    """Return the derivatives of position and velocity without force."""
    return np.concatenate([state[3:], np.zeros(3)])


def _allan_deviation(values: np.ndarray, rate_hz: float, averaging_s: np.ndarray) -> np.ndarray:
    """Return the overlapping Allan deviation (averaging time) of samples (sample)."""
    total = np.concatenate([[0.0], np.cumsum(values)])
    found = []
    for count in np.rint(averaging_s * rate_hz).astype(int):
        means = (total[count:] - total[:-count]) / count
        found.append(math.sqrt(0.5 * float(np.mean((means[count:] - means[:-count]) ** 2))))
    return np.array(found)


def allan() -> Any:
    """Return the Allan deviation of ten hours of a gyro at rest, and the terms of its datasheet."""
    figure = figures.new_figure(
        9.6, 4.8, "Ten hours of a gyro at rest",
        "overlapping Allan deviation of the preset stim300_gyro, and of one with a rate random walk of 2 deg/h/√h; lines: "
        "IEEE Std 952",
    )  # fmt: skip
    axes = figure.subplots()
    rate_hz, averaging_s = 25.0, np.geomspace(0.2, 12_000.0, 60)
    time_s = np.arange(round(10.0 * 3600.0 * rate_hz)) / rate_hz
    zero = np.zeros((len(time_s), 3))
    upright = np.tile([0.0, 0.0, 0.0, 1.0], (len(time_s), 1))
    at_rest = rl.records.BodyMotion(time_s, zero, zero, upright, zero, zero)
    for walk_deg_h_sqrt_h, colour in ((0.0, palette.BLUE), (2.0, palette.RED)):
        gyro = rl.sensors.Gyro(
            name="gyro", preset="stim300_gyro", rate_hz=rate_hz, rate_random_walk_deg_h_sqrt_h=walk_deg_h_sqrt_h
        )
        samples, _ = gyro.measure(at_rest, rl.sensors.make_key(1, "gyro"), 0)
        for k, axis in enumerate((samples.angular_velocity_rad_s / units.DEG_H).T):
            label = "preset, three axes" if walk_deg_h_sqrt_h == 0.0 else "with a rate random walk"
            deviation = _allan_deviation(axis, rate_hz, averaging_s)
            axes.plot(
                averaging_s, deviation, ".-", color=colour, ms=3, lw=figures.THIN_PT, label=label if k == 0 else None
            )
    floor = gyro.bias_instability_deg_h
    for label, line, style in (
        ("angle random walk 0.15 deg/√h", 0.15 * 60.0 / np.sqrt(averaging_s), "--"),
        (f"bias instability {floor:g} deg/h", np.full_like(averaging_s, floor), ":"),
        ("rate random walk 2 deg/h/√h", 2.0 * np.sqrt(averaging_s / 3.0 / 3600.0), "-."),
    ):
        axes.plot(averaging_s, line, style, color=palette.INK, lw=figures.THIN_PT, label=label)
    axes.set(xscale="log", yscale="log", ylim=(0.1, 30.0))
    figures.style_axes(axes, x="Averaging time [s]", y="Allan deviation [deg/h]")
    key(axes)
    return figure


def _arrow(
    axes: Any, end: tuple[float, float], name: str, colour: str = palette.INK, start: tuple[float, float] = (0.0, 0.0)
) -> None:
    """Draw an axis or a direction with its name at the tip."""
    axes.annotate(
        "",
        end,
        start,
        arrowprops={"arrowstyle": "-|>", "color": colour, "lw": figures.LINE_PT, "shrinkA": 0, "shrinkB": 0},
    )
    tip = np.asarray(end) + 0.13 * (np.asarray(end) - start) / np.hypot(*(np.asarray(end) - start))
    axes.text(*tip, name, ha="center", va="center", color=colour, fontsize=figures.TEXT_PT)


def _plain(axes: Any, title: str, x: tuple[float, float], y: tuple[float, float]) -> None:
    """Prepare a drawing to scale, without numbers."""
    figures.style_axes(axes, title)
    axes.set(xlim=x, ylim=y, aspect="equal", xticks=[], yticks=[])
    axes.grid(visible=False)
    for side in axes.spines.values():
        side.set_visible(False)


def axes_chain() -> Any:
    """Axes of a target's orbit, of the pan-tilt unit and of the lidar, as docs/axes.md describes them."""
    figure = figures.new_figure(
        figures.PAGE_IN, 4.3, "From the orbit to the pixel", "axes by name; drawings are not to scale"
    )
    figure.get_layout_engine().set(w_pad=0.12)
    rtn, ptu, lidar = figure.subplots(1, 3)

    _plain(rtn, "rtn of the target, seen from orbit north", (-1.75, 1.45), (-1.5, 1.7))
    around = np.linspace(0.32, 1.1, 60) * np.pi
    rtn.plot(2.6 * np.cos(around), 2.6 * np.sin(around) - 2.6, color=palette.RULE, lw=figures.THIN_PT)
    rtn.text(0.0, -1.2, "Earth, far below", ha="center", va="center", color=palette.QUIET, fontsize=figures.SMALL_PT)
    _arrow(rtn, (0.0, 1.1), "x, radial", palette.BLUE)
    _arrow(rtn, (-1.1, 0.0), "y", palette.GREEN)
    rtn.text(-1.1, 0.2, "along-track", ha="center", va="center", color=palette.GREEN, fontsize=figures.SMALL_PT)
    rtn.plot(0.0, 0.0, "o", mfc=palette.PAPER, mec=palette.RED, mew=figures.LINE_PT, ms=10)
    rtn.plot(0.0, 0.0, ".", color=palette.RED)
    rtn.text(0.15, 0.22, "z, to the reader", ha="left", color=palette.RED, fontsize=figures.TEXT_PT)
    rtn.plot(1.05, -0.2, "s", color=palette.INK, ms=7)
    rtn.text(1.05, -0.48, "follower", ha="center", color=palette.INK, fontsize=figures.TEXT_PT)
    rtn.text(0.0, -0.35, "target", ha="center", color=palette.INK, fontsize=figures.TEXT_PT)

    _plain(ptu, "PTU on the follower, seen from above", (-1.0, 2.2), (-1.6, 1.6))
    ptu.fill([-0.45, 0.25, 0.25, -0.45], [-0.35, -0.35, 0.35, 0.35], color=palette.OTHER_PART)
    _arrow(ptu, (1.5, 0.0), "x", palette.QUIET)
    _arrow(ptu, (0.0, 1.3), "y", palette.QUIET)
    pan = np.linspace(0.0, 35.0 * units.DEG, 30)
    _arrow(ptu, (1.7 * math.cos(pan[-1]), 1.7 * math.sin(pan[-1])), "boresight", palette.BLUE)
    ptu.plot(np.cos(pan), np.sin(pan), color=palette.ORANGE, lw=figures.LINE_PT)
    ptu.text(1.12, 0.36, "pan > 0: left", color=palette.ORANGE, fontsize=figures.TEXT_PT, va="center")
    ptu.text(0.6, -0.85, "z is up, to the reader;", ha="center", color=palette.QUIET, fontsize=figures.SMALL_PT)
    ptu.text(0.6, -1.15, "tilt > 0 looks up", ha="center", color=palette.ORANGE, fontsize=figures.TEXT_PT)

    _plain(lidar, "lidar, as it looks at the scene", (-1.9, 1.9), (1.9, -1.9))
    for line in np.linspace(-1.2, 1.2, 9):
        lidar.plot([line, line], [-1.2, 1.2], color=palette.RULE, lw=figures.HAIR_PT)
        lidar.plot([-1.2, 1.2], [line, line], color=palette.RULE, lw=figures.HAIR_PT)
    _arrow(lidar, (1.45, 0.0), "x", palette.BLUE)
    _arrow(lidar, (0.0, 1.45), "y", palette.GREEN)
    lidar.plot(0.0, 0.0, "o", mfc=palette.PAPER, mec=palette.RED, mew=figures.LINE_PT, ms=10)
    lidar.plot(0.0, 0.0, "x", color=palette.RED, ms=6)
    paper = {"facecolor": palette.PAPER, "edgecolor": "none", "pad": 1.5}
    lidar.text(-0.2, -0.3, "z, boresight,\naway", ha="right", color=palette.RED, fontsize=figures.TEXT_PT, bbox=paper)
    lidar.text(-1.2, -1.38, "pixel (row 0, col 0)", ha="left", color=palette.QUIET, fontsize=figures.SMALL_PT)
    lidar.text(1.2, 1.5, "row, col grow", ha="right", color=palette.QUIET, fontsize=figures.SMALL_PT)
    return figure


def pictures_style() -> Any:
    """The style of all pictures: colours of lines, sizes of text, colours of parts, and colour maps."""
    figure = figures.new_figure(
        figures.PAGE_IN,
        4.6,
        "Style of pictures",
        "colours of the scheme of this page; maps and parts are the same in both",
    )
    lines, sizes, maps, parts = figure.subplots(2, 2, gridspec_kw={"height_ratios": (1.35, 1.0)}).flat
    x = np.linspace(0.0, 1.0, 60)
    names = ("BLUE", "ORANGE", "GREEN", "PINK", "SKY", "RED")
    for k, (name, colour) in enumerate(zip(names, palette.LINES, strict=True)):
        lines.plot(x, np.sin(3.0 * x + 0.45 * k), color=colour, lw=figures.THICK_PT, label=name)
    lines.axhline(0.0, color=palette.RULE, lw=figures.THIN_PT)
    figures.style_axes(lines, "Lines and categories", "Time [s]", "Range [m]")
    lines.legend(
        fontsize=figures.SMALL_PT,
        frameon=False,
        loc="upper left",
        bbox_to_anchor=(1.0, 1.0),
        labelcolor=palette.QUIET,
        borderaxespad=0.0,
    )
    words = {
        "TITLE_PT": figures.TITLE_PT,
        "HEADING_PT": figures.HEADING_PT,
        "TEXT_PT": figures.TEXT_PT,
        "SMALL_PT": figures.SMALL_PT,
    }
    for k, (name, size_pt) in enumerate(words.items()):
        sizes.text(
            0.0,
            0.9 - 0.27 * k,
            f"{name}: {size_pt:g} pt",
            fontsize=size_pt,
            color=palette.QUIET if k else palette.INK,
            va="center",
        )
    widths = {
        "HAIR_PT": figures.HAIR_PT,
        "THIN_PT": figures.THIN_PT,
        "LINE_PT": figures.LINE_PT,
        "THICK_PT": figures.THICK_PT,
        "WIDE_PT": figures.WIDE_PT,
    }
    for k, (name, width_pt) in enumerate(widths.items()):
        y = 0.94 - 0.21 * k
        sizes.plot([0.55, 0.68], [y, y], color=palette.INK, lw=width_pt)
        sizes.text(0.71, y, f"{name}: {width_pt:g} pt", fontsize=figures.SMALL_PT, color=palette.QUIET, va="center")
    sizes.set(xlim=(0, 1), ylim=(0, 1))
    sizes.set_axis_off()
    ramps = {
        "range": colour_maps.RANGE_RAMP,
        "intensity": colour_maps.INTENSITY_RAMP,
        "amount": colour_maps.AMOUNT_RAMP,
        "error": colour_maps.ERROR_RAMP,
    }
    for k, name in enumerate(ramps.values()):
        maps.imshow(colour_maps.ramp(name)[None], extent=(0, 256, 3.6 - k, 4.4 - k), aspect="auto")
    maps.imshow(np.array([[palette.split_rgb(palette.NO_RETURN)]]), extent=(0, 256, -0.4, 0.4), aspect="auto")
    maps.set(xlim=(0, 256), ylim=(-0.5, 4.5), xticks=[])
    figures.style_axes(maps, "Colour maps")
    maps.grid(visible=False)
    maps.set_yticks(range(5), ["no return", *reversed([f"{use}: {name}" for use, name in ramps.items()])])
    for k, colour in enumerate((*palette.PARTS, palette.OTHER_PART)):
        parts.imshow(np.array([[palette.split_rgb(colour)]]), extent=(k - 0.45, k + 0.45, 0, 1), aspect="auto")
    parts.set(xlim=(-0.5, len(palette.PARTS) + 0.5), ylim=(0, 1), yticks=[])
    figures.style_axes(parts, "Parts and classes on images")
    parts.grid(visible=False)
    parts.set_xticks(range(len(palette.PARTS) + 1), [*(f"{k}" for k in range(len(palette.PARTS))), "other"])
    return figure


FIGURES: dict[str, Callable[[], Any]] = {
    "palette": pictures_style,
    "axes_chain": axes_chain,
    "counts": counts,
    "detection": detection,
    "false_alarms": false_alarms,
    "precision": precision,
    "walk": walk,
    "strong_returns": strong_returns,
    "pixel": pixel,
    "gate": gate,
    "droop": droop,
    "shared": shared,
    "amplitude_crosstalk": neighbours,
    "report": report,
    "separation": separation,
    "operations": operations,
    "safety_ellipse": safety_ellipse,
    "relative_models": relative_models,
    "link_budget": link_budget,
    "my_camera": my_camera,
    "events": events,
    "dispersion": dispersion,
    "finding": finding,
    "models": models,
    "stray_light": stray_light,
    "smear": smear,
    "allan": allan,
    "published": published,
    "published_arrays": published_arrays,
    "camera_fit": camera_fit,
    "camera_maps": camera_maps,
    "camera_shots": camera_shots,
    "scan_lines": scan_lines,
    "second_bounce": second_bounce,
}


def main(names: Sequence[str] = ()) -> None:
    """Draw the figures of these names, or all."""
    if unknown := set(names) - set(FIGURES):
        known = ", ".join(FIGURES)
        sys.stderr.write(f"figures: {', '.join(sorted(unknown))}: no figure of this name; give some of {known}\n")
        sys.exit(2)
    for name in names or FIGURES:
        figure = FIGURES[name]()
        for scheme, ending in ((picture.LIGHT, ""), (picture.DARK, "_dark")):
            save_small_figure(figure, FOLDER / f"{name}{ending}.png", scheme)


if __name__ == "__main__":
    main(sys.argv[1:])

"""Solve the constants of the shipped detectors through the whole chain: `python -m rso_lidar.detector.bench.calibration`.

The reference state is a plate at normal incidence and a Gaussian pulse of 8 ns. 1000 mean photons reach the pixel, after the
optics and before quantum efficiency. Dark current and threshold spread are on, background is off. There 95 % of flashes are
detected (Fuller et al., sec. 3.3). ``noise_limited`` also has a threshold of 6 times the noise, ``offset_limited`` an
amplifier of 300 electrons. The curves of the empirical detector are then fitted to the chain's. Nothing here runs when a
user changes a setting.
"""

import math
import sys
from pathlib import Path

import numpy as np

from rso_lidar import units
from rso_lidar.detector.analysis.false_alarms import mean_false_alarms_per_s
from rso_lidar.detector.bench.trial import Trial, make_plate, run_trial
from rso_lidar.detector.chain.analog import simulate_analog
from rso_lidar.detector.chain.camera import camera_of
from rso_lidar.detector.chain.traces import arm_rows
from rso_lidar.detector.settings import presets
from rso_lidar.detector.settings.gsfl import Gsfl
from rso_lidar.detector.stages.comparator import mark_watched
from rso_lidar.detector.stages.time_axis import place_rows

REFERENCE_PHOTONS, REFERENCE_PROBABILITY, REFERENCE_FWHM_S = 1000.0, 0.95, 8e-9
THRESHOLD_OVER_NOISE, OFFSET_NOISE_ELECTRONS = 6.0, 300.0
_SEED = 20_240_917
_PIXELS = 16_384
_LEVELS = (400, 500, 600, 650, 700, 750, 800, 850, 900, 950, 1000, 1100, 1200, 1400, 2000, 4000, 10_000, 30_000)
_COUNTS = (1000, 3000, 10_000, 30_000, 60_000, 80_000, 95_000, 110_000, 150_000, 300_000)


def make_reference_pulse() -> tuple[float, np.ndarray]:
    """Return step [s] and power (tap) [1/s] of the reference pulse."""
    step_s = REFERENCE_FWHM_S / 48.0
    time = np.arange(-177, 178) / 24.0
    power = np.exp(-math.log(2.0) * time**2)
    return step_s, power / (power.sum() * step_s)


def simulate_peaks(gsfl: Gsfl, repeats: int) -> np.ndarray:
    """Simulate the greatest amplitude of the reference pulse at the comparators, over their pixel's factor of threshold."""
    rng = np.random.Generator(np.random.Philox(_SEED))
    photons = make_plate(REFERENCE_PHOTONS, _PIXELS, make_reference_pulse(), REFERENCE_FWHM_S)
    camera = camera_of(gsfl, photons)
    plan, comparators = camera.plan(0.0), camera.comparators
    rows, _ = arm_rows(comparators, place_rows(photons, plan), plan.step_s)
    axis = camera.axis(rows.length)
    watched = mark_watched(rows.length, rows.first, rows.last)
    bridge = axis.bridge
    height_over_threshold = []
    for _ in range(repeats):
        signals = simulate_analog(camera.front, axis, photons, rows, rng)
        amplitude = np.where(watched, signals.amplitude, -np.inf)
        height = amplitude.max(axis=1)
        sigma = comparators.noise_sigma(signals.primaries / axis.step_s + gsfl.apd.dark_electrons_per_s)
        pair = np.maximum(amplitude[:, :-1], amplitude[:, 1:])
        near = pair > (height - bridge.reach * bridge.sigma * sigma.max(axis=1))[:, None]
        row, step = np.nonzero(near & watched[:, :-1] & watched[:, 1:])
        path = bridge.path(signals.amplitude, signals.mean(), row, step, sigma[row, step], rng)
        np.maximum.at(height, row, path.max(axis=1))
        height_over_threshold.append(height / camera.front.pixels.threshold)
    return np.concatenate(height_over_threshold)


def solve_preset(noise_electrons: float | None, repeats: int = 24) -> tuple[float, float]:
    """Solve amplifier noise and threshold [electrons] for the reference state. Noise None: for threshold / noise = 6."""
    noise = noise_electrons or 1000.0
    threshold = 6.0 * noise
    for _ in range(1 if noise_electrons else 6):
        gsfl = Gsfl()
        gsfl = gsfl.replace(amplifier=gsfl.amplifier.replace(noise_electrons=noise))
        threshold = float(np.quantile(simulate_peaks(gsfl, repeats), 1.0 - REFERENCE_PROBABILITY))
        if noise_electrons is None:
            shot2 = gsfl.noise_electrons**2 - noise**2
            noise = math.sqrt((threshold / THRESHOLD_OVER_NOISE) ** 2 - shot2)
    return noise, threshold


def run_reference_trial(gsfl: Gsfl, photons: float, repeats: int = 2) -> Trial:
    """Run a trial at the reference state, over several flashes of a camera."""
    rng = np.random.Generator(np.random.Philox(_SEED + round(photons)))
    seen = make_plate(photons, _PIXELS, make_reference_pulse(), REFERENCE_FWHM_S)
    trials = [run_trial(gsfl, seen, rng) for _ in range(repeats)]
    return Trial(*(np.concatenate([getattr(trial, name) for trial in trials]) for name in Trial.__dataclass_fields__))


def fit_empirical(gsfl: Gsfl) -> dict[str, float]:
    """Fit the coefficients of the empirical detector to this detector's curves, by least squares."""
    from scipy.optimize import least_squares
    from scipy.special import ndtr

    levels = np.array(_LEVELS, dtype=float)
    trials = [run_reference_trial(gsfl, level) for level in _LEVELS]
    probability = np.array([trial.probability for trial in trials])
    still = gsfl.replace(timing=gsfl.timing.replace(pixel_jitter_ns=0.0))
    quantum, s = gsfl.quantum_efficiency, REFERENCE_FWHM_S / units.FWHM_PER_SIGMA

    def detection(x: np.ndarray) -> np.ndarray:
        def noise(n: np.ndarray | float) -> np.ndarray:
            return np.asarray(np.sqrt(x[0] ** 2 + x[1] * n / quantum))

        threshold = REFERENCE_PHOTONS - 1.644_853_626_951_472_6 * noise(REFERENCE_PHOTONS)
        return ndtr((levels - threshold) / noise(levels))  # type: ignore[no-any-return]

    fit = least_squares(lambda x: detection(x) - probability, [130.0, 3.5], bounds=([0.0, 1.0], [900.0, 60.0]))
    n = levels[probability > 0.5]  # of fewer photons only the lucky ones are seen
    noise_m = np.array([run_reference_trial(still, level).range_noise_m for level in n])
    sample_s = gsfl.readout.sample_s

    def spread(x: np.ndarray) -> np.ndarray:
        white = 2.0 * s * sample_s / math.sqrt(math.pi) * (x[0] / n) ** 2
        shot = s**2 * x[1] / (quantum * n)
        return np.asarray(units.RANGE_PER_DELAY_M_S * np.sqrt(shot + white))

    ranging = least_squares(lambda x: np.log(spread(x) / noise_m), [130.0, 3.5], bounds=([0.0, 0.1], [900.0, 60.0]))
    counts_at = np.array(_COUNTS, dtype=float)
    counts = np.array([float(run_reference_trial(gsfl, level, 1).intensity_counts.mean()) for level in _COUNTS])

    def bend_counts(x: np.ndarray) -> np.ndarray:
        linear = x[0] * counts_at
        return np.asarray(np.minimum(linear / (1.0 + (linear / x[1]) ** 4) ** 0.25, gsfl.full_scale_counts))

    bend = least_squares(lambda x: np.log(bend_counts(x) / counts), [0.04, 5000.0], bounds=([1e-3, 1e3], [1.0, 1e5]))
    levels = np.array([2000.0, 4000.0, 8000.0, 16_000.0, 32_000.0])
    noise_photons = (
        np.array([float(run_reference_trial(gsfl, level).intensity_counts.std()) for level in levels]) / bend.x[0]
    )

    def scatter(x: np.ndarray) -> np.ndarray:
        return np.asarray(np.sqrt(x[0] ** 2 + x[1] * levels / quantum + 1.0 / (12.0 * bend.x[0] ** 2)))

    intensity = least_squares(
        lambda x: np.log(scatter(x) / noise_photons), [130.0, 3.5], bounds=([0.0, 0.1], [900, 60])
    )
    return {
        "noise_equivalent_photons": float(fit.x[0]),
        "excess_noise_factor": float(fit.x[1]),
        "intensity_noise_equivalent_photons": float(intensity.x[0]),
        "intensity_excess_noise_factor": float(intensity.x[1]),
        "range_noise_equivalent_photons": float(ranging.x[0]),
        "range_excess_noise_factor": float(ranging.x[1]),
        "range_plateau_m": gsfl.timing.pixel_jitter_ns * units.NS * units.RANGE_PER_DELAY_M_S,
        "counts_per_photon": float(bend.x[0]),
        "compression_counts": float(bend.x[1]),
        "false_alarms_per_s": mean_false_alarms_per_s(gsfl),
    }


def _format_table(name: str, values: dict[str, float]) -> str:
    return "\n".join([f"[{name}]", *(f"{key} = {float(f'{value:.5g}')}" for key, value in values.items()), ""])


def write_presets(path: Path) -> None:
    """Solve both presets, fit the empirical detector to the first, and write all to a file."""
    tables = []
    for name, noise_electrons in (("noise_limited", None), ("offset_limited", OFFSET_NOISE_ELECTRONS)):
        noise, threshold = solve_preset(noise_electrons)
        values = {"noise_electrons": noise, "threshold_electrons": threshold}
        tables.append((name, values))
        gsfl = Gsfl()
        gsfl = gsfl.replace(
            amplifier=gsfl.amplifier.replace(noise_electrons=noise),
            trigger=gsfl.trigger.replace(threshold_electrons=threshold),
        )
        reached = run_reference_trial(gsfl, REFERENCE_PHOTONS, 8).probability
        sys.stdout.write(f"{name}: {values}, detects {reached:.4f} of {REFERENCE_PHOTONS:g} photons\n")
        if noise_electrons is None:
            fitted = fit_empirical(gsfl)
            sys.stdout.write(f"empirical: {fitted}\n")
    remark = "# Written by `make calibrate` (python -m rso_lidar.detector.bench.calibration); edit that, not this.\n"
    path.write_text(
        "\n".join([remark, *(_format_table(*table) for table in [*tables, ("empirical", fitted)])]), encoding="utf-8"
    )


if __name__ == "__main__":
    write_presets(Path(presets.__file__).with_name("presets.toml"))

"""What `check` and `track` say of range noise against what frames show, with all that couples the pixels of a flash."""

import datetime
import math
import re

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.detector import detect
from rso_lidar.evaluation.track_quality.range_noise import estimate_range_noise_m
from tests.detector.returns_for_tests import returns
from tests.optics.bench_for_tests import plate, write_stl

START = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)
LENS = rl.Receiver(fov_deg=0.5, aperture_mm=104.75, n_rows=24, n_cols=24, rays_per_pixel=4)
QUARTILES = 1.348_979_500_392_163_6  # between those of a normal law of rms 1


def bench(folder, side_m, laser=None, frames=12, euler_deg=(0.0, 0.0, 0.0), receiver=LENS, **detector):
    """Return a black room with one plate 500 m ahead, seen `frames` times."""
    write_stl(folder / "plate.stl", plate(side_m))
    return rl.Scenario(
        version=1,
        name="plate",
        seed=3,
        world=rl.World(axes="local"),
        time=rl.Time(start_utc=START, duration_s=float(frames), frame_rate_hz=1.0),
        target=(
            rl.Target(
                name="plate",
                model=str(folder / "plate.stl"),
                motion=rl.Fixed(position_m=(500.0, 0.0, 0.0)),
                attitude=rl.FixedAttitude(euler_zyx_deg=(euler_deg[0], 90.0 + euler_deg[1], euler_deg[2])),
                material=rl.Lambertian(reflectance=0.30),
                center_of_mass_m=(0.0, 0.0, 0.0),
            ),
        ),
        follower=rl.Follower(motion=rl.Fixed(position_m=(0.0, 0.0, 0.0))),
        lidar=rl.Lidar(
            laser=laser or rl.Laser(energy_mj=0.2, divergence_deg=0.5),
            receiver=receiver,
            detector=rl.Gsfl(**detector),
        ),
    )


def said(scenario):
    """Return probability and range noise [m] of the median pixel, as `check` prints them."""
    line = next(line for line in scenario.describe().splitlines() if line.startswith("  first"))
    probability, noise_cm = (re.search(rf"{words} ([\d.]+)", line)[1] for words in (r"P\(detect\)", "range noise"))
    return float(probability), float(noise_cm) / 100.0


def simulated(scenario):
    """Return the same of the plate's whole pixels in all frames."""
    errors, found = [], []
    for frame in rl.simulate(scenario):
        photons = frame.labels.photons
        whole = photons > 0.97 * np.median(photons[photons > 0.0])
        off = (frame.range_m - frame.labels.range_m)[whole]
        seen = np.abs(off) < 5.0
        errors.append(off[seen])
        found.append(seen)
    low, high = np.quantile(np.concatenate(errors), [0.25, 0.75])
    return float(np.concatenate(found).mean()), float(high - low) / QUARTILES


DIM = rl.Laser(energy_mj=0.06, divergence_deg=0.5)
JITTERY = rl.Laser(energy_mj=0.06, divergence_deg=0.5, energy_jitter_fraction=0.15, timing_jitter_ns=0.4)
STILL = {"pixel_jitter_ns": 0.0}
CASES = {
    "crosstalk, the plate fills the view": {"side_m": 6.0, "crosstalk": {}},
    "crosstalk, the plate fills a tenth of it": {"side_m": 1.5, "crosstalk": {"noise_m": 1.0}, "timing": STILL},
    "crosstalk, a tilted plate": {
        "side_m": 9.0,
        "euler_deg": (0.0, 35.0, 0.0),
        "crosstalk": {"noise_m": 0.4},
        "timing": STILL,
    },
    "crosstalk, calibrated at half the array": {
        "side_m": 6.0,
        "crosstalk": {"offset_m": 0.5, "calibrated_fraction": 0.5},
    },
    "droop by a third near the threshold": {
        "side_m": 6.0,
        "laser": DIM,
        "droop": {"capacitance_nf": 0.006, "resistance_ohm": 1e4},
        "timing": STILL,
    },
    "maps and speckle": {"side_m": 6.0, "maps": {}, "speckle": {"depolarising": False}, "timing": STILL},
    "a gate of two pulses with droop": {
        "side_m": 6.0,
        "laser": DIM,
        "gate": {"delay_ns": 3300.0, "width_ns": 60.0, "pulses": 2},
        "droop": {"capacitance_nf": 0.02},
        "timing": {"pixel_jitter_ns": 0.2, "frame_jitter_ns": 0.2},
        "frames": 32,
    },
    "several returns": {
        "side_m": 6.0,
        "max_returns": 3,
        "returns": "strongest",
        "crosstalk": {"noise_m": 0.1},
        "timing": STILL,
    },
    "jitter of frames and of the laser": {
        "side_m": 6.0,
        "laser": JITTERY,
        "timing": {"pixel_jitter_ns": 0.1, "frame_jitter_ns": 0.5},
        "frames": 160,
    },
}
QUICK = {"crosstalk, the plate fills the view", "several returns"}


def mark_slow(cases):
    """Return cases, with all but two marked as slow: each takes a second or two of CPU."""
    return [pytest.param(case, marks=() if case in QUICK else pytest.mark.slow) for case in cases]


@pytest.mark.parametrize("case", mark_slow(CASES))
def test_check_says_what_frames_show(case, tmp_path, validation):
    """Probability and range noise of a pixel, said by `check` from a trial, and pooled over a plate in simulated frames.

    Range noise is to agree within 15 %, the probability within 0.03. Frames that move as a whole are few: their jitter is
    known to 1/√(2 frames), 6 % of 160 and 13 % of 32, in which it is less than a fifth of the variance.
    """
    scenario = bench(tmp_path, **CASES[case])
    told_probability, told_m = said(scenario)
    probability, noise_m = simulated(scenario)
    validation(
        case=f"{case}: range noise that `check` states",
        source="simulated frames of the same scenario",
        expected=noise_m,
        got=told_m,
        tolerance=0.15 * noise_m,
        unit="m",
    )
    assert told_probability == pytest.approx(probability, abs=0.03)


@pytest.mark.parametrize(
    "case",
    mark_slow(
        [
            "crosstalk, the plate fills the view",
            "crosstalk, the plate fills a tenth of it",
            "droop by a third near the threshold",
            "maps and speckle",
            "several returns",
        ]
    ),
)
def test_track_takes_the_range_noise_that_frames_have(case, tmp_path, validation):
    """Estimated from what the sensor said, never from labels; within 15 % of the errors of the plate's whole pixels.

    Its pixels are many against those at its edges, except where it fills a tenth of the view; there 22 % are edges.
    """
    scenario = bench(tmp_path, **CASES[case])
    _, noise_m = simulated(scenario)
    validation(
        case=f"{case}: range noise that `track` takes",
        source="simulated frames of the same scenario",
        expected=noise_m,
        got=estimate_range_noise_m(scenario.instrument, list(rl.simulate(scenario))),
        tolerance=0.15 * noise_m,
        unit="m",
    )


def test_a_checkerboard_is_ranged_as_published(tmp_path, validation):
    """Half of the array triggered, default timing and Crosstalk(): 8.04 cm (Opt. Eng. 60(8) 083101, abstract)."""
    part = rl.Gsfl(crosstalk=rl.detector.Crosstalk())
    lit = np.arange(0, 128 * 128, 2)
    photons = returns(np.full(lit.size, 50.0), 30_000.0, pixel=lit, shape=(128, 128))
    range_m = detect(photons, part, np.random.default_rng(5))[0].range_m.ravel()[lit]
    low, high = np.quantile(range_m, [0.25, 0.75])
    validation(
        case="single-shot range precision before a checkerboard that fills the view, Crosstalk()",
        source="Opt. Eng. 60(8) 083101 (2021), abstract: 8.04 cm; shot noise adds 1 cm in squares here",
        expected=0.0804,
        got=float(high - low) / QUARTILES,
        tolerance=0.004,
        unit="m",
    )
    assert abs(float(np.median(range_m)) - 50.0) < 4.0 * 1.2533 * 0.08 / math.sqrt(lit.size)  # no mean shift is left

"""Frames of many pulses, between which targets, follower and PTU move: against the convolution with a box, and counting.

A point that moves evenly while n pulses are sent is spread evenly over its path: its place is convolved with a box as long
as the path, whose mean is the place in the middle and whose variance is the path squared over 12, (n + 1) / (n - 1) times
that for n pulses from one end of it to the other.
"""

import datetime
import math

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar import units

RANGE_M, PULSES, RATE_HZ = 100.0, 48, 1000.0
PIXEL_M = 2.0 * RANGE_M * math.tan(units.DEG) / 16
EXPOSURE_S = (PULSES - 1) / RATE_HZ
SHARE = math.sqrt((PULSES + 1) / (PULSES - 1) / 12.0)  # rms of n points, evenly from one end of a path to the other
STILL = {"motion": {"type": "fixed", "position_m": [0, 0, 0]}}
GATE = {"type": "gsfl", "gate": {"delay_ns": 620, "width_ns": 96, "pulses": PULSES}}
COUNTER = {
    "type": "geiger",
    "gate_from_m": 90,
    "gate_to_m": 110,
    "pulses": PULSES,
    "jitter_ns": 0,
    "peak_ns": 12,
    "dark_count_rate_hz": 0,
}


def coast(time_s, state, inputs):
    """Return the derivatives of position and velocity without force."""
    return np.concatenate([state[3:], np.zeros(3)])


def moving(position_m, velocity_m_s):
    """Return a motion that is at `position_m` in the middle of the exposure of frame 0."""
    begin_m = np.array(position_m, dtype=float) - 0.5 * EXPOSURE_S * np.array(velocity_m_s)
    state = (*begin_m.tolist(), *map(float, velocity_m_s))
    return {"motion": {"type": "state_space", "axes": "local", "dynamics": coast, "initial_state": state}}


def scene(target, follower=STILL, detector=GATE, ptu=None, rate_hz=RATE_HZ, frames=1, energy_mj=2.0, rays=64, **plate):
    """Return a mission of a plate before a camera of 16 x 16 pixels, 1/8 degree each, on the bench."""
    return rl.Scenario(
        version=1,
        name="a plate that moves",
        seed=11,
        world={"axes": "local"},
        time={
            "start_utc": datetime.datetime(2024, 9, 17, tzinfo=datetime.UTC),
            "duration_s": frames,
            "frame_rate_hz": 1,
        },
        target=[{"name": "plate", "model": "plate", "scale": 0.25} | target | plate],
        follower=follower,
        ptu=ptu,
        lidar={
            "laser": {"energy_mj": energy_mj, "pulse_fwhm_ns": 4, "divergence_deg": 4, "pulse_rate_hz": rate_hz},
            "receiver": {"fov_deg": 2, "n_rows": 16, "n_cols": 16, "f_number": 2.8, "rays_per_pixel": rays},
            "detector": detector,
        },
    )


def fly(scenario, *keep):
    (frame,) = rl.simulate(scenario, frames=[0], keep=keep, threads=1)
    return frame


def spread_m(frame, pixels=slice(None)):
    """Return mean and rms [m] of half the path of all light in some rows of pixels."""
    light = frame.kept["photons"]
    range_m = light.delay_s * units.RANGE_PER_DELAY_M_S
    mean = np.average(range_m, weights=light.photons)
    return mean, math.sqrt(np.average((range_m - mean) ** 2, weights=light.photons))


@pytest.mark.parametrize("speed_m_s", [2.0, 20.0, -60.0])
def test_motion_along_the_line_of_sight(validation, speed_m_s):
    """The plate is wider than the field and flat: ranges of its rays differ by 15 mm, to the corners of the field."""
    path_m = abs(speed_m_s) * EXPOSURE_S
    frame = fly(scene(moving([RANGE_M, 0, 0], [speed_m_s, 0, 0]), scale=2.0), "photons")
    still = fly(scene({"motion": {"type": "fixed", "position_m": [RANGE_M, 0, 0]}}, scale=2.0), "photons")
    epochs = len(frame.truth.exposure.time_s)
    mean_m, rms_m = spread_m(frame)
    sent_m = np.linspace(-0.5, 0.5, PULSES) * path_m
    within_m2 = (
        np.var(sent_m) - np.var(frame.truth.exposure.time_s - frame.time_s) * speed_m_s**2
    )  # of pulses cast at once
    still_m, still_rms_m = spread_m(still)
    validation(
        case=f"{PULSES} pulses, plate at {speed_m_s:g} m/s along the line of sight, cast at {epochs} epochs: rms of ranges",
        source="box of length v T: v T / sqrt 12, for n pulses",
        expected=path_m * SHARE,
        got=math.sqrt(rms_m**2 - still_rms_m**2 + within_m2),
        tolerance=2e-3 * path_m * SHARE,
        unit="m",
    )
    validation(
        case=f"{PULSES} pulses, plate at {speed_m_s:g} m/s along the line of sight: mean range",
        source="place in the middle; nearer light is brighter by 1 / R²",
        expected=still_m - 2.0 * (path_m * SHARE) ** 2 / RANGE_M,
        got=mean_m,
        tolerance=2e-4,
        unit="m",
    )
    assert frame.truth.pose("lidar", "plate").translation[2] == pytest.approx(RANGE_M, abs=1e-9)
    assert float(np.nanmean(frame.labels.range_m)) == pytest.approx(mean_m, abs=2e-3)


def width_m(frame):
    """Return the rms [m] of the samples about their mean, summed over the pixels that the plate fills."""
    waveforms = frame.kept["waveforms"]
    filled = frame.labels.filled_fraction.ravel()[waveforms.pixel] > 0.99
    trace = (waveforms.samples_counts[filled] - waveforms.baseline_counts).mean(axis=0)
    range_m = np.arange(len(trace)) * waveforms.sample_s * units.RANGE_PER_DELAY_M_S
    mean = np.average(range_m, weights=trace)
    return math.sqrt(np.average((range_m - mean) ** 2, weights=trace))


def test_the_samples_of_a_gate_are_convolved_with_the_path(validation):
    """Without noise of the amplifier worth mention: the plate returns 9000 photons a pixel and pulse, over 49 pixels."""
    still, moved = (fly(scene(moving([RANGE_M, 0, 0], [speed_m_s, 0, 0])), "waveforms") for speed_m_s in (0.0, 30.0))
    validation(
        case=f"gate of {PULSES} pulses, plate at 30 m/s along the line of sight: growth of the mean waveform's rms, squared",
        source="box of length v T: (v T)² / 12, for n pulses",
        expected=(30.0 * EXPOSURE_S * SHARE) ** 2,
        got=width_m(moved) ** 2 - width_m(still) ** 2,
        tolerance=0.02 * (30.0 * EXPOSURE_S * SHARE) ** 2,
        unit="m2",
    )


def columns(frame):
    """Return the share of the plate's light in each column of pixels."""
    photons = frame.labels.photons.sum(axis=0)
    return photons / photons.sum()


def trapezium(path_m, wide_m=1.0):
    """Return the share of a plate's light in each column (16), if it moves from -path/2 to path/2 across the boresight."""
    at_m = np.linspace(-0.5, 0.5, 4001) * path_m
    edge_m = (np.arange(17) - 8.0) * PIXEL_M
    covered = [np.clip(edge_m, at - 0.5 * wide_m, at + 0.5 * wide_m) for at in at_m]
    return np.diff(np.mean(covered, axis=0)) / wide_m


ACROSS = {  # 4 pixels in the exposure
    "the target": lambda path_m: scene(moving([RANGE_M, 0, 0], [0, path_m / EXPOSURE_S, 0])),
    "the follower": lambda path_m: scene(
        {"motion": {"type": "fixed", "position_m": [RANGE_M, 0, 0]}}, moving([0, 0, 0], [0, path_m / EXPOSURE_S, 0])
    ),
    "the PTU": lambda path_m: scene(
        {"motion": {"type": "fixed", "position_m": [RANGE_M, 0, 0]}},
        ptu={
            "point": {
                "type": "scan",
                "pattern": "raster",
                "pan_deg": 0.5 * math.degrees(path_m / RANGE_M) - 5.0,
                "half_width_deg": 5.0,
                "step_deg": 1.0,
                "half_height_deg": 0.0,
                "rate_deg_s": math.degrees(path_m / RANGE_M) / EXPOSURE_S,
            }
        },
    ),
}


@pytest.mark.parametrize("what", ACROSS)
def test_motion_across_the_line_of_sight(validation, what):
    frame = fly(ACROSS[what](4.0 * PIXEL_M))
    expected, full = trapezium(4.0 * PIXEL_M * PULSES / (PULSES - 1)), PIXEL_M / 1.0
    validation(
        case=f"{what} moves by 4 pixels in {PULSES} pulses, cast at {len(frame.truth.exposure.time_s)} epochs: worst column",
        source="box of 4 pixels: trapezium, in light of a column that the plate fills",
        expected=0.0,
        got=float(np.abs(columns(frame) - expected).max()) / full,
        tolerance=0.015,
        unit="1",
    )
    assert np.count_nonzero(columns(frame)) >= 7 + 4 - 1


def test_a_plate_that_spins(validation):
    """A plate that faces the lidar in the middle of the exposure, and turns by 60 degrees about the vertical meanwhile."""
    turn = 60.0 * units.DEG
    rate_deg_s = 60.0 / EXPOSURE_S
    quaternion = [0.0, 0.0, math.sin(-0.25 * turn), math.cos(-0.25 * turn)]  # 30 degrees back from facing
    attitude = {"type": "spin", "axis": [0, 0, 1], "rate_deg_s": rate_deg_s, "quaternion_xyzw": quaternion}
    place = {"motion": {"type": "fixed", "position_m": [RANGE_M, 0, 0]}, "scale": 9.25 * PIXEL_M / 4.0}
    frame, still = (
        fly(scene(place, attitude=one)) for one in (attitude, {"type": "fixed", "quaternion_xyzw": [0, 0, 0, 1]})
    )
    angles = np.linspace(-0.5, 0.5, PULSES) * turn
    middle = (slice(7, 9), slice(7, 9))
    validation(
        case=f"plate turns by 60 degrees in {PULSES} pulses: light of a pixel that it fills",
        source="Lambert: mean cosine over the turn, of n pulses",
        expected=float(np.cos(angles).mean()),
        got=float(frame.labels.photons[middle].sum() / still.labels.photons[middle].sum()),
        tolerance=2e-4,
        unit="1",
    )
    validation(
        case=f"plate turns by 60 degrees in {PULSES} pulses: area that it covers",
        source="mean cosine over the turn, of n pulses",
        expected=9.25**2 * float(np.cos(angles).mean()),
        got=float(frame.labels.filled_fraction.sum()),
        tolerance=0.2,
        unit="pixels",
    )


def test_a_pulse_counts_one_photon_of_its_own_light(validation):
    """A bright edge enters a pixel after a quarter of the pulses, and fills it after three quarters.

    Its mean light spread over all pulses would make all of them count.
    """
    speed_m_s = 2.0 * PIXEL_M / EXPOSURE_S
    # The left edge of the plate, 1 m wide, is over the middle of column 7 in the middle of the exposure.
    frame = fly(scene(moving([RANGE_M, 0.5 * PIXEL_M - 0.5, 0], [0, speed_m_s, 0]), detector=COUNTER, energy_mj=0.004))
    covered = np.clip(np.linspace(-0.5, 1.5, PULSES), 0.0, 1.0)
    mean = 0.4 * float(frame.labels.photons[7:9, 7].mean())
    fired = -np.expm1(-mean * covered / covered.mean())
    assert 0.98 < -math.expm1(-mean) < 1.0 - 1e-6
    validation(
        case=f"bright edge that crosses two pixels of a Geiger array in {PULSES} pulses: counts",
        source="Poisson: sum of 1 - exp(-PDE N) over the pulses, each with its own light",
        expected=2.0 * float(fired.sum()),
        got=float(frame.intensity_counts[7:9, 7].sum()),
        tolerance=4.0 * math.sqrt(2.0 * float((fired * (1.0 - fired)).sum())),
        unit="counts",
    )


def test_each_pulse_has_its_own_energy_and_delay(validation):
    """Over 400 frames: what is left of the jitter after averaging."""
    laser = rl.Laser(energy_jitter_fraction=0.2, timing_jitter_ns=1.0, energy_mj=2.0)
    fired = [laser.fire_pulses(np.random.default_rng(k), PULSES) for k in range(400)]
    energies, late_s = np.array([one.energy_mj for one, _, _ in fired]), np.array([one for _, one, _ in fired])
    band = 4.0 / math.sqrt(2.0 * 400)
    for what, expected, got in (
        ("energy", 0.2, energies.std() / 2.0),
        ("delay [ns]", 1.0, late_s.std() / units.NS),
    ):
        validation(
            case=f"mean {what} of {PULSES} pulses with a jitter of {expected:g} each: rms",
            source="independent pulses: 1 / sqrt n",
            expected=expected / math.sqrt(PULSES),
            got=float(got),
            tolerance=band * expected / math.sqrt(PULSES),
            unit="1" if what == "energy" else "ns",
        )

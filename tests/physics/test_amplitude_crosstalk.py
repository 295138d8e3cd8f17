"""One bright pixel, or a whole wall, with crosstalk in amplitude: what the neighbours show, against closed forms."""

import numpy as np
import pytest

from rso_lidar.detector import AmplitudeCrosstalk, Gsfl, detect, detect_with_taps, make_point_returns
from rso_lidar.detector.stages.neighbour_coupling import list_neighbours
from rso_lidar.optics import Laser

LASER = Laser()
SHAPE = (11, 13)
BRIGHT = (5, 6)
RANGE_M = 900.0
# No noise but that of the avalanche in the bright pixel, and a converter without steps.
CLEAN = {
    "preset": "offset_limited",
    "amplifier": {"noise_electrons": 0.0},
    "apd": {"dark_current_na": 0.0},
    "trigger": {"threshold_spread_fraction": 0.0, "threshold_electrons": 500.0},
    "timing": {"pixel_jitter_ns": 0.0},
    "readout": {"quantised": False, "electrons_per_count": 4000.0},
    "ranging": {"algorithm": "parabola"},
}


def light(photons, shape=SHAPE, bright=(BRIGHT,)):
    pixel = np.array(sorted(row * shape[1] + col for row, col in bright))
    every = np.ones(len(pixel))
    return make_point_returns(shape, LASER.pulse, LASER.pulse_fwhm_s, pixel, RANGE_M * every, photons * every)


def peaks(detector, photons, seed=1):
    """Return the highest amplitude (row, col) [electrons] behind the coupling, 0 where nothing latched."""
    _, _, taps = detect_with_taps(photons, detector, np.random.default_rng(seed))
    top = np.zeros(photons.shape)
    top.ravel()[taps.pixel] = taps.amplitude_electrons.max(axis=1)
    return top


def test_neighbours_of_one_bright_pixel_show_the_published_levels(validation):
    """Without noise of the amplifiers, a neighbour's amplitude is that of the bright pixel, scaled."""
    top = peaks(Gsfl(**CLEAN, amplitude_crosstalk={}), light(1e6))
    row, col = BRIGHT
    for distance, level_db in ((1, -40.0), (2, -46.667), (3, -53.333), (4, -60.0)):
        around = [top[row, col + distance], top[row, col - distance], top[row + distance, col]]
        shown_db = 20 * np.log10(np.array(around) / top[BRIGHT])
        assert shown_db == pytest.approx([level_db] * 3, abs=1e-3)
        if distance in (1, 4):  # published; between them a straight line is assumed
            validation(
                case=f"crosstalk in amplitude, {distance} pixel{'s' * (distance > 1)} from a bright one, preset pixell",
                source="LeddarTech, user guide 54A0049 7.0, sec. 2.2: about 40 dB below it, and 60 dB from 4 pixels",
                expected=level_db,
                got=shown_db.mean(),
                tolerance=0.01,  # float32
                unit="dB",
            )
    assert 20 * np.log10(top[row + 1, col + 1] / top[BRIGHT]) == pytest.approx(-40 - (2**0.5 - 1) * 20 / 3, abs=1e-3)
    assert top[row + 5, col] == top[row, col + 5] == 0.0
    assert np.count_nonzero(top) == 1 + len(list_neighbours(AmplitudeCrosstalk())[0])


def test_neighbours_report_the_range_of_the_bright_pixel_and_its_counts_scaled():
    reading, _ = detect(light(1e6), Gsfl(**CLEAN, amplitude_crosstalk={}), np.random.default_rng(2))
    row, col = BRIGHT
    # The same samples, scaled: the same vertex. Phases of the clock differ where thresholds are crossed a sample later.
    assert reading.range_m[row, col + 1] == pytest.approx(reading.range_m[BRIGHT], abs=0.02)
    assert reading.intensity_counts[row, col + 1] == pytest.approx(0.01 * reading.intensity_counts[BRIGHT], abs=1.0)


def test_a_wall_rises_by_the_sum_of_all_shares():
    shape = (17, 17)
    every = [(row, col) for row in range(17) for col in range(17)]
    wall, sums = light(5e4, shape, every), 1.0 + list_neighbours(AmplitudeCrosstalk())[1].sum()
    off, on = (
        np.mean([peaks(Gsfl(**CLEAN, **part), wall, seed)[5:12, 5:12].mean() for seed in range(4)])
        for part in ({}, {"amplitude_crosstalk": {}})
    )
    # Shot noise of 49 pixels and 4 frames: F = 3.5, 4e4 primaries, 0.07 % for each mean; 4 sigma of the ratio.
    assert on / off == pytest.approx(sums, rel=4 * 2**0.5 * 0.0007)


def test_a_dark_pixel_triggers_once_the_share_passes_its_threshold():
    """P(trigger) = Q((T − c A)/σ) and a little more, as noise has some nanoseconds at the peak."""
    shape = (32, 96)
    bright = [(row, col) for row in range(0, 32, 2) for col in range(1, 96, 3)]
    gsfl = Gsfl(
        amplitude_crosstalk={"levels_db": (-40.0,), "along": "rows"}, trigger={"threshold_spread_fraction": 0.0}
    )
    dark = np.ones(shape, bool)
    dark[tuple(np.transpose(bright))] = False
    dark[1::2] = False  # whole rows without light stay dark
    share = {}
    for times in (0.55, 1.0, 1.5):
        photons = times * 100.0 * gsfl.trigger.threshold_electrons / peak_electrons_per_photon(gsfl)
        reading, _ = detect(light(photons, shape, bright), gsfl, np.random.default_rng(3))
        share[times] = float(np.isfinite(reading.range_m[dark]).mean())
        assert np.isfinite(reading.range_m[1::2]).mean() < 0.002
    assert share[0.55] < 0.02  # 2.7 sigma below
    assert 0.45 < share[1.0] < 0.9
    assert share[1.5] > 0.995  # 3 sigma above


def peak_electrons_per_photon(gsfl):
    from rso_lidar.detector import Pulse

    amplifier = gsfl.amplifier
    pulse = Pulse.after(*LASER.pulse, amplifier.pole_s, amplifier.integration_s)
    return gsfl.electrons_per_photon * pulse.peak


def test_a_clipped_amplifier_couples_its_rail_and_no_more():
    saturation = {"rail_electrons": 400_000.0, "recovery_ns": 4.0}
    gsfl = Gsfl(**CLEAN, saturation=saturation, amplitude_crosstalk={"levels_db": (-40.0,)})
    row, col = BRIGHT
    for photons in (1e6, 1e8):
        top = peaks(gsfl, light(photons))
        assert top[BRIGHT] == 400_000.0
        assert top[row, col + 1] == pytest.approx(4_000.0, rel=1e-5)
    open_ended = peaks(gsfl.replace(saturation=None), light(1e8))
    assert open_ended[row, col + 1] == pytest.approx(0.01 * open_ended[BRIGHT], rel=1e-5)
    assert open_ended[row, col + 1] > 1e6
    wall = peaks(gsfl, light(1e6, (9, 9), [(r, c) for r in range(9) for c in range(9)]))
    assert np.all(wall == 400_000.0)  # the sum of shares does not pass the rail either


def test_pixels_behind_a_gate_show_it_too():
    gsfl = Gsfl(
        **{**CLEAN, "trigger": {}, "amplifier": {"noise_electrons": 100.0}},
        gate={"delay_ns": RANGE_M / 0.149896 - 60.0, "width_ns": 150.0},
        amplitude_crosstalk={"levels_db": (-30.0,)},
    )
    reading, _ = detect(light(1e6), gsfl, np.random.default_rng(5))
    row, col = BRIGHT
    assert reading.range_m[row, col + 1] == pytest.approx(RANGE_M, abs=0.1)
    ratio = reading.intensity_counts[row, col + 1] / reading.intensity_counts[BRIGHT]
    assert 20 * np.log10(ratio) == pytest.approx(-30.0, abs=0.1)
    assert np.isfinite(reading.range_m).sum() <= 5 + 1


def test_light_far_behind_a_bright_return_couples_too():
    """A pixel that has latched on its first return still couples the light of its second."""
    pixel = BRIGHT[0] * SHAPE[1] + BRIGHT[1]
    two = make_point_returns(
        SHAPE, LASER.pulse, LASER.pulse_fwhm_s, np.full(2, pixel), np.array([500.0, 1500.0]), np.array([5e4, 1e7])
    )
    gsfl = Gsfl(**{**CLEAN, "trigger": {"threshold_electrons": 50_000.0}}, amplitude_crosstalk={"levels_db": (-40.0,)})
    reading, _ = detect(two, gsfl, np.random.default_rng(6))
    assert reading.range_m[BRIGHT] == pytest.approx(500.0, abs=0.1)
    assert reading.range_m[BRIGHT[0] - 1, BRIGHT[1]] == pytest.approx(1500.0, abs=0.1)


def test_the_frame_is_the_same_with_any_number_of_threads():
    every = [(row, col) for row in range(40) for col in range(40)]
    wall = light(3e4, (40, 40), every)
    gsfl = Gsfl(amplitude_crosstalk={})
    one, two = (detect(wall, gsfl, np.random.default_rng(7), threads)[0] for threads in (1, 2))
    assert np.array_equal(one.range_m, two.range_m, equal_nan=True)
    assert np.array_equal(one.intensity_counts, two.intensity_counts)


def test_pixels_of_a_trial_do_not_couple():
    gsfl = Gsfl(amplitude_crosstalk={})
    assert gsfl.has_coupled_pixels and not gsfl.alone().has_coupled_pixels
    assert not Gsfl().has_coupled_pixels

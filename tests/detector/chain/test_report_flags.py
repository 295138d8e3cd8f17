"""Flags of returns as the sensor says them and as they are: single and overlapping pulses, bright neighbours, clipping."""

import math

import numpy as np
import pytest

from rso_lidar.detector import Gsfl, detect, label_flags, make_plate, make_point_returns
from rso_lidar.detector.chain.report_flags import measure_widths, sum_near_light, sum_neighbours
from rso_lidar.detector.settings.focal_plane import AmplitudeCrosstalk
from rso_lidar.detector.stages.neighbour_coupling import list_neighbours
from rso_lidar.optics import Laser
from rso_lidar.records import Labels
from tests.reference.detector import report_flags as reference

LASER = Laser()
FLAGGED = {"report": {"flags": True}, "timing": {"pixel_jitter_ns": 0.0}}
N = 2048


def sky(shape):
    """Return labels of an empty scene."""
    kinds = {"range_m": "f8", "first_range_m": "f8", "cluster_count": "u1", "target": "i2", "part": "i2", "facet": "i4"}
    kinds |= {"cos_incidence": "f4", "photons": "f4", "filled_fraction": "f4"}
    return Labels(**{name: np.zeros(shape, kind) for name, kind in kinds.items()})


def flash(gsfl, photons, seed=1):
    reading, _ = detect(photons, gsfl, np.random.default_rng(seed))
    return reading, label_flags(gsfl, sky(photons.shape), photons, reading)


def two_pulses(photons, apart_m):
    """Return the light of two surfaces in each of N pixels, at all phases of the clock."""
    near_m = make_plate(1.0, N, LASER.pulse, LASER.pulse_fwhm_s, 300.0).delay_s * 299_792_458.0 / 2.0
    range_m = np.stack([near_m, near_m + apart_m], axis=1).ravel()
    pixel = np.repeat(np.arange(N), 2)
    return make_point_returns((1, N), LASER.pulse, LASER.pulse_fwhm_s, pixel, range_m, np.full(2 * N, photons))


def test_widths_are_those_of_gaussian_pulses_by_straight_lines():
    step = np.arange(200.0)
    place, sigma = np.array([60.3, 100.0, 140.7]), np.array([5.0, 10.0, 20.0])
    samples = np.exp(-0.5 * ((step - place[:, None]) / sigma[:, None]) ** 2)
    # A chord over one sample is off by at most |s''| / 8 over the slope: below 0.01 samples here.
    assert measure_widths(samples, place, np.full(3, 0.5)) == pytest.approx(
        sigma * math.sqrt(8 * math.log(2)), abs=0.03
    )
    cut = measure_widths(samples[:, 50:], place - 50.0, np.full(3, 0.5))
    assert cut[0] == pytest.approx(5.0 * math.sqrt(8 * math.log(2)), abs=0.03)
    assert measure_widths(samples[:1, 60:], place[:1] - 60.0, np.full(1, 0.5))[0] == pytest.approx(6.2, abs=0.1)


@pytest.mark.parametrize("photons", [800.0, 3_000.0, 50_000.0])
def test_single_pulses_are_not_called_superimposed(photons):
    reading, labels = flash(Gsfl(**FLAGGED), make_plate(photons, N, LASER.pulse, LASER.pulse_fwhm_s))
    assert reading.superimposed.mean() < 0.003  # 4 sigma, with the tails of avalanches
    assert not labels.superimposed.any() and not labels.crosstalk.any() and not labels.saturated.any()


def test_overlapping_pulses_are_called_superimposed_where_they_are():
    for apart_m, said, true in ((0.3, 0.0, 0.0), (1.2, 1.0, 1.0), (1.5, 1.0, 1.0), (3.0, 0.0, 0.0)):
        reading, labels = flash(Gsfl(**FLAGGED), two_pulses(10_000.0, apart_m))
        assert reading.superimposed.mean() == pytest.approx(said, abs=0.02), apart_m
        assert labels.superimposed.mean() == pytest.approx(true, abs=0.02), apart_m


def test_a_weak_second_pulse_is_true_but_not_seen():
    photons = two_pulses(10_000.0, 1.0)
    photons.photons.setflags(write=True)
    photons.photons[1::2] *= 0.3
    reading, labels = flash(Gsfl(**FLAGGED), photons)
    assert labels.superimposed.mean() > 0.98 and reading.superimposed.mean() < 0.02


def test_neighbours_of_a_bright_pixel_are_crosstalk_and_say_so():
    shape, bright = (11, 11), 5 * 11 + 5
    pixel, range_m = np.array([bright, bright + 2]), np.array([900.0, 905.0])  # the second has light of its own
    light = make_point_returns(shape, LASER.pulse, LASER.pulse_fwhm_s, pixel, range_m, np.array([1e5, 5e4]))
    gsfl = Gsfl(**FLAGGED, amplitude_crosstalk={"levels_db": (-26.0, -60.0)})
    reading, labels = flash(gsfl, light)
    expected = np.zeros(shape, bool)
    expected[4:7, 4:7] = expected[4:7, 6:9] = True  # within a pixel of either; on diagonals 1.4 pixels, -40 dB
    expected[5, [5, 7]] = False
    for flags in (reading.crosstalk, labels.crosstalk):
        assert not flags.astype(bool)[~expected].any()
        assert flags[[4, 6, 5, 4, 6], [5, 5, 4, 7, 7]].all()  # at -26 dB they trigger in any case
        assert np.array_equal(flags.astype(bool), np.isfinite(reading.range_m) & expected)


def test_a_false_trigger_is_no_crosstalk():
    """A dark pixel that reports another range than its bright neighbour."""
    shape = (1, 3)
    light = make_point_returns(
        shape, LASER.pulse, LASER.pulse_fwhm_s, np.array([1]), np.array([900.0]), np.array([1e6])
    )
    gsfl = Gsfl(**FLAGGED, amplitude_crosstalk={"levels_db": (-40.0,)})
    reading, _ = detect(light, gsfl, np.random.default_rng(1))
    moved = reading.range_m.copy()
    moved[0, 0] = 500.0
    labels = label_flags(gsfl, sky(shape), light, type(reading)(moved, reading.intensity_counts, reading.saturated))
    assert labels.crosstalk.tolist() == [[0, 0, 1]]


def test_what_clips_is_saturated_and_said_so():
    gsfl = Gsfl(**FLAGGED)
    full = gsfl.readout.clip_counts * gsfl.readout.electrons_per_count / gsfl.electrons_per_photon
    for times, share in ((0.8, 0), (1.4, 1)):  # of the amplitude before the amplifier, which lowers it by 7 %
        reading, labels = flash(gsfl, make_plate(times * full, N, LASER.pulse, LASER.pulse_fwhm_s))
        for flags in (reading.saturated, labels.saturated):
            assert np.count_nonzero(flags != share) <= 2  # a false trigger before the light is not saturated
    railed = gsfl.replace(saturation={"rail_electrons": 100_000.0})
    reading, labels = flash(railed, make_plate(20_000.0, N, LASER.pulse, LASER.pulse_fwhm_s))
    assert labels.saturated.mean() > 0.998 and reading.saturated.mean() > 0.998
    assert not reading.superimposed.any()  # the width of a clipped pulse tells nothing of depths


@pytest.mark.parametrize("returns", ["first", "last"])
def test_a_reported_return_is_superimposed_also_where_another_return_of_the_pixel_clips(returns):
    """Two surfaces 1.2 m apart, and a bright one 5 m before or behind them: of the pair only the width is looked at."""
    gsfl = Gsfl(**FLAGGED, readout={"samples": 48}, returns=returns, max_returns=4)
    full = gsfl.readout.clip_counts * gsfl.readout.electrons_per_count / gsfl.electrons_per_photon
    near_m = make_plate(1.0, N, LASER.pulse, LASER.pulse_fwhm_s, 300.0).delay_s * 299_792_458.0 / 2.0
    apart_m = {"first": (0.0, 1.2, 6.2), "last": (0.0, 5.0, 6.2)}[returns]
    photons = {"first": (1e4, 1e4, 2.0 * full), "last": (2.0 * full, 1e4, 1e4)}[returns]
    range_m, pixel = np.stack([near_m + apart for apart in apart_m], axis=1).ravel(), np.repeat(np.arange(N), 3)
    light = make_point_returns((1, N), LASER.pulse, LASER.pulse_fwhm_s, pixel, range_m, np.tile(photons, N))
    reading, labels = flash(gsfl, light)
    assert (np.isfinite(reading.return_range_m).sum(axis=-1) == 2).mean() > 0.98
    for flags in (reading.superimposed, labels.superimposed):
        assert flags.mean() > 0.98
    assert not labels.saturated.any() and reading.saturated.all()  # of the reading: some sample clipped


def test_without_flags_a_frame_has_none():
    light = make_plate(5_000.0, 64, LASER.pulse, LASER.pulse_fwhm_s)
    for gsfl in (Gsfl(), Gsfl(report={})):
        reading, labels = flash(gsfl, light)
        assert reading.crosstalk is reading.superimposed is labels.crosstalk is labels.saturated is None
    bare, flagged = (detect(light, Gsfl(report={"flags": on}), np.random.default_rng(4))[0] for on in (False, True))
    assert np.array_equal(bare.range_m, flagged.range_m, equal_nan=True)  # they draw no random number


def test_sums_over_neighbours_are_those_of_the_reference():
    rng = np.random.default_rng(6)
    shape = (9, 8)
    range_m = (500.0 + rng.choice([0.0, 0.5, 8.0], shape)).astype(np.float32)
    range_m[rng.uniform(size=shape) < 0.3] = np.nan
    counts = np.where(np.isfinite(range_m), rng.uniform(30.0, 4000.0, shape), 0.0)
    offset, factor = list_neighbours(AmplitudeCrosstalk(levels_db=(-20.0, -30.0)))
    by_kernel, by_reference = np.empty(shape), np.empty(shape)
    sum_neighbours(range_m, counts, offset.astype(np.int64), factor, 1.3, by_kernel)
    reference.sum_neighbours(range_m, counts, offset, factor, 1.3, by_reference)
    assert by_kernel == pytest.approx(by_reference)
    assert by_kernel.max() > 100.0

    n = 200
    pixel = np.sort(rng.integers(0, 72, n))
    first = np.searchsorted(pixel, np.arange(73))
    delay_s = 3e-6 + rng.uniform(0.0, 40e-9, n)
    reported_s = np.where(np.isfinite(range_m.ravel()), 3e-6 + rng.uniform(0.0, 40e-9, 72), np.nan)
    given = first, delay_s, rng.uniform(1.0, 1e5, n), rng.uniform(0.0, 5e-9, n), reported_s, 8
    given += offset.astype(np.int64), factor, 3e4, 12e-9
    sums = [tuple(np.zeros(72) for _ in range(4)) for _ in range(2)]
    sum_near_light(*given, sums[0])
    reference.sum_near_light(*given, sums[1])
    for ours, theirs in zip(*sums, strict=True):
        assert ours == pytest.approx(theirs, rel=1e-9, abs=1e-30) and ours.any()

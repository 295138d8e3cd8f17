"""What makes pixels and flashes differ: each part does what its source says, and none is on by default."""

import math
from dataclasses import replace

import numpy as np
import pytest

from rso_lidar.detector import (
    Apd,
    Crosstalk,
    Defects,
    Droop,
    Gsfl,
    Maps,
    Saturation,
    Speckle,
    Timing,
    advise,
    detect,
    make_plate,
    run_trial,
)
from rso_lidar.detector.bench.calibration import make_reference_pulse
from rso_lidar.detector.chain.analog import draw_speckle_factors
from rso_lidar.detector.chain.camera import camera_of, draw_camera_pixels
from rso_lidar.detector.chain.timing import plan_time
from rso_lidar.detector.stages.array_effects import draw_shift_m, draw_speckle, latch_share, limit_amplitude, solve_gain
from rso_lidar.detector.stages.nonuniformity import draw_pixels
from rso_lidar.detector.stages.time_axis import place_rows
from rso_lidar.errors import ScenarioError
from tests.detector.returns_for_tests import nothing, returns, simulate_rows

C = 299_792_458.0
ELECTRON_C = 1.602_176_634e-19
QUIET = Gsfl(preset="offset_limited", timing={"pixel_jitter_ns": 0.0}, readout={"quantised": False})
N = 4096
FLOAT32_M = 3e-4  # a range of 3 km in float32, twice


def flash(gsfl, photons=20_000.0, n=N, seed=1):
    """Return ranges [m] and counts of n pixels on a plate, NaN where none."""
    reading, _ = detect(make_plate(photons, n, make_reference_pulse(), 8e-9), gsfl, np.random.default_rng(seed))
    ranges = reading.range_m.ravel().astype(float)
    return ranges, np.where(np.isfinite(ranges), reading.intensity_counts.ravel().astype(float), np.nan)


def slope(y, x):
    """Return the slope of y over x and its standard error, from pixels where both are known."""
    known = np.isfinite(x) & np.isfinite(y)
    x, y = x[known] - x[known].mean(), y[known] - y[known].mean()
    k = (x * y).sum() / (x * x).sum()
    return k, (y - k * x).std() / math.sqrt((x * x).sum())


def test_none_of_it_is_on_by_default():
    part = Gsfl()
    assert [part.maps, part.defects, part.saturation, part.droop, part.crosstalk, part.speckle] == [None] * 6
    plain = draw_camera_pixels(part, 100)
    assert np.all(plain.gain == 1.0) and not (plain.offset_counts.any() or plain.t0_s.any())
    assert not (plain.dead.any() or plain.hot.any())


# ----------------------------------------------------------------------------------------------------------------- maps


def test_maps_have_the_spread_that_is_asked_for_and_leave_each_other_alone():
    """4 standard errors, σ/√(2n), of each standard deviation."""
    n = 16_384
    maps = Maps(gain_spread_fraction=0.08, offset_spread_counts=4.0, t0_spread_ns=0.5)
    one = draw_pixels(n, 3, Apd(), 0.05, maps, Defects(dead_fraction=0.01, hot_fraction=0.03))
    for values, spread in ((one.threshold, 0.05), (one.gain, 0.08), (one.offset_counts, 4.0), (one.t0_s, 0.5e-9)):
        assert values.std() == pytest.approx(spread, rel=4.0 / math.sqrt(2.0 * n))
    for mask, share in ((one.dead, 0.01), (one.hot, 0.03)):
        assert abs(mask.mean() - share) < 4.0 * math.sqrt(share * (1.0 - share) / n)
    assert not (one.dead & one.hot).any()
    other = draw_pixels(n, 3, Apd(), 0.05, maps.replace(t0_spread_ns=0.0), None)
    assert np.array_equal(one.gain, other.gain) and np.array_equal(one.offset_counts, other.offset_counts)
    assert np.array_equal(one.threshold, other.threshold)
    assert abs(np.corrcoef(one.gain, draw_pixels(n, 4, Apd(), 0.05, maps, None).gain)[0, 1]) < 4.0 / math.sqrt(n)


@pytest.mark.parametrize(("calibrated", "left"), [(False, 1.0), (True, 0.1)], ids=["raw", "calibrated"])
def test_readings_scatter_by_the_t0_map(calibrated, left):
    """Against the same flash without the map, a pixel's range moves by its t0 times c/2; calibrated, by what is left."""
    maps = Maps(gain_spread_fraction=0.0, offset_spread_counts=0.0, t0_spread_ns=0.6, calibrated=calibrated)
    part = QUIET.replace(maps=maps)
    moved = flash(part)[0] - flash(QUIET)[0]
    assert np.nanmax(np.abs(moved - left * draw_camera_pixels(part, N).t0_s * C / 2.0)) < FLOAT32_M
    assert np.nanstd(moved) == pytest.approx(left * 0.6e-9 * C / 2.0, rel=4.0 / math.sqrt(2.0 * N))


@pytest.mark.parametrize(("calibrated", "left"), [(False, 1.0), (True, 0.1)], ids=["raw", "calibrated"])
def test_counts_follow_the_gain_map(calibrated, left):
    """Counts over those without the map, regressed on the gain: 4 standard errors, and the square of the 8 % spread."""
    maps = Maps(gain_spread_fraction=0.08, offset_spread_counts=0.0, t0_spread_ns=0.0, calibrated=calibrated)
    part = QUIET.replace(maps=maps)
    k, error = slope(flash(part)[1] / flash(QUIET)[1], draw_camera_pixels(part, N).gain)
    assert abs(k - left) < 4.0 * error + 0.08**2
    assert error < 0.02


def test_counts_follow_the_offset_map_and_calibration_takes_nine_tenths_off():
    maps = Maps(gain_spread_fraction=0.0, offset_spread_counts=10.0, t0_spread_ns=0.0)
    part = QUIET.replace(maps=maps)
    raw, raw_error = slope(flash(part)[1] - flash(QUIET)[1], draw_camera_pixels(part, N).offset_counts)
    known = part.replace(maps=maps.replace(calibrated=True))
    left, left_error = slope(flash(known)[1] - flash(QUIET)[1], draw_camera_pixels(part, N).offset_counts)
    assert raw > 0.2 and raw_error < 0.01
    assert abs(left - 0.1 * raw) < 4.0 * math.hypot(left_error, 0.1 * raw_error)


# -------------------------------------------------------------------------------------------------------------- defects


@pytest.mark.parametrize("gate", [None, {"delay_ns": 19_990.0, "width_ns": 60.0}], ids=["triggered", "gated"])
def test_dead_pixels_never_report(gate):
    part = Gsfl(defects=Defects(dead_fraction=0.05, hot_fraction=0.0), gate=gate)
    dead = draw_camera_pixels(part, N).dead
    reading, waveforms = detect(make_plate(20_000.0, N, make_reference_pulse(), 8e-9), part, np.random.default_rng(2))
    valid = np.isfinite(reading.range_m.ravel())
    assert 150 < dead.sum() < 260 and not valid[dead].any() and valid[~dead].all()
    assert not np.isin(waveforms.pixel, np.flatnonzero(dead)).any()


def test_there_are_no_more_defects_than_pixels():
    with pytest.raises(ScenarioError, match="is over 1; reduce"):
        Defects(dead_fraction=0.6, hot_fraction=0.6)


# ----------------------------------------------------------------------------------------------------------- saturation


@pytest.mark.parametrize("overdrive", [1.5, 4.0, 50.0])
def test_a_brief_pulse_is_stretched_by_recovery_times_the_log_of_its_overdrive(overdrive):
    part, step_s = Saturation(rail_electrons=1000.0, recovery_ns=4.0), 0.05e-9
    spike = np.zeros((1, 1000), np.float32)
    spike[0, 100] = 1000.0 * overdrive
    out = limit_amplitude(part, spike, step_s)[0]
    held_s = np.count_nonzero(out[100:] >= 1000.0) * step_s
    assert held_s == pytest.approx(4e-9 * math.log(overdrive), abs=1.01 * step_s)
    assert not out[:100].any() and out.max() == 1000.0
    # Then it decays with the time constant.
    tail = out[100:][out[100:] < 1000.0][:200]
    assert np.log(tail[:-1] / tail[1:]) == pytest.approx(step_s / 4e-9, rel=1e-3)


def test_below_the_rail_nothing_happens():
    rng = np.random.default_rng(0)
    amplitude = rng.normal(0.0, 300.0, (5, 100)).astype(np.float32)
    assert np.array_equal(limit_amplitude(Saturation(rail_electrons=2000.0), amplitude, 1e-9), amplitude)


def test_an_overdriven_pulse_leaves_the_rail_late():
    """A pulse s(t) is on the rail until the last t + recovery ln(s(t)/rail): what t had to let go of. One step of 0.4 ns."""
    part = QUIET.replace(steps_per_sample=6, saturation=Saturation(rail_electrons=200_000.0, recovery_ns=4.0))
    photons = returns(np.array([3000.0]), 100_000.0)
    plan = plan_time(part, 8e-9)
    rows = place_rows(photons, plan)
    out = simulate_rows(part, photons, rows, None).amplitude[0]
    on_rail = np.flatnonzero(out >= 0.999 * 200_000.0)
    left_s = (rows.start[0] + on_rail[-1]) * plan.step_s - photons.delay_s[0]
    time_s = np.linspace(-10e-9, 20e-9, 6001)
    over = 8.0 * 100_000.0 * camera_of(part, photons).pulse.amplitude(time_s) / 200_000.0
    predicted_s = max(t + 4e-9 * math.log(x) for t, x in zip(time_s, over, strict=True) if x > 1.0)
    assert left_s == pytest.approx(predicted_s, abs=plan.step_s)
    assert predicted_s > time_s[over > 1.0].max()  # later than the pulse itself


def test_a_saturated_return_is_late_flagged_and_no_higher_than_the_rail():
    saturation = Saturation(rail_electrons=200_000.0, recovery_ns=4.0)
    centroid = QUIET.replace(ranging={"algorithm": "centroid"})
    seen = make_plate(100_000.0, 1000, make_reference_pulse(), 8e-9)
    clean = run_trial(centroid, seen, np.random.default_rng(3))
    railed = run_trial(centroid.replace(saturation=saturation), seen, np.random.default_rng(3))
    assert abs(clean.range_bias_m) < 0.05 and railed.range_bias_m > clean.range_bias_m + 0.1
    reading, _ = detect(seen, QUIET.replace(saturation=saturation), np.random.default_rng(3))
    assert reading.saturated.all()
    dim = make_plate(20_000.0, 1000, make_reference_pulse(), 8e-9)  # 160,000 electrons
    assert not detect(dim, QUIET.replace(saturation=saturation), np.random.default_rng(3))[0].saturated.any()
    assert not detect(make_plate(80_000.0, 1000, make_reference_pulse(), 8e-9), QUIET, np.random.default_rng(3))[
        0
    ].saturated.any()


# ---------------------------------------------------------------------------------------------------------------- droop


def test_droop_is_the_discharge_of_a_capacitor():
    """C dV/dt = (V₀ − V)/R − i: after a charge Q, Q/C exp(−t/RC); under a steady current I, v = I R (1 − exp(−t/RC)).

    A sag of v leaves 1/(1 + 0.05 v) of the gain. In the second case it is so small that the current stays I.
    """
    part, step_s = Droop(capacitance_nf=10.0, resistance_ohm=1000.0, gain_slope_per_v=0.05), 1e-9
    time_s = np.arange(40_000) * step_s
    burst = np.zeros(40_000)
    burst[0] = 1e11
    sag_v = 1e11 * ELECTRON_C / 10e-9 * np.exp(-(time_s[1:] - step_s) / 10e-6)
    assert solve_gain(part, burst, step_s)[0] == 1.0
    assert solve_gain(part, burst, step_s)[1:] == pytest.approx(1.0 / (1.0 + 0.05 * sag_v), abs=1e-6)
    steady = np.full(40_000, 1e6)
    sag_v = 1e6 * ELECTRON_C / step_s * 1000.0 * -np.expm1(-time_s / 10e-6)
    lost = 0.05 * sag_v
    assert solve_gain(part, steady, step_s) == pytest.approx(
        1.0 - lost, abs=lost[-1] * (step_s / 10e-6 + 2.0 * lost[-1])
    )


@pytest.mark.parametrize("electrons", [1e5, 1e9, 1e12])
def test_sag_and_gain_are_solved_together(electrons):
    """The end of a long pulse is steady: v (1 + k v) = I R, a quadratic, at any load; so is sunlight before the flash."""
    part, step_s = Droop(capacitance_nf=1.0, resistance_ohm=50.0, gain_slope_per_v=0.22), 1e-9
    current_v = (
        electrons * ELECTRON_C / 1e-9 / -math.expm1(-step_s / 50e-9)
    )  # the sum over steps that recover in between
    sag_v = (math.sqrt(1.0 + 4.0 * 0.22 * current_v) - 1.0) / (2.0 * 0.22)
    assert solve_gain(part, np.full(4000, electrons), step_s)[-1] == pytest.approx(1.0 / (1.0 + 0.22 * sag_v), rel=2e-6)
    loaded_v = electrons / step_s * ELECTRON_C * 50.0
    sag_v = (math.sqrt(1.0 + 4.0 * 0.22 * loaded_v) - 1.0) / (2.0 * 0.22)
    sunlit = solve_gain(part, np.zeros(5), step_s, steady_per_s=electrons / step_s)
    assert sunlit == pytest.approx(1.0 / (1.0 + 0.22 * sag_v), rel=2e-6)


def test_the_default_slope_is_that_of_the_data_sheet_and_within_millers():
    """M = a/(V_b − V), a = 40 to 50 V (Excelitas C30662): M/a per volt at M = 10. Miller: V_b = 50 to 70 V, n = 1 to 3."""
    slope = Droop().gain_slope_per_v
    assert 10.0 / 50.0 <= slope <= 10.0 / 40.0
    miller = [n * 9.0 / (v_b * 0.9 ** (1.0 / n)) for v_b in (50.0, 70.0) for n in (1.0, 3.0)]
    assert min(miller) <= slope <= max(miller)


def test_a_preset_of_droop_fills_the_keys_that_are_not_given():
    """A pixel of 40 µm has a quarter of the 0.24 pF of 80 µm; the slope is M/a at twice the gain."""
    small, large = Droop(preset="small_junctions"), Droop()
    assert small.capacitance_nf == pytest.approx(0.24e-3 / 4.0 * 128**2, rel=0.02)
    assert small.gain_slope_per_v == 2.0 * large.gain_slope_per_v
    assert small.replace(preset="large_junctions") == large
    assert Droop(preset="small_junctions", capacitance_nf=3.0).capacitance_nf == 3.0
    assert Droop(**small.model_dump()) == small
    assert (large.slope_gain, small.slope_gain, small.replace(gain_slope_per_v=0.3).slope_gain) == (10.0, 20.0, None)


def test_a_slope_of_another_gain_is_told():
    """Slope M/a of the data sheet: 0.44 per volt belongs to a gain of 20."""
    small, large = Droop(preset="small_junctions"), Droop()
    told = advise(Gsfl(droop=small), 8e-9)
    assert any("slope of the gain 0.44 / V belongs to a gain of 20, not of 10" in line for line in told)
    for fine in (
        Gsfl(droop=small, apd={"gain": 20.0}),
        Gsfl(droop=large),
        Gsfl(droop=large.replace(gain_slope_per_v=0.0)),
    ):
        assert not any("droop" in line for line in advise(fine, 8e-9))


def test_a_bright_array_dims_every_pixel():
    """4032 pixels flash; 2 µs later 64 others see what the supply has recovered: 4 standard errors, and their own."""
    late = np.arange(N) >= N - 64
    range_m = np.where(late, 3300.0, 3000.0)
    photons = returns(range_m, 20_000.0)
    dark = QUIET.replace(apd={"dark_current_na": 0.0})
    droop = Droop(capacitance_nf=0.046, resistance_ohm=10e-6 / 0.046e-9, gain_slope_per_v=0.05)
    before, _ = detect(photons, dark, np.random.default_rng(4))
    after, _ = detect(photons, dark.replace(droop=droop), np.random.default_rng(4))
    ratio = after.intensity_counts.ravel() / before.intensity_counts.ravel().astype(float)
    charge_c = (N - 64) * 20_000.0 * 8.0 * ELECTRON_C
    # The flash dims itself: slope · sag u grows by slope · dQ / C / (1 + u), so u + u²/2 = slope · Q / C.
    sag = (math.sqrt(1.0 + 2.0 * 0.05 * charge_c / 0.046e-9) - 1.0) * math.exp(-2e-6 / 10e-6)
    fall = 1.0 - 1.0 / (1.0 + sag)
    assert fall > 0.05
    own = 0.05 * 64 * 20_000.0 * 8.0 * ELECTRON_C / 0.046e-9
    assert abs(1.0 - ratio[late].mean() - fall) < 4.0 * ratio[late].std() / math.sqrt(64) + own
    assert 0.0 < 1.0 - ratio[~late].mean() < fall * math.exp(0.2)  # they feel part of their own flash
    few = returns(range_m[:64], 20_000.0)
    alone = detect(few, dark.replace(droop=droop), np.random.default_rng(5))[0].intensity_counts.mean()
    assert alone == pytest.approx(detect(few, dark, np.random.default_rng(5))[0].intensity_counts.mean(), rel=own)


# ------------------------------------------------------------------------------------------------------------ crosstalk


def test_crosstalk_grows_with_the_share_of_the_array_that_latches_together():
    """Mean offset · s and scatter noise · s (Opt. Eng. 60(8) 083101's model); 4 standard errors of 6,000 pixels."""
    part = Crosstalk(offset_m=0.4, noise_m=0.2)
    latch_s = np.concatenate([np.full(6000, 20e-6), 30e-6 + np.arange(50) * 10e-9])
    shift = draw_shift_m(part, latch_share(latch_s, latch_s, 2.38e-9, 10_000), np.random.default_rng(6))
    together, alone = shift[:6000], shift[6000:]
    assert abs(together.mean() - 0.6 * 0.4) < 4.0 * 0.6 * 0.2 / math.sqrt(6000)
    assert together.std() == pytest.approx(0.6 * 0.2, rel=4.0 / math.sqrt(12_000))
    assert np.abs(alone).max() < 1e-4 * (0.4 + 5.0 * 0.2)


def test_within_one_clock_before_or_after_counts_as_together():
    part = Crosstalk(offset_m=1.0, noise_m=0.0)
    latch_s = np.array([0.0, 2.0, 2.9, 9.0]) * 1e-9
    share = latch_share(latch_s, latch_s, 2.5e-9, 100)
    assert share == pytest.approx([0.02, 0.03, 0.02, 0.01])
    assert draw_shift_m(part, share, np.random.default_rng(0)) == pytest.approx(share)
    assert latch_share(np.array([1e-9, 20e-9]), latch_s, 2.5e-9, 100) == pytest.approx([0.03, 0.0])


def test_calibration_takes_off_the_mean_shift_of_the_share_that_it_saw():
    share = np.array([0.0, 0.25, 0.5, 1.0])
    part = Crosstalk(offset_m=0.4, noise_m=0.0, calibrated_fraction=0.5)
    assert draw_shift_m(part, share, np.random.default_rng(0)) == pytest.approx([-0.2, -0.1, 0.0, 0.2])
    assert not draw_shift_m(
        Crosstalk(noise_m=0.0), share, np.random.default_rng(0)
    ).any()  # a calibrated camera by default


def test_a_plate_that_fills_the_view_is_the_worst_case():
    part = QUIET.replace(crosstalk=Crosstalk(offset_m=0.3, noise_m=0.0), trigger={"threshold_spread_fraction": 0.0})
    plain = QUIET.replace(trigger={"threshold_spread_fraction": 0.0})
    for lit, share in ((N, 1.0), (N // 8, 0.125)):
        photons = returns(np.full(lit, 3000.0), 50_000.0, shape=(64, 64))
        moved = detect(photons, part, np.random.default_rng(7))[0].range_m - detect(
            photons, plain, np.random.default_rng(7)
        )[0].range_m.astype(float)
        assert np.nanmedian(moved) == pytest.approx(0.3 * share, rel=0.01, abs=FLOAT32_M)


# -------------------------------------------------------------------------------------------------------------- speckle


@pytest.mark.parametrize(("wavelength_nm", "contrast"), [(1064.0, 0.034), (1570.0, 0.050)])
def test_speckle_of_the_seeds_lens(wavelength_nm, contrast):
    """M = 1 + A Ω/λ² for a filled pixel of 340.94 µrad behind 104.75 mm: contrast 1/√M, over √2 where it depolarises.

    The published figures are rounded to a tenth of a per cent; the sample's are known to 4/√(2n).
    """
    n = 100_000
    cells = math.pi / 4.0 * 0.10475**2 * (340.94e-6 / (wavelength_nm * 1e-9)) ** 2
    rng = np.random.default_rng(8)
    plain = draw_speckle(Speckle(depolarising=False), np.full(n, cells), rng)
    both = draw_speckle(Speckle(), np.full(n, cells), rng)
    assert plain.std() == pytest.approx((1.0 + cells) ** -0.5, rel=4.0 / math.sqrt(2.0 * n))
    assert plain.std() == pytest.approx(contrast, abs=0.0005 + 4.0 * contrast / math.sqrt(2.0 * n))
    assert both.std() == pytest.approx(0.7071 * (1.0 + cells) ** -0.5, rel=4.0 / math.sqrt(2.0 * n))
    for factors in (plain, both):
        assert abs(factors.mean() - 1.0) < 4.0 * factors.std() / math.sqrt(n)


def test_a_surface_speckles_as_one():
    """Returns of a cluster share their factor, and their cells add up."""
    photons = returns(np.full(40_000, 3000.0), 100.0, np.repeat(np.arange(20_000), 2), (1, 20_000))
    shared = returns(
        np.full(40_000, 3000.0), 100.0, np.repeat(np.arange(20_000), 2), (1, 20_000), np.repeat(np.arange(20_000), 2)
    )
    part = QUIET.replace(speckle=Speckle(depolarising=False))
    one = draw_speckle_factors(part.speckle, shared, np.random.default_rng(9)).reshape(-1, 2)
    assert np.array_equal(one[:, 0], one[:, 1])
    assert one[:, 0].std() == pytest.approx(1771.0**-0.5, rel=4.0 / math.sqrt(40_000))
    two = draw_speckle_factors(part.speckle, photons, np.random.default_rng(9)).reshape(-1, 2)
    assert abs(np.corrcoef(two.T)[0, 1]) < 4.0 / math.sqrt(20_000)
    assert draw_speckle_factors(QUIET.speckle, photons, np.random.default_rng(9)) is None
    assert draw_speckle_factors(part.speckle, nothing((2, 2)), np.random.default_rng(9)) is None


def test_intensity_scatters_by_speckle():
    """A small lit area, M = 3.56 modes: contrast 53 % (a CubeSat at 10 km); the gamma law's own spread over n pixels."""
    photons = replace(returns(np.full(N, 3000.0), 10_000.0), coherence_cells=np.full(N, 2.56))
    part = QUIET.replace(speckle=Speckle(depolarising=False))
    counts = detect(photons, part, np.random.default_rng(10))[0].intensity_counts.ravel()
    # Kurtosis of the gamma law 3 + 6/M: the variance of the variance is (2 + 6/M) σ⁴/n. Few are too dim to be seen.
    tolerance = 4.0 * 0.5 * math.sqrt((2.0 + 6.0 / 3.56) / N)
    assert counts.std() / counts.mean() == pytest.approx(3.56**-0.5, rel=tolerance + 0.01)


# --------------------------------------------------------------------------------------------------------------- timing


def test_jitter_of_pixels_is_the_5_cm_plateau():
    """0.334 ns is 5 cm; against the same flash without it, 4/√(2n)."""
    moved = flash(QUIET.replace(timing=Timing()))[0] - flash(QUIET)[0]
    assert np.nanstd(moved) == pytest.approx(0.0501, rel=4.0 / math.sqrt(2.0 * N))
    assert abs(np.nanmean(moved)) < 4.0 * 0.05 / math.sqrt(N)


def test_jitter_of_a_frame_is_common_to_it():
    part = QUIET.replace(timing=Timing(pixel_jitter_ns=0.0, frame_jitter_ns=1.0))
    frames = [flash(part, n=64, seed=k)[0] - flash(QUIET, n=64, seed=k)[0] for k in range(40)]
    assert max(np.nanstd(frame) for frame in frames) < FLOAT32_M
    # Standard deviation of 40 frames: 0.15 m within 4/√80 of itself.
    assert np.std([np.nanmean(frame) for frame in frames]) == pytest.approx(0.15, rel=4.0 / math.sqrt(80.0))

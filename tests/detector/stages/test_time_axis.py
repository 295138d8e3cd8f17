"""Expected light on an axis of time: nothing is lost, nothing moves, and surfaces that are one stay one."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import find_peaks

from rso_lidar.detector import Gsfl, detect
from rso_lidar.detector.chain.camera import camera_of
from rso_lidar.detector.chain.timing import plan_time
from rso_lidar.detector.stages.convolution import transform_pulse
from rso_lidar.detector.stages.light import sharing_response, spread_light
from rso_lidar.detector.stages.time_axis import place_rows
from tests.detector.returns_for_tests import returns, simulate_rows

C = 299_792_458.0
GSFL = Gsfl(preset="offset_limited", max_returns=4, armed_to_m=20_000.0, timing={"pixel_jitter_ns": 0.0})
PLAN = plan_time(GSFL, 8e-9)


def deep(photons, spread_s):
    """Return the photons with returns as deep as `spread_s`."""
    return replace(photons, depth_spread_s=np.broadcast_to(np.asarray(spread_s, dtype=float), photons.pixel.shape))


def long_rows(photons):
    """Return one row for each pixel that holds all its returns, however deep."""
    rows = place_rows(photons, PLAN)
    _, one = np.unique(rows.pixel, return_index=True)
    cut = {name: getattr(rows, name)[one] for name in ("pixel", "start", "first", "last")}
    return replace(rows, **cut, length=256)


def moments(photons, spread_s=0.0):
    """Return sum, mean [steps since emission] and variance [steps²] of the light in the row of each pixel."""
    photons = deep(photons, spread_s)
    rows = long_rows(photons)
    light = spread_light(photons, rows, PLAN.step_s).astype(float)
    place = np.arange(rows.length) - PLAN.before
    total = light.sum(axis=1)
    mean = (light * place).sum(axis=1) / total
    variance = (light * (place - mean[:, None]) ** 2).sum(axis=1) / total
    return rows.pixel, total, rows.start + PLAN.before + mean, variance


@pytest.mark.parametrize("spread_steps", [0.0, 0.3, 1.4, 1.6, 4.0, 7.3])
def test_light_is_conserved_and_keeps_its_delay_and_its_depth(spread_steps):
    """A return is a box of its depth: variance depth²/12. Shares are float32, their places up to 30 steps: 1e-4 steps."""
    photons = returns(1000.0 + 0.0173 * np.arange(300), np.geomspace(1e-2, 1e6, 300))
    pixel, total, mean, variance = moments(photons, spread_steps * PLAN.step_s)
    assert np.array_equal(pixel, np.arange(300))
    assert total == pytest.approx(photons.photons, rel=1e-6)
    assert mean == pytest.approx(photons.delay_s / PLAN.step_s, abs=1e-4)
    assert variance == pytest.approx(spread_steps**2 / 12.0, abs=1e-4 * (1.0 + spread_steps**2))


def test_returns_of_a_pixel_add():
    range_m, bright = [1000.0, 1000.4], [300.0, 100.0]
    photons = returns(
        np.tile(range_m, 5) + np.repeat(np.arange(5), 2), np.tile(bright, 5), np.repeat(np.arange(5), 2), (1, 5)
    )
    _, total, mean, variance = moments(photons)
    apart = 0.4 * 2.0 / C / PLAN.step_s
    assert total == pytest.approx(400.0, rel=1e-6)
    assert mean == pytest.approx((1000.1 + np.arange(5)) * 2.0 / C / PLAN.step_s, abs=1e-3)
    assert variance == pytest.approx(0.75 * 0.25 * apart**2, rel=1e-4)  # two points, three to one


def test_factors_and_lateness():
    photons = returns(1000.0 + np.arange(8), 100.0)
    rows = place_rows(photons, PLAN)
    factors = np.linspace(0.5, 2.0, 8)
    assert spread_light(photons, rows, PLAN.step_s, factors).sum(axis=1) == pytest.approx(100.0 * factors, rel=1e-6)
    _, _, mean, _ = moments(replace(photons, late_s=10.0 * PLAN.step_s))
    assert mean == pytest.approx(photons.delay_s / PLAN.step_s + 10.0, abs=1e-4)


def test_rows_cover_every_return_once():
    """Near each other or far apart: what could latch on a return is watched, and no moment of a pixel is watched twice.

    Only the seam is: a row that goes on from another begins with the last step watched there.
    """
    rng = np.random.default_rng(1)
    pixel = np.sort(rng.integers(0, 50, 400))
    range_m = rng.choice([100.0, 1000.0, 4000.0], 400) + rng.choice([0.0, 5.0, 12.0], 400) * rng.random(400)
    photons = deep(returns(range_m, 100.0, pixel, (1, 50)), rng.random(400) * 2e-9)
    rows = place_rows(photons, PLAN)
    assert np.all(np.diff(rows.pixel) >= 0) and np.all((rows.start + PLAN.before) % PLAN.steps_per_sample == 0)
    assert len(rows.pixel) > 50  # some pixels have several
    begin, end = rows.start + rows.first, rows.start + rows.last
    same = np.flatnonzero(np.diff(rows.pixel) == 0)
    assert np.all(begin[same + 1] >= end[same] - 1) and np.any(begin[same + 1] == end[same] - 1)
    half_s = 0.5 * photons.depth_spread_s
    for k in range(400):
        of = rows.pixel == pixel[k]
        watched = np.concatenate([np.arange(a, b) for a, b in zip(begin[of], end[of], strict=True)])
        needed = np.arange(
            np.floor((photons.delay_s[k] - half_s[k]) / PLAN.step_s) - PLAN.rise,
            np.ceil((photons.delay_s[k] + half_s[k]) / PLAN.step_s) + PLAN.fall,
        )
        assert np.isin(needed, watched).all()
    # A latch at any watched step finds all its samples in the row.
    assert np.all(rows.first >= PLAN.before - 1) and np.all(rows.last + PLAN.after <= rows.length)


def test_dark_returns_make_no_rows():
    photons = returns(np.array([1000.0, 1000.0]), np.array([0.0, 10.0]))
    assert np.array_equal(place_rows(photons, PLAN).pixel, [1])
    assert len(place_rows(returns(np.array([1000.0]), 0.0), PLAN).pixel) == 0


def test_the_shares_of_a_place_are_undone_on_the_average():
    """Cubic shares dim a wave of f cycles a step by its fourth order, 11 (2πf)⁴ / 720 on the average over places.

    The error of Lagrange's cubic is (x+1)x(x−1)(x−2) f''''/24, whose mean over a step is 11/30.
    """
    n = 400
    f = np.fft.rfftfreq(n)
    low = f < 0.08
    wave = 2.0 * np.pi * f[low]
    assert sharing_response(n)[0] == pytest.approx(1.0, abs=1e-12)
    assert 1.0 - sharing_response(n)[low] == pytest.approx(11.0 / 720.0 * wave**4, abs=0.06 * wave.max() ** 6)


def amplitude(photons):
    """Return the amplifier's output of one pixel without noise, and the time of its first step [s]."""
    rows = long_rows(photons)
    return simulate_rows(GSFL, photons, rows, None).amplitude[0], rows.start[0] * PLAN.step_s


def pulses(trace):
    """Return the places [steps] of the local maxima that stand out by a thousandth of the highest."""
    return find_peaks(trace, prominence=1e-3 * trace.max())[0]


def tilted(n_rays, ifov_rad=340.94e-6, range_m=10_000.0, angle_deg=60.0):
    """Return the photons of one pixel on a plate tilted about the row axis, n_rays x n_rays sub-rays to the pixel."""
    side_m = range_m * ifov_rad / n_rays
    step_m = side_m * np.tan(np.deg2rad(angle_deg))
    depth_m = (np.arange(n_rays) - 0.5 * (n_rays - 1)) * step_m
    photons = returns(
        range_m + np.repeat(depth_m, n_rays),
        2e4 / n_rays**2,
        np.zeros(n_rays**2, int),
        (1, 1),
        cluster=np.zeros(n_rays**2, int),
    )
    return deep(photons, 2.0 * step_m / C), step_m


def test_a_facet_at_60_degrees_at_10_km_is_one_pulse_and_not_a_comb():
    photons, step_m = tilted(4)
    assert 2.0 * step_m / C == pytest.approx(
        10e-9, rel=0.02
    )  # the sub-rays lie 10 ns apart, more than the pulse is long
    whole, _ = amplitude(photons)
    assert len(pulses(whole)) == 1
    assert len(pulses(amplitude(deep(photons, 0.0))[0])) == 4  # as it would be without the depth of the facet
    # The finer the sub-rays, the same pulse: a box of 39 ns behind pulse and amplifier, to a thousandth.
    finer, _ = amplitude(tilted(16)[0])
    n = min(len(whole), len(finer))
    assert whole.max() == pytest.approx(finer.max(), rel=1e-3) and whole[:n].sum() == pytest.approx(finer[:n].sum())
    reading, _ = detect(photons, GSFL, np.random.default_rng(2))
    assert np.count_nonzero(np.isfinite(reading.return_range_m)) == 1


@pytest.mark.parametrize(("apart_m", "count"), [(5.0, 2), (0.5, 1)])
def test_an_edge_is_two_pulses_and_a_step_is_a_blend(apart_m, count):
    photons = returns(np.array([1000.0, 1000.0 + apart_m]), np.array([6000.0, 4000.0]), np.zeros(2, int), (1, 1))
    trace, start_s = amplitude(photons)
    found = pulses(trace)
    assert len(found) == count
    pulse = camera_of(GSFL, photons).pulse
    if count == 2:  # each stands where it would alone, and as high
        range_m = (start_s + found * PLAN.step_s - pulse.peak_s) * C / 2.0
        assert range_m == pytest.approx([1000.0, 1000.0 + apart_m], abs=0.6 * PLAN.step_s * C / 2.0)
        assert trace[found] == pytest.approx(8.0 * photons.photons * pulse.peak, rel=0.02)
    else:  # the centroid is the photons' mean, later by the amplifier's 2 tau
        centroid_s = start_s + (np.arange(len(trace)) * trace).sum() / trace.sum() * PLAN.step_s
        assert (centroid_s - 2.0 * GSFL.amplifier.pole_s) * C / 2.0 == pytest.approx(1000.2, abs=1e-3)


def test_light_behind_the_pulse_has_the_pulses_spectrum_over_all_places_in_a_step():
    """A Gaussian of full width w has the transform exp(−π² w² f² / (4 ln 2)), whatever sharing among steps does: 1e-5.

    Returns stand at 64 places spread evenly over a step; turned back by their delays, their transforms are averaged.
    """
    part, n = Gsfl(), 64
    plan = plan_time(part, 8e-9)
    photons = returns(np.full(n, 1000.0), 1.0)
    delay_s = 6.67e-6 + (np.arange(n) + 0.5) / n * plan.step_s
    photons = replace(photons, delay_s=delay_s)
    rows = place_rows(photons, plan)
    light = spread_light(photons, rows, plan.step_s).astype(float)
    frequency = np.fft.rfftfreq(rows.length, plan.step_s)
    since_s = delay_s - rows.start * plan.step_s
    turned = np.fft.rfft(light, axis=1) * np.exp(2j * np.pi * frequency * since_s[:, None])
    transfer = transform_pulse(photons.pulse_step_s, photons.pulse_power_per_s, rows.length, plan.step_s)
    gauss = np.exp(-((np.pi * 8e-9 * frequency) ** 2) / (4.0 * np.log(2.0)))
    some = gauss > 1e-4
    assert np.abs(turned.mean(axis=0) * transfer - gauss)[some].max() < 1e-5

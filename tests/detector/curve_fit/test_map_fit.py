import dataclasses

import numpy as np
import pytest

from rso_lidar import units
from rso_lidar.detector import Defects, Gsfl, Maps, PixelMaps, read_pixel_maps
from rso_lidar.detector.chain.camera import draw_camera_pixels
from rso_lidar.detector.curve_fit.map_fit import fit_maps
from rso_lidar.detector.curve_fit.measured_map import MeasuredMap
from rso_lidar.detector.stages.false_triggers import rates_per_s
from rso_lidar.errors import ScenarioError
from rso_lidar.scenario import Lidar
from tests.detector.curve_fit.maps_for_tests import (
    FROM_M,
    list_truth,
    make_mean,
    measure_maps,
    measure_rates,
    take_frames,
)

SHAPE = (20, 24)
HIDDEN = Gsfl(
    maps=Maps(gain_spread_fraction=0.08, offset_spread_counts=6.0, t0_spread_ns=0.5),
    defects=Defects(dead_fraction=0.02, hot_fraction=0.0),
    camera_seed=7,
    armed_to_m=100.0,
)
PULSE = Lidar(receiver={"fov_deg": 2.5, "f_number": 2.8}, detector=HIDDEN).pulse
PLAIN = HIDDEN.replace(maps=None, defects=None)


@pytest.fixture(scope="module")
def measured():
    return measure_maps(HIDDEN, PULSE, SHAPE, (2500.0, 9000.0), 30, seed=1)


@pytest.fixture(scope="module")
def fitted(measured):
    return fit_maps(PLAIN, PULSE, measured, ("gain", "offset", "t0"))


def check_pulls(fit, name, truth, known):
    """Check that values lie about the truth as their standard errors say: within 4.5 standard deviations of that sum.

    Their mean is a convention, whose error all pixels share, so that it does not count.
    """
    beside, error = (fit.maps[name] - truth[name])[known], fit.errors[name][known]
    common = np.average(beside, weights=error**-2)
    pulls = (beside - common) / error
    assert abs(common) < 4.5 * beside.std() / np.sqrt(len(beside))
    assert abs((pulls**2).mean() - 1.0) < 4.5 * np.sqrt(2.0 / len(pulls))


@pytest.mark.parametrize("name", ["gain_factor", "offset_counts", "t0_ns"])
def test_hidden_maps_are_recovered_within_their_errors(fitted, name):
    pixels = draw_camera_pixels(HIDDEN, SHAPE[0] * SHAPE[1])
    check_pulls(fitted, name, list_truth(pixels, SHAPE), ~fitted.dead)
    assert fitted.errors[name][~fitted.dead].max() < 0.6 * list_truth(pixels, SHAPE)[name].std()
    assert fitted.misfits == []


def test_dead_pixels_are_recognised(fitted):
    pixels = draw_camera_pixels(HIDDEN, SHAPE[0] * SHAPE[1])
    assert pixels.dead.any()
    assert np.array_equal(fitted.dead, pixels.dead.reshape(SHAPE))
    assert np.isnan(fitted.errors["gain_factor"][fitted.dead]).all()
    assert np.all(fitted.maps["gain_factor"][fitted.dead] == 1.0)


def test_a_frame_simulated_with_the_maps_shows_the_measured_pattern(fitted, measured, tmp_path):
    maps = PixelMaps(SHAPE, fitted.maps, fitted.errors, fitted.dead, fitted.hot)
    maps.save(tmp_path / "maps.npz")
    camera = PLAIN.replace(maps=Maps(file=str(tmp_path / "maps.npz")))
    counts, error_m = take_frames(camera, PULSE, SHAPE, 9000.0, 30, seed=99)
    assert np.array_equal(np.isnan(counts).all(axis=0), fitted.dead)
    live = ~fitted.dead
    flat, plain = (make_mean("again", quantity, 9000.0, stack).value for quantity, stack in
                   (("counts_mean", counts), ("range_mean", error_m)))  # fmt: skip
    for again, first in ((flat, measured[2]), (plain, measured[3])):
        difference = (again - first.value)[live]
        # Noise of the first frames, which the maps hold, and of the second: within 4.5 standard deviations of their sum.
        expected = 2.0 * (first.scatter**2 / first.trials[live]).mean()
        assert difference.var() < expected * (1.0 + 4.5 * np.sqrt(2.0 / live.sum()))
        assert first.value[live].var() > 5.0 * expected


@pytest.mark.slow
def test_thresholds_and_hot_pixels_are_recovered_from_rates():
    camera = HIDDEN.replace(
        maps=Maps(gain_spread_fraction=0.08, offset_spread_counts=0.0, t0_spread_ns=0.0),
        defects=Defects(dead_fraction=0.02, hot_fraction=0.02, hot_dark_current_na=30.0),
    )
    pixels = draw_camera_pixels(camera, SHAPE[0] * SHAPE[1])
    maps = measure_maps(camera, PULSE, SHAPE, (9000.0,), 30, seed=1, quantities=("counts_mean",))
    maps += measure_rates(camera, PULSE, SHAPE, (700.0, 850.0), 80, seed=50)
    rate = rates_per_s(camera.apd, camera.amplifier, camera.trigger.threshold_electrons * pixels.threshold,
                       pixels.dark_per_s)  # fmt: skip
    rate[pixels.dead] = 0.0
    dark = np.random.Generator(np.random.Philox(3)).poisson(20.0 * rate).astype(float).reshape(SHAPE)
    maps.append(MeasuredMap("dark", "dark_counts", 0.0, dark, np.full(SHAPE, 20.0), np.nan, FROM_M, 0.0))
    fit = fit_maps(PLAIN, PULSE, maps, ("gain", "threshold"))
    assert np.array_equal(fit.dead, pixels.dead.reshape(SHAPE))
    assert np.array_equal(fit.hot, (pixels.hot & ~pixels.dead).reshape(SHAPE))
    known = np.isfinite(fit.errors["threshold_factor"])
    assert np.array_equal(known, ~fit.dead & ~fit.hot)
    truth = list_truth(pixels, SHAPE)
    truth["threshold_factor"] = truth["threshold_factor"] / truth["threshold_factor"][known].mean()
    check_pulls(fit, "threshold_factor", truth, known)
    current = fit.maps["dark_current_na"][fit.hot]
    assert np.all(np.abs(current - 30.0) < 5.0 * fit.errors["dark_current_na"][fit.hot])
    assert fit.misfits == []


def test_maps_that_such_pixels_cannot_give_are_rejected(measured):
    strange = dataclasses.replace(measured[3], value=measured[3].value + 0.05 * (np.arange(SHAPE[1]) % 2))
    fit = fit_maps(PLAIN, PULSE, [measured[1], strange], ("t0",))  # of one level only: odd columns are 5 cm late
    (group,) = fit.misfits
    assert group.p_value < 1e-6


def shift(measured, **changes):
    return [dataclasses.replace(each, **changes) for each in measured]


@pytest.mark.parametrize(
    ("change", "names", "words"),
    [
        (lambda maps: [maps[0], maps[1]], ("gain", "offset", "t0"), "gain and offset cannot be told apart by one map"),
        (lambda maps: maps[:1], ("gain", "threshold"), "nothing tells the threshold of a pixel"),
        (lambda maps: maps, ("gain", "offset"), "range_mean at 2500: tells t0, which is not named"),
        (lambda maps: shift(maps[:1], photons=2.5e4), ("gain",), "at 2500: its values are 10 times too low, it seems"),
        (
            lambda maps: shift(maps[:1], photons=2.5),
            ("gain",),
            "at 2500: its photons are 1,000 times too low, it seems",
        ),
        (lambda maps: shift(maps[:1], photons=700.0), ("gain",), "detects .* and noise selects what it reports"),
        (lambda maps: shift(maps[1:2], value=maps[1].value + 21.0), ("t0",), "mean range is 21 m beside the plate"),
        (lambda maps: shift(maps[:1], value=np.full(SHAPE, np.nan)), ("gain",), "pixels report nothing"),
        (
            lambda maps: [maps[0], *shift(maps[:1], name="again", photons=2505.0)],
            ("gain", "offset"),
            "nearly equal light",
        ),
    ],
)
def test_maps_that_hold_too_little_are_refused(measured, change, names, words):
    with pytest.raises(ScenarioError, match=words) as caught:
        fit_maps(PLAIN, PULSE, change(measured), names)
    assert "\n" not in str(caught.value)


def test_maps_of_two_arrays_are_refused(measured):
    other = dataclasses.replace(measured[2], value=measured[2].value[:10], trials=measured[2].trials[:10])
    with pytest.raises(ScenarioError, match="give maps of one array"):
        fit_maps(PLAIN, PULSE, [measured[0], other], ("gain", "offset"))
    with pytest.raises(ScenarioError, match="give rows and columns of both"):
        dataclasses.replace(measured[2], value=measured[2].value[:10])


def test_the_time_origin_is_in_nanoseconds_of_the_way_out_and_back(fitted):
    pixels = draw_camera_pixels(HIDDEN, SHAPE[0] * SHAPE[1])
    slope = np.polyfit(pixels.t0_s[~pixels.dead], fitted.maps["t0_ns"].ravel()[~pixels.dead] * units.NS, 1)[0]
    assert slope == pytest.approx(
        1.0, abs=0.03
    )  # 5 standard errors of a slope of 470 pixels whose errors are 9 % of t0


def test_a_pixel_beyond_the_limits_of_a_file_is_set_to_them_with_a_warning(measured, tmp_path):
    (counts, *_) = (each for each in measured if each.quantity == "counts_mean")
    row, col = np.argwhere(np.isfinite(counts.value))[0]
    value = counts.value.copy()
    value[row, col] *= 0.01
    with pytest.warns(UserWarning, match=rf"gain_factor of 1 of 480 pixels is beyond 0.05 to 20, .*\({row}, {col}\)"):
        fit = fit_maps(PLAIN, PULSE, [dataclasses.replace(counts, value=value)], ("gain",))
    assert fit.maps["gain_factor"][row, col] == 0.05
    path = PixelMaps(SHAPE, fit.maps, fit.errors, fit.dead, fit.hot).save(tmp_path / "maps.npz")
    assert np.array_equal(read_pixel_maps(str(path)).maps["gain_factor"], fit.maps["gain_factor"])

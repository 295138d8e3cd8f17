"""What a lidar gets of a plate: the link budget's photons, the detector's probability, sunlight, and flashes over a stay."""

import math

import numpy as np
import pytest

from rso_lidar.errors import ScenarioError
from rso_lidar.mission_analysis.passes.plate_light import PlateLight
from rso_lidar.scenario import Finding, Lidar, load_presets
from rso_lidar.study import ViewedPlate, budget

LIDAR = Lidar(preset="gsfl_1064")
RANGES = np.array([1000.0, 2000.0, 2500.0, 3000.0])


def make_light(lidar=LIDAR, finding=None, **plate):
    return PlateLight(lidar, ViewedPlate(**plate), finding or Finding())


def find(light, range_m, sunlight=0.0, rate=0.0):
    wide = np.atleast_1d(np.asarray(range_m, dtype=float))
    return light.find_in_flash(wide, np.full(wide.shape, rate), np.full(wide.shape, sunlight))


def test_photons_pixels_and_probability_are_those_of_the_link_budget():
    light = make_light(side_m=2.0, reflectance=0.3)
    (curve,) = budget(LIDAR, range_m=RANGES, materials=[0.3], facet_m2=4.0, target_m=2.0).curves
    assert light.count_photons(RANGES) == pytest.approx(curve.photons, rel=1e-12)
    assert light.count_pixels(RANGES) == pytest.approx(curve.pixels_on_target, rel=1e-9)
    single = make_light(side_m=0.2, reflectance=0.3)
    (curve,) = budget(LIDAR, range_m=RANGES, materials=[0.3], facet_m2=0.04, target_m=0.2).curves
    # both closed forms of the full chain agree to 0.02; thresholds differ from pixel to pixel
    found = find(single, np.repeat(RANGES, 200)).reshape(4, 200).mean(axis=1)
    assert found == pytest.approx(curve.detection_probability, abs=0.03)


def test_no_pixel_gets_more_light_than_the_pulse_holds():
    """Nearer than its aperture is wide, the lidar equation alone returns more photons than it sent."""
    near = make_light(side_m=10.0, reflectance=1.0).count_photons(np.array([0.0, 1e-3, 0.2, 1000.0]))
    assert (near[:3] <= LIDAR.laser.photons).all() and near[3] < near[2]


def test_nothing_is_found_where_the_detector_does_not_look():
    light = make_light()
    near_m, far_m = LIDAR.detector.traits.sees_from_m, LIDAR.detector.traits.sees_to_m
    assert find(light, [0.9 * near_m, 1.1 * far_m]).tolist() == [0.0, 0.0]
    assert find(light, [1.5 * near_m])[0] > 0.99


def test_more_pixels_asked_for_are_found_less_far():
    one, many = make_light(), make_light(finding=Finding(pixels=20))
    at_m = np.linspace(1000.0, 3000.0, 40)
    assert np.all(find(many, at_m) <= find(one, at_m) + 1e-9)
    pixels = many.count_pixels(at_m)
    assert np.all(find(many, at_m)[pixels < 20.0] == 0.0)


def test_sunlight_counts_with_a_filter_and_by_its_phase():
    lidar = LIDAR.replace(receiver=LIDAR.receiver.replace(filter_width_nm=50.0))
    light = make_light(lidar=lidar)
    phases = np.radians([0.0, 60.0, 90.0, 150.0])
    sun = light.count_sunlight(np.full(4, 3000.0), phases, np.ones(4))
    assert sun[:2] == pytest.approx([sun[0], 0.5 * sun[0]])
    assert sun[0] > 0.0 and sun[2:] == pytest.approx([0.0, 0.0], abs=1e-9 * sun[0])
    assert light.count_sunlight(np.array([3000.0]), np.zeros(1), np.zeros(1))[0] == 0.0  # in shadow
    assert make_light().count_sunlight(np.array([3000.0]), np.zeros(1), np.ones(1))[0] == 0.0  # no filter is known
    dark = find(light, np.full(300, 2900.0)).mean()
    bright = find(light, np.full(300, 2900.0), sunlight=1e11).mean()
    assert bright < dark - 0.01  # more noise: earlier false triggers hide the plate


@pytest.mark.parametrize("count", [5, 30, 300])
def test_flashes_of_a_stay_multiply_their_misses(count):
    light = make_light(flash_rate_hz=2.0)
    time_s = np.linspace(0.0, count / 2.0, 500)
    for each in (1e-3, 0.02, 0.4):
        expected = 1.0 - (1.0 - each) ** count
        assert light.find_over_stay(time_s, np.full(500, each)) == pytest.approx(expected, rel=1e-6)


def test_a_stay_shorter_than_a_frame_is_met_by_its_share_of_the_flashes():
    light = make_light(flash_rate_hz=1.0)
    time_s = np.linspace(0.0, 0.25, 101)
    assert light.find_over_stay(time_s, np.ones(101)) == pytest.approx(0.25, abs=1.0 / 16.0)
    assert light.find_over_stay(time_s, np.zeros(101)) == 0.0


def test_k_of_n_divides_the_stay_into_groups():
    light = make_light(flash_rate_hz=1.0, finding=Finding(needed=2, flashes=3))
    time_s, each = np.linspace(0.0, 30.0, 200), 0.2
    group = 3 * each**2 * (1 - each) + each**3
    assert light.find_over_stay(time_s, np.full(200, each)) == pytest.approx(1.0 - (1.0 - group) ** 10, rel=1e-6)


def test_every_shipped_camera_gives_a_probability():
    for preset in load_presets():
        light = make_light(lidar=Lidar(preset=preset))
        at_m = np.geomspace(50.0, 20_000.0, 12)
        found = find(light, at_m, sunlight=1e8, rate=20.0)
        assert np.all((found >= 0.0) & (found <= 1.0)) and found.max() > 0.5


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"side_m": 0.0}, "^target_size: 0 is out of range; give more than 0 and at most 10000 m$"),
        ({"reflectance": 1.5}, "^reflectance: 1.5 is out of range; give more than 0 and at most 1$"),
        ({"flash_rate_hz": math.nan}, "^flash_rate: nan is out of range"),
        ({"side_m": True}, "^target_size: True is out of range"),
        ({"side_m": "2"}, "^target_size: '2' is out of range"),
    ],
)
def test_values_without_meaning_are_refused(changed, message):
    with pytest.raises(ScenarioError, match=message):
        ViewedPlate(**changed)


def test_what_is_assumed_is_called_so():
    assert ViewedPlate().describe().count("(assumed)") == 3
    assert ViewedPlate(side_m=2.0, reflectance=0.1, flash_rate_hz=5.0).describe() == (
        "a facing square plate of 2 m side, reflectance 0.1, flashes at 5 Hz"
    )


def test_the_probability_of_one_flash_does_not_depend_on_the_pixel():
    """It is the mean over pixels, the same at equal ranges. Of several pixels each is drawn independently."""
    far_m = 3000.0
    light = make_light(side_m=0.7)
    edge = np.linspace(1000.0, far_m, 200)
    at_m = float(edge[np.argmin(np.abs(find(light, edge) - 0.5))])  # where half of the flashes find it
    same = find(light, np.full(30, at_m))
    assert np.ptp(same) == 0.0 and 0.1 < same[0] < 0.9
    assert np.all(np.diff(find(light, edge)) <= 1e-3)  # a greatest value over a stay is that of its nearest instant

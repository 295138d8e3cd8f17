"""Star trackers: axes of the errors, and what blinds them."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rso_lidar import sensors, units
from tests.sensors.motion_for_tests import make_motion

KEY = sensors.make_key(7, "tracker")
MOUNT = {"euler_zyx_deg": (30.0, 60.0, -40.0)}


def test_without_errors_it_reports_the_attitude():
    motion = make_motion(np.arange(20.0), np.random.default_rng(1), earth_direction=None)
    samples, _ = sensors.StarTracker(name="tracker", rate_hz=1.0, mount=MOUNT).measure(motion, KEY, 0)
    assert samples.valid.all() and (samples.quaternion_xyzw[:, 3] >= 0.0).all()
    error = Rotation.from_quat(samples.quaternion_xyzw) * Rotation.from_quat(motion.quaternion_xyzw).inv()
    np.testing.assert_allclose(error.magnitude(), 0.0, atol=1e-14)


@pytest.mark.parametrize(
    ("errors", "turned"),
    [
        ({"boresight_arcsec": 3600.0}, [False, False, True]),
        ({"cross_boresight_arcsec": 3600.0}, [True, True, False]),
        ({"slow_boresight_arcsec": 3600.0}, [False, False, True]),
        ({"misalignment_arcsec": 3600.0}, [True, True, True]),
    ],
)
def test_errors_are_about_the_axes_of_the_tracker(errors, turned):
    motion = make_motion(np.arange(20.0), np.random.default_rng(1), earth_direction=None)
    tracker = sensors.StarTracker(name="tracker", rate_hz=1.0, mount=MOUNT, **errors)
    samples, _ = tracker.measure(motion, KEY, 0)
    error = Rotation.from_quat(motion.quaternion_xyzw).inv() * Rotation.from_quat(samples.quaternion_xyzw)
    vectors = tracker.mount.rotation.inv().apply(error.as_rotvec()) / units.DEG
    assert ((np.abs(vectors) > 1e-9).all(axis=0) == turned).all()
    if "misalignment_arcsec" in errors:
        np.testing.assert_allclose(vectors, np.tile(vectors[0], (20, 1)), atol=1e-10)


def directions(angles_deg):
    """Return unit vectors at angles from the boresight of a tracker without rotation (+z), towards +x."""
    angles = np.asarray(angles_deg) * units.DEG
    return np.stack([np.sin(angles), 0.0 * angles, np.cos(angles)], axis=-1)


@pytest.mark.parametrize("name", ["sun", "moon"])
def test_the_sun_and_the_moon_blind_within_their_angle(name):
    motion = make_motion(np.arange(3.0), **{f"{name}_direction": directions([29.9, 30.1, 180.0])})
    tracker = sensors.StarTracker(name="tracker", rate_hz=1.0, **{f"{name}_exclusion_deg": 30.0})
    samples, _ = tracker.measure(motion, KEY, 0)
    assert samples.valid.tolist() == [False, True, True]
    assert np.isnan(samples.quaternion_xyzw[0]).all()
    narrow = make_motion(np.arange(2.0), **{f"{name}_direction": directions([0.7, 0.9])})
    few = tracker.replace(**{f"{name}_exclusion_deg": 0.8})
    assert few.measure(narrow, KEY, 0)[0].valid.tolist() == [False, True]
    behind = tracker.replace(mount={"euler_zyx_deg": (0.0, 180.0, 0.0)})
    assert behind.measure(motion, KEY, 0)[0].valid.tolist() == [True, True, False]


def test_no_star_is_seen_through_the_earth():
    """Without an exclusion angle the disk itself blinds: of 60 degrees here."""
    earth = {"earth_direction": directions([59.0, 61.0]), "earth_angle_rad": np.full(2, 60.0 * units.DEG)}
    tracker = sensors.StarTracker(name="tracker", rate_hz=1.0)
    assert tracker.measure(make_motion(np.arange(2.0), **earth), KEY, 0)[0].valid.tolist() == [False, True]


def test_the_earth_blinds_from_its_limb():
    motion = make_motion(
        np.arange(3.0), earth_direction=directions([89.9, 90.1, 120.0]), earth_angle_rad=np.full(3, 65.0 * units.DEG)
    )
    tracker = sensors.StarTracker(name="tracker", rate_hz=1.0, earth_exclusion_deg=25.0)
    assert tracker.measure(motion, KEY, 0)[0].valid.tolist() == [False, True, True]


def test_the_boresight_is_the_z_axis_of_a_mount_askew_on_a_body_askew():
    """The Sun at 29 and at 31 degrees from it, to either side of it along two directions across."""
    body = Rotation.from_euler("ZYX", [50.0, -20.0, 110.0], degrees=True)
    tracker = Rotation.from_euler("ZYX", MOUNT["euler_zyx_deg"], degrees=True)
    off = Rotation.from_rotvec([[a, b, 0.0] for d in (29.0, 31.0) for a, b in ((d, 0), (-d, 0), (0, d), (0, -d))], True)
    sun = (body * tracker).apply(off.apply([0.0, 0.0, 1.0]))
    motion = make_motion(np.arange(8.0), quaternion_xyzw=np.tile(body.as_quat(), (8, 1)), sun_direction=sun)
    part = sensors.StarTracker(name="tracker", rate_hz=1.0, mount=MOUNT, sun_exclusion_deg=30.0)
    assert part.measure(motion, KEY, 0)[0].valid.tolist() == [False] * 4 + [True] * 4


def test_a_fast_body_blurs_the_stars():
    motion = make_motion(np.arange(2.0), angular_velocity_rad_s=[[0.0, 0.009, 0.009], [0.0, 0.0, 0.017]])
    tracker = sensors.StarTracker(name="tracker", rate_hz=1.0, max_rate_deg_s=1.0)
    assert tracker.measure(motion, KEY, 0)[0].valid.tolist() == [True, True]
    assert tracker.replace(max_rate_deg_s=0.7).measure(motion, KEY, 0)[0].valid.tolist() == [False, False]
    assert tracker.replace(max_rate_deg_s=0.8).measure(motion, KEY, 0)[0].valid.tolist() == [True, False]


def test_in_a_local_world_nothing_blinds():
    nowhere = np.full((2, 3), np.nan)
    motion = make_motion(
        np.arange(2.0),
        sun_direction=nowhere,
        moon_direction=nowhere,
        earth_direction=nowhere,
        earth_angle_rad=[np.nan] * 2,
    )
    tracker = sensors.StarTracker(
        name="tracker", rate_hz=1.0, sun_exclusion_deg=90.0, moon_exclusion_deg=90.0, earth_exclusion_deg=90.0
    )
    assert tracker.measure(motion, KEY, 0)[0].valid.all()
    assert tracker.measure(make_motion(np.arange(2.0)), KEY, 0)[0].valid.all()


def test_a_blinded_tracker_needs_time_to_find_its_attitude_again():
    """At 10 Hz, 0.3 s are three samples: the Sun leaves at the fifth, and the tracker searches there and at two more."""
    angles = np.full(20, 90.0)
    angles[[2, 3, 12]] = 20.0
    motion = make_motion(np.arange(20.0) / 10.0, sun_direction=directions(angles))
    tracker = sensors.StarTracker(name="tracker", rate_hz=10.0, sun_exclusion_deg=30.0, acquisition_s=0.3)
    samples, state = tracker.measure(motion, KEY, 0)
    assert np.flatnonzero(~samples.valid).tolist() == [2, 3, 4, 5, 6, 12, 13, 14, 15]
    assert state.values[-1] == 0.0
    assert np.isnan(samples.quaternion_xyzw[~samples.valid]).all()
    at_once = tracker.replace(acquisition_s=0.0).measure(motion, KEY, 0)[0]
    assert np.flatnonzero(~at_once.valid).tolist() == [2, 3, 12]


@pytest.mark.parametrize("cause", ["outage", "rate", "random outage"])
def test_it_searches_after_an_outage_and_after_a_fast_turn(cause):
    rate = np.zeros((30, 3))
    changes = {"outages": [{"from_s": 1.0, "to_s": 2.0}]}
    if cause == "rate":
        rate[1:2], changes = 0.1, {"max_rate_deg_s": 1.0}
    if cause == "random outage":
        changes = {"random_outage": {"mean_up_s": 6.0, "mean_down_s": 1.0}}
    motion = make_motion(np.arange(30.0), angular_velocity_rad_s=rate)
    tracker = sensors.StarTracker(name="tracker", rate_hz=1.0, acquisition_s=4.0, **changes)
    out = ~tracker.replace(acquisition_s=0.0).measure(motion, KEY, 0)[0].valid
    assert 0 < out.sum() < 15
    expected = [bool(out[max(0, k - 4) : k + 1].any()) for k in range(30)]
    assert (~tracker.measure(motion, KEY, 0)[0].valid).tolist() == expected
    assert out.sum() < sum(expected) < 30


@pytest.mark.parametrize(("acquisition_s", "rate_hz", "samples"), [(0.25, 10.0, 3), (0.07, 100.0, 7), (0.001, 10.0, 1)])
def test_an_acquisition_that_has_begun_a_sample_takes_it(acquisition_s, rate_hz, samples):
    """0.07 s at 100 Hz are 7 samples, though their product rounds to more."""
    assert sensors.StarTracker(name="tracker", rate_hz=rate_hz, acquisition_s=acquisition_s).look_back == samples


@pytest.mark.parametrize("acquisition_s", [0.0, 0.3, 1.0, 7.0])
def test_samples_of_an_acquisition_do_not_depend_on_how_they_are_divided(acquisition_s):
    """Each is valid after the clear samples that an acquisition takes, whatever calls they were in."""
    rng = np.random.default_rng(3)
    angles = np.where(rng.random(400) < 0.04, 20.0, 90.0)
    motion = make_motion(np.arange(400.0) / 10.0, sun_direction=directions(angles))
    tracker = sensors.StarTracker(
        name="tracker", rate_hz=10.0, sun_exclusion_deg=30.0, cross_boresight_arcsec=5.0, acquisition_s=acquisition_s
    )
    whole, end = tracker.measure(motion, KEY, 0)
    back = round(acquisition_s * 10.0)
    assert tracker.look_back == back
    assert whole.valid.tolist() == [bool((angles[max(0, k - back) : k + 1] > 30.0).all()) for k in range(400)]
    assert 0 < whole.valid.sum() < 400
    state, begin = None, 0
    while begin < 400:
        until = min(400, begin + int(rng.integers(1, 12)))
        some, state = tracker.measure(motion.some(np.arange(begin, until)), KEY, begin, state)
        np.testing.assert_array_equal(some.quaternion_xyzw, whole.quaternion_xyzw[begin:until])
        begin = until
    np.testing.assert_array_equal(state.values, end.values)
    for first in (1, 57, 200, 395):  # samples alone, with those before them on which they depend
        begin = max(0, first - back)
        alone, _ = tracker.measure(motion.some(np.arange(begin, 400)), KEY, begin)
        np.testing.assert_array_equal(alone.quaternion_xyzw[first - begin :], whole.quaternion_xyzw[first:])


def test_samples_that_a_state_skips_count_as_clear():
    motion = make_motion(np.arange(12.0), sun_direction=directions([20.0] + 11 * [90.0]))
    tracker = sensors.StarTracker(name="tracker", rate_hz=1.0, sun_exclusion_deg=30.0, acquisition_s=5.0)
    _, state = tracker.measure(motion.some(np.arange(2)), KEY, 0)
    assert state.values[-1] == 4.0
    assert tracker.measure(motion.some(np.arange(4, 8)), KEY, 4, state)[0].valid.tolist() == [False, False, True, True]
    assert tracker.measure(motion.some(np.arange(8, 9)), KEY, 8, state)[0].valid.all()

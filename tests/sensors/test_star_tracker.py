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

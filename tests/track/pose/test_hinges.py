"""Angles of hinges beside the pose: a box with two wings, each on a hinge along x."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

import rso_lidar as rl
from rso_lidar.pose import pose
from rso_lidar.track import MeshHinge, PoseFollower, SampledMesh, acquire, align, sample_mesh
from rso_lidar.track.pose.follow import HingeFilter, _Hypothesis
from rso_lidar.track.pose.icp import UNKNOWN_ANGLE_RAD, find_outline, misfit_m
from rso_lidar.track.pose.pose_search import LIKELIER, keep_sides, search_hinges

DEG = rl.units.DEG
TRUE = pose(np.array([1.0, -2.0, 60.0]), Rotation.from_euler("ZYX", [40, -30, 20], degrees=True))
NORTH, SOUTH = (
    MeshHinge("north", (1.0, 0.0, 0.2), (2.0, 0.0, 0.0)),
    MeshHinge("south", (-1.0, 0.0, 0.2), (1.0, 0.0, 0.0)),
)
STILL = Rotation.identity()


def rectangle(first, second, third):
    """Return the corners of a rectangle as two triangles, from three of its corners."""
    first, second, third = (np.array(one, dtype=float) for one in (first, second, third))
    return [[first, second, third], [first, third, first + third - second]]


def craft():
    """Return corners and hinges of a box with an antenna, and two wings of 3.5 m by 2 m, half a metre from it."""
    faces = []
    for axis in range(3):
        a, b = np.roll([0.0, 1.0, 0.0], axis), np.roll([0.0, 0.0, 1.5], axis)
        for side in (-1.0, 1.0):
            n = np.roll([side, 0.0, 0.0], axis)
            faces += rectangle(n - a - b, n + a - b, n + a + b)
    faces += rectangle((-0.5, 1.0, 0.5), (0.5, 1.0, 0.5), (0.5, 3.0, 1.5))
    wings = [rectangle((1.5 * s, -1.0, 0.2), (5.0 * s, -1.0, 0.2), (5.0 * s, 1.0, 0.2)) for s in (1.0, -1.0)]
    return np.array([*faces, *wings[0], *wings[1]]), np.repeat([-1, 0, 1], [len(faces), 2, 2])


CORNERS, HINGE_OF_FACET = craft()


def sample(count, seed, hinges=(NORTH, SOUTH)):
    rng = np.random.default_rng(seed)
    return sample_mesh(CORNERS, count, rng, hinges=hinges, hinge_of_facet=HINGE_OF_FACET)


@pytest.fixture(scope="module")
def model():
    return sample(6000, 1)


def cloud(angles_deg, seed, *, true=TRUE, noise_m=0.03, count=400, hidden=()):
    """Return points on the craft in lidar axes, with noise along the line of sight; without those of hidden hinges."""
    rng = np.random.default_rng(1000 + seed)
    craft = sample(count, 2000 + seed).turn_hinges(dict(zip(("north", "south"), np.radians(angles_deg), strict=True)))
    points = true.apply(craft.points_m[~np.isin(craft.hinge_of, hidden)])
    return points + points / np.linalg.norm(points, axis=1, keepdims=True) * rng.normal(0.0, noise_m, (len(points), 1))


def off_deg(found, angles_deg):
    angles = [found.hinge_angles_rad[name] for name in ("north", "south")]
    return np.degrees(np.array(angles)) - angles_deg


def turn_deg(found, true=TRUE):
    return (found.pose.rotation.inv() * true.rotation).magnitude() / DEG


def test_points_turn_with_their_hinge(model):
    """A quarter of a turn about x lifts y to z: the plane of the wing becomes vertical."""
    turned = model.turn_hinges({"north": np.pi / 2})
    north = model.hinge_of == 0
    arm = model.points_m[north] - [0.0, 0.0, 0.2]
    np.testing.assert_allclose(
        turned.points_m[north], np.stack([arm[:, 0], 0.0 * arm[:, 0], arm[:, 1] + 0.2], axis=1), atol=1e-12
    )
    np.testing.assert_array_equal(turned.points_m[~north], model.points_m[~north])
    np.testing.assert_allclose(np.abs(turned.normals[north]) @ [0.0, 1.0, 0.0], 1.0)
    again = turned.turn_hinges({"north": 0.0})
    np.testing.assert_allclose(again.points_m, model.points_m, atol=1e-12)
    seen = np.random.default_rng(3).uniform(-4, 4, (200, 3))
    apart, nearest = turned.find_nearest(seen)
    expected, number = turned.tree.query(seen)  # of the points where they stand
    np.testing.assert_allclose(apart, expected, atol=1e-12)
    np.testing.assert_array_equal(nearest, number)


def test_errors_of_pose_and_angles_are_as_large_as_stated(model):
    """NEES of both hinges over 40 clouds of known noise: chi-square, one degree of freedom for each angle."""
    guess = TRUE * pose(np.array([0.1, -0.1, 0.1]), Rotation.from_rotvec([0.03, -0.04, 0.02]))
    start = model.turn_hinges({"north": 40.0 * DEG, "south": -20.0 * DEG})
    nees, turns = [], []
    for seed in range(40):
        found = align(cloud((50.0, -30.0), seed), start, guess)
        sigma_deg = np.degrees([found.hinge_sigmas_rad[name] for name in ("north", "south")])
        # 0.03 m x the mean cosine on 90 points whose arms about the hinge are 0.58 m rms, at most: 0.3 deg.
        assert (sigma_deg < 0.45).all()
        nees += ((off_deg(found, (50.0, -30.0)) / sigma_deg) ** 2).tolist()
        turns.append(turn_deg(found))
    low, high = chi2.ppf([0.0005, 0.9995], len(nees)) / len(nees)
    assert low < np.mean(nees) < high
    assert np.median(turns) < 0.15


def test_a_rigid_model_is_pulled_away_by_turned_wings(model):
    points = cloud((50.0, -30.0), 1)
    rigid = align(points, sample_mesh(CORNERS, 6000), TRUE)
    assert not rigid.hinge_angles_rad
    held = align(points, model, TRUE, hinge_sigmas_rad={"north": 1e-9, "south": 1e-9})
    np.testing.assert_allclose(off_deg(held, (0.0, 0.0)), 0.0, atol=1e-4)
    assert turn_deg(align(points, model.turn_hinges({"north": 0.8, "south": -0.5}), TRUE)) < 0.3
    assert min(turn_deg(rigid), turn_deg(held)) > 0.6


@pytest.mark.parametrize("shown", [0, 3])
def test_a_hinge_that_no_points_show_keeps_its_angle(model, shown):
    """Three points on a wing could be mixed pixels, and do not turn it."""
    points = cloud((50.0, 10.0), 5, hidden=(1,))
    if shown:
        points = np.concatenate([points, cloud((50.0, 26.0), 6, noise_m=0.0, hidden=(-1, 0))[:shown]])
    found = align(points, model.turn_hinges({"north": 0.7, "south": 0.4}), TRUE)
    assert abs(off_deg(found, (50.0, 10.0))[0]) < 1.0
    assert found.hinge_angles_rad["south"] == pytest.approx(0.4, abs=1e-12)
    assert found.hinge_sigmas_rad["south"] == pytest.approx(UNKNOWN_ANGLE_RAD)
    known = align(points, model.turn_hinges({"north": 0.7, "south": 0.4}), TRUE, hinge_sigmas_rad={"south": 0.05})
    assert known.hinge_sigmas_rad["south"] == pytest.approx(0.05)


def test_a_wrong_angle_is_found(model):
    points = cloud((100.0, 0.0), 7)
    wrong = align(points, model.turn_hinges({"north": -0.1}), TRUE, hinge_sigmas_rad={"north": 1e-6})
    other, gain = search_hinges(points, model, wrong)
    assert gain > LIKELIER
    right = align(points, model.turn_hinges(other.hinge_angles_rad), other.pose)
    assert (
        abs(off_deg(right, (100.0, 0.0))[0] + 180.0) < 1.0 or abs(off_deg(right, (100.0, 0.0))[0]) < 1.0
    )  # a flat wing
    assert search_hinges(points, model, right)[1] < LIKELIER


def test_pose_and_angles_are_found_without_a_guess(model):
    found = acquire(cloud((70.0, -40.0), 8, count=150), model, starts=16)[0]
    assert turn_deg(found) < 1.0
    assert (
        np.abs(off_deg(found, (70.0, -40.0))).max() < 2.0
    )  # the wings are flat, and both are nearer to zero than to half a turn


def test_of_two_sides_that_look_the_same_the_near_one_is_kept(model):
    points = cloud((70.0, -40.0), 9)
    far = align(points, model.turn_hinges({"north": 250.0 * DEG, "south": -40.0 * DEG}), TRUE)
    assert off_deg(far, (250.0, -40.0))[0] == pytest.approx(0.0, abs=1.5)
    np.testing.assert_allclose(off_deg(keep_sides(points, model, far), (70.0, -40.0)), 0.0, atol=1.5)
    beside = model.turn_hinges({"north": 200.0 * DEG})
    np.testing.assert_allclose(off_deg(keep_sides(points, beside, far), (250.0, -40.0)), 0.0, atol=1.5)


@pytest.mark.slow
def test_wings_are_followed_and_predicted_while_hidden(model):
    """Wings that turn by 3 deg a cloud; one is hidden for four clouds, and is where its rate has taken it."""
    follow = PoseFollower(model)
    rate, true = Rotation.from_rotvec([0.0, 0.02, 0.03]), TRUE
    points = cloud((0.0, 0.0), 0)
    start = align(points, model, TRUE)
    hinges = HingeFilter.start(0.0, start.hinge_angles_rad, start.hinge_sigmas_rad)
    follow._kept = [_Hypothesis(0.0, start.pose, points.mean(axis=0), start, 0.1, hinges)]
    errors, spreads = [], []
    for number in range(1, 10):
        true = pose(true.translation, rate * true.rotation)
        angles = np.array([3.0, -2.0]) * number
        found = follow(60.0 * number, cloud(angles, number, true=true, hidden=(1,) if 5 <= number < 9 else ()), STILL)
        errors.append(off_deg(found, angles))
        spreads.append(found.hinge_sigmas_rad["south"])
        assert turn_deg(found, true) < 1.0
    errors = np.array(errors)
    assert np.abs(errors[:4]).max() < 1.5
    assert np.abs(errors[4:8, 1]).max() < 3.0  # eight degrees from where it was last seen
    assert (np.diff(spreads[4:8]) > 0.0).all()
    assert np.abs(errors[8]).max() < 1.5


@pytest.mark.parametrize("returned", [4, 5])
def test_a_wing_without_returns_is_no_misfit(model, returned):
    """The cells of an array may reflect everything away; with five returns the rest of it is missed again."""
    wing = cloud((50.0, -30.0), 6, count=1200, hidden=(-1, 0))
    inner = wing[np.argsort(np.linalg.norm(wing - TRUE.translation, axis=1))][:returned]  # at the edge near the box
    points = np.concatenate([cloud((50.0, -30.0), 5, count=1200, hidden=(1,)), inner])
    posed = model.turn_hinges({"north": 50.0 * DEG, "south": -30.0 * DEG})
    rigid = SampledMesh(posed.points_m, posed.normals)
    found_m, rigid_m = (misfit_m(TRUE, one, points, find_outline(points)) for one in (posed, rigid))
    assert rigid_m > 0.5  # the wing reaches 3 m beyond the rest
    assert found_m == pytest.approx(rigid_m) if returned == 5 else found_m < 0.2


def test_the_filter_of_a_hinge_is_that_of_kalman():
    """The posterior of an angle with its variance is that of the textbook's update, and the rate follows."""
    start = HingeFilter.start(0.0, {"a": 0.3}, {"a": 0.01})
    ahead = start.predict(100.0)
    prior, covariance = ahead.states["a"], ahead.covariances["a"]
    measured, variance = 0.5, 0.02**2
    gain = covariance[:, 0] / (covariance[0, 0] + variance)
    state, spread = prior + gain * (measured - prior[0]), covariance - np.outer(gain, covariance[0])
    ahead.update({"a": state[0]}, {"a": np.sqrt(spread[0, 0])}, is_predicted=True)
    np.testing.assert_allclose(ahead.states["a"], state, rtol=1e-12)
    np.testing.assert_allclose(ahead.covariances["a"], spread, rtol=1e-9, atol=1e-18)
    later = ahead.predict(200.0)
    assert later.angles_rad["a"] == pytest.approx(state[0] + 100.0 * state[1])
    assert later.sigmas_rad["a"] > ahead.sigmas_rad["a"]
    assert ahead.predict(1e7).sigmas_rad["a"] == UNKNOWN_ANGLE_RAD
    ahead.update({"a": 2.0}, {"a": 0.1}, is_predicted=False)
    np.testing.assert_array_equal(ahead.states["a"], [2.0, 0.0])


def test_refused(model):
    with pytest.raises(
        rl.ScenarioError, match=r"no hinge named 'nort'; did you mean 'north'\? \(known: north, south\)"
    ):
        model.turn_hinges({"nort": 0.1})
    for wrong in (np.nan, np.inf, "1", None, np.array([0.1, 0.2])):
        with pytest.raises(rl.ScenarioError, match=r"hinge north: .* is no angle; give a finite number in radians"):
            model.turn_hinges({"north": wrong})
    with pytest.raises(rl.ScenarioError, match="the mesh has no hinges"):
        sample_mesh(CORNERS, 100).turn_hinges({"north": 0.1})
    with pytest.raises(rl.ScenarioError, match="from -1 to 0 for each of 18 facets"):
        sample_mesh(CORNERS, hinges=(NORTH,), hinge_of_facet=HINGE_OF_FACET)
    with pytest.raises(rl.ScenarioError, match="same name"):
        sample(100, 1, (NORTH, NORTH))
    with pytest.raises(rl.ScenarioError, match="hinge flat: needs a finite position and an axis"):
        sample(100, 1, (NORTH, MeshHinge("flat", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))))

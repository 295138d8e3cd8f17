from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import rso_lidar as rl
from rso_lidar.pose import pose
from rso_lidar.track import PoseFollower, SampledMesh, acquire, align, measure_visible_centroid, sample_mesh
from rso_lidar.track.pose.follow import HingeFilter, _Hypothesis
from rso_lidar.track.pose.icp import find_outline, misfit_m
from rso_lidar.track.pose.pose_search import LIKELIER, search_turns

EXAMPLES = Path(__file__).resolve().parents[3] / "examples"
DEG = rl.units.DEG
TRUE = pose(np.array([1.0, -2.0, 300.0]), Rotation.from_euler("ZYX", [40, -70, 20], degrees=True))


@pytest.fixture(scope="module")
def corners():
    return rl.Scenario.load(EXAMPLES / "tdrs_approach.toml").surfaces[0].corners


@pytest.fixture(scope="module")
def model(corners):
    return sample_mesh(corners)


def cloud(corners, seed, noise_m, true=TRUE, count=800):
    """Return points on the facets that are not the model's own, in lidar axes, with noise along the line of sight."""
    rng = np.random.default_rng(seed)
    points = true.apply(sample_mesh(corners, count, rng).points_m)
    ahead = points / np.linalg.norm(points, axis=1, keepdims=True)
    return points + ahead * rng.normal(0.0, noise_m, (count, 1))


def apart(found, true=TRUE):
    return (found.rotation.inv() * true.rotation).magnitude() / DEG, np.linalg.norm(
        found.translation - true.translation
    )


@pytest.mark.parametrize(("noise_m", "most_deg", "most_m"), [(0.0, 0.15, 0.01), (0.05, 0.3, 0.03)])
def test_a_known_pose_is_found_within_noise(corners, model, noise_m, most_deg, most_m):
    """Of 800 points with 5 cm: 5 cm / sqrt(800) * sqrt(6) is 4 mm, and over the 5 m of arm 0.05 degrees; times six.

    Without noise what is left is the model's: 20,000 points, some 5 cm apart, on curved dishes.
    """
    guess = TRUE * pose(np.array([0.4, -0.3, 0.2]), Rotation.from_rotvec([0.08, -0.06, 0.1]))  # 8 degrees, half a metre
    found = align(cloud(corners, 3, noise_m), model, guess)
    turn_deg, off_m = apart(found.pose)
    assert turn_deg < most_deg
    assert off_m < most_m
    assert found.rms_m < 1.2 * noise_m + 0.02  # the model is points 5 cm apart, on planes


def test_a_pose_is_found_without_a_guess(corners, model):
    points = cloud(corners, 4, 0.05)
    found = acquire(points, model, count=4)
    turn_deg, off_m = min(apart(one.pose) for one in found)  # the craft looks nearly the same half a turn on
    assert turn_deg < 0.3
    assert off_m < 0.03
    assert len(acquire(points, model, starts=8)) == 1


@pytest.fixture(scope="module")
def stage_corners():
    return rl.Scenario.load(EXAMPLES / "tumbling_inspection.toml").corners_of(0)


@pytest.mark.parametrize("turn_deg", [60.0, 120.0, -150.0])
def test_a_wrong_turn_about_a_round_body_is_found(stage_corners, turn_deg):
    """A stage is aligned at any turn about its long axis; tanks and nozzle then lie beside the model."""
    stage = sample_mesh(stage_corners)
    points = cloud(stage_corners, 8, 0.04)
    about = Rotation.from_rotvec(np.radians(turn_deg) * stage.long_axis)
    arm = stage.middle_m - about.apply(stage.middle_m)
    wrong = align(points, stage, TRUE * pose(arm, about))
    assert apart(wrong.pose)[0] > 20.0
    other, gain = search_turns(points, stage, wrong)
    assert gain > LIKELIER
    assert apart(align(points, stage, other.pose).pose)[0] < 3.0
    assert search_turns(points, stage, align(points, stage, TRUE))[1] < LIKELIER


def test_a_follower_gives_up_a_wrong_turn(stage_corners):
    """From cloud to cloud the likelihoods add up, and the turn is no motion."""
    stage = sample_mesh(stage_corners)
    about = Rotation.from_rotvec(np.radians(90.0) * stage.long_axis)
    wrong = TRUE * pose(stage.middle_m - about.apply(stage.middle_m), about)
    rate, true, errors = Rotation.from_rotvec([0.0, np.radians(2.0), np.radians(3.0)]), TRUE, []
    follow = PoseFollower(stage)
    points = cloud(stage_corners, 0, 0.05, true, count=300)
    start = align(points, stage, wrong)
    hinges = HingeFilter.start(0.0, {}, {})
    follow._kept = [_Hypothesis(0.0, start.pose, points.mean(axis=0), start, 0.1, hinges)]
    for number in range(1, 7):
        true = pose(true.translation, rate * true.rotation)
        points = cloud(stage_corners, number, 0.05, true, count=300)
        errors.append(apart(follow(float(number), points, Rotation.identity()).pose, true)[0])
    assert max(errors[3:]) < 5.0


def test_parts_outside_the_field_are_no_misfit(corners, model):
    points = cloud(corners, 6, 0.05)
    half_field = 0.5 * float(np.arctan(np.abs(points[:, 0] / points[:, 2]).max()))
    seen = points[(np.abs(points[:, :2] / points[:, 2:]) <= np.tan(half_field)).all(axis=1)]
    outline = find_outline(seen)
    assert 100 < len(seen) < len(points)
    assert misfit_m(TRUE, model, seen, outline) > 1.0  # metres of panels and dishes
    assert misfit_m(TRUE, model, seen, outline, half_field) < 0.5  # noise, and the distance between two points
    aside = pose(np.array([100.0, 0.0, 0.0]), Rotation.identity()) * TRUE
    assert misfit_m(aside, model, seen, outline, half_field) == np.inf


@pytest.mark.slow
def test_a_target_that_overfills_the_field_is_followed(corners, model):
    """Half of the craft is outside the field; only what is inside is compared with the outline."""
    crops = {}
    for number in range(3):
        points = cloud(corners, 20 + number, 0.05, count=1600)
        half_field = 0.5 * float(np.arctan(np.abs(points[:, :2] / points[:, 2:]).max()))
        crops[number] = points[(np.abs(points[:, :2] / points[:, 2:]) <= np.tan(half_field)).all(axis=1)]
    usual = []
    for field in (np.inf, half_field, (half_field, half_field)):
        follow = PoseFollower(model)
        start = align(crops[0], model, TRUE)
        square_m2 = misfit_m(start.pose, model, crops[0], find_outline(crops[0]), field) ** 2
        middle = crops[0].mean(axis=0)
        follow._kept = [_Hypothesis(0.0, start.pose, middle, start, square_m2, HingeFilter.start(0.0, {}, {}))]
        for number in (1, 2):
            found = follow(float(number), crops[number], Rotation.identity(), field)
            assert apart(found.pose)[0] < 0.5
        usual.append(np.sqrt(follow._kept[0].square_m2))
    assert usual[1] == usual[2] < 0.5 < 1.0 < usual[0]
    found = PoseFollower(model, most_points=500)(0.0, crops[0], Rotation.identity(), half_field)
    assert apart(found.pose)[0] < 1.0  # against parts outside the field, half a turn away fits better


def test_what_a_round_target_does_not_tell_stays_as_guessed():
    angle = np.linspace(0.0, 2.0 * np.pi, 721)[:-1]
    rim = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
    disc = np.stack([np.zeros_like(rim), rim, np.roll(rim, -1, axis=0)], axis=1)
    guess = TRUE * pose(np.array([0.0, 0.0, 0.2]), Rotation.from_rotvec([0.05, 0.0, 0.0]))
    found = align(cloud(disc, 5, 0.0), sample_mesh(disc), guess).pose
    axis = [one.rotation.apply([0.0, 0.0, 1.0]) for one in (found, TRUE)]
    assert np.linalg.norm(axis[0] - axis[1]) < 1e-3
    assert apart(found)[0] < 3.5  # the guess is 3 degrees off, about another axis


@pytest.mark.slow
def test_a_spinning_target_is_followed(corners, model):
    follow = PoseFollower(model)
    still = Rotation.identity()
    for k in range(15):
        true = TRUE * pose(rotation=Rotation.from_rotvec(np.array([0.0, 0.05, 0.12]) * k))  # 7.5 degrees a cloud
        found = follow(float(k), cloud(corners, 100 + k, 0.05, true), still)
        if k >= 10:  # half a turn on it looks nearly the same: some clouds are needed to tell
            assert apart(found.pose, true)[0] < 0.5
        if k == 7:
            assert follow(k + 0.5, cloud(corners, 1, 0.05)[:20], still) is None  # too few points, which is no harm


def test_a_model_is_even_and_knows_its_axis():
    square = np.array([[[0, 0, 0], [4, 0, 0], [4, 1, 0]], [[0, 0, 0], [4, 1, 0], [0, 1, 0]]], dtype=float)
    made = sample_mesh(square, 8000)
    counts, _, _ = np.histogram2d(made.points_m[:, 0], made.points_m[:, 1], bins=(4, 2), range=[[0, 4], [0, 1]])
    np.testing.assert_allclose(counts, 1000.0, atol=4.5 * np.sqrt(1000.0))  # Poisson, 8 cells
    assert abs(made.long_axis[0]) > 0.99
    np.testing.assert_allclose(np.abs(made.normals), np.broadcast_to([0.0, 0.0, 1.0], (8000, 3)), atol=1e-12)


def test_the_middle_of_what_is_seen_of_a_ball():
    """Half a ball is seen: the mean depth of a disc's points on it is 2/3 of its radius, the same from everywhere."""
    rng = np.random.default_rng(8)
    points = rng.normal(size=(60_000, 3))
    points *= 3.0 / np.linalg.norm(points, axis=1, keepdims=True)
    along, wander, across = measure_visible_centroid(SampledMesh(points, points / 3.0))
    assert along == pytest.approx(-2.0, rel=0.05)  # cells at the rim, nearest point of each
    assert wander < 0.05
    assert across < 0.05


def test_refused(model):
    with pytest.raises(rl.ScenarioError, match="at least 6 points"):
        align(np.zeros((5, 3)), model, TRUE)
    with pytest.raises(rl.ScenarioError, match="corners"):
        sample_mesh(np.zeros((0, 3, 3)))
    with pytest.raises(rl.ScenarioError, match="PoseFollower"):
        PoseFollower(model, min_points=2)

import numpy as np
import pytest
import trimesh
from scipy.spatial.distance import cdist, pdist
from scipy.spatial.transform import RigidTransform, Rotation

from rso_lidar.dataset.scoring.pose_errors import ModelSurface, find_pose_errors
from rso_lidar.records import Symmetry
from rso_lidar.track import SampledMesh, sample_mesh
from rso_lidar.units import DEG
from tests.dataset.scoring.frames import by_name, make_card, make_truth

SPHERE = ModelSurface(sample_mesh(trimesh.creation.icosphere(subdivisions=5, radius=1.0).triangles))
BOX = ModelSurface(sample_mesh(trimesh.creation.box((6.0, 2.0, 2.0)).triangles))
FLOOR_M = 0.013  # of ADD-S: half the spacing of 20,000 points on a sphere of radius 1


def pose(shift=(0.0, 0.0, 0.0), rotvec=(0.0, 0.0, 0.0)):
    return RigidTransform.from_components(np.array(shift, float), Rotation.from_rotvec(rotvec))


def pose_columns(position, quaternion):
    names = ("x_m", "y_m", "z_m", "qx", "qy", "qz", "qw")
    return dict(zip(names, np.column_stack([position, quaternion]).T, strict=True))


def test_add_of_a_shift_is_the_shift():
    here = pose((3.0, -1.0, 500.0), (0.3, 1.0, -0.2))
    moved = RigidTransform.from_components(here.translation + np.array([0.3, 0.0, -0.4]), here.rotation)
    add, adds = BOX.find_distances(moved, here)
    assert add == pytest.approx(0.5) and adds < add
    assert BOX.find_distances(here, here)[0] == pytest.approx(0.0, abs=1e-12)
    assert BOX.diameter_m == pytest.approx(np.sqrt(44.0), rel=0.01)


def test_add_of_a_turned_sphere_is_in_closed_form():
    # a turn by t moves a point at distance r sin(u) of the axis by 2 sin(t/2) r sin(u), and the mean of sin(u) is pi/4
    add, adds = SPHERE.find_distances(pose(rotvec=(0.0, 0.0, 0.8)), pose())
    assert add == pytest.approx(2.0 * np.sin(0.4) * np.pi / 4.0, rel=0.03)
    assert adds < FLOOR_M


def test_adds_of_a_sphere_depends_on_the_shift_alone():
    for rotvec in ((0.0, 0.0, 0.0), (1.0, 0.3, -2.0)):
        _, adds = SPHERE.find_distances(pose((0.0, 0.0, 0.2), rotvec), pose())
        # distance of a shifted point from a unit sphere, averaged over the sphere
        cosines = np.linspace(-1.0, 1.0, 20001)
        assert adds == pytest.approx(np.mean(np.abs(np.sqrt(1.0 + 0.04 + 0.4 * cosines) - 1.0)), abs=FLOOR_M)


def make_craft(count=1700):
    """Return points of a craft without any symmetry: a small dense bus, a long boom, and a plate at its side."""
    rng = np.random.default_rng(8)
    bus = rng.uniform([-0.5, -0.4, -0.3], [0.5, 0.4, 0.3], (count - 900, 3))
    boom = rng.uniform([0.5, -0.05, 0.1], [7.0, 0.05, 0.2], (300, 3))
    plate = rng.uniform([-0.2, 0.4, -0.1], [0.6, 3.0, -0.08], (600, 3))
    points_m = rng.permutation(np.concatenate([bus, boom, plate]))
    return ModelSurface(SampledMesh(points_m, np.zeros_like(points_m)))


CRAFT = make_craft()
POSES = [
    (pose((0.4, -0.2, 300.0), (0.3, 1.0, -0.2)), pose((0.1, 0.3, 301.0), (0.3, 0.7, -0.4))),
    (pose((-2.0, 1.0, 80.0), (2.0, 0.4, 0.9)), pose((-2.5, 0.2, 82.0), (-1.1, 0.3, 2.0))),
    (pose((0.0, 0.0, 50.0), (0.0, 0.0, 1.4)), pose((1.0, 0.0, 50.0), (0.0, 0.0, 0.0))),
]


def compute_by_brute_force(points_m, found, true):
    """Return ADD and ADD-S [m] of 500 points by their definitions, in lidar axes: from true points to estimated ones."""
    chosen = points_m[:: len(points_m) // 500][:500]
    add = np.mean([np.linalg.norm(found.apply(point) - true.apply(point)) for point in chosen])
    adds = cdist(true.apply(chosen), found.apply(points_m)).min(axis=1).mean()
    return float(add), float(adds)


@pytest.mark.parametrize(("found", "true"), POSES)
def test_distances_of_a_craft_without_symmetry_are_those_of_brute_force(found, true):
    expected = compute_by_brute_force(CRAFT.mesh.points_m, found, true)
    assert CRAFT.find_distances(found, true) == pytest.approx(expected, rel=1e-9)
    other_way = compute_by_brute_force(CRAFT.mesh.points_m, true, found)
    assert other_way[0] == pytest.approx(expected[0]) and abs(other_way[1] / expected[1] - 1.0) > 0.02  # not symmetric


def test_every_frame_has_the_distances_of_its_own_poses_and_model():
    truth = make_truth(9)
    turn = Rotation.from_rotvec(np.linspace(0.1, 0.9, 9)[:, None] * [0.3, 0.5, -0.8])
    position = truth.position_m + np.linspace(0.2, 0.6, 9)[:, None] * [1.0, -2.0, 0.5]
    quaternion = (turn * Rotation.from_quat(truth.quaternion_xyzw)).as_quat()
    surfaces = {0: CRAFT, 1: BOX}  # that of model 2 is not known
    errors = find_pose_errors(truth, position, quaternion, surfaces, [None] * 3)
    assert {*truth.model_id.tolist()} == {0, 1, 2}
    for k, model in enumerate(truth.model_id.tolist()):
        if model == 2:
            assert np.isnan([errors.add_m[k], errors.adds_m[k], errors.diameter_m[k]]).all()
            continue
        found = RigidTransform.from_components(position[k], Rotation.from_quat(quaternion[k]))
        true = RigidTransform.from_components(truth.position_m[k], Rotation.from_quat(truth.quaternion_xyzw[k]))
        expected = compute_by_brute_force(surfaces[model].mesh.points_m, found, true)
        assert (errors.add_m[k], errors.adds_m[k]) == pytest.approx(expected, rel=1e-9)
        assert errors.diameter_m[k] == surfaces[model].diameter_m


def test_the_diameter_is_that_of_brute_force():
    assert CRAFT.diameter_m == pytest.approx(pdist(CRAFT.mesh.points_m).max(), rel=2e-3)
    few = SampledMesh(np.array([[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [0.0, 4.0, 0.0]]), np.zeros((3, 3)))
    assert ModelSurface(few).diameter_m == pytest.approx(5.0) and len(ModelSurface(few).points_m) == 3


def test_a_box_on_its_head_is_right_by_the_closest_points_only():
    truth = make_truth(40)
    turn = Rotation.from_rotvec([np.pi, 0.0, 0.0])
    columns = pose_columns(truth.position_m, (Rotation.from_quat(truth.quaternion_xyzw) * turn).as_quat())
    card = make_card(truth, columns, surfaces=dict.fromkeys(range(3), BOX), replicates=100)
    found = by_name(card)
    assert found["add_recall"].value.value == found["add_area"].value.value == 0.0
    assert found["adds_recall"].value.value == 1.0 and 0.9 < found["adds_area"].value.value < 1.0
    (recall,) = (values for bins, values in card.binned if bins.name == "pose_recall" and bins.quantity == "range")
    assert {value.value for value in recall["ADD"]} == {0.0} and {value.value for value in recall["ADD-S"]} == {1.0}


def test_a_box_may_stand_on_its_head():
    add, adds = BOX.find_distances(pose(rotvec=(np.pi, 0.0, 0.0)), pose())
    assert adds < 0.03 and add > 2.0


def test_errors_are_angles_and_distances():
    truth = make_truth(50)
    turn = Rotation.from_rotvec(np.tile([0.0, 0.1, 0.0], (50, 1)))
    quaternion = (Rotation.from_quat(truth.quaternion_xyzw) * turn).as_quat()
    errors = find_pose_errors(truth, truth.position_m + np.array([0.0, 3.0, 4.0]), quaternion, {}, [None] * 3)
    assert errors.rotation_rad == pytest.approx(np.full(50, 0.1))
    assert errors.translation_m == pytest.approx(np.full(50, 5.0))
    assert np.isnan(errors.add_m).all() and np.isnan(errors.diameter_m).all()


def test_attitudes_that_look_the_same_are_no_errors():
    truth = make_truth(60)
    turn = Rotation.from_euler("ZX", np.tile([90.0, 4.0], (60, 1)), degrees=True)
    quaternion = (Rotation.from_quat(truth.quaternion_xyzw) * turn).as_quat()
    symmetries = [Symmetry(fold=0), Symmetry(fold=4), None]
    errors = find_pose_errors(truth, truth.position_m, quaternion, {}, symmetries)
    tilt, whole = 4.0 * DEG, turn[0].magnitude()
    for model, expected in enumerate((tilt, tilt, whole)):
        of_model = errors.rotation_rad[truth.model_id == model]
        assert len(of_model) > 5 and of_model == pytest.approx(np.full(len(of_model), expected))


def test_perfect_poses():
    truth = make_truth(30)
    columns = pose_columns(truth.position_m, -truth.quaternion_xyzw)  # the other sign is the same rotation
    found = by_name(make_card(truth, columns, surfaces=dict.fromkeys(range(3), BOX)))
    assert found["rotation_error_median"].value.value == pytest.approx(0.0, abs=1e-6)
    assert found["translation_error_median"].value.value == 0.0
    assert found["add_recall"].value.value == found["adds_recall"].value.value == 1.0
    assert found["add_area"].value.value == pytest.approx(1.0)


def test_the_area_is_that_of_recall_over_thresholds():
    truth = make_truth(40)
    shift = np.linspace(0.0, 1.2, 40)[:, None] * np.array([[0.0, 0.0, 1.0]])
    columns = pose_columns(truth.position_m + shift, truth.quaternion_xyzw)
    found = by_name(make_card(truth, columns, surfaces=dict.fromkeys(range(3), BOX)))
    thresholds = (np.arange(5000) + 0.5) / 5000 * 0.1 * BOX.diameter_m
    recall = (shift[:, 2][:, None] < thresholds).mean(axis=0)
    assert found["add_area"].value.value == pytest.approx(recall.mean(), abs=1e-3)
    assert found["add_recall"].value.value == np.mean(shift[:, 2] < 0.1 * BOX.diameter_m)


def test_missing_poses_are_failures_and_empty_frames_are_not():
    truth = make_truth(40, empty=10)
    position, quaternion = np.nan_to_num(truth.position_m), np.nan_to_num(truth.quaternion_xyzw)
    quaternion[truth.present == 0] = [0.0, 0.0, 0.0, 1.0]
    position[:8] = quaternion[:8] = np.nan
    found = by_name(make_card(truth, pose_columns(position, quaternion), surfaces=dict.fromkeys(range(3), BOX)))
    assert found["add_recall"].value.frames == 30
    assert found["add_recall"].value.value == found["adds_recall"].value.value == pytest.approx(22 / 30)
    assert found["translation_error_median"].value.value == 0.0
    assert found["translation_error_90"].value.value == np.inf


def test_errors_are_binned_by_range_and_lit_pixels():
    truth = make_truth(300)
    shift = np.stack([truth.range_to_target_m * 1e-3, np.zeros(300), np.zeros(300)], axis=1)
    card = make_card(truth, pose_columns(truth.position_m + shift, truth.quaternion_xyzw), replicates=100)
    bins = {(one.name, one.quantity): (one, values["median"]) for one, values in card.binned}
    one, values = bins["translation_error_m", "range"]
    medians = np.array([value.value for value in values])
    assert np.all((medians > 1e-3 * one.edges[:-1]) & (medians < 1e-3 * one.edges[1:]))
    assert ("rotation_error_deg", "lit_pixels") in bins
    assert by_name(card)["relative_translation_error_median"].value.value == pytest.approx(1e-3)

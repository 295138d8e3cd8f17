import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import RigidTransform, Rotation

from rso_lidar.dataset.scoring.pose_errors import ModelSurface, find_pose_errors
from rso_lidar.records import Symmetry
from rso_lidar.track.pose.sampled_mesh import sample_mesh
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

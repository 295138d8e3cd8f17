"""Keypoints in images: places by closed forms, visibility against a caster of its own, hinges, and recordings."""

import dataclasses

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

import rso_lidar as rl
from rso_lidar.simulation.keypoint_labels import TOLERANCE

SCENE = """
version = 1
name = "keypoints"
seed = 1
[world]
axes = "local"
sun_direction = [-1, 0.3, 0.5]
[time]
start_utc = 2024-09-17T12:00:00Z
duration_s = 2
frame_rate_hz = 1
[[target]]
name = "craft"
model = "craft.stl"
center_of_mass_m = [0, 0, 0]
motion = { type = "fixed", position_m = [40, 0.5, -1] }
attitude = { type = "fixed", euler_zyx_deg = [25, -20, 40] }
[follower]
motion = { type = "fixed", position_m = [0, 0, 0] }
[lidar]
receiver = { f_number = 4, fov_deg = 12, n_rows = 24, n_cols = 32 }
laser = { divergence_deg = 12 }
[[camera]]
name = "nav"
mount = { position_m = [0, 0.4, 0], euler_zyx_deg = [3, 2, 0] }
lens.f_number = 4
lens.fov_deg = 20
lens.n_rows = 48
lens.n_cols = 64
lens.distortion = { type = "brown_conrady", k1 = -1.5, p2 = 0.02 }
"""
# lidar_from_follower: x right, y down, z ahead from x forward, y left, z up (REP-103)
OPTICAL = np.array([[0, -1, 0], [0, 0, -1], [1, 0, 0]], dtype=float)
BODY = Rotation.from_euler("ZYX", [25, -20, 40], degrees=True).as_matrix()


def fly(tmp_path, mesh, points, change=str):
    """Return the first frame of the scene with a mesh, and its scenario."""
    mesh.export(tmp_path / "craft.stl")
    table = "name,x,y,z,part\n" + "".join(f"p{k},{x!r},{y!r},{z!r}\n" for k, (x, y, z) in enumerate(points.tolist()))
    (tmp_path / "points.csv").write_text(table)
    text = change(SCENE.replace("center_of", 'keypoint_file = "points.csv"\ncenter_of'))
    (tmp_path / "scene.toml").write_text(text)
    scenario = rl.Scenario.load(tmp_path / "scene.toml")
    return next(iter(rl.simulate(scenario, frames=[0], threads=1))), scenario


def test_places_are_those_of_a_pinhole_and_of_the_inverse_of_a_distortion(tmp_path):
    """Row and column of the lidar by f x / z + c. Undistorted, those of the camera look along the points."""
    box = trimesh.creation.box((2, 3, 1))
    points = np.asarray(box.vertices)
    frame, scenario = fly(tmp_path, box, points)
    ahead = points @ BODY.T + [40, 0.5, -1]
    x, y, z = (ahead @ OPTICAL.T).T
    focal_px = 16 / np.tan(np.radians(6))
    expected = np.stack([focal_px * y / z + 11.5, focal_px * x / z + 15.5], axis=1)
    assert frame.labels.keypoint_px == pytest.approx(expected, abs=1e-9)
    assert frame.labels.keypoint_range_m == pytest.approx(np.linalg.norm(ahead, axis=1), rel=1e-12)
    assert frame.source.keypoints == tuple(("craft", f"p{k}") for k in range(8))

    mount = Rotation.from_euler("ZYX", [3, 2, 0], degrees=True).as_matrix()
    x, y, z = ((ahead - [0, 0.4, 0]) @ mount @ OPTICAL.T).T
    labels, lens = frame.camera_labels["nav"], scenario.cameras[0].lens
    row, col = labels.keypoint_px.T
    seen_x, seen_y = lens.tangents_at(col + 0.5, row + 0.5)
    assert seen_x == pytest.approx(x / z, abs=1e-12) and seen_y == pytest.approx(y / z, abs=1e-12)
    # By hand (Brown 1966), without the code of the lens:
    u, v = x / z, y / z
    r2 = u * u + v * v
    focal_px = 32 / np.tan(np.radians(10))
    by_hand = focal_px * (u * (1 - 1.5 * r2) + 0.02 * (r2 + 2 * u * u)) + 31.5
    assert col == pytest.approx(by_hand, abs=1e-9)


def test_visibility_is_that_of_a_caster_of_its_own_on_a_mesh_of_nasa(tmp_path, shared):
    """Juno: points on 400 random facets, from the lidar, against all facets (Möller and Trumbore 1997) in float64."""
    mesh = trimesh.load(shared / "meshes" / "juno.stl")
    rng = np.random.default_rng(3)
    corners = np.asarray(mesh.triangles, dtype=float)
    share = rng.dirichlet([1, 1, 1], 400)
    points = np.einsum("pc,pci->pi", share, corners[rng.integers(len(corners), size=400)])
    frame, _ = fly(tmp_path, mesh, points, lambda text: text.replace("fov_deg = 12", "fov_deg = 40"))
    eye = -np.array([40, 0.5, -1]) @ BODY  # the lidar in body axes
    away = np.linalg.norm(points - eye, axis=1)
    tolerance_m = TOLERANCE * np.linalg.norm(corners.reshape(-1, 3), axis=1).max()
    nearest = np.array([cast(eye, (point - eye) / r, corners) for point, r in zip(points, away, strict=True)])
    before = away - nearest  # of the first surface, 0 for a point that nothing hides
    clear = np.abs(before - tolerance_m) > 1e-3 * tolerance_m  # float32 decides the others
    expected = np.where(before < tolerance_m, 2, 1)
    assert np.count_nonzero(~clear) < 5 and 50 < np.count_nonzero(expected == 2) < 350
    assert frame.labels.keypoint_visibility[clear].tolist() == expected[clear].tolist()


def cast(origin, direction, corners):
    """Return the distance to the first facet that a ray meets."""
    a, ab, ac = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    p = np.cross(direction, ac)
    scale = (ab * p).sum(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        u = ((origin - a) * p).sum(axis=1) / scale
        q = np.cross(origin - a, ab)
        v = q @ direction / scale
        t = (ac * q).sum(axis=1) / scale
    met = (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1 + 1e-9) & (t > 0)
    return t[met].min()


def test_a_point_behind_beside_or_hidden_by_another_body_is_told_apart(tmp_path):
    """A plate at 20 m covers a part of the box; its points are covered, beside the field, behind the lidar, and free."""
    other = """
[[target]]
name = "plate"
model = "plate"
motion = { type = "fixed", position_m = [20, -1, 0] }
"""
    points = np.array([[-0.5, 0, 0.2], [0, 30, 0], [-60, 0, 0], [-0.5, 2.5, 0.2]])  # the plate's shadow ends at 1.5

    def place(text):
        text = text.replace("euler_zyx_deg = [25, -20, 40]", "euler_zyx_deg = [0, 0, 0]")
        return text.replace("[40, 0.5, -1]", "[40, 0.5, 0]").replace("[follower]", other + "[follower]")

    frame, _ = fly(tmp_path, trimesh.creation.box((1, 6, 1)), points, place)
    own = frame.labels.keypoint_visibility[:4]
    assert own.tolist() == [1, 0, 0, 2]
    assert np.isnan(frame.labels.keypoint_px[1:3]).all() and np.isfinite(frame.labels.keypoint_px[[0, 3]]).all()
    assert frame.source.keypoints[4][0] == "plate"  # those of the catalogue follow


HINGED = """
[[target]]
name = "tdrs"
model = "tdrs"
motion = { type = "fixed", position_m = [200, 0, 0] }
joint = [{ name = "solar_north", angle = { type = "fixed", angle_deg = 35 } }]
"""


def test_a_hinge_turns_the_points_of_its_parts(tmp_path):
    def change(text):
        return text.replace("[follower]", HINGED + "[follower]")

    frame, scenario = fly(tmp_path, trimesh.creation.box((1, 1, 1)), np.zeros((1, 3)), change)
    joint = scenario.target[1].joints[0]
    turn = Rotation.from_rotvec(np.radians(35) * np.array(joint.axis) / np.linalg.norm(joint.axis))
    moved = 0
    for k, point in enumerate(frame.source.targets[1].keypoints, 1):
        place = np.array(point.position_m)
        if point.part in joint.parts:
            place = turn.apply(place - joint.position_m) + joint.position_m
            moved += 1
        range_m = np.linalg.norm(place + np.array([200, 0, 0]))
        assert frame.labels.keypoint_range_m[k] == pytest.approx(range_m, abs=1e-6)
    assert moved == 4  # corners of the wing


def test_a_camera_labels_the_middle_of_its_exposure(tmp_path):
    """A box that crosses the field at 3 m/s, and an exposure of 100 ms that begins 50 ms after the flash."""
    (tmp_path / "path.csv").write_text("time_s,x_m,y_m,z_m\n0,40,0,0\n2,40,6,0\n")

    def change(text):
        text = text.replace('"fixed", position_m = [40, 0.5, -1]', '"table", file = "path.csv"')
        text = text.replace("euler_zyx_deg = [25, -20, 40]", "euler_zyx_deg = [0, 0, 0]")
        return text.replace('name = "nav"', 'name = "nav"\nexposure_ms = 100\nstart_ms = 50')

    frame, _ = fly(tmp_path, trimesh.creation.box((1, 1, 1)), np.array([[-0.5, 0.5, 0.5]]), change)
    _, lidar_col = frame.labels.keypoint_px[0]
    assert lidar_col == pytest.approx(16 / np.tan(np.radians(6)) * -0.5 / 39.5 + 15.5, abs=1e-6)
    from_camera = np.array([39.5, 0.5 + 3 * 0.1 - 0.4, 0.5])
    assert frame.camera_labels["nav"].keypoint_range_m[0] == pytest.approx(np.linalg.norm(from_camera), abs=1e-6)


def test_recordings_hold_keypoints_of_both_sensors(tmp_path):
    frame, _ = fly(tmp_path, trimesh.creation.box((2, 3, 1)), np.array([[1.0, 1.5, 0.5], [0, 0, 0.2]]))
    for name in ("run.h5", "run.zarr"):
        with rl.open(rl.save(tmp_path / name, [frame])) as recording:
            again = recording[0]
            assert recording.source.targets == frame.source.targets
            for one, other in ((frame.labels, again.labels), (frame.camera_labels["nav"], again.camera_labels["nav"])):
                for field in dataclasses.fields(one):
                    if "keypoint" in field.name or field.name == "facet":
                        np.testing.assert_array_equal(getattr(one, field.name), getattr(other, field.name))
            assert recording.camera["nav"].keypoint_px[:].shape == (1, 2, 2)
    flown_again = rl.Scenario.loads(frame.source.scenario)
    assert flown_again.target[0].keypoint == frame.source.targets[0].keypoints
    assert flown_again.target[0].keypoint_file is None


@pytest.mark.parametrize(
    ("table", "line"),
    [
        ("p,1,2\n", "line 1: needs name, x, y, z"),
        ("p,1,2,nan\n", "line 1: needs name"),
        ("name,x,y,z\np,1,2,3,wing\n", "no part 'wing'"),
        ("p,1,2,3\np,1,2,4\n", "two points have the name 'p'"),
        ("a b,1,2,3\n", "points.csv: line 1"),
        ("p,1,2,3,body,more\n", "line 1: needs name"),
    ],
)
def test_a_table_of_points_that_does_not_fit_is_one_line(tmp_path, table, line):
    trimesh.creation.box((1, 1, 1)).export(tmp_path / "craft.stl")
    (tmp_path / "points.csv").write_text(table)
    (tmp_path / "scene.toml").write_text(SCENE.replace("center_of", 'keypoint_file = "points.csv"\ncenter_of'))
    with pytest.raises(rl.RsoLidarError, match=line) as caught:
        _ = rl.Scenario.load(tmp_path / "scene.toml").source
    assert "\n" not in str(caught.value)


def test_normals_of_both_sensors_are_those_of_the_facets_that_label_the_pixels(tmp_path):
    """A turned box: the normals of trimesh, by the label of the facet, and toward the sensor."""
    box = trimesh.creation.box((2, 3, 1))
    frame, scenario = fly(tmp_path, box, np.zeros((1, 3)))
    mesh = trimesh.load(tmp_path / "craft.stl", process=False)
    mount = Rotation.from_euler("ZYX", [3, 2, 0], degrees=True).as_matrix()
    for camera, labels, turn in (
        (None, frame.labels, OPTICAL @ BODY),
        ("nav", frame.camera_labels["nav"], OPTICAL @ mount.T @ BODY),
    ):
        normals = rl.find_normals(frame, scenario, camera)
        on = labels.target >= 0
        assert np.isnan(normals[~on]).all() and np.count_nonzero(on) > 20
        expected = np.asarray(mesh.face_normals)[labels.facet[on]] @ turn.T
        assert normals[on] == pytest.approx(expected, abs=1e-6)  # a closed box shows its outer sides only
        assert len(np.unique(labels.facet[on])) >= 3
    with pytest.raises(rl.RsoLidarError, match="no camera 'nave' in the frame; did you mean 'nav'"):
        rl.find_normals(frame, scenario, "nave")

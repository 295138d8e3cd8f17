"""The baselines of examples/learning: their inputs, and that each trains and writes predictions."""

import importlib
import sys
from pathlib import Path

import numpy as np
import pytest

import rso_lidar as rl

LEARNING = Path(__file__).resolve().parents[1] / "examples" / "learning"
WITHOUT_TORCH = (
    "arguments", "frames", "gap", "images", "noise", "parts_by_place", "pose_tables", "predictions", "presence",
    "sensors", "shape", "study",
)  # fmt: skip
WITH_TORCH = ("pytorch", "networks", "training", "resnet", "pose", "parts", "super_resolution", "explain", "benchmark")
SPEC = """
version  = 1
name     = "Few"
scenario = "bench.toml"
draws    = 2

[view]
range_m = { type = "log_uniform", low = 300, high = 900 }

[labels]
oversampled = true

[split]
type = "random"
test = 0.4

[[classes]]
name    = "tdrs"
models  = ["tdrs"]
samples = 5

[[classes]]
name    = "stage"
models  = ["rocket_body"]
samples = 5

[[classes]]
name    = "nothing"
empty   = true
samples = 5
"""


class Examples(dict):
    """The modules of the examples by name, imported at first use; a test that needs torch is skipped without it."""

    def __missing__(self, name):
        if name in WITH_TORCH:
            pytest.importorskip("torch", reason="needs the extra learn: pip install 'rso-lidar[learn]'")
        self[name] = importlib.import_module(name)
        return self[name]


@pytest.fixture
def learning(monkeypatch):
    """Return the modules of the examples by name, and remove them from `sys.modules` afterwards."""
    monkeypatch.syspath_prepend(str(LEARNING))
    for name in (*WITHOUT_TORCH, *WITH_TORCH):
        monkeypatch.delitem(sys.modules, name, raising=False)
    yield Examples()
    for name in (*WITHOUT_TORCH, *WITH_TORCH):
        sys.modules.pop(name, None)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a dataset of two craft and of empty frames."""
    root = tmp_path_factory.mktemp("learning")
    rl.dataset.make(rl.dataset.DatasetSpec.loads(SPEC, folder=LEARNING), root / "few", workers=1)
    return root / "few"


def test_resnet_18_has_the_parameters_of_the_original(learning):
    network = learning["networks"].ResNet18(1000)
    assert sum(one.numel() for one in network.parameters()) == 11_689_512  # He et al. 2016, as torchvision counts them


def test_group_is_found_among_noise(learning):
    rng = np.random.default_rng(3)
    craft = np.array([100.0, -40.0, 2000.0]) + rng.uniform(-6.0, 6.0, (30, 3))
    noise = np.column_stack([rng.uniform(-60.0, 60.0, (8, 2)), rng.uniform(200.0, 1500.0, 8)])
    kept = learning["frames"].find_group(np.concatenate([noise, craft]), np.ones(38))
    assert kept.tolist() == [False] * 8 + [True] * 30
    lone = learning["frames"].find_group(noise, np.arange(8.0))
    assert np.flatnonzero(lone).tolist() == [7]  # the brightest


def test_lines_of_sight_are_those_of_the_frame(learning, folder):
    data = rl.dataset.open(folder)
    frame = data.split("train").read([0], ("intrinsics_px", "range_m"))
    found = learning["frames"].directions(frame["range_m"].shape[1:], frame["intrinsics_px"][0])
    assert np.abs(found - data.constants.line_of_sight[data.sensors[0]]).max() < 1e-9


def test_crops_turn_with_the_frame(learning, folder):
    frames = learning["frames"]
    returns = frames.load_returns(str(folder), "train")
    one = returns.take(np.array([int(np.argmax(returns.count))]))

    class Quarter:
        """Stands for a generator that draws a quarter turn without a mirror."""

        uniform = staticmethod(lambda low, high: 0.5 * np.pi)
        choice = staticmethod(lambda sides: 1.0)

    plain, turned = frames.crop(one, np.array([0])), frames.crop(one, np.array([0]), Quarter())
    assert plain[0, 2].sum() > 300
    assert np.mean(np.rot90(plain[0, 2]) == turned[0, 2]) > 0.97  # but for cells between two pixels


def test_rotation_loss_is_blind_to_a_symmetry(learning):
    from scipy.spatial.transform import Rotation

    loss, torch = learning["pose"].rotation_loss, learning["pose"].torch
    true = Rotation.from_rotvec([0.3, -1.0, 0.4])
    spun = true * Rotation.from_rotvec([0.0, 0.0, 1.2])
    flipped = true * Rotation.from_rotvec([np.pi, 0.0, 0.0])
    found = torch.tensor(np.stack([spun.as_matrix(), flipped.as_matrix()])[None])
    group = torch.tensor(np.stack([np.eye(3), Rotation.from_rotvec([np.pi, 0.0, 0.0]).as_matrix()])[None])
    about_z = torch.diag(torch.tensor([0.0, 0.0, 1.0], dtype=torch.float64))[None]
    whole = torch.eye(3, dtype=torch.float64)[None]
    wanted = torch.tensor(true.as_matrix()[None])
    assert loss(found, wanted, group[:, :1], about_z)[0].tolist() == pytest.approx([0.0, 4.0])
    assert loss(found, wanted, group, about_z)[0].tolist() == pytest.approx([0.0, 0.0], abs=1e-12)
    # |A - B|^2 of rotations is 4 (1 - cos angle)
    assert loss(found, wanted, group, whole)[0].tolist() == pytest.approx([4.0 * (1.0 - np.cos(1.2)), 0.0], abs=1e-12)


def test_range_by_a_camera_follows_from_the_size_of_its_points_in_metres(learning):
    pose, rng = learning["pose"], np.random.default_rng(4)
    position_m = np.array([[3.0, -2.0, 200.0], [30.0, -12.0, 1600.0]])
    craft_m = rng.uniform(-4.0, 4.0, (300, 3)) * [1.0, 1.0, 0.0]
    craft_m += [1.0, 0.5, 0.0] - craft_m.mean(axis=0)
    seen = position_m[:, None] + craft_m
    points = 1000.0 * seen / np.linalg.norm(seen, axis=-1, keepdims=True)
    camera = learning["frames"].Returns(
        start=np.array([0, 300, 600]), point_m=points.reshape(-1, 3), pixel=np.zeros((600, 2), int),
        intensity=np.ones(600), reports=np.array([300, 300]), columns={"class_id": np.zeros(2, int)},
    )  # fmt: skip
    sight = pose.Sight(None, camera, position_m, np.stack([np.eye(3)] * 2))
    cloud, middle, unit = sight.clouds(np.arange(2), rng)
    code = sight.encode(np.arange(2), middle, unit)
    rms_m = np.sqrt(craft_m.var(axis=0).sum())
    assert code[:, 2] == pytest.approx(np.log(rms_m / 10.0), abs=1e-3)  # the same at both ranges
    assert code[:, :2] == pytest.approx(np.tile([-1.0, -0.5] / rms_m, (2, 1)), abs=1e-2)
    assert np.square(cloud[..., :3]).sum(axis=2).mean(axis=1) == pytest.approx(
        [1.0, 1.0], rel=0.15
    )  # 128 random points of 300
    assert sight.decode(code, middle, unit) == pytest.approx(position_m, abs=0.01)  # points at one range are a sphere
    astray_m = position_m + np.array([[0.0, 0.0, 0.0], [20.0, 0.0, 0.0]])  # the points of the second frame are clutter
    assert pose.Sight(None, camera, astray_m, sight.rotation).is_craft().tolist() == [True, False]


def test_icp_takes_the_guess_that_fits(learning, folder):
    from scipy.spatial.transform import Rotation

    pose = learning["pose"]
    returns = learning["frames"].load_returns(str(folder), "train")
    frame = int(np.argmax(returns.count * (returns.columns["class_id"] == 0)))
    mesh = pose.load_meshes(("tdrs",))[0]
    true = Rotation.from_quat(returns.columns["quaternion_xyzw"][frame])
    guesses = [(true * Rotation.from_rotvec(off)).as_matrix() for off in ([0.0, 1.5, 0.5], [0.1, -0.1, 0.05])]
    point_m = returns.point_m[returns.of(frame)][::4].astype(float)
    near_m = returns.columns["position_m"][frame] + 0.3
    half_field_rad = np.deg2rad(1.25)
    found, misfit = pose.refine(point_m, mesh, np.stack(guesses), near_m, half_field_rad)
    assert (found.pose.rotation.inv() * true).magnitude() < 0.02
    assert misfit < pose.refine(point_m, mesh, np.stack(guesses[:1]), near_m, half_field_rad)[1]
    assert np.linalg.norm(found.pose.translation - returns.columns["position_m"][frame]) < 0.1


@pytest.mark.parametrize(
    ("name", "options", "column", "shape"),
    [
        ("shape", [], "scores", (2,)),
        ("shape", ["--floor"], "scores", (2,)),
        ("resnet", ["--epochs", "1"], "scores", (2,)),
        ("pose", ["--epochs", "1", "--no-icp"], "quaternion_xyzw", (4,)),  # pose_before_icp.npz
        ("parts", ["--epochs", "1"], "part_class_id", (128, 128)),
        ("super_resolution", ["--epochs", "1"], "oversampled_range_m", (512, 512)),
        ("presence", [], "present", ()),
        ("parts_by_place", [], "part_class_id", (128, 128)),
    ],
)
def test_a_baseline_writes_a_prediction_for_each_frame(
    learning, folder, tmp_path, monkeypatch, name, options, column, shape
):
    place = tmp_path / f"{name}.npz"
    monkeypatch.setattr(sys, "argv", [name, str(folder), "-o", str(place), *options])
    learning[name].main()
    test = rl.dataset.open(folder).split("test")
    with np.load(place if place.exists() else tmp_path / f"{name}_before_icp.npz") as found:
        assert found[column].shape == (len(test), *shape)
        assert sorted(found["sample"].tolist()) == sorted(test.column("sample").tolist())
        assert np.isfinite(found["scores"]).all() if column == "scores" else True


@pytest.mark.slow
def test_the_benchmark_sees_with_both_sensors(learning, tmp_path, monkeypatch, capsys):
    spec = rl.dataset.DatasetSpec.loads(SPEC, folder=LEARNING).replace(scenario="benchmark_1_scenario.toml", draws=1)
    folder = tmp_path / "two_eyes"
    test = rl.dataset.make(spec, folder, workers=1).split("test")
    for name, sensor, options in (
        ("shape", "camera", []), ("shape", "both", []), ("benchmark", "both", ["--epochs", "1", "--size", "32"]),
    ):  # fmt: skip
        place = tmp_path / f"{name}_{sensor}.npz"
        asked = [name, str(folder), "--sensor", sensor, "--also", f"{folder}/", "-o", str(place), *options]
        monkeypatch.setattr(sys, "argv", asked)
        learning[name].main()
        with np.load(place) as found, np.load(tmp_path / f"{name}_{sensor}_two_eyes.npz") as again:
            assert found["scores"].shape == (len(test), 2)
            assert np.all((found["present"] >= 0.0) & (found["present"] <= 1.0))
            assert np.array_equal(found["scores"], again["scores"])
    monkeypatch.setattr(
        sys, "argv", ["sensors", str(folder), "--both", str(tmp_path / "shape_both.npz"), "-o", "x.png"]
    )
    monkeypatch.chdir(tmp_path)
    capsys.readouterr()
    learning["sensors"].main()
    assert "100 reporting pixels or more" in capsys.readouterr().out
    assert (tmp_path / "x.png").stat().st_size > 10_000
    for sensor in ("camera", "both"):
        monkeypatch.setattr(
            sys, "argv", ["pose", str(folder), "--sensor", sensor, "--epochs", "1", "--no-icp", "-o", f"{sensor}.npz"]
        )
        learning["pose"].main()
    asked = ["--camera", "camera_before_icp.npz", "--both", "both_before_icp.npz"]
    monkeypatch.setattr(sys, "argv", ["pose_tables", str(folder), *asked])
    capsys.readouterr()
    learning["pose_tables"].main()
    assert "both, 1 runs" in capsys.readouterr().out


def test_metric_crops_place_returns_in_metres(learning, folder):
    frames = learning["frames"]
    returns = frames.load_returns(str(folder), "train")
    frame = int(np.argmax(returns.count))
    image, extra = frames.metric_crop(returns, np.array([frame]))
    point = returns.point_m[returns.of(frame)]
    wide_m = 10.0 * np.ptp(image[0, 3:], axis=(1, 2))  # down, right
    cell_m = 10.0 * float(np.exp(extra[0, 0])) * 2.0 / frames.CROP
    assert wide_m == pytest.approx(np.ptp(point[:, [1, 0]], axis=0), abs=3.0 * cell_m)
    assert np.all(image[0, 3:][:, image[0, 2] == 0.0] == 0.0)


def test_turned_crops_keep_returns_at_their_places_in_metres(learning, folder):
    frames, benchmark = learning["frames"], learning["benchmark"]
    returns = frames.load_returns(str(folder), "train")
    image, extra = frames.metric_crop(returns, np.flatnonzero(returns.has_craft))
    turned = benchmark.turn(benchmark.torch.as_tensor(image), np.random.default_rng(5), benchmark.ACROSS).numpy()
    half = np.exp(extra[:, 0])[:, None, None, None]
    expected = frames.cells()[None] * half * turned[:, 2:3]  # down, right
    cell = 2.0 * half / frames.CROP
    assert np.all(np.abs(turned[:, 3:] - expected) <= cell)
    assert turned[:, 2].sum() == pytest.approx(image[:, 2].sum(), rel=0.02)


def test_the_largest_bright_group_of_an_image_is_cropped(learning):
    rng = np.random.default_rng(8)
    image = rng.normal(64.0, 3.3, (256, 256)).round()
    assert not learning["images"].find_bright(image)[1].any()  # noise alone
    image[100:120, 50:90] += 60.0
    image[100:120, 98:100] += 60.0  # an edge of the same craft, across a shadow of 8 pixels
    image[200:203, 200:203] += 4000.0  # brighter, but smaller
    _, bright = learning["images"].find_bright(image)
    assert bright[101:119, 51:89].all()
    assert bright[101:119, 98:100].all()
    assert not bright[190:].any()
    crop, extra = learning["images"].crop_image(image)
    half_px = 10.0 * np.exp(extra[0])
    width_px = np.ptp(np.flatnonzero(crop[1].any(axis=0))) * 2.0 * half_px / learning["frames"].CROP
    assert width_px == pytest.approx(50.0, abs=3.0)


def test_sun_angle_is_zero_with_the_sun_behind_the_sensors(learning):
    position_m = np.array([[0.0, 0.0, 500.0]] * 3)
    sun = np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    assert learning["sensors"].find_sun_angle_deg(sun, position_m) == pytest.approx([0.0, 90.0, 180.0])


def test_one_frame_in_twenty_without_a_target_is_called(learning):
    present = np.random.default_rng(2).random((2, 400))
    is_present = np.arange(400) >= 200
    called = learning["sensors"].find_called(present, is_present)
    assert called[:, ~is_present].mean(axis=1).tolist() == [0.05, 0.05]


def test_changes_of_the_simulation_keep_the_frames_of_the_benchmark(learning):
    gap = learning["gap"]
    spec = rl.dataset.DatasetSpec.load(LEARNING / "benchmark_1.toml")
    for settings in gap.list_changes().values():
        rl.Scenario.load(LEARNING / "benchmark_1_scenario.toml", settings)
        other = gap.change(spec, settings, 30)
        assert (other.seed, other.view, other.clutter, other.split) == (spec.seed, spec.view, spec.clutter, spec.split)
        assert [entry.name for entry in other.classes] == [entry.name for entry in spec.classes]


@pytest.mark.parametrize("missing", ["torch", "captum", "sklearn"])
def test_a_library_that_is_absent_is_one_line(learning, monkeypatch, capsys, missing):
    monkeypatch.setitem(sys.modules, missing, None)  # as if it were not installed
    with pytest.raises(SystemExit) as ended:
        if missing == "torch":
            importlib.import_module("pytorch")
        else:
            learning["arguments"].run(lambda: importlib.import_module(missing))
    assert ended.value.code == 2
    assert capsys.readouterr().err == f"{missing}: is not installed: pip install 'rso-lidar[learn]'\n"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["/nowhere"], "is not the folder of a dataset"),
        (["/nowhere", "-o", "/nowhere/shape.npz"], "is not a file NAME.npz in an existing folder"),
        (["/nowhere", "-o", "shape.txt"], "is not a file NAME.npz in an existing folder"),
    ],
)
def test_bad_input_is_one_line(learning, monkeypatch, capsys, arguments, words):
    monkeypatch.setattr(sys, "argv", ["shape", *arguments])
    with pytest.raises(SystemExit) as ended:
        learning["arguments"].run(learning["shape"].main)
    assert ended.value.code == 2
    assert words in capsys.readouterr().err.splitlines()[-1]

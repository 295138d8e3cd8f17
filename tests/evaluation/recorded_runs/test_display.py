"""How a recording is shown: what is chosen with and without a display, and the true meshes in place."""

import dataclasses

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.evaluation.recorded_runs import display as module
from rso_lidar.evaluation.recorded_runs.display import choose_viewer, load_true_shapes

HINGED = (
    'motion = { type = "fixed", position_m = [500, 0, 0] }\n'
    'joint = [{ name = "array", parts = ["solar_array_north", "solar_substrate_north", "solar_yoke_north"], '
    'position_m = [0, -0.012, -0.128], axis = [0, 1, 0], angle = { type = "fixed", angle_deg = 30 } }]\n'
)
PLATE = 'motion   = { type = "fixed", position_m = [1000, 0, 0] }\n'


@pytest.fixture
def desk(monkeypatch):
    """Return a function that says what this machine has: a display, Rerun, something to open windows with."""

    def have(*, display=True, rerun=True, window=True):
        monkeypatch.setattr(module, "has_display", lambda: display)
        monkeypatch.setattr(module.rerun_scene, "has_rerun", lambda: rerun)
        monkeypatch.setattr(module.rerun_scene, "import_rerun", lambda what: None)
        monkeypatch.setattr(module, "window_backend", lambda: "tkagg" if window else None)

    return have


@pytest.mark.parametrize(
    ("here", "asked", "tool", "why"),
    [
        ({}, None, "rerun", "Rerun"),
        ({"rerun": False}, None, "window", "matplotlib's window (tkagg)"),
        ({}, "window", "window", "matplotlib's window (tkagg)"),
        ({}, "files", "files", ""),
        ({"rerun": False, "window": False}, None, "files", "matplotlib has nothing to open a window with"),
        ({"display": False}, None, "files", "no display"),
        ({"display": False}, "files", "files", ""),
        ({"display": False}, "rerun", "rerun", "no display"),
    ],
)
def test_the_first_that_is_possible(desk, tmp_path, here, asked, tool, why):
    desk(**here)
    chosen = choose_viewer(asked, recording=tmp_path / "a.h5")
    assert chosen.tool == tool
    assert chosen.why.startswith(why)
    assert bool(chosen.why) == bool(why)
    written = {
        "files": ["a_view.png", "a_view_sheet.png", "a_view.gif"],
        "rerun": ["a.rrd"] if why == "no display" else [],
    }
    assert [path.name for path in chosen.paths] == written.get(tool, [])


@pytest.mark.parametrize(
    ("here", "asked", "output", "said"),
    [
        ({}, "rerunn", None, "did you mean 'rerun'"),
        ({"display": False}, "window", None, "no display; choose files"),
        ({"window": False}, "window", None, "nothing to open a window with"),
        ({}, "window", "b.png", "a window writes no file"),
        ({}, "rerun", "b.png", "unknown suffix '.png'"),
        ({}, "files", "b.rrd", "unknown suffix '.rrd'"),
        ({}, None, "b.mcap", "unknown suffix '.mcap'"),
        ({}, None, "no/such/b.rrd", "there is no folder"),
        ({}, None, "old.rrd", "exists already"),
        ({"display": False}, None, None, "exists already"),
    ],
)
def test_what_cannot_be_is_said_at_once(desk, tmp_path, monkeypatch, here, asked, output, said):
    desk(**here)
    monkeypatch.chdir(tmp_path)
    for name in ("old.rrd", "a_view_sheet.png"):
        (tmp_path / name).touch()
    with pytest.raises(rl.RecordingError, match=said):
        choose_viewer(asked, output, recording=tmp_path / "a.h5")


def test_overwriting_is_asked_for(desk, tmp_path):
    desk(display=False)
    (tmp_path / "a_view_sheet.png").touch()
    assert len(choose_viewer(recording=tmp_path / "a.h5", overwrite=True).paths) == 3


def test_frames_made_in_memory_have_no_file_to_write_beside(desk, text):
    desk(display=False)
    with pytest.raises(rl.RecordingError, match="give output"):
        rl.view(list(rl.simulate(rl.Scenario.loads(text), frames=[0])))


def test_display_is_what_the_environment_says(monkeypatch):
    monkeypatch.setattr(module.sys, "platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    assert not module.has_display()
    monkeypatch.setenv("WAYLAND_DISPLAY", "wayland-0")
    assert module.has_display()
    monkeypatch.delenv("WAYLAND_DISPLAY")
    monkeypatch.setattr(module.sys, "platform", "darwin")
    assert module.has_display()


def test_hinged_parts_are_in_the_axes_of_their_hinge(text):
    one_ray = "rays_per_pixel = 1\nmin_rays_per_target = 0"  # through the middle of the pixel
    flown = text.replace('"plate"', '"tdrs"').replace(PLATE, HINGED).replace("rays_per_pixel = 4", one_ray)
    scenario = rl.Scenario.loads(flown)
    (frame,) = rl.simulate(scenario, frames=[0])
    shapes = {shape.axes: shape for shape in load_true_shapes(frame.source)}
    assert list(shapes) == ["tdrs", "tdrs.array"]
    place = {
        number: (surface.name, k)
        for surface in scenario.surfaces
        for k, number in enumerate(surface.mesh.source_facet.tolist())
    }
    labels, seen = frame.labels, set()
    for row, col in np.argwhere(labels.target >= 0).tolist():
        axes, k = place[int(labels.facet[row, col])]
        a, b, c = frame.truth.pose("lidar", axes).apply(shapes[axes].corners_m[k])
        normal = np.cross(b - a, c - a)
        point = labels.range_m[row, col] * frame.line_of_sight[row, col]
        assert abs(normal @ (point - a)) / np.linalg.norm(normal) < 1e-6  # the same plane, in float64
        seen.add(axes)
    assert seen == set(shapes)


def test_a_mesh_that_is_not_here_is_told_and_left_out(text, tmp_path):
    source = next(rl.simulate(rl.Scenario.loads(text), frames=[0])).source
    gone = source.scenario.replace('model = "plate"', 'model = "gone/plate.stl"')
    assert gone != source.scenario
    with pytest.warns(rl.RsoLidarWarning, match="drawn without true meshes: .*plate.stl"):
        assert load_true_shapes(dataclasses.replace(source, scenario=gone), tmp_path) == []
    other = dataclasses.replace(source.targets[0], mesh_sha256="0" * 64)
    with pytest.warns(rl.RsoLidarWarning, match="not the mesh that was recorded"):
        assert load_true_shapes(dataclasses.replace(source, targets=(other,))) == []


def test_a_viewer_gets_the_frames_with_their_progress_in_the_colour_asked_for(desk, monkeypatch):
    got = {}
    desk()
    monkeypatch.setattr(module.rerun_scene, "write_rerun", lambda frames, path, shapes, **how: got.update(how) or path)
    monkeypatch.setattr(module.rerun_scene, "open_rerun", lambda path: got.update(opened=path.suffix))
    frames = list(rl.simulate(rl.Scenario.load("examples/bench_plate.toml"), frames=[0]))
    module.view(frames, tool="rerun", colour="intensity", each=iter(frames))
    assert got["colour"] == "intensity" and list(got["each"]) == frames and got["opened"] == ".rrd"

"""A recording of a model of the user's library: flown again as it was, or refused in one line."""

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.errors import MeshError, RecordingError, RsoLidarWarning, ScenarioError
from rso_lidar.evaluation import load_scenario
from rso_lidar.evaluation.recorded_runs.flown_scenario import load_surfaces
from rso_lidar.export import run_id
from rso_lidar.scene import MeshOptions, add_model
from tests.scene.meshes.test_mesh import BOX, binary_stl, glb

HINGE = """
[[model.hinge]]
name = "flap"
parts = ["flap"]
position_m = [0.5, 0.0, 0.0]
axis = [0.0, 0.0, 1.0]
normal = [1.0, 0.0, 0.0]
"""


@pytest.fixture
def craft(tmp_path, library):
    """Put a craft of a bus and a flap, drawn in decimetres, into the library; return what puts it there anew."""
    path = tmp_path / "craft.glb"

    def put(times=10.0, **wanted):
        path.write_bytes(glb([("bus", BOX * times), ("flap", BOX * times + 30)], [{"mesh": 0}, {"mesh": 1}]))
        said = {"scale": 0.1, "material": "white_paint", "center_of_mass_m": (0.5, 1.0, 1.5), **wanted}
        entry, _ = add_model(path, MeshOptions(**said), overwrite=True)
        index = library / "index.toml"
        index.write_text(index.read_text() + HINGE)
        return entry

    put()
    return put


@pytest.fixture
def mission(text, craft):
    """Return a scenario that flies the craft, with its flap turned."""
    target = text.replace('model    = "plate"', 'model    = "craft"').replace("material =", "#")
    joint = '[[target.joint]]\nname = "flap"\nangle = { type = "fixed", angle_deg = 30 }\n\n[follower]'
    return target.replace("[follower]", joint)


def mend(library, old, new):
    index = library / "index.toml"
    assert old in index.read_text()
    index.write_text(index.read_text().replace(old, new))


def flown(scenario):
    return next(rl.simulate(scenario, threads=1))


CHANGES = {
    "materials": {"wanted": {"material": "mli_gold"}},
    "centre of mass": {"wanted": {"center_of_mass_m": (0.0, 0.0, 0.0)}},
    "taxonomy": {"wanted": {"taxonomy": {"object_class": "debris"}}},
    "hinge": {"old": "position_m = [0.5, 0.0, 0.0]", "new": "position_m = [0.0, 2.0, 0.0]"},
    "part": {"old": 'flap = "white_paint"', "new": ""},
}


@pytest.mark.parametrize("change", CHANGES)
def test_what_the_library_says_of_a_model_is_part_of_the_run_and_kept_by_its_recording(change, mission, craft, library):
    scenario = rl.Scenario.loads(mission)
    frame = flown(scenario)
    assert frame.valid.any()
    again = rl.Scenario.loads(frame.source.scenario)
    assert again.source.scenario == frame.source.scenario, "written out once and for all"
    if "wanted" in CHANGES[change]:
        craft(**CHANGES[change]["wanted"])
    else:
        mend(library, **CHANGES[change])
    named = [run_id(source, "", "1") for source in (frame.source, rl.Scenario.loads(mission).source)]
    assert named[0] != named[1], "a half-made recording is not gone on with"
    later = load_scenario(frame.source)
    assert later.source.scenario == frame.source.scenario and later.source.targets == frame.source.targets
    assert later.target[0].joints == scenario.target[0].joints
    same = flown(later)
    assert np.array_equal(same.range_m, frame.range_m, equal_nan=True)
    assert np.array_equal(same.labels.photons, frame.labels.photons)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"old": "scale = 0.1", "new": "scale = 0.05"}, r"\(scale 0\.1, now 0\.05\)"),
        ({"old": 'mesh_axes = "z_up"', "new": 'mesh_axes = "y_up"'}, r"\(mesh_axes z_up, now y_up\)"),
        ({"old": "left_out = []", "new": "left_out = [[3, 4]]"}, r"\(left_out nothing, now 3 to 4\)"),
        ({"times": 11.0}, r"\(sha256 [0-9a-f]{12}\.\.\., now [0-9a-f]{12}\.\.\.\)"),
    ],
)
def test_another_mesh_of_that_name_is_refused(change, says, mission, craft, library):
    source = rl.Scenario.loads(mission).source
    if "times" in change:
        craft(**change)
    else:
        mend(library, **change)
    with pytest.raises(
        MeshError, match=rf"^recording: target plate: model 'craft': has changed since the recording {says}; add"
    ):
        load_surfaces(load_scenario(source), source, 0, "view")
    assert run_id(rl.Scenario.loads(mission).source, "", "1") != run_id(source, "", "1")


def test_a_name_that_is_shipped_by_now_and_one_that_is_gone(mission, library, monkeypatch, tmp_path):
    source = rl.Scenario.loads(mission).source
    renamed = source.scenario.replace('model = "craft"', 'model = "plate"')
    with pytest.raises(MeshError, match=r"model 'plate': was one of the user's own library, and a shipped one"):
        _ = rl.Scenario.loads(renamed).surfaces
    monkeypatch.setenv("RSO_LIDAR_MODELS", str(tmp_path / "elsewhere"))
    with pytest.raises(ScenarioError, match=r"unknown model 'craft'.*add your own mesh with `rso-lidar models add`"):
        _ = rl.Scenario.loads(source.scenario).surfaces
    with pytest.raises(ScenarioError, match=r"library is for a model of your own library, by its name; leave it out"):
        rl.Scenario.loads(source.scenario.replace('model = "craft"', 'model = "craft.stl"'))


def test_a_run_that_was_cut_off_is_not_gone_on_with_as_another_model(mission, craft, tmp_path):
    output, names = tmp_path / "run.h5", []
    for wanted in ({}, {"material": "mli_gold"}):
        craft(**wanted)
        scenario = rl.Scenario.loads(mission)
        named = run_id(scenario.source, "", "1")
        with (
            pytest.raises(KeyboardInterrupt),
            rl.export.Recorder(output, scenario.source, run_id=named, resume=True) as recorder,
        ):
            names.append((recorder.temporary.name, recorder.written))
            recorder.write(flown(scenario))
            raise KeyboardInterrupt
    assert names[0][0] != names[1][0] and [written for _, written in names] == [0, 0]


def test_a_recording_of_a_mesh_by_path_is_of_that_file(text, tmp_path):
    path = tmp_path / "box.stl"
    path.write_bytes(binary_stl(BOX))
    mission = text.replace('model    = "plate"', f'model = "{path}"\ncenter_of_mass_m = [0, 0, 0]')
    source = rl.Scenario.loads(mission).source
    path.write_bytes(binary_stl(BOX * 2))
    with pytest.raises(RecordingError, match=r"is not the mesh that was recorded"):
        load_surfaces(load_scenario(source), source, 0, "view")


def test_what_was_dropped_of_a_mesh_is_told_once(text, tmp_path, library):
    path = tmp_path / "torn.stl"
    path.write_bytes(binary_stl(np.concatenate([BOX, np.zeros((1, 3, 3))])))
    mission = text.replace('model    = "plate"', f'model = "{path}"\ncenter_of_mass_m = [0, 0, 0]')
    says = r"^target plate: torn\.stl: 1 of 13 facets have no area and were dropped; `rso-lidar models check torn\.stl`"
    with pytest.warns(RsoLidarWarning, match=says) as caught:
        flown(rl.Scenario.loads(mission))
    assert len(caught) == 1
    assert rl.Scenario.loads(mission).surfaces, "no second warning, which would be an error here"
    add_model(path)
    flown(rl.Scenario.loads(text.replace('model    = "plate"', 'model = "torn"')))  # `add` told it

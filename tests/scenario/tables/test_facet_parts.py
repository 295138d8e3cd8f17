"""Parts that a scenario gives to the facets of a user's mesh: their classes, materials and hinges, and wrong uses."""

import pytest
import trimesh

import rso_lidar as rl

SCENE = """
version = 1
name = "own mesh"
seed = 1
[world]
axes = "local"
[time]
start_utc = 2024-09-17T12:00:00Z
duration_s = 1
frame_rate_hz = 1
[[target]]
name = "craft"
model = "box.stl"
center_of_mass_m = [0, 0, 0]
facet_parts = { file = "parts.csv" }
part_classes = { lid = "shield" }
part_materials = { lid = "mli_gold" }
joint = [{ name = "door", parts = ["lid"], axis = [0, 1, 0], angle = { type = "fixed", angle_deg = 30 } }]
motion = { type = "fixed", position_m = [50, 0, 0] }
[follower]
motion = { type = "fixed", position_m = [0, 0, 0] }
[lidar]
preset = "gsfl_1064"
"""


@pytest.fixture
def folder(tmp_path):
    trimesh.creation.box((1, 1, 1)).export(tmp_path / "box.stl")
    (tmp_path / "parts.csv").write_text("facet,part\n0-3,solar_array\n4-5,lid\n")
    return tmp_path


def test_parts_of_facets_have_classes_materials_and_hinges(folder):
    (folder / "scene.toml").write_text(SCENE)
    scenario = rl.Scenario.load(folder / "scene.toml")
    entry = scenario.source.targets[0]
    assert entry.parts == ("solar_array", "lid", "body")
    assert entry.part_classes == ("solar_array", "shield", "other")
    assert entry.materials[1] != entry.materials[0] == entry.materials[2]
    door = scenario.surfaces[1]
    assert door.name == "craft.door" and door.mesh.source_facet.tolist() == [4, 5]
    assert "# file parts.csv of craft: SHA-256" in scenario.source.scenario


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        ('{ file = "parts.csv" }', "{}", "give file, a table of facets, or by"),
        ('{ file = "parts.csv" }', '{ file = "parts.csv", by = "material" }', "one of the two"),
        ('{ file = "parts.csv" }', '{ by = "material" }', "names no materials"),
        ('"box.stl"', '"tdrs"', "facet_parts is for a mesh that model names by its path"),
        ("lid = ", "lit = ", "no part 'lit'"),
    ],
)
def test_a_wrong_use_is_one_line(folder, old, new, line):
    (folder / "scene.toml").write_text(SCENE.replace(old, new))
    with pytest.raises(rl.RsoLidarError, match=line) as caught:
        _ = rl.Scenario.load(folder / "scene.toml").surfaces
    assert "\n" not in str(caught.value)


def test_a_table_of_keypoints_is_for_a_mesh_by_its_path(folder):
    text = SCENE.replace('facet_parts = { file = "parts.csv" }', 'keypoint_file = "parts.csv"').replace(
        '"box.stl"', '"tdrs"'
    )
    with pytest.raises(rl.ScenarioError, match="keypoint_file is for a mesh that model names by its path"):
        rl.Scenario.loads(text)

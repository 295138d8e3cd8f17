"""Sizes of meshes in each unit, in words, and the targets that take one."""

import pytest

from rso_lidar.errors import MeshError, ScenarioError
from rso_lidar.scene import load_mesh
from rso_lidar.studio.model.mesh_sizes import list_mesh_sizes, list_mesh_targets, summarize_mesh
from rso_lidar.studio.model.root_folder import Folder
from tests.scene.meshes.test_mesh import BOX, binary_stl


@pytest.fixture
def folder(tmp_path):
    """Return a folder with one mesh, 1 to 3 m, in millimetres."""
    (tmp_path / "box.stl").write_bytes(binary_stl(BOX * 1000.0))
    return Folder(tmp_path)


def test_each_unit_has_the_sides_of_the_mesh_in_metres(folder):
    assert list_mesh_sizes("box.stl", folder) == [
        ("millimetres", "1 × 2 × 3 m (likely)", 0.001),
        ("metres", "1,000 × 2,000 × 3,000 m", 1.0),
        ("centimetres", "10 × 20 × 30 m", 0.01),
        ("inches", "25.4 × 50.8 × 76.2 m", 0.0254),
        ("feet", "304.8 × 609.6 × 914.4 m", 0.3048),
        ("kilometres", "1,000,000 × 2,000,000 × 3,000,000 m", 1000.0),
    ]


@pytest.mark.parametrize(
    ("factor", "said"),
    [
        (1000.0, "12 facets, 1 part, 1,000 × 2,000 × 3,000 m as it stands; 1 × 2 × 3 m if in millimetres"),
        (1.0, "12 facets, 1 part, 1 × 2 × 3 m as it stands"),
        (1e5, "12 facets, 1 part, 100,000 × 200,000 × 300,000 m as it stands"),  # no unit makes it a spacecraft
    ],
)
def test_a_mesh_is_said_with_its_size_and_the_likely_one(folder, factor, said):
    (folder.path / "b.stl").write_bytes(binary_stl(BOX * factor))
    assert summarize_mesh(load_mesh(folder.path / "b.stl")) == said


@pytest.mark.parametrize("name", ["tdrs", "", "no_such.stl", "../box.stl", "/etc/passwd", "words.stl"])
def test_what_is_no_mesh_of_the_folder_is_refused_in_one_line(folder, name):
    (folder.path / "words.stl").write_text("no mesh", encoding="utf-8")
    with pytest.raises((ScenarioError, MeshError)) as caught:
        list_mesh_sizes(name, folder)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("tables", "targets"),
    [
        (
            {"target": [{"name": "a", "model": "tdrs"}, {"name": "b", "model": "box.stl"}]},
            {"target[1]": "b", "target[0]": "a"},
        ),
        ({"target": [{"model": "tdrs"}, 3]}, {"target[0]": "target[0]"}),
        ({"target": 3}, {}),
        ({}, {}),
    ],
)
def test_targets_with_the_mesh_are_first(tables, targets):
    found = list_mesh_targets(tables, "box.stl")
    assert list(found.items()) == list(targets.items())

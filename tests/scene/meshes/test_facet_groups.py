"""Parts of facets: by a table and by the materials of a file, and one line for each mistake."""

import numpy as np
import pytest
import trimesh

import rso_lidar as rl
from rso_lidar.scene import MeshOptions, add_model, group_facets, load_mesh, remove_model
from rso_lidar.scene.meshes.facet_groups import format_facet_words

OBJ = """\
o craft
v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0 0\nv 2 1 0
usemtl foil gold
f 1 2 3 4
usemtl cells
f 2 5 6
usemtl foil gold
f 2 6 3
"""


def test_materials_of_an_obj_are_parts_triangle_by_triangle(tmp_path):
    path = tmp_path / "craft.obj"
    path.write_text(OBJ)
    mesh = load_mesh(path)
    assert mesh.part_names == ("craft",)
    grouped = group_facets(mesh)
    assert grouped.part_names == ("foil_gold", "cells")
    assert grouped.part.tolist() == [0, 0, 1, 0]  # the square becomes two triangles
    assert np.array_equal(grouped.facets, mesh.facets)


def test_materials_of_a_gltf_are_parts(tmp_path):
    boxes = {name: trimesh.creation.box((1, 1, 1)) for name in ("a", "b", "c")}
    for number, (name, box) in enumerate(boxes.items()):
        box.apply_translation((3 * number, 0, 0))
        material = trimesh.visual.material.PBRMaterial(name="cells" if name == "b" else "foil")
        box.visual = trimesh.visual.TextureVisuals(uv=np.zeros((len(box.vertices), 2)), material=material)
    trimesh.Scene(boxes).export(tmp_path / "three.glb")
    grouped = group_facets(load_mesh(tmp_path / "three.glb"))
    middle = grouped.vertices[grouped.facets].mean(axis=1)[:, 0]
    assert grouped.part_names == ("foil", "cells")
    assert np.array_equal(grouped.part == 1, np.abs(middle - 3) < 1.0)


def test_a_table_makes_parts_and_its_text_gives_the_same_again(tmp_path):
    trimesh.creation.box((1, 1, 1)).export(tmp_path / "box.stl")
    mesh = load_mesh(tmp_path / "box.stl")
    (tmp_path / "parts.csv").write_text("facet,part\n0-3,solar_array\n7,mast\n")
    grouped = group_facets(mesh, tmp_path / "parts.csv")
    assert grouped.part_names == ("solar_array", "body", "mast")
    assert grouped.part.tolist() == [0] * 4 + [1] * 3 + [2] + [1] * 4
    (tmp_path / "again.csv").write_text(format_facet_words(grouped))
    again = group_facets(mesh, tmp_path / "again.csv")
    assert [again.part_names[k] for k in again.part] == [grouped.part_names[k] for k in grouped.part]


def test_a_model_of_the_library_keeps_the_parts_of_its_table(tmp_path, monkeypatch):
    monkeypatch.setenv("RSO_LIDAR_MODELS", str(tmp_path / "library"))
    trimesh.creation.box((1, 1, 1)).export(tmp_path / "box.stl")
    (tmp_path / "parts.csv").write_text("0-3,solar_array\n7,mast\n")
    options = MeshOptions(facet_parts=tmp_path / "parts.csv", part_classes={"mast": "boom"})
    entry, _ = add_model(tmp_path / "box.stl", options)
    assert entry.part_classes == {"solar_array": "solar_array", "mast": "boom", "body": "other"}
    assert entry.mesh.part.tolist() == [0] * 4 + [1] * 3 + [2] + [1] * 4
    table = tmp_path / "library" / "box.parts.csv"
    table.write_text(table.read_text().replace("mast", "bus"))
    with pytest.raises(rl.MeshError, match="is not the table that was added"):
        _ = entry.mesh
    remove_model("box")
    assert not table.exists()


@pytest.mark.parametrize(
    ("name", "text", "line"),
    [
        ("parts.csv", "facet,part\n0-12,bus\n", "line 2: no facets 0-12 in a mesh of 12"),
        ("parts.csv", "3-1,bus\n", "line 1: no facets 3-1"),
        ("parts.csv", "1\n", "needs a facet, or a span such as 10-19, and a part"),
        ("parts.csv", "one,bus\n", "needs a facet"),
        ("parts.txt", "1,bus\n", "is not read; give a .csv"),
        ("parts.csv", None, "parts.csv"),
    ],
)
def test_a_table_that_does_not_fit_is_one_line(tmp_path, name, text, line):
    trimesh.creation.box((1, 1, 1)).export(tmp_path / "box.stl")
    if text is not None:
        (tmp_path / name).write_text(text)
    with pytest.raises(rl.RsoLidarError, match=line) as caught:
        group_facets(load_mesh(tmp_path / "box.stl"), tmp_path / name)
    assert "\n" not in str(caught.value)


def test_a_file_without_materials_is_one_line(tmp_path):
    trimesh.creation.box((1, 1, 1)).export(tmp_path / "box.stl")
    with pytest.raises(rl.MeshError, match="names no materials"):
        group_facets(load_mesh(tmp_path / "box.stl"))

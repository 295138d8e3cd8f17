"""Materials of single facets from a file: what is lit as what, and one line for each mistake."""

import numpy as np
import pytest
import trimesh

import rso_lidar as rl
from rso_lidar.scenario.tables.facet_materials import apply_color_materials, apply_facet_materials
from rso_lidar.scene import build_surface, load_mesh
from tests.optics.bench_for_tests import box, surface

SAT = surface("sat", box(1.0, 2.0, 3.0), rl.Lambertian(reflectance=0.5))
WHITE = {"1": rl.Lambertian(reflectance=0.9)}


def painted(tmp_path, name, content, materials=None):
    path = tmp_path / name
    if isinstance(content, str):
        path.write_text(content)
    else:
        np.save(path, content)
    said = rl.FacetMaterials(file=name, materials=materials or {})
    return apply_facet_materials(SAT, said, lambda file: tmp_path / file, 1064e-9)


def test_a_table_names_facets_and_spans(tmp_path):
    sat = painted(tmp_path, "labels.csv", "facet,material\n0,mine\n4-6,regolith_mare\n", {"mine": "regolith_highland"})
    expected = np.full(12, 0.5)
    expected[0], expected[4:7] = 0.35, 0.20
    assert sat.lambertian_per_sr * np.pi == pytest.approx(expected)
    assert np.array_equal(sat.part, SAT.part)  # labels stay


def test_a_table_from_a_spreadsheet_begins_with_a_mark(tmp_path):
    sat = painted(tmp_path, "labels.csv", "\ufefffacet,material\n3,regolith_mare\n")
    assert np.flatnonzero(sat.lambertian_per_sr * np.pi < 0.3).tolist() == [3]


def test_an_array_holds_a_number_for_each_facet(tmp_path):
    numbers = np.full(12, -1)
    numbers[[3, 11]] = 1
    sat = painted(tmp_path, "labels.npy", numbers, WHITE)
    assert np.flatnonzero(sat.lambertian_per_sr * np.pi > 0.8).tolist() == [3, 11]


def test_colours_of_a_file_tell_materials_apart(tmp_path):
    """A GLB of a red and a grey group, and a PLY with a colour for each facet, written by trimesh."""
    red, grey = (trimesh.creation.box((1, 1, 1)) for _ in range(2))
    grey.apply_translation((3, 0, 0))
    for piece, rgb in ((red, (255, 0, 0)), (grey, (128, 128, 128))):
        material = trimesh.visual.material.PBRMaterial(baseColorFactor=[*rgb, 255])
        piece.visual = trimesh.visual.TextureVisuals(uv=np.zeros((len(piece.vertices), 2)), material=material)
    trimesh.Scene({"a": red, "b": grey}).export(tmp_path / "two.glb")
    ball = trimesh.creation.box((1, 1, 1))
    ball.visual.face_colors = [[10, 20, 30, 255]] * 7 + [[255, 0, 0, 255]] * 5
    ball.export(tmp_path / "ball.ply")
    said = {"#FF0000": rl.Lambertian(reflectance=0.9)}
    for name, of_red in (("two.glb", range(12)), ("ball.ply", range(7, 12))):
        sat = build_surface("sat", load_mesh(tmp_path / name))
        lit = apply_color_materials(sat, said, 1064e-9).lambertian_per_sr * np.pi
        assert np.flatnonzero(lit > 0.8).tolist() == list(of_red)
    with pytest.raises(
        rl.ScenarioError, match=r"color_materials: no facet of ball.ply has the colour '#00ff00' \(there"
    ):
        apply_color_materials(sat, {"#00ff00": rl.Lambertian()}, 1064e-9)
    trimesh.creation.box((1, 1, 1)).export(tmp_path / "plain.stl")
    with pytest.raises(rl.MeshError, match=r"colours are read from .glb and .ply only"):
        apply_color_materials(build_surface("sat", load_mesh(tmp_path / "plain.stl")), said, 1064e-9)
    with pytest.raises(rl.ScenarioError, match=r"color_materials.*needs a colour such as '#a29225', not 'red'"):
        rl.Target(name="a", model="tdrs", motion=rl.Fixed(position_m=(0, 0, 0)), color_materials={"red": "osr"})


@pytest.mark.parametrize(
    ("name", "content", "told"),
    [
        ("a.csv", "0,gold\n", r"a.csv: no material 'gold'.* define it in facet_materials.materials"),
        ("a.csv", "12,osr\n", r"line 1: no facets 12 in a mesh of 12; number them from 0"),
        ("a.csv", "facet,material\n7-3,osr\n", r"line 2: no facets 7-3"),
        ("a.csv", "one,osr\n", r"line 1: needs a facet, or a span"),
        ("a.csv", "1\n", r"line 1: needs a facet, or a span"),
        ("a.csv", "1-,osr\n", r"line 1: needs a facet, or a span"),
        ("a.csv", "9" * 5000 + ",osr\n", r"line 1: needs a facet, or a span"),
        ("a.txt", "1,osr\n", r"'.txt' is not read"),
        ("a.npy", np.zeros(11, dtype=int), r"holds int64 \(11,\); give one integer for each of the 12 facets"),
        ("a.npy", np.zeros(12), r"holds float64"),
        ("b.npy", "no array", None),
    ],
)
def test_mistakes_are_one_line(tmp_path, name, content, told):
    with pytest.raises((rl.ScenarioError, rl.MeshError), match=told) as caught:
        painted(tmp_path, name, content)
    assert str(caught.value).startswith("facet_materials: ")
    assert "\n" not in str(caught.value)

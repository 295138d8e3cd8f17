"""The mesh doctor against meshes whose ills are known, and against figures that other tools found."""

import json

import numpy as np
import pytest

from rso_lidar.errors import MeshError, ScenarioError
from rso_lidar.scene import examine_file, examine_mesh, load_mesh, model
from rso_lidar.scene.meshes.components import find_helper_cube
from rso_lidar.scene.meshes.mesh import normalize_mesh
from tests.optics import bench_for_tests
from tests.scene.meshes.test_mesh import binary_stl


def box(*sides, at=(0.0, 0.0, 0.0)):
    """Return the triangles of a box about a point, wound outward."""
    triangles = bench_for_tests.box(*sides)
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    inward = np.einsum("fi,fi->f", normal, triangles.mean(axis=1) - triangles.mean(axis=(0, 1))) < 0
    triangles[inward] = triangles[inward][:, ::-1]
    return triangles + np.array(at)


@pytest.fixture
def examined(tmp_path):
    """Examine triangles as a file would hold them."""

    def look(triangles):
        path = tmp_path / "mesh.stl"
        path.write_bytes(binary_stl(np.asarray(triangles)))
        return examine_mesh(load_mesh(path))

    return look


def test_a_closed_box_is_sound(examined):
    found = examined(box(1.0, 2.0, 3.0))
    assert (found.components, found.boundary_edges, found.nonmanifold_edges, found.turned_edges) == (1, 0, 0, 0)
    assert (found.duplicates, found.hidden, found.strays, found.cube) == (0, 0, (), None)
    assert found.front_share == 1.0 and found.area_m2 == pytest.approx(22.0) and found.size_m == (1.0, 2.0, 3.0)
    assert any("watertight" in line for line in found.lines())


def test_a_facet_out_leaves_three_open_edges_and_shows_the_inside(examined):
    found = examined(box(1.0, 2.0, 3.0)[1:])
    assert found.boundary_edges == 3 and found.components == 1
    assert 0.5 < found.front_share < 1.0
    assert not any("watertight" in line for line in found.lines())


def test_a_facet_turned_has_three_turned_edges(examined):
    triangles = box(1.0, 2.0, 3.0)
    triangles[4] = triangles[4][::-1]
    found = examined(triangles)
    assert (found.turned_edges, found.boundary_edges) == (3, 0)
    assert found.front_share < 1.0


def test_a_box_inside_a_box_is_hidden(examined):
    found = examined(np.concatenate([box(2.0, 2.0, 2.0), box(1.0, 1.0, 1.0)]))
    assert (found.components, found.hidden) == (2, 12)
    assert found.hidden_area_share == pytest.approx(6.0 / 30.0)


def test_what_was_dropped_and_what_lies_twice(examined):
    triangles = box(1.0, 2.0, 3.0)
    found = examined(np.concatenate([triangles, triangles[:2], np.zeros((5, 3, 3))]))
    assert (found.facets, found.degenerate, found.duplicates) == (19, 5, 2)
    assert found.nonmanifold_edges == 5, "two facets of one side have five edges"
    text = "\n".join(found.lines())
    assert "5 without area dropped" in text and "2 facets on another" in text


def test_a_stray_is_told_with_its_place(examined):
    triangles = np.concatenate([box(1.0, 2.0, 3.0), box(0.1, 0.1, 0.1, at=(40.0, 0, 0))])
    found = examined(triangles)
    (stray,) = found.strays
    assert (stray.facets, stray.first_facet) == (12, 12)
    assert stray.center_m == pytest.approx((40.0, 0.0, 0.0), abs=1e-6)
    assert any(
        "12 facets from facet 12 on, 0.1 m across, about (40.00, 0.00, 0.00) m" in line for line in found.lines()
    )


def test_a_long_boom_is_no_stray(examined):
    boom = box(10.0, 0.05, 0.05, at=(5.6, 0, 0))
    assert examined(np.concatenate([box(1.0, 1.0, 1.0), boom])).strays == ()


@pytest.mark.parametrize(
    ("triangles", "side"),
    [
        (box(6.0, 6.0, 6.0), 6.0),
        (box(6.0, 6.0, 6.1), None),
        (box(6.0, 6.0, 6.0) + 1.0, None),
        (box(6.0, 6.0, 6.0)[1:], None),
    ],
)
def test_a_helper_cube_stands_about_the_origin(tmp_path, triangles, side):
    path = tmp_path / "cube.stl"
    path.write_bytes(binary_stl(np.concatenate([box(9.0, 8.0, 7.0) + 20, triangles])))
    cube = find_helper_cube(load_mesh(path))
    assert (cube is None) if side is None else (cube.size_m == side and cube.first_facet == 12)


def test_a_size_that_no_spacecraft_has_is_doubted(examined):
    assert any("perhaps millimetres (--scale 0.001)" in line for line in examined(box(1000.0, 2000.0, 3000.0)).lines())


def test_left_out_facets_are_told(tmp_path):
    path = tmp_path / "two.stl"
    path.write_bytes(binary_stl(np.concatenate([box(1.0, 2.0, 3.0), box(4.0, 4.0, 4.0) + 9])))
    found = examine_mesh(normalize_mesh(load_mesh(path), 1.0, left_out=((12, 23),)))
    assert (found.components, found.left_out, found.size_m) == (1, 12, (1.0, 2.0, 3.0))
    assert any("12 left out" in line for line in found.lines())


@pytest.mark.parametrize("name", ["tdrs", "plate", "sphere"])
def test_shipped_models_are_closed(name):
    found = examine_mesh(model(name).mesh)
    assert found.boundary_edges == 0 and found.strays == () and not found.degenerate
    assert found.front_share > 0.9999, "a ray along an edge may slip past it, once in 50,000"


@pytest.mark.parametrize("name", ["juno", "suomi_npp", "tdrs"])
def test_real_spacecraft_have_the_holes_that_their_manifest_says(name, shared):
    """Found with trimesh; edges of two copies of one facet are counted otherwise there, hence 2 of 1,886 for Juno."""
    entry = json.loads((shared / "meshes" / "manifest.json").read_text())["models"][name]
    found = examine_mesh(load_mesh(shared / "meshes" / entry["file"]))
    assert found.boundary_edges == pytest.approx(entry["boundary_edges"], abs=2)
    assert found.nonmanifold_edges == entry["nonmanifold_edges"]
    assert found.area_m2 == pytest.approx(entry["surface_area_m2"], abs=1e-3)
    assert found.front_share == pytest.approx(entry["front_facing_first_hits"], abs=2e-3)  # other rays
    assert (found.turned_edges == 0) == entry["winding_consistent"] or found.nonmanifold_edges


def test_a_file_is_examined_in_its_unit_and_a_model_by_its_name(tmp_path):
    path = tmp_path / "box.stl"
    path.write_bytes(binary_stl(box(1000.0, 2000.0, 3000.0)))
    found = examine_file(path, scale=1e-3)
    assert found.size_m == pytest.approx((1.0, 2.0, 3.0)) and found.area_m2 == pytest.approx(22.0)
    assert examine_file(path).size_m == pytest.approx((1000.0, 2000.0, 3000.0)) and not found.known
    assert examine_file("plate") == examine_mesh(model("plate").mesh)
    with pytest.raises(MeshError, match="0: is not a scale; give a number over 0"):
        examine_file(path, scale=0.0)
    with pytest.raises(ScenarioError, match="unknown model 'plat'; did you mean 'plate'"):
        examine_file("plat")


def test_a_mesh_beyond_all_numbers_is_one_line(tmp_path):
    path = tmp_path / "far.stl"
    path.write_bytes(binary_stl(box(1.0, 2.0, 3.0) * 1e30))
    with pytest.raises(MeshError, match=r"reaches beyond 1e\+07 m as scaled"):
        examine_mesh(load_mesh(path))

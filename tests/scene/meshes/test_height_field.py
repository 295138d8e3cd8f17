"""Height fields: files of heights as meshes, and heights over points."""

import numpy as np
import pytest

from rso_lidar.errors import MeshError
from rso_lidar.scene import MOST_HEIGHT_CELLS, build_height_field, build_surface, find_top_heights, load_height_field

HEIGHTS = np.array([[0.0, 1.0, 2.0], [3.0, 4.0, 5.0]])  # two rows from north to south, three columns from west to east


def test_rows_run_south_and_columns_east(tmp_path):
    np.save(tmp_path / "dem.npy", HEIGHTS)
    mesh = load_height_field(tmp_path / "dem.npy", 10.0, 2.0)
    corners = {tuple(vertex) for vertex in mesh.vertices.tolist()}
    assert {(-10.0, 5.0, 0.0), (10.0, 5.0, 4.0), (-10.0, -5.0, 6.0), (10.0, -5.0, 10.0)} <= corners
    assert len(mesh.facets) == 4
    a, b, c = (mesh.vertices[mesh.facets[:, k]] for k in range(3))
    assert np.all(np.cross(b - a, c - a)[:, 2] > 0.0)  # they face up
    assert mesh.part_names == ("ground",)


@pytest.mark.parametrize("suffix", ["npy", "npz", "png"])
def test_formats_agree(tmp_path, suffix):
    from PIL import Image

    path = tmp_path / f"dem.{suffix}"
    values = np.array([[0, 300], [70, 65535]], dtype=np.uint16)
    {
        "npy": lambda: np.save(path, values),
        "npz": lambda: np.savez_compressed(path, heights=values),
        "png": lambda: Image.fromarray(values).save(path),
    }[suffix]()
    mesh = load_height_field(path, 1.0, 0.01)
    assert sorted(mesh.vertices[:, 2]) == pytest.approx([0.0, 0.7, 3.0, 655.35], abs=1e-9)


def test_no_ground_where_there_is_no_height(tmp_path):
    heights = np.zeros((4, 4))
    heights[0, 0] = np.nan
    np.save(tmp_path / "dem.npy", heights)
    mesh = load_height_field(tmp_path / "dem.npy", 1.0, 1.0)
    assert len(mesh.facets) == 2 * 8
    assert np.isfinite(mesh.vertices).all()


def _text(path):
    path.write_text("not an array")


def _bomb(path):
    np.savez_compressed(path, heights=np.zeros((20, MOST_HEIGHT_CELLS), np.int8))


def _claims(path):
    """Write a header of more cells than there is room for, and nothing behind it."""
    np.lib.format.write_array_header_1_0(
        file := path.open("wb"), {"descr": "<f8", "fortran_order": False, "shape": (10**6, 10**6)}
    )
    file.close()


BAD = {
    "missing.npy": (lambda path: None, "no such file"),
    "dem.tif": (lambda path: path.write_bytes(b"II"), "not read; convert"),
    "text.npy": (_text, "write it with numpy.save"),
    "text.npz": (_text, "write it with numpy.save"),
    "text.png": (_text, "export it again"),
    "empty.npy": (lambda path: path.write_bytes(b""), "write it with numpy.save"),
    "claims.npy": (_claims, "give a smaller array"),
    "pickled.npy": (lambda path: np.save(path, np.array([{}]), allow_pickle=True), "not numbers or text"),
    "line.npy": (lambda path: np.save(path, np.arange(4.0)), "rows and columns"),
    "words.npy": (lambda path: np.save(path, np.full((2, 2), "high")), "not numbers"),
    "infinite.npy": (lambda path: np.save(path, np.full((2, 2), np.inf)), "not finite"),
    "nothing.npy": (lambda path: np.save(path, np.full((2, 2), np.nan)), "no cell has a height"),
    "two.npz": (lambda path: np.savez(path, a=HEIGHTS, b=HEIGHTS), "contains 2 arrays"),
    "bomb.npz": (_bomb, "give a smaller array"),
    "wide.npy": (lambda path: np.save(path, np.zeros((2, MOST_HEIGHT_CELLS), np.int8)), "crop or thin it"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_file_is_one_line(tmp_path, name):
    write, told = BAD[name]
    write(tmp_path / name)
    with pytest.raises(MeshError, match=told) as error:
        load_height_field(tmp_path / name, 1.0, 1.0)
    assert "\n" not in str(error.value)
    assert name in str(error.value)


def test_colour_is_no_height(tmp_path):
    from PIL import Image

    Image.new("RGB", (4, 4)).save(tmp_path / "colour.png")
    with pytest.raises(MeshError, match="save heights as grey"):
        load_height_field(tmp_path / "colour.png", 1.0, 1.0)


def test_a_file_written_anew_is_read_anew(tmp_path):
    import os

    path = tmp_path / "dem.npy"
    for k in range(2):
        np.save(path, HEIGHTS + k)
        os.utime(path, ns=(k, k))
        assert load_height_field(path, 1.0, 1.0).vertices[0, 2] == k


def test_heights_over_points(tmp_path):
    x = np.linspace(-50.0, 50.0, 101)
    plane = 0.1 * x[None, :] - 0.2 * x[:, None]  # rises to the east and to the north
    block = np.array([[-1.0, -1.0, 30.0], [1.0, -1.0, 30.0], [0.0, 2.0, 30.0]]), np.array([[0, 1, 2]])
    mesh = build_height_field(plane[::-1][::-1], 1.0, tmp_path / "plane", "", block)
    surface = build_surface("site", mesh)
    found = find_top_heights(surface, [0.0, 10.3, -20.7, 80.0], [0.0, 40.2, -3.3, 0.0])
    expected = [30.0, 0.1 * 10.3 + 0.2 * 40.2, -0.1 * 20.7 - 0.2 * 3.3]
    assert found[:3] == pytest.approx(expected, abs=1e-4)  # float32 of some 100 m
    assert np.isnan(found[3])
    assert mesh.part_names == ("ground", "boulders")

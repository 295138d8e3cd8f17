import numpy as np
import pytest

from rso_lidar.errors import MeshError
from tests.scene.meshes.test_mesh import BOX, ascii_stl, binary_stl, load  # noqa: F401, a fixture


def test_bytes_behind_the_last_facet_are_ignored_and_whole_facets_are_not(load):  # noqa: F811
    assert np.array_equal(load("a.stl", binary_stl(BOX) + b"\0\0").vertices.reshape(-1, 3, 3), BOX)
    more = binary_stl(BOX)
    with pytest.raises(MeshError, match="its header promises 11 facets, but there is room for 12; export it again"):
        load("b.stl", more[:80] + b"\x0b\0\0\0" + more[84:])


def test_solids_of_an_ascii_file_are_parts_and_those_of_one_name_are_one(load):  # noqa: F811
    names = ["bus", "solar wing", "bus"]
    solids = [ascii_stl(BOX[4 * k : 4 * k + 4]).replace(b" box", b" " + name.encode()) for k, name in enumerate(names)]
    mesh = load("a.stl", b"".join(solids))
    assert mesh.part_names == ("bus", "solar_wing")
    assert mesh.part.tolist() == [0] * 4 + [1] * 4 + [0] * 4
    assert np.array_equal(mesh.vertices[mesh.facets], BOX)


def test_a_facet_of_four_corners_is_a_polygon_of_its_own(load):  # noqa: F811
    """A dart, whose diagonal must be the short one, then a triangle."""
    dart, corner = [(0, 1), (1, 2), (0, 0), (-1, 2)], [(5, 0), (6, 0), (5, 1)]
    dart = dart[1:] + dart[:1]
    lines = ["solid a"]
    for facet in (dart, corner):
        lines += ["facet normal 0 0 1", "outer loop", *(f"vertex {x} {y} 0" for x, y in facet), "endloop endfacet"]
    mesh = load("a.stl", "\r\n".join([*lines, "endsolid"]).encode())
    corners = mesh.vertices[mesh.facets]
    areas = 0.5 * np.abs(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2])
    assert areas.tolist() == [0.5, 0.5, 0.5]
    assert corners[2, :, :2].tolist() == [list(point) for point in corner]


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (b"endloop", b""),
        (b"outer loop", b""),
        (b"endsolid box", b"endsolid box\nvertex 1 2 3"),
        (b"solid box", b"solid box\nsolid box"),
    ],
)
def test_words_out_of_order_are_one_line_with_their_place(load, old, new):  # noqa: F811
    with pytest.raises(MeshError, match=r"line \d+ \(.+\): cannot be read as STL"):
        load("a.stl", ascii_stl(BOX).replace(old, new, 1))


def test_an_ascii_file_may_begin_with_a_byte_order_mark(load):  # noqa: F811
    assert np.array_equal(load("a.stl", b"\xef\xbb\xbf" + ascii_stl(BOX)).vertices.reshape(-1, 3, 3), BOX)
    with pytest.raises(MeshError, match="is UTF-16 text or no text; save it as UTF-8"):
        load("b.stl", ascii_stl(BOX).decode().encode("utf-16"))


def test_a_normal_that_is_no_number_does_not_bear_on_the_corners(load):  # noqa: F811
    """Compilers write the normal of a facet without area as -nan(ind) or -1.#IND."""
    lines = ["solid a", "facet normal -nan(ind) -1.#IND 1.#QNAN", "outer loop", "vertex 0 0 7", "vertex 2 0 7"]
    text = "\n".join([*lines, "vertex 0 3 7", "endloop", "endfacet", "endsolid a"])
    assert load("a.stl", text.encode()).vertices.tolist() == [[0, 0, 7], [2, 0, 7], [0, 3, 7]]


def test_an_ascii_file_with_a_zero_byte_is_refused_as_text(load):  # noqa: F811
    """Not as a binary file that promises a billion facets, however its lines and capitals are."""
    named = ascii_stl(BOX).replace(b"solid box\n", b"SOLID box\0\n", 1).replace(b"facet normal", b"FACET  NORMAL")
    with pytest.raises(MeshError, match="is UTF-16 text or no text"):
        load("a.stl", named)

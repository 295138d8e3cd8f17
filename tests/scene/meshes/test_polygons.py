import numpy as np
import pytest

from rso_lidar.errors import MeshError
from rso_lidar.scene.meshes.polygons import cut_polygons
from tests.scene.meshes.test_mesh import load  # noqa: F401, a fixture

BRACKET = [(0, 0), (4, 0), (4, 3), (3, 3), (3, 1), (1, 1), (1, 3), (0, 3)]  # a U: 4 x 1 below two arms of 1 x 2
TILTED = np.array([[2.0, 1.0, 2.0], [-2.0, 2.0, 1.0], [-1.0, -2.0, 2.0]]) / 3.0  # a rotation
# A plate of 8 x 4 with two holes of 2 x 2, each joined to the rim by an edge there and back, as polygons have holes.
KEYHOLES = [
    (0, 0), (8, 0), (7, 1), (5, 1), (5, 3), (7, 3), (7, 1), (8, 0),
    (8, 4), (0, 4), (0, 0), (1, 1), (1, 3), (3, 3), (3, 1), (1, 1),
]  # fmt: skip


def cut(outline):
    """Cut one polygon (corner, xy), tilted, away from the origin; return corners and area of the triangles."""
    points = np.array([(x, y, 0.0) for x, y in outline]) @ TILTED.T + [5.0, -3.0, 2.0]
    facets = cut_polygons("a.obj", points, np.arange(len(points)), np.array([len(points)]))
    triangles = points[facets]
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    return triangles, 0.5 * np.linalg.norm(normals, axis=1), normals @ TILTED[:, 2]


@pytest.mark.parametrize(
    ("outline", "area"),
    [
        (BRACKET, 8.0),
        (KEYHOLES, 24.0),
        ([(0, 0), (3, 1), (0, 2), (1, 1)], 2.0),  # a dart
        ([(0, -1), *BRACKET[1:]], 10.0),
        ([(0, 0), (0, 0), (4, 0), (4, 0), (4, 4), (1, 1), (1, 1), (0, 4)], 10.0),  # corners given twice
    ],
    ids=["bracket", "holes", "dart", "uneven", "doubled corners"],
)
def test_triangles_of_a_concave_polygon_cover_it_once_whatever_its_first_corner_and_sense(outline, area):
    for turn in range(len(outline)):
        for sense in (1, -1):
            corners = (outline[turn:] + outline[:turn])[::sense]
            triangles, areas, along = cut(corners)
            assert len(triangles) == len(outline) - 2
            assert areas.sum() == pytest.approx(area, rel=1e-12)
            assert (sense * along > -1e-9).all(), "all triangles wind as the polygon does"


def test_every_corner_of_a_star_is_used_and_its_area_is_the_shoelace_formula_s():
    rng = np.random.default_rng(20240917)
    angles = 2 * np.pi * (np.arange(31) + rng.uniform(0.1, 0.9, 31)) / 31
    radii = rng.uniform(0.2, 3.0, 31)
    outline = np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=1)
    x, y = outline.T
    triangles, areas, _ = cut(outline.tolist())
    assert areas.sum() == pytest.approx(0.5 * (x @ np.roll(y, -1) - y @ np.roll(x, -1)), rel=1e-12)
    assert len(np.unique(triangles.reshape(-1, 3).round(9), axis=0)) == 31


def test_a_convex_polygon_is_a_fan_and_polygons_keep_their_order():
    points = np.array([(0, 0, 0), (2, 0, 0), (2, 1, 0), (1, 2, 0), (0, 1, 0)], dtype=float)
    corners, sizes = np.array([0, 1, 2, 0, 1, 2, 3, 4, 2, 3, 4, 0]), np.array([3, 5, 1, 0, 3])
    facets = cut_polygons("a.obj", points, corners, sizes)
    assert facets.tolist() == [[0, 1, 2], [0, 1, 2], [0, 2, 3], [0, 3, 4], [3, 4, 0]]


@pytest.mark.parametrize(
    "corners",
    [
        [(0, 0, 0), (1, 1, 0), (1, 0, 0), (0, 1, 0)],
        [(1, 2, 3)] * 6,
        [(0, 0, 0), (1, 0, 0), (2, 0, 0), (3, 0, 0), (1, 0, 0)],
        [(0, 0, 0), (1, 0, 1), (1, 1, -3), (0, 1, 2), (0.5, 0.5, 9), (0.2, 0.1, 0)],
        [(np.nan, 0, 0), (1, 0, 0), (1, 1, 0), (0.2, 0.1, 0), (0, 1, 0)],
        [(1e308, 0, 0), (-1e308, 0, 0), (1, 1e308, 0), (0.2, 0.1, 0), (0, 1, 0)],
        [(np.cos(0.8 * np.pi * k), np.sin(0.8 * np.pi * k), 0) for k in range(5)],
    ],
    ids=["bow tie", "one point", "line", "not plane", "not a number", "huge", "pentagram"],
)
def test_a_polygon_without_a_right_answer_gives_as_many_triangles(corners):
    facets = cut_polygons("a.obj", np.array(corners, dtype=float), np.arange(len(corners)), np.array([len(corners)]))
    assert facets.shape == (len(corners) - 2, 3)


def test_a_concave_polygon_of_too_many_corners_is_refused_in_one_line():
    count = 30_000
    teeth = np.stack([np.arange(count), np.arange(count) % 2, np.zeros(count)], axis=1)
    teeth[-1] = (0.5 * count, -10.0, 0.0)
    with pytest.raises(MeshError, match=r"a.off: has 1 concave polygons of up to 30,000 corners, too many to cut"):
        cut_polygons("a.off", teeth, np.arange(count), np.array([count]))


PLY = "ply\nformat ascii 1.0\nelement vertex 9\nproperty float x\nproperty float y\nproperty float z\nelement face 2\n"
POINTS = [*BRACKET, (9, 9)]
TEXTS = {
    "a.obj": "".join(f"v {x} {y} 0\n" for x, y in POINTS) + "f 1 2 3 4 5 6 7 8\nf 3 9 8\n",
    "a.off": "OFF\n9 2 0\n" + "".join(f"{x} {y} 0\n" for x, y in POINTS) + "8 0 1 2 3 4 5 6 7\n3 2 8 7\n",
    "a.ply": PLY
    + "property list uchar int vertex_indices\nend_header\n"
    + "".join(f"{x} {y} 0\n" for x, y in POINTS)
    + "8 0 1 2 3 4 5 6 7\n3 2 8 7\n",
}


@pytest.mark.parametrize("name", TEXTS)
@pytest.mark.parametrize("mark", [b"", b"\xef\xbb\xbf"], ids=["plain", "with a byte order mark"])
def test_every_format_with_polygons_leaves_a_notch_empty_and_numbers_facets_in_its_order(load, name, mark):  # noqa: F811
    mesh = load(name, mark + TEXTS[name].encode())
    corners = mesh.vertices[mesh.facets]
    areas = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    assert mesh.source_facet.tolist() == [0, 1, 2, 3, 4, 5, 6]
    assert areas[:6].sum() == pytest.approx(8.0, rel=1e-12)
    assert corners[6].tolist() == [[4, 3, 0], [9, 9, 0], [0, 3, 0]]


@pytest.mark.parametrize("name", TEXTS)
def test_text_in_two_bytes_for_each_letter_is_refused_as_such(load, name):  # noqa: F811
    for encoding in ("utf-16", "utf-16-le"):
        with pytest.raises(MeshError, match="is UTF-16 text or no text; save it as UTF-8"):
            load(name, TEXTS[name].encode(encoding))

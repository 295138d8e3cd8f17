import struct

import numpy as np
import pytest

from rso_lidar.errors import MeshError
from rso_lidar.scene import read_facet_colours
from tests.scene.meshes.test_mesh import load  # noqa: F401, a fixture
from tests.scene.meshes.test_polygons import BRACKET

ORDERS = {"<": "binary_little_endian", ">": "binary_big_endian"}


def binary(order, faces):
    """Return a PLY of a normal list before and a flag after the corners of each face, and the U of 8 m2 with a triangle."""
    head = f"ply\nformat {ORDERS[order]} 1.0\ncomment a U\nelement vertex 9\nproperty double x\nproperty float y\n"
    head += "property uchar red\nproperty uchar green\nproperty uchar blue\nproperty short z\n"
    head += f"element face {len(faces)}\nproperty list ushort float st\nproperty list uchar uint vertex_index\n"
    head += "property char flag\nelement edge 1\nproperty list int int many\nend_header\n"
    body = b"".join(struct.pack(f"{order}dfBBBh", x, y, 10 * x, 7, y, -2) for x, y in [*BRACKET, (9, 9)])
    for face in faces:
        body += struct.pack(f"{order}HffB{len(face)}Ib", 2, 0.5, 0.5, len(face), *face, -1)
    return head.encode() + body


@pytest.mark.parametrize("order", ORDERS)
def test_faces_of_several_lengths_are_read_in_either_order_of_bytes_with_lists_beside_them(load, order):  # noqa: F811
    mesh = load("a.ply", binary(order, [range(8), (2, 8, 7), (0, 1), (0, 1, 2)]))
    corners = mesh.vertices[mesh.facets]
    areas = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    assert areas[:6].sum() == pytest.approx(8.0, rel=1e-12) and len(areas) == 8
    assert corners[6].tolist() == [[4, 3, -2], [9, 9, -2], [0, 3, -2]]
    colours = read_facet_colours(mesh)
    assert colours[6] == f"#{(40 + 90 + 0) // 3:02x}{7:02x}{(3 + 9 + 3) // 3:02x}"


def test_triangles_alone_are_read_at_once_to_the_same_result(load):  # noqa: F811
    mesh = load("a.ply", binary("<", [(0, 1, 2), (2, 8, 7)]))
    assert mesh.vertices[mesh.facets][1].tolist() == [[4, 3, -2], [9, 9, -2], [0, 3, -2]]


def test_strips_are_refused_by_name_and_points_alone_have_no_triangles(load):  # noqa: F811
    head = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n"
    strips = "element tristrips 1\nproperty list int int vertex_indices\n"
    with pytest.raises(MeshError, match="has its triangles in 'tristrips', which are not read"):
        load("a.ply", (head + strips + "end_header\n0 0 0\n3 0 0 0\n").encode())
    with pytest.raises(MeshError, match="contains no triangles"):
        load("b.ply", (head + "end_header\n0 0 0\n").encode())


def test_a_property_that_is_stated_twice_is_refused_by_name(load):  # noqa: F811
    whole = binary("<", [(0, 1, 2)])
    with pytest.raises(MeshError, match="its header states 'x' twice; export it again"):
        load("a.ply", whole.replace(b"property float y\n", b"property float y\nproperty int x\n"))

import pytest

from rso_lidar.errors import MeshError
from tests.scene.meshes.test_mesh import load  # noqa: F401, a fixture


@pytest.mark.parametrize(
    "text",
    [
        "OFF 3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
        "3 1\n0 0 0\n1 0 0\n\n0 1 0 # last\n3 0 1 2 255 0 0\n",
        "# a plate\nCOFF\n3 2 0\n0 0 0 9 9 9 9\n1 0 0 9 9 9 9\n0 1 0 9 9 9 9\n2 0 1\n3 0 1 2\n",
    ],
    ids=["counts beside the keyword", "no keyword, colour of a face", "colours of vertices, an edge"],
)
def test_what_an_off_may_say_beside_facets(load, text):  # noqa: F811
    mesh = load("a.off", text.encode())
    assert mesh.vertices[mesh.facets].tolist() == [[[0, 0, 0], [1, 0, 0], [0, 1, 0]]]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("OFF BINARY\n", "is binary or not in three dimensions"),
        ("4OFF\n1 0 0\n", "is binary or not in three dimensions"),
        ("OFF\n3 2 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", "has 1 of the 2 facets that its header states"),
        ("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n", "a facet names a vertex that is not in the file"),
        ("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n4 0 1 2\n", r"line 6 \(4 0 1 2\): cannot be read as OFF"),
        ("OFF\n", "ends after its first line"),
    ],
)
def test_another_file_is_one_line(load, text, says):  # noqa: F811
    with pytest.raises(MeshError, match=says):
        load("a.off", text.encode())

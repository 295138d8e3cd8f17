import pytest

from rso_lidar.errors import MeshError
from tests.scene.meshes.test_mesh import load  # noqa: F401, a fixture


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("surf 0 1 0 1 1 2 3 4", r"line 4: has a curved surface \('surf'\), which is not read"),
        ("call other.obj", "line 4: calls another file, which is not read"),
    ],
)
def test_what_would_be_missing_is_refused_by_name(load, line, says):  # noqa: F811
    with pytest.raises(MeshError, match=says):
        load("a.obj", f"v 0 0 0\nv 1 0 0\nv 0 1 0\n{line}\nf 1 2 3\n".encode())


def test_a_backslash_continues_a_polygon_but_not_a_comment_or_a_path(load):  # noqa: F811
    """A lost first vertex would shift the others, in silence where no polygon names the last one."""
    text = "# C:\\out\\\nv 0 0 0\nmtllib C:\\out\\\nv 3 0 0\nv 0 5 0\nf 1 2 \\ \t\n 3\n"
    assert load("a.obj", text.encode()).vertices.tolist() == [[0, 0, 0], [3, 0, 0], [0, 5, 0]]


def test_a_number_sign_inside_a_name_belongs_to_it_and_a_comment_does_not(load):  # noqa: F811
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\no panel#1 # left\nf 1 2 3\no panel#2 #right\nf 1 2 3\ng #none\nf 1 2 3#last\n"
    assert load("a.obj", text.encode()).part_names == ("panel#1", "panel#2", "body")

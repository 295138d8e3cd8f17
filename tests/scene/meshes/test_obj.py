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

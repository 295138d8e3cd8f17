"""Units of meshes: the guessed one is first, with the metres that `check` advises."""

import numpy as np
import pytest

from rso_lidar.errors import MeshError
from rso_lidar.scene import list_units, load_mesh
from rso_lidar.scene.library.mesh_units import MeshUnit, known_meshes
from tests.scene.meshes.test_mesh import BOX, binary_stl, glb


@pytest.fixture
def load(tmp_path):
    """Load a mesh from the bytes of a file."""

    def write(content, name="box.stl"):
        (tmp_path / name).write_bytes(content)
        return load_mesh(tmp_path / name)

    return write


@pytest.mark.parametrize(
    ("factor", "likely"),
    [
        (1.0, ("metres", 1.0)),
        (1000.0, ("millimetres", 0.001)),  # 3 m across
        (1e-3, ("kilometres", 1000.0)),  # 3 mm, if in metres
    ],
)
def test_the_likely_unit_is_first(load, factor, likely):
    units = list_units(load(binary_stl(BOX * factor)))
    assert sorted(unit.metres for unit in units) == [0.001, 0.01, 0.0254, 0.3048, 1.0, 1000.0]
    assert units[0] == MeshUnit(*likely, True)
    assert [unit.is_likely for unit in units[1:]] == [False] * 5


def test_no_unit_is_likely_where_none_makes_a_spacecraft(load):
    units = list_units(load(binary_stl(BOX * 100_000.0)))  # 300 m, if in millimetres
    assert [(unit.metres, unit.is_likely) for unit in units] == [
        (metres, False) for metres in (1.0, 0.001, 0.01, 0.0254, 0.3048, 1000.0)
    ]


def test_gltf_is_in_metres_by_its_standard(load):
    box = load(glb([("box", BOX * 80.0)], [{"mesh": 0}]), "box.glb")
    assert box.size_m == pytest.approx([80.0, 160.0, 240.0])
    assert list_units(box)[0] == MeshUnit("metres", 1.0, True)


def test_a_helper_cube_is_a_unit_of_its_own(load):
    cube = (BOX / [1, 2, 3] - BOX.reshape(-1, 3).mean(axis=0) / [1, 2, 3]) * 8.0
    units = list_units(load(binary_stl(np.concatenate([cube, BOX * 30 + 20]))))
    assert units[-1] == MeshUnit("helper cube of 1 m, which is 8 units", 0.125, False)


def test_what_is_known_of_meshes_cannot_be_changed_and_is_read_like_all_else(tmp_path, monkeypatch):
    one = next(iter(known_meshes().values()))
    for table in (known_meshes(), one):
        with pytest.raises(TypeError):
            table["name"] = "other"
    monkeypatch.setattr("rso_lidar.scene.library.mesh_units.shipped", lambda name: tmp_path)
    known_meshes.cache_clear()
    with pytest.raises(MeshError, match=r"known_meshes\.toml: cannot be read \(no such file\); install"):
        known_meshes()

import numpy as np
import pytest

from rso_lidar.errors import ScenarioError
from rso_lidar.scene import Lambertian, Phong
from tests.optics.bench_for_tests import box, plate, sphere, surface

BOX = box(1.0, 2.0, 3.0)


def test_scale_comes_first_then_the_centre_of_mass():
    moved = surface("sat", BOX + np.array([10, 0, 0]), scale=0.5, center_of_mass_m=(5.0, 0.0, 1.0))
    assert np.allclose(moved.corners, 0.5 * BOX - [0, 0, 1], rtol=0, atol=1e-12)


def test_y_up_turns_the_file_s_y_to_body_z_without_a_mirror():
    """A quarter turn about x: x stays, y goes up, and z goes to -y, so that volumes keep their sign."""
    turned = surface("sat", BOX, mesh_axes="y_up", center_of_mass_m=(0.1, 0.2, 0.3)).corners
    x, y, z = np.moveaxis(BOX - [0.1, 0.2, 0.3], -1, 0)
    assert np.allclose(turned, np.stack([x, -z, y], axis=-1), rtol=0, atol=1e-12)
    volume = lambda t: np.sum(np.linalg.det(t)) / 6  # noqa: E731
    ball = sphere(1.0, 2)
    assert volume(surface("ball", ball, mesh_axes="y_up").corners) == pytest.approx(volume(ball), rel=1e-12)


def test_planes_are_unit_normals_and_hold_their_corners():
    rng = np.random.default_rng(5)
    triangles = rng.normal(size=(50, 3, 3)) * 10
    planes = surface("sat", triangles).planes
    assert np.allclose(np.linalg.norm(planes[:3], axis=0), 1, rtol=0, atol=1e-14)
    height = np.einsum("if,fci->fc", planes[:3], triangles) - planes[3][:, None]
    assert np.abs(height).max() < 1e-13 * 100


def test_sphere_and_outline_hold_every_corner():
    rng = np.random.default_rng(6)
    for triangles in (
        plate(3, 1),
        sphere(2.0, 3) * [1, 3, 0.2] + [5, 0, 0],
        rng.normal(size=(40, 3, 3)),
        plate(2, n=9),
    ):
        seen = surface("sat", triangles)
        centre, radius = seen.sphere
        assert np.linalg.norm(triangles - centre, axis=-1).max() <= radius * (1 + 1e-12)
        assert seen.radius_m == pytest.approx(np.linalg.norm(triangles, axis=-1).max(), rel=1e-12)
        for direction in rng.normal(size=(30, 3)):
            assert (seen.outline @ direction).max() >= (triangles @ direction).max() - 1e-12


def test_materials_go_by_part():
    gold, white = Phong(diffuse=0.1, specular=0.5, exponent=30.0), Lambertian(reflectance=0.8)
    part = np.array([0, 0, 1, 1, 2, 2, 0, 0, 1, 1, 2, 2], dtype=np.int16)
    sat = surface("sat", BOX, white, part=part, part_names=("bus", "wing", "dish"), part_materials={"wing": gold})
    assert sat.materials == (white, gold, white)
    cosine = np.linspace(0.1, 1.0, 12)
    brdf = sat.brdf_per_sr(np.arange(12), cosine)
    expected = [(gold if part[i] == 1 else white).brdf_per_sr(cosine[i : i + 1])[0] for i in range(12)]
    assert brdf == pytest.approx(expected, rel=1e-14)


def test_without_a_material_it_is_the_seed_s():
    assert surface("sat", BOX).materials == (Lambertian(reflectance=0.30),)


def test_a_part_that_is_not_there():
    with pytest.raises(ScenarioError, match=r"part_materials: no part 'bdy' in sat\.stl; did you mean 'body'"):
        surface("sat", BOX, part_materials={"bdy": Lambertian()})


def test_same_geometry_shares_its_acceleration_structure_and_other_does_not():
    one, same, other = surface("a", BOX), surface("b", BOX), surface("c", BOX * 1.001)
    assert one.embree is same.embree
    assert one.embree is not other.embree

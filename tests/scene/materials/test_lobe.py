"""Directions drawn from lobes: against NumPy, and their density against how often they are drawn."""

import numpy as np
import pytest

from rso_lidar.errors import ScenarioError
from rso_lidar.kernels import packed
from rso_lidar.scene import Crinkled, Ggx, Lambertian, Lobe, Phong, complete
from rso_lidar.scene.materials.lobe import check_lobe, direction_density, draw_directions
from tests.reference.scene import lobe as reference

LOBES = [Lobe(0.0), Lobe(0.6, 30.0), Lobe(1.0, 2000.0), Lobe(0.6, roughness=0.3), Lobe(1.0, roughness=0.02)]


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=0)


def cases(n=2000):
    """Return numbers, lobes, base, normal and viewer of some paths."""
    rng = np.random.default_rng(7)
    base = unit(rng.normal(size=(3, n)))
    normal = unit(base + 0.1 * rng.normal(size=(3, n)))
    viewer = unit(normal + 0.9 * unit(rng.normal(size=(3, n))))
    lobes = np.array(LOBES)[rng.integers(0, len(LOBES), n)]
    return rng.random((3, n)), packed(lobes), packed(base), packed(normal), packed(viewer)


def test_directions_are_those_of_numpy():
    uniform, *about = cases()
    drawn = draw_directions(uniform, *about)
    np.testing.assert_allclose(drawn, reference.draw_directions(uniform, *about), atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(drawn, axis=0), 1.0, atol=1e-12)
    np.testing.assert_allclose(
        direction_density(drawn, *about), reference.direction_density(drawn, *about), rtol=1e-6, atol=1e-12
    )


@pytest.mark.parametrize("lobe", LOBES, ids=str)
def test_density_is_how_often_a_direction_is_drawn(lobe):
    """The mean of 1 / density over the directions drawn inside a cap is the solid angle of the cap."""
    n = 200_000
    uniform = np.random.default_rng(3).random((3, n))
    around = [np.repeat(np.array([[x], [0.0], [z]]), n, axis=1) for x, z in ((0.0, 1.0), (0.0, 1.0), (0.6, 0.8))]
    about = packed(np.repeat([lobe], n, axis=0)), *(packed(one) for one in around)
    drawn = draw_directions(uniform, *about)
    density = direction_density(drawn, *about)
    assert np.mean(density > 0.0) > 0.99, "a half vector may be behind the viewer"
    # Its middle is the mirror direction, in which every one of these lobes draws.
    inside = drawn[2] * 0.8 - drawn[0] * 0.6 > 0.9995
    weight = np.where(inside, 1.0 / np.where(inside, density, 1.0), 0.0)
    error = weight.std() / np.sqrt(n)
    assert abs(weight.mean() - 2.0 * np.pi * 0.0005) < 4.5 * error


def test_materials_have_their_lobes():
    assert Lambertian().lobe is None
    assert Phong(diffuse=0.2, specular=0.0, exponent=5.0).lobe is None
    assert Phong(diffuse=0.2, specular=0.6, exponent=5.0).lobe == pytest.approx((0.75, 5.0, 1.0))
    assert Crinkled(diffuse=0.1, specular=0.3, exponent=60.0, tilt_deg=5.0).lobe == pytest.approx((0.75, 60.0, 1.0))
    assert Ggx(diffuse=0.3, specular=0.3, roughness=0.2).lobe == pytest.approx((0.5, -1.0, 0.2))


class Mine:
    """A material with a lobe of its own."""

    def __init__(self, lobe):
        self.lobe = lobe

    def brdf_per_sr(self, cos_in, cos_out, cos_phase):
        return np.full(np.shape(cos_in), 0.1)


def test_a_users_lobe_is_checked():
    assert complete(Mine(Lobe(0.5, 20.0))).lobe == Lobe(0.5, 20.0)
    assert check_lobe(Lobe(0.5, roughness=0.1)) is None
    for lobe, said in (
        (0.5, "make it a Lobe"),
        (Lobe(1.5), "share 1.5"),
        (Lobe(0.5, float("nan")), "exponent nan"),
        (Lobe(0.5, roughness=0.0), "roughness 0.0"),
    ):
        with pytest.raises(ScenarioError, match=said):
            complete(Mine(lobe))

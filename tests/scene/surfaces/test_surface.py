from dataclasses import replace

import numpy as np
import pytest

from rso_lidar.errors import ScenarioError
from rso_lidar.scene import ByWavelength, Hinged, Lambertian, Phong, RetroReflector, split_at_hinges
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


def test_materials_are_those_of_the_wavelength():
    both = ByWavelength(wavelength_nm=(1064.0, 1570.0), materials=(Lambertian(reflectance=0.1), Lambertian()))
    cubes = RetroReflector(diameter_mm=12.7, reflectance=0.9, fill_fraction=0.5)
    halves = {"part": np.repeat(np.array([0, 1], np.int16), 6), "part_names": ("bus", "cubes")}
    sat = surface("sat", BOX, both, **halves, part_materials={"cubes": cubes}, wavelength_m=1064e-9)
    assert sat.materials == (Lambertian(reflectance=0.1), cubes.replace(wavelength_nm=1064.0))
    with pytest.raises(ScenarioError, match=r"^material: by_wavelength: no material within 5 % of 532 nm"):
        surface("sat", BOX, both, wavelength_m=532e-9)
    with pytest.raises(ScenarioError, match=r"^part_materials\.cubes: by_wavelength: no material within 5 % of 532 nm"):
        surface("sat", BOX, **halves, part_materials={"cubes": both}, wavelength_m=532e-9)


def on_facets(triangles, rng, n=4000):
    """Return facet numbers and points on them, at random."""
    facet = rng.integers(len(triangles), size=n)
    share = rng.dirichlet([1, 1, 1], n)
    return facet, np.einsum("hc,hci->hi", share, triangles[facet])


def test_a_smooth_sphere_has_a_sphere_s_normals():
    """Within 0.5 deg of the true ones, anywhere on 1280 facets whose own are up to 4 deg off; winding is mixed."""
    rng = np.random.default_rng(7)
    triangles = sphere(2.0, 3)
    turned = rng.random(len(triangles)) < 0.5
    triangles[turned] = triangles[turned][:, [0, 2, 1]]
    facet, point = on_facets(triangles, rng)
    radial = point / np.linalg.norm(point, axis=1, keepdims=True)
    ball, flat = surface("ball", triangles, smooth_parts=("body",)), surface("ball", triangles)
    cosine = np.einsum("hi,hi->h", ball.shading_normals(facet, point), radial)
    own = np.einsum("hi,hi->h", flat.shading_normals(facet, point), radial)
    assert np.array_equal(np.sign(cosine), np.where(turned[facet], -1, 1)), "of the facet's own side"
    assert np.rad2deg(np.arccos(np.abs(cosine).clip(max=1))).max() < 0.5
    assert np.rad2deg(np.arccos(np.abs(own).clip(max=1))).max() > 3.0


def test_an_edge_stays_an_edge():
    """Faces of a box meet at 90 degrees: smooth or not, its normals are the facets'."""
    rng = np.random.default_rng(8)
    facet, point = on_facets(BOX, rng)
    sharp = surface("sat", BOX, smooth_parts=("body",))
    assert np.allclose(sharp.shading_normals(facet, point), sharp.planes[:3, facet].T, rtol=0, atol=1e-12)


def ridge(rise_m):
    """Return two squares that meet along the y axis, each falling away from it by `rise_m` over 1 m."""
    left, right = plate(1.0) - np.array([0.5, 0, 0]), plate(1.0) + np.array([0.5, 0, 0])
    both = np.concatenate([left, right])
    both[..., 2] = -rise_m * np.abs(both[..., 0])
    return both


@pytest.mark.parametrize(("between_deg", "tilt_deg"), [(50.0, 0.0), (58.0, 0.0), (62.0, 31.0), (100.0, 50.0)])
def test_sixty_degrees_make_an_edge(between_deg, tilt_deg):
    """On the ridge of two squares: upright where they meet at less than 60 degrees, else the square's own."""
    roof = surface("roof", ridge(np.tan(np.deg2rad(0.5 * between_deg))), smooth_parts=("body",))
    normal = roof.shading_normals(np.array([0]), np.array([[-1e-9, 0.0, 0.0]]))
    assert np.rad2deg(np.arccos(np.abs(normal[0, 2]).clip(max=1.0))) == pytest.approx(tilt_deg, abs=1e-3)


def test_parts_do_not_share_their_normals():
    """Two squares at 30 degrees: of one part the ridge is rounded, of two it is sharp; a part not named stays flat."""
    roof = ridge(np.tan(np.deg2rad(15)))
    point, facet = np.array([[-1e-9, 0.0, 0.0]]), np.array([0])  # on the ridge, of the facet that holds it
    two = {"part": np.array([0, 0, 1, 1], np.int16), "part_names": ("a", "b")}
    tilt = lambda s: float(np.rad2deg(np.arccos(abs(s.shading_normals(facet, point)[0, 2]))))  # noqa: E731
    assert tilt(surface("roof", roof, smooth_parts=("body",))) == pytest.approx(0.0, abs=1e-3)
    assert tilt(surface("roof", roof, **two, smooth_parts=("a", "b"))) == pytest.approx(15.0, abs=1e-6)
    assert tilt(surface("roof", roof, **two, smooth_parts=("b",))) == pytest.approx(15.0, abs=1e-6)
    assert tilt(surface("roof", roof)) == pytest.approx(15.0, abs=1e-6)


def test_corners_weigh_by_angle():
    """Four faces of a flat pyramid, one of them cut in two: the tip's normal is +z, whatever the cut."""
    rim = np.array([[1, 0, -0.3], [0, 1, -0.3], [-1, 0, -0.3], [0, -1, -0.3]], dtype=float)
    tip = np.zeros(3)
    faces = [np.array([tip, rim[k], rim[(k + 1) % 4]]) for k in range(4)]
    middle = 0.5 * (rim[0] + rim[1])
    cut = [np.array([tip, rim[0], middle]), np.array([tip, middle, rim[1]]), *faces[1:]]
    pyramid = surface("pyramid", np.array(cut), smooth_parts=("body",))
    normal = pyramid.shading_normals(np.arange(5), np.zeros((5, 3)))
    assert np.allclose(normal, [0, 0, 1], rtol=0, atol=1e-12)


def test_a_smooth_part_that_is_not_there():
    with pytest.raises(ScenarioError, match=r"smooth_parts: no part 'bdy' in sat\.stl; did you mean 'body'"):
        surface("sat", BOX, smooth_parts=("bdy",))


def test_single_facets_may_be_of_another_material():
    """Two facets of the bus are painted; in packets, in NumPy and on a hinge they stay so."""
    dark, white = Lambertian(reflectance=0.1), Lambertian(reflectance=0.8)
    part = np.array([0] * 8 + [1] * 4, dtype=np.int16)
    sat = surface("sat", BOX, dark, part=part, part_names=("bus", "wing"))
    painted = part.astype(np.int64)
    painted[[2, 3]] = 2
    sat = replace(sat, materials=(dark, dark, white), material_of=painted)
    expected = np.where(np.isin(np.arange(12), (2, 3)), 0.8, 0.1) / np.pi
    assert sat.lambertian_per_sr == pytest.approx(expected)
    assert sat.brdf_per_sr(np.arange(12), np.ones(12)) == pytest.approx(expected)
    still, turned = split_at_hinges(sat, [Hinged("sat.wing", ("wing",), (0.0, 0.0, 0.0))])
    assert still.lambertian_per_sr == pytest.approx(expected[:8])
    assert turned.lambertian_per_sr == pytest.approx(expected[8:])


def test_the_area_of_a_box_is_that_of_its_sides():
    boxed = surface("sat", BOX, scale=0.5)
    assert boxed.area_m2 == pytest.approx(0.25 * 2.0 * (1 * 2 + 2 * 3 + 1 * 3), rel=1e-12)
    assert boxed.areas_m2.shape == (len(BOX),)

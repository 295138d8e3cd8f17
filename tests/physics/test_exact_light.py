"""The references of sampling, polygons and lattices of rays, against closed forms and each other, without the sampler."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rso_lidar.optics import Laser
from tests.optics.bench_for_tests import plate
from tests.physics.sampling_scenes import (
    CRAFT,
    EXACT,
    LASER,
    RECEIVER,
    SCENES,
    compare,
    craft_case,
    draw_pixels,
    load_case,
    one_target,
    rays_of,
)
from tests.reference.optics.exact_light import exact_photons, facets_in_lidar_axes, find_touched, lattice_photons

REFLECTANCE = 0.3
POLYGONS = "facets clipped as polygons in the image (tests/reference/optics/exact_light.py)"
EQ_7 = "Fuller et al., eq. 7, in closed form"


def photons_by_hand(area_m2, normal, center_m, laser=LASER, receiver=RECEIVER):
    """Return the photons that a small facet sends back: eq. 7 with its image area |n·p| / z³ for a pixel's."""
    x, y, z = center_m
    range_m = math.sqrt(x * x + y * y + z * z)
    along = abs(float(np.dot(normal, center_m)))  # R cos α
    image_area = area_m2 * along / z**3
    t2 = laser.half_width_tangent**2
    density = {
        "square": 1.0 / (4.0 * t2),
        "circle": 1.0 / (math.pi * t2),
        "gaussian": 2.0 / (math.pi * t2) * math.exp(-2.0 * (x * x + y * y) / (z * z * t2)),
    }[laser.footprint]
    lens_m2 = receiver.aperture_area_m2 * receiver.transmission
    return (
        laser.photons
        * density
        * image_area
        * REFLECTANCE
        / math.pi
        * along
        / range_m
        * z
        / range_m
        * lens_m2
        / range_m**2
    )


def polygons(scene):
    """Return the photons of pixels (pixel) from polygons."""
    touched = find_touched(scene.surfaces, scene.truth, scene.receiver)
    photons = exact_photons(*facets_in_lidar_axes(scene.surfaces, scene.truth), scene.receiver, scene.laser, touched)
    return np.nan_to_num(photons, nan=0.0)


@pytest.mark.parametrize("footprint", ["square", "circle", "gaussian"])
@pytest.mark.parametrize("turn", [(0.0, 0.0, 0.0), (25.0, -50.0, 10.0)])
def test_a_plate_within_a_pixel_returns_the_closed_form(footprint, turn, validation):
    rotation, at = Rotation.from_euler("xyz", turn, degrees=True), (3.4, -6.1, 1000.0)
    laser = LASER.replace(footprint=footprint)
    scene = one_target(plate(0.4, 0.3), rotation, at[2], across_m=at[:2], laser=laser)
    by_hand = photons_by_hand(0.4 * 0.3, rotation.apply((0.0, 0.0, 1.0)), at, laser)
    photons = polygons(scene)
    assert np.count_nonzero(photons) == 1
    # The square of the plate's size over its range, and of that over the beam's width: what a small facet leaves out.
    validation(
        case=f"polygons: plate within a pixel, turned by {turn} degrees, {footprint} beam",
        source=EQ_7,
        expected=1.0,
        got=photons.sum() / by_hand,
        tolerance=2e-6 if footprint != "gaussian" else 2e-4,
        unit="",
    )


@pytest.mark.parametrize("footprint", ["square", "circle", "gaussian"])
def test_a_wall_returns_the_light_of_the_whole_beam(footprint, validation):
    laser = Laser(divergence_deg=0.31, footprint=footprint)
    scene = one_target(plate(400.0), Rotation.identity(), 1000.0, laser=laser)
    lens_m2 = RECEIVER.aperture_area_m2 * RECEIVER.transmission
    by_hand = laser.photons * REFLECTANCE / math.pi * lens_m2 / 1000.0**2
    # cos⁴ of the angle from the boresight, which is at most 0.0039 within a square, and mostly below in a Gaussian.
    validation(
        case=f"polygons: facing wall, {footprint} beam",
        source=EQ_7,
        expected=1.0,
        got=polygons(scene).sum() / by_hand,
        tolerance=2.0 * 0.0039**2,
        unit="",
    )


def test_what_is_hidden_by_a_black_plate_is_missing():
    center = np.array([0.68, 0.68, 1000.0])  # about the middle of a pixel
    far, near = plate(1.2) + center, plate(0.3) + 0.7 * center
    full, hidden = (photons_by_hand(side_m**2, (0.0, 0.0, 1.0), center) for side_m in (1.2, 0.3 / 0.7))
    for first, second in ((near, far), (far, near)):
        triangles = np.concatenate([first, second])
        reflectance = np.where(triangles[:, 0, 2] < 800.0, 0.0, REFLECTANCE)
        photons = exact_photons(triangles, reflectance, RECEIVER, LASER)
        assert photons.sum() == pytest.approx(full - hidden, rel=2e-6)


def test_of_facets_that_coincide_the_light_counts_once():
    scene = SCENES["plate edge, random"].build()
    triangles, reflectance = facets_in_lidar_axes(scene.surfaces, scene.truth)
    twice = exact_photons(np.concatenate([triangles, triangles]), REFLECTANCE, RECEIVER, LASER)
    np.testing.assert_allclose(twice, exact_photons(triangles, reflectance, RECEIVER, LASER), rtol=1e-9)


def test_cutting_facets_changes_no_light():
    whole = one_target(plate(12.7), Rotation.random(random_state=5), 1000.0)
    cut = one_target(plate(12.7, n=5), Rotation.random(random_state=5), 1000.0)
    np.testing.assert_allclose(polygons(cut), polygons(whole), rtol=1e-6)


def assert_agree_with_lattices(name, n, number, most):
    """Assert that polygons agree with the mean of a number of lattices of n rays in a pixel, within its standard error.

    That error, relative and weighted by light, is at most `most`.
    """
    scene = SCENES[name].build()
    exact = polygons(scene)
    touched = find_touched(scene.surfaces, scene.truth, scene.receiver)
    is_lit = exact[touched] > 0.0
    pixels = np.concatenate([draw_pixels(touched[is_lit], 40), draw_pixels(touched[~is_lit], 5)])
    shifts = np.random.default_rng(35).random((number, 2))  # random shifts leave no bias (Cranley and Patterson 1976)
    lattices = np.array([lattice_photons(*scene, n, shift, pixels)[pixels] for shift in shifts])
    exact = exact[pixels]
    variance = lattices.var(axis=0, ddof=1) / number
    error, label, _ = compare(lattices.mean(axis=0), exact, variance + (1e-5 * exact) ** 2)  # corners in float32
    assert label < most
    assert error < 2.0 * label  # pixels along an edge err alike, so about ten independent errors decide: 4 sigma


@pytest.mark.parametrize(
    "name",
    [
        "plate edge, random",
        "half hidden, random",
        "half hidden, aligned",
        "interpenetrating, random",
        "interpenetrating, aligned",
        "several targets, random",
        pytest.param("narrow beam, circle", marks=pytest.mark.slow),
    ],
)
def test_polygons_agree_with_lattices_of_rays(name):
    assert_agree_with_lattices(name, 4096, 32, 4e-4)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["half hidden, random", "interpenetrating, random"])
def test_polygons_agree_with_many_lattices_of_rays(name):
    assert_agree_with_lattices(name, 16_384, 64, 6e-5)


def test_a_lattice_is_shifted_within_its_pixels():
    scene = SCENES["four pixels, random"].build()
    here, there = (lattice_photons(*scene, 64, shift) for shift in ((0.0, 0.0), (0.3, 0.7)))
    assert 0.0 < compare(here, there, 0.0 * here)[0] < 0.1
    assert np.array_equal(here > 0.0, there > 0.0)


def test_every_pixel_that_a_target_covers_is_touched():
    for name in ("distorted lens, random", "boom and speck, aligned", "crater field, oblique"):
        scene = SCENES[name].build()
        receiver = scene.receiver.replace(n_rows=16, n_cols=16, pixel_pitch_um=200.0)
        lit = np.flatnonzero(lattice_photons(scene.surfaces, scene.truth, receiver, scene.laser, 64))
        assert 0 < len(lit) and set(lit) <= set(find_touched(scene.surfaces, scene.truth, receiver))


def find_reference_pixels(scene, photons):
    """Return the pixels that facets may touch, and whose photons the reference has."""
    touched = find_touched(scene.surfaces, scene.truth, scene.receiver)
    return touched[np.isfinite(photons[touched])]


def assert_agrees_with_a_coarser_lattice(case):
    """Assert that a quarter of the rays gives nearly the same light: an error falls with their number to the power 3/4."""
    scene, photons = load_case(case)
    pixels = find_reference_pixels(scene, photons)
    coarse = lattice_photons(*scene, rays_of(case) // 4, pixels=pixels)
    error, _, total = compare(coarse, photons, 0.0 * photons)
    assert 0.0 < error < 0.003
    assert abs(total) < 3e-4


CRAFT_CASES = [
    pytest.param(name, turn, marks=[pytest.mark.slow] if name in ("tdrs", "cassini", "voyager", "rosetta") else [])
    for name in CRAFT
    for turn in ("random", "aligned")
]


@pytest.mark.parametrize(("name", "turn"), CRAFT_CASES)
def test_lattices_of_spacecraft_agree_with_coarser_ones(name, turn, shared):
    assert_agrees_with_a_coarser_lattice(craft_case(shared, name, turn))


@pytest.mark.parametrize("name", [name for name, case in SCENES.items() if case.reference != EXACT])
def test_lattices_agree_with_coarser_ones(name):
    assert_agrees_with_a_coarser_lattice(SCENES[name])


@pytest.mark.slow
@pytest.mark.parametrize(("name", "turn"), [("suomi_npp", "random"), ("hubble", "aligned")])
def test_polygons_of_spacecraft_agree_with_lattices(name, turn, shared, validation):
    scene, lattice = load_case(craft_case(shared, name, turn))
    triangles, reflectance = facets_in_lidar_axes(scene.surfaces, scene.truth)
    pixels = find_reference_pixels(scene, lattice)[::2]
    error, _, total = compare(
        lattice, exact_photons(triangles, reflectance, scene.receiver, scene.laser, pixels), 0.0 * lattice
    )
    rows = (
        ("error of a pixel's photons, weighted by light", 0.0, error, 0.1),
        ("light of the pixels compared", 1.0, 1.0 + total, 0.002),
    )
    for what, expected, got, tolerance in rows:
        numbers = {"expected": 100.0 * expected, "got": 100.0 * got, "tolerance": tolerance, "unit": "%"}
        validation(case=f"lattice of rays: {name} at {CRAFT[name]} m, {turn}: {what}", source=POLYGONS, **numbers)

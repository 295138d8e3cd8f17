"""Line sampling: how well it knows the light, what rays it costs, and what it does not depend on."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rso_lidar import optics, sampling, scene
from rso_lidar.optics import BrownConrady, GaussianPsf, Laser, Receiver
from rso_lidar.optics.rays.scan_lines import ScanLines, merge_pixels, normalise
from rso_lidar.records import Truth, specs
from rso_lidar.scene import Crinkled
from tests.optics.bench_for_tests import PAPER_LASER, box, place, plate, surface, truth_of
from tests.reference.optics import scan_lines as oracle
from tests.reference.optics.exact_light import exact_photons, facets_in_lidar_axes, find_touched, lattice_photons

LENS = Receiver(fov_deg=2.5, f_number=2.8, n_rows=32, n_cols=32)
BOOM = np.concatenate([box(3.0, 2.0, 2.0), box(0.02, 30.0, 0.02)])
GRATING = np.concatenate([box(20.0, 0.05, 0.05) + np.array([0.0, y, 0.0]) for y in np.arange(-8.0, 8.0, 0.37)])
BRIGHT = Laser(energy_mj=5e4)  # so that photon noise excuses nothing


def cast(surfaces, truth: Truth, receiver=LENS, laser=PAPER_LASER, threads=1):
    """Return the hits of a frame and the expected photons of the pixels (pixel)."""
    hits = sampling.cast_pixels(receiver, laser, surfaces, truth, threads)
    photons = optics.pixel_photons(hits, laser, receiver) * hits.weight
    return hits, np.bincount(hits.pixel, photons, receiver.n_rows * receiver.n_cols)


def see(triangles, lidar_from_target, receiver=LENS, laser=PAPER_LASER, material=None, threads=1):
    """Return the hits of one target and the expected photons of the pixels (pixel)."""
    return cast([surface("target", triangles, material)], truth_of(target=lidar_from_target), receiver, laser, threads)


def exact(triangles, lidar_from_target, laser=PAPER_LASER):
    """Return the true photons of the pixels (pixel)."""
    surfaces, truth = [surface("target", triangles)], truth_of(target=lidar_from_target)
    photons = exact_photons(*facets_in_lidar_axes(surfaces, truth), LENS, laser, find_touched(surfaces, truth, LENS))
    return np.nan_to_num(photons, nan=0.0)


def compare(hits, got, true):
    """Return the relative error of a pixel weighted by light, and the same as the label says."""
    lit, variance = true > 0.0, hits.photons_variance.ravel()
    return (
        math.sqrt(float((squares[lit] / true[lit]).sum() / true.sum())) for squares in ((got - true) ** 2, variance)
    )


def attitude(seed):
    """Return a random rotation."""
    return Rotation.random(random_state=seed)


def assert_whole(rays):
    """Assert that rays are ordered by pixel, with weights that sum to one in each."""
    assert (np.diff(rays.pixel) >= 0).all() and (rays.weight > 0.0).all()
    sums = np.bincount(rays.pixel, rays.weight)
    np.testing.assert_allclose(sums[np.unique(rays.pixel)], 1.0, rtol=0, atol=1e-5)


# ----------------------------------------------------------------------------------------------------- what is known


@pytest.mark.parametrize("range_m", [250.0, 1000.0, 4000.0])
def test_the_light_of_pixels_is_known_to_the_error_and_says_so(range_m):
    where = place((0.01 * range_m, 0.0, range_m), attitude(3))
    hits, got = see(BOOM, where, laser=BRIGHT)
    true = exact(BOOM, where, BRIGHT)
    error, said = compare(hits, got, true)
    # A single craft; errors of many are held closer to their labels in tests/physics.
    assert error < 1.5 * 0.02 and error / 3.0 < said < 1.5 * 0.02
    assert true[got == 0.0].sum() < 1e-3 * true.sum()
    assert got.sum() == pytest.approx(true.sum(), rel=4e-3)


def test_a_thin_boom_is_found_although_no_ray_of_a_grid_meets_it():
    where = place((0.0, 0.0, 3000.0), Rotation.from_euler("z", 17.0, degrees=True))
    _, got = see(BOOM, where)
    _, coarse = see(BOOM, where, LENS.replace(rays_per_pixel=16, min_rays_per_target=0))
    true = exact(BOOM, where)
    far = (np.abs(np.arange(32 * 32) // 32 - 15.5) > 1.5) & (true > 0.0)  # rows beyond the box
    assert far.sum() >= 4 and np.count_nonzero(coarse[far]) < 4
    np.testing.assert_allclose(got[far], true[far], rtol=0.05)


def test_a_plate_that_fills_pixels_needs_four_rays_in_each():
    hits, got = see(plate(400.0), place((0.0, 0.0, 1000.0), Rotation.from_euler("x", 0.3)))
    assert len(hits.rays.pixel) <= 4.2 * 32 * 32  # the diagonal of the plate is no contour
    assert hits.photons_variance.max() < (0.02 * got.max()) ** 2
    assert_whole(hits.rays)


@pytest.mark.parametrize("divergence_deg", [2.5 / 32 / 20, 2.5 / 32 / 2])
@pytest.mark.parametrize(("footprint", "off"), [("square", 1e-5), ("circle", 1e-3), ("gaussian", 0.02)])
def test_a_narrow_beam_keeps_its_energy(footprint, off, divergence_deg):
    """A beam down to a twentieth of a pixel on a wide plate: the plate returns what falls on it, wherever rays go."""
    laser = Laser(divergence_deg=divergence_deg, footprint=footprint)
    _, got = see(plate(400.0), place((0.0, 0.0, 1000.0)), laser=laser)
    gathered = LENS.aperture_area_m2 * LENS.transmission * 0.3 / math.pi / 1000.0**2
    assert got.sum() == pytest.approx(laser.photons * gathered, rel=off)  # beside the corner of four pixels


@pytest.mark.parametrize("seed", [2, 6])
def test_crinkled_foil_smaller_than_a_ray_says_how_well_it_is_known(seed):
    foil = Crinkled(diffuse=0.15, specular=0.65, exponent=30.0, tilt_deg=7.0, cell_mm=200.0)
    where = place((0.0, 0.0, 3000.0), attitude(seed))
    hits, got = see(plate(20.0), where, laser=BRIGHT, material=foil)
    true = lattice_photons([surface("target", plate(20.0), foil)], truth_of(target=where), LENS, BRIGHT, 16384)
    error, said = compare(hits, got, true)
    assert error < 0.06 and 0.5 * error < said < 2.0 * error
    assert got.sum() == pytest.approx(true.sum(), rel=4.0 * 0.05 / math.sqrt(np.count_nonzero(true)))
    assert len(hits.rays.pixel) > 1024 * np.count_nonzero(true)


@pytest.mark.slow
def test_two_targets_far_apart_in_size_and_a_lens_that_distorts():
    bent = LENS.replace(distortion=BrownConrady(k1=3.0), psf=GaussianPsf(sigma_um=30.0))
    targets = [surface("near", BOOM), surface("speck", box(0.3, 0.3, 0.3))]
    truth = truth_of(near=place((1.0, 0.0, 900.0), attitude(7)), speck=place((-14.0, 3.0, 1500.0), attitude(8)))
    hits, _ = cast(targets, truth, bent)
    photons = optics.pixel_photons(hits, PAPER_LASER, bent) * hits.weight
    for target in (0, 1):
        true = lattice_photons([targets[target]], truth, bent, PAPER_LASER, 65536)
        assert photons[hits.target == target].sum() == pytest.approx(true.sum(), rel=0.02)
    light = optics.collect(hits, PAPER_LASER, bent)
    assert light.photons_variance.sum() < hits.photons_variance.sum()  # neighbours share what one gets wrong


def test_a_smaller_error_costs_rays_and_brings_it():
    where = place((0.0, 0.0, 1000.0), attitude(4))
    true = exact(GRATING, where, BRIGHT)
    rays, errors, labels = [], [], []
    for error in (0.3, 0.05, 0.01):
        hits, got = see(GRATING, where, LENS.replace(sampling_error=error), BRIGHT)
        rays.append(len(hits.rays.pixel))
        errors.append(float(np.sqrt(((got - true) ** 2).sum()) / true.sum()))
        labels.append(float(np.sqrt(hits.photons_variance.sum()) / true.sum()))
    assert rays == sorted(rays) and rays[0] < 0.5 * rays[2]
    assert errors[0] > 3.0 * errors[2] and labels[0] > labels[1] > labels[2]


def test_nothing_in_view_gives_no_rays_and_no_error():
    for where in (place((0.0, 0.0, -500.0)), place((500.0, 0.0, 500.0))):
        hits, got = see(BOOM, where)
        assert len(hits.rays.pixel) == 0 and got.sum() == 0.0
        assert hits.photons_variance.sum() == 0.0


# -------------------------------------------------------------------------------------------------------- two rounds


def test_a_second_round_replaces_the_rays_of_the_pixels_that_missed():
    surfaces, truth = [surface("target", GRATING)], truth_of(target=place((0.0, 0.0, 1000.0), attitude(4)))
    contours = scene.contours(surfaces, truth, 0.1)
    lines = ScanLines(LENS, BRIGHT, scene.extent(surfaces, truth), contours, scene.find_textures(surfaces, truth))
    lines.lay(scene.find_fronts(lines.probes, surfaces, truth))
    rays = lines.rays
    first = scene.cast(rays, surfaces, truth, 1)
    first, is_unfinished = lines.take(first, optics.pixel_photons(first, BRIGHT, LENS))
    assert is_unfinished
    finer = scene.cast(lines.rays, surfaces, truth, 1)
    last, is_unfinished = lines.take(finer, optics.pixel_photons(finer, BRIGHT, LENS), first)
    assert not is_unfinished
    for done in (first, last):
        assert_whole(done.rays)
        assert (np.diff(done.ray) > 0).all()
        np.testing.assert_array_equal(done.weight, done.rays.weight[done.ray])
        np.testing.assert_array_equal(done.pixel, done.rays.pixel[done.ray])
    again = np.unique(lines.rays.pixel)
    assert 0 < len(again) < len(np.unique(rays.pixel))
    photons = np.bincount(first.pixel, optics.pixel_photons(first, BRIGHT, LENS) * first.weight, 32 * 32)
    share = first.photons_variance.ravel() / np.maximum(photons, 1e-3 * photons.max())
    others = np.setdiff1d(np.flatnonzero(photons), again)
    assert 0.0 < share[others].sum() < (0.02**2) * photons.sum() < share.sum()
    for of, before in ((last.rays, rays), (last, first)):
        finest = lines.rays if of is last.rays else finer
        is_finer = np.isin(of.pixel, again)
        for name, spec in specs(type(of)).items():
            if spec.dims[:1] in (("ray",), ("hit",)) and name != "ray" and getattr(of, name) is not None:
                np.testing.assert_array_equal(getattr(of, name)[is_finer], getattr(finest, name))
                kept = ~np.isin(before.pixel, again)
                np.testing.assert_array_equal(getattr(of, name)[~is_finer], getattr(before, name)[kept])
    # Each hit still has the ray on which it is: its range follows from the direction, and both lists from one cast.
    alone = scene.cast(last.rays, surfaces, truth, 1)
    np.testing.assert_array_equal(last.ray, alone.ray)
    np.testing.assert_array_equal(last.range_m, alone.range_m)
    assert last.photons_variance.sum() < first.photons_variance.sum()
    changed = np.flatnonzero(last.photons_variance.ravel() != first.photons_variance.ravel())
    assert set(changed) <= set(again)


@pytest.mark.parametrize("seed", range(4))
def test_merged_pixels_have_the_finer_entries_alone(seed):
    rng = np.random.default_rng(seed)
    before, after = np.sort(rng.integers(0, 20, 50)), np.sort(rng.integers(5, 25, 10 * seed))
    is_replaced = np.isin(np.arange(25), after)
    expected = oracle.merge_pixels(before, after, is_replaced)
    np.testing.assert_array_equal(merge_pixels(before, after, is_replaced), expected)


def test_directions_are_unit_vectors():
    direction = np.random.default_rng(3).normal(0.0, 1.0, (3, 20))
    expected = oracle.normalise(direction)
    normalise(direction)
    np.testing.assert_allclose(direction, expected, rtol=1e-14)


# ------------------------------------------------------------------------------------- what sampling does not depend on


def test_threads_change_nothing():
    where = place((0.0, 0.0, 200.0), attitude(2))
    one, other = (see(BOOM, where, threads=threads)[0] for threads in (1, 3))
    for name in specs(type(one)):
        if getattr(one, name) is not None:
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


@pytest.mark.parametrize("rays_per_pixel", [None, 9])
def test_a_pixel_does_not_depend_on_what_else_is_in_the_frame(rays_per_pixel):
    lens = LENS.replace(rays_per_pixel=rays_per_pixel)
    surfaces = [surface("one", BOOM), surface("two", box(9.0, 5.0, 20.0))]
    poses = {"one": place((-9.0, 0.4, 1000.0), attitude(1)), "two": place((15.0, -13.0, 900.0), attitude(2))}
    alone, _ = cast(surfaces[:1], truth_of(one=poses["one"]), lens)
    both, _ = cast(surfaces, truth_of(**poses), lens)
    is_first = np.isin(both.rays.pixel, alone.rays.pixel)
    assert 0 < len(alone.rays.pixel) == is_first.sum() < len(is_first)
    for name in ("direction", "pixel", "weight"):
        np.testing.assert_array_equal(getattr(both.rays, name)[is_first], getattr(alone.rays, name))
    of = np.unique(alone.rays.pixel)
    np.testing.assert_array_equal(both.photons_variance.flat[of], alone.photons_variance.flat[of])


# -------------------------------------------------------------------------------------------------------- fixed grids


def test_a_fixed_grid_is_estimated_too():
    where = place((0.0, 0.0, 400.0), attitude(5))
    hits, _ = see(BOOM, where, LENS.replace(rays_per_pixel=16, min_rays_per_target=0))
    np.testing.assert_allclose(hits.rays.weight, 1.0 / 16.0)
    assert hits.photons_variance.max() > 0.0
    assert scene.label(hits, optics.collect(hits, PAPER_LASER, LENS)).photons_sampling_error.max() > 0.0


@pytest.mark.parametrize("side_m", [20.0, 2.0, 0.2, 2e-3])
def test_on_a_fixed_grid_contours_count_of_targets_with_few_rays(side_m):
    """A square is known exactly by its contours, down to a millipixel; a grid alone misses it or is off."""
    where = place((0.31, 0.17, 1000.0))
    true = exact(plate(side_m), where)
    grid = LENS.replace(rays_per_pixel=4)  # some 800 rays on the largest
    for least, is_cut in ((4096, True), (0, False)):
        hits, got = see(plate(side_m), where, grid.replace(min_rays_per_target=least))
        assert_whole(hits.rays)
        assert (len(hits.rays.pixel) > 4 * len(np.unique(hits.rays.pixel))) == is_cut
        assert (abs(got.sum() / true.sum() - 1.0) < 1e-4) == is_cut


def test_contours_count_by_target_on_a_fixed_grid():
    """Of a large and a small target only the small one has contours."""
    surfaces = [surface("large", plate(30.0)), surface("small", plate(0.3))]
    truth = truth_of(large=place((-5.0, -4.0, 1000.0)), small=place((18.0, 17.0, 1000.0)))
    hits, _ = cast(surfaces, truth, LENS.replace(rays_per_pixel=16, min_rays_per_target=1000))
    is_small = hits.rays.direction[:, 0] > 0.016
    assert 0 < is_small.sum() and len(np.unique(hits.rays.weight[is_small].round(9))) > 1
    np.testing.assert_allclose(hits.rays.weight[~is_small], 1.0 / 16.0)

"""Probes: what they find hidden is behind something, and what is seen is not found hidden."""

import math

import numpy as np
import pytest

from rso_lidar import optics, sampling
from rso_lidar.optics import Laser, Receiver
from rso_lidar.optics.rays import probes
from rso_lidar.optics.rays.contour_images import cut_contours
from rso_lidar.optics.rays.probes import count_probes, image_fronts, is_hidden, place_probes
from tests.optics.bench_for_tests import box, place, plate, surface, truth_of
from tests.reference.optics import probes as oracle
from tests.reference.optics.exact_light import lattice_photons

ALL = np.ones((4, 6), np.int64)
PER_SIDE, PIXEL = 3, 1e-3


def fronts_of(depth_at, error=0.02, sides=ALL):
    """Return the image of fronts (a, b, c) that `depth_at(x, y)` gives for points of the window [pixels]."""
    point, pixel, weight = place_probes(sides, PER_SIDE, 0, 0, sides.shape[1])
    assert len(np.unique(pixel)) == np.count_nonzero(sides)
    np.testing.assert_allclose(np.bincount(pixel, weight, sides.size), sides.ravel())
    x, y = point * PIXEL
    direction = np.stack([x, y, np.ones_like(x)]) / np.sqrt(1.0 + x * x + y * y)
    fronts = np.array([depth_at(*at) for at in point.T]).T
    return image_fronts(sides, PER_SIDE, direction, np.ascontiguousarray(fronts), PIXEL / PER_SIDE, error)


def wall(x, y):
    """A wall that faces the lidar at 100 m."""
    return 0.0, 0.0, 0.01


def is_behind_found(image, x, y, depth_m):
    """Return whether a point at a depth is found hidden."""
    return is_hidden(x, y, 0.0, 0.0, 1.0 / depth_m, 0.0, image, PER_SIDE)


def test_a_wall_hides_what_is_behind_it_and_nothing_else():
    image = fronts_of(wall)
    for x, y in ((1.1, 2.3), (3.0, 0.7), (5.5, 3.5)):
        assert is_behind_found(image, x, y, 101.0)
        assert is_behind_found(image, x, y, 100.002)  # 2 cm of 3.3 from probe to probe, and a slack of 2 % of these
        for depth_m in (100.0001, 100.0, 99.0):
            assert not is_behind_found(image, x, y, depth_m)


def test_a_leaning_wall_hides_by_its_plane():
    """z = 100 m + 2 x: far behind on one side, far in front on the other."""
    image = fronts_of(lambda x, y: (-0.02, 0.0, 0.01))
    for x in (0.5, 3.0, 5.5):
        depth_m = 1.0 / (0.01 - 0.02 * x * PIXEL)
        assert is_behind_found(image, x, 2.0, depth_m + 0.01)
        assert not is_behind_found(image, x, 2.0, depth_m)


def test_where_fronts_differ_only_what_is_well_behind_is_hidden():
    """A step of 1 m from 100 to 101 m between two columns of probes: 15 % of their distance counts as behind."""
    image = fronts_of(lambda x, y: (0.0, 0.0, 0.01 if x < 3.0 else 1.0 / 101.0))
    assert not is_behind_found(image, 3.0, 2.0, 100.5)
    assert not is_behind_found(image, 3.0, 2.0, 101.004)
    assert is_behind_found(image, 3.0, 2.0, 101.006)
    assert is_behind_found(image, 1.0, 2.0, 100.002)


def test_nothing_is_hidden_beside_an_edge_or_outside_the_window():
    image = fronts_of(lambda x, y: wall(x, y) if x < 3.0 else (0.0, 0.0, 0.0))
    assert is_behind_found(image, 2.6, 2.0, 200.0)
    for x in (2.9, 3.1, 4.0):
        assert not is_behind_found(image, x, 2.0, 200.0)
    for x, y in ((0.1, 2.0), (5.9, 2.0), (2.0, 0.1), (2.0, 3.9)):
        assert not is_behind_found(image, x, y, 200.0)
    uncovered = ALL.copy()
    uncovered[2, 2] = 0
    assert not is_behind_found(fronts_of(wall, sides=uncovered), 2.4, 2.5, 200.0)


def test_an_almost_upright_facet_hides_nothing():
    image = fronts_of(lambda x, y: (-25.0 * 0.01, 0.0, 0.01))
    assert not is_behind_found(image, 2.0, 2.0, 200.0)


def test_a_piece_is_hidden_as_a_whole_or_not():
    """The hidden part of a contour that goes behind a wall is left out, pixel by pixel."""
    image = fronts_of(lambda x, y: wall(x, y) if x < 3.0 else (0.0, 0.0, 0.0))
    ends = np.array([[0.3, 1.5, 5.7, 1.5], [0.3, 2.5, 5.7, 2.5]])
    per_depth = np.array([[1.0 / 150.0] * 2, [1.0 / 50.0] * 2])
    starts, pieces, steps = cut_contours(
        ends, np.array([1.0, 2.0]), per_depth, np.ones((4, 6), np.int64), 0, 0, image, PER_SIDE
    )
    pixel = np.repeat(np.arange(24), np.diff(starts))
    assert sorted(pixel[steps == 1.0] % 6) == [2, 3, 4, 5]  # the first of these is at the wall's edge
    assert sorted(pixel[steps == 2.0] % 6) == [0, 1, 2, 3, 4, 5]
    assert len(pieces) == 10


def test_more_probes_for_less_error_and_fewer_for_many_pixels():
    counts = [count_probes(np.ones((n, n), np.int64), 0.02) for n in (1, 12, 20, 100)]
    assert counts == [4, 4, 3, 2]
    assert [count_probes(np.ones((4, 4), np.int64), error) for error in (0.1, 0.05, 0.01, 0.005, 1e-4)] == [
        2,
        2,
        8,
        16,
        16,
    ]


@pytest.mark.parametrize("wide", [0.8, 3.0])
def test_what_a_panel_hides_costs_no_rays(wide):
    """Boxes behind a panel: with a narrow one they are seen beside it, and keep their light."""
    lens = Receiver(fov_deg=2.5, f_number=2.8, n_rows=32, n_cols=32)
    behind = np.concatenate([box(0.1, 2.0, 0.1) + np.array([x, 0.0, 0.0]) for x in np.arange(-1.0, 1.0, 0.13)])
    targets = [surface("panel", plate(wide)), surface("boxes", behind)]
    truth = truth_of(panel=place((0.01, 0.02, 150.0)), boxes=place((0.0, 0.0, 152.0)))
    hits = sampling.cast_pixels(lens, Laser(), targets, truth)
    alone = sampling.cast_pixels(lens, Laser(), targets[:1], truth)
    seen = optics.pixel_photons(hits, Laser(), lens) * hits.weight
    if wide > 2.0:
        assert len(hits.rays.pixel) == len(alone.rays.pixel)
        assert (hits.target == 0).all()
    else:
        area = 2.0 * 0.1 * 16 - sum(
            0.8 * max(0.0, min(x + 0.05, 0.01 + 0.4 * 152 / 150) - max(x - 0.05, 0.01 - 0.4 * 152 / 150))
            for x in np.arange(-1.0, 1.0, 0.13)
        )
        gathered = lens.aperture_area_m2 * lens.transmission * 0.3 / math.pi * Laser().density_on_axis / 151.95**4
        assert seen[hits.target == 1].sum() == pytest.approx(area * gathered, rel=0.02)


@pytest.mark.parametrize("seed", range(4))
def test_probes_and_fronts_are_those_of_the_oracle(seed):
    rng = np.random.default_rng(seed)
    sides = rng.integers(0, 3, (4, 5))
    per_side, error = 2 + seed % 3, (0.01, 0.02)[seed % 2]
    found = place_probes(sides, per_side, 7, 9, 32)
    for got, expected in zip(found, oracle.place_probes(sides, per_side, 7, 9, 32), strict=True):
        np.testing.assert_allclose(got, expected, rtol=1e-12)
    n = len(found[1])
    direction = np.stack([*rng.normal(0.0, 0.05, (2, n)), np.ones(n)])
    direction /= np.linalg.norm(direction, axis=0)
    fronts = np.stack([*rng.normal(0.0, 0.05, (2, n)), np.full(n, 0.01)]) * rng.choice([0.0, 1.0], n, p=[0.1, 0.9])
    fronts[:, :: 1 + seed % 2] = [[0.01], [0.0], [0.01]]  # one plane for all probes, or for every second
    image = image_fronts(sides, per_side, direction, fronts, 1e-3, error)
    np.testing.assert_allclose(image, oracle.image_fronts(sides, per_side, direction, fronts, 1e-3, error), rtol=1e-12)

    x, y = rng.uniform(-0.2, 5.2, 300), rng.uniform(-0.2, 4.2, 300)
    dx, dy = rng.normal(0.0, 0.4, (2, 300))
    w, dw = 0.01 * (1.0 - rng.exponential(1e-3, 300)), 0.01 * rng.normal(0.0, 1e-4, 300)
    hidden = [is_hidden(*piece, image, per_side) for piece in zip(x, y, dx, dy, w, dw, strict=True)]
    expected = [oracle.is_hidden(*piece, image, per_side) for piece in zip(x, y, dx, dy, w, dw, strict=True)]
    assert hidden == expected

    point, ray = np.stack([x + 9.0, y + 7.0]), np.flatnonzero(rng.random(300) < 0.7)
    for k in (0, per_side):
        given = point, ray, 1.0 / w[ray], 7, 9, image, k
        np.testing.assert_array_equal(probes.find_unexpected(*given), oracle.find_unexpected(*given))
    doubted = rng.random(sides.shape) < 0.3
    expected = oracle.distrust_fronts(image, per_side, doubted)
    probes.distrust_fronts(image, per_side, doubted)
    np.testing.assert_array_equal(image, expected)


@pytest.mark.parametrize(("rows", "wide"), [(0.3, 0.5), (10.0, 0.3)])
def test_what_is_seen_through_a_gap_is_sampled_anew_or_labelled(rows, wide):
    """A slit of a fifth of a pixel between two panels of some rows of pixels, and booms behind it that all probes miss."""
    lens = Receiver(fov_deg=2.5, f_number=2.8, n_rows=32, n_cols=32)
    pixel_m, middle = lens.pixel_tangent * 150.0, 0.5 if rows < 1.0 else 2.0 / 3.0
    panel = plate(20.0 * pixel_m) * np.array([1.0, rows / 20.0, 1.0])
    shift = np.array([0.0, (0.5 * rows + 0.1) * pixel_m, 0.0])
    booms = np.concatenate(
        [box(wide * pixel_m, pixel_m, 0.01) + np.array([x * pixel_m, 0.0, 0.0]) for x in range(-8, 8)]
    )
    targets = [surface("panels", np.concatenate([panel + shift, panel - shift])), surface("booms", booms)]
    at = place((0.0, middle * pixel_m, 150.0)), place((0.13 * pixel_m, middle * pixel_m, 152.0))
    truth, bright = truth_of(panels=at[0], booms=at[1]), Laser(energy_mj=1e6)
    hits = sampling.cast_pixels(lens, bright, targets, truth)
    true = lattice_photons(targets, truth, lens, bright, 16384)
    got = np.bincount(hits.pixel, optics.pixel_photons(hits, bright, lens) * hits.weight, 32 * 32)
    slit = np.ravel_multi_index((16, np.arange(8, 24)), (32, 32))
    wrong = math.sqrt(((got - true)[slit] ** 2).mean())
    if rows < 1.0:  # much of the frame's light: a second round takes all contours
        assert wrong < 0.003 * true[slit].mean()
    else:  # little of it: no second round, but the label says so
        assert 0.02 * true[slit].mean() < wrong
        assert 0.5 * wrong < math.sqrt(hits.photons_variance.ravel()[slit].mean()) < 2.0 * wrong

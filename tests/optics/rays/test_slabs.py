"""Kernels of line sampling against their oracles: slabs, lines, crossings, rays and variances."""

import math
from itertools import pairwise

import numpy as np
import pytest

from rso_lidar.optics.rays import scan_lines, slabs
from rso_lidar.optics.rays.contour_images import cut_contours
from tests.reference.optics import scan_lines as oracle

ROOM = 128


def draw_pieces(seed, contours, shape=(1, 1)):
    """Return pieces of random contours in pixels, as `cut_contours` does: some short, some upright, some level."""
    rng = np.random.default_rng(seed)
    start = rng.uniform(-0.3, 1.3, (contours, 2)) * shape[::-1]
    ends = np.concatenate(
        [start, start + rng.normal(0.0, rng.choice([0.05, 0.5, 2.0], (contours, 1)), (contours, 2))], 1
    )
    ends[::7, 2], ends[3::7, 3] = ends[::7, 0], ends[3::7, 1]
    return cut_contours(ends, rng.uniform(0.5, 2.0, contours), (0, shape[0], 0, shape[1]))


def choose(pieces, steps, allowed=-1.0, rough=0.2, steep=0.05):
    """Return the edges of the slabs of a pixel, and its variance."""
    edges, room = np.empty(ROOM), np.empty((3, 64))
    count, variance = slabs.choose_slabs(pieces, steps, 0, len(pieces), allowed, rough, steep, edges, room)
    return edges[: count + 1].copy(), variance


@pytest.mark.parametrize("seed", range(40))
def test_slabs_end_where_contours_end(seed):
    _, pieces, steps = draw_pieces(seed, 1 + seed)
    if not len(pieces):
        return
    edges, variance = choose(pieces, steps)
    ends = oracle.find_ends(pieces, 0.05)
    assert edges[0] == 0.0 and edges[-1] == 1.0 and np.diff(edges).min() > 0.0
    assert variance == pytest.approx(oracle.estimate_slabs(pieces, steps, edges), rel=1e-9, abs=1e-12)
    if len(ends) <= 6:
        np.testing.assert_allclose(edges[1:-1], ends, rtol=0, atol=1e-9)
    else:
        assert len(edges) - 1 >= 3
        assert max(np.abs(ends - edge).min() for edge in edges[1:-1]) < 2e-6


@pytest.mark.parametrize("contours", [20, 200])
def test_less_variance_takes_more_slabs(contours):
    _, pieces, steps = draw_pieces(5, contours)
    start = oracle.estimate_slabs(pieces, steps, np.array([0.0, 1.0]))
    found = [choose(pieces, steps, allowed=share * start) for share in (0.1, 0.01, 0.001)]
    counts = [len(edges) - 1 for edges, _ in found]
    assert 3 <= counts[0] < counts[1] < counts[2] <= 66
    for (_, variance), share in zip(found[:2], (0.1, 0.01), strict=True):
        assert variance <= 2.0 * share * start
    dim, dimmer, bright = (
        len(choose(pieces, light * steps, rough=rough)[0]) for light, rough in ((1, 1e-2), (1, 1e-3), (1e3, 1e-3))
    )
    assert dim == dimmer < bright  # a third of photon noise is left in any case


def test_a_pixel_without_contours_is_one_slab():
    edges, variance = choose(np.empty((0, 5)), np.empty(0))
    assert edges.tolist() == [0.0, 1.0] and variance == 0.0


@pytest.mark.parametrize("seed", range(5))
def test_the_variance_of_slabs_is_that_of_the_oracle(seed):
    _, pieces, steps = draw_pieces(seed, 30)
    edges = np.concatenate([[0.0], np.sort(np.random.default_rng(seed).uniform(0.0, 1.0, 2 * seed)), [1.0]])
    got = slabs.estimate_slabs(pieces, steps, 0, len(pieces), edges, len(edges) - 1)
    assert got == pytest.approx(oracle.estimate_slabs(pieces, steps, edges), rel=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_lines_cross_the_contours_that_they_meet(seed):
    _, pieces, _ = draw_pieces(seed, 40)
    row = (np.arange(9.0) + 0.4) / 9.0
    starts, filled, first = np.empty(10, np.int64), np.empty(9, np.int64), np.empty(len(pieces), np.int64)
    room = np.empty(1), np.empty(1, np.int64), (np.empty(1, np.int64), np.empty(1))  # too short, so that it grows
    crossing, by, _ = slabs.cross_lines(pieces, 0, len(pieces), row, 9, starts, filled, first, *room)
    for line in range(9):
        columns, numbers = oracle.cross_line(pieces, row[line])
        np.testing.assert_allclose(crossing[starts[line] : starts[line + 1]], columns, rtol=0, atol=1e-12)
        np.testing.assert_array_equal(by[starts[line] : starts[line + 1]], numbers)


def place(starts, pieces, steps, sides, narrow=0.0):
    """Return the rays of pixels that begin at row 3 and column 4 of 50, as `place_rays` does."""
    allowed = np.full(sides.shape, -1.0)
    return slabs.place_rays(starts, pieces, steps, sides, 3, 4, 50, allowed, 0.2, narrow, 0.05)


@pytest.mark.parametrize("narrow", [0.0, 0.06])
@pytest.mark.parametrize("sides", [1, 2, 5])
@pytest.mark.parametrize(("seed", "contours"), [(0, 3), (1, 12), (2, 60), (3, 600)])
def test_rays_stand_in_the_intervals_between_contours(seed, contours, sides, narrow):
    shape = (2, 3)
    starts, pieces, steps = draw_pieces(seed, contours, shape)
    per_side = np.full(shape, sides)
    per_side[1, 1] = 0
    point, pixel, weight, jump, variance = place(starts, pieces, steps, per_side, narrow)
    assert np.unique(pixel).tolist() == [154, 155, 156, 204, 206]  # but for the pixel in which nothing can be seen
    assert (np.diff(pixel) >= 0).all() and variance[1, 1] == 0.0
    lines = [*np.flatnonzero(jump == slabs.LINE), len(pixel)]
    expected = np.zeros(shape)
    for a, b in pairwise(lines):
        row, col = pixel[a] // 50 - 3, pixel[a] % 50 - 4
        p = 3 * row + col
        own, own_steps = pieces[starts[p] : starts[p + 1]], steps[starts[p] : starts[p + 1]]
        x, y, height = point[0, a:b] - 4 - col, point[1, a] - 3 - row, weight[a:b].sum()
        assert np.ptp(point[1, a:b]) == 0.0 and np.ptp(pixel[a:b]) == 0
        columns, numbers = oracle.cross_line(own, y)
        begins = [*np.flatnonzero((jump[a:b] > 0.0) | (jump[a:b] == slabs.LINE)), b - a]
        edge = np.concatenate([[0.0], np.cumsum(weight[a:b]) / height])[begins]
        least = narrow * np.ptp(columns) if len(columns) > 12 else 0.0
        for k, (i, j) in enumerate(pairwise(begins)):
            left, right = edge[k], edge[k + 1]
            inside = columns[(columns > left + 3e-6) & (columns < right - 3e-6)]
            assert len(inside) == 0 or right - left < 2.0 * least + 1e-6
            if k:
                met = np.abs(columns - left) < 3e-6
                assert met.any() and jump[a + i] >= own_steps[numbers[met]].min() - 1e-12
            assert ((x[i:j] > left) & (x[i:j] < right)).all()
            assert j - i == max(1, math.ceil((right - left) * sides - 2e-6))
            np.testing.assert_allclose(weight[a + i : a + j], weight[a + i], rtol=1e-12)
            assert (jump[a + i + 1 : a + j] == (slabs.PAIR if sides == 2 else slabs.TEXTURE)).all()
            if j - i == 1 and len(inside) == 0:
                assert x[i] == pytest.approx(0.5 * (left + right), abs=3e-6)
        if least == 0.0:
            for one, other in pairwise(range(len(numbers))):
                two = numbers[[one, other]]
                gap = columns[other] - columns[one]
                expected[row, col] += oracle.estimate_meeting(own[two], own_steps[two], gap, y, height)
    for p in (0, 1, 2, 3, 5):
        of = pixel == 50 * (3 + p // 3) + 4 + p % 3
        own = slice(starts[p], starts[p + 1])
        assert weight[of].sum() == pytest.approx(1.0, abs=1e-5)
        first = of & (jump == slabs.LINE)
        height = np.add.reduceat(weight, lines[:-1])[first[lines[:-1]]]
        assert height @ (point[1, first] - 3 - p // 3) == pytest.approx(
            0.5, abs=1e-5
        )  # in the middle of slabs, or pairs
        _, chosen = choose(pieces[own], steps[own])
        if narrow == 0.0 and contours < 600:
            assert variance[p // 3, p % 3] == pytest.approx(chosen + expected[p // 3, p % 3], rel=1e-4, abs=1e-9)
        elif narrow:
            assert variance[p // 3, p % 3] >= chosen


def test_four_rays_integrate_a_pixel_without_contours_to_the_third_degree():
    starts, pieces, steps = draw_pieces(0, 0)
    (x, y), _, weight, jump, _ = place(starts, pieces, steps, np.array([[2]]))
    assert jump.tolist() == [slabs.LINE, slabs.PAIR] * 2
    for degree in range(4):
        assert weight @ (x - 4.0) ** degree == pytest.approx(1.0 / (degree + 1))
        assert weight @ (y - 3.0) ** degree == pytest.approx(1.0 / (degree + 1))


def test_a_grid_has_one_ray_in_each_cell_and_no_two_lines_alike():
    starts, pieces, steps = draw_pieces(0, 0, (2, 2))
    (x, y), _, weight, jump, _ = place(starts, pieces, steps, np.full((2, 2), 5))
    assert (weight == 1.0 / 25.0).all() and (jump == np.tile([-1.0] + [-2.0] * 4, 20)).all()
    assert len(set(zip(np.floor(5 * x), np.floor(5 * y), strict=True))) == len(x) == 100
    np.testing.assert_allclose(np.mod(5 * y, 1.0), 0.5)
    turns = np.sort(np.unique(np.round(np.mod(5 * x, 1.0), 6)))
    assert len(turns) == 20 and np.diff(turns).max() < 0.2  # each line has its own shift, and they fill a cell


def test_the_shift_of_a_pixel_does_not_depend_on_the_window():
    starts, pieces, steps = draw_pieces(0, 0, (2, 2))
    both, pixel, *_ = place(starts, pieces, steps, np.full((2, 2), 3))
    alone, *_ = slabs.place_rays(
        starts[:2], pieces, steps, np.array([[3]]), 4, 5, 50, np.array([[-1.0]]), 0.2, 0.0, 0.05
    )
    np.testing.assert_array_equal(alone, both[:, pixel == 4 * 50 + 5])


@pytest.mark.parametrize(("gap", "height"), [(0.05, 0.4), (0.05, 0.9), (0.2, 0.3), (0.0, 0.5)])
def test_contours_that_may_meet(gap, height):
    pieces = np.array([[0.1, 0.0, 0.9, 0.8, 1.0], [0.7, 0.1, 0.25, 1.0, -0.5]])
    steps = np.array([3.0, 2.0])
    got = slabs.estimate_meeting(pieces, steps, 0, 1, gap, 0.55, height)
    assert got == pytest.approx(oracle.estimate_meeting(pieces, steps, gap, 0.55, height), rel=1e-6, abs=1e-15)
    assert (got > 0.0) == (1.5 * min(0.5 * height, 0.45) > gap)


@pytest.mark.parametrize("seed", range(4))
def test_what_rays_met_corrects_the_variance(seed):
    rng = np.random.default_rng(seed)
    jumps = [
        [slabs.LINE, slabs.PAIR, slabs.LINE, slabs.PAIR],
        [slabs.LINE, 2.0, 0.5, slabs.LINE, 1.0, 0.0, 3.0],
        [slabs.LINE, slabs.TEXTURE, slabs.TEXTURE, slabs.LINE, slabs.TEXTURE, 0.7],
        [slabs.LINE],
    ]
    pixel = np.repeat([2, 5, 6, 9], [len(jump) for jump in jumps]).astype(np.int32)
    rays = np.stack([rng.uniform(0.05, 0.3, len(pixel)), np.concatenate(jumps), rng.uniform(0.0, 3.0, len(pixel))], 1)
    variance, seen, photons = rng.uniform(0.5, 1.0, 10), np.zeros(10), np.zeros(10)
    before = variance.copy()
    scan_lines.correct_variance(pixel, *map(np.ascontiguousarray, rays.T), variance, seen, photons, 0.35, 0.3, 0.1)
    for p in range(10):
        of = pixel == p
        expected = oracle.correct_variance(rays[of], before[p], 0.35, 0.3, 0.1) if of.any() else (before[p], 0.0, 0.0)
        np.testing.assert_allclose((variance[p], seen[p], photons[p]), expected, rtol=1e-12)

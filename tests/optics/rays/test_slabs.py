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
    steps, sides = rng.uniform(0.5, 2.0, contours), np.ones(shape, np.int64)
    return cut_contours(ends, steps, np.ones((contours, 2)), sides, 0, 0, np.empty((4, 0, 0)), 0)


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
    assert (first == [np.sum(row <= upper) for upper in pieces[:, 1]]).all()


def expect(pieces, steps, row):
    """Return the change of light that is expected from line to line."""
    row, lines = np.asarray(row), len(row)
    starts, filled, first = np.empty(lines + 1, np.int64), np.empty(lines, np.int64), np.empty(len(pieces), np.int64)
    room = np.empty(1), np.empty(1, np.int64), (np.empty(1, np.int64), np.empty(1))
    slabs.cross_lines(pieces, 0, len(pieces), row, lines, starts, filled, first, *room)
    expected, greatest = np.empty(lines), np.empty(lines)
    slabs.expect_changes(pieces, steps, 0, len(pieces), row, lines, first, expected, greatest)
    return expected


@pytest.mark.parametrize("contours", [1, 3, 40])
@pytest.mark.parametrize("seed", range(5))
def test_changes_from_line_to_line_are_those_of_the_oracle(seed, contours):
    _, pieces, steps = draw_pieces(seed, contours)
    row = np.sort(np.random.default_rng(seed).uniform(0.0, 1.0, 9))
    np.testing.assert_allclose(expect(pieces, steps, row), oracle.expect_changes(pieces, steps, row), rtol=1e-9)


def test_the_mean_light_of_lines_changes_as_expected_unless_contours_may_cancel():
    edge = np.array([0.1, 0.0, 0.7, 1.0, 0.6])
    other = np.array([0.2, 0.0, 0.8, 1.0, 0.6])
    weak = np.array([0.5, 0.2, 0.9, 1.0, 0.5])
    row = [0.25, 0.5, 1.0]
    step = [0.0, 3.0 * 0.6 * 0.25, 3.0 * 0.6 * 0.5]  # dark to the left of the edge, 3 photons to the right
    np.testing.assert_allclose(expect(np.array([edge]), np.array([3.0]), row), step)
    assert expect(np.array([edge, other]), np.array([3.0, 3.0]), row).tolist() == [0.0, slabs.UNKNOWN, slabs.UNKNOWN]
    both = expect(np.array([edge, weak]), np.array([3.0, 0.5]), row)
    np.testing.assert_allclose(both, np.hypot(step, [0.0, 0.5 * 0.5 * 0.25, 0.5 * 0.5 * 0.5]))
    assert expect(np.array([[0.2, 0.4, 0.9, 0.4, 0.0]]), np.array([2.0]), row)[1:] == pytest.approx([1.4, 0.0])


def place(starts, pieces, steps, sides, narrow=0.0):
    """Return the rays of pixels that begin at row 3 and column 4 of 50, as `place_rays` does."""
    allowed = np.full(sides.shape, -1.0)
    return slabs.place_rays(starts, pieces, steps, sides, 3, 4, 50, allowed, 0.2, narrow, 0.05, True)


@pytest.mark.parametrize("narrow", [0.0, 0.06])
@pytest.mark.parametrize("sides", [1, 2, 5])
@pytest.mark.parametrize(("seed", "contours"), [(0, 3), (1, 12), (2, 60), (3, 600)])
def test_rays_stand_in_the_intervals_between_contours(seed, contours, sides, narrow):
    shape = (2, 3)
    starts, pieces, steps = draw_pieces(seed, contours, shape)
    per_side = np.full(shape, sides)
    per_side[1, 1] = 0
    point, pixel, weight, side, kind, change, variance = place(starts, pieces, steps, per_side, narrow)
    assert np.unique(pixel).tolist() == [154, 155, 156, 204, 206]  # but for the pixel in which nothing can be seen
    assert (np.diff(pixel) >= 0).all() and variance[1, 1] == 0.0
    begins_interval = (kind == slabs.LINE) | (kind == slabs.CONTOUR)
    assert (kind[~begins_interval] == (slabs.PAIR if sides == 2 else slabs.TEXTURE)).all()
    assert (change[~begins_interval] == 0.0).all()
    lines = [*np.flatnonzero(kind == slabs.LINE), len(pixel)]
    expected = np.zeros(shape)
    for a, b in pairwise(lines):
        row, col = pixel[a] // 50 - 3, pixel[a] % 50 - 4
        p = 3 * row + col
        own, own_steps = pieces[starts[p] : starts[p + 1]], steps[starts[p] : starts[p + 1]]
        x, y, height = point[0, a:b] - 4 - col, point[1, a] - 3 - row, weight[a:b].sum()
        assert np.ptp(pixel[a:b]) == 0
        if len(own) == 0 and sides > 2:  # such rays are shifted within their cells
            assert np.ptp(point[1, a:b]) < height
        else:
            assert np.ptp(point[1, a:b]) == 0.0
        np.testing.assert_allclose(side[a:b] ** 2, 0.5 * ((weight[a:b] / height) ** 2 + height**2))
        columns, numbers = oracle.cross_line(own, y)
        begins = [*np.flatnonzero(begins_interval[a:b]), b - a]
        edge = np.concatenate([[0.0], np.cumsum(weight[a:b]) / height])[begins]
        least = narrow * np.ptp(columns) if len(columns) > 12 else 0.0
        for k, (i, j) in enumerate(pairwise(begins)):
            left, right = edge[k], edge[k + 1]
            inside = columns[(columns > left + 3e-6) & (columns < right - 3e-6)]
            assert len(inside) == 0 or right - left < 2.0 * least + 1e-6
            if k:
                assert np.abs(columns - left).min() < 3e-6
                passed = (columns > left - 3e-6) & (columns < right - 3e-6)  # several, if intervals share the ray
                assert change[a + i] == own_steps[numbers[passed]].max()
            assert ((x[i:j] > left) & (x[i:j] < right)).all()
            assert j - i == max(1, math.ceil((right - left) * sides - 2e-6))
            np.testing.assert_allclose(weight[a + i : a + j], weight[a + i], rtol=1e-12)
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
        first = of & (kind == slabs.LINE)
        if starts[p + 1] > starts[p] or sides <= 2:
            height = np.add.reduceat(weight, lines[:-1])[first[lines[:-1]]]
            row = point[1, first] - 3 - p // 3
            assert height @ row == pytest.approx(0.5, abs=1e-5)  # in the middle of slabs, or pairs
            np.testing.assert_allclose(
                change[first], oracle.expect_changes(pieces[own], steps[own], row), rtol=1e-6, atol=1e-9
            )
        else:
            assert (change[first] == 0.0).all()
        _, chosen = choose(pieces[own], steps[own])
        if narrow == 0.0 and contours < 600:
            assert variance[p // 3, p % 3] == pytest.approx(chosen + expected[p // 3, p % 3], rel=1e-4, abs=1e-9)
        elif narrow:
            assert variance[p // 3, p % 3] >= chosen


def test_four_rays_integrate_a_pixel_without_contours_to_the_first_degree():
    starts, pieces, steps = draw_pieces(0, 0)
    (x, y), _, weight, side, kind, change, _ = place(starts, pieces, steps, np.array([[2]]))
    assert kind.tolist() == [slabs.LINE, slabs.PAIR] * 2 and not change.any()
    np.testing.assert_allclose(side, 0.5)
    for degree in range(2):
        assert weight @ (x - 4.0) ** degree == pytest.approx(1.0 / (degree + 1))
        assert weight @ (y - 3.0) ** degree == pytest.approx(1.0 / (degree + 1))


def test_a_grid_has_one_ray_in_each_cell_and_no_two_lines_alike():
    starts, pieces, steps = draw_pieces(0, 0, (2, 2))
    (x, y), _, weight, side, kind, change, _ = place(starts, pieces, steps, np.full((2, 2), 5))
    assert (weight == 1.0 / 25.0).all() and not change.any()
    assert (kind == np.tile([slabs.LINE] + [slabs.TEXTURE] * 4, 20)).all()
    np.testing.assert_allclose(side, 0.2)
    assert len(set(zip(np.floor(5 * x), np.floor(5 * y), strict=True))) == len(x) == 100
    for at in (x, y):
        np.testing.assert_allclose(np.mod(at, 1.0).reshape(4, 25).mean(axis=1), 0.5)  # so that no range is biased
        for pixel in np.mod(at, 1.0).reshape(4, 25):
            np.testing.assert_allclose(np.sort(pixel), (np.arange(25) + 0.5) / 25.0)  # no two at one column or row


def test_the_shift_of_a_pixel_does_not_depend_on_the_window():
    starts, pieces, steps = draw_pieces(0, 0, (2, 2))
    both, pixel, *_ = place(starts, pieces, steps, np.full((2, 2), 3))
    alone, *_ = slabs.place_rays(
        starts[:2], pieces, steps, np.array([[3]]), 4, 5, 50, np.array([[-1.0]]), 0.2, 0.0, 0.05, True
    )
    np.testing.assert_array_equal(alone, both[:, pixel == 4 * 50 + 5])


@pytest.mark.parametrize(("gap", "height"), [(0.05, 0.4), (0.05, 0.9), (0.2, 0.3), (0.0, 0.5)])
def test_contours_that_may_meet(gap, height):
    pieces = np.array([[0.1, 0.0, 0.9, 0.8, 1.0], [0.7, 0.1, 0.25, 1.0, -0.5]])
    steps = np.array([3.0, 2.0])
    got = slabs.estimate_meeting(pieces, steps, 0, 1, gap, 0.55, height)
    assert got == pytest.approx(oracle.estimate_meeting(pieces, steps, gap, 0.55, height), rel=1e-6, abs=1e-15)
    assert (got > 0.0) == (1.5 * min(0.5 * height, 0.45) > gap)


KINDS = {"line": slabs.LINE, "contour": slabs.CONTOUR, "pair": slabs.PAIR, "texture": slabs.TEXTURE}
PIXELS = {  # how rays follow each other, and the change of light that is expected
    2: [("line", 0.0), ("pair", 0.0), ("line", 0.0), ("pair", 0.0)],
    3: [("line", 0.0), ("contour", 2.0), ("line", slabs.UNKNOWN), ("contour", 1.0), ("contour", 1.5)],
    5: [("line", 0.0), ("contour", 2.0), ("line", 1.3), ("contour", 1.0), ("line", slabs.UNKNOWN), ("line", 2.5)],
    6: [("line", 0.0), *[("texture", 0.0)] * 2, ("line", 0.0), ("texture", 0.0), ("contour", 0.7), ("line", 0.4)],
    7: [("line", 0.0), ("contour", 3.0), ("contour", 0.5)],
    8: [("line", 0.0), ("line", 1e-2)],
    9: [("line", 0.0)],
}
CALIBRATION = 0.35, 0.3, 0.1, 0.15


def correct(pixels, weight, light, variance, is_unexpected=None):
    """Return the variance, the factor on it and the photons of pixels, whose numbers and rays are those of `PIXELS`."""
    rays = [ray for of in pixels.values() for ray in of]
    pixel = np.repeat(np.array([*pixels], np.int32), [len(of) for of in pixels.values()])
    kind, change = np.array([KINDS[name] for name, _ in rays], np.int8), np.array([change for _, change in rays])
    seen, photons, variance = np.zeros(10), np.zeros(10), np.array(variance)
    if is_unexpected is None:
        is_unexpected = np.zeros(len(rays), np.bool_)
    scan_lines.correct_variance(pixel, weight, kind, change, light, is_unexpected, variance, seen, photons, CALIBRATION)
    return pixel, variance, seen, photons


@pytest.mark.parametrize("seed", range(4))
def test_what_rays_met_corrects_the_variance(seed):
    rng, rays = np.random.default_rng(seed), [ray for of in PIXELS.values() for ray in of]
    kind, change = np.array([name for name, _ in rays]), np.array([change for _, change in rays])
    weight, light, before = (
        rng.uniform(0.05, 0.3, len(rays)),
        rng.uniform(0.0, 3.0, len(rays)),
        rng.uniform(0.5, 1.0, 10),
    )
    is_unexpected = rng.random(len(rays)) < 0.2
    pixel, *got = correct(PIXELS, weight, light, before, is_unexpected)
    for p in range(10):
        of, expected = pixel == p, (before[p], 0.0, 0.0)
        if of.any():
            columns = (values[of] for values in (weight, kind, change, light, is_unexpected))
            expected = oracle.correct_variance(*columns, before[p], CALIBRATION)
        np.testing.assert_allclose([values[p] for values in got], expected, rtol=1e-12)
    assert got[1][8] == pytest.approx(3.0 * 0.35)  # 100 times the change that is expected counts as the root of 3


def test_hidden_contours_leave_no_error():
    """Of lines that are all alike, however many contours are on them and wherever contours are expected between them."""
    pixels = {0: PIXELS[5], 1: PIXELS[6], 2: PIXELS[7]}
    n = sum(map(len, pixels.values()))
    _, variance, seen, photons = correct(pixels, np.full(n, 0.125), np.full(n, 4.0), np.ones(10))
    assert (variance[:3] == 0.0).all() and (seen[:3] == 0.0).all()
    np.testing.assert_allclose(photons[:3], [3.0, 3.5, 1.5])

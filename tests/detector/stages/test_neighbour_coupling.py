"""Crosstalk in amplitude: the shares of neighbours, against loops over pixels, and which pixels get rows."""

import math

import numpy as np
import pytest

from rso_lidar.detector import AmplitudeCrosstalk, Gsfl
from rso_lidar.detector.chain.timing import plan_time
from rso_lidar.detector.stages.neighbour_coupling import (
    NeighbourCoupling,
    _merge_light,
    couple_rows,
    gather_light,
    list_neighbours,
)
from rso_lidar.detector.stages.time_axis import place_rows
from rso_lidar.errors import ScenarioError
from tests.detector.returns_for_tests import nothing, returns
from tests.reference.detector import neighbour_coupling as reference

PLAN = plan_time(Gsfl(), 8e-9)
SHAPE = (6, 7)
PIXELS = SHAPE[0] * SHAPE[1]


def scattered(seed=3, n=60):
    """Return light of random pixels, several returns in some of them, a few metres or a kilometre apart."""
    rng = np.random.default_rng(seed)
    pixel = np.sort(rng.integers(0, PIXELS, n))
    range_m = 500.0 + rng.choice([0.0, 3.0, 7.0, 1000.0], n) + rng.uniform(0.0, 2.0, n)
    order = np.lexsort((range_m, pixel))
    return returns(range_m[order], rng.uniform(10.0, 1e4, n), pixel[order], SHAPE, cluster=np.arange(n))


def test_levels_hold_at_whole_distances_and_lie_on_straight_lines_between():
    offset, factor = list_neighbours(AmplitudeCrosstalk(levels_db=(-20.0, -40.0)))
    level_db = {tuple(map(int, at)): 20.0 * math.log10(f) for at, f in zip(offset, factor, strict=True)}
    assert len(level_db) == 12  # none at (1, 2): its distance is 2.24
    assert level_db[0, 1] == level_db[-1, 0] == pytest.approx(-20.0)
    assert level_db[2, 0] == pytest.approx(-40.0)
    assert level_db[1, -1] == pytest.approx(-20.0 - 20.0 * (math.sqrt(2.0) - 1.0))


@pytest.mark.parametrize(("along", "same"), [("rows", 0), ("columns", 1)])
def test_along_rows_or_columns_only_those_couple(along, same):
    offset, factor = list_neighbours(AmplitudeCrosstalk(along=along))
    assert len(offset) == 8 and not offset[:, same].any()
    assert sorted(np.abs(offset[:, 1 - same])) == [1, 1, 2, 2, 3, 3, 4, 4]
    near, far = factor[np.abs(offset).max(axis=1) == 1], factor[np.abs(offset).max(axis=1) == 4]
    assert near == pytest.approx([0.01, 0.01]) and far == pytest.approx([0.001, 0.001])


def test_rows_couple_as_a_loop_over_pixels_and_steps_says():
    rows = place_rows(scattered(), PLAN)
    coupling = NeighbourCoupling.of(AmplitudeCrosstalk(levels_db=(-6.0, -10.0, -20.0)), rows, SHAPE)
    follows = np.flatnonzero(np.diff(rows.pixel) == 0)
    assert (coupling.end[follows] < rows.start[follows] + rows.length).any()  # some overlap, and ...
    assert (coupling.end[follows] < rows.start[follows + 1]).any()  # ... some are far apart
    signal = np.random.default_rng(5).standard_normal((len(rows.pixel), rows.length), dtype=np.float32)
    every = np.arange(len(rows.pixel))
    by_kernel = coupling.add(signal, every)
    assert by_kernel == pytest.approx(reference.couple_rows(coupling, signal), abs=1e-5)
    assert np.array_equal(by_kernel[::3], coupling.add(signal, every[::3]))
    assert len(couple_rows.dispatcher.signatures) == 1


@pytest.mark.parametrize("most", [math.inf, 100.0])
def test_light_merges_as_a_loop_over_returns_says(most):
    photons = scattered()
    number = (photons.delay_s / 8e-9).astype(np.int64)
    number -= number.min()
    light = np.stack([photons.photons, photons.delay_s - 1e-9, photons.delay_s + 1e-9])
    offset, factor = list_neighbours(AmplitudeCrosstalk(levels_db=(-20.0, -40.0)))
    neighbours = np.concatenate([[[0, 0]], offset]), np.concatenate([[1.0], factor])
    given = photons.pixel, number, light, SHAPE, neighbours, 5.0, most
    pixel, of, merged = _merge_light(*given)
    expected = reference.merge_bins(*given)
    assert list(zip(pixel.tolist(), of.tolist(), strict=True)) == list(expected)
    assert merged.T == pytest.approx(np.array(list(expected.values())), rel=1e-12)


def test_without_neighbours_rows_stay_where_they_are():
    """Far-apart pixels: merging returns of a pixel changes no row, and dark pixels get one where enough couples."""
    photons = returns(np.array([500.0, 500.4, 1500.0]), 1e4, np.array([0, 0, 5]), SHAPE, cluster=np.arange(3))
    alone = gather_light(AmplitudeCrosstalk(levels_db=(-199.0,)), photons, 1.0, math.inf)
    for name in ("pixel", "start", "first", "last"):
        assert np.array_equal(getattr(place_rows(alone, PLAN), name), getattr(place_rows(photons, PLAN), name)), name
    seen = gather_light(AmplitudeCrosstalk(levels_db=(-40.0,)), photons, 1.0, math.inf)
    assert set(place_rows(seen, PLAN).pixel) == {0, 1, 7, 8, 5, 4, 6, 12, 11, 13} - {8, 11, 13}
    assert gather_light(AmplitudeCrosstalk(), nothing(SHAPE), 1.0, math.inf).pixel.size == 0
    black = returns(500.0, 0.0, np.array([3]), SHAPE)
    assert gather_light(AmplitudeCrosstalk(), black, 1.0, math.inf).photons.sum() == 0.0


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"levels_db": (40.0,)}, "levels_db"),
        ({"levels_db": ()}, "levels_db"),
        ({"levels_db": (-40.0,) * 17}, "levels_db"),
        ({"levels_db": (float("nan"),)}, "levels_db"),
        ({"preset": "pixell", "levels_db": (-40.0,)}, "leave one out"),
        ({"preset": "pixel"}, "preset"),
        ({"along": "row"}, "along"),
    ],
)
def test_what_makes_no_sense_is_refused_by_name(given, said):
    with pytest.raises(ScenarioError, match=said):
        Gsfl(amplitude_crosstalk=given)

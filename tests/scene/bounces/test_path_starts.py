"""Starts of paths: against NumPy, even by area, and with the facets that files name."""

import numpy as np
import pytest

from rso_lidar.kernels import packed
from rso_lidar.optics import Laser, Receiver, pixel_rays
from rso_lidar.scene import cast, engine, extent
from rso_lidar.scene.bounces.path_starts import draw_numbers, number_facets, spread_paths, start_paths
from rso_lidar.scene.casting.first_hits import find_first_hits
from tests.optics.bench_for_tests import box, place, sphere, surface, truth_of
from tests.reference.scene import path_starts as reference

KEY = np.array([5, 9], np.uint32)
LENS = Receiver(fov_deg=6, f_number=2.8, n_rows=12, n_cols=12, rays_per_pixel=16, min_rays_per_target=0)


def some_hits():
    targets = surface("box", box(1.0, 1.5, 2.0)), surface("ball", sphere(0.5, 2))
    truth = truth_of(box=place((0.4, 0, 30)), ball=place((-0.5, 0.1, 29)))
    rays = pixel_rays(LENS, Laser(divergence_deg=60), extent(targets, truth))
    return cast(rays, targets, truth, 1), targets, find_first_hits(rays, targets, truth, 1, engine())


def test_paths_are_those_of_numpy():
    pixel = np.sort(np.random.default_rng(2).integers(0, 40, 500))
    area = np.random.default_rng(3).random(500) * (pixel % 3 > 0)
    hit, uniform = spread_paths(packed(pixel), packed(area), 3.7, KEY, 5000)
    expected_hit, expected_uniform = reference.spread_paths(pixel, area, 3.7, KEY)
    np.testing.assert_array_equal(hit, expected_hit)
    np.testing.assert_allclose(uniform, expected_uniform, atol=1e-9)


def test_paths_are_spread_evenly_by_area():
    hits, _, _ = some_hits()
    can = hits.target == 0
    hit, uniform, share = start_paths(hits, can, KEY, 3000)
    assert can[hit].all() and (np.diff(hit) >= 0).all()
    assert abs(len(hit) - 3000) < 3 * np.sqrt(len(np.unique(hits.pixel)))
    assert share == pytest.approx(hits.weight[can].sum() / 3000, rel=1e-12)
    of_pixel = np.bincount(hits.pixel[hit], minlength=144) * share
    area = np.bincount(hits.pixel[can], hits.weight[can], minlength=144)
    assert np.abs(of_pixel - area).max() <= share * (1 + 1e-9), "systematic sampling is off by less than one path"
    assert 0.0 <= uniform.min() and uniform.max() < 1.0
    assert np.abs(uniform.mean(axis=1) - 0.5).max() < 0.02


def test_no_path_starts_where_none_can_go():
    hits, _, _ = some_hits()
    hit, uniform, share = start_paths(hits, np.zeros(len(hits.ray), bool), KEY, 3000)
    assert len(hit) == 0 and uniform.shape == (3, 0) and share == 0.0


def test_facets_are_found_by_their_number_in_the_file():
    hits, targets, first = some_hits()
    number, facet = number_facets(hits, targets)
    np.testing.assert_array_equal(number, first.number)
    np.testing.assert_array_equal(facet, first.facet)


def test_numbers_of_further_directions_are_those_of_their_address():
    pixel, key = np.array([3, 3, 3, 7, 9, 9], np.int32), np.array([5, 6], np.uint32)
    found = {turn: np.empty((3, 6)) for turn in (1, 2)}
    for turn, numbers in found.items():
        draw_numbers(pixel, key, turn, numbers)
        np.testing.assert_array_equal(numbers, reference.draw_numbers(pixel, key, turn))
    assert len(np.unique(np.concatenate([*found.values()]))) == 36

"""Edges that one sees, of solids whose edges are known."""

import numpy as np
import pytest

from rso_lidar.picture import Shape
from rso_lidar.picture.viewers.shape import MOST_EDGES

CUBE = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
SIDES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
FACETS = np.array([(a, b, c) for a, b, c, _ in SIDES] + [(a, c, d) for a, _, c, d in SIDES])


def cube(**changes):
    return Shape("box", CUBE[changes.get("facets", FACETS)])


def test_a_cube_has_twelve_edges_and_no_diagonals():
    edges = cube().edges_m
    assert edges.shape == (12, 2, 3)
    assert np.linalg.norm(edges[:, 1] - edges[:, 0], axis=-1) == pytest.approx(2.0)
    assert cube().radius_m == pytest.approx(np.sqrt(3.0))


def test_winding_tells_nothing():
    facets = FACETS.copy()
    facets[::3] = facets[::3, ::-1]
    assert len(cube(facets=facets).edges_m) == 12


def test_corners_a_hair_apart_are_one():
    corners = cube().corners_m + np.random.default_rng(1).normal(0, 1e-9, (12, 3, 3))
    shape = Shape("box", corners + 1e-7)  # off the edges of the grid that tells what is one
    assert len(shape.edges_m) == 12


def test_an_open_sheet_ends_at_its_rim():
    sheet = Shape(
        "sheet", np.array([[[0, 0, 0], [2, 0, 0], [2, 1, 0]], [[0, 0, 0], [2, 1, 0], [0, 1, 0]]], dtype=float)
    )
    lengths = np.linalg.norm(sheet.edges_m[:, 1] - sheet.edges_m[:, 0], axis=-1)
    assert lengths.tolist() == pytest.approx([2, 2, 1, 1])  # the longest first; not the diagonal


def test_a_round_body_of_many_facets_has_no_edges_and_its_rim_few():
    turn = np.linspace(0, 2 * np.pi, 73)
    low, high = (np.stack([np.cos(turn), np.sin(turn), np.full(73, z)], axis=-1) for z in (0.0, 3.0))
    walls = np.concatenate(
        [np.stack(c, axis=1) for c in ((low[:-1], low[1:], high[1:]), (low[:-1], high[1:], high[:-1]))]
    )
    edges = Shape("tube", walls).edges_m
    assert len(edges) == 2 * 72  # the two rims; the walls bend by 5 degrees from strip to strip


def test_a_needle_without_area_and_nothing_at_all_do_no_harm():
    needle = Shape("needle", np.array([[[0, 0, 0], [1, 0, 0], [1, 0, 0]]], dtype=float))
    assert np.isfinite(needle.normals).all()
    assert needle.edges_m.shape[1:] == (2, 3)
    assert Shape("nothing", np.zeros((0, 3, 3))).edges_m.shape == (0, 2, 3)
    assert Shape("nothing", np.zeros((0, 3, 3))).radius_m == 0


def test_only_the_longest_are_kept():
    steps = np.arange(2000.0)[:, None, None]
    combs = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]]) * (1 + 1e-3 * steps) + steps * np.array([0, 0, 1.0])
    edges = Shape("comb", combs).edges_m
    lengths = np.linalg.norm(edges[:, 1] - edges[:, 0], axis=-1)
    assert len(edges) == MOST_EDGES
    assert (np.diff(lengths) <= 1e-9).all()


def test_the_target_of_a_hinge():
    assert Shape("tdrs.array", CUBE[FACETS]).target == Shape("tdrs", CUBE[FACETS]).target == "tdrs"

import numpy as np
import pytest
from scipy.spatial import ConvexHull, Delaunay
from scipy.spatial.transform import Rotation

from rso_lidar import scene
from rso_lidar.scene.surfaces.pieces import find_pieces
from tests.optics.bench_for_tests import box, place, plate, sphere, surface, truth_of

BAR = np.array([[[0, 0, 0], [1, 1e-3, 0], [1, 0, 1e-3]]], dtype=float)
SHAPES = {
    "two boxes": np.concatenate([box(1, 1, 1), box(2, 0.5, 1) + np.array([8, 3, 1])]),
    "sphere": sphere(2.0, 4),
    "flat": plate(6, n=8) @ Rotation.from_euler("xyz", [0.3, 0.4, 0.5]).as_matrix(),
    "one facet": BAR,
    "wings": np.concatenate([box(1, 1, 2), plate(12, 1, n=6)]),
    "many": np.concatenate([box(0.4, 0.3, 0.5) + p for p in np.random.default_rng(2).uniform(-5, 5, (24, 3))]),
}


def hulls(surface_of):
    found = find_pieces(surface_of)
    return [found.points[a:b] for a, b in zip(found.starts[:-1], found.starts[1:], strict=True)]


@pytest.mark.parametrize("name", SHAPES)
def test_each_facet_is_seen_inside_an_outline(name):
    """From anywhere, to rounding: what lies outside all outlines cannot be hit."""
    target = surface("target", SHAPES[name])
    rng = np.random.default_rng(3)
    for _ in range(5):
        pose = place(rng.uniform([-5, -5, 30], [5, 5, 90]), Rotation.random(rng=rng))
        outlines = scene.extent([target], truth_of(target=pose)).outlines[0]
        seen = pose.apply(target.corners.reshape(-1, 3))
        seen = (seen[:, :2] / seen[:, 2:]).reshape(-1, 3, 1, 2)
        held = np.zeros(len(target.corners), bool)
        for outline in outlines:
            side = np.roll(outline, -1, axis=0) - outline
            off = seen - outline
            turn = side[:, 0] * off[..., 1] - side[:, 1] * off[..., 0]  # (facet, corner, side): left of all sides
            held |= (turn >= -1e-9 * np.abs(side).max()).all(axis=(1, 2))
        assert held.all()


@pytest.mark.parametrize("name", ["two boxes", "wings", "many"])
def test_each_facet_lies_in_the_hull_of_a_piece(name):
    target = surface("target", SHAPES[name])
    inside = np.zeros(len(target.corners), bool)
    middle = target.sphere[0]
    for hull in hulls(target):
        grown = hull if np.ptp(hull, axis=0).min() > 1e-9 else np.concatenate([hull - 1e-6, hull + 1e-6])
        grown = hull.mean(axis=0) + (grown - hull.mean(axis=0)) * (1 + 1e-6)
        inside |= (Delaunay(grown).find_simplex(target.corners) >= 0).all(axis=1)
    assert inside.all(), f"{(~inside).sum()} facets outside, about {middle}"


def test_what_is_apart_is_split_and_what_is_not_stays_whole():
    assert len(hulls(surface("target", SHAPES["two boxes"]))) == 2
    assert len(hulls(surface("target", SHAPES["many"]))) > 20
    for name in ("sphere", "flat", "one facet"):
        assert len(hulls(surface("target", SHAPES[name]))) == 1
    # Boxes of 1 and 2 x 0.5 x 1: the areas of their hulls are those of the boxes themselves.
    areas = sorted(ConvexHull(hull).area for hull in hulls(surface("target", SHAPES["two boxes"])))
    assert areas == pytest.approx([6.0, 7.0], rel=1e-12)


def test_a_round_body_has_few_corners_and_grows_little():
    """2562 corners become some 130 of a body a few per cent larger, in no direction smaller."""
    found = find_pieces(surface("target", SHAPES["sphere"])).points
    assert len(found) < 160
    directions = Rotation.random(500, rng=np.random.default_rng(1)).apply([1.0, 0.0, 0.0])
    reach = np.einsum("pi,di->dp", found, directions).max(axis=1)
    there = np.einsum("pi,di->dp", SHAPES["sphere"].reshape(-1, 3), directions).max(axis=1)
    assert np.all(reach >= there) and reach.max() < 1.06 * 2.0


def test_pieces_are_found_once():
    target = surface("target", SHAPES["wings"])
    assert find_pieces(target) is find_pieces(target)

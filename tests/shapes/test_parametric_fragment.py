"""Fragments from seeds: closed, of the size asked for, and always the same."""

import math

import numpy as np
import pytest
import trimesh

from rso_lidar.errors import ScenarioError
from rso_lidar.shapes import fragment

KINDS = ("plate", "shard", "panel", "foil")


@pytest.mark.parametrize("kind", KINDS)
def test_fragments_are_closed_bodies_of_the_size_asked_for(kind):
    for seed in range(12):
        model = fragment(seed, 0.37, kind)
        assert model.size_m[0] == pytest.approx(0.37, abs=1e-12)
        assert np.all(np.diff(model.size_m) <= 0.0), "longest along x, thinnest along z"
        for part, solid in model.parts.items():
            mesh = trimesh.Trimesh(*solid, process=False)
            assert mesh.is_watertight, (seed, part)
            assert mesh.is_winding_consistent, (seed, part)
            assert mesh.area_faces.min() > 0.0, (seed, part)
            assert solid.volume_m3() > 0.0, (seed, part)
        assert 0.0 < model.mass_kg < 2700.0 * np.prod(model.size_m)  # less than a block of aluminium


def test_a_seed_always_makes_the_same_fragment_and_another_makes_another():
    for kind in KINDS:
        first, again, other = fragment(3, 0.5, kind), fragment(3, 0.5, kind), fragment(4, 0.5, kind)
        for part in first.parts:
            assert np.array_equal(first.parts[part].vertices, again.parts[part].vertices)
        assert any(
            a.vertices.shape != b.vertices.shape or not np.allclose(a.vertices, b.vertices)
            for a, b in zip(first.parts.values(), other.parts.values(), strict=False)
        )


def test_a_fragment_grows_in_all_directions():
    small, large = fragment(8, 0.1, "plate"), fragment(8, 1.0, "plate")
    assert large.parts["skin"].vertices == pytest.approx(10.0 * small.parts["skin"].vertices, abs=1e-12)
    assert large.mass_kg == pytest.approx(1000.0 * small.mass_kg, rel=1e-9)
    assert (small.taxonomy.size_class, large.taxonomy.size_class) == ("small", "medium")


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (
            (1, 0.3, "plat"),
            r"^fragment: unknown kind 'plat'; did you mean 'plate'\? \(known: plate, shard, panel, foil\)$",
        ),
        ((1, 0.0, "plate"), r"^fragment: longest_m is 0\.0; give a length above 0 m$"),
        ((1, math.nan, "plate"), r"^fragment: longest_m is nan; give a length above 0 m$"),
        ((-1, 0.3, "plate"), r"^fragment: seed is -1; give a whole number of 0 or more$"),
    ],
)
def test_a_fragment_that_cannot_be_is_one_line(arguments, line):
    with pytest.raises(ScenarioError, match=line):
        fragment(*arguments)

"""Fragments of a break-up: closed bodies of the size asked for, the same on every machine, with the mass of the model."""

import json
import os
import subprocess
import sys
from typing import get_args

import numpy as np
import pytest
import trimesh
from scipy import stats
from scipy.spatial.distance import pdist

from rso_lidar.errors import ScenarioError
from rso_lidar.records import FragmentKind
from rso_lidar.shapes import breakup_fragment, hash_solid
from rso_lidar.shapes.breakup import draw_area_to_mass
from rso_lidar.shapes.torn_sheets import sine_cosine
from tests.processor import other_processor

KINDS = get_args(FragmentKind)
PINNED = [
    "0735077d",
    "c422d84e",
    "e73f3cd0",
    "3389ad02",
    "62755b96",
    "cdb02235",
    "093f9e9a",
    "d0014ebe",
    "931610bb",
    "318b16a0",
    "159d073f",
    "564bfa09",
]
HASHES = """
import json
from rso_lidar.shapes.breakup import breakup_fragment, hash_solid
made = [breakup_fragment(kind, seed, 0.3).parts["fragment"] for kind in {kinds} for seed in (0, 1)]
print(json.dumps([hash_solid(one) for one in made]))
"""
NM = 1e-9  # [m]; vertices are rounded to it


def fragment(kind, seed, length_m=0.3):
    """Return a fragment, and its only part."""
    made = breakup_fragment(kind, seed, length_m)
    return made, made.pieces["fragment"]


@pytest.mark.parametrize("kind", KINDS)
def test_fragments_are_closed_bodies_about_their_centre_of_mass(kind):
    for seed in range(6):
        made, part = fragment(kind, seed)
        mesh = trimesh.Trimesh(part.solid.vertices, part.solid.facets, process=False)
        assert mesh.is_watertight and mesh.is_winding_consistent and mesh.volume > 0.0
        assert np.abs(mesh.center_mass).max() < 100.0 * NM  # of sheets that are not much thicker than the rounding
        x, y, z = made.size_m
        assert x > y > z > 0.0
        assert (x + y + z) / 3.0 == pytest.approx(0.3, abs=2.0 * NM)
        assert made.part_classes == {"fragment": "fragment"} and made.taxonomy.object_class == "debris"


@pytest.mark.parametrize("kind", KINDS)
def test_extents_are_the_longest_one_and_the_longest_across_it(kind):
    made, part = fragment(kind, 3)
    x, y, _ = made.size_m
    assert x == pytest.approx(pdist(part.solid.vertices).max(), abs=3.0 * NM)
    assert y == pytest.approx(pdist(part.solid.vertices[:, 1:]).max(), abs=3.0 * NM)


def test_proportions_of_each_kind():
    # Needles have a large x/y and plates a small one with a large y/z (Hanada and Liou 2009); nuggets are about
    # 2 : sqrt(2) : 1 (Michikami et al. 2016).
    sides = {kind: np.array([fragment(kind, seed)[0].size_m for seed in range(20)]) for kind in KINDS}
    ratios = {kind: (x / y, y / z) for kind, (x, y, z) in ((kind, of.T) for kind, of in sides.items())}
    assert ratios["straight_rod"][0].min() > 3.0
    assert ratios["flat_plate"][0].max() < 3.0 and ratios["flat_plate"][1].min() > 3.0
    longer, flatter = ratios["nugget"]
    assert longer.mean() == pytest.approx(np.sqrt(2.0), abs=0.15) and flatter.mean() == pytest.approx(
        np.sqrt(2.0), abs=0.15
    )
    for kind in ("bent_plate", "bent_rod"):
        straight = {"bent_plate": "flat_plate", "bent_rod": "straight_rod"}[kind]
        deep = sides[kind][:, 2].mean() if kind == "bent_plate" else sides[kind][:, 1].mean()
        assert deep > 1.5 * (sides[straight][:, 2] if kind == "bent_plate" else sides[straight][:, 1]).mean()


def test_a_seed_makes_the_same_bytes_on_every_processor():
    ours = [hash_solid(fragment(kind, seed)[1].solid) for kind in KINDS for seed in (0, 1)]
    assert len(set(ours)) == len(ours)
    command = [sys.executable, "-c", HASHES.format(kinds=KINDS)]
    there = subprocess.run(command, env=os.environ | other_processor(), capture_output=True, text=True)
    assert there.returncode == 0, there.stderr
    assert json.loads(there.stdout) == ours
    assert [one[:8] for one in ours] == PINNED  # what another machine made


def test_sine_and_cosine_are_those_of_the_library_to_rounding():
    angle = np.linspace(-4.0 * np.pi, 4.0 * np.pi, 20001)
    sine, cosine = sine_cosine(angle)
    assert np.abs(sine - np.sin(angle)).max() < 1e-14 and np.abs(cosine - np.cos(angle)).max() < 1e-14


# Mean and standard deviation of log10(A/M) from the formulas of Johnson et al. 2001, and the share of the first mode.
@pytest.mark.parametrize(
    ("length_m", "modes"),
    [
        (0.05, [(1.0, -1.0 + 1.4 * (0.0511), 0.2 + 0.1333 * 2.19897)]),
        (0.5, [(0.3 + 0.4 * 0.89897, -0.6 - 0.318 * 0.79897, 0.3), (1.0 - 0.65959, -1.2 - 1.333 * 0.39897, 0.30103)]),
        (1.0, [(0.78, -0.95, 0.3), (0.22, -2.0, 0.3)]),
    ],
)
def test_area_to_mass_is_distributed_as_the_breakup_model_says(length_m, modes):
    rng = np.random.default_rng(3)
    drawn = np.log10([draw_area_to_mass(length_m, rng) for _ in range(4000)])

    def share_below(x):
        return sum(share * stats.norm.cdf(x, mean, sigma) for share, mean, sigma in modes)

    assert (
        stats.kstest(drawn, share_below).statistic < 0.035
    )  # 4000 draws; twelve uniforms for a normal; rounded slopes


def test_a_plate_is_as_thick_as_its_area_to_mass_demands():
    seen = 0
    for seed in range(30):
        made, part = fragment("flat_plate", seed)
        area_m2 = trimesh.Trimesh(part.solid.vertices, part.solid.facets, process=False).area
        thickness_m = 2.0 * part.solid.volume_m3() / area_m2
        ratio = 0.25 * area_m2 / made.mass_kg  # mean cross-section of a convex body (Cauchy)
        if 0.001 * 0.3 < thickness_m < 0.05 * 0.3:
            seen += 1
            density = {"aluminium": 2700.0, "cfrp": 1600.0}[part.material]
            assert thickness_m == pytest.approx(0.5 / (density * ratio), rel=0.08)  # the rim counts too
        assert made.mass_kg <= 2700.0 * part.solid.volume_m3() * (1.0 + 1e-9)
    assert seen > 8


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (("plate", 1, 0.3), r"^fragment: unknown kind 'plate'; did you mean '\w*plate'\? \(known: flat_plate, "),
        (("nugget", -1, 0.3), r"^fragment: seed is -1; give a whole number of 0 or more$"),
        (("nugget", 1, 0.0), r"^fragment: characteristic_length_m is 0\.0; give 0\.001 to 10 m$"),
        (("nugget", 1, float("nan")), r"characteristic_length_m is nan"),
    ],
)
def test_a_fragment_that_cannot_be_is_one_line(arguments, line):
    with pytest.raises(ScenarioError, match=line):
        breakup_fragment(*arguments)

"""Fragments as targets: what a scenario says of them, what labels say, and what stays in memory of many."""

import gc
import weakref

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.records import PART_CLASSES
from rso_lidar.scenario.mission import target_surfaces
from rso_lidar.scenario.tables import fragment as fragments
from rso_lidar.scene.surfaces import surface
from tests.scenario.tables.test_terrain import scenario

BENT = {"kind": "bent_plate", "seed": 7, "characteristic_length_m": 3.0}


def test_a_fragment_flies_and_says_where_it_comes_from():
    said = scenario(position_m=(0.0, 0.0, 40.0), fov_deg=10.0, fragment=BENT)
    frame = next(rl.simulate(said))
    entry = frame.source.targets[0]
    assert (entry.model, entry.parts) == ("fragment bent_plate 7", ("fragment",))
    assert entry.part_classes == ("fragment",) and entry.part_classes[0] in PART_CLASSES
    assert entry.taxonomy.object_class == "debris" and entry.taxonomy.subclass == "fragment_bent_plate"
    assert entry.materials == (rl.scene.Named(name="aluminium").at(1.064e-6).summarize(),)
    assert said.target[0].symmetry is None
    lit = frame.labels.target >= 0
    assert 40 < lit.sum() < 32 * 32
    assert np.abs(frame.labels.range_m[lit] - 40.0).max() < 3.0
    again = rl.Scenario.loads(said.dumps())
    assert again == said
    assert again.surfaces[0].mesh.sha256 == said.surfaces[0].mesh.sha256 == entry.mesh_sha256


def test_the_seed_the_kind_and_the_size_each_make_another_fragment():
    meshes = [
        scenario(fragment=BENT | change).surfaces[0].mesh
        for change in ({}, {"seed": 8}, {"kind": "nugget"}, {"characteristic_length_m": 1.5})
    ]
    assert len({mesh.sha256 for mesh in meshes}) == 4
    assert [mesh.size_m.mean() for mesh in meshes] == pytest.approx([3.0, 3.0, 3.0, 1.5], abs=1e-8)


def test_a_material_of_the_scenario_replaces_that_of_the_fragment():
    said = scenario(fragment=BENT, material={"type": "lambertian", "reflectance": 0.5})
    assert said.surfaces[0].lambertian_per_sr[0] == pytest.approx(0.5 / np.pi)


@pytest.mark.slow
def test_what_is_kept_of_many_fragments_is_bounded():
    first = scenario(fragment=BENT).surfaces[0].mesh
    kept = weakref.ref(first)
    del first
    for seed in range(40):  # a few cells of the image each, so that every one gets its acceleration structure
        said = scenario((0.0, 0.0, 60.0), fragment={**BENT, "kind": "straight_rod", "seed": seed})
        next(rl.simulate(said, threads=1))
    del said
    gc.collect()
    assert kept() is None
    assert fragments.build_fragment.cache_info().currsize <= 16
    assert target_surfaces._build_fragment_once.cache_info().currsize <= 16
    assert len(surface._scenes) <= surface._SCENES_KEPT


@pytest.mark.parametrize(
    ("target", "told"),
    [
        ({"fragment": BENT, "model": "tdrs"}, "fragment for debris, not both"),
        ({"fragment": BENT, "size_m": 3.0}, "fragment says its size itself"),
        ({"fragment": BENT | {"kind": "plate"}}, "fragment.kind"),
        ({"fragment": BENT | {"seed": -1}}, "fragment.seed"),
        ({"fragment": BENT | {"characteristic_length_m": 20.0}}, "characteristic_length_m"),
        ({"fragment": {"kind": "nugget"}}, "characteristic_length_m"),
        ({"fragment": BENT, "part_materials": {"skin": "cfrp"}}, "no part 'skin' in fragment bent_plate 7"),
    ],
)
def test_a_fragment_that_cannot_be_is_one_line(target, told):
    with pytest.raises(rl.ScenarioError, match=told) as caught:
        _ = scenario(**target).surfaces
    assert "\n" not in str(caught.value)

"""Samples: where a view places a target, which values are drawn, and what an empty sample leaves out."""

import math

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.dataset.drawing.plan import make_plan
from rso_lidar.dataset.drawing.sample import draw_sample
from rso_lidar.simulation import simulate
from tests.dataset.bench_for_tests import SCENARIO, find_sample, make_spec


def test_a_view_places_the_target(tmp_path):
    mount = "mount = { position_m = [0.3, -0.2, 0.1], euler_zyx_deg = [20, 5, 3] }\nreceiver"
    spec = make_spec(tmp_path)
    (tmp_path / "bench.toml").write_text(SCENARIO.replace("receiver", mount, 1), encoding="utf-8")
    plan = make_plan(spec)
    for index in np.flatnonzero(plan.membership.target_class == 0)[:4].tolist():
        sample = draw_sample(plan, index)
        (frame,) = simulate(sample.scenario, frames=sample.frames, threads=1)
        seen = frame.truth.pose("lidar", "body")
        assert np.linalg.norm(seen.translation) == pytest.approx(sample.values["view.range_m"], rel=1e-9)
        x, y, z = seen.translation
        edge = math.tan(math.radians(1.0))
        assert [x / z / edge, y / z / edge] == pytest.approx(sample.values["view.offset_fraction"], abs=1e-9)
        turned = frame.truth.pose("inertial", "body").rotation.as_quat(canonical=True)
        assert turned == pytest.approx(sample.values["view.attitude"], abs=1e-9)
        assert sample.scenario.lidar.laser.energy_mj == sample.values["lidar.laser.energy_mj"]


def test_a_sample_depends_on_its_class_and_number_only(tmp_path):
    spec = make_spec(tmp_path)
    few = make_plan(spec)
    more = make_plan(spec.replace(classes=[spec.classes[1].replace(samples=40), spec.classes[0]]))
    for k, name in ((0, "plate"), (1, "round")):
        one, again = draw_sample(few, find_sample(few, k, 3)), draw_sample(more, find_sample(more, 1 - k, 3))
        assert one.values == again.values and one.seeds == again.seeds and one.model == again.model, name


def test_a_new_variable_changes_no_other(tmp_path):
    spec = make_spec(tmp_path)
    further = {"field": "lidar.receiver.transmission", "law": {"type": "uniform", "low": 0.4, "high": 0.7}}
    more = spec.replace(variable=[further, *spec.variable])
    before, after = draw_sample(make_plan(spec), 3).values, draw_sample(make_plan(more), 3).values
    assert before.items() <= after.items() and set(after) - set(before) == {"lidar.receiver.transmission"}


def test_an_empty_sample_has_no_target(tmp_path):
    plan = make_plan(make_spec(tmp_path))
    sample = draw_sample(plan, int(np.flatnonzero(plan.membership.target_class == 2)[0]))
    assert sample.scenario.target == () and sample.target is None and sample.class_id == -1


def test_clutter_is_drawn_anew(tmp_path):
    clutter = {"models": ["sphere", "plate"], "count": {"type": "whole", "low": 0, "high": 3}}
    plan = make_plan(make_spec(tmp_path, clutter=clutter))
    counts = set()
    for index in range(15):
        sample = draw_sample(plan, index)
        bodies = [one.name for one in sample.scenario.target if one.name.startswith("clutter_")]
        assert len(bodies) == sample.values["clutter.count"]
        counts.add(len(bodies))
    assert len(counts) > 2


def test_sequences_start_anywhere_in_the_scenario(tmp_path):
    sequence = {"frames": 3, "stride": 2}
    plan = make_plan(make_spec(tmp_path, sequence=sequence, view=None, draws=1))
    starts = [draw_sample(plan, index).frames for index in range(15)]
    assert all(np.array_equal(np.diff(frames), [2, 2]) and frames[-1] <= 9 for frames in starts)
    assert len({frames[0] for frames in starts}) > 3


def test_low_discrepancy_points(tmp_path):
    plan = make_plan(
        make_spec(tmp_path, sampling="halton", classes=[{"name": "a", "models": ["plate"], "samples": 64}])
    )
    ranges = np.log([draw_sample(plan, index).values["view.range_m"] for index in range(64)])
    share = (ranges - np.log(50)) / np.log(8)
    counts = np.histogram(share, 8, (0, 1))[0]
    assert (
        counts.min() >= 6 and counts.max() <= 10
    )  # 8 on average; pseudo-random numbers fail this in nine cases of ten


def test_settings_of_a_class_reach_the_model_that_it_chooses(tmp_path):
    scaled = {"name": "a", "models": ["sphere"], "samples": 8, "set": ["target.body.size_m=3.5"]}
    (target,) = draw_sample(make_plan(make_spec(tmp_path, classes=[scaled])), 0).scenario.target
    assert target.model == "sphere" and target.size_m == 3.5


def test_a_value_at_the_end_of_a_law_is_found_before_the_first_flash(tmp_path):
    rare = {"field": "target.body.material", "law": {"type": "choice", "values": ["white_paint"] * 99 + ["no_such"]}}
    with pytest.raises((rl.ScenarioError, rl.DatasetError, rl.MeshError), match="no_such"):
        rl.dataset.make(make_spec(tmp_path, variable=[rare]), tmp_path / "made", workers=1)
    assert not (tmp_path / "made").exists()


FRAGMENTS = {"kinds": ["nugget", "bent_rod"], "characteristic_length_m": {"type": "uniform", "low": 0.2, "high": 0.8}}


def debris(tmp_path, fragments=FRAGMENTS, **changes):
    """Return the plan of a dataset with a class of fragments."""
    classes = [
        {"name": "debris", "fragments": fragments, "samples": 30},
        {"name": "plate", "models": ["plate"], "samples": 12},
    ]
    return make_plan(make_spec(tmp_path, classes=classes, **changes))


@pytest.mark.parametrize("sampling", ["random", "halton"])
def test_every_sample_is_a_fragment_of_its_own(tmp_path, sampling):
    plan = debris(tmp_path, sampling=sampling)
    assert plan.models == ("fragment nugget", "fragment bent_rod", "plate")
    samples = [draw_sample(plan, index) for index in np.flatnonzero(plan.membership.target_class == 0).tolist()]
    drawn = [sample.scenario.target[0].fragment for sample in samples]
    assert len({one.seed for one in drawn}) == 30 and {one.kind for one in drawn} == {"nugget", "bent_rod"}
    assert [f"fragment {one.kind}" for one in drawn] == [sample.model for sample in samples]
    assert [one.seed for one in drawn] == [sample.values["fragment.seed"] for sample in samples]
    sizes = np.array([one.characteristic_length_m for one in drawn])
    assert 0.2 <= sizes.min() < 0.3 and 0.7 < sizes.max() < 0.8
    assert sizes.tolist() == [sample.values["fragment.characteristic_length_m"] for sample in samples]
    assert len({sample.scenario.surfaces[0].mesh.sha256 for sample in samples[:4]}) == 4


def test_few_seeds_make_the_same_fragments_again(tmp_path):
    plan = debris(tmp_path, FRAGMENTS | {"seed": {"type": "whole", "low": 5, "high": 6}})
    mine = np.flatnonzero(plan.membership.target_class == 0).tolist()
    assert {draw_sample(plan, index).scenario.target[0].fragment.seed for index in mine} == {5, 6}


def test_a_kind_of_fragments_is_kept_for_the_test(tmp_path):
    classes = [{"name": "debris", "fragments": FRAGMENTS, "samples": 30}]
    plan = make_plan(make_spec(tmp_path, classes=classes, split={"type": "model", "test": ["fragment nugget"]}))
    samples = [draw_sample(plan, index) for index in range(30)]
    assert {(one.split, one.model) for one in samples} == {("train", "fragment bent_rod"), ("test", "fragment nugget")}


def test_fragments_as_clutter(tmp_path):
    clutter = {"models": ["sphere"], "fragments": FRAGMENTS, "count": {"type": "whole", "low": 2, "high": 2}}
    plan = make_plan(make_spec(tmp_path, clutter=clutter))
    bodies = [one for index in range(15) for one in draw_sample(plan, index).scenario.target if "clutter" in one.name]
    found = [one.model or one.fragment.kind for one in bodies]
    assert set(found) == {"sphere", "nugget", "bent_rod"}
    seeds = [one.fragment.seed for one in bodies if one.fragment]
    assert len(set(seeds)) == len(seeds) > 10
    assert "fragment nugget" in plan.mesh_sha256


def test_a_class_may_keep_a_target_of_terrain_or_a_fragment(tmp_path):
    for table, name, field in (
        ('fragment = { kind = "nugget", characteristic_length_m = 0.5 }', "fragment nugget", "fragment.seed"),
        (
            'terrain = { type = "craters_and_boulders", size_m = 8, cell_m = 0.5 }',
            "craters_and_boulders",
            "terrain.seed",
        ),
    ):
        law = {"type": "whole", "low": 0, "high": 10**6}
        spec = make_spec(
            tmp_path,
            classes=[{"name": "own", "samples": 4}],
            variable=[{"field": f"target.body.{field}", "law": law}],
            split={"type": "random", "test": 0.0},
        )
        (tmp_path / "bench.toml").write_text(SCENARIO.replace('model = "plate"', table), encoding="utf-8")
        plan = make_plan(spec)
        assert plan.models == (name,) and plan.part_names[name]
        meshes = {draw_sample(plan, index).scenario.surfaces[0].mesh.sha256 for index in range(4)}
        assert len(meshes) == 4

"""Samples: where a view places a target, which values are drawn, and what an empty sample leaves out."""

import math

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.dataset.drawing.plan import make_plan
from rso_lidar.dataset.drawing.sample import draw_sample
from rso_lidar.simulate import simulate
from tests.dataset.bench_for_tests import SCENARIO, make_spec


def test_a_view_places_the_target(tmp_path):
    mount = "mount = { position_m = [0.3, -0.2, 0.1], euler_zyx_deg = [20, 5, 3] }, receiver"
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
        index = int(np.flatnonzero(few.membership.target_class == k)[3])
        other = int(np.flatnonzero(more.membership.target_class == 1 - k)[3])
        one, again = draw_sample(few, index), draw_sample(more, other)
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

"""Noise draws of one pose: each is the frame of its own seed, and rays are cast once where the light has no noise."""

import numpy as np
import pytest

from rso_lidar import sampling
from rso_lidar.dataset.drawing.plan import make_plan
from rso_lidar.dataset.drawing.sample import draw_sample
from rso_lidar.dataset.making.flight import fly_sample, label, list_kept
from rso_lidar.detector.bench import scatter_table
from rso_lidar.records import specs
from rso_lidar.simulation import simulate
from tests.dataset.bench_for_tests import find_sample, make_spec

GSFL = 'lidar.detector={type="gsfl"}'
SUNLIT = (GSFL, "world.sun_direction=[-1, 0.2, 0.1]", "lidar.receiver.filter_width_nm=10.0")
ALL_LABELS = dict.fromkeys(("part_visibility", "oversampled", "keypoints", "normals"), True)


@pytest.mark.parametrize(
    ("settings", "casts"),
    [
        ((), 1),
        (SUNLIT, 1),
        (('lidar.detector={type="geiger"}',), 1),
        (("lidar.laser.energy_jitter_fraction=0.05",), 3),
        (("lidar.bounces=2",), 3),
    ],
)
def test_each_draw_is_the_frame_of_its_seed(tmp_path, monkeypatch, settings, casts):
    spec = make_spec(tmp_path, draws=3, set=settings, labels=ALL_LABELS, sequence={"frames": 2})
    plan = make_plan(spec)
    sample = draw_sample(plan, find_sample(plan, 0, 0))
    cast, calls = sampling.cast_pixels, []

    def count(*given, **chosen):
        calls.append(1)
        return cast(*given, **chosen)

    monkeypatch.setattr(sampling, "cast_pixels", count)
    flown = [frame for frame, _ in fly_sample(plan, sample)]
    monkeypatch.undo()
    assert len(calls) == 2 * casts and len(flown) == 6
    keep = (*list_kept(spec.labels), "prediction")
    for draw, seed in enumerate(sample.seeds):
        alone = simulate(sample.scenario.replace(seed=seed), frames=sample.frames, threads=1, keep=keep)
        for step, frame in enumerate(alone):
            expected, found = label(plan, sample, frame, step, draw), flown[3 * step + draw]
            for name in specs(type(found)):
                ours, theirs = np.asarray(getattr(found, name)), np.asarray(getattr(expected, name))
                assert ours.tobytes() == theirs.tobytes(), name
    assert not np.array_equal(flown[0].range_m, flown[1].range_m, equal_nan=True)


@pytest.mark.parametrize(
    ("field", "law", "is_drawn"),
    [
        ("lidar.laser.pulse_fwhm_ns", {"type": "uniform", "low": 6, "high": 10}, True),
        ("lidar.laser.pulse_fwhm_ns", {"type": "choice", "values": [6, 10]}, False),
        ("lidar.laser.energy_mj", {"type": "uniform", "low": 6, "high": 10}, False),
        ("lidar.detector.camera_seed", {"type": "whole", "low": 0, "high": 1000}, False),
        ("lidar.detector.apd.gain", {"type": "normal", "mean": 10, "sigma": 1, "low": 8, "high": 12}, True),
    ],
)
def test_no_table_is_filled_for_a_detector_of_one_sample(tmp_path, field, law, is_drawn):
    variable = [{"field": field, "law": law}]
    spec = make_spec(tmp_path, variable=variable, draws=1, labels={"prediction": True}, set=(GSFL,))
    assert spec.draws_detector is is_drawn
    if not is_drawn:
        return
    plan = make_plan(spec)
    filled = scatter_table._try_levels.cache_info().misses
    ((frame, _),) = fly_sample(plan, draw_sample(plan, find_sample(plan, 0, 0)))
    assert scatter_table._try_levels.cache_info().misses == filled
    lit = frame.detection_probability > 0.9
    assert lit.any() and (0.003 < frame.range_sigma_m[lit]).all() and (frame.range_sigma_m[lit] < 0.3).all()

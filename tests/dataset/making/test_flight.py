"""Noise draws of one pose: each is the frame of its own seed, and rays are cast once where the light has no noise."""

import numpy as np
import pytest

from rso_lidar import sampling
from rso_lidar.dataset.drawing.plan import make_plan
from rso_lidar.dataset.drawing.sample import draw_sample
from rso_lidar.dataset.making.flight import fly_sample, label, list_kept
from rso_lidar.records.schema import specs
from rso_lidar.simulate import simulate
from tests.dataset.bench_for_tests import make_spec

SUNLIT = ("world.sun_direction=[-1, 0.2, 0.1]", "lidar.receiver.filter_width_nm=10.0")
ALL_LABELS = {"part_visibility": True, "oversampled": True}


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
    sample = draw_sample(plan, 0)
    cast, calls = sampling.cast_pixels, []

    def count(*given, **chosen):
        calls.append(1)
        return cast(*given, **chosen)

    monkeypatch.setattr(sampling, "cast_pixels", count)
    flown = [frame for frame, _ in fly_sample(plan, sample)]
    monkeypatch.undo()
    assert len(calls) == 2 * casts and len(flown) == 6
    keep = list_kept(spec.labels)
    for draw, seed in enumerate(sample.seeds):
        alone = simulate(sample.scenario.replace(seed=seed), frames=sample.frames, threads=1, keep=keep)
        for step, frame in enumerate(alone):
            expected, found = label(plan, sample, frame, step, draw), flown[3 * step + draw]
            for name in specs(type(found)):
                ours, theirs = np.asarray(getattr(found, name)), np.asarray(getattr(expected, name))
                assert ours.tobytes() == theirs.tobytes(), name
    assert not np.array_equal(flown[0].range_m, flown[1].range_m, equal_nan=True)

"""Messages of frames: what a viewer needs beyond the frames themselves."""

import json

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.loop.live.frame_messages import stamp_of, write_ptu, write_stl
from rso_lidar.picture import Shape


def test_meshes_are_binary_stl():
    corners = np.array([[[0.0, 0, 0], [2, 0, 0], [0, 3, 0]], [[0, 0, 1], [0, 1, 1], [1, 0, 1]]])
    data = write_stl(Shape("plate", corners))
    assert len(data) == 84 + 2 * 50 and data[80:84] == b"\x02\0\0\0"
    facet = np.frombuffer(data[84:132], "<f4")
    assert facet.tolist() == [0, 0, 1, 0, 0, 0, 2, 0, 0, 0, 3, 0]


def test_angles_and_stamps_are_those_of_the_frame(text):
    scenario = rl.Scenario.loads(text + '\n[lidar.detector]\ntype = "empirical"\n')
    (frame,) = rl.simulate(scenario, frames=[1], threads=1)
    tree = json.loads(write_ptu(frame))
    assert tree["timestamp"] == {"sec": 1726574400, "nsec": 200_000_000}
    assert stamp_of(frame) == 1726574400_200_000_000
    for k, axis in enumerate(("pan", "tilt")):
        for name in ("demand", "actual", "measured"):
            assert tree[f"{axis}_{name}_rad"] == pytest.approx(getattr(frame.truth.pointing, f"{name}_rad")[k])
    assert write_ptu(next(rl.simulate(scenario.replace(ptu=None), frames=[1], threads=1))) is None

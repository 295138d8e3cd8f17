"""Figures of merit: what they are by definition, in closed form where there is one, and where they have no meaning."""

import math
import re
from pathlib import Path

import numpy as np
import pytest

from rso_lidar import units
from rso_lidar.evaluation import tracking
from rso_lidar.scenario import Scenario
from rso_lidar.simulation import simulate
from rso_lidar.study.trades.merits import MERITS, Run, evaluate
from rso_lidar.study.trades.run_sums import RunSums

SWEEP = """
version = 1
name = "a camera that turns past a plate"

[world]
axes = "local"

[time]
start_utc = 2024-09-17T12:00:00Z
duration_s = 12
frame_rate_hz = 20

[[target]]
name = "plate"
model = "plate"
motion = { type = "fixed", position_m = [1000, 0, 0] }
attitude = { type = "look_at", at = "follower" }

[follower]
motion = { type = "fixed", position_m = [0, 0, 0] }
attitude = { type = "spin", axis = [0, 0, 1], rate_deg_s = 0.5, quaternion_xyzw = [0, 0, -0.026177, 0.999657] }

[lidar.receiver]
fov_deg = 2.5
f_number = 2.8
n_rows = 32
n_cols = 32
"""


@pytest.fixture(scope="module")
def frames():
    from tests.conftest import BENCH

    scenario = Scenario.loads(BENCH, settings=("lidar.laser.energy_mj=3", "lidar.laser.divergence_deg=1.5"))
    return scenario, list(simulate(scenario, frames=[0, 3, 6], threads=1))


def test_sums_over_frames_are_what_arrays_of_all_pixels_say(frames):
    scenario, made = frames
    names = [name for name in MERITS if MERITS[name].needs == "frames"]
    judgement = evaluate(scenario, names, 0, np.array([0, 3, 6]), threads=1)
    lit = [frame.labels.filled_fraction > 0.0 for frame in made]
    error_m = np.concatenate([(frame.range_m - frame.labels.range_m)[on] for frame, on in zip(made, lit, strict=True)])
    found = error_m[np.abs(error_m) < math.sqrt(32.0)]  # the diagonal of a plate of 4 m x 4 m
    assert 10 < found.size < error_m.size  # or nothing is tried
    assert judgement["pixels_on_target"] == round(error_m.size / 3, 6)
    assert judgement["returns_on_target"] == round(found.size / 3, 6)
    assert judgement["detection_fraction"] == round(found.size / error_m.size, 9)
    assert judgement["range_rms_m"] == pytest.approx(np.sqrt(np.mean(found**2)), abs=0.51e-6)
    light = np.concatenate([frame.labels.photons[on] for frame, on in zip(made, lit, strict=True)]).astype(float)
    assert judgement["photons_per_pixel"] == pytest.approx(light.mean(), rel=1e-9)
    false = sum(np.sum(frame.valid & (frame.labels.target < 0)) for frame in made)
    assert judgement["false_returns"] == round(false / 3, 6)
    near = np.sort(np.abs(found))[math.ceil(math.erf(math.sqrt(0.5)) * found.size) - 1]
    assert judgement["range_error_m"] == pytest.approx(near, rel=0.006)  # half a step of 1 %


def test_the_tracker_is_the_one_that_tracks_recordings(frames):
    scenario, made = frames
    table = tracking(made, poses=False).table
    error_m = np.array([table[f"cv_error_{axis}_m"] for axis in ("right", "down", "ahead")])
    rms_m = np.sqrt(np.nanmean(np.sum(error_m**2, axis=0)))
    got = evaluate(scenario, ["tracker_error_m", "detection_fraction"], 0, np.array([0, 3, 6]), threads=1)
    assert got["tracker_error_m"] == pytest.approx(rms_m, abs=0.51e-6)
    assert 0.0 < got["detection_fraction"] <= 1.0  # the same frames are counted as they pass


@pytest.mark.parametrize("rate_deg_s", [0.5, 1.0])
def test_time_in_the_field_is_that_of_a_plate_swept_past(rate_deg_s):
    """The plate's edges are 2 m off its middle at 1 km: it is wholly inside for (field - its angle) / rate."""
    scenario = Scenario.loads(SWEEP, settings=(f"follower.attitude.rate_deg_s={rate_deg_s}",))
    made = evaluate(scenario, ["time_in_field_s", "off_boresight_deg"], 0, np.array([0]))
    inside_deg = 2.5 - 2.0 * math.atan(2.0 / 1000.0) / units.DEG
    assert made["time_in_field_s"] == pytest.approx(inside_deg / rate_deg_s, abs=1.0 / 20.0 + 1e-3)  # a frame
    turned_deg = -3.0 + rate_deg_s * scenario.time.seconds(np.arange(240))
    assert made["off_boresight_deg"] == pytest.approx(np.sqrt(np.mean(turned_deg**2)), rel=1e-4)  # of the quaternion


def test_what_is_never_in_the_field_has_no_errors():
    names = [name for name in MERITS if name != "off_boresight_deg"]
    scenario = Scenario.loads(SWEEP, settings=("follower.attitude={type='fixed', euler_zyx_deg=[20, 0, 0]}",))
    made = evaluate(scenario, names, 0, np.array([0, 1]), threads=1)
    none = {name for name, value in made.items() if math.isnan(value)}
    expected = {"detection_fraction", "range_error_m", "range_rms_m", "photons_per_pixel", "tracker_error_m"}
    assert none == expected
    assert (made["pixels_on_target"], made["time_in_field_s"]) == (0.0, 0.0)


def test_merits_of_truth_alone_flash_nothing(monkeypatch):
    monkeypatch.setattr("rso_lidar.study.trades.merits.simulate", lambda *_, **__: pytest.fail("a frame was flashed"))
    made = evaluate(Scenario.loads(SWEEP), ["time_in_field_s"], 0, np.array([0]))
    assert made["time_in_field_s"] > 1.0


def test_what_differs_by_rounding_alone_is_equal():
    """A camera that looks at a plate to 2e-15 rad, and one that looks straight at it, are as good."""
    merit = MERITS["off_boresight_deg"]
    turns = [f"follower.attitude={{type='fixed', quaternion_xyzw=[0, {y}, 0, 1]}}" for y in (0.0, 1e-15, 1e-5)]
    made = [
        evaluate(Scenario.loads(SWEEP, settings=(turn,)), [merit.name], 0, np.array([0]))[merit.name] for turn in turns
    ]
    assert made[0] == made[1] == 0.0
    assert made[2] == pytest.approx(2e-5 / units.DEG, abs=0.51e-6)
    assert math.copysign(1.0, MERITS["photons_per_pixel"].of(_of_photons(-1e-12))) == 1.0  # no -0 in a table
    assert MERITS["photons_per_pixel"].of(_of_photons(1.5)) == 1.5


def _of_photons(photons):
    sums = RunSums(0, 1.0)
    sums.pixels, sums.photons = 1, photons
    return Run(None, 0, sums, np.empty(0), np.empty(0, int))


def test_names_end_in_their_units():
    for merit in MERITS.values():
        assert merit.unit in ("1", "pixels", "photons") or merit.name.endswith(f"_{merit.unit}")
        assert merit.better in ("more", "less") and merit.sign in (1.0, -1.0)


def test_the_page_lists_them_all():
    page = (Path(__file__).resolve().parents[3] / "docs" / "studies.md").read_text(encoding="utf-8")
    assert set(re.findall(r"^\| `(\w+)` \| \S+ \| (?:more|less) \|", page, re.MULTILINE)) == set(MERITS)


def test_the_whole_target_is_found_as_often_as_the_timeline_says():
    """Both evaluate the light of the same frames; more pixels are reported in fewer of them."""
    from rso_lidar.mission_analysis import timeline
    from tests.conftest import BENCH

    settings = ("lidar.laser.energy_mj=9", 'lidar.detector={ type = "empirical" }')
    found = []
    for pixels in (1, 4, 400):
        scenario = Scenario.loads(BENCH, settings=(*settings, f"finding.pixels={pixels}"))
        frames = np.arange(scenario.time.n_frames)
        found.append(evaluate(scenario, ["found_probability"], 0, frames)["found_probability"])
        assert found[-1] == pytest.approx(timeline(scenario).table["found_probability"].mean(), abs=1e-6)
    assert found[0] > found[1] > found[2] == 0.0

"""Verdicts on a scenario, on its recording and on a study of it."""

import json
import math

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.errors import RecordingError, ScenarioError
from rso_lidar.study import Requirements, verify
from rso_lidar.study.trades.merits import MERITS, evaluate
from rso_lidar.study.verification.matrix import judge

FAST = '\n[lidar.detector]\ntype = "empirical"\n'


def requirements(*entries, **top):
    """Return requirements with an id each, from keyword arguments."""
    filled = [{"id": f"R-{k}", "text": "It shall.", **entry} for k, entry in enumerate(entries)]
    return Requirements(version=1, name="tests", requirement=filled, **top)


@pytest.fixture(scope="module")
def scenario():
    from tests.conftest import BENCH

    return rl.Scenario.loads(
        BENCH.replace("[1000, 0, 0]", "[300, 0, 0]").replace("duration_s    = 2", "duration_s = 4") + FAST
    )


@pytest.fixture(scope="module")
def frames(scenario):
    return list(rl.simulate(scenario))


SURE = {"confidence": 0.9}
MIXED = (
    {"quantity": "detection_fraction", "at_least": 0.5, **SURE},
    {"quantity": "range_error_m", "at_most": 1e-4, **SURE},
    {"quantity": "returns_on_target", "within": (1.0, 1e6), "frames": (0, 3, 6), **SURE},
    {"quantity": "pixels_on_target", "at_least": 10.0, "between_m": (250.0, 350.0)},
    {"quantity": "off_boresight_deg", "at_most": 0.1},
    {"quantity": "timeline.range_m", "statistic": "least", "within": (299.0, 301.0)},
    {"quantity": "budget.photons", "range_m": 300.0, "at_least": 1.0},
    {"quantity": "lidar.laser.energy_mj", "at_most": 49.0},
)


def test_a_scenario_and_its_recording_agree(scenario, frames, tmp_path):
    of_scenario = verify(requirements(*MIXED), scenario, threads=1)
    assert [one.verdict for one in of_scenario.results] == [
        "met", "not met", "not shown", "met", "met", "met", "met", "not met",
    ]  # fmt: skip
    assert of_scenario.count("met") == 5 and not of_scenario.is_met
    rl.save(tmp_path / "bench.h5", frames)
    with rl.open(tmp_path / "bench.h5") as recording:
        of_recording = verify(requirements(*MIXED), recording)
    for one, other in zip(of_scenario.results, of_recording.results, strict=True):
        assert (one.value, one.low, one.high) == pytest.approx((other.value, other.low, other.high), nan_ok=True)
    assert "recording of" in of_recording.subject


def test_values_are_those_of_the_figures_of_merit(scenario):
    names = [name for name, merit in MERITS.items() if merit.needs == "frames"]
    entries = [{"quantity": name, "at_least": -1.0} | (SURE if MERITS[name].noise != "none" else {}) for name in names]
    made = verify(requirements(*entries), scenario, threads=1)
    expected = evaluate(scenario, names, 0, np.arange(scenario.time.n_frames), threads=1)
    assert {one.requirement.quantity: one.value for one in made.results} == expected
    for one in made.results:
        assert one.low <= one.value <= one.high
        assert (one.low < one.high) == (one.requirement.confidence is not None and one.low != one.high)


def test_more_runs_make_narrower_bounds(scenario):
    asked = {"quantity": "range_rms_m", "at_most": 1.0, **SURE}
    one, four = (verify(requirements(asked, seeds=n), scenario, threads=1).results[0] for n in (1, 4))
    assert four.sample == "80 frames" and one.sample == "20 frames"
    assert four.high - four.low < 0.75 * (one.high - one.low)
    seeds = [scenario.replace(seed=scenario.seed + k) for k in range(2)]
    alone = [evaluate(each, ["false_returns"], 0, np.arange(20), threads=1)["false_returns"] for each in seeds]
    asked = {"quantity": "false_returns", "at_most": 9.0, **SURE}
    both = verify(requirements(asked, seeds=2), scenario, threads=1).results[0]
    assert alone[0] != alone[1] and both.value == pytest.approx(np.mean(alone), abs=1e-6)


def test_the_tracker_is_bounded_by_blocks(scenario):
    entries = (
        {"quantity": "tracker_error_m", "at_most": 10.0, **SURE},
        {"quantity": "tracking.centroid_error_ahead_m", "statistic": "rms", "at_most": 10.0, **SURE},
    )
    made = verify(requirements(*entries, seeds=2), scenario, threads=1)
    assert all("of 40 frames" in one.sample and "block" in one.sample for one in made.results)
    expected = evaluate(scenario, ["tracker_error_m"], 0, np.arange(20), threads=1)["tracker_error_m"]
    alone = verify(requirements(entries[0]), scenario, threads=1).results[0]
    assert alone.value == pytest.approx(expected)
    missing = {"quantity": "tracking.centroid_mistake_m", "statistic": "rms", "at_most": 10.0, **SURE}
    with pytest.raises(ScenarioError, match="no column 'centroid_mistake_m'"):
        verify(requirements(missing), scenario, threads=1)


@pytest.mark.parametrize(
    ("entry", "said"),
    [
        ({"quantity": "lidar.receiver.ifov", "at_most": 1.0}, "did you mean 'lidar.receiver.ifov_rad'?"),
        ({"quantity": "lidar.laser.pulse_shape", "at_most": 1.0}, "is 'gaussian', not a number"),
        ({"quantity": "lidar.receiver.filter_width_nm", "at_most": 1.0}, "is not set, not a number"),
        ({"quantity": "timeline.rang_m", "statistic": "mean", "at_most": 1.0}, "did you mean 'range_m'?"),
        (
            {"quantity": "range_rms_m", "at_most": 1.0, "between_m": (5.0, 9.0), **SURE},
            "no frame has its target at 5 to 9 m",
        ),
        ({"quantity": "range_rms_m", "at_most": 1.0, "frames": (99,), **SURE}, "frames: need ascending numbers"),
    ],
)
def test_what_the_scenario_does_not_have_is_said(scenario, entry, said):
    with pytest.raises(ScenarioError, match=said.replace("?", r"\?")):
        verify(requirements(entry), scenario)


def test_what_the_recording_does_not_have_is_said(frames):
    asked = {"quantity": "range_rms_m", "at_most": 1.0, "frames": (15,), **SURE}
    with pytest.raises(RecordingError, match="holds none of them, but 3 from 0 to 2"):
        verify(requirements(asked), frames[:3])
    with pytest.raises(RecordingError, match="has no frames"):
        verify(requirements(asked), [])
    with pytest.raises(ScenarioError, match="need a Scenario"):
        verify(requirements(asked), "bench.toml")
    with pytest.raises(ScenarioError, match="did you mean 'plate'"):
        verify(requirements(asked, target="plat"), frames[:3])


def test_a_study_meets_what_all_its_points_meet(scenario, tmp_path):
    (tmp_path / "bench.toml").write_text(scenario.dumps(), encoding="utf-8")
    text = """
version = 1
name = "energies"
scenario = "bench.toml"
merits = ["detection_fraction"]
frames = "0:4:2"
seeds = 3

[[axis]]
field = "lidar.laser.energy_mj"
values = [0.02, 20, 50]
"""
    study = rl.study.Study.loads(text, folder=tmp_path)
    entries = (
        {"quantity": "detection_fraction", "at_least": 0.5, **SURE},
        {"quantity": "false_returns", "at_most": 100.0, **SURE},
        {"quantity": "lidar.laser.energy_mj", "at_most": 60.0},
        {"quantity": "lidar.laser.energy_mj", "at_most": 30.0},
    )
    made = verify(requirements(*entries), study)
    assert [one.verdict for one in made.results] == ["not met", "met", "met", "not met"]
    assert "met at 2 of 3 points; row 0 is the worst: lidar.laser.energy_mj = 0.02" in made.results[0].note
    assert made.results[3].value == 50.0
    single = verify(requirements(entries[0]), rl.study.trade(study.replace(seeds=1)))
    assert single.results[0].verdict == "not shown" and "set seeds in the study" in single.results[0].note
    for entry, said in (
        (
            {"quantity": "tracking.cv_error_ahead_m", "statistic": "rms", "at_most": 1.0, **SURE},
            "needs a scenario or a rec",
        ),
        ({"quantity": "detection_fraction", "at_least": 0.1, "frames": "0:4", **SURE}, "a study has its own frames"),
    ):
        with pytest.raises(ScenarioError, match=said):
            verify(requirements(entry), study)


def test_verdicts():
    asked = requirements({"quantity": "range_rms_m", "within": (1.0, 2.0), **SURE}).requirement[0]
    spans = {(1.1, 1.9): "met", (0.9, 1.5): "not shown", (0.2, 0.9): "not met", (2.1, 3.0): "not met"}
    assert {span: judge(asked, *span) for span in spans} == spans
    assert judge(asked, math.nan, 1.5) == "not shown" and judge(asked, 1.0, 2.0) == "met"


def test_the_matrix_is_text_csv_and_json(scenario, tmp_path):
    made = verify(requirements(*MIXED[2:5]), scenario, threads=1)
    assert "R-0" in made.table() and "not shown" in made.table() and "a bound needs 8 frames" in made.table()
    tree = json.loads(made.save(tmp_path / "m.json").read_text(encoding="utf-8"))
    assert tree["counts"] == {"met": 2, "not met": 0, "not shown": 1} and tree["is_met"] is False
    assert tree["requirements"][0]["low"] is None and tree["requirements"][0]["at_least"] == 1.0
    rows = made.save(tmp_path / "m.csv").read_text(encoding="utf-8").splitlines()
    assert len(rows) == 4 and rows[0].startswith("id,quantity,unit,at_least,at_most,value")
    with pytest.raises(RecordingError, match="exists"):
        made.save(tmp_path / "m.csv")

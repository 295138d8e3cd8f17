"""How far a body is found: what it solves for, what it follows, and what it refuses; physics is in tests/physics."""

import math

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.errors import RsoLidarError
from rso_lidar.mission_analysis import find_range
from rso_lidar.mission_analysis.budgets import attitude_search, finding_range
from rso_lidar.mission_analysis.budgets.attitude_search import AttitudeSearch, follow_gate, list_facing_attitudes
from rso_lidar.mission_analysis.budgets.finding_range import choose_body
from rso_lidar.scenario import Finding, spread_attitudes
from rso_lidar.units import RANGE_PER_DELAY_M_S

RECEIVER = {"fov_deg": 0.625, "n_rows": 32, "n_cols": 32, "rays_per_pixel": 100}  # a fixed grid is coarse, and fast
FAST = rl.Lidar(preset="gsfl_1064", detector=rl.Empirical(), receiver=RECEIVER)
FEW = {"attitudes": 6, "range_m": (600.0, 1500.0)}


@pytest.fixture(scope="module")
def far():
    """Solve a range, with fewer places in the pixel grid for the worst attitude, which takes a third of the time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(finding_range, "_WORST_PLACES", 8)
        patch.setattr(attitude_search, "_FEW_PLACES", 2)
        patch.setattr(attitude_search, "_PLACES", 4)
        return find_range(FAST, "cubesat_3u", **FEW)


def test_the_greatest_range_has_the_wanted_probability(far, tmp_path):
    assert 700.0 < far.max_range_m < 1100.0
    assert far.range_of(0.9) == pytest.approx(far.max_range_m, rel=0.01)
    assert np.all(np.diff(far.range_m) > 0.0)
    assert "worst attitude: " in far.table() and "quaternion_xyzw = [" in far.table()
    head, *rows = far.save(tmp_path / "found.csv").read_text().splitlines()
    assert head == "range_m,found_probability,worst_probability" and len(rows) == len(far.range_m)
    assert far.save(tmp_path / "found.png").stat().st_size > 10_000


def test_turning_finds_an_attitude_worse_than_all_that_are_listed(far):
    flown, number = choose_body(FAST, None, "cubesat_3u")
    listed = [(0, matrix) for matrix in [*spread_attitudes(FEW["attitudes"])[0], *list_facing_attitudes()]]
    with AttitudeSearch(FAST, flown, number, Finding(), FEW["attitudes"], in_run=False) as search:
        least = min(search.of_attitude(attitude, far.max_range_m, 4) for attitude in listed)
        assert search.of_attitude((0, far.worst_attitude), far.max_range_m, 4) < least - 0.01


def test_a_gate_follows_the_body():
    """The body is in the middle of a gate of 18 m at each range, as it is at 1 km in one that opens at 991 m."""
    there = 1000.0
    found = []
    for delay_ns in (0.0, (there - 9.0) / RANGE_PER_DELAY_M_S / 1e-9):
        lidar = FAST.replace(detector=rl.Gsfl(gate={"delay_ns": delay_ns, "width_ns": 120.0}))
        flown, number = choose_body(lidar, None, "cubesat_3u")
        with AttitudeSearch(lidar, flown, number, Finding(), 8, in_run=False) as search:
            found.append(search.over_attitudes(there, 8))
        assert follow_gate(lidar, there).detector.sees_from_m == pytest.approx(there - 9.0, abs=0.1)
    assert found[0] == pytest.approx(found[1], abs=1e-3)
    assert 0.5 < found[0] < 1.0


def test_a_body_that_is_never_found_has_no_range():
    never = find_range(FAST, "cubesat_3u", finding=Finding(pixels=1000), attitudes=2, range_m=(800.0, 900.0))
    assert math.isnan(never.max_range_m) and never.worst_attitude is None
    assert "never" in never.table()
    assert never.notes[0] == "attitudes: all rotations, evenly; places: one pixel about the boresight"


def test_the_attitudes_of_the_run_are_those_that_face_the_lidar():
    """A plate that always faces the lidar is found as far as one attitude is."""
    from tests.conftest import BENCH

    settings = ('target.plate.attitude={ type = "look_at", at = "follower" }', 'lidar.detector={ type = "empirical" }')
    scenario = rl.Scenario.loads(BENCH, settings=settings)
    facing = find_range(scenario, in_run=True, attitudes=8, range_m=(1000.0, 4000.0))
    assert facing.worst_attitude is not None
    toward = -facing.worst_attitude[2]
    assert toward == pytest.approx([1.0, 0.0, 0.0], abs=1e-6)
    assert facing.worst_range_m == pytest.approx(facing.max_range_m, rel=0.05)  # 8 places against 32
    assert facing.notes[0] == "attitudes of the run"


def test_a_body_alone_stands_still_for_all_pulses_of_a_slow_laser():
    """100 pulses at 20 Hz take 5 s, more than a second between frames."""
    gated = rl.Gsfl(gate={"delay_ns": 5000.0, "pulses": 100})
    slow = rl.Lidar(receiver=FAST.receiver, laser={"pulse_rate_hz": 20.0}, detector=gated)
    alone, number = choose_body(slow, None, "cubesat_3u")
    assert number == 0 and alone.lidar.exposure_s < 1.0 / alone.time.frame_rate_hz


@pytest.mark.parametrize(
    ("given", "why"),
    [
        ({"body": None}, "a camera alone has no body"),
        ({"body": "cubesat_33u"}, "did you mean 'cubesat_3u'"),
        ({"body": 7}, "7: is not a name"),
        ({"body": ""}, "'': is not a name"),
        ({"finding": Finding(pixels=1025)}, "finding.pixels: 1025 is more than the 1024 pixels"),
        ({"body": "./none.stl"}, "no file './none.stl'"),
        ({"probability": 1.0}, "probability: 1: is never or always reached"),
        ({"probability": float("nan")}, "probability: nan"),
        ({"attitudes": 0}, "attitudes: 0"),
        ({"attitudes": 2.5}, "attitudes: 2.5"),
        ({"range_m": (900.0, 100.0)}, "range_m: 900, 100"),
        ({"range_m": (0.0, 100.0)}, "range_m: 0, 100"),
        ({"in_run": True}, "the body is not of a scenario"),
    ],
)
def test_bad_input_is_one_line(given, why):
    with pytest.raises(RsoLidarError) as raised:
        find_range(FAST, **{"body": "cubesat_3u", "attitudes": 2, **given})
    assert why in str(raised.value) and "\n" not in str(raised.value)

"""The log of a served flight: from it and the recording, the flight is repeated bit for bit."""

import itertools
import json

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.loop.service.requests import parse_request


def ask(session, **request):
    return session.answer(parse_request(json.dumps(request).encode()), skip=request.get("sequence") == 7)


@pytest.fixture(scope="module")
def flown(scenario, tmp_path_factory):
    """Return the path of a recording of two flights over a link, with short steps, a flash left out, and a refused step."""
    path = tmp_path_factory.mktemp("flown") / "a.h5"
    link = rl.DataLink(latency_s=0.05, command_latency_s=0.13, drop_probability=0.3)
    recorder = rl.loop.FlightRecorder(path)
    session = rl.loop.Session(rl.Simulation(scenario.replace(link=link), threads=1), recorder=recorder)
    for seed in (3, 4):
        ask(session, request="reset", seed=seed)
        for number in range(4):
            ask(session, request="step", command={"pan_rad": 0.1 / (number + seed), "tilt_rad": 0.03})
            ask(session, request="step", dt_ns=10_000_001, command={"pan_rad": -0.01 * number})
            with pytest.raises(rl.ScenarioError, match="two flashes"):
                ask(session, request="step", dt_ns=10**10)
        ask(session, request="step", sequence=7)
        ask(session, request="step")
    recorder.complete()
    return path


@pytest.mark.parametrize("name", ["a", "a.2"])
def test_the_frames_are_those_of_the_recording(flown, name):
    with rl.open(flown.with_name(f"{name}.h5")) as recording:
        simulation = rl.Simulation(rl.Scenario.loads(recording.source.scenario), threads=1)
        again = list(rl.loop.repeat_flight(simulation, flown.with_name(f"{name}.commands.jsonl")))
        assert [frame.index for frame in again] == [frame.index for frame in recording] == [0, 1, 2, 3, 5]
        for one, other in zip(again, recording, strict=True):
            assert one.time_s == other.time_s
            np.testing.assert_array_equal(one.range_m, other.range_m)
            np.testing.assert_array_equal(one.intensity_counts, other.intensity_counts)
            np.testing.assert_array_equal(one.truth.pointing.actual_rad, other.truth.pointing.actual_rad)
            np.testing.assert_array_equal(one.observation.pan_tilt_rad, other.observation.pan_tilt_rad)
    pans = {frame.truth.pointing.demand_rad[0] for frame in again}
    assert len(pans) > 3
    assert len(list(flown.parent.iterdir())) == 4


@pytest.mark.parametrize(
    ("line", "error"),
    [
        (b"", "line 2: begins at 0 ns and the simulation is at"),
        (b"{", "line 2: is not JSON"),
        (b'{"time_ns": 0, "dt": 1}', "unknown key 'dt'"),
        (b'{"time_ns": 0, "dt_ns": 0}', "greater than or equal to 1"),
        (b'{"time_ns": 5}', "line 2: begins at 5 ns"),
        (b'{"time_ns": 0, "dt_ns": 5000000000}', "line 2: dt_s: .*two flashes"),
        (b'{"time_ns": 0, "command": {"inputs": {"nobody": [1.0]}}}', "line 2: .*'nobody'"),
    ],
)
def test_what_is_no_log_of_this_flight_is_refused_in_a_line(flown, scenario, tmp_path, line, error):
    log = tmp_path / "b.commands.jsonl"
    whole = flown.with_name("a.commands.jsonl").read_bytes()
    log.write_bytes(whole.partition(b"\n")[0] + b"\n" + line + b"\n" if line else whole)
    with rl.open(flown) as recording:
        simulation = rl.Simulation(rl.Scenario.loads(recording.source.scenario), threads=1)
    if not line:
        simulation.step(dt_s=0.01)
    with pytest.raises(rl.RecordingError, match=error) as caught:
        list(rl.loop.repeat_flight(simulation, log))
    assert "\n" not in str(caught.value)
    with pytest.raises(rl.RecordingError, match="no such file; check the name"):
        list(itertools.islice(rl.loop.repeat_flight(simulation, tmp_path / "none.jsonl"), 1))


def test_a_killed_server_leaves_both_files_with_one_ending_and_its_last_line_may_be_half(scenario, tmp_path):
    recorder = rl.loop.FlightRecorder(tmp_path / "a.h5")
    session = rl.loop.Session(rl.Simulation(scenario, threads=1), recorder=recorder)
    for _ in range(3):
        ask(session, request="step", command={"pan_rad": 0.1})
    (frames,), (log,) = (list(tmp_path.glob(f"a.{kind}.tmp-*")) for kind in ("h5", "commands.jsonl"))
    assert frames.name.rpartition("-")[2] == log.name.rpartition("-")[2]
    log.write_bytes(log.read_bytes()[:-5])
    assert [frame.index for frame in rl.loop.repeat_flight(rl.Simulation(scenario, threads=1), log)] == [0, 1]
    recorder.complete()


@pytest.mark.parametrize(
    ("first", "error"),
    [
        (b"", "line 1: is not JSON"),
        (b'{"time_ns": 0}', "line 1: unknown key 'time_ns'"),
        (b'{"digest": "0", "seed": 3}', "line 1: is of another scenario"),
    ],
)
def test_a_log_begins_with_what_is_flown(flown, scenario, tmp_path, first, error):
    log = tmp_path / "b.commands.jsonl"
    log.write_bytes(first + b"\n" if first else b"")
    with pytest.raises(rl.RecordingError, match=error):
        list(rl.loop.repeat_flight(rl.Simulation(scenario, threads=1), log))
    with rl.open(flown) as recording:
        simulation = rl.Simulation(rl.Scenario.loads(recording.source.scenario), threads=1)
    simulation.reset(99)
    with pytest.raises(rl.RecordingError, match="the seed is 3 and that of the simulation 99"):
        list(rl.loop.repeat_flight(simulation, flown.with_name("a.commands.jsonl")))

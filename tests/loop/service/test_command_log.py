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
    ("line", "said"),
    [
        (b"", "begins at 0 ns and the simulation is at"),
        (b"{", "line 1: is not JSON"),
        (b'{"time_ns": 0, "dt": 1}', "unknown key 'dt'"),
        (b'{"time_ns": 0, "dt_ns": 0}', "greater than or equal to 1"),
        (b'{"time_ns": 5}', "line 1: begins at 5 ns"),
    ],
)
def test_what_is_no_log_of_this_flight_is_refused_in_a_line(flown, scenario, tmp_path, line, said):
    log = tmp_path / "b.commands.jsonl"
    log.write_bytes(line or flown.with_name("a.commands.jsonl").read_bytes())
    simulation = rl.Simulation(scenario, threads=1)
    if not line:
        simulation.step(dt_s=0.01)
    with pytest.raises(rl.RecordingError, match=said) as caught:
        list(rl.loop.repeat_flight(simulation, log))
    assert "\n" not in str(caught.value)
    with pytest.raises(rl.RecordingError, match="cannot be read"):
        list(itertools.islice(rl.loop.repeat_flight(simulation, tmp_path / "none.jsonl"), 1))

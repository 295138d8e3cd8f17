"""Answers without sockets, and the recordings of a session."""

import pytest

import rso_lidar as rl
from rso_lidar.loop.service.requests import parse_request
from rso_lidar.loop.service.session import MOST_STATES


def ask(session, text):
    return session.answer(parse_request(text.encode()))


def test_every_flight_has_a_recording_of_its_own(scenario, tmp_path):
    recorder = rl.loop.FlightRecorder(tmp_path / "a.h5")
    session = rl.loop.Session(rl.Simulation(scenario, threads=1), recorder=recorder)
    ask(session, '{"request": "step"}')
    ask(session, '{"request": "step", "command": {"pan_rad": 0.7}}')
    with pytest.raises(rl.ScenarioError, match="start the server without -o"):
        ask(session, '{"request": "restore", "state": "state-1"}')
    ask(session, '{"request": "reset", "seed": 5}')
    ask(session, '{"request": "step"}')
    (unfinished,) = tmp_path.glob("a.2.h5.tmp-*")
    with rl.open(unfinished) as recording:
        assert len(recording) == 1
    recorder.complete()
    assert [(path.name, count) for path, count in recorder.completed] == [("a.h5", 2), ("a.2.h5", 1)]
    with rl.open(tmp_path / "a.2.h5") as recording:
        assert recording.source.seed == 5
    (tmp_path / "b.2.h5").write_text("in the way")
    session = rl.loop.Session(rl.Simulation(scenario, threads=1), recorder=rl.loop.FlightRecorder(tmp_path / "b.h5"))
    ask(session, '{"request": "step"}')
    with pytest.raises(rl.RecordingError, match=r"b\.2\.h5"):
        ask(session, '{"request": "reset"}')
    assert ask(session, '{"request": "step"}').header["frame"]["index"] == 1


def test_truth_is_served_only_where_it_is_asked_for(scenario):
    session = rl.loop.Session(rl.Simulation(scenario, threads=1))
    answer = ask(session, '{"request": "step"}')
    with pytest.raises(rl.ScenarioError, match="start the server with --truth"):
        ask(session, '{"request": "truth"}')
    listed = [one.path for one in answer.arrays]
    assert "reading/range_m" in listed
    assert not [path for path in listed if "truth" in path or "label" in path]


def test_the_line_of_sight_is_sent_once_and_after_a_zoom(scenario):
    session = rl.loop.Session(rl.Simulation(scenario, threads=1))

    def has_sight(text):
        return "line_of_sight" in [one.path for one in ask(session, text).arrays]

    step = '{"request": "step"}'
    assert [has_sight(step) for _ in range(3)] == [True, False, False]
    assert has_sight('{"request": "step", "command": {"focal_length_m": 0.3}}')
    assert has_sight(step)  # back to the scenario's lens
    assert not has_sight(step)
    assert has_sight('{"request": "observation"}')
    assert not has_sight(step)
    assert has_sight('{"request": "hello", "version": 1}')
    assert has_sight(step)


def test_states_are_bounded_and_can_be_deleted(scenario):
    session = rl.loop.Session(rl.Simulation(scenario, threads=1))
    names = [ask(session, '{"request": "save"}').header["state"] for _ in range(MOST_STATES)]
    with pytest.raises(rl.ScenarioError, match="states are kept already"):
        ask(session, '{"request": "save"}')
    ask(session, f'{{"request": "restore", "state": "{names[0]}", "delete": true}}')
    with pytest.raises(rl.ScenarioError, match="no state"):
        ask(session, f'{{"request": "restore", "state": "{names[0]}"}}')
    ask(session, '{"request": "save"}')


def test_samples_of_other_sensors_come_with_every_step(scenario):
    gyro = {"name": "imu", "type": "gyro", "rate_hz": 100.0}
    session = rl.loop.Session(rl.Simulation(scenario.replace(sensor=[gyro]), threads=1))
    counts = []
    for _ in range(3):
        answer = ask(session, '{"request": "step", "dt_ns": 250000000}')
        assert answer.header["records"]["sensors/imu"] == "GyroSamples"
        counts.append(next(len(one.values) for one in answer.arrays if one.path == "sensors/imu/time_s"))
    assert sum(counts) in (75, 76)
    assert min(counts) >= 24


def test_every_frame_made_is_shown(scenario):
    shown = []
    session = rl.loop.Session(
        rl.Simulation(scenario.replace(link=rl.DataLink(drop_probability=1)), threads=1), show=shown.append
    )
    ask(session, '{"request": "step"}')
    ask(session, '{"request": "step", "dt_ns": 10000000}')
    ask(session, '{"request": "step"}')
    assert [frame.index for frame in shown] == [0, 1]

"""The motion of an orbit parameter message: its maneuvers against `numerical`, and against the rocket equation."""

import datetime
import math
import pathlib

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.errors import PropagationError, ScenarioError
from rso_lidar.orbit import Burn, Epochs, Forces, Impulse, Numerical, Opm, State, StatedManeuver, write_opm

START = datetime.datetime(2026, 5, 1, tzinfo=datetime.UTC)
EXAMPLES = pathlib.Path(__file__).parents[3] / "examples"
STATE = State(epoch_utc=START, position_m=(7e6, 0.0, 0.0), velocity_m_s=(0.0, 7529.3, 501.6))
MANEUVERS = (
    StatedManeuver(600.0, (0.5, 1.0, -0.25)),
    StatedManeuver(1500.0, (10.0, 0.0, 5.0), "vnc", 120.0, -4.0),
)


def saved(tmp_path, **options):
    path = write_opm(tmp_path / "craft.opm", "CRAFT", "2026-001A", STATE, **options)
    return str(path)


def test_it_flies_as_numerical_motion_with_the_same_maneuvers_does(tmp_path):
    file = saved(tmp_path, mass_kg=500.0, maneuvers=MANEUVERS)
    exhaust_m_s = math.hypot(10.0, 5.0) / math.log(500.0 / 496.0)
    thrust_n = np.array([10.0, 0.0, 5.0]) / math.hypot(10.0, 5.0) * (4.0 / 120.0) * exhaust_m_s
    forces = Forces(zonal_degree=4)
    known = Numerical(
        initial=STATE,
        forces=forces,
        maneuvers=(
            Impulse(at_s=600.0, delta_v_m_s=(0.5, 1.0, -0.25)),
            Burn(
                from_s=1500.0, duration_s=120.0, thrust_n=tuple(thrust_n.tolist()), mass_kg=500.0,
                isp_s=exhaust_m_s / 9.80665, axes="vnc",
            ),
        ),
    )  # fmt: skip
    time_s = np.array([0.0, 599.0, 601.0, 1550.0, 5000.0])
    wanted = known.states(Epochs(START, time_s))
    late = START + datetime.timedelta(seconds=1000)  # the impulse is flown before the start of the run
    for begin in (START, late):
        ahead_s = (begin - START).total_seconds()
        found = Opm(file=file, forces=forces).states(Epochs(begin, time_s - ahead_s))
        np.testing.assert_allclose(found.position_m, wanted.position_m, atol=1e-4)  # 1e-6 m in the file, over an hour
        np.testing.assert_allclose(found.velocity_m_s, wanted.velocity_m_s, atol=1e-7)
    motion = Opm(file=file)
    assert motion.breaks_s(Epochs(late, np.zeros(1))) == pytest.approx([-400.0, 500.0, 620.0])
    assert motion.list_impulses_s(late) == pytest.approx([-400.0])
    # 11.18 m/s is what the burn gives; the impulse is 1.15 m/s
    assert motion.summarize(START) == "opm of CRAFT, 2026-05-01T00:00:00Z; 2 maneuvers of 12.33 m/s"


def test_a_burn_without_change_of_mass_has_constant_acceleration(tmp_path):
    push = (StatedManeuver(10.0, (3.0, 0.0, 0.0), "inertial", 30.0),)
    pushed = Opm(file=saved(tmp_path, mass_kg=500.0, maneuvers=push), forces=Forces(zonal_degree=0))
    known = Numerical(
        initial=STATE,
        forces=Forces(zonal_degree=0),
        maneuvers=(Burn(from_s=10.0, duration_s=30.0, acceleration_m_s2=(0.1, 0.0, 0.0), axes="inertial"),),
    )
    epochs = Epochs(START, np.array([0.0, 25.0, 100.0]))
    np.testing.assert_allclose(pushed.states(epochs).position_m, known.states(epochs).position_m, atol=1e-5)


def test_maneuvers_can_be_left_out(tmp_path):
    file = saved(tmp_path, mass_kg=500.0, maneuvers=MANEUVERS)
    coast = Opm(file=file, maneuvers=False, forces=Forces(zonal_degree=0))
    epochs = Epochs(START, np.array([0.0, 3000.0]))
    np.testing.assert_allclose(coast.states(epochs).position_m, STATE.states(epochs).position_m, atol=1e-4)
    assert coast.breaks_s(epochs).size == 0
    assert coast.summarize(START) == "opm of CRAFT, 2026-05-01T00:00:00Z"


def test_masses_that_do_not_last_are_refused(tmp_path):
    empty = (StatedManeuver(10.0, (3.0, 0.0, 0.0), "rtn", 30.0, -600.0),)
    file = saved(tmp_path, mass_kg=500.0, maneuvers=empty)
    epochs = Epochs(START, np.zeros(1))
    with pytest.raises(ScenarioError, match=r"craft\.opm: maneuver 1: uses 600 kg of 500 kg; correct MASS"):
        Opm(file=file).states(epochs)
    text = (tmp_path / "craft.opm").read_text()
    (tmp_path / "craft.opm").write_text("\n".join(line for line in text.splitlines() if not line.startswith("MASS")))
    with pytest.raises(ScenarioError, match="maneuver 1 changes the mass, which the message does not give; add MASS"):
        Opm(file=file).states(epochs)


def test_a_fall_names_the_file(tmp_path):
    down = State(epoch_utc=START, position_m=(6.6e6, 0.0, 0.0), velocity_m_s=(-3000.0, 5000.0, 0.0))
    write_opm(tmp_path / "down.opm", "A", "1", down)
    with pytest.raises(PropagationError, match=r"down\.opm: from its EPOCH, numerical: meets the Earth") as error:
        Opm(file=str(tmp_path / "down.opm")).states(Epochs(START, np.array([0.0, 3000.0])))
    assert error.value.bad.tolist() == [False, True]


def test_a_target_of_a_scenario_flies_by_a_message_and_its_ephemeris_breaks_at_the_impulse(tmp_path):
    file = saved(tmp_path, mass_kg=500.0, maneuvers=MANEUVERS[:1])
    text = rl.Scenario.load(EXAMPLES / "closed_loop.toml").model_dump(exclude_unset=True)
    text["time"] |= {"start_utc": START + datetime.timedelta(seconds=300), "duration_s": 600.0}
    text["target"][0]["motion"] = {"type": "opm", "file": file}
    scenario = rl.Scenario.model_validate(text)
    name = scenario.target[0].name
    path = rl.mission_analysis.save_truth(scenario, tmp_path / "craft.oem", body=name)
    assert path.read_text().count("META_START") == 2
    again = rl.mission_analysis.save_truth(scenario, tmp_path / "again.opm", body=name)
    found = rl.orbit.read_opm(again)
    assert found.epoch_utc == scenario.time.start_utc
    first = Opm(file=file).states(Epochs(scenario.time.start_utc, np.zeros(1)))
    np.testing.assert_allclose(found.position_m, first.position_m[0], atol=2e-6)

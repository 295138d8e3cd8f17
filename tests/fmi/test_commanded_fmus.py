"""FMUs that fly motion and attitude under commands: against equations of motion, step by step, and with wrong mappings."""

import math
import pickle
import zipfile
from pathlib import Path

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.errors import ScenarioError
from rso_lidar.motion import FmuAttitude, FmuMotion
from rso_lidar.motion.dynamics import row_history
from tests.settings_for_tests import limit_pixels

pytest.importorskip("fmpy", reason="the extra `fmi` is not installed")
pythonfmu = pytest.importorskip("pythonfmu", reason="the extra `fmi` is not installed")

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "thrusters.toml"
SMALL = (
    "time.duration_s=6",
    *limit_pixels(8),
    'sensor=[{name="imu", type="accelerometer", rate_hz=20.0}, {name="gyro", type="gyro", rate_hz=20.0}]',
)
MASS_KG, INERTIA_KG_M2 = 250.0, 80.0
# A spacecraft in the rtn axes of its chief (Clohessy and Wiltshire), and turning about its z axis. Both are solved exactly
# under forces in mN and a torque in N m that are held over a step.
CRAFT = """
import math
import numpy as np
from pythonfmu import Fmi2Causality, Fmi2Slave, Real

MASS, INERTIA, N = 250.0, 80.0, math.sqrt(3.986004418e14 / 6_928_137.0**3)
A = np.zeros((9, 9))
A[:3, 3:6] = np.eye(3)
A[3, 0], A[3, 4], A[4, 3], A[5, 2] = 3 * N**2, 2 * N, -2 * N, -(N**2)
A[3:6, 6:] = np.eye(3) / MASS

def transit(step):
    term = total = np.eye(9)
    for k in range(1, 12):
        term = term @ A * step / k
        total = total + term
    return total

class Craft(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.values = {"tau": 0.0, "yaw": 0.0, "w": 0.0, "qz": 0.0, "qw": 1.0}
        self.values |= dict(zip(("x", "y", "z", "vx", "vy", "vz"), (3.0, -120.0, -2.0, 0.02, -0.15, 0.01)))
        self.values |= dict.fromkeys(("fx", "fy", "fz", "ax", "ay", "az", "sx", "sy", "sz"), 0.0)
        for name in self.values:
            causality = Fmi2Causality.input if name in ("fx", "fy", "fz", "tau") else Fmi2Causality.output
            self._add(name, causality, {"start": 0.0} if causality == Fmi2Causality.input else {})
        self._compute()

    def _add(self, name, causality, start):
        def write(value):
            self.values[name] = value
        self.register_variable(Real(name, causality=causality, getter=lambda: self.values[name], setter=write, **start))

    def _compute(self):
        v = self.values
        state = [v[name] for name in ("x", "y", "z", "vx", "vy", "vz")] + [1e-3 * v[name] for name in ("fx", "fy", "fz")]
        rates = A @ state
        v["ax"], v["ay"], v["az"] = (float(one) for one in rates[3:6])
        v["sx"], v["sy"], v["sz"] = (1e-3 * v[name] / MASS for name in ("fx", "fy", "fz"))
        v["qz"], v["qw"] = math.sin(0.5 * v["yaw"]), math.cos(0.5 * v["yaw"])
        return state

    def do_step(self, time, step):
        v = self.values
        state = transit(step) @ self._compute()
        v.update(zip(("x", "y", "z", "vx", "vy", "vz"), map(float, state)))
        v["yaw"] += v["w"] * step + 0.5 * v["tau"] / INERTIA * step**2
        v["w"] += v["tau"] / INERTIA * step
        self._compute()
        return True

    def _get_fmu_state(self):
        return {"values": dict(self.values)}

    def _set_fmu_state(self, saved):
        self.values.update(saved["values"])
"""
UNITS = {"tau": "N.m", "w": "rad/s"} | {
    f"{letter}{axis}": unit
    for letter, unit in (("", "m"), ("v", "m/s"), ("a", "m/s2"), ("s", "m/s2"), ("f", "mN"))
    for axis in "xyz"
}
OUTPUTS = {
    "position_m": ("x", "y", "z"),
    "velocity_m_s": ("vx", "vy", "vz"),
    "acceleration_m_s2": ("ax", "ay", "az"),
    "specific_force_m_s2": ("sx", "sy", "sz"),
}


@pytest.fixture(scope="module")
def craft(tmp_path_factory):
    folder = tmp_path_factory.mktemp("craft")
    (folder / "craft.py").write_text(CRAFT)
    options = {"canGetAndSetFMUstate": True, "canSerializeFMUstate": True}
    return str(pythonfmu.FmuBuilder.build_FMU(folder / "craft.py", dest=folder / "craft.fmu", **options))


def describe_motion(craft, **changes):
    """Return the motion of the FMU, in the rtn axes of the stage."""
    fields = {"axes": "rtn", "relative_to": "stage", "step_s": 0.01, "units": UNITS, "outputs": OUTPUTS}
    return FmuMotion(file=craft, inputs={"force_n": ("fx", "fy", "fz")}, **(fields | changes))


def describe_attitude(craft, **changes):
    """Return the attitude of the FMU: a turn about z by a torque."""
    outputs = {"quaternion_xyzw": (0.0, 0.0, "qz", "qw"), "body_rate_rad_s": (0.0, 0.0, "w")}
    given = {"step_s": 0.01, "inputs": {"torque_n_m": "tau"}, "outputs": outputs, "units": UNITS}
    return FmuAttitude(file=craft, **(given | changes))


@pytest.fixture(scope="module")
def by_equations():
    return rl.Scenario.load(EXAMPLE, settings=SMALL, trust_code=True)


@pytest.fixture(scope="module")
def by_fmu(by_equations, craft):
    changed = by_equations.follower.replace(motion=describe_motion(craft))
    return by_equations.replace(follower=changed).with_trusted_fmus()


def push_n(k):
    return [5.0 * math.sin(2.0 * k), 3.0 * math.cos(k), -2.0 * (k % 3)]


def fly(simulation, names=("follower",), step_s=None, last=6):
    """Fly under forces or accelerations that change at each flash; return poses, and the samples of the other sensors."""
    per_kg = 1.0 if names[0] == "follower" and isinstance(simulation.scenario.follower.motion, FmuMotion) else MASS_KG
    found, forces = [], []
    command = None
    for k in range(round(simulation.next_flash_s), last):
        if step_s is None or k == 0:
            frame = simulation.step(command)
            samples = frame.observation.sensors
            forces += [samples["imu"].specific_force_m_s2, samples["gyro"].angular_velocity_rad_s]
        else:
            for _ in range(round(1.0 / step_s)):
                frame = simulation.step(command, dt_s=step_s) or frame
            samples = frame.observation.sensors
            forces += [samples["imu"].specific_force_m_s2, samples["gyro"].angular_velocity_rad_s]
        pose = frame.truth.pose("inertial", "follower")
        found.append(np.concatenate([frame.truth.pose("stage", "follower").translation, pose.rotation.as_quat()]))
        row = {"follower": [one / per_kg for one in push_n(k)]}
        command = rl.Command(inputs={name: row.get(name, [0.4 * math.sin(k)]) for name in names})
    return np.array(found), np.concatenate(forces)


def test_a_commanded_fmu_equals_equations_of_motion(by_equations, by_fmu):
    """Clohessy and Wiltshire's equations, once integrated by DOP853 and once solved exactly in an FMU that counts in mN."""
    theirs, specific_force = fly(rl.Simulation(by_fmu, threads=1))
    ours, known = fly(rl.Simulation(by_equations, threads=1))
    free, _ = fly(rl.Simulation(by_fmu, threads=1), names=("follower",), last=1)
    assert np.abs(theirs - ours).max() < 1e-6 and np.abs(theirs[:, :3] - free[0, :3]).max() > 0.1
    assert np.abs(specific_force - known).max() < 1e-9 and np.abs(known).max() > 0.01


def test_steps_between_flashes_change_no_bit(by_fmu, craft):
    both = by_fmu.follower.replace(attitude=describe_attitude(craft))
    scenario = by_fmu.replace(follower=both)
    names = ("follower", "follower.attitude")
    at_once, specific_force = fly(rl.Simulation(scenario, threads=1), names, last=4)
    stepped, fine = fly(rl.Simulation(scenario, threads=1), names, step_s=0.02, last=4)
    assert np.array_equal(at_once, stepped) and np.array_equal(specific_force, fine)
    assert np.ptp(at_once[:, 5]) > 1e-3  # it turns


def test_an_attitude_turns_by_its_torque(by_equations, craft):
    scenario = by_equations.replace(
        follower=by_equations.follower.replace(attitude=describe_attitude(craft, start_inputs={"torque_n_m": 0.8}))
    ).with_trusted_fmus()
    simulation = rl.Simulation(scenario, threads=1)
    rate, angle = 0.0, 0.0
    torques = [0.8, 0.8, -2.0, 1.5]  # the first until the first command
    frame = simulation.step()
    for torque in torques:
        command = rl.Command(inputs={"follower.attitude": [torque]}) if torque != 0.8 else None
        frame = simulation.step(command)
        angle, rate = angle + rate + 0.5 * torque / INERTIA_KG_M2, rate + torque / INERTIA_KG_M2
        pose = frame.truth.pose("inertial", "follower")
        assert 2.0 * math.atan2(pose.rotation.as_quat()[2], pose.rotation.as_quat()[3]) == pytest.approx(
            angle, abs=1e-12
        )
    (alone,) = rl.simulate(scenario, frames=[2], threads=1)  # without commands, under the torque at the start
    assert 2.0 * math.asin(alone.truth.pose("inertial", "follower").rotation.as_quat()[2]) == pytest.approx(
        0.5 * 0.8 / INERTIA_KG_M2 * 4.0, abs=1e-12
    )


def test_a_command_between_points_of_the_grid_acts_from_the_next(craft):
    flight = describe_motion(craft, axes="local", relative_to=None, step_s=0.1).begin_flight()
    flight.hold(0.25, np.array([0.0, MASS_KG, 0.0]))
    late = flight(np.array([0.3, 1.3]))
    flight = describe_motion(craft, axes="local", relative_to=None, step_s=0.1).begin_flight()
    flight.hold(0.3, np.array([0.0, MASS_KG, 0.0]))
    assert np.array_equal(late, flight(np.array([0.3, 1.3])))
    assert late[1, 1] - late[0, 1] == pytest.approx(-0.15 + 0.5, abs=1e-3)
    assert np.array_equal(flight.inputs_at(np.array([0.29, 0.3, 5.0]))[:, 1], [0.0, MASS_KG, MASS_KG])
    flight(np.array([2.0]))
    with pytest.raises(ScenarioError, match=r"its outputs at 2 s were asked for before the command at 1 s"):
        flight.hold(1.0, np.zeros(3))


def test_actuator_telemetry_does_not_read_an_fmu(by_equations, craft):
    """Its outputs are place and velocity: the first three are no speeds of wheels."""
    wheels = rl.sensors.WheelTelemetry(name="wheels", rate_hz=1.0, dynamics="motion", speed_entries=(0, 1, 2))
    follower = by_equations.follower.replace(motion=describe_motion(craft))
    assert by_equations.replace(sensor=(wheels,)).sensor == (wheels,)
    with pytest.raises(ScenarioError, match="'wheels': the follower's motion is not of type state_space"):
        by_equations.replace(follower=follower, sensor=(wheels,))


def test_a_commanded_fmu_goes_back_and_on_again(by_fmu):
    simulation = rl.Simulation(by_fmu, threads=1)
    fly(simulation, last=3)
    saved = simulation.save()
    onward, _ = fly(simulation)
    simulation.restore(saved)
    again, _ = fly(simulation)
    assert np.array_equal(again, onward)
    other = rl.Simulation(by_fmu, threads=1)
    other.restore(pickle.loads(pickle.dumps(saved)))
    assert np.array_equal(fly(other)[0], onward)


def test_rows_keep_every_earlier_state(monkeypatch):
    monkeypatch.setattr(row_history, "_KEPT", 100)
    one = row_history.RowHistory.begin(np.zeros(2))
    numbers = np.arange(1, 500, dtype=float)
    states = [one := one.append(np.full((1, 2), n), keep_all=False) for n in numbers]
    assert one.end == 500 and 0 < one.first <= 400
    left, right = (states[49].append(np.full((3, 2), sign), keep_all=False) for sign in (-1.0, -2.0))
    assert np.array_equal(left.read(np.array([50, 51]))[:, 0], [50.0, -1.0])
    assert np.array_equal(right.read(np.array([49, 53]))[:, 0], [49.0, -2.0])
    assert np.array_equal(one.read(np.arange(one.first, 500))[:, 0], np.arange(one.first, 500))
    copy = pickle.loads(pickle.dumps(left))
    assert copy.end == left.end == 54 and np.array_equal(copy.read(np.array([1, 53]))[:, 1], [1.0, -1.0])


@pytest.mark.parametrize(
    ("changes", "error"),
    [
        ({"inputs": {"force": "fx"}}, "no quantity 'force'; did you mean 'force_n'"),
        ({"inputs": {"force_n": "vx"}}, "is of causality output, not input"),
        (
            {"inputs": {"force_n": ("fx", "fy")}, "start_inputs": {"force_n": (1.0,)}},
            "has 1 numbers for the 2 elements",
        ),
        ({"inputs": {"force_n": ("fx", "fx", "fz")}}, "'fx' is mapped twice in `inputs`"),
        ({"parameters": {"fx": 3.0}}, "'fx' is among `inputs` and `parameters`; leave it out of `parameters`"),
        ({"start_inputs": {"torque_n_m": 1.0}}, "start_inputs: no quantity 'torque_n_m' among `inputs`"),
        ({"units": UNITS | {"fx": "N.m"}}, "the unit 'N.m', which is not a unit of N"),
        ({"units": UNITS | {"fx": "lbf"}}, "'lbf' is not defined by the FMU and not known"),
        (
            {"outputs": {name: OUTPUTS[name] for name in ("position_m", "velocity_m_s")}},
            "'acceleration_m_s2' is missing",
        ),
    ],
)
def test_wrong_mappings_of_commands(craft, changes, error):
    with pytest.raises((ScenarioError, ValueError), match=error):
        describe_motion(craft, **changes).begin_flight() if "inputs" not in changes else FmuMotion(
            file=craft, step_s=0.01, units=UNITS, **({"axes": "local", "outputs": OUTPUTS} | changes)
        ).begin_flight()


def test_a_state_of_an_fmu_that_was_replaced_is_refused(by_fmu, craft, tmp_path):
    copy = tmp_path / "craft.fmu"
    copy.write_bytes(Path(craft).read_bytes())
    simulation = rl.Simulation(
        by_fmu.replace(follower=by_fmu.follower.replace(motion=describe_motion(str(copy)))), threads=1
    )
    simulation.step()
    simulation.step()
    saved = pickle.dumps(simulation.save())
    assert pickle.loads(saved).time_ns == 10**9
    with zipfile.ZipFile(copy, "a") as archive:
        archive.writestr("resources/tables.csv", "1,2")
    with pytest.raises(ScenarioError, match=r"craft\.fmu: the FMU has changed since the state was saved; restore with"):
        pickle.loads(saved)


@pytest.mark.filterwarnings("error")
def test_a_command_beyond_the_numbers_of_the_fmu_is_refused(craft):
    flight = describe_motion(craft, axes="local", relative_to=None).begin_flight()
    flight.hold(0.0, np.array([0.0, 1e308, 0.0]))
    with pytest.raises(ScenarioError, match=r"craft\.fmu: the input 'fy' is too large in the unit of the FMU"):
        flight(np.array([0.1]))


def test_wrong_commands(by_fmu, craft):
    simulation = rl.Simulation(by_fmu, threads=1)
    for inputs, error in (
        ({"follower": [1.0]}, r"craft\.fmu are \[1\.0\]; give 3 finite numbers"),
        ({"follower": [1.0, math.nan, 0.0]}, "give 3 finite numbers"),
        ({"stage": [1.0]}, "'stage', which has no state-space model or FMU with inputs"),
    ):
        with pytest.raises(ScenarioError, match=error) as caught:
            simulation.step(rl.Command(inputs=inputs))
        assert "\n" not in str(caught.value)
    stated = {name: OUTPUTS[name] for name in OUTPUTS if name != "specific_force_m_s2"}
    silent = by_fmu.replace(follower=by_fmu.follower.replace(motion=describe_motion(craft, outputs=stated)))
    with pytest.raises(ScenarioError, match="sensor 'imu': the follower's motion does not state its thrust"):
        rl.Simulation(silent, threads=1).step()

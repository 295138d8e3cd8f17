"""FMUs in the loop: the instrument written as one and driven by fmpy, and one as a controller."""

import math
import pickle
import zipfile
from pathlib import Path

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.cli.fmu import fmu
from rso_lidar.errors import ScenarioError
from rso_lidar.loop import FmuController, write_fmu
from rso_lidar.loop.fmus.instrument import MEASURED, Instrument, measure
from tests.settings_for_tests import limit_pixels

fmpy = pytest.importorskip("fmpy", reason="the extra `fmi` is not installed")
pytest.importorskip("pythonfmu", reason="the extra `fmi` is not installed")
pytest.importorskip("pythonfmu3", reason="the extra `fmi` is not installed")

EXAMPLES = Path(__file__).resolve().parents[3] / "examples"
TINY = limit_pixels(16)
CONTROLLER = """
import math
from pythonfmu import Fmi2Causality, Fmi2Slave, Real

class Pointer(Fmi2Slave):
    def _get_fmu_state(self):
        return {"count": self.count}

    def _set_fmu_state(self, saved):
        self.count = saved["count"]

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.x = self.y = self.z = self.pan = self.tilt = self.pan_out = self.tilt_out = 0.0
        self.count = 0
        for name in ("x", "y", "z", "pan", "tilt"):
            self.register_variable(Real(name, causality=Fmi2Causality.input, start=0.0))
        for name in ("pan_out", "tilt_out"):
            self.register_variable(Real(name, causality=Fmi2Causality.output))

    def do_step(self, time, step):
        self.count += 1  # a state, beside what is set and read
        if self.z > 0.0 and self.count % 3:  # degrees; x right and y down turn pan and tilt to the other sides
            self.pan_out = self.pan - math.degrees(math.atan2(self.x, self.z))
            self.tilt_out = self.tilt - math.degrees(math.atan2(self.y, self.z))
        return True
"""


@pytest.fixture(scope="module")
def passage():
    return rl.Scenario.load(EXAMPLES / "closed_loop.toml", settings=(*TINY, "time.duration_s=4"))


@pytest.mark.parametrize("version", [2, 3])
def test_fmpy_drives_the_instrument(passage, tmp_path, version):
    """The same commands, once through an FMU and once through a Simulation, give the same readings."""
    path = write_fmu(passage, tmp_path / "lidar.fmu", version=version)
    from fmpy.validation import validate_fmu

    assert validate_fmu(str(path)) == []
    units = {one.name: one.unit for one in fmpy.read_model_description(str(path)).modelVariables}
    assert units["range_m"] == "m" and units["pan_demand_rad"] == "rad" and units["time_s"] == "s"
    times = np.arange(0.0, 4.0, 0.25)
    given = np.zeros(
        len(times), dtype=[("time", float), ("point", int), ("pan_demand_rad", float), ("tilt_demand_rad", float)]
    )
    given["time"], given["point"] = times, times >= 1.0
    given["pan_demand_rad"], given["tilt_demand_rad"] = 0.785 + 0.004 * times, 0.003 * times
    names = [port.name for port in MEASURED] + ["status"]
    table = fmpy.simulate_fmu(
        str(path), stop_time=3.75, output_interval=0.25, input=given, output=names, fmi_type="CoSimulation"
    )
    simulation = rl.Simulation(passage, threads=1)
    measured = [measure(simulation.step().observation)]
    for row in given[:-1]:
        point = row["point"] > 0
        pan, tilt = (float(row[f"{axis}_demand_rad"]) for axis in ("pan", "tilt"))
        simulation.step(
            rl.Command(pan_rad=pan, tilt_rad=tilt) if point else None, dt_s=0.25
        ) if not simulation.is_over else None
        measured.append(measure(simulation.observation))
    assert len(table) == len(measured) == 16
    for port in MEASURED:
        assert np.array_equal(table[port.name], [row[port.name] for row in measured]), port.name
    assert table["target_pixels"].min() > 5 and np.ptp(table["pan_rad"]) > 0.005
    assert set(table["status"][:-2]) == {1} and table["status"][-1] == 2  # the last flash is at 3.5 s


@pytest.mark.parametrize("version", [2, 3])
def test_the_instrument_goes_back_to_its_state(passage, tmp_path, version):
    """fmpy saves the state on the way, as bytes too, and goes on from it: in the same instance, and in another."""
    from fmpy.fmi2 import FMU2Slave
    from fmpy.fmi3 import FMU3Slave

    path = write_fmu(passage, tmp_path / "lidar.fmu", version=version)
    described = fmpy.read_model_description(str(path))
    kind, word = described.coSimulation, "FMUstate" if version == 2 else "FMUState"
    assert kind.canGetAndSetFMUstate and kind.canSerializeFMUstate
    folder = fmpy.extract(str(path), tmp_path / "unpacked")
    given = {"guid": described.instantiationToken, "modelIdentifier": kind.modelIdentifier}
    numbers = {one.name: one.valueReference for one in described.modelVariables}
    names = [port.name for port in MEASURED if not port.is_whole]

    def begin():
        fmu = (FMU2Slave if version == 2 else FMU3Slave)(unzipDirectory=folder, instanceName="lidar", **given)
        fmu.instantiate()
        fmu.enterInitializationMode() if version == 3 else (fmu.setupExperiment(), fmu.enterInitializationMode())
        fmu.exitInitializationMode()
        return fmu

    def fly(fmu, first, last):
        rows = []
        write, read = (fmu.setReal, fmu.getReal) if version == 2 else (fmu.setFloat64, fmu.getFloat64)
        (fmu.setInteger if version == 2 else fmu.setInt32)([numbers["point"]], [1])
        for k in range(first, last):
            write([numbers["pan_demand_rad"], numbers["tilt_demand_rad"]], [0.785 + 0.002 * k, 0.001 * k])
            fmu.doStep(0.25 * k, 0.25)
            rows.append(read([numbers[name] for name in names]))
        return np.array(rows)

    fmu = begin()
    fly(fmu, 0, 5)
    state = getattr(fmu, f"get{word}")()
    data = getattr(fmu, f"serialize{word}")(state)
    onward = fly(fmu, 5, 10)
    assert np.ptp(onward[:, names.index("pan_rad")]) > 0.002 and np.ptp(onward[:, names.index("range_m")]) > 0.1
    getattr(fmu, f"set{word}")(state)
    getattr(fmu, f"free{word}")(state)
    assert np.array_equal(fly(fmu, 5, 10), onward)
    other = begin()
    read_back = other.deSerializeFMUstate if version == 2 else other.deserializeFMUState
    getattr(other, f"set{word}")(read_back(data))
    assert np.array_equal(fly(other, 5, 10), onward)


def test_inputs_of_state_space_models_are_ports(tmp_path):
    scenario = rl.Scenario.load(EXAMPLES / "thrusters.toml", settings=(*TINY, "time.duration_s=20"), trust_code=True)
    path = write_fmu(scenario, tmp_path / "thrusters.fmu")
    with zipfile.ZipFile(path) as archive:
        archive.extractall(tmp_path / "unpacked")
    assert (tmp_path / "unpacked" / "resources" / "thrusters.py").is_file()  # its dynamics travel along
    pushed, drifting = (Instrument.load(tmp_path / "unpacked" / "resources") for _ in range(2))
    assert list(pushed.inputs) == ["follower.u[1]", "follower.u[2]", "follower.u[3]"]
    pushed.inputs["follower.u[2]"] = 0.02
    for one in (pushed, drifting):
        for time_s in (0.0, 2.5, 10.0):
            one.advance(time_s)
    assert drifting.outputs["range_m"] - pushed.outputs["range_m"] == pytest.approx(0.5 * 0.02 * 10.0**2, abs=0.4)
    assert pushed.outputs["time_s"] == 10.0 and pushed.outputs["status"] == 1.0


def test_an_fmu_as_controller_keeps_the_stage_in_the_field(passage, tmp_path):
    from pythonfmu import FmuBuilder

    source = tmp_path / "pointer.py"
    source.write_text(CONTROLLER)
    path = FmuBuilder.build_FMU(source, dest=tmp_path)
    inputs = {"centroid_x_m": "x", "centroid_y_m": "y", "centroid_z_m": "z", "pan_rad": "pan", "tilt_rad": "tilt"}
    given = {
        "inputs": inputs,
        "outputs": {"pan_rad": "pan_out", "tilt_rad": "tilt_out"},
        "units": {"x": "m", "y": "m", "z": "m", **dict.fromkeys(("pan", "tilt", "pan_out", "tilt_out"), "deg")},
    }
    with pytest.raises(ScenarioError, match="runs only where it is trusted; give trust_fmu=True"):
        FmuController(str(path), step_s=0.5, **given)
    for length in ("0.5", 0.0, math.nan, True):
        with pytest.raises(ScenarioError, match=r"step_s: .* is no time between commands; give seconds above 0"):
            FmuController(str(path), step_s=length, trust_fmu=True, **given)
    controller = FmuController(str(path), step_s=0.5, trust_fmu=True, **given)
    for frame in rl.simulate(passage, controller):
        x, y, z = frame.truth.pose("lidar", "stage").translation
    assert math.atan2(math.hypot(x, y), z) < 0.15 * passage.lidar.receiver.fov_rad  # 0.35 of it without a controller
    with pytest.raises(ScenarioError, match=r"not the next instant on the grid of 0\.5 s"):
        controller(frame.observation)
    fast = FmuController(str(path), step_s=0.1, trust_fmu=True, **given)
    with pytest.raises(ScenarioError, match="before the first flash"):
        fast.command_at(0.0, {})
    last_s = [frame.time_s for frame in rl.simulate(passage, fast, command_rate_hz=10)][-1]
    assert fast.command_at(last_s + 0.1, {}).pan_rad is not None  # it has made a step for each tenth of a second


@pytest.mark.parametrize("can_restore", [True, False])
def test_an_fmu_as_controller_goes_back_with_the_simulation(passage, tmp_path, can_restore):
    from pythonfmu import FmuBuilder

    source = tmp_path / "pointer.py"
    source.write_text(CONTROLLER)
    options = {"canGetAndSetFMUstate": can_restore, "canSerializeFMUstate": can_restore}
    path = FmuBuilder.build_FMU(source, dest=tmp_path, **options)
    given = {
        "inputs": {"centroid_x_m": "x", "centroid_z_m": "z", "pan_rad": "pan"},
        "outputs": {"pan_rad": "pan_out"},
        "units": {"x": "m", "z": "m", "pan": "deg", "pan_out": "deg"},
    }
    controller = FmuController(str(path), step_s=0.5, trust_fmu=True, **given)
    simulation = rl.Simulation(passage, threads=1)

    def fly(simulation, controller, count, command=None):
        rows = []
        for _ in range(count):
            command = controller(simulation.step(command).observation)
            rows.append(command.pan_rad)
        return rows

    begun = controller.save()
    fly(simulation, controller, 3)
    if not can_restore:
        with pytest.raises(ScenarioError, match=r"cannot give its state .*, so it cannot be saved; begin again"):
            controller.save()
        controller.restore(begun)
        simulation.reset()
        assert len(fly(simulation, controller, 2)) == 2
        return
    saved = simulation.save(), controller.save()
    onward = fly(simulation, controller, 4)
    simulation.restore(saved[0])
    controller.restore(saved[1])
    assert fly(simulation, controller, 4) == onward and len(set(onward)) > 1
    other = FmuController(str(path), step_s=0.5, trust_fmu=True, **given)
    simulation.restore(saved[0])
    other.restore(pickle.loads(pickle.dumps(saved[1])))
    assert fly(simulation, other, 4) == onward
    for wrong, error in ((3, "is not a state"), (saved[1], "of another FMU or mapping")):
        with pytest.raises(ScenarioError, match=error):
            FmuController(str(path), step_s=0.25, trust_fmu=True, **given).restore(wrong)


def test_what_cannot_be_written(passage, tmp_path, monkeypatch):
    for path, version, error in (("x.zip", 2, "x.zip"), ("x.fmu", 4, "give 2 or 3")):
        with pytest.raises(rl.errors.RsoLidarError, match=error):
            write_fmu(passage, tmp_path / path, version=version)
    (tmp_path / "there.fmu").write_text("")
    with pytest.raises(rl.errors.RsoLidarError, match=r"there\.fmu"):
        fmu(EXAMPLES / "closed_loop.toml", tmp_path / "there.fmu")
    monkeypatch.setitem(__import__("sys").modules, "pythonfmu", None)
    with pytest.raises(ScenarioError, match=r"needs pythonfmu; install it with: pip install rso-lidar\[fmi\]"):
        write_fmu(passage, tmp_path / "x.fmu")
    assert sorted(file.name for file in tmp_path.iterdir()) == ["there.fmu"]

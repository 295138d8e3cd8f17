"""FMUs that other tools exported, from the models of others: against closed forms, through a flight and alone.

Those of OpenModelica are in the wheel of gemseo-fmu (LGPL-3.0, IRT Saint Exupery), which is installed without what it
needs: ``pip install --no-deps gemseo-fmu``. Only its files are read, and none is part of this project.
"""

import importlib.util
import os
import platform
import sys
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
from scipy.linalg import expm

import rso_lidar as rl
from rso_lidar.errors import ScenarioError
from rso_lidar.fmi import FmuModel
from rso_lidar.motion import FmuMotion

pytest.importorskip("fmpy", reason="the extra `fmi` is not installed")

BENCH = Path(__file__).resolve().parents[2] / "examples" / "bench_plate.toml"
SPRING_N_M, DAMPER_N_S_M, MASS_KG, REST_M = 40.0, 2.0, 1.0, -0.5


def find_fmu(name):
    """Return the path of an FMU of gemseo-fmu; where it is not installed or cannot run, the test is skipped."""
    found = importlib.util.find_spec("gemseo_fmu")
    if found is None or not found.submodule_search_locations:
        pytest.skip("gemseo-fmu, whose FMUs OpenModelica exported, is not installed (pip install --no-deps gemseo-fmu)")
    if sys.platform != "linux" or platform.machine() != "x86_64":
        pytest.skip("its FMUs hold binaries for Linux on x86-64")
    return str(Path(found.submodule_search_locations[0], "problems", "fmu_files", "linux", name))


def describe_mass(**changes):
    """Return the motion of OpenModelica's mass on a spring and a damper, of Modelica's standard library with its units."""
    outputs = {name: (variable, 0.0, 0.0) for name, variable in (("position_m", "mass.s"), ("velocity_m_s", "mass.v"))}
    given = {"axes": "local", "step_s": 1e-3, "inputs": {"force_n": "f"}, "outputs": outputs}
    return FmuMotion(
        file=find_fmu("Mass_Damper.fmu"),
        parameters={"spring.c": SPRING_N_M, "damper.d": DAMPER_N_S_M},
        **(given | changes),
    )


def push(state, force_n, time_s):
    """Solve m x'' = f - d x' - c (x - rest) exactly, for a force that is held."""
    rates = np.array(
        [[0.0, 1.0, 0.0], [-SPRING_N_M / MASS_KG, -DAMPER_N_S_M / MASS_KG, 1.0 / MASS_KG], [0.0, 0.0, 0.0]]
    )
    moved = expm(rates * time_s) @ np.array([state[0] - REST_M, state[1], force_n])
    return np.array([moved[0] + REST_M, moved[1]])


@pytest.mark.parametrize(
    ("interface", "within"),
    [("model_exchange", 1e-9), ("co_simulation", 0.05)],  # the second: Euler's steps of 1 ms inside the FMU
)
def test_a_mass_of_openmodelica_moves_under_commanded_forces(interface, within):
    flight = describe_mass(interface=interface).begin_flight()
    state, off = np.zeros(2), []
    for k in range(20):
        force = 5.0 if k % 7 < 3 else -2.0
        flight.hold(0.1 * k, np.array([force]))
        state = push(state, force, 0.1)
        off.append(np.abs(flight(np.array([0.1 * (k + 1)]))[0][[0, 3]] - state).max())
    assert max(off) < within


def test_a_target_flies_as_openmodelica_says():
    """The plate of the bench, 50 m away, on that mass: the range of its pixels is that of the closed form."""
    bench = rl.Scenario.load(
        BENCH, settings=("time.duration_s=0.8", "lidar.receiver.n_rows=8", "lidar.receiver.n_cols=8")
    )
    away = bench.follower.motion.replace(position_m=(-50.0, 0.0, 0.0))
    scenario = bench.replace(
        target=(bench.target[0].replace(motion=describe_mass(interface="model_exchange")),),
        follower=bench.follower.replace(motion=away),
    ).with_trusted_fmus()
    simulation, state = rl.Simulation(scenario, threads=1), np.zeros(2)
    simulation.step()
    while not simulation.is_over:
        force = 20.0 if simulation.time_s < 0.35 else -8.0
        frame = simulation.step(rl.Command(inputs={"plate": [force]}))
        state = push(state, force, 0.1)
        assert frame.truth.pose("lidar", "plate").translation[2] == pytest.approx(50.0 + state[0], abs=1e-9)
    assert abs(np.nanmedian(frame.range_m) - 50.0 - state[0]) < 0.1 and abs(state[0]) > 0.2


class Masses(FmuModel):
    """The outputs of two masses between three springs."""

    output_units: ClassVar[dict[str, tuple[str, int]]] = {"position_m": ("m", 2), "velocity_m_s": ("m/s", 2)}


def test_two_masses_of_openmodelica_swing_as_in_closed_form():
    """All masses and springs are 1; from x = (0, 1), v = (1, 0). The FMU declares no units: the mapping does."""
    model = Masses(
        file=find_fmu("MassSpringSystem.fmu"),
        interface="model_exchange",
        outputs={"position_m": ("x1", "x2"), "velocity_m_s": ("v1", "v2")},
        units={"x1": "m", "x2": "m", "v1": "m/s", "v2": "m/s"},
    )
    run = model.make_run(0.01)
    point, _ = run.begin(np.empty(0))
    _, rows = run.advance(point, np.empty((200, 0)))
    stiff = np.array([[-2.0, 1.0], [1.0, -2.0]])
    rates = np.block([[np.zeros((2, 2)), np.eye(2)], [stiff, np.zeros((2, 2))]])
    exact = np.array([expm(rates * 0.01 * k) @ [0.0, 1.0, 1.0, 0.0] for k in range(1, 201)])
    assert np.abs(rows - exact).max() < 1e-8


class Shafts(FmuModel):
    """Numbers without a unit, and a torque."""

    input_units: ClassVar[dict[str, tuple[str, int]]] = {"torque_n_m": ("N.m", 1)}
    optional_names: ClassVar[frozenset[str]] = frozenset(input_units)
    output_units: ClassVar[dict[str, tuple[str, int]]] = {"values": ("1", 0)}


def find_shared_fmu(name):
    """Return the path of an FMU that the user has put into the folder of real data; without it the test is skipped."""
    path = Path(os.environ.get("RSO_LIDAR_SHARED", "."), "fmus", name)
    if not path.is_file():
        pytest.skip(f"needs {name}, from where docs/fmi.md says, in fmus/ of the folder that RSO_LIDAR_SHARED names")
    return str(path)


def test_a_torsion_bar_of_20sim_meets_its_published_result():
    """TorsionBar of 20-sim 4.6 in the FMI Cross-Check (Modelica Association): its reference result, TorsionBar_ref.csv."""
    model = Shafts(file=find_shared_fmu("TorsionBar.fmu"), outputs={"values": ("LoadDiskRev", "MotorDiskRev")})
    run = model.make_run(0.01)
    point, _ = run.begin(np.empty(0))
    _, rows = run.advance(point, np.empty((1200, 0)))
    published = {
        0.5: (0.82496939248164669, 2.9936455379843712),
        1.0: (1.0050786688176114, 3.7826150359894806),
        5.0: (-0.027350589031067744, -0.084306705373228652),
        12.0: (1.0264273322947917, 3.8244436055445132),
    }
    for time_s, values in published.items():
        assert rows[round(100 * time_s) - 1] == pytest.approx(values, abs=1e-10)


def test_an_integrator_of_simulink_integrates():
    """StateInitExample of libcosim, exported by Simulink R2024b with the FMI Kit: the integral of 1."""
    run = Shafts(file=find_shared_fmu("StateInitExample.fmu"), outputs={"values": "Integrator_out1"}).make_run(0.01)
    _, rows = run.advance(run.begin(np.empty(0))[0], np.empty((100, 0)))
    assert rows[:, 0] == pytest.approx(0.01 * np.arange(1, 101), abs=1e-12)


def test_a_drivetrain_of_dymola_goes_back_to_its_state():
    """Drivetrain of FMPy's tests, exported by Dymola 2021x: both interfaces, a torque by unit, and its state."""
    ends = {}
    for interface in ("model_exchange", "co_simulation"):
        model = Shafts(
            file=find_shared_fmu("Drivetrain.fmu"),
            interface=interface,
            inputs={"torque_n_m": "tau"},
            outputs={"values": "w"},
            relative_tolerance=1e-9,
        )
        with pytest.raises(ScenarioError, match="the unit 'rad/s', which is not a unit of 1"):
            model.make_run(1e-3)
        rated = Rate(**model.model_dump())
        run = rated.make_run(1e-3)
        half, _ = run.advance(run.begin(np.array([10.0]))[0], np.full((500, 1), 10.0))
        end, rows = run.advance(half, np.full((500, 1), -4.0))
        assert np.array_equal(run.advance(half, np.full((500, 1), -4.0))[1], rows) and end.tick == 1000
        ends[interface] = rows[-1, 0]
    assert ends["model_exchange"] == pytest.approx(ends["co_simulation"], abs=1e-6)


class Rate(Shafts):
    """The rate of a shaft under a torque."""

    output_units: ClassVar[dict[str, tuple[str, int]]] = {"values": ("rad/s", 1)}

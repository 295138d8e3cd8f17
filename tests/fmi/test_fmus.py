"""FMUs as drive, motion and attitude: against the built-in drive, with FMUs of others, and with broken ones."""

import math
import os
import pickle
import signal
import subprocess
import sys
import time
import zipfile
from pathlib import Path

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.cli import main
from rso_lidar.cli.truth import truth
from rso_lidar.errors import ScenarioError
from rso_lidar.fmi import host, run
from rso_lidar.mission_analysis import fly_open_loop, timeline
from rso_lidar.motion import FmuAttitude, FmuDrive, FmuMotion
from rso_lidar.motion.dynamics.fmu_history import FmuHistory
from tests.fmi.fmus_for_tests import build_drive, build_oscillator, compile_reference, write_fmu
from tests.settings_for_tests import limit_pixels

pytest.importorskip("fmpy", reason="the extra `fmi` is not installed")
pytest.importorskip("pythonfmu", reason="the extra `fmi` is not installed")

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "closed_loop.toml"
SMALL = (
    "time.duration_s=3",
    *limit_pixels(8),
    "ptu.errors={command_latency_s=0.05}",
)
BUILT_IN = 'ptu.response={type="second_order", natural_hz=3.0, damping=0.7}'
AXES = ("pan", "tilt")
G, T = 9.81, math.sqrt(2 / 9.81)  # the ball falls 1 m


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("fmus")


@pytest.fixture(scope="module")
def drive_file(folder):
    return build_drive(folder)


def describe_drive(path, **changes):
    """Return the drive of an FMU by `build_drive`."""
    kinds = {"demand": "deg", "start": "deg", "angle": "deg", "rate": "deg/s"}
    fields = {
        "file": str(path),
        "inputs": {f"{axis}_rad": f"{axis}_demand" for axis in AXES},
        "outputs": {f"{axis}_rad": f"{axis}_angle" for axis in AXES}
        | {f"{axis}_rate_rad_s": f"{axis}_rate" for axis in AXES},
        "start_variables": {f"{axis}_rad": f"{axis}_start" for axis in AXES},
        "units": {f"{axis}_{kind}": unit for axis in AXES for kind, unit in kinds.items()},
        "parameters": {"natural_hz": 3.0},
    }
    return FmuDrive(**(fields | changes))


@pytest.fixture(scope="module")
def built_in():
    return rl.Scenario.load(EXAMPLE, settings=(*SMALL, BUILT_IN))


def with_drive(scenario, drive):
    return scenario.replace(ptu=scenario.ptu.replace(response=drive)).with_trusted_fmus()


def fly(simulation, first=0, last=6):
    """Fly under commands between flashes, and return the angles and rates of the PTU at each flash."""
    rows = []
    for k in range(first, last):
        command = rl.Command(pan_rad=0.785 + 0.05 * math.sin(3.0 * k), tilt_rad=0.03 * math.cos(2.0 * k))
        if k:
            simulation.step(command, dt_s=0.4321)
            command = rl.Command(pan_rad=0.785, tilt_rad=0.0)  # so that the drive moves at the flash
        pointing = simulation.step(command).truth.pointing
        rows.append([*pointing.actual_rad, *pointing.rate_rad_s])
    return np.array(rows)


def test_an_fmu_of_the_second_order_drive_equals_the_built_in_one(built_in, drive_file):
    """The same equation, once in a kernel and once in an FMU that counts in degrees."""
    ours = fly(rl.Simulation(built_in, threads=1))
    theirs = fly(rl.Simulation(with_drive(built_in, describe_drive(drive_file)), threads=1))
    assert np.ptp(ours[:, 0]) > 0.01 and np.abs(ours[:, 2]).max() > 0.01
    assert np.abs(ours - theirs).max() < 1e-12
    stated = describe_drive(drive_file)
    without = stated.replace(outputs={name: one for name, one in stated.outputs.items() if "rate" not in name})
    changes = fly(rl.Simulation(with_drive(built_in, without), threads=1))
    assert np.array_equal(changes[:, :2], theirs[:, :2])  # angles at flashes on the grid need no rate
    assert np.abs(changes[:, 2:] - theirs[:, 2:]).max() < 5e-3  # rates over 1 ms, at accelerations of some rad/s2


def test_a_simulation_with_an_fmu_goes_back_and_on_again(built_in, drive_file):
    simulation = rl.Simulation(with_drive(built_in, describe_drive(drive_file)), threads=1)
    first = fly(simulation, 0, 2)
    early = simulation.save()
    fly(simulation, 2, 3)
    saved = simulation.save()
    onward = fly(simulation, 3, 6)
    simulation.restore(saved)
    assert np.array_equal(fly(simulation, 3, 6), onward)
    simulation.restore(early)
    fly(simulation, 5, 6)  # other commands, as many steps: the same tick with another state
    simulation.restore(saved)
    assert np.array_equal(fly(simulation, 3, 6), onward)
    other = rl.Simulation(with_drive(built_in, describe_drive(drive_file)), threads=1)
    other.restore(pickle.loads(pickle.dumps(saved)))
    assert np.array_equal(fly(other, 3, 6), onward)
    simulation.reset()
    assert np.array_equal(fly(simulation, 0, 2), first)


def test_an_fmu_without_its_state_says_that_it_cannot_go_back(built_in, folder):
    drive = describe_drive(build_drive(folder, can_restore=False))
    simulation = rl.Simulation(with_drive(built_in, drive), threads=1)
    first = fly(simulation, 0, 3)
    saved = simulation.save()
    fly(simulation, 3, 4)
    simulation.restore(saved)
    with pytest.raises(ScenarioError, match=r"cannot go back from .* s to .* s, because it cannot give its state"):
        simulation.step()
    with pytest.raises(ScenarioError, match="cannot be pickled"):
        pickle.dumps(saved)
    simulation.reset()
    assert np.array_equal(fly(simulation, 0, 3), first)


@pytest.mark.parametrize("version", [2, 3])
def test_the_reference_ball_bounces_as_in_closed_form(folder, version):
    """BouncingBall of the Reference FMUs: from 1 m, with 0.7 of its speed after a bounce (Modelica Association)."""
    path = compile_reference(folder, "BouncingBall", version)
    time_s = np.array([0.0, 0.1, 0.2345, T - 1e-3, T + 0.1, T + 0.3])
    after = np.maximum(time_s - T, 0.0)
    height = np.where(time_s < T, 1.0 - 0.5 * G * time_s**2, 0.7 * G * T * after - 0.5 * G * after**2)
    speed = np.where(time_s < T, -G * time_s, 0.7 * G * T - G * after)
    for interface, within in (("model_exchange", 1e-9), ("co_simulation", 0.02)):  # the second is Euler's, 1 ms a step
        motion = FmuMotion(
            file=str(path),
            interface=interface,
            axes="local",
            step_s=0.01,
            outputs={"position_m": (50.0, -3.0, "h"), "velocity_m_s": (0.0, 0.0, "v")},
        )
        place = motion.place(rl.orbit.Epochs(built_in_start(), time_s), motion.fly_open_loop())
        assert np.array_equal(place.position_m[:, :2], np.tile([50.0, -3.0], (6, 1)))
        smooth = np.array([0, 1, 2, 4, 5])  # not the step with the bounce in it, which a cubic smooths
        assert np.abs(place.position_m[:, 2] - height)[smooth].max() < within
        assert np.abs(place.velocity_m_s[:, 2] - speed)[smooth].max() < 5.0 * within
        grid_s = np.arange(int(T / 0.01)) * 0.01
        wrong_m = np.abs(motion.fly_open_loop()(grid_s)[:, 2] - (1.0 - 0.5 * G * grid_s**2))  # until the bounce
        steps = motion.compare_steps(float(grid_s[-1]))
        assert np.abs(steps.flown - steps.compared)[:, 2] == pytest.approx(wrong_m, abs=1e-9)
    assert "at 1." in motion.advise(2.0)[0] and "its model exchange differ by 0.02" in motion.advise(2.0)[0]
    freely = motion.replace(interface=None)
    assert freely.fly_open_loop().interface == "model_exchange" and not freely.advise(2.0)


def test_half_the_steps_estimate_the_error_of_an_fmu_without_model_exchange(tmp_path):
    """Explicit Euler steps h of an oscillator x'' = -x: the amplitude grows as (1 + h^2)^(t / 2h), by h t / 2 at first."""
    motion = FmuMotion(
        file=str(build_oscillator(tmp_path)),
        axes="local",
        step_s=0.01,
        outputs={"position_m": (50.0, 0.0, "x"), "velocity_m_s": (0.0, 0.0, "v")},
        units={"x": "m", "v": "m/s"},
    )
    (line,) = motion.advise(2.0 * np.pi)
    h, t = 0.01, 6.28
    expected = np.sqrt(1.0 + h**2) ** (t / h) - np.sqrt(1.0 + (h / 2) ** 2) ** (2.0 * t / h)
    assert f"the co-simulation of the FMU and steps of 0.005 s differ by {expected:.2g} m at 6." in line


def built_in_start():
    return rl.Scenario.load(EXAMPLE).time.start_utc


def test_the_reference_feedthrough_is_an_ideal_drive(built_in, folder):
    path = compile_reference(folder, "Feedthrough", 3)
    names = ("Float64_continuous", "Float64_discrete")
    drive = FmuDrive(
        file=str(path),
        inputs={f"{axis}_rad": f"{name}_input" for axis, name in zip(AXES, names, strict=True)},
        outputs={f"{axis}_rad": f"{name}_output" for axis, name in zip(AXES, names, strict=True)},
        units={f"{name}_{end}": "rad" for name in names for end in ("input", "output")},
        pan_limits_deg=(40.0, 44.9),
    )
    rows = fly(rl.Simulation(with_drive(built_in, drive), threads=1))
    ideal = built_in.replace(ptu=built_in.ptu.replace(response=rl.Ideal(pan_limits_deg=(40.0, 44.9))))
    assert np.degrees(rows[:, 0].max()) == pytest.approx(44.9)
    assert np.abs(rows[:, :2] - fly(rl.Simulation(ideal, threads=1))[:, :2]).max() < 1e-15


def test_a_frame_is_the_same_alone_and_in_order(built_in, folder):
    path = compile_reference(folder, "BouncingBall", 2)
    attitude = FmuAttitude(
        file=str(path),
        step_s=0.01,
        outputs={"quaternion_xyzw": (0.0, 0.0, 0.6, 0.8), "body_rate_rad_s": (0.0, 0.0, "h")},
        units={},
    )
    with pytest.raises(ScenarioError, match="'h': has the unit 'm', which is not a unit of rad/s"):
        FmuHistory(attitude)
    attitude = attitude.replace(outputs={"quaternion_xyzw": (0.0, 0.0, 0.6, 0.8), "body_rate_rad_s": (0.0, 0.0, 0.1)})
    scenario = built_in.replace(target=(built_in.target[0].replace(attitude=attitude),)).with_trusted_fmus()
    frames = [*rl.simulate(scenario, threads=1)]
    (alone,) = rl.simulate(scenario, frames=[4], threads=1)
    assert np.array_equal(frames[4].range_m, alone.range_m, equal_nan=True)
    turned = alone.truth.pose("inertial", "stage")
    assert np.abs(turned.rotation.as_quat()) == pytest.approx([0.0, 0.0, 0.6, 0.8], abs=1e-12)


def test_an_fmu_runs_only_where_it_is_trusted(built_in, drive_file, tmp_path):
    scenario = built_in.replace(ptu=built_in.ptu.replace(response=describe_drive(drive_file)))
    with pytest.raises(ScenarioError, match=r"ptu: the FMU .* holds native code, .* give --trust-fmu"):
        rl.Simulation(scenario)
    text = scenario.with_trusted_fmus().source.scenario
    with pytest.raises(ScenarioError, match="holds native code"):  # of a recording, from anybody
        rl.Simulation(rl.Scenario.loads(text, trust_code=True))
    file = tmp_path / "s.toml"
    file.write_text(text)
    untrusted = rl.Scenario.load(file)
    for fly_it in (rl.Simulation, fly_open_loop, rl.Scenario.describe, timeline, lambda one: [*rl.simulate(one)]):
        with pytest.raises(ScenarioError, match="holds native code"):
            fly_it(untrusted)
    assert rl.Simulation(rl.Scenario.load(file, trust_fmu=True)).step().index == 0


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"file": "no.fmu"}, "no.fmu"),
        (
            {"inputs": {"pan_rad": "pan_demnd", "tilt_rad": "tilt_demand"}},
            "no variable 'pan_demnd'; did you mean 'pan_demand'",
        ),
        ({"inputs": {"pan_rad": "pan_demand"}}, "'tilt_rad' is missing"),
        ({"inputs": {"pan_rad": "pan_angle", "tilt_rad": "tilt_demand"}}, "is of causality output, not input"),
        ({"inputs": {"pan": "pan_demand", "tilt_rad": "tilt_demand"}}, "no quantity 'pan'"),
        ({"units": {}}, "declares no unit; state it under `units`"),
        ({"interface": "model_exchange"}, r"no interface model_exchange \(it has co_simulation\)"),
        ({"parameters": {"natural": 1.0}}, "no variable 'natural'"),
        ({"start_variables": {"roll_rad": "pan_start"}}, "start_variables: no quantity 'roll_rad'"),
        ({"outputs": {"pan_rad": ("pan_angle", "pan_rate"), "tilt_rad": "tilt_angle"}}, "unit 'deg/s'|has 1 elements"),
    ],
)
def test_wrong_mappings(drive_file, changes, told):
    with pytest.raises(ScenarioError, match=told):
        describe_drive(drive_file, **changes).begin(0.0, 0.0)


def test_wrong_units(drive_file):
    units = describe_drive(drive_file).units
    for changed, told in (
        ({"pan_demand": "m"}, "the unit 'm', which is not a unit of rad"),
        ({"pan_demand": "furlong"}, "'furlong' is not defined by the FMU and not known"),
    ):
        with pytest.raises(ScenarioError, match=told):
            describe_drive(drive_file, units=units | changed).begin(0.0, 0.0)


def test_files_that_are_no_fmus(drive_file, folder, tmp_path, monkeypatch):
    text = tmp_path / "text.fmu"
    text.write_text("no archive")
    empty, foreign, broken, old = (tmp_path / f"{name}.fmu" for name in ("empty", "foreign", "broken", "old"))
    with zipfile.ZipFile(empty, "w") as archive:
        archive.writestr("readme.txt", "nothing")
    with zipfile.ZipFile(drive_file) as archive:
        description = archive.read("modelDescription.xml").decode()
    with zipfile.ZipFile(foreign, "w") as archive:
        archive.writestr("modelDescription.xml", description)
        archive.writestr("binaries/win64/SecondOrder.dll", b"")
    write_fmu(broken, description[: len(description) // 2], b"", "SecondOrder")
    write_fmu(old, description.replace('fmiVersion="2.0"', 'fmiVersion="1.0"'), b"", "SecondOrder")
    library = tmp_path / "library.fmu"
    write_fmu(library, description, b"not a library", "SecondOrder")
    bomb = tmp_path / "bomb.fmu"
    with zipfile.ZipFile(bomb, "w") as archive:
        archive.writestr("modelDescription.xml", description)
        for k in range(host.MOST_FILES):
            archive.writestr(f"resources/{k}", b"")
    climbing = tmp_path / "climbing.fmu"
    write_fmu(climbing, description, b"", "../../climbed")
    for path, told in (
        (text, "not a ZIP archive"),
        (empty, "has no modelDescription.xml"),
        (foreign, r"no binary for linux64 \(it has win64\)"),
        (broken, "modelDescription.xml cannot be read"),
        (old, "FMI 1.0|cannot be read"),
        (library, "binary cannot be loaded"),
        (bomb, "it is too large"),
        (climbing, "binary cannot be loaded"),
    ):
        with pytest.raises(ScenarioError, match=rf"^{path.name}: .*({told})") as caught:
            describe_drive(path).begin(0.0, 0.0)
        assert "\n" not in str(caught.value)
    assert not list(tmp_path.parent.rglob("climbed.so"))


@pytest.mark.parametrize(
    ("fail", "told"),
    [
        ("(_ for _ in ()).throw(RuntimeError('motor on fire'))", "failed with status"),
        ("False", "failed with status"),
        ("__import__('os').abort()", "ended its process with status -6"),
        ("values.__setitem__(1, float('nan')) or True", "'tilt_angle' is not a finite number at t = 0.001 s"),
        ("__import__('time').sleep(60)", "has not answered for 1 s"),
        ("print('noise' * 100000) or True", None),
    ],
)
def test_fmus_that_fail(folder, monkeypatch, fail, told):
    monkeypatch.setattr(run, "_ANSWER_S", 10.0 if "sleep" not in fail else 1.0)
    drive = describe_drive(build_drive(folder, fail=fail))
    if "sleep" in fail:
        monkeypatch.setattr(run, "_ANSWER_S", 10.0)
    axes, further = drive.begin(0.1, 0.0)
    monkeypatch.setattr(run, "_ANSWER_S", 1.0 if "sleep" in fail else 10.0)
    if told is None:
        ((pan, _), _), _ = drive.advance(0.0, 1e-3, axes, further, np.array([[0.1, 0.0]]))
        assert pan == pytest.approx(0.1)
        return
    with pytest.raises(ScenarioError, match=told) as caught:
        drive.advance(0.0, 1e-3, axes, further, np.zeros((3, 2)))
    assert "\n" not in str(caught.value)


def test_the_process_of_an_fmu_ends_with_its_run(drive_file):
    run = describe_drive(drive_file).make_run(1e-3)
    process = run._process._process
    folder = Path(process.args[-1])
    assert process.poll() is None and (folder / "modelDescription.xml").is_file()
    del run
    assert process.wait(timeout=10.0) == 0 and not folder.exists()


# Runs two FMUs: a fork keeps the input of the first one open, the second one hangs in a request.
ASKS = """
import os, sys, threading, time
from pathlib import Path
from rso_lidar.fmi.run import HostProcess

drive, fifo = sys.argv[1:]
idle = HostProcess(Path(drive))
if not (fork := os.fork()):
    time.sleep(60)
hanging = HostProcess(Path(drive))
threading.Thread(target=hanging.ask, args=("describe", fifo), daemon=True).start()
print(idle._process.pid, hanging._process.pid, fork, flush=True)
time.sleep(60)
"""


def is_running(process):
    """Return whether a process runs; one that has ended waits for its new parent to notice."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_the_processes_of_fmus_end_with_a_process_that_is_killed(drive_file, tmp_path):
    os.mkfifo(tmp_path / "fifo")  # opening it takes until somebody writes
    command = [sys.executable, "-c", ASKS, str(drive_file), str(tmp_path / "fifo")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as asking:
        *hosts, fork = map(int, asking.stdout.readline().split())
        assert all(map(is_running, hosts))
        asking.kill()
        asking.wait()
        until_s = time.monotonic() + 10.0
        while any(map(is_running, hosts)) and time.monotonic() < until_s:
            time.sleep(0.05)
        left = [host for host in hosts if is_running(host)]
        os.kill(fork, signal.SIGKILL)
    assert len(hosts) == 2 and not left


def test_the_command_line_says_it_in_one_line(built_in, drive_file, tmp_path, capsys):
    scenario = with_drive(built_in, describe_drive(drive_file))
    file = tmp_path / "s.toml"
    file.write_text(scenario.source.scenario)
    with pytest.raises(SystemExit) as refused:
        main(["check", str(file)])
    printed = capsys.readouterr().err
    assert refused.value.code == 2 and printed.count("\n") == 1 and "--trust-fmu" in printed
    truth(file, tmp_path / "truth.csv", trust_fmu=True)
    assert (tmp_path / "truth.csv").read_text().count("\n") > 6

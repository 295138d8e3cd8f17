"""Frames made in other processes: the same bits, bad calls told, and nobody left behind."""

import contextlib
import multiprocessing
import os
import pickle
import signal
import subprocess
import sys
import textwrap
import time
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.errors import RunError, ScenarioError, warn
from rso_lidar.mission_analysis import find_range
from rso_lidar.processes import Processes, send_function
from rso_lidar.study import Requirements
from tests.settings_for_tests import limit_pixels
from tests.study.trades.trade_for_tests import folder_with
from tests.study.verification.requirements_for_tests import FILE


@contextlib.contextmanager
def sent_to_processes(count, function):
    with Processes(count) as processes, send_function(function, processes) as sent:
        yield sent


@pytest.fixture(scope="module")
def scenario():
    return rl.Scenario.load("examples/tdrs_approach.toml", (*limit_pixels(16), "time.frame_rate_hz=0.01"))


@pytest.fixture(scope="module")
def worker():
    """Return one process for the tests that leave it as it is: each start takes a second."""
    with Processes(1) as process:
        yield process


class Stubborn:
    """A motion that refuses to be pickled, with an error of its own."""

    def states(self, epochs):
        raise NotImplementedError

    def __getstate__(self):
        raise ValueError("not to be copied")


def test_an_object_that_cannot_be_pickled_is_told(scenario):
    with pytest.raises(
        ScenarioError, match=r"workers: the scenario cannot be sent .*\(not to be copied\); .*leave out workers"
    ):
        with sent_to_processes(1, Stubborn().states):
            pass


class Restless(Stubborn):
    """A motion that can be pickled, and not restored."""

    def __getstate__(self):
        return {"a": 1}

    def __setstate__(self, state):
        raise ValueError("not to be restored")


def test_an_object_that_cannot_be_restored_is_told(worker):
    with send_function(Restless().states, worker) as sent:
        future = sent.submit(None)
        with pytest.raises(
            ScenarioError, match=r"cannot be rebuilt in another process \(ValueError: not to be restored\)"
        ):
            sent.result(future)


def test_every_value_gives_a_result():
    with sent_to_processes(2, abs) as sent:
        assert sorted(sent.map_unordered(range(-9, 1))) == list(range(10))
        assert list(sent.map_unordered(())) == []


class OddError(Exception):
    """An exception that cannot be restored: it is called with one argument less."""

    def __init__(self, one, two):
        super().__init__(one)


def raise_odd():
    raise OddError("one", "two")


def test_an_exception_that_cannot_be_restored_is_told(worker):
    with send_function(raise_odd, worker) as sent:
        future = sent.submit()
        with pytest.raises(RunError, match=r"workers: a call raised OddError: one; leave out workers to see where"):
            sent.result(future)


@dataclass(frozen=True)
class Matt:
    """A material of the user's own."""

    albedo: float

    def brdf_per_sr(self, cos_in, cos_out, cos_phase):
        return self.albedo / np.pi


@pytest.mark.slow
def test_workers_take_a_material_of_the_users_own(scenario):
    matt = scenario.replace(target=(scenario.target[0].replace(material=Matt(0.3), part_materials={}),))
    (alone,), (shared,) = (list(rl.simulate(matt, frames=[20], **how)) for how in ({"threads": 1}, {"workers": 1}))
    assert alone.valid.any()
    np.testing.assert_array_equal(alone.range_m, shared.range_m)


class Elsewhere(Executor):
    """Calls received as on another machine, pickled, by two threads; counts them."""

    _max_workers = 2

    def __init__(self):
        self.threads, self.submitted = ThreadPoolExecutor(2), 0

    def submit(self, fn, /, *given, **chosen):
        self.submitted += 1
        return self.threads.submit(call_pickled, pickle.dumps((fn, given, chosen)))

    def shutdown(self, wait=True, *, cancel_futures=False):
        self.threads.shutdown(wait)


def call_pickled(sent):
    fn, given, chosen = pickle.loads(sent)
    return pickle.loads(pickle.dumps(fn(*given, **chosen)))


@pytest.fixture(scope="module")
def alone(scenario):
    return list(rl.simulate(scenario, threads=1, frames=range(20, 24), keep=("photons", "waveforms")))


@pytest.fixture(params=["process", "threads", "pickled"])
def executor(request, worker):
    if request.param == "process":
        yield worker
        return
    with ThreadPoolExecutor(2) if request.param == "threads" else Elsewhere() as pool:
        yield pool


def test_any_executor_makes_the_same_frames_as_one_thread(scenario, alone, executor):
    chosen = {"frames": range(20, 24), "keep": ("photons", "waveforms")}
    found = list(rl.simulate(scenario, executor=executor, **chosen))
    assert [frame.index for frame in found] == list(range(20, 24))
    for one, other in zip(alone, found, strict=True):
        assert one.range_m.tobytes() == other.range_m.tobytes()
        assert one.intensity_counts.tobytes() == other.intensity_counts.tobytes()
        assert one.labels.range_m.tobytes() == other.labels.range_m.tobytes()
        assert one.truth.pointing.measured_rad.tobytes() == other.truth.pointing.measured_rad.tobytes()
        assert np.shares_memory(other.line_of_sight, found[0].line_of_sight)  # not a copy for each frame
        assert other.source is scenario.source
        assert not any(image.flags.writeable for image in (other.range_m, other.labels.range_m, other.labels.photons))
        np.testing.assert_array_equal(one.kept["photons"].photons, other.kept["photons"].photons)
        np.testing.assert_array_equal(one.kept["waveforms"].samples_counts, other.kept["waveforms"].samples_counts)


def test_at_most_two_frames_for_each_worker_wait(scenario):
    with Elsewhere() as executor:
        for number, _ in enumerate(rl.simulate(scenario, executor=executor, frames=range(7))):
            assert executor.submitted - number == min(4, 7 - number)


FAST = rl.Lidar(
    preset="gsfl_1064",
    detector=rl.Empirical(),
    receiver={"fov_deg": 0.625, "n_rows": 32, "n_cols": 32, "rays_per_pixel": 25},
)


def find_a_cubesat(_folder, _text, executor):
    """Beyond the range at which it is found with the wanted probability: no attitude is turned, which takes longest."""
    return find_range(FAST, "cubesat_3u", attitudes=6, range_m=(1300.0, 1500.0), executor=executor)


def make_a_timeline(_folder, text, executor):
    glare = "f_number = 2.8\nfilter_width_nm = 1.0\nglare = {}"
    sunny = text.replace("f_number = 2.8", glare).replace(
        'axes = "local"', 'axes = "local"\nsun_direction = [-1, 0, 0.1]'
    )
    return rl.timeline(rl.Scenario.loads(sunny), executor=executor)


def run_a_trade(folder, text, executor):
    return rl.study.trade(folder_with(folder, text), executor=executor)


def verify_a_scenario(_folder, text, executor):
    asked = Requirements.loads(FILE.replace("[[requirement]]", "seeds = 2\n[[requirement]]", 1))
    scenario = rl.Scenario.loads(text, settings=("time.duration_s=1",))
    return rl.study.verify(asked, scenario, executor=executor)


@pytest.mark.parametrize("work", [find_a_cubesat, make_a_timeline, run_a_trade, verify_a_scenario])
def test_an_executor_changes_no_bit_of(work, text, tmp_path):
    with Elsewhere() as executor:
        result = work(tmp_path, text, executor)
    assert executor.submitted > 1
    written = [it.save(tmp_path / f"{k}.csv").read_bytes() for k, it in enumerate((result, work(tmp_path, text, None)))]
    assert written[0] == written[1]


@pytest.mark.slow
def test_a_zoom_and_a_plan_travel_to_the_workers(text):
    scenario = rl.Scenario.loads(text).replace(seed=3)
    schedule = {"time_s": [0.0, 1.0], "focal_length_mm": [60.0, 120.0]}
    lidar = scenario.lidar
    lidar = lidar.replace(receiver=lidar.receiver.replace(fov_deg=None, focal_length_mm=60.0), schedule=schedule)
    scenario = scenario.replace(lidar=lidar)
    pairs = zip(rl.simulate(scenario, threads=1), rl.simulate(scenario, workers=1), strict=True)
    for one, other in pairs:
        assert one.range_m.tobytes() == other.range_m.tobytes()
        assert one.line_of_sight.tobytes() == other.line_of_sight.tobytes()
        assert dict(one.observation.settings) == dict(other.observation.settings)


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ({"workers": 0}, "workers: needs a whole number from 1, not 0"),
        ({"workers": 2.0}, "workers: needs a whole number"),
        ({"workers": True}, "workers: needs a whole number"),
        ({"threads": -1}, "threads: needs a whole number"),
        ({"workers": 2, "threads": 2}, "threads or by workers"),
        ({"workers": 2, "controller": lambda observation: None}, "leave out workers"),
        ({"executor": 2}, "executor: needs an Executor"),
        ({"executor": Elsewhere(), "workers": 2}, "executor: needs an Executor of .* and no workers"),
        ({"executor": Elsewhere(), "threads": 2}, "threads or by workers"),
        ({"executor": Elsewhere(), "controller": lambda observation: None}, "leave out workers"),
    ],
)
def test_what_cannot_be_asked_is_told_before_anything_starts(scenario, asked, words):
    with pytest.raises(ScenarioError, match=words):
        rl.simulate(scenario, **asked)


def test_what_cannot_be_sent_is_named():
    with pytest.raises(ScenarioError, match="workers: the scenario cannot be sent to other processes"):
        with sent_to_processes(1, lambda: 0):
            pass


def test_a_daemon_is_told_that_it_may_start_none(monkeypatch):
    monkeypatch.setitem(multiprocessing.current_process()._config, "daemon", True)
    with pytest.raises(ScenarioError, match="workers: a daemon process cannot start processes"):
        Processes(1)


def fails(scenario_error):
    if scenario_error:
        raise ScenarioError("tdrs: gone; look elsewhere")
    os._exit(3)


def test_an_error_in_a_worker_comes_back_as_it_is(worker):
    with send_function(fails, worker) as sent, pytest.raises(ScenarioError, match=r"^tdrs: gone; look elsewhere$"):
        sent.result(sent.submit(True))


def test_a_worker_that_dies_is_told_in_one_line():
    with sent_to_processes(1, fails) as sent:
        with pytest.raises(RunError, match="workers: a process ended before its call returned"):
            sent.result(sent.submit(False))
        with pytest.raises(RunError, match="workers: a process ended"):
            sent.submit(True)


def test_leaving_early_ends_the_workers(scenario):
    before = set(_children(os.getpid()))
    frames = rl.simulate(scenario, workers=1)
    next(frames)
    frames.close()  # returns once they have ended
    assert not [child for child in set(_children(os.getpid())) - before if "spawn_main" in _command(child)]


@pytest.mark.skipif(not Path("/proc/self").is_dir(), reason="looks for processes in /proc")
def test_a_parent_that_is_killed_leaves_no_worker_behind(tmp_path):
    script = tmp_path / "long.py"
    script.write_text(
        textwrap.dedent(
            """
            import time
            from rso_lidar.processes import Processes

            if __name__ == "__main__":
                with Processes(2) as processes:
                    waiting = [processes.submit(time.sleep, 600) for _ in range(2)]
                    print("started", flush=True)
                    waiting[0].result()
            """
        )
    )
    with subprocess.Popen([sys.executable, str(script)], stdout=subprocess.PIPE, text=True) as parent:
        assert parent.stdout.readline() == "started\n"
        while len(children := _children(parent.pid)) < 2:
            time.sleep(0.05)
        time.sleep(1.0)
        parent.send_signal(signal.SIGKILL)
        parent.wait()
    while any(
        Path(f"/proc/{child}").exists() for child in children
    ):  # for ever, where they outlive it: a limit ends that
        time.sleep(0.05)


UNGUARDED = """
import time
from functools import partial
from rso_lidar.processes import Processes, send_function

with Processes(2) as processes, send_function(partial(time.sleep, bytes(1_000_000)), processes) as sent:
    sent.result(sent.submit())
"""


@pytest.mark.slow
def test_a_script_without_a_guard_is_told_and_does_not_hang(tmp_path):
    """What is sent is more than a pipe holds, and the process that should read it dies before."""
    script = tmp_path / "unguarded.py"
    script.write_text(UNGUARDED)
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert 'needs `if __name__ == "__main__":`' in done.stderr.replace("\n", " ")


def _children(pid):
    found = []
    for entry in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            if int((entry / "stat").read_text().rpartition(")")[2].split()[1]) == pid:
                found.append(int(entry.name))
    return found


def _command(pid):
    with contextlib.suppress(OSError):
        return Path(f"/proc/{pid}/cmdline").read_text()
    return ""


def waits(_data):
    time.sleep(60.0)


def test_leaving_early_ends_a_call_that_waits_at_a_full_pipe():
    with pytest.raises(KeyError), sent_to_processes(1, waits) as sent:
        for _ in range(4):
            sent.submit(bytes(300_000))  # a pipe holds 65,536
        raise KeyError


def warns(word):
    warn(f"tdrs: {word}")


def test_a_warning_of_a_worker_is_one_line_without_a_place_in_the_source(capfd):
    with sent_to_processes(1, warns) as sent:
        sent.result(sent.submit("1,370 m across"))
    assert capfd.readouterr().err == "warning: tdrs: 1,370 m across\n"

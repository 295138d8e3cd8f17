"""The command line: what it prints, what it leaves, and with which status."""

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.cli import main


@pytest.fixture
def scenario(text, tmp_path):
    path = tmp_path / "bench.toml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.fixture
def call(capsys):
    """Return a function that runs a command and gives status, standard output and the lines of standard error."""

    def run(*arguments):
        with pytest.raises(SystemExit) as left:
            main([str(argument) for argument in arguments])
        printed = capsys.readouterr()
        return left.value.code or 0, printed.out, printed.err.splitlines()

    return run


def test_version(call):
    assert call("--version") == (0, f"rso-lidar {rl.__version__}\n", [])


def test_help_names_every_command(call):
    _, out, _ = call("--help")
    for command in ["check", "run", "info", "plot", "animate", "models", "schema"]:
        assert command in out


def test_models(call):
    status, out, _ = call("models")
    assert status == 0
    for name in ["tdrs", "juno", "cubesat_3u", "rocket_body"]:
        assert name in out


def test_schema_is_what_the_files_fill(call):
    schema = json.loads(call("schema")[1])
    assert {"version", "time", "target", "follower", "ptu", "lidar"} <= set(schema["properties"])
    assert "energy_mj" in schema["$defs"]["Laser"]["properties"]


def test_check(call, scenario):
    status, out, err = call("check", scenario)
    assert (status, err) == (0, [])
    assert "a plate on a bench" in out
    assert "P(detect)" in out


def test_run_info_plot_animate(call, scenario, tmp_path):
    output = tmp_path / "bench.h5"
    status, out, _ = call("run", scenario, "-o", output)
    assert status == 0
    assert "10 in" in out
    status, out, _ = call("info", output)
    assert status == 0
    for words in ["10, 0 to 1.8 s", "32 x 32", "plate", "complete", "ptu", "lidar"]:
        assert words in out, words
    for arguments, name in [
        (("plot", output), "bench_sheet.png"),
        (("plot", output, "--frame", 3), "bench_frame3.png"),
        (("plot", output, "--path"), "bench_path.png"),
        (("plot", output, "--curves"), "bench_curves.png"),
        (("animate", output, tmp_path / "bench.gif"), "bench.gif"),
    ]:
        status, _, err = call(*arguments)
        assert (status, err) == (0, [])
        assert (tmp_path / name).stat().st_size > 1000


def test_frames_seed_and_set(call, scenario, tmp_path):
    call("run", scenario, "-o", tmp_path / "a.h5")
    call("run", scenario, "-o", tmp_path / "b.h5", "--frames", "4:7", "--threads", 1)
    call("run", scenario, "-o", tmp_path / "c.h5", "--frames", "4:7", "--seed", 8)
    call("run", scenario, "-o", tmp_path / "d.h5", "--frames", "4:7", "--set", "lidar.laser.energy_mj=5")
    with (
        rl.open(tmp_path / "a.h5") as a,
        rl.open(tmp_path / "b.h5") as b,
        rl.open(tmp_path / "c.h5") as c,
        rl.open(tmp_path / "d.h5") as d,
    ):
        np.testing.assert_array_equal(b.range_m[:], a.range_m[4:7])
        assert not np.array_equal(c.range_m[:], b.range_m[:], equal_nan=True)
        # Other noise, but the same PTU jitter is drawn from the seed too: geometry agrees to what jitter moves.
        assert c.source.seed == 8
        np.testing.assert_allclose(d.labels.photons[:], b.labels.photons[:] / 10, rtol=1e-6)


def test_every_nth_frame_and_frames_by_their_number(call, scenario, tmp_path):
    output = tmp_path / "thin.h5"
    assert call("run", scenario, "-o", output, "--frames", "1:9:3")[0] == 0
    with rl.open(output) as recording:
        assert recording.frame_index[:].tolist() == [1, 4, 7]
    assert call("plot", output, "--frame", 4)[0] == 0
    status, _, err = call("plot", output, "--frame", 5)
    assert (status, len(err)) == (2, 1)
    assert "1 to 7" in err[0]


def test_a_run_that_is_complete_has_nothing_to_resume(call, scenario, tmp_path):
    output = tmp_path / "done.h5"
    call("run", scenario, "-o", output)
    before = output.stat().st_mtime_ns
    status, out, _ = call("run", scenario, "-o", output, "--resume")
    assert status == 0
    assert "already" in out
    assert output.stat().st_mtime_ns == before
    status, _, err = call("run", scenario, "-o", output, "--resume", "--seed", 99)
    assert (status, len(err)) == (2, 1)  # another run's recording is in the way


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("fly",), "No such command"),
        (("run",), "FILE"),
        (("run", "{scenario}"), "--output"),
        (("run", "{scenario}", "-o", "{folder}/none/x.h5"), "no folder"),
        (("run", "{scenario}", "-o", "{folder}"), "suffix"),
        (("run", "{scenario}", "-o", "{folder}/x.txt"), ".h5"),
        (("run", "{scenario}", "-o", "{folder}/x.h5", "--frames", "a:b"), "A:B"),
        (("run", "{scenario}", "-o", "{folder}/x.h5", "--frames", "20:30"), "0 to 9"),
        (("run", "{scenario}", "-o", "{folder}/x.h5", "--threads", "0"), "--threads"),
        (("run", "{scenario}", "-o", "{folder}/x.h5", "--set", "lidar.laser.energy_mj=-1"), "energy_mj"),
        (("check", "{folder}/none.toml"), "no such file"),
        (("info", "{folder}/none.h5"), "no such file"),
        (("info", "{scenario}"), "suffix"),
        (("plot", "{folder}/none.h5"), "no such file"),
        (("animate", "{folder}/none.h5", "{folder}/x.gif"), "no such file"),
    ],
)
def test_bad_input_gets_one_line_and_status_2(call, scenario, tmp_path, arguments, words):
    before = sorted(tmp_path.rglob("*"))
    status, _, err = call(*(argument.format(scenario=scenario, folder=tmp_path) for argument in arguments))
    assert status == 2
    assert len(err) == 1
    assert words in err[0]
    assert sorted(tmp_path.rglob("*")) == before, "nothing may be left behind"


def test_an_output_that_exists_is_kept(call, scenario, tmp_path):
    output = tmp_path / "kept.h5"
    output.write_bytes(b"precious")
    status, _, err = call("run", scenario, "-o", output)
    assert (status, len(err)) == (2, 1)
    assert "--overwrite" in err[0]
    assert output.read_bytes() == b"precious"
    assert call("run", scenario, "-o", output, "--overwrite")[0] == 0
    assert output.stat().st_size > 10_000


def test_a_killed_run_resumes_to_the_same_datasets(call, scenario, tmp_path):
    """Kill a run with SIGKILL once it has frames, resume it, and compare every dataset with an unbroken run's."""
    import h5py

    slow = ("--set", "time.duration_s=40", "--set", "lidar.receiver.rays_per_pixel=400")
    whole, broken = tmp_path / "whole.h5", tmp_path / "broken.h5"
    command = [sys.executable, "-m", "rso_lidar", "run", str(scenario), "-o", str(broken), *slow]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    deadline = time.monotonic() + 60.0
    temporary = []
    while time.monotonic() < deadline and process.poll() is None:
        temporary = [path for path in tmp_path.glob("broken.h5.tmp-*") if not path.name.endswith(".starting")]
        if temporary and temporary[0].stat().st_size > 150_000:
            break
        time.sleep(0.01)
    assert process.poll() is None, "the run ended before it could be killed: make it longer"
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    assert not broken.exists()
    with rl.open(temporary[0]) as part:
        assert not part.complete
        assert 0 < len(part) < 200

    status, out, _ = call("run", scenario, "-o", broken, "--resume", *slow)
    assert status == 0
    assert "going on after" in out
    assert not list(tmp_path.glob("broken.h5.tmp-*"))
    assert call("run", scenario, "-o", whole, *slow)[0] == 0
    with h5py.File(whole) as a, h5py.File(broken) as b:
        names: list[str] = []
        a.visititems(lambda name, item: names.append(name) if isinstance(item, h5py.Dataset) else None)
        assert len(names) > 30
        for name in names:
            np.testing.assert_array_equal(a[name][()], b[name][()], err_msg=name)

"""`rso-lidar export`: every quick format from a recording, compared with what flies the scenario, and bad input."""

import csv
import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import rso_lidar as rl
from rso_lidar.cli import main
from rso_lidar.errors import has_warnings_enabled
from rso_lidar.orbit.ccsds.reader import read_message

FLYBY = Path(__file__).resolve().parents[2] / "examples" / "tle_flyby.toml"
SMALL = (
    "--set",
    "lidar.receiver.n_rows=8",
    "--set",
    "lidar.receiver.n_cols=8",
    "--set",
    "lidar.receiver.rays_per_pixel=1",
)
COUNT = 18  # frames of the fly-by, each tenth


def left(arguments):
    with pytest.raises(SystemExit) as status:
        main([str(argument) for argument in arguments])
    return status.value.code or 0


@pytest.fixture
def call(capsys):
    """Return a function that runs `export` and gives status, standard output and the lines of standard error."""

    def run(*arguments):
        capsys.readouterr()
        status = left(["export", *arguments])
        printed = capsys.readouterr()
        return status, printed.out, printed.err.splitlines()

    return run


@pytest.fixture(scope="module")
def flyby(tmp_path_factory):
    path = tmp_path_factory.mktemp("flyby") / "flyby.h5"
    assert left(["run", FLYBY, "-o", path, "--frames", "::10", *SMALL]) == 0
    return path


@pytest.fixture(scope="module")
def bench_once(text, tmp_path_factory):
    """Return the folder of a scenario and its recording in a local world."""
    folder = tmp_path_factory.mktemp("bench")
    (folder / "bench.toml").write_text(text, encoding="utf-8")
    assert left(["run", folder / "bench.toml", "-o", folder / "bench.h5", *SMALL]) == 0
    return folder


@pytest.fixture
def bench(bench_once, tmp_path):
    """Return a copy of that recording, beside one of the scenario."""
    shutil.copytree(bench_once, tmp_path, dirs_exist_ok=True)
    return tmp_path / "bench.h5"


def table(path):
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


@pytest.mark.parametrize("local", [False, True])
def test_the_table_is_the_one_that_truth_writes(call, request, tmp_path, local):
    recording = request.getfixturevalue("bench" if local else "flyby")
    scenario = tmp_path / "bench.toml" if local else FLYBY
    every = (
        ()
        if local
        else ("--every", str(10 * (rl.Scenario.load(FLYBY).time.duration_s / rl.Scenario.load(FLYBY).time.n_frames)))
    )
    status, said, errors = call(recording, "--to", tmp_path / "a.csv")
    assert (status, errors) == (0, [])
    assert (
        said.startswith(f"written     {tmp_path / 'a.csv'} (csv, ")
        and said.count("\n") == 1
        and "; lost: all images" in said
    )
    assert left(["truth", scenario, "-o", tmp_path / "b.csv", *every]) == 0
    ours, theirs = table(tmp_path / "a.csv"), table(tmp_path / "b.csv")[: len(table(tmp_path / "a.csv"))]
    assert len(ours) == (10 if local else COUNT)
    assert list(ours[0]) == list(theirs[0])
    for a, b in zip(ours, theirs, strict=True):
        assert a.pop("utc") == b.pop("utc")
        for name in a:
            # A recorded rotation is rounded to 2e-15, on arms of up to 7e6 m; angles at ranges of kilometres.
            assert float(a[name]) == pytest.approx(
                float(b[name]), rel=1e-12, abs=2e-7 if name.endswith("_m") else 1e-9
            ), name


def test_trajectories(call, flyby, tmp_path):
    for form in ("tum", "kitti"):
        for more in ((), ("--lidar-in-target",)):
            assert call(flyby, "--to", tmp_path / "out.txt", "--format", form, "--overwrite", *more)[0] == 0
            rows = np.loadtxt(tmp_path / "out.txt")
            with rl.open(flyby) as frames:
                ends = ("stage", "lidar") if more else ("lidar", "stage")
                poses = [frame.truth.pose(*ends) for frame in frames]
                times = frames.time_s[:]
            if form == "tum":
                np.testing.assert_allclose(rows[:, 0], times, atol=1e-9)
                where, turn = rows[:, 1:4], Rotation.from_quat(rows[:, 4:]).as_matrix()
            else:
                matrices = rows.reshape(-1, 3, 4)
                where, turn = matrices[..., 3], matrices[..., :3]
            np.testing.assert_allclose(where, [pose.translation for pose in poses], atol=2e-9)
            np.testing.assert_allclose(turn, [pose.rotation.as_matrix() for pose in poses], atol=1e-14)


@pytest.mark.parametrize("target", [None, "stage"])
def test_an_ephemeris(call, flyby, tmp_path, target):
    path = tmp_path / "out.oem"
    assert call(flyby, "--to", path, *(("--target", target) if target else ()))[0] == 0
    message = read_message(path.read_text(), "OEM", "out.oem")
    (segment,) = message.segments
    assert segment.meta["OBJECT_NAME"].value == (target or "follower")
    assert segment.rows[0][1][0] == "2024-09-17T11:58:30.000"
    with rl.open(flyby) as frames:
        states = [frame.truth.states[target or "follower"] for frame in frames]
    numbers = np.array([cells[1:] for _, cells in segment.rows], dtype=float) * 1e3
    np.testing.assert_allclose(numbers[:, :3], [state.position_m for state in states], atol=6e-7)  # written to 1e-6 m
    np.testing.assert_allclose(numbers[:, 3:], [state.velocity_m_s for state in states], atol=6e-10)


def test_what_a_recording_names_lies_beside_it(call, flyby, tmp_path, monkeypatch):
    """A motion's file is looked up beside the recording, and what the run has warned of is not told again."""
    import rso_lidar.evaluation.conversion as command

    beside, asked = flyby.with_name("plan.csv"), []
    beside.write_text("", encoding="utf-8")

    def breaks_s(scenario, name):
        asked.append((scenario.file("plan.csv"), has_warnings_enabled()))
        return set()

    monkeypatch.setattr(command, "find_velocity_jumps_s", breaks_s)
    assert call(flyby, "--to", tmp_path / "x.oem")[0] == 0
    assert asked == [(beside, False)]


def test_impulses_break_an_ephemeris(call, tmp_path, monkeypatch):
    import rso_lidar.evaluation.conversion as command

    path = tmp_path / "hop.h5"
    example = FLYBY.with_name("tdrs_approach.toml")
    assert left(["run", example, "-o", path, "--frames", "0:12", *SMALL]) == 0
    monkeypatch.setattr(command, "find_velocity_jumps_s", lambda scenario, name: {0.0, 21.0, 1e6})
    assert call(path, "--to", tmp_path / "hop.oem")[0] == 0
    segments = read_message((tmp_path / "hop.oem").read_text(), "OEM", "hop.oem").segments
    assert [len(segment.rows) for segment in segments] == [5, 7]  # frames each 5 s
    monkeypatch.setattr(command, "find_velocity_jumps_s", lambda scenario, name: {3.0})
    status, _, errors = call(path, "--to", tmp_path / "hop.oem", "--overwrite")
    assert status == 0 and errors == [
        "warning: follower: the impulse at 3 s has fewer than two frames beside it and is not marked"
    ]


def test_an_attitude(call, flyby, tmp_path):
    path = tmp_path / "out.aem"
    assert call(flyby, "--to", path, "--target", "lidar")[0] == 0
    message = read_message(path.read_text(), "AEM", "out.aem")
    (segment,) = message.segments
    quaternions = np.array([cells[1:] for _, cells in segment.rows], dtype=float)
    with rl.open(flyby) as frames:
        turned = [frame.truth.pose("inertial", "lidar").rotation.as_matrix() for frame in frames]
    np.testing.assert_allclose(Rotation.from_quat(quaternions).as_matrix(), turned, atol=1e-14)


def test_a_globe(call, flyby, tmp_path):
    assert call(flyby, "--to", tmp_path / "out.czml")[0] == 0
    assert left(["truth", FLYBY, "-o", tmp_path / "truth.czml", "--every", "20"]) == 0
    ours, theirs = (json.loads((tmp_path / name).read_text()) for name in ("out.czml", "truth.czml"))
    assert [packet["id"] for packet in ours] == [packet["id"] for packet in theirs]
    assert len(ours[1]["position"]["cartesian"]) == 4 * COUNT


def test_a_choice_of_frames_is_by_their_number_in_the_scenario(call, flyby, tmp_path):
    with rl.open(flyby) as frames:
        times = frames.time_s[:]
    for text, places in (("20:60", [2, 3, 4, 5]), ("0:100:30", [0, 3, 6, 9]), ("40", [4]), ("-1:", [COUNT - 1])):
        status, said, _ = call(flyby, "--to", tmp_path / "out.tum", "--frames", text, "--overwrite")
        assert status == 0 and f"(tum, {len(places)} of {COUNT} frames, " in said
        np.testing.assert_allclose(np.loadtxt(tmp_path / "out.tum", ndmin=2)[:, 0], times[places], atol=1e-9)


def test_mcap(call, bench, tmp_path):
    pytest.importorskip("mcap_ros2.writer", reason="needs the extra mcap: pip install 'rso-lidar[mcap]'")
    status, said, errors = call(bench, "--to", tmp_path / "out.mcap")
    assert status == 0 and said.startswith(f"written     {tmp_path / 'out.mcap'} (mcap, 10 frames, ")
    assert all(line.startswith("frame ") for line in errors)  # how far it is


def test_a_folder_for_ros_and_one_of_zarr(call, bench, tmp_path, capsys):
    pytest.importorskip("mcap_ros2.writer", reason="needs the extra mcap: pip install 'rso-lidar[mcap]'")
    pytest.importorskip("zarr", reason="needs the extra zarr: pip install 'rso-lidar[zarr]'")
    status, said, _ = call(bench, "--to", tmp_path / "out.rosbag2", "--frames", "2:5")
    assert status == 0 and "(rosbag2, 3 of 10 frames, " in said
    assert call(bench, "--to", tmp_path / "out.zarr")[0] == 0
    assert call(tmp_path / "out.zarr", "--to", tmp_path / "again.tum")[0] == 0  # a store is a recording, too
    assert left(["info", tmp_path / "out.zarr"]) == 0
    held = sum(file.stat().st_size for file in (tmp_path / "out.zarr").rglob("*") if file.is_file())
    assert f"file        out.zarr, {held / 1e6:.1f} MB, complete" in capsys.readouterr().out


def test_an_unfinished_recording(call, bench, tmp_path):
    unfinished = bench.rename(tmp_path / "bench.h5.tmp-1a2b3c4d")
    assert call(unfinished, "--to", tmp_path / "out.tum")[0] == 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--to", "out.xyz"], "out.xyz: unknown suffix '.xyz'"),
        (["--to", "out"], "out: the name has no suffix"),
        (["--to", "out.tum", "--format", "tmu"], "tmu: unknown format; did you mean 'tum'"),
        (["--to", "no/out.tum"], "there is no folder no"),
        (["--to", "there.tum"], "there.tum: exists already; give --overwrite"),
        (["--to", "there.csv"], "there.csv: exists already; give --overwrite"),
        (["--to", ".", "--format", "kitti"], "is a folder; name a file in it"),
        (
            ["--to", "out.csv", "--target", "plate"],
            "--target plate: is for tum, kitti, tdm, oem and aem; leave it out of a csv",
        ),
        (["--to", "out.czml", "--lidar-in-target"], "--lidar-in-target: is for tum and kitti; leave it out of a czml"),
        (
            ["--to", "out.tum", "--target", "plat"],
            "--target plat: nothing in the recording has that name; did you mean 'plate'",
        ),
        (["--to", "out.oem"], "out.oem: a local world has no Earth"),
        (["--to", "out.aem"], "out.aem: a local world has no Earth"),
        (["--to", "out.czml"], "out.czml: a local world has no Earth"),
        (
            ["--to", "out.tum", "--frames", "100:200"],
            "--frames 100:200: bench.h5 holds none of them, but 10 from 0 to 9",
        ),
        (["--to", "out.tum", "--frames", "a:b"], "--frames a:b: is not A:B or A:B:STEP"),
        (["--to", "bench.h5", "--overwrite"], "bench.h5: is the recording itself; give another name"),
        (["--to", "out.raw"], "out.raw: the detector of this recording states no words of its own; add"),
        (["--to", "out.tum", "--header-bytes", "4"], "--header-bytes: is for raster; leave it out of a tum"),
        (
            ["--to", "out.csv", "--frame-stride-bytes", "4"],
            "--frame-stride-bytes: is for raster; leave it out of a csv",
        ),
        (["--to", "there.oem"], "there.oem: exists already; give --overwrite"),
        ([], "Missing option '--to'"),
    ],
)
def test_bad_input(call, bench, tmp_path, monkeypatch, arguments, message):
    monkeypatch.chdir(tmp_path)
    for suffix in ("tum", "csv", "oem"):
        (tmp_path / f"there.{suffix}").write_text("older")
    before = {file.name: file.read_bytes() for file in tmp_path.iterdir()}
    status, said, errors = call("bench.h5", *arguments)
    assert (status, said, len(errors)) == (2, "", 1)
    assert message in errors[0]
    assert {file.name: file.read_bytes() for file in tmp_path.iterdir()} == before


@pytest.mark.parametrize(
    ("name", "message"),
    [("no.h5", "there is no such file"), ("text.h5", "is not an HDF5 file"), ("bench.toml", "unknown suffix '.toml'")],
)
def test_recordings_that_are_none(call, bench, tmp_path, name, message):
    (tmp_path / "text.h5").write_text("no recording")
    status, _, errors = call(tmp_path / name, "--to", tmp_path / "out.tum")
    assert (status, len(errors)) == (2, 1) and message in errors[0]


def test_a_body_that_is_not_there(call, flyby, tmp_path):
    status, _, errors = call(flyby, "--to", tmp_path / "out.oem", "--target", "lidar")
    assert (status, len(errors)) == (2, 1)
    assert "--target lidar: nothing of that name can be written (known: stage, follower)" in errors[0]
    status, _, errors = call(flyby, "--to", tmp_path / "out.oem", "--frames", "0:5")
    assert (status, len(errors)) == (2, 1) and "needs two or more" in errors[0]
    assert not list(tmp_path.iterdir())

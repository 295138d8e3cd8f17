"""`rl.save` and `rso-lidar export`: one table of formats, the same files."""

import json
import subprocess
import sys

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.errors import RecordingError
from rso_lidar.export import FORMATS
from rso_lidar.export.registry import FORMAT_SUFFIXES
from rso_lidar.shipped import shipped
from tests.settings_for_tests import limit_pixels

SMALL = (
    "lidar.detector.type=empirical",
    "lidar.receiver.n_rows=16",
    "lidar.receiver.n_cols=16",
    "lidar.detector.report.range_bits=20",
)


@pytest.fixture(scope="module")
def flown():
    """Return frames of a hop, about its second impulse (no frame is cheaper than an empty one)."""
    scenario = rl.Scenario.load(shipped("examples/tdrs_approach.toml"), (*SMALL, "lidar.receiver.rays_per_pixel=1"))
    return list(rl.simulate(scenario, frames=range(4)))


@pytest.fixture(scope="module")
def recording(flown, tmp_path_factory):
    return rl.save(tmp_path_factory.mktemp("recorded") / "run.h5", flown)


@pytest.mark.parametrize(
    "suffix",
    [
        suffix
        for suffix, kind in FORMAT_SUFFIXES.items()
        if not kind.folder and not kind.extra and suffix != ".tdm"  # it needs a target that is whole in the field
    ],
)
def test_save_and_export_write_the_same(rso_lidar, flown, recording, tmp_path, suffix):
    """From frames in memory, from a recording, and by the command: but for the time of writing, byte for byte."""
    one = rl.save(tmp_path / f"one{suffix}", iter(flown))
    with rl.open(recording) as read:
        two = rl.save(tmp_path / f"two{suffix}", read)
    three = tmp_path / f"three{suffix}"
    status, out, err = rso_lidar("export", recording, "--to", three)
    assert (status, [line for line in err if not line.startswith("frame ")]) == (0, [])
    assert f"({FORMAT_SUFFIXES[suffix].name}, 4 frames" in out
    if FORMAT_SUFFIXES[suffix].name in ("hdf5", "netcdf", "npz"):
        sizes = [file.stat().st_size for file in (one, two, three)]
        assert max(sizes) < 1.01 * min(sizes)
        return
    if FORMAT_SUFFIXES[suffix].name == "raster":
        assert one.read_bytes() == two.read_bytes() == three.read_bytes()
        return
    texts = [
        [line for line in file.read_text(encoding="utf-8").splitlines() if "CREATION_DATE" not in line]
        for file in (one, two, three)
    ]
    assert texts[1] == texts[2]
    if FORMAT_SUFFIXES[suffix].name != "czml":  # where a pose is stored as a quaternion, its last digit may change
        assert len(texts[0]) == len(texts[1]) > 1


def test_every_format_has_a_writer_that_save_finds(flown, tmp_path):
    for made in FORMATS.values():
        (tmp_path / f"x{made.suffixes[0]}").mkdir() if not made.folder else (tmp_path / f"x{made.suffixes[0]}").touch()
        with pytest.raises(RecordingError, match=r"is a folder|is a file|needs an extra"):
            rl.save(tmp_path / f"x{made.suffixes[0]}", flown)


def test_what_is_written_is_where_the_follower_was(flown, tmp_path):
    rl.save(tmp_path / "a.oem", flown)
    rl.save(tmp_path / "tdrs.oem", flown, target="tdrs")
    rows = [line.split() for line in (tmp_path / "a.oem").read_text().splitlines() if line[:4] == "2024"]
    found_m = 1e3 * np.array([[float(word) for word in row[1:4]] for row in rows])
    np.testing.assert_allclose(found_m, [frame.truth.states["follower"].position_m for frame in flown], atol=1e-5)
    assert (tmp_path / "a.oem").read_text() != (tmp_path / "tdrs.oem").read_text()


@pytest.mark.parametrize(
    ("name", "options", "said"),
    [
        ("a.oem", {"target": "tdr"}, "nothing of that name can be written; did you mean 'tdrs'"),
        ("a.aem", {"target": "ptuu"}, "did you mean 'ptu'"),
        ("a.foo", {}, "unknown suffix '.foo' (known: .h5, .hdf5, .nc,"),
        ("a.n", {}, "did you mean '.nc'"),
        ("a.mat", {}, "cannot be written"),
        ("a", {"format": "netcdff"}, "did you mean 'netcdf'"),
        ("none/a.oem", {}, "there is no folder"),
        ("taken.czml", {}, "exists already"),
    ],
)
def test_refused(flown, tmp_path, name, options, said):
    (tmp_path / "taken.czml").write_text("mine")
    with pytest.raises(RecordingError) as told:
        rl.save(tmp_path / name, flown, **options)
    assert said in str(told.value)
    assert [file.name for file in tmp_path.iterdir()] == ["taken.czml"]


@pytest.mark.parametrize("suffix", [".oem", ".aem", ".czml"])
def test_no_frames_and_no_earth_leave_nothing(text, tmp_path, suffix):
    with pytest.raises(RecordingError, match="no frames"):
        rl.save(tmp_path / f"a{suffix}", [])
    frames = rl.simulate(rl.Scenario.loads(text), frames=[0])
    with pytest.raises(RecordingError, match="a local world has no Earth"):
        rl.save(tmp_path / f"a{suffix}", frames)
    assert list(tmp_path.iterdir()) == []


# ------------------------------------------------------------------------------------------------------------- netCDF


@pytest.fixture(scope="module")
def netcdf(flown, tmp_path_factory):
    return rl.save(tmp_path_factory.mktemp("netcdf") / "run.nc", flown)


def test_a_netcdf_file_is_a_recording(rso_lidar, netcdf, flown):
    with rl.open(netcdf) as read:
        np.testing.assert_array_equal(read.range_m[:], [frame.range_m for frame in flown])
    assert rso_lidar("info", netcdf)[0] == 0


def test_the_netcdf_library_reads_it(netcdf, flown):
    import netCDF4

    with netCDF4.Dataset(netcdf) as file:
        assert set(file.dimensions) == {"time", "row", "col", "xyz", "quaternion"}
        assert file["range"].dimensions == ("time", "row", "col")
        np.testing.assert_array_equal(np.ma.filled(file["range"][:], np.nan), [frame.range_m for frame in flown])
        np.testing.assert_array_equal(
            file["truth/tdrs/inertial_position"][:], [frame.truth.states["tdrs"].position_m for frame in flown]
        )


CHECK = """
import json, sys
from compliance_checker.runner import CheckSuite, ComplianceChecker
CheckSuite.load_all_available_checkers()
ComplianceChecker.run_checker(
    sys.argv[1], ["cf:1.11"], 0, "strict", output_filename=sys.argv[2], output_format=["json"], skip_checks=sys.argv[3:]
)
"""


@pytest.mark.slow
@pytest.mark.parametrize("changed", [None, "units"])
def test_a_checker_of_the_cf_conventions_finds_nothing_to_correct(netcdf, tmp_path, changed):
    """The IOOS compliance checker; the second time of a file that breaks them, so that its silence means something."""
    file = tmp_path / "run.nc"
    file.write_bytes(netcdf.read_bytes())
    if changed:
        import h5py

        with h5py.File(file, "r+") as opened:
            opened["range"].attrs["units"] = "furlongs per nibble"
    # Of 6.1.0, one check wants every group to have a dimension `time` of its own, and stops on those of the root.
    told = tmp_path / "told.json"
    command = [sys.executable, "-W", "ignore", "-c", CHECK, str(file), str(told)]
    run = subprocess.run(
        [*command, "check_invalid_same_named_dimension_across_groups"], capture_output=True, text=True, cwd=tmp_path
    )
    assert told.is_file(), run.stderr
    report = json.loads(told.read_text())["cf:1.11"]
    problems = [
        one["msgs"]
        for rank in ("high", "medium", "low")
        for one in report[f"{rank}_priorities"]
        if one["value"][0] < one["value"][1]
    ]
    assert report["possible_points"] > 50
    assert bool(problems) == bool(changed), problems
    assert not changed or "furlongs per nibble" in str(problems)


@pytest.mark.slow
def test_samples_of_sensors_are_recorded_listed_and_exported(rso_lidar, tmp_path):
    """The command records them, resumes nothing, and its file has what a run in memory has."""
    small = (
        "time.duration_s=3",
        *limit_pixels(8),
    )
    scenario = shipped("examples/onboard_sensors.toml")
    output, table = tmp_path / "run.h5", tmp_path / "gyro.csv"
    settings = [word for text in small for word in ("--set", text)]
    assert rso_lidar("run", scenario, "-o", output, "--frames", "1:3", *settings)[0] == 0
    flown = list(rl.simulate(rl.Scenario.load(scenario, small), frames=range(1, 3)))
    with rl.open(output) as recording:
        for ours, theirs in zip(recording, flown, strict=True):
            for name, samples in theirs.observation.sensors.items():
                for field, values in vars(samples).items():
                    np.testing.assert_array_equal(getattr(ours.observation.sensors[name], field), values)
        assert type(recording.sensors["gnss"]) is type(flown[0].observation.sensors["gnss"])
    told = rso_lidar("info", output)[1]
    assert "sensor      gyro: GyroSamples, 40 samples at 20 Hz, 0.05 to 2 s\n" in told
    assert rso_lidar("export", output, "--to", table, "--sensor", "gyro")[0] == 0
    assert len(table.read_text().splitlines()) == 41
    status, _, err = rso_lidar("export", output, "--to", tmp_path / "a.tum", "--sensor", "gyro")
    assert (status, err) == (2, ["error: --sensor gyro: is for csv and parquet; leave it out of a tum"])
    status, _, err = rso_lidar("export", output, "--to", tmp_path / "a.csv", "--sensor", "gyr")
    assert status == 2
    assert "did you mean 'gyro'" in err[0]

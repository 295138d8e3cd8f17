"""Samples of sensors in recordings: those of each frame, and each sensor as one series."""

import dataclasses
import pickle
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from frames_for_tests import (
    SENSORS,
    SOURCE,
    FourSamples,
    assert_same,
    assert_same_record,
    datasets,
    leave_unfinished,
    make_frame,
    make_frames,
)

from rso_lidar import export
from rso_lidar.errors import RecordingError
from rso_lidar.export.layout import sensor_samples
from rso_lidar.records import GyroSamples, SensorSamples, array, join_samples, specs

COUNT = 8
HERE = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    return export.save(tmp_path_factory.mktemp("sensors") / "run.h5", make_frames(COUNT, sensors=SENSORS))


def expected():
    return join_samples([frame.observation.sensors for frame in make_frames(COUNT, sensors=SENSORS)])


@pytest.mark.parametrize("suffix", ["h5", "nc", "zarr"])
def test_samples_come_back_bit_for_bit(tmp_path, saved, suffix):
    if suffix == "zarr":
        pytest.importorskip("zarr", reason="needs the extra zarr: pip install 'rso-lidar[zarr]'")
    path = saved if suffix == "h5" else export.save(tmp_path / f"run.{suffix}", export.open(saved))
    with export.open(path) as recording:
        for k, frame in enumerate(recording):
            assert_same(frame, make_frame(k, sensors=SENSORS))
        series = expected()
        assert list(recording.sensors) == list(series) == list(SENSORS)
        for name, samples in series.items():
            assert_same_record(recording.sensors[name], samples)
        assert recording.sensors["wheels"].torque_n_m.shape == (12, 0)
        assert "gyro" in recording.sensors
        assert recording.sensors.get("gyroscope") is None
        with pytest.raises(KeyError, match=r"has no sensor 'gyr'; did you mean 'gyro'\?"):
            recording.sensors["gyr"]


def test_recordings_without_sensors_are_as_before(tmp_path):
    with export.open(export.save(tmp_path / "run.h5", make_frames(2))) as recording:
        assert dict(recording.sensors) == {}
        assert recording[1].observation.sensors == {}
        with h5py.File(recording.path) as file:
            assert "sensors" not in file
            assert "sensors" not in file.attrs


def test_h5py_alone_reads_a_series_by_its_count_or_its_missing_times(saved):
    """Entries have room for one sample more than the first frame that did not fit."""
    gyro = expected()["gyro"]
    with h5py.File(saved) as file:
        group = file["sensors/gyro"]
        counts, times = group["sample_count"][:], group["time_s"][:]
        assert counts.tolist() == [1, 5, 6, 5, 5, 5, 5, 5]
        assert times.shape == (COUNT, 6)
        np.testing.assert_array_equal(np.isfinite(times).sum(axis=1), counts)
        rates = group["angular_velocity_rad_s"]
        np.testing.assert_array_equal(rates[:][np.isfinite(times)], gyro.angular_velocity_rad_s)
        assert rates.attrs["units"] == "rad s-1"
        assert rates.attrs["long_name"].startswith("measured angular velocity relative to inertial axes")
        assert [rates.dims[axis][0].name for axis in range(3)] == ["/time", "/sensors/gyro/sample", "/xyz"]
        assert group["time_s"].attrs["units"] == "seconds since 2024-09-17 12:00:00"
        assert dict(group.attrs) == {"record": "GyroSamples", "long_name": "Samples of a triad of gyros."}
        assert file["sensors/own sensor/code"].fillvalue == -1
        assert file["sensors/own sensor/row"][:].tolist() == [0, 1, 2]  # its own, and not the rows of the focal plane
        assert all(group[name].fletcher32 for name in group)


def test_xarray_reads_a_group(saved):
    xarray = pytest.importorskip("xarray", reason="needs xarray: pip install xarray")
    pytest.importorskip("h5netcdf", reason="needs h5netcdf: pip install h5netcdf")
    with xarray.open_dataset(saved, engine="h5netcdf", group="sensors/gyro") as gyro:
        assert gyro["angular_velocity_rad_s"].dims == ("time", "sample", "xyz")
        at = gyro["time_s"].values[1, 0] - np.datetime64("2024-09-17T12:00:00")
    assert at / np.timedelta64(1, "ns") == pytest.approx(1e9 * expected()["gyro"].time_s[1], abs=2)


def test_a_class_that_is_not_loaded_is_made_from_its_statements(saved, tmp_path):
    """Another process, in which nobody has defined the class; it reads, pickles, joins and writes the samples again."""
    code = f"""
import pickle, numpy as np
from rso_lidar import export
with export.open({str(saved)!r}) as recording:
    samples = recording.sensors["own sensor"]
    again = pickle.loads(pickle.dumps(samples))
    assert type(again) is type(samples) is type(recording[1].observation.sensors["own sensor"])
    print(type(samples).__name__, samples.current_a.dtype, samples.is_lit.dtype, again.code.tolist(), type(samples).__doc__)
    export.save({str(tmp_path / "again.h5")!r}, recording)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    own = expected()["own sensor"]
    assert (
        done.stdout == f"FourSamples float32 bool {own.code.tolist()} Samples of a sensor with fields of four types.\n"
    )
    with export.open(tmp_path / "again.h5") as recording:
        assert_same_record(recording.sensors["own sensor"], own)
        read = type(recording[3].observation.sensors["own sensor"])
        assert (read.__name__, read.__doc__) == (FourSamples.__name__, FourSamples.__doc__)


def test_a_class_of_that_name_with_other_fields_is_not_taken():
    """The unit of the loaded class is another one."""

    @dataclasses.dataclass(frozen=True, eq=False, repr=False)
    class SunSamples(SensorSamples):
        angle_deg: np.ndarray = array("sample", "f8", "degree", "angle to the Sun")

    entries = {
        "time_s": np.zeros(1),
        "available_s": np.zeros(1),
        "valid": np.ones(1, "u1"),
        "angle_deg": np.array([7.0]),
    }
    told = sensor_samples.describe_sensors({"sun": SunSamples(**entries)})["sun"]
    assert type(sensor_samples.make_samples(told, entries)) is SunSamples
    told["fields"]["angle_deg"]["unit"] = "rad"
    made = sensor_samples.make_samples(told, entries)
    assert type(made) is not SunSamples
    assert specs(type(made))["angle_deg"].unit == "rad"
    assert made.angle_deg.tolist() == [7.0]


def test_a_resumed_run_has_the_same_datasets(tmp_path):
    """It was interrupted when the entries were still short; then a frame has more samples."""
    counts = {"gyro": (1, 1, 1, 40, 44), "own sensor": (2, 1, 2, 3, 0)}
    whole = export.save(tmp_path / "whole.h5", make_frames(5, sensors=counts))
    path = tmp_path / "run.h5"
    leave_unfinished(path, make_frames(2, sensors=counts), "1a2b3c4d")
    with export.Recorder(path, SOURCE, run_id="1a2b3c4d", resume=True) as recorder:
        assert recorder.written == 2
        for k in range(2, 5):
            recorder.write(make_frame(k, sensors=counts))
            if k == 3:  # its entries have just grown
                with export.open(recorder.temporary) as growing:
                    assert_same(growing[k], make_frame(k, sensors=counts))
                    assert_same(growing[0], make_frame(0, sensors=counts))
    ours, theirs = datasets(path), datasets(whole)
    assert ours.keys() == theirs.keys()
    for name, (shape, dtype, content, attributes) in theirs.items():
        assert ours[name] == (shape, dtype, content, attributes), name


def test_zarr_makes_room_after_its_first_shard(tmp_path, monkeypatch):
    pytest.importorskip("zarr", reason="needs the extra zarr: pip install 'rso-lidar[zarr]'")
    from rso_lidar.export.writer import zarr_store

    monkeypatch.setattr(zarr_store, "FRAMES_PER_SHARD", 2)
    counts = {"gyro": (1, 1, 1, 7, 9), "own sensor": (0, 0, 0, 0, 4)}
    with export.open(export.save(tmp_path / "run.zarr", make_frames(5, sensors=counts))) as recording:
        for k, frame in enumerate(recording):
            assert_same(frame, make_frame(k, sensors=counts))
        assert recording.dataset("sensors/gyro/time_s").shape == (5, 10)
        assert recording._file["sensors/gyro/sample"].shape == (10,)


def test_npz_has_series_without_padding(tmp_path):
    with np.load(export.save(tmp_path / "run.npz", make_frames(COUNT, sensors=SENSORS))) as arrays:
        import json

        for name, samples in expected().items():
            for field, values in vars(samples).items():
                if values is not None and values.size:
                    np.testing.assert_array_equal(arrays[f"sensors/{name}/{field}"], values)
        told = json.loads(str(arrays["attributes"]))
        assert told["sensors/gyro/angular_velocity_rad_s"]["dims"] == ["sample", "xyz"]
        assert arrays["sensors/gyro/sample_count"].sum() == len(expected()["gyro"].time_s)


def change(frame, **sensors):
    return dataclasses.replace(frame, observation=dataclasses.replace(frame.observation, sensors=sensors))


def test_what_cannot_be_recorded_is_refused_in_one_line(tmp_path):
    @dataclasses.dataclass(frozen=True, eq=False, repr=False)
    class Plain(SensorSamples):
        gain: float = 1.0

    @dataclasses.dataclass(frozen=True, eq=False, repr=False)
    class Constant(SensorSamples):
        offset: np.ndarray = array("xyz", "f8", "m", "offset")

    @dataclasses.dataclass(frozen=True, eq=False, repr=False)
    class Complex(SensorSamples):
        field: np.ndarray = array("sample", "c16", "V", "voltage")

    @dataclasses.dataclass(frozen=True, eq=False, repr=False)
    class Twice(SensorSamples):
        valid_s: np.ndarray = array("sample valid", "f8", "s", "seconds")

    common = (np.zeros(1), np.zeros(1), np.ones(1, bool))
    frame = make_frame()
    cases = {
        r"sensor 'a': Plain.gain: has no statement of its array": {"a": Plain(*common)},
        r"sensor 'a': Constant.offset: a recording takes arrays whose first dimension": {
            "a": Constant(*common, np.zeros(3))
        },
        r"sensor 'a': Complex.field: a recording cannot hold complex128": {"a": Complex(*common, np.zeros(1))},
        r"sensor 'a': Twice.valid_s: a dimension cannot have the name 'valid'": {"a": Twice(*common, np.zeros((1, 2)))},
        r"sensor 'a/b': a recording cannot hold this name": {"a/b": SensorSamples(*common)},
        r"sensor '..': a recording cannot hold this name": {"..": SensorSamples(*common)},
    }
    for message, sensors in cases.items():
        with pytest.raises(RecordingError, match=message) as caught:
            export.save(tmp_path / "run.h5", [change(frame, **sensors)])
        assert "\n" not in str(caught.value)
    assert not list(tmp_path.iterdir())


def test_frames_with_other_sensors_are_refused(tmp_path):
    frame = make_frame(0, sensors=SENSORS)
    gyro = frame.observation.sensors["gyro"]
    other = {**frame.observation.sensors, "gyro": GyroSamples(*(vars(gyro).values()))}
    with export.Recorder(tmp_path / "run.h5", SOURCE, run_id="1a2b3c4d") as recorder:
        recorder.write(change(frame, **other))
        with pytest.raises(RecordingError, match=r"sensors/gyro/.*: not in every frame"):
            recorder.write(make_frame(1))

        @dataclasses.dataclass(frozen=True, eq=False, repr=False)
        class RateSamples(SensorSamples):
            angular_velocity_rad_s: np.ndarray = array("sample xyz", "f8", "rad s-1", "rate")

        with pytest.raises(RecordingError, match="its sensors have other samples than the first's"):
            recorder.write(change(frame, **{**other, "gyro": RateSamples(*vars(gyro).values())}))


def test_a_count_that_is_wrong_or_a_text_that_was_edited_is_damage(tmp_path, saved):
    path = tmp_path / "run.h5"
    path.write_bytes(saved.read_bytes())
    with h5py.File(path, "r+") as file:
        file["sensors/gyro/sample_count"][2] = 60
    with export.open(path) as recording, pytest.raises(RecordingError, match="sensors/gyro: is damaged"):
        recording[2]
    with h5py.File(path, "r+") as file:
        file.attrs["sensors"] = file.attrs["sensors"].replace("rad s-1", "deg s-1")
    with pytest.raises(RecordingError, match="texts in its attributes differ from their checksum"):
        export.open(path)


def test_recordings_with_sensors_can_be_pickled(saved):
    with export.open(saved) as recording:
        again = pickle.loads(pickle.dumps(recording))
        assert_same_record(again.sensors["gyro"], recording.sensors["gyro"])
        again.close()

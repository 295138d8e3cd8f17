import json
import shutil
import sys

import h5py
import numpy as np
import pytest
from frames_for_tests import KEEP, make_frame, make_frames, read_arrays

from rso_lidar import export
from rso_lidar.errors import RecordingError, RunError
from rso_lidar.export.layout.datasets import collect_values
from rso_lidar.export.writer import zarr_store

HOW = {"returns": True, "keep": KEEP}
NEEDED = "needs the extra zarr: pip install 'rso-lidar[zarr]'"


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    """Save seven frames of a zoom lens as file and store, three to a shard; return both paths."""
    pytest.importorskip("zarr", reason=NEEDED)
    folder, lens = tmp_path_factory.mktemp("saved"), {"zoom": lambda k: 1.0 + (k % 3)}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(zarr_store, "FRAMES_PER_SHARD", 3)
        return [export.save(folder / name, make_frames(7, **lens, **HOW)) for name in ("run.h5", "run.zarr")]


@pytest.fixture(params=["one lens", "zoom"])
def both(request, tmp_path, saved, monkeypatch):
    """Return a file and a store of the same frames."""
    if request.param == "zoom":
        return saved
    monkeypatch.setattr(zarr_store, "FRAMES_PER_SHARD", 3)
    return [export.save(tmp_path / name, make_frames(7)) for name in ("run.h5", "run.zarr")]


def test_arrays_and_attributes_are_those_of_the_recording(both, saved):
    import zarr

    recording, place = both
    store = zarr.open_group(place, mode="r")
    expected = read_arrays(recording)
    arrays = {name: array for name, array in store.members(max_depth=None) if isinstance(array, zarr.Array)}
    scales = {"row", "col"}
    if both is saved:
        scales |= {
            "returns/return",
            "labels/return",
            "waveforms/sample",
            "oversampled/fine_row",
            "oversampled/fine_col",
        }
    assert set(arrays) == set(expected) | scales
    with h5py.File(recording) as file:
        for name, values in expected.items():
            assert arrays[name].dtype == values.dtype, name
            np.testing.assert_array_equal(arrays[name][:], values, err_msg=name)
            scale = [file[name].dims[axis] for axis in range(values.ndim)] if name != "time" else []
            dims = [dim[0].name.rpartition("/")[2] for dim in scale] or ["time"]
            assert list(arrays[name].metadata.dimension_names) == dims, name
            for key in ("units", "long_name"):
                assert arrays[name].attrs[key] == file[name].attrs[key], name
        assert dict(store.attrs) == {
            key: value.item() if hasattr(value, "item") else value for key, value in file.attrs.items()
        }
        assert store["truth"].attrs["tree"] == file["truth"].attrs["tree"]
        assert store["truth/tdrs"].attrs["parent"] == file["truth/tdrs"].attrs["parent"]
        if both is saved:
            assert store["waveforms"].attrs["sample_s"] == file["waveforms"].attrs["sample_s"]
    assert arrays["range"].chunks == (1, 12, 10)
    assert arrays["range"].shards == (3, 12, 10)
    assert len(list((place / "range/c").iterdir())) == 3  # 7 frames, 3 to a file
    assert np.isnan(arrays["range"].fill_value)
    assert arrays["labels/target"].fill_value == -1


def test_xarray_opens_it_with_sky_as_nan(tmp_path):
    pytest.importorskip("zarr", reason=NEEDED)
    import xarray

    path = export.save(tmp_path / "run.zarr", make_frames(3))
    with xarray.open_datatree(path, engine="zarr") as tree:
        assert dict(tree["range"].sizes) == {"time": 3, "row": 12, "col": 10}
        assert str(tree["time"].values[2]) == "2024-09-17T12:00:00.200000000"
        np.testing.assert_array_equal(tree["range"][1], make_frame(1).range_m)
        target = make_frame(1).labels.target
        np.testing.assert_array_equal(tree["labels/target"][1], np.where(target < 0, np.nan, target))
        assert json.loads(tree.attrs["targets"])[1]["name"] == "rock"


def test_frames_are_written_a_shard_at_a_time(tmp_path, monkeypatch):
    """Big frames make shards of fewer frames, so that what waits in memory stays bounded."""
    zarr = pytest.importorskip("zarr", reason=NEEDED)
    each = zarr_store.count_frame_bytes(zarr_store.list_variables(make_frame()))
    monkeypatch.setattr(zarr_store, "MOST_BATCH_BYTES", 2 * each)
    most = 0

    def watched():
        nonlocal most
        for frame in make_frames(9):
            yield frame
            [draft] = tmp_path.glob("*.part")
            written = zarr.open_group(draft, mode="r")["range"].shape[0]
            most = max(most, frame.index // 3 + 1 - written)

    path = export.save(tmp_path / "run.zarr", watched())
    assert most == 1  # one waits, the second fills the shard
    assert zarr.open_group(path, mode="r")["range"].shape == (9, 12, 10)
    assert list(tmp_path.iterdir()) == [path]


def test_without_the_extra_it_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "zarr", None)
    with pytest.raises(RecordingError, match=r"Zarr needs an extra: pip install rso-lidar\[zarr\], or write \.h5"):
        export.save(tmp_path / "run.zarr", make_frames(1))
    assert list(tmp_path.iterdir()) == []


def test_it_opens_as_a_recording_like_the_file(tmp_path, saved):
    with export.open(saved[0]) as file, export.open(saved[1]) as store:
        assert (len(store), store.complete, store.kept) == (7, True, file.kept)
        assert store.source == file.source
        np.testing.assert_array_equal(store.line_of_sight, file.line_of_sight)
        for key in (5, -2, slice(1, 6, 2), slice(5, 0, -2), [4, 0, 4], (slice(2, 4), 3, slice(1, 9))):
            np.testing.assert_array_equal(store.range_m[key], file.range_m[key])
            np.testing.assert_array_equal(store.labels.target[key], file.labels.target[key])
        for ours, theirs in zip(store[2:], file[2:], strict=True):
            there = collect_values(theirs)
            for name, value in collect_values(ours).items():
                np.testing.assert_array_equal(value, there[name], err_msg=name)
            assert ours.index == theirs.index and ours.source.scenario == theirs.source.scenario
        with pytest.raises(IndexError, match="it has 7"):
            store[7]
        again = export.save(tmp_path / "again.h5", store)
    with export.open(again) as copy, export.open(saved[0]) as file:
        np.testing.assert_array_equal(copy.range_m[:], file.range_m[:])
    with pytest.raises(RecordingError, match="is closed"):
        store.range_m[0]


def test_what_is_no_store_of_ours_is_one_line(tmp_path, monkeypatch):
    zarr = pytest.importorskip("zarr", reason=NEEDED)
    with pytest.raises(RecordingError, match="there is no such folder"):
        export.open(tmp_path / "no.zarr")
    (tmp_path / "empty.zarr").mkdir()
    with pytest.raises(RecordingError, match="is not a Zarr store of version 3"):
        export.open(tmp_path / "empty.zarr")
    zarr.open_group(tmp_path / "other.zarr", mode="w")
    with pytest.raises(RecordingError, match="not a recording of rso_lidar"):
        export.open(tmp_path / "other.zarr")
    path = export.save(tmp_path / "run.zarr", make_frames(2))
    (path / "zarr.json").write_text("{")
    with pytest.raises(RecordingError, match="is damaged"):
        export.open(path)
    monkeypatch.setitem(sys.modules, "zarr", None)
    with pytest.raises(RecordingError, match=r"pip install rso-lidar\[zarr\]"):
        export.open(tmp_path / "other.zarr")


@pytest.mark.parametrize("gone", ["range/c/1/0/0", "intensity/c/0/0/0", "time/c/0", "labels/photons"])
def test_a_store_that_lost_something_is_refused_and_not_read_as_absence(tmp_path, gone, saved):
    store = shutil.copytree(saved[1], tmp_path / "run.zarr")
    with export.open(store) as whole:
        assert len(whole) == 7
    lost = store / gone
    shutil.rmtree(lost) if lost.is_dir() else lost.unlink()
    with pytest.raises(RecordingError, match=r"lacks \d of \d chunks; export it again"):
        export.open(store)


@pytest.mark.slow
def test_damage_in_a_store_is_one_line_or_changes_nothing(tmp_path):
    """One bit of each file of a store: chunks have CRC-32C, metadata a CRC-32 in the consolidated copy that is read."""
    pytest.importorskip("zarr", reason=NEEDED)
    store = export.save(tmp_path / "a.zarr", make_frames(2, shape=(6, 5)))
    with export.open(store) as recording:
        names = list(recording._datasets)
        before = {name: recording.dataset(name)[:].tobytes() for name in names}
        sight = recording.line_of_sight.tobytes()
        source = recording.source
    rng = np.random.default_rng(17)
    told: list[tuple[str, str]] = []
    files = [file for file in sorted(store.rglob("*")) if file.is_file()]
    for file in files + [store / "zarr.json"] * 20:
        whole = file.read_bytes()
        damaged = bytearray(whole)
        damaged[int(rng.integers(len(damaged)))] ^= 1 << int(rng.integers(8))
        file.write_bytes(damaged)
        inside = [name for name in names if (store / name) in file.parents]  # other datasets are in untouched files
        try:
            with export.open(store) as recording:
                assert recording.source == source
                assert recording.line_of_sight.tobytes() == sight, file
                for name in inside or names:
                    assert recording.dataset(name)[:].tobytes() == before[name], file
        except RecordingError as error:
            told.append((str(file.relative_to(store)), str(error)))
        file.write_bytes(whole)
    assert not any("\n" in line for _, line in told)
    for name in names:
        chunks = [line for file, line in told if file.startswith(f"{name}/c")]
        assert chunks, name
        assert all(f"{name}: is damaged" in line for line in chunks), chunks
    assert any("differ from their checksum metadata_crc32" in line for _, line in told)


def test_a_store_that_another_program_removed_is_not_published(tmp_path):
    """Zarr makes folders that are missing, so that its writer alone would not notice."""
    pytest.importorskip("zarr", reason=NEEDED)
    place = tmp_path / "a.zarr"

    def flying():
        yield make_frame(0)
        shutil.rmtree(tmp_path / "a.zarr.part")
        yield make_frame(1)

    with pytest.raises(RunError, match=r"a\.zarr: (not written:|could not be written)"):
        export.save(place, flying())
    assert not place.exists()

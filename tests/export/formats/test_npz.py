import json
import zipfile
import zlib

import h5py
import numpy as np
import pytest
from frames_for_tests import KEEP, make_frames, read_arrays

from rso_lidar import export
from rso_lidar.errors import RecordingError, RunError
from rso_lidar.export.formats.npz import write_npz

HOW = {"returns": True, "keep": KEEP}


@pytest.mark.parametrize("zoom", [1.0, lambda k: 1.0 + (k % 2)], ids=["one lens", "zoom"])
def test_arrays_are_those_of_the_recording(tmp_path, zoom):
    expected = read_arrays(export.save(tmp_path / "run.h5", make_frames(4, zoom=zoom, **HOW)))
    with np.load(export.save(tmp_path / "run.npz", make_frames(4, zoom=zoom, **HOW))) as found:
        assert set(found) == set(expected) | {"attributes"}
        for name, values in expected.items():
            assert found[name].dtype == values.dtype, name
            np.testing.assert_array_equal(found[name], values, err_msg=name)


def test_attributes_say_what_each_array_is(tmp_path):
    with h5py.File(export.save(tmp_path / "run.h5", make_frames(2))) as file:
        with np.load(export.save(tmp_path / "run.npz", make_frames(2))) as found:
            told = json.loads(str(found["attributes"]))
            assert set(told) == set(found) - {"attributes"} | {"/"}
            for name in set(found) - {"attributes"}:
                assert told[name]["units"] == file[name].attrs["units"]
                assert told[name]["long_name"] == file[name].attrs["long_name"]
                assert len(told[name]["dims"]) == found[name].ndim
        assert told["/"]["scenario"] == file.attrs["scenario"]
        assert told["/"]["tree"] == json.loads(file["truth"].attrs["tree"])
        assert [target["name"] for target in told["/"]["targets"]] == ["tdrs", "rock"]


def test_the_same_frames_are_the_same_bytes(tmp_path):
    a, b = (export.save(tmp_path / f"{name}.npz", make_frames(2)) for name in "ab")
    assert a.read_bytes() == b.read_bytes()


@pytest.mark.parametrize("known", [True, False], ids=["of known length", "as they come"])
def test_too_much_is_refused_with_what_to_use(tmp_path, known):
    frames = list(make_frames(5)) if known else make_frames(5)
    with pytest.raises(RecordingError, match=r"run.npz: more than 2e-05 GB .* write \.h5 or \.zarr, or choose fewer"):
        write_npz(tmp_path / "run.npz", frames, most_bytes=20_000)
    assert list(tmp_path.iterdir()) == []


def test_numpy_reports_damage(tmp_path):
    """Each array of the archive has a CRC-32, which numpy verifies; a flip is an error or hits what says nothing."""
    path = export.save(tmp_path / "a.npz", make_frames(2, shape=(6, 5)))
    whole = path.read_bytes()
    before = {name: array.tobytes() for name, array in np.load(path).items()}
    rng = np.random.default_rng(17)
    told = 0
    for _ in range(60):
        damaged = bytearray(whole)
        damaged[int(rng.integers(len(damaged)))] ^= 1 << int(rng.integers(8))
        path.write_bytes(damaged)
        try:
            with path.open("rb") as stream, np.load(stream) as arrays:
                assert {name: array.tobytes() for name, array in arrays.items()} == before
        except (zipfile.BadZipFile, zlib.error, ValueError, NotImplementedError, OSError, KeyError, EOFError):
            told += 1
    assert told > 30


def test_what_does_not_read_back_is_not_published(tmp_path, monkeypatch):
    save = np.savez_compressed

    def garbled(stream, **arrays):
        save(stream, **arrays)
        stream.seek(500)
        stream.write(b"garbage")

    monkeypatch.setattr(np, "savez_compressed", garbled)
    with pytest.raises(RunError, match=r"a\.npz: not written: the file cannot be read back"):
        export.save(tmp_path / "a.npz", make_frames(2))
    assert list(tmp_path.iterdir()) == []

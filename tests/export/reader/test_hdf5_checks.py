"""HDF5 files are checked before libhdf5 takes memory for them, or walks a heap without an end."""

import subprocess
import sys
import tracemalloc

import h5py
import numpy as np
import pytest
from frames_for_tests import SOURCE, leave_unfinished, make_frames

from rso_lidar import export
from rso_lidar.dataset.scoring.prediction_file import read_columns
from rso_lidar.errors import DatasetError, RecordingError
from rso_lidar.export import check_declared_size
from rso_lidar.export.reader.hdf5_checks import check_heaps

RUN = "1a2b3c4d"
LIMIT_S = 20.0
READ = """
import sys, rso_lidar as rl
for path in sys.argv[1:]:
    try:
        rl.open(path).close()
        print("read")
    except rl.RecordingError as error:
        print(error)
"""


def find_objects(data):
    """Return the places of all objects of all global heaps in an HDF5 file [bytes]."""
    places, heap = [], data.find(b"GCOL")
    while heap >= 0:
        at, end = heap + 16, heap + int.from_bytes(data[heap + 8 : heap + 16], "little")
        while at + 16 <= end:
            number, size = int.from_bytes(data[at : at + 2], "little"), int.from_bytes(data[at + 8 : at + 16], "little")
            places.append(at)
            at += 16 + (size + 7) // 8 * 8 if number else size
        heap = data.find(b"GCOL", end)
    return places


@pytest.mark.parametrize("state", ["finished", "killed"])
def test_an_object_without_a_size_is_one_line(tmp_path, state):
    """Sixteen zeroed bytes, for which libhdf5 would loop without an end: in a process, for a loop would hold this one."""
    name = "run.h5" if state == "finished" else f"run.h5.tmp-{RUN}"
    if state == "finished":
        export.save(tmp_path / name, make_frames(2, shape=(6, 5)))
    else:
        leave_unfinished(tmp_path / "run.h5", make_frames(2, shape=(6, 5)), RUN)
    data = (tmp_path / name).read_bytes()
    places = find_objects(data)
    assert len(places) > 200
    paths = []
    for place in places[:: len(places) // 6]:
        (tmp_path / str(place)).mkdir()
        paths.append(tmp_path / str(place) / name)
        paths[-1].write_bytes(data[:place] + bytes(16) + data[place + 16 :])
    command = [sys.executable, "-c", READ, *map(str, paths)]
    done = subprocess.run(command, timeout=LIMIT_S, check=True, capture_output=True, text=True)
    lines = done.stdout.splitlines()
    assert len(lines) == len(paths)
    for path, line in zip(paths, lines, strict=True):
        assert line.startswith(f"{path}: is damaged (the heap of texts at byte "), line
        assert f"an object of 0 bytes at byte {path.parent.name})" in line


def test_a_heap_is_checked_again_after_a_change(tmp_path):
    path = export.save(tmp_path / "run.h5", make_frames(2, shape=(6, 5)))
    check_heaps(path)
    data = path.read_bytes()
    place = find_objects(data)[3]
    path.write_bytes(data[:place] + bytes(16) + data[place + 16 :] + b"\0")
    with pytest.raises(OSError, match="the heap of texts"):
        check_heaps(path)


def test_a_column_of_texts_is_checked(tmp_path):
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["class"] = ["bus", "panel"]
    assert read_columns(path)[0]["class"].tolist() == ["bus", "panel"]
    data = path.read_bytes()
    place = find_objects(data)[0]
    path.write_bytes(data[:place] + bytes(16) + data[place + 16 :])
    with pytest.raises(DatasetError, match="the heap of texts"):
        read_columns(path)


@pytest.mark.parametrize("size", [2**32, 2**41])
def test_fill_values_take_no_memory(tmp_path, size):
    """A file of a few kB that declares gigabytes: refused for what it declares, before an array is made."""
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset("score", (size,), "f8", chunks=(2**17,), fillvalue=1.0)
        file.create_dataset("sample", (2**20,), "f8", fillvalue=1.0)
        check_declared_size(file["sample"])  # 8 MiB
        with pytest.raises(OSError, match=f"/score declares {8 * size:,} bytes, in a file of"):
            check_declared_size(file["score"])
    assert path.stat().st_size < 10_000
    tracemalloc.start()
    with pytest.raises(DatasetError, match="score declares"):
        read_columns(path)
    assert tracemalloc.get_traced_memory()[1] < 2**24
    tracemalloc.stop()


def test_a_recording_with_more_than_it_stores_is_one_line(tmp_path):
    path = export.save(tmp_path / "run.h5", make_frames(2, shape=(6, 5)))
    with h5py.File(path, "r+") as file:
        file["labels/part"].resize(2**40, axis=0)
    with pytest.raises(RecordingError, match=r"run\.h5: is damaged \(/labels/part declares") as caught:
        export.open(path)
    assert "\n" not in str(caught.value)


def test_a_dataset_of_texts_is_no_image(tmp_path):
    path = export.save(tmp_path / "run.h5", make_frames(2, shape=(6, 5)))
    with h5py.File(path, "r+") as file:
        del file["frame_index"]
        file["frame_index"] = ["a", "b"]
    with pytest.raises(RecordingError, match="/frame_index holds object, not numbers"):
        export.open(path)


def test_a_zeroed_chunk_is_damage_whatever_it_holds(tmp_path):
    """Zeros of the length of any chunk: a checksum of zeros is 0, so that fletcher32 alone would accept them."""
    with export.Recorder(tmp_path / "run.h5", SOURCE, run_id=RUN) as recorder:
        for frame in make_frames(3, shape=(6, 5)):
            recorder.write(frame)
        data = recorder.temporary.read_bytes()
    left = tmp_path / f"left.h5.tmp-{RUN}"
    left.write_bytes(data)
    with export.open(left) as recording:
        chunks = {path: recording.handle(path).id.get_chunk_info(2) for path in recording.paths}
    resumed = ("labels/part", "truth/tdrs/position", "time")
    for path in {*sorted(chunks)[::9], *resumed}:
        chunk = chunks[path]
        start, end = chunk.byte_offset, chunk.byte_offset + chunk.size
        left.write_bytes(data[:start] + bytes(chunk.size) + data[end:])
        with pytest.raises(RecordingError, match="is damaged"), export.open(left) as recording:
            recording.dataset(path)[:]
        if path in resumed:
            with pytest.raises(RecordingError, match=rf"{path}: is damaged"):
                with export.Recorder(tmp_path / "left.h5", SOURCE, run_id=RUN, resume=True):
                    pass
            assert left.stat().st_size == len(data)
    with h5py.File(tmp_path / "run.h5") as file:
        stored = file["time"].id.read_direct_chunk((2,))[1]
        assert stored[7:15] == np.float64(file["time"][2]).tobytes()  # not compressed, in a zlib stream
        assert len(stored) == 8 + 7 + 8

"""Checksums of chunks against HDF5's own filter, and damage against what a reader says of it."""

import gzip
import hashlib
from pathlib import Path

import h5py
import numpy as np
import pytest
from frames_for_tests import SOURCE, leave_unfinished, make_frames

from rso_lidar import export
from rso_lidar.errors import RecordingError
from rso_lidar.export.layout.checksum import compute_fletcher32, is_intact

RUN = "1a2b3c4d"
DIGEST = "a8807a5ec78ee8992ffb0b9c234c5970105b8a61e2501be80f999e6eee5d6c58"  # by h5py alone, of all growing datasets
FULL = {"returns": True, "keep": ("waveforms", "photons", "oversampled"), "zoom": lambda k: 1.0 + k % 2}


def test_fletcher32_is_that_of_hdf5(tmp_path):
    """Odd lengths, all zeros (the sum 0) and all ones (the sum 65535 in place of 0) among them."""
    rng = np.random.default_rng(32)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for count in (1, 2, 3, 8, 24, 361, 4001, 400_000):
            for kind, data in (("random", rng.bytes(count)), ("zeros", bytes(count)), ("ones", b"\xff" * count)):
                made = file.create_dataset(
                    f"{kind}{count}", data=np.frombuffer(data, "u1"), chunks=(count,), dtype="u1", fletcher32=True
                )
                file.flush()
                _, stored = made.id.read_direct_chunk((0,))
                assert stored == data + compute_fletcher32(data), (kind, count)
                assert is_intact(stored)


def visit(path):
    """Return every dataset of an HDF5 file by path, as h5py sees it."""
    found = {}
    file = h5py.File(path)
    file.visititems(lambda name, item: found.update({name: item} if isinstance(item, h5py.Dataset) else {}))
    return file, found


@pytest.fixture(scope="module")
def full(tmp_path_factory):
    return export.save(tmp_path_factory.mktemp("full") / "full.h5", make_frames(3, shape=(6, 5), **FULL))


def test_every_dataset_has_checksums(full):
    file, found = visit(full)
    with file:
        assert len(found) > 80
        assert [name for name, dataset in found.items() if not dataset.fletcher32] == []


@pytest.mark.slow
def test_a_flip_in_any_dataset_is_one_line_with_its_name(tmp_path, full):
    """One bit of each dataset's last chunk: in HDF5's own words to other readers, in one line to ours."""
    rng = np.random.default_rng(18)
    whole = full.read_bytes()
    file, found = visit(full)
    with file:
        chunks = {}
        for name, dataset in found.items():
            if dataset.id.get_num_chunks():
                chunk = dataset.id.get_chunk_info(dataset.id.get_num_chunks() - 1)
                chunks[name] = chunk.byte_offset, chunk.size
    with export.open(full) as recording:
        ours = {*recording._datasets, "line_of_sight"}
    assert ours <= chunks.keys()
    broken = tmp_path / "broken.h5"
    for name, (start, size) in chunks.items():
        data = bytearray(whole)
        data[start + int(rng.integers(size))] ^= 1 << int(rng.integers(8))
        broken.write_bytes(data)
        with h5py.File(broken) as plain, pytest.raises(OSError, match=r"filter|inflate"):
            plain[name][:]
        if name in ours:
            with export.open(broken) as recording, pytest.raises(RecordingError) as caught:
                _ = recording.line_of_sight if name == "line_of_sight" else recording.dataset(name)[:]
            assert str(caught.value).startswith(f"{broken}: {name}: is damaged ("), name
            assert "\n" not in str(caught.value)


def numbers(path):
    """Return all that a recording says, as bytes."""
    with export.open(path) as recording:
        found = {name: recording.dataset(name)[:].tobytes() for name in recording._datasets}
        times = [frame.time_s for frame in recording]
        return found, times, recording.line_of_sight.tobytes(), repr(recording.source)


@pytest.mark.parametrize("state", ["finished", pytest.param("killed", marks=pytest.mark.slow)])
def test_a_flip_anywhere_is_told_or_changes_nothing(tmp_path, state):
    """A killed writer's file is read with SWMR, whose default is to wait for ever where a checksum is wrong.

    Two frames of few pixels, so that most of the file is metadata: 40 flips hit object headers, chunk indices, heaps,
    the superblock and data. Without a limit on read attempts a fifth of them never returned.
    """
    with export.Recorder(tmp_path / "run.h5", SOURCE, run_id=RUN) as recorder:
        for frame in make_frames(2, shape=(6, 5)):
            recorder.write(frame)
        data = recorder.temporary.read_bytes()
    path = tmp_path / "run.h5"
    if state == "finished":
        data = path.read_bytes()
    else:
        assert data[11] == 5  # the superblock says that a SWMR writer has it open
        path = tmp_path / f"killed.h5.tmp-{RUN}"
        path.write_bytes(data)
    before = numbers(path)
    rng = np.random.default_rng(14)
    said: list[str] = []
    for bit in [*rng.integers(0, 8 * 48, 4).tolist(), *rng.integers(0, 8 * len(data), 36).tolist()]:
        flipped = bytearray(data)
        flipped[bit // 8] ^= 1 << bit % 8
        path.write_bytes(flipped)
        try:
            assert numbers(path) == before, bit
        except RecordingError as error:
            said.append(str(error))
    assert len(said) > 20
    assert all(path.name in line and "\n" not in line for line in said)


def test_a_text_of_any_length_is_guarded(tmp_path, full):
    data = bytearray(full.read_bytes())
    place = data.index(b"# element set")
    data[place + 2] ^= 1
    (tmp_path / "run.h5").write_bytes(data)
    with pytest.raises(RecordingError, match=r"run\.h5: is damaged \(texts in its attributes differ"):
        export.open(tmp_path / "run.h5")


def test_resume_refuses_to_carry_damage_on(tmp_path):
    """Chunks are copied as they are stored, so their checksums are verified on the way."""
    output, left = tmp_path / "run.h5", tmp_path / f"run.h5.tmp-{RUN}"
    leave_unfinished(output, make_frames(4, shape=(6, 5)), RUN)
    whole = left.read_bytes()
    for name in ("truth/tdrs/position", "labels/part"):
        with h5py.File(left) as file:
            chunk = file[name].id.get_chunk_info(2)
        data = bytearray(whole)
        data[chunk.byte_offset + 3] ^= 16
        left.write_bytes(data)
        with (
            pytest.raises(RecordingError, match=rf"tmp-{RUN}: {name}: is damaged \(the checksum of frame 2 is wrong\)"),
            export.Recorder(output, SOURCE, run_id=RUN, resume=True),
        ):
            pass
        assert left.read_bytes() == bytes(data)
        assert [path.name for path in tmp_path.iterdir()] == [left.name]
        left.write_bytes(whole)


def test_a_recording_made_before_there_were_checksums_is_read(tmp_path):
    """Three frames of 4 x 3 pixels by version 0.1.0: raw small vectors of 128 frames a chunk, no checksum of texts."""
    packed = Path(__file__).parents[1] / "data" / "recording_0.1.0.h5.gz"
    (tmp_path / "old.h5").write_bytes(gzip.decompress(packed.read_bytes()))
    with export.open(tmp_path / "old.h5") as recording:
        assert len(recording) == 3
        assert recording.source == SOURCE
        assert recording[2].truth.sunlit.keys() == {"tdrs", "follower"}
        digest = hashlib.sha256()
        for name in sorted(recording._datasets):
            digest.update(recording.dataset(name)[:].tobytes())
        assert digest.hexdigest() == DIGEST

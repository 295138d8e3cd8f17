"""Plain rasters: a script that knows word, stride and header reads them; nothing half-written stays."""

import dataclasses

import numpy as np
import pytest

from rso_lidar import export
from rso_lidar.errors import RecordingError
from rso_lidar.export import write_raster
from tests.export.frames_for_tests import make_frames

NO_RETURN = 192_000


def pack(frame):
    """Return words of 12 bits of intensity below 20 bits of range in steps of 1/64 foot, as one camera has them."""
    step = np.where(frame.valid, np.rint(np.nan_to_num(frame.range_m.astype(float)) * 64.0 / 0.3048), NO_RETURN)
    counts = np.where(frame.valid, np.minimum(frame.intensity_counts, 4095), 0)
    return (step.astype(np.uint32) << 12 | counts.astype(np.uint32)).astype("<u4")[None]


def import_raster(path, stride, header, rows, cols):
    """Return ranges [foot] and intensities of all frames: an import script as a laboratory has it."""
    raw = np.fromfile(path, np.uint8)[header:].reshape(-1, stride)
    words = raw[:, : 4 * rows * cols].copy().view("<u4").reshape(-1, rows, cols)
    return (words >> 12) / 64.0, words & 0xFFF


def test_an_import_script_reads_the_frames_with_a_stride_and_a_header(tmp_path):
    frames = list(make_frames(3))
    rows, cols = frames[0].range_m.shape
    words = 4 * rows * cols
    path = write_raster(tmp_path / "a.raw", frames, pack, header_bytes=512, frame_stride_bytes=words + 1424)
    assert path.stat().st_size == 512 + 3 * (words + 1424)
    feet, counts = import_raster(path, words + 1424, 512, rows, cols)
    for k, frame in enumerate(frames):
        here = frame.valid & (frame.range_m < 2**20 / 64 * 0.3048)
        assert here.any()
        assert np.abs(feet[k][here] * 0.3048 - frame.range_m[here]).max() <= 0.5 * 0.3048 / 64 + 1e-3  # float32 at 3 km
        assert np.array_equal(counts[k][here], np.minimum(frame.intensity_counts[here], 4095))
        assert np.all(feet[k][~frame.valid] == 3000.0) and not counts[k][~frame.valid].any()


def test_without_lengths_there_is_nothing_but_words(tmp_path):
    frames = list(make_frames(2))
    path = write_raster(tmp_path / "a.raw", iter(frames), pack)
    assert path.read_bytes() == b"".join(pack(frame).tobytes() for frame in frames)
    behind = write_raster(tmp_path / "b.raw", frames, pack, frame_header_bytes=8).read_bytes()
    assert behind[:8] == bytes(8) and behind[8:] == pack(frames[0]).tobytes() + bytes(8) + pack(frames[1]).tobytes()


@pytest.mark.parametrize(
    ("lengths", "said"),
    [
        (
            {"frame_stride_bytes": 100},
            "frame_stride_bytes: a frame has .* bytes of words behind 0 of header, more than 100",
        ),
        ({"frame_stride_bytes": 0}, "take [0-9]+ or more"),
        ({"header_bytes": -1}, "header_bytes: -1 is not a whole number"),
        ({"frame_header_bytes": 1.5}, "frame_header_bytes: 1.5 is not a whole number"),
        ({"header_bytes": True}, "header_bytes: True"),
        ({"header_bytes": 2**40}, "header_bytes: 1099511627776 is not a whole number"),
    ],
)
def test_lengths_that_make_no_sense_leave_nothing(tmp_path, lengths, said):
    with pytest.raises(RecordingError, match=said):
        write_raster(tmp_path / "a.raw", make_frames(1), pack, **lengths)
    assert not list(tmp_path.iterdir())


def test_a_file_that_breaks_off_leaves_the_older_one(tmp_path):
    frames = list(make_frames(2))
    path = write_raster(tmp_path / "a.raw", frames, pack)
    before = path.read_bytes()
    with pytest.raises(RecordingError, match=r"not replaced|exists"):
        write_raster(path, frames, pack)

    def other_size(frame):
        return pack(frame)[:, : 1 + (frame.index == frames[0].index)]

    with pytest.raises(RecordingError, match=f"frame {frames[1].index}: has .* bytes of words"):
        write_raster(path, frames, other_size, overwrite=True)
    assert path.read_bytes() == before and [file.name for file in tmp_path.iterdir()] == ["a.raw"]
    with pytest.raises(RecordingError, match="no frames"):
        write_raster(tmp_path / "b.raw", [], pack)


def test_the_format_is_known_by_its_suffix():
    assert export.format_for("a.raw").name == "raster"
    with pytest.raises(RecordingError, match="raster needs the recording's scenario"):
        export.save("a.raw", make_frames(1))
    assert dataclasses.is_dataclass(export.format_for("raster"))

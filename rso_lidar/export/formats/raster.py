"""Plain rasters: the words in which a camera reports its pixels, frame after frame, without any description of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np

from rso_lidar.errors import RecordingError
from rso_lidar.export.writer.frame_stream import take_first
from rso_lidar.files import check_stream, check_writable, write_atomically
from rso_lidar.records import Frame

_MOST_BYTES = 2**30  # of a header or a frame: more is a slip, and would fill the memory


def write_raster(
    path: str | Path,
    frames: Iterable[Frame],
    encode: Callable[[Frame], np.ndarray],
    *,
    header_bytes: int = 0,
    frame_header_bytes: int = 0,
    frame_stride_bytes: int | None = None,
    overwrite: bool = False,
) -> Path:
    """Write the words of frames to one file, and return its path.

    The words of a frame are those of its nearest returns, row by row, then those of its second ones. All other bytes are 0.

    Parameters
    ----------
    path : of the file
    frames : written one at a time as they come
    encode : words (return, row, col) of a frame, in the order of bytes that the file has

    Other Parameters
    ----------------
    header_bytes : length of what precedes the first frame [bytes]
    frame_header_bytes : length of what precedes the words of each frame [bytes]
    frame_stride_bytes : from the beginning of one frame to that of the next [bytes] (None: header and words)
    overwrite : whether an existing file may be replaced

    Returns
    -------
    Path

    Raises
    ------
    RecordingError
        For a length that is no whole number from 0 to 2^30, a stride shorter than a frame, frames of different sizes, or a
        path that cannot be written.
    """
    place = check_writable(path, overwrite=overwrite)
    lengths = {"header_bytes": header_bytes, "frame_header_bytes": frame_header_bytes}
    lengths |= {"frame_stride_bytes": frame_stride_bytes} if frame_stride_bytes is not None else {}
    for name, length in lengths.items():
        if not isinstance(length, int) or isinstance(length, bool) or not 0 <= length <= _MOST_BYTES:
            raise RecordingError(f"{place}: {name}: {length!r:.40} is not a whole number from 0 to 2^30; correct it")
    first, coming = take_first(place, frames)
    size = encode(first).nbytes
    stride = frame_header_bytes + size if frame_stride_bytes is None else frame_stride_bytes
    behind = stride - frame_header_bytes - size
    if behind < 0:
        raise RecordingError(
            f"{place}: frame_stride_bytes: a frame has {size:,} bytes of words behind {frame_header_bytes:,} of header, "
            f"more than {stride:,}; take {frame_header_bytes + size} or more"
        )
    with write_atomically(place) as draft, draft.open("wb") as stream:
        stream.write(bytes(header_bytes))
        for frame in coming:
            words = encode(frame)
            if words.nbytes != size:
                raise RecordingError(
                    f"{place}: frame {frame.index}: has {words.nbytes:,} bytes of words, the first one {size:,}; write it "
                    "to another file"
                )
            stream.write(bytes(frame_header_bytes) + np.ascontiguousarray(words).tobytes() + bytes(behind))
            check_stream(stream, draft, place)
    return place

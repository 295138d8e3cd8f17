"""Two recordings compared frame by frame: differences, their statistics, and the target's centre in the image."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass
from pathlib import Path
from threading import Lock

import numpy as np

from rso_lidar.errors import RecordingError
from rso_lidar.export import Recording
from rso_lidar.export.reader.status import read_status
from rso_lidar.records import Frame
from rso_lidar.track import locate_centroid

_MOST_OPEN = 6
_GATE_M = 20.0  # of the centroid; the command `track` takes it from the target's size


@dataclass(frozen=True, eq=False)
class FrameDifference:
    """Difference of two frames: measured range B - A [m] (row, col), NaN where not both report, and its statistics."""

    range_m: np.ndarray
    lines: tuple[str, ...]


class RecordingShelf:
    """Recordings that were opened last, each read frame by frame; one that is being written is opened as it grows."""

    def __init__(self) -> None:
        self._open: OrderedDict[Path, tuple[tuple[int, int], Recording]] = OrderedDict()
        self._lock = Lock()

    def count(self, path: Path) -> int:
        """Return the number of frames that a recording has by now."""
        with self._lock:
            return len(self._get(path))

    def read(self, path: Path, row: int) -> Frame:
        """Read a frame; a row beyond the end is the last frame.

        Raises
        ------
        RecordingError
            If the file cannot be read, or has no frame yet.
        """
        with self._lock:
            recording = self._get(path)
            if not len(recording):
                raise RecordingError(f"{path.name}: has no frame yet; wait for the first")
            return recording[min(row, len(recording) - 1)]

    def find(self, path: Path, index: int) -> Frame | None:
        """Read the frame with a number of its scenario; None if the recording does not have it."""
        with self._lock:
            recording = self._get(path)
            rows = np.flatnonzero(recording.frame_index[:] == index)
            return recording[int(rows[0])] if rows.size else None

    def _get(self, path: Path) -> Recording:
        file = path if path.exists() else read_status(path).file
        status = file.stat()
        stamp = (status.st_mtime_ns, status.st_size)
        if path in self._open and self._open[path][0] != stamp:
            self._open.pop(path)[1].close()
        if path not in self._open:
            self._open[path] = (stamp, Recording(file))
            while len(self._open) > _MOST_OPEN:
                self._open.popitem(last=False)[1][1].close()
        self._open.move_to_end(path)
        return self._open[path][1]


def compare_frames(one: Frame, other: Frame) -> FrameDifference:
    """Compare two frames pixel by pixel.

    Raises
    ------
    RecordingError
        If their arrays have different shapes.
    """
    if one.range_m.shape != other.range_m.shape:
        raise RecordingError(f"frames of {one.range_m.shape} and {other.range_m.shape} pixels cannot be compared")
    both = one.valid & other.valid
    difference = np.where(both, np.asarray(other.range_m, float) - one.range_m, np.nan)
    counts = np.asarray(other.intensity_counts, float) - one.intensity_counts
    lines = [
        f"reported by both {int(both.sum()):,}, by A only {int((one.valid & ~other.valid).sum()):,}, "
        f"by B only {int((other.valid & ~one.valid).sum()):,}"
    ]
    if both.any():
        of_both = difference[both]
        middle, spread = np.median(of_both), 1.4826 * np.median(np.abs(of_both - np.median(of_both)))
        lines += [
            f"range B − A: mean {of_both.mean():+.3f} m, rms {np.sqrt(np.mean(of_both**2)):.3f} m",
            f"robust: median {middle:+.3f} m, standard deviation {spread:.3f} m (1.4826 × median deviation)",
            f"intensity B − A: mean {counts[both].mean():+.1f}, standard deviation {counts[both].std():.1f} counts",
        ]
    return FrameDifference(difference, tuple(lines))


def locate_centers(frame: Frame) -> dict[str, tuple[float, float]]:
    """Return where a frame has the true origins of its targets, and the centroid of its points, as pixel (row, col).

    A place behind the lidar or outside the array is left out.
    """
    places_m = {
        f"truth: {target.name}": frame.truth.pose("lidar", target.name).translation for target in frame.source.targets
    }
    sight = frame.line_of_sight
    pixel_rad = float(np.linalg.norm(sight[0, 0] - sight[0, 1]))
    fix = locate_centroid(frame.points_m, pixel_rad=pixel_rad, gate_m=_GATE_M)
    if fix is not None:
        places_m["centroid of points"] = fix.position_m
    found = {}
    flat = sight.reshape(-1, 3)
    for name, place_m in places_m.items():
        cosine = flat @ (place_m / max(float(np.linalg.norm(place_m)), 1e-9))
        nearest = int(cosine.argmax())
        if cosine[nearest] > np.cos(pixel_rad):
            row, col = divmod(nearest, sight.shape[1])
            found[name] = (float(row), float(col))
    return found

"""Two frames compared pixel by pixel, and where a frame has its targets: by the truth, and by the reference tracker."""

from __future__ import annotations

import numpy as np

from rso_lidar.errors import RecordingError
from rso_lidar.export import Recording
from rso_lidar.records import Frame
from rso_lidar.track import locate_centroid

_GATE_M = 20.0  # of the centroid


def find_frame(recording: Recording, index: int) -> Frame | None:
    """Return the frame of a recording with a number of its scenario, or None if it has no such frame."""
    rows = np.flatnonzero(recording.frame_index[:] == index)
    return recording[int(rows[0])] if rows.size else None


def compare_frames(one: Frame, other: Frame) -> list[str]:
    """Return the statistics of the differences of two frames, second minus first, one line each.

    Raises
    ------
    RecordingError
        If they have different numbers of pixels.
    """
    if one.range_m.shape != other.range_m.shape:
        raise RecordingError(f"frames of {one.range_m.shape} and {other.range_m.shape} pixels cannot be compared")
    both = one.valid & other.valid
    lines = [
        f"Reported by both {int(both.sum()):,}, by A only {int((one.valid & ~other.valid).sum()):,}, "
        f"by B only {int((other.valid & ~one.valid).sum()):,} pixels."
    ]
    if both.any():
        range_m = np.asarray(other.range_m, float)[both] - one.range_m[both]
        counts = np.asarray(other.intensity_counts, float)[both] - one.intensity_counts[both]
        middle_m = float(np.median(range_m))
        robust_m = 1.4826 * float(np.median(np.abs(range_m - middle_m)))
        lines += [
            f"Range: mean {range_m.mean():+.3f} m, rms {np.sqrt(np.mean(range_m**2)):.3f} m; median {middle_m:+.3f} m, "
            f"robust standard deviation {robust_m:.3f} m.",
            f"Intensity: mean {counts.mean():+.1f}, standard deviation {counts.std():.1f} counts.",
        ]
    return lines


def locate_centers(frame: Frame) -> dict[str, tuple[int, int]]:
    """Return the pixel (row, col) of the true origin of each target, and of the centroid of the measured points.

    What is outside the field is left out.
    """
    places_m = {f"truth of {one.name}": frame.truth.pose("lidar", one.name).translation for one in frame.source.targets}
    sight = frame.line_of_sight
    pixel_rad = float(np.linalg.norm(sight[0, 0] - sight[0, 1]))
    fix = locate_centroid(frame.points_m, pixel_rad=pixel_rad, gate_m=_GATE_M)
    if fix is not None:
        places_m["centroid of the points"] = fix.position_m
    found = {}
    for name, place_m in places_m.items():
        cosine = sight.reshape(-1, 3) @ (place_m / max(float(np.linalg.norm(place_m)), 1e-9))
        nearest = int(cosine.argmax())
        if cosine[nearest] > np.cos(pixel_rad):
            row, col = divmod(nearest, sight.shape[1])
            found[name] = (row, col)
    return found

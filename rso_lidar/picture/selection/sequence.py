"""Frames chosen from a sequence, and the little of each that a small picture needs."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeVar, runtime_checkable

import numpy as np

from rso_lidar.errors import RecordingError, did_you_mean
from rso_lidar.picture.selection.window import Window, bounding_window, grow
from rso_lidar.records import Frame

T = TypeVar("T")


@runtime_checkable
class Counted(Protocol):
    """Collection of frames with a length: a list, a recording."""

    def __len__(self) -> int: ...

    def __getitem__(self, index: int, /) -> Frame: ...


def even_indices(n: int, count: int) -> list[int]:
    """Choose evenly spaced indices of a sequence, both ends included.

    Parameters
    ----------
    n : length of the sequence
    count : greatest number of indices

    Returns
    -------
    list of int
        Ascending indices.

        >>> even_indices(10, 4)
        [0, 3, 6, 9]
        >>> even_indices(3, 10)
        [0, 1, 2]

    Raises
    ------
    RecordingError
        If `count` is below 1.
    """
    if count < 1:
        raise RecordingError(f"a picture of {count} frames; give 1 or more")
    if n <= count:
        return list(range(n))
    if count == 1:
        return [0]
    return [(2 * k * (n - 1) + count - 1) // (2 * (count - 1)) for k in range(count)]


def pick(frames: Iterable[Frame], count: int, look: Callable[[Frame], T]) -> tuple[list[T], int]:
    """Apply `look` to at most `count` evenly chosen frames; return the results and the total number of frames.

    A sequence (a list, a recording) is read only where it is looked at. Of an iterator, such as `simulate` gives, every
    s-th frame and the last are kept, s doubling whenever too many are held: memory does not grow with its length.

    Raises
    ------
    RecordingError : if there are no frames.
    """
    even_indices(0, count)
    if isinstance(frames, Counted):
        total = len(frames)
        chosen = [look(frames[k]) for k in even_indices(total, count)]
    else:
        chosen, total = _thin(frames, count, look)
    if not chosen:
        raise RecordingError("nothing to draw: the recording has no frames")
    return chosen, total


def _thin(frames: Iterable[Frame], count: int, look: Callable[[Frame], T]) -> tuple[list[T], int]:
    """Apply `look` to every s-th frame of an iterator and to the last, doubling s when too many results are held.

    Parameters
    ----------
    count : most results returned; up to four times as many are held
    """
    kept: list[T] = []
    stride, total = 1, 0
    last: Frame | None = None
    for frame in frames:
        last = frame
        if total % stride == 0:
            if len(kept) == 4 * count:
                kept, stride = kept[::2], 2 * stride
            if total % stride == 0:
                kept.append(look(frame))
        total += 1
    if last is not None and (total - 1) % stride:
        kept.append(look(last))
    return [kept[k] for k in even_indices(len(kept), count)], total


def find_target_returns(frame: Frame) -> np.ndarray:
    """Find the returns (row, col) that came from a target: by the labels, or without labels by their neighbours.

    Without labels a return with fewer than two returns around it is taken for a false one.

    Parameters
    ----------
    frame : with or without labels

    Returns
    -------
    ndarray
        (row, col) bool.
    """
    labelled = frame.labels.target >= 0
    if labelled.any():
        return np.asarray(frame.valid & labelled)
    valid = frame.valid
    padded = np.pad(valid.astype(np.int8), 1)
    n_rows, n_cols = valid.shape
    around_it = sum(padded[r : r + n_rows, c : c + n_cols] for r in range(3) for c in range(3)) - valid
    return np.asarray(valid & (around_it >= 2))


def find_target_pixels(frame: Frame) -> np.ndarray:
    """Find the pixels of interest (row, col): targets by the labels, else returns with neighbours, else any return."""
    for mask in (frame.labels.target >= 0, find_target_returns(frame), frame.valid):
        if mask.any():
            return np.asarray(mask)
    return np.ones(frame.valid.shape, dtype=bool)


def choose_window(*frames: Frame, whole: bool = False) -> Window:
    """Choose the part of the field that pictures of frames show: a square about their targets, or the whole field.

    Parameters
    ----------
    *frames : frames of one focal plane, at least one. Without labels the returns stand for the targets
    whole : whether to show the whole field

    Returns
    -------
    Window
    """
    masks = [find_target_pixels(frame) for frame in frames]
    if whole:
        return bounding_window(np.zeros(masks[0].shape, bool))
    return Window.about(np.logical_or.reduce(masks))


def choose_camera_window(camera: str, *frames: Frame, whole: bool = False) -> Window:
    """Choose the part of a camera's field that pictures show: a square about the targets, or the whole field.

    Parameters
    ----------
    camera : name of the camera beside the lidar
    *frames : frames with an image of it, at least one
    whole : whether to show the whole field

    Returns
    -------
    Window
    """
    masks = [np.asarray(frame.camera_labels[camera].filled_fraction) > 0.0 for frame in frames]
    mask = np.logical_or.reduce(masks)
    return Window.about(np.zeros_like(mask) if whole else mask)


def target_ranges_m(frame: Frame) -> dict[str, float]:
    """Return the true range [m] of each target's origin by name, without those missing from the truth."""
    return {
        entry.name: float(np.linalg.norm(frame.truth.pose("lidar", entry.name).translation))
        for entry in frame.source.targets
        if entry.name in frame.truth.poses
    }


def format_start(frame: Frame) -> str:
    """Format the instant at which `time_s` is zero, with a final Z."""
    return frame.source.start_utc.replace("+00:00", "Z")


def pixel_rad(frame: Frame) -> float:
    """Return the angle [rad] between the lines of sight of two adjacent pixels in the middle of the field."""
    n_rows, n_cols = frame.valid.shape
    row, col = n_rows // 2, n_cols // 2
    direction, neighbour = frame.line_of_sight[row, col], frame.line_of_sight[row, max(col - 1, 0)]
    return float(2 * np.arcsin(0.5 * np.linalg.norm(direction - neighbour)))


@dataclass(frozen=True, eq=False)
class Thumbnail:
    """Excerpt of a frame: what one cell of a sheet, or one picture of an animation, needs.

    Parameters
    ----------
    time_s : of the flash, since the start [s]
    title, start_utc : of the run
    range_m, intensity_counts : (row, col) [m], NaN for no return, and [counts]
    on_target : (row, col), returns from a target
    bounds : the part of the field with targets, or with returns
    true_range_m : range of the nearest target's origin [m], NaN where unknown
    pixel_rad : angle between adjacent pixels in the middle of the field [rad]
    """

    time_s: float
    title: str
    start_utc: str
    range_m: np.ndarray
    intensity_counts: np.ndarray
    on_target: np.ndarray
    bounds: Window
    true_range_m: float
    pixel_rad: float

    @staticmethod
    def of(frame: Frame) -> Thumbnail:
        """Make the thumbnail of a frame.

        Parameters
        ----------
        frame : with or without labels

        Returns
        -------
        Thumbnail
        """
        ranges_m = target_ranges_m(frame)
        returned, bounds = find_target_returns(frame), bounding_window(find_target_pixels(frame))
        if returned.any():  # of a target that is mostly too faint, show what came back
            bounds = grow(bounding_window(returned), bounds)
        return Thumbnail(
            time_s=frame.time_s,
            title=frame.source.title,
            start_utc=format_start(frame),
            range_m=np.array(frame.range_m),
            intensity_counts=np.array(frame.intensity_counts),
            on_target=returned,
            bounds=bounds,
            true_range_m=min(ranges_m.values(), default=float("nan")),
            pixel_rad=pixel_rad(frame),
        )

    @property
    def median_m(self) -> float:
        """Median range [m] of the target's returns, NaN where none came back."""
        seen = self.range_m[self.on_target]
        return float(np.median(seen)) if seen.size else float("nan")

    @property
    def pixel_m(self) -> float:
        """Width of a pixel at the target [m], NaN where no range is known."""
        median_m = self.median_m
        return self.pixel_rad * (median_m if np.isfinite(median_m) else self.true_range_m)

    @property
    def returns(self) -> int:
        """Number of pixels that reported a return."""
        return int(np.isfinite(self.range_m).sum())


def choose_target(picture: str, target: str | None, targets: Sequence[str], known: Sequence[str]) -> str:
    """Choose the axes about which a picture is drawn: those that are named, or the first target's.

    Parameters
    ----------
    target : name of axes, where the user gives one
    known : names of all axes

    Raises
    ------
    RecordingError : if there is no target, or no axes of that name.
    """
    if target is None:
        if not targets:
            raise RecordingError(f"{picture}: no target to draw about; name one (known axes: {', '.join(known)})")
        return targets[0]
    if target not in known:
        raise RecordingError(f"{picture}: no target named '{target}'{did_you_mean(target, known)}")
    return target

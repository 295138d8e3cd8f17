"""Frames of a dataset as lists of returns, and the inputs of the networks: crops and clouds.

A frame has a few thousand reports at most, and a few of them are noise. `Returns` holds the reports of the densest group in
space. The group is found from the reading alone; labels are carried along for training only.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

import rso_lidar as rl
from rso_lidar.errors import DatasetError

GROUP_RADIUS_M = 20.0  # half of the longest craft of the study (comsat, 36 m), and a margin
NEIGHBOUR_M = 5.0  # a few pixels at 3 km, less than a bus
CROP = 64  # pixels
SMALLEST_RADIUS = 4.0  # pixels; lower bound of the radius of a crop about few returns
READING = ("range_m", "intensity_counts", "intrinsics_px")
FRAME_COLUMNS = (
    "sample", "step", "draw", "class_id", "model_id", "sensor_id", "present", "range_to_target_m", "lit_pixels",
    "reporting_pixels", "position_m", "quaternion_xyzw", "intrinsics_px",
)  # fmt: skip


@dataclass(frozen=True)
class Returns:
    """Returns of the target candidate in n frames, one after the other; those of frame k are start[k] to start[k + 1].

    `point_m` (return, 3) in lidar axes, `pixel` (return, 2) row and col, `intensity` (return) counts, `labels` of the
    pixels by name (return), `columns` by name (frame), and `reports` (frame), the count of all reports, noise included.
    """

    start: np.ndarray
    point_m: np.ndarray
    pixel: np.ndarray
    intensity: np.ndarray
    reports: np.ndarray
    columns: dict[str, np.ndarray]
    labels: dict[str, np.ndarray] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.start) - 1

    @property
    def count(self) -> np.ndarray:
        """Number of returns of each frame."""
        return np.diff(self.start)

    @property
    def has_craft(self) -> np.ndarray:
        """Frames with returns of a craft (frame), from which a class, a pose or parts can be learned."""
        return (self.count > 0) & (self.columns["class_id"] >= 0)

    def of(self, k: int) -> slice:
        """Place of the returns of frame k."""
        return slice(self.start[k], self.start[k + 1])

    def take(self, frames: np.ndarray) -> Returns:
        """Return some of the frames, in the order given."""
        frames = np.arange(len(self))[frames]
        rows = np.concatenate([np.arange(self.start[k], self.start[k + 1]) for k in frames] or [np.zeros(0, int)])
        return replace(
            self,
            start=np.concatenate([[0], np.cumsum(self.count[frames])]),
            point_m=self.point_m[rows],
            pixel=self.pixel[rows],
            intensity=self.intensity[rows],
            reports=self.reports[frames],
            columns={name: values[frames] for name, values in self.columns.items()},
            labels={name: values[rows] for name, values in self.labels.items()},
        )


def directions(shape: tuple[int, int], intrinsics_px: np.ndarray) -> np.ndarray:
    """Return unit lines of sight (row, col, xyz) of a camera without distortion: +z ahead, +x right, +y down."""
    fx, fy, cx, cy = intrinsics_px
    row, col = np.mgrid[: shape[0], : shape[1]]
    ray = np.stack([(col - cx) / fx, (row - cy) / fy, np.ones(shape)], axis=-1)
    return ray / np.linalg.norm(ray, axis=-1, keepdims=True)


def find_group(point_m: np.ndarray, intensity: np.ndarray) -> np.ndarray:
    """Find the returns of the target among all reports of a frame: the reports near the densest place.

    Noise reports anywhere in the gate, so that two of them are hardly ever within metres of each other. Where no report
    has a neighbour the brightest is taken. Returns whether each report is kept.
    """
    from scipy.spatial import cKDTree

    if not len(point_m):
        return np.zeros(0, bool)
    some = np.arange(0, len(point_m), max(1, len(point_m) // 500))
    near = cKDTree(point_m).query_ball_point(point_m[some], NEIGHBOUR_M, return_length=True)
    middle = point_m[some[np.lexsort((intensity[some], near))[-1]]]
    kept = np.linalg.norm(point_m - middle, axis=1) < GROUP_RADIUS_M
    for _ in range(2):
        kept = np.linalg.norm(point_m - point_m[kept].mean(axis=0), axis=1) < GROUP_RADIUS_M
        if not kept.any():
            return np.linalg.norm(point_m - middle, axis=1) < GROUP_RADIUS_M
    return kept


def choose_frames(part: Any, most: int | None, draws: int | None) -> np.ndarray:
    """Choose frames of a split (frame), by number; ``most`` and ``draws`` are those of `load_returns`."""
    taken = np.arange(len(part))
    if draws is not None:
        taken = taken[np.asarray(part.column("draw")) < draws]
    return taken[:most]


def load_returns(
    folder: str, split: str, labels: tuple[str, ...] = (), most: int | None = None, draws: int | None = None
) -> Returns:
    """Load the returns of the frames of a split.

    Parameters
    ----------
    folder : of the dataset.
    split : its name.
    labels : arrays (frame, row, col) to carry along, by name.
    most : greatest number of frames; all if omitted.
    draws : number of noise draws of each pose to take; all if omitted.
    """
    part = rl.dataset.open(folder).split(split)
    taken = choose_frames(part, most, draws)
    pieces: list[dict[str, Any]] = []
    reports, counts = [], []
    sight: dict[bytes, np.ndarray] = {}
    for some in np.array_split(taken, 1 + len(taken) // 256):
        block = part.read(some.tolist(), (*READING, *labels))
        for k, range_m in enumerate(block["range_m"]):
            key = block["intrinsics_px"][k].tobytes()
            if key not in sight:
                sight[key] = directions(range_m.shape, block["intrinsics_px"][k])
            pixel = np.argwhere(np.isfinite(range_m))
            at = tuple(pixel.T)
            point = range_m[at][:, None] * sight[key][at]
            intensity = block["intensity_counts"][k][at].astype(np.float32)
            kept = find_group(point, intensity)
            at = tuple(pixel[kept].T)
            reports.append(len(pixel))
            counts.append(int(kept.sum()))
            pieces.append(
                {"point_m": point[kept], "pixel": pixel[kept], "intensity": intensity[kept]}
                | {name: block[name][k][at] for name in labels}
            )
    join = {name: np.concatenate([piece[name] for piece in pieces]) for name in pieces[0]}
    return Returns(
        start=np.concatenate([[0], np.cumsum(counts)]),
        point_m=join.pop("point_m").astype(np.float32),
        pixel=join.pop("pixel").astype(np.int16),
        intensity=join.pop("intensity"),
        reports=np.array(reports),
        columns={name: np.asarray(part.column(name))[taken] for name in FRAME_COLUMNS},
        labels=join,
    )


def divide(returns: Returns, seed: int, usable: np.ndarray, share: float = 0.15) -> tuple[np.ndarray, np.ndarray]:
    """Divide frames into training and validation frames by sample, so that noise draws of one pose stay together.

    Parameters
    ----------
    returns : of the training split.
    seed : of the choice.
    usable : (frame) whether a frame can be trained on.
    share : of the samples that are held out.
    """
    samples = np.unique(returns.columns["sample"][usable])
    held = np.random.default_rng(seed).permutation(samples)[: max(1, int(share * len(samples)))]
    held_out = np.isin(returns.columns["sample"], held)
    if not (usable & held_out).any() or not (usable & ~held_out).any():
        raise DatasetError(f"train: {usable.sum()} frames with returns of a craft are too few: make a larger dataset")
    return np.flatnonzero(usable & ~held_out), np.flatnonzero(usable & held_out)


def outline(returns: Returns, frame: int) -> tuple[np.ndarray, float]:
    """Return the middle (row, col) and the radius [pixels] of a circle about the returns of a frame."""
    pixel = returns.pixel[returns.of(frame)]
    if not len(pixel):
        return np.zeros(2), SMALLEST_RADIUS
    middle = (pixel.min(axis=0) + pixel.max(axis=0)) / 2.0
    return middle, max(SMALLEST_RADIUS, float(np.hypot(*(pixel - middle).T).max()) + 1.0)


def scale(returns: Returns, frames: np.ndarray) -> np.ndarray:
    """Return two numbers that a crop lacks (frame, 2): logarithms of its half width [10 m] and of the number of returns."""
    out = np.zeros((len(frames), 2), np.float32)
    for k, frame in enumerate(frames):
        point = returns.point_m[returns.of(frame)]
        if len(point):
            far = float(np.median(np.linalg.norm(point, axis=1)))
            pixel_rad = 1.0 / float(returns.columns["intrinsics_px"][frame, 0])
            out[k] = np.log(outline(returns, frame)[1] * pixel_rad * far / 10.0), np.log(len(point)) / 4.0
    return out


def cells() -> np.ndarray:
    """Return the places (2, row, col) of the cells of a crop, down and right of its middle, as shares of its half width."""
    cell = (np.arange(CROP) + 0.5) / CROP * 2.0 - 1.0
    return np.stack(np.meshgrid(cell, cell, indexing="ij"))


def crop(
    returns: Returns, frames: np.ndarray, rng: np.random.Generator | None = None, names: tuple[str, ...] = ()
) -> Any:
    """Return crops (frame, 3, row, col) about the returns: range minus its median, log intensity, 1 where there is a return.

    A crop encloses a circle about the returns. A range of 10 m is 1. Cells take the return of the pixel that they lie in.
    Intensity is multiplied by the square of the range in km, with which the signal of a facet falls.

    Parameters
    ----------
    returns : of all frames.
    frames : numbers of those to crop.
    rng : turns each crop at random about the line of sight and mirrors half of them; None leaves them as they are.
    names : labels to crop as well; then a dict of them (frame, row, col) is returned too, -1 outside the returns.
    """
    out = np.zeros((len(frames), 3, CROP, CROP), np.float32)
    extra = {name: np.full((len(frames), CROP, CROP), -1, returns.labels[name].dtype) for name in names}
    down, right = cells()
    for k, frame in enumerate(frames):
        here = returns.of(frame)
        if here.start == here.stop:
            continue
        middle, radius = outline(returns, frame)
        low, high = returns.pixel[here].min(axis=0) - 1, returns.pixel[here].max(axis=0) + 1  # a rim without returns
        number = np.full(high - low + 1, -1)
        number[tuple((returns.pixel[here] - low).T)] = np.arange(here.start, here.stop)
        angle = 0.0 if rng is None else rng.uniform(0.0, 2.0 * np.pi)
        side = 1.0 if rng is None else rng.choice([-1.0, 1.0])
        c, s = radius * np.cos(angle), radius * np.sin(angle)
        row = np.rint(middle[0] - low[0] + c * down + s * side * right).astype(int).clip(0, number.shape[0] - 1)
        col = np.rint(middle[1] - low[1] + c * side * right - s * down).astype(int).clip(0, number.shape[1] - 1)
        at = number[row, col]
        far = np.linalg.norm(returns.point_m[here], axis=1)
        bright = np.log(returns.intensity[here]) + 2.0 * np.log(np.median(far) / 1000.0)
        values = np.stack([(far - np.median(far)) / 10.0, bright / 10.0, np.ones(len(far))])
        out[k] = np.where(at >= 0, values[:, np.maximum(at - here.start, 0)], 0.0)
        for name, kept in extra.items():
            kept[k] = np.where(at >= 0, returns.labels[name][np.maximum(at, 0)], -1)
    return (out, extra) if names else out


def add_metres(image: np.ndarray, extra: np.ndarray) -> np.ndarray:
    """Add two channels to crops (frame, 3, row, col): the places of the returns across [10 m], down and right.

    Parameters
    ----------
    image : crops.
    extra : result of `scale` (frame, 2), which has their half widths.
    """
    across = cells()[None] * np.exp(extra[:, 0])[:, None, None, None] * image[:, 2:]
    return np.concatenate([image, across.astype(np.float32)], axis=1)


def metric_crop(
    returns: Returns, frames: np.ndarray, rng: np.random.Generator | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return crops (frame, 5, row, col) with the channels of `add_metres`, and their `scale`.

    Parameters
    ----------
    returns : of all frames.
    frames : numbers of those to crop.
    rng : turns and mirrors the crops as in `crop`.
    """
    extra = scale(returns, frames)
    return add_metres(crop(returns, frames, rng), extra), extra


def cloud(returns: Returns, frames: np.ndarray, size: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return clouds (frame, point, 4) of x, y, z about their mean [10 m] and log intensity, and the means (frame, 3) [m].

    Parameters
    ----------
    returns : of all frames.
    frames : numbers of those to take.
    size : number of points, drawn without repetition where there are as many and repeated where there are fewer.
    rng : random generator.
    """
    out, middle = np.zeros((len(frames), size, 4), np.float32), np.zeros((len(frames), 3))
    for k, frame in enumerate(frames):
        here = returns.of(frame)
        count = here.stop - here.start
        if not count:
            continue
        some = here.start + (rng.choice(count, size, replace=False) if count >= size else np.arange(size) % count)
        middle[k] = returns.point_m[here].mean(axis=0)
        out[k, :, :3] = (returns.point_m[some] - middle[k]) / 10.0
        out[k, :, 3] = np.log(returns.intensity[some]) / 10.0
    return out, middle

"""Fixed transforms of a frame: an image of fixed size about its returns, and a cloud of a fixed number of points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rso_lidar.dataset.reading.random_access import Dataset


@dataclass(frozen=True)
class CropReturns:
    """Crop a frame about its returns and resample it to a square image of three channels, `image` (3, size, size).

    The channels are the range minus its median, divided by `range_scale_m`; the natural logarithm of 1 + counts; and 1
    where a cell has a return. Cells without a return are 0 in all channels. Absolute range and place are left out, so
    that a network cannot learn the class from them. A cell larger than a pixel holds the means of its returns. A
    smaller cell repeats the pixel at its centre. Returns farther than `depth_m` from the median range, such as false
    alarms, are left out.

    Parameters
    ----------
    size : rows and columns of the image
    depth_m : greatest distance of a return from the median range [m]
    range_scale_m : range that is 1 in the first channel [m]
    margin_pixels : empty rows and columns around the returns
    """

    size: int = 64
    depth_m: float = 30.0
    range_scale_m: float = 1.0
    margin_pixels: int = 1
    needs: tuple[str, ...] = ("range_m", "intensity_counts")
    makes: tuple[str, ...] = ("image",)

    def __call__(self, frame: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Add the image to a frame."""
        image = np.zeros((3, self.size, self.size), np.float32)
        frame["image"] = image
        row, col, range_m = find_returns(frame["range_m"], self.depth_m)
        if not len(row):
            return frame
        counts = frame["intensity_counts"][row, col].astype(np.float32)
        values = ((range_m - np.median(range_m)) / self.range_scale_m, np.log1p(counts), np.ones(len(row)))
        low = np.array([row.min(), col.min()]) - self.margin_pixels
        high = np.array([row.max(), col.max()]) + self.margin_pixels
        side = int((high - low).max()) + 1
        corner = np.floor(0.5 * (low + high + 1 - side)).astype(np.int64)
        place = row - corner[0], col - corner[1]
        if side > self.size:
            cell = (place[0] * self.size // side) * self.size + place[1] * self.size // side
            count = np.bincount(cell, minlength=self.size**2)
            lit = count > 0
            for channel, value in zip(image, values, strict=True):
                channel.ravel()[lit] = np.bincount(cell, value, self.size**2)[lit] / count[lit]
            return frame
        whole = np.zeros((3, side, side), np.float32)
        for channel, value in zip(whole, values, strict=True):
            channel[place] = value
        at = (2 * np.arange(self.size) + 1) * side // (2 * self.size)
        image[:] = whole[:, at[:, None], at]
        return frame


@dataclass(frozen=True, eq=False)
class PointCloud:
    """Convert the returns of a frame to points in lidar axes: `cloud_m` (point, xyz) minus their mean, `center_m` (xyz) [m].

    If there are more returns than `points`, evenly spaced returns in pixel order are taken. If there are fewer, they are
    repeated. A frame without returns has zeros. `returns` is the number of returns near the median range.

    Parameters
    ----------
    lines_of_sight : (sensor) each (row, col, xyz), by `sensor_id`
    points : number of points
    depth_m : greatest distance of a return from the median range [m]; others, such as false alarms, are left out
    """

    lines_of_sight: Sequence[np.ndarray]
    points: int = 1024
    depth_m: float = 30.0
    needs: tuple[str, ...] = ("range_m", "sensor_id")
    makes: tuple[str, ...] = ("cloud_m", "center_m", "returns")

    @classmethod
    def of(cls, data: Dataset, points: int = 1024, depth_m: float = 30.0) -> PointCloud:
        """Return the transform for the sensors of a dataset.

        Parameters
        ----------
        data : the dataset
        points, depth_m : as for the class
        """
        sights = tuple(data.constants.line_of_sight[name].astype(np.float32) for name in data.sensors)
        return cls(sights, points, depth_m)

    def __call__(self, frame: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Add the points to a frame."""
        row, col, range_m = find_returns(frame["range_m"], self.depth_m)
        frame["cloud_m"], frame["center_m"] = np.zeros((self.points, 3), np.float32), np.zeros(3, np.float32)
        frame["returns"] = np.array(len(row), np.int32)
        if not len(row):
            return frame
        sight = self.lines_of_sight[int(frame["sensor_id"])]
        cloud = range_m[:, None].astype(np.float64) * sight[row, col]
        center = cloud.mean(axis=0)
        chosen = np.arange(self.points) % len(row)
        if len(row) > self.points:
            chosen = np.arange(self.points) * len(row) // self.points
        frame["cloud_m"][:], frame["center_m"][:] = (cloud - center)[chosen], center
        return frame


def find_returns(range_m: np.ndarray, depth_m: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find the returns of a frame near its median range.

    Parameters
    ----------
    range_m : (row, col) [m], NaN where nothing was reported
    depth_m : greatest distance from the median [m]

    Returns
    -------
    row, column and range [m] of each return.
    """
    row, col = np.nonzero(np.isfinite(range_m))
    returns_m = range_m[row, col]
    if len(returns_m):
        near = np.abs(returns_m - np.median(returns_m)) <= depth_m
        row, col, returns_m = row[near], col[near], returns_m[near]
    return row, col, returns_m

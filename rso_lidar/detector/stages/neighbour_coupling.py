"""Crosstalk in amplitude: each pixel shows a share of what its neighbours amplify, and may trigger on it in the dark."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from rso_lidar.detector.settings.focal_plane import AmplitudeCrosstalk
from rso_lidar.detector.stages.time_axis import Rows
from rso_lidar.kernels import kernel, packed
from rso_lidar.parallel import run_in_threads
from rso_lidar.records import Photons

_ROWS_AT_ONCE = 1024
_NO_CELLS = 1e6  # of coherence: what places rows draws no speckle


def list_neighbours(crosstalk: AmplitudeCrosstalk) -> tuple[np.ndarray, np.ndarray]:
    """Return the offsets (neighbour, row_col) of the pixels that couple, and the factor of the amplitude of each."""
    level_db = crosstalk.level_db
    far = len(level_db)
    row, col = (axis.ravel() for axis in np.mgrid[-far : far + 1, -far : far + 1])
    distance = np.hypot(row, col)
    allowed = {"both": distance > 0.0, "rows": (row == 0) & (col != 0), "columns": (col == 0) & (row != 0)}
    some = allowed[crosstalk.along] & (distance <= far)
    factor = 10.0 ** (np.interp(distance[some], np.arange(1, far + 1), level_db) / 20.0)
    return np.stack([row[some], col[some]], axis=1), factor


@dataclass(frozen=True, eq=False)
class NeighbourCoupling:
    """Which steps of which rows add to those of each row, and by how much."""

    rows: Rows
    shape: tuple[int, int]
    first: np.ndarray  # (pixel + 1) first row of each pixel
    begin: np.ndarray  # (row) from this step of the axis on a row stands for its pixel,
    end: np.ndarray  # (row) and up to this one, where the next takes over
    offset: np.ndarray  # (neighbour, row_col)
    factor: np.ndarray  # (neighbour) float32

    @staticmethod
    def of(crosstalk: AmplitudeCrosstalk, rows: Rows, shape: tuple[int, int]) -> NeighbourCoupling:
        """Find the rows of each pixel; where two overlap, the first stands for the pixel while it is watched."""
        end = rows.start + rows.length
        begin = rows.start.copy()
        row = np.flatnonzero(rows.pixel[1:] == rows.pixel[:-1])
        end[row] = np.minimum(end[row], np.maximum(rows.start[row] + rows.last[row], rows.start[row + 1]))
        begin[row + 1] = np.maximum(begin[row + 1], end[row])
        offset, factor = list_neighbours(crosstalk)
        first = np.searchsorted(rows.pixel, np.arange(shape[0] * shape[1] + 1))
        return NeighbourCoupling(rows, shape, first, begin, end, offset, factor.astype(np.float32))

    def add(self, signal: np.ndarray, wanted: np.ndarray, threads: int | None = 1) -> np.ndarray:
        """Return some rows (wanted, step) of a signal (row, step) with what their neighbours add."""
        coupled = np.empty((len(wanted), self.rows.length), np.float32)
        places = (self.rows.pixel, self.rows.start, self.first, self.begin, self.end, self.offset)
        pixel, start, first, begin, end, offset = (packed(values, np.int64) for values in places)
        signal, (n_rows, n_cols) = packed(signal, np.float32), self.shape

        def add_block(block: slice) -> None:
            some = packed(wanted[block], np.int64)
            couple_rows(
                signal, pixel, start, first, begin, end, offset, self.factor, n_rows, n_cols, some, coupled[block]
            )

        run_in_threads(threads, add_block, [slice(k, k + _ROWS_AT_ONCE) for k in range(0, len(wanted), _ROWS_AT_ONCE)])
        return coupled


@kernel
def couple_rows(
    signal: np.ndarray,
    pixel: np.ndarray,
    start: np.ndarray,
    first: np.ndarray,
    begin: np.ndarray,
    end: np.ndarray,
    offset: np.ndarray,
    factor: np.ndarray,
    n_rows: int,
    n_cols: int,
    wanted: np.ndarray,
    coupled: np.ndarray,
) -> None:
    """Write some rows of a signal, each with its neighbours' shares at the same instants.

    Parameters
    ----------
    signal : (row, step)
    pixel, start, begin, end : (row) pixel, first step on the axis of time, and the steps for which the row stands
    first : (pixel + 1) first row of each pixel
    offset, factor : (neighbour, row_col) and (neighbour)
    n_rows, n_cols : pixels of the array
    wanted : (wanted) rows to write
    coupled : (wanted, step), written
    """
    n = signal.shape[1]
    for k in range(len(wanted)):
        row = wanted[k]
        total = coupled[k]
        for step in range(n):
            total[step] = signal[row, step]
        at_row, at_col = pixel[row] // n_cols, pixel[row] % n_cols
        for j in range(len(factor)):
            from_row, from_col, share = at_row + offset[j, 0], at_col + offset[j, 1], factor[j]
            if from_row < 0 or from_row >= n_rows or from_col < 0 or from_col >= n_cols:
                continue
            neighbour = from_row * n_cols + from_col
            for other in range(first[neighbour], first[neighbour + 1]):
                low, high = max(begin[other] - start[row], 0), min(end[other] - start[row], n)
                if low >= high:
                    continue
                lag = start[other] - start[row]
                added, to = signal[other, low - lag : high - lag], total[low:high]
                for step in range(high - low):
                    to[step] += share * added[step]


def gather_light(crosstalk: AmplitudeCrosstalk, photons: Photons, least_photons: float, most_photons: float) -> Photons:
    """Return light that marks when each pixel has a signal, its own or its neighbours', to place rows by.

    Returns of a pixel within one bin, as wide as the pulse, become one return of the same extent.

    Parameters
    ----------
    least_photons : fewer photons of the neighbours in a bin mark nothing
    most_photons : of a pixel in a bin that couple, where its amplifier has a rail
    """
    if not (photons.photons > 0.0).any():
        return photons
    first_s = float(photons.delay_s.min())
    number = ((photons.delay_s - first_s) / photons.pulse_fwhm_s).astype(np.int64)
    half_s = 0.5 * photons.depth_spread_s
    light = np.stack([photons.photons, photons.delay_s - half_s, photons.delay_s + half_s])
    alone = np.zeros((1, 2), np.int64), np.ones(1)
    pixel, number, light = _merge_light(photons.pixel, number, light, photons.shape, alone, 0.0, math.inf)
    offset, factor = list_neighbours(crosstalk)
    several = np.concatenate([alone[0], offset]), np.concatenate([alone[1], factor])
    pixel, number, light = _merge_light(pixel, number, light, photons.shape, several, least_photons, most_photons)
    n, (total, from_s, to_s) = len(pixel), light
    return replace(
        photons,
        pixel=pixel,
        delay_s=0.5 * (from_s + to_s),
        photons=total,
        depth_spread_s=to_s - from_s,
        coherence_cells=np.full(n, _NO_CELLS),
        hit=np.full(n, -1),
        cluster=np.arange(n),
        cluster_pixel=pixel,
        epoch=None if photons.epoch is None else np.zeros(n, photons.epoch.dtype),
    )


def _merge_light(
    pixel: np.ndarray,
    number: np.ndarray,
    light: np.ndarray,
    shape: tuple[int, int],
    neighbours: tuple[np.ndarray, np.ndarray],
    least_photons: float,
    most_photons: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the light of each pixel and bin with what neighbours add: pixel, bin, and (3, place) as of `merge_bins`."""
    first = np.searchsorted(pixel, np.arange(shape[0] * shape[1] + 1))
    n_bins, room = int(number.max()) + 1, 4 * len(pixel) + 1024
    while True:
        at, of, merged = np.empty(room, np.int64), np.empty(room, np.int64), np.empty((3, room))
        needed = merge_bins(
            packed(first, np.int64),
            packed(number, np.int64),
            packed(light, np.float64),
            *shape,
            packed(neighbours[0], np.int64),
            packed(neighbours[1], np.float64),
            float(least_photons),
            float(most_photons),
            n_bins,
            at,
            of,
            merged,
        )
        if needed <= room:
            return at[:needed], of[:needed], merged[:, :needed]
        room = needed


@kernel
def merge_bins(
    first: np.ndarray,
    number: np.ndarray,
    light: np.ndarray,
    n_rows: int,
    n_cols: int,
    offset: np.ndarray,
    factor: np.ndarray,
    least_photons: float,
    most_photons: float,
    n_bins: int,
    at: np.ndarray,
    of: np.ndarray,
    merged: np.ndarray,
) -> int:
    """Return how many pairs of pixel and bin hold light; write as many as there is room for.

    Parameters
    ----------
    first : (pixel + 1) first return of each pixel
    number : (return) bin
    light : (3, return) photons, and begin and end of the return [s]
    n_rows, n_cols : pixels of the array
    offset, factor : (neighbour, row_col) and (neighbour); the first is the pixel itself
    least_photons : what a bin without light of its own must exceed
    most_photons : of a neighbour in a bin
    at, of : (place) pixel and bin, written
    merged : (3, place) photons, begin and end [s], written
    """
    total, from_s, to_s = np.zeros(n_bins), np.empty(n_bins), np.empty(n_bins)
    is_own, is_met, touched = np.zeros(n_bins, np.bool_), np.zeros(n_bins, np.bool_), np.empty(n_bins, np.int64)
    count = 0
    for pixel in range(n_rows * n_cols):
        n_touched = 0
        for j in range(len(factor)):
            row, col = pixel // n_cols + offset[j, 0], pixel % n_cols + offset[j, 1]
            if row < 0 or row >= n_rows or col < 0 or col >= n_cols:
                continue
            source = row * n_cols + col
            for k in range(first[source], first[source + 1]):
                if not light[0, k] > 0.0:
                    continue
                b = number[k]
                if not is_met[b]:
                    place = n_touched  # kept in order of time
                    while place > 0 and touched[place - 1] > b:
                        touched[place] = touched[place - 1]
                        place -= 1
                    touched[place] = b
                    n_touched += 1
                    from_s[b], to_s[b], is_own[b], is_met[b] = light[1, k], light[2, k], False, True
                total[b] += factor[j] * (light[0, k] if j == 0 else min(light[0, k], most_photons))
                from_s[b], to_s[b] = min(from_s[b], light[1, k]), max(to_s[b], light[2, k])
                is_own[b] = is_own[b] or j == 0
        for k in range(n_touched):
            b = touched[k]
            if is_own[b] or total[b] > least_photons:
                if count < len(at):
                    at[count], of[count] = pixel, b
                    merged[0, count], merged[1, count], merged[2, count] = total[b], from_s[b], to_s[b]
                count += 1
            total[b], is_met[b] = 0.0, False
    return count

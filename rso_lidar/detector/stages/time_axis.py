"""Expected photons on an axis of time: returns of a pixel add before anything detects them.

Time runs in steps, a whole number of them to a sample. Work is done only where light comes: each pixel has one row, or
several where its returns lie far apart, of equal length, long enough that a pulse which latches in the watched part of
the row finds all its samples there.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from rso_lidar.arithmetic import compiled, packed
from rso_lidar.records import Photons

_AT_ONCE = 32_768  # returns, so that what is worked on stays in the cache
_LONGEST = 4.0  # pulses: of a return that is deeper, so much about its middle is watched on either side
_WIDEST = 1.5  # steps: a return of a deeper facet is cut into several ...
MOST_PIECES = 4096  # ... and at most so many


@dataclass(frozen=True)
class Plan:
    """How rows are laid out, in steps: the pulse's rise and fall about a delay, what is stored before and after a latch."""

    step_s: float
    steps_per_sample: int
    rise: int  # before its delay a return can latch so early
    fall: int  # and after it so late
    before: int  # stored before a latch, and what the filter remembers
    after: int  # stored after it
    room: int  # at the end, where a return would reach around to the front

    @property
    def watched(self) -> int:
        """Return how many steps of a row the comparator watches."""
        return self.rise + self.fall + self.steps_per_sample

    @property
    def length(self) -> int:
        """Return the steps of a row, a length that transforms well."""
        from scipy.fft import next_fast_len

        return int(next_fast_len(self.before + self.watched + self.after, real=True))


@dataclass(frozen=True, eq=False)
class Rows:
    """Stretches of time of pixels: row r begins at step `start` of the axis that counts from emission.

    Rows are ordered by pixel and, in a pixel, by time; the comparator watches steps `first` to `last` of a row. A row that
    goes on where the one before ends begins with the last step that was watched there: what is between two steps counts.
    """

    pixel: np.ndarray
    start: np.ndarray
    first: np.ndarray
    last: np.ndarray
    length: int
    room: int = 0  # steps at the end where no return may begin: the transform would wrap its tail to the front


def rows_about(
    photons: Photons, plan: Plan, n_pixels: int, least_photons: float = 0.0, sure_photons: float = math.inf
) -> Rows:
    """Return the rows that hold every return: the first begins at a pixel's first return, the next where it ends.

    Pixels that get no more than `least_photons` have none; after a row that gets more than `sure_photons` early enough, a
    pixel has no other, for it will have latched.
    """
    if compiled():
        return _rows_by_loops(photons, plan, least_photons, sure_photons)
    half_s = np.minimum(0.5 * photons.depth_spread_s, _LONGEST * photons.pulse_fwhm_s)
    enough = np.bincount(photons.pixel, photons.photons, n_pixels) > least_photons
    left = np.flatnonzero((photons.photons > 0.0) & enough[photons.pixel])
    if not len(left):
        none = np.zeros(0, np.int64)
        return Rows(none, none, none, none, plan.length, plan.room)
    pixel = photons.pixel[left]
    delay_s, half_s, light = photons.delay_s[left] + photons.late_s, half_s[left], photons.photons[left]
    from_s, to_s = delay_s - half_s - plan.rise * plan.step_s, delay_s + half_s + plan.fall * plan.step_s
    pixels, starts, firsts = [], [], []
    covered_s = np.full(n_pixels, -np.inf)
    done = np.zeros(n_pixels, bool)
    while len(pixel):
        group = np.flatnonzero(np.diff(pixel, prepend=-1))
        made = pixel[group]
        lit_s = np.minimum.reduceat(from_s, group)
        goes_on = lit_s <= covered_s[made]
        begin = np.floor(np.maximum(lit_s, covered_s[made]) / plan.step_s + 1e-9).astype(np.int64)
        # Rows begin on a sample, so that samples fall on steps.
        watched = begin // plan.steps_per_sample * plan.steps_per_sample
        pixels.append(made)
        starts.append(watched - plan.before)
        firsts.append(begin - watched + plan.before - goes_on)
        covered_s[made] = (watched + plan.watched) * plan.step_s
        later = to_s > covered_s[pixel]
        done[made] = np.add.reduceat(np.where(later, 0.0, light), group) > sure_photons
        later &= ~done[pixel]
        if not later.any():
            break
        pixel, from_s, to_s, light = pixel[later], from_s[later], to_s[later], light[later]
    pixel, start, first = (np.concatenate(column) for column in (pixels, starts, firsts))
    order = np.lexsort((start, pixel))
    last = np.full(len(pixel), plan.before + plan.watched)
    return Rows(pixel[order].astype(np.int64), start[order], first[order], last, plan.length, plan.room)


def _rows_by_loops(photons: Photons, plan: Plan, least_photons: float, sure_photons: float) -> Rows:
    from rso_lidar.detector.waveform_loops import rows_of

    longest_s, step_s = _LONGEST * float(photons.pulse_fwhm_s), plan.step_s
    # No return reaches into more rows than this: each but the first and last is as long as what is watched.
    most = math.ceil(2.0 * longest_s / (plan.watched * step_s)) + 3
    made = np.empty((3, most * len(photons.pixel)), np.int64)
    n_rows = rows_of(
        packed(photons.pixel),
        packed(photons.delay_s),
        packed(photons.photons),
        packed(photons.depth_spread_s),
        (float(photons.late_s), longest_s, plan.rise * step_s, plan.fall * step_s, step_s),
        (plan.steps_per_sample, plan.before, plan.watched),
        (float(least_photons), float(sure_photons)),
        made,
    )
    assert n_rows >= 0, "rows: more than there is room for"
    pixel, start, first = made[:, :n_rows].copy()
    return Rows(pixel, start, first, np.full(n_rows, plan.before + plan.watched), plan.length, plan.room)


def expected(photons: Photons, rows: Rows, step_s: float, factors: np.ndarray | None = None) -> np.ndarray:
    """Return the expected photons (row, step), float32, as if each return were a flash of no length at its delay.

    `factors` (return) multiply the photons. The pulse is laid over it by a filter, for all rows at once.
    """
    weight = photons.photons if factors is None else photons.photons * factors
    if compiled():
        return _light_by_loops(photons, weight, rows, step_s)
    centre = (photons.delay_s + photons.late_s) / step_s
    spread = photons.depth_spread_s / step_s
    pixel = photons.pixel
    deep = np.flatnonzero(spread > _WIDEST)
    if len(deep):
        weight, centre, spread, pixel = _cut(weight, centre, spread, pixel, deep)
    n_pixels = photons.shape[0] * photons.shape[1]
    count = np.bincount(rows.pixel, minlength=n_pixels)
    first = np.cumsum(count) - count
    grid = np.zeros(len(rows.pixel) * rows.length, np.float32)
    for piece in range(0, len(pixel), _AT_ONCE):
        part = slice(piece, piece + _AT_ONCE)
        some = pixel[part]
        for k in range(int(count[some].max())):
            of = part if k == 0 and count[some].all() else piece + np.flatnonzero(count[pixel[part]] > k)
            row = first[pixel[of]] + k
            _share(grid, weight[of], centre[of] - rows.start[row], spread[of], row * rows.length, rows)
    return grid.reshape(-1, rows.length)


def _light_by_loops(photons: Photons, weight: np.ndarray, rows: Rows, step_s: float) -> np.ndarray:
    from rso_lidar.detector.waveform_loops import shared

    grid = np.zeros((len(rows.pixel), rows.length), np.float32)
    last = rows.length - 3 - rows.room
    shared(
        packed(photons.pixel),
        packed(photons.delay_s),
        packed(weight),
        packed(photons.depth_spread_s),
        float(photons.late_s),
        step_s,
        _WIDEST,
        rows.pixel,
        rows.start,
        last,
        grid,
    )
    return grid


def _cut(
    weight: np.ndarray, centre: np.ndarray, spread: np.ndarray, pixel: np.ndarray, deep: np.ndarray
) -> tuple[np.ndarray, ...]:
    """Return the returns with those that are deeper than a few steps cut into equal pieces, put at the end."""
    pieces = np.minimum(np.ceil(spread[deep] / _WIDEST), MOST_PIECES).astype(np.int64)
    of = np.repeat(deep, pieces)
    number = np.arange(len(of)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    pieces = np.repeat(pieces, pieces)
    piece = spread[of] / pieces
    whole = weight.copy()
    whole[deep] = 0.0
    return (
        np.concatenate([whole, weight[of] / pieces]),
        np.concatenate([centre, centre[of] + (number - 0.5 * (pieces - 1)) * piece]),
        np.concatenate([spread, piece]),
        np.concatenate([pixel, pixel[of]]),
    )


def _sixths(x1: np.ndarray, x2: np.ndarray, x3: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return six times the shares of steps -1, 0, 1 and 2 in a return at x, from the means of x, x² and x³.

    Cubic interpolation's weights: sum, mean, variance and third moment are exact, and the error left is of fourth order,
    2e-4 of the peak for a step of a quarter of the pulse's sigma.
    """
    return 3.0 * x2 - x3 - 2.0 * x1, 3.0 * (x3 - 2.0 * x2 - x1) + 6.0, 3.0 * (x2 - x3) + 6.0 * x1, x3 - x1


def _share(
    grid: np.ndarray, weight: np.ndarray, at: np.ndarray, spread: np.ndarray, offset: np.ndarray, rows: Rows
) -> None:
    """Add returns at steps `at` of their rows to the grid: cubic interpolation's weights, averaged over their depth."""
    below = np.floor(at)
    inside = (below >= 1.0) & (below < rows.length - 2 - rows.room)
    if not inside.all():
        weight, below, at = (
            np.where(inside, value, other) for value, other in ((weight, 0.0), (below, 1.0), (at, 1.0))
        )
    x1 = at - below
    variance = spread * spread * (1.0 / 12.0)
    x2 = x1 * x1 + variance
    x3 = x1 * (x2 + 2.0 * variance)
    index = offset + below.astype(np.int64)
    run = np.flatnonzero(np.diff(index, prepend=-1))  # neighbours in a pixel often share their steps
    if not len(run):
        return
    cell = index[run]
    sixth = weight * (1.0 / 6.0)
    for step, share in enumerate(_sixths(x1, x2, x3), -1):
        np.add.at(grid, cell + step, np.add.reduceat(sixth * share, run).astype(np.float32))


@lru_cache(maxsize=16)
def sharing_response(n: int) -> np.ndarray:
    """Return what sharing returns among steps does to each frequency of a transform of `n` steps, over all places.

    Dividing by it leaves only what differs from place to place within a step. It is cut where it is far from 1, beyond
    what a pulse holds.
    """
    cycles = np.fft.rfftfreq(n)[:, None]
    place = (np.arange(32) + 0.5) / 32.0
    weights = np.stack(_sixths(place, place**2, place**3)) / 6.0
    turned = [w * np.exp(-2j * math.pi * cycles * (k - 1 - place)) for k, w in enumerate(weights)]
    response: np.ndarray = np.maximum(np.sum(turned, axis=0).mean(axis=1).real, 0.5)
    return response


def pulse_transfer(pulse_step_s: float, power_per_s: np.ndarray, n: int, step_s: float) -> np.ndarray:
    """Return what lays a laser's pulse over `n` steps of `expected` light, complex factors of its transform."""
    time_s = (np.arange(len(power_per_s)) - (len(power_per_s) - 1) / 2.0) * pulse_step_s
    frequency_hz = np.fft.rfftfreq(n, step_s)
    turn = np.exp(-2j * math.pi * np.multiply.outer(frequency_hz, time_s))
    transfer: np.ndarray = (turn * (power_per_s * pulse_step_s)).sum(axis=1) / sharing_response(n)
    transfer[frequency_hz > 0.5 / pulse_step_s] = 0.0  # finer than the taps nothing is known of the pulse
    return transfer


class Laying(NamedTuple):
    """Two filters, on the circle of a row: factors of its transform, and responses of its steps, twice around."""

    pulse: np.ndarray  # light to primaries
    amplified: np.ndarray  # light to amplitude
    pulse_response: np.ndarray
    amplified_response: np.ndarray

    @staticmethod
    def of(pulse: np.ndarray, amplified: np.ndarray, n: int) -> "Laying":
        """Return the filters of so many steps with these factors."""
        from scipy.fft import irfft

        responses = (np.tile(irfft(factors, n), 2).astype(np.float32) for factors in (pulse, amplified))
        return Laying(pulse.astype(np.complex64), amplified.astype(np.complex64), *responses)


def laid(light: np.ndarray, laying: Laying, least_primaries: np.float32) -> tuple[np.ndarray, np.ndarray]:
    """Return expected primaries and amplitude (row, step): light behind two filters; fewer primaries count as none.

    The transform costs the same whatever is lit. Little of a row is: the loop lays a response over each lit step.
    """
    if compiled():
        from rso_lidar.detector.waveform_loops import laid as laid_by_loops

        primaries, amplitude = np.empty(light.shape, np.float32), np.empty(light.shape, np.float32)
        laid_by_loops(light, laying.pulse_response, laying.amplified_response, least_primaries, primaries, amplitude)
        return primaries, amplitude
    from scipy.fft import irfft, rfft

    spectrum, n = rfft(light, axis=1), light.shape[1]
    primaries, amplitude = (irfft(spectrum * factors, n, axis=1) for factors in (laying.pulse, laying.amplified))
    primaries *= primaries >= least_primaries
    return primaries, amplitude

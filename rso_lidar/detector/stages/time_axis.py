"""The axis of time: steps, a whole number of them to a sample, and the rows of steps in which light comes.

Work is done only where light comes. Each pixel has one row, or several where its returns are far apart. All rows have one
length: a pulse that latches in the watched part of a row finds all its samples there.
"""

import math
from dataclasses import dataclass

import numpy as np

from rso_lidar import units
from rso_lidar.detector.settings.amplifier import Amplifier
from rso_lidar.detector.settings.gate import Gate
from rso_lidar.detector.settings.readout import Readout
from rso_lidar.kernels import kernel, packed
from rso_lidar.records import Photons

_LONGEST = 4.0  # pulses: of a return that is deeper, so much about its middle is watched on either side


@dataclass(frozen=True)
class SamplingPlan:
    """Layout of rows, in steps: rise and fall of the pulse about a delay, and what is stored before and after a latch."""

    step_s: float
    steps_per_sample: int
    rise: int  # before its delay a return can latch so early
    fall: int  # and after it so late
    before: int  # stored before a latch, and what the filter remembers
    after: int  # stored after it
    room: int  # at the end, where a return would reach around to the front

    @property
    def watched(self) -> int:
        """How many steps of a row the comparator watches."""
        return self.rise + self.fall + self.steps_per_sample

    @property
    def length(self) -> int:
        """Steps of a row, a length that transforms well."""
        from scipy.fft import next_fast_len

        return int(next_fast_len(self.before + self.watched + self.after, real=True))


@dataclass(frozen=True, eq=False)
class Rows:
    """Stretches of time of pixels: row r begins at step `start` of the axis that counts from emission.

    Rows are ordered by pixel and, in a pixel, by time; the comparator watches steps `first` to `last` of a row. A row that
    continues the one before it begins with the last step that was watched there, so that no crossing between is lost.
    """

    pixel: np.ndarray
    start: np.ndarray
    first: np.ndarray
    last: np.ndarray
    length: int
    room: int = 0  # steps at the end where no return may begin: the transform would wrap its tail to the front

    def select(self, block: slice) -> "Rows":
        """Return some of the rows."""
        pixel, start = self.pixel[block], self.start[block]
        return Rows(pixel, start, self.first[block], self.last[block], self.length, self.room)


def make_plan(
    readout: Readout,
    amplifier: Amplifier,
    pulse_fwhm_s: float,
    *,
    steps_per_sample: int = 2,
    earliest_s: float = 0.0,
) -> SamplingPlan:
    """Return the layout of the axis of time.

    Parameters
    ----------
    steps_per_sample : least number of steps between samples
    earliest_s : how long before its delay a return can latch [s], where that is longer than for moderate light
    """
    sample_s, pole_s = readout.sample_s, amplifier.pole_s
    # With 6.5 steps to a pulse, detection moves by less than 0.1 % from there to three times as many.
    per_sample = max(steps_per_sample, math.ceil(6.5 * sample_s / pulse_fwhm_s))
    step_s = sample_s / per_sample
    # Together with `room`, 1.5 FWHM from the last return around to the first sample: 0.2 % of a Gaussian's peak is left.
    # 110 times the threshold latches so early. Brighter light latches before the watched steps.
    rise = math.ceil(1.3 * pulse_fwhm_s / step_s)
    memory_s = max(6.0 * pole_s, 0.85 * pulse_fwhm_s, earliest_s - rise * step_s)
    return SamplingPlan(
        step_s=step_s,
        steps_per_sample=per_sample,
        rise=rise,
        fall=math.ceil((0.5 * pulse_fwhm_s + 2.0 * pole_s) / step_s),
        before=readout.pretrigger_samples * per_sample + math.ceil(memory_s / sample_s) * per_sample,
        after=(readout.samples - readout.pretrigger_samples) * per_sample,
        room=math.ceil(0.65 * pulse_fwhm_s / step_s),
    )


def place_rows(
    photons: Photons, plan: SamplingPlan, least_photons: float = 0.0, sure_photons: float = math.inf
) -> Rows:
    """Place rows that hold every return: the first begins at a pixel's first return, the next where it ends.

    Parameters
    ----------
    least_photons : pixels that get no more than this have no rows
    sure_photons : after a row that gets more than this early enough, a pixel has no other, for it will have latched
    """
    longest_s, step_s = _LONGEST * float(photons.pulse_fwhm_s), plan.step_s
    # No return reaches into more rows than this: each except the first and last is as long as the watched part.
    most = math.ceil(2.0 * longest_s / (plan.watched * step_s)) + 3
    table = np.empty((3, most * len(photons.pixel)), np.int64)
    n_rows = find_rows(
        packed(photons.pixel),
        packed(photons.delay_s),
        packed(photons.photons),
        packed(photons.depth_spread_s),
        (float(photons.late_s), longest_s, plan.rise * step_s, plan.fall * step_s, step_s),
        (plan.steps_per_sample, plan.before, plan.watched),
        (float(least_photons), float(sure_photons)),
        table,
    )
    assert n_rows >= 0, "rows: more than fit into the array"
    pixel, start, first = table[:, :n_rows].copy()
    return Rows(pixel, start, first, np.full(n_rows, plan.before + plan.watched), plan.length, plan.room)


@kernel
def find_rows(
    pixel: np.ndarray,
    delay_s: np.ndarray,
    photons: np.ndarray,
    depth_spread_s: np.ndarray,
    timing_s: tuple[float, float, float, float, float],
    steps: tuple[int, int, int],
    enough: tuple[float, float],
    table: np.ndarray,
) -> int:
    """Return how many rows there are, written to pixel, start and first of `table` (3, row); -1 where they do not fit.

    Parameters
    ----------
    enough : least photons of a pixel that has rows; photons of a row after which a pixel has no other
    pixel, delay_s, photons, depth_spread_s : (return) pixel, delay [s], expected photons, and time over which the
        surface stretches it [s]
    table : (3, row) i8: pixel, start and first of each row, written
    """
    late_s, longest_s, rise_s, fall_s, step_s = timing_s
    per_sample, before, watched_steps = steps
    least_photons, sure_photons = enough
    n_rows, first, n = 0, 0, len(pixel)
    while first < n:
        end, total = first, 0.0
        while end < n and pixel[end] == pixel[first]:
            total += photons[end]
            end += 1
        covered_s = -math.inf
        more = total > least_photons
        while more:
            begin_s = math.inf
            for k in range(first, end):
                half_s = min(0.5 * depth_spread_s[k], longest_s)
                at_s = delay_s[k] + late_s
                if photons[k] > 0.0 and at_s + half_s + fall_s > covered_s:
                    begin_s = min(begin_s, at_s - half_s - rise_s)
            if begin_s == math.inf:
                break
            if n_rows == table.shape[1]:
                return -1
            begin = math.floor(max(begin_s, covered_s) / step_s + 1e-9)
            watched = begin // per_sample * per_sample  # rows begin on a sample, so that samples fall on steps
            table[0, n_rows], table[1, n_rows], table[2, n_rows] = (
                pixel[first],
                watched - before,
                begin - watched + before,
            )
            if begin_s <= covered_s:  # continues from the last step that was watched
                table[2, n_rows] -= 1
            n_rows += 1
            ends_s = (watched + watched_steps) * step_s
            more, light = False, 0.0
            for k in range(first, end):
                to_s = delay_s[k] + late_s + min(0.5 * depth_spread_s[k], longest_s) + fall_s
                if photons[k] > 0.0 and to_s > ends_s:
                    more = True
                elif photons[k] > 0.0 and to_s > covered_s:
                    light += photons[k]
            more = more and light <= sure_photons
            covered_s = ends_s
        first = end
    return n_rows


def place_gate_rows(gate: Gate, readout: Readout, plan: SamplingPlan, n_pixels: int) -> tuple[Rows, int]:
    """Place one row for each pixel over the gate; also return the number of the gate's first sample since emission."""
    from scipy.fft import next_fast_len

    sample = int(np.ceil(gate.delay_ns * units.NS / readout.sample_s - 1e-6))
    stored = gate.n_samples(readout.sample_s) * plan.steps_per_sample
    # The transform wraps around: as much room after the gate as the filter remembers, and half a pulse on both sides.
    length = int(next_fast_len(plan.before + stored + plan.rise, real=True))
    pixel = np.arange(n_pixels)
    start = np.full(n_pixels, sample * plan.steps_per_sample - plan.before)
    nothing = np.zeros(n_pixels, np.int64)
    return Rows(pixel, start, nothing, nothing, length), sample

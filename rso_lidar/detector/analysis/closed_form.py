"""Closed forms of the full chain: probability of detection, range precision, SNR, saturation.

A return of N photons is QE N primaries. Each is an avalanche of mean M and excess noise F through the amplifier's h(t).
Campbell's theorem gives mean, covariance and third cumulant of the amplitude. The noise of the amplifier and of the dark
current adds to them. The comparator misses the return where the amplitude stays below its threshold all along the pulse.
That is the integral of a Gaussian over an orthant (Genz 1992), at instants a sixth of the amplifier's pole apart.

Four things are approximate:

- the normal law, bent at each instant to the third cumulant (a gamma law);
- a long stretched pulse, whose instants are farther apart;
- a gate, where noise beside a weak pulse may be found;
- precision where few returns pass the threshold, which selects those that noise has raised.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from rso_lidar import units
from rso_lidar.detector.ranging.gate_threshold import GateThresholds
from rso_lidar.detector.ranging.matched_filter import Matched
from rso_lidar.detector.ranging.pulse import LaserPulse, Pulse
from rso_lidar.detector.settings.apd import cumulants
from rso_lidar.detector.settings.gsfl import Gsfl
from rso_lidar.errors import ScenarioError

_Kernel = Callable[[np.ndarray], np.ndarray]

_FINE = 12  # steps of time to a pole of the amplifier
_MOST_STEPS = 2000
_MOST_INSTANTS = 96  # at which the comparator is looked at
_POINTS = 4096  # of the lattice over the orthant
_AT_ONCE = 16  # numbers of photons taken together
_LEAST = 0.6  # of the pulse's peak: a lower part does not trigger
_REACH_FWHM = 1.5  # samples to each side of the peak that the matched filter takes
_PHASES = 8  # of the clock, over which precision is averaged
_FASTEST = 200.0  # of an amplifier's pole in a pulse's length
_STRETCHES = 32  # depths computed within a pulse's length and for each factor of two beyond; linear between them


@dataclass(frozen=True, eq=False)
class Prediction:
    """What is expected of a detector for some returns; arrays (return).

    Parameters
    ----------
    probability : of detection, given that the return is in reach and no false alarm comes before it
    range_precision_m : standard deviation of the range [m]
    snr : signal over noise, as amplitudes
    saturated : whether the intensity is clipped, bool
    """

    probability: np.ndarray
    range_precision_m: np.ndarray
    snr: np.ndarray
    saturated: np.ndarray


def predict_gsfl(
    gsfl: Gsfl, pulse: LaserPulse, photons: np.ndarray, depth_s: np.ndarray, only_probability: bool = False
) -> Prediction:
    """Return the prediction of the full chain in closed form.

    Parameters
    ----------
    photons : (return) expected photons
    depth_s : (return) time over which the surface stretches each return [s]

    Raises
    ------
    ScenarioError
        If the amplifier is too fast for the closed form of the pulse.
    """
    if gsfl.amplifier.pole_s * _FASTEST < pulse.fwhm_s:
        raise ScenarioError(
            f"amplifier.bandwidth_mhz: {gsfl.amplifier.bandwidth_mhz:g}: is too fast for the closed form of a pulse of "
            f"{pulse.fwhm_s / units.NS:.3g} ns; narrow it, or simulate"
        )
    probability, precision_m, snr, peak_electrons = (np.zeros(photons.shape) for _ in range(4))
    number = _depth_number(depth_s / pulse.fwhm_s)
    steady = pulse._replace(timing_jitter_ns=0.0)
    for k in np.unique([np.floor(number), np.ceil(number)]):
        of = np.abs(number - k) < 1.0
        weight = 1.0 - np.abs(number[of] - k)
        stretch_s = pulse.fwhm_s * _depth_of(k)
        seen = _compute_response(gsfl, steady, stretch_s)
        probability[of] += weight * seen.probability(photons[of])
        if not only_probability:
            widest_m = (stretch_s + pulse.fwhm_s) / math.sqrt(12.0) * units.RANGE_PER_DELAY_M_S
            known_m = np.minimum(seen.precision_m(photons[of]), widest_m)  # a report is from within the pulse
            precision_m[of] += weight * known_m
            snr[of] += weight * seen.snr(photons[of])
            peak_electrons[of] += weight * seen.primaries(photons[of]) * seen.mean.max()
    jitter_ns = math.hypot(gsfl.timing.pixel_jitter_ns, gsfl.timing.frame_jitter_ns, pulse.timing_jitter_ns)
    saturated = peak_electrons >= gsfl.clip_electrons
    jitter_ns /= math.sqrt(gsfl.gate.pulses if gsfl.gate else 1)  # each pulse of a frame has its own
    return Prediction(probability, np.hypot(precision_m, jitter_ns * _RANGE_PER_NS), snr, saturated)


_RANGE_PER_NS = units.NS * units.RANGE_PER_DELAY_M_S


def _depth_number(depth: np.ndarray) -> np.ndarray:
    """Return the fractional index of depths (return) [pulse lengths] among the computed: equal steps, then equal ratios."""
    number: np.ndarray = _STRETCHES * np.where(depth < 1.0, depth, 1.0 + np.log2(np.maximum(depth, 1.0)))
    return number


def _depth_of(number: float) -> float:
    """Return the depth [pulse lengths] at an index."""
    return float(number / _STRETCHES if number <= _STRETCHES else 2.0 ** (number / _STRETCHES - 1.0))


@dataclass(frozen=True, eq=False)
class _Response:
    """A pulse behind the amplifier: what one primary adds at instants about the peak, and how precise a fit is.

    `mean` (instant) [electrons], `shot` (instant, instant) and `third` (instant) are cumulants of one primary, `still` is
    the covariance in the dark. `place_s2` is the variance of a fitted place: of dark noise times primaries², and of shot
    noise times primaries. `fitted` is the height fitted to one primary, its variance in the dark, and for each primary;
    `threshold_electrons` is a gate's, on that height.
    """

    gsfl: Gsfl
    mean: np.ndarray
    shot: np.ndarray
    third: np.ndarray
    still: np.ndarray
    place_s2: tuple[float, float]
    fitted: tuple[float, float, float]
    threshold_electrons: float

    def primaries(self, photons: np.ndarray) -> np.ndarray:
        return self.gsfl.quantum_efficiency * photons

    def precision_m(self, photons: np.ndarray) -> np.ndarray:
        n = np.maximum(self.primaries(photons), 1e-9)
        pulses = self.gsfl.gate.pulses if self.gsfl.gate else 1
        variance = (self.place_s2[0] / n**2 + self.place_s2[1] / n) / pulses
        precision: np.ndarray = np.sqrt(variance) * units.RANGE_PER_DELAY_M_S
        return precision

    def snr(self, photons: np.ndarray) -> np.ndarray:
        n = self.primaries(photons)
        if self.gsfl.gate is not None:
            height, dark, shot = self.fitted
            return np.asarray(height * n / np.sqrt(np.maximum(dark + shot * n, 1e-30)))
        top = int(self.mean.argmax())
        noise = np.sqrt(np.maximum(self.still[top, top] + n * self.shot[top, top], 1e-30))
        return np.asarray(n * self.mean[top] / noise)

    def probability(self, photons: np.ndarray) -> np.ndarray:
        n = self.primaries(photons)
        if self.gsfl.gate is not None:
            return self._in_gate(n)
        threshold = self.gsfl.trigger.threshold_electrons
        spread = (self.gsfl.trigger.threshold_spread_fraction * threshold) ** 2
        result = np.zeros(n.shape)
        sure = 1.5 * (1.0 + 5.0 * self.gsfl.trigger.threshold_spread_fraction) * threshold
        result[n * self.mean.max() > max(sure, threshold + 12.0 * math.sqrt(self.still[0, 0]))] = 1.0
        near = np.flatnonzero((n > 0.0) & (result < 1.0))
        for start in range(0, len(near), _AT_ONCE):
            some = near[start : start + _AT_ONCE]
            k = n[some][:, None]
            covariance = self.still + k[:, :, None] * self.shot + spread
            sigma = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
            z = _as_normal((threshold - k * self.mean) / sigma, k * self.third / sigma**3)
            result[some] = 1.0 - _integrate_orthant(covariance / sigma[:, :, None] / sigma[:, None, :], z)
        return np.clip(result, 0.0, 1.0)

    def _in_gate(self, n: np.ndarray) -> np.ndarray:
        """Return the probability that the fitted height passes the gate's threshold.

        Place and height are fitted together: the height is that of two normal components, one along the pulse and one
        along its slope, of which the second is noise alone. Its square is a noncentral chi-square of two degrees.
        """
        from scipy.special import chndtr

        height, dark, shot = self.fitted
        variance = np.maximum(dark + shot * n, 1e-30)
        below = chndtr(self.threshold_electrons**2 / variance, 2.0, (height * n) ** 2 / variance)
        probability: np.ndarray = np.where(n > 0.0, 1.0 - below, 0.0)
        return probability


@dataclass(frozen=True, eq=False)
class _AssumedPulse:
    """The pulse behind the amplifier as the matched filter assumes it, and a gate's threshold [electrons] on its height."""

    pulse: Pulse
    matched: Matched
    gate_electrons: float


@lru_cache(maxsize=64)
def _assume_pulse(gsfl: Gsfl, pulse: LaserPulse) -> _AssumedPulse:
    """Tabulate what a detector takes each return for, kept for its stretches."""
    readout, amplifier = gsfl.readout, gsfl.amplifier
    shape = Pulse.after(pulse.step_s, pulse.power_per_s, amplifier.pole_s, amplifier.integration_s)
    matched = Matched.of(shape, readout.sample_s, amplifier.pole_s, gsfl.noise_counts)
    gate_electrons = math.nan
    if gsfl.gate is not None:
        thresholds = GateThresholds(gsfl.gate, gsfl.apd, amplifier, readout, matched)
        gate_electrons = thresholds.at_rate(gsfl.apd.dark_electrons_per_s) * readout.electrons_per_count
    return _AssumedPulse(shape, matched, gate_electrons)


@lru_cache(maxsize=1024)
def _compute_response(gsfl: Gsfl, pulse: LaserPulse, stretch_s: float) -> _Response:
    """Return the response of the amplifier to a pulse that a surface stretches evenly."""
    pole_s, width_s = gsfl.amplifier.pole_s, gsfl.amplifier.integration_s
    step_s, taps, assumed = pulse.step_s, pulse.power_per_s, _assume_pulse(gsfl, pulse)
    energy = np.cumsum(taps) * step_s
    tap_s = (np.arange(len(taps)) - len(taps) // 2) * step_s
    from_s, to_s = np.interp([1e-6, 1.0 - 1e-6], energy, tap_s) + np.array([-0.5, 0.5]) * stretch_s
    fine_s = max(min(pole_s / _FINE, 4.0 * step_s), (to_s - from_s + 16.0 * pole_s) / _MOST_STEPS)
    time_s = np.arange(from_s - fine_s, to_s + 8.0 * pole_s, fine_s)
    # The mean of the pulse over each step, by its energy up to the step's ends, over the surface's depth.
    ends = np.append(time_s - 0.5 * fine_s, time_s[-1] + 0.5 * fine_s)
    blur_s = stretch_s * ((np.arange(64) + 0.5) / 64.0 - 0.5) if stretch_s > 0.0 else np.zeros(1)
    light = np.diff(np.interp(ends[:, None] - blur_s, tap_s + 0.5 * step_s, energy, left=0.0).mean(axis=1))

    gain, square, cube = cumulants(gsfl.apd)

    def respond(at_s: np.ndarray) -> np.ndarray:
        """Return what charge in each step adds at instants (step, instant)."""
        x = np.maximum(at_s - time_s[:, None], 0.0) / pole_s
        added: np.ndarray = width_s / pole_s * x * np.exp(-x)
        return added

    def dark(at_s: np.ndarray) -> np.ndarray:
        lag = np.abs(np.subtract.outer(at_s, at_s)) / pole_s
        covariance: np.ndarray = gsfl.noise_electrons**2 * (1.0 + lag) * np.exp(-lag)
        return covariance

    curve = np.einsum("t,ti->i", light, respond(time_s))
    high = time_s[curve > _LEAST * curve.max()]
    peak_s = float(time_s[curve.argmax()])
    apart_s = max(pole_s / 6.0, (high[-1] - high[0]) / _MOST_INSTANTS)
    before, after = int((peak_s - high[0]) / apart_s), int((high[-1] - peak_s) / apart_s)
    at_s = peak_s + apart_s * np.arange(-before, after + 1)
    at_s = at_s[np.argsort(np.abs(at_s - peak_s), kind="stable")]  # the deciding instants come first
    added = respond(at_s)
    place_s2, fitted = _fit(gsfl, assumed, light, respond, dark, 0.5 * fine_s)
    return _Response(
        gsfl,
        gain * np.einsum("t,ti->i", light, added),
        square * np.einsum("ti,tj->ij", light[:, None] * added, added),
        (cube if gsfl.apd.statistics != "gaussian" else 0.0) * np.einsum("t,ti->i", light, added**3),
        dark(at_s),
        place_s2,
        fitted,
        assumed.gate_electrons,
    )


def _fit(
    gsfl: Gsfl, assumed: _AssumedPulse, light: np.ndarray, respond: _Kernel, dark: _Kernel, beside_s: float
) -> tuple[tuple[float, float], tuple[float, float, float]]:
    """Return `place_s2` and `fitted` of a response.

    The matched filter assumes the pulse as it left, and noise of the amplifier's colour with a little white noise. Its
    error is that of a linear fit with these weights in the true noise, shot noise included (Kay 1993, sec. 6.5). Slopes
    are differences over half a step of time to each side: then it does not matter how the steps lie.

    Parameters
    ----------
    light : (step) the stretched pulse
    respond, dark : response at some instants to charge in each step, and covariance of the noise in the dark there
    beside_s : half a step of time [s]
    """
    readout, amplifier, pulse = gsfl.readout, gsfl.amplifier, assumed.pulse
    half = max(2, math.ceil(_REACH_FWHM * pulse.fwhm_s / readout.sample_s))
    lag = np.arange(2 * half + 1) - half
    rounding = readout.electrons_per_count**2 / 12.0 if readout.quantised else 0.0
    x = np.abs(np.subtract.outer(lag, lag)) * readout.sample_s / amplifier.pole_s
    believed = (1.0 + x) * np.exp(-x) + max(3e-3, rounding / max(gsfl.noise_electrons, 1e-9) ** 2) * np.eye(len(lag))
    places, heights = [], []
    weights = assumed.matched.height_weights()
    square = cumulants(gsfl.apd)[1]
    for phase in (np.arange(_PHASES) + 0.5) / _PHASES - 0.5:
        at_s = (lag - phase) * readout.sample_s + pulse.peak_s
        jacobian = np.stack([pulse.amplitude(at_s), -pulse.slope(at_s)], axis=1)
        whitened = np.linalg.solve(believed, jacobian)
        by_time = np.linalg.solve(np.einsum("si,sj->ij", jacobian, whitened), whitened.T)[1]
        added = respond(at_s)
        shot = square * np.einsum("ti,tj->ij", light[:, None] * added, added)
        still = dark(at_s) + rounding * np.eye(len(lag))
        slope = np.einsum("t,ts->s", light, respond(at_s + beside_s) - respond(at_s - beside_s)) / (2.0 * beside_s)
        moved = gsfl.apd.gain * float((by_time * -slope).sum())
        places.append(
            [float(np.einsum("i,ij,j", by_time, noise, by_time)) / max(moved**2, 1e-60) for noise in (still, shot)]
        )
        heights.append(
            [
                gsfl.apd.gain * float((weights * np.einsum("t,ts->s", light, added)).sum()),
                *(float(np.einsum("i,ij,j", weights, noise, weights)) for noise in (still, shot)),
            ]
        )
    place, height = np.mean(places, axis=0), np.mean(heights, axis=0)
    pulses = gsfl.gate.pulses if gsfl.gate else 1
    fitted = (float(height[0]), float(height[1]) / pulses, float(height[2]) / pulses)
    return (float(place[0]), float(place[1])), fitted


def _as_normal(z: np.ndarray, skewness: np.ndarray) -> np.ndarray:
    """Return what a normal number passes as rarely as a number of that skewness passes z: by a gamma law (Pearson's III)."""
    from scipy.special import gammainc, gammaincc, ndtri

    g = np.maximum(skewness, 1e-3)
    shape = 4.0 / g**2
    x = np.maximum(shape + 2.0 * z / g, 1e-12)
    above, below = np.maximum(gammaincc(shape, x), 1e-300), np.maximum(gammainc(shape, x), 1e-300)
    normal: np.ndarray = np.where(above < 0.5, -ndtri(above), ndtri(below))
    return normal


def _integrate_orthant(correlation: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Return the probability (row) that normal numbers of these correlations (row, i, i) all stay below z (row, i).

    By Genz (1992): each number, given those before it, is one coordinate of the unit cube. The integral is taken over a
    lattice of Richtmyer's, with the ends of each axis folded together.
    """
    from scipy.special import ndtr, ndtri

    n = z.shape[1]
    root = np.linalg.cholesky(correlation + 1e-9 * np.eye(n))
    points = _lattice(n)
    normal = np.zeros((len(z), n, _POINTS))
    inside = np.ones((len(z), _POINTS))
    for k in range(n):
        given = np.einsum("rj,rjp->rp", root[:, k, :k], normal[:, :k])
        below = ndtr((z[:, k, None] - given) / root[:, k, k, None])
        inside *= below
        if k < n - 1:
            normal[:, k] = ndtri(np.maximum(points[k] * below, 1e-300))
    stayed: np.ndarray = inside.mean(axis=1)
    return stayed


@lru_cache(maxsize=8)
def _lattice(n: int) -> np.ndarray:
    """Return points (axis, point) spread evenly over the unit cube: multiples of the roots of primes, folded."""
    primes = [k for k in range(2, 1000) if all(k % d for d in range(2, math.isqrt(k) + 1))][:n]
    points = np.modf(np.outer(np.sqrt(primes), np.arange(1, _POINTS + 1)))[0]
    folded: np.ndarray = np.clip(np.abs(2.0 * points - 1.0), 0.5 / _POINTS, 1.0 - 0.5 / _POINTS)
    return folded

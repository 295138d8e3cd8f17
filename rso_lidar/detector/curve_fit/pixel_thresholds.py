"""Thresholds of single pixels by the likelihood of their detections and dark counts, and pixels of high dark current."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rso_lidar import units
from rso_lidar.detector.bench.prediction import predict
from rso_lidar.detector.curve_fit.curve_prediction import CurvePredictor, from_link, to_link
from rso_lidar.detector.curve_fit.measured_map import MeasuredMap
from rso_lidar.detector.settings.gsfl import Gsfl
from rso_lidar.detector.stages.false_triggers import rates_per_s
from rso_lidar.errors import ScenarioError

_TRIALS = 65_536  # pixels of the trial that corrects the closed form of a level
_LOG_FACTOR = np.linspace(np.log(0.4), np.log(2.5), 367)  # of thresholds, in steps of half a percent
_LOG_RATIO = np.linspace(np.log(0.33), np.log(3.0), 25)  # of threshold over gain, for which detection is tabulated
_GAIN_SIGMAS = 2.0  # of the gains, between which detection is interpolated by a parabola
_PIXELS_AT_ONCE = 4096
_HOT_BELOW = 1e-6  # probability of as many dark counts, below which a pixel is hot
_HOT_SIGMAS = 5.0  # by which its threshold is taken to be lower than detections tell, ...
_SPREADS = 5.0  # and the most that it is below the others, in spreads of thresholds
_DARK_CURRENTS = np.geomspace(1.0, 1e5, 200)  # over the nominal one, among which that of a hot pixel is found
_LEAST_SPREAD = 0.02  # of thresholds
_SHIFTS = np.linspace(-0.2, 0.2, 41)  # of the logarithm of all thresholds, among which that of a map is found
_ROUNDS = 4  # of thresholds and shifts in turn
_MOVE_SIGMAS = 4.0  # of the gain, up to which it moves
_RARE = 1e-9
_LEAST_BITS = 25.0  # variance of the number of detections in a trial from which its rate corrects the closed form


@dataclass(frozen=True, eq=False)
class PixelThresholds:
    """Thresholds of the pixels; arrays (row, col).

    Parameters
    ----------
    factor : threshold over the nominal one; 1 where it is unknown, as that of a hot pixel
    error : its standard error; NaN where it is unknown
    hot : whether a pixel triggers in the dark far more often than its threshold explains
    dark_current_na : dark current before multiplication [nA]: nominal, but for hot pixels
    dark_current_error_na : its standard error [nA]; NaN where it is nominal
    expected : of each map, the share of detections or the number of dark counts; NaN where the threshold is unknown
    """

    factor: np.ndarray
    error: np.ndarray
    hot: np.ndarray
    dark_current_na: np.ndarray
    dark_current_error_na: np.ndarray
    expected: list[np.ndarray]


def fit_thresholds(
    nominal: Gsfl,
    predictor: CurvePredictor,
    maps: Sequence[MeasuredMap],
    live: np.ndarray,
    gain: np.ndarray,
    gain_error: float,
) -> PixelThresholds:
    """Fit the threshold of each pixel by likelihood: binomial for detections, Poisson's for dark counts.

    The mean threshold is the nominal one. Each map has a free shift that is common to all pixels: otherwise an error of the
    photons, or of the noise, would count as a misfit of every pixel. Where both were measured, a pixel whose dark counts no
    usual threshold explains is hot, and its dark current follows from them.

    Parameters
    ----------
    nominal : detector without spreads
    predictor : for the pulse of the bench
    maps : of detection rates and dark counts
    live : (row, col) pixels that are fitted
    gain : (row, col) gain factors, by which signals are larger
    gain_error : their standard error, by which gains are free where dark counts tell the thresholds too
    """
    light = [measured for measured in maps if measured.quantity == "detection_rate"]
    dark = [measured for measured in maps if measured.quantity == "dark_counts"]
    detection = _Detection(nominal, predictor, light, gain[live])
    shifts = np.zeros(len(light)), np.zeros(len(dark))
    hot = np.zeros(int(live.sum()), bool)
    for _ in range(_ROUNDS):
        by_light, by_dark = _sum_light(detection, light, live, shifts[0]), _sum_dark(nominal, dark, live, shifts[1])
        if light and dark:
            hot = _find_hot(nominal, dark, live, *_find_peaks(by_light), shifts[1])
        factor, error = _find_peaks(_free_gain(by_light, gain_error) + by_dark)
        factor[hot], error[hot] = 1.0, np.nan
        known = np.isfinite(error)
        if not known.any():
            raise ScenarioError(
                "pixel_constants: these rates tell no threshold; give light near the threshold, or longer dark counts"
            )
        mean = float(factor[known].mean())
        factor[known], error[known] = factor[known] / mean, error[known] / mean
        shifts = (
            np.array([_find_shift(detection, k, measured, live, factor, known) for k, measured in enumerate(light)]),
            np.array([_find_dark_shift(nominal, measured, live, factor, known) for measured in dark]),
        )
    current = np.full(len(factor), nominal.apd.dark_current_na)
    current_error = np.full(len(factor), np.nan)
    if hot.any():
        spread = max(float(factor[np.isfinite(error)].std()), _LEAST_SPREAD)
        current[hot], current_error[hot] = _solve_currents(nominal, dark, live, hot, spread)

    def fill_array(values: np.ndarray, fill: float) -> np.ndarray:
        plane = np.full(live.shape, fill, dtype=values.dtype)
        plane[live] = values
        return plane

    expected = []
    for measured in maps:
        if measured.quantity == "detection_rate":
            k = light.index(measured)
            moved = _find_gain_moves(by_light, factor * mean, gain_error) if dark else 0.0
            own = detection.rate(k, (np.log(factor) + shifts[0][k] - moved)[:, None])[:, 0]
        else:
            shifted = np.where(hot, 1.0, factor * np.exp(shifts[1][dark.index(measured)]))
            own = np.where(hot, np.nan, _rate(nominal, shifted, nominal.apd.dark_current_na) * measured.trials[live])
        expected.append(fill_array(np.where(known, own, np.nan), np.nan))
    return PixelThresholds(
        fill_array(factor, 1.0),
        fill_array(error, np.nan),
        fill_array(hot, False),
        fill_array(current, nominal.apd.dark_current_na),
        fill_array(current_error, np.nan),
        expected,
    )


def _list_moves(gain_error: float) -> tuple[np.ndarray, np.ndarray]:
    """Return moves of the gain in steps of the threshold factors, and the logarithm of their likelihood."""
    step = float(_LOG_FACTOR[1] - _LOG_FACTOR[0])
    most = min(int(np.ceil(_MOVE_SIGMAS * gain_error / step)), len(_LOG_FACTOR) // 4)
    moves = np.arange(-most, most + 1)
    return moves, -0.5 * (moves * step / max(gain_error, 1e-12)) ** 2


def _free_gain(by_light: np.ndarray, gain_error: float) -> np.ndarray:
    """Return the logarithm of the likelihood (pixel, factor) of detections at the most likely gain of each pixel."""
    freed = np.full(by_light.shape, -np.inf)
    columns = np.arange(len(_LOG_FACTOR))
    for move, prior in zip(
        *_list_moves(gain_error), strict=True
    ):  # a gain that is higher by a step acts as a lower threshold
        np.maximum(freed, by_light[:, np.clip(columns - move, 0, len(columns) - 1)] + prior, out=freed)
    return freed


def _find_gain_moves(by_light: np.ndarray, factor: np.ndarray, gain_error: float) -> np.ndarray:
    """Return by how much the logarithm of the gain moves (pixel) at the fitted thresholds."""
    step = float(_LOG_FACTOR[1] - _LOG_FACTOR[0])
    at = np.interp(np.log(factor), _LOG_FACTOR, np.arange(len(_LOG_FACTOR)))
    moves, prior = _list_moves(gain_error)
    if len(moves) < 3:
        return np.zeros(len(factor))
    pixel = np.arange(len(factor))
    place = np.clip(at[:, None] - moves, 0, len(_LOG_FACTOR) - 2)
    low = place.astype(np.int64)
    here, after = by_light[pixel[:, None], low], by_light[pixel[:, None], low + 1]
    total = here + (place - low) * (after - here) + prior
    best = np.clip(total.argmax(axis=1), 1, len(moves) - 2)
    left, middle, right = (total[pixel, best + k] for k in (-1, 0, 1))
    bend = left + right - 2.0 * middle
    with np.errstate(divide="ignore", invalid="ignore"):
        shift = np.where(bend < 0.0, np.clip(0.5 * (left - right) / bend, -1.0, 1.0), 0.0)
    return np.asarray(step * (moves[best] + shift))


class _Detection:
    """Probabilities of detection of pixels at each level of light, over their threshold factor.

    A gain g is a threshold, and a noise of the amplifier, that are g times lower. The closed form at three gains is
    corrected by a large trial of the nominal pixel.
    """

    def __init__(self, nominal: Gsfl, predictor: CurvePredictor, maps: list[MeasuredMap], gain: np.ndarray) -> None:
        self.log_gain = np.log(gain)
        spread = _GAIN_SIGMAS * float(self.log_gain.std())
        self.nodes = np.array([-spread, 0.0, spread]) if spread > 1e-3 else np.zeros(1)
        photons = np.array([measured.photons for measured in maps])
        shape = (len(maps), len(self.nodes), len(_LOG_RATIO))
        link = np.empty(shape)
        for j, log_gain in enumerate(self.nodes.tolist() if maps else []):
            for k, log_ratio in enumerate(_LOG_RATIO.tolist()):
                link[:, j, k] = _predict_link(nominal, predictor, photons, np.exp(log_ratio), np.exp(log_gain))
        at_rest = _predict_link(nominal, predictor, photons, 1.0, 1.0) if maps else np.zeros(0)
        for k, measured in enumerate(maps):
            trial = predictor.refer(nominal, measured.pool(), _TRIALS).link[0]
            share = float(from_link("detection_rate", trial))
            if share * (1.0 - share) * _TRIALS > _LEAST_BITS:
                link[k] += trial - at_rest[k]
        self.link = link

    def rate(self, level: int, log_factor: np.ndarray, pixel: slice = slice(None)) -> np.ndarray:
        """Return the probabilities (pixel, factor) of some pixels at threshold factors."""
        from scipy.interpolate import PchipInterpolator

        log_gain = self.log_gain[pixel, None]
        at = np.clip(log_factor - log_gain, _LOG_RATIO[0], _LOG_RATIO[-1])
        known = [PchipInterpolator(_LOG_RATIO, node)(at) for node in self.link[level]]
        if len(known) == 1:
            return from_link("detection_rate", known[0])
        x = log_gain / self.nodes[2]
        link = known[1] + 0.5 * x * (known[2] - known[0]) + 0.5 * x**2 * (known[2] + known[0] - 2.0 * known[1])
        return from_link("detection_rate", link)


def _predict_link(
    nominal: Gsfl, predictor: CurvePredictor, photons: np.ndarray, ratio: float, gain: float
) -> np.ndarray:
    """Return the probit of detection (level) at a threshold `ratio` times the nominal, of a pixel of a gain factor."""
    trigger = nominal.trigger.replace(threshold_electrons=ratio * nominal.trigger.threshold_electrons)
    amplifier = nominal.amplifier.replace(noise_electrons=nominal.amplifier.noise_electrons / gain)
    try:
        pixel = nominal.replace(trigger=trigger, amplifier=amplifier)
        rate = predict(pixel, predictor.pulse, photons, np.zeros(len(photons)), only_probability=True).probability
    except ScenarioError:  # a threshold above the rail of the amplifier, which nothing reaches
        rate = np.zeros(len(photons))
    return to_link("detection_rate", rate)


def _sum_light(detection: _Detection, maps: list[MeasuredMap], live: np.ndarray, shifts: np.ndarray) -> np.ndarray:
    """Return the logarithm of the likelihood (pixel, factor) of detections."""
    total = np.zeros((int(live.sum()), len(_LOG_FACTOR)))
    for level, measured in enumerate(maps):
        hits, trials = measured.value[live], measured.trials[live]
        for first in range(0, len(hits), _PIXELS_AT_ONCE):
            some = slice(first, first + _PIXELS_AT_ONCE)
            rate = np.clip(detection.rate(level, _LOG_FACTOR[None] + shifts[level], some), _RARE, 1.0 - _RARE)
            missed = (trials - hits)[some, None]
            total[some] += hits[some, None] * np.log(rate) + missed * np.log1p(-rate)
    return total


def _sum_dark(nominal: Gsfl, maps: list[MeasuredMap], live: np.ndarray, shifts: np.ndarray) -> np.ndarray:
    """Return the logarithm of the likelihood (pixel, factor) of dark counts."""
    total = np.zeros((int(live.sum()), len(_LOG_FACTOR)))
    for measured, shift in zip(maps, shifts, strict=True):
        rate = np.maximum(_rate(nominal, np.exp(_LOG_FACTOR + shift), nominal.apd.dark_current_na), 1e-30)
        count, armed_s = measured.value[live], measured.trials[live]
        total += count[:, None] * np.log(armed_s[:, None] * rate) - armed_s[:, None] * rate
    return total


def _find_shift(
    detection: _Detection, level: int, measured: MeasuredMap, live: np.ndarray, factor: np.ndarray, known: np.ndarray
) -> float:
    """Return the shift of the logarithm of all thresholds at which a map of detections is most likely."""
    hits, trials = measured.value[live][known], measured.trials[live][known]
    total = np.zeros(len(_SHIFTS))
    for k, shift in enumerate(_SHIFTS.tolist()):
        rate = detection.rate(level, (np.log(factor) + shift)[:, None])[known, 0]
        rate = np.clip(rate, _RARE, 1.0 - _RARE)
        total[k] = (hits * np.log(rate) + (trials - hits) * np.log1p(-rate)).sum()
    return _find_top(total)


def _find_dark_shift(
    nominal: Gsfl, measured: MeasuredMap, live: np.ndarray, factor: np.ndarray, known: np.ndarray
) -> float:
    """Return the shift of the logarithm of all thresholds at which a map of dark counts is most likely."""
    count, armed_s = measured.value[live][known], measured.trials[live][known]
    total = np.zeros(len(_SHIFTS))
    for k, shift in enumerate(_SHIFTS.tolist()):
        mean = np.maximum(_rate(nominal, factor[known] * np.exp(shift), nominal.apd.dark_current_na) * armed_s, 1e-30)
        total[k] = (count * np.log(mean) - mean).sum()
    return _find_top(total)


def _find_top(total: np.ndarray) -> float:
    """Return the shift of the greatest of some logarithms of likelihood, between them by a parabola."""
    k = int(np.clip(total.argmax(), 1, len(total) - 2))
    before, here, after = total[k - 1 : k + 2]
    bend = before + after - 2.0 * here
    step = float(_SHIFTS[1] - _SHIFTS[0])
    return float(_SHIFTS[k] - step * np.clip(0.5 * (after - before) / bend, -1.0, 1.0)) if bend < 0.0 else 0.0


def _rate(nominal: Gsfl, factor: np.ndarray, dark_current_na: float | np.ndarray) -> np.ndarray:
    """Return the rates of triggers in the dark [1/s] at threshold factors and dark currents of the same shape."""
    dark_per_s = np.broadcast_to(dark_current_na, np.shape(factor)) * (units.NA / units.ELEMENTARY_CHARGE_C)
    threshold = nominal.trigger.threshold_electrons * np.asarray(factor)
    return rates_per_s(nominal.apd, nominal.amplifier, threshold, dark_per_s)


def _find_peaks(log_likelihood: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the factor of greatest likelihood (pixel), and its standard error; 1 and NaN where there is no peak."""
    step = float(_LOG_FACTOR[1] - _LOG_FACTOR[0])
    best = log_likelihood.argmax(axis=1)
    inner = (best > 0) & (best < len(_LOG_FACTOR) - 1)
    at = np.clip(best, 1, len(_LOG_FACTOR) - 2)
    pixel = np.arange(len(at))
    before, here, after = (log_likelihood[pixel, at + k] for k in (-1, 0, 1))
    slope, bend = 0.5 * (after - before), before + after - 2.0 * here
    with np.errstate(divide="ignore", invalid="ignore"):
        error = step / np.sqrt(-bend)
        known = inner & (bend < 0.0) & (error < 1.0)
        factor = np.exp(_LOG_FACTOR[at] - step * slope / bend)
    return np.where(known, factor, 1.0), np.where(known, factor * error, np.nan)


def _find_hot(
    nominal: Gsfl,
    maps: list[MeasuredMap],
    live: np.ndarray,
    factor: np.ndarray,
    error: np.ndarray,
    shifts: np.ndarray,
) -> np.ndarray:
    """Return which pixels trigger in the dark more often than any usual threshold explains.

    A hot pixel is noisy, so its detections tell a wrong threshold: none is taken to be far below those of the others.
    """
    from scipy.stats import poisson

    low, middle, high = np.nanquantile(np.where(np.isfinite(error), factor, np.nan), [0.25, 0.5, 0.75])
    spread = max(float(high - low) / 1.349, _LEAST_SPREAD)
    least = np.where(np.isfinite(error), factor - _HOT_SIGMAS * np.nan_to_num(error), 0.0)
    lowest = np.maximum(least, middle - _SPREADS * spread) * np.exp(shifts.mean())
    rate = _rate(nominal, lowest, nominal.apd.dark_current_na)
    count = sum(measured.value[live] for measured in maps)
    armed_s = sum(measured.trials[live] for measured in maps)
    return np.asarray(poisson.sf(count - 1, rate * armed_s) < _HOT_BELOW)


def _solve_currents(
    nominal: Gsfl, maps: list[MeasuredMap], live: np.ndarray, hot: np.ndarray, spread: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the dark currents of hot pixels [nA] at the nominal threshold, with errors by the spread of thresholds."""
    count = sum(measured.value[live][hot] for measured in maps)
    armed_s = sum(measured.trials[live][hot] for measured in maps)
    currents = max(nominal.apd.dark_current_na, 1e-3) * _DARK_CURRENTS
    log_currents = []
    for factor in (1.0, 1.0 + spread):
        rates = np.maximum.accumulate(_rate(nominal, np.full(len(currents), factor), currents))
        log_currents.append(np.interp(np.log(count / armed_s), np.log(np.maximum(rates, 1e-300)), np.log(currents)))
    current = np.exp(log_currents[0])
    return current, current * np.abs(log_currents[1] - log_currents[0])

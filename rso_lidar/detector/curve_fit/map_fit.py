"""Gain, offset, time origin and threshold of each pixel, as measured maps give them, with standard errors.

A pixel is the nominal one but for a few constants of its own. Means of counts and of range are linear in gain, offset and
time origin, with slopes by trials. Thresholds follow from rates by likelihood. What all pixels have in common at a level
of light is not told by maps: all constants are relative to their mean.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rso_lidar import units
from rso_lidar.detector.curve_fit.curve_prediction import CurvePredictor
from rso_lidar.detector.curve_fit.measured_curve import MeasuredCurve
from rso_lidar.detector.curve_fit.measured_map import MeasuredMap, PixelConstant
from rso_lidar.detector.curve_fit.pixel_response import PixelResponse, simulate_response, take_nominal_pixel
from rso_lidar.detector.curve_fit.pixel_thresholds import fit_thresholds
from rso_lidar.detector.curve_fit.scale_check import check_scale
from rso_lidar.detector.detection import AnyDetector
from rso_lidar.detector.ranging.pulse import LaserPulse
from rso_lidar.detector.settings.gsfl import Gsfl
from rso_lidar.detector.stages.pixel_maps import MAP_LIMITS
from rso_lidar.errors import ScenarioError, warn

_REJECTED_BELOW = 1e-3  # probability of a worse fit, as for curves
_MOST_DEAD = 0.5  # of the array: more are a wrong file, not dead pixels
_LEAST_DETECTED = 0.99  # of flashes: at less light the noise selects the reports
_UNRESOLVED_GAIN = 0.5  # median standard error of the gain from which gain and offset cannot be told apart
_FEWEST_EVENTS = 0.1  # variance of a number of events, below which it is not compared
_ROUNDS = 6  # of means and pixels in turn; with equal weights one is enough
_M_PER_NS = units.NS * units.RANGE_PER_DELAY_M_S
_TOLD_BY: dict[str, tuple[str, ...]] = {
    "gain": ("counts_mean",),
    "offset": ("counts_mean",),
    "t0": ("range_mean",),
    "threshold": ("detection_rate", "dark_counts"),
}


@dataclass(frozen=True, eq=False)
class FittedMap:
    """A measured map beside that of the fitted pixels; arrays (row, col).

    Parameters
    ----------
    map : as measured
    expected : values of the fitted pixels; NaN where nothing is known
    residuals : measured less expected over the standard error; NaN for dead and unknown pixels
    over_detector : what all pixels together give, over that of the detector; difference [m] of ranges
    """

    map: MeasuredMap
    expected: np.ndarray
    residuals: np.ndarray
    over_detector: float

    @property
    def chi2(self) -> float:
        """Sum of the squared residuals."""
        return float(np.nansum(self.residuals**2))


@dataclass(frozen=True, eq=False)
class MapGroup:
    """Fitted maps that tell the same constants of the pixels.

    Parameters
    ----------
    tables : the maps
    freedom : degrees of freedom that the constants leave
    p_value : probability of a worse fit, were the model true; 1 where nothing is left to judge by
    """

    tables: tuple[FittedMap, ...]
    freedom: float
    p_value: float

    @property
    def chi2(self) -> float:
        """Sum of the squared residuals of these maps."""
        return float(sum(table.chi2 for table in self.tables))

    @property
    def label(self) -> str:
        """Names of the maps."""
        return ", ".join(table.map.name for table in self.tables)


@dataclass(frozen=True, eq=False)
class MapFit:
    """Constants of each pixel as measured maps give them; arrays (row, col).

    Parameters
    ----------
    maps : by name of a file of maps: ``gain_factor``, ``offset_counts``, ``t0_ns``, ``threshold_factor``,
        ``dark_current_na``
    errors : standard errors by the same names; NaN where a pixel has the nominal value
    dead : whether a pixel reports nothing, however bright
    hot : whether it triggers in the dark far more often than its threshold explains
    groups : the measured maps beside the fit, by the constants that they tell
    """

    maps: dict[str, np.ndarray]
    errors: dict[str, np.ndarray]
    dead: np.ndarray
    hot: np.ndarray
    groups: tuple[MapGroup, ...]

    @property
    def tables(self) -> list[FittedMap]:
        """All maps beside the fit."""
        return [table for group in self.groups for table in group.tables]

    @property
    def misfits(self) -> list[MapGroup]:
        """Maps that such pixels cannot have given; the chance of one of them to be so is shared among all."""
        return [group for group in self.groups if group.p_value * len(self.groups) < _REJECTED_BELOW]


def fit_maps(
    detector: AnyDetector, pulse: LaserPulse, maps: Sequence[MeasuredMap], names: Sequence[PixelConstant]
) -> MapFit:
    """Fit constants of each pixel to measured maps.

    Parameters
    ----------
    detector : with the constants that all pixels share
    pulse : the laser's pulse
    maps : the measured maps, of one array
    names : constants of each pixel that are fitted; the others are nominal

    Returns
    -------
    MapFit

    Raises
    ------
    ScenarioError
        If the maps hold too little for the constants, most pixels report nothing, or a map is in another unit.
    """
    _check_names(maps, names)
    predictor = CurvePredictor(pulse)
    nominal = take_nominal_pixel(detector, "map")
    dead = _find_dead(nominal, predictor, maps)
    pooled = [measured.pool() for measured in maps]
    for curve in pooled:
        check_scale(predictor, nominal, curve)
    shape = dead.shape
    responses = _simulate(nominal, pulse, maps)
    values: dict[str, np.ndarray] = {}
    errors: dict[str, np.ndarray] = {}
    expected: dict[int, np.ndarray] = {}
    counts = [k for k, measured in enumerate(maps) if measured.quantity == "counts_mean"]
    gain, offset = np.ones(shape), np.zeros(shape)
    if counts:
        is_free = ("gain" in names, "offset" in names)
        solved = _solve_counts([maps[k] for k in counts], [responses[k] for k in counts], ~dead, is_free)
        gain, offset = (
            _keep_within("gain_factor", 1.0 + solved.value[0]),
            _keep_within("offset_counts", solved.value[1]),
        )
        expected |= dict(zip(counts, solved.expected, strict=True))
        for name, k, value in (("gain_factor", 0, gain), ("offset_counts", 1, offset)):
            if is_free[k]:
                values[name], errors[name] = value, solved.error[k]
        if all(is_free) and float(np.nanmedian(solved.error[0])) > _UNRESOLVED_GAIN:
            raise ScenarioError(
                "pixel_constants: gain and offset cannot be told apart by counts at nearly equal light; add a map at other "
                "photons, or leave one out"
            )
    ranges = [k for k, measured in enumerate(maps) if measured.quantity == "range_mean"]
    if ranges:
        solved = _solve_ranges(
            [maps[k] for k in ranges], [responses[k] for k in ranges], ~dead, "t0" in names, gain - 1.0, offset
        )
        values["t0_ns"], errors["t0_ns"] = _keep_within("t0_ns", solved.value[0]), solved.error[0]
        expected |= dict(zip(ranges, solved.expected, strict=True))
    rates = [k for k, measured in enumerate(maps) if measured.quantity in ("detection_rate", "dark_counts")]
    hot = np.zeros(shape, bool)
    if rates:
        gain_error = float(np.nanmedian(errors["gain_factor"])) if "gain_factor" in errors else 0.0
        thresholds = fit_thresholds(nominal, predictor, [maps[k] for k in rates], ~dead, gain, gain_error)
        values["threshold_factor"], errors["threshold_factor"], hot = (
            thresholds.factor,
            thresholds.error,
            thresholds.hot,
        )
        if hot.any():
            values["dark_current_na"], errors["dark_current_na"] = (
                thresholds.dark_current_na,
                thresholds.dark_current_error_na,
            )
        expected |= dict(zip(rates, thresholds.expected, strict=True))
    groups = _judge(maps, expected, dead, errors, responses, pooled, nominal, predictor)
    return MapFit(values, errors, dead, hot, groups)


def _keep_within(name: str, values: np.ndarray) -> np.ndarray:
    """Return a map within the limits that a file of maps has, and warn of pixels that are beyond."""
    low, high = MAP_LIMITS[name]
    beyond = (values < low) | (values > high)
    if beyond.any():
        row, col = np.argwhere(beyond)[0]
        warn(
            f"map: {name} of {int(beyond.sum()):,} of {values.size:,} pixels is beyond {low:g} to {high:g}, first pixel "
            f"({row}, {col}) with {values[row, col]:.3g}; they are set to the limit: check whether they are alive"
        )
    kept: np.ndarray = np.clip(values, low, high)
    return kept


def _check_names(maps: Sequence[MeasuredMap], names: Sequence[str]) -> None:
    """Refuse constants that the maps do not tell, and maps that tell none of the constants."""
    if not names:
        raise ScenarioError("pixel_constants: none is named; name some of gain, offset, t0 and threshold")
    quantities = [measured.quantity for measured in maps]
    for name in names:
        if not set(_TOLD_BY[name]) & set(quantities):
            needs = " or ".join(_TOLD_BY[name])
            raise ScenarioError(
                f"pixel_constants: nothing tells the {name} of a pixel; add a map of {needs}, or leave it out"
            )
    if {"gain", "offset"} <= set(names) and quantities.count("counts_mean") < 2:
        raise ScenarioError(
            "pixel_constants: gain and offset cannot be told apart by one map of counts_mean; add one at other photons"
        )
    for measured in maps:
        if not [name for name in names if measured.quantity in _TOLD_BY[name]]:
            wanted = " or ".join(name for name, told_by in _TOLD_BY.items() if measured.quantity in told_by)
            raise ScenarioError(f"{measured.name}: tells {wanted}, which is not named; add it, or leave the map out")
    if len(shapes := {measured.value.shape for measured in maps}) > 1:
        first, other = sorted(shapes)[:2]
        raise ScenarioError(f"map: some are of {first} and some of {other} pixels; give maps of one array")


def _find_dead(nominal: Gsfl, predictor: CurvePredictor, maps: Sequence[MeasuredMap]) -> np.ndarray:
    """Return the pixels (row, col) that report nothing where even one of a high threshold would report ten times."""
    expected = np.zeros(maps[0].value.shape)
    reported = np.zeros(maps[0].value.shape)
    slow = nominal.replace(
        trigger=nominal.trigger.replace(threshold_electrons=1.5 * nominal.trigger.threshold_electrons)
    )
    for measured in maps:
        if measured.quantity == "dark_counts":
            continue
        if measured.quantity == "detection_rate":
            rate = float(predictor.predict(slow, measured.pool())[0])
            expected += measured.trials * rate
            reported += np.nan_to_num(measured.value)
        else:
            expected += 10.0
            reported += np.isfinite(measured.value)
    dead: np.ndarray = (expected >= 10.0) & (reported == 0.0)
    if dead.mean() > _MOST_DEAD:
        raise ScenarioError(
            f"map: {int(dead.sum()):,} of {dead.size:,} pixels report nothing; correct the file, or give brighter levels"
        )
    return dead


def _simulate(nominal: Gsfl, pulse: LaserPulse, maps: Sequence[MeasuredMap]) -> dict[int, PixelResponse]:
    """Simulate each level of light of which there are maps of means, by the number of the map; it must be bright."""
    known: dict[tuple[float, float], PixelResponse] = {}
    responses = {}
    for number, measured in enumerate(maps):
        if measured.quantity not in ("counts_mean", "range_mean"):
            continue
        level = measured.photons, measured.range_m
        if level not in known:
            known[level] = simulate_response(nominal, pulse, *level)
        if known[level].detected_fraction < _LEAST_DETECTED:
            raise ScenarioError(
                f"{measured.name}: a pixel detects {known[level].detected_fraction:.0%} of flashes of "
                f"{measured.photons:.4g} photons, and noise selects what it reports; give maps of means at brighter levels"
            )
        responses[number] = known[level]
    return responses


@dataclass(frozen=True, eq=False)
class _Solution:
    """Constants (constant, row, col) with errors, and expected values (row, col) of each map."""

    value: np.ndarray
    error: np.ndarray
    expected: list[np.ndarray]


def _solve_counts(
    maps: list[MeasuredMap], responses: list[PixelResponse], live: np.ndarray, is_free: tuple[bool, bool]
) -> _Solution:
    """Solve gains less 1 and offsets from mean counts, by least squares pixel by pixel."""
    slopes, variances = [], []
    for measured, response in zip(maps, responses, strict=True):
        scale = float(np.nanmean(measured.value[live])) / response.counts
        slopes.append([scale * response.counts_by_gain, response.counts_by_offset])
        variances.append(_find_variance(measured, response.counts_scatter))
    return _solve_linear([measured.value for measured in maps], np.array(slopes), variances, live, is_free)


def _solve_ranges(
    maps: list[MeasuredMap],
    responses: list[PixelResponse],
    live: np.ndarray,
    is_free: bool,
    gain: np.ndarray,
    offset: np.ndarray,
) -> _Solution:
    """Solve time origins [ns] from mean ranges, less what gains (less 1) and offsets do to them."""
    values, variances, moved = [], [], []
    for measured, response in zip(maps, responses, strict=True):
        moved.append(response.range_by_gain_m * gain + response.range_by_offset_m * offset)
        values.append(measured.value - moved[-1])
        variances.append(_find_variance(measured, response.range_scatter_m))
    solved = _solve_linear(values, np.full((len(maps), 1), _M_PER_NS), variances, live, (is_free,))
    expected = [own + common for own, common in zip(solved.expected, moved, strict=True)]
    return _Solution(solved.value, solved.error, expected)


def _find_variance(measured: MeasuredMap, scatter: float) -> np.ndarray:
    """Return the variance of each mean (row, col), infinite where there is none.

    The scatter is one for all pixels: that of a few reports of one pixel would make the sum of squares too large.
    """
    own = measured.scatter if np.isfinite(measured.scatter) else scatter
    with np.errstate(divide="ignore"):
        variance = own**2 / measured.trials + measured.systematic**2
    return np.where(np.isfinite(measured.value), variance, np.inf)


def _solve_linear(
    values: list[np.ndarray],
    slopes: np.ndarray,
    variances: list[np.ndarray],
    live: np.ndarray,
    is_free: tuple[bool, ...],
) -> _Solution:
    """Solve constants of each pixel of mean zero, and a mean of each map, by weighted least squares.

    Parameters
    ----------
    values : of each map (row, col), NaN where there is none
    slopes : (map, constant)
    variances : of each map (row, col), infinite where there is none
    is_free : (constant) whether it is solved; 0 otherwise
    """
    measured = np.stack(values, axis=-1)[live]  # (pixel, map)
    weight = 1.0 / np.stack(variances, axis=-1)[live]
    filled = np.where(weight > 0.0, np.nan_to_num(measured), 0.0)
    free = np.flatnonzero(is_free)
    design = slopes[:, free]
    normal = np.einsum("pm,mi,mj->pij", weight, design, design)
    known = np.linalg.cond(normal) < 1e12 if len(free) else np.zeros(len(measured), bool)
    covariance = np.full(normal.shape, np.nan)
    covariance[known] = np.linalg.inv(normal[known])
    constant = np.zeros((len(measured), len(free)))
    mean = np.zeros(len(values))
    for _ in range(_ROUNDS):
        left = filled - constant @ design.T
        mean = (weight * left).sum(axis=0) / weight.sum(axis=0)
        right = np.einsum("pm,mi->pi", weight * (filled - mean), design)
        constant[known] = np.einsum("pij,pj->pi", covariance[known], right[known])
        constant[known] -= constant[known].mean(axis=0)
    shape = live.shape
    value, error = np.zeros((len(is_free), *shape)), np.full((len(is_free), *shape), np.nan)
    for place, k in enumerate(free.tolist()):
        value[k][live] = constant[:, place]
        error[k][live] = np.sqrt(covariance[:, place, place])
    expected = []
    for common, slope in zip(mean, design, strict=True):
        here = np.full(shape, np.nan)
        here[live] = common + constant @ slope
        expected.append(here)
    return _Solution(value, error, expected)


def _judge(
    maps: Sequence[MeasuredMap],
    expected: dict[int, np.ndarray],
    dead: np.ndarray,
    errors: dict[str, np.ndarray],
    responses: dict[int, PixelResponse],
    pooled: list[MeasuredCurve],
    nominal: Gsfl,
    predictor: CurvePredictor,
) -> tuple[MapGroup, ...]:
    """Return the maps beside their fit, in groups that tell the same constants."""
    groups = []
    for quantities in dict.fromkeys(_TOLD_BY.values()):
        tables, points, variance = [], 0, 0.0
        for k, measured in enumerate(maps):
            if measured.quantity not in quantities:
                continue
            known = ~dead & np.isfinite(measured.value) & np.isfinite(expected[k])
            residuals = np.full(dead.shape, np.nan)
            residuals[known], scatter = _find_pixel_residuals(measured, known, expected[k][known], responses.get(k))
            points += int(np.isfinite(residuals).sum())
            variance += float(np.nansum(scatter))
            simulated, value = float(predictor.predict(nominal, pooled[k])[0]), float(pooled[k].value[0])
            is_range = measured.quantity == "range_mean"
            over = value - simulated if is_range else value / max(simulated, 1e-300)
            tables.append(FittedMap(measured, expected[k], residuals, over))
        if not tables:
            continue
        own = [error for name, error in errors.items() if _TOLD_BY.get(name.split("_")[0]) == quantities]
        # Each map has a mean or a shift of its own, while the mean of each constant is given.
        spent = sum(int(np.isfinite(error).sum()) for error in own) + len(tables) - len(own)
        freedom = float(max(points - spent, 0))
        p_value = _find_p_value(sum(table.chi2 for table in tables), freedom, variance / points) if freedom else 1.0
        groups.append(MapGroup(tuple(tables), freedom, p_value))
    return tuple(groups)


def _find_pixel_residuals(
    measured: MeasuredMap, known: np.ndarray, expected: np.ndarray, response: PixelResponse | None
) -> tuple[np.ndarray, np.ndarray]:
    """Return the residuals of the known pixels of a map (pixel), and the variances of their squares.

    A square of a residual of a rate is Pearson's: its mean is 1 also for few events, which is not so of a deviance. Its
    variance is 2 and the excess of the fourth moment of the binomial or of Poisson's law. Pixels with next to no events
    have no residual.
    """
    value, trials = measured.value[known], measured.trials[known]
    if measured.quantity == "detection_rate":
        rate = np.clip(expected, 1e-12, 1.0 - 1e-12)
        own = trials * rate * (1.0 - rate)
        excess, beside = (1.0 - 6.0 * rate * (1.0 - rate)) / own, value - trials * rate
        more = (trials * measured.systematic) ** 2
    elif measured.quantity == "dark_counts":
        own = np.maximum(expected, 1e-12)
        excess, beside, more = 1.0 / own, value - own, measured.systematic**2
    else:
        scatter = measured.scatter
        if not np.isfinite(scatter) and response is not None:
            scatter = response.counts_scatter if measured.quantity == "counts_mean" else response.range_scatter_m
        own, more = scatter**2 / trials, measured.systematic**2
        excess, beside = np.zeros(len(value)), value - expected
    enough = (own >= _FEWEST_EVENTS) | measured.quantity.endswith("mean")
    return np.where(enough, beside / np.sqrt(own + more), np.nan), np.where(enough, 2.0 + excess, np.nan)


def _find_p_value(chi2_sum: float, freedom: float, variance: float) -> float:
    """Return the probability of a greater sum of squares, each of variance `variance` in place of 2.

    The law of the sum is that of a chi-square of the same mean and variance, times a factor (Satterthwaite 1946).
    """
    from scipy.stats import chi2

    factor = 0.5 * variance
    return float(chi2.sf(chi2_sum / factor, freedom / factor))

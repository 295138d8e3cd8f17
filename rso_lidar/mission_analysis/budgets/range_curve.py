"""One curve of a link budget: light, detection and precision of a pixel against range."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from rso_lidar import units
from rso_lidar.detector import AnyDetector, false_alarm_probability, predict
from rso_lidar.mission_analysis.budgets.inputs import BudgetTarget
from rso_lidar.mission_analysis.budgets.pixel_light import compute_photons, depth_spread_s, pixel_width_m
from rso_lidar.scenario import Lidar
from rso_lidar.scene import Scatterer

_SCANNED = 64  # ranges that bracket the greatest range before it is solved for
FARTHEST_M = 1e7


@dataclass(frozen=True, eq=False)
class BudgetCurve:
    """Results (range) along `range_m` for one material at one tilt and one divergence.

    `detection_probability` counts earlier false alarms as misses, and is 0 where the camera is not armed.
    `false_alarm_probability` is that of such a false alarm. `range_precision_m` is 1 sigma of a detected return.
    `pixels_on_target` is the target's illuminated area over that of a pixel, `pixels_across` its longest side over that of
    a pixel. `max_range_m` is the greatest range with the wanted probability, NaN where none has it. `armed_limits` states
    that the armed window ends there, `fill_limits` that the target fills no pixel beyond. Light and detection are those of
    a filled pixel: they hold for the target only where `target_fills_pixel`.
    """

    material: str
    tilt_deg: float
    divergence_deg: float
    range_m: np.ndarray
    photons: np.ndarray
    fill_fraction: np.ndarray
    detection_probability: np.ndarray
    range_precision_m: np.ndarray
    snr: np.ndarray
    saturated: np.ndarray
    false_alarm_probability: np.ndarray
    pixel_m: np.ndarray
    pixels_on_target: np.ndarray
    pixels_across: np.ndarray
    target_fills_pixel: np.ndarray
    max_range_m: float
    armed_limits: bool
    fill_limits: bool


def compute_curve(
    lidar: Lidar,
    label: str,
    material: Scatterer,
    tilt: float,
    range_m: np.ndarray,
    facet_m2: float | None,
    target: BudgetTarget,
    filled_to_m: float,
    wanted: float,
) -> BudgetCurve:
    """Compute one curve of a link budget.

    Parameters
    ----------
    tilt : angle between the facet's normal and the boresight [deg]
    range_m : (range) ranges [m]
    facet_m2 : area of the facet [m²] (None: it fills the pixel)
    target : target on which pixels are counted
    filled_to_m : range to which the target fills a pixel [m]
    """
    laser, receiver, detector = lidar.laser, lidar.receiver, lidar.detector
    tilt_rad = tilt * units.DEG
    photons, fill = compute_photons(laser, receiver, material, tilt_rad, range_m, facet_m2)
    pulse = lidar.pulse
    seen = predict(detector, pulse, photons, depth_spread_s(receiver, tilt_rad, range_m, fill))
    first = false_alarm_probability(detector, range_m)
    pixel_m = pixel_width_m(receiver, range_m)
    lit = np.minimum(_footprint_m2(lidar, range_m), receiver.n_rows * receiver.n_cols * pixel_m**2)

    def probability(at_m: np.ndarray) -> np.ndarray:
        photons, fill = compute_photons(laser, receiver, material, tilt_rad, at_m, facet_m2)
        stretch_s = depth_spread_s(receiver, tilt_rad, at_m, fill)
        detected = predict(detector, pulse, photons, stretch_s, only_probability=True).probability
        return detected * (1.0 - false_alarm_probability(detector, at_m))

    farthest, armed_limits = _find_greatest_range_m(probability, *_armed_span_m(detector), wanted)
    fill_limits = farthest > filled_to_m
    return BudgetCurve(
        material=label,
        tilt_deg=tilt,
        divergence_deg=laser.divergence_deg,
        range_m=range_m,
        photons=photons,
        fill_fraction=fill,
        detection_probability=np.where(_is_armed(detector, range_m), seen.probability * (1.0 - first), 0.0),
        range_precision_m=seen.range_precision_m,
        snr=seen.snr,
        saturated=seen.saturated,
        false_alarm_probability=first,
        pixel_m=pixel_m,
        pixels_on_target=np.minimum(target.area_m2, lit) / pixel_m**2,
        pixels_across=np.minimum(max(target.sides_m), receiver.n_cols * pixel_m) / pixel_m,
        target_fills_pixel=range_m <= filled_to_m,
        max_range_m=filled_to_m if fill_limits else farthest,
        armed_limits=armed_limits and not fill_limits,
        fill_limits=fill_limits,
    )


def _footprint_m2(lidar: Lidar, range_m: np.ndarray) -> np.ndarray:
    """Return the area of the laser's footprint (range) [m²]; a Gaussian one ends at 1/e²."""
    half_m = range_m * math.tan(0.5 * lidar.laser.divergence_deg * units.DEG)
    round_ = lidar.laser.footprint in ("circle", "gaussian")
    area: np.ndarray = (math.pi if round_ else 4.0) * half_m**2
    return area


def _armed_span_m(detector: AnyDetector) -> tuple[float, float]:
    """Return the range limits [m] of detection; a gate is assumed to be placed about the target at any range."""
    traits = detector.traits
    if traits.is_gated:
        return 1.0, FARTHEST_M
    return max(traits.sees_from_m, 1e-3), min(traits.sees_to_m, FARTHEST_M)


def _is_armed(detector: AnyDetector, range_m: np.ndarray) -> np.ndarray:
    low, high = _armed_span_m(detector)
    armed: np.ndarray = (range_m >= low * (1.0 - 1e-9)) & (range_m <= high * (1.0 + 1e-9))
    return armed


def _find_greatest_range_m(probability: Any, low_m: float, high_m: float, wanted: float) -> tuple[float, bool]:
    """Find the greatest range [m] with the wanted probability, and whether it is the upper limit; NaN without any."""
    from scipy.optimize import brentq

    scanned = np.geomspace(low_m, high_m, _SCANNED)
    reached = np.flatnonzero(probability(scanned) >= wanted)
    if not len(reached):
        return math.nan, False
    last = int(reached[-1])
    if last == _SCANNED - 1:
        return high_m, True
    between = [math.log(scanned[last]), math.log(scanned[last + 1])]
    solved = brentq(lambda x: float(probability(np.exp([x]))[0]) - wanted, *between, xtol=1e-6)
    return float(math.exp(solved)), False

"""What a pixel reports when its gain or its offset differs from the nominal ones, by trials with the same random numbers."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rso_lidar import units
from rso_lidar.detector.bench.trial import NEAR_M, make_plate
from rso_lidar.detector.chain.camera import build_camera
from rso_lidar.detector.chain.full import run_chain
from rso_lidar.detector.curve_fit.measured_curve import LevelStatistics, summarise_reports
from rso_lidar.detector.detection import AnyDetector
from rso_lidar.detector.ranging.pulse import LaserPulse
from rso_lidar.detector.settings.gsfl import Gsfl
from rso_lidar.errors import ScenarioError

_PIXELS = 8192  # of a trial
_GAIN_STEP = 0.1  # to each side: a usual spread
_OFFSET_STEP_COUNTS = 4.0
_SEED = 39  # random seed of the trials


@dataclass(frozen=True, eq=False)
class PixelResponse:
    """Reports of a nominal pixel at one level of light, and their slopes over what differs from pixel to pixel.

    Parameters
    ----------
    detected_fraction : share of the flashes with a report
    counts, range_m : mean intensity [counts], and mean error of range [m]
    counts_scatter, range_scatter_m : of single reports
    counts_by_gain, range_by_gain_m : slopes over the gain factor
    counts_by_offset, range_by_offset_m : slopes over the offset [1/count]
    """

    detected_fraction: float
    counts: float
    range_m: float
    counts_scatter: float
    range_scatter_m: float
    counts_by_gain: float
    range_by_gain_m: float
    counts_by_offset: float
    range_by_offset_m: float


def take_chain(detector: AnyDetector, what: str) -> Gsfl:
    """Return a detector that is the full chain; another one is refused.

    Parameters
    ----------
    what : that needs the chain, for the message
    """
    if not isinstance(detector, Gsfl):
        raise ScenarioError(f'{what}: needs the full chain; set lidar.detector.type = "gsfl"')
    return detector


def take_nominal_pixel(detector: AnyDetector, what: str) -> Gsfl:
    """Return the full chain with pixels that are all nominal.

    Parameters
    ----------
    what : that needs the chain, for the message
    """
    chain = take_chain(detector, what)
    return chain.replace(maps=None, defects=None, trigger=chain.trigger.replace(threshold_spread_fraction=0.0))


def simulate_response(detector: Gsfl, pulse: LaserPulse, photons: float, range_m: float) -> PixelResponse:
    """Simulate the reports of a pixel at one level of light, and their slopes.

    Parameters
    ----------
    detector : whose own maps are left out
    pulse : the laser's pulse
    photons : expected on the pixel
    range_m : least range of the plate, which is spread over a metre [m]
    """
    nominal = take_nominal_pixel(detector.alone(), "map")
    steps = [(1.0, 0.0), (1.0 + _GAIN_STEP, 0.0), (1.0 - _GAIN_STEP, 0.0)]
    steps += [(1.0, _OFFSET_STEP_COUNTS), (1.0, -_OFFSET_STEP_COUNTS)]
    rest, *sides = (_run(nominal, pulse, photons, range_m, *step) for step in steps)
    values = [np.array([each.counts_mean[0], each.range_mean_m[0]]) for each in sides]
    by_gain = (values[0] - values[1]) / (2.0 * _GAIN_STEP)
    by_offset = (values[2] - values[3]) / (2.0 * _OFFSET_STEP_COUNTS)
    return PixelResponse(
        float(rest.share[0]),
        float(rest.counts_mean[0]),
        float(rest.range_mean_m[0]),
        float(rest.counts_scatter[0]),
        float(rest.range_scatter_m[0]),
        float(by_gain[0]),
        float(by_gain[1]),
        float(by_offset[0]),
        float(by_offset[1]),
    )


def _run(
    detector: Gsfl, pulse: LaserPulse, photons: float, range_m: float, gain: float, offset_counts: float
) -> LevelStatistics:
    """Run trials of pixels of one gain factor and one offset."""
    camera = build_camera(detector, pulse, _PIXELS)
    same = np.ones(_PIXELS)
    pixels = replace(camera.front.pixels, gain=gain * same, offset_counts=offset_counts * same)
    camera = replace(
        camera, front=replace(camera.front, pixels=pixels), processor=replace(camera.processor, pixels=pixels)
    )
    light = make_plate(photons, _PIXELS, (pulse.step_s, pulse.power_per_s), pulse.fwhm_s, range_m)
    reading, _, _ = run_chain(camera, light, np.random.Generator(np.random.Philox(_SEED)))
    error_m = reading.range_m.ravel().astype(float) - light.delay_s * units.RANGE_PER_DELAY_M_S
    with np.errstate(invalid="ignore"):
        near = np.abs(error_m) < NEAR_M
    return summarise_reports(near, error_m, reading.intensity_counts.ravel())

"""Figures of a camera's data sheet that follow from its settings: noise, threshold, false alarms, saturation, pixels."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from rso_lidar import units
from rso_lidar.detector.analysis.false_alarms import mean_false_alarms_per_s
from rso_lidar.detector.bench.prediction import find_saturation_photons
from rso_lidar.detector.chain.camera import draw_camera_pixels
from rso_lidar.detector.detection import AnyDetector, false_alarm_probability
from rso_lidar.detector.geiger.array import GeigerArray
from rso_lidar.detector.ranging.pulse import LaserPulse, Pulse
from rso_lidar.detector.settings.empirical import Empirical
from rso_lidar.detector.settings.gsfl import Gsfl

_SETTING, _CLOSED_FORM = "setting", "closed form"
_LEAST_TRUE = 1.0 / 1.25  # of the rate of false alarms, where single avalanches dominate: see `false_alarm_rate`
_RICE = "rate of noise through the threshold: Rice's integral with the density of McIntyre's avalanches"


@dataclass(frozen=True)
class CameraFigure:
    """One figure of a camera's data sheet.

    Parameters
    ----------
    name : of the figure, which ends in its unit where it has one
    meaning : in a few words
    value : in `unit`; NaN where nothing is known, infinite where there is no limit
    unit : in SI; empty for a ratio
    how : origin of the value in two or three words: a setting, a closed form, or a number of trials
    low, high : uncertainty of the value: of trials the interval of 95 % confidence, of a closed form its known error. None
        for a setting, and for a closed form without an approximation
    formula : more about the origin; empty where the meaning says it
    """

    name: str
    meaning: str
    value: float
    unit: str
    how: str
    low: float | None = None
    high: float | None = None
    formula: str = ""


def list_camera_figures(
    detector: AnyDetector, pulse: LaserPulse, wavelength_m: float, n_pixels: int
) -> tuple[CameraFigure, ...]:
    """List the figures of a data sheet that need no trial.

    Parameters
    ----------
    detector : a part, or an object that follows the protocol `Detector`, of which the traits alone are known
    pulse : the laser's pulse
    wavelength_m : of the laser [m]
    n_pixels : number of pixels of the array

    Returns
    -------
    tuple of CameraFigure
        What the detector has, in the order of a data sheet.
    """
    match detector:
        case Gsfl():
            figures = _list_gsfl(detector, pulse, wavelength_m)
            threshold = next((figure.value for figure in figures if figure.name == "threshold_photons"), math.nan)
            figures += [*_list_coupling(detector, threshold), *_list_array(detector, n_pixels)]
        case Empirical():
            figures = _list_empirical(detector)
        case GeigerArray():
            figures = _list_geiger(detector, wavelength_m)
        case _:
            traits = detector.traits
            figures = [
                CameraFigure("threshold_photons", "threshold", traits.threshold_photons, "photons", "its traits"),
                CameraFigure(
                    "saturation_photons", "photons that saturate", traits.saturation_photons, "photons", "its traits"
                ),
            ]
    return (*figures, *_list_false_alarms(detector, n_pixels))


def _list_gsfl(gsfl: Gsfl, pulse: LaserPulse, wavelength_m: float) -> list[CameraFigure]:
    """List the noise, the threshold and the saturation of the full chain."""
    apd, amplifier = gsfl.apd, gsfl.amplifier
    responsivity = gsfl.quantum_efficiency * units.ELEMENTARY_CHARGE_C / units.photon_energy_j(wavelength_m)
    amplifier_a = amplifier.noise_a_per_sqrt_hz
    nep = math.hypot(amplifier_a, apd.dark_noise_a_per_sqrt_hz) / (apd.gain * responsivity)
    peak = Pulse.after(pulse.step_s, pulse.power_per_s, amplifier.pole_s, amplifier.integration_s).peak
    per_photon = gsfl.electrons_per_photon * peak
    noise_photons = gsfl.noise_electrons / per_photon
    figures = [
        ("responsivity_a_per_w", "responsivity at unit gain", responsivity, "A/W", _CLOSED_FORM, "QE q λ / (h c)"),
        ("gain", "gain M of the APD", apd.gain, "", _SETTING, ""),
        (
            "excess_noise_factor",
            "excess noise factor F",
            apd.excess_noise_factor,
            "",
            _CLOSED_FORM,
            "McIntyre, of M and k",
        ),
        ("bandwidth_hz", "bandwidth to −3 dB", amplifier.bandwidth_mhz * units.MHZ, "Hz", _SETTING, ""),
        ("noise_bandwidth_hz", "noise bandwidth", amplifier.noise_bandwidth_hz, "Hz", _CLOSED_FORM, "∫|H|² df"),
        (
            "amplifier_noise_a_per_sqrt_hz",
            "amplifier noise after the APD",
            amplifier_a,
            "A/√Hz",
            _CLOSED_FORM,
            "white, one-sided, through the noise bandwidth",
        ),
        (
            "nep_w_per_sqrt_hz",
            "NEP in the dark",
            nep,
            "W/√Hz",
            _CLOSED_FORM,
            "amplifier and multiplied dark current, over gain and responsivity",
        ),
        (
            "noise_equivalent_photons",
            "noise-equivalent photons",
            noise_photons,
            "photons",
            _CLOSED_FORM,
            "rms noise in the dark, over the peak of one photon of this pulse behind the amplifier",
        ),
    ]
    if gsfl.gate is None:
        threshold = gsfl.trigger.threshold_electrons
        figures += [
            (
                "threshold_electrons",
                "threshold, electrons",
                threshold,
                "electrons",
                _SETTING,
                "after the APD, above the baseline",
            ),
            (
                "threshold_photons",
                "threshold, photons at the peak",
                threshold / per_photon,
                "photons",
                _CLOSED_FORM,
                "without noise, of this pulse",
            ),
            ("threshold_over_noise", "threshold over noise", gsfl.threshold_over_noise, "", _CLOSED_FORM, ""),
        ]
    figures.append(
        (
            "saturation_photons",
            "photons that saturate",
            find_saturation_photons(gsfl, pulse),
            "photons",
            _CLOSED_FORM,
            "photons of this pulse whose peak reaches the converter's full scale, or the amplifier's rail",
        )
    )
    return [CameraFigure(*figure[:5], formula=figure[5]) for figure in figures]


def _list_coupling(gsfl: Gsfl, threshold_photons: float) -> Iterator[CameraFigure]:
    """Yield the crosstalk in amplitude by distance, and the light in one pixel that triggers its neighbour in the dark."""
    coupled = gsfl.amplitude_crosstalk
    if coupled is None:
        return
    over = "amplitude over that of the bright pixel, along " + {"both": "rows and columns"}.get(
        coupled.along, coupled.along
    )
    for distance, level_db in enumerate(coupled.level_db, 1):
        yield CameraFigure(
            f"amplitude_crosstalk_{distance}_db",
            f"crosstalk, {distance} pixel{'s' * (distance > 1)} away",
            level_db,
            "dB",
            _SETTING,
            formula=over,
        )
    if math.isnan(threshold_photons):
        return
    share = 10.0 ** (max(coupled.level_db) / 20.0)
    needed = threshold_photons / share
    if gsfl.saturation is not None and gsfl.saturation.rail_electrons * share < gsfl.trigger.threshold_electrons:
        needed = math.inf  # the amplifier clips before
    yield CameraFigure(
        "crosstalk_at_threshold_photons",
        "photons that trigger a neighbour",
        needed,
        "photons",
        _CLOSED_FORM,
        formula="in one pixel, of which a dark pixel shows its threshold, without noise",
    )


def _list_array(gsfl: Gsfl, n_pixels: int) -> Iterator[CameraFigure]:
    """Yield what the array does to its pixels, and how many of them work."""
    shared = gsfl.crosstalk
    if shared is not None and gsfl.gate is None:
        together = "where all pixels latch within one clock, 1 sigma"
        yield CameraFigure(
            "crosstalk_noise_m", "range noise by crosstalk", shared.noise_m, "m", _SETTING, formula=together
        )
        offset_m = shared.offset_m * (1.0 - shared.calibrated_fraction)
        yield CameraFigure(
            "crosstalk_offset_m", "range shift by crosstalk", offset_m, "m", _CLOSED_FORM, formula=together
        )
    pixels = draw_camera_pixels(gsfl, n_pixels)
    operable = 1.0 - float((pixels.dead | pixels.hot).mean())
    is_measured = gsfl.maps is not None and gsfl.maps.file is not None
    origin = "measured maps" if is_measured else f"map of camera_seed {gsfl.camera_seed}"
    formula = f"share of {n_pixels:,} pixels that are neither dead nor hot, in the {origin}"
    yield CameraFigure("operability_fraction", "operability", operable, "", "map of defects", formula=formula)


def _list_empirical(empirical: Empirical) -> list[CameraFigure]:
    """List the figures of the empirical detector, whose curves are settings."""
    figures = [
        ("excess_noise_factor", "effective excess noise factor", empirical.excess_noise_factor, "", _SETTING),
        (
            "noise_equivalent_photons",
            "noise-equivalent photons",
            empirical.noise_equivalent_photons,
            "photons",
            _SETTING,
        ),
        ("threshold_photons", "threshold", empirical.threshold_photons, "photons", _CLOSED_FORM),
        ("saturation_photons", "photons that saturate", empirical.saturation_photons, "photons", _CLOSED_FORM),
    ]
    return [CameraFigure(*figure) for figure in figures]


def _list_geiger(array: GeigerArray, wavelength_m: float) -> list[CameraFigure]:
    """List the figures of the Geiger-mode array, whose noise is that of its dark counts."""
    efficiency, dark_hz = array.detection_efficiency, array.dark_count_rate_hz
    nep = units.photon_energy_j(wavelength_m) * math.sqrt(2.0 * dark_hz) / efficiency
    noise_photons = math.sqrt(array.pulses * dark_hz * array.peak_s) / (array.pulses * efficiency)
    full = array.traits.saturation_photons
    figures = [
        ("detection_efficiency", "photon detection efficiency", efficiency, "", _SETTING, ""),
        ("dark_count_rate_hz", "dark counts of a pixel", dark_hz, "Hz", _SETTING, ""),
        ("nep_w_per_sqrt_hz", "NEP of the dark counts", nep, "W/√Hz", _CLOSED_FORM, "h ν √(2 D) / PDE"),
        (
            "noise_equivalent_photons",
            "noise-equivalent photons",
            noise_photons,
            "photons",
            _CLOSED_FORM,
            "of each pulse: rms dark counts in a peak of a frame, over counts per photon",
        ),
        ("least_counts", "least counts of a peak", array.dark_least_counts, "counts", _CLOSED_FORM, ""),
        (
            "saturation_photons",
            "photons that saturate",
            full,
            "photons",
            _CLOSED_FORM,
            "of each pulse: all pulses count",
        ),
    ]
    return [CameraFigure(*figure[:5], formula=figure[5]) for figure in figures]


def _list_false_alarms(detector: AnyDetector, n_pixels: int) -> Iterator[CameraFigure]:
    """Yield the false alarms of a pixel and second, and of a frame, in the dark."""
    pixel, frame = "false alarms of an armed pixel", "false alarms of a frame"
    to_m = detector.traits.sees_to_m
    if isinstance(detector, Gsfl) and detector.gate is None:
        least = _LEAST_TRUE if detector.apd.statistics == "mcintyre" else 1.0
        rate = mean_false_alarms_per_s(detector)
        each = float(false_alarm_probability(detector, np.array([to_m]))[0]) * n_pixels
        for name, meaning, value, unit in (
            ("false_alarms_per_s", pixel, rate, "1/s"),
            ("false_alarms_per_frame", frame, each, ""),
        ):
            yield CameraFigure(name, meaning, value, unit, _CLOSED_FORM, least * value, value, _RICE)
        return
    if isinstance(detector, Empirical):
        yield CameraFigure("false_alarms_per_s", pixel, detector.false_alarms_per_s, "1/s", _SETTING)
    if isinstance(detector, GeigerArray):
        rate = float(detector.false_peak_probability(np.zeros(1))[0]) / (detector.pulses * detector.gate_s)
        yield CameraFigure("false_alarms_per_gate_s", "false alarms, second of gate", rate, "1/s", _CLOSED_FORM)
    if math.isfinite(to_m):
        share = float(false_alarm_probability(detector, np.array([to_m]))[0])
        if not isinstance(detector, Gsfl | Empirical | GeigerArray) and not detector.traits.is_gated and share < 1.0:
            armed_s = (to_m - detector.traits.sees_from_m) / units.RANGE_PER_DELAY_M_S
            one_rate = "from the share of pixels that report one, as if all had one rate"
            rate = -math.log1p(-share) / armed_s
            yield CameraFigure("false_alarms_per_s", pixel, rate, "1/s", "its own", formula=one_rate)
        yield CameraFigure("false_alarms_per_frame", frame, share * n_pixels, "", _CLOSED_FORM)

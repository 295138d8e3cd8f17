"""What a lidar gets of a plate that it passes: photons, pixels, sunlight, and the probability that it is found at all.

The plate is a square that faces the lidar. Its light is that of the link budget. A flash finds it if at least as many pixels
report it as the scenario's `finding` asks for. Light and sunlight count at the range and phase of each instant. The range
rate spreads the returns of a detector that adds up several pulses.
"""

from __future__ import annotations

import math
import numbers
from dataclasses import dataclass, replace

import numpy as np

from rso_lidar import units
from rso_lidar.detector import false_alarm_probability, k_of_n, make_plate, predict, report_probability
from rso_lidar.errors import ScenarioError
from rso_lidar.mission_analysis.budgets.pixel_light import compute_photons, pixel_width_m
from rso_lidar.mission_analysis.passes.exclusion import TOGETHER_M, ExclusionAngles
from rso_lidar.optics import sun_photons_per_s_m2
from rso_lidar.orbit import phase_angle_rad, sunlit_fraction
from rso_lidar.scenario import Finding, Lidar
from rso_lidar.scene import Lambertian

SIDE_M, REFLECTANCE, FLASH_RATE_HZ = 1.0, 0.30, 1.0  # assumed where nothing is given; the reflectance of Fuller et al.
_LEAST_SHARE = 0.01  # of the threshold's photons: below it the light adds nothing to false triggers, which do not count
_GATED_NEAR_M = 1.0  # assumed: a gate opens after the pulse has left, 7 ns for 1 m
_AT_ONCE = 20_000  # instants in one call of a detector
_FLASHES = 64  # in one call, each on all pixels of the mean
_PIXELS = 256  # of the camera, over which the probability is averaged: thresholds differ from pixel to pixel
_PROBES = 4  # of them that tell whether the probability depends on the pixel
_ALIKE = 1e-4  # difference of their probabilities below which it does not
_PHASES = 16  # of the flashes over which the mean is taken: a stay shorter than a frame is right within 1/16
_MANY = 64.0  # flashes in a stay from which a sum over flashes is an integral, within half a flash of 64
_CERTAIN = 1e-12  # keeps the logarithm of the probability of a miss finite


@dataclass(frozen=True)
class ViewedPlate:
    """A plate that faces the lidar, and how often it is looked at; None where nothing is given, and a value is assumed.

    Parameters
    ----------
    side_m : side of the square [m]
    reflectance : Lambertian
    flash_rate_hz : flashes per second [Hz]
    """

    side_m: float | None = None
    reflectance: float | None = None
    flash_rate_hz: float | None = None

    def __post_init__(self) -> None:
        for what, unit, value, most in (
            ("target_size", "m", self.side_m, 1e4),
            ("flash_rate", "Hz", self.flash_rate_hz, 1e6),
            ("reflectance", "", self.reflectance, 1.0),
        ):
            is_number = isinstance(value, numbers.Real) and not isinstance(value, bool)
            if value is not None and not (is_number and 0.0 < float(value) <= most):
                shown = f"{value:g}" if is_number else f"{value!r:.40}"
                raise ScenarioError(
                    f"{what}: {shown} is out of range; give more than 0 and at most {most:g} {unit}".rstrip()
                )

    @property
    def values(self) -> tuple[float, float, float]:
        """Side [m], reflectance and flashes per second [Hz], those that are assumed included."""
        given = (self.side_m, self.reflectance, self.flash_rate_hz)
        return tuple(  # type: ignore[return-value]
            float(assumed if value is None else value)
            for value, assumed in zip(given, (SIDE_M, REFLECTANCE, FLASH_RATE_HZ), strict=True)
        )

    def describe(self, *, with_rate: bool = True) -> str:
        """Describe the plate in a few words, with what is assumed.

        Parameters
        ----------
        with_rate : whether to state how often it is looked at too

        Returns
        -------
        str
        """
        given = (self.side_m, self.reflectance, self.flash_rate_hz)
        texts = ("a facing square plate of {:g} m side", "reflectance {:g}", "flashes at {:g} Hz")
        return ", ".join(
            text.format(value) + (" (assumed)" if known is None else "")
            for text, value, known in list(zip(texts, self.values, given, strict=True))[: 3 if with_rate else 2]
        )


class PlateLight:
    """What one lidar gets of a plate.

    Parameters
    ----------
    lidar : the instrument
    plate : the plate
    finding : when it counts as found
    """

    def __init__(self, lidar: Lidar, plate: ViewedPlate, finding: Finding) -> None:
        self.lidar, self.plate, self.finding = lidar, plate, finding
        self._side_m, self._reflectance, self._rate_hz = plate.values
        self._material = Lambertian(reflectance=self._reflectance)
        filter_nm = lidar.receiver.filter_width_nm
        self.has_sunlight = filter_nm is not None
        self._sun_per_s_m2 = (
            0.0 if filter_nm is None else sun_photons_per_s_m2(lidar.laser.wavelength_m, filter_nm * units.NM)
        )

    def count_photons(self, range_m: np.ndarray) -> np.ndarray:
        """Return the expected photons (…) of the brightest pixel at some ranges (…) [m].

        The lidar equation holds at ranges that are large beside the aperture. Nearer, the energy of the pulse is the bound.
        """
        at_m = np.maximum(np.asarray(range_m, dtype=float), 1e-3)
        photons, _ = compute_photons(
            self.lidar.laser, self.lidar.receiver, self._material, 0.0, at_m.ravel(), self._side_m**2
        )
        most = self.lidar.laser.photons * self.lidar.receiver.transmission
        return np.minimum(photons.reshape(at_m.shape), most)

    def count_pixels(self, range_m: np.ndarray) -> np.ndarray:
        """Return the pixels (…) that the plate covers at some ranges (…) [m], a part of one where it is smaller."""
        receiver = self.lidar.receiver
        wide = np.maximum(np.asarray(range_m, dtype=float), 1e-3)
        across = self._side_m / pixel_width_m(receiver, wide)
        covered: np.ndarray = np.minimum(across, receiver.n_rows) * np.minimum(across, receiver.n_cols)
        return covered

    def count_sunlight(self, range_m: np.ndarray, phase_rad: np.ndarray, sunlit: np.ndarray) -> np.ndarray:
        """Return the sunlight (…) of the plate in its brightest pixel [photons/s]; 0 without a filter in the receiver.

        Parameters
        ----------
        range_m : (…) ranges [m]
        phase_rad : (…) angles at the plate between the Sun and the lidar [rad]
        sunlit : (…) share of the Sun's disc that lights it
        """
        receiver = self.lidar.receiver
        per_pixel = self._sun_per_s_m2 * receiver.aperture_area_m2 * receiver.transmission * receiver.pixel_tangent**2
        falls = np.maximum(np.cos(phase_rad), 0.0) * sunlit
        rate: np.ndarray = per_pixel * self._reflectance / math.pi * falls * np.minimum(self.count_pixels(range_m), 1.0)
        return np.where(np.isfinite(rate), rate, 0.0)

    def find_in_flash(self, range_m: np.ndarray, rate_m_s: np.ndarray, sunlight_per_s: np.ndarray) -> np.ndarray:
        """Return the probability (instant) that one flash finds the plate, wherever its image falls.

        Thresholds differ from pixel to pixel. The probability of a pixel is therefore the mean over the same 256 pixels at
        each instant, and the pixels that the plate covers count as drawn from them independently.

        Parameters
        ----------
        range_m, rate_m_s : (instant) range [m] and range rate [m/s]
        sunlight_per_s : (instant) sunlight in a pixel [photons/s]
        """
        probability = np.zeros(len(range_m))
        traits = self.lidar.detector.traits
        photons = self.count_photons(range_m)
        near_m, far_m = (_GATED_NEAR_M, math.inf) if traits.is_gated else (traits.sees_from_m, traits.sees_to_m)
        some = np.flatnonzero(
            (range_m >= near_m) & (range_m <= far_m) & (photons > _LEAST_SHARE * traits.threshold_photons)
        )
        for begin in range(0, len(some), _AT_ONCE):
            lot = some[begin : begin + _AT_ONCE]
            of_pixel = self._average_pixels(photons[lot], range_m[lot], rate_m_s[lot], sunlight_per_s[lot])
            pixels = np.maximum(self.count_pixels(range_m[lot]).astype(np.int64), 1)
            enough = pixels >= self.finding.pixels
            each = np.clip(of_pixel, 0.0, 1.0)
            probability[lot] = np.where(
                enough, k_of_n(each, self.finding.pixels, np.maximum(pixels, self.finding.pixels)), 0.0
            )
        return probability

    def _average_pixels(
        self, photons: np.ndarray, range_m: np.ndarray, rate_m_s: np.ndarray, sunlight_per_s: np.ndarray
    ) -> np.ndarray:
        """Return the mean probability (instant) that a pixel of the camera reports the plate."""
        detector = self.lidar.detector
        spread_s = np.abs(rate_m_s) * self.lidar.exposure_s / units.RANGE_PER_DELAY_M_S
        inputs = photons, range_m, spread_s, sunlight_per_s
        probes = None if detector.traits.is_gated else self._list_pixels(*(np.repeat(of, _PROBES) for of in inputs))
        if probes is not None:
            probes = probes.reshape(-1, _PROBES)
            mean: np.ndarray = probes.mean(axis=1)
            unlike = np.flatnonzero(np.ptp(probes, axis=1) > _ALIKE)
            for begin in range(0, len(unlike), _FLASHES):
                some = unlike[begin : begin + _FLASHES]
                pixels = self._list_pixels(*(np.repeat(of[some], _PIXELS) for of in inputs), flashes=len(some))
                if pixels is not None:
                    mean[some] = pixels.reshape(-1, _PIXELS).mean(axis=1)
            return mean
        # a gate is placed about the plate at any range; sunlight is not counted here
        reported = predict(detector, self.lidar.pulse, photons, spread_s, only_probability=True).probability
        quiet: np.ndarray = reported * (1.0 - false_alarm_probability(detector, range_m))
        return quiet

    def _list_pixels(
        self,
        photons: np.ndarray,
        range_m: np.ndarray,
        spread_s: np.ndarray,
        sunlight_per_s: np.ndarray,
        *,
        flashes: int = 1,
    ) -> np.ndarray | None:
        """Return the probability (pixel) that each of the first pixels of a camera reports a plate of its own.

        Without a closed form of the detector there is none. Arrays are (pixel).

        Parameters
        ----------
        flashes : number of flashes, whose pixels are listed one flash after another; 1 by default
        """
        laser = self.lidar.laser
        nearest_m = np.maximum(range_m - 0.5, 0.0)
        light = make_plate(photons, len(photons), laser.pulse, laser.pulse_fwhm_s, nearest_m, flashes)
        light = replace(
            light,
            depth_spread_s=spread_s,
            background_photons_per_s=sunlight_per_s[None] if self.has_sunlight else None,
        )
        return report_probability(self.lidar.detector, light, np.ones(len(photons), dtype=bool), flashes)

    def find_over_stay(self, time_s: np.ndarray, probability: np.ndarray) -> float:
        """Return the probability that the plate is found at all, the mean over the phase of the flashes.

        Flashes are independent. Where `finding` asks for k of n flashes, the stay is divided into groups of n.

        Parameters
        ----------
        time_s : (instant) ascending times [s]
        probability : (instant) probability that one flash finds it, 0 where it cannot be looked at
        """
        finding = self.finding
        group = np.clip(k_of_n(probability, finding.needed, finding.flashes), 0.0, 1.0 - _CERTAIN)
        missed = np.log1p(-group)
        if not missed.any():
            return 0.0
        rate_hz, begin_s, end_s = self._rate_hz / finding.flashes, float(time_s[0]), float(time_s[-1])
        if rate_hz * (end_s - begin_s) > _MANY:
            return float(-np.expm1(rate_hz * np.trapezoid(missed, time_s)))
        steps = np.arange(math.ceil(rate_hz * (end_s - begin_s)) + 1)
        flashes_s = begin_s + (steps[:, None] + (np.arange(_PHASES) + 0.5) / _PHASES) / rate_hz
        sums = np.interp(flashes_s, time_s, missed, right=0.0).sum(axis=0)
        return float(np.mean(-np.expm1(sums)))

    def describe(self) -> list[str]:
        """Describe what the columns of light assume, in lines for the notes of a table."""
        why = "the detector is gated" if self.lidar.detector.traits.is_gated else ""
        why = why if self.has_sunlight else "the receiver has no filter_width_nm"
        sun = f"sunlight not counted: {why}" if why else "sunlight on it counted"
        return [
            f"photons, pixels and found: {self.plate.describe()}; {sun}; found: by {self.finding.describe()}, at any time "
            "of the stay in which slew and exclusion angles allow a look"
        ]


def tabulate_light(
    light: PlateLight,
    sky: ExclusionAngles,
    time_s: np.ndarray,
    geometry: tuple[np.ndarray, np.ndarray, np.ndarray],
    allowed: np.ndarray,
    middle: np.ndarray,
) -> dict[str, np.ndarray]:
    """Tabulate (stay) what the lidar gets of a plate, at the closest approach and over each stay; NaN where they are one.

    Parameters
    ----------
    time_s : (stay, instant) times [s]
    geometry : relative positions [m] and velocities [m/s], and positions of the follower [m], all (stay, instant, 3) in TEME
        axes
    allowed : (stay, instant) whether slew and exclusion angles allow a look
    middle : (stay) number of the instant of the closest approach
    """
    line, rate, place = geometry
    apart = np.sqrt(np.einsum("nti,nti->nt", line, line))
    closing = np.einsum("nti,nti->nt", line, rate) / np.maximum(apart, TOGETHER_M)
    sunlight = np.zeros(apart.shape)
    if light.has_sunlight:
        sun_m, target_m = sky.sun_position_m(time_s), place + line
        sunlight = light.count_sunlight(
            apart, phase_angle_rad(target_m, place, sun_m), sunlit_fraction(target_m, sun_m)
        )
    flash = light.find_in_flash(apart.ravel(), closing.ravel(), sunlight.ravel()).reshape(apart.shape)
    looked = np.where(allowed, flash, 0.0)
    each = np.arange(len(middle))
    columns = {
        "photons": light.count_photons(apart[each, middle]),
        "target_pixels": light.count_pixels(apart[each, middle]),
        "background_photons_per_s": sunlight[each, middle],
        "detection_probability": flash[each, middle],
        "best_probability": looked.max(axis=1),
        "found_probability": np.array(
            [light.find_over_stay(times, probability) for times, probability in zip(time_s, looked, strict=True)]
        ),
    }
    together = apart[each, middle] < TOGETHER_M  # one object under two names: there is nothing to see
    return {name: np.where(together, np.nan, column) for name, column in columns.items()}

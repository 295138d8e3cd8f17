"""The pulsed laser: how many photons leave, how they spread over the tangent plane, and when."""

import math
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.optics.tables.laser_profiles import find_full_width_s, read_pattern, read_pulse
from rso_lidar.optics.tables.number_text import cache_by_file
from rso_lidar.part import NotNegative, Number, Part, Positive, Text, Vector

Divergence = Annotated[Positive, Field(lt=180)]
_TAPS_PER_FWHM = 48
_MOST_TAPS = 4096  # to each side of a measured pulse


class Laser(Part):
    """Pulsed laser that lights the scene along the lidar's boresight: one pulse for each frame, or those of its detector.

    `divergence_deg` is a full angle: edge to edge of a square or circular footprint, the 1/e² width of a Gaussian one.
    A ``pattern`` measured in `pattern_file` (an image or a table of numbers) fills the square of that angle. The
    footprint ``as_printed`` is the square of Fuller et al., eq. 7, as printed, which returns four times the energy
    sent.

    The pulse of `pulse_fwhm_ns` is Gaussian, or super-Gaussian exp(−|t/a|^2p) with p = `pulse_order`. A ``measured``
    pulse comes from `pulse_file` (columns time_ns, power), which also sets its width. `offset_m` is the position of the
    laser relative to the lens, in lidar axes. `energy_jitter_fraction` and `timing_jitter_ns` are 1 sigma from pulse to
    pulse, unknown to the receiver.

    Where the detector takes several pulses for a frame, `pulse_rate_hz` spreads them over time, and targets, follower and
    PTU move from one to the next. Without it they are all sent at the time of the frame.
    """

    wavelength_nm: Positive = Field(
        default=1064.0,
        description="Wavelength in vacuum [nm]. Default: Fuller et al., sec. 3.1.4 and 5; the other band is 1570 nm.",
    )
    energy_mj: Positive = Field(
        default=50.0, description="Energy of one pulse where it leaves the laser [mJ]. Default: Fuller et al., sec. 5."
    )
    pulse_fwhm_ns: Positive = Field(
        default=8.0,
        description=(
            "Full width of the pulse at half maximum [ns]. Default: assumed; Fuller et al., sec. 3.1.4, give 6 to 10 "
            "ns."
        ),
    )
    pulse_shape: Literal["gaussian", "super_gaussian", "measured"] = Field(
        default="gaussian", description="Shape of the power over time. Default: assumed."
    )
    pulse_order: Annotated[Number, Field(ge=1, le=20)] = Field(
        default=2.0,
        description=(
            "Order p of a super-Gaussian; 1 is a Gaussian, higher orders are flatter. Default: a choice, used by "
            "`super_gaussian` alone."
        ),
    )
    pulse_file: Text | None = Field(
        default=None,
        description=(
            "Path of a measured pulse with the columns time_ns and power. Its own width replaces `pulse_fwhm_ns`."
        ),
    )
    divergence_deg: Divergence = Field(
        default=2.5,
        description="Full divergence angle, edge to edge, or 1/e² of a Gaussian [deg]. Default: Fuller et al., sec. 5.",
    )
    footprint: Literal["square", "circle", "gaussian", "pattern", "as_printed"] = Field(
        default="square",
        description=(
            "Distribution of the energy over the plane across the boresight. `as_printed` follows eq. 7 of Fuller et "
            "al. literally, which is four times too bright. Default: a square diffuser (Fuller et al., sec. 3.2)."
        ),
    )
    pattern_file: Text | None = Field(
        default=None,
        description=(
            "Path of a measured footprint, a grey image or a table of numbers. It fills the square of the full "
            "divergence angle."
        ),
    )
    offset_m: Vector = Field(
        default=(0.0, 0.0, 0.0),
        description=(
            "Position of the laser relative to the lens, in lidar axes [m]. If not zero, the laser's own shadows and "
            "angles count. Default: a choice, at the lens, as in eq. 7 of Fuller et al."
        ),
    )
    energy_jitter_fraction: Annotated[NotNegative, Field(le=0.5)] = Field(
        default=0.0,
        description="Fluctuation of the pulse energy from pulse to pulse, 1 sigma over the mean. Default: a choice.",
    )
    timing_jitter_ns: NotNegative = Field(
        default=0.0,
        description="Jitter of the emission time, 1 sigma, unknown to the receiver [ns]. Default: a choice.",
    )

    pulse_rate_hz: Positive | None = Field(
        default=None,
        description=(
            "Pulses a second within a frame, for a detector that takes several [Hz]. If omitted, all pulses of a frame are "
            "sent at its time, and nothing moves between them. Default: a choice."
        ),
    )

    @model_validator(mode="after")
    def _check_files(self) -> Self:
        for what, needs, name in (
            ("pulse_shape 'measured'", self.pulse_shape == "measured", "pulse_file"),
            ("footprint 'pattern'", self.footprint == "pattern", "pattern_file"),
        ):
            given = getattr(self, name) is not None
            if needs and not given:
                raise ValueError(f"{what} needs {name}; give the path of the file")
            if given and not needs:
                raise ValueError(f"{name} is given but not used; set {what}, or leave it out")
        return self

    @property
    def wavelength_m(self) -> float:
        """Vacuum wavelength [m]."""
        return self.wavelength_nm * units.NM

    @cached_property
    def photons(self) -> float:
        """Number of photons in one pulse (E_tx of Fuller et al., in photons)."""
        return self.energy_mj * units.MJ / units.photon_energy_j(self.wavelength_m)

    @property
    def pulse_fwhm_s(self) -> float:
        """Full width of the pulse at half maximum [s]; a measured pulse has its own."""
        if self.pulse_shape != "measured":
            return self.pulse_fwhm_ns * units.NS
        assert self.pulse_file is not None
        return _measured_width_s(self.pulse_file)

    @property
    def pulse(self) -> tuple[float, np.ndarray]:
        """Step [s] and taps (tap) of the pulse: power over energy [1/s], the middle tap at time zero."""
        if self.pulse_shape == "measured":
            assert self.pulse_file is not None
            return _measured_taps(self.pulse_file)
        order = 1.0 if self.pulse_shape == "gaussian" else self.pulse_order
        return _taps(self.pulse_fwhm_ns * units.NS, order)

    @property
    def offset(self) -> np.ndarray | None:
        """Position of the laser in lidar axes (xyz) [m]; None at the lens."""
        return np.array(self.offset_m) if any(self.offset_m) else None

    @property
    def has_jitter(self) -> bool:
        """Whether energy or timing differ from pulse to pulse."""
        return self.energy_jitter_fraction > 0.0 or self.timing_jitter_ns > 0.0

    def fire(self, rng: np.random.Generator) -> "tuple[Laser, float]":
        """Draw the energy and the timing of one pulse.

        Parameters
        ----------
        rng : source of the random numbers; not used without jitter

        Returns
        -------
        The laser with the energy of this pulse, and how late the pulse left [s].
        """
        if not self.has_jitter:
            return self, 0.0
        energy, late = rng.standard_normal(2)
        factor = max(1.0 + self.energy_jitter_fraction * energy, 1e-3)
        return self.replace(energy_mj=self.energy_mj * factor), float(late) * self.timing_jitter_ns * units.NS

    def fire_pulses(self, rng: np.random.Generator, pulses: int) -> "tuple[Laser, float, np.ndarray | None]":
        """Draw energy and timing of the pulses of one frame, each by itself.

        Parameters
        ----------
        rng : source of the random numbers; not used without jitter
        pulses : number of pulses

        Returns
        -------
        The laser with the mean energy of these pulses, how late they left on average [s], and for each pulse (2, pulse) its
        energy over the mean and its delay beyond the mean [s]. That is None for one pulse, and without jitter.
        """
        if pulses == 1 or not self.has_jitter:
            return *self.fire(rng), None
        energy, late = rng.standard_normal((2, pulses))
        energy = np.maximum(1.0 + self.energy_jitter_fraction * energy, 1e-3)
        late_s = late * (self.timing_jitter_ns * units.NS)
        mean, mean_s = float(energy.mean()), float(late_s.mean())
        return self.replace(energy_mj=self.energy_mj * mean), mean_s, np.stack([energy / mean, late_s - mean_s])

    @property
    def divergence_rad(self) -> float:
        """Full angle of the beam [rad]."""
        return self.divergence_deg * units.DEG

    @cached_property
    def half_width_tangent(self) -> float:
        """Half the footprint's width in the tangent plane at unit distance: tan(θ/2)."""
        return math.tan(0.5 * self.divergence_rad)

    def is_lit(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return whether the footprint covers points of the tangent plane; a Gaussian covers all.

        Parameters
        ----------
        x, y : coordinates in the tangent plane, broadcast together
        """
        if self.footprint == "gaussian":
            return np.ones(np.broadcast(x, y).shape, dtype=bool)
        if self.footprint == "circle":
            inside: np.ndarray = x * x + y * y <= self.half_width_tangent**2
        else:
            inside = (np.abs(x) <= self.half_width_tangent) & (np.abs(y) <= self.half_width_tangent)
        return inside

    def density(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return photons per unit area of the tangent plane at (x, y), whose integral is `photons`.

        Square E/(4t²), circle E/(πt²), Gaussian 2E/(πt²)·exp(−2r²/t²), with t = tan(θ/2). ``as_printed`` is E/t²
        (Fuller et al., eq. 7).

        Parameters
        ----------
        x, y : coordinates in the tangent plane, broadcast together

        Returns
        -------
        photons per unit area of the tangent plane.

        Examples
        --------
        >>> laser = Laser(divergence_deg=2.5)
        >>> float(laser.density(0.0, 0.0) * (2 * laser.half_width_tangent) ** 2 / laser.photons)
        1.0
        """
        if self.footprint == "pattern":
            return self._pattern_density(x, y)
        if self.footprint == "gaussian":
            bell: np.ndarray = self.density_on_axis * np.exp(-2.0 * (x * x + y * y) / self.half_width_tangent**2)
            return bell
        return np.where(self.is_lit(x, y), self.density_on_axis, 0.0)

    @cached_property
    def density_on_axis(self) -> float:
        """Photons per unit area of the tangent plane in the middle of the beam; of a ``pattern``, the mean."""
        t2 = self.half_width_tangent**2
        area = {"square": 4.0 * t2, "circle": math.pi * t2, "gaussian": 0.5 * math.pi * t2, "as_printed": t2}
        return self.photons / area.get(self.footprint, 4.0 * t2)

    def _pattern_density(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return the density of a measured pattern, constant over each of its cells."""
        rows, cols = self._pattern.shape
        t = self.half_width_tangent
        row = np.clip(((np.asarray(y) / t + 1.0) * 0.5 * rows).astype(np.int64), 0, rows - 1)
        col = np.clip(((np.asarray(x) / t + 1.0) * 0.5 * cols).astype(np.int64), 0, cols - 1)
        cell = 4.0 * t * t / (rows * cols)
        density: np.ndarray = np.where(self.is_lit(x, y), self._pattern[row, col] * (self.photons / cell), 0.0)
        return density

    @property
    def cell_tangent(self) -> float:
        """Side of a cell of a measured pattern in the tangent plane; infinite without a pattern."""
        if self.footprint != "pattern":
            return math.inf
        return 2.0 * self.half_width_tangent / float(max(self._pattern.shape))

    @cached_property
    def _pattern(self) -> np.ndarray:
        assert self.pattern_file is not None
        return read_pattern(self.pattern_file)


@lru_cache(maxsize=16)
def _taps(fwhm_s: float, order: float) -> tuple[float, np.ndarray]:
    step_s = fwhm_s / _TAPS_PER_FWHM
    # A Gaussian is 1e-16 of its peak at 3.65 FWHM; higher orders end sooner.
    half = math.ceil(3.7 * _TAPS_PER_FWHM)
    time = np.arange(-half, half + 1) / (0.5 * _TAPS_PER_FWHM)
    power = np.exp(-math.log(2.0) * np.abs(time) ** (2.0 * order))
    power /= power.sum() * step_s
    power.flags.writeable = False
    return step_s, power


@cache_by_file(16)
def _measured_width_s(file: str) -> float:
    """Return the full width at half maximum of a measured pulse [s]."""
    return find_full_width_s(*read_pulse(file))


@cache_by_file(16)
def _measured_taps(file: str) -> tuple[float, np.ndarray]:
    """Sample a measured pulse at even steps about its centroid.

    Returns
    -------
    step [s], and power at each step (tap), whose integral is 1.

    Raises
    ------
    ScenarioError
        If the rows reach too far from the middle for the width of the pulse.
    """
    time_s, power = read_pulse(file)
    fwhm_s, reach_s = find_full_width_s(time_s, power), float(np.abs(time_s).max())
    half = min(math.ceil(reach_s / min(float(np.diff(time_s).min()), fwhm_s / _TAPS_PER_FWHM)), _MOST_TAPS)
    if reach_s / half > fwhm_s / 8.0:
        raise ScenarioError(
            f"{Path(file).name}: the pulse is {fwhm_s / units.NS:.3g} ns wide and its rows extend "
            f"{reach_s / units.NS:.3g} ns from its middle; shorten its tails"
        )
    step_s = reach_s / half
    time = np.arange(-half, half + 1) * step_s
    taps = np.interp(time, time_s, power, left=0.0, right=0.0)
    taps = np.interp(time + float(np.average(time, weights=taps)), time_s, power, left=0.0, right=0.0)
    taps /= taps.sum() * step_s
    taps.flags.writeable = False
    return step_s, taps

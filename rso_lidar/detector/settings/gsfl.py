"""Settings of the full detector: APDs that trigger, sample and convert (Fuller et al., sec. 3.2, 3.3 and 6)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cached_property
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from rso_lidar import units
from rso_lidar.detector.settings.algorithm import Ranging
from rso_lidar.detector.settings.amplifier import Amplifier
from rso_lidar.detector.settings.apd import Apd, noise_rms
from rso_lidar.detector.settings.data_sheet import DataSheet, fill_amplifier, fill_apd, fill_quantum_efficiency
from rso_lidar.detector.settings.focal_plane import (
    AmplitudeCrosstalk,
    Bloom,
    Crosstalk,
    Defects,
    Droop,
    Maps,
    Saturation,
    Speckle,
    Timing,
)
from rso_lidar.detector.settings.gate import Gate
from rso_lidar.detector.settings.presets import DETECTOR_PRESETS, SOLVED_CONSTANTS
from rso_lidar.detector.settings.readout import Readout
from rso_lidar.detector.settings.report import ReportWords
from rso_lidar.detector.settings.threshold_condition import ThresholdCondition
from rso_lidar.detector.settings.traits import DetectorTraits
from rso_lidar.detector.settings.trigger import Trigger
from rso_lidar.detector.settings.zero_crossing import ZeroCrossing
from rso_lidar.errors import ScenarioError
from rso_lidar.part import Fraction, NotNegative, Part, Positive, Whole

_SPOILT = 30.0  # times the saturation: from there on, the samples that do not clip no longer give the range
_EDGES = 6.5  # pulses behind the latch that hold both edges of a return up to 1e8 times the saturation
_BETWEEN_PIXELS = ("bloom", "droop", "crosstalk", "amplitude_crosstalk")  # parts that couple pixels
# Entries of a data sheet with the part and the key that they determine.
_DETERMINED: tuple[tuple[str, str | None, str], ...] = (
    ("responsivity_a_per_w", None, "quantum_efficiency"),
    ("excess_noise_factor", "apd", "ionisation_ratio"),
    ("noise_bandwidth_mhz", "amplifier", "bandwidth_mhz"),
    ("rise_time_ns", "amplifier", "bandwidth_mhz"),
    ("noise_pa_per_sqrt_hz", "amplifier", "noise_electrons"),
    ("nep_w_per_sqrt_hz", "amplifier", "noise_electrons"),
)


def _is_stated(given: dict[str, Any], key: str) -> bool:
    """Return whether a data sheet or a condition in a table of the detector states a constant of the preset."""
    return any(key == filled for _, filled in list_determined(given))


def list_determined(given: Mapping[str, Any]) -> list[tuple[str | None, str]]:
    """List the keys that a data sheet or a condition in a table of the detector determines.

    Parameters
    ----------
    given : table of the detector

    Returns
    -------
    Part and key of each; the part is None for keys of the detector itself.
    """
    sheet = given.get("data_sheet")
    entries = sheet.model_dump(exclude_none=True) if isinstance(sheet, Part) else sheet
    keys = [(part, key) for entry, part, key in _DETERMINED if isinstance(entries, Mapping) and entry in entries]
    return keys + ([("trigger", "threshold_electrons")] if given.get("solve") is not None else [])


class Gsfl(Part):
    """The focal plane of a global shutter flash lidar, from photons to counts (Fuller et al., sec. 3.2 and 3.3).

    Noise comes from the stages: detection, range precision, range walk and dropouts are results. `preset` chooses the
    amplifier's noise and the threshold. Both are solved once, so that 1000 photons are detected in 95 % of flashes
    (Fuller et al., sec. 3.3). ``noise_limited`` has threshold / noise = 6; ``offset_limited`` has a quiet amplifier under
    a high threshold. Other settings change the result; nothing is solved again.

    A pixel triggers on the first crossing between `armed_from_m` and `armed_to_m` and stores a few samples about it. Under a
    `gate` all pixels store the same samples and none triggers. `returns` selects which of the returns in these samples is
    reported as range and intensity; up to `max_returns` are listed beside it. `camera_seed` draws what is fixed in a camera:
    thresholds, maps, defects. The gate and the parts after it are off unless given.
    """

    type: Literal["gsfl"] = "gsfl"
    preset: Literal["noise_limited", "offset_limited"] = Field(
        default="noise_limited",
        description=(
            "Calibrated pair of amplifier noise and threshold. Other settings change the result without a new "
            "calibration. Default: a choice, threshold / noise = 6, so that false triggers do not hide a distant "
            "target."
        ),
    )
    quantum_efficiency: Annotated[Fraction, Field(gt=0)] = Field(
        default=0.8,
        description=(
            "Photoelectrons per photon. Default: assumed, 0.7 to 0.85 is usual for InGaAs at 1064 nm; medium "
            "confidence."
        ),
    )
    armed_from_m: NotNegative = Field(
        default=1.0, description="Range at which the pixels are armed; nothing nearer triggers [m]. Default: assumed."
    )
    armed_to_m: Positive = Field(
        default=5000.0,
        description=(
            "Range at which the pixels are disarmed; nothing farther triggers [m]. Default: assumed; the introduction "
            "of Fuller et al. mentions 5 km."
        ),
    )
    returns: Literal["first", "strongest", "last"] = Field(
        default="first",
        description=(
            "Which return of a pixel is reported as its range and intensity. Default: assumed, a comparator that "
            "latches once."
        ),
    )
    max_returns: Annotated[Whole, Field(ge=1, le=8)] = Field(
        default=1, description="Greatest number of returns listed for a pixel. Default: a choice."
    )
    camera_seed: Annotated[Whole, Field(ge=0, lt=2**63)] = Field(
        default=0,
        description=(
            "Random seed of what is fixed in one camera: thresholds, maps and defects. It is independent of the "
            "scenario's seed. Default: a choice."
        ),
    )
    steps_per_sample: Annotated[Whole, Field(ge=2, le=64)] = Field(
        default=2,
        description=(
            "Minimum number of simulation steps per sample interval. Default: a choice of sampling, not of physics."
        ),
    )
    data_sheet: DataSheet | None = Field(
        default=None,
        description=(
            "Entries of a data sheet, which fill `quantum_efficiency`, `apd` and `amplifier`. If omitted, "
            "those are given themselves."
        ),
    )
    solve: ThresholdCondition | None = Field(
        default=None,
        description=(
            "Condition for which `trigger.threshold_electrons` is solved when the lidar is made, such as "
            "{ pd = 0.95, photons = 1000 }. If omitted, the threshold is that of the trigger."
        ),
    )
    apd: Apd = Field(default=Apd(), description="Avalanche photodiode: photoelectrons to electrons.")
    amplifier: Amplifier = Field(default=Amplifier(), description="Amplifier: electrons to an amplitude.")
    trigger: Trigger = Field(default=Trigger(), description="Comparator that latches a pixel.")
    readout: Readout = Field(default=Readout(), description="Stored samples and their converter.")
    ranging: Ranging = Field(default=Ranging(), description="Estimate of the range from the samples.")
    timing: Timing = Field(default=Timing(), description="Timing jitter of pixels and flashes.")
    zero_crossing: ZeroCrossing | None = Field(
        default=None,
        description=(
            "Timing channel that takes the range from the zero crossing of a bipolar pulse. If omitted, the range comes "
            "from the samples."
        ),
    )
    gate: Gate | None = Field(
        default=None, description="Range gate that replaces the trigger. If omitted, pixels trigger themselves."
    )
    maps: Maps | None = Field(
        default=None, description="Fixed patterns of gain, offset and time origin. If omitted, all pixels are equal."
    )
    defects: Defects | None = Field(default=None, description="Dead and hot pixels. If omitted, there are none.")
    saturation: Saturation | None = Field(
        default=None, description="Amplifier saturation. If omitted, the amplifier is linear."
    )
    bloom: Bloom | None = Field(
        default=None, description="Charge that full pixels spill to their neighbours. If omitted, there is none."
    )
    droop: Droop | None = Field(
        default=None,
        description="Sag of the APD bias under the current of the whole array. If omitted, the bias is constant.",
    )
    crosstalk: Crosstalk | None = Field(
        default=None, description="Range error of pixels that trigger together. If omitted, there is none."
    )
    amplitude_crosstalk: AmplitudeCrosstalk | None = Field(
        default=None,
        description="Share of the neighbours' amplitude that each pixel shows. If omitted, there is none.",
    )
    speckle: Speckle | None = Field(
        default=None, description="Interference of coherent light. If omitted, there is none."
    )
    report: ReportWords | None = Field(
        default=None,
        description="Integer words in which the camera reports its pixels. If omitted, the frame has numbers alone.",
    )

    @model_validator(mode="before")
    @classmethod
    def _preset(cls, given: Any) -> Any:
        if not isinstance(given, dict) or given.get("preset") != "offset_limited":  # the other's constants are defaults
            return given
        filled = dict(given)
        for part, key in SOLVED_CONSTANTS:
            if _is_stated(given, key):
                continue
            table = filled.get(part, {})
            if isinstance(table, dict):
                filled[part] = {key: DETECTOR_PRESETS[filled["preset"]][key], **table}
            elif isinstance(table, Part) and key not in table.model_fields_set:
                filled[part] = table.replace(**{key: DETECTOR_PRESETS[filled["preset"]][key]})
        return filled

    @model_validator(mode="after")
    def _read_data_sheet(self) -> Self:
        """Fill the keys that a data sheet determines, and keep nothing of it but its wavelength."""
        sheet = self.data_sheet
        if sheet is None or sheet.model_fields_set <= {"wavelength_nm"}:
            return self
        for entry, part, key in _DETERMINED:
            given = self if part is None else getattr(self, part)
            if getattr(sheet, entry) is not None and key in given.model_fields_set:
                place = key if part is None else f"{part}.{key}"
                raise ValueError(f"data_sheet.{entry} and {place} determine the same; leave one out")
        efficiency = fill_quantum_efficiency(sheet, self.quantum_efficiency)
        apd = fill_apd(sheet, self.apd)
        amplifier = fill_amplifier(sheet, self.amplifier, apd, efficiency)
        kept = None if sheet.wavelength_nm is None else DataSheet(wavelength_nm=sheet.wavelength_nm)
        filled = {"quantum_efficiency": efficiency, "apd": apd, "amplifier": amplifier, "data_sheet": kept}
        changed = {name: value for name, value in filled.items() if value is not getattr(self, name)}
        self.__dict__.update(changed)
        self.__pydantic_fields_set__.update(changed)
        return self

    @model_validator(mode="after")
    def _check_condition(self) -> Self:
        """Refuse a condition for a threshold that is given, or that a gate has not."""
        if self.solve is None:
            return self
        if self.gate is not None:
            raise ValueError(
                "solve and gate both determine what is reported; leave out solve: a gate has its own threshold"
            )
        if "threshold_electrons" in self.trigger.model_fields_set:
            raise ValueError("solve and trigger.threshold_electrons determine the same; leave one out")
        return self

    @model_validator(mode="after")
    def _sensible(self) -> Self:
        if self.armed_to_m <= self.armed_from_m:
            raise ValueError(f"armed_to_m ({self.armed_to_m:g}) must be beyond armed_from_m ({self.armed_from_m:g})")
        if self.gate is not None and self.gate.width_ns < 4.0 * self.readout.sample_ns:
            raise ValueError(
                f"gate.width_ns ({self.gate.width_ns:g}) holds fewer than 4 samples of "
                f"{self.readout.sample_ns:g} ns; widen it"
            )
        is_solved = self.solve is None  # else the rail is compared with the threshold that is solved
        rail = self.saturation.rail_electrons if self.saturation is not None and is_solved else math.inf
        if rail <= self.trigger.threshold_electrons:
            raise ValueError(
                f"saturation.rail_electrons ({rail:g}) is below trigger.threshold_electrons "
                f"({self.trigger.threshold_electrons:g}), which no signal could reach; raise the rail"
            )
        self._check_zero_crossing()
        return self

    def _check_zero_crossing(self) -> None:
        """Refuse a timing channel that could never fire, or beside settings that it cannot serve."""
        timed = self.zero_crossing
        if timed is None:
            return
        if self.gate is not None:
            raise ValueError(
                "zero_crossing times pixels that trigger themselves, and a gate has no trigger; leave one out"
            )
        if self.returns != "first" or self.max_returns > 1:
            raise ValueError(
                "zero_crossing times the first return of a pixel alone; leave out returns and max_returns, or zero_crossing"
            )
        if timed.rail_electrons <= timed.arming_electrons:
            raise ValueError(
                f"zero_crossing.rail_electrons ({timed.rail_electrons:g}) is not above zero_crossing.arming_electrons "
                f"({timed.arming_electrons:g}), which no pulse could reach; raise the rail"
            )
        dark, pole_s, width_s = self.apd.dark_electrons_per_s, self.amplifier.pole_s, self.amplifier.integration_s
        noise = float(noise_rms(self.apd, dark, timed.noise_electrons, pole_s, width_s))
        if timed.arming_electrons < 3.0 * noise:
            raise ValueError(
                f"zero_crossing.arming_electrons ({timed.arming_electrons:g}) is below 3 times the noise of the channel "
                f"({noise:.0f} electrons), which would arm it before the pulse; raise it"
            )

    def replace(self, **changes: Any) -> Self:
        """Return a copy with some fields changed; another preset brings its own constants, unless they were set."""
        other = changes.get("preset", self.preset)
        if other != self.preset:
            for name, key in SOLVED_CONSTANTS:
                part = getattr(self, name)
                if name not in changes and getattr(part, key) == DETECTOR_PRESETS[self.preset][key]:
                    kept = part.model_fields_set - {key}
                    changes[name] = type(part)(**{field: getattr(part, field) for field in kept})
        return super().replace(**changes)

    # ------------------------------------------------------------------------------------------- derived quantities

    @cached_property
    def noise_electrons(self) -> float:
        """Rms of the noise that the comparator sees in the dark [electrons]: amplifier and dark current."""
        return self.noise_in_light(0.0)

    def noise_in_light(self, background_photons_per_s: float) -> float:
        """Return the rms noise under sunlight [electrons].

        Parameters
        ----------
        background_photons_per_s : sunlight on the pixel [photons/s]
        """
        rate = self.apd.dark_electrons_per_s + self.quantum_efficiency * background_photons_per_s
        amplifier = self.amplifier
        noise = noise_rms(self.apd, rate, amplifier.noise_electrons, amplifier.pole_s, amplifier.integration_s)
        return float(noise)

    @property
    def noise_counts(self) -> float:
        """Rms of a sample's noise in the dark [counts], before rounding."""
        return max(self.noise_electrons / self.readout.electrons_per_count, 1e-3)  # a filter needs some noise to weigh

    @property
    def threshold_over_noise(self) -> float:
        """Threshold over the rms noise in the dark."""
        return self.trigger.threshold_electrons / self.noise_electrons if self.noise_electrons > 0.0 else math.inf

    @property
    def electrons_per_photon(self) -> float:
        """Mean number of electrons after the APD for each photon."""
        return self.quantum_efficiency * self.apd.gain

    @property
    def full_scale_counts(self) -> int:
        """Greatest amplitude above the baseline that can be reported, in the unit of `intensity_counts`."""
        return int(self.readout.clip_counts / self.readout.counts_per_intensity)

    @property
    def window_m(self) -> float:
        """Depth [m] in which one flash can see several returns of a pixel."""
        return self.gate.to_m - self.gate.from_m if self.gate else self.readout.window_m

    @property
    def stored_behind_m(self) -> float:
        """Depth [m] that a pixel stores behind its latch, or that a gate holds."""
        cells = self.readout.samples - self.readout.pretrigger_samples
        return self.window_m if self.gate else cells * self.readout.sample_s * units.RANGE_PER_DELAY_M_S

    @property
    def sees_from_m(self) -> float:
        """Least range [m] at which anything is detected."""
        return self.gate.from_m if self.gate else self.armed_from_m

    @property
    def sees_to_m(self) -> float:
        """Greatest range [m] at which anything is detected."""
        return self.gate.to_m if self.gate else self.armed_to_m

    @property
    def clip_electrons(self) -> float:
        """Amplitude from which a return is saturated [electrons]: the converter's full scale, or the amplifier's rail."""
        rail = math.inf if self.saturation is None else self.saturation.rail_electrons
        return min(self.readout.clip_counts * self.readout.electrons_per_count, rail)

    @property
    def saturation_photons(self) -> float:
        """Photons of a return that saturates, if the amplifier makes an amplitude of all of its charge.

        That is so in a pulse as long as its integration time; `find_saturation_photons` counts the laser's own.
        """
        return self.clip_electrons / self.electrons_per_photon

    @property
    def clipped_range_photons(self) -> float:
        """Photons of a return from which its range is no better than decimetres, because too little of it is stored.

        The edges of a clipped pulse give its place where both are stored. The last lies up to some 50 ns behind the latch.
        """
        stored_s = (self.readout.samples - self.readout.pretrigger_samples) * self.readout.sample_s
        if self.zero_crossing is not None or self.gate is not None or stored_s > _EDGES * self.amplifier.integration_s:
            return math.inf
        return _SPOILT * self.saturation_photons

    @property
    def strong_return_cure(self) -> str:
        """Settings of this detector that help with returns that clip, in words; empty where all are in use."""
        cures = []
        if self.readout.low_gain is None:
            cures.append("add lidar.detector.readout.low_gain for their intensity")
        if math.isfinite(self.clipped_range_photons):
            cures.append(
                "add lidar.detector.zero_crossing or store more lidar.detector.readout.samples for their range"
            )
        return ", or ".join(cures)

    @cached_property
    def traits(self) -> DetectorTraits:
        """Facts that a scenario reads about this detector."""
        if self.solve is not None:
            raise ScenarioError(
                "detector.solve: the threshold is not solved yet; give the detector to a Lidar, or call "
                "rl.detector.solve_threshold(detector, pulse)"
            )
        gate = self.gate
        gated = {"gate_delay_s": gate.delay_ns * units.NS, "gate_width_s": gate.width_ns * units.NS} if gate else {}
        return DetectorTraits(
            sees_to_m=self.sees_to_m,
            threshold_photons=self.trigger.threshold_electrons / self.electrons_per_photon,
            sees_from_m=self.sees_from_m,
            max_returns=self.max_returns,
            returns=self.returns,
            stored_behind_m=self.stored_behind_m,
            saturation_photons=self.saturation_photons,
            clipped_range_photons=self.clipped_range_photons,
            strong_return_cure=self.strong_return_cure,
            settings=gated,
            has_waveforms=True,
            has_taps=True,
            is_gated=gate is not None,
            window_keys="gate.delay_ns and gate.width_ns" if gate else "armed_from_m and armed_to_m",
            clock_s=self.readout.sample_s,
            pulses=gate.pulses if gate else 1,
            samples=gate.n_samples(self.readout.sample_s) if gate else self.readout.samples,
        )

    def with_gate_delay(self, delay_ns: float) -> Self:
        """Return a copy whose gate opens at another time.

        Parameters
        ----------
        delay_ns : time after emission [ns]

        Raises
        ------
        ValueError
            If the detector has no gate.
        """
        if self.gate is None:
            raise ValueError("the detector has no gate; add [lidar.detector.gate]")
        return self.replace(gate=self.gate.replace(delay_ns=delay_ns))

    def counts(self, photons: np.ndarray) -> np.ndarray:
        """Return the amplitude of photons in a pulse as long as the amplifier's integration time [counts].

        Parameters
        ----------
        photons : (return) photons
        """
        per_count = self.readout.electrons_per_count * self.readout.counts_per_intensity
        linear = photons * (self.electrons_per_photon / per_count)
        clipped: np.ndarray = np.minimum(linear, self.full_scale_counts)
        return clipped

    # ------------------------------------------------------------------------------------------------ what pixels share

    @property
    def frame_jitter_s(self) -> float:
        """Jitter of a whole frame [s, 1 sigma]; each pulse that a gate averages has its own."""
        return self.timing.frame_jitter_ns * units.NS / math.sqrt(self.gate.pulses if self.gate else 1)

    @property
    def has_flags(self) -> bool:
        """Whether returns are flagged as crosstalk and as superimposed, with labels of what is true."""
        return self.report is not None and self.report.flags

    @property
    def has_coupled_pixels(self) -> bool:
        """Whether the light of one pixel changes what another one reports."""
        return any(getattr(self, name) is not None for name in _BETWEEN_PIXELS)

    def alone(self, gain: float = 1.0) -> Self:
        """Return this detector without coupling between pixels.

        Parameters
        ----------
        gain : gain of the APD over its gain at rest
        """
        apart: dict[str, Any] = dict.fromkeys(_BETWEEN_PIXELS)
        apart["timing"] = self.timing.replace(frame_jitter_ns=0.0)
        if gain != 1.0:
            apart["apd"] = self.apd.replace(gain=max(self.apd.gain * gain, 1.0))
        return self.replace(**apart)

"""Entries of the data sheet of a camera, and what they are as keys of the chain."""

from __future__ import annotations

import math
from typing import Annotated, Self

from pydantic import Field, Strict, model_validator

from rso_lidar import units
from rso_lidar.detector.settings.amplifier import Amplifier
from rso_lidar.detector.settings.apd import Apd
from rso_lidar.part import NotNegative, Number, Part, Positive

# Step response 1 − (1 + x) exp(−x) of two equal poles: 0.1 at x = 0.53181, 0.9 at x = 3.88972.
_RISE_POLES = 3.357_909
_POLE_BANDWIDTH = math.sqrt(math.sqrt(2.0) - 1.0) / (2.0 * math.pi)  # −3 dB bandwidth times the pole


class DataSheet(Part):
    """Entries of the data sheet of a camera; each fills the key of the chain that it determines.

    The detector then has that key alone, so a recording holds the number that was used. Giving both is an error. NEP is that
    in the dark, of amplifier and dark current together. `wavelength_nm` stays, and `check` compares it with the laser's.
    """

    wavelength_nm: Positive | None = Field(
        default=None,
        description="Wavelength at which the data sheet states responsivity and NEP [nm]; needed beside them.",
    )
    responsivity_a_per_w: Positive | None = Field(
        default=None,
        description="Photocurrent over optical power at unit gain [A/W]; fills `quantum_efficiency`.",
    )
    excess_noise_factor: Annotated[Number, Field(ge=1)] | None = Field(
        default=None,
        description="Excess noise factor F of the APD at its gain; fills `apd.ionisation_ratio` (McIntyre 1966).",
    )
    noise_bandwidth_mhz: Positive | None = Field(
        default=None,
        description="Equivalent noise bandwidth ∫|H|² df of the amplifier [MHz]; fills `amplifier.bandwidth_mhz`.",
    )
    rise_time_ns: Positive | None = Field(
        default=None,
        description="Rise time of the amplifier from 10 to 90 % [ns]; fills `amplifier.bandwidth_mhz`.",
    )
    noise_pa_per_sqrt_hz: NotNegative | None = Field(
        default=None,
        description=(
            "White current noise of the amplifier, referred to its input, which is behind the APD [pA/√Hz]; fills "
            "`amplifier.noise_electrons`."
        ),
    )
    nep_w_per_sqrt_hz: Annotated[float, Strict(), Field(ge=1e-18, le=1e-6)] | None = Field(
        default=None,
        description=(
            "Noise-equivalent power in the dark, amplifier and dark current together [W/√Hz]; fills "
            "`amplifier.noise_electrons`."
        ),
    )

    @model_validator(mode="after")
    def _check_entries(self) -> Self:
        for first, second in (("noise_bandwidth_mhz", "rise_time_ns"), ("noise_pa_per_sqrt_hz", "nep_w_per_sqrt_hz")):
            if getattr(self, first) is not None and getattr(self, second) is not None:
                raise ValueError(f"{first} and {second} determine the same; leave one out")
        for name in ("responsivity_a_per_w", "nep_w_per_sqrt_hz"):
            if getattr(self, name) is not None and self.wavelength_nm is None:
                raise ValueError(f"{name} holds at one wavelength; give wavelength_nm beside it")
        return self


def fill_quantum_efficiency(sheet: DataSheet, quantum_efficiency: float) -> float:
    """Return the quantum efficiency of a responsivity, or the given one without it.

    Raises
    ------
    ValueError
        If the responsivity is more than one electron for each photon.
    """
    if sheet.responsivity_a_per_w is None or sheet.wavelength_nm is None:
        return quantum_efficiency
    photon_v = units.photon_energy_j(sheet.wavelength_nm * units.NM) / units.ELEMENTARY_CHARGE_C
    filled = sheet.responsivity_a_per_w * photon_v
    if filled > 1.0:
        raise ValueError(
            f"data_sheet.responsivity_a_per_w ({sheet.responsivity_a_per_w:g}) is {filled:.3g} electrons for each photon "
            f"of {sheet.wavelength_nm:g} nm; state that of unit gain, at most {1.0 / photon_v:.3g}"
        )
    return filled


def fill_apd(sheet: DataSheet, apd: Apd) -> Apd:
    """Return the APD with the ionisation ratio of an excess noise factor, k = (F − 2 + 1/M) / (M − 2 + 1/M).

    Raises
    ------
    ValueError
        If no ionisation ratio from 0 to below 1 gives the factor at this gain.
    """
    excess, gain = sheet.excess_noise_factor, apd.gain
    if excess is None or excess == gain == 1.0:  # a photodiode without gain has no excess noise
        return apd
    least = 2.0 - 1.0 / gain
    if not least * (1.0 - 1e-9) <= excess < gain:
        raise ValueError(
            f"data_sheet.excess_noise_factor ({excess:g}) is not possible at apd.gain = {gain:g}, which has {least:.3g} "
            f"(k = 0) to below {gain:g} (k = 1); correct one of them"
        )
    return apd.replace(ionisation_ratio=max((excess - least) / (gain - least), 0.0))


def fill_amplifier(sheet: DataSheet, amplifier: Amplifier, apd: Apd, quantum_efficiency: float) -> Amplifier:
    """Return the amplifier with bandwidth and noise of a data sheet.

    Parameters
    ----------
    apd, quantum_efficiency : already those of the data sheet

    Raises
    ------
    ValueError
        If the dark current alone has more noise than the NEP.
    """
    pole_s = None
    if sheet.noise_bandwidth_mhz is not None:
        pole_s = 1.0 / (8.0 * sheet.noise_bandwidth_mhz * units.MHZ)
    if sheet.rise_time_ns is not None:
        pole_s = sheet.rise_time_ns * units.NS / _RISE_POLES
    if pole_s is not None:
        amplifier = amplifier.replace(bandwidth_mhz=_POLE_BANDWIDTH / pole_s / units.MHZ)
    if (noise_a := _find_noise_a(sheet, apd, quantum_efficiency)) is None:
        return amplifier
    rms_a = noise_a * math.sqrt(amplifier.noise_bandwidth_hz)
    return amplifier.replace(noise_electrons=rms_a * amplifier.integration_s / units.ELEMENTARY_CHARGE_C)


def _find_noise_a(sheet: DataSheet, apd: Apd, quantum_efficiency: float) -> float | None:
    """Return the current noise of the amplifier alone, after the APD [A/√Hz]; None where it is not stated."""
    if sheet.noise_pa_per_sqrt_hz is not None:
        return sheet.noise_pa_per_sqrt_hz * units.PA
    if sheet.nep_w_per_sqrt_hz is None or sheet.wavelength_nm is None:
        return None
    responsivity = (
        quantum_efficiency * units.ELEMENTARY_CHARGE_C / units.photon_energy_j(sheet.wavelength_nm * units.NM)
    )
    total_a, dark_a = sheet.nep_w_per_sqrt_hz * responsivity * apd.gain, apd.dark_noise_a_per_sqrt_hz
    if total_a < dark_a:
        raise ValueError(
            f"data_sheet.nep_w_per_sqrt_hz ({sheet.nep_w_per_sqrt_hz:g}) is less than the noise of apd.dark_current_na = "
            f"{apd.dark_current_na:g} alone, {dark_a / (responsivity * apd.gain):.3g}; correct one of them"
        )
    return math.sqrt(total_a**2 - dark_a**2)

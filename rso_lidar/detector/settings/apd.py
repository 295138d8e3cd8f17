"""Settings of the avalanche photodiode, and the closed forms of McIntyre's distribution of its gain.

A primary electron leaves the avalanche as n electrons with McIntyre's probability P(n|1) (IEEE Trans. Electron Devices
13, 164 (1966) and 19, 703 (1972)). With p = (1−k)(M−1)/M, Lagrange's inversion gives P(n|a) = (a/n) [wⁿ⁻ᵃ]
(1−p+pw)^(n/(1−k)). The generating function w of a single primary solves w = z (1−p+pw)^(1/(1−k)). All closed forms follow
from that.
"""

import math
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from rso_lidar import units
from rso_lidar.part import NotNegative, Number, Part

_LONGEST_TAIL_ELECTRONS = 1e4  # beyond this 1/e tail of a single avalanche the tables would fill memory


class Apd(Part):
    """An avalanche photodiode of mean `gain` M and McIntyre's `ionisation_ratio` k (0.02 Si, 0.2 InAlAs, 0.4 InP).

    `dark_current_na` is the part that is multiplied, before multiplication (1 nA is assumed for a 100 µm InGaAs pixel at
    room temperature). ``statistics = "gaussian"`` keeps mean and variance and loses the tail that false alarms come from.
    """

    gain: Annotated[Number, Field(ge=1)] = Field(
        default=10.0,
        description="Mean avalanche gain M, electrons per photoelectron. Default: Fuller et al., sec. 3.3 (about 10).",
    )
    ionisation_ratio: Annotated[Number, Field(ge=0, lt=1)] = Field(
        default=0.2,
        description=(
            "Ratio k of the ionisation rates of holes and electrons: 0.02 for Si, 0.2 for InAlAs, 0.4 for InP. "
            "Default: assumed InAlAs; low confidence."
        ),
    )
    dark_current_na: NotNegative = Field(
        default=1.0,
        description=(
            "Dark current of one pixel before multiplication [nA]. Default: assumed, 0.1 to 10 nA is usual for such a "
            "pixel at room temperature; low confidence."
        ),
    )
    statistics: Literal["mcintyre", "gaussian"] = Field(
        default="mcintyre",
        description=(
            "Statistics of the avalanche gain. `gaussian` lacks the upper tail, which causes false alarms. Default: "
            "McIntyre 1966, 1972."
        ),
    )

    @model_validator(mode="after")
    def _check_tail(self) -> Self:
        if self.statistics == "mcintyre":
            s = tail_per_electron(self.gain, self.ionisation_ratio)
            if s * _LONGEST_TAIL_ELECTRONS < 1.0:
                raise ValueError(
                    f"gain {self.gain:g} at ionisation_ratio {self.ionisation_ratio:g} makes single avalanches of "
                    f'{_LONGEST_TAIL_ELECTRONS:g} electrons common; lower one, or set statistics = "gaussian"'
                )
        return self

    @property
    def excess_noise_factor(self) -> float:
        """Excess noise factor F = k M + (1−k)(2 − 1/M), the mean square gain over M² (McIntyre 1966).

        >>> round(Apd(gain=10.0, ionisation_ratio=0.2).excess_noise_factor, 2)
        3.52
        """
        k = self.ionisation_ratio
        return k * self.gain + (1.0 - k) * (2.0 - 1.0 / self.gain)

    @property
    def dark_electrons_per_s(self) -> float:
        """Primary electrons of the dark current [1/s]."""
        return self.dark_current_na * units.NA / units.ELEMENTARY_CHARGE_C

    @property
    def dark_noise_a_per_sqrt_hz(self) -> float:
        """Shot noise of the multiplied dark current after the APD [A/√Hz], one-sided: √(2 q I M² F)."""
        return units.ELEMENTARY_CHARGE_C * math.sqrt(2.0 * cumulants(self)[1] * self.dark_electrons_per_s)


def cumulants(apd: Apd) -> tuple[float, float, float]:
    """Return E[n], E[n²], E[n³] of one primary's electrons n.

    Times the mean number of primaries they are the first three cumulants of a step. From the derivatives at w = 1 of
    y(w) = ln w − ln(1−p+pw)/(1−k), whose inverse is the moment generating function.
    """
    p, rest = avalanche_share(apd.gain, apd.ionisation_ratio), 1.0 - apd.ionisation_ratio
    y2, y3 = p**2 / rest - 1.0, 2.0 - 2.0 * p**3 / rest
    gain = apd.gain
    return gain, -y2 * gain**3, (3.0 * y2**2 - y3 / gain) * gain**5


def avalanche_share(gain: float, ionisation_ratio: float) -> float:
    """Return p = (1−k)(M−1)/M of McIntyre's distribution."""
    return (1.0 - ionisation_ratio) * (gain - 1.0) / gain


def greatest_w(gain: float, ionisation_ratio: float) -> float:
    """Return where the generating function w of a single primary ends, capped at 1e4: dy/dw = 0 there."""
    p, k = avalanche_share(gain, ionisation_ratio), ionisation_ratio
    return 1e4 if k * p == 0.0 else min((1.0 - p) * (1.0 - k) / (k * p), 1e4)


def log_z(w: np.ndarray, gain: float, ionisation_ratio: float) -> np.ndarray:
    """Return y = ln z where the generating function of one primary is w: the inverse of its moment generating function."""
    y: np.ndarray = np.log(w) - np.log1p(avalanche_share(gain, ionisation_ratio) * (w - 1.0)) / (1.0 - ionisation_ratio)
    return y


def tail_per_electron(gain: float, ionisation_ratio: float) -> float:
    """Return the rate [1/electron] at which the tail of a single avalanche falls off."""
    return float(log_z(np.array(greatest_w(gain, ionisation_ratio)), gain, ionisation_ratio))


def noise_rms(
    apd: Apd, rate_per_s: np.ndarray | float, noise_electrons: float, pole_s: float, integration_s: float
) -> np.ndarray:
    """Return the rms noise [electrons] at the amplifier's output.

    The shot noise has the variance M²F · rate · integration² ∫h², with ∫h² = 1/4τ.

    Parameters
    ----------
    rate_per_s : primary electrons, of any origin [1/s]
    noise_electrons : rms of the amplifier's own noise [electrons]
    pole_s : time constant τ of both poles [s]
    integration_s : time in which a current counts as charge [s]
    """
    shot = cumulants(apd)[1] * np.asarray(rate_per_s, dtype=float) * integration_s**2 / (4.0 * pole_s)
    rms: np.ndarray = np.sqrt(noise_electrons**2 + shot)
    return rms

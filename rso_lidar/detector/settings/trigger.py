"""Settings of a pixel's comparator."""

from typing import Annotated

from pydantic import Field

from rso_lidar.detector.settings.presets import DEFAULT
from rso_lidar.part import NotNegative, Number, Part, Positive


class Trigger(Part):
    """A Schmitt trigger: it fires where the amplifier's output passes `threshold_electrons` from below.

    After it was above, it is ready again only below threshold − `hysteresis_electrons`. Thresholds differ from pixel to
    pixel by `threshold_spread_fraction` (1 sigma, fixed in a camera). The threshold is a constant of the preset;
    hysteresis and spread are assumed.
    """

    threshold_electrons: Positive = Field(
        default=DEFAULT["threshold_electrons"],
        description=(
            "Threshold above the baseline [electrons]. Default: solved through the chain by `make calibrate`, so that "
            "95 % of returns of 1000 photons are detected (Fuller et al., sec. 3.3)."
        ),
    )
    hysteresis_electrons: NotNegative = Field(
        default=1000.0,
        description=(
            "Distance below the threshold at which the comparator is ready again [electrons]. Default: assumed."
        ),
    )
    threshold_spread_fraction: Annotated[Number, Field(ge=0.0, le=0.3)] = Field(
        default=0.05,
        description=(
            "Spread of the threshold from pixel to pixel, 1 sigma over the mean, fixed in one camera. Default: "
            "assumed, 5 to 10 %."
        ),
    )

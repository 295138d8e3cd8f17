"""The algorithm that takes ranges from samples."""

from typing import Annotated, Literal

from pydantic import Field, Strict

from rso_lidar.part import Flag, Part

Algorithm = Literal["matched_filter", "constant_fraction", "centroid", "parabola", "leading_edge"]


class Ranging(Part):
    """Estimate of delays from samples: the algorithm, and whether its walk with amplitude is calibrated away.

    `constant_fraction` takes the time at `fraction` of the peak.
    """

    algorithm: Algorithm = Field(
        default="matched_filter",
        description=(
            "Algorithm that estimates the delay of a pulse from its samples. Default: a choice; Fuller et al. mention "
            "a digital filter."
        ),
    )
    fraction: Annotated[float, Strict(), Field(gt=0.0, lt=1.0)] = Field(
        default=0.5,
        description=(
            "Fraction of the peak at which `constant_fraction` takes the time. Default: a choice, used by "
            "`constant_fraction` alone."
        ),
    )
    walk_correction: Flag = Field(
        default=False,
        description="Whether the algorithm's range bias at each amplitude is subtracted. Default: a choice.",
    )

"""The curves file: which tables a laboratory measured of a camera, what their columns are, and what is fitted to them."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, model_validator

from rso_lidar.detector import CurveQuantity
from rso_lidar.errors import did_you_mean
from rso_lidar.part import Name, NotNegative, Number, Part, Positive, Text
from rso_lidar.scenario import FilePart

# Units of the values of each quantity, in SI; the first is the default. `hits` are divided by `trials`, rates multiplied.
RANGE_UNITS = ("m", "cm", "mm", "ns", "ps")
UNITS: dict[str, tuple[str, ...]] = {
    "detection_rate": ("fraction", "percent", "hits"),
    "range_mean": RANGE_UNITS,
    "range_scatter": RANGE_UNITS,
    "counts_mean": ("counts",),
    "counts_scatter": ("counts",),
    "walk": RANGE_UNITS,
    "dark_counts": ("triggers", "hz", "khz"),
}


class CurveTable(Part):
    """A measured curve: the table that holds it, and its columns. A text names a column; a number holds for all points.

    A facing plate fills the pixels. The values are those of all pixels together, each of which counts as one trial in
    each flash.
    """

    quantity: CurveQuantity = Field(
        description=(
            "What was measured. `range_mean` is a mean range; `walk` is one whose constant is unknown. Scatters are "
            "standard deviations of single reports."
        )
    )
    file: Text = Field(description="Table of the curve (.csv, .npz, .h5, .hdf5, .mat), beside the curves file.")
    name: Text | None = Field(default=None, description="Name of the curve in messages. If omitted, its quantity.")
    value: Text = Field(description="Column of the measured values.")
    unit: Text | None = Field(
        default=None,
        description=(
            "Unit of the values: `fraction`, `percent` or `hits` of a rate, `m`, `cm`, `mm`, `ns` or `ps` of a range (times "
            "are of the way out and back), `counts`, and `triggers`, `hz` or `khz` of dark counts. If omitted, the first "
            "of these."
        ),
    )
    photons: Positive | Text | None = Field(
        default=None,
        description=(
            "Expected photons on the pixel, after the optics and before quantum efficiency. Required, except for "
            "`dark_counts`."
        ),
    )
    photons_per_unit: Positive = Field(
        default=1.0, description="Photons on the pixel for each unit of `photons`, such as for 1 nJ/cm²."
    )
    density: NotNegative | Text = Field(
        default=0.0, description="Optical density D of the filters between the source and the pixel: they pass 10^-D."
    )
    trials: Positive | Text = Field(
        description=(
            "Number of flashes times pixels behind each rate, number of reports behind each mean or scatter, or armed "
            "time of `dark_counts` times pixels [s]."
        )
    )
    range_m: NotNegative | Text | None = Field(
        default=None,
        description=(
            "Range of the plate [m]. If omitted, 20 m into what the detector sees, and values of `range_mean` are errors."
        ),
    )
    range_offset_m: Number = Field(
        default=0.0, description="Offset of the bench, which is subtracted from measured mean ranges [m]."
    )
    threshold: Positive | Text | None = Field(
        default=None, description="Threshold at which `dark_counts` were measured. If omitted, the detector's own."
    )
    electrons_per_unit: Positive = Field(
        default=1.0, description="Electrons for each unit of `threshold`, such as for 1 mV."
    )
    systematic: NotNegative | Text = Field(
        default=0.0,
        description=(
            "Error that all trials of a point share, 1 sigma, in the unit of the values. It is what keeps a good fit from "
            "being rejected where the bench is worse than its statistics."
        ),
    )

    @model_validator(mode="after")
    def _fitting_keys(self) -> Self:
        known = UNITS[self.quantity]
        if self.unit is not None and self.unit not in known:
            raise ValueError(
                f"unit: '{self.unit}' is no unit of {self.quantity}{did_you_mean(self.unit, known)} "
                f"(known: {', '.join(known)})"
            )
        is_dark = self.quantity == "dark_counts"
        if (self.photons is None) is not is_dark:
            cure = "leave out photons" if is_dark else "add photons, a column or a number"
            raise ValueError(f"{self.quantity} {'is measured in the dark' if is_dark else 'needs its light'}; {cure}")
        if self.threshold is not None and not is_dark:
            raise ValueError("threshold is for dark_counts; leave it out")
        return self

    @property
    def label(self) -> str:
        """Name of the curve in messages."""
        return self.name or self.quantity


class CurvesFile(FilePart):
    """A file of measured curves, as TOML."""

    version: Literal[1] = Field(description="Version of the file format.")
    name: Name = Field(description="Name of the camera, which its preset states.")
    what: Text | None = Field(default=None, description="Description of the camera and the bench.")
    constants: tuple[Text, ...] = Field(
        min_length=1,
        description="Constants to fit: dotted names of numbers in `[lidar.detector]`, such as `amplifier.noise_electrons`.",
    )
    start: dict[Text, Number] = Field(
        default={}, description="Values at which the fit starts, by constant, in place of those of the scenario."
    )
    confidence: Annotated[float, Field(gt=0.0, lt=1.0)] = Field(
        default=0.95, description="Probability of the confidence intervals."
    )
    photons_error_fraction: Annotated[NotNegative, Field(le=1.0)] = Field(
        default=0.0,
        description=(
            "Relative error that all stated photons share, 1 sigma, such as that of the power meter. Their scale is then "
            "fitted with the constants."
        ),
    )
    curve: tuple[CurveTable, ...] = Field(min_length=1, description="The measured curves.")
    _KIND: ClassVar[str] = "curves"

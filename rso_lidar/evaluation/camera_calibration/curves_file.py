"""The curves file: which curves, maps and shots a laboratory measured of a camera, and what is fitted to them."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, model_validator

from rso_lidar.detector import CurveQuantity, MapQuantity, PixelConstant
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
        _check_unit(self.quantity, self.unit)
        _check_light(self.quantity, self.photons)
        if self.threshold is not None and self.quantity != "dark_counts":
            raise ValueError("threshold is for dark_counts; leave it out")
        return self

    @property
    def label(self) -> str:
        """Name of the curve in messages."""
        return self.name or self.quantity


class MapTable(Part):
    """A quantity of each pixel at one level of light: a map (row, col), or a stack of frames (shot, row, col).

    Every pixel sees the same light. NaN in a map of means, and NaN or 0 in a stack, is a flash without a report.
    """

    quantity: MapQuantity = Field(
        description=(
            "What was measured of each pixel: mean intensity, mean range, rate of detections, or triggers in the dark."
        )
    )
    file: Text = Field(description="Table of the map (.csv, .npz, .h5, .hdf5, .mat), beside the curves file.")
    name: Text | None = Field(default=None, description="Name of the map in messages. If omitted, quantity and light.")
    value: Text = Field(
        description="Array of the measured values, or column of a CSV file with one line for each pixel."
    )
    row: Text = Field(default="row", description="Column of a CSV file with the row of each pixel, from 0 at the top.")
    col: Text = Field(default="col", description="Column of a CSV file with the column of each pixel, from 0.")
    unit: Text | None = Field(
        default=None, description="Unit of the values, as that of a curve. If omitted, the first of those."
    )
    photons: Positive | None = Field(
        default=None,
        description=(
            "Expected photons on each pixel, after the optics and before quantum efficiency. Required, except for "
            "`dark_counts`."
        ),
    )
    photons_per_unit: Positive = Field(default=1.0, description="Photons on the pixel for each unit of `photons`.")
    density: NotNegative = Field(
        default=0.0, description="Optical density D of the filters between the source and the pixel: they pass 10^-D."
    )
    trials: Positive | Text | None = Field(
        default=None,
        description=(
            "Number of flashes behind each rate, of reports behind each mean, or armed time of `dark_counts` [s]: a number, "
            "or an array (row, col). That of a stack follows from it, except for the armed time."
        ),
    )
    scatter: Positive | Text | None = Field(
        default=None,
        description=(
            "Standard deviation of single reports, in the unit of the values: a number, or an array (row, col). If "
            "omitted, that of a stack, or of the detector."
        ),
    )
    range_m: NotNegative | Text | None = Field(
        default=None,
        description="Range of the plate [m], for each pixel or all. If omitted, 20 m into what the detector sees.",
    )
    systematic: NotNegative = Field(
        default=0.0, description="Error of each pixel that all its trials share, 1 sigma, in the unit of the values."
    )

    @model_validator(mode="after")
    def _fitting_keys(self) -> Self:
        _check_unit(self.quantity, self.unit)
        _check_light(self.quantity, self.photons)
        if self.scatter is not None and not self.quantity.endswith("mean"):
            raise ValueError("scatter is for maps of means; leave it out")
        return self

    @property
    def label(self) -> str:
        """Name of the map in messages."""
        light = "" if self.photons is None else f" at {self.photons * self.photons_per_unit * 10.0**-self.density:.4g}"
        return self.name or f"map of {self.quantity}{light}"


class WaveformTable(Part):
    """Shots of raw samples of one pixel, at one or several levels of light, or in the dark."""

    file: Text = Field(description="Table of the shots (.csv, .npz, .h5, .hdf5, .mat), beside the curves file.")
    name: Text = Field(default="shots", description="Name of the shots in messages.")
    samples: Text = Field(
        description=(
            "Array (shot, sample), baseline included. In a CSV file each line is a shot, and this text begins the names of "
            "the columns of samples, which end with their number."
        )
    )
    sample_ns: Positive = Field(description="Time between samples [ns].")
    counts_per_unit: Positive = Field(default=1.0, description="Counts for each unit of the samples, such as for 1 mV.")
    photons: Positive | Text | None = Field(
        default=None,
        description=(
            "Expected photons on the pixel: a number, or an array with one for each shot, in which 0 is dark. If omitted, "
            "the shots are dark."
        ),
    )
    photons_per_unit: Positive = Field(default=1.0, description="Photons on the pixel for each unit of `photons`.")
    density: NotNegative | Text = Field(
        default=0.0, description="Optical density D of the filters between the source and the pixel: they pass 10^-D."
    )

    @property
    def label(self) -> str:
        """Name of the shots in messages."""
        return self.name


def _check_unit(quantity: str, unit: str | None) -> None:
    """Refuse a unit that is none of a quantity's."""
    known = UNITS[quantity]
    if unit is not None and unit not in known:
        raise ValueError(
            f"unit: '{unit}' is no unit of {quantity}{did_you_mean(unit, known)} (known: {', '.join(known)})"
        )


def _check_light(quantity: str, photons: float | str | None) -> None:
    """Refuse light of what is measured in the dark, and its absence elsewhere."""
    is_dark = quantity == "dark_counts"
    if (photons is None) is not is_dark:
        cure = "leave out photons" if is_dark else "add photons, a column or a number"
        raise ValueError(f"{quantity} {'is measured in the dark' if is_dark else 'needs its light'}; {cure}")


class CurvesFile(FilePart):
    """A file of measured curves, maps and waveforms, as TOML."""

    version: Literal[1] = Field(description="Version of the file format.")
    name: Name = Field(description="Name of the camera, which its preset states.")
    what: Text | None = Field(default=None, description="Description of the camera and the bench.")
    constants: tuple[Text, ...] = Field(
        default=(),
        description=(
            "Constants to fit to the curves and waveforms: dotted names of numbers in `[lidar.detector]`, such as "
            "`amplifier.noise_electrons`."
        ),
    )
    pixel_constants: tuple[PixelConstant, ...] = Field(
        default=(),
        description="Constants of each pixel to fit to the maps: some of `gain`, `offset`, `t0`, `threshold`.",
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
    curve: tuple[CurveTable, ...] = Field(default=(), description="The measured curves.")
    map: tuple[MapTable, ...] = Field(default=(), description="The measured maps.")
    waveform: tuple[WaveformTable, ...] = Field(default=(), description="The raw waveforms.")
    _KIND: ClassVar[str] = "curves"

    @model_validator(mode="after")
    def _complete(self) -> Self:
        if not (self.curve or self.map or self.waveform):
            raise ValueError("holds no measurement; add [[curve]], [[map]] or [[waveform]]")
        if bool(self.constants) is not bool(self.curve or self.waveform):
            cure = "leave constants out, or add [[curve]]" if self.constants else "name what is fitted to the curves"
            raise ValueError(f"constants: {'nothing tells them' if self.constants else 'none is named'}; {cure}")
        if bool(self.pixel_constants) is not bool(self.map):
            cure = (
                "leave them out, or add [[map]]"
                if self.pixel_constants
                else "name some of gain, offset, t0 and threshold"
            )
            raise ValueError(
                f"pixel_constants: {'nothing tells them' if self.pixel_constants else 'none is named'}; {cure}"
            )
        return self

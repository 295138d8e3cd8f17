"""Origin of the constants of a detector that were fitted to measurements of a real camera."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Annotated

from pydantic import Field

from rso_lidar.detector import AnyDetector, get_constant
from rso_lidar.errors import ScenarioError
from rso_lidar.files import MOST_BYTES, read_bytes
from rso_lidar.part import Fraction, Instant, NotNegative, Number, Part, Positive, Text


class CalibratedConstant(Part):
    """A constant of the detector that was fitted, with its confidence interval."""

    name: Text = Field(description="Dotted name in `[lidar.detector]`, such as `amplifier.noise_electrons`.")
    value: Number = Field(description="Value of greatest likelihood, in the unit of the name.")
    low: Number = Field(description="Lower end of the confidence interval, in the unit of the name.")
    high: Number = Field(description="Upper end of the confidence interval, in the unit of the name.")


class AssumedSetting(Part):
    """A setting of the detector that neither the fit nor the scenario of the bench gave."""

    name: Text = Field(description="Dotted name in `[lidar.detector]`, such as `apd.dark_current_na`.")
    value: Number = Field(description="Its default in the package, in the unit of the name.")


class CalibrationData(Part):
    """A measured curve or map that constants were fitted to."""

    table: Text = Field(description="Name of the table that was read.")
    sha256: Annotated[Text, Field(pattern="^[0-9a-f]{64}$")] = Field(description="SHA-256 of that table.")
    quantity: Text = Field(description="What was measured, such as `detection_rate`.")
    points: Annotated[int, Field(ge=1)] = Field(description="Number of points of the curve, or of pixels of the map.")
    p_value: Fraction = Field(description="Probability of a worse fit of this curve, were the model true.")


class Calibration(Part):
    """Origin of the fitted constants of a detector, as `rso-lidar camera fit` writes it. It changes no result.

    A scenario that names the preset file takes this table with the detector, and recordings carry both.
    """

    name: Text = Field(description="Name of the camera.")
    what: Text | None = Field(default=None, description="Description of the camera and its measurements.")
    date_utc: Instant = Field(description="Time of the fit, with its offset.")
    versions: Text = Field(description="Versions of the package and of the libraries that made the fit.")
    wavelength_nm: Positive = Field(description="Wavelength of the laser on the bench [nm].")
    pulse_fwhm_ns: Positive = Field(description="Full width at half maximum of its pulse [ns].")
    confidence: Fraction = Field(description="Probability of the confidence intervals.")
    chi2: NotNegative = Field(description="Sum of the squared residuals of all points.")
    freedom: NotNegative = Field(description="Degrees of freedom of that sum.")
    p_value: Fraction | None = Field(
        default=None,
        description=(
            "Probability of a worse fit, were the model true. If omitted, less than one degree of freedom was left, so "
            "that the fit cannot be judged."
        ),
    )
    maps_sha256: Annotated[Text, Field(pattern="^[0-9a-f]{64}$")] | None = Field(
        default=None,
        description="SHA-256 of the file of maps that `detector.maps.file` names. If omitted, there is none.",
    )
    constants: tuple[CalibratedConstant, ...] = Field(description="The fitted constants.")
    assumed: tuple[AssumedSetting, ...] = Field(
        default=(),
        description=(
            "Settings that were left at a default of the package that is assumed, solved or fitted. All others were stated "
            "for the bench, or have a published source."
        ),
    )
    data: tuple[CalibrationData, ...] = Field(description="The measured curves and maps.")

    def list_overridden(self, detector: AnyDetector) -> list[str]:
        """Return the names of the fitted constants that a detector has with another value, and of a file of other maps.

        Parameters
        ----------
        detector : of the scenario that takes the calibration, with the path of its file of maps
        """
        changed = [constant.name for constant in self.constants if not _has(detector, constant)]
        if self.maps_sha256 is not None and _hash_maps(detector) != self.maps_sha256:
            changed.append("maps.file")
        return changed

    def list_assumed(self, detector: AnyDetector) -> list[str]:
        """Return the names of the assumed settings that a detector still has with the same value.

        Parameters
        ----------
        detector : of the scenario that takes the calibration
        """
        return [setting.name for setting in self.assumed if _has(detector, setting)]


def _has(detector: AnyDetector, setting: AssumedSetting | CalibratedConstant) -> bool:
    """Return whether a detector has a setting with its value."""
    try:
        return get_constant(detector, setting.name) == setting.value
    except (AttributeError, TypeError):  # a detector of another type, or without the part
        return False


def _hash_maps(detector: AnyDetector) -> str | None:
    """Return the SHA-256 of the file of maps of a detector; None where it names none."""
    file = getattr(getattr(detector, "maps", None), "file", None)
    return None if file is None else hashlib.sha256(read_bytes(Path(file), MOST_BYTES, ScenarioError)).hexdigest()

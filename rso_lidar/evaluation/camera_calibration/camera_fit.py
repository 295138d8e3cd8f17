"""The detector of a camera fitted to measured tables, and the preset file that scenarios take it from."""

from __future__ import annotations

import datetime
import importlib.metadata
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rso_lidar.detector import ConstantFit, FittedCurve, fit_constants, get_constant, list_assumed_settings
from rso_lidar.errors import ScenarioError, add_place
from rso_lidar.evaluation.camera_calibration.curves_file import CurvesFile
from rso_lidar.evaluation.camera_calibration.measured_tables import read_curves
from rso_lidar.files import align_columns, write_text
from rso_lidar.part import dump_part, python_objects
from rso_lidar.scenario import AssumedSetting, CalibratedConstant, Calibration, CalibrationData, Lidar

_LIBRARIES = ("numpy", "scipy", "numba")
_FAR = 3.0  # standard errors from which a point is named
_MOST_NAMED = 3  # points of a curve


@dataclass(frozen=True, eq=False)
class CameraFit:
    """The constants of a camera as tables of a laboratory give them.

    Parameters
    ----------
    file : the curves file
    lidar : instrument at the start of the fit
    fit : the fitted constants, with the curves
    hashes : SHA-256 of the table of each curve
    date_utc : time of the fit
    """

    file: CurvesFile
    lidar: Lidar
    fit: ConstantFit
    hashes: tuple[str, ...]
    date_utc: datetime.datetime

    @property
    def calibration(self) -> Calibration:
        """Origin of the constants, as the preset file and scenarios hold it."""
        fit = self.fit
        versions = ", ".join(f"{name} {importlib.metadata.version(name)}" for name in ("rso-lidar", *_LIBRARIES))
        return Calibration(
            name=self.file.name,
            what=self.file.what,
            date_utc=self.date_utc,
            versions=versions,
            wavelength_nm=self.lidar.laser.wavelength_nm,
            pulse_fwhm_ns=self.lidar.laser.pulse_fwhm_ns,
            confidence=fit.confidence,
            chi2=fit.chi2,
            freedom=fit.freedom,
            p_value=fit.p_value,
            constants=tuple(
                CalibratedConstant(name=free.name, value=free.value, low=free.low, high=free.high)
                for free in fit.constants
            ),
            assumed=tuple(
                AssumedSetting(name=name, value=get_constant(fit.detector, name)) for name in self._list_assumed()
            ),
            data=tuple(
                CalibrationData(
                    table=table.file,
                    sha256=sha256,
                    quantity=table.quantity,
                    points=len(curve.residuals),
                    p_value=curve.p_value,
                )
                for table, sha256, curve in zip(self.file.curve, self.hashes, fit.curves, strict=True)
            ),
        )

    def _list_assumed(self) -> list[str]:
        """Return the names of the settings that neither the fit nor the bench's scenario gave."""
        bench = self.lidar.calibration  # of an earlier fit
        unstated = [] if bench is None else bench.list_assumed(self.fit.detector)
        fitted = [constant.name for constant in self.fit.constants]
        return [name for name in list_assumed_settings(self.fit.detector, unstated) if name not in fitted]

    def list_misfits(self) -> list[str]:
        """Return what the fitted detector cannot reproduce, a line for each curve: its worst points."""
        return [_describe_misfit(curve) for curve in self.fit.misfits]

    def table(self) -> str:
        """Return the constants, the curves and their goodness of fit as text."""
        fit = self.fit
        percent = f"{100.0 * fit.confidence:g} %"
        scale = [fit.photons_scale] if fit.photons_scale else []
        constants = [("constant", "start", "fitted", f"low {percent}", f"high {percent}")]
        constants += [
            (free.name, f"{free.start:.6g}", f"{free.value:.6g}", f"{free.low:.6g}", f"{free.high:.6g}")
            for free in [*fit.constants, *scale]
        ]
        curves = [("curve", "points", "chi-square", "P of a worse fit")]
        curves += [
            (curve.curve.name, str(len(curve.residuals)), f"{curve.chi2:.1f}", f"{curve.p_value:.2g}")
            for curve in fit.curves
        ]
        lines = [*align_columns(constants), "", *align_columns(curves), ""]
        lines.append(f"All: chi-square {fit.chi2:.1f} with {fit.freedom:.1f} degrees of freedom, P {fit.p_value:.2g}")
        lines += [
            f"Hard to tell apart: {first} and {second} (correlation {value:.3f})"
            for first, second, value in fit.hard_to_tell
        ]
        lines += [f"Not reproduced: {line}" for line in self.list_misfits()]
        return "\n".join(lines)

    def preset_text(self) -> str:
        """Return the preset file: the whole detector, and the origin of its constants."""
        import tomli_w

        remark = (
            f"# The camera '{self.file.name}' as `rso-lidar camera fit` fitted it.\n"
            '# In a scenario: [lidar] preset = "(path of this file)"\n'
        )
        tables = {
            "detector": dump_part(self.fit.detector),
            "calibration": self.calibration.model_dump(exclude_none=True),
        }
        return f"{remark}\n{tomli_w.dumps(tables)}"

    def save_preset(self, path: str | Path, *, overwrite: bool = False) -> Path:
        """Write the preset file.

        Parameters
        ----------
        path : of the file (.toml)
        overwrite : whether an existing file may be replaced

        Returns
        -------
        Path

        Raises
        ------
        ScenarioError
            If the fit is rejected: its constants describe no camera.
        RecordingError
            If the file exists already, or may not be written.
        """
        self.check_accepted()
        return write_text(path, self.preset_text(), overwrite=overwrite)

    def check_accepted(self) -> None:
        """Refuse a fit whose curves the detector cannot have given.

        Raises
        ------
        ScenarioError
            With the curves that do not fit, and their worst points.
        """
        if not self.fit.is_rejected:
            return
        misfits = self.list_misfits() or ["all curves together"]
        raise ScenarioError(
            f"{self.file.where}: rejected: the detector cannot have given these curves (chi-square {self.fit.chi2:.0f} "
            f"with {self.fit.freedom:.0f} degrees of freedom, P {self.fit.p_value:.1g}): {'; '.join(misfits)}; free the "
            "constants that are wrong, add the part of the detector that is missing, or state errors of the bench "
            "(systematic)"
        )


def fit_camera(lidar: Lidar, file: CurvesFile, *, on_round: Callable[[int], None] = lambda _: None) -> CameraFit:
    """Fit constants of a lidar's detector to the measured tables of a curves file.

    Parameters
    ----------
    lidar : with the detector and the pulse of the bench
    file : the tables, what their columns are, and which constants are free
    on_round : called with the number of each round of the fit

    Returns
    -------
    CameraFit
        Also of a fit that is rejected; `CameraFit.check_accepted` refuses that.

    Raises
    ------
    ScenarioError
        If a table is not as described, the curves hold too little for the constants, or the fit does not converge.
    """
    if python_objects(lidar):
        raise ScenarioError(
            "detector: is a Python object, of which no preset can be written; use one that TOML describes"
        )
    curves, hashes = read_curves(file, lidar.detector)
    with add_place(file.where):
        fit = fit_constants(
            lidar.detector,
            lidar.pulse,
            curves,
            file.constants,
            start=file.start,
            confidence=file.confidence,
            photons_error_fraction=file.photons_error_fraction,
            on_round=on_round,
        )
        lidar.replace(detector=fit.detector)  # which refuses a detector that noise alone would trigger
    return CameraFit(file, lidar, fit, tuple(hashes), datetime.datetime.now(datetime.UTC).replace(microsecond=0))


def _describe_misfit(curve: FittedCurve) -> str:
    """Describe a curve that does not fit: its sum of squares, and the points farthest from the model."""
    order = np.argsort(-np.abs(curve.residuals))[:_MOST_NAMED]
    points = [
        f"{curve.curve.value[k]:.4g} measured, {curve.expected[k]:.4g} simulated at {_name_point(curve, int(k))} "
        f"({curve.residuals[k]:+.1f} sigma)"
        for k in order
        if abs(curve.residuals[k]) > _FAR
    ]
    far = f": {', '.join(points)}" if points else ""
    return f"{curve.curve.name} (chi-square {curve.chi2:.0f} of {len(curve.residuals)} points){far}"


def _name_point(curve: FittedCurve, k: int) -> str:
    """Name a point of a curve by its light, or in the dark by its threshold."""
    if curve.curve.quantity != "dark_counts":
        return f"{curve.curve.photons[k]:.4g} photons"
    threshold = curve.curve.threshold_electrons[k]
    return "the detector's threshold" if np.isnan(threshold) else f"a threshold of {threshold:.4g} electrons"

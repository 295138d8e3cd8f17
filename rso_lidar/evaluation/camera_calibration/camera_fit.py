"""The detector of a camera fitted to measured tables, and the preset file that scenarios take it from."""

from __future__ import annotations

import datetime
import hashlib
import importlib.metadata
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rso_lidar.detector import (
    MAPS_SUFFIX,
    AnyDetector,
    ConstantFit,
    FittedCurve,
    MapFit,
    MapGroup,
    MeanPulse,
    MeasuredCurve,
    PixelMaps,
    fit_constants,
    fit_maps,
    get_constant,
    list_assumed_settings,
    merge_points,
    reduce_shots,
    set_maps,
)
from rso_lidar.errors import ScenarioError, add_place
from rso_lidar.evaluation.camera_calibration.curves_file import CurvesFile
from rso_lidar.evaluation.camera_calibration.map_tables import read_maps, read_shots
from rso_lidar.evaluation.camera_calibration.measured_tables import Tables, read_curves
from rso_lidar.files import align_columns, check_writable, write_text
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
    fit : the fitted constants that all pixels share, with the curves; those of waveforms come last
    hashes : SHA-256 of the table of each curve
    date_utc : time of the fit
    tables : file of the table of each curve
    maps : the constants of each pixel; None without maps
    map_hashes : SHA-256 of the table of each map, in the order of the curves file
    pulses : mean pulses of the waveforms
    """

    file: CurvesFile
    lidar: Lidar
    fit: ConstantFit
    hashes: tuple[str, ...]
    date_utc: datetime.datetime
    tables: tuple[str, ...] = ()
    maps: MapFit | None = None
    map_hashes: tuple[str, ...] = ()
    pulses: tuple[MeanPulse, ...] = ()

    @property
    def is_rejected(self) -> bool:
        """Whether the detector cannot have given the measurements."""
        return self.fit.is_rejected or bool(self.maps and self.maps.misfits)

    @property
    def versions(self) -> str:
        """Versions of the package and of the libraries that made the fit."""
        return ", ".join(f"{name} {importlib.metadata.version(name)}" for name in ("rso-lidar", *_LIBRARIES))

    @property
    def goodness(self) -> tuple[float, float, float | None]:
        """Sum of the squared residuals of curves and maps, its degrees of freedom, and the probability of a worse fit.

        The probability is None where less than one degree of freedom is left: such a fit cannot be judged.
        """
        from scipy.stats import chi2

        groups = self.maps.groups if self.maps else ()
        total = self.fit.chi2 + sum(group.chi2 for group in groups)
        freedom = (self.fit.freedom if self.fit.curves else 0.0) + sum(group.freedom for group in groups)
        return total, freedom, float(chi2.sf(total, freedom)) if freedom >= 1.0 else None

    @property
    def goodness_text(self) -> str:
        """The goodness of fit as a phrase; "P -" where no degree of freedom is left."""
        total, freedom, p_value = self.goodness
        chance = "-" if p_value is None else f"{p_value:.2g}"
        return f"chi-square {total:.1f} with {freedom:.1f} degrees of freedom, P {chance}"

    @property
    def pixel_maps(self) -> PixelMaps | None:
        """The maps as their file holds them, with their origin; None without maps."""
        if self.maps is None:
            return None
        origin = {
            "name": self.file.name,
            "what": self.file.what or "",
            "date_utc": self.date_utc.isoformat(),
            "versions": self.versions,
            "tables": [
                {"file": table.file, "sha256": sha256, "quantity": table.quantity, "name": table.label}
                for table, sha256 in zip(self.file.map, self.map_hashes, strict=True)
            ],
            "goodness": [
                {"maps": group.label, "chi2": group.chi2, "freedom": group.freedom, "p_value": group.p_value}
                for group in self.maps.groups
            ],
        }
        dead = self.maps.dead
        return PixelMaps(
            (dead.shape[0], dead.shape[1]), self.maps.maps, self.maps.errors, dead, self.maps.hot, json.dumps(origin)
        )

    @property
    def calibration(self) -> Calibration:
        """Origin of the constants, as the preset file and scenarios hold it."""
        fit, maps = self.fit, self.pixel_maps
        total, freedom, p_value = self.goodness
        groups = self.maps.groups if self.maps else ()
        tables = {table.map.name: (table, group) for group in groups for table in group.tables}
        return Calibration(
            name=self.file.name,
            what=self.file.what,
            date_utc=self.date_utc,
            versions=self.versions,
            wavelength_nm=self.lidar.laser.wavelength_nm,
            pulse_fwhm_ns=self.lidar.laser.pulse_fwhm_ns,
            confidence=fit.confidence,
            chi2=total,
            freedom=freedom,
            p_value=p_value,
            maps_sha256=None if maps is None else hashlib.sha256(maps.to_bytes()).hexdigest(),
            constants=tuple(
                CalibratedConstant(name=free.name, value=free.value, low=free.low, high=free.high)
                for free in fit.constants
            ),
            assumed=tuple(
                AssumedSetting(name=name, value=get_constant(fit.detector, name)) for name in self._list_assumed()
            ),
            data=(
                *(
                    CalibrationData(
                        table=table,
                        sha256=sha256,
                        quantity=curve.curve.quantity,
                        points=len(curve.residuals),
                        p_value=curve.p_value,
                    )
                    for table, sha256, curve in zip(self.tables, self.hashes, fit.curves, strict=True)
                ),
                *(
                    CalibrationData(
                        table=table.file,
                        sha256=sha256,
                        quantity=f"map of {table.quantity}",
                        points=int(np.isfinite(tables[table.label][0].residuals).sum()),
                        p_value=tables[table.label][1].p_value,
                    )
                    for table, sha256 in zip(self.file.map, self.map_hashes, strict=True)
                ),
            ),
        )

    def _list_assumed(self) -> list[str]:
        """Return the names of the settings that neither the fit nor the bench's scenario gave."""
        bench = self.lidar.calibration  # of an earlier fit
        unstated = [] if bench is None else bench.list_assumed(self.fit.detector)
        fitted = [constant.name for constant in self.fit.constants]
        return [name for name in list_assumed_settings(self.fit.detector, unstated) if name not in fitted]

    def list_misfits(self) -> list[str]:
        """Return what the fitted detector cannot reproduce, a line for each curve or group of maps with its worst points."""
        groups = self.maps.misfits if self.maps else []
        return [_describe_misfit(curve) for curve in self.fit.misfits] + [_describe_bad_maps(group) for group in groups]

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
        lines = [*align_columns(constants), "", *align_columns(curves), ""] if fit.curves else []
        if self.maps is not None:
            lines += [line for rows in self.list_map_rows() for line in (*align_columns(rows), "")]
        lines.append(f"All: {self.goodness_text}")
        lines += [
            f"Hard to tell apart: {first} and {second} (correlation {value:.3f})"
            for first, second, value in fit.hard_to_tell
        ]
        lines += [f"Not reproduced: {line}" for line in self.list_misfits()]
        return "\n".join(lines)

    def place_maps(self, preset: str | Path) -> Path | None:
        """Return the path of the maps of a preset, beside it; None without maps.

        Parameters
        ----------
        preset : path of the preset
        """
        return None if self.maps is None else Path(preset).with_suffix(MAPS_SUFFIX)

    def build_detector(self, maps_file: str | None = None) -> AnyDetector:
        """Return the fitted detector, with its maps by the name of their file.

        Parameters
        ----------
        maps_file : name of the file of maps
        """
        maps = self.pixel_maps
        if maps is None:
            return self.fit.detector
        keeps = "trigger.threshold_spread_fraction" in self.file.constants
        return set_maps(self.fit.detector, maps, maps_file, keep_threshold_spread=keeps)

    def list_map_rows(self) -> list[list[tuple[str, ...]]]:
        """Return the rows of two tables, each with its heading: the fitted maps, and the measured ones beside them."""
        return [] if self.maps is None else [_list_maps(self.maps), _list_groups(self.maps)]

    def preset_text(self, maps_file: str | None = None) -> str:
        """Return the preset file: the whole detector, and the origin of its constants.

        Parameters
        ----------
        maps_file : name of the file of maps, beside the preset
        """
        import tomli_w

        remark = (
            f"# The camera '{self.file.name}' as `rso-lidar camera fit` fitted it.\n"
            '# In a scenario: [lidar] preset = "(path of this file)"\n'
        )
        tables = {
            "detector": dump_part(self.build_detector(maps_file)),
            "calibration": self.calibration.model_dump(exclude_none=True),
        }
        return f"{remark}\n{tomli_w.dumps(tables)}"

    def save_preset(self, path: str | Path, *, overwrite: bool = False) -> Path:
        """Write the preset file and, where maps were fitted, their file (.npz) of the same name beside it.

        Parameters
        ----------
        path : of the file (.toml)
        overwrite : whether existing files may be replaced

        Returns
        -------
        Path

        Raises
        ------
        ScenarioError
            If the fit is rejected: its constants describe no camera.
        RecordingError
            If a file exists already, or may not be written.
        """
        self.check_accepted()
        maps, beside = self.pixel_maps, self.place_maps(path)
        if maps is None or beside is None:
            return write_text(path, self.preset_text(), overwrite=overwrite)
        check_writable(path, (Path(path).suffix,), overwrite=overwrite)
        maps.save(beside, overwrite=overwrite)
        return write_text(path, self.preset_text(beside.name), overwrite=overwrite)

    def check_accepted(self) -> None:
        """Refuse a fit whose curves or maps the detector cannot have given.

        Raises
        ------
        ScenarioError
            With the curves that do not fit, and their worst points.
        """
        if not self.is_rejected:
            return
        misfits = self.list_misfits() or ["all curves together"]
        raise ScenarioError(
            f"{self.file.where}: rejected: the detector cannot have given these curves ({self.goodness_text}): "
            f"{'; '.join(misfits)}; free the constants that are wrong, add the part of the detector that is missing, or "
            "state errors of the bench (systematic)"
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
    tables = Tables(file.folder)
    curves = read_curves(file, lidar, tables)
    names = [table.file for table in file.curve]
    maps = read_maps(file, lidar, tables)
    if len({measured.name for measured in maps}) < len(maps):
        raise ScenarioError(f"{file.where}: map: two have the same name; give each a name")
    with add_place(file.where):
        pulses: list[MeanPulse] = []
        for table, shots in zip(file.waveform, read_shots(file, tables), strict=True):
            points, means = reduce_shots(shots, lidar.detector, lidar.pulse)
            merged = merge_points(points, table.label)
            curves, pulses = curves + merged, pulses + means
            names += [table.file] * len(merged)
        fit = _fit_curves(lidar, file, curves, on_round)
        lidar.replace(detector=fit.detector)  # which refuses a detector that noise alone would trigger
        fitted = fit_maps(fit.detector, lidar.pulse, maps, file.pixel_constants) if maps else None
    date_utc = datetime.datetime.now(datetime.UTC).replace(microsecond=0)
    hashes = tuple(tables.sha256(name) for name in names)
    map_hashes = tuple(tables.sha256(table.file) for table in file.map)
    return CameraFit(file, lidar, fit, hashes, date_utc, tuple(names), fitted, map_hashes, tuple(pulses))


def _fit_curves(
    lidar: Lidar, file: CurvesFile, curves: list[MeasuredCurve], on_round: Callable[[int], None]
) -> ConstantFit:
    """Fit the constants that all pixels share; without curves the detector stays as it is."""
    if not curves:
        return ConstantFit(lidar.detector, (), file.confidence, np.zeros((0, 0)), (), 0.0, 1.0, 1.0, None)
    return fit_constants(
        lidar.detector,
        lidar.pulse,
        curves,
        file.constants,
        start=file.start,
        confidence=file.confidence,
        photons_error_fraction=file.photons_error_fraction,
        on_round=on_round,
    )


def _list_maps(maps: MapFit) -> list[tuple[str, ...]]:
    """Return rows of the fitted maps: spread over the pixels, and standard error of a pixel."""
    rows = [("map", "pixels", "spread", "error of a pixel")]
    for name, values in maps.maps.items():
        known = np.isfinite(maps.errors[name])
        rows.append(
            (name, f"{known.sum():,}", f"{values[known].std():.4g}", f"{np.median(maps.errors[name][known]):.3g}")
        )
    return [*rows, ("dead", f"{maps.dead.sum():,}", "", ""), ("hot", f"{maps.hot.sum():,}", "", "")]


def _list_groups(maps: MapFit) -> list[tuple[str, ...]]:
    """Return rows of the measured maps: how they compare with the detector, and how well their group fits."""
    rows: list[tuple[str, ...]] = [
        ("measured map", "over the detector", "chi-square", "freedom of group", "P of a worse fit")
    ]
    for group in maps.groups:
        judged = f"{group.p_value:.2g}" if group.freedom >= 1.0 else ""
        for table in group.tables:
            over = (
                f"{table.over_detector:+.3f} m"
                if table.map.quantity == "range_mean"
                else f"{table.over_detector:.3f} times"
            )
            rows.append((table.map.name, over, f"{table.chi2:.1f}", f"{group.freedom:.0f}", judged))
    return rows


def _describe_bad_maps(group: MapGroup) -> str:
    """Describe maps that such pixels cannot have given, with the pixel that lies farthest beside."""
    worst = max(group.tables, key=lambda table: float(np.nanmax(np.abs(table.residuals))))
    row, col = np.unravel_index(int(np.nanargmax(np.abs(worst.residuals))), worst.residuals.shape)
    return (
        f"{group.label} (chi-square {group.chi2:.0f} with {group.freedom:.0f} degrees of freedom): pixel ({row}, {col}) of "
        f"{worst.map.name} is {worst.residuals[row, col]:+.1f} sigma beside"
    )


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

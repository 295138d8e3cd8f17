"""Tables of measurements (CSV, NPZ, HDF5 and MAT) read as the curves that a curves file makes of their columns."""

from __future__ import annotations

import csv
import hashlib
import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from rso_lidar import units
from rso_lidar.detector import MeasuredCurve, place_plate_m
from rso_lidar.errors import ScenarioError, did_you_mean
from rso_lidar.evaluation.camera_calibration.curves_file import UNITS, CurvesFile, CurveTable
from rso_lidar.export import check_declared_size, open_checked
from rso_lidar.files import MOST_BYTES, check_regular, read_arrays, read_bytes, read_text
from rso_lidar.scenario import Lidar

TABLE_SUFFIXES = (".csv", ".npz", ".h5", ".hdf5", ".mat")
_MOST_POINTS = 10_000  # of a curve; a longer table holds shots, not a curve
SI = {
    "fraction": 1.0,
    "percent": 0.01,
    "m": 1.0,
    "cm": units.CM,
    "mm": units.MM,
    "ns": units.NS * units.RANGE_PER_DELAY_M_S,
    "ps": 1e-3 * units.NS * units.RANGE_PER_DELAY_M_S,
    "counts": 1.0,
    "triggers": 1.0,
    "hits": 1.0,
    "hz": 1.0,
    "khz": 1e3,
}


class Tables:
    """The tables of a curves file, each read once.

    Parameters
    ----------
    folder : of the curves file
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._columns: dict[str, Mapping[str, np.ndarray]] = {}
        self._sha256: dict[str, str] = {}

    def read(self, file: str) -> Mapping[str, np.ndarray]:
        """Return the columns of a table by name."""
        if file not in self._columns:
            path = self.folder / file
            self._columns[file] = read_table(path)
            self._sha256[file] = hashlib.sha256(read_bytes(path, MOST_BYTES, ScenarioError, "table")).hexdigest()
        return self._columns[file]

    def sha256(self, file: str) -> str:
        """Return the SHA-256 of a table that was read."""
        return self._sha256[file]


def read_curves(file: CurvesFile, lidar: Lidar, tables: Tables) -> list[MeasuredCurve]:
    """Read the curves that a curves file describes.

    Parameters
    ----------
    lidar : that was measured, for what a curve does not state
    tables : of the file

    Raises
    ------
    ScenarioError
        If a table cannot be read, lacks a column, or holds something that is not a measurement.
    """
    return [_make_curve(table, tables.read(table.file), lidar) for table in file.curve]


def read_table(path: Path) -> Mapping[str, np.ndarray]:
    """Read the columns of a table by name: the cells of a CSV file as text, and arrays without axes of length 1."""
    suffix = path.suffix.lower()
    if suffix not in TABLE_SUFFIXES:
        guess = did_you_mean(suffix, TABLE_SUFFIXES)
        raise ScenarioError(f"{path}: unknown suffix '{path.suffix}'{guess} (known: {', '.join(TABLE_SUFFIXES)})")
    if suffix == ".csv":
        return _read_csv(path)
    check_regular(path, MOST_BYTES, ScenarioError, "table")
    arrays = (
        read_arrays(path, ScenarioError)
        if suffix == ".npz"
        else _read_mat(path)
        if suffix == ".mat"
        else _read_hdf5(path)
    )
    return {name: np.atleast_1d(np.squeeze(values)) for name, values in arrays.items()}


def _read_csv(path: Path) -> dict[str, np.ndarray]:
    """Read a CSV file with a line of names; lines that start with # are comments."""
    lines = [
        line
        for line in read_text(path, MOST_BYTES, ScenarioError, "table").splitlines(keepends=True)
        if line.strip() and not line.startswith("#")
    ]
    if len(lines) < 2:
        raise ScenarioError(f"{path}: holds no table; write a line of column names, and one line for each point")
    delimiter = max(",;\t", key=lines[0].count)
    rows = list(csv.reader(io.StringIO("".join(lines)), delimiter=delimiter))
    names = [name.strip() for name in rows[0]]
    for number, row in enumerate(rows[1:], 2):
        if len(row) != len(names):
            raise ScenarioError(
                f"{path}: row {number} has {len(row)} cells, and the heading names {len(names)} columns; complete it"
            )
    return {name: np.array([row[k].strip() for row in rows[1:]]) for k, name in enumerate(names)}


def _read_hdf5(path: Path) -> dict[str, np.ndarray]:
    """Read all datasets of an HDF5 file by their paths."""
    arrays: dict[str, np.ndarray] = {}

    def keep(name: str, member: Any) -> None:
        if hasattr(member, "dtype") and member.dtype.kind in "biuf":
            check_declared_size(member)
            arrays[name] = member[()]

    try:
        with open_checked(path) as file:
            file.visititems(keep)
    except (OSError, RuntimeError, KeyError, TypeError, ValueError) as error:  # of h5py
        reason = " ".join(str(error).split())
        raise ScenarioError(
            f"{path}: is not an HDF5 file of numbers, or is damaged ({reason:.120}); write it again"
        ) from None
    return arrays


def _read_mat(path: Path) -> dict[str, np.ndarray]:
    """Read the arrays of a MAT file: of version 7.3, which is HDF5, or an earlier one."""
    from scipy.io import loadmat

    with path.open("rb") as stream:
        is_hdf5 = b"MATLAB 7.3" in stream.read(128)
    if is_hdf5:
        return {name: values.T for name, values in _read_hdf5(path).items()}  # MATLAB stores columns first
    try:
        content = loadmat(path)
    except Exception as error:  # scipy has a dozen errors for damaged files
        reason = " ".join(str(error).split()) or type(error).__name__
        raise ScenarioError(f"{path}: is not a MAT file, or is damaged ({reason:.120}); save it with -v7") from None
    return {name: values for name, values in content.items() if getattr(values, "dtype", np.dtype("O")).kind in "biuf"}


def _make_curve(table: CurveTable, columns: Mapping[str, np.ndarray], lidar: Lidar) -> MeasuredCurve:
    """Make a curve in SI units of the columns of a table."""
    where = f"{table.file}: {table.label}"
    value = _pick_numbers(where, table, columns, table.value, None)
    n = len(value)
    if n > _MOST_POINTS:
        raise ScenarioError(
            f"{where}: has {n:,} points, over {_MOST_POINTS:,}; give means over shots, one for each level of light"
        )

    def pick(given: str | float | None, default: float) -> np.ndarray:
        return _pick_numbers(where, table, columns, default if given is None else given, n)

    trials = pick(table.trials, 0.0)
    if np.any(trials <= 0.0):
        raise ScenarioError(f"{where}: trials: {trials.min():g} is not above 0; give how many trials each point has")
    unit = table.unit or UNITS[table.quantity][0]
    scale = np.full(n, SI[unit])
    if unit == "hits":
        scale = 1.0 / trials
    if unit in ("hz", "khz"):
        scale = SI[unit] * trials
    range_m = pick(table.range_m, place_plate_m(lidar.detector.traits, lidar.pulse))
    photons = pick(table.photons, 0.0) * table.photons_per_unit * 10.0 ** -pick(table.density, 0.0)
    value = value * scale
    if table.quantity in ("range_mean", "walk"):
        value = value - table.range_offset_m - (range_m if table.range_m is not None else 0.0)
    curve = MeasuredCurve(
        table.label,
        table.quantity,
        photons,
        value,
        trials,
        range_m,
        pick(table.threshold, np.nan) * table.electrons_per_unit,
        pick(table.systematic, 0.0) * scale,
    )
    _check_values(where, unit, curve)
    return curve


def _check_values(where: str, unit: str, curve: MeasuredCurve) -> None:
    """Refuse light that is not positive, rates beyond 0 and 1, and scatters that are not positive."""
    if curve.quantity != "dark_counts" and np.any(curve.photons <= 0.0):
        raise ScenarioError(f"{where}: photons: {curve.photons.min():g} is not above 0; leave such points out")
    low, high = float(curve.value.min()), float(curve.value.max())
    if curve.quantity == "detection_rate" and not 0.0 <= low <= high <= 1.0:
        worst = low if low < 0.0 else high
        cure = "percent" if unit == "fraction" else "fraction"
        raise ScenarioError(
            f'{where}: a rate of {worst:g} is not between 0 and 1; correct it, or set unit = "{cure}" or "hits"'
        )
    if curve.quantity.startswith("counts") or curve.quantity.endswith("scatter"):
        if low <= 0.0:
            raise ScenarioError(f"{where}: {low:g} is not above 0; leave such points out")
    elif curve.quantity == "dark_counts" and low < 0.0:
        raise ScenarioError(f"{where}: {low:g} triggers are fewer than none; correct them")


def _pick_numbers(
    where: str, table: CurveTable, columns: Mapping[str, np.ndarray], given: str | float, n: int | None
) -> np.ndarray:
    """Return a column, or a number for each of `n` points."""
    if not isinstance(given, str):
        return np.full(n or 1, float(given))
    column = find_column(where, columns, given)
    if column.ndim != 1:
        raise ScenarioError(f"{where}: column '{given}' has the shape {column.shape}; give one value for each point")
    if n is not None and len(column) != n:
        raise ScenarioError(f"{where}: column '{given}' has {len(column)} values and '{table.value}' {n}; give as many")
    numbers = convert_cells(where, given, column)
    if not np.isfinite(numbers).all():
        k = int(np.argmin(np.isfinite(numbers)))
        raise ScenarioError(
            f"{where}: column '{given}': point {k + 1} is {numbers[k]}; correct it, or leave the point out"
        )
    return numbers


def find_column(where: str, columns: Mapping[str, np.ndarray], name: str) -> np.ndarray:
    """Return a column of a table by its name."""
    if name not in columns:
        known = ", ".join(columns)
        raise ScenarioError(f"{where}: has no column '{name}'{did_you_mean(name, columns)} (known: {known})")
    return columns[name]


def convert_cells(where: str, name: str, column: np.ndarray) -> np.ndarray:
    """Return the cells of a column as numbers; a text that is none is an error."""
    if column.dtype.kind in "biuf":
        return column.astype(float)
    numbers = np.empty(len(column))
    for k, cell in enumerate(column.tolist()):
        try:
            numbers[k] = float(cell)
        except ValueError:
            raise ScenarioError(
                f"{where}: column '{name}': point {k + 1}: '{cell:.40}' is not a number; correct it"
            ) from None
    return numbers

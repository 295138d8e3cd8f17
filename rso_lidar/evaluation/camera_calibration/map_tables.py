"""Maps and raw shots that a curves file describes, read from their tables in SI units."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from rso_lidar import units
from rso_lidar.detector import MeasuredMap, ShotList, place_plate_m
from rso_lidar.errors import ScenarioError
from rso_lidar.evaluation.camera_calibration.curves_file import UNITS, CurvesFile, MapTable, WaveformTable
from rso_lidar.evaluation.camera_calibration.measured_tables import SI, Tables, convert_cells, find_column
from rso_lidar.scenario import Lidar

_OUTLIER = 5.0  # standard deviations from the median of a pixel, beyond which a report is a false trigger
_QUARTILES = 1.348_979_500_392_163_6  # distance of the quartiles of a normal law, in standard deviations
_MOST_LEVELS = 100  # of light in one table of shots
_FEWEST_SAMPLES = 8  # of a shot


def read_maps(file: CurvesFile, lidar: Lidar, tables: Tables) -> list[MeasuredMap]:
    """Read the maps that a curves file describes.

    Parameters
    ----------
    lidar : that was measured, whose array the maps must have
    tables : of the file

    Raises
    ------
    ScenarioError
        If a table cannot be read, lacks an array, has another shape, or holds something that is not a measurement.
    """
    return [_make_map(table, tables.read(table.file), lidar) for table in file.map]


def read_shots(file: CurvesFile, tables: Tables) -> list[list[ShotList]]:
    """Read the raw shots that a curves file describes, those of each table by level of light.

    Parameters
    ----------
    tables : of the file

    Raises
    ------
    ScenarioError
        If a table cannot be read, lacks an array, or holds something that are no samples.
    """
    return [_split_shots(table, tables.read(table.file)) for table in file.waveform]


def _make_map(table: MapTable, columns: Mapping[str, np.ndarray], lidar: Lidar) -> MeasuredMap:
    """Make a map in SI units of the arrays of a table."""
    where = f"{table.file}: {table.label}"
    shape = lidar.receiver.n_rows, lidar.receiver.n_cols
    place = _place_pixels(where, table, columns, shape)
    value = _pick_array(where, columns, table.value, place, shape)
    if value.shape[-2:] != shape or value.ndim not in (2, 3):
        raise ScenarioError(
            f"{where}: '{table.value}' has the shape {value.shape}, and the receiver {shape[0]} x {shape[1]} pixels; give "
            "(row, col) or (shot, row, col) of this array, or set receiver.n_rows and n_cols"
        )

    def pick(given: float | str | None, default: float) -> np.ndarray:
        if not isinstance(given, str):
            return np.full(shape, default if given is None else float(given))
        values = _pick_array(where, columns, given, place, shape)
        if values.shape != shape or not np.isfinite(values).all():
            raise ScenarioError(f"{where}: '{given}' is not a finite number for each of {shape} pixels; correct it")
        return values

    unit = table.unit or UNITS[table.quantity][0]
    plate_m = pick(table.range_m, place_plate_m(lidar.detector.traits, lidar.pulse))
    scatter = np.nan
    if value.ndim == 3:
        value, trials, scatter = _reduce_stack(where, table, value)
        unit = {"detection_rate": "hits", "dark_counts": "triggers"}.get(table.quantity, unit)
    elif table.trials is None:
        raise ScenarioError(f"{where}: trials: is missing; give how many flashes or reports each pixel has")
    if table.trials is not None:
        trials = pick(table.trials, 0.0)
        if np.any(trials <= 0.0):
            raise ScenarioError(
                f"{where}: trials: {trials.min():g} is not above 0; give how many trials each pixel has"
            )
    elif table.quantity == "dark_counts":
        raise ScenarioError(f"{where}: trials: is missing; give the armed time of a pixel [s], of all flashes together")
    if table.scatter is not None:
        own = pick(table.scatter, 0.0) * SI[unit]
        scatter = float(np.sqrt((own[np.isfinite(value)] ** 2).mean())) / SI[unit]
    measured = MeasuredMap(
        table.label,
        table.quantity,
        (table.photons or 0.0) * table.photons_per_unit * 10.0**-table.density,
        _scale_values(unit, value, trials, plate_m if table.range_m is not None else None, table),
        trials,
        scatter * SI[unit],
        float(plate_m.mean()),
        table.systematic * SI[unit],
    )
    _check_map(where, unit, measured)
    return measured


def _scale_values(
    unit: str, value: np.ndarray, trials: np.ndarray, plate_m: np.ndarray | None, table: MapTable
) -> np.ndarray:
    """Return the values of a map in SI units: means, errors of range, or numbers of hits and triggers."""
    if table.quantity == "detection_rate":
        hits: np.ndarray = value if unit == "hits" else value * SI[unit] * trials
        return hits
    if unit in ("hz", "khz"):
        number: np.ndarray = value * SI[unit] * trials
        return number
    scaled: np.ndarray = value * SI[unit]
    return scaled - plate_m if plate_m is not None and table.quantity == "range_mean" else scaled


def _reduce_stack(where: str, table: MapTable, stack: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Return mean, number of reports and common scatter of a stack; or sums of hits or triggers, and the flashes."""
    seen = np.isfinite(stack) & (stack != 0.0)
    if table.quantity == "detection_rate":
        return seen.sum(axis=0).astype(float), np.full(stack.shape[1:], float(len(stack))), np.nan
    if table.quantity == "dark_counts":
        return np.where(seen, stack, 0.0).sum(axis=0), np.full(stack.shape[1:], float(len(stack))), np.nan
    if len(stack) < 2 or not seen.any():
        raise ScenarioError(f"{where}: {len(stack)} frame{'s' * (len(stack) != 1)} with few reports; give more of them")
    about = np.where(seen, stack, np.nan)
    order = np.sort(about, axis=0)  # NaN last
    middle_place = np.maximum(seen.sum(axis=0) - 1, 0) // 2
    middle = np.take_along_axis(order, middle_place[None], axis=0)[0]
    low, high = np.nanquantile(about - middle, [0.25, 0.75])
    with np.errstate(invalid="ignore"):
        kept = seen & (np.abs(stack - middle) <= _OUTLIER * max(float(high - low) / _QUARTILES, 1e-12))
    number = kept.sum(axis=0).astype(float)
    mean = np.where(number > 0.0, np.where(kept, stack, 0.0).sum(axis=0) / np.maximum(number, 1.0), np.nan)
    freedom = float(number.sum() - (number > 0.0).sum())
    if freedom < 1.0:
        raise ScenarioError(f"{where}: no pixel has two reports, which would tell the scatter; give more frames")
    scatter = np.sqrt(np.where(kept, (stack - np.nan_to_num(mean)) ** 2, 0.0).sum() / freedom)
    return mean, np.maximum(number, 1.0), float(scatter)


def _place_pixels(
    where: str, table: MapTable, columns: Mapping[str, np.ndarray], shape: tuple[int, int]
) -> np.ndarray | None:
    """Return the pixel of each line of a CSV file; None for tables that hold arrays."""
    if not table.file.lower().endswith(".csv"):
        return None
    row, col = (convert_cells(where, name, find_column(where, columns, name)) for name in (table.row, table.col))
    n = shape[0] * shape[1]
    inside = (row >= 0) & (row < shape[0]) & (col >= 0) & (col < shape[1]) & (row % 1 == 0) & (col % 1 == 0)
    if not inside.all():
        k = int(np.argmin(inside))
        raise ScenarioError(
            f"{where}: point {k + 1} is of pixel ({row[k]:g}, {col[k]:g}), and the receiver has {shape[0]} x {shape[1]}; "
            "count from 0, or set receiver.n_rows and n_cols"
        )
    place: np.ndarray = (row * shape[1] + col).astype(np.int64)
    if len(place) != n or len(np.unique(place)) != n:
        raise ScenarioError(
            f"{where}: has {len(np.unique(place)):,} of {n:,} pixels in {len(place):,} lines; give each once"
        )
    return place


def _pick_array(
    where: str, columns: Mapping[str, np.ndarray], name: str, place: np.ndarray | None, shape: tuple[int, int]
) -> np.ndarray:
    """Return an array of a table, that of a CSV file in the order of pixels (row, col)."""
    column = find_column(where, columns, name)
    if place is None:
        if column.dtype.kind not in "biuf":
            raise ScenarioError(f"{where}: '{name}' holds {column.dtype}, not numbers; save it as numbers")
        return column.astype(float)
    values = np.empty(len(place))
    values[place] = convert_cells(where, name, column)
    return values.reshape(shape)


def _check_map(where: str, unit: str, measured: MeasuredMap) -> None:
    """Refuse light that is not positive, infinite values, and rates and counts that cannot be."""
    if np.isinf(measured.value).any():
        raise ScenarioError(f"{where}: holds infinite values; correct them")
    is_rate = measured.quantity in ("detection_rate", "dark_counts")
    if is_rate and np.isnan(measured.value).any():
        row, col = np.argwhere(np.isnan(measured.value))[0]
        raise ScenarioError(
            f"{where}: pixel ({row}, {col}) is nan; correct it, with 0 for a pixel that reports nothing"
        )
    if not np.isfinite(measured.value).any():
        raise ScenarioError(f"{where}: all values are nan; correct the file")
    if measured.quantity != "range_mean" and np.nanmin(measured.value) < 0.0:
        raise ScenarioError(f"{where}: {np.nanmin(measured.value):g} is below 0; correct it")
    if measured.quantity == "detection_rate" and np.any(measured.value > measured.trials * (1.0 + 1e-9)):
        worst = float((measured.value / measured.trials).max())
        cure = "percent" if unit == "fraction" else "fraction"
        raise ScenarioError(
            f'{where}: a rate of {worst:g} is not between 0 and 1; correct it, or set unit = "{cure}" or "hits"'
        )


def _split_shots(table: WaveformTable, columns: Mapping[str, np.ndarray]) -> list[ShotList]:
    """Return the shots of a table by level of light."""
    where = f"{table.file}: {table.label}"
    if table.file.lower().endswith(".csv"):
        names = [name for name in columns if name.startswith(table.samples) and name[len(table.samples) :].isdigit()]
        if not names:
            find_column(where, columns, table.samples)
            raise ScenarioError(
                f"{where}: has no columns '{table.samples}0', '{table.samples}1', …; name the samples so"
            )
        names.sort(key=lambda name: int(name[len(table.samples) :]))
        samples = np.stack([convert_cells(where, name, columns[name]) for name in names], axis=1)
    else:
        samples = find_column(where, columns, table.samples)
        if samples.ndim == 1:
            raise ScenarioError(f"{where}: '{table.samples}' holds one shot, which tells no scatter; give more shots")
        if samples.ndim != 2 or samples.dtype.kind not in "biuf":
            raise ScenarioError(
                f"{where}: '{table.samples}' has the shape {samples.shape} of {samples.dtype}; give numbers (shot, sample)"
            )
        samples = samples.astype(float)
    n_shots, n_samples = samples.shape
    if n_samples < _FEWEST_SAMPLES:
        raise ScenarioError(
            f"{where}: shots of {n_samples} samples hold no pulse; give (shot, sample), {_FEWEST_SAMPLES} or more"
        )
    if not np.isfinite(samples).all():
        shot, sample = np.argwhere(~np.isfinite(samples))[0]
        raise ScenarioError(
            f"{where}: shot {shot + 1}, sample {sample + 1} is {samples[shot, sample]}; correct it, or leave the shot out"
        )

    def pick(given: float | str | None) -> np.ndarray:
        if not isinstance(given, str):
            return np.full(n_shots, given or 0.0)
        values = convert_cells(where, given, find_column(where, columns, given))
        if values.shape != (n_shots,) or not np.all(np.isfinite(values) & (values >= 0.0)):
            raise ScenarioError(f"{where}: '{given}' is not a number from 0 on for each of {n_shots} shots; correct it")
        return values

    photons = pick(table.photons) * table.photons_per_unit * 10.0 ** -pick(table.density)
    levels = np.unique(photons)
    if len(levels) > _MOST_LEVELS:
        raise ScenarioError(
            f"{where}: has {len(levels):,} levels of light, over {_MOST_LEVELS}; give many shots of each level"
        )
    return [
        ShotList(
            table.label, table.counts_per_unit * samples[photons == level], table.sample_ns * units.NS, float(level)
        )
        for level in levels.tolist()
    ]

"""CSV tables whose rows have a time: `time_s` counts from the start of the run, `utc` or `epoch` is ISO text."""

from __future__ import annotations

import csv
import datetime
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rso_lidar.errors import ScenarioError, did_you_mean
from rso_lidar.orbit.ccsds.message import check_increasing, parse_number
from rso_lidar.orbit.epochs import PS_PER_S, floor_to_utc_second, parse_epoch_ps, tai_ps_from_utc
from rso_lidar.part import UNIT_NORM_WITHIN

TIMES = ("time_s", "utc", "epoch")


@dataclass(frozen=True, eq=False)
class TimedTable:
    """Rows as read.

    Parameters
    ----------
    where : name of the file, for messages
    start_utc : instant from which `time_s` counts, None for the start of the run
    time_s : (row,) [s]
    columns : (row,) values by name of column
    lines : line of each row in the file
    """

    where: str
    start_utc: datetime.datetime | None
    time_s: np.ndarray
    columns: dict[str, np.ndarray]
    lines: list[int]

    def stack(self, names: Sequence[str]) -> np.ndarray | None:
        """Return columns side by side (row, n), or None if the table lacks them."""
        return np.stack([self.columns[name] for name in names], axis=-1) if names[0] in self.columns else None

    def stack_unit_quaternions(self, names: Sequence[str]) -> np.ndarray:
        """Return four columns side by side (row, 4); `ScenarioError` if the norm of a row is not 1."""
        return check_unit_quaternions(self.where, np.stack([self.columns[name] for name in names], axis=-1), self.lines)


def elapsed_from_ps(
    stamps: Sequence[int], start_utc: datetime.datetime | None = None
) -> tuple[datetime.datetime, np.ndarray]:
    """Convert instants [ps] to a start and seconds after it (row,) [s].

    Parameters
    ----------
    stamps : (row,) instants [ps of TAI since the start of 2000]
    start_utc : the start; a whole UTC second at the first instant if None
    """
    if start_utc is None:
        start, start_ps = floor_to_utc_second(stamps[0])
    else:
        start, start_ps = start_utc, tai_ps_from_utc(start_utc)
    return start, np.array([(stamp - start_ps) / PS_PER_S for stamp in stamps])


def read_csv_table(text: str, where: str, sets: Sequence[Sequence[str]], needed: Sequence[Sequence[str]]) -> TimedTable:
    """Read and check a CSV table.

    Parameters
    ----------
    text : content of the file
    where : name of the file, for messages
    sets : groups of columns that may occur; of each group all or none
    needed : groups of which exactly one must occur

    Returns
    -------
    columns and times of the table

    Raises
    ------
    ScenarioError
        if the table does not follow this; the message names the line
    """
    try:
        rows = [(k, cells) for k, cells in enumerate(csv.reader(text.split("\n")), start=1) if "".join(cells).strip()]
    except csv.Error as error:
        raise ScenarioError(f"{where}: cannot be read as CSV ({error}); write plain rows of numbers") from None
    at = f"{where}: line {rows[0][0]}"
    header = [cell.strip() for cell in rows[0][1]]
    time_column = _find_time_column(at, header, sets, needed)
    if len(rows) < 3:
        raise ScenarioError(f"{where}: has {len(rows) - 1} rows; a table needs at least two")
    columns: dict[str, list[float]] = {name: [] for name in header if name != time_column}
    stamps: list[int] = []
    times: list[float] = []
    for line, cells in rows[1:]:
        at = f"{where}: line {line}"
        if len(cells) != len(header):
            raise ScenarioError(f"{at}: has {len(cells)} cells, the header {len(header)}; give one for each column")
        for name, cell in zip(header, cells, strict=True):
            if name != time_column:
                columns[name].append(parse_number(at, name, cell))
            elif name == "time_s":
                times.append(parse_number(at, name, cell))
                stamps.append(round(times[-1] * PS_PER_S))
            else:
                stamps.append(parse_epoch_ps(cell.strip(), "UTC", at))
    lines = [line for line, _ in rows[1:]]
    check_increasing(where, stamps, lines)
    start, time_s = (None, np.array(times)) if times else elapsed_from_ps(stamps)
    return TimedTable(where, start, time_s, {name: np.array(values) for name, values in columns.items()}, lines)


def check_unit_quaternions(where: str, quaternion: np.ndarray, lines: Sequence[int]) -> np.ndarray:
    """Return quaternions (row, 4); a `ScenarioError` names the line, of `lines` (row,), of one whose norm is not 1."""
    norms = np.linalg.norm(quaternion, axis=1)
    wrong = np.flatnonzero(np.abs(norms - 1.0) > UNIT_NORM_WITHIN)
    if len(wrong):
        k = int(wrong[0])
        raise ScenarioError(
            f"{where}: line {lines[k]}: the quaternion's norm is {norms[k]:.6g}, not 1; divide by it, or correct the row"
        )
    return quaternion


def _find_time_column(
    where: str, header: list[str], sets: Sequence[Sequence[str]], needed: Sequence[Sequence[str]]
) -> str:
    """Check the header, and return the name of its column of time; `sets` and `needed` are as for `read_csv_table`."""
    known = [*TIMES, *(name for group in sets for name in group)]
    for name in header:
        if name not in known:
            guess = did_you_mean(name, known) or f"; known columns: {', '.join(known)}"
            raise ScenarioError(f"{where}: unknown column '{name}'{guess}")
        if header.count(name) > 1:
            raise ScenarioError(f"{where}: column '{name}' is given twice; remove one")
    times = [name for name in TIMES if name in header]
    if len(times) != 1:
        raise ScenarioError(f"{where}: needs one column of time ({' or '.join(TIMES)}), not {len(times)}; give one")
    for group in sets:
        missing = [name for name in group if name not in header]
        if 0 < len(missing) < len(group):
            raise ScenarioError(f"{where}: column {', '.join(missing)} is missing; give all of {', '.join(group)}")
    if sum(group[0] in header for group in needed) != 1:
        choice = " or ".join(", ".join(group) for group in needed)
        raise ScenarioError(f"{where}: needs the columns {choice}, one set of them; correct the header")
    return times[0]

"""A trade study worked through: one run of a scenario for each point, side by side, kept as they come, and a table."""

from __future__ import annotations

import errno
import hashlib
import importlib.metadata
import json
import os
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from rso_lidar.errors import RunError, ScenarioError
from rso_lidar.files import hold_lock, write_cure
from rso_lidar.processes import Processes
from rso_lidar.scenario import Scenario
from rso_lidar.scene.library.catalogue import own_models
from rso_lidar.study.trades.definition import Axis, Study, write_toml_value
from rso_lidar.study.trades.plan import Row, TradePlan, make_plan
from rso_lidar.study.trades.report import save_trade
from rso_lidar.study.trades.results import TradeTable


def identify(plan: TradePlan, base: Scenario) -> str:
    """Return eight hex digits that name a study: SHA-256 of it, of its scenario as resolved, and of the version.

    What its points name counts by content: files beside the scenario, and models of the user's own library.
    """
    version = importlib.metadata.version("rso-lidar"), base.source.versions["arithmetic"]
    named = [
        _hash_content(word, plan.folder) for word in sorted(set(_iterate_texts([list(point) for point in plan.points])))
    ]
    asked = plan.study.model_dump_json(exclude={"min_detection_fraction"})  # it ranks rows, and changes none
    parts = (asked, plan.text, base.source.scenario, *named, *version)
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:8]


def _iterate_texts(value: Any) -> Iterator[str]:
    """Return the texts in a value of an axis, down through its lists and tables."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, Mapping):
        for inner in value.values():
            yield from _iterate_texts(inner)
    elif isinstance(value, list | tuple):
        for inner in value:
            yield from _iterate_texts(inner)


def _hash_content(word: str, folder: Path) -> str:
    """Return what a text names, as far as it names a file or a model that may change; else nothing."""
    own = own_models().get(word)
    place = folder / word
    with suppress(OSError, ValueError):
        return repr(own) if own else hashlib.sha256(place.read_bytes()).hexdigest() if place.is_file() else ""
    return ""


class RowFile:
    """Rows kept in a file as they come, one JSON text a line: what was cut off goes on after its last whole line."""

    def __init__(self, path: Path, count: int) -> None:
        self.path, self._count = path, count
        self.known: dict[int, Row] = {}
        self._file: BinaryIO | None = None

    @contextmanager
    def opened(self) -> Iterator[RowFile]:
        """Read what is there and keep others away; the file stays when the context ends."""
        with hold_lock(self.path.with_name(f".{self.path.name}.lock")):
            try:
                with self._written():
                    self._file = open(self.path, "a+b", opener=_open_no_link)  # noqa: SIM115  # closed below
                    self._file.seek(0)
                    whole = 0
                    for line in self._file:
                        row = _parse_row(line, self._count)
                        if row is None:
                            break
                        self.known[row["row"]] = row
                        whole += len(line)
                    self._file.truncate(whole)
                yield self
            finally:
                if self._file is not None:
                    self._file.close()

    def add(self, row: Row) -> None:
        """Keep a row; when this returns, a kill no longer loses it."""
        assert self._file is not None
        with self._written():
            self._file.write((json.dumps(row) + "\n").encode())
            self._file.flush()
            os.fsync(self._file.fileno())
        self.known[row["row"]] = row

    @contextmanager
    def _written(self) -> Iterator[None]:
        """Say of what the system refuses that it was this file."""
        try:
            yield
        except OSError as error:
            told, cure = error.strerror or error, write_cure(error.errno)
            if error.errno == errno.ELOOP:
                told, cure = "it is a symbolic link", "remove it"
            raise RunError(f"{self.path}: cannot be written ({told}); {cure} and run again") from error


def _open_no_link(path: str, flags: int) -> int:
    """Open a file whose name others can guess; a link there is an error."""
    return os.open(path, flags | getattr(os, "O_NOFOLLOW", 0), 0o666)


def _parse_row(line: bytes, count: int) -> Row | None:
    """Return the row of a line; None where it was cut off."""
    try:
        row = json.loads(line)
    except ValueError:
        return None
    whole = line.endswith(b"\n") and isinstance(row, dict) and set(row) == {"row", "seed", "merits", "error"}
    return row if whole and 0 <= row["row"] < count else None


def run_rows(plan: TradePlan, known: dict[int, Row], workers: int | None = None) -> Iterator[Row]:
    """Yield the rows that are not known yet, as they are done; a row depends on the plan and its number only."""
    left = [number for number in range(plan.study.n_rows) if number not in known]
    if workers is None or workers < 2 or len(left) < 2:
        yield from map(plan.row, left)
        return
    with Processes(min(workers, len(left)), partial(TradePlan.row, plan)) as processes:
        waiting: set[Future[Any]] = set()
        try:
            while left or waiting:
                while left and len(waiting) < 2 * workers:
                    waiting.add(processes.submit(left.pop(0)))
                done, waiting = wait(waiting, return_when=FIRST_COMPLETED)
                for future in done:
                    yield processes.result(future)
        except BaseException:
            processes.abandon()
            raise


class Trade(TradeTable):
    """A trade study worked through: its table, and how to write it and its report."""

    def save(self, path: str | Path) -> Path:
        """Return the path of the table (.csv, .parquet) or of the report (.html), written whole or not at all."""
        return save_trade(self, Path(path))


def trade(
    study: Study | str | Path,
    *,
    workers: int | None = None,
    working: str | Path | None = None,
    on_row: Callable[[int, int], None] | None = None,
) -> Trade:
    """Return a trade study worked through: a table of figures of merit, one row for each point and seed.

    Parameters
    ----------
    study : what is asked, or the TOML file that says so.
    workers : how many processes work through points at once, in place of threads; a script that asks for them keeps its own
        work under ``if __name__ == "__main__":``. It does not change a bit.
    working : a file in which rows are kept as they come; with the same one a study that was cut off goes on. Its name gets
        eight hex digits of what is asked, so another study does not go on from it; it stays until you delete it.
    on_row : called with how many rows there are, and of how many, at the start and after each.
    """
    if workers is not None and (not isinstance(workers, int) or isinstance(workers, bool) or workers < 1):
        raise ScenarioError(f"workers: needs a whole number from 1, not {workers!r}; or leave it out")
    asked = study if isinstance(study, Study) else Study.load(study)
    plan, base = make_plan(asked, threads=1 if workers is not None and workers > 1 else None)
    tell = on_row or (lambda done, count: None)
    known: dict[int, Row] = {}
    if working is None:
        tell(0, asked.n_rows)
        for row in run_rows(plan, known, workers):
            known[row["row"]] = row
            tell(len(known), asked.n_rows)
        return tabulate_rows(plan, base, known)
    with RowFile(place_row_file(Path(working), plan, base), asked.n_rows).opened() as rows:
        tell(len(rows.known), asked.n_rows)
        for row in run_rows(plan, rows.known, workers):
            rows.add(row)
            tell(len(rows.known), asked.n_rows)
        return tabulate_rows(plan, base, rows.known)


def place_row_file(place: Path, plan: TradePlan, base: Scenario) -> Path:
    """Return the file in which rows are kept that go to `place` in the end."""
    return place.with_name(f"{place.name}.tmp-{identify(plan, base)}")


def tabulate_rows(plan: TradePlan, base: Scenario, known: dict[int, Row]) -> Trade:
    """Return the table of all rows, in their order."""
    study = plan.study
    rows = [known[number] for number in range(study.n_rows)]
    table = {"row": np.array([row["row"] for row in rows]), "seed": np.array([row["seed"] for row in rows])}
    for k, axis in enumerate(study.axis):
        values = [plan.points[number // study.seeds][k] for number in range(study.n_rows)]
        for column, field in enumerate(axis.field):
            if field != "seed":
                table[field] = _tabulate_field(axis, values, column)
    table |= {name: np.array([row["merits"][name] for row in rows], dtype=float) for name in study.judged_by}
    table["error"] = np.array([row["error"] for row in rows])
    made = Trade(study, base, plan, table)
    if made.needs_detection:
        table["detected"] = np.repeat(made.detected, study.seeds).astype(int)
        table["min_detection_fraction"] = np.full(len(rows), study.min_detection_fraction)
    return made


def _tabulate_field(axis: Axis, values: list[Any], column: int) -> np.ndarray:
    """Return the values of one field: as numbers where all are, else as TOML."""
    linked = len(axis.field) > 1
    own = [value[column] if linked and isinstance(value, list) else value for value in values]
    if all(type(value) in (int, float) for value in own):
        return np.array(own, dtype=float)
    return np.array([value if isinstance(value, str) else write_toml_value(value) for value in own])

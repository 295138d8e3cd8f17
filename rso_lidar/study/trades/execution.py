"""The execution of a trade study: one run for each point and seed, in parallel, saved one by one."""

from __future__ import annotations

import errno
import hashlib
import importlib.metadata
import json
import os
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO, ClassVar, Self

import numpy as np

from rso_lidar.errors import RunError, ScenarioError
from rso_lidar.files import advise_on_write, hold_lock
from rso_lidar.picture import LIGHT, Scheme
from rso_lidar.processes import check_workers, map_unordered
from rso_lidar.scenario import Scenario, iterate_texts
from rso_lidar.scene import own_models
from rso_lidar.study.trades.definition import Axis, Study, write_toml_value
from rso_lidar.study.trades.plan import Row, TradePlan, make_trade_plan
from rso_lidar.study.trades.ranking import summarize_trade
from rso_lidar.study.trades.report import TRADE_SUFFIXES, save_trade
from rso_lidar.study.trades.results import TradeTable


def identify(plan: TradePlan, base: Scenario) -> str:
    """Return eight hex digits that identify a study: SHA-256 of it, of its resolved scenario, and of the version.

    Files and models of the user's own library that points name are included with their content.
    """
    version = importlib.metadata.version("rso-lidar"), base.source.versions["arithmetic"]
    named = [_hash_content(word, plan.folder) for word in sorted(set(iterate_texts(plan.points)))]
    asked = plan.study.model_dump_json(exclude={"min_detection_fraction"})  # it ranks rows, and changes none
    parts = (asked, plan.text, base.source.scenario, *named, *version)
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:8]


def _hash_content(word: str, folder: Path) -> str:
    """Return a hash of the file or the user's model that a text names; empty for another text."""
    own = own_models().get(word)
    place = folder / word
    with suppress(OSError, ValueError):
        return repr(own) if own else hashlib.sha256(place.read_bytes()).hexdigest() if place.is_file() else ""
    return ""


class RowFile:
    """A file of finished rows, one JSON text per line. An interrupted study continues after the last complete line."""

    def __init__(self, path: Path, count: int) -> None:
        self.path, self._count = path, count
        self.known: dict[int, Row] = {}
        self._file: BinaryIO | None = None

    @contextmanager
    def opened(self) -> Iterator[RowFile]:
        """Read existing rows and lock the file; it remains when the context ends."""
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
        """Save a row; when this returns, it survives a kill of the process."""
        if self._file is None:
            raise ScenarioError("working: its file of rows is not open; enter the TradeRun with `with`")
        with self._written():
            self._file.write((json.dumps(row) + "\n").encode())
            self._file.flush()
            os.fsync(self._file.fileno())
        self.known[row["row"]] = row

    @contextmanager
    def _written(self) -> Iterator[None]:
        """Turn errors of the system into a `RunError` that names this file."""
        try:
            yield
        except OSError as error:
            reason, cure = error.strerror or error, advise_on_write(error.errno)
            if error.errno == errno.ELOOP:
                reason, cure = "it is a symbolic link", "remove it"
            raise RunError(f"{self.path}: cannot be written ({reason}); {cure} and run again") from error


def _open_no_link(path: str, flags: int) -> int:
    """Open a file without following a symbolic link, because others can guess its name."""
    return os.open(path, flags | getattr(os, "O_NOFOLLOW", 0), 0o666)


def _parse_row(line: bytes, count: int) -> Row | None:
    """Parse the row of a line; None for an incomplete line."""
    try:
        row = json.loads(line)
    except ValueError:
        return None
    whole = line.endswith(b"\n") and isinstance(row, dict) and set(row) == {"row", "seed", "merits", "error"}
    return row if whole and 0 <= row["row"] < count else None


def run_rows(
    plan: TradePlan, known: dict[int, Row], workers: int | None = None, executor: Executor | None = None
) -> Iterator[Row]:
    """Return the rows that are not known yet, each when it is finished."""
    left = [number for number in range(plan.study.n_rows) if number not in known]
    return map_unordered(partial(TradePlan.row, plan), left, min(workers or 1, len(left)), executor)


class Trade(TradeTable):
    """A finished trade study, which writes its table and its report; `SUFFIXES` are those of the files that it writes."""

    SUFFIXES: ClassVar[tuple[str, ...]] = TRADE_SUFFIXES

    def save(self, path: str | Path, scheme: Scheme = LIGHT) -> Path:
        """Write the table or the report.

        Parameters
        ----------
        path : of the output, .csv, .parquet or .html
        scheme : of a report, `LIGHT` or `DARK`

        Returns
        -------
        Path

        Raises
        ------
        RecordingError
            For another suffix, or a path that cannot be written.
        """
        return save_trade(self, Path(path), scheme)

    def describe(self) -> str:
        """Describe in a few lines the number of runs, and the best point by each figure of merit."""
        return "\n".join(summarize_trade(self))


class TradeRun:
    """A trade study to be run, or continued after an interruption, row by row; a context that holds its file of rows.

    The study is checked when this is built. `kept` is the path of the file, None where rows are not kept. It remains when
    the context ends.
    """

    def __init__(
        self,
        study: Study | str | Path,
        *,
        workers: int | None = None,
        working: str | Path | None = None,
        trust_code: bool = False,
        trust_fmu: bool = False,
    ) -> None:
        """Check a study.

        Parameters
        ----------
        study, workers, working, trust_code, trust_fmu : as for `trade`

        Raises
        ------
        ScenarioError
            For a study that is not valid, and where no point is a valid scenario.
        """
        check_workers(workers)
        study = study if isinstance(study, Study) else Study.load(study)
        threads = 1 if workers is not None and workers > 1 else None
        self._plan, self._base = make_trade_plan(study, threads, trust_code=trust_code, trust_fmu=trust_fmu)
        self._workers, self._context = workers, ExitStack()
        self.kept: Path | None = None
        self._file: RowFile | None = None
        self._known: dict[int, Row] = {}
        if working is not None:
            place = Path(working)
            self.kept = place.with_name(f"{place.name}.tmp-{identify(self._plan, self._base)}")
            self._file = RowFile(self.kept, study.n_rows)
            self._known = self._file.known

    def __enter__(self) -> Self:
        if self._file is not None:
            self._context.enter_context(self._file.opened())
        return self

    def __exit__(self, *error: object) -> None:
        self._context.close()

    @property
    def n_rows(self) -> int:
        """Number of rows of the study."""
        return self._plan.study.n_rows

    @property
    def n_done(self) -> int:
        """Number of rows that are finished."""
        return len(self._known)

    def list_other_files(self) -> list[str]:
        """List the names of files of rows that another study, scenario or version has left for the same table."""
        if self.kept is None:
            return []
        start = self.kept.name.rpartition("-")[0]
        beside = sorted(self.kept.parent.iterdir())
        return [path.name for path in beside if path.name.startswith(f"{start}-") and path.name != self.kept.name]

    def finish(self, on_row: Callable[[int, int], None] | None = None, *, executor: Executor | None = None) -> Trade:
        """Run the rows that are not finished.

        Parameters
        ----------
        on_row : called with the number of finished rows and that of all rows, after each row
        executor : as for `trade`

        Returns
        -------
        Trade
            The table.

        Raises
        ------
        RunError
            For a file of rows that cannot be written.
        """
        check_workers(self._workers, executor)
        plan = self._plan if executor is None else replace(self._plan, threads=1)
        for row in run_rows(plan, self._known, self._workers, executor):
            if self._file is not None:
                self._file.add(row)
            self._known[row["row"]] = row
            if on_row is not None:
                on_row(self.n_done, self.n_rows)
        return _tabulate_rows(self._plan, self._base, self._known)


def trade(
    study: Study | str | Path,
    *,
    workers: int | None = None,
    executor: Executor | None = None,
    working: str | Path | None = None,
    on_row: Callable[[int, int], None] | None = None,
    trust_code: bool = False,
    trust_fmu: bool = False,
) -> Trade:
    """Run a trade study: a table of figures of merit with one row for each point and seed.

    Parameters
    ----------
    study : the study, or its TOML file
    workers : number of processes that run points in parallel, instead of threads. The result does not depend on it. A
        script that uses workers keeps its own code under ``if __name__ == "__main__":``
    executor : in the manner of `concurrent.futures`, whose workers run points in place of `workers`: a pool of threads or
        processes, or ``client.get_executor()`` of dask. The result does not depend on it
    working : file in which finished rows are saved. An interrupted study continues from it. Its name is extended by eight
        hex digits that identify the study, so that another study does not use it. It remains until you delete it
    on_row : called with the number of finished rows and that of all rows, at the start and after each row
    trust_code, trust_fmu : whether Python code, and the native code of FMUs, that the scenario names may run

    Returns
    -------
    Trade
        The table.

    Raises
    ------
    ScenarioError
        For a study that is not valid, and where no point is a valid scenario.
    RunError
        For a file of rows that cannot be written.
    """
    check_workers(workers, executor)
    with TradeRun(study, workers=workers, working=working, trust_code=trust_code, trust_fmu=trust_fmu) as run:
        if on_row is not None:
            on_row(run.n_done, run.n_rows)
        return run.finish(on_row, executor=executor)


def _tabulate_rows(plan: TradePlan, base: Scenario, known: dict[int, Row]) -> Trade:
    """Build the table of all rows, in their order, from the finished rows by number."""
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
    finished_trade = Trade(study, base, plan, table)
    if finished_trade.needs_detection:
        table["detected"] = np.repeat(finished_trade.detected, study.seeds).astype(int)
        table["min_detection_fraction"] = np.full(len(rows), study.min_detection_fraction)
    return finished_trade


def _tabulate_field(axis: Axis, values: list[Any], column: int) -> np.ndarray:
    """Return the values of one field: as numbers where all of them are, else as TOML."""
    linked = len(axis.field) > 1
    own = [value[column] if linked and isinstance(value, list) else value for value in values]
    if all(type(value) in (int, float) for value in own):
        return np.array(own, dtype=float)
    return np.array([value if isinstance(value, str) else write_toml_value(value) for value in own])

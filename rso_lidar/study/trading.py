"""A trade study worked through: one run of a scenario for each point, side by side, kept as they come, and a table."""

from __future__ import annotations

import hashlib
import importlib.metadata
import json
import os
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from pydantic import ValidationError

from rso_lidar.errors import RsoLidarError, RunError, ScenarioError, unwarned
from rso_lidar.lock import Lock
from rso_lidar.processes import Processes
from rso_lidar.scenario import Scenario
from rso_lidar.scenario.load import read_toml
from rso_lidar.study.merits import judged
from rso_lidar.study.sampling import points, settings
from rso_lidar.study.trade_asked import Axis, Study, toml_of

_TRIED = 300  # points at most that are tried before anything is flown
_OF_AN_AXIS = 50  # values of one axis, alone
Row = dict[str, Any]


@dataclass(frozen=True, eq=False)
class Plan:
    """All that a row depends on but its number: it travels to other processes."""

    study: Study
    points: tuple[tuple[Any, ...], ...]
    text: str
    folder: Path
    where: str
    seed: int
    threads: int | None = None

    def scenario(self, row: int) -> Scenario:
        """Return the scenario of a row, or raise `ScenarioError`."""
        changes = tuple(f"{field}={text}" for field, text in self.settings(row).items())
        return Scenario.loads(self.text, folder=self.folder, where=self.where, settings=(*self.study.set, *changes))

    def settings(self, row: int) -> dict[str, str]:
        """Return by field what a row sets, as TOML text."""
        chosen = settings(self.study, self.points[row // self.study.seeds])
        return chosen | ({"seed": str(self.seed + row % self.study.seeds)} if self.study.seeds > 1 else {})

    def row(self, number: int) -> Row:
        """Return one row: merits, or why there are none."""
        study, merits = self.study, dict.fromkeys(self.study.merits, float("nan"))
        seed, why = self.seed, ""
        with unwarned():
            try:
                scenario = self.scenario(number)
                seed = scenario.seed
                which, frames = study.number(scenario), study.numbers(scenario)
                merits = judged(scenario, study.merits, which, frames, folder=self.folder, threads=self.threads)
            except RunError:
                raise
            except RsoLidarError as error:
                why = " ".join(str(error).split())
        return {"row": number, "seed": seed, "merits": merits, "error": why}


def plan_of(study: Study, threads: int | None = None) -> tuple[Plan, Scenario]:
    """Return the plan of a study and its scenario, once every field that it changes is known to be one."""
    base, path = study.base(), study.scenario_file()
    plan = Plan(study, tuple(points(study)), read_toml(path), path.parent, path.name, base.seed, threads)
    with unwarned():
        _check_fields(plan)
        _check_points(plan)
    return plan, base


def _check_fields(plan: Plan) -> None:
    """Raise where an axis names no field of the scenario, or gives values of another type."""
    for k, axis in enumerate(plan.study.axis):
        tried = {repr(point[k]): point[k] for point in plan.points}
        for value in list(tried.values())[:_OF_AN_AXIS]:
            for field, text in axis.settings(value).items():
                _check_field(plan, f"{plan.study.where}: axis[{k}]", field, text)


def _check_field(plan: Plan, place: str, field: str, text: str) -> None:
    changed = (*plan.study.set, f"{field}={text}")
    try:
        Scenario.loads(plan.text, folder=plan.folder, where=plan.where, settings=changed)
    except ScenarioError as error:
        key, misfit = _misfit(error, field)
        if misfit:
            said = str(error).removeprefix(f"--set {field}={text}: ")
            named = "" if field in said else f"{field}: "
            raise ScenarioError(f"{place}.{key}: {named}{said}") from None


def _misfit(error: ScenarioError, field: str) -> tuple[str, bool]:
    """Return which key of an axis is wrong for every point, and whether one is: no such field, or another type."""
    cause = error.__context__  # what the one line was made of
    if not isinstance(cause, ValidationError):
        return "field", str(error).startswith("--set ")
    steps = field.replace("[", ".").replace("]", "").split(".")
    for problem in cause.errors(include_url=False):
        last = str(problem["loc"][-1]) if problem["loc"] else ""
        if problem["type"] == "extra_forbidden" and last in steps:
            return "field", True
        if last == steps[-1] and (problem["type"].endswith("_type") or problem["type"] == "int_from_float"):
            return "values", True
    return "field", False


def _check_points(plan: Plan) -> None:
    """Raise where no point is a scenario that can be flown."""
    n = len(plan.points)
    first = None
    for point in dict.fromkeys(np.linspace(0, n - 1, min(n, _TRIED)).round().astype(int).tolist()):
        try:
            plan.scenario(point * plan.study.seeds)
        except ScenarioError as error:
            first = first or error
        else:
            return
    raise ScenarioError(f"{plan.study.where}: no point can be flown; the first: {first}")


# ---------------------------------------------------------------------------------------------------- working through


def identity(plan: Plan, base: Scenario) -> str:
    """Return eight hex digits that name a study: SHA-256 of it, of its scenario as resolved, and of the version."""
    version = importlib.metadata.version("rso-lidar"), base.source.versions["arithmetic"]
    parts = (plan.study.model_dump_json(), plan.text, base.source.scenario, *version)
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:8]


class Rows:
    """Rows kept in a file as they come, one JSON text a line: what was cut off goes on after its last whole line."""

    def __init__(self, path: Path, count: int) -> None:
        self.path, self._count = path, count
        self.known: dict[int, Row] = {}
        self._file: BinaryIO | None = None

    @contextmanager
    def opened(self) -> Iterator[Rows]:
        """Read what is there and keep others away; the file stays when the context ends."""
        lock = Lock(self.path.with_name(f".{self.path.name}.lock"))
        try:
            self._file = self.path.open("a+b")
            self._file.seek(0)
            whole = 0
            for line in self._file:
                row = _read(line, self._count)
                if row is None:
                    break
                self.known[row["row"]] = row
                whole += len(line)
            self._file.truncate(whole)
            yield self
        except OSError as error:
            raise RunError(
                f"{self.path}: cannot be written ({error.strerror or error}); make room and run again"
            ) from error
        finally:
            if self._file is not None:
                self._file.close()
            lock.release()

    def add(self, row: Row) -> None:
        """Keep a row; when this returns, a kill no longer loses it."""
        assert self._file is not None
        self._file.write((json.dumps(row) + "\n").encode())
        self._file.flush()
        os.fsync(self._file.fileno())
        self.known[row["row"]] = row


def _read(line: bytes, count: int) -> Row | None:
    """Return the row of a line; None where it was cut off."""
    try:
        row = json.loads(line)
    except ValueError:
        return None
    whole = line.endswith(b"\n") and isinstance(row, dict) and set(row) == {"row", "seed", "merits", "error"}
    return row if whole and 0 <= row["row"] < count else None


def work(plan: Plan, known: dict[int, Row], workers: int | None = None) -> Iterator[Row]:
    """Yield the rows that are not known yet, as they are done; a row depends on the plan and its number only."""
    left = [number for number in range(plan.study.n_rows) if number not in known]
    if workers is None or workers < 2 or len(left) < 2:
        yield from map(plan.row, left)
        return
    with Processes(min(workers, len(left)), partial(Plan.row, plan)) as processes:
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


@dataclass(frozen=True, eq=False)
class Trade:
    """A trade study and its answers: `table` holds columns (row) by name: row, seed, fields, figures of merit, error."""

    study: Study
    base: Scenario
    plan: Plan
    table: dict[str, np.ndarray]

    def of_points(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """Return mean and standard deviation (point) of a figure of merit over its seeds; NaN where none has one."""
        values = self.table[name].reshape(-1, self.study.seeds)
        known = np.isfinite(values)
        count = known.sum(axis=1)
        mean = np.where(count > 0, np.where(known, values, 0.0).sum(axis=1) / np.maximum(count, 1), np.nan)
        squared = np.where(known, (values - mean[:, None]) ** 2, 0.0).sum(axis=1)
        return mean, np.where(count > 1, np.sqrt(squared / np.maximum(count - 1, 1)), np.nan)

    def save(self, path: str | Path) -> Path:
        """Return the path of the table (.csv, .parquet) or of the report (.html), written whole or not at all."""
        from rso_lidar.study.report import save

        return save(self, Path(path))


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
    plan, base = plan_of(asked, threads=1 if workers is not None and workers > 1 else None)
    tell = on_row or (lambda done, count: None)
    known: dict[int, Row] = {}
    if working is None:
        tell(0, asked.n_rows)
        for row in work(plan, known, workers):
            known[row["row"]] = row
            tell(len(known), asked.n_rows)
        return tabled(plan, base, known)
    with Rows(working_file(Path(working), plan, base), asked.n_rows).opened() as rows:
        tell(len(rows.known), asked.n_rows)
        for row in work(plan, rows.known, workers):
            rows.add(row)
            tell(len(rows.known), asked.n_rows)
        return tabled(plan, base, rows.known)


def working_file(place: Path, plan: Plan, base: Scenario) -> Path:
    """Return the file in which rows are kept that go to `place` in the end."""
    return place.with_name(f"{place.name}.tmp-{identity(plan, base)}")


def tabled(plan: Plan, base: Scenario, known: dict[int, Row]) -> Trade:
    """Return the table of all rows, in their order."""
    study = plan.study
    rows = [known[number] for number in range(study.n_rows)]
    table = {"row": np.array([row["row"] for row in rows]), "seed": np.array([row["seed"] for row in rows])}
    for k, axis in enumerate(study.axis):
        values = [plan.points[number // study.seeds][k] for number in range(study.n_rows)]
        for column, field in enumerate(axis.field):
            if field != "seed":
                table[field] = _column(axis, values, column)
    table |= {name: np.array([row["merits"][name] for row in rows], dtype=float) for name in study.merits}
    table["error"] = np.array([row["error"] for row in rows])
    return Trade(study, base, plan, table)


def _column(axis: Axis, values: list[Any], column: int) -> np.ndarray:
    """Return the values of one field: as numbers where all are, else as TOML."""
    linked = len(axis.field) > 1
    own = [value[column] if linked and isinstance(value, list) else value for value in values]
    if all(type(value) in (int, float) for value in own):
        return np.array(own, dtype=float)
    return np.array([value if isinstance(value, str) else toml_of(value) for value in own])

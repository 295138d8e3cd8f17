"""The steps of a served flight, one JSON object to a line beside its recording, from which the flight can be repeated."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Annotated, Literal, NamedTuple, TypeVar

from pydantic import Field, ValidationError

from rso_lidar.errors import RecordingError, ScenarioError
from rso_lidar.files import check_regular, explain_unreadable, make_write_error
from rso_lidar.loop.service.requests import CommandRequest, Nanoseconds, parse_json
from rso_lidar.part import Flag, Part, Text, Whole, explain
from rso_lidar.records import Command, Frame
from rso_lidar.simulation import Simulation
from rso_lidar.units import NS_PER_S

SUFFIX = ".commands.jsonl"
_MOST_BYTES = 2**34  # 16 GiB: months of steps at 10 Hz, some 100 bytes each
_Line = TypeVar("_Line", bound=Part)


class FlownStep(NamedTuple):
    """One step of a simulation under the command in force behind the link; `dt_ns` is None for one to the next flash."""

    time_ns: int
    dt_ns: int | None
    command: Command | None
    is_skipped: bool = False


class LogHeader(Part):
    """First line of the log: what is flown."""

    log: Literal["rso_lidar.commands"] = Field(default="rso_lidar.commands", description="Kind of the file.")
    version: Literal[1] = Field(default=1, description="Version of the layout.")
    digest: Text = Field(description="Digest of the scenario, whatever its seed, and of its frames.")
    seed: Whole = Field(description="Seed of all noise.")


class LoggedStep(Part):
    """Each further line of the log: a step of a simulation."""

    time_ns: Nanoseconds = Field(description="Beginning of the step, since start_utc [ns].")
    dt_ns: Annotated[Whole, Field(ge=1)] | None = Field(
        default=None, description="Length of the step [ns]; left out: to the next flash."
    )
    command: CommandRequest | None = Field(default=None, description="Command in force; left out: none.")
    is_skipped: Flag = Field(default=False, description="Whether the flash was left out because the machine was late.")


class CommandLog:
    """Writes the steps of one flight; they are in the temporary file when `write` returns.

    Parameters
    ----------
    path : of the log once the flight is complete
    """

    def __init__(self, path: Path, run_id: str, simulation: Simulation) -> None:
        self.path, self._temporary = path, path.with_name(f"{path.name}.tmp-{run_id}")
        header = LogHeader(digest=simulation.digest, seed=simulation.scenario.seed)
        self._append([header.model_dump_json() + "\n"])

    def write(self, steps: Iterable[FlownStep]) -> None:
        """Write steps."""
        self._append([_write_line(step) for step in steps])

    def _append(self, lines: list[str]) -> None:
        try:
            with self._temporary.open("a", encoding="utf-8", newline="\n") as file:
                file.writelines(lines)
        except OSError as error:
            raise make_write_error(self.path, error) from error

    def complete(self, *, keep: bool) -> None:
        """Give the log its name.

        Parameters
        ----------
        keep : whether the flight has frames; else the log is deleted
        """
        try:
            if keep:
                self._temporary.replace(self.path)
            else:
                self._temporary.unlink()
        except OSError as error:
            raise make_write_error(self.path, error) from error


def _write_line(step: FlownStep) -> str:
    given = None if step.command is None else CommandRequest(**vars(step.command))
    line = LoggedStep(time_ns=step.time_ns, dt_ns=step.dt_ns, command=given, is_skipped=step.is_skipped)
    return line.model_dump_json(exclude_none=True) + "\n"


def repeat_flight(simulation: Simulation, path: str | os.PathLike[str]) -> Iterator[Frame]:
    """Yield the frames of a served flight again, bit for bit, from the log of its commands.

    Parameters
    ----------
    simulation : of the scenario in the recording, at t = 0
    path : of the log, such as ``a.commands.jsonl`` beside ``a.h5``. A last line without its end, which a killed server
        leaves, is left out

    Returns
    -------
    iterator of the frames.

    Raises
    ------
    RecordingError
        If the file cannot be read, or is not a log of this scenario.
    """
    check_regular(Path(path), _MOST_BYTES, RecordingError, f"{SUFFIX} file")
    try:
        with Path(path).open("rb") as lines:
            _check_header(_parse_line(next(lines, b""), LogHeader, f"{path}: line 1"), simulation, f"{path}: line 1")
            for number, line in enumerate(lines, 2):
                if not line.endswith(b"\n"):
                    return
                where = f"{path}: line {number}"
                step = _parse_line(line, LoggedStep, where)
                if step.time_ns != round(simulation.time_s * NS_PER_S):
                    raise RecordingError(
                        f"{where}: begins at {step.time_ns} ns and the simulation is at {simulation.time_s:.9g} s; "
                        "begin at t = 0 of the recording's scenario"
                    )
                if (frame := _repeat_step(simulation, step, where)) is not None:
                    yield frame
    except OSError as error:
        raise RecordingError(explain_unreadable(path, error)) from error


def _repeat_step(simulation: Simulation, step: LoggedStep, where: str) -> Frame | None:
    """Step a simulation as the log says."""
    command = step.command.to_command() if step.command else None
    length_s = {} if step.dt_ns is None else {"dt_s": step.dt_ns / NS_PER_S}
    try:
        if not step.is_skipped:
            return simulation.step(command, **length_s)
        simulation.advance(command)
    except ScenarioError as error:
        raise RecordingError(f"{where}: {error}") from None
    return None


def _check_header(header: LogHeader, simulation: Simulation, where: str) -> None:
    """Check that a simulation flies what the log is of."""
    if header.digest != simulation.digest:
        raise RecordingError(f"{where}: is of another scenario; load the scenario in the recording beside it")
    if header.seed != simulation.scenario.seed:
        raise RecordingError(
            f"{where}: the seed is {header.seed} and that of the simulation {simulation.scenario.seed}; reset it with "
            "this seed"
        )


def _parse_line(line: bytes, kind: type[_Line], where: str) -> _Line:
    """Return what a line holds."""
    try:
        tree = parse_json(line, where)
        return kind.model_validate(tree)
    except ScenarioError as error:
        raise RecordingError(str(error)) from None
    except ValidationError as error:
        raise RecordingError(f"{where}: {explain(error, kind, tree)}") from None

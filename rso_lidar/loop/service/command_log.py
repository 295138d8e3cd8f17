"""The steps of a served flight, one JSON object to a line beside its recording, from which the flight can be repeated."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Annotated, NamedTuple

from pydantic import Field, ValidationError

from rso_lidar.errors import RecordingError, ScenarioError
from rso_lidar.files import make_write_error
from rso_lidar.loop.service.requests import CommandRequest, Nanoseconds, parse_json
from rso_lidar.part import Flag, Part, Whole, explain
from rso_lidar.records import Command, Frame
from rso_lidar.simulation.stepping import Simulation

SUFFIX = ".commands.jsonl"
_NS_PER_S = 1_000_000_000


class FlownStep(NamedTuple):
    """One step of a simulation under the command in force behind the link; `dt_ns` is None for one to the next flash."""

    time_ns: int
    dt_ns: int | None
    command: Command | None
    is_skipped: bool = False


class LoggedStep(Part):
    """One line of the log: a step of a simulation."""

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
    path : of the log once the flight is complete.
    run_id : of the temporary name.
    """

    def __init__(self, path: Path, run_id: str) -> None:
        self.path, self._temporary = path, path.with_name(f"{path.name}.tmp-{run_id}")

    def write(self, steps: Iterable[FlownStep]) -> None:
        """Write steps.

        Parameters
        ----------
        steps : in their order.
        """
        lines = [_write_line(step) for step in steps]
        try:
            with self._temporary.open("a", encoding="utf-8", newline="\n") as file:
                file.writelines(lines)
        except OSError as error:
            raise make_write_error(self.path, error) from error

    def complete(self, *, keep: bool) -> None:
        """Give the log its name.

        Parameters
        ----------
        keep : whether the flight has frames; else the log is deleted.
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
    simulation : of the scenario in the recording, at t = 0.
    path : of the log, such as ``a.commands.jsonl`` beside ``a.h5``.

    Returns
    -------
    iterator of the frames.

    Raises
    ------
    RecordingError
        If the file cannot be read, or is not a log of this scenario.
    """
    try:
        with Path(path).open("rb") as lines:
            for number, line in enumerate(lines, 1):
                where = f"{path}: line {number}"
                step = _parse_step(line, where)
                if step.time_ns != round(simulation.time_s * _NS_PER_S):
                    raise RecordingError(
                        f"{where}: begins at {step.time_ns} ns and the simulation is at {simulation.time_s:.9g} s; "
                        "begin at t = 0 of the recording's scenario"
                    )
                command = step.command.to_command() if step.command else None
                if step.is_skipped:
                    simulation.advance(command)
                    continue
                length_s = {} if step.dt_ns is None else {"dt_s": step.dt_ns / _NS_PER_S}
                if (frame := simulation.step(command, **length_s)) is not None:
                    yield frame
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read ({error.strerror}); give a {SUFFIX} file") from error


def _parse_step(line: bytes, where: str) -> LoggedStep:
    """Return the step of a line.

    Parameters
    ----------
    line : of the log.
    where : start of error messages.
    """
    try:
        tree = parse_json(line, where)
        return LoggedStep.model_validate(tree)
    except ScenarioError as error:
        raise RecordingError(str(error)) from None
    except ValidationError as error:
        raise RecordingError(f"{where}: {explain(error, LoggedStep, tree)}") from None

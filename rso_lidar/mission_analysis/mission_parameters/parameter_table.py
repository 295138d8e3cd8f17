"""The table of a mission's parameters, which writes itself as text, CSV, JSON or SysML v2."""

from __future__ import annotations

import importlib.metadata
import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from rso_lidar.errors import ScenarioError, did_you_mean
from rso_lidar.files import align_columns, check_writable, format_csv, write_text
from rso_lidar.mission_analysis.mission_parameters.parameter_list import MissionParameter, iterate_parameters
from rso_lidar.mission_analysis.mission_parameters.sysml_text import write_model
from rso_lidar.scenario import Scenario

_COLUMNS = ("path", "value", "unit", "meaning", "default", "source", "is_derived")
_WIDEST = 40  # characters of a value on the terminal


@dataclass(frozen=True, eq=False)
class ParameterTable:
    """The parameters of a mission: `name` is its title, `parameters` its keys and derived figures in order.

    `SUFFIXES` are those of the files that `save` writes.
    """

    SUFFIXES: ClassVar[tuple[str, ...]] = (".csv", ".json", ".sysml")

    name: str
    parameters: tuple[MissionParameter, ...]

    def find(self, path: str) -> MissionParameter:
        """Return the parameter at a place such as ``lidar.receiver.ifov_rad``.

        Parameters
        ----------
        path : as `MissionParameter.path`

        Raises
        ------
        ScenarioError
            If there is none.
        """
        by_path = {parameter.path: parameter for parameter in self.parameters}
        if path not in by_path:
            raise ScenarioError(
                f"'{path}': the scenario has no such parameter{did_you_mean(path, by_path)}; "
                "`rso-lidar parameters` lists them"
            )
        return by_path[path]

    def table(self) -> str:
        """Return a text table: path, value with unit, and source. Derived numbers have nine digits; files have them all."""
        rows = []
        for parameter in self.parameters:
            if parameter.value is not None:
                text = _shorten(_format_value(_round_derived(parameter)))
                unit = "" if parameter.unit == "1" else parameter.unit
                rows.append((parameter.path, f"{text} {unit}".rstrip(), parameter.source))
        return "\n".join(align_columns(rows, left=(0, 1, 2)))

    def csv_text(self) -> str:
        """Return all parameters as CSV, one per row; a key without a value has an empty one."""
        rows = [
            (
                parameter.path,
                _format_value(parameter.value),
                parameter.unit,
                parameter.meaning,
                _format_value(parameter.default),
                parameter.source,
                int(parameter.is_derived),
            )
            for parameter in self.parameters
        ]
        return format_csv([_COLUMNS, *rows])

    def json_text(self) -> str:
        """Return all parameters as JSON: a list of objects with the columns of the CSV table."""
        rows = [{name: getattr(parameter, name) for name in _COLUMNS} for parameter in self.parameters]
        return json.dumps({"name": self.name, "parameters": rows}, indent=1, default=str, ensure_ascii=False) + "\n"

    def sysml_text(self, more: Iterable[str] = ()) -> str:
        """Return all parameters as a package in the textual notation of SysML v2.

        Parameters
        ----------
        more : further lines of the package, such as those of requirements
        """
        version = importlib.metadata.version("rso-lidar")
        about = f"Parameters of the mission {self.name}. Written by rso-lidar {version}."
        return write_model(self.name, self.parameters, about, more)

    def save(self, path: str | Path, *, overwrite: bool = False, more: Iterable[str] = ()) -> Path:
        """Write the table.

        Parameters
        ----------
        path : of the output, .csv, .json or .sysml
        overwrite : whether an existing file may be replaced
        more : further lines of a .sysml file

        Returns
        -------
        Path

        Raises
        ------
        RecordingError
            For another suffix, or a path that cannot be written.
        """
        place = check_writable(path, self.SUFFIXES, overwrite=overwrite)
        suffix = place.suffix.lower()
        text = (
            self.sysml_text(more) if suffix == ".sysml" else self.json_text() if suffix == ".json" else self.csv_text()
        )
        return write_text(place, text, overwrite=overwrite)


def list_parameters(scenario: Scenario) -> ParameterTable:
    """List all parameters of a scenario: keys with value, unit, meaning, default and source, and derived figures.

    Parameters
    ----------
    scenario : the scenario

    Returns
    -------
    ParameterTable

    Raises
    ------
    ScenarioError
        For another object, and for a scenario that names files which cannot be read.
    """
    parameters = tuple(iterate_parameters(scenario))
    return ParameterTable(scenario.name, parameters)


def _round_derived(parameter: MissionParameter) -> Any:
    """Return the value of a parameter, to nine digits where it is a derived number."""
    value = parameter.value
    return float(f"{value:.9g}") if parameter.is_derived and isinstance(value, float) else value


def _format_value(value: Any) -> str:
    """Return a value as text: numbers in full, lists in brackets, nothing for none.

    >>> _format_value((0.5, -3000.0)), _format_value(None), _format_value(True)
    ('[0.5, -3000.0]', '', 'true')
    """
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple):
        return f"[{', '.join(_format_value(item) for item in value)}]"
    if isinstance(value, dict):
        return json.dumps(value, default=str, ensure_ascii=False)
    return str(value)


def _shorten(text: str) -> str:
    return text if len(text) <= _WIDEST else f"{text[: _WIDEST - 1]}…"

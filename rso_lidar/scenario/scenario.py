"""Scenario: a mission in one file, and what is asked of it."""

from __future__ import annotations

from functools import cached_property

from rso_lidar.errors import ScenarioError
from rso_lidar.part import name_object, python_objects
from rso_lidar.records import Source
from rso_lidar.scenario.mission.mission import Mission
from rso_lidar.scenario.mission.provenance import arithmetic_in_words, source_of
from rso_lidar.scenario.review.advice import advice
from rso_lidar.scenario.review.description import describe


class Scenario(Mission):
    """Everything that a simulation needs, as its TOML file says it.

    Relative paths are looked up beside the scenario file, then among the shipped data.
    """

    @property
    def source(self) -> Source:
        """Record of where frames come from, which every frame carries; it names the arithmetic in force."""
        made_by = arithmetic_in_words()
        if made_by not in self._sources:
            self._sources[made_by] = source_of(self)
        return self._sources[made_by]

    @cached_property
    def _sources(self) -> dict[str, Source]:
        return {}

    def dumps(self) -> str:
        """Return the scenario as TOML, with every default written out and element sets inline.

        Raises `ScenarioError` where it holds a Python object in place of a part: a text cannot bring that back.
        """
        for one in python_objects(self):
            raise ScenarioError(
                f"{self._where}: holds the Python object {name_object(one)}, which TOML cannot; "
                "keep the script that builds the scenario"
            )
        return self.source.scenario

    def describe(self) -> str:
        """Return some twenty lines for a person: orbit, geometry, optics, link budget, warnings."""
        return describe(self)

    def advice(self) -> list[str]:
        """Return one warning for each setting that is allowed but probably not intended."""
        return advice(self)


def need_scenario(given: object, asked_by: str) -> None:
    """Raise `ScenarioError` for what is no scenario."""
    if not isinstance(given, Scenario):
        raise ScenarioError(f"{asked_by}: needs a Scenario, not {given!r:.60}; Scenario.load reads one from a file")

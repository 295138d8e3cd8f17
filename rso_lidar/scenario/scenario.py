"""Scenario: a mission in one file, with its description and its record of origin."""

from __future__ import annotations

from functools import cached_property

from rso_lidar import motion
from rso_lidar.errors import ScenarioError, did_you_mean
from rso_lidar.part import name_object, python_objects
from rso_lidar.records import Source, Truth
from rso_lidar.scenario.assessment.advice import advise
from rso_lidar.scenario.assessment.description import describe
from rso_lidar.scenario.mission.mission import Mission
from rso_lidar.scenario.mission.provenance import build_source
from rso_lidar.scenario.mission.target_keypoints import CarriedPoints, group_keypoints


class Scenario(Mission):
    """Everything that a simulation needs, as its TOML file says it.

    Relative paths are looked up beside the scenario file, then among the shipped data.

    >>> scenario = Scenario.loads('''
    ... version = 1
    ... name = "a plate on a bench"
    ... world = { axes = "local" }
    ... time = { start_utc = 2024-09-17T12:00:00Z, duration_s = 2, frame_rate_hz = 5 }
    ... follower = { motion = { type = "fixed", position_m = [0, 0, 0] } }
    ... lidar = { preset = "gsfl_1064" }
    ... target = [{ name = "plate", model = "plate", motion = { type = "fixed", position_m = [1000, 0, 0] } }]
    ... ''')
    >>> scenario.time.n_frames
    10
    """

    @cached_property
    def source(self) -> Source:
        """Record of where frames come from, which every frame carries."""
        return build_source(self)

    @cached_property
    def carried_points(self) -> tuple[CarriedPoints, ...]:
        """Keypoints of all targets, by the axes that carry them."""
        radii_m = [
            max(surface.radius_m for surface in self.surfaces_of(number)) if entry.keypoints else 0.0
            for number, entry in enumerate(self.source.targets)
        ]
        return group_keypoints(self.target, self.source.targets, radii_m)

    def dumps(self) -> str:
        """Return the scenario as TOML, with every default written out and element sets inline.

        Raises `ScenarioError` where it holds a Python object in place of a part: a text cannot bring that back.
        """
        for python_object in python_objects(self):
            raise ScenarioError(
                f"{self._where}: holds the Python object {name_object(python_object)}, which TOML cannot; "
                "keep the script that builds the scenario"
            )
        return self.source.scenario

    def apply_light_time(self, truth: Truth) -> Truth:
        """Return the truth that rays are cast into: if `world.light_time`, with the targets where light meets them.

        Parameters
        ----------
        truth : at emission, with the lidar in it
        """
        if not self.world.light_time:
            return truth
        with self.locate_errors():
            return motion.apply_light_time(truth, [surface.name for surface in self.surfaces])

    def describe(self) -> str:
        """Return about twenty lines of text: orbit, geometry, optics, link budget, warnings."""
        return describe(self)

    def advice(self) -> list[str]:
        """Return one warning for each setting that is allowed but probably not intended."""
        return advise(self)


def find_target(scenario: Scenario, target: str | None, asked_by: str) -> int:
    """Return the index of a target.

    Parameters
    ----------
    scenario : with its targets
    target : name of the target (None: the first)
    asked_by : beginning of the message of an error

    Raises
    ------
    ScenarioError
        For a scenario without targets, or without that target.
    """
    names = [candidate.name for candidate in scenario.target]
    if not names:
        raise ScenarioError(f"{asked_by}: the scenario has no target; add a [[target]]")
    if target is not None and target not in names:
        raise ScenarioError(
            f"{asked_by}: no target named '{target}'{did_you_mean(target, names)} (known: {', '.join(names)})"
        )
    return 0 if target is None else names.index(target)


def require_scenario(given: object, asked_by: str) -> None:
    """Check that an object is a scenario.

    Parameters
    ----------
    given : the object
    asked_by : name of the calling function, which begins the message

    Raises
    ------
    ScenarioError
        If it is not.
    """
    if not isinstance(given, Scenario):
        raise ScenarioError(f"{asked_by}: needs a Scenario, not {given!r:.60}; Scenario.load reads one from a file")

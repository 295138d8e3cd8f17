"""The objects of a search: read from files of element sets, ephemerides and scenarios, or given as objects."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from rso_lidar.errors import CatalogError, PropagationError, ScenarioError, did_you_mean, quote_value
from rso_lidar.motion import Chief
from rso_lidar.orbit import (
    Catalog,
    ElementSet,
    Ephemeris,
    Epochs,
    NamedTrajectory,
    Trajectory,
    format_utc,
    is_message_of,
    list_ephemeris_objects,
    read_element_sets,
    read_opm,
    read_table_text,
)
from rso_lidar.records import BodyState
from rso_lidar.scenario import Scenario, list_lunar_bodies

_SNIFFED = 4096  # characters of a file that tell its kind
_FOLLOWER = "follower"


@dataclass(eq=False)
class SearchObjects:
    """Element sets and trajectories of a search, and the problems of those that cannot be used.

    Parameters
    ----------
    entries : the element sets, and `NamedTrajectory` objects
    problems : label and reason of what was left out
    where : name of the source, for messages
    trust_code, trust_fmu : whether Python code and FMUs may run that scenarios among the files name
    settings : fields that are set in the scenarios among the files, each as `key=value`
    """

    entries: list[Any] = field(default_factory=list)
    problems: list[tuple[str, str]] = field(default_factory=list)
    where: str = "catalogue"
    trust_code: bool = False
    trust_fmu: bool = False
    settings: tuple[str, ...] = ()

    def find(self, wanted: int | str, source: Any) -> list[Any]:
        """Find the entries of one object: its element sets, or its trajectory.

        Parameters
        ----------
        wanted : catalogue number or name; of a trajectory also its name in its file, where no other one has that
        source : the catalogue as it was given, for error messages

        Raises
        ------
        CatalogError
            If there is none of that name, or several objects have it.
        """
        text = str(wanted).strip()

        def matches(entry: Any) -> bool:
            if text.isdigit():
                return bool(entry.norad_id == int(text))
            return bool(entry.name.casefold() == text.casefold())

        meant = [entry for entry in self.entries if matches(entry)] or self._find_in_sources(text)
        if not meant:
            read = read_element_sets(source) if is_catalog_file(source) else []
            for entry in filter(matches, read):
                raise CatalogError(f"follower: {entry.problem}")
            known = {
                (str(listed_object.norad_id) if text.isdigit() else listed_object.name.casefold()): listed_object
                for listed_object in self.entries
            }
            guess = did_you_mean(text.casefold(), filter(None, known))
            for key, listed_object in known.items() if guess else ():
                guess = guess.replace(
                    f"'{key}'?", f"'{listed_object.norad_id if text.isdigit() else listed_object.name}'?"
                )
            held = f"{len(self.entries):,} element sets"
            if not all(isinstance(entry, ElementSet) for entry in self.entries):
                held = f"{len(self.entries):,} element sets and trajectories"
            raise CatalogError(f"{self.where}: no follower '{text}' among {held}{guess or '; check it'}")
        flown = [entry for entry in meant if not isinstance(entry, ElementSet)]
        if len(flown) + bool(len(meant) > len(flown)) > 1:
            raise CatalogError(
                f"{self.where}: '{text}' names {len(flown)} trajectories and {len(meant) - len(flown)} element sets; "
                "give the file of the follower, or rename one"
            )
        if not flown and len({entry.norad_id for entry in meant}) > 1:
            numbers = ", ".join(str(number) for number in sorted({entry.norad_id for entry in meant})[:6])
            raise CatalogError(
                f"{self.where}: several objects are named '{text}' ({numbers}); give the catalogue number"
            )
        return meant

    def _find_in_sources(self, text: str) -> list[Any]:
        """Find the trajectory that has a name in its file and is listed under another one.

        Raises
        ------
        CatalogError
            If those of several files have it.
        """
        meant = [
            entry
            for entry in self.entries
            if isinstance(entry, NamedTrajectory) and entry.name_in_source.casefold() == text.casefold()
        ]
        if text and len(meant) > 1:
            names = ", ".join(f"'{entry.name}'" for entry in meant[:6])
            raise CatalogError(f"{self.where}: '{text}' names {len(meant)} trajectories; give one of {names}")
        return meant if text else []


def collect_objects(
    source: Any, *, settings: Iterable[str] = (), trust_code: bool = False, trust_fmu: bool = False
) -> SearchObjects:
    """Collect the objects of a search.

    Parameters
    ----------
    source : path of a file, a catalogue, an iterable of element sets, trajectories and paths, or a mapping of names to
        trajectories
    settings : fields that are set in the scenarios among the files, each as `key=value`
    trust_code, trust_fmu : whether Python code and FMUs may run that scenarios among the files name

    Raises
    ------
    CatalogError
        For what is none of these.
    """
    objects = SearchObjects(trust_code=trust_code, trust_fmu=trust_fmu, settings=tuple(settings))
    if isinstance(source, str | os.PathLike):
        objects.where = str(os.fspath(source))
        _add_file(objects, os.fspath(source))
    elif isinstance(source, bytes) or not isinstance(source, Iterable):
        raise CatalogError(
            f"catalogue: {quote_value(source)} is not a catalogue; give a path, a catalogue or element sets"
        )
    elif isinstance(source, Mapping):
        objects.entries += [_name(str(name), entry) for name, entry in source.items()]
    else:
        _add_entries(objects, source)
        _add_problems(objects, source)
    objects.entries = _distinguish(objects.entries)
    bad = [entry for entry in objects.entries if isinstance(entry, ElementSet) and entry.problem is not None]
    objects.problems = [(element_set.label, str(element_set.problem)) for element_set in bad] + objects.problems
    objects.entries = [
        entry for entry in objects.entries if not (isinstance(entry, ElementSet) and entry.problem is not None)
    ]
    return objects


def _distinguish(entries: list[Any]) -> list[Any]:
    """Put the name of the file before the name of a trajectory, where those of several files have that name."""
    files: dict[str, set[str]] = {}
    for entry in entries:
        if isinstance(entry, NamedTrajectory):
            files.setdefault(entry.name, set()).add(entry.source)
    stems: dict[str, set[str]] = {}
    for source in set().union(*files.values()):
        stems.setdefault(Path(source).stem, set()).add(source)
    shown = {
        source: stem if len(sources) == 1 else f"{Path(source).parent.name}/{stem}"
        for stem, sources in stems.items()
        for source in sources
    }
    return [
        replace(entry, name=f"{shown[entry.source]} {entry.name}", name_in_source=entry.name_in_source or entry.name)
        if isinstance(entry, NamedTrajectory) and entry.source and len(files[entry.name]) > 1
        else entry
        for entry in entries
    ]


def _add_entries(objects: SearchObjects, source: Iterable[Any]) -> None:
    read = set[str]()
    for entry in source:
        if isinstance(entry, str | os.PathLike):
            path = _resolve(os.fspath(entry))
            if path not in read:  # a file that is given twice holds the same objects
                read.add(path)
                _add_file(objects, os.fspath(entry))
        elif isinstance(entry, ElementSet | NamedTrajectory):
            objects.entries.append(entry)
        elif isinstance(entry, Trajectory):
            objects.entries.append(NamedTrajectory(f"trajectory {len(objects.entries) + 1}", entry))
        else:
            raise CatalogError(
                f"catalogue: {quote_value(entry)} in it is not an element set; read the sets with Catalog, or give objects "
                "that answer states"
            )


def list_names(entry: Any) -> list[str]:
    """List by what an object of a search can be named, in lower case: number, name, name in its own file, and label."""
    words = (str(getattr(entry, key, "") or "") for key in ("norad_id", "name", "name_in_source", "label"))
    return [word.casefold() for word in words if word]


def check_names(place: str, names: Iterable[str], entries: Iterable[Any]) -> None:
    """Check that objects of a search have names that an argument states, or raise `ScenarioError`.

    Parameters
    ----------
    place : name of the argument
    """
    known = {name: entry for entry in entries for name in list_names(entry)}
    for name in names:
        if name.casefold() not in known:
            near = did_you_mean(name.casefold(), known)
            raise ScenarioError(f"{place}: no object of the search has the name or number '{name}'{near}; correct it")


def _name(name: str, entry: Any) -> Any:
    if isinstance(entry, ElementSet | NamedTrajectory):
        return entry
    if not isinstance(entry, Trajectory):
        raise CatalogError(
            f"catalogue: {name}: {quote_value(entry)} has no states; give a trajectory or an element set"
        )
    return NamedTrajectory(name, entry)


def _add_problems(objects: SearchObjects, source: Any) -> None:
    other = (problem.rpartition(": ") for problem in getattr(source, "problems", ()))
    objects.problems += [(place, what) for place, _, what in other]


def _add_file(objects: SearchObjects, path: Any) -> None:
    """Add the objects of a file: bodies of a scenario, objects of an ephemeris, the state of an OPM, or element sets."""
    text = str(path)
    kind = _find_kind(text)
    if kind == "scenario":
        scenario = Scenario.load(text, objects.settings, trust_code=objects.trust_code, trust_fmu=objects.trust_fmu)
        orbiting = [body for body in scenario.bodies if body.orbits]
        for body in orbiting or scenario.bodies:
            objects.entries.append(_name_body(text, scenario, body.name))
    elif kind == "ephemeris":
        names = list_ephemeris_objects(text)
        for name in names:
            objects.entries.append(NamedTrajectory(name, Ephemeris(file=text, object=name), source=_resolve(text)))
        if not names:
            objects.entries.append(NamedTrajectory(Path(text).stem, Ephemeris(file=text), source=_resolve(text)))
    elif kind == "state":
        objects.entries.append(NamedTrajectory(Path(text).stem, read_opm(text), source=_resolve(text)))
    else:
        catalog = Catalog.from_file(path)
        objects.entries += list(catalog)
        _add_problems(objects, catalog)


def _name_body(path: str, scenario: Scenario, name: str) -> NamedTrajectory:
    """Name a body of a scenario: a target by its name, the follower by the file as well."""
    trajectory, source = BodyTrajectory(scenario, name), _resolve(path)
    if name != _FOLLOWER:
        return NamedTrajectory(name, trajectory, source=source)
    return NamedTrajectory(f"{Path(path).stem} {name}", trajectory, source=source, name_in_source=name)


def _resolve(path: str) -> str:
    return str(Path(path).resolve())


def load_follower(path: str, *, settings: Iterable[str] = (), trust_code: bool = False, trust_fmu: bool = False) -> Any:
    """Load the follower of a search from a file of one object: element sets, an ephemeris, or a scenario's follower.

    Parameters
    ----------
    settings : fields that are set in a scenario, each as `key=value`
    trust_code, trust_fmu : whether Python code and FMUs may run that a scenario names

    Raises
    ------
    CatalogError
        If the file holds several objects.
    """
    if _find_kind(path) == "scenario":
        scenario = Scenario.load(path, tuple(settings), trust_code=trust_code, trust_fmu=trust_fmu)
        return _name_body(path, scenario, _FOLLOWER)
    objects = collect_objects(path)
    if not objects.entries:
        label, why = (objects.problems or [("the file", "it holds no object; give another one")])[0]
        raise CatalogError(f"{path}: {label}: {why}")
    names = {getattr(entry, "label", "") for entry in objects.entries}
    if len(names) != 1:
        some = ", ".join(sorted(names)[:4])
        raise CatalogError(
            f"{path}: holds {len(names)} objects ({some}); give it as a catalogue, and the follower by its name"
        )
    return objects.entries[0] if len(objects.entries) == 1 else objects.entries


def is_catalog_file(source: Any) -> bool:
    """Return whether a source is the path of a file of element sets."""
    return isinstance(source, str | os.PathLike) and _find_kind(str(source)) == "elements"


def _find_kind(path: str) -> str:
    """Return what a file holds by its suffix and first lines: "scenario", "ephemeris", "state" or "elements".

    Raises
    ------
    CatalogError
        For a tracking data message, which holds no orbit.
    """
    if Path(path).suffix.lower() == ".toml":
        return "scenario"
    if not Path(path).is_file():
        return "elements"  # the reader of element sets explains what is wrong
    if str(path).lower().removesuffix(".gz").endswith(".oem"):
        return "ephemeris"  # whose reader explains what is wrong
    try:
        head = read_table_text(Path(path))[:_SNIFFED]
    except ScenarioError:
        return "elements"
    words = head.lower()
    columns = {cell.strip() for cell in words.lstrip().splitlines()[0].split(",")} if words.strip() else set()
    is_table = {"x_m", "x_km"} & columns and {"time_s", "utc", "epoch"} & columns
    if is_table or is_message_of("OEM", head):
        return "ephemeris"
    if is_message_of("TDM", head):
        raise CatalogError(
            f"{path}: a tracking data message (TDM) holds measurements, such as ranges and directions, and no orbit; "
            f"fit one to them with rso-lidar fit {Path(path).name} --own OBSERVER.opm, and give an OEM, OPM, TLE or scenario"
        )
    return "state" if is_message_of("OPM", head) else "elements"


class BodyTrajectory:
    """The trajectory of a body of a scenario, from the scenario's start on.

    Parameters
    ----------
    scenario : the scenario
    name : of the target, or "follower"

    Raises
    ------
    ScenarioError
        If there is no such body, or if it is not in orbit.
    """

    def __init__(self, scenario: Scenario, name: str) -> None:
        bodies = {body.name: body for body in scenario.bodies}
        if name not in bodies:
            raise ScenarioError(f"{scenario.name}: no body named '{name}' (known: {', '.join(bodies)})")
        if scenario.is_local or not bodies[name].orbits:
            raise ScenarioError(
                f"{scenario.name}: {name} is not in orbit about the Earth; take a scenario with bodies in orbit"
            )
        if name in list_lunar_bodies(scenario.bodies):
            raise ScenarioError(
                f"{scenario.name}: {name} orbits about the Moon, and encounters are searched about the Earth; take a body "
                "about the Earth"
            )
        self.scenario, self.name, self._start_utc = scenario, name, scenario.time.start_utc
        self._chief = Chief(scenario.bodies, name)

    def states(self, epochs: Epochs) -> BodyState:
        """Return position [m] and velocity [m/s] (time, 3) in GCRS axes.

        Raises
        ------
        PropagationError
            If epochs are before the start of the scenario; its `bad` masks them.
        """
        time_s = epochs.since(self._start_utc)
        bad = time_s < -1e-6
        if bad.any():
            raise PropagationError(
                f"{self.name}: the scenario starts at {format_utc(self._start_utc, 0.0)}; begin the search then", bad
            )
        with self.scenario.locate_errors(f"{self.name}.motion"):
            return self._chief.states(Epochs(self._start_utc, np.maximum(time_s, 0.0)))

    def breaks_s(self, epochs: Epochs) -> np.ndarray:
        """Return the instants at which its motion, or one that it is relative to, has a jump or a corner.

        Parameters
        ----------
        epochs : instants that matter

        Returns
        -------
        times since the `start_utc` of `epochs` [s]
        """
        shift_s = float(Epochs(epochs.start_utc, np.zeros(1)).since(self._start_utc)[0])
        own = Epochs(self._start_utc, np.maximum(epochs.time_s + shift_s, 0.0))
        return np.append(self._chief.list_breaks_s(own), 0.0) - shift_s

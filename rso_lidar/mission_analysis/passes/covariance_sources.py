"""Covariances of the objects of a search: from messages, from the history of their element sets, or from a table by age."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rso_lidar import units
from rso_lidar.errors import CatalogError, PropagationError, ScenarioError, quote_value, warn_of_input
from rso_lidar.mission_analysis.passes.search_objects import check_names, list_names
from rso_lidar.mission_analysis.passes.set_errors import SetErrors, estimate_set_errors
from rso_lidar.orbit import (
    Catalog,
    ConjunctionMessage,
    CovarianceHistory,
    ElementSet,
    Epochs,
    NamedTrajectory,
    is_message_of,
    list_ephemeris_objects,
    orbit_state_matrix,
    read_covariances,
    read_table_text,
)
from rso_lidar.part import to_real_array
from rso_lidar.records import BodyState

# Two-body motion propagates sigmas to 1 % over 15 minutes in low orbit, against an integration about the oblate Earth.
_NEAR_S = 900.0
_APART_RAD = 0.01  # 70 km in low orbit: a covariance turned by it has 1 % of its greatest sigma in other axes
_MOST_SIGMA = 1e12  # m or m/s: any larger one is a mistake, and its square would spoil sums
_COLUMNS = ("age_days", "radial_m", "along_m", "cross_m")
_SPEED_COLUMNS = ("radial_m_s", "along_m_s", "cross_m_s")


@dataclass(frozen=True, eq=False)
class SetErrorTable:
    """Standard deviations of element sets by age, from a user's table, in the object's rtn axes.

    Parameters
    ----------
    source : name of the table, for messages
    age_days : (row) increasing ages [day]
    sigma : (row, 3) of radial, along-track and cross-track position [m], or (row, 6) with those of velocity [m/s]. Without
        them velocities count as known

    Raises
    ------
    ScenarioError
        For ages that do not increase from 0 or more, and values that are no standard deviations.
    """

    source: str
    age_days: np.ndarray
    sigma: np.ndarray

    def __post_init__(self) -> None:
        ages, sigma = to_real_array(self.age_days), to_real_array(self.sigma)
        if ages is None or ages.ndim != 1 or not len(ages) or not (ages >= 0.0).all() or (np.diff(ages) <= 0.0).any():
            raise ScenarioError(
                f"{self.source}: age_days: do not increase from 0 or more; sort them, and give each once"
            )
        if sigma is None or sigma.shape not in ((len(ages), 3), (len(ages), 6)) or not (sigma >= 0.0).all():
            raise ScenarioError(f"{self.source}: standard deviations need 3 or 6 numbers of 0 or more for each age")
        if not np.isfinite(sigma).all() or not np.isfinite(ages).all():
            raise ScenarioError(f"{self.source}: holds a value that is not finite; correct it")
        if (sigma > _MOST_SIGMA).any():
            raise ScenarioError(
                f"{self.source}: {sigma.max():g} is no standard deviation of an orbit; give at most {_MOST_SIGMA:g} m or m/s"
            )
        object.__setattr__(self, "age_days", ages.astype(float))
        object.__setattr__(self, "sigma", sigma.astype(float))

    @classmethod
    def from_file(cls, path: str | Path) -> SetErrorTable:
        """Read a table from CSV with columns age_days, radial_m, along_m and cross_m, and perhaps those of velocity.

        Parameters
        ----------
        path : path of the file; columns of velocity are radial_m_s, along_m_s and cross_m_s

        Returns
        -------
        SetErrorTable

        Raises
        ------
        ScenarioError
            For a file that cannot be read, columns that are missing, and cells that are no numbers.
        """
        where = str(path)
        rows = list(csv.reader(io.StringIO(read_table_text(Path(path)))))
        heads = [cell.strip() for cell in rows[0]] if rows else []
        missing = [name for name in _COLUMNS if name not in heads]
        if missing:
            raise ScenarioError(
                f"{where}: has no column {', '.join(missing)}; a table by age has {', '.join(_COLUMNS)}"
            )
        names = [*_COLUMNS, *(_SPEED_COLUMNS if _SPEED_COLUMNS[0] in heads else ())]
        lacking = [name for name in names if name not in heads]
        if lacking:
            raise ScenarioError(f"{where}: has no column {', '.join(lacking)}; give all three velocities, or none")
        if any(heads.count(name) > 1 for name in names):
            raise ScenarioError(f"{where}: line 1: has a column twice; remove one")
        numbers = []
        for line, row in enumerate(rows[1:], start=2):
            if not any(cell.strip() for cell in row):
                continue
            try:
                values = [float(row[heads.index(name)]) for name in names]
            except (IndexError, ValueError):
                raise ScenarioError(f"{where}: line {line}: is no row of {len(names)} numbers; correct it") from None
            if len(row) > len(heads):
                raise ScenarioError(f"{where}: line {line}: has {len(row)} cells under {len(heads)} heads; correct it")
            numbers.append(values)
        if not numbers:
            raise ScenarioError(f"{where}: has no rows; give at least one")
        table = np.array(numbers, dtype=float).reshape(-1, len(names))
        return cls(where, table[:, 0], table[:, 1:])

    def covariance_at(self, age_days: float) -> np.ndarray:
        """Interpolate the covariance (6, 6) at an age linearly between rows.

        Parameters
        ----------
        age_days : age of the set [day]

        Returns
        -------
        numpy.ndarray
            (6, 6) in rtn axes [m2, m2/s, m2/s2].

        Raises
        ------
        ScenarioError
            If the age is outside those of the table.
        """
        first, last = self.age_days[0], self.age_days[-1]
        if not first <= age_days <= last:
            raise ScenarioError(
                f"age_days: {age_days:g} is outside the ages of {self.source}, {first:g} to {last:g}; add a row"
            )
        variances = np.zeros(6)
        variances[: self.sigma.shape[1]] = [np.interp(age_days, self.age_days, column**2) for column in self.sigma.T]
        return np.diag(variances)


class CovarianceSources:
    """Where the covariance of each object of a search comes from.

    Parameters
    ----------
    given : sources, some of them perhaps as pairs of a name or catalogue number and a source, or a mapping. A source is a
        file (OEM, OPM, CDM, element sets with their history, or a CSV table by age), a `SetErrors` or `SetErrorTable`, or
        anything that answers `at(epochs)` with covariances (time, 6, 6) in GCRS axes. A table by age without a name serves
        all element sets that have no other source
    entries : objects of the search. Several sets of one object are its history, and an OEM or OPM may hold covariances

    Raises
    ------
    ScenarioError
        For what is no source, files that cannot be read, and names that no object of the search has.
    """

    def __init__(self, given: Any, entries: Sequence[Any]) -> None:
        self._named: dict[str, Any] = {}
        self._stated: list[str] = []
        self._histories: dict[Any, list[ElementSet]] = {}
        self._errors: dict[Any, SetErrors] = {}
        self._read: dict[tuple[str, str], Any] = {}
        self._by_age: Any = None
        self._add_sets(entries)
        listed = list(given.items()) if isinstance(given, Mapping) else _list_sources(given)
        for source in listed:
            name, source = source if isinstance(source, tuple) and len(source) == 2 else ("", source)
            name = str(name).strip()
            if name.casefold() in {stated.casefold() for stated in self._stated}:
                raise ScenarioError(f"covariances: '{name}' is given twice; give one source for each object")
            before = {*self._named, *self._histories}
            self._add(name, source)
            if not name:
                _warn_of_others({*self._named, *self._histories} - before, source, entries)
        check_names("covariances", self._stated, entries)

    def find(self, entry: Any, age_days: float, epochs: Epochs, state: BodyState) -> tuple[np.ndarray, str]:
        """Find the covariance of an object at an instant.

        Parameters
        ----------
        entry : an element set, several of one object, or a `NamedTrajectory`
        age_days : age of the set then, NaN for a trajectory [day]
        epochs : the one instant
        state : (3,) of the object then, in GCRS axes

        Returns
        -------
        covariance : (6, 6) in GCRS axes [m2, m2/s, m2/s2]
        source : in a few words

        Raises
        ------
        ScenarioError
            If none is known; the message states what would be needed.
        PropagationError
            If its source has none at this instant.
        """
        first = entry[0] if isinstance(entry, list | tuple) else entry
        source = self._choose(first)
        if hasattr(source, "covariance_at"):
            age = abs(age_days)
            if not np.isfinite(age):
                raise ScenarioError("a table by age needs an element set; give a covariance at epochs, as in an OEM")
            turn = orbit_state_matrix("rtn", state.position_m, state.velocity_m_s)
            if isinstance(source, SetErrors):
                words = f"differences of {int(source.pairs.sum()):,} pairs of its own sets, age {age:.2f} d"
            else:
                words = f"{Path(getattr(source, 'source', 'table')).name}, age {age:.2f} d"
            return turn @ source.covariance_at(age) @ turn.T, words
        words = Path(str(getattr(source, "source", "") or type(source).__name__)).name
        away_s = _find_distance_s(source, epochs) if isinstance(source, CovarianceHistory) else 0.0
        if away_s > _NEAR_S and source.has_velocity:
            raise PropagationError(
                f"covariance of {source.label} ({source.source}) is {away_s / 3600.0:,.3g} h from the closest approach; "
                f"give one within {_NEAR_S / 60.0:g} minutes of it"
            )
        if isinstance(source, CovarianceHistory):
            _check_orbit(source, first, epochs, state)
        if 0.0 < away_s <= _NEAR_S:
            return source.at(epochs, beyond="two_body")[0], f"{words}, propagated by {away_s:.3g} s"
        covariance = to_real_array(source.at(epochs))
        if covariance is None or covariance.shape != (1, 6, 6):
            raise ScenarioError("its source does not answer at(epochs) with covariances (time, 6, 6); correct it")
        return covariance[0], words

    def _choose(self, first: Any) -> Any:
        """Choose the source of an object by its name or number, its own file, its sets, or the table for all sets."""
        for key in list_names(first):
            if key in self._named:
                return self._named[key]
        if isinstance(first, NamedTrajectory):
            if not first.source or first.source.lower().endswith(".toml"):
                raise ScenarioError("no covariance is known; give one with epochs, such as an OEM, for this name")
            # The name that the trajectory was given: another name of the same file would repeat its warnings.
            file = str(getattr(first.trajectory, "file", ""))
            path = file if file and Path(file).resolve() == Path(first.source).resolve() else first.source
            return self._read_message(path, first.name_in_source or first.name)
        if first.identity in self._errors:
            return self._errors[first.identity]
        history = self._histories.get(first.identity, [])
        if len(history) > 1 and any(first.identity):
            errors = estimate_set_errors(history)
            if np.isfinite(errors.age_days).any() or self._by_age is None:
                return self._errors.setdefault(first.identity, errors)
        if self._by_age is not None:
            return self._by_age
        raise ScenarioError(
            "no covariance is known; give more of its element sets, an OEM, OPM or CDM, or a table by age"
        )

    def _read_message(self, path: str, name: str) -> Any:
        """Read the covariances of one object of a message."""
        if (path, name) not in self._read:
            known = list_ephemeris_objects(path) if is_message_of("OEM", read_table_text(Path(path))) else []
            self._read[path, name] = read_covariances(path, name if name in known else None)
        return self._read[path, name]

    def _add(self, name: str, source: Any) -> None:
        """Add a source that was given, under a name or under the names that its file holds."""
        self._stated += [name] if name else []
        if hasattr(source, "covariance_at") or hasattr(source, "at"):
            if not name and isinstance(source, SetErrorTable):
                self._by_age = source
                return
            name = name or str(getattr(source, "label", ""))
            if not name:
                raise ScenarioError(
                    f"covariances: {quote_value(source)} has no name; give a mapping of names to sources"
                )
            self._named[name.casefold()] = source
            return
        if not isinstance(source, str | os.PathLike):
            raise ScenarioError(
                f"covariances: {quote_value(source)} is no source; give a file, errors by age, or an object with at(epochs)"
            )
        self._add_file(name, str(os.fspath(source)))

    def _add_file(self, name: str, path: str) -> None:
        text = read_table_text(Path(path))
        if is_message_of("CDM", text):
            message = ConjunctionMessage.from_text(text, path)
            for key, body in (("OBJECT1", message.first), ("OBJECT2", message.second)):
                names = {body.name, body.designator, str(body.norad_id or "")} - {""}
                if not name or name.casefold() in {other.casefold() for other in names}:
                    history = read_covariances(path, key)
                    self._named |= {(name or other).casefold(): history for other in names}
            if name and name.casefold() not in self._named:
                raise ScenarioError(f"covariances: {path}: has no object '{name}'; give it as the message names it")
        elif is_message_of("OEM", text):
            known = list_ephemeris_objects(path)
            for other in known if len(known) > 1 and not name else [name if len(known) > 1 else None]:
                history = read_covariances(path, other)
                self._named[(name or history.label).casefold()] = history
        elif is_message_of("OPM", text):
            history = read_covariances(path)
            self._named[(name or history.label).casefold()] = history
        elif "age_days" in text[:4096].split("\n", 1)[0]:
            self._add(name, SetErrorTable.from_file(path))
        else:
            sets = list(Catalog.from_file(path))
            good = [entry for entry in sets if isinstance(entry, ElementSet) and entry.problem is None]
            if not good:
                raise CatalogError(
                    f"covariances: {path}: is no OEM, OPM, CDM or table by age, and holds no element sets; give one of them"
                )
            self._add_sets(good, name)

    def _add_sets(self, entries: Iterable[Any], name: str = "") -> None:
        """Add element sets to the histories of their objects; with a name, to a source of that name."""
        sets = [entry for entry in entries if isinstance(entry, ElementSet)]
        if name:
            own = [entry for entry in sets if name.casefold() in list_names(entry)]
            self._named[name.casefold()] = estimate_set_errors(own or sets)
            return
        for entry in sets:
            known = self._histories.setdefault(entry.identity, [])
            if not any(entry.epoch_utc == other.epoch_utc for other in known):
                known.append(entry)


def _warn_of_others(added: set[Any], source: Any, entries: Sequence[Any]) -> None:
    """Warn where no object of a search has a name or an identity that a source has just added."""
    searched = {name for entry in entries for name in list_names(entry)}
    if added and not added & searched:  # identities of sets that are searched were known before
        names = ", ".join(sorted(str(key if isinstance(key, str) else key[1] or key[0]) for key in added)[:3])
        what = Path(os.fspath(source)).name if isinstance(source, str | os.PathLike) else "a source"
        warn_of_input(
            f"covariances: {what} is of {names}, not in the search, and is not used; write NAME={what} with "
            "the name or number of the object that it is for"
        )


def _check_orbit(history: CovarianceHistory, entry: Any, epochs: Epochs, state: BodyState) -> None:
    """Warn where covariances are about an orbit in another direction than the object, so that their axes are not its own."""
    try:
        place_m = history.reference.states(epochs).position_m[0]
    except PropagationError:  # the orbit ends before this instant, near which the covariances hold
        return
    here_m = np.asarray(state.position_m).reshape(3)
    lengths = np.linalg.norm(place_m) * np.linalg.norm(here_m)
    if float(np.arccos(np.clip(place_m @ here_m / lengths, -1.0, 1.0))) > _APART_RAD:
        warn_of_input(
            f"{history.source or history.label}: its orbit is {np.linalg.norm(place_m - here_m) / units.KM:,.0f} km from "
            f"{entry.name or entry.label}, whose errors it states; give covariances about that orbit"
        )


def _find_distance_s(history: CovarianceHistory, epochs: Epochs) -> float:
    """Return the time [s] from an instant to the nearer end of a history; 0 within it, and at its ends to a millisecond."""
    at_s, known_s = float(epochs.since(history.epochs.start_utc)[0]), history.epochs.time_s
    away_s = max(float(known_s[0]) - at_s, at_s - float(known_s[-1]), 0.0)
    return away_s if away_s > 1e-3 else 0.0


def _list_sources(given: Any) -> list[Any]:
    if given is None:
        return []
    if isinstance(given, str | os.PathLike) or hasattr(given, "at") or hasattr(given, "covariance_at"):
        return [given]
    if not isinstance(given, Iterable):
        raise ScenarioError(
            f"covariances: {quote_value(given)} is no source; give files, or a mapping of names to sources"
        )
    return list(given)

"""Motions by SGP4: from the element sets of a catalogue, or from a mean-elements message written inline."""

from __future__ import annotations

import datetime
import functools
from pathlib import Path
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from rso_lidar.errors import CatalogError, warn
from rso_lidar.files import expand_user
from rso_lidar.orbit.epochs import Epochs
from rso_lidar.orbit.sets.element_set import ElementSet, explain_impossible
from rso_lidar.orbit.sets.formats import parse_lines, read_lines, read_object
from rso_lidar.orbit.sets.selection import select_set
from rso_lidar.orbit.sets.set_sequence import SetJump, SetSequence, make_sequence
from rso_lidar.orbit.sets.teme import age_days, propagate_sgp4
from rso_lidar.part import Instant, Number, Part, Text, Whole
from rso_lidar.records import BodyState
from rso_lidar.shipped import find, shipped

_SHARED = (
    "mean_motion_rev_day",
    "eccentricity",
    "inclination_deg",
    "raan_deg",
    "argument_of_perigee_deg",
    "mean_anomaly_deg",
    "bstar_per_earth_radius",
    "mean_motion_dot_rev_day2",
    "mean_motion_ddot_rev_day3",
)


class Omm(Part):
    """Motion by SGP4 from a mean-elements message written inline, with the numbers of its OMM.

    They are mean elements of SGP4 (TEME, WGS72), not osculating ones. They are good to about a kilometre, growing by
    one to three a day. More than a week from the epoch there is a warning, beyond 5 years an error. For a rendezvous
    within kilometres, use this for the chief, and a relative motion for the other body.
    """

    type: Literal["omm"] = "omm"
    object_name: Text | None = Field(default=None, description="Name of the object.")
    norad_id: Annotated[Whole, Field(ge=0, lt=10**9)] = Field(
        default=0, description="Catalogue number of up to nine digits; 0 means none yet."
    )
    epoch_utc: Instant = Field(description="Time at which the elements apply.")
    epoch_rest_ns: Annotated[Number, Field(ge=0, lt=1000)] = Field(
        default=0.0, description="Part of the epoch below its whole microseconds [ns]."
    )
    mean_motion_rev_day: Number = Field(description="Mean motion of SGP4 (Kozai) [rev/day].")
    eccentricity: Number = Field(description="Mean eccentricity, 0 to below 1.")
    inclination_deg: Number = Field(description="Mean inclination to the equator of TEME, 0 to 180 [deg].")
    raan_deg: Number = Field(description="Mean right ascension of the ascending node [deg].")
    argument_of_perigee_deg: Number = Field(description="Mean argument of perigee, from the ascending node [deg].")
    mean_anomaly_deg: Number = Field(description="Mean anomaly, from perigee [deg].")
    bstar_per_earth_radius: Number = Field(default=0.0, description="Drag term B* of SGP4 [1/R⊕].")
    mean_motion_dot_rev_day2: Number = Field(
        default=0.0,
        description="Half of the first derivative of mean motion, as an OMM gives it [rev/day²]. SGP4 does not use it.",
    )
    mean_motion_ddot_rev_day3: Number = Field(
        default=0.0,
        description=(
            "A sixth of the second derivative of mean motion, as an OMM gives it [rev/day³]. SGP4 does not use it."
        ),
    )

    @model_validator(mode="after")
    def _of_an_orbit(self) -> Self:
        wrong = explain_impossible(self.elements())
        if wrong:
            raise ValueError(f"{wrong}; correct the message")
        return self

    @classmethod
    def of(cls, elements: ElementSet) -> Omm:
        """Make the motion of an element set.

        Parameters
        ----------
        elements : the element set

        Returns
        -------
        motion with the same elements
        """
        return cls(
            object_name=elements.name or None,
            norad_id=elements.norad_id,
            epoch_utc=elements.epoch_utc,
            epoch_rest_ns=elements.epoch_rest_ns,
            **{key: getattr(elements, key) for key in _SHARED},
        )

    def elements(self) -> ElementSet:
        """Return the element set."""
        return ElementSet(
            name=self.object_name or "",
            norad_id=self.norad_id,
            where="omm",
            epoch_utc=self.epoch_utc,
            epoch_rest_ns=self.epoch_rest_ns,
            **{key: getattr(self, key) for key in _SHARED},
        )

    def summarize(self, start_utc: datetime.datetime) -> str:
        """Return the motion in a few words: object, and age of the elements at the start.

        Parameters
        ----------
        start_utc : start of the run
        """
        return _summarize(self.type, self.elements(), self.epoch_age_days(Epochs(start_utc, np.zeros(1))))

    def epoch_age_days(self, epochs: Epochs) -> float:
        """Return the greatest time between the epoch of the elements and some epochs [day].

        Parameters
        ----------
        epochs : instants
        """
        return age_days(self.elements(), epochs)

    def states(self, epochs: Epochs) -> BodyState:
        """Return position [m] and velocity [m/s] (time, 3) in GCRS axes.

        Raises
        ------
        PropagationError
            if SGP4 has no state at an epoch; its `bad` masks those epochs
        """
        return propagate_sgp4(self.elements(), epochs)


class Tle(Part):
    """Motion by SGP4 from element sets: of a `file` (TLE, 3LE or OMM), by `name` or `norad_id`, or of inline `lines`.

    Of several sets of one object, `sets = "nearest"` uses the one nearest to the start of the run. With `sets = "all"`
    the nearest set applies at each instant, and a warning names the jumps between sets. Element sets are good to about
    a kilometre, growing by one to three a day. More than a week from the epoch there is a warning, beyond 5 years an
    error.
    """

    type: Literal["tle"] = "tle"
    file: Text | None = Field(
        default=None,
        description=(
            "Path of a file of element sets: TLE, 3LE, or OMM in JSON, CSV, XML or KVN. Give exactly one of `file` "
            "and `lines`."
        ),
    )
    lines: Annotated[tuple[Text, ...], Field(min_length=2)] | None = Field(
        default=None, description="The element set itself, or several of one object, two lines each."
    )
    messages: tuple[Omm, ...] = Field(
        default=(), description="Mean-elements messages of the object, in place of `lines` or beside them."
    )
    name: Text | None = Field(
        default=None, description="Name of the object in the file; upper and lower case are equal."
    )
    norad_id: Annotated[Whole, Field(ge=1, lt=10**9)] | None = Field(
        default=None, description="Catalogue number of the object in the file."
    )
    sets: Literal["nearest", "all"] = Field(
        default="nearest",
        description=(
            "Choice among several sets. `nearest`: the set nearest to the start applies throughout. `all`: the "
            "nearest set applies at each time, with a jump between sets."
        ),
    )

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        inline = self.lines is not None or bool(self.messages)
        if (self.file is None) != inline:
            raise ValueError(
                "needs exactly one of file and lines; give the path of a file of element sets, or the two lines of one"
            )
        if inline:
            read = self._inline_sets()
            junk = read_lines(self.lines, "lines")[1] if self.lines else []
            wrong = next((entry.problem for entry in read if entry.problem), junk[0] if junk else None)
            if wrong:
                raise ValueError(wrong)
            chosen = select_set(read, "lines")
            if self.norad_id not in (None, chosen.norad_id):
                raise ValueError(f"lines: are of NORAD {chosen.norad_id}, not {self.norad_id}; correct norad_id")
        return self

    def _inline_sets(self) -> tuple[ElementSet, ...]:
        read = _sets_from_lines(self.lines, self.name) if self.lines is not None else ()
        name = {"name": self.name} if self.name else {}
        messages = (ElementSet(**{**omm.elements().__dict__, **name}) for omm in self.messages)
        return (*read, *messages)

    def _read(self, folder: Path | None) -> tuple[tuple[ElementSet, ...], str]:
        """Return the sets of the object, bad ones included, and the name of their source for messages."""
        if self.file is None:
            return self._inline_sets(), "lines"
        path = find(self.file, folder)
        if path is None:
            places = f"in {folder or Path.cwd()} and among the shipped data in {shipped()}"
            looked = "" if expand_user(self.file).is_absolute() else f", looked for {places}"
            raise CatalogError(f"{self.file}: no such file{looked}; check the path")
        return read_object(path, self.file, self.name, self.norad_id), self.file

    def elements(self, near_utc: datetime.datetime | None = None, folder: Path | None = None) -> ElementSet:
        """Select and check the element set to propagate.

        Parameters
        ----------
        near_utc : of several sets, that with the nearest epoch is selected; without it the newest
        folder : folder in which a relative `file` is looked up first (the working folder if None), before the shipped data

        Returns
        -------
        the element set, without a problem

        Raises
        ------
        CatalogError
            if there is no such file or object, or the set is bad
        """
        read, where = self._read(folder)
        if self.sets == "all":
            read = tuple(entry for entry in read if entry.problem is None) or read
        return select_set(read, where, near_utc=near_utc)

    def trajectory(self, near_utc: datetime.datetime | None = None, folder: Path | None = None) -> SetSequence:
        """Return the trajectory: of one set, or of all good sets of the object. A warning counts the bad ones.

        Parameters
        ----------
        near_utc : instant; with ``sets = "nearest"``, the set with the nearest epoch applies. None for the newest set
        folder : folder in which a relative `file` is looked up first; None for the working folder

        Raises
        ------
        CatalogError
            if there is no such file or object, or no good set
        """
        if self.sets == "nearest":
            return make_sequence((self.elements(near_utc, folder),))
        read, _ = self._read(folder)
        good = tuple(entry for entry in read if entry.problem is None)
        if len(good) < len(read):
            bad = [entry.problem for entry in read if entry.problem]
            if not good:
                raise CatalogError(str(bad[0]))
            warn(f"{good[0].label}: {len(bad)} of {len(read)} element sets are left out, the first is {bad[0]}")
        return make_sequence(good)

    def inline(self, near_utc: datetime.datetime, folder: Path | None = None) -> Tle | Omm:
        """Return the same motion without a file: its sets in `lines` or, for sets without lines, in `messages`.

        Parameters
        ----------
        near_utc : start of the run; with ``sets = "nearest"``, the set with the nearest epoch is taken
        folder : folder in which a relative `file` is looked up first; None for the working folder
        """
        if self.file is None:
            return self
        flown = self.trajectory(near_utc, folder).sets
        if len(flown) == 1 and not flown[0].line1:
            return Omm.of(flown[0])
        return Tle(
            lines=tuple(line for entry in flown if entry.line1 for line in (entry.line1, entry.line2)) or None,
            messages=tuple(Omm.of(entry) for entry in flown if not entry.line1),
            name=flown[0].name or None,
            norad_id=flown[0].norad_id or None,
            sets=self.sets,
        )

    def summarize(self, start_utc: datetime.datetime) -> str:
        """Return the motion in a few words: object, and age of the elements at the start.

        Parameters
        ----------
        start_utc : start of the run
        """
        age_days = self.epoch_age_days(Epochs(start_utc, np.zeros(1)))
        return _summarize(self.type, self.elements(start_utc), age_days)

    def check(self, start_utc: datetime.datetime) -> None:
        """Check that there is an element set to propagate.

        Parameters
        ----------
        start_utc : start of the run

        Raises
        ------
        CatalogError
            if there is none
        """
        self.elements(start_utc)

    def jumps(self, epochs: Epochs) -> tuple[SetJump, ...]:
        """Return the switches between sets within the span of the epochs.

        Parameters
        ----------
        epochs : instants
        """
        return self.trajectory(epochs.start_utc).jumps(epochs)

    def breaks_s(self, epochs: Epochs) -> np.ndarray:
        """Return the instants at which it switches between sets, as times since the `start_utc` of `epochs` [s].

        Parameters
        ----------
        epochs : instants
        """
        return self.trajectory(epochs.start_utc).breaks_s(epochs)

    def epoch_age_days(self, epochs: Epochs) -> float:
        """Return the greatest time between an epoch and that of the elements that apply there [day].

        Parameters
        ----------
        epochs : instants
        """
        if self.sets == "all":
            return float(self.trajectory(epochs.start_utc).ages_days(epochs).max(initial=0.0))
        return age_days(self.elements(epochs.start_utc), epochs)

    def states(self, epochs: Epochs) -> BodyState:
        """Return position [m] and velocity [m/s] (time, 3) in GCRS axes.

        Raises
        ------
        PropagationError
            if SGP4 has no state at an epoch; its `bad` masks those epochs
        """
        if self.sets == "all":
            return self.trajectory(epochs.start_utc).states(epochs)
        return propagate_sgp4(self.elements(epochs.start_utc), epochs)


def _summarize(kind: str, elements: ElementSet, age_days: float) -> str:
    """Return a motion by SGP4 in a few words."""
    return f"{kind} {elements.norad_id} {elements.name}, {age_days:.1f} days from epoch"


@functools.lru_cache(maxsize=64)
def _sets_from_lines(lines: tuple[str, ...], name: str | None) -> tuple[ElementSet, ...]:
    """Parse inline lines, with the name that the part gives."""
    read = parse_lines(lines, "lines")
    return tuple(ElementSet(**{**entry.__dict__, "name": name or entry.name}) for entry in read)

"""Conjunction data messages (CCSDS 508.0-B, CDM): two states at the closest approach with their covariances."""

from __future__ import annotations

import datetime
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.orbit.ccsds.keywords import (
    GREATEST_TERM,
    RADIUS_COMMENT,
    KeywordBlock,
    StatedValue,
    check_version,
    read_keywords,
)
from rso_lidar.orbit.ccsds.message import check_center
from rso_lidar.orbit.ccsds.reader import find_table, read_table_text
from rso_lidar.orbit.ccsds.reference_frames import parse_frame, warn_without_orientation
from rso_lidar.orbit.earth.axes import convert_states
from rso_lidar.orbit.epochs import PS_PER_S, Epochs, floor_to_utc_second, parse_epoch_ps
from rso_lidar.orbit.two_body.orbit_axes import has_plane, orbit_state_matrix
from rso_lidar.records import BodyState

_AXES = ("R", "T", "N", "RDOT", "TDOT", "NDOT")
_STATE = ("X", "Y", "Z", "X_DOT", "Y_DOT", "Z_DOT")
_RELATIVE = ("R", "T", "N")


@dataclass(frozen=True, eq=False)
class ConjunctionObject:
    """One of the two objects of a conjunction data message.

    Parameters
    ----------
    name, designator, international_designator : as the message gives them; empty where it does not
    norad_id : catalogue number where the designator is one, else 0
    frame : reference frame of the state in the message
    position_m, velocity_m_s : (3,) state at the closest approach in GCRS axes [m], [m/s]
    covariance_rtn : (6, 6) covariance in the object's own rtn axes [m2, m2/s, m2/s2]
    has_velocity_covariance : whether the message gives the terms of velocity, which are 0 otherwise
    area_m2 : AREA_PC, the area of the object; None where it is not given, or not as a positive number of m**2 [m2]
    """

    name: str
    designator: str
    international_designator: str
    norad_id: int
    frame: str
    position_m: np.ndarray
    velocity_m_s: np.ndarray
    covariance_rtn: np.ndarray
    has_velocity_covariance: bool
    area_m2: float | None

    @property
    def label(self) -> str:
        """Name and designator."""
        return f"{self.name} ({self.designator})" if self.name and self.designator else self.name or self.designator

    @property
    def state(self) -> BodyState:
        """State at the closest approach in GCRS axes."""
        return BodyState(self.position_m, self.velocity_m_s)

    @property
    def covariance(self) -> np.ndarray:
        """Covariance (6, 6) in GCRS axes; velocities of the message are relative to inertial axes [m2, m2/s, m2/s2]."""
        turn = orbit_state_matrix("rtn", self.position_m, self.velocity_m_s)
        turned: np.ndarray = turn @ self.covariance_rtn @ turn.T
        return turned


@dataclass(frozen=True, eq=False)
class ConjunctionMessage:
    """A conjunction data message: two states at the time of closest approach (TCA), with their covariances.

    States are converted to GCRS axes. Those in ITRF lack polar motion, some 10 m on the ground, which both
    share; a warning states it.

    Parameters
    ----------
    where : name of the source
    message_id, originator : as the message gives them
    tca_utc : time of closest approach, to a microsecond
    first, second : the objects; the first is the one for which the message was made
    stated_miss_m, stated_speed_m_s : miss distance [m] and relative speed [m/s] of the message, None where not given
    stated_position_m : (3,) position of the second in the rtn axes of the first by the message [m], or None
    stated_probability, stated_method : probability of collision of the message, and its method; None and empty
    stated_radius_m : combined hard-body radius of the message, by its keyword or comment HBR [m], or None
    """

    where: str
    message_id: str
    originator: str
    tca_utc: datetime.datetime
    first: ConjunctionObject
    second: ConjunctionObject
    stated_miss_m: float | None
    stated_speed_m_s: float | None
    stated_position_m: np.ndarray | None
    stated_probability: float | None
    stated_method: str
    stated_radius_m: float | None

    @classmethod
    def from_file(cls, path: str | Path) -> ConjunctionMessage:
        """Read a message in keyword = value notation or XML.

        Parameters
        ----------
        path : path of the file; a relative one is looked up in the working folder, then among the shipped data

        Returns
        -------
        ConjunctionMessage

        Raises
        ------
        ScenarioError
            if the file cannot be read, or does not follow the format; the message names the line
        """
        file = find_table(str(path))[0]
        return cls.from_text(read_table_text(file), str(path))

    @classmethod
    def from_text(cls, text: str, where: str = "CDM") -> ConjunctionMessage:
        """Read a message from a text.

        Parameters
        ----------
        text : the message in keyword = value notation or XML
        where : name of the text, for messages

        Returns
        -------
        ConjunctionMessage

        Raises
        ------
        ScenarioError
            if the text does not follow the format; the message names the line
        """
        fields, parts = _read_parts(text, where)
        tca = fields.require("TCA")
        ps = parse_epoch_ps(tca.value, "UTC", f"{where}: line {tca.line}")
        second, second_ps = floor_to_utc_second(ps)
        tca_utc = second + datetime.timedelta(microseconds=round((ps - second_ps) / (PS_PER_S // 1_000_000)))
        objects = [_read_object(part, tca_utc) for part in parts]
        place = [fields.number(f"RELATIVE_POSITION_{axis}", "m") for axis in _RELATIVE]
        return cls(
            where=where,
            message_id=fields.text("MESSAGE_ID"),
            originator=fields.text("ORIGINATOR"),
            tca_utc=tca_utc,
            first=objects[0],
            second=objects[1],
            stated_miss_m=fields.number("MISS_DISTANCE", "m"),
            stated_speed_m_s=fields.number("RELATIVE_SPEED", "m/s"),
            stated_position_m=None if None in place else np.array(place, dtype=float),
            stated_probability=fields.number("COLLISION_PROBABILITY", "", 0.0, 1.0),
            stated_method=fields.text("COLLISION_PROBABILITY_METHOD"),
            stated_radius_m=fields.number("HBR", "m", 1e-9, 1e5),
        )


def _read_parts(text: str, where: str) -> tuple[KeywordBlock, list[KeywordBlock]]:
    """Read the keywords of the conjunction, and of its two objects, which the keyword OBJECT begins."""
    version, entries = read_keywords(text, "CDM", where)
    check_version(version, "CDM", where, "12")
    common = KeywordBlock(where, "the message")
    objects: list[KeywordBlock] = []
    for key, entry in entries:
        if key == "OBJECT":
            name = f"OBJECT{len(objects) + 1}"
            if len(objects) == 2:
                raise ScenarioError(f"{where}: line {entry.line}: a third object; a message has two")
            if entry.value.upper() != name:
                raise ScenarioError(
                    f"{where}: line {entry.line}: OBJECT {entry.value:.20}; a message has OBJECT1 and then OBJECT2"
                )
            objects.append(KeywordBlock(where, name))
        if key != RADIUS_COMMENT:
            (objects[-1] if objects else common).add(key, entry)
        elif "HBR" not in common:
            common.add("HBR", entry)
    if len(objects) != 2:
        raise ScenarioError(f"{where}: holds {len(objects)} of the two objects; give OBJECT1 and OBJECT2")
    return common, objects


def _read_object(fields: KeywordBlock, tca_utc: datetime.datetime) -> ConjunctionObject:
    """Read one object of a message."""
    where = fields.where
    center = fields.find("ORBIT_CENTER")
    if center is not None:
        check_center("ORBIT_CENTER", center, where)
    frame = fields.require("REF_FRAME")
    state = [fields.require_number(key, "km" if k < 3 else "km/s") * units.KM for k, key in enumerate(_STATE)]
    position, velocity = _to_gcrs(np.array(state[:3]), np.array(state[3:]), frame, where, tca_utc)
    radius = float(np.linalg.norm(position))
    if not units.EARTH_RADIUS_M < radius < 1e9:
        raise ScenarioError(
            f"{where}: {fields.part}: its position is {radius / units.KM:,.0f} km from the Earth's centre, which is no "
            "orbit; give X, Y, Z in km"
        )
    if not has_plane(position, velocity):
        raise ScenarioError(
            f"{where}: {fields.part}: its velocity has no part across its position, which is no orbit; give X_DOT, Y_DOT, "
            "Z_DOT in km/s"
        )
    designator = fields.text("OBJECT_DESIGNATOR")
    covariance, has_velocity = _read_covariance(fields)
    return ConjunctionObject(
        name=fields.text("OBJECT_NAME"),
        designator=designator,
        international_designator=fields.text("INTERNATIONAL_DESIGNATOR"),
        norad_id=int(designator) if designator.isascii() and designator.isdigit() and len(designator) <= 9 else 0,
        frame=frame.value,
        position_m=position,
        velocity_m_s=velocity,
        covariance_rtn=covariance,
        has_velocity_covariance=has_velocity,
        area_m2=_read_area_m2(fields),
    )


def _to_gcrs(
    position_m: np.ndarray, velocity_m_s: np.ndarray, frame: StatedValue, where: str, tca_utc: datetime.datetime
) -> tuple[np.ndarray, np.ndarray]:
    """Convert a state (3,) in the frame of a message to GCRS axes."""
    axes = parse_frame(frame.value, f"{where}: line {frame.line}")
    if axes == "itrs":
        cure = "both objects share it, and for absolute positions give the message in GCRF or EME2000"
        warn_without_orientation(where, position_m, cure)
    given = BodyState(position_m[None], velocity_m_s[None])
    there = convert_states(given, Epochs(tca_utc, np.zeros(1)), from_axes=axes)
    return there.position_m[0], there.velocity_m_s[0]


def _read_area_m2(fields: KeywordBlock) -> float | None:
    """Return AREA_PC, or None where it is no positive number of m**2; only a message without a radius needs it."""
    try:
        return fields.number("AREA_PC", "m**2", 1e-12)
    except ScenarioError:
        return None


def _read_covariance(fields: KeywordBlock) -> tuple[np.ndarray, bool]:
    """Return the covariance (6, 6) in rtn axes, and whether the message gives its terms of velocity."""
    matrix = np.zeros((6, 6))
    given = [
        fields.text(f"C{row}_{column}").lower() not in ("", "nan")
        for k, row in enumerate(_AXES)
        if k > 2
        for column in _AXES[: k + 1]
    ]
    for row in range(6 if any(given) else 3):
        for column in range(row + 1):
            unit = "m**2" + ("" if row < 3 else "/s" if column < 3 else "/s**2")
            value = fields.require_number(f"C{_AXES[row]}_{_AXES[column]}", unit, GREATEST_TERM)
            matrix[row, column] = matrix[column, row] = value
    return matrix, any(given)

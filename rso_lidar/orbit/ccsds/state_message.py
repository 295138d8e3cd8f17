"""Orbit parameter messages (CCSDS 502.0-B, OPM): a state, its covariance and maneuvers, in keyword = value text or XML."""

from __future__ import annotations

import datetime
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from rso_lidar import units
from rso_lidar.errors import ScenarioError, warn_of_input
from rso_lidar.orbit.ccsds.keywords import GREATEST_TERM, KeywordBlock, StatedValue, check_version, read_keywords
from rso_lidar.orbit.ccsds.message import check_center, read_time_system
from rso_lidar.orbit.ccsds.reader import find_table, read_table_text
from rso_lidar.orbit.ccsds.reference_frames import (
    freeze_axes,
    parse_frame,
    parse_orbit_frame,
    warn_without_orientation,
)
from rso_lidar.orbit.earth.axes import EARTH_AXES, EarthAxes, convert_states, gcrs_from_axes, gcrs_state_matrix
from rso_lidar.orbit.earth.earth_orientation import EarthOrientation
from rso_lidar.orbit.epochs import PS_PER_S, Epochs, floor_to_utc_second, parse_epoch_ps
from rso_lidar.orbit.two_body.kepler import State
from rso_lidar.orbit.two_body.orbit_axes import OrbitAxes, invert_state_matrix
from rso_lidar.records import BodyState

STATE_KEYS = ("X", "Y", "Z", "X_DOT", "Y_DOT", "Z_DOT")
_PS_PER_US = PS_PER_S // 1_000_000


@dataclass(frozen=True)
class StatedManeuver:
    """A maneuver of an orbit parameter message.

    Parameters
    ----------
    ignition_s : time of ignition, since the epoch of the message's state [s]
    delta_v_m_s : (3,) change of velocity in `axes` [m/s]
    axes : "rtn", "vnc" or "inertial" (GCRS), as of an `Impulse`; they turn with the orbit during a burn
    duration_s : duration of the burn; 0 for an impulse [s]
    delta_mass_kg : change of the mass, 0 or less [kg]
    """

    ignition_s: float
    delta_v_m_s: tuple[float, float, float]
    axes: Literal["rtn", "vnc", "inertial"] = "rtn"
    duration_s: float = 0.0
    delta_mass_kg: float = 0.0


@dataclass(frozen=True, eq=False)
class OrbitParameterMessage:
    """An orbit parameter message (OPM): a state with what the message tells of its covariance, spacecraft and maneuvers.

    Parameters
    ----------
    where : name of the source
    object_name, object_id, originator : as the message gives them; empty where it does not
    frame : reference frame of the state in the message
    state : two-body motion from the state, in GCRS axes
    covariance : (6, 6) of the state in GCRS axes [m2, m2/s, m2/s2]; None where the message gives none
    covariance_frame : reference frame of the covariance in the message; empty without one
    mass_kg, drag_area_m2, drag_coefficient, radiation_area_m2, radiation_coefficient : of the spacecraft; None where the
        message does not give them
    maneuvers : in the order of the message
    """

    where: str
    object_name: str
    object_id: str
    originator: str
    frame: str
    state: State
    covariance: np.ndarray | None
    covariance_frame: str
    mass_kg: float | None
    drag_area_m2: float | None
    drag_coefficient: float | None
    radiation_area_m2: float | None
    radiation_coefficient: float | None
    maneuvers: tuple[StatedManeuver, ...]

    @classmethod
    def from_file(cls, path: str | Path, orientation: EarthOrientation | None = None) -> OrbitParameterMessage:
        """Read a message in keyword = value notation or XML.

        Parameters
        ----------
        path : path of the file; a relative one is looked up in the working folder, then among the shipped data
        orientation : polar motion and UT1 for a state in ITRF, see `itrs_from_gcrs`

        Returns
        -------
        OrbitParameterMessage

        Raises
        ------
        ScenarioError
            if the file cannot be read, does not follow the format, or is not about the Earth; the message names the line
        """
        return cls.from_text(read_table_text(find_table(str(path))[0]), str(path), orientation)

    @classmethod
    def from_text(
        cls, text: str, where: str = "OPM", orientation: EarthOrientation | None = None
    ) -> OrbitParameterMessage:
        """Read a message from a text.

        Parameters
        ----------
        text : the message in keyword = value notation or XML
        where : name of the text, for messages
        orientation : polar motion and UT1 for a state in ITRF, see `itrs_from_gcrs`

        Returns
        -------
        OrbitParameterMessage

        Raises
        ------
        ScenarioError
            if the text does not follow the format, or is not about the Earth; the message names the line
        """
        block, maneuvers = _read_blocks(text, where)
        system = read_time_system(block.require("TIME_SYSTEM"), where)
        state = _read_state(block, system, orientation)
        covariance, covariance_frame = _read_covariance(block, system, state, orientation)
        return cls(
            where=where,
            object_name=block.text("OBJECT_NAME"),
            object_id=block.text("OBJECT_ID"),
            originator=block.text("ORIGINATOR"),
            frame=block.require("REF_FRAME").value,
            state=state,
            covariance=covariance,
            covariance_frame=covariance_frame,
            mass_kg=block.number("MASS", "kg", 0.0),
            drag_area_m2=block.number("DRAG_AREA", "m**2", 0.0),
            drag_coefficient=block.number("DRAG_COEFF", "", 0.0),
            radiation_area_m2=block.number("SOLAR_RAD_AREA", "m**2", 0.0),
            radiation_coefficient=block.number("SOLAR_RAD_COEFF", "", 0.0),
            maneuvers=tuple(_read_maneuver(maneuver, system, state) for maneuver in maneuvers),
        )

    @property
    def covariance_rtn(self) -> np.ndarray | None:
        """Covariance (6, 6) in the rtn axes of the state, rotated without their rate [m2, m2/s, m2/s2]."""
        if self.covariance is None:
            return None
        back = invert_state_matrix(gcrs_state_matrix("rtn", *_list_states(self.state)))[0]
        turned: np.ndarray = back @ self.covariance @ back.T
        return turned


def read_opm(path: str | Path, orientation: EarthOrientation | None = None) -> State:
    """Read the state of an orbit parameter message (CCSDS OPM, keyword = value or XML) as a motion.

    The motion is two-body; give it to `Numerical` as `initial` for other forces. Elements, covariance and spacecraft
    parameters of the message are not read, see `OrbitParameterMessage`. Maneuvers are not flown, of which a warning tells;
    the motion `Opm` flies them.

    Parameters
    ----------
    path : path of the file; a relative one is looked up in the working folder, then among the shipped data
    orientation : polar motion and UT1 for a state in ITRF, see `itrs_from_gcrs`

    Returns
    -------
    State
        motion from the state, in GCRS axes

    Raises
    ------
    ScenarioError
        if the file cannot be read, does not follow the format, or is not about the Earth; the message names the line

    Examples
    --------
    >>> import pathlib, tempfile
    >>> text = '''CCSDS_OPM_VERS = 3.0
    ... CREATION_DATE = 2026-05-01T00:00:00
    ... ORIGINATOR = TEST
    ... OBJECT_NAME = CRAFT
    ... OBJECT_ID = 2026-001A
    ... CENTER_NAME = EARTH
    ... REF_FRAME = GCRF
    ... TIME_SYSTEM = UTC
    ... EPOCH = 2026-05-01T00:00:00
    ... X = 7000 [km]
    ... Y = 0 [km]
    ... Z = 0 [km]
    ... X_DOT = 0 [km/s]
    ... Y_DOT = 7.5 [km/s]
    ... Z_DOT = 0 [km/s]'''
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder) / "craft.opm"
    ...     _ = file.write_text(text)
    ...     read_opm(file).velocity_m_s
    (0.0, 7500.0, 0.0)
    """
    where = str(path)
    block, maneuvers = _read_blocks(read_table_text(find_table(where)[0]), where)
    state = _read_state(block, read_time_system(block.require("TIME_SYSTEM"), where), orientation)
    if maneuvers:
        first = maneuvers[0].text("MAN_EPOCH_IGNITION")
        warn_of_input(
            f"{where}: has maneuvers from {first} on, which are not flown; use the motion 'opm', which flies them, or give "
            "them to 'numerical'"
        )
    return state


def _read_blocks(text: str, where: str) -> tuple[KeywordBlock, list[KeywordBlock]]:
    """Read the keywords of a message: those of its state and spacecraft, and of each maneuver."""
    version, entries = read_keywords(text, "OPM", where)
    check_version(version, "OPM", where, "123")
    block, maneuvers = KeywordBlock(where, "the message"), list[KeywordBlock]()
    for key, entry in entries:
        if key == "MAN_EPOCH_IGNITION":
            maneuvers.append(KeywordBlock(where, f"maneuver {len(maneuvers) + 1}"))
        if key.startswith("MAN_"):
            if not maneuvers:
                raise ScenarioError(
                    f"{where}: line {entry.line}: {key} before MAN_EPOCH_IGNITION, which begins each maneuver; put it after"
                )
            maneuvers[-1].add(key, entry)
        elif key != "EPOCH" or "X" not in block:  # in XML, other blocks of some producers repeat EPOCH
            block.add(key, entry)
    return block, maneuvers


def _read_state(block: KeywordBlock, system: str, orientation: EarthOrientation | None) -> State:
    """Read the state of a message in GCRS axes."""
    where, frame = block.where, block.require("REF_FRAME")
    check_center("CENTER_NAME", block.require("CENTER_NAME"), where)
    axes = parse_frame(frame.value, f"{where}: line {frame.line}")
    stamp_ps = _parse_stamp(block.require("EPOCH"), system, where)
    values = [block.require_number(key, "km" if k < 3 else "km/s") * units.KM for k, key in enumerate(STATE_KEYS)]
    given = BodyState(np.array([values[:3]]), np.array([values[3:]]))
    if axes == "itrs" and orientation is None:
        warn_without_orientation(where, given.position_m, "give finals2000A.all of the IERS as orientation")
    start_utc, start_ps = floor_to_utc_second(stamp_ps)
    at = Epochs(start_utc, np.array([(stamp_ps - start_ps) / PS_PER_S]))
    there = _to_gcrs(given, at, axes, _find_frozen_ps(block, system, axes), orientation)
    # The epoch of a motion has whole microseconds; the state moves with its velocity to the one before.
    since_us, rest_ps = divmod(stamp_ps - start_ps, _PS_PER_US)
    place_m = there.position_m[0] - there.velocity_m_s[0] * (rest_ps / PS_PER_S)
    try:
        return State(
            epoch_utc=start_utc + datetime.timedelta(microseconds=int(since_us)),
            position_m=tuple(place_m.tolist()),
            velocity_m_s=tuple(there.velocity_m_s[0].tolist()),
        )
    except ScenarioError as error:
        raise ScenarioError(f"{where}: its state is no orbit: {error}") from None


def _parse_stamp(entry: StatedValue, system: str, where: str) -> int:
    """Parse the instant of an entry [ps of TAI since the start of 2000]."""
    return parse_epoch_ps(entry.value, system, f"{where}: line {entry.line}")


def _find_frozen_ps(block: KeywordBlock, system: str, axes: EarthAxes | OrbitAxes) -> int | None:
    """Return REF_FRAME_EPOCH [ps of TAI since the start of 2000] for axes of date, or None where it is not given."""
    fixed = block.find("REF_FRAME_EPOCH")
    return None if fixed is None or axes not in ("mod", "tod", "teme") else _parse_stamp(fixed, system, block.where)


def _to_gcrs(
    states: BodyState, at: Epochs, axes: EarthAxes, frozen_ps: int | None, orientation: EarthOrientation | None
) -> BodyState:
    """Convert states (row, 3) at epochs (row) to GCRS axes, from axes of date of one epoch where it is given."""
    if frozen_ps is not None:
        return BodyState(*freeze_axes(states.position_m, states.velocity_m_s, axes, frozen_ps))
    return convert_states(states, at, from_axes=axes, orientation=orientation)


def _read_covariance(
    block: KeywordBlock, system: str, state: State, orientation: EarthOrientation | None
) -> tuple[np.ndarray | None, str]:
    """Return the covariance (6, 6) in GCRS axes, and the name of its frame in the message; None and empty without one."""
    if not any(key.partition("_")[0] in ("CX", "CY", "CZ") for key in block.entries):
        return None, ""
    matrix = read_triangle(block)
    if (np.diag(matrix) < 0.0).any():
        raise ScenarioError(
            f"{block.where}: the covariance has a variance below 0; correct it, or remove the covariance"
        )
    named = block.find("COV_REF_FRAME") or block.require("REF_FRAME")
    frame = parse_orbit_frame(named.value, f"{block.where}: line {named.line}")
    if frame.axes in EARTH_AXES:
        frame = replace(frame, frozen_ps=_find_frozen_ps(block, system, frame.axes))
    turn = frame.find_matrix(*_list_states(state), orientation)[0]
    return turn @ matrix @ turn.T, named.value


def read_triangle(block: KeywordBlock) -> np.ndarray:
    """Read the lower triangle of a covariance (6, 6) in kilometres by its keywords CX_X ... [m2, m2/s, m2/s2]."""
    matrix = np.zeros((6, 6))
    for row, name in enumerate(STATE_KEYS):
        for column, other in enumerate(STATE_KEYS[: row + 1]):
            unit = ("km**2", "km**2/s", "km**2/s**2")[(row > 2) + (column > 2)]
            value = block.require_number(f"C{name}_{other}", unit, GREATEST_TERM) * units.KM**2
            matrix[row, column] = matrix[column, row] = value
    return matrix


def _list_states(state: State) -> tuple[Epochs, BodyState]:
    """Return a state as a batch of one."""
    return Epochs(state.epoch_utc, np.zeros(1)), BodyState(np.array([state.position_m]), np.array([state.velocity_m_s]))


def _read_maneuver(block: KeywordBlock, system: str, state: State) -> StatedManeuver:
    """Read one maneuver; frames of the Earth are turned to GCRS axes at ignition."""
    where, ignition, named = block.where, block.require("MAN_EPOCH_IGNITION"), block.require("MAN_REF_FRAME")
    stamp_ps = _parse_stamp(ignition, system, where)
    at_utc, at_ps = floor_to_utc_second(stamp_ps)
    ignition_s = float(Epochs(at_utc, np.array([(stamp_ps - at_ps) / PS_PER_S])).since(state.epoch_utc)[0])
    if ignition_s < 0.0:
        raise ScenarioError(
            f"{where}: line {ignition.line}: {block.part} ignites before EPOCH, so the state contains it; remove it"
        )
    duration_s = block.require_number("MAN_DURATION", "s")
    if duration_s < 0.0:
        raise ScenarioError(f"{where}: line {block.require('MAN_DURATION').line}: MAN_DURATION is below 0; correct it")
    lost_kg = block.number("MAN_DELTA_MASS", "kg") or 0.0
    if lost_kg > 0.0:
        raise ScenarioError(
            f"{where}: line {block.require('MAN_DELTA_MASS').line}: MAN_DELTA_MASS is {lost_kg:g}; the standard sets the "
            "change of the mass, 0 or less"
        )
    values = [block.require_number(f"MAN_DV_{k}", "km/s") * units.KM for k in (1, 2, 3)]
    frame = parse_orbit_frame(named.value, f"{where}: line {named.line}")
    axes: Literal["rtn", "vnc", "inertial"] = "inertial"
    if frame.axes == "rtn":
        axes, vector = "rtn", values
    elif frame.axes == "vnc":
        axes, vector = "vnc", values
    elif frame.axes == "tnw":  # x along the velocity, z along r x v: vnc has y along r x v
        axes, vector = "vnc", [values[0], values[2], -values[1]]
    elif frame.axes == "ntw":  # y along the velocity, x outward
        axes, vector = "vnc", [values[1], values[2], values[0]]
    elif frame.axes == "lvlh_ccsds":  # z to nadir, x along-track
        axes, vector = "rtn", [-values[2], values[0], -values[1]]
    elif frame.axes == "itrs":
        raise ScenarioError(
            f"{where}: line {named.line}: MAN_REF_FRAME {named.value} turns with the Earth; write RTN, TNW or an "
            "inertial frame"
        )
    else:
        at = Epochs(at_utc, np.array([(stamp_ps - at_ps) / PS_PER_S]))
        vector = (gcrs_from_axes(frame.axes, at)[0] @ values).tolist()
    return StatedManeuver(ignition_s, (vector[0], vector[1], vector[2]), axes, duration_s, lost_kg)

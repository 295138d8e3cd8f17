"""Writers of orbits: CCSDS OEM and OPM (502.0-B, keyword = value), and CSV."""

from __future__ import annotations

import datetime
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import numpy as np

from rso_lidar import units
from rso_lidar.errors import RecordingError
from rso_lidar.files import write_text
from rso_lidar.orbit.ccsds.ephemeris_arc import DEGREE, PLACES, SPEEDS
from rso_lidar.orbit.ccsds.kvn import format_keywords, format_kvn, make_header
from rso_lidar.orbit.ccsds.reference_frames import WRITTEN_ORBIT_AXES, StateFrame, convert_to_written
from rso_lidar.orbit.ccsds.state_message import STATE_KEYS, StatedManeuver
from rso_lidar.orbit.ccsds.table_segment import EDGE_S
from rso_lidar.orbit.earth.axes import EarthAxes
from rso_lidar.orbit.earth.earth_orientation import EarthOrientation
from rso_lidar.orbit.epochs import Epochs, format_epochs, format_utc, tai_ps_from_utc
from rso_lidar.orbit.two_body.covariance_history import CovarianceHistory
from rso_lidar.orbit.two_body.kepler import State
from rso_lidar.orbit.two_body.orbit_axes import ORBIT_AXES, OrbitAxes, check_axes, invert_state_matrix
from rso_lidar.pose import length
from rso_lidar.records import BodyState

_APART = 0.01  # share of the distance from the Earth's centre: 70 km in low orbit, where rtn axes differ by 0.6 deg


def write_oem(
    path: str | Path,
    name: str,
    object_id: str,
    epochs: Epochs,
    states: BodyState,
    *,
    originator: str = "RSO_LIDAR",
    version: Literal["2.0", "3.0"] = "2.0",
    breaks_s: Sequence[float] = (),
    covariances: CovarianceHistory | None = None,
    covariance_axes: OrbitAxes | None = None,
    axes: EarthAxes = "gcrs",
    frame_epoch_utc: datetime.datetime | None = None,
    orientation: EarthOrientation | None = None,
    created_utc: datetime.datetime | None = None,
    overwrite: bool = False,
) -> Path:
    """Write GCRS states as an OEM (keyword = value; UTC; GCRF unless other axes are chosen) to 1e-6 m and 1e-9 m/s.

    Covariances are written to 16 digits, at their own epochs; `read_covariances` reads them.

    Parameters
    ----------
    path : path of the file
    name, object_id : OBJECT_NAME and OBJECT_ID of the message
    epochs : two or more instants
    states : their states in GCRS axes

    Other Parameters
    ----------------
    originator : ORIGINATOR of the message
    version : version of the format
    breaks_s : instants [s] at which the velocity jumps; a new segment begins at each, since interpolation must not
        cross them
    covariances : covariances of the states, at epochs within the segments; none if left out
    covariance_axes : orbital axes in which the file states the covariances, "rtn", "tnw", "ntw", "vnc" or "lvlh_ccsds",
        with velocities relative to inertial axes; those of the states if left out
    axes : axes of the file: "gcrs", "eme2000", "mod", "tod", "teme" or "itrs"
    frame_epoch_utc : for "mod", "tod" and "teme", the one epoch of the axes (REF_FRAME_EPOCH); by default they are those
        of each row's date
    orientation : polar motion and UT1 for "itrs"; without it the file is off by up to 0.9 arcsecond of the distance
    created_utc : CREATION_DATE, now if left out
    overwrite : whether an existing file is replaced

    Returns
    -------
    Path
        the path

    Raises
    ------
    RecordingError
        if the states or epochs make no ephemeris, the covariances are not about it, or the file cannot be written
    ScenarioError
        if the axes are unknown, or have no epoch of their own
    """
    orbit = _check_rows(epochs, states)
    blocks = []
    if covariances is not None:
        _check_orbit(covariances, epochs, orbit)
        chosen = _choose_frame(covariance_axes, axes, frame_epoch_utc)
        blocks = _format_covariances(covariances, chosen, covariance_axes, orientation)
    states, frame = convert_to_written(states, epochs, axes, frame_epoch_utc, orientation)
    rows, texts = _check_rows(epochs, states), format_epochs(epochs)
    edges = np.searchsorted(epochs.time_s, np.sort(np.asarray(breaks_s, dtype=float)))
    parts = [part for part in np.split(np.arange(len(rows)), np.unique(edges)) if len(part)]
    places = _place_covariances(covariances, epochs, parts)
    segments = []
    for number, part in enumerate(parts):
        if len(part) < 2:
            at = epochs.time_s[part[0]]
            raise RecordingError(
                f"epochs: only one, at {at:g} s, is between two breaks; give two or more on each side of a break"
            )
        meta = {
            "OBJECT_NAME": name,
            "OBJECT_ID": object_id,
            "CENTER_NAME": "EARTH",
            **frame,
            "TIME_SYSTEM": "UTC",
            "START_TIME": texts[part[0]],
            "STOP_TIME": texts[part[-1]],
            "INTERPOLATION": "HERMITE",
            "INTERPOLATION_DEGREE": str(min(DEGREE, 2 * len(part) - 1)),
        }
        lines = [_format_line(texts[k], rows[k].tolist()) for k in part]
        own = [line for k in np.flatnonzero(places == number) for line in blocks[k]]
        segments.append((meta, [*lines, *(["", "COVARIANCE_START", *own, "COVARIANCE_STOP"] if own else [])]))
    header = make_header(originator, created_utc)
    return write_text(path, format_kvn("OEM", version, header, segments), overwrite=overwrite)


def _format_line(text: str, row: list[float]) -> str:
    """Format a line of an OEM: km to 1e-9, km/s to 1e-12."""
    cells = [*(f"{value / units.KM:.9f}" for value in row[:3]), *(f"{value / units.KM:.12f}" for value in row[3:])]
    return " ".join([text, *cells])


def _choose_frame(
    covariance_axes: OrbitAxes | None, axes: EarthAxes, frame_epoch_utc: datetime.datetime | None
) -> StateFrame:
    """Return the axes of the covariances of a file: of the orbit, or without a choice those of its states."""
    if covariance_axes is not None:
        check_axes(covariance_axes, ORBIT_AXES)
        return StateFrame("", covariance_axes)
    return StateFrame("", axes, frozen_ps=None if frame_epoch_utc is None else tai_ps_from_utc(frame_epoch_utc))


def _check_orbit(covariances: CovarianceHistory, epochs: Epochs, rows: np.ndarray) -> None:
    """Check that the covariances are about the orbit of the states of a file.

    Parameters
    ----------
    epochs, rows : (row,), (row, 6) states of the file in GCRS axes [m], [m/s]
    """
    if not covariances.has_velocity:
        raise RecordingError(
            "covariances: have no terms of velocity, which an OEM states (502.0-B, 5.2.5); leave the covariances out"
        )
    about_m = covariances.reference.states(covariances.epochs).position_m
    away_s = np.abs(epochs.time_s - covariances.epochs.since(epochs.start_utc)[:, None])
    nearest = away_s.argmin(axis=1)
    place_m, speed_m_s = rows[nearest, :3], length(rows[nearest, 3:])
    beyond_m = length(place_m - about_m) - speed_m_s * away_s.min(axis=1)  # what motion from the row does not explain
    if (beyond_m > _APART * length(place_m)).any():
        raise RecordingError(
            f"covariances: are about an orbit that is {beyond_m.max() / units.KM:,.0f} km from the states; give those of "
            "this object"
        )


def _place_covariances(
    covariances: CovarianceHistory | None, epochs: Epochs, parts: Sequence[np.ndarray]
) -> np.ndarray:
    """Return the number (covariance,) of the segment in which each covariance is; where two meet, the later one.

    Parameters
    ----------
    parts : (segment) numbers of the rows of each segment
    """
    if covariances is None:
        return np.zeros(0, dtype=int)
    at_s = covariances.epochs.since(epochs.start_utc)
    begin_s, end_s = (epochs.time_s[[part[k] for part in parts]] for k in (0, -1))
    which = np.searchsorted(begin_s - EDGE_S, at_s, side="right") - 1
    outside = (which < 0) | (at_s > end_s[which] + EDGE_S)
    if outside.any():
        first = format_utc(epochs.start_utc, float(at_s[np.argmax(outside)]))
        raise RecordingError(
            f"covariances: {int(outside.sum())} of {len(at_s)} are at epochs outside the segments of the states, first "
            f"{first}; give states there, or leave these covariances out"
        )
    return which


def _format_covariances(
    covariances: CovarianceHistory, frame: StateFrame, axes: OrbitAxes | None, orientation: EarthOrientation | None
) -> list[list[str]]:
    """Format the lines of each covariance: its epoch, its axes, and the lower triangle to 16 digits."""
    states = covariances.reference.states(covariances.epochs)
    turns = invert_state_matrix(frame.find_matrix(covariances.epochs, states, orientation))
    named = [] if axes is None else [f"COV_REF_FRAME = {WRITTEN_ORBIT_AXES[axes]}"]
    turned = turns @ covariances.matrices @ np.swapaxes(turns, 1, 2) / units.KM**2
    return [
        [f"EPOCH = {text}", *named, *(" ".join(f"{term:.15e}" for term in matrix[row, : row + 1]) for row in range(6))]
        for text, matrix in zip(format_epochs(covariances.epochs), turned, strict=True)
    ]


def write_opm(
    path: str | Path,
    name: str,
    object_id: str,
    state: State,
    *,
    covariance: np.ndarray | None = None,
    covariance_axes: OrbitAxes | None = None,
    mass_kg: float | None = None,
    maneuvers: Sequence[StatedManeuver] = (),
    originator: str = "RSO_LIDAR",
    version: Literal["2.0", "3.0"] = "2.0",
    axes: EarthAxes = "gcrs",
    frame_epoch_utc: datetime.datetime | None = None,
    orientation: EarthOrientation | None = None,
    created_utc: datetime.datetime | None = None,
    overwrite: bool = False,
) -> Path:
    """Write a state as an OPM (keyword = value; UTC; GCRF unless other axes are chosen) to 1e-6 m and 1e-9 m/s.

    Parameters
    ----------
    path : path of the file
    name, object_id : OBJECT_NAME and OBJECT_ID of the message
    state : its epoch, position and velocity in GCRS axes
    covariance : (6, 6) of the state in GCRS axes [m2, m2/s, m2/s2]; none if left out
    covariance_axes : orbital axes in which the file states the covariance, "rtn", "tnw", "ntw", "vnc" or "lvlh_ccsds", with
        velocities relative to inertial axes; those of the state if left out
    mass_kg : mass at the epoch, which maneuvers require [kg]
    maneuvers : as of `OrbitParameterMessage`, in the order of time

    Other Parameters
    ----------------
    originator : ORIGINATOR of the message
    version : version of the format
    axes : axes of the file: "gcrs", "eme2000", "mod", "tod", "teme" or "itrs"
    frame_epoch_utc : for "mod", "tod" and "teme", the epoch of the axes (REF_FRAME_EPOCH); by default that of the state
    orientation : polar motion and UT1 for "itrs"; without it the file is off by up to 0.9 arcsecond of the distance
    created_utc : CREATION_DATE, now if left out
    overwrite : whether an existing file is replaced

    Returns
    -------
    Path
        the path

    Raises
    ------
    RecordingError
        if the covariance or the maneuvers cannot be stated, or the file cannot be written
    ScenarioError
        if the axes are unknown, or have no epoch of their own
    """
    at = Epochs(state.epoch_utc, np.zeros(1))
    given = BodyState(np.array([state.position_m]), np.array([state.velocity_m_s]))
    there, frame = convert_to_written(given, at, axes, frame_epoch_utc, orientation)
    numbers = [*there.position_m[0].tolist(), *there.velocity_m_s[0].tolist()]
    meta = {"OBJECT_NAME": name, "OBJECT_ID": object_id, "CENTER_NAME": "EARTH", **frame, "TIME_SYSTEM": "UTC"}
    body = {"EPOCH": format_epochs(at)[0]}
    for k, (key, value) in enumerate(zip(STATE_KEYS, numbers, strict=True)):
        body[key] = f"{value / units.KM:.{9 if k < 3 else 12}f} [{'km' if k < 3 else 'km/s'}]"
    blocks = [meta, body]
    if mass_kg is not None:
        if not 0.0 < mass_kg < np.inf:
            raise RecordingError(f"mass_kg: {mass_kg:g} kg; give a mass above 0")
        blocks.append({"MASS": f"{mass_kg:.6f} [kg]"})
    if covariance is not None:
        chosen = _choose_frame(covariance_axes, axes, frame_epoch_utc)
        turn = invert_state_matrix(chosen.find_matrix(at, given, orientation))[0]
        blocks.append(_format_covariance(covariance, turn, covariance_axes))
    if maneuvers and mass_kg is None:
        raise RecordingError("mass_kg: a message with maneuvers states the mass (502.0-B, 3.2.4.9); give it")
    blocks += [_format_maneuver(maneuver, state.epoch_utc) for maneuver in maneuvers]
    text = format_keywords("OPM", version, make_header(originator, created_utc), blocks)
    return write_text(path, text, overwrite=overwrite)


def _format_covariance(covariance: np.ndarray, turn: np.ndarray, axes: OrbitAxes | None) -> dict[str, str]:
    """Format a covariance (6, 6) in GCRS axes, of which `turn` (6, 6) makes that of the file, to 16 digits."""
    matrix = np.asarray(covariance, dtype=float)
    if matrix.shape != (6, 6) or not np.isfinite(matrix).all() or (np.diag(matrix) < 0.0).any():
        raise RecordingError("covariance: needs 6 x 6 finite numbers with variances of 0 or more; correct it")
    turned = turn @ (0.5 * (matrix + matrix.T)) @ turn.T / units.KM**2
    words = {} if axes is None else {"COV_REF_FRAME": WRITTEN_ORBIT_AXES[axes]}
    for row, name in enumerate(STATE_KEYS):
        for column, other in enumerate(STATE_KEYS[: row + 1]):
            unit = ("km**2", "km**2/s", "km**2/s**2")[(row > 2) + (column > 2)]
            words[f"C{name}_{other}"] = f"{turned[row, column]:.15e} [{unit}]"
    return words


def _format_maneuver(maneuver: StatedManeuver, epoch_utc: datetime.datetime) -> dict[str, str]:
    """Format a maneuver, whose time counts from the epoch of the state."""
    x, y, z = (component / units.KM for component in maneuver.delta_v_m_s)
    frame, vector = {
        "rtn": ("RTN", (x, y, z)),
        "vnc": ("TNW", (x, -z, y)),  # N = W x T is inward on a circle
        "inertial": ("GCRF", (x, y, z)),
    }[maneuver.axes]
    words = {
        "MAN_EPOCH_IGNITION": format_epochs(Epochs(epoch_utc, np.array([maneuver.ignition_s])))[0],
        "MAN_DURATION": f"{maneuver.duration_s:.6f} [s]",
        "MAN_DELTA_MASS": f"{maneuver.delta_mass_kg:.6f} [kg]",
        "MAN_REF_FRAME": frame,
    }
    return words | {f"MAN_DV_{k}": f"{value:.12f} [km/s]" for k, value in enumerate(vector, start=1)}


def write_ephemeris_csv(path: str | Path, epochs: Epochs, states: BodyState, *, overwrite: bool = False) -> Path:
    """Write GCRS states as CSV (utc, x_m ..., vx_m_s ...) to 1e-6 m and 1e-9 m/s.

    Parameters
    ----------
    path : path of the file
    epochs : two or more instants
    states : their states in GCRS axes
    overwrite : whether an existing file is replaced

    Returns
    -------
    Path
        the path

    Raises
    ------
    RecordingError
        if the states or epochs make no ephemeris, or the file cannot be written
    """
    rows, texts = _check_rows(epochs, states), format_epochs(epochs)
    lines = [",".join(("utc", *PLACES[0], *SPEEDS[0]))]
    for text, row in zip(texts, rows.tolist(), strict=True):
        cells = [*(f"{value:.6f}" for value in row[:3]), *(f"{value:.9f}" for value in row[3:])]
        lines.append(",".join((f"{text}Z", *cells)))
    return write_text(path, "\n".join(lines) + "\n", overwrite=overwrite)


def _check_rows(epochs: Epochs, states: BodyState) -> np.ndarray:
    rows: np.ndarray = np.concatenate([np.atleast_2d(states.position_m), np.atleast_2d(states.velocity_m_s)], axis=1)
    if rows.shape != (len(epochs), 6) or not np.all(np.isfinite(rows)):
        raise RecordingError(
            f"states: an ephemeris needs finite states at all its {len(epochs)} epochs; leave out the others"
        )
    if len(epochs) < 2 or not np.all(np.diff(epochs.time_s) >= 1e-9):
        raise RecordingError("epochs: an ephemeris needs two or more that grow by 1 ns or more; sort them")
    return rows

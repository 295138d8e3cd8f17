"""Orbit parameter messages (CCSDS 502.0-B, OPM): one state, read from keyword = value text or XML."""

from __future__ import annotations

import datetime
from pathlib import Path

import numpy as np

from rso_lidar import units
from rso_lidar.errors import ScenarioError, warn_of_input
from rso_lidar.orbit.ccsds.keywords import KeywordBlock, check_version, read_keywords
from rso_lidar.orbit.ccsds.message import check_center, read_time_system
from rso_lidar.orbit.ccsds.reader import find_table, read_table_text
from rso_lidar.orbit.ccsds.reference_frames import freeze_axes, parse_frame, warn_without_orientation
from rso_lidar.orbit.earth.axes import convert_states
from rso_lidar.orbit.earth.earth_orientation import EarthOrientation
from rso_lidar.orbit.epochs import PS_PER_S, Epochs, floor_to_utc_second, parse_epoch_ps
from rso_lidar.orbit.two_body.kepler import State
from rso_lidar.records import BodyState

_STATE = ("X", "Y", "Z", "X_DOT", "Y_DOT", "Z_DOT")
_PS_PER_US = PS_PER_S // 1_000_000


def read_opm(path: str | Path, orientation: EarthOrientation | None = None) -> State:
    """Read the state of an orbit parameter message (CCSDS OPM, keyword = value or XML) as a motion.

    The motion is two-body; give it to `Numerical` as `initial` for other forces. Elements, covariance and spacecraft
    parameters of the message are not read. Maneuvers are not flown, of which a warning tells.

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
    version, entries = read_keywords(read_table_text(find_table(where)[0]), "OPM", where)
    check_version(version, "OPM", where, "123")
    block = KeywordBlock(where, "the message")
    # The optional covariance and maneuvers come after the state, and in XML repeat its keyword EPOCH.
    for key, entry in entries:
        if key != "EPOCH" or "X" not in block:
            block.add(key, entry)
    frame = block.require("REF_FRAME")
    check_center("CENTER_NAME", block.require("CENTER_NAME"), where)
    axes = parse_frame(frame.value, f"{where}: line {frame.line}")
    system = read_time_system(block.require("TIME_SYSTEM"), where)
    epoch = block.require("EPOCH")
    stamp_ps = parse_epoch_ps(epoch.value, system, f"{where}: line {epoch.line}")
    values = [block.require_number(key, "km" if k < 3 else "km/s") * units.KM for k, key in enumerate(_STATE)]
    position_m, velocity_m_s = np.array([values[:3]]), np.array([values[3:]])
    fixed = block.find("REF_FRAME_EPOCH")
    if fixed is not None and axes in ("mod", "tod", "teme"):
        frozen_ps = parse_epoch_ps(fixed.value, system, f"{where}: line {fixed.line}")
        position_m, velocity_m_s = freeze_axes(position_m, velocity_m_s, axes, frozen_ps)
        axes = "gcrs"
    if axes == "itrs" and orientation is None:
        warn_without_orientation(where, position_m, "give finals2000A.all of the IERS as orientation")
    if "MAN_EPOCH_IGNITION" in block:
        first = block.text("MAN_EPOCH_IGNITION")
        warn_of_input(f"{where}: has maneuvers from {first} on, which are not flown; give them to 'numerical'")
    start_utc, start_ps = floor_to_utc_second(stamp_ps)
    at = Epochs(start_utc, np.array([(stamp_ps - start_ps) / PS_PER_S]))
    there = convert_states(BodyState(position_m, velocity_m_s), at, from_axes=axes, orientation=orientation)
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

"""Reference frames of CCSDS messages, by the names of the SANA registry, as named axes of this package."""

from __future__ import annotations

import datetime
import re
from collections.abc import Sequence
from typing import Literal

import numpy as np

from rso_lidar.errors import ScenarioError, warn_of_input
from rso_lidar.orbit.earth.axes import EarthAxes, convert_states, gcrs_from_axes
from rso_lidar.orbit.earth.earth_orientation import UNCERTAINTY_WITHOUT_RAD, EarthOrientation
from rso_lidar.orbit.epochs import PS_PER_S, Epochs, floor_to_utc_second, format_epochs
from rso_lidar.orbit.two_body.orbit_axes import orbit_axes_matrix
from rso_lidar.records import BodyState

# Names without spaces, dashes and underscores, and their axes. GCRF and ICRF are equal axes; the centre is the Earth's here.
_NAMES: dict[EarthAxes, tuple[str, ...]] = {
    "gcrs": ("GCRF", "GCRS", "ICRF", "ICRF1", "ICRF2", "ICRF3", "ICRS"),
    "eme2000": ("EME2000", "J2000", "EMEJ2000", "J2000.0"),
    "teme": ("TEME", "TEMEOFDATE"),
    "mod": ("MOD", "MODEARTH"),
    "tod": ("TOD", "TODEARTH"),
    "itrs": ("ITRF", "ITRS", "WGS84"),
}
OrbitFrame = Literal["rtn", "tnw"]
# Names of local orbital axes without dashes and underscores; those of the state's instant, which do not turn.
_ORBIT_NAMES: dict[OrbitFrame, tuple[str, ...]] = {
    "rtn": ("RTN", "RSW", "RIC", "QSW", "RTNINERTIAL", "RSWINERTIAL"),
    "tnw": ("TNW", "TNWINERTIAL"),
}
_ITRF = re.compile(r"ITRF(19|20)?\d\d")  # its realisations agree within centimetres
WRITTEN_FRAMES: dict[EarthAxes, str] = {
    "gcrs": "GCRF",
    "eme2000": "EME2000",
    "teme": "TEME",
    "mod": "MOD",
    "tod": "TOD",
    "itrs": "ITRF",
}


def parse_frame(name: str, where: str) -> EarthAxes:
    """Parse the name of a frame, or raise `ScenarioError`."""
    plain = name.upper().replace(" ", "").replace("_", "").replace("-", "")
    for axes, names in _NAMES.items():
        if plain in names or (axes == "itrs" and _ITRF.fullmatch(plain)):
            return axes
    known = ", ".join(WRITTEN_FRAMES.values())
    raise ScenarioError(f"{where}: reference frame {name} is not supported; write the file in {known}")


def parse_orbit_frame(name: str, where: str) -> EarthAxes | OrbitFrame:
    """Parse the name of a frame of a covariance or a maneuver, which may be orbital axes, or raise `ScenarioError`."""
    plain = name.upper().replace(" ", "").replace("_", "").replace("-", "")
    for frame, names in _ORBIT_NAMES.items():
        if plain in names:
            return frame
    try:
        return parse_frame(name, where)
    except ScenarioError:
        known = ", ".join(("RTN", "TNW", *WRITTEN_FRAMES.values()))
        raise ScenarioError(f"{where}: reference frame {name} is not supported; write {known}") from None


def gcrs_from_orbit_frame(
    frame: OrbitFrame, position_m: np.ndarray | Sequence[float], velocity_m_s: np.ndarray | Sequence[float]
) -> np.ndarray:
    """Return the rotation matrix (3, 3) from orbital axes of a state (3,) in GCRS axes.

    502.0-B-3, 3.2.4.11: TNW has x along the velocity, W along the angular momentum, and N completes the right-handed
    system.
    """
    position, velocity = np.asarray(position_m, dtype=float), np.asarray(velocity_m_s, dtype=float)
    if frame == "rtn":
        return orbit_axes_matrix("rtn", position, velocity)
    outward, along, normal = orbit_axes_matrix("ntw", position, velocity).T
    return np.stack([along, -outward, normal], axis=-1)


def freeze_axes(
    position_m: np.ndarray, velocity_m_s: np.ndarray, axes: EarthAxes, stamp_ps: int
) -> tuple[np.ndarray, np.ndarray]:
    """Rotate states from MOD, TOD or TEME of one fixed epoch (REF_FRAME_EPOCH) to GCRS axes.

    Parameters
    ----------
    position_m, velocity_m_s : (row, 3) [m], [m/s]
    stamp_ps : the epoch of the axes [ps of TAI since the start of 2000]
    """
    start_utc, start_ps = floor_to_utc_second(stamp_ps)
    matrix = gcrs_from_axes(axes, Epochs(start_utc, np.array([(stamp_ps - start_ps) / PS_PER_S])))[0]
    return position_m @ matrix.T, velocity_m_s @ matrix.T


def convert_to_written(
    states: BodyState,
    epochs: Epochs,
    axes: EarthAxes,
    frame_epoch_utc: datetime.datetime | None,
    orientation: EarthOrientation | None,
) -> tuple[BodyState, dict[str, str]]:
    """Convert GCRS states to the axes of a file, and return them with the metadata REF_FRAME and REF_FRAME_EPOCH.

    Parameters
    ----------
    frame_epoch_utc : epoch of axes of date, which then do not turn with the epochs; None for axes of date
    """
    words = {"REF_FRAME": WRITTEN_FRAMES[axes]} if axes in WRITTEN_FRAMES else {}
    if frame_epoch_utc is None:
        return convert_states(states, epochs, to_axes=axes, orientation=orientation), words
    if axes not in ("mod", "tod", "teme"):
        raise ScenarioError(
            f"frame_epoch_utc: '{axes}' are no axes of date; use 'mod', 'tod' or 'teme', or leave it out"
        )
    fixed = Epochs(frame_epoch_utc, np.zeros(1))
    matrix = gcrs_from_axes(axes, fixed)[0]
    words["REF_FRAME_EPOCH"] = format_epochs(fixed)[0]
    return BodyState(np.atleast_2d(states.position_m) @ matrix, np.atleast_2d(states.velocity_m_s) @ matrix), words


def warn_without_orientation(where: str, position_m: np.ndarray, cure: str) -> None:
    """Warn that positions in ITRF are converted without polar motion and UT1 of the IERS."""
    off_m = UNCERTAINTY_WITHOUT_RAD * float(np.linalg.norm(position_m, axis=-1).max(initial=0.0))
    warn_of_input(f"{where}: is in ITRF, and without polar motion and UT1 it is off by up to {off_m:.0f} m: {cure}")

"""Reference frames of CCSDS messages, by the names of the SANA registry, as named axes of this package."""

from __future__ import annotations

import datetime
import re
from dataclasses import dataclass

import numpy as np

from rso_lidar.errors import ScenarioError, warn_of_input
from rso_lidar.orbit.earth.axes import EarthAxes, convert_states, gcrs_from_axes, gcrs_state_matrix
from rso_lidar.orbit.earth.earth_orientation import UNCERTAINTY_WITHOUT_RAD, EarthOrientation
from rso_lidar.orbit.epochs import PS_PER_S, Epochs, floor_to_utc_second, format_epochs
from rso_lidar.orbit.two_body.orbit_axes import OrbitAxes
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
# Names of axes of an orbit without dashes and underscores. Velocities along them are relative to inertial axes, unless the
# name ends in ROTATING (SANA, orbit-relative reference frames).
_ORBIT_NAMES: dict[OrbitAxes, tuple[str, ...]] = {
    "rtn": ("RTN", "RSW", "RIC", "QSW"),
    "tnw": ("TNW",),
    "ntw": ("NTW",),
    "vnc": ("VNC",),
    "lvlh_ccsds": ("LVLH",),
}
WRITTEN_ORBIT_AXES: dict[OrbitAxes, str] = {
    "rtn": "RTN",
    "tnw": "TNW",
    "ntw": "NTW_INERTIAL",
    "vnc": "VNC_INERTIAL",
    "lvlh_ccsds": "LVLH_INERTIAL",
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


@dataclass(frozen=True)
class StateFrame:
    """Axes of a covariance or a maneuver of a message.

    Parameters
    ----------
    name : as the message gives it
    axes : of the Earth or of the orbit
    rotating : whether velocities are relative to orbital axes as they turn
    frozen_ps : epoch of axes of date [ps of TAI since the start of 2000]; None for that of the state
    """

    name: str
    axes: EarthAxes | OrbitAxes
    rotating: bool = False
    frozen_ps: int | None = None

    def find_matrix(self, epochs: Epochs, states: BodyState, orientation: EarthOrientation | None = None) -> np.ndarray:
        """Return the matrices (time, 6, 6) that take states in these axes to those in GCRS axes.

        Parameters
        ----------
        states : (time, 3) of the orbit, in GCRS axes
        """
        if self.frozen_ps is not None and self.axes in ("mod", "tod", "teme"):
            start_utc, start_ps = floor_to_utc_second(self.frozen_ps)
            fixed = Epochs(start_utc, np.array([(self.frozen_ps - start_ps) / PS_PER_S]))
            return np.broadcast_to(gcrs_state_matrix(self.axes, fixed), (len(epochs), 6, 6))
        return gcrs_state_matrix(self.axes, epochs, states, rotating=self.rotating, orientation=orientation)


def parse_orbit_frame(name: str, where: str) -> StateFrame:
    """Parse the name of a frame of a covariance or a maneuver, which may be orbital axes, or raise `ScenarioError`."""
    plain = name.upper().replace(" ", "").replace("_", "").replace("-", "")
    base = plain.removesuffix("INERTIAL").removesuffix("ROTATING")
    for axes, names in _ORBIT_NAMES.items():
        if base in names:
            if plain == "LVLH":
                raise ScenarioError(
                    f"{where}: reference frame {name} means two things; write LVLH_INERTIAL or LVLH_ROTATING (z to "
                    "nadir), or RTN (x outward)"
                )
            return StateFrame(name, axes, plain.endswith("ROTATING"))
    try:
        return StateFrame(name, parse_frame(name, where))
    except ScenarioError:
        known = ", ".join((*WRITTEN_ORBIT_AXES.values(), *WRITTEN_FRAMES.values()))
        raise ScenarioError(f"{where}: reference frame {name} is not supported; write {known}") from None


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

"""Reference frames of CCSDS messages, by the names of the SANA registry, as named axes of this package."""

from __future__ import annotations

import re

import numpy as np

from rso_lidar.errors import ScenarioError, warn_of_input
from rso_lidar.orbit.earth.axes import EarthAxes, gcrs_from_axes
from rso_lidar.orbit.earth.earth_orientation import UNCERTAINTY_WITHOUT_RAD
from rso_lidar.orbit.epochs import PS_PER_S, Epochs, floor_to_utc_second

# Names without spaces, dashes and underscores, and their axes. GCRF and ICRF are equal axes; the centre is the Earth's here.
_NAMES: dict[EarthAxes, tuple[str, ...]] = {
    "gcrs": ("GCRF", "GCRS", "ICRF", "ICRF1", "ICRF2", "ICRF3", "ICRS"),
    "eme2000": ("EME2000", "J2000", "EMEJ2000", "J2000.0"),
    "teme": ("TEME", "TEMEOFDATE"),
    "mod": ("MOD", "MODEARTH"),
    "tod": ("TOD", "TODEARTH"),
    "itrs": ("ITRF", "ITRS", "WGS84"),
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


def warn_without_orientation(where: str, position_m: np.ndarray, cure: str) -> None:
    """Warn that positions in ITRF are converted without polar motion and UT1 of the IERS."""
    off_m = UNCERTAINTY_WITHOUT_RAD * float(np.linalg.norm(position_m, axis=-1).max(initial=0.0))
    warn_of_input(f"{where}: is in ITRF, and without polar motion and UT1 it is off by up to {off_m:.0f} m: {cure}")

"""The toolkit's pool of kernels: loaded for one call at a time, and its time scale."""

from __future__ import annotations

import importlib.util
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.orbit.ccsds.reader import find_table
from rso_lidar.orbit.epochs import J2000_TT_JD, Epochs

LOCK = threading.RLock()  # CSPICE has one pool of kernels in a process, and is not safe among threads
# TDB - TT as in NAIF's leap-second kernels (naif0012.tls): amplitude [s], eccentricity, mean anomaly [rad] and its rate
_AMPLITUDE_S, _ECCENTRICITY, _ANOMALY_RAD, _ANOMALY_RATE = 1.657e-3, 1.671e-2, 6.239996, 1.99096871e-7


def import_spiceypy(where: str) -> Any:
    """Import the toolkit; a `ScenarioError` names the extra where it is not installed."""
    if importlib.util.find_spec("spiceypy") is None:
        raise ScenarioError(f"{where}: SPICE kernels need the extra 'spice' (pip install 'rso-lidar[spice]')")
    import spiceypy

    return spiceypy


@contextmanager
def load_kernels(kernels: Sequence[str], where: str) -> Iterator[Any]:
    """Load kernels for the duration of a block, which gets the toolkit; its errors become one line."""
    spice = import_spiceypy(where)
    paths = [str(find_table(kernel)[0]) for kernel in kernels]
    loaded: list[str] = []
    with LOCK:
        try:
            for path in paths:
                try:
                    spice.furnsh(path)
                except spice.utils.exceptions.SpiceyError as error:
                    raise ScenarioError(
                        f"{where}: {path}: is no kernel that can be loaded ({explain_error(error)}); correct or replace it"
                    ) from None
                loaded.append(path)
            yield spice
        except spice.utils.exceptions.SpiceyError as error:
            raise ScenarioError(f"{where}: {explain_error(error)}") from None
        finally:
            for path in reversed(loaded):
                spice.unload(path)


def explain_error(error: Any) -> str:
    """Return the toolkit's explanation of an error in one line."""
    words = " ".join(f"{getattr(error, 'short', '')} {getattr(error, 'long', '') or error}".split())
    return f"{words:.300}"


def find_ephemeris_times(epochs: Epochs) -> tuple[np.ndarray, np.ndarray]:
    """Return ephemeris times (time) [s of TDB after J2000], and how far the epochs are after these rounded numbers [s].

    A number of seconds after J2000 is rounded to 0.1 us, which is a millimetre along a low orbit.
    """
    whole, fraction = epochs.tt_julian()
    days_s, in_day_s = (whole - J2000_TT_JD) * units.DAY_S, fraction * units.DAY_S
    anomaly = _ANOMALY_RAD + _ANOMALY_RATE * (days_s + in_day_s)
    in_day_s = in_day_s + _AMPLITUDE_S * np.sin(anomaly + _ECCENTRICITY * np.sin(anomaly))
    times_s = days_s + in_day_s
    return times_s, in_day_s - (times_s - days_s)


def find_tdb_rate(times_s: np.ndarray) -> np.ndarray:
    """Return by how much TDB is faster than TT (time), 3.3e-10 at most; velocities of kernels are per second of TDB.

    Parameters
    ----------
    times_s : (time) ephemeris times [s]
    """
    anomaly = _ANOMALY_RAD + _ANOMALY_RATE * times_s
    slope = _ANOMALY_RATE * (1.0 + _ECCENTRICITY * np.cos(anomaly))
    rate: np.ndarray = _AMPLITUDE_S * slope * np.cos(anomaly + _ECCENTRICITY * np.sin(anomaly))
    return rate

"""Writers of ephemerides: CCSDS OEM (502.0-B, keyword = value) and CSV."""

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
from rso_lidar.orbit.ccsds.kvn import format_kvn, make_header
from rso_lidar.orbit.ccsds.reference_frames import WRITTEN_FRAMES
from rso_lidar.orbit.earth.axes import EarthAxes, convert_states
from rso_lidar.orbit.earth.earth_orientation import EarthOrientation
from rso_lidar.orbit.epochs import Epochs, format_epochs
from rso_lidar.records import BodyState


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
    axes: EarthAxes = "gcrs",
    orientation: EarthOrientation | None = None,
    created_utc: datetime.datetime | None = None,
    overwrite: bool = False,
) -> Path:
    """Write GCRS states as an OEM (keyword = value; UTC; GCRF unless other axes are chosen) to 1e-6 m and 1e-9 m/s.

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
    axes : axes of the file: "gcrs", "eme2000", "mod", "tod", "teme" or "itrs"
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
        if the states or epochs make no ephemeris, or the file cannot be written
    ScenarioError
        if the axes are unknown
    """
    _check_rows(epochs, states)
    states = convert_states(states, epochs, to_axes=axes, orientation=orientation)
    rows, texts = _check_rows(epochs, states), format_epochs(epochs)
    edges = np.searchsorted(epochs.time_s, np.sort(np.asarray(breaks_s, dtype=float)))
    segments = []
    for part in np.split(np.arange(len(rows)), np.unique(edges)):
        if not len(part):
            continue
        if len(part) < 2:
            at = epochs.time_s[part[0]]
            raise RecordingError(
                f"epochs: only one, at {at:g} s, is between two breaks; give two or more on each side of a break"
            )
        meta = {
            "OBJECT_NAME": name,
            "OBJECT_ID": object_id,
            "CENTER_NAME": "EARTH",
            "REF_FRAME": WRITTEN_FRAMES[axes],
            "TIME_SYSTEM": "UTC",
            "START_TIME": texts[part[0]],
            "STOP_TIME": texts[part[-1]],
            "INTERPOLATION": "HERMITE",
            "INTERPOLATION_DEGREE": str(min(DEGREE, 2 * len(part) - 1)),
        }
        segments.append((meta, [_format_line(texts[k], rows[k].tolist()) for k in part]))
    header = make_header(originator, created_utc)
    return write_text(path, format_kvn("OEM", version, header, segments), overwrite=overwrite)


def _format_line(text: str, row: list[float]) -> str:
    """Format a line of an OEM: km to 1e-9, km/s to 1e-12."""
    cells = [*(f"{value / units.KM:.9f}" for value in row[:3]), *(f"{value / units.KM:.12f}" for value in row[3:])]
    return " ".join([text, *cells])


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

"""SPICE kernels of truth: orbits as SPK of type 9 or 13, and attitudes as CK of type 3 with their clock and frame."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from rso_lidar import units
from rso_lidar.errors import RecordingError
from rso_lidar.files import check_writable, write_atomically, write_text
from rso_lidar.orbit.epochs import Epochs
from rso_lidar.orbit.spice.kernel_pool import LOCK, explain_error, find_ephemeris_times, find_tdb_rate, import_spiceypy
from rso_lidar.orbit.spice.kernel_states import shift_states
from rso_lidar.records import BodyState

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

_EARTH, _DEGREE = 399, 7
_TICKS_PER_S = 1_000_000
# Over 1 ms the Earth as a point misplaces a state by some 10 nm and 10 um/s in a low orbit.
_JOINED_S = 1e-3
_FRAME = """KPL/FK

Body-fixed frame of {name}; its attitude is in a CK of the same name.

\\begindata
NAIF_BODY_NAME += ( '{name}' )
NAIF_BODY_CODE += ( {body} )
FRAME_{frame} = {number}
FRAME_{number}_NAME = '{frame}'
FRAME_{number}_CLASS = 3
FRAME_{number}_CLASS_ID = {number}
FRAME_{number}_CENTER = {body}
CK_{number}_SCLK = {body}
CK_{number}_SPK = {body}
\\begintext
"""
_CLOCK = """KPL/SCLK

Clock of {name}, which counts microseconds of TDB from the first row of its attitude.

\\begindata
SCLK_KERNEL_ID = ( @2000-01-01 )
SCLK_DATA_TYPE_{clock} = ( 1 )
SCLK01_TIME_SYSTEM_{clock} = ( 1 )
SCLK01_N_FIELDS_{clock} = ( 2 )
SCLK01_MODULI_{clock} = ( 4294967296 {ticks} )
SCLK01_OFFSETS_{clock} = ( 0 0 )
SCLK01_OUTPUT_DELIM_{clock} = ( 1 )
SCLK_PARTITION_START_{clock} = ( 0.0 )
SCLK_PARTITION_END_{clock} = ( {end} )
SCLK01_COEFFICIENTS_{clock} = ( 0.0 {start!r} 1.0 )
\\begintext
"""


def write_spk(
    path: str | Path,
    name: str,
    body: int,
    epochs: Epochs,
    states: BodyState,
    *,
    kind: Literal[9, 13] = 13,
    breaks_s: Sequence[float] = (),
    overwrite: bool = False,
) -> Path:
    """Write GCRS states as an SPK about the Earth: Hermite's (type 13) or Lagrange's interpolation (type 9) of degree 7.

    Parameters
    ----------
    path : path of the file
    name : of the body, for the names of the segments
    body : NAIF's number of the body, negative for a spacecraft
    epochs : two or more instants
    states : their states in GCRS axes

    Other Parameters
    ----------------
    kind : type of the kernel, 9 or 13
    breaks_s : instants [s] at which the velocity jumps; a new segment begins at each. The last state before it is carried
        to it, if nearer than 1 ms, so that the segments meet; at the break itself the later one answers
    overwrite : whether an existing file is replaced

    Returns
    -------
    Path
        the path

    Raises
    ------
    RecordingError
        if the states or epochs make no kernel, or the file cannot be written
    ScenarioError
        if the extra `spice` is not installed
    """
    times_s, rest_s = find_ephemeris_times(epochs)
    shape = (len(epochs), 3)
    if np.shape(states.position_m) != shape or np.shape(states.velocity_m_s) != shape:
        raise RecordingError(f"spk: {len(epochs)} epochs need positions and velocities {shape}")
    rows = _list_rows(states, times_s, -rest_s)
    if len(rows) < 2 or not np.isfinite(rows).all() or not (np.diff(times_s) > 0.0).all():
        raise RecordingError(
            "spk: needs finite states at two or more epochs that grow by 1 us or more; leave out the others"
        )
    edges = np.unique(np.searchsorted(epochs.time_s, np.sort(np.asarray(breaks_s, dtype=float))))
    parts = [part for part in np.split(np.arange(len(rows)), edges) if len(part)]
    if any(len(part) < 2 for part in parts):
        raise RecordingError("spk: only one epoch is between two breaks; give two or more on each side of a break")
    segments = [(times_s[part].copy(), rows[part]) for part in parts]
    for (at_s, last), later in zip(segments, parts[1:], strict=False):
        ahead_s = times_s[later[0]] - at_s[-1]
        if ahead_s <= _JOINED_S:
            row = later[0] - 1
            state = BodyState(states.position_m[row : row + 1], states.velocity_m_s[row : row + 1])
            at_s[-1] = times_s[later[0]]
            last[-1] = _list_rows(state, at_s[-1:], ahead_s - rest_s[row : row + 1])[0]

    def fill(spice: Any, file: str) -> None:
        handle = spice.spkopn(file, "SPK", 0)
        for part, (at_s, rows) in zip(parts, segments, strict=True):
            degree = min(_DEGREE, 2 * len(part) - 1 if kind == 13 else len(part) - 1)
            write = spice.spkw13 if kind == 13 else spice.spkw09
            write(handle, body, _EARTH, "J2000", at_s[0], at_s[-1], name[:40], degree, len(part), rows, at_s)
        spice.spkcls(handle)

    return _write_binary(path, fill, overwrite=overwrite)


def _list_rows(states: BodyState, times_s: np.ndarray, by_s: np.ndarray) -> np.ndarray:
    """Return rows (time, 6) [km], [km/s of TDB] of states that are shifted in time.

    Parameters
    ----------
    times_s : (time) ephemeris times of the rows [s]
    by_s : (time) shifts [s]
    """
    moved = shift_states(states, by_s)
    velocity_m_s = moved.velocity_m_s / (1.0 + find_tdb_rate(times_s))[:, None]
    return np.concatenate([moved.position_m, velocity_m_s], axis=1) / units.KM


def write_ck(
    path: str | Path,
    name: str,
    body: int,
    epochs: Epochs,
    gcrs_from_body: Rotation,
    rate_rad_s: np.ndarray,
    *,
    overwrite: bool = False,
) -> Path:
    """Write attitudes as a CK of type 3, with a frame kernel (.tf) and a clock kernel (.tsc) beside it.

    The frame is called NAME_BODY, in capitals, and its number is 1000 times that of the body.

    Parameters
    ----------
    path : path of the CK
    name : of the body: letters, digits and underscores
    body : NAIF's number of the body, below 0
    epochs : two or more instants
    gcrs_from_body : (time) attitudes
    rate_rad_s : (time, 3) angular velocity relative to GCRS axes, in body axes [rad/s]

    Other Parameters
    ----------------
    overwrite : whether existing files are replaced

    Returns
    -------
    Path
        the path

    Raises
    ------
    RecordingError
        if the attitudes or epochs make no kernel, or a file cannot be written
    ScenarioError
        if the extra `spice` is not installed
    """
    from scipy.spatial.transform import Rotation

    times_s, rest_s = find_ephemeris_times(epochs)
    rate = np.array(rate_rad_s, dtype=float)
    if rate.shape != (len(epochs), 3) or len(gcrs_from_body) != len(epochs) or not np.isfinite(rate).all():
        raise RecordingError(f"ck: {len(epochs)} epochs need as many attitudes and finite rates ({len(epochs)}, 3)")
    if len(epochs) < 2 or not (np.diff(times_s) > 0.0).all():
        raise RecordingError("ck: needs two or more epochs that grow by 1 us or more; sort them")
    if body >= 0 or not name.isascii() or not name.replace("_", "a").isalnum() or len(name) > 20:
        raise RecordingError(
            f"ck: body {body} named '{name:.30}': needs a number below 0, and up to 20 letters, digits and underscores"
        )
    turned = gcrs_from_body * Rotation.from_rotvec(-rate * rest_s[:, None])
    spins = turned.apply(rate)  # in J2000 axes
    ticks = (times_s - times_s[0]) * _TICKS_PER_S
    frame = f"{name.upper()}_BODY"
    words = {"name": name.upper(), "body": body, "frame": frame, "number": 1000 * body, "clock": -body,
             "ticks": _TICKS_PER_S, "end": 4294967296 * _TICKS_PER_S, "start": float(times_s[0])}  # fmt: skip
    beside = [(Path(path).with_suffix(".tf"), _FRAME), (Path(path).with_suffix(".tsc"), _CLOCK)]
    for place, _ in beside:
        check_writable(place, overwrite=overwrite)

    def fill(spice: Any, file: str) -> None:
        handle = spice.ckopn(file, "CK", 0)
        # m2q takes the rotation from J2000 axes to those of the body
        quaternions = np.stack([spice.m2q(np.ascontiguousarray(matrix.T)) for matrix in turned.as_matrix()])
        spice.ckw03(
            handle, ticks[0], ticks[-1], 1000 * body, "J2000", True, frame, len(ticks), ticks, quaternions, spins, 1,
            ticks[:1],
        )  # fmt: skip
        spice.ckcls(handle)

    written = _write_binary(path, fill, overwrite=overwrite)
    for place, template in beside:
        write_text(place, template.format(**words), overwrite=overwrite)
    return written


def _write_binary(path: str | Path, fill: Callable[[Any, str], None], *, overwrite: bool) -> Path:
    """Write a binary kernel beside its place, and move it there when it is complete."""
    place = check_writable(path, overwrite=overwrite)
    spice = import_spiceypy(str(path))
    with LOCK, tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "kernel.bin")
        try:
            fill(spice, str(file))
        except spice.utils.exceptions.SpiceyError as error:
            raise RecordingError(f"{path}: {explain_error(error)}") from None
        content = file.read_bytes()
    with write_atomically(place) as draft:
        draft.write_bytes(content)
    return place

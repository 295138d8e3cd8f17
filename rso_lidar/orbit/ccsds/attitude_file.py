"""Files of attitudes, read and written: CCSDS AEM (504.0-B, keyword = value or XML) and CSV.

A CCSDS quaternion "from A to B" transforms coordinates: v_B = M(q) v_A, with M as in Wertz. As a rotation of
vectors, the same four numbers are a_from_b. The file, or the version of its format, defines which number is the scalar.
"""

from __future__ import annotations

import datetime
import functools
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from rso_lidar.errors import RecordingError, ScenarioError
from rso_lidar.files import write_text
from rso_lidar.orbit.ccsds.csv_table import check_unit_quaternions, elapsed_from_ps, read_csv_table
from rso_lidar.orbit.ccsds.kvn import format_kvn, make_header
from rso_lidar.orbit.ccsds.message import (
    CcsdsMessage,
    CcsdsSegment,
    check_increasing,
    parse_number,
    select_segments,
    usable_span_s,
)
from rso_lidar.orbit.ccsds.reader import find_table, is_message, read_message, read_table_text
from rso_lidar.orbit.ccsds.reference_frames import parse_frame
from rso_lidar.orbit.ccsds.table_segment import TableSegment, sort_segments
from rso_lidar.orbit.earth.axes import gcrs_from_eme2000
from rso_lidar.orbit.epochs import Epochs, format_epochs, parse_epoch_ps
from rso_lidar.orbit.two_body.orbit_axes import rtn_from_lvlh_ccsds
from rso_lidar.pose import quaternion_xyzw

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

_QUATERNION = ("qx", "qy", "qz", "qw")
_ORBITAL = ("RTN", "RSW", "QSW", "RIC")
_KINDS = ("QUATERNION", "QUATERNION/DERIVATIVE", "QUATERNION/RATE", "QUATERNION/ANGVEL")


@dataclass(frozen=True, eq=False)
class AttitudeSegment(TableSegment):
    """Attitudes of one segment of a table.

    Parameters
    ----------
    rotation : axes_from_body (row)
    in_origin : whether the axes are rtn axes at the body's origin, and not inertial axes
    """

    rotation: Rotation
    in_origin: bool

    @functools.cached_property
    def _spline(self) -> Any:
        from scipy.spatial.transform import RotationSpline

        return RotationSpline(self.time_s, self.rotation)

    @functools.cached_property
    def _slerp(self) -> tuple[Any, np.ndarray]:
        """Return the interpolator, and its constant rates (row - 1, 3) [rad/s] between rows."""
        from scipy.spatial.transform import Slerp

        steps = (self.rotation[:-1].inv() * self.rotation[1:]).as_rotvec()
        return Slerp(self.time_s, self.rotation), steps / np.diff(self.time_s)[:, None]

    def interpolate(self, time_s: np.ndarray, interpolation: str) -> tuple[Rotation, np.ndarray]:
        """Interpolate axes_from_body and body rates (time, 3) [rad/s]; slerp gives the rate after a row at that row.

        Parameters
        ----------
        time_s : (time,) instants since the segment's start, within its rows [s]
        interpolation : "spline" or "slerp"
        """
        if interpolation == "spline":
            return self._spline(time_s), self._spline(time_s, 1)
        slerp, rates = self._slerp
        after = np.searchsorted(self.time_s, time_s, side="right") - 1
        return slerp(time_s), rates[np.clip(after, 0, len(rates) - 1)]


def read_attitudes(file: str, wanted: str | None, axes: str | None) -> tuple[AttitudeSegment, ...]:
    """Read a table of attitudes from a CCSDS AEM or a CSV file, cached until the file changes.

    Parameters
    ----------
    file : path of the file
    wanted : name or identifier of one object of an AEM; None for the only one
    axes : axes of a CSV table, "inertial", "rtn" or "lvlh_ccsds"; None for inertial. Those of an AEM are stated in it

    Returns
    -------
    segments in the order of time, as rotations axes_from_body in inertial (GCRS) or rtn axes

    Raises
    ------
    ScenarioError
        if the file is invalid, its segments overlap or differ in axes, or `wanted` or `axes` does not apply to its
        format
    """
    return _read_file(*find_table(file), wanted, axes)


@functools.lru_cache(maxsize=16)
def _read_file(
    path: Path, _modified_ns: int, _size: int, wanted: str | None, axes: str | None
) -> tuple[AttitudeSegment, ...]:
    """Read a table of attitudes, cached until the file changes."""
    text = read_table_text(path)
    if not is_message(text):
        if wanted is not None:
            raise ScenarioError(f"{path}: a CSV table holds one object and no name; leave out object '{wanted}'")
        return (_read_csv(text, str(path), axes or "inertial"),)
    if axes is not None:
        raise ScenarioError(f"{path}: an AEM states its own axes; leave out axes '{axes}'")
    message = read_message(text, "AEM", str(path))
    arcs: list[AttitudeSegment] = []
    for segment in select_segments(message, wanted):
        arcs.append(_read_segment(message, segment, arcs[0].start_utc if arcs else None))
    if len({arc.in_origin for arc in arcs}) > 1:
        raise ScenarioError(f"{path}: has segments in inertial axes and in rtn axes; write all in the same axes")
    return sort_segments(arcs)


def _read_csv(text: str, where: str, axes: str) -> AttitudeSegment:
    """Read a CSV table as one segment."""
    from scipy.spatial.transform import Rotation

    table = read_csv_table(text, where, (_QUATERNION,), (_QUATERNION,))
    rotation = Rotation.from_quat(table.stack_unit_quaternions(_QUATERNION))
    if axes == "lvlh_ccsds":
        rotation = rtn_from_lvlh_ccsds() * rotation
    time_s = table.time_s
    return AttitudeSegment(where, table.start_utc, time_s[0], time_s[-1], time_s, rotation, axes != "inertial")


def _read_segment(message: CcsdsMessage, segment: CcsdsSegment, start_utc: datetime.datetime | None) -> AttitudeSegment:
    """Read one segment of an AEM, as axes_from_body in inertial or rtn axes; times count from its first row by default."""
    from scipy.spatial.transform import Rotation

    at = f"{message.where}: line {segment.line}"
    kind = message.require(segment, "ATTITUDE_TYPE")
    if kind.value.upper() not in _KINDS:
        raise ScenarioError(
            f"{message.where}: line {kind.line}: ATTITUDE_TYPE {kind.value} is not supported; "
            "write the attitudes as QUATERNION"
        )
    system = message.time_system(segment)
    scalar_first = _is_scalar_first(message, segment)
    if len(segment.rows) < 2:
        raise ScenarioError(f"{at}: the segment has {len(segment.rows)} rows; it needs at least two")
    stamps, values, lines = [], [], []
    for line, cells in segment.rows:
        here = f"{message.where}: line {line}"
        if len(cells) < 5 or (len(cells) > 5 and kind.value.upper() == "QUATERNION"):
            raise ScenarioError(
                f"{here}: has {len(cells)} words; a row of {kind.value} begins with an epoch and 4 numbers"
            )
        stamps.append(parse_epoch_ps(cells[0], system, here))
        values.append([parse_number(here, "the quaternion", cell) for cell in cells[1:5]])
        lines.append(line)
    check_increasing(message.where, stamps, lines)
    numbers = np.array(values)
    if scalar_first:
        numbers = np.roll(numbers, -1, axis=1)
    rotation = Rotation.from_quat(check_unit_quaternions(message.where, numbers, lines))
    axes, reverse = _read_axes(message, segment)
    if reverse:
        rotation = rotation.inv()
    if axes == "eme2000":
        rotation = Rotation.from_matrix(gcrs_from_eme2000()) * rotation
    start, time_s = elapsed_from_ps(stamps, start_utc)
    span = usable_span_s(message, segment, system, stamps[0], time_s)
    return AttitudeSegment(at, start, *span, time_s, rotation, axes == "rtn")


def _is_scalar_first(message: CcsdsMessage, segment: CcsdsSegment) -> bool:
    """Return whether the scalar is the first number; from version 2.0 on it is the last by default."""
    entry = segment.meta.get("QUATERNION_TYPE")
    if entry is None:
        if message.version.startswith("1"):
            message.require(segment, "QUATERNION_TYPE")
        return False
    if entry.value.upper() not in ("FIRST", "LAST"):
        raise ScenarioError(
            f"{message.where}: line {entry.line}: QUATERNION_TYPE {entry.value}; write FIRST or LAST (the scalar)"
        )
    return entry.value.upper() == "FIRST"


def _read_axes(message: CcsdsMessage, segment: CcsdsSegment) -> tuple[str, bool]:
    """Read the reference axes, "gcrs", "eme2000" or "rtn", and whether the quaternion leads from the body to them."""
    ends = {key: message.require(segment, f"REF_FRAME_{key}") for key in "AB"}
    bodily = [key for key, end in ends.items() if end.value.upper().replace(" ", "_").startswith("SC_BODY")]
    if len(bodily) != 1:
        raise ScenarioError(
            f"{message.where}: line {ends['B'].line}: REF_FRAME_A {ends['A'].value}, REF_FRAME_B {ends['B'].value}; one of "
            "them must be SC_BODY"
        )
    other = ends["A" if bodily == ["B"] else "B"]
    axes: str
    if other.value.upper() in _ORBITAL:
        axes = "rtn"
    else:
        axes = parse_frame(other.value, f"{message.where}: line {other.line}")
        if axes not in ("gcrs", "eme2000"):
            raise ScenarioError(
                f"{message.where}: line {other.line}: an attitude in {other.value} is not supported; write it in GCRF or "
                "EME2000"
            )
    entry = segment.meta.get("ATTITUDE_DIR")
    if entry is None and message.version.startswith(
        "1"
    ):  # required in version 1 (504.0-B-1, table 4-3), removed in 2.0
        message.require(segment, "ATTITUDE_DIR")
    direction = entry.value.upper() if entry is not None else "A2B"
    if direction not in ("A2B", "B2A"):
        line = entry.line if entry is not None else segment.line
        raise ScenarioError(f"{message.where}: line {line}: ATTITUDE_DIR {direction}; write A2B or B2A")
    return axes, (direction == "A2B") == (bodily == ["A"])


def write_aem(
    path: str | Path,
    name: str,
    object_id: str,
    epochs: Epochs,
    inertial_from_body: Rotation,
    *,
    originator: str = "RSO_LIDAR",
    version: Literal["1.0", "2.0"] = "1.0",
    created_utc: datetime.datetime | None = None,
    overwrite: bool = False,
) -> Path:
    """Write attitudes as one segment of an AEM (keyword = value; GCRF to SC_BODY_1, scalar last, UTC).

    Parameters
    ----------
    path : of the file
    name : OBJECT_NAME
    object_id : OBJECT_ID, the international designator
    epochs : at least two instants
    inertial_from_body : attitudes (time), or one for all epochs

    Other Parameters
    ----------------
    originator : ORIGINATOR in the header
    version : of the AEM format
    created_utc : CREATION_DATE; None for now
    overwrite : replace an existing file

    Returns
    -------
    path of the file

    Raises
    ------
    RecordingError
        if there are fewer than two epochs, they do not ascend, their number differs from that of the attitudes, or the
        file cannot be written
    """
    rows, texts = _canonical_quaternions(epochs, inertial_from_body), format_epochs(epochs)
    old = version == "1.0"
    meta = {
        "OBJECT_NAME": name,
        "OBJECT_ID": object_id,
        "CENTER_NAME": "EARTH",
        "REF_FRAME_A": "GCRF",
        "REF_FRAME_B": "SC_BODY_1",
        **({"ATTITUDE_DIR": "A2B"} if old else {}),
        "TIME_SYSTEM": "UTC",
        "START_TIME": texts[0],
        "STOP_TIME": texts[-1],
        "ATTITUDE_TYPE": "QUATERNION",
        **({"QUATERNION_TYPE": "LAST"} if old else {}),
    }
    lines = (f"{text} " + " ".join(f"{value:.15f}" for value in row) for text, row in zip(texts, rows, strict=True))
    header = make_header(originator, created_utc)
    return write_text(path, format_kvn("AEM", version, header, [(meta, lines)]), overwrite=overwrite)


def write_attitude_csv(path: str | Path, epochs: Epochs, axes_from_body: Rotation, *, overwrite: bool = False) -> Path:
    """Write attitudes as a CSV file (utc, qx, qy, qz, qw) that `AttitudeTable` reads.

    Parameters
    ----------
    path : of the file
    epochs : at least two instants
    axes_from_body : attitudes (time), or one for all epochs
    overwrite : replace an existing file

    Returns
    -------
    path of the file

    Raises
    ------
    RecordingError
        if there are fewer than two epochs, they do not ascend, their number differs from that of the attitudes, or the
        file cannot be written
    """
    rows, texts = _canonical_quaternions(epochs, axes_from_body), format_epochs(epochs)
    lines = [",".join(("utc", *_QUATERNION))]
    lines += [
        ",".join((f"{text}Z", *(f"{value:.15f}" for value in row))) for text, row in zip(texts, rows, strict=True)
    ]
    return write_text(path, "\n".join(lines) + "\n", overwrite=overwrite)


def _canonical_quaternions(epochs: Epochs, rotation: Rotation) -> list[list[float]]:
    quaternion = quaternion_xyzw(rotation)
    rows = np.broadcast_to(quaternion, (len(epochs), 4)) if quaternion.ndim == 1 else quaternion
    if len(rows) != len(epochs) or len(rows) < 2 or not np.all(np.diff(epochs.time_s) >= 1e-9):
        raise RecordingError(
            "epochs: an attitude table needs two or more, at least 1 ns apart and ascending, with one attitude each"
        )
    values: list[list[float]] = rows.tolist()
    return values

"""Bodies, their orientation, lines of sight and the lidar's boresight as CZML documents, for globes such as Cesium.

Positions are in inertial axes, which such globes take for ICRF. Orientations are in Earth-fixed axes, as the format
requires: each rotates body coordinates to Earth-fixed ones (CZML wiki, Orientation). Times are elapsed seconds since
the start.
"""

from __future__ import annotations

import datetime
import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rso_lidar import orbit
from rso_lidar.errors import RecordingError
from rso_lidar.files import write_text
from rso_lidar.orbit import itrs_from_gcrs
from rso_lidar.pose import ROOT, quaternion_xyzw
from rso_lidar.records import Truth

MOST_SAMPLES = 2000
DEGREE = 5  # of the interpolation between positions
COLOURS = ((213, 94, 0), (0, 114, 178), (0, 158, 115), (204, 121, 167), (230, 159, 0))
BEAM, GREY = (255, 122, 24), (160, 164, 172)
UM = 6  # decimal places of metres
NS = 9  # decimal places of seconds
QUATERNION = 12  # decimal places


@dataclass(frozen=True, eq=False)
class CzmlBody:
    """A moving body: `position_m` (time, 3) in GCRS axes, and optionally `itrs_from_body` (time, 4), x, y, z, w."""

    name: str
    position_m: np.ndarray
    itrs_from_body: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class CzmlBeam:
    """A line from the body `of` to a point `tip_m` (time, 3) in GCRS axes, such as the end of the lidar's boresight."""

    name: str
    of: str
    tip_m: np.ndarray


def choose_globe_samples(n: int, most: int = MOST_SAMPLES) -> np.ndarray:
    """Choose the epochs of a run that a document for a browser globe holds, evenly spread, both ends included.

    Parameters
    ----------
    n : number of epochs
    most : greatest number of epochs to choose

    Returns
    -------
    ndarray
        (sample) ascending indices below `n`.

        >>> choose_globe_samples(10, 4)
        array([0, 3, 6, 9])

    Raises
    ------
    RecordingError
        If `most` is below 2.
    """
    if most < 2:
        raise RecordingError(f"czml: {most} samples cannot show motion; give 2 or more")
    return np.unique(np.linspace(0, n - 1, min(n, most)).round().astype(int))


def build_packets(
    title: str,
    time_s: np.ndarray,
    bodies: Sequence[CzmlBody],
    start_utc: str,
    end_utc: str,
    *,
    lines: Sequence[tuple[str, str]] = (),
    beams: Sequence[CzmlBeam] = (),
    most: int = MOST_SAMPLES,
) -> list[dict[str, Any]]:
    """Build the packets of a CZML document: one for the document and one for each body, line and beam.

    Parameters
    ----------
    time_s : times (time) [s since start_utc]
    start_utc, end_utc : start of `time_s`, and time of the last sample, as ISO UTC text
    lines : (name, name) of two bodies that a thin line joins, such as the follower and its target
    beams : lines that end in space
    most : greatest number of samples per body
    """
    time_s = np.asarray(time_s, dtype=float)
    names = [body.name for body in bodies]
    _check_document(time_s, bodies, names, lines, beams)
    chosen = choose_globe_samples(time_s.size, most)
    at_s = time_s[chosen]
    span = f"{start_utc}/{end_utc}"
    document = {
        "id": "document",
        "name": title,
        "version": "1.0",
        "clock": {
            "interval": span,
            "currentTime": start_utc,
            "multiplier": max(1.0, round(float(np.ptp(time_s)) / 60.0)),
            "range": "LOOP_STOP",
            "step": "SYSTEM_CLOCK_MULTIPLIER",
        },
    }
    packets: list[dict[str, Any]] = [document]
    for k, body in enumerate(bodies):
        colour = {"rgba": [*COLOURS[k % len(COLOURS)], 255]}
        packet: dict[str, Any] = {
            "id": body.name,
            "name": body.name,
            "availability": span,
            "position": _position(at_s, body.position_m[chosen], start_utc),
            "point": {
                "pixelSize": 8,
                "color": colour,
                "outlineColor": {"rgba": [255, 255, 255, 255]},
                "outlineWidth": 1,
            },
            "label": {
                "text": body.name,
                "font": "12pt sans-serif",
                "fillColor": colour,
                "horizontalOrigin": "LEFT",
                "pixelOffset": {"cartesian2": [12, -12 - 16 * k]},
            },
            "path": {
                "material": {"solidColor": {"color": colour}},
                "width": 2,
                "leadTime": float(at_s[-1] - at_s[0]),
                "trailTime": float(at_s[-1] - at_s[0]),
                "resolution": max(1.0, round(float(at_s[-1] - at_s[0]) / MOST_SAMPLES, 3)),
            },
        }
        if body.itrs_from_body is not None:
            packet["orientation"] = _orientation(at_s, body.itrs_from_body[chosen], start_utc)
        packets.append(packet)
    packets += [_line(f"{a}-{b}", a, b, span, (*GREY, 160), 1) for a, b in lines]
    for beam in beams:
        tip = f"{beam.name} tip"
        position = _position(at_s, beam.tip_m[chosen], start_utc, degree=1)
        packets.append({"id": tip, "availability": span, "position": position})
        packets.append(_line(beam.name, beam.of, tip, span, (*BEAM, 220), 2))
    return packets


def write_czml(path: str | os.PathLike[str], document: Sequence[dict[str, Any]]) -> Path:
    """Write a CZML file, completely or not at all, and return its path."""
    return write_text(path, json.dumps(document, allow_nan=False, separators=(",", ":")), overwrite=True)


def _check_document(
    time_s: np.ndarray,
    bodies: Sequence[CzmlBody],
    names: list[str],
    lines: Sequence[tuple[str, str]],
    beams: Sequence[CzmlBeam],
) -> None:
    """Raise a `RecordingError` for input that would make an unreadable document."""
    if not bodies or time_s.size < 1:
        raise RecordingError("czml: no body or no instant to write; check the selection")
    if len(set(names)) < len(names):
        raise RecordingError(f"czml: two bodies have the same name ({', '.join(names)}); rename one")
    if np.any(np.diff(time_s) <= 0.0):
        raise RecordingError("czml: the instants do not increase; sort them")
    for what, values in [(body.name, body.position_m) for body in bodies] + [(beam.name, beam.tip_m) for beam in beams]:
        if values.shape != (time_s.size, 3) or not np.all(np.isfinite(values)):
            raise RecordingError(f"czml: {what}: needs a finite position (x, y, z) at each of {time_s.size} instants")
    for body in bodies:
        if body.itrs_from_body is not None and body.itrs_from_body.shape != (time_s.size, 4):
            raise RecordingError(
                f"czml: {body.name}: needs a quaternion (x, y, z, w) at each of {time_s.size} instants"
            )
    for name in {*(name for pair in lines for name in pair), *(beam.of for beam in beams)} - set(names):
        raise RecordingError(f"czml: a line ends at '{name}', which is not a body; known: {', '.join(names)}")


def _samples(at_s: np.ndarray, values: np.ndarray, digits: int) -> list[float]:
    """Return time-tagged samples (time, n) in one row; a single sample is a constant without a time."""
    if at_s.size == 1:
        return [round(float(value), digits) for value in values[0]]
    rows = zip(at_s.tolist(), values.tolist(), strict=True)
    return [number for time_s, row in rows for number in (round(time_s, NS), *(round(value, digits) for value in row))]


def _position(at_s: np.ndarray, position_m: np.ndarray, epoch: str, degree: int = DEGREE) -> dict[str, Any]:
    """Return a position (time, 3) [m] in inertial axes; `epoch` is the ISO 8601 text of the start."""
    return {
        "interpolationAlgorithm": "LAGRANGE" if degree > 1 else "LINEAR",
        "interpolationDegree": min(degree, max(at_s.size - 1, 1)),
        "referenceFrame": "INERTIAL",
        "epoch": epoch,
        "cartesian": _samples(at_s, position_m, UM),
    }


def _orientation(at_s: np.ndarray, quaternion: np.ndarray, epoch: str) -> dict[str, Any]:
    """Return the orientation as quaternions (time, xyzw) whose signs keep neighbours close."""
    flips = np.where(np.sum(quaternion[1:] * quaternion[:-1], axis=-1) < 0.0, -1.0, 1.0)
    smooth = quaternion * np.concatenate([[1.0], np.cumprod(flips)])[:, None]
    return {
        "interpolationAlgorithm": "LINEAR",
        "interpolationDegree": 1,
        "epoch": epoch,
        "unitQuaternion": _samples(at_s, smooth, QUATERNION),
    }


def _line(name: str, a: str, b: str, span: str, rgba: tuple[int, ...], width: int) -> dict[str, Any]:
    """Return a straight line between two bodies, its width in pixels."""
    return {
        "id": name,
        "name": name,
        "availability": span,
        "polyline": {
            "positions": {"references": [f"{_id(a)}#position", f"{_id(b)}#position"]},
            "arcType": "NONE",
            "width": width,
            "material": {"solidColor": {"color": {"rgba": list(rgba)}}},
        },
    }


def _id(name: str) -> str:
    """Return a name as references write it, with a backslash before characters that would end it."""
    return name.replace("\\", "\\\\").replace("#", "\\#").replace(".", "\\.")


def write_globe(
    path: str | os.PathLike[str], title: str, start_utc: datetime.datetime, targets: list[str], place: Truth
) -> Path:
    """Write a CZML file: bodies with their orientation, lines of sight to targets, and the lidar's boresight.

    Parameters
    ----------
    path : of the file; an existing one is replaced
    title : name of the document
    start_utc : start of the run
    targets : names of the targets
    place : truth, batched over epochs; `choose_globe_samples` reduces it to as many as browser globes play smoothly

    Returns
    -------
    Path
        Of the file, which is written completely or not at all.

    Raises
    ------
    RecordingError
        Without a body, or where positions are not finite.
    """
    from scipy.spatial.transform import Rotation

    time_s = place.time_s
    fixed = itrs_from_gcrs(orbit.Epochs(start_utc, time_s))
    bodies = []
    for name, state in place.states.items():
        turned = np.broadcast_to(place.pose(ROOT, name).rotation.as_matrix(), (time_s.size, 3, 3))
        itrs_from_body = np.einsum("kij,kjl->kil", fixed, turned)
        bodies.append(CzmlBody(name, state.position_m, quaternion_xyzw(Rotation.from_matrix(itrs_from_body))))
    beams = []
    if targets:
        nearest = np.min([np.linalg.norm(place.pose("lidar", name).translation, axis=-1) for name in targets], axis=0)
        ahead = np.zeros((time_s.size, 3))
        ahead[:, 2] = nearest
        beams.append(CzmlBeam("boresight", "follower", place.pose(ROOT, "lidar").apply(ahead)))
    ends = orbit.Epochs(start_utc, np.array([0.0, time_s[-1]]))
    start, end = ends.skyfield_time().utc_iso(places=6)
    lines = [("follower", name) for name in targets]
    packets = build_packets(title, time_s, bodies, str(start), str(end), lines=lines, beams=beams)
    return write_czml(path, packets)

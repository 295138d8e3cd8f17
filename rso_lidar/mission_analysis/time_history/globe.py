"""Bodies and lines of sight for a globe, as a CZML document."""

from __future__ import annotations

import datetime
import os
from pathlib import Path

import numpy as np

from rso_lidar import orbit
from rso_lidar.mission_analysis.time_history.czml import CzmlBeam, CzmlBody, build_packets, write_czml
from rso_lidar.orbit import itrs_from_gcrs
from rso_lidar.pose import ROOT, quaternion_xyzw
from rso_lidar.records import Truth


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
    time_s = place.time_s
    fixed = itrs_from_gcrs(orbit.Epochs(start_utc, time_s))
    bodies = []
    for name, state in place.states.items():
        turned = np.broadcast_to(place.pose(ROOT, name).rotation.as_matrix(), (time_s.size, 3, 3))
        itrs_from_body = np.einsum("kij,kjl->kil", fixed, turned)
        bodies.append(CzmlBody(name, state.position_m, _to_quaternion(itrs_from_body)))
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


def _to_quaternion(matrix: np.ndarray) -> np.ndarray:
    from scipy.spatial.transform import Rotation

    return quaternion_xyzw(Rotation.from_matrix(matrix))

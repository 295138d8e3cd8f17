"""Normals of what is in each pixel, from the labels of facets."""

from __future__ import annotations

import numpy as np

from rso_lidar.errors import RecordError, did_you_mean
from rso_lidar.records import CameraLabels, Frame, Labels
from rso_lidar.scenario import Scenario
from rso_lidar.simulation.keypoint_labels import view_from_camera


def find_normals(frame: Frame, scenario: Scenario, camera: str | None = None) -> np.ndarray:
    """Find the normal of the facet that labels each pixel of a frame.

    Parameters
    ----------
    frame : as simulated, or read from a recording
    scenario : of the frame; ``Scenario.loads(frame.source.scenario)`` of a recording
    camera : name of a camera beside the lidar (None: the lidar)

    Returns
    -------
    ndarray
        (row, col, xyz) f4, unit vectors toward the sensor in its axes, NaN for sky. They are those of flat facets, also
        where a part is smooth.

    Raises
    ------
    RecordError
        If there is no such camera, or the recording is older than its labels of facets.
    """
    truth, labels, sight = scenario.apply_light_time(frame.truth), frame.labels, frame.line_of_sight
    of_image: Labels | CameraLabels = labels
    if camera is not None:
        described = {entry.name: entry for entry in scenario.cameras}
        if camera not in described or camera not in frame.camera_labels:
            guess = did_you_mean(camera, frame.camera_labels)
            raise RecordError(f"find_normals: no camera '{camera}' in the frame{guess}; give one of its cameras")
        of_image, sight = frame.camera_labels[camera], described[camera].lens.line_of_sight
        truth = view_from_camera(frame.truth, described[camera], frame.camera[camera])
    if of_image.facet is None:
        raise RecordError(f"find_normals: camera '{camera}' has no labels of facets; simulate the scenario again")
    normals = np.full((*of_image.target.shape, 3), np.nan, np.float32)
    for surface in scenario.surfaces:
        place = np.full(surface.mesh.source_facets, -1)
        place[surface.mesh.source_facet] = np.arange(len(surface.mesh.source_facet))
        rows, cols = np.nonzero(of_image.target == surface.target)
        local = place[of_image.facet[rows, cols]]
        rows, cols, local = rows[local >= 0], cols[local >= 0], local[local >= 0]
        _, turn = truth.poses.place("lidar", surface.name)
        normal = np.einsum("ij,jp->pi", turn, surface.planes[:3, local])
        away = np.einsum("pi,pi->p", normal, sight[rows, cols]) > 0.0
        normals[rows, cols] = np.where(away[:, None], -normal, normal)
    return normals

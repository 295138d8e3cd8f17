"""Visibility of the common part classes of a target: how much of the silhouette of each is not hidden."""

from __future__ import annotations

import numpy as np

from rso_lidar import scene
from rso_lidar.dataset.annotation.frame_labels import number_part_classes
from rso_lidar.kernels import kernel, packed
from rso_lidar.pose import rotate_vectors
from rso_lidar.records import PART_CLASSES, Frame, Rays
from rso_lidar.scenario import Scenario

_CELLS = 96  # along the longer side of the target's image: a silhouette of a thousand cells is known to about 1 %


def measure_part_visibility(frame: Frame, scenario: Scenario, target: int | None) -> np.ndarray:
    """Measure the visibility of each common part class of a target, as BOP defines `visib_fract`.

    The visibility is the visible area of the class in the image over the area of its silhouette alone. Other classes, other
    targets and the edge of the field can hide it; facets of the class itself cannot. The image is sampled on a grid of 96
    cells along the longer side of the target's image. Facets with a corner behind the lidar are left out.

    Parameters
    ----------
    target : number of the target, or None where the frame has none

    Returns
    -------
    (part_class) f4 from 0 to 1, NaN for classes without a silhouette.
    """
    visibility = np.full(len(PART_CLASSES), np.nan, np.float32)
    if target is None:
        return visibility
    class_of = number_part_classes(scenario.source, tuple(PART_CLASSES))[target]
    truth, corners, classes = scenario.apply_light_time(frame.truth), [], []
    for surface in scenario.surfaces_of(target):
        place_m, turn = truth.poses.place("lidar", surface.name)
        seen = rotate_vectors(turn, surface.corners) + place_m
        ahead = seen[..., 2].min(axis=1) > 0.0
        corners.append(seen[ahead, :, :2] / seen[ahead, :, 2:])
        classes.append(class_of[surface.part[ahead]])
    tangents, kind = np.concatenate(corners), np.concatenate(classes)
    if not len(kind):
        return visibility
    low, high = tangents.min(axis=(0, 1)), tangents.max(axis=(0, 1))
    step = float((high - low).max()) / _CELLS
    n_cols, n_rows = (max(int(np.ceil(length / step - 1e-9)), 1) for length in high - low)
    alone = np.zeros((len(PART_CLASSES), n_rows, n_cols), bool)
    mark_silhouettes(packed((tangents - low) / step), packed(kind.astype(np.int64)), alone)
    row, col = (places.ravel() for places in np.indices((n_rows, n_cols)))
    x, y = low[0] + (col + 0.5) * step, low[1] + (row + 0.5) * step
    direction = np.stack([x, y, np.ones(len(x))], axis=1)
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    rays = Rays((n_rows, n_cols), direction, np.arange(len(x)), np.ones(len(x)))
    hits = scene.cast(rays, scenario.surfaces, truth, 1)
    receiver = scenario.instrument.at(frame.time_s).receiver
    image_col, image_row = receiver.image_of(x[hits.ray], y[hits.ray])
    inside = (image_col >= 0.0) & (image_col <= receiver.n_cols) & (image_row >= 0.0) & (image_row <= receiver.n_rows)
    mine = hits.target == target
    met = class_of[hits.part[mine]]
    covered = alone.reshape(len(PART_CLASSES), -1)
    covered[met, hits.ray[mine]] = True  # cells whose centre is on an edge, to rounding
    whole = covered.sum(axis=1)
    free = np.bincount(met[inside[mine]], minlength=len(PART_CLASSES))
    visibility[whole > 0] = free[whole > 0] / whole[whole > 0]
    return visibility


@kernel
def mark_silhouettes(corners: np.ndarray, kind: np.ndarray, covered: np.ndarray) -> None:
    """Mark the cells of an image whose centres are covered by facets, separately for each kind of facet.

    Parameters
    ----------
    corners : (facet, 3, right_down) in cells, 0 at the outer edges of the first cells
    kind : (facet) index of the first axis of `covered`
    covered : (kind, row, col) bool, written in place
    """
    _, n_rows, n_cols = covered.shape
    for k in range(len(kind)):
        ax, ay = corners[k, 0, 0], corners[k, 0, 1]
        bx, by = corners[k, 1, 0], corners[k, 1, 1]
        cx, cy = corners[k, 2, 0], corners[k, 2, 1]
        first_row, last_row = max(int(np.ceil(min(ay, by, cy) - 0.5)), 0), min(int(max(ay, by, cy) - 0.5), n_rows - 1)
        first_col, last_col = max(int(np.ceil(min(ax, bx, cx) - 0.5)), 0), min(int(max(ax, bx, cx) - 0.5), n_cols - 1)
        for row in range(first_row, last_row + 1):
            y = row + 0.5
            for col in range(first_col, last_col + 1):
                x = col + 0.5
                u = (bx - ax) * (y - ay) - (by - ay) * (x - ax)
                v = (cx - bx) * (y - by) - (cy - by) * (x - bx)
                w = (ax - cx) * (y - cy) - (ay - cy) * (x - cx)
                if (u >= 0.0 and v >= 0.0 and w >= 0.0) or (u <= 0.0 and v <= 0.0 and w <= 0.0):
                    covered[kind[k], row, col] = True

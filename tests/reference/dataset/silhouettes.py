"""Silhouettes by barycentric coordinates: the oracle of `rso_lidar.dataset.annotation.part_visibility.mark_silhouettes`."""

import numpy as np


def mark_silhouettes(corners, kind, covered):
    """Mark the cells whose centres are in a triangle: no barycentric coordinate is negative."""
    row, col = np.indices(covered.shape[1:])
    centre = np.stack([col + 0.5, row + 0.5], axis=-1)
    for (a, b, c), one in zip(corners, kind, strict=True):
        matrix = np.column_stack([b - a, c - a])
        if abs(np.linalg.det(matrix)) < 1e-12:
            continue
        v, w = np.linalg.inv(matrix) @ (centre - a).reshape(-1, 2).T
        covered[one] |= ((v >= 0) & (w >= 0) & (v + w <= 1)).reshape(row.shape)

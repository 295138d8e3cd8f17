"""Silhouettes of a target at the attitudes of a run: area, and the largest square inside."""

from __future__ import annotations

import numpy as np

from rso_lidar import sampling, units
from rso_lidar.optics import Laser, Receiver
from rso_lidar.scenario import Scenario, list_run_attitudes, move_target, preview_mission

_MOST_ATTITUDES = 24
_CELLS = 160  # along a side of each silhouette
_AWAY = 200.0  # distance in radii: perspective then changes the silhouette by half a per cent


def cast_silhouettes(scenario: Scenario, number: int) -> tuple[np.ndarray, np.ndarray]:
    """Cast rays at a target to find its silhouettes as the lidar sees them over a run.

    Returns
    -------
    area_m2 : (attitude) area of the silhouette [m²].
    square_m : (attitude) side of the largest square inside the silhouette, its sides along rows and columns [m].
    """
    from scipy.ndimage import distance_transform_cdt

    preview = preview_mission(scenario)
    geometry, surfaces = preview.targets[number], scenario.surfaces_of(number)
    away_m = _AWAY * geometry.radius_m
    fov_deg = 2.04 * float(np.arctan(1.0 / _AWAY)) / units.DEG
    receiver = Receiver(
        fov_deg=fov_deg, f_number=2.8, n_rows=_CELLS, n_cols=_CELLS, rays_per_pixel=1, min_rays_per_target=0
    )
    laser = Laser(divergence_deg=2.0 * fov_deg)
    ahead_m = np.array([0.0, 0.0, away_m])
    areas, squares = [], []
    most = min(_MOST_ATTITUDES, int(np.count_nonzero(geometry.range_m > 0.0)))
    for row, turned in dict(list_run_attitudes(preview, geometry.name, most)).items():
        truth = move_target(scenario, number, preview.truth.at(row), ahead_m, turned)
        hits = sampling.cast_pixels(receiver, laser, surfaces, truth, 1)
        covered = np.zeros((_CELLS + 2, _CELLS + 2), dtype=bool)  # with a border of sky
        covered[1 + hits.pixel // _CELLS, 1 + hits.pixel % _CELLS] = True
        cell_m = away_m * receiver.pixel_tangent
        areas.append(float(hits.weight.sum()) * cell_m**2)
        squares.append(max(2.0 * float(distance_transform_cdt(covered, "chessboard").max()) - 1.0, 0.0) * cell_m)
    return np.array(areas), np.array(squares)

"""Orthographic views of a surface, for pictures, silhouettes and heights."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rso_lidar.scene.surfaces.surface import Surface

_ABOVE_M = 1.0


@dataclass(frozen=True, eq=False)
class Portrait:
    """An orthographic view of a surface: what a grid of parallel rays hits, rows downward and columns rightward.

    `facet` (row, col) is -1 where there is nothing. `cosine` (row, col) is that of the angle between the facet's normal
    and the viewer. A cell is `cell_m` [m] wide.
    """

    facet: np.ndarray
    cosine: np.ndarray
    cell_m: float

    @property
    def covered(self) -> np.ndarray:
        """Silhouette: where the surface is (row, col)."""
        covered: np.ndarray = self.facet >= 0
        return covered

    @property
    def area_m2(self) -> float:
        """Area of the silhouette [m²]."""
        return float(self.covered.sum()) * self.cell_m**2


def viewer_axes(toward: tuple[float, float, float], up: tuple[float, float, float]) -> np.ndarray:
    """Return the unit vectors right, down and ahead (3, xyz) of a viewer, the rows of lidar_from_body of such a lidar.

    Parameters
    ----------
    toward : (xyz) direction from the body to the viewer, in body axes
    up : (xyz) direction that is upward in the view, in body axes; not along `toward`
    """
    ahead = -np.asarray(toward, dtype=float) / np.linalg.norm(toward)
    right = np.cross(ahead, np.asarray(up, dtype=float))
    right /= np.linalg.norm(right)
    return np.array([right, np.cross(ahead, right), ahead])


def render_portrait(
    surface: Surface,
    toward: tuple[float, float, float],
    up: tuple[float, float, float],
    *,
    side_m: float | None = None,
    cells: int = 400,
) -> Portrait:
    """Render an orthographic view of a surface, centred on its bounds.

    Parameters
    ----------
    surface : the surface
    toward : (xyz), direction from the surface to the viewer, in the surface's axes
    up : (xyz), direction that is upward in the picture
    side_m : side of the square picture [m]; None holds the surface from any direction
    cells : number of rows and of columns

    Returns
    -------
    the view, with facet and cosine at each cell.
    """
    right, down, ahead = viewer_axes(toward, up)
    centre, radius = surface.sphere
    side = 2.0 * radius if side_m is None else side_m
    step = (np.arange(cells) + 0.5) / cells - 0.5
    across, along = (grid.ravel() for grid in np.meshgrid(step * side, step * side))  # columns, rows
    start = centre - 1.5 * radius * ahead + across[:, None] * right + along[:, None] * down
    rays = np.broadcast_to(ahead.astype(np.float32), start.shape)
    met = surface.embree.run(start.astype(np.float32), np.ascontiguousarray(rays), query="INTERSECT", output=1)
    facet = np.asarray(met["primID"], dtype=np.int64).reshape(cells, cells)
    normal = np.stack([surface.planes[axis][facet] for axis in range(3)])
    cosine = np.where(facet >= 0, np.abs(np.einsum("i,irc->rc", ahead, normal)), 0.0)
    return Portrait(facet, cosine, side / cells)


def find_top_heights(surface: Surface, x_m: np.ndarray, y_m: np.ndarray) -> np.ndarray:
    """Find the height of the topmost facet over points, in body axes.

    The height is good to some 1e-7 of the surface's size, the precision of float32.

    Parameters
    ----------
    surface : the surface
    x_m, y_m : coordinates of the points [m], which are broadcast

    Returns
    -------
    heights in the shape of the points [m]; NaN where there is no facet.
    """
    x, y = np.broadcast_arrays(np.asarray(x_m, dtype=float), np.asarray(y_m, dtype=float))
    above = float(surface.corners[..., 2].max()) + _ABOVE_M
    start = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, above)]).astype(np.float32)
    down = np.zeros((x.size, 3), np.float32)
    down[:, 2] = -1.0
    met = surface.embree.run(start, down, query="INTERSECT", output=1)
    height = np.where(met["primID"] >= 0, above - met["tfar"].astype(float), np.nan)
    return height.reshape(x.shape)

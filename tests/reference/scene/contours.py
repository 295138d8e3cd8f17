"""Oracle of `rso_lidar.scene.casting.contours`: the edges of a surface, one by one."""

import numpy as np

from rso_lidar.records import Contours

_LEAST_DEPTH_M = 1e-6


def contours(surfaces, truth, least_crease):
    """Return the rims, folds and creases of all surfaces."""
    ends, steps, depths, numbers = [], [], [], []
    for number, surface in enumerate(surfaces):
        translation, matrix = truth.poses.place("lidar", surface.name)
        corners = surface.corners @ np.asarray(matrix).T + translation
        owners = {}
        for facet, triangle in enumerate(corners):
            for i in range(3):
                side = frozenset(surface.corners[facet, j].astype(np.float32).tobytes() for j in (i, (i + 1) % 3))
                owners.setdefault(side, []).append((facet, triangle[i], triangle[(i + 1) % 3], triangle[(i + 2) % 3]))
        for sides in owners.values():
            a, b = sides[0][1:3]
            if max(a[2], b[2]) <= _LEAST_DEPTH_M:
                continue
            of = [_brightness(surface, corners, side[0]) for side in (sides if len(sides) == 2 else sides[:1])]
            step = max(of)
            # The plane through the lidar and the edge has both facets on one side of it: a fold.
            if len(sides) == 2 and np.linalg.det([a, b, sides[0][3]]) * np.linalg.det([a, b, sides[1][3]]) < 0.0:
                step = abs(of[0] - of[1])
                if step < least_crease * max(of):
                    continue
            if step > 0.0:
                ends.append(np.concatenate([_image(a, b), _image(b, a)]))
                steps.append(step)
                depths.append([1.0 / max(point[2], _LEAST_DEPTH_M) for point in (a, b)])
                numbers.append(number)
    per_depth = np.array(depths).reshape(-1, 2)
    return Contours(np.array(ends).reshape(-1, 4), np.array(steps), per_depth, np.array(numbers, np.int16))


def _image(point, other):
    """Return x/z and y/z of one end of an edge, or of where the edge reaches the lidar's plane."""
    if point[2] < _LEAST_DEPTH_M:
        point = other + (other[2] - _LEAST_DEPTH_M) / (other[2] - point[2]) * (point - other)
        return point[:2] / _LEAST_DEPTH_M
    return point[:2] / point[2]


def _brightness(surface, corners, facet):
    """Return ρ cos α / R² of a facet, at its first corner."""
    a, b, c = corners[facet]
    normal = np.cross(b - a, c - a)
    cosine = np.array([abs(normal @ a) / np.linalg.norm(normal) / np.linalg.norm(a)])
    return float(surface.brdf_per_sr(np.array([facet]), cosine)[0] * cosine[0] / (a @ a))

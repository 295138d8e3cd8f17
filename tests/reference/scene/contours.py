"""Oracle of `rso_lidar.scene.casting.contours`: the edges of a surface, one by one."""

import numpy as np

from rso_lidar.records import Contours


def contours(surfaces, truth):
    """Return the rims and folds of all surfaces."""
    ends, steps, numbers = [], [], []
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
            if min(a[2], b[2]) <= 1e-6:
                continue
            image = [point[:2] / point[2] for point in (a, b)]
            along = image[1] - image[0]
            if len(sides) == 2:
                beyond = [side[3][:2] / side[3][2] - image[0] for side in sides]
                if np.prod([along[0] * off[1] - along[1] * off[0] for off in beyond]) < 0.0:
                    continue
            of = [_brightness(surface, corners, side[0]) for side in (sides if len(sides) == 2 else sides[:1])]
            if max(of) > 0.0:
                ends.append(np.concatenate(image))
                steps.append(max(of))
                numbers.append(number)
    return Contours(np.array(ends).reshape(-1, 4), np.array(steps), np.array(numbers, np.int16))


def _brightness(surface, corners, facet):
    """Return ρ cos α / R² of a facet, at its first corner."""
    a, b, c = corners[facet]
    normal = np.cross(b - a, c - a)
    cosine = np.array([abs(normal @ a) / np.linalg.norm(normal) / np.linalg.norm(a)])
    return float(surface.brdf_per_sr(np.array([facet]), cosine)[0] * cosine[0] / (a @ a))

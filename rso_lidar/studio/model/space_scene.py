"""Scenes in space as bytes for a browser: a JSON header, then float32 positions and byte colours, in one message."""

from __future__ import annotations

import json
import struct
from typing import Any

import numpy as np

from rso_lidar.imaging import load_stars
from rso_lidar.picture import (
    LIGHT,
    Scale,
    Scheme,
    colour_maps,
    colour_parts,
    find_part_name,
    find_target_returns,
    palette,
)
from rso_lidar.records import Frame


class SpaceScene:
    """A scene being assembled: points, lines, meshes and labels in one set of axes, with a camera.

    Lines are pairs of positions. A browser keeps its camera while the `name` stays, and else begins with this one.
    """

    def __init__(self, name: str, scheme: Scheme = LIGHT, origin_m: np.ndarray | None = None) -> None:
        """Begin an empty scene, whose origin (xyz) [m] may lie elsewhere in the axes that it is drawn in."""
        self.scheme, self.origin_m = scheme, np.zeros(3) if origin_m is None else np.array(origin_m)
        self.header: dict[str, Any] = {
            "name": name,
            "paper": scheme.paper,
            "ink": scheme.ink,
            "items": [],
            "labels": [],
        }
        self._buffers: list[bytes] = []
        self.look((0.0, -3.0, 1.0))

    def look(self, eye: Any, at: Any = (0.0, 0.0, 0.0), up: Any = (0.0, 0.0, 1.0)) -> None:
        """Place the camera."""
        camera = {"eye": eye, "at": at, "up": up}
        self.header["camera"] = {key: np.asarray(value, float).tolist() for key, value in camera.items()}

    def add(self, kind: str, positions: Any, colour: Any, **more: Any) -> None:
        """Add points, lines (pairs of positions), or points of the sky.

        Parameters
        ----------
        kind : "points", "lines", or "sky" for round points in directions
        positions : (…, xyz)
        colour : one colour, or bytes (…, rgb) for each position
        **more : size of points [pixels], opacity, and whatever else the module of the browser knows
        """
        flat = np.ascontiguousarray(positions, dtype="<f4").reshape(-1, 3)
        item = {"kind": kind, "count": len(flat), **more}
        parts = [flat.tobytes()]
        if isinstance(colour, str):
            item["colour"] = colour
        else:
            rgb = np.ascontiguousarray(colour, np.uint8).tobytes()
            parts.append(rgb + bytes(-len(rgb) % 4))
            item["coloured"] = True
        self.header["items"].append(item)
        self._buffers += parts

    def path(self, points: np.ndarray, colour: str, **more: Any) -> None:
        """Add a line through points (point, xyz).

        Parameters
        ----------
        points, colour, **more : as of `add`
        """
        self.add("lines", np.stack([points[:-1], points[1:]], axis=1), colour, **more)

    def label(self, text: str, at: Any, *, is_sky: bool = False) -> None:
        """Add a word at a position, or in a direction of the sky. Of words that would overlap, the first stays."""
        self.header["labels"].append({"text": text, "at": np.asarray(at, float).tolist(), "sky": is_sky})

    def axes(self, matrix: np.ndarray, length: float, name: str) -> None:
        """Draw labelled axes, red, green and blue.

        Parameters
        ----------
        matrix : (4, 4) pose in the scene's axes
        name : of the axes; "rtn" axes are labelled R, T, N
        """
        letters = ("R radial", "T along-track", "N cross-track") if name == "rtn" else [f"{name} {k}" for k in "xyz"]
        for k, colour in enumerate((self.scheme.lines[5], self.scheme.lines[2], self.scheme.lines[0])):
            end = matrix[:3, 3] + length * matrix[:3, k]
            self.add("lines", [matrix[:3, 3], end], colour)
            self.label(letters[k], end)

    def mark(self, at: np.ndarray, words: str) -> None:
        """Mark the point (xyz) that the user has chosen."""
        self.add("points", [at], self.scheme.mark, size=11, on_top=True)
        self.label(words, at)

    def sky(self, from_inertial: np.ndarray, sun: np.ndarray, sunlit: float = 1.0) -> None:
        """Add the stars, and the Sun with its light.

        Parameters
        ----------
        from_inertial : rotation (3, 3) from inertial axes to the scene's
        sun : unit vector to the Sun (xyz) in inertial axes; NaN for no Sun, and then no stars: the world has no sky
        sunlit : share of the Sun's disc that the targets see
        """
        if not np.isfinite(sun).all():
            return
        stars = load_stars()
        directions, magnitudes = stars.direction, stars.magnitude
        for brightest, faintest, size in ((-2.0, 1.5, 7), (1.5, 3.0, 5), (3.0, 4.5, 3.5)):
            chosen = (magnitudes >= brightest) & (magnitudes < faintest)
            # The eye's response is near logarithmic: a tenth of full brightness for each magnitude.
            grey = np.clip(255.0 * (1.0 - 0.1 * np.maximum(magnitudes[chosen], 0.0)), 0, 255).astype(np.uint8)
            self.add("sky", directions[chosen] @ from_inertial.T, np.repeat(grey[:, None], 3, axis=1), size=size)
        toward = from_inertial @ sun
        self.add("sky", [toward], palette.PARTS[8], size=22)
        self.label("Sun", toward, is_sky=True)
        self.header["sun"], self.header["sunlit"] = toward.tolist(), float(sunlit)

    def earth(self, radius: float, at: Any) -> None:
        """Add the Earth, with a day and a night side."""
        colours = {"day": palette.OKABE_ITO[0], "night": palette.NIGHT}
        item = {"kind": "earth", "radius": radius, "at": np.asarray(at, float).tolist(), **colours}
        self.header["items"].append(item)

    def pack(self) -> bytes:
        """Return the scene: length of the header as uint32, the header, and the buffers of its items in order."""
        header = json.dumps(self.header).encode()
        header += b" " * (-len(header) % 4)
        return struct.pack("<I", len(header)) + header + b"".join(self._buffers)


def draw_cloud(
    frame: Frame, scheme: Scheme = LIGHT, colour: str = "range", axes: str = "lidar", pixel: tuple[int, int] = (-1, -1)
) -> bytes:
    """Draw the point cloud of a frame. The returns are in the order of the rows and columns; false ones are dim.

    Parameters
    ----------
    scheme : `LIGHT` or `DARK`
    pixel : row and column of the return that is marked, if there is one
    """
    scene, valid = SpaceScene(f"cloud {axes}", scheme), frame.valid
    points = frame.points_m[valid]
    if axes in frame.truth.poses and axes != "lidar":
        points = frame.truth.pose(axes, "lidar").apply(points.reshape(-1, 3))
    rgb, legend = _colour_points(frame, colour)
    on = find_target_returns(frame)[valid]
    rgb = np.where(on[:, None], rgb, palette.dim(rgb, scheme.paper))
    seen = points[on] if on.any() else points
    middle = np.median(seen, axis=0) if len(seen) else np.zeros(3)
    size = max(2.0 * float(np.percentile(np.linalg.norm(seen - middle, axis=1), 98)), 0.5) if len(seen) else 1.0
    scene.add("points", points - middle, rgb, size=3, pick=True)
    if pixel >= (0, 0) and valid[pixel]:
        number = int(np.flatnonzero(np.flatnonzero(valid) == pixel[0] * valid.shape[1] + pixel[1])[0])
        scene.mark(points[number] - middle, "row {}, column {}".format(*pixel))
    toward = frame.truth.pose(axes, "lidar") if axes in frame.truth.poses else None
    # The camera looks as the lidar does, from a little to the side, so that depth shows; the image's up is up.
    matrix = np.eye(4) if toward is None else toward.as_matrix()
    scene.look(matrix[:3, :3] @ np.array([-0.5, -0.4, -1.1]) * 1.4 * size, up=-matrix[:3, 1])
    corner = np.eye(4)
    corner[:3, 3] = -0.5 * size
    scene.axes(corner, 0.25 * size, axes)
    scene.header["legend"] = legend
    return scene.pack()


def _colour_points(frame: Frame, colour: str) -> tuple[np.ndarray, dict[str, Any]]:
    """Return the colour of each return (return, rgb), and the legend."""
    valid, scale = frame.valid, Scale.of_frames(frame)
    prediction: Any = frame.kept.get("prediction")
    if colour == "part":
        parts = colour_parts(frame)
        colours = [*palette.PARTS, palette.OTHER_PART, palette.NO_RETURN]
        words = {colours[c]: find_part_name(frame, *kind) for c, kind in zip(parts.colours, parts.kinds, strict=True)}
        words |= {palette.OTHER_PART: "more parts"} if palette.OTHER_PART in words else {}
        rgb = np.array([palette.split_rgb(colour) for colour in colours])[parts.image[valid]]
        return rgb, {"title": "Part", "entries": [*words.items(), (palette.NO_RETURN, "no target")]}
    if colour == "probability" and prediction is not None:
        title, low, high, name = "Probability of detection", "0", "1", colour_maps.AMOUNT_RAMP
        rgb = colour_maps.apply_ramp(prediction.detection_probability[valid].astype(float), name, palette.NO_RETURN)
    elif colour == "intensity":
        (title, low, high), name = scale.intensity_words, colour_maps.INTENSITY_RAMP
        rgb = scale.intensity_rgb(frame.intensity_counts[valid])
    else:
        (title, low, high), name = scale.range_words, colour_maps.RANGE_RAMP
        rgb = scale.range_rgb(frame.range_m[valid], 0.0)
    return rgb, {"title": title, "low": low, "high": high, "ramp": colour_maps.ramp(name)[::15].tolist()}

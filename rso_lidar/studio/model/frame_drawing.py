"""A frame of a recording drawn for a viewer, alone or beside that of another recording."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rso_lidar.errors import RsoLidarError
from rso_lidar.evaluation import compare_frames
from rso_lidar.export import Recording
from rso_lidar.picture import Scheme, choose_camera_window, choose_window, palette
from rso_lidar.records import Frame
from rso_lidar.studio.model.companion_image import describe_point, draw_camera_image
from rso_lidar.studio.model.frame_image import draw_difference, draw_image, mark_pixel
from rso_lidar.track import locate_centroid


@dataclass(frozen=True)
class DrawnFrame:
    """What is shown of a frame: images as PNG by title, marks as SVG over the first, and lines of text.

    `describe_point` tells what is at a point of an image [pixels], by its title; None where the lidar's image is shown.
    """

    images: dict[str, bytes]
    marks: str
    lines: tuple[str, ...]
    describe_point: Callable[[str, float, float], str] | None = None


def draw_recorded_frame(
    k: int, recording: Recording, other: Recording | None, marked: bool, scheme: Scheme, camera: str = ""
) -> DrawnFrame:
    """Read a frame and draw it, with the frame of the other recording that has its number, by scales that span both.

    Parameters
    ----------
    other : a recording to compare with, or None
    scheme : `LIGHT` or `DARK`
    camera : whose image is drawn beside the range; empty for range and intensity of the lidar
    """
    try:
        frame = recording[k]
        lines = [f"Frame {frame.index}, {frame.time_s:,.3f} s, {int(frame.valid.sum()):,} returns."]
        second, marks = None, ""
        if other is not None and (rows := np.flatnonzero(other.frame_index[:] == frame.index)).size:
            second = other[int(rows[0])]
        if camera:
            return _draw_camera(frame, second, camera, scheme, lines)
        if second is not None:
            lines += compare_frames(frame, second).describe().splitlines()
            window = choose_window(frame, second)
            images = {"A": draw_image(frame, scheme, beside=second), "B": draw_image(second, scheme, beside=frame)}
            images["B − A"] = draw_difference(frame, second, scheme)
        else:
            lines += [f"{other.path.name} has no frame {frame.index}."] if other is not None else []
            window, images = choose_window(frame), {"A": draw_image(frame, scheme)}
        if marked:
            for number, (name, (row, col)) in enumerate(locate_centers(frame).items()):
                colour, dash = ((palette.IMAGE_MARK, ""), (palette.OKABE_ITO[4], "6 4"))[name.startswith("centroid")]
                lines.append(f"{name.capitalize()}: row {row}, column {col} ({'dashed, blue' if dash else 'orange'}).")
                for x, y, side in mark_pixel(window, row, col):
                    x, y, r = x + side / 2, y + side / 2, 12 + 4 * number
                    marks += (
                        f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{r}" fill="none" stroke="{colour}" stroke-width="3" '
                        f'stroke-dasharray="{dash}"/>'
                    )
        return DrawnFrame(images, marks, tuple(lines))
    except (RsoLidarError, OSError) as error:
        return DrawnFrame({}, "", (str(error),))


def _draw_camera(frame: Frame, second: Frame | None, camera: str, scheme: Scheme, lines: list[str]) -> DrawnFrame:
    """Draw the images of a camera, of one frame or of two.

    Parameters
    ----------
    second : the frame to compare with, or None
    """
    shown = {"A": frame}
    if second is not None:
        if _find_shapes(second, camera) == _find_shapes(frame, camera):
            shown["B"] = second
        else:
            lines.append(f"The other recording has no image of {camera} of this size.")
    windows = choose_window(*shown.values()), choose_camera_window(camera, *shown.values())
    images = {
        title: draw_camera_image(drawn, camera, scheme, beside=shown["A"] if title == "B" else shown.get("B"))
        for title, drawn in shown.items()
    }

    def describe(title: str, x: float, y: float) -> str:
        """Describe the pixel at a point of an image."""
        return describe_point(shown[title], camera, x, y, *windows)

    return DrawnFrame(images, "", tuple(lines), describe)


def _find_shapes(frame: Frame, camera: str) -> tuple[tuple[int, ...], ...]:
    """Return the shapes of the lidar's image, and of that of a camera, if it has one."""
    image = frame.camera.get(camera)
    return frame.valid.shape, () if image is None else image.intensity_counts.shape


def locate_centers(frame: Frame) -> dict[str, tuple[int, int]]:
    """Return the pixel (row, col) of the true origin of each target, and of the centroid of the measured points.

    What is outside the field is left out.
    """
    places_m = {
        f"truth of {target.name}": frame.truth.pose("lidar", target.name).translation for target in frame.source.targets
    }
    sight = frame.line_of_sight
    pixel_rad = float(np.linalg.norm(sight[0, 0] - sight[0, 1]))
    fix = locate_centroid(frame.points_m, pixel_rad=pixel_rad)
    if fix is not None:
        places_m["centroid of the points"] = fix.position_m
    centers = {}
    for name, place_m in places_m.items():
        cosine = sight.reshape(-1, 3) @ (place_m / max(float(np.linalg.norm(place_m)), 1e-9))
        nearest = int(cosine.argmax())
        if cosine[nearest] > np.cos(pixel_rad):
            row, col = divmod(nearest, sight.shape[1])
            centers[name] = (row, col)
    return centers

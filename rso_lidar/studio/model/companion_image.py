"""Images of cameras beside the lidar as PNG, each beside the range of the lidar, and the words for a point of them."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np

from rso_lidar.export import list_cameras
from rso_lidar.picture import (
    LIGHT,
    Scale,
    Scheme,
    Stretch,
    Window,
    choose_camera_window,
    choose_window,
    colour_maps,
    palette,
)
from rso_lidar.records import Frame
from rso_lidar.studio.model.frame_image import (
    Panel,
    draw_panels,
    draw_range_panel,
    find_pixel_of_panel,
    measure_width_m,
)


@lru_cache(maxsize=8)
def list_bands(scenario: str) -> dict[str, tuple[str, ...]]:
    """List the bands of each camera of a resolved scenario, by the name of the camera."""
    cameras = list_cameras(Path("camera"), scenario)
    return {camera.name: tuple(str(band["name"]) for band in camera.bands) for camera in cameras}


def draw_camera_image(
    frame: Frame,
    camera: str,
    scheme: Scheme = LIGHT,
    *,
    band: str = "",
    whole: bool = False,
    beside: Frame | None = None,
) -> bytes:
    """Draw the image of a camera, beside the range that the lidar measured with the same flash, as PNG.

    Parameters
    ----------
    scheme : `LIGHT` or `DARK`
    band : name of the one that is shown in grey; empty for the colours of three bands, or else the first
    whole : whether the whole fields are shown, and not the parts about the targets
    beside : a frame to compare with; the parts of the fields and the colours span both, whichever is drawn
    """
    spanned = (frame,) if beside is None else (frame, beside)
    bands, image = list_bands(frame.source.scenario)[camera], frame.camera[camera]
    stretch = Stretch.of(camera, *spanned)
    rgb = stretch.paint(image.intensity_counts, bands.index(band) if band in bands else None)
    shown = band if band in bands else ", ".join(bands) if len(bands) == 3 else bands[0]
    note = f"exposure {1e3 * float(image.exposure_s):,.3g} ms"
    window, of_camera = choose_window(*spanned, whole=whole), choose_camera_window(camera, *spanned, whole=whole)
    of_image = Panel(
        f"{camera}: {shown}", note, colour_maps.IMAGE_RAMP, rgb, palette.NO_LIGHT, stretch.words, of_camera
    )
    of_range = draw_range_panel(frame, window, Scale.of_frames(*spanned))
    return draw_panels((of_image, of_range), measure_width_m(frame, window), scheme)


def describe_point(frame: Frame, camera: str, x: float, y: float, window: Window, of_camera: Window) -> str:
    """Describe the pixel at a point of an image: what was measured there, and which target and part are there.

    Parameters
    ----------
    x, y : point [pixels of the image], right and down
    window, of_camera : the parts of the lidar's field and of the camera's that are shown

    Returns
    -------
    str
        Empty beside the panels.
    """
    if pixel := find_pixel_of_panel(of_camera, x, y, 0):
        labels, counts = frame.camera_labels[camera], frame.camera[camera].intensity_counts[pixel].tolist()
        bands = list_bands(frame.source.scenario)[camera]
        said = ", ".join(f"{name} {value:,}" for name, value in zip(bands, counts, strict=True))
        thing = _name_part(frame, int(labels.target[pixel]), int(labels.part[pixel]))
        away = f", {float(labels.range_m[pixel]):,.2f} m away" if np.isfinite(labels.range_m[pixel]) else ""
        return f"{camera}, row {pixel[0]}, column {pixel[1]}: {said} counts; {thing}{away}"
    if pixel := find_pixel_of_panel(window, x, y, 1):
        range_m, thing = frame.range_m[pixel], _name_part(frame, *(int(k[pixel]) for k in _list_labels(frame)))
        measured = (
            f"{float(range_m):,.2f} m, {int(frame.intensity_counts[pixel]):,} counts"
            if np.isfinite(range_m)
            else "no return"
        )
        return f"lidar, row {pixel[0]}, column {pixel[1]}: {measured}; {thing}"
    return ""


def _list_labels(frame: Frame) -> tuple[np.ndarray, np.ndarray]:
    return frame.labels.target, frame.labels.part


def _name_part(frame: Frame, target: int, part: int) -> str:
    """Return the names of a target and its part; "sky" for none."""
    if target < 0:
        return "sky"
    entry = frame.source.targets[target]
    return f"{entry.name}, {entry.parts[part]}" if 0 <= part < len(entry.parts) else entry.name

"""Animations: a sequence of frames as a GIF, or as an MP4 where the extra is installed."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rso_lidar.errors import RecordingError
from rso_lidar.files import check_writable, write_atomically
from rso_lidar.picture.frames.raster import GAP, draw_legend, draw_pair, draw_panel, draw_text, shorten
from rso_lidar.picture.selection.scale import Scale
from rso_lidar.picture.selection.sequence import Thumbnail, even_indices, pick
from rso_lidar.picture.selection.stretch import Stretch
from rso_lidar.picture.selection.window import Window, bounding_window, crop
from rso_lidar.picture.style.colour_maps import RAMP_COLOURS, fixed_palette
from rso_lidar.picture.style.palette import LIGHT, NO_LIGHT, Scheme
from rso_lidar.records import Frame

if TYPE_CHECKING:
    from PIL.Image import Image

ANIMATION_SUFFIXES = (".gif", ".mp4")
SIDE = 384  # pixels of one panel
MARGIN = 16
HEAD = 42
CAPTION = 34
TIMELINE = 58
FOOT = 30
WIDTH = 2 * MARGIN + 2 * SIDE + GAP
HEIGHT = HEAD + SIDE + CAPTION + TIMELINE + FOOT  # even, as MP4 needs both
_SAMPLED = 8  # frames that the colours of a GIF are taken from
SHOWN_S = 10.0  # length of an animation without a rate, about
FASTEST_HZ = 50.0  # GIF counts hundredths of a second, and players slow down delays under two


def animate(
    frames: Iterable[Frame],
    path: str | Path,
    max_frames: int = 120,
    frame_rate_hz: float | None = None,
    scheme: Scheme = LIGHT,
) -> Path:
    """Draw an animation of at most `max_frames` frames, evenly chosen; GIF or MP4 by the suffix.

    Colour limits are the same for the whole sequence. Images of cameras beside the lidar stand at the right, each stretched
    by itself, because the exposure may change. A GIF counts its delays in hundredths of a second.

    Parameters
    ----------
    frames : a sequence, a recording or an iterator
    path : of the file
    max_frames : most frames drawn
    frame_rate_hz : rate of playing, at most 50 Hz (None: 4 to 20 Hz, for a length of about ten seconds)
    scheme : `LIGHT` or `DARK`

    Returns
    -------
    The path of the file.

    Raises
    ------
    RecordingError : if there are no frames, the rate is out of bounds, or MP4 is wanted and its extra is not installed.
    """
    place = check_writable(path, ANIMATION_SUFFIXES, overwrite=True)
    if frame_rate_hz is not None and not 0 < frame_rate_hz <= FASTEST_HZ:
        raise RecordingError(
            f"{place}: frame rate of {frame_rate_hz:g} Hz; choose a rate above 0 and up to {FASTEST_HZ:g} Hz"
        )
    ffmpeg = _import_ffmpeg(place) if place.suffix.lower() == ".mp4" else None
    draw_cameras = _CameraPanels()
    scenes, _ = pick(frames, max_frames, lambda frame: (Thumbnail.of(frame), draw_cameras(frame)))
    thumbnails = [thumbnail for thumbnail, _ in scenes]
    panels = [panel for _, panel in scenes]
    rate_hz = frame_rate_hz or min(max(len(thumbnails) / SHOWN_S, 4.0), 20.0)
    with write_atomically(place) as draft:
        if ffmpeg is None:
            _write_gif(draft, _draw_all(thumbnails, panels, scheme), rate_hz, _choose_palette(panels, scheme))
        else:
            _write_mp4(ffmpeg, draft, _draw_all(thumbnails, panels, scheme), rate_hz, _measure_width(panels))
    return place


class _CameraPanels:
    """Panels of the cameras of successive frames; the part of a field that is shown changes seldom."""

    def __init__(self) -> None:
        self._windows: dict[str, Window] = {}

    def __call__(self, frame: Frame) -> dict[str, np.ndarray]:
        """Return the panel (row, col, rgb) of each camera of a frame, by name."""
        panels = {}
        for name, image in frame.camera.items():
            mask = np.asarray(frame.camera_labels[name].filled_fraction) > 0.0
            window = self._windows[name] = crop(bounding_window(mask), self._windows.get(name))
            rgb = window.cut(Stretch.of(name, frame).paint(image.intensity_counts))
            panels[name] = np.asarray(draw_panel(rgb, SIDE, NO_LIGHT))
        return panels


def _measure_width(panels: Sequence[Mapping[str, np.ndarray]]) -> int:
    """Return the width of the page [pixels]: the lidar's two panels, and one for each camera."""
    return WIDTH + len(panels[0]) * (SIDE + GAP)


def _draw_all(
    thumbnails: Sequence[Thumbnail], panels: Sequence[Mapping[str, np.ndarray]], scheme: Scheme
) -> Iterator[Image]:
    """Yield one picture for each thumbnail and its panels of cameras."""
    from PIL import Image, ImageDraw

    scale = Scale.of(thumbnails)
    page = Image.new("RGB", (_measure_width(panels), HEIGHT), scheme.paper)
    draw = ImageDraw.Draw(page)
    inner = WIDTH - 2 * MARGIN
    draw_text(draw, MARGIN, 12, shorten(draw, thumbnails[0].title, 17, inner, bold=True), 17, scheme.ink, bold=True)
    draw_legend(draw, MARGIN, HEIGHT - FOOT + 6, scale, inner, 12, scheme)
    plot = _draw_timeline(page, thumbnails, scheme)
    window: Window | None = None
    for k, thumbnail in enumerate(thumbnails):
        window = crop(thumbnail.bounds, window)
        picture = _draw_one(page.copy(), thumbnail, scale, window, plot[k], scheme)
        for number, name in enumerate(panels[0]):
            if name in panels[k]:
                left = WIDTH - MARGIN + GAP + number * (SIDE + GAP)
                picture.paste(Image.fromarray(panels[k][name]), (left, HEAD))
                draw_text(ImageDraw.Draw(picture), left + 12, HEAD + SIDE + 10, f"camera {name}", 12, scheme.quiet)
        yield picture


def _draw_one(
    page: Image, thumbnail: Thumbnail, scale: Scale, window: Window, now: tuple[float, float], scheme: Scheme
) -> Image:
    """Draw one frame on a copy of the page.

    Parameters
    ----------
    now : where on the line of range over time the frame is
    """
    from PIL import ImageDraw

    draw = ImageDraw.Draw(page)
    page.paste(draw_pair(thumbnail, scale, window, SIDE, scheme), (MARGIN, HEAD))
    y = HEAD + SIDE + 8
    seen = math.isfinite(thumbnail.median_m)
    said = f"{thumbnail.median_m:,.1f} m" if seen else f"{thumbnail.true_range_m:,.1f} m (truth)"
    draw_text(draw, MARGIN, y, said, 18, scheme.ink, bold=True)
    field = f"whole field, {window.size_text}" if window.whole else f"crop {window.size_text}"
    draw_text(draw, MARGIN + SIDE + GAP, y + 4, f"{thumbnail.returns:,} returns   ·   {field}", 12, scheme.quiet)
    draw_text(draw, WIDTH - MARGIN, y + 2, f"{thumbnail.time_s:,.1f} s", 15, scheme.ink, anchor="ra")
    across, down = now
    draw.line((across, HEAD + SIDE + CAPTION + 2, across, HEAD + SIDE + CAPTION + TIMELINE - 8), fill=scheme.rule)
    draw.ellipse((across - 4, down - 4, across + 4, down + 4), fill=scheme.mark)
    return page


def _draw_timeline(page: Image, thumbnails: Sequence[Thumbnail], scheme: Scheme) -> list[tuple[float, float]]:
    """Draw the line of range over time, and return the position of each thumbnail on it [pixels]."""
    from PIL import ImageDraw

    draw = ImageDraw.Draw(page)
    times_s = np.array([thumbnail.time_s for thumbnail in thumbnails])
    ranges_m = np.array([g.true_range_m if math.isfinite(g.true_range_m) else g.median_m for g in thumbnails])
    known = np.isfinite(ranges_m)
    low_m, high_m = (float(ranges_m[known].min()), float(ranges_m[known].max())) if known.any() else (0.0, 0.0)
    top, bottom = HEAD + SIDE + CAPTION + 6, HEAD + SIDE + CAPTION + TIMELINE - 12
    left, right = MARGIN + 76, WIDTH - MARGIN - 6
    draw_text(draw, left - 8, top, f"{high_m:,.0f} m", 12, scheme.quiet, anchor="rm")
    draw_text(draw, left - 8, bottom, f"{low_m:,.0f} m", 12, scheme.quiet, anchor="rm")
    share_x = (times_s - times_s[0]) / max(float(np.ptp(times_s)), 1e-12)
    share_y = (np.where(known, ranges_m, low_m) - low_m) / max(high_m - low_m, 1e-12)
    points = [
        (left + (right - left) * float(x), bottom - (bottom - top) * float(y))
        for x, y in zip(share_x, share_y, strict=True)
    ]
    if len(points) > 1:
        draw.line(points, fill=scheme.quiet, width=2, joint="curve")
    return points


def _choose_palette(panels: Sequence[Mapping[str, np.ndarray]], scheme: Scheme) -> Sequence[int]:
    """Choose the 256 colours of a GIF, flat: those of all animations; colour cameras take every second step of the ramps."""
    from PIL import Image

    fixed = np.reshape(fixed_palette(scheme), (-1, 3))
    seen = [panel[::8, ::8] for k in even_indices(len(panels), _SAMPLED) for panel in panels[k].values()]
    if not any(np.ptp(panel.astype(int), axis=2).any() for panel in seen):
        return fixed_palette(scheme)
    ramps, roles = fixed[:RAMP_COLOURS], fixed[RAMP_COLOURS:]
    kept = [*ramps[::2], *roles]
    montage = Image.fromarray(np.concatenate(seen, axis=1)).quantize(256 - len(kept))
    of_cameras = np.reshape(montage.getpalette() or (), (-1, 3))[: 256 - len(kept)]
    return [int(value) for colour in [*kept, *of_cameras] for value in colour]


def _write_gif(draft: Path, pictures: Iterator[Image], rate_hz: float, colours: Sequence[int]) -> None:
    """Write pictures as a GIF.

    Parameters
    ----------
    rate_hz : pictures per second of playback; GIF rounds their duration to 10 ms
    colours : (768) red, green and blue of the palette, 0 to 255
    """
    from PIL import Image

    palette = Image.new("P", (1, 1))
    palette.putpalette(list(colours))
    drawn = (picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures)
    delay_ms = max(round(100.0 / rate_hz), 2) * 10
    next(drawn).save(draft, save_all=True, append_images=drawn, duration=delay_ms, loop=0, optimize=False)


def _import_ffmpeg(place: Path):  # type: ignore[no-untyped-def]
    """Import the module that writes MP4, which is an extra."""
    try:
        import imageio_ffmpeg
    except ImportError:
        raise RecordingError(
            f"{place}: MP4 needs an extra: pip install rso-lidar[mp4], or choose a name that ends in .gif"
        ) from None
    return imageio_ffmpeg


def _write_mp4(ffmpeg, draft: Path, pictures: Iterator[Image], rate_hz: float, width: int) -> None:  # type: ignore[no-untyped-def]
    """Write pictures as an MP4."""
    writer = ffmpeg.write_frames(str(draft), (width, HEIGHT), fps=rate_hz, quality=8, macro_block_size=2)
    writer.send(None)
    try:
        for picture in pictures:
            writer.send(np.ascontiguousarray(np.asarray(picture)))
    finally:
        writer.close()

"""Contact sheets: a sequence of frames on one page."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from rso_lidar.errors import RecordingError
from rso_lidar.files import check_writable, write_atomically
from rso_lidar.picture.frames.raster import GAP, draw_legend, draw_pair, draw_text, shorten
from rso_lidar.picture.selection.scale import Scale
from rso_lidar.picture.selection.sequence import Thumbnail, find_target_returns, pick
from rso_lidar.picture.selection.window import Window, crop
from rso_lidar.picture.style.palette import LIGHT, Scheme
from rso_lidar.records import Frame

SIDE = 192  # pixels of one panel
CAPTION = 40  # pixels under a cell
MARGIN = 24
SPACE = 22  # between cells
HEAD = 62
FOOT = 30


def contact_sheet(
    frames: Iterable[Frame], path: str | Path, columns: int = 4, rows: int = 4, scheme: Scheme = LIGHT
) -> Path:
    """Draw a sheet of at most `columns` x `rows` frames, evenly chosen, and write it as PNG.

    A cell shows range and intensity of a square around the target's returns, or of the whole field without a target. A
    locator marks the square in the field. All cells share the scales below them. If the range changes much more over the
    sequence than within a frame, colour is range minus the cell's median, and the absolute range is below the cell.

    Parameters
    ----------
    frames : a sequence, a recording or an iterator
    path : of the PNG
    columns, rows : most cells across and down
    scheme : `LIGHT` or `DARK`

    Returns
    -------
    The path of the file.

    Raises
    ------
    RecordingError : if there are no frames, or less than one column or row is wanted.
    """
    from PIL import Image, ImageDraw

    place = check_writable(path, (".png",), overwrite=True)
    if columns < 1 or rows < 1:
        raise RecordingError(f"a contact sheet of {columns} columns and {rows} rows; give 1 or more of each")
    thumbnails, total = pick(frames, columns * rows, _look)
    columns = min(columns, len(thumbnails))
    rows = -(-len(thumbnails) // columns)
    scale = Scale.of(thumbnails)
    cell_width = 2 * SIDE + GAP
    width = max(2 * MARGIN + columns * cell_width + (columns - 1) * SPACE, 2 * MARGIN + 860)
    height = HEAD + rows * (SIDE + CAPTION) + (rows - 1) * (SPACE // 2) + FOOT + MARGIN
    page = Image.new("RGB", (width, height), scheme.paper)
    draw = ImageDraw.Draw(page)
    first, last = thumbnails[0], thumbnails[-1]
    inner = width - 2 * MARGIN
    draw_text(draw, MARGIN, 14, shorten(draw, first.title, 20, inner, bold=True), 20, scheme.ink, bold=True)
    count = f"{len(thumbnails)} of {total} frames" if len(thumbnails) < total else f"{total} frame{'s' * (total != 1)}"
    span = (
        f"{count}, {first.time_s:,.1f} s to {last.time_s:,.1f} s after {first.start_utc}; left range, right intensity"
    )
    draw_text(draw, MARGIN, 40, shorten(draw, span, 12, inner), 12, scheme.quiet)
    for k, thumbnail in enumerate(thumbnails):
        x = MARGIN + (k % columns) * (cell_width + SPACE)
        y = HEAD + (k // columns) * (SIDE + CAPTION + SPACE // 2)
        window = crop(thumbnail.bounds)
        page.paste(draw_pair(thumbnail, scale, window, SIDE, scheme), (x, y))
        seen = thumbnail.median_m == thumbnail.median_m
        range_m = thumbnail.median_m if seen else thumbnail.true_range_m
        said = f"{range_m:,.1f} m" + ("" if seen else " (truth)") if math.isfinite(range_m) else "no target"
        draw_text(draw, x, y + SIDE + 5, said, 14, scheme.ink, bold=True)
        draw_text(draw, x + cell_width, y + SIDE + 6, f"{thumbnail.time_s:,.1f} s", 13, scheme.ink, anchor="ra")
        draw_text(draw, x, y + SIDE + 23, f"{thumbnail.returns:,} returns", 12, scheme.quiet)
        field = f"whole field, {window.size_text}" if window.whole else f"crop {window.size_text}"
        draw_text(draw, x + cell_width, y + SIDE + 23, field, 12, scheme.quiet, anchor="ra")
    draw_legend(draw, MARGIN, height - FOOT - 4, scale, inner, scheme=scheme)
    with write_atomically(place) as draft:
        page.save(draft, optimize=True)
    return place


def _look(frame: Frame) -> Thumbnail:
    """Return the thumbnail of a frame; its bounds are the whole field if it holds stray returns only."""
    thumbnail = Thumbnail.of(frame)
    if (frame.labels.target >= 0).any() or find_target_returns(frame).any():
        return thumbnail
    n_rows, n_cols = frame.valid.shape
    return replace(thumbnail, bounds=Window(0, n_rows, 0, n_cols, n_rows, n_cols))

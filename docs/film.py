"""Draw the film of an approach: ``python docs/film.py`` writes docs/pictures/approach.gif, in about half a minute.

It flies the first example from 1.8 km to 300 m. The satellite turns more slowly and keeps its own materials. Range,
intensity and the cloud of points are drawn side by side. Each picture is nearer than the one before by the same factor, so
that the satellite grows evenly. The same versions of the libraries write the same bytes. A path on the command line is
written instead.
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib
import numpy as np
from PIL import Image, ImageDraw, ImageFont

import rso_lidar as rl
from rso_lidar.mission_analysis import fly_open_loop
from rso_lidar.picture import colour_maps, palette

PLACE = Path(__file__).resolve().parent / "pictures" / "approach.gif"
EXAMPLE = Path(__file__).resolve().parents[1] / "examples" / "tdrs_approach.toml"
SLOWER = (
    "target.0.attitude.rate_deg_s=0.1",
)  # of 0.5: the satellite then turns by a few degrees from picture to picture

FAR_M, NEAR_M, PICTURES = 1800.0, 306.0, 100
DELAY_MS, LAST_MS = 120, 2500
SIDE, GAP, MARGIN, HEAD, FOOT = 256, 8, 8, 30, 46
WIDTH, HEIGHT = 2 * MARGIN + 3 * SIDE + 2 * GAP, HEAD + SIDE + FOOT

HALF_DEPTH_M = 6.0  # the ramp of range spans so much before and behind the satellite's centre
WINDOW_M = 25.0  # points farther than this from the centre are false alarms, and not drawn in the cloud
HALF_VIEW_M = 11.5  # the cloud's panel shows so much to each side; the satellite is 21 m long
SWING_DEG, TILT_DEG = 50.0, 15.0  # the cloud is seen from the side, and from above

CARD: palette.Rgb = (16, 19, 26)  # near black, so that the film looks the same on light and on dark pages
SKY: palette.Rgb = (34, 38, 48)
TEXT: palette.Rgb = (232, 235, 240)
FAINT: palette.Rgb = (150, 157, 168)
COLOURS = np.vstack(
    [colour_maps.ramp(colour_maps.RANGE_RAMP)[24::2], np.repeat(np.arange(0, 256, 2)[:, None], 3, axis=1)]
)[:244]


def find_frames(scenario: rl.Scenario) -> list[int]:
    """Find the frames whose true ranges fall by an equal factor."""
    truth, _ = fly_open_loop(scenario, drive=False)
    range_m = np.linalg.norm(truth.pose("lidar", "tdrs").translation, axis=-1)
    wanted_m = np.geomspace(FAR_M, NEAR_M, PICTURES)
    return sorted({int(k) for k in np.abs(range_m[None] - wanted_m[:, None]).argmin(axis=1)})


def draw_range(depth_m: np.ndarray) -> np.ndarray:
    """Return the colours (…, rgb) of depths [m] about the centre of the satellite; NaN has the colour of the sky."""
    colours = colour_maps.ramp(colour_maps.RANGE_RAMP)[24:]
    step = np.clip((depth_m / HALF_DEPTH_M + 1.0) / 2.0, 0.0, 1.0) * (len(colours) - 1)
    return np.where(np.isfinite(depth_m)[..., None], colours[np.nan_to_num(step).astype(int)], SKY).astype(np.uint8)


def draw_intensity(counts: np.ndarray, most: float) -> np.ndarray:
    """Return the greys (…, rgb) of intensities [counts], logarithmic up to `most`; no return is black."""
    share = np.log(np.maximum(counts, 1)) / np.log(most)
    grey = colour_maps.ramp(colour_maps.INTENSITY_RAMP)[np.clip(share * 255, 0, 255).astype(int)]
    return np.where((counts > 0)[..., None], grey, 0).astype(np.uint8)


def draw_cloud(points_m: np.ndarray, depth_m: np.ndarray, pixel_m: float, swing_deg: float) -> np.ndarray:
    """Return a picture (SIDE, SIDE, rgb) of points [m] about the satellite's centre, seen from the side.

    Parameters
    ----------
    points_m : (n, 3) in lidar axes, from the centre.
    depth_m : (n) by which they are coloured.
    pixel_m : side of a pixel of the lidar at the satellite; dots are about half as wide.
    swing_deg : direction of the view about the vertical, from the lidar's.
    """
    swing, tilt = swing_deg * rl.units.DEG, TILT_DEG * rl.units.DEG
    x, y, z = points_m.T
    across, ahead = np.cos(swing) * x + np.sin(swing) * z, np.cos(swing) * z - np.sin(swing) * x
    down, behind = np.cos(tilt) * y - np.sin(tilt) * -ahead, np.cos(tilt) * ahead - np.sin(tilt) * y
    scale = SIDE / (2.0 * HALF_VIEW_M)
    dot = int(np.clip(round(0.5 * pixel_m * scale), 2, 6))
    picture = np.full((SIDE, SIDE, 3), CARD, np.uint8)
    order = np.argsort(-behind)  # from back to front
    col, row = (np.rint(SIDE / 2 + scale * v[order] - dot / 2).astype(int) for v in (across, down))
    colour = draw_range(depth_m[order])
    for left, top, dye in zip(col, row, colour, strict=True):
        if 0 <= left <= SIDE - dot and 0 <= top <= SIDE - dot:
            picture[top : top + dot, left : left + dot] = dye
    return picture


def draw_picture(frame: rl.Frame, share: float, most: float, start_s: float) -> Image.Image:
    """Draw one picture of the film.

    Parameters
    ----------
    frame : the frame of the lidar.
    share : 0 for the first, 1 for the last.
    most : brightest intensity [counts].
    start_s : time of the first frame [s].
    """
    center_m = frame.truth.pose("lidar", "tdrs").translation
    range_m = float(np.linalg.norm(center_m))
    depth_m = frame.range_m - range_m
    near = np.isfinite(depth_m) & (np.abs(np.nan_to_num(depth_m)) < WINDOW_M)
    ifov_rad = 2.5 * rl.units.DEG / frame.range_m.shape[1]
    swing_deg = SWING_DEG * np.sin(2.0 * np.pi * share * 1.1)
    cloud = draw_cloud(frame.points_m[near] - center_m, depth_m[near], ifov_rad * range_m, swing_deg)
    twice = [np.repeat(np.repeat(p, 2, axis=0), 2, axis=1)
             for p in (draw_range(depth_m), draw_intensity(frame.intensity_counts, most))]  # fmt: skip
    page = Image.new("RGB", (WIDTH, HEIGHT), CARD)
    draw = ImageDraw.Draw(page)
    heads = ("range", "intensity", "points, from the side")
    for k, (panel, head) in enumerate(zip((*twice, cloud), heads, strict=True)):
        left = MARGIN + k * (SIDE + GAP)
        page.paste(Image.fromarray(panel), (left, HEAD))
        draw.text((left + 1, HEAD - 8), head, FAINT, load_font(13), "ls")
    foot = HEAD + SIDE + 30
    draw.text((MARGIN, foot), f"{range_m:,.0f} m", TEXT, load_font(22, bold=True), "ls")
    minutes, seconds = divmod(round(frame.time_s - start_s), 60)
    draw.text((MARGIN + 118, foot), f"{minutes:d} min {seconds:02d} s", FAINT, load_font(15), "ls")
    draw.text((MARGIN + SIDE + GAP, foot), f"{int(near.sum()):,} points", TEXT, load_font(15), "ls")
    draw_scale(page, draw, MARGIN + 2 * (SIDE + GAP), foot - 12)
    return page


def draw_scale(page: Image.Image, draw: ImageDraw.ImageDraw, left: int, top: int) -> None:
    """Draw the ramp of range with its ends in metres.

    Parameters
    ----------
    page, draw : the canvas.
    left, top : where [pixels].
    """
    bar = draw_range(np.linspace(-HALF_DEPTH_M, HALF_DEPTH_M, 96))[None]
    draw.text((left, top + 11), f"−{HALF_DEPTH_M:g} m", FAINT, load_font(12), "ls")
    page.paste(Image.fromarray(np.repeat(bar, 10, axis=0)), (left + 38, top + 2))
    draw.text((left + 140, top + 11), f"+{HALF_DEPTH_M:g} m, along range", FAINT, load_font(12), "ls")


def load_font(size: int, bold: bool = False) -> ImageFont.FreeTypeFont:
    """Load DejaVu Sans, which matplotlib ships, at `size` [pixels]."""
    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    return ImageFont.truetype(Path(matplotlib.get_data_path()) / "fonts" / "ttf" / name, size)


def write_film(place: Path) -> Path:
    """Fly the approach and write the film.

    Parameters
    ----------
    place : path of the GIF; an existing one is replaced.
    """
    scenario = rl.Scenario.load(EXAMPLE, SLOWER)
    satellite = scenario.target[0].replace(material=None)  # its own materials: bright foil, dark cells
    scenario = scenario.replace(target=(satellite,))
    flown = list(rl.simulate(scenario, frames=find_frames(scenario)))
    most = max(float(np.percentile(frame.intensity_counts[frame.valid], 99)) for frame in flown)
    shares = np.linspace(0.0, 1.0, len(flown))
    drawn = [draw_picture(frame, share, most, flown[0].time_s) for frame, share in zip(flown, shares, strict=True)]
    indexed_palette = Image.new("P", (1, 1))
    fixed = [*COLOURS.tolist(), CARD, SKY, TEXT, FAINT]
    fixed += [CARD] * (256 - len(fixed))
    indexed_palette.putpalette([int(v) for colour in fixed for v in colour])
    indexed = [picture.quantize(palette=indexed_palette, dither=Image.Dither.NONE) for picture in drawn]
    delays = [DELAY_MS] * (len(indexed) - 1) + [LAST_MS]
    indexed[0].save(place, save_all=True, append_images=indexed[1:], duration=delays, loop=0, optimize=False)
    return place


if __name__ == "__main__":
    written = write_film(Path(sys.argv[1]) if len(sys.argv) > 1 else PLACE)
    print(f"{written} ({written.stat().st_size / 1e6:.2f} MB)")

"""Records and tables drawn: frames, contact sheets, animations, orbits and curves.

Every figure is a plain `matplotlib.figure.Figure` on an Agg canvas: pyplot and its global state are never touched.
"""

from typing import TYPE_CHECKING

from rso_lidar.public_names import export_lazily, limit_dir

if TYPE_CHECKING:
    from rso_lidar.picture.frames.animation import ANIMATION_SUFFIXES, animate
    from rso_lidar.picture.frames.frame import frame_figure, save_frame, summarize_frame
    from rso_lidar.picture.frames.panels import draw_intensity, draw_range, range_limits_m
    from rso_lidar.picture.frames.part_colours import choose_part_colours, count_parts, find_part_name, parts_in_order
    from rso_lidar.picture.frames.raster import draw_panel, write_raster
    from rso_lidar.picture.frames.sheet import SHEET_SUFFIXES, contact_sheet
    from rso_lidar.picture.plots.angles import angles_figure, ptu_figure
    from rso_lidar.picture.plots.curves import curve_figure
    from rso_lidar.picture.plots.orbit import inertial_figure, is_about_earth, osculating_orbit_m
    from rso_lidar.picture.plots.trajectory import orbit_figure
    from rso_lidar.picture.selection.scale import Scale, count_limits, nice_down, nice_up
    from rso_lidar.picture.selection.sequence import (
        Thumbnail,
        even_indices,
        find_shown_returns,
        find_target_pixels,
        on_target,
    )
    from rso_lidar.picture.selection.window import Window, bounding_window, crop
    from rso_lidar.picture.style import colour_maps, figures, palette
    from rso_lidar.picture.style.html_page import embed_figure, write_page, write_table
    from rso_lidar.picture.style.output import FIGURE_SUFFIXES, RESULT_SUFFIXES, save_figure, save_figure_or_table
    from rso_lidar.picture.style.palette import DARK, LIGHT, Scheme
    from rso_lidar.picture.style.recolour import recolour
    from rso_lidar.picture.viewers import rerun_scene
    from rso_lidar.picture.viewers.shape import Shape
else:
    __getattr__ = export_lazily(__name__)

__all__ = [
    "ANIMATION_SUFFIXES",
    "DARK",
    "FIGURE_SUFFIXES",
    "LIGHT",
    "RESULT_SUFFIXES",
    "SHEET_SUFFIXES",
    "Scale",
    "Scheme",
    "Shape",
    "Thumbnail",
    "Window",
    "angles_figure",
    "animate",
    "bounding_window",
    "choose_part_colours",
    "colour_maps",
    "contact_sheet",
    "count_limits",
    "count_parts",
    "crop",
    "curve_figure",
    "draw_intensity",
    "draw_panel",
    "draw_range",
    "embed_figure",
    "even_indices",
    "figures",
    "find_part_name",
    "find_shown_returns",
    "find_target_pixels",
    "frame_figure",
    "inertial_figure",
    "is_about_earth",
    "nice_down",
    "nice_up",
    "on_target",
    "orbit_figure",
    "osculating_orbit_m",
    "palette",
    "parts_in_order",
    "ptu_figure",
    "range_limits_m",
    "recolour",
    "rerun_scene",
    "save_figure",
    "save_figure_or_table",
    "save_frame",
    "summarize_frame",
    "write_page",
    "write_raster",
    "write_table",
]

__dir__ = limit_dir(__name__)

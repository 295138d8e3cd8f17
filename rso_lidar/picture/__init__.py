"""Records and tables drawn: frames, contact sheets, animations, orbits and curves.

Every figure is a plain `matplotlib.figure.Figure` on an Agg canvas: pyplot and its global state are never touched.
"""

from typing import TYPE_CHECKING

from rso_lidar.public_names import export_lazily, limit_dir

if TYPE_CHECKING:
    from rso_lidar.picture.frames.animation import ANIMATION_SUFFIXES, animate
    from rso_lidar.picture.frames.frame import draw, frame_figure, save_frame, summarize_frame
    from rso_lidar.picture.frames.panels import draw_intensity, draw_range
    from rso_lidar.picture.frames.part_colours import colour_parts, find_part_name, rank_parts
    from rso_lidar.picture.frames.raster import draw_panel, draw_text
    from rso_lidar.picture.frames.sheet import contact_sheet
    from rso_lidar.picture.plots.angles import angles_figure, ptu_figure
    from rso_lidar.picture.plots.curves import curve_figure
    from rso_lidar.picture.plots.orbit import inertial_figure, is_about_earth, osculating_orbit_m
    from rso_lidar.picture.plots.trajectory import orbit_figure
    from rso_lidar.picture.selection.scale import Scale
    from rso_lidar.picture.selection.sequence import (
        Thumbnail,
        choose_camera_window,
        choose_window,
        even_indices,
        find_target_returns,
    )
    from rso_lidar.picture.selection.stretch import Stretch
    from rso_lidar.picture.selection.window import Window
    from rso_lidar.picture.style import colour_maps, figures, html_page, palette
    from rso_lidar.picture.style.defaults import make_rc_params
    from rso_lidar.picture.style.output import FIGURE_SUFFIXES, RESULT_SUFFIXES, SavedResult, save_figure
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
    "SavedResult",
    "Scale",
    "Scheme",
    "Shape",
    "Stretch",
    "Thumbnail",
    "Window",
    "angles_figure",
    "animate",
    "choose_camera_window",
    "choose_window",
    "colour_maps",
    "colour_parts",
    "contact_sheet",
    "curve_figure",
    "draw",
    "draw_intensity",
    "draw_panel",
    "draw_range",
    "draw_text",
    "even_indices",
    "figures",
    "find_part_name",
    "find_target_returns",
    "frame_figure",
    "html_page",
    "inertial_figure",
    "is_about_earth",
    "make_rc_params",
    "orbit_figure",
    "osculating_orbit_m",
    "palette",
    "ptu_figure",
    "rank_parts",
    "recolour",
    "rerun_scene",
    "save_figure",
    "save_frame",
    "summarize_frame",
]

__dir__ = limit_dir(__name__)

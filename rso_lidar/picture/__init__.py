"""Records and tables drawn: frames, contact sheets, animations, orbits and curves.

Every figure is a plain `matplotlib.figure.Figure` on an Agg canvas: pyplot and its global state are never touched.
"""

from typing import TYPE_CHECKING

from rso_lidar.public_names import export_lazily, limit_dir

if TYPE_CHECKING:
    from rso_lidar.picture.frames.animation import animate
    from rso_lidar.picture.frames.frame import frame_figure, save_frame
    from rso_lidar.picture.frames.sheet import contact_sheet
    from rso_lidar.picture.plots.angles import angles_figure, ptu_figure
    from rso_lidar.picture.plots.curves import curve_figure
    from rso_lidar.picture.plots.orbit import inertial_figure
    from rso_lidar.picture.plots.trajectory import orbit_figure
    from rso_lidar.picture.selection.sequence import even_indices
    from rso_lidar.picture.style.output import save_figure
    from rso_lidar.picture.style.palette import DARK, LIGHT
    from rso_lidar.picture.style.recolour import recolour

__all__ = [
    "DARK",
    "LIGHT",
    "angles_figure",
    "animate",
    "contact_sheet",
    "curve_figure",
    "even_indices",
    "frame_figure",
    "inertial_figure",
    "orbit_figure",
    "ptu_figure",
    "recolour",
    "save_figure",
    "save_frame",
]

__getattr__ = export_lazily(__name__)
__dir__ = limit_dir(__name__)

"""Fly a flash LiDAR past a satellite before you build one.

Here is what scripts build scenarios from, and what runs them. Each room holds the rest: `rl.orbit`, `rl.rpo` and
`rl.motion` further motions and attitudes, `rl.scene` further materials, `rl.optics` and `rl.detector` what a lens and a
detector are made of, `rl.sensors` the spacecraft's other sensors, `rl.records` what the stages hand on, `rl.study` and
`rl.track` what is asked of the result, and `rl.loop` what connects a run to other programs.

>>> import rso_lidar as rl
>>> rl.Laser(energy_mj=50).wavelength_nm
1064.0
"""

from rso_lidar.interruption import watch_if_command_line as _watch_if_command_line

_watch_if_command_line()  # before any further import

from typing import TYPE_CHECKING as _TYPE_CHECKING

from rso_lidar.public_names import export_lazily as _export_lazily
from rso_lidar.public_names import limit_dir as _limit_dir

if _TYPE_CHECKING:
    from rso_lidar import (
        dataset,
        detector,
        export,
        imaging,
        loop,
        motion,
        optics,
        orbit,
        records,
        rpo,
        scene,
        sensors,
        study,
        track,
        units,
    )
    from rso_lidar.detector import Empirical, GeigerArray, Gsfl
    from rso_lidar.errors import (
        CatalogError,
        DatasetError,
        MeshError,
        PropagationError,
        RecordingError,
        RsoLidarError,
        RsoLidarWarning,
        RunError,
        ScenarioError,
    )
    from rso_lidar.evaluation import save, view
    from rso_lidar.export import open
    from rso_lidar.imaging import Camera
    from rso_lidar.mission_analysis import budget, timeline, truth
    from rso_lidar.motion import (
        Axes,
        FirstOrder,
        Fixed,
        FixedAttitude,
        FixedPoint,
        Ideal,
        LookAt,
        Mount,
        Nadir,
        PointingErrors,
        Ptu,
        Rtn,
        ScanPoint,
        SecondOrder,
        Spin,
        SunPointing,
        TrackPoint,
        Tumble,
    )
    from rso_lidar.optics import Laser, Receiver
    from rso_lidar.orbit import Kepler, Tle
    from rso_lidar.picture import draw
    from rso_lidar.records import Command, Frame, Observation, Taxonomy
    from rso_lidar.rpo import Hill
    from rso_lidar.scenario import (
        Constraints,
        Corridor,
        CratersAndBoulders,
        DataLink,
        Dispersion,
        FacetMaterials,
        FacetParts,
        Follower,
        Fragment,
        HeightField,
        Joint,
        Lidar,
        Scenario,
        Schedule,
        Target,
        Time,
        World,
        facet_forces,
    )
    from rso_lidar.scene import Lambertian, Phong
    from rso_lidar.simulation import Simulation, find_normals, flash, simulate
    from rso_lidar.study import trade

    __version__: str

__all__ = [
    "Axes",
    "Camera",
    "CatalogError",
    "Command",
    "Constraints",
    "Corridor",
    "CratersAndBoulders",
    "DataLink",
    "DatasetError",
    "Dispersion",
    "Empirical",
    "FacetMaterials",
    "FacetParts",
    "FirstOrder",
    "Fixed",
    "FixedAttitude",
    "FixedPoint",
    "Follower",
    "Fragment",
    "Frame",
    "GeigerArray",
    "Gsfl",
    "HeightField",
    "Hill",
    "Ideal",
    "Joint",
    "Kepler",
    "Lambertian",
    "Laser",
    "Lidar",
    "LookAt",
    "MeshError",
    "Mount",
    "Nadir",
    "Observation",
    "Phong",
    "PointingErrors",
    "PropagationError",
    "Ptu",
    "Receiver",
    "RecordingError",
    "RsoLidarError",
    "RsoLidarWarning",
    "Rtn",
    "RunError",
    "ScanPoint",
    "Scenario",
    "ScenarioError",
    "Schedule",
    "SecondOrder",
    "Simulation",
    "Spin",
    "SunPointing",
    "Target",
    "Taxonomy",
    "Time",
    "Tle",
    "TrackPoint",
    "Tumble",
    "World",
    "budget",
    "dataset",
    "detector",
    "draw",
    "export",
    "facet_forces",
    "find_normals",
    "flash",
    "imaging",
    "loop",
    "motion",
    "open",
    "optics",
    "orbit",
    "records",
    "rpo",
    "save",
    "scene",
    "sensors",
    "simulate",
    "study",
    "timeline",
    "track",
    "trade",
    "truth",
    "units",
    "view",
]

__dir__ = _limit_dir(__name__, "__doc__", "__version__")
_get_export = _export_lazily(__name__)
_ROOMS = (
    "orbit",
    "rpo",
    "motion",
    "sensors",
    "scene",
    "optics",
    "detector",
    "records",
    "study",
    "track",
    "export",
    "imaging",
)


if not _TYPE_CHECKING:  # which finds a wrong name itself

    def __getattr__(name: str) -> object:
        """Import what a name stands for when it is first used; say in which room a name is that is not here."""
        import sys
        from importlib import import_module
        from importlib.util import find_spec

        if name == "__version__":
            from importlib.metadata import version

            return version("rso-lidar")
        if not (name in __all__ or name.startswith("_")):
            if find_spec(f"rso_lidar.{name}"):  # such as rl.errors
                return import_module(f"rso_lidar.{name}")
            for room in _ROOMS:
                if name in getattr(sys.modules[__name__], room).__all__:
                    raise AttributeError(f"module 'rso_lidar' has no attribute '{name}': rl.{name} is rl.{room}.{name}")
        return _get_export(name)

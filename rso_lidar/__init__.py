"""Fly a flash LiDAR past a satellite before you build one.

>>> import rso_lidar as rl
>>> rl.Laser(energy_mj=50).wavelength_nm
1064.0
"""

from importlib.metadata import version as _version

from rso_lidar import track, units
from rso_lidar.detector import Empirical
from rso_lidar.errors import (
    CatalogError,
    MeshError,
    PropagationError,
    RecordingError,
    RsoLidarError,
    RsoLidarWarning,
    RunError,
    ScenarioError,
)
from rso_lidar.export import open, save
from rso_lidar.motion import (
    Axes,
    Body,
    Epochs,
    FirstOrder,
    Fixed,
    FixedAttitude,
    FixedPoint,
    Hill,
    Ideal,
    Kepler,
    LookAt,
    LvlhCcsds,
    Mount,
    PointingErrors,
    Ptu,
    Rtn,
    ScanPoint,
    SecondOrder,
    Spin,
    State,
    Table,
    Tle,
    TrackPoint,
    Tumble,
)
from rso_lidar.optics import Laser, Receiver
from rso_lidar.records import (
    Command,
    Extent,
    Frame,
    Hits,
    Labels,
    Observation,
    Photons,
    PtuAngles,
    Rays,
    Reading,
    Source,
    Truth,
)
from rso_lidar.scenario import Follower, Lidar, Scenario, Target, Time, World
from rso_lidar.scene import Lambertian, Phong
from rso_lidar.simulate import flash, simulate

__version__ = _version("rso-lidar")

__all__ = [
    "Axes",
    "Body",
    "CatalogError",
    "Command",
    "Empirical",
    "Epochs",
    "Extent",
    "FirstOrder",
    "Fixed",
    "FixedAttitude",
    "FixedPoint",
    "Follower",
    "Frame",
    "Hill",
    "Hits",
    "Ideal",
    "Kepler",
    "Labels",
    "Lambertian",
    "Laser",
    "Lidar",
    "LookAt",
    "LvlhCcsds",
    "MeshError",
    "Mount",
    "Observation",
    "Phong",
    "Photons",
    "PointingErrors",
    "PropagationError",
    "Ptu",
    "PtuAngles",
    "Rays",
    "Reading",
    "Receiver",
    "RecordingError",
    "RsoLidarError",
    "RsoLidarWarning",
    "Rtn",
    "RunError",
    "ScanPoint",
    "Scenario",
    "ScenarioError",
    "SecondOrder",
    "Source",
    "Spin",
    "State",
    "Table",
    "Target",
    "Time",
    "Tle",
    "TrackPoint",
    "Truth",
    "Tumble",
    "World",
    "flash",
    "open",
    "save",
    "simulate",
    "track",
    "units",
]

"""Where everything is, and how it is turned."""

from rso_lidar.motion.aim import LIDAR_FROM_PTU, Aim, asked, demand, with_lidar
from rso_lidar.motion.attitude import FixedAttitude, LookAt, LvlhCcsds, Rtn, Spin, Tumble
from rso_lidar.motion.body import Axes, Body, working_order
from rso_lidar.motion.ephemeris import Fixed, Table
from rso_lidar.motion.epochs import Epochs, utc_text
from rso_lidar.motion.hill import Hill
from rso_lidar.motion.kepler import Kepler, State
from rso_lidar.motion.point import FixedPoint, ScanPoint, TrackPoint
from rso_lidar.motion.ptu import FirstOrder, Ideal, Mount, PointingErrors, Ptu, SecondOrder, sense, start, step
from rso_lidar.motion.sgp4_orbit import Tle
from rso_lidar.motion.truth import truth

__all__ = [
    "LIDAR_FROM_PTU",
    "Aim",
    "Axes",
    "Body",
    "Epochs",
    "FirstOrder",
    "Fixed",
    "FixedAttitude",
    "FixedPoint",
    "Hill",
    "Ideal",
    "Kepler",
    "LookAt",
    "LvlhCcsds",
    "Mount",
    "PointingErrors",
    "Ptu",
    "Rtn",
    "ScanPoint",
    "SecondOrder",
    "Spin",
    "State",
    "Table",
    "Tle",
    "TrackPoint",
    "Tumble",
    "asked",
    "demand",
    "sense",
    "start",
    "step",
    "truth",
    "utc_text",
    "with_lidar",
    "working_order",
]

"""Where everything is, and how it is turned."""

from rso_lidar.motion.aem import AttitudeTable, write_aem, write_attitude_csv
from rso_lidar.motion.aim import Aim, asked, demand, driven, lidar_from_ptu, with_lidar
from rso_lidar.motion.attitude import FixedAttitude, LookAt, LvlhCcsds, Rtn, Spin, Tumble
from rso_lidar.motion.body import Axes, Body, working_order
from rso_lidar.motion.course import Course
from rso_lidar.motion.ephemeris import Fixed, Table
from rso_lidar.motion.joint import FixedAngle, FollowSun, HingeAxes, PlannedAngle
from rso_lidar.motion.point import FixedPoint, ScanPoint, TrackPoint
from rso_lidar.motion.ptu import (
    FirstOrder,
    Ideal,
    Mount,
    PointingErrors,
    Ptu,
    SecondOrder,
    StateSpaceDrive,
    sense,
    start,
    step,
)
from rso_lidar.motion.slew import Slew
from rso_lidar.motion.state_space import StateSpace, StateSpaceAttitude
from rso_lidar.motion.sunward import Nadir, SunPointing
from rso_lidar.motion.truth import Chief, truth

__all__ = [
    "Aim",
    "AttitudeTable",
    "Axes",
    "Body",
    "Chief",
    "Course",
    "FirstOrder",
    "Fixed",
    "FixedAngle",
    "FixedAttitude",
    "FixedPoint",
    "FollowSun",
    "HingeAxes",
    "Ideal",
    "LookAt",
    "LvlhCcsds",
    "Mount",
    "Nadir",
    "PlannedAngle",
    "PointingErrors",
    "Ptu",
    "Rtn",
    "ScanPoint",
    "SecondOrder",
    "Slew",
    "Spin",
    "StateSpace",
    "StateSpaceAttitude",
    "StateSpaceDrive",
    "SunPointing",
    "Table",
    "TrackPoint",
    "Tumble",
    "asked",
    "demand",
    "driven",
    "lidar_from_ptu",
    "sense",
    "start",
    "step",
    "truth",
    "with_lidar",
    "working_order",
    "write_aem",
    "write_attitude_csv",
]

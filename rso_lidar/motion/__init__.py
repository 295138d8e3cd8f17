"""Where everything is, and how it is turned."""

from rso_lidar.motion.aim import Aim, asked, demand, driven, lidar_from_ptu, with_lidar
from rso_lidar.motion.attitudes.aem import AttitudeTable, write_aem, write_attitude_csv
from rso_lidar.motion.attitudes.constant import FixedAttitude, LvlhCcsds, Rtn
from rso_lidar.motion.attitudes.look_at import LookAt
from rso_lidar.motion.attitudes.slew import Slew
from rso_lidar.motion.attitudes.spin import Spin, Tumble
from rso_lidar.motion.attitudes.sun_pointing import Nadir, SunPointing
from rso_lidar.motion.bodies.body import Axes, Body
from rso_lidar.motion.bodies.hinge import FixedAngle, FollowSun, HingeAxes, PlannedAngle
from rso_lidar.motion.bodies.order import working_order
from rso_lidar.motion.bodies.prescribed import Fixed, Table
from rso_lidar.motion.course import Course
from rso_lidar.motion.dynamics.state_space import StateSpace, StateSpaceAttitude
from rso_lidar.motion.gimbal.demand import FixedPoint, ScanPoint, TrackPoint
from rso_lidar.motion.gimbal.drive import FirstOrder, Ideal, SecondOrder, StateSpaceDrive
from rso_lidar.motion.gimbal.ptu import PointingErrors, Ptu, sense, start, step
from rso_lidar.motion.mount import Mount
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

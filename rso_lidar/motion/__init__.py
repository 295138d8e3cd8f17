"""Positions and attitudes of all bodies, and the pointing of the lidar."""

from typing import TYPE_CHECKING

from rso_lidar.motion.truth import truth
from rso_lidar.public_names import export_lazily, limit_dir

if TYPE_CHECKING:
    from rso_lidar.motion.aim import Aim, AimState, add_lidar, compute_demand, make_demand
    from rso_lidar.motion.attitudes.attitude_dynamics import StateSpaceAttitude
    from rso_lidar.motion.attitudes.attitude_file import write_aem, write_attitude_csv
    from rso_lidar.motion.attitudes.attitude_hold import FixedAttitude, LvlhCcsds, Rtn
    from rso_lidar.motion.attitudes.attitude_table import AttitudeTable
    from rso_lidar.motion.attitudes.fmu_attitude import FmuAttitude
    from rso_lidar.motion.attitudes.look_at import LookAt
    from rso_lidar.motion.attitudes.situation import Attitude, Orientation, Situation
    from rso_lidar.motion.attitudes.slew import Slew
    from rso_lidar.motion.attitudes.spin import Spin, Tumble
    from rso_lidar.motion.attitudes.spin_presets import load_spin_presets
    from rso_lidar.motion.attitudes.sun_pointing import Nadir, SunPointing
    from rso_lidar.motion.bodies.body import Axes, Body
    from rso_lidar.motion.bodies.hinge import FixedAngle, FollowSun, HingeAxes, PlannedAngle
    from rso_lidar.motion.course import Course, CourseState
    from rso_lidar.motion.follower_motion import FollowerMotion, count_dynamics, states_specific_force
    from rso_lidar.motion.gimbal.demand import FixedPoint, ScanPoint, TrackPoint
    from rso_lidar.motion.gimbal.drive import FirstOrder, Ideal, SecondOrder, StateSpaceDrive
    from rso_lidar.motion.gimbal.fmu_drive import FmuDrive
    from rso_lidar.motion.gimbal.ptu import PointingErrors, Ptu, check_angles, sense, start, step
    from rso_lidar.motion.light_time import apply_light_time
    from rso_lidar.motion.motions.fmu_motion import FmuMotion
    from rso_lidar.motion.motions.motion import Motion
    from rso_lidar.motion.motions.prescribed_motion import Fixed, Table
    from rso_lidar.motion.motions.state_space import StateSpace
    from rso_lidar.motion.mount import Mount

__all__ = [
    "Aim",
    "AimState",
    "Attitude",
    "AttitudeTable",
    "Axes",
    "Body",
    "Course",
    "CourseState",
    "FirstOrder",
    "Fixed",
    "FixedAngle",
    "FixedAttitude",
    "FixedPoint",
    "FmuAttitude",
    "FmuDrive",
    "FmuMotion",
    "FollowSun",
    "FollowerMotion",
    "HingeAxes",
    "Ideal",
    "LookAt",
    "LvlhCcsds",
    "Motion",
    "Mount",
    "Nadir",
    "Orientation",
    "PlannedAngle",
    "PointingErrors",
    "Ptu",
    "Rtn",
    "ScanPoint",
    "SecondOrder",
    "Situation",
    "Slew",
    "Spin",
    "StateSpace",
    "StateSpaceAttitude",
    "StateSpaceDrive",
    "SunPointing",
    "Table",
    "TrackPoint",
    "Tumble",
    "add_lidar",
    "apply_light_time",
    "check_angles",
    "compute_demand",
    "count_dynamics",
    "load_spin_presets",
    "make_demand",
    "sense",
    "start",
    "states_specific_force",
    "step",
    "truth",
    "write_aem",
    "write_attitude_csv",
]

__getattr__ = export_lazily(__name__)
__dir__ = limit_dir(__name__)

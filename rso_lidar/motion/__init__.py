"""Positions and attitudes of all bodies, and the pointing of the lidar."""

from typing import TYPE_CHECKING

from rso_lidar.public_names import export_lazily, limit_dir

if TYPE_CHECKING:
    from rso_lidar.motion.aim import (
        Aim,
        AimState,
        add_lidar,
        compute_demand,
        lidar_from_ptu,
        make_demand,
        simulate_drive,
    )
    from rso_lidar.motion.attitudes.attitude_along import PrescribedAttitude
    from rso_lidar.motion.attitudes.attitude_dynamics import StateSpaceAttitude
    from rso_lidar.motion.attitudes.attitude_hold import FixedAttitude, LvlhCcsds, Rtn
    from rso_lidar.motion.attitudes.attitude_table import AttitudeTable
    from rso_lidar.motion.attitudes.fmu_attitude import FmuAttitude
    from rso_lidar.motion.attitudes.kernel_attitude import SpiceAttitude
    from rso_lidar.motion.attitudes.look_at import LookAt
    from rso_lidar.motion.attitudes.situation import Attitude, Orientation, Situation
    from rso_lidar.motion.attitudes.slew import Slew
    from rso_lidar.motion.attitudes.spin import Spin, Tumble, load_spin_presets
    from rso_lidar.motion.attitudes.sun_pointing import Nadir, SunPointing
    from rso_lidar.motion.attitudes.torqued import Torqued
    from rso_lidar.motion.bodies.body import RESERVED_AXES, Axes, Body
    from rso_lidar.motion.bodies.hinge import FixedAngle, FollowSun, HingeAngle, HingeAxes, PlannedAngle
    from rso_lidar.motion.bodies.orbital_axes import find_moon_m
    from rso_lidar.motion.bodies.order import find_center_of_body, sort_bodies
    from rso_lidar.motion.body_truth import Chief, truth
    from rso_lidar.motion.course import Course, CourseState
    from rso_lidar.motion.dynamics.function import find_dynamics_file, name_function
    from rso_lidar.motion.follower_motion import FollowerMotion, count_dynamics, states_specific_force
    from rso_lidar.motion.gimbal.demand import FixedPoint, ScanPoint, TrackPoint
    from rso_lidar.motion.gimbal.drive import FirstOrder, Ideal, SecondOrder, StateSpaceDrive
    from rso_lidar.motion.gimbal.fmu_drive import FmuDrive
    from rso_lidar.motion.gimbal.ptu import PointingErrors, Ptu, check_angles, make_ptu_link, sense, start, step
    from rso_lidar.motion.light_time import apply_light_time
    from rso_lidar.motion.motions.fmu_motion import FmuMotion
    from rso_lidar.motion.motions.motion import Motion, advise_on_motion, get_chief_name, summarize_motion
    from rso_lidar.motion.motions.prescribed_motion import Fixed, Table
    from rso_lidar.motion.motions.state_space import StateSpace
    from rso_lidar.motion.mount import Mount
    from rso_lidar.motion.proximity import find_flight, find_plan, follows_plan, get_flown_motion, list_commands
    from rso_lidar.orbit import write_aem, write_attitude_csv
else:
    __getattr__ = export_lazily(__name__)

__all__ = [
    "RESERVED_AXES",
    "Aim",
    "AimState",
    "Attitude",
    "AttitudeTable",
    "Axes",
    "Body",
    "Chief",
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
    "HingeAngle",
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
    "PrescribedAttitude",
    "Ptu",
    "Rtn",
    "ScanPoint",
    "SecondOrder",
    "Situation",
    "Slew",
    "SpiceAttitude",
    "Spin",
    "StateSpace",
    "StateSpaceAttitude",
    "StateSpaceDrive",
    "SunPointing",
    "Table",
    "Torqued",
    "TrackPoint",
    "Tumble",
    "add_lidar",
    "advise_on_motion",
    "apply_light_time",
    "check_angles",
    "compute_demand",
    "count_dynamics",
    "find_center_of_body",
    "find_dynamics_file",
    "find_flight",
    "find_moon_m",
    "find_plan",
    "follows_plan",
    "get_chief_name",
    "get_flown_motion",
    "lidar_from_ptu",
    "list_commands",
    "load_spin_presets",
    "make_demand",
    "make_ptu_link",
    "name_function",
    "sense",
    "simulate_drive",
    "sort_bodies",
    "start",
    "states_specific_force",
    "step",
    "summarize_motion",
    "truth",
    "write_aem",
    "write_attitude_csv",
]

__dir__ = limit_dir(__name__)

"""Rendezvous and proximity operations: relative motion in a chief's rtn axes, plans made of it, and their flight."""

from typing import TYPE_CHECKING

from rso_lidar.public_names import export_lazily, limit_dir

if TYPE_CHECKING:
    from rso_lidar.orbit import rtn_axes, rtn_matrix
    from rso_lidar.rpo.flown.filtered_flight import FilterEstimate
    from rso_lidar.rpo.flown.flown_plan import AnyNavigation, Flown, RelativeStart
    from rso_lidar.rpo.flown.guidance import Guidance, GuidanceUpdate, TwoImpulseGuidance
    from rso_lidar.rpo.flown.held_thrust import HeldThrustErrors
    from rso_lidar.rpo.flown.plan_flight import PlanFlight
    from rso_lidar.rpo.flown.thrusters import NavigationErrors, Thrusters
    from rso_lidar.rpo.navigation.filter_bank import ORBIT_STATES, THRUST_STATES, FilterBank, ScalarUpdate, apply_matrix
    from rso_lidar.rpo.navigation.navigation_sensors import (
        NavigationCamera,
        NavigationLidar,
        RangeNoise,
        find_clear_views,
    )
    from rso_lidar.rpo.navigation.relative_filter import RelativeFilter
    from rso_lidar.rpo.navigation.slow_errors import CentroidWander, SensorBias, SlowErrors
    from rso_lidar.rpo.plans.approach import CoElliptic, RBarApproach, StationKeeping, VBarApproach
    from rso_lidar.rpo.plans.circumnavigation import Circumnavigation, ForcedCircumnavigation, SafetyEllipse, Teardrop
    from rso_lidar.rpo.plans.exhaust import plume_margin
    from rso_lidar.rpo.plans.free_holds import Perch, PulsedStationKeeping
    from rso_lidar.rpo.plans.glideslope import Glideslope
    from rso_lidar.rpo.plans.keep_out import KeepOutSphere
    from rso_lidar.rpo.plans.operation import ProximityOperation
    from rso_lidar.rpo.plans.plan import Plan, PlannedImpulse
    from rso_lidar.rpo.plans.transfers import Hop, Lambert, Rendezvous, Waypoints
    from rso_lidar.rpo.relative.deviation_flow import DeviationFlow
    from rso_lidar.rpo.relative.hill import Hill, clohessy_wiltshire, mean_motion_of_state
    from rso_lidar.rpo.relative.nonlinear import Nonlinear
    from rso_lidar.rpo.relative.reference_orbit import ReferenceOrbit
    from rso_lidar.rpo.relative.relative_elements import (
        RelativeElements,
        relative_elements_from_states,
        state_from_relative_elements,
    )
    from rso_lidar.rpo.relative.relative_motion import RelativeMotion, RtnMotion
    from rso_lidar.rpo.relative.yamanaka_ankersen import YamanakaAnkersen, propagate_yamanaka_ankersen
    from rso_lidar.rpo.sequences.end_conditions import (
        AfterTime,
        AtAngle,
        AtPassiveSafety,
        AtRange,
        AtSunAngle,
        InSunlight,
    )
    from rso_lidar.rpo.sequences.legs import (
        CircumnavigationLeg,
        CoEllipticLeg,
        DriftLeg,
        ForcedCircumnavigationLeg,
        GlideslopeLeg,
        HoldLeg,
        HopLeg,
        LambertLeg,
        PerchLeg,
        PulsedHoldLeg,
        RBarLeg,
        SafetyEllipseLeg,
        TeardropLeg,
        VBarLeg,
        WaypointsLeg,
    )
    from rso_lidar.rpo.sequences.sequence import Sequence
    from rso_lidar.rpo.sequences.sequence_plan import PlannedLeg, SequencePlan
else:
    __getattr__ = export_lazily(__name__)

__all__ = [
    "ORBIT_STATES",
    "THRUST_STATES",
    "AfterTime",
    "AnyNavigation",
    "AtAngle",
    "AtPassiveSafety",
    "AtRange",
    "AtSunAngle",
    "CentroidWander",
    "Circumnavigation",
    "CircumnavigationLeg",
    "CoElliptic",
    "CoEllipticLeg",
    "DeviationFlow",
    "DriftLeg",
    "FilterBank",
    "FilterEstimate",
    "Flown",
    "ForcedCircumnavigation",
    "ForcedCircumnavigationLeg",
    "Glideslope",
    "GlideslopeLeg",
    "Guidance",
    "GuidanceUpdate",
    "HeldThrustErrors",
    "Hill",
    "HoldLeg",
    "Hop",
    "HopLeg",
    "InSunlight",
    "KeepOutSphere",
    "Lambert",
    "LambertLeg",
    "NavigationCamera",
    "NavigationErrors",
    "NavigationLidar",
    "Nonlinear",
    "Perch",
    "PerchLeg",
    "Plan",
    "PlanFlight",
    "PlannedImpulse",
    "PlannedLeg",
    "ProximityOperation",
    "PulsedHoldLeg",
    "PulsedStationKeeping",
    "RBarApproach",
    "RBarLeg",
    "RangeNoise",
    "ReferenceOrbit",
    "RelativeElements",
    "RelativeFilter",
    "RelativeMotion",
    "RelativeStart",
    "Rendezvous",
    "RtnMotion",
    "SafetyEllipse",
    "SafetyEllipseLeg",
    "ScalarUpdate",
    "SensorBias",
    "Sequence",
    "SequencePlan",
    "SlowErrors",
    "StationKeeping",
    "Teardrop",
    "TeardropLeg",
    "Thrusters",
    "TwoImpulseGuidance",
    "VBarApproach",
    "VBarLeg",
    "Waypoints",
    "WaypointsLeg",
    "YamanakaAnkersen",
    "apply_matrix",
    "clohessy_wiltshire",
    "find_clear_views",
    "mean_motion_of_state",
    "plume_margin",
    "propagate_yamanaka_ankersen",
    "relative_elements_from_states",
    "rtn_axes",
    "rtn_matrix",
    "state_from_relative_elements",
]

__dir__ = limit_dir(__name__)

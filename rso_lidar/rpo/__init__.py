"""Rendezvous and proximity operations: relative motion in a chief's rtn axes, plans made of it, and their flight."""

from typing import TYPE_CHECKING

from rso_lidar.public_names import export_lazily, limit_dir

if TYPE_CHECKING:
    from rso_lidar.rpo.flown.filtered_flight import FilterEstimate
    from rso_lidar.rpo.flown.flown_plan import Flown, RelativeStart
    from rso_lidar.rpo.flown.guidance import Guidance, GuidanceUpdate, TwoImpulseGuidance
    from rso_lidar.rpo.flown.plan_flight import PlanFlight
    from rso_lidar.rpo.flown.thrusters import NavigationErrors, Thrusters
    from rso_lidar.rpo.navigation.navigation_sensors import NavigationCamera, NavigationLidar, RangeNoise
    from rso_lidar.rpo.navigation.relative_filter import RelativeFilter
    from rso_lidar.rpo.plans.approach import CoElliptic, RBarApproach, StationKeeping, VBarApproach
    from rso_lidar.rpo.plans.circumnavigation import Circumnavigation, ForcedCircumnavigation, SafetyEllipse, Teardrop
    from rso_lidar.rpo.plans.free_holds import Perch, PulsedStationKeeping
    from rso_lidar.rpo.plans.glideslope import Glideslope
    from rso_lidar.rpo.plans.operation import ProximityOperation
    from rso_lidar.rpo.plans.plan import Plan, PlannedImpulse
    from rso_lidar.rpo.plans.transfers import Hop, Lambert, Rendezvous, Waypoints
    from rso_lidar.rpo.relative.hill import Hill
    from rso_lidar.rpo.relative.nonlinear import Nonlinear
    from rso_lidar.rpo.relative.relative_elements import (
        RelativeElements,
        relative_elements_from_states,
        state_from_relative_elements,
    )
    from rso_lidar.rpo.relative.relative_motion import RelativeMotion
    from rso_lidar.rpo.relative.rtn import rtn_axes, rtn_matrix
    from rso_lidar.rpo.relative.yamanaka_ankersen import YamanakaAnkersen
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

__all__ = [
    "AfterTime",
    "AtAngle",
    "AtPassiveSafety",
    "AtRange",
    "AtSunAngle",
    "Circumnavigation",
    "CircumnavigationLeg",
    "CoElliptic",
    "CoEllipticLeg",
    "DriftLeg",
    "FilterEstimate",
    "Flown",
    "ForcedCircumnavigation",
    "ForcedCircumnavigationLeg",
    "Glideslope",
    "GlideslopeLeg",
    "Guidance",
    "GuidanceUpdate",
    "Hill",
    "HoldLeg",
    "Hop",
    "HopLeg",
    "InSunlight",
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
    "RelativeElements",
    "RelativeFilter",
    "RelativeMotion",
    "RelativeStart",
    "Rendezvous",
    "SafetyEllipse",
    "SafetyEllipseLeg",
    "Sequence",
    "SequencePlan",
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
    "relative_elements_from_states",
    "rtn_axes",
    "rtn_matrix",
    "state_from_relative_elements",
]

__getattr__ = export_lazily(__name__)
__dir__ = limit_dir(__name__)

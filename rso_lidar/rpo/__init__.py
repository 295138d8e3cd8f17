"""Rendezvous and proximity operations: relative motion in a chief's rtn axes, and plans made of it."""

from rso_lidar.public_names import limit_dir
from rso_lidar.rpo.plans.approach import CoElliptic, RBarApproach, StationKeeping, VBarApproach
from rso_lidar.rpo.plans.circumnavigation import Circumnavigation, ForcedCircumnavigation, SafetyEllipse, Teardrop
from rso_lidar.rpo.plans.operation import ProximityOperation
from rso_lidar.rpo.plans.plan import Plan
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

__all__ = [
    "Circumnavigation",
    "CoElliptic",
    "ForcedCircumnavigation",
    "Hill",
    "Hop",
    "Lambert",
    "Nonlinear",
    "Plan",
    "ProximityOperation",
    "RBarApproach",
    "RelativeElements",
    "RelativeMotion",
    "Rendezvous",
    "SafetyEllipse",
    "StationKeeping",
    "Teardrop",
    "VBarApproach",
    "Waypoints",
    "YamanakaAnkersen",
    "relative_elements_from_states",
    "rtn_axes",
    "rtn_matrix",
    "state_from_relative_elements",
]

__dir__ = limit_dir(__name__)

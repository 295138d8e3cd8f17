"""Rendezvous and proximity operations: relative motion in a chief's rtn axes, and plans made of it."""

from rso_lidar.rpo.approach import CoElliptic, RBarApproach, StationKeeping, VBarApproach
from rso_lidar.rpo.circling import Circumnavigation, ForcedCircumnavigation, SafetyEllipse, Teardrop
from rso_lidar.rpo.eccentric import YamanakaAnkersen
from rso_lidar.rpo.hill import Hill, rtn_axes, rtn_matrix
from rso_lidar.rpo.nonlinear import Nonlinear
from rso_lidar.rpo.operation import ProximityOperation
from rso_lidar.rpo.plan import Plan
from rso_lidar.rpo.relative import RelativeMotion
from rso_lidar.rpo.relative_elements import (
    RelativeElements,
    relative_elements_from_states,
    state_from_relative_elements,
)
from rso_lidar.rpo.transfers import Hop, Lambert, Rendezvous, Waypoints

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

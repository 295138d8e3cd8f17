"""Legs of a sequence: the operations about one body, each from where the last one ended, with a condition that ends it."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from rso_lidar.errors import ScenarioError
from rso_lidar.part import Name, NotNegative, Number, Vector
from rso_lidar.records import BodyState
from rso_lidar.rpo.limits import Duration, TransferTime
from rso_lidar.rpo.plans.approach import CoElliptic, RBarApproach, StationKeeping, VBarApproach
from rso_lidar.rpo.plans.circumnavigation import Circumnavigation, ForcedCircumnavigation, SafetyEllipse, Teardrop
from rso_lidar.rpo.plans.free_holds import Perch, PulsedStationKeeping
from rso_lidar.rpo.plans.glideslope import Glideslope
from rso_lidar.rpo.plans.operation import ProximityOperation, check_lengths
from rso_lidar.rpo.plans.plan import Plan, make_coast
from rso_lidar.rpo.plans.transfers import Hop, Lambert, Waypoints
from rso_lidar.rpo.relative.hill import mean_motion_of_state
from rso_lidar.rpo.sequences.end_conditions import Until

State = tuple[np.ndarray, np.ndarray]
_OF_THE_LEG = ("type", "until", "transfer_s", "relative_to")
_ANY_NAME = "body"
_PER_REVOLUTION = 360  # samples of a path in the search for its end


class SequenceLeg(ProximityOperation):
    """Base of legs: an operation that begins where the last leg ended, and its end.

    If the operation begins elsewhere, a two-impulse transfer leads there; its duration counts with the leg. Without
    `until` the leg ends when its operation does.
    """

    is_endless: ClassVar[bool] = False  # whether the operation ends by `duration_s` only
    operation: ClassVar[type[ProximityOperation]]
    start_key: ClassVar[str] = ""  # the operation's key of a position at which it begins, which a leg may leave out

    relative_to: Name | None = Field(  # type: ignore[assignment]
        default=None, description="Name of the body that is approached, which is that of the sequence if omitted."
    )
    keep_out_m: NotNegative | None = Field(  # type: ignore[assignment]
        default=None,
        description=(
            "Radius of the keep-out sphere during this leg and the transfer to it [m]. If omitted, that of the sequence."
        ),
    )
    until: Until | None = Field(
        default=None,
        description="Condition that ends the leg, where its operation does not end before. If omitted, its own end.",
    )
    transfer_s: TransferTime | None = Field(
        default=None,
        description=(
            "Duration of the transfer to the start of the leg, if it begins elsewhere than the last one ended [s]. If "
            "omitted, that of the least delta-v up to a revolution that keeps out of the keep-out sphere."
        ),
    )

    def start_values(self, state: State | None) -> dict[str, Any]:
        """Return the start of the operation, where the leg leaves it out.

        Parameters
        ----------
        state : position [m] and velocity [m/s] (3,) at which the last leg ended; None at the first leg
        """
        key = self.start_key
        return {key: tuple(_need(state, key)[0].tolist())} if key and getattr(self, key) is None else {}

    @property
    def has_own_end(self) -> bool:
        """Whether the leg ends without `until`: its operation is not endless, or a key says how long it lasts."""
        return not self.is_endless or any(getattr(self, key, None) is not None for key in ("duration_s", "to_m"))

    def find_step_s(self, mean_motion_rad_s: float) -> float:
        """Return the step at which the path is searched for its end [s].

        Parameters
        ----------
        mean_motion_rad_s : mean motion of the body that is approached [rad/s]
        """
        return 2.0 * np.pi / mean_motion_rad_s / _PER_REVOLUTION

    def make_plan(self, mean_motion_rad_s: float) -> Plan:
        """Return the plan of the leg alone, about a body of this mean motion [rad/s]."""
        return self.make_operation(None).make_plan(mean_motion_rad_s)

    def make_operation(self, state: State | None) -> ProximityOperation:
        """Return the operation of the leg.

        Parameters
        ----------
        state : position [m] and velocity [m/s] (3,) at which the last leg ended; None at the first leg

        Raises
        ------
        ScenarioError
            if it has no start, or cannot begin there
        """
        names = set(type(self).operation.model_fields) - {*_OF_THE_LEG, "keep_out_m"}
        fields = {name: getattr(self, name) for name in names if name in self.model_fields_set}
        fields = {name: value for name, value in fields.items() if value is not None}
        return type(self).operation(relative_to=_ANY_NAME, **(self.start_values(state) | fields))

    def make_leg_plan(self, chief: BodyState, state: State | None) -> Plan:
        """Make the plan of the leg from its own begin, without the transfer to it.

        Parameters
        ----------
        chief : inertial state of the body that is approached at the begin of the leg
        state : position [m] and velocity [m/s] (3,) at which the last leg ended; None at the first leg

        Returns
        -------
        the plan in rtn axes of that body, from time 0
        """
        operation = self.make_operation(state)
        check_lengths(operation, mean_motion_of_state(chief.position_m, chief.velocity_m_s))
        return operation.make_plan_about(chief)


def _need(state: State | None, key: str) -> State:
    """Return the state; raise `ScenarioError` where the first leg lacks the key of its start."""
    if state is None:
        raise ScenarioError(f"{key}: is missing: the first leg begins there; give it, or the sequence's position_m")
    return state


class HopLeg(SequenceLeg, Hop):
    """Leg of a sequence: a two-impulse transfer to `to_m`, from rest or from any velocity; see `Hop`."""

    operation = Hop
    start_key = "from_m"
    from_m: Vector | None = Field(  # type: ignore[assignment]
        default=None, description="Position of departure in rtn axes [m]. If omitted, where the last leg ended."
    )


class GlideslopeLeg(SequenceLeg, Glideslope):
    """Leg of a sequence: a straight line flown by pulses at a commanded speed; see `Glideslope`."""

    operation = Glideslope
    start_key = "from_m"
    from_m: Vector | None = Field(  # type: ignore[assignment]
        default=None, description="Initial position in rtn axes [m]. If omitted, where the last leg ended."
    )

    @model_validator(mode="after")
    def _some_length(self) -> Self:
        if self.from_m is not None:
            self.make_operation(None)
        return self


class PerchLeg(SequenceLeg, Perch):
    """Leg of a sequence: rest on the V-bar in free flight; see `Perch`."""

    is_endless = True
    operation = Perch


class PulsedHoldLeg(SequenceLeg, PulsedStationKeeping):
    """Leg of a sequence: a position kept by pulses; see `PulsedStationKeeping`."""

    operation = PulsedStationKeeping
    start_key = "position_m"
    position_m: Vector | None = Field(  # type: ignore[assignment]
        default=None, description="Position that is kept, in rtn axes [m]. If omitted, where the last leg ended."
    )


class HoldLeg(SequenceLeg, StationKeeping):
    """Leg of a sequence: a position held in rtn axes; see `StationKeeping`."""

    is_endless = True
    operation = StationKeeping
    start_key = "position_m"
    position_m: Vector | None = Field(  # type: ignore[assignment]
        default=None, description="Position that is held, in rtn axes [m]. If omitted, where the last leg ended."
    )


class _AxisLeg(SequenceLeg):
    """Base of legs along one axis, whose start may be left out."""

    from_m: Number | None = Field(
        default=None,
        description="Initial position along the axis [m]. If omitted, the one at which the last leg ended.",
    )

    @model_validator(mode="after")
    def _somewhere(self) -> Self:
        if self.from_m is not None:
            self.make_operation(None)
        return self

    def start_values(self, state: State | None) -> dict[str, Any]:
        """Return the start of the operation; see `SequenceLeg`."""
        if self.from_m is not None:
            return {}
        axis: int = getattr(type(self).operation, "axis", 1)
        return {"from_m": float(_need(state, "from_m")[0][axis])}


class VBarLeg(_AxisLeg, VBarApproach):
    """Leg of a sequence: an approach along the V-bar; see `VBarApproach`."""

    operation = VBarApproach


class RBarLeg(_AxisLeg, RBarApproach):
    """Leg of a sequence: an approach along the R-bar; see `RBarApproach`."""

    operation = RBarApproach


class CoEllipticLeg(_AxisLeg, CoElliptic):
    """Leg of a sequence: drift on a neighbouring circle, `radial_m` above or below; see `CoElliptic`.

    With `until` and without `to_m` and `duration_s`, it lasts until that condition is met.
    """

    is_endless = True
    operation = CoElliptic

    @model_validator(mode="after")
    def _gets_there(self) -> Self:
        if self.until is None and self.to_m is None and self.duration_s is None:
            raise ValueError("needs one of to_m, duration_s and until; give one of them")
        return self

    def start_values(self, state: State | None) -> dict[str, Any]:
        """Return the start of the operation; see `SequenceLeg`."""
        endless = {"duration_s": 1.0} if self.to_m is None and self.duration_s is None else {}
        return super().start_values(state) | endless


class EllipseLeg(SequenceLeg):
    """Base of legs on an ellipse, on which the craft may begin at any phase."""

    is_endless = True
    phase_deg: Number | None = Field(
        default=None,
        description=(
            "Initial phase on the ellipse [deg]: 0 above, 90 behind its centre, 180 below. If omitted, that of the "
            "transfer with the least delta-v, and 0 in a first leg."
        ),
    )

    @property
    def has_free_phase(self) -> bool:
        """Whether the leg may begin at any phase of the ellipse."""
        return self.phase_deg is None


class CircumnavigationLeg(EllipseLeg, Circumnavigation):
    """Leg of a sequence: natural motion round the body; see `Circumnavigation`."""

    operation = Circumnavigation


class SafetyEllipseLeg(EllipseLeg, SafetyEllipse):
    """Leg of a sequence: insertion onto a walking safety ellipse, and flight on it; see `SafetyEllipse`."""

    operation = SafetyEllipse


class TeardropLeg(SequenceLeg, Teardrop):
    """Leg of a sequence: loops above or below the body; see `Teardrop`."""

    operation = Teardrop


class ForcedCircumnavigationLeg(SequenceLeg, ForcedCircumnavigation):
    """Leg of a sequence: a forced circle about the body; see `ForcedCircumnavigation`."""

    is_endless = True
    operation = ForcedCircumnavigation

    def find_step_s(self, mean_motion_rad_s: float) -> float:
        """Return the step at which the path is searched for its end [s]; see `SequenceLeg`."""
        return min(super().find_step_s(mean_motion_rad_s), self.turn_s / _PER_REVOLUTION)


class WaypointsLeg(SequenceLeg, Waypoints):
    """Leg of a sequence: transfers through a list of positions; see `Waypoints`."""

    operation = Waypoints


class LambertLeg(SequenceLeg, Lambert):
    """Leg of a sequence: a two-body transfer at any distance, about the body's orbit as two-body motion; see `Lambert`."""

    operation = Lambert
    from_m: Vector | None = Field(  # type: ignore[assignment]
        default=None, description="Position of departure in rtn axes [m]. If omitted, where the last leg ended."
    )

    def start_values(self, state: State | None) -> dict[str, Any]:
        """Return the start of the operation; see `SequenceLeg`."""
        if self.from_m is not None:
            return {}
        position, velocity = _need(state, "from_m")
        return {"from_m": tuple(position.tolist()), "velocity_m_s": tuple(velocity.tolist())}


class DriftLeg(SequenceLeg):
    """Leg of a sequence: free flight from where the last leg ended, with the velocity that it ended with."""

    is_endless = True
    type: Literal["drift"] = "drift"
    duration_s: Duration | None = Field(
        default=None, description="Duration of the drift [s]. If omitted, one revolution of the body, or `until`."
    )

    def make_leg_plan(self, chief: BodyState, state: State | None) -> Plan:
        """Return the plan of the leg; see `SequenceLeg`."""
        n = mean_motion_of_state(chief.position_m, chief.velocity_m_s)
        if state is None:
            raise ScenarioError("drift: the first leg begins nowhere; give the sequence's position_m and velocity_m_s")
        return Plan(self.name, n, self.duration_s or 2.0 * np.pi / n, (make_coast(0.0, *state, n),))


def _take_operation(value: Any) -> Any:
    """Return the fields of an operation that stands where a leg is needed; leave anything else as it is."""
    if not isinstance(value, ProximityOperation) or isinstance(value, SequenceLeg):
        return value
    return {name: getattr(value, name) for name in value.model_fields_set} | {"type": value.name}


_DescribedLeg = Annotated[
    HopLeg
    | HoldLeg
    | PulsedHoldLeg
    | PerchLeg
    | DriftLeg
    | GlideslopeLeg
    | VBarLeg
    | RBarLeg
    | CoEllipticLeg
    | CircumnavigationLeg
    | SafetyEllipseLeg
    | TeardropLeg
    | ForcedCircumnavigationLeg
    | WaypointsLeg
    | LambertLeg,
    Field(discriminator="type"),
]
AnyLeg = Annotated[_DescribedLeg, BeforeValidator(_take_operation)]

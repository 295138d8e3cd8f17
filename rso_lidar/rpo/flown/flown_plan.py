"""The motion of a craft that flies a plan under real forces."""

from __future__ import annotations

import datetime
import functools
from collections.abc import Hashable, Mapping
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import BeforeValidator, Field

from rso_lidar.errors import ScenarioError
from rso_lidar.orbit import Epochs, ForceModel, Forces, Initial, Trajectory, find_center
from rso_lidar.part import Part, Vector, Whole, name_object
from rso_lidar.records import BodyState
from rso_lidar.rpo.flown.guidance import AnyGuidance, TwoImpulseGuidance
from rso_lidar.rpo.flown.plan_flight import FlightSettings, PlanFlight
from rso_lidar.rpo.flown.thrusters import NavigationErrors, Thrusters
from rso_lidar.rpo.limits import Velocity
from rso_lidar.rpo.navigation.relative_filter import RelativeFilter
from rso_lidar.rpo.plans.approach import CoElliptic, RBarApproach, StationKeeping, VBarApproach
from rso_lidar.rpo.plans.circumnavigation import Circumnavigation, ForcedCircumnavigation, SafetyEllipse, Teardrop
from rso_lidar.rpo.plans.free_holds import Perch, PulsedStationKeeping
from rso_lidar.rpo.plans.glideslope import Glideslope
from rso_lidar.rpo.plans.plan import Plan
from rso_lidar.rpo.plans.transfers import Hop, Lambert, Rendezvous, Waypoints
from rso_lidar.rpo.relative.reference_orbit import ReferenceOrbit
from rso_lidar.rpo.relative.relative_motion import RtnMotion
from rso_lidar.rpo.sequences.sequence import Sequence

AnyPlan = Annotated[
    StationKeeping
    | PulsedStationKeeping
    | Perch
    | VBarApproach
    | RBarApproach
    | Glideslope
    | Hop
    | CoElliptic
    | Circumnavigation
    | SafetyEllipse
    | Teardrop
    | ForcedCircumnavigation
    | Waypoints
    | Rendezvous
    | Lambert
    | Sequence,
    Field(discriminator="type"),
]


class RelativeStart(Part):
    """State of the craft at `start_utc`, before the first impulse, in the rtn axes of the body that is approached."""

    type: Literal["relative"] = "relative"
    position_m: Vector = Field(description="Position in the rtn axes of that body [m].")
    velocity_m_s: Velocity = Field(description="Velocity relative to those rotating axes [m/s].")


def _name_errors(value: object) -> object:
    """Return a table of navigation with its `type`, which may be left out for stated errors."""
    return {"type": "errors", **value} if isinstance(value, Mapping) and "type" not in value else value


_DescribedNavigation = Annotated[NavigationErrors | RelativeFilter, Field(discriminator="type")]
AnyNavigation = Annotated[_DescribedNavigation, BeforeValidator(_name_errors)]
AnyStart = Annotated[Initial | RelativeStart, Field(discriminator="type")]


class Flown(RtnMotion):
    """A plan of a proximity operation, flown by the forces that act, with real thrusters and corrections on the way.

    The craft and the body that is approached are integrated under forces, and the impulses and the held thrust of the
    plan act in the rtn axes of that body. A body with a `numerical` motion keeps its own forces and maneuvers. Any other
    body is propagated from its osculating state at `start_utc`, and the difference of the two orbits is applied in its
    actual axes (as `nonlinear` does).
    """

    type: Literal["flown"] = "flown"
    plan: AnyPlan = Field(description="Operation that is flown; its `relative_to` names the body that is approached.")
    forces: Forces | None = Field(
        default=None,
        description=(
            "Forces on the craft. If omitted, those of the body that is approached where its motion is `numerical`, "
            "else J2."
        ),
    )
    chief_forces: Forces | None = Field(
        default=None,
        description=(
            "Forces on the body that is approached, where its motion is not `numerical`. If omitted, those on the craft."
        ),
    )
    start: AnyStart | None = Field(
        default=None,
        description=(
            "State of the craft at `start_utc`, before the first impulse: `relative`, or an orbit such as `tle` or "
            "`ephemeris`. If omitted, the start of the plan."
        ),
    )
    thrusters: Thrusters = Field(default=Thrusters(), description="Burns and their errors. If omitted, exact impulses.")
    guidance: AnyGuidance | None = Field(
        default=None,
        description="Guidance that replans the impulses on the way. If omitted, the plan is flown blindly.",
    )
    navigation: AnyNavigation = Field(
        default=NavigationErrors(),
        description=(
            "State that guidance is given: the true one with stated `errors` (the type if none is given), or that of a "
            "`filter` on sensors. If omitted, the true one."
        ),
    )
    seed: Annotated[Whole, Field(ge=0, lt=2**63)] | None = Field(
        default=None,
        description="Seed of the errors of thrusters and navigation. If omitted, from the scenario's and the body's name.",
    )

    @property
    def relative_to(self) -> str:
        """Name of the body that is approached."""
        return self.plan.relative_to

    @property
    def keep_out_m(self) -> float:
        """Radius of the plan's keep-out sphere [m]."""
        return self.plan.keep_out_m

    def with_seed(self, seed: int) -> Self:
        """Return the motion with a seed of its errors, unless it has its own.

        Parameters
        ----------
        seed : that follows from the scenario's
        """
        return self.replace(seed=seed) if self.seed is None else self

    def without_random_errors(self) -> Self:
        """Return the motion with burns and navigation that have no random errors; constant errors of burns stay."""
        exact = dict.fromkeys(
            ("magnitude_sigma_fraction", "magnitude_sigma_m_s", "pointing_sigma_deg", "pointing_sigma_m_s"), 0.0
        )
        return self.replace(thrusters=self.thrusters.replace(**exact), navigation=NavigationErrors())

    def make_plan(self, start_utc: datetime.datetime, chief: Trajectory) -> Plan:
        """Return the plan that is flown.

        Parameters
        ----------
        start_utc : start of the plan
        chief : trajectory of the body that is approached
        """
        return self.plan.plan(start_utc, chief)

    def fly(self, start_utc: datetime.datetime, chief: Trajectory) -> PlanFlight:
        """Return the flight, which is integrated as far as it is asked for. The same flight is not integrated twice.

        Parameters
        ----------
        start_utc : start of the plan
        chief : trajectory of the body that is approached

        Raises
        ------
        ScenarioError
            if the plan cannot be carried out, or `chief_forces` contradict the motion of the body
        """
        try:
            hash(self)
        except TypeError:
            raise ScenarioError(
                f"guidance: {name_object(self.guidance)} has no hash, by which its flight is kept; make it a frozen "
                "dataclass"
            ) from None
        self.check_center(find_center(chief))
        model: ForceModel | None = getattr(chief, "force_model", None)
        if model is not None and self.chief_forces is not None:
            raise ScenarioError(
                f"chief_forces: the motion of '{self.relative_to}' is integrated with its own forces; leave chief_forces out"
            )
        forces = self.forces or (model.forces if model else Forces())
        around, maneuvers = (model.forces, model.maneuvers) if model else (self.chief_forces or forces, ())
        reference = ReferenceOrbit.from_chief(chief, start_utc, around, maneuvers)
        plan, stamps = self.make_plan(start_utc, chief), (forces.stamp_files(), around.stamp_files())
        flight: PlanFlight = _make_flight(self.replace(forces=forces), plan, reference, stamps)
        return flight

    def relative(self, epochs: Epochs, chief: Trajectory) -> tuple[np.ndarray, np.ndarray]:
        """Return position [m] and velocity [m/s] (time, 3) in the chief's rotating rtn axes."""
        return self.fly(epochs.start_utc, chief).relative(epochs.time_s)

    def breaks_s(self, epochs: Epochs, chief: Trajectory) -> np.ndarray:
        """Return the instants at which velocity or acceleration is discontinuous.

        Parameters
        ----------
        epochs : instants; maneuvers after the last are left out
        chief : trajectory of the body that is approached
        """
        return self.fly(epochs.start_utc, chief).breaks_s(float(epochs.time_s.max(initial=0.0)) + 10.0)

    def validity(self, epochs: Epochs, chief: Trajectory) -> list[str]:
        """Return one sentence for each way in which the flight is not what it should be."""
        flight = self.fly(epochs.start_utc, chief)
        own, around = flight.settings.forces, flight.reference.forces
        lines = []
        unlike = [
            name for name in ("zonal_degree", "gravity", "sun", "moon") if getattr(own, name) != getattr(around, name)
        ]
        if unlike:
            lines.append(
                f"flown: gravity differs between craft and '{self.relative_to}' ({', '.join(unlike)}), which moves them "
                "apart as nothing real does; give both the same"
            )
        if isinstance(self.navigation, RelativeFilter) and self.guidance is None:
            lines.append(
                "flown: without guidance the navigation filter has no effect; add guidance, or leave the filter out"
            )
        if isinstance(self.guidance, TwoImpulseGuidance):
            lines += self.guidance.list_limits(flight.plan.mean_motion_rad_s)
        try:
            self.plan.check_positions(epochs, chief, flight.relative(epochs.time_s)[0])
        except ScenarioError as inside:
            lines.append(f"flown: {str(inside).partition('; go ')[0]}; add guidance, or correct earlier")
        return lines

    def summarize(self, start_utc: datetime.datetime) -> str:
        """Return the motion in a few words.

        Parameters
        ----------
        start_utc : start of the run; not used
        """
        return f"{self.plan.type} flown" + (", with guidance," if self.guidance is not None else "")


@functools.lru_cache(maxsize=32)
def _make_flight(motion: Flown, plan: Plan, reference: ReferenceOrbit, _stamps: Hashable) -> PlanFlight:
    """Make the flight of a motion whose forces are known, anew where one of their files has changed."""
    assert motion.forces is not None
    settings = FlightSettings(motion.forces, motion.thrusters, motion.guidance, motion.navigation, motion.seed or 0)
    return PlanFlight(plan, reference, settings, _find_start(motion, reference))


def _find_start(motion: Flown, reference: ReferenceOrbit) -> BodyState | None:
    """Return the inertial state (3,) at the start; None for that of the plan."""
    if motion.start is None:
        return None
    if isinstance(motion.start, RelativeStart):
        return reference.place(np.array(motion.start.position_m), np.array(motion.start.velocity_m_s))
    state = motion.start.states(Epochs(reference.start_utc, np.zeros(1)))
    return BodyState(state.position_m[0], state.velocity_m_s[0])

"""Relative motion without approximation: the difference of two orbits under the same forces, in rotating rtn axes."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from pydantic import Field

from rso_lidar.errors import ScenarioError
from rso_lidar.orbit import (
    EARTH,
    CentralBody,
    Epochs,
    Forces,
    Impulse,
    Maneuver,
    Trajectory,
    describe_late_maneuvers,
    find_center,
    integrate_orbit,
    propagate_two_body,
)
from rso_lidar.records import BodyState
from rso_lidar.rpo.relative.hill import describe_flattening, find_start_state
from rso_lidar.rpo.relative.reference_orbit import ReferenceOrbit
from rso_lidar.rpo.relative.relative_motion import RelativeState

_POINT_MASS = Forces(zonal_degree=0)


class Nonlinear(RelativeState):
    """The difference of two orbits: the chief's, from its osculating state at `start_utc`, and the body's beside it.

    Both are propagated under the same `forces`, or by two-body motion without them. The body also follows its
    `maneuvers`. The difference is taken in the rtn axes of the chief thus propagated, not of its model (a TLE). It is
    then applied in the chief's actual axes. It is exact for any separation and eccentricity, except for forces left
    out. Both bodies have the same drag and light pressure per mass.
    """

    type: Literal["nonlinear"] = "nonlinear"
    forces: Forces | None = Field(
        default=None, description="Forces on both bodies, equal per mass. If omitted, two-body motion."
    )
    maneuvers: tuple[Maneuver, ...] = Field(
        default=(),
        description="Impulses and burns of this body, in any order. The axes `chief_rtn` are those of `relative_to`.",
    )

    def check_center(self, center: CentralBody) -> None:
        """Check that the forces, and the gravity during maneuvers, are those of the body about which the chief orbits."""
        if center is EARTH:
            return
        for key in ("forces", "maneuvers"):
            if getattr(self, key):
                raise ScenarioError(
                    f"{key}: are integrated with the Earth's gravity, and '{self.relative_to}' orbits about {center.name}; "
                    "leave them out"
                )

    def relative(self, epochs: Epochs, chief: Trajectory) -> tuple[np.ndarray, np.ndarray]:
        """Return position [m] and velocity [m/s] (time, 3) in the chief's rotating rtn axes."""
        forces = _POINT_MASS if self.forces is None and self.maneuvers else self.forces
        reference = ReferenceOrbit.from_chief(chief, epochs.start_utc, forces)
        start = reference.place(np.array(self.position_m), np.array(self.velocity_m_s))
        if forces is None:
            flown = propagate_two_body(start.position_m, start.velocity_m_s, epochs.time_s, reference.gm_m3_s2)
            return reference.express(BodyState(*flown), epochs)
        place = start.position_m, start.velocity_m_s, epochs.start_utc
        chief_orbit = reference.orbit if self.maneuvers else None
        rows = integrate_orbit(*place, forces, self.maneuvers, chief=chief_orbit)(epochs.time_s)
        return reference.express(BodyState(rows[:, :3], rows[:, 3:]), epochs)

    def breaks_s(self, epochs: Epochs, chief: Trajectory) -> np.ndarray:
        """Return the instants at which velocity or acceleration is discontinuous: those of the maneuvers."""
        return np.array([edge_s for maneuver in self.maneuvers for edge_s in maneuver.edges_s])

    def advise(self, end_s: float) -> list[str]:
        """Report maneuvers after the last frame.

        Parameters
        ----------
        end_s : time of the last frame [s]

        Returns
        -------
        one line of advice; empty if there are none
        """
        return describe_late_maneuvers(self.maneuvers, end_s)

    @property
    def impulses_s(self) -> tuple[float, ...]:
        """Instants of the impulses among the maneuvers [s]."""
        return tuple(maneuver.at_s for maneuver in self.maneuvers if isinstance(maneuver, Impulse))

    @property
    def delta_v_m_s(self) -> float:
        """Total delta-v of all maneuvers [m/s]."""
        return math.fsum(maneuver.size_m_s for maneuver in self.maneuvers)

    def validity(self, epochs: Epochs, chief: Trajectory) -> list[str]:
        """Return one sentence for each limit of the model that these epochs exceed, with a better choice."""
        if self.forces is not None:
            return []
        return describe_flattening(
            "nonlinear",
            epochs,
            *find_start_state(chief, epochs.start_utc),
            better="give it forces",
            center=find_center(chief),
        )

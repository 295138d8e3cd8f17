"""The flight that is dispersed: its path, its burns, its updates of guidance, and the axes of the body approached."""

from __future__ import annotations

import datetime
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from rso_lidar.orbit import Forces
from rso_lidar.rpo.flown.thrusters import NavigationErrors, Thrusters
from rso_lidar.rpo.navigation.relative_filter import RelativeFilter
from rso_lidar.rpo.plans.plan import PlannedImpulse


@dataclass(frozen=True)
class GuidanceInstant:
    """An update of guidance at `time_s` that corrects the path up to `aim_s` [s]."""

    time_s: float
    aim_s: float


@dataclass(frozen=True, eq=False)
class NominalFlight:
    """A flight without random errors.

    Parameters
    ----------
    start_utc : start of the run
    craft_m : function of instants (time,) [s] that returns the position (time, 3) [m] of the craft, inertial axes
    chief_axes : function of instants (time,) [s] that returns the rtn axes of the body approached, as columns (time, 3, 3)
        in inertial axes, and their angular velocity (time, 3) [rad/s] in rtn axes
    forces : whose gravity moves deviations
    burns : changes of velocity [m/s] in those rtn axes
    updates : updates of guidance
    held_s : spans (leg, 2) [s] that are held by thrust
    control_m_s2 : function of instants (time,) [s] that returns the thrust there (time, 3) [m/s2] in the rtn axes
    thrusters, navigation : whose random errors disperse the flight
    least_m_s : a correction smaller than this is not made [m/s]
    chief_m : function of instants (time,) [s] that returns the position (time, 3) [m] of the body approached, inertial
        axes; a filter needs it, and errors of that body do
    """

    start_utc: datetime.datetime
    craft_m: Callable[[np.ndarray], np.ndarray]
    chief_axes: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
    forces: Forces
    burns: tuple[PlannedImpulse, ...] = ()
    updates: tuple[GuidanceInstant, ...] = ()
    held_s: tuple[tuple[float, float], ...] = ()
    control_m_s2: Callable[[np.ndarray], np.ndarray] | None = None
    thrusters: Thrusters = field(default_factory=Thrusters)
    navigation: NavigationErrors | RelativeFilter = field(default_factory=NavigationErrors)
    least_m_s: float = 0.0
    chief_m: Callable[[np.ndarray], np.ndarray] | None = None

    def list_nodes_s(self, until_s: float, sample_s: np.ndarray) -> np.ndarray:
        """Return the instants (node,) [s] at which something happens or is sampled, from 0.

        Parameters
        ----------
        until_s : last instant [s]
        sample_s : (time,) instants of the samples [s]
        """
        ends = [edge for span in self.held_s for edge in span]
        events = [*(one.time_s for one in self.burns), *ends]
        events += [at_s for one in self.updates for at_s in (one.time_s, one.aim_s)]
        if isinstance(self.navigation, RelativeFilter):
            events += self.navigation.list_instants_s(0.0, until_s).tolist()
        inside = [at_s for at_s in events if 0.0 <= at_s <= until_s]
        nodes: np.ndarray = np.unique(np.concatenate([[0.0], inside, sample_s]))
        return nodes

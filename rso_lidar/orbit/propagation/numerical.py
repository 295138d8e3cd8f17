"""Numerical propagation: DOP853 (see `integrator`) on the forces of `forces`.

The integrator alone is within 1 mm of two-body motion over a day (1e-13 per step). `forces` lists what is left out.
"""

from __future__ import annotations

import datetime
import functools
import math
from collections.abc import Sequence
from typing import Annotated, Any, Literal, NamedTuple, Protocol, Self

import numpy as np
from pydantic import Field, model_validator

from rso_lidar import units
from rso_lidar.errors import PropagationError
from rso_lidar.orbit.ccsds.ephemeris import Ephemeris
from rso_lidar.orbit.epochs import Epochs
from rso_lidar.orbit.propagation.facet_model import AttitudeAlong, FacetForces, FindTable
from rso_lidar.orbit.propagation.forces import FileStamps, Forces
from rso_lidar.orbit.propagation.integrator import OdeSolution
from rso_lidar.orbit.propagation.j2 import J2
from rso_lidar.orbit.propagation.maneuver import Axes3, Burn, Impulse, describe_late_maneuvers
from rso_lidar.orbit.sets.sgp4_motion import Omm, Tle
from rso_lidar.orbit.two_body.kepler import Kepler, State
from rso_lidar.part import Part
from rso_lidar.records import BodyState

Maneuver = Annotated[Impulse | Burn, Field(discriminator="type")]
Initial = Annotated[Tle | Omm | Kepler | State | J2 | Ephemeris, Field(discriminator="type")]
_PANEL_S = 5400.0


class Thrust(Protocol):
    """A push over an interval, such as a burn."""

    @property
    def axes(self) -> Axes3:
        """Axes of the acceleration before it is turned into GCRS axes."""
        ...

    @property
    def from_s(self) -> float:
        """Start of the thrust since `start_utc` [s]."""
        ...

    @property
    def until_s(self) -> float:
        """End of the thrust since `start_utc` [s]."""
        ...

    @property
    def edges_s(self) -> tuple[float, ...]:
        """Instants at which the acceleration is not smooth [s]."""
        ...

    def acceleration(self, time_s: float, r: list[float], v: list[float]) -> tuple[float, float, float]:
        """Return the acceleration [m/s2] in inertial axes.

        Parameters
        ----------
        time_s : seconds since the start of the run
        r, v : position [m] and velocity [m/s] that define the axes
        """
        ...


class ForceModel(NamedTuple):
    """What an integrated motion is integrated with."""

    forces: Forces
    maneuvers: tuple[Impulse | Burn, ...]


class Numerical(Part):
    """Numerical integration from the state of `initial` at `start_utc`, with `forces` and `maneuvers`."""

    type: Literal["numerical"] = "numerical"
    initial: Initial = Field(
        description=(
            "Orbit that gives the state at `start_utc`: a `tle`, `omm`, `kepler`, `state`, `j2` or `ephemeris`. For a state "
            "relative to another body use the motion `nonlinear`."
        )
    )
    forces: Forces = Field(default=Forces(), description="Forces besides the central gravity.")
    maneuvers: tuple[Maneuver, ...] = Field(default=(), description="Impulses and burns, in any order.")

    @model_validator(mode="after")
    def _no_chief(self) -> Self:
        for k, maneuver in enumerate(self.maneuvers):
            if maneuver.axes == "chief_rtn":
                raise ValueError(
                    f"maneuvers[{k}].axes: 'chief_rtn' are the axes of another body, and 'numerical' is relative to none; "
                    "use 'rtn', 'vnc' or 'inertial', or the motion 'nonlinear'"
                )
        return self

    @property
    def facet_model(self) -> FacetForces | None:
        """Settings of sunlight and air on the facets of the body; None where they do not act."""
        return self.forces.facets

    def with_table(self, find_table: FindTable, attitude: AttitudeAlong) -> Self:
        """Return the motion of a body whose facets and attitude are known.

        Parameters
        ----------
        find_table, attitude : as for `FacetForces.with_table`
        """
        assert self.forces.facets is not None
        return self.replace(forces=self.forces.replace(facets=self.forces.facets.with_table(find_table, attitude)))

    @property
    def force_model(self) -> ForceModel:
        """Forces and maneuvers of the integration."""
        return ForceModel(self.forces, self.maneuvers)

    def states(self, epochs: Epochs) -> BodyState:
        """Return position [m] and velocity [m/s] (time, 3) in GCRS axes.

        Raises
        ------
        PropagationError
            if the orbit meets the Earth; its `bad` masks the later epochs
        """
        start = self.initial.states(Epochs(epochs.start_utc, np.zeros(1)))
        flight = integrate_orbit(
            start.position_m[0], start.velocity_m_s[0], epochs.start_utc, self.forces, self.maneuvers
        )
        rows = flight(epochs.time_s)
        return BodyState(rows[:, :3], rows[:, 3:])

    def breaks_s(self, epochs: Epochs) -> np.ndarray:
        """Return the times [s] since `start_utc` at which velocity or acceleration jumps: impulses, and ends of burns.

        Parameters
        ----------
        epochs : not used; maneuvers count from `start_utc`
        """
        return np.array([time_s for maneuver in self.maneuvers for time_s in maneuver.edges_s])

    def summarize(self, start_utc: datetime.datetime) -> str:
        """Return the motion in a few words: its initial state, forces and maneuvers.

        Parameters
        ----------
        start_utc : start of the run; not used
        """
        forces, count = self.forces, len(self.maneuvers)
        others = [name for name in ("drag", "radiation_pressure", "facets", "sun", "moon") if getattr(forces, name)]
        words = [forces.describe_gravity() or "a point", *(name.replace("_", " ") for name in others)]
        if count:
            words.append(f"{count} maneuver{'s' * (count > 1)} of {self.delta_v_m_s:.4g} m/s")
        return f"{self.type} from {self.initial.type}; {', '.join(words)}"

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


class IntegratedOrbit:
    """An integrated orbit: call it with seconds since `start_utc` (time,) for rows [position m, velocity m/s] (time, 6).

    Parameters
    ----------
    position_m, velocity_m_s : (3,) state at `begin_s` in GCRS axes [m], [m/s]
    start_utc : start of the run
    forces : forces besides the central attraction
    maneuvers : impulses from `begin_s` on, and burns or other thrust

    Other Parameters
    ----------------
    chief : orbit whose rtn axes are meant by the maneuvers' axes "chief_rtn"
    begin_s : time of the state, since `start_utc` [s]
    """

    def __init__(
        self,
        position_m: tuple[float, ...],
        velocity_m_s: tuple[float, ...],
        start_utc: datetime.datetime,
        forces: Forces,
        maneuvers: Sequence[Impulse | Thrust],
        chief: IntegratedOrbit | None = None,
        begin_s: float = 0.0,
    ) -> None:
        field, piece = forces.field(start_utc), forces.phase(start_utc)
        self._begin_s, self._chief = begin_s, chief
        # No orbit lasts in the air below 100 km, and re-entry is so stiff that its integration would take minutes.
        self._floor_m = 100.0 * units.KM if forces.has_air else 0.0
        floor_m2 = (units.EARTH_RADIUS_M + self._floor_m) ** 2
        impulses = [maneuver for maneuver in maneuvers if isinstance(maneuver, Impulse) and maneuver.at_s >= begin_s]
        burns = [maneuver for maneuver in maneuvers if not isinstance(maneuver, Impulse) and maneuver.until_s > begin_s]

        def derivative(t: float, x: np.ndarray) -> np.ndarray:
            rx, ry, rz, vx, vy, vz, _, *open_ = x.tolist()
            at_s = t + begin_s
            if rx * rx + ry * ry + rz * rz < floor_m2:
                raise _FallError(at_s)
            (ax, ay, az), rough = field(at_s, (rx, ry, rz), (vx, vy, vz))
            for burn, valve in zip(burns, open_, strict=True):
                if valve > 0.5 and t >= 0.0:
                    known = self._find_chief(burn.axes, at_s)
                    values = [rx, ry, rz, vx, vy, vz] if known is None else known.tolist()
                    bx, by, bz = burn.acceleration(at_s, values[:3], values[3:])
                    ax, ay, az = ax + bx, ay + by, az + bz
            return np.array([vx, vy, vz, ax, ay, az, rough, *([0.0] * len(burns))])

        # The seventh entry integrates the magnitude of discontinuous forces, with its own tolerance. Without it
        # DOP853, whose error estimate assumes smooth forces, would step over the edge of the shadow.
        # One entry for each burn states whether it is on: a step that ends where a burn begins must not contain it, and
        # the step that begins there must.
        start = np.array([*position_m, *velocity_m_s])
        for impulse in impulses:
            if impulse.at_s == begin_s:
                start = self._apply(impulse, start)
        jumps = [
            (impulse.at_s - begin_s, functools.partial(self._apply, impulse))
            for impulse in impulses
            if impulse.at_s > begin_s
        ]
        for k, burn in enumerate(burns, start=7):
            jumps.append((burn.until_s - begin_s, functools.partial(_set_entry, k, 0.0)))
            if burn.from_s > begin_s:
                jumps.append((burn.from_s - begin_s, functools.partial(_set_entry, k, 1.0)))
        self._solution = OdeSolution(
            derivative,
            np.array([*start, 0.0, *(float(burn.from_s <= begin_s) for burn in burns)]),
            panel_s=_PANEL_S,
            rtol=1e-13,
            atol=np.array([1e-6] * 3 + [1e-9] * 3 + [1e-11] + [1.0] * len(burns)),
            jumps=jumps,
            breaks=[edge_s - begin_s for burn in burns for edge_s in burn.edges_s],
            phase=None if piece is None else lambda t, x: piece(t + begin_s, tuple(x[:3].tolist())),
            name="numerical",
        )

    def __call__(self, time_s: np.ndarray) -> np.ndarray:
        """Return rows [position m, velocity m/s] (time, 6)."""
        times = np.atleast_1d(np.asarray(time_s, dtype=float))
        try:
            return self._solution(times - self._begin_s)[:, :6]
        except _FallError as fall:
            by_s = float(fall.args[0])
            way = 1.0 if by_s >= self._begin_s else -1.0
            bad = way * times >= way * by_s
            where = f"falls below {self._floor_m / units.KM:g} km" if self._floor_m else "meets the Earth"
            raise PropagationError(
                f"numerical: {where} by {by_s:.0f} s after the start, before {int(bad.sum())} of {len(bad)} epochs; end the "
                "run before that, or raise the orbit",
                bad,
            ) from None

    def _find_chief(self, axes: Axes3, time_s: float) -> np.ndarray | None:
        """Return the state (6,) of the chief if its axes are meant, else None."""
        if axes != "chief_rtn":
            return None
        assert self._chief is not None, "maneuvers in the axes of a chief need one"
        row: np.ndarray = self._chief(np.array([time_s]))[0]
        return row

    def _apply(self, impulse: Impulse, state: np.ndarray) -> np.ndarray:
        return impulse.apply(state, self._find_chief(impulse.axes, impulse.at_s))


class _FallError(Exception):
    """The orbit meets the ground or dense air; the argument is the time [s]."""


def integrate_orbit(
    position_m: np.ndarray,
    velocity_m_s: np.ndarray,
    start_utc: datetime.datetime,
    forces: Forces,
    maneuvers: Sequence[Impulse | Thrust] = (),
    *,
    chief: IntegratedOrbit | None = None,
    begin_s: float = 0.0,
) -> IntegratedOrbit:
    """Integrate an orbit from a state. The result is cached, so the same call costs nothing twice.

    Parameters
    ----------
    position_m, velocity_m_s : (3,) state at `begin_s` in GCRS axes [m], [m/s]
    start_utc : start of the run
    forces : forces besides the central attraction
    maneuvers : impulses from `begin_s` on, and burns or other thrust

    Other Parameters
    ----------------
    chief : orbit whose rtn axes are meant by the maneuvers' axes "chief_rtn"
    begin_s : time of the state, since `start_utc` [s]

    Returns
    -------
    IntegratedOrbit
        called with seconds since `start_utc` (time,), it returns rows [position m, velocity m/s] (time, 6)

    Raises
    ------
    PropagationError
        from that call, where the orbit meets the Earth; its `bad` masks the later epochs
    """
    position, velocity = np.asarray(position_m, dtype=float).tolist(), np.asarray(velocity_m_s, dtype=float).tolist()
    arguments = (tuple(position), tuple(velocity), start_utc, forces, tuple(maneuvers), chief, begin_s)
    return _integrated_orbit(forces.stamp_files(), *arguments)


@functools.lru_cache(maxsize=64)
def _integrated_orbit(_stamps: FileStamps, *arguments: Any) -> IntegratedOrbit:
    """Integrate an orbit, anew where a file of its forces has changed."""
    return IntegratedOrbit(*arguments)


def _set_entry(entry: int, value: float, state: np.ndarray) -> np.ndarray:
    """Return a copy of a state (n,) with one entry replaced."""
    after = np.array(state)
    after[entry] = value
    return after

"""A slew from one attitude law to another, within limits of rate and acceleration.

R(t) = A(t) exp(s(t) theta(t)), theta = log(A(t)^-1 B(t)): at every instant about the one axis that leads from the first
law A to the second law B, both of which may move; s rises from 0 to 1 with constant acceleration, constant rate and
constant deceleration. Body rates are exact, by the right Jacobian of the rotation group (Sola et al. 2018, eq. 143).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import Field

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.motion.attitudes.law import AnyLaw
from rso_lidar.motion.attitudes.situation import Orientation, Situation, laws_of, orient
from rso_lidar.orbit.epochs import Epochs
from rso_lidar.part import Number, Part, Positive
from rso_lidar.pose import rotate_vectors

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

_STEPS = 48  # of the grid on which limits are kept, in each of the three phases
_SLACK = 1e-6  # by which rounding may pass a limit, as a share of it
_HALF_TURN_WITHIN_RAD = 1e-9
_LEAST_RAMP_S = 1e-3  # no slew is shorter than twice this, however small its turn
_TRIALS = 60


class Slew(Part):
    """Attitude `first` until `at_s`, then a slew to attitude `then`, which may move, and `then` from there on.

    The turn is the shorter way about the axis that joins the two at `at_s`, and keeps to that way; at half a turn, to
    1e-9 rad, it goes about the axis whose largest component in body axes is positive. The whole body rate and angular
    acceleration in root axes, the laws' own included, keep the limits during the slew, on a grid of 144 steps: the slew
    is made as long as that needs, within some per cent. A law that itself turns faster than the limits is an error.
    """

    type: Literal["slew"] = "slew"
    first: AnyLaw = Field(description="Attitude until `at_s`.")
    then: AnyLaw = Field(description="Attitude after the slew; it may move.")
    at_s: Annotated[Number, Field(ge=-1e8, le=1e8)] = Field(
        description="Start of the slew, in seconds since `start_utc` [s]."
    )
    max_rate_deg_s: Positive = Field(
        description="Greatest total body rate in root axes, the rates of both attitudes included [deg/s]."
    )
    max_acceleration_deg_s2: Positive = Field(description="Greatest total angular acceleration in root axes [deg/s²].")

    @property
    def laws(self) -> tuple[Any, ...]:
        """The attitudes that the slew leads between."""
        return (*laws_of(self.first), *laws_of(self.then))

    def advise(self, end_s: float) -> list[str]:
        """Return a line where the slew begins after the last frame, at `end_s` [s]."""
        if self.at_s <= end_s:
            return []
        return [f"its slew begins at {self.at_s:g} s, after the last frame at {end_s:g} s; shift at_s"]

    def orient(self, here: Situation) -> Orientation:
        """Return how the body is turned, in root axes: as `first` or `then` before and after the slew, to rounding."""
        from scipy.spatial.transform import Rotation

        time_s = here.epochs.time_s
        begun = time_s > self.at_s
        over = begun.copy()
        quaternion, rate = np.empty((len(time_s), 4)), np.empty((len(time_s), 3))
        if begun.any():
            profile = self.plan(here)
            over &= time_s >= profile.end_s
            during = begun & ~over
            if during.any():
                there = select_epochs(here, during)
                rotation, rate[during] = profile.orient(time_s[during], *self._evaluate_laws(there))
                quaternion[during] = rotation.as_quat()
        for law, which in ((self.first, ~begun), (self.then, over)):  # a law is asked only about its own time
            if which.any():
                there = select_epochs(here, which)
                laid = _EvaluatedLaw.of(orient(law, there), there)
                quaternion[which], rate[which] = laid.rotation.as_quat(), laid.rate_rad_s
        return Orientation(Rotation.from_quat(quaternion), rate)

    def end_s(self, here: Situation) -> float:
        """Return when the slew is over [s]."""
        return self.plan(here).end_s

    def plan(self, here: Situation) -> SlewProfile:
        """Return when and how the body slews; it does not depend on the epochs of `here`."""
        limit = np.array([self.max_rate_deg_s, self.max_acceleration_deg_s2]) * units.DEG
        start = self._evaluate_laws(self._situation_at(here, np.array([self.at_s])))
        theta = _initial_rotvec(start[0].rotation, start[1].rotation)
        angle = float(np.linalg.norm(theta))
        profile = SlewProfile.fastest(self.at_s, angle, *limit)
        for _ in range(_TRIALS):
            grid_s = profile.grid_s()
            laws = self._evaluate_laws(self._situation_at(here, grid_s))
            profile = profile.with_way(_unwrap(_relative_rotvec(*laws), theta))
            demand = _peak_demand(grid_s, profile.orient(grid_s, *laws)[1])
            if np.all(demand <= limit * (1.0 + _SLACK)):
                return profile
            own = np.max([_peak_demand(grid_s, law.rate_rad_s) for law in laws], axis=0)
            if np.any(own >= limit):
                k = int(np.argmax(own / limit))
                what, unit = (("rate", "deg/s"), ("acceleration", "deg/s2"))[k]
                raise ScenarioError(
                    f"slew: a law that it leads between itself reaches {own[k] / units.DEG:.4g} {unit}, and max_{what} is "
                    f"{limit[k] / units.DEG:.4g} {unit}: raise the limit, or choose slower laws"
                )
            # The laws' share stays as the slew is stretched; the rest falls as 1/k in rate, as 1/k^2 in acceleration.
            more = np.maximum(demand - own, 0.0) / (limit - own)
            profile = profile.stretch(max(1.005, min(float(more[0]), 4.0), min(math.sqrt(more[1]), 4.0)))
        raise ScenarioError(
            "slew: no duration keeps its limits, for the laws that it leads between almost reach them: raise max_rate_deg_s "
            "or max_acceleration_deg_s2"
        )

    def _situation_at(self, here: Situation, grid_s: np.ndarray) -> Situation:
        return here.at(Epochs(here.epochs.start_utc, grid_s))

    def _evaluate_laws(self, here: Situation) -> tuple[_EvaluatedLaw, _EvaluatedLaw]:
        return _EvaluatedLaw.of(orient(self.first, here), here), _EvaluatedLaw.of(orient(self.then, here), here)


@dataclass(frozen=True, eq=False)
class _EvaluatedLaw:
    """A law laid out over epochs: root_from_body (time) and the body rate (time, 3) [rad/s]."""

    rotation: Rotation
    rate_rad_s: np.ndarray

    @staticmethod
    def of(turn: Orientation, here: Situation) -> _EvaluatedLaw:
        """Return a turn laid out over the epochs, in root axes."""
        from scipy.spatial.transform import Rotation

        rotation, rate, n = turn.rotation, turn.rate_rad_s, len(here.epochs)
        if turn.in_origin:
            rate = rate + rotate_vectors(rotation.inv(), here.origin_rate_rad_s)
            rotation = here.root_from_origin * rotation
        quaternion = np.broadcast_to(rotation.as_quat(), (n, 4))
        return _EvaluatedLaw(Rotation.from_quat(quaternion), np.array(np.broadcast_to(rate, (n, 3))))


def select_epochs(here: Situation, which: np.ndarray) -> Situation:
    """Return a situation at some of its epochs, which a mask picks."""
    if which.all():
        return here

    def line(name: str) -> tuple[np.ndarray, np.ndarray]:
        toward, moving = here.line(name)
        return toward[which], moving[which]

    return replace(
        here,
        epochs=here.epochs.at(which),
        position_m=here.position_m[which],
        velocity_m_s=here.velocity_m_s[which],
        root_from_origin=here.root_from_origin if here.root_from_origin.single else here.root_from_origin[which],
        origin_rate_rad_s=here.origin_rate_rad_s[which],
        sun_m=None if here.sun_m is None else here.sun_m[which],
        line=line,
    )


@dataclass(frozen=True, eq=False)
class SlewProfile:
    """When a slew takes place [s]: from `start_s`, speeding up and slowing down for `ramp_s` each, over at `end_s`.

    `way` (grid, 3) [rad] is the turn that is left to the second law at `grid_s`, which tells the way round elsewhere.
    """

    start_s: float
    ramp_s: float
    coast_s: float
    way: np.ndarray | None = None

    @staticmethod
    def fastest(start_s: float, angle_rad: float, rate_rad_s: float, acceleration_rad_s2: float) -> SlewProfile:
        """Return the quickest turn by an angle: a trapezoid of rate, or a triangle where it never reaches its limit."""
        ramp_s = min(rate_rad_s / acceleration_rad_s2, math.sqrt(angle_rad / acceleration_rad_s2))
        ramp_s = max(ramp_s, _LEAST_RAMP_S)
        coast_s = angle_rad / (acceleration_rad_s2 * ramp_s) - ramp_s
        return SlewProfile(start_s, ramp_s, coast_s if coast_s > 1e-6 * ramp_s else 0.0)

    @property
    def end_s(self) -> float:
        """Return when it is over [s]."""
        return self.start_s + 2.0 * self.ramp_s + self.coast_s

    def stretch(self, factor: float) -> SlewProfile:
        """Return it made longer, the shape kept."""
        return SlewProfile(self.start_s, self.ramp_s * factor, self.coast_s * factor)

    def with_way(self, way: np.ndarray) -> SlewProfile:
        """Return it with its way round."""
        return SlewProfile(self.start_s, self.ramp_s, self.coast_s, way)

    def grid_s(self) -> np.ndarray:
        """Return instants from start to end, the edges of its phases among them [s]."""
        steps = np.arange(_STEPS) / _STEPS
        coast = self.start_s + self.ramp_s + steps * self.coast_s if self.coast_s > 0.0 else np.empty(0)
        late = self.end_s - self.ramp_s
        return np.concatenate([self.start_s + steps * self.ramp_s, coast, late + steps * self.ramp_s, [self.end_s]])

    def share(self, time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return s (time), 0 to 1, and its rate [1/s]."""
        ramp, coast = self.ramp_s, self.coast_s
        top = 1.0 / (ramp + coast)
        since = np.clip(time_s - self.start_s, 0.0, 2.0 * ramp + coast)
        left = 2.0 * ramp + coast - since
        up, down = since < ramp, left < ramp
        near = np.where(up, since, left)
        share = np.where(up | down, 0.5 * top * near**2 / ramp, 0.0)
        share = np.where(up, share, np.where(down, 1.0 - share, top * (since - 0.5 * ramp)))
        return share, np.where(up | down, top * near / ramp, top)

    def orient(self, time_s: np.ndarray, a: _EvaluatedLaw, b: _EvaluatedLaw) -> tuple[Rotation, np.ndarray]:
        """Return root_from_body and body rates (time, 3) [rad/s] between the two laws."""
        from scipy.spatial.transform import Rotation

        theta = _relative_rotvec(a, b)
        if self.way is not None:
            grid_s = self.grid_s()
            row = np.clip(np.searchsorted(grid_s, time_s, side="right") - 1, 0, len(grid_s) - 2)
            part = ((time_s - grid_s[row]) / (grid_s[row + 1] - grid_s[row]))[:, None]
            theta = _pick_nearer(theta, self.way[row] + part * (self.way[row + 1] - self.way[row]))
        share, share_rate = self.share(time_s)
        whole = Rotation.from_rotvec(theta)
        theta_rate = _jacobian_inverse(theta, b.rate_rad_s - rotate_vectors(whole.inv(), a.rate_rad_s))
        phi = share[:, None] * theta
        part_turn = Rotation.from_rotvec(phi)
        phi_rate = share_rate[:, None] * theta + share[:, None] * theta_rate
        return a.rotation * part_turn, rotate_vectors(part_turn.inv(), a.rate_rad_s) + _jacobian(phi, phi_rate)


def _relative_rotvec(a: _EvaluatedLaw, b: _EvaluatedLaw) -> np.ndarray:
    rotvec: np.ndarray = (a.rotation.inv() * b.rotation).as_rotvec()
    return rotvec


def _initial_rotvec(a: Rotation, b: Rotation) -> np.ndarray:
    """Return the turn (3,) [rad] from one attitude to another, of two equally long ones always the same."""
    theta: np.ndarray = (a.inv() * b).as_rotvec()[0]
    if np.linalg.norm(theta) > np.pi - _HALF_TURN_WITHIN_RAD and theta[np.argmax(np.abs(theta))] < 0.0:
        theta = _other_way(theta[None])[0]
    return theta


def _other_way(theta: np.ndarray) -> np.ndarray:
    """Return the turns (time, 3) [rad] the other way round to the same attitude."""
    angle = np.maximum(np.linalg.norm(theta, axis=-1, keepdims=True), 1e-300)
    other: np.ndarray = theta * ((angle - 2.0 * np.pi) / angle)
    return other


def _pick_nearer(theta: np.ndarray, guide: np.ndarray) -> np.ndarray:
    """Return of the two ways round the one that is nearer to a guide (time, 3) [rad]."""
    other = _other_way(theta)
    closer = np.sum((other - guide) ** 2, axis=-1) < np.sum((theta - guide) ** 2, axis=-1)
    return np.where(closer[:, None], other, theta)


def _unwrap(theta: np.ndarray, first: np.ndarray) -> np.ndarray:
    """Return turns along a grid (grid, 3) [rad], each the way round that is nearer to the one before."""
    way, before = np.empty_like(theta), first
    for k in range(len(theta)):
        before = way[k] = _pick_nearer(theta[k : k + 1], before[None])[0]
    return way


def _peak_demand(grid_s: np.ndarray, rate_rad_s: np.ndarray) -> np.ndarray:
    """Return the largest rate [rad/s] and the largest mean acceleration of a step [rad/s2] on a grid."""
    steps = np.linalg.norm(np.diff(rate_rad_s, axis=0), axis=1) / np.diff(grid_s)
    return np.array([np.linalg.norm(rate_rad_s, axis=1).max(), steps.max()])


def _jacobian(phi: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """Return J_r(phi) rate (time, 3): the body rate of exp(phi) where phi changes at a rate."""
    angle = np.linalg.norm(phi, axis=-1, keepdims=True)
    small = angle < 1e-3
    safe = np.where(small, 1.0, angle)
    first = np.where(small, 0.5 - angle**2 / 24.0, 2.0 * np.sin(safe / 2.0) ** 2 / safe**2)
    second = np.where(small, 1.0 / 6.0 - angle**2 / 120.0, (safe - np.sin(safe)) / safe**3)
    once = np.cross(phi, rate)
    product: np.ndarray = rate - first * once + second * np.cross(phi, once)
    return product


def _jacobian_inverse(theta: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """Return J_r(theta)^-1 rate (time, 3): how fast log R changes where R has a body rate; not at a whole turn."""
    angle = np.linalg.norm(theta, axis=-1, keepdims=True)
    small = angle < 1e-3
    safe = np.where(small, 1.0, angle)
    second = np.where(small, 1.0 / 12.0 + angle**2 / 720.0, (1.0 - safe / 2.0 / np.tan(safe / 2.0)) / safe**2)
    once = np.cross(theta, rate)
    product: np.ndarray = rate + 0.5 * once + second * np.cross(theta, once)
    return product

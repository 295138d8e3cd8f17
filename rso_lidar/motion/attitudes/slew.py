"""A slew from one attitude law to another, within limits of rate and acceleration.

R(t) = A(t) exp(s(t) theta(t)), theta = log(A(t)^-1 B(t)). At every instant the rotation is about the single axis that
leads from the first law A to the second law B; both may move. s rises from 0 to 1 with constant acceleration, constant
rate and constant deceleration. Body rates are exact, by the right Jacobian of the rotation group (Sola et al. 2018,
eq. 143).
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
from rso_lidar.orbit import Epochs
from rso_lidar.part import Number, Part, Positive
from rso_lidar.pose import rotate_vectors

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

_STEPS = 48  # steps in each of the three phases, of the grid on which the limits are checked
_SLACK = 1e-6  # relative tolerance of the limits, for rounding
_HALF_TURN_WITHIN_RAD = 1e-9
_LEAST_RAMP_S = 1e-3  # half of the shortest slew, so that a zero angle does not divide by zero
_TRIALS = 60


class Slew(Part):
    """Attitude `first` until `at_s`, then a slew to the attitude `then`, which may move.

    The slew takes the shorter way about the axis that joins the two attitudes at `at_s`, and keeps that direction. At
    half a turn, within 1e-9 rad, it uses the axis whose largest component in body axes is positive.

    The limits hold for the total body rate and angular acceleration in root axes, those of the laws included. They are
    checked on a grid of 144 steps, and the slew is lengthened until it meets them, within a few per cent. A law that
    itself exceeds the limits is an error.
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
        """Attitudes between which the slew leads."""
        return (*laws_of(self.first), *laws_of(self.then))

    def advise(self, end_s: float) -> list[str]:
        """Report a slew that begins after the last frame.

        Parameters
        ----------
        end_s : time of the last frame [s]

        Returns
        -------
        one line of advice; none if the slew begins in time
        """
        if self.at_s <= end_s:
            return []
        return [f"its slew begins at {self.at_s:g} s, after the last frame at {end_s:g} s; shift at_s"]

    def orient(self, situation: Situation) -> Orientation:
        """Compute the attitude in root axes; before and after the slew it is that of `first` or `then`, to rounding."""
        from scipy.spatial.transform import Rotation

        time_s = situation.epochs.time_s
        begun = time_s > self.at_s
        over = begun.copy()
        quaternion, rate = np.empty((len(time_s), 4)), np.empty((len(time_s), 3))
        if begun.any():
            profile = self.plan(situation)
            over &= time_s >= profile.end_s
            during = begun & ~over
            if during.any():
                there = select_epochs(situation, during)
                rotation, rate[during] = profile.orient(time_s[during], *self._evaluate_laws(there))
                quaternion[during] = rotation.as_quat()
        for law, which in ((self.first, ~begun), (self.then, over)):  # a law may be undefined outside its own time
            if which.any():
                there = select_epochs(situation, which)
                evaluated = _EvaluatedLaw.of(orient(law, there), there)
                quaternion[which], rate[which] = evaluated.rotation.as_quat(), evaluated.rate_rad_s
        return Orientation(Rotation.from_quat(quaternion), rate)

    def end_s(self, situation: Situation) -> float:
        """Compute the end of the slew.

        Parameters
        ----------
        situation : of the body, at any epochs

        Returns
        -------
        end of the slew [s]
        """
        return self.plan(situation).end_s

    def plan(self, situation: Situation) -> SlewProfile:
        """Plan the slew. The result does not depend on the epochs of the situation.

        Parameters
        ----------
        situation : of the body, at any epochs

        Returns
        -------
        timing of the slew, which meets the limits

        Raises
        ------
        ScenarioError
            If one of the two laws alone exceeds a limit, or if no duration meets the limits
        """
        limit = np.array([self.max_rate_deg_s, self.max_acceleration_deg_s2]) * units.DEG
        start = self._evaluate_laws(self._situation_at(situation, np.array([self.at_s])))
        theta = _initial_rotvec(start[0].rotation, start[1].rotation)
        angle = float(np.linalg.norm(theta))
        profile = SlewProfile.fastest(self.at_s, angle, *limit)
        for _ in range(_TRIALS):
            grid_s = profile.grid_s()
            laws = self._evaluate_laws(self._situation_at(situation, grid_s))
            profile = replace(profile, way=_unwrap(_relative_rotvec(*laws), theta))
            demand = _peak_demand(grid_s, profile.orient(grid_s, *laws)[1])
            if np.all(demand <= limit * (1.0 + _SLACK)):
                return profile
            own = np.max([_peak_demand(grid_s, law.rate_rad_s) for law in laws], axis=0)
            if np.any(own >= limit):
                k = int(np.argmax(own / limit))
                what, unit = (("rate", "deg/s"), ("acceleration", "deg/s2"))[k]
                raise ScenarioError(
                    f"slew: one of its two laws alone reaches {own[k] / units.DEG:.4g} {unit}, and max_{what} is "
                    f"{limit[k] / units.DEG:.4g} {unit}; raise the limit, or choose slower laws"
                )
            # Stretching leaves the laws' share; the rest falls as 1/k in rate and as 1/k^2 in acceleration.
            more = np.maximum(demand - own, 0.0) / (limit - own)
            profile = profile.stretch(max(1.005, min(float(more[0]), 4.0), min(math.sqrt(more[1]), 4.0)))
        raise ScenarioError(
            "slew: no duration meets its limits, because its two laws almost reach them; raise max_rate_deg_s or "
            "max_acceleration_deg_s2"
        )

    def _situation_at(self, situation: Situation, grid_s: np.ndarray) -> Situation:
        return situation.at(Epochs(situation.epochs.start_utc, grid_s))

    def _evaluate_laws(self, situation: Situation) -> tuple[_EvaluatedLaw, _EvaluatedLaw]:
        return _EvaluatedLaw.of(orient(self.first, situation), situation), _EvaluatedLaw.of(
            orient(self.then, situation), situation
        )


@dataclass(frozen=True, eq=False)
class _EvaluatedLaw:
    """A law evaluated at epochs: root_from_body (time) and the body rate (time, 3) [rad/s]."""

    rotation: Rotation
    rate_rad_s: np.ndarray

    @staticmethod
    def of(turn: Orientation, situation: Situation) -> _EvaluatedLaw:
        """Convert an orientation to root axes, with one entry for each epoch."""
        from scipy.spatial.transform import Rotation

        rotation, rate, n = turn.rotation, turn.rate_rad_s, len(situation.epochs)
        if turn.in_origin:
            rate = rate + rotate_vectors(rotation.inv(), situation.origin_rate_rad_s)
            rotation = situation.root_from_origin * rotation
        quaternion = np.broadcast_to(rotation.as_quat(), (n, 4))
        return _EvaluatedLaw(Rotation.from_quat(quaternion), np.array(np.broadcast_to(rate, (n, 3))))


def select_epochs(situation: Situation, which: np.ndarray) -> Situation:
    """Restrict a situation to the epochs that a mask (time) selects."""
    if which.all():
        return situation

    def line(name: str) -> tuple[np.ndarray, np.ndarray]:
        toward, moving = situation.line(name)
        return toward[which], moving[which]

    return replace(
        situation,
        epochs=situation.epochs.at(which),
        position_m=situation.position_m[which],
        velocity_m_s=situation.velocity_m_s[which],
        root_from_origin=situation.root_from_origin
        if situation.root_from_origin.single
        else situation.root_from_origin[which],
        origin_rate_rad_s=situation.origin_rate_rad_s[which],
        sun_m=None if situation.sun_m is None else situation.sun_m[which],
        line=line,
    )


@dataclass(frozen=True, eq=False)
class SlewProfile:
    """Timing of a slew: acceleration, constant rate, deceleration.

    Parameters
    ----------
    start_s : start of the slew [s]
    ramp_s : duration of the acceleration, and of the deceleration [s]
    coast_s : duration of the constant rate [s]
    way : rotation vectors (grid, 3) from the first law to the second at `grid_s` [rad]. They decide which of the two
        ways round applies between; None for the shorter
    """

    start_s: float
    ramp_s: float
    coast_s: float
    way: np.ndarray | None = None

    @staticmethod
    def fastest(start_s: float, angle_rad: float, rate_rad_s: float, acceleration_rad_s2: float) -> SlewProfile:
        """Plan the fastest rotation: a trapezoid of rate, or a triangle if the rate limit is not reached.

        Returns
        -------
        the profile, with a ramp of at least 1 ms
        """
        ramp_s = min(rate_rad_s / acceleration_rad_s2, math.sqrt(angle_rad / acceleration_rad_s2))
        ramp_s = max(ramp_s, _LEAST_RAMP_S)
        coast_s = angle_rad / (acceleration_rad_s2 * ramp_s) - ramp_s
        return SlewProfile(start_s, ramp_s, coast_s if coast_s > 1e-6 * ramp_s else 0.0)

    @property
    def end_s(self) -> float:
        """End of the slew [s]."""
        return self.start_s + 2.0 * self.ramp_s + self.coast_s

    def stretch(self, factor: float) -> SlewProfile:
        """Return a profile of the same shape, longer by a factor."""
        return SlewProfile(self.start_s, self.ramp_s * factor, self.coast_s * factor)

    def grid_s(self) -> np.ndarray:
        """Return instants from start to end, the limits of the phases included [s]."""
        steps = np.arange(_STEPS) / _STEPS
        coast = self.start_s + self.ramp_s + steps * self.coast_s if self.coast_s > 0.0 else np.empty(0)
        late = self.end_s - self.ramp_s
        return np.concatenate([self.start_s + steps * self.ramp_s, coast, late + steps * self.ramp_s, [self.end_s]])

    def share(self, time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the completed share s (time), 0 to 1, and its rate [1/s]."""
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
        """Interpolate between two laws.

        Parameters
        ----------
        time_s : instants (time) [s]
        a, b : first and second law at these instants

        Returns
        -------
        root_from_body (time), and body rates (time, 3) [rad/s]
        """
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
    """Return the rotation vector (3,) [rad] from one attitude to another, with a fixed choice at half a turn."""
    theta: np.ndarray = (a.inv() * b).as_rotvec()[0]
    if np.linalg.norm(theta) > np.pi - _HALF_TURN_WITHIN_RAD and theta[np.argmax(np.abs(theta))] < 0.0:
        theta = _other_way(theta[None])[0]
    return theta


def _other_way(theta: np.ndarray) -> np.ndarray:
    """Return the rotation vectors (time, 3) [rad] the other way round to the same attitude."""
    angle = np.maximum(np.linalg.norm(theta, axis=-1, keepdims=True), 1e-300)
    other: np.ndarray = theta * ((angle - 2.0 * np.pi) / angle)
    return other


def _pick_nearer(theta: np.ndarray, guide: np.ndarray) -> np.ndarray:
    """Choose for each rotation vector the way round that is closer to a guide (time, 3) [rad]."""
    other = _other_way(theta)
    closer = np.sum((other - guide) ** 2, axis=-1) < np.sum((theta - guide) ** 2, axis=-1)
    return np.where(closer[:, None], other, theta)


def _unwrap(theta: np.ndarray, first: np.ndarray) -> np.ndarray:
    """Make rotation vectors (grid, 3) [rad] continuous: each takes the way round closer to the previous one."""
    way, before = np.empty_like(theta), first
    for k in range(len(theta)):
        before = way[k] = _pick_nearer(theta[k : k + 1], before[None])[0]
    return way


def _peak_demand(grid_s: np.ndarray, rate_rad_s: np.ndarray) -> np.ndarray:
    """Find the largest rate [rad/s] and the largest mean acceleration of a step [rad/s2] on a grid."""
    steps = np.linalg.norm(np.diff(rate_rad_s, axis=0), axis=1) / np.diff(grid_s)
    return np.array([np.linalg.norm(rate_rad_s, axis=1).max(), steps.max()])


def _jacobian(phi: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """Return J_r(phi) rate (time, 3): the body rate of exp(phi) if phi changes at `rate`."""
    angle = np.linalg.norm(phi, axis=-1, keepdims=True)
    small = angle < 1e-3
    safe = np.where(small, 1.0, angle)
    first = np.where(small, 0.5 - angle**2 / 24.0, 2.0 * np.sin(safe / 2.0) ** 2 / safe**2)
    second = np.where(small, 1.0 / 6.0 - angle**2 / 120.0, (safe - np.sin(safe)) / safe**3)
    once = np.cross(phi, rate)
    product: np.ndarray = rate - first * once + second * np.cross(phi, once)
    return product


def _jacobian_inverse(theta: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """Return J_r(theta)^-1 rate (time, 3): the rate of log R for a body rate of R; singular at a whole turn."""
    angle = np.linalg.norm(theta, axis=-1, keepdims=True)
    small = angle < 1e-3
    safe = np.where(small, 1.0, angle)
    second = np.where(small, 1.0 / 12.0 + angle**2 / 720.0, (1.0 - safe / 2.0 / np.tan(safe / 2.0)) / safe**2)
    once = np.cross(theta, rate)
    product: np.ndarray = rate + 0.5 * once + second * np.cross(theta, once)
    return product

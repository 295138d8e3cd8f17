"""Attitudes relative to the Sun: an axis toward the Sun, and nadir pointing with yaw steering."""

from __future__ import annotations

from typing import ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from rso_lidar.errors import PropagationError, ScenarioError
from rso_lidar.motion.attitudes.look_at import PARALLEL_RAD, aim_axes
from rso_lidar.motion.attitudes.situation import Orientation, Situation
from rso_lidar.orbit import format_utc, rtn_from_lvlh_ccsds, sun_position_m
from rso_lidar.part import Direction, Flag, Part, Vector
from rso_lidar.pose import euler_zyx, rotate_vectors

_STEP_S = 64.0  # step of the difference that gives the Sun's own rate; rounding leaves 1e-15 rad/s


class SunPointing(Part):
    """Attitude with body `axis` toward the Sun, and body `up_axis` as close to `up` (root axes) as possible.

    By default `up` is the orbit normal, or the root's +z without an orbit.
    """

    type: Literal["sun_pointing"] = "sun_pointing"
    axis: Direction = Field(default=(1.0, 0.0, 0.0), description="Body axis that points to the Sun, of any length.")
    up_axis: Direction = Field(
        default=(0.0, 0.0, 1.0), description="Body axis that is turned as close to `up` as possible."
    )
    up: Direction | None = Field(
        default=None,
        description=(
            "Upward direction in root axes. If omitted, the orbit normal, or the root's +z for a body that does not "
            "orbit."
        ),
    )

    @model_validator(mode="after")
    def _two_directions(self) -> Self:
        a, b = np.array(self.axis), np.array(self.up_axis)
        if np.linalg.norm(np.cross(a, b)) <= PARALLEL_RAD * np.linalg.norm(a) * np.linalg.norm(b):
            raise ValueError(
                "axis and up_axis are parallel, which leaves roll undetermined; give an up_axis across axis"
            )
        return self

    def orient(self, situation: Situation) -> Orientation:
        """Compute the attitude in root axes.

        Raises
        ------
        PropagationError
            If the Sun is within 1e-6 rad of `up`
        ScenarioError
            If a local world has no Sun
        """
        line, line_rate = sun_line(situation, "sun_pointing")
        up = situation.upward if self.up is None else np.broadcast_to(np.array(self.up, dtype=float), line.shape)
        _refuse(
            situation,
            _sine(line, up) <= PARALLEL_RAD,
            f"sun_pointing: the Sun is within {PARALLEL_RAD:g} rad of `up`",
            "give an `up` (root axes) across it",
        )
        rotation, rate = aim_axes(line, line_rate, up, situation.upward_rate if self.up is None else None)
        # the triad has x along `axis`, and z as close to `up_axis` as possible
        body_from_triad, _ = aim_axes(np.array(self.axis), np.zeros(3), np.array(self.up_axis))
        return Orientation(rotation * body_from_triad.inv(), rotate_vectors(body_from_triad, rate))


class Nadir(Part):
    """Attitude with body +z to the centre of the body that it orbits (nadir) and +x forward, rotated by `euler_zyx_deg`.

    With `yaw_steering` the body turns about nadir. Its +x is then on the Sun's side, and +y, the hinge of a solar
    array, is perpendicular to the Sun. The yaw from the velocity's side is psi = atan2(-tan beta, sin mu), with mu
    counted from orbit midnight (Bar-Sever 1996; Montenbruck et al. 2015, eq. 3).

    This is the nominal law. Near noon and midnight it turns at up to mu' / tan beta, which grows without bound as the
    Sun enters the orbital plane; a real spacecraft turns slower. With the Sun within 1e-6 rad of zenith or nadir, yaw
    is undetermined, which is an error.
    """

    needs_orbit: ClassVar[bool] = True
    type: Literal["nadir"] = "nadir"
    yaw_steering: Flag = Field(
        default=False,
        description=(
            "Whether the body turns about nadir, so that body +y (a solar array's hinge) is perpendicular to the Sun "
            "and +x is on its side."
        ),
    )
    euler_zyx_deg: Vector = Field(
        default=(0.0, 0.0, 0.0), description="Further intrinsic rotations about z, new y, new x [deg]."
    )

    def orient(self, situation: Situation) -> Orientation:
        """Compute the attitude in rtn axes.

        Raises
        ------
        ScenarioError
            If the body has no orbit
        PropagationError
            If the Sun is within 1e-6 rad of zenith or nadir under yaw steering
        """
        from scipy.spatial.transform import Rotation

        if not situation.orbits:
            raise ScenarioError("nadir: needs a body that orbits; use 'fixed', 'spin' or 'look_at'")
        after, rtn_from_lvlh = euler_zyx(self.euler_zyx_deg), rtn_from_lvlh_ccsds()
        if not self.yaw_steering:
            return Orientation(rtn_from_lvlh * after, np.zeros(3), in_origin=True)
        line, line_rate = sun_line(situation, "nadir")
        lvlh_from_root = (situation.root_from_origin * rtn_from_lvlh).inv()
        spin = rotate_vectors(rtn_from_lvlh.inv(), situation.origin_rate_rad_s)
        s = rotate_vectors(lvlh_from_root, line)
        s_rate = rotate_vectors(lvlh_from_root, line_rate) - np.cross(spin, s)
        across = s[:, 0] ** 2 + s[:, 1] ** 2
        _refuse(
            situation,
            np.sqrt(across) <= PARALLEL_RAD * np.linalg.norm(s, axis=1),
            f"nadir: the Sun is within {PARALLEL_RAD:g} rad of zenith or nadir, where yaw steering is undetermined",
            "shift the run, or leave out yaw_steering",
        )
        yaw = np.arctan2(s[:, 1], s[:, 0])
        rate = np.zeros((len(yaw), 3))
        rate[:, 2] = (s[:, 0] * s_rate[:, 1] - s[:, 1] * s_rate[:, 0]) / across
        half = np.zeros((len(yaw), 4))
        half[:, 2], half[:, 3] = np.sin(yaw / 2.0), np.cos(yaw / 2.0)
        return Orientation(
            rtn_from_lvlh * Rotation.from_quat(half) * after, rotate_vectors(after.inv(), rate), in_origin=True
        )


def sun_line(situation: Situation, law: str) -> tuple[np.ndarray, np.ndarray]:
    """Compute vectors (time, 3) [m] from a body to the Sun and their rates [m/s] in root axes.

    In a local world the Sun is a constant direction, the same for every body.
    """
    if situation.sun_m is None:
        raise ScenarioError(f"{law}: this local world has no Sun; give [world] sun_direction, or use another attitude")
    if situation.local:
        return situation.sun_m, np.zeros_like(situation.sun_m)
    after, before = (sun_position_m(situation.epochs.shift(step)) for step in (_STEP_S, -_STEP_S))
    return situation.sun_m - situation.position_m, (after - before) / (2.0 * _STEP_S) - situation.velocity_m_s


def _sine(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    sine: np.ndarray = np.linalg.norm(np.cross(a, b), axis=-1) / (
        np.linalg.norm(a, axis=-1) * np.linalg.norm(b, axis=-1)
    )
    return sine


def _refuse(situation: Situation, bad: np.ndarray, what: str, cure: str) -> None:
    """Raise `PropagationError` with the mask (time) of the epochs at which a law is undetermined, if there are any."""
    if bad.any():
        at = situation.epochs.time_s[np.argmax(bad)]
        raise PropagationError(
            f"{what} at {int(bad.sum())} of {len(bad)} epochs, first at time_s = {at:g} "
            f"({format_utc(situation.epochs.start_utc, at)}): {cure}",
            bad,
        )

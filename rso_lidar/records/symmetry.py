"""Symmetry of a target: rotations that a lidar cannot tell apart, and errors of rotation that respect them."""

from __future__ import annotations

import math
from typing import Annotated, Any, Self

import numpy as np
from pydantic import Field, model_validator

from rso_lidar.errors import ScenarioError
from rso_lidar.part import Direction, Flag, Part, Vector, Whole

_PERPENDICULAR_WITHIN = 1e-6  # cosine between the axis and a half turn: rounding of directions with seven digits
_STEP_DEG = 5.0  # between elements of a continuous group: the project's goal for the median error of attitude


class Symmetry(Part):
    """Group of the rotations after which a target looks the same to a lidar.

    The group has `fold` rotations about `axis` by equal steps, or all rotations about it if `fold` is 0 (body of
    revolution). With `half_turn`, it also has half turns about that direction and its images (dihedral group). The group of
    a sphere has all rotations. The axis passes through `position_m`. Directions and position are in mesh axes.
    """

    axis: Direction = Field(default=(0.0, 0.0, 1.0), description="Direction of the main axis, of any length.")
    fold: Annotated[Whole, Field(ge=0)] = Field(
        default=1, description="Number of equal steps in a full turn about the axis; 0 for a body of revolution."
    )
    half_turn: Direction | None = Field(
        default=None,
        description="Direction perpendicular to the axis, of a half turn in the group. If omitted, there is none.",
    )
    is_sphere: Flag = Field(default=False, description="Whether all rotations belong to the group.")
    position_m: Vector = Field(default=(0.0, 0.0, 0.0), description="A point of the axis, or the sphere's centre [m].")

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.is_sphere and (self.fold != 1 or self.half_turn is not None):
            raise ValueError("a sphere has all rotations; leave out fold and half_turn")
        if not self.is_sphere and self.fold == 1:
            raise ValueError("fold = 1 has no rotation; give fold = 0 or 2 or more, or leave out the symmetry")
        if self.half_turn is not None:
            axis, across = (np.array(way) / np.linalg.norm(way) for way in (self.axis, self.half_turn))
            if abs(float(axis @ across)) > _PERPENDICULAR_WITHIN:
                raise ValueError("half_turn: is not perpendicular to the axis; correct one of the two")
        return self

    @property
    def in_words(self) -> str:
        """Description of the group, with its Schoenflies symbol."""
        if self.is_sphere:
            return "all rotations (SO(3))"
        kind, order = ("C", self.fold) if self.half_turn is None else ("D", self.fold)
        symbol = f"{kind}{order or 'inf'}"
        axis = ", ".join(f"{part:g}" for part in self.axis)
        what = "any angle" if self.fold == 0 else f"{self.fold} steps"
        return f"{what} about ({axis})" + (" with half turns" if self.half_turn else "") + f" ({symbol})"

    @property
    def basis(self) -> np.ndarray:
        """Matrix (3, 3) of orthonormal rows: the half turn's direction (or any normal to the axis), a third, the axis."""
        axis = np.array(self.axis) / np.linalg.norm(self.axis)
        across = np.array(self.half_turn) if self.half_turn else np.eye(3)[int(np.argmin(np.abs(axis)))]
        across = across - (across @ axis) * axis
        across /= np.linalg.norm(across)
        return np.stack([across, np.cross(axis, across), axis])

    def rotations_xyzw(self, step_deg: float = _STEP_DEG) -> np.ndarray:
        """Return the rotations of the group (k, 4) as quaternions x, y, z, w, the identity first.

        A continuous group about an axis is sampled. The group of a sphere is represented by the 60 rotations of the
        icosahedron.

        Parameters
        ----------
        step_deg : greatest step between samples of a continuous group [deg]
        """
        if not 0.0 < step_deg <= 180.0:
            raise ScenarioError(f"step_deg: {step_deg:g} is not a step; give a number above 0, at most 180")
        if self.is_sphere:
            from scipy.spatial.transform import Rotation

            group = Rotation.create_group("I").as_quat()
            group *= np.where(group[:, 3:] < 0.0, -1.0, 1.0)
            return np.asarray(group[np.argsort(-group[:, 3], kind="stable")])
        count = self.fold or math.ceil(360.0 / step_deg)
        half = np.pi / count * np.arange(count)  # half of each angle
        across, normal, axis = self.basis
        turned = np.column_stack([np.sin(half)[:, None] * axis, np.cos(half)])
        if self.half_turn is not None:
            ways = np.cos(half)[:, None] * across + np.sin(half)[:, None] * normal
            turned = np.concatenate([turned, np.column_stack([ways, np.zeros(count)])])
        return np.where(turned[:, 3:] < 0.0, -turned, turned)

    def translations_m(self, rotations_xyzw: np.ndarray) -> np.ndarray:
        """Return the translations (k, 3) [m] that accompany rotations of the group, so that the axis stays in place.

        Parameters
        ----------
        rotations_xyzw : (k, 4) quaternions x, y, z, w
        """
        from scipy.spatial.transform import Rotation

        position_m = np.array(self.position_m)
        return np.asarray(position_m - Rotation.from_quat(rotations_xyzw).apply(position_m))


def rotation_error_rad(a_xyzw: Any, b_xyzw: Any, symmetry: Symmetry | None = None) -> np.ndarray:
    """Return the angle between attitudes [rad], the least over all that look the same.

    The least angle has a closed form. Let q be the rotation from a to b in target axes. Its scalar part and its component
    along the axis form one plane vector, its two components perpendicular to the axis another. The rotations of the group
    turn each of the two by multiples of π / fold. For a body of revolution the result is the angle between the two axes.

    Parameters
    ----------
    a_xyzw, b_xyzw : (…, 4) unit quaternions x, y, z, w of lidar_from_target, in any order
    symmetry : of the target, in target axes; None for a target without symmetry

    Returns
    -------
    (…) angles from 0 to π [rad]

    Examples
    --------
    >>> turned = [0.0, 0.0, np.sin(np.pi / 4), np.cos(np.pi / 4)]  # 90 degrees about z
    >>> np.rad2deg(rotation_error_rad([0, 0, 0, 1], turned)).round(6).tolist()
    90.0
    >>> np.rad2deg(rotation_error_rad([0, 0, 0, 1], turned, Symmetry(fold=3))).round(6).tolist()
    30.0
    """
    a, b = np.broadcast_arrays(np.asarray(a_xyzw, dtype=float), np.asarray(b_xyzw, dtype=float))
    scalar = np.einsum("...i,...i->...", a, b)
    vector = a[..., 3:] * b[..., :3] - b[..., 3:] * a[..., :3] - np.cross(a[..., :3], b[..., :3])
    if symmetry is None:
        return np.asarray(2.0 * np.arctan2(np.linalg.norm(vector, axis=-1), np.abs(scalar)))
    if symmetry.is_sphere:
        return np.zeros(scalar.shape)
    x, y, z = np.moveaxis(vector @ symmetry.basis.T, -1, 0)
    along, across = np.hypot(scalar, z), np.hypot(x, y)
    error = _least_angle(along, np.arctan2(z, scalar), across, symmetry.fold)
    if symmetry.half_turn is not None:
        error = np.minimum(error, _least_angle(across, np.arctan2(y, x), along, symmetry.fold))
    return error


def _least_angle(length: np.ndarray, phase_rad: np.ndarray, rest: np.ndarray, fold: int) -> np.ndarray:
    """Return the least angle of rotation [rad] where a group turns one of the two parts of a unit quaternion.

    Parameters
    ----------
    length, phase_rad : length and phase of the part that contains the scalar part after a rotation of the group
    fold : number of rotations of the group that turn the part, 0 for any angle
    """
    off = np.zeros(phase_rad.shape)
    if fold:
        step = np.pi / fold
        off = phase_rad - step * np.round(phase_rad / step)
    return np.asarray(2.0 * np.arctan2(np.hypot(rest, length * np.sin(off)), length * np.cos(off)))

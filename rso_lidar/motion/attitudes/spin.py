"""Torque-free attitudes: a spin at a constant rate, and tumbling."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from functools import cache, cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from rso_lidar import units
from rso_lidar.errors import did_you_mean
from rso_lidar.motion.attitudes.free_rotation import rotate_freely
from rso_lidar.motion.attitudes.situation import Orientation, Situation
from rso_lidar.part import GREATEST, Direction, Number, Part, Quaternion, Text, Vector

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation


_IDENTITY = (0.0, 0.0, 0.0, 1.0)
_PLACES = {"direction", "quaternion_xyzw"}  # a user's choice of one replaces the preset's other


class Spin(Part):
    """Spin at a constant rate about an axis that is fixed in the body, and in inertial or in rtn axes.

    A dead satellite whose axis is fixed in rtn axes is held there by torques. `preset` names the rotation of a real object,
    with its source.
    """

    type: Literal["spin"] = "spin"
    preset: Text | None = Field(
        default=None,
        description="Name of a real object, whose rotation applies where no values are given here (docs/orbits.md).",
    )
    axis: Direction = Field(description="Rotation axis in body axes, of any length.")
    rate_deg_s: Number = Field(description="Rotation rate relative to `axes`, right-handed about `axis` [deg/s].")
    axes: Literal["inertial", "rtn"] = Field(
        default="inertial",
        description="Axes in which the rotation axis is fixed: the root's, or the body's own rtn axes if it orbits.",
    )
    direction: Direction | None = Field(
        default=None,
        description=(
            "Direction of the rotation axis in `axes`, of any length: at `start_utc` the smallest rotation from `axes` "
            "takes `axis` there. Give at most one of this and `quaternion_xyzw`."
        ),
    )
    quaternion_xyzw: Quaternion = Field(
        default=_IDENTITY, description="Unit quaternion axes_from_body at `start_utc`, with `axes` as above."
    )

    @model_validator(mode="before")
    @classmethod
    def _from_preset(cls, given: Any) -> Any:
        return _merge_preset(given) if isinstance(given, dict) else given

    @model_validator(mode="after")
    def _one_start(self) -> Self:
        if self.direction is not None and self.quaternion_xyzw != _IDENTITY:
            raise ValueError("direction and quaternion_xyzw both state where the axis points; give one")
        return self

    @property
    def needs_orbit(self) -> bool:
        """Whether the body must orbit."""
        return self.axes == "rtn"

    @property
    def axes_from_body(self) -> Rotation:
        """Attitude at `start_utc`, in `axes`."""
        from scipy.spatial.transform import Rotation

        if self.direction is None:
            return Rotation.from_quat(self.quaternion_xyzw)
        a, b = (np.asarray(vector, dtype=float) / np.linalg.norm(vector) for vector in (self.axis, self.direction))
        across, along = np.cross(a, b), float(a @ b)
        if np.linalg.norm(across) > 1e-12:
            return Rotation.from_rotvec(across / np.linalg.norm(across) * np.arctan2(np.linalg.norm(across), along))
        aside = np.cross(a, np.eye(3)[np.argmin(np.abs(a))])  # half a turn about any direction across it
        return Rotation.from_rotvec(aside / np.linalg.norm(aside) * (np.pi if along < 0.0 else 0.0))

    @property
    def body_rate_rad_s(self) -> np.ndarray:
        """Constant body rates (3,) in body axes [rad/s]."""
        axis = np.asarray(self.axis, dtype=float)
        rate: np.ndarray = axis / np.linalg.norm(axis) * (self.rate_deg_s * units.DEG)
        return rate

    def orientation(self, time_s: np.ndarray | float) -> tuple[Rotation, np.ndarray]:
        """Compute the attitude by Rodrigues' formula.

        Parameters
        ----------
        time_s : instants (…) [s]

        Returns
        -------
        axes_from_body (…), and the body rates (…, 3) [rad/s] relative to those axes

        Examples
        --------
        >>> rotation, _ = Spin(axis=(0, 0, 1), rate_deg_s=90.0).orientation(1.0)
        >>> rotation.apply([1, 0, 0]).round(12)
        array([0., 1., 0.])
        """
        from scipy.spatial.transform import Rotation

        along, across, out, rate = self._rodrigues
        angle = np.asarray(time_s, dtype=float)[..., None, None] * (self.rate_deg_s * units.DEG)
        matrix = along + np.cos(angle) * across + np.sin(angle) * out
        return Rotation.from_matrix(matrix, assume_valid=True), np.tile(rate, (*np.shape(time_s), 1))

    @cached_property
    def _rodrigues(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Constant, cosine and sine terms (3, 3) of the attitude matrix by Rodrigues' formula, and the rate [rad/s]."""
        x, y, z = np.asarray(self.axis, dtype=float) / np.linalg.norm(self.axis)
        start = self.axes_from_body.as_matrix()
        along = np.matmul(start, np.outer((x, y, z), (x, y, z)))
        out = np.matmul(start, np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]))
        return along, start - along, out, self.body_rate_rad_s

    def orient(self, situation: Situation) -> Orientation:
        """Return the attitude and body rates in root axes, or in the body's rtn axes."""
        return Orientation(*self.orientation(situation.epochs.time_s), in_origin=self.axes == "rtn")


def _check_inertia(inertia: Any) -> Any:
    rows = list(inertia) if isinstance(inertia, list | tuple) else []
    tables = [list(row) if isinstance(row, list | tuple) else None for row in rows]
    square = all(row is not None and len(row) == 3 for row in tables)
    if len(rows) != 3 or not (square or all(row is None for row in tables)):
        raise ValueError("needs the three principal moments along the body axes, or three rows of three numbers")
    for value in [value for row in tables for value in row or ()] or rows:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ValueError(f"needs numbers, not {value!r:.60}")
        if not -GREATEST <= value <= GREATEST:  # an integer of a Python integer may have any length
            raise ValueError(f"needs numbers up to {GREATEST:g}; check them and their unit")
    return inertia


class RigidRotation(Part):
    """Base of the rotations of a rigid body of any inertia, from its body rates and attitude at t = 0."""

    inertia_kg_m2: Annotated[Vector | tuple[Vector, Vector, Vector], BeforeValidator(_check_inertia)] = Field(
        description=(
            "Three principal moments of inertia along the body axes, or the symmetric inertia tensor in body axes [kg "
            "m²]."
        )
    )
    body_rate_deg_s: Vector = Field(description="Angular velocity at `start_utc`, in body axes [deg/s].")
    quaternion_xyzw: Quaternion = Field(
        default=_IDENTITY, description="Unit quaternion inertial_from_body at `start_utc`."
    )

    @model_validator(mode="after")
    def _possible(self) -> Self:
        tensor = self.inertia_tensor_kg_m2
        if np.abs(tensor - tensor.T).max() > 1e-9 * np.abs(tensor).max():
            raise ValueError("inertia_kg_m2: the tensor is not symmetric; write each product of inertia twice, equal")
        least, middle, most = np.linalg.eigvalsh(tensor)
        if least <= 0.0:
            raise ValueError(f"inertia_kg_m2: a principal moment is {least:.6g}; all three must be positive")
        if most > (least + middle) * (1.0 + 1e-9):  # a flat plate has equality, to rounding
            raise ValueError(
                f"inertia_kg_m2: no body has the principal moments {least:.6g}, {middle:.6g} and {most:.6g}, "
                "because the largest exceeds the sum of the others; check units, axes and signs"
            )
        return self

    @property
    def inertia_tensor_kg_m2(self) -> np.ndarray:
        """Inertia tensor (3, 3) in body axes [kg m2]."""
        given = np.asarray(self.inertia_kg_m2, dtype=float)
        return np.diag(given) if given.ndim == 1 else given


class Tumble(RigidRotation):
    """Torque-free tumbling of a rigid body of any inertia, in Jacobi's closed form.

    `inertia_kg_m2` is three principal moments along the body axes, or a symmetric 3 x 3 tensor in body axes.
    `body_rate_deg_s` and `quaternion_xyzw` (inertial_from_body) hold at t = 0.
    """

    type: Literal["tumble"] = "tumble"

    def orientation(self, time_s: np.ndarray | float) -> tuple[Rotation, np.ndarray]:
        """Compute the attitude in closed form (Landau & Lifshitz, Mechanics, section 37).

        Parameters
        ----------
        time_s : instants, a number or (time,) [s]

        Returns
        -------
        inertial_from_body, and the body rates (…, 3) [rad/s]
        """
        from scipy.spatial.transform import Rotation

        time = np.atleast_1d(np.ascontiguousarray(time_s, dtype=float))
        rate = np.asarray(self.body_rate_deg_s, dtype=float) * units.DEG
        turned, rates = rotate_freely(self.inertia_tensor_kg_m2, rate, time)
        rotation = Rotation.from_quat(self.quaternion_xyzw) * turned
        return (rotation[0], rates[0]) if np.ndim(time_s) == 0 else (rotation, rates)

    def orient(self, situation: Situation) -> Orientation:
        """Return the attitude and body rates in root axes."""
        return Orientation(*self.orientation(situation.epochs.time_s))


@cache
def load_spin_presets() -> dict[str, dict[str, Any]]:
    """Load the rotations of real objects by name, as tables of an attitude with a line `what`.

    Returns
    -------
    dict
        Tables by name; `what` states what is sourced, with how much confidence, and what is assumed

    Examples
    --------
    >>> sorted(load_spin_presets())
    ['bs_3a', 'cz3b_stage', 'dead_geo', 'envisat_2013', 'envisat_2017']
    """
    return tomllib.loads(Path(__file__).with_name("presets.toml").read_text(encoding="utf-8"))


def _merge_preset(given: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return a table with the values of its preset where it has none; without a preset, the table itself."""
    name, known = given.get("preset"), load_spin_presets()
    if not isinstance(name, str):
        return given
    if name not in known:
        raise ValueError(f"preset: no rotation '{name}'{did_you_mean(name, known)} (known: {', '.join(known)})")
    left_out = {"what", *(_PLACES if _PLACES & set(given) else ())}
    return {key: value for key, value in known[name].items() if key not in left_out} | dict(given)

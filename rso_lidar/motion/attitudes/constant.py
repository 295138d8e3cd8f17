"""How a body is turned: fixed, with the orbit, toward a name, spinning, or tumbling free of torque.

A body's axes are x forward, y left, z up. Body rates are relative to the axes that the body is turned in, in body axes.
At one epoch the answer has the same bits whichever other epochs are asked for.
"""

from __future__ import annotations

from functools import cache, cached_property
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.motion.free_rotation import free_rotation
from rso_lidar.motion.situation import Situation, Turn
from rso_lidar.part import GREATEST, Direction, Number, Part, Quaternion, Text, Vector
from rso_lidar.pose import euler_zyx

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

PARALLEL_RAD = 1e-6  # a line of sight nearer than this to `up` leaves the roll open

_IDENTITY = (0.0, 0.0, 0.0, 1.0)


@cache
def rtn_from_lvlh_ccsds() -> Rotation:
    """Return how the CCSDS axes stand in rtn: z to nadir is rtn -x, y along -(r x v) is rtn -z, x = y x z is rtn +y."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])


class FixedAttitude(Part):
    """Turned once and for all in the axes that the body's motion is given in: the root, or the body it is fixed to."""

    type: Literal["fixed"] = "fixed"
    quaternion_xyzw: Quaternion | None = Field(
        default=None, description="Unit quaternion axes_from_body; give at most one of this and `euler_zyx_deg`."
    )
    euler_zyx_deg: Vector | None = Field(
        default=None,
        description=(
            "Intrinsic rotations about z, then the new y, then the new x [deg]; give at most one of this and "
            "`quaternion_xyzw`."
        ),
    )

    @model_validator(mode="after")
    def _one_rotation(self) -> Self:
        if self.quaternion_xyzw is not None and self.euler_zyx_deg is not None:
            raise ValueError("quaternion_xyzw and euler_zyx_deg both turn the body: keep one")
        return self

    @property
    def rotation(self) -> Rotation:
        """Return axes_from_body; the identity where nothing is given."""
        from scipy.spatial.transform import Rotation

        if self.euler_zyx_deg is not None:
            return euler_zyx(self.euler_zyx_deg)
        return Rotation.from_quat(self.quaternion_xyzw or _IDENTITY)

    def orientation(self, time_s: np.ndarray | float) -> tuple[Rotation, np.ndarray]:
        """Return axes_from_body, single, and the body rates (…, 3) [rad/s], zero, at `time_s` (…) [s]."""
        return self.rotation, np.zeros((*np.shape(time_s), 3))

    def turn(self, here: Situation) -> Turn:
        """Return how the body is turned: in the root's axes where it orbits, in its host's elsewhere."""
        return Turn(*self.orientation(here.epochs.time_s), in_origin=not here.orbits)


class Rtn(Part):
    """Turned with the body's own rtn axes (x radially out, z along r x v, y = z x x), then by `euler_zyx_deg`."""

    type: Literal["rtn"] = "rtn"
    euler_zyx_deg: Vector = Field(
        default=(0.0, 0.0, 0.0),
        description=(
            "Intrinsic rotations from the rtn axes about z, new y, new x [deg]; [90, 0, 0] turns body +x along-track."
        ),
    )

    def rtn_from_body(self) -> Rotation:
        """Return the constant rotation of the body in its rtn axes.

        >>> Rtn(euler_zyx_deg=(90, 0, 0)).rtn_from_body().apply([1, 0, 0]).round(12)  # body +x along-track
        array([0., 1., 0.])
        """
        return euler_zyx(self.euler_zyx_deg)

    def turn(self, here: Situation) -> Turn:
        """Return how the body is turned: it stands still in the axes of its orbit."""
        return Turn(self.rtn_from_body(), np.zeros(3), in_origin=True)


class LvlhCcsds(Part):
    """Turned with CCSDS's local-vertical axes (z to nadir, y along -(r x v), x = y x z), then by `euler_zyx_deg`."""

    type: Literal["lvlh_ccsds"] = "lvlh_ccsds"
    euler_zyx_deg: Vector = Field(
        default=(0.0, 0.0, 0.0), description="Intrinsic rotations from the CCSDS axes about z, new y, new x [deg]."
    )

    def rtn_from_body(self) -> Rotation:
        """Return the constant rotation of the body in its rtn axes.

        >>> LvlhCcsds().rtn_from_body().apply([0, 0, 1]).round(12) + 0.0  # body +z to nadir
        array([-1.,  0.,  0.])
        """
        return rtn_from_lvlh_ccsds() * euler_zyx(self.euler_zyx_deg)

    def turn(self, here: Situation) -> Turn:
        """Return how the body is turned: it stands still in the axes of its orbit."""
        return Turn(self.rtn_from_body(), np.zeros(3), in_origin=True)


class LookAt(Part):
    """Body +x toward the name `at`, body +z as near `up` (root axes) as can be.

    `up` is the orbit normal, rtn +z, where it is left out, and the root's +z in a local world.
    """

    type: Literal["look_at"] = "look_at"
    at: Text = Field(description="Name of the body to look at, or of axes that a body declares.")
    up: Direction | None = Field(
        default=None,
        description=(
            "Upward direction in root axes. If omitted, the orbit normal, or the root's +z for a body that does not "
            "orbit."
        ),
    )

    def turn(self, here: Situation) -> Turn:
        """Return how the body is turned toward what it looks at."""
        line, rate = here.line(self.at)
        if self.up is None:
            return Turn(*look_at(line, rate, here.upward, here.upward_rate))
        return Turn(*look_at(line, rate, np.broadcast_to(np.array(self.up, dtype=float), line.shape)))


class Spin(Part):
    """Spinning at a constant rate about an axis in body axes; `quaternion_xyzw` is inertial_from_body at t = 0."""

    type: Literal["spin"] = "spin"
    axis: Direction = Field(description="Rotation axis in body axes, of any length.")
    rate_deg_s: Number = Field(description="Rotation rate, right-handed about `axis` [deg/s].")
    quaternion_xyzw: Quaternion = Field(
        default=_IDENTITY, description="Unit quaternion inertial_from_body at `start_utc`."
    )

    @property
    def body_rate_rad_s(self) -> np.ndarray:
        """Return the constant body rates (3,) [rad/s] in body axes."""
        axis = np.asarray(self.axis, dtype=float)
        rate: np.ndarray = axis / np.linalg.norm(axis) * (self.rate_deg_s * units.DEG)
        return rate

    def orientation(self, time_s: np.ndarray | float) -> tuple[Rotation, np.ndarray]:
        """Return inertial_from_body and the body rates (…, 3) [rad/s] at `time_s` (…) [s].

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
        """Return what of the first matrix stays, what turns with the cosine and with the sine, and the rate [rad/s]."""
        from scipy.spatial.transform import Rotation

        x, y, z = np.asarray(self.axis, dtype=float) / np.linalg.norm(self.axis)
        start = Rotation.from_quat(self.quaternion_xyzw).as_matrix()
        along = np.matmul(start, np.outer((x, y, z), (x, y, z)))
        out = np.matmul(start, np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]))
        return along, start - along, out, self.body_rate_rad_s

    def turn(self, here: Situation) -> Turn:
        """Return how the body is turned."""
        return Turn(*self.orientation(here.epochs.time_s))


def _three_or_nine(inertia: Any) -> Any:
    rows = list(inertia) if isinstance(inertia, list | tuple) else []
    tables = [list(row) if isinstance(row, list | tuple) else None for row in rows]
    square = all(row is not None and len(row) == 3 for row in tables)
    if len(rows) != 3 or not (square or all(row is None for row in tables)):
        raise ValueError("needs the three principal moments along the body axes, or three rows of three numbers")
    for value in [value for row in tables for value in row or ()] or rows:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ValueError(f"needs numbers, not {value!r:.60}")
        if not -GREATEST <= value <= GREATEST:  # an integer of any length, too
            raise ValueError(f"needs numbers up to {GREATEST:g}; check them and their unit")
    return inertia


class Tumble(Part):
    """Tumbling free of torque: a rigid body of any inertia, in Jacobi's closed form.

    `inertia_kg_m2` is three principal moments along the body axes, or a symmetric 3 x 3 tensor in body axes;
    `body_rate_deg_s` and `quaternion_xyzw` (inertial_from_body) hold at t = 0.
    """

    type: Literal["tumble"] = "tumble"
    inertia_kg_m2: Annotated[Vector | tuple[Vector, Vector, Vector], BeforeValidator(_three_or_nine)] = Field(
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
                "for the largest exceeds the sum of the others; check units, axes and signs"
            )
        return self

    @property
    def inertia_tensor_kg_m2(self) -> np.ndarray:
        """Return the inertia tensor (3, 3) [kg m2] in body axes."""
        given = np.asarray(self.inertia_kg_m2, dtype=float)
        return np.diag(given) if given.ndim == 1 else given

    def orientation(self, time_s: np.ndarray | float) -> tuple[Rotation, np.ndarray]:
        """Return inertial_from_body and the body rates (…, 3) [rad/s] at `time_s` (…) [s]."""
        from scipy.spatial.transform import Rotation

        time = np.atleast_1d(np.ascontiguousarray(time_s, dtype=float))
        rate = np.asarray(self.body_rate_deg_s, dtype=float) * units.DEG
        turned, rates = free_rotation(self.inertia_tensor_kg_m2, rate, time)
        rotation = Rotation.from_quat(self.quaternion_xyzw) * turned
        return (rotation[0], rates[0]) if np.ndim(time_s) == 0 else (rotation, rates)

    def turn(self, here: Situation) -> Turn:
        """Return how the body is turned."""
        return Turn(*self.orientation(here.epochs.time_s))


def look_at(
    line_of_sight: np.ndarray, line_of_sight_rate: np.ndarray, up: np.ndarray, up_rate: np.ndarray | None = None
) -> tuple[Rotation, np.ndarray]:
    """Return inertial_from_body and body rates (…, 3) [rad/s] of a body that turns its +x to a target, +z nearest `up`.

    Parameters
    ----------
    line_of_sight : (…, 3) from the body to its target, root axes [m]
    line_of_sight_rate : (…, 3) its rate in root axes [m/s]
    up : (…, 3) direction of any length, root axes
    up_rate : (…, 3) its rate [1/s in the unit of `up`]; None for a direction that stands still

    >>> rotation, rates = look_at(np.array([10.0, 0, 0]), np.array([0, 1.0, 0]), np.array([0, 0, 1.0]))
    >>> rates + 0.0  # the target moves to the left: the body turns about +z
    array([0. , 0. , 0.1])
    """
    from scipy.spatial.transform import Rotation

    line_of_sight, up = np.asarray(line_of_sight, dtype=float), np.asarray(up, dtype=float)
    distance = np.linalg.norm(line_of_sight, axis=-1, keepdims=True)
    if not np.all(distance > 0.0):
        raise ScenarioError("look_at: the target is where the body is: look at another name, or move one of them")
    x = line_of_sight / distance
    x_rate = (line_of_sight_rate - x * _dot(x, line_of_sight_rate)) / distance

    across = np.cross(up, x)
    length = np.linalg.norm(across, axis=-1, keepdims=True)
    if not np.all(length > PARALLEL_RAD * np.linalg.norm(up, axis=-1, keepdims=True)):
        raise ScenarioError(
            f"look_at: up is parallel to the line of sight (within {PARALLEL_RAD:g} rad): "
            "give an `up` (root axes) that stands across it"
        )
    across_rate = np.cross(up, x_rate)
    if up_rate is not None:
        across_rate = across_rate + np.cross(up_rate, x)
    y = across / length
    y_rate = (across_rate - y * _dot(y, across_rate)) / length
    z = np.cross(x, y)

    # omega = 1/2 sum e x de/dt, in the body's own axes; the z column follows from the other two
    rates = np.concatenate([_dot(y_rate, z), -_dot(x_rate, z), _dot(x_rate, y)], axis=-1)
    columns = np.stack(np.broadcast_arrays(x, y, z), axis=-1)
    return Rotation.from_matrix(columns), rates


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    product: np.ndarray = np.sum(a * b, axis=-1, keepdims=True)
    return product

"""Attitude toward a target: body +x along the line of sight, body +z as close to `up` as possible."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np
from pydantic import Field

from rso_lidar.errors import ScenarioError
from rso_lidar.motion.attitudes.situation import Orientation, Situation
from rso_lidar.part import Direction, Part, Text

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation


PARALLEL_RAD = 1e-6  # a line of sight closer than this to `up` leaves roll undetermined


class LookAt(Part):
    """Attitude with body +x toward the body or axes `at`, and body +z as close to `up` (root axes) as possible.

    By default `up` is the orbit normal, rtn +z, and in a local world the root's +z.
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

    @property
    def looks_at(self) -> tuple[str, ...]:
        """Names of the bodies or axes that the body looks at."""
        return (self.at,)

    def orient(self, situation: Situation) -> Orientation:
        """Compute the attitude toward the target."""
        line, rate = situation.line(self.at)
        if self.up is None:
            return Orientation(*aim_axes(line, rate, situation.upward, situation.upward_rate))
        return Orientation(*aim_axes(line, rate, np.broadcast_to(np.array(self.up, dtype=float), line.shape)))


def aim_axes(
    line_of_sight: np.ndarray, line_of_sight_rate: np.ndarray, up: np.ndarray, up_rate: np.ndarray | None = None
) -> tuple[Rotation, np.ndarray]:
    """Compute the attitude with body +x toward a target and body +z as close to `up` as possible.

    Parameters
    ----------
    line_of_sight : (…, 3) from the body to its target, root axes [m]
    line_of_sight_rate : (…, 3) its rate in root axes [m/s]
    up : (…, 3) direction of any length, root axes
    up_rate : (…, 3) its rate [1/s in the unit of `up`]; None for a constant direction

    Returns
    -------
    inertial_from_body (…), and body rates (…, 3) [rad/s]

    Raises
    ------
    ScenarioError
        If the target is at the body's position, or `up` is parallel to the line of sight

    Examples
    --------
    >>> rotation, rates = aim_axes(np.array([10.0, 0, 0]), np.array([0, 1.0, 0]), np.array([0, 0, 1.0]))
    >>> rates + 0.0  # the target moves to the left: the body turns about +z
    array([0. , 0. , 0.1])
    """
    from scipy.spatial.transform import Rotation

    line_of_sight, up = np.asarray(line_of_sight, dtype=float), np.asarray(up, dtype=float)
    distance = np.linalg.norm(line_of_sight, axis=-1, keepdims=True)
    if not np.all(distance > 0.0):
        raise ScenarioError(
            "look_at: the target is at the position of the body; look at another target, or move one of them"
        )
    x = line_of_sight / distance
    x_rate = (line_of_sight_rate - x * _dot(x, line_of_sight_rate)) / distance

    across = np.cross(up, x)
    length = np.linalg.norm(across, axis=-1, keepdims=True)
    if not np.all(length > PARALLEL_RAD * np.linalg.norm(up, axis=-1, keepdims=True)):
        raise ScenarioError(
            f"look_at: up is parallel to the line of sight (within {PARALLEL_RAD:g} rad); "
            "give an `up` (root axes) across it"
        )
    across_rate = np.cross(up, x_rate)
    if up_rate is not None:
        across_rate = across_rate + np.cross(up_rate, x)
    y = across / length
    y_rate = (across_rate - y * _dot(y, across_rate)) / length
    z = np.cross(x, y)

    # omega = 1/2 sum e x de/dt, in the body's own axes; de/dt of z follows from the other two
    rates = np.concatenate([_dot(y_rate, z), -_dot(x_rate, z), _dot(x_rate, y)], axis=-1)
    columns = np.stack(np.broadcast_arrays(x, y, z), axis=-1)
    return Rotation.from_matrix(columns), rates


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    product: np.ndarray = np.sum(a * b, axis=-1, keepdims=True)
    return product

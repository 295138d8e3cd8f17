"""What an attitude law may look at: where its body is among the others, in root axes, at some epochs."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rso_lidar.errors import ScenarioError
from rso_lidar.orbit.epochs import Epochs
from rso_lidar.pose import rotate_vectors

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation


@dataclass(frozen=True, eq=False)
class Turn:
    """How a body is turned: `rotation` is axes_from_body (single or (time)), `rate_rad_s` (…, 3) its rate in body axes.

    The rate is relative to those axes. `in_origin` says that they are the axes at the body's origin (its rtn axes where
    it orbits, its host's where it is fixed to something) and not the root's.
    """

    rotation: Rotation
    rate_rad_s: np.ndarray
    in_origin: bool = False


@dataclass(frozen=True, eq=False)
class Situation:
    """One body among the others; vectors (time, 3) in root axes.

    `orbits` says whether it has an orbit; `root_from_origin` and `origin_rate_rad_s` how the axes at its origin stand in the
    root and turn (in their own axes); `sun_m` is the vector from the root's origin to the Sun [m], None without one.
    In a `local` world, which has no Earth, that is a direction of length 1 AU, the same for every body.
    """

    epochs: Epochs
    position_m: np.ndarray
    velocity_m_s: np.ndarray
    orbits: bool
    root_from_origin: Rotation
    origin_rate_rad_s: np.ndarray
    sun_m: np.ndarray | None
    local: bool
    line: Callable[
        [str], tuple[np.ndarray, np.ndarray]
    ]  # to a name: vector [m] and its rate [m/s], (time, 3), root axes
    at: Callable[[Epochs], Situation]  # the same body at other instants

    @property
    def upward(self) -> np.ndarray:
        """Return what is up where nothing else is said (time, 3): the orbit normal, or the root's +z without an orbit."""
        z = np.array([0.0, 0.0, 1.0])
        up = rotate_vectors(self.root_from_origin, z) if self.orbits else z
        return np.broadcast_to(up, (len(self.epochs), 3))

    @property
    def upward_rate(self) -> np.ndarray:
        """Return the rate of `upward` (time, 3) [1/s]: a perturbed orbit's plane turns."""
        rate = np.zeros((len(self.epochs), 3))
        if not self.orbits:
            return rate
        spin = self.origin_rate_rad_s  # omega x z in the origin's axes
        rate[:, 0], rate[:, 1] = spin[:, 1], -spin[:, 0]
        return rotate_vectors(self.root_from_origin, rate)


def given_direction(given: Sequence[float] | np.ndarray | None, *, local: bool) -> np.ndarray | None:
    """Return the direction to the Sun (3) that is given in a local world, of length 1; None where none is given."""
    if given is None:
        return None
    if not local:
        raise ScenarioError("sun_direction: with an Earth the Sun is where the date says; leave it out")
    direction = np.asarray(given, dtype=float)
    length = np.linalg.norm(direction)
    if direction.shape != (3,) or not 0.0 < length < math.inf:
        raise ScenarioError("sun_direction: needs a vector of three finite numbers that are not all zero")
    unit: np.ndarray = direction / length
    return unit

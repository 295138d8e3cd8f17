"""The interface of attitudes: the situation of a body that they receive, and the orientation that they return."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np

from rso_lidar.errors import ScenarioError
from rso_lidar.motion.dynamics.commands import CommandedFlight, CommandedModel
from rso_lidar.orbit import Epochs
from rso_lidar.part import Part, kind_of, read_member, show_value
from rso_lidar.pose import Link, rotate_vectors

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation


@dataclass(frozen=True, eq=False)
class Orientation:
    """Attitude and body rates of a body at some epochs.

    Parameters
    ----------
    rotation : axes_from_body, single or (time)
    rate_rad_s : (…, 3) angular velocity relative to those axes, in body axes [rad/s]
    in_origin : whether those axes are the ones at the body's origin, and not the root's. They are its rtn axes if it
        orbits, and the axes of its host if it is attached to one
    """

    rotation: Rotation
    rate_rad_s: np.ndarray
    in_origin: bool = False


@runtime_checkable
class Attitude(Protocol):
    """Protocol of user-defined attitudes; the single method `orient` is enough.

    `orient` may be called with any epochs. Its result at one epoch must not depend on the others, and the object must
    not change. Two optional attributes are recognised:

    - ``looks_at``: names of the bodies or axes for which `orient` calls `situation.line`. Bodies are computed in an
      order that respects them.
    - ``needs_orbit``: if True, the attitude is refused for a body without an orbit.

    `examples/seams/own_attitude.py` is an example.
    """

    def orient(self, situation: Situation) -> Orientation:
        """Compute the attitude of the body at ``situation.epochs``.

        Parameters
        ----------
        situation : epochs, position and velocity of the body, its rtn axes, the Sun, and vectors to other bodies

        Returns
        -------
        attitude axes_from_body, and the angular velocity of the body relative to those axes
        """


@dataclass(frozen=True, eq=False)
class Situation:
    """State of one body relative to the others at some epochs; vectors (time, 3) are in root axes.

    Parameters
    ----------
    epochs : instants; ``epochs.time_s`` (time) counts seconds since `start_utc`
    position_m, velocity_m_s : of the body's origin [m], [m/s]
    orbits : whether the body has an orbit, and so rtn axes
    root_from_origin : rotation of the axes at its origin (rtn axes where it orbits), single or (time)
    origin_rate_rad_s : their angular velocity, in those axes [rad/s]
    sun_m : vector from the root's origin to the Sun [m]; None without one. In a local world, which has no Earth, it is
        a direction of length 1 AU, the same for every body
    local : whether the world is local
    line : called with the name of a body or of axes, gives the vector to it [m] and the rate of that vector [m/s]
    at : called with other epochs, gives the same body's situation then
    origin_of : called with the name of another body, gives the link from the root to the axes at its origin
    flight_of : called with a state-space model or an FMU of this body, gives its flight under the inputs so far
    list_motions : called without arguments, lists the motions from which the position of the body follows
    """

    epochs: Epochs
    position_m: np.ndarray
    velocity_m_s: np.ndarray
    orbits: bool
    root_from_origin: Rotation
    origin_rate_rad_s: np.ndarray
    sun_m: np.ndarray | None
    local: bool
    line: Callable[[str], tuple[np.ndarray, np.ndarray]]
    at: Callable[[Epochs], Situation]
    origin_of: Callable[[str], Link]
    flight_of: Callable[[CommandedModel], CommandedFlight]
    list_motions: Callable[[], tuple[Any, ...]]

    @property
    def upward(self) -> np.ndarray:
        """Default direction of up (time, 3): the orbit normal, or the root's +z without an orbit."""
        z = np.array([0.0, 0.0, 1.0])
        up = rotate_vectors(self.root_from_origin, z) if self.orbits else z
        return np.broadcast_to(up, (len(self.epochs), 3))

    @property
    def upward_rate(self) -> np.ndarray:
        """Rate of `upward` (time, 3) [1/s]: the plane of a perturbed orbit turns."""
        rate = np.zeros((len(self.epochs), 3))
        if not self.orbits:
            return rate
        spin = self.origin_rate_rad_s  # omega x z in the origin's axes
        rate[:, 0], rate[:, 1] = spin[:, 1], -spin[:, 0]
        return rotate_vectors(self.root_from_origin, rate)


def laws_of(attitude: Any) -> tuple[Any, ...]:
    """Return the attitude itself, or all laws between which a slew leads."""
    laws: tuple[Any, ...] = getattr(attitude, "laws", (attitude,)) if isinstance(attitude, Part) else (attitude,)
    return laws


def looks_at(attitude: Any) -> tuple[str, ...]:
    """Return the names of bodies and axes that an attitude looks at."""
    cure = "make it a tuple of names, such as ('station',), or a property"
    names = read_member(attitude, "looks_at", (), (tuple, list), cure)
    if not all(isinstance(name, str) for name in names):
        raise ScenarioError(f"{kind_of(attitude)}: looks_at is {show_value(names)}; {cure}")
    return tuple(names)


def needs_orbit(attitude: Any) -> bool:
    """Return whether an attitude requires a body that orbits."""
    return bool(read_member(attitude, "needs_orbit", False, bool, "make it True or False, or a property"))


def orient(attitude: Any, situation: Situation) -> Orientation:
    """Call an attitude and check its result; raise `ScenarioError` if it is not an `Orientation`."""
    orientation = attitude.orient(situation)
    if not isinstance(orientation, Orientation):
        raise ScenarioError(
            f"{kind_of(attitude)}: orient() returned a {type(orientation).__name__}; return an Orientation"
        )
    if isinstance(attitude, Part):
        return orientation
    n, rate = len(situation.epochs), np.asarray(orientation.rate_rad_s)
    as_quat = getattr(orientation.rotation, "as_quat", None)
    rotation = np.asarray(orientation.rotation if as_quat is None else as_quat())
    if rotation.shape not in ((4,), (n, 4)) or rate.shape not in ((3,), (n, 3)):
        raise ScenarioError(
            f"{kind_of(attitude)}: orient() returned the wrong shape for {n} epochs; "
            f"return one rotation or {n}, and rates (3) or ({n}, 3)"
        )
    if rate.dtype.kind not in "fiu" or not np.isfinite(rate).all():
        raise ScenarioError(f"{kind_of(attitude)}: orient() returned rates that are not finite numbers; correct them")
    return orientation

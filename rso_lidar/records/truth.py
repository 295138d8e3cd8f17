"""Truth: states of bodies, the tree of axes and the angles of the PTU."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from rso_lidar.pose import Link, PoseTree
from rso_lidar.records.schema import Record, array, locked

if TYPE_CHECKING:
    from scipy.spatial.transform import RigidTransform


@dataclass(frozen=True, eq=False, repr=False)
class BodyState(Record):
    """The state of a body's origin in inertial axes (GCRS, or the root of a local world); single or batched."""

    position_m: np.ndarray = array("… xyz", "f8", "m", "position in inertial axes")
    velocity_m_s: np.ndarray = array("… xyz", "f8", "m s-1", "velocity in inertial axes")

    def __getitem__(self, epoch: int | slice | np.ndarray) -> BodyState:
        """Return the state at one epoch of a batch, or at some of them."""
        return BodyState(self.position_m[epoch], self.velocity_m_s[epoch])


@dataclass(frozen=True, eq=False, repr=False)
class PtuAngles(Record):
    """PTU angles at one flash: demanded, true, and as the encoders report them. Pan left and tilt up are positive."""

    demand_rad: np.ndarray = array("pan_tilt", "f8", "rad", "demanded pan and tilt")
    actual_rad: np.ndarray = array("pan_tilt", "f8", "rad", "true pan and tilt, jitter and misalignment included")
    measured_rad: np.ndarray = array("pan_tilt", "f8", "rad", "pan and tilt as the encoders report them")
    rate_rad_s: np.ndarray = array("pan_tilt", "f8", "rad s-1", "true pan and tilt rates")


@dataclass(frozen=True, eq=False, repr=False)
class Truth:
    """Poses and states of all bodies at one epoch, or at a batch of epochs that `at` divides.

    `time_s` is a float or an array (time) [s since start_utc]. `poses` is the tree of axes, and `states` holds the
    inertial states of bodies. `sun_direction` (…, 3) is the unit vector to the Sun in inertial axes, NaN in a local
    world without a Sun. `pointing` holds the angles of the PTU (None without a PTU). `sunlit` is, by body, the share
    (…) of the Sun's disc that the Earth does not hide.

    `exposure` is a batch of the epochs at which the pulses of a frame are cast, where the scene moves between them. It is
    None where it does not; a recording does not hold it.
    """

    time_s: Any
    poses: PoseTree
    states: Mapping[str, BodyState]
    sun_direction: np.ndarray
    pointing: PtuAngles | None = None
    sunlit: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    exposure: Truth | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "sun_direction", locked(self.sun_direction, np.dtype(float)))

    def __repr__(self) -> str:
        """Return the instants and the names of the axes."""
        return f"<Truth: {np.size(self.time_s)} epoch(s), axes {', '.join(self.poses)}>"

    def pose(self, a: str, b: str) -> RigidTransform:
        """Return the pose a_from_b, which converts coordinates in axes b to coordinates in axes a (Fuller et al., eq. 5).

        Parameters
        ----------
        a, b : names of axes, such as "lidar" and "tdrs"; "inertial" is the root

        Returns
        -------
        scipy.spatial.transform.RigidTransform
            Its `translation` (…, 3) is the position of the origin of b in axes a [m]. Its `rotation` turns vectors from
            b to a; `rotation.as_quat(canonical=True)` is x, y, z, w (…, 4) with w >= 0. One pose for a truth at one epoch,
            else one for each epoch. ``apply(points)`` converts points (n, 3) [m], and ``inv()`` is b_from_a.

        Raises
        ------
        ScenarioError
            If there are no axes of that name
        """
        return self.poses.pose(a, b)

    def rates(self, a: str, b: str) -> tuple[np.ndarray, np.ndarray]:
        """Return the velocity and angular velocity of axes b relative to axes a.

        Parameters
        ----------
        a, b : names of axes, such as "lidar" and "tdrs"; "inertial" is the root

        Returns
        -------
        velocity_m_s
            (…, 3) of the origin of b, in axes a [m/s]; it contains the transport term where a rotates
        angular_velocity_rad_s
            (…, 3) in axes b [rad/s]
        """
        link: Link = self.poses.link(a, b)
        return link.velocity_m_s, link.angular_velocity_rad_s

    @property
    def cast_epochs(self) -> tuple[Truth, ...]:
        """Return the truth at each epoch at which the scene is cast: those of the exposure, or this one."""
        if self.exposure is None:
            return (self,)
        return tuple(self.exposure.at(epoch) for epoch in range(len(self.exposure.time_s)))

    def view_from(self, axes: str) -> Truth:
        """Return the truth with its "lidar" axes at other axes, from which the scene is then cast.

        Parameters
        ----------
        axes : name of the axes of the viewer: x right, y down, z ahead
        """
        return dataclasses.replace(self, poses=self.poses.with_node("lidar", axes, Link.still()), exposure=None)

    def extrapolate(self, ahead_s: float) -> Truth:
        """Return the truth a short time later: all rates are held constant, and the Sun stands still.

        Parameters
        ----------
        ahead_s : the time [s]; negative for before
        """
        later = {
            name: BodyState(state.position_m + ahead_s * state.velocity_m_s, state.velocity_m_s)
            for name, state in self.states.items()
        }
        return dataclasses.replace(
            self, time_s=self.time_s + ahead_s, poses=self.poses.extrapolate(ahead_s), states=later, exposure=None
        )

    def some(self, epochs: slice) -> Truth:
        """Return the truth at some epochs of a batch.

        Parameters
        ----------
        epochs : the epochs
        """
        return Truth(
            self.time_s[epochs],
            self.poses.at(epochs),
            {name: state[epochs] for name, state in self.states.items()},
            self.sun_direction[epochs],
            None,
            {name: share[epochs] for name, share in self.sunlit.items()},
        )

    def at(self, epoch: int) -> Truth:
        """Return the truth at one epoch of a batch.

        Parameters
        ----------
        epoch : index of the epoch
        """
        return Truth(
            float(self.time_s[epoch]),
            self.poses.at(epoch),
            {name: state[epoch] for name, state in self.states.items()},
            self.sun_direction[epoch],
            self.pointing,
            {name: float(share[epoch]) for name, share in self.sunlit.items()},
        )

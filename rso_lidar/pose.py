"""Poses named ``a_from_b``, the links between axes, and the tree that joins them (seed 3.1.1, eqs. 1-5).

A pose ``a_from_b`` is a `scipy.spatial.transform.RigidTransform` that takes coordinates in axes b to coordinates in
axes a, so ``a_from_c = a_from_b * b_from_c``. A `Link` adds how fast: it is what stands between a child and its parent.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from rso_lidar.errors import ScenarioError, did_you_mean

ROOT = "inertial"


def pose(position_m: np.ndarray | None = None, rotation: Rotation | None = None) -> RigidTransform:
    """Return the pose made of a translation [m] (…, 3), in the axes a, and a rotation a_from_b; either may be left out."""
    if position_m is None:
        return RigidTransform.from_rotation(Rotation.identity() if rotation is None else rotation)
    if rotation is None:
        return RigidTransform.from_translation(np.asarray(position_m, dtype=float))
    return RigidTransform.from_components(np.asarray(position_m, dtype=float), rotation)


def turned(rotation: Rotation | np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Return vectors (…, 3) turned by a rotation, or by matrices (…, 3, 3); single, or batched over epochs.

    Element by element: library routines give an epoch other bits alone than among many.
    """
    matrix = rotation.as_matrix() if isinstance(rotation, Rotation) else rotation
    vectors = np.asarray(vectors, dtype=float)
    product: np.ndarray = (
        matrix[..., 0] * vectors[..., 0, None]
        + matrix[..., 1] * vectors[..., 1, None]
        + matrix[..., 2] * vectors[..., 2, None]
    )
    return product


def euler_zyx(euler_zyx_deg: tuple[float, float, float]) -> Rotation:
    """Return the intrinsic rotation about z, then the new y, then the new x [deg]: the axes so turned, seen from the old."""
    return Rotation.from_euler("ZYX", euler_zyx_deg, degrees=True)


def quaternion_xyzw(rotation: Rotation) -> np.ndarray:
    """Return the canonical quaternion (…, 4) in the order x, y, z, w, with w >= 0."""
    quaternion: np.ndarray = rotation.as_quat(canonical=True)
    return quaternion


@dataclass(frozen=True, eq=False)
class Link:
    """How one set of axes (the child) stands and moves in another (the parent); single, or batched over epochs.

    `pose` is parent_from_child. `velocity_m_s` (…, 3) is the rate of the child's origin as the parent sees it, in parent
    axes [m/s]; where the parent turns, that contains the transport term. `angular_velocity_rad_s` (…, 3) is the child's
    relative to the parent, in child axes [rad/s].
    """

    pose: RigidTransform
    velocity_m_s: np.ndarray
    angular_velocity_rad_s: np.ndarray

    def __post_init__(self) -> None:
        for name in ("velocity_m_s", "angular_velocity_rad_s"):
            locked = np.asarray(getattr(self, name), dtype=float).view()
            locked.flags.writeable = False
            object.__setattr__(self, name, locked)

    @staticmethod
    def still(parent_from_child: RigidTransform | None = None) -> Link:
        """Return a link that does not move."""
        still = RigidTransform.identity() if parent_from_child is None else parent_from_child
        return Link(still, np.zeros(3), np.zeros(3))

    @property
    def single(self) -> bool:
        """Return whether the link holds one epoch (or is the same at all)."""
        single: bool = self.pose.single
        return single and self.velocity_m_s.ndim == 1 and self.angular_velocity_rad_s.ndim == 1

    def __mul__(self, inner: Link) -> Link:
        """Return the link a-c from a-b and b-c; rates by the transport theorem."""
        rotation = self.pose.rotation
        carried = np.cross(self.angular_velocity_rad_s, inner.pose.translation)
        return Link(
            self.pose * inner.pose,
            self.velocity_m_s + turned(rotation, inner.velocity_m_s + carried),
            turned(inner.pose.rotation.inv(), self.angular_velocity_rad_s) + inner.angular_velocity_rad_s,
        )

    def inv(self) -> Link:
        """Return the link as the child sees the parent."""
        inverse = self.pose.inv()
        rotation = inverse.rotation
        velocity = -turned(rotation, self.velocity_m_s) - np.cross(self.angular_velocity_rad_s, inverse.translation)
        return Link(inverse, velocity, -turned(self.pose.rotation, self.angular_velocity_rad_s))

    def __getitem__(self, epoch: int | slice) -> Link:
        """Return the link at one epoch, or at a slice of them."""
        if self.single:
            return self

        def at(vectors: np.ndarray) -> np.ndarray:
            return vectors if vectors.ndim == 1 else vectors[epoch]

        transform = self.pose if self.pose.single else self.pose[epoch]
        return Link(transform, at(self.velocity_m_s), at(self.angular_velocity_rad_s))


class PoseTree(Mapping[str, Link]):
    """Axes by name, each with one parent and the link to it; the root is ``inertial``.

    Indexing gives the link to the parent. Relative poses are composed along the shortest path, so that two bodies related
    by a relative motion never meet the large numbers of inertial coordinates.
    """

    def __init__(self, parents: Mapping[str, str], links: Mapping[str, Link]) -> None:
        self._parents = dict(parents)
        self._links = dict(links)

    def __getitem__(self, name: str) -> Link:
        return self._links[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._links)

    def __len__(self) -> int:
        return len(self._links)

    def parent(self, name: str) -> str:
        """Return the name of a node's parent."""
        return self._parents[name]

    def with_node(self, name: str, parent: str, link: Link) -> PoseTree:
        """Return a tree with one more node, or with that node's link exchanged."""
        return PoseTree({**self._parents, name: parent}, {**self._links, name: link})

    def at(self, epoch: int | slice) -> PoseTree:
        """Return the tree at one epoch of a batch, or at a slice of them."""
        return PoseTree(self._parents, {name: link[epoch] for name, link in self._links.items()})

    def pose(self, a: str, b: str) -> RigidTransform:
        """Return a_from_b (seed eq. 5), batched where the tree is."""
        up, down = self._path(a, b)
        transform = RigidTransform.identity()
        for name in up:
            transform = transform * self._links[name].pose.inv()
        for name in down:
            transform = transform * self._links[name].pose
        return transform

    def link(self, a: str, b: str) -> Link:
        """Return pose and rates of b as a sees it: velocity in a's axes, angular velocity in b's."""
        up, down = self._path(a, b)
        total = Link.still()
        for name in up:
            total = total * self._links[name].inv()
        for name in down:
            total = total * self._links[name]
        return total

    def _path(self, a: str, b: str) -> tuple[list[str], list[str]]:
        """Return the nodes to climb from a (inner first) and to descend to b (outer first), common ancestors left out."""
        above_a, above_b = self._ancestry(a), self._ancestry(b)
        while above_a and above_b and above_a[-1] == above_b[-1]:
            above_a.pop()
            above_b.pop()
        return above_a, above_b[::-1]

    def _ancestry(self, name: str) -> list[str]:
        chain: list[str] = []
        while name != ROOT:
            if name not in self._links:
                known = [ROOT, *self._links]
                raise ScenarioError(
                    f"pose: no axes named '{name}'{did_you_mean(name, known)} (known: {', '.join(known)})"
                )
            chain.append(name)
            name = self._parents[name]
        return chain

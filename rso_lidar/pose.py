"""Poses named ``a_from_b``, the links between axes, and the tree that joins them (Fuller et al., sec. 3.1.1, eqs. 1-5).

A pose ``a_from_b`` is a `scipy.spatial.transform.RigidTransform` that takes coordinates in axes b to coordinates in
axes a, so ``a_from_c = a_from_b * b_from_c``. A `Link` joins a child to its parent and adds their relative rates.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np

from rso_lidar.errors import ScenarioError, did_you_mean

if TYPE_CHECKING:
    from scipy.spatial.transform import RigidTransform, Rotation

ROOT = "inertial"


def pose(position_m: np.ndarray | None = None, rotation: Rotation | None = None) -> RigidTransform:
    """Return the pose a_from_b of a translation [m] (…, 3) in axes a and a rotation a_from_b; either may be left out."""
    from scipy.spatial.transform import RigidTransform, Rotation

    if position_m is None:
        return RigidTransform.from_rotation(Rotation.identity() if rotation is None else rotation)
    if rotation is None:
        return RigidTransform.from_translation(np.asarray(position_m, dtype=float))
    return RigidTransform.from_components(np.asarray(position_m, dtype=float), rotation)


def rotate_vectors(rotation: Rotation | np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Rotate vectors (…, 3) by a rotation, or by matrices (…, 3, 3); single, or batched over epochs.

    The sums are written out: library routines round an epoch differently alone and within a batch.
    """
    matrix = rotation if isinstance(rotation, np.ndarray) else rotation.as_matrix()
    vectors = np.asarray(vectors, dtype=float)
    if matrix.size == 9 and vectors.size == 3:  # the same sums, a tenth of the time
        x, y, z = vectors.ravel().tolist()
        a, b, c, d, e, f, g, h, i = matrix.ravel().tolist()
        rotated = np.array([a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + i * z])
        return rotated.reshape((1,) * max(matrix.ndim - 2, vectors.ndim - 1) + (3,))
    v0, v1, v2 = vectors[..., 0], vectors[..., 1], vectors[..., 2]
    product = np.empty(np.broadcast_shapes(matrix.shape[:-1], vectors.shape))
    for row in range(3):
        product[..., row] = matrix[..., row, 0] * v0 + matrix[..., row, 1] * v1 + matrix[..., row, 2] * v2
    return product


def euler_zyx(euler_zyx_deg: tuple[float, float, float]) -> Rotation:
    """Return the intrinsic rotation about z, then the new y, then the new x [deg]: old_from_new."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_euler("ZYX", euler_zyx_deg, degrees=True)


def build_rotation(
    quaternion_xyzw: tuple[float, ...] | None, euler_zyx_deg: tuple[float, float, float] | None
) -> Rotation:
    """Return the rotation of a quaternion (x, y, z, w) or of Euler angles [deg]; the identity without either."""
    from scipy.spatial.transform import Rotation

    if euler_zyx_deg is not None:
        return euler_zyx(euler_zyx_deg)
    return Rotation.from_quat(quaternion_xyzw or (0.0, 0.0, 0.0, 1.0))


def quaternion_xyzw(rotation: Rotation) -> np.ndarray:
    """Return the canonical quaternion (…, 4) in the order x, y, z, w, with w >= 0."""
    quaternion: np.ndarray = rotation.as_quat(canonical=True)
    return quaternion


def matrix_from_quaternion(quaternion_xyzw: np.ndarray) -> np.ndarray:
    """Return the rotation matrices (…, 3, 3) of quaternions (…, 4) x, y, z, w of any length but zero.

    The sums are written out: for a few quaternions this takes a tenth of the time of a `Rotation`.
    """
    q = np.asarray(quaternion_xyzw, dtype=float)
    if q.size == 4:
        x, y, z, w = q.ravel().tolist()
        s = float(np.divide(2.0, x * x + y * y + z * z + w * w))
    else:
        x, y, z, w = q[..., 0], q[..., 1], q[..., 2], q[..., 3]
        s = 2.0 / (x * x + y * y + z * z + w * w)
    matrix = np.empty((*q.shape[:-1], 3, 3))
    sx, sy, sz = s * x, s * y, s * z
    matrix[..., 0, 0], matrix[..., 0, 1], matrix[..., 0, 2] = 1.0 - sy * y - sz * z, sx * y - sz * w, sx * z + sy * w
    matrix[..., 1, 0], matrix[..., 1, 1], matrix[..., 1, 2] = sx * y + sz * w, 1.0 - sx * x - sz * z, sy * z - sx * w
    matrix[..., 2, 0], matrix[..., 2, 1], matrix[..., 2, 2] = sx * z - sy * w, sy * z + sx * w, 1.0 - sx * x - sy * y
    return matrix


def matrix_from_vector(rotation_rad: np.ndarray) -> np.ndarray:
    """Return the rotation matrices (…, 3, 3) of rotation vectors (…, 3): axis times angle [rad]."""
    return matrix_from_quaternion(quaternion_from_vector(rotation_rad))


def quaternion_from_vector(rotation_rad: np.ndarray) -> np.ndarray:
    """Return the quaternions (…, 4) x, y, z, w of rotation vectors (…, 3): axis times angle [rad]."""
    half = 0.5 * length(rotation_rad)
    quaternion = np.empty((*rotation_rad.shape[:-1], 4))
    quaternion[..., :3] = 0.5 * np.sinc(half / np.pi)[..., None] * rotation_rad
    quaternion[..., 3] = np.cos(half)
    return quaternion


def multiply_quaternions(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the products (…, 4) of quaternions (…, 4) x, y, z, w: the rotation b first, then a."""
    product = np.empty(np.broadcast_shapes(a.shape, b.shape))
    product[..., :3] = a[..., 3:] * b[..., :3] + b[..., 3:] * a[..., :3] + cross(a[..., :3], b[..., :3])
    product[..., 3] = a[..., 3] * b[..., 3] - dot(a[..., :3], b[..., :3])
    return product


class Link:
    """Pose and rates of one set of axes (the child) in another (the parent); single, or batched over epochs.

    `translation_m` (…, 3) is the position of the child's origin in parent axes [m], and `matrix` (…, 3, 3) is
    parent_from_child; `pose` is both as one RigidTransform. `velocity_m_s` (…, 3) is the rate of the child's origin relative
    to the parent, in parent axes [m/s]; it contains the transport term where the parent rotates. `angular_velocity_rad_s`
    (…, 3) is that of the child relative to the parent, in child axes [rad/s].
    """

    __slots__ = ("_pose", "angular_velocity_rad_s", "matrix", "translation_m", "velocity_m_s")

    def __init__(
        self,
        pose: RigidTransform | tuple[np.ndarray, np.ndarray],
        velocity_m_s: np.ndarray,
        angular_velocity_rad_s: np.ndarray,
    ) -> None:
        """Join a child to its parent.

        Parameters
        ----------
        pose : parent_from_child, or its translation [m] (…, 3) and rotation matrix (…, 3, 3)
        velocity_m_s : (…, 3) velocity of the child's origin relative to the parent, in parent axes [m/s]
        angular_velocity_rad_s : (…, 3) of the child relative to the parent, in child axes [rad/s]
        """
        known = None if isinstance(pose, tuple) else pose
        given = pose if isinstance(pose, tuple) else (pose.translation, pose.rotation.as_matrix())
        self.translation_m, self.matrix, self.velocity_m_s, self.angular_velocity_rad_s = (
            _read_only(vectors) for vectors in (*given, velocity_m_s, angular_velocity_rad_s)
        )
        self._pose: RigidTransform | None = known

    @property
    def pose(self) -> RigidTransform:
        """Return parent_from_child."""
        if self._pose is None:
            self._pose = pose(self.translation_m, self.rotation)
        return self._pose

    @property
    def rotation(self) -> Rotation:
        """Return the rotation in parent_from_child."""
        from scipy.spatial.transform import Rotation

        return Rotation.from_matrix(self.matrix, assume_valid=True)

    @staticmethod
    def still(parent_from_child: RigidTransform | None = None) -> Link:
        """Return a link without motion."""
        still = (np.zeros(3), np.eye(3)) if parent_from_child is None else parent_from_child
        return Link(still, np.zeros(3), np.zeros(3))

    @property
    def single(self) -> bool:
        """Whether the link holds one epoch, or the same value for all epochs."""
        moving = (self.translation_m, self.velocity_m_s, self.angular_velocity_rad_s)
        return self.matrix.ndim == 2 and all(vectors.ndim == 1 for vectors in moving)

    def __mul__(self, inner: Link) -> Link:
        """Compose a-b and b-c into a-c; rates by the transport theorem."""
        carried = cross(self.angular_velocity_rad_s, inner.translation_m)
        return Link(
            (
                self.translation_m + rotate_vectors(self.matrix, inner.translation_m),
                np.matmul(self.matrix, inner.matrix),
            ),
            self.velocity_m_s + rotate_vectors(self.matrix, inner.velocity_m_s + carried),
            rotate_vectors(_transpose(inner.matrix), self.angular_velocity_rad_s) + inner.angular_velocity_rad_s,
        )

    def inv(self) -> Link:
        """Return the inverse link: the parent relative to the child."""
        transposed = _transpose(self.matrix)
        translation = -rotate_vectors(transposed, self.translation_m)
        velocity = -rotate_vectors(transposed, self.velocity_m_s) - cross(self.angular_velocity_rad_s, translation)
        return Link((translation, transposed), velocity, -rotate_vectors(self.matrix, self.angular_velocity_rad_s))

    def __getitem__(self, epoch: int | slice) -> Link:
        """Return the link at one epoch, or at a slice of them."""
        if self.single:
            return self

        def at(values: np.ndarray, single: int) -> np.ndarray:
            return values if values.ndim == single else values[epoch]

        return Link(
            (at(self.translation_m, 1), at(self.matrix, 2)),
            at(self.velocity_m_s, 1),
            at(self.angular_velocity_rad_s, 1),
        )


def _read_only(values: np.ndarray) -> np.ndarray:
    view = np.asarray(values, dtype=float).view()
    view.flags.writeable = False
    return view


def _transpose(matrix: np.ndarray) -> np.ndarray:
    return np.swapaxes(matrix, -1, -2)


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the vector products of vectors (…, 3)."""
    product = np.empty(a.shape if a.shape == b.shape else np.broadcast_shapes(a.shape, b.shape))
    if product.size == 3:
        (a0, a1, a2), (b0, b1, b2) = a.ravel().tolist(), b.ravel().tolist()
    else:
        a0, a1, a2, b0, b1, b2 = a[..., 0], a[..., 1], a[..., 2], b[..., 0], b[..., 1], b[..., 2]
    product[..., 0] = a1 * b2 - a2 * b1
    product[..., 1] = a2 * b0 - a0 * b2
    product[..., 2] = a0 * b1 - a1 * b0
    return product


def skew(a: np.ndarray) -> np.ndarray:
    """Return the skew-symmetric matrices (…, 3, 3) of vectors (…, 3): their product with b is the vector product a x b."""
    matrix = np.zeros((*a.shape, 3))
    matrix[..., 2, 1], matrix[..., 0, 2], matrix[..., 1, 0] = a[..., 0], a[..., 1], a[..., 2]
    return matrix - np.swapaxes(matrix, -1, -2)


def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return a . b (…) of vectors (…, 3). The sum is written out, for the same bits alone and within a batch."""
    product: np.ndarray = np.asarray(a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2])
    return product


def length(a: np.ndarray) -> np.ndarray:
    """Return the lengths (…) of vectors (…, 3)."""
    size: np.ndarray = np.sqrt(dot(a, a))
    return size


class PoseTree(Mapping[str, Link]):
    """Axes by name, each with one parent and the link to it; the root is ``inertial``.

    Indexing gives the link to the parent. Relative poses are composed along the shortest path. Two bodies joined by a
    relative motion keep their precision: inertial coordinates, 7 nm coarse at GEO, are not used.
    """

    def __init__(self, parents: Mapping[str, str], links: Mapping[str, Link]) -> None:
        self._parents = dict(parents)
        self._links = dict(links)
        self._places: dict[tuple[str, str], tuple[np.ndarray, np.ndarray]] = {}  # those that were asked for

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
        """Return a tree with one more node, or with the link of that node replaced.

        Parameters
        ----------
        link : parent_from_child with rates
        """
        return PoseTree({**self._parents, name: parent}, {**self._links, name: link})

    def extrapolate(self, ahead_s: float) -> PoseTree:
        """Return the tree a short time later, each link with its rates held constant.

        Parameters
        ----------
        ahead_s : the time [s]; negative for before
        """
        links = {
            name: Link(
                (
                    link.translation_m + ahead_s * link.velocity_m_s,
                    np.matmul(link.matrix, matrix_from_vector(ahead_s * link.angular_velocity_rad_s)),
                ),
                link.velocity_m_s,
                link.angular_velocity_rad_s,
            )
            for name, link in self._links.items()
        }
        return PoseTree(self._parents, links)

    def at(self, epoch: int | slice) -> PoseTree:
        """Return the tree at one epoch of a batch, or at a slice of them."""
        return PoseTree(self._parents, {name: link[epoch] for name, link in self._links.items()})

    def pose(self, a: str, b: str) -> RigidTransform:
        """Return a_from_b (Fuller et al., eq. 5), batched where the tree is."""
        from scipy.spatial.transform import Rotation

        translation, matrix = self.place(a, b)
        return pose(translation, Rotation.from_matrix(matrix, assume_valid=True))

    def place(self, a: str, b: str) -> tuple[np.ndarray, np.ndarray]:
        """Return a_from_b as translation [m] (…, 3) and rotation matrix (…, 3, 3), read-only: faster than `pose`."""
        if (a, b) not in self._places:
            self._places[a, b] = self._find_place(a, b)
        return self._places[a, b]

    def _find_place(self, a: str, b: str) -> tuple[np.ndarray, np.ndarray]:
        """Compose the links between two nodes."""
        up, down = self._path(a, b)
        translation, matrix = np.zeros(3), np.eye(3)
        for name in up:
            link = self._links[name]
            transposed = _transpose(link.matrix)
            translation, matrix = (
                translation - rotate_vectors(matrix, rotate_vectors(transposed, link.translation_m)),
                np.matmul(matrix, transposed),
            )
        for name in down:
            link = self._links[name]
            translation, matrix = (
                translation + rotate_vectors(matrix, link.translation_m),
                np.matmul(matrix, link.matrix),
            )
        translation.flags.writeable = matrix.flags.writeable = False
        return translation, matrix

    def link(self, a: str, b: str) -> Link:
        """Return pose and rates of b relative to a: velocity in axes a, angular velocity in axes b."""
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

"""Quaternions x, y, z, w as sums written out, with the same bits alone and within a batch."""

from __future__ import annotations

import numpy as np

from rso_lidar.pose import cross, length


def rotate_by_quaternion(quaternion_xyzw: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Rotate vectors (time, xyz) by unit quaternions (time, 4) a_from_b, from axes b to axes a.

    Parameters
    ----------
    quaternion_xyzw : (time, 4).
    vectors : (time, xyz) in axes b.
    """
    u, w = quaternion_xyzw[..., :3], quaternion_xyzw[..., 3:]
    twice = 2.0 * cross(u, vectors)
    turned: np.ndarray = vectors + w * twice + cross(u, twice)
    return turned


def multiply_quaternions(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the products (time, 4) of quaternions: the rotation b first, then a.

    Parameters
    ----------
    a, b : (time, 4) x, y, z, w.
    """
    product = np.empty(np.broadcast_shapes(a.shape, b.shape))
    product[..., :3] = a[..., 3:] * b[..., :3] + b[..., 3:] * a[..., :3] + cross(a[..., :3], b[..., :3])
    product[..., 3] = a[..., 3] * b[..., 3] - (a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2])
    return product


def quaternion_from_vector(rotation_rad: np.ndarray) -> np.ndarray:
    """Return the quaternions (time, 4) of rotation vectors.

    Parameters
    ----------
    rotation_rad : (time, xyz) axis times angle [rad].
    """
    half = 0.5 * length(rotation_rad)
    quaternion = np.empty((*rotation_rad.shape[:-1], 4))
    quaternion[..., :3] = 0.5 * np.sinc(half / np.pi)[..., None] * rotation_rad
    quaternion[..., 3] = np.cos(half)
    return quaternion

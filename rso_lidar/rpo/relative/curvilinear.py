"""Curvilinear coordinates: height, arc along the track and arc across it, for bodies far apart along an orbit.

They are height r - R and arcs R theta and R phi. Here r and R are the distances of the body and of the chief from the
Earth's centre. The body is theta ahead of the chief in its orbital plane, and phi out of it. Clohessy and Wiltshire's
equations hold for them as for x, y, z. About a circle they do so to all orders in theta (Alfriend, Vadali, Gurfil, How &
Breger, Spacecraft Formation Flying, sec. 5.3).
"""

from __future__ import annotations

import numpy as np


def to_curvilinear(
    position_m: np.ndarray, velocity_m_s: np.ndarray, radius_m: np.ndarray, radial_m_s: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Convert rtn positions and velocities to height and arcs.

    Parameters
    ----------
    position_m, velocity_m_s : (…, 3) in rtn axes [m], [m/s]
    radius_m : (…) the chief's distance from the Earth's centre [m]
    radial_m_s : (…) its rate [m/s]

    Returns
    -------
    arcs_m, rates_m_s : (…, 3) height, arc along and arc across [m], and their rates [m/s]
    """
    x, y, z = np.moveaxis(np.asarray(position_m, dtype=float), -1, 0)
    u, v, w = np.moveaxis(np.asarray(velocity_m_s, dtype=float), -1, 0)
    out, out_rate = radius_m + x, radial_m_s + u
    flat = np.hypot(out, y)
    distance = np.hypot(flat, z)
    flat_rate = (out * out_rate + y * v) / flat
    ahead, across = np.arctan2(y, out), np.arctan2(z, flat)
    # r - R without the cancellation of two large numbers
    height = (x * (2.0 * radius_m + x) + y * y + z * z) / (distance + radius_m)
    rates = (
        (flat * flat_rate + z * w) / distance - radial_m_s,
        radius_m * (out * v - y * out_rate) / flat**2 + radial_m_s * ahead,
        radius_m * (flat * w - z * flat_rate) / distance**2 + radial_m_s * across,
    )
    return np.stack([height, radius_m * ahead, radius_m * across], axis=-1), np.stack(rates, axis=-1)


def to_rectilinear(
    arcs_m: np.ndarray, rates_m_s: np.ndarray, radius_m: np.ndarray, radial_m_s: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Convert height and arcs to rtn positions and velocities; the inverse of `to_curvilinear`."""
    height, along, cross = np.moveaxis(np.asarray(arcs_m, dtype=float), -1, 0)
    height_rate, along_rate, cross_rate = np.moveaxis(np.asarray(rates_m_s, dtype=float), -1, 0)
    theta, phi = along / radius_m, cross / radius_m
    theta_rate, phi_rate = (along_rate - radial_m_s * theta) / radius_m, (cross_rate - radial_m_s * phi) / radius_m
    s, c, sin_phi, cos_phi = np.sin(theta), np.cos(theta), np.sin(phi), np.cos(phi)
    distance, rate = radius_m + height, radial_m_s + height_rate
    flat, flat_rate = distance * cos_phi, rate * cos_phi - distance * sin_phi * phi_rate
    # R (cos - 1) by half angles, so that x of a near body is not the difference of two radii
    back = np.sin(0.5 * theta) ** 2 * cos_phi + np.sin(0.5 * phi) ** 2
    position = (height * c * cos_phi - 2.0 * radius_m * back, flat * s, distance * sin_phi)
    velocity = (
        flat_rate * c - flat * s * theta_rate - radial_m_s,
        flat_rate * s + flat * c * theta_rate,
        rate * sin_phi + distance * cos_phi * phi_rate,
    )
    return np.stack(position, axis=-1), np.stack(velocity, axis=-1)

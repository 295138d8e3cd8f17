"""Two-body motion of many elliptic states side by side, each to its own instants."""

from __future__ import annotations

import numpy as np

from rso_lidar import units
from rso_lidar.errors import PropagationError
from rso_lidar.orbit.two_body.anomaly import eccentric_from_mean
from rso_lidar.pose import dot

GM = units.EARTH_GM_M3_S2


def propagate_many(
    position_m: np.ndarray, velocity_m_s: np.ndarray, time_s: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Propagate elliptic states by two-body motion (Battin, sec. 4.3).

    Parameters
    ----------
    position_m, velocity_m_s : (state, 3) states at the epoch [m], [m/s]
    time_s : (state,) or (state, time) time since the epoch [s]

    Returns
    -------
    position_m, velocity_m_s : (state, 3) or (state, time, 3) [m], [m/s]

    Raises
    ------
    PropagationError
        if a state is not on an ellipse; its `bad` masks those states
    """
    dt = time_s if time_s.ndim == 2 else time_s[:, None]
    r, v = position_m[:, None], velocity_m_s[:, None]
    radius, speed2 = np.sqrt(dot(r, r)), dot(v, v)
    axis = 1.0 / (2.0 / radius - speed2 / GM)
    bad = ~((axis > 0.0) & np.isfinite(axis))[:, 0]
    if bad.any():
        raise PropagationError(
            f"states: {int(bad.sum())} of {len(bad)} are not on an ellipse about the Earth; reduce their covariance",
            bad,
        )
    sigma = dot(r, v) / np.sqrt(GM)
    root = np.sqrt(axis)
    cosine, sine = 1.0 - radius / axis, sigma / root  # e cos E and e sin E
    eccentricity, start = np.hypot(cosine, sine), np.arctan2(sine, cosine)
    mean = start - sine + np.sqrt(GM / axis) / axis * dt
    change = eccentric_from_mean(mean, np.broadcast_to(eccentricity, mean.shape)) - start
    c, s = np.cos(change), np.sin(change)
    there = axis + (radius - axis) * c + sigma * root * s
    f = 1.0 - axis / radius * (1.0 - c)
    g = axis * sigma / np.sqrt(GM) * (1.0 - c) + radius * root / np.sqrt(GM) * s
    f_rate = -np.sqrt(GM) * root / (there * radius) * s
    g_rate = 1.0 - axis / there * (1.0 - c)
    position = f[..., None] * r + g[..., None] * v
    velocity = f_rate[..., None] * r + g_rate[..., None] * v
    return (position, velocity) if time_s.ndim == 2 else (position[:, 0], velocity[:, 0])

"""Frames made by hand for transforms and augmentation: a disc of pixels with known light, and a pose."""

import numpy as np
from scipy.spatial.transform import Rotation

N = 32
F_PX = 400.0
COUNTS_PER_PHOTON = 0.05


def make_frame(seed=0, radius=9.0, light=1500.0, noisy=True):
    """Return a frame of one body 500 m away, with one false alarm in the sky and one inside the body."""
    rng = np.random.default_rng(seed)
    row, col = np.mgrid[:N, :N]
    lit = np.hypot(row - 14, col - 18) < radius
    photons = np.where(lit, light * np.exp(rng.normal(0.0, 0.5, (N, N))), 0.0)
    true_m = np.where(lit, 500.0 + 0.1 * (row - 14) + 0.02 * col, np.nan)
    probability = np.where(lit, 1.0 / (1.0 + np.exp(-(photons - 800.0) / 150.0)), 0.0)
    sigma_m = np.where(lit, 0.05 + 60.0 / np.maximum(photons, 1.0), np.nan)
    reports = lit & (rng.random((N, N)) < probability)
    range_m = np.where(reports, true_m + (sigma_m * rng.standard_normal((N, N)) if noisy else 0.0), np.nan)
    counts = np.where(reports, np.maximum(np.rint(COUNTS_PER_PHOTON * photons), 1), 0)
    range_m[2, 3], counts[2, 3] = 321.0, 17
    range_m[14, 18], counts[14, 18] = 222.0, 19
    point = np.array([2.0, -1.5, 500.0])
    inside = np.flatnonzero(lit.any(axis=1)), np.flatnonzero(lit.any(axis=0))
    return {
        "range_m": range_m.astype("f4"),
        "intensity_counts": counts.astype("u2"),
        "saturated": np.zeros((N, N), "u1"),
        "true_range_m": true_m.astype("f4"),
        "photons": photons.astype("f4"),
        "detection_probability": probability.astype("f4"),
        "range_sigma_m": sigma_m.astype("f4"),
        "part_class_id": np.where(lit, row % 3, -1).astype("i1"),
        "position_m": point,
        "quaternion_xyzw": Rotation.random(rng=rng).as_quat(canonical=True),
        "sun_direction": np.array([0.6, 0.0, 0.8], "f4"),
        "box_px": np.array([inside[0][0], inside[1][0], inside[0][-1], inside[1][-1]], "i2"),
        "intrinsics_px": np.array([F_PX, F_PX, 0.5 * (N - 1), 0.5 * (N - 1)]),
        "sensor_id": np.array(0, "i2"),
        "class_id": np.array(3, "i2"),
    }

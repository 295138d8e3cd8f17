"""Photons made by hand: what a detector is handed, without a scene."""

import numpy as np

from rso_lidar.detector.chain.analog import simulate_analog
from rso_lidar.detector.chain.camera import camera_of
from rso_lidar.records import Photons

# A detector told by round figures, whatever the shipped one has been fitted to.
STATED = {
    "noise_equivalent_photons": 127.0,
    "excess_noise_factor": 3.52,
    "intensity_noise_equivalent_photons": 127.0,
    "intensity_excess_noise_factor": 3.52,
    "range_noise_equivalent_photons": 127.0,
    "range_excess_noise_factor": 3.52,
    "range_plateau_m": 0.05,
    "counts_per_photon": 0.04,
    "compression_counts": 5000.0,
}
RANGE_PER_DELAY_M_S = 299_792_458.0 / 2


def returns(range_m, photons, pixel=None, shape=None, cluster=None, pulse_fwhm_s=8e-9):
    """Return Photons with one return for each range [m], by default one to a pixel, each a cluster of its own."""
    range_m, photons = np.broadcast_arrays(np.atleast_1d(np.asarray(range_m, dtype=float)), photons)
    pixel = np.arange(len(range_m)) if pixel is None else np.asarray(pixel)
    cluster = np.arange(len(range_m)) if cluster is None else np.asarray(cluster)
    first = np.flatnonzero(np.diff(cluster, prepend=-1))
    return Photons(
        shape=(1, len(range_m)) if shape is None else shape,
        pulse_fwhm_s=pulse_fwhm_s,
        **bell(pulse_fwhm_s),
        pixel=pixel,
        delay_s=range_m / RANGE_PER_DELAY_M_S,
        photons=np.asarray(photons, dtype=float),
        depth_spread_s=np.zeros(len(range_m)),
        coherence_cells=np.full(len(range_m), 885.0),
        hit=np.arange(len(range_m)),
        cluster=cluster,
        cluster_pixel=pixel[first],
    )


def simulate_rows(part, photons, rows, rng):
    """Return the analog signals of some rows in the camera of a detector."""
    camera = camera_of(part, photons)
    return simulate_analog(camera.front, camera.axis(rows.length), photons, rows, rng)


def nothing(shape):
    """Return the photons of an empty scene."""
    empty = np.zeros(0)
    return Photons(shape, 8e-9, **bell(8e-9), **dict.fromkeys(RETURNS, empty))


RETURNS = ("pixel", "delay_s", "photons", "depth_spread_s", "coherence_cells", "hit", "cluster", "cluster_pixel")


def bell(fwhm_s):
    """Return step, lateness and power of a Gaussian pulse."""
    step_s = fwhm_s / 48
    power = np.exp2(-((np.arange(-180, 181) / 24) ** 2))
    return {"pulse_step_s": step_s, "late_s": 0.0, "pulse_power_per_s": power / (power.sum() * step_s)}

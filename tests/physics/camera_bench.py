"""A bench for cameras: an image of some surfaces under a given Sun, taken without a scenario."""

import math

import numpy as np

from rso_lidar import imaging, optics, units
from rso_lidar.imaging import Band, Camera, CameraLens, NaturalLight
from rso_lidar.pose import Link, PoseTree
from rso_lidar.records import Truth

GREEN = Band(name="green", wavelength_nm=550.0, width_nm=10.0, quantum_efficiency=0.5)
LOCAL = NaturalLight(earth_albedo=None, moon_m=None, has_earth=False)


def take(
    surfaces, poses, sun, lens, *, motion=None, flash=None, natural=LOCAL, at=None, states=None, seed=1, **settings
):
    """Return image, labels and camera.

    The camera stands at the origin of the bench, in camera axes, unless `at` gives its pose. `poses` are those of the
    surfaces on the bench, by name, and `motion` their velocity [m/s] and angular velocity [rad/s]. `sun` points to the Sun.
    """
    camera = Camera(name="eye", lens=lens, **({"bands": (GREEN,)} | settings))
    speed, turn = (np.array(rate, dtype=float) for rate in motion or (np.zeros(3), np.zeros(3)))
    still = {name: Link.still(pose) for name, pose in poses.items()}
    links = {name: Link((link.translation_m, link.matrix), speed, turn) for name, link in still.items()}
    links |= {"bench": Link.still(), "lidar": Link.still(), "eye": Link.still(at)}
    parents = dict.fromkeys(links, "bench") | {"bench": "inertial"}
    direction = np.full(3, np.nan) if sun is None else np.array(sun, dtype=float) / np.linalg.norm(sun)
    truth = Truth(0.0, PoseTree(parents, links), states or {}, direction)
    of_bands = [tuple(surfaces)] * len(camera.bands)
    image, labels = imaging.take_image(camera, truth, of_bands, natural, flash, np.random.default_rng(seed), threads=1)
    return image, labels, camera


def gathering_m2_sr(lens):
    """Return what each pixel (row, col) gathers of a radiance [m² sr]: A (p/f)² cos⁴ θ times the transmission."""
    focal_m, pitch_m = lens.focal_length_m, lens.pixel_pitch_um * 1e-6
    x = (np.arange(lens.n_cols) + 0.5 - 0.5 * lens.n_cols) * pitch_m / focal_m
    y = (np.arange(lens.n_rows) + 0.5 - 0.5 * lens.n_rows) * pitch_m / focal_m
    cos2 = 1.0 / (1.0 + x**2 + y[:, None] ** 2)
    area_m2 = 0.25 * math.pi * lens.aperture_m**2
    return area_m2 * lens.transmission * (pitch_m / focal_m) ** 2 * cos2**2


def radiance_over_sun(labels, camera, exposure_s=1e-3):
    """Return the radiance of each pixel (row, col) over the irradiance of the Sun [1/sr]."""
    band = camera.bands[0]
    per_m2 = optics.sun_photons_per_s_m2(band.wavelength_m, band.width_nm * units.NM) * band.quantum_efficiency
    return labels.electrons[..., 0] / (per_m2 * exposure_s * gathering_m2_sr(camera.lens))


def make_lens(fov_deg, n=32, **settings):
    """Return the lens of a small image."""
    return CameraLens(**({"fov_deg": fov_deg, "f_number": 4.0, "n_rows": n, "n_cols": n} | settings))

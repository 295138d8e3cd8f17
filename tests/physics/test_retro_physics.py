"""The light of cube corners in the whole walk, beside Huygens's sum over the cube's face with exact path lengths."""

import math

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.mission_analysis.budgets.pixel_light import compute_photons

DIAMETER_M, WAVELENGTH_M, APERTURE_M = 12.7e-3, 1064e-9, 0.105
WALK = f"""
version = 1
name    = "cube corners on a bench"
seed    = 1

[world]
axes = "local"

[time]
start_utc     = 2024-09-17T12:00:00Z
duration_s    = 1
frame_rate_hz = 1

[[target]]
name     = "plate"
model    = "plate"
material = {{ type = "retro_reflector", diameter_mm = {DIAMETER_M * 1e3}, reflectance = 1.0, fill_fraction = 1.0 }}
motion   = {{ type = "fixed", position_m = [100, 0, 0] }}
attitude = {{ type = "fixed" }}

[follower]
motion = {{ type = "fixed", position_m = [0, 0, 0] }}

[lidar.laser]
divergence_deg = 2.0

[lidar.receiver]
fov_deg        = 0.2
aperture_mm    = {APERTURE_M * 1e3}
n_rows         = 8
n_cols         = 8
rays_per_pixel = 1

[lidar.detector]
type = "empirical"
"""


def huygens(range_m, beside_m, aperture_m=APERTURE_M):
    """Return the mean irradiance over the lens, relative to that in the middle of the far field's pattern.

    A ray that enters a cube corner at r leaves it at −r, all with the same path inside. The way from the laser to r and
    from −r to a point of the lens is taken exactly; points of face and lens are Gauss nodes in the square of the radius.
    """
    turn = math.pi * DIAMETER_M / (WAVELENGTH_M * range_m)  # [rad/m] across the lens, from the face's middle to its rim
    v, w = turn * (beside_m + 0.5 * aperture_m), turn * 0.5 * aperture_m
    face, face_weight = disc(0.5 * DIAMETER_M, 12 + int(v / 3), 2.0 * math.pi, 24 + int(1.2 * v))
    lens, lens_weight = disc(
        0.5 * aperture_m, 10 + int(w / 2), math.pi, 12 + int(1.4 * w)
    )  # half: the rest is the same
    laser = np.array([beside_m, 0.0])
    out_m = np.sqrt(((face - laser) ** 2).sum(axis=1) + range_m**2)
    mean = 0.0
    for start in range(0, len(lens), 500):
        some = lens[start : start + 500]
        back_m = np.sqrt(((some[:, None] + face[None]) ** 2).sum(axis=2) + range_m**2)
        field = (np.exp(2j * math.pi / WAVELENGTH_M * (out_m + back_m - 2 * range_m)) * face_weight).sum(axis=1)
        mean += float((np.abs(field) ** 2 * lens_weight[start : start + 500]).sum())
    return mean


def disc(radius_m, n_radii, angle_rad, n_angles):
    """Return points (point, xy) [m] of a disc's sector and their weights, 1 in all."""
    node, weight = np.polynomial.legendre.leggauss(n_radii)
    radius = radius_m * np.sqrt(0.5 * (node + 1.0))
    angle = (np.arange(n_angles) + 0.5) * angle_rad / n_angles
    points = radius[:, None, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    return points.reshape(-1, 2), np.repeat(0.5 * weight / n_angles, n_angles)


@pytest.mark.parametrize(
    ("range_m", "beside_m", "where"),
    [
        (1000.0, 0.0, "at 1 km, the laser in the lens"),
        (1000.0, 0.10, "at 1 km, the laser beside the lens, at the edge of the pattern"),
        (1000.0, 0.15, "at 1 km, the laser beside the lens, outside the pattern"),
        (200.0, 0.07, "at 200 m, the laser beside the lens"),
        (60.0, 0.0, "at 60 m, the laser in the lens, in the near field"),
        (60.0, 0.05, "at 60 m, the laser at the lens's rim, in the near field"),
        (60.0, 0.09, "at 60 m, the laser beside the lens, in the near field"),
    ],
)
def test_photons_of_cube_corners_in_the_walk(range_m, beside_m, where, validation):
    """Eq. 7 with the BRDF of the far field's peak, times the mean of Huygens's pattern over the lens, to 1 %."""
    text = WALK.replace("[100, 0, 0]", f"[{range_m}, 0, 0]")
    cubes = rl.Scenario.loads(
        text.replace("divergence_deg = 2.0", f"divergence_deg = 2.0\noffset_m = [{beside_m}, 0, 0]")
    )
    plate = cubes.target[0].replace(material=rl.Lambertian(reflectance=1.0))
    matt = rl.Scenario.loads(text).replace(target=(plate,))
    # The four pixels in the middle: no more than 0.03 deg off the boresight, where the pattern is the same to 1e-6.
    photons, of_matt = (next(rl.simulate(one)).labels.photons[3:5, 3:5].mean() for one in (cubes, matt))
    peak_per_sr = math.pi / 4 * (DIAMETER_M / WAVELENGTH_M) ** 2  # σ = π³ D⁴ / (4 λ²) of Degnan, over 4π D²π/4
    expected = huygens(range_m, beside_m)
    validation(
        case=f"mean irradiance of a 12.7 mm cube corner over a 105 mm lens {where}",
        source="Huygens's sum over the cube's face, exact path lengths; peak: Degnan 1993",
        expected=expected,
        got=float(photons / of_matt / (peak_per_sr * math.pi)),
        tolerance=0.01 * expected,
        unit="1",
    )
    lidar = cubes.lidar
    (budget,), _ = compute_photons(
        lidar.laser, lidar.receiver, cubes.surfaces[0].materials[0], 0.0, np.array([range_m])
    )
    assert budget == pytest.approx(
        photons, rel=0.01
    )  # both average to 1 %; the closed form's pixel is on the boresight

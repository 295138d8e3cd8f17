"""Light that meets two surfaces, against closed forms: a corner, a sphere from inside, a mirror and two plates."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rso_lidar.optics import Laser, Receiver, collect
from rso_lidar.scene import Lambertian, Phong, bounce
from rso_lidar.units import RANGE_PER_DELAY_M_S
from tests.optics.bench_for_tests import corner, place, plate, see, sphere, surface, truth_of

HOWELL = "Howell, A Catalog of Radiation Heat Transfer Configuration Factors"


def two_bounces(target, truth, receiver, laser, paths, keys=4):
    """Return the photons of either bounce, the standard error of the second, and its mean range [m]."""
    hits = see(target, truth, receiver, laser).hits
    once = collect(hits, laser, receiver)
    first, first_s = once.photons.sum(), once.photons @ once.delay_s
    second, late_s = [], []
    for key in range(keys):
        bounces = bounce(
            hits, target, truth, np.array([key, 2], np.uint32), 1, laser_from_m=laser.offset, n_paths=paths
        )
        both = collect(hits, laser, receiver, bounces=bounces)
        second.append(both.photons.sum() - first)
        late_s.append((both.photons @ both.delay_s - first_s) / second[-1])
    error = np.std(second, ddof=1) / math.sqrt(keys)
    return first, np.mean(second), error, np.mean(late_s) * RANGE_PER_DELAY_M_S


def test_corner_of_two_plates(validation):
    """Far away, two bounces return rho F of what one does: each plate gets the light that the other sends on."""
    rho, size = 0.8, 4.0
    target = [surface("target", corner(size), Lambertian(reflectance=rho))]
    receiver = Receiver(fov_deg=0.02, f_number=2.8, n_rows=8, n_cols=8, rays_per_pixel=1024)
    laser = Laser(divergence_deg=0.02)
    truth = truth_of(target=place((0, 0, 20_000.0)))
    first, second, error, _ = two_bounces(target, truth, receiver, laser, 50_000)
    factor = (0.5 * math.pi - math.sqrt(2) * math.atan(math.sqrt(0.5)) + 0.25 * math.log(0.75)) / math.pi
    validation(
        case="two square plates at right angles, far away: second bounce over the first",
        source=f"reflectance x factor of perpendicular squares ({HOWELL}, C-14)",
        expected=rho * factor,
        got=second / first,
        tolerance=4.5 * error / first + 1e-3 * rho * factor,
        unit="1",
    )


def test_sphere_from_inside(validation):
    """The second bounce inside a sphere is even: each point sends its light evenly over the whole inside."""
    rho, radius, half = 0.6, 5.0, math.tan(math.radians(30.0))
    target = [surface("target", sphere(radius, 4), Lambertian(reflectance=rho))]
    receiver = Receiver(fov_deg=60.0, f_number=2.8, n_rows=16, n_cols=16, rays_per_pixel=64)
    laser = Laser(divergence_deg=60.0)
    first, second, error, _ = two_bounces(target, truth_of(target=place()), receiver, laser, 50_000)
    # First: b rho/pi A eta / R^2 times the integral of cos. Second: rho/pi rho E/(4 pi R^2) A eta times that of cos^4.
    at = (np.arange(2000) + 0.5) / 1000.0 * half - half
    cosine = (1.0 + at**2 + at[:, None] ** 2) ** -0.5
    density = 1.0 / (2.0 * half) ** 2
    expected = rho / (4.0 * math.pi) * np.mean(cosine**4) / (density * np.mean(cosine))
    validation(
        case="lidar in the middle of a sphere, 60 degrees wide: second bounce over the first",
        source="each point of a sphere lights all others evenly",
        expected=expected,
        got=second / first,
        tolerance=4.5 * error / first + 2e-3 * expected,
        unit="1",
    )


@pytest.mark.parametrize("shift_m", [(0.0, 0.0, 0.0), (1.0, 2.0, 0.5)])
def test_further_bounces_inside_a_sphere(validation, shift_m):
    """After the first, each bounce lights the whole sphere evenly, wherever the lidar is: each has rho of the one before."""
    rho, keys, most = 0.6, 4, (1, 2, 3, 4, 6)
    target = [surface("target", sphere(5.0, 4), Lambertian(reflectance=rho))]
    receiver = Receiver(fov_deg=60.0, f_number=2.8, n_rows=16, n_cols=16, rays_per_pixel=64)
    laser, truth = Laser(divergence_deg=60.0), truth_of(target=place(shift_m))
    hits = see(target, truth, receiver, laser).hits
    light = np.empty((keys, len(most)))
    for key in range(keys):
        for column, n in enumerate(most):
            words = np.array([key, 3], np.uint32)
            bounces = bounce(hits, target, truth, words, 1, n_paths=6_000, most=n) if n > 1 else None
            light[key, column] = collect(hits, laser, receiver, bounces=bounces).photons.sum()
    second, third, fourth, fifth_and_sixth = np.diff(light, axis=1).T
    for name, got, expected in (
        ("third bounce over the second", third / second, rho),
        ("fourth bounce over the third", fourth / third, rho),
        ("fifth and sixth bounce over the fourth", fifth_and_sixth / fourth, rho + rho**2),
    ):
        validation(
            case=f"lidar in a sphere, {math.hypot(*shift_m):.1f} m beside its middle: {name}",
            source="each point of a sphere lights all others evenly",
            expected=expected,
            got=got.mean(),
            tolerance=4.5 * got.std(ddof=1) / math.sqrt(keys) + 2e-3,
            unit="1",
        )


@pytest.mark.parametrize("exponent", [200.0, 20_000.0])
def test_mirror_lights_a_wall(validation, exponent):
    """A mirror at 45 degrees sends the beam across to a wall; the wall's light comes by the mirror as well.

    Light takes each path both ways, so the second bounce is twice the mirrored beam's light on the wall.
    """
    rho, k_s, side, away = 0.5, 0.7, 1.0, 4.0
    mirror = Rotation.from_euler("y", -45, degrees=True).apply(plate(side).reshape(-1, 3)).reshape(-1, 3, 3)
    wall = Rotation.from_euler("y", 60, degrees=True).apply(plate(6.0).reshape(-1, 3)).reshape(-1, 3, 3)
    wall = wall + np.array([away, 0.0, 0.0])
    part = np.repeat([0, 1], 2).astype(np.int16)
    names = {"part": part, "part_names": ("mirror", "wall")}
    given = {"mirror": Phong(diffuse=0.0, specular=k_s, exponent=exponent), "wall": Lambertian(reflectance=rho)}
    target = [surface("target", np.concatenate([mirror, wall]), part_materials=given, **names)]
    range_m = 2000.0
    truth = truth_of(target=place((-2.0, 0, range_m)))
    receiver = Receiver(fov_deg=0.25, f_number=2.8, n_rows=16, n_cols=16, rays_per_pixel=256)
    laser = Laser(divergence_deg=0.25)
    first, second, error, late_m = two_bounces(target, truth, receiver, laser, 30_000)
    # Of the light on a modified Phong mirror at theta, k_s cos(theta) (n + 2) / (n + 1) leaves in its narrow lobe.
    cos_mirror = math.sqrt(0.5)
    reflected = k_s * cos_mirror * (exponent + 2.0) / (exponent + 1.0)
    hits = see(target, truth, receiver, laser).hits
    mirror_area, wall_area = np.bincount(hits.part, hits.weight)  # as the rays see them, edges and all
    expected = 2.0 * mirror_area * reflected / wall_area  # both seen by the lens at the wall's angle
    broad = 1.0 / exponent  # the lobe's mean square angle: cosines and distances change to that order
    validation(
        case=f"a mirror of exponent {exponent:g} and a matt wall: second bounce over the first",
        source="the mirrored beam on the wall, and the same light the other way",
        expected=expected,
        got=second / first,
        tolerance=(4.5 * error / first) + (2e-3 + 2.0 * broad) * expected,
        unit="1",
    )
    validation(
        case=f"a mirror of exponent {exponent:g} and a matt wall: mean range of the second bounce",
        source="half the way by the mirror's middle",
        expected=range_m + 0.5 * away,
        got=late_m,
        tolerance=0.01 + 4.0 * broad * away,
        unit="m",
    )


def test_pixels_that_the_beam_leaves_dark(validation):
    """A beam on one plate of a corner lights the other: the sum of all pairs of small squares of the two plates."""
    rho, size, n, range_m = 0.8, 2.0, 16, 100.0
    receiver = Receiver(fov_deg=3.0, f_number=2.8, n_rows=16, n_cols=16, rays_per_pixel=256)
    laser = Laser(divergence_deg=0.5)
    shift = 0.9
    target = [surface("target", corner(size), Lambertian(reflectance=rho))]
    truth = truth_of(target=place((shift, 0, range_m)))
    hits = see(target, truth, receiver, laser).hits
    assert (hits.rays.direction[hits.ray, 0] * hits.range_m < shift).all(), "only the left plate is lit"
    _, second, error, _ = two_bounces(target, truth, receiver, laser, 30_000)
    # Light of small squares of the beam, on the left plate x - z = shift - range, by small squares of the right one.
    at = ((np.arange(2 * n) + 0.5) / n - 1.0) * laser.half_width_tangent
    right_u, right_v = (np.arange(4 * n) + 0.5) / (4 * n) * size, (np.arange(2 * n) + 0.5) / (2 * n) * size - 0.5 * size
    a, b = (one.ravel() for one in np.meshgrid(at, at))
    u, v = (one.ravel() for one in np.meshgrid(right_u, right_v))
    area, slant = size**2 / (8 * n * n), math.sqrt(0.5)
    left = np.stack([a, b, np.ones_like(a)], axis=1) * ((range_m - shift) / (1.0 - a))[:, None]
    assert np.abs(left[:, 1]).max() < 0.5 * size and (shift - left[:, 0]).max() < size * slant
    right = np.stack([shift + u * slant, v, range_m - u * slant], axis=1)
    normal_left, normal_right = np.array([slant, 0, -slant]), np.array([-slant, 0, -slant])
    across = right[None] - left[:, None]
    apart = np.linalg.norm(across, axis=2)
    factor = np.clip(across @ normal_left, 0, None) * np.clip(-(across @ normal_right), 0, None) / (math.pi * apart**4)
    on_right = np.full(len(left), rho * laser.photons / len(left)) @ factor
    back_m = np.linalg.norm(right, axis=1)
    lens = receiver.aperture_area_m2 * receiver.transmission * (right[:, 2] / back_m)
    seen = on_right * rho / math.pi * area * (-(right @ normal_right) / back_m) * lens / back_m**2
    validation(
        case="a narrow beam on one plate of a corner: light by the other plate",
        source="sum over pairs of small squares",
        expected=seen.sum(),
        got=second,
        tolerance=4.5 * error + 2e-3 * seen.sum(),
        unit="photons",
    )

"""Images of cameras against closed forms and published figures: photons, noise, stars, shutters, phases, limb."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rso_lidar import units
from rso_lidar.imaging import Flash, ImageSensor, NaturalLight
from rso_lidar.optics import GaussianPsf, Laser, sun_photons_per_s_m2
from rso_lidar.records import BodyState
from rso_lidar.scene import Lambertian
from tests.optics.bench_for_tests import place, plate, sphere, surface
from tests.physics.camera_bench import GREEN, gathering_m2_sr, make_lens, take

REFLECTANCE = 0.30
GREY = Lambertian(reflectance=REFLECTANCE)
SUN_W_M2_NM = 1.8508  # ASTM G173-03, extraterrestrial, mean over 25 nm about 550 nm
PHOTON_J = 6.626_070_15e-34 * 299_792_458.0 / 550e-9
V_ZERO_W_M2_NM = 3.63e-11  # of a star of V = 0 at 548 nm: Bessell, Castelli and Plez, A&A 333, 231 (1998), table A2
V_ZERO_SHARE = 0.03  # to which zero points of photometric systems and magnitudes of the Sun agree
EARTH = NaturalLight(earth_albedo=0.3, moon_m=None, has_earth=True)


def check(validation, case, source, expected, got, tolerance, unit):
    """Compare a number with the outside world's."""
    validation(case=case, source=source, expected=expected, got=got, tolerance=tolerance, unit=unit)


@pytest.mark.parametrize("incidence_deg", [0.0, 60.0])
def test_electrons_of_a_plate_in_sunlight(validation, incidence_deg):
    """E · A · (p/f)² · cos⁴ θ · T · ρ/π · cos i · QE · t in each pixel of a field of 60 degrees."""
    incidence = math.radians(incidence_deg)
    lens, exposure_s = make_lens(60.0, 24), 2e-3
    sun = (math.sin(incidence), 0.0, -math.cos(incidence))
    wall = surface("wall", plate(400.0), GREY)
    _, labels, _ = take([wall], {"wall": place((0.0, 0.0, 100.0))}, sun, lens, exposure_ms=1e3 * exposure_s)
    photons_m2 = SUN_W_M2_NM * GREEN.width_nm / PHOTON_J * exposure_s
    electrons = photons_m2 * 0.5 * REFLECTANCE / math.pi * math.cos(incidence) * gathering_m2_sr(lens)
    # the mean over a pixel of 2.5 degrees differs from its middle by (p/f)²/24 of 8, the curvature of cos⁴ θ: 0.08 %
    worst = float(np.abs(labels.electrons[..., 0] / electrons - 1.0).max())
    validation(
        case=f"plate, Sun {incidence_deg:g} deg from its normal, field of 60 deg: worst pixel",
        source="Lambert's law and cos⁴ θ",
        expected=0.0,
        got=100.0 * worst,
        tolerance=0.15,
        unit="%",
    )


def test_electrons_of_the_laser(validation):
    """A square beam on a plate, seen by a camera 0.4 m beside it: N · cos α · ρ/π · A (p/f)² cos⁴ θ · T · QE."""
    laser, pulses, range_m = Laser(wavelength_nm=850.0, energy_mj=5.0, divergence_deg=4.0), 3, 50.0
    band = GREEN.replace(wavelength_nm=850.0, quantum_efficiency=0.2)
    lens = make_lens(1.0, 8, transmission=0.8)
    wall = surface("wall", plate(20.0), GREY)
    flash = Flash(laser, pulses, (wall,))
    poses = {"wall": place((0.0, 0.0, range_m))}
    _, labels, _ = take([wall], poses, None, lens, flash=flash, bands=(band,), at=place((0.4, 0.0, 0.0)))
    density_m2 = laser.energy_mj * 1e-3 * pulses / (4.0 * math.tan(math.radians(2.0)) ** 2 * range_m**2)
    photons_m2 = density_m2 / (PHOTON_J * 550.0 / 850.0)
    electrons = photons_m2 * REFLECTANCE / math.pi * 0.2 * gathering_m2_sr(lens)
    got = float(labels.electrons[..., 0].sum())
    validation(
        case="plate in the laser's light",
        source="closed form",
        expected=float(electrons.sum()),
        got=got,
        tolerance=1e-3 * float(electrons.sum()),
        unit="electrons",
    )
    _, late, _ = take([wall], poses, None, lens, flash=flash, bands=(band,), at=place((0.4, 0.0, 0.0)), start_ms=0.1)
    assert not late.electrons.any(), "the pulse has returned before the exposure begins"


def test_photon_transfer(validation):
    """EMVA 1288: variance over mean is the gain, in the dark the read noise and 1/12; a full well and a full converter."""
    sensor = ImageSensor(full_well_electrons=9000.0, read_noise_electrons=6.0, electrons_per_count=3.0, bits=12)
    levels, n = np.array([0.0, 200.0, 1000.0, 4000.0]), 200_000
    counts = np.stack([sensor.read(np.full(n, level), np.random.default_rng(k)) for k, level in enumerate(levels)])
    mean, variance = counts.mean(axis=1), counts.var(axis=1)
    spread = math.sqrt(2.0 / n)  # of a variance, relative
    assert mean == pytest.approx(64.0 + levels / 3.0, abs=5.0 * math.sqrt(variance.max() / n))
    slope = (variance[3] - variance[0]) / (mean[3] - mean[0])
    source = "EMVA 1288, release 4.0"
    check(
        validation,
        "slope of the photon transfer curve",
        source,
        1.0 / 3.0,
        slope,
        5.0 * spread / 3.0,
        "counts per electron",
    )
    dark = (6.0 / 3.0) ** 2 + 1.0 / 12.0
    check(validation, "variance in the dark", source, dark, float(variance[0]), 5.0 * spread * dark, "counts²")
    full = sensor.read(np.full(n, 2e4), np.random.default_rng(9))
    assert full.mean() == pytest.approx(64.0 + 3000.0, abs=5.0 * 2.1 / math.sqrt(n))
    assert full.std() == pytest.approx(math.sqrt(dark), rel=5.0 * spread), "a full well has no shot noise"
    in_sun = sensor.read(np.full(n, 1e25), np.random.default_rng(9))
    assert in_sun.mean() == pytest.approx(full.mean(), abs=0.1), "the Sun on one pixel"
    narrow = sensor.replace(electrons_per_count=1.0)
    assert narrow.read(np.full(4, 8000.0), np.random.default_rng(1)).tolist() == [4095] * 4


def test_electrons_grow_with_the_exposure():
    wall, lens = surface("wall", plate(40.0), GREY), make_lens(2.0, 8)
    seen = [
        take([wall], {"wall": place((0, 0, 100.0))}, (0, 0, -1), lens, exposure_ms=each, start_ms=3.0)[1].electrons
        for each in (1.0, 2.0)
    ]
    np.testing.assert_allclose(seen[1], 2.0 * seen[0], rtol=1e-6)


# Yale Bright Star Catalogue, 5th ed. (Hoffleit and Warren 1991): right ascension, declination (J2000), V
STARS = {
    "Sirius": ((6, 45, 8.9), (-1, 16, 42, 58), -1.46),
    "Vega": ((18, 36, 56.3), (1, 38, 47, 1), 0.03),
    "Arcturus": ((14, 15, 39.7), (1, 19, 10, 57), -0.04),
    "Betelgeuse": ((5, 55, 10.3), (1, 7, 24, 25), 0.50),
    "Polaris": ((2, 31, 48.7), (1, 89, 15, 51), 2.02),
}


@pytest.mark.parametrize("name", STARS)
def test_stars(validation, name):
    """A star on a tilted camera: its centroid within 3 arcseconds, its light by the flux of V = 0."""
    (hours, minutes, seconds), (sign, degrees, arcmin, arcsec), magnitude = STARS[name]
    ascension = math.radians(15.0 * (hours + minutes / 60.0 + seconds / 3600.0))
    declination = sign * math.radians(degrees + arcmin / 60.0 + arcsec / 3600.0)
    ahead = Rotation.from_euler("ZY", [ascension, 0.5 * math.pi - declination])  # turns +z to the star
    root_from_camera = ahead * Rotation.from_euler("zxy", [30.0, 0.05, -0.03], degrees=True)
    star = root_from_camera.inv().apply(ahead.apply([0.0, 0.0, 1.0]))
    lens = make_lens(0.36, 64, psf=GaussianPsf(sigma_um=6.0))
    state = {"follower": BodyState(np.array([7e6, 0.0, 0.0]), np.zeros(3))}
    pose = place((0.0, 0.0, 0.0), root_from_camera)
    band = GREEN.replace(wavelength_nm=548.0)
    options = {"at": pose, "states": state, "sky": ("stars",), "exposure_ms": 100.0, "bands": (band,)}
    _, labels, _ = take([], {}, (1.0, 0.0, 0.0), lens, natural=EARTH, **options)
    light = labels.electrons[..., 0].astype(float)
    row, col = (np.sum(light * at) / light.sum() for at in np.indices(light.shape) + 0.5)
    x, y = star[:2] / star[2]
    off = np.array([col - 32.0, row - 32.0]) * lens.pixel_tangent - [x, y]
    source = "Bright Star Catalogue, 5th ed."
    apart_arcsec = float(np.linalg.norm(off)) / units.DEG * 3600.0
    check(validation, f"{name}: place in the image", source, 0.0, apart_arcsec, 3.0, "arcsec")
    photon_j = PHOTON_J * 550.0 / 548.0
    flux = V_ZERO_W_M2_NM * 10.0 ** (-0.4 * magnitude) * band.width_nm / photon_j
    electrons = flux * lens.aperture_area_m2 * lens.transmission * 0.5 * 0.1
    # the zero point, and 0.05 magnitudes between catalogues
    allowed = V_ZERO_SHARE + 0.05
    check(validation, f"{name}: electrons", f"{source}; Bessell et al. 1998", 1.0, light.sum() / electrons, allowed, "")


def test_sunlight_is_that_of_the_sun_s_magnitude(validation):
    """V = -26.76 (Willmer, ApJS 236, 47, 2018) and the flux of V = 0 give the Sun's irradiance at 548 nm."""
    expected = V_ZERO_W_M2_NM * 10.0 ** (0.4 * 26.76)
    got = sun_photons_per_s_m2(548e-9, 10e-9) * PHOTON_J * 550.0 / 548.0 / 10.0
    source = "Willmer 2018; Bessell et al. 1998"
    check(validation, "sunlight at 548 nm", source, expected, got, V_ZERO_SHARE * expected, "W m⁻² nm⁻¹")


def find_edge(labels):
    """Return the column at which a bright left part ends, row by row: light of a row over that of its brightest pixel."""
    light = labels.electrons[..., 0].astype(float)
    return (light / light.max(axis=1, keepdims=True)).sum(axis=1)


def take_moving_edge(pixels_per_ms, **settings):
    """Return labels of a plate whose right edge starts in the middle of the image and moves to the right."""
    lens = make_lens(2.0, 32)
    half = plate(40.0)
    half[..., 0] -= 20.0
    speed_m_s = pixels_per_ms * 1e3 * lens.pixel_tangent * 100.0
    wall = surface("wall", half, GREY)
    motion = ((speed_m_s, 0.0, 0.0), (0.0, 0.0, 0.0))
    return take([wall], {"wall": place((0, 0, 100.0))}, (0, 0, -1), lens, motion=motion, **settings)[1]


def test_a_rolling_shutter_leans_an_edge(validation):
    """An edge that moves by 2 pixels in 1 ms leans by 0.2 pixels a row where rows begin 0.1 ms after each other."""
    edge = find_edge(take_moving_edge(2.0, exposure_ms=0.1, row_delay_us=100.0))
    lean = np.polyfit(np.arange(32), edge, 1)
    source = "rate times delay"
    check(validation, "lean of an edge under a rolling shutter", source, 0.2, float(lean[0]), 0.004, "pixels a row")
    # the middle of the exposure of row 0 is 0.05 ms after its begin; light is cast at every quarter of a pixel
    check(validation, "edge in the first row", source, 16.1, float(np.polyval(lean, 0)), 0.13, "pixels")


def test_motion_blurs_an_edge_evenly(validation):
    """An edge that moves by 6 pixels during the exposure is a ramp of 6 pixels: its slope is 1/6 a pixel."""
    light = take_moving_edge(2.0, exposure_ms=3.0).electrons[16, :, 0].astype(float)
    ramp = light / light.max()
    assert ramp[:16] == pytest.approx(np.ones(16), rel=1.3e-3), "cos⁴ θ at the edge of the field"
    assert not ramp[22:].any()
    expected = 1.0 - (np.arange(16, 22) + 0.5 - 16.0) / 6.0
    worst = float(np.abs(ramp[16:22] - expected).max())
    check(
        validation,
        "ramp of a blurred edge: worst pixel",
        "rate times exposure",
        0.0,
        worst,
        1.0 / 24.0,
        "of its height",
    )


@pytest.mark.parametrize(
    ("phase_deg", "distance_m", "allowed"),
    [(30.0, 1e3, 0.01), (90.0, 1e3, 0.01), (130.0, 1e3, 0.01), (90.0, 1e5, 0.03)],
)
def test_light_of_a_sphere_over_its_phase(validation, phase_deg, distance_m, allowed):
    """E · (2/3) ρ · (R/d)² · (sin φ + (π - φ) cos φ) / π: Lambert's sphere, of which the Sun lights half.

    At 100 km it covers 1/6 of a pixel's side, and some 1,000 rays sample it.
    """
    phase, radius_m = math.radians(phase_deg), 1.0
    lens = make_lens(0.15 if distance_m < 1e4 else 0.17, 24, rays_per_pixel=64 if distance_m < 1e4 else 4)
    ball = surface("ball", sphere(radius_m, 4), GREY)
    sun = (math.sin(phase), 0.0, -math.cos(phase))
    beside_m = 0.3 * lens.pixel_tangent * distance_m
    _, labels, _ = take([ball], {"ball": place((beside_m, 0.0, distance_m))}, sun, lens)
    curve = (math.sin(phase) + (math.pi - phase) * math.cos(phase)) / math.pi
    at_lens = 2.0 / 3.0 * REFLECTANCE * (radius_m / distance_m) ** 2 * curve
    photons_m2 = SUN_W_M2_NM * GREEN.width_nm / PHOTON_J * 1e-3
    expected = photons_m2 * at_lens * lens.aperture_area_m2 * lens.transmission * 0.5
    got = float(labels.electrons.sum(dtype=float))
    case = f"sphere of 1 m at {1e-3 * distance_m:g} km and a phase of {phase_deg:g} deg"
    check(validation, case, "Lambert 1760; phase law of a sphere", expected, got, allowed * expected, "electrons")


def test_the_limb_of_the_earth(validation):
    """From 9,000 km, without a target in view, the limb is asin(R/r) from the nadir."""
    r_m, lens, below = 9e6, make_lens(4.0, 64), math.radians(0.3)
    tilt = math.asin(units.EARTH_RADIUS_M / r_m) + below  # of the boresight from the nadir
    boresight = np.array([-math.cos(tilt), 0.0, math.sin(tilt)])
    down = np.array([-math.sin(tilt), 0.0, -math.cos(tilt)])
    turn = Rotation.from_matrix(np.stack([np.cross(down, boresight), down, boresight], axis=1))
    place_m = np.array([r_m, 0.0, 0.0])
    options = {"at": place(place_m, turn), "states": {"follower": BodyState(place_m, np.zeros(3))}, "sky": ("earth",)}
    _, labels, _ = take([], {}, (1.0, 0.0, 1.0), lens, natural=EARTH, **options)
    column = labels.electrons[:, 31:33, 0].sum(axis=1, dtype=float)
    top = int(np.flatnonzero(column)[0])
    assert not column[:top].any()
    row = top + 1.0 - column[top] / column[top + 1]
    expected = 32.0 + math.tan(below) / lens.pixel_tangent
    check(validation, "row of the Earth's limb", "asin(R/r)", expected, row, 0.1, "pixels")

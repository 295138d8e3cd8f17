"""Light out and light back against closed forms: walls, plates, spheres, mirrors and the system of Fuller et al.

A wall at distance d that faces the lidar returns b rho A eta cos^4(theta) / d^2 per unit area of the tangent plane, and
the integral of cos^4 over a rectangle is the configuration factor of a differential element and a parallel rectangle
(Howell, A Catalog of Radiation Heat Transfer Configuration Factors, B-3; over a disc, B-12), times pi.
"""

import math

import numpy as np
import pytest
from scipy import integrate, special
from scipy.spatial.transform import Rotation

from rso_lidar.optics import Laser, Receiver
from rso_lidar.scene import Lambertian, Phong
from tests.optics.bench_for_tests import (
    PAPER_LASER,
    PAPER_RECEIVER,
    box,
    look,
    place,
    plate,
    see,
    sphere,
    surface,
    truth_of,
)

RHO = 0.30 / math.pi
FOOTPRINTS = ["square", "circle", "gaussian", "as_printed"]


def corner_rectangle(x, y):
    """Return the integral of 1/(1 + x^2 + y^2)^2 over [0, x] by [0, y]: pi times Howell's factor B-3."""
    a, b = math.sqrt(1 + x * x), math.sqrt(1 + y * y)
    return 0.5 * (x / a * math.atan(y / a) + y / b * math.atan(x / b))


def received(laser, receiver, range_m, rho=RHO):
    """Return rho A eta E / R^2 [photons], which a footprint's shape multiplies."""
    return rho * receiver.aperture_area_m2 * receiver.transmission * laser.photons / range_m**2


def wall_total(laser, half_field):
    """Return the integral of b/E cos^4 over the field (square, half a side `half_field`) that the footprint lights."""
    t = math.tan(math.radians(laser.divergence_deg) / 2)
    if laser.footprint in ("square", "as_printed"):
        lit = min(t, half_field)
        return 4 * corner_rectangle(lit, lit) / (4 * t * t if laser.footprint == "square" else t * t)
    if laser.footprint == "circle":
        assert t <= half_field * (1 + 1e-12)
        return 1 / (1 + t * t)  # sin^2 / tan^2 of the half angle: Howell's B-12 over the disc's area
    bell = lambda y, x: math.exp(-2 * (x * x + y * y) / t**2) / (1 + x * x + y * y) ** 2  # noqa: E731
    reach = min(half_field, 6 * t)
    inside, _ = integrate.dblquad(bell, 0, reach, 0, reach, epsabs=0, epsrel=1e-9)
    return 4 * inside * 2 / (math.pi * t * t)


def pixel_share(laser, receiver):
    """Return the integral of b/E cos^4 over one of the four pixels that meet on the boresight."""
    t, p = math.tan(math.radians(laser.divergence_deg) / 2), receiver.pixel_tangent
    if laser.footprint == "gaussian":
        bell = lambda y, x: math.exp(-2 * (x * x + y * y) / t**2) / (1 + x * x + y * y) ** 2  # noqa: E731
        return integrate.dblquad(bell, 0, p, 0, p, epsabs=0, epsrel=1e-9)[0] * 2 / (math.pi * t * t)
    area = {"square": 4 * t * t, "circle": math.pi * t * t, "as_printed": t * t}[laser.footprint]
    return corner_rectangle(p, p) / area


@pytest.mark.parametrize("footprint", FOOTPRINTS)
@pytest.mark.parametrize("fov_deg", [2.5, 45.0])
def test_a_wall_that_fills_the_field(validation, fov_deg, footprint):
    receiver = Receiver(fov_deg=fov_deg, f_number=2.8)
    laser = Laser(divergence_deg=fov_deg, footprint=footprint)
    half = math.tan(math.radians(fov_deg) / 2)
    seen = look(plate(5 * half * 1000.0), place((0, 0, 1000.0)), receiver, laser)
    full = received(laser, receiver, 1000.0)
    total = full * wall_total(laser, half)
    validation(
        case=f"wall over {fov_deg:g} deg, {footprint}: all photons",
        source="Howell B-3, B-12 or quadrature",
        expected=total,
        got=seen.by_pixel.sum(),
        tolerance=1e-3 * total,
        unit="photons",
    )
    pixel = full * pixel_share(laser, receiver)
    for row, col in ((63, 63), (64, 64)):
        validation(
            case=f"wall over {fov_deg:g} deg, {footprint}: pixel ({row}, {col})",
            source="Howell B-3 or quadrature",
            expected=pixel,
            got=seen.by_pixel[row, col],
            tolerance=1e-3 * pixel,
            unit="photons",
        )


@pytest.mark.parametrize("pixels", [1.3, 10.37])
@pytest.mark.parametrize("footprint", ["square", "circle", "gaussian"])
def test_a_narrow_beam_whose_edge_cuts_pixels(validation, footprint, pixels):
    """Fuller et al., sec. 5: divergence down to 10 x 10 or 20 x 20 pixels. Energy does not depend on the edge's place."""
    laser = Laser(
        divergence_deg=2 * math.degrees(math.atan(pixels / 2 * PAPER_RECEIVER.pixel_tangent)), footprint=footprint
    )
    # The pixels about the axis have the same error, by symmetry: their sum is no better known than one of them.
    receiver = PAPER_RECEIVER.replace(sampling_error=1e-3)
    seen = look(plate(300.0), place((0, 0, 1000.0)), receiver, laser)
    total = received(laser, PAPER_RECEIVER, 1000.0) * wall_total(laser, math.tan(math.radians(1.25)))
    validation(
        case=f"beam of {pixels:g} pixels on a wall, {footprint}: all photons",
        source="Howell B-3, B-12 or quadrature",
        expected=total,
        got=seen.by_pixel.sum(),
        tolerance=(2.0 if footprint == "gaussian" else 1.0) * receiver.sampling_error * total,  # the tail has few rays
        unit="photons",
    )
    if footprint != "gaussian":
        row, col = np.nonzero(seen.by_pixel)
        beyond = np.maximum(np.abs(row - 63.5), np.abs(col - 63.5)) - 0.5 >= pixels / 2
        assert len(row) > 0 and not beyond.any(), "light outside the footprint"


def test_a_narrow_beam_gains_what_the_seed_hopes_for(validation):
    """Fuller et al., sec. 5: light only 20 x 20 or 10 x 10 pixels; energy per pixel grows by the ratio of areas."""
    wide = look(plate(300.0), place((0, 0, 1000.0))).by_pixel[64, 64]
    for pixels in (20, 10):
        angle = 2 * math.degrees(math.atan(pixels / 2 * PAPER_RECEIVER.pixel_tangent))
        narrow = look(plate(300.0), place((0, 0, 1000.0)), laser=Laser(divergence_deg=angle)).by_pixel
        validation(
            case=f"beam of {pixels} x {pixels} pixels: range gain",
            source="square root of the areas' ratio",
            expected=128 / pixels,
            got=math.sqrt(narrow[64, 64] / wide),
            tolerance=1e-4 * 128 / pixels,
            unit="1",
        )
        assert np.count_nonzero(narrow) == pixels**2, "a pixel beside the footprint is dark, to the last photon"


def test_a_lambertian_shell_returns_what_a_hemisphere_gives_the_lens(validation):
    """A shell about the lidar meets every ray head on: N pi R^2 / (A rho0 eta) is the energy sent, times the mean cos.

    For a circle of half angle h the mean of the aperture's cos(theta) over the tangent plane is 2 (1/cos h - 1)/tan^2 h.
    """
    laser, receiver = Laser(divergence_deg=60, footprint="circle"), Receiver(fov_deg=75, f_number=2.8)
    seen = look(sphere(500.0, 5), place(), receiver, laser)
    sent = seen.by_pixel.sum() * math.pi * 500.0**2 / (receiver.aperture_area_m2 * 0.30 * receiver.transmission)
    h = math.radians(30)
    expected = laser.photons * 2 * (1 / math.cos(h) - 1) / math.tan(h) ** 2
    validation(
        case="Lambertian shell about the lidar: energy sent, worked back",
        source="energy conservation",
        expected=expected,
        got=sent,
        tolerance=1e-3 * expected,
        unit="photons",
    )


def test_a_lambertian_sphere_far_away(validation):
    """A small Lambertian sphere in a uniform beam: the geometric albedo of a Lambert sphere is 2/3 of its reflectance.

    Its intensity toward the lidar is 2/3 rho0 E r^2 (Russell 1916; Lester et al. 1979), E the irradiance.
    """
    laser = PAPER_LASER.replace(energy_mj=5e5)  # so strong that photon noise excuses no error of sampling
    seen = look(sphere(20.0, 5), place((0, 0, 20_000.0)), PAPER_RECEIVER.replace(sampling_error=1e-3), laser)
    irradiance = laser.photons / (4 * math.tan(math.radians(1.25)) ** 2 * 20_000.0**2)
    aperture = PAPER_RECEIVER.aperture_area_m2 * PAPER_RECEIVER.transmission / 20_000.0**2
    expected = 2 / 3 * 0.30 * irradiance * 20.0**2 * aperture
    validation(
        case="Lambertian sphere, 20 m at 20 km: all photons",
        source="geometric albedo 2/3 (Russell 1916)",
        expected=expected,
        got=seen.by_pixel.sum(),
        tolerance=3e-3 * expected,
        unit="photons",
    )


def paper_pixel(range_m, receiver=PAPER_RECEIVER, laser=PAPER_LASER, material=None, tilt_deg=0.0):
    """Return the mean photons of the four pixels on the boresight, on a wall that fills them."""
    lens = receiver.replace(
        n_rows=2,
        n_cols=2,
        fov_deg=None,
        focal_length_mm=receiver.focal_length_m * 1e3,
        f_number=None,
        aperture_mm=receiver.aperture_m * 1e3,
    )
    turn = Rotation.from_rotvec([0, math.radians(tilt_deg), 0])
    wall = plate(0.02 * range_m / math.cos(math.radians(tilt_deg)))
    return look(wall, place((0, 0, range_m), turn), lens, laser, material).by_pixel.mean()


def test_the_paper_s_system_has_1000_photons_at_3_km(validation):
    """Fuller et al., sec. 5 with transmission 0.67: 95 % at 1000 photons and a range of about 3 km are one statement."""
    validation(
        case="system of Fuller et al., 3.0 km, filled pixel",
        source="Fuller et al., secs. 3.3 and 5, transmission 0.67",
        expected=1000.0,
        got=paper_pixel(3000.0),
        tolerance=2.0,
        unit="photons",
    )


def test_an_independent_budget_by_solid_angles(validation):
    """With divergence = field every pixel's share of the pulse is E/128^2, and the lens takes A/(pi R^2) of it."""
    lens = PAPER_RECEIVER.replace(transmission=1.0)
    share = 0.050 / (6.62607015e-34 * 299792458.0 / 1064e-9) / 128**2
    aperture_m = 128 * 100e-6 / (2 * math.tan(math.radians(1.25))) / 2.8
    expected = share * 0.30 * (aperture_m / 2) ** 2 / 3000.0**2
    assert expected == pytest.approx(1494.7, abs=0.1)
    validation(
        case="system of Fuller et al., 3.0 km, no losses",
        source="E/128^2 x rho0 x (D/2)^2/R^2",
        expected=expected,
        got=paper_pixel(3000.0, lens),
        tolerance=1e-4 * expected,
        unit="photons",
    )


@pytest.mark.parametrize(("eta", "photons", "range_1000_km"), [(0.5, 747, 2.59), (0.7, 1046, 3.07), (1.0, 1495, 3.67)])
def test_the_table_of_losses(validation, eta, photons, range_1000_km):
    lens = PAPER_RECEIVER.replace(transmission=eta)
    validation(
        case=f"seed system, 3.0 km, transmission {eta:g}",
        source="closed form, table in the design notes",
        expected=photons,
        got=paper_pixel(3000.0, lens),
        tolerance=0.6,
        unit="photons",
    )
    got = 3.0 * math.sqrt(paper_pixel(3000.0, lens) / 1000)
    validation(
        case=f"seed system, range of 1000 photons, transmission {eta:g}",
        source="closed form",
        expected=range_1000_km,
        got=got,
        tolerance=0.006,
        unit="km",
    )


@pytest.mark.parametrize("fov_deg", [2.5, 45.0])
def test_as_printed_sends_back_four_times_what_was_sent(validation, fov_deg):
    """Fuller et al., eq. 7 lacks a 4: a square of full angle theta has area 4 tan^2(theta/2). Shown at two angles."""
    lens = Receiver(fov_deg=fov_deg, f_number=2.8)
    square, printed = (
        look(plate(4000.0), place((0, 0, 1000.0)), lens, Laser(divergence_deg=fov_deg, footprint=name)).by_pixel.sum()
        for name in ("square", "as_printed")
    )
    validation(
        case=f"eq. 7 as printed over the square that conserves energy, {fov_deg:g} deg",
        source="area of a square",
        expected=4.0,
        got=printed / square,
        tolerance=1e-9,
        unit="1",
    )


@pytest.mark.parametrize(
    ("what", "power", "low", "high"),
    [
        ("range", -2, {"range_m": 500.0}, {"range_m": 20_000.0}),
        ("energy", 1, {"laser": Laser(energy_mj=1.0)}, {"laser": Laser(energy_mj=80.0)}),
        ("wavelength", 1, {"laser": Laser(wavelength_nm=1064.0)}, {"laser": Laser(wavelength_nm=1570.0)}),
        (
            "aperture",
            2,
            {"receiver": PAPER_RECEIVER.replace(f_number=None, aperture_mm=20.0)},
            {"receiver": PAPER_RECEIVER.replace(f_number=None, aperture_mm=300.0)},
        ),
        (
            "pixel pitch",
            2,
            {"receiver": Receiver(focal_length_mm=293.3, aperture_mm=100.0, pixel_pitch_um=20.0)},
            {"receiver": Receiver(focal_length_mm=293.3, aperture_mm=100.0, pixel_pitch_um=150.0)},
        ),
        (
            "focal length",
            -2,
            {"receiver": Receiver(focal_length_mm=200.0, aperture_mm=100.0)},
            {"receiver": Receiver(focal_length_mm=800.0, aperture_mm=100.0)},
        ),
        ("reflectance", 1, {"material": Lambertian(reflectance=0.05)}, {"material": Lambertian(reflectance=1.0)}),
    ],
)
def test_what_the_photons_grow_with(validation, what, power, low, high):
    values = {
        "range": lambda s: s["range_m"],
        "energy": lambda s: s["laser"].energy_mj,
        "wavelength": lambda s: s["laser"].wavelength_nm,
        "aperture": lambda s: s["receiver"].aperture_mm,
        "pixel pitch": lambda s: s["receiver"].pixel_pitch_um,
        "focal length": lambda s: s["receiver"].focal_length_mm,
        "reflectance": lambda s: s["material"].reflectance,
    }
    ratio = values[what](high) / values[what](low)
    few, many = (paper_pixel(**{"range_m": 3000.0, **settings}) for settings in (low, high))
    validation(
        case=f"photons grow with {what} to the power",
        source="Fuller et al., eq. 7",
        expected=power,
        got=math.log(many / few) / math.log(ratio),
        tolerance=1e-5,
        unit="1",
    )


@pytest.mark.parametrize("divergence_deg", [1.0, 5.0])
def test_photons_fall_with_the_area_lit(validation, divergence_deg):
    ratio = paper_pixel(3000.0, laser=Laser(divergence_deg=divergence_deg)) / paper_pixel(3000.0)
    expected = (math.tan(math.radians(1.25)) / math.tan(math.radians(divergence_deg / 2))) ** 2
    validation(
        case=f"divergence {divergence_deg:g} deg over 2.5 deg",
        source="Fuller et al., eq. 7",
        expected=expected,
        got=ratio,
        tolerance=1e-9 * expected,
        unit="1",
    )


@pytest.mark.parametrize("tilt_deg", [20, 40, 60, 70, 80])
def test_a_tilted_lambertian_wall_goes_with_the_first_power_of_cos_alpha(validation, tilt_deg):
    """Second-order terms of the finite pixel are (IFOV tan alpha)^2, 4e-6 at 80 degrees."""
    ratio = paper_pixel(3000.0, tilt_deg=tilt_deg) / paper_pixel(3000.0)
    validation(
        case=f"Lambertian wall tilted {tilt_deg} deg, over facing",
        source="Fuller et al., eq. 7: cos(alpha)",
        expected=math.cos(math.radians(tilt_deg)),
        got=ratio,
        tolerance=1e-5,
        unit="1",
    )


@pytest.mark.parametrize("tilt_deg", [0, 3, 10, 30, 50])
def test_a_tilted_phong_wall_follows_equation_10(validation, tilt_deg):
    """kd = 0.1, ks = 0.5, n = 20: cos(alpha) times eq. 10 with phi = 2 alpha, over the facing Lambertian wall."""
    alpha = math.radians(tilt_deg)
    phong = 0.1 / math.pi + 0.5 * 22 / (2 * math.pi) * max(math.cos(2 * alpha), 0.0) ** 20
    ratio = paper_pixel(3000.0, tilt_deg=tilt_deg, material=Phong(diffuse=0.1, specular=0.5, exponent=20.0))
    validation(
        case=f"Phong wall tilted {tilt_deg} deg, over facing Lambertian 0.30",
        source="Fuller et al., eqs. 7 and 10",
        expected=math.cos(alpha) * phong / RHO,
        got=ratio / paper_pixel(3000.0),
        tolerance=2e-4 * phong / RHO,
        unit="1",
    )


@pytest.mark.parametrize("n", [300, 3000])
def test_a_phong_mirror_returns_what_a_mirror_may(validation, n):
    """A mirror that faces the lidar shows it its own beam from 2R away: E A eta / (4 (2R)^2 tan^2(theta/2)).

    A Phong plate of ks = 1 sums to (n + 2)/n of that, less what the lobe's width costs; 1.0003 at n = 3000.
    """
    laser, lens = Laser(divergence_deg=10.0), Receiver(fov_deg=10.0, f_number=2.8)
    seen = look(plate(500.0), place((0, 0, 1000.0)), lens, laser, Phong(diffuse=0.0, specular=1.0, exponent=float(n)))
    t = math.tan(math.radians(5))
    mirror = laser.photons * lens.aperture_area_m2 * lens.transmission / (4 * 2000.0**2 * t * t)

    def lobe(y, x):
        u = x * x + y * y  # tan^2(theta), so cos(2 theta) = (1 - u)/(1 + u)
        return (n + 2) / (2 * math.pi) * ((1 - u) / (1 + u)) ** n / (1 + u) ** 2

    expected = 4 * 4 * integrate.dblquad(lobe, 0, t, 0, t, epsabs=0, epsrel=1e-8)[0]
    if n == 3000:
        assert expected == pytest.approx(1.0003, abs=5e-5)
    validation(
        case=f"Phong plate, ks = 1, n = {n}, over a mirror",
        source="mirror image, quadrature of eq. 10",
        expected=expected,
        got=seen.by_pixel.sum() / mirror,
        tolerance=1e-3 * expected,
        unit="1",
    )


def plate_photons(side_m, position_m, rotation):
    """Return the photons of a small Lambertian plate: E rho A eta cos^2(alpha) / (R^4 cos^2(theta) 4 tan^2).

    b per tangent area is E/(4 tan^2); the plate covers dA cos(alpha)/(R^2 cos^3(theta)) of it.
    """
    r = np.linalg.norm(position_m)
    cos_theta = position_m[2] / r
    cos_alpha = abs(rotation.apply([0, 0, 1]) @ position_m) / r
    t = math.tan(math.radians(1.25))
    sent = PAPER_LASER.photons / (4 * t * t) * RHO * PAPER_RECEIVER.aperture_area_m2 * PAPER_RECEIVER.transmission
    return sent * side_m**2 * cos_alpha**2 / (r**4 * cos_theta**2)


@pytest.mark.parametrize(("area_pixels", "tilted"), [(0.1, False), (0.1, True), (0.01, True), (1e-4, False)])
def test_a_plate_of_a_tenth_of_a_pixel_anywhere(validation, area_pixels, tilted):
    """60 random places and turns at 3 km: mean within 1 % of the closed form, scatter at most 5 %, never zero."""
    rng = np.random.default_rng(20)
    side_m = math.sqrt(area_pixels) * PAPER_RECEIVER.pixel_tangent * 3000.0
    ratio = np.empty(60)
    for i in range(60):
        x, y = rng.uniform(-0.98, 0.98, 2) * math.tan(math.radians(1.25))
        position = 3000.0 * np.array([x, y, 1.0])
        turn = Rotation.from_rotvec([0, 0, rng.uniform(0, 2 * np.pi)])
        if tilted:
            turn = turn * Rotation.from_rotvec([math.radians(rng.uniform(0, 75)), 0, 0])
        seen = look(plate(side_m), place(position, turn))
        ratio[i] = seen.by_pixel.sum() / plate_photons(side_m, position, turn)
    assert ratio.min() > 0, "the plate was missed"
    assert ratio.std() <= 0.05
    validation(
        case=f"plate of {area_pixels:g} pixel, {'tilted' if tilted else 'facing'}, 60 places: mean over closed form",
        source="Fuller et al., eq. 7",
        expected=1.0,
        got=ratio.mean(),
        tolerance=0.01,
        unit="1",
    )


@pytest.mark.parametrize("range_m", [3000.0, 20_000.0])
def test_a_cubesat_is_never_missed(validation, range_m):
    """A 3U CubeSat in 60 random poses: photons of its projected faces, sum of cos^2 over the faces in view."""
    rng = np.random.default_rng(30)
    sides = np.array([0.1, 0.1, 0.3405])
    areas = np.array([sides[1] * sides[2], sides[0] * sides[2], sides[0] * sides[1]])
    ratio = np.empty(60)
    for i in range(60):
        x, y = rng.uniform(-0.9, 0.9, 2) * math.tan(math.radians(1.25))
        position, turn = range_m * np.array([x, y, 1.0]), Rotation.random(rng=rng)
        seen = look(box(*sides), place(position, turn))
        assert len(seen.hits.ray) > 0 and seen.by_pixel.sum() > 0
        toward = turn.inv().apply(position / np.linalg.norm(position))
        # 1 m2 facing, times the sum of area cos^2(alpha) of the three faces in view.
        facing = plate_photons(1.0, position, Rotation.align_vectors([position], [[0.0, 0.0, 1.0]])[0])
        ratio[i] = seen.by_pixel.sum() / (facing * np.sum(areas * toward**2))
    assert ratio.std() <= 0.05
    validation(
        case=f"3U CubeSat at {range_m / 1e3:g} km in 60 poses: mean over closed form",
        source="faces of a box, eq. 7",
        expected=1.0,
        got=ratio.mean(),
        tolerance=0.01,
        unit="1",
    )


@pytest.mark.parametrize("order", [0, 1])
def test_a_small_target_before_a_large_one_takes_no_light_from_nowhere(validation, order):
    """Same reflectance, 0.5 m before a wall: the pixel keeps its photons to the plates' ratio of ranges squared."""
    rng = np.random.default_rng(7)
    wall, small = surface("wall", plate(200.0)), surface("small", plate(0.3))
    targets = [wall, small] if order else [small, wall]
    full = look(plate(200.0), place((0, 0, 3000.0))).by_pixel
    for _ in range(5):
        x, y = rng.uniform(-30, 30, 2)
        turn = Rotation.from_rotvec([0, 0, rng.uniform(0, 6)])
        seen = see(targets, truth_of(wall=place((0, 0, 3000.0)), small=place((x, y, 2999.5), turn)))
        assert set(seen.hits.target.tolist()) == {0, 1}, "the small one is seen before the wall"
        assert seen.made.max() <= 1 + 1e-9
        extra = seen.by_pixel / full - 1
        assert extra.min() > -1e-9 and extra.max() < (3000 / 2999.5) ** 2 - 1 + 1e-9
    validation(
        case=f"plate before a wall, listed {'second' if order else 'first'}: all photons over the wall's",
        source="energy conservation",
        expected=1.0,
        got=seen.by_pixel.sum() / full.sum(),
        tolerance=1e-6,
        unit="1",
    )


def test_a_large_target_hides_a_small_one(validation):
    wall, small = surface("wall", plate(200.0)), surface("small", box(0.3, 0.3, 0.3), Lambertian(reflectance=1.0))
    seen = see([small, wall], truth_of(wall=place((0, 0, 3000.0)), small=place((3.3, 4.4, 3001.0))))
    assert set(seen.hits.target.tolist()) == {1}
    alone = look(plate(200.0), place((0, 0, 3000.0))).by_pixel
    validation(
        case="small target behind a wall: greatest change of a pixel",
        source="energy conservation",
        expected=0.0,
        got=np.abs(seen.by_pixel / alone - 1).max(),
        tolerance=1e-7,
        unit="1",
    )


def test_a_gaussian_beam_on_a_small_plate_off_the_axis(validation):
    """exp(-2 r^2/t^2) at the plate, averaged over it by the error function."""
    laser = Laser(footprint="gaussian", divergence_deg=0.5)
    t, side = math.tan(math.radians(0.25)), 10.0 / 3000.0
    x0, y0 = 0.8 * t, -0.5 * t
    arms = [
        math.sqrt(math.pi / 8)
        * t
        * (special.erf(math.sqrt(2) * (c + side / 2) / t) - special.erf(math.sqrt(2) * (c - side / 2) / t))
        for c in (x0, y0)
    ]
    slant = 1 + x0 * x0 + y0 * y0
    expected = received(laser, PAPER_RECEIVER, 3000.0) * 2 / (math.pi * t * t) * arms[0] * arms[1] / slant**2
    seen = look(plate(10.0), place((x0 * 3000, y0 * 3000, 3000.0)), laser=laser)
    # The closed form takes cos^4 at the plate's centre: 1e-5; the grid samples the plate's edge.
    validation(
        case="plate of 10 m off the axis of a Gaussian beam, 3 km",
        source="error functions",
        expected=expected,
        got=seen.by_pixel.sum(),
        tolerance=0.01 * expected,
        unit="photons",
    )


@pytest.mark.parametrize(("small_m", "large_m"), [(0.5, 1.0), (0.3, 10.0), (0.02, 3.0)])
def test_two_overlapping_plates_fill_their_union(validation, small_m, large_m):
    """Rectangles A and B at one range cover |A| + |B| - |A and B| of the tangent plane, whichever is listed first.

    100 random pairs about each other; both are sampled by 4096 rays or more, so one pair is within 4 % (a row of 64 on
    each of two sides, twice), and the mean of 100 within a tenth of that.
    """
    rng = np.random.default_rng(12)
    d, ratio = 3000.0, np.empty(100)
    for i in range(100):
        size = np.array([rng.uniform(0.8, 1.2, 2) * small_m, rng.uniform(0.8, 1.2, 2) * large_m])
        middle = rng.uniform(-30, 30, 2) + np.array([rng.uniform(-0.6, 0.6, 2) * large_m, np.zeros(2)])
        low, high = middle - size / 2, middle + size / 2
        shared = np.prod(np.maximum(high.min(axis=0) - low.max(axis=0), 0))
        union = np.prod(size, axis=1).sum() - shared
        small, large = surface("small", plate(*size[0])), surface("large", plate(*size[1]))
        poses = {"small": place((*middle[0], d - 1e-3)), "large": place((*middle[1], d))}
        seen = see([small, large] if i % 2 else [large, small], truth_of(**poses))
        ratio[i] = seen.hits.weight.sum() * (PAPER_RECEIVER.pixel_tangent * d) ** 2 / union
    assert np.abs(ratio - 1).max() < 0.04
    validation(
        case=f"plates of some {small_m:g} and {large_m:g} m that overlap: area seen over their union",
        source="areas of rectangles",
        expected=1.0,
        got=ratio.mean(),
        tolerance=0.004,
        unit="1",
    )

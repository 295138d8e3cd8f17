"""Stray light: sunlight behind a blurring lens, ghosts, and Sun, Earth and Moon in or near the field."""

import math

import numpy as np
import pytest
from scipy import integrate

from rso_lidar import optics, scene, units
from rso_lidar.optics import Baffle, GaussianPsf, Ghost, Glare, Laser, Receiver, sun_photons_per_s_m2
from rso_lidar.optics.stray import glare, sources
from rso_lidar.optics.stray.ghosts import add_ghosts
from rso_lidar.pose import Link, PoseTree
from rso_lidar.records import BodyState, Truth
from tests.optics.bench_for_tests import place, plate, surface

LASER = Laser()
LENS = Receiver(fov_deg=2.5, f_number=2.8, filter_width_nm=1.0, glare=Glare())
PER_M2 = sun_photons_per_s_m2(1064e-9, 1e-9)
R, AU = units.EARTH_RADIUS_M, units.ASTRONOMICAL_UNIT_M
HALO = GaussianPsf(sigma_um=60.0, halo_fraction=0.1, halo_radius_um=150.0)


def truth_of(sun=(0.0, 0.0, 1.0), position_m=(0.0, 0.0, 0.0), sunlit=1.0, **lidar_from_target):
    """Return the truth of one epoch, the lidar's axes being those of the root."""
    parents = {"lidar": "inertial", **dict.fromkeys(lidar_from_target, "lidar")}
    links = {"lidar": Link.still(None), **{n: Link.still(p) for n, p in lidar_from_target.items()}}
    follower = BodyState(np.array(position_m, dtype=float), np.zeros(3))
    state = {"follower": follower}
    return Truth(0.0, PoseTree(parents, links), state, np.array(sun, dtype=float), None, {"follower": sunlit})


def flash_of(targets, truth, lens, *, has_earth=False, moon_m=None, laser=LASER):
    """Return photons without and with stray light, and the sky, of one flash."""
    rays = optics.pixel_rays(lens, laser, scene.extent(targets, truth))
    hits = scene.cast(rays, targets, truth, 1, sun=True)
    photons = optics.collect(hits, laser, lens)
    sky = optics.see_sky(laser, lens, truth, moon_m, has_earth=has_earth)
    hidden = None if sky is None else scene.find_hidden(sky.direction, targets, truth)
    return photons, optics.add_stray_light(photons, hits, laser, lens, sky, hidden), sky, hidden


# ---------------------------------------------------------------------------------------- sunlight behind a lens that blurs


def test_a_lens_that_blurs_keeps_the_sunlight_of_a_plate(validation):
    """The kernel of a lens has the sum 1: what a plate of sunlight sends lands on the focal plane, core and halo."""
    wall, truth = surface("wall", plate(3.0)), truth_of((0.0, 0.0, -1.0), wall=place((0.4, -0.7, 500.0)))
    sharp, soft = LENS.replace(glare=None, psf=None), LENS.replace(glare=None, psf=HALO)
    hits = scene.cast(optics.pixel_rays(soft, LASER, scene.extent([wall], truth)), [wall], truth, 1, sun=True)
    sharp, soft = (optics.collect(hits, LASER, lens).background_photons_per_s for lens in (sharp, soft))
    validation(
        case="sunlight of a plate behind a blur with a halo, over that behind a sharp lens",
        source="energy",
        expected=1.0,
        got=soft.sum() / sharp.sum(),
        tolerance=1e-6,
        unit="1",
    )
    assert soft.max() < sharp.max()


# ------------------------------------------------------------------------------------------------------------------ ghosts


def test_ghost_of_a_plate(validation):
    """A ghost about the axis of 1e-3 of the light: at minus the place, on the pixels and in time, with its detour."""
    lens = LENS.replace(glare=None, filter_width_nm=None, ghosts=(Ghost(fraction=1e-3, extra_path_m=0.3),))
    truth = truth_of(wall=place((3.0, -2.0, 500.0)))
    plain = flash_of([surface("wall", plate(2.0))], truth, lens)[0]
    ghostly = add_ghosts(plain, lens)
    images = [np.bincount(p.pixel, p.photons, 128 * 128).reshape(128, 128) for p in (plain, ghostly)]
    copy = images[1] - images[0]
    validation(
        case="light of a ghost over that of the image",
        source="fraction = 1e-3",
        expected=1e-3,
        got=copy.sum() / images[0].sum(),
        tolerance=1e-5,
        unit="1",
    )
    assert copy[::-1, ::-1] == pytest.approx(1e-3 * images[0], abs=1e-9 * images[0].max())
    far = images[0].ravel()[ghostly.pixel] == 0.0
    got_m = np.average(ghostly.delay_s[far], weights=ghostly.photons[far]) * units.RANGE_PER_DELAY_M_S
    real_m = np.average(plain.delay_s, weights=plain.photons) * units.RANGE_PER_DELAY_M_S
    validation(
        case="range of a ghost with a detour of 0.3 m beyond that of the plate",
        source="half the detour",
        expected=0.15,
        got=got_m - real_m,
        tolerance=1e-6,
        unit="m",
    )


# --------------------------------------------------------------------------------------------------- the law of the scatter


@pytest.mark.parametrize(("slope", "knee"), [(-1.5, 0.01), (-2.0, 0.01), (-2.5, 0.001), (-1.0, 0.1)])
def test_the_law_of_harvey_and_shack(validation, slope, knee):
    """Peak, knee and slope as the manual of FRED defines them, and the total scatter by quadrature over the hemisphere."""
    law = Glare(slope=slope, knee_sine=knee, peak_per_sr=0.05, surfaces=1)
    at = law.scatter_per_sr(np.array([0.0, knee, 30 * knee, 300 * knee]))
    validation(
        case=f"peak of the scatter, s = {slope:g}, L = {knee:g}",
        source="b0",
        expected=0.05,
        got=at[0],
        tolerance=1e-12,
        unit="sr-1",
    )
    validation(
        case=f"scatter at the knee over the peak, s = {slope:g}",
        source="2^(s/2)",
        expected=2 ** (slope / 2),
        got=at[1] / at[0],
        tolerance=1e-9,
        unit="1",
    )
    decade = math.log10(at[3] / at[2])
    validation(
        case=f"slope of the scatter beyond the knee, s = {slope:g}",
        source="the slope of the law",
        expected=slope,
        got=decade,
        tolerance=1e-3,
        unit="1",
    )
    total = 2 * math.pi * integrate.quad(lambda b: float(law.scatter_per_sr(np.array(b))) * b, 0, 1, points=[knee])[0]
    validation(
        case=f"total scatter of a surface, s = {slope:g}, L = {knee:g}",
        source="quadrature",
        expected=total,
        got=law.total_scatter,
        tolerance=1e-6 * total,
        unit="1",
    )


def test_the_veil_is_the_point_source_transmittance(validation):
    """On the axis: the Sun's irradiance times PST is the focal plane's. PST by hand, with the default law."""
    for degrees in (5.0, 20.0, 60.0):
        angle = math.radians(degrees)
        sky = optics.see_sky(LASER, LENS, truth_of((math.sin(angle), 0.0, math.cos(angle))), has_earth=False)
        on_axis = glare.veil(sky, LENS)[63:65, 63:65].mean() / LENS.pixel_pitch_m**2 / PER_M2
        by_hand = (
            0.67 * 8 * 0.1 * (1 + (math.sin(angle) / 0.01) ** 2) ** -0.75 * math.cos(angle) * math.pi / (4 * 2.8**2)
        )
        validation(
            case=f"PST of eight surfaces at {degrees:g} deg (b0 = 0.1 / sr, L = 0.01, s = -1.5, f/2.8)",
            source="by hand",
            expected=by_hand,
            got=on_axis,
            tolerance=2e-3 * by_hand,
            unit="1",
        )
        ours = float(LENS.glare.point_source_transmittance(angle, 2.8, 0.67))
        assert ours == pytest.approx(by_hand, rel=1e-12)


def test_all_scattered_light_is_somewhere(validation):
    """Of a source on the axis a wide field gathers the scatter within it: π Σ b0 L² ((1 + (β/L)²)^(s/2+1) - 1)/(s/2 + 1)."""
    law = Glare(slope=-3.0, knee_sine=0.02, surfaces=4, peak_per_sr=1.0)
    lens = Receiver(
        fov_deg=60.0, f_number=2.0, n_rows=200, n_cols=200, filter_width_nm=1.0, glare=law, transmission=1.0
    )
    sky = optics.see_sky(LASER, lens, truth_of(), has_earth=False)
    light = glare.veil(sky, lens)
    sight = lens.line_of_sight
    within = np.hypot(sight[..., 0], sight[..., 1]) < 0.45
    expected = 4 * math.pi * 0.02**2 * ((1 + (0.45 / 0.02) ** 2) ** -0.5 - 1) / -0.5
    # A sensor that looks along the scattered light gathers radiance times cos⁴ of its tangent plane: direction cosines.
    got = light[within].sum() / PER_M2 / lens.aperture_area_m2
    validation(
        case="scatter within sin θ = 0.45 of a source on the axis, over its light",
        source="closed form",
        expected=expected,
        got=got,
        tolerance=0.01 * expected,
        unit="1",
    )


@pytest.mark.parametrize("degrees", [0.0, 10.0, 25.0, 35.0, 60.0])
def test_the_shade_of_a_baffle(validation, degrees):
    """The lit part of the lens by Monte Carlo: points of the aperture from which the Sun is seen through the opening."""
    shade, aperture_m = Baffle(length_mm=100.0, diameter_mm=60.0, leak_fraction=1e-4), 0.04
    rng = np.random.default_rng(1)
    r, turn = 0.02 * np.sqrt(rng.random(200_000)), 2 * math.pi * rng.random(200_000)
    free = np.hypot(r * np.cos(turn) + 0.1 * math.tan(math.radians(degrees)), r * np.sin(turn)) < 0.03
    expected = max(float(free.mean()), 1e-4)
    got = float(shade.lit_fraction(np.array(math.radians(degrees)), aperture_m))
    validation(
        case=f"part of the lens that a baffle leaves lit at {degrees:g} deg",
        source="Monte Carlo, 200,000 points",
        expected=expected,
        got=got,
        tolerance=4e-3,
        unit="1",
    )


# --------------------------------------------------------------------------------------------- the Sun, and what hides it


@pytest.mark.parametrize("psf", [None, HALO], ids=["sharp", "blurred"])
def test_the_sun_in_the_field(validation, psf):
    """The whole disc gives irradiance times aperture times transmission; a pixel within it radiance times étendue."""
    lens = LENS.replace(psf=psf)
    photons, lit, sky, _ = flash_of([], truth_of((0.004, -0.003, 1.0)), lens)
    image = lit.background_photons_per_s - glare.veil(sky, lens)
    whole = PER_M2 * lens.aperture_area_m2 * lens.transmission / math.hypot(0.004, 0.003, 1.0)
    kind = "blurred" if psf else "sharp"
    assert photons.background_photons_per_s.max(initial=0.0) == 0.0
    validation(
        case=f"photons of the Sun's {kind} disc in the field",
        source="E490, E A T cos θ",
        expected=whole,
        got=image.sum(),
        tolerance=(2e-3 if psf else 2e-4) * whole,
        unit="1/s",
    )
    if psf is None:
        disc_sr = 4 * math.pi * math.sin(math.asin(units.SUN_RADIUS_M / AU) / 2) ** 2
        pixel = PER_M2 / disc_sr * lens.pixel_tangent**2 * lens.aperture_area_m2 * lens.transmission
        validation(
            case="photons of a pixel within the Sun's disc",
            source="radiance times étendue",
            expected=pixel,
            got=image.max(),
            tolerance=2e-4 * pixel,
            unit="1/s",
        )
        pixels = np.count_nonzero(image > 0.5 * image.max())
        validation(
            case="pixels of the Sun's disc",
            source="its solid angle over that of a pixel",
            expected=disc_sr / lens.pixel_tangent**2,
            got=pixels,
            tolerance=8.0,
            unit="1",
        )


def test_a_target_before_the_sun(validation):
    """A plate whose edge runs through the disc's centre hides half of it, from the image and from the veil."""
    wall = surface("wall", plate(4.0))
    truths = (
        truth_of(wall=place((2.0, 0.0, 200.0))),
        truth_of(wall=place((0.0, 0.0, 200.0))),
        truth_of(wall=place((0, 0, -200.0))),
    )
    half, none, free = (flash_of([wall], truth, LENS) for truth in truths)
    image, veil = [], []
    for _, lit, sky, hidden in (half, none, free):
        veil.append(glare.veil(sky, LENS, hidden).mean())
        image.append(lit.background_photons_per_s.sum() - 128 * 128 * veil[-1])
    validation(
        case="light of the Sun's disc half behind a plate, over the whole",
        source="half",
        expected=0.5,
        got=image[0] / image[2],
        tolerance=5e-3,
        unit="1",
    )
    validation(
        case="veil of the Sun half behind a plate, over the whole",
        source="half",
        expected=0.5,
        got=veil[0] / veil[2],
        tolerance=0.02,
        unit="1",
    )
    validation(
        case="light of the Sun wholly behind a plate, over the whole",
        source="none",
        expected=0.0,
        got=abs(image[1]) / image[2],
        tolerance=1e-9,
        unit="1",
    )
    assert veil[1] == 0.0 and none[3].all()


def test_an_eclipse_takes_the_sun_away(validation):
    """Behind the Earth the Sun is dark; with half of the disc behind the limb, half of veil and image are left."""
    dark = truth_of((0.0, 0.0, 1.0), (0.0, 0.0, -4e7), sunlit=0.0)
    lit = flash_of([], dark, LENS, has_earth=True)[1]
    validation(
        case="light of a Sun behind the Earth",
        source="none",
        expected=0.0,
        got=float(lit.background_photons_per_s.sum()),
        tolerance=1e-9,
        unit="1/s",
    )
    edge = math.asin(R / 4e7)  # the limb through the Sun's centre, on the axis
    place_m = -4e7 * np.array([math.sin(edge), 0.0, math.cos(edge)])
    partly = truth_of((0.0, 0.0, 1.0), place_m, sunlit=0.5)
    lens = LENS.replace(glare=Glare(sources=("sun",)))
    image = optics.see_sky(LASER, lens, partly).image_photons_per_s.sum()
    free = optics.see_sky(LASER, lens, truth_of(), has_earth=False)
    validation(
        case="image of a Sun half behind the Earth's limb, over the whole",
        source="half; the limb is straight",
        expected=0.5,
        got=image / free.image_photons_per_s.sum(),
        tolerance=0.03,
        unit="1",
    )
    seen = optics.see_sky(LASER, lens, partly).photons_per_s.sum()
    validation(
        case="irradiance of a Sun half behind the limb, over the whole",
        source="truth.sunlit",
        expected=0.5,
        got=seen / free.photons_per_s.sum(),
        tolerance=1e-9,
        unit="1",
    )


# ------------------------------------------------------------------------------------------------------ Earth and Moon


@pytest.mark.parametrize("radius_m", [7.0e6, 42.164e6, 3.84e8])
def test_the_full_earth(validation, radius_m):
    """The light of a Lambertian sphere in full light below the lens: quadrature over its cap, (2/3) p (R/d)² far away."""

    def ring(gamma):
        far2 = radius_m**2 + R**2 - 2 * radius_m * R * math.cos(gamma)
        seen = (radius_m * math.cos(gamma) - R) * (radius_m - R * math.cos(gamma)) / far2
        return math.cos(gamma) * seen / far2 * 2 * math.pi * R**2 * math.sin(gamma)

    expected = 0.3 / math.pi * integrate.quad(ring, 0, math.acos(R / radius_m))[0]
    sky = optics.see_sky(LASER, LENS, truth_of((0.0, 0.0, -1.0), (0.0, 0.0, -radius_m)))
    got = glare.lens_light(sky, LENS)[sky.body == sources.EARTH].sum() / PER_M2 / LENS.aperture_area_m2
    validation(
        case=f"light of the full Earth from {radius_m / 1e6:.4g} Mm over that of the Sun",
        source="quadrature of a Lambertian sphere",
        expected=expected,
        got=got,
        tolerance=5e-3 * expected,
        unit="1",
    )
    if radius_m > 1e8:
        validation(
            case="light of the full Earth from the Moon's distance over that of the Sun",
            source="2/3 p (R/d)²",
            expected=0.2 * (R / radius_m) ** 2,
            got=got,
            tolerance=0.03 * got,
            unit="1",
        )


def test_the_half_earth(validation):
    """At a phase of 90 degrees a Lambertian sphere sends 1/π of the light of the full one."""
    far = (0.0, 0.0, -3.84e8)
    full, half = (optics.see_sky(LASER, LENS, truth_of(sun, far)) for sun in ((0, 0, -1.0), (1.0, 0, 0)))
    light = [glare.lens_light(sky, LENS)[sky.body == sources.EARTH].sum() for sky in (full, half)]
    validation(
        case="light of the half Earth over that of the full",
        source="Lambert's law: 1/π",
        expected=1 / math.pi,
        got=light[1] / light[0],
        tolerance=0.01,
        unit="1",
    )


def test_the_day_side_that_fills_the_field(validation):
    """Straight down at the subsolar point, a pixel gathers albedo / π of the Sun's light times its étendue."""
    sky = optics.see_sky(LASER, LENS, truth_of((0.0, 0.0, -1.0), (0.0, 0.0, -7e6)))
    pixel = 0.3 / math.pi * PER_M2 * LENS.pixel_tangent**2 * LENS.aperture_area_m2 * LENS.transmission
    got = sky.image_photons_per_s[64, 64]
    validation(
        case="photons of a pixel at the subsolar point of the Earth",
        source="Lambert's law",
        expected=pixel,
        got=got,
        tolerance=1e-3 * pixel,
        unit="1/s",
    )


@pytest.mark.parametrize(
    ("phase_deg", "fainter"), [(10, 0.23), (30, 0.79), (60, 1.62), (90, 2.63), (120, 3.93), (150, 5.9)]
)
def test_the_phase_law_of_the_moon(validation, phase_deg, fainter):
    """Magnitudes below full Moon in the table of Allen (1973), p. 143, beside his formula."""
    got = -2.5 * math.log10(sources.moon_over_sun(math.radians(phase_deg)) / sources.moon_over_sun(0.0))
    validation(
        case=f"Moon at a phase of {phase_deg} deg below full Moon",
        source="Allen (1973), table",
        expected=fainter,
        got=got,
        tolerance=0.05,
        unit="mag",
    )


def test_the_moon_in_the_field(validation):
    """The full Moon on the axis from near the Earth: its image holds 2.5e-6 of the Sun's light."""
    near = (0.0, 0.0, 7e6)
    moon_m = np.array([0.0, 0.0, 7e6 + 384_401e3])
    lens = LENS.replace(glare=Glare(sources=("moon",)))
    for name, sun, share in (
        ("full", (0.0, 0.0, -1.0), 10 ** (-0.4 * 14.01)),
        ("half", (1.0, 0.0, 0.0), 10 ** (-0.4 * (14.01 + 2.34 + 0.26244))),
    ):
        sky = optics.see_sky(LASER, lens, truth_of(sun, near), moon_m)
        got = sky.image_photons_per_s.sum() / (PER_M2 * lens.aperture_area_m2 * lens.transmission)
        validation(
            case=f"light of the {name} Moon in the image over that of the Sun",
            source="Allen (1973): V = -12.73 and -26.74",
            expected=share,
            got=got,
            tolerance=0.01 * share,
            unit="1",
        )
        # The Moon is 0.15 degrees beside the direction in which the Earth sees it, and the phase by as much less.
        assert sky.photons_per_s.sum() / PER_M2 / lens.aperture_area_m2 == pytest.approx(share, rel=6e-3)

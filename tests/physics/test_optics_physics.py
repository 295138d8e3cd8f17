"""The optics of the walk: a laser beside the lens, lenses that bend and blur, sunlight, and pulses that jitter."""

import dataclasses
import datetime
import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import integrate
from scipy.spatial.transform import Rotation

import rso_lidar as rl
from rso_lidar import optics, scene
from rso_lidar.optics import BrownConrady, FieldDependentPsf, FieldPsf, GaussianPsf, Laser, Receiver
from rso_lidar.scene import Phong
from rso_lidar.scene.materials.scatterer import SUN_RADIUS_RAD
from rso_lidar.simulation import DETECTION
from tests.optics.bench_for_tests import box, place, plate, see, surface, truth_of, write_stl

C = 299_792_458.0
RHO = 0.30 / math.pi
NEAR = Receiver(fov_deg=40.0, f_number=2.0, n_rows=32, n_cols=32, transmission=0.5)


def flash_of(targets, truth, receiver, laser, *, sun=False):
    """Return hits, photons, labels and photons by pixel of one flash, its laser wherever it is."""
    targets = targets if isinstance(targets, list) else [targets]
    rays = optics.pixel_rays(receiver, laser, scene.extent(targets, truth))
    hits = scene.cast(rays, targets, truth, 1, laser_from_m=laser.offset, sun=sun)
    photons = optics.collect(hits, laser, receiver)
    return SimpleNamespace(
        hits=hits,
        photons=photons,
        labels=scene.label(hits, photons),
        by_pixel=np.bincount(photons.pixel, photons.photons, receiver.n_rows * receiver.n_cols).reshape(receiver.shape),
        point_m=hits.rays.direction[hits.ray] * hits.range_m[:, None],
    )


# ------------------------------------------------------------------------------------------- a laser beside the lens


@pytest.mark.parametrize("offset_m", [(0.3, 0.0, 0.0), (-0.2, 0.5, 0.4), (0.0, 0.0, -1.0)])
@pytest.mark.parametrize("range_m", [3.0, 30.0])
def test_parallax_of_a_laser_beside_the_lens(validation, offset_m, range_m):
    """A wall at d facing both: the laser at (a, b, c) puts b/(d - c)² on each unit of its area, whatever the angle.

    Seen from the lens it returns rho A eta cos⁴(theta)/d² of that from each unit of area, theta from the lens. The beam is a
    Gaussian, so that no edge falls between rays.
    """
    laser = Laser(footprint="gaussian", divergence_deg=12.0, offset_m=offset_m)
    lens = NEAR.replace(rays_per_pixel=4)  # a grid that is not shifted: its error of an even field cancels
    got = flash_of(surface("wall", plate(100.0)), truth_of(wall=place((0, 0, range_m))), lens, laser)
    a, b, c = offset_m
    away, t, half = range_m - c, math.tan(math.radians(6.0)), 16 * NEAR.pixel_tangent

    def per_area(y, x):  # x, y on the wall over its distance
        u, v = (x * range_m - a) / away, (y * range_m - b) / away
        bell = 2 / (math.pi * t * t) * math.exp(-2 * (u * u + v * v) / t**2)
        return bell / away**2 / (1 + x * x + y * y) ** 2

    whole, _ = integrate.dblquad(per_area, -half, half, -half, half, epsabs=0, epsrel=1e-6)
    expected = laser.photons * RHO * NEAR.aperture_area_m2 * NEAR.transmission * whole
    validation(
        case=f"photons from a wall at {range_m:g} m, laser at ({a:g}, {b:g}, {c:g}) m beside the lens",
        source="irradiance b/(d - c)² on the wall and Lambert's law, integrated over the field",
        expected=expected,
        got=got.photons.photons.sum(),
        tolerance=1e-4 * expected,
        unit="photons",
    )
    path_m = got.hits.range_m + np.linalg.norm(got.point_m - offset_m, axis=1)
    assert got.photons.delay_s * C == pytest.approx(path_m, rel=1e-12)
    lit = got.labels.photons > 0
    assert np.all(np.abs(got.labels.range_m[lit] - range_m) < 2.0 * max(np.linalg.norm(offset_m), 0.1 * range_m))
    # Half of the two paths, the photon-weighted mean over the pixel.
    one = got.photons.pixel == 16 * 32 + 16
    assert got.labels.range_m[16, 16] == pytest.approx(np.average(path_m[one] / 2, weights=got.photons.photons[one]))


def test_the_footprint_is_where_the_laser_shines(validation):
    """A square beam from 0.5 m to the right and 0.3 m above, on a wall at 4 m: its middle is off by just that."""
    laser = Laser(divergence_deg=12.0, offset_m=(0.5, -0.3, 0.0))
    lens = NEAR.replace(n_rows=96, n_cols=96)
    got = flash_of(surface("wall", plate(100.0)), truth_of(wall=place((0, 0, 4.0))), lens, laser)
    lit = got.photons.hit
    half_m, ray_m = 4.0 * math.tan(math.radians(6.0)), 4.0 * lens.pixel_tangent / 4
    for axis, middle, name in ((0, 0.5, "right"), (1, -0.3, "down")):
        low, high = got.point_m[lit, axis].min(), got.point_m[lit, axis].max()
        assert high - low == pytest.approx(2 * half_m, abs=2 * ray_m)
        validation(
            case=f"middle of a square footprint at 4 m, to the {name}",
            source="the laser's own place beside the lens, half a ray's width",
            expected=middle,
            got=0.5 * (low + high),
            tolerance=ray_m,
            unit="m",
        )


def test_a_shadow_beside_what_throws_it(validation):
    """A plate 1 m wide at 5 m before a wall at 10 m, laser 0.8 m to the left: its shadow is twice as wide, 0.8 m right.

    The lens, at the origin, sees past the plate: left of it a strip that is lit, right of it one in shadow.
    """
    laser = Laser(footprint="gaussian", divergence_deg=40.0, offset_m=(-0.8, 0.0, 0.0))
    near, wall = surface("near", plate(1.0, 1.0)), surface("wall", plate(60.0))
    truth = truth_of(near=place((0, 0, 5.0)), wall=place((0, 0, 10.0)))
    lens = NEAR.replace(n_rows=64, n_cols=64)
    got = flash_of([near, wall], truth, lens, laser)
    on_wall = got.hits.target == 1
    x, y = got.point_m[:, 0], got.point_m[:, 1]
    # The lines from the laser at x = -0.8 through the plate's sides at ±0.5 meet the wall at 2 (±0.5) + 0.8.
    inside = (x > -0.2) & (x < 1.8) & (np.abs(y) < 1.0)
    rim = (np.abs(x + 0.2) < 0.02) | (np.abs(x - 1.8) < 0.02) | (np.abs(np.abs(y) - 1.0) < 0.02)
    dark = np.ones(len(x), bool)
    dark[got.photons.hit] = False
    clear = on_wall & ~rim
    assert np.array_equal(dark[clear], inside[clear])
    assert not dark[got.hits.target == 0].any() and np.all(got.photons.photons > 0)
    strip = on_wall & dark
    validation(
        case="right edge of a shadow on a wall at 10 m, from a laser 0.8 m to the left",
        source="the line from the laser past the plate's edge",
        expected=1.8,
        got=x[strip].max(),
        tolerance=10 * lens.pixel_tangent / 4,
        unit="m",
    )


# --------------------------------------------------------------------------------------------------------- distortion

LENSES = {
    "barrel, 2.5 deg": Receiver(fov_deg=2.5, f_number=2.8, n_rows=48, n_cols=64, distortion=BrownConrady(k1=-40.0)),
    "pincushion, 2.5 deg": Receiver(fov_deg=2.5, f_number=2.8, n_rows=48, n_cols=64, distortion=BrownConrady(k1=40.0)),
    "strong barrel, 30 deg": Receiver(fov_deg=30, f_number=2, n_rows=48, n_cols=64, distortion=BrownConrady(k1=-0.6)),
    "pincushion, 30 deg": Receiver(
        fov_deg=30, f_number=2, n_rows=48, n_cols=64, distortion=BrownConrady(k1=0.6, k2=0.5)
    ),
    "decentred, 30 deg": Receiver(
        fov_deg=30, f_number=2, n_rows=48, n_cols=64, distortion=BrownConrady(k1=-0.3, p1=0.03, p2=-0.02)
    ),
}


@pytest.mark.parametrize("name", LENSES)
def test_a_point_appears_where_the_lens_puts_it(name):
    """A speck in a known direction lights the pixel that Brown-Conrady says, written out here; and only that one."""
    lens = LENSES[name]
    k1, k2, k3, p1, p2 = lens.distortion.coefficients
    rng = np.random.default_rng(6)
    found = 0
    for x, y in rng.uniform(-1.05, 1.05, (40, 2)) * 0.5 * np.array([64, 48]) * lens.pixel_tangent:
        r2 = x * x + y * y
        radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
        xd = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
        yd = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
        col, row = xd / lens.pixel_tangent + 32, yd / lens.pixel_tangent + 24
        if np.abs(np.array([col, row]) % 1 - 0.5).max() > 0.48:
            continue  # too near to an edge of pixels
        speck = surface("speck", plate(1e-3 * 500 * lens.pixel_tangent))
        got = see(speck, truth_of(speck=place((500 * x, 500 * y, 500))), lens, Laser(divergence_deg=120.0))
        lit = np.argwhere(got.by_pixel > 0).tolist()
        inside = 0 <= col < 64 and 0 <= row < 48
        assert lit == ([[math.floor(row), math.floor(col)]] if inside else [])
        found += inside
    assert found >= 20


@pytest.mark.parametrize("name", LENSES)
def test_points_of_a_bent_lens_lie_on_the_plate(validation, name):
    """Range times line of sight is a point of the tilted plate: the table of a frame is the bent one (house.md, labels)."""
    lens = LENSES[name].replace(rays_per_pixel=1, min_rays_per_target=0)
    pose = place((0.3, -0.2, 400), Rotation.from_euler("xy", [25, -35], degrees=True))
    got = see(surface("plate", plate(1000.0)), truth_of(plate=pose), lens, Laser(divergence_deg=120.0))
    points = got.labels.range_m[..., None] * lens.line_of_sight
    seen = np.isfinite(got.labels.range_m)
    assert seen.all()
    off_m = np.abs((points - [0.3, -0.2, 400]) @ pose.rotation.apply([0, 0, 1.0]))
    validation(
        case=f"{name} lens: greatest distance of a point from its plate at 400 m",
        source="the plate's plane",
        expected=0.0,
        got=off_m.max(),
        tolerance=1e-6,
        unit="m",
    )


@pytest.mark.parametrize("name", LENSES)
def test_a_bent_lens_gathers_what_a_straight_one_does(validation, name):
    """What the lens takes in does not depend on where it puts it: a beam inside the field, a wall, as without distortion.

    The pixels' solid angles make up for the moved rays. Closed form: rho A eta E times the integral of b cos⁴.
    """
    lens = LENSES[name].replace(n_rows=64)
    divergence_deg = 0.12 * math.degrees(lens.fov_rad)
    t = math.tan(math.radians(divergence_deg) / 2)
    laser = Laser(footprint="gaussian", divergence_deg=divergence_deg)
    got = see(surface("wall", plate(4000.0)), truth_of(wall=place((0, 0, 1000))), lens, laser)
    bell, _ = integrate.quad(lambda r: math.exp(-2 * r * r / t**2) * r / (1 + r * r) ** 2, 0, 7 * t, epsrel=1e-10)
    expected = laser.photons * RHO * lens.aperture_area_m2 * lens.transmission * bell * 4 / (t * t * 1000.0**2)
    validation(
        case=f"{name} lens: photons of a Gaussian beam on a wall",
        source="the integral of b cos⁴ over the beam, no lens in it",
        expected=expected,
        got=got.photons.photons.sum(),
        tolerance=2e-5 * expected,
        unit="photons",
    )


@pytest.mark.parametrize("name", LENSES)
def test_a_bent_field_is_as_large_as_its_rim(validation, name):
    """A wall that fills the field returns the integral of cos⁴ over the directions the focal plane catches.

    By Green's theorem along the rim of the field: an independent way to the same area.
    """
    lens = LENSES[name]
    got = see(surface("wall", plate(9000.0)), truth_of(wall=place((0, 0, 1000))), lens, Laser(divergence_deg=100.0))
    n = 4000
    s = np.arange(n) / n
    one = np.ones(n)
    rim_col = np.concatenate([64 * s, 64 * one, 64 * (1 - s), 0 * one])
    rim_row = np.concatenate([0 * one, 48 * s, 48 * one, 48 * (1 - s)])
    x, y = lens.tangents_at(rim_col, rim_row)

    def flow(x, y):  # Q with dQ/dx = cos⁴ = (1 + x² + y²)^-2
        a2 = 1 + y * y
        a = np.sqrt(a2)
        return x / (2 * a2 * (a2 + x * x)) + np.arctan(x / a) / (2 * a2 * a)

    x1, y1 = np.roll(x, -1), np.roll(y, -1)
    whole = np.sum(0.5 * (flow(x, y) + flow(x1, y1)) * (y1 - y))
    t = math.tan(math.radians(50.0))
    factor = RHO * lens.aperture_area_m2 * lens.transmission / (4 * t * t) / 1000.0**2
    expected = Laser().photons * factor * whole
    validation(
        case=f"{name} lens: photons of a wall that fills the field",
        source="the integral of cos⁴ over the field, along its rim",
        expected=expected,
        got=got.photons.photons.sum(),
        tolerance=1e-4 * expected,
        unit="photons",
    )


# --------------------------------------------------------------------------------------------------------------- blur


@pytest.mark.parametrize("sigma_um", [40.0, 80.0])
def test_blur_keeps_photons_and_widens_the_image(validation, sigma_um):
    """The image of a plate 3.4 x 1.8 pixels large: as many photons, its middle in place, its variance larger by σ²."""
    lens = Receiver(focal_length_mm=100, f_number=2.8, n_rows=32, n_cols=32)
    target, truth = surface("plate", plate(3.4, 1.8)), truth_of(plate=place((0.9, -1.3, 1000)))
    sharp, soft = (
        see(target, truth, lens.replace(psf=psf), Laser(divergence_deg=5.0))
        for psf in (None, GaussianPsf(sigma_um=sigma_um))
    )
    total = sharp.photons.photons.sum()
    validation(
        case=f"photons of a plate behind a lens of {sigma_um:g} um blur",
        source="photons before the lens",
        expected=total,
        got=soft.photons.photons.sum(),
        tolerance=1e-6 * total,
        unit="photons",
    )
    at = np.arange(32) + 0.5 - 16
    for axis, side, where, name in ((0, 3.4, 0.9, "columns"), (1, 1.8, -1.3, "rows")):
        light = soft.by_pixel.sum(axis=axis) / soft.by_pixel.sum()
        middle = np.sum(light * at)
        assert middle == pytest.approx(where, abs=0.03)  # rays lie 1/28 of a pixel apart
        validation(
            case=f"variance along {name} of a plate {side:g} pixels wide behind {sigma_um:g} um of blur",
            source="a box's, a Gaussian's and a pixel's added; 1e-3 of the light is beyond reach",
            expected=side**2 / 12 + (sigma_um / 100) ** 2 + 1 / 12,
            got=np.sum(light * (at - middle) ** 2),
            tolerance=0.01 + 0.03 * (sigma_um / 100) ** 2,
            unit="pixel²",
        )


def test_an_edge_before_a_wall_stays_an_edge_in_depth(validation):
    """Beside the edge a pixel gets light of both depths, as two clusters each at its own range, unmixed."""
    lens = Receiver(focal_length_mm=100, f_number=2.8, n_rows=16, n_cols=16, psf=GaussianPsf(sigma_um=50.0))
    near, far = surface("near", plate(40, 80) - [20, 0, 0]), surface("far", plate(90, 90))
    truth = truth_of(near=place((0, 0, 1000)), far=place((0, 0, 1004)))
    got = see([near, far], truth, lens, Laser(divergence_deg=4.0))
    labels = scene.label(got.hits, got.photons, 2)
    assert np.all(labels.cluster_count[:, 7:9] == 2)
    for number, range_m in ((0, 1000.0), (1, 1004.0)):
        # Within 8 mrad of the axis slant ranges are longer by up to R θ²/2.
        slant = range_m * (np.sqrt(1 + ((np.arange(16) - 7.5) * 1e-3) ** 2 + 0.5e-3**2) - 1)
        validation(
            case=f"range of return {number + 1} in the pixel that an edge's blur lights",
            source="the plate's own range",
            expected=range_m + slant[8],
            got=labels.return_range_m[8, 8, number],
            tolerance=2e-3,
            unit="m",
        )


def test_a_uniform_kernel_over_the_field_changes_nothing_from_zone_to_zone():
    """Zones of a field-dependent kernel that is everywhere the same meet without a seam."""
    same = GaussianPsf(sigma_um=40.0)
    psf = FieldDependentPsf(fields=(FieldPsf(field_deg=0.0, psf=same), FieldPsf(field_deg=5.0, psf=same)))
    lens = Receiver(focal_length_mm=100, f_number=2.8, n_rows=32, n_cols=32)
    wall, truth = surface("wall", plate(90.0)), truth_of(wall=place((0, 0, 1000)))
    flat = see(wall, truth, lens, Laser(divergence_deg=5.0)).by_pixel
    soft = see(wall, truth, lens.replace(psf=psf), Laser(divergence_deg=5.0)).by_pixel
    assert soft[3:-3, 3:-3] == pytest.approx(flat[3:-3, 3:-3], rel=1e-3)


# ----------------------------------------------------------------------------------------------------------- sunlight

PAPER_LENS_ETA = Receiver(fov_deg=2.5, f_number=2.8, transmission=0.7, rays_per_pixel=1, min_rays_per_target=0)
START = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)


@pytest.fixture(scope="module")
def wall(tmp_path_factory):
    path = tmp_path_factory.mktemp("models") / "wall.stl"
    write_stl(path, np.roll(plate(60.0), 1, axis=2))  # faces along x
    return str(path)


def sunny(wall, sun_direction, receiver, material=None, laser=None, **settings):
    """Return a scenario with a wall of 60 m, 1 km ahead, in the light of a Sun."""
    return rl.Scenario(
        version=1,
        name="sunlit wall",
        world=rl.World(axes="local", sun_direction=sun_direction),
        time=rl.Time(start_utc=START, duration_s=1.0, frame_rate_hz=1.0),
        target=(
            rl.Target(
                name="wall",
                model=wall,
                material=material,
                motion=rl.Fixed(position_m=(1000.0, 0.0, 0.0)),
                center_of_mass_m=(0.0, 0.0, 0.0),
            ),
        ),
        follower=rl.Follower(motion=rl.Fixed(position_m=(0.0, 0.0, 0.0))),
        lidar=rl.Lidar(receiver=receiver, laser=laser or Laser()),
        **settings,
    )


def background(scenario):
    """Return the sunlight on each pixel [photons/s] of the first frame, or None."""
    frame = next(iter(rl.simulate(scenario, threads=1, keep=["photons"])))
    return frame.kept["photons"].background_photons_per_s


@pytest.mark.parametrize(
    ("wavelength_nm", "w_m2_um", "width_nm", "table"),
    # ASTM E490 in W m-2 um-1, and the table of instrument.md section 5, in photons a second to two digits.
    [
        (1064.0, 645.9, 1.0, 2.3e8),
        (1064.0, 645.9, 2.0, 4.6e8),
        (1064.0, 645.9, 10.0, 2.3e9),
        (1570.0, 264.5, 1.0, 1.4e8),
        (1570.0, 264.5, 2.0, 2.8e8),
        (1570.0, 264.5, 10.0, 1.4e9),
    ],
)
def test_sunlight_through_the_whole_walk(validation, wall, wavelength_nm, w_m2_um, width_nm, table):
    """N = E dlam rho0 cos(theta_s)/pi A IFOV² eta / (hc/lambda), lens of Fuller et al., rho0 0.30, eta 0.7 (E490)."""
    lens, laser = PAPER_LENS_ETA.replace(filter_width_nm=width_nm), Laser(wavelength_nm=wavelength_nm)
    seen = background(sunny(wall, (-1.0, 0.0, 0.0), lens, laser=laser))
    photon_j = 6.62607015e-34 * C / (wavelength_nm * 1e-9)
    expected = w_m2_um * width_nm * 1e-3 / photon_j * RHO * 8.618e-3 * 340.94e-6**2 * 0.7
    assert expected == pytest.approx(table, rel=0.02)
    validation(
        case=f"sunlight on a filled pixel at {wavelength_nm:g} nm behind a filter of {width_nm:g} nm",
        source="ASTM E490 and Lambert's law; lens of Fuller et al., whose figures have four digits",
        expected=expected,
        got=seen[64, 64],
        tolerance=5e-4 * expected,
        unit="photons/s",
    )
    # Over the field cos⁴ falls by 2 (sin 1.77 deg)² in the corner.
    assert seen.min() > 0.998 * seen.max()


def test_sunlight_goes_with_the_cosine_and_ends_at_the_terminator(wall):
    lens = PAPER_LENS_ETA.replace(filter_width_nm=1.0)
    noon = background(sunny(wall, (-1.0, 0.0, 0.0), lens))
    slant = background(sunny(wall, (-math.cos(1.2), 0.6 * math.sin(1.2), 0.8 * math.sin(1.2)), lens))
    assert slant == pytest.approx(math.cos(1.2) * noon, rel=1e-9)
    assert np.all(background(sunny(wall, (1.0, 0.2, 0.0), lens)) == 0)  # the Sun behind the wall


def test_no_filter_no_background(wall):
    assert background(sunny(wall, (-1.0, 0.0, 0.0), PAPER_LENS_ETA)) is None
    dark = sunny(wall, (-1.0, 0.0, 0.0), PAPER_LENS_ETA.replace(filter_width_nm=1.0)).replace(
        world=rl.World(axes="local")
    )
    assert np.all(background(dark) == 0)  # a local world without a Sun


def test_a_narrow_beam_leaves_the_sunlight_whole(wall):
    """Pixels that the beam misses, or that its edge cuts, get all their sunlight."""
    lens = PAPER_LENS_ETA.replace(filter_width_nm=1.0, rays_per_pixel=4)
    wide, square, circle = (
        background(sunny(wall, (-1.0, 0.0, 0.0), lens, laser=laser))
        for laser in (Laser(), Laser(divergence_deg=0.31), Laser(divergence_deg=0.31, footprint="circle"))
    )
    # The rays of a pixel that an edge cuts go through other points of it: cos⁴ changes by 1e-5 from one to the next.
    assert square == pytest.approx(wide, rel=3e-5) and circle == pytest.approx(wide, rel=3e-5)


@pytest.mark.parametrize("exponent", [3e4, 1e5])
def test_the_sun_in_a_mirror(validation, wall, exponent):
    """A mirror shows the Sun's disc of 6.8e-5 sr: 1.5e5 times the sunlight of a matt 0.30, times its reflectance.

    A lobe cosⁿ averaged over the disc of radius s keeps 1 - e^(-n s²/2) of it (instrument.md section 5).
    """
    lens = PAPER_LENS_ETA.replace(filter_width_nm=1.0)
    mirror = Phong(diffuse=0.0, specular=0.8, exponent=exponent)
    matt, glint = (background(sunny(wall, (-1.0, 0.0, 0.0), lens, material)) for material in (None, mirror))
    disc_sr = 2 * math.pi * (1 - math.cos(SUN_RADIUS_RAD))
    kept = (exponent + 2) / exponent * -math.expm1(-exponent * SUN_RADIUS_RAD**2 / 2)
    expected = 0.8 * kept / disc_sr / RHO
    assert expected < 0.8 * 1.55e5
    validation(
        case=f"sunlight of a mirror (Phong, n = {exponent:g}) over that of a matt 0.30",
        source="a disc of 6.8e-5 sr in a mirror of 0.8; twelve points of the disc, and half a pixel off the axis",
        expected=expected,
        got=glint[64, 64] / matt[64, 64],
        tolerance=0.01 * expected,
        unit="1",
    )
    assert glint[0, 0] < 0.5 * glint[64, 64]  # 1.8 degrees off the axis the Sun's image is elsewhere


def test_in_the_earth_s_shadow_there_is_no_sunlight(tmp_path):
    """Two spacecraft once around in a low orbit: background where the truth says the target is sunlit, none in eclipse."""
    write_stl(tmp_path / "box.stl", box(4.0, 4.0, 4.0))
    orbit = (
        '{ type = "kepler", epoch_utc = 2024-03-20T12:00:00Z, semi_major_axis_km = 6878, eccentricity = 0.0, '
        "inclination_deg = 10, raan_deg = 0, argument_of_perigee_deg = 0, true_anomaly_deg = 0 }"
    )
    text = f"""
    version = 1
    name = "around"
    [time]
    start_utc = 2024-03-20T12:00:00Z
    duration_s = 5600
    frame_rate_hz = 0.005
    [[target]]
    name = "box"
    model = "box.stl"
    center_of_mass_m = [0, 0, 0]
    motion = {orbit}
    attitude = {{ type = "spin", axis = [1, 2, 3], rate_deg_s = 0.3 }}
    [follower]
    motion = {{ type = "hill", relative_to = "box", position_m = [0, -300, 0], velocity_m_s = [0, 0, 0] }}
    attitude = {{ type = "look_at", at = "box" }}
    [lidar.receiver]
    fov_deg = 2.5
    f_number = 2.8
    n_rows = 24
    n_cols = 24
    rays_per_pixel = 4
    filter_width_nm = 1.0
    """
    scenario = rl.Scenario.loads(text, folder=tmp_path)
    shares, light = [], []
    for frame in rl.simulate(scenario, threads=1, keep=["photons"]):
        shares.append(frame.truth.sunlit["box"])
        light.append(frame.kept["photons"].background_photons_per_s.sum())
        assert frame.labels.photons.sum() > 0
    shares, light = np.array(shares), np.array(light)
    # A third of a low orbit near the plane of the ecliptic lies in shadow: asin(6371/6878)/180 deg = 38 %.
    assert (shares == 0).mean() == pytest.approx(0.38, abs=0.06) and (shares == 1).sum() > 10
    assert np.all(light[shares == 0] == 0)
    assert (light[shares == 1] > 0).sum() > 5  # where the follower sees a side that is lit


def test_sunlight_in_half_shadow_is_half(wall):
    """The share of the disc that the Earth leaves free multiplies the background, target by target."""
    receiver = PAPER_LENS_ETA.replace(filter_width_nm=1.0)
    target, truth = surface("wall", plate(90.0)), truth_of(wall=place((0, 0, 1000)))
    truth = dataclasses.replace(truth, sun_direction=np.array([0.1, 0.2, -1.0]) / math.sqrt(1.05))
    light = []
    for share in (1.0, 0.5, 0.0):
        lit = dataclasses.replace(truth, sunlit={"wall": share})
        light.append(flash_of(target, lit, receiver, Laser(), sun=True).photons.background_photons_per_s)
    assert light[1] == pytest.approx(0.5 * light[0], rel=1e-12) and np.all(light[2] == 0)


# ------------------------------------------------------------------------------------------------------------- jitter


def test_a_late_pulse_measures_long_and_is_labelled_true(validation, wall):
    """Timing jitter of 4 ns: each frame's ranges are off by c/2 times what its pulse was late, and labels are not.

    The mean over 1024 pixels of some 5 cm noise is good to 2 mm; energy jitter of 10 % scales the labelled photons.
    """
    lens = Receiver(fov_deg=2.5, f_number=2.8, n_rows=32, n_cols=32, rays_per_pixel=1, min_rays_per_target=0)
    laser = Laser(timing_jitter_ns=4.0, energy_jitter_fraction=0.1)
    jittery, steady = (
        sunny(wall, None, lens, laser=one).replace(time=rl.Time(start_utc=START, duration_s=4.0, frame_rate_hz=1.0))
        for one in (laser, Laser())
    )
    biases = []
    for k, (frame, calm) in enumerate(zip(rl.simulate(jittery), rl.simulate(steady), strict=True)):
        energy, late = jittery.rng(k, DETECTION).standard_normal(2)
        assert frame.labels.range_m == pytest.approx(calm.labels.range_m, abs=1e-9)
        assert frame.labels.photons == pytest.approx((1 + 0.1 * energy) * calm.labels.photons, rel=1e-5)
        assert frame.observation.settings == calm.observation.settings  # unknown to the receiver
        off, base = (np.nanmedian(one.range_m.astype(float) - one.labels.range_m) for one in (frame, calm))
        biases.append((0.5 * C * 4e-9 * late, off - base))
    expected, got = np.array(biases).T
    assert np.ptp(expected) > 0.5
    validation(
        case="greatest error of a frame's range bias under 4 ns of timing jitter",
        source="c/2 times the delay that the frame's generator draws; 4 standard errors of two medians of 1024 pixels",
        expected=0.0,
        got=np.abs(got - expected).max(),
        tolerance=4 * math.sqrt(2) * 1.2533 * 0.06 / 32,
        unit="m",
    )

"""What a lens with a point spread function does to the light of a scene: photons, depths, labels."""

import math

import numpy as np
import pytest
from scipy.special import erf

from rso_lidar import optics
from rso_lidar.errors import ScenarioError
from rso_lidar.optics import AiryPsf, BrownConrady, FieldDependentPsf, FieldPsf, GaussianPsf, GridPsf, Laser, Receiver
from rso_lidar.optics.returns import blur
from rso_lidar.scene import Lambertian, RetroReflector, label
from tests.optics.bench_for_tests import place, plate, see, surface, truth_of

# Pixels of 100 um, 1 m wide at 1 km; 16 rays in each.
LENS = Receiver(focal_length_mm=100, f_number=2.8, n_rows=24, n_cols=32)
LASER = Laser(divergence_deg=4.0)
PIXEL_M = 1.0
SOFT = GaussianPsf(sigma_um=50.0)


def at_pixels(right, down, range_m=1000.0):
    """Return a place, in pixels from the middle of the field."""
    return place((right * range_m * 1e-3, down * range_m * 1e-3, range_m))


def seen(width, height, right, down, lens=LENS, material=None, laser=LASER):
    """Return what is seen of one plate, in pixels from the middle."""
    target = surface("plate", plate(width * PIXEL_M, height * PIXEL_M), material)
    return see(target, truth_of(plate=at_pixels(right, down)), lens, laser)


def before_lens(scene, lens, laser=LASER):
    """Return the light of the same hits before a lens spreads it, and its photons pixel by pixel (row, col)."""
    photons = optics.collect(scene.hits, laser, lens.replace(psf=None))
    return photons, np.bincount(photons.pixel, photons.photons, math.prod(lens.shape)).reshape(lens.shape)


def with_psf(psf, lens=LENS):
    return lens.replace(psf=psf)


@pytest.mark.parametrize(
    "psf",
    [
        SOFT,
        GaussianPsf(sigma_um=1.0),
        GaussianPsf(sigma_um=120.0),
        AiryPsf(),
        GaussianPsf(sigma_um=10.0, halo_fraction=0.05, halo_radius_um=40.0),
        FieldDependentPsf(fields=(FieldPsf(field_deg=0.0, psf=AiryPsf()), FieldPsf(field_deg=1.0, psf=SOFT))),
    ],
    ids=["gaussian", "sharp", "wide", "airy", "halo", "field"],
)
@pytest.mark.parametrize("distortion", [None, BrownConrady(k1=-40.0)], ids=["straight", "barrel"])
def test_no_photon_is_lost_or_made(psf, distortion):
    """In the middle of the focal plane the sum stays to 1e-6."""
    lens = LENS.replace(distortion=distortion, n_rows=48, n_cols=48)
    blurred = seen(3.3, 2.2, 0.4, -0.7, lens.replace(psf=psf))
    sharp, _ = before_lens(blurred, lens)
    assert blurred.photons.photons.sum() == pytest.approx(sharp.photons.sum(), rel=1e-6)
    assert blurred.photons.photons.min() >= 0


def test_what_a_wall_loses_over_the_edge():
    """An evenly lit field of W pixels loses σ/√(2π) at each edge, so 2σ/(√(2π) W) of itself across and down."""
    blurred = seen(60, 60, 0, 0, with_psf(SOFT))
    sharp, by_pixel = before_lens(blurred, LENS)
    kept = [1 - 2 * 0.5 / math.sqrt(2 * math.pi) / n for n in LENS.shape]
    # 1e-3 of the light lies beyond the pixels that are looked at: some 1 % of what crosses an edge.
    assert blurred.photons.photons.sum() / sharp.photons.sum() == pytest.approx(math.prod(kept), abs=5e-4)
    inner = (slice(3, -3), slice(3, -3))
    assert blurred.by_pixel[inner] == pytest.approx(by_pixel[inner], rel=1e-5)  # rays lie evenly in their pixels


def shares_by_hand(hits, lens, sigma_m):
    """Return the shares (hit, row, col) of a Gaussian about each hit: boxes of 1/8 pixel, divided between two middles."""

    def along(at, n):
        before = np.floor(8 * at - 0.5)
        share = (8 * at - 0.5 - before)[:, None]
        return (1 - share) * box_along((before + 0.5) / 8, n) + share * box_along((before + 1.5) / 8, n)

    def box_along(at, n):
        sigma = sigma_m / lens.pixel_pitch_m

        def antiderivative(u):  # of the distribution function
            bell = sigma * np.exp(-0.5 * (u / sigma) ** 2) / math.sqrt(2 * math.pi)
            return 0.5 * u * (1 + erf(u / (sigma * math.sqrt(2)))) + bell

        edge, half = np.arange(n + 1), 0.5 / 8
        below = antiderivative(edge - at[:, None] + half) - antiderivative(edge - at[:, None] - half)
        return np.diff(below / (2 * half), axis=1)

    direction = hits.rays.direction[hits.ray]
    col, row = lens.image_of(direction[:, 0] / direction[:, 2], direction[:, 1] / direction[:, 2])
    return along(row, lens.n_rows)[:, :, None] * along(col, lens.n_cols)[:, None, :]


@pytest.mark.parametrize("distortion", [None, BrownConrady(k1=-40.0, p1=0.5)], ids=["straight", "bent"])
def test_the_image_is_the_sum_of_all_spots(distortion):
    """A plate at the upper right corner of a small focal plane, against erf for every hit and pixel."""
    lens = LENS.replace(psf=GaussianPsf(sigma_um=40.0), n_rows=10, n_cols=14, distortion=distortion)
    blurred = seen(4.3, 1.7, 4.6, -3.8, lens)
    sharp, _ = before_lens(blurred, lens)
    by_hand = np.einsum("h,hrc->rc", sharp.photons, shares_by_hand(blurred.hits, lens, 40e-6))
    assert blurred.by_pixel == pytest.approx(by_hand, abs=2e-3 * by_hand.max())
    assert np.unravel_index(blurred.by_pixel.argmax(), lens.shape) == np.unravel_index(by_hand.argmax(), lens.shape)


@pytest.mark.parametrize("sigma_um", [30.0, 60.0, 100.0])
@pytest.mark.parametrize("rays_per_pixel", [1, 16, 100])
def test_the_spot_of_a_small_target(sigma_um, rays_per_pixel):
    """The image of a point is a Gaussian about it: variance σ², and what pixels and cells of 1/8 of them add, w²/12."""
    right, down = 3.30, -2.85
    lens = with_psf(GaussianPsf(sigma_um=sigma_um), LENS.replace(rays_per_pixel=rays_per_pixel))
    image = seen(0.01, 0.01, right, down, lens).by_pixel
    light = image / image.sum()
    row, col = np.arange(lens.n_rows) + 0.5 - 12, np.arange(lens.n_cols) + 0.5 - 16
    for at, marginal, where in ((col, light.sum(axis=0), right), (row, light.sum(axis=1), down)):
        middle = np.sum(at * marginal)
        sigma = sigma_um / 100
        # What pixels as wide as the bell do to its mean: e^(-2π²σ²)/π (Sheppard's next term). A single ray of a pixel may
        # miss the plate's middle by half of the plate.
        assert middle == pytest.approx(where, abs=math.exp(-2 * (math.pi * sigma) ** 2) / math.pi + 0.01)
        variance = np.sum((at - middle) ** 2 * marginal)
        # Sheppard's next term for the variance; 1e-3 of the light lies beyond reach, at 3 to 4 σ, and what goes farther
        # than two pixels is spread as from anywhere in its pixel.
        ripple = 4 * (1 / (4 * math.pi**2) + sigma**2) * math.exp(-2 * (math.pi * sigma) ** 2)
        assert variance == pytest.approx(sigma**2 + 1 / 12 + 1 / (12 * 64), abs=ripple + 0.03 * sigma**2)


@pytest.mark.parametrize("f_number", [2.8, 8.0])
def test_a_pixel_as_wide_as_the_airy_disc_holds_the_disc(f_number):
    """A circle through the first dark ring, 1.22 λN, holds 83.8 % (Born and Wolf, 8.5.2); one about the pixel, 91 %."""
    pitch_um = 2.0 * 1.22 * 1.064 * f_number
    lens = LENS.replace(f_number=f_number, pixel_pitch_um=pitch_um, psf=AiryPsf(), rays_per_pixel=100)
    side_m = pitch_um * 1e-6 / 0.1 * 1000.0  # of a pixel, 1 km away
    target = surface("point", plate(0.01 * side_m))
    at = place((0.53 * side_m, -0.47 * side_m, 1000.0))  # near the middle of pixel (11, 16)
    image = see(
        target, truth_of(point=at), lens, LASER.replace(energy_mj=1e10)
    ).by_pixel  # parts of 0.01 photon are lost
    assert np.unravel_index(image.argmax(), image.shape) == (11, 16)
    assert 0.83 < image[11, 16] / image.sum() < 0.91


def step(lens, depth_m=20.0):
    """Return what is seen of a near plate left of the middle and a far one behind it."""
    near = surface("near", plate(40, 80) - [20, 0, 0])
    far = surface("far", plate(90, 90))
    return see([near, far], truth_of(near=place((0, 0, 1000)), far=place((0, 0, 1000 + depth_m))), lens, LASER)


def test_two_depths_stay_two_returns():
    """Beside the edge each pixel gets both plates, each with its own delay and with the share that spills over.

    Of an evenly lit half-plane the first pixel beyond its edge gets ∫₀¹ Φ(-u/σ) du, σ in pixels.
    """
    blurred = step(with_psf(SOFT))
    sharp, by_pixel = before_lens(blurred, LENS)
    target = blurred.hits.target[blurred.photons.hit]
    for number in (0, 1):
        of_hits, of_light = (
            sharp.delay_s[blurred.hits.target[sharp.hit] == number],
            blurred.photons.delay_s[target == number],
        )
        assert of_hits.min() - 1e-15 <= of_light.min() and of_light.max() <= of_hits.max() + 1e-15
    counts = blurred.labels.cluster_count
    assert np.all(label(blurred.hits, sharp).cluster_count == 1)
    assert np.all(counts[:, [15, 16]] == 2) and np.all(counts[:, :13] == 1) and np.all(counts[:, 19:] == 1)
    u = np.linspace(0, 1, 4001)
    spilt = np.trapezoid(0.5 * (1 - erf(u / 0.5 / math.sqrt(2))), u)
    light = np.zeros((2, *LENS.shape))
    for number in (0, 1):
        mine = target == number
        light[number] = np.bincount(blurred.photons.pixel[mine], blurred.photons.photons[mine], 24 * 32).reshape(24, 32)
    inner = slice(3, -3)
    near, far = by_pixel[inner, 15], by_pixel[inner, 16]
    assert light[0, inner, 16] == pytest.approx(spilt * near, rel=0.02)  # 1e-3 of the light is shared out anew
    assert light[0, inner, 15] == pytest.approx((1 - spilt) * near, rel=0.02)
    assert light[1, inner, 15] == pytest.approx(spilt * far, rel=0.02)
    assert np.all(light[0, :, 20:] == 0) and np.all(light[1, :, :12] == 0)


def test_labels_follow_the_light():
    """Pixels that only the blur lights carry the target's labels and range, and are filled by nothing."""
    sharp, blurred = (seen(2, 2, 0, 0, with_psf(p)) for p in (None, SOFT))
    lit, on = blurred.labels.photons > 0, sharp.labels.photons > 0
    assert on.sum() == 4 and lit.sum() > 12 and np.all(lit[on])
    spilt = lit & ~on
    assert np.all(blurred.labels.target[lit] == 0) and np.all(blurred.labels.target[~lit] == -1)
    assert np.all(blurred.labels.filled_fraction[spilt] == 0)
    assert blurred.labels.filled_fraction == pytest.approx(sharp.labels.filled_fraction, abs=1e-12)
    assert np.ptp(blurred.labels.range_m[lit]) < 1e-3 and abs(np.nanmean(blurred.labels.range_m) - 1000) < 1e-2
    assert blurred.labels.photons == pytest.approx(blurred.by_pixel, rel=1e-6)


@pytest.mark.parametrize("field", [False, True])
def test_returns_are_ordered_and_know_their_hits(field):
    psf = FieldDependentPsf(fields=(FieldPsf(field_deg=0.0, psf=SOFT),)) if field else SOFT
    scene = step(with_psf(psf))
    photons = scene.photons
    assert np.all(np.diff(photons.pixel) >= 0) and np.all(np.diff(photons.cluster_pixel) >= 0)
    same = np.diff(photons.pixel) == 0
    assert np.all(np.diff(photons.delay_s)[same] >= 0)
    path_m = 2 * scene.hits.range_m[photons.hit]
    assert photons.delay_s == pytest.approx(path_m / 299_792_458.0, abs=0.1 * 8e-9)  # what is nearer counts as one
    assert np.array_equal(photons.cluster_pixel[photons.cluster], photons.pixel)


def test_one_kernel_for_the_whole_field_is_that_kernel():
    once, many = (step(with_psf(psf)) for psf in (SOFT, FieldDependentPsf(fields=(FieldPsf(field_deg=0.0, psf=SOFT),))))
    assert many.by_pixel == pytest.approx(once.by_pixel, rel=1e-9)
    assert len(many.photons.pixel) == len(once.photons.pixel)


def outward(tmp_path, shift=1.5, n=41):
    """Return a kernel that moves light `shift` pixels toward the top row, sharp on the axis."""
    values = np.zeros((n, n))
    values[n // 2 - round(shift * 100 / 10), n // 2] = 1.0
    np.savetxt(tmp_path / "corner.csv", values, delimiter=",")
    rim = GridPsf(file=str(tmp_path / "corner.csv"), spacing_um=10.0)
    axis = GaussianPsf(sigma_um=1.0)
    return FieldDependentPsf(fields=(FieldPsf(field_deg=0.1, psf=axis), FieldPsf(field_deg=0.6, psf=rim)))


def centroid(image):
    row, col = (np.arange(n) + 0.5 - n / 2 for n in image.shape)
    return np.array([np.sum(image.sum(axis=0) * col), np.sum(image.sum(axis=1) * row)]) / image.sum()


@pytest.mark.parametrize(("right", "down"), [(11.1, 7.2), (-11.1, 7.2), (-11.1, -7.2), (11.1, -7.2), (0.1, 9.6)])
def test_a_kernel_that_changes_over_the_field_points_away_from_the_axis(tmp_path, right, down):
    """Far out the light moves by 1.5 pixels outwards, to the middle of a zone of 1/8 of the field (14° of azimuth)."""
    psf = outward(tmp_path)
    moved = centroid(seen(1, 1, right, down, with_psf(psf)).by_pixel) - centroid(seen(1, 1, right, down).by_pixel)
    toward = np.array([right, down]) / math.hypot(right, down)
    assert 1.5 * math.cos(math.radians(14)) < moved @ toward < np.linalg.norm(moved) + 1e-9 < 1.52
    near_axis = centroid(seen(1, 1, 0.5, -0.5, with_psf(psf)).by_pixel) - centroid(seen(1, 1, 0.5, -0.5).by_pixel)
    assert np.abs(near_axis) == pytest.approx(0, abs=1.5 * 0.2)  # the zone's middle lies at 0.14 degrees: 8 % of it


def test_zones_on_either_side_of_the_axis_mirror_each_other(tmp_path):
    """The field angle of a zone is that of its middle: zones that mirror each other spread light as in a mirror."""
    lens = with_psf(outward(tmp_path))
    shares = [blur.zone_shares(lens, LASER.wavelength_m, 2, zone) for zone in range(blur.ZONES**2)]
    for zone, share in enumerate(shares):
        row, col = divmod(zone, blur.ZONES)
        across = shares[row * blur.ZONES + blur.ZONES - 1 - col]
        down = shares[(blur.ZONES - 1 - row) * blur.ZONES + col]
        np.testing.assert_allclose(share, across[:, ::-1, :, ::-1], atol=1e-9)
        np.testing.assert_allclose(share, down[::-1, :, ::-1], atol=1e-9)


def test_the_halo_of_a_retro_reflector():
    """A 12.7 mm cube saturates; 1e-3 of its light, scattered as (1 + (r/R)²)^(-3/2), lights pixels far away.

    Of the halo R p² / (2π (R² + r²)^(3/2)) fall on a pixel of side p at the distance r.
    """
    psf = GaussianPsf(sigma_um=5.0, halo_fraction=1e-3, halo_radius_um=200.0)
    cube = RetroReflector(diameter_mm=12.7, reflectance=0.7, fill_fraction=1.0)
    target = surface("cube", plate(0.0127), cube.at(1064e-9))
    scene = see(target, truth_of(cube=at_pixels(0.55, -0.45)), with_psf(psf), LASER)
    light = scene.by_pixel / scene.by_pixel.sum()
    assert scene.by_pixel.sum() > 1e7  # four decades over what is detected
    row, col = 11, 16
    assert light[row, col] == pytest.approx(1.0, abs=2e-3)
    for down, right in ((0, 4), (5, 0), (-4, 3), (6, -6)):
        r = 100e-6 * math.hypot(down - 0.05, right - 0.05)  # the cube is so far from the middle of its pixel
        expected = 1e-3 * 200e-6 * 100e-6**2 / (2 * math.pi * (200e-6**2 + r**2) ** 1.5)
        # The pixel at 4 is wide beside the bend of the halo (1.5 %), and the kernel of sub-cells is smeared by 1/8 pixel.
        assert light[row + down, col + right] == pytest.approx(expected, rel=0.05)
    # A neighbour 4 pixels away sees a ghost at the cube's range.
    assert scene.labels.photons[row, col + 4] > 100
    assert scene.labels.range_m[row, col + 4] == pytest.approx(1000, abs=0.01)


@pytest.mark.parametrize("psf", [SOFT, FieldDependentPsf(fields=(FieldPsf(field_deg=0.0, psf=SOFT),))])
def test_nothing_seen_nothing_blurred(psf):
    scene = seen(1, 1, 100, 0, with_psf(psf))
    assert len(scene.photons.pixel) == 0 and np.all(scene.labels.target == -1)


def test_a_black_plate_blurs_into_nothing():
    scene = seen(3, 3, 0, 0, with_psf(SOFT), Lambertian(reflectance=0.0))
    assert np.all(scene.by_pixel == 0) and np.all(scene.labels.target[scene.labels.filled_fraction > 0] == 0)


def test_the_oversampled_image_is_from_before_the_lens():
    blurred = seen(3.3, 2.2, 0.4, -0.7, with_psf(SOFT))
    sharp, with_lens = (optics.oversample(blurred.hits, LASER, lens) for lens in (LENS, with_psf(SOFT)))
    assert np.array_equal(sharp.range_m, with_lens.range_m, equal_nan=True)
    assert np.array_equal(sharp.photons, with_lens.photons)
    assert with_lens.photons.sum(dtype=float) == pytest.approx(before_lens(blurred, LENS)[1].sum(), rel=1e-6)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"psf": GaussianPsf(sigma_um=5000.0)}, "only"),
        ({"distortion": BrownConrady(k1=-3000.0)}, "distortion"),
        ({"distortion": BrownConrady(k1=-400.0), "n_cols": 128, "n_rows": 128}, "distortion"),
    ],
)
def test_a_lens_that_cannot_be_is_told_before_the_first_flash(change, told):
    with pytest.raises(ScenarioError, match=told) as caught:
        optics.read_files(LASER, LENS.replace(**change))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "psf",
    [SOFT, AiryPsf(), GaussianPsf(sigma_um=60.0, halo_fraction=0.2, halo_radius_um=150.0)],
    ids=["gaussian", "airy", "halo"],
)
def test_light_of_any_strength_is_blurred_alike(psf):
    """From 70 photons a pixel to 7e-5, which a detector may add up over 10,000 pulses: all returns scale with the energy."""
    bright, faint = (seen(6.5, 4.5, 0.3, -0.2, with_psf(psf), laser=LASER.replace(energy_mj=mj)) for mj in (1.0, 1e-6))
    assert 30 < bright.by_pixel.max() < 80
    for name in ("pixel", "hit", "cluster"):
        assert np.array_equal(getattr(bright.photons, name), getattr(faint.photons, name))
    # A transform rounds to some 1e-16 of the brightest source.
    expected = 1e-6 * bright.photons.photons
    assert faint.photons.photons == pytest.approx(expected, rel=1e-9, abs=1e-14 * expected.max())


@pytest.mark.parametrize("sigma_um", [40.0, 80.0, 120.0, 200.0])
def test_the_centroid_of_a_dot_is_where_the_dot_is(sigma_um):
    """Across a pixel, to 0.005 pixel: a Gaussian over 0.4 pixels is sampled by pixels without bias."""
    lens = with_psf(GaussianPsf(sigma_um=sigma_um), LENS.replace(n_rows=40, n_cols=48))
    for right, down in ((3.02, -2.97), (3.27, -2.61), (3.49, -2.5), (3.77, -2.12), (3.98, -2.33)):
        found = centroid(seen(0.004, 0.004, right, down, lens).by_pixel)
        bias = math.exp(-2 * (math.pi * sigma_um / 100) ** 2) / math.pi  # of pixels as wide as the bell
        assert found == pytest.approx([right, down], abs=0.005 + bias)


def test_the_centroid_of_a_dot_with_a_strong_halo_is_where_the_dot_is():
    """Halo of radius 0.4 pixels with 30 % of the light: some of it lands where one kernel serves all sub-cells."""
    psf = GaussianPsf(sigma_um=60.0, halo_fraction=0.3, halo_radius_um=40.0)
    found = centroid(seen(0.004, 0.004, 3.42, -2.9, with_psf(psf, LENS.replace(n_rows=80, n_cols=80))).by_pixel)
    assert found == pytest.approx([3.42, -2.9], abs=0.01)

"""Ghost images: where a copy lands, how much of it, when, and what is left of it in the bookkeeping."""

from dataclasses import replace

import numpy as np
import pytest

from rso_lidar.optics import GaussianPsf, Ghost, Receiver
from rso_lidar.optics.stray.ghosts import LEAST_PHOTONS, add_ghosts, copy_image
from tests.detector.returns_for_tests import returns
from tests.optics.bench_for_tests import place, plate, see, surface, truth_of

C = 299_792_458.0
LENS = Receiver(focal_length_mm=100, f_number=2.8, n_rows=24, n_cols=32)


def light_of(ghosts, right=6.0, down=-4.0, width=2.0, psf=None, range_m=1000.0):
    """Return the photons of a bright plate, `right` and `down` of the middle in pixels, with and without ghosts."""
    lens = LENS.replace(ghosts=ghosts, psf=psf)
    where = place((right * range_m * 1e-3, down * range_m * 1e-3, range_m))
    seen = see(surface("plate", plate(width, width)), truth_of(plate=where), lens)
    return seen.photons, add_ghosts(seen.photons, lens), lens


def image_of(photons):
    return np.bincount(photons.pixel, photons.photons, np.prod(photons.shape)).reshape(photons.shape)


def centre(image):
    """Return row and column of the centre of light, from the outer corner of the first pixel."""
    rows, cols = np.indices(image.shape) + 0.5
    return np.array([(rows * image).sum(), (cols * image).sum()]) / image.sum()


@pytest.mark.parametrize("psf", [None, GaussianPsf(sigma_um=50)], ids=["sharp", "blurred"])
@pytest.mark.parametrize("defocus_um", [0.0, 250.0])
@pytest.mark.parametrize(
    ("where", "to"),
    [
        ({}, lambda at: np.array([24.0, 32.0]) - at),
        ({"mirror_pixels": (17.25, 10.5)}, lambda at: 2 * np.array([10.5, 17.25]) - at),
        ({"offset_pixels": (-7.4, 3.0)}, lambda at: at + np.array([3.0, -7.4])),
    ],
    ids=["axis", "point", "offset"],
)
def test_a_copy_lands_where_it_should_with_its_strength(where, to, defocus_um, psf):
    plain, ghostly, _ = light_of((Ghost(fraction=0.05, defocus_um=defocus_um, **where),), psf=psf)
    copy = image_of(ghostly) - image_of(plain)
    assert copy.sum() == pytest.approx(0.05 * plain.photons.sum(), rel=1e-3)
    assert centre(copy) == pytest.approx(to(centre(image_of(plain))), abs=2e-3)


def test_the_disc_of_a_ghost_out_of_focus_is_even():
    """A point on a disc of 4 pixels in radius gives 1/(16 π) of its light to each pixel inside, and none outside."""
    image = np.zeros(LENS.shape)
    image[12, 16] = 1.0
    ghost = Ghost(fraction=0.2, offset_pixels=(-2.0, 1.0), defocus_um=400.0)
    copy = copy_image(image, ghost, LENS) / 0.2
    row, col = np.indices(LENS.shape)
    apart = np.hypot(row - 13, col - 14)
    assert copy[apart < 3.0] == pytest.approx(1 / (16 * np.pi), rel=0.03)
    assert np.all(copy[apart > 5.5] < 1e-12)
    assert copy.sum() == pytest.approx(1.0, rel=1e-9)


def test_a_detour_makes_the_copy_late():
    plain, ghostly, _ = light_of((Ghost(fraction=0.05, extra_path_m=0.6),))
    from_ghost = ghostly.pixel > plain.pixel.max()
    assert from_ghost.any()
    late_s = np.average(ghostly.delay_s[from_ghost], weights=ghostly.photons[from_ghost]) - np.average(
        plain.delay_s, weights=plain.photons
    )
    assert late_s == pytest.approx(0.6 / C, rel=1e-6)


@pytest.mark.parametrize("turned", [False, True])
def test_a_copy_of_returns_that_are_merged_has_their_mean_delay_and_the_variance_of_their_rectangles(turned):
    """Two returns 0.8 ns apart, three parts and one of the light, on one pixel: depth is √12 times the deviation."""
    where = {"mirror_pixels": (17.0, 10.5)} if turned else {"offset_pixels": (2.0, 3.0)}
    lens = LENS.replace(ghosts=(Ghost(fraction=0.1, extra_path_m=3.0, **where),))
    plain = returns([900.0, 900.0 + 0.4e-9 * C], [3e4, 1e4], [5 * 32 + 7] * 2, lens.shape, [0, 0])
    plain = replace(plain, depth_spread_s=np.array([1.0e-9, 1.6e-9]), coherence_cells=np.array([60.0, 15.0]))
    ghostly = add_ghosts(plain, lens)
    # mirrored about (col 17, row 10.5) by edges, pixel (5, 7) is (15, 26); moved by 2 right and 3 down, it is (8, 9)
    copy = ghostly.pixel == (15 * 32 + 26 if turned else 8 * 32 + 9)
    assert copy.sum() == 1 and len(ghostly.pixel) == 3
    variance = 0.75 * 1.0**2 / 12 + 0.25 * 1.6**2 / 12 + 0.75 * 0.25 * 0.8**2
    assert ghostly.photons[copy] == pytest.approx([4e3], rel=1e-9)
    assert ghostly.delay_s[copy] == pytest.approx([2 * 900.0 / C + 0.2e-9 + 3.0 / C], rel=1e-12)
    assert ghostly.depth_spread_s[copy] == pytest.approx([np.sqrt(12 * variance) * 1e-9], rel=1e-6)
    assert ghostly.coherence_cells[copy] == pytest.approx([75.0], rel=1e-9)
    assert ghostly.hit[copy].tolist() == [0]


def test_light_beside_the_focal_plane_is_lost_and_nothing_wraps_around():
    plain, ghostly, _ = light_of((Ghost(fraction=0.05, offset_pixels=(9.5, 0.0)),))  # the plate is in columns 21 and 22
    copy = image_of(ghostly) - image_of(plain)
    assert np.abs(copy[:, :30]).max() < 1e-9 * plain.photons.sum()
    assert 0.0 < copy.sum() < 0.05 * plain.photons.sum()
    whole = 0.05 * image_of(plain).sum(axis=0)
    assert copy.sum(axis=0)[30:] == pytest.approx([0.5 * whole[21], 0.5 * (whole[21] + whole[22])], rel=1e-6)


def test_returns_stay_in_order_and_know_their_hits():
    plain, ghostly, lens = light_of((Ghost(fraction=0.05), Ghost(fraction=0.01, defocus_um=300.0)))
    keys = ghostly.pixel.astype(np.int64) * 10**15 + (ghostly.delay_s * 1e18).astype(np.int64) // 10**6
    assert np.all(np.diff(ghostly.pixel) >= 0) and np.all(np.diff(keys) >= 0)
    assert ghostly.photons.min() >= min(LEAST_PHOTONS, plain.photons.min())
    assert set(np.unique(ghostly.hit)) <= set(np.unique(plain.hit))
    assert np.all(ghostly.cluster_pixel[ghostly.cluster] == ghostly.pixel)
    # In focus, the copy of a pixel names the hit of that pixel.
    far = ghostly.pixel >= plain.pixel.max() + 3
    turned = lens.n_rows * lens.n_cols - 1 - ghostly.pixel[far]
    source_of = {int(p): set(plain.hit[plain.pixel == p].tolist()) for p in np.unique(turned)}
    sharp = [hit in source_of[int(p)] for hit, p in zip(ghostly.hit[far], turned, strict=True) if source_of[int(p)]]
    assert sharp and np.mean(sharp) > 0.5


def test_too_faint_a_copy_changes_nothing():
    plain, ghostly, _ = light_of((Ghost(fraction=1e-12),))
    assert ghostly is plain or np.array_equal(ghostly.photons, plain.photons)


def test_many_pulses_show_a_copy_that_is_too_faint_in_one():
    """A copy of 2e-3 to 5e-3 photons a pixel and pulse is left out in one pulse, and made in a hundred."""
    plain, _, lens = light_of(())
    brightest = image_of(plain).max()
    lens = lens.replace(ghosts=(Ghost(fraction=5e-3 / brightest),))
    assert add_ghosts(plain, lens) is plain
    copy = image_of(add_ghosts(plain, lens, 100)) - image_of(plain)
    assert copy.max() == pytest.approx(5e-3, rel=1e-6)
    assert copy.sum() == pytest.approx(5e-3 / brightest * plain.photons.sum(), rel=0.01)


def test_no_returns_have_no_ghosts():
    plain, ghostly, _ = light_of((Ghost(fraction=0.5),), right=500.0)
    assert len(plain.pixel) == len(ghostly.pixel) == 0

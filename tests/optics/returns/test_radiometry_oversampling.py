"""The photon image and range image on the grid of rays (Fuller et al., figs. 9 and 11)."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import rso_lidar as rl
from rso_lidar import optics
from rso_lidar.optics import BrownConrady, GaussianPsf, Laser, Receiver
from tests.optics.bench_for_tests import PAPER_LASER, PAPER_RECEIVER, box, look, place, plate, see, surface, truth_of


def made(scene, receiver, laser=PAPER_LASER):
    return optics.oversample(scene.hits, laser, receiver)


def binned(image, k):
    """Return the sum of k x k cells (row, col)."""
    rows, cols = (n // k for n in image.shape)
    return image.astype(float).reshape(rows, k, cols, k).sum(axis=(1, 3))


@pytest.mark.parametrize("rays_per_pixel", [1, 16])
@pytest.mark.parametrize("distortion", [None, BrownConrady(k1=5.0)], ids=["straight", "bent"])
def test_cells_add_up_to_pixels(rays_per_pixel, distortion):
    receiver = PAPER_RECEIVER.replace(rays_per_pixel=rays_per_pixel, distortion=distortion)
    k = receiver.rays_per_side
    for triangles, pose in ((plate(40.0), place((3, -5, 3000))), (plate(0.3), place((10.2, 7.1, 3000)))):
        scene = look(triangles, pose, receiver)
        image = made(scene, receiver)
        assert image.photons.shape == image.range_m.shape == (128 * k, 128 * k)
        assert binned(image.photons, k) == pytest.approx(scene.by_pixel, rel=1e-5, abs=1e-9)  # float32
        assert np.array_equal(np.isfinite(image.range_m), image.photons > 0)
        assert np.nanmin(image.range_m) == pytest.approx(scene.hits.range_m.min(), rel=1e-6)


def test_the_paper_s_figures_are_512_by_512():
    """Fuller et al., sec. 3: 128 x 128 pixels, 4 x 4 rays each. The picture lies as the lidar sees it, and shows depth."""
    near = surface("near", box(8.0, 8.0, 4.0))
    far = surface("far", plate(60.0, 30.0))
    receiver = PAPER_RECEIVER.replace(rays_per_pixel=16, min_rays_per_target=0)
    scene = see([near, far], truth_of(near=place((-10, -6, 2980)), far=place((5, 5, 3000))), receiver)
    image = made(scene, receiver)
    assert image.photons.shape == (512, 512)
    pixel_m = 3000 * PAPER_RECEIVER.pixel_tangent / 4
    at = lambda x, y: (256 + round(y / pixel_m), 256 + round(x / pixel_m))  # noqa: E731
    assert image.range_m[at(-10 * 2978 / 3000, -6)] == pytest.approx(2978, abs=0.1)
    assert image.range_m[at(20, 10)] == pytest.approx(3000, abs=0.2)
    assert np.isnan(image.range_m[at(-28, 0)]) and image.photons[at(-28, 0)] == 0  # left of the far plate
    assert np.isnan(image.range_m[at(20, -14)]) and np.isnan(image.range_m[0, 0])  # above it
    cells = np.isfinite(image.range_m)
    assert cells.sum() == len(scene.hits.ray)
    # On cells that see one plate photons are even: b and cos^4 vary by less than 1e-3 over the field.
    flat = image.photons[cells & (image.range_m > 2990)]
    assert np.ptp(flat) < 5e-3 * flat.mean()


def test_the_nearest_of_several_rays_gives_the_range_and_their_photons_add():
    """Contours of a small target cut the grid's lines: its cells hold several rays, and the sum of their light."""
    small = surface("small", plate(0.5))
    wall = surface("wall", plate(90.0))
    receiver = PAPER_RECEIVER.replace(rays_per_pixel=16)
    turned = place((0.7, 0.7, 2000), Rotation.from_euler("z", 0.4))
    scene = see([small, wall], truth_of(small=turned, wall=place((0, 0, 3000))), receiver)
    image = made(scene, receiver)
    assert len(scene.hits.ray) > np.isfinite(image.range_m).sum() + 10
    assert image.photons.sum(dtype=float) == pytest.approx(scene.photons.photons.sum(), rel=1e-5)
    row, col = np.unravel_index(np.nanargmin(image.range_m), image.range_m.shape)
    assert image.range_m[row, col] == pytest.approx(2000, abs=1e-3)
    assert binned(image.photons, 4) == pytest.approx(scene.by_pixel, rel=1e-5)
    # Cell by cell: on the border of the small target rays of both fall into one cell, in any order.
    direction = scene.hits.rays.direction[scene.hits.ray]
    at = PAPER_RECEIVER.image_of(direction[:, 0] / direction[:, 2], direction[:, 1] / direction[:, 2])
    nearest: dict[tuple[int, int], float] = {}
    for col, row, range_m in zip(*(np.floor(4 * x).astype(int) for x in at), scene.hits.range_m, strict=True):
        nearest[row, col] = min(range_m, nearest.get((row, col), np.inf))
    expected = np.full_like(image.range_m, np.nan)
    expected[tuple(np.transpose(list(nearest)))] = list(nearest.values())
    np.testing.assert_array_equal(image.range_m, expected)


def test_dark_hits_have_range_and_no_photons():
    """Beside a narrow beam, where sunlight is asked for, the scene is there and sends nothing."""
    receiver = PAPER_RECEIVER.replace(filter_width_nm=1.0, rays_per_pixel=16)
    laser = Laser(divergence_deg=0.5)
    scene = look(plate(140.0), place((0, 0, 3000)), receiver, laser)
    image = made(scene, receiver, laser)
    assert np.all(np.isfinite(image.range_m)) and (image.photons > 0).mean() == pytest.approx(0.04, rel=0.05)
    assert image.photons[256, 256] > 0 and image.photons[10, 10] == 0


def test_nothing_seen():
    scene = look(plate(1.0), place((500, 0, 3000)))
    image = made(scene, PAPER_RECEIVER)
    assert np.all(np.isnan(image.range_m)) and np.all(image.photons == 0)


def test_a_frame_keeps_it(text):
    scenario = rl.Scenario.loads(text)
    frame = next(iter(rl.simulate(scenario, keep=["oversampled", "photons"], threads=1)))
    image = frame.kept["oversampled"]
    assert image.photons.shape == (64, 64)
    assert binned(image.photons, 2) == pytest.approx(frame.labels.photons, rel=1e-5)


def test_a_lens_that_blurs_leaves_it_sharp():
    receiver = Receiver(fov_deg=2.5, f_number=2.8, n_rows=32, n_cols=32, rays_per_pixel=16)
    soft = receiver.replace(psf=GaussianPsf(sigma_um=80.0))
    blurred = look(box(9.0, 5.0, 3.0), place((2, 1, 3000)), soft)
    sharp = optics.collect(blurred.hits, PAPER_LASER, receiver)
    image = made(blurred, soft)
    assert binned(image.photons, 4).ravel() == pytest.approx(np.bincount(sharp.pixel, sharp.photons, 32 * 32), rel=1e-5)
    assert np.array_equal(image.photons, made(blurred, receiver).photons)
    assert np.count_nonzero(blurred.by_pixel) > 2 * np.count_nonzero(binned(image.photons, 4))

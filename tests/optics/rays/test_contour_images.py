"""Contours on the focal plane: where lenses image them, the edge of the beam, and their pieces in pixels."""

import math

import numpy as np
import pytest

from rso_lidar.optics import BrownConrady, Laser, Receiver
from rso_lidar.optics.rays.contour_images import cut_contours, image_contours, image_straight
from rso_lidar.records import Contours
from tests.reference.optics import scan_lines as oracle

LENS = Receiver(fov_deg=2.5, f_number=2.8, n_rows=24, n_cols=32)


def contours(ends, steps):
    """Return contours of one target."""
    return Contours(np.asarray(ends), np.asarray(steps), np.full((len(ends), 2), 1e-3), np.zeros(len(ends), np.int16))


def cut(ends, steps, window, sides=None):
    """Cut contours that nothing hides."""
    top, bottom, left, right = window
    sides = np.ones((bottom - top, right - left), np.int64) if sides is None else sides
    return cut_contours(ends, steps, np.ones((len(ends), 2)), sides, top, left, np.empty((4, 0, 0)), 0)


NONE = contours(np.empty((0, 4)), np.empty(0))


@pytest.mark.parametrize("seed", range(6))
def test_pieces_are_those_of_the_oracle(seed):
    rng = np.random.default_rng(seed)
    ends = rng.uniform(-2.0, 9.0, (40, 4))
    ends[:20, 2:] = ends[:20, :2] + rng.normal(0.0, 0.2, (20, 2))
    ends[::5, 2], ends[1::5, 3] = ends[::5, 0], ends[1::5, 1]  # upright and level ones
    steps, window = rng.uniform(1.0, 2.0, 40), (1, 6, 2, 7)
    starts, pieces, strength = cut(ends, steps, window)
    expected = oracle.cut_contours(ends, steps, window)
    np.testing.assert_array_equal(np.diff(starts), np.bincount(expected[:, 0].astype(int), minlength=25))
    np.testing.assert_allclose(pieces, expected[:, 1:6], rtol=1e-9, atol=1e-9)
    np.testing.assert_array_equal(strength, expected[:, 6])


@pytest.mark.parametrize("contours_of", [40, 4000])  # the second outgrow the room that is made at first
def test_pixels_without_rays_have_no_pieces(contours_of):
    rng = np.random.default_rng(contours_of)
    ends, steps, window = rng.uniform(0.0, 9.0, (contours_of, 4)), rng.uniform(1.0, 2.0, contours_of), (1, 7, 2, 8)
    sides = rng.integers(0, 3, (6, 6))
    starts, pieces, strength = cut(ends, steps, window, sides)
    of_all, every, steps_of_all = cut(ends, steps, window)
    kept = np.repeat(sides.ravel() > 0, np.diff(of_all))
    np.testing.assert_array_equal(np.diff(starts), np.where(sides.ravel() > 0, np.diff(of_all), 0))
    np.testing.assert_array_equal(pieces, every[kept])
    np.testing.assert_array_equal(strength, steps_of_all[kept])


def test_a_contour_along_the_edges_of_pixels_is_cut_once():
    ends = np.array([[0.0, 2.0, 4.0, 2.0], [2.0, 0.0, 2.0, 4.0], [0.0, 0.0, 4.0, 4.0], [4.0, 4.0, 4.0, 0.0]])
    _, pieces, strength = cut(ends, np.arange(4.0), (0, 4, 0, 4))
    length = np.hypot(pieces[:, 2] - pieces[:, 0], pieces[:, 3] - pieces[:, 1])
    sums = np.bincount(strength.astype(int), length, 4)
    np.testing.assert_allclose(sums, [4.0, 4.0, 4.0 * math.sqrt(2.0), 0.0])  # the last is the edge of the next pixels
    assert pieces[:, :4].min() >= 0.0 and pieces[:, :4].max() <= 1.0


def test_contours_are_imaged_by_the_lens_with_their_light():
    laser = Laser(divergence_deg=4.0)
    ends = np.array([[-0.01, 0.002, 0.015, 0.012]])
    images, steps, _ = image_contours(LENS, laser, contours(ends, [2e-7]))
    np.testing.assert_allclose(images, np.reshape(LENS.image_of(ends[0, ::2], ends[0, 1::2]), (1, 4), order="F"))
    gathered = LENS.pixel_tangent**2 * LENS.aperture_area_m2 * LENS.transmission
    np.testing.assert_allclose(steps, 2e-7 * laser.density_on_axis * gathered)


def test_ends_are_imaged_as_by_the_oracle():
    ends = np.random.default_rng(4).normal(0.0, 1.0, (20, 4)) * 10.0 ** np.arange(-4.0, 16.0)[:, None]
    expected = oracle.image_straight(ends, 1e-3, 16.0, 12.0)
    np.testing.assert_allclose(image_straight(ends, 1e-3, 16.0, 12.0), expected, rtol=1e-12)


def test_behind_a_lens_that_bends_them_contours_are_chords_of_the_image():
    """A long one, a short one that stays whole, one through the whole field from the lidar's plane, and one beside it."""
    lens = Receiver(fov_deg=30.0, f_number=2.8, n_rows=48, n_cols=64, distortion=BrownConrady(k1=-0.5))
    ends = np.array([[-0.2, 0.1, 0.2, 0.15], [0.1, 0.1, 0.102, 0.101], [0.1, -0.15, 9e6, 3e6], [2.0, 2.0, 3.0, 2.0]])
    images, steps, _ = image_contours(lens, Laser(divergence_deg=60.0), contours(ends, [1.0, 2.0, 3.0, 4.0]))
    steps = steps / steps.min()
    assert np.count_nonzero(np.isclose(steps, 2.0)) == 1
    on_image = (images[:, [0, 2]] > 1) & (images[:, [0, 2]] < 63) & (images[:, [1, 3]] > 1) & (images[:, [1, 3]] < 47)
    assert not on_image[np.isclose(steps, 4.0)].any()
    share = np.linspace(0.0, 1.0, 11)
    for contour in range(3):
        of = images[np.isclose(steps, contour + 1.0)]
        (x0, y0), along = ends[contour, :2], ends[contour, 2:] - ends[contour, :2]
        at = share[:, None] * of[:, None, 2:] + (1.0 - share[:, None]) * of[:, None, :2]
        inside = (at[..., 0] > 0) & (at[..., 0] < 64) & (at[..., 1] > 0) & (at[..., 1] < 48)
        x, y = lens.tangents_at(*at[inside].T)
        off = ((x - x0) * along[1] - (y - y0) * along[0]) / np.hypot(*along)
        assert (
            inside.any() and np.abs(off).max() < 0.05 * lens.pixel_tangent
        )  # a chord is off by a small part of a pixel
    long = images[np.isclose(steps, 1.0)]
    assert len(long) == 8
    np.testing.assert_allclose(long[1:, :2], long[:-1, 2:])


def test_a_contour_to_the_lidars_plane_keeps_its_direction():
    images, _, _ = image_contours(LENS, Laser(), contours([[0.0, 0.0, 3e7, 1e7]], [1.0]))
    along = images[0, 2:] - images[0, :2]
    assert along[1] / along[0] == pytest.approx(1.0 / 3.0)


@pytest.mark.parametrize("footprint", ["square", "circle", "as_printed", "pattern", "gaussian"])
def test_the_edge_of_a_narrow_beam_is_a_closed_contour(footprint, tmp_path):
    divergence = 0.05 if footprint == "gaussian" else 0.5
    settings = {}
    if footprint == "pattern":
        settings["pattern_file"] = str(tmp_path / "pattern.csv")
        np.savetxt(settings["pattern_file"], np.ones((4, 4)), delimiter=",")
    laser = Laser(divergence_deg=divergence, footprint=footprint, **settings)
    ends, steps, _ = image_contours(LENS, laser, NONE)
    x0, y0, x1, y1 = ((ends - [16.0, 12.0, 16.0, 12.0]) * LENS.pixel_tangent).T
    area, half = 0.5 * np.sum(x0 * y1 - x1 * y0), laser.half_width_tangent
    radius = np.hypot(x0, y0)
    if footprint == "gaussian":  # rings, the outermost of which encloses 99.5 % of the light at least
        assert radius.min() < 0.3 * half and 1.63 * half < radius.max() < 3.5 * half
        assert len(np.unique(radius.round(12))) > 8
        assert len(image_contours(LENS, laser.replace(divergence_deg=1.0), NONE)[0]) == 0
    else:
        assert area == pytest.approx((math.pi if footprint == "circle" else 4.0) * half**2, rel=1e-12)
        assert len(np.unique(steps)) == 1
        assert radius.max() < 1.5 * half


def test_a_beam_wider_than_the_field_or_beside_the_lens_has_no_edge():
    for laser in (Laser(divergence_deg=2.5), Laser(divergence_deg=3.6, footprint="circle")):
        assert len(image_contours(LENS, laser, NONE)[0]) == 0
    assert len(image_contours(LENS, Laser(divergence_deg=0.5, offset_m=(0.5, 0.0, 0.0)), NONE)[0]) == 0
    assert len(image_contours(LENS, Laser(divergence_deg=3.0, footprint="circle"), NONE)[0]) > 0  # corners are dark

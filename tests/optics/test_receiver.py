import math

import numpy as np
import pytest

from rso_lidar.errors import ScenarioError
from rso_lidar.optics import Baffle, BrownConrady, Glare, Receiver

SEED = Receiver(fov_deg=2.5, f_number=2.8)


def test_the_seed_lens():
    """Fuller et al., sec. 5: 128 pixels of 100 um over 2.5 degrees at f/2.8, worked out by hand."""
    focal_mm = 128 * 0.1 / (2 * math.tan(math.radians(1.25)))
    assert focal_mm == pytest.approx(293.3, abs=0.05)
    assert SEED.focal_length_m == pytest.approx(focal_mm * 1e-3, rel=1e-12)
    assert SEED.aperture_m == pytest.approx(0.10475, abs=5e-6)
    assert SEED.aperture_area_m2 == pytest.approx(8.618e-3, abs=5e-7)
    assert SEED.ifov_rad == pytest.approx(340.94e-6, abs=5e-9)
    assert SEED.fov_rad == pytest.approx(math.radians(2.5), rel=1e-12)


def test_the_same_lens_said_otherwise():
    other = Receiver(focal_length_mm=SEED.focal_length_m * 1e3, aperture_mm=SEED.aperture_m * 1e3)
    assert other.fov_rad == pytest.approx(SEED.fov_rad, rel=1e-12)
    assert other.aperture_area_m2 == pytest.approx(SEED.aperture_area_m2, rel=1e-12)
    assert np.allclose(other.line_of_sight, SEED.line_of_sight, rtol=0, atol=1e-15)


def test_a_wide_lens_keeps_square_pixels():
    wide = Receiver(fov_deg=90, f_number=2, n_rows=30, n_cols=60)
    assert wide.line_of_sight.shape == (30, 60, 3)
    x, y = (wide.line_of_sight[..., axis] / wide.line_of_sight[..., 2] for axis in (0, 1))
    assert np.allclose(np.diff(x, axis=1), 2 / 60, rtol=0, atol=1e-14)
    assert np.allclose(np.diff(y, axis=0), 2 / 60, rtol=0, atol=1e-14)


def test_rows_run_down_and_columns_run_right():
    sight = SEED.line_of_sight
    assert sight[0, 0, 0] < 0 and sight[0, 0, 1] < 0  # top left looks left and up, and +y is down
    assert sight[127, 0, 1] > 0 and sight[0, 127, 0] > 0
    assert np.allclose(sight[::-1, ::-1] * [-1, -1, 1], sight, rtol=0, atol=1e-15)
    assert np.allclose(np.linalg.norm(sight, axis=-1), 1, rtol=0, atol=1e-15)
    odd = Receiver(fov_deg=2.5, f_number=2.8, n_rows=5, n_cols=7)
    assert odd.line_of_sight[2, 3].tolist() == [0, 0, 1]


@pytest.mark.parametrize(
    ("bad", "word"),
    [
        ({"f_number": 2.8}, "exactly one of fov_deg"),
        ({"fov_deg": 2.5, "focal_length_mm": 100.0, "f_number": 2.8}, "exactly one of fov_deg"),
        ({"fov_deg": 2.5}, "exactly one of f_number"),
        ({"fov_deg": 2.5, "f_number": 2.8, "aperture_mm": 10.0}, "exactly one of f_number"),
        ({"fov_deg": 2.5, "f_number": 2.8, "rays_per_pixel": 15}, "16 instead of 15"),
        ({"fov_deg": 2.5, "f_number": 2.8, "rays_per_pixel": 2}, "1 instead of 2"),
        ({"fov_deg": 2.5, "f_number": 2.8, "n_rows": 100_000, "n_cols": 100_000}, "give fewer"),
        ({"fov_deg": 180.0, "f_number": 2.8}, "fov_deg"),
        ({"fov_deg": 2.5, "f_number": 2.8, "transmission": 1.01}, "transmission"),
        ({"fov_deg": 2.5, "f_number": 2.8, "n_rows": 0}, "n_rows"),
    ],
)
def test_a_receiver_that_cannot_be(bad, word):
    with pytest.raises(ScenarioError, match=word):
        Receiver(**bad)


# ----------------------------------------------------------------------------------------------------------- distortion

BENT = {
    "barrel": BrownConrady(k1=-0.2),
    "pincushion": BrownConrady(k1=0.3, k2=0.05),
    "aside": BrownConrady(k1=-0.1, p1=0.01, p2=-0.02),
}


@pytest.mark.parametrize("name", BENT)
def test_a_direction_falls_where_distort_says(name):
    """Whatever the pixel: the direction `tangents_at` gives for a place falls on that place, by Brown-Conrady."""
    lens = Receiver(fov_deg=30.0, f_number=2.0, n_rows=24, n_cols=36, distortion=BENT[name])
    col, row = np.random.default_rng(2).uniform([[0], [0]], [[36], [24]], (2, 500))
    x, y = lens.tangents_at(col, row)
    back = lens.image_of(x, y)
    assert np.abs(back[0] - col).max() < 1e-9 and np.abs(back[1] - row).max() < 1e-9
    k1, k2, _, p1, p2 = BENT[name].coefficients
    r2 = x * x + y * y
    by_hand = x * (1 + k1 * r2 + k2 * r2**2) + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
    assert by_hand / lens.pixel_tangent + 18 == pytest.approx(col, abs=1e-9)


@pytest.mark.parametrize("name", BENT)
def test_the_table_of_lines_of_sight_is_the_bent_one(name):
    lens = Receiver(fov_deg=30.0, f_number=2.0, n_rows=24, n_cols=36, distortion=BENT[name])
    sight = lens.line_of_sight
    assert np.allclose(np.linalg.norm(sight, axis=-1), 1, rtol=0, atol=1e-15)
    col, row = lens.image_of(sight[..., 0] / sight[..., 2], sight[..., 1] / sight[..., 2])
    assert np.abs(col - np.arange(36) - 0.5).max() < 1e-9 and np.abs(row - np.arange(24)[:, None] - 0.5).max() < 1e-9
    straight = lens.replace(distortion=None).line_of_sight
    corner = sight[0, 0, 0] / sight[0, 0, 2] / (straight[0, 0, 0] / straight[0, 0, 2])
    if name != "aside":  # a barrel lens sees more: its corner looks farther out
        assert (corner > 1) == (name == "barrel")


@pytest.mark.parametrize("name", BENT)
def test_the_edge_of_the_field_holds_every_direction(name):
    lens = Receiver(fov_deg=30.0, f_number=2.0, n_rows=24, n_cols=36, distortion=BENT[name])
    col, row = np.meshgrid(np.linspace(0, 36, 145), np.linspace(0, 24, 97))
    x, y = lens.tangents_at(col, row)
    assert np.abs(x).max() <= lens.field_edge[0] * (1 + 1e-6) and np.abs(y).max() <= lens.field_edge[1] * (1 + 1e-6)
    assert np.abs(x).max() > 0.999 * lens.field_edge[0] and np.abs(y).max() > 0.999 * lens.field_edge[1]
    straight = lens.replace(distortion=None)
    assert straight.field_edge.tolist() == pytest.approx([18 * lens.pixel_tangent, 12 * lens.pixel_tangent], rel=1e-15)


@pytest.mark.parametrize(("factor", "fits"), [(1.0 + 1e-6, True), (1.0 - 1e-6, False)])
def test_a_baffle_is_as_wide_as_the_lens_and_twice_the_slope_of_the_corner_of_the_field(factor, fits):
    """A lens of 50 mm; the corner of 30 by 20 pixels of 0.1 mm is 1.803 mm from the middle, 100 mm behind the lens."""
    least_mm = 50.0 + 2.0 * 200.0 * math.hypot(1.5, 1.0) / 100.0
    glare = Glare(baffle=Baffle(length_mm=200.0, diameter_mm=least_mm * factor))
    fields = {"focal_length_mm": 100.0, "f_number": 2.0, "n_rows": 20, "n_cols": 30, "filter_width_nm": 1.0}
    if fits:
        assert Receiver(**fields, glare=glare).glare == glare
        assert glare.baffle.lit_fraction(np.radians([0.0, 80.0]), 0.05).tolist() == [1.0, 1e-4]  # open, and shaded
    else:
        with pytest.raises(ScenarioError, match=r"needs 57\.21 mm; widen or shorten it"):
            Receiver(**fields, glare=glare)


def test_what_follows_from_a_lens_is_worked_out_once_and_not_carried_over():
    lens = Receiver(fov_deg=2.5, f_number=2.8)
    assert lens.line_of_sight is lens.line_of_sight and lens.field_edge is lens.field_edge
    closer = lens.replace(fov_deg=1.25)
    assert closer.pixel_tangent == pytest.approx(math.tan(math.radians(0.625)) / 64, rel=1e-12)
    assert lens == Receiver(fov_deg=2.5, f_number=2.8) and hash(lens) == hash(Receiver(fov_deg=2.5, f_number=2.8))

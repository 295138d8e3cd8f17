import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rso_lidar.optics import Laser, Receiver
from rso_lidar.scene import Lambertian, label
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

ONE_PIXEL = Receiver(focal_length_mm=293.3, f_number=2.8, n_rows=1, n_cols=1)  # 1.02 m at 3 km
C = 299_792_458.0


def two_plates(apart_m, near_share=0.5, **material):
    """Return what one pixel at 3 km sees of two plates side by side, the right one farther by so much."""
    side = ONE_PIXEL.pixel_tangent * 3000.0
    left, right = plate(side * near_share * 2, side * 2), plate(side * (1 - near_share) * 2, side * 2)
    edge = (near_share - 0.5) * side
    triangles = np.concatenate(
        [
            left + np.array([edge - side * near_share, 0, 0]),
            right + np.array([edge + side * (1 - near_share), 0, apart_m]),
        ]
    )
    return look(triangles, place((0, 0, 3000.0)), ONE_PIXEL, Laser(divergence_deg=1, **material)).labels


@pytest.mark.parametrize(
    ("apart_m", "fwhm_ns", "clusters"),
    [(0.5, 8.0, 1), (1.0, 8.0, 1), (1.195, 8.0, 1), (1.203, 8.0, 2), (1.3, 8.0, 2), (1.3, 10.0, 1), (1.0, 6.0, 2)],
)
def test_surfaces_part_where_the_gap_is_wider_than_half_the_pulse(apart_m, fwhm_ns, clusters):
    """c FWHM / 2: 1.199 m for 8 ns, 1.499 m for 10 ns, 0.899 m for 6 ns."""
    assert (apart_m > C * fwhm_ns * 1e-9 / 2) == (clusters == 2)
    labels = two_plates(apart_m, pulse_fwhm_ns=fwhm_ns)
    assert labels.cluster_count.tolist() == [[clusters]]


def test_one_cluster_reports_the_mean_and_two_the_brightest():
    """Two halves of a pixel: together their mean weighted by light, apart the one that sends more, and the nearest."""
    near, far = 3000.0, 3001.0
    one = two_plates(1.0)
    mean = (near / near**2 + far / far**2) / (1 / near**2 + 1 / far**2)
    assert one.range_m[0, 0] == pytest.approx(mean, abs=2e-3)  # slant ranges in the pixel differ by 0.1 mm
    assert one.first_range_m[0, 0] == one.range_m[0, 0]
    small_near = two_plates(2.0, near_share=0.25)
    assert small_near.range_m[0, 0] == pytest.approx(3002.0, abs=1e-3)
    assert small_near.first_range_m[0, 0] == pytest.approx(3000.0, abs=1e-3)
    big_near = two_plates(2.0, near_share=0.75)
    assert big_near.range_m[0, 0] == big_near.first_range_m[0, 0] == pytest.approx(3000.0, abs=1e-3)


@pytest.mark.parametrize("most", [2, 3, 5])
def test_returns_are_listed_from_the_nearest_on(most):
    """Three strips of a pixel at 3000, 3010 and 3025 m: ranges and photons in order, empty places behind them."""
    side = ONE_PIXEL.pixel_tangent * 3000.0
    strips = {"a": (-0.4, 0.2, 3010.0), "b": (-0.1, 0.4, 3000.0), "c": (0.3, 0.4, 3025.0)}  # middle, width, range
    targets = [surface(name, plate(width * side, 2 * side)) for name, (_, width, _) in strips.items()]
    truth = truth_of(**{name: place((middle * side, 0, z)) for name, (middle, _, z) in strips.items()})
    seen = see(targets, truth, ONE_PIXEL, Laser(divergence_deg=1))
    labels = label(seen.hits, seen.photons, most)
    ranges_m, photons = labels.return_range_m[0, 0], labels.return_photons[0, 0]
    assert ranges_m[: min(most, 3)] == pytest.approx([3000.0, 3010.0, 3025.0][:most], abs=0.01)
    assert np.isnan(ranges_m[3:]).all() and not photons[3:].any()
    width = np.array([0.4, 0.5 * 3000 / 3010 - 0.3, 0.5 * 3000 / 3025 - 0.1])  # of what the middle strip does not hide
    light = width / np.array([3000.0, 3010.0, 3025.0]) ** 2
    assert photons[: min(most, 3)] / photons[0] == pytest.approx((light / light[0])[:most], rel=1e-6)


def test_of_two_targets_the_brighter_speaks_and_the_photons_are_both_s():
    side = ONE_PIXEL.pixel_tangent * 3000.0
    dark, white = Lambertian(reflectance=0.05), Lambertian(reflectance=0.9)
    targets = [surface("dark", plate(2 * side), dark), surface("white", plate(side / 2, side), white)]
    truth = truth_of(
        dark=place((0, 0, 3000.0)), white=place((side / 4, 0, 3010.0))
    )  # hidden: the dark one is before it
    hidden = see(targets, truth, ONE_PIXEL, Laser(divergence_deg=1)).labels
    assert (hidden.target[0, 0], hidden.cluster_count[0, 0]) == (0, 1)
    truth = truth_of(dark=place((0, 0, 3010.0)), white=place((side / 4, 0, 3000.0)))
    both = see(targets, truth, ONE_PIXEL, Laser(divergence_deg=1)).labels
    assert (both.target[0, 0], both.cluster_count[0, 0]) == (1, 2)
    assert both.range_m[0, 0] == pytest.approx(3000, abs=1e-3)
    assert both.filled_fraction[0, 0] == pytest.approx(1, abs=1e-6)
    expected = hidden.photons[0, 0] * (0.5 * (3000 / 3010) ** 2 + 0.5 * 0.9 / 0.05)
    assert both.photons[0, 0] == pytest.approx(expected, rel=2e-3)


def test_sky():
    labels = look(sphere(5.0, 3), place((0, 0, 3000.0))).labels
    sky = labels.filled_fraction == 0
    assert 0 < np.sum(~sky) < 200
    for name in ("target", "part", "facet"):
        assert np.array_equal(getattr(labels, name) == -1, sky)
    for name in ("range_m", "first_range_m", "cos_incidence"):
        assert np.array_equal(np.isnan(getattr(labels, name)), sky)
    assert np.array_equal(labels.cluster_count == 0, sky)
    assert np.array_equal(labels.photons == 0, sky)


def test_a_scene_without_targets_is_sky():
    labels = see([], truth_of()).labels
    assert np.all(labels.target == -1) and np.all(np.isnan(labels.range_m)) and np.all(labels.photons == 0)


def test_filled_fraction_is_the_share_of_the_pixel():
    """A sphere's disc: pi R^2 / d^2 of the tangent plane, in pixels, to the sampling of its edge."""
    labels = look(sphere(20.0, 5), place((0, 0, 3000.0))).labels
    disc = np.pi * 20.0**2 / (3000.0**2 - 20.0**2) / PAPER_RECEIVER.pixel_tangent**2
    assert labels.filled_fraction.sum() == pytest.approx(disc, rel=3e-3)
    assert labels.filled_fraction.max() <= 1 + 1e-6


def test_a_black_facet_is_there_though_nothing_comes_back():
    labels = look(plate(50.0), place((0, 0, 3000.0)), material=Lambertian(reflectance=0.0)).labels
    assert labels.target[64, 64] == 0 and labels.photons[64, 64] == 0
    assert labels.range_m[64, 64] == pytest.approx(3000, abs=1e-3)
    assert labels.cos_incidence[64, 64] == pytest.approx(1, abs=1e-6)


@pytest.mark.parametrize("range_m", [3000.0, 5000.0, 10_000.0])
@pytest.mark.parametrize("tilt_deg", [45, 60, 75])
@pytest.mark.parametrize("rays_per_pixel", [4, 16, 64])
def test_a_tilted_plate_is_one_surface_and_so_one_cluster(range_m, tilt_deg, rays_per_pixel):
    """At 10 km a pixel is 3.4 m wide, and 60 degrees of tilt spread 5.9 m of depth over it, without a gap.

    A tilted facet is no comb of pulses (house.md section 6): rays a sub-pixel apart meet one surface, however finely
    the pixel is sampled.
    """
    lens = PAPER_RECEIVER.replace(
        n_rows=8,
        n_cols=8,
        rays_per_pixel=rays_per_pixel,
        fov_deg=None,
        focal_length_mm=PAPER_RECEIVER.focal_length_m * 1e3,
    )
    pose = place((0, 0, range_m), Rotation.from_rotvec([0, np.pi * tilt_deg / 180, 0]))
    labels = look(plate(1000.0), pose, lens, PAPER_LASER).labels
    assert labels.cluster_count.tolist() == [[1] * 8] * 8
    assert labels.range_m == pytest.approx(labels.first_range_m, abs=1e-9)


def test_a_box_before_a_tilted_wall_still_parts_from_it():
    """One surface must not swallow what really stands apart: 30 m before a wall of 60 degrees."""
    targets = [surface("wall", plate(2000.0)), surface("box", box(3, 3, 3))]
    truth = truth_of(wall=place((0, 0, 10_000.0), Rotation.from_rotvec([0, np.pi / 3, 0])), box=place((0, 0, 9970.0)))
    labels = see(targets, truth).labels
    # 3 m box on pixels of 3.4 m whose corners meet on the axis: a quarter of it in each of four.
    assert labels.cluster_count[63:65, 63:65].tolist() == [[2, 2], [2, 2]]
    assert np.all(labels.filled_fraction[63:65, 63:65] > 0.99)
    assert labels.first_range_m[63, 63] == pytest.approx(9968.5, abs=1e-2)

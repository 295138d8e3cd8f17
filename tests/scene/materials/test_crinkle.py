"""Crinkled foil: the mean over its cells against the integral over their slopes, and the same foil in every frame."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rso_lidar.errors import ScenarioError
from rso_lidar.mission_analysis.budgets.pixel_light import compute_photons
from rso_lidar.optics import Laser, Receiver
from rso_lidar.records import Rays
from rso_lidar.scene import Crinkled, cast
from tests.optics.bench_for_tests import look, place, plate, surface, truth_of

FOIL = Crinkled(diffuse=0.1, specular=0.7, exponent=40.0, tilt_deg=8.0, cell_mm=20.0)
RANGE_M = 300.0


def brdf_seen(material, angle_deg, *, threads=1, laser_from_m=None, rays=40_000, roll_deg=0.0, sun=None):
    """Return many hits on a 20 m plate, turned by an angle; everything, rays too, rolled about the line of sight."""
    rng = np.random.default_rng(3)
    half = 6.0 * math.cos(math.radians(angle_deg)) / RANGE_M
    xy = rng.uniform(-1, 1, (rays, 2)) * [half, 6.0 / RANGE_M]
    roll = Rotation.from_euler("z", roll_deg, degrees=True)
    direction = roll.apply(np.column_stack([xy, np.ones(rays)]))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    beam = Rays((1, 1), direction, np.zeros(rays, dtype=np.int32), np.full(rays, 1.0 / rays))
    foil = surface("foil", plate(20.0), material)
    turned = roll * Rotation.from_euler("y", angle_deg, degrees=True)
    truth = truth_of(foil=place((0.0, 0.0, RANGE_M), turned))
    if sun is not None:
        truth = replace(truth, sun_direction=np.asarray(sun, dtype=float))
    return cast(beam, [foil], truth, threads=threads, laser_from_m=laser_from_m, sun=sun is not None)


def smith(cosine, slope):
    """Return the share of a surface of normal slopes that is not hidden (Smith 1967, as Walter et al. 2007 give it)."""
    a = 1.0 / (math.sqrt(2.0) * slope * math.tan(math.acos(cosine))) if cosine < 1.0 else math.inf
    return 2.0 / (1.0 + math.erf(a) + math.exp(-a * a) / (a * math.sqrt(math.pi))) if math.isfinite(a) else 1.0


def expected(material, angle_deg):
    """Return the BRDF of the foil as the integral over slopes p, q of a cell, by Gauss-Hermite quadrature."""
    node, weight = np.polynomial.hermite_e.hermegauss(120)
    p, q = (grid * material.rms_slope for grid in np.meshgrid(node, node, indexing="ij"))
    w = np.outer(weight, weight) / (2.0 * math.pi)
    cosine, sine = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
    cos_tilt = 1.0 / np.sqrt(1.0 + p**2 + q**2)
    met = np.maximum((cosine + p * sine) * cos_tilt, 0.0)
    rho = material.brdf_per_sr(met)
    return float((w * rho * met**2 / cos_tilt).sum()) / cosine**2 * smith(cosine, material.rms_slope)


@pytest.mark.parametrize("angle_deg", [0.0, 10.0, 30.0, 60.0])
def test_the_closed_form_is_the_integral(angle_deg):
    cosine = np.array([math.cos(math.radians(angle_deg))])
    assert FOIL.mean_brdf_per_sr(cosine) == pytest.approx(expected(FOIL, angle_deg), rel=1e-9)
    same = FOIL.mean_brdf_per_sr(cosine, cosine, np.array([1.0]))
    assert same == pytest.approx(expected(FOIL, angle_deg), rel=1e-6)  # an azimuth of 1e-8 rad


def test_light_may_go_either_way():
    cos_in, cos_out, cos_phase = np.array([0.9, 0.5, 0.3]), np.array([0.4, 0.8, 0.2]), np.array([0.5, 0.1, -0.7])
    assert FOIL.mean_brdf_per_sr(cos_in, cos_out, cos_phase) == pytest.approx(
        FOIL.mean_brdf_per_sr(cos_out, cos_in, cos_phase), rel=2e-3
    )  # slopes beyond which a cell turns away end between two points of the quadrature


@pytest.mark.parametrize("tilt_deg", [5.0, 30.0])
@pytest.mark.parametrize("angle_deg", [0.0, 75.0, 88.0])
def test_no_more_light_leaves_than_comes(tilt_deg, angle_deg):
    """The reflectance of white foil over the hemisphere, by midpoints in azimuth and in the square of the sine."""
    white = Crinkled(diffuse=1.0, specular=0.0, exponent=0.0, tilt_deg=tilt_deg)
    sine2, azimuth = np.meshgrid((np.arange(24) + 0.5) / 24, (np.arange(24) + 0.5) * math.pi / 24)
    cos_out, cosine = np.sqrt(1.0 - sine2).ravel(), math.cos(math.radians(angle_deg))
    cos_phase = cosine * cos_out + math.sqrt(1.0 - cosine**2) * np.sqrt(sine2).ravel() * np.cos(azimuth).ravel()
    mean = white.mean_brdf_per_sr(np.full(cos_out.size, cosine), cos_out, cos_phase)
    assert 0.5 < math.pi * mean.mean() < 1.005


def test_the_link_budget_is_that_of_the_rays():
    """A wall of foil 20 degrees off, 9 x 9 pixels of a metre: their mean is the closed form's, by their own scatter."""
    receiver = Receiver(focal_length_mm=293.3, f_number=2.8, n_rows=9, n_cols=9, rays_per_pixel=256)
    pose = place((0.0, 0.0, 3000.0), Rotation.from_euler("y", 20.0, degrees=True))
    photons = look(plate(24.0), pose, receiver, Laser(), FOIL).photons
    of_pixel = np.bincount(photons.pixel, photons.photons, 81)
    told, _ = compute_photons(Laser(), receiver, FOIL, math.radians(20.0), np.array([3000.0]))
    assert of_pixel.mean() == pytest.approx(told[0], abs=5.0 * of_pixel.std() / 9.0)
    assert of_pixel.std() < 0.3 * of_pixel.mean()


@pytest.mark.parametrize("angle_deg", [0.0, 30.0, 60.0])
def test_the_mean_over_cells_is_the_integral_over_slopes(angle_deg):
    hits = brdf_seen(FOIL, angle_deg)
    point = hits.rays.direction[hits.ray] * hits.range_m[:, None]
    seen = hits.brdf_per_sr
    # cells, not hits, are what is drawn: some 600 x 600 on the plate; a hit's cell is shared by about one other
    cells = len(np.unique(np.floor(point / 0.02).astype(int), axis=0))
    error = seen.std() / math.sqrt(cells / 2)
    assert seen.mean() == pytest.approx(expected(FOIL, angle_deg), abs=5 * error)
    # the hits are those of a flat plate: range and cosine are the facet's
    assert hits.cos_incidence == pytest.approx(
        np.abs(hits.rays.direction[hits.ray] @ Rotation.from_euler("y", angle_deg, degrees=True).as_matrix()[:, 2])
    )


def test_slopes_are_normal_and_of_their_cells():
    rng = np.random.default_rng(1)
    point = np.stack([*rng.uniform(-500, 500, (2, 200_000)), np.zeros(200_000)])
    up = np.repeat(np.array([[0.0], [0.0], [1.0]]), 200_000, axis=1)
    turned = FOIL.tilt_normals(up, point)
    slope = turned[:2] / turned[2]
    assert np.linalg.norm(turned, axis=0) == pytest.approx(1.0)
    for one in slope:  # mean, deviation and fourth moment of a normal number, to five standard errors
        z = one / FOIL.rms_slope
        assert abs(z.mean()) < 5 / math.sqrt(len(z))
        assert z.std() == pytest.approx(1.0, abs=5 * math.sqrt(0.5 / len(z)))
        assert (z**4).mean() == pytest.approx(3.0, abs=5 * math.sqrt(96 / len(z)))
    assert abs(np.corrcoef(slope)[0, 1]) < 5 / math.sqrt(len(z))
    # a step of a tenth of a cell stays in nine cells of ten, along an axis
    beside = FOIL.tilt_normals(up, point + np.array([[0.002], [0.0], [0.0]]))
    assert np.mean(np.all(beside == turned, axis=0)) == pytest.approx(0.9, abs=0.01)
    other = FOIL.replace(pattern=1).tilt_normals(up, point)
    assert not np.any(np.all(other == turned, axis=0))


def test_it_is_the_same_foil_in_every_frame_and_with_any_threads():
    """Rolled with the camera the same places are hit: a millimetre aside, of 20 mm, they are of the same cell."""
    first, second, rolled = (
        brdf_seen(FOIL, 20.0, threads=threads, roll_deg=roll_deg, rays=20_000)
        for threads, roll_deg in ((1, 0.0), (2, 0.0), (1, 77.0))
    )
    assert np.array_equal(first.brdf_per_sr, second.brdf_per_sr)
    same = np.isclose(rolled.brdf_per_sr, first.brdf_per_sr, rtol=1e-4)
    assert same.mean() > 0.99  # but for hits within float32 of a cell's edge
    assert first.brdf_per_sr.std() > 0.3 * first.brdf_per_sr.mean()


def test_a_laser_beside_the_lens_meets_the_cells_from_there():
    """A centimetre aside is as good as in the lens; at 60 m, 11 degrees off, the mean is the closed form's."""
    here = brdf_seen(FOIL, 25.0)
    beside = brdf_seen(FOIL, 25.0, laser_from_m=(0.01, 0.0, 0.0))
    assert beside.brdf_per_sr == pytest.approx(here.brdf_per_sr, rel=0.01, abs=1e-3)
    assert beside.cos_incidence == pytest.approx(here.cos_incidence, abs=1e-4)
    far = brdf_seen(FOIL, 25.0, laser_from_m=(60.0, 0.0, 0.0))
    normal = Rotation.from_euler("y", 25.0, degrees=True).apply([0.0, 0.0, 1.0])
    point = far.rays.direction[far.ray] * far.range_m[:, None]
    toward = np.array([60.0, 0.0, 0.0]) - point
    toward /= np.linalg.norm(toward, axis=1, keepdims=True)
    back = -far.rays.direction[far.ray]
    cos_in, cos_out = np.abs(toward @ normal), np.abs(back @ normal)
    some = slice(None, None, 200)
    mean = FOIL.mean_brdf_per_sr(cos_in[some], cos_out[some], np.einsum("hi,hi->h", toward, back)[some])
    cells = len(np.unique(np.floor(point / 0.02).astype(int), axis=0))
    assert far.brdf_per_sr.mean() == pytest.approx(mean.mean(), abs=5 * far.brdf_per_sr.std() / math.sqrt(cells / 2))


def test_white_foil_in_the_sun_sends_back_no_more_than_it_gets():
    """Sun at 35 degrees, seen from directions drawn by the cosine: the mean of π BRDF is the reflectance."""
    white, rng = Crinkled(diffuse=1.0, specular=0.0, exponent=0.0, tilt_deg=8.0), np.random.default_rng(2)
    total = []
    for _ in range(50):
        angle_deg = math.degrees(math.asin(math.sqrt(rng.uniform(0.0, 0.98))))  # the last grazing ones miss the plate
        turned = Rotation.from_euler("y", angle_deg, degrees=True)
        normal = -turned.apply([0.0, 0.0, 1.0])
        across = Rotation.from_rotvec(normal * rng.uniform(0.0, 2 * math.pi)).apply(turned.apply([1.0, 0.0, 0.0]))
        sun = math.cos(math.radians(35.0)) * normal + math.sin(math.radians(35.0)) * across
        hits = brdf_seen(white, angle_deg, rays=2_000, sun=sun)
        total.append(math.pi * hits.sunlight_per_sr.mean() / math.cos(math.radians(35.0)))
    error = np.std(total) / math.sqrt(len(total))
    assert 0.96 < np.mean(total) < 1.0 + 3 * error  # 2 to 3 % meet the foil twice, and are lost


@pytest.mark.parametrize("wrong", [{"tilt_deg": 0.0}, {"tilt_deg": 31.0}, {"cell_mm": 0.0}, {"diffuse": 0.5}])
def test_wrong_foil_is_one_line(wrong):
    with pytest.raises(ScenarioError) as caught:
        FOIL.replace(**wrong)
    assert "\n" not in str(caught.value)

"""Crinkled foil: the mean over its cells against the integral over their slopes, and the same foil in every frame."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rso_lidar.errors import ScenarioError
from rso_lidar.records import Rays
from rso_lidar.scene import Crinkled, cast
from rso_lidar.scene.crinkle import tilted, unhidden
from tests.optics.bench_for_tests import place, plate, surface, truth_of

FOIL = Crinkled(diffuse=0.1, specular=0.7, exponent=40.0, tilt_deg=8.0, cell_mm=20.0)
RANGE_M = 300.0


def brdf_seen(material, angle_deg, *, threads=1, laser_from_m=None, rays=300_000, seed=3):
    """Return many hits on a 20 m plate, turned by an angle."""
    rng = np.random.default_rng(seed)
    half = 6.0 * math.cos(math.radians(angle_deg)) / RANGE_M
    xy = rng.uniform(-1, 1, (rays, 2)) * [half, 6.0 / RANGE_M]
    direction = np.column_stack([xy, np.ones(rays)])
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    beam = Rays((1, 1), direction, np.zeros(rays, dtype=np.int32), np.full(rays, 1.0 / rays))
    foil = surface("foil", plate(20.0), material)
    truth = truth_of(foil=place((0.0, 0.0, RANGE_M), Rotation.from_euler("y", angle_deg, degrees=True)))
    return cast(beam, [foil], truth, threads=threads, laser_from_m=laser_from_m)


def expected(material, angle_deg):
    """Return the BRDF of the foil as the integral over slopes p, q of a cell, by Gauss-Hermite quadrature."""
    node, weight = np.polynomial.hermite_e.hermegauss(120)
    p, q = (grid * material.slope for grid in np.meshgrid(node, node, indexing="ij"))
    w = np.outer(weight, weight) / (2.0 * math.pi)
    cosine, sine = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
    cos_tilt = 1.0 / np.sqrt(1.0 + p**2 + q**2)
    met = np.maximum((cosine + p * sine) * cos_tilt, 0.0)
    rho = material.brdf_per_sr(met)
    return float((w * rho * met**2 / cos_tilt).sum()) / cosine**2 * float(unhidden(np.array(cosine), material.slope))


@pytest.mark.parametrize("angle_deg", [0.0, 10.0, 30.0, 60.0])
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
    turned = tilted(up, point, FOIL)
    slope = turned[:2] / turned[2]
    assert np.linalg.norm(turned, axis=0) == pytest.approx(1.0)
    for one in slope:  # mean, deviation and fourth moment of a normal number, to five standard errors
        z = one / FOIL.slope
        assert abs(z.mean()) < 5 / math.sqrt(len(z))
        assert z.std() == pytest.approx(1.0, abs=5 * math.sqrt(0.5 / len(z)))
        assert (z**4).mean() == pytest.approx(3.0, abs=5 * math.sqrt(96 / len(z)))
    assert abs(np.corrcoef(slope)[0, 1]) < 5 / math.sqrt(len(z))
    # a step of a tenth of a cell stays in nine cells of ten, along an axis
    beside = tilted(up, point + np.array([[0.002], [0.0], [0.0]]), FOIL)
    assert np.mean(np.all(beside == turned, axis=0)) == pytest.approx(0.9, abs=0.01)
    other = tilted(up, point, FOIL.replace(pattern=1))
    assert not np.any(np.all(other == turned, axis=0))


def test_it_is_the_same_foil_in_every_frame_and_with_any_threads():
    first, second = brdf_seen(FOIL, 20.0), brdf_seen(FOIL, 20.0, threads=2)
    assert np.array_equal(first.brdf_per_sr, second.brdf_per_sr)


def test_a_laser_in_the_lens_is_one_beside_it():
    here, beside = brdf_seen(FOIL, 25.0), brdf_seen(FOIL, 25.0, laser_from_m=(1e-9, 0.0, 0.0))
    assert beside.brdf_per_sr == pytest.approx(here.brdf_per_sr, rel=1e-6, abs=1e-9)
    assert beside.cos_incidence == pytest.approx(here.cos_incidence, abs=1e-9)


def test_white_foil_sends_back_no_more_than_it_gets():
    """Directional-hemispherical reflectance at 55 degrees, over slopes and directions; what meets it twice is lost."""
    white, rng = Crinkled(diffuse=1.0, specular=0.0, exponent=0.0, tilt_deg=8.0), np.random.default_rng(2)
    n = 400_000
    p, q = rng.normal(size=(2, n)) * white.slope
    normal = np.array([-p, -q, np.ones(n)]) / np.sqrt(1 + p**2 + q**2)
    angle = math.radians(55)
    toward = np.array([math.sin(angle), 0.0, math.cos(angle)])
    cos_out, azimuth = np.sqrt(rng.uniform(size=n)), rng.uniform(0, 2 * math.pi, n)  # drawn by the cosine
    sine = np.sqrt(1 - cos_out**2)
    out = np.array([sine * np.cos(azimuth), sine * np.sin(azimuth), cos_out])
    met, left = np.maximum(toward @ normal, 0), np.maximum((out * normal).sum(axis=0), 0)
    share = met * left / normal[2] / toward[2] / cos_out * unhidden(np.array(toward[2]), white.slope)
    share *= unhidden(cos_out, white.slope)
    error = share.std() / math.sqrt(n)
    assert 0.97 < share.mean() < 1.0 + 3 * error  # of the 2 to 3 % that neighbours hide, all is lost


@pytest.mark.parametrize("wrong", [{"tilt_deg": 0.0}, {"tilt_deg": 31.0}, {"cell_mm": 0.0}, {"diffuse": 0.5}])
def test_wrong_foil_is_one_line(wrong):
    with pytest.raises(ScenarioError) as caught:
        FOIL.replace(**wrong)
    assert "\n" not in str(caught.value)

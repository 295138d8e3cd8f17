"""The veil of scattered light against its oracle, and the parts that describe it."""

import numpy as np
import pytest

from rso_lidar import optics
from rso_lidar.errors import ScenarioError
from rso_lidar.optics import Baffle, BrownConrady, Glare, Laser, Receiver
from rso_lidar.optics.stray import glare
from rso_lidar.pose import Link, PoseTree
from rso_lidar.records import BodyState, Sky, Truth
from tests.reference.optics import glare as oracle

LENS = Receiver(fov_deg=2.5, f_number=2.8, n_rows=48, n_cols=40, filter_width_nm=1.0, glare=Glare())
LASER = Laser()


def sky_truth(sun=(0.0, 0.0, 1.0), position_m=(0.0, 0.0, 0.0), sunlit=1.0):
    """Return the truth of a lidar whose axes are those of the root: a Sun's direction, and the follower's position."""
    follower = BodyState(np.array(position_m, dtype=float), np.zeros(3))
    tree = PoseTree({"lidar": "inertial"}, {"lidar": Link.still(None)})
    return Truth(0.0, tree, {"follower": follower}, np.array(sun, dtype=float), None, {"follower": sunlit})


def test_the_scatter_of_elements_is_what_the_oracle_sums():
    rng = np.random.default_rng(3)
    sight, toward = rng.normal(size=(40, 2)) * 0.02, rng.normal(size=(30, 2)) * 0.1
    given = sight, toward, rng.random(30), rng.random(30) * 1e-6, 0.8, 0.01, -1.7
    assert glare.sum_scatter(*given) == pytest.approx(oracle.sum_scatter(*given), rel=1e-12)


@pytest.mark.parametrize(
    "lens",
    [LENS, LENS.replace(distortion=BrownConrady(k1=-40.0)), LENS.replace(fov_deg=60.0)],
    ids=["straight", "barrel", "wide"],
)
@pytest.mark.parametrize(("off", "knee"), [(0.0, 0.003), (0.01, 0.003), (0.4, 0.01)])
def test_the_veil_between_its_nodes(lens, off, knee):
    """Splines through some pixels are within 1e-3 of the law at every pixel."""
    lens = lens.replace(glare=Glare(knee_sine=knee))
    sky = optics.see_sky(LASER, lens, sky_truth((off, 0.3 * off, 1.0)), has_earth=False)
    sight = lens.line_of_sight
    law = oracle.sum_scatter(
        sight.reshape(-1, 3)[:, :2],
        sky.direction[:, :2],
        glare.lens_light(sky, lens),
        0.5 * sky.radius_rad**2,
        lens.glare.surfaces * lens.glare.peak_per_sr,
        knee,
        lens.glare.slope,
    ).reshape(lens.shape)
    area = 1.0
    if lens.distortion is not None:
        area = lens.distortion.area_at_direction(sight[..., 0] / sight[..., 2], sight[..., 1] / sight[..., 2])
    gathered = lens.pixel_tangent**2 * lens.transmission * area * sight[..., 2] ** 4
    assert glare.veil(sky, lens) == pytest.approx(law * gathered, rel=1e-3)


def test_the_veil_on_the_axis_has_the_width_of_what_scatters_in_it():
    """E cos θ N b₀ (1 + (sin² θ + a²/2) / L²)^(s/2) over the pixel's solid angle, by body; the third element is hidden."""
    angle, radius = np.array([0.03, 0.5, 0.3]), np.array([0.04, 0.01, 0.02])
    toward = np.stack([np.sin(angle) * 0.6, np.sin(angle) * -0.8, np.cos(angle)], axis=1)
    sky = Sky(np.zeros(LENS.shape), toward, np.array([5e6, 8e9, 1e9]), radius, np.array([2, 0, 0]))
    got = glare.veil_on_axis(sky, LENS, np.array([False, False, True]))
    law = 8 * 0.1 * (1.0 + (np.sin(angle) ** 2 + radius**2 / 2.0) / 0.01**2) ** (-1.5 / 2.0)
    light = np.array([5e6, 8e9, 0.0]) * np.cos(angle) * law * (2.0 * np.tan(np.deg2rad(1.25)) / 40) ** 2 * 0.67
    assert got == pytest.approx([light[1], 0.0, light[0]], rel=1e-12)


def test_the_image_of_the_sun_far_from_the_axis_is_what_the_foreshortened_aperture_takes():
    """Irradiance times A cos θ times the transmission, at 32.6 degrees in a field of 80 degrees."""
    lens = LENS.replace(fov_deg=80.0)
    sky = optics.see_sky(LASER, lens, sky_truth((0.5, 0.4, 1.0)), has_earth=False)
    per_m2 = glare.band_photons_per_s_m2(LASER, lens)
    taken = per_m2 * lens.aperture_area_m2 / np.sqrt(1.41) * 0.67
    assert sky.image_photons_per_s.sum() == pytest.approx(taken, rel=0.01)  # points of a pixel on the edge of the disc


@pytest.mark.parametrize("shape", [(1, 1), (1, 64), (3, 5), (200, 2)])
def test_the_veil_of_small_focal_planes(shape):
    lens = LENS.replace(n_rows=shape[0], n_cols=shape[1])
    sky = optics.see_sky(LASER, lens, sky_truth((0.1, 0.0, 1.0)), has_earth=False)
    light = glare.veil(sky, lens)
    assert light.shape == shape and np.all(light > 0.0)


def test_no_light_without_sources():
    assert optics.see_sky(LASER, LENS.replace(glare=None), sky_truth()) is None
    dark = optics.see_sky(LASER, LENS, sky_truth((np.nan,) * 3), has_earth=False)
    behind = optics.see_sky(LASER, LENS, sky_truth((0.0, 0.0, -1.0)), has_earth=False)
    night = optics.see_sky(LASER, LENS, sky_truth((0.0, 0.0, 1.0), (0.0, 0.0, -7e6), sunlit=0.0))
    for sky in (dark, behind, night):
        assert sky.image_photons_per_s.sum() == 0.0
        assert glare.veil(sky, LENS).sum() == 0.0


def test_only_the_wanted_sources_give_light():
    where = sky_truth((0.6, 0.0, 0.8), (0.0, 0.0, -4e7))  # the half-lit Earth ahead, the Sun 37 degrees off
    moon_m = np.array([1e8, 0.0, 3e8])
    light = {}
    for names in (("sun",), ("earth",), ("moon",), ("sun", "earth", "moon")):
        lens = LENS.replace(glare=Glare(sources=names))
        light[names] = glare.veil(optics.see_sky(LASER, lens, where, moon_m), lens).mean()
    assert light.pop(("sun", "earth", "moon")) == pytest.approx(sum(light.values()), rel=1e-9)
    assert all(value > 0.0 for value in light.values())


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"glare": Glare(), "filter_width_nm": None}, "glare needs filter_width_nm"),
        ({"glare": Glare(baffle=Baffle(length_mm=200, diameter_mm=35))}, "cuts into the field of view"),
        ({"glare": {"peak_per_sr": 1e5}}, "for polished optics"),
        ({"glare": {"slope": 1.0}}, "less than or equal to 0"),
        ({"glare": {"sources": []}}, "glare.sources is empty"),
        ({"glare": {"sources": ["venus"]}}, "unknown value 'venus' (known: sun, earth, moon)"),
        ({"glare": {"knee_sine": 0.0}}, "greater than 0"),
        ({"ghosts": [{"fraction": 0.0}]}, "greater than 0"),
        ({"ghosts": [{"fraction": 0.01, "offset_pixels": [1, 1], "mirror_pixels": [2, 2]}]}, "give one of"),
        ({"ghosts": [{"fraction": 0.01, "offset_pixels": [0, 0]}]}, "lays the copy on the image"),
        ({"ghosts": [{"fraction": 0.01, "offset_pixels": [500, 0]}]}, "beside the focal plane"),
        ({"ghosts": [{"fraction": 0.01, "defocus_um": 1e6}]}, "twice the focal plane"),
        ({"ghosts": [{"strength": 0.01}]}, "unknown key 'strength'"),
    ],
)
def test_bad_stray_light_is_refused_in_one_line(table, words):
    with pytest.raises(ScenarioError) as caught:
        LENS.replace(**table)
    assert words in str(caught.value) and "\n" not in str(caught.value)

"""Earthshine on targets, against integrals over the Earth's surface, closed forms and a published approximation."""

import dataclasses
import datetime
import math

import numpy as np
import pytest
from scipy.integrate import dblquad

import rso_lidar as rl
from rso_lidar import units
from rso_lidar.scene.bounces import earthshine

START = datetime.datetime(2024, 3, 20, 12, tzinfo=datetime.UTC)
ALBEDO, REFLECTANCE = 0.3, 0.30
R = units.EARTH_RADIUS_M
NOON, NIGHT, TERMINATOR, MORNING = (1, 0, 0), (-1, 0, 0), (0, 0, 1), (1, 1, 0)
APART_M = 20.0
# Relative error of a mean over the hits. Were their 16 directions independent, the standard deviation over √n would be
# 0.15 % under a high Sun and 0.4 % at the terminator. Stratified directions stay below that.
SUM = 0.002


def state(x_m):
    """Return an orbit whose first position is on the x axis."""
    speed_m_s = math.sqrt(units.EARTH_GM_M3_S2 / x_m)
    return {
        "type": "state",
        "epoch_utc": START,
        "position_m": [x_m, 0.0, 0.0],
        "velocity_m_s": [0.0, speed_m_s, 0.0],
    }


def mission(height_m, *, albedo=ALBEDO, material=None, above=False, yaw_deg=0.0, screen=False):
    """Return a mission of a plate over the x axis, whose lower (or upper) face fills a small image."""
    x_m = R + height_m
    targets = [
        {
            "name": "plate",
            "model": "plate",
            "scale": 1.0,
            "material": material or {"type": "lambertian", "reflectance": REFLECTANCE},
            "motion": state(x_m),
            "attitude": {"type": "fixed", "euler_zyx_deg": [yaw_deg, 0.0, 0.0]},
        }
    ]
    if screen:  # behind the lidar, and wider than the Earth as the plate sees it
        targets.append(targets[0] | {"name": "screen", "scale": 40.0, "motion": state(x_m - APART_M - 2.0)})
    return rl.Scenario(
        version=1,
        name="Earthshine",
        world={"earth_albedo": albedo},
        time={"start_utc": START, "duration_s": 1, "frame_rate_hz": 1},
        target=targets,
        follower={
            "motion": state(x_m + (APART_M if above else -APART_M)),
            "attitude": {"type": "fixed", "euler_zyx_deg": [180.0 if above else 0.0, 0.0, 0.0]},
        },
        lidar={
            "receiver": {
                "fov_deg": 1.0,
                "f_number": 2.8,
                "n_rows": 16,
                "n_cols": 16,
                "rays_per_pixel": 4,
                "filter_width_nm": 1.0,
            }
        },
    )


def light(scenario, sun):
    """Return the mean of the steady light of all hits on the plate, over the Sun's irradiance [1/sr]."""
    truth = rl.Simulation(scenario).advance().truth
    to_sun = np.array(sun, dtype=float)
    truth = dataclasses.replace(truth, sun_direction=to_sun / np.linalg.norm(to_sun))
    hits = rl.flash(scenario, truth, np.random.default_rng(1), 1, keep=("hits",)).kept["hits"]
    return hits.sunlight_per_sr[hits.target == 0].mean()


def integrate_earth(height_m, sun, normal):
    """Return the irradiance of the lit Earth over the Sun's on a plate on the x axis, by its surface (Lambert's law)."""
    x_m, (sx, sy, sz), (nx, ny, nz) = R + height_m, np.array(sun) / np.linalg.norm(sun), normal

    def element(turn, cosine):
        sine = math.sqrt(1.0 - cosine * cosine)
        px, py, pz = cosine, sine * math.cos(turn), sine * math.sin(turn)
        lit = max(px * sx + py * sy + pz * sz, 0.0)
        dx, dy, dz = x_m - R * px, -R * py, -R * pz
        squared = dx * dx + dy * dy + dz * dz
        leaving, arriving = px * dx + py * dy + pz * dz, -(nx * dx + ny * dy + nz * dz)
        return lit * max(leaving, 0.0) * max(arriving, 0.0) * R * R / squared**2

    cap, _ = dblquad(element, R / x_m, 1.0, 0.0, 2.0 * math.pi, epsabs=1e-6, epsrel=1e-5)
    return ALBEDO / math.pi * cap


@pytest.mark.parametrize("height_m", [500e3, 2000e3, 35_786e3])
def test_a_plate_that_faces_an_evenly_lit_earth(height_m, monkeypatch, validation):
    """The view factor from a plate that faces a sphere is (R / r)²."""
    monkeypatch.setattr(
        earthshine, "earth_radiance", lambda toward, earth, sun, albedo: np.full(len(toward), albedo / math.pi)
    )
    expected = ALBEDO * (R / (R + height_m)) ** 2 * REFLECTANCE / math.pi
    validation(
        case=f"light of an evenly lit Earth on a plate {height_m / 1e3:.0f} km high that faces it, reflected",
        source="view factor (R / r)²; a sum over 16 directions a ray",
        expected=expected,
        got=light(mission(height_m), NOON),
        tolerance=SUM * expected,
        unit="1/sr",
    )


@pytest.mark.parametrize("sun", [NOON, MORNING, TERMINATOR], ids=["noon", "morning", "terminator"])
@pytest.mark.parametrize("height_m", [500e3, 35_786e3])
def test_a_plate_that_faces_the_earth(height_m, sun, validation):
    """The Sun is behind the plate or edge-on to it, so that all of its light is the Earth's."""
    expected = integrate_earth(height_m, sun, (-1.0, 0.0, 0.0)) * REFLECTANCE / math.pi
    validation(
        case=f"Earthshine on a plate {height_m / 1e3:.0f} km high that faces the Earth, the Sun toward {sun}",
        source="integral of Lambert's law over the Earth's surface; a sum over 16 directions a ray",
        expected=expected,
        got=light(mission(height_m), sun),
        tolerance=SUM * expected,
        unit="1/sr",
    )


def test_a_plate_that_is_tilted(validation):
    """At 50 degrees from the nadir part of the Earth is below the plate's horizon."""
    normal = (-math.cos(50 * units.DEG), -math.sin(50 * units.DEG), 0.0)
    expected = integrate_earth(500e3, NOON, normal) * REFLECTANCE / math.pi
    validation(
        case="Earthshine on a plate 500 km high, tilted by 50 deg",
        source="integral of Lambert's law over the Earth's surface; a sum over 16 directions a ray",
        expected=expected,
        got=light(mission(500e3, yaw_deg=50.0), NOON),
        tolerance=SUM * expected,
        unit="1/sr",
    )


@pytest.mark.parametrize("height_m", [300e3, 800e3, 20_200e3, 35_786e3])
def test_the_published_approximation_of_albedo(height_m, validation):
    """Wertz and Larson, Space Mission Analysis and Design, 3rd ed., sec. 11.5: a K sin²ρ, K = 0.664 + 0.521 ρ - 0.203 ρ².

    ρ is the angular radius of the Earth [rad]; K stands for sunlight that falls on a sphere, and is given to three digits.
    """
    radius = math.asin(R / (R + height_m))
    factor = 0.664 + 0.521 * radius - 0.203 * radius**2
    rounding = 0.0005 * (1.0 + radius + radius**2) / factor  # of coefficients with three digits
    expected = ALBEDO * factor * math.sin(radius) ** 2
    validation(
        case=f"albedo irradiance over the Sun's, {height_m / 1e3:.0f} km over the subsolar point",
        source="Wertz and Larson (1999), sec. 11.5, a fit",
        expected=expected,
        got=light(mission(height_m), NOON) * math.pi / REFLECTANCE,
        tolerance=(rounding + SUM) * expected,
        unit="1",
    )


def test_the_earth_in_a_mirror(validation):
    """A mirror over the subsolar point shows the radiance albedo / π, times its reflectance."""
    mirror = {"type": "phong", "diffuse": 0.0, "specular": 0.8, "exponent": 1e4}
    validation(
        case="Earthshine in a mirror of 0.8 over the subsolar point",
        source="Lambert's law: albedo / π",
        expected=0.8 * ALBEDO / math.pi,
        got=light(mission(500e3, material=mirror), NOON),
        tolerance=SUM * 0.8 * ALBEDO / math.pi,
        unit="1/sr",
    )


@pytest.mark.parametrize(
    "settings", [{"sun": NIGHT}, {"above": True, "sun": (0, 0, 1)}, {"screen": True, "sun": NOON}], ids=str
)
def test_where_there_is_none(settings):
    """Over the night side, on the face that looks away from the Earth, and behind another body."""
    chosen = dict(settings)
    sun = chosen.pop("sun")
    assert light(mission(500e3, **chosen), sun) == light(mission(500e3, **chosen, albedo=0.0), sun)


def test_it_goes_with_the_albedo():
    one, other = (light(mission(500e3, albedo=albedo), NOON) for albedo in (0.3, 0.6))
    assert other == pytest.approx(2.0 * one, rel=1e-12)

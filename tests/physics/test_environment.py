"""Sun, Earth and shadow about an orbit against published figures, an independent ephemeris, and the cones of the shadow."""

import datetime
import math

import numpy as np
import pytest

from rso_lidar import units
from rso_lidar.orbit import (
    Epochs,
    State,
    Tle,
    angle_rad,
    beta_angle_rad,
    earth_angular_radius_rad,
    find_eclipses,
    shadow_margins_rad,
    sun_position_m,
)

EARTH = units.EARTH_RADIUS_M
EQUINOX = datetime.datetime(2024, 3, 20, 3, 6, tzinfo=datetime.UTC)
SUN_DEG = 0.0105  # the analytic Sun against ERFA's, at worst
ISS = (  # CelesTrak, 30 July 2019
    "1 25544U 98067A   19211.03329231  .00004695  00000-0  87069-4 0  9995",
    "2 25544  51.6437 148.6985 0006091 196.9496 269.4947 15.51024086181901",
)
# Of that set by astropy 8.0.2 (its builtin ERFA Sun and its own TEME to GCRS) and sgp4 2.27: UTC, beta, and the Sun's angle
# from the velocity [deg]
ASTROPY = [("2019-07-30T12:00:00", 24.431532, 81.556767), ("2019-07-31T00:20:00", 21.972919, 91.023529)]


def equatorial(height_m):
    """Return a circular orbit in the equator, where the Sun stands at the equinox: beta is nought."""
    radius = EARTH + height_m
    return State(
        epoch_utc=EQUINOX,
        position_m=(radius, 0.0, 0.0),
        velocity_m_s=(0.0, math.sqrt(units.EARTH_GM_M3_S2 / radius), 0.0),
    )


def the_eclipse(height_m):
    """Return an eclipse of that orbit, half a revolution after the Sun is overhead."""
    period_s = 2 * math.pi * math.sqrt((EARTH + height_m) ** 3 / units.EARTH_GM_M3_S2)
    (found,) = find_eclipses(equatorial(height_m), Epochs(EQUINOX, np.array([0.0, period_s])))
    return found, period_s


@pytest.mark.parametrize(
    ("where", "height_m", "degrees"), [("a geostationary orbit", 35_786e3, 8.7), ("400 km", 400e3, 70.2)]
)
def test_the_earths_disk(validation, where, height_m, degrees):
    got = earth_angular_radius_rad(np.array([[EARTH + height_m, 0.0, 0.0]]))[0] / units.DEG
    # half the 17.4 degrees that an antenna of global coverage sees from GEO, and half of 140.4
    validation(
        case=f"Earth's angular radius from {where}",
        source="textbook figure, rounded to 0.1 deg",
        expected=degrees,
        got=got,
        tolerance=0.05,
        unit="deg",
    )


@pytest.mark.parametrize(("utc", "beta_deg", "ahead_deg"), ASTROPY)
def test_beta_and_sun_of_the_iss(validation, utc, beta_deg, ahead_deg):
    start = datetime.datetime.fromisoformat(f"{utc}+00:00")
    epochs = Epochs(start, np.zeros(1))
    state, sun = Tle(lines=ISS).states(epochs), sun_position_m(epochs)
    source = "astropy 8.0.2: get_body, TEME to GCRS"
    beta = beta_angle_rad(state, sun)[0] / units.DEG
    validation(
        case=f"beta of the ISS, {utc}", source=source, expected=beta_deg, got=beta, tolerance=SUN_DEG, unit="deg"
    )
    ahead = angle_rad(state.velocity_m_s, sun - state.position_m)[0] / units.DEG
    validation(
        case=f"Sun off the ISS's velocity, {utc}",
        source=source,
        expected=ahead_deg,
        got=ahead,
        tolerance=SUN_DEG,
        unit="deg",
    )


def test_the_longest_eclipse_of_a_geostationary_orbit(validation):
    """Textbooks give 69.4 min, a cylinder of 17.40 degrees in a sidereal day; the Sun moves on meanwhile: 0.2 min more."""
    one, _ = the_eclipse(35_786e3)
    umbra, whole = one.umbra_to_s - one.umbra_from_s, one.penumbra_to_s - one.penumbra_from_s
    validation(
        case="geostationary orbit at the equinox: longest eclipse, mean of umbra and umbra with penumbra",
        source="textbook figure, the shadow a cylinder",
        expected=69.4,
        got=0.5 * (umbra + whole) / 60.0,
        tolerance=0.25,
        unit="min",
    )
    # the orbit goes round once a sidereal day and the Sun once a year: 24 h for a revolution as the shadow sees it
    disc_deg = (
        2 * math.asin(units.SUN_RADIUS_M / np.linalg.norm(sun_position_m(Epochs(EQUINOX, np.zeros(1))))) / units.DEG
    )
    validation(
        case="geostationary orbit at the equinox: penumbra at one end",
        source="Sun's diameter over 360 deg in 24 h",
        expected=4.0 * disc_deg,
        got=0.5 * (whole - umbra) / 60.0,
        tolerance=0.01,  # the edges' own angle: the orbit crosses the shadow 0.1 deg off its middle, 1e-4 of it
        unit="min",
    )


def test_the_longest_eclipse_of_a_low_orbit(validation):
    one, period_s = the_eclipse(400e3)
    half = 0.5 * (one.umbra_to_s - one.umbra_from_s + one.penumbra_to_s - one.penumbra_from_s)
    validation(
        case="400 km with beta 0: eclipse, mean of umbra and umbra with penumbra",
        source="textbook figure: 36 min of 92",
        expected=36.0,
        got=half / 60.0,
        tolerance=0.5,
        unit="min",
    )
    validation(
        case="400 km with beta 0: share of the orbit in shadow",
        source="cylinder: asin(R / (R + h)) / pi",
        expected=math.asin(EARTH / (EARTH + 400e3)) / math.pi,
        got=half / period_s,
        tolerance=2e-4,  # the Sun goes 0.024 deg in half an hour of 140 deg
        unit="1",
    )


@pytest.mark.parametrize(
    ("name", "height_m"), [("400 km", 400e3), ("20,200 km", 20_200e3), ("geostationary", 35_786e3)]
)
def test_edges_lie_on_the_cones_that_touch_sun_and_earth(validation, name, height_m):
    """Vallado, 4th ed. sec. 5.3.2, with the Sun's own distance: half angles asin((Rs +- Re) / d), tips on the axis."""
    one, _ = the_eclipse(height_m)
    orbit = equatorial(height_m)
    worst_s = 0.0
    for time_s, sign in (
        (one.penumbra_from_s, 1),
        (one.umbra_from_s, -1),
        (one.umbra_to_s, -1),
        (one.penumbra_to_s, 1),
    ):
        at = Epochs(EQUINOX, np.array([time_s]))
        state, sun = orbit.states(at), sun_position_m(at)[0]
        distance = np.linalg.norm(sun)
        half = math.asin((units.SUN_RADIUS_M + sign * EARTH) / distance)
        behind = -float(np.sum(state.position_m[0] * sun)) / distance
        aside = np.linalg.norm(state.position_m[0] + behind * sun / distance)
        edge = math.tan(half) * (EARTH / math.sin(half) + sign * behind)  # the cone's radius there
        across = (state.position_m[0] + behind * sun / distance) / aside
        rate = abs(float(np.sum(state.velocity_m_s[0] * across)))  # at which the place leaves the axis
        worst_s = max(worst_s, abs(aside - edge) / rate)
    validation(
        case=f"{name} orbit: edges of umbra and penumbra off their cones, worst",
        source="Vallado, 4th ed., sec. 5.3.2",
        expected=0.0,
        got=worst_s * 1e3,
        tolerance=1.0,
        unit="ms",
    )


def test_shadow_axis(validation):
    """On the axis the umbra ends where the cones meet: R d / (Rs - R)."""
    distance = units.ASTRONOMICAL_UNIT_M
    tip = EARTH * distance / (units.SUN_RADIUS_M - EARTH)

    def covered(behind):
        place = np.array([[-behind, 0.0, 0.0]])
        return shadow_margins_rad(place, np.array([[distance, 0.0, 0.0]]))[1][0]

    low, high = 0.5 * tip, 2.0 * tip
    for _ in range(80):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if covered(middle) < 0.0 else (low, middle)
    validation(
        case="length of the Earth's umbra at 1 au",
        source="similar triangles: R d / (Rs - R)",
        expected=tip / 1e3,
        got=low / 1e3,
        tolerance=1e-3,
        unit="km",
    )

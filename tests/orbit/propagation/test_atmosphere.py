"""Atmospheres by NRLMSIS against published outputs, another program, and the storm of May 2024."""

import datetime
import importlib.util

import numpy as np
import pytest

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.orbit import Drag, Epochs, Forces, Geodetic, NrlmsisAtmosphere, itrs_from_gcrs, itrs_from_geodetic
from rso_lidar.orbit.propagation.atmosphere import ExponentialAtmosphere, air_density_kg_m3
from rso_lidar.orbit.sky.almanac import Almanac
from tests.orbit.propagation.weather_for_tests import make_csv

QUIET = {"f107": 150.0, "f107a": 150.0, "ap": 4.0}
needs_pymsis = pytest.mark.skipif(
    importlib.util.find_spec("pymsis") is None, reason="the extra `atmosphere` is not installed"
)


def density(atmosphere, instant, latitude_deg, longitude_deg, height_km, time_s=0.0):
    """Return the density above a place, some seconds after the start of a run."""
    start = instant - datetime.timedelta(seconds=time_s)
    place = Geodetic(latitude_deg * units.DEG, longitude_deg * units.DEG, height_km * 1e3)
    (turn,) = itrs_from_gcrs(Epochs(start, np.array([time_s])))
    r = tuple((turn.T @ itrs_from_geodetic(place)).tolist())
    return atmosphere.density_along(Almanac(start, sun=False, moon=False))(time_s, r)


def utc(*words):
    return datetime.datetime(*words, tzinfo=datetime.UTC)


# Columns of the reference files that NRL distributes with NRLMSIS 2.0 and 2.1: year and day, second, height [km], latitude,
# longitude [deg], mean flux, flux, ap, density [g/cm3] to four digits
PUBLISHED = [
    ("2.1", 6264, 42650, 155.0, 80.8, 150.2, 77.7, 70.9, 3.0, 0.9118e-12),
    ("2.1", 83289, 36443, 188.9, -35.5, 2.5, 105.6, 127.7, 13.0, 0.3411e-12),
    ("2.1", 12178, 13881, 250.0, -6.9, -38.6, 127.6, 88.5, 7.0, 0.3556e-13),
    ("2.1", 6283, 41080, 358.8, 46.2, 160.7, 79.3, 75.0, 2.0, 0.1644e-14),
    ("2.1", 73081, 82086, 414.7, -78.1, 23.7, 102.1, 88.1, 53.0, 0.1493e-14),
    ("2.0", 79092, 38525, 222.2, 8.8, 172.0, 179.9, 202.9, 36.0, 0.1732e-12),
    ("2.0", 78040, 76395, 377.8, -24.9, 108.2, 133.6, 161.3, 16.0, 0.3654e-14),
]


@needs_pymsis
@pytest.mark.parametrize("case", PUBLISHED, ids=[f"{row[0]}-{row[3]:g}km" for row in PUBLISHED])
def test_densities_of_the_models_own_reference_files(case):
    version, date, second, height_km, latitude, longitude, f107a, f107, ap, published = case
    year = date // 1000 + (1900 if date // 1000 > 60 else 2000)
    instant = utc(year, 1, 1) + datetime.timedelta(days=date % 1000 - 1, seconds=second)
    atmosphere = NrlmsisAtmosphere(version=version, f107=f107, f107a=f107a, ap=ap)
    # four digits are printed, of which the last is unsafe; and the height of a place is good to single precision
    assert density(atmosphere, instant, latitude, longitude, height_km, 5000.0) * 1e-3 == pytest.approx(
        published, rel=2e-3
    )


# The test program of NRLMSISE-00 (Picone et al. 2002), cases 11 to 15: day 172, 29,000 s, 60 N, 70 W, flux 150, ap 4. Its
# local time, 16 h, does not belong to that second and longitude. Above 80 km it matters by up to a factor of two, below
# it does not.
@needs_pymsis
@pytest.mark.parametrize(
    ("height_km", "published"),
    [(0, 1.261066e-3), (10, 4.059139e-4), (30, 1.950822e-5), (50, 1.294709e-6), (70, 1.147668e-7)],
)
def test_published_densities_of_nrlmsise_00_below_its_tides(height_km, published):
    atmosphere = NrlmsisAtmosphere(version="00", **QUIET)
    instant = utc(2001, 1, 1) + datetime.timedelta(days=171, seconds=29_000)
    assert density(atmosphere, instant, 60.0, -70.0, height_km) * 1e-3 == pytest.approx(published, rel=2e-3)


# brahe 1.8.0, density_nrlmsise00_geod (a port of its own, daily ap), with the space weather of CelesTrak: instant,
# longitude, latitude [deg], height [km], flux of the day before, its mean, ap, density [kg/m3]
BRAHE = [
    (utc(2024, 5, 9, 1, 30), 10.0, 20.0, 400.0, 227.1, 175.5, 5.0, 4.915323600765373e-12),
    (utc(2024, 5, 10, 20, 15), -70.0, 60.0, 400.0, 233.2, 176.2, 105.0, 1.0796902786209109e-11),
    (utc(2024, 5, 11, 4, 0), 150.0, -35.0, 250.0, 223.4, 177.1, 271.0, 1.536827988690091e-10),
    (utc(2024, 5, 12, 13, 0), -20.0, 75.0, 600.0, 213.7, 178.0, 53.0, 6.998482515315674e-13),
    (utc(2024, 5, 11, 10, 30), 100.0, 0.0, 300.0, 223.4, 177.1, 271.0, 6.331758091513073e-11),
]


@needs_pymsis
@pytest.mark.parametrize("case", BRAHE, ids=[f"{row[0]:%d_%Hh}" for row in BRAHE])
def test_nrlmsise_00_against_brahe(case):
    instant, longitude, latitude, height_km, f107, f107a, ap, brahe = case
    atmosphere = NrlmsisAtmosphere(version="00", f107=f107, f107a=f107a, ap=ap)
    # pymsis computes in single precision, brahe in double; the model itself is good to 15 % (Picone et al. 2002)
    assert density(atmosphere, instant, latitude, longitude, height_km, -3000.0) == pytest.approx(brahe, rel=5e-4)


@needs_pymsis
def test_the_table_is_of_the_same_order_in_mean_activity():
    atmosphere = NrlmsisAtmosphere(**QUIET)
    for height_km in (200, 300, 400, 500, 600):
        by_day = [density(atmosphere, utc(2024, 3, 20, hour), 0.0, 0.0, height_km) for hour in (2, 8, 14, 20)]
        assert 0.3 < np.mean(by_day) / air_density_kg_m3(height_km * 1e3) < 3.0
        if height_km >= 400:
            assert by_day[2] > 1.5 * by_day[0]  # the afternoon's bulge


@needs_pymsis
def test_a_storm_makes_the_air_denser(tmp_path):
    """Satellites at 400 to 500 km measured two to six times the density in the night of 10 to 11 May 2024 (Parker and
    Linares, J. Spacecraft and Rockets 61, 2024; Swarm and GRACE-FO); models give less, and at least half more.
    """
    (tmp_path / "sw.csv").write_text(make_csv())
    atmosphere = NrlmsisAtmosphere(space_weather_file=str(tmp_path / "sw.csv"))
    calm, storm = (density(atmosphere, utc(2024, 5, day, 4), 40.0, 100.0, 420.0) for day in (10, 11))
    assert 1.5 < storm / calm < 6.0


@needs_pymsis
def test_drag_is_proportional_to_the_density_and_absent_far_out():
    r, v = np.array([[6.78e6, 0.0, 0.0], [0.0, 9e6, 0.0]]), np.array([[0.0, 4.0e3, 6.5e3], [6e3, 0.0, 2e3]])
    start, times = utc(2024, 5, 10), np.array([100.0, 100.0])
    pushes = []
    for atmosphere in (ExponentialAtmosphere(), NrlmsisAtmosphere(**QUIET)):
        drag = Forces(zonal_degree=0, drag=Drag(area_m2=4.0, mass_kg=400.0, atmosphere=atmosphere))
        pushes.append(
            drag.acceleration(Epochs(start, times), r, v)
            - Forces(zonal_degree=0).acceleration(Epochs(start, times), r, v)
        )
    rho = [a.density_along(Almanac(start, sun=False, moon=False))(100.0, tuple(r[0])) for a in (
        ExponentialAtmosphere(), NrlmsisAtmosphere(**QUIET))]  # fmt: skip
    np.testing.assert_allclose(pushes[1][0] / rho[1], pushes[0][0] / rho[0], rtol=1e-6)
    assert not pushes[0][1].any() and not pushes[1][1].any()


@needs_pymsis
def test_steps_of_the_integration_end_where_the_space_weather_changes(tmp_path):
    (tmp_path / "sw.csv").write_text(make_csv())
    start = utc(2024, 5, 11, 2, 50)
    drag = Drag(area_m2=4.0, mass_kg=400.0, atmosphere=NrlmsisAtmosphere(space_weather_file=str(tmp_path / "sw.csv")))
    piece = Forces(drag=drag).phase(start)
    assert piece(599.9, (7e6, 0.0, 0.0)) != piece(600.1, (7e6, 0.0, 0.0)) == piece(11_399.9, (0.0, 7e6, 0.0))
    assert Forces(drag=Drag(area_m2=4.0, mass_kg=400.0)).phase(start) is None


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({}, "f107: is missing; give f107, f107a and ap, or a space_weather_file"),
        ({"f107": 150.0, "ap": 4.0}, "f107a: is missing"),
        ({"space_weather_file": "sw.csv", "ap": 4.0}, "ap: space_weather_file has it; leave one of them out"),
        ({**QUIET, "ap": 500.0}, "ap"),
        ({**QUIET, "f107": -1.0}, "f107"),
        ({**QUIET, "f107": 0.15}, "f107: should be greater than or equal to 20"),
        ({**QUIET, "f107a": 1e6}, "f107a: should be less than or equal to 1000"),
        ({**QUIET, "version": "1.0"}, "version"),
    ],
)
def test_activity_is_given_once_and_whole(fields, message):
    with pytest.raises(ScenarioError, match=message):
        NrlmsisAtmosphere(**fields)


def test_without_the_extra_the_error_names_it(monkeypatch):
    known = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "pymsis" else known(name))
    drag = Drag(area_m2=4.0, mass_kg=400.0, atmosphere=NrlmsisAtmosphere(**QUIET))
    with pytest.raises(ScenarioError, match=r"needs the extra 'atmosphere' \(pip install 'rso-lidar\[atmosphere\]'\)"):
        Forces(drag=drag).field(utc(2024, 5, 10))

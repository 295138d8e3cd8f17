"""Propagators against the outside world: textbooks, and whole days flown by brahe with the same forces."""

import datetime
import functools
import math

import numpy as np
import pytest

from rso_lidar import units
from rso_lidar.orbit import (
    J2,
    Epochs,
    Forces,
    Gravity,
    Kepler,
    Numerical,
    RadiationPressure,
    elements_from_state,
    integrate_orbit,
    propagate_two_body,
)
from rso_lidar.orbit.propagation.j2 import secular_rates
from rso_lidar.orbit.sky.moon import ecliptic_of_date
from tests.orbit.earth.earth_for_tests import finals

GM = units.EARTH_GM_M3_S2
START = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)
DAY = np.array([86_400.0])

STARTS = {
    "low orbit": [4.2e6, -3.1e6, 4.4e6, 3.6e3, 6.5e3, 1.2e3],
    "geostationary orbit": [42164e3, 0.0, 0.0, 0.0, 3074.6, 10.0],
    "orbit with e = 0.73": [7.0e6, 0.0, 1.0e5, 0.0, 4.2e3, 9.0e3],
}
# brahe 1.8.0, NumericalOrbitPropagator, high_precision (RKN12(10)), no Earth orientation data, positions after a day [m].
# Forces: none; earth_zonal J2 and J6 (EGM2008, pole of IAU 2006/2000A); low-precision Sun and Moon; sunlight on 4 m2 of
# a body of 100 kg, Cr 1.3, P0 4.56e-6 N/m2, conical shadow
BRAHE = {
    ("low orbit", "none"): [5217848.087922664, -17633.82033117101, 4389789.273563106],
    ("low orbit", "J2"): [5330205.173434172, 64643.462452603104, 4256160.993320357],
    ("low orbit", "J2 to J6"): [5330054.523911757, 62608.502177249815, 4256698.377429141],
    ("low orbit", "Sun and Moon"): [5217853.975987012, -17557.961095166276, 4389778.314026813],
    ("low orbit", "sunlight"): [5217850.508518339, -17616.120215926552, 4389785.48657854],
    ("geostationary orbit", "none"): [42157508.742203414, 739816.9033785434, 2406.2216333133692],
    ("geostationary orbit", "J2"): [42157158.4260019, 759502.4755633237, 2502.2323041423683],
    ("geostationary orbit", "J2 to J6"): [42157158.399559945, 759503.3175596677, 2502.2377287627733],
    ("geostationary orbit", "Sun and Moon"): [42157281.77141771, 750284.4209601702, 2448.335005734493],
    ("geostationary orbit", "sunlight"): [42157518.168653555, 741473.7338025575, 2411.940605192743],
    ("orbit with e = 0.73", "none"): [-2626001.180623519, 5928922.337909097, 12667319.278653447],
    ("orbit with e = 0.73", "J2"): [-4919109.731262638, 6449182.230750085, 13709814.090976408],
    ("orbit with e = 0.73", "J2 to J6"): [-4921452.025685688, 6449645.315844823, 13710777.987836925],
    ("orbit with e = 0.73", "Sun and Moon"): [-2596728.119003774, 5920127.9528047, 12649738.47237332],
    ("orbit with e = 0.73", "sunlight"): [-2627213.0514524234, 5929257.95079529, 12668007.578742156],
}
LIGHT = RadiationPressure(area_m2=4.0, mass_kg=100.0, coefficient=1.3 * 4.56e-6 / units.SOLAR_PRESSURE_N_M2)
FORCES = {
    "none": Forces(zonal_degree=0),
    "J2": Forces(zonal_degree=2),
    "J2 to J6": Forces(zonal_degree=6),
    "Sun and Moon": Forces(zonal_degree=0, sun=True, moon=True),
    "sunlight": Forces(zonal_degree=0, radiation_pressure=LIGHT),
}


@functools.cache
def fly_a_day(orbit, force):
    """Return the position (xyz) [m] after a day."""
    x = np.array(STARTS[orbit])
    return integrate_orbit(x[:3], x[3:], START, FORCES[force])(DAY)[0, :3]


@pytest.mark.parametrize("orbit", list(STARTS))
@pytest.mark.parametrize("force", ["J2", "J2 to J6", "Sun and Moon", "sunlight"])
def test_what_a_force_does_in_a_day(validation, orbit, force):
    """How far it has moved the body; its own two-body motion taken out, and so the 7.5e-10 by which the two GM differ."""
    ours = [fly_a_day(orbit, name) for name in (force, "none")]
    theirs = np.array(BRAHE[orbit, force]) - BRAHE[orbit, "none"]
    moved = np.linalg.norm(theirs)
    share = {
        # EGM96 and EGM2008 differ by 4.7e-7 of J2, the GM of the forces by 7.5e-10, the poles by 0.2 arcsecond, 1e-6
        "J2": 1e-5,
        "J2 to J6": 1e-5,
        # brahe's Moon is good to some arcminutes and 500 km of 385,000, to the third power
        "Sun and Moon": 5e-3,
        # the edge of the shadow of a low orbit by 0.01 degree of the Sun and 1 m of the Earth
        "sunlight": 1e-2 if orbit == "low orbit" else 5e-4,
    }[force]
    validation(
        case=f"{orbit}: what {force} moves in a day, difference of the two vectors",
        source="brahe 1.8.0, NumericalOrbitPropagator",
        expected=0.0,
        got=np.linalg.norm(ours[0] - ours[1] - theirs),
        tolerance=share * moved,
        unit="m",
    )


@pytest.mark.parametrize("orbit", list(STARTS))
def test_two_body_day_of_another_gm(validation, orbit):
    """brahe's GM is 398600.4415; two-body motion scales: at its GM the same path takes longer by half of the ratio."""
    x = np.array(STARTS[orbit])
    stretch = math.sqrt(398600.4415e9 / GM)  # slower clock, and velocities as that clock sees them
    position, _ = propagate_two_body(x[:3], x[3:] / stretch, DAY * stretch)
    validation(
        case=f"{orbit}: two-body motion for a day, with GM 398600.4415 km3/s2",
        source="brahe 1.8.0, NumericalOrbitPropagator without forces",
        expected=0.0,
        got=np.linalg.norm(position[0] - BRAHE[orbit, "none"]),
        tolerance=1e-2,  # of its integrator: 1e-10 of 1e8 m and more flown
        unit="m",
    )


# brahe 1.8.0, as above, with the shipped coefficients read from their file, to degree and order 20, and one orientation of
# the Earth throughout: UT1 - UTC 0.03 s, pole at 0.2" and 0.4", no offsets of the celestial pole (StaticEOPProvider)
TESSERAL = {
    "low orbit": [5331442.320885702, 71148.91625672365, 4254611.24248655],
    "geostationary orbit": [42157054.99757353, 760106.8173738574, 2504.3839194669004],
    "orbit with e = 0.73": [-4937577.972267258, 6452565.284247276, 13717230.665781872],
}


@pytest.mark.parametrize("orbit", list(STARTS))
def test_day_in_a_gravity_field_of_degree_and_order_twenty(validation, orbit, tmp_path):
    file = tmp_path / "finals"
    file.write_text(finals(range(60_560, 60_580), 0.2, 0.4, 0.03))
    x = np.array(STARTS[orbit])
    forces = Forces(gravity=Gravity(degree=20, order=20, earth_orientation_file=str(file)))
    validation(
        case=f"{orbit}: EGM2008 to degree and order 20 for a day, distance of the two places",
        source="brahe 1.8.0, NumericalOrbitPropagator, with the same coefficients and orientation of the Earth",
        expected=0.0,
        got=np.linalg.norm(integrate_orbit(x[:3], x[3:], START, forces)(DAY)[0, :3] - TESSERAL[orbit]),
        tolerance=1e-2,  # of brahe's integrator, as without forces
        unit="m",
    )


def test_vallados_kepler_problem(validation):
    position, velocity = propagate_two_body(
        np.array([1131.340, -2282.343, 6672.423]) * 1e3,
        np.array([-5.64305, 4.30333, 2.42879]) * 1e3,
        np.array([2400.0]),
    )
    expected = [-4219.7527, 4363.0292, -3958.7666], [3.689866, -1.916735, -6.112511]
    for axis in range(3):
        validation(
            case=f"example 2-4, 40 minutes: position {'xyz'[axis]}",
            source="Vallado 4th ed. example 2-4",
            expected=expected[0][axis],
            got=position[0, axis] / units.KM,
            tolerance=1e-4,
            unit="km",
        )
        validation(
            case=f"example 2-4, 40 minutes: velocity {'xyz'[axis]}",
            source="Vallado 4th ed. example 2-4",
            expected=expected[1][axis],
            got=velocity[0, axis] / units.KM,
            tolerance=1e-6,
            unit="km/s",
        )


def test_vallados_elements(validation):
    """Example 2-5, and 2-6 back; printed to the digits of its state."""
    r, v = np.array([6524.834, 6862.875, 6448.296]), np.array([4.901327, 5.533756, -1.976341])
    found = elements_from_state(r * 1e3, v * 1e3)
    for name, expected, got, tolerance, unit in [
        ("semi-latus rectum", 11067.790, found.semi_latus_rectum_m / units.KM, 0.02, "km"),
        ("semi-major axis", 36127.343, found.semi_major_axis_m / units.KM, 0.02, "km"),
        ("eccentricity", 0.832853, found.eccentricity, 1e-6, "1"),
        ("inclination", 87.870, found.inclination_rad / units.DEG, 0.001, "deg"),
        ("node", 227.898, found.raan_rad / units.DEG, 0.001, "deg"),
        ("argument of perigee", 53.38, found.argument_of_perigee_rad / units.DEG, 0.006, "deg"),
        ("true anomaly", 92.335, found.true_anomaly_rad / units.DEG, 0.001, "deg"),
    ]:
        source = "Vallado 4th ed. example 2-5"
        validation(case=f"elements: {name}", source=source, expected=expected, got=got, tolerance=tolerance, unit=unit)


def test_sun_synchronous_inclination(validation):
    """Landsat 8's orbit of reference: 705 km, 98.2 degrees, 233 revolutions in 16 days on the same track."""
    a = units.EARTH_RADIUS_M + 705e3
    _, _, node = secular_rates(np.array([a, 0.0, 0.0, 0.0, 98.2 * units.DEG, 0.0]))
    validation(
        case="705 km, 98.2 deg: the node turns with the Sun",
        source="360 deg in a tropical year; USGS, Landsat 8: 98.2 deg, 705 km",
        expected=360.0 / 365.2422,
        got=node / units.DEG * units.DAY_S,
        tolerance=0.006,  # half of the last digit of the inclination
        unit="deg/day",
    )
    orbit = {"epoch_utc": START, "semi_major_axis_km": a / 1e3, "eccentricity": 0.001, "inclination_deg": 98.2}
    orbit |= {"raan_deg": 0.0, "argument_of_perigee_deg": 90.0, "mean_anomaly_deg": 0.0}
    epochs = Epochs(START, np.linspace(0.0, units.DAY_S, 100))
    full = Numerical(initial=Kepler(**orbit), forces=FORCES["J2"]).states(epochs).position_m
    off = np.linalg.norm(J2(**orbit, elements="osculating").states(epochs).position_m - full, axis=1).max()
    validation(
        case="705 km, 98.2 deg: mean elements of J2 against an integration for a day, worst distance",
        source="DOP853; J2 squared times the radius is 8 m",
        expected=0.0,
        got=off,
        tolerance=30.0,
        unit="m",
    )


def test_moon_of_meeus(validation):
    longitude, latitude, distance = ecliptic_of_date(np.array([(2448724.5 - 2451545.0) / 36525.0]))
    for name, expected, got, tolerance, unit in [
        ("longitude", 133.162655, longitude[0] / units.DEG % 360.0, 1e-6, "deg"),
        ("latitude", -3.229126, latitude[0] / units.DEG, 1e-6, "deg"),
        ("distance", 368409.7, distance[0] / units.KM, 0.05, "km"),
    ]:
        source = "Meeus, Astronomical Algorithms, example 47.a"
        validation(case=f"Moon: {name}", source=source, expected=expected, got=got, tolerance=tolerance, unit=unit)


@pytest.mark.parametrize(
    ("force", "low_m_s2", "high_m_s2"),
    # Montenbruck & Gill fig. 3.1, read off its logarithmic axis at a geostationary 42,000 km: to half a decade
    [("J2", 5e-6, 2e-5), ("Moon", 3e-6, 2e-5), ("Sun", 1e-6, 1e-5), ("sunlight", 2e-8, 4e-7)],
)
def test_sizes_of_forces_at_geostationary_height(force, low_m_s2, high_m_s2):
    light = RadiationPressure(area_m2=4.0, mass_kg=100.0)
    with_it = {
        "J2": Forces(),
        "Moon": Forces(zonal_degree=0, moon=True),
        "Sun": Forces(zonal_degree=0, sun=True),
        "sunlight": Forces(zonal_degree=0, radiation_pressure=light),
    }[force]
    epochs = Epochs(START, np.linspace(0.0, 28 * units.DAY_S, 60))
    r = np.broadcast_to([42164e3, 0.0, 0.0], (60, 3))
    v = np.zeros((60, 3))
    size = np.linalg.norm(with_it.acceleration(epochs, r, v) - FORCES["none"].acceleration(epochs, r, v), axis=1)
    assert low_m_s2 < size.max() < high_m_s2

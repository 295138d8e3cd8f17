"""Orbits and relative motion against worked examples of textbooks and samples of standards."""

import datetime
import math

import numpy as np
import pytest

from rso_lidar import rpo, units
from rso_lidar.orbit import (
    Catalog,
    Epochs,
    Kepler,
    OsculatingElements,
    eccentric_from_mean,
    elements_from_state,
    find_eclipses,
    mean_from_true,
    moon_position_m,
    propagate_sgp4,
    propagate_two_body,
    solve_lambert,
    state_from_elements,
    true_from_mean,
)
from rso_lidar.orbit.propagation.j2 import secular_rates
from rso_lidar.records import BodyState
from rso_lidar.rpo import clohessy_wiltshire
from rso_lidar.rpo.plans.two_impulse import solve_departure_m_s
from rso_lidar.rpo.relative.reference_orbit import find_relative_state

GM = units.EARTH_GM_M3_S2
CURTIS_GM = 3.986e14  # his, 1.1e-6 less: beyond the five digits that he prints
CURTIS_RADIUS_KM = 6378.0
CURTIS = "Curtis, Orbital Mechanics for Engineering Students"
VALLADO = "Vallado, Fundamentals of Astrodynamics and Applications, 4th ed."
MONTENBRUCK = "Montenbruck & Gill, Satellite Orbits"
DEG = units.DEG


@pytest.fixture
def compare(validation):
    """Return a function that compares the numbers of one example, each with its own tolerance."""

    def each(source, rows):
        for case, expected, got, tolerance, unit in rows:
            validation(case=case, source=source, expected=expected, got=got, tolerance=tolerance, unit=unit)

    return each


def vector(case, expected, got, tolerance, unit):
    """Return one row for each component of a vector."""
    return [(f"{case} {axis}", e, g, tolerance, unit) for axis, e, g in zip("xyz", expected, got, strict=True)]


def of_momentum(h_km2_s, e, *angles_deg):
    """Return the state of an orbit by momentum, eccentricity, inclination, node, perigee and anomaly, as Curtis does."""
    a = (h_km2_s * 1e6) ** 2 / CURTIS_GM / (1.0 - e * e)
    return state_from_elements(OsculatingElements(a, e, *(angle * DEG for angle in angles_deg)))


# ----------------------------------------------------------------------------------------------- elements and Kepler


def test_elements_of_montenbruck_and_gill(compare):
    of = elements_from_state(np.array([10_000e3, 40_000e3, -5_000e3]), np.array([-1500.0, 1000.0, -100.0]))
    compare(
        f"{MONTENBRUCK}, exercise 2.3",
        [
            ("osculating elements: semi-major axis", 25015.181, of.semi_major_axis_m / units.KM, 6e-4, "km"),
            ("osculating elements: eccentricity", 0.7079772, of.eccentricity, 6e-8, "1"),
            ("osculating elements: inclination", 6.971, of.inclination_rad / DEG, 6e-4, "deg"),
            ("osculating elements: node", 173.290, of.raan_rad / DEG, 6e-4, "deg"),
            ("osculating elements: argument of perigee", 91.553, of.argument_of_perigee_rad / DEG, 6e-4, "deg"),
            ("osculating elements: mean anomaly", 144.225, of.mean_anomaly_rad / DEG, 6e-4, "deg"),
        ],
    )


def test_keplers_equation_of_montenbruck_and_gill(compare):
    found = [float(eccentric_from_mean(mean * DEG, 0.72)) for mean in (4.0, 50.0)]
    compare(
        f"{MONTENBRUCK}, exercise 2.2",
        [
            ("Kepler's equation, e = 0.72, M = 4 deg", 0.24318719629, found[0], 2e-10, "rad"),
            ("Kepler's equation, e = 0.72, M = 50 deg", 1.59249513093, found[1], 2e-10, "rad"),
        ],
    )


def test_elements_of_a_retrograde_orbit(compare):
    """To six digits, and his GM, to the power 2 in the axis, is 1.1e-6 less."""
    of = elements_from_state(np.array([-6045e3, -3490e3, 2500e3]), np.array([-3457.0, 6618.0, 2533.0]))
    h_km2_s = math.sqrt(GM * of.semi_latus_rectum_m) / 1e6
    compare(
        f"{CURTIS}, example 4.3",
        [
            ("retrograde orbit: angular momentum", 58311.7, h_km2_s, 0.06, "km2/s"),
            ("retrograde orbit: semi-major axis", 8788.1, of.semi_major_axis_m / units.KM, 0.06, "km"),
            ("retrograde orbit: eccentricity", 0.171212, of.eccentricity, 2e-6, "1"),
            ("retrograde orbit: inclination", 153.249, of.inclination_rad / DEG, 6e-4, "deg"),
            ("retrograde orbit: node", 255.279, of.raan_rad / DEG, 6e-4, "deg"),
            ("retrograde orbit: argument of perigee", 20.0683, of.argument_of_perigee_rad / DEG, 3e-4, "deg"),
            ("retrograde orbit: true anomaly", 28.4456, of.true_anomaly_rad / DEG, 3e-4, "deg"),
        ],
    )


def test_state_of_a_hyperbola(compare):
    position, velocity = of_momentum(80_000.0, 1.4, 30.0, 40.0, 60.0, 30.0)
    compare(
        f"{CURTIS}, example 4.7",
        vector("hyperbola of e = 1.4: position", (-4040.0, 4815.0, 3629.0), position / units.KM, 0.6, "km")
        + vector("hyperbola of e = 1.4: velocity", (-10.39, -4.772, 1.744), velocity / units.KM, 6e-3, "km/s"),
    )


def test_state_of_vallados_elements(compare):
    """Its printed x is 24 m from what its own rounded elements give, as other programs find too."""
    axis = 11067.790e3 / (1.0 - 0.83285**2)
    position, velocity = state_from_elements(
        OsculatingElements(axis, 0.83285, 87.87 * DEG, 227.89 * DEG, 53.38 * DEG, 92.335 * DEG)
    )
    compare(
        f"{VALLADO}, example 2-6",
        vector("example 2-6: position", (6525.344, 6861.535, 6449.125), position / units.KM, 0.05, "km")
        + vector("example 2-6: velocity", (4.902276, 5.533124, -1.975709), velocity / units.KM, 3e-5, "km/s"),
    )


def test_time_along_an_ellipse(compare):
    low, high = 9_600e3, 21_000e3
    e, period_s = (high - low) / (high + low), math.tau * math.sqrt((0.5 * (low + high)) ** 3 / GM)
    time_s = mean_from_true(120 * DEG, e) / math.tau * period_s
    anomaly = true_from_mean(10800.0 / period_s * math.tau, e) / DEG % 360.0
    compare(
        f"{CURTIS}, examples 3.1 and 3.2",
        [
            ("9600 by 21,000 km: period", 18834.0, period_s, 1.0, "s"),
            ("9600 by 21,000 km: time from perigee to 120 deg", 4077.0, time_s, 0.6, "s"),
            ("9600 by 21,000 km: true anomaly after 3 h", 193.2, anomaly, 0.06, "deg"),
        ],
    )


def test_a_parabola_by_barkers_equation(compare):
    perigee = 0.5 * 25512e3
    start, speed = np.array([perigee, 0.0, 0.0]), np.array([0.0, math.sqrt(2.0 * GM / perigee), 0.0])
    (x, y, _), _ = (rows[0] for rows in propagate_two_body(start, speed, np.array([53.7874 * 60.0])))
    tangent = math.tan(0.5 * math.atan2(y, x))
    compare(
        f"{VALLADO}, example 2-2",
        [("parabola of p = 25,512 km after 53.7874 min: tan(nu / 2)", 0.817751, tangent, 2e-6, "1")],
    )


def test_flight_along_a_hyperbola(compare):
    """His times are printed to 1 s, 10 km."""
    at = np.array([4141.0, 4141.0 + 10800.0])
    position, velocity = propagate_two_body(np.array([6678e3, 0.0, 0.0]), np.array([0.0, 15000.0, 0.0]), at)
    distance, anomaly = np.linalg.norm(position, axis=1) / units.KM, np.arctan2(position[:, 1], position[:, 0]) / DEG
    compare(
        f"{CURTIS}, example 3.5",
        [
            ("15 km/s from 300 km: distance at 100 deg, 4141 s", 48497.0, distance[0], 10.0, "km"),
            ("15 km/s from 300 km: true anomaly after 4141 s", 100.0, anomaly[0], 0.01, "deg"),
            ("15 km/s from 300 km: true anomaly 3 h later", 107.78, anomaly[1], 0.006, "deg"),
            ("15 km/s from 300 km: distance 3 h later", 163180.0, distance[1], 15.0, "km"),
            ("15 km/s from 300 km: speed 3 h later", 10.51, np.linalg.norm(velocity[1]) / units.KM, 6e-3, "km/s"),
        ],
    )


def test_secular_rates(compare):
    """His rates are of first order in J2; ours go on to the second, up to 1.5e-3 of them. Heights to 0.01 km or 1 km."""
    of_year = 360.0 / 365.2422
    e = 60.0 / (CURTIS_RADIUS_KM + 340.0)
    shuttle = secular_rates(np.array([(CURTIS_RADIUS_KM + 340.0) * 1e3, 0.0, e, 0.0, 51.43 * DEG, 0.0]))
    circle = secular_rates(np.array([(CURTIS_RADIUS_KM + 758.63) * 1e3, 0.0, 0.0, 0.0, 98.43 * DEG, 0.0]))
    frozen = secular_rates(np.array([10560e3, 0.0, 0.3466, 0.0, 116.565 * DEG, 0.0]))
    a_day = units.DAY_S / DEG
    compare(
        f"{CURTIS}, ch. 4: effects of the Earth's oblateness",
        [
            ("280 by 400 km, 51.43 deg: turn of the node", -1.0465e-6, shuttle[2], 1.6e-9, "rad/s"),
            ("280 by 400 km, 51.43 deg: turn of the perigee", 7.9193e-7, shuttle[1], 1.2e-9, "rad/s"),
            ("758.63 km and 98.43 deg: turn of the node", of_year, circle[2] * a_day, 0.001, "deg/day"),
            ("10,560 km, e = 0.3466, 116.57 deg: turn of the node", of_year, frozen[2] * a_day, 0.001, "deg/day"),
            ("10,560 km, e = 0.3466, 116.57 deg: turn of the perigee", 0.0, frozen[1] * a_day, 2e-4, "deg/day"),
        ],
    )


# ------------------------------------------------------------------------------------------------------------ Lambert


def test_a_hohmann_transfer_is_a_lambert_orbit_of_half_a_turn(compare):
    """Half a turn exactly, which spans no plane: it is asked for by its normal."""
    low, high = units.EARTH_RADIUS_M + 191.34411e3, units.EARTH_RADIUS_M + 35781.34857e3
    start, end = np.array([low, 0.0, 0.0]), np.array([-high, 0.0, 0.0])
    orbit = solve_lambert(start, end, 315.403 * 60.0, normal=(0.0, 0.0, 1.0))
    first = np.linalg.norm(orbit.departure_m_s - (0.0, math.sqrt(GM / low), 0.0)) / units.KM
    second = np.linalg.norm(orbit.arrival_m_s - (0.0, -math.sqrt(GM / high), 0.0)) / units.KM
    compare(
        f"{VALLADO}, example 6-1",
        [
            ("Hohmann transfer to a geostationary orbit: first boost", 2.457038, first, 2e-6, "km/s"),
            ("Hohmann transfer to a geostationary orbit: second boost", 1.478187, second, 2e-6, "km/s"),
            ("Hohmann transfer to a geostationary orbit: both", 3.935224, first + second, 2e-6, "km/s"),
        ],
    )


def test_a_meteoroid_seen_twice(compare):
    """A hyperbola of e = 1.05, from 267,000 km to 140,000 km in 13.5 hours and 5 degrees."""
    start = np.array([(CURTIS_RADIUS_KM + 267e3) * 1e3, 0.0, 0.0])
    end = (CURTIS_RADIUS_KM + 140e3) * 1e3 * np.array([math.cos(5 * DEG), math.sin(5 * DEG), 0.0])
    orbit = solve_lambert(start, end, 13.5 * 3600.0, gm_m3_s2=CURTIS_GM)
    of = elements_from_state(start, orbit.departure_m_s)
    compare(
        f"{CURTIS}, example 5.3",
        [
            ("meteoroid: speed down", -2.4356, orbit.departure_m_s[0] / units.KM, 6e-5, "km/s"),
            ("meteoroid: speed across", 0.26741, orbit.departure_m_s[1] / units.KM, 6e-6, "km/s"),
            ("meteoroid: eccentricity", 1.0506, of.eccentricity, 6e-5, "1"),
        ],
    )


# ----------------------------------------------------------------------------------------------------- relative motion


def test_relative_velocity_in_turning_axes(compare):
    chief = of_momentum(52059.0, 0.025724, 60.0, 40.0, 30.0, 40.0)
    other = of_momentum(52362.0, 0.0072696, 50.0, 40.0, 120.0, 40.0)
    apart = find_relative_state(*(BodyState(r[None], v[None]) for r, v in (chief, other)))
    compare(
        f"{CURTIS}, example 7.1",
        vector("two orbits: relative position", (-6701.2, 6828.3, -406.26), apart[0][0] / units.KM, 0.06, "km")
        + vector("two orbits: relative velocity", (0.31667, 0.11199, 1.2470), apart[1][0] / units.KM, 6e-5, "km/s"),
    )


def test_clohessy_wiltshire_of_a_release(compare):
    """The Hubble telescope's: in rtn axes; to the digits of Vallado's own program, whose GM and radius differ by 1e-7."""
    n = math.sqrt(GM / (units.EARTH_RADIUS_M + 590e3) ** 3)
    position, velocity = clohessy_wiltshire((0.0, 0.0, 0.0), (-0.1, -0.04, -0.02), 300.0, n)
    compare(
        f"{VALLADO}, example 6-14",
        vector("released at 0.1 m/s, after 5 min: position", (-33.345724, -1.473560, -5.894530), position, 5e-6, "m")
        + vector(
            "released at 0.1 m/s, after 5 min: velocity", (-0.1203371, 0.0323876, -0.0189490), velocity, 1e-7, "m/s"
        ),
    )
    place, _ = clohessy_wiltshire((0.0, 0.0, 0.0), (-0.1, -0.04, -0.02), 600.0, n)
    back = solve_departure_m_s(np.array([-70.933, 20.357, -11.17]), np.zeros(3), 300.0, n)
    compare(
        f"{VALLADO}, example 6-15",
        vector("released at 0.1 m/s, after 10 min: position", (-70.933, 20.357, -11.170), place, 6e-4, "m")
        + vector("fetched again in 5 min: departure", (0.2741908, 0.0134667, 0.0359080), back, 1e-7, "m/s"),
    )


def test_clohessy_wiltshire_matrices(compare):
    """Of a revolution less a little: the terms with n t are as printed, the others nearly nothing."""
    n, time_s = 0.0011569, 1.49 * 3600.0
    moved = [clohessy_wiltshire(unit[:3], unit[3:], time_s, n) for unit in np.eye(6)]
    rr, vr = (np.stack([moved[k][which] for k in range(3)], axis=1) for which in (0, 1))
    rv, vv = (np.stack([moved[k][which] for k in range(3, 6)], axis=1) for which in (0, 1))
    compare(
        f"{CURTIS}, example 7.5",
        [
            ("rr of 1.49 h: x by x", 1.0090, rr[0, 0], 6e-5, "1"),
            ("rr of 1.49 h: y by x", -37.699, rr[1, 0], 6e-4, "1"),
            ("rr of 1.49 h: z by z", 0.99699, rr[2, 2], 6e-6, "1"),
            ("rv of 1.49 h: x by x", -66.986, rv[0, 0], 6e-4, "s"),
            ("rv of 1.49 h: x by y", 5.1989, rv[0, 1], 6e-5, "s"),
            ("rv of 1.49 h: y by x", -5.1989, rv[1, 0], 6e-5, "s"),
            ("rv of 1.49 h: y by y", -16360.0, rv[1, 1], 0.6, "s"),
            ("vr of 1.49 h: x by x", -2.6897e-4, vr[0, 0], 6e-9, "1/s"),
            ("vr of 1.49 h: y by x", -2.0875e-5, vr[1, 0], 6e-10, "1/s"),
            ("vr of 1.49 h: z by z", 8.9655e-5, vr[2, 2], 6e-10, "1/s"),
            ("vv of 1.49 h: x by y", -0.15499, vv[0, 1], 6e-6, "1"),
            ("vv of 1.49 h: y by y", 0.98798, vv[1, 1], 2e-5, "1"),
        ],
    )


def test_rendezvous_in_eight_hours(compare):
    """Its orbits are printed to 0.01 km and 0.001 deg, 0.1 km of 20 across and along: some 0.1 m/s in 100."""

    def orbit(low_km, high_km, *angles_deg):
        low, high = (CURTIS_RADIUS_KM + low_km) * 1e3, (CURTIS_RADIUS_KM + high_km) * 1e3
        angles = [angle * DEG for angle in angles_deg]
        return [
            row[None]
            for row in state_from_elements(OsculatingElements(0.5 * (low + high), (high - low) / (high + low), *angles))
        ]

    station = orbit(300.0, 300.0, 40.0, 20.0, 0.0, 60.0)
    other = orbit(320.06, 513.86, 40.130, 19.819, 70.662, 349.65)
    position, velocity = (rows[0] for rows in find_relative_state(BodyState(*station), BodyState(*other)))
    n = math.sqrt(CURTIS_GM / ((CURTIS_RADIUS_KM + 300.0) * 1e3) ** 3)
    plan = rpo.Rendezvous(
        relative_to="station",
        position_m=tuple(position.tolist()),
        velocity_m_s=tuple(velocity.tolist()),
        duration_s=8 * 3600.0,
    ).make_plan(n)
    compare(
        f"{CURTIS}, example 7.4",
        [("rendezvous in 8 h from 36 km: both boosts", 111.24, plan.delta_v_m_s, 0.1, "m/s")],
    )


# --------------------------------------------------------------------------------------------------------- environment


def test_moon_of_montenbruck_and_gill(compare):
    """Their analytic series is good to some arc minutes and about 500 km (section 3.3.2)."""
    start = datetime.datetime(2006, 3, 13, 23, 58, 54, 816_000, tzinfo=datetime.UTC)  # 2006-03-14 00:00 TT
    printed_km = [
        (-387105.185, 106264.577, 61207.474),
        (-403080.629, 33917.735, 21704.832),
        (-401102.631, -39906.188, -18757.478),
        (-381055.373, -111853.486, -58337.911),
        (-343564.315, -178551.672, -95178.733),
    ]
    got_km = moon_position_m(Epochs(start, np.arange(5) * units.DAY_S)) / units.KM
    off = np.linalg.norm(got_km - np.array(printed_km), axis=1)
    compare(
        f"{MONTENBRUCK}, exercise 3.2",
        [("Moon on five days from 14 March 2006: worst distance", 0.0, off.max(), 500.0, "km")],
    )


def test_moon_of_vallado(compare):
    """His series is good to 0.3 deg in longitude, and his axes are of date, 0.08 deg from those of J2000."""
    at = Epochs(datetime.datetime(1994, 4, 28, tzinfo=datetime.UTC), np.zeros(1))
    here = moon_position_m(at)[0] / units.KM
    printed = np.array([-134240.626, -311571.590, -126693.785])
    angle = math.acos(here @ printed / np.linalg.norm(here) / np.linalg.norm(printed)) / DEG
    compare(
        f"{VALLADO}, example 5-3",
        [
            ("Moon on 28 April 1994: off his direction", 0.0, angle, 0.38, "deg"),
            ("Moon on 28 April 1994: distance", np.linalg.norm(printed), np.linalg.norm(here), 1300.0, "km"),
        ],
    )  # 0.003 deg of 0.95 deg of parallax


def test_the_longest_eclipse_of_a_navigation_satellite(compare):
    """In the equator, where the Sun stands at the equinox: the mean of umbra and penumbra, as of a cylinder."""
    start = datetime.datetime(2024, 3, 20, 3, 6, tzinfo=datetime.UTC)
    orbit = Kepler(
        epoch_utc=start,
        semi_major_axis_km=26560.0,
        eccentricity=0.0,
        inclination_deg=0.0,
        raan_deg=0.0,
        argument_of_perigee_deg=0.0,
        true_anomaly_deg=90.0,
    )
    (dark,) = find_eclipses(orbit, Epochs(start, np.arange(0.0, 30_000.0, 60.0)))
    umbra, whole = dark.umbra_to_s - dark.umbra_from_s, dark.penumbra_to_s - dark.penumbra_from_s
    compare(
        "textbook figure, to a minute",
        [("GPS orbit, beta 0: longest eclipse", 55.0, 0.5 * (umbra + whole) / 60.0, 1.0, "min")],
    )


# ------------------------------------------------------------------------------------------------------------ messages

GOES_9 = """CCSDS_OMM_VERS = 2.0
CREATION_DATE = 2007-065T16:00:00
ORIGINATOR = NOAA/USA
OBJECT_NAME = GOES 9
OBJECT_ID = 1995-025A
CENTER_NAME = EARTH
REF_FRAME = TEME
TIME_SYSTEM = UTC
MEAN_ELEMENT_THEORY = SGP/SGP4
EPOCH = 2007-064T10:34:41.4264
MEAN_MOTION = 1.00273272
ECCENTRICITY = 0.0005013
INCLINATION = 3.0539
RA_OF_ASC_NODE = 81.7939
ARG_OF_PERICENTER = 249.2363
MEAN_ANOMALY = 150.1602
GM = 398600.8
EPHEMERIS_TYPE = 0
CLASSIFICATION_TYPE = U
NORAD_CAT_ID = 23581
ELEMENT_SET_NO = 0925
REV_AT_EPOCH = 4316
BSTAR = 0.0001
MEAN_MOTION_DOT = -0.00000113
MEAN_MOTION_DDOT = 0.0
"""
GOES_9_LINES = """GOES 9 [P]
1 23581U 95025A   07064.44075725 -.00000113  00000-0  10000-3 0  9250
2 23581   3.0539  81.7939 0005013 249.2363 150.1602  1.00273272 43169
"""


def test_the_sample_of_a_mean_elements_message_is_that_of_its_lines(compare):
    """The standard gives the message, and these are its numbers as lines: 0.44075725 of a day is 10:34:41.4264."""
    (message,), (lines,) = Catalog.from_text(GOES_9), Catalog.from_text(GOES_9_LINES)
    assert message.norad_id == lines.norad_id == 23581
    at = Epochs(datetime.datetime(2007, 3, 6, tzinfo=datetime.UTC), np.arange(0.0, 86_400.0, 3_600.0))
    apart = np.linalg.norm(propagate_sgp4(message, at).position_m - propagate_sgp4(lines, at).position_m, axis=1)
    compare(
        "CCSDS 502.0-B, sample OMM of GOES 9, and its two lines",
        [("OMM and two lines of one object, a day: worst distance", 0.0, apart.max(), 1e-3, "m")],
    )

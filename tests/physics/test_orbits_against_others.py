"""Orbits, time and the Sun against the outside world: Vallado, skyfield, a numerical integrator, almanac, two bodies."""

import datetime
import math
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import rso_lidar as rl
from rso_lidar import motion, units
from rso_lidar.orbit import Epochs, Kepler, Tle, gcrs_from_teme, propagate_two_body
from rso_lidar.orbit.sets.formats import parse_lines
from rso_lidar.orbit.sets.teme import propagate_in_teme
from rso_lidar.orbit.sky.sun import sun_position_m
from rso_lidar.rpo import Hill, clohessy_wiltshire, rtn_axes

GM = units.EARTH_GM_M3_S2
ACTIVE = "tle/catalogs/celestrak_active_2026-05-07.tle"
UTC = datetime.UTC
EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
LONG = np.longdouble


def worst(expected, got):
    """Return the pair of numbers that differ most, as the row of the page wants them."""
    expected, got = np.broadcast_arrays(expected, got)
    k = np.argmax(np.abs(got - expected))  # the first NaN, where there is one
    return {"expected": expected.flat[k], "got": got.flat[k]}


# ------------------------------------------------------------------------------------ SGP4, by Vallado's own program


@pytest.fixture(scope="module")
def verification(shared):
    """Return Vallado's element sets by place in the file: the set, and its start, stop and step [min]."""
    folder = shared / "tle" / "sgp4_verification"
    lines = [line for line in (folder / "SGP4-VER.TLE").read_text().splitlines() if line[:2] in ("1 ", "2 ")]
    # the last columns of his line 2, past the 69 of an element line, are the times to print
    sets = parse_lines([line[:69] for line in lines], "SGP4-VER.TLE")
    spans = [tuple(float(field) for field in line[69:].split()) for line in lines[1::2]]
    return list(zip(sets, spans, strict=True))


@pytest.fixture(scope="module")
def printed(shared):
    """Return the rows of tcppver.out, Vallado's C++ program, for each satellite: minutes, position [km], velocity [km/s]."""
    blocks = []
    for line in (shared / "tle" / "sgp4_verification" / "tcppver.out").read_text().splitlines():
        if line.endswith("xx"):
            blocks.append((int(line.split()[0]), []))
        else:
            blocks[-1][1].append([float(field) for field in line.split()[:7]])
    return [(number, np.array(rows)) for number, rows in blocks]


def test_vallados_verification_set(validation, verification, printed):
    assert len(verification) == len(printed) == 33
    off_m, off_m_s = [], []
    for (elements, _), (number, rows) in zip(verification, printed, strict=True):
        assert elements.norad_id == number
        if len(rows) == 1:
            continue  # his program prints the previous satellite's state where the first epoch fails: see below
        position_m, velocity_m_s, error = propagate_in_teme(elements, Epochs(elements.epoch_utc, rows[:, 0] * 60.0))
        np.testing.assert_array_equal(error, 0)
        np.testing.assert_allclose(position_m / 1e3, rows[:, 1:4], rtol=0, atol=2e-7, err_msg=str(number))
        np.testing.assert_allclose(velocity_m_s / 1e3, rows[:, 4:7], rtol=0, atol=2e-9, err_msg=str(number))
        off_m.append(position_m - rows[:, 1:4] * 1e3)
        off_m_s.append(velocity_m_s - rows[:, 4:7] * 1e3)
    compared = sum(map(len, off_m))
    assert compared > 600
    # printed to 1e-8 km and 1e-9 km/s; the allowance for other compilers is the sgp4 package's own, 0.2 mm
    for what, off, tolerance, unit in [("position", off_m, 0.2, "mm"), ("velocity", off_m_s, 2e-3, "mm/s")]:
        validation(
            case=f"SGP4, {len(off)} element sets, {compared} states: {what}, worst coordinate",
            source="Vallado et al., AIAA 2006-6753, tcppver.out",
            expected=0.0,
            got=np.abs(np.concatenate(off)).max() * 1e3,
            tolerance=tolerance,
            unit=unit,
        )


def test_vallados_error_cases(validation, verification, printed):
    """Where his printout breaks off, the next epoch of the satellite's span must carry SGP4's error."""
    errors = {}
    for (elements, (start, stop, step)), (number, rows) in zip(verification, printed, strict=True):
        minutes = np.append(np.arange(start, stop, step), stop)
        after = minutes[minutes > rows[-1, 0]] if len(rows) > 1 else minutes
        if not len(after):
            continue
        _, _, error = propagate_in_teme(elements, Epochs(elements.epoch_utc, after[:1] * 60.0))
        errors[number] = int(error[0])
    # the list of the sgp4 package's tests, in the order of the file: 1, 1, 6, 6, 4, 3, 6
    his = {22312: 1, 28350: 1, 28872: 6, 29141: 6, 33333: 4, 33334: 3, 20413: 6}
    assert errors == his
    validation(
        case="SGP4, element sets that decay or break down: refused with his error, where he stops",
        source="Vallado et al., AIAA 2006-6753; sgp4 package",
        expected=len(his),
        got=sum(errors.get(number) == error for number, error in his.items()),
        tolerance=0,
        unit="sets",
    )


def test_three_of_vallados_sets_were_altered_and_their_checksums_tell(verification):
    altered = [elements.norad_id for elements, _ in verification if elements.problem]
    assert altered == [33333, 33334, 33335]
    for elements, _ in verification:
        if elements.problem:
            assert "wrong checksum" in elements.problem


# ----------------------------------------------------------------------------------------------- TEME to GCRS, by skyfield


def skyfield_state(elements, epochs):
    from skyfield.api import EarthSatellite

    time = epochs.skyfield_time()
    at = EarthSatellite(elements.line1, elements.line2, ts=time.ts).at(time)
    return at.position.m.T, at.velocity.m_per_s.T


@pytest.mark.parametrize("name", ["TDRS 3", "TDRS 13", "ISS (ZARYA)", "CALSPHERE 1", "MERIDIAN 8"])
def test_states_are_skyfields(validation, shared, name):
    part = Tle(file=str(shared / ACTIVE), name=name)
    epochs = Epochs(datetime.datetime(2026, 5, 6, 1, 2, 3, 456789, tzinfo=datetime.UTC), np.linspace(0.0, 86400.0, 301))
    state = part.states(epochs)
    position_m, velocity_m_s = skyfield_state(part.elements(epochs.start_utc), epochs)
    # the limit the project set is 1 mm; interpolation and skyfield's own rounding (1e-13 rad) leave microns
    validation(
        case=f"TLE of {name} for a day: position in GCRS, worst coordinate",
        source="skyfield",
        expected=0.0,
        got=np.abs(state.position_m - position_m).max() * 1e3,
        tolerance=0.01,
        unit="mm",
    )
    assert np.abs(state.velocity_m_s - velocity_m_s).max() < 1e-8


def test_relative_position_of_a_formation_is_skyfields(validation, shared):
    path = str(shared / "tle/pairs/terrasarx_tandemx_2026.tle")
    epochs = Epochs(datetime.datetime(2026, 4, 1, 6, tzinfo=datetime.UTC), np.linspace(0.0, 6000.0, 121))
    parts = [Tle(file=path, name=name) for name in ("TERRASAR-X", "TANDEM-X")]
    ours = parts[1].states(epochs).position_m - parts[0].states(epochs).position_m
    theirs = [skyfield_state(part.elements(epochs.start_utc), epochs)[0] for part in parts]
    validation(
        case="TerraSAR-X and TanDEM-X, 20 m to 6.4 km apart: relative position, worst coordinate",
        source="skyfield (the project's limit is 1 mm)",
        expected=0.0,
        got=np.abs(ours - (theirs[1] - theirs[0])).max() * 1e3,
        tolerance=0.01,
        unit="mm",
    )
    separation = np.linalg.norm(ours, axis=1)
    assert separation.min() > 20.0  # the pair flies 20 m to 6.4 km apart by its element sets
    assert separation.max() < 6.5e3


@pytest.mark.parametrize("year", [1980, 2000, 2026, 2045])
def test_rotation_is_skyfields(validation, year):
    from skyfield.sgp4lib import TEME

    epochs = Epochs(datetime.datetime(year, 2, 3, tzinfo=datetime.UTC), np.linspace(0.0, 40 * 86400.0, 1500))
    theirs = TEME.rotation_at(epochs.skyfield_time()).transpose(2, 1, 0)
    ours = gcrs_from_teme(epochs)
    # the pole: the fortnightly nutation, 0.23", through hourly nodes by a cubic leaves 4e-15
    assert np.abs(ours[:, :, 2] - theirs[:, :, 2]).max() < 1e-14
    # about the pole skyfield rounds more: it counts 4e6 s of GMST82 in one float64, which steps by 4.7e-10 s = 3.4e-14
    # rad, several times over, on either side
    validation(
        case=f"TEME to GCRS over 40 days of {year}: worst element of the matrix",
        source="skyfield",
        expected=0.0,
        got=np.abs(ours - theirs).max(),
        tolerance=8 * 3.4e-14,
        unit="rad",
    )


# ------------------------------------------------------------------------------------------- two bodies, by integration


@pytest.mark.parametrize(("e", "incoming_rad"), [(0.0, 0.0), (0.3, -1.0), (0.9, 3.0), (1.0, -1.8), (1.6, -1.5)])
def test_two_body_motion_against_an_integrator(validation, e, incoming_rad):
    perigee = 7e6
    p = perigee * (1 + e)
    c, s = math.cos(incoming_rad), math.sin(incoming_rad)
    r0 = p / (1 + e * c) * np.array([c, 0.6 * s, 0.8 * s])
    v0 = math.sqrt(GM / p) * np.array([-s, 0.6 * (e + c), 0.8 * (e + c)])
    times = np.linspace(0.0, 20000.0, 41)

    def pull(_, state):
        return np.concatenate([state[3:], -GM * state[:3] / np.linalg.norm(state[:3]) ** 3])

    scale = np.concatenate([np.full(3, 1e-6), np.full(3, 1e-9)])
    flown = solve_ivp(pull, (0.0, times[-1]), np.concatenate([r0, v0]), "DOP853", times, rtol=3e-14, atol=scale)
    position, velocity = propagate_two_body(r0, v0, times)
    # DOP853 at rtol 3e-14 keeps about 1e-11 over this span: some 1000 steps, each rounded, growing along the track
    size = np.linalg.norm(position, axis=1).max()
    validation(
        case=f"two-body orbit of eccentricity {e:g} for 20,000 s: worst coordinate",
        source="numerical integration, DOP853",
        expected=0.0,
        got=np.abs(position - flown.y[:3].T).max() * 1e3,
        tolerance=1e-10 * size * 1e3,
        unit="mm",
    )
    assert np.abs(velocity - flown.y[3:].T).max() < 1e-10 * math.sqrt(2 * GM / perigee)


@pytest.mark.parametrize(
    ("book", "flight", "before_km", "before_km_s", "time_s", "after_km", "after_km_s", "printed_m", "printed_m_s"),
    [
        (  # 4th ed.; printed to 0.1 m and 1 mm/s, input to 1 m and 1 cm/s
            "Vallado, example 2-4",
            "low orbit for 40 minutes",
            (1131.340, -2282.343, 6672.423),
            (-5.64305, 4.30333, 2.42879),
            2400.0,
            (-4219.7527, 4363.0292, -3958.7666),
            (3.689866, -1.916735, -6.112511),
            0.1,
            1e-3,
        ),
        (  # Orbital Mechanics for Engineering Students; printed to five digits
            "Curtis, example 3.7",
            "ellipse for an hour",
            (7000.0, -12124.0, 0.0),
            (2.6679, 4.6210, 0.0),
            3600.0,
            (-3297.8, 7413.4, 0.0),
            (-8.2976, -0.96404, 0.0),
            0.05e3,
            0.05,
        ),
    ],
)
def test_two_body_motion_of_the_textbooks(
    validation, book, flight, before_km, before_km_s, time_s, after_km, after_km_s, printed_m, printed_m_s
):
    position, velocity = propagate_two_body(np.array(before_km) * 1e3, np.array(before_km_s) * 1e3, np.array([time_s]))
    for what, expected, got, tolerance, unit in [
        ("position", after_km, position, printed_m, "m"),
        ("velocity", after_km_s, velocity, printed_m_s, "m/s"),
    ]:
        validation(
            case=f"two-body {flight}: {what}, worst coordinate",
            source=book,
            **worst(np.array(expected) * 1e3, got[0]),
            tolerance=tolerance,
            unit=unit,
        )


# ----------------------------------------------------------------------------------------- relative motion, by two bodies


def two_body_difference(chief_r, chief_v, rho, rho_dot, times):
    """Return the true relative position [m] in rtn axes of two Kepler orbits."""
    rotation, rate = rtn_axes(chief_r, chief_v)
    follower_r = chief_r + rotation.apply(rho)
    follower_v = chief_v + rotation.apply(rho_dot + np.cross(rate, rho))
    chief, _ = propagate_two_body(chief_r, chief_v, times)
    axes, _ = rtn_axes(*propagate_two_body(chief_r, chief_v, times))
    return axes.inv().apply(propagate_two_body(follower_r, follower_v, times)[0] - chief)


def test_clohessy_wiltshire_error_is_the_second_order_term(validation):
    """The neglected gravity gradient is 3/2 n^2 rho^2 / r: ten times the separation, a hundred times the error."""
    radius = 42164e3
    n = math.sqrt(GM / radius**3)
    chief = np.array([radius, 0, 0]), np.array([0, n * radius, 0])
    times = np.linspace(0.0, 10800.0, 61)
    errors = []
    for rho in (300.0, 3000.0, 30000.0):
        start, velocity = np.array([0.2, -1.0, 0.1]) * rho, np.array([0.1, -0.3, 0.2]) * n * rho
        truth = two_body_difference(*chief, start, velocity, times)
        errors.append(np.linalg.norm(clohessy_wiltshire(start, velocity, times, n)[0] - truth, axis=1).max())
        # the error of an acceleration of up to 3 n^2 rho^2 / r (radial and cross terms together) over nt = 0.8 rad
        validation(
            case=f"Clohessy-Wiltshire in GEO for 3 h, {rho / 1e3:g} km away: greatest error",
            source="difference of two Kepler orbits; tolerance: the neglected second order",
            expected=0.0,
            got=errors[-1],
            tolerance=3 * (n * times[-1]) ** 2 * rho**2 / radius,
            unit="m",
        )
    # the third-order term spoils the ratio by about rho / r = 7e-4, rounding (1e-8 m of 2 mm) by less
    for far_km, ratio in zip((3, 30), np.array(errors[1:]) / np.array(errors[:-1]), strict=True):
        validation(
            case=f"Clohessy-Wiltshire in GEO: growth of its error from {far_km / 10:g} to {far_km} km",
            source="the neglected term is of second order",
            expected=100.0,
            got=ratio,
            tolerance=0.5,
            unit="1",
        )


def test_seed_hop_of_3_km_stays_within_its_own_second_order_error(validation):
    """The hop of the design page: 3 km behind TDRS to 300 m behind in 45 minutes."""
    radius = 42164e3
    n = math.sqrt(GM / radius**3)
    times = np.array([2700.0])
    start, velocity = np.array([0.0, -3000.0, 0.0]), np.array([-0.19500, 0.98719, 0.0])
    position, _ = clohessy_wiltshire(start, velocity, times, n)
    # velocities given to 5e-6 m/s (and n of a real TDRS to 1e-4) leave 15 mm at the end
    np.testing.assert_allclose(position[0], [0.0, -300.0, 0.0], rtol=0, atol=0.1)
    truth = two_body_difference(np.array([radius, 0, 0]), np.array([0, n * radius, 0]), start, velocity, times)
    validation(
        case="hop in GEO from 3 km to 300 m in 45 minutes: where Clohessy-Wiltshire ends, off by",
        source="difference of two Kepler orbits; tolerance: the neglected second order",
        expected=0.0,
        got=np.linalg.norm(truth - position),
        tolerance=3 * (n * 2700.0) ** 2 * 3000.0**2 / radius,
        unit="m",
    )


def mean_motion(position_m, velocity_m_s):
    """Return the mean motion [rad/s] of the osculating orbit (vis-viva, Kepler's third law)."""
    a = 1.0 / (2.0 / np.linalg.norm(position_m) - velocity_m_s @ velocity_m_s / GM)
    return math.sqrt(GM / a**3)


def test_tdrs_approach_arrives_300_m_behind(validation):
    """Its two velocities are printed to 5e-6 m/s, for a circle of 42164 km; the real TDRS has a mean motion of its own."""
    scenario = rl.Scenario.load(EXAMPLES / "tdrs_approach.toml")
    duration_s = scenario.time.duration_s
    course = motion.truth(scenario.bodies, Epochs(scenario.time.start_utc, np.array([0.0, duration_s])))
    end = course.pose("tdrs.rtn", "follower").translation[1]
    chief = course.states["tdrs"]
    n0, n = math.sqrt(GM / 42164e3**3), mean_motion(chief.position_m[0], chief.velocity_m_s[0])

    def per_speed_s(n):
        """Return how far x and y end by a departure velocity along x and y (Vallado 4th ed. alg. 48)."""
        s, k = math.sin(n * duration_s) / n, 2 * (1 - math.cos(n * duration_s)) / n
        return np.array([[s, k], [-k, 4 * s - 3 * duration_s]])

    rounding_m = 5e-6 * np.abs(per_speed_s(n)).sum(axis=1)
    own_orbit_m = np.abs((per_speed_s(n) - per_speed_s(n0)) @ [-0.19500, 0.98719])
    for axis, name, expected in [(0, "above", 0.0), (1, "ahead of", -300.0)]:
        validation(
            case=f"examples/tdrs_approach.toml: metres {name} TDRS at the end of the hop",
            source="300 m behind; tolerance: printed digits of the velocity, and TDRS's own mean motion",
            expected=expected,
            got=end[axis],
            tolerance=rounding_m[axis] + own_orbit_m[axis],
            unit="m",
        )


def test_a_follower_metres_away_is_placed_to_a_tenth_of_a_micrometre(validation):
    """And better: inertial coordinates, 7 nm coarse at GEO, are left out of relative positions."""
    start_utc = datetime.datetime(2024, 9, 17, 12, tzinfo=UTC)
    rho, rate = np.array([2.0, -5.0, 1.0]), np.array([1e-4, -2.9e-4, 2e-4])
    hill = Hill(relative_to="tdrs", position_m=tuple(rho.tolist()), velocity_m_s=tuple(rate.tolist()))
    bodies = [
        motion.Body(name="tdrs", motion=Tle(file="tle/tdrs.tle"), attitude=motion.Spin(axis=(0, 0, 1), rate_deg_s=0.5)),
        motion.Body(name="follower", motion=hill, attitude=motion.LookAt(at="tdrs")),
    ]
    times = np.linspace(0.0, 6 * 3600.0, 181)
    course = motion.truth(bodies, Epochs(start_utc, times))
    chief = course.states["tdrs"]
    n = LONG(mean_motion(chief.position_m[0], chief.velocity_m_s[0]))
    # Vallado 4th ed. alg. 48, in 80-bit floats
    (x, y, z), (u, v, w), nt = rho.astype(LONG), rate.astype(LONG), n * times.astype(LONG)
    s, c = np.sin(nt), np.cos(nt)
    expected = np.stack(
        [
            u / n * s - (3 * x + 2 * v / n) * c + 4 * x + 2 * v / n,
            (6 * x + 4 * v / n) * s + 2 * u / n * c - (6 * x * nt + 3 * v * times) + y - 2 * u / n,
            z * c + w / n * s,
        ],
        axis=-1,
    )
    distance = np.sqrt(np.einsum("ti,ti->t", expected, expected))
    assert distance.min() < 6.0
    for what, right, got in [
        ("worst coordinate", expected, course.pose("tdrs.rtn", "follower").translation),
        # through both attitudes: the follower turned to TDRS sees it straight ahead
        ("distance straight ahead", distance, course.pose("follower", "tdrs").translation[:, 0]),
    ]:
        assert np.abs(got - right).max() < 1e-12  # some hundreds of roundings of 11 m, 2e-15 each
        validation(
            case=f"follower metres from TDRS (a TLE) for 6 h: {what}",
            source="Clohessy-Wiltshire in 80-bit floats",
            **worst(right, got),
            tolerance=1e-7,
            unit="m",
        )


# --------------------------------------------------------------------------------------------------- time and the Sun


@pytest.mark.parametrize(
    ("name", "instant", "longitude_deg"),
    [
        ("March equinox of 2024", (2024, 3, 20, 3, 6), 0.0),
        ("June solstice of 2024", (2024, 6, 20, 20, 51), 90.0),
        ("September equinox of 2024", (2024, 9, 22, 12, 44), 180.0),
        ("December solstice of 2025", (2025, 12, 21, 15, 3), 270.0),
    ],
)
def test_seasons_begin_when_the_almanac_says(validation, name, instant, longitude_deg):
    epochs = Epochs(datetime.datetime(*instant, tzinfo=UTC), np.zeros(1))
    time = epochs.skyfield_time()
    toward_m = sun_position_m(epochs)
    x, y, z = np.einsum("ijt,tj->ti", time.M, toward_m / np.linalg.norm(toward_m, axis=1, keepdims=True))[
        0
    ]  # true equator and equinox of date
    obliquity = (time._mean_obliquity_radians + time._nutation_angles_radians[1])[0]
    longitude = math.atan2(y * math.cos(obliquity) + z * math.sin(obliquity), x) / units.DEG
    validation(
        case=f"Sun's apparent longitude at the {name}",
        source="US Naval Observatory, Earth's Seasons",
        expected=longitude_deg,
        got=longitude_deg + math.remainder(longitude - longitude_deg, 360.0),
        # the formula against ERFA's epv00, 2000 to 2050, and half of the printed minute
        tolerance=0.0105 + 0.0004,
        unit="deg",
    )


def test_leap_second_of_2016(validation):
    """A run that starts 5 s before midnight meets midnight after 6 s, and satellites are where they are then."""
    midnight = datetime.datetime(2017, 1, 1, tzinfo=UTC)
    epochs = Epochs(datetime.datetime(2016, 12, 31, 23, 59, 55, tzinfo=UTC), np.array([0.0, 6.0]))
    validation(
        case="seconds from 2016-12-31 23:59:55 UTC to midnight",
        source="IERS Bulletin C 52: a leap second",
        expected=6.0,
        got=-epochs.since(midnight)[0],
        tolerance=0,
        unit="s",
    )
    radius = 7e6
    orbit = Kepler(
        epoch_utc=midnight,
        semi_major_axis_km=radius / 1e3,
        eccentricity=0.0,
        inclination_deg=0.0,
        raan_deg=0.0,
        argument_of_perigee_deg=0.0,
        true_anomaly_deg=0.0,
    )
    before, at = orbit.states(epochs).position_m
    validation(
        case="low orbit flown over the leap second: way from 23:59:55 UTC to midnight",
        source="chord of 6 s on a circle",
        expected=2 * radius * math.sin(3.0 * math.sqrt(GM / radius**3)),
        got=np.linalg.norm(at - before),
        tolerance=1e-8,  # a few roundings of 7e6 m, 1e-9 each; a lost second is 7.5 km
        unit="m",
    )

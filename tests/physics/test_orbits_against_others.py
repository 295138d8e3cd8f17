"""Orbits against the outside world: Vallado's verification set, skyfield, a numerical integrator, and two-body truth."""

import datetime
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from rso_lidar import units
from rso_lidar.motion import catalog
from rso_lidar.motion.epochs import Epochs
from rso_lidar.motion.hill import Hill, rtn_axes
from rso_lidar.motion.kepler import propagate
from rso_lidar.motion.sgp4_orbit import Tle, _teme, gcrs_from_teme

GM = units.EARTH_GM_M3_S2
ACTIVE = "tle/catalogs/celestrak_active_2026-05-07.tle"


# ------------------------------------------------------------------------------------ SGP4, by Vallado's own program


@pytest.fixture(scope="module")
def verification(shared):
    """Return Vallado's element sets by place in the file: the set, and its start, stop and step [min]."""
    folder = shared / "tle" / "sgp4_verification"
    lines = [line for line in (folder / "SGP4-VER.TLE").read_text().splitlines() if line[:2] in ("1 ", "2 ")]
    # the last columns of his line 2, past the 69 of an element line, are the times to print
    sets = catalog.parse_lines([line[:69] for line in lines], "SGP4-VER.TLE")
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


def test_vallados_verification_set(verification, printed):
    assert len(verification) == len(printed) == 33
    compared = 0
    for (elements, _), (number, rows) in zip(verification, printed, strict=True):
        assert elements.norad_id == number
        if len(rows) == 1:
            continue  # his program prints the previous satellite's state where the first epoch fails: see below
        position_m, velocity_m_s, error = _teme(elements, Epochs(elements.epoch_utc, rows[:, 0] * 60.0))
        np.testing.assert_array_equal(error, 0)
        # printed to 1e-8 km and 1e-9 km/s; the allowance for other compilers is the sgp4 package's own, 0.2 mm
        np.testing.assert_allclose(position_m / 1e3, rows[:, 1:4], rtol=0, atol=2e-7, err_msg=str(number))
        np.testing.assert_allclose(velocity_m_s / 1e3, rows[:, 4:7], rtol=0, atol=2e-9, err_msg=str(number))
        compared += len(rows)
    assert compared > 600


def test_vallados_error_cases(verification, printed):
    """Where his printout breaks off, the next epoch of the satellite's span must carry SGP4's error."""
    errors = {}
    for (elements, (start, stop, step)), (number, rows) in zip(verification, printed, strict=True):
        minutes = np.append(np.arange(start, stop, step), stop)
        after = minutes[minutes > rows[-1, 0]] if len(rows) > 1 else minutes
        if not len(after):
            continue
        _, _, error = _teme(elements, Epochs(elements.epoch_utc, after[:1] * 60.0))
        errors[number] = int(error[0])
    # the list of the sgp4 package's tests, in the order of the file: 1, 1, 6, 6, 4, 3, 6
    assert errors == {22312: 1, 28350: 1, 28872: 6, 29141: 6, 33333: 4, 33334: 3, 20413: 6}


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
def test_states_are_skyfields(shared, name):
    part = Tle(file=str(shared / ACTIVE), name=name)
    epochs = Epochs(datetime.datetime(2026, 5, 6, 1, 2, 3, 456789, tzinfo=datetime.UTC), np.linspace(0.0, 86400.0, 301))
    state = part.states(epochs)
    position_m, velocity_m_s = skyfield_state(part.elements(epochs.start_utc), epochs)
    # the limit the project set is 1 mm; interpolation and skyfield's own rounding (1e-13 rad) leave microns
    assert np.abs(state.position_m - position_m).max() < 1e-5
    assert np.abs(state.velocity_m_s - velocity_m_s).max() < 1e-8


def test_relative_position_of_a_formation_is_skyfields(shared):
    path = str(shared / "tle/pairs/terrasarx_tandemx_2026.tle")
    epochs = Epochs(datetime.datetime(2026, 4, 1, 6, tzinfo=datetime.UTC), np.linspace(0.0, 6000.0, 121))
    parts = [Tle(file=path, name=name) for name in ("TERRASAR-X", "TANDEM-X")]
    ours = parts[1].states(epochs).position_m - parts[0].states(epochs).position_m
    theirs = [skyfield_state(part.elements(epochs.start_utc), epochs)[0] for part in parts]
    assert np.abs(ours - (theirs[1] - theirs[0])).max() < 1e-5
    separation = np.linalg.norm(ours, axis=1)
    assert separation.min() > 20.0  # the pair flies 20 m to 6.4 km apart by its element sets
    assert separation.max() < 6.5e3


@pytest.mark.parametrize("year", [1980, 2000, 2026, 2045])
def test_rotation_is_skyfields(year):
    from skyfield.sgp4lib import TEME

    epochs = Epochs(datetime.datetime(year, 2, 3, tzinfo=datetime.UTC), np.linspace(0.0, 40 * 86400.0, 1500))
    theirs = TEME.rotation_at(epochs.skyfield_time()).transpose(2, 1, 0)
    ours = gcrs_from_teme(epochs)
    # the pole: the fortnightly nutation, 0.23", through hourly nodes by a cubic leaves 4e-15
    assert np.abs(ours[:, :, 2] - theirs[:, :, 2]).max() < 1e-14
    # about the pole skyfield rounds more: it counts 4e6 s of GMST82 in one float64, which steps by 4.7e-10 s = 3.4e-14
    # rad, several times over, on either side
    assert np.abs(ours - theirs).max() < 8 * 3.4e-14


# ------------------------------------------------------------------------------------------- two bodies, by integration


@pytest.mark.parametrize(("e", "incoming_rad"), [(0.0, 0.0), (0.3, -1.0), (0.9, 3.0), (1.0, -1.8), (1.6, -1.5)])
def test_two_body_motion_against_an_integrator(e, incoming_rad):
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
    position, velocity = propagate(r0, v0, times)
    # DOP853 at rtol 3e-14 keeps about 1e-11 over this span: some 1000 steps, each rounded, growing along the track
    size = np.linalg.norm(position, axis=1).max()
    assert np.abs(position - flown.y[:3].T).max() < 1e-10 * size
    assert np.abs(velocity - flown.y[3:].T).max() < 1e-10 * math.sqrt(2 * GM / perigee)


# ----------------------------------------------------------------------------------------- relative motion, by two bodies


def two_body_difference(chief_r, chief_v, rho, rho_dot, times):
    """Return the true relative position [m] in rtn axes of two Kepler orbits."""
    rotation, rate = rtn_axes(chief_r, chief_v)
    follower_r = chief_r + rotation.apply(rho)
    follower_v = chief_v + rotation.apply(rho_dot + np.cross(rate, rho))
    chief, _ = propagate(chief_r, chief_v, times)
    axes, _ = rtn_axes(*propagate(chief_r, chief_v, times))
    return axes.inv().apply(propagate(follower_r, follower_v, times)[0] - chief)


def test_clohessy_wiltshire_error_is_the_second_order_term():
    """The neglected gravity gradient is 3/2 n^2 rho^2 / r: ten times the separation, a hundred times the error."""
    radius = 42164e3
    n = math.sqrt(GM / radius**3)
    chief = np.array([radius, 0, 0]), np.array([0, n * radius, 0])
    times = np.linspace(0.0, 10800.0, 61)
    errors = []
    for rho in (300.0, 3000.0, 30000.0):
        start, velocity = np.array([0.2, -1.0, 0.1]) * rho, np.array([0.1, -0.3, 0.2]) * n * rho
        hill = Hill(relative_to="chief", position_m=tuple(start.tolist()), velocity_m_s=tuple(velocity.tolist()))
        truth = two_body_difference(*chief, start, velocity, times)
        errors.append(np.linalg.norm(hill.relative(times, n)[0] - truth, axis=1).max())
        # the error of an acceleration of up to 3 n^2 rho^2 / r (radial and cross terms together) over nt = 0.8 rad
        assert errors[-1] < 3 * (n * times[-1]) ** 2 * rho**2 / radius
    # the third-order term spoils the ratio by about rho / r = 7e-4, rounding (1e-8 m of 2 mm) by less
    np.testing.assert_allclose(np.array(errors[1:]) / np.array(errors[:-1]), 100.0, rtol=5e-3)


def test_seed_hop_of_3_km_stays_within_its_own_second_order_error():
    """The hop of the design page: 3 km behind TDRS to 300 m behind in 45 minutes."""
    radius = 42164e3
    n = math.sqrt(GM / radius**3)
    times = np.array([2700.0])
    start, velocity = np.array([0.0, -3000.0, 0.0]), np.array([-0.19500, 0.98719, 0.0])
    hill = Hill(relative_to="tdrs", position_m=(0.0, -3000.0, 0.0), velocity_m_s=(-0.19500, 0.98719, 0.0))
    position, _ = hill.relative(times, n)
    # velocities given to 5e-6 m/s (and n of a real TDRS to 1e-4) leave 15 mm at the end
    np.testing.assert_allclose(position[0], [0.0, -300.0, 0.0], rtol=0, atol=0.1)
    truth = two_body_difference(np.array([radius, 0, 0]), np.array([0, n * radius, 0]), start, velocity, times)
    assert np.linalg.norm(truth - position) < 3 * (n * 2700.0) ** 2 * 3000.0**2 / radius

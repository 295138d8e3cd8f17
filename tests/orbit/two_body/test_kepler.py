"""Two-body motion: textbook cases, closed forms, every conic, and there and back."""

import datetime
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rso_lidar import units
from rso_lidar.errors import PropagationError, RsoLidarWarning, ScenarioError
from rso_lidar.orbit import Epochs, Kepler, State, elements_from_state, propagate_two_body
from rso_lidar.orbit.two_body.kepler import semi_major_axis_m
from rso_lidar.orbit.two_body.universal_variables import inverse_semi_major_axis, propagate_universal, stumpff

GM = units.EARTH_GM_M3_S2
EPOCH = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)
EPS = np.finfo(float).eps
GEO = {
    "epoch_utc": EPOCH,
    "semi_major_axis_km": 42164.0,
    "eccentricity": 0.0,
    "inclination_deg": 0.0,
    "raan_deg": 0.0,
    "argument_of_perigee_deg": 0.0,
    "true_anomaly_deg": 0.0,
}


def at_perigee(perigee_m, e):
    return np.array([perigee_m, 0, 0]), np.array([0, math.sqrt(GM * (1 + e) / perigee_m), 0])


def test_vallado_example_2_4():
    # Vallado 4th ed. example 2-4: 40 minutes in low orbit; printed to 0.1 m and 1 mm/s, input to 1 m and 1 cm/s
    position, velocity = propagate_two_body(
        np.array([1131.340, -2282.343, 6672.423]) * 1e3,
        np.array([-5.64305, 4.30333, 2.42879]) * 1e3,
        np.array([2400.0]),
    )
    np.testing.assert_allclose(position[0], np.array([-4219.7527, 4363.0292, -3958.7666]) * 1e3, rtol=0, atol=0.1)
    np.testing.assert_allclose(velocity[0], np.array([3.689866, -1.916735, -6.112511]) * 1e3, rtol=0, atol=1e-3)


def test_curtis_example_3_7():
    # Curtis, Orbital Mechanics for Engineering Students, example 3.7: an ellipse for one hour, printed to five digits
    position, velocity = propagate_two_body(
        np.array([7000.0, -12124.0, 0]) * 1e3, np.array([2.6679, 4.6210, 0]) * 1e3, np.array([3600.0])
    )
    np.testing.assert_allclose(position[0], np.array([-3297.8, 7413.4, 0]) * 1e3, rtol=0, atol=0.05e3)
    np.testing.assert_allclose(velocity[0], np.array([-8.2976, -0.96404, 0]) * 1e3, rtol=0, atol=0.05)


def test_elements_of_vallado_example_2_5():
    found = elements_from_state(
        np.array([6524.834, 6862.875, 6448.296]) * 1e3, np.array([4.901327, 5.533756, -1.976341]) * 1e3
    )
    assert found.semi_major_axis_m == pytest.approx(36127.343e3, abs=10.0)  # a hangs on v to 1 mm/s: 8 m
    assert found.eccentricity == pytest.approx(0.832853, abs=1e-6)
    for angle, degrees in [
        (found.inclination_rad, 87.870),
        (found.raan_rad, 227.898),
        (found.argument_of_perigee_rad, 53.38),
        (found.true_anomaly_rad, 92.335),
    ]:
        assert angle / units.DEG == pytest.approx(degrees, abs=0.006)


@pytest.mark.parametrize("e", [0.0, 1e-9, 0.3, 0.9, 0.9999])
def test_ellipse_against_its_parametric_form(e):
    """The closed form in eccentric anomaly: x = a (cos E - e), y = b sin E at t = (E - e sin E) / n."""
    perigee = 7e6
    a = perigee / (1 - e)
    n = math.sqrt(GM / a**3)
    anomaly = np.linspace(-3 * math.tau, 5 * math.tau, 1001)
    position, velocity = propagate_two_body(*at_perigee(perigee, e), (anomaly - e * np.sin(anomaly)) / n)
    b = a * math.sqrt((1 - e) * (1 + e))
    rate = n / (1 - e * np.cos(anomaly))
    expected = np.stack([a * (np.cos(anomaly) - e), b * np.sin(anomaly), 0 * anomaly], axis=1)
    slope = np.stack([-a * np.sin(anomaly) * rate, b * np.cos(anomaly) * rate, 0 * anomaly], axis=1)
    # The state at perigee, rounded to EPS, fixes a to 4 EPS / (1 - e) of itself; that moves a point outward by as much,
    # and along its path by 3/2 of it in time, over all revolutions flown.
    slack = 4 * EPS / (1 - e)
    late = 1.5 * slack * np.abs(anomaly).max() / n
    speed = np.linalg.norm(slope, axis=1)
    assert np.all(np.linalg.norm(position - expected, axis=1) <= 2 * slack * a + speed * late)
    radius = np.linalg.norm(expected, axis=1)
    assert np.all(np.linalg.norm(velocity - slope, axis=1) <= 2 * slack * speed * a / radius + GM / radius**2 * late)


@pytest.mark.parametrize("e", [1.0 + 1e-9, 1.1, 3.0, 10.0])
def test_hyperbola_against_its_parametric_form(e):
    perigee = 7e6
    a = perigee / (e - 1)
    n = math.sqrt(GM / a**3)
    span = 4.0 if e > 1.01 else 1e-3  # near a parabola a small hyperbolic anomaly goes far
    anomaly = np.linspace(-span, span, 401)
    time = (e * np.sinh(anomaly) - anomaly) / n
    position, _ = propagate_two_body(*at_perigee(perigee, e), time)
    b = a * math.sqrt((e - 1) * (e + 1))
    # cosh and sinh near 0 through half angles: e - cosh H = (e - 1) - 2 sinh(H/2)^2
    expected = np.stack([a * ((e - 1) - 2 * np.sinh(anomaly / 2) ** 2), b * np.sinh(anomaly), 0 * anomaly], axis=1)
    # the formula for time cancels near a parabola (e sinh H - H), to EPS * H / n; and a follows from e - 1
    speed = math.sqrt(GM * (1 + e) / perigee)
    time_rounding = 8 * EPS * np.abs(anomaly) / n
    size = np.linalg.norm(expected, axis=1)
    # the state at perigee fixes e to 4 EPS, and so a to 4 EPS / (e - 1)
    assert np.all(
        np.linalg.norm(position - expected, axis=1) <= 32 * EPS * size * (1 + size / a) + speed * time_rounding
    )


def test_parabola_obeys_barker():
    """Barker's equation: t = sqrt(2 q^3 / GM) (D + D^3 / 3), D = tan(nu / 2), r = q (1 + D^2)."""
    q = 7e6
    d = np.linspace(-5.0, 5.0, 101)
    position, _ = propagate_two_body(*at_perigee(q, 1.0), math.sqrt(2 * q**3 / GM) * (d + d**3 / 3))
    expected = np.stack([q * (1 - d**2), 2 * q * d, 0 * d], axis=1)
    # the speed at perigee rounds to EPS, so 1 / a to a few EPS / q, which bends the path by (r / q)^2 of that
    assert np.all(np.linalg.norm(position - expected, axis=1) <= 16 * EPS * q * (1 + d**2) ** 2)


@given(
    e=st.sampled_from([0.0, 1e-9, 1e-3, 0.2, 0.7, 0.95, 1.0, 1.0 + 1e-9, 1.05, 2.0]),
    perigee_m=st.floats(6.5e6, 5e7),
    where=st.floats(-0.98, 0.98),
    log_dt=st.floats(-3.0, 6.5),
    back=st.booleans(),
)
def test_there_and_back(e, perigee_m, where, log_dt, back):
    limit = math.pi if e < 1 else math.acos(-1 / e)
    nu, p = where * limit, perigee_m * (1 + e)
    r0 = p / (1 + e * math.cos(nu)) * np.array([math.cos(nu), math.sin(nu), 0.0])
    v0 = math.sqrt(GM / p) * np.array([-math.sin(nu), e + math.cos(nu), 0.0])
    dt = np.array([-(10.0**log_dt) if back else 10.0**log_dt])
    r1, v1 = propagate_two_body(r0, v0, dt)
    r2, v2 = propagate_two_body(r1[0], v1[0], -dt)
    # Energy rounds to EPS GM / r_min, so mean motion to 3 EPS (a / r_min), and the phase grows with the mean anomaly
    # flown; position errors are magnified at most by the ratio of extremes of radius.
    radius0, radius1 = np.linalg.norm(r0), np.linalg.norm(r1[0])
    fastest = math.sqrt(2 * GM / perigee_m)
    scale = fastest * abs(dt[0]) + radius0 + radius1
    bound = 100 * EPS * scale * max(radius0, radius1) / perigee_m
    assert np.linalg.norm(r2[0] - r0) <= bound
    assert np.linalg.norm(v2[0] - v0) <= bound * GM / perigee_m**3 * (scale / fastest)
    energy0, energy1 = v0 @ v0 / 2 - GM / radius0, v1[0] @ v1[0] / 2 - GM / radius1
    assert abs(energy1 - energy0) <= 64 * EPS * GM / perigee_m
    momentum = np.cross(r1[0], v1[0])
    assert np.linalg.norm(momentum - np.cross(r0, v0)) <= 64 * EPS * radius1 * np.linalg.norm(v1[0])


def test_many_revolutions_come_home():
    r0, v0 = at_perigee(6.778e6, 0.01)
    period = math.tau / math.sqrt(GM / semi_major_axis_m(r0, v0) ** 3)
    turns = np.array([0.0, 1.0, -1.0, 1e4, -1e4])
    position, _ = propagate_two_body(r0, v0, turns * period)
    # a and so the period round to a few EPS: times 1e4 periods at 7.7 km/s
    assert np.all(np.linalg.norm(position - r0, axis=1) <= 8 * EPS * (np.abs(turns) + 1) * period * 8e3)


def test_a_state_is_the_same_bits_in_any_company():
    dt = np.linspace(-1e5, 3e5, 1003)
    for e in (0.0, 0.7, 1.5):
        r0, v0 = at_perigee(7e6, e)
        together = propagate_two_body(r0, v0, dt)
        for k in (0, 1, 2, 3, 501, 1001, 1002):
            alone = propagate_two_body(r0, v0, dt[k : k + 1])
            np.testing.assert_array_equal(alone[0][0], together[0][k])
            np.testing.assert_array_equal(alone[1][0], together[1][k])


@given(
    e=st.floats(0.0, 0.99999), perigee_m=st.floats(6.4e6, 5e7), turns=st.floats(-3.0, 3.0), start=st.floats(-3.0, 3.0)
)
def test_both_solvers_of_an_ellipse_agree(e, perigee_m, turns, start):
    """The one without a loop, and universal variables, which share nothing but the conic."""
    r0, v0 = at_perigee(perigee_m, e)
    period = math.tau * math.sqrt((perigee_m / (1 - e)) ** 3 / GM)
    r0, v0 = (column[0] for column in propagate_two_body(r0, v0, np.array([start * 0.1 * period])))
    dt = np.array([turns * period])
    position, velocity = propagate_two_body(r0, v0, dt)
    other, speed, bad = propagate_universal(r0, v0, dt, inverse_semi_major_axis(r0, v0))
    assert not bad.any()
    # the axis rounds by EPS / (1 - e) of itself, and a point runs ahead by 3/2 of that of the way flown at perigee's speed
    fastest = math.sqrt(2 * GM / perigee_m)
    bound = 16 * EPS / (1 - e) * (perigee_m / (1 - e) + fastest * period * (1 + abs(turns)))
    assert np.linalg.norm(position - other) <= bound
    assert np.linalg.norm(velocity - speed) <= bound * GM / perigee_m**2 / fastest * 4


def test_epochs_without_an_answer_are_named():
    r0, v0 = at_perigee(7e6, 1.5)
    with pytest.raises(PropagationError, match="no state at 1 of 2 epochs") as caught:
        propagate_two_body(r0, v0, np.array([10.0, np.nan]))
    np.testing.assert_array_equal(caught.value.bad, [False, True])


def test_stumpff_functions_join_smoothly():
    for edge in (1.0, -1.0):
        below, above = stumpff(np.array([edge, np.nextafter(edge, 10 * edge)]))
        np.testing.assert_allclose(below[0], below[1], rtol=8 * EPS)
        np.testing.assert_allclose(above[0], above[1], rtol=8 * EPS)
    c2, c3 = stumpff(np.array([0.0, math.pi**2, -1.0]))
    np.testing.assert_allclose(c2, [1 / 2, 2 / math.pi**2, math.cosh(1) - 1], rtol=8 * EPS)
    np.testing.assert_allclose(c3, [1 / 6, 1 / math.pi**2, math.sinh(1) - 1], rtol=8 * EPS)


# ------------------------------------------------------------------------------------------------------------- parts


def test_geostationary_part():
    radius = 42164e3
    n = math.sqrt(GM / radius**3)
    times = np.array([0.0, math.pi / 2 / n, -math.pi / n])
    state = Kepler(**GEO).states(Epochs(EPOCH, times))
    np.testing.assert_allclose(
        state.position_m, [[radius, 0, 0], [0, radius, 0], [-radius, 0, 0]], rtol=0, atol=32 * EPS * radius
    )
    np.testing.assert_allclose(state.velocity_m_s[0], [0, n * radius, 0], rtol=0, atol=8 * EPS * n * radius)


@pytest.mark.parametrize(("a_km", "e"), [(42164.0, 1e-6), (7000.0, 0.01), (26600.0, 0.74), (-20000.0, 1.5)])
def test_elements_return_what_was_given(a_km, e):
    given = {"inclination_deg": 63.4, "raan_deg": 210.0, "argument_of_perigee_deg": 270.0, "true_anomaly_deg": 40.0}
    state = Kepler(epoch_utc=EPOCH, semi_major_axis_km=a_km, eccentricity=e, **given).at_epoch()
    found = elements_from_state(state.position_m, state.velocity_m_s)
    assert found.semi_major_axis_m == pytest.approx(a_km * 1e3, rel=64 * EPS / abs(1 - e))
    assert found.eccentricity == pytest.approx(e, abs=32 * EPS)
    assert found.inclination_rad / units.DEG == pytest.approx(63.4, abs=1e-12)
    assert found.raan_rad / units.DEG == pytest.approx(210.0, abs=1e-12)
    direction = 64 * EPS / e / units.DEG  # how well a perigee of a near-circle can be told
    assert found.argument_of_perigee_rad / units.DEG == pytest.approx(270.0, abs=1e-12 + direction)
    assert found.true_anomaly_rad / units.DEG == pytest.approx(40.0, abs=1e-12 + direction)
    assert found.perigee_altitude_m == pytest.approx(a_km * 1e3 * (1 - e) - units.EARTH_RADIUS_M, abs=1e-6)
    if e < 1:
        assert found.apogee_altitude_m == pytest.approx(a_km * 1e3 * (1 + e) - units.EARTH_RADIUS_M, rel=1e-12)
        assert found.period_s == pytest.approx(math.tau * math.sqrt((a_km * 1e3) ** 3 / GM), rel=1e-12)
    else:
        assert math.isinf(found.apogee_altitude_m)
        assert math.isinf(found.period_s)


def test_elements_of_a_circle_on_the_equator():
    state = Kepler(**{**GEO, "true_anomaly_deg": 75.0}).at_epoch()
    found = elements_from_state(state.position_m, state.velocity_m_s)
    assert found.inclination_rad == 0.0
    longitude = found.raan_rad + found.argument_of_perigee_rad + found.true_anomaly_rad
    assert math.remainder(longitude / units.DEG - 75.0, 360.0) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(
    ("a_km", "e", "mean_deg"), [(26600.0, 0.74, 100.0), (26600.0, 0.74, -800.0), (-20000.0, 1.5, 100.0)]
)
def test_mean_anomaly_solves_keplers_equation(a_km, e, mean_deg):
    fields = {
        **GEO,
        "semi_major_axis_km": a_km,
        "eccentricity": e,
        "true_anomaly_deg": None,
        "mean_anomaly_deg": mean_deg,
    }
    state = Kepler(**fields).at_epoch()
    nu = elements_from_state(state.position_m, state.velocity_m_s).true_anomaly_rad
    half = math.sqrt(abs(1 - e) / (1 + e)) * math.tan(nu / 2)
    if e < 1:
        anomaly = 2 * math.atan(half)
        mean = anomaly - e * math.sin(anomaly)
    else:
        anomaly = 2 * math.atanh(half)
        mean = e * math.sinh(anomaly) - anomaly
    assert math.remainder(mean - mean_deg * units.DEG, math.tau) == pytest.approx(0.0, abs=1e-13)


def test_state_part_is_the_same_motion():
    kepler = Kepler(**{**GEO, "eccentricity": 0.1, "inclination_deg": 30.0})
    start = kepler.at_epoch()
    part = State(
        epoch_utc=EPOCH, position_m=tuple(start.position_m.tolist()), velocity_m_s=tuple(start.velocity_m_s.tolist())
    )
    epochs = Epochs(EPOCH + datetime.timedelta(hours=1), np.linspace(-1e4, 1e5, 50))
    np.testing.assert_array_equal(part.states(epochs).position_m, kepler.states(epochs).position_m)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"mean_anomaly_deg": 0.0}, "exactly one of true_anomaly_deg and mean_anomaly_deg"),
        ({"true_anomaly_deg": None}, "exactly one of true_anomaly_deg and mean_anomaly_deg"),
        ({"eccentricity": 1.0}, "type 'state'"),
        ({"eccentricity": 1.2}, "negative for a hyperbola"),
        ({"semi_major_axis_km": -8000.0}, "positive for an ellipse"),
        ({"semi_major_axis_km": 0.0}, "semi_major_axis_km: 0"),
        ({"semi_major_axis_km": 6400.0, "eccentricity": 0.01}, "below the Earth's surface"),
        (
            {"semi_major_axis_km": 42164170.0},
            r"semi_major_axis_km: 42164170 km is beyond 3e\+06 km, .* as metres it would be 42164.17 km; give kilometres",
        ),
        ({"semi_major_axis_km": -42164170.0, "eccentricity": 1.2}, "as metres it would be -42164.17 km"),
        ({"inclination_deg": 200.0}, "outside 0 to 180"),
        ({"semi_major_axis_km": -20000.0, "eccentricity": 1.5, "true_anomaly_deg": 140.0}, "within 131.810"),
    ],
)
def test_impossible_orbits_are_refused(changes, message):
    with pytest.raises(ScenarioError, match=message) as caught:
        Kepler(**{**GEO, **changes})
    assert "\n" not in str(caught.value)


def test_impossible_states_are_refused():
    with pytest.raises(
        ScenarioError, match=r"is 42164 m .* inside the Earth; as kilometres it would be 4\.2164e\+07 m; give m"
    ):
        State(epoch_utc=EPOCH, position_m=(42164.0, 0.0, 0.0), velocity_m_s=(0.0, 3.07, 0.0))
    with pytest.raises(ScenarioError, match="give it a component across"):
        State(epoch_utc=EPOCH, position_m=(7e6, 0.0, 0.0), velocity_m_s=(10.0, 0.0, 0.0))
    with pytest.raises(ScenarioError, match=r"position_m: is 4\.2e\+10 m .* beyond 3e\+09 m"):
        State(epoch_utc=EPOCH, position_m=(4.2e10, 0.0, 0.0), velocity_m_s=(0.0, 3070.0, 0.0))


def test_a_speed_in_kilometres_per_second_is_asked_about():
    place = {"epoch_utc": EPOCH, "position_m": (0.0, 7e6, 0.0)}
    with pytest.warns(
        RsoLidarWarning, match=r"7\.5 m/s is a fall into the Earth; as kilometres .* of 7500 m/s; give metres"
    ):
        State(**place, velocity_m_s=(7.5, 0.0, 0.0))
    for speed in (0.9, 11.0, 1000.0):  # escape speed is 10 672 m/s there
        State(**place, velocity_m_s=(speed, 0.0, 0.0))

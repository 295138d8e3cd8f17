"""Events of many conditions against a grid of 1 s, with conditions that are written apart from the package's."""

import datetime

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.orbit import GroundStation, NamedTrajectory
from tests.mission_analysis.intervals.grid_for_tests import choose_limits, combine, compare, make_oracle

START = datetime.datetime(2026, 5, 7, tzinfo=datetime.UTC)
STATION = GroundStation(47.067, 15.493, 540.0, 5.0, name="G")
KEYS = ("semi_major_axis_km", "eccentricity", "inclination_deg", "raan_deg", "argument_of_perigee_deg")


def orbit(*elements):
    return rl.orbit.J2(epoch_utc=START, **dict(zip((*KEYS, "mean_anomaly_deg"), map(float, elements), strict=True)))


LOW = orbit(6878.0, 0.001, 97.4, 40.0, 15.0, 0.0)
PAIRS = {
    "a formation": (LOW, orbit(6878.0, 0.0012, 97.402, 40.003, 15.0, 0.004)),
    "orbits that cross": (LOW, orbit(6879.0, 0.0015, 51.6, 100.0, 30.0, 210.0)),
    "low and geostationary": (LOW, orbit(42165.0, 0.0003, 0.05, 10.0, 0.0, 60.0)),
    "eccentric and low": (orbit(26560.0, 0.72, 63.4, 200.0, 270.0, 90.0), LOW),
}


def check(own, target, days, names=None):
    """Return the number of events, and of those that the grid shows, and fail where they differ."""
    limits = choose_limits(own, target, START, days)
    oracle = make_oracle(own, target, START, STATION, limits)
    time_s = np.arange(0.0, 86400.0 * days + 0.5)
    held = oracle(time_s)
    text, mask = combine(held)
    held = {name: at for name, at in held.items() if names is None or name in names} | {text: mask}
    objects = [NamedTrajectory("target", target)]
    table = rl.study.events(
        objects, NamedTrajectory("own", own), list(held), start_utc=START, days=days, stations=[STATION]
    )
    found = shown = 0
    for name in held:
        spans = [(row.from_s, row.to_s) for row in table.rows if row.event == name]

        def again(at, name=name):
            several = oracle(at)
            return combine(several)[1] if name == text else several[name]

        seen, wrong, moved = compare(spans, held[name], again, time_s)
        assert (wrong, moved) == (0, 0), name
        found, shown = found + len(spans), shown + seen
    return found, shown


def test_events_of_a_formation_are_those_of_the_grid():
    found, shown = check(*PAIRS["a formation"], 0.1, {"sun < 45deg", "lit", "umbra", "contact(G)"})
    assert found >= shown > 4


@pytest.mark.slow
@pytest.mark.parametrize("name", PAIRS)
def test_no_event_of_a_day_is_missed(name):
    found, shown = check(*PAIRS[name], 0.75)
    assert found >= shown > 50


def test_greatest_range_and_share_of_light_of_an_event_are_those_of_the_grid():
    target, own = PAIRS["low and geostationary"]
    table = rl.study.events(
        [NamedTrajectory("target", target)], NamedTrajectory("own", own), "range < 45000km", start_utc=START, days=0.07
    )
    oracle = make_oracle(own, target, START, STATION, choose_limits(own, target, START, 0.07))
    shares = []
    for row in table.rows:
        time_s = np.linspace(row.from_s, row.to_s, 4001)
        epochs = rl.orbit.Epochs(START, time_s)
        range_m = np.linalg.norm(own.states(epochs).position_m - target.states(epochs).position_m, axis=1)
        assert row.farthest_m == pytest.approx(range_m.max(), rel=1e-6)
        assert row.nearest_m == pytest.approx(range_m.min(), rel=1e-3)  # of steps of some seconds
        # a penumbra of 10 s on each side, in which half of the disc and its centre differ by the Earth's shape
        lit = oracle(time_s)["lit"].mean()
        assert row.lit_fraction == pytest.approx(lit, abs=20.0 / row.duration_s)
        shares.append(lit)
    assert any(0.05 < share < 0.95 for share in shares)


def test_a_flyby_of_a_second_is_found():
    """Two craft pass at 8 km/s within 100 m: nothing but the rates of the conditions leads to so short an event."""
    here = LOW.states(rl.orbit.Epochs(START, np.array([30_011.3])))
    at_utc = START + datetime.timedelta(seconds=30_011.3)
    place, speed = here.position_m[0], here.velocity_m_s[0]
    across = np.cross(place, speed)
    across *= np.linalg.norm(speed) / np.linalg.norm(across)
    passing = rl.orbit.State(
        epoch_utc=at_utc,
        position_m=tuple((place * (1.0 + 100.0 / np.linalg.norm(place))).tolist()),
        velocity_m_s=tuple(across.tolist()),
    )
    names = {"near": "range < 3km", "turning": "slew > 30deg/s", "ahead": "range < 3km and angle(+r) < 87deg"}
    table = rl.study.events(
        [NamedTrajectory("b", passing)], NamedTrajectory("a", LOW), names, start_utc=START, days=0.5
    )
    spans = {row.event: (row.from_s, row.to_s) for row in table.rows if abs(row.nearest_s - 30_011.3) < 2.0}
    assert set(spans) == set(names)
    near = spans["near"]
    speed_m_s = np.sqrt(2.0) * np.linalg.norm(speed)
    # straight lines: 2 sqrt(3000^2 - 100^2) over the relative speed
    assert near[1] - near[0] == pytest.approx(2.0 * np.sqrt(3000.0**2 - 100.0**2) / speed_m_s, abs=2e-3)
    assert sum(near) / 2 == pytest.approx(30_011.3, abs=2e-3)
    turning = spans["turning"]
    # omega = d v / (d^2 + v^2 t^2) of straight lines
    half = np.sqrt(100.0 * speed_m_s / np.radians(30.0) - 100.0**2) / speed_m_s
    assert turning[1] - turning[0] == pytest.approx(2.0 * half, rel=1e-2)

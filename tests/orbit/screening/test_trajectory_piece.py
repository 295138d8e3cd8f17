"""Screening of trajectories: eccentric orbits, burns, tables with gaps, mixed with element sets, against a fine grid."""

import datetime
import itertools

import numpy as np
import pytest

from rso_lidar import units
from rso_lidar.errors import PropagationError
from rso_lidar.orbit import (
    Burn,
    ElementSet,
    Ephemeris,
    Epochs,
    Impulse,
    Kepler,
    NamedTrajectory,
    Numerical,
    Omm,
    State,
    Tle,
    screen,
    screen_pairs,
    write_oem,
)
from rso_lidar.orbit.screening.trajectory_piece import find_pieces
from rso_lidar.records import BodyState

START = datetime.datetime(2026, 5, 7, tzinfo=datetime.UTC)
SPAN_S = 6 * 3600.0 + 7.0
WITHIN_M = 150e3


def kepler(axis_km, e=0.001, i=53.0, raan=10.0, argument=20.0, anomaly=0.0):
    return Kepler(
        epoch_utc=START,
        semi_major_axis_km=axis_km,
        eccentricity=e,
        inclination_deg=i,
        raan_deg=raan % 360.0,
        argument_of_perigee_deg=argument % 360.0,
        mean_anomaly_deg=anomaly % 360.0,
    )


def make_set(number, turns, **changes):
    fields = {"eccentricity": 0.001, "inclination_deg": 53.0, "raan_deg": 10.0, "argument_of_perigee_deg": 20.0}
    fields |= {"mean_anomaly_deg": 0.0, "bstar_per_earth_radius": 0.0, **changes}
    return ElementSet(name=f"OBJECT {number}", norad_id=number, epoch_utc=START, mean_motion_rev_day=turns, **fields)


FOLLOWER = kepler(6878.0)


def draw_orbits(count, seed=3):
    """Return orbits that pass the follower within 200 km at some instant: slow, crossing, and eccentric to 0.8."""
    rng = np.random.default_rng(seed)
    orbits = []
    for k in range(count):
        at_s = float(rng.uniform(0.0, SPAN_S))
        state = FOLLOWER.states(Epochs(START, np.array([at_s])))
        direction = rng.normal(size=3)
        away = state.position_m[0] + direction / np.linalg.norm(direction) * rng.uniform(0.0, 200e3)
        velocity = state.velocity_m_s[0] * (rng.uniform(1.2, 1.34) if k % 2 else 1.0)
        if k % 3:
            normal = state.position_m[0] / np.linalg.norm(state.position_m[0])
            angle = rng.uniform(0.001, 2.0)
            velocity = velocity * np.cos(angle) + np.cross(normal, velocity) * np.sin(angle)
        orbits.append(
            State(
                epoch_utc=START + datetime.timedelta(seconds=at_s),
                position_m=tuple(away.tolist()),
                velocity_m_s=tuple(velocity.tolist()),
            )
        )
    return orbits


class Thrusting:
    """A follower's orbit with a push that no break announces: its states alone show it."""

    def __init__(self, begin_s, length_s, accel_m_s2):
        self.flown = Numerical(
            initial=FOLLOWER,
            maneuvers=(Burn(from_s=begin_s, duration_s=length_s, acceleration_m_s2=accel_m_s2),),
        )

    def states(self, epochs):
        return self.flown.states(epochs)


def compare_with_grid(found, objects, own, lead=0, step_s=2.0, within_m=WITHIN_M):
    """Assert that stays and minima agree with ranges on a fine grid, and return the number of minima there."""
    time_s = np.arange(0.5, SPAN_S, step_s)  # not on the ends of tables and pieces, which are known to 0.1 ms
    here = place(own, time_s)
    count = 0
    for which, one in enumerate(objects):
        range_m = np.linalg.norm(place(one, time_s) - here, axis=1)
        stays = [stay for stay in found.approaches if (stay.lead, stay.which) == (lead, which)]
        inside = np.zeros(len(time_s), dtype=bool)
        for stay in stays:
            inside |= (time_s >= stay.enter_s) & (time_s <= stay.leave_s)
        with np.errstate(invalid="ignore"):
            clear = np.abs(range_m - within_m) > 2.0
            assert np.array_equal(inside & clear, (range_m <= within_m) & clear), f"object {which}"
            dips = (range_m[1:-1] < range_m[:-2]) & (range_m[1:-1] <= range_m[2:]) & (range_m[1:-1] < within_m)
        minima = [at for stay in stays for at in stay.minima_s]
        for at in time_s[1:-1][dips]:
            assert min(abs(np.array(minima) - at)) <= step_s + 1e-3
        count += int(dips.sum())
    return count


def place(one, time_s):
    """Return positions (time, 3) [m] in GCRS axes, NaN without a state."""
    motion = Omm.of(one) if isinstance(one, ElementSet) else one
    position = np.full((len(time_s), 3), np.nan)
    try:
        position[:] = motion.states(Epochs(START, time_s)).position_m
    except PropagationError as error:
        good = ~error.bad
        position[good] = motion.states(Epochs(START, time_s[good])).position_m
    return position


def test_eccentric_and_crossing_orbits_against_a_fine_grid():
    orbits = draw_orbits(60)
    found = screen(FOLLOWER, orbits, START, SPAN_S, WITHIN_M)
    assert found.near > 50
    assert compare_with_grid(found, orbits, FOLLOWER) > 40


@pytest.mark.parametrize("step_s", [300.0, 120.0, 600.0])
def test_an_orbit_faster_than_the_grid_follows_is_found_at_any_step(step_s):
    """A perigee at 6878 km with e = 0.9: the cubic over 600 s is wrong by some kilometres there."""
    orbits = [kepler(68_780.0, e=0.9, i=53.0, anomaly=anomaly) for anomaly in (-0.6, -0.3, -0.01, 0.0, 0.02)]
    found = screen(FOLLOWER, orbits, START, SPAN_S, 40e3, step_s)
    compare_with_grid(found, orbits, FOLLOWER, within_m=40e3)
    assert found.approaches


@pytest.mark.parametrize(("begin_s", "length_s", "push"), [(4000.0, 500.0, 0.4), (9000.0, 20.0, 8.0)])
def test_burns_declared_or_not(begin_s, length_s, push):
    burning = Thrusting(begin_s, length_s, (0.0, push, 0.2 * push))
    mate, orbits = kepler(6878.0, anomaly=-0.3), draw_orbits(25, seed=8)
    for target in (burning, burning.flown):
        found = screen(target, [mate, *orbits], START, SPAN_S, WITHIN_M)
        assert compare_with_grid(found, [mate, *orbits], burning) > 10
        (stay,) = [one for one in found.approaches if one.which == 0][:1]
        assert not stay.entered and stay.left  # it begins beside its mate and leaves it by the burn


def test_impulses_do_not_split_a_stay():
    jumping = Numerical(
        initial=FOLLOWER,
        maneuvers=tuple(Impulse(at_s=at, delta_v_m_s=(0.0, dv, 0.3)) for at, dv in ((100.0, 5.0), (900.0, -5.0))),
    )
    found = screen(jumping, [FOLLOWER], START, SPAN_S, 20e3)
    compare_with_grid(found, [FOLLOWER], jumping, within_m=20e3)
    assert found.follower.several.all()
    first = found.approaches[0]
    assert first.enter_s == 0.0 and first.leave_s > 900.0
    assert found.follower.switching == 0


@pytest.fixture
def gappy(tmp_path):
    """Return a table of states of two spans, with a gap between them, and its orbit."""
    orbit = kepler(6880.0, i=80.0, anomaly=0.0)
    place = tmp_path / "gappy.oem"
    texts = []
    for name, begin_s, end_s in (("a", 600.0, 9000.0), ("b", 12_345.0, 20_000.0)):
        epochs = Epochs(START, np.arange(begin_s, end_s + 1.0, 60.0))
        file = tmp_path / f"{name}.oem"
        write_oem(file, "GAPPY", "2026-001A", epochs, orbit.states(epochs))
        texts.append(file.read_text(encoding="ascii"))
    second = texts[1][texts[1].index("META_START") :]
    place.write_text(texts[0] + second, encoding="ascii")
    return Ephemeris(file=str(place)), orbit


def test_a_table_with_a_gap_is_searched_where_it_has_states(gappy):
    table, _ = gappy
    objects = [NamedTrajectory("TABLE", table), make_set(7, 15.2)]
    orbits = draw_orbits(12, seed=5)
    for follower in (FOLLOWER, *orbits):
        found = screen(follower, objects, START, SPAN_S, 1500e3)
        compare_with_grid(found, objects, follower, within_m=1500e3)
    labels, reasons = zip(*found.rejected, strict=True)
    assert set(labels) == {"TABLE"}
    assert len(reasons) == 3  # before, between and after
    assert "has no state from 2026-05-07T00:00:00.000Z to 2026-05-07T00:10:00.000Z" in reasons[0]


def test_a_table_as_the_follower_and_one_without_any_state(gappy):
    table, orbit = gappy
    mates = [kepler(6880.0, e=0.002, i=80.0, anomaly=0.1), kepler(6880.0, i=80.0, anomaly=0.5)]
    found = screen(table, mates, START, SPAN_S, WITHIN_M)
    compare_with_grid(found, mates, table)
    stays = [stay for stay in found.approaches if stay.which == 1]
    assert len(stays) == 2 and not any(stay.entered or stay.left for stay in stays)
    with pytest.raises(
        PropagationError, match=r"^follower LATE: has no state in the span \(ephemeris .*does not cover"
    ):
        screen(NamedTrajectory("LATE", table), mates, START - datetime.timedelta(days=2), SPAN_S, WITHIN_M)
    late = screen(orbit, [NamedTrajectory("LATE", table)], START - datetime.timedelta(days=2), SPAN_S, WITHIN_M)
    assert late.approaches == () and late.rejected[0][0] == "LATE"


def test_all_pairs_of_sets_and_trajectories_are_those_in_turn_and_on_the_grid(gappy):
    sets = [make_set(k, 15.2 + 0.01 * k, inclination_deg=40.0 + 9.0 * k) for k in range(4)]
    objects = [*sets, gappy[0], Thrusting(4000.0, 500.0, (0.0, 0.4, 0.1)), *draw_orbits(4, seed=2)]
    found = screen_pairs(objects, START, SPAN_S, 400e3)
    pairs = [(stay.lead, stay.which, stay.time_s, stay.range_m) for stay in found.approaches]
    turns = [
        (one, one + 1 + stay.which, stay.time_s, stay.range_m)
        for one in range(len(objects) - 1)
        for stay in screen(objects[one], objects[one + 1 :], START, SPAN_S, 400e3).approaches
    ]
    assert np.array(sorted(pairs)) == pytest.approx(np.array(sorted(turns)), abs=2e-2)
    assert {pair[:2] for pair in pairs} & {(one, 4) for one in range(4)}
    for one in (0, 4, 5):
        others = [k for k in range(len(objects)) if k > one]
        shifted = [None] * len(objects)
        for k in others:
            shifted[k] = objects[k]
        for k in others:
            compare_with_grid(_only(found, one, k), [objects[k]], objects[one], within_m=400e3, step_s=4.0)


def _only(found, one, other):
    """Return the stays of one pair, numbered as a single object."""
    import dataclasses

    stays = [s for s in found.approaches if (s.lead, s.which) == (one, other)]
    return dataclasses.replace(found, approaches=tuple(dataclasses.replace(stay, lead=0, which=0) for stay in stays))


def test_an_element_set_and_its_trajectory_give_the_same():
    sets = [make_set(k, 15.2 + 0.01 * k, inclination_deg=30.0 + 6.0 * k) for k in range(8)]
    by_set = screen(sets[0], sets[1:], START, SPAN_S, 300e3).approaches
    flown = screen(Omm.of(sets[0]), [Omm.of(one) for one in sets[1:]], START, SPAN_S, 300e3).approaches
    assert len(by_set) == len(flown) > 3
    for a, b in zip(by_set, flown, strict=True):
        assert (a.which, a.time_s) == (b.which, pytest.approx(b.time_s, abs=1e-3))
        assert a.range_m == pytest.approx(b.range_m, abs=1e-3)


def test_pieces_bound_what_is_flown():
    for entry in (FOLLOWER, kepler(20_000.0, e=0.65, anomaly=-40.0), Thrusting(4000.0, 500.0, (0.0, 0.4, 0.1))):
        (piece,), gaps = find_pieces(entry, 0, START, SPAN_S, 300.0)
        assert gaps == []
        bounds = piece.measure_bounds(300.0)
        state = entry.states(Epochs(START, np.arange(0.0, SPAN_S, 1.7)))
        radius, speed = np.linalg.norm(state.position_m, axis=1), np.linalg.norm(state.velocity_m_s, axis=1)
        assert bounds.perigee_m < radius.min() and radius.max() < bounds.apogee_m
        assert speed.max() < bounds.speed_m_s < 1.2 * speed.max()


def test_a_trajectory_that_escapes_and_one_that_is_not_finite():
    fast = State(epoch_utc=START, position_m=(7e6, 0.0, 0.0), velocity_m_s=(0.0, 12e3, 1e3))

    class Lost:
        def states(self, epochs):
            return BodyState(np.full((len(epochs), 3), np.nan), np.full((len(epochs), 3), np.nan))

    found = screen(fast, [FOLLOWER, Lost()], START, SPAN_S, 500e3)
    assert ("object 2", "has no state in the span (its states are not finite)") in found.rejected
    compare_with_grid(found, [FOLLOWER], fast, within_m=500e3)


def test_pieces_end_where_the_states_do(gappy):
    pieces, gaps = find_pieces(gappy[0], 0, START, SPAN_S, 300.0)
    edges = list(itertools.chain.from_iterable((piece.from_s, piece.to_s) for piece in pieces))
    # the table ends with the last row of each segment, a multiple of its minute
    assert edges == pytest.approx([600.0, 9000.0, 12_345.0, 12_345.0 + 127 * 60.0], abs=1e-3)
    assert len(gaps) == 3


def test_a_tle_motion_is_a_trajectory_too():
    found = screen(Tle(file="tle/flyby.tle", name="FOLLOWER (SYNTHETIC)"), [FOLLOWER], START, 3600.0, 1e6)
    assert found.follower.several.tolist() == [False]


@pytest.mark.parametrize("step_s", [300.0, 600.0])
def test_an_encounter_that_the_cubic_misses_is_found_by_its_measured_error(step_s):
    """A perigee of e = 0.727 half a metre above a circle, limit 20 m, wherever the grid falls.

    The cubic errs by h^4 / 384 times the difference of the fourth derivatives, 3 e mu^2 / r^5 along r: 0.5 km for 300 s.
    """
    radius_m, e = 6.647e6, 0.727
    speed_m_s = float(np.sqrt(units.EARTH_GM_M3_S2 / radius_m))
    assert 3.0 * e * units.EARTH_GM_M3_S2**2 / radius_m**5 * step_s**4 / 384.0 > 500.0  # m: far outside the limit
    for phase in (0.0, 0.2, 0.45, 0.5, 0.7):
        meet_s = (2.0 + phase) * step_s
        at = {"epoch_utc": START + datetime.timedelta(seconds=meet_s)}
        circle = State(position_m=(radius_m, 0.0, 0.0), velocity_m_s=(0.0, speed_m_s, 0.0), **at)
        fast = (0.0, speed_m_s * float(np.sqrt(1.0 + e)), 0.0)
        transfer = State(position_m=(radius_m + 0.5, 0.0, 0.0), velocity_m_s=fast, **at)
        (stay,) = screen(circle, [transfer], START, 5.0 * step_s, 20.0, step_s).approaches
        assert stay.time_s == pytest.approx(meet_s, abs=2e-3)
        assert stay.range_m < 1.0

"""No state beyond a decay, on either side of the epoch; and no state less of a set that does not decay."""

import datetime

import numpy as np
import pytest
from sgp4.earth_gravity import wgs72
from sgp4.model import Satrec
from sgp4.propagation import sgp4init

from rso_lidar.errors import PropagationError
from rso_lidar.orbit import Catalog, ElementSet, Epochs, Fleet, SetSequence, propagate_sgp4, screen, screen_pairs
from rso_lidar.orbit.sets.decay import _SECULAR, DecayTimes, _RadiusBounds
from rso_lidar.orbit.sets.teme import MOST_AGE_S, find_decay_times, propagate_in_teme

UTC = datetime.UTC
DAY_S = 86_400.0
EPOCH = datetime.datetime(2026, 4, 30, 12, tzinfo=UTC)
DENSE_STEP_S = 30.0
DAYS = 40.0


def make_set(turns, e, bstar, inclination=98.5, perigee=160.0):
    return ElementSet(
        name="BODY",
        norad_id=90001,
        epoch_utc=EPOCH,
        mean_motion_rev_day=turns,
        eccentricity=e,
        inclination_deg=inclination,
        raan_deg=111.56,
        argument_of_perigee_deg=perigee,
        mean_anomaly_deg=200.0,
        bstar_per_earth_radius=bstar,
    )


HIGH_DRAG = make_set(15.92, 0.0014, 0.04)  # decays on day 1, and SGP4 has states again from day 4.3
ORDINARY = make_set(15.85, 0.0010, 0.006)  # 310 km: decays within weeks
ECCENTRIC = make_set(8.0, 0.38, 0.05)  # fails at its perigees alone at first, for minutes in three hours
DEEP = make_set(2.26, 0.734, 0.05, inclination=27.0)  # a transfer orbit
GHOSTS = [HIGH_DRAG, ORDINARY, ECCENTRIC, DEEP]


def first_failure_s(elements, sign):
    """Return when SGP4 itself first has no state, on a dense grid, by its library alone."""
    model = elements.satrec()
    time_s = np.arange(0.0, DAYS * DAY_S, DENSE_STEP_S)
    shift = sign * time_s / DAY_S
    error, _, _ = model.sgp4_array(np.full(shift.shape, model.jdsatepoch), model.jdsatepochF + shift)
    bad = np.isin(error, (1, 2, 4, 6))
    return (float(time_s[np.argmax(bad)]) if bad.any() else np.inf), error


@pytest.mark.parametrize("sign", [1.0, -1.0], ids=["after", "before"])
@pytest.mark.parametrize("elements", GHOSTS, ids=["high_drag", "ordinary", "eccentric", "deep"])
def test_no_state_lies_beyond_the_first_failure_of_sgp4(elements, sign):
    dense_s, _ = first_failure_s(elements, sign)
    time_s = sign * np.arange(0.0, DAYS * DAY_S, DENSE_STEP_S)
    ours = Fleet([elements], EPOCH).grid(np.zeros(1, int), time_s)
    kept = np.isfinite(ours[0][0, :, 0])
    first = int(np.argmax(~kept))
    assert not kept[first:].any()
    # the refined search finds failures between two instants of the grid; none is found before a revolution that has one
    assert dense_s - 2.0 * DAY_S / elements.mean_motion_rev_day < abs(time_s[first]) <= dense_s
    assert (ours[2][0, first:] != 0).all()


def test_the_states_after_a_decay_would_look_like_an_orbit():
    """Otherwise the tests above would show nothing: SGP4 itself has states of each set beyond its decay."""
    for elements in GHOSTS:
        decay_s, error = first_failure_s(elements, 1.0)
        assert (error[int(decay_s / DENSE_STEP_S) :] == 0).any()


def test_all_ways_to_a_state_say_the_same():
    day_s = np.array([-3.0, -1.0, 0.0, 1.0, 2.0, 5.0]) * DAY_S
    epochs = Epochs(EPOCH, day_s)
    bad = [True, False, False, False, True, True]
    fleet = Fleet([HIGH_DRAG, make_set(14.2, 0.001, 1e-5)], EPOCH)
    position, _, error = fleet.grid(np.array([1, 0]), day_s)
    assert np.isnan(position[..., 0]).tolist() == [[False] * 6, bad]
    assert error[1].tolist() == [6, 0, 0, 0, 6, 6]
    assert np.isnan(fleet.at(np.zeros(6, int), day_s)[0][:, 0]).tolist() == bad
    assert (propagate_in_teme(HIGH_DRAG, epochs)[2] != 0).tolist() == bad
    for ask in (lambda: propagate_sgp4(HIGH_DRAG, epochs), lambda: SetSequence((HIGH_DRAG,)).states(epochs)):
        with pytest.raises(
            PropagationError, match=r"SGP4 error 6, and has no state before 2026-04-28T18:52:49"
        ) as caught:
            ask()
        assert caught.value.bad.tolist() == bad
    with pytest.raises(
        PropagationError, match=r"has decayed .*, SGP4 error 6, by 2026-05-01T14:33:54.330Z; use epochs"
    ):
        propagate_sgp4(HIGH_DRAG, Epochs(EPOCH, day_s[3:]))
    assert "by 2026-05-01T14:33:54.330Z (elements of 2026-04-30T12:00Z)" in fleet.describe_loss(0, 5.0 * DAY_S, 6)[1]


def test_the_decay_is_found_to_the_millisecond():
    decay_s = find_decay_times(HIGH_DRAG)
    propagate_in_teme(HIGH_DRAG, Epochs(EPOCH, np.array([2.0 * DAY_S])))
    at_s = decay_s.since_epoch_s(0, 1.0)
    radius_m = np.linalg.norm(
        propagate_in_teme(HIGH_DRAG, Epochs(EPOCH, np.array([at_s - 1e-3, at_s + 1e-3])))[0], axis=1
    )
    np.testing.assert_allclose(radius_m, 6_378_135.0, atol=1.0)  # WGS72; it falls by some 100 m/s here
    assert radius_m[0] > 6_378_135.0 > radius_m[1]


def test_screening_finds_no_ghost():
    """On day 4.31 SGP4 puts the decayed set among low orbits again; a follower through that point meets nothing."""
    start = EPOCH + datetime.timedelta(days=4.25)
    ghosts = HIGH_DRAG.satrec()
    days = np.linspace(4.25, 4.75, 2000)
    error, position_km, _ = ghosts.sgp4_array(np.full(2000, ghosts.jdsatepoch), ghosts.jdsatepochF + days)
    low = (error == 0) & (np.linalg.norm(position_km, axis=1) < 8000.0)
    assert low.any()
    others = [make_set(14.2, 0.001, 1e-5)]
    found = screen(others[0], [HIGH_DRAG], start, 0.5 * DAY_S, 20e6)
    assert (found.approaches, [label for label, _ in found.rejected]) == ((), [HIGH_DRAG.label])
    pairs = screen_pairs([HIGH_DRAG, *others], start, 0.5 * DAY_S, 20e6)
    assert (pairs.approaches, [label for label, _ in pairs.rejected]) == ((), [HIGH_DRAG.label])
    with pytest.raises(PropagationError, match=r"follower BODY .*SGP4 has no state at .* by 2026-05-01T14:33:54"):
        screen(HIGH_DRAG, others, start, 0.5 * DAY_S, 20e6)


def test_coefficients_are_those_of_the_library():
    """The sgp4 package's version in Python keeps the coefficients of sgp4init, the compiled one does not."""
    sets = [HIGH_DRAG, make_set(15.2, 0.02, 2e-4), make_set(13.0, 0.08, -1e-4, 51.6), make_set(16.2, 0.002, 1e-3), DEEP]
    bounds = _RadiusBounds([entry.satrec() for entry in sets])
    for k, entry in enumerate(sets):
        compiled, model = entry.satrec(), Satrec()
        sgp4init(
            wgs72, "i", 1, compiled.jdsatepoch + compiled.jdsatepochF - 2_433_281.5, compiled.bstar, 0.0, 0.0, compiled.ecco,
            compiled.argpo, compiled.inclo, compiled.mo, compiled.no_kozai, compiled.nodeo, model,
        )  # fmt: skip
        swing = 0.0 if model.isimp else model.bstar * model.cc5
        want = [model.cc1, model.d2, model.d3, model.d4, model.bstar * model.cc4, abs(swing)]
        got = [*bounds.polynomial[:, k], bounds.rate[k], 0.5 * (bounds.swing[1, k] - bounds.swing[0, k])]
        np.testing.assert_allclose(got, want, rtol=1e-12)
    assert abs(model.dedt) <= bounds.lunisolar[-1] * _SECULAR


def test_a_catalogue_loses_no_state_of_a_set_that_does_not_decay(shared):
    catalog = Catalog.from_file(shared / "tle" / "catalogs" / "celestrak_active_2019-07-30.tle")
    fleet = Fleet(catalog.sets, datetime.datetime(2019, 7, 30, tzinfo=UTC))
    which, time_s = np.arange(len(fleet)), np.linspace(-7.0, 7.0, 29) * DAY_S
    ours = np.isfinite(fleet.grid(which, time_s)[0][..., 0])
    fleet._decays = DecayTimes(fleet.sets, fleet._models, MOST_AGE_S)
    fleet._decays.mark = lambda *_: None
    without = np.isfinite(fleet.grid(which, time_s)[0][..., 0])
    assert without[~ours].sum() == 0
    assert without.sum() == 64_491


def test_sets_without_drag_keep_their_states_between_perigees_below_the_ground():
    deep = make_set(2.26, 0.7440, 0.0, inclination=27.0)  # its perigee is 6280 km from the centre
    error = propagate_in_teme(deep, Epochs(EPOCH, np.linspace(-2.0, 2.0, 2000) * DAY_S))[2]
    codes, count = np.unique(error, return_counts=True)
    assert codes.tolist() == [0, 6]
    assert count[0] > 1900

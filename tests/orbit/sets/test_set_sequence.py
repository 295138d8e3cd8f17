"""One trajectory from many element sets: which set holds when, and how far it jumps."""

import datetime

import numpy as np
import pytest

from rso_lidar.errors import CatalogError, PropagationError, RsoLidarWarning
from rso_lidar.orbit import Catalog, Epochs, SetSequence, Tle, propagate_sgp4
from rso_lidar.orbit.sets.formats import parse_lines
from rso_lidar.orbit.sets.tle_text import compute_checksum

UTC = datetime.UTC
# CelesTrak: TerraSAR-X; the later sets are made of it, 0.001 degree, about 120 m, ahead each.
LINES = (
    "1 31698U 07026A   26074.00000000  .00001102  00000+0  55648-4 0  999",
    "2 31698  97.4465  83.5666 0001759  83.5600 276.5835 15.00000000 3900",
)
EPOCH = datetime.datetime(2026, 3, 15, tzinfo=UTC)


def made(day, anomaly_deg, line1=LINES[0], line2=LINES[1]):
    pair = line1.replace("26074", f"26{day:03d}"), line2.replace("276.5835", f"{anomaly_deg:8.4f}")
    return [f"{line}{compute_checksum(line)}" for line in pair]


def sets():
    lines = [line for k in (2, 0, 1) for line in made(74 + k, 276.5835 + 0.001 * k)]
    return tuple(parse_lines(lines, "here"))


def test_the_nearest_set_holds():
    trajectory = SetSequence(sets())
    assert [entry.epoch_utc.day for entry in trajectory.sets] == [15, 16, 17]
    at_s = np.array([-1e5, 0.0, 43199.0, 43201.0, 86400.0, 129599.0, 129601.0, 3e5])
    assert trajectory.which(Epochs(EPOCH, at_s)).tolist() == [0, 0, 0, 1, 1, 1, 2, 2]
    with pytest.warns(RsoLidarWarning, match="switches element sets 2 times"):
        state = trajectory.states(Epochs(EPOCH, at_s))
    for k, which in enumerate([0, 0, 0, 1, 1, 1, 2, 2]):
        alone = propagate_sgp4(trajectory.sets[which], Epochs(EPOCH, at_s[k : k + 1]))
        np.testing.assert_array_equal(state.position_m[k], alone.position_m[0])
        np.testing.assert_array_equal(state.velocity_m_s[k], alone.velocity_m_s[0])


def test_jumps_are_the_difference_of_two_sets():
    trajectory = SetSequence(sets())
    jumps = trajectory.jumps()
    assert [jump.at_utc for jump in jumps] == [EPOCH + datetime.timedelta(days=0.5 + k) for k in (0, 1)]
    for k, jump in enumerate(jumps):
        at = Epochs(jump.at_utc, np.zeros(1))
        before, after = (propagate_sgp4(trajectory.sets[k + m], at) for m in (0, 1))
        assert jump.position_m == pytest.approx(np.linalg.norm(after.position_m - before.position_m), abs=1e-6)
        assert jump.velocity_m_s == pytest.approx(np.linalg.norm(after.velocity_m_s - before.velocity_m_s), abs=1e-9)
    with pytest.warns(
        RsoLidarWarning, match=r"switches element sets once in this span, the largest jump \d+ m"
    ) as caught:
        trajectory.states(Epochs(EPOCH, np.array([0.0, 60000.0])))
    assert f"{jumps[0].position_m:.0f} m and {jumps[0].velocity_m_s:.2f} m/s at 2026-03-15T12:00:00Z" in str(
        caught[0].message
    )
    trajectory.states(Epochs(EPOCH, np.array([0.0, 43199.0])))  # no switch, no warning
    assert trajectory.jumps(Epochs(EPOCH, np.array([0.0, 43199.0]))) == ()


def test_age_is_that_of_the_nearest_set():
    trajectory = SetSequence(sets())
    np.testing.assert_allclose(trajectory.ages_days(Epochs(EPOCH, np.array([-86400.0, 86400.0 * 0.75]))), [1.0, 0.25])
    with pytest.warns(RsoLidarWarning, match=r"propagated 8\.0 days from its epoch 2026-03-17"):
        trajectory.states(Epochs(EPOCH, np.array([10 * 86400.0])))


def test_what_makes_no_trajectory():
    other = parse_lines(made(74, 0.0, *(line.replace("31698", "31699") for line in LINES)), "here")
    with pytest.raises(CatalogError, match="choose the sets of one object"):
        SetSequence((*sets(), *other))
    with pytest.raises(CatalogError, match="at least one"):
        SetSequence(())
    broken = parse_lines((made(74, 0.0)[0], made(74, 0.0)[1][:-1]), "here")
    with pytest.raises(CatalogError, match="is truncated"):
        SetSequence(tuple(broken))


def test_a_failing_set_of_several_is_named():
    doomed = made(76, 100.0, LINES[0].replace("55648-4", "99999+0"), LINES[1].replace("15.0000", "16.4000"))
    trajectory = SetSequence((*sets()[1:], *parse_lines(doomed, "here")))
    epochs = Epochs(EPOCH, np.array([0.0, 86400.0, 1.9e5, 2.5e5]))
    with pytest.raises(PropagationError, match=r"31698.*2026-03-17T00:00Z") as caught:
        trajectory.states(epochs)
    assert caught.value.bad.tolist() == [False, False, True, True]


def test_a_real_series(shared):
    path = shared / "tle" / "pairs" / "terrasarx_tandemx_2026.tle"
    catalog = Catalog.from_file(path)
    trajectory = catalog.trajectory("terrasar-x")
    assert len(trajectory.sets) == len(catalog.objects()[31698]) == 58
    jumps = trajectory.jumps()
    assert len(jumps) == 57
    # element sets of a low satellite, a day apart, agree to a kilometre or two (the folder's README: errors of that order)
    assert 1.0 < np.median([jump.position_m for jump in jumps]) < 2000.0
    start = datetime.datetime(2026, 4, 1, tzinfo=UTC)
    part = Tle(file=str(path), name="TERRASAR-X", sets="all")
    epochs = Epochs(start, np.arange(0.0, 2 * 86400.0, 600.0))
    with pytest.warns(RsoLidarWarning, match="TERRASAR-X .* switches element sets"):
        flown = part.states(epochs)
    assert part.epoch_age_days(epochs) < 2.0
    assert len(part.jumps(epochs)) >= 1
    inline = part.inline(start)
    assert len(inline.lines) == 116
    with pytest.warns(RsoLidarWarning):
        again = inline.states(epochs)
    np.testing.assert_array_equal(again.position_m, flown.position_m)

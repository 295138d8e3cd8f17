"""The TLE motion as a part: sources, warnings, errors, and bits that do not depend on the company."""

import datetime

import numpy as np
import pytest

from rso_lidar.errors import CatalogError, PropagationError, RsoLidarWarning, ScenarioError
from rso_lidar.orbit import Epochs, Fleet, Tle, gcrs_from_teme
from rso_lidar.orbit.sets.teme import TOO_OLD

# CelesTrak: TerraSAR-X. A rocket body of Vallado's verification set decays within a day.
LOW = (
    "1 31698U 07026A   26074.52702793  .00001102  00000+0  55648-4 0  9991",
    "2 31698  97.4465  83.5666 0001759  83.5600 276.5835 15.19149353 39001",
)
MOLNIYA = (  # SGP4-VER.TLE, 12 h resonant
    "1 08195U 75081A   06176.33215444  .00000099  00000-0  11873-3 0   813",
    "2 08195  64.1586 279.0717 6877146 264.7651  20.2257  2.00491383225656",
)
DECAYING = (  # SGP4-VER.TLE: "Sub-orbital case - Decayed 2005-11-29 (perigee = -51km), lost in 50 minutes"
    "1 28872U 05037B   05333.02012661  .25992681  00000-0  24476-3 0  1534",
    "2 28872  96.4736 157.9986 0303955 244.0492 110.6523 16.46015938 10708",
)
START = datetime.datetime(2026, 3, 15, 12, tzinfo=datetime.UTC)


def test_exactly_one_source():
    for fields in ({}, {"file": "a.tle", "lines": LOW}):
        with pytest.raises(ScenarioError, match="exactly one of file and lines"):
            Tle(**fields)


def test_inline_lines_are_checked_when_built():
    with pytest.raises(ScenarioError, match="lines: line 2: wrong checksum"):
        Tle(lines=(LOW[0], LOW[1][:-1] + "5"))
    with pytest.raises(ScenarioError, match="lines: line"):
        Tle(lines=(LOW[1], LOW[0]))
    with pytest.raises(ScenarioError, match="are of NORAD 31698, not 5"):
        Tle(lines=LOW, norad_id=5)


def test_inline_keeps_the_motion(tmp_path):
    path = tmp_path / "one.tle"
    path.write_text("\n".join(["TERRASAR-X", *LOW]))
    part = Tle(file=str(path), name="terrasar-x")
    inline = part.inline(START)
    assert inline.file is None
    assert inline.lines == LOW
    assert inline.name == "TERRASAR-X"
    assert inline.inline(START) is inline
    epochs = Epochs(START, np.arange(0.0, 6000.0, 600.0))
    np.testing.assert_array_equal(part.states(epochs).position_m, inline.states(epochs).position_m)
    assert inline.elements().label == "TERRASAR-X (NORAD 31698)"
    assert Tle(file="one.tle").elements(folder=tmp_path).line1 == LOW[0]


def test_missing_file_names_the_path_as_written():
    with pytest.raises(CatalogError, match=r"^nowhere/x\.tle: no such file, looked for in .* shipped data") as caught:
        Tle(file="nowhere/x.tle").elements()
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("lines", [LOW, MOLNIYA])
def test_a_state_is_the_same_bits_in_any_company(lines):
    part = Tle(lines=lines)
    start = part.elements().epoch_utc + datetime.timedelta(minutes=7)
    epochs = Epochs(start, np.linspace(0.0, 2.5e5, 403))  # crosses several whole hours and days
    together = part.states(epochs)
    for k in (0, 5, 6, 7, 8, 200, 401, 402):
        alone = part.states(epochs.at(k))
        np.testing.assert_array_equal(alone.position_m[0], together.position_m[k])
        np.testing.assert_array_equal(alone.velocity_m_s[0], together.velocity_m_s[k])
    back = part.states(epochs.at(slice(None, None, -3)))
    np.testing.assert_array_equal(back.position_m, together.position_m[::-3])


def test_rotation_is_a_rotation():
    matrices = gcrs_from_teme(Epochs(START, np.linspace(0.0, 1e7, 1001)))
    # skyfield's frame bias is of first order: its angles, 8e-8 rad, leave their squares, 6e-15
    product = np.einsum("nij,nkj->nik", matrices, matrices)
    np.testing.assert_allclose(product, np.broadcast_to(np.eye(3), product.shape), rtol=0, atol=1e-14)
    assert gcrs_from_teme(Epochs(START, np.zeros(0))).shape == (0, 3, 3)


def test_velocity_is_the_slope_of_position():
    # SGP4's velocity leaves out small rates of its periodic terms: some cm/s of 7.6 km/s (Vallado 2006, 3.D)
    epochs = Epochs(START, np.arange(0.0, 6000.0, 60.0))
    part = Tle(lines=LOW)
    ahead, behind = (part.states(epochs.shift(h)).position_m for h in (0.5, -0.5))
    assert np.abs(ahead - behind - part.states(epochs).velocity_m_s).max() < 0.1


def test_decay_raises_with_the_mask():
    part = Tle(lines=DECAYING, name="MINOTAUR R/B")
    start = part.elements().epoch_utc
    epochs = Epochs(start, np.arange(0.0, 61.0 * 60.0, 300.0))
    with pytest.raises(
        PropagationError, match=r"tle MINOTAUR R/B \(NORAD 28872\): SGP4 has no state at .* time_s = "
    ) as caught:
        part.states(epochs)
    bad = caught.value.bad
    assert bad.shape == (len(epochs),)
    np.testing.assert_array_equal(np.flatnonzero(bad), [11, 12])  # 50 minutes are well, 55 and 60 are not
    first = int(np.argmax(bad))
    assert f"time_s = {epochs.time_s[first]:g}: it has decayed (its distance is less than the Earth's radius)" in str(
        caught.value
    )
    assert "\n" not in str(caught.value)
    part.states(epochs.at(~bad))  # the others have states


def test_stale_elements_warn_and_are_flown():
    part = Tle(lines=LOW)
    epoch = part.elements().epoch_utc
    fresh = Epochs(epoch, np.array([0.0, 7.0 * 86400.0]))
    assert part.epoch_age_days(fresh) == 7.0
    part.states(fresh)
    stale = Epochs(epoch - datetime.timedelta(days=8), np.array([0.0, 10.0]))
    assert part.epoch_age_days(stale) == pytest.approx(8.0, abs=1e-12)
    with pytest.warns(RsoLidarWarning, match=r"NORAD 31698: propagated 8\.0 days"):
        part.states(stale)


def test_a_leap_second_does_not_move_the_satellite():
    # 2016-12-31 had one; SGP4 subtracts UTC dates, so counting it would shift a low satellite by 7.6 km
    line1 = "1 31698U 07026A   16366.50000000  .00001102  00000+0  55648-4 0  9990"
    part = Tle(lines=(line1[:68] + str(_sum(line1)), LOW[1]))
    epochs = Epochs(datetime.datetime(2016, 12, 31, 23, 59, 55, tzinfo=datetime.UTC), np.arange(0.0, 10.0, 0.5))
    state = part.states(epochs)
    middle = 0.5 * (state.velocity_m_s[1:] + state.velocity_m_s[:-1])
    # half a second at SGP4's velocity, some cm/s coarse: see above
    np.testing.assert_allclose(np.diff(state.position_m, axis=0), 0.5 * middle, rtol=0, atol=0.05)


def _sum(line):
    return sum(int(c) if c.isdigit() else c == "-" for c in line[:68]) % 10


def test_a_set_whose_drag_threw_it_off_is_refused():
    """SGP4 reports no error for these: a decayed satellite, years after, is billions of kilometres away."""
    import math

    from sgp4.api import WGS72, Satrec, jday
    from sgp4.exporter import export_tle

    jd, fraction = jday(2020, 1, 1, 0, 0, 0)
    satellite = Satrec()
    turns = 16.3 * 2.0 * math.pi / 1440.0
    satellite.sgp4init(WGS72, "i", 99009, jd + fraction - 2433281.5, 0.99999, 0, 0, 1e-3, 0.1, 0.9, 0.1, turns, 0.1)
    satellite.classification, satellite.intldesg, satellite.elnum, satellite.revnum = "U", "20001A", 1, 1
    satellite.ephtype = 0
    tle = Tle(lines=tuple(export_tle(satellite)))
    epochs = Epochs(datetime.datetime(2024, 1, 1, tzinfo=datetime.UTC), np.array([0.0, 60.0]))
    with pytest.warns(RsoLidarWarning), pytest.raises(PropagationError, match=r"99009.*epoch") as caught:
        tle.states(epochs)
    assert caught.value.bad.tolist() == [True, True]


FIVE_YEARS_S = 5.0 * 365.25 * 86400.0  # the limit that docs/orbits.md says


@pytest.mark.parametrize("sets", ["nearest", "all"])
def test_a_set_far_from_its_epoch_is_refused(sets):
    """Near the limit a set is flown with a warning, beyond it before or after there is no state."""
    part = Tle(lines=LOW, sets=sets)
    epoch = part.elements().epoch_utc
    for sign in (1.0, -1.0):
        time_s = sign * np.array([0.0, FIVE_YEARS_S - 1.0, FIVE_YEARS_S + 1.0])
        with pytest.warns(RsoLidarWarning, match=r"propagated 1826\.2 days"):
            part.states(Epochs(epoch, time_s[:2]))
        with pytest.raises(
            PropagationError, match=r"31698.* at 1 of 3 epochs.*more than 5 years from the epoch"
        ) as caught:
            part.states(Epochs(epoch, time_s))
        assert caught.value.bad.tolist() == [False, False, True]
    with pytest.raises(PropagationError, match="more than 5 years from the epoch"):  # once 22,900 km and a mild word
        part.states(Epochs(epoch + datetime.timedelta(days=36525), np.zeros(1)))


def test_many_sets_far_from_their_epochs_have_no_states():
    part = Tle(lines=LOW)
    epochs = Epochs(part.elements().epoch_utc, np.array([FIVE_YEARS_S - 1.0, FIVE_YEARS_S + 1.0]))
    fleet = Fleet([part.elements()] * 2, epochs.start_utc)
    position, _, error = fleet.grid(np.array([0, 1]), epochs.time_s)
    assert np.isnan(position[:, :, 0]).tolist() == [[False, True]] * 2
    assert error.tolist() == [[0, TOO_OLD]] * 2
    assert np.isnan(fleet.at(np.array([0, 1]), epochs.time_s)[0][:, 0]).tolist() == [False, True]

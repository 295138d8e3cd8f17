import datetime

import numpy as np
import pytest

from rso_lidar import units
from rso_lidar.errors import PropagationError, ScenarioError
from rso_lidar.orbit import EarthOrientation, Epochs, convert_states, itrs_from_gcrs
from rso_lidar.records import BodyState
from tests.orbit.earth.earth_for_tests import finals


def written(tmp_path, text):
    path = tmp_path / "finals2000A.all"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_published_reduction_with_polar_motion(tmp_path):
    # Vallado, Fundamentals of Astrodynamics and Applications, 4th ed., examples 3-14 and 3-15: 2004-04-06 07:51:28.386009
    # UTC. The celestial pole's offsets (0.2 mas), which are left out, and the printed digits are worth 1 cm.
    path = written(tmp_path, finals(range(53100, 53104), -0.140682, 0.333309, -0.4399619))
    epochs = Epochs(datetime.datetime(2004, 4, 6, 7, 51, 28, 386009, tzinfo=datetime.UTC), np.zeros(1))
    inertial = BodyState(
        1e3 * np.array([[5102.5089580, 6123.0114007, 6378.1369282]]),
        1e3 * np.array([[-4.7432201567, 0.7905364974, 5.5337557274]]),
    )
    orientation = EarthOrientation.from_file(path)
    fixed = convert_states(inertial, epochs, to_axes="itrs", orientation=orientation)
    np.testing.assert_allclose(
        fixed.position_m, 1e3 * np.array([[-1033.4793830, 7901.2952754, 6380.3565958]]), atol=0.02
    )
    np.testing.assert_allclose(
        fixed.velocity_m_s, 1e3 * np.array([[-3.225636520, -2.872451450, 5.531924446]]), atol=2e-4
    )
    back = convert_states(fixed, epochs, from_axes="itrs", orientation=orientation)
    np.testing.assert_allclose(back.position_m, inertial.position_m, rtol=0, atol=1e-7)
    np.testing.assert_allclose(back.velocity_m_s, inertial.velocity_m_s, rtol=0, atol=1e-9)


def test_it_is_skyfields_rotation_over_a_leap_second(tmp_path):
    from skyfield.data import iers
    from skyfield.framelib import itrs
    from skyfield.timelib import Timescale

    lines = [
        finals([day], 0.1 + 1e-3 * k, 0.4 - 2e-3 * k, -0.4 - 1e-3 * k) for k, day in enumerate(range(57740, 57754))
    ]
    after = [
        finals([day], 0.114 + 1e-3 * k, 0.372 - 2e-3 * k, 0.586 - 1e-3 * k) for k, day in enumerate(range(57754, 57770))
    ]
    path = written(tmp_path, "".join(lines + after))  # UT1 - UTC jumps by a second on 2017-01-01, MJD 57754
    orientation = EarthOrientation.from_file(path)
    epochs = Epochs(datetime.datetime(2016, 12, 28, tzinfo=datetime.UTC), np.linspace(0.0, 8 * 86400.0, 29))
    with path.open("rb") as file:
        table = iers.parse_x_y_dut1_from_finals_all(file)
    built_in = epochs.skyfield_time().ts
    scale = Timescale(
        (iers.build_timescale_arrays(table["utc_mjd"], table["dut1"])[0] + 24.0 / 86400.0,  # it counts leaps from 1973
         epochs_delta_t(table, built_in)), built_in.leap_dates, built_in.leap_offsets,
    )  # fmt: skip
    iers.install_polar_motion_table(scale, table)
    time = epochs.skyfield_time()
    other = itrs.rotation_at(scale.tt_jd(time.whole, time.tt_fraction)).transpose(2, 0, 1)
    np.testing.assert_allclose(itrs_from_gcrs(epochs, orientation), other, rtol=0, atol=5e-13)
    assert np.abs(itrs_from_gcrs(epochs) - other).max() > 1e-7  # 0.3 arcsecond of polar motion


def epochs_delta_t(table, scale):
    """Return TT - UT1 [s] at the days of a table."""
    whole = table["utc_mjd"] + 2400000.5
    leap = scale.leap_offsets[np.searchsorted(scale.leap_dates, whole, side="right") - 1]
    return 32.184 + leap - table["dut1"]


def test_without_it_the_error_is_what_is_said(tmp_path):
    from rso_lidar.orbit.earth.earth_orientation import UNCERTAINTY_WITHOUT_RAD

    epochs = Epochs(datetime.datetime(2024, 9, 17, tzinfo=datetime.UTC), np.zeros(1))
    late_s = float(epochs.skyfield_time().dut1[0]) + 0.02  # a prediction that is 20 ms off
    path = written(tmp_path, finals(range(60570, 60580), 0.25, 0.45, late_s))
    change = np.abs(itrs_from_gcrs(epochs, EarthOrientation.from_file(path)) - itrs_from_gcrs(epochs)).max()
    assert 0.2 * units.ARCSEC < change < UNCERTAINTY_WITHOUT_RAD


def test_bad_files_are_one_line(tmp_path):
    good = finals(range(53100, 53104), 0.1, 0.3, -0.4)
    cases = {
        "": "has 0 days of Earth orientation",
        "hello\n" * 3: "MJD '' is not a number",
        finals([53100], 0.1, 0.3, -0.4): "has 1 days",
        good.replace("53102.00", "53302.00"): "does not follow the day before it",
        good.replace("53102.00", "53099.00"): "does not follow the day before it",
        good.replace(" 0.100000", " 9.100000"): "are no Earth orientation",
        good.replace("-0.4000000", "-0.4x00000"): "UT1-UTC '-0.4x00000' is not a number",
    }
    for text, message in cases.items():
        with pytest.raises(ScenarioError, match=message):
            EarthOrientation.from_file(written(tmp_path, text))
    with pytest.raises(ScenarioError, match="no such file"):
        EarthOrientation.from_file(tmp_path / "none")
    with pytest.raises(ScenarioError):
        EarthOrientation.from_file(tmp_path)
    late = Epochs(datetime.datetime(2004, 4, 6, tzinfo=datetime.UTC), np.array([0.0, 86400.0 * 30]))
    with pytest.raises(PropagationError, match=r"1 of 2 epochs, the first is 2004-05-06.*give a newer file") as caught:
        itrs_from_gcrs(late, EarthOrientation.from_file(written(tmp_path, good)))
    assert caught.value.bad.tolist() == [False, True]
    padded = good + f"{'':7}{53104:8.2f} \n" + f"{'':7}{53105:8.2f}{'':173}\n"  # days without a prediction follow
    assert len(EarthOrientation.from_file(written(tmp_path, good + padded[len(good) :][16:])).tai_s) == 4

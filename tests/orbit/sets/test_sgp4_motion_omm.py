"""The OMM as a part of a scenario, and element sets of every kind carried inline."""

import datetime
import json

import numpy as np
import pytest

from rso_lidar.errors import CatalogError, PropagationError, RsoLidarWarning, ScenarioError
from rso_lidar.orbit import Catalog, Epochs, Omm, Tle, propagate_sgp4

UTC = datetime.UTC
START = datetime.datetime(2026, 5, 7, tzinfo=UTC)
FIELDS = {  # made up: a low orbit
    "object_name": "STARLINK-9",
    "norad_id": 100123456,
    "epoch_utc": datetime.datetime(2026, 5, 7, 1, 2, 3, 123456, tzinfo=UTC),
    "mean_motion_rev_day": 15.06,
    "eccentricity": 0.0001,
    "inclination_deg": 53.0,
    "raan_deg": 10.0,
    "argument_of_perigee_deg": 20.0,
    "mean_anomaly_deg": 30.0,
    "bstar_per_earth_radius": 1e-4,
}
LOW = (
    "1 31698U 07026A   26074.52702793  .00001102  00000+0  55648-4 0  9991",
    "2 31698  97.4465  83.5666 0001759  83.5600 276.5835 15.19149353 39001",
)


def record(**changes):
    fields = Omm(**FIELDS).elements().omm()
    return {**fields, **changes}


def test_the_part_is_the_record(tmp_path):
    omm = Omm(**FIELDS)
    (read,) = Catalog.from_text(json.dumps(record()))
    assert Omm.of(read) == omm
    epochs = Epochs(START, np.arange(0.0, 86400.0, 600.0))
    np.testing.assert_array_equal(omm.states(epochs).position_m, propagate_sgp4(read, epochs).position_m)
    assert omm.epoch_age_days(epochs) == pytest.approx((85800 - 3723.123456) / 86400, abs=1e-12)
    # a = (GM / n^2)^(1/3) = 6924 km, within SGP4's 10 km of oscillation (J2)
    radius_km = np.linalg.norm(omm.states(epochs).position_m, axis=1) / 1e3
    assert np.abs(radius_km - 6924.0).max() < 12.0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"eccentricity": 1.0}, "eccentricity 1 is not from 0 to below 1; correct the message"),
        ({"mean_motion_rev_day": 0.0}, "mean motion 0 rev/day is not above 0"),
        ({"inclination_deg": -1.0}, "inclination -1 is not"),
        ({"norad_id": 10**9}, "norad_id"),
        ({"epoch_rest_ns": 1000.0}, "epoch_rest_ns"),
        ({"epoch_utc": datetime.datetime(2026, 1, 1)}, "without an offset"),
    ],
)
def test_what_cannot_be_flown_is_refused(change, message):
    with pytest.raises(ScenarioError, match=message):
        Omm(**{**FIELDS, **change})


def test_failures_and_age_are_told():
    epochs = Epochs(START + datetime.timedelta(days=30), np.array([0.0]))
    with pytest.warns(RsoLidarWarning, match=r"omm STARLINK-9 \(NORAD 100123456\): propagated 30\.0 days"):
        Omm(**FIELDS).states(epochs)
    doomed = Omm(**{**FIELDS, "mean_motion_rev_day": 17.4})
    with pytest.raises(PropagationError, match=r"omm STARLINK-9 .* it has decayed .*SGP4 error 6") as caught:
        doomed.states(Epochs(START, np.array([0.0, 60.0])))
    assert caught.value.bad.all()


def test_a_file_of_messages_is_carried_inline(tmp_path):
    path = tmp_path / "one.json"
    path.write_text(json.dumps([record(EPOCH="2026-05-07T01:02:03.123456789"), record(NORAD_CAT_ID=6)]))
    part = Tle(file=str(path), norad_id=100123456)
    inline = part.inline(START)
    assert type(inline) is Omm
    assert inline.epoch_rest_ns == 789.0
    epochs = Epochs(START, np.arange(0.0, 6000.0, 60.0))
    np.testing.assert_array_equal(inline.states(epochs).position_m, part.states(epochs).position_m)
    # written as TOML and read again it is the same part
    assert Omm(**inline.model_dump(exclude_none=True)) == inline


def test_all_sets_of_mixed_kinds_are_carried_inline(tmp_path):
    message = record(
        NORAD_CAT_ID=31698, OBJECT_NAME="T", EPOCH="2026-03-17T00:00:00", MEAN_MOTION=15.19, INCLINATION=97.4
    )
    lines = ["CCSDS_OMM_VERS = 2.0", *(f"{key} = {value}" for key, value in message.items()), "T", *LOW]
    path = tmp_path / "mixed.txt"
    path.write_text("\n".join(lines))
    part = Tle(file=str(path), name="T", sets="all")
    inline = part.inline(START)
    assert (inline.file, inline.lines, len(inline.messages), inline.sets) == (None, LOW, 1, "all")
    epochs = Epochs(datetime.datetime(2026, 3, 15, 12, tzinfo=UTC), np.arange(0.0, 2e5, 5000.0))
    with pytest.warns(RsoLidarWarning, match="NORAD 31698"):
        flown = inline.states(epochs), part.states(epochs)
    np.testing.assert_array_equal(flown[0].position_m, flown[1].position_m)
    assert Tle(**inline.model_dump(exclude_none=True)) == inline
    with pytest.raises(ScenarioError, match="exactly one of file and lines"):
        inline.replace(file="x.tle")
    with pytest.raises(ScenarioError, match="several objects"):
        Tle(lines=LOW, messages=(Omm(**FIELDS),))


def test_a_bad_set_of_the_object_is_left_out_and_told(tmp_path):
    path = tmp_path / "two.tle"
    bad = LOW[1][:-1] + "5"
    path.write_text("\n".join(["T", LOW[0].replace("26074", "26075"), bad, "T", *LOW]))
    start = datetime.datetime(2026, 3, 15, 12, tzinfo=UTC)
    with pytest.warns(RsoLidarWarning, match=r"1 of 2 element sets are left out, the first is .*wrong checksum"):
        assert Tle(file=str(path), sets="all").inline(start).lines == LOW
    path.write_text("\n".join(["T", LOW[0], bad]))
    with pytest.raises(CatalogError, match="wrong checksum"):
        Tle(file=str(path), sets="all").elements(start)

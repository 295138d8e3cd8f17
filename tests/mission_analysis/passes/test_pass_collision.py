"""Probability of collision of encounters: equal to that of a message, with its sources named, and a reason without it."""

import datetime
import json

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.errors import PropagationError, RsoLidarWarning, ScenarioError
from rso_lidar.mission_analysis.passes.covariance_sources import CovarianceSources
from rso_lidar.orbit import (
    Catalog,
    ConjunctionMessage,
    CovarianceHistory,
    Ephemeris,
    Epochs,
    NamedTrajectory,
    State,
    UncertainState,
    foster_probability,
    sample_collisions,
    write_oem,
)
from rso_lidar.shipped import shipped
from rso_lidar.study import SetErrorTable, assess_conjunction, encounters

FLYBY = shipped("tle/flyby.tle")
START = datetime.datetime(2024, 9, 17, 11, 50, tzinfo=datetime.UTC)
AGES = SetErrorTable("ages", np.array([0.0, 2.0]), np.array([[100.0, 300.0, 100.0], [200.0, 3000.0, 100.0]]))


def search(**more):
    return encounters(FLYBY, 99003, within_m=20e3, start_utc=START, days=0.02, **more)


def test_a_message_has_the_probability_of_its_encounter():
    """States and covariances of a CDM, flown as two bodies and searched for."""
    path = shipped("tle/flyby.cdm")
    message = ConjunctionMessage.from_file(path)
    flown = [
        NamedTrajectory(
            body.name,
            State(
                epoch_utc=message.tca_utc,
                position_m=tuple(body.position_m.tolist()),
                velocity_m_s=tuple(body.velocity_m_s.tolist()),
            ),
        )
        for body in (message.first, message.second)
    ]
    begin = message.tca_utc - datetime.timedelta(seconds=600)
    # the covariances hold at the message's instant; a millisecond beside it they are the same
    named = {body.name: AtOnce(path, key) for key, body in (("OBJECT1", message.first), ("OBJECT2", message.second))}
    rows = [
        encounters(order, None, within_m=5e3, start_utc=begin, days=0.014, radius_m=6.0, covariances=named).rows[0]
        for order in (flown, flown[::-1])
    ]
    known = assess_conjunction(message, 6.0, samples=0)
    assert rows[0].collision.collision_probability == pytest.approx(known.foster, rel=1e-4)
    assert rows[1].collision.collision_probability == pytest.approx(known.foster, rel=1e-4)  # the objects swapped
    assert rows[0].collision.integral_probability == pytest.approx(known.integral.probability, rel=1e-3)


def test_a_message_of_another_day_is_no_source_and_the_reason_says_what_to_give():
    catalog = Catalog.from_file(FLYBY)
    later = Epochs(START + datetime.timedelta(days=1), np.zeros(1))
    sources = CovarianceSources(shipped("tle/flyby.cdm"), list(catalog))
    state = catalog.trajectory(99003).states(later)
    with pytest.raises(PropagationError, match=r"23\.8 h from the closest approach; give one within 15 minutes of it$"):
        sources.find(catalog.objects()[99003], 1.0, later, state)


def test_an_ephemeris_keeps_its_name_where_its_covariance_is_read(tmp_path, monkeypatch):
    """Its warnings are the same text then, and are shown once."""
    monkeypatch.chdir(tmp_path)
    orbit, epochs = Catalog.from_file(FLYBY).trajectory(99003), Epochs(START, np.arange(0.0, 50.0, 5.0))
    history = CovarianceHistory.from_axes("OURS", orbit, epochs, np.tile(np.eye(6), (10, 1, 1)), "rtn")
    write_oem("a.oem", "OURS", "2024-002C", epochs, orbit.states(epochs), covariances=history)
    entry = NamedTrajectory("OURS", Ephemeris(file="a.oem"), source=str(tmp_path / "a.oem"))
    later = Epochs(START + datetime.timedelta(hours=3), np.zeros(1))
    with pytest.raises(PropagationError, match=r"^covariance of OURS \(a\.oem\) is"):
        CovarianceSources(None, [entry]).find(entry, np.nan, later, orbit.states(later))


class AtOnce:
    """The covariance of one object of a message, whatever the instant."""

    def __init__(self, path, key):
        self.matrix = rl.orbit.read_covariances(path, key).matrices[0]

    def at(self, epochs: Epochs):
        return np.repeat(self.matrix[None], len(epochs), axis=0)


def test_a_fast_encounter_of_the_search_is_that_of_monte_carlo():
    row = search(radius_m=100.0, covariances=[AGES]).rows[0]
    used = row.collision
    pair = []
    for state in row.states:
        turn = np.kron(np.eye(2), rl.orbit.rtn_matrix(state.position_m, state.velocity_m_s)[0])
        covariance = turn @ AGES.covariance_at(abs(row.age_days)) @ turn.T
        pair.append(UncertainState(state.position_m, state.velocity_m_s, covariance))
    assert used.foster_probability == pytest.approx(foster_probability(*pair, 100.0), rel=1e-9)
    drawn = sample_collisions(*pair, 100.0, rng=np.random.default_rng(1), samples=1_000_000)
    assert abs(used.collision_probability - drawn.probability) < 4.0 * drawn.standard_error + 1e-3 * drawn.probability


def test_radii_of_single_objects_and_models_are_added():
    used = (
        search(hard_bodies={99003: 2.0, "ROCKET BODY (SYNTHETIC)": "zenit_stage"}, covariances=[AGES]).rows[0].collision
    )
    assert used.hard_body_radius_m > 4.0 and used.hard_body_source.startswith("2 m + model zenit_stage")


def test_without_a_covariance_or_radius_the_reason_is_given(tmp_path):
    table = search(radius_m=6.0)
    assert not table.rows[0].collision.is_known
    assert "no covariance is known; give more of its element sets" in table.table()
    place = table.json(tmp_path / "a.json")
    row = json.loads(place.read_text(encoding="utf-8"))["encounters"][0]
    assert row["collision_probability"] is None and "no covariance is known" in row["collision_reason"]
    assert "no hard-body radius of" in search(covariances=[AGES]).table()
    assert search().rows[0].collision is None


def test_a_covariance_of_no_object_of_the_search_is_warned_of(tmp_path):
    orbit, epochs = Catalog.from_file(FLYBY).trajectory(99003), Epochs(START, np.arange(0.0, 50.0, 5.0))
    history = CovarianceHistory.from_axes("OTHER", orbit, epochs, np.tile(np.eye(6), (10, 1, 1)), "rtn")
    place = write_oem(tmp_path / "a.oem", "OTHER", "2024-002C", epochs, orbit.states(epochs), covariances=history)
    entry = NamedTrajectory("OURS", orbit)
    with pytest.warns(
        RsoLidarWarning, match=r"a\.oem is of other, not in the search, and is not used; write NAME=a\.oem"
    ):
        CovarianceSources([str(place)], [entry])
    CovarianceSources([("OURS", str(place))], [entry])


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"radius_m": 0.0}, "radius_m: 0.0 is not a hard-body radius"),
        ({"hard_bodies": {99003: "2"}}, "hard_bodies: 99003: '2' has no unit; write 2m, or a model"),
        ({"covariances": [("A", AGES), ("a", AGES)]}, "covariances: 'a' is given twice"),
        ({"hard_bodies": {"x": True}}, "hard_bodies: x: .True. is no radius"),
        ({"covariances": [3.0]}, "covariances: .3.0. is no source"),
    ],
)
def test_what_is_no_radius_and_no_source_is_refused(more, message):
    with pytest.raises(ScenarioError, match=message):
        search(**more)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("age_days,radial_m\n0,1\n", "has no column along_m, cross_m"),
        ("age_days,radial_m,along_m,cross_m\n0,1,x,1\n", "line 2: is no row of 4 numbers"),
        ("age_days,radial_m,along_m,cross_m\n1,1,1,1\n0,1,1,1\n", "age_days: do not increase"),
        ("age_days,radial_m,along_m,cross_m\n1,1,-1,1\n", "standard deviations need"),
        ("age_days,radial_m,along_m,cross_m\n", "has no rows"),
        ("age_days,radial_m,along_m,cross_m,radial_m\n1,1,1,1,9\n", "line 1: has a column twice"),
        ("age_days,radial_m,along_m,cross_m\n1,1,5,1,2\n", "line 2: has 5 cells under 4 heads"),
        ("age_days,radial_m,along_m,cross_m\n1,1e300,1,1\n", "1e\\+300 is no standard deviation"),
    ],
)
def test_tables_by_age_that_are_broken(tmp_path, text, message):
    place = tmp_path / "ages.csv"
    place.write_text(text, encoding="utf-8")
    with pytest.raises(ScenarioError, match=message):
        SetErrorTable.from_file(place)

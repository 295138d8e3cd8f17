"""A conjunction assessed: its geometry, both probabilities, what is noted, and the scenario that is written."""

import dataclasses
import re

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.errors import ScenarioError
from rso_lidar.orbit import ConjunctionMessage, Epochs
from rso_lidar.shipped import shipped
from rso_lidar.study import assess_conjunction, conjunction_scenario_text

TEXT = shipped("tle/flyby.cdm").read_text(encoding="ascii")


def assess(text, *arguments, **more):
    return assess_conjunction(ConjunctionMessage.from_text(text), *arguments, **{"samples": 0, **more})


def test_the_shipped_conjunction():
    found = assess_conjunction("tle/flyby.cdm", samples=100_000)
    assert found.miss_m == pytest.approx(120.0, abs=0.01)
    assert found.position_rtn_m == pytest.approx([40.0, 113.137, 0.0], abs=1e-3)
    assert found.speed_m_s == pytest.approx(2.0 * 7504.359 * np.sin(np.radians(0.095)), rel=1e-6)  # circular speeds
    assert (found.radius_m, found.radius_source) == (6.0, "HBR of the message")
    assert abs(found.monte_carlo.probability - found.foster) < 4.0 * found.monte_carlo.standard_error
    assert found.notes == ()
    assert "Pc by Foster     0.0008" in found.text()
    assert "100,000 draws" in found.text()


def test_a_covariance_in_square_kilometres_is_asked_about():
    small = re.sub(
        r"^(C[RTN](?:DOT)?_[RTN](?:DOT)? = )(\S+)",
        lambda found: f"{found[1]}{float(found[2]) * 1e-8:g}",
        TEXT,
        flags=re.MULTILINE,
    )
    sigma_m = np.sqrt(np.diag(assess(TEXT).first.covariance)[:3].max())
    notes = [note for note in assess(small).notes if "read in km instead of m" in note]
    assert len(notes) == 2
    assert (
        f"a sigma of {sigma_m * 1e-4:.4g} m and" in notes[0]
        and f"would be a sigma of {sigma_m / 10.0:.4g} m" in notes[0]
    )


def test_the_window_of_monte_carlo_is_the_users():
    own, set_ = (assess(TEXT, samples=2000, **more) for more in ({}, {"window_s": 90.0}))
    assert own.monte_carlo.window_s < 60.0 and own.notes == ()
    assert set_.monte_carlo.window_s == 90.0 and "within 90 s of the closest approach" in set_.text()
    assert "note: Monte Carlo searches minutes (90 s on each side)" in set_.text() and "a second one" in set_.text()


def test_the_radius_is_the_users_then_the_messages_then_that_of_areas():
    without = TEXT.replace("COMMENT HBR = 6 [m]\n", "")
    areas = without.replace("CATALOG_NAME = SATCAT", "AREA_PC = 12.566370614 [m**2]")  # pi 2^2: a disc of 2 m each
    assert assess(TEXT, 3.0).radius_source == "as given"
    assert assess(areas).radius_m == pytest.approx(4.0)
    unknown = assess(without)
    assert (unknown.radius_m, unknown.foster, unknown.monte_carlo) == (None, None, None)
    assert "no probability: no hard-body radius is given" in unknown.text()
    with pytest.raises(ScenarioError, match=r"^radius_m: -1 is not a hard-body radius"):
        assess(TEXT, -1)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("MISS_DISTANCE = 120 [m]", "MISS_DISTANCE = 150 [m]", "MISS_DISTANCE of the message is 150 m, but its states"),
        ("RELATIVE_SPEED = 25", "RELATIVE_SPEED = 2500", "RELATIVE_SPEED of the message is 2,500 m/s, but its states"),
        ("Y = 0.000000000", "Y = 0.500000000", "the states are closest"),
        ("Z = 0.000000000", "Z = 0.500000000", "the states are closest"),
        ("CRDOT_T = -5.400000e-01", "CRDOT_T = -5.400000e+00", "its 6 x 6 covariance is not positive semidefinite"),
    ],
)
def test_what_does_not_fit_is_noted(old, new, said):
    assert old in TEXT or "CRDOT_T" in old
    text = TEXT.replace(old, new, 1)
    if "CRDOT_T" in old:
        start = TEXT.index("CRDOT_T = ")
        text = TEXT[:start] + "CRDOT_T = -5.4e+01 [m**2/s]" + TEXT[TEXT.index("\n", start) :]
    assert any(said in note for note in assess(text).notes)


def test_a_covariance_of_no_distribution_is_refused_by_the_name_of_its_object():
    start = TEXT.index("CT_R = ")
    text = TEXT[:start] + "CT_R = 1e9 [m**2]" + TEXT[TEXT.index("\n", start) :]
    with pytest.raises(ScenarioError, match=r"^CDM: FOLLOWER .SYNTHETIC. .99003.: covariance: is not positive"):
        assess(text)


@pytest.mark.parametrize("follower", [1, 2])
def test_the_scenario_flies_past_at_the_miss_distance(follower):
    found = assess(TEXT)
    scenario = rl.Scenario.loads(conjunction_scenario_text(found, follower))
    name = ("rocket_body_synthetic", "follower_synthetic")[follower - 1]
    assert scenario.target[0].name == name
    since_s = (found.message.tca_utc - scenario.time.start_utc).total_seconds()
    epochs = Epochs(scenario.time.start_utc, np.array([since_s]))
    own, other = scenario.follower.motion.states(epochs), scenario.target[0].motion.states(epochs)
    assert np.linalg.norm(other.position_m - own.position_m) == pytest.approx(found.miss_m, abs=1e-4)
    assert 0.0 < since_s < scenario.time.duration_s


def test_which_object_and_equal_states():
    with pytest.raises(ScenarioError, match=r"^follower: 3: a conjunction has two objects"):
        conjunction_scenario_text(assess(TEXT), 3)
    lines = TEXT.splitlines()
    edge = lines.index("OBJECT = OBJECT2")
    first = {line.partition(" = ")[0]: line for line in lines[:edge]}
    same = [first[line.partition(" = ")[0]] if line[0] in "XYZ" else line for line in lines[edge:]]
    found = assess("\n".join([*lines[:edge], *same]))
    assert found.foster is None
    assert "none: no relative velocity" in found.text()
    with pytest.raises(ScenarioError, match=r"^conjunction: both states are equal"):
        conjunction_scenario_text(found)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda one: {"covariance_rtn": 1e-12 * one.covariance_rtn}, "the relative position is known to"),
        (lambda one: {"velocity_m_s": 2.0 * one.velocity_m_s}, "not on an ellipse"),
    ],
)
def test_without_an_integral_a_note_says_why(change, reason):
    message = ConjunctionMessage.from_text(TEXT)
    both = {
        name: dataclasses.replace(one, **change(one))
        for name in ("first", "second")
        for one in [getattr(message, name)]
    }
    found = assess_conjunction(dataclasses.replace(message, **both), samples=0)
    assert found.integral is None
    assert any(note.startswith("no Pc in 3-D: ") and reason in note for note in found.notes)

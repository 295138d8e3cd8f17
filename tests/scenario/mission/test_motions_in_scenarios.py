"""Every type of motion and attitude in a scenario's text: described, flown, and refused in one line that says where."""

import re

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.errors import RsoLidarError, ScenarioError
from tests.property.motions_for_tests import (
    ATTITUDES,
    KEPLER,
    MOTIONS,
    ORBITS,
    PLACES,
    RELATIVE,
    scenario_text,
    write_files,
)

HILL = RELATIVE["hill"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("scenarios")
    write_files(made)
    return made


@pytest.fixture
def load(folder):
    return lambda text: rl.Scenario.loads(text, folder=folder, where="one.toml", trust_code=True)


def refusal(load, text):
    """Return the one line with which a scenario is refused."""
    with pytest.raises(RsoLidarError) as error:
        load(text).describe()
    line = str(error.value)
    assert line.startswith("one.toml: ")
    assert "\n" not in line
    assert len(line) < 500  # the list of all types of motion takes most of it
    return line


def describe_start(load, text):
    """Return the description of a scenario's first frame alone: what it says of motions takes no longer run."""
    return load(text.replace("duration_s    = 2000", "duration_s    = 100")).describe()


def kind(table):
    return re.search(r'type = "(\w+)"', table)[1]


# ------------------------------------------------------------------------------------------------------- what works


@pytest.mark.filterwarnings("ignore::rso_lidar.errors.RsoLidarWarning")
@pytest.mark.parametrize("name", MOTIONS)
def test_a_motion_is_described_and_flown(name, load):
    text = scenario_text(MOTIONS[name])
    scenario, lines = load(text), describe_start(load, text).splitlines()
    (follower,) = [line for line in lines if line.startswith("follower")]
    assert kind(MOTIONS[name]) in follower
    assert ("relative to chief" in follower) == ("relative_to" in MOTIONS[name])
    assert any(line.startswith("plan") for line in lines) == hasattr(scenario.follower.motion, "plan")
    frame = next(iter(rl.simulate(scenario, frames=[3])))
    range_m = np.linalg.norm(frame.truth.pose("lidar", "chief").translation)
    states = frame.truth.states
    apart = np.linalg.norm(states["follower"].position_m - states["chief"].position_m)
    assert range_m == pytest.approx(apart, rel=1e-9, abs=2e-8)  # inertial coordinates are 1e-9 m coarse


@pytest.mark.parametrize("name", ATTITUDES)
def test_an_attitude_is_described_and_flown(name, load):
    text = scenario_text(HILL, ATTITUDES[name])
    assert f"attitude {kind(ATTITUDES[name])}" in describe_start(load, text)
    frame = next(iter(rl.simulate(load(text), frames=[3])))
    toward = frame.truth.pose("lidar", "chief").translation
    assert toward[2] == pytest.approx(np.linalg.norm(toward), rel=1e-12)  # the PTU holds it on the boresight


@pytest.mark.parametrize("name", MOTIONS)
def test_a_target_may_move_so_too(name, load):
    """The follower goes round the one or looks at it, whatever it flies."""
    about = MOTIONS[name].replace('"chief"', '"station"')
    more = f'[[target]]\nname = "station"\nmodel = "plate"\nmotion = {KEPLER}\n'
    orbits = name not in PLACES
    motion = HILL if orbits and name != "kepler, open" else '{ type = "fixed", position_m = [0.0, 9e6, 0.0] }'
    scenario = load(scenario_text(motion, ATTITUDES["look_at"], about, more))
    truth = next(iter(rl.simulate(scenario, frames=[0]))).truth
    if motion is HILL:
        assert np.allclose(truth.pose("chief.rtn", "follower").translation, (100.0, -900.0, 50.0), atol=1e-6)
    toward = truth.pose("follower", "chief").translation
    assert np.allclose(toward / np.linalg.norm(toward), (1.0, 0.0, 0.0), atol=1e-9)


# ------------------------------------------------------------------------------------------------- what is refused


@pytest.mark.parametrize("name", MOTIONS)
def test_an_unknown_key_of_a_motion_names_its_place(name, load):
    line = refusal(load, scenario_text(MOTIONS[name].replace("{ type", "{ wobble_m = 1.0, type", 1)))
    assert "follower.motion: unknown key 'wobble_m'" in line


@pytest.mark.parametrize("name", ATTITUDES)
def test_an_unknown_key_of_an_attitude_names_its_place(name, load):
    line = refusal(load, scenario_text(HILL, ATTITUDES[name].replace("{ type", "{ wobble_m = 1.0, type", 1)))
    assert "follower.attitude: unknown key 'wobble_m'" in line


@pytest.mark.parametrize(
    ("motion", "attitude", "old", "new", "says"),
    [
        ("numerical", None, "raan_deg", "rann_deg", ["follower.motion.initial", "'rann_deg'", "'raan_deg'"]),
        ("numerical", None, "area_m2 = 4.0, mass_kg", "area_m = 4.0, mass_kg", ["follower.motion.forces.drag", "'area_m2'"]),
        ("numerical", None, "thrust_n =", "thrust =", ["follower.motion.maneuvers[1]", "'thrust_n'"]),
        ("numerical", None, 'type = "burn"', 'type = "brun"', ["follower.motion.maneuvers[1]", "'brun'", "'burn'"]),
        ("numerical", None, "zonal_degree = 6", "zonal_degree = 7", ["follower.motion.forces.zonal_degree", "6"]),
        ("hill", "slew, rtn to look_at", "at = ", "att = ", ["follower.attitude.then", "'att'", "'at'"]),
        ("hill", "slew, nadir to Sun", "max_rate_deg_s = 0.5", "max_rate_deg_s = -1", ["follower.attitude.max_rate_deg_s"]),
        ("hill", None, '"hill"', '"hil"', ["follower.motion", "'hil'", "'hill'"]),
        ("hill", None, '"hill"', '"clohessy_wiltshire"', ["follower.motion", "'clohessy_wiltshire'"]),
        ("kepler", None, "eccentricity = 0.001", "eccentricity = 1.2", ["follower.motion", "semi_major_axis_km"]),
        ("kepler", None, ", true_anomaly_deg = 70.0", "", ["follower.motion", "true_anomaly_deg"]),
        ("v_bar_approach", None, "speed_m_s = 0.4", "speed_m_s = 0.4, duration_s = 9", ["follower.motion", "not both"]),
        ("hop", None, "duration_s = 2000.0", "duration_s = 0", ["follower.motion.duration_s", "infinite speed"]),
        ("hop", None, "stop =", "keep_out_m = 400.0, stop =", ["follower.motion", "keep_out_m"]),
        ("rendezvous", None, "duration_s = 2100.0", "duration_s = -5", ["follower.motion.duration_s", "is negative"]),
        ("waypoints", None, "900.0, 1800.0]", "900.0, 930.0]", ["follower.motion", "times_s[2]", "hold"]),
        ("teardrop", None, "period_s = 1500.0", "period_s = 9000.0", ["follower.motion", "period_s", "revolution"]),
        ("lambert", None, "duration_s = 2100.0", "duration_s = 2100.0, revolutions = 3", ["follower.motion", "revolutions"]),
        ("ephemeris, OEM", None, "low.oem", "lov.oem", ["follower.motion", "'lov.oem'"]),
        ("ephemeris, OEM", None, "low.oem", "turn.aem", ["follower.motion", "turn.aem", "OEM"]),
        ("tle", None, "low.tle", "dynamics.py", ["follower.motion", "dynamics.py"]),
        ("tle", None, '"low.tle"', '"low.tle", norad_id = 5', ["follower.motion", "5", "99002"]),
        ("table", None, "course.csv", "low.csv", ["follower.motion", "low.csv"]),
        ("hill", "table, AEM", "turn.aem", "low.oem", ["follower.attitude", "low.oem", "AEM"]),
        ("state_space, rtn", None, "dynamics.py:hill", "dynamics.py:hil", ["follower.motion", "'hil'", "'hill'"]),
        ("state_space, rtn", None, '"rtn"', '"inertial"', ["follower.motion", "relative_to"]),
        ("state_space, rtn rigid body", "rtn", "", "", ["follower.attitude", "rigid body"]),
        ("fixed", "rtn", "", "", ["follower.attitude", "orbits"]),
        ("fixed", "nadir", "", "", ["follower.attitude", "orbits"]),
    ],
)  # fmt: skip
def test_what_is_wrong_inside_is_named_to_its_place(motion, attitude, old, new, says, load):
    text = scenario_text(MOTIONS[motion], ATTITUDES.get(attitude))
    begin = text.index("[follower]")
    assert old in text[begin:]
    line = refusal(load, text[:begin] + text[begin:].replace(old, new, 1))
    for word in says:
        assert word in line, line


@pytest.mark.parametrize("name", [name for name in MOTIONS if "relative_to" in MOTIONS[name]])
def test_relative_to_nothing_to_itself_and_round(name, load):
    motion = MOTIONS[name]
    line = refusal(load, scenario_text(motion.replace('"chief"', '"cheif"')))
    assert "follower.motion.relative_to: unknown body 'cheif'; did you mean 'chief'?" in line
    assert "loop" in refusal(load, scenario_text(motion.replace('"chief"', '"follower"')))
    orbits = name not in PLACES
    line = refusal(load, scenario_text(motion, None, (HILL if orbits else motion).replace('"chief"', '"follower"')))
    assert "loop" in line
    assert "follower -> chief -> follower" in line or "chief -> follower -> chief" in line
    standing = scenario_text(motion, None, '{ type = "fixed", position_m = [7e6, 0.0, 0.0] }')
    if orbits:
        assert "'chief' does not orbit" in refusal(load, standing)
    else:
        load(standing)


@pytest.mark.parametrize("name", [name for name in RELATIVE if not name.startswith("state_space")])
def test_a_relative_motion_without_its_chief(name, load):
    line = refusal(load, scenario_text(RELATIVE[name].replace('relative_to = "chief", ', "")))
    assert re.search(r"follower\.motion\.(plan\.)?relative_to", line)
    assert "missing" in line


def local(text, sun=True):
    return text.replace(
        "[time]", '[world]\naxes = "local"\n' + ("sun_direction = [1, 0, 0]\n" if sun else "") + "\n[time]"
    )


@pytest.mark.parametrize("name", [*ORBITS, *RELATIVE])
def test_a_local_world_has_no_orbits(name, load):
    text = scenario_text(MOTIONS[name], None, '{ type = "fixed", position_m = [0.0, 0.0, 0.0] }')
    line = refusal(load, local(text))
    assert "follower.motion" in line
    assert "Earth" in line
    assert "[world]" in line


@pytest.mark.parametrize("name", ATTITUDES)
def test_attitudes_in_a_local_world(name, load):
    place = '{ type = "fixed", position_m = [-900.0, 5.0, 1.0] }'
    text = local(scenario_text(place, ATTITUDES[name], '{ type = "fixed", position_m = [0.0, 0.0, 0.0] }'))
    if re.search('"(rtn|lvlh_ccsds|nadir)"', ATTITUDES[name]):
        line = refusal(load, text)
        assert "follower.attitude" in line
        return
    truth = next(iter(rl.simulate(load(text), frames=[3]))).truth
    assert np.linalg.norm(truth.pose("lidar", "chief").translation) == pytest.approx(
        np.sqrt(900.0**2 + 26.0), rel=1e-12
    )


def test_in_a_local_world_without_a_sun_nothing_points_at_it(load):
    place = '{ type = "fixed", position_m = [-900.0, 5.0, 1.0] }'
    text = scenario_text(place, ATTITUDES["sun_pointing"], '{ type = "fixed", position_m = [0.0, 0.0, 0.0] }')
    line = refusal(load, local(text, sun=False))
    assert "follower.attitude" in line
    assert "Sun" in line


# ---------------------------------------------------------------------------------------------------- what is warned


ECCENTRIC = KEPLER.replace("eccentricity = 0.001", "eccentricity = 0.1").replace("6928.137", "8000.0")


@pytest.mark.parametrize(
    ("motion", "chief", "duration_s", "says"),
    [
        (HILL.replace("-900.0", "-20000.0"), KEPLER, 2000, ["hill: the separation", "curvilinear", "nonlinear"]),
        (HILL, ECCENTRIC, 2000, ["hill: the chief's eccentricity is 0.1", "yamanaka_ankersen"]),
        (HILL, KEPLER, 60000, ["hill: in", "flattening", "relative_elements"]),
        (
            RELATIVE["yamanaka_ankersen"].replace("-900.0", "-20000.0"),
            KEPLER,
            2000,
            ["yamanaka_ankersen: the separation", "nonlinear"],
        ),
        (RELATIVE["yamanaka_ankersen"], KEPLER, 60000, ["yamanaka_ankersen: in", "flattening", "relative_elements"]),
        (RELATIVE["nonlinear"], KEPLER, 60000, ["nonlinear", "forces"]),
        (
            RELATIVE["relative_elements"].replace("}", ", j2 = false }"),
            KEPLER,
            60000,
            ["relative_elements: in", "set j2 = true"],
        ),
        (
            RELATIVE["relative_elements"],
            KEPLER.replace("6928", "6728"),
            400000,
            ["relative_elements: the chief comes down to", "drag", "numerical"],
        ),
        (
            RELATIVE["lambert"].replace("2100.0", "14000.0, revolutions = 2"),
            KEPLER,
            14000,
            ["lambert", "J2", "nonlinear"],
        ),
        (RELATIVE["safety_ellipse"], ECCENTRIC, 2000, ["safety_ellipse", "eccentricity"]),
    ],
)
def test_a_stretched_model_is_named_with_the_better_one(motion, chief, duration_s, says, load):
    text = scenario_text(motion, None, chief).replace("duration_s    = 2000", f"duration_s    = {duration_s}")
    text = text.replace("frame_rate_hz = 0.01", "frame_rate_hz = 0.001")
    lines = load(text).advice()
    assert len([line for line in lines if all(word in line for word in ["follower.motion: ", *says])]) == 1, lines


def test_a_model_within_its_range_is_not_named(load):
    assert not any("follower.motion: " in line for line in load(scenario_text(HILL)).advice())


@pytest.mark.parametrize(
    ("motion", "says"),
    [
        (
            ORBITS["tle of several sets"],
            ["LOW (SYNTHETIC)", "switches element sets once", "2024-09-17T12:18:00Z", "nearest"],
        ),
        (ORBITS["omm"].replace("2024-09-17T12", "2024-08-17T12"), ["LOW", "31", "days"]),
    ],
)
def test_old_and_jumping_element_sets_are_told(motion, says, load):
    lines = load(scenario_text(motion)).advice()
    assert any(all(word in line for word in says) for line in lines), lines


def test_a_run_past_the_end_of_a_table_says_which_epochs(load):
    text = scenario_text(ORBITS["ephemeris, OEM"]).replace("duration_s    = 2000", "duration_s    = 4000")
    line = refusal(load, text)
    for word in ("follower.motion", "low.oem", "time_s = 3700", "2024-09-17T13:01:40", "2024-09-17T13:00:00"):
        assert word in line
    text = scenario_text(PLACES["table"]).replace("duration_s    = 2000", "duration_s    = 4000")
    line = refusal(load, text)
    for word in ("follower.motion", "course.csv", "time_s = 3700"):
        assert word in line


def test_an_orbit_that_falls_says_when(load):
    place = "position_m = [6.6e6, 0.0, 0.0], velocity_m_s = [-100.0, 4000.0, 0.0]"
    falling = f'{{ type = "state", epoch_utc = 2024-09-17T12:00:00Z, {place} }}'
    line = refusal(load, scenario_text(f'{{ type = "numerical", initial = {falling} }}'))
    assert "follower.motion" in line
    assert re.search(r"ground|Earth", line)
    assert re.search(r"[0-9]+ s after the start, before 17 of 20 epochs", line)


def test_each_type_is_told_where_none_is_known():
    """The list of known types in an error holds every type of this file, and those that need files or facets."""
    with pytest.raises(ScenarioError) as error:
        rl.Scenario.loads(scenario_text('{ type = "warp" }'))
    known = set(re.findall(r"\w+", str(error.value).partition("(known: ")[2]))
    assert {kind(text) for text in MOTIONS.values()} | {"fmu", "lunar_kepler", "lunar_state", "spice"} == known
    with pytest.raises(ScenarioError) as error:
        rl.Scenario.loads(scenario_text(HILL, '{ type = "warp" }'))
    known = set(re.findall(r"\w+", str(error.value).partition("(known: ")[2]))
    assert {kind(text) for text in ATTITUDES.values()} | {"fmu", "spice", "torqued"} == known

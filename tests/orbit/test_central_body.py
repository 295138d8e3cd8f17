"""What answers `states`, and what the functions of trajectories say of what does not."""

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.errors import ScenarioError
from rso_lidar.orbit import (
    Catalog,
    Epochs,
    GroundStation,
    NamedTrajectory,
    find_access,
    find_eclipses,
    find_ground_track,
    screen,
    screen_pairs,
)
from rso_lidar.rpo import Hill
from rso_lidar.shipped import shipped
from tests.orbit.earth.earth_for_tests import LOW, START
from tests.orbit.sets.sets_for_tests import TERRASAR

SPAN = Epochs(START, np.array([0.0, 600.0]))
HILL = Hill(relative_to="chief", position_m=(0.0, -3000.0, 0.0), velocity_m_s=(0.0, 0.0, 0.0))
STATION = GroundStation(latitude_deg=10.0, longitude_deg=20.0)
ASK = {
    "observer": lambda motion: find_access(motion, LOW, SPAN),
    "target": lambda motion: find_access(STATION, motion, SPAN),
    "trajectory": lambda motion: STATION.see(motion, SPAN),
    "trajectory ": lambda motion: find_ground_track(motion, SPAN),
    "trajectory  ": lambda motion: find_eclipses(motion, SPAN),
    "follower": lambda motion: screen(motion, [LOW], START, 600.0, 1e5),
    "object 2": lambda motion: screen(LOW, [LOW, motion], START, 600.0, 1e5),
    "object 1": lambda motion: screen_pairs([motion, LOW], START, 600.0, 1e5),
    "CRAFT": lambda motion: NamedTrajectory("CRAFT", motion),
}


@pytest.mark.parametrize("name", ASK)
def test_a_relative_motion_is_refused_with_the_way_through(name):
    with pytest.raises(ScenarioError) as caught:
        ASK[name](HILL)
    assert str(caught.value) == (
        f"{name.strip()}: Hill is relative to 'chief' and has no states alone; give "
        "rl.study.BodyTrajectory(scenario, 'follower')"
    )


def test_the_way_through_gives_the_states_of_the_follower():
    scenario = rl.Scenario.load(shipped("examples/tdrs_approach.toml"))
    follower, target = (rl.study.BodyTrajectory(scenario, name) for name in ("follower", "tdrs"))
    span = Epochs(scenario.time.start_utc, np.array([0.0, 2700.0]))
    (seen,) = find_access(follower, target, span)
    assert (seen.from_s, seen.to_s) == (-np.inf, np.inf)
    assert 250.0 < seen.closest_m < 350.0  # it ends at 300 m
    here, there = (find_ground_track(body, span) for body in (follower, target))
    assert np.abs(here.latitude_rad - there.latitude_rad).max() < 3000.0 / 6.3e6
    station = GroundStation(0.0, np.degrees(float(there.longitude_rad[0])))
    assert find_access(station, follower, span)[0].from_s == -np.inf  # above it in GEO


def test_an_element_set_alone_is_no_trajectory():
    (elements,) = Catalog.from_text("\n".join(TERRASAR))
    with pytest.raises(
        ScenarioError, match=r"^observer: ElementSet has no method states; .* SetSequence\(\(elements,\)\)$"
    ):
        find_access(elements, LOW, SPAN)
    for other in (None, "tdrs", [elements, "tdrs"]):
        with pytest.raises(ScenarioError, match=r"^object 1: \w+ has no method states"):
            screen(elements, [other], START, 600.0, 1e5)

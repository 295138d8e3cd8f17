"""Orbits about the Moon: against DOP853, skyfield, the period of LRO, and another centre for everything that is relative.

The kernel is the day of DE430 that skyfield's own tests contain.
"""

import datetime
import math
from pathlib import Path

import numpy as np
import pytest
import skyfield
from scipy.integrate import solve_ivp

from rso_lidar import units
from rso_lidar.errors import PropagationError, ScenarioError
from rso_lidar.orbit import (
    Epochs,
    JplEphemeris,
    Kepler,
    LunarKepler,
    LunarState,
    elements_from_state,
    find_access,
    find_center,
    find_center_states,
    find_eclipses,
    screen,
    subtract_center,
    sun_position_m,
)
from rso_lidar.orbit.central_body import MOON
from rso_lidar.picture import is_about_earth
from rso_lidar.rpo import Flown, Hop, Lambert

KERNEL = Path(skyfield.__file__).parent / "tests" / "data" / "de430-2015-03-02.bsp"
START = datetime.datetime(2015, 3, 2, 1, tzinfo=datetime.UTC)
EPOCHS = Epochs(START, np.linspace(0.0, 30_000.0, 31))


def states_about_center(motion, epochs):
    return subtract_center(motion.states(epochs), find_center_states(motion, epochs))


pytestmark = pytest.mark.skipif(not KERNEL.exists(), reason="this skyfield has no day of DE430 among its tests")


def orbiter(**changes):
    given = {
        "epoch_utc": START,
        "semi_major_axis_km": 1787.4,
        "eccentricity": 0.0,
        "inclination_deg": 90.0,
        "raan_deg": 10.0,
        "argument_of_perigee_deg": 0.0,
        "true_anomaly_deg": 0.0,
        "kernel_file": str(KERNEL),
    }
    return LunarKepler(**(given | changes))


def test_the_period_is_that_of_lro():
    # LRO's mapping orbit, circular at 50 km: 113 min (Chin et al. 2007, Space Sci. Rev. 129, sec. 2)
    about = states_about_center(orbiter(), Epochs(START, np.zeros(1)))
    period_s = elements_from_state(about.position_m[0], about.velocity_m_s[0], MOON).period_s
    assert abs(period_s / 60.0 - 113.0) < 0.05
    after = states_about_center(orbiter(), Epochs(START, np.array([0.0, period_s])))
    assert np.linalg.norm(after.position_m[1] - after.position_m[0]) < 1e-5  # nanoseconds of the epoch, at 1.6 km/s


@pytest.mark.parametrize("eccentricity", [0.0, 0.3, 0.7])
def test_states_are_those_of_an_integration_beside_the_moon_of_skyfield(eccentricity):
    from skyfield.jpllib import SpiceKernel

    motion = orbiter(semi_major_axis_km=1787.4 / (1.0 - eccentricity), eccentricity=eccentricity, true_anomaly_deg=40.0)
    spice = SpiceKernel(str(KERNEL))
    moon = (spice["moon"] - spice["earth"]).at(EPOCHS.skyfield_time())
    first = motion.states(EPOCHS.at(slice(0, 1)))
    about = np.concatenate([
        first.position_m[0] - moon.position.m[:, 0],
        first.velocity_m_s[0] - moon.velocity.m_per_s[:, 0],
    ])  # fmt: skip
    gm = 4.902800066e12  # DE430, table 8
    flown = solve_ivp(
        lambda _, x: np.concatenate([x[3:], -gm * x[:3] / np.linalg.norm(x[:3]) ** 3]),
        (0.0, 30_000.0),
        about,
        "DOP853",
        EPOCHS.time_s,
        rtol=1e-13,
        atol=1e-6,
    ).y
    states = motion.states(EPOCHS)
    assert np.abs(states.position_m.T - moon.position.m - flown[:3]).max() < 1e-3
    assert np.abs(states.velocity_m_s.T - moon.velocity.m_per_s - flown[3:]).max() < 1e-6
    spice.close()


def test_a_state_and_its_elements_are_one_orbit():
    kepler = orbiter(eccentricity=0.01, semi_major_axis_km=1900.0)
    about = states_about_center(kepler, Epochs(START, np.zeros(1)))
    state = LunarState(
        epoch_utc=START,
        position_m=tuple(about.position_m[0]),
        velocity_m_s=tuple(about.velocity_m_s[0]),
        kernel_file=str(KERNEL),
    )
    assert find_center(state) is MOON
    np.testing.assert_allclose(state.states(EPOCHS).position_m, kepler.states(EPOCHS).position_m, rtol=0.0, atol=1e-5)


def test_the_velocity_of_the_moon_is_the_derivative_of_its_position():
    kernel = JplEphemeris(KERNEL)
    at = np.array([10_000.0 - 10.0, 10_000.0, 10_000.0 + 10.0])
    moon = kernel.states("moon", Epochs(START, at))
    slope = (moon.position_m[2] - moon.position_m[0]) / 20.0
    assert np.abs(slope - moon.velocity_m_s[1]).max() < 1e-6  # TDB beats TT's rate by up to 3e-10
    np.testing.assert_array_equal(moon.position_m, kernel.position_m("moon", Epochs(START, at), light_time=False))


def test_eclipses_are_those_of_the_cylinder_behind_the_moon():
    # a circle in parallel light: half the time in the shadow is acos(sqrt(1 - (R / r)^2) / cos beta) / n
    motion = orbiter(raan_deg=-20.0)
    found = find_eclipses(motion, Epochs(START, np.array([0.0, 14_000.0])))
    assert len(found) == 2
    at = Epochs(START, np.array([found[0].umbra_from_s]))
    about = states_about_center(motion, at)
    sun = sun_position_m(at)[0] - motion.center_states(at).position_m[0]
    normal = np.cross(about.position_m[0], about.velocity_m_s[0])
    sine = sun @ normal / np.linalg.norm(sun) / np.linalg.norm(normal)
    ratio = units.MOON_RADIUS_M / 1787.4e3
    n = math.sqrt(units.MOON_GM_M3_S2 / 1787.4e3**3)
    expected_s = 2.0 / n * math.acos(math.sqrt(1.0 - ratio**2) / math.sqrt(1.0 - sine**2))
    middle_s = 0.5 * (found[0].umbra_to_s - found[0].umbra_from_s + found[0].penumbra_to_s - found[0].penumbra_from_s)
    assert abs(middle_s - expected_s) < 2.0  # the Sun moves 0.03 degree meanwhile


def test_an_orbit_far_from_the_moon_is_reported():
    assert orbiter().validity(EPOCHS) == []
    far = orbiter(semi_major_axis_km=80_000.0).validity(EPOCHS)
    assert (
        len(far) == 1
        and "it reaches 80000 km from the Moon, where the Earth's tide, which is left out, is 147%" in far[0]
    )


def test_bad_input_is_told(tmp_path):
    with pytest.raises(
        ScenarioError, match=r"kernel_file: an orbit about the Moon needs .* kernel_file = \"de440s.bsp\""
    ):
        orbiter(kernel_file=None)
    with pytest.raises(ScenarioError, match=r"the perigee is 37\.4 km below the Moon's surface"):
        orbiter(semi_major_axis_km=1700.0)
    with pytest.raises(ScenarioError, match="inside the Moon; give metres from the centre"):
        LunarState(epoch_utc=START, position_m=(1e6, 0, 0), velocity_m_s=(0, 1, 0), kernel_file="a.bsp")
    with pytest.raises(ScenarioError, match="a fall through the Moon's centre"):
        LunarState(epoch_utc=START, position_m=(2e6, 0, 0), velocity_m_s=(1, 0, 0), kernel_file="a.bsp")
    with pytest.raises(ScenarioError, match=r"kernel_file: .*none\.bsp: no such file"):
        orbiter(kernel_file=str(tmp_path / "none.bsp")).states(EPOCHS)
    with pytest.raises(PropagationError, match=r"kernel_file: .*it spans 2015-02-26 to 2015-03-06") as caught:
        orbiter().states(Epochs(START, np.array([0.0, 1e8])))
    assert caught.value.bad.tolist() == [False, True]


def test_what_knows_the_earth_alone_refuses_an_orbit_about_the_moon():
    craft = orbiter()
    earthly = Kepler(
        epoch_utc=START, semi_major_axis_km=6978.137, eccentricity=0.0, inclination_deg=10.0, raan_deg=0.0,
        argument_of_perigee_deg=0.0, true_anomaly_deg=0.0,
    )  # fmt: skip
    with pytest.raises(ScenarioError, match="target: orbits about the Moon, and access counts the Earth alone"):
        find_access(earthly, craft, EPOCHS)
    with pytest.raises(ScenarioError, match="orbits about the Moon, and encounters are searched about the Earth"):
        screen(earthly, [craft], START, 3000.0, 1e4)
    ends = {"relative_to": "chief", "from_m": (0, -1000, 0), "to_m": (0, -100, 0), "duration_s": 1000}
    for refused in (Lambert(**ends).plan, Flown(plan=Hop(**ends)).fly):
        with pytest.raises(ScenarioError, match="has the Earth's gravity"):
            refused(START, craft)


def test_orbits_about_the_moon_are_drawn_as_flown():
    states = orbiter().states(EPOCHS)
    assert not is_about_earth(EPOCHS.time_s, states.position_m, states.velocity_m_s)

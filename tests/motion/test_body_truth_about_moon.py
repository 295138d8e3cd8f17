"""Bodies about the Moon: rtn axes, attitudes, light and relative motion about its centre.

The same orbits about the Earth, of equal period, are the independent check of relative motion: a two-body orbit scales.
"""

import datetime
from pathlib import Path

import numpy as np
import pytest
import skyfield

from rso_lidar import units
from rso_lidar.errors import RsoLidarWarning, ScenarioError
from rso_lidar.motion import Body, Chief, LvlhCcsds, truth
from rso_lidar.orbit import Epochs, Kepler, LunarKepler, propagate_two_body
from rso_lidar.rpo import Flown, Hill, Hop, Lambert, Nonlinear, RelativeElements, YamanakaAnkersen

KERNEL = Path(skyfield.__file__).parent / "tests" / "data" / "de430-2015-03-02.bsp"
START = datetime.datetime(2015, 3, 2, 1, tzinfo=datetime.UTC)
EPOCHS = Epochs(START, np.linspace(0.0, 6_800.0, 35))
ELEMENTS = {
    "epoch_utc": START, "eccentricity": 0.0, "inclination_deg": 80.0, "raan_deg": 10.0,
    "argument_of_perigee_deg": 0.0, "true_anomaly_deg": 0.0,
}  # fmt: skip
SCALE = (units.EARTH_GM_M3_S2 / units.MOON_GM_M3_S2) ** (1.0 / 3.0)  # of lengths, at one period

pytestmark = pytest.mark.skipif(not KERNEL.exists(), reason="this skyfield has no day of DE430 among its tests")


def about_moon(**changes):
    return LunarKepler(**({"semi_major_axis_km": 1787.4, "kernel_file": str(KERNEL)} | ELEMENTS | changes))


def fly(motion, chief):
    return truth([Body(name="chief", motion=chief, attitude=LvlhCcsds()), Body(name="f", motion=motion)], EPOCHS)


def test_nadir_is_toward_the_moon_and_turns_once_a_revolution():
    motion = about_moon()
    found = truth([Body(name="chief", motion=motion, attitude=LvlhCcsds())], EPOCHS)
    down = motion.center_states(EPOCHS).position_m - found.states["chief"].position_m
    nadir = found.pose("inertial", "chief").rotation.apply([0.0, 0.0, 1.0])
    np.testing.assert_allclose(nadir, down / np.linalg.norm(down, axis=1, keepdims=True), atol=1e-13)
    n = np.sqrt(units.MOON_GM_M3_S2 / 1787.4e3**3)
    np.testing.assert_allclose(found.rates("inertial", "chief")[1], np.tile([0.0, -n, 0.0], (35, 1)), atol=1e-12)


def test_the_velocity_of_the_origin_is_the_derivative_of_its_position():
    motion = about_moon(eccentricity=0.02, semi_major_axis_km=1850.0)
    bodies = [
        Body(name="chief", motion=motion),
        Body(name="f", motion=YamanakaAnkersen(**start((300.0, -900.0, 50.0)))),
    ]
    step = 5.0  # epochs are known to a nanosecond
    at = [truth(bodies, Epochs(START, np.array([3000.0 + k * step]))) for k in (-2, -1, 0, 1, 2)]
    for name in ("chief", "f"):
        place = [one.states[name].position_m[0] for one in at]
        slope = (place[0] - 8.0 * place[1] + 8.0 * place[3] - place[4]) / (12.0 * step)
        assert np.abs(slope - at[2].states[name].velocity_m_s[0]).max() < 1e-6
        np.testing.assert_allclose(at[2].rates("inertial", name)[0][0], slope, atol=1e-6)


def start(position=(0.0, -1000.0, 0.0), velocity=(0.1, 0.0, 0.05)):
    return {"relative_to": "chief", "position_m": position, "velocity_m_s": velocity}


@pytest.mark.parametrize("kind", [Hill, YamanakaAnkersen, Nonlinear])
def test_relative_motion_is_that_about_the_earth_at_one_scale(kind):
    earth = fly(kind(**start(tuple(SCALE * np.array([0.0, -1000.0, 0.0])), tuple(SCALE * np.array([0.1, 0.0, 0.05])))),
                Kepler(semi_major_axis_km=1787.4 * SCALE, **ELEMENTS))  # fmt: skip
    moon = fly(kind(**start()), about_moon())
    there, here = earth.poses.link("chief.rtn", "f.rtn"), moon.poses.link("chief.rtn", "f.rtn")
    np.testing.assert_allclose(here.translation_m, there.translation_m / SCALE, atol=1e-6)
    np.testing.assert_allclose(here.velocity_m_s, there.velocity_m_s / SCALE, atol=1e-9)
    np.testing.assert_allclose(here.matrix, there.matrix, atol=1e-9)


def test_nonlinear_is_the_difference_of_two_orbits_about_the_moon():
    found = fly(Nonlinear(**start()), about_moon())
    first = {name: state[0] for name, state in found.states.items()}
    moon = about_moon().center_states(EPOCHS)
    for name, state in first.items():
        place = state.position_m - moon.position_m[0], state.velocity_m_s - moon.velocity_m_s[0]
        flown, _ = propagate_two_body(*place, EPOCHS.time_s, units.MOON_GM_M3_S2)
        assert np.abs(flown + moon.position_m - found.states[name].position_m).max() < 1e-3


def test_a_hop_arrives():
    hop = Hop(relative_to="chief", from_m=(0.0, -1000.0, 0.0), to_m=(0.0, -200.0, 0.0), duration_s=3390.0)
    found = fly(hop, about_moon()).poses.link("chief.rtn", "f.rtn").translation_m
    assert np.linalg.norm(found[-1] - [0.0, -200.0, 0.0]) < 1e-6
    # the same impulses, flown by the exact difference of two orbits: 6 pi rho^2 / r of second order
    impulse = hop.plan(START, Chief([Body(name="chief", motion=about_moon())], "chief")).impulses[0].delta_v_m_s
    exact = fly(Nonlinear(**start((0.0, -1000.0, 0.0), tuple(impulse))), about_moon())
    half = int(np.searchsorted(EPOCHS.time_s, 3390.0)) - 1
    off = exact.poses.link("chief.rtn", "f.rtn").translation_m[half] - found[half]
    assert np.linalg.norm(off) < 6.0 * np.pi * 1000.0**2 / 1787.4e3


def test_both_shadows_are_in_the_light():
    found = truth([Body(name="chief", motion=about_moon())], EPOCHS)
    lit = found.sunlit["chief"]
    assert lit.min() == 0.0 and lit.max() == 1.0


HOP = {"relative_to": "chief", "from_m": (0, -3000, 0), "to_m": (0, -300, 0), "duration_s": 3000.0}
IMPULSE = {"type": "impulse", "at_s": 9.0, "delta_v_m_s": (0.0, 1.0, 0.0)}


@pytest.mark.parametrize(
    ("motion", "message"),
    [
        (
            RelativeElements(relative_to="chief", delta_lambda_m=-1000.0),
            "'relative_elements' has the Earth's gravity, and",
        ),
        (Nonlinear(**start(), forces={}), "forces: are integrated with the Earth's gravity"),
        (Nonlinear(**start(), maneuvers=[IMPULSE]), "maneuvers: are integrated"),
        (Lambert(**HOP), "'lambert' has the Earth's gravity, and 'chief' orbits about the Moon"),
        (Flown(plan=Hop(**HOP)), "'flown' has the Earth's gravity"),
    ],
)
def test_what_has_the_gravity_of_the_earth_is_refused(motion, message):
    with pytest.raises(ScenarioError) as caught:
        fly(motion, about_moon())
    assert f"f.motion: {message}" in str(caught.value) and "\n" not in str(caught.value)


def test_limits_are_those_about_the_moon():
    bodies = [Body(name="chief", motion=about_moon(eccentricity=0.02, semi_major_axis_km=1850.0)),
              Body(name="f", motion=Hill(**start()))]  # fmt: skip
    with pytest.warns(RsoLidarWarning, match="eccentricity is 0.0200; .*; use yamanaka_ankersen or nonlinear$"):
        truth(bodies, EPOCHS)
    day = Epochs(START, np.linspace(0.0, 80_000.0, 9))
    bodies[0] = bodies[0].replace(motion=about_moon())
    with pytest.warns(
        RsoLidarWarning, match=r"in 11.8 revolutions the Moon's flattening .* take the result as an estimate"
    ):
        truth(bodies, day)

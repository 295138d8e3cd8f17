"""What every motion and every attitude law keeps to: rates are derivatives, an epoch has its own bits, text keeps all."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import rso_lidar as rl
from rso_lidar import motion, units
from rso_lidar.errors import RsoLidarError, ScenarioError
from rso_lidar.motion import add_lidar, simulate_drive
from rso_lidar.orbit import Epochs, OsculatingElements, State, state_from_elements
from rso_lidar.rpo import Hill, Nonlinear, YamanakaAnkersen, rtn_axes
from tests.property.motions_for_tests import (
    ATTITUDES,
    KEPLER,
    MOTIONS,
    ORBITS,
    RELATIVE,
    START,
    scenario_text,
    write_files,
)

pytestmark = pytest.mark.filterwarnings("ignore::rso_lidar.errors.RsoLidarWarning")

GM = units.EARTH_GM_M3_S2
# No impulse, switch of element sets or corner of a slew is within two steps of these.
TIMES_S = np.array([137.3, 431.9, 761.9, 1403.7, 1777.1])
STEP_S = 2.0
SLOPE = np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / 12.0 / STEP_S
GRID_S = (TIMES_S[:, None] + STEP_S * np.arange(-2, 3)).ravel()

# The five-point difference is off by h^4/30 of the fifth derivative: 16/30 n^4 v = 6e-9 m/s at n = 1.1e-3 rad/s and
# v = 7.6 km/s, and by some 1e-9 m/s of rounding (1e-9 m over the step). At the open orbit's perigee all is faster, and
# zonal harmonics have waves six times as short.
EXACT_M_S = 2e-8
SHORT_WAVES_M_S = 1e-6
# SGP4 rounds the time from its epoch, some days, to 1e-10 s, which is 1e-6 m along a low orbit, over the step of 2 s.
SGP4_M_S = 3e-6
OF_STATES = {
    "tle": SGP4_M_S,
    "tle of several sets": SGP4_M_S,
    "omm": SGP4_M_S,
    "kepler, open": SHORT_WAVES_M_S,
    "j2": SHORT_WAVES_M_S,
    "j2, osculating": SHORT_WAVES_M_S,
    "numerical": SHORT_WAVES_M_S,
    "numerical from a tle": SHORT_WAVES_M_S,
    "nonlinear with maneuvers": SHORT_WAVES_M_S,
}
# What differences of 2 s leave out of an acceleration, 3e-6 of 0.02 m/s^2 (J2), over the speed: 1e-11 rad/s. A user's own
# dynamics are not differenced: what they leave out is said in `motion.bodies.orbital_axes`.
RATE_RAD_S = 3e-11
OWN_RAD_S = 1e-9
# The velocity of SGP4 leaves out small rates of its periodic terms, some cm/s (Vallado et al. 2006, 3.D); the first-order
# map of J2 leaves J2^2 r = 8 m a revolution, at several waves in it: 8 m n = 9 mm/s.
# Two bodies 1 km apart have nearly the same of those 9 mm/s: the difference is 1.4e-4 (1 km over the radius) times some
# waves in a revolution.
FAR_WAVES_M_S = 1e-5
THEORIES = ("tle", "tle of several sets", "omm", "j2", "j2, osculating")
DIFFERENCES = (
    "relative_elements",
    "relative_elements of two bodies",
    "nonlinear",
    "nonlinear with forces",
    "lambert",
    "hill, curvilinear",
)
CHIEFS = {name: text for name, text in ORBITS.items() if name != "kepler, open"}
ABOUT = [*CHIEFS, "hill", "relative_elements", "safety_ellipse", "state_space, rtn"]
NEAR = [name for name in RELATIVE if name.partition(",")[0] in (*DIFFERENCES, "hill", "yamanaka_ankersen")]
NEAR += ["safety_ellipse", "state_space, rtn"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("motions")
    write_files(made)
    return made


def epochs(time_s):
    return Epochs(START, np.asarray(time_s, dtype=float))


def slope(values, step_s=STEP_S):
    """Return the derivative (time, ...) of rows on the grid by the five-point difference."""
    return np.einsum("nk...,k->n...", values.reshape((len(TIMES_S), 5, *values.shape[1:])), SLOPE * STEP_S / step_s)


def middle(values):
    return values.reshape((len(TIMES_S), 5, *values.shape[1:]))[:, 2]


def batch(values, *inner):
    return np.broadcast_to(values, (len(GRID_S), *inner))


def velocity_off_m_s(link, step_s=STEP_S):
    moved = slope(batch(link.translation_m, 3), step_s) - middle(batch(link.velocity_m_s, 3))
    return np.linalg.norm(moved, axis=1).max()


def rate_off_rad_s(link, step_s=STEP_S):
    """Return by how much the body rate differs from R' dR/dt, the turn of the axes in themselves."""
    turning = batch(link.matrix, 3, 3)
    spin = np.einsum("nji,njk->nik", middle(turning), slope(turning, step_s))
    rate = 0.5 * np.stack(
        [spin[:, 2, 1] - spin[:, 1, 2], spin[:, 0, 2] - spin[:, 2, 0], spin[:, 1, 0] - spin[:, 0, 1]], 1
    )
    return np.linalg.norm(rate - middle(batch(link.angular_velocity_rad_s, 3)), axis=1).max()


def bits(truth):
    """Return all numbers of a truth as rows of one epoch each, and their names."""
    n = len(truth.time_s)
    rows = {}
    for name, link in truth.poses.items():
        for field, inner in (
            ("translation_m", (3,)),
            ("matrix", (3, 3)),
            ("velocity_m_s", (3,)),
            ("angular_velocity_rad_s", (3,)),
        ):
            rows[f"{name} {field}"] = np.broadcast_to(getattr(link, field), (n, *inner))
    for name, state in truth.states.items():
        rows |= {
            f"{name} place": state.position_m,
            f"{name} speed": state.velocity_m_s,
            f"{name} lit": truth.sunlit[name],
        }
    return rows | {"sun": truth.sun_direction}


def same_bits(a, b):
    return a.keys() == b.keys() and all(np.array_equal(a[name], b[name]) for name in a)


# ---------------------------------------------------------------------------------------------------------- rates


@pytest.mark.parametrize("name", MOTIONS)
def test_velocity_is_the_slope_of_the_position(name, folder):
    bodies = rl.Scenario.loads(scenario_text(MOTIONS[name]), folder=folder, trust_code=True).bodies
    truth = motion.truth(bodies, epochs(GRID_S))
    poses, origin = truth.poses, bodies[-1].origin
    within = OF_STATES.get(
        name, FAR_WAVES_M_S if name in ("relative_elements", "nonlinear with forces", "flown") else EXACT_M_S
    )
    assert velocity_off_m_s(poses.link("inertial", origin)) < within
    assert velocity_off_m_s(poses.link("inertial", "follower")) < within
    assert velocity_off_m_s(poses[origin]) < within
    within = OWN_RAD_S if name.startswith("state_space") else RATE_RAD_S
    assert rate_off_rad_s(poses.link("inertial", origin)) < within
    assert rate_off_rad_s(poses[origin]) < within
    if bodies[-1].orbits:
        state, here = truth.states["follower"], poses.link("inertial", origin)
        axes, plane = rtn_axes(state.position_m, state.velocity_m_s)
        assert np.allclose(here.matrix, axes.as_matrix(), rtol=0, atol=1e-12)
        # of two bodies the plane stands still, and no perturbation turns it faster than thrust does here
        assert np.allclose(here.angular_velocity_rad_s, plane, rtol=0, atol=3e-6)
        # a theory's velocity is not quite the derivative of its position; elsewhere coordinates round to 1e-9 m
        within = 0.05 if name in THEORIES else 3e-6
        assert np.allclose(state.velocity_m_s, here.velocity_m_s, rtol=0, atol=within)


@pytest.mark.parametrize("name", ATTITUDES)
def test_body_rate_is_the_turn_of_the_attitude(name, folder):
    """In the axes of the orbit, in GCRS, and in those of another body."""
    bodies = rl.Scenario.loads(
        scenario_text(RELATIVE["nonlinear"], ATTITUDES[name]), folder=folder, trust_code=True
    ).bodies
    poses = motion.truth(bodies, epochs(GRID_S)).poses
    # 16/30 of the rate to the fifth: 1.2 deg/s and twice that of a tumble's products, 1e-8; all else is twenty times slower.
    within = 1e-8 if name == "tumble" else 1e-10
    for parent in ("follower.rtn", "inertial", "chief", "chief.rtn"):
        assert rate_off_rad_s(poses.link(parent, "follower")) < within, parent
    assert rate_off_rad_s(poses.link("follower", "chief")) < within


@pytest.mark.parametrize("name", ["tle", "numerical", "j2"])
def test_body_rates_in_a_perturbed_orbit(name, folder):
    for law in ("rtn", "lvlh_ccsds", "nadir", "look_at", "sun_pointing"):
        bodies = rl.Scenario.loads(
            scenario_text(RELATIVE["hill"], ATTITUDES[law], MOTIONS[name]), folder=folder, trust_code=True
        ).bodies
        poses = motion.truth(bodies, epochs(GRID_S)).poses
        for parent in ("inertial", "chief", "chief.rtn"):
            assert rate_off_rad_s(poses.link(parent, "follower")) < 1e-10, (law, parent)
            assert velocity_off_m_s(poses.link(parent, "follower")) < OF_STATES[name], (law, parent)


def test_hinges_turn_at_their_rates(folder):
    """A planned angle is linear between its entries, a fixed one turns on, a panel follows the Sun."""
    hinge = (
        '[[target.joint]]\nname = "{}"\nparts = ["plate"]\nposition_m = [1, 0, 0]\naxis = [0.0, 1.0, 0.2]\nangle = {}\n'
    )
    angles = {
        "turning": '{ type = "fixed", angle_deg = 10, rate_deg_s = 0.1 }',
        "panel": '{ type = "follow_sun", normal = [1, 0, 0] }',
        "planned": '{ type = "planned", time_s = [0, 600, 1500, 3000], angle_deg = [0, 50, -20, 0] }',
    }
    for name, angle in angles.items():
        more = 'attitude = { type = "nadir" }\n' + hinge.format(name, angle)
        bodies = rl.Scenario.loads(
            scenario_text(RELATIVE["nonlinear"], None, KEPLER, more), folder=folder, trust_code=True
        ).bodies
        truth = motion.truth(bodies, epochs(GRID_S))
        (axes,) = [axes for axes in truth.poses if axes.endswith(name)]
        for parent in ("chief", "inertial", "follower"):
            assert rate_off_rad_s(truth.poses.link(parent, axes)) < 1e-10, (name, parent)
            assert velocity_off_m_s(truth.poses.link(parent, axes)) < EXACT_M_S
        again = motion.truth(bodies, epochs(GRID_S[3:4]))
        assert same_bits({key: rows[3:4] for key, rows in bits(truth).items()}, bits(again))


@pytest.mark.parametrize(
    ("response", "within"),
    [
        # The demand runs at r = 2 deg/s = 0.0349 rad/s and is held for a tick of dt = 1 ms, so that an angle has corners.
        # A rate is that at the end of a tick; against the mean over ticks it is off by r dt / (2 tau) for the first order
        # (its rate jumps by r dt / tau) and by w^2 r dt^2 / 12 for the second (its acceleration jumps by w^2 r dt).
        ('{ type = "ideal" }', 1e-12),  # rounding: 1e-15 rad over the step
        ('{ type = "first_order", time_constant_s = 0.3 }', 1.02 * 0.0349 * 1e-3 / 2.0 / 0.3),
        ('{ type = "second_order", natural_hz = 0.5, damping = 0.7 }', 1.05 * np.pi**2 * 0.0349 * 1e-6 / 12.0),
    ],
)
def test_the_pan_tilt_unit_turns_the_lidar_at_its_rates(response, within, folder):
    """Ptu and lidar, each on a mount away and turned, in the axes of follower and target, while the drive follows a scan."""
    ptu = f"""[ptu]
mount = {{ position_m = [0.3, -0.2, 0.1], euler_zyx_deg = [30, -20, 10] }}
response = {response}
[ptu.point]
type = "scan"
pattern = "raster"
pan_deg = 10
tilt_deg = 5
half_width_deg = 40
half_height_deg = 10
step_deg = 5
rate_deg_s = 2

[lidar]
mount = {{ position_m = [0.05, 0.02, -0.1], euler_zyx_deg = [1, 2, 3] }}
"""
    text = scenario_text(RELATIVE["nonlinear"]).replace('[ptu]\npoint = { type = "track", at = "chief" }\n', ptu)
    scenario = rl.Scenario.loads(text, folder=folder)
    step_s = 8e-3  # whole ticks; the drive's transients, exp(-2.2 t) and exp(-3.3 t), bend the course far more slowly
    times_s = np.array([0.5, 1.2, 3.0, 7.25, 15.0])  # on the first line of the raster, which ends at 20 s
    grid_s = (times_s[:, None] + step_s * np.arange(-2, 3)).ravel()
    course = motion.truth(scenario.bodies, epochs(grid_s))
    angles, rates = simulate_drive(scenario.ptu, scenario.bodies, course, START, local=False)
    assert np.all(np.abs(rates[:, 0]) > 0.01)  # it moves, and may not be right by standing still
    poses = add_lidar(course.poses, scenario.ptu, angles, rates, scenario.lidar.mount)
    for parent, child in (("follower", "ptu"), ("follower", "lidar"), ("lidar", "follower"), ("lidar", "chief")):
        link = poses.link(parent, child)
        away_m = np.linalg.norm(batch(link.translation_m, 3), axis=1).max()
        assert rate_off_rad_s(link, step_s) < within, (parent, child)
        # where the parent turns, the child's place turns with it; positions of some km are rounded to 1e-9 m
        assert velocity_off_m_s(link, step_s) < within * away_m + 1e-6, (parent, child)


# ----------------------------------------------------------------------------------------------- bits, text, chiefs


@pytest.mark.parametrize("name", [*MOTIONS, *(f"attitude {name}" for name in ATTITUDES)])
def test_an_epoch_has_the_same_bits_alone_in_any_order_and_after_writing(name, folder):
    law = ATTITUDES.get(name.removeprefix("attitude "), None) if name not in MOTIONS else None
    text = scenario_text(MOTIONS.get(name, RELATIVE["hill"]), law)
    scenario = rl.Scenario.loads(text, folder=folder, trust_code=True)
    times = np.array([0.0, 61.0, 137.3, 300.0, 900.0, 1203.71, 1800.0, 1999.9, 2100.0])
    whole = bits(motion.truth(scenario.bodies, epochs(times)))
    order = np.random.default_rng(3).permutation(len(times))
    mixed = bits(motion.truth(scenario.bodies, epochs(np.concatenate([times[order], [5.0, 1234.5]]))))
    assert same_bits({key: rows[order] for key, rows in whole.items()}, {key: rows[:-2] for key, rows in mixed.items()})
    for k in (0, 3, 7):
        alone = bits(motion.truth(scenario.bodies, epochs(times[k : k + 1])))
        assert same_bits({key: rows[k : k + 1] for key, rows in whole.items()}, alone), times[k]

    again = rl.Scenario.loads(scenario.dumps(), folder=folder, trust_code=True)
    if "tle" not in name:  # whose file is written out as lines
        assert again == scenario
    assert rl.Scenario.loads(again.dumps(), folder=folder, trust_code=True) == again
    assert same_bits(whole, bits(motion.truth(again.bodies, epochs(times))))


@pytest.mark.parametrize("about", ABOUT)
def test_a_relative_motion_about_any_chief(about, folder):
    """In the chief's turning axes; what is worked out from the chief's states has their errors too."""
    chief, more = MOTIONS[about], ""
    if about in RELATIVE:
        chief = chief.replace('"chief"', '"station"')
        more = f'[[target]]\nname = "station"\nmodel = "plate"\nmotion = {KEPLER}\n'
    at = np.concatenate([GRID_S, [0.0]])
    # About a theory, an exact orbit and another relative motion all fly; each of them also flies about some of the others.
    names = NEAR if about in ("j2", "kepler", "hill") else NEAR[ABOUT.index(about) % 4 :: 4]
    for name in names:
        bodies = rl.Scenario.loads(
            scenario_text(RELATIVE[name], None, chief, more), folder=folder, trust_code=True
        ).bodies
        poses = motion.truth(bodies, epochs(at)).poses
        link = poses["follower.rtn"]
        assert poses.parent("follower.rtn") == "chief.rtn"
        apart = np.linalg.norm(link.translation_m, axis=1)
        assert np.all(np.isfinite(apart))
        if "position_m" in (fields := bodies[-1].motion.model_dump()):
            assert np.allclose(link.translation_m[-1], fields["position_m"], rtol=0, atol=1e-6), name
            assert np.allclose(link.velocity_m_s[-1], fields["velocity_m_s"], rtol=0, atol=1e-9), name
        within = FAR_WAVES_M_S if name in DIFFERENCES else EXACT_M_S
        assert velocity_off_m_s(link[: len(GRID_S)]) < within, name
        assert rate_off_rad_s(link[: len(GRID_S)]) < (OWN_RAD_S if "state_space" in name else RATE_RAD_S), name


def test_about_an_open_chief_only_what_needs_no_mean_motion(folder):
    for name in ("hill", "yamanaka_ankersen", "relative_elements", "safety_ellipse", "lambert"):
        text = scenario_text(RELATIVE[name], None, ORBITS["kepler, open"])
        with pytest.raises(RsoLidarError, match=r"follower\.motion: .*: .*") as error:
            motion.truth(rl.Scenario.loads(text, folder=folder, trust_code=True).bodies, epochs(TIMES_S))
        assert "\n" not in str(error.value)
    text = scenario_text(RELATIVE["nonlinear"], None, ORBITS["kepler, open"])
    poses = motion.truth(rl.Scenario.loads(text, folder=folder, trust_code=True).bodies, epochs(GRID_S)).poses
    assert velocity_off_m_s(poses["follower.rtn"]) < SHORT_WAVES_M_S


def test_a_body_that_looks_at_one_that_moves_about_it_is_no_loop(folder):
    more = ATTITUDES["look_at"].replace("chief", "follower")
    text = scenario_text(RELATIVE["hill"], ATTITUDES["look_at"], KEPLER, f"attitude = {more}\n")
    truth = motion.truth(rl.Scenario.loads(text, folder=folder, trust_code=True).bodies, epochs(TIMES_S))
    for a, b in (("chief", "follower"), ("follower", "chief")):
        toward = truth.pose(a, b).translation
        assert np.allclose(toward[:, 1:], 0.0, atol=1e-9 * np.abs(toward[:, :1]).max())
        assert np.all(toward[:, 0] > 0.0)


def test_bodies_may_stand_in_any_order(folder):
    text = scenario_text(RELATIVE["hill"], ATTITUDES["look_at"], MOTIONS["hill"].replace('"chief"', '"station"'))
    with pytest.raises(ScenarioError, match="unknown body 'station'"):
        rl.Scenario.loads(text, folder=folder, trust_code=True)
    station = f'[[target]]\nname = "station"\nmodel = "plate"\nmotion = {KEPLER}\n'
    text = scenario_text(
        RELATIVE["hill"], ATTITUDES["look_at"], MOTIONS["hill"].replace('"chief"', '"station"'), station
    )
    bodies = rl.Scenario.loads(text, folder=folder, trust_code=True).bodies
    one, other = (motion.truth(order, epochs(TIMES_S)) for order in (bodies, bodies[::-1]))
    assert same_bits(bits(one), bits(other))


# ------------------------------------------------------------------------------------------------- small separations


def flown(kind, place, speed, chief, time_s):
    part = kind(relative_to="chief", position_m=tuple(place.tolist()), velocity_m_s=tuple(speed.tolist()))
    return part.relative(epochs(time_s), chief)


def chief_of(e, anomaly):
    """Return a chief with its perigee at 7000 km, and its rate there [rad/s]."""
    r, v = state_from_elements(OsculatingElements(7e6 / (1.0 - e), e, 0.9, 2.0, 4.0, anomaly))
    return State(epoch_utc=START, position_m=tuple(r.tolist()), velocity_m_s=tuple(v.tolist())), np.sqrt(
        GM * (1 + e) / 7e6**3
    )


directions = st.tuples(*[st.floats(-1.0, 1.0)] * 6).map(np.array).filter(lambda x: np.linalg.norm(x) > 0.1)


@settings(max_examples=20)
@given(directions, st.floats(-np.pi, np.pi))
def test_about_a_circle_both_linear_models_are_the_same(direction, anomaly):
    """The chief's velocity is rounded, e = 1e-16, its n to 2e-16: rounding of 1 km over a radian or two, times some tens."""
    chief, n = chief_of(0.0, anomaly)
    place, speed = 1000.0 * direction[:3], 1000.0 * n * direction[3:]
    (a, va), (b, vb) = (
        flown(kind, place, speed, chief, [0.0, 500.0, 2000.0, 6000.0]) for kind in (Hill, YamanakaAnkersen)
    )
    assert np.abs(a - b).max() < 1e-9
    assert np.abs(va - vb).max() < 1e-9 * n


@settings(max_examples=20)
@given(directions, st.floats(0.0, 0.7), st.floats(-np.pi, np.pi))
def test_linear_models_are_off_by_the_square_of_the_separation(direction, e, anomaly):
    """Halved separation, a quarter of the difference to two bodies; the rest is of third order, some rho^3 / q^2."""
    direction = direction / np.linalg.norm(direction)
    chief, n = chief_of(e, anomaly)
    time_s = np.linspace(0.0, 2.0 / n, 5)
    kinds = [YamanakaAnkersen, Hill] if e == 0.0 else [YamanakaAnkersen]
    for kind in kinds:
        off = []
        for rho in (20_000.0, 10_000.0):
            place, speed = rho * direction[:3], rho * n * direction[3:]
            exact, linear = (flown(model, place, speed, chief, time_s)[0] for model in (Nonlinear, kind))
            off.append(exact - linear)
        assert np.abs(off[0]).max() < 60.0 * 20_000.0**2 / 7e6
        assert np.abs(4.0 * off[1] - off[0]).max() < 200.0 * 20_000.0**3 / 7e6**2


@settings(max_examples=20)
@given(directions, st.floats(-np.pi, np.pi))
def test_clohessy_wiltshire_is_off_by_the_eccentricity_times_the_separation(direction, anomaly):
    """First order in e: halving a small e halves the difference from Yamanaka and Ankersen, to e^2 of the separation."""
    off = []
    for e in (2e-4, 1e-4):
        chief, _ = chief_of(e, anomaly)
        place, speed = 1000.0 * direction[:3], 1000.0 * 1.08e-3 * direction[3:]
        time_s = np.linspace(0.0, 2000.0, 5)
        linear, circular = (flown(kind, place, speed, chief, time_s)[0] for kind in (YamanakaAnkersen, Hill))
        off.append(linear - circular)
    assert np.abs(off[0]).max() < 80.0 * 2e-4 * 1000.0
    assert np.abs(2.0 * off[1] - off[0]).max() < 150.0 * 2e-4**2 * 1000.0

"""Every type of motion and of attitude law, as a scenario file says it, and the files that some of them need."""

import datetime

import numpy as np

from rso_lidar.orbit import Epochs, Kepler, State, StatedManeuver, write_ephemeris_csv, write_oem, write_opm

START = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)
WHEN = "epoch_utc = 2024-09-17T12:00:00Z"
ELEMENTS = (
    f"{WHEN}, semi_major_axis_km = 6928.137, eccentricity = 0.001, inclination_deg = 51.6, raan_deg = 40.0, "
    "argument_of_perigee_deg = 15.0, true_anomaly_deg = 70.0"
)
KEPLER = f'{{ type = "kepler", {ELEMENTS} }}'
PLACE = "position_m = [100.0, -900.0, 50.0], velocity_m_s = [0.05, -0.15, 0.1]"
FORCES = (
    "{ zonal_degree = 6, sun = true, moon = true, drag = { area_m2 = 4.0, mass_kg = 400.0 }, "
    "radiation_pressure = { area_m2 = 4.0, mass_kg = 400.0 } }"
)
STATE = "7e6, 1e5, 0.0, -86.0, 6036.0, 4528.0"  # nearly a circle
RIGID = "0.1, 0.2, 0.3, 0.9273618495495703, 0.001, -0.002, 0.003"

ORBITS = {
    "tle": '{ type = "tle", file = "low.tle" }',
    "tle of several sets": '{ type = "tle", file = "sets.tle", sets = "all" }',
    "omm": (
        f'{{ type = "omm", object_name = "LOW", norad_id = 99002, {WHEN}, mean_motion_rev_day = 15.05, eccentricity = 0.001,'
        " inclination_deg = 51.6, raan_deg = 40.0, argument_of_perigee_deg = 15.0, mean_anomaly_deg = 70.0, "
        "bstar_per_earth_radius = 1e-5 }"
    ),
    "kepler": KEPLER,
    "kepler, open": (
        f'{{ type = "kepler", {WHEN}, semi_major_axis_km = -7000.0, eccentricity = 2.0, inclination_deg = 30.0, '
        "raan_deg = 10.0, argument_of_perigee_deg = 20.0, true_anomaly_deg = -40.0 }"
    ),
    "state": f'{{ type = "state", {WHEN}, position_m = [7e6, 1e5, 0.0], velocity_m_s = [-86.0, 6036.0, 4528.0] }}',
    "j2": f'{{ type = "j2", {ELEMENTS} }}',
    "j2, osculating": f'{{ type = "j2", {ELEMENTS}, elements = "osculating" }}',
    "numerical": (
        f'{{ type = "numerical", initial = {KEPLER}, forces = {FORCES}, maneuvers = ['
        '{ type = "impulse", at_s = 300.0, delta_v_m_s = [0.1, 0.5, -0.2] }, '
        '{ type = "burn", from_s = 500.0, duration_s = 800.0, thrust_n = [0.0, 5.0, 0.0], mass_kg = 400.0, '
        "isp_s = 220.0 }] }"
    ),
    "numerical from a tle": '{ type = "numerical", initial = { type = "tle", file = "low.tle" } }',
    "ephemeris, OEM": '{ type = "ephemeris", file = "low.oem" }',
    "ephemeris, CSV": '{ type = "ephemeris", file = "low.csv", interpolation = "lagrange", degree = 9 }',
    "opm": '{ type = "opm", file = "low.opm" }',
    "state_space, inertial": (
        f'{{ type = "state_space", dynamics = "dynamics.py:two_bodies", initial_state = [{STATE}] }}'
    ),
    "state_space, inertial rigid body": (
        '{ type = "state_space", dynamics = "dynamics.py:two_bodies_turning", layout = "rigid_body", '
        f"initial_state = [{STATE}, {RIGID}] }}"
    ),
}
_ABOUT = 'relative_to = "chief"'
RELATIVE = {
    "hill": f'{{ type = "hill", {_ABOUT}, {PLACE} }}',
    "hill, forced": f'{{ type = "hill", {_ABOUT}, {PLACE}, acceleration_m_s2 = [1e-5, -2e-5, 3e-5] }}',
    "hill, curvilinear": f'{{ type = "hill", {_ABOUT}, {PLACE}, curvilinear = true }}',
    "yamanaka_ankersen": f'{{ type = "yamanaka_ankersen", {_ABOUT}, {PLACE} }}',
    "relative_elements": (
        f'{{ type = "relative_elements", {_ABOUT}, delta_a_m = 10.0, delta_lambda_m = -900.0, delta_ex_m = 50.0, '
        "delta_ey_m = 40.0, delta_ix_m = 30.0, delta_iy_m = -20.0 }"
    ),
    "relative_elements of two bodies": (
        f'{{ type = "relative_elements", {_ABOUT}, delta_lambda_m = -900.0, delta_ex_m = 50.0, j2 = false }}'
    ),
    "nonlinear": f'{{ type = "nonlinear", {_ABOUT}, {PLACE} }}',
    "nonlinear with forces": f'{{ type = "nonlinear", {_ABOUT}, {PLACE}, forces = {FORCES} }}',
    "nonlinear with maneuvers": (
        f'{{ type = "nonlinear", {_ABOUT}, {PLACE}, maneuvers = [{{ type = "impulse", at_s = 40.0, '
        'delta_v_m_s = [0.01, 0.02, -0.01], axes = "chief_rtn" }] }'
    ),
    "flown": (
        f'{{ type = "flown", plan = {{ type = "waypoints", {_ABOUT}, positions_m = [[0.0, -500.0, 0.0], '
        "[50.0, -200.0, 10.0], [0.0, -50.0, 0.0]], times_s = [0.0, 900.0, 1800.0], stop = true, hold_s = 60.0 }, "
        f"forces = {FORCES}, thrusters = {{ acceleration_m_s2 = 0.05, rise_s = 1.0, magnitude_sigma_fraction = 0.01 }}, "
        'guidance = { type = "two_impulse", at_s = [450.0, 1300.0], model = "clohessy_wiltshire" } }'
    ),
    "station_keeping": f'{{ type = "station_keeping", {_ABOUT}, position_m = [30.0, -100.0, 10.0] }}',
    "pulsed_station_keeping": (
        f'{{ type = "pulsed_station_keeping", {_ABOUT}, position_m = [30.0, -100.0, 10.0], arc_m = 2.0, '
        "duration_s = 1800.0 }"
    ),
    "perch": f'{{ type = "perch", {_ABOUT}, along_track_m = -900.0 }}',
    "glideslope": (
        f'{{ type = "glideslope", {_ABOUT}, from_m = [0.0, -900.0, 0.0], to_m = [0.0, -50.0, 0.0], '
        "initial_speed_m_s = 1.5, final_speed_m_s = 0.1, pulses = 6 }"
    ),
    "sequence": (
        f'{{ type = "sequence", {_ABOUT}, position_m = [0.0, -1000.0, 0.0], legs = [{{ type = "hop", '
        'to_m = [0.0, -300.0, 0.0], duration_s = 1800.0 }, { type = "station_keeping", '
        'until = { type = "time", duration_s = 600.0 } }] }'
    ),
    "v_bar_approach": f'{{ type = "v_bar_approach", {_ABOUT}, from_m = -900.0, to_m = -20.0, speed_m_s = 0.4 }}',
    "v_bar_approach by hops": f'{{ type = "v_bar_approach", {_ABOUT}, from_m = 900.0, to_m = 20.0, hops = 3 }}',
    "r_bar_approach": f'{{ type = "r_bar_approach", {_ABOUT}, from_m = -900.0, to_m = -20.0, hops = 3, speed_m_s = 0.4 }}',
    "hop": (
        f'{{ type = "hop", {_ABOUT}, from_m = [0.0, -3000.0, 0.0], to_m = [0.0, -300.0, 0.0], duration_s = 2000.0, '
        "stop = false }"
    ),
    "co_elliptic": f'{{ type = "co_elliptic", {_ABOUT}, radial_m = -500.0, from_m = -5000.0, to_m = 1000.0 }}',
    "circumnavigation": (
        f'{{ type = "circumnavigation", {_ABOUT}, radial_m = 100.0, cross_track_m = 50.0, phase_deg = 200.0 }}'
    ),
    "safety_ellipse": (
        f'{{ type = "safety_ellipse", {_ABOUT}, radial_m = 100.0, cross_track_m = 80.0, drift_m = 200.0, '
        "center_along_track_m = -1000.0 }"
    ),
    "teardrop": f'{{ type = "teardrop", {_ABOUT}, cusp_m = -300.0, period_s = 1500.0, loops = 2 }}',
    "forced_circumnavigation": (
        f'{{ type = "forced_circumnavigation", {_ABOUT}, radius_m = 50.0, period_s = 1200.0, axis = [1.0, 0.0, 1.0] }}'
    ),
    "waypoints": (
        f'{{ type = "waypoints", {_ABOUT}, positions_m = [[0.0, -500.0, 0.0], [50.0, -200.0, 10.0], [0.0, -50.0, 0.0]], '
        "times_s = [0.0, 900.0, 1800.0], stop = true, hold_s = 60.0 }"
    ),
    "rendezvous": (
        f'{{ type = "rendezvous", {_ABOUT}, position_m = [-900.0, -8000.0, 100.0], velocity_m_s = [0.0, 1.5, 0.0], '
        "duration_s = 2100.0 }"
    ),
    "lambert": (
        f'{{ type = "lambert", {_ABOUT}, from_m = [-1000.0, -8000.0, 100.0], to_m = [0.0, -100.0, 0.0], '
        "duration_s = 2100.0 }"
    ),
    "state_space, rtn": (
        f'{{ type = "state_space", dynamics = "dynamics.py:hill", axes = "rtn", {_ABOUT}, '
        "initial_state = [100.0, -900.0, 50.0, 0.05, -0.15, 0.1] }"
    ),
    "state_space, rtn rigid body": (
        f'{{ type = "state_space", dynamics = "dynamics.py:hill_turning", axes = "rtn", {_ABOUT}, layout = "rigid_body", '
        f"initial_state = [100.0, -900.0, 50.0, 0.05, -0.15, 0.1, {RIGID}] }}"
    ),
}
PLACES = {
    "fixed": '{ type = "fixed", position_m = [7e6, 0.0, 0.0] }',
    "fixed to a body": '{ type = "fixed", position_m = [3.0, 0.0, 0.0], relative_to = "chief" }',
    "table": '{ type = "table", file = "course.csv" }',
    "table about a body": '{ type = "table", file = "course.csv", relative_to = "chief" }',
}
MOTIONS = ORBITS | RELATIVE | PLACES

_SPIN = '{ type = "spin", axis = [1.0, 2.0, 3.0], rate_deg_s = 0.05 }'
_LIMITS = "at_s = 100.0, max_rate_deg_s = 0.5, max_acceleration_deg_s2 = 0.001"
_SUNWARD = '{ type = "sun_pointing", axis = [0.0, 1.0, 0.0] }'
ATTITUDES = {
    "fixed": '{ type = "fixed", euler_zyx_deg = [10.0, 20.0, 30.0] }',
    "rtn": '{ type = "rtn", euler_zyx_deg = [90.0, 5.0, 0.0] }',
    "lvlh_ccsds": '{ type = "lvlh_ccsds", euler_zyx_deg = [1.0, 2.0, 3.0] }',
    "look_at": '{ type = "look_at", at = "chief" }',
    "look_at, with up": '{ type = "look_at", at = "chief", up = [0.1, 0.2, 1.0] }',
    "spin": _SPIN,
    "tumble": '{ type = "tumble", inertia_kg_m2 = [10.0, 20.0, 25.0], body_rate_deg_s = [0.5, 1.0, -0.3] }',
    "sun_pointing": _SUNWARD,
    "nadir": '{ type = "nadir" }',
    "nadir, yaw steering": '{ type = "nadir", yaw_steering = true, euler_zyx_deg = [0.0, 5.0, 0.0] }',
    "table, AEM": '{ type = "table", file = "turn.aem" }',
    "table in rtn": '{ type = "table", file = "turn.csv", axes = "rtn" }',
    "slew, rtn to look_at": (
        '{ type = "slew", first = { type = "rtn" }, then = { type = "look_at", at = "chief" }, ' + f"{_LIMITS} }}"
    ),
    "slew, nadir to Sun": f'{{ type = "slew", first = {{ type = "nadir" }}, then = {_SUNWARD}, {_LIMITS} }}',
    "slew, spin to nadir": (
        f'{{ type = "slew", first = {_SPIN}, then = {{ type = "nadir", yaw_steering = true }}, {_LIMITS} }}'
    ),
    "slew, fixed to spin": f'{{ type = "slew", first = {{ type = "fixed" }}, then = {_SPIN}, {_LIMITS} }}',
    "state_space": (f'{{ type = "state_space", dynamics = "dynamics.py:turning", initial_state = [{RIGID}] }}'),
}

DYNAMICS = """
import numpy as np
GM, N = 3.986004418e14, 1.0948e-3


def two_bodies(t, x, u):
    return [*x[3:6], *(-GM * x[:3] / np.sqrt(x[0] ** 2 + x[1] ** 2 + x[2] ** 2) ** 3)]


def hill(t, x, u):
    return [*x[3:6], 3 * N * N * x[0] + 2 * N * x[4], -2 * N * x[3], -N * N * x[2]]


def turning(t, x, u):
    q, (p, r, s), w = x[:3], x[4:7], x[3]
    rate = np.array([p, r, s])
    return [*(0.5 * (w * rate + np.cross(q, rate))), -0.5 * (q[0] * p + q[1] * r + q[2] * s), -r * s / 4, p * s / 2, 0.0]


def two_bodies_turning(t, x, u):
    return [*two_bodies(t, x, u), *turning(t, x[6:], u)]


def hill_turning(t, x, u):
    return [*hill(t, x, u), *turning(t, x[6:], u)]
"""


def write_files(folder):
    """Write what the motions and attitudes name: element sets, ephemerides, tables and dynamics."""
    from scipy.spatial.transform import Rotation

    from rso_lidar.motion import write_aem, write_attitude_csv

    first, later = element_set(24261.25, 10.0), element_set(24261.775, 10.0 + 0.525 * 15.05 * 360.0 % 360.0)
    (folder / "low.tle").write_text("\n".join(first) + "\n")
    (folder / "sets.tle").write_text("\n".join([*first, *later]) + "\n")
    orbit = Kepler(
        epoch_utc=START,
        semi_major_axis_km=6928.137,
        eccentricity=0.001,
        inclination_deg=51.6,
        raan_deg=40.0,
        argument_of_perigee_deg=15.0,
        true_anomaly_deg=70.0,
    )
    epochs = Epochs(START, np.arange(-300.0, 3600.1, 60.0))
    write_oem(folder / "low.oem", "LOW", "2024-001A", epochs, orbit.states(epochs))
    first = orbit.states(Epochs(START, np.zeros(1)))
    state = State(
        epoch_utc=START,
        position_m=tuple(first.position_m[0].tolist()),
        velocity_m_s=tuple(first.velocity_m_s[0].tolist()),
    )
    burns = (StatedManeuver(300.0, (0.1, 0.5, -0.2)), StatedManeuver(500.0, (0.0, 2.0, 0.0), "rtn", 400.0, -0.5))
    write_opm(folder / "low.opm", "LOW", "2024-001A", state, mass_kg=400.0, maneuvers=burns)
    write_ephemeris_csv(folder / "low.csv", epochs, orbit.states(epochs))
    turns = Rotation.from_rotvec(epochs.time_s[:, None] * np.array([1e-3, -5e-4, 2e-3]))
    write_aem(folder / "turn.aem", "LOW", "2024-001A", epochs, turns)
    write_attitude_csv(folder / "turn.csv", epochs, turns)
    rows = [
        f"{t},{3.0 + 1e-3 * t},{-20.0 + 1e-6 * t * t},{2.0},{x},{y},{z},{w}"
        for t, (x, y, z, w) in zip(epochs.time_s.tolist(), turns.as_quat().tolist(), strict=True)
    ]
    (folder / "course.csv").write_text("time_s,x_m,y_m,z_m,qx,qy,qz,qw\n" + "\n".join(rows) + "\n")
    (folder / "dynamics.py").write_text(DYNAMICS)


def element_set(epoch, mean_anomaly_deg):
    """Return a name and the two lines of a synthetic object in low orbit."""
    lines = (
        f"1 99002U 24001B   {epoch:014.8f}  .00000000  00000-0  10000-4 0    1",
        f"2 99002  51.6000  40.0000 0010000  15.0000 {mean_anomaly_deg:8.4f} 15.05000000    1",
    )
    return ["LOW (SYNTHETIC)", *(f"{line}{checksum(line)}" for line in lines)]


def checksum(line):
    return sum(int(c) if c.isdigit() else c == "-" for c in line) % 10


def scenario_text(motion, attitude=None, chief=KEPLER, more=""):
    """Return a scenario whose follower moves so, about a target on the motion `chief`."""
    turned = f"attitude = {attitude}\n" if attitude else ""
    return f"""
version = 1
name    = "one motion"

[time]
start_utc     = 2024-09-17T12:00:00Z
duration_s    = 2000
frame_rate_hz = 0.01

[[target]]
name     = "chief"
model    = "plate"
motion   = {chief}
{more}
[follower]
motion   = {motion}
{turned}
[ptu]
point = {{ type = "track", at = "chief" }}

[lidar.laser]
energy_mj = 50

[lidar.receiver]
fov_deg  = 2.5
f_number = 2.8
n_rows   = 8
n_cols   = 8
rays_per_pixel = 1

[lidar.detector]
type = "empirical"
"""

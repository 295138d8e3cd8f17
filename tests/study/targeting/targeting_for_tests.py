"""Scenarios and targeter files that tests solve."""

import numpy as np

EARTH_GM_KM3_S2 = 398600.4418
RADIUS_KM = 6878.137
RATE_RAD_S = float(np.sqrt(EARTH_GM_KM3_S2 / RADIUS_KM**3))
START_M = (20.0, -100.0, 10.0)
HOLD_M = (0.0, -30.0, 0.0)
_EPOCH = "epoch_utc = 2024-09-17T12:00:00Z"


def circle(radius_km=RADIUS_KM, anomaly_deg=120.0):
    """Return the motion of a circular orbit."""
    return (
        f'{{ type = "kepler", {_EPOCH}, semi_major_axis_km = {radius_km}, eccentricity = 0.0, inclination_deg = 97.4, '
        f"raan_deg = 80, argument_of_perigee_deg = 0, true_anomaly_deg = {anomaly_deg} }}"
    )


def state(position_km, velocity_km_s):
    """Return the motion of a state in inertial axes."""
    metres, rates = (np.multiply(vector, 1000.0).tolist() for vector in (position_km, velocity_km_s))
    return f'{{ type = "state", {_EPOCH}, position_m = {metres}, velocity_m_s = {rates} }}'


def scenario(target, motion, impulses, duration_s=6000):
    """Return a scenario; impulses are rows of instant [s], delta-v (3,) [m/s] and axes."""
    rows = "".join(
        f'{{ type = "impulse", at_s = {at_s}, delta_v_m_s = {list(push)}, axes = "{axes}" }},\n'
        for at_s, push, axes in impulses
    )
    return f"""version = 1
name = "Targeting"
seed = 1
[time]
start_utc = 2024-09-17T12:00:00Z
duration_s = {duration_s}
frame_rate_hz = 0.01
[[target]]
name = "client"
model = "comsat"
motion = {target}
attitude = {{ type = "lvlh_ccsds" }}
[follower]
attitude = {{ type = "look_at", at = "client" }}
[follower.motion]
{motion}
maneuvers = [
{rows}]
[lidar]
preset = "gsfl_1064"
"""


def rendezvous(forces="", target=None, at_s=3600.0):
    """Return the scenario of a rendezvous by two impulses."""
    motion = (
        f'type = "nonlinear"\nrelative_to = "client"\nposition_m = {list(START_M)}\nvelocity_m_s = [0, 0, 0]\n{forces}'
    )
    pushes = [(0.0, (0.0, 0.1, 0.0), "chief_rtn"), (at_s, (0.0, 0.1, 0.0), "chief_rtn")]
    return scenario(target or circle(), motion, pushes)


def variable(place, low, high):
    """Return a variable of the maneuvers."""
    return f'[[variable]]\nfield = "follower.motion.maneuvers.{place}"\nlow = {low}\nhigh = {high}\n'


IMPULSES = "".join(variable(f"{k}.delta_v_m_s.{axis}", -2, 2) for k in (0, 1) for axis in range(3))
ARRIVAL = 'at_s = "follower.motion.maneuvers.1.at_s"\n'
HOLD = (
    f'[[goal]]\nquantity = "position_m"\n{ARRIVAL}equals = {list(HOLD_M)}\n'
    f'[[goal]]\nquantity = "velocity_m_s"\n{ARRIVAL}equals = [0, 0, 0]\n'
)


def write(folder, scenario_text, parts, head=""):
    """Write a scenario and its targeter, and return the path of the latter."""
    (folder / "flight.toml").write_text(scenario_text, encoding="utf-8")
    file = folder / "targeter.toml"
    file.write_text(f'version = 1\nname = "Rendezvous"\nscenario = "flight.toml"\n{head}\n{parts}', encoding="utf-8")
    return file


def clohessy_wiltshire(time_s):
    """Return the position's and velocity's dependence on the start, four matrices (3, 3) (Clohessy and Wiltshire 1960)."""
    n, t = RATE_RAD_S, time_s
    s, c = np.sin(n * t), np.cos(n * t)
    rr = np.array([[4 - 3 * c, 0, 0], [6 * (s - n * t), 1, 0], [0, 0, c]])
    rv = np.array([[s / n, 2 * (1 - c) / n, 0], [2 * (c - 1) / n, 4 * s / n - 3 * t, 0], [0, 0, s / n]])
    vr = np.array([[3 * n * s, 0, 0], [6 * n * (c - 1), 0, 0], [0, 0, -n * s]])
    vv = np.array([[c, 2 * s, 0], [-2 * s, 4 * c - 3, 0], [0, 0, c]])
    return rr, rv, vr, vv


def two_impulses_m_s(time_s, start_m=START_M, end_m=HOLD_M):
    """Return the two impulses (2, 3) [m/s] between points at rest after a time, in closed form."""
    rr, rv, vr, vv = clohessy_wiltshire(time_s)
    first = np.linalg.solve(rv, np.subtract(end_m, rr @ start_m))
    return np.array([first, -(vr @ start_m + vv @ first)])

"""How fast orbits and poses are: `python -m benchmarks.orbits` prints a table. Nothing here is asserted.

Every figure stands beside a peer's or a target's in the same run; peers that are not installed are named and skipped.
"""

import datetime
import importlib.util
import os
import sys
import time
from pathlib import Path

import numpy as np

import rso_lidar as rl
from benchmarks.encounters import encounters, pairs
from rso_lidar import motion, orbit
from rso_lidar.orbit import Fleet
from rso_lidar.shipped import shipped

START = datetime.datetime(2026, 5, 7, tzinfo=datetime.UTC)
DAY_S = 86_400.0


def best(work, repeats=5):
    """Return the shortest of several spans [s], and what the last gave."""
    spans, made = [], None
    for _ in range(repeats):
        began = time.perf_counter()
        made = work()
        spans.append(time.perf_counter() - began)
    return min(spans), made


def time_cpu(work):
    """Return the CPU time of this thread [s], which other work on the machine changes little."""
    began = time.thread_time()
    work()
    return time.thread_time() - began


def row(name, value, unit, target, note=""):
    """Print one line of the table."""
    print(f"  {name:<54}{value:>14,.3g} {unit:<10} {target:<16} {note}")


def installed(name):
    """Return whether a peer is installed, and say so if it is not."""
    there = importlib.util.find_spec(name) is not None
    if not there:
        print(f"  ({name} is not installed: skipped)")
    return there


def element_lines():
    """Return the two lines of the shipped fly-by's first object."""
    lines = [line for line in (shipped() / "tle" / "flyby.tle").read_text().splitlines() if line[:2] in ("1 ", "2 ")]
    return tuple(lines[:2])


def sgp4_rates():
    """TLE to GCRS at fresh epochs beside skyfield, and many sets to TEME beside SatrecArray."""
    from sgp4.api import Satrec, SatrecArray
    from skyfield.api import EarthSatellite, load

    lines = element_lines()
    tle = rl.Tle(lines=lines)
    start = tle.elements().epoch_utc
    n = 86_400
    shift = iter(range(1000))  # fresh epochs each time: nothing of the day before is known

    def ours():
        at = orbit.Epochs(start, np.arange(n) + 0.25 * next(shift))
        return at, tle.states(at)

    ours_s, (at, states) = best(ours)
    scale = load.timescale(builtin=True)
    satellite = EarthSatellite(*lines, ts=scale)

    def theirs():
        day = (next(shift) + np.arange(n)) / DAY_S
        return satellite.at(scale.utc(start.year, start.month, start.day + day)).position.m

    theirs_s, _ = best(theirs, 1)
    off_m = np.linalg.norm(satellite.at(at.skyfield_time()).position.m.T - states.position_m, axis=1).max()
    row("TLE to GCRS, 86,400 fresh epochs", n / ours_s, "states/s", "")
    row("  beside skyfield", theirs_s / ours_s, "times", ">= 20", f"apart {off_m * 1e3:.2g} mm (<= 1)")
    if installed("brahe"):
        _brahe(lines, start, n, ours_s)

    entry = tle.elements()
    which, time_s = np.arange(1000), np.linspace(0.0, DAY_S, 1000)
    at, fleet = orbit.Epochs(start, time_s), Fleet([entry] * 1000, start)
    models = SatrecArray([Satrec.twoline2rv(*lines) for _ in which])
    whole, fraction = at.utc_julian()
    pairs = [(best(lambda: fleet.grid(which, time_s), 1)[0], best(lambda: models.sgp4(whole, fraction), 1)[0])
             for _ in range(7)]  # fmt: skip
    ours_s, theirs_s = (min(column) for column in zip(*pairs, strict=True))
    row("1000 sets x 1000 epochs of a fleet in TEME", 1e6 / ours_s, "states/s", "")
    row("  beside SatrecArray", theirs_s / ours_s, "times", "", "ours masks sets without a state, and gives metres")


def _brahe(lines, start, n, ours_s):
    import brahe

    brahe.set_global_eop_provider(brahe.StaticEOPProvider.from_zero())
    propagator = brahe.SGPPropagator.from_tle(*lines, 60.0)
    first = brahe.Epoch.from_datetime(
        start.year, start.month, start.day, start.hour, start.minute, start.second + start.microsecond * 1e-6, 0.0,
        brahe.TimeSystem.UTC,
    )  # fmt: skip
    epochs = [first + 1.0 * k for k in range(n // 10)]
    began = time.perf_counter()
    propagator.states_gcrf(epochs)
    row(
        "  beside brahe",
        (time.perf_counter() - began) * 10.0 / ours_s,
        "times",
        ">= 20",
        "brahe: a tenth of the epochs",
    )


def closed_forms():
    """Kepler, Clohessy-Wiltshire and Yamanaka-Ankersen at many epochs."""
    n = 1_000_000
    at = orbit.Epochs(START, np.linspace(0.0, 5 * DAY_S, n))
    for eccentricity in (0.001, 0.7):
        axis_km = 7000.0 / (1.0 - eccentricity)
        chief = rl.Kepler(
            epoch_utc=START,
            semi_major_axis_km=axis_km,
            eccentricity=eccentricity,
            inclination_deg=51.6,
            raan_deg=10.0,
            argument_of_perigee_deg=20.0,
            mean_anomaly_deg=30.0,
        )
        seconds, _ = best(lambda chief=chief: chief.states(at), 3)
        row(f"Kepler, e = {eccentricity:g}, 1,000,000 epochs", n / seconds, "states/s", ">= 2 M")
        if eccentricity < 0.1:
            hill = rl.Hill(relative_to="chief", position_m=(0.0, -1000.0, 0.0), velocity_m_s=(0.0, 0.1, 0.0))
            seconds, _ = best(lambda chief=chief, hill=hill: hill.relative(at, chief), 3)
            row("Clohessy-Wiltshire, 1,000,000 epochs", n / seconds, "states/s", ">= 10 M")
        eccentric = rl.rpo.YamanakaAnkersen(
            relative_to="chief", position_m=(0.0, -1000.0, 0.0), velocity_m_s=(0.0, 0.1, 0.0)
        )
        seconds, _ = best(lambda chief=chief, eccentric=eccentric: eccentric.relative(at, chief), 3)
        row(f"Yamanaka-Ankersen, e = {eccentricity:g}, 1,000,000 epochs", n / seconds, "states/s", ">= 2 M")


def poses():
    """The whole chain inertial - target - follower - PTU - lidar in batch, and one closed-loop step."""
    scenario = rl.Scenario.load(Path(__file__).resolve().parents[1] / "examples" / "tdrs_approach.toml")
    n = 100_000
    at = orbit.Epochs(scenario.time.start_utc, np.linspace(0.0, 2699.0, n))

    def chain():
        course = motion.truth(scenario.bodies, at)
        angles = motion.compute_demand(scenario.ptu, scenario.bodies, course)
        tree = motion.add_lidar(course.poses, scenario.ptu, angles, np.zeros_like(angles), scenario.lidar.mount)
        return tree.place("lidar", "tdrs")

    seconds, _ = best(chain)
    row("lidar_from_target, motion and PTU included, 100,000", n / seconds, "poses/s", ">= 300,000")

    seconds, n = best(make_closed_loop(scenario), 3)
    row("closed loop, attitude and PTU, a step of 50 ms", 1e6 * seconds / n, "us", "<= 100")


def make_closed_loop(scenario):
    """Make a function that flies n steps of attitude and PTU, and returns n."""
    spin = rl.Spin(axis=(0.0, 0.0, 1.0), rate_deg_s=1.0)
    asked = motion.make_demand(scenario.ptu, scenario.bodies, scenario.time.start_utc, 100.0, local=False)
    rng = np.random.default_rng(0)

    def steps(n=500, step_s=0.05):
        state = motion.start(scenario.ptu, asked)
        for k in range(1, n):
            state = motion.step(scenario.ptu, state, asked, k * step_s)
            motion.sense(scenario.ptu, state, rng)
            spin.orientation(k * step_s)
        return n

    return steps


def rigid_body(_t, x, u):
    """Clohessy and Wiltshire with thrust u[:3] [m/s2] in rtn axes, and Euler's equations with torque u[3:] [N m]."""
    px, _, pz, vx, vy, vz, qx, qy, qz, qw, wx, wy, wz = x.tolist()
    fx, fy, fz, tx, ty, tz = u.tolist()
    n, (ix, iy, iz) = 1.1e-3, (10.0, 15.0, 20.0)
    moved = (vx, vy, vz, 3.0 * n * n * px + 2.0 * n * vy + fx, -2.0 * n * vx + fy, -n * n * pz + fz)
    turned = (qw * wx - qz * wy + qy * wz, qz * wx + qw * wy - qx * wz, -qy * wx + qx * wy + qw * wz)
    faster = (tx - (iz - iy) * wy * wz) / ix, (ty - (ix - iz) * wz * wx) / iy, (tz - (iy - ix) * wx * wy) / iz
    return (*moved, *(0.5 * rate for rate in turned), -0.5 * (qx * wx + qy * wy + qz * wz), *faster)


def flown():
    """Closed-loop steps without a flash of a follower that flight software pushes and turns."""
    examples = Path(__file__).resolve().parents[1] / "examples"
    reference = make_closed_loop(rl.Scenario.load(examples / "tdrs_approach.toml"))
    drive = 'ptu={response={type="second_order", natural_hz=4, damping=0.7, max_rate_deg_s=30}}'
    units = '{type="gyro", name="gyro", rate_hz=100}', '{type="accelerometer", name="accelerometer", rate_hz=100}'
    scenario = rl.Scenario.load(
        examples / "thrusters.toml",
        ("time.frame_rate_hz=0.1", drive, f"sensor=[{', '.join(units)}]"),
        trust_code=True,
    )
    body = motion.StateSpace(
        dynamics=rigid_body,
        axes="rtn",
        relative_to="stage",
        layout="rigid_body",
        initial_state=(3, -120, -2, 0.02, -0.15, 0.01, 0, 0, 2**-0.5, 2**-0.5, 1e-3, 2e-3, -1e-3),
        inputs=(0,) * 6,
    )
    follower = scenario.follower.replace(motion=body, attitude=None)
    for what, flying in (
        ("thrust and torque, PTU, gyro and accelerometer", scenario.replace(follower=follower)),
        ("the same, thrust alone and the attitude a law", scenario),
    ):
        simulation = rl.Simulation(flying, threads=1)
        simulation.step()
        n_inputs = len(flying.follower.motion.inputs)

        def steps(simulation=simulation, n_inputs=n_inputs, n=60):
            for k in range(n):
                pushes = (1e-5 * (k % 3), *(1e-5,) * (n_inputs - 1))
                command = rl.Command(pan_rad=1e-3 * (k % 7), tilt_rad=0.0, inputs={"follower": pushes})
                simulation.step(command, dt_s=0.01)

        pairs = np.array([(time_cpu(reference) / 500, time_cpu(steps) / 60) for _ in range(10)])
        row(f"a step of 10 ms, no flash: {what}", 1e6 * pairs[:, 1].min(), "us of CPU", "")
        row("  beside the step of attitude and PTU", np.median(pairs[:, 1] / pairs[:, 0]), "times", "<= 2")


def main():
    """Print the table."""
    print(f"orbits and poses; {os.cpu_count()} cores, best of a few")
    sgp4_rates()
    closed_forms()
    poses()
    flown()
    encounters()
    pairs()


if __name__ == "__main__":
    sys.exit(main())

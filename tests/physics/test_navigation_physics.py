"""Navigation filter from noisy sensors: consistency of its innovations and errors over fifty runs."""

import functools
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from rso_lidar import motion, sensors, track
from rso_lidar.motion import lidar_from_ptu
from rso_lidar.pose import matrix_from_vector
from rso_lidar.records import BodyState
from rso_lidar.rpo import CentroidWander, SensorBias
from rso_lidar.track.navigation.two_orbits import predict_orbits
from tests.sensors.motion_for_tests import make_motion

RUNS, END_S, GRID_S = 50, 14.0, 0.5
JUDGED_S = (5.5, 9.5, 13.5)  # when only GNSS measures, so once in each run
GYRO = sensors.Gyro(
    name="gyro", rate_hz=4.0, phase_s=0.05, mount={"euler_zyx_deg": (30.0, 20.0, 10.0)}, angle_random_walk_deg_sqrt_h=0.15,
    bias_instability_deg_h=3.0, rate_random_walk_deg_h_sqrt_h=2.0, turn_on_bias_deg_h=20.0,
)  # fmt: skip
TRACKER = sensors.StarTracker(
    name="tracker", rate_hz=1.0, mount={"euler_zyx_deg": (0.0, -90.0, 0.0)}, cross_boresight_arcsec=6.0,
    boresight_arcsec=40.0, slow_cross_boresight_arcsec=5.0, slow_boresight_arcsec=20.0, correlation_s=50.0,
    misalignment_arcsec=10.0,
)  # fmt: skip
GNSS = sensors.Gnss(
    name="gnss", rate_hz=1.0, phase_s=0.5, position_noise_m=1.0, slow_position_m=3.0, velocity_noise_m_s=0.03,
    slow_velocity_m_s=0.01, vertical_ratio=1.5, correlation_s=100.0, antenna_m=(1.0, 0.5, 0.0),
)  # fmt: skip
RELATIVE = sensors.RelativeGnss(
    name="relative", rate_hz=0.5, target="stage", position_noise_m=0.1, slow_position_m=0.2, velocity_noise_m_s=0.01,
    correlation_s=100.0,
)  # fmt: skip
PARTS = {"gyro": GYRO, "star_tracker": TRACKER, "gnss": GNSS, "relative_gnss": RELATIVE}
BODY_FROM_LIDAR, ORIGIN_M = lidar_from_ptu().inv().as_matrix(), np.array([0.2, 0.0, 0.4])
FIX_SIGMA_M = np.array([0.005, 0.005, 0.02])  # across the line of sight, and along it
START = np.array([7e6, 0, 0, 0, 4.66e3, 5.87e3, -30.0, 100.0, 20.0, 0.05, -0.1, 0.02])
ACCELERATIONS = {"own": 1e-3, "target": 3e-4}  # m/s²/√Hz
TUMBLE = motion.Tumble(inertia_kg_m2=(10.0, 20.0, 25.0), body_rate_deg_s=(2.0, 3.0, -1.5))
SIGMA = np.repeat([10.0, 0.3, 3.0, 0.1, 0.01], 3)  # of the estimate at the start


@functools.cache
def attitudes(first_s, step_s, count):
    turned, rate = TUMBLE.orientation(first_s + step_s * np.arange(count))
    return turned, rate


def fly(rng):
    """Return the true states (grid, 12) of both bodies under white accelerations."""
    states = [START]
    for _ in range(round(END_S / GRID_S)):
        state, _, noise = predict_orbits(
            states[-1], GRID_S, own_m_s2_sqrt_hz=ACCELERATIONS["own"], target_m_s2_sqrt_hz=ACCELERATIONS["target"]
        )
        states.append(state + np.linalg.cholesky(noise + 1e-20 * np.eye(12)) @ rng.normal(size=12))
    return np.array(states)


def measure(part, states, seed):
    """Return what a sensor measures in a run; a gyro needs no place, so it may sample between the points of the grid."""
    times = sensors.read_schedule(part).time_samples(range(math.ceil((END_S - part.phase_s) * part.rate_hz)))
    turned, rate = attitudes(times[0], times[1] - times[0], len(times))
    there = states[np.rint(times / GRID_S).astype(int)]
    motion_of = make_motion(
        times, position_m=there[:, :3], velocity_m_s=there[:, 3:6], quaternion_xyzw=turned.as_quat(),
        angular_velocity_rad_s=rate, targets={"stage": BodyState(there[:, 6:9], there[:, 9:])},
    )  # fmt: skip
    return part.measure(motion_of, sensors.make_key(seed, part.name), 0)[0]


def run(seed, slow=None, knows_slow=True, **changed):
    """Return the updates of a filter in one run, and its normalised errors squared (NEES).

    The filter has slow errors of fixes as states where it knows of them.
    """
    rng = np.random.default_rng(seed)
    states = fly(rng)
    error = SIGMA * rng.normal(size=15)
    first = states[0] + error[:12]
    start = attitudes(0.0, GRID_S, len(states))[0].as_matrix()
    estimate = track.NavigationEstimate(
        0.0, first[:3], first[3:6], first[6:9], first[9:], start[0] @ matrix_from_vector(error[12:]), np.diag(SIGMA**2)
    )
    found = {name: measure(part, states, seed) for name, part in PARTS.items()}
    parts = PARTS | changed
    navigation = track.NavigationFilter(
        estimate,
        **parts,
        own_acceleration_m_s2_sqrt_hz=ACCELERATIONS["own"],
        target_acceleration_m_s2_sqrt_hz=ACCELERATIONS["target"],
        **(slow or {} if knows_slow else {}),
    )
    tracker, gnss, relative, gyro = (found[name] for name in ("star_tracker", "gnss", "relative_gnss", "gyro"))
    attitude = Rotation.from_quat(tracker.quaternion_xyzw).as_matrix()
    events = [(t, navigation.update_attitude, (attitude[k],)) for k, t in enumerate(tracker.time_s)]
    events += [
        (t, navigation.update_position, (gnss.position_m[k], gnss.velocity_m_s[k])) for k, t in enumerate(gnss.time_s)
    ]
    events += [
        (t, navigation.update_relative, (relative.relative_position_m[k], relative.relative_velocity_m_s[k]))
        for k, t in enumerate(relative.time_s)
    ]
    shifts = draw_shifts(np.random.default_rng([seed, 1]), states, start) if slow else np.zeros((len(states), 3))
    for k in range(0, len(states), 2):
        seen = BODY_FROM_LIDAR.T @ (start[k].T @ states[k, 6:9] - ORIGIN_M) + FIX_SIGMA_M * rng.normal(size=3)
        seen = seen + BODY_FROM_LIDAR.T @ start[k].T @ shifts[k]
        events.append((GRID_S * k, navigation.update_fix, (seen, np.diag(FIX_SIGMA_M**2), BODY_FROM_LIDAR, ORIGIN_M)))
    nees, rates = [], list(zip(gyro.time_s, gyro.angular_velocity_rad_s, strict=True))
    for time_s, update, measured in sorted(events, key=lambda event: event[0]):
        while rates and navigation.last_rate_s < time_s:
            navigation.add_rate(*rates.pop(0))
        update(time_s, *measured)
        if time_s in JUDGED_S:
            k, now = round(time_s / GRID_S), navigation.copy().estimate(time_s)
            estimated = (now.position_m, now.velocity_m_s, now.relative_position_m, now.relative_velocity_m_s)
            turn = Rotation.from_matrix(now.inertial_from_body.T @ start[k]).as_rotvec()
            wrong = np.concatenate([states[k] - np.concatenate(estimated), turn])
            nees.append(wrong @ np.linalg.solve(now.covariance, wrong))
    return navigation.updates, nees


SLOW = {
    "bias": SensorBias(range_sigma_m=0.3),
    "centroid": CentroidWander(along_sigma_m=0.2, across_sigma_m=0.1, correlation_time_s=8.0),
}


def draw_shifts(rng, states, attitude):
    """Return by how much what is seen lies off the target (grid, 3) [m], inertial axes: a bias of range and a wander."""
    decay, sigma = np.exp(-GRID_S / 8.0), np.array([0.2, 0.1, 0.1])
    bias_m, wander, shifts = 0.3 * rng.normal(), sigma * rng.normal(size=3), []
    for k, state in enumerate(states):
        along = state[6:9] - attitude[k] @ ORIGIN_M
        along /= np.linalg.norm(along)
        normal = np.cross(state[:3] + state[6:9], state[3:6] + state[9:])
        in_plane = np.cross(normal, along)
        in_plane /= np.linalg.norm(in_plane)
        shifts.append((bias_m + wander[0]) * along + wander[1] * in_plane + wander[2] * np.cross(along, in_plane))
        wander = decay * wander + np.sqrt(1.0 - decay**2) * sigma * rng.normal(size=3)
    return np.array(shifts)


def test_fixes_with_a_bias_and_a_wandering_centroid_are_consistent_where_these_are_states():
    """Twelve runs: mean NEES at three instants and mean NIS of fixes within 99.9 %; in four without the states above."""
    for knows_slow in (True, False):
        runs = [run(seed, slow=SLOW, knows_slow=knows_slow) for seed in range(12 if knows_slow else 4)]
        nis = [update.nis for updates, _ in runs for update in updates if update.source == "lidar"]
        nees = np.array([each for _, each in runs]).mean(axis=0)
        low, high = mean_bounds(15, len(runs))
        if knows_slow:
            assert (low < nees).all()
            assert (nees < high).all()
            assert mean_bounds(3, len(nis))[0] < np.mean(nis) < mean_bounds(3, len(nis))[1]
        else:
            assert (nees > 1.5 * high).all()


def mean_bounds(freedom, count):
    """Return the bounds of the mean of chi-square numbers, exceeded once in a thousand."""
    return chi2.ppf([5e-4, 1.0 - 5e-4], freedom * count) / count


def test_innovations_and_errors_of_fifty_runs_are_chi_square(validation):
    runs = [run(seed) for seed in range(RUNS)]
    sources = {"tracker": 3, "gnss": 6, "relative": 6, "lidar": 3}
    for source, freedom in sources.items():
        nis = [update.nis for updates, _ in runs for update in updates if update.source == source]
        assert len(nis) >= 7 * RUNS
        low, high = mean_bounds(freedom, len(nis))
        validation(
            case=f"navigation filter, 50 runs: mean NIS of {source}", source="chi-square distribution", expected=freedom,
            got=np.mean(nis), tolerance=max(high - freedom, freedom - low), unit="1",
        )  # fmt: skip
    nees = np.array([each for _, each in runs])
    assert nees.shape == (RUNS, len(JUDGED_S))
    low, high = mean_bounds(15, RUNS)
    for k, time_s in enumerate(JUDGED_S):
        validation(
            case=f"navigation filter, 50 runs: mean NEES after {time_s:g} s", source="chi-square distribution",
            expected=15.0, got=nees[:, k].mean(), tolerance=max(high - 15.0, 15.0 - low), unit="1",
        )  # fmt: skip


@pytest.mark.parametrize(
    ("name", "source", "changes"),
    [
        ("star_tracker", "tracker", {"cross_boresight_arcsec": 2.0, "boresight_arcsec": 13.0}),
        ("gnss", "gnss", {"position_noise_m": 0.33, "velocity_noise_m_s": 0.01}),
        ("gyro", "tracker", {"angle_random_walk_deg_sqrt_h": 0.01, "turn_on_bias_deg_h": 1.0}),
    ],
)
def test_a_filter_that_assumes_too_little_noise_is_seen(name, source, changes):
    updates, _ = run(0, **{name: PARTS[name].replace(**changes)})
    nis = [update.nis for update in updates if update.source == source]
    freedom = len(updates[0].innovation) if source == "tracker" else 6
    assert np.mean(nis) > mean_bounds(freedom, len(nis))[1]

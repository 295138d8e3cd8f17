"""What no plan is beyond: times, speeds, distances and numbers of pieces are refused in one line that names the key."""

import datetime
import math
import tracemalloc

import numpy as np
import pytest

from rso_lidar import rpo, units
from rso_lidar.errors import ScenarioError
from rso_lidar.orbit import Epochs, Kepler

START = datetime.datetime(2026, 5, 1, tzinfo=datetime.UTC)
C = {"relative_to": "station"}
BACK, NEAR = (0.0, -1000.0, 0.0), (0.0, -50.0, 0.0)
STATION = Kepler(
    epoch_utc=START,
    semi_major_axis_km=6928.137,
    eccentricity=0.001,
    inclination_deg=51.6,
    raan_deg=35.0,
    argument_of_perigee_deg=0.0,
    true_anomaly_deg=0.0,
)
REVOLUTION = math.tau / math.sqrt(units.EARTH_GM_M3_S2 / 6928.137e3**3)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        # faster than any orbit about the Earth
        (lambda: rpo.Hop(**C, from_m=BACK, to_m=NEAR, duration_s=1e-9), "duration_s: the plan needs .* m/s, faster"),
        (
            lambda: rpo.Lambert(**C, from_m=BACK, to_m=NEAR, duration_s=1e-9),
            "duration_s: the plan needs .* m/s, faster",
        ),
        (
            lambda: rpo.ForcedCircumnavigation(**C, radius_m=50.0, period_s=1e-12),
            "period_s: the plan needs .* m/s, fas",
        ),
        (lambda: rpo.VBarApproach(**C, from_m=-100.0, to_m=-50.0, speed_m_s=1e9), "speed_m_s: the plan needs .* m/s"),
        (
            lambda: rpo.Rendezvous(**C, position_m=BACK, velocity_m_s=(0.0, 1e9, 0.0), duration_s=1000.0),
            "velocity_m_s: 1e.09 m/s is faster than bodies pass",
        ),
        (
            lambda: rpo.Nonlinear(**C, position_m=BACK, velocity_m_s=(0.0, 1e9, 0.0)),
            "velocity_m_s: 1e.09 m/s is faster",
        ),
        # longer than ten years
        (lambda: rpo.Hop(**C, from_m=BACK, to_m=NEAR, duration_s=1e12), "duration_s: .* years are too long"),
        (lambda: rpo.Lambert(**C, from_m=BACK, to_m=NEAR, duration_s=1e11), "duration_s: .* years are too long"),
        (lambda: rpo.Waypoints(**C, positions_m=(BACK, NEAR), times_s=(0.0, 1e10)), r"times_s\[1\]: .* years are too"),
        (lambda: rpo.Waypoints(**C, positions_m=(BACK, NEAR), speed_m_s=1e-12), "speed_m_s: the plan takes .* years"),
        (
            lambda: rpo.VBarApproach(**C, from_m=-100.0, to_m=-50.0, speed_m_s=1e-12),
            "speed_m_s: the plan takes .* year",
        ),
        (lambda: rpo.CoElliptic(**C, radial_m=1e-12, from_m=1.0, to_m=-1000.0), "radial_m: the plan takes .* years"),
        # farther than the Earth's centre
        (
            lambda: rpo.Waypoints(**C, positions_m=(BACK, (0.0, 1e9, 0.0)), times_s=(0.0, 1e4)),
            r"positions_m\[1\]: 1e.06 km is farther",
        ),
        (lambda: rpo.StationKeeping(**C, position_m=(1e7, 0.0, 0.0)), "position_m: 1e.04 km is farther"),
        (lambda: rpo.SafetyEllipse(**C, radial_m=1e9, cross_track_m=9.0), "radial_m: 1e.06 km is farther"),
        (
            lambda: rpo.CoElliptic(**C, radial_m=1e5, from_m=0.0, duration_s=1e6),
            "duration_s: the plan leads .* km away, farther",
        ),
        # more pieces than can be looked at
        (lambda: rpo.Teardrop(**C, cusp_m=100.0, turn_m=20.0, loops=100_000), "loops: a plan has at most 1000 of them"),
        (
            lambda: rpo.VBarApproach(**C, from_m=-100.0, to_m=-50.0, hops=100_000),
            "hops: a plan has at most 1000 of them",
        ),
        # angles that begin again
        (
            lambda: rpo.RelativeElements(**C, delta_lambda_m=-1e9),
            "delta_lambda_m: -1e.06 km is more than half the chief",
        ),
    ],
)
def test_what_means_nothing_is_refused_at_once(make, says):
    with pytest.raises(ScenarioError, match=says) as error:
        make().relative(Epochs(START, np.zeros(1)), STATION)
    assert "\n" not in str(error.value)


def test_what_is_just_within_is_flown():
    for part in (
        rpo.Hop(**C, from_m=BACK, to_m=NEAR, duration_s=0.1),
        rpo.Lambert(**C, from_m=BACK, to_m=NEAR, duration_s=0.1),
        rpo.RelativeElements(**C, delta_lambda_m=-2e7),
        rpo.Nonlinear(**C, position_m=BACK, velocity_m_s=(0.0, -15e3, 0.0)),
    ):
        assert np.all(np.isfinite(part.relative(Epochs(START, np.zeros(1)), STATION)[0]))


def test_a_thousand_loops_are_told():
    plan = rpo.Teardrop(**C, cusp_m=100.0, turn_m=20.0, loops=1000).plan(START, STATION)
    assert plan.describe()


@pytest.mark.parametrize(
    "horizon_s",
    [0, -5, 0.0, -1e-9, math.nan, math.inf, -math.inf, 1e10, 10**400, "1", True, [1.0], np.array([1.0, 2.0])],
)
def test_a_horizon_that_is_no_time_is_refused(horizon_s):
    plan = rpo.Hop(**C, from_m=BACK, to_m=NEAR, duration_s=1000.0).plan(START, STATION)
    with pytest.raises(ScenarioError, match=r"horizon_s: .* is not a valid duration of a drift; give seconds") as error:
        plan.passive_safety_m(horizon_s)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    "part",
    [
        rpo.Hop(**C, from_m=BACK, to_m=NEAR, duration_s=1000.0),
        rpo.VBarApproach(**C, from_m=-500.0, to_m=-20.0, speed_m_s=0.2),
        rpo.SafetyEllipse(**C, radial_m=80.0, cross_track_m=100.0, duration_s=3e8),
    ],
    ids=lambda part: part.type,
)
def test_the_work_is_bounded_whatever_the_horizon(part):
    plan = part.plan(START, STATION)
    horizons = (0.001, 2.0 * REVOLUTION, 1e5, 1e6, 3e8)
    tracemalloc.start()
    try:
        found = [plan.passive_safety_m(horizon_s) for horizon_s in horizons]
        _, most_bytes = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert most_bytes < 100e6  # 39 MB; it was many GB
    assert np.all(np.diff(found) <= 1e-6)  # a longer drift is no safer
    if part.type == "safety_ellipse":
        assert found == pytest.approx([part.radial_m] * 5)  # begins there, and always returns
    plan.nearest()


def test_flattening_is_told_of_free_flight_and_names_the_operation():
    day, hour = Epochs(START, np.array([0.0, 86_400.0])), Epochs(START, np.array([0.0, 3600.0]))
    free = [
        rpo.SafetyEllipse(**C, radial_m=80.0, cross_track_m=100.0),
        rpo.Circumnavigation(**C, radial_m=80.0),
        rpo.Teardrop(**C, cusp_m=100.0, turn_m=20.0, loops=50),
        rpo.VBarApproach(**C, from_m=-200.0, to_m=-50.0, hops=40),
        rpo.CoElliptic(**C, radial_m=10.0, from_m=-300.0, duration_s=5.0),
        rpo.Lambert(**C, from_m=BACK, to_m=NEAR, duration_s=3.4 * REVOLUTION, revolutions=3),
    ]
    for part in free:
        (only,) = part.validity(day, STATION)
        assert only.startswith(f"{part.type}: in ")
        assert "the Earth's flattening" in only
        assert "use relative_elements, or nonlinear with forces" in only
        assert part.validity(hour, STATION) == []
    # what thrust holds does not move, and what has arrived is held
    for part in (
        rpo.StationKeeping(**C, position_m=BACK),
        rpo.ForcedCircumnavigation(**C, radius_m=50.0, period_s=1200.0),
        rpo.Hop(**C, from_m=BACK, to_m=NEAR, duration_s=1000.0),
    ):
        assert part.validity(day, STATION) == []


@pytest.mark.parametrize(("inclination_deg", "anomaly_deg"), [(51.6, 0.0), (97.6, 70.0), (97.6, 90.0), (97.6, 160.0)])
def test_flattening_bounds_what_an_integration_finds(inclination_deg, anomaly_deg):
    """Two bodies against J2 integrated: it moves a ring about a chief by up to 4.5 % of the separation a revolution."""
    from rso_lidar.orbit import Forces
    from rso_lidar.rpo.relative.hill import describe_flattening, find_start_state

    chief = STATION.replace(inclination_deg=inclination_deg, true_anomaly_deg=anomaly_deg, eccentricity=0.0)
    epochs = Epochs(START, np.linspace(0.0, 2.0 * REVOLUTION, 41))
    ring = rpo.Circumnavigation(**C, radial_m=100.0).relative(Epochs(START, np.zeros(1)), chief)
    start = {"position_m": tuple(ring[0][0].tolist()), "velocity_m_s": tuple(ring[1][0].tolist())}
    plain = rpo.Nonlinear(**C, **start).relative(epochs, chief)[0]
    real = rpo.Nonlinear(**C, **start, forces=Forces(zonal_degree=2)).relative(epochs, chief)[0]
    off = np.linalg.norm(real - plain, axis=1)[-1] / np.linalg.norm(plain, axis=1).max()
    (told,) = describe_flattening("ring", epochs, *find_start_state(chief, START))
    share = float(told.split("by up to ")[1].split("%")[0]) / 100.0
    assert 0.2 * share < off < share

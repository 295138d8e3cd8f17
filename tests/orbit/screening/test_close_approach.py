"""Minima of rounding are one; those of a formation, as low as each other, are counted."""

import datetime

import numpy as np

from rso_lidar.orbit import Kepler, NamedTrajectory, screen
from rso_lidar.orbit.screening.close_approach import select_distinct_minima

START = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)


def orbit(anomaly_deg, eccentricity=0.0):
    return Kepler(
        epoch_utc=START, semi_major_axis_km=7000.0, eccentricity=eccentricity, inclination_deg=50.0, raan_deg=10.0,
        argument_of_perigee_deg=0.0, true_anomaly_deg=anomaly_deg,
    )  # fmt: skip


def test_a_rise_of_more_than_rounding_separates_two_minima():
    range_m = np.array([1.0, 1.0 + 1e-7, 1.0, 2.0, 1.0, 1.0 + 1e-9, 1.0 - 1e-3])
    assert select_distinct_minima(range_m, np.array([0, 2, 4, 6])).tolist() == [0, 6]
    assert select_distinct_minima(range_m, np.array([2, 4])).tolist() == [2, 4]


def test_two_bodies_on_one_circle_have_one_minimum():
    found = screen(NamedTrajectory("a", orbit(0.0)), [NamedTrajectory("b", orbit(0.01))], START, 86_400.0, 50e3)
    assert [len(one.minima_s) for one in found.approaches] == [1]
    two = screen(NamedTrajectory("a", orbit(0.0)), [NamedTrajectory("b", orbit(0.01, 1e-4))], START, 86_400.0, 50e3)
    assert sum(len(one.minima_s) for one in two.approaches) > 10  # once or twice a revolution, of 14.8 a day

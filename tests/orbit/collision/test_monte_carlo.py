"""Monte Carlo: where lines are straight it is Foster's, its two ways agree, and it says how sure it is."""

import math

import numpy as np
import pytest

from rso_lidar import units
from rso_lidar.errors import PropagationError, ScenarioError
from rso_lidar.orbit import SampledProbability, UncertainState, foster_probability, sample_collisions
from rso_lidar.orbit.collision.monte_carlo import MOST_SAMPLES, choose_samples

RADIUS = 7e6
SPEED = math.sqrt(units.EARTH_GM_M3_S2 / RADIUS)


def make_pair(miss_m=(10.0, 25.0, 0.0), angle_deg=30.0, sigma_m=20.0):
    """Return two objects on circular orbits that cross at an angle."""
    c, s = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
    covariance = np.diag([sigma_m**2, 4.0 * sigma_m**2, sigma_m**2, 1e-4, 1e-4, 1e-4])
    first = UncertainState([RADIUS, 0.0, 0.0], [0.0, SPEED, 0.0], covariance)
    return first, UncertainState([RADIUS + miss_m[0], miss_m[1], miss_m[2]], [0.0, SPEED * c, SPEED * s], covariance)


def test_a_fast_encounter_is_fosters():
    first, second = make_pair()
    found = sample_collisions(first, second, 12.0, rng=np.random.default_rng(4), samples=200_000)
    expected = foster_probability(first, second, 12.0)
    assert abs(found.probability - expected) < 4.0 * found.standard_error
    assert found.low < expected < found.high
    assert found.window_s < 1.0


def test_both_ways_of_counting_find_the_same_hits():
    """A window of a quarter turn makes the same draws be flown from node to node."""
    first, second = make_pair(angle_deg=0.5)
    short = sample_collisions(first, second, 30.0, rng=np.random.default_rng(4), samples=20_000)
    long = sample_collisions(first, second, 30.0, rng=np.random.default_rng(4), samples=20_000, window_s=400.0)
    assert short.hits > 500
    assert long.hits == pytest.approx(short.hits, abs=3)


def test_draws_are_those_of_the_generator():
    first, second = make_pair()
    hits = [
        sample_collisions(first, second, 12.0, rng=np.random.default_rng(seed), samples=20_000).hits
        for seed in (1, 1, 2)
    ]
    assert hits[0] == hits[1] != hits[2]


def test_a_window_holds_the_crossings_within_it_and_no_others():
    """Circles of one radius meet in both nodes: here 40 degrees of arc before the given instant, and 140 after it."""
    still = np.diag([1e-8, 1e-8, 1e-8, 1e-12, 1e-12, 1e-12])
    tilt, rate_rad_s = 1e-3, SPEED / RADIUS
    c, s = math.cos(math.radians(40.0)), math.sin(math.radians(40.0))
    first = UncertainState([RADIUS, 0.0, 0.0], [0.0, SPEED, 0.0], still)
    second = UncertainState([RADIUS, 0.0, RADIUS * tilt * s], [0.0, SPEED, SPEED * tilt * c], still)
    behind_s = math.radians(40.0) / rate_rad_s
    hits = [
        sample_collisions(first, second, 20.0, rng=np.random.default_rng(4), samples=100, window_s=window_s).hits
        for window_s in (0.97 * behind_s, 1.03 * behind_s)
    ]
    assert hits == [0, 100]


def test_half_a_revolution_counts_a_second_crossing_with_the_first():
    """Errors of speed along the track part the draws: most meet at the node at hand, others only at the next one.

    Both fly circles of one radius tilted by 1 mrad; the second is 30 m ahead at its node. A change of speed by dv moves it
    back by 3 pi dv / n until the opposite node, so that draws with dv near 30 m n / (3 pi) = 3.4 mm/s collide there.
    """
    n = SPEED / RADIUS
    sure = np.diag([1e-8, 1e-8, 1e-8, 1e-14, 1e-14, 1e-14])
    wide = np.diag([1e-8, 1e-8, 1e-8, 1e-14, 0.004**2, 1e-14])
    first = UncertainState([RADIUS, 0.0, 0.0], [0.0, SPEED, 0.0], sure)
    second = UncertainState([RADIUS, 30.0, 0.0], [-30.0 * n, SPEED * math.cos(1e-3), SPEED * math.sin(1e-3)], wide)
    half_s = math.pi / n
    near, both = (
        sample_collisions(first, second, 12.0, rng=np.random.default_rng(4), samples=20_000, window_s=window_s)
        for window_s in (0.5 * half_s, 1.05 * half_s)
    )
    # Clohessy-Wiltshire after half a revolution: 4 dv / n in radius, -3 pi dv / n along the track
    dv = 0.004 * np.random.default_rng(1).standard_normal(400_000)
    ahead = np.hypot(4.0 * dv / n, 30.0 - 3.0 * math.pi * dv / n) < 12.0
    behind = np.hypot(4.0 * dv / n, 30.0 + 3.0 * math.pi * dv / n) < 12.0
    assert near.hits == 0
    assert both.probability == pytest.approx(float(np.mean(ahead | behind)), abs=4.0 * both.standard_error)


def test_objects_side_by_side_collide_where_their_errors_overlap():
    """No relative velocity, errors of position alone along the radius: a normal number within the radius of the miss."""
    covariance = np.diag([8.0, 1e-12, 1e-12])
    first = UncertainState([RADIUS, 0.0, 0.0], [0.0, SPEED, 0.0], covariance)
    second = UncertainState([RADIUS, 0.0, 5.0], [0.0, SPEED, 0.0], covariance)
    found = sample_collisions(first, second, 6.0, rng=np.random.default_rng(4), samples=20_000, window_s=1e-3)
    expected = math.erf(math.sqrt(6.0**2 - 5.0**2) / 4.0 / math.sqrt(2.0))
    assert abs(found.probability - expected) < 4.0 * found.standard_error


def test_the_interval_holds_for_no_hit_and_for_all():
    none, every = SampledProbability(1000, 0, 1.0), SampledProbability(1000, 1000, 1.0)
    assert (none.probability, none.standard_error, none.low) == (0.0, 0.0, 0.0)
    assert none.high == pytest.approx(1.0 - 0.025 ** (1.0 / 1000.0))  # Clopper and Pearson
    assert every.low == pytest.approx(0.025 ** (1.0 / 1000.0))
    assert every.high == 1.0


def test_the_number_of_draws_follows_the_probability():
    first, second = make_pair()
    wanted = choose_samples(first, second, 1.0)
    assert 1000.0 <= wanted * foster_probability(first, second, 1.0) < 3000.0
    assert choose_samples(*make_pair(miss_m=(5e3, 0.0, 0.0)), 1.0) == MOST_SAMPLES


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"samples": 0}, "samples: 0 is not a number of draws"),
        ({"samples": 2.5}, r"samples: 2\.5"),
        ({"samples": True}, "samples: True"),
        ({"samples": 10, "window_s": -1.0}, r"window_s: -1\.0 is not a window"),
        ({"samples": 10, "window_s": float("nan")}, "window_s: nan"),
    ],
)
def test_what_makes_no_sense_is_refused(more, said):
    with pytest.raises(ScenarioError, match=f"^{said}"):
        sample_collisions(*make_pair(), 10.0, rng=np.random.default_rng(1), **more)


def test_draws_that_leave_the_earth_are_refused():
    wild = UncertainState([RADIUS, 0.0, 0.0], [0.0, SPEED, 0.0], np.diag([1.0] * 3 + [9e6] * 3))
    with pytest.raises(PropagationError, match="are not on an ellipse about the Earth"):
        sample_collisions(wild, make_pair()[1], 10.0, rng=np.random.default_rng(1), samples=200, window_s=600.0)

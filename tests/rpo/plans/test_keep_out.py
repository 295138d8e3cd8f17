"""The keep-out sphere and its corridor: distances by hand, for a cone that lies along no axis."""

from types import SimpleNamespace

import numpy as np
import pytest

from rso_lidar.errors import ScenarioError
from rso_lidar.rpo import KeepOutSphere

AXIS, ASIDE = np.array([1.0, -2.0, 2.0]) / 3.0, np.array([2.0, 2.0, 1.0]) / 3.0  # a right angle apart
SPHERE = KeepOutSphere(100.0, (2.0, -4.0, 4.0), 20.0)  # an axis need not have length 1


def place(distance_m, angle_deg):
    """Return the point at an angle off the corridor's axis."""
    angle = np.radians(angle_deg)
    return distance_m * (np.cos(angle) * AXIS + np.sin(angle) * ASIDE)


@pytest.mark.parametrize(
    ("distance_m", "angle_deg", "clear_m"),
    [
        (40.0, 5.0, 40.0 * np.sin(np.radians(15.0))),  # in the corridor
        (40.0, -5.0, 40.0 * np.sin(np.radians(15.0))),  # on its other side
        (40.0, 20.0, 0.0),  # on its surface
        (40.0, 50.0, -20.0),  # beside it: 40 sin 30 from its surface, 60 from the sphere's
        (95.0, 50.0, -5.0),  # beside it, nearer to the sphere's surface
        (40.0, 120.0, -40.0),  # more than a right angle from its surface: the apex is nearest
        (40.0, 180.0, -40.0),  # behind the apex
        (130.0, 50.0, 30.0),  # outside the sphere
        (130.0, 5.0, 130.0 * np.sin(np.radians(15.0))),  # outside the sphere, before the corridor
        (130.0, 180.0, 30.0),
    ],
)
def test_distance_from_what_is_forbidden_is_that_to_the_nearer_of_cone_and_sphere(distance_m, angle_deg, clear_m):
    assert SPHERE.clear_m(place(distance_m, angle_deg)) == pytest.approx(clear_m, abs=1e-9)


def test_a_corridor_wider_than_a_half_space_is_one_too():
    wide = KeepOutSphere(100.0, tuple(AXIS), 120.0)
    found = wide.clear_m(np.stack([place(40.0, 0.0), place(40.0, 90.0), place(40.0, 150.0)]))
    np.testing.assert_allclose(found, [40.0, 20.0, -20.0], atol=1e-9)


def test_without_a_corridor_the_distance_is_that_from_the_sphere():
    points = np.array([[[3.0, 4.0, 12.0], [30.0, -40.0, 120.0]]])  # 13 and 130 m
    np.testing.assert_allclose(KeepOutSphere(100.0).clear_m(points), [[-87.0, 30.0]], atol=1e-12)


def test_the_worst_of_some_positions_is_named():
    points = np.stack([place(40.0, 5.0), place(40.0, 50.0), place(90.0, 180.0), place(60.0, 60.0)])
    with pytest.raises(
        ScenarioError, match=r"^keep_out_m: at 7\.0 s the path is 60 m from the body .* its corridor; go"
    ):
        SPHERE.check_positions(np.array([4.0, 5.0, 6.0, 7.0]), points)
    SPHERE.check_positions(np.array([4.0]), points[:1])
    KeepOutSphere(0.0).check_positions(np.array([5.0]), np.zeros((1, 3)))


def fly_past():
    """Return a plan that flies by at 1 m/s, 30 m aside, from 300 m behind at 100 s to 300 m ahead at 700 s."""

    def path(time_s):
        line = np.stack([0.0 * time_s, time_s - 300.0, np.full_like(time_s, 30.0)], axis=-1)
        return line, np.broadcast_to([0.0, 1.0, 0.0], line.shape)

    leg = SimpleNamespace(path=path)
    return SimpleNamespace(
        revolution_s=5400.0,
        nearest=lambda: (30.0, 400.0),
        stretches=lambda: [(leg, 100.0, 700.0)],
        relative=lambda time_s: path(np.asarray(time_s) - 100.0),
    )


@pytest.mark.parametrize(
    ("sphere", "at"),
    [
        (KeepOutSphere(100.0), "400.0 s the path is 30 m from the body (0, 0, 30 m in rtn), inside the sphere of 100 m;"),
        # behind the apex the depth is the lesser of d and 100 m - d: deepest at 50 m, 40 m past the body
        (
            KeepOutSphere(100.0, (0.0, -1.0, 0.0), 20.0),
            "440.0 s the path is 50 m from the body (0, 40, 30 m in rtn), inside the sphere of 100 m and outside its cor",
        ),
    ],
)  # fmt: skip
def test_a_plan_is_refused_where_it_is_deepest_in_what_is_forbidden(sphere, at):
    with pytest.raises(ScenarioError) as caught:
        sphere.check(fly_past())
    assert f"keep_out_m: at {at}" in str(caught.value)


def test_of_two_entries_the_deeper_is_named():
    """Both fly by beside a needle of a corridor, at 90 and 60 m."""

    def leg(aside_m):
        def path(time_s):
            line = np.stack([0.0 * time_s, time_s - 300.0, np.full_like(time_s, aside_m)], axis=-1)
            return line, np.zeros_like(line)

        return SimpleNamespace(path=path)

    plan = fly_past()
    plan.stretches = lambda: [(leg(90.0), 100.0, 700.0), (leg(60.0), 700.0, 1300.0)]
    plan.relative = lambda time_s: leg(60.0).path(np.asarray(time_s) - 700.0)
    with pytest.raises(ScenarioError, match=r"at 1000\.0 s the path is 60 m from the body \(0, 0, 60 m"):
        KeepOutSphere(100.0, (1.0, 0.0, 0.0), 1.0).check(plan)


@pytest.mark.parametrize("sphere", [KeepOutSphere(0.0), KeepOutSphere(29.9), KeepOutSphere(100.0, (0, 0, 1), 73.0)])
def test_a_plan_that_stays_clear_is_returned(sphere):
    """From 100 m the path is 72.54 degrees off the third axis."""
    plan = fly_past()
    assert sphere.check(plan) is plan

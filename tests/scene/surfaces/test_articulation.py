import datetime
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import rso_lidar as rl
from rso_lidar import optics, scene
from rso_lidar.errors import ScenarioError
from rso_lidar.motion import FixedAngle, FollowSun
from rso_lidar.scenario import Joint
from rso_lidar.scene import Hinged, split_at_hinges

START = datetime.datetime(2026, 5, 7, tzinfo=datetime.UTC)
NORTH = ("solar_array_north", "solar_substrate_north", "solar_yoke_north")
HINGE_M = (0.0, -0.012, -0.128)


def scenario(angle=None, sun=(0.0, 1.0, 1.0), parts=NORTH, **changes):
    """A relay satellite whose northern array turns about its boom, seen from 100 m."""
    joint = (Joint(name="north", parts=parts, position_m=HINGE_M, axis=(1.0, 0.0, 0.0), angle=angle),) if angle else ()
    target = rl.Target(
        name="tdrs",
        model="tdrs",
        motion=rl.Fixed(position_m=(100.0, 0.0, 0.0)),
        attitude=rl.FixedAttitude(euler_zyx_deg=(90.0, 20.0, 0.0)),
        joint=joint,
    )
    return rl.Scenario(
        version=1,
        name="hinged",
        world=rl.World(axes="local", sun_direction=sun),
        time=rl.Time(start_utc=START, duration_s=1.0, frame_rate_hz=1.0),
        target=(target,),
        follower=rl.Follower(motion=rl.Fixed(position_m=(0.0, 0.0, 0.0))),
        lidar=rl.Lidar(
            laser=rl.Laser(divergence_deg=15.0),
            receiver=rl.Receiver(fov_deg=15.0, f_number=2.8, rays_per_pixel=16, **changes),
            detector=rl.Empirical(),
        ),
    )


def frame_of(scenario):
    return next(rl.simulate(scenario, keep=("hits",)))


def key(hits):
    """Return a number for the direction of each hit's ray."""
    return np.round(hits.rays.direction[hits.ray, :2] * 1e9) @ [1.0, 1e10]


def test_at_angle_zero_nothing_changes():
    """The same rays meet the same facets of the same parts; ranges agree to a micrometre, the bound of the house."""
    rigid, hinged = frame_of(scenario()), frame_of(scenario(FixedAngle()))
    one, two = rigid.kept["hits"], hinged.kept["hits"]
    assert set(np.unique(two.target)) == {0}
    # Nothing is small enough to be sampled more finely, so that the rays are the same; at an edge, where float32 decides,
    # a few of ten thousand may go the other way.
    _, a, b = np.intersect1d(key(one), key(two), return_indices=True)
    assert len(a) > 0.999 * max(len(one.ray), len(two.ray))
    same = one.facet[a] == two.facet[b]
    assert same.mean() > 0.999
    facing = same & (one.cos_incidence[a] > 0.01)  # edge-on, embree's own distance stands
    np.testing.assert_allclose(one.range_m[a][facing], two.range_m[b][facing], rtol=0, atol=1e-6)
    assert np.array_equal(one.part[a][same], two.part[b][same])


def test_a_turned_part_is_the_part_of_a_turned_mesh():
    """Half the array's facets moved by hand: the hits lie on the planes of the vertices turned about the hinge."""
    hinged = scenario(FixedAngle(angle_deg=40.0))
    frame = frame_of(hinged)
    hits = frame.kept["hits"]
    whole = scenario().surfaces[0]
    turn = Rotation.from_euler("x", 40.0, degrees=True)
    north = np.isin(whole.part, [whole.mesh.part_names.index(part) for part in NORTH])
    corners = whole.corners.copy()
    corners[north] = turn.apply((corners[north] - HINGE_M).reshape(-1, 3)).reshape(-1, 3, 3) + HINGE_M
    point = hits.rays.direction[hits.ray] * hits.range_m[:, None]
    point = frame.truth.pose("tdrs", "lidar").apply(point)
    facet = np.searchsorted(whole.mesh.source_facet, hits.facet)
    triangle = corners[facet]
    normal = np.cross(triangle[:, 1] - triangle[:, 0], triangle[:, 2] - triangle[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    off_m = np.abs(np.sum((point - triangle[:, 0]) * normal, axis=1))
    facing = hits.cos_incidence > 0.01  # edge-on, embree's own distance stands
    assert north[facet].sum() > 500
    assert off_m[facing].max() < 1e-6


def test_an_array_that_follows_the_sun_faces_it():
    made = scenario(FollowSun(normal=(0.0, 0.0, 1.0)))
    truth = frame_of(made).truth
    sun = truth.pose("tdrs.north", "inertial").rotation.apply(np.array([0.0, 1.0, 1.0]) / np.sqrt(2.0))
    assert sun[2] > 0.0
    assert abs(sun[1]) < 1e-12


def test_a_hinged_part_shades_and_is_shaded():
    """Where rays meet the same facet with and without the other surface, light can only be lost, and on both some is."""
    dishes = ("antenna_single_access_east", "antenna_single_access_west")
    made = scenario(FixedAngle(), sun=(-1.0, -1.0, 0.0), parts=dishes)
    truth = frame_of(made).truth
    surfaces, lidar = made.surfaces, made.instrument
    rays = optics.pixel_rays(lidar.receiver.replace(rays_per_pixel=64), lidar.laser, scene.extent(surfaces, truth))
    together = scene.cast(rays, surfaces, truth, sun=True)
    for one in surfaces:
        alone = scene.cast(rays, [one], truth, sun=True)
        keys = (hits.ray.astype(np.int64) * 10**6 + hits.facet for hits in (together, alone))
        _, a, b = np.intersect1d(*keys, return_indices=True)
        assert len(a) > 300
        assert np.all(together.sunlight_per_sr[a] <= alone.sunlight_per_sr[b] + 1e-15)
        lost = np.sum((together.sunlight_per_sr[a] == 0.0) & (alone.sunlight_per_sr[b] > 0.0))
        assert lost > 100


def test_a_hinge_in_the_way_hides_what_is_behind():
    """The parts of a target compete for each ray: no pixel has more than its share, hinged or not."""
    hits = frame_of(scenario(FixedAngle(angle_deg=90.0))).kept["hits"]
    assert np.bincount(hits.pixel, weights=hits.weight).max() <= 1.0 + 1e-9
    assert len(np.unique(hits.ray)) == len(hits.ray)


@pytest.mark.parametrize(
    ("hinged", "words"),
    [
        ([Hinged("a.x", ("solar_aray_north",), (0, 0, 0))], "did you mean 'solar_array_north'"),
        ([Hinged("a.x", NORTH, (0, 0, 0)), Hinged("a.y", NORTH[:1], (0, 0, 0))], "is on a.x already"),
    ],
)
def test_bad_parts(hinged, words):
    with pytest.raises(ScenarioError, match=words):
        split_at_hinges(scenario().surfaces[0], hinged)


def test_something_has_to_stand_still():
    whole = scenario().surfaces[0]
    with pytest.raises(ScenarioError, match="all parts are on hinges"):
        split_at_hinges(whole, [Hinged("a.x", whole.mesh.part_names, (0, 0, 0))])


def test_without_hinges_the_surface_is_itself():
    whole = replace(scenario().surfaces[0], target=3)
    assert split_at_hinges(whole, ()) == (whole,)

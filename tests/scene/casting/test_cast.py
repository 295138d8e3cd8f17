import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from rso_lidar import scene
from rso_lidar.optics import Laser, Receiver
from rso_lidar.records import Rays
from rso_lidar.scene import Lambertian, Phong
from rso_lidar.scene.materials.scatterer import SUN_RADIUS_RAD
from tests.optics.bench_for_tests import PAPER_LASER, box, look, place, plate, see, sphere, surface, truth_of

SMALL = Receiver(fov_deg=20, f_number=2, n_rows=12, n_cols=12, rays_per_pixel=4, min_rays_per_target=0)
WIDE = Laser(divergence_deg=170)


def along(*directions):
    """Return rays in these directions, one to a pixel."""
    direction = np.array(directions, dtype=float)
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    return Rays((1, len(direction)), direction, np.arange(len(direction)), np.ones(len(direction)))


def slow_hits(triangles, direction):
    """Return range [m] and facet that rays from the origin meet first, by Moeller and Trumbore in 80-bit floats."""
    triangles, direction = triangles.astype(np.longdouble), direction.astype(np.longdouble)
    a, b, c = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    h = np.cross(direction[:, None], c[None])
    det = np.einsum("fi,rfi->rf", b, h)
    with np.errstate(divide="ignore", invalid="ignore"):
        u = np.einsum("fi,rfi->rf", -a, h) / det
        q = np.cross(-a, b)
        v = np.einsum("ri,fi->rf", direction, q) / det
        t = np.einsum("fi,fi->f", c, q) / det
    met = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0) & (det != 0)
    t = np.where(met, t, np.inf)
    return t.min(axis=1), t.argmin(axis=1)


@settings(max_examples=25)
@given(st.integers(0, 10**6), st.sampled_from([2.0, 30.0, 3000.0, 50_000.0]))
def test_first_facet_and_range_of_a_soup_of_triangles(seed, range_m):
    """Thirty triangles at random, mixed winding, open: as an 80-bit loop over all of them finds, to 1 um."""
    rng = np.random.default_rng(seed)
    triangles = rng.normal(size=(30, 3, 3))
    pose = place(rng.normal(size=3) * 0.1 + [0, 0, range_m], Rotation.random(rng=rng))
    lens = SMALL.replace(fov_deg=min(90.0, float(np.rad2deg(5.0 / range_m))))
    seen = look(triangles, pose, lens, WIDE)
    expected, facet = slow_hits(pose.apply(triangles.reshape(-1, 3)).reshape(-1, 3, 3), seen.rays.direction)
    got = np.full(len(expected), np.inf)
    got[seen.hits.ray] = seen.hits.range_m
    same = np.isfinite(got) == np.isfinite(expected)
    # Embree works in float32: a ray that passes an edge by less than 1e-6 of the scene may go either way. That is one ray in
    # some thousands, and so a few in a view of a few hundred.
    few = 3 + 2e-3 * len(same)
    assert np.sum(~same) <= few
    both = np.isfinite(got) & np.isfinite(expected)
    off = np.abs(got[both] - expected[both].astype(float))
    assert np.sum(off > 1e-6) <= few
    agree = np.flatnonzero(both)[off <= 1e-6]
    of_hit = dict(zip(seen.hits.ray.tolist(), seen.hits.facet.tolist(), strict=True))
    assert all(of_hit[ray] == facet[ray] for ray in agree.tolist())


def test_hits_follow_the_rays_and_carry_them():
    rays = look(plate(2.0), place((0.1, 0.1, 5)), SMALL, WIDE).rays
    pair = np.concatenate([box(0.3, 0.3, 0.3) - np.array([0.5, 0, 0]), box(0.3, 0.3, 0.3) + np.array([0.5, 0, 0])])
    hits = scene.cast(rays, [surface("pair", pair)], truth_of(pair=place((0.1, 0.1, 5))))
    assert 0 < len(hits.ray) < len(rays.pixel)
    assert np.all(np.diff(hits.ray) > 0)
    assert np.array_equal(hits.pixel, rays.pixel[hits.ray])
    assert np.array_equal(hits.weight, rays.weight[hits.ray])


def test_winding_does_not_matter():
    """Real meshes are open shells of mixed winding: every facet turned over, nothing changes but the side."""
    rng = np.random.default_rng(3)
    triangles = sphere(1.0, 3)
    turned = triangles.copy()
    some = rng.random(len(triangles)) < 0.5
    turned[some] = turned[some][:, [0, 2, 1]]
    pose = place((0.1, -0.2, 10), Rotation.random(rng=rng))
    rays, truth = look(triangles, pose, SMALL, WIDE).rays, truth_of(ball=pose)
    one, other = (scene.cast(rays, [surface("ball", shape)], truth) for shape in (triangles, turned))
    for name in ("ray", "facet"):
        assert np.array_equal(getattr(one, name), getattr(other, name))
    assert len(one.ray) > 100 and np.all(one.cos_incidence > 0)
    assert other.cos_incidence == pytest.approx(one.cos_incidence, rel=1e-12)
    assert other.range_m == pytest.approx(one.range_m, rel=1e-13)


def test_from_inside_one_sees_the_back_of_the_facets():
    lens = Receiver(fov_deg=100, f_number=2, n_rows=9, n_cols=9, rays_per_pixel=1)
    seen = look(box(4, 6, 8), place((0, 0, 1)), lens, WIDE)
    assert len(seen.hits.ray) == 81
    d = seen.rays.direction
    expected = np.min(np.stack([2 / np.abs(d[:, 0] + 1e-300), 3 / np.abs(d[:, 1] + 1e-300), 5 / d[:, 2]]), axis=0)
    assert seen.hits.range_m == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("n", [1, 2, 32, 64])
@pytest.mark.parametrize("rays_per_pixel", [1, 4, 16])
def test_no_ray_slips_through_an_edge(n, rays_per_pixel):
    """Rays through corners and along the diagonals of a wall of squares: a wall has no holes."""
    lens = Receiver(fov_deg=2.5, f_number=2.8, n_rows=32, n_cols=32, rays_per_pixel=rays_per_pixel)
    width = 32 * lens.pixel_tangent * 1000.0
    seen = look(plate(width * 2, n=2 * n), place((0, 0, 1000.0)), lens, PAPER_LASER)
    assert len(seen.hits.ray) == len(seen.rays.pixel) == 32 * 32 * rays_per_pixel


def test_the_nearest_of_two_targets_wins_whatever_their_order():
    near, far = surface("near", plate(1.0)), surface("far", plate(4.0))
    truth = truth_of(near=place((0, 0, 10)), far=place((0, 0, 12)))
    for order in ([near, far], [far, near]):
        seen = see(order, truth, SMALL, WIDE)
        names = np.array([s.name for s in order])[seen.hits.target]
        shadowed = np.all(np.abs(seen.rays.direction[:, :2] / seen.rays.direction[:, 2:])[seen.hits.ray] < 0.05, axis=1)
        assert np.all((names == "near") == shadowed)
        assert set(names) == {"near", "far"}


def test_parts_and_facets_are_those_of_the_source_file():
    part = np.array([0, 0, 1, 1], dtype=np.int16)
    sat = surface(
        "sat",
        np.concatenate([plate(1.0) - [1, 0, 0], plate(1.0) + np.array([1, 0, 0])]),
        part=part,
        part_names=("a", "b"),
    )
    mesh = dataclasses.replace(sat.mesh, source_facet=np.array([3, 5, 6, 9], dtype=np.int32), source_facets=10)
    sat = dataclasses.replace(sat, mesh=mesh)
    hits = scene.cast(
        along([-1.2, -0.3, 9], [-1.2, 0.4, 9], [0.8, -0.3, 9], [0.8, 0.4, 9]), [sat], truth_of(sat=place((0, 0, 9)))
    )
    assert hits.part.tolist() == [0, 0, 1, 1]
    facets = hits.facet.tolist()
    assert set(facets[:2]) == {3, 5} and set(facets[2:]) == {6, 9}


def test_rays_that_meet_nothing_have_no_row():
    hits = scene.cast(
        along([0, 0, 1], [1, 0, 1], [0, 0, -1]), [surface("sat", plate(1.0))], truth_of(sat=place((0, 0, 9)))
    )
    assert hits.ray.tolist() == [0]
    nothing = scene.cast(along([0, 0, 1]), [], truth_of())
    assert len(nothing.ray) == 0
    none = scene.cast(
        Rays((4, 4), np.zeros((0, 3)), np.zeros(0), np.zeros(0)),
        [surface("sat", plate(1.0))],
        truth_of(sat=place((0, 0, 9))),
    )
    assert len(none.ray) == 0


@pytest.mark.parametrize("threads", [1, 2, 5, None])
def test_threads_change_no_bit(threads):
    rng = np.random.default_rng(1)
    targets = [surface("a", sphere(30.0, 4)), surface("b", box(20, 30, 60))]
    truth = truth_of(a=place((3, 5, 1000), Rotation.random(rng=rng)), b=place((-20, 4, 990), Rotation.random(rng=rng)))
    one = see(targets, truth, threads=1)
    other = see(targets, truth, threads=threads)
    assert len(one.rays.pixel) > 3 * 16_384  # several bands, or nothing is shown
    for name in ("ray", "target", "facet", "range_m", "cos_incidence", "brdf_per_sr"):
        assert getattr(one.hits, name).tobytes() == getattr(other.hits, name).tobytes()


def test_the_pose_of_the_root_plays_no_part():
    """Only lidar_from_target counts: the same scene by a lidar at 42,000 km is the same to the last bit."""
    far = place((4.2e7, -1e7, 3e6), Rotation.from_rotvec([0.3, 0.2, -0.9]))
    pose = place((1, 2, 3000), Rotation.from_rotvec([1.0, 0.4, 0.2]))
    target = surface("sat", box(3, 4, 5))
    here, there = see(target, truth_of(sat=pose)), see(target, truth_of(far, sat=pose))
    assert len(here.hits.ray) > 0
    assert here.hits.range_m.tobytes() == there.hits.range_m.tobytes()


# --------------------------------------------------------------------------------------------- a laser beside the lens

FIELDS = ("ray", "pixel", "weight", "target", "facet", "part", "range_m", "cos_incidence", "brdf_per_sr")
SHINY = Phong(diffuse=0.1, specular=0.5, exponent=30.0)
FINE = SMALL.replace(n_rows=40, n_cols=40)


def cast(targets, truth, receiver=FINE, threads=1, **settings):
    """Return the hits of all rays of a lens on surfaces, and the points (hit, xyz) that they meet, in lidar axes."""
    targets = targets if isinstance(targets, list) else [targets]
    rays = optics_rays(receiver, targets, truth)
    hits = scene.cast(rays, targets, truth, threads, **settings)
    return hits, hits.range_m[:, None] * rays.direction[hits.ray]


def optics_rays(receiver, targets, truth):
    from rso_lidar.optics import pixel_rays

    return pixel_rays(receiver, WIDE, scene.extent(targets, truth))


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def shapes_to_cast():
    rng = np.random.default_rng(4)
    targets = [surface("a", sphere(1.0, 3), SHINY), surface("b", box(1, 2, 0.5))]
    truth = truth_of(a=place((0.6, 0, 10), Rotation.random(rng=rng)), b=place((-0.8, 0, 9), Rotation.random(rng=rng)))
    return targets, dataclasses.replace(truth, sun_direction=unit(np.array([0.5, 0.4, -1.0])))


def test_a_laser_in_the_lens_is_the_default_to_the_last_bit():
    targets, truth = shapes_to_cast()
    plain, _ = cast(targets, truth)
    assert plain.sunlight_per_sr is None
    for light in ({"laser_from_m": None}, {"laser_from_m": (0.0, 0.0, 0.0)}, {"sun": True}):
        other, _ = cast(targets, truth, **light)
        for name in FIELDS:
            assert getattr(other, name).tobytes() == getattr(plain, name).tobytes()
    assert cast(targets, truth, sun=True)[0].sunlight_per_sr.max() > 0


@pytest.mark.parametrize("threads", [2, 5, None])
def test_threads_change_no_bit_of_other_light_either(threads):
    rng = np.random.default_rng(1)
    targets = [surface("a", sphere(30.0, 4), SHINY, smooth_parts=("body",)), surface("b", box(20, 30, 60))]
    truth = truth_of(a=place((3, 5, 1000), Rotation.random(rng=rng)), b=place((-20, 4, 990), Rotation.random(rng=rng)))
    truth = dataclasses.replace(truth, sun_direction=unit(np.array([0.5, 0.4, -1.0])))
    lens = Receiver(fov_deg=4, f_number=2.8)
    light = {"laser_from_m": (2.0, 1.0, 0.0), "sun": True}
    one, other = (cast(targets, truth, lens, n, **light)[0] for n in (1, threads))
    assert len(one.ray) > 3 * 16_384  # several bands, or nothing is shown
    for name in (*FIELDS, "sunlight_per_sr"):
        assert getattr(one, name).tobytes() == getattr(other, name).tobytes()


def test_a_laser_beside_the_lens_by_its_own_angles():
    """A tilted shiny plate: cosines from the points, and Phong's φ from the mirror's law."""
    laser = np.array([0.7, -0.4, 0.2])
    pose = place((0.1, 0.2, 6.0), Rotation.from_euler("xyz", [12, -8, 40], degrees=True))
    normal = pose.rotation.apply([0.0, 0.0, -1.0])
    hits, point = cast(surface("wall", plate(4.0), SHINY), truth_of(wall=pose), laser_from_m=laser)
    plain, _ = cast(surface("wall", plate(4.0), SHINY), truth_of(wall=pose))
    to_laser, to_lens = unit(laser - point), unit(-point)
    cos_in = to_laser @ normal
    mirrored = 2 * cos_in[:, None] * normal - to_laser
    expected = 0.1 / math.pi + 0.5 * 32 / (2 * math.pi) * np.clip(np.sum(mirrored * to_lens, axis=1), 0, 1) ** 30
    assert len(hits.ray) > 500
    assert hits.cos_incidence == pytest.approx(cos_in, rel=1e-12)
    assert hits.brdf_per_sr == pytest.approx(expected, rel=1e-10)
    assert np.abs(hits.brdf_per_sr / plain.brdf_per_sr - 1).max() > 0.1, "or the offset is too small to tell"
    assert hits.range_m.tobytes() == plain.range_m.tobytes()


@pytest.mark.parametrize("together", [True, False])
@pytest.mark.parametrize("range_m", [10.0, 30_000.0])
def test_a_shadow_of_the_laser(together, range_m):
    """A screen half way, out of sight, that hides the laser from the half of a wall where x > 0.

    From the wall's (x, y, R) the ray to the laser at (2, 0, 0) passes x/2 + 1 half way; the screen begins at 1 there.
    """
    laser = (2.0, 0.0, 0.0)
    lens = SMALL.replace(fov_deg=float(np.rad2deg(2 * math.atan(0.5 / range_m))))
    screen = plate(0.5, 4.0) + np.array([1.25, 0, -range_m / 2])
    if together:
        targets, poses = [surface("wall", np.concatenate([plate(3.0), screen]))], {"wall": place((0, 0, range_m))}
    else:
        turn = Rotation.from_euler("x", 180, degrees=True)
        targets = [surface("wall", plate(3.0)), surface("screen", screen)]
        poses = {"wall": place((0, 0, range_m), turn), "screen": place((0, 0, range_m))}
    hits, point = cast(targets, truth_of(**poses), lens, laser_from_m=laser)
    hidden = point[:, 0] > 0
    apart = np.abs(point[:, 0]) > 1e-3 * max(1.0, range_m * 1e-3)  # float32 at the edge of 30 km of surface
    assert 0.4 < hidden.mean() < 0.6
    assert np.array_equal(hits.cos_incidence[apart] == 0, hidden[apart])
    to_laser = unit(np.array(laser) - point)
    assert hits.cos_incidence[apart & ~hidden] == pytest.approx(-to_laser[apart & ~hidden, 2], rel=1e-9)


def test_what_is_behind_the_laser_hides_nothing():
    wall = surface("wall", plate(3.0))
    behind = surface("behind", plate(9.0))
    truth = truth_of(wall=place((0, 0, 10)), behind=place((0, 0, -0.5)))
    hits, _ = cast([wall, behind], truth, laser_from_m=(0.5, 0, 0))
    assert np.all(hits.cos_incidence > 0.9)


def test_a_facet_between_lens_and_laser_is_lit_on_its_far_side():
    """Lens at x = 0, laser at x = 0.5, a sheet in the plane x = 0.25: what the lens sees is dark."""
    pose = place((0.25, 0, 10), Rotation.from_euler("y", 90, degrees=True))
    hits, _ = cast(surface("sheet", plate(10.0, 2.0)), truth_of(sheet=pose), laser_from_m=(0.5, 0, 0))
    assert len(hits.ray) > 0 and np.all(hits.cos_incidence == 0)


@pytest.mark.parametrize("size_m", [0.01, 1.0, 100.0])
@pytest.mark.parametrize("aside", [0.01, 0.5])
def test_no_facet_of_a_ball_shades_itself(size_m, aside):
    """A convex body shades nothing that faces the laser, at any scale: dark is what faces away, and only that."""
    pose = place((0, 0, 8 * size_m), Rotation.from_rotvec([0.3, 0.5, 0.1]))
    ball = surface("ball", sphere(size_m, 3) + np.array([3.0, 1.0, -2.0]) * size_m, center_of_mass_m=(0, 0, 0))
    moved = place(pose.translation - pose.rotation.apply(np.array([3.0, 1.0, -2.0]) * size_m), pose.rotation)
    laser = np.array([aside * size_m, 0, 0])
    hits, point = cast(ball, truth_of(ball=moved), laser_from_m=laser)
    normal = unit(point - pose.translation)  # within 4 degrees of the facet's
    toward = np.sum(normal * unit(laser - point), axis=1)
    assert len(hits.ray) > 300
    assert np.all(hits.cos_incidence[toward > 0.1] > 0)


# -------------------------------------------------------------------------------------------------------- smooth parts


def test_a_smooth_ball_is_shaded_as_a_ball_and_ranged_as_a_mesh():
    """cos α within 0.5 deg of the true ball's, where the facets are up to 4 deg off; the range is the facets'."""
    pose = place((0, 0, 12), Rotation.from_rotvec([0.2, 0.4, 1.0]))
    flat, point = cast(surface("ball", sphere(1.0, 3), SHINY), truth_of(ball=pose))
    ball, _ = cast(surface("ball", sphere(1.0, 3), SHINY, smooth_parts=("body",)), truth_of(ball=pose))
    assert ball.range_m.tobytes() == flat.range_m.tobytes()
    true = np.arccos(np.clip(np.sum(unit(point - [0, 0, 12]) * unit(-point), axis=1), 0, 1))
    inside = true < np.deg2rad(85)
    off = lambda hits: np.rad2deg(np.abs(np.arccos(hits.cos_incidence) - true)[inside].max())  # noqa: E731
    assert off(ball) < 0.5 and off(flat) > 2.0
    assert ball.brdf_per_sr == pytest.approx(SHINY.brdf_per_sr(ball.cos_incidence), rel=1e-12)
    assert ball.cos_incidence.min() >= 0


# ------------------------------------------------------------------------------------------------------------ sunlight


def sunny(truth, direction_in_lidar, **settings):
    """Return the truth with a Sun in a direction of the lidar's axes."""
    inertial = truth.pose("inertial", "lidar").rotation.apply(unit(np.asarray(direction_in_lidar, dtype=float)))
    return dataclasses.replace(truth, sun_direction=inertial, **settings)


TURNED = place((4e6, -5e6, 3e6), Rotation.from_rotvec([0.4, -1.1, 0.7]))


def test_sunlight_on_a_matt_plate_is_lambert_s():
    """ρ₀/π cos θ_s, times the share of the Sun's disc that the Earth leaves free; the lidar is turned in root axes."""
    pose = place((0, 0, 10), Rotation.from_euler("x", 30, degrees=True))
    normal = pose.rotation.apply([0, 0, -1.0])
    for direction in ([0, 0, -1], [0.3, 0.8, -1], [1, -0.5, 0.05]):
        cos_sun = float(unit(np.array(direction, dtype=float)) @ normal)
        truth = sunny(truth_of(TURNED, wall=pose), direction, sunlit={"wall": 0.25, "other": 0.0})
        hits, _ = cast(surface("wall", plate(3.0)), truth, sun=True)
        assert hits.sunlight_per_sr == pytest.approx(0.25 * 0.30 / math.pi * max(cos_sun, 0.0), rel=1e-9)
        whole, _ = cast(surface("wall", plate(3.0)), dataclasses.replace(truth, sunlit={}), sun=True)
        assert whole.sunlight_per_sr == pytest.approx(0.30 / math.pi * max(cos_sun, 0.0), rel=1e-9)


def test_no_sun_no_sunlight():
    wall = surface("wall", plate(3.0))
    local = truth_of(wall=place((0, 0, 10)))
    for truth in (local, sunny(local, [0, 0, 1]), sunny(local, [0, 0, -1], sunlit={"wall": 0.0})):
        hits, _ = cast(wall, truth, sun=True)
        assert len(hits.ray) and np.all(hits.sunlight_per_sr == 0)
    assert len(cast([wall], sunny(truth_of(wall=place((0, 0, -9))), [0, 0, -1]), sun=True)[0].ray) == 0


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("together", [True, False])
def test_a_tumbling_plate_shades_a_tumbling_plate(seed, together):
    """From a point of one plate the ray to the Sun pierces the other where its own coordinates are inside its edges."""
    rng = np.random.default_rng(seed)
    lens = FINE.replace(fov_deg=30.0)
    shaded_seen = lit_seen = 0
    for _ in range(6):
        sun = unit(rng.normal(size=3) * [1, 1, 0.3] - [0, 0, 1.0])
        poses = [
            place(np.array([0, 0, 12.0]), Rotation.from_rotvec(rng.normal(size=3) * 0.4)),
            place(np.array([0, 0, 12.0]) + 2.5 * sun, Rotation.from_rotvec(rng.normal(size=3) * 0.4)),
        ]
        plates = [plate(4.0), plate(1.5)]
        if together:
            both = np.concatenate(
                [p.apply(c.reshape(-1, 3)).reshape(-1, 3, 3) for p, c in zip(poses, plates, strict=True)]
            )
            targets, truth = [surface("both", both)], truth_of(TURNED, both=place())
        else:
            targets = [surface("a", plates[0]), surface("b", plates[1])]
            truth = truth_of(TURNED, a=poses[0], b=poses[1])
        hits, point = cast(targets, sunny(truth, sun), lens, sun=True)
        on = hits.target if not together else hits.facet // 2
        clear, shaded = np.ones(len(point), bool), np.zeros(len(point), bool)
        for number in (0, 1):
            normal = poses[number].rotation.apply([0, 0, 1.0])
            mine = on == number
            shaded[mine] |= (normal @ sun) * (-point[mine] @ normal) < 0  # Sun and lens on two sides of it
            other = poses[1 - number].inv()
            start, along = other.apply(point[mine]), other.rotation.apply(sun)
            t = -start[:, 2] / along[2]
            pierced = start + t[:, None] * along
            margin = 0.5 * (4.0, 1.5)[1 - number] - np.abs(pierced[:, :2]).max(axis=1)
            shaded[mine] |= (margin > 0) & (t > 0)
            clear[mine] &= (np.abs(margin) > 1e-3) & (np.abs(t) > 1e-3)
        assert np.array_equal((hits.sunlight_per_sr == 0)[clear], shaded[clear])
        shaded_seen += int(np.sum(shaded & clear))
        lit_seen += int(np.sum(~shaded & clear))
    assert shaded_seen > 200 and lit_seen > 200


@pytest.mark.parametrize("n", [3e3, 3e4, 1e5])
def test_a_mirror_shows_the_sun_s_disc(n):
    """Where the middle of the Sun mirrors into the lens, a lobe cosⁿφ averaged over the disc of radius s gives

    ks (n+2)/n (1 - e^(-n s²/2)) / Ω, Ω = 6.8e-5 sr, times the cosine: for n ≫ 1 / s² all of ks / Ω, which is 1.5e5 times
    the matt 0.30 (instrument.md 5). Averaging by twelve points is good to 1e-3 here.
    """
    tilt = 20.0
    pose = place((0, 0, 1000.0), Rotation.from_euler("x", tilt, degrees=True))
    normal = pose.rotation.apply([0, 0, -1.0])
    sun = 2 * (-normal[2]) * normal - np.array([0, 0, -1.0])
    truth = sunny(truth_of(TURNED, mirror=pose), sun)
    mirror = surface("mirror", plate(3.0), Phong(diffuse=0.0, specular=0.8, exponent=n))
    hits = scene.cast(along([0, 0, 1]), [mirror], truth, sun=True)
    disc_sr = 2 * math.pi * (1 - math.cos(SUN_RADIUS_RAD))
    expected = 0.8 * (n + 2) / n * -math.expm1(-n * SUN_RADIUS_RAD**2 / 2) / disc_sr * math.cos(math.radians(tilt))
    assert hits.sunlight_per_sr[0] == pytest.approx(expected, rel=1.5e-3)
    aside = sunny(truth_of(TURNED, mirror=pose), sun + np.array([0.1, 0, 0]))
    assert scene.cast(along([0, 0, 1]), [mirror], aside, sun=True).sunlight_per_sr[0] < 0.2 * expected


def test_a_glint_on_a_ball_is_where_the_half_way_normal_is():
    """On a smooth shiny ball the brightest sunlight is where the normal halves the angle between Sun and lens."""
    sun = unit(np.array([1.0, -0.4, -0.6]))
    truth = sunny(truth_of(TURNED, ball=place((0, 0, 12))), sun)
    ball = surface("ball", sphere(1.0, 3), Phong(diffuse=0.05, specular=0.5, exponent=300.0), smooth_parts=("body",))
    hits, point = cast(ball, truth, sun=True)
    brightest = unit(point[np.argmax(hits.sunlight_per_sr)] - [0, 0, 12])
    halfway = unit(sun + unit(-point[np.argmax(hits.sunlight_per_sr)]))
    # Rays 0.25 deg apart meet a ball of 1 m at 12 m some 3 deg apart on it: the nearest is within half their diagonal.
    assert np.rad2deg(np.arccos(brightest @ halfway)) < 3.0
    night = np.sum(unit(point - [0, 0, 12]) * sun, axis=1) < -0.1
    assert night.any() and np.all(hits.sunlight_per_sr[night] == 0)


def test_materials_take_turns_in_sunlight():
    """Parts of one surface with a matt and a shiny material: each as if it were alone."""
    part = np.repeat(np.array([0, 1], np.int16), [640, 640])
    truth = sunny(truth_of(TURNED, ball=place((0, 0, 12))), [0.2, 0.1, -1])
    mixed = surface(
        "ball",
        sphere(1.0, 3),
        part=part,
        part_names=("matt", "shiny"),
        part_materials={"shiny": SHINY.replace(exponent=900.0)},
    )
    hits, _ = cast(mixed, truth, sun=True)
    for number, material in enumerate((Lambertian(), SHINY.replace(exponent=900.0))):
        alone, _ = cast(surface("ball", sphere(1.0, 3), material), truth, sun=True)
        mine = hits.part == number
        assert mine.any()
        assert hits.sunlight_per_sr[mine].tobytes() == alone.sunlight_per_sr[mine].tobytes()

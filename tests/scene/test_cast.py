import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from rso_lidar import scene
from rso_lidar.optics import Laser, Receiver
from rso_lidar.records import Rays
from tests.optics.bench_for_tests import SEED_LASER, box, look, place, plate, see, sphere, surface, truth_of

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
    # Embree works in float32: a ray that passes an edge by less than 1e-6 of the scene may go either way.
    assert np.mean(~same) < 2e-3
    both = np.isfinite(got) & np.isfinite(expected)
    off = np.abs(got[both] - expected[both].astype(float))
    assert np.mean(off > 1e-6) < 2e-3
    agree = np.flatnonzero(both)[off <= 1e-6]
    of_hit = dict(zip(seen.hits.ray.tolist(), seen.hits.facet.tolist(), strict=True))
    assert all(of_hit[ray] == facet[ray] for ray in agree.tolist())


def test_hits_follow_the_rays_and_carry_them():
    pair = np.concatenate([box(0.3, 0.3, 0.3) - np.array([0.5, 0, 0]), box(0.3, 0.3, 0.3) + np.array([0.5, 0, 0])])
    seen = look(pair, place((0.1, 0.1, 5)), SMALL, WIDE)
    hits, rays = seen.hits, seen.rays
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
    one, other = look(triangles, pose, SMALL, WIDE), look(turned, pose, SMALL, WIDE)
    for name in ("ray", "facet"):
        assert np.array_equal(getattr(one.hits, name), getattr(other.hits, name))
    assert np.all(one.hits.cos_incidence > 0)
    assert other.hits.cos_incidence == pytest.approx(one.hits.cos_incidence, rel=1e-12)
    assert other.hits.range_m == pytest.approx(one.hits.range_m, rel=1e-13)


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
    seen = look(plate(width * 2, n=2 * n), place((0, 0, 1000.0)), lens, SEED_LASER)
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
    import dataclasses

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

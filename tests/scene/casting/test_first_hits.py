"""Casting in packets against the reference in NumPy, which asks embree for one ray after another."""

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rso_lidar import scene
from rso_lidar.optics import Laser, Receiver, pixel_rays
from rso_lidar.records import Rays
from rso_lidar.scene import Lambertian, Phong, RetroReflector
from rso_lidar.scene.casting.first_hits import cast_rays
from rso_lidar.scene.casting.shadows import cut_rays
from rso_lidar.scene.embree import engine as embree
from rso_lidar.scene.embree.ray_by_ray import RayByRay
from tests.optics.bench_for_tests import box, place, plate, sphere, surface, truth_of
from tests.reference.scene.first_hits import reference_casting


@pytest.fixture(params=["packets", "ray by ray"], autouse=True)
def engine(request, monkeypatch):
    """Cast by what was found, and by what stands in for it where nothing is found."""
    if request.param == "packets":
        yield embree.engine()
        return
    stand_in = RayByRay()
    for module in ("cast", "shadows"):
        monkeypatch.setattr(f"rso_lidar.scene.casting.{module}.engine", lambda: stand_in)
    yield stand_in


LENS = Receiver(fov_deg=4, f_number=2.8, n_rows=64, n_cols=64, rays_per_pixel=16, min_rays_per_target=0)
SHINY = Phong(diffuse=0.1, specular=0.5, exponent=30.0)
EXACT = ("ray", "pixel", "target", "facet", "part")
ROUNDED = ("weight", "range_m", "cos_incidence", "brdf_per_sr", "sunlight_per_sr")


def both(targets, truth, lens=LENS, rays=None, **light):
    """Return the hits by the loops and by the reference, of the same rays."""
    rays = rays or pixel_rays(lens, Laser(divergence_deg=60), scene.extent(targets, truth))
    compiled = scene.cast(rays, targets, truth, 1, **light)
    with reference_casting():
        return compiled, scene.cast(rays, targets, truth, 1, **light)


def agree(compiled, reference, ties=0.0):
    """Check that hits are the same: to rounding, but for a share `ties` of rays that pass an edge within float32."""
    assert [getattr(compiled, name).dtype for name in EXACT] == [getattr(reference, name).dtype for name in EXACT]
    few = int(np.ceil(ties * len(reference.ray)))
    assert len(np.setxor1d(compiled.ray, reference.ray)) <= few
    _, one, other = np.intersect1d(compiled.ray, reference.ray, return_indices=True)
    same = (compiled.facet[one] == reference.facet[other]) & (compiled.target[one] == reference.target[other])
    assert np.sum(~same) <= few
    one, other = one[same], other[same]
    for name in EXACT:
        assert np.array_equal(getattr(compiled, name)[one], getattr(reference, name)[other]), name
    for name in ROUNDED:
        a, b = getattr(compiled, name), getattr(reference, name)
        if b is None:
            assert a is None
            continue
        off = np.abs(a[one] - b[other]) > 1e-12 * np.abs(b[other])
        # Shadows have edges too, where float32 may go either way.
        assert np.sum(off) <= (few if name in ("cos_incidence", "brdf_per_sr", "sunlight_per_sr") else 0), name


def some(seed=4, n=1):
    """Return targets of several shapes and materials, and where they are."""
    rng = np.random.default_rng(seed)
    part = np.repeat(np.array([0, 1], np.int16), [2560, 2560])
    cubes = {"part": np.repeat(np.array([0, 1], np.int16), 6), "part_names": ("bus", "cubes")}
    made = [
        surface("ball", sphere(12.0, 4), part=part, part_names=("matt", "shiny"), part_materials={"shiny": SHINY}),
        surface("box", box(6, 9, 20), Lambertian(reflectance=0.7)),
        surface(
            "cubes",
            box(4, 4, 5),
            **cubes,
            part_materials={
                "cubes": RetroReflector(diameter_mm=10.0, reflectance=0.9, fill_fraction=0.5, wavelength_nm=1064.0)
            },
        ),
        surface("smooth", sphere(5.0, 3), SHINY, smooth_parts=("body",)),
        surface("soup", rng.normal(size=(40, 3, 3)) * 4.0),
    ][:n]
    poses = {
        one.name: place((*rng.uniform(-18, 18, 2), 600 + 8 * k), Rotation.random(rng=rng)) for k, one in enumerate(made)
    }
    sun = np.array([0.4, -0.3, -0.87])
    return made, dataclasses.replace(truth_of(**poses), sun_direction=sun / np.linalg.norm(sun))


@pytest.mark.parametrize("n", [1, 2, 5])
@pytest.mark.parametrize("light", [{}, {"sun": True}, {"laser_from_m": (0.8, 0.3, 0.0)}, {"aperture_m": 0.05}])
def test_packets_meet_what_the_reference_meets(n, light):
    targets, truth = some(n=n)
    compiled, reference = both(targets, truth, **light)
    assert len(reference.ray) > 5_000 and len(set(reference.target.tolist())) == n
    if "sun" in light:
        assert np.mean(reference.sunlight_per_sr > 0) > 0.1
    agree(compiled, reference, ties=1e-3)


def test_a_small_wall_a_millimetre_before_a_large_one_is_met():
    """The large one's sphere begins nearer, so that it is asked first; the small one is within what rays get beyond it."""
    targets = [surface("large", plate(12.0)), surface("small", plate(3.0))]
    turned = Rotation.from_rotvec([0.0, 0.0, 0.3])  # so that no row of rays lies on a diagonal
    truth = truth_of(large=place((0, 0, 300.001), turned), small=place((0, 0, 300.0), turned))
    compiled, reference = both(targets, truth)
    agree(compiled, reference)
    assert np.sum(compiled.target == 1) > 100 and np.sum(compiled.target == 0) > 100
    assert (compiled.range_m * compiled.cos_incidence)[compiled.target == 1] == pytest.approx(300.0, rel=1e-12)


@pytest.mark.parametrize("range_m", [30.0, 3000.0, 50_000.0, 1e6])
def test_far_and_near_and_fine(range_m):
    """Rays on a grid over the target, far finer than pixels; 30 m is inside the sphere about a long target."""
    target = surface("sat", box(2, 3, 70))
    pose = place((0.1, 0.2, range_m), Rotation.from_rotvec([0.3, 1.2, -0.5]))
    truth = truth_of(sat=pose)
    seen = scene.extent([target], truth)
    low, high = np.maximum(seen.low[0], -0.05), np.minimum(seen.high[0], 0.05)
    right, down = np.meshgrid(*(np.linspace(low[axis], high[axis], 66)[1:-1] for axis in (0, 1)))
    direction = np.stack([right.ravel(), down.ravel(), np.ones(right.size)], axis=1)
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    rays = Rays((1, right.size), direction, np.arange(right.size), np.ones(right.size))
    compiled, reference = both([target], truth, rays=rays)
    assert len(reference.ray) > 300
    agree(compiled, reference, ties=1e-3)


@pytest.mark.parametrize("n_rays", [0, 1, 3, 16, 17, 255, 256, 257, 1000])
@pytest.mark.parametrize("n_targets", [1, 3])
def test_any_number_of_rays(n_rays, n_targets):
    targets, truth = some(n=n_targets)
    rng = np.random.default_rng(n_rays)
    direction = rng.normal(size=(n_rays, 3)) * [0.03, 0.03, 0] + [0, 0, 1]
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    rays = Rays((1, max(n_rays, 1)), direction, np.arange(n_rays), np.full(n_rays, 0.5))
    compiled, reference = both(targets, truth, rays=rays)
    assert n_rays < 100 or 0 < len(reference.ray) < n_rays
    agree(compiled, reference, ties=2e-3 if n_rays > 100 else 0.0)


def test_nothing_is_met():
    targets, truth = some(n=2)
    rays = Rays((1, 3), np.array([[0, 0, -1.0], [1, 0, 0], [0, 1, 0]]), np.arange(3), np.ones(3))
    for hits in (*both(targets, truth, rays=rays), *both(targets[:1], truth, rays=rays), *both([], truth, rays=rays)):
        assert len(hits.ray) == 0


def test_from_inside_and_behind():
    lens = Receiver(fov_deg=90, f_number=2, n_rows=32, n_cols=32, rays_per_pixel=1)
    for position in ((0.5, -0.3, 1.0), (0, 0, -3.0), (0, 0, 4.9)):
        agree(*both([surface("room", box(4, 6, 10))], truth_of(room=place(position)), lens), ties=1e-2)


def test_edge_on_to_rounding():
    """Facets half a millimetre deep, so that is where they are, seen edge-on; their planes say anything within metres.

    Embree's own distance is then rounding over rounding of float32 too, now and then: half of the hits are within 1 mm.
    """
    rng = np.random.default_rng(1)
    x = np.linspace(-0.04, 0.04, 50)
    direction = np.stack([x, np.zeros(50), np.full(50, 100.0)], axis=1)
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    rays = Rays((1, 50), direction, np.arange(50), np.ones(50))
    edge_on = Rotation.from_euler("x", 90, degrees=True)
    off_m = [[], []]
    for _ in range(40):
        turn = Rotation.random(rng=rng)
        strip = surface("strip", turn.apply(plate(0.1, 5e-4).reshape(-1, 3)).reshape(-1, 3, 3))
        truth = truth_of(strip=place((0, 0, 100.0), edge_on * turn.inv()))
        for found, hits in zip(off_m, both([strip], truth, rays=rays), strict=True):
            assert np.all(hits.cos_incidence < 1e-9) and np.all(np.isfinite(hits.range_m))
            found.append(hits.range_m - 100.0 / direction[hits.ray, 2])
    for found in map(np.concatenate, off_m):
        assert len(found) > 500 and np.median(np.abs(found)) < 1e-3


def test_what_is_behind_the_laser_casts_no_shadow():
    """The ball stands 100 m behind lens and laser, on the way on of the light to the laser, which has ended there."""
    (ball, *_), truth = some()
    pose = truth.poses.place("lidar", "ball")[0]
    laser = np.array([0.8, 0.3, 0.0])
    behind = laser + (laser - pose) / np.linalg.norm(laser - pose) * 100.0
    poses = {"ball": place(pose), "behind": place(behind)}
    rays = pixel_rays(LENS, Laser(divergence_deg=60), scene.extent([ball], truth_of(ball=place(pose))))
    alone = scene.cast(rays, [ball], truth_of(ball=place(pose)), 1, laser_from_m=laser)
    targets = [ball, surface("behind", sphere(30.0, 2))]
    for hits in both(targets, truth_of(**poses), rays=rays, laser_from_m=laser):
        assert np.mean(alone.cos_incidence > 0.0) > 0.9
        agree(hits, alone, ties=1e-3)


def test_of_two_in_one_place_the_first_is_met():
    """Also where the second's sphere is wider, so that its rays start first."""
    small, wide = plate(2.0), np.concatenate([plate(2.0), plate(1.0) + np.array([30.0, 0, 0])])
    here = place((0, 0, 200), Rotation.from_euler("z", 20, degrees=True))  # no ray along the diagonal of a plate
    for shapes in ((small, wide), (wide, small)):
        targets = [surface("a", shapes[0]), surface("b", shapes[1])]
        compiled, reference = both(targets, truth_of(a=here, b=here))
        shared = np.abs(compiled.range_m * compiled.rays.direction[compiled.ray, 0]) < 1.5
        assert np.sum(shared) > 100 and np.all(compiled.target[shared] == 0)
        agree(compiled, reference, ties=1e-3)


def test_many_targets_one_behind_the_other():
    rng = np.random.default_rng(8)
    shape, names = sphere(6.0, 2), [f"t{k}" for k in range(30)]
    poses = {n: place((*rng.uniform(-15, 15, 2), 500 + 10 * k), Rotation.random(rng=rng)) for k, n in enumerate(names)}
    order = rng.permutation(names)
    compiled, reference = both([surface(n, shape) for n in order], truth_of(**poses))
    assert len(set(reference.target.tolist())) > 15
    agree(compiled, reference, ties=1e-3)


@pytest.mark.parametrize("layout", ["C", "F", "strided"])
def test_any_layout_of_rays_is_taken_and_compiled_once(layout):
    targets, truth = some(n=2)
    rays = pixel_rays(LENS, Laser(divergence_deg=60), scene.extent(targets, truth))
    direction = {
        "C": np.ascontiguousarray(rays.direction),
        "F": np.asfortranarray(rays.direction),
        "strided": np.repeat(rays.direction, 2, axis=0)[::2],
    }[layout]
    pixel = rays.pixel if layout != "strided" else np.repeat(rays.pixel, 2)[::2]
    other = Rays(rays.shape, direction, pixel, rays.weight.copy())
    sun = {"sun": True, "laser_from_m": (0.3, 0, 0)}
    one, two = scene.cast(rays, targets, truth, 1, **sun), scene.cast(other, targets, truth, 2, **sun)
    for name in (*EXACT, *ROUNDED):
        assert getattr(one, name).tobytes() == getattr(two, name).tobytes()
    assert len(cast_rays.dispatcher.signatures) == len(cut_rays.dispatcher.signatures) == 1

"""The same mesh, rays and machine, by others: bare embree, Open3D, Mitsuba 3 and mitransient, each in pairs with ours.

A second table compares a default flash with mitransient at equal error. What a peer of the first table is given it gets
ready-made: rays of float32 in the target's own axes. Ours start from directions of float64 in lidar axes and turn them; both
end with NumPy arrays.
"""

import math
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import count, pairwise

import numpy as np

import rso_lidar as rl
from benchmarks import sampling, scenes
from benchmarks.clock import Work, pairs, quartiles, seconds
from benchmarks.report import Findings, Target, table
from rso_lidar import optics, scene
from rso_lidar.records import Extent, Truth
from rso_lidar.simulation import flash

BANDS = 16
BINS = 20
REFLECTANCE = 0.30
WALK_FRAMES = 40
SCENES = ("TDRS, 300 m", "TDRS, 1 km", "TDRS, 3 km")
# At equal error: CPU of mitransient with independent samples over that of a default flash, by range in metres.
GOALS = {300.0: 14.0, 1000.0: 60.0, 3000.0: 180.0}
SAMPLERS = ("independent", "stratified", "multijitter")
JUDGED = "independent"
FINEST = 64  # samples per side of a pixel in mitransient's own reference
SEEDS = 4  # renders of which the error is averaged


class Bench:
    """One scene, with what ours and the peers are given of it."""

    def __init__(self, name: str) -> None:
        self.scenario = scenes.build(name).replace(time=scenes.time_of(WALK_FRAMES))
        self.truth = next(rl.simulate(self.scenario, frames=[0])).truth
        self.surface, lidar = self.scenario.surfaces[0], self.scenario.instrument
        self.receiver, self.laser = lidar.receiver, lidar.laser
        self.rays = self.aimed()
        everywhere = Extent(np.full((1, 2), -np.inf), np.full((1, 2), np.inf))
        self.field = self.in_target_axes(optics.pixel_rays(self.receiver, self.laser, everywhere))
        self.made = self.in_target_axes(self.rays)

    def in_target_axes(self, rays: rl.records.Rays) -> tuple[np.ndarray, np.ndarray]:
        """Return origins and directions (ray, xyz), f4, in target axes; origins just before the target."""
        pose = self.truth.pose(self.surface.name, "lidar")
        along = pose.rotation.apply(np.ascontiguousarray(rays.direction))
        near_m = max(0.0, float(np.linalg.norm(pose.translation)) - 1.5 * self.surface.radius_m)
        return (pose.translation + near_m * along).astype(np.float32), along.astype(np.float32)

    def aimed(self) -> rl.records.Rays:
        """Return the rays that we make: none that cannot hit."""
        return optics.pixel_rays(self.receiver, self.laser, scene.extent(self.scenario.surfaces, self.truth))

    def cast(self, threads: int) -> Work:
        """Return our casting: directions in, hit records out."""
        return lambda: scene.cast(self.rays, self.scenario.surfaces, self.truth, threads)

    def geometry(self) -> None:
        """Find where targets are, make the rays, cast them."""
        scene.cast(self.aimed(), self.scenario.surfaces, self.truth, 2)

    def flash(self) -> None:
        """Make one whole frame, on one thread."""
        flash(self.scenario, self.truth, self.scenario.rng(0), 1)

    def walk(self) -> None:
        """Make whole frames, two at a time."""
        for _ in rl.simulate(self.scenario, threads=2):
            pass


@dataclass(frozen=True)
class Peer:
    """Somebody else's program for part of the walk. `make` may raise ImportError."""

    name: str
    install: str
    make: Callable[[Bench], Work]


def bare_embree(threads: int) -> Callable[[Bench], Work]:
    """Return embree as embreex hands it out, on the rays that we make, in bands where there are threads for them."""

    def make(bench: Bench) -> Work:
        embree, (start, along) = bench.surface.embree, bench.made
        cuts = np.linspace(0, len(start), 1 + (BANDS if threads > 1 else 1)).astype(int)
        bands = [slice(a, b) for a, b in pairwise(cuts) if b > a]
        pool = ThreadPoolExecutor(threads)

        def one(band: slice) -> object:
            return embree.run(start[band], along[band], query="INTERSECT", output=1)

        return (lambda: list(pool.map(one, bands))) if threads > 1 else (lambda: one(bands[0]))

    return make


def open3d(bench: Bench) -> Work:
    """Return Open3D's RaycastingScene over the whole field, all that it says of a hit."""
    import open3d as o3d

    corners = bench.surface.corners.reshape(-1, 3).astype(np.float32)
    facets = np.arange(len(corners), dtype=np.uint32).reshape(-1, 3)
    caster = o3d.t.geometry.RaycastingScene(nthreads=2)
    caster.add_triangles(o3d.core.Tensor(corners), o3d.core.Tensor(facets))
    rays = np.concatenate(bench.field, axis=1)
    return lambda: {key: value.numpy() for key, value in caster.cast_rays(o3d.core.Tensor(rays)).items()}


def mitsuba(*, normals: bool, ours: bool = False) -> Callable[[Bench], Work]:
    """Return Mitsuba 3 over the whole field or on our rays: distance and facet, or the whole record with normals.

    It is told that the rays are coherent. Its time holds the way in from NumPy and the way out to it.
    """

    def make(bench: Bench) -> Work:
        mi, dr = _mitsuba()
        world = mi.load_dict({"type": "scene", "target": _mesh(mi, bench.surface.corners.reshape(-1, 3))})
        start, along = (np.ascontiguousarray(array.T) for array in (bench.made if ours else bench.field))

        def cast() -> tuple[np.ndarray, ...]:
            rays = mi.Ray3f(mi.Point3f(start), mi.Vector3f(along))
            if normals:
                met = world.ray_intersect(rays, mi.RayFlags.All, True)
                wanted = met.t, met.prim_index, met.n
            else:
                met = world.ray_intersect_preliminary(rays, coherent=True)
                wanted = met.t, met.prim_index
            dr.eval(*wanted)
            return tuple(np.array(column) for column in wanted)

        return cast

    return make


def mitransient(bench: Bench) -> Work:
    """Return mitransient's histogram of 20 bins for each pixel, from 16 samples a pixel; it has no detector."""
    mi, _ = _mitsuba()
    return renders(mi, bench.scenario, bench.truth, "independent", bench.receiver.rays_per_pixel)


def renders(mi: object, scenario: rl.Scenario, truth: Truth, sampler: str, samples: int) -> Work:
    """Return mitransient's histogram (row, col, bin, 1) of a scene with one target, each time by another seed."""
    import mitransient as _registers_its_plugins  # noqa: F401

    surface, (rows, cols) = scenario.surfaces[0], scenario.lidar.receiver.shape
    pose = truth.pose("lidar", surface.name)
    distance_m = float(np.linalg.norm(pose.translation))
    # The target stands at the origin, where float32 is finest; +y is down in lidar axes.
    corners = pose.apply(surface.corners.reshape(-1, 3)) - np.array([0.0, 0.0, distance_m])
    lens = mi.ScalarTransform4f().look_at(origin=[0, 0, -distance_m], target=[0, 0, 0], up=[0, -1, 0])
    film = {
        "type": "transient_hdr_film",
        "width": cols,
        "height": rows,
        "start_opl": 2.0 * distance_m - BINS,
        "bin_width_opl": 2.0,
        "temporal_bins": BINS,
        "rfilter": {"type": "box"},
    }
    sensor = {
        "type": "perspective",
        "fov": scenes.FOV_DEG,
        "fov_axis": "x",
        "to_world": lens,
        "near_clip": 0.01,
        "far_clip": 2.0 * distance_m,
        "film": film,
        "sampler": {"type": sampler, "sample_count": samples},
    }
    beam = {"type": "uniform", "value": 1.0 / np.pi}
    laser = {"type": "projector", "fov": scenes.FOV_DEG, "to_world": lens, "irradiance": beam}
    path = {"type": "transient_path", "max_depth": 2}
    target = _mesh(mi, corners)
    world = mi.load_dict({"type": "scene", "integrator": path, "sensor": sensor, "laser": laser, "target": target})
    seeds = count()
    return lambda: np.array(mi.render(world, seed=next(seeds))[1])


def _mitsuba(threads: int = 2) -> tuple[object, object]:
    """Return Mitsuba with its compiled variant, and Dr.Jit. One thread is the calling one."""
    import drjit as dr
    import mitsuba as mi

    mi.set_variant("llvm_ad_mono")
    dr.set_thread_count(threads)
    return mi, dr


def _mesh(mi: object, corners: np.ndarray) -> object:
    """Return a two-sided Lambertian mesh of triangles, corner by corner."""
    properties = mi.Properties()
    grey = {"type": "uniform", "value": REFLECTANCE}
    properties["bsdf"] = mi.load_dict({"type": "twosided", "side": {"type": "diffuse", "reflectance": grey}})
    properties["face_normals"] = True
    mesh = mi.Mesh("target", len(corners), len(corners) // 3, props=properties)
    shape = mi.traverse(mesh)
    shape["vertex_positions"] = corners.ravel().astype(np.float32)
    shape["faces"] = np.arange(len(corners), dtype=np.uint32)
    shape.update()
    return mesh


EMBREE = "pip install embreex"
MITSUBA = "pip install mitsuba==3.9.1; it needs LLVM: Debian's libllvm19"
ONE = Peer("bare embree, 1 thread", EMBREE, bare_embree(1))
TWO = Peer("bare embree, 2 threads", EMBREE, bare_embree(2))
OPEN3D = Peer("Open3D, whole field", "pip install open3d; it needs libusb-1.0-0 and libgl1", open3d)
QUICK_MITSUBA = Peer("Mitsuba, whole field", MITSUBA, mitsuba(normals=False))
WHOLE_MITSUBA = Peer("Mitsuba with normals, whole field", MITSUBA, mitsuba(normals=True))
OUR_MITSUBA = Peer("Mitsuba, the rays that we make", MITSUBA, mitsuba(normals=False, ours=True))
OUR_WHOLE_MITSUBA = Peer("Mitsuba with normals, the rays that we make", MITSUBA, mitsuba(normals=True, ours=True))
MITRANSIENT = Peer(
    "mitransient, 20 bins", "pip install mitransient==1.3.1 mitsuba==3.9.1; " + MITSUBA[27:], mitransient
)


def compared(name: str, n: int) -> tuple[list[tuple[str, ...]], dict[tuple[str, str], np.ndarray]]:
    """Return the rows of one scene's table, and the ratios peer / ours by names of the two."""
    bench = Bench(name)
    ours = {
        "cast, 1 thread": (bench.cast(1), 1),
        "cast, 2 threads": (bench.cast(2), 1),
        "extent, rays and cast, 2 threads": (bench.geometry, 1),
        "flash, 1 thread": (bench.flash, 1),
        "whole walk, 2 threads": (bench.walk, WALK_FRAMES),
    }
    order = (
        ("cast, 1 thread", ONE),
        ("cast, 2 threads", TWO),
        ("cast, 2 threads", OPEN3D),
        ("cast, 2 threads", QUICK_MITSUBA),
        ("cast, 2 threads", WHOLE_MITSUBA),
        ("cast, 2 threads", OUR_MITSUBA),
        ("cast, 2 threads", OUR_WHOLE_MITSUBA),
        ("extent, rays and cast, 2 threads", QUICK_MITSUBA),
        ("extent, rays and cast, 2 threads", WHOLE_MITSUBA),
        ("flash, 1 thread", ONE),
        ("whole walk, 2 threads", TWO),
        ("whole walk, 2 threads", MITRANSIENT),
    )
    rows, ratios = [], {}
    for what, peer in order:
        try:
            theirs = peer.make(bench)
        except ImportError as error:
            print(f"skipped: {peer.name}: {error} ({peer.install})")
            continue
        work, frames = ours[what]
        took = pairs(work, theirs, n) / (frames, 1)
        ratio = took[:, 1] / took[:, 0]
        mine, other = np.median(took, axis=0) * 1e3
        rows.append((name, what, peer.name, f"{mine:.2f}", f"{other:.2f}", quartiles(ratio)))
        ratios[what, peer.name] = ratio
    return rows, ratios


def judged(name: str, ratios: dict[tuple[str, str], np.ndarray]) -> list[Target]:
    """Return what was wanted of the ratios of the first scene."""
    ratio = ratios.get(("cast, 2 threads", WHOLE_MITSUBA.name))
    if name != SCENES[0] or ratio is None:
        return []
    what = f"{name}: hit records, beside Mitsuba's with normals, whole field"
    return [Target(what, "no slower", f"{quartiles(ratio)} ×", bool(np.median(ratio) >= 1.0))]


def at_equal_error(range_m: float, n: int) -> tuple[list[tuple[str, ...]], list[Target]]:
    """Return rows and targets of a default flash beside mitransient with as many samples as its error needs."""
    mi, _ = _mitsuba(threads=1)
    scenario, truth = sampling.first_flash(range_m)
    light = sampling.pixel_light(scenario, sampling.cast(scenario, truth))
    error = sampling.rms_error(light, sampling.lattice_light(scenario, truth, sampling.COUNTS[-1]))
    reference = _image(renders(mi, scenario, truth, "multijitter", FINEST**2))
    rows, targets = [], []
    for sampler in SAMPLERS:

        def render(side: int, sampler: str = sampler) -> Work:
            return renders(mi, scenario, truth, sampler, side**2)

        side = cheapest_side(render, reference, error)
        took = pairs(lambda: flash(scenario, truth, scenario.rng(0), 1), render(side), n, time.thread_time)
        ratio, (mine, other) = took[:, 1] / took[:, 0], (f"{1e3 * took_s:.1f}" for took_s in np.median(took, axis=0))
        theirs = f"{100.0 * _mean_error(render(side), reference):.1f} %"
        name = f"TDRS, {range_m:g} m"
        rows.append((name, sampler, f"{100.0 * error:.1f} %", mine, theirs, f"{side**2:,}", other, quartiles(ratio)))
        if sampler == JUDGED:
            what = f"{name}: CPU of mitransient, {sampler} samples, over that of a default flash at equal error"
            met = bool(np.median(ratio) >= GOALS[range_m])
            targets.append(Target(what, f"at least {GOALS[range_m]:g} ×", f"{quartiles(ratio)} ×", met))
    return rows, targets


def cheapest_side(render: Callable[[int], Work], reference: np.ndarray, error: float) -> int:
    """Return the side of the grid of samples in a pixel that reaches an error in the least CPU time.

    It is the least side, or the next power of two: that is often faster, because Mitsuba divides by it.
    """
    low, high = 1, FINEST
    while high - low > 1:
        side = (low + high) // 2
        low, high = (low, side) if _mean_error(render(side), reference) <= error else (side, high)
    return min((high, 2 ** math.ceil(math.log2(high))), key=lambda side: min(_cpu_times(render(side))))


def _cpu_times(work: Work) -> list[float]:
    """Return the CPU times of some calls, warm."""
    work()
    return [seconds(work, 1, time.thread_time) for _ in range(3)]


def _mean_error(work: Work, reference: np.ndarray) -> float:
    """Return the rms error of the light of some renders by different seeds."""
    return math.sqrt(np.mean([sampling.rms_error(_image(work), reference) ** 2 for _ in range(SEEDS)]))


def _image(work: Work) -> np.ndarray:
    """Render once; return the light (pixel,) in all bins."""
    return work().sum(axis=(2, 3), dtype=float).ravel()


def run(*, quick: bool) -> Findings:
    """Return the table of all pairs, that at equal error, and what was wanted of them."""
    rows, equal, targets, n = [], [], [], 7 if quick else 11
    for name in SCENES:
        print(f"peers: {name}", file=sys.stderr)
        made, ratios = compared(name, n)
        rows += made
        targets += judged(name, ratios)
    columns = ("scene", "ours", "peer", "ours [ms]", "peer [ms]", "peer / ours")
    blocks = {"peers": table(columns, rows, left=3)}
    try:
        for range_m in GOALS:
            print(f"peers: at equal error, {range_m:g} m", file=sys.stderr)
            made, wanted = at_equal_error(range_m, n)
            equal += made
            targets += wanted
    except ImportError as error:
        print(f"skipped: {MITRANSIENT.name}: {error} ({MITRANSIENT.install})")
    else:
        mine, theirs = ("our error", "our CPU [ms]"), ("its error", "a pixel", "its CPU [ms]", "its / ours")
        blocks["equal error"] = table(("scene", "samples of mitransient", *mine, *theirs), equal, left=2)
    return Findings(blocks, targets)

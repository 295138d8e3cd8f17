"""Ranges and facets against exact geometry: 80-bit floats, analytic surfaces, and a loop over every facet.

Embree, which finds the facets, works in float32; nothing here does.
"""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rso_lidar import scene
from rso_lidar.optics import Laser, Receiver
from tests.optics.bench_for_tests import box, look, place, plate, see, sphere, truth_of

ALL = Laser(divergence_deg=170)
LONG = np.longdouble


def lens(fov_deg, n=16, rays_per_pixel=4):
    return Receiver(fov_deg=fov_deg, f_number=2.8, n_rows=n, n_cols=n, rays_per_pixel=rays_per_pixel)


def exact(pose, triangles):
    """Return the triangles (facet, corner, xyz) in lidar axes, in 80-bit floats from the pose's own numbers."""
    turn = pose.rotation.as_matrix().astype(LONG)
    return np.einsum("ij,fcj->fci", turn, triangles.astype(LONG)) + pose.translation.astype(LONG)


def exact_range(corners, direction):
    """Return the range [m] to the plane of each facet (hit, corner, xyz) along each ray (hit, xyz), in 80-bit floats."""
    direction = direction.astype(LONG)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.einsum("hi,hi->h", normal, corners[:, 0]) / np.einsum("hi,hi->h", normal, direction)


def outside_by(corners, point):
    """Return how far [m] each point lies outside its facet: the greatest distance beyond an edge, 0 inside."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    beyond = []
    for k in range(3):
        edge = corners[:, (k + 1) % 3] - corners[:, k]
        out = np.cross(edge, normal)
        out /= np.sqrt(np.einsum("hi,hi->h", out, out))[:, None]
        beyond.append(np.einsum("hi,hi->h", out, point - corners[:, k]))
    return np.maximum(np.max(beyond, axis=0), 0).astype(float)


def check(validation, case, triangles, pose, receiver, laser=ALL, at_least=100):
    """Every hit's range is that of its facet's plane to 1 um, and its point lies on the facet."""
    seen = look(triangles, pose, receiver, laser)
    hits = seen.hits
    assert len(hits.ray) >= at_least
    direction = seen.rays.direction[hits.ray]
    direction = direction / np.sqrt(np.einsum("hi,hi->h", direction.astype(LONG), direction.astype(LONG)))[:, None]
    corners = exact(pose, triangles)[hits.facet]
    expected = exact_range(corners, direction)
    off = np.abs(hits.range_m.astype(LONG) - expected).astype(float)
    worst = int(np.argmax(off))
    validation(
        case=case,
        source="plane of the facet in 80-bit floats",
        expected=float(expected[worst]),
        got=hits.range_m[worst],
        tolerance=1e-6,
        unit="m",
    )
    # float32 has 6e-8 of the coordinates, seen under a slant of cos(alpha).
    size = np.abs(triangles).max()
    slack = 1e-6 * (size + 1) / np.maximum(hits.cos_incidence, 1e-9)
    assert np.all(outside_by(corners, expected[:, None] * direction) <= slack)
    return seen


@pytest.mark.parametrize("range_km", [1, 5, 50])
@pytest.mark.parametrize("name", ["plate", "sphere", "box"])
def test_range_of_turned_bodies(validation, name, range_km):
    triangles = {"plate": plate(20.0, n=3), "sphere": sphere(10.0, 4), "box": box(5.0, 8.0, 20.0)}[name]
    rng = np.random.default_rng(range_km)
    for _ in range(3):
        range_m = range_km * 1e3
        pose = place((rng.normal(), rng.normal(), range_m), Rotation.random(rng=rng))
        receiver = lens(math.degrees(24 / range_m))
        check(validation, f"{name} at {range_km} km: range without noise", triangles, pose, receiver)


@pytest.mark.parametrize("range_m", [5.0, 100.0, 3000.0, 50_000.0])
@pytest.mark.parametrize("tilt_deg", [89.0, 89.9, 89.99])
def test_grazing_incidence(validation, range_m, tilt_deg):
    pose = place(
        (0, 0, range_m), Rotation.from_rotvec([0, 0, 0.3]) * Rotation.from_rotvec([0, math.radians(tilt_deg), 0])
    )
    check(
        validation,
        f"plate of 20 m tilted {tilt_deg} deg at {range_m:g} m: range",
        plate(20.0, n=2),
        pose,
        lens(min(60.0, math.degrees(22 / range_m)), 32),
        at_least=2,
    )


@pytest.mark.parametrize("range_m", [0.5, 1.0, 2.0, 5.0])
def test_near_range(validation, range_m):
    """Seed: from less than a metre. A turned wall that fills 45 degrees, and a box that reaches beside the lidar."""
    pose = place((0.1, -0.2, range_m), Rotation.from_rotvec([0.3, -0.2, 1.0]))
    check(validation, f"wall at {range_m:g} m over 45 deg: range", plate(30.0, n=5), pose, lens(45.0), at_least=1024)


@pytest.mark.parametrize("inside", [(0, 0, 0), (0.3, -0.8, 2.0), (1.9, 0, -1.0)])
def test_lidar_inside_a_target(validation, inside):
    """Berthing: the lidar is within the bounding sphere, here within the body itself. It sees all of its rays hit."""
    pose = place(inside, Rotation.from_rotvec([0.5, 1.0, -0.3]))
    seen = check(validation, f"lidar in a box, at {inside}: range", box(5, 6, 7), pose, lens(70.0), at_least=1024)
    assert len(seen.hits.ray) == len(seen.rays.pixel)


def test_lidar_in_the_bounding_sphere_but_outside_the_body(validation):
    """Under a wing of 20 m, 2 m from the body it is fixed to."""
    wing, body = plate(20.0, 2.0, n=4), box(2, 2, 2) + np.array([0, 0, -1.0])
    pose = place((3.0, 0.5, 4.0), Rotation.from_rotvec([0.2, 0.4, 0.1]))
    check(validation, "lidar 4 m from a wing of 20 m: range", np.concatenate([wing, body]), pose, lens(60.0))


@pytest.mark.slow
def test_a_sphere_of_many_facets_is_a_sphere(validation):
    """A ball of radius 10 m in 82,000 facets lies within its sagitta, e^2/(8 r) = 0.2 mm, of the analytic sphere."""
    triangles = sphere(10.0, 6)
    edge = np.linalg.norm(triangles - np.roll(triangles, 1, axis=1), axis=-1).max()
    centre = np.array([2.0, -1.0, 50_000.0])
    seen = look(triangles, place(centre, Rotation.from_rotvec([1, 2, 3])), lens(math.degrees(16 / 50_000.0)), ALL)
    d = seen.rays.direction[seen.hits.ray]
    along = d @ centre
    beside2 = np.sum(np.cross(d, centre) ** 2, axis=1)
    central = beside2 < 6.0**2
    expected = along - np.sqrt(10.0**2 - np.where(central, beside2, 0))
    late = (seen.hits.range_m - expected)[central]
    sagitta = edge**2 / 6 / 10.0 / 0.8  # at most e^2/(6 r) above a facet's middle, seen under cos 0.8
    assert late.min() > -1e-6
    validation(
        case="sphere of 10 m at 50 km: how late facets are met, at most",
        source="sagitta of a facet",
        expected=sagitta / 2,
        got=late.max(),
        tolerance=sagitta / 2,
        unit="m",
    )


def slow_first(corners, direction):
    """Return facet and range that each ray from the origin meets first: every facet tried, in float64.

    Facets whose bounds in the tangent plane do not hold the ray are skipped; all are ahead of the lidar.
    """
    assert corners[..., 2].min() > 0
    flat = corners[..., :2] / corners[..., 2:]
    low, high = flat.min(axis=1), flat.max(axis=1)
    facet, range_m = np.full(len(direction), -1), np.full(len(direction), np.inf)
    for k, d in enumerate(direction):
        x = d[:2] / d[2]
        some = np.flatnonzero(np.all((low <= x + 1e-9) & (high >= x - 1e-9), axis=1))
        a, b, c = corners[some, 0], corners[some, 1] - corners[some, 0], corners[some, 2] - corners[some, 0]
        h = np.cross(d, c)
        det = np.einsum("fi,fi->f", b, h)
        with np.errstate(divide="ignore", invalid="ignore"):
            u, q = np.einsum("fi,fi->f", -a, h) / det, np.cross(-a, b)
            v, t = q @ d / det, np.einsum("fi,fi->f", c, q) / det
        met = (det != 0) & (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)
        if met.any():
            best = np.argmin(np.where(met, t, np.inf))
            facet[k], range_m[k] = some[best], t[best]
    return facet, range_m


@pytest.mark.parametrize(
    ("name", "range_m"),
    [("tdrs", "near"), ("tdrs", 3000.0), ("tdrs", 50_000.0), ("iss", "near"), ("iss", 50_000.0)],
)
def test_real_spacecraft_facet_by_facet(validation, shared, name, range_m):
    """Real meshes: open shells, mixed winding, doubled facets. The same facet, or one that coincides to 1 um."""
    target = scene.build_surface(name, scene.load_mesh(shared / "meshes" / f"{name}.stl"))
    centre, radius = target.sphere
    range_m = 1.3 * radius if range_m == "near" else range_m
    turn = Rotation.from_rotvec([0.7, -1.1, 0.4])
    pose = place(np.array([0, 0, range_m]) - turn.apply(centre), turn)
    receiver = lens(min(100.0, 2 * math.degrees(math.atan(0.8 * radius / range_m))), 20 if name == "tdrs" else 14, 1)
    receiver = receiver.replace(min_rays_per_target=0)
    seen = see(target, truth_of(**{name: pose}), receiver, ALL)
    # Relative to the lidar the corners are exact to 1e-11 m at 50 km.
    facet, expected = slow_first(pose.apply(target.corners.reshape(-1, 3)).reshape(-1, 3, 3), seen.rays.direction)
    got_facet, got = np.full(len(facet), -1), np.full(len(facet), np.inf)
    got_facet[seen.hits.ray] = np.searchsorted(target.mesh.source_facet, seen.hits.facet)
    got[seen.hits.ray] = seen.hits.range_m
    assert np.sum(facet >= 0) > 40
    assert np.array_equal(got_facet >= 0, facet >= 0), "a ray hits in one and misses in the other"
    hit = facet >= 0
    off = np.abs(got[hit] - expected[hit])
    validation(
        case=f"{name} from {range_m:.0f} m, {hit.sum()} rays: greatest difference of range",
        expected=0.0,
        source="loop over every facet, float64",
        got=off.max(),
        tolerance=1e-6,
        unit="m",
    )
    validation(
        case=f"{name} from {range_m:.0f} m: rays on another facet that does not coincide",
        expected=0,
        source="loop over every facet, float64",
        got=np.sum((got_facet[hit] != facet[hit]) & (off > 1e-6)),
        tolerance=0,
        unit="1",
    )


def test_cosine_of_incidence_on_a_sphere(validation):
    """cos(alpha) of a facet is that of its plane; over a ball it averages, by area seen, to 2/3."""
    seen = look(sphere(10.0, 5), place((0, 0, 50_000.0)), lens(math.degrees(21 / 50_000.0), 64), ALL)
    mean = np.average(seen.hits.cos_incidence, weights=seen.hits.weight)
    validation(
        case="mean cos(alpha) over the disc of a sphere",
        source="integral of sqrt(1 - r^2) over the disc",
        expected=2 / 3,
        got=mean,
        tolerance=2e-3,
        unit="1",
    )
    facing = np.linalg.norm(seen.rays.direction[seen.hits.ray][:, :2], axis=1) * 50_000 < 0.5
    assert np.all(seen.hits.cos_incidence[facing] > 0.998)


@pytest.mark.parametrize("rays_per_pixel", [1, 16])
def test_a_point_is_its_range_along_the_line_of_sight(validation, rays_per_pixel):
    """range_m is a slant range: a wall at distance d is seen at d/cos(theta), and the points lie in its plane."""
    receiver = lens(45.0, 64, rays_per_pixel)
    seen = look(plate(500.0), place((0, 0, 100.0)), receiver, ALL)
    points = seen.labels.range_m[..., None] * receiver.line_of_sight
    # The mean of sub-rays is not the centre's range: their second-order spread, d (p/2)^2 / 6 at most.
    slack = 0.0 if rays_per_pixel == 1 else 100 * receiver.pixel_tangent**2 / 6
    validation(
        case=f"wall at 100 m over 45 deg, {rays_per_pixel} rays: greatest depth of a point",
        source="plane z = 100 m",
        expected=100.0,
        got=points[..., 2].max(),
        tolerance=1e-9 + slack,
        unit="m",
    )
    assert points[..., 2].min() > 100 - 1e-9 - slack

"""Bounces: the same light from either end, by any number of threads, of any material."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rso_lidar.optics import Laser, Receiver, collect
from rso_lidar.scene import Crinkled, Ggx, Lambertian, OrenNayar, Phong, bounce
from rso_lidar.scene.bounces import bounce as room
from tests.optics.bench_for_tests import corner, place, see, sphere, surface, truth_of

LENS = Receiver(fov_deg=2.5, f_number=2.8, n_rows=16, n_cols=16, rays_per_pixel=64)
WIDE = Laser(divergence_deg=6.0)


class Glossy:
    """A material of a user: without a lobe of its own."""

    def brdf_per_sr(self, cos_in, cos_out, cos_phase):
        return 0.1 + 0.3 * np.clip(2.0 * cos_in * cos_out - cos_phase, 0.0, 1.0) ** 4


MATERIALS = {
    "lambertian": Lambertian(reflectance=0.5),
    "phong": Phong(diffuse=0.2, specular=0.6, exponent=40.0),
    "ggx": Ggx(diffuse=0.2, specular=0.6, roughness=0.1),
    "rough": OrenNayar(reflectance=0.5, roughness_deg=30.0),
    "crinkled": Crinkled(diffuse=0.1, specular=0.8, exponent=60.0, tilt_deg=6.0, cell_mm=300.0),
    "own": Glossy(),
}


def scene_of(material, smooth=(), offset=(0.0, 0.0, 0.0)):
    """Return a ball before two plates at right angles: surfaces, truth, laser and hits."""
    ball = sphere(0.6, 2) + np.array([0.0, 0.3, -1.2])
    triangles, part = np.concatenate([corner(), ball]), np.repeat([0, 1], [4, len(ball)]).astype(np.int16)
    names = {"part": part, "part_names": ("corner", "ball"), "smooth_parts": smooth}
    target = [surface("target", triangles, material, **names)]
    truth = truth_of(target=place((0, 0, 100.0), Rotation.from_euler("xyz", [12, 9, 4], degrees=True)))
    laser = WIDE.replace(offset_m=offset)
    return target, truth, laser, see(target, truth, LENS, laser).hits


def light(hits, laser, bounces):
    """Return the photons of all bounces but the first."""
    return collect(hits, laser, LENS, bounces=bounces).photons.sum() - collect(hits, laser, LENS).photons.sum()


@pytest.mark.parametrize(
    ("material", "smooth", "offset", "most"),
    [(name, (), (0.0, 0.0, 0.0), 4) for name in MATERIALS]
    + [
        ("phong", ("ball",), (0.0, 0.0, 0.0), 2),
        ("ggx", ("ball",), (3.0, 1.0, 0.0), 4),
        ("crinkled", (), (3.0, 1.0, 0.0), 2),
    ],
)
def test_light_is_the_same_from_either_end(material, smooth, offset, most):
    """Path tracing alone, and light tracing alone, find what the two find together.

    Light tracing finds no light of points that the lens does not see, of which there are some with a laser beside it.
    """
    target, truth, laser, hits = scene_of(MATERIALS[material], smooth, offset)
    found = []
    for key in range(6):
        words = np.array([key, 1], np.uint32)
        made = bounce(hits, target, truth, words, 1, laser_from_m=laser.offset, n_paths=8_000, most=most)
        zero = np.zeros(len(made.hit))
        inward = replace(made, outward_per_sr=zero, reverse_density=zero)
        outward = replace(made, inward_per_sr=zero, reverse_density=zero)
        found.append([light(hits, laser, one) for one in (made, inward, outward)])
    both, inward, outward = np.mean(found, axis=0)
    error = np.std(found, axis=0, ddof=1) / np.sqrt(len(found))
    assert abs(inward - both) < 5.0 * np.hypot(error[0], error[1]) + 2e-3 * both
    if any(offset):
        assert 0.85 * both < outward < both + 5.0 * np.hypot(error[0], error[2])
    else:
        assert abs(outward - both) < 5.0 * np.hypot(error[0], error[2]) + 2e-3 * both


def test_threads_do_not_change_a_bit(monkeypatch):
    monkeypatch.setattr(room, "_BAND_PATHS", 500)
    target, truth, _, hits = scene_of(MATERIALS["crinkled"], ("ball",))
    made = [bounce(hits, target, truth, np.array([3, 1], np.uint32), threads) for threads in (1, 4)]
    for name in ("hit", "direction", "range_m", "between_m", "inward_per_sr", "outward_per_sr", "reverse_density"):
        np.testing.assert_array_equal(getattr(made[0], name), getattr(made[1], name))
    assert len(made[0].hit) > 500


def test_a_convex_body_has_no_paths():
    target = [surface("ball", sphere(1.0, 2))]
    truth = truth_of(ball=place((0, 0, 100.0)))
    hits = see(target, truth, LENS, WIDE).hits
    assert len(bounce(hits, target, truth, np.array([1, 1], np.uint32)).hit) == 0


def test_light_passes_between_targets():
    """Two halves of a corner as two targets send on the same light as one target."""
    triangles = corner()
    pose = place((0, 0, 100.0))
    one = [surface("target", triangles)]
    two = [surface("left", triangles[:2]), surface("right", triangles[2:])]
    found = []
    for target, truth in ((one, truth_of(target=pose)), (two, truth_of(left=pose, right=pose))):
        hits = see(target, truth, LENS, WIDE).hits
        found.append(light(hits, WIDE, bounce(hits, target, truth, np.array([5, 1], np.uint32), 1, n_paths=20_000)))
    assert found[1] == pytest.approx(found[0], rel=1e-6)

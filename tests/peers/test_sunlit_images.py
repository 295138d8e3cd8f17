"""Images in sunlight, pixel by pixel, against Mitsuba 3: radiance, shadows with sharp and soft edges, silhouettes.

What was rendered is kept beside this file (tests/peers/render_sunlit.py). Nothing is normalised: radiance is compared over
the irradiance of the Sun.
"""

import numpy as np
import pytest

from rso_lidar.scene import Lambertian
from tests.optics.bench_for_tests import place, surface
from tests.peers.render_sunlit import KEPT
from tests.peers.scenes_for_tests import REFLECTANCE
from tests.peers.sunlit_for_tests import load_scenes
from tests.physics.camera_bench import make_lens, radiance_over_sun, take

pytestmark = pytest.mark.slow
WORST = 0.01  # of the brightest pixel: the agreement that is asked for
COVERED = 0.01  # of a pixel's area
SHIPPED, NASA = tuple(load_scenes(None)), ("aura", "cassini")


def compare(key, scene):
    """Return the worst differences of radiance, over that of the brightest pixel, of all light, and of the pixels' cover."""
    with np.load(KEPT) as kept:
        if not np.allclose(kept[f"{key}_check"], scene.check, rtol=1e-9, atol=1e-6):
            pytest.fail(f"{scene.name} is not what was rendered: python -m tests.peers.render_sunlit", pytrace=False)
        theirs, covered = kept[f"{key}_radiance"], kept[f"{key}_covered"]
    target = surface("target", scene.triangles, Lambertian(reflectance=REFLECTANCE))
    lens = make_lens(scene.fov_deg, scene.n, rays_per_pixel=scene.rays_per_pixel)
    poses = {"target": place((0.0, 0.0, scene.distance_m))}
    _, labels, camera = take([target], poses, scene.sun_direction, lens, has_penumbra=scene.is_disc)
    ours = radiance_over_sun(labels, camera)
    off = np.abs(ours - theirs)
    return off.max() / theirs.max(), ours.sum() / theirs.sum() - 1.0, np.abs(labels.filled_fraction - covered).max()


@pytest.fixture(scope="module", params=[*SHIPPED, *NASA])
def pair(request):
    """Return a scene and how far both are apart in it."""
    key = request.param
    folder = request.getfixturevalue("shared") / "meshes" if key in NASA else None
    scene = load_scenes(folder)[key]
    return scene, *compare(key, scene)


def test_radiance_and_silhouette_of_every_pixel(validation, pair):
    scene, worst, total, uncovered = pair
    with np.load(KEPT) as kept:
        source = ", ".join(kept["made_by"].tolist())
    rows = (
        ("worst pixel, of the brightest", worst, WORST),
        ("light of all pixels", total, WORST),
        ("worst share of a pixel that is covered", uncovered, COVERED),
    )
    for what, off, allowed in rows:
        case = f"{scene.name}: {what}"
        validation(case=case, source=source, expected=0.0, got=100.0 * off, tolerance=100.0 * allowed, unit="%")

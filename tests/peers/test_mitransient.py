"""Noise-free waveforms, pixel by pixel, against an independent transient renderer: mitransient on Mitsuba 3.

The renderer gives the radiance of each pixel over optical path length, for a beam of one unit per unit area of the tangent
plane. Through a lens of area A and transmission eta, a pixel of side p in the tangent plane, at theta from the boresight,
receives b A eta p^2 cos^4(theta) times that (cos^3 is the pixel's solid angle, cos the foreshortened lens). Nothing is
normalised: energy and delay are compared as they are. What was rendered is kept beside this file and compared at every run;
where mitransient is installed (pip install mitransient==1.3.1, or make peers), it is rendered anew.
"""

import importlib.util
import math
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from rso_lidar.detector import Gate, Gsfl
from rso_lidar.detector.chain.timing import plan_time
from rso_lidar.detector.stages.time_axis import place_gate_rows
from rso_lidar.optics import Laser, Receiver
from rso_lidar.scene import Lambertian
from tests.detector.returns_for_tests import simulate_rows
from tests.optics.bench_for_tests import look, place
from tests.peers.render import KEPT, SEEDS
from tests.peers.scenes_for_tests import SCENES, Scene

pytestmark = pytest.mark.slow
ROOT = Path(__file__).resolve().parents[2]
LIGHT_M_S = 299_792_458.0
FWHM_NS = 8.0
SIGMA_S = FWHM_NS * 1e-9 / math.sqrt(8.0 * math.log(2.0))
WORST = 0.01  # of the peak: the agreement that is asked for
WORST_OF_TWO = 0.02  # the same, where light meets two surfaces
PATHS = 200_000  # of light that meets two surfaces
NOISE = 0.002  # of the peak: the renderer's own noise, so that it does not decide
ENERGY = 1e-3  # of all photons of a scene: Monte Carlo's share and the rays' that cut edges are each some 1e-4
FAINT = (
    0.05  # a pixel that peaks below this share of the brightest one's is a sliver of few rays, and is held to the share
)


@dataclass(frozen=True, eq=False)
class Pair:
    """One scene as both see it: photons per second (row, col, step) at the same times; the renderer's for each seed."""

    key: str
    scene: Scene
    time_s: np.ndarray
    ours: np.ndarray
    theirs: list

    @property
    def allowed(self):
        """Return the agreement that is asked for, as a share of the peak."""
        return WORST if self.scene.bounces == 1 else WORST_OF_TWO

    @property
    def mean(self):
        return np.mean(self.theirs, axis=0)

    def total(self, waveforms):
        """Return all photons of a scene."""
        return waveforms.sum() * (self.time_s[1] - self.time_s[0])


def parts(scene):
    """Return the receiver and the laser of a scene."""
    n, rays = scene.n, scene.rays_per_pixel
    receiver = Receiver(fov_deg=scene.fov_deg, f_number=2.8, n_rows=n, n_cols=n, rays_per_pixel=rays)
    return receiver, Laser(divergence_deg=scene.divergence_deg, pulse_fwhm_ns=FWHM_NS)


def detector_waveforms(scene):
    """Return times since emission (step) [s] and the photons per second (row, col, step) that reach the detector.

    They are the primary electrons of the detector's own chain without noise, over its quantum efficiency.
    """
    receiver, laser = parts(scene)
    material, paths = Lambertian(reflectance=scene.reflectance), PATHS if scene.bounces > 1 else None
    photons = look(scene.triangles, place((0, 0, scene.distance_m)), receiver, laser, material, paths=paths).photons
    start_m, bins = scene.path_m
    margin_ns = 2.5 * FWHM_NS
    per_m_ns = 1e9 / LIGHT_M_S
    width_ns = bins * scene.bin_m * per_m_ns + 2 * margin_ns
    gsfl = Gsfl(gate=Gate(delay_ns=start_m * per_m_ns - margin_ns, width_ns=width_ns))
    n_pixels = scene.n**2
    plan = plan_time(gsfl, laser.pulse_fwhm_s)
    rows, _ = place_gate_rows(gsfl.gate, gsfl.readout, plan, n_pixels)
    made = simulate_rows(gsfl, photons, rows, None)
    time_s = (rows.start[0] + np.arange(rows.length)) * plan.step_s
    per_s = made.primaries.astype(float) / (gsfl.quantum_efficiency * plan.step_s)
    return time_s, per_s.reshape(scene.n, scene.n, -1)


def peer_waveforms(scene, radiance, time_s):
    """Return the photons per second (row, col, step) that the renderer's radiance (row, col, bin) sends to the detector."""
    receiver, laser = parts(scene)
    side = receiver.pixel_tangent
    beam = laser.photons / (2.0 * math.tan(math.radians(scene.divergence_deg) / 2)) ** 2
    at = (np.arange(scene.n) + 0.5 - 0.5 * scene.n) * side
    cos4 = (1.0 + at[:, None] ** 2 + at**2) ** -2
    photons = radiance * (beam * receiver.aperture_area_m2 * receiver.transmission * side**2 * cos4)[..., None]
    start_m, bins = scene.path_m
    path_m = start_m + (np.arange(bins) + 0.5) * scene.bin_m
    late = (time_s - path_m[:, None] / LIGHT_M_S) / SIGMA_S
    pulse = np.exp(-0.5 * late**2) / (SIGMA_S * math.sqrt(2.0 * math.pi))
    return np.einsum("rcb,bt->rct", photons, pulse)


def rendered(path, key, scene, time_s):
    """Return the renderer's waveforms of one scene in a file, for each seed."""
    with np.load(path) as kept:
        if not np.allclose(kept[f"{key}_check"], scene.check, rtol=1e-9, atol=1e-6):
            pytest.fail(f"{scene.name} is not what was rendered: python -m tests.peers.render", pytrace=False)
        return [peer_waveforms(scene, kept[f"{key}_{seed}"], time_s) for seed in SEEDS]


def worst(some, others):
    """Return the greatest difference of two sets of waveforms as a share of the pixel's peak, and the pixels compared."""
    peak = np.maximum(some, others).max(axis=2)
    floor = FAINT * peak.max()
    off = np.abs(some - others).max(axis=2) / np.maximum(peak, floor)
    return float(off.max()), int((peak > floor).sum())


@pytest.fixture(scope="module", params=SCENES)
def pair(request):
    """Return one scene as both see it; the renderer's part is the kept one."""
    scene = SCENES[request.param]()
    time_s, ours = detector_waveforms(scene)
    return Pair(request.param, scene, time_s, ours, rendered(KEPT, request.param, scene, time_s))


@pytest.fixture(scope="module")
def anew(tmp_path_factory):
    """Return the file that the renderer writes now, in a process of its own: with an old LLVM it aborts."""
    if importlib.util.find_spec("mitransient") is None:
        pytest.skip(
            "mitransient is not installed (pip install mitransient==1.3.1, or make peers); the kept renderings are compared"
        )
    path = tmp_path_factory.mktemp("peers") / "mitransient.npz"
    command = [sys.executable, "-m", "tests.peers.render", str(path)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    if done.returncode:
        why = f"mitransient cannot render; it needs LLVM 19 (tests/peers/render.py):\n{done.stderr[-2000:]}"
        pytest.fail(why, pytrace=False)
    return path


@pytest.fixture(scope="module")
def source():
    """Return what rendered the kept file: names and versions."""
    with np.load(KEPT) as kept:
        return ", ".join(kept["made_by"].tolist())


def test_waveforms_of_every_pixel(validation, pair, source):
    off, compared = worst(pair.ours, pair.mean)
    assert compared >= (60 if pair.scene.bounces == 1 else 20), "pixels with light to compare"
    rays = f"{pair.scene.rays_per_pixel} rays per pixel{'' if pair.scene.bounces == 1 else ', two bounces'}"
    validation(
        case=f"{pair.scene.name}, {rays}: worst of {compared} pixels, of its peak",
        source=source,
        expected=0.0,
        got=100.0 * off,
        tolerance=100.0 * pair.allowed,
        unit="%",
    )


def test_all_photons(validation, pair, source):
    theirs = pair.total(pair.mean)
    validation(
        case=f"{pair.scene.name}: photons on all pixels{', two bounces' if pair.scene.bounces > 1 else ''}",
        source=source,
        expected=theirs,
        got=pair.total(pair.ours),
        tolerance=ENERGY * theirs,
        unit="photons",
    )


def test_the_renderers_noise_does_not_decide(pair):
    first, second = pair.theirs
    assert worst(first, second)[0] / 2.0 < NOISE, "of the mean of two renderings with independent noise"


def test_small_errors_would_be_seen(pair):
    """A delay of 2 cm, or 1.5 % of the energy, is past what is allowed; of two bounces twice as much."""
    more = pair.allowed / WORST
    with np.load(KEPT) as kept:
        late = peer_waveforms(pair.scene, kept[f"{pair.key}_{SEEDS[0]}"], pair.time_s - 2 * 0.02 * more / LIGHT_M_S)
    assert worst(pair.ours, late)[0] > pair.allowed
    assert worst(pair.ours, (1.0 - 0.015 * more) * pair.mean)[0] > pair.allowed


def test_rendered_anew(pair, anew):
    """What is kept is what mitransient renders, and it agrees with rso_lidar just as well."""
    mean = np.mean(rendered(anew, pair.key, pair.scene, pair.time_s), axis=0)
    assert worst(mean, pair.mean)[0] < NOISE
    assert worst(pair.ours, mean)[0] < pair.allowed

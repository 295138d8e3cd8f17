import ctypes
import gc
import os
import platform
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from importlib import metadata
from threading import Barrier

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rso_lidar import optics, scene
from rso_lidar.errors import MeshError
from rso_lidar.scene.embree import engine as packets
from rso_lidar.scene.embree.ray_by_ray import RayByRay
from rso_lidar.scene.surfaces import surface as surfaces
from tests.optics.bench_for_tests import PAPER_LASER, PAPER_RECEIVER, box, place, see, sphere, surface, truth_of
from tests.reference.scene.first_hits import reference_casting

ENGINE = packets.engine()
needs_packets = pytest.mark.skipif(isinstance(ENGINE, RayByRay), reason="embree is not there to be asked for packets")


class Spy:
    """Embree's library, with some functions answered here, and all calls noted."""

    def __init__(self, library, **answers):
        self.library, self.answers, self.called = library, answers, []

    def __getattr__(self, name):
        def call(*arguments):
            self.called.append((name, *arguments))
            return self.answers[name] if name in self.answers else getattr(self.library, name)(*arguments)

        return call

    def count(self, name):
        return sum(call[0] == name for call in self.called)


@needs_packets
@pytest.mark.parametrize("isa", ["avx512", "avx2", "sse4.2"])
def test_packets_of_any_width_meet_the_same(isa, monkeypatch):
    """16, 8 and 4 rays at once: the same hits, but that embree may take either of two facets on their common edge."""
    try:
        engine = packets.open_engine(packets._libraries()[0], isa)
    except ValueError:
        pytest.skip(f"this processor has no {isa}")
    assert engine.width in (4, 8, 16)
    rng = np.random.default_rng(5)
    targets = [surface("ball", sphere(20.0, 4)), surface("box", box(5, 9, 30))]
    poses = {
        "ball": place((2, 1, 1500), Rotation.random(rng=rng)),
        "box": place((-9, 3, 1400), Rotation.random(rng=rng)),
    }
    truth = truth_of(**poses)
    rays = optics.pixel_rays(PAPER_RECEIVER, PAPER_LASER, scene.extent(targets, truth))
    with reference_casting():
        expected = scene.cast(rays, targets, truth, 1)
    monkeypatch.setattr("rso_lidar.scene.casting.cast.engine", lambda: engine)
    got = scene.cast(rays, targets, truth, 1)
    assert len(expected.ray) > 10_000
    assert len(np.setxor1d(got.ray, expected.ray)) <= 3  # at the rim, float32 may go either way
    _, one, other = np.intersect1d(got.ray, expected.ray, return_indices=True)
    same = (got.facet[one] == expected.facet[other]) & (got.target[one] == expected.target[other])
    assert np.mean(~same) < 1e-3
    assert got.range_m[one][same].tobytes() == expected.range_m[other][same].tobytes()


def test_the_embree_that_embreex_brings_is_found():
    """The tests of packets are skipped where there are none: this one fails where there ought to be."""
    files = metadata.files("embreex") or []
    if platform.machine() not in ("x86_64", "AMD64") or not any("embree4" in file.name for file in files):
        pytest.skip("embreex brings no Embree 4 here")
    assert isinstance(packets.engine(), packets.Embree)


def test_without_the_library_embreex_does_the_work(tmp_path, monkeypatch):
    (tmp_path / "libembree4.so").write_bytes(b"no library")
    seen = see(surface("sat", box(3, 4, 5)), truth_of(sat=place((0, 0, 900))))
    for found in ([], [tmp_path / "libembree4.so"], [tmp_path / "nothing.so"]):
        monkeypatch.setattr(packets, "_libraries", lambda found=found: found)
        packets._find_engine.cache_clear()
        try:
            assert isinstance(packets.engine(), RayByRay)
            again = see(surface("sat", box(3, 4, 5)), truth_of(sat=place((0, 0, 900))))
        finally:
            packets._find_engine.cache_clear()
        assert np.array_equal(again.hits.ray, seen.hits.ray)
        assert again.hits.range_m == pytest.approx(seen.hits.range_m, rel=1e-12)


@needs_packets
@pytest.mark.parametrize(
    ("answers", "says"),
    [
        ({"rtcGetDeviceProperty": 30_130}, "version 30130"),
        ({"rtcNewDevice": None}, "cannot make a device"),
    ],
)
def test_another_embree_will_not_do(answers, says, monkeypatch):
    monkeypatch.setattr(ctypes, "CDLL", lambda path: _with_functions(answers))
    with pytest.raises(ValueError, match=says):
        packets.open_engine(packets._libraries()[0])


def _with_functions(answers):
    class Library:
        def __getattr__(self, name):
            def function(*arguments):
                return answers.get(name, 1)

            setattr(self, name, function)
            return function

    return Library()


@needs_packets
def test_what_a_scene_takes_it_gives_back():
    spy = Spy(ENGINE.library)
    built = packets.PacketScene(ENGINE._replace(library=spy), box(1, 2, 3))
    address = built.address
    assert address and spy.count("rtcReleaseGeometry") == spy.count("rtcNewGeometry") == 1
    assert spy.count("rtcReleaseScene") == 0
    del built
    gc.collect()
    assert [call for call in spy.called if call[0] == "rtcReleaseScene"] == [("rtcReleaseScene", address)]


@needs_packets
@pytest.mark.parametrize(
    ("answers", "error"),
    [
        ({"rtcGetDeviceError": 4}, MemoryError),
        ({"rtcGetDeviceError": 1}, MeshError),
        ({"rtcNewScene": None}, MeshError),
        ({"rtcNewGeometry": None}, MeshError),
        ({"rtcSetNewGeometryBuffer": None}, MeshError),
    ],
)
def test_a_scene_that_cannot_be_built_says_so_and_leaves_nothing(answers, error):
    spy = Spy(ENGINE.library, **answers)
    with pytest.raises(error, match=r"embree: .*mesh") as raised:
        packets.PacketScene(ENGINE._replace(library=spy), box(1, 2, 3))
    assert error is MemoryError or "check the mesh" in str(raised.value)
    del raised
    gc.collect()
    for kind in ("Scene", "Geometry"):
        made = spy.count(f"rtcNew{kind}") if f"rtcNew{kind}" not in answers else 0
        assert spy.count(f"rtcRelease{kind}") == made


@needs_packets
def test_frames_side_by_side_share_one_scene():
    together = Barrier(4)

    def build(_):
        one = surface("sat", sphere(1.2345, 4))
        together.wait()
        return one.scene(ENGINE)

    with ThreadPoolExecutor(4) as pool:
        built = list(pool.map(build, range(4)))
    assert len({id(one) for one in built}) == 1
    assert surface("other", sphere(1.2346, 4)).scene(ENGINE) is not built[0]


@needs_packets
def test_more_targets_than_scenes_are_kept(monkeypatch):
    """A scene that is dropped from those kept stays good for who casts at it, and is not built twice meanwhile."""
    monkeypatch.setattr(surfaces, "_SCENES_KEPT", 2)
    targets = [surface(f"t{k}", box(0.5, 0.5, 0.5 + 0.01 * k)) for k in range(6)]
    truth = truth_of(**{f"t{k}": place((2.0 * k - 5.0, 0, 300)) for k in range(6)})
    one, other = see(targets, truth).hits, see(targets, truth).hits
    assert set(one.target.tolist()) == set(range(6))
    assert one.range_m.tobytes() == other.range_m.tobytes()
    assert targets[0].scene(ENGINE) is targets[0].scene(ENGINE)


def test_a_mesh_of_one_facet_and_one_with_facets_of_no_area():
    triangle = np.array([[[-1.0, -1, 0], [1, -1, 0], [0, 1, 0]]])
    for shape in (triangle, np.concatenate([np.zeros((3, 3, 3)), triangle, np.ones((2, 3, 3))])):
        with np.errstate(invalid="ignore"):  # such facets have no normal; they are taken out where files are read
            hits = see(surface("sat", shape), truth_of(sat=place((0, 0, 50)))).hits
        assert len(hits.ray) > 100
        assert set(hits.facet.tolist()) == {0 if len(shape) == 1 else 3}
        assert np.all(np.isfinite(hits.range_m))


def test_what_goes_wrong_in_embreex_is_raised(monkeypatch):
    """The kernel that asks cannot raise it."""
    stand_in, target = RayByRay(), surface("sat", box(3, 4, 5))
    monkeypatch.setattr("rso_lidar.scene.casting.cast.engine", lambda: stand_in)
    truth = truth_of(sat=place((0, 0, 900)))
    assert len(see(target, truth).hits.ray) > 100

    def fail(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(target.scene(stand_in), "run", fail)
    with pytest.raises(KeyboardInterrupt):
        see(target, truth)
    monkeypatch.undo()
    assert len(see(target, truth).hits.ray) > 100


@pytest.mark.slow
def test_kernels_run_as_python():
    """For a debugger: the very same hits, the call of embree included."""
    program = """
from tests.optics.bench_for_tests import *
target, truth = surface("sat", box(3, 4, 5)), truth_of(sat=place((0, 0, 900)))
rays = optics.pixel_rays(PAPER_RECEIVER.replace(rays_per_pixel=1), PAPER_LASER, scene.extent([target], truth))
print(len(rays.pixel), scene.cast(rays, [target], truth, 1, laser_from_m=(0.1, 0, 0)).range_m.sum().hex())
"""
    said = [
        subprocess.run([sys.executable, "-c", program], env=os.environ | environment, capture_output=True, text=True)
        for environment in ({}, {"NUMBA_DISABLE_JIT": "1"})
    ]
    assert said[0].returncode == 0, said[0].stderr
    assert said[0].stdout == said[1].stdout, said[1].stderr
    assert int(said[0].stdout.split()[0]) > 100

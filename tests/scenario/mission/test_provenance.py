"""Where frames come from: versions of what computed them."""

import importlib.metadata
import platform

import rso_lidar as rl


def test_frames_name_the_versions_of_all_that_computes():
    (frame,) = rl.simulate(rl.Scenario.load("examples/bench_plate.toml"), frames=[0])
    libraries = ("numpy", "scipy", "skyfield", "sgp4", "trimesh", "embreex", "h5py")
    expected = {name: importlib.metadata.version(name) for name in libraries}
    own = {"rso_lidar": importlib.metadata.version("rso-lidar"), "python": platform.python_version()}
    versions = dict(frame.source.versions)
    assert versions.pop("arithmetic").startswith(f"numba {importlib.metadata.version('numba')} ")
    assert versions == expected | own

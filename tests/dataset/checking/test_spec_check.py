"""The check of a specification prints sizes, and finds a class that its range reveals."""

from rso_lidar.dataset import check_spec
from tests.dataset.bench_for_tests import make_spec


def test_sizes_and_counts(tmp_path):
    found = check_spec(make_spec(tmp_path))
    text = found.describe()
    assert "15 samples, 30 frames" in text and found.frame_s > 0.0 and found.frame_bytes > 500.0
    assert "plate" in text and "no target" in text


def test_a_leak_is_found_before_a_frame_is_made(tmp_path):
    near = {"name": "near", "models": ["plate"], "samples": 60}
    far = {"name": "far", "models": ["sphere"], "samples": 60}
    law = {"type": "uniform", "low": 5, "high": 9}
    variable = [{"field": "lidar.laser.energy_mj", "law": law, "classes": ["far"]}]
    base = {"field": "lidar.laser.energy_mj", "law": {"type": "uniform", "low": 7, "high": 20}, "classes": ["near"]}
    spec = make_spec(tmp_path, classes=[near, far], variable=[base, *variable], draws=1)
    assert any("lidar.laser.energy_mj tells the class" in line for line in check_spec(spec).warnings)

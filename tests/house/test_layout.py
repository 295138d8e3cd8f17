"""Tests lie where the module lies that they test: tests/<room>/test_<module>.py, and test_<module>_<aspect>.py beside it."""

import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGE, TESTS = ROOT / "rso_lidar", ROOT / "tests"
ELSEWHERE = {"models": ROOT / "models" / "build"}  # folders of tests, by name, whose modules lie beside the package
ACROSS = {
    "browser",
    "golden",
    "house",
    "peers",
    "physics",
    "property",
    "site",
}  # folders of tests that hold across rooms

# Tests of several modules of a room, or of all that a user brings or reads.
SPANNING = {
    "cli/test_cli.py",
    "cli/test_engines.py",
    "cli/test_help.py",
    "cli/test_outputs.py",
    "cli/test_trust_code.py",
    "detector/chain/test_addressed_noise.py",
    "detector/chain/test_frame_noise.py",
    "detector/chain/test_several_rows.py",
    "evaluation/camera_calibration/test_map_calibration.py",
    "detector/chain/test_values.py",
    "export/formats/test_sensor_exports.py",
    "fmi/test_commanded_fmus.py",
    "fmi/test_fmus.py",
    "fmi/test_fmus_of_other_tools.py",
    "fmi/test_trust.py",
    "loop/environments/test_environments.py",
    "loop/fmus/test_fmus_in_the_loop.py",
    "models/test_models.py",
    "models/test_rounding.py",
    "models/test_silhouettes.py",
    "models/test_targets.py",
    "optics/rays/test_pixel_rays.py",
    "picture/plots/test_over_time.py",
    "scenario/mission/test_motions_in_scenarios.py",
    "scenario/mission/test_trusted_code.py",
    "scenario/test_python_detector.py",
    "scene/materials/test_brdf.py",
    "scene/materials/test_own_material.py",
    "scene/materials/test_two_directions.py",
    "mission_analysis/passes/test_screening_sets.py",
    "study/trades/test_worked_studies.py",
    "test_bridge_basilisk.py",
    "test_bridge_bsk_rl.py",
    "test_bridge_cfs.py",
    "test_bridge_ros2.py",
    "test_examples.py",
    "test_learning_examples.py",
    "test_names.py",
    "test_seams.py",
    "test_tolerances.py",
    "track/pose/test_hinges.py",
}


# What stands at the top of the repository. A further entry needs a reason: a tool or a reader looks for it there.
TOP = {
    ".ci", ".github", "LICENSES", "benchmarks", "conda", "docs", "examples", "gravity", "models", "paper", "rso_lidar",
    "stars", "tests", "tle", ".dockerignore", ".gitignore", ".zenodo.json", "ARCHITECTURE.md", "CHANGELOG.md",
    "CITATION.cff", "CODE_OF_CONDUCT.md", "CONTRIBUTING.md", "Dockerfile", "LICENSE", "Makefile", "README.md", "REUSE.toml",
    "SECURITY.md", "constraints.txt", "hatch_build.py", "noxfile.py", "pyproject.toml",
}  # fmt: skip


def test_top_of_the_repository_holds_what_is_listed():
    if not (ROOT / ".git").exists():
        pytest.skip("not a checkout: git knows what is tracked")
    known = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert {name.split("/")[0] for name in known.split("\0") if name} == TOP


def is_about_a_module(test):
    """Return whether a test's file is named after a module in the folder that its own folder tests."""
    name = test.stem.removeprefix("test_")
    words = name.split("_")
    stems = {"_".join(words[:count]) for count in range(1, len(words) + 1)}
    folder = ELSEWHERE.get(str(test.parent), PACKAGE / test.parent)
    return any((folder / f"{stem}.py").is_file() for stem in stems)


def test_tests_lie_where_their_module_lies():
    tests = [file.relative_to(TESTS) for file in TESTS.rglob("test_*.py")]
    tests = [test for test in tests if not ACROSS.intersection(test.parts)]
    assert len(tests) > 150
    astray = {test.as_posix() for test in tests if not is_about_a_module(test)}
    assert astray == SPANNING, "move it to its module's folder and name, or list it as one of several modules"


def test_a_name_tells_the_module():
    assert is_about_a_module(Path("scene/test_labels.py")) and is_about_a_module(Path("scene/test_labels_oracle.py"))
    assert not is_about_a_module(Path("scene/test_casting.py")) and not is_about_a_module(Path("optics/test_labels.py"))

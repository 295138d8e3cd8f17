"""The Octave example reads a frame of a recording: the same numbers, in the same order of rows and columns."""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import rso_lidar as rl

EXAMPLE = Path(__file__).resolve().parents[3] / "examples" / "octave" / "read_recording.m"
SCRIPT = """
frame = read_recording('{file}', 7);
printf('%d ', size(frame.range_m), size(frame.points_m)); printf('\\n');
printf('%.9g ', frame.range_m'); printf('\\n');
printf('%d ', frame.counts'); printf('\\n');
printf('%.9g ', frame.points_m({row}, {col}, :), frame.position_m.plate, frame.quaternion.plate, frame.time_s);
"""


@pytest.fixture(scope="module")
def octave():
    path = shutil.which("octave-cli")
    if path is None:
        pytest.skip("needs GNU Octave, which pip does not install")
    return path


@pytest.fixture(scope="module")
def recording(tmp_path_factory, text):
    """A field of 32 x 20 pixels, so that rows are no columns, whose plate is off its middle."""
    scenario = rl.Scenario.loads(text.replace("n_cols   = 32", "n_cols = 20"))
    return rl.save(tmp_path_factory.mktemp("octave") / "bench.h5", rl.simulate(scenario, frames=range(5, 8)))


def test_a_frame_has_the_numbers_that_were_recorded(octave, recording, tmp_path):
    frame = rl.open(recording)[2]
    shutil.copy(EXAMPLE, tmp_path)
    row, col = np.argwhere(frame.valid)[0].tolist()
    (tmp_path / "script.m").write_text(SCRIPT.format(file=recording, row=row + 1, col=col + 1))
    run = subprocess.run([octave, "--no-gui", "script.m"], cwd=tmp_path, capture_output=True, text=True, check=False)
    sizes, ranges_m, counts, rest = [[float(word) for word in line.split()] for line in run.stdout.splitlines()]
    assert sizes == [32, 20, 32, 20, 3]
    np.testing.assert_allclose(np.reshape(ranges_m, (32, 20)), frame.range_m, rtol=1e-8, equal_nan=True)
    np.testing.assert_array_equal(np.reshape(counts, (32, 20)), frame.intensity_counts)
    pose = frame.truth.pose("lidar", "plate")
    expected = [*frame.points_m[row, col], *pose.translation, *pose.rotation.as_quat(canonical=True), frame.time_s]
    np.testing.assert_allclose(rest, expected, rtol=1e-6, atol=1e-9)


def test_a_frame_that_is_not_there_is_named(octave, recording, tmp_path):
    shutil.copy(EXAMPLE, tmp_path)
    (tmp_path / "script.m").write_text(f"read_recording('{recording}', 3);\n")
    run = subprocess.run([octave, "--no-gui", "script.m"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert "holds no frame 3, but 3 of them from 5 on" in run.stderr

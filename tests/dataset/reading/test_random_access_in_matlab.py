"""The MATLAB example reads a shard; run in GNU Octave, which lacks h5read and h5info, with substitutes of both."""

import shutil
import subprocess
from pathlib import Path

import pytest

from rso_lidar.dataset import open as open_dataset
from tests.dataset.written_for_tests import make_dataset

EXAMPLES = Path(__file__).resolve().parents[3] / "examples" / "matlab"
NAMES = {"range_m": 3, "class_id": 1, "box_px": 2}  # with the number of dimensions of each
SUBSTITUTES = {
    "h5read": "function x = h5read(file, place)\ns = load('-hdf5', file);\nx = s.(place(2:end));\nend\n",
    "h5info": "function info = h5info(file, place)\nranks = struct({ranks});\n"
    "info = struct('Dataspace', struct('Size', ones(1, ranks.(place(2:end)))));\nend\n",
}
SCRIPT = """
frames = read_shard('{file}', {{{names}}});
printf('%d ', size(frames.range_m), size(frames.class_id), size(frames.box_px)); printf('\\n');
printf('%d ', frames.class_id); printf('\\n');
printf('%d ', frames.box_px(2, :)); printf('\\n');
printf('%.6f ', frames.range_m(2, 2, 2), frames.range_m(2, 3, 2), frames.range_m(6, 8, 1)); printf('\\n');
"""


def test_a_shard_is_read_frame_last(tmp_path):
    octave = shutil.which("octave-cli")
    if octave is None:
        pytest.skip("needs GNU Octave, which pip does not install")
    folder = make_dataset(tmp_path / "two_craft")
    shutil.copy(EXAMPLES / "read_shard.m", tmp_path)
    ranks = ", ".join(f"'{name}', {rank}" for name, rank in NAMES.items())
    for name, text in SUBSTITUTES.items():
        (tmp_path / f"{name}.m").write_text(text.replace("{ranks}", ranks))
    names = ", ".join(f"'{name}'" for name in NAMES)
    (tmp_path / "script.m").write_text(SCRIPT.format(file=folder / "train" / "000000.h5", names=names))
    run = subprocess.run([octave, "--no-gui", "script.m"], cwd=tmp_path, capture_output=True, text=True, check=False)
    sizes, classes, box, ranges_m = [line.split() for line in run.stdout.splitlines()]
    split = open_dataset(folder).split("train")
    assert sizes == ["6", "8", "4", "4", "1", "4", "4"]
    assert [int(one) for one in classes] == split.column("class_id")[:4].tolist()
    assert [int(one) for one in box] == split[1]["box_px"].tolist()
    expected = [split[1]["range_m"][1, 1], split[1]["range_m"][1, 2], split[0]["range_m"][5, 7]]
    assert [float(one) for one in ranges_m] == pytest.approx(expected, abs=1e-4)

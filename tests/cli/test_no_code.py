"""``--no-code``: a file from somebody else that names Python code is refused in one line, and the code does not run."""

import pytest

from rso_lidar.shipped import shipped

CODE = "from pathlib import Path\nPath('ran').touch()\n\ndef move(t, x, u):\n    return [0.0] * 6\n"
TRADE = """
version = 1
name = "few"
scenario = "a.toml"
sampling = { type = "latin_hypercube", points = 2 }
frames = "0:1"
merits = ["detection_fraction"]
[[axis]]
field = "lidar.laser.energy_mj"
low = 20
high = 50
"""
DATASET = """
version = 1
name = "few"
scenario = "a.toml"
seed = 1

[[classes]]
name = "one"
samples = 2
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    text = shipped("examples/tle_flyby.toml").read_text(encoding="utf-8")
    head, _, rest = text.partition("[follower]")
    _, _, rest = rest.partition("\n[")
    follower = (
        '[follower]\nmotion = { type = "state_space", dynamics = "code.py:move", initial_state = '
        "[7e6, 0, 0, 0, 7500, 0] }\n\n["
    )
    (tmp_path / "a.toml").write_text(head + follower + rest, encoding="utf-8")
    (tmp_path / "code.py").write_text(CODE, encoding="utf-8")
    (tmp_path / "trade.toml").write_text(TRADE, encoding="utf-8")
    (tmp_path / "dataset.toml").write_text(DATASET, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    "words",
    [
        ["run", "a.toml", "-o", "a.h5"],
        ["timeline", "a.toml", "-o", "a.csv"],
        ["trade", "trade.toml", "-o", "a.html"],
        ["dataset", "make", "dataset.toml", "-o", "made", "--workers", "1"],
    ],
    ids=lambda words: words[0],
)
def test_code_is_refused_and_does_not_run(folder, rso_lidar, words):
    before = sorted(path.name for path in folder.iterdir())
    status, _, errors = rso_lidar(*words, "--no-code")
    assert status == 2
    assert len(errors) == 1
    assert "names the Python code 'code.py:move'" in errors[0]
    assert sorted(path.name for path in folder.iterdir()) == before  # no output, and no file that the code writes

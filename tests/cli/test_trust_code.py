"""Commands run the Python code that a scenario names with ``--trust-code`` only; without it, they refuse in one line."""

import pytest

from rso_lidar.loop import Server

CODE = """
from pathlib import Path
Path(__file__).with_name("ran").touch()

def move(t, x, u):
    return [*x[3:], 0.0, 0.0, 0.0]
"""
BENCH = "{ type = 'state_space', axes = 'local', dynamics = 'code.py:move', initial_state = [0, 0, 0, 0, 0, 0] }"
ORBIT = "{ type = 'state_space', dynamics = 'code.py:move', initial_state = [7e6, 0, 0, 0, 7500, 0] }"
CHIEF = (
    """{ type = "state", epoch_utc = 2024-09-17T12:00:00Z, position_m = [7001e3, 0, 0], velocity_m_s = [0, 7500, 0] }"""
)
FOLLOWER, TARGET = (f'{{ type = "fixed", position_m = [{x}, 0, 0] }}' for x in (0, 1000))
TRADE = """
version = 1
name = "few"
scenario = "a.toml"
sampling = { type = "latin_hypercube", points = 2 }
frames = "0:1"
merits = ["off_boresight_deg"]
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
REQUIREMENTS = """
version = 1
name = "near"

[[requirement]]
id = "A"
text = "The target shall be near the boresight."
quantity = "off_boresight_deg"
at_most = 180
"""
WINDOW = ["--within", "5km", "--start", "2024-09-17T12:00:00Z", "--days", "0.001"]
COMMANDS = [
    ["check", "a.toml"],
    ["budget", "a.toml"],
    ["budget", "a.toml", "--find", "plate", "--attitudes", "4"],
    ["truth", "a.toml", "-o", "made.csv"],
    ["timeline", "a.toml", "-o", "made.csv"],
    ["run", "a.toml", "-o", "made.h5", "--frames", "0:1"],
    ["serve", "a.toml", "--bind", "tcp://127.0.0.1:0"],
    ["disperse", "orbit.toml", "-o", "made.csv", "--runs", "2"],
    ["encounters", "orbit.toml", "--all-pairs", *WINDOW],
    ["encounters", "orbit.toml", "--follower", "orbit.toml", *WINDOW],
    ["requirements", "requirements.toml", "a.toml"],
    ["requirements", "requirements.toml", "trade.toml"],
    ["trade", "trade.toml", "-o", "made.csv"],
    ["dataset", "check", "dataset.toml"],
    ["dataset", "make", "dataset.toml", "-o", "made", "--workers", "1"],
]
WITHOUT_FLIGHT = [  # these two fly nothing, but what they call of parts may run their code
    ["parameters", "a.toml", "-o", "made.csv"],
    ["fmu", "a.toml", "-o", "made.fmu"],
]


@pytest.fixture
def folder(text, tmp_path, monkeypatch):
    bench = replace_all(text, {"n_rows   = 32": "n_rows = 8", "n_cols   = 32": "n_cols = 8"} | {FOLLOWER: BENCH})
    orbit = replace_all(text, {'axes = "local"': 'axes = "inertial"', TARGET: CHIEF, FOLLOWER: ORBIT})
    files = {"a.toml": bench, "orbit.toml": f"{orbit}\n[dispersion]\nenergy_sigma_fraction = 0.05\n", "code.py": CODE}
    files |= {"trade.toml": TRADE, "dataset.toml": DATASET, "requirements.toml": REQUIREMENTS}
    for name, content in files.items():
        (tmp_path / name).write_text(content)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def replace_all(text, changes):
    for old, new in changes.items():
        assert text.count(old) == 1
        text = text.replace(old, new)
    return text


@pytest.mark.parametrize("words", [*COMMANDS, *WITHOUT_FLIGHT], ids="-".join)
def test_code_is_refused_in_one_line_and_does_not_run(folder, rso_lidar, words):
    before = sorted(path.name for path in folder.iterdir())
    status, _, errors = rso_lidar(*words)
    assert status == 2
    (line,) = (one for one in errors if one.startswith("error: "))
    assert ".toml: follower.motion: dynamics: names the Python code 'code.py:move'" in line and "--trust-code" in line
    assert sorted(path.name for path in folder.iterdir()) == before  # no output, and no file that the code writes


LONG = ("trade", "dataset make", "budget a.toml --find")


@pytest.mark.parametrize(
    "words",
    [pytest.param(words, marks=pytest.mark.slow if " ".join(words).startswith(LONG) else ()) for words in COMMANDS],
    ids="-".join,
)
def test_trusted_code_runs(folder, rso_lidar, words, monkeypatch):
    monkeypatch.setattr(Server, "run", lambda self, ended: None)
    status, _, errors = rso_lidar(*words, "--trust-code")
    assert status == 0, errors
    assert (folder / "ran").exists()


@pytest.mark.parametrize("words", WITHOUT_FLIGHT, ids="-".join)
def test_trusted_code_is_written_into_what_flies_nothing(folder, rso_lidar, words):
    status, _, errors = rso_lidar(*words, "--trust-code")
    assert status == 0, errors
    assert b"code.py" in (folder / words[-1]).read_bytes()


def test_a_recording_needs_no_trust(folder, rso_lidar):
    status, _, errors = rso_lidar("requirements", "requirements.toml", "made.h5", "--trust-code")
    assert status == 2
    assert errors == ["error: --trust-code: is for a scenario or a study; a recording runs no code; leave it out"]

"""`rso-lidar requirements` and `rso-lidar parameters`: exit status, output, and what they refuse."""

import json
from functools import partial

import pytest

from tests.study.verification.requirements_for_tests import FILE

MET = FILE.replace("at_most  = 1e-6", "at_most  = 1")


@pytest.fixture
def call(rso_lidar, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "reqs.toml").write_text(FILE, encoding="utf-8")
    (tmp_path / "met.toml").write_text(MET, encoding="utf-8")
    return partial(rso_lidar, "requirements")


def test_the_status_says_whether_all_are_met(call, bench, recorded, tmp_path):
    settings = ("--set", "lidar.detector.type=empirical", "--set", "time.duration_s=1")
    status, said, _ = call("met.toml", bench, *settings)
    assert status == 0 and "2 requirements: 2 met" in said
    status, said, _ = call("reqs.toml", bench, *settings, "-o", "m.json", "-o", "m.csv")
    assert status == 1 and "2 requirements: 1 met, 1 not met" in said
    assert said.splitlines()[-2:] == ["m.json", "m.csv"]
    assert json.loads((tmp_path / "m.json").read_text(encoding="utf-8"))["counts"]["not met"] == 1
    status, said, _ = call("met.toml", recorded)
    assert status == 0 and "recording of" in said


def test_a_study_is_known_by_its_axes(call, bench, tmp_path):
    study = 'version = 1\nname = "e"\nscenario = "bench.toml"\nframes = "0:2"\nseeds = 2\nmerits = ["range_rms_m"]\n'
    study += 'set = ["lidar.detector.type=empirical"]\n[[axis]]\nfield = "lidar.laser.energy_mj"\nvalues = [20, 50]\n'
    (tmp_path / "study.toml").write_text(study, encoding="utf-8")
    status, said, _ = call("met.toml", "study.toml")
    assert "study 'e', 2 points, 2 runs each" in said and "of 2 points" in said
    assert status in (0, 1)  # two runs of two frames decide as they fall


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("none.toml", "bench.toml"), "none.toml"),
        (("reqs.toml", "none.toml"), "none.toml"),
        (("reqs.toml", "none.h5"), "none.h5"),
        (("bench.toml", "reqs.toml"), "bench.toml: "),
        (("reqs.toml", "reqs.toml"), "reqs.toml: "),
        (("reqs.toml", "bench.toml", "-o", "m.xlsx"), "unknown suffix '.xlsx'"),
        (("reqs.toml", "bench.toml", "--set", "lidar.lase.x=1"), "laser"),
        (
            ("wrong.toml", "bench.toml"),
            "requirement[1] (A-2): 'lidar.receiver.ifov': the scenario has no such parameter",
        ),
    ],
)
def test_bad_input_is_one_line(call, bench, arguments, said, tmp_path):
    (tmp_path / "wrong.toml").write_text(FILE.replace("ifov_rad", "ifov"), encoding="utf-8")
    before = sorted(tmp_path.iterdir())
    status, printed, errors = call(*arguments)
    assert (status, printed, len(errors)) == (2, "", 1)
    assert said in errors[0]
    assert sorted(tmp_path.iterdir()) == before


def test_settings_change_no_recording(call, recorded):
    status, _, errors = call("reqs.toml", recorded, "--set", "seed=3")
    assert status == 2 and "a recording cannot be changed" in errors[0]


def test_parameters_are_listed(call, rso_lidar, bench, tmp_path):
    status, said, _ = rso_lidar("parameters", bench)
    assert status == 0 and "lidar.laser.energy_mj" in said and "50.0 mJ" in said
    status, said, _ = rso_lidar("parameters", bench, "-o", "p.sysml", "--requirements", "reqs.toml", "--set", "seed=9")
    assert status == 0 and said.endswith("p.sysml\n")
    text = (tmp_path / "p.sysml").read_text(encoding="utf-8")
    assert "requirement <'A-1'>" in text and "attribute seed : Integer = 9" in text
    assert "lidar_mission.lidar.receiver.ifov_rad <= at_most" in text
    for arguments, said in (
        (("-o", "p.sysml"), "exists"),
        (("-o", "p.xml"), "unknown suffix"),
        (("--requirements", "reqs.toml"), "goes with -o FILE.sysml"),
        (("-o", "q.sysml", "--requirements", "none.toml"), "none.toml"),
    ):
        status, printed, errors = rso_lidar("parameters", bench, *arguments)
        assert (status, printed, len(errors)) == (2, "", 1) and said in errors[0]
    assert not (tmp_path / "q.sysml").exists()

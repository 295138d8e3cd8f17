"""`rso-lidar timeline`: what it writes and says, and what it refuses."""

import csv
from functools import partial

import pytest


@pytest.fixture
def call(rso_lidar):
    return partial(rso_lidar, "timeline")


def test_a_picture_and_a_table(call, bench, tmp_path, monkeypatch):
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    monkeypatch.chdir(elsewhere)  # a scenario may lie among examples; the picture goes where one works
    status, said, errors = call(bench)
    assert (status, errors) == (0, [])
    assert said.startswith("plate: 10 frames, 1,000.0 -> 1,000.0 m")
    assert [file.name for file in elsewhere.iterdir()] == ["bench_timeline.png"]
    assert (elsewhere / "bench_timeline.png").read_bytes().startswith(b"\x89PNG")
    table = tmp_path / "t.csv"
    assert call(bench, "-o", table, "--every", "0.4")[0] == 0
    with table.open(encoding="utf-8", newline="") as file:
        assert [float(row["time_s"]) for row in csv.DictReader(file)] == [0.0, 0.4, 0.8, 1.2, 1.6, 1.8]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["-o", "x.jpg"], "unknown suffix '.jpg'"),
        (["-o", "x"], "no suffix"),
        (["-o", "no/such/x.png"], "there is no folder"),
        (["--every", "0"], "seconds above 0"),
        (["--every", "nan"], "seconds above 0"),
        (["--target", "plats"], "did you mean 'plate'"),
        (["--set", "target=[]", "--set", "ptu.point={type='fixed'}"], "has no target"),
    ],
)
def test_refused_in_one_line(refused, arguments, said):
    refused(arguments, said)


def test_an_output_that_exists_is_kept(call, bench, tmp_path):
    output = tmp_path / "kept.csv"
    output.write_text("mine", encoding="utf-8")
    assert call(bench, "-o", output)[0] == 2
    assert output.read_text(encoding="utf-8") == "mine"
    assert call(bench, "-o", output, "--overwrite")[0] == 0

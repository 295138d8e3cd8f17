"""`rso-lidar trade`: what it writes, how it goes on after a kill, and what it refuses."""

import csv
import os
import signal
import subprocess
import sys
import time
from functools import partial

import pytest

from rso_lidar.study.trades.execution import RowFile
from tests.study.trades.trade_for_tests import STUDY, folder_with

NO_PICTURES = "\n[report]\npictures = 0\n"


@pytest.fixture
def call(rso_lidar, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return partial(rso_lidar, "trade")


def rows_of(path):
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_a_table_and_a_report(call, text, tmp_path):
    study = folder_with(tmp_path, text, STUDY.replace("[5, 20]", "[5, -5]") + NO_PICTURES)
    status, said, _ = call(study)
    assert status == 0
    assert said.splitlines()[0] == "Energy and beam: 6 runs, 3 could not be flown"
    assert said.splitlines()[-2:] == ["study.csv", "study.html"]
    table = rows_of(tmp_path / "study.csv")
    assert [row["lidar.laser.divergence_deg"] for row in table] == ["1.0", "2.0", "4.0"] * 2
    assert [float(row["time_in_field_s"]) for row in table[:3]] == [2.0] * 3
    assert all(row["error"] for row in table[3:]) and not any(row["error"] for row in table[:3])
    assert (tmp_path / "study.html").read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    assert sorted(file.name for file in tmp_path.iterdir()) == ["bench.toml", "study.csv", "study.html", "study.toml"]


def test_the_least_detection_is_given_on_the_command_line(call, text, tmp_path):
    study = folder_with(
        tmp_path, text, STUDY.replace("[5, 20]", "[0.001]").replace("count  = 3", "count = 1") + NO_PICTURES
    )
    status, said, _ = call(study, "--min-detection-fraction", 0.25)
    assert status == 0
    assert "no point is ranked in range_error_m: all 1 have a detection_fraction below 0.25" in said
    (row,) = rows_of(tmp_path / "study.csv")
    assert (row["detected"], row["min_detection_fraction"]) == ("0", "0.25")
    for share in (1.5, -0.1, "nan"):
        status, _, told = call(study, "--min-detection-fraction", share, "--overwrite")
        assert status == 2 and len(told) == 1 and "is not a fraction of pixels" in told[0]


def test_where_it_goes(call, text, tmp_path):
    study = folder_with(
        tmp_path, text, STUDY.replace("[5, 20]", "[5]").replace("count  = 3", "count = 1") + NO_PICTURES
    )
    (tmp_path / "made").mkdir()
    assert call(study, "-o", tmp_path / "made")[0] == 0
    assert call(study, "-o", tmp_path / "made" / "other.html")[0] == 0
    made = ["other.csv", "other.html", "study.csv", "study.html"]
    assert sorted(file.name for file in (tmp_path / "made").iterdir()) == made
    assert (tmp_path / "made" / "other.csv").read_bytes() == (tmp_path / "made" / "study.csv").read_bytes()


def test_left_out_it_is_the_working_folder_and_not_the_study_s(call, text, tmp_path, monkeypatch):
    """A study may lie among examples, or where nothing may be written."""
    study = folder_with(
        tmp_path, text, STUDY.replace("[5, 20]", "[5]").replace("count  = 3", "count = 1") + NO_PICTURES
    )
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    assert call(study)[0] == 0
    assert sorted(file.name for file in (tmp_path / "here").iterdir()) == ["study.csv", "study.html"]
    assert sorted(file.name for file in tmp_path.iterdir()) == ["bench.toml", "here", "study.toml"]


def test_a_slash_at_the_end_makes_the_folder(call, text, tmp_path, monkeypatch):
    study = folder_with(tmp_path, text, STUDY.replace("[5, 20]", "[5]").replace("count  = 3", "count = 1"))
    monkeypatch.chdir(tmp_path)
    assert call(study, "-o", "made/")[0] == 0
    assert sorted(file.name for file in (tmp_path / "made").iterdir()) == ["study.csv", "study.html"]
    study.write_text(STUDY.replace("energy_mj", "energy_m"), encoding="utf-8")
    assert call(study, "-o", "none/")[0] == 2
    assert not (tmp_path / "none").exists()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["-o", "x.jpg"], "unknown suffix '.jpg'"),
        (["-o", "x"], "no suffix"),
        (["-o", "no/such/"], "no/such: there is no folder no; create it first"),
        (["-o", "mine.csv/"], "mine.csv: exists already"),
        (["-o", "no/such/x.csv"], "there is no folder"),
        (["-o", "~no_such_user/"], "~no_such_user"),
        (["-o", "~no_such_user/x.csv"], "~no_such_user/x.csv: cannot be written here"),
        (["-o", "mine.csv"], "exists already; give --overwrite"),
        (["-o", "mine.html"], "exists already; give --overwrite"),
        (["--workers", "0"], "--workers"),
    ],
)
def test_refused_in_one_line(call, text, tmp_path, monkeypatch, arguments, said):
    study = folder_with(tmp_path, text)
    (tmp_path / "mine.csv").write_text("mine", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    before = {file.name: file.read_bytes() for file in tmp_path.iterdir()}
    status, printed, errors = call(study, *arguments)
    assert (status, printed, len(errors)) == (2, "", 1)
    assert said in errors[0]
    assert {file.name: file.read_bytes() for file in tmp_path.iterdir()} == before


def test_a_study_that_is_not_there_and_one_that_is_no_toml(call, tmp_path):
    assert "no such file" in call(tmp_path / "none.toml")[2][0]
    (tmp_path / "bad.toml").write_text("name = ", encoding="utf-8")
    assert "not valid TOML" in call(tmp_path / "bad.toml")[2][0]


def test_parquet_names_its_extra_before_anything_runs(call, text, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    monkeypatch.setitem(sys.modules, "pyarrow.parquet", None)
    status, _, errors = call(folder_with(tmp_path, text), "-o", tmp_path / "x.parquet")
    assert (status, len(errors)) == (2, 1)
    assert "pip install rso-lidar[parquet]" in errors[0]


def test_another_study_is_told_of_what_stands_there(call, text, tmp_path):
    study = folder_with(
        tmp_path, text, STUDY.replace("[5, 20]", "[5]").replace("count  = 3", "count = 1") + NO_PICTURES
    )
    (tmp_path / "study.csv.tmp-0badcafe").write_text("", encoding="utf-8")
    status, _, errors = call(study)
    assert status == 0
    assert any("starting again: study.csv.tmp-0badcafe is of another study" in line for line in errors)
    assert (tmp_path / "study.csv.tmp-0badcafe").exists()


# ---------------------------------------------------------------------------------------------------------- cut off


def started(study, output):
    """Start a trade in a process of its own and wait until it has kept two rows more than there were."""
    command = [sys.executable, "-m", "rso_lidar", "trade", str(study), "-o", str(output), "--overwrite"]
    before = len(kept_rows(output))
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    while len(kept_rows(output)) < before + 2:
        assert process.poll() is None, process.communicate()
        time.sleep(0.005)
    return process


def kept_rows(output):
    files = [file for file in output.parent.glob(f"{output.name}.tmp-*") if not file.name.endswith(".lock")]
    return files[0].read_bytes().splitlines() if files else []


def interrupted(monkeypatch, after):
    """Press Ctrl-C in this process once so many rows more are kept."""
    add, kept = RowFile.add, []

    def added(rows, row):
        add(rows, row)
        kept.append(row)
        if len(kept) == after:
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(RowFile, "add", added)


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="signals are POSIX's")
def test_interrupted_and_killed_it_goes_on_and_ends_byte_for_byte_the_same(call, text, tmp_path, monkeypatch):
    asked = STUDY.replace('merits   = ["detection_fraction", "range_error_m", ', 'merits   = ["detection_fraction", ')
    study = folder_with(tmp_path, text, asked.replace("count  = 3", "count  = 8") + "\n[report]\npictures = 1\n")
    output = tmp_path / "cut.csv"
    process = started(study, output)
    process.kill()
    process.communicate()
    there = len(kept_rows(output))
    assert 2 <= there < 13  # or it was not cut off
    with monkeypatch.context() as patch:
        interrupted(patch, after=2)
        status, _, errors = call(study, "-o", output)
    assert status == 130
    assert errors[-1].startswith(f"interrupted: {there + 2} of 16 runs are kept in {output}.tmp-")
    assert errors[-1].endswith("the same command goes on")
    assert not output.exists() and not output.with_suffix(".html").exists()
    status, said, _ = call(study, "-o", output)
    assert status == 0
    assert said.splitlines()[0] == f"continuing after {there + 2} of 16 runs"
    assert call(study, "-o", tmp_path / "whole.csv")[0] == 0
    for suffix in (".csv", ".html"):  # pictures and all
        assert output.with_suffix(suffix).read_bytes() == (tmp_path / f"whole{suffix}").read_bytes()
    assert not kept_rows(output)

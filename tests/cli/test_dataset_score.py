"""`rso-lidar dataset score`: its exit status, its outputs, and what it refuses."""

import csv
import json

import numpy as np
import pytest

import rso_lidar as rl
from tests.dataset.bench_for_tests import SPEC, make_spec


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a folder with a dataset in `set`, and predictions of its test split: right.csv, wrong.csv and part.csv."""
    place = tmp_path_factory.mktemp("scored")
    spec = make_spec(place, SPEC.replace("samples = 6", "samples = 12").replace("draws = 2", "draws = 1"))
    dataset = rl.dataset.make(spec, place / "set", workers=1)
    frames = dataset.split("test")
    sample, class_id = frames.column("sample"), np.maximum(frames.column("class_id"), 0)
    for name, shift, kept in (("right", 0, len(sample)), ("wrong", 1, len(sample)), ("part", 0, len(sample) - 1)):
        with (place / f"{name}.csv").open("w", newline="") as file:
            file.write(f"# dataset: {dataset.constants.sha256}\n")
            rows = csv.writer(file)
            rows.writerow(["sample", "class"])
            rows.writerows([*zip(sample, np.array(dataset.classes)[(class_id + shift) % 2], strict=True)][:kept])
    return place


@pytest.fixture
def score(rso_lidar, folder, monkeypatch):
    """Return a function that scores files of the folder."""
    monkeypatch.chdir(folder)
    return lambda *words: rso_lidar("dataset", "score", *words, "--dataset", "set", "--replicates", "200")


def test_a_table_and_reports(score, folder):
    status, printed, errors = score("part.csv", "-o", "out.json", "-o", "out.html")
    assert (status, errors) == (0, [])
    assert "part.csv: 1 of" in printed and "they count as failures" in printed
    assert printed.splitlines()[-2:] == ["out.json", "out.html"]
    merits = {one["name"]: one for one in json.loads((folder / "out.json").read_text())["merits"]}
    line = next(line for line in printed.splitlines() if line.startswith("accuracy "))
    assert float(line.split()[1]) == pytest.approx(merits["accuracy"]["value"], abs=1e-4)
    assert score("part.csv", "-o", "out.json")[0] == 2
    assert score("part.csv", "-o", "out.json", "--overwrite")[0] == 0


def test_the_status_tells_whether_anything_is_worse(score):
    status, printed, _ = score("wrong.csv", "--against", "right.csv")
    assert status == 1 and printed.splitlines()[-1].startswith("worse: accuracy")
    status, printed, _ = score("right.csv", "--against", "wrong.csv")
    assert status == 0 and printed.splitlines()[-1].startswith("better: accuracy")
    assert score("right.csv", "--against", "right.csv")[0] == 0
    assert (
        score("wrong.csv", "--against", "right.csv", "--margin", "accuracy=1", "--margin", "accuracy_100_pixels=1")[0]
        == 0
    )


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["none.csv"], "none.csv: no such file"),
        (["right.csv", "--split", "tset"], "did you mean 'test'"),
        (["right.csv", "--margin", "accuracy=0.1"], "--margin: compares with nothing"),
        (["right.csv", "--against", "wrong.csv", "--margin", "accuracy"], "--margin accuracy: is not NAME=VALUE"),
        (["right.csv", "--against", "wrong.csv", "--margin", "acuracy=1"], "did you mean 'accuracy'"),
        (["right.csv", "--level", "2"], "--level: is not a probability"),
        (["right.csv", "--confidence", "0.2"], "--confidence: is not a probability"),
        (["right.csv", "-o", "out.htm"], "did you mean '.html'"),
    ],
)
def test_bad_input_is_one_line(score, words, said):
    status, printed, errors = score(*words)
    assert (status, printed, len(errors)) == (2, "", 1)
    assert errors[0].startswith("error: ") and said in errors[0]

import json
import math
import re

import numpy as np
import pytest
import trimesh

from rso_lidar.dataset import check_score_report, compare, format_comparison, format_scores, save_score_report
from rso_lidar.dataset.scoring.pose_errors import ModelSurface
from rso_lidar.errors import RsoLidarError
from rso_lidar.track import sample_mesh
from tests.dataset.scoring.frames import make_card, make_truth


@pytest.fixture(scope="module")
def cards():
    """Return the scorecards of a good and a bad algorithm that predict classes, presence and poses."""
    truth = make_truth(120, empty=30)
    surface = ModelSurface(sample_mesh(trimesh.creation.box((6.0, 2.0, 2.0)).triangles, 2000))

    def predict(skill, seed):
        rng = np.random.default_rng(seed)
        right = np.arange(3) == truth.class_id[:, None]
        scores = {f"score.{name}": rng.normal(size=120) + skill * right[:, k] for k, name in enumerate(truth.classes)}
        position = np.nan_to_num(truth.position_m) + rng.normal(size=(120, 3)) / skill
        quaternion = np.where(truth.present[:, None] > 0, truth.quaternion_xyzw, [0.0, 0.0, 0.0, 1.0])
        names = ("x_m", "y_m", "z_m", "qx", "qy", "qz", "qw")
        pose = dict(zip(names, np.column_stack([position, quaternion]).T, strict=True))
        return scores | pose | {"present": rng.normal(size=120) + skill * truth.present}

    good, bad = (make_card(truth, predict(*one), surfaces=dict.fromkeys(range(3), surface)) for one in ((4, 0), (1, 1)))
    return good, bad


def test_json_holds_all_numbers(cards, tmp_path):
    good, bad = cards
    save_score_report(good, tmp_path / "r.json", compare(good, bad))
    read = json.loads((tmp_path / "r.json").read_text())
    merits = {one["name"]: one for one in read["merits"]}
    assert merits["accuracy"]["value"] == pytest.approx(good.merits[0].value.value)
    assert merits["accuracy"]["interval"] == "Wilson, design effect" and merits["add_recall"]["encounters"] == 90
    assert read["frames"] == 120 and read["split"] == "test" and read["dataset"] == "f00d"
    assert set(read["curves"]) == {"present", "dawn", "juno", "tdrs"}
    assert sum(map(sum, read["confusions"][0]["counts"][0])) == 90
    assert {(one["name"], one["quantity"]) for one in read["bins"]} >= {
        ("recall", "lit_pixels"),
        ("pose_recall", "range"),
    }
    changes = {one["name"]: one for one in read["comparison"]["changes"]}
    assert changes["accuracy"]["verdict"] == "better" and not read["comparison"]["is_worse"]
    assert math.isclose(changes["accuracy"]["difference"], changes["accuracy"]["new"] - changes["accuracy"]["old"])
    assert len(read["comparison"]["repaired"][0]) == 3


def test_the_page_needs_nothing_else(cards, tmp_path):
    good, bad = cards
    save_score_report(bad, tmp_path / "r.html", compare(bad, good))
    text = (tmp_path / "r.html").read_text(encoding="utf-8")
    assert not re.search(r"<script|<link|src=\"(?!data:)|href=", text)
    assert text.count("data:image/png") == 7 and "worse: " in text and "<code>adds_recall</code>" in text


def test_pictures_go_to_a_folder(cards, tmp_path):
    made = save_score_report(cards[0], tmp_path / "pictures")
    stems = ["precision_recall", "recall", "pose_range", "pose_lit_pixels", "confusion", "presence"]
    assert [path.stem for path in made] == stems and all(path.stat().st_size > 10_000 for path in made)
    with pytest.raises(RsoLidarError, match="holds pictures"):
        check_score_report(tmp_path / "pictures", overwrite=False)


def test_places_that_cannot_be_written_are_refused_before_the_work(tmp_path):
    (tmp_path / "file").write_text("")
    for place, words in (
        (tmp_path / "r.htm", "did you mean '.html'"),
        (tmp_path / "none" / "pictures", "there is no folder"),
        (tmp_path / "file", "is a file without a suffix"),
        (tmp_path / "none" / "r.json", "there is no folder"),
    ):
        with pytest.raises(RsoLidarError) as caught:
            check_score_report(place, overwrite=False)
        assert words in str(caught.value)


def test_the_table_says_what_was_left_out(cards):
    lines = format_scores(cards[0])
    assert lines[0] == "120 frames of 120 encounters, split 'test'"
    assert any(re.fullmatch(r"accuracy +[01][\d.]* +0\.\d+ to [01][\d.]* +90", line) for line in lines)
    truth = make_truth(40)
    truth.lit_pixels[:3] = 0
    card = make_card(truth, {"present": np.ones(40)})
    assert "3 frames of a target with no lit pixel are left out" in format_scores(card)


def test_the_last_line_of_a_comparison_is_its_result(cards):
    good, bad = cards
    assert format_comparison(compare(bad, good))[-1].startswith("worse: accuracy")
    assert format_comparison(compare(good, good))[-1].startswith("no significant difference (at 5%")

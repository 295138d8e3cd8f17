"""The card: a head that YAML reads, and the facts of the dataset in its text."""

import pytest

from rso_lidar.dataset import open as open_dataset
from rso_lidar.dataset.publication.attribution import Attribution
from rso_lidar.dataset.publication.card_tables import count_frames, format_table
from rso_lidar.dataset.publication.card_text import LIMITS
from rso_lidar.dataset.publication.dataset_card import choose_size, write_card


@pytest.fixture
def card(data):
    return write_card(data, count_frames(data), ["frame.png"], Attribution("CC-BY-4.0")).read_text(encoding="utf-8")


def test_the_head_is_yaml_that_hugging_face_knows(card):
    yaml = pytest.importorskip("yaml", reason="needs PyYAML: pip install pyyaml")
    head = yaml.safe_load(card.split("---\n")[1])
    assert head["pretty_name"] == 'Two craft, "near" & far'
    assert head["license"] == "cc-by-4.0" and head["size_categories"] == ["n<1K"]
    (config,) = head["configs"]
    assert config["data_files"] == [{"split": one, "path": f"{one}/*.h5"} for one in ("train", "test")]
    assert "object-detection" in head["task_categories"] and "lidar" in head["tags"]


def test_counts_stand_in_tables(card):
    assert "| relay | 3 | 2 | 100.0 to 900.0 |" in card
    assert "| no target | 1 | 1 |  |" in card and "| all | 6 | 4 |  |" in card
    assert "| 1 to 9 | 5 | 3 |" in card


def test_every_array_is_described(card, data):
    for name in data.split("train").names:
        assert f"| `{name}` | frame" in card
    assert card.index("| `range_m`") < card.index("| `class_id`") < card.index("| `variable.lidar.laser.energy_mj`")
    assert "| `range_m` | frame × 6 × 8 | float32 | m | measured slant range" in card


def test_laws_models_limits_and_the_way_to_make_it_again(card, data):
    assert "| `view.range_m` | log_uniform low = 100, high = 900 |" in card
    assert "| `lidar.laser.energy_mj` | uniform low = 20, high = 50 |" in card
    assert "| tdrs | Tracking and Data Relay Satellite" in card
    assert all(limit in card for limit in LIMITS)
    assert "rso-lidar dataset make dataset.toml -o again" in card and data.constants.sha256 in card
    assert "Made with rso-lidar 0.1.0, numpy 2.4.6. The hash" in card
    assert "![a frame of" in card and "(frame.png)" in card
    assert "| `lidar.laser.energy_mj` | drawn |" in card


def test_the_split_rule_is_explained(data):
    spec = data.spec.replace(classes=data.spec.classes[:2], split={"type": "model", "test": ["cubesat_6u"]})
    (data.folder / "dataset.toml").write_text(spec.dumps(), encoding="utf-8")
    data = open_dataset(data.folder)
    card = write_card(data, count_frames(data), [], Attribution()).read_text(encoding="utf-8")
    assert "assigned by model (test: cubesat_6u), so the test measures a model that training never saw" in card
    assert "license: unknown" in card


@pytest.mark.parametrize(
    ("frames", "size"), [(1, "n<1K"), (1000, "1K<n<10K"), (999_999, "100K<n<1M"), (10**8, "100M<n<1B"), (10**9, "n>1B")]
)
def test_size_categories(frames, size):
    assert choose_size(frames) == size


def test_a_bar_in_a_cell_does_not_end_it():
    assert format_table(["a"], [["x|y"]]).splitlines()[-1] == "| x\\|y |"

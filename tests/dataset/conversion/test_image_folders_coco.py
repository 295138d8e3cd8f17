"""COCO annotations: boxes, areas and run lengths of masks, and files that readers take."""

import io
import json
from contextlib import redirect_stdout

import numpy as np
import pytest

from rso_lidar.dataset.conversion.image_folders import measure_runs, open_coco, outline_mask

MASK = np.zeros((4, 6), bool)
MASK[1:3, 2:5] = True
MASK[1, 2] = False


def expand(counts, shape):
    """Return the mask of run lengths, column by column."""
    values = np.arange(len(counts)) % 2 == 1
    return np.repeat(values, counts).reshape(shape[::-1]).T


def test_a_box_is_left_top_width_height():
    outline = outline_mask(MASK)
    assert (outline["bbox"], outline["area"], outline["iscrowd"]) == ([2, 1, 3, 2], 5, 0)
    assert outline["segmentation"]["size"] == [4, 6]


@pytest.mark.parametrize("mask", [MASK, ~MASK, np.ones((3, 2), bool), np.eye(5, dtype=bool)])
def test_runs_make_the_mask_again(mask):
    counts = measure_runs(mask)
    assert sum(counts) == mask.size
    assert (expand(counts, mask.shape) == mask).all()


def test_a_file_has_all_images_and_only_targets_that_are_seen(tmp_path):
    place = tmp_path / "train.json"
    with open_coco(place, {"description": "a set"}, ["relay", "cube"]) as coco:
        coco.add({"file_name": "a.png"}, MASK, 2, {"lit_pixels": 5})
        coco.add({"file_name": "b.png"}, np.zeros_like(MASK), 0, {})
        coco.add({"file_name": "c.png"}, ~MASK, 1, {})
    found = json.loads(place.read_text(encoding="utf-8"))
    assert [one["id"] for one in found["images"]] == [1, 2, 3]
    assert [(one["id"], one["image_id"], one["category_id"]) for one in found["annotations"]] == [(1, 1, 2), (2, 3, 1)]
    assert [(one["id"], one["name"]) for one in found["categories"]] == [(1, "relay"), (2, "cube")]
    assert found["info"] == {"description": "a set"} and found["annotations"][0]["lit_pixels"] == 5
    assert list(tmp_path.iterdir()) == [place]


def test_an_empty_file_is_valid(tmp_path):
    with open_coco(tmp_path / "val.json", {}, []):
        pass
    assert json.loads((tmp_path / "val.json").read_text(encoding="utf-8"))["images"] == []


@pytest.mark.filterwarnings("ignore")  # of the library itself
def test_pycocotools_reads_the_masks(tmp_path):
    coco_module = pytest.importorskip("pycocotools.coco", reason="needs pycocotools: pip install pycocotools")
    place = tmp_path / "train.json"
    with open_coco(place, {}, ["relay"]) as coco:
        coco.add({"file_name": "a.png", "height": 4, "width": 6}, MASK, 1, {})
    with redirect_stdout(io.StringIO()):
        read = coco_module.COCO(str(place))
    assert (read.annToMask(read.anns[1]) == MASK).all()
    assert read.getAnnIds(imgIds=[1], catIds=[1]) == [1]

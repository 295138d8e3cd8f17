"""Image folders: the grey levels of PNG images, and annotations that fit them."""

import io
import json

import numpy as np
from PIL import Image

from rso_lidar.dataset.conversion.image_folders import write_image_folders

INFO = {"description": "two craft"}


def load(folder, kind, name, split="train"):
    return np.asarray(Image.open(io.BytesIO((folder / "images" / split / kind / f"{name}.png").read_bytes())))


def test_ranges_are_steps_of_one_scale(data, tmp_path):
    step_mm = write_image_folders(tmp_path, data, ["train", "test"], INFO)
    assert step_mm == 20.0  # 16 bits of 20 mm reach 1.3 km; the farthest target is at 1 km
    for place, (split, name) in enumerate([("train", "00000000-0000-00"), ("test", "00000004-0000-00")]):
        levels = load(tmp_path, "range", name, split)
        truth = data.split(split)[2 * place]["range_m"].copy()
        truth[5, 7] = np.nan  # a false return beyond the scale is left out
        assert levels.dtype == np.uint16
        np.testing.assert_array_equal(levels == 0, np.isnan(truth))
        seen = levels > 0
        np.testing.assert_allclose(levels[seen] * step_mm / 1e3, truth[seen], atol=step_mm / 2e3 + 1e-4)


def test_labels_are_one_more_than_in_the_shards(data, tmp_path):
    write_image_folders(tmp_path, data, ["train"], INFO)
    frame = data.split("train")[1]
    for kind in ("target", "part_class_id"):
        levels = load(tmp_path, kind, "00000000-0000-01")
        assert levels.dtype == np.uint8
        np.testing.assert_array_equal(levels.astype(int) - 1, frame[kind])
    np.testing.assert_array_equal(load(tmp_path, "intensity", "00000000-0000-01"), frame["intensity_counts"])


def test_annotations_fit_the_labels(data, tmp_path):
    write_image_folders(tmp_path, data, ["train"], INFO)
    found = json.loads((tmp_path / "annotations" / "train.json").read_text(encoding="utf-8"))
    split = data.split("train")
    assert found["info"] == {**INFO, "range_step_mm": 10.0}  # the farthest of this split is at 0.6 km
    assert len(found["images"]) == len(split)
    for image in found["images"]:
        assert (tmp_path / "images" / image["file_name"]).is_file()
        assert (image["height"], image["width"]) == (6, 8)
    by_image = {one["image_id"]: one for one in found["annotations"]}
    assert list(by_image) == [1, 2, 3, 5, 6]  # the fourth frame has no target
    for place in (0, 1, 2, 4, 5):
        frame, one = split[place], by_image[place + 1]
        first_row, first_col, last_row, last_col = frame["box_px"].tolist()
        assert one["bbox"] == [first_col, first_row, last_col - first_col + 1, last_row - first_row + 1]
        assert one["area"] == one["lit_pixels"] == int(frame["lit_pixels"])
        assert one["category_id"] == int(frame["class_id"]) + 1
        assert one["position_m"] == frame["position_m"].tolist()


def test_images_of_cameras_are_counts_in_16_bits(paired, tmp_path):
    data, _ = paired
    write_image_folders(tmp_path, data, ["train"], INFO)
    split = data.split("train")
    coco = json.loads((tmp_path / "annotations" / "train.camera.nav.json").read_text(encoding="utf-8"))
    boxes = {entry["image_id"]: entry for entry in coco["annotations"]}
    assert coco["info"]["cameras"]["sensor"]["name"] == "nav" and 0 < len(boxes) < len(coco["images"]) == len(split)
    for k, entry in enumerate(coco["images"]):
        frame = split[k]
        image = np.asarray(Image.open(tmp_path / "images" / entry["file_name"]))
        assert image.dtype == np.uint16 and np.array_equal(image, frame["camera.nav.intensity_counts"][..., 0])
        name = entry["file_name"].rpartition("/")[2].removesuffix(".png")
        assert np.array_equal(load(tmp_path, "camera.nav/target", name).astype(int) - 1, frame["camera.nav.target"])
        assert (entry["id"] in boxes) == bool(frame["camera.nav.target_pixels"])
        if entry["id"] in boxes:
            top, left, bottom, right = frame["camera.nav.box_px"].tolist()
            assert boxes[entry["id"]]["bbox"] == [left, top, right - left + 1, bottom - top + 1]
            assert boxes[entry["id"]]["area"] == frame["camera.nav.target_pixels"]
            assert boxes[entry["id"]]["position_m"] == frame["camera.nav.position_m"].tolist()
    eye = json.loads((tmp_path / "annotations" / "train.camera.eye.json").read_text(encoding="utf-8"))
    png = (tmp_path / "images" / eye["images"][0]["file_name"]).read_bytes()
    assert png[24:26] == bytes([16, 2])  # 16 bits, truecolour (ISO/IEC 15948, sec. 11.2.2)

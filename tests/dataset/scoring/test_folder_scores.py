import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.errors import RsoLidarError, RsoLidarWarning


def predict(dataset, split="test", **changes):
    """Return perfect predictions of a split."""
    frames = dataset.split(split)
    column = {name: frames.column(name) for name in ("sample", "step", "draw", "class_id", "present")}
    names = ("x_m", "y_m", "z_m", "qx", "qy", "qz", "qw")
    pose = np.column_stack([frames.column("position_m"), frames.column("quaternion_xyzw")])
    classes = np.array(dataset.classes)[np.maximum(column["class_id"], 0)]
    keys = {name: column[name] for name in ("sample", "step", "draw")}
    return (
        keys | dict(zip(names, pose.T, strict=True)) | {"class": classes, "present": column["present"] * 1.0} | changes
    )


def predict_classes(dataset, split):
    """Return the classes of perfect predictions alone."""
    return {
        name: values for name, values in predict(dataset, split).items() if name in ("sample", "step", "draw", "class")
    }


def test_perfect_predictions_of_a_folder(made):
    dataset, _ = made
    parts = dataset.split("test").column("part_class_id")
    card = rl.dataset.score(predict(dataset, part_class_id=parts), dataset, replicates=200)
    found = {merit.name: merit.value for merit in card.merits}
    for name in ("accuracy", "presence_average_precision", "add_recall", "adds_recall", "mean_iou", "pixel_accuracy"):
        assert found[name].value == 1.0
    assert found["translation_error_median"].value == 0.0
    assert found["rotation_error_median"].value == pytest.approx(0.0, abs=1e-6)
    # two noise draws of each sample are one encounter
    assert found["presence_average_precision"].frames == 2 * found["presence_average_precision"].encounters
    # the models stand in the axes of the poses: a shift of half the diameter is not within a tenth of it
    surface = card.benchmark.surfaces[dataset.models.index("sphere")]
    assert np.abs(surface.mesh.middle_m).max() < 0.02 * surface.diameter_m


def test_files_are_scored_like_columns(made, tmp_path):
    dataset, _ = made
    np.savez(tmp_path / "mine.npz", dataset=dataset.constants.sha256[:12], **predict(dataset))
    card = rl.dataset.score(tmp_path / "mine.npz", dataset.folder, replicates=200)
    assert card.merits[0].value.value == 1.0 and card.runs[0].name.endswith("mine.npz")
    comparison = rl.dataset.compare(card, rl.dataset.score([predict(dataset)], dataset, replicates=200))
    assert not comparison.is_worse
    np.savez(tmp_path / "other.npz", dataset="0123456789ab", **predict(dataset))
    with pytest.raises(RsoLidarError, match="is about the dataset 0123456789ab"):
        rl.dataset.score(tmp_path / "other.npz", dataset)


def test_other_splits_are_refused_and_training_is_warned_of(made):
    dataset, _ = made
    with pytest.raises(RsoLidarError, match="is of the split 'train', and the split 'test' is scored"):
        rl.dataset.score(predict(dataset, "train"), dataset)
    with pytest.warns(RsoLidarWarning, match="what an algorithm was trained on"):
        rl.dataset.score(predict_classes(dataset, "train"), dataset, "train", replicates=100)
    with pytest.raises(RsoLidarError, match="did you mean 'test'"):
        rl.dataset.score(predict(dataset), dataset, "tset")
    with pytest.raises(RsoLidarError, match="predicts other things"):
        rl.dataset.score([predict(dataset), predict_classes(dataset, "test")], dataset)
    with pytest.raises(RsoLidarError, match="no predictions"):
        rl.dataset.score([], dataset)


def test_missing_frames_are_failures(made):
    dataset, _ = made
    full = predict(dataset)
    part = {name: values[:-4] for name, values in full.items()}
    truth = dataset.split("test").column("class_id")
    lit = dataset.split("test").column("lit_pixels") > 0
    card = rl.dataset.score(part, dataset, replicates=200)
    counted = (truth >= 0) & lit
    assert card.runs[0].missing.sum() == 4
    assert card.merits[0].value.value == pytest.approx(1.0 - counted[-4:].sum() / counted.sum())

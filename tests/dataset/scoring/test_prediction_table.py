import h5py
import numpy as np
import pytest

from rso_lidar.dataset.scoring.prediction_table import check_predictions, load_predictions, match_frames
from rso_lidar.errors import RsoLidarError, RsoLidarWarning
from tests.dataset.scoring.frames import CLASSES

KEYS = {"sample": [4, 4, 9], "step": [0, 0, 0], "draw": [0, 1, 0]}
SCORES = {f"score.{name}": [0.1, 0.5, 0.2 + k] for k, name in enumerate(CLASSES)}
POSE = {key: [0.0, 1.0, 2.0] for key in ("x_m", "y_m", "z_m", "qx", "qy", "qz")} | {"qw": [2.0, 1.0, 0.5]}


def refused(columns, words):
    with pytest.raises(RsoLidarError) as caught:
        check_predictions(columns, CLASSES, "mine.csv")
    message = str(caught.value)
    assert words in message and message.startswith("mine.csv: ") and "\n" not in message


def test_columns_become_predictions():
    found = check_predictions(KEYS | SCORES | POSE | {"present": [1, 0, 1]}, CLASSES, dataset="abc")
    assert found.keys.tolist() == [[4, 0, 0], [4, 0, 1], [9, 0, 0]]
    assert found.class_id.tolist() == [0, 0, 2]  # of equal scores the first
    assert found.class_scores.shape == (3, 3) and found.present_score.tolist() == [1.0, 0.0, 1.0]
    assert np.linalg.norm(found.quaternion_xyzw, axis=1) == pytest.approx(np.ones(3))
    alone = check_predictions({"sample": [4, 5], "class": ["juno", ""]}, CLASSES)
    assert alone.class_id.tolist() == [1, -1] and alone.class_scores is None and alone.position_m is None
    assert alone.keys.tolist() == [[4, 0, 0], [5, 0, 0]]


def test_a_row_without_a_pose_is_a_failure_and_not_an_error():
    nothing = {name: [values[0], np.nan, values[2]] for name, values in POSE.items()}
    found = check_predictions(KEYS | nothing, CLASSES)
    assert np.isnan(found.position_m[1]).all() and np.isfinite(found.position_m[[0, 2]]).all()


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"sample": None}, "no column 'sample'"),
        ({"sample": None, "sampel": [1, 2, 3]}, "did you mean 'sampel'?"),
        ({"score.tdrs": None, "score.tdsr": [1, 2, 3]}, "unknown class 'tdsr'; did you mean 'tdrs'?"),
        ({"score.tdrs": None}, "no column 'score.tdrs'; give one for each class"),
        ({"score.dawn": [0.1, np.nan, 0.2]}, "sample 4, step 0, draw 1: score.dawn is nan"),
        ({"score.dawn": [0.1, 0.2, np.inf]}, "sample 9, step 0, draw 0: score.dawn is inf"),
        ({"score.dawn": ["0.1", "high", "0"]}, "row 2: score.dawn is 'high'; give a number"),
        ({"score.dawn": np.zeros((3, 2))}, "has shape (3, 2)"),
        ({"draw": [0, 0, 0]}, "sample 4, step 0, draw 0 occurs twice"),
        ({"sample": [1.5, 2, 3]}, "row 1: sample is 1.5; give a whole number"),
        ({"class": ["juno", "rosetta", "dawn"]}, "unknown class 'rosetta'"),
        ({"x_m": [1, 2, 3]}, "has x_m but no y_m"),
        (POSE | {"x_m": [1.0, np.nan, 2.0]}, "sample 4, step 0, draw 1 has a part of a pose"),
        (POSE | {"x_m": [1.0, np.inf, 2.0]}, "has a pose that is not finite"),
        (POSE | {"qw": [1.0, 1e300, 1.0]}, "or too large"),
        (
            POSE | {key: [0, 1, 1] for key in ("qx", "qy", "qz", "qw")},
            "sample 4, step 0, draw 0 has a quaternion of zero",
        ),
        (dict.fromkeys(SCORES), "predicts nothing"),
        (dict.fromkeys(SCORES) | {"presnt": [1, 2, 3]}, "predicts nothing; did you mean 'present'?"),
    ],
)
def test_bad_columns_are_refused_in_one_line(changes, words):
    columns = {name: values for name, values in (KEYS | SCORES | changes).items() if values is not None}
    refused(columns, words)


def test_columns_that_are_not_read_are_said():
    with pytest.warns(RsoLidarWarning, match="ignored: comment, presnt; did you mean 'present'"):
        check_predictions(KEYS | SCORES | {"comment": list("abc"), "presnt": [1, 2, 3]}, CLASSES)


def test_frames_are_matched_whatever_their_order():
    given = check_predictions(KEYS | SCORES, CLASSES, "mine.csv")
    truth = np.array([[9, 0, 0], [4, 0, 1], [7, 0, 0], [4, 0, 0]])
    assert match_frames(given, truth, {}, "test").tolist() == [2, 1, -1, 0]
    with pytest.raises(RsoLidarError, match="sample 9, step 0, draw 0 is of the split 'train', and the split 'test'"):
        match_frames(given, truth[1:], {"train": np.array([1, 9])}, "test")
    with pytest.raises(RsoLidarError, match="is not in the dataset"):
        match_frames(given, truth[1:], {"train": np.array([1])}, "test")


def columns_as_read(path):
    found = load_predictions(path, CLASSES)
    return found.keys.tolist(), found.class_id.tolist(), found.class_scores.tolist(), found.dataset


def test_files_of_all_formats_hold_the_same(tmp_path):
    arrays = {name: np.array(values) for name, values in (KEYS | SCORES).items()}
    rows = zip(*arrays.values(), strict=True)
    text = "# made by hand\n# dataset: 12ab34cd\n" + "\n".join(
        [",".join(arrays), *(",".join(str(cell) for cell in row) for row in rows)]
    )
    (tmp_path / "a.csv").write_text(text + "\n\n")
    np.savez(tmp_path / "a.npz", dataset="12ab34cd", **arrays)
    matrix = {"scores": np.stack([*map(np.array, SCORES.values())], axis=1), "classes": np.array(CLASSES)}
    np.savez(tmp_path / "b.npz", dataset="12ab34cd", **{name: arrays[name] for name in KEYS}, **matrix)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.attrs["dataset"] = "12ab34cd"
        for name, values in arrays.items():
            file[name] = values
    read = [columns_as_read(tmp_path / name) for name in ("a.csv", "a.npz", "b.npz", "a.h5")]
    assert all(one == read[0] for one in read) and read[0][3] == "12ab34cd"
    pyarrow = pytest.importorskip("pyarrow", reason="needs the extra parquet: pip install 'rso-lidar[parquet]'")
    from pyarrow import parquet

    table = pyarrow.table(arrays).replace_schema_metadata({"dataset": "12ab34cd"})
    parquet.write_table(table, tmp_path / "a.parquet")
    assert columns_as_read(tmp_path / "a.parquet") == read[0]


def test_poses_and_pixels_are_arrays_in_a_file(tmp_path):
    pose = {"position_m": np.ones((3, 3)), "quaternion_xyzw": np.tile([0.0, 0.0, 0.0, 1.0], (3, 1))}
    np.savez(tmp_path / "a.npz", **KEYS, **pose, part_class_id=np.zeros((3, 4, 5), np.int8))
    found = load_predictions(tmp_path / "a.npz", CLASSES)
    assert found.position_m.tolist() == np.ones((3, 3)).tolist() and found.pixels["part_class_id"].shape == (3, 4, 5)
    np.savez(tmp_path / "b.npz", **KEYS, position_m=np.ones((3, 2)))
    with pytest.raises(RsoLidarError, match=r"position_m has shape \(3, 2\); give \(frame, 3\)"):
        load_predictions(tmp_path / "b.npz", CLASSES)


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.csv", b"", "is empty"),
        ("a.csv", b"sample,class\n1,juno,3\n", "row 2 has 3 cells, and the heading names 2 columns"),
        ("a.csv", b"sample,class,class\n1,juno,juno\n", "the column 'class' stands there twice"),
        ("a.csv", b"\xff\xfe\x00", "is not UTF-8 text"),
        ("a.npz", b"not a zip", "is not an NPZ file"),
        ("a.h5", b"not HDF5", "is not an HDF5 file"),
        ("a.parquet", b"PAR1", "Parquet"),
        ("a.cvs", b"", "unknown suffix '.cvs'; did you mean '.csv'?"),
        ("a.npz", None, "no such file"),
    ],
)
def test_damaged_files_are_refused_in_one_line(tmp_path, name, content, words):
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(RsoLidarError) as caught:
        load_predictions(tmp_path / name, CLASSES)
    assert words in str(caught.value) and "\n" not in str(caught.value)


def test_arrays_have_one_row_for_each_frame(tmp_path):
    np.savez(tmp_path / "a.npz", **KEYS, part_class_id=np.zeros((2, 4, 5), np.int8))
    with pytest.raises(RsoLidarError, match="part_class_id has 2 rows and sample has 3"):
        load_predictions(tmp_path / "a.npz", CLASSES)

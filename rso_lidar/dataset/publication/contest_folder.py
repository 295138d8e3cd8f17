"""The folder of a contest: a dataset to give away, whose test split holds readings only, with hashes of its labels."""

from __future__ import annotations

import hashlib
import json
import secrets
import shutil
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rso_lidar.dataset.publication.attribution import Attribution
from rso_lidar.dataset.publication.card_text import CARD, cite, list_limits
from rso_lidar.dataset.reading.contest_key import CONTEST_SPLIT, HASHES, ContestKey, find_key
from rso_lidar.dataset.reading.random_access import SPEC_FILE, Split
from rso_lidar.dataset.shards.layout import is_image, name_camera_array
from rso_lidar.dataset.shards.manifest import ShardRecord, append_record
from rso_lidar.dataset.shards.sensor_file import SENSOR_FILE, SENSOR_HASH
from rso_lidar.dataset.shards.shard_file import hash_file, write_arrays
from rso_lidar.errors import DatasetError
from rso_lidar.export import check_export_folder, draft_export_folder

if TYPE_CHECKING:
    from rso_lidar.dataset.reading.random_access import Dataset

FRAMES = "test_frames.csv"
MARK = "dataset_export.json"  # marks a folder as an export, which --overwrite may replace
READINGS = (
    "range_m",
    "intensity_counts",
    "saturated",
    "sensor_id",
    "intrinsics_px",
)  # what the sensor knows of a frame
_CAMERA_READINGS = ("intensity_counts", "exposure_s", "start_s", "intrinsics_px")  # and of each camera beside it
_SCENARIO = "scenario.toml"
_LABELS = ("class_id", "model_id", "present", "position_m", "quaternion_xyzw")
_LEAST_SEED = 2**56  # a smaller one is found by trial, and with it every label of the test; assumed
_MOST_SEED = 2**63


def write_contest(data: Dataset, path: Path, attribution: Attribution, *, overwrite: bool = False) -> list[str]:
    """Write a dataset whose test labels stay apart into a new folder, and its key beside the labels.

    Training and validation shards are copied. Frames of the test are numbered and ordered by the key, and hold the reading,
    the number of the sensor and the lens only, and of each camera beside the lidar the image, its exposure and the lens. The
    same dataset and key give the same folder.

    Returns
    -------
    list of str
        Lines for the user.

    Raises
    ------
    DatasetError
        If the test can be made again from what is published, or the dataset has no test or is incomplete.
    RecordingError
        If the folder may not be written.
    """
    _check_secrecy(data)
    place = check_export_folder(path, overwrite=overwrite)
    if place.resolve() == data.folder.resolve() or data.folder.resolve() in place.resolve().parents:
        raise DatasetError(f"{place}: is in the folder of the labels; name one elsewhere, which can be given away")
    key = find_key(data.folder)
    with draft_export_folder(place, overwrite=overwrite) as draft:
        for name in (SENSOR_FILE, SENSOR_HASH, _SCENARIO):
            shutil.copyfile(data.folder / name, draft / name)
        _write_spec(data, draft / SPEC_FILE)
        for record in data.records:
            if not record.path.startswith(f"{CONTEST_SPLIT}/"):
                (draft / record.path).parent.mkdir(exist_ok=True)
                shutil.copyfile(data.folder / record.path, draft / record.path)
                append_record(draft, record, data.constants.sha256)
        count = _write_test(data, key, draft)
        (draft / CARD).write_text(_write_card(data, attribution, count), encoding="utf-8", newline="\n")
        info = {"format": "contest", "rso_lidar_version": version("rso-lidar"), "dataset": data.constants.sha256}
        (draft / MARK).write_text(json.dumps(info, indent=1) + "\n", encoding="utf-8", newline="\n")
    return [
        f"written     {place}: to give away, {count:,} test frames without labels",
        f"kept        {data.folder}: labels and key; rso-lidar dataset score FILE --dataset {data.folder} --contest",
    ]


def _check_secrecy(data: Dataset) -> None:
    """Raise `DatasetError` if labels of the test follow from what a contest publishes, or a shard is missing."""
    spec = data.spec
    if CONTEST_SPLIT not in data.labelled_splits:
        raise DatasetError(
            f"{data.folder}: has no labels of '{CONTEST_SPLIT}' that could be hidden; take a dataset with them"
        )
    n_made = sum(record.samples for record in data.records)
    if n_made != spec.n_samples:
        raise DatasetError(
            f"{data.folder}: {n_made:,} of {spec.n_samples:,} samples are made; make with --resume before a contest"
        )
    if spec.seed < _LEAST_SEED:
        fresh = _LEAST_SEED + secrets.randbelow(_MOST_SEED - _LEAST_SEED)
        raise DatasetError(
            f"{data.folder}: seed = {spec.seed} can be guessed, and every label with it; make the dataset with a secret "
            f"seed, such as {fresh}"
        )
    if spec.sampling != "random":
        raise DatasetError(
            f"{data.folder}: points of a Halton sequence that are in the test follow from those in training; make the "
            'dataset with sampling = "random"'
        )

    if spec.draws > 1 and (name := _find_link(data)) is not None:
        raise DatasetError(
            f"{data.folder}: {name} differs from sample to sample and is the same in all noise draws of one, and so tells "
            "which frames share a pose; make the dataset with draws = 1, or with one exposure and lens for all samples"
        )


def _find_link(data: Dataset) -> str | None:
    """Find a number that a contest publishes and that differs among samples of one sensor at one step; None without."""
    split = data.split(CONTEST_SPLIT)
    place = np.stack([split.column("sensor_id"), split.column("step")], axis=1)
    _, first, group = np.unique(place, axis=0, return_index=True, return_inverse=True)
    for name in _list_readings(data):
        if not is_image(name) and np.any((values := split.column(name)) != values[first[group.ravel()]]):
            return name
    return None


def _list_readings(data: Dataset) -> tuple[str, ...]:
    """List the arrays of the test that a contest publishes."""
    return (*READINGS, *(name_camera_array(camera, field) for camera in data.cameras for field in _CAMERA_READINGS))


def _write_spec(data: Dataset, place: Path) -> None:
    """Write the specification without its seed."""
    import tomli_w

    text = tomli_w.dumps(data.spec.model_dump(exclude_none=True, exclude={"seed"}))
    place.write_text(f"# The seed is withheld until the labels are published.\n{text}", encoding="utf-8", newline="\n")


def _write_test(data: Dataset, key: ContestKey, folder: Path) -> int:
    """Write the test split of a contest, its list of frames and the hashes of its labels; return the number of frames."""
    split = data.split(CONTEST_SPLIT)
    columns = {name: split.column(name) for name in ("sample", "step", "draw")}
    number = key.number_frames(columns["sample"], columns["draw"])
    order = np.lexsort((columns["step"], number))
    (folder / CONTEST_SPLIT).mkdir()
    names = ",".join(("sample", "step"))
    identities = [f"{number[row]},{columns['step'][row]}" for row in order.tolist()]
    (folder / FRAMES).write_text("\n".join([names, *identities]) + "\n", encoding="utf-8", newline="\n")
    size, shards = data.spec.shard_frames, 0
    versions = split.records[0].versions
    with (folder / HASHES).open("w", encoding="utf-8", newline="\n") as hashes:
        for begin in range(0, len(order), size):
            rows = order[begin : begin + size]
            path = f"{CONTEST_SPLIT}/{shards:06d}.h5"
            arrays: dict[str, Any] = {
                "sample": number[rows],
                "step": columns["step"][rows],
                "draw": np.zeros(len(rows), int),
                **split.read(rows, _list_readings(data)),
            }
            write_arrays(
                folder / path, {name: list(values) for name, values in arrays.items()}, dataset=data.constants.sha256
            )
            place, samples = folder / path, len(np.unique(number[rows]))
            append_record(
                folder,
                ShardRecord(path, len(rows), samples, place.stat().st_size, hash_file(place), versions),
                data.constants.sha256,
            )
            shards += 1
            for identity, text in zip(identities[begin : begin + size], _list_labels(data, split, rows), strict=True):
                salt = key.digest(f"salt,{identity}")
                hashes.write(f"{hashlib.sha256(f'{salt} {identity} {text}'.encode()).hexdigest()}  {identity}\n")
    return len(order)


def _list_labels(data: Dataset, split: Split, rows: np.ndarray) -> Iterator[str]:
    """Yield the labels of frames as JSON, with the SHA-256 of images of labels."""
    wanted = ["part_class_id", "true_range_m", "oversampled_range_m"]
    wanted += [name_camera_array(camera, field) for camera in data.cameras for field in ("part_class_id", "range_m")]
    images = [name for name in wanted if name in split.names]
    arrays = split.read(rows, (*_LABELS, *images))
    for k in range(len(rows)):
        class_id, model_id = int(arrays["class_id"][k]), int(arrays["model_id"][k])
        labels: dict[str, Any] = {
            "class": data.classes[class_id] if class_id >= 0 else None,
            "model": data.models[model_id] if model_id >= 0 else None,
            "present": int(arrays["present"][k]),
            **{name: [repr(float(x)) for x in arrays[name][k]] for name in ("position_m", "quaternion_xyzw")},
            **{name: hashlib.sha256(np.ascontiguousarray(arrays[name][k]).tobytes()).hexdigest() for name in images},
        }
        yield json.dumps(labels, sort_keys=True)


def _write_card(data: Dataset, attribution: Attribution, count: int) -> str:
    """Return the card of a contest."""
    others = [name for name in data.splits if name != CONTEST_SPLIT]
    frames = ", ".join(f"{len(data.split(name)):,} of {name}" for name in others)
    head = ["---", f"pretty_name: {json.dumps(data.spec.name, ensure_ascii=False)}"]
    head += [f"license: {(attribution.licence or 'unknown').lower()}", "configs:"]
    for name in data.splits:  # splits differ in their arrays, which needs a configuration for each
        head += [f"- config_name: {name}", "  data_files:", f"  - split: {name}", f"    path: {name}/*.h5"]
    readings = ", ".join(f"`{name}`" for name in _list_readings(data))
    limits = "\n".join(f"- {limit}" for limit in list_limits(data))
    return "\n".join([*head, "---"]) + (
        f"\n\n# {data.spec.name}: a contest\n\n"
        f"Simulated frames of a flash lidar: {frames} with labels, and {count:,} of {CONTEST_SPLIT} without. Classes: "
        f"{', '.join(data.classes)}. The dataset is `{data.constants.sha256}`.\n\n"
        "## A submission\n\n"
        f"One row for each frame of `{FRAMES}`, which names them by `sample` and `step`, as CSV, Parquet, NPZ or\n"
        "HDF5. Give `class`, `score.<class>` of all classes, `present`, a pose (`x_m`, `y_m`, `z_m`, `qx`, `qy`, `qz`,\n"
        "`qw`), or images of `part_class_id`. A frame without a row counts as a failure.\n\n"
        "```text\n"
        f"# dataset: {data.constants.sha256}\nsample,step,class\n0,0,{data.classes[0]}\n1,0,{data.classes[-1]}\n"
        "```\n\n"
        "## What is hidden\n\n"
        f"A frame of the test has {readings}.\nNumbers and order of its frames are random. `{HASHES}` has the "
        "salted SHA-256 of the labels of each,\nso that nobody can change them afterwards. Whoever has the labels and the "
        f"key gets the same `{HASHES}`\nby publishing again.\n\n"
        f"## Known limits\n\n{limits}\n\n## Citation\n\n{cite(data, attribution)}\n"
    )

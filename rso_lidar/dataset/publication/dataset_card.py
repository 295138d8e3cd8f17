"""The card of a dataset: `README.md`, with a YAML head that Hugging Face reads, and a description in Markdown."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rso_lidar.dataset.publication.attribution import Attribution
from rso_lidar.dataset.publication.card_tables import (
    FrameCounts,
    format_table,
    list_arrays,
    list_counts,
    list_laws,
    list_models,
    list_sensors,
)
from rso_lidar.dataset.publication.card_text import CARD, PAPER, cite, describe_dataset, list_limits
from rso_lidar.dataset.specification.tables import ModelSplit, RandomSplit
from rso_lidar.files import write_text

if TYPE_CHECKING:
    from rso_lidar.dataset.reading.random_access import Dataset

_TASKS = ("image-classification", "object-detection", "image-segmentation")
_TAGS = ("lidar", "flash-lidar", "range-image", "point-cloud", "space", "spacecraft", "pose-estimation", "simulation")
_SAMPLING = {"random": "pseudo-random numbers", "halton": "a scrambled Halton sequence"}
_SIZES = (
    (10**3, "n<1K"),
    (10**4, "1K<n<10K"),
    (10**5, "10K<n<100K"),
    (10**6, "100K<n<1M"),
    (10**7, "1M<n<10M"),
    (10**8, "10M<n<100M"),
    (10**9, "100M<n<1B"),
)


def write_card(data: Dataset, counts: FrameCounts, pictures: Sequence[str], attribution: Attribution) -> Path:
    """Write the card into the folder of a dataset, and return its path."""
    sections = (
        _write_head(data, counts, attribution),
        f"# {data.spec.name}\n\n{describe_dataset(data)}",
        *(f"![a frame of {data.spec.name}]({name})" for name in pictures),
        _explain_making(data),
        _explain_content(data, counts),
        _explain_splits(data),
        _explain_sensors(data),
        _explain_limits(data),
        _explain_reading(data),
        f"## Citation\n\n{cite(data, attribution)}\n\nThe simulated system is that of: {PAPER}.",
    )
    return write_text(data.folder / CARD, "\n\n".join(sections) + "\n", overwrite=True)


def choose_size(frames: int) -> str:
    """Return the size category of Hugging Face for a number of frames.

    >>> choose_size(999), choose_size(2800)
    ('n<1K', '1K<n<10K')
    """
    return next((name for end, name in _SIZES if frames < end), "n>1B")


def _write_head(data: Dataset, counts: FrameCounts, attribution: Attribution) -> str:
    """Return the YAML head of the card. Texts are written as in JSON, which YAML reads."""
    lines = [
        "---",
        f"pretty_name: {json.dumps(data.spec.name, ensure_ascii=False)}",
        f"license: {(attribution.licence or 'unknown').lower()}",
        f"size_categories: [{json.dumps(choose_size(sum(counts.frames.values())))}]",
        f"task_categories: {json.dumps(_TASKS)}",
        f"tags: {json.dumps(_TAGS)}",
        "configs:",
        "- config_name: default",
        "  data_files:",
    ]
    for split in data.splits:
        lines += [f"  - split: {split}", f"    path: {split}/*.h5"]
    return "\n".join([*lines, "---"])


def _explain_making(data: Dataset) -> str:
    """Return the section on how the dataset was made."""
    spec = data.spec
    versions = "; or with ".join(sorted({_list_versions(record.versions) for record in data.records}))
    steps = "a single flash" if spec.sequence.frames == 1 else f"{spec.sequence.frames} frames in sequence"
    draws = "one draw of noise" if spec.draws == 1 else f"{spec.draws} draws of noise of the same poses and light"
    return (
        "## How it was made\n\n"
        f"The simulator rso_lidar flew the scenario `scenario.toml` for each sample. A sample is {steps}, with {draws}. "
        f"Sample i depends on `dataset.toml` and i only. The random seed is {spec.seed}, and values are drawn from their "
        f"laws by {_SAMPLING[spec.sampling]}. To make it again:\n\n"
        "```sh\nrso-lidar dataset make dataset.toml -o again\n```\n\n"
        f"Made with {versions}. The hash of the specification, scenario and meshes is `{data.constants.sha256}`.\n\n"
        f"{list_laws(data)}"
    )


def _list_versions(text: str) -> str:
    """Format the versions of a shard, which the manifest holds as JSON."""
    return ", ".join(f"{name} {version}" for name, version in json.loads(text).items())


def _explain_content(data: Dataset, counts: FrameCounts) -> str:
    """Return the section on what the dataset holds."""
    return (
        "## What it holds\n\n"
        f"{list_counts(data, counts)}\n\n"
        f"{list_models(data)}\n\n"
        "A shard, such as `train/000000.h5`, is an HDF5 file in which every array has the frame as its first axis. "
        "`manifest.jsonl` has the SHA-256 of each, and `sensor.h5` the names, the lines of sight and the symmetries.\n\n"
        f"{list_arrays(data)}\n\n"
        f"Classes, by `class_id`: {_number(data.classes)}. Models, by `model_id`: {_number(data.models)}. Part classes, "
        f"by `part_class_id`: {_number(data.part_classes)}. Lidar axes: +z is the boresight, +x right (columns grow with "
        "it), +y down (rows grow with it). Poses are lidar_from_target; quaternions are x, y, z, w."
        f"{_explain_cameras(data)}"
    )


def _explain_cameras(data: Dataset) -> str:
    """Return how the arrays of the cameras beside the lidar are named, or an empty text without cameras."""
    if not data.cameras:
        return ""
    return (
        f" Arrays `camera.<name>.…` are of the cameras {', '.join(data.cameras)}; their axes are named like those of the "
        "lidar, and `sensor.h5` has their lines of sight, bands and numbers."
    )


def _number(names: Sequence[str]) -> str:
    """Return names with their numbers."""
    return ", ".join(f"{number} {name}" for number, name in enumerate(names))


def _explain_splits(data: Dataset) -> str:
    """Return the section on splits, and on mistakes that make results look too good."""
    rule = data.spec.split
    if isinstance(rule, RandomSplit):
        how = (
            "Each class is divided at random by the shares of the splits. A model can be in every split, so the test "
            "measures new views of known craft."
        )
    else:
        what = "model" if isinstance(rule, ModelSplit) else "sensor"
        held = "; ".join(f"{place}: {', '.join(names)}" for place in ("val", "test") if (names := getattr(rule, place)))
        how = f"Samples are assigned by {what} ({held}), so the test measures a {what} that training never saw."
    return (
        f"## Splits\n\n{how} All frames and noise draws of a sample are in one split, and a larger dataset of the same "
        "specification moves no sample.\n\n"
        "- Divide the training split further by `sample`, never by frame: noise draws of one pose are nearly copies.\n"
        "- Choose networks and thresholds on the training or validation split, and use the test split once.\n"
        "- Report results by range and by reporting pixels. Where classes differ in size, absolute range and the number of "
        "lit pixels alone can tell them apart.\n"
        "- Labels such as `true_range_m`, `photons` and `lit_pixels` are not measured; do not feed them to a classifier."
    )


def _explain_sensors(data: Dataset) -> str:
    """Return the section on the instruments."""
    parts = ["## Sensor"]
    drawn = {_name_camera(data, variable.field) for variable in data.spec.variable}
    for name, parameters in list_sensors(data):
        rows = [
            [
                f"`{parameter.place}`",
                "drawn" if parameter.place in drawn else parameter.value,
                "assumed" if parameter.is_assumed else "",
                parameter.meaning,
            ]
            for parameter in parameters
        ]
        parts += [f"### {name}", format_table(["parameter", "value", "source", "meaning"], rows)]
    return "\n\n".join(parts)


def _name_camera(data: Dataset, field: str) -> str:
    """Return a field of a scenario with the name of its camera in place of the camera's number."""
    numbered = re.match(r"camera(?:\[(\d+)\]|\.(\d+))(?=\.)", field)
    if numbered is None or (number := int(numbered[1] or numbered[2])) >= len(data.cameras):
        return field
    return f"camera.{data.cameras[number]}{field[numbered.end() :]}"


def _explain_limits(data: Dataset) -> str:
    """Return the section on known limits."""
    assumed = {
        parameter.place for _, parameters in list_sensors(data) for parameter in parameters if parameter.is_assumed
    }
    lines = [f"- {limit}" for limit in list_limits(data)]
    if assumed:
        lines.append(f"- Assumed numbers of the instrument: {', '.join(f'`{place}`' for place in sorted(assumed))}.")
    return "## Known limits\n\n" + "\n".join(lines)


def _explain_reading(data: Dataset) -> str:
    """Return the section on how to read the dataset."""
    first = data.splits[0]
    return (
        "## How to read it\n\n"
        "```python\nimport rso_lidar as rl\n\n"
        f'data = rl.dataset.open(".")\nframes = data.split("{first}").read([0], ["range_m", "class_id"])\n```\n\n'
        "Without rso_lidar: `h5py.File` reads a shard, Hugging Face `load_dataset` this folder, and MATLAB `h5read` a "
        "shard. `rso-lidar dataset export` writes WebDataset, TFRecord, and images with COCO annotations."
    )

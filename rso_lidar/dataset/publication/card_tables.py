"""The tables of a dataset's card: arrays, counts of frames, laws, models, and sensors with their assumed parameters."""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from rso_lidar.dataset.shards.layout import LabelledFrame, LabelledImage, describe_array, name_camera_array
from rso_lidar.errors import RsoLidarError, ScenarioError
from rso_lidar.imaging import Camera
from rso_lidar.part import Part
from rso_lidar.records import specs
from rso_lidar.scenario import Lidar, name_fragments
from rso_lidar.scene import model

if TYPE_CHECKING:
    from rso_lidar.dataset.reading.random_access import Dataset

NO_TARGET = "no target"
PIXEL_STEPS = (0, 1, 10, 100, 1000)  # lowest number of reporting pixels of each bin
_COLUMNS = ("class_id", "range_to_target_m", "reporting_pixels")
_MARK = "assumed"  # in the description of a field: its default has no source


def format_table(heads: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    r"""Format a table in Markdown.

    >>> print(format_table(["a", "b"], [[1, "x|y"]]))
    | a | b |
    | --- | --- |
    | 1 | x\|y |
    """
    lines = [list(heads), ["---"] * len(heads), *rows]
    return "\n".join("| " + " | ".join(str(cell).replace("|", "\\|") for cell in line) + " |" for line in lines)


def list_arrays(data: Dataset) -> str:
    """Return the table of the arrays of the shards."""
    split = data.split(data.splits[0])
    first = split[0]
    rows = []
    of_cameras = [name_camera_array(camera, field) for camera in data.cameras for field in specs(LabelledImage)]
    stated = [*specs(LabelledFrame), *of_cameras]  # in the order in which a person reads them; drawn numbers follow
    for name in sorted(split.names, key=lambda key: stated.index(key) if key in stated else len(stated)):
        spec = describe_array(name)
        shape = " × ".join(["frame", *map(str, first[name].shape)])
        rows.append([f"`{name}`", shape, first[name].dtype.name, "" if spec.unit == "1" else spec.unit, spec.meaning])
    return format_table(["array", "shape", "type", "unit", "meaning"], rows)


def list_counts(data: Dataset, counts: FrameCounts) -> str:
    """Return the tables of frames by class and by reporting pixels."""
    splits = list(counts.by_class)
    rows = []
    for name in counts.by_class[splits[0]]:
        low, high = counts.ranges_m.get(name, (None, None))
        span = f"{low:,.1f} to {high:,.1f}" if low is not None else ""
        rows.append([name, *(f"{counts.by_class[split][name]:,}" for split in splits), span])
    rows.append(["all", *(f"{counts.frames[split]:,}" for split in splits), ""])
    ends = [*(f"{low} to {high - 1}" for low, high in itertools.pairwise(PIXEL_STEPS)), "1000 or more"]
    bins = [
        ["0" if k == 0 else end, *(f"{counts.by_pixels[split][k]:,}" for split in splits)] for k, end in enumerate(ends)
    ]
    heads = [f"frames of {split}" for split in splits]
    return (
        format_table(["class", *heads, "range of the target [m]"], rows)
        + "\n\n"
        + format_table(["pixels that reported the target", *heads], bins)
    )


def list_laws(data: Dataset) -> str:
    """Return the table of drawn quantities and their laws."""
    return format_table(["what is drawn", "law"], _describe_laws(data))


def _describe_laws(data: Dataset) -> Iterator[tuple[str, str]]:
    """Yield each drawn quantity and its law."""
    spec = data.spec
    for table in ("view", "clutter"):
        part = getattr(spec, table)
        for name in type(part).model_fields if part is not None else ():
            value = getattr(part, name)
            if value is not None:
                yield f"`{table}.{name}`", _describe_value(value)
    for drawn in spec.variable:
        only = f" of {', '.join(drawn.classes)}" if drawn.classes else ""
        yield f"`{drawn.field}`{only}", _describe_value(drawn.law)
    if spec.sensor:
        yield "sensor", f"one of {', '.join(data.sensors)}, equally likely"


def _describe_value(value: Any) -> str:
    """Describe a law, or another value of a specification, in one line."""
    if not isinstance(value, Part):
        return ", ".join(map(str, value)) if isinstance(value, tuple) else str(value)
    table = value.model_dump(exclude_none=True)
    kind = table.pop("type", "")
    return f"{kind} {', '.join(f'{name} = {_shorten(entry)}' for name, entry in table.items())}".strip()


def _shorten(value: Any) -> str:
    """Format a number, or a list of them."""
    if isinstance(value, tuple | list):
        return f"[{', '.join(map(_shorten, value))}]"
    return f"{value:g}" if isinstance(value, float) else str(value)


def list_models(data: Dataset) -> str:
    """Return the table of the models with their licences and confidence."""
    rows = []
    for name in data.models:
        try:
            entry = model(name)
        except RsoLidarError:
            what = "fragments from random seeds" if name.startswith(name_fragments("")) else "a mesh of the user"
            rows.append([name, what, "", ""])
        else:
            rows.append([name, entry.what, entry.licence, entry.confidence])
    return format_table(["model", "what it is", "licence", "confidence"], rows)


def list_sensors(data: Dataset) -> Iterator[tuple[str, list[Parameter]]]:
    """Yield name and parameters of each sensor, and of each camera beside it."""
    for name in data.sensors:
        yield name, list_parameters(data.constants.lidars[name], "lidar", Lidar)
        for camera, entry in data.constants.cameras.get(name, {}).items():
            yield f"{name}, camera {camera}", list_parameters(entry.table, f"camera.{camera}", Camera)


@dataclass(frozen=True)
class FrameCounts:
    """Frames by split and class, and by split and reporting pixels; and nearest and farthest range [m] by class."""

    by_class: dict[str, dict[str, int]]
    by_pixels: dict[str, tuple[int, ...]]
    ranges_m: dict[str, tuple[float, float]]

    @property
    def frames(self) -> dict[str, int]:
        """Number of frames of each split."""
        return {split: sum(classes.values()) for split, classes in self.by_class.items()}


def count_frames(data: Dataset) -> FrameCounts:
    """Count the frames of a dataset, one shard in memory at a time."""
    names = [*data.classes, NO_TARGET]
    by_class: dict[str, dict[str, int]] = {}
    by_pixels: dict[str, tuple[int, ...]] = {}
    nearest_m, farthest_m = np.full(len(data.classes), np.inf), np.full(len(data.classes), -np.inf)
    for name in data.splits:
        split = data.split(name)
        of_class, of_pixels = np.zeros(len(names), int), np.zeros(len(PIXEL_STEPS), int)
        for shard in range(len(split.records)):
            arrays = split.read_shard(shard, _COLUMNS)
            class_id, range_m = arrays["class_id"], arrays["range_to_target_m"]
            of_class += np.bincount(np.where(class_id < 0, len(names) - 1, class_id), minlength=len(names))
            known = (class_id >= 0) & np.isfinite(range_m)
            np.minimum.at(nearest_m, class_id[known], range_m[known])
            np.maximum.at(farthest_m, class_id[known], range_m[known])
            bins = np.searchsorted(PIXEL_STEPS, arrays["reporting_pixels"][class_id >= 0], side="right") - 1
            of_pixels += np.bincount(bins, minlength=len(PIXEL_STEPS))
        by_class[name] = dict(zip(names, of_class.tolist(), strict=True))
        by_pixels[name] = tuple(of_pixels.tolist())
    ranges = zip(data.classes, nearest_m.tolist(), farthest_m.tolist(), strict=True)
    ranges_m = {name: (low, high) for name, low, high in ranges if low <= high}
    return FrameCounts(by_class, by_pixels, ranges_m)


class Parameter(NamedTuple):
    """One parameter of a sensor: its key in the scenario, its value, its meaning, and whether the value is assumed."""

    place: str
    value: str
    meaning: str
    is_assumed: bool


def list_parameters(text: str, place: str, part: type[Part]) -> list[Parameter]:
    """List the parameters of a sensor or a camera.

    Parameters
    ----------
    text : its table as JSON
    place : of the table in the scenario
    part : class that the table fills

    Returns
    -------
    list of Parameter
        Without meanings if the parts of this version cannot read the table, such as for a detector of the user's own.
    """
    table = json.loads(text)
    try:
        return list(_walk(part.model_validate_json(text), place))
    except (ScenarioError, ValueError):
        return [Parameter(key, value, "", False) for key, value in _flatten(table, place)]


def _walk(part: Part, place: str) -> Iterator[Parameter]:
    """Yield the parameters of a part and of the parts in it."""
    for name, field in type(part).model_fields.items():
        value = getattr(part, name)
        if isinstance(value, Part):
            yield from _walk(value, f"{place}.{name}")
        elif value is not None:
            meaning = " ".join((field.description or "").split())
            text = json.dumps(_simplify(value), ensure_ascii=False)
            yield Parameter(f"{place}.{name}", text, meaning, _MARK in meaning and value == field.default)


def _flatten(table: Any, place: str) -> Iterator[tuple[str, str]]:
    """Yield place and value of all entries of a table."""
    if isinstance(table, dict):
        for name, value in table.items():
            yield from _flatten(value, f"{place}.{name}")
    else:
        yield place, json.dumps(table, ensure_ascii=False)


def _simplify(value: Any) -> Any:
    """Convert a value of a part to a JSON value."""
    if isinstance(value, Part):
        return value.model_dump(mode="json", exclude_none=True)
    if isinstance(value, list | tuple):
        return [_simplify(element) for element in value]
    return value if isinstance(value, bool | int | float | str) else str(value)

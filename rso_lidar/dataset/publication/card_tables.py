"""The tables of a dataset's card: arrays, counts, laws, models and sensors."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

from rso_lidar.dataset.publication.frame_counts import PIXEL_STEPS, FrameCounts
from rso_lidar.dataset.publication.sensor_table import Parameter, list_parameters
from rso_lidar.dataset.shards.layout import LabelledFrame, describe_array
from rso_lidar.errors import RsoLidarError
from rso_lidar.part import Part
from rso_lidar.records import specs
from rso_lidar.scenario import name_fragments
from rso_lidar.scene import model

if TYPE_CHECKING:
    from rso_lidar.dataset.reading.random_access import Dataset


def format_table(heads: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    r"""Format a table in Markdown.

    Parameters
    ----------
    heads : of the columns
    rows : cells of each row, of any type

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
    stated = [*specs(LabelledFrame)]  # in the order in which a person reads them; drawn numbers follow
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
    """Yield name and parameters of each sensor."""
    for name in data.sensors:
        yield name, list_parameters(data.constants.lidars[name])

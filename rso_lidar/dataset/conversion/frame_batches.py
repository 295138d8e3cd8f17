"""Frames of a dataset one by one for an export: their names, numbers, texts and images, at constant memory."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain, islice
from typing import TYPE_CHECKING, Any

import numpy as np

from rso_lidar.dataset.shards.layout import is_image, list_cameras, name_camera_array
from rso_lidar.errors import DatasetError, did_you_mean

if TYPE_CHECKING:
    from rso_lidar.dataset.reading.random_access import Dataset, Split

BATCH = 32  # frames read at once
FRAMES_PER_FILE = 1024  # of an export in large files: 0.1 GB of 128 x 128 pixels, a size that object stores serve well
USUAL_IMAGES = ("range_m", "intensity_counts", "saturated", "target", "part_class_id")  # of the lidar and of cameras
_IDENTITY = ("sample", "step", "draw")


@dataclass(frozen=True)
class ExportedFrame:
    """One frame of a dataset for an export.

    `numbers` has the numbers and short vectors of the frame by name. `words` has its split and the names of its class, model
    and sensor, None where it has none. `images` has the chosen arrays (row, col) by name; those of cameras may have bands.
    """

    name: str
    numbers: Mapping[str, Any]
    words: Mapping[str, str | None]
    images: Mapping[str, np.ndarray]

    @property
    def description(self) -> dict[str, Any]:
        """Numbers and names as JSON values; None for NaN and infinity."""
        return {name: _to_json(np.asarray(value).tolist()) for name, value in self.numbers.items()} | dict(self.words)


def read_frames(data: Dataset, split: str, images: Sequence[str]) -> Iterator[ExportedFrame]:
    """Read the frames of a split in their order."""
    frames = data.split(split)
    columns = [name for name in frames.names if not is_image(name)]
    for batch in read_batches(frames, [*columns, *images]):
        for place in range(len(batch["sample"])):
            numbers = {column: batch[column][place] for column in columns}
            arrays = {image: batch[image][place] for image in images}
            words = {"split": split, **find_names(data, numbers)}
            yield ExportedFrame(name_frame(numbers), numbers, words, arrays)


def read_batches(frames: Split, names: Sequence[str]) -> Iterator[dict[str, np.ndarray]]:
    """Read arrays of a split in the order of its frames, a few frames at a time.

    Yields
    ------
    dict
        Arrays by name, with at most `BATCH` frames on their first axis.
    """
    for shard, record in enumerate(frames.records):
        for start in range(0, record.frames, BATCH):
            yield frames.read_shard(shard, names, slice(start, start + BATCH))


def divide(frames: Iterable[ExportedFrame], size: int = FRAMES_PER_FILE) -> Iterator[Iterator[ExportedFrame]]:
    """Divide frames into groups. Read each group to its end before the next one."""
    left = iter(frames)
    for first in left:
        yield chain([first], islice(left, size - 1))


def choose_images(frames: Split, wanted: Sequence[str]) -> list[str]:
    """Choose the arrays of images to export.

    Parameters
    ----------
    wanted : names of arrays; ``all`` stands for all of them. If empty, `USUAL_IMAGES` of the lidar and of all cameras but
        the cameras' true range

    Raises
    ------
    DatasetError
        If the dataset has no images of such a name.
    """
    known = [name for name in frames.names if is_image(name)]
    for name in wanted:
        if name not in (*known, "all"):
            raise DatasetError(f"{name}: no such images{did_you_mean(name, known)} (known: {', '.join(known)}; or all)")
    if "all" in wanted:
        return known
    if wanted:
        return [name for name in known if name in wanted]
    of_cameras = {name_camera_array(camera, field) for camera in list_cameras(known) for field in USUAL_IMAGES[1:]}
    return [name for name in known if name in USUAL_IMAGES or name in of_cameras]


def name_frame(numbers: Mapping[str, Any]) -> str:
    """Return the name of a frame, unique in its dataset: sample, step and draw.

    >>> name_frame({"sample": 17, "step": 2, "draw": 1})
    '00000017-0002-01'
    """
    sample, step, draw = (int(numbers[name]) for name in _IDENTITY)
    return f"{sample:08d}-{step:04d}-{draw:02d}"


def find_names(data: Dataset, numbers: Mapping[str, Any]) -> dict[str, str | None]:
    """Return the names of the class, model and sensor of a frame; None where it has none."""
    lists = {"class": data.classes, "model": data.models, "sensor": data.sensors}
    places = {word: int(numbers[f"{word}_id"]) for word in lists}
    return {word: names[places[word]] if places[word] >= 0 else None for word, names in lists.items()}


def _to_json(value: Any) -> Any:
    """Replace NaN and infinity, which JSON lacks, by None."""
    if isinstance(value, list):
        return [_to_json(element) for element in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value

"""The parts of targets in a frame, and the colour and name of each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rso_lidar.picture.style.palette import PARTS
from rso_lidar.records import Frame

PartKey = tuple[int, int]  # numbers of target and part


class PartColours(NamedTuple):
    """Parts seen in a frame, the number of pixels of each, and the colours of both.

    Parameters
    ----------
    kinds : (kind, [target, part]) numbers, ascending
    counts : (kind) pixels
    colours : (kind) index into `palette.PARTS`; one past its end for kinds that share the colour of other parts
    image : (row, col) index of the colour, -1 where no target is
    """

    kinds: np.ndarray
    counts: np.ndarray
    colours: np.ndarray
    image: np.ndarray


def colour_parts(frame: Frame, parts: Sequence[PartKey] = ()) -> PartColours:
    """Choose the colours of the parts in a frame.

    Where there is a colour for every part of the recording a part keeps its own in all frames. Else the first of `parts`
    get them, or without these the parts with most pixels.

    Parameters
    ----------
    frame : with labels
    parts : numbers (target, part) of parts that get colours of their own first

    Returns
    -------
    PartColours
    """
    there = frame.labels.target >= 0
    kinds, places, counts = _count_parts(frame)
    colours = _choose_colours(frame, kinds, np.argsort(-counts, kind="stable"), parts)
    image = np.full(there.shape, -1)
    image[there] = colours[places.reshape(-1)]
    return PartColours(kinds, counts, colours, image)


def _count_parts(frame: Frame) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the parts (kind, [target, part]) in a frame, the kind of each target pixel, and the pixels of each kind."""
    there = frame.labels.target >= 0
    seen = np.stack([frame.labels.target[there], frame.labels.part[there]], axis=-1)
    kinds, places, counts = np.unique(seen, axis=0, return_inverse=True, return_counts=True)
    return kinds, places, counts


def rank_parts(frames: Sequence[Frame]) -> tuple[PartKey, ...]:
    """Return the parts (target, part) in frames, those with most pixels first.

    Parameters
    ----------
    frames : with labels; their pixels are added up
    """
    total: dict[PartKey, int] = {}
    for frame in frames:
        kinds, _, counts = _count_parts(frame)
        for (target, part), count in zip(kinds.tolist(), counts.tolist(), strict=True):
            total[target, part] = total.get((target, part), 0) + count
    return tuple(sorted(total, key=lambda kind: (-total[kind], kind)))


def _choose_colours(frame: Frame, kinds: np.ndarray, order: np.ndarray, parts: Sequence[PartKey]) -> np.ndarray:
    """Return the index of the colour of each kind (kind); `len(PARTS)` for kinds that share the last colour.

    Parameters
    ----------
    kinds : (kind, [target, part])
    order : kinds by their number of pixels, most first
    parts : numbers (target, part) of parts that get colours of their own first
    """
    starts = np.cumsum([0, *(len(entry.parts) for entry in frame.source.targets)])
    known = kinds.size and kinds[:, 0].max() < len(starts) - 1 and kinds[:, 1].min() >= 0
    if known and starts[-1] <= len(PARTS):
        return np.asarray(starts[kinds[:, 0]] + kinds[:, 1])
    if parts:
        place = {kind: k for k, kind in enumerate(parts[: len(PARTS)])}
        return np.array([place.get((target, part), len(PARTS)) for target, part in kinds.tolist()], dtype=int)
    rank = np.empty_like(order)
    rank[order] = np.arange(order.size)
    return np.asarray(np.minimum(rank, len(PARTS)))


def find_part_name(frame: Frame, target: int, part: int) -> str:
    """Return the name of a part, with its target's name where there are several targets.

    Parameters
    ----------
    frame : gives the names
    target, part : numbers of target and part, as the labels hold them; unknown ones are named by their number
    """
    entries = frame.source.targets
    entry = entries[target] if target < len(entries) else None
    known = entry is not None and 0 <= part < len(entry.parts)
    name = entry.parts[part] if entry is not None and known else f"part {part}"
    owner = entry.name if entry is not None else f"target {target}"
    text = f"{owner}: {name}" if len(entries) > 1 else name
    return text if len(text) <= 27 else f"{text[:13]}…{text[-13:]}"  # names often differ at their end

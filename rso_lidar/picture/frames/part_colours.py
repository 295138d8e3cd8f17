"""The parts of targets in a frame, and the colour and name of each."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rso_lidar.picture.style.palette import PARTS
from rso_lidar.records import Frame

PartKey = tuple[int, int]  # numbers of target and part


def count_parts(frame: Frame) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the parts (kind, [target, part]) in a frame, the kind of each target pixel, and the pixels of each kind."""
    there = frame.labels.target >= 0
    seen = np.stack([frame.labels.target[there], frame.labels.part[there]], axis=-1)
    kinds, places, counts = np.unique(seen, axis=0, return_inverse=True, return_counts=True)
    return kinds, places, counts


def parts_in_order(frames: Sequence[Frame]) -> tuple[PartKey, ...]:
    """Return the parts (target, part) in frames, those with most pixels first."""
    total: dict[PartKey, int] = {}
    for frame in frames:
        kinds, _, counts = count_parts(frame)
        for (target, part), count in zip(kinds.tolist(), counts.tolist(), strict=True):
            total[target, part] = total.get((target, part), 0) + count
    return tuple(sorted(total, key=lambda kind: (-total[kind], kind)))


def choose_part_colours(frame: Frame, kinds: np.ndarray, order: np.ndarray, parts: Sequence[PartKey]) -> np.ndarray:
    """Return the index of the colour of each kind (kind); `len(PARTS)` for kinds that share the last colour.

    Where there is a colour for every part of the recording a part keeps its own in all frames; else the first in `parts`
    get them, or without these the parts with most pixels, first in `order`.

    Parameters
    ----------
    frame : the frame.
    kinds : (kind, [target, part]).
    order : kinds by their number of pixels, most first.
    parts : parts that get colours of their own first.
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
    frame : gives the names.
    target, part : numbers of target and part.
    """
    entries = frame.source.targets
    entry = entries[target] if target < len(entries) else None
    known = entry is not None and 0 <= part < len(entry.parts)
    name = entry.parts[part] if entry is not None and known else f"part {part}"
    owner = entry.name if entry is not None else f"target {target}"
    text = f"{owner}: {name}" if len(entries) > 1 else name
    return text if len(text) <= 27 else f"{text[:13]}…{text[-13:]}"  # names often differ at their end

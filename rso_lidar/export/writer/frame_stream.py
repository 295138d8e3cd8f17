"""Frames on their way into a file: at least one, all with the same arrays."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from rso_lidar.errors import RecordingError
from rso_lidar.export.layout import intermediates
from rso_lidar.export.layout.datasets import Variable, collect_values, get_parents
from rso_lidar.export.layout.sensor_samples import pad
from rso_lidar.records import Frame


def take_first(place: Path, frames: Iterable[Frame]) -> tuple[Frame, Iterator[Frame]]:
    """Return the first frame, and an iterator over all frames; raise a `RecordingError` if there is none."""
    if not isinstance(frames, Iterable):
        raise RecordingError(f"{place}: got a {type(frames).__name__}, not frames; give what simulate or open returns")
    coming = iter(frames)
    first = next(coming, None)
    if first is None:
        raise RecordingError(f"{place}: no frames to write; check the selection of frames")
    return _check_frame(place, first), (_check_frame(place, frame) for frame in itertools.chain([first], coming))


def _check_frame(place: Path, frame: object) -> Frame:
    if not isinstance(frame, Frame):
        raise RecordingError(f"{place}: got a {type(frame).__name__}, not a frame; give what simulate or open returns")
    return frame


def match_entries(place: Path, frame: Frame, first: Frame, variables: Mapping[str, Variable]) -> dict[str, np.ndarray]:
    """Return the entry of each variable, by path, after checking that a frame matches the first one.

    Samples of sensors are not padded to their entry.
    """
    where = f"{place}: frame {frame.index}"
    if frame is not first and get_parents(frame) != get_parents(first):
        raise RecordingError(f"{where}: its tree of axes differs from the first frame's; write it to another file")
    if frame.line_of_sight.shape != first.line_of_sight.shape:
        raise RecordingError(f"{where}: has other rows or columns than the first; write it to another file")
    filled = collect_values(frame)
    if filled.keys() != variables.keys():
        odd = ", ".join(sorted(filled.keys() ^ variables.keys()))
        raise RecordingError(f"{where}: {odd}: not in every frame; write it to another file")
    if intermediates.get_constants(frame.kept) != intermediates.get_constants(first.kept):
        raise RecordingError(f"{where}: kept waveforms are sampled otherwise than the first's; write to another file")
    ours, theirs = ({n: type(of).__name__ for n, of in f.observation.sensors.items()} for f in (frame, first))
    if ours != theirs:
        raise RecordingError(f"{where}: its sensors have other samples than the first's; write it to another file")
    entries = {}
    for path, value in filled.items():
        variable = variables[path]
        start = 1 if variable.is_series else 0
        if np.shape(value)[start:] != variable.shape[start:]:
            raise RecordingError(f"{where}: {path}: needs the shape {variable.shape}, not {np.shape(value)}")
        entries[path] = np.asarray(value, dtype=variable.spec.dtype, order="C")
    return entries


def pad_entries(entries: Mapping[str, np.ndarray], variables: Mapping[str, Variable]) -> dict[str, np.ndarray]:
    """Return entries with the samples of sensors padded to the length that their variables have.

    Parameters
    ----------
    entries : from `match_entries`
    """
    return {
        path: pad(value, variables[path].shape[0], variables[path].fill) if variables[path].is_series else value
        for path, value in entries.items()
    }


def pad_all(column: Iterable[np.ndarray], variable: Variable) -> list[np.ndarray]:
    """Return the entries of a variable of samples, padded to its length."""
    return [pad(values, variable.shape[0], variable.fill) for values in column]


def count_frame_bytes(variables: Mapping[str, Variable]) -> int:
    """Return the size of the arrays of one frame [bytes]."""
    return sum(variable.frame_bytes for variable in variables.values())


def to_json(attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Convert attributes to types that JSON holds."""
    return {
        name: value.tolist() if isinstance(value, np.ndarray | np.generic) else value
        for name, value in attributes.items()
    }

"""The manifest of a dataset: one line for each finished shard, with its hash."""

from __future__ import annotations

import json
import os
import re
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import BinaryIO

from rso_lidar.dataset.specification.tables import SPLITS
from rso_lidar.errors import DatasetError, RunError
from rso_lidar.files import advise_on_write, hold_lock

MANIFEST = "manifest.jsonl"
_SHARD = re.compile(rf"({'|'.join(SPLITS)})/\d{{6,}}\.h5")  # no other path, such as one out of the folder, is accepted
_LONGEST_LINE = 2**16  # bytes; a line is some 400 long
_LOCK_WAIT_S = 60.0  # appending a line takes milliseconds


@dataclass(frozen=True)
class ShardRecord:
    """One finished shard: its path in the folder, its frames, bytes and SHA-256, and the versions that made it."""

    path: str
    frames: int
    samples: int
    size_bytes: int
    sha256: str
    versions: str


def read_manifest(folder: Path, dataset: str) -> dict[str, ShardRecord]:
    """Read the records of finished shards, by path.

    Parameters
    ----------
    dataset : hash of the dataset that the lines must belong to

    Raises
    ------
    DatasetError
        For a damaged line. An incomplete last line, as a killed run may leave, is ignored.
    """
    place = folder / MANIFEST
    try:
        lines = place.read_bytes().split(b"\n")
    except FileNotFoundError:
        return {}
    except OSError as error:
        raise DatasetError(f"{place}: cannot be read ({error.strerror}); check the folder") from None
    records: dict[str, ShardRecord] = {}
    for number, line in enumerate(lines[:-1], 1):
        try:
            record = json.loads(line)
            of = record.pop("dataset")
            records[record["path"]] = _check_record(ShardRecord(**record))
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
            raise DatasetError(f"{place}: line {number} is damaged; delete the line, and make with --resume") from None
        if of != dataset:
            raise DatasetError(f"{place}: line {number} belongs to another dataset; choose another folder")
    return records


def _check_record(record: ShardRecord) -> ShardRecord:
    """Return a record, or raise an error if its path is no shard's, a count is not positive, or versions are no table."""
    counts = (record.frames, record.samples, record.size_bytes)
    if not _SHARD.fullmatch(record.path) or any(type(count) is not int or count < 1 for count in counts):
        raise ValueError(record.path)
    for version in json.loads(record.versions).values():
        if not isinstance(version, str):
            raise ValueError(record.versions)
    return record


def append_record(folder: Path, record: ShardRecord, dataset: str) -> None:
    """Append the record of a finished shard, and flush it to the disk."""
    place = folder / MANIFEST
    line = json.dumps({"dataset": dataset, **asdict(record)}) + "\n"
    with hold_lock(folder / f".{MANIFEST}.lock", wait_s=_LOCK_WAIT_S):
        try:
            with place.open("a+b") as stream:
                stream.truncate(_find_whole_lines(stream))
                stream.write(line.encode())
                stream.flush()
                os.fsync(stream.fileno())
        except OSError as error:
            raise RunError(
                f"{place}: cannot be written ({error.strerror}); {advise_on_write(error.errno)} and make with --resume"
            ) from error


def _find_whole_lines(stream: BinaryIO) -> int:
    """Return the length [bytes] of a file up to the end of its last complete line. Only the file's end is read."""
    size = stream.seek(0, os.SEEK_END)
    stream.seek(max(0, size - _LONGEST_LINE))
    tail = stream.read()
    return size - len(tail) + tail.rfind(b"\n") + 1

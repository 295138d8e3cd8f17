"""A dataset in a folder: splits with random access to their frames, as NumPy arrays."""

from __future__ import annotations

import os
from collections import OrderedDict
from collections.abc import Iterable, Sequence
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import numpy as np

from rso_lidar.dataset.reading.contest_key import CONTEST_SPLIT, HASHES
from rso_lidar.dataset.shards.manifest import ShardRecord, read_manifest
from rso_lidar.dataset.shards.sensor_file import Constants, read_constants
from rso_lidar.dataset.shards.shard_file import hash_file, open_shard
from rso_lidar.dataset.specification.spec import DatasetSpec
from rso_lidar.errors import DatasetError, did_you_mean
from rso_lidar.export import check_declared_size
from rso_lidar.files import convert_path, explain_unreadable
from rso_lidar.records import Symmetry

SPEC_FILE = "dataset.toml"
_IMAGE_DIMENSIONS = 3  # of an array of images, with the frame
_MOST_OPEN = 512  # shards of a split that are kept open in a process, where the system allows twice as many files
_CACHE = 2**28  # bytes of images that libhdf5 may keep for each array of a split, over all open shards
_MOST_KNOWN = 4096  # shards whose numbers stay in memory: 2 kB for each column and shard of 256 frames


class Dataset:
    """A dataset in a folder, read on demand. It can be pickled; each process opens files of its own.

    Parameters
    ----------
    folder : folder that `rso-lidar dataset make` wrote
    verify : whether each process compares a shard with its hash before it first reads it. Damaged HDF5 files may have
        other numbers than were written, or never end a call of libhdf5. Hashing reads the whole shard, about 1 GB/s

    Raises
    ------
    DatasetError
        If the folder is no dataset, or a file in it is damaged.
    """

    def __init__(self, folder: str | os.PathLike[str], *, verify: bool = True) -> None:
        self._verify = verify
        self.folder = convert_path(folder, DatasetError)
        self.constants: Constants = read_constants(self.folder)
        records = read_manifest(self.folder, self.constants.sha256)
        self._records = {
            split: tuple(records[path] for path in sorted(records) if path.startswith(f"{split}/"))
            for split in self.constants.splits
        }

    def __repr__(self) -> str:
        """Return title, frames and splits."""
        sizes = ", ".join(f"{len(self.split(name)):,} {name}" for name in self.splits)
        return f"<Dataset {self.constants.title!r}: {sizes}>"

    @cached_property
    def spec(self) -> DatasetSpec:
        """Specification that made the dataset."""
        return DatasetSpec.load(self.folder / SPEC_FILE)

    @property
    def classes(self) -> tuple[str, ...]:
        """Names of the classes, which `class_id` numbers."""
        return self.constants.classes

    @property
    def models(self) -> tuple[str, ...]:
        """Names of the models, which `model_id` numbers."""
        return self.constants.models

    @property
    def sensors(self) -> tuple[str, ...]:
        """Names of the sensors, which `sensor_id` numbers."""
        return self.constants.sensors

    @property
    def cameras(self) -> tuple[str, ...]:
        """Names of the cameras beside the lidar. Their arrays are named ``camera.<name>.<field>``."""
        return tuple(self.constants.cameras.get(self.sensors[0], {}))

    @property
    def part_classes(self) -> tuple[str, ...]:
        """Names of the common part classes, which `part_class_id` numbers."""
        return self.constants.part_classes

    @property
    def keypoints(self) -> tuple[tuple[str, ...], ...]:
        """Names of the keypoints of each model, in the order of `keypoint_px`; empty where they are no labels."""
        return tuple(self.constants.model_keypoints.get(name, ()) for name in self.models)

    @property
    def symmetries(self) -> tuple[Symmetry | None, ...]:
        """Symmetry of each model, in the axes of `quaternion_xyzw`; None where a lidar can tell all attitudes apart."""
        tables = self.constants.symmetries
        return tuple(Symmetry(**tables[name]) if tables[name] else None for name in self.models)

    @property
    def splits(self) -> tuple[str, ...]:
        """Names of the splits that hold frames."""
        return tuple(name for name in self.constants.splits if self._records[name])

    @property
    def labelled_splits(self) -> tuple[str, ...]:
        """Names of the splits whose frames have labels: all, but for the test of a contest."""
        hidden = (CONTEST_SPLIT,) if (self.folder / HASHES).is_file() else ()
        return tuple(name for name in self.splits if name not in hidden)

    @property
    def records(self) -> tuple[ShardRecord, ...]:
        """Records of all shards."""
        return tuple(record for records in self._records.values() for record in records)

    def split(self, name: str) -> Split:
        """Return one split.

        Parameters
        ----------
        name : train, val or test

        Raises
        ------
        DatasetError
            If the dataset has no such split.
        """
        if not self._records.get(name):
            known = ", ".join(self.splits)
            raise DatasetError(
                f"{self.folder}: has no split '{name}'{did_you_mean(name, self.splits)} (known: {known})"
            )
        return Split(self.folder, name, self.constants.sha256, self._records[name], verify=self._verify)


class Split:
    """The frames of one split, in the order of their shards. It can be pickled; each process opens files of its own."""

    def __init__(
        self, folder: Path, name: str, dataset: str, records: Sequence[ShardRecord], *, verify: bool = True
    ) -> None:
        """Make a split of its shards.

        Parameters
        ----------
        folder : of the dataset
        name : of the split
        dataset : hash of the dataset
        records : of the shards
        verify : whether shards are compared with their hashes, as in `Dataset`
        """
        self._verify = verify
        self.folder, self.name, self._dataset, self.records = folder, name, dataset, tuple(records)
        self.ends = np.cumsum([record.frames for record in records])
        self._forget()

    def _forget(self) -> None:
        self._files: OrderedDict[int, tuple[Any, dict[str, Any]]] = OrderedDict()  # the most recently used last
        self._numbers: OrderedDict[int, dict[str, np.ndarray]] = OrderedDict()
        self._process = os.getpid()

    def __getstate__(self) -> dict[str, Any]:
        """Return what another process needs, without open files."""
        return {key: value for key, value in self.__dict__.items() if key not in ("_files", "_numbers", "_process")}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._forget()

    def __len__(self) -> int:
        return int(self.ends[-1]) if len(self.ends) else 0

    def __repr__(self) -> str:
        """Return name, frames and shards."""
        return f"<Split {self.name!r}: {len(self):,} frames, shards: {len(self.records):,}>"

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of all arrays."""
        file, _ = self._open(0)
        try:
            return tuple(sorted(file))
        except (OSError, KeyError, RuntimeError) as error:
            raise self._describe_damage(0, "the list of arrays", error) from None

    def _open(self, shard: int) -> tuple[Any, dict[str, Any]]:
        """Return an open shard, and the images of it that were used so far, by name."""
        if self._process != os.getpid():  # a forked process must not share the position in a file
            self._forget()
        if shard not in self._files:
            if len(self._files) >= _limit_open_shards():
                self._files.popitem(last=False)  # no reference is left; `close` would search all objects of all files
            self._files[shard] = self._open_whole(shard), {}
        self._files.move_to_end(shard)
        return self._files[shard]

    def _open_whole(self, shard: int) -> Any:
        """Open a shard; the first time, check its hash, and that it has as many frames as its record states."""
        record = self.records[shard]
        path = self.folder / record.path
        if self._verify:
            _compare_with_hash(path, record)
        is_known = shard in self._numbers
        each = _CACHE // min(len(self.records), _limit_open_shards())
        file = open_shard(path, None if is_known else self._dataset, each)
        if is_known:
            return file
        try:
            count = len(file["sample"])
        except (OSError, RuntimeError, KeyError, TypeError):
            count = 0
        if count != record.frames:
            file.close()
            raise DatasetError(
                f"{path}: has {count} frames, and the manifest says {record.frames}; delete the shard and make again with "
                "--resume"
            )
        if len(self._numbers) >= _MOST_KNOWN:
            self._numbers.popitem(last=False)
        self._numbers[shard] = {}
        return file

    def _array(self, shard: int, name: str) -> Any:
        """Return an array of a shard: an h5py dataset of images, or the values of smaller entries.

        Numbers stay in memory after the shard is closed, so that opening it again costs less.
        """
        if self._process == os.getpid() and name in self._numbers.get(shard, ()):
            self._numbers.move_to_end(shard)
            return self._numbers[shard][name]
        file, images = self._open(shard)
        if name not in images:
            try:
                stored = file[name]
                check_declared_size(stored)
                if stored.ndim < _IMAGE_DIMENSIONS:
                    values = self._numbers.setdefault(shard, {})[name] = stored[()]
                    return values
            except (OSError, KeyError, RuntimeError) as error:
                if name in self.names:
                    raise self._describe_damage(shard, name, error) from None
                raise DatasetError(
                    f"{self.folder}: the shards have no array '{name}'{did_you_mean(name, self.names)}; "
                    "optional labels are switched on in [labels] of the specification"
                ) from None
            images[name] = stored
        return images[name]

    def __getitem__(self, index: int) -> dict[str, np.ndarray]:
        """Return all arrays of one frame."""
        return {name: values[0] for name, values in self.read([index], self.names).items()}

    def read(self, indices: Iterable[int], names: Iterable[str]) -> dict[str, np.ndarray]:
        """Read some frames, in any order.

        Parameters
        ----------
        indices : of the frames
        names : of the arrays

        Returns
        -------
        Arrays by name, each with the frame as its first dimension.

        Raises
        ------
        DatasetError
            For an index beyond the split, an array that it does not have, and a damaged shard.
        """
        rows = np.asarray(list(indices))
        if rows.size and (rows.dtype.kind not in "iu" or rows.min() < -len(self) or rows.max() >= len(self)):
            raise IndexError(f"{self!r}: has no frame {rows.max() if rows.dtype.kind in 'iu' else rows[0]}")
        rows = np.where(rows < 0, rows + len(self), rows).astype(np.int64)
        shards = np.searchsorted(self.ends, rows, side="right")
        starts = np.concatenate(([0], self.ends))[shards] if rows.size else rows
        arrays: dict[str, np.ndarray] = {}
        for name in names:
            pieces = [
                self._read(int(shard), name, int(row - start))
                for shard, row, start in zip(shards, rows, starts, strict=True)
            ]
            arrays[name] = np.stack(pieces) if pieces else self._array(0, name)[:0]
        return arrays

    def _read(self, shard: int, name: str, row: Any) -> np.ndarray:
        """Read entries of an array of a shard."""
        try:
            values: np.ndarray = self._array(shard, name)[row]
        except (OSError, KeyError, RuntimeError) as error:  # of data, and of the names in the file
            raise self._describe_damage(shard, name, error) from None
        return values

    def _describe_damage(self, shard: int, name: str, error: Exception) -> DatasetError:
        """Return the error of an array that cannot be read."""
        return DatasetError(
            f"{self.folder / self.records[shard].path}: {name} is damaged "
            f"({' '.join(str(error).split()):.120}); delete the shard and make again with --resume"
        )

    def read_shard(self, shard: int, names: Iterable[str], rows: slice = slice(None)) -> dict[str, np.ndarray]:
        """Read consecutive frames of one shard at once.

        All other shards are closed, so that a pass over all shards needs the memory of one.

        Parameters
        ----------
        shard : number of the shard in `records`
        names : of the arrays
        rows : the frames, by their place in the shard

        Returns
        -------
        Arrays by name, each with the frame as its first dimension.
        """
        self._open(shard)
        for other in [number for number in self._files if number != shard]:
            self._files.pop(other)[0].close()
        for other in [number for number in self._numbers if number != shard]:
            del self._numbers[other]
        return {name: self._read(shard, name, rows) for name in names}

    def column(self, name: str) -> np.ndarray:
        """Read one array of all frames. Images of a large split need much memory.

        Parameters
        ----------
        name : of the array

        Returns
        -------
        The array, with the frame as its first dimension.
        """
        return np.concatenate([self._read(shard, name, slice(None)) for shard in range(len(self.records))])


@cache
def _limit_open_shards() -> int:
    """Return how many shards a split keeps open: half of the files that the system allows a process, at most."""
    try:
        import resource
    except ImportError:  # Windows
        return _MOST_OPEN
    allowed, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    return _MOST_OPEN if allowed < 0 else max(1, min(_MOST_OPEN, allowed // 2))


_verified: dict[Path, tuple[str, int, int]] = {}  # hash, time of the last change and size of files that were compared


def _compare_with_hash(path: Path, record: ShardRecord) -> None:
    """Raise `DatasetError` if a shard differs from its hash. A file is hashed again only after it has changed."""
    try:
        status = path.stat()
        known = record.sha256, status.st_mtime_ns, status.st_size
        if _verified.get(path) == known:
            return
        differs = status.st_size != record.size_bytes or hash_file(path) != record.sha256
    except FileNotFoundError:
        return  # opening says so
    except OSError as error:
        raise DatasetError(explain_unreadable(path, error)) from None
    if differs:
        raise DatasetError(
            f"{path}: differs from its hash in the manifest; delete the shard and make again with --resume"
        )
    _verified[path] = known


def open_dataset(folder: str | os.PathLike[str], *, verify: bool = True) -> Dataset:
    """Open a dataset.

    Parameters
    ----------
    folder : folder that `rso-lidar dataset make` wrote
    verify : whether each process compares a shard with its hash before it first reads it

    Returns
    -------
    Dataset

    Raises
    ------
    DatasetError
        If the folder is no dataset, or a file in it is damaged.
    """
    return Dataset(folder, verify=verify)

"""An open recording file, HDF5 or Zarr, with its structure checked and its datasets by path."""

from __future__ import annotations

import contextlib
import json
import operator
import re
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any, Self

import numpy as np

from rso_lidar.errors import RecordingError, join_problems
from rso_lidar.export.layout import camera_images, intermediates
from rso_lidar.export.layout.checksum import compute_texts_crc32
from rso_lidar.export.layout.datasets import INERTIAL, LABELS, NODE, POINTING, READING
from rso_lidar.export.layout.target_table import read_targets
from rso_lidar.export.reader.hdf5_checks import check_declared_size
from rso_lidar.export.reader.hdf5_file import TEMPORARY, open_hdf5
from rso_lidar.export.reader.zarr_file import SUFFIX, open_zarr
from rso_lidar.records import SCHEMA_VERSION, Source

_NUMBERS = "fiub"  # kinds of the types of all datasets


class RecordingFile:
    """An open recording file: what holds for all frames, and datasets that are at least as long as /time.

    `complete` is False for the temporary file of a running or killed simulation. Such a file has the frames that were
    complete when it was opened.
    """

    def __init__(self, path: str | Path) -> None:
        """Open a recording and check its structure.

        Parameters
        ----------
        path : of an HDF5 file or a Zarr store

        Raises
        ------
        RecordingError
            If there is no recording at the path, or it is damaged.
        """
        self.path = Path(path)
        self._absolute = self.path.absolute()  # for another process, whose working folder may differ
        self.complete = TEMPORARY.search(self.path.name) is None
        zarr = self.path.suffix.lower() == SUFFIX
        self._is_hdf5 = not zarr
        self._file: Any = open_zarr(self.path) if zarr else open_hdf5(self.path, swmr=not self.complete)
        try:
            with self.watched():
                self._check()
        except BaseException:
            self.close()
            raise

    def __reduce__(self) -> tuple[Any, ...]:
        """Describe the recording to another process, which opens the file again.

        Raises
        ------
        RecordingError
            If the file is closed.
        """
        if not self._file:
            raise RecordingError(f"{self.path}: is closed; open it again")
        return _reopen, (type(self), self._absolute, self._count)

    def __len__(self) -> int:
        return self._count

    def place(self, k: Any) -> int:
        """Return the index of a frame, counted from the end if negative; raise `IndexError` if there is no such frame.

        Parameters
        ----------
        k : any integer
        """
        place = operator.index(k)
        if not -len(self) <= place < len(self):
            raise IndexError(f"{self.path}: there is no frame {place}; it has {len(self)}")
        return place % len(self)

    @property
    def changes_lens(self) -> bool:
        """Whether the recording has lines of sight of several lenses."""
        return "lens" in self._datasets

    @property
    def paths(self) -> Collection[str]:
        """Paths of all datasets with an entry for each frame."""
        return self._datasets.keys()

    def handle(self, path: str) -> Any:
        """Return the h5py dataset or Zarr array at a path; errors of its library are not translated.

        Parameters
        ----------
        path : such as ``range``

        Raises
        ------
        RecordingError
            If the file is closed or has no such dataset.
        """
        if not self._file:
            raise RecordingError(f"{self.path}: is closed; open it again")
        if path not in self._datasets:
            raise RecordingError(f"{self.path}: there is no dataset {path} in it")
        return self._datasets[path]

    def read(self, path: str, key: Any) -> Any:
        """Read part of a dataset; raise `RecordingError` if the dataset is missing or damaged.

        Parameters
        ----------
        path : of the dataset, such as ``range``
        key : index, slice or tuple of them, as in h5py

        Returns
        -------
        ndarray or scalar
            The selected values.
        """
        with self.watched(path):
            return self.handle(path)[key]

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    @contextlib.contextmanager
    def watched(self, what: str = "") -> Iterator[None]:
        """Convert errors of h5py and Zarr in this context to a `RecordingError` that names a dataset.

        Parameters
        ----------
        what : path of the dataset; empty for the whole file

        Yields
        ------
        None
        """
        place = f"{self.path}: {what}" if what else f"{self.path}"
        try:
            yield
        except RecordingError:
            raise
        except (OSError, RuntimeError, KeyError, ValueError, TypeError, IndexError, AttributeError) as error:
            why = " ".join(str(error).split())[:120]
            raise RecordingError(f"{place}: is damaged ({why}); copy or record it again") from error

    # ------------------------------------------------------------------------------------------------------ the inside

    def _check(self) -> None:
        """Read what holds for all frames, and check that all datasets exist and are long enough."""
        attributes = self._file.attrs
        if "schema_version" not in attributes or "rso_lidar_version" not in attributes:
            raise RecordingError(
                f"{self.path}: holds arrays but is not a recording of rso_lidar; give one made by `run`"
            )
        schema = int(attributes["schema_version"])
        if schema > SCHEMA_VERSION:
            version = attributes["rso_lidar_version"]
            raise RecordingError(
                f"{self.path}: is of schema {schema}, by rso_lidar {version}; this one reads up to schema "
                f"{SCHEMA_VERSION}: upgrade rso_lidar"
            )
        self._need("truth")
        stated = self._file["truth"].attrs.get("texts_crc32")
        if stated is not None and int(stated) != compute_texts_crc32(self._file):
            raise RecordingError(
                f"{self.path}: is damaged (texts in its attributes differ from their checksum texts_crc32); copy or record "
                "it again"
            )
        self.source = self._source()
        self._need("time", "frame_index", "line_of_sight", "truth/sun_direction")
        self._parents: dict[str, str] = json.loads(self._file["truth"].attrs["tree"])
        self._states: list[str] = json.loads(self._file["truth"].attrs["states"])
        self._settings = list(self._file["settings"]) if "settings" in self._file else []
        self._ptu = "ptu" in self._file
        optional: list[str] = json.loads(attributes.get("optional_datasets", "[]"))
        self._sunlit = [match[1] for path in optional if (match := re.fullmatch("truth/(.+)/sunlit", path))]
        groups = [group for group in intermediates.RECORDS if any(path.startswith(f"{group}/") for path in optional)]
        self.kept = tuple(groups)  # names of the intermediate records that it holds
        self.cameras = tuple(camera_images.list_cameras(optional))  # names of the cameras of which it holds images
        paths = ["time", "frame_index", *READING, *LABELS, "truth/sun_direction", *optional]
        paths += [f"truth/{name}/{path}" for name in self._parents for path in NODE]
        paths += [f"truth/{name}/{path}" for name in self._states for path in INERTIAL]
        paths += [f"settings/{name}" for name in self._settings]
        paths += [path for path, _, _ in POINTING] if self._ptu else []
        self._need(*paths)
        self._datasets = {path: self._file[path] for path in paths}
        for dataset in (*self._datasets.values(), self._file["line_of_sight"]):
            if dataset.dtype.kind not in _NUMBERS:
                raise ValueError(f"{dataset.name} holds {dataset.dtype}, not numbers")
            if self._is_hdf5:
                check_declared_size(dataset)
        self._constants = {
            group: {name: float(self._file[group].attrs[name]) for name in intermediates.CONSTANTS.get(group, ())}
            for group in self.kept
        }
        self.sensors_text: str = attributes.get("sensors", "{}")
        self._count = int(self._datasets["time"].shape[0])
        for path, dataset in self._datasets.items():
            if dataset.shape[0] < self._count:
                raise RecordingError(f"{self.path}: {path} ends before /time; copy or record it again")
        self._sight: tuple[int, np.ndarray] | None = None
        if not self.changes_lens:
            self._sight_of(0)

    def _need(self, *paths: str) -> None:
        missing = [path for path in paths if path not in self._file]
        if missing:
            what = f"dataset {missing[0]} is" if len(missing) == 1 else f"datasets {join_problems(missing, ', ')} are"
            raise RecordingError(f"{self.path}: the {what} missing; copy or record it again")

    def _source(self) -> Source:
        attributes = self._file.attrs
        return Source(
            scenario=attributes["scenario"],
            title=attributes["title"],
            start_utc=attributes["start_utc"],
            seed=int(attributes["seed"]),
            versions=json.loads(attributes["versions"]),
            targets=read_targets(json.loads(attributes["targets"])),
        )

    def _sight_of(self, number: int) -> np.ndarray:
        """Return the line of sight (row, col, xyz) of one lens."""
        if self._sight is None or self._sight[0] != number:
            with self.watched("line_of_sight"):
                tables = self._file["line_of_sight"]
                self._sight = number, tables[_check_index(number, tables.shape[0])] if self.changes_lens else tables[:]
        return self._sight[1]


def _reopen(kind: type[RecordingFile], path: Path, count: int) -> RecordingFile:
    """Open a recording in another process, with the frames that the first process saw.

    Raises
    ------
    RecordingError
        If the file has fewer frames, or cannot be opened.
    """
    again = kind(path)
    if len(again) < count:
        held = len(again)
        again.close()
        raise RecordingError(f"{path}: has {held} frames and had {count} in another process; open it again")
    again._count = count
    return again


def _check_index(number: int, count: int) -> int:
    """Return the number of a table; raise an `IndexError` where there is no such table."""
    if not 0 <= number < count:
        raise IndexError(f"no line of sight {number} among {count}")
    return number

"""An HDF5 recording read back: frames one by one, and arrays of which only what is asked for is read."""

from __future__ import annotations

import contextlib
import difflib
import json
import operator
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import SimpleNamespace, TracebackType
from typing import Any, Self, overload

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from rso_lidar.errors import RecordingError
from rso_lidar.export.hdf5_layout import FRAMES_PER_CHUNK, INERTIAL, NODE, POINTING, READING
from rso_lidar.pose import Link, PoseTree
from rso_lidar.records import (
    SCHEMA_VERSION,
    BodyState,
    Frame,
    Labels,
    Observation,
    PtuAngles,
    Reading,
    Source,
    TargetEntry,
    Truth,
    specs,
)

TEMPORARY = re.compile(r"\.tmp-[0-9a-zA-Z]+(\.starting)?$")

SUPERBLOCK_BYTES = 48


class Stored:
    """One dataset of a recording, indexed like a numpy array whose first axis is time; only those frames are read."""

    def __init__(self, recording: Recording, path: str, dtype: Any = None) -> None:
        self._recording, self._path = recording, path
        dataset = recording.dataset(path)
        self.shape: tuple[int, ...] = (len(recording), *dataset.shape[1:])
        self.dtype = np.dtype(dtype or dataset.dtype)
        self.ndim = len(self.shape)

    def __len__(self) -> int:
        return self.shape[0]

    def __repr__(self) -> str:
        return f"<{self._path} of {self._recording.path.name}: {self.shape} {self.dtype}>"

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        if copy is False:
            raise ValueError(f"{self._path}: is read from a file, which makes a copy")
        return np.asarray(self[:], dtype=dtype)

    def __getitem__(self, key: Any) -> Any:
        keys = key if isinstance(key, tuple) else (key,)
        first, rest = (keys[0], keys[1:]) if keys else (slice(None), ())
        if isinstance(first, slice):
            wanted = range(*first.indices(len(self)))
            low, high = (min(wanted), max(wanted) + 1) if wanted else (0, 0)
            step = abs(wanted.step)
            block = self._read(slice(low, high, step))
            return block[(slice(None, None, 1 if wanted.step > 0 else -1), *rest)]
        if first is Ellipsis or first is None or np.ndim(first) > 1:
            return self._read(slice(0, len(self)))[key]
        if np.ndim(first) == 0 and not isinstance(first, bool | np.bool_):
            k = self._recording.place(first)
            return self._read(slice(k, k + 1))[(0, *rest)]
        # A list or array of frames (or a mask): read each frame once, then let numpy arrange.
        places = np.arange(len(self))[first]
        frames, inverse = np.unique(places, return_inverse=True)
        blocks = [self._read(slice(k, k + 1)) for k in frames.tolist()]
        block = np.concatenate(blocks) if blocks else self._read(slice(0, 0))
        return block[(inverse.reshape(places.shape), *rest)]

    def _read(self, frames: slice) -> np.ndarray:
        with self._recording.watched():
            block: np.ndarray = self._recording.dataset(self._path)[frames]
        return block.astype(self.dtype, copy=False)


class Frames(Sequence[Frame]):
    """Some frames of a recording, read when asked for."""

    def __init__(self, recording: Recording, places: range) -> None:
        self._recording, self._places = recording, places

    def __len__(self) -> int:
        return len(self._places)

    @overload
    def __getitem__(self, k: int) -> Frame: ...
    @overload
    def __getitem__(self, k: slice) -> Frames: ...
    def __getitem__(self, k: int | slice) -> Frame | Frames:
        if isinstance(k, slice):
            return Frames(self._recording, self._places[k])
        return self._recording[self._places[k]]


class Recording(Sequence[Frame]):
    """A recording: a sequence of frames, and arrays (time, row, col) that are read piece by piece.

    A temporary file, of a run that goes on or was killed, is read like a finished one, as far as it had come when it
    was opened; `complete` is False then.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self.complete = TEMPORARY.search(self.path.name) is None
        self._file = _opened(self.path, swmr=not self.complete)
        self._rows: dict[str, tuple[int, np.ndarray]] = {}
        try:
            with self.watched():
                self._check()
        except BaseException:
            self.close()
            raise

    # ---------------------------------------------------------------------------------------------------- as a sequence

    def __len__(self) -> int:
        return self._count

    @overload
    def __getitem__(self, k: int) -> Frame: ...
    @overload
    def __getitem__(self, k: slice) -> Frames: ...
    def __getitem__(self, k: int | slice) -> Frame | Frames:
        if isinstance(k, slice):
            return Frames(self, range(len(self))[k])
        place = self.place(k)
        with self.watched():
            return self._frame(place)

    def __iter__(self) -> Iterator[Frame]:
        return (self[k] for k in range(len(self)))

    def place(self, k: Any) -> int:
        """Return the place of frame k, counted from the end where k is negative."""
        place = operator.index(k)
        if not -len(self) <= place < len(self):
            raise IndexError(f"{self.path}: there is no frame {place}; it has {len(self)}")
        return place % len(self)

    # ----------------------------------------------------------------------------------------------------- as arrays

    @property
    def range_m(self) -> Stored:
        """Return the measured ranges (time, row, col) [m], NaN where nothing came back."""
        return Stored(self, "range")

    @property
    def intensity_counts(self) -> Stored:
        """Return the measured intensities (time, row, col) [counts], 0 where nothing came back."""
        return Stored(self, "intensity")

    @property
    def saturated(self) -> Stored:
        """Return where the intensity clipped (time, row, col), as bool."""
        return Stored(self, "saturated", bool)

    @property
    def time_s(self) -> Stored:
        """Return the instants of emission (time) [s since start_utc]."""
        return Stored(self, "time")

    @property
    def frame_index(self) -> Stored:
        """Return the number (time) of each frame in its scenario."""
        return Stored(self, "frame_index")

    @property
    def labels(self) -> SimpleNamespace:
        """Return what was there, by name: ``recording.labels.target[10:20]``, (time, row, col)."""
        return SimpleNamespace(**{name: Stored(self, f"labels/{name}") for name in specs(Labels)})

    def dataset(self, path: str) -> Any:
        """Return the h5py dataset at a path of the file, such as ``truth/tdrs/position``."""
        if not self._file:
            raise RecordingError(f"{self.path}: is closed; open it again")
        if path not in self._datasets:
            raise RecordingError(f"{self.path}: there is no dataset {path} in it")
        return self._datasets[path]

    # ------------------------------------------------------------------------------------------------- open and close

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @contextlib.contextmanager
    def watched(self) -> Iterator[None]:
        """Turn what h5py raises over a damaged file into a `RecordingError`."""
        try:
            yield
        except RecordingError:
            raise
        except (OSError, RuntimeError, KeyError, ValueError, TypeError, IndexError, AttributeError) as error:
            what = " ".join(str(error).split())[:120]
            raise RecordingError(f"{self.path}: is damaged ({what}); copy or record it again") from error

    # ------------------------------------------------------------------------------------------------------ the inside

    def _check(self) -> None:
        """Read what is not per frame, and make sure that all else is there."""
        attributes = self._file.attrs
        if "schema_version" not in attributes or "rso_lidar_version" not in attributes:
            raise RecordingError(f"{self.path}: is an HDF5 file but no recording of rso_lidar; give one made by `run`")
        schema = int(attributes["schema_version"])
        if schema > SCHEMA_VERSION:
            version = attributes["rso_lidar_version"]
            raise RecordingError(
                f"{self.path}: is of schema {schema}, by rso_lidar {version}; this one reads up to schema "
                f"{SCHEMA_VERSION}: upgrade rso_lidar"
            )
        self.source = self._source()
        self._need("time", "frame_index", "line_of_sight", "truth", "truth/sun_direction")
        self._parents: dict[str, str] = json.loads(self._file["truth"].attrs["tree"])
        self._states: list[str] = json.loads(self._file["truth"].attrs["states"])
        self._settings = list(self._file["settings"]) if "settings" in self._file else []
        self._ptu = "ptu" in self._file
        paths = ["time", "frame_index", *READING, *(f"labels/{name}" for name in specs(Labels)), "truth/sun_direction"]
        paths += [f"truth/{name}/{path}" for name in self._parents for path in NODE]
        paths += [f"truth/{name}/{path}" for name in self._states for path in INERTIAL]
        paths += [f"settings/{name}" for name in self._settings]
        paths += [path for path, _, _ in POINTING] if self._ptu else []
        self._need(*paths)
        self._datasets = {path: self._file[path] for path in paths}
        self._count = len(self._datasets["time"])
        for path, dataset in self._datasets.items():
            if len(dataset) < self._count:
                raise RecordingError(f"{self.path}: {path} ends before /time; copy or record it again")
        self.line_of_sight: np.ndarray = self._file["line_of_sight"][:]

    def _need(self, *paths: str) -> None:
        missing = [path for path in paths if path not in self._file]
        if missing:
            more = f" (and {len(missing) - 1} more)" if len(missing) > 1 else ""
            raise RecordingError(f"{self.path}: the dataset {missing[0]} is missing{more}; copy or record it again")

    def _source(self) -> Source:
        attributes = self._file.attrs
        targets = [
            TargetEntry(**{**entry, "parts": tuple(entry["parts"]), "materials": tuple(entry["materials"])})
            for entry in json.loads(attributes["targets"])
        ]
        return Source(
            scenario=attributes["scenario"],
            title=attributes["title"],
            start_utc=attributes["start_utc"],
            seed=int(attributes["seed"]),
            versions=json.loads(attributes["versions"]),
            targets=tuple(targets),
        )

    def _row(self, path: str, k: int) -> np.ndarray:
        """Return one entry of a dataset of small vectors, which are read a chunk of frames at a time."""
        low = k - k % FRAMES_PER_CHUNK
        have = self._rows.get(path)
        if have is None or have[0] != low:
            have = low, self.dataset(path)[low : min(low + FRAMES_PER_CHUNK, self._count)]
            self._rows[path] = have
        entry: np.ndarray = have[1][k - low]
        return entry

    def _frame(self, k: int) -> Frame:
        time_s = float(self._row("time", k))
        reading = Reading(**{name: self.dataset(path)[k] for path, name in READING.items()})
        pointing = self._pointing(k)
        links = {name: self._link(f"truth/{name}", k) for name in self._parents}
        states = {
            name: BodyState(**{field: self._row(f"truth/{name}/{path}", k) for path, field in INERTIAL.items()})
            for name in self._states
        }
        observation = Observation(
            time_s=time_s,
            reading=reading,
            settings={name: float(self._row(f"settings/{name}", k)) for name in self._settings},
            line_of_sight=self.line_of_sight,
            pan_tilt_rad=None if pointing is None else pointing.measured_rad,
        )
        return Frame(
            index=int(self._row("frame_index", k)),
            observation=observation,
            labels=Labels(**{name: self.dataset(f"labels/{name}")[k] for name in specs(Labels)}),
            truth=Truth(time_s, PoseTree(self._parents, links), states, self._row("truth/sun_direction", k), pointing),
            source=self.source,
        )

    def _link(self, group: str, k: int) -> Link:
        rotation = Rotation.from_quat(self._row(f"{group}/parent_quaternion", k))
        return Link(
            RigidTransform.from_components(self._row(f"{group}/parent_position", k), rotation),
            self._row(f"{group}/velocity", k),
            self._row(f"{group}/angular_velocity", k),
        )

    def _pointing(self, k: int) -> PtuAngles | None:
        if not self._ptu:
            return None
        angles: dict[str, np.ndarray] = {name: np.zeros(2) for name in specs(PtuAngles)}
        for path, name, place in POINTING:
            angles[name][place] = self._row(path, k)
        return PtuAngles(**angles)


def _opened(path: Path, *, swmr: bool) -> Any:
    """Return the h5py file, or say in one line why it is none."""
    import h5py

    try:
        if path.is_dir():
            raise RecordingError(f"{path}: is a folder; name a recording in it")
        if not path.exists():
            raise RecordingError(f"{path}: there is no such file{_near(path)}")
        if not path.is_file():
            raise RecordingError(f"{path}: is not a regular file; give a recording made by `run`")
        with path.open("rb") as stream:
            head = stream.read(SUPERBLOCK_BYTES)
        if not h5py.is_hdf5(path):
            raise RecordingError(f"{path}: is not an HDF5 file, or is cut short; give a recording made by `run`")
        # The superblock (version 2 and 3) says after every flush where the file ends. HDF5 does not look there while a
        # file is marked as being written, and then reads zeros behind its end, or tries for ever.
        size = path.stat().st_size
        if size < SUPERBLOCK_BYTES or (head[8] >= 2 and size < int.from_bytes(head[28:36], "little")):
            raise RecordingError(f"{path}: is cut short; copy or record it again")
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read ({error.strerror}); check the name and its rights") from error
    try:
        return h5py.File(path, "r", swmr=swmr, locking="best-effort", rdcc_nbytes=2**20)
    except (OSError, RuntimeError) as error:
        if "h5clear" in str(error) or "already open" in str(error):
            raise RecordingError(f"{path}: is still being written, or its run was killed; wait or resume") from error
        what = " ".join(str(error).split())[:120]
        raise RecordingError(f"{path}: is damaged ({what}); copy or record it again") from error


def _near(path: Path) -> str:
    """Return a hint at an unfinished recording of that name, or at the nearest name in the folder."""
    if not path.parent.is_dir():
        return f"; there is no folder {path.parent} either"
    names = sorted(entry.name for entry in path.parent.iterdir())
    unfinished = [name for name in names if name.startswith(f"{path.name}.tmp-") and not name.endswith(".starting")]
    if unfinished:
        return f", only the unfinished {unfinished[0]}: open that, or go on with --resume"
    near = difflib.get_close_matches(path.name, names, n=1, cutoff=0.6)
    return f"; did you mean '{near[0]}'?" if near else "; record it first"

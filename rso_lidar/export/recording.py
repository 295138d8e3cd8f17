"""A recording read back, from HDF5 or Zarr: frames one by one, and arrays of which only what is asked for is read."""

from __future__ import annotations

import contextlib
import json
import operator
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import SimpleNamespace, TracebackType
from typing import Any, Self, overload

import numpy as np

from rso_lidar.errors import RecordingError, RsoLidarError
from rso_lidar.export import kept
from rso_lidar.export.checksum import texts_crc32
from rso_lidar.export.datasets import (
    INERTIAL,
    LABELS,
    MORE_LABELS,
    NODE,
    POINTING,
    READING,
    RETURNS,
)
from rso_lidar.export.hdf5_file import TEMPORARY, opened
from rso_lidar.export.stored import Frames, Stored
from rso_lidar.export.targets import targets
from rso_lidar.export.zarr_file import SUFFIX, opened_zarr
from rso_lidar.pose import Link, PoseTree
from rso_lidar.records import (
    SCHEMA_VERSION,
    BodyState,
    Frame,
    Labels,
    Observation,
    PtuAngles,
    Reading,
    Record,
    Source,
    Truth,
    specs,
)

_READ_AT_ONCE = 128  # frames of small vectors, which are kept until another one is asked for


class Recording(Sequence[Frame]):
    """A recording: a sequence of frames, and arrays (time, row, col) that are read piece by piece.

    A temporary file, of a run that goes on or was killed, is read like a finished one, as far as it had come when it
    was opened; `complete` is False then.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self.complete = TEMPORARY.search(self.path.name) is None
        zarr = self.path.suffix.lower() == SUFFIX
        self._file: Any = opened_zarr(self.path) if zarr else opened(self.path, swmr=not self.complete)
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

    def __repr__(self) -> str:
        """Return the file, how many frames it holds, and their instants."""
        count = len(self)
        frames = f"{count} frame{'s' * (count != 1)}" + ("" if self.complete else " so far")
        span = ""
        with contextlib.suppress(RsoLidarError, OSError, RuntimeError, ValueError):  # it may have been closed
            span = f", {self.time_s[0]:g} to {self.time_s[-1]:g} s" if count else ""
        return f"<Recording {self.path.name}: {frames}{span}>"

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
        return self._named(LABELS | MORE_LABELS)

    @property
    def returns(self) -> SimpleNamespace:
        """Return what was measured of all returns of a pixel, as range_m and intensity_counts (time, row, col, return)."""
        self._need_kept("returns")
        return self._named({path: name.removeprefix("return_") for path, name in RETURNS.items()})

    @property
    def waveforms(self) -> SimpleNamespace:
        """Return samples_counts (time, row, col, sample), start_s, latch_s, and the numbers sample_s, baseline_counts."""
        return self._kept_arrays("waveforms")

    @property
    def photons(self) -> SimpleNamespace:
        """Return the photon images (time, row, col): photons, and background_photons_per_s where there is background."""
        return self._kept_arrays("photons")

    @property
    def oversampled(self) -> SimpleNamespace:
        """Return the images on the grid of rays (time, fine_row, fine_col): range_m and photons."""
        return self._kept_arrays("oversampled")

    @property
    def changes_lens(self) -> bool:
        """Return whether the recording has a line of sight for each of several lenses."""
        return "lens" in self._datasets

    @property
    def lens(self) -> Stored:
        """Return which of the lines of sight each frame (time) was seen along, where the lens changes."""
        return Stored(self, "lens")

    @property
    def line_of_sight(self) -> np.ndarray:
        """Return unit vectors (row, col, xyz) in lidar axes; where the lens changes (lens_number, row, col, xyz)."""
        if not self.changes_lens:
            return self._sight_of(0)
        lenses = self.lens[:]
        with self.watched("line_of_sight"):
            tables: np.ndarray = self._file["line_of_sight"][: int(lenses.max(initial=-1)) + 1]
        return tables

    def dataset(self, path: str) -> Stored:
        """Return the array at a path of the file, such as ``truth/tdrs/position``, with its attributes."""
        return Stored(self, path)

    def handle(self, path: str) -> Any:
        """Return the h5py dataset (of a Zarr store the array) at a path; what it raises is its library's."""
        if not self._file:
            raise RecordingError(f"{self.path}: is closed; open it again")
        if path not in self._datasets:
            raise RecordingError(f"{self.path}: there is no dataset {path} in it")
        return self._datasets[path]

    def read(self, path: str, key: Any) -> Any:
        """Return what an index selects of a dataset; damage there is an error that names the dataset."""
        with self.watched(path):
            return self.handle(path)[key]

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
    def watched(self, what: str = "") -> Iterator[None]:
        """Turn what h5py raises over a damaged file into a `RecordingError`; `what` names the dataset that is read."""
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
        """Read what is not per frame, and make sure that all else is there."""
        attributes = self._file.attrs
        if "schema_version" not in attributes or "rso_lidar_version" not in attributes:
            raise RecordingError(f"{self.path}: holds arrays but is no recording of rso_lidar; give one made by `run`")
        schema = int(attributes["schema_version"])
        if schema > SCHEMA_VERSION:
            version = attributes["rso_lidar_version"]
            raise RecordingError(
                f"{self.path}: is of schema {schema}, by rso_lidar {version}; this one reads up to schema "
                f"{SCHEMA_VERSION}: upgrade rso_lidar"
            )
        self._need("truth")
        stated = self._file["truth"].attrs.get("texts_crc32")
        if stated is not None and int(stated) != texts_crc32(self._file):
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
        self._sunlit = [name for path in optional if (name := _between("truth/", path, "/sunlit"))]
        found = [group for group in kept.RECORDS if any(path.startswith(f"{group}/") for path in optional)]
        self.kept = tuple(found)  # names of the intermediate records that it holds
        paths = ["time", "frame_index", *READING, *LABELS, "truth/sun_direction", *optional]
        paths += [f"truth/{name}/{path}" for name in self._parents for path in NODE]
        paths += [f"truth/{name}/{path}" for name in self._states for path in INERTIAL]
        paths += [f"settings/{name}" for name in self._settings]
        paths += [path for path, _, _ in POINTING] if self._ptu else []
        self._need(*paths)
        self._datasets = {path: self._file[path] for path in paths}
        self._constants = {
            group: {name: float(self._file[group].attrs[name]) for name in kept.CONSTANTS.get(group, ())}
            for group in self.kept
        }
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
            more = f" (and {len(missing) - 1} more)" if len(missing) > 1 else ""
            raise RecordingError(f"{self.path}: the dataset {missing[0]} is missing{more}; copy or record it again")

    def _source(self) -> Source:
        attributes = self._file.attrs
        return Source(
            scenario=attributes["scenario"],
            title=attributes["title"],
            start_utc=attributes["start_utc"],
            seed=int(attributes["seed"]),
            versions=json.loads(attributes["versions"]),
            targets=targets(json.loads(attributes["targets"])),
        )

    def _row(self, path: str, k: int) -> np.ndarray:
        """Return one entry of a dataset of small vectors, which are read many frames at a time."""
        low = k - k % _READ_AT_ONCE
        have = self._rows.get(path)
        if have is None or have[0] != low:
            have = low, self.read(path, slice(low, min(low + _READ_AT_ONCE, self._count)))
            self._rows[path] = have
        entry: np.ndarray = have[1][k - low]
        return entry

    def _frame(self, k: int) -> Frame:
        time_s = float(self._row("time", k))
        reading = Reading(**self._arrays(READING | RETURNS, k))
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
            line_of_sight=self._sight_of(int(self._row("lens", k)) if self.changes_lens else 0),
            pan_tilt_rad=None if pointing is None else pointing.measured_rad,
        )
        sun = self._row("truth/sun_direction", k)
        sunlit = {name: float(self._row(f"truth/{name}/sunlit", k)) for name in self._sunlit}
        return Frame(
            index=int(self._row("frame_index", k)),
            observation=observation,
            labels=Labels(**self._arrays(LABELS | MORE_LABELS, k)),
            truth=Truth(time_s, PoseTree(self._parents, links), states, sun, pointing, sunlit),
            source=self.source,
            kept={group: self._kept_record(group, k) for group in self.kept},
        )

    def _arrays(self, names: Mapping[str, str], k: int) -> dict[str, np.ndarray]:
        """Return one entry of each of these datasets that the recording has, by name in the record."""
        return {name: self.read(path, k) for path, name in names.items() if path in self._datasets}

    def _kept_record(self, group: str, k: int) -> Record:
        entries = self._arrays({f"{group}/{path}": name for path, name in kept.FIELDS[group].items()}, k)
        return kept.restored(group, entries, self._constants[group])

    def _named(self, names: Mapping[str, str]) -> SimpleNamespace:
        """Return those of these datasets that the recording has, by name in the record."""
        return SimpleNamespace(**{name: Stored(self, path) for path, name in names.items() if path in self._datasets})

    def _kept_arrays(self, group: str) -> SimpleNamespace:
        self._need_kept(group)
        named = self._named({f"{group}/{path}": name for path, name in kept.FIELDS[group].items()})
        return SimpleNamespace(**vars(named), **self._constants[group])

    def _need_kept(self, group: str) -> None:
        if not any(path.startswith(f"{group}/") for path in self._datasets):
            raise RecordingError(f"{self.path}: holds no {group}; ask for them when the frames are made")

    def _sight_of(self, number: int) -> np.ndarray:
        """Return the line of sight (row, col, xyz) through one of the lenses."""
        if self._sight is None or self._sight[0] != number:
            with self.watched("line_of_sight"):
                tables = self._file["line_of_sight"]
                self._sight = number, tables[_index(number, tables.shape[0])] if self.changes_lens else tables[:]
        return self._sight[1]

    def _link(self, group: str, k: int) -> Link:
        from scipy.spatial.transform import RigidTransform, Rotation

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


def _between(start: str, text: str, end: str) -> str:
    """Return what stands between a start and an end of a text, nothing where it has others."""
    return text[len(start) : -len(end)] if text.startswith(start) and text.endswith(end) else ""


def _index(number: int, count: int) -> int:
    """Return a number of a table once it is sure that there is one."""
    if not 0 <= number < count:
        raise IndexError(f"no line of sight {number} among {count}")
    return number

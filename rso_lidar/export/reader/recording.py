"""Recordings read back from HDF5 or Zarr, frame by frame or array by array."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any, overload

import numpy as np

from rso_lidar.errors import RecordingError, RsoLidarError, did_you_mean
from rso_lidar.export.layout import camera_images, intermediates
from rso_lidar.export.layout.datasets import FLAGS, INERTIAL, LABELS, MORE_LABELS, POINTING, READING, RETURNS
from rso_lidar.export.layout.sensor_samples import COUNT, GROUP, make_samples
from rso_lidar.export.reader.recording_file import RecordingFile
from rso_lidar.export.reader.stored_array import StoredArray
from rso_lidar.pose import Link, PoseTree
from rso_lidar.records import (
    BodyState,
    CameraImage,
    CameraLabels,
    Frame,
    Labels,
    Observation,
    PtuAngles,
    Reading,
    Record,
    SensorSamples,
    Truth,
    specs,
)

_READ_AT_ONCE = 128  # frames of small vectors, which are kept until another one is asked for


class Recording(RecordingFile, Sequence[Frame]):
    """A recording: a sequence of frames, and arrays (time, row, col) that are read piece by piece.

    The temporary file of a running or killed simulation can be read like a finished recording. It has the frames that
    were complete when it was opened, and `complete` is False.

    `sensors` holds the samples of other sensors by name, each as one series over all frames:
    ``recording.sensors["gyro"].time_s``.

    A recording can be pickled, such as for the processes of a data loader. Each process opens the file itself.
    """

    def __init__(self, path: str | Path) -> None:
        """Open a recording.

        Parameters
        ----------
        path : of an HDF5 file or a Zarr store
        """
        super().__init__(path)
        self._rows: dict[str, tuple[int, np.ndarray]] = {}
        with self.watched("sensors"):
            self.sensors = SensorSeries(self)

    # ---------------------------------------------------------------------------------------------------- as a sequence

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

    # ----------------------------------------------------------------------------------------------------- as arrays

    @property
    def range_m(self) -> StoredArray:
        """Measured ranges (time, row, col) [m], NaN where nothing came back."""
        return StoredArray(self, "range")

    @property
    def intensity_counts(self) -> StoredArray:
        """Measured intensities (time, row, col) [counts], 0 where nothing came back."""
        return StoredArray(self, "intensity")

    @property
    def saturated(self) -> StoredArray:
        """Whether the intensity clipped (time, row, col), as bool."""
        return StoredArray(self, "saturated", bool)

    @property
    def time_s(self) -> StoredArray:
        """Times of emission (time) [s since start_utc]."""
        return StoredArray(self, "time")

    @property
    def frame_index(self) -> StoredArray:
        """Number (time) of each frame in its scenario."""
        return StoredArray(self, "frame_index")

    @property
    def labels(self) -> SimpleNamespace:
        """True values by name, each (time, row, col): ``recording.labels.target[10:20]``."""
        return self._named(LABELS | MORE_LABELS)

    @property
    def returns(self) -> SimpleNamespace:
        """All measured returns of a pixel: range_m and intensity_counts (time, row, col, return)."""
        self._need_kept("returns")
        return self._named({path: name.removeprefix("return_") for path, name in RETURNS.items()})

    @property
    def flags(self) -> SimpleNamespace:
        """Flags that the sensor raises on its returns, where it does: crosstalk and superimposed (time, row, col)."""
        if not FLAGS.keys() <= self._datasets.keys():
            raise RecordingError(
                f"{self.path}: has no flags; run the scenario with [lidar.detector.report] flags = true"
            )
        return self._named(FLAGS)

    @property
    def waveforms(self) -> SimpleNamespace:
        """Kept waveforms: samples_counts (time, row, col, sample), start_s, latch_s, sample_s and baseline_counts."""
        return self._kept_arrays("waveforms")

    @property
    def photons(self) -> SimpleNamespace:
        """Kept photon images (time, row, col): photons, and background_photons_per_s where there is background."""
        return self._kept_arrays("photons")

    @property
    def oversampled(self) -> SimpleNamespace:
        """Kept images on the grid of rays (time, fine_row, fine_col): range_m and photons."""
        return self._kept_arrays("oversampled")

    @property
    def prediction(self) -> SimpleNamespace:
        """Kept predictions (time, row, col): detection_probability and range_sigma_m."""
        return self._kept_arrays("prediction")

    @property
    def camera(self) -> dict[str, SimpleNamespace]:
        """Images and labels of each camera beside the lidar, by name: ``camera["nav"].intensity_counts[10:20]``."""
        return {name: self._named(camera_images.name_arrays(name)) for name in self.cameras}

    @property
    def lens(self) -> StoredArray:
        """Number of the line of sight of each frame (time), where the lens changes."""
        return StoredArray(self, "lens")

    @property
    def line_of_sight(self) -> np.ndarray:
        """Unit vectors (row, col, xyz) in lidar axes; (lens_number, row, col, xyz) where the lens changes."""
        if not self.changes_lens:
            return self._sight_of(0)
        lenses = self.lens[:]
        with self.watched("line_of_sight"):
            tables: np.ndarray = self._file["line_of_sight"][: int(lenses.max(initial=-1)) + 1]
        return tables

    def dataset(self, path: str) -> StoredArray:
        """Return the array at a path of the file, with its attributes.

        Parameters
        ----------
        path : such as ``truth/tdrs/position``
        """
        return StoredArray(self, path)

    def read_samples(self, k: int) -> dict[str, SensorSamples]:
        """Return the samples of other sensors in one frame, by name; no image is read.

        Parameters
        ----------
        k : index of the frame, from 0
        """
        rows = {path: self._row(path, k) for path in self.paths if path.startswith(f"{GROUP}/")} if self.sensors else {}
        return {name: self.sensors.select(name, rows) for name in self.sensors}

    # ------------------------------------------------------------------------------------------------------ the inside

    def _row(self, path: str, k: int) -> np.ndarray:
        """Return one entry of a dataset of small vectors; many frames are read at once."""
        low = k - k % _READ_AT_ONCE
        have = self._rows.get(path)
        if have is None or have[0] != low:
            have = low, self.read(path, slice(low, min(low + _READ_AT_ONCE, self._count)))
            self._rows[path] = have
        entry: np.ndarray = have[1][k - low]
        return entry

    def _frame(self, k: int) -> Frame:
        time_s = float(self._row("time", k))
        reading = Reading(**self._arrays(READING | RETURNS | FLAGS, k))
        pointing = self._pointing(k)
        images = {name: self._read_image(name, k) for name in self.cameras}
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
            sensors=self.read_samples(k),
            camera={name: image for name, (image, _) in images.items()},
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
            camera_labels={name: labels for name, (_, labels) in images.items()},
        )

    def _arrays(self, names: Mapping[str, str], k: int) -> dict[str, np.ndarray]:
        """Return one entry of each of these datasets that the recording has, by name in the record."""
        return {name: self.read(path, k) for path, name in names.items() if path in self._datasets}

    def _read_image(self, camera: str, k: int) -> tuple[CameraImage, CameraLabels]:
        paths = camera_images.name_arrays(camera)
        return camera_images.restore_records(
            camera, {path: self.read(path, k) for path in paths if path in self._datasets}
        )

    def _kept_record(self, group: str, k: int) -> Record:
        entries = self._arrays({f"{group}/{path}": name for path, name in intermediates.FIELDS[group].items()}, k)
        return intermediates.restore_record(group, entries, self._constants[group])

    def _named(self, names: Mapping[str, str]) -> SimpleNamespace:
        """Return those of these datasets that the recording has, by name in the record."""
        return SimpleNamespace(
            **{name: StoredArray(self, path) for path, name in names.items() if path in self._datasets}
        )

    def _kept_arrays(self, group: str) -> SimpleNamespace:
        self._need_kept(group)
        named = self._named({f"{group}/{path}": name for path, name in intermediates.FIELDS[group].items()})
        return SimpleNamespace(**vars(named), **self._constants[group])

    def _need_kept(self, group: str) -> None:
        if not any(path.startswith(f"{group}/") for path in self._datasets):
            raise RecordingError(f"{self.path}: has no {group}; request them when the frames are made")

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


class Frames(Sequence[Frame]):
    """Some frames of a recording, read when asked for."""

    def __init__(self, recording: Recording, places: Sequence[int]) -> None:
        """Select frames of a recording.

        Parameters
        ----------
        recording : to read from
        places : their indices
        """
        self.recording, self.places = recording, places

    def __len__(self) -> int:
        return len(self.places)

    @overload
    def __getitem__(self, k: int) -> Frame: ...
    @overload
    def __getitem__(self, k: slice) -> Frames: ...
    def __getitem__(self, k: int | slice) -> Frame | Frames:
        if isinstance(k, slice):
            return Frames(self.recording, self.places[k])
        return self.recording[self.places[k]]


class SensorSeries(Mapping[str, SensorSamples]):
    """Samples of the sensors of a recording, by name of the sensor; a series is read when it is asked for.

    ``recording.sensors["gyro"].angular_velocity_rad_s`` has the samples (sample, xyz) of all frames in order, without
    padding.
    """

    def __init__(self, recording: RecordingFile) -> None:
        """Refer to the sensors of a recording."""
        self._recording = recording
        self._described: dict[str, Any] = json.loads(recording.sensors_text)

    def __iter__(self) -> Iterator[str]:
        return iter(self._described)

    def __len__(self) -> int:
        return len(self._described)

    def __repr__(self) -> str:
        """Return the names of the sensors and of their records."""
        named = ", ".join(f"{name}: {entry['record']}" for name, entry in self._described.items())
        return f"<sensors of {self._recording.path.name}: {named}>"

    def __getitem__(self, name: str) -> SensorSamples:
        if name not in self._described:
            guess = did_you_mean(name, self._described)
            raise KeyError(
                f"{self._recording.path}: has no sensor '{name}'{guess} (known: {', '.join(self._described)})"
            )
        return self.read(name, slice(0, len(self._recording)))

    def read(self, name: str, frames: slice) -> SensorSamples:
        """Read the samples of a sensor in some frames.

        Parameters
        ----------
        frames : in ascending order, without a step
        """
        described, group = self._described[name], f"{GROUP}/{name}"
        counts = self._recording.read(f"{group}/{COUNT}", frames)
        entries = {}
        for field in described["fields"]:
            if (path := f"{group}/{field}") in self._recording.paths:
                values = self._recording.read(path, frames)
                entries[field] = values[np.arange(values.shape[1]) < counts[:, None]]
        return self._make(name, entries, int(counts.sum()))

    def select(self, name: str, rows: Mapping[str, np.ndarray]) -> SensorSamples:
        """Return the samples of a sensor in one frame."""
        group = f"{GROUP}/{name}"
        count = int(rows[f"{group}/{COUNT}"])
        fields = [field for field in self._described[name]["fields"] if f"{group}/{field}" in rows]
        return self._make(name, {field: rows[f"{group}/{field}"][:count] for field in fields}, count)

    def _make(self, name: str, entries: Mapping[str, np.ndarray], count: int) -> SensorSamples:
        """Make the record of samples, after checking how many there are."""
        path = f"{GROUP}/{name}"
        with self._recording.watched(path):
            if any(len(values) != count for values in entries.values()):
                raise ValueError(f"{COUNT} is larger than an entry")
            return make_samples(self._described[name], entries)

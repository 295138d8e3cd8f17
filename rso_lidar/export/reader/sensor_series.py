"""Samples of the sensors of a recording, each sensor as one series over all its frames."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from rso_lidar.errors import did_you_mean
from rso_lidar.export.layout.sensor_samples import COUNT, GROUP, make_samples
from rso_lidar.export.reader.recording_file import RecordingFile
from rso_lidar.records import SensorSamples


class SensorSeries(Mapping[str, SensorSamples]):
    """Samples of the sensors of a recording, by name of the sensor; a series is read when it is asked for.

    ``recording.sensors["gyro"].angular_velocity_rad_s`` has the samples (sample, xyz) of all frames in order, without
    padding.
    """

    def __init__(self, recording: RecordingFile) -> None:
        """Refer to the sensors of a recording.

        Parameters
        ----------
        recording : open file
        """
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
        name : of the sensor
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
        """Return the samples of a sensor in one frame.

        Parameters
        ----------
        name : of the sensor
        rows : entries of the frame, by path
        """
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

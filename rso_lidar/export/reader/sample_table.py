"""Samples of one sensor as a table: a row for each sample, and a column for each number of it."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping

import numpy as np

from rso_lidar.errors import RecordingError, did_you_mean
from rso_lidar.export.layout.datasets import split_unit
from rso_lidar.export.reader.recording import Frames, Recording
from rso_lidar.records import Frame, SensorSamples, join_samples, specs

_AXES = {"xyz": "xyz", "quaternion": "xyzw"}  # names of the places along a dimension


def read_samples(frames: Iterable[Frame], sensor: str) -> SensorSamples:
    """Return the samples of a sensor in frames, as one series; of a recording, no image is read.

    Parameters
    ----------
    frames : from `simulate` or `open`, at least one

    Raises
    ------
    RecordingError
        If there is no such sensor.
    """
    if isinstance(frames, Recording):
        frames = frames[:]
    samples_by_frame: list[Mapping[str, SensorSamples]]
    if isinstance(frames, Frames):
        samples_by_frame = [frames.recording.read_samples(frames.recording.place(k)) for k in frames.places]
    else:
        samples_by_frame = [frame.observation.sensors for frame in frames]
    known = samples_by_frame[0]
    if sensor not in known:
        guess = did_you_mean(sensor, known)
        listed = f"{guess or ';'} (known: {', '.join(known)})" if known else "; the frames have no sensors"
        raise RecordingError(f"--sensor {sensor}: there is no sensor of that name{listed}")
    return join_samples([{sensor: some[sensor]} for some in samples_by_frame])[sensor]


def tabulate_samples(samples: SensorSamples, utc: np.ndarray) -> dict[str, np.ndarray]:
    """Tabulate samples: columns (sample) by name, with units in the names.

    Parameters
    ----------
    utc : the instants at which they hold, as text (sample)

    Returns
    -------
    The columns. A vector has a column for each axis (``angular_velocity_x_rad_s``), other arrays one for each place
    (``force_0_n``). ``utc`` is text.
    """
    table = {"time_s": samples.time_s, "utc": utc}
    for field, spec in specs(type(samples)).items():
        values = getattr(samples, field)
        if values is None or field == "time_s":
            continue
        stem, unit = split_unit(field.removesuffix("_xyzw") if spec.dims[-1] == "quaternion" else field)
        places = [_AXES.get(dim, range(size)) for dim, size in zip(spec.dims[1:], values.shape[1:], strict=True)]
        for place in np.ndindex(values.shape[1:]):
            words = (str(names[k]) for names, k in zip(places, place, strict=True))
            table[re.sub("_+", "_", "_".join([stem, *words, unit])).strip("_")] = values[(slice(None), *place)]
    return table

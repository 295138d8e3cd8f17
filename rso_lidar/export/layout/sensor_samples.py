"""Samples of sensors in a recording: their datasets, the statements of their fields, and the records made of them.

How many samples a sensor has varies from frame to frame. A frame is an entry of fixed length, with missing values behind
its last sample (CF 1.11, sec. 9.3.2, incomplete multidimensional array representation), and `sample_count` counts them.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numpy as np

from rso_lidar.errors import RecordingError
from rso_lidar.records import ArraySpec, SensorSamples, array, specs

GROUP = "sensors"
COUNT = "sample_count"
_COUNT_SPEC = ArraySpec((), np.dtype("u4"), "1", "number of samples that became available since the frame before")
_SAMPLE = "sample"
_FLAG = np.dtype("u1")  # files hold true and false as 1 and 0
_RESERVED = ("time", COUNT)  # names that a dimension cannot have
_GIVEN = tuple(specs(SensorSamples))
TIMES = ("time_s", "available_s")

Capacities = Mapping[str, int]  # by name of the sensor: samples for which an entry has room


def is_series(path: str) -> bool:
    """Return whether the dataset at a path has a varying number of samples in each frame."""
    return path.startswith(f"{GROUP}/") and not path.endswith(f"/{COUNT}")


def list_arrays(sensors: Mapping[str, SensorSamples]) -> dict[str, ArraySpec]:
    """List the arrays that a recording makes of samples, by path.

    Raises
    ------
    RecordingError
        If a name or a field cannot be recorded.
    """
    array_specs = {}
    for name, samples in sensors.items():
        if not name or "/" in name or name.strip(".") == "":
            raise RecordingError(f"sensor '{name}': a recording cannot hold this name; rename the sensor")
        stated = _check_fields(name, type(samples))
        array_specs[f"{GROUP}/{name}/{COUNT}"] = _COUNT_SPEC
        for field, spec in stated.items():
            value = getattr(samples, field)
            if value is not None and 0 not in value.shape[1:]:
                dtype = _FLAG if spec.dtype.kind == "b" else spec.dtype
                array_specs[f"{GROUP}/{name}/{field}"] = dataclasses.replace(spec, dtype=dtype)
    return array_specs


def _check_fields(name: str, kind: type[SensorSamples]) -> Mapping[str, ArraySpec]:
    """Return the statements of a class of samples; raise a `RecordingError` where a field cannot be recorded."""
    stated = specs(kind)
    for field in dataclasses.fields(kind):
        place = f"sensor '{name}': {kind.__name__}.{field.name}"
        spec = stated.get(field.name)
        if spec is None:
            raise RecordingError(f"{place}: has no statement of its array; state it with records.array(...)")
        if spec.dims[:1] != (_SAMPLE,) or field.name == COUNT:
            raise RecordingError(f"{place}: a recording takes arrays whose first dimension is '{_SAMPLE}'; state it so")
        if spec.dtype.kind not in "fiub" or spec.dtype.itemsize > 8:
            raise RecordingError(f"{place}: a recording cannot hold {spec.dtype}; state numbers of up to 8 bytes")
        if wrong := [dim for dim in spec.dims[1:] if dim in (*_RESERVED, *stated) or spec.dims.count(dim) > 1]:
            raise RecordingError(f"{place}: a dimension cannot have the name '{wrong[0]}' here; rename it")
    return stated


def collect_arrays(sensors: Mapping[str, SensorSamples]) -> dict[str, np.ndarray]:
    """Collect the arrays of the samples of a frame, each (sample, …) and not padded, by path."""
    arrays: dict[str, np.ndarray] = {}
    for name, samples in sensors.items():
        arrays[f"{GROUP}/{name}/{COUNT}"] = np.asarray(len(samples.time_s), _COUNT_SPEC.dtype)
        for field in specs(type(samples)):
            value = getattr(samples, field)
            if value is not None and 0 not in value.shape[1:]:
                arrays[f"{GROUP}/{name}/{field}"] = value
    return arrays


def grow_capacities(sensors: Mapping[str, SensorSamples], capacities: Capacities) -> dict[str, int]:
    """Return the capacities that samples need: those given, or one more than there are samples.

    The numbers of samples of complete intervals differ by one at most.
    """
    new_capacities = {}
    for name, samples in sensors.items():
        count, room = len(samples.time_s), capacities.get(name, 1)
        new_capacities[name] = room if count <= room and name in capacities else max(count + 1, room)
    return new_capacities


def pad(values: np.ndarray, room: int, fill: float | int | None) -> np.ndarray:
    """Pad samples to the length of an entry.

    Parameters
    ----------
    values : (sample, …)
    fill : value behind the last sample (None: 0)
    """
    padded = np.full((room, *values.shape[1:]), 0 if fill is None else fill, values.dtype)
    padded[: len(values)] = values
    return padded


def describe_sensors(sensors: Mapping[str, SensorSamples]) -> dict[str, Any]:
    """Return what a recording states of each sensor, ready for JSON: its record, and all fields of it."""
    statements = {}
    for name, samples in sensors.items():
        fields = {
            field: {
                "dims": list(spec.dims),
                "dtype": spec.dtype.str,
                "unit": spec.unit,
                "meaning": spec.meaning,
                "shape": list(getattr(samples, field).shape[1:]),
            }
            for field, spec in specs(type(samples)).items()
            if getattr(samples, field) is not None
        }
        kind = type(samples)
        about = (kind.__doc__ or "").strip().partition("\n")[0]
        statements[name] = {"record": kind.__name__, "about": about, "fields": fields}
    return statements


def make_samples(described: Mapping[str, Any], entries: Mapping[str, np.ndarray]) -> SensorSamples:
    """Make a record of samples from the arrays of a recording.

    The class is one that is loaded and has the recorded name and fields. Otherwise it is made from the statements of
    the fields. Nothing is imported, because a recording may come from anywhere.

    Parameters
    ----------
    entries : arrays (sample, …) by name of the field; fields without entries are made
    """
    fields = described["fields"]
    stated = {field: _read_spec(statement) for field, statement in fields.items()}
    kind = _find_class(described["record"], stated) or _make_class(
        described["record"], described["about"], tuple(stated.items())
    )
    count = len(entries["time_s"])
    arrays = {
        field: entries[field].astype(spec.dtype, copy=False)
        if field in entries
        else np.empty((count, *fields[field]["shape"]), spec.dtype)
        for field, spec in stated.items()
    }
    return kind(**arrays)


def _read_spec(statement: Mapping[str, Any]) -> ArraySpec:
    return ArraySpec(tuple(statement["dims"]), np.dtype(statement["dtype"]), statement["unit"], statement["meaning"])


def _find_class(name: str, stated: Mapping[str, ArraySpec]) -> type[SensorSamples] | None:
    """Return a loaded class of samples with a name and fields; None where there is none.

    Parameters
    ----------
    stated : recorded fields; optional ones may be missing
    """
    waiting: list[type[SensorSamples]] = [SensorSamples]
    while waiting:
        kind = waiting.pop()
        waiting += kind.__subclasses__()
        if kind.__name__ != name or not dataclasses.is_dataclass(kind) or "recorded_statement" in vars(kind):
            continue
        wanted = {field.name for field in dataclasses.fields(kind) if field.default is dataclasses.MISSING}
        own = specs(kind)
        if wanted <= stated.keys() and all(own.get(field) == spec for field, spec in stated.items()):
            return kind
    return None


@lru_cache(maxsize=256)
def _make_class(name: str, about: str, stated: tuple[tuple[str, ArraySpec], ...]) -> type[SensorSamples]:
    """Make a class of samples from recorded statements."""
    own = [
        (field, np.ndarray, array(" ".join(spec.dims), spec.dtype.str, spec.unit, spec.meaning))
        for field, spec in stated
        if field not in _GIVEN
    ]
    statement = (name, about, stated)
    members = {"__doc__": about, "recorded_statement": statement, "__reduce__": _reduce_samples}
    samples_class: type[SensorSamples] = dataclasses.make_dataclass(
        name, own, bases=(SensorSamples,), namespace=members, frozen=True, eq=False, repr=False
    )
    return samples_class


def _reduce_samples(samples: Any) -> tuple[Any, ...]:
    """Describe a record of a made class to another process."""
    return _restore_samples, (type(samples).recorded_statement, dict(vars(samples)))


def _restore_samples(statement: tuple[Any, ...], arrays: Mapping[str, np.ndarray]) -> SensorSamples:
    return _make_class(*statement)(**arrays)

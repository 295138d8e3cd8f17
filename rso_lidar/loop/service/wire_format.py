"""Messages of the server: a JSON header that lists arrays, and the arrays as raw little-endian bytes."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, TypeVar

import numpy as np
from pydantic_core import from_json, to_json

from rso_lidar import records
from rso_lidar.errors import RunError, ScenarioError
from rso_lidar.export import collect_truth
from rso_lidar.loop.service.requests import SCHEMA
from rso_lidar.pose import Link, PoseTree
from rso_lidar.records import (
    ArraySpec,
    BodyState,
    CameraImage,
    Observation,
    PtuAngles,
    Reading,
    Record,
    SensorSamples,
    Truth,
    specs,
)

AnyRecord = TypeVar("AnyRecord", bound=Record)

_DTYPES = {
    name: np.dtype(name) for name in ("|b1", "|u1", "|i1", "<u2", "<i2", "<u4", "<i4", "<u8", "<i8", "<f4", "<f8")
}
_CAMERA = "camera/"  # before the name of a camera in the paths of its images


@dataclass(frozen=True, eq=False)
class WireArray:
    """One array of a message: its path, its statement and its values."""

    path: str
    spec: ArraySpec
    values: np.ndarray


def list_record(path: str, record: Record) -> Iterator[WireArray]:
    """Yield the arrays of a record, with the statements of its fields.

    Parameters
    ----------
    path : before the names of the fields, with a slash at its end, or empty
    record : whose arrays are sent; those that are None are not
    """
    for name, spec in specs(type(record)).items():
        if (values := getattr(record, name)) is not None:
            yield WireArray(f"{path}{name}", spec, values)


def list_reading(
    observation: Observation | None, samples: Mapping[str, SensorSamples], *, with_line_of_sight: bool = False
) -> tuple[dict[str, str], list[WireArray]]:
    """List the arrays of a reading and of samples of other sensors.

    Parameters
    ----------
    observation : whose reading and angles are sent; None for none
    with_line_of_sight : whether the receiver does not have the present line of sight yet

    Returns
    -------
    classes
        of the records, by their paths.
    arrays
        in the order of the message.
    """
    inside: dict[str, Record] = {f"sensors/{name}": some for name, some in samples.items()}
    arrays: list[WireArray] = []
    if observation is not None:
        inside = {"reading": observation.reading, **inside}
        own = list_record("", observation)
        arrays += [array for array in own if with_line_of_sight or array.path != "line_of_sight"]
    for path, record in inside.items():
        arrays += list_record(f"{path}/", record)
    return {path: type(record).__name__ for path, record in inside.items()}, arrays


def list_images(images: Mapping[str, CameraImage]) -> tuple[dict[str, str], list[WireArray]]:
    """List the classes of images by path, and their arrays.

    Parameters
    ----------
    images : by the name of the camera
    """
    inside = {f"{_CAMERA}{name}": image for name, image in images.items()}
    arrays = [array for path, image in inside.items() for array in list_record(f"{path}/", image)]
    return {path: type(image).__name__ for path, image in inside.items()}, arrays


def list_truth(truth: Truth) -> list[WireArray]:
    """List the arrays of the truth at one epoch, with the paths and meanings that they have in a recording."""
    arrays = [WireArray(path, spec, value) for path, (spec, value) in collect_truth(truth).items()]
    if truth.pointing is not None:
        arrays += list_record("ptu/", truth.pointing)
    return arrays


def encode(header: dict[str, Any], arrays: Sequence[WireArray] = ()) -> list[Any]:
    """Return the parts of a message: the JSON header in UTF-8, then the bytes of each array.

    Parameters
    ----------
    header : of the message, without schema and arrays. A number that is not finite is sent as null
    """
    packed = [to_little_endian(array.values) for array in arrays]
    listed = b",".join(
        [
            _describe_array(array.path, array.spec, values.dtype.str, values.shape)
            for array, values in zip(arrays, packed, strict=True)
        ]
    )
    text = to_json({"schema": SCHEMA, **header}, inf_nan_mode="null")
    return [
        b'%b,"arrays":[%b]}' % (text[:-1], listed),
        *[values.data if values.size else b"" for values in packed],
    ]


@lru_cache(maxsize=1024)
def _describe_array(path: str, spec: ArraySpec, dtype: str, shape: tuple[int, ...]) -> bytes:
    """Return the JSON object that describes an array; most are the same from message to message."""
    stated = {"unit": spec.unit, "dims": spec.dims, "meaning": spec.meaning}
    return to_json({"name": path, "dtype": dtype, "shape": shape, **stated})


def to_little_endian(values: Any) -> np.ndarray:
    """Return an array in C order and little-endian bytes; most are already."""
    array = np.asarray(values)
    if array.flags.c_contiguous and array.dtype.str[0] != ">":
        return array
    return np.require(array, array.dtype.newbyteorder("<"), "C")


def decode(parts: Sequence[Any]) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Return the header of a message and its arrays by path; raise `RunError` if they are no message of this schema."""
    try:
        header = from_json(bytes(parts[0]))
    except (IndexError, ValueError):
        header = None
    if not isinstance(header, dict):
        raise RunError("reply: is none of an rso-lidar server; check the address")
    if header.get("schema") != SCHEMA:
        raise RunError(
            f"reply: has the schema {header.get('schema')!r:.60}, and this client speaks {SCHEMA}; use equal versions"
        )
    listed = header.get("arrays", [])
    if not isinstance(listed, list) or len(listed) != len(parts) - 1:
        raise RunError(f"reply: lists other arrays than its {len(parts) - 1} parts; use equal versions")
    return header, dict(map(_read_array, listed, parts[1:]))


def _read_array(entry: Any, data: Any) -> tuple[str, np.ndarray]:
    """Return path and values of one array of a message."""
    path, name, size = f"{entry!r:.60}", "", memoryview(data).nbytes
    try:
        path, name, shape = str(entry["name"]), str(entry["dtype"]), tuple(map(int, entry["shape"]))
        dtype = _DTYPES[name]
        if min(shape, default=0) >= 0 and math.prod(shape) * dtype.itemsize == size:
            return path, np.ndarray(shape, dtype, data)
    except (KeyError, TypeError, ValueError):
        pass
    raise RunError(
        f"reply: the array {path:.60} of {name or '?':.20} does not fit its {size} bytes; use equal versions"
    )


@contextmanager
def check_reply(endpoint: str) -> Iterator[None]:
    """Raise `RunError` where a reply that is read in this context lacks a key or an array, or has another type."""
    try:
        yield
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        what = (
            f"lacks {error}" if isinstance(error, KeyError) else f"cannot be read ({' '.join(str(error).split()):.100})"
        )
        raise RunError(f"{endpoint}: the reply {what}; use equal versions") from error


def build_observation(
    header: dict[str, Any],
    arrays: dict[str, np.ndarray],
    line_of_sight: np.ndarray,
    samples: Mapping[str, SensorSamples],
) -> Observation:
    """Build the record of an observation from a message.

    Parameters
    ----------
    header, arrays : from `decode`
    line_of_sight : (row, col, xyz) in force
    samples : of the other sensors since the reading before, by name
    """
    reading = _build_record("reading", Reading, arrays)
    frame = header["frame"]
    return Observation(
        frame["time_s"],
        reading,
        frame["settings"],
        line_of_sight,
        pan_tilt_rad=arrays.get("pan_tilt_rad"),
        sensors=samples,
        camera={
            path.removeprefix(_CAMERA): _build_record(path, CameraImage, arrays)
            for path in header.get("records", {})
            if path.startswith(_CAMERA)
        },
    )


def build_samples(header: dict[str, Any], arrays: dict[str, np.ndarray]) -> dict[str, SensorSamples]:
    """Build the samples of other sensors from a message, by name.

    Parameters
    ----------
    header, arrays : from `decode`
    """
    built = {}
    for path, name in header.get("records", {}).items():
        if path.startswith("sensors/"):
            cls = getattr(records, name, None)
            if not (isinstance(cls, type) and issubclass(cls, SensorSamples)):
                raise RunError(f"reply: {path} is a {name!r:.40}, which this version does not know; use equal versions")
            built[path.removeprefix("sensors/")] = _build_record(path, cls, arrays)
    return built


def _build_record(path: str, cls: type[AnyRecord], arrays: dict[str, np.ndarray]) -> AnyRecord:
    """Build one record of a message."""
    return cls(**{field: arrays[f"{path}/{field}"] for field in specs(cls) if f"{path}/{field}" in arrays})


def build_truth(header: dict[str, Any], arrays: dict[str, np.ndarray]) -> Truth:
    """Build the truth at one epoch from a message.

    Parameters
    ----------
    header, arrays : from `decode`
    """
    from scipy.spatial.transform import Rotation

    links = {}
    for name in header["parents"]:
        position, quaternion, velocity, rate = (
            arrays[f"truth/{name}/{path}"]
            for path in ("parent_position", "parent_quaternion", "velocity", "angular_velocity")
        )
        links[name] = Link((position, Rotation.from_quat(quaternion).as_matrix()), velocity, rate)
    states = {
        name: BodyState(arrays[f"truth/{name}/inertial_position"], arrays[f"truth/{name}/inertial_velocity"])
        for name in header["parents"]
        if f"truth/{name}/inertial_position" in arrays
    }
    pointing = None
    if "ptu/actual_rad" in arrays:
        pointing = PtuAngles(**{name: arrays[f"ptu/{name}"] for name in specs(PtuAngles)})
    tree = PoseTree(header["parents"], links)
    return Truth(header["time_s"], tree, states, arrays["truth/sun_direction"], pointing, header.get("sunlit", {}))


def encode_request(kind: str, sequence: int, fields: dict[str, Any]) -> bytes:
    """Return the header of a request; raise `ScenarioError` if a number is not finite.

    Parameters
    ----------
    fields : further keys; None is left out
    """
    given = {name: value for name, value in fields.items() if value is not None}
    try:
        text = _REQUEST_ENCODER.encode({"request": kind, "sequence": sequence, **given})
    except (TypeError, ValueError) as error:
        raise ScenarioError(f"{kind}: cannot be sent ({error}); give finite numbers") from None
    return text.encode()


def _to_json(value: Any) -> Any:
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"{value!r:.40} is no number")


_REQUEST_ENCODER = json.JSONEncoder(allow_nan=False, default=_to_json)

"""What stands where in an HDF5 recording: the datasets that a frame fills, and the file that waits for them.

Names, dtypes, units and meanings come from the statements in `records`; the few that no record states (a node of the
tree of axes) are stated here. Dimensions are HDF5 dimension scales and attributes follow CF 1.11, so that plain h5py,
MATLAB, netCDF tools and xarray read the same names. Absence: NaN in floats, -1 in signed integers, 0 in unsigned ones.
"""

from __future__ import annotations

import dataclasses
import datetime
import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from rso_lidar.errors import RecordingError
from rso_lidar.pose import ROOT, PoseTree
from rso_lidar.records import (
    SCHEMA_VERSION,
    ArraySpec,
    BodyState,
    Frame,
    Labels,
    Observation,
    PtuAngles,
    Reading,
    Source,
    specs,
)

# Small vectors are stored in chunks of so many frames, raw: a compressed chunk that grows is moved at every flush, and
# the space it leaves is lost to a file that others may be reading.
FRAMES_PER_CHUNK = 128

READING = {"range": "range_m", "intensity": "intensity_counts", "saturated": "saturated"}  # in the file: in the record
AXES = (
    "inertial: GCRS, or the root of a local world. lidar: +z boresight, +x right (columns grow with it), +y down (rows "
    "grow with it). A point is range * line_of_sight, in lidar axes."
)
_F8 = np.dtype("f8")
_XYZ = ("xyz",)
NODE = {
    "parent_position": ArraySpec(_XYZ, _F8, "m", "position of these axes in their parent's"),
    "parent_quaternion": ArraySpec(("quaternion",), _F8, "1", "rotation parent_from_this as x, y, z, w with w >= 0"),
    "velocity": ArraySpec(_XYZ, _F8, "m s-1", "velocity of these axes' origin as the parent sees it, in parent axes"),
    "angular_velocity": ArraySpec(_XYZ, _F8, "rad s-1", "angular velocity relative to the parent, in these axes"),
    "position": ArraySpec(_XYZ, _F8, "m", "position of these axes in lidar axes"),
    "quaternion": ArraySpec(("quaternion",), _F8, "1", "rotation lidar_from_this as x, y, z, w with w >= 0"),
}
INERTIAL = {"inertial_position": "position_m", "inertial_velocity": "velocity_m_s"}  # in the file: in BodyState
SUN = ArraySpec(_XYZ, _F8, "1", "unit vector to the Sun in inertial axes, NaN in a local world")
TIME = ArraySpec((), _F8, "", "emission of the laser flash")
INDEX = ArraySpec((), np.dtype("i8"), "1", "number of the frame in the scenario")

_UNITS = {  # what a suffix means, in UDUNITS
    "m": "m",
    "km": "km",
    "mm": "mm",
    "um": "um",
    "nm": "nm",
    "s": "s",
    "ns": "ns",
    "rad": "rad",
    "deg": "degree",
    "m_s": "m s-1",
    "rad_s": "rad s-1",
    "deg_s": "degree s-1",
    "hz": "Hz",
    "mhz": "MHz",
    "j": "J",
    "mj": "mJ",
    "kg": "kg",
    "n_m": "N m",
    "na": "nA",
    "per_sr": "sr-1",
    "per_s": "s-1",
    "counts": "count",
    "v": "V",
}


@dataclass(frozen=True)
class Variable:
    """One dataset that grows by one entry a frame: where it stands, what it is, and the shape of one entry."""

    path: str
    spec: ArraySpec
    shape: tuple[int, ...]

    @property
    def per_pixel(self) -> bool:
        """Return whether an entry is an array over the focal plane."""
        return "row" in self.spec.dims

    @property
    def fill(self) -> float | int | None:
        """Return what stands for absence, or None where zero does."""
        if self.path in ("time", "frame_index"):
            return None
        return {"f": np.nan, "i": -1}.get(self.spec.dtype.kind)

    @property
    def chunk(self) -> tuple[int, ...]:
        """Return the shape of a chunk in the file."""
        return (1 if self.per_pixel else FRAMES_PER_CHUNK, *self.shape)


def variables(frame: Frame) -> dict[str, Variable]:
    """Return the datasets that a recording with such frames has, by path."""
    found = {"time": TIME, "frame_index": INDEX}
    found |= {path: specs(Reading)[name] for path, name in READING.items()}
    found |= {f"labels/{name}": spec for name, spec in specs(Labels).items()}
    for name in frame.observation.settings:
        found[f"settings/{name}"] = ArraySpec((), _F8, setting_unit(name), f"{name.replace('_', ' ')}, as in force")
    if frame.truth.pointing is not None:
        for (path, _, place), spec in zip(POINTING, _pointing_specs(), strict=True):
            found[path] = dataclasses.replace(spec, dims=(), meaning=f"{('pan', 'tilt')[place]} of: {spec.meaning}")
    found["truth/sun_direction"] = SUN
    for name in frame.truth.poses:
        if name == "sun_direction" or "/" in name:
            raise RecordingError(f"axes '{name}': a recording cannot hold this name; rename the body")
        found |= {f"truth/{name}/{path}": spec for path, spec in NODE.items()}
    state = {path: dataclasses.replace(specs(BodyState)[field], dims=_XYZ) for path, field in INERTIAL.items()}
    for name in frame.truth.states:
        found |= {f"truth/{name}/{path}": spec for path, spec in state.items()}
    sizes = {"row": frame.range_m.shape[0], "col": frame.range_m.shape[1], "xyz": 3, "quaternion": 4}
    return {
        path: Variable(path, spec, tuple(sizes[dim] for dim in spec.dims if dim in sizes))
        for path, spec in found.items()
    }


# Path, field of `PtuAngles`, and place in it: /ptu/pan_demand_rad and so on.
POINTING = [
    (f"ptu/{axis}_{name}", name, place) for name in specs(PtuAngles) for place, axis in enumerate(("pan", "tilt"))
]


def _pointing_specs() -> list[ArraySpec]:
    return [specs(PtuAngles)[name] for _, name, _ in POINTING]


def setting_unit(name: str) -> str:
    """Return the unit that a setting's suffix names, in UDUNITS; 1 where it names none.

    >>> setting_unit("focal_length_m"), setting_unit("max_rate_rad_s"), setting_unit("gain")
    ('m', 'rad s-1', '1')
    """
    words = name.split("_")
    ends = ("_".join(words[-count:]) for count in range(min(3, len(words) - 1), 0, -1))
    return next((_UNITS[end] for end in ends if end in _UNITS), "1")


def values(frame: Frame) -> dict[str, Any]:
    """Return what a frame puts into each dataset, by path, in the file's dtypes (time last)."""
    observation, truth = frame.observation, frame.truth
    found: dict[str, Any] = {path: getattr(observation.reading, name) for path, name in READING.items()}
    found |= {f"labels/{name}": getattr(frame.labels, name) for name in specs(Labels)}
    found |= {f"settings/{name}": value for name, value in observation.settings.items()}
    if truth.pointing is not None:
        found |= {path: getattr(truth.pointing, name)[place] for path, name, place in POINTING}
    found["truth/sun_direction"] = truth.sun_direction
    seen = lidar_from(truth.poses)
    rotations = [truth.poses[name].pose.as_matrix()[..., :3, :3] for name in seen]
    rotations += [matrix[..., :3, :3] for matrix in seen.values()]
    quaternions = Rotation.from_matrix(np.array(rotations)).as_quat(canonical=True)
    for place, (name, matrix) in enumerate(seen.items()):
        link = truth.poses[name]
        found[f"truth/{name}/parent_position"] = link.pose.translation
        found[f"truth/{name}/parent_quaternion"] = quaternions[place]
        found[f"truth/{name}/velocity"] = link.velocity_m_s
        found[f"truth/{name}/angular_velocity"] = link.angular_velocity_rad_s
        found[f"truth/{name}/position"] = matrix[..., :3, 3]
        found[f"truth/{name}/quaternion"] = quaternions[len(seen) + place]
    for name, state in truth.states.items():
        found |= {f"truth/{name}/{path}": getattr(state, field) for path, field in INERTIAL.items()}
    found["frame_index"] = frame.index
    found["time"] = frame.time_s
    return found


def lidar_from(tree: PoseTree) -> dict[str, np.ndarray]:
    """Return the matrix (4, 4) of lidar_from_<name> for every node, by name, in the tree's order.

    The tree is walked once, outward from the lidar, so that each pose is composed along the shortest path.
    """
    if "lidar" not in tree:
        raise RecordingError("a frame without axes named 'lidar' cannot be recorded: add them to its truth")
    inward = {name: tree[name].pose.as_matrix() for name in tree}  # parent_from_name
    below: dict[str, list[str]] = {}
    for name in tree:
        below.setdefault(tree.parent(name), []).append(name)
    seen = {"lidar": np.eye(4)}
    waiting = ["lidar"]
    while waiting:
        name = waiting.pop()
        if name != ROOT and tree.parent(name) not in seen:
            rotation, position = inward[name][:3, :3], inward[name][:3, 3]
            inverse = np.eye(4)
            inverse[:3, :3], inverse[:3, 3] = rotation.T, -rotation.T @ position
            seen[tree.parent(name)] = seen[name] @ inverse
            waiting.append(tree.parent(name))
        for child in below.get(name, []):
            if child not in seen:
                seen[child] = seen[name] @ inward[child]
                waiting.append(child)
    return {name: seen[name] for name in tree}


def parents(frame: Frame) -> dict[str, str]:
    """Return the parent of every node of a frame's tree of axes."""
    return {name: frame.truth.poses.parent(name) for name in frame.truth.poses}


# -------------------------------------------------------------------------------------------------------- the file


def lay_out(file: Any, source: Source, frame: Frame) -> dict[str, Variable]:
    """Return the datasets by path after making them all in an empty h5py file, with attributes and dimension scales."""
    found = variables(frame)
    _root_attributes(file, source)
    scales = {"time": _dataset(file, found["time"], _time_attributes(source.start_utc))}
    for dim, size, meaning in (
        ("row", frame.range_m.shape[0], "row of the focal plane, 0 at the top"),
        ("col", frame.range_m.shape[1], "column of the focal plane, 0 at the left"),
    ):
        scales[dim] = file.create_dataset(dim, data=np.arange(size, dtype="i4"), dtype="i4")
        _attributes(scales[dim], {"units": "1", "long_name": meaning})
    for dim, size, meaning in (("xyz", 3, "x, y, z"), ("quaternion", 4, "x, y, z, w")):
        scales[dim] = file.create_dataset(dim, shape=(size,), dtype=">f4")
        _attributes(scales[dim], {"long_name": meaning})
    for dim, scale in scales.items():
        phantom = f"This is a netCDF dimension but not a netCDF variable.{scale.shape[0]:10d}"
        scale.make_scale(phantom if dim in ("xyz", "quaternion") else dim)

    directions = specs(Observation)["line_of_sight"]
    sight = file.create_dataset(
        "line_of_sight", data=frame.line_of_sight, dtype=directions.dtype, compression="gzip", shuffle=True
    )
    _attributes(sight, {"units": directions.unit, "long_name": directions.meaning})
    _attach(sight, directions.dims, scales)
    for path, variable in found.items():
        if path != "time":
            extra: dict[str, Any] = {"units": variable.spec.unit, "long_name": variable.spec.meaning}
            if path == "labels/target" and source.targets:
                extra["flag_values"] = np.arange(len(source.targets), dtype=variable.spec.dtype)
                extra["flag_meanings"] = " ".join(target.name for target in source.targets)
            _attach(_dataset(file, variable, extra), ("time", *variable.spec.dims), scales)
    for name, parent in parents(frame).items():
        _attributes(file[f"truth/{name}"], {"parent": parent})
    _attributes(file["truth"], {"tree": json.dumps(parents(frame)), "states": json.dumps(list(frame.truth.states))})
    return found


def _dataset(file: Any, variable: Variable, attributes: Mapping[str, Any]) -> Any:
    squeeze = {"compression": "gzip", "compression_opts": 1, "shuffle": True} if variable.per_pixel else {}
    made = file.create_dataset(
        variable.path,
        shape=(0, *variable.shape),
        maxshape=(None, *variable.shape),
        chunks=variable.chunk,
        dtype=variable.spec.dtype,
        fillvalue=variable.fill,
        **squeeze,
    )
    _attributes(made, attributes)
    if variable.fill is not None:
        made.attrs.create("_FillValue", np.array([variable.fill], variable.spec.dtype), dtype=variable.spec.dtype)
    return made


def _attach(dataset: Any, dims: tuple[str, ...], scales: Mapping[str, Any]) -> None:
    for axis, dim in enumerate(dims):
        dataset.dims[axis].attach_scale(scales[dim])


def _attributes(place: Any, attributes: Mapping[str, Any]) -> None:
    import h5py

    for name, value in attributes.items():
        if isinstance(value, str):
            place.attrs.create(name, value, dtype=h5py.string_dtype())
        else:
            place.attrs.create(name, value, dtype=np.asarray(value).dtype)


def _root_attributes(file: Any, source: Source) -> None:
    seed: Any = np.int64(source.seed) if abs(source.seed) < 2**63 else str(source.seed)
    attributes = {
        "Conventions": "CF-1.11",
        "title": source.title,
        "schema_version": np.int64(SCHEMA_VERSION),
        "rso_lidar_version": source.versions.get("rso_lidar", "unknown"),
        "versions": json.dumps(dict(source.versions)),
        "scenario": source.scenario,
        "seed": seed,
        "start_utc": source.start_utc,
        "targets": json.dumps([dataclasses.asdict(target) for target in source.targets], indent=1),
        "quaternion_order": "xyzw",
        "axes": AXES,
    }
    _attributes(file, attributes)


def _time_attributes(start_utc: str) -> dict[str, str]:
    """Return the CF attributes of /time; its units name the start without an offset, as netCDF tools like it."""
    try:
        start = datetime.datetime.fromisoformat(start_utc)
    except ValueError:
        raise RecordingError(f"start_utc: '{start_utc}' is no ISO 8601 instant; write 2024-09-17T12:00:00Z") from None
    if start.tzinfo is not None:
        start = start.astimezone(datetime.UTC).replace(tzinfo=None)
    return {
        "units": f"seconds since {start.isoformat(sep=' ')}",
        "calendar": "standard",
        "standard_name": "time",
        "axis": "T",
        "long_name": TIME.meaning,
        "comment": "elapsed SI seconds since start_utc (UTC); a leap second during the run is an ordinary second, so "
        "the calendar time that a reader derives is one second ahead of UTC after it",
    }

"""Datasets of a recording: their paths, their meaning, and the values that a frame puts into them.

Names, dtypes, units and meanings come from the field statements in `records`. The few datasets that no record states,
those of a node of the pose tree, are stated here. Missing values are NaN in floats, -1 in signed integers and 0 in
unsigned integers.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from rso_lidar.errors import RecordingError
from rso_lidar.export.layout import camera_images, intermediates, sensor_samples
from rso_lidar.pose import ROOT, PoseTree
from rso_lidar.records import ArraySpec, BodyState, Frame, Labels, PtuAngles, Reading, Truth, specs

# In the file: in the record.
READING = {"range": "range_m", "intensity": "intensity_counts", "saturated": "saturated"}
RETURNS = {"returns/range": "return_range_m", "returns/intensity": "return_intensity_counts"}
FLAGS = {name: name for name in ("crosstalk", "superimposed")}
LABELS = {f"labels/{field.name}": field.name for field in dataclasses.fields(Labels) if field.default is not None}
MORE_LABELS = {f"labels/{name}": name for name in specs(Labels) if f"labels/{name}" not in LABELS}
_LEAST_COMPRESSED_BYTES = 1024
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
SUN = ArraySpec(_XYZ, _F8, "1", "unit vector to the Sun in inertial axes, NaN in a local world without a Sun")
SUNLIT = ArraySpec((), _F8, "1", "share of the Sun's disc that the Earth leaves free")
TIME = ArraySpec((), _F8, "", "emission of the laser flash")
INDEX = ArraySpec((), np.dtype("i8"), "1", "number of the frame in the scenario")
LENS = ArraySpec((), np.dtype("i4"), "1", "lens_number of the line of sight in force")

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
    "m_s2": "m s-2",
    "rad_s": "rad s-1",
    "deg_s": "degree s-1",
    "hz": "Hz",
    "mhz": "MHz",
    "j": "J",
    "mj": "mJ",
    "kg": "kg",
    "n": "N",
    "n_m": "N m",
    "na": "nA",
    "per_sr": "sr-1",
    "per_s": "s-1",
    "counts": "count",
    "v": "V",
}


@dataclass(frozen=True)
class Variable:
    """One dataset that grows by one entry per frame: its path, its statement, and the shape of an entry."""

    path: str
    spec: ArraySpec
    shape: tuple[int, ...]

    @property
    def is_image(self) -> bool:
        """Whether an entry covers a focal plane: the lidar's, at its own resolution or a finer one, or a camera's."""
        return not {"row", "fine_row", "image_row"}.isdisjoint(self.spec.dims)

    @property
    def is_series(self) -> bool:
        """Whether an entry holds a varying number of samples, and has room for `shape[0]` of them."""
        return sensor_samples.is_series(self.path)

    @property
    def is_compressed(self) -> bool:
        """Whether entries are compressed: below some 1 kB they would hardly become smaller."""
        return self.is_image or self.frame_bytes >= _LEAST_COMPRESSED_BYTES

    @property
    def fill(self) -> float | int | None:
        """Fill value for missing data, or None where zero serves."""
        if self.path in ("time", "frame_index", "lens"):
            return None
        return {"f": np.nan, "i": -1}.get(self.spec.dtype.kind)

    @property
    def frame_bytes(self) -> int:
        """Size of one entry [bytes]."""
        return self.spec.dtype.itemsize * math.prod(self.shape)

    @property
    def chunk(self) -> tuple[int, ...]:
        """Shape of a chunk in the file."""
        # One frame: a chunk is written once. A kill while a chunk of many frames was replaced would leave a checksum
        # that fits none of them.
        return (1, *self.shape)


def list_variables(frame: Frame, capacities: sensor_samples.Capacities | None = None) -> dict[str, Variable]:
    """List the datasets of a recording with such frames, by path.

    Parameters
    ----------
    capacities : samples of each sensor for which an entry has room (None: as the frame needs)
    """
    room = sensor_samples.grow_capacities(frame.observation.sensors, capacities or {})
    array_specs = _list_required(frame) | list_optional(frame)
    sizes = {"row": frame.range_m.shape[0], "col": frame.range_m.shape[1], "xyz": 3, "quaternion": 4}
    variables = {}
    for path, value in collect_values(frame).items():
        own = dict(zip(array_specs[path].dims, np.shape(value), strict=False))  # of returns, samples and the fine grid
        if sensor_samples.is_series(path):
            own["sample"] = room[path.split("/")[1]]
            variables[path] = Variable(path, array_specs[path], tuple(own.values()))
        else:
            variables[path] = Variable(
                path, array_specs[path], tuple((own | sizes)[dim] for dim in array_specs[path].dims)
            )
    for path, variable in variables.items():
        if 0 in variable.shape:
            raise RecordingError(
                f"{path}: the first frame's has the shape {variable.shape}; record at least one of each"
            )
    return variables


def _list_required(frame: Frame) -> dict[str, ArraySpec]:
    """List the datasets that follow from the settings, axes, bodies and PTU of a frame."""
    array_specs = {"time": TIME, "frame_index": INDEX}
    array_specs |= {path: specs(Reading)[name] for path, name in READING.items()}
    array_specs |= {path: specs(Labels)[name] for path, name in LABELS.items()}
    for name in frame.observation.settings:
        array_specs[f"settings/{name}"] = ArraySpec(
            (), _F8, get_setting_unit(name), f"{name.replace('_', ' ')}, as in force"
        )
    if frame.truth.pointing is not None:
        for path, name, place in POINTING:
            spec = specs(PtuAngles)[name]
            array_specs[path] = dataclasses.replace(
                spec, dims=(), meaning=f"{('pan', 'tilt')[place]} of: {spec.meaning}"
            )
    array_specs["truth/sun_direction"] = SUN
    for name in frame.truth.poses:
        if name == "sun_direction" or "/" in name:
            raise RecordingError(f"axes '{name}': a recording cannot hold this name; rename the body")
        array_specs |= {f"truth/{name}/{path}": spec for path, spec in NODE.items()}
    state = {path: dataclasses.replace(specs(BodyState)[field], dims=_XYZ) for path, field in INERTIAL.items()}
    for name in frame.truth.states:
        array_specs |= {f"truth/{name}/{path}": spec for path, spec in state.items()}
    return array_specs


def list_optional(frame: Frame) -> dict[str, ArraySpec]:
    """List the datasets that exist only if the frame has their content.

    An attribute of the file lists them too.
    """
    reading, labels = frame.observation.reading, frame.labels
    array_specs = {
        path: specs(Reading)[name] for path, name in (RETURNS | FLAGS).items() if getattr(reading, name) is not None
    }
    array_specs |= {
        path: specs(Labels)[name] for path, name in MORE_LABELS.items() if getattr(labels, name) is not None
    }
    array_specs |= {f"truth/{name}/sunlit": SUNLIT for name in frame.truth.sunlit}
    array_specs |= sensor_samples.list_arrays(frame.observation.sensors)
    array_specs |= camera_images.list_arrays(frame)
    return array_specs | intermediates.list_arrays(frame.kept)


# Path, field of `PtuAngles`, and place in it: /ptu/pan_demand_rad and so on.
POINTING = [
    (f"ptu/{axis}_{name}", name, place) for name in specs(PtuAngles) for place, axis in enumerate(("pan", "tilt"))
]


def get_setting_unit(name: str) -> str:
    """Return the unit that the suffix of a setting names, as UDUNITS writes it; 1 where it names none.

    >>> [get_setting_unit(name) for name in ("focal_length_m", "max_rate_rad_s", "gain")]
    ['m', 'rad s-1', '1']
    """
    return _UNITS.get(split_unit(name)[1], "1")


def split_unit(name: str) -> tuple[str, str]:
    """Split a name into its stem and the suffix of its unit, which is empty where there is none.

    >>> split_unit("specific_force_m_s2"), split_unit("gain")
    (('specific_force', 'm_s2'), ('gain', ''))
    """
    words = name.split("_")
    for count in range(min(3, len(words) - 1), 0, -1):
        if (end := "_".join(words[-count:])) in _UNITS:
            return "_".join(words[:-count]), end
    return name, ""


def collect_values(frame: Frame) -> dict[str, Any]:
    """Collect the values that a frame puts into each dataset, by path, /time last."""
    observation, truth = frame.observation, frame.truth
    values: dict[str, Any] = {
        path: value
        for record, names in ((observation.reading, READING | RETURNS | FLAGS), (frame.labels, LABELS | MORE_LABELS))
        for path, name in names.items()
        if (value := getattr(record, name)) is not None
    }
    values |= intermediates.collect_arrays(frame.kept, frame.range_m.shape)
    values |= sensor_samples.collect_arrays(observation.sensors)
    values |= camera_images.collect_arrays(frame)
    values |= {f"settings/{name}": value for name, value in observation.settings.items()}
    if truth.pointing is not None:
        values |= {path: getattr(truth.pointing, name)[place] for path, name, place in POINTING}
    values |= {path: value for path, (_, value) in collect_truth(truth).items()}
    values |= {f"truth/{name}/sunlit": share for name, share in truth.sunlit.items()}
    values["frame_index"] = frame.index
    values["time"] = frame.time_s
    return values


def collect_truth(truth: Truth) -> dict[str, tuple[ArraySpec, np.ndarray]]:
    """Collect the direction to the Sun, the axes and the bodies of a truth, as a recording holds them.

    Parameters
    ----------
    truth : at one epoch, with axes named ``lidar``

    Returns
    -------
    dict
        Statement (unit, meaning, dims) and value of each dataset, by its path, such as ``truth/tdrs/position``.

    Raises
    ------
    RecordingError
        If there are no axes named ``lidar``.
    """
    from scipy.spatial.transform import Rotation

    entries = {"truth/sun_direction": (SUN, truth.sun_direction)}
    seen = compute_lidar_poses(truth.poses)
    rotations = [truth.poses[name].matrix for name in seen]
    rotations += [matrix[:3, :3] for matrix in seen.values()]
    quaternions = Rotation.from_matrix(np.array(rotations), assume_valid=True).as_quat(canonical=True)
    for place, (name, matrix) in enumerate(seen.items()):
        link = truth.poses[name]
        from_parent = (link.translation_m, quaternions[place], link.velocity_m_s, link.angular_velocity_rad_s)
        values = (*from_parent, matrix[:3, 3], quaternions[len(seen) + place])
        entries |= {
            f"truth/{name}/{path}": (spec, value) for (path, spec), value in zip(NODE.items(), values, strict=True)
        }
    for name, state in truth.states.items():
        entries |= {
            f"truth/{name}/{path}": (specs(BodyState)[field], getattr(state, field)) for path, field in INERTIAL.items()
        }
    return entries


def compute_lidar_poses(tree: PoseTree) -> dict[str, np.ndarray]:
    """Compute the matrix (4, 4) of lidar_from_<name> for every node, by name, in the order of the tree.

    The tree is walked once, outward from the lidar, so that each pose is composed along the shortest path.
    """
    if "lidar" not in tree:
        raise RecordingError("a frame without axes named 'lidar' cannot be recorded; add them to its truth")
    inward = np.zeros((len(tree), 4, 4))  # parent_from_name
    inward[:, :3, :3] = [tree[name].matrix for name in tree]
    inward[:, :3, 3] = [tree[name].translation_m for name in tree]
    inward[:, 3, 3] = 1.0
    places = {name: k for k, name in enumerate(tree)}
    below: dict[str, list[str]] = {}
    for name in tree:
        below.setdefault(tree.parent(name), []).append(name)
    seen = {"lidar": np.eye(4)}
    waiting = ["lidar"]
    while waiting:
        name = waiting.pop()
        if name != ROOT and tree.parent(name) not in seen:
            rotation, position = inward[places[name], :3, :3], inward[places[name], :3, 3]
            inverse = np.zeros((4, 4))
            inverse[:3, :3], inverse[:3, 3], inverse[3, 3] = rotation.T, -rotation.T @ position, 1.0
            seen[tree.parent(name)] = seen[name] @ inverse
            waiting.append(tree.parent(name))
        for child in below.get(name, []):
            if child not in seen:
                seen[child] = seen[name] @ inward[places[child]]
                waiting.append(child)
    return {name: seen[name] for name in tree}


def get_parents(frame: Frame) -> dict[str, str]:
    """Return the parent of every node of a frame's pose tree."""
    return {name: frame.truth.poses.parent(name) for name in frame.truth.poses}

"""Layout of an HDF5 recording: an empty file with all datasets that a frame fills.

Dimensions are HDF5 dimension scales and attributes follow CF 1.11. Plain h5py, MATLAB, netCDF tools and xarray
therefore read the same names.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from rso_lidar.export.layout import intermediates
from rso_lidar.export.layout.attributes import (
    get_array_attributes,
    get_group_attributes,
    get_root_attributes,
    get_scale_meaning,
    get_sensor_attributes,
    get_time_attributes,
)
from rso_lidar.export.layout.checksum import compute_texts_crc32
from rso_lidar.export.layout.datasets import LENS, Variable, get_parents, list_optional, list_variables
from rso_lidar.export.layout.sensor_samples import Capacities, is_series
from rso_lidar.records import Frame, Observation, Source, specs


def lay_out(
    file: Any, source: Source, frame: Frame, *, changing_lens: bool = False, capacities: Capacities | None = None
) -> dict[str, Variable]:
    """Create all datasets of a recording in an empty h5py file, and return them by path.

    Parameters
    ----------
    file : empty h5py file
    changing_lens : store a table of lines of sight that grows, and the number of each frame's in /lens
    capacities : samples of each sensor for which there is room in a frame (None: as this frame needs)
    """
    variables = list_variables(frame, capacities)
    more = list(list_optional(frame))
    if changing_lens:
        variables["lens"] = Variable("lens", LENS, ())
        more.append("lens")
    _write_attributes(file, get_root_attributes(source) | get_sensor_attributes(frame))
    _write_attributes(file, {"optional_datasets": json.dumps(more)})
    scales = {"time": _make_dataset(file, variables["time"], get_time_attributes(source.start_utc))}
    scales["time"].make_scale("time")
    scales |= {dim: _make_scale(file, dim, size) for dim, size in zip(("row", "col"), frame.range_m.shape, strict=True)}
    for dim, size, meaning in (("xyz", 3, "x, y, z"), ("quaternion", 4, "x, y, z, w")):
        scales[dim] = file.create_dataset(dim, shape=(size,), dtype=">f4", fletcher32=True)
        _write_attributes(scales[dim], {"long_name": meaning})
        scales[dim].make_scale(f"This is a netCDF dimension but not a netCDF variable.{size:10d}")
    _lay_out_line_of_sight(file, frame, scales, changing_lens)
    for path, variable in variables.items():
        if path != "time":
            dataset = _make_dataset(file, variable, get_array_attributes(variable, source))
            _attach_scales(dataset, ("time", *variable.spec.dims), scales | _make_own_scales(dataset, variable, scales))
    for name, parent in get_parents(frame).items():
        _write_attributes(file[f"truth/{name}"], {"parent": parent})
    _write_attributes(
        file["truth"], {"tree": json.dumps(get_parents(frame)), "states": json.dumps(list(frame.truth.states))}
    )
    for group, held in (intermediates.get_constants(frame.kept) | get_group_attributes(frame)).items():
        _write_attributes(file[group], held)
    _write_attributes(file["truth"], {"texts_crc32": np.uint32(compute_texts_crc32(file))})
    return variables


def _lay_out_line_of_sight(file: Any, frame: Frame, scales: dict[str, Any], changing: bool) -> None:
    """Create /line_of_sight, filled unless the lens changes.

    Parameters
    ----------
    file : empty h5py file
    scales : dimension scales by name; a scale is added if the lens changes
    """
    stated = specs(Observation)["line_of_sight"]
    shape, dims = frame.line_of_sight.shape, stated.dims
    squeeze = {"compression": "gzip", "shuffle": True, "fletcher32": True, "dtype": stated.dtype}
    if changing:  # not a dimension `lens`, for HDF5 calls a dimension by its scale, and /lens is another dataset
        grows: Any = {"shape": (0,), "maxshape": (None,), "chunks": (1,)}
        number = file.create_dataset("lens_number", dtype="i4", compression="gzip", fletcher32=True, **grows)
        _write_attributes(number, {"units": "1", "long_name": "number of a lens, in the order of first use"})
        number.make_scale("lens_number")
        scales["lens_number"], dims = number, ("lens_number", *dims)
        grows = {"shape": (0, *shape), "maxshape": (None, *shape), "chunks": (1, *shape)}
        sight = file.create_dataset("line_of_sight", **grows, **squeeze)
    else:
        sight = file.create_dataset("line_of_sight", data=frame.line_of_sight, **squeeze)
    _write_attributes(sight, {"units": stated.unit, "long_name": stated.meaning})
    _attach_scales(sight, dims, scales)


def _make_own_scales(dataset: Any, variable: Variable, scales: Mapping[str, Any]) -> dict[str, Any]:
    """Create the scales of dimensions that only the dataset's group has, such as the samples of waveforms."""
    sizes = zip(variable.spec.dims, variable.shape, strict=True)
    group = dataset.parent
    common = ("xyz", "quaternion") if is_series(variable.path) else scales  # others of a sensor are its own
    return {
        dim: group[dim] if dim in group else _make_scale(group, dim, size) for dim, size in sizes if dim not in common
    }


def _make_scale(group: Any, dim: str, size: int) -> Any:
    """Create the scale of a counted dimension."""
    scale = group.create_dataset(dim, data=np.arange(size, dtype="i4"), dtype="i4", compression="gzip", fletcher32=True)
    _write_attributes(scale, {"units": "1", "long_name": get_scale_meaning(scale.name.strip("/"))})
    scale.make_scale(dim)
    return scale


def _make_dataset(file: Any, variable: Variable, attributes: Mapping[str, Any]) -> Any:
    """Create the empty dataset of a variable.

    Parameters
    ----------
    file : h5py file
    """
    dataset = file.create_dataset(
        variable.path,
        shape=(0, *variable.shape),
        maxshape=(None, *variable.shape),
        chunks=variable.chunk,
        dtype=variable.spec.dtype,
        fillvalue=variable.fill,
        # Small entries are zlib streams, too, though not smaller: to fletcher32 alone, a chunk of zeros is valid.
        compression="gzip",
        compression_opts=1,
        shuffle=variable.is_compressed,
        fletcher32=True,
    )
    _write_attributes(dataset, attributes)
    if variable.fill is not None:
        dataset.attrs.create("_FillValue", np.array([variable.fill], variable.spec.dtype), dtype=variable.spec.dtype)
    return dataset


def _attach_scales(dataset: Any, dims: tuple[str, ...], scales: Mapping[str, Any]) -> None:
    """Attach a scale to each dimension of a dataset.

    Parameters
    ----------
    dataset : of h5py
    """
    for axis, dim in enumerate(dims):
        dataset.dims[axis].attach_scale(scales[dim])


def _write_attributes(place: Any, attributes: Mapping[str, Any]) -> None:
    import h5py

    for name, value in attributes.items():
        if isinstance(value, str):
            place.attrs.create(name, value, dtype=h5py.string_dtype())
        else:
            place.attrs.create(name, value, dtype=np.asarray(value).dtype)

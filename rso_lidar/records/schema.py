"""The base class of records, and the statement of what each of their arrays is."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from rso_lidar.errors import RecordError


@dataclass(frozen=True)
class ArraySpec:
    """What one array of a record is: dimension names, dtype, unit and meaning."""

    dims: tuple[str, ...]
    dtype: np.dtype[Any]
    unit: str
    meaning: str


def array(dims: str, dtype: str, unit: str, meaning: str, *, optional: bool = False) -> Any:
    """Return a dataclass field that holds an array, e.g. ``array("row col", "f4", "m", "slant range")``."""
    spec = ArraySpec(tuple(dims.split()), np.dtype(dtype), unit, meaning)
    metadata = {"array": spec}
    return dataclasses.field(default=None, metadata=metadata) if optional else dataclasses.field(metadata=metadata)


_specs: dict[type, Mapping[str, ArraySpec]] = {}


def specs(record: type) -> Mapping[str, ArraySpec]:
    """Return what each array field of a record class is, by name, in order."""
    if record not in _specs:
        found = {f.name: f.metadata["array"] for f in dataclasses.fields(record) if "array" in f.metadata}
        _specs[record] = MappingProxyType(found)
    return _specs[record]


def locked(values: Any, dtype: np.dtype[Any]) -> np.ndarray:
    """Return a view of values that cannot be written to."""
    view = np.asarray(values, dtype).view()
    view.setflags(write=False)
    return view


@dataclass(frozen=True, eq=False, repr=False)
class Record:
    """Base of records: checks its arrays against their statements, and makes them read-only."""

    def __post_init__(self) -> None:
        sizes: dict[str, int] = {"xyz": 3, "quaternion": 4}
        for name, spec in specs(type(self)).items():
            value = getattr(self, name)
            if value is None:
                continue
            place = f"{type(self).__name__}.{name}"
            try:
                if getattr(value, "dtype", None) is not spec.dtype and np.iscomplexobj(value):
                    raise TypeError  # the conversion would drop the imaginary part with a warning
                values = locked(value, spec.dtype)
            except (TypeError, ValueError, OverflowError):
                given = " ".join(f"{value!r:.60}".split())
                raise RecordError(f"{place}: needs an array of {spec.dtype}, not {given}; convert it") from None
            dims, shape = spec.dims, values.shape
            if dims[0] == "…":  # single, or batched over epochs
                dims, shape = dims[1:], shape[1 - len(dims) :]
            if len(shape) != len(dims):
                raise RecordError(f"{place}: needs dims ({', '.join(spec.dims)}), got {values.shape}; reshape it")
            for dim, size in zip(dims, shape, strict=True):
                if sizes.setdefault(dim, size) != size:
                    raise RecordError(f"{place}: {dim} is {size} here and {sizes[dim]} elsewhere; match them")
            object.__setattr__(self, name, values)

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore what another process sent: arrays arrive writable, and become read-only again."""
        self.__dict__.update(state)
        for name in specs(type(self)):
            if (value := getattr(self, name)) is not None:
                value.setflags(write=False)

    def __repr__(self) -> str:
        """Return the class with the sizes of its arrays, not their contents."""
        sizes = ", ".join(
            f"{name}{list(value.shape)}" for name in specs(type(self)) if (value := getattr(self, name)) is not None
        )
        return f"<{type(self).__name__}: {sizes}>"

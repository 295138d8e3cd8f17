"""The base class of records, and the statements of their arrays."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType
from typing import Any

import numpy as np

from rso_lidar.errors import RecordError


@dataclass(frozen=True)
class ArraySpec:
    """Statement of one array of a record: dimension names, dtype, unit and meaning."""

    dims: tuple[str, ...]
    dtype: np.dtype[Any]
    unit: str
    meaning: str


def array(dims: str, dtype: str, unit: str, meaning: str, *, optional: bool = False) -> Any:
    """State an array field of a record.

    Parameters
    ----------
    dims : names of the dimensions, separated by blanks; ``…`` first for any number of epochs
    dtype : of NumPy, such as ``"f4"``
    unit : as in the CF conventions, such as ``"m s-1"``
    meaning : a phrase for files, docs and labels on screen
    optional : whether the field may be None, its default

    Returns
    -------
    dataclasses.Field
        To be assigned in the class, as in ``range_m: np.ndarray = array("row col", "f4", "m", "slant range")``
    """
    spec = ArraySpec(tuple(dims.split()), np.dtype(dtype), unit, meaning)
    metadata = {"array": spec}
    return dataclasses.field(default=None, metadata=metadata) if optional else dataclasses.field(metadata=metadata)


_specs: dict[type, Mapping[str, ArraySpec]] = {}


def specs(record: type) -> Mapping[str, ArraySpec]:
    """Return the statements of the array fields of a record class, by name, in order.

    Parameters
    ----------
    record : the class
    """
    if record not in _specs:
        statements = {f.name: f.metadata["array"] for f in dataclasses.fields(record) if "array" in f.metadata}
        _specs[record] = MappingProxyType(statements)
    return _specs[record]


def locked(values: Any, dtype: np.dtype[Any]) -> np.ndarray:
    """Return a read-only view of an array."""
    view = np.asarray(values, dtype).view()
    view.setflags(write=False)
    return view


def _check_conversion(values: Any, dtype: np.dtype[Any]) -> None:
    """Refuse values that numpy would convert to wrong values without an error.

    Raises
    ------
    ValueError : if they are complex, or numbers that an integer type does not hold, such as 12.7
    """
    given = getattr(values, "dtype", None)
    if given is None:
        values = np.asarray(values)
        given = values.dtype
    if given.kind == "c":
        raise ValueError
    if dtype.kind in "iu" and given.kind in "fiu" and not np.can_cast(given, dtype) and values.size:
        limits = np.iinfo(dtype)
        if not (limits.min <= values.min() and values.max() <= limits.max):  # NaN is outside, too
            raise ValueError
        if given.kind == "f" and (values != np.trunc(values)).any():
            raise ValueError


@lru_cache(maxsize=1024)
def _check_shapes(record: type, shapes: tuple[tuple[int, ...] | None, ...]) -> None:
    """Check the shapes of the arrays of a record against their dimensions; those that have passed are remembered.

    Parameters
    ----------
    shapes : of each array, in the order of the statements; None for a field without one

    Raises
    ------
    RecordError
        If the number of dimensions is wrong, or one dimension has two sizes
    """
    sizes: dict[str, int] = {"xyz": 3, "quaternion": 4}
    for (name, spec), given in zip(specs(record).items(), shapes, strict=True):
        if given is None:
            continue
        dims, shape = spec.dims, given
        if dims and dims[0] == "…":  # single, or batched over epochs
            dims, shape = dims[1:], shape[1 - len(dims) :]
        place = f"{record.__name__}.{name}"
        if len(shape) != len(dims):
            raise RecordError(f"{place}: needs dims ({', '.join(spec.dims)}), got {given}; reshape it")
        for dim, size in zip(dims, shape, strict=True):
            if sizes.setdefault(dim, size) != size:
                raise RecordError(f"{place}: {dim} is {size} here and {sizes[dim]} elsewhere; match them")


@dataclass(frozen=True, eq=False, repr=False)
class Record:
    """Base class of records: it checks arrays against their statements, and makes them read-only."""

    def __post_init__(self) -> None:
        cls, fields = type(self), self.__dict__
        shapes: list[tuple[int, ...] | None] = []
        for name, spec in specs(cls).items():
            value = fields[name]
            if value is None:
                shapes.append(None)
                continue
            if type(value) is np.ndarray and value.dtype == spec.dtype:  # most of them: nothing to convert
                values = value.view()
                values.setflags(write=False)
            else:
                values = self._convert(name, value, spec.dtype)
            fields[name] = values
            shapes.append(values.shape)
        _check_shapes(cls, tuple(shapes))  # type: ignore[arg-type]  # a class is hashable, whatever its instances are

    def _convert(self, name: str, value: Any, dtype: np.dtype[Any]) -> np.ndarray:
        """Return a value as a read-only array, or raise an error if the conversion would change it."""
        try:
            if getattr(value, "dtype", None) != dtype:
                _check_conversion(value, dtype)
            return locked(value, dtype)
        except (TypeError, ValueError, OverflowError):
            given = " ".join(f"{value!r:.60}".split())
            place = f"{type(self).__name__}.{name}"
            raise RecordError(f"{place}: needs an array of {dtype}, not {given}; convert it") from None

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore a record from another process: its arrays become read-only again."""
        self.__dict__.update(state)
        for name in specs(type(self)):
            if (value := getattr(self, name)) is not None:
                value.setflags(write=False)

    def __repr__(self) -> str:
        """Return the name of the class and the sizes of its arrays."""
        sizes = ", ".join(
            f"{name}{list(value.shape)}" for name in specs(type(self)) if (value := getattr(self, name)) is not None
        )
        return f"<{type(self).__name__}: {sizes}>"

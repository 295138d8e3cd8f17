"""Part: the frozen base class of all that a user describes, and the types of its fields.

A part is what its TOML table fills: same names, units, defaults. Scalars are strict: a text is not a number, and a bool is
not an int. Containers are lax: a TOML list fills a tuple. A bad value raises a `ScenarioError`, one line that names the
place and the cure.
"""

from __future__ import annotations

import datetime
import types
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Annotated, Any, Self, cast

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, GetCoreSchemaHandler, Strict, ValidationError
from pydantic.functional_validators import AfterValidator
from pydantic_core import core_schema

from rso_lidar.errors import ScenarioError
from rso_lidar.part.validation_messages import explain, part_classes, show_value

if TYPE_CHECKING:
    from pydantic._internal._model_construction import ModelMetaclass
else:
    ModelMetaclass = type(BaseModel)


# No physical quantity of a scenario lies outside these limits, in any unit of a key.
GREATEST, _LEAST = 1e12, 1e-12
# Quaternions are written with four digits or more: a larger error of the norm is a mistake, not rounding.
UNIT_NORM_WITHIN = 1e-3


def _with_offset(instant: datetime.datetime) -> datetime.datetime:
    if instant.tzinfo is None:
        raise ValueError("a time without an offset is ambiguous; end it with Z or +00:00")
    try:
        year = instant.astimezone(datetime.UTC).year
    except OverflowError:
        year = 0
    if not 1900 <= year <= 2200:
        raise ValueError(f"{instant.isoformat()} is not between 1900 and 2200; correct the year")
    return instant


def _measurable(value: float) -> float:
    if abs(value) > GREATEST:
        raise ValueError(f"{value:g} exceeds {GREATEST:g} in magnitude; check the number and its unit")
    return value


def _not_vanishing(value: float) -> float:
    if 0.0 < value < _LEAST:
        raise ValueError(f"{value:g} is below {_LEAST:g}; check the number and its unit")
    return value


def _unit(quaternion: tuple[float, ...]) -> tuple[float, ...]:
    norm = float(np.linalg.norm(quaternion))
    if abs(norm - 1.0) > UNIT_NORM_WITHIN:
        raise ValueError(f"needs a unit quaternion x, y, z, w, but its norm is {norm:.6g}; divide by the norm")
    return quaternion


def _nonzero(vector: tuple[float, ...]) -> tuple[float, ...]:
    if np.linalg.norm(vector) < _LEAST:
        raise ValueError("a direction cannot be the zero vector")
    return vector


Number = Annotated[float, Strict(), AfterValidator(_measurable)]
Positive = Annotated[float, Strict(), Field(gt=0), AfterValidator(_measurable), AfterValidator(_not_vanishing)]
NotNegative = Annotated[float, Strict(), Field(ge=0), AfterValidator(_measurable)]
Fraction = Annotated[float, Strict(), Field(ge=0, le=1)]
Whole = Annotated[int, Strict()]
Count = Annotated[int, Strict(), Field(ge=1)]
Flag = Annotated[bool, Strict()]
Text = Annotated[str, Strict(), Field(min_length=1)]
NAME_PATTERN = r"[A-Za-z][A-Za-z0-9_\-]*"
Name = Annotated[str, Strict(), Field(pattern=f"^{NAME_PATTERN}$")]
Instant = Annotated[datetime.datetime, Strict(), AfterValidator(_with_offset)]
Vector = tuple[Number, Number, Number]
Direction = Annotated[Vector, AfterValidator(_nonzero)]
Quaternion = Annotated[tuple[Number, Number, Number, Number], AfterValidator(_unit)]


class _PartMeta(ModelMetaclass):
    """Metaclass of parts: `Part(...)` turns pydantic's report of a bad value into one `ScenarioError`."""

    def __call__(cls, *args: Any, **fields: Any) -> Any:
        try:
            return super().__call__(*args, **fields)
        except ValidationError as error:
            raise ScenarioError(f"{cls.__name__}: {explain(error, cast(type[BaseModel], cls), fields)}") from None


class Part(BaseModel, metaclass=_PartMeta):
    """Base class of all that a user describes: frozen, no unknown keys, no NaN or infinity."""

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        allow_inf_nan=False,
        protected_namespaces=(),
        validate_default=False,
        defer_build=True,  # the validator of a part is built at its first use: few scenarios use all parts
    )

    @classmethod
    def __pydantic_init_subclass__(cls, **kwargs: Any) -> None:
        """Use the first line of a class's docstring as the description of its field `type`, if it has one."""
        tag = cls.__pydantic_fields__.get("type")
        if tag is not None and tag.description is None:
            tag.description = (cls.__doc__ or "").strip().partition("\n")[0].replace("``", "`")

    def __eq__(self, other: object) -> bool:
        """Compare the fields of two parts of one class; cached properties do not count."""
        return type(other) is type(self) and all(self.__dict__[name] == other.__dict__[name] for name in self._names())

    def __hash__(self) -> int:
        return hash((type(self), *(self.__dict__[name] for name in self._names())))

    @classmethod
    def _names(cls) -> Iterable[str]:
        return cls.__pydantic_fields__

    def replace(self, **changes: Any) -> Self:
        """Return a copy with some fields changed, validated like a new part; pydantic's `model_copy` does not validate.

        Parameters
        ----------
        **changes : new values by the names of their fields, in the units of those names

        Raises
        ------
        ScenarioError
            If a name is unknown or a value is not allowed.
        """
        fields = {name: getattr(self, name) for name in self.model_fields_set}
        return type(self)(**{**fields, **changes})


class Seam:
    """Annotation of a field that takes a part of a closed set, or any Python object that follows a protocol.

    A TOML file can describe only the parts of the closed set. From Python, an object of another class is accepted unchanged
    if it has the methods of the protocol. Materials, motions, attitudes and detectors are such fields::

        AnyMaterial = Annotated[DescribedMaterial | Material, Seam(DescribedMaterial, Material)]

        class Target(Part):
            material: AnyMaterial | None = None

    A dump of the part holds ``{ type = "python", object = "module.Class(...)" }`` in place of the object, and so does the
    text that a recording keeps. Such a table cannot be read back: it raises an error that names the object.
    `python_objects` finds the objects before a dump.

    Parameters
    ----------
    described : annotation of the closed set: a union of parts, with its discriminator and validators
    protocol : a protocol decorated with `typing.runtime_checkable`
    """

    def __init__(self, described: Any, protocol: type) -> None:
        self.described, self.protocol = described, protocol

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        """Return the schema of the described parts, which lets objects of the protocol pass."""
        serialize = core_schema.wrap_serializer_function_ser_schema(self._serialize, info_arg=True)
        described = handler.generate_schema(self.described)
        return core_schema.no_info_wrap_validator_function(self._validate, described, serialization=serialize)

    def _is_described(self, value: Any) -> bool:
        return isinstance(value, (*_TOML_TYPES, *part_classes(self.described)))

    def _validate(self, value: Any, validate: Callable[[Any], Any]) -> Any:
        if isinstance(value, Mapping) and value.get("type") == _PYTHON:
            raise ValueError(
                f"represents the Python object {value.get('object', '')!s:.60}, which TOML cannot store; "
                "set it again in Python, with replace(...)"
            )
        if self._is_described(value):
            return validate(value)
        if isinstance(value, type) and isinstance(value, self.protocol):  # the class has the methods too
            raise ValueError(f"is the class {value.__name__}; give an instance, such as {value.__name__}()")
        if not isinstance(value, self.protocol):
            members = {**self.protocol.__annotations__, **vars(self.protocol)}
            methods = ", ".join(sorted(name for name in members if not name.startswith("_")))
            raise ValueError(
                f"needs a table with a 'type', a part, or an object with {methods} (the protocol "
                f"{self.protocol.__name__}), not {show_value(value)}"
            )
        return value

    def _serialize(self, value: Any, serialize: Callable[[Any], Any], info: core_schema.SerializationInfo) -> Any:
        """Dump a part as its table; put a Python object into the context, and dump the table that represents it."""
        if self._is_described(value):
            return serialize(value)
        if isinstance(info.context, _Objects):
            info.context.append(value)
        return python_table(value)


_PYTHON = "python"  # `type` of the table that represents a Python object
_TOML_TYPES = (str, int, float, list, tuple, Mapping, datetime.date, datetime.time, types.NoneType)


class _Objects(list[object]):
    """The Python objects that a dump found."""


def python_objects(part: BaseModel) -> list[object]:
    """Return the Python objects in the fields marked with `Seam` of a part and of all parts inside it.

    Parameters
    ----------
    part : the part
    """
    objects = _Objects()
    part.model_dump(context=objects)
    return list(objects)


def dump_part(value: object) -> dict[str, Any]:
    """Return the table of a part without unset keys, or the table that represents a Python object.

    Parameters
    ----------
    value : a part, or any other object
    """
    return value.model_dump(exclude_none=True) if isinstance(value, Part) else python_table(value)


def python_table(value: object) -> dict[str, Any]:
    """Return the table that represents a Python object in a dump."""
    return {"type": _PYTHON, "object": name_object(value)}


def kind_of(value: object) -> str:
    """Return the `type` of a part, or the `name_object` of any other object.

    Parameters
    ----------
    value : a part, or any other object
    """
    return value.type if isinstance(value, Part) and hasattr(value, "type") else name_object(value)


def name_object(value: object) -> str:
    """Return a text that describes an object without its memory address, such as ``velvet.Velvet(sheen=0.2)``.

    Parameters
    ----------
    value : the object
    """
    cls = type(value)
    try:
        text = " ".join(repr(value).split())
    except Exception:  # whatever a user's own __repr__ raises
        text = ""
    if not text or " at 0x" in text or len(text) > _LONGEST_REPR:
        text = f"{cls.__qualname__}(...)"
    return text if text.startswith(f"{cls.__module__}.") else f"{cls.__module__}.{text}"


_LONGEST_REPR = 200  # characters

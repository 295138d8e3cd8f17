"""Part: the frozen base class of all that a user describes, and the types of its fields.

A part is what its TOML table fills: same names, units, defaults. Scalars are strict: a text is not a number, and a bool is
not an int. Containers are lax: a TOML list fills a tuple. A bad value raises a `ScenarioError`, one line that names the
place and the cure.
"""

from __future__ import annotations

import datetime
import re
import types
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Annotated, Any, Self, cast, get_args, get_origin

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, GetCoreSchemaHandler, Strict, ValidationError
from pydantic.functional_validators import AfterValidator
from pydantic_core import core_schema

from rso_lidar.errors import ScenarioError, did_you_mean

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
Name = Annotated[str, Strict(), Field(pattern=r"^[A-Za-z][A-Za-z0-9_\-]*$")]
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
        **changes : new values by the names of their fields, in the units of those names.

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
    described : annotation of the closed set: a union of parts, with its discriminator and validators.
    protocol : a protocol decorated with `typing.runtime_checkable`.
    """

    def __init__(self, described: Any, protocol: type) -> None:
        self.described, self.protocol = described, protocol

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        """Return the schema of the described parts, which lets objects of the protocol pass."""
        serialize = core_schema.wrap_serializer_function_ser_schema(self._serialize, info_arg=True)
        described = handler.generate_schema(self.described)
        return core_schema.no_info_wrap_validator_function(self._validate, described, serialization=serialize)

    def _is_described(self, value: Any) -> bool:
        return isinstance(value, (*_TOML_TYPES, *_part_classes(self.described)))

    def _validate(self, value: Any, validate: Callable[[Any], Any]) -> Any:
        if isinstance(value, Mapping) and value.get("type") == _PYTHON:
            raise ValueError(
                f"stands for the Python object {value.get('object', '')!s:.60}, which a text cannot hold; "
                "set the object again in Python, with replace(...)"
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
        if self._is_described(value):
            return serialize(value)
        if isinstance(info.context, _Objects):
            info.context.append(value)
        return python_table(value)


_PYTHON = "python"  # `type` of the table that stands for a Python object
_TOML_TYPES = (str, int, float, list, tuple, Mapping, datetime.date, datetime.time, types.NoneType)


class _Objects(list[object]):
    """The Python objects that a dump found."""


def python_objects(part: BaseModel) -> list[object]:
    """Return the Python objects in the fields marked with `Seam` of a part and of all parts inside it."""
    found = _Objects()
    part.model_dump(context=found)
    return list(found)


def dump_part(value: object) -> dict[str, Any]:
    """Return the table of a part without unset keys, or the table that stands for a Python object."""
    return value.model_dump(exclude_none=True) if isinstance(value, Part) else python_table(value)


def python_table(value: object) -> dict[str, Any]:
    """Return the table that stands for a Python object in a dump."""
    return {"type": _PYTHON, "object": name_object(value)}


def kind_of(value: object) -> str:
    """Return the `type` of a part, or the `name_object` of any other object."""
    return value.type if isinstance(value, Part) and hasattr(value, "type") else name_object(value)


def name_object(value: object) -> str:
    """Return a text that describes an object without its memory address, such as ``velvet.Velvet(sheen=0.2)``."""
    cls = type(value)
    try:
        text = " ".join(repr(value).split())
    except Exception:  # whatever a user's own __repr__ raises
        text = ""
    if not text or " at 0x" in text or len(text) > _LONGEST_REPR:
        text = f"{cls.__qualname__}(...)"
    return text if text.startswith(f"{cls.__module__}.") else f"{cls.__module__}.{text}"


_LONGEST_REPR = 200  # characters
_MOST_TYPES = 3  # that a message lists


def explain(error: ValidationError, part: type[BaseModel], raw: Any) -> str:
    """Describe the first problem of a validation in one line, *place: what: what to do*, and count the others.

    Parameters
    ----------
    error : pydantic's report.
    part : class that was validated.
    raw : the values given for its fields, to tell which member of a union was meant.

    Returns
    -------
    str
        The line, without a full stop.
    """
    problems = error.errors(include_url=False)
    # A misspelt key often leaves another key missing: the misspelling is the problem to report.
    first = next((problem for problem in problems if problem["type"] == "extra_forbidden"), problems[0])
    more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
    loc = first["loc"]
    place, owner, others = _place(loc, part, raw)
    if first["type"] == "extra_forbidden":
        place = _place(loc[:-1], part, raw)[0]
    text = _what(first, owner, others)
    return f"{place}: {text}{more}" if place else f"{text}{more}"


def _place(
    loc: tuple[int | str, ...], part: type[BaseModel], raw: Any
) -> tuple[str, type[BaseModel] | None, list[type[BaseModel]]]:
    """Convert pydantic's path of an error to a dotted TOML key, without the tags of unions.

    Parameters
    ----------
    loc : pydantic's path: keys, places in lists, and the tags of unions.
    part : class that was validated.
    raw : the values given for its fields.

    Returns
    -------
    str
        The key, such as ``target[0].motion.file``.
    type or None
        The part class that holds the last key.
    list of types
        The part classes that are allowed in its stead.
    """
    words: list[str] = []
    owner: type[BaseModel] | None = part
    others: list[type[BaseModel]] = []
    here: type[BaseModel] | None = part
    annotation: Any = part
    for step in loc:
        if isinstance(step, int):
            words.append(f"[{step}]")
            raw = raw[step] if isinstance(raw, list | tuple) and step < len(raw) else None
            here = _choose(annotation, raw)
            continue
        if _tag(raw) == step and (here is None or step not in here.model_fields):
            continue  # pydantic's path contains the tag of a union; the TOML key does not
        default = _find_by_type(annotation, step) if here is None and _tag(raw) is None else None
        if default is not None:
            here = default  # a table that leaves out its default type
            continue
        owner, others = here, list(_part_classes(annotation))
        words.append(step if not words else f".{step}")
        if here is None and get_origin(annotation) is dict:
            annotation = get_args(annotation)[1]  # a table whose keys the user chooses
        else:
            field = here.model_fields.get(step) if here else None
            annotation = field.annotation if field else None
        raw = raw.get(step) if isinstance(raw, Mapping) else getattr(raw, step, None)
        here = _choose(annotation, raw)
    return "".join(words), owner, others


def _find_by_type(annotation: Any, tag: str) -> type[BaseModel] | None:
    """Return the part class with this `type` among those that an annotation allows."""
    found = (cls for cls in _part_classes(annotation) if "type" in cls.model_fields)
    return next((cls for cls in found if cls.model_fields["type"].default == tag), None)


def _tag(raw: Any) -> str | None:
    tag = raw.get("type") if isinstance(raw, Mapping) else getattr(raw, "type", None)
    return tag if isinstance(tag, str) else None


def _choose(annotation: Any, raw: Any) -> type[BaseModel] | None:
    """Return the part class that the values `raw` are meant for, among those that an annotation allows."""
    classes = list(_part_classes(annotation))
    tag = _tag(raw)
    for cls in classes:
        field = cls.model_fields.get("type")
        if field is not None and tag is not None and field.default == tag:
            return cls
    return classes[0] if len(classes) == 1 else None


def _part_classes(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and not isinstance(annotation, types.GenericAlias):
        return [annotation] if issubclass(annotation, BaseModel) else []
    return [cls for inner in get_args(annotation) for cls in _part_classes(inner)]


def _what(problem: Any, owner: type[BaseModel] | None, others: Iterable[type[BaseModel]]) -> str:
    """Return what is wrong and what to do, in words of TOML rather than of pydantic.

    Parameters
    ----------
    problem : one error of pydantic.
    owner : part class that holds its last key.
    others : part classes that are allowed in its stead.
    """
    kind, context = problem["type"], problem.get("ctx", {})
    value = problem.get("input")
    if kind == "extra_forbidden":
        key = str(problem["loc"][-1])
        known = list(owner.model_fields) if owner else []
        types = [one.model_fields["type"].default for one in others if {key, "type"} <= set(one.model_fields)]
        if 0 < len(types) <= _MOST_TYPES:
            return f"unknown key '{key}'; it is a key of type = " + " or ".join(f'"{name}"' for name in types)
        guess = did_you_mean(key, known) or (f"; known keys: {', '.join(known)}" if known else "")
        return f"unknown key '{key}'{guess}"
    if kind == "missing":
        return "is missing; give a value"
    if kind == "union_tag_invalid":
        known = [word.strip(" '") for word in context["expected_tags"].split(",")]
        guess = did_you_mean(str(context["tag"]), known)
        return f"unknown type '{context['tag']}'{guess or ''} (known: {', '.join(known)})"
    if kind == "union_tag_not_found":
        return f"needs a table with a 'type', not {show_value(value)}"
    if kind == "literal_error":
        known = [word.strip(" '") for word in re.split(r",| or ", context["expected"])]
        noun = "type" if problem["loc"][-1] == "type" else "value"
        guess = did_you_mean(value, known) if isinstance(value, str) and value not in known else ""
        return f"unknown {noun} {show_value(value)}{guess} (known: {', '.join(known)})"
    if kind == "too_short":
        return f"needs at least {context['min_length']} entries, not {context['actual_length']}; add some"
    if kind == "too_long":
        return f"needs {context['max_length']} entries, not {context.get('actual_length') or 'more'}; remove some"
    if kind in ("dict_type", "model_type", "model_attributes_type"):
        return f"needs a table, not {show_value(value)}"
    if kind == "string_pattern_mismatch":
        if context["pattern"].startswith("^#"):
<<<<<<< HEAD
            return f"needs a colour such as '#a29225', not {_show(value)}"
        return f"needs a letter followed by letters, digits, _ or -, not {_show(value)}"
=======
            return f"needs a colour such as '#a29225', not {show_value(value)}"
        return f"needs letters, digits, _ and -, a letter first, not {show_value(value)}"
>>>>>>> 8c08e60 (What optional members of users' objects say is checked where it enters, in one line)
    if kind == "datetime_type":
        return f"needs a date and time without quotes, such as 2024-09-17T12:00:00Z, not {show_value(value)}"
    if kind == "tuple_type":
        tables = " ([[...]] for a list of tables)" if isinstance(value, dict) else ""
        return f"needs a list{tables}, not {show_value(value)}"
    if kind == "value_error":
        return " ".join(str(context["error"]).splitlines())
    message = problem["msg"].removeprefix("Input ")
    return f"{message}, not {show_value(value)}"


def show_value(value: Any) -> str:
    """Return a value as one short line, for a message."""
    try:
        text = " ".join(repr(value).split())
    except (ValueError, RecursionError):
        text = f"a {type(value).__name__} of more digits than can be shown"
    except Exception:  # whatever a user's own __repr__ raises
        text = f"a {type(value).__name__}"
    return text if len(text) <= 60 else text[:57] + "..."

"""Part: the frozen base of all that a user describes, and the words for its fields.

A part is what its TOML table fills: same names, units, defaults. Scalars are strict (a text is not a number, a bool is
not an int), containers are lax (a TOML list fills a tuple). Bad values raise `ScenarioError` with one line that names
the place and the cure.
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


# Nothing that is described here is beyond these, in any of the units that people say.
GREATEST, _LEAST = 1e12, 1e-12
# Quaternions are written with four digits or more; a norm farther off than that is a mistake, not rounding.
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
        raise ValueError(f"{value:g} is beyond {GREATEST:g}; check the number and its unit")
    return value


def _not_vanishing(value: float) -> float:
    if 0.0 < value < _LEAST:
        raise ValueError(f"{value:g} is below {_LEAST:g}; check the number and its unit")
    return value


def _unit(quaternion: tuple[float, ...]) -> tuple[float, ...]:
    norm = float(np.linalg.norm(quaternion))
    if abs(norm - 1.0) > UNIT_NORM_WITHIN:
        raise ValueError(f"a unit quaternion x, y, z, w is needed, but the norm is {norm:.6g}; divide by it")
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
    """Turns pydantic's report of a bad value into one `ScenarioError`, for `Part(...)` written in Python."""

    def __call__(cls, *args: Any, **fields: Any) -> Any:
        try:
            return super().__call__(*args, **fields)
        except ValidationError as error:
            raise ScenarioError(f"{cls.__name__}: {explain(error, cast(type[BaseModel], cls), fields)}") from None


class Part(BaseModel, metaclass=_PartMeta):
    """The base of all that a user describes: frozen, no unknown keys, no NaN or infinity."""

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        allow_inf_nan=False,
        protected_namespaces=(),
        validate_default=False,
        defer_build=True,  # what checks a part is made when one is first asked for: few scenarios use them all
    )

    @classmethod
    def __pydantic_init_subclass__(cls, **kwargs: Any) -> None:
        """Describe the `type` of a part, if it has one, by the first line of the class."""
        tag = cls.__pydantic_fields__.get("type")
        if tag is not None and tag.description is None:
            tag.description = (cls.__doc__ or "").strip().partition("\n")[0].replace("``", "`")

    def __eq__(self, other: object) -> bool:
        """Two parts are equal where their fields are, whatever has been worked out from them."""
        return type(other) is type(self) and all(self.__dict__[name] == other.__dict__[name] for name in self._names())

    def __hash__(self) -> int:
        return hash((type(self), *(self.__dict__[name] for name in self._names())))

    @classmethod
    def _names(cls) -> Iterable[str]:
        return cls.__pydantic_fields__

    def replace(self, **changes: Any) -> Self:
        """Return a copy with some fields changed, validated like a new part.

        Unlike pydantic's own ``model_copy``, which does not validate.
        """
        fields = {name: getattr(self, name) for name in self.model_fields_set}
        return type(self)(**{**fields, **changes})


class Seam:
    """Annotation of a field that takes one of some parts, or any Python object that follows a protocol.

    What a TOML file can say stays the closed, checked set of parts. From Python, an object of any other class passes as
    it is when it has the protocol's methods. Materials, motions, attitudes and detectors are such fields::

        AnyMaterial = Annotated[DescribedMaterial | Material, Seam(DescribedMaterial, Material)]

        class Target(Part):
            material: AnyMaterial | None = None

    A dump of the part, and so the text that a recording keeps, holds ``{ type = "python", object = "module.Class(...)" }``
    in the object's place. Reading such a table is an error that asks for the object again; see `python_objects` for how to
    find the objects before a dump.

    Parameters
    ----------
    described : the annotation of the closed set: a union of parts, with its discriminator and validators.
    protocol : a protocol decorated with `typing.runtime_checkable`.
    """

    def __init__(self, described: Any, protocol: type) -> None:
        self.described, self.protocol = described, protocol

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        """Return the schema of the described parts, with a way past it for objects."""
        serialize = core_schema.wrap_serializer_function_ser_schema(self._serialize, info_arg=True)
        described = handler.generate_schema(self.described)
        return core_schema.no_info_wrap_validator_function(self._validate, described, serialization=serialize)

    def _is_described(self, value: Any) -> bool:
        return isinstance(value, (*_TOML_TYPES, *_part_classes(self.described)))

    def _validate(self, value: Any, validate: Callable[[Any], Any]) -> Any:
        if isinstance(value, Mapping) and value.get("type") == _PYTHON:
            raise ValueError(
                f"stands for the Python object {value.get('object', '')!s:.60}, which a text cannot hold; "
                "give the object again in Python, with replace(...)"
            )
        if self._is_described(value):
            return validate(value)
        if isinstance(value, type) and isinstance(value, self.protocol):  # the class has the methods too
            raise ValueError(f"is the class {value.__name__}; give an object of it, such as {value.__name__}()")
        if not isinstance(value, self.protocol):
            members = {**self.protocol.__annotations__, **vars(self.protocol)}
            methods = ", ".join(sorted(name for name in members if not name.startswith("_")))
            raise ValueError(
                f"needs a table with a 'type', a part, or an object with {methods} (the protocol "
                f"{self.protocol.__name__}), not {_show(value)}"
            )
        return value

    def _serialize(self, value: Any, serialize: Callable[[Any], Any], info: core_schema.SerializationInfo) -> Any:
        if self._is_described(value):
            return serialize(value)
        if isinstance(info.context, _Objects):
            info.context.append(value)
        return python_table(value)


_PYTHON = "python"  # the type of the table that stands for a Python object
_TOML_TYPES = (str, int, float, list, tuple, Mapping, datetime.date, datetime.time, types.NoneType)


class _Objects(list[object]):
    """Collects the objects that a dump meets."""


def python_objects(part: BaseModel) -> list[object]:
    """Return the Python objects that a part and all parts in it hold in fields marked with `Seam`."""
    found = _Objects()
    part.model_dump(context=found)
    return list(found)


def dump_part(value: object) -> dict[str, Any]:
    """Return the table of a part, without keys that are not set, or the one that stands for another object."""
    return value.model_dump(exclude_none=True) if isinstance(value, Part) else python_table(value)


def python_table(value: object) -> dict[str, Any]:
    """Return the table that stands for a Python object in a dump."""
    return {"type": _PYTHON, "object": name_object(value)}


def kind_of(value: object) -> str:
    """Return the `type` of a part, or a text for another object as `name_object` gives it."""
    return value.type if isinstance(value, Part) and hasattr(value, "type") else name_object(value)


def name_object(value: object) -> str:
    """Return a text for an object without its address in memory, such as ``velvet.Velvet(sheen=0.2)``."""
    cls = type(value)
    text = " ".join(repr(value).split())
    if " at 0x" in text or len(text) > _LONGEST_REPR:
        text = f"{cls.__qualname__}(...)"
    return text if text.startswith(f"{cls.__module__}.") else f"{cls.__module__}.{text}"


_LONGEST_REPR = 200  # characters


def explain(error: ValidationError, part: type[BaseModel], raw: Any) -> str:
    """Return one line, ``place: what: what to do``, for the first problem of a validation, and how many more there are."""
    problems = error.errors(include_url=False)
    # A key that is not known often leaves another missing: the misspelling is what to tell.
    first = next((problem for problem in problems if problem["type"] == "extra_forbidden"), problems[0])
    more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
    loc = first["loc"]
    place, owner = _place(loc, part, raw)
    if first["type"] == "extra_forbidden":
        place = _place(loc[:-1], part, raw)[0]
    text = _what(first, owner)
    return f"{place}: {text}{more}" if place else f"{text}{more}"


def _place(loc: tuple[int | str, ...], part: type[BaseModel], raw: Any) -> tuple[str, type[BaseModel] | None]:
    """Return the dotted TOML place of an error, union tags left out, and the part class that holds its last key."""
    words: list[str] = []
    owner: type[BaseModel] | None = part
    here: type[BaseModel] | None = part
    annotation: Any = part
    for step in loc:
        if isinstance(step, int):
            words.append(f"[{step}]")
            raw = raw[step] if isinstance(raw, list | tuple) and step < len(raw) else None
            here = _choose(annotation, raw)
            continue
        if _tag(raw) == step and (here is None or step not in here.model_fields):
            continue  # pydantic names the branch of a union; the reader's file does not
        untold = _named(annotation, step) if here is None and _tag(raw) is None else None
        if untold is not None:
            here = untold  # a table that leaves its type to the default
            continue
        owner = here
        words.append(step if not words else f".{step}")
        if here is None and get_origin(annotation) is dict:
            annotation = get_args(annotation)[1]  # a table whose keys the user chooses
        else:
            field = here.model_fields.get(step) if here else None
            annotation = field.annotation if field else None
        raw = raw.get(step) if isinstance(raw, Mapping) else getattr(raw, step, None)
        here = _choose(annotation, raw)
    return "".join(words), owner


def _named(annotation: Any, tag: str) -> type[BaseModel] | None:
    """Return the part class of that type among those an annotation allows."""
    found = (cls for cls in _part_classes(annotation) if "type" in cls.model_fields)
    return next((cls for cls in found if cls.model_fields["type"].default == tag), None)


def _tag(raw: Any) -> str | None:
    tag = raw.get("type") if isinstance(raw, Mapping) else getattr(raw, "type", None)
    return tag if isinstance(tag, str) else None


def _choose(annotation: Any, raw: Any) -> type[BaseModel] | None:
    """Return the part class that `raw` was meant to be, among those an annotation allows."""
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


def _what(problem: Any, owner: type[BaseModel] | None) -> str:
    """Return what is wrong and what to do, in our words where pydantic's would puzzle a reader of TOML."""
    kind, context = problem["type"], problem.get("ctx", {})
    value = problem.get("input")
    if kind == "extra_forbidden":
        key = str(problem["loc"][-1])
        known = list(owner.model_fields) if owner else []
        guess = did_you_mean(key, known) or (f"; known keys: {', '.join(known)}" if known else "")
        return f"unknown key '{key}'{guess}"
    if kind == "missing":
        return "is missing; give a value"
    if kind == "union_tag_invalid":
        known = [word.strip(" '") for word in context["expected_tags"].split(",")]
        guess = did_you_mean(str(context["tag"]), known)
        return f"unknown type '{context['tag']}'{guess or ''} (known: {', '.join(known)})"
    if kind == "union_tag_not_found":
        return f"needs a table with a 'type', not {_show(value)}"
    if kind == "literal_error":
        known = [word.strip(" '") for word in re.split(r",| or ", context["expected"])]
        noun = "type" if problem["loc"][-1] == "type" else "value"
        guess = did_you_mean(value, known) if isinstance(value, str) and value not in known else ""
        return f"unknown {noun} {_show(value)}{guess} (known: {', '.join(known)})"
    if kind == "too_short":
        return f"needs at least {context['min_length']} entries, not {context['actual_length']}; add some"
    if kind == "too_long":
        return f"needs {context['max_length']} entries, not {context.get('actual_length') or 'more'}; leave some out"
    if kind in ("dict_type", "model_type", "model_attributes_type"):
        return f"needs a table, not {_show(value)}"
    if kind == "string_pattern_mismatch":
        if context["pattern"].startswith("^#"):
            return f"needs a colour such as '#a29225', not {_show(value)}"
        return f"needs letters, digits, _ and -, a letter first, not {_show(value)}"
    if kind == "datetime_type":
        return f"needs a date and time without quotes, such as 2024-09-17T12:00:00Z, not {_show(value)}"
    if kind == "tuple_type":
        tables = " ([[...]] for a list of tables)" if isinstance(value, dict) else ""
        return f"needs a list{tables}, not {_show(value)}"
    if kind == "value_error":
        return " ".join(str(context["error"]).splitlines())
    message = problem["msg"].removeprefix("Input ")
    return f"{message}, not {_show(value)}"


def _show(value: Any) -> str:
    try:
        text = " ".join(repr(value).split())
    except (ValueError, RecursionError):
        text = f"a {type(value).__name__} of more digits than can be shown"
    return text if len(text) <= 60 else text[:57] + "..."

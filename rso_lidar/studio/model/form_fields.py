"""Fields of a part as a form shows them: kind, unit, meaning, bounds, default and choices, read from their statements."""

from __future__ import annotations

import datetime
import json
import re
import types
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from rso_lidar.errors import ScenarioError
from rso_lidar.mission_analysis import split_unit
from rso_lidar.part import Part, Seam, describe_type, parse_toml, part_classes

SCALARS = ("number", "whole", "flag", "text", "instant", "choice", "value")
TABLES = ("table", "variant", "entries")


@dataclass(frozen=True)
class FieldForm:
    """A field as a form shows it.

    `kind` is one of `SCALARS`, or `table` for a table of one part, `variant` for a table of several by their `type`, or
    `entries` for a list of tables. `bounds` are words such as ``number > 0``; a `value` is written as in TOML. `choices` are
    the values of a choice, or the types of a variant with their meaning. `classes` are the parts that fill a table, and
    `usual` is the type of one that names none; empty where the type is required.
    """

    key: str
    kind: str
    unit: str
    meaning: str
    bounds: str
    default: str
    required: bool
    choices: Mapping[str, str]
    classes: tuple[type[Part], ...]
    usual: str = ""

    def choose(self, tables: Any) -> type[Part] | None:
        """Return the part that fills a table, by its `type`."""
        if len(self.classes) == 1:
            return self.classes[0]
        tag = tables.get("type", self.usual) if isinstance(tables, Mapping) else None
        return next((cls for cls in self.classes if _tag(cls) == tag), None)

    def show_default(self, scenario: Any, place: str) -> str:
        """Return the value that holds where the text has none: of a scenario with its presets, or else the default.

        Parameters
        ----------
        scenario : None where the text is not one
        """
        return show_value(find_value_in_force(scenario, place)) or self.default

    def name_default(self, default: str) -> str:
        """Return the words for an empty choice, whose value is then `default`."""
        return "required" if self.required else f"default: {default}" if default else "default"


def list_fields(cls: type[Part]) -> list[FieldForm]:
    """List the fields of a part, without its `type`, which the choice of the part sets."""
    return [_read_field(name, field) for name, field in cls.model_fields.items() if name != "type"]


def find_part(cls: type[Part], tables: Mapping[str, Any], steps: tuple[str | int, ...]) -> type[Part] | None:
    """Return the part that fills the table at a place of a text; None where it is not known."""
    part: type[Part] | None = cls
    here: Any = tables
    field: FieldForm | None = None
    for step in steps:
        if isinstance(step, int):
            here = here[step] if isinstance(here, list) and step < len(here) else None
        else:
            field = (
                next((candidate for candidate in list_fields(part) if candidate.key == step), None) if part else None
            )
            here = here.get(step) if isinstance(here, Mapping) else None
        part = field.choose(here) if field else None
    return part


def find_field(cls: type[Part], tables: Mapping[str, Any], steps: tuple[str | int, ...]) -> FieldForm | None:
    """Return the field that holds the table, or the list with the entry, at a place of a text; None where it is not known.

    Parameters
    ----------
    steps : as in `find_part`
    """
    names = [step for step in steps if isinstance(step, str)]
    parent = find_part(cls, tables, tuple(names[:-1])) if names[1:] else cls
    return next((field for field in list_fields(parent) if names and field.key == names[-1]), None) if parent else None


def iterate_tables(cls: type[Part], tables: Mapping[str, Any], nested: str) -> Iterator[tuple[str, str, bool]]:
    """Yield the label and the place of each table that a text may have, and whether it has it."""
    for field in list_fields(cls):
        value = tables.get(field.key)
        if field.kind == "entries":
            for number, entry in enumerate(value if isinstance(value, list) else []):
                name = entry.get("name", entry.get("type", "")) if isinstance(entry, Mapping) else ""
                yield f"{field.key}: {name}", f"{field.key}[{number}]", True
        elif field.kind in TABLES:
            yield field.key, field.key, value is not None
            if field.key == nested:
                held = value if isinstance(value, Mapping) else {}
                for inner in list_fields(field.classes[0]):
                    if inner.kind in TABLES:
                        here = f"{field.key}.{inner.key}"
                        yield here, here, held.get(inner.key) is not None


def make_entry(cls: type[Part], key: str, entries: Sequence[Any]) -> dict[str, Any]:
    """Make a new entry of a list of tables, with a free name and its type where it has them."""
    table: dict[str, Any] = {"type": cls.model_fields["type"].default} if "type" in cls.model_fields else {}
    if "name" in cls.model_fields and cls.model_fields["name"].is_required():
        taken = {entry.get("name") for entry in entries if isinstance(entry, Mapping)}
        table["name"] = next(f"{key}_{k}" for k in range(1, len(entries) + 2) if f"{key}_{k}" not in taken)
    return table


def parse_value(kind: str, text: str) -> Any:
    """Return the value that a user typed into a field, as TOML has it.

    Parameters
    ----------
    kind : of the field, one of `SCALARS`

    Raises
    ------
    ScenarioError
        If the text is no such value.
    """
    text = text.strip()
    if kind in ("text", "choice"):
        return text
    try:
        value = parse_toml(f"value = {text}", "value", ScenarioError)["value"] if "\n" not in text else None
    except ScenarioError:
        value = None
    words = {"number": "a number such as 12.5", "whole": "a whole number", "flag": "true or false"}
    allowed: dict[str, tuple[type, ...]] = {"number": (int, float), "whole": (int,), "instant": (datetime.datetime,)}
    right = value is not None and isinstance(value, allowed.get(kind, (object,)))
    if not right or (kind in ("number", "whole") and isinstance(value, bool)):
        wanted = words.get(
            kind, "a time such as 2024-09-17T12:00:00Z" if kind == "instant" else "TOML, such as [0, 0, 1]"
        )
        raise ScenarioError(f"{text:.40}: is not {wanted}")
    return value


def show_value(value: Any) -> str:
    """Return a value of a TOML text as a user types it."""
    if value is None:
        return ""
    if isinstance(value, str):
        return value
    if isinstance(value, datetime.datetime):
        return value.isoformat().replace("+00:00", "Z")
    if isinstance(value, Mapping):
        keys = {key: key if re.fullmatch(r"[A-Za-z0-9_-]+", key) else _quote(key) for key in value}
        return "{ " + ", ".join(f"{keys[key]} = {_quote(inner)}" for key, inner in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_quote(inner) for inner in value) + "]"
    return str(value).lower() if isinstance(value, bool) else str(value)


def find_value_in_force(scenario: Any, place: str) -> Any:
    """Return the value that is in force at a place of a scenario, defaults and presets included; None for none or a table.

    Parameters
    ----------
    scenario : or None
    place : such as ``lidar.laser.energy_mj``
    """
    here = scenario
    for step in place.replace("[", ".").replace("]", "").split("."):
        if here is None:
            return None
        here = (here[int(step)] if int(step) < len(here) else None) if step.isdigit() else getattr(here, step, None)
    return None if isinstance(here, Part) or here in ((), {}) else here


def _quote(value: Any) -> str:
    if not isinstance(value, str):
        return show_value(value)
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")  # the one character that only TOML escapes


def _read_field(name: str, field: FieldInfo) -> FieldForm:
    annotation, metadata = _unwrap(field.annotation, list(field.metadata))
    classes = tuple(cls for cls in dict.fromkeys(part_classes(annotation)) if issubclass(cls, Part))
    members = [member for member in _members(annotation) if member is not type(None)]
    kind = _find_kind(members, classes)
    literals = [value for member in members if get_origin(member) is Literal for value in get_args(member)]
    choices = (
        {_tag(cls): (cls.__doc__ or "").strip().partition("\n")[0].replace("`", "") for cls in classes}
        if kind in ("variant", "entries")
        else {}
    )
    default = None if field.is_required() else field.get_default(call_default_factory=True)
    said = field.description or ""
    numeric = kind in ("number", "whole", "value")
    unit, meaning = split_unit(name, said) if numeric else ("", said)
    return FieldForm(
        key=name,
        kind=kind,
        unit="" if unit == "1" else unit,
        meaning=meaning.replace("`", ""),
        bounds=describe_type(annotation, metadata).replace("`", "") if numeric and not classes else "",
        default="" if isinstance(default, BaseModel) or default in (None, (), {}) else show_value(default),
        required=field.is_required(),
        choices=choices if kind != "choice" else {str(value): "" for value in literals},
        classes=classes if kind in TABLES else (),
        usual=_tag(type(default)) if isinstance(default, Part) and type(default) in classes else "",
    )


def _find_kind(members: list[Any], classes: tuple[type[Part], ...]) -> str:
    """Return the kind of a field whose type is a union of `members`, and which the parts `classes` may fill."""
    origins = {get_origin(member) for member in members}
    if classes and not origins & {dict, tuple}:
        return "table" if len(classes) == 1 and "type" not in classes[0].model_fields else "variant"
    if classes and len(members) == 1 and origins == {tuple}:
        return "entries"
    if members and all(get_origin(member) is Literal and isinstance(get_args(member)[0], str) for member in members):
        return "choice"
    # A TOML file names the dynamics, in Python any function, by a text.
    kinds = {float: "number", int: "whole", bool: "flag", str: "text", Any: "text", datetime.datetime: "instant"}
    return kinds.get(members[0], "value") if len(members) == 1 else "value"


def _unwrap(annotation: Any, metadata: list[Any]) -> tuple[Any, list[Any]]:
    """Return an annotation without `Annotated`, and the metadata; of a seam, what a text may describe."""
    seams = [item for item in metadata if isinstance(item, Seam)]
    if seams:
        return _unwrap(seams[0].described, [])
    if get_origin(annotation) is Annotated:
        first, *more = get_args(annotation)
        flat = [inner for item in more for inner in (item.metadata if isinstance(item, FieldInfo) else [item])]
        return _unwrap(first, [*flat, *metadata])
    return annotation, metadata


def _members(annotation: Any) -> list[Any]:
    """Return the members of a union, without `Annotated`; another annotation is its only member."""
    if get_origin(annotation) in (Union, types.UnionType):
        return [inner for member in get_args(annotation) for inner in _members(_unwrap(member, [])[0])]
    return [annotation]


def _tag(cls: type[BaseModel]) -> str:
    field = cls.model_fields.get("type")
    return str(field.default) if field else cls.__name__

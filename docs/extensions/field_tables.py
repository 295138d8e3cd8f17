"""Fields of parts and records in the API, from where they are stated: descriptions of fields, and specs of arrays."""

import dataclasses
import inspect
import re

import generate

from rso_lidar import records
from rso_lidar.part import Part


def part_parameters(cls: type[Part]) -> list[str]:
    """Return the fields of a part as the section *Parameters* of a numpy docstring."""
    lines = ["", "Parameters", "----------"]
    for name, field in cls.model_fields.items():
        lines += [f"{name} : {generate.describe_field(cls, name)}", f"    {_one_line(field.description or '')}"]
    return lines if len(lines) > 3 else []


def record_attributes(cls: type) -> list[str]:
    """Return the fields of a record as the section *Fields* of a numpy docstring."""
    arrays = records.specs(cls)
    lines = ["", "Fields", "------"]
    for field in dataclasses.fields(cls):
        if field.name.startswith("_"):
            continue
        if spec := arrays.get(field.name):
            unit = "" if spec.unit == "1" else f", [{spec.unit}]"
            lines += [
                f"{field.name} : ({', '.join(spec.dims)}) {spec.dtype.name}{unit}",
                f"    {_one_line(spec.meaning)}",
            ]
        else:
            lines += [f"{field.name} : {field.type}", "    \\"]
    return lines if len(lines) > 3 else []


def _one_line(text: str) -> str:
    return " ".join(text.replace("\\", "\\\\").replace("*", "\\*").split()) or "\\"


def add_fields(_app, what, _name, value, _options, lines):
    """Add the fields to the docstring of a part or a record, above its examples, unless it lists them itself."""
    if what != "class" or not inspect.isclass(value) or "Parameters" in lines:
        return
    if issubclass(value, Part):
        made = part_parameters(value)
    elif dataclasses.is_dataclass(value):
        made = record_attributes(value)
    else:
        return
    place = next((k for k, line in enumerate(lines) if line.startswith(">>>")), len(lines))
    if lines[place - 2 : place] == ["Examples", "--------"]:
        place -= 2
    lines[place:place] = [*made, ""]


def drop_fields(_app, what, name, value, skip, options):
    """Leave out pydantic's own members, which every part inherits, and fields, which the table lists."""
    if what == "class" and (name.startswith("model_") or name in ("copy", "dict", "json", "parse_obj")):
        return True
    return None if not skip else True


def escape(text: str) -> str:
    """Escape bars of absolute values, which reStructuredText takes for substitutions; code stays as it is."""
    pieces = text.split("`")
    pieces[::2] = [piece.replace("\\|", "|").replace("|", "\\|") for piece in pieces[::2]]
    return "`".join(pieces)


def separate_names(lines: list[str]) -> list[str]:
    """Return a docstring whose parameters and errors have their text below their name; here it follows the colon."""
    made, inside = [], False
    for k, line in enumerate(lines):
        if set(line.strip()) == {"-"} and k:
            inside = lines[k - 1].strip() in ("Parameters", "Other Parameters", "Raises")
        found = re.match(r"([\w*, ]+) : (.+)", line) if inside else None
        made += [found[1], f"    {found[2]}"] if found else [line]
    return made


def head_examples(lines: list[str]) -> list[str]:
    """Return a docstring with a heading over its examples; napoleon takes those in a section for its entries."""
    first = next((k for k, line in enumerate(lines) if line.startswith(">>>")), None)
    headings = [lines[k - 1].strip() for k in range(1, first or 0) if re.fullmatch("-{3,}", lines[k].strip())]
    if first is None or not headings or headings[-1] == "Examples":
        return lines
    return [*lines[:first], "Examples", "--------", *lines[first:]]


def prepare(_app, what, _name, _value, _options, lines):
    """Escape the bars of a docstring, put the text of its parameters below their names, and head its examples."""
    lines[:] = head_examples(separate_names([escape(line) for line in lines]))
    if what == "property" and lines:
        lines[:0] = ["..", ""]  # an empty comment: napoleon takes a property's first line up to a colon for its type


def setup(app):
    """Connect all to autodoc, before napoleon reads the docstrings."""
    app.connect("autodoc-process-docstring", prepare, priority=90)
    app.connect("autodoc-process-docstring", add_fields, priority=100)
    app.connect("autodoc-skip-member", drop_fields)
    return {"parallel_read_safe": True, "parallel_write_safe": True}

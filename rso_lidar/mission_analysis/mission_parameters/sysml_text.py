"""Parameters as a model in the textual notation of SysML v2 (OMG formal/2025-09, clause 8.2.2).

Each part of a scenario is a `part` usage, each parameter an `attribute` usage with its quantity of ISQ, its unit of SI and
its meaning. Grammar and libraries: github.com/Systems-Modeling/SysML-v2-Release, release 2026-06.
"""

from __future__ import annotations

import datetime
import re
from collections.abc import Iterable, Sequence
from typing import Any

from rso_lidar.mission_analysis.mission_parameters.parameter_list import MissionParameter
from rso_lidar.mission_analysis.mission_parameters.sysml_units import declare_units, find_notation

SYSML_MISSION = "mission"  # name of the part that holds all parameters
_IMPORTS = ("ScalarValues", "ISQ", "SI", "SIPrefixes", "MeasurementReferences", "Quantities", "VerificationCases")
_RESERVED = frozenset(  # RESERVED_KEYWORD of SysML-textual-bnf.kebnf
    re.findall(
        r"\w+",
        """about abstract accept action actor after alias all allocate allocation analysis and as assert assign assume at
        attribute bind binding by calc case comment concern connect connection constant constraint crosses decide def
        default defined dependency derived do doc else end entry enum event exhibit exit expose false filter first flow for
        fork frame from hastype if implies import in include individual inout interface istype item join language library
        locale loop merge message meta metadata nonunique not null objective occurrence of or ordered out package parallel
        part perform port private protected public redefines ref references render rendering rep require requirement return
        satisfy send snapshot specializes stakeholder standard state subject subsets succession terminate then timeslice to
        transition true until use variant variation verification verify via view viewpoint when while xor""",
    )
)


def quote_name(name: str) -> str:
    """Return a name as SysML writes it: in single quotes if it is reserved or no basic name.

    Parameters
    ----------
    name : any text

    >>> quote_name("ifov_rad"), quote_name("state"), quote_name("LID-010")
    ('ifov_rad', "'state'", "'LID-010'")
    """
    if re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", name) and name not in _RESERVED:
        return name
    text = name.replace("\\", "\\\\").replace("'", "\\'").replace("\n", " ")
    return f"'{text}'"


def write_comment(text: str) -> str:
    """Return a text as documentation of the element around it, on one line.

    Parameters
    ----------
    text : of one or several lines, which may hold the end mark of a comment
    """
    return f"doc /* {' '.join(text.split()).replace('*/', '* /')} */"


def declare_attribute(name: str, unit: str, value: float | None = None) -> str:
    """Write an attribute usage of a quantity, without its end.

    Parameters
    ----------
    name : of the attribute, as SysML writes it
    unit : of the quantity, such as ``m/s``; a real number where SysML has none for it, such as photons
    value : in that unit (None: the attribute has none)

    Returns
    -------
    str
        Such as ``attribute at_least : LengthValue = 5.0 [m]``.

    >>> declare_attribute("at_least", "m", 5.0), declare_attribute("quantity", "photons")
    ('attribute at_least : LengthValue = 5.0 [m]', 'attribute quantity : Real')
    """
    notation = find_notation(unit)
    declared = f"attribute {name} : {notation.type}"
    return declared if value is None else f"{declared} = {_write_value(value, notation.unit)}"


def write_model(name: str, parameters: Sequence[MissionParameter], about: str, more: Iterable[str] = ()) -> str:
    """Write a package with one part that holds all parameters.

    Keys without a value are left out.
    """
    more = list(more)
    given = [parameter for parameter in parameters if parameter.value is not None and parameter.value not in ((), {})]
    units = {find_notation(parameter.unit).unit for parameter in given}
    lines = [f"package {quote_name(name)} {{", f"    {write_comment(about)}"]
    lines += [f"    private import {library}::*;" for library in _IMPORTS]
    lines += [f"    {line}" for line in declare_units(units | _find_units(more))]
    lines += [f"    part {SYSML_MISSION} {{"]
    here: list[str] = []
    for parameter in sorted(given, key=_order_within(given)):
        *steps, last = parameter.path.split(".")
        common = next(
            (k for k, (a, b) in enumerate(zip(here, steps, strict=False)) if a != b), min(len(here), len(steps))
        )
        lines += [f"{'    ' * (2 + k)}}}" for k in reversed(range(common, len(here)))]
        lines += [f"{'    ' * (2 + k)}part {quote_name(steps[k])} {{" for k in range(common, len(steps))]
        here = steps
        lines += [f"{'    ' * (2 + len(steps))}{line}" for line in _write_attribute(last, parameter)]
    lines += [f"{'    ' * (2 + k)}}}" for k in reversed(range(len(here)))]
    return "\n".join([*lines, "    }", *(f"    {line}" for line in more), "}", ""])


def _order_within(parameters: Sequence[MissionParameter]) -> Any:
    """Return a key that sorts parameters so that those of one part are together, in the order of first appearance."""
    first: dict[tuple[str, ...], int] = {}
    for number, parameter in enumerate(parameters):
        steps = tuple(parameter.path.split("."))
        for depth in range(1, len(steps) + 1):
            first.setdefault(steps[:depth], number)

    def key(parameter: MissionParameter) -> list[tuple[int, int]]:
        steps = tuple(parameter.path.split("."))
        return [(int(depth < len(steps)), first[steps[:depth]]) for depth in range(1, len(steps) + 1)]

    return key


def _find_units(lines: Iterable[str]) -> set[str]:
    """Return the expressions of units in square brackets in some lines."""
    return {unit for line in lines for unit in re.findall(r"\[([^\[\]]+)\]", line)}


def _write_attribute(name: str, parameter: MissionParameter) -> list[str]:
    """Write the attribute usage of a parameter."""
    notation = find_notation(parameter.unit)
    values = list(_flatten(parameter.value))
    kind = notation.type if parameter.unit and notation.unit else _choose_type(values)
    many = f"[{len(values)}] ordered nonunique" if isinstance(parameter.value, tuple) else ""
    written = [_write_value(value, notation.unit) for value in values]
    text = f"({', '.join(written)})" if many else written[0]
    unit = f" Unit: {parameter.unit}." if parameter.unit not in ("", "1") and not notation.unit else ""
    return [
        f"attribute {quote_name(name)} : {kind}{many} = {text} {{",
        f"    {write_comment(f'{parameter.meaning}{unit} Source: {parameter.source}.')}",
        "}",
    ]


def _flatten(value: Any) -> Iterable[Any]:
    if isinstance(value, tuple):
        for item in value:
            yield from _flatten(item)
    else:
        yield value


def _choose_type(values: list[Any]) -> str:
    """Return the scalar type that all values have."""
    if all(isinstance(value, bool) for value in values):
        return "Boolean"
    if all(isinstance(value, int) and not isinstance(value, bool) for value in values):
        return "Integer"
    if all(isinstance(value, int | float) and not isinstance(value, bool) for value in values):
        return "Real"
    return "String"


def _write_value(value: Any, unit: str) -> str:
    """Return a value as an expression of SysML.

    >>> _write_value(1064.0, "nm"), _write_value("a", ""), _write_value(True, "")
    ('1064.0 [nm]', '"a"', 'true')
    """
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int | float):
        return f"{value!r} [{unit}]" if unit else repr(value)
    text = value.isoformat() if isinstance(value, datetime.datetime) else str(value)
    escaped = text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
    return f'"{escaped}"'

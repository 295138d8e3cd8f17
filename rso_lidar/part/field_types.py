"""Types of fields in words, with their limits, for documentation and forms."""

from __future__ import annotations

import datetime
import re
import types
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from rso_lidar.part.model import Direction, Name, Quaternion


def describe_type(annotation: Any, metadata: list[Any]) -> str:
    """Return the type of a value in words, with its limits.

    Parameters
    ----------
    annotation : of the field
    metadata : of the field, which holds its limits
    """
    origin, args = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        flat = [inner for item in args[1:] for inner in (item.metadata if hasattr(item, "metadata") else [item])]
        return describe_type(args[0], [*flat, *metadata])
    if origin in (Union, types.UnionType):
        return " or ".join(describe_type(inner, metadata) for inner in args if inner is not type(None))
    if origin is Literal:
        return " or ".join(f'`"{value}"`' if isinstance(value, str) else f"`{value}`" for value in args)
    if origin is tuple:
        return _describe_tuple(args, metadata)
    if origin is dict:
        return f"table of {_plural(describe_type(args[1], []))} by name"
    words = {float: "number", int: "whole number", str: "text", bool: "true or false", Any: "text"}
    if annotation is datetime.datetime:
        return "date and time with offset"
    patterns = [item.pattern for item in metadata if getattr(item, "pattern", None)]
    if get_args(Name)[-1].metadata[-1].pattern in patterns:
        return "name: a letter, then letters, digits, `_` or `-`"
    limits = [_limit(item) for item in metadata]
    return " ".join([words[annotation], " and ".join(filter(None, limits))]).strip()


def _describe_tuple(args: tuple[Any, ...], metadata: list[Any]) -> str:
    if any(item in get_args(Quaternion) for item in metadata):
        return "unit quaternion x, y, z, w"
    if args[-1] is Ellipsis:
        return f"list of {_plural(describe_type(args[0], []))}"
    inner = describe_type(args[0], [])
    nonzero = ", not all zero" if any(item in get_args(Direction) for item in metadata) else ""
    if get_origin(args[0]) is tuple:
        return f"{len(args)} lists of {inner}"
    return f"{len(args)} {_plural(inner)}{nonzero}"


def _plural(words: str) -> str:
    return re.sub(r"(?:^|(?<= or ))(whole number|number|text|name|list|table)\b", r"\1s", words)


def _limit(item: Any) -> str:
    for name, sign in (("gt", ">"), ("ge", "≥"), ("lt", "<"), ("le", "≤")):
        if hasattr(item, name):
            bound = getattr(item, name)
            return f"{sign} 2^{bound.bit_length() - 1}" if bound == 2**63 else f"{sign} {bound:g}"
    return ""

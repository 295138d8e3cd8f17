"""Messages for values that a part does not take: the place as a TOML key, what is wrong, and what to do."""

from __future__ import annotations

import re
import types
from collections.abc import Iterable, Mapping
from typing import Any, get_args, get_origin

from pydantic import BaseModel, ValidationError

from rso_lidar.errors import did_you_mean, join_problems

_MOST_TYPES = 3  # that a message lists
_KNOWN_KEYS = "; known keys: "
_GUESS = re.compile("; did you mean '(.*)'")


def explain(error: ValidationError, part: type[BaseModel], raw: Any) -> str:
    """Describe the problems of a validation in one line, *place: what: what to do* each, the causes first.

    Parameters
    ----------
    error : pydantic's report
    part : class that was validated
    raw : the values given for its fields, to tell which member of a union was meant

    Returns
    -------
    str
        The line, without a full stop.
    """
    # A misspelt key often leaves another key missing: the misspelling is the problem to report.
    problems = sorted(error.errors(include_url=False), key=lambda problem: problem["type"] != "extra_forbidden")
    texts: dict[str, str] = {}  # by key; of the members of a union that refuse one value, the first speaks
    guesses = set()
    listed = set()  # tables whose known keys are told already
    for problem in problems:
        loc = problem["loc"]
        key, owner, others = _place(loc, part, raw)
        if key in texts or (key in guesses and problem["type"] == "missing"):
            continue
        place, text = key, _what(problem, owner, others)
        if problem["type"] == "extra_forbidden":
            place = _place(loc[:-1], part, raw)[0]
            what, known_keys, _ = text.partition(_KNOWN_KEYS)
            text = what if known_keys and place in listed else text
            if known_keys:
                listed.add(place)
            if guess := _GUESS.search(text):
                guesses.add(f"{place}.{guess[1]}" if place else guess[1])
        texts[key] = f"{place}: {text}" if place else text
    # A table that one member of a union refuses for a key is refused by the others because it is a table.
    parents = {key[: dot.start()] for key in texts for dot in re.finditer(r"\.", key)}
    return join_problems(text for key, text in texts.items() if key not in parents)


def _place(
    loc: tuple[int | str, ...], part: type[BaseModel], raw: Any
) -> tuple[str, type[BaseModel] | None, list[type[BaseModel]]]:
    """Convert pydantic's path of an error to a dotted TOML key, without the tags of unions.

    Parameters
    ----------
    loc : pydantic's path: keys, places in lists, and the tags of unions
    part : class that was validated

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
        if isinstance(raw, str | int | float | list | tuple):
            continue  # pydantic's path names the type that it tried; a plain value has no keys
        if _tag(raw) == step and (here is None or step not in here.model_fields):
            continue  # pydantic's path contains the tag of a union; the TOML key does not
        default = _find_by_type(annotation, step) if here is None and _tag(raw) is None else None
        if default is not None:
            here = default  # a table that leaves out its default type
            continue
        owner, others = here, list(part_classes(annotation))
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
    classes = (cls for cls in part_classes(annotation) if "type" in cls.model_fields)
    return next((cls for cls in classes if cls.model_fields["type"].default == tag), None)


def _tag(raw: Any) -> str | None:
    tag = raw.get("type") if isinstance(raw, Mapping) else getattr(raw, "type", None)
    return tag if isinstance(tag, str) else None


def _choose(annotation: Any, raw: Any) -> type[BaseModel] | None:
    """Return the part class that the values `raw` are meant for, among those that an annotation allows."""
    classes = list(part_classes(annotation))
    tag = _tag(raw)
    for cls in classes:
        field = cls.model_fields.get("type")
        if field is not None and tag is not None and field.default == tag:
            return cls
    return classes[0] if len(classes) == 1 else None


def part_classes(annotation: Any) -> list[type[BaseModel]]:
    """Return the part classes that an annotation allows, in its order.

    Parameters
    ----------
    annotation : of a field, such as ``tuple[Lambertian | Phong, ...]``
    """
    if isinstance(annotation, type) and not isinstance(annotation, types.GenericAlias):
        return [annotation] if issubclass(annotation, BaseModel) else []
    return [cls for inner in get_args(annotation) for cls in part_classes(inner)]


def _what(problem: Any, owner: type[BaseModel] | None, others: Iterable[type[BaseModel]]) -> str:
    """Return what is wrong and what to do, in words of TOML rather than of pydantic.

    Parameters
    ----------
    owner : part class that holds its last key
    others : part classes that are allowed in its stead
    """
    kind, context = problem["type"], problem.get("ctx", {})
    value = problem.get("input")
    if kind == "extra_forbidden":
        key = str(problem["loc"][-1])
        known = list(owner.model_fields) if owner else []
        types = [cls.model_fields["type"].default for cls in others if {key, "type"} <= set(cls.model_fields)]
        if 0 < len(types) <= _MOST_TYPES:
            return f"unknown key '{key}'; it is a key of type = " + " or ".join(f'"{name}"' for name in types)
        guess = did_you_mean(key, known) or (f"{_KNOWN_KEYS}{', '.join(known)}" if known else "")
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
        if problem["loc"][-1] == "version" and type(value) is int and all(word.isdecimal() for word in known):
            newest = max(map(int, known))
            if value > newest:
                return f"is {value}, of a newer rso_lidar; this one reads up to {newest}: upgrade rso_lidar"
        noun = "type" if problem["loc"][-1] == "type" else "value"
        guess = did_you_mean(value, known) if isinstance(value, str) and value not in known else ""
        return f"unknown {noun} {show_value(value)}{guess} (known: {', '.join(known)})"
    if kind == "too_short":
        return f"needs at least {context['min_length']} entries, not {context['actual_length']}; add some"
    if kind == "too_long":
        return (
            f"needs at most {context['max_length']} entries, not {context.get('actual_length') or 'more'}; remove some"
        )
    if kind in ("dict_type", "model_type", "model_attributes_type"):
        return f"needs a table, not {show_value(value)}"
    if kind == "string_pattern_mismatch":
        if context["pattern"].startswith("^#"):
            return f"needs a colour such as '#a29225', not {show_value(value)}"
        return f"needs a letter followed by letters, digits, _ or -, not {show_value(value)}"
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
    """Return a value as one short line, for a message.

    Parameters
    ----------
    value : any object
    """
    try:
        text = " ".join(repr(value).split())
    except Exception:  # whatever a user's own __repr__ raises
        text = f"a {type(value).__name__}"
        if type(value) is int:  # Python refuses to print an int of more than 4300 digits
            text = "an int of more digits than can be shown"
    return text if len(text) <= 60 else text[:57] + "..."

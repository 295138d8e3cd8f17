"""Places in the text of a scenario: their keys, their lines, and the one that the message of an error is about."""

from __future__ import annotations

import re

from rso_lidar.errors import ScenarioError
from rso_lidar.part import parse_toml

_KEY = r"""(?:[\w-]+|"[^"]*"|'[^']*')"""
_KEYS = rf"{_KEY}(?:\s*\.\s*{_KEY})*"
_HEADER, _ENTRY = re.compile(rf"\s*(\[\[?)\s*({_KEYS})\s*\]"), re.compile(rf"\s*({_KEYS})\s*=")
_PLACE = re.compile(r"([A-Za-z_][\w-]*(?:\[\d+\]|\.[\w-]+)*): ")


def locate_problem(message: str, text: str) -> tuple[str, int | None]:
    """Return the place that a message names, as a TOML key, and its line in the text (None: unknown).

    Parameters
    ----------
    message : of an error that `Scenario.loads` raises, without the title of the text
    """
    if match := re.search(r"\(at line (\d+), column \d+\)", message):
        return "", int(match[1])
    match = _PLACE.match(message)
    place = match[1] if match else ""
    if unknown := re.search(r"(?:^|: )unknown key '([^']+)'", message):
        place = f"{place}.{unknown[1]}".lstrip(".")
    first, _, rest = place.partition(".")
    if match := re.match(r"target (\S+): ", message):  # messages of loaded bodies have names, not numbers
        first, rest = match[1], ""
    names = _list_targets(text)
    if first in names:
        place = f"target[{names.index(first)}].{rest}".rstrip(".")
    return place, find_line(text, place)


def split_place(place: str) -> tuple[str | int, ...]:
    """Return the keys of a place such as ``target[0].motion.file``, with the numbers of entries of lists.

    >>> split_place("target[0].motion.file")
    ('target', 0, 'motion', 'file')
    """
    words = re.findall(r"\[(\d+)\]|([^.\[\]]+)", place)
    return tuple(int(number) if number else word for number, word in words)


def find_line(text: str, place: str) -> int | None:
    r"""Return the line, from 1, of the key at a place, or of the table that is to hold it; None if there is neither.

    Tables in one line (`{ ... }`) count as their key.

    Parameters
    ----------
    place : dotted key, such as ``target[0].motion.file``

    >>> find_line('[lidar]\n[lidar.laser]\nenergy_mj = 5', "lidar.laser.energy_mj")
    3
    """
    wanted = tuple(str(step) for step in split_place(place))
    here: tuple[str, ...] = ()
    entries: dict[tuple[str, ...], int] = {}
    best: tuple[int, int | None] = (0, None)
    for number, line in enumerate(text.splitlines(), 1):
        head, entry = _HEADER.match(line), _ENTRY.match(line)
        if head is None and entry is None:
            continue
        steps = [step.strip("\"' \t") for step in re.findall(_KEY, head[2] if head else entry[1] if entry else "")]
        path: tuple[str, ...] = () if head else here
        for k, step in enumerate(steps):
            path = (*path, step)
            if head and head[1] == "[[" and k == len(steps) - 1:
                entries[path] = entries.get(path, -1) + 1
            if path in entries:
                path = (*path, str(entries[path]))
        here = path if head else here
        if path[: len(wanted)] == wanted[: len(path)] and min(len(path), len(wanted)) > best[0]:
            best = min(len(path), len(wanted)), number
    return best[1]


def is_at(place: str, field: str) -> bool:
    """Return whether a place is that of a field, or of a number of the vector in it."""
    return field in (place, re.sub(r"\[\d+\]$", "", place))


def _list_targets(text: str) -> list[str]:
    try:
        tables = parse_toml(text, "", ScenarioError).get("target", [])
    except ScenarioError:
        return []
    return (
        [str(table.get("name")) if isinstance(table, dict) else "" for table in tables]
        if isinstance(tables, list)
        else []
    )

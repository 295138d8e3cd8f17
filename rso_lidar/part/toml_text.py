"""TOML texts, parsed after a check of their size and depth."""

from __future__ import annotations

import re
import tomllib
from typing import Any

from rso_lidar.errors import RsoLidarError

MOST_TOML_BYTES = 8 * 2**20
MOST_KEYS = 100_000
DEEPEST_TOML = 32  # levels of nested tables, or parts of a dotted key

# Quoted text and comments are ignored. A quoted part of a dotted key still counts as one part.
_QUOTED = re.compile(
    r'"""(?:\\.|[^\\])*?"""|' + r"'''.*?'''" + r'|"(?:\\.|[^"\\\n])*"' + r"|'[^'\n]*'" + r"|(#[^\n]*)", re.DOTALL
)
_DOTTED = re.compile(r"(?<![\w-])[\w-]++(?:[ \t]*+\.[ \t]*+[\w-]++)+")  # linear in the text: nothing is tried twice
_BRACKET = re.compile(r"[\[\]{}]")
_KEY = r"""(?:[\w-]+|"[^"]*"|'[^']*')"""
_KEYS = rf"{_KEY}(?:\s*\.\s*{_KEY})*"
_HEADER, _ENTRY = re.compile(rf"\s*(\[\[?)\s*({_KEYS})\s*\]"), re.compile(rf"\s*({_KEYS})\s*=")


def parse_toml(text: str, where: str, error: type[RsoLidarError]) -> dict[str, Any]:
    """Parse a TOML text after a check of its size and depth.

    tomllib needs gigabytes of memory for some texts of a few 100 kB.

    Parameters
    ----------
    text : the TOML text.
    where : name of the text in messages, such as its path.
    error : class of the error to raise.

    Returns
    -------
    dict

    Raises
    ------
    error
        If the text is not TOML, is too long or nested too deeply, or has too many keys.
    """
    if not isinstance(text, str):
        raise error(f"{where}: not a str but {text!r:.60}; give TOML as a str")
    if len(text) > MOST_TOML_BYTES:
        raise error(
            f"{where}: has over {MOST_TOML_BYTES // 2**20} million characters; move large tables to files of their own"
        )
    bare = _QUOTED.sub(lambda found: "" if found[1] else "q", text)
    steps = [found[0].count(".") + 1 for found in _DOTTED.finditer(bare)]
    if (
        bare.count("=") + sum(count for count in steps if count > 2) > MOST_KEYS
    ):  # a number such as 1.5 looks like a key of two parts
        raise error(f"{where}: has over {MOST_KEYS:,} keys; move large tables to files of their own")
    deepest, depth = max(steps, default=0), 0
    for found in _BRACKET.finditer(bare):
        depth = depth + 1 if found[0] in "[{" else max(depth - 1, 0)
        deepest = max(deepest, depth)
    if deepest > DEEPEST_TOML:
        raise error(f"{where}: nested more than {DEEPEST_TOML} levels deep; no key needs that, so flatten it")
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as problem:
        raise error(f"{where}: not valid TOML: {problem}; correct that line") from None
    except (RecursionError, ValueError) as problem:
        raise error(f"{where}: not readable as TOML ({problem}); correct the text") from None


def split_place(place: str) -> tuple[str | int, ...]:
    """Return the keys of a place such as ``target[0].motion.file``, with the numbers of entries of lists.

    Parameters
    ----------
    place : dotted key.

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
    text : the TOML text, which need not be complete.
    place : dotted key, such as ``target[0].motion.file``.

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

"""TOML texts, parsed after a check of their size and depth."""

from __future__ import annotations

import re
import tomllib
from typing import Any

from rso_lidar.errors import RsoLidarError

MOST_BYTES = 8 * 2**20
MOST_KEYS = 100_000
DEEPEST = 32  # tables in tables, or steps of a dotted key

# Quoted text and comments are ignored. A quoted step of a key still counts as a step.
_QUOTED = re.compile(
    r'"""(?:\\.|[^\\])*?"""|' + r"'''.*?'''" + r'|"(?:\\.|[^"\\\n])*"' + r"|'[^'\n]*'" + r"|(#[^\n]*)", re.DOTALL
)
_DOTTED = re.compile(r"[\w-]+(?:[ \t]*\.[ \t]*[\w-]+)+")
_BRACKET = re.compile(r"[\[\]{}]")


def parse_toml(text: str, where: str, error: type[RsoLidarError]) -> dict[str, Any]:
    """Parse a TOML text after a check of its size and depth: tomllib takes gigabytes for some texts of a few 100 kB.

    Parameters
    ----------
    text : the TOML.
    where : its name in errors.
    error : the class of what is raised.

    Raises
    ------
    error : the text is no TOML, or is too long, too deep or of too many keys.
    """
    if not isinstance(text, str):
        raise error(f"{where}: is no text but {text!r:.60}; give TOML as a str")
    if len(text) > MOST_BYTES:
        raise error(
            f"{where}: has over {MOST_BYTES // 2**20} million characters; keep large tables in files of their own"
        )
    bare = _QUOTED.sub(lambda found: "" if found[1] else "q", text)
    steps = [found[0].count(".") + 1 for found in _DOTTED.finditer(bare)]
    if bare.count("=") + sum(count for count in steps if count > 2) > MOST_KEYS:  # a number such as 1.5 has two steps
        raise error(f"{where}: has over {MOST_KEYS:,} keys; keep large tables in files of their own")
    deepest, depth = max(steps, default=0), 0
    for found in _BRACKET.finditer(bare):
        depth = depth + 1 if found[0] in "[{" else max(depth - 1, 0)
        deepest = max(deepest, depth)
    if deepest > DEEPEST:
        raise error(f"{where}: is nested over {DEEPEST} levels deep; no table here is, so write it flat")
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as problem:
        raise error(f"{where}: not valid TOML: {problem}; mend that line") from None
    except (RecursionError, ValueError) as problem:
        raise error(f"{where}: not readable as TOML ({problem}); mend it") from None

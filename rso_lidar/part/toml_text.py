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


def parse_toml(text: str, where: str, error: type[RsoLidarError]) -> dict[str, Any]:
    """Parse a TOML text after a check of its size and depth.

    tomllib needs gigabytes of memory for some texts of a few 100 kB.

    Parameters
    ----------
    text : the TOML text
    where : name of the text in messages, such as its path
    error : class of the error to raise

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
    bare = _QUOTED.sub(lambda match: "" if match[1] else "q", text)
    steps = [match[0].count(".") + 1 for match in _DOTTED.finditer(bare)]
    if (
        bare.count("=") + sum(count for count in steps if count > 2) > MOST_KEYS
    ):  # a number such as 1.5 looks like a key of two parts
        raise error(f"{where}: has over {MOST_KEYS:,} keys; move large tables to files of their own")
    deepest, depth = max(steps, default=0), 0
    for bracket in _BRACKET.finditer(bare):
        depth = depth + 1 if bracket[0] in "[{" else max(depth - 1, 0)
        deepest = max(deepest, depth)
    if deepest > DEEPEST_TOML:
        raise error(f"{where}: nested more than {DEEPEST_TOML} levels deep; no key needs that, so flatten it")
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as problem:
        raise error(f"{where}: not valid TOML: {problem}; correct that line") from None
    except (RecursionError, ValueError) as problem:
        raise error(f"{where}: not readable as TOML ({problem}); correct the text") from None

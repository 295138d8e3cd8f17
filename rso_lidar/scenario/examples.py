"""Examples: the shipped scenarios by name, what each shows, and the files that it needs."""

import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from rso_lidar.shipped import shipped

SHORTEST_EXAMPLE = """\
version = 1
name = "new scenario"
world = { axes = "local" }  # a bench; leave it out for an orbit

[time]
start_utc = 2024-09-17T12:00:00Z
duration_s = 10
frame_rate_hz = 1

[[target]]
name = "plate"
model = "plate"
motion = { type = "fixed", position_m = [300, 0, 0] }

[follower]
motion = { type = "fixed", position_m = [0, 0, 0] }

[lidar]
preset = "gsfl_1064"
"""  # a scenario with the keys that it must have, and one target


def find_examples() -> dict[str, Path]:
    """Return the shipped example scenarios by name."""
    return {file.stem: file for file in sorted(shipped("examples").glob("*.toml"))}


def summarize_example(text: str) -> str:
    """Return the first sentence of the comment at the top of a scenario.

    Parameters
    ----------
    text : of the scenario.
    """
    return re.split(r"(?<=[.:]) ", " ".join(_read_head(text)))[0].rstrip(":.")


def rename_example(text: str, name: str) -> str:
    """Return the text of an example with another title.

    Parameters
    ----------
    text : of the example.
    name : value of its key `name`.
    """
    named, count = re.subn(r'(?m)^(name\s*=\s*)"[^"\n]*"', lambda found: found[1] + _quote_toml(name), text, count=1)
    assert count == 1, "every example has a name"
    return named


def _read_head(text: str) -> list[str]:
    """Return the lines of the comment at the top of a scenario, without comment marks."""
    lines = []
    for line in text.splitlines():
        if not line.startswith("#"):
            break
        lines.append(line.removeprefix("#").strip())
    return lines


def _quote_toml(text: str) -> str:
    """Return a printable text as a TOML string."""
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'


def find_companions(text: str, folder: Path) -> list[Path]:
    """Find the files beside an example that its text names: tables, and Python files with dynamics.

    Parameters
    ----------
    text : of the example.
    folder : in which it lies.
    """
    found: dict[Path, None] = {}
    for value in iterate_texts(tomllib.loads(text)):
        for word in (value, value.rpartition(":")[0]):
            if word and Path(word).name == word and (folder / word).is_file():
                found[folder / word] = None
    return list(found)


def iterate_texts(tree: Any) -> Iterator[str]:
    """Yield all texts of a TOML tree."""
    if isinstance(tree, str):
        yield tree
    elif isinstance(tree, dict | list):
        for inner in tree.values() if isinstance(tree, dict) else tree:
            yield from iterate_texts(inner)

"""Examples: the shipped scenarios by name, what each shows, and the files that it needs."""

import re
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
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


@dataclass(frozen=True)
class Example:
    """A shipped example scenario: its name, and its TOML file, beside which lie a twin in Python and what it needs."""

    name: str
    path: Path

    @property
    def text(self) -> str:
        """TOML of the scenario."""
        return self.path.read_text(encoding="utf-8")

    @property
    def summary(self) -> str:
        """First sentence of the comment at the top."""
        lines = []
        for line in self.text.splitlines():
            if not line.startswith("#"):
                break
            lines.append(line.removeprefix("#").strip())
        return re.split(r"(?<=[.:]) ", " ".join(lines))[0].rstrip(":.")

    @property
    def companions(self) -> list[Path]:
        """Files beside it that its text names: tables, and Python files with dynamics."""
        files: dict[Path, None] = {}
        for value in iterate_texts(tomllib.loads(self.text)):
            for word in (value, value.rpartition(":")[0]):
                if word and Path(word).name == word and (self.path.parent / word).is_file():
                    files[self.path.parent / word] = None
        return list(files)

    def rename(self, title: str) -> str:
        """Return the text with another title.

        Parameters
        ----------
        title : value of its key `name`, in printable characters
        """
        escaped = title.replace("\\", "\\\\").replace('"', '\\"')
        start = r'(?m)^(name\s*=\s*)"[^"\n]*"'
        named, count = re.subn(start, lambda match: f'{match[1]}"{escaped}"', self.text, count=1)
        assert count == 1, "every example has a name"
        return named


def find_examples() -> dict[str, Example]:
    """Return the shipped example scenarios by name, in alphabetical order."""
    return {file.stem: Example(file.stem, file) for file in sorted(shipped("examples").glob("*.toml"))}


def iterate_texts(tree: Any) -> Iterator[str]:
    """Yield all texts in a TOML tree, depth first.

    Parameters
    ----------
    tree : a text, a table or a list of trees, or another value, which has none

    Yields
    ------
    str
    """
    if isinstance(tree, str):
        yield tree
    elif isinstance(tree, dict | list | tuple):
        for inner in tree.values() if isinstance(tree, dict) else tree:
            yield from iterate_texts(inner)

"""The planted faults: single mistakes that an engineer could make, one file of them for each room."""

import ast
import hashlib
import tomllib
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FOLDER = Path(__file__).resolve().parent
PACKAGE = "rso_lidar"


@dataclass(frozen=True)
class Fault:
    """One planted fault: in `file`, `old`, which occurs once there, becomes `new`.

    `tests` are run first, before those of the room; `equivalent` says why no test can see the fault, where none can.
    """

    room: str
    name: str
    file: str
    old: str
    new: str
    tests: tuple[str, ...] = ()
    equivalent: str = ""
    line: int = 0  # of a fault of the random sample; 0 in the list

    @property
    def kind(self) -> str:
        """Return "sample" for a fault that was drawn, else "list"."""
        return "sample" if self.line else "list"

    def planted(self, source: str) -> str:
        """Return the source with the fault in it."""
        return source.replace(self.old, self.new)

    def problems(self, root: Path = ROOT) -> list[str]:
        """Return why this fault cannot be planted: an empty list where it can."""
        path = root / self.file
        if not path.is_file():
            return [f"{self}: there is no {self.file}"]
        source = path.read_text(encoding="utf-8")
        found = [f"{self}: no {test}" for test in self.tests if not (root / test.partition("::")[0]).exists()]
        if (times := source.count(self.old)) != 1:
            return [*found, f"{self}: `old` occurs {times} times in {self.file}, not once"]
        if self.old == self.new:
            found.append(f"{self}: `new` changes nothing")
        try:
            ast.parse(self.planted(source))
        except SyntaxError as error:
            found.append(f"{self}: {self.file} does not parse with it: {error}")
        return found

    def digest(self, root: Path = ROOT) -> str:
        """Return what changes with the fault or with the file that it is planted in."""
        text = "\0".join((self.file, self.old, self.new, (root / self.file).read_text(encoding="utf-8")))
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    def __str__(self) -> str:
        return f"{self.room}: {self.name}"


def load() -> list[Fault]:
    """Return all faults of the list, room by room, in the order of their files."""
    found: list[Fault] = []
    for path in sorted(set(FOLDER.glob("*.toml")) - {FOLDER / "sample.toml"}):
        table = tomllib.loads(path.read_text(encoding="utf-8"))
        found += [Fault(path.stem, **{**entry, "tests": tuple(entry.get("tests", ()))}) for entry in table["fault"]]
    return found

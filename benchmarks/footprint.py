"""Measure the size of an installation: the wheel in an environment of its own, package by package, and how it starts."""

import os
import re
import subprocess
import sys
import tarfile
import tempfile
import venv
import zipfile
from collections.abc import Iterable
from dataclasses import dataclass
from importlib.metadata import Distribution, distributions
from pathlib import Path

import numpy as np

from benchmarks.report import Findings, table
from benchmarks.startup import IMPORT, LIBRARIES

ROOT = Path(__file__).resolve().parents[1]
MB = 1e6
LEAST_SHARE = 0.01  # packages below it share one row
OURS = "rso-lidar"
COLUMNS = ("files [MB]", "byte code [MB]", "together [MB]")
HELP = """
import contextlib, io, sys, time
start = time.perf_counter()
sys.argv = ["rso-lidar", "--help"]
from rso_lidar.__main__ import main
with contextlib.suppress(SystemExit), contextlib.redirect_stdout(io.StringIO()):
    main()
print(time.perf_counter() - start)
"""


@dataclass(frozen=True)
class Size:
    """Bytes of an installed package: byte code, and all other files."""

    files: int
    byte_code: int

    @property
    def both(self) -> int:
        """Return all bytes."""
        return self.files + self.byte_code

    def row(self, name: str, note: str) -> tuple[str, ...]:
        """Return a row of a table of packages."""
        return name, *(f"{number / MB:.1f}" for number in (self.files, self.byte_code, self.both)), note


def run(*, quick: bool) -> Findings:
    """Build and install the package, and return tables of its size and of its start with and without byte code.

    Parameters
    ----------
    quick : start fewer times.
    """
    with tempfile.TemporaryDirectory(prefix="rso_lidar_footprint_") as name:
        folder = Path(name)
        try:
            wheel, sdist = _build(folder)
            python = _install(folder, wheel)
        except subprocess.CalledProcessError as failed:
            reason = (failed.stderr.strip().splitlines() or ["no message"])[-1]
            print(f"footprint: not measured, it needs a package index: {reason}", file=sys.stderr)
            return Findings()
        blocks = {
            **_packages(_site(python)),
            "distributions": _contents(wheel, sdist),
            "byte code": _starts(python, folder, 4 if quick else 10),
        }
    return Findings(blocks)


def _call(*command: str | Path) -> str:
    words = [str(word) for word in command]
    return subprocess.run(words, check=True, capture_output=True, text=True, cwd=ROOT.parent).stdout


def _build(folder: Path) -> tuple[Path, Path]:
    """Build the source distribution, and the wheel from it."""
    tools = folder / "tools"
    venv.create(tools, with_pip=True, upgrade_deps=True)
    python = _interpreter(tools)
    pip = (python, "-m", "pip", "--disable-pip-version-check", "install", "-qq", "--require-hashes")
    _call(*pip, "-c", ROOT / "constraints.txt", "build", "hatchling")
    _call(python, "-m", "build", "--no-isolation", "--outdir", folder / "dist", ROOT)
    (wheel,), (sdist,) = (folder / "dist").glob("*.whl"), (folder / "dist").glob("*.tar.gz")
    return wheel, sdist


def _install(folder: Path, wheel: Path) -> Path:
    """Install a wheel and what it needs, without pip itself; return the interpreter of that environment."""
    environment = folder / "environment"
    venv.create(environment)
    python = _interpreter(environment)
    pip = (_interpreter(folder / "tools"), "-m", "pip", "--disable-pip-version-check", "--python", python)
    _call(*pip, "install", "-qq", "--no-require-hashes", "-c", ROOT / "constraints.txt", wheel)
    return python


def _interpreter(environment: Path) -> Path:
    return environment / ("Scripts/python.exe" if sys.platform == "win32" else "bin/python")


def _site(python: Path) -> Path:
    return Path(_call(python, "-c", "import sysconfig; print(sysconfig.get_path('platlib'))").strip())


def _packages(site: Path) -> dict[str, str]:
    """Return the tables of packages of an environment, and of what each direct dependency alone brings, by size."""
    found = {_normal(one.metadata["Name"]): one for one in distributions(path=[str(site)])}
    needs = {
        name: {_normal(_name(line)) for line in one.requires or [] if "extra ==" not in line} & set(found)
        for name, one in found.items()
    }
    sizes = {name: _size(one) for name, one in found.items()}
    total = _sum(sizes.values())
    rows, small = [], []
    for name in sorted(sizes, key=lambda name: -sizes[name].both):
        if sizes[name].both < LEAST_SHARE * total.both:
            small.append(sizes[name])
        else:
            users = sorted(user for user, needed in needs.items() if name in needed)
            rows.append(sizes[name].row(name, ", ".join(users) or "you"))
    rows.append(_sum(small).row(f"{len(small)} others", ""))
    rows.append(total.row(f"**all {len(sizes)}**", ""))
    packages = table(("package", *COLUMNS, "needed by"), rows)

    alone = {}
    for direct in needs[OURS]:
        kept = _closure(OURS, {name: needed - {direct} if name == OURS else needed for name, needed in needs.items()})
        alone[direct] = [name for name in _closure(OURS, needs) if name not in kept]
    shares = {direct: _sum(sizes[name] for name in names) for direct, names in alone.items()}
    rows = [
        shares[direct].row(direct, ", ".join(sorted(set(alone[direct]) - {direct})))
        for direct in sorted(shares, key=lambda direct: -shares[direct].both)
        if shares[direct].both >= LEAST_SHARE * total.both
    ]
    return {"footprint": packages, "alone": table(("without", *COLUMNS, "and what only it needs"), rows)}


def _sum(sizes: Iterable[Size]) -> Size:
    listed = list(sizes)
    return Size(sum(size.files for size in listed), sum(size.byte_code for size in listed))


def _closure(start: str, needs: dict[str, set[str]]) -> set[str]:
    """Return a package and all that it needs, and so on."""
    reached, waiting = {start}, [start]
    while waiting:
        new = needs[waiting.pop()] - reached
        reached |= new
        waiting += new
    return reached


def _name(requirement: str) -> str:
    return re.split(r"[^\w.-]", requirement, maxsplit=1)[0]


def _normal(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def _size(one: Distribution) -> Size:
    """Return the bytes of the files that an installer recorded for a package."""
    places = [Path(str(one.locate_file(file))) for file in one.files or []]
    sizes = [(place.suffix == ".pyc", place.stat().st_size) for place in places if place.is_file()]
    return Size(sum(size for code, size in sizes if not code), sum(size for code, size in sizes if code))


def _contents(wheel: Path, sdist: Path) -> str:
    """Return the table of both distributions: compressed size, and the files inside by folder."""
    with zipfile.ZipFile(wheel) as archive:
        in_wheel = [(part.filename.split("/", 1)[1], part.file_size) for part in archive.infolist()]
    with tarfile.open(sdist) as archive:
        in_sdist = [(part.name.split("/", 1)[1], part.size) for part in archive if part.isfile()]
    rows = []
    for what, file, parts, folders in (
        ("wheel", wheel, in_wheel, ("models", "examples", "tle")),
        ("source distribution", sdist, in_sdist, ("docs", "tests", "models", "examples", "rso_lidar")),
    ):
        inside: dict[str, int] = dict.fromkeys(folders, 0) | {"the rest": 0}
        for name, size in parts:
            top = name.split("/", 1)[0]
            inside[top if top in folders else "the rest"] += size
        listed = ", ".join(f"{top} {size / MB:.1f}" for top, size in inside.items())
        rows.append((what, f"{file.stat().st_size / MB:.1f}", f"{sum(inside.values()) / MB:.1f}", listed))
    return table(("distribution", "compressed [MB]", "unpacked [MB]", "of which [MB]"), rows)


def _starts(python: Path, folder: Path, turns: int) -> str:
    """Return how much longer a start takes without byte code, as after `pip install --no-compile`, in turns."""
    empty = folder / "no_byte_code"
    with_byte_code = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    without = with_byte_code | {"PYTHONPYCACHEPREFIX": str(empty), "PYTHONDONTWRITEBYTECODE": "1"}
    rows = []
    for what, command in (
        ("`import rso_lidar`", ("-c", IMPORT.format("rso_lidar"))),
        ("`rso-lidar --help`", ("-c", HELP)),
    ):
        ratios, over = [], []
        for turn in range(turns + 1):
            took = [_took(python, words, variables) for words, variables in (
                (command, with_byte_code), (command, without), (("-c", IMPORT.format(LIBRARIES)), with_byte_code)
            )]  # fmt: skip
            if turn:  # the first fills the system's cache of files
                ratios.append(took[1] / took[0])
                over.append(took[0] / took[2])
        rows.append((what, f"{np.median(over):.2f}", f"{np.median(ratios):.1f}"))
    return table(("start", f"over importing {LIBRARIES}", "without byte code, over with it"), rows)


def _took(python: Path, words: tuple[str, ...], variables: dict[str, str]) -> float:
    """Return the seconds that a process measured itself."""
    command = [str(python), "-I", *words] if "PYTHONPYCACHEPREFIX" not in variables else [str(python), *words]
    done = subprocess.run(command, check=True, capture_output=True, text=True, env=variables, cwd=python.parent)
    return float(done.stdout.splitlines()[-1])

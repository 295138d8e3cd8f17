"""A copy of the working tree in which a fault is planted, tested and mended again."""

import ast
import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

from tests.mutants.faults import ROOT, Fault

# Each module of a copy ends in a comment of this length. A fault takes from it or adds to it, so that the size stays the
# same: with the old time too, numba does not compile anew the loops that a fault cannot reach.
SPARE = 2000


class Tree:
    """A copy of what git knows of the working tree, with machine code of its own; the working tree is only read."""

    def __init__(self, folder: Path) -> None:
        self.root, self.clean, self.scratch = folder / "tree", folder / "loops", folder / "scratch_loops"
        listed = subprocess.run(
            ["git", "ls-files", "-co", "--exclude-standard"], cwd=ROOT, check=True, capture_output=True, text=True
        ).stdout.splitlines()
        files = [name for name in listed if (ROOT / name).is_file()]
        for name in files:
            self._copy(name)
        kept = {self.root / name for name in files}
        for path in [path for path in self.root.rglob("*") if path.is_file() and path not in kept]:
            path.unlink()
        self.clean.mkdir(exist_ok=True)

    def _copy(self, name: str) -> None:
        here, there = ROOT / name, self.root / name
        padded = name.startswith("rso_lidar/") and name.endswith(".py")
        now = here.stat()
        size = now.st_size + (SPARE if padded else 0)
        if there.is_file() and (there.stat().st_mtime_ns, there.stat().st_size) == (now.st_mtime_ns, size):
            return
        there.parent.mkdir(parents=True, exist_ok=True)
        there.write_bytes(here.read_bytes() + (_spare(SPARE) if padded else b""))
        os.utime(there, ns=(now.st_mtime_ns, now.st_mtime_ns))

    def test(self, tests: list[str], fault: Fault | None, limit_s: float) -> tuple[str, str]:
        """Run tests with a fault, or none, and stop at the first that fails; return "passed" or "failed", and which."""
        cache = self.root.parent / "pytest_cache"
        shutil.rmtree(cache, ignore_errors=True)
        machine_code = self.clean
        if fault is not None and fault.file in compiled_from(fault.file):
            machine_code = self.scratch
            shutil.rmtree(self.scratch, ignore_errors=True)
            shutil.copytree(self.clean, self.scratch)
        environment = os.environ | {
            "PYTHONPATH": str(self.root),
            "NUMBA_CACHE_DIR": str(machine_code),
            "CI": "1",  # hypothesis meets the same examples each time
        }
        command = [sys.executable, "-m", "pytest", "-q", "-x", "-o", f"cache_dir={cache}", *tests]
        mended = self._plant(fault) if fault is not None else None
        try:
            run = subprocess.run(
                command, cwd=self.root, env=environment, capture_output=True, text=True, timeout=limit_s, check=False
            )
        except subprocess.TimeoutExpired:
            return "failed", f"no end after {limit_s:.0f} s"
        finally:
            if mended is not None:
                mended()
        if run.returncode == 0:
            return "passed", ""
        if run.returncode not in (1, 2):
            if run.returncode in (4, 5):  # asked for wrongly, or nothing collected
                raise SystemExit(f"mutants: pytest {' '.join(tests)}: {run.stdout[-2000:]}{run.stderr[-2000:]}")
            return "failed", f"the interpreter ended with {run.returncode}"
        failed = cache / "v" / "cache" / "lastfailed"
        names = list(json.loads(failed.read_text(encoding="utf-8"))) if failed.is_file() else []
        return "failed", names[-1] if names else f"pytest ended with {run.returncode}"

    def _plant(self, fault: Fault):
        path = self.root / fault.file
        before, stat = path.read_bytes(), path.stat()
        text = before[:-SPARE]
        planted = fault.planted(text.decode()).encode()
        path.write_bytes(planted + _spare(len(before) - len(planted)))
        reached = fault.file in compiled_from(fault.file)
        stamp = time.time_ns() if reached else stat.st_mtime_ns
        os.utime(path, ns=(stamp, stamp))
        _forget(path)

        def mend() -> None:
            path.write_bytes(before)
            os.utime(path, ns=(stat.st_mtime_ns, stat.st_mtime_ns))
            _forget(path)

        return mend


def compiled_from(file: str) -> set[str]:
    """Return the modules of a file's room that end up in machine code: those with loops, and what they import."""
    room = (ROOT / file).parent
    if room == ROOT / "rso_lidar":
        return {file}  # what all rooms stand on
    imports = {path.stem: _imported(path, room.name) for path in room.glob("*.py")}
    found = {name for name, (_, loops) in imports.items() if loops}
    waiting = set(found)
    while waiting:
        more = imports[waiting.pop()][0] & set(imports)
        waiting |= more - found
        found |= more
    return {(room / f"{name}.py").relative_to(ROOT).as_posix() for name in found}


def _imported(path: Path, room: str) -> tuple[set[str], bool]:
    """Return the modules of its room that a module imports as it is imported, and whether it has loops."""
    found, loops = set(), False
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.ImportFrom) and node.module == "rso_lidar.arithmetic":
            loops |= any(name.name == "loop" for name in node.names)
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith(f"rso_lidar.{room}."):
            found.add(str(node.module).rpartition(".")[2])
    return found, loops


def _spare(length: int) -> bytes:
    return b"\n#" + b"-" * (length - 3) + b"\n"


def _forget(path: Path) -> None:
    """Remove what Python has kept of a module: it goes by time and size, which stay the same here."""
    for kept in (path.parent / "__pycache__").glob(f"{path.stem}.*.pyc"):
        kept.unlink()

"""A copy of the working tree in which a fault is planted, tested and mended again."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

from tests.mutants.faults import ROOT, Fault


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
        if there.is_file() and there.read_bytes() == here.read_bytes():
            return
        there.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(here, there)

    def test(self, tests: list[str], fault: Fault | None, limit_s: float, *, all_failures: bool = False) -> list[str]:
        """Run tests with a fault, or none, and return which failed: none, the first, or all of them."""
        cache = self.root.parent / "pytest_cache"
        shutil.rmtree(cache, ignore_errors=True)
        machine_code = self.clean
        if fault is not None and "@kernel" in (self.root / fault.file).read_text(encoding="utf-8"):
            machine_code = self.scratch
            shutil.rmtree(self.scratch, ignore_errors=True)
            shutil.copytree(self.clean, self.scratch)
        environment = os.environ | {
            "PYTHONPATH": str(self.root),
            "NUMBA_CACHE_DIR": str(machine_code),
            "CI": "1",  # hypothesis meets the same examples each time
            "RSO_LIDAR_QUICK_TEST_S": "inf",  # a fault is noticed by what a test asserts
        }
        arguments = self.root.parent / "tests.txt"
        arguments.write_text("\n".join(tests), encoding="utf-8")
        command = [sys.executable, "-m", "pytest", "-q", "--tb=no", "-o", f"cache_dir={cache}", f"@{arguments}"]
        command += [] if all_failures else ["-x"]
        mended = self._plant(fault) if fault is not None else None
        try:
            run = subprocess.run(
                command, cwd=self.root, env=environment, capture_output=True, text=True, timeout=limit_s, check=False
            )
        except subprocess.TimeoutExpired:
            return [f"no end after {limit_s:.0f} s"]
        finally:
            if mended is not None:
                mended()
        if run.returncode == 0:
            return []
        failed = cache / "v" / "cache" / "lastfailed"
        names = list(json.loads(failed.read_text(encoding="utf-8"))) if failed.is_file() else []
        if names:
            return names
        if fault is None:
            raise SystemExit(f"mutants: pytest {' '.join(tests)}: {run.stdout[-2000:]}{run.stderr[-2000:]}")
        if run.returncode in (3, 4, 5):  # the package cannot be imported, or there are no such tests
            self.test(tests, None, limit_s)
        return [f"pytest ended with {run.returncode}"]

    def _plant(self, fault: Fault):
        path = self.root / fault.file
        before = path.read_bytes()
        path.write_bytes(fault.planted(before.decode()).encode())
        _forget(path)

        def mend() -> None:
            path.write_bytes(before)
            _forget(path)

        return mend


def _forget(path: Path) -> None:
    """Remove what Python has kept of a module: it compares times and sizes, which a fault may leave the same."""
    for kept in (path.parent / "__pycache__").glob(f"{path.stem}.*.pyc"):
        kept.unlink()

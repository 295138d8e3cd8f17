"""Which tests reach which lines of the package: `python -m pytest -p tests.mutants.reach ...` writes it to out/reach.

coverage.py notes the lines, under the name of the test or of the fixture that runs. Of compiled loops it sees nothing: a
kernel that a test calls counts as reached from its first line to its last, and so do the kernels that it calls. Processes
that tests start are followed too, by a `sitecustomize` on their path.
"""

import ast
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import pytest

from tests.mutants.faults import PACKAGE, ROOT

FOLDER = ROOT / "out" / "reach"
_FUNCTION = ast.FunctionDef | ast.AsyncFunctionDef
SETTINGS = f"""\
[run]
source = {ROOT / PACKAGE}
data_file = {FOLDER / "coverage"}
parallel = true
context = ${{RSO_LIDAR_REACH}}
disable_warnings = no-data-collected, module-not-measured, couldnt-parse, no-sysmon, include-ignored
"""


def function_of(nodeid: str) -> str:
    """Return the name of a test without its parameters."""
    return nodeid.partition("[")[0]


class Notes:
    """Notes lines under the name of what runs: a test, or a fixture that several tests share."""

    def __init__(self) -> None:
        import coverage

        FOLDER.mkdir(parents=True, exist_ok=True)
        settings = FOLDER / "settings.ini"
        settings.write_text(SETTINGS, encoding="utf-8")
        (FOLDER / "sitecustomize.py").write_text("import coverage\n\ncoverage.process_startup()\n", encoding="utf-8")
        os.environ["RSO_LIDAR_REACH"] = ""
        self.coverage = coverage.Coverage(config_file=str(settings), context="")
        self.coverage.start()
        os.environ["COVERAGE_PROCESS_START"] = str(settings)
        os.environ["PYTHONPATH"] = os.pathsep.join([str(FOLDER), os.environ.get("PYTHONPATH", "")])
        self.context = ""
        self.seconds: dict[str, float] = defaultdict(float)
        self.fixtures: dict[str, set[str]] = defaultdict(set)
        self.kernels: dict[str, set[tuple[str, int]]] = defaultdict(set)
        self._watch_kernels()

    def _watch_kernels(self) -> None:
        from rso_lidar.kernels import Kernel

        call = Kernel.__call__

        def noted(kernel, *arguments):
            code = kernel.function.__code__
            self.kernels[self.context].add((code.co_filename, code.co_firstlineno))
            return call(kernel, *arguments)

        Kernel.__call__ = noted

    def switch(self, context: str) -> str:
        """Note from now on under another name; return the one before."""
        before, self.context = self.context, context
        os.environ["RSO_LIDAR_REACH"] = context
        self.coverage.switch_context(context)
        return before

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item):
        name = function_of(item.nodeid)
        for definitions in item._fixtureinfo.name2fixturedefs.values() if hasattr(item, "_fixtureinfo") else ():
            self.fixtures[name] |= {_name(fixture) for fixture in definitions if fixture.scope != "function"}
        self.switch(name)
        try:
            return (yield)
        finally:
            self.switch("")

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, fixturedef):
        if fixturedef.scope == "function":
            return (yield)
        before = self.switch(_name(fixturedef))
        try:
            return (yield)
        finally:
            self.switch(before)

    def pytest_runtest_logreport(self, report):
        if report.when == "call" and report.passed:
            self.seconds[function_of(report.nodeid)] += report.duration

    def pytest_sessionfinish(self):
        self.coverage.stop()
        self.coverage.save()
        told = {
            "seconds": dict(self.seconds),
            "fixtures": {name: sorted(fixtures) for name, fixtures in self.fixtures.items()},
            "kernels": {context: sorted(kernels) for context, kernels in self.kernels.items()},
        }
        (FOLDER / f"tests.{os.getpid()}.json").write_text(json.dumps(told), encoding="utf-8")


def _name(fixture) -> str:
    return f"fixture {fixture.baseid}::{fixture.argname}"


def pytest_configure(config):
    if hasattr(config, "workerinput") or not config.getoption("numprocesses", None):
        config.pluginmanager.register(Notes(), "reach")


class Reach:
    """What was noted: which tests reach a place, and how long each of them takes."""

    def __init__(self) -> None:
        from coverage import Coverage

        measured = Coverage(data_file=str(FOLDER / "coverage"), config_file=False)
        measured.combine(keep=True)
        self.data = measured.get_data()
        self.seconds: dict[str, float] = defaultdict(float)
        self.users: dict[str, set[str]] = defaultdict(set)  # of a fixture: tests
        self.callers: dict[tuple[str, int], set[str]] = defaultdict(set)  # of a kernel: tests and fixtures
        for file in FOLDER.glob("tests.*.json"):
            told = json.loads(file.read_text(encoding="utf-8"))
            for name, seconds in told["seconds"].items():
                self.seconds[name] += seconds
            for name, fixtures in told["fixtures"].items():
                for fixture in fixtures:
                    self.users[fixture].add(name)
            for context, kernels in told["kernels"].items():
                for path, line in kernels:
                    self.callers[Path(path).relative_to(ROOT).as_posix(), line].add(context)

    def tests(self, file: str, line: int) -> list[str]:
        """Return which tests reach a line, the nearest and then the quickest first.

        A line that runs at import is reached by whatever runs in its module, and by lines elsewhere that hold its name.
        So is one of a function that keeps what it returns, which only the first test of a process reaches.
        """
        place = _find_place(file, line)
        contexts: set[str] = set()
        if place.kernel is not None:
            for key in self._kernels_with((file, place.kernel)):
                contexts |= self.callers.get(key, set())
        if place.function is not None:
            contexts |= self._contexts(file, place.statement)
            if not contexts - {""}:
                contexts |= self._contexts(file, place.function)
        if place.is_kept or not contexts - {""}:
            contexts |= self._contexts(file, _bodies(file))
            for kernel in _kernels():
                if kernel[0] == file:
                    contexts |= self.callers.get(kernel, set())
            for name in place.names:
                for other, numbers in _lines_that_name(name).items():
                    contexts |= self._contexts(other, numbers)
        tests = {test for context in contexts for test in self.users.get(context, {context})} & set(self.seconds)
        return sorted(tests, key=lambda test: (distance(file, test), self.seconds[test], test))

    def _contexts(self, file: str, lines: Iterable[int]) -> set[str]:
        by_line = self._by_line(file)
        return {context for line in lines for context in by_line.get(line, ())}

    @cache  # noqa: B019 (one object lives as long as the run)
    def _by_line(self, file: str) -> dict[int, list[str]]:
        return self.data.contexts_by_lineno(str(ROOT / file))

    def _kernels_with(self, kernel: tuple[str, int]) -> Iterator[tuple[str, int]]:
        """Yield a kernel and those that call it, however indirectly, as far as their names tell."""
        waiting, seen = [kernel], set()
        while waiting:
            place = waiting.pop()
            if place in seen:
                continue
            seen.add(place)
            yield place
            name, _ = _kernels()[place]
            waiting += [other for other, (_, called) in _kernels().items() if name in called]


@cache
def _tree(file: str) -> ast.Module:
    return ast.parse((ROOT / file).read_text(encoding="utf-8"))


@cache
def _kernels() -> dict[tuple[str, int], tuple[str, set[str]]]:
    """Return all compiled loops by file and first line (that of the decorator): their names, and those that they use."""
    kernels = {}
    for path in sorted((ROOT / PACKAGE).rglob("*.py")):
        file = path.relative_to(ROOT).as_posix()
        if "@kernel" not in path.read_text(encoding="utf-8"):
            continue
        for node in ast.walk(_tree(file)):
            if isinstance(node, ast.FunctionDef) and any("kernel" in ast.dump(d) for d in node.decorator_list):
                used = {part.id for part in ast.walk(node) if isinstance(part, ast.Name)}
                used |= {part.attr for part in ast.walk(node) if isinstance(part, ast.Attribute)}
                kernels[file, node.decorator_list[0].lineno] = node.name, used - {node.name}
    return kernels


@cache
def _bodies(file: str) -> list[int]:
    """Return the lines of the bodies of functions."""
    functions = [node for node in ast.walk(_tree(file)) if isinstance(node, _FUNCTION)]
    return [line for node in functions for line in range(node.body[0].lineno, _end(node) + 1)]


@dataclass(frozen=True)
class _Place:
    """Where a line stands.

    `statement` and `function` are lines of its statement and of its function's body, `kernel` is the first line of its
    kernel, `names` are those that it gives, and `is_kept` tells whether its function keeps what it returns.
    """

    statement: range
    function: range | None
    kernel: int | None
    names: set[str]
    is_kept: bool


def _find_place(file: str, line: int) -> _Place:
    nodes = [node for node in ast.walk(_tree(file)) if isinstance(node, ast.stmt) and node.lineno <= line <= _end(node)]
    inner = nodes[-1]  # they come from the outermost to the innermost
    body = getattr(inner, "body", None)
    statement = range(inner.lineno, body[0].lineno if isinstance(body, list) and body else _end(inner) + 1)
    functions = [node for node in nodes if isinstance(node, _FUNCTION) and line >= node.body[0].lineno]
    starts = [node.decorator_list[0].lineno for node in functions if node.decorator_list]
    names = {node.name for node in nodes if isinstance(node, ast.ClassDef | _FUNCTION)}
    targets = inner.targets if isinstance(inner, ast.Assign) else [getattr(inner, "target", None)]
    names |= {node.id for target in targets if target for node in ast.walk(target) if isinstance(node, ast.Name)}
    return _Place(
        statement if line in statement else range(line, line + 1),
        range(functions[-1].body[0].lineno, _end(functions[-1]) + 1) if functions else None,
        next((start for start in starts if (file, start) in _kernels()), None),
        names,
        any("cache" in ast.dump(decorator) for node in functions for decorator in node.decorator_list),
    )


def _end(node: ast.stmt) -> int:
    return node.end_lineno or node.lineno


@cache
def _lines_that_name(name: str) -> dict[str, list[int]]:
    """Return the lines of the package that hold a name."""
    pattern, found = re.compile(rf"\b{re.escape(name)}\b"), {}
    for path in sorted((ROOT / PACKAGE).rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        if pattern.search(text):
            lines = [k for k, line in enumerate(text.splitlines(), 1) if pattern.search(line)]
            found[path.relative_to(ROOT).as_posix()] = lines
    return found


def distance(file: str, test: str) -> int:
    """Return how far a test is from a module: 0 its own, 1 in its sub-room, 2 in its room, 3 of the walk, 4 elsewhere."""
    module, place = Path(file), Path(test.partition("::")[0])
    if place == module:
        return 0
    here, there = module.parent.parts[1:], place.parent.parts[1:]
    if here == there:
        return 0 if module.stem in place.stem or place.stem.removeprefix("test_") in module.stem else 1
    if here[:1] == there[:1] and here:
        return 2
    return 3 if there[:1] in (("physics",), ("property",), ("golden",), ("simulation",)) else 4


def measure(jobs: int) -> None:
    """Run all tests of what the package does once and note what they reach."""
    shutil.rmtree(FOLDER, ignore_errors=True)
    before = _digest()
    command = [sys.executable, "-m", "pytest", "-q", "-n", str(jobs), "--dist", "loadscope", "--no-loadscope-reorder"]
    environment = os.environ | {"RSO_LIDAR_QUICK_TEST_S": "inf"}
    command += ["-p", "tests.mutants.reach", "--ignore=tests/house"]
    if subprocess.run(command, cwd=ROOT, env=environment, check=False).returncode not in (0, 1):  # 1: some test failed
        raise SystemExit(f"mutants: {' '.join(command)} did not run its tests")
    (FOLDER / "digest").write_text(before, encoding="utf-8")


def is_measured() -> bool:
    """Return whether all was noted, for the package and the tests as they are now."""
    file = FOLDER / "digest"
    return file.is_file() and file.read_text(encoding="utf-8") == _digest()


def _digest() -> str:
    files = sorted(path for top in (PACKAGE, "tests") for path in (ROOT / top).rglob("*.py"))
    return hashlib.sha256(b"\0".join(path.read_bytes() for path in files)).hexdigest()

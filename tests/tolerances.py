"""Find tolerances that rounding could exceed: `python -m tests.tolerances <arguments of pytest>`.

The tests run twice, once as on this processor and once as on the oldest one (see `processor`), which rounds otherwise. In
both runs each comparison of floating-point numbers is recorded: `pytest.approx`, `np.testing.assert_allclose`,
`np.allclose`, `np.isclose`, `math.isclose` and asserted inequalities. A comparison is listed where the two runs differ by
more than a tenth of what is left to its tolerance or bound. Such a tolerance would fail on some processor.
"""

import ast
import builtins
import math
import operator
import os
import pickle
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest
from _pytest.assertion import rewrite

ALLOWED_FRACTION = 0.1  # of what is left to the bound; a factor of ten for processors that round otherwise again
MOST_VALUES = 4096  # kept of one comparison
FOLDER = "RSO_LIDAR_TOLERANCES"
ORDER = {ast.Lt: operator.lt, ast.LtE: operator.le, ast.Gt: operator.gt, ast.GtE: operator.ge}
TESTS = str(Path(__file__).parent) + os.sep


class Recorder:
    """Records, for each test and line, how far compared numbers are apart and how much is left to the bound."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.test, self.records = folder, "", {}

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item):
        self.test, self.records = item.nodeid, {}
        try:
            return (yield)
        finally:
            with (self.folder / f"{os.getpid()}.pickle").open("ab") as file:
                pickle.dump((self.test, self.records), file)

    def note(self, apart, left, line=None):
        """Keep one comparison: the signed difference, and what is left to the bound."""
        frame = sys._getframe(2)
        while frame is not None and not is_test(frame.f_code.co_filename):
            frame = frame.f_back
        if frame is None:  # the package compares for itself
            return
        try:
            apart, left = (np.asarray(values, dtype=float).ravel() for values in np.broadcast_arrays(apart, left))
        except (TypeError, ValueError):
            return
        kept = np.linspace(0, apart.size - 1, min(apart.size, MOST_VALUES)).astype(int)
        place = f"{frame.f_code.co_filename.removeprefix(TESTS)}:{line or frame.f_lineno}"
        self.records.setdefault(place, []).append((apart[kept], left[kept]))

    def note_close(self, actual, desired, relative, absolute):
        """Keep one comparison with tolerances."""
        try:
            actual, desired = np.asarray(actual, dtype=float), np.asarray(desired, dtype=float)
            with np.errstate(all="ignore"):
                apart = actual - desired
                left = absolute + relative * np.abs(desired) - np.abs(apart)
        except (TypeError, ValueError):
            return
        self.note(apart, left)

    def compare(self, line, *parts):
        """Evaluate `left op right op ...`, given in this order."""
        result = True
        for left, holds, right in zip(parts[:-2:2], parts[1::2], parts[2::2], strict=True):
            if is_real(left) and is_real(right):
                with np.errstate(all="ignore"):
                    apart = np.subtract(left, right, dtype=float)
                self.note(apart, np.abs(apart), line)
            result = holds(left, right)
            if len(parts) > 3 and not result:
                return result
        return result


def is_test(name: str) -> bool:
    """Return whether a file holds tests."""
    return name.startswith(TESTS) and name != __file__


def is_real(value) -> bool:
    """Return whether a value is made of real numbers, at least one of which may have been rounded."""
    return isinstance(value, (int, float)) or (
        isinstance(value, (np.generic, np.ndarray)) and value.dtype.kind in "fiu"
    )


class Inequalities(ast.NodeTransformer):
    """Sends the inequalities of assertions to the recorder."""

    def __init__(self) -> None:
        self.inside = False

    def visit_Assert(self, node):
        self.inside = True
        node.test = self.visit(node.test)
        self.inside = False
        return node

    def visit_Compare(self, node):
        self.generic_visit(node)
        if not self.inside or not all(type(op) in ORDER for op in node.ops):
            return node
        names = [ast.Name(f"__{type(op).__name__}__", ast.Load()) for op in node.ops]
        rest = [part for pair in zip(names, node.comparators, strict=True) for part in pair]
        call = ast.Call(ast.Name("__compare__", ast.Load()), [ast.Constant(node.lineno), node.left, *rest], [])
        return ast.fix_missing_locations(ast.copy_location(call, node))


def pytest_configure(config):
    """Record comparisons where a folder for them is named."""
    if FOLDER not in os.environ:
        return
    recorder = Recorder(Path(os.environ[FOLDER]))
    config.pluginmanager.register(recorder)
    builtins.__compare__ = recorder.compare
    for kind, holds in ORDER.items():
        setattr(builtins, f"__{kind.__name__}__", holds)

    def watch(home, name, note):
        plain = getattr(home, name)

        def watched(*given, **named):
            if name == "__eq__" or is_test(sys._getframe(1).f_code.co_filename):
                note(*given, **named)
            return plain(*given, **named)

        setattr(home, name, watched)

    def numpys(actual, desired, rtol=1e-7, atol=0.0, *_, **__):
        recorder.note_close(actual, desired, rtol, atol)

    def close(actual, desired, rtol=1e-5, atol=1e-8, *_, **__):
        recorder.note_close(actual, desired, rtol, atol)

    def maths(a, b, *, rel_tol=1e-9, abs_tol=0.0):
        recorder.note_close(a, b, 0.0, max(rel_tol * max(abs(a), abs(b)), abs_tol))

    def approximate(scalar, actual):
        if is_real(actual) and is_real(scalar.expected) and not isinstance(actual, np.ndarray):
            recorder.note_close(
                actual, scalar.expected, 0.0, scalar.tolerance if math.isfinite(scalar.expected) else 0.0
            )

    watch(np.testing, "assert_allclose", numpys)
    watch(np, "allclose", close)
    watch(np, "isclose", close)
    watch(math, "isclose", maths)
    watch(type(pytest.approx(1.0)), "__eq__", approximate)
    plain_rewrite = rewrite.rewrite_asserts

    def rewrite_asserts(tree, *given, **named):
        plain_rewrite(Inequalities().visit(tree), *given, **named)

    rewrite.rewrite_asserts = rewrite_asserts


def read(folder: Path) -> dict:
    """Read the comparisons that a run recorded, by test and line."""
    found = {}
    for path in folder.glob("*.pickle"):
        with path.open("rb") as file:
            while True:
                try:
                    test, records = pickle.load(file)
                except EOFError:
                    break
                found |= {(test, place): noted for place, noted in records.items()}
    return found


def compare_runs(one: dict, other: dict) -> list[str]:
    """List the comparisons that differ by more than a share of what is left to their bounds, the worst ones first."""
    worst = {}
    for key, noted in one.items():
        test, place = key
        again = other.get(key, [])
        if len(noted) != len(again):  # such as those of a fixture that another test process made
            continue
        for (apart, left), (apart_again, left_again) in zip(noted, again, strict=True):
            if apart.shape != apart_again.shape:
                continue
            with np.errstate(all="ignore"):
                moved = np.nan_to_num(np.abs(apart - apart_again), nan=0.0, posinf=0.0)
                rest = np.minimum(
                    np.abs(left), np.abs(left_again)
                )  # below zero where a test denies that numbers are close
                share = np.where(moved > 0.0, moved / rest, 0.0)
            k = int(np.argmax(np.nan_to_num(share))) if share.size else 0
            if share.size and share[k] > worst.get(place, (ALLOWED_FRACTION,))[0]:
                worst[place] = float(share[k]), f"moves by {moved[k]:.2g}, {rest[k]:.2g} is left", test
    ordered = sorted(worst.items(), key=lambda one: -one[1][0])
    return [f"{place}: {share:.2g} of what is left: {words} ({test})" for place, (share, words, test) in ordered]


def main() -> int:
    """Run the tests twice, and list the tolerances that are too near."""
    from tests.processor import other_processor

    runs = []
    with tempfile.TemporaryDirectory() as scratch:
        for name, variables in (("here", {}), ("oldest", other_processor() | {"NUMBA_CACHE_DIR": f"{scratch}/numba"})):
            folder = Path(scratch) / name
            folder.mkdir()
            # bytecode of its own: the tests are compiled otherwise; and the same examples of hypothesis in both runs
            more = {FOLDER: str(folder), "PYTHONPYCACHEPREFIX": f"{scratch}/bytecode", "CI": "1"}
            more["RSO_LIDAR_QUICK_TEST_S"] = "inf"
            command = [sys.executable, "-m", "pytest", "-q", "-p", "tests.tolerances", *sys.argv[1:]]
            subprocess.run(command, env=os.environ | variables | more, check=False)
            runs.append(read(folder))
    lines = compare_runs(*runs)
    print(*lines, sep="\n")
    print(f"{sum(map(len, runs[0].values()))} comparisons on {len(runs[0])} lines of tests, {len(lines)} too near")
    return int(bool(lines))


if __name__ == "__main__":
    sys.exit(main())

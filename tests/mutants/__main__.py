"""Plant faults one at a time in a copy of the tree, and tell which of them the tests let through: `make mutants`."""

import argparse
import hashlib
import json
import os
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import SimpleQueue

from tests.mutants.faults import ROOT, Fault, load
from tests.mutants.tree import Tree

WANTED = 0.95  # of the faults that are not equivalent
LIMIT_S = 1800.0  # a fault that makes a loop endless is seen too
# What a fault must pass to survive: the tests named with it, its room's, and those that fly the whole walk.
WHOLE = ["tests/simulation/test_run.py", "tests/golden", "tests/property", "tests/physics"]
ROOM = {
    "export": ["tests/export", "tests/property/test_save_load.py"],
    "orbit": ["tests/orbit", "tests/mission_analysis/passes/test_screening_sets.py"],
}


def stages(fault: Fault, *, named_only: bool) -> Iterator[list[str]]:
    """Yield what is run with a fault, from the nearest tests to the farthest."""
    if fault.tests:
        yield list(fault.tests)
    if named_only and fault.tests:
        return
    if room := ROOM.get(fault.room, [f"tests/{fault.room}"]):
        yield room
    if not named_only:
        yield WHOLE


class Results:
    """What is known of each fault, one line of a file for each: a run that is broken off goes on where it stopped."""

    def __init__(self, path: Path) -> None:
        self.path = path
        path.parent.mkdir(parents=True, exist_ok=True)
        lines = path.read_text(encoding="utf-8").splitlines() if path.is_file() else []
        self.known = {(row["room"], row["name"]): row for row in map(json.loads, lines)}

    def still_holds(self, fault: Fault) -> bool:
        """Return whether nothing that decided about a fault has changed since."""
        row = self.known.get((fault.room, fault.name))
        return row is not None and row["digest"] == fault.digest() and row["tests"] == _tests_digest(row["by"])

    def add(self, fault: Fault, outcome: str, by: str, seconds: float) -> None:
        """Keep what became of a fault."""
        row = {"room": fault.room, "name": fault.name, "outcome": outcome, "by": by, "seconds": round(seconds, 1)}
        self.known[fault.room, fault.name] = row | {"digest": fault.digest(), "tests": _tests_digest(by)}
        with self.path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(self.known[fault.room, fault.name]) + "\n")


def _tests_digest(by: str) -> str:
    """Return what changes with the test that killed a fault, or with any test where none did."""
    killer = ROOT / by.partition("::")[0]
    files = [killer] if by and killer.is_file() else sorted((ROOT / "tests").rglob("test_*.py"))
    return hashlib.sha256(b"\0".join(path.read_bytes() for path in files)).hexdigest()[:16]


def judge(tree: Tree, fault: Fault, clean: set[str], *, named_only: bool) -> tuple[str, str]:
    """Return "killed" or "survived", and the test that killed; a test that fails without the fault ends the run."""
    for tests in stages(fault, named_only=named_only):
        outcome, by = tree.test(tests, fault, LIMIT_S)
        if outcome == "passed":
            continue
        if "::" in by and by not in clean:
            if tree.test([by], None, LIMIT_S)[0] != "passed":
                raise SystemExit(f"mutants: {by} fails without a fault too: mend that first")
            clean.add(by)
        return "killed", by
    return "survived", ""


def run(faults: list[Fault], results: Results, folder: Path, jobs: int, *, named_only: bool) -> None:
    """Judge faults, several at a time, each process of tests in a copy of the tree of its own."""
    trees: SimpleQueue[Tree] = SimpleQueue()
    for job in range(jobs):
        (folder / str(job)).mkdir(parents=True, exist_ok=True)
        trees.put(Tree(folder / str(job)))
    clean: set[str] = set()

    def one(fault: Fault) -> tuple[Fault, str, str, float]:
        tree, began = trees.get(), time.perf_counter()
        try:
            outcome, by = judge(tree, fault, clean, named_only=named_only)
        finally:
            trees.put(tree)
        return fault, outcome, by, time.perf_counter() - began

    with ThreadPoolExecutor(jobs) as pool:
        for fault, outcome, by, seconds in pool.map(one, faults):
            results.add(fault, outcome, by, seconds)
            sys.stdout.write(f"{outcome:8}  {fault}  ({seconds:.0f} s{', ' if by else ''}{by})\n")
            sys.stdout.flush()


def report(faults: list[Fault], results: Results) -> float:
    """Write what was killed, room by room, and what was not; return the share killed of all that could be."""
    rows = {fault: results.known.get((fault.room, fault.name), {}).get("outcome", "not run") for fault in faults}
    sys.stdout.write("\nroom        faults  killed  survived  not run  equivalent\n")
    for room in [*dict.fromkeys(fault.room for fault in faults), "all"]:
        of = {fault: outcome for fault, outcome in rows.items() if room in (fault.room, "all")}
        real = [outcome for fault, outcome in of.items() if not fault.equivalent]
        counts = [real.count(outcome) for outcome in ("killed", "survived", "not run")]
        sys.stdout.write("{:10}{:8}{:8}{:10}{:9}{:12}\n".format(room, len(of), *counts, len(of) - len(real)))
    for fault, outcome in rows.items():
        if outcome == "survived" and not fault.equivalent:
            sys.stdout.write(f"survived    {fault}  ({fault.file})\n")
    real = [outcome for fault, outcome in rows.items() if not fault.equivalent and outcome != "not run"]
    return real.count("killed") / len(real) if real else 1.0


def main() -> int:
    """Judge the faults asked for and report; return 1 where too many survive."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutants", description=__doc__)
    parser.add_argument("--room", action="append", default=[], help="of these rooms only; may be given more than once")
    parser.add_argument("--name", default="", help="only faults whose name holds this")
    parser.add_argument("--jobs", type=int, default=1, help="faults tried at once")
    parser.add_argument("--again", action="store_true", help="try those too whose outcome is known and still holds")
    parser.add_argument("--named-only", action="store_true", help="run no tests but those named with a fault: quick")
    parser.add_argument("--equivalent", action="store_true", help="try those too that are said to be equivalent")
    parser.add_argument("--report", action="store_true", help="run nothing, say what is known")
    parser.add_argument("--folder", type=Path, help="where the copies live, kept for the next time (a temporary one)")
    parser.add_argument("--results", type=Path, default=ROOT / "out" / "mutants.jsonl", help="where outcomes are kept")
    asked = parser.parse_args()
    known = load()
    rooms = sorted({fault.room for fault in known})
    if unknown := set(asked.room) - set(rooms):
        parser.error(f"--room: unknown: {', '.join(sorted(unknown))}; known: {', '.join(rooms)}")
    faults = [f for f in known if (not asked.room or f.room in asked.room) and asked.name in f.name]
    if not faults:
        parser.error(f"--name: no fault of these rooms has {asked.name!r} in its name")
    if problems := [problem for fault in faults for problem in fault.problems()]:
        sys.exit("\n".join(problems))
    results = Results(asked.results)
    waiting = [f for f in faults if not f.equivalent or asked.equivalent]
    if not asked.again:
        waiting = [f for f in waiting if not results.still_holds(f)]
    if waiting and not asked.report:
        with tempfile.TemporaryDirectory(prefix="rso_lidar_mutants_") as temporary:
            folder = asked.folder.resolve() if asked.folder else Path(temporary)
            os.environ.setdefault("RSO_LIDAR_SHARED", str(ROOT.parent / "shared"))
            run(waiting, results, folder, max(asked.jobs, 1), named_only=asked.named_only)
    share = report(faults, results)
    sys.stdout.write(f"killed: {100.0 * share:.1f} % of those tried; wanted: {100.0 * WANTED:.0f} %\n")
    return int(share < WANTED)


if __name__ == "__main__":
    sys.exit(main())

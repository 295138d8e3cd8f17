"""Plant faults one at a time in a copy of the tree, and tell which of them the tests let through: `make mutants`."""

import argparse
import hashlib
import json
import os
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue
from threading import Lock

from tests.mutants import reach, sample
from tests.mutants.faults import ROOT, Fault, load
from tests.mutants.tree import Tree

WANTED = {"list": 0.95, "sample": 0.92}  # of the faults that are not equivalent
LIMIT_S = 1800.0  # a fault that makes a loop endless is seen too
# What a fault of the list must pass to survive: the tests named with it, its room's, and those that fly the whole walk.
WHOLE = ["tests/simulation/test_run.py", "tests/golden", "tests/property", "tests/physics"]
ROOM = {
    "export": ["tests/export", "tests/property/test_save_load.py"],
    "orbit": ["tests/orbit", "tests/mission_analysis/passes/test_screening_sets.py"],
}
NEAR_S = 40.0  # of tests of a fault's own room: all of them run, so that it shows which notice it; assumed
START_S, SLOWER = (
    100.0,
    4.0,
)  # allowed to a stage: to start and compile, and a busy machine's time over that measured; assumed


@dataclass(frozen=True)
class Stage:
    """Tests that run with a fault, until the first of them fails or, to know them, all."""

    tests: list[str]
    limit_s: float = LIMIT_S
    all_failures: bool = False


def list_stages(fault: Fault, *, named_only: bool) -> Iterator[Stage]:
    """Yield what is run with a fault of the list, from the nearest tests to the farthest."""
    if fault.tests:
        yield Stage(list(fault.tests))
    if named_only and fault.tests:
        return
    if room := ROOM.get(fault.room, [f"tests/{fault.room}"]):
        yield Stage(room)
    if not named_only:
        yield Stage(WHOLE)


def reaching_stages(fault: Fault, tests: list[str], seconds: dict[str, float]) -> Iterator[Stage]:
    """Yield what is run with a fault of the sample: the tests that reach it, those of its room first."""
    near: list[str] = []
    far: list[str] = []
    spent = 0.0
    for test in tests:
        spent += seconds[test]
        is_near = reach.distance(fault.file, test) < 3 and spent < NEAR_S
        (near if is_near else far).append(test)
    for part, all_failures in ((near, True), (far, False)):
        if part:
            yield Stage(part, START_S + SLOWER * sum(seconds[test] for test in part), all_failures)


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

    def add(self, fault: Fault, killers: list[str], seconds: float) -> None:
        """Keep what became of a fault."""
        by = killers[0] if killers else ""
        row = {"room": fault.room, "name": fault.name, "outcome": "killed" if killers else "survived", "by": by}
        row |= {"killers": killers, "seconds": round(seconds, 1), "digest": fault.digest(), "tests": _tests_digest(by)}
        self.known[fault.room, fault.name] = row
        with self.path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(row) + "\n")


def _tests_digest(by: str) -> str:
    """Return what changes with the test that killed a fault, or with any test where none did."""
    killer = ROOT / by.partition("::")[0]
    files = [killer] if by and killer.is_file() else sorted((ROOT / "tests").rglob("test_*.py"))
    return hashlib.sha256(b"\0".join(path.read_bytes() for path in files)).hexdigest()[:16]


def judge(tree: Tree, fault: Fault, stages: Iterator[Stage], clean: set[str]) -> list[str]:
    """Return the tests that noticed a fault; a test that fails without the fault ends the run."""
    for stage in stages:
        killers = tree.test(stage.tests, fault, stage.limit_s, all_failures=stage.all_failures)
        if not killers:
            continue
        by = killers[0]
        if "::" in by and by not in clean:
            if tree.test([by], None, LIMIT_S):
                raise SystemExit(f"mutants: {by} fails without a fault too: mend that first")
            clean.add(by)
        return killers
    return []


def run(
    faults: list[Fault], results: Results, folder: Path, jobs: int, stages: Callable[[Fault], Iterator[Stage]]
) -> None:
    """Judge faults, several at a time, each process of tests in a copy of the tree of its own."""
    trees: SimpleQueue[Tree] = SimpleQueue()
    for job in range(jobs):
        (folder / str(job)).mkdir(parents=True, exist_ok=True)
        trees.put(Tree(folder / str(job)))
    clean: set[str] = set()
    telling = Lock()

    def try_out(fault: Fault) -> None:
        tree, began = trees.get(), time.perf_counter()
        try:
            killers = judge(tree, fault, stages(fault), clean)
        finally:
            trees.put(tree)
        seconds = time.perf_counter() - began
        outcome = f"killed by {killers[0]}" if killers else "survived"
        with telling:
            results.add(fault, killers, seconds)
            sys.stdout.write(f"{fault.file}  {fault}: {outcome} ({seconds:.0f} s)\n")
            sys.stdout.flush()

    with ThreadPoolExecutor(jobs) as pool:
        for _ in pool.map(try_out, faults):
            pass


def report(faults: list[Fault], results: Results) -> dict[str, float]:
    """Write what was killed by room, what was not, and by which tests; return the share killed of each kind tried."""
    rows = {fault: results.known.get((fault.room, fault.name), {}) for fault in faults}
    shares = {}
    for kind in WANTED:
        of_kind = {f: row.get("outcome", "not run") for f, row in rows.items() if f.kind == kind}
        if not of_kind:
            continue
        sys.stdout.write(f"\n{kind:18}faults  killed  survived  not run  equivalent\n")
        for room in [*sorted({fault.room for fault in of_kind}), "all"]:
            of = {fault: outcome for fault, outcome in of_kind.items() if room in (fault.room, "all")}
            real = [outcome for fault, outcome in of.items() if not fault.equivalent]
            counts = [real.count(outcome) for outcome in ("killed", "survived", "not run")]
            sys.stdout.write("{:18}{:6}{:8}{:10}{:9}{:12}\n".format(room, len(of), *counts, len(of) - len(real)))
        for fault, outcome in of_kind.items():
            if outcome == "survived" and not fault.equivalent:
                sys.stdout.write(f"survived    {fault}  ({fault.file})\n")
        real = [outcome for fault, outcome in of_kind.items() if not fault.equivalent and outcome != "not run"]
        if real:
            shares[kind] = real.count("killed") / len(real)
    _report_killers([row["killers"] for fault, row in rows.items() if fault.line and row.get("killers")])
    return shares


def _report_killers(killers: list[list[str]]) -> None:
    """Write how many faults of the sample each module of tests kills, and how many of them no other module near kills."""
    by_fault = [{name.partition("::")[0] for name in names} for names in killers]
    killed = Counter(module for modules in by_fault for module in modules)
    alone = Counter(module for modules in by_fault if len(modules) == 1 for module in modules)
    sys.stdout.write("\nkills of the sample   alone   by\n")
    for module, count in sorted(killed.items(), key=lambda item: (-item[1], item[0])):
        sys.stdout.write(f"{count:19}{alone[module]:8}   {module}\n")


def main() -> int:
    """Judge the faults asked for and report; return 1 where too many survive."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutants", description=__doc__)
    parser.add_argument("--only", choices=list(WANTED), help="plant the list of known slips, or the random sample")
    parser.add_argument("--room", action="append", default=[], help="of these rooms only; may be given more than once")
    parser.add_argument("--name", default="", help="only faults whose name holds this")
    parser.add_argument("--jobs", type=int, default=1, help="faults tried at once")
    parser.add_argument("--again", action="store_true", help="try those too whose outcome is known and still holds")
    parser.add_argument("--named-only", action="store_true", help="run no tests but those named with a fault: quick")
    parser.add_argument("--equivalent", action="store_true", help="try those too that are said to be equivalent")
    parser.add_argument("--report", action="store_true", help="run nothing, say what is known")
    parser.add_argument("--measure", action="store_true", help="note anew which tests reach what (some 20 minutes)")
    parser.add_argument("--folder", type=Path, help="where the copies live, kept for the next time (a temporary one)")
    parser.add_argument("--results", type=Path, default=ROOT / "out" / "mutants.jsonl", help="where outcomes are kept")
    asked = parser.parse_args()
    known = [*(load() if asked.only != "sample" else []), *(sample.draw() if asked.only != "list" else [])]
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
        jobs = max(asked.jobs, 1)
        os.environ.setdefault("RSO_LIDAR_SHARED", str(ROOT.parent / "shared"))
        if asked.measure or (any(fault.line for fault in waiting) and not reach.is_measured()):
            reach.measure(jobs)
        noted = reach.Reach() if any(fault.line for fault in waiting) else None

        def stages(fault: Fault) -> Iterator[Stage]:
            if noted is None or not fault.line:
                return list_stages(fault, named_only=asked.named_only)
            return reaching_stages(fault, noted.tests(fault.file, fault.line), noted.seconds)

        if noted is not None:  # the quickest first
            waiting.sort(
                key=lambda f: sum(noted.seconds[test] for test in noted.tests(f.file, f.line)) if f.line else 0.0
            )
        with tempfile.TemporaryDirectory(prefix="rso_lidar_mutants_") as temporary:
            folder = asked.folder.resolve() if asked.folder else Path(temporary)
            run(waiting, results, folder, jobs, stages)
    shares = report(faults, results)
    for kind, share in shares.items():
        wanted = 100.0 * WANTED[kind]
        sys.stdout.write(f"{kind}: {100.0 * share:.1f} % of those tried were killed; wanted: {wanted:.0f} %\n")
    return int(any(share < WANTED[kind] for kind, share in shares.items()))


if __name__ == "__main__":
    sys.exit(main())

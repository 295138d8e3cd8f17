"""Limits on what each test takes: wall time that scales with the load of the machine, and CPU time of quick tests.

The limit of wall time counts seconds of an idle machine: where more processes want to run than there are cores, each second
counts for the share of a core that a process then gets. A test over its limit fails with a traceback, and the next one runs.
One that holds the interpreter's lock inside a library, so that nothing else runs, ends its process, as far as a limit later.

A test without the mark `slow` is quick: it takes at most `QUICK_S` of CPU, with the processes that it starts and awaits. A
slower one is listed at the end, and fails from five times that on. A yardstick, run after such a test, loosens the limit on
a machine that is slower or busy. Fixtures do not count, nor does a test during which kernels are compiled: others use both.
"""

import faulthandler
import os
import signal
import sys
import threading
import time
from pathlib import Path

import pytest

LIMIT_S = float(os.environ.get("RSO_LIDAR_TEST_LIMIT_S", "300"))  # of an idle machine; the slowest test takes 20 s
TICK_S = min(5.0, LIMIT_S / 4.0)
# Of CPU; none where kernels run as Python, or where a run of tests is slowed on purpose and says so.
QUICK_S = float(os.environ.get("RSO_LIDAR_QUICK_TEST_S", "inf" if "NUMBA_DISABLE_JIT" in os.environ else "3"))
YARDSTICK_S = 0.042  # of CPU for `slowness`, on the machine where tests were marked
TYPES = "tests/house/test_types.py::"  # mypy reads the whole package for a minute, and yet runs before each commit
COST = "cpu_s"  # of the user properties of a report, which pytest-xdist carries from its workers
MACHINE_CODE = Path(os.environ.get("NUMBA_CACHE_DIR") or Path(__file__).parents[1] / "rso_lidar" / "__pycache__")


def share() -> float:
    """Return how much of a core each process gets, from the number of those that wanted to run in the last minute."""
    if not hasattr(os, "getloadavg"):  # Windows
        return 1.0
    return min(1.0, (os.cpu_count() or 1) / max(os.getloadavg()[0], 1e-3))


class Limit:
    """Fails the test that takes too long."""

    def __init__(self, stream) -> None:
        self.stream, self.name, self.spent_s = stream, "", 0.0
        self.running = threading.Event()

    def pytest_sessionstart(self):
        if hasattr(signal, "SIGALRM"):
            signal.signal(signal.SIGALRM, self._stop)
        threading.Thread(target=self._watch, daemon=True, name="limit").start()

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item):
        self.name, self.spent_s = item.nodeid, 0.0
        self._put_off()
        self.running.set()
        try:
            return (yield)
        finally:
            self.running.clear()
            faulthandler.cancel_dump_traceback_later()

    def _watch(self):
        while self.running.wait():
            before = time.monotonic()
            self._put_off()
            time.sleep(TICK_S)
            self.spent_s += (time.monotonic() - before) * share()
            if self.running.is_set() and self.spent_s > LIMIT_S and hasattr(signal, "SIGALRM"):
                self.spent_s = 0.0  # it may take another limit to end
                self.stream.write(f"\n{self.name}: over {LIMIT_S:g} s of an idle machine, and stands here:\n")
                self.stream.flush()
                faulthandler.dump_traceback(file=self.stream)
                signal.pthread_kill(threading.main_thread().ident, signal.SIGALRM)

    def _put_off(self):
        """Have the process end a limit from now: put off at each tick, it comes only where no other thread can run."""
        faulthandler.dump_traceback_later(LIMIT_S / share() + 2.0 * TICK_S, exit=True, file=self.stream)

    def _stop(self, *_):
        if self.running.is_set():
            pytest.fail(f"took over {LIMIT_S:g} s of an idle machine")


def spent() -> float:
    """Return the seconds of CPU of this process and of those that it has started and awaited."""
    return sum(os.times()[:4])


def slowness() -> float:
    """Return how many times longer than on the reference machine a fixed computation takes here and now, at least 1."""
    before, total = time.thread_time(), 0
    for k in range(1_000_000):
        total += k * k % 7
    return max(1.0, (time.thread_time() - before) / YARDSTICK_S)


def growth(work, few, many) -> float:
    """Return how many times the CPU time of `work(few)` the work `work(many)` takes, each the least of three."""

    def measure(number):
        before = time.process_time()
        work(number)
        return time.process_time() - before

    return min(measure(many) for _ in range(3)) / min(measure(few) for _ in range(3))


def has_compiled(since_s: float) -> bool:
    """Return whether any process may have compiled a kernel since a point of time [s since 1970]."""
    times_s = [file.stat().st_mtime for file in MACHINE_CODE.rglob("*.nbi")]
    return not times_s or max(times_s) > since_s  # without any, machine code is kept elsewhere


class Quick:
    """Measures the CPU time of tests that are not marked slow, and fails those that take far too much."""

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_call(self, item):
        if item.get_closest_marker("slow") or item.nodeid.startswith(TYPES):
            return (yield)
        since_s, before = time.time(), spent()
        result = yield
        cpu_s = spent() - before
        if cpu_s > QUICK_S and not has_compiled(since_s) and (cpu_s := cpu_s / slowness()) > QUICK_S:
            item.user_properties.append((COST, cpu_s))
            if cpu_s > 5.0 * QUICK_S:  # the yardstick of a busy machine is inexact
                pytest.fail(f"took {cpu_s:.1f} s of CPU, over {QUICK_S:g} s: make it cheaper, or mark it slow")
        return result


class Costs:
    """Lists at the end the quick tests that took too much CPU time."""

    def __init__(self) -> None:
        self.costs: list[tuple[float, str]] = []

    def pytest_runtest_logreport(self, report):
        if report.when == "call":
            self.costs += [(cpu_s, report.nodeid) for key, cpu_s in report.user_properties if key == COST]

    def pytest_terminal_summary(self, terminalreporter):
        if self.costs:
            terminalreporter.section(f"over {QUICK_S:g} s of CPU without the mark slow")
            for cpu_s, name in sorted(self.costs, reverse=True):
                terminalreporter.line(f"{cpu_s:5.1f} s  {name}")


class AtOnce:
    """Prints a failure when it happens, under xdist too, not only when the last test has ended."""

    def __init__(self, terminal) -> None:
        self.terminal = terminal

    @pytest.hookimpl(trylast=True)
    def pytest_runtest_logreport(self, report):
        if report.failed:
            self.terminal.ensure_newline()
            self.terminal.write_sep("!", f"{report.nodeid} ({report.when})", red=True)
            report.toterminal(self.terminal._tw)
            self.terminal.flush()


def watch(config) -> None:
    """Have the tests of a session limited where they run, and failures printed where a person reads."""
    terminal = config.pluginmanager.get_plugin("terminalreporter")
    if not hasattr(config, "workerinput") and terminal is not None:
        config.pluginmanager.register(AtOnce(terminal), "failures at once")
        config.pluginmanager.register(Costs(), "costs")
    stream = os.fdopen(os.dup(sys.__stderr__.fileno()), "w")  # before a test's output is captured
    config.add_cleanup(stream.close)
    config.pluginmanager.register(Limit(stream), "limit")
    config.pluginmanager.register(Quick(), "quick")

"""A limit on each test that scales with the load of the machine, and failures that are printed at once.

The limit counts seconds of an idle machine: where more processes want to run than there are cores, each second counts for
the share of a core that a process then gets. A test over its limit fails with a traceback, and the next one runs. One that
holds the interpreter's lock inside a library, so that nothing else runs, ends its process, as far as a limit later.
"""

import faulthandler
import os
import signal
import sys
import threading
import time

import pytest

LIMIT_S = float(os.environ.get("RSO_LIDAR_TEST_LIMIT_S", "300"))  # of an idle machine; the slowest test takes 20 s
TICK_S = min(5.0, LIMIT_S / 4.0)


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
    stream = os.fdopen(os.dup(sys.__stderr__.fileno()), "w")  # before a test's output is captured
    config.add_cleanup(stream.close)
    config.pluginmanager.register(Limit(stream), "limit")

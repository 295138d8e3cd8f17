"""Ctrl-C and SIGTERM on the command line: the process ends at once, with one line, whatever it is doing.

A Python signal handler runs only between two steps of the main thread. It raises its exception in the middle of an import,
and it waits while the main thread compiles or casts. So the command line does not use one: a thread reads the number of the
signal from a pipe, removes what the run would have removed, writes the line and ends the process. Recordings stay whole,
because each frame is on the disk once it is written, as after a kill.

`import rso_lidar` in a user's own program installs nothing: there Ctrl-C raises `KeyboardInterrupt`, as anywhere in Python.

This module is the first that the package imports, so it imports little: until it has run, Ctrl-C is Python's own.
"""

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

_WORDS = {"SIGINT": "interrupted", "SIGTERM": "terminated", "SIGHUP": "the terminal was closed"}
_CRITICAL_S = 1.0  # how long a short step may hold up the end of the process
_COMMAND = "rso-lidar"

_ending = threading.Lock()  # taken by whoever ends the process: the watching thread, or the command itself
_critical = threading.RLock()
_removals: list[Callable[[], object]] = []
_advice: Callable[[], str] | None = None
_is_watched = False


def watch_if_command_line() -> None:
    """Watch for signals where this process is the command line itself, not a program or a worker that imports it.

    To be called before the package imports anything else: the imports take most of a short command's time.
    """
    if os.name != "posix" or not _is_command_line() or threading.current_thread() is not threading.main_thread():
        return
    global _is_watched  # noqa: PLW0603  # a process is watched once
    _is_watched = True
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    threading.Thread(target=_wait_for_signal, args=(reading,), name="signals", daemon=True).start()
    signal.set_wakeup_fd(writing, warn_on_full_buffer=False)
    for name in _WORDS:
        number = signal.Signals[name]
        if signal.getsignal(number) != signal.SIG_IGN:  # as under nohup, and in the background of a shell script
            signal.signal(number, lambda *_: None)  # the number still goes to the pipe


def _is_command_line() -> bool:
    """Return whether Python was started for the command line: as `rso-lidar`, or as `python -m rso_lidar`."""
    program = (getattr(sys, "argv", None) or [""])[0]
    given = getattr(sys, "orig_argv", [])
    if program == "-m":  # while Python looks for the module, which imports the package
        return "rso_lidar" in given[given.index("-m") + 1 :][:1] if "-m" in given else "-mrso_lidar" in given
    # A worker has the arguments of its parent in sys.argv, but was not started with them.
    return program in given and os.path.basename(program).removesuffix(".exe") == _COMMAND  # noqa: PTH119  # pathlib takes 5 ms


def _wait_for_signal(pipe: int) -> None:
    known = {signal.Signals[name].value for name in _WORDS}
    while True:
        for number in os.read(pipe, 64):
            if number in known:
                _end(number)


def _end(number: int) -> None:
    """End this process for a signal: status 128 and its number, one line, and nothing temporary left behind."""
    if not _ending.acquire(blocking=False):
        return  # the command is done and is leaving
    _critical.acquire(timeout=_CRITICAL_S)
    for remove in _removals.copy():  # in order, so that workers end last and cannot report errors
        with suppress(Exception):
            remove()
    with suppress(Exception):
        os.write(
            2, f"{format_ending(number)}\n".encode(errors="backslashreplace")
        )  # no lock of Python's stream is in the way
    os._exit(128 + number)


def format_ending(number: int) -> str:
    """Return the line that ends a command after a signal."""
    told = _advice() if _advice is not None else ""
    return " ".join((_WORDS[signal.Signals(number).name] + (f": {told}" if told else "")).split())


def set_advice(advice: Callable[[], str] | None) -> None:
    """Have an interrupted command say what is kept and how to go on; None says nothing."""
    global _advice  # noqa: PLW0603  # a process runs one command
    _advice = advice


@contextmanager
def remove_on_signal(remove: Callable[[], object]) -> Iterator[None]:
    """Have `remove` called where a signal ends the process inside: what a `finally` would do, but in another thread."""
    _removals.append(remove)
    try:
        yield
    finally:
        _removals.remove(remove)


@contextmanager
def make_temporary_folder() -> Iterator[str]:
    """Return, as a context, a new folder in the system's place for temporary files, removed however the context ends."""
    import shutil
    import tempfile

    folder: str | None = None

    def remove() -> None:
        if folder is not None:
            shutil.rmtree(folder, ignore_errors=True)

    with remove_on_signal(remove):
        try:
            with defer_signals():
                folder = tempfile.mkdtemp(prefix="rso_lidar_")
            yield folder
        finally:
            remove()


@contextmanager
def defer_signals() -> Iterator[None]:
    """Keep a signal waiting during a short step, and have processes that are started inside leave Ctrl-C to this one."""
    with _critical:
        if not hasattr(signal, "pthread_sigmask"):
            yield
            return
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


def ignore_late_signals() -> None:
    """Begin the ordinary end of a command: from here on signals come too late; one that came before ends the process."""
    if _is_watched:
        _ending.acquire()

"""Ctrl-C and SIGTERM on the command line: the process ends immediately and prints one line.

A Python signal handler runs only between two bytecodes of the main thread. It can raise its exception inside an import, and
it waits while the main thread compiles or casts. The command line therefore uses no handler. A thread reads the signal's
number from a pipe, removes the temporary files, prints the line and ends the process. Recordings stay intact, because each
frame is flushed to disk when it is written.

`import rso_lidar` in a user's program installs nothing: there Ctrl-C raises `KeyboardInterrupt`, as usual in Python.

The package imports this module first, and it imports little: before it has run, Python handles Ctrl-C itself.
"""

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

_WORDS = {"SIGINT": "interrupted", "SIGTERM": "terminated", "SIGHUP": "the terminal was closed"}
_CRITICAL_S = 1.0  # longest wait for a step protected by `defer_signals`
_COMMAND = "rso-lidar"

_ending = threading.Lock()  # acquired by the thread that ends the process: the watching thread or the main thread
_critical = threading.RLock()
_removals: list[Callable[[], object]] = []
_advice: Callable[[], str] | None = None
_taker: Callable[[int], object] | None = None
_is_watched = False


def watch_if_command_line() -> None:
    """Watch for signals if this process is the command line, not a program or a worker that imports the package.

    Call it before all other imports of the package, which take most of the time of a short command.
    """
    if os.name != "posix" or not _is_command_line() or threading.current_thread() is not threading.main_thread():
        return
    global _is_watched  # noqa: PLW0603  # each process is watched once
    _is_watched = True
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    threading.Thread(target=_wait_for_signal, args=(reading,), name="signals", daemon=True).start()
    signal.set_wakeup_fd(writing, warn_on_full_buffer=False)
    for name in _WORDS:
        number = signal.Signals[name]
        if signal.getsignal(number) != signal.SIG_IGN:  # ignored under nohup and in the background of a shell script
            signal.signal(number, lambda *_: None)  # the number still goes to the pipe


def _is_command_line() -> bool:
    """Return whether Python was started for the command line: as `rso-lidar`, or as `python -m rso_lidar`."""
    program = (getattr(sys, "argv", None) or [""])[0]
    given = getattr(sys, "orig_argv", [])
    if program == "-m":  # while Python locates the module, which imports the package
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
    """End this process after a signal: remove temporary files, print one line, exit with status 128 + n."""
    global _taker
    if _taker is not None:
        take, _taker = _taker, None
        take(number)
        return
    if not _ending.acquire(blocking=False):
        return  # the command has finished and is exiting
    _critical.acquire(timeout=_CRITICAL_S)
    for remove in _removals.copy():  # in this order workers end last, and cannot report errors
        with suppress(Exception):
            remove()
    with suppress(Exception):
        os.write(
            2, f"{format_ending(number)}\n".encode(errors="backslashreplace")
        )  # unbuffered: Python's stream may be locked
    os._exit(128 + number)


def format_ending(number: int) -> str:
    """Return the line that ends a command after a signal."""
    advice = _advice() if _advice is not None else ""
    return " ".join((_WORDS[signal.Signals(number).name] + (f": {advice}" if advice else "")).split())


def set_advice(advice: Callable[[], str] | None) -> None:
    """Set the text that an interrupted command prints: what is kept, and how to resume. None prints nothing."""
    global _advice  # noqa: PLW0603  # a process runs one command
    _advice = advice


@contextmanager
def take_first_signal(take: Callable[[int], object]) -> Iterator[None]:
    """Call `take` with the number of the first signal inside this context, in another thread; the next one ends the process.

    It is for a command that runs until it is interrupted, and then completes what it has begun.
    """
    global _taker  # noqa: PLW0603  # a process runs one command
    _taker = take
    try:
        yield
    finally:
        _taker = None


@contextmanager
def remove_on_signal(remove: Callable[[], object]) -> Iterator[None]:
    """Call `remove` if a signal ends the process inside this context, where no `finally` would run."""
    _removals.append(remove)
    try:
        yield
    finally:
        _removals.remove(remove)


@contextmanager
def make_temporary_folder() -> Iterator[str]:
    """Create a folder among the system's temporary files for the length of a context, also removed after a signal."""
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
    """Defer signals during a short step; processes started inside it inherit a blocked Ctrl-C."""
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
    """Ignore signals from here on, as the command exits; an earlier signal still ends the process."""
    if _is_watched:
        _ending.acquire()

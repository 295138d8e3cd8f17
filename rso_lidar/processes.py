"""One function called in several processes, with what all calls share sent to each of them once."""

from __future__ import annotations

import os
import pickle
import signal
import threading
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Future
from contextlib import ExitStack, suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from rso_lidar.errors import RunError, ScenarioError
from rso_lidar.interruption import defer_signals, make_temporary_folder, remove_on_signal

_WARNINGS = "PYTHONWARNINGS"

_work: Callable[..., Any]  # in a worker: the function that it is there for


class Processes:
    """A pool of fresh processes that each hold one function; a context manager.

    The function, and what it holds, must be picklable. A script that starts processes keeps its own work under
    ``if __name__ == "__main__":``, for each of them reads the script's definitions.
    """

    def __init__(self, count: int, function: Callable[..., Any]) -> None:
        import multiprocessing
        from concurrent.futures import ProcessPoolExecutor

        try:
            sent = pickle.dumps(function, protocol=pickle.HIGHEST_PROTOCOL)
        except (pickle.PicklingError, AttributeError, TypeError) as error:
            raise ScenarioError(
                f"workers: the scenario cannot be sent to other processes ({error}); define what it names in a module, or "
                "leave out workers"
            ) from None
        if multiprocessing.current_process().daemon:
            raise ScenarioError("workers: this process is a daemon itself, and may start none; leave out workers")
        fresh = multiprocessing.get_context("spawn")  # what is forked inherits locks that other threads hold
        # By a file: a process that dies before it has read so much leaves its parent waiting at a full pipe.
        with ExitStack() as stack:
            file = Path(stack.enter_context(make_temporary_folder()), "function")
            file.write_bytes(sent)
            _start_quiet_tracker()
            self._pool = ProcessPoolExecutor(count, fresh, initializer=_begin, initargs=(str(file),))
            stack.enter_context(remove_on_signal(self.abandon))
            self._ending = stack.pop_all()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with self._ending:
            if kind is not None:
                self.abandon()  # their results are no longer needed
            self._pool.shutdown(wait=True, cancel_futures=True)

    def abandon(self) -> None:
        """End the processes without waiting for what they are at."""
        for process in list(getattr(self._pool, "_processes", None) or ()):
            with suppress(OSError):
                os.kill(process, signal.SIGTERM)

    def submit(self, *given: Any, **chosen: Any) -> Future[Any]:
        """Return the future result of the function, called with what is given."""
        try:
            with defer_signals():  # what is begun here is not torn out of its imports by Ctrl-C
                return self._pool.submit(_call, *given, **chosen)
        except BrokenExecutor as error:
            raise _lost() from error

    @staticmethod
    def result(future: Future[Any]) -> Any:
        """Return a result once it is there, or raise what the call raised; `RunError` where its process is gone."""
        try:
            return future.result()
        except BrokenExecutor as error:
            raise _lost() from error


def _start_quiet_tracker() -> None:
    """Start the process that removes the semaphores of a killed run, without its warning that it does."""
    if os.name != "posix":
        return
    from multiprocessing import resource_tracker

    before = os.environ.get(_WARNINGS)
    os.environ[_WARNINGS] = "ignore"
    try:
        resource_tracker.ensure_running()
    finally:
        del os.environ[_WARNINGS]
        if before is not None:
            os.environ[_WARNINGS] = before


def _lost() -> RunError:
    return RunError(
        "workers: a process ended before its frame was made; there may be too little memory for so many: take fewer "
        '(a script that starts them needs `if __name__ == "__main__":` about its own work)'
    )


def _begin(file: str) -> None:
    """Make a process ready for calls of the function that a file holds."""
    import multiprocessing

    global _work  # noqa: PLW0603  # a process is there for one function
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # whoever started it decides when it ends
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_end_with, args=(parent,), daemon=True).start()
    _work = pickle.loads(Path(file).read_bytes())


def _end_with(parent: Any) -> None:
    """End this process when its parent has ended, however that did."""
    parent.join()
    os._exit(1)


def _call(*given: Any, **chosen: Any) -> Any:
    return _work(*given, **chosen)

"""Worker processes: a pool that calls one function, and clients of dask, whose cluster may be of other machines.

The pool sends the data that all calls share to each process once.
"""

from __future__ import annotations

import importlib
import os
import pickle
import signal
import threading
import warnings
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, ThreadPoolExecutor, wait
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from itertools import islice
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from rso_lidar.errors import RsoLidarError, RunError, ScenarioError
from rso_lidar.interruption import defer_signals, make_temporary_folder, remove_on_signal

LOCAL = "local"  # a scheduler of dask that is started here
_LOST_WORKERS = 16  # workers that may be killed under one task, before the task is taken for their cause
_CONNECT_S = "20s"
_WARNINGS = "PYTHONWARNINGS"

_work: Callable[..., Any]  # in a worker process: the function that it calls


class Processes:
    """A pool of new processes that each hold one function; a context manager.

    The function and the objects that it refers to must be picklable. A script that starts processes needs
    ``if __name__ == "__main__":`` around its own code, because each process imports the script.
    """

    def __init__(self, count: int, function: Callable[..., Any]) -> None:
        """Start the pool; raise `ScenarioError` if the function cannot be pickled, or this process is a daemon.

        Parameters
        ----------
        function : called in each process with the arguments of `submit`
        """
        import multiprocessing
        from concurrent.futures import ProcessPoolExecutor

        try:
            sent = pickle.dumps(function, protocol=pickle.HIGHEST_PROTOCOL)
        except Exception as error:  # whatever a user's own object raises that cannot be pickled
            raise ScenarioError(
                f"workers: the scenario cannot be sent to other processes ({error}); define what it names in a module, or "
                "leave out workers"
            ) from error
        if multiprocessing.current_process().daemon:
            raise ScenarioError("workers: a daemon process cannot start processes; leave out workers")
        fresh = multiprocessing.get_context("spawn")  # a forked process would inherit locks that other threads hold
        # Sent by a file: a worker that dies early would leave its parent waiting at a full pipe.
        self._count = count
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
        """Terminate the processes without waiting for their calls."""
        for process in list(getattr(self._pool, "_processes", None) or ()):
            with suppress(OSError):
                os.kill(process, signal.SIGTERM)
        # A call that is being written to a full pipe ends with an error once nothing can read it. Otherwise Python 3.11.2
        # would wait for that thread for ever (CPython gh-94777).
        if (queue := getattr(self._pool, "_call_queue", None)) is not None:
            queue._reader.close()

    def submit(self, *given: Any, **chosen: Any) -> Future[Any]:
        """Call the function in one of the processes, and return the future of its result."""
        try:
            with defer_signals():  # Ctrl-C must not interrupt the imports of a worker that starts here
                return self._pool.submit(_call, *given, **chosen)
        except BrokenExecutor as error:
            raise _lost() from error

    @staticmethod
    def result(future: Future[Any]) -> Any:
        """Wait for a result, or raise what the call raised; raise `RunError` if its process has ended."""
        try:
            return future.result()
        except BrokenExecutor as error:
            raise _lost() from error

    def map_unordered(self, values: Iterable[Any]) -> Iterator[Any]:
        """Call the function with each value, and yield each result when it is ready, in any order.

        At most two calls for each process wait or run, so that memory does not grow with the number of values.
        """
        left = iter(values)
        waiting: set[Future[Any]] = set()
        while True:
            waiting |= {self.submit(value) for value in islice(left, 2 * self._count - len(waiting))}
            if not waiting:
                return
            done, waiting = wait(waiting, return_when=FIRST_COMPLETED)
            for future in done:
                yield self.result(future)


def check_workers(workers: Any) -> None:
    """Raise `ScenarioError` unless `workers` is a whole number from 1, or None for this process alone."""
    if workers is not None and (not isinstance(workers, int) or isinstance(workers, bool) or workers < 1):
        raise ScenarioError(f"workers: needs a whole number from 1, not {workers!r}; or leave it out")


def map_unordered(function: Callable[[Any], Any], values: Iterable[Any], count: int) -> Iterator[Any]:
    """Call a function with each value, and yield each result when it is ready, in any order.

    Parameters
    ----------
    function : called with one value
    values : its arguments
    count : number of processes; this process alone works for less than two
    """
    if count < 2:
        yield from map(function, values)
        return
    with Processes(count, function) as processes:
        yield from processes.map_unordered(values)


@contextmanager
def call_in_background(
    function: Callable[..., Any], count: int, *, in_processes: bool
) -> Iterator[Callable[..., Callable[[], Any]]]:
    """Yield a function that starts a call in the background and returns a function that waits for its result.

    With one thread, the call is made where its result is waited for.

    Parameters
    ----------
    function : called with the arguments of the yielded one
    count : number of threads or processes
    in_processes : whether processes work instead of threads
    """
    if not in_processes and count == 1:
        yield lambda *given, **chosen: partial(function, *given, **chosen)
        return
    if not in_processes:
        with ThreadPoolExecutor(count) as threads:
            yield lambda *given, **chosen: threads.submit(function, *given, **chosen).result
        return
    with Processes(count, function) as processes:
        yield lambda *given, **chosen: partial(processes.result, processes.submit(*given, **chosen))


def _start_quiet_tracker() -> None:
    """Start the process that removes the semaphores of a killed run, without its warning about them."""
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
        "workers: a process ended before its frame was made, perhaps for lack of memory; take fewer workers "
        '(a script that starts workers needs `if __name__ == "__main__":` around its own code)'
    )


def _begin(file: str) -> None:
    """Prepare a worker process: load its function from a file, and end when the parent process ends."""
    import multiprocessing

    global _work  # noqa: PLW0603  # a worker process calls one function
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent process decides when it ends
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_end_with, args=(parent,), daemon=True).start()
    warnings.formatwarning = _format_warning
    try:
        _work = pickle.loads(Path(file).read_bytes())
    except Exception as error:  # whatever a user's own object raises
        _work = partial(_refuse, f"{type(error).__name__}: {error}")


def _format_warning(message: Warning | str, *_place: Any, **_more: Any) -> str:
    """Format a warning as one line, as the command line does, without a place in the source.

    Parameters
    ----------
    message : the warning, which `warnings` passes
    """
    return f"warning: {message}\n"


def _refuse(problem: str, *_given: Any, **_chosen: Any) -> Any:
    """Raise the error of a scenario that cannot be rebuilt in a worker; it takes the place of the worker's function.

    Raises
    ------
    ScenarioError
        Always.
    """
    raise ScenarioError(
        f"workers: the scenario cannot be rebuilt in another process ({problem}); correct how its objects are pickled, or "
        "leave out workers"
    )


def _end_with(parent: Any) -> None:
    """End this process when its parent has ended, even if the parent was killed."""
    parent.join()
    os._exit(1)


def _call(*given: Any, **chosen: Any) -> Any:
    try:
        return _work(*given, **chosen)
    except Exception as error:
        try:
            pickle.loads(pickle.dumps(error))
        except Exception:  # it would end the pool without a word of what happened
            what = f"{type(error).__name__}: {error}"
            raise RunError(f"workers: a call raised {what}; leave out workers to see where") from None
        raise


@contextmanager
def open_dask_client(scheduler: str, workers: int, error: type[RsoLidarError] = ScenarioError) -> Iterator[Any]:
    """Yield a client of dask.

    Parameters
    ----------
    scheduler : address of a running scheduler, such as ``tcp://10.0.0.1:8786``, or ``local``
    error : raised if dask is not installed, or no scheduler answers
    """
    try:
        dask: Any = importlib.import_module("dask")
        distributed: Any = importlib.import_module("distributed")
    except ImportError:
        raise error('--engine dask: needs dask; install the extra: pip install "rso-lidar[dask]"') from None
    with ExitStack() as stack:
        stack.enter_context(dask.config.set({"distributed.scheduler.allowed-failures": _LOST_WORKERS}))
        try:
            if scheduler == LOCAL:
                options: dict[str, Any] = {"threads_per_worker": 1, "processes": True, "dashboard_address": None}
                cluster = stack.enter_context(distributed.LocalCluster(n_workers=workers, **options))
                client = stack.enter_context(distributed.Client(cluster))
            else:
                client = stack.enter_context(distributed.Client(scheduler, timeout=_CONNECT_S))
        except (OSError, ValueError) as problem:
            said = " ".join(str(problem).split())
            raise error(
                f"--scheduler {scheduler}: no scheduler answers ({said:.120}); start one, or take local"
            ) from None
        yield client

"""Workers: pools of processes, clients of dask, and functions that are sent once to the workers of an executor.

An executor is one in the manner of `concurrent.futures`: a pool of threads or processes, or ``client.get_executor()`` of
dask, whose cluster may be of other machines. What all calls share is sent to each worker once, or with each
call of an executor of another kind.
"""

from __future__ import annotations

import hashlib
import importlib
import math
import os
import pickle
import signal
import threading
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ThreadPoolExecutor,
    wait,
)
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from itertools import islice
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from rso_lidar.errors import RunError, ScenarioError
from rso_lidar.interruption import defer_signals, make_temporary_folder, remove_on_signal

LOCAL = "local"  # a scheduler of dask that is started here
_LOST_WORKERS = 16  # workers that may be killed under one task, before the task is taken for their cause
_CONNECT_S = "20s"
_LOG_FORMAT = "warning: dask: %(message)s"
_LOG_LEVELS = {  # of dask: one line for a lost worker, by its nanny, and none for what a call raises, which is raised here
    "distributed": "warning",
    "distributed.scheduler": "error",
    "distributed.worker": "critical",
    "distributed.worker.memory": "warning",
}
_WARNINGS = "PYTHONWARNINGS"
_PARTS = 8  # of some values, for each worker: so that none waits long for the last one

# In a worker: the function that it holds, under its SHA-256.
_held: tuple[str, Callable[..., Any]] | None = None
_holding = threading.Lock()


class Processes(Executor):
    """A pool of new processes; a context manager.

    Functions and arguments of calls must be picklable. A script that starts processes needs
    ``if __name__ == "__main__":`` around its own code, because each process imports the script.
    """

    def __init__(self, count: int) -> None:
        """Prepare the pool, whose processes start with the first calls; raise `ScenarioError` in a daemon process."""
        import multiprocessing
        from concurrent.futures import ProcessPoolExecutor

        if multiprocessing.current_process().daemon:
            raise ScenarioError("workers: a daemon process cannot start processes; leave out workers")
        fresh = multiprocessing.get_context("spawn")  # a forked process would inherit locks that other threads hold
        self.count = count
        with ExitStack() as stack:
            self.folder = Path(stack.enter_context(make_temporary_folder()))
            _start_quiet_tracker()
            self._pool = ProcessPoolExecutor(count, fresh, initializer=_begin)
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

    def submit(self, fn: Callable[..., Any], /, *given: Any, **chosen: Any) -> Future[Any]:
        """Call a function in one of the processes, and return the future of its result."""
        with defer_signals():  # Ctrl-C must not interrupt the imports of a worker that starts here
            return self._pool.submit(fn, *given, **chosen)


class SentFunction:
    """A function that the workers of an executor hold, or the threads of a pool share.

    `slots` is the number of calls that run at once.
    """

    def __init__(self, executor: Executor, function: Callable[..., Any]) -> None:
        """Send the function; raise `ScenarioError` if it cannot be pickled."""
        self._executor, self._waiting = executor, set[Future[Any]]()
        self._content: tuple[Any, ...] = ()
        self._options: dict[str, Any] = {}
        client = getattr(executor, "_client", None)  # of dask
        self.slots: int = getattr(executor, "_max_workers", None) or os.cpu_count() or 1
        self._call: Callable[..., Any] = function
        self._file: Path | None = None
        if isinstance(executor, ThreadPoolExecutor):
            return
        # Dask's own pickle knows the classes of a user's script, which its workers do not import.
        sent = _pickle(function, pickle.dumps if client is None else importlib.import_module("cloudpickle").dumps)
        name = hashlib.sha256(sent).hexdigest()
        content: Any = sent
        if isinstance(executor, Processes):
            # Sent by a file: a worker that dies early would leave its parent waiting at a full pipe.
            self.slots, self._file = executor.count, executor.folder / f"{name}-{id(self)}"
            self._file.write_bytes(sent)
            content = self._file
        elif client is not None:
            # A task of its own: its result goes to each worker once, and is made again if a worker is killed.
            self.slots = max(1, sum(client.nthreads().values()))
            self._options = {"pure": False}  # a key from the arguments would cost more than some calls
            content = client.submit(bytes, sent, **self._options)
        self._call, self._content = partial(_call, name), (content,)

    def submit(self, *given: Any, **chosen: Any) -> Future[Any]:
        """Call the function by a worker, and return the future of its result."""
        try:
            future = self._executor.submit(self._call, *self._content, *given, **chosen, **self._options)
        except BrokenExecutor as error:
            raise _lost() from error
        self._waiting.add(future)
        future.add_done_callback(self._waiting.discard)
        return future

    @staticmethod
    def result(future: Future[Any]) -> Any:
        """Wait for a result, or raise what the call raised; raise `RunError` if its worker has ended."""
        try:
            return future.result()
        except BrokenExecutor as error:
            raise _lost() from error
        except Exception as error:
            if isinstance(error, CancelledError) or type(error).__module__.startswith("distributed."):
                what = " ".join(f"{type(error).__name__}: {error}".split())
                raise RunError(
                    f"workers: a call was lost ({what:.200}); look at the scheduler and its workers"
                ) from error
            raise

    def map_unordered(self, values: Iterable[Any]) -> Iterator[Any]:
        """Call the function with each value, and yield each result when it is ready, in any order.

        At most two calls for each worker wait or run, so that memory does not grow with the number of values.
        """
        left = iter(values)
        waiting: set[Future[Any]] = set()
        while True:
            waiting |= {self.submit(value) for value in islice(left, 2 * self.slots - len(waiting))}
            if not waiting:
                return
            done, waiting = wait(waiting, return_when=FIRST_COMPLETED)
            for future in done:
                yield self.result(future)

    def map_parts(self, values: Sequence[Any], *given: Any) -> list[Any]:
        """Call the function with each of several parts of some values, and join the lists that it returns, in order.

        Parameters
        ----------
        given : further arguments of each call
        """
        each = 1 if not self._content else math.ceil(len(values) / (_PARTS * self.slots))
        parts = [self.submit(values[first : first + each], *given) for first in range(0, len(values), max(each, 1))]
        return [result for part in parts for result in self.result(part)]

    def close(self) -> None:
        """Cancel the calls that wait."""
        for future in list(self._waiting):
            future.cancel()
        if self._file is not None:
            self._file.unlink(missing_ok=True)


@contextmanager
def send_function(function: Callable[..., Any], executor: Executor) -> Iterator[SentFunction]:
    """Send a function to the workers of an executor for the length of a context; calls that wait at its end are cancelled.

    Parameters
    ----------
    function : called with the arguments of `SentFunction.submit`
    executor : a pool of threads shares the function itself

    Yields
    ------
    SentFunction
        To submit calls.

    Raises
    ------
    ScenarioError
        If the function cannot be pickled, and has to be.
    """
    sent = SentFunction(executor, function)
    try:
        yield sent
    finally:
        sent.close()


@contextmanager
def open_executor(
    workers: int | None = None, *, executor: Executor | None = None, scheduler: str | None = None
) -> Iterator[Executor | None]:
    """Yield an executor: the one given, of dask, or a pool of new processes; None without any of them.

    Parameters
    ----------
    workers : number of processes (None: none; for a local cluster of dask, one per core)
    executor : is yielded as it is, and stays open
    scheduler : of dask, as for `open_dask_client`

    Yields
    ------
    Executor or None

    Raises
    ------
    ScenarioError
        If no scheduler answers, or processes cannot be started here.
    """
    if executor is not None or (workers is None and scheduler is None):
        yield executor
    elif scheduler is not None:
        with open_dask_client(scheduler, workers or os.cpu_count() or 1) as client:
            yield client.get_executor()
    else:
        assert workers is not None
        with Processes(workers) as processes:
            yield processes


def check_workers(workers: Any, executor: Any = None) -> None:
    """Raise `ScenarioError` unless `workers` is a whole number from 1, or `executor` can be one; None for neither."""
    if workers is not None and (not isinstance(workers, int) or isinstance(workers, bool) or workers < 1):
        raise ScenarioError(f"workers: needs a whole number from 1, not {workers!r}; or leave it out")
    if executor is not None and (workers is not None or not callable(getattr(executor, "submit", None))):
        raise ScenarioError(
            "executor: needs an Executor of concurrent.futures, or client.get_executor() of dask, and no workers"
        )


def map_unordered(
    function: Callable[[Any], Any], values: Iterable[Any], count: int, executor: Executor | None = None
) -> Iterator[Any]:
    """Call a function with each value, and yield each result when it is ready, in any order.

    Parameters
    ----------
    function : called with one value
    values : its arguments
    count : number of processes; this process alone works for less than two
    executor : in place of processes
    """
    if count < 2 and executor is None:
        yield from map(function, values)
        return
    with open_executor(count, executor=executor) as workers:
        assert workers is not None
        with send_function(function, workers) as sent:
            yield from sent.map_unordered(values)


def map_parts(function: Callable[[Any], list[Any]], values: Sequence[Any], executor: Executor | None) -> list[Any]:
    """Call a function with parts of some values, and join the lists that it returns, in order.

    Parameters
    ----------
    function : called with a part
    values : all of them
    executor : whose workers call it (None: threads of this process, one per core)
    """
    with ExitStack() as stack:
        workers = executor or stack.enter_context(ThreadPoolExecutor(os.cpu_count() or 1))
        return stack.enter_context(send_function(function, workers)).map_parts(values)


def _pickle(function: Callable[..., Any], dumps: Callable[..., bytes]) -> bytes:
    """Pickle a function with all that it refers to, or raise `ScenarioError`."""
    try:
        return dumps(function, protocol=pickle.HIGHEST_PROTOCOL)
    except Exception as error:  # whatever a user's own object raises that cannot be pickled
        raise ScenarioError(
            f"workers: the scenario cannot be sent to other processes ({error}); define what it names in a module, or "
            "leave out workers"
        ) from error


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
        "workers: a process ended before its call returned, perhaps for lack of memory; take fewer workers "
        '(a script that starts workers needs `if __name__ == "__main__":` around its own code)'
    )


def _begin() -> None:
    """Prepare a worker process, which ends when its parent process ends."""
    import multiprocessing

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent process decides when it ends
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_end_with, args=(parent,), daemon=True).start()
    warnings.formatwarning = _format_warning


def _format_warning(message: Warning | str, *_place: Any, **_more: Any) -> str:
    """Format a warning as one line, as the command line does, without a place in the source.

    Parameters
    ----------
    message : the warning, which `warnings` passes
    """
    return f"warning: {message}\n"


def _end_with(parent: Any) -> None:
    """End this process when its parent has ended, even if the parent was killed."""
    parent.join()
    os._exit(1)


def _call(name: str, content: Path | bytes, *given: Any, **chosen: Any) -> Any:
    """Call, in a worker, a function that was sent.

    Parameters
    ----------
    name, content : SHA-256 of the pickled function, and where it is, or itself
    """
    function = _hold(name, content)
    try:
        return function(*given, **chosen)
    except Exception as error:
        try:
            pickle.loads(pickle.dumps(error))
        except Exception:  # it would end the pool without a word of what happened
            what = f"{type(error).__name__}: {error}"
            raise RunError(f"workers: a call raised {what}; leave out workers to see where") from None
        raise


def _hold(name: str, content: Path | bytes) -> Callable[..., Any]:
    """Return a function that was sent; it is held until another one is called."""
    global _held  # noqa: PLW0603  # a worker holds one function
    with _holding:
        if _held is None or _held[0] != name:
            try:
                _held = name, pickle.loads(content if isinstance(content, bytes) else content.read_bytes())
            except Exception as error:  # whatever a user's own object raises
                raise ScenarioError(
                    f"workers: the scenario cannot be rebuilt in another process ({type(error).__name__}: {error}); correct "
                    "how its objects are pickled, or leave out workers"
                ) from error
        return _held[1]


@contextmanager
def open_dask_client(scheduler: str, workers: int) -> Iterator[Any]:
    """Yield a client of dask, or raise `ScenarioError` if dask is not installed or no scheduler answers.

    Parameters
    ----------
    scheduler : address of a running scheduler, such as ``tcp://10.0.0.1:8786``, or ``local``
    """
    settings = {
        "distributed.scheduler.allowed-failures": _LOST_WORKERS,
        "distributed.admin.large-graph-warning-threshold": "4GiB",  # a scenario is sent once
        "distributed.admin.log-format": _LOG_FORMAT,
        "logging": _LOG_LEVELS,
        # workers read theirs from the environment
        "distributed.nanny.pre-spawn-environ.DASK_DISTRIBUTED__ADMIN__LOG_FORMAT": _LOG_FORMAT,
        "distributed.nanny.pre-spawn-environ.DASK_LOGGING": str(_LOG_LEVELS),
    }
    with ExitStack() as stack:
        try:
            dask: Any = importlib.import_module("dask")
            stack.enter_context(dask.config.set(settings))  # before distributed, which reads its log levels once
            distributed: Any = importlib.import_module("distributed")
        except ImportError:
            raise ScenarioError('--engine dask: needs dask; install the extra: pip install "rso-lidar[dask]"') from None
        try:
            if scheduler == LOCAL:
                _start_quiet_tracker()
                options: dict[str, Any] = {
                    "threads_per_worker": 1,
                    "processes": True,
                    "dashboard_address": "127.0.0.1:0",
                }
                cluster = stack.enter_context(distributed.LocalCluster(n_workers=workers, **options))
                client = stack.enter_context(distributed.Client(cluster))
            else:
                client = stack.enter_context(distributed.Client(scheduler, timeout=_CONNECT_S))
        except (OSError, ValueError) as problem:
            said = " ".join(str(problem).split())
            raise ScenarioError(
                f"--scheduler {scheduler}: no scheduler answers ({said:.120}); start one, or take local"
            ) from None
        yield client

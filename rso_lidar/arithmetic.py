"""Which arithmetic the busiest stages run on: NumPy, or the same written as loops and compiled by numba.

Beside a module ``x.py`` whose work is worth compiling stands ``x_loops.py``: functions made of plain loops, marked `loop`,
that do what the NumPy in ``x.py`` does (the drive of a PTU needs none: its very functions are compiled). NumPy is the
reference: tests compare the two, and it runs where numba cannot. Both give the same numbers to rounding, and noise of the
same statistics; a recording's versions name the path.
"""

import inspect
import os
import stat
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from rso_lidar.errors import RsoLidarError, warn

VARIABLE = "RSO_LIDAR_ARITHMETIC"
CHOICES = ("numba", "numpy")

_LONGEST_TURN_S = 120.0  # a loop takes at most some 3 s of one core, and a loaded machine may give a tenth of one

_Function = TypeVar("_Function", bound=Callable[..., Any])


def compiled() -> bool:
    """Return whether the loops run compiled: so unless RSO_LIDAR_ARITHMETIC=numpy, or numba cannot be imported."""
    return chosen() == "numba" and _numba() is not None


def chosen() -> str:
    """Return the arithmetic asked for, "numba" or "numpy"."""
    asked = os.environ.get(VARIABLE) or CHOICES[0]
    if asked not in CHOICES:
        raise RsoLidarError(f"{VARIABLE}: unknown arithmetic '{asked}'; known: {', '.join(CHOICES)}")
    return asked


def name() -> str:
    """Return the path used, in words for a recording: such as "numba 0.68.1", or "numpy"."""
    return f"numba {_numba()}" if compiled() else "numpy"


@contextmanager
def using(arithmetic: str) -> Iterator[None]:
    """Run what stands inside on "numba" or "numpy", in all threads of this process and in processes that it starts."""
    before = os.environ.get(VARIABLE)
    os.environ[VARIABLE] = arithmetic
    try:
        chosen()
        yield
    finally:
        del os.environ[VARIABLE]
        if before is not None:
            os.environ[VARIABLE] = before


def loop(function: _Function) -> _Function:
    """Return a function of loops compiled: the GIL released, kept on disk, IEEE arithmetic in the order written.

    A module of loops is imported inside the functions that use it, so that `import rso_lidar` needs no numba.
    """
    import numba

    made: Any
    try:
        with _cache_folder(function):
            made = numba.njit(nogil=True, cache=True, error_model="numpy")(function)
        # numba looks at the function's own file only, not at what that imports: the stamp of what is kept is made wider.
        kept = made._cache._cache_file
        kept._source_stamp = kept._source_stamp, *_state_of(Path(inspect.getfile(function)).parent)
        for deed in ("load_overload", "save_overload"):
            setattr(made._cache, deed, _suffered(getattr(made._cache, deed)))
        made._cache.load_overload, made._cache.save_overload = _in_turn(made._cache)
    except (RuntimeError, AttributeError):  # no folder to keep machine code in, or another numba: made in each process
        made = numba.njit(nogil=True, error_model="numpy")(function)
    return made  # type: ignore[no-any-return]


def _suffered(deed: Callable[..., Any]) -> Callable[..., Any]:
    """Return a deed of numba's cache that does nothing where its files are damaged, or where there is no room for them."""

    def attempted(*given: Any) -> Any:
        try:
            return deed(*given)
        except Exception as error:  # numba raises whatever its unpickling and LLVM do
            warn(
                f"numba: machine code in {deed.__self__.cache_path} cannot be read or kept ({type(error).__name__}); "  # type: ignore[attr-defined]
                "it is made anew: empty that folder, or name another in NUMBA_CACHE_DIR"
            )
            return None

    return attempted


@lru_cache(maxsize=1)
def spare_folder() -> Path | None:
    """Return a folder that only this user can write, in the system's place for temporary files.

    None, with a warning, where there cannot be one. Machine code is loaded from there, so a folder that another user owns or
    may write to is refused.
    """
    user = os.getuid() if hasattr(os, "getuid") else os.environ.get("USERNAME", "user")
    folder = Path(tempfile.gettempdir(), f"rso_lidar-cache-{user}")
    elsewhere = "machine code is made anew in each process; name a folder for it in NUMBA_CACHE_DIR"
    try:
        with suppress(FileExistsError):
            folder.mkdir(mode=0o700)
        status = folder.lstat()  # a link may lead anywhere
        is_ours = not hasattr(os, "getuid") or (status.st_uid == os.getuid() and not status.st_mode & 0o022)
        if not stat.S_ISDIR(status.st_mode) or not is_ours:
            warn(f"{folder}: is no folder that only you can write; {elsewhere}")
            return None
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as error:
        warn(f"{folder}: cannot be written ({error.strerror}), nor can a cache in your home; {elsewhere}")
        return None
    return folder


@contextmanager
def _cache_folder(function: Callable[..., Any]) -> Iterator[None]:
    """Have numba keep machine code in a spare folder inside, where it can write neither beside the code nor in the home."""
    from numba.core import caching

    config: Any = sys.modules["numba.core.config"]  # whose names are made when it is imported

    try:
        caching.FunctionCache(function)  # type: ignore[no-untyped-call]
        spare = None
    except RuntimeError:
        spare = spare_folder()
    if spare is None:
        yield
        return
    before, config.CACHE_DIR = config.CACHE_DIR, str(spare)
    try:
        yield
    finally:
        config.CACHE_DIR = before


def _in_turn(cache: Any) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """Return how a cache loads and saves, so that of several processes that start at once one compiles, and others wait.

    A load that finds nothing takes the lock of the cache's folder and looks again; the save that follows releases it.
    """
    from filelock import FileLock, Timeout

    load, save = cache.load_overload, cache.save_overload
    lock = FileLock(Path(cache.cache_path) / "rso_lidar.lock", timeout=_LONGEST_TURN_S, is_singleton=True)

    def loaded(*given: Any) -> Any:
        found = load(*given)
        if found is None and lock.timeout > 0.0:
            try:
                lock.acquire()
            except (Timeout, OSError):  # whoever holds it does not go on, or the file system has no locks
                lock.timeout = 0.0
                return None
            found = load(*given)
            if found is not None:
                lock.release()
        return found

    def saved(*given: Any) -> None:
        try:
            save(*given)
        finally:
            lock.release()

    return loaded, saved


@contextmanager
def watch_compiling(tell: Callable[[], None]) -> Iterator[None]:
    """Call `tell` once, as a context, when a loop is first compiled instead of read from disk."""
    if not compiled():
        yield
        return
    from numba.core import event

    class Told(event.Listener):
        waiting = True

        def on_start(self, event: Any) -> None:
            if self.waiting:
                self.waiting = False
                tell()

        def on_end(self, event: Any) -> None:
            pass

    with event.install_listener("numba:compile", Told()):
        yield


def packed(values: np.ndarray, dtype: Any = None) -> np.ndarray:
    """Return values contiguous and read-only: a loop is compiled once for each combination of those."""
    whole = np.ascontiguousarray(values, dtype).view()
    whole.setflags(write=False)
    return whole


@lru_cache(maxsize=16)
def _state_of(room: Path) -> tuple[tuple[str, int, int], ...]:
    """Return what changes when a module does that a room's loops may import: one of the room, units, ties, or this."""
    below = [Path(__file__), *(Path(__file__).with_name(name) for name in ("units.py", "ties.py"))]
    stats = [(path.name, path.stat()) for path in sorted(room.glob("*.py")) + below]
    return tuple((name, stat.st_mtime_ns, stat.st_size) for name, stat in stats)


@lru_cache(maxsize=1)
def _numba() -> str | None:
    """Return the version of numba; None, with a warning, where it cannot be imported beside this NumPy."""
    try:
        import numba
    except ImportError as error:
        warn(f"numba: cannot be imported ({error}); NumPy does its work, more slowly")
        return None
    return str(numba.__version__)

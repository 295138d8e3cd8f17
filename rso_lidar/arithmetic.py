"""Which arithmetic the busiest stages run on: NumPy, or the same written as loops and compiled by numba.

Beside a module ``x.py`` whose work is worth compiling stands ``x_loops.py``: functions made of plain loops, marked `loop`,
that do what the NumPy in ``x.py`` does (the drive of a PTU needs none: its very functions are compiled). NumPy is the
reference: tests compare the two, and it runs where numba cannot. Both give the same numbers to rounding, and noise of the
same statistics; a recording's versions name the path.
"""

import inspect
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from rso_lidar.errors import RsoLidarError, warn

VARIABLE = "RSO_LIDAR_ARITHMETIC"
CHOICES = ("numba", "numpy")

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
        made = numba.njit(nogil=True, cache=True, error_model="numpy")(function)
        # numba looks at the function's own file only, not at what that imports: the stamp of what is kept is made wider.
        kept = made._cache._cache_file
        kept._source_stamp = kept._source_stamp, *_state_of(Path(inspect.getfile(function)).parent)
        for deed in ("load_overload", "save_overload"):
            setattr(made._cache, deed, _suffered(getattr(made._cache, deed)))
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


def on_compiling(tell: Callable[[], None]) -> None:
    """Have `tell` called once, when a loop is next compiled instead of read from disk."""
    if not compiled():
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

    event.register("numba:compile", Told())  # type: ignore[no-untyped-call]


def packed(values: np.ndarray, dtype: Any = None) -> np.ndarray:
    """Return values contiguous and read-only: a loop is compiled once for each combination of those."""
    whole = np.ascontiguousarray(values, dtype).view()
    whole.setflags(write=False)
    return whole


@lru_cache(maxsize=16)
def _state_of(room: Path) -> tuple[tuple[str, int, int], ...]:
    """Return what changes when a module does that a room's loops may import: one of the room, units, or this."""
    below = [Path(__file__), Path(__file__).with_name("units.py")]
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

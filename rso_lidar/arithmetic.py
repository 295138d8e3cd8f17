"""Which arithmetic the busiest stages run on: NumPy, or the same written as loops and compiled by numba.

Beside a module ``x.py`` whose work is worth compiling stands ``x_loops.py``: functions made of plain loops, marked `loop`,
that do what the NumPy in ``x.py`` does. NumPy is the reference: tests compare the two, and it runs where numba cannot.
Where both give the same numbers to rounding, and noise of the same statistics, a recording's versions name the path.
"""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import lru_cache
from typing import Any, TypeVar

from rso_lidar.errors import RsoLidarError, warn

VARIABLE = "RSO_LIDAR_ARITHMETIC"
CHOICES = ("numba", "numpy")

_Function = TypeVar("_Function", bound=Callable[..., Any])
_chosen: str | None = None


def compiled() -> bool:
    """Return whether the loops run compiled: so unless RSO_LIDAR_ARITHMETIC=numpy, or numba cannot be imported."""
    return chosen() == "numba" and _numba() is not None


def chosen() -> str:
    """Return the arithmetic asked for, "numba" or "numpy"."""
    asked = _chosen or os.environ.get(VARIABLE) or CHOICES[0]
    if asked not in CHOICES:
        raise RsoLidarError(f"{VARIABLE}: unknown arithmetic '{asked}'; known: {', '.join(CHOICES)}")
    return asked


def name() -> str:
    """Return the path used, in words for a recording: such as "numba 0.68.1", or "numpy"."""
    return f"numba {_numba()}" if compiled() else "numpy"


@contextmanager
def using(arithmetic: str) -> Iterator[None]:
    """Run what stands inside on "numba" or "numpy", in all threads of this process."""
    global _chosen  # noqa: PLW0603  # one choice for the whole process: a frame is not made half by each
    before, _chosen = _chosen, arithmetic
    try:
        chosen()
        yield
    finally:
        _chosen = before


def loop(function: _Function) -> _Function:
    """Return a function of loops compiled: the GIL released, kept on disk, IEEE arithmetic in the order written.

    A module of loops is imported inside the functions that use it, so that `import rso_lidar` needs no numba.
    """
    import numba

    try:
        return numba.njit(nogil=True, cache=True, error_model="numpy")(function)  # type: ignore[no-any-return]
    except RuntimeError:  # no folder where the machine code could be kept: it is made anew in each process
        return numba.njit(nogil=True, error_model="numpy")(function)  # type: ignore[no-any-return]


@lru_cache(maxsize=1)
def _numba() -> str | None:
    """Return the version of numba; None, with a warning, where it cannot be imported beside this NumPy."""
    try:
        import numba
    except ImportError as error:
        warn(f"numba: cannot be imported ({error}); NumPy does its work, more slowly")
        return None
    return str(numba.__version__)

"""Which arithmetic the busiest stages run on: NumPy, or the same written as loops and compiled by numba.

Beside a module ``x.py`` whose work is worth compiling stands ``x_loops.py``: functions made of plain loops, marked `loop`,
that do what the NumPy in ``x.py`` does (the drive of a PTU needs none: its very functions are compiled). NumPy is the
reference: tests compare the two, and it runs where numba cannot. Both give the same numbers to rounding, and noise of the
same statistics; a recording's versions name the path.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache

from rso_lidar.errors import RsoLidarError, warn
from rso_lidar.kernels import kernel as loop
from rso_lidar.kernels import packed

__all__ = ["CHOICES", "VARIABLE", "chosen", "compiled", "loop", "name", "packed", "using"]

VARIABLE = "RSO_LIDAR_ARITHMETIC"
CHOICES = ("numba", "numpy")


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


@lru_cache(maxsize=1)
def _numba() -> str | None:
    """Return the version of numba; None, with a warning, where it cannot be imported beside this NumPy."""
    try:
        import numba
    except ImportError as error:
        warn(f"numba: cannot be imported ({error}); NumPy does its work, more slowly")
        return None
    return str(numba.__version__)

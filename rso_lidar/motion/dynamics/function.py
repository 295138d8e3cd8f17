"""Functions of user-defined dynamics x' = f(t, x, u) (Fuller et al., eq. 6): how they are found and called."""

from __future__ import annotations

import functools
import importlib
import importlib.machinery
import importlib.util
from collections.abc import Callable, Hashable
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, PlainSerializer, WithJsonSchema

from rso_lidar.errors import RsoLidarError, ScenarioError, did_you_mean
from rso_lidar.shipped import find

Function = Callable[[float, np.ndarray, np.ndarray], Any]


def _check_dynamics(value: Any) -> Any:
    if isinstance(value, str):
        place, colon, name = value.rpartition(":")
        if not (colon and place and name.isidentifier()):
            raise ValueError(f"'{value}' names no function; write 'file.py:name' or 'package.module:name'")
    elif not callable(value):
        raise ValueError(f"needs 'file.py:name', 'package.module:name' or a function f(t, x, u), not {value!r:.60}")
    elif not isinstance(value, Hashable):
        raise ValueError(f"{value!r:.60} cannot be hashed; give it a __hash__, as @dataclass(frozen=True) does")
    return value


def name_function(value: Any) -> str:
    """Return a function's name by which it can be found again: `package.module:name` or `file.py:name`.

    The name of a lambda contains "<", and finds nothing.

    Parameters
    ----------
    value : a function ``f(t, x, u)``, or its name as a scenario gives it
    """
    if isinstance(value, str):
        return value
    return f"{getattr(value, '__module__', '?')}:{getattr(value, '__qualname__', type(value).__qualname__)}"


def find_dynamics_file(dynamics: Any) -> str | None:
    """Return the Python file in the name of a function; None for a function itself, or the name of one in a package.

    Parameters
    ----------
    dynamics : a function ``f(t, x, u)``, or its name as a scenario gives it
    """
    place = dynamics.rpartition(":")[0] if isinstance(dynamics, str) else ""
    return place if place.endswith(".py") else None


Dynamics = Annotated[
    Any,
    BeforeValidator(_check_dynamics),
    PlainSerializer(name_function, return_type=str),
    WithJsonSchema({"type": "string", "description": "file.py:name or package.module:name"}),
]


def stamp_file(dynamics: Any) -> tuple[int, int]:
    """Return modification time and size of the file of dynamics, zeros without one."""
    place = find_dynamics_file(dynamics)
    path = find(place) if place is not None else None
    if path is None:
        return (0, 0)
    status = path.stat()
    return status.st_mtime_ns, status.st_size


def wrap_dynamics(function: Function, label: str, n: int, answer: str = "") -> Function:
    """Wrap a function of dynamics so that its exceptions and invalid results become one-line errors.

    Parameters
    ----------
    function : f(t, x, u)
    n : entries of the result, which must be (n,) finite numbers
    answer : what the result has to be, for messages (empty: the derivatives)

    Returns
    -------
    function with the same arguments, which raises `ScenarioError`
    """

    def call_checked(t: float, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Call the function of the dynamics; raise `ScenarioError` unless its result is (n,) finite numbers."""
        x = x.copy()  # f must not change the state by writing into its arguments, nor keep what changes later
        x.setflags(write=False)
        if u.flags.writeable:
            u = u.copy()
            u.setflags(write=False)
        try:
            rates = np.asarray(function(t, x, u), dtype=float)
        except RsoLidarError:
            raise
        except (Exception, SystemExit, GeneratorExit) as error:
            raise ScenarioError(
                f"{label}: failed at t = {t:g} s with {type(error).__name__}{_format_error(error)}; correct the dynamics"
            ) from error
        if rates.shape != (n,):
            raise ScenarioError(
                f"{label}: returned the shape {rates.shape} at t = {t:g} s; "
                f"{answer or f'return one derivative for each of the {n} entries of the state'}"
            )
        if not rates.dot(rates) < np.inf and not np.isfinite(rates).all():  # the sum of squares may overflow
            raise ScenarioError(
                f"{label}: returned {rates.tolist()!s:.60} at t = {t:g} s; return finite numbers for this state"
            )
        return rates

    return call_checked


def _format_error(error: BaseException) -> str:
    """Return the text of an error after a colon; an empty text stays empty."""
    text = " ".join(str(error).split())
    return f": {text}" if text else ""


def find_function(dynamics: Any) -> Function:
    """Find the function that `dynamics` names; a callable is returned as it is."""
    if not isinstance(dynamics, str):
        function: Function = dynamics
        return function
    place, _, name = dynamics.rpartition(":")
    module = _import_module(place)
    here: Any = getattr(module, name, None)
    if not callable(here):
        known = [word for word in vars(module) if not word.startswith("_") and callable(vars(module)[word])]
        guess = did_you_mean(name, known)
        what = "nothing" if here is None else "no function"
        raise ScenarioError(f"{place}: {what} is named '{name}' there{guess or '; correct the name'}")
    named: Function = here
    return named


def _import_module(place: str) -> Any:
    if not place.endswith(".py"):
        try:
            return importlib.import_module(place)
        except (Exception, SystemExit) as error:
            raise ScenarioError(
                f"{place}: cannot be imported ({type(error).__name__}{_format_error(error)}); check it"
            ) from None
    path = find(place)
    if path is None:
        raise ScenarioError(f"{place}: no such file; check the path of the dynamics")
    return _file_module(path.resolve(), *stamp_file(f"{place}:"))


class _SourceLoader(importlib.machinery.SourceFileLoader):
    """A loader that does not write a compiled file next to a user's file or an installed example."""

    def path_stats(self, path: Any) -> Any:
        """Ignore compiled files: their time stamps have whole seconds, too coarse while a user edits the source."""
        raise OSError

    def set_data(self, path: Any, data: Any, *, _mode: int = 0o666) -> None:
        """Do not write a compiled file."""


@functools.lru_cache(maxsize=32)
def _file_module(path: Path, _modified_ns: int, _size: int) -> Any:
    """Run a Python file as a module, cached until its modification time or size changes.

    Raises
    ------
    ScenarioError
        If the file cannot be imported
    """
    name = f"rso_lidar_dynamics_{path.stem}"
    loader = _SourceLoader(name, str(path))
    spec = importlib.util.spec_from_loader(name, loader)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    try:
        loader.exec_module(module)
    except (Exception, SystemExit) as error:
        line = getattr(error, "lineno", None)
        where = f"line {line}: " if line else ""
        raise ScenarioError(
            f"{path.name}: {where}cannot be imported ({type(error).__name__}{_format_error(error)}); correct it"
        ) from None
    return module

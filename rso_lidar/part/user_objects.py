"""Optional members of users' own Python objects, and what their methods return: read, and checked where they enter."""

from __future__ import annotations

from collections.abc import Sequence as ListLike
from typing import Any

import numpy as np

from rso_lidar.errors import ScenarioError
from rso_lidar.part.model import Part, name_object
from rso_lidar.part.validation_messages import show_value

_ROUNDING = 1e-9  # by which a number may be outside of its limits


def make_answer_error(owner: object, method: str, answer: object, cure: str, *, member: str = "") -> ScenarioError:
    """Return the error for an object whose method returned something else than it should.

    Parameters
    ----------
    owner : the object
    method : name of its method
    answer : what the method returned
    cure : what to do
    member : which member of the result is wrong; empty where it has none
    """
    where = f" in {member}" if member else ""
    return ScenarioError(f"{name_object(owner)}: {method}() returned {show_value(answer)}{where}; {cure}")


def read_member(owner: object, name: str, default: Any, kind: type | tuple[type, ...], cure: str) -> Any:
    """Return an optional attribute of an object.

    Parameters
    ----------
    owner : a part, whose own attribute needs no check, or a user's object
    name : of the attribute
    default : its value for an object that lacks it
    kind : types that it may have
    cure : what to do where it has another

    Raises
    ------
    ScenarioError : if the attribute has another type.
    """
    value = getattr(owner, name, default)
    if not isinstance(value, kind) and not isinstance(owner, Part):
        what = "a method" if callable(value) else show_value(value)
        raise ScenarioError(f"{name_object(owner)}: {name} is {what}; {cure}")
    return value


def call_member(owner: object, name: str, *given: Any, default: Any = None) -> Any:
    """Call an optional method of an object with read-only arrays; return the default for an object that lacks it.

    Parameters
    ----------
    owner : the object
    name : name of the method
    given : its arguments
    default : result for an object without the method

    Returns
    -------
    what the method returned, or the default.

    Raises
    ------
    ScenarioError : if the attribute is not a method.
    """
    method = getattr(owner, name, None)
    if method is None:
        return default
    if not callable(method):
        raise ScenarioError(f"{name_object(owner)}: {name} is {show_value(method)}; make it a method, or rename it")
    return method(*(lock_array(value) if isinstance(value, np.ndarray) else value for value in given))


def lock_array(values: np.ndarray) -> np.ndarray:
    """Return a read-only view of an array.

    Parameters
    ----------
    values : the array, any shape and type
    """
    view = values.view()
    view.setflags(write=False)
    return view


def check_lines(owner: object, method: str, answer: object) -> list[str]:
    """Return lines of text that a method returned, or raise an error for anything else.

    Parameters
    ----------
    owner, method : the object and the name of its method
    answer : what the method returned

    Raises
    ------
    ScenarioError : if that is not a list of texts.
    """
    if isinstance(answer, ListLike) and not isinstance(answer, str) and all(isinstance(line, str) for line in answer):
        return [" ".join(line.split("\n")) for line in answer]
    raise make_answer_error(owner, method, answer, "return a list of texts, one for each line")


def check_text(owner: object, method: str, answer: object) -> str:
    """Return a text that a method returned, or raise an error if it is not a text.

    Parameters
    ----------
    owner : the object
    method : name of its method
    answer : what the method returned

    Raises
    ------
    ScenarioError : if that is not a text.
    """
    if isinstance(answer, str):
        return " ".join(answer.split("\n"))
    raise make_answer_error(owner, method, answer, "return a text")


def check_values(
    owner: object,
    method: str,
    answer: object,
    *,
    shape: tuple[int, ...] = (),
    least: float = -np.inf,
    most: float = np.inf,
    member: str = "",
) -> np.ndarray:
    """Return numbers that a method returned as an array of float64, or raise an error if they are not as they must be.

    Parameters
    ----------
    owner, method : the object and the name of its method
    answer : what the method returned; one number represents as many as there are
    shape : of the array
    least, most : limits; NaN is outside of them
    member : which member of the result the numbers are; empty where they are the whole result

    Returns
    -------
    array of float64 of this shape, read-only.

    Raises
    ------
    ScenarioError : if they are not real numbers, or have another shape, or are beyond a limit.
    """
    cure = f"return numbers of shape {shape}" if shape else "return a number"
    values = to_real_array(answer)
    if values is None:
        raise make_answer_error(owner, method, answer, cure, member=member)
    if values.shape not in ((), shape):
        where = f" in {member}" if member else ""
        raise ScenarioError(
            f"{name_object(owner)}: {method}() returned an array of shape {values.shape}{where}; {cure}"
        )
    wrong = ~((values >= least - _ROUNDING) & (values <= most + _ROUNDING))
    if wrong.any():
        cure += f" from {least:g}" if np.isfinite(least) else ""
        cure += f" to {most:g}" if np.isfinite(most) else ""
        raise make_answer_error(owner, method, float(values[wrong].flat[0]), cure, member=member)
    return np.broadcast_to(values, shape)


def to_real_array(answer: object) -> np.ndarray | None:
    """Return real numbers as an array of float64; None for anything else.

    Parameters
    ----------
    answer : what a user's object returned
    """
    try:
        values = np.asarray(answer)
    except (TypeError, ValueError):
        return None
    return values.astype(np.float64, copy=False) if values.dtype.kind in "fiub" else None

"""Every exception and warning that rso_lidar raises on purpose.

A message reads *where: what: what to do*. The command line prints it as one line. It exits with status 2 after bad input (a
`RsoLidarError` that is a `ValueError`), and with status 1 after a failed run.
"""

import difflib
import re
import warnings
from collections.abc import Hashable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from contextvars import ContextVar
from types import TracebackType
from typing import Any

import numpy as np

MOST_CHARACTERS = 1000  # of a message on the command line: five rows of a terminal of 200 columns
_MOST_OF_PROBLEMS = 800  # characters of those that a message lists; the rest is for the place and the cure

# C0 and C1 controls, the separators of lines and paragraphs, and the marks of writing direction.
_UNPRINTED = re.compile("[\x00-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ufeff\ufff9-\ufffb]+")


class RsoLidarError(Exception):
    """The root of all errors raised on purpose."""


class ScenarioError(RsoLidarError, ValueError):
    """A scenario, or a part of one, that cannot be flown as written."""


class SettingError(ScenarioError):
    """A ``place=value`` setting whose place does not exist in a scenario."""


class FieldError(ScenarioError):
    """Invalid fields of a part.

    `problems` holds, for each, the path of its keys and pydantic's name of the problem.
    """

    def __init__(self, message: str, problems: Sequence[tuple[tuple[str | int, ...], str]] = ()) -> None:
        super().__init__(message)
        self.problems = tuple(problems)


class RecordError(RsoLidarError, TypeError, ValueError):
    """An array of the wrong type (a TypeError) or shape (a ValueError) for its field of a record."""


class MeshError(RsoLidarError, ValueError):
    """A mesh file that cannot be read as a target's surface."""


class CatalogError(RsoLidarError, ValueError):
    """A catalogue of element sets that cannot be read, or lacks the requested object."""


class PropagationError(RsoLidarError, ValueError):
    """A motion that is undefined at some epochs.

    `bad` is the boolean mask (time) of those epochs.
    """

    def __init__(self, message: str, bad: np.ndarray | None = None) -> None:
        """Take the message of the error.

        Parameters
        ----------
        message : where, what, and what to do
        bad : boolean mask (time) of the epochs without an answer
        """
        super().__init__(message)
        self.bad = np.zeros(0, dtype=bool) if bad is None else np.asarray(bad, dtype=bool)


class RecordingError(RsoLidarError, ValueError):
    """A recording that cannot be read, or an output that may not be written."""


class DatasetError(RsoLidarError, ValueError):
    """A dataset that cannot be made as specified, or a folder of one that is damaged or does not fit."""


class RunError(RsoLidarError, RuntimeError):
    """A run that started but could not finish, such as on a full disk. The command line exits with status 1."""


class RsoLidarWarning(UserWarning):
    """A setting that is allowed and probably not intended."""


_suppressed: ContextVar[bool] = ContextVar("suppressed", default=False)
_collected: ContextVar[list[str] | None] = ContextVar("collected", default=None)


@contextmanager
def suppress_warnings() -> Iterator[None]:
    """Suppress repeated warnings in this thread during auxiliary calculations."""
    token = _suppressed.set(True)
    try:
        yield
    finally:
        _suppressed.reset(token)


@contextmanager
def collect_warnings() -> Iterator[list[str]]:
    """Collect the messages of warnings in this thread, each once, instead of showing them; yield the list.

    Warnings that are given once a process are collected each time. `suppress_warnings` around this context has no effect.
    """
    lines: list[str] = []
    tokens = _collected.set(lines), _suppressed.set(False)
    try:
        yield lines
    finally:
        _collected.reset(tokens[0])
        _suppressed.reset(tokens[1])


def has_warnings_enabled() -> bool:
    """Return whether warnings are shown here, for callers that must compute something to decide on one."""
    return not _suppressed.get()


_warned: set[Hashable] = set()  # of what warnings were given that are given once a process


def warn(message: str, *, about: Hashable = None) -> None:
    """Warn of a setting that is allowed and probably not intended, unless `suppress_warnings` is in effect.

    With `about`, the warning is shown once a process for whatever equals it.
    """
    if has_warnings_enabled() and not _collect(message) and (about is None or about not in _warned):
        _warned.add(about)
        warnings.warn(message, RsoLidarWarning, stacklevel=3)


def warn_of_input(message: str) -> None:
    """Warn of what an input file holds, where it is used; the first time even if `suppress_warnings` is in effect.

    The place of the warning is always this line, so that Python's default filter prints each message once.
    """
    if has_warnings_enabled() and _collect(message):
        return
    if has_warnings_enabled() or message not in _warned:
        _warned.add(message)
        warnings.warn(message, RsoLidarWarning, stacklevel=1)


def _collect(message: str) -> bool:
    """Add a message to the warnings that are collected in this thread, and return whether they are."""
    lines = _collected.get()
    if lines is not None and message not in lines:
        lines.append(message)
    return lines is not None


class _PlacePrefix(AbstractContextManager[None]):
    """A context that prefixes messages with a place; it costs little, because steps of a run enter it."""

    def __init__(self, place: str) -> None:
        self._place = place

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if isinstance(error, RsoLidarError) and not str(error).startswith(f"{self._place}: "):
            raise rephrase(error, f"{self._place}: {error}") from None


def rephrase(error: RsoLidarError, message: str) -> RsoLidarError:
    """Return an error of the same class and attributes, such as the mask of bad epochs, with another message."""
    copy = type(error)(message)
    vars(copy).update(vars(error))
    return copy


def add_place(place: str) -> AbstractContextManager[None]:
    """Prefix the message of an `RsoLidarError` raised in this context, which may be entered again, with a place.

    >>> with add_place("tdrs.motion"):
    ...     raise ScenarioError("no such thing; name another")
    Traceback (most recent call last):
    rso_lidar.errors.ScenarioError: tdrs.motion: no such thing; name another
    """
    return _PlacePrefix(place)


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Return ``"; did you mean 'x'?"`` for the nearest known word, or an empty string.

    A file suffix is too short for a similarity ratio. Two suffixes are near if they start with the same letter and differ
    by one edit: an insertion, a deletion, a substitution or a swap of neighbours.

    >>> did_you_mean("natural_freq_hz", ["natural_hz", "damping"])
    "; did you mean 'natural_hz'?"
    >>> did_you_mean(".cvs", [".csv", ".png"]), did_you_mean(".foo", [".oem", ".csv"])
    ("; did you mean '.csv'?", '')
    """
    if word.startswith("."):
        near = [suffix for suffix in known if word[1:2] == suffix[1:2] and _is_one_slip(word, suffix)]
    else:
        near = difflib.get_close_matches(word, list(known), n=1, cutoff=0.5)
    return f"; did you mean '{near[0]}'?" if near else ""


def join_problems(problems: Iterable[str], separator: str = "; ") -> str:
    """Join descriptions of problems for one message: as many as fit, at least one, then the number of the others.

    Parameters
    ----------
    problems : descriptions, the causes first

    >>> join_problems(["a: is missing", "b: is missing"])
    'a: is missing; b: is missing'
    >>> join_problems(f"key_{number:03}: is missing" for number in range(100))[-60:]
    'sing; key_036: is missing; key_037: is missing (and 62 more)'
    """
    texts = list(problems)
    count, length = 0, 0
    while count < len(texts) and (count == 0 or length + len(texts[count]) <= _MOST_OF_PROBLEMS):
        length += len(texts[count]) + len(separator)
        count += 1
    more = f" (and {len(texts) - count} more)" if count < len(texts) else ""
    return f"{separator.join(texts[:count])}{more}"


def make_printable(text: str) -> str:
    r"""Make one printable line of a text: control characters become a space, and unpaired surrogates a '?'.

    >>> make_printable("A\nB \ud800")
    'A B ?'
    """
    if text.isprintable():
        return text
    return _UNPRINTED.sub(" ", text.encode("utf-8", "replace").decode("utf-8")).strip()


def quote_value(value: Any) -> str:
    """Quote a value for a message, cut to 40 characters."""
    try:
        text = " ".join(str(value).split())
    except (ValueError, RecursionError):  # an integer of thousands of digits
        text = type(value).__name__
    return f"'{text[:37]}...'" if len(text) > 40 else f"'{text}'"


def _is_one_slip(word: str, meant: str) -> bool:
    """Return whether two words differ by one edit: an insertion, deletion, substitution or swap of neighbours."""
    start = 0
    while start < min(len(word), len(meant)) and word[start] == meant[start]:
        start += 1
    word_rest, meant_rest = word[start:], meant[start:]
    return (
        word_rest[1:] == meant_rest
        or word_rest == meant_rest[1:]
        or word_rest[1:] == meant_rest[1:]
        or (word_rest[:2] == meant_rest[1::-1] and word_rest[2:] == meant_rest[2:])
    )

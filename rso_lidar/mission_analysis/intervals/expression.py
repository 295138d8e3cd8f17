"""Expressions of conditions, such as ``range < 50km and lit and not sun < 30deg``.

Conditions are joined by ``and``, ``or``, ``not`` and parentheses. Each is a word, with arguments in parentheses where it
takes some. A quantity is compared with a number and its unit.
"""

from __future__ import annotations

import itertools
import math
import re
import string
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from rso_lidar import units
from rso_lidar.errors import ScenarioError, did_you_mean
from rso_lidar.orbit import join_spans

# Factors to SI by kind of quantity. A number of a kind without units has none.
UNITS: dict[str, dict[str, float]] = {
    "length": {"m": 1.0, "km": units.KM},
    "angle": {"deg": units.DEG, "rad": 1.0},
    "speed": {"m/s": 1.0, "km/s": units.KM},
    "turning": {"deg/s": units.DEG, "rad/s": 1.0},
    "number": {"": 1.0},
}
_TOKEN = re.compile(
    r"\s*(?:(?P<compare><=|>=|<|>)|(?P<mark>[(),])|(?P<number>[+-]?[0-9.]+(?:[eE][+-]?[0-9]+)?)|(?P<axis>[+-][a-z])"
    r"|(?P<word>[A-Za-z_][\w./-]*))"
)
_SLIVER_S = 1e-3  # spans shorter than this are rounding of edges
_DEEPEST = 50  # parentheses and nots within each other
_MOST_CONDITIONS = 200  # each is searched by itself: some 20 ms of work for an orbit


@dataclass(frozen=True)
class Condition:
    """One condition of an expression.

    Parameters
    ----------
    word : such as ``range`` or ``contact``
    arguments : in its parentheses
    is_below : whether it asks for values below the limit; None for a condition without a comparison
    limit : in SI units
    """

    word: str
    arguments: tuple[str, ...] = ()
    is_below: bool | None = None
    limit: float = 0.0


@dataclass(frozen=True)
class Combination:
    """Expressions that are combined: ``and``, ``or``, or ``not`` of one."""

    kind: str
    parts: tuple[Expression, ...]


Expression = Condition | Combination
FindSpans = Callable[[Condition, Sequence[tuple[float, float]]], list[tuple[float, float]]]


def find_in_windows(
    expression: Expression, find: FindSpans, windows: Sequence[tuple[float, float]]
) -> list[tuple[float, float]]:
    """Find the spans within some windows in which an expression holds.

    The parts of ``and`` are searched in order, each within the spans of those before.

    Parameters
    ----------
    expression : what must hold
    find : ``find(condition, windows) -> spans`` of one condition
    windows : in order [s]

    Returns
    -------
    list of (begin, end)
        [s] in order; spans of neighbouring windows are not joined
    """
    if not windows:
        return []
    if isinstance(expression, Condition):
        return find(expression, windows)
    if expression.kind == "and":
        spans = list(windows)
        for part in expression.parts:
            spans = find_in_windows(part, find, spans)
        return spans
    each = [find_in_windows(part, find, windows) for part in expression.parts]
    joined = join_spans([span for spans in each for span in spans], 0.0)
    if expression.kind == "not":
        gaps = itertools.pairwise([-math.inf, *(edge for span in joined for edge in span), math.inf])
        joined = list(gaps)[::2]
    both = intersect_spans(windows, joined)
    return [span for span in both if span[1] - span[0] > _SLIVER_S] if expression.kind == "not" else both


def intersect_spans(
    windows: Sequence[tuple[float, float]], spans: Sequence[tuple[float, float]]
) -> list[tuple[float, float]]:
    """Return the parts of spans, each list in order, that are in windows; spans are cut where one window follows another."""
    overlaps: list[tuple[float, float]] = []
    first = 0
    for begin, end in windows:
        while first < len(spans) and spans[first][1] <= begin:
            first += 1
        k = first
        while k < len(spans) and spans[k][0] < end:
            overlaps.append((max(begin, spans[k][0]), min(end, spans[k][1])))
            k += 1
    return overlaps


def parse_expression(text: str, words: dict[str, str | None]) -> Expression:
    """Parse an expression.

    Parameters
    ----------
    text : such as ``range < 50km and (lit or not umbra)``
    words : kind of the unit of each quantity, and None for words that take no comparison

    Raises
    ------
    ScenarioError
        With the place at which it is wrong.

    >>> parse_expression("range < 2km", {"range": "length"})
    Condition(word='range', arguments=(), is_below=True, limit=2000.0)
    """
    return _Parser(text, words).parse()


def parse_quantity(text: str, kind: str) -> float | None:
    """Parse a number with its unit, such as ``30deg``, and return it in SI units; None for what is not one of its kind.

    Parameters
    ----------
    kind : of unit, of `UNITS`
    """
    number = text.rstrip("/" + string.ascii_letters)
    factor = UNITS[kind].get(text[len(number) :])
    try:
        value = float("nan") if factor is None else factor * float(number)
    except ValueError:
        value = float("nan")
    return value if math.isfinite(value) else None


class _Parser:
    """A parser that descends: or, and, not, and conditions or parentheses."""

    def __init__(self, text: str, words: dict[str, str | None]) -> None:
        self._text, self._words = " ".join(text.split()), words
        self._tokens: list[tuple[str, str, int]] = []
        place = 0
        while place < len(self._text):
            match = _TOKEN.match(self._text, place)
            if match is None:
                raise self._wrong(place, "is not understood")
            kind = str(match.lastgroup)
            self._tokens.append((kind, match[kind], match.start(kind)))
            place = match.end()
        self._at = 0
        joints = sum(text in ("and", "or") for kind, text, _ in self._tokens if kind == "word")
        if joints >= _MOST_CONDITIONS:
            raise ScenarioError(
                f"when '{self._text:.60}': has {joints + 1:,} conditions; give at most {_MOST_CONDITIONS} in one "
                "expression, and the rest in others"
            )

    def parse(self) -> Expression:
        """Parse the whole text."""
        expression = self._parse_joined(("or", "and"), 0)
        if self._at < len(self._tokens):
            raise self._wrong(self._tokens[self._at][2], "is one too many; join conditions by and, or")
        return expression

    def _parse_joined(self, kinds: tuple[str, ...], depth: int) -> Expression:
        """Parse expressions that are joined by the first of some words, and within them by the others."""
        if not kinds:
            return self._parse_single(depth)
        parts = [self._parse_joined(kinds[1:], depth)]
        while self._take(kinds[0]):
            parts.append(self._parse_joined(kinds[1:], depth))
        return parts[0] if len(parts) == 1 else Combination(kinds[0], tuple(parts))

    def _parse_single(self, depth: int) -> Expression:
        if depth > _DEEPEST:
            raise ScenarioError(f"when '{self._text:.60}': is nested too deeply; simplify it")
        if self._take("not"):
            return Combination("not", (self._parse_single(depth + 1),))
        if self._take("("):
            expression = self._parse_joined(("or", "and"), depth + 1)
            self._need(")")
            return expression
        return self._parse_condition()

    def _parse_condition(self) -> Condition:
        kind, word, place = self._next("a condition")
        if kind != "word" or word in ("and", "or"):
            raise self._wrong(place, "is not a condition")
        if word not in self._words:
            guess = did_you_mean(word, self._words)
            raise self._wrong(place, f"is not a condition{guess or ';'} (known: {', '.join(self._words)})")
        arguments: list[str] = []
        if self._take("("):
            arguments.append(self._parse_argument())
            while self._take(","):
                arguments.append(self._parse_argument())
            self._need(")")
        unit_kind = self._words[word]
        compares = self._at < len(self._tokens) and self._tokens[self._at][0] == "compare"
        if unit_kind is None:
            if compares:
                raise self._wrong(place, "holds or does not, and is not compared; leave the comparison out")
            return Condition(word, tuple(arguments))
        example = next(iter(UNITS[unit_kind]))
        if not compares:
            raise self._wrong(place, f"needs a limit; write for example {word} < 5{example}")
        sign = self._next("a comparison")[1]
        limit = self._parse_limit(word, unit_kind)
        if word == "found" and not 0.0 <= limit <= 1.0:
            raise self._wrong(place, "is a probability; compare it with a number from 0 to 1")
        if unit_kind == "angle" and abs(limit) > math.pi * (1.0 + 1e-9):
            raise self._wrong(place, "is an angle; compare it with at most 180deg")
        if unit_kind in ("length", "speed", "turning") and limit < 0.0:
            raise self._wrong(place, "is never negative; compare it with 0 or more")
        return Condition(word, tuple(arguments), "<" in sign, limit)

    def _parse_argument(self) -> str:
        """Parse a word, or a number with its unit."""
        kind, text, place = self._next("an argument")
        if kind not in ("word", "number", "axis"):
            raise self._wrong(place, "comes where an argument is needed")
        if kind == "number" and self._at < len(self._tokens) and self._tokens[self._at][0] == "word":
            text += self._next("a unit")[1]
        return text

    def _parse_limit(self, word: str, unit_kind: str) -> float:
        """Parse a number with its unit, and return it in SI units."""
        known = UNITS[unit_kind]
        kind, number, place = self._next("a number")
        try:
            value = float(number) if kind == "number" else float("nan")
        except ValueError:
            value = float("nan")
        if not math.isfinite(value):
            raise self._wrong(place, f"is not a number; write for example {word} < 5{next(iter(known))}")
        if "" in known:
            return value
        names = ", ".join(known)
        if self._at >= len(self._tokens) or self._tokens[self._at][1] not in known:
            here = self._tokens[self._at][1] if self._at < len(self._tokens) else ""
            what = "has no unit" if here in ("", "and", "or", ")", ",") else f"has the unknown unit '{here}'"
            raise self._wrong(place, f"{what}; write {number}{next(iter(known))} (known: {names})")
        return value * known[self._next("a unit")[1]]

    def _take(self, text: str) -> bool:
        """Go past a token if it is the next one."""
        if self._at < len(self._tokens) and self._tokens[self._at][1] == text:
            self._at += 1
            return True
        return False

    def _need(self, text: str) -> None:
        if not self._take(text):
            place = self._tokens[self._at][2] if self._at < len(self._tokens) else len(self._text)
            raise self._wrong(place, f"comes where '{text}' is needed")

    def _next(self, what: str) -> tuple[str, str, int]:
        if self._at >= len(self._tokens):
            raise ScenarioError(f"when '{self._text:.80}': ends where {what} is needed; complete it")
        self._at += 1
        return self._tokens[self._at - 1]

    def _wrong(self, place: int, why: str) -> ScenarioError:
        rest = self._text[place:].strip().split(" ")[0][:40] or "the end"
        cure = "" if ";" in why or "?" in why else "; correct it"
        return ScenarioError(f"when '{self._text:.80}': '{rest}' {why}{cure}")

"""Named constants of a detector that a fit varies: their limits, and the unlimited numbers that stand for them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rso_lidar.detector.detection import AnyDetector
from rso_lidar.errors import ScenarioError, did_you_mean
from rso_lidar.part import Part


@dataclass(frozen=True)
class FreeConstant:
    """A constant that a fit varies.

    Parameters
    ----------
    name : dotted name in `[lidar.detector]`, such as ``amplifier.noise_electrons``
    start : value at which the fit starts
    low, high : limits between which it may lie, infinite without one
    """

    name: str
    start: float
    low: float
    high: float

    def to_free(self, value: float) -> float:
        """Return the unlimited number for a value: a logarithm from one limit, a logit between two."""
        if math.isfinite(self.low) and math.isfinite(self.high):
            return math.log((value - self.low) / (self.high - value))
        if math.isfinite(self.low):
            return math.log(value - self.low)
        return value / max(abs(self.start), 0.1)

    def to_value(self, free: float) -> float:
        """Return the value for an unlimited number."""
        free = min(max(free, -200.0), 200.0) if math.isfinite(self.low) else free
        if math.isfinite(self.low) and math.isfinite(self.high):
            return self.low + (self.high - self.low) / (1.0 + math.exp(-free))
        if math.isfinite(self.low):
            return self.low + math.exp(free)
        return free * max(abs(self.start), 0.1)


def find_constants(
    detector: AnyDetector, names: Sequence[str], start: Mapping[str, float] | None = None
) -> list[FreeConstant]:
    """Find named constants of a detector, their limits and where a fit starts.

    Parameters
    ----------
    names : dotted names, such as ``amplifier.noise_electrons``
    start : by name, in place of the detector's own values

    Raises
    ------
    ScenarioError
        If the detector has no such number, it is given twice, or its start is not inside its limits.
    """
    known = dict(_iterate_numbers(detector))
    constants: list[FreeConstant] = []
    for name in names:
        if name not in known:
            raise ScenarioError(
                f"constants: the detector of type '{getattr(detector, 'type', 'python')}' has no number '{name}'"
                f"{did_you_mean(name, known)} (known: {', '.join(known)})"
            )
        if any(constant.name == name for constant in constants):
            raise ScenarioError(f"constants: '{name}' is given twice; leave one out")
        value, low, high = known[name]
        value = float((start or {}).get(name, value))
        if not low < value < high:
            raise ScenarioError(
                f"start.{name}: {value:g} is not inside its limits {low:g} to {high:g}; give a start between them"
            )
        constants.append(FreeConstant(name, value, low, high))
    if unknown := [name for name in start or {} if name not in names]:
        raise ScenarioError(
            f"start: '{unknown[0]}' is not among the constants{did_you_mean(unknown[0], names)}; add it"
        )
    return constants


def set_constants(detector: AnyDetector, values: Mapping[str, float]) -> Any:
    """Return a detector with other values of some constants.

    Parameters
    ----------
    values : by dotted name

    Raises
    ------
    ScenarioError
        If the detector does not allow these values together.
    """
    part: Any = detector
    changes: dict[str, Any] = {}
    inner: dict[str, dict[str, float]] = {}
    for name, value in values.items():
        table, dot, key = name.partition(".")
        if dot:
            inner.setdefault(table, {})[key] = value
        else:
            changes[table] = value
    changes |= {table: set_constants(getattr(part, table), some) for table, some in inner.items()}
    return part.replace(**changes)


def get_constant(detector: AnyDetector, name: str) -> float:
    """Return the value of a constant of a detector.

    Parameters
    ----------
    detector : a part with that number
    name : dotted name in `[lidar.detector]`, such as ``amplifier.noise_electrons``
    """
    value: Any = detector
    for key in name.split("."):
        value = getattr(value, key)
    return float(value)


def _iterate_numbers(part: Any, place: str = "") -> Iterator[tuple[str, tuple[float, float, float]]]:
    """Yield the dotted name of each number of a part and of those in it, with its value and limits."""
    if not isinstance(part, Part):
        return
    for name, field in type(part).model_fields.items():
        value = getattr(part, name)
        if isinstance(value, Part):
            yield from _iterate_numbers(value, f"{place}{name}.")
        elif isinstance(value, float):
            limits = [inner for item in field.metadata for inner in getattr(item, "metadata", [item])]
            lows = [getattr(item, key) for item in limits for key in ("gt", "ge") if hasattr(item, key)]
            highs = [getattr(item, key) for item in limits for key in ("lt", "le") if hasattr(item, key)]
            yield f"{place}{name}", (value, max(lows, default=-math.inf), min(highs, default=math.inf))

"""The verification matrix: one result for each requirement, as a text table, CSV or JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Literal

from rso_lidar.files import align_columns, check_writable, format_csv, write_text
from rso_lidar.study.verification.requirements_file import Requirement

Verdict = Literal["met", "not met", "not shown"]
_COLUMNS = (
    "id", "quantity", "unit", "at_least", "at_most", "value", "confidence", "low", "high", "margin", "verdict", "sample",
    "note", "verification", "text", "rationale", "source",
)  # fmt: skip


@dataclass(frozen=True)
class RequirementResult:
    """The result of one requirement.

    `value` is NaN where there is none. `low` and `high` are one-sided bounds of a quantity that depends on noise, each
    with the confidence of the requirement, and the value of another quantity; NaN where the sample gives no bound.
    `margin` is the distance of the bounds from the limits, negative outside. `sample` describes what the value comes
    from, and `note` what the reader should know.
    """

    requirement: Requirement
    unit: str
    value: float
    low: float
    high: float
    margin: float
    verdict: Verdict
    sample: str
    note: str


def judge(requirement: Requirement, low: float, high: float) -> Verdict:
    """Return the verdict on a value by its confidence bounds.

    ``met`` and ``not met`` are each wrong with a probability of at most 1 − confidence. For two limits, both bounds must be
    inside (two one-sided tests; Schuirmann, 1987).

    Parameters
    ----------
    low, high : lower and upper confidence bound of the value, or the value twice; NaN for none
    """
    if math.isnan(low) or math.isnan(high):
        return "not shown"
    least, most = requirement.limits
    if low >= least and high <= most:
        return "met"
    return "not met" if high < least or low > most else "not shown"


@dataclass(frozen=True, eq=False)
class VerificationMatrix:
    """Results of all requirements of a file on one subject: a scenario, a study or a recording.

    `name` is the title of the requirements, `subject` describes what was evaluated, and `versions` are those of the
    libraries by name. `SUFFIXES` are those of the files that `save` writes.
    """

    SUFFIXES: ClassVar[tuple[str, ...]] = (".csv", ".json")

    name: str
    subject: str
    results: tuple[RequirementResult, ...]
    versions: Mapping[str, str]

    @property
    def is_met(self) -> bool:
        """Whether all requirements are met."""
        return all(result.verdict == "met" for result in self.results)

    def count(self, verdict: Verdict) -> int:
        """Return the number of results with a verdict.

        Parameters
        ----------
        verdict : ``met``, ``not met`` or ``not shown``
        """
        return sum(result.verdict == verdict for result in self.results)

    def table(self) -> str:
        """Return a text table, one row for each requirement, with notes below it."""
        counts = ", ".join(
            f"{n} {verdict}" for verdict in ("met", "not met", "not shown") if (n := self.count(verdict))
        )
        heads = ("id", "quantity", "bound", "value", "confidence bound", "margin", "verdict")
        rows = [heads, *(_format_row(result) for result in self.results)]
        lines = [f"{self.name}: {self.subject}", f"{len(self.results)} requirements: {counts}", ""]
        lines += align_columns(rows, left=(0, 1, 2, 4, 6))
        notes = [f"{result.requirement.id}: {result.note}" for result in self.results if result.note]
        return "\n".join([*lines, *([""] if notes else []), *notes])

    def csv_text(self) -> str:
        """Return all results as CSV, one row for each requirement; a number that does not exist is empty."""
        return format_csv([_COLUMNS, *(_tabulate(result).values() for result in self.results)])

    def json_text(self) -> str:
        """Return all results as JSON, with the counts of verdicts and the versions; a number that does not exist is null."""
        counts = {verdict: self.count(verdict) for verdict in ("met", "not met", "not shown")}
        tree = {"name": self.name, "subject": self.subject, "is_met": self.is_met, "counts": counts}
        tree |= {"requirements": [_tabulate(result) for result in self.results], "versions": dict(self.versions)}
        return json.dumps(tree, indent=1, ensure_ascii=False) + "\n"

    def save(self, path: str | Path, *, overwrite: bool = False) -> Path:
        """Write the matrix.

        Parameters
        ----------
        path : of the output, .csv or .json
        overwrite : whether an existing file may be replaced

        Returns
        -------
        Path

        Raises
        ------
        RecordingError
            For another suffix, or a path that cannot be written.
        """
        place = check_writable(path, self.SUFFIXES, overwrite=overwrite)
        text = self.json_text() if place.suffix.lower() == ".json" else self.csv_text()
        return write_text(place, text, overwrite=overwrite)


def _tabulate(result: RequirementResult) -> dict[str, Any]:
    """Return a result by column, None for a number that does not exist."""
    asked = result.requirement
    least, most = asked.limits
    numbers = {
        "at_least": least,
        "at_most": most,
        "value": result.value,
        "low": result.low,
        "high": result.high,
        "margin": result.margin,
    }
    texts = {"id": asked.id, "quantity": asked.quantity, "unit": result.unit, "confidence": asked.confidence}
    texts |= {
        "verdict": result.verdict,
        "sample": result.sample,
        "note": result.note,
        "verification": asked.verification,
    }
    texts |= {"text": asked.text, "rationale": asked.rationale, "source": asked.source}
    row: dict[str, Any] = texts | {name: value if math.isfinite(value) else None for name, value in numbers.items()}
    return {name: row[name] for name in _COLUMNS}


def _format_row(result: RequirementResult) -> tuple[str, ...]:
    """Return the cells of a row of the text table."""
    asked, unit = result.requirement, "" if result.unit == "1" else f" {result.unit}"
    conditions = describe_conditions(asked)
    quantity = f"{asked.quantity}, {conditions}" if conditions else asked.quantity
    return (
        asked.id,
        quantity,
        f"{describe_bound(asked)}{unit}",
        f"{_format_number(result.value)}{unit}" if math.isfinite(result.value) else "none",
        _describe_bounds(result, unit),
        f"{_format_number(result.margin)}{unit}" if math.isfinite(result.margin) else "none",
        result.verdict,
    )


def _describe_bounds(result: RequirementResult, unit: str) -> str:
    """Describe the confidence bounds that decide; empty for a quantity without noise."""
    asked = result.requirement
    if asked.confidence is None:
        return ""
    at = f" at {100.0 * asked.confidence:g} %"
    if math.isnan(result.low):
        return f"none{at}"
    if asked.within is not None:
        return f"{_format_number(result.low)} to {_format_number(result.high)}{unit}{at}"
    word, bound = (">=", result.low) if asked.at_least is not None else ("<=", result.high)
    return f"{word} {_format_number(bound)}{unit}{at}"


def describe_bound(asked: Requirement) -> str:
    """Describe the bound of a requirement in words, without its unit."""
    if asked.within is not None:
        return f"{asked.within[0]:g} to {asked.within[1]:g}"
    return f"at least {asked.at_least:g}" if asked.at_least is not None else f"at most {asked.at_most:g}"


def describe_conditions(asked: Requirement) -> str:
    """Describe the conditions of a requirement in a few words; empty for none."""
    words: list[str] = [asked.statistic or ""]
    if asked.range_m is not None:
        words.append(f"at {asked.range_m:g} m")
    if asked.probability is not None:
        words.append(f"P = {asked.probability:g}")
    if asked.material is not None:
        words.append(asked.material)
    if asked.tilt_deg:
        words.append(f"tilt {asked.tilt_deg:g}°")
    if asked.between_m is not None:
        words.append(f"{asked.between_m[0]:g} to {asked.between_m[1]:g} m")
    if asked.frames is not None:
        words.append(f"frames {asked.frames}" if isinstance(asked.frames, str) else f"{len(asked.frames)} frames")
    return ", ".join(filter(None, words))


def _format_number(value: float) -> str:
    return f"{value:.4g}"

"""Pages of the validation ledger: capabilities with their gaps first, and all rows that tests compared."""

import math
import textwrap
from pathlib import Path

from rso_lidar.files import write_text
from tests.ledger.assumed_defaults import list_assumed_defaults
from tests.ledger.capabilities import KINDS, build_ledger, file_title

STATUS_WORDS = {  # of the sentence of counts, and headings with what they mean
    "failed": ("failed", "Failed", "A comparison of this run was outside its tolerance."),
    "not run": ("not run", "Not run", "There are comparisons, but none of them ran: data or programs were absent."),
    "assumed": ("assumed", "Assumed", "No source, and nothing independent to compare with: a choice of this project."),
    "modelled": (
        "modelled",
        "Modelled",
        "The equations have a source, but nothing independent was compared. Comparisons of the package with itself, or "
        "with a figure to which a number was fitted, do not count.",
    ),
    "validated": (
        "validated",
        "Validated",
        "Compared with something independent. A *published measurement* is of a real instrument or material. "
        "An *other program* was run, or its results were kept. A *published number* is a printed example, a data sheet or a "
        "standard. A *closed form* was worked out for the test. Under *how near* stands the number that uses most of its "
        "tolerance.",
    ),
}
CASES = "validation_cases.md"
NO_CAMERA = (
    "**No camera was measured for this package.** Curves of the default detector have the shape that theory gives them; "
    "their place on the axes rests on assumed numbers."
)
HOW_IT_IS_MADE = (
    "`tests/ledger/capabilities.toml` lists the capabilities, their references and the tests that compare them. Every "
    "part, format, command and preset that users can name belongs to one of them. `make validate` runs the tests and "
    f"derives each status from what ran. All rows are in [{CASES}]({CASES}). Spacecraft and orbits from outside the "
    "repository are brought in by `make real-data FROM=folder` ([where they are public](../tests/real_data.md)). Without "
    "them, rows are shown as not run. The page in the repository keeps the last result of each test from a "
    "machine that could run it."
)
DEFAULTS = (
    "A validated capability may start from assumed numbers: the model is right, the number is a guess. {total} defaults say "
    "that they are assumed. Give your own before you rely on a result. "
    "[physics.md](physics.md#defaults-and-where-they-come-from) has the values, and where each comes from."
)
CASES_INTRODUCTION = (
    "What rso_lidar {version} was compared with, number by number. A test that passed checked every row, and the tolerance "
    "is the test's own. `make validate` writes this page; [validation.md](validation.md) is the ledger of capabilities that "
    "follows from it."
)


def write_pages(folder, capabilities, results):
    """Write validation.md and validation_cases.md to a folder, and return the ledger that they show."""
    ledger = build_ledger(capabilities, results)
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    write_text(folder / "validation.md", ledger_page(ledger), overwrite=True)
    write_text(folder / CASES, cases_page(results), overwrite=True)
    return ledger


def summary(ledger):
    """Return the counts of a ledger in three lines."""
    counts = [f"{ledger.count(status)} {words[0]}" for status, words in STATUS_WORDS.items()]
    rows = [row for result in ledger.results.tests.values() if result.outcome == "passed" for row in set(result.rows)]
    outcomes = [result.outcome for result in ledger.results.tests.values()]
    lines = [
        f"{len(ledger.entries)} capabilities: {', '.join(reversed(counts))}",
        f"{len(rows):,} numbers compared; tests: {outcomes.count('passed'):,} passed, {outcomes.count('failed')} failed, "
        f"{outcomes.count('skipped')} not run",
    ]
    lines += [f"not run: {reason} ({count})" for reason, count in skip_reasons(ledger.results)]
    return lines


def skip_reasons(results):
    """Return why tests did not run, with the number of tests, the commonest reason first."""
    reasons = [result.reason for result in results.tests.values() if result.outcome == "skipped"]
    return sorted({(reason, reasons.count(reason)) for reason in reasons}, key=lambda each: (-each[1], each[0]))


def ledger_page(ledger):
    """Return the page of the ledger: counts, gaps, what is validated, and assumed defaults."""
    lines = [
        "# Validation ledger",
        "",
        *paragraph(f"What each capability of rso_lidar {ledger.results.version} rests on. {_counts_sentence(ledger)}"),
        "",
        *paragraph(NO_CAMERA),
        "",
        *_overview(ledger),
    ]
    for status, (_, heading, meaning) in STATUS_WORDS.items():
        entries = [entry for entry in ledger.entries if entry.status == status]
        if entries:
            lines += ["", f"## {heading}", "", *paragraph(meaning), ""]
            lines += {"assumed": _assumed, "modelled": _modelled}.get(status, _compared)(entries)
    lines += _defaults_section(ledger)
    lines += _skipped_section(ledger.results)
    lines += ["", "## How the ledger is made", "", *paragraph(HOW_IT_IS_MADE)]
    return "\n".join(lines) + "\n"


def paragraph(text):
    """Return a paragraph as lines of a page."""
    return textwrap.wrap(text, 120, break_long_words=False, break_on_hyphens=False)


def _counts_sentence(ledger):
    """Return one sentence with the number of capabilities of each status."""
    shown = [
        status for status in STATUS_WORDS if ledger.count(status) or status in ("assumed", "modelled", "validated")
    ]
    told = [f"{ledger.count(status)} {STATUS_WORDS[status][0]}" for status in shown]
    return f"**{len(ledger.entries)} capabilities: {', '.join(told[:-1])} and {told[-1]}.**"


def _overview(ledger):
    """Return a table: for each area the number of capabilities of each status, and of each kind of comparison."""
    gaps = [status for status in STATUS_WORDS if status != "validated" and ledger.count(status)]
    kinds = [kind for kind in KINDS if kind != "itself"]
    head = ["area", *gaps, "validated", *(f"by {KINDS[kind]}" for kind in kinds)]
    lines = [f"| {' | '.join(head)} |", "| --- |" + " ---: |" * (len(head) - 1)]
    areas = list(dict.fromkeys(entry.capability.area for entry in ledger.entries))
    for area in [*areas, None]:
        entries = [entry for entry in ledger.entries if area in (None, entry.capability.area)]
        numbers = [sum(entry.status == status for entry in entries) for status in [*gaps, "validated"]]
        numbers += [sum(best_kind(entry) == kind for entry in entries) for kind in kinds]
        cells = [str(number) if number else "" for number in numbers]
        lines.append(f"| {area or '**all**'} | {' | '.join(cells)} |")
    return lines


def best_kind(entry):
    """Return the kind of comparison of most weight that ran for a validated capability."""
    if entry.status != "validated":
        return None
    return next(kind for kind in KINDS if any(each.ran and each.evidence.kind == kind for each in entry.independent))


def _assumed(entries):
    lines = ["| capability | area | what is assumed |", "| --- | --- | --- |"]
    lines += [f"| {plain(e.capability.name)} | {e.capability.area} | {plain(e.capability.gap)} |" for e in entries]
    return lines


def _modelled(entries):
    lines = ["| capability | area | reference | what is missing | compared with the package itself |"]
    lines += ["| --- | --- | --- | --- | --- |"]
    for entry in entries:
        own = "; ".join(f"{plain(each.evidence.against)}: {how_near(each)}" for each in entry.compared if each.ran)
        given = entry.capability
        lines.append(
            f"| {plain(given.name)} | {given.area} | {plain(given.reference)} | {plain(given.gap)} | {own or '–'} |"
        )
    return lines


def _compared(entries):
    lines = []
    for area in dict.fromkeys(entry.capability.area for entry in entries):
        lines += [] if not lines else [""]
        lines += [f"### {area}", ""] if entries[0].status == "validated" else [f"**{area}**", ""]
        lines += ["| capability | compared with | kind | how near | not covered |", "| --- | --- | --- | --- | --- |"]
        for entry in entries:
            if entry.capability.area == area:
                lines += _lines_of(entry)
    return lines


def _lines_of(entry):
    shown = sorted(entry.independent, key=lambda each: list(KINDS).index(each.evidence.kind))
    for number, each in enumerate(shown):
        name = plain(entry.capability.name) if number == 0 else ""
        gap = plain(entry.capability.gap) if number == 0 else ""
        yield f"| {name} | {plain(each.evidence.against)} | {KINDS[each.evidence.kind]} | {how_near(each)} | {gap} |"


def how_near(compared):
    """Return how near a comparison came, in words: of its rows the one that uses most of its tolerance."""
    parts = []
    if compared.failed:
        parts.append(f"**{counted(len(compared.failed), 'test')} failed**")
    if compared.rows:
        worst = max(compared.rows, key=lambda row: row.share)
        number = counted(len(compared.rows), "number")
        link = ":" if len(compared.rows) == 1 else "; nearest to its limit:"
        parts.append(f"{number}{link} {plain(worst.case)}, {difference(worst)}")
    if compared.checks:
        parts.append(f"{counted(compared.checks, 'check')} passed")
    if compared.skipped:
        reasons = "; ".join(sorted({reason for _, reason in compared.skipped}))
        parts.append(f"**not run**: {counted(len(compared.skipped), 'test')} ({plain(reasons)})")
    return "; ".join(parts) or "**not run**"


def difference(row):
    """Return the difference of a row and what is allowed, in its unit."""
    unit = "" if row.unit in ("", "1") else f" {row.unit}"
    if row.tolerance == 0:
        return "no difference"
    return f"{row.difference:.2g}{unit} off, {row.tolerance:.2g}{unit} allowed"


def _defaults_section(ledger):
    """Return the section of assumed defaults: those of each capability's parts whose descriptions say so."""
    found = [(entry, list_assumed_defaults(entry.capability.has)) for entry in ledger.entries]
    found = [(entry, names) for entry, names in found if names]
    total = sum(len(names) for _, names in found)
    lines = [
        "",
        "## Default numbers that are assumed",
        "",
        *paragraph(DEFAULTS.format(total=total)),
        "",
        "| capability | status | assumed defaults |",
        "| --- | --- | --- |",
    ]
    for entry, names in found:
        lines.append(
            f"| {plain(entry.capability.name)} | {entry.status} | {', '.join(f'`{name}`' for name in names)} |"
        )
    return lines


def _skipped_section(results):
    """Return the section of tests that did not run, with their reasons; nothing where all ran."""
    reasons = skip_reasons(results)
    if not reasons:
        return []
    lines = [
        "",
        "## Comparisons that did not run",
        "",
        "| reason | tests | rows known from earlier |",
        "| --- | ---: | ---: |",
    ]
    for reason, count in reasons:
        rows = {row for r in results.tests.values() if r.outcome == "skipped" and r.reason == reason for row in r.rows}
        lines.append(f"| {plain(reason)} | {count} | {len(rows) or ''} |")
    return lines


def cases_page(results):
    """Return the page of all rows: one table for each test file, files and cases in order."""
    lines = [
        "# Validation cases",
        "",
        *paragraph(CASES_INTRODUCTION.format(version=results.version)),
    ]
    by_file = {}
    for name, result in sorted(results.tests.items()):
        by_file.setdefault(name.partition("::")[0], []).append((name, result))
    titles = {file: file_title(file) for file in by_file}
    for file in sorted(by_file, key=lambda file: (titles[file], file)):
        lines += ["", f"## {titles[file]}", "", f"`{file}`"]
        lines += _rows_of(by_file[file])
    return "\n".join(lines) + "\n"


def _rows_of(tests):
    rows, checks = set(), []
    for name, result in tests:
        note = {"failed": "**failed**", "skipped": "**not run**"}.get(result.outcome, "")
        rows |= {(row, note, result.reason) for row in result.rows}
        if not result.rows:
            checks.append((name.partition("::")[2] or name, result))
    lines = []
    if rows:
        lines += ["", "| case | source | expected | got | tolerance |", "| --- | --- | ---: | ---: | ---: |"]
        lines += [f"| {' | '.join(cells(row, note))} |" for row, note, _ in sorted(rows)]
        if reasons := sorted({reason for _, note, reason in rows if reason}):
            lines += ["", f"Not run: {plain('; '.join(reasons))}."]
    passed = [name for name, result in checks if result.outcome == "passed"]
    if passed:
        names = dict.fromkeys(name.partition("[")[0] for name in passed)
        told = "; ".join(words(name) for name in names)
        lines += ["", f"{counted(len(passed), 'check')} without a number passed: {told}."]
    for outcome, told in (("failed", "Failed"), ("skipped", "Not run")):
        lines += [
            line
            for name, result in checks
            if result.outcome == outcome
            for line in ("", f"**{told}**: {words(name)}{f' ({plain(result.reason)})' if result.reason else ''}.")
        ]
    return lines


def cells(row, note=""):
    unit = "" if row.unit in ("", "1") else f" {row.unit}"
    got = digits(row.got, row.tolerance) + unit
    if note:
        got = f"{note}: {got}" if "failed" in note else note
    return [
        plain(row.case),
        plain(row.source),
        digits(row.expected, row.tolerance) + unit,
        got,
        f"{row.tolerance:.3g}{unit}",
    ]


def digits(value, tolerance):
    """Return a number with one digit more than its tolerance can tell apart."""
    if value == 0 or not math.isfinite(value) or not 0 < tolerance < math.inf:
        return f"{value:.12g}"
    shown = math.floor(math.log10(abs(value))) - math.floor(math.log10(tolerance)) + 2
    return f"{value:.{min(max(shown, 1), 15)}g}"


def words(name):
    """Return the name of a test as words, with its parameters as they are."""
    name, bracket, rest = name.partition("[")
    return plain(name.rpartition("::")[2].removeprefix("test_").replace("_", " ") + (f" [{rest}" if bracket else ""))


def counted(number, noun):
    return f"{number:,} {noun}{'' if number == 1 else 's'}"


def plain(text):
    return " ".join(text.split()).replace("|", "\\|")

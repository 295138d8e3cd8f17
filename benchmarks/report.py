"""What was measured, as tables: on the screen, and between the markers of a page."""

import importlib.metadata
import os
import platform
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

NAMED = ("numpy", "scipy", "numba", "embreex", "h5py", "mitsuba", "mitransient", "open3d")


@dataclass(frozen=True)
class Target:
    """One thing that was wanted of the speed, and what came of it."""

    what: str
    wanted: str
    measured: str
    met: bool

    @property
    def row(self) -> tuple[str, ...]:
        """Return it as a row of a table."""
        return self.what, self.wanted, self.measured, "met" if self.met else "**not met**"


@dataclass
class Findings:
    """What one part of the benchmarks found: blocks of text by name, and targets."""

    blocks: dict[str, str] = field(default_factory=dict)
    targets: list[Target] = field(default_factory=list)


HEADER = ("target, two cores, 128 × 128, 16 rays per pixel", "wanted", "measured", "")


def table(header: Sequence[str], rows: Iterable[Sequence[str]], left: int = 1) -> str:
    """Return a Markdown table, its first `left` columns flush left and the others right."""
    rule = ["---" if k < left else "---:" for k in range(len(header))]
    return "\n".join("| " + " | ".join(line) + " |" for line in (header, rule, *rows))


def machine() -> str:
    """Return what was measured on, in a sentence or two."""
    versions = []
    for name in NAMED:
        try:
            versions.append(f"{name} {importlib.metadata.version(name)}")
        except importlib.metadata.PackageNotFoundError:
            versions.append(f"no {name}")
    return (
        f"Measured on {_processor()}, {os.cpu_count()} cores, {platform.system()}, Python {platform.python_version()}; "
        f"rso-lidar {importlib.metadata.version('rso-lidar')}, {', '.join(versions)}."
    )


def _processor() -> str:
    """Return the processor's name as the system tells it."""
    told = Path("/proc/cpuinfo")
    if told.is_file():
        for line in told.read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def write(page: Path, part: str, findings: Findings) -> None:
    """Put what a part found between its markers, and its targets where that part's stand."""
    text = page.read_text(encoding="utf-8")
    for name, block in findings.blocks.items():
        text = _filled(text, page, name, block)
    if findings.targets:
        text = _filled(text, page, f"targets, {part}", table(HEADER, [one.row for one in findings.targets], left=2))
    page.write_text(text, encoding="utf-8")


def _markers(name: str) -> tuple[str, str]:
    return f"<!-- measured: {name} -->", f"<!-- end of {name} -->"


def _filled(text: str, page: Path, name: str, block: str) -> str:
    old = _block(text, page, name)
    begin, end = _markers(name)
    return text.replace(f"{begin}{old}{end}", f"{begin}\n\n{block.strip()}\n\n{end}")


def _block(text: str, page: Path, name: str) -> str:
    """Return what stands between the markers of a block now."""
    begin, end = _markers(name)
    if text.count(begin) != 1 or end not in text.partition(begin)[2]:
        raise SystemExit(f"{page}: needs exactly one '{begin}' and '{end}' after it")
    return text.partition(begin)[2].partition(end)[0]

"""`rso-lidar check`: checks and summary of a scenario."""

import re
import shutil
import sys
import textwrap

from rso_lidar.cli.arguments import ScenarioFile, Settings, TrustCode, TrustFmu
from rso_lidar.cli.progress import announce_compiling
from rso_lidar.cli.terminal import echo
from rso_lidar.scenario import Scenario

_WIDTH = 100  # characters of a line at most
_INDENT = 12  # of the column of texts
_AFTER_NUMBER = re.compile(r"(?<=\d) |(?<=->) | (?=->)")


def check(
    file: ScenarioFile, settings: Settings = None, trust_code: TrustCode = False, trust_fmu: TrustFmu = False
) -> None:
    """Check a scenario and print a summary.

    The verdict and the warnings come first, then orbit, geometry, optics and link budget.
    """
    scenario = Scenario.load(file, tuple(settings or ()), trust_code=trust_code, trust_fmu=trust_fmu)
    with announce_compiling():
        described = scenario.describe()
    width = min(shutil.get_terminal_size().columns, _WIDTH) if sys.stdout.isatty() else _WIDTH
    echo("\n".join(_fold(line, width) for line in described.splitlines()))


def _fold(line: str, width: int) -> str:
    """Break a line at spaces, but not between a number and its unit, and go on below its first column."""
    kept = _AFTER_NUMBER.sub("\N{NO-BREAK SPACE}", line)
    indent = " " * max(_INDENT, len(line) - len(line.lstrip()) + 2)
    lines = textwrap.fill(kept, width, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)
    return lines.replace("\N{NO-BREAK SPACE}", " ")

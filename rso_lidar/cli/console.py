"""Consoles that print tables literally, since names come from users and files."""

from collections.abc import Iterable
from typing import Any

from rich.console import Console, ConsoleOptions
from rich.segment import Segment

from rso_lidar.cli.terminal import escape_controls

_NO_END = 1000  # columns into a file or a pipe


class _Literal(Console):
    """A console that escapes control characters in all texts, also in tables, but keeps its own colours."""

    def render(self, renderable: Any, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        for segment in super().render(renderable, options):
            text = segment.text if segment.control else escape_controls(segment.text)
            yield segment if text is segment.text else Segment(text, segment.style, segment.control)


def make_console(least_width: int = 0) -> Console:
    """Make a console that prints text literally.

    Parameters
    ----------
    least_width : columns that tables need. Narrower terminals wrap lines. Files and pipes get all columns
    """
    plain = {"markup": False, "emoji": False, "highlight": False}
    console = _Literal(**plain)  # type: ignore[arg-type]
    width = max(console.width, least_width) if console.is_terminal else _NO_END
    return _Literal(width=width, **plain) if least_width else console  # type: ignore[arg-type]

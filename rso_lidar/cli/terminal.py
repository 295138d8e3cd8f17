"""Output of commands as literal text, with control characters escaped, since names come from users and files."""

import re

import typer

# Characters that move the cursor, change colours or the window's title, or reverse the order of letters: C0 but for tab and
# newline, C1, Unicode's bidirectional marks and line separators, and surrogates, which represent bytes that are no UTF-8.
_CONTROLS = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")


def escape_controls(text: str) -> str:
    r"""Escape the control characters of a text.

    >>> escape_controls("a\x1b[31mred")
    'a\\x1b[31mred'
    """
    return _CONTROLS.sub(lambda found: found[0].encode("unicode_escape").decode(), text)


def to_one_line(text: str) -> str:
    """Return a text as one printable line."""
    return escape_controls(" ".join(re.split(r"[ \t\n]+", text.strip())))


def echo(text: object = "", *, err: bool = False) -> None:
    """Print a text with its control characters escaped."""
    typer.echo(escape_controls(str(text)), err=err)  # noqa: TID251 - the one place

"""Output of commands as literal text, with control characters escaped, since names come from users and files."""

import io
import re
import sys
from typing import Any

from rso_lidar.errors import MOST_CHARACTERS

# Characters that move the cursor, change colours or the window's title, or reverse the order of letters: C0 but for tab and
# newline, C1, Unicode's bidirectional marks and line separators, characters without width but for the joiners that scripts
# need, and surrogates, which represent bytes that are no UTF-8.
_CONTROLS = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\xad\u061c\u200b\u200e\u200f\u2028-\u202e\u2060-\u206f\ufeff\ud800-\udfff]"
)
_MOST_OF_A_CLAUSE = 250  # characters of a value or a list inside a message that is too long
_CLAUSE_ENDS = re.compile("(?<=[:;?]) ")


def escape_controls(text: str) -> str:
    r"""Escape the control characters of a text.

    >>> escape_controls("a\x1b[31mred")
    'a\\x1b[31mred'
    """
    return _CONTROLS.sub(lambda match: match[0].encode("unicode_escape").decode(), text)


def to_one_line(text: str) -> str:
    r"""Return a message as one printable line of bounded length.

    >>> to_one_line("a\nb.toml: no such file; check the name\n")
    'a\\nb.toml: no such file; check the name'
    """
    line = escape_controls(text.strip()).replace("\n", "\\n").replace("\t", "\\t")
    return _shorten(line) if len(line) > MOST_CHARACTERS else line


def _shorten(line: str) -> str:
    """Shorten a message: long values and lists first, so that place, cause and cure stay; then its middle."""
    clauses = (_cut_middle(clause, _MOST_OF_A_CLAUSE) for clause in _CLAUSE_ENDS.split(line))
    return _cut_middle(" ".join(clauses), MOST_CHARACTERS)


def _cut_middle(text: str, most: int) -> str:
    """Replace the middle of a text that has more than `most` characters by the number of characters left out."""
    if len(text) <= most:
        return text
    end = most // 4
    start = most - end
    return f"{text[:start]} ... ({len(text) - start - end:,} characters left out) ... {text[-end:]}"


class _Output(io.FileIO):
    """A stream that drops what is written after its reader has gone away, such as `head`."""

    has_reader = True

    def write(self, data: Any, /) -> int:
        try:
            return super().write(data)
        except BrokenPipeError:
            self.has_reader = False
            return memoryview(data).nbytes


def outlive_readers() -> None:
    """Let commands go on without output where the reader of a pipe goes away, so that their files are complete."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None or stream is not getattr(sys, f"__{name}__"):  # closed, or a test's
            continue
        raw = _find_raw(stream)
        if type(raw) is not io.FileIO:  # a console of Windows
            continue
        is_direct = raw is stream.buffer  # python -u
        output: Any = _Output(raw.fileno(), "w", closefd=False)
        wrapper = io.TextIOWrapper(
            output if is_direct else io.BufferedWriter(output),
            stream.encoding,
            stream.errors,
            line_buffering=stream.line_buffering,
            write_through=is_direct,
        )
        setattr(sys, name, wrapper)


def has_reader() -> bool:
    """Return whether standard output is still read, as far as the last write to it tells."""
    return getattr(_find_raw(sys.stdout), "has_reader", True)


def _find_raw(stream: Any) -> Any:
    """Return the unbuffered stream below a text stream; None for one that has none."""
    buffer = getattr(stream, "buffer", None)
    return getattr(buffer, "raw", buffer)


def echo(text: object = "", *, err: bool = False) -> None:
    """Print a text with its control characters escaped."""
    import typer

    typer.echo(escape_controls(str(text)), err=err)  # noqa: TID251 - the one place

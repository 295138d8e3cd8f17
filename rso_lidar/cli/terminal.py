"""The console that tables are printed on: text stands as it is, without markup and emoji, for users name things."""

from rich.console import Console

_NO_END = 1000  # columns into a file or a pipe


def literal_console(least_width: int = 0) -> Console:
    """Return a console that prints text as it stands.

    Parameters
    ----------
    least_width : columns that tables need; narrower terminals wrap lines. A file or a pipe gets all columns.
    """
    plain = {"markup": False, "emoji": False, "highlight": False}
    console = Console(**plain)  # type: ignore[arg-type]
    width = max(console.width, least_width) if console.is_terminal else _NO_END
    return Console(width=width, **plain) if least_width else console  # type: ignore[arg-type]

"""The command line: one file per command, and one place that turns errors into a line and an exit status."""

import atexit
import gc
import io
import os
import signal
import sys
import warnings
from contextlib import suppress
from typing import Any, NamedTuple, NoReturn

from rso_lidar import interruption
from rso_lidar.cli.terminal import outlive_readers, to_one_line
from rso_lidar.errors import RsoLidarError, RsoLidarWarning, RunError
from rso_lidar.public_names import limit_dir

__all__ = ["main"]

__dir__ = limit_dir(__name__)

_INTERRUPTED = 128 + signal.SIGINT


class _Outcome(NamedTuple):
    """Exit status of a command, and its last line on standard error, if any."""

    status: int = 0
    line: str = ""
    is_hdf5_unsafe: bool = False  # after a failed write, HDF5 may crash when the interpreter exits


def main(arguments: list[str] | None = None) -> NoReturn:
    """Run the command line and exit.

    The status is 0 for success, 2 for bad input, 1 for a failed run, and 128 + n after signal n.

    Parameters
    ----------
    arguments : words of the command line, those of the process by default
    """
    _collect_garbage_less_often()
    warnings.showwarning = _show_warning
    warnings.simplefilter("always", RsoLidarWarning)
    outlive_readers()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # names may contain characters that a terminal cannot show
    interruption.set_advice(None)
    outcome = _run(arguments)
    interruption.ignore_late_signals()
    if outcome.line:
        _print_line(outcome.line)
    if outcome.is_hdf5_unsafe:
        os._exit(outcome.status)
    sys.exit(outcome.status)


def _run(arguments: list[str] | None) -> _Outcome:
    """Run one command, and turn exceptions into a status and a line."""
    from rso_lidar.cli.app import app, usage_error

    try:
        status = app(arguments, prog_name="rso-lidar", standalone_mode=False) or 0
        if status == _INTERRUPTED:
            return _Outcome(_INTERRUPTED, interruption.format_ending(signal.SIGINT))
        if sys.stdout is not None:
            sys.stdout.flush()
        return _Outcome(status)
    except usage_error as error:
        message = error.format_message().rstrip(".")
        if type(error).__name__ == "NoArgsIsHelpError":  # which typer's own copy of click names nowhere else
            _print_help(message)
            message = ""
        message = message.replace("\n\t", " ")  # how typer lists choices
        return _Outcome(2, f"error: {_add_hint(message, error)}" if message else "")
    except RunError as error:
        with suppress(OSError, ValueError, AttributeError):
            sys.stdout.flush()
        return _Outcome(1, f"error: {error}", is_hdf5_unsafe=True)
    except RsoLidarError as error:
        return _Outcome(2, f"error: {error}")
    except MemoryError as error:
        return _Outcome(1, f"error: not enough memory ({error}); use fewer pixels, rays, samples or pulses")
    except KeyboardInterrupt:
        return _Outcome(_INTERRUPTED, interruption.format_ending(signal.SIGINT))
    except OSError as error:
        if error.filename is None:
            return _Outcome(
                1, f"error: output: cannot be written ({error.strerror or error}); make room, or redirect it"
            )
        from rso_lidar.files import explain_unreadable

        return _Outcome(2, f"error: {explain_unreadable(os.fsdecode(error.filename), error)}")


def _add_hint(message: str, error: Any) -> str:
    """Add to the message of a usage error the command that prints help."""
    context = getattr(error, "ctx", None)
    command = context.command_path if context is not None else "rso-lidar"
    return f"{message}{' ' if message.endswith('?') else '; '}try '{command} --help'"


def _collect_garbage_less_often() -> None:
    """Run the garbage collector less often: it took a quarter of the time of a short command."""
    gc.set_threshold(50_000)
    atexit.register(gc.freeze)


def _print_help(text: str) -> None:
    if sys.stderr is not None:
        with suppress(OSError):  # standard error may be closed
            print(text, file=sys.stderr, flush=True)  # noqa: T201 - the command line prints


def _print_line(line: str) -> None:
    if sys.stderr is not None:
        with suppress(OSError):  # standard error may be closed
            print(to_one_line(line), file=sys.stderr, flush=True)  # noqa: T201 - the command line prints


_shown: set[str] = set()


def _show_warning(message: Warning | str, category: type[Warning], *_place: Any, **_more: Any) -> None:
    """Print a warning in one line, each text once; a replacement of `warnings.showwarning`."""
    # Libraries break the lines of their warnings.
    line = (
        str(message)
        if issubclass(category, RsoLidarWarning)
        else f"{category.__name__}: {' '.join(str(message).split())}"
    )
    if line not in _shown:
        _shown.add(line)
        _print_line(f"warning: {line}")

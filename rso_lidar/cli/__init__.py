"""The command line: one file for each command, and one place where errors become a line and an exit status."""

import atexit
import gc
import os
import sys
import warnings
from contextlib import suppress
from typing import Any, NoReturn

from rso_lidar.errors import RsoLidarError, RsoLidarWarning, RunError

_INTERRUPTED = 130
_GO_ON = "interrupted: a run that had begun goes on with --resume and the same options"


def main(arguments: list[str] | None = None) -> NoReturn:
    """Run the command line and leave: status 0 good, 2 bad input, 1 a run that failed, 130 interrupted."""
    _collect_seldom()
    from rso_lidar.cli.app import app, usage_error

    warnings.showwarning = _show_warning
    warnings.simplefilter("always", RsoLidarWarning)
    try:
        status = app(arguments, prog_name="rso-lidar", standalone_mode=False)
        if status == _INTERRUPTED:
            _say(_GO_ON)
        sys.exit(status)
    except usage_error as error:
        if error.format_message():  # without any words the help has been shown, and says enough
            _say(f"error: {_with_hint(error.format_message().rstrip('.'), error)}")
        sys.exit(2)
    except RunError as error:
        # After a write that failed, HDF5 may crash while the interpreter cleans up: leave at once, all said.
        _say(f"error: {error}")
        sys.stdout.flush()
        os._exit(1)
    except RsoLidarError as error:
        _say(f"error: {error}")
        sys.exit(2)
    except MemoryError as error:
        _say(f"error: there is not enough memory ({error}); take fewer pixels, rays, samples or pulses")
        sys.exit(1)
    except KeyboardInterrupt:
        _say(_GO_ON)
        sys.exit(_INTERRUPTED)
    except BrokenPipeError:  # the reader of our output went away, as `head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(0)
    except OSError as error:
        _say(f"error: output: cannot be written ({error.strerror or error}); make room, or send it elsewhere")
        sys.exit(1)


def _with_hint(message: str, error: Any) -> str:
    """Return the message of a usage error with the command whose help tells more."""
    context = getattr(error, "ctx", None)
    command = context.command_path if context is not None else "rso-lidar"
    return f"{message}{' ' if message.endswith('?') else '; '}try '{command} --help'"


def _collect_seldom() -> None:
    """Let the search for circles among objects run seldom: a quarter of a short command went there, to find none."""
    gc.set_threshold(50_000)
    atexit.register(gc.freeze)


def _say(line: str) -> None:
    if sys.stderr is not None:
        with suppress(OSError):  # nobody may be listening
            print(" ".join(line.split()), file=sys.stderr, flush=True)  # noqa: T201 - what a command line is for


_shown: set[str] = set()


def _show_warning(message: Warning | str, category: type[Warning], *_place: Any, **_more: Any) -> None:
    line = str(message) if issubclass(category, RsoLidarWarning) else f"{category.__name__}: {message}"
    if line not in _shown:
        _shown.add(line)
        _say(f"warning: {line}")

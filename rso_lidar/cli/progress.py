"""Progress of a run: a bar on a terminal, lines elsewhere."""

import os
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from typing import Any, Protocol

from rso_lidar.cli.terminal import echo
from rso_lidar.interruption import remove_on_signal
from rso_lidar.kernels import watch_compiling
from rso_lidar.records import Frame

_LOG_EVERY_S = 5.0
_LEAST_S = 1.0  # of work, before a rate is stated
_BELOW_THE_BAR = b"\n\x1b[?25h"  # the next line, and the cursor that the bar hides


class Bar(Protocol):
    """A display of progress."""

    def advance(self) -> None:
        """Count one frame."""


@contextmanager
def show_progress(total: int, done: int, doing: str = "flying", of: str = "frame") -> Iterator[Bar]:
    """Show a bar with rate and time left on a terminal, or plain lines elsewhere."""
    if sys.stderr is None or not sys.stderr.isatty():
        yield _Lines(total, done, of)
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns: list[Any] = [TextColumn(doing), BarColumn(), MofNCompleteColumn(), TextColumn("{task.fields[rate]}")]
    bar = Progress(*columns, TimeRemainingColumn(), console=Console(stderr=True))
    with bar as shown, remove_on_signal(lambda: os.write(2, _BELOW_THE_BAR)):
        task = shown.add_task("frames", total=total, completed=done, rate="")
        pace = Pace()

        class _Rich:
            def advance(self) -> None:
                rate = pace.count()
                shown.update(task, advance=1, rate="" if rate is None else f"{format_rate(rate)} {of}s/s")

        yield _Rich()


def announce_compiling() -> AbstractContextManager[None]:
    """Print the progress of numba's compilation within this context; it takes longer than most commands."""
    last_s = time.monotonic()

    def tell(count: int) -> None:
        nonlocal last_s
        if count == 1:
            echo("compiling    once for each installation: some 15 s", err=True)
        elif time.monotonic() >= last_s + _LOG_EVERY_S:
            echo(f"compiling    inner loop {count}", err=True)
        else:
            return
        last_s = time.monotonic()

    return watch_compiling(tell)


def count_frames(frames: Sequence[Frame], doing: str) -> Iterator[Frame]:
    """Yield frames and count them on a bar."""
    with show_progress(len(frames), 0, doing) as bar:
        for frame in frames:
            yield frame
            bar.advance()


@contextmanager
def count_steps(doing: str, of: str) -> Iterator[Callable[[int, int], None]]:
    """Yield a function that shows finished steps on a bar; it is called with their number and that of all, 0 for no bar."""
    with ExitStack() as stack:
        bar: Bar | None = None
        shown = 0

        def step(done: int, total: int) -> None:
            nonlocal bar, shown
            if bar is None and total:
                bar = stack.enter_context(show_progress(total, done, doing, of))
                shown = done
            while bar is not None and shown < done:
                bar.advance()
                shown += 1

        yield step


class Pace:
    """Rate of steps, without the first step, whose time includes compilation and one-time work."""

    def __init__(self) -> None:
        self._began_s = 0.0
        self._count = 0

    def count(self) -> float | None:
        """Count one step, and return the rate [1/s]; None until a second of work after the first step is measured."""
        now_s = time.monotonic()
        self._count += 1
        if self._count == 1:
            self._began_s = now_s
        worked_s = now_s - self._began_s
        return (self._count - 1) / worked_s if worked_s >= _LEAST_S else None


def format_rate(rate: float) -> str:
    """Return a rate with three significant digits and without an exponent."""
    return f"{float(f'{rate:.3g}'):.15g}"


class _Lines:
    def __init__(self, total: int, done: int, of: str) -> None:
        """Prepare lines of progress."""
        self._total, self._done, self._of = total, done, of
        self._said = time.monotonic()
        self._pace = Pace()

    def advance(self) -> None:
        self._done += 1
        rate, now, is_last = self._pace.count(), time.monotonic(), self._done >= self._total
        if not is_last and (rate is None or now - self._said < _LOG_EVERY_S):
            return
        self._said = now
        line = f"{self._of} {self._done}/{self._total}"
        if rate is not None:
            line += f", {format_rate(rate)} {self._of}s/s"
            line += "" if is_last else f", {(self._total - self._done) / rate:.0f} s left"
        with suppress(OSError, AttributeError):  # standard error may be closed
            echo(line, err=True)

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
        pace = _Pace()

        class _Rich:
            def advance(self) -> None:
                shown.update(task, advance=1, rate=f"{pace.count():.1f} {of}s/s")

        yield _Rich()


def announce_compiling() -> AbstractContextManager[None]:
    """Print the progress of numba's compilation within this context; it takes longer than most commands."""
    last_s = time.monotonic()

    def tell(count: int, most: int) -> None:
        nonlocal last_s
        if count == 1:
            echo("compiling    once for each installation: some 15 s", err=True)
        elif time.monotonic() >= last_s + _LOG_EVERY_S:
            echo(f"compiling    inner loop {count} of some {most}", err=True)
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


class _Pace:
    """Rate of frames, without the first frame, whose time includes compilation and one-time work."""

    def __init__(self) -> None:
        self._began = time.monotonic()
        self._count = 0

    @property
    def first(self) -> bool:
        """Whether at most one frame has been counted."""
        return self._count < 2

    def count(self) -> float:
        """Count one frame, and return the rate [frames/s]."""
        now = time.monotonic()
        self._count += 1
        if self._count == 1:
            waited, self._began = now - self._began, now
            return 1.0 / max(waited, 1e-9)
        return (self._count - 1) / max(now - self._began, 1e-9)


class _Lines:
    def __init__(self, total: int, done: int, of: str) -> None:
        """Prepare lines of progress."""
        self._total, self._done, self._of = total, done, of
        self._said = time.monotonic()
        self._pace = _Pace()

    def advance(self) -> None:
        self._done += 1
        rate, now = self._pace.count(), time.monotonic()
        if now - self._said < _LOG_EVERY_S and self._done < self._total:
            return
        if self._pace.first and self._done < self._total:
            return  # one frame tells no pace
        self._said = now
        left = (self._total - self._done) / rate
        with suppress(OSError, AttributeError):  # standard error may be closed
            echo(f"{self._of} {self._done}/{self._total}, {rate:.1f} {self._of}s/s, {left:.0f} s left", err=True)

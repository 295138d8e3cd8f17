"""The base of live views: a short queue of frames, and a thread that shows them.

Where that thread or a viewer is too slow, frames are left out and the simulation does not wait.
"""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from collections import deque
from typing import Self

from rso_lidar.errors import warn
from rso_lidar.records import Frame

_BACKLOG = 4  # frames that wait for the thread
_ENDS_S = 5.0  # time for the frames that still wait at the end


class QueuedView(ABC):
    """A live view whose frames wait in a short queue; a context manager."""

    def __init__(self) -> None:
        self._waiting: deque[Frame] = deque()
        self._changed = threading.Condition()
        self._is_busy = self._is_closed = False
        self._dropped = self._shown = 0
        self._thread = threading.Thread(target=self._publish_all, name="live view", daemon=True)

    @property
    @abstractmethod
    def url(self) -> str:
        """Address for the viewer."""

    @abstractmethod
    def _publish(self, frame: Frame) -> None:
        """Show one frame; called by the thread."""

    @abstractmethod
    def _stop(self) -> None:
        """Release what the view holds."""

    def _start(self) -> None:
        """Start the thread, when the view is ready."""
        self._thread.start()

    @property
    def shown(self) -> int:
        """Number of frames that were handed to the viewers."""
        return self._shown

    @property
    def dropped(self) -> int:
        """Number of frames that were left out because newer ones came first."""
        return self._dropped

    def show(self, frame: Frame) -> None:
        """Show a frame; never waits for a viewer.

        Parameters
        ----------
        frame : the next frame. If too many wait, the oldest of them is dropped
        """
        with self._changed:
            if self._is_closed:
                return
            if len(self._waiting) >= _BACKLOG:
                self._waiting.popleft()
                self._dropped += 1
            self._waiting.append(frame)
            self._changed.notify_all()

    def close(self) -> None:
        """Show the frames that wait, for a few seconds at most, and end the view."""
        with self._changed:
            if self._is_closed:
                return
            self._changed.wait_for(lambda: not self._waiting and not self._is_busy, timeout=_ENDS_S)
            self._is_closed = True
            self._dropped += len(self._waiting)
            self._waiting.clear()
            self._changed.notify_all()
        self._thread.join(timeout=_ENDS_S)
        self._stop()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def _publish_all(self) -> None:
        """Publish frames until the view is closed; the work of the thread."""
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._waiting or self._is_closed)
                if self._is_closed:
                    return
                frame, self._is_busy = self._waiting.popleft(), True
            try:
                self._publish(frame)
            except Exception as error:  # a view that fails must not end the run that it shows
                warn(f"live view: frame {frame.index} could not be shown ({' '.join(str(error).split()):.120})")
            finally:
                with self._changed:
                    self._is_busy = False
                    self._shown += 1
                    self._changed.notify_all()

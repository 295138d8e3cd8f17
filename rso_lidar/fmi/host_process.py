"""The process of an FMU, seen from the one that asks: requests with a time limit, and errors in one line."""

from __future__ import annotations

import importlib.util
import pickle
import queue
import shutil
import subprocess
import sys
import tempfile
import threading
import weakref
from contextlib import suppress
from pathlib import Path
from typing import Any

from rso_lidar.errors import ScenarioError
from rso_lidar.fmi import host

ANSWER_S = 120.0  # longest time of a request; a step of an FMU takes microseconds to milliseconds


class HostProcess:
    """A process that runs one FMU, from its first request until nobody holds this object.

    Parameters
    ----------
    path : of the FMU

    Raises
    ------
    ScenarioError
        If fmpy is not installed, the process cannot be started, or the file is not an FMU for this machine
    """

    def __init__(self, path: Path) -> None:
        if importlib.util.find_spec("fmpy") is None:
            raise ScenarioError(f"{path.name}: an FMU needs fmpy; install it with: pip install rso-lidar[fmi]")
        self.name = path.name
        folder = tempfile.mkdtemp(prefix="rso_lidar_fmu_")
        command = [sys.executable, str(Path(host.__file__)), folder]
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
        )
        weakref.finalize(self, _end, self._process, folder)
        self._answers: queue.Queue[tuple[str, Any] | None] = queue.Queue()
        threading.Thread(target=_read_answers, args=(self._process.stdout, self._answers), daemon=True).start()
        self.description: dict[str, Any] = self.ask("describe", str(path.resolve()))

    def ask(self, name: str, *given: Any) -> Any:
        """Make a request and wait for its answer.

        Parameters
        ----------
        name : of a method of `host.Host`
        given : its arguments

        Returns
        -------
        what the method returned

        Raises
        ------
        ScenarioError
            If the FMU fails, ends its process, or does not answer in time. The process has then ended.
        """
        assert self._process.stdin is not None
        try:
            pickle.dump((name, *given), self._process.stdin)
            self._process.stdin.flush()
            answer = self._answers.get(timeout=ANSWER_S)
        except queue.Empty:
            self._process.kill()
            raise ScenarioError(
                f"{self.name}: the FMU has not answered for {ANSWER_S:g} s and was ended; check it in another tool"
            ) from None
        except OSError:
            answer = None
        if answer is None:
            status = self._process.wait()
            raise ScenarioError(
                f"{self.name}: the FMU has ended its process with status {status}, as after a crash; check it in another "
                "tool"
            )
        kind, result = answer
        if kind == "error":
            raise ScenarioError(f"{self.name}: {result}; correct the FMU or its settings")
        return result


def _read_answers(stream: Any, answers: queue.Queue[tuple[str, Any] | None]) -> None:
    """Read answers until the stream ends, which is the last answer: None."""
    with stream:
        try:
            while True:
                answers.put(pickle.load(stream))
        except Exception:  # the process has ended, in an answer or between two
            answers.put(None)


def _end(process: subprocess.Popen[bytes], folder: str) -> None:
    """End a process that runs an FMU, and remove the folder of its files."""
    if process.stdin is not None:
        with suppress(OSError):
            process.stdin.close()
    try:
        process.wait(timeout=2.0)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    shutil.rmtree(folder, ignore_errors=True)

"""Deadlines of steps on the wall clock: when a reply is due, what happens where it is late, and the report at the end."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import ClassVar, Literal

import numpy as np

from rso_lidar.errors import RunError, ScenarioError
from rso_lidar.units import NS_PER_S

Policy = Literal["slip", "skip", "fail"]


class Deadlines:
    """Deadlines of the wall clock for the steps of a simulation.

    The first reply after a reset starts the clock. The reply of a step to simulated time t is due t / `factor` later.
    A reply that is ready before is held until then. A reply that is ready later has missed its deadline: ``slip``
    moves all later deadlines by the delay, ``skip`` keeps them and leaves out flashes whose deadlines have passed before
    they begin, and ``fail`` ends the run. `POLICIES` are these.

    Parameters
    ----------
    factor : simulated time over wall-clock time
    policy : at a missed deadline
    clock : monotonic time [s]
    """

    POLICIES: ClassVar[tuple[Policy, ...]] = ("slip", "skip", "fail")

    def __init__(self, factor: float, policy: Policy = "slip", clock: Callable[[], float] = time.monotonic) -> None:
        if not 1e-6 <= factor <= 1e6:
            raise ScenarioError(
                f"--real-time {factor:g}: is no factor of real time; give one from 1e-6 to 1e6, such as 1"
            )
        if policy not in self.POLICIES:
            raise ScenarioError(f"--late {policy}: is not {', '.join(self.POLICIES)}")
        self.factor, self.policy, self._clock = factor, policy, clock
        self._origin: tuple[float, int] | None = None  # clock [s] and simulated time [ns]
        self._late_s: list[float] = []
        self.skipped = self._replies = self._asked_late = 0
        self._simulated_s = self._elapsed_s = self._worked_s = 0.0
        self._last: tuple[float, int] | None = None

    @property
    def overruns(self) -> int:
        """Number of deadlines that were missed."""
        return len(self._late_s)

    def begin(self) -> None:
        """Start the clock anew with the next reply, as after a reset."""
        self._origin = self._last = None

    def has_passed(self, time_ns: int) -> bool:
        """Return whether the policy leaves out late flashes and the deadline of one has passed.

        Parameters
        ----------
        time_ns : time of the flash [ns]
        """
        return self.policy == "skip" and self._origin is not None and self._clock() > self._deadline_s(time_ns)

    def _deadline_s(self, time_ns: int) -> float:
        assert self._origin is not None
        return self._origin[0] + (time_ns - self._origin[1]) / NS_PER_S / self.factor

    def time_reply(self, time_ns: int, asked_s: float, *, skipped: bool = False) -> float:
        """Count a reply that is ready, and find when it is due.

        Parameters
        ----------
        time_ns : simulated time of the reply [ns]
        asked_s : when its request arrived on the clock [s]
        skipped : whether its flash was left out

        Returns
        -------
        instant on the clock at which the reply is to be sent [s].

        Raises
        ------
        RunError
            If the deadline was missed, and the policy is ``fail``.
        """
        now_s = self._clock()
        if self._origin is None:
            self._origin = self._last = (now_s, time_ns)
            return now_s
        due_s = self._deadline_s(time_ns)
        late_s = now_s - due_s
        self._replies += 1
        self.skipped += skipped
        self._worked_s += now_s - asked_s
        assert self._last is not None
        self._simulated_s += (time_ns - self._last[1]) / NS_PER_S
        self._elapsed_s += max(now_s, due_s) - self._last[0]
        self._last = (max(now_s, due_s), time_ns)
        if late_s <= 0.0:
            return due_s
        self._late_s.append(late_s)
        self._asked_late += asked_s > due_s
        if self.policy == "fail":
            raise RunError(
                f"--real-time {self.factor:g}: the step to {time_ns / NS_PER_S:g} s was ready {late_s * 1e3:.3g} ms after "
                "its deadline; lower the factor or the frame rate, or allow --late slip"
            )
        if self.policy == "slip":
            self._origin = (now_s, time_ns)
        return now_s

    def report(self) -> list[str]:
        """Return the lines of the report: factor achieved, load, and how late replies were."""
        if not self._replies:
            return [f"real time   {self.factor:g} asked for; no step was paced"]
        achieved = self._simulated_s / max(self._elapsed_s, 1e-9)
        share = self._worked_s * self.factor / max(self._simulated_s, 1e-9)
        lines = [
            f"real time   {self.factor:g} asked for, {achieved:.4g} achieved; a step takes {share:.1%} of its time"
        ]
        text = f"overruns    {self.overruns} of {self._replies} deadlines missed ({self.overruns / self._replies:.2%})"
        if self._late_s:
            late_ms = 1e3 * np.array(self._late_s)
            text += f", by {np.median(late_ms):.3g} ms (median) and {late_ms.max():.3g} ms (worst)"
            text += f"; at {self._asked_late} of them the request came after the deadline"
        lines.append(text)
        if self.skipped:
            lines.append(f"skipped     {self.skipped} flashes were left out")
        return lines

"""Integration over a short stretch: explicit Runge-Kutta steps that cost little to start.

The pair of Dormand and Prince, of orders 5 and 4 (J. Comput. Appl. Math. 6, 1980), with the dense output of Shampine
(Math. Comp. 46, 1986), as in scipy's RK45. The first step has a fixed length, and each next one is twice as long. From the
first step with too large an error estimate on, `OdeSolution` takes over.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np

from rso_lidar.orbit.propagation.integrator import Derivative, OdeSolution

FIRST_STEP_S = 0.02  # two control cycles of 10 ms


class _Step(NamedTuple):
    """One accepted step: its start and length [s], the state (n,) at the start, and the dense output (n, 4)."""

    begin_s: float
    length_s: float
    state: np.ndarray
    slopes: np.ndarray


class ShortSolution:
    """x(t) of x' = f(t, x) for t >= 0 with x(0) given; x at an instant does not depend on other requested instants.

    Parameters
    ----------
    f : ``f(t, x (n,)) -> (n,)`` with t in seconds from the start. It may fail; `OdeSolution` then finds out where.
    x0 : (n,) state at t = 0.
    panel_s : longest step, and length of the panels of `OdeSolution` [s].
    rtol, atol : tolerances of a step, relative and absolute.
    name : what errors call the integration.
    """

    def __init__(self, f: Derivative, x0: np.ndarray, *, panel_s: float, rtol: float, atol: float, name: str) -> None:
        self._f, self._panel_s, self._name, self._rtol, self._atol = f, panel_s, name, rtol, atol
        self._end_s, self._x, self._next_s = 0.0, np.asarray(x0, dtype=float), FIRST_STEP_S
        self._rate: np.ndarray | None = None
        self._steps: list[_Step] = []
        self._rest: OdeSolution | None = None

    def __call__(self, time_s: np.ndarray) -> np.ndarray:
        """Return x (time, n) at `time_s` (time,) >= 0 [s]."""
        times = np.asarray(time_s, dtype=float)
        latest = float(times[-1]) if len(times) == 1 else float(times.max(initial=0.0))
        while self._rest is None and self._end_s < latest:
            self._advance()
        if len(times) == 1:
            return self._at(latest)[None]
        return np.array([self._at(one) for one in times.tolist()]).reshape(len(times), len(self._x))

    def _at(self, time_s: float) -> np.ndarray:
        """Evaluate x (n,) at one instant that has been reached."""
        if time_s > self._end_s or not self._steps:
            if self._rest is None:
                return self._x
            beyond: np.ndarray = self._rest(np.array([time_s - self._end_s]))[0]
            return beyond
        begin_s, length_s, state, slopes = next(step for step in reversed(self._steps) if step.begin_s <= time_s)
        part = (time_s - begin_s) / length_s
        value: np.ndarray = state + length_s * np.dot(slopes, (part, part**2, part**3, part**4))
        return value

    def _advance(self) -> None:
        """Make one step, or hand over to `OdeSolution` where its error is too large or f fails."""
        length = min(self._next_s, self._panel_s)
        try:
            with np.errstate(all="ignore"):
                made = self._try_step(length)
        except Exception:  # raised again by OdeSolution, which finds how far f can be followed
            made = None
        if made is None:
            begin_s = self._end_s
            self._rest = OdeSolution(
                lambda t, x: self._f(t + begin_s, x),
                self._x,
                panel_s=self._panel_s,
                rtol=self._rtol,
                atol=self._atol,
                name=self._name,
            )
            return
        slopes, self._x, self._rate = made[0], made[1], made[2]
        self._steps.append(_Step(self._end_s, length, made[3], slopes))
        self._end_s, self._next_s = self._end_s + length, 2.0 * self._next_s

    def _try_step(self, length: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray] | None:
        """Try a step of a length [s].

        Returns
        -------
        dense output (n, 4), state (n,) and rate (n,) at the end, and state at the start; None if the error is too large.
        """
        stages, nodes, weights, errors, dense = _tableau()
        f, t, x = self._f, self._end_s, self._x
        rates = np.empty((7, len(x)))
        rates[0] = f(t, x) if self._rate is None else self._rate
        for number in range(1, 6):
            rates[number] = f(t + nodes[number] * length, x + length * np.dot(stages[number], rates[:number]))
        end = x + length * np.dot(weights, rates[:6])
        rates[6] = f(t + length, end)
        scale = self._atol + self._rtol * np.maximum(np.abs(x), np.abs(end))
        miss = length * np.dot(errors, rates) / scale
        if not np.dot(miss, miss) <= len(x):  # root mean square over 1, or not a number
            return None
        return np.dot(rates.T, dense), end, rates[6].copy(), x


@functools.cache
def _tableau() -> tuple[list[np.ndarray], list[float], np.ndarray, np.ndarray, np.ndarray]:
    """Return the coefficients of scipy's RK45: stages, nodes, weights, of the error, and of the dense output."""
    from scipy.integrate import RK45

    return [RK45.A[number, :number].copy() for number in range(6)], RK45.C.tolist(), RK45.B, RK45.E, RK45.P

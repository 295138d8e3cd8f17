"""Integration over a short stretch: explicit Runge-Kutta steps that cost little to start.

The pair of Dormand and Prince, of orders 5 and 4 (J. Comput. Appl. Math. 6, 1980), with the dense output of Shampine
(Math. Comp. 46, 1986), as in scipy's RK45. The first step has a fixed length, and each next one is twice as long. From the
first step with too large an error estimate on, `OdeSolution` takes over.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from rso_lidar.kernels import kernel, packed
from rso_lidar.orbit import OdeSolution

FIRST_STEP_S = 0.02  # two control cycles of 10 ms


class _Step(NamedTuple):
    """One accepted step: its start and length [s], the state (n,) at the start, and the dense output (n, 4)."""

    begin_s: float
    length_s: float
    state: np.ndarray
    slopes: np.ndarray


class ShortSolution:
    """x(t) of x' = f(t, x, u) from a start on; x at an instant does not depend on other requested instants.

    Parameters
    ----------
    f : ``f(t, x (n,), u) -> (n,)`` with t in seconds. It may fail; `OdeSolution` then finds out where
    begin_s : t at the start [s]
    x0 : (n,) state at the start
    inputs : u, constant
    panel_s : longest step, and length of the panels of `OdeSolution` [s]
    rtol, atol : tolerances of a step, relative and absolute
    name : what errors call the integration
    """

    def __init__(
        self,
        f: Callable[[float, np.ndarray, np.ndarray], np.ndarray],
        begin_s: float,
        x0: np.ndarray,
        inputs: np.ndarray,
        *,
        panel_s: float,
        rtol: float,
        atol: float,
        name: str,
    ) -> None:
        self._f, self._begin_s, self._inputs = f, begin_s, inputs
        self._panel_s, self._name, self._rtol, self._atol = panel_s, name, rtol, atol
        self._end_s, self._x, self._next_s = 0.0, np.array(x0, dtype=float), FIRST_STEP_S
        self._rate: np.ndarray | None = None
        self._steps: list[_Step] = []
        self._rest: OdeSolution | None = None

    def __call__(self, time_s: np.ndarray) -> np.ndarray:
        """Return x (time, n) at `time_s` (time,) >= 0 after the start [s]."""
        times = np.asarray(time_s, dtype=float)
        latest = float(times[-1]) if len(times) == 1 else float(times.max(initial=0.0))
        while self._rest is None and self._end_s < latest:
            self._advance()
        if len(times) == 1:
            return self._at(latest)[None]
        return np.array([self._at(at_s) for at_s in times.tolist()]).reshape(len(times), len(self._x))

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
            step = self._try_step(length)
        except Exception:  # raised again by OdeSolution, which finds how far f can be followed
            step = None
        if step is None:
            begin_s = self._begin_s + self._end_s
            self._rest = OdeSolution(
                lambda t, x: self._f(t + begin_s, x, self._inputs),
                self._x,
                panel_s=self._panel_s,
                rtol=self._rtol,
                atol=self._atol,
                name=self._name,
            )
            return
        slopes, self._x, self._rate = step[0], step[1], step[2]
        self._steps.append(_Step(self._end_s, length, step[3], slopes))
        self._end_s, self._next_s = self._end_s + length, 2.0 * self._next_s

    def _try_step(self, length: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray] | None:
        """Try a step of a length [s].

        Returns
        -------
        dense output (n, 4), state (n,) and rate (n,) at the end, and state at the start; None if the error is too large
        """
        stages, nodes, errors, dense = _tableau()
        f, t, x, u = self._f, self._begin_s + self._end_s, self._x, self._inputs
        rates = np.empty((7, len(x)))
        rates[0] = f(t, x, u) if self._rate is None else self._rate
        for number in range(1, 7):
            end = extrapolate(x, rates, stages[number], length)
            rates[number] = f(t + nodes[number] * length, end, u)
        slopes = np.empty((len(x), 4))
        if not find_slopes(x, end, rates, errors, dense, (length, self._atol, self._rtol), slopes) <= len(x):
            return None  # root mean square over 1, or not a number
        return slopes, end, rates[6].copy(), x


@functools.cache
def _tableau() -> tuple[list[np.ndarray], list[float], np.ndarray, np.ndarray]:
    """Return the coefficients of scipy's RK45: stages with the end last, nodes, of the error, and of the dense output."""
    from scipy.integrate import RK45

    stages = [packed(RK45.A[number, :number]) for number in range(6)]
    return [*stages, packed(RK45.B)], [*RK45.C.tolist(), 1.0], packed(RK45.E), packed(RK45.P)


@kernel
def extrapolate(x: np.ndarray, rates: np.ndarray, weights: np.ndarray, length: float) -> np.ndarray:
    """Return x + length * the sum of weights * rates.

    Parameters
    ----------
    x : (n,) state
    rates : (7, n) of the stages
    weights : (stage) of the first stages
    length : of the step [s]
    """
    end = np.empty(len(x))
    for entry in range(len(x)):
        total = 0.0
        for stage in range(len(weights)):
            total += weights[stage] * rates[stage, entry]
        end[entry] = x[entry] + length * total
    return end


@kernel
def find_slopes(
    x: np.ndarray,
    end: np.ndarray,
    rates: np.ndarray,
    errors: np.ndarray,
    dense: np.ndarray,
    limits: tuple[float, float, float],
    slopes: np.ndarray,
) -> float:
    """Write the dense output of a step, and return the sum of the squares of its errors over their tolerances.

    Parameters
    ----------
    x, end : (n,) states at the start and the end
    rates : (7, n) of the stages
    errors, dense : (7) and (7, 4) weights of the stages
    limits : length of the step [s], and the absolute and the relative tolerance
    slopes : (n, 4), written
    """
    length, absolute, relative = limits
    squared = 0.0
    for entry in range(len(x)):
        miss = 0.0
        for stage in range(7):
            miss += errors[stage] * rates[stage, entry]
        miss *= length / (absolute + relative * max(abs(x[entry]), abs(end[entry])))
        squared += miss * miss
        for power in range(4):
            slope = 0.0
            for stage in range(7):
                slope += rates[stage, entry] * dense[stage, power]
            slopes[entry, power] = slope
    return squared

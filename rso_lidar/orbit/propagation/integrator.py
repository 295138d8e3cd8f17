"""Integration of ordinary differential equations whose result at an instant does not depend on other requested instants.

DOP853 (Hairer, Norsett & Wanner, Solving ODEs I, sec. II.5; scipy's implementation) with its dense output. It runs in
panels of fixed length from t = 0, forward and backward, as far as requested. Completed steps are kept; panels end
where the right-hand side is not smooth.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Sequence
from operator import itemgetter
from threading import RLock
from typing import Any

import numpy as np

from rso_lidar.errors import PropagationError

Derivative = Callable[[float, np.ndarray], np.ndarray]
Jump = tuple[float, Callable[[np.ndarray], np.ndarray]]
Phase = Callable[[float, np.ndarray], Hashable]
_MOST_STEPS = 200_000  # some 400 days of a low orbit, half a gigabyte
_NEAR_S = 1e-9  # breaks closer together than this count as one
_EDGE_S = 1e-6  # a change of phase this close to the end of a step is at its end
_LOOKS = 4  # instants in a step at which its phase is read


class OdeSolution:
    """x(t) of x' = f(t, x) with x(0) given, at any instants.

    Where f fails in a step that reaches beyond the last requested instant, a shorter step up to that instant is made.
    Only at this edge of the domain of f do the bits depend on the last requested instant.

    Parameters
    ----------
    f : ``f(t, x (n,)) -> (n,)`` with t in seconds from the start
    x0 : (n,) state at t = 0
    panel_s : length of a panel [s], in which the step size may grow

    Other Parameters
    ----------------
    rtol, atol : tolerances of a step, relative and absolute (one number, or one for each entry of x)
    jumps : ``(time_s, jump)`` at which x becomes ``jump(x)``; time_s > 0
    breaks : further instants [s] at which f is not smooth, such as the start of a burn
    phase : ``phase(t, x (n,))`` is a value that changes where f is not smooth, such as at the edge of a shadow; a step
        ends at each change. The estimate of a step's error can miss such an edge by chance
    name : what errors call the integration
    """

    def __init__(
        self,
        f: Derivative,
        x0: np.ndarray,
        *,
        panel_s: float,
        rtol: float = 1e-13,
        atol: float | np.ndarray = 1e-9,
        jumps: Sequence[Jump] = (),
        breaks: Sequence[float] = (),
        phase: Phase | None = None,
        name: str = "integration",
    ) -> None:
        x0 = np.array(x0, dtype=float)
        breaks = sorted({*(at for at, _ in jumps), *breaks})
        shared = (f, x0, panel_s, {"rtol": rtol, "atol": atol}, sorted(jumps, key=itemgetter(0)), breaks, phase, name)
        self._ways = {way: _Direction(way, *shared) for way in (1, -1)}
        self._n = len(x0)
        self._lock = RLock()

    def __call__(self, time_s: np.ndarray) -> np.ndarray:
        """Return x (time, n) at `time_s` (time,) [s]; at a jump, the state after it."""
        times = np.atleast_1d(np.asarray(time_s, dtype=float))
        values = np.empty((len(times), self._n))
        with self._lock:
            for way, of in ((1, times >= 0.0), (-1, times < 0.0)):
                rows = np.flatnonzero(of)
                if len(rows):
                    values[rows] = self._ways[way].at(times[rows], times)
        return values


class _Direction:
    """One direction from t = 0: the steps completed so far, and the solver that makes the next."""

    def __init__(
        self,
        way: int,
        f: Derivative,
        x0: np.ndarray,
        panel_s: float,
        tolerances: dict[str, Any],
        jumps: Sequence[Jump],
        breaks: Sequence[float],
        phase: Phase | None,
        name: str,
    ) -> None:
        """Start at t = 0.

        Parameters
        ----------
        way : 1 forward, -1 backward
        tolerances : relative and absolute tolerance of DOP853
        """
        self._way, self._f, self._panel_s, self._tolerances, self._name = way, f, panel_s, tolerances, name
        self._jumps, self._phase = jumps if way == 1 else (), phase
        self._breaks = [way * at for at in breaks]
        self._ends, self._steps = (
            [0.0],
            list[Any](),
        )  # ends of the steps, positive in this direction, and their polynomials
        self._solver: Any = None
        self._x = x0

    def at(self, times: np.ndarray, requested: np.ndarray) -> np.ndarray:
        """Return x (time, n) at instants [s] of this direction; `requested` holds all, for the mask of an error."""
        until = float(np.max(self._way * times))
        beyond = self._reach(until, requested)
        # an instant on an edge belongs to the step that begins there, after a jump
        step = np.searchsorted(self._ends, self._way * times, side="right") - 1
        values = np.empty((len(times), len(self._x)))
        for number in np.unique(step):
            rows = step == number
            polynomial = self._steps[number] if number < len(self._steps) else beyond
            values[rows] = polynomial(times[rows]).T
        return values

    def _reach(self, until: float, requested: np.ndarray) -> Any:
        """Make steps until one ends beyond `until`, or return a shorter piece up to there where f has no value beyond."""
        from scipy.integrate import DOP853, solve_ivp

        while self._ends[-1] <= until:
            begin = self._ends[-1]
            if len(self._steps) >= _MOST_STEPS:
                raise PropagationError(
                    f"{self._name}: {_MOST_STEPS:,} steps of integration reach {self._way * begin:g} s of the "
                    f"{self._way * until:g} s requested; shorten the run, or smooth the dynamics",
                    self._way * requested > begin,
                )
            x = self._x if self._solver is None else self._solver.y
            try:
                if self._solver is None:
                    bound = self._way * self._find_panel_end(begin)
                    self._solver = DOP853(self._f, self._way * begin, x, bound, **self._tolerances)
                message = self._solver.step()
            except Exception:
                self._solver = None
                self._x = x
                if begin >= until:
                    raise
                tail = solve_ivp(
                    self._f,
                    (self._way * begin, self._way * until),
                    x,
                    "DOP853",
                    dense_output=True,
                    **self._tolerances,
                )
                return tail.sol
            if self._solver.status == "failed" or not np.all(np.isfinite(self._solver.y)):
                self._solver = None
                raise PropagationError(
                    f"{self._name}: the integration breaks down {self._way * begin:g} s from its start "
                    f"({(message or 'infinite').rstrip('.')}); check state and dynamics, or shorten the run",
                    self._way * requested > begin,
                )
            interpolant = self._solver.dense_output()
            edge = self._find_edge(interpolant, begin, self._way * self._solver.t)
            if edge is not None:  # make the step again, up to there
                self._solver = DOP853(self._f, self._way * begin, x, self._way * edge, **self._tolerances)
                continue
            self._steps.append(interpolant)
            self._ends.append(self._way * self._solver.t)
            if self._solver.status == "finished":
                self._x, self._solver = self._apply_jumps(self._solver.y), None
        return None

    def _find_edge(self, interpolant: Any, begin: float, end: float) -> float | None:
        """Return where the phase first changes inside a step, both ends left out; None where it does not.

        Parameters
        ----------
        begin, end : its ends, positive in this direction [s]
        """
        if self._phase is None:
            return None
        low = begin + _EDGE_S
        first = self._phase(self._way * low, interpolant(self._way * low))
        for look in np.linspace(begin, end, _LOOKS + 1)[1:].tolist():
            if self._phase(self._way * look, interpolant(self._way * look)) != first:
                high = look
                while high - low > _NEAR_S:
                    middle = 0.5 * (low + high)
                    if self._phase(self._way * middle, interpolant(self._way * middle)) == first:
                        low = middle
                    else:
                        high = middle
                return high if high < end - _EDGE_S else None
            low = look
        return None

    def _apply_jumps(self, x: np.ndarray) -> np.ndarray:
        for at, jump in self._jumps:
            if abs(at - self._ends[-1]) < _NEAR_S:
                x = np.asarray(jump(x), dtype=float)
        return x

    def _find_panel_end(self, begin: float) -> float:
        """Return where the panel that begins at `begin` ends: at the next edge of the grid, or at a break."""
        edge = (math.floor(begin / self._panel_s + 1e-9) + 1) * self._panel_s
        return min([at for at in self._breaks if at > begin + _NEAR_S] + [edge])

"""Ordinary differential equations, integrated so that an instant has the same bits whatever other instants are asked for.

DOP853 (Hairer, Norsett & Wanner, Solving ODEs I, sec. II.5; scipy's) with its dense output, in whole panels of fixed length
from t = 0, forward and backward. A panel once worked out is kept; panels end where the right-hand side is not smooth.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from threading import RLock
from typing import Any

import numpy as np

from rso_lidar.errors import PropagationError

Derivative = Callable[[float, np.ndarray], np.ndarray]
_NEAR_S = 1e-9  # two breaks nearer than this are one


class Solution:
    """x(t) of x' = f(t, x) with x(0) given, at any instants.

    Parameters
    ----------
    f : ``f(t, x (n,)) -> (n,)`` with t in seconds from the start
    x0 : (n,) state at t = 0
    panel_s : length of a panel [s]; some hundred steps fit well
    rtol, atol : tolerances of a step, relative and absolute (one number, or one for each entry of x)
    jumps : ``(time_s, jump)`` at which x becomes ``jump(x)``; time_s > 0
    breaks : further instants [s] at which f is not smooth, such as a thruster's switching
    name : what to call it in errors
    """

    def __init__(
        self,
        f: Derivative,
        x0: np.ndarray,
        *,
        panel_s: float,
        rtol: float = 1e-13,
        atol: float | np.ndarray = 1e-9,
        jumps: Sequence[tuple[float, Callable[[np.ndarray], np.ndarray]]] = (),
        breaks: Sequence[float] = (),
        name: str = "integration",
    ) -> None:
        self._f, self._panel_s, self._name = f, panel_s, name
        self._tolerances = {"rtol": rtol, "atol": atol}
        self._jumps = sorted(jumps, key=lambda jump: jump[0])
        self._breaks = sorted({*(at for at, _ in self._jumps), *breaks})
        x0 = np.array(x0, dtype=float)
        self._ends: dict[int, list[tuple[float, np.ndarray]]] = {1: [(0.0, x0)], -1: [(0.0, x0)]}
        self._dense: dict[int, list[Any]] = {1: [], -1: []}
        self._lock = RLock()

    def __call__(self, time_s: np.ndarray) -> np.ndarray:
        """Return x (time, n) at `time_s` (time,) [s]; at a jump, what is after it."""
        times = np.atleast_1d(np.asarray(time_s, dtype=float))
        values = np.empty((len(times), len(self._ends[1][0][1])))
        for way in (1, -1):
            of = np.flatnonzero(times >= 0.0 if way == 1 else times < 0.0)
            if len(of):
                self._reach(way, float(np.max(way * times[of])), times)
                ends = np.array([way * at for at, _ in self._ends[way]])
                # forward, an instant on an edge belongs to the panel that begins there: after a jump
                panel = np.searchsorted(ends, way * times[of], side="right" if way == 1 else "left") - 1
                for number in np.unique(panel):
                    rows = of[panel == number]
                    values[rows] = self._dense[way][number](times[rows]).T
        return values

    def _reach(self, way: int, until_s: float, asked: np.ndarray) -> None:
        """Work out panels, forward (1) or backward (-1), until one lies beyond `until_s` [s]."""
        from scipy.integrate import solve_ivp

        with self._lock:
            ends, dense = self._ends[way], self._dense[way]
            while way * ends[-1][0] <= until_s or not dense:
                begin, x = ends[-1]
                end = way * self._next(way * begin, way)
                made = solve_ivp(self._f, (begin, end), x, method="DOP853", dense_output=True, **self._tolerances)
                if not made.success or not np.all(np.isfinite(made.y[:, -1])):
                    bad = way * asked > way * begin
                    raise PropagationError(
                        f"{self._name}: the integration breaks down {begin:g} s from its start "
                        f"({made.message.rstrip('.')}): check state and dynamics, or ask for a shorter run",
                        bad,
                    )
                x = made.y[:, -1]
                for at, jump in self._jumps if way == 1 else ():
                    if abs(at - end) < _NEAR_S:
                        x = np.asarray(jump(x), dtype=float)
                dense.append(made.sol)
                ends.append((end, x))

    def _next(self, begin: float, way: int) -> float:
        """Return where the panel that begins at `begin` (counted forward) ends: at the grid's next edge, or a break."""
        edge = (math.floor(begin / self._panel_s + 1e-9) + 1) * self._panel_s
        return min([at for at in (way * b for b in self._breaks) if at > begin + _NEAR_S] + [edge])

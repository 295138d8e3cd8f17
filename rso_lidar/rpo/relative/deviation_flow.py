"""The motion of deviations from a reference path: all of them in one integration."""

from __future__ import annotations

import datetime
import math
from collections.abc import Callable
from typing import ClassVar

import numpy as np

from rso_lidar import units
from rso_lidar.orbit import Forces

_PER_RADIAN = (
    120  # steps in which the reference turns by a radian: RK4 is then good to 1e-9 of a deviation each revolution
)
Path = Callable[[np.ndarray], np.ndarray]
Push = Callable[[int], np.ndarray]


class DeviationFlow:
    """The motion of deviations from a reference path, between given instants.

    A deviation d obeys d'' = g(r + d) - g(r), with the gravity g of the Earth along the reference r. Nothing is
    linearised. Drag, sunlight, Sun and Moon act on the reference; their change over a deviation is left out (the Moon
    moves a deviation of 1 km by 3 mm in two hours). The integrator is that of Runge and Kutta, of fourth order.

    Parameters
    ----------
    node_s : (node,) ascending instants [s since `start_utc`]
    reference : function of instants (time,) [s] that returns the reference position (time, 3) [m], inertial axes
    forces : whose gravity of the Earth acts: zonal harmonics about the pole of the start, or `gravity`, which turns with it
    start_utc : start of the run
    """

    TIE_S: ClassVar[float] = 1e-6  # nodes nearer than this are one

    def __init__(self, node_s: np.ndarray, reference: Path, forces: Forces, start_utc: datetime.datetime) -> None:
        self.node_s = node_s
        first = reference(node_s[:1])[0]
        rate = math.sqrt(units.EARTH_GM_M3_S2 / float(np.linalg.norm(first)) ** 3)
        lengths = np.diff(node_s)
        self._steps = np.maximum(np.ceil(lengths * rate * _PER_RADIAN).astype(int), 1)
        self._step_s = lengths / self._steps
        stages = [
            begin + 0.5 * step * np.arange(2 * count + 1)
            for begin, step, count in zip(node_s[:-1], self._step_s, self._steps, strict=True)
        ]
        self._begins = np.cumsum([0, *(len(instants_s) for instants_s in stages)])
        self.stage_s = np.concatenate([*stages, node_s[-1:]])
        self._attract = forces.attraction(start_utc)
        self._reference = reference(self.stage_s)
        self._along = self._attract(self.stage_s, self._reference.T).T

    def advance(self, node: int, state: np.ndarray, push: Push | None = None) -> np.ndarray:
        """Return deviations (6, n) at the next node.

        Parameters
        ----------
        node : index of the node
        state : (6, n) deviations of position [m] and velocity [m/s] there, inertial axes
        push : function of the index of a stage in `stage_s` that returns further accelerations (3, n) or (3, 1) [m/s2]
        """
        h, at = float(self._step_s[node]), int(self._begins[node])
        d, v = state[:3], state[3:]
        for _ in range(int(self._steps[node])):
            a1 = self._accelerate(at, d, push)
            v2 = v + 0.5 * h * a1
            a2 = self._accelerate(at + 1, d + 0.5 * h * v, push)
            v3 = v + 0.5 * h * a2
            a3 = self._accelerate(at + 1, d + 0.5 * h * v2, push)
            v4 = v + h * a3
            a4 = self._accelerate(at + 2, d + h * v3, push)
            d = d + h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4)
            v = v + h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
            at += 2
        return np.concatenate([d, v])

    def transition(self, node: int) -> np.ndarray:
        """Return the transition matrix (6, 6) of small deviations [m], [m/s] from a node to the next one, in inertial axes.

        Parameters
        ----------
        node : index of the node
        """
        small = np.array([1.0, 1.0, 1.0, 1e-3, 1e-3, 1e-3])
        # the mean of both signs cancels the second order, which is 1e-7 of a deviation
        there, back = (self.advance(node, sign * np.diag(small)) for sign in (1.0, -1.0))
        matrix: np.ndarray = 0.5 * (there - back) / small
        return matrix

    def _accelerate(self, stage: int, d: np.ndarray, push: Push | None) -> np.ndarray:
        """Return the second derivatives (3, n) of deviations [m/s2].

        Parameters
        ----------
        stage : index in `stage_s`
        d : (3, n) deviations of position [m]
        push : as in `advance`
        """
        pulled = self._attract(self.stage_s[stage], self._reference[stage][:, None] + d)
        acceleration: np.ndarray = pulled - self._along[stage][:, None]
        return acceleration if push is None else acceleration + push(stage)

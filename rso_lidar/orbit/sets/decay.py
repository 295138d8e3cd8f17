"""Decays: the first instant on either side of its epoch at which SGP4 has no state of an element set.

SGP4 squares the drag polynomial that scales the semi-major axis (tempa in Vallado's program). Where the polynomial passes
zero the orbit grows again, so a set that SGP4 reports as decayed has states again days later. None of these describe an
orbit, and neither do those of an eccentric orbit between two perigees below the ground. No state beyond the first failure is
used, neither after the epoch nor before it.

**What must not be missed.** A failure may last for seconds, at one perigee. Samples alone would miss it, so spans are first
proven to be free of failures. With the coefficients of SGP4, the drag polynomial and the mean eccentricity have bounds over
any span, and so has the least radius of the orbit. A span in which this bound is above the ground, the eccentricity is
between -0.001 and 1, and the polynomial is above 0 contains no failure. Nearly all sets of a catalogue are proven in one
step. The spans of the others are divided into pieces of half a day; what is not proven then is sampled by SGP4 itself, with
each minimum of the radius refined.

Two kinds of failures are no decay and end nothing. One is error 3: the perturbed eccentricity of a nearly circular orbit is
below 0 for a while. The other are those of deep-space sets without drag (B* = 0), whose perigee Sun and Moon move below the
ground and out again. The verification set of SGP4 publishes states of one (20413) nine months after its first such perigee.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any

import numpy as np

from rso_lidar import units
from rso_lidar.orbit.sets.element_set import ElementSet

_ENDS = np.array([False, True, True, False, True, False, True])  # by error code: whether there is no state beyond it
_BELOW_GROUND = 6
# The short-period terms of SGP4 lower a radius by at most 1.5 J2 + J2 / 4 = 0.0019 Earth radii, its long-period terms the
# radius of perigee by J3 / (2 J2) / (1 - e^2) = 0.00118 / (1 - e^2) (Hoots and Roehrich, Spacetrack Report 3).
_SHORT_PERIOD, _LONG_PERIOD = 0.002, 0.0012
# Sun and Moon change the eccentricity of a deep-space orbit by at most 15 e sqrt(1 - e^2) / n times these: a periodic part
# [rad/min], and a secular part [rad/min2] that grows with time. They are the coefficients c1ss and c1l of dscom in Vallado's
# program, and their products with the rates zns and znl, with all direction cosines at 1.
_PERIODIC = 0.5 * (2.9864797e-6 + 4.7968065e-7)
_SECULAR = 2.9864797e-6 * 1.19459e-5 + 4.7968065e-7 * 1.5835218e-4
_RESONANT = 0.98  # least semi-major axis over its mean; in catalogues resonances lower it by 0.2 % in five years
_PIECE_MIN = 720.0
_MARGIN_S = units.DAY_S  # searched beyond the instants asked for, so that a run of single steps seldom searches
_SAMPLES, _LONGEST_STEP_MIN = 180, 4.0  # samples of a revolution: 0.5 min in low orbit
_LOW = 1.05  # Earth radii; a minimum of the radius above this is not refined
_REFINED = 33
_BISECTED_MIN = 1e-5  # 0.6 ms
_MOST_PIECES = 400_000  # bounded at a time: some 50 MB


class DecayTimes:
    """When element sets decay, found as far from their epochs as states are asked for.

    Parameters
    ----------
    sets : element sets
    models : the SGP4 model of each; only its elements are read
    most_s : greatest time from an epoch for which there are states [s]
    """

    def __init__(self, sets: Sequence[ElementSet], models: Sequence[Any], most_s: float) -> None:
        self._sets = tuple(sets)
        self._models = models
        self._most_s = most_s
        count = len(self._sets)
        self._proven_s = np.zeros((2, count))  # time before and after the epoch without a decay
        self._decay_s = np.full((2, count), np.inf)  # time of the decay before and after the epoch
        self._code = np.zeros((2, count), dtype=int)

    @functools.cached_property
    def _bounds(self) -> _RadiusBounds:
        return _RadiusBounds(self._models)

    def mark(self, error: np.ndarray, which: np.ndarray, since_s: np.ndarray, time_s: np.ndarray) -> None:
        """Write the error code of a decay at all instants beyond it.

        Parameters
        ----------
        error : (row, time) error codes, changed in place
        which : (row,) number of the set
        since_s : (row,) time from its epoch to the instant 0 [s]
        time_s : (time,) instants [s]
        """
        if not error.size:
            return
        for side, sign in enumerate((-1.0, 1.0)):
            last_s = np.clip((sign * since_s) + (sign * time_s).max(), 0.0, self._most_s)
            unknown = last_s > np.minimum(self._proven_s[side, which], self._decay_s[side, which])
            unknown &= np.isinf(self._decay_s[side, which])
            if unknown.any():
                self._search(side, which[unknown], last_s[unknown])
            rows = np.flatnonzero(last_s > self._decay_s[side, which])
            if len(rows):
                beyond = sign * (since_s[rows, None] + time_s) > self._decay_s[side, which[rows], None]
                error[rows] = np.where(beyond, self._code[side, which[rows], None], error[rows])

    def since_epoch_s(self, which: int, since_s: float) -> float:
        """Return when a set decays on that side of its epoch where an instant is [s since its epoch]; infinite if never.

        Parameters
        ----------
        since_s : the instant [s since its epoch], for which `mark` was called
        """
        side = int(since_s >= 0.0)
        return float(self._decay_s[side, which]) * (1.0 if side else -1.0)

    def _search(self, side: int, which: np.ndarray, last_s: np.ndarray) -> None:
        """Search for decays until `last_s` from the epochs of some sets, before (0) or after (1) them.

        Parameters
        ----------
        side : 0 before the epochs, 1 after them
        which : (row,) numbers of the sets, which may repeat
        last_s : (row,) time from the epoch [s]
        """
        sign = 1.0 if side else -1.0
        until_s = np.zeros(len(self._sets))
        np.maximum.at(until_s, which, np.minimum(last_s + _MARGIN_S, self._most_s))
        sets = np.unique(which)
        begin, end = self._proven_s[side, sets] / 60.0, until_s[sets] / 60.0
        proven = self._bounds.exclude_failure(sets, begin[:, None], end[:, None], sign)[:, 0]
        self._proven_s[side, sets[proven]] = until_s[sets[proven]]
        left = np.flatnonzero(~proven)
        if not len(left):
            return
        pieces = max(1, int(np.ceil(float((end - begin)[left].max()) / _PIECE_MIN)))
        for rows in np.array_split(left, -(-len(left) * pieces // _MOST_PIECES)):
            edges = begin[rows, None] + (end - begin)[rows, None] * np.linspace(0.0, 1.0, pieces + 1)
            free = self._bounds.exclude_failure(sets[rows], edges[:, :-1], edges[:, 1:], sign)
            for row, number in enumerate(sets[rows].tolist()):
                failure = _find_failure(self._sets[number], edges[row], free[row], sign)
                if failure is not None:
                    self._code[side, number] = failure[1]
                    self._decay_s[side, number] = failure[0] * 60.0
                self._proven_s[side, number] = until_s[number]


class _RadiusBounds:
    """Bounds of the orbits of SGP4 over spans of time, from the coefficients of sgp4init in Vallado's program.

    Lengths are in Earth radii, times in minutes, as there.

    Parameters
    ----------
    models : the SGP4 models
    """

    def __init__(self, models: Sequence[Any]) -> None:
        names = ("a", "ecco", "inclo", "argpo", "mo", "bstar")
        rows = np.array([[getattr(model, name) for name in names] for model in models])
        axis, e, inclination, argument, anomaly, bstar = rows.T
        earth = models[0]
        deep = np.array([model.method == "d" for model in models])
        self.eccentricity = e
        with np.errstate(all="ignore"):  # numbers that are no orbit give bounds that are not numbers: nothing is proven
            motion = earth.xke * axis**-1.5  # of the original theory, not Kozai's
            polynomial, rate, swing = _find_drag(axis, e, inclination, argument, motion, earth)
            simple = deep | (axis * (1.0 - e) < 220.0 / earth.radiusearthkm + 1.0)
            order = np.arange(1, 5)[:, None]
            polynomial = np.where(simple & (order > 1), 0.0, polynomial * bstar**order)
            swing = np.where(simple, 0.0, swing * bstar)
            self.is_drag_free = deep & (bstar == 0.0)
            self.lunisolar = np.where(deep, 15.0 * e * np.sqrt(1.0 - e**2) / motion, 0.0)
        self.axis = axis * np.where(deep, _RESONANT, 1.0)
        self.polynomial, self.rate = polynomial, rate * bstar
        self.swing = np.stack([swing * np.sin(anomaly) - np.abs(swing), swing * np.sin(anomaly) + np.abs(swing)])

    def exclude_failure(self, sets: np.ndarray, begin: np.ndarray, end: np.ndarray, sign: float) -> np.ndarray:
        """Return whether it is proven that no set decays within spans.

        Parameters
        ----------
        sets : (set,) numbers of the sets
        begin, end : (set, span) time from the epoch [min], not negative
        sign : 1 after the epoch, -1 before it
        """
        of = (sets, None)
        lowest = np.ones(np.broadcast_shapes(begin.shape, end.shape))
        for k, coefficient in enumerate(self.polynomial, start=1):
            signed = coefficient[of] * sign**k
            lowest = lowest - np.maximum(signed * begin**k, signed * end**k)
        slope, wander = sign * self.rate[of], self.lunisolar[of] * (_PERIODIC + _SECULAR * end)
        e = self.eccentricity[of]
        high = e - np.minimum(slope * begin, slope * end) + self.swing[1][of] + wander
        low = e - np.maximum(slope * begin, slope * end) + self.swing[0][of]
        high = np.maximum(high, 1e-6)
        with np.errstate(all="ignore"):
            radius = self.axis[of] * lowest**2 * (1.0 - high) - _SHORT_PERIOD - _LONG_PERIOD / (1.0 - high)
        proven: np.ndarray = (lowest > 0.0) & (high < 1.0) & (low > -0.001) & (radius > 1.0)
        proven |= self.is_drag_free[of]
        return proven


def _find_drag(
    axis: np.ndarray,
    e: np.ndarray,
    inclination: np.ndarray,
    argument: np.ndarray,
    motion: np.ndarray,
    earth: Any,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the drag coefficients of sgp4init, each over its power of B*.

    Parameters
    ----------
    axis : (set,) semi-major axis [Earth radii]
    e : (set,) eccentricity
    inclination, argument : (set,) inclination and argument of perigee [rad]
    motion : (set,) mean motion [rad/min]
    earth : a model, with the Earth's radius and J2

    Returns
    -------
    (4, set) cc1, d2, d3 and d4 [1/min^k]; cc4 [1/min], and cc5
    """
    height_km = (axis * (1.0 - e) - 1.0) * earth.radiusearthkm
    s_km = np.where(height_km < 156.0, np.where(height_km < 98.0, 20.0, height_km - 78.0), 78.0)
    s = s_km / earth.radiusearthkm + 1.0
    tsi = 1.0 / (axis - s)
    eta = axis * e * tsi
    eta2, eeta, psi2 = eta**2, e * eta, np.abs(1.0 - eta**2)
    coefficient = ((120.0 - s_km) / earth.radiusearthkm) ** 4 * tsi**4 / psi2**3.5
    con41, x1mth2 = 3.0 * np.cos(inclination) ** 2 - 1.0, np.sin(inclination) ** 2
    cc1 = (
        coefficient
        * motion
        * (
            axis * (1.0 + 1.5 * eta2 + eeta * (4.0 + eta2))
            + 0.375 * earth.j2 * tsi / psi2 * con41 * (8.0 + 3.0 * eta2 * (8.0 + eta2))
        )
    )
    zonal = -3.0 * con41 * (1.0 - 2.0 * eeta + eta2 * (1.5 - 0.5 * eeta))
    zonal += 0.75 * x1mth2 * (2.0 * eta2 - eeta * (1.0 + eta2)) * np.cos(2.0 * argument)
    cc5 = 2.0 * coefficient * axis * (1.0 - e**2) * (1.0 + 2.75 * (eta2 + eeta) + eeta * eta2)
    in_plane = eta * (2.0 + 0.5 * eta2) + e * (0.5 + 2.0 * eta2)
    cc4 = 2.0 * motion * coefficient * axis * (1.0 - e**2) * (in_plane - earth.j2 * tsi / (axis * psi2) * zonal)
    d2 = 4.0 * axis * tsi * cc1**2
    third = d2 * tsi * cc1 / 3.0
    d3, d4 = (17.0 * axis + s) * third, 0.5 * third * axis * tsi * (221.0 * axis + 31.0 * s) * cc1
    return np.stack([cc1, d2, d3, d4]), cc4, cc5


def _find_failure(elements: ElementSet, edges: np.ndarray, free: np.ndarray, sign: float) -> tuple[float, int] | None:
    """Find the first failure of SGP4 in the pieces that may contain one.

    Parameters
    ----------
    edges : (piece + 1,) ends of the pieces, from the epoch outward [min]
    free : (piece,) whether a piece is proven to contain none
    sign : 1 after the epoch, -1 before it

    Returns
    -------
    time from the epoch [min] and error code, None without a failure
    """
    if free.all():
        return None
    model = elements.satrec()  # a new one: the deep-space integrator keeps its state
    step = min(1440.0 / elements.mean_motion_rev_day / _SAMPLES, _LONGEST_STEP_MIN)

    def evaluate(minutes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        days = sign * minutes / 1440.0
        error, position_km, _ = model.sgp4_array(np.full(days.shape, model.jdsatepoch), model.jdsatepochF + days)
        radius = np.sqrt(np.einsum("ni,ni->n", position_km, position_km)) / model.radiusearthkm
        code = np.where(_ENDS[error], error, 0)
        code[(error == 0) & np.isnan(radius)] = _BELOW_GROUND
        return radius, code

    for k in np.flatnonzero(~free).tolist():
        begin, end = max(float(edges[k]) - step, 0.0), float(edges[k + 1]) + step
        minutes = np.linspace(begin, end, int(np.ceil((end - begin) / step)) + 1)
        radius, code = evaluate(minutes)
        low = np.flatnonzero((radius[1:-1] < radius[:-2]) & (radius[1:-1] <= radius[2:]) & (radius[1:-1] < _LOW)) + 1
        middle, half = minutes[low], minutes[1] - minutes[0]
        refined, codes = minutes, code
        for _ in range(2):
            if not len(middle):
                break
            around = middle[:, None] + half * np.linspace(-1.0, 1.0, _REFINED)
            there, why = (part.reshape(around.shape) for part in evaluate(around.ravel()))
            refined, codes = np.append(refined, around), np.append(codes, why)
            middle = around[np.arange(len(middle)), np.argmin(np.where(np.isnan(there), -1.0, there), axis=1)]
            half *= 2.0 / (_REFINED - 1)
        order = np.argsort(refined, kind="stable")
        refined, codes = refined[order], codes[order]
        if codes.any():
            at = int(np.argmax(codes != 0))
            before, after, what = float(refined[max(at - 1, 0)]), float(refined[at]), int(codes[at])
            while after - before > _BISECTED_MIN:
                half_way = 0.5 * (before + after)
                here = int(evaluate(np.array([half_way]))[1][0])
                before, after, what = (before, half_way, here) if here else (half_way, after, what)
            return max(before, 0.0), what
    return None

"""Lambert's problem: the two-body orbits that connect two positions in a given time, all revolutions and both branches.

After Izzo, Revisiting Lambert's problem, Celest. Mech. Dyn. Astr. 121 (2015); equation numbers below are his. Lancaster and
Blanchard's x is found by Householder steps inside a bracket, and the velocities follow in closed form.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.orbit.two_body.izzo import Branch, find_all_orbits, find_orbits

Way = Literal["short", "long", "prograde", "retrograde"]

_PARALLEL = 1e-10  # sine of the transfer angle below which the positions span no plane
MOST_REVOLUTIONS = 1000  # up to which `solve_lambert_all` lists the orbits


@dataclass(frozen=True, eq=False)
class Transfer:
    """One orbit of Lambert's problem.

    Parameters
    ----------
    departure_m_s, arrival_m_s : (3,) velocities at both ends [m/s]
    revolutions : whole revolutions before arrival
    branch : "low" or "high", the two orbits with the same number of revolutions: "low" has the smaller semi-major axis.
        None with less than one revolution, where there is one orbit
    way : "short" for a transfer angle of less than half a revolution (beside the whole ones), else "long"
    """

    departure_m_s: np.ndarray
    arrival_m_s: np.ndarray
    revolutions: int
    branch: Branch | None
    way: Literal["short", "long"]


def solve_lambert_all(
    from_m: np.ndarray,
    to_m: np.ndarray,
    duration_s: float,
    gm_m3_s2: float = units.EARTH_GM_M3_S2,
    *,
    normal: Sequence[float] | np.ndarray | None = None,
) -> tuple[Transfer, ...]:
    """Solve Lambert's problem for every orbit, of any number of revolutions.

    Parameters
    ----------
    from_m, to_m : (3,) positions [m]
    duration_s : time of flight [s]
    gm_m3_s2 : gravitational parameter [m3/s2]
    normal : (3,) normal of the orbit plane, needed where the positions and the Earth's centre are in one line

    Returns
    -------
    tuple of Transfer
        short ways first, then by revolutions

    Raises
    ------
    ScenarioError
        if a parameter makes no sense, or the time is enough for more than 1000 revolutions (`solve_lambert` finds the
        orbits of one such number)

    Examples
    --------
    >>> radius = 7e6
    >>> day = solve_lambert_all(np.array([radius, 0, 0]), np.array([0, radius, 0]), 20_000.0)
    >>> [(orbit.revolutions, orbit.branch, orbit.way) for orbit in day][:3]
    [(0, None, 'short'), (1, 'low', 'short'), (1, 'high', 'short')]
    """
    arc = _Geometry.from_positions(from_m, to_m, duration_s, gm_m3_s2, normal)
    if arc.scaled_time > math.pi * (MOST_REVOLUTIONS + 1):
        raise ScenarioError(
            f"duration_s: {duration_s:g} s leave time for some {arc.scaled_time / math.pi:.3g} revolutions, and orbits of "
            f"up to {MOST_REVOLUTIONS} are listed; give less, or give solve_lambert one number of revolutions"
        )
    ways: tuple[Literal["short", "long"], ...] = ("short", "long")
    return tuple(
        Transfer(*arc.velocities(x, way), revolutions, branch, way)
        for way in ways
        for revolutions, branch, x in find_all_orbits(arc.scaled_time, arc.share, arc.lam(way))
    )


def solve_lambert(
    from_m: np.ndarray,
    to_m: np.ndarray,
    duration_s: float,
    *,
    revolutions: int = 0,
    branch: Branch = "low",
    way: Way = "short",
    normal: Sequence[float] | np.ndarray | None = None,
    gm_m3_s2: float = units.EARTH_GM_M3_S2,
) -> Transfer:
    """Solve Lambert's problem for one orbit.

    Parameters
    ----------
    from_m, to_m : (3,) positions [m]
    duration_s : time of flight [s]
    revolutions : whole revolutions before arrival
    branch : "low" or "high" semi-major axis, where there is at least one revolution
    way : "short" or "long" transfer angle, or "prograde" or "retrograde" about `normal`
    normal : (3,) normal for `way`, the Earth's axis +z where it is left out; it also sets the orbit plane where the
        positions and the Earth's centre are in one line
    gm_m3_s2 : gravitational parameter [m3/s2]

    Returns
    -------
    Transfer

    Raises
    ------
    ScenarioError
        if a parameter is invalid, or there is no such orbit; the message states how many revolutions are possible
    """
    for name, word, known in (("way", way, get_args(Way)), ("branch", branch, get_args(Branch))):
        if word not in known:
            raise ScenarioError(f"{name}: '{word!s:.40}' is not known; write one of {', '.join(known)}")
    if isinstance(revolutions, bool) or not isinstance(revolutions, int | np.integer) or revolutions < 0:
        raise ScenarioError(f"revolutions: {revolutions!r:.40} is not a number of whole revolutions; give 0 or more")
    chosen: Literal["short", "long"]
    if way in ("short", "long"):
        chosen = "long" if way == "long" else "short"
    else:
        pole = np.array([0.0, 0.0, 1.0]) if normal is None else _vector("normal", normal)
        turns = float(np.sum(np.cross(_vector("from_m", from_m), _vector("to_m", to_m)) * pole))
        chosen = "short" if (turns >= 0.0) == (way == "prograde") else "long"
    arc = _Geometry.from_positions(from_m, to_m, duration_s, gm_m3_s2, normal)
    problem = arc.scaled_time, arc.share, arc.lam(chosen)
    if revolutions <= arc.scaled_time / math.pi:
        for which, x in find_orbits(*problem, revolutions):
            if which in (None, branch):
                return Transfer(*arc.velocities(x, chosen), revolutions, which, chosen)
    most = int(arc.scaled_time / math.pi)
    while most and not find_orbits(*problem, most):  # the time may be too short for `most`
        most -= 1
    raise ScenarioError(
        f"revolutions: {duration_s:g} s leave no time for {revolutions}; at most {most} the {chosen} way; "
        "ask for fewer, or give a longer duration"
    )


def _vector(name: str, given: Any) -> np.ndarray:
    """Check that a value is a finite vector (3,)."""
    try:
        vector = np.asarray(given, dtype=float)
    except (TypeError, ValueError):
        vector = np.empty(0)
    if vector.shape != (3,) or not np.all(np.isfinite(vector)):
        raise ScenarioError(f"{name}: lambert needs three finite numbers, from the Earth's centre; correct it")
    return vector


@dataclass(frozen=True, eq=False)
class _Geometry:
    """Triangle of the problem: unit vectors, lengths [m], and Izzo's scaled time."""

    outward: tuple[np.ndarray, np.ndarray]  # unit vectors to departure and arrival
    pole: np.ndarray  # unit normal of the short way
    radii_m: tuple[float, float]
    chord_m: float
    share: float  # q = chord / half perimeter = 1 - lambda^2
    root: float  # |lambda|
    scaled_time: float
    speed_m_s: float

    @staticmethod
    def from_positions(
        from_m: np.ndarray,
        to_m: np.ndarray,
        duration_s: float,
        gm_m3_s2: float,
        normal: Sequence[float] | np.ndarray | None,
    ) -> _Geometry:
        """Check the inputs of `solve_lambert`, raise `ScenarioError` if one makes no sense, and compute the triangle."""
        start, end = _vector("from_m", from_m), _vector("to_m", to_m)
        for name, value in (("duration_s", duration_s), ("gm_m3_s2", gm_m3_s2)):
            if not isinstance(value, int | float | np.number) or not math.isfinite(value):
                raise ScenarioError(f"{name}: {value!r:.40} is not a finite number; give one above zero")
        if not duration_s > 0.0:
            raise ScenarioError(f"duration_s: a transfer in {duration_s:g} s needs infinite speed; give more than zero")
        if not gm_m3_s2 > 0.0:
            raise ScenarioError(f"gm_m3_s2: {gm_m3_s2:g} does not attract; give more than zero")
        r1, r2 = float(np.linalg.norm(start)), float(np.linalg.norm(end))
        if min(r1, r2) == 0.0:
            raise ScenarioError("lambert: a position is the Earth's centre; give positions from it, in metres")
        u1, u2 = start / r1, end / r2
        pole = np.cross(u1, u2)
        sine, cosine = float(np.linalg.norm(pole)), float(np.sum(u1 * u2))
        if sine < _PARALLEL:
            if normal is None or cosine > 0.0:
                angle = "whole revolutions" if cosine > 0.0 else "180 degrees"
                cure = (
                    "change the duration, or the positions" if cosine > 0.0 else "give a normal, or change the duration"
                )
                raise ScenarioError(f"lambert: the positions are {angle} apart and span no plane; {cure}")
            given = _vector("normal", normal)
            pole = given - u1 * float(np.sum(given * u1))
            if np.linalg.norm(pole) <= _PARALLEL * np.linalg.norm(given):
                raise ScenarioError("lambert: the normal is parallel to the positions; give one across them")
        chord = float(np.linalg.norm(end - start))
        half = 0.5 * (r1 + r2 + chord)
        return _Geometry(
            (u1, u2),
            pole / np.linalg.norm(pole),
            (r1, r2),
            chord,
            chord / half,
            0.5 * math.sqrt(r1 * r2) * float(np.linalg.norm(u1 + u2)) / half,  # exact near half a revolution too
            math.sqrt(2.0 * gm_m3_s2 / half**3) * duration_s,
            math.sqrt(0.5 * gm_m3_s2 * half),
        )

    def lam(self, way: str) -> float:
        """Return Izzo's lambda, negative for the long way."""
        return -self.root if way == "long" else self.root

    def velocities(self, x: float, way: str) -> tuple[np.ndarray, np.ndarray]:
        """Return the velocities (3,) [m/s] at departure and arrival of the orbit with this x (Izzo alg. 1)."""
        lam = self.lam(way)
        y = math.sqrt(self.share + lam * lam * x * x)
        r1, r2 = self.radii_m
        rho = (r1 - r2) / self.chord_m
        sigma = math.sqrt(max(0.0, (1.0 - rho) * (1.0 + rho)))
        across = self.speed_m_s * sigma * (y + lam * x)
        out = (
            self.speed_m_s * ((lam * y - x) - rho * (lam * y + x)),
            -self.speed_m_s * ((lam * y - x) + rho * (lam * y + x)),
        )
        forward = [math.copysign(1.0, lam) * np.cross(self.pole, unit) for unit in self.outward]
        departure, arrival = (
            (out[k] * self.outward[k] + across * forward[k]) / radius for k, radius in enumerate(self.radii_m)
        )
        return departure, arrival

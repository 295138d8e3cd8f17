"""Torn and bent sheets, from which fragments are made.

Every function uses only operations that all processors round alike: sums, products, quotients, square roots and rounding.
Sine and cosine of mathematical libraries differ in the last bit, so `sine_cosine` sums their series.
"""

from __future__ import annotations

import math
from typing import Any, Protocol

import numpy as np

from rso_lidar.shapes.solids import Solid

_HALVINGS = 5  # of an angle, before its series is summed
_TERMS = 9  # of the series: the rest is below 1e-20 for an angle of 4 pi / 32


class UniformNumbers(Protocol):
    """A source of uniform random numbers, such as NumPy's Generator."""

    def random(self, size: Any = None) -> Any:
        """Draw numbers from 0 to below 1: one, or an array of a given size."""


def sine_cosine(angle_rad: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return sine and cosine of angles of up to 4 pi [rad], with the same bits on every processor.

    The series of a small part of the angle is summed. The formulas of the double angle then give the whole.

    >>> [float(x.round(12)) for x in sine_cosine(np.pi / 6)]
    [0.5, 0.866025403784]
    """
    small = np.asarray(angle_rad, float) / 2.0**_HALVINGS
    square = small * small
    sine, versine = np.ones_like(small), np.ones_like(small)
    for k in range(_TERMS, 0, -1):
        sine = 1.0 - square * sine / ((2.0 * k) * (2.0 * k + 1.0))
        versine = 1.0 - square * versine / ((2.0 * k + 1.0) * (2.0 * k + 2.0))
    sine, versine = small * sine, 0.5 * square * versine  # 1 - cosine keeps the digits that the cosine would lose
    for _ in range(_HALVINGS):
        sine, versine = 2.0 * sine * (1.0 - versine), 2.0 * versine * (2.0 - versine)
    return sine, 1.0 - versine


def draw_outline(numbers: UniformNumbers, corners: int, ragged: float, squeeze: float) -> np.ndarray:
    """Draw a torn outline: a star-shaped curve of long waves with teeth.

    Parameters
    ----------
    corners : number of the long waves
    ragged : height of the teeth, share of the radius

    Returns
    -------
    (16 * corners, 2) points, about 1 in radius.
    """
    n = 16 * corners
    angle = np.arange(n) * (2.0 * math.pi / n)
    radius = np.ones(n)
    for k in range(2, corners + 1):
        height, phase = 0.30 / k * numbers.random(), 2.0 * math.pi * numbers.random()
        wave = k * np.arange(n) % n * (2.0 * math.pi / n) + phase
        radius = radius + height * sine_cosine(wave)[1]
    ends = ragged * (2.0 * numbers.random(n // 4 + 1) - 1.0)
    between = np.tile(0.25 * np.arange(4), n // 4)
    teeth = np.repeat(ends[:-1], 4) * (1.0 - between) + np.repeat(ends[1:], 4) * between
    radius = radius * (1.0 + teeth + 0.3 * ragged * (2.0 * numbers.random(n) - 1.0))
    sine, cosine = sine_cosine(angle)
    return np.column_stack([radius * cosine, squeeze * radius * sine])


def build_sheet(outline: np.ndarray, thickness: float, rings: int) -> Solid:
    """Build a flat plate within a star-shaped outline, with inner vertices so that it can be bent.

    Parameters
    ----------
    outline : (n, 2) points
    thickness : in the unit of the outline
    """
    n = len(outline)
    share = np.arange(1, rings + 1) / rings
    layer = np.concatenate([np.zeros((1, 2)), (share[:, None, None] * outline).reshape(-1, 2)])
    m = len(layer)
    vertices = np.concatenate([np.column_stack([layer, np.full(m, z)]) for z in (-0.5 * thickness, 0.5 * thickness)])
    sides = [(a, (a + 1) % n) for a in range(n)]
    top = [(0, 1 + a, 1 + b) for a, b in sides]
    for ring in range(rings - 1):
        here, out = 1 + ring * n, 1 + (ring + 1) * n
        for a, b in sides:
            top += [(here + a, out + a, out + b), (here + a, out + b, here + b)]
    upper = np.array(top) + m
    lower = np.array(top)[:, ::-1]
    edge = 1 + (rings - 1) * n
    rim = [t for a, b in sides for t in ((edge + a, edge + b, m + edge + b), (edge + a, m + edge + b, m + edge + a))]
    return Solid(vertices, np.concatenate([lower, upper, np.array(rim)]))


def bend_solids(
    numbers: UniformNumbers, solids: list[Solid], curl: float, folds: int, depth: float, *, along_x: bool = False
) -> list[Solid]:
    """Crease thin solids along random lines, then roll them about one line.

    Creases stay below 0.4 of the rolling radius, so that no sheet turns inside out.

    Parameters
    ----------
    solids : sheets or rods about the plane z = 0, bent alike
    curl : rolling angle per unit length [rad]
    along_x : whether solids are rolled along x, as rods are, and not along a random direction
    """
    heights = [np.zeros(len(solid.vertices)) for solid in solids]
    for _ in range(folds):
        turn, place = 2.0 * math.pi * numbers.random(), 1.2 * numbers.random() - 0.6
        slope = depth * (2.0 * numbers.random() - 1.0)
        sine, cosine = sine_cosine(turn)
        for height, solid in zip(heights, solids, strict=True):
            beyond = cosine * solid.vertices[:, 0] + sine * solid.vertices[:, 1] - place
            height += slope * np.maximum(0.0, beyond)
    steepest = max(float(np.abs(height).max()) for height in heights)
    share = min(1.0, 0.4 / (curl * max(steepest, 1e-12)))
    sine, cosine = sine_cosine(0.0 if along_x else 2.0 * math.pi * numbers.random())
    rolled = []
    for height, solid in zip(heights, solids, strict=True):
        x, y, z = solid.vertices.T
        radius, turned = 1.0 / curl - z - share * height, curl * (cosine * x + sine * y)
        across = cosine * y - sine * x
        sine_of, cosine_of = sine_cosine(turned)
        vertices = np.column_stack([radius * sine_of, across, 1.0 / curl - radius * cosine_of])
        rolled.append(Solid(vertices, solid.facets))
    return rolled

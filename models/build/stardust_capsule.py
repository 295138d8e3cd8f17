"""Stardust's return capsule, open as at the encounter: the cover, the heat shield swung down, the dust collector held up."""

from __future__ import annotations

import math

from models.build.primitives import box, cylinder, revolve, ring, torus, tube
from rso_lidar.shapes import Point, Solid, join, pipe
from rso_lidar.units import DEG

DIAMETER_M, HEIGHT_M = 0.81, 0.50
ANGLE_DEG = 60.0  # half the angle of the heat shield's cone
NOSE_M = 0.23  # radius of its nose
LIP_M = 0.045  # how far its edge stands up

MIDDLE_Z_M = 0.155
BUS_BACK_M = -0.70  # the face of the bus that the capsule hangs on
HINGE_M: Point = (-1.018, 0.0, -0.172)  # of the heat shield
OPEN_DEG = 82.0  # how far it is swung down
COLLECTOR_M: Point = (-0.97, 0.0, 0.90)  # middle of the collector
COLLECTOR_RADIUS_M = 0.212
CELL_M = (0.038, 0.0195)  # of aerogel, two by four centimetres with its wrapping


def _heights() -> tuple[float, float]:
    """Return the heights of the heat shield, nose to edge, and of the cover, which together make the capsule's [m]."""
    slope = ANGLE_DEG * DEG
    shield = 0.5 * DIAMETER_M / math.tan(slope) - NOSE_M * (1.0 / math.sin(slope) - 1.0)
    return shield, HEIGHT_M - shield


def cover() -> Solid:
    """Return the back cover of the capsule, which opens to -x, with the canister inside it."""
    _, depth = _heights()
    edge = 0.5 * DIAMETER_M
    outside = [(0.0, 0.0), (0.22, 0.0), (0.25, 0.02), (edge - 0.012, depth - 0.03), (edge, depth)]
    inside = [(edge - 0.02, depth), (edge - 0.04, depth - 0.03), (0.0, depth - 0.03)]
    canister = cylinder(0.26, depth - 0.05, depth - 0.012, 32)
    seal = torus(edge - 0.03, 0.008, 48, 6).move(z=depth)
    locks = [box((0.03, 0.06, 0.03), (edge - 0.07, 0.0, depth - 0.01)).turn("z", turn) for turn in (40, 140, 220, 320)]
    return (
        join(revolve([*outside, *inside], 48), canister, seal, *locks)
        .facing((-1, 0, 0))
        .move(BUS_BACK_M - 0.06, 0.0, MIDDLE_Z_M)
    )


def struts() -> Solid:
    """Return the struts between the bus and the capsule, and the pin of the heat shield's hinge."""
    bars = [
        tube(
            (BUS_BACK_M + 0.01, 0.26 * y, MIDDLE_Z_M + 0.26 * z),
            (BUS_BACK_M - 0.10, 0.20 * y, MIDDLE_Z_M + 0.20 * z),
            0.018,
        )
        for y, z in ((0.5, 0.87), (-0.5, 0.87), (0.5, -0.87), (-0.5, -0.87), (1.0, 0.0), (-1.0, 0.0))
    ]
    pin = tube((HINGE_M[0], -0.16, HINGE_M[2]), (HINGE_M[0], 0.16, HINGE_M[2]), 0.018)
    return join(*bars, pin)


def heat_shield() -> Solid:
    """Return the heat shield, swung down on its hinge: a blunt cone that points to about -z, hollow above, with its arms."""
    tip, depth = _heights()
    edge = 0.5 * DIAMETER_M
    turns = [(90.0 - ANGLE_DEG) * DEG * k / 3 for k in range(4)]
    nose = [(NOSE_M * math.sin(turn), NOSE_M * (1.0 - math.cos(turn)) - tip) for turn in turns]
    outer = [*nose, (edge, 0.0)]
    lip = [(edge, LIP_M - 0.01), (edge - 0.03, LIP_M)]
    inner = [(edge - 0.05, 0.02), (0.08, 0.035 - tip + 0.02), (0.0, 0.035 - tip + 0.02)]
    pads = [cylinder(0.02, -0.06, 0.03, 10).move(edge - 0.09).turn("z", 45.0 + 90.0 * k) for k in range(4)]
    rim_x_m = BUS_BACK_M - 0.06 - depth - LIP_M - 0.005
    shut = join(revolve([*outer, *lip, *inner], 56), *pads).turn("y", 90).move(rim_x_m, 0.0, MIDDLE_Z_M)
    x, _, z = HINGE_M
    opened = shut.move(-x, 0.0, -z).turn("y", -OPEN_DEG).move(x, 0.0, z)
    arms = [pipe([(x, y, z), (x - 0.08, y, z - 0.02), (x - 0.12, y, z - 0.12)], 0.014, 6) for y in (-0.10, 0.10)]
    return join(opened, *arms)


def _cell_places() -> list[tuple[float, float]]:
    """Return the middles (y, z) of the aerogel cells that fit into the collector's frame [m]."""
    wide, high = CELL_M[0] + 0.004, CELL_M[1] + 0.002
    places = [((column + 0.5 * (row % 2)) * wide, row * high) for row in range(-9, 10) for column in range(-6, 7)]
    half_y, half_z = 0.5 * CELL_M[0], 0.5 * CELL_M[1]
    return [(y, z) for y, z in places if math.hypot(abs(y) + half_y, abs(z) + half_z) < COLLECTOR_RADIUS_M]


def aerogel() -> Solid:
    """Return the blocks of aerogel, which stand out of their frame a little on both sides."""
    x, y0, z0 = COLLECTOR_M
    return join(*(box((0.034, *CELL_M), (x, y0 + y, z0 + z)) for y, z in _cell_places()))


def collector() -> Solid:
    """Return the frame of the collector: a round rim, and the bars between the rows of cells."""
    rim = ring(COLLECTOR_RADIUS_M, COLLECTOR_RADIUS_M + 0.012, -0.016, 0.016, 48)
    reach = COLLECTOR_RADIUS_M + 0.005
    heights = [(k + 0.5) * (CELL_M[1] + 0.002) for k in range(-9, 9)]
    bars = [box((0.026, 2.0 * math.sqrt(reach**2 - z * z), 0.003), (0.0, 0.0, z)) for z in heights]
    return join(rim.facing((1, 0, 0)), *bars).move(*COLLECTOR_M)


def collector_arm() -> Solid:
    """Return the arm that holds the collector above the capsule, with its wrist and its shoulder."""
    x, _, z = COLLECTOR_M
    arm = [tube((-0.99, y, 0.33), (x, y, z - 0.215), 0.010) for y in (-0.022, 0.022)]
    return join(*arm, box((0.07, 0.09, 0.09), (-1.00, 0.0, 0.34)), box((0.05, 0.09, 0.05), (x, 0.0, z - 0.225)))

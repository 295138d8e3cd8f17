"""What Rosetta carries: the instruments on its top, and Philae, folded, on its -x face."""

from __future__ import annotations

from models.build.primitives import ball, box, cylinder, dish, frustum, prism, tiles, tube, wall
from rso_lidar.shapes import Point, Solid, join, skin

TOP_M = 1.4  # of the instrument panel

# Philae in plan: half widths at the face that it hangs on, where its hood narrows, and at its outer face [m].
NEAR_M, MIDDLE_M, FAR_M = -1.00, -1.73, -2.08
HALF_M, HALF_FAR_M = 0.50, 0.26
FLOOR_M, ROOF_M = -0.49, 0.25


def _barrel(radius: float, length: float, way: Point, place: Point) -> Solid:
    """Return a baffle: a tube closed at the back and open in front.

    Parameters
    ----------
    radius, length : of the tube [m]
    way : direction in which it opens
    place : middle of its back [m]
    """
    tubular = join(
        wall([(radius - 0.012, 0.0), (radius - 0.012, length)], 0.012, 28), cylinder(radius - 0.006, -0.05, 0.04, 28)
    )
    return tubular.facing(way).move(*place)


def cameras() -> Solid:
    """Return the two cameras with their baffles, and the infrared spectrometer beside them."""
    baffles = [_barrel(0.17, 0.27, (0, 0, 1), (-0.73, y, TOP_M + 0.01)) for y in (-0.27, 0.12)]
    narrow = [
        box((0.46, 0.36, 0.30), (-0.95, -0.65, TOP_M + 0.10)),
        _barrel(0.11, 0.24, (0, 0, 1), (-1.05, -0.62, TOP_M + 0.22)),
    ]
    doors = [cylinder(0.16, 0.0, 0.012, 28).facing((0.5, 0, 1)).move(-0.50, y, TOP_M + 0.30) for y in (-0.27, 0.12)]
    return join(*baffles, *narrow, *doors)


def lenses() -> Solid:
    """Return the front lenses at the bottom of the cameras' baffles."""
    return join(*(cylinder(0.155, TOP_M + 0.045, TOP_M + 0.055, 28).move(-0.73, y) for y in (-0.27, 0.12)))


def microwave_dish() -> Solid:
    """Return the microwave radiometer's offset dish of 0.3 m, tilted on its box."""
    bowl = dish(0.34, 0.16, 0.008, 5, 28).facing((0.45, 0, 1)).move(-0.34, 0.76, TOP_M + 0.24)
    stalk = tube((-0.28, 0.76, TOP_M - 0.01), (-0.36, 0.76, TOP_M + 0.24), 0.05, 10)
    mirror = join(
        tube((-0.12, 0.76, TOP_M), (-0.10, 0.76, TOP_M + 0.26), 0.02),
        box((0.10, 0.12, 0.02), (-0.11, 0.76, TOP_M + 0.27)),
    )
    return join(bowl, stalk, mirror)


def instruments() -> Solid:
    """Return boxes, drums and shades of instruments on the top, and the radiators beside the lander."""
    shade = skin(
        [
            [(0.62, 0.0, TOP_M - 0.01), (1.03, -0.22, TOP_M - 0.01), (1.03, 0.22, TOP_M - 0.01)],
            [(0.86, 0.0, 1.92), (0.93, -0.02, 1.92), (0.93, 0.02, 1.92)],
        ]
    )
    drum = join(cylinder(0.18, TOP_M - 0.01, TOP_M + 0.16, 28), cylinder(0.06, TOP_M + 0.15, TOP_M + 0.24, 16)).move(
        0.50, -0.68
    )
    gas = tube((0.32, -0.70, TOP_M + 0.12), (-0.02, -0.70, TOP_M + 0.42), 0.11, 20)
    boxes = [
        box((0.34, 0.30, 0.14), (0.95, 0.82, TOP_M + 0.06)),
        box((0.24, 0.22, 0.10), (0.40, 0.56, TOP_M + 0.04)),
        box((0.32, 0.22, 0.16), (-0.40, -0.58, TOP_M + 0.06)),
        box((0.20, 0.16, 0.20), (0.92, 0.40, TOP_M + 0.08)),
        box((0.16, 0.16, 0.12), (-0.87, -0.90, TOP_M + 0.04)),
        box((0.14, 0.14, 0.10), (-1.18, 0.15, TOP_M + 0.02)),
        box((0.24, 0.16, 0.12), (-1.12, 0.52, TOP_M + 0.03)),
        box((0.30, 0.24, 0.18), (-1.05, 0.85, TOP_M + 0.06)),
    ]
    bowl = frustum(0.46, 0.30, TOP_M - 0.01, TOP_M + 0.03, 40)
    domes = [
        ball(0.07, place, 2)
        for place in ((0.86, -0.85, TOP_M + 0.06), (-0.38, 0.42, TOP_M + 0.04), (-0.35, 0.24, TOP_M + 0.04))
    ]
    shields = [
        box((0.012, 0.34, 0.26), (-1.12, y, TOP_M + 0.14)).turn("z", turn) for y, turn in ((-0.30, 4), (0.33, -6))
    ]
    coolers = [tiles((0.03, 0.52, 0.52), (1, 2), 0.03).move(-1.41, -0.70, 1.06)]
    columns = [cylinder(0.11, 0.0, 0.60, 20).facing((-1, 0.25 * y, 0)).move(-1.02, 0.66 * y, 0.48) for y in (-1, 1)]
    return join(shade, drum, gas, *boxes, bowl, *domes, *shields, *coolers, *columns)


def star_trackers() -> Solid:
    """Return the two star trackers and the sun sensors."""
    trackers = [_barrel(0.085, 0.30, (0.3, y, 0.1), (0.75, 0.92 * y, TOP_M + 0.09)) for y in (-1, 1)]
    sensors = [box((0.08, 0.08, 0.06), (x, y, -TOP_M - 0.02)) for x, y in ((0.8, 0.8), (-0.8, -0.8))]
    return join(*trackers, *sensors)


def lander() -> Solid:
    """Return the body of Philae: a six-sided hood with a lid that stands out a little, and the balcony below."""
    plan = [
        (NEAR_M, -HALF_M),
        (NEAR_M, HALF_M),
        (MIDDLE_M, HALF_M),
        (FAR_M, HALF_FAR_M),
        (FAR_M, -HALF_FAR_M),
        (MIDDLE_M, -HALF_M),
    ]
    lid = prism([(1.006 * x, 1.03 * y) for x, y in plan], ROOF_M - 0.02, ROOF_M + 0.012)
    balcony = box((0.75, 0.90, 0.05), (-1.45, 0.0, FLOOR_M - 0.035))
    drill = tube((-1.80, 0.20, ROOF_M), (-1.80, 0.20, ROOF_M + 0.10), 0.05, 12)
    return join(prism(plan, FLOOR_M, ROOF_M), lid, balcony, drill)


def lander_cells() -> Solid:
    """Return the cells on the five free sides of the hood."""
    height, middle = ROOF_M - FLOOR_M - 0.08, 0.5 * (ROOF_M + FLOOR_M)
    side = tiles((height, 0.32, 0.008), (6, 3), 0.008).facing((0, 1, 0)).move(-1.55, HALF_M, middle)
    slope = (HALF_FAR_M - HALF_M, MIDDLE_M - FAR_M, 0.0)
    bevel = tiles((height, 0.38, 0.008), (6, 4), 0.008).facing(slope)
    bevel = bevel.move(0.5 * (MIDDLE_M + FAR_M), 0.5 * (HALF_M + HALF_FAR_M), middle)
    front = tiles((height, 0.46, 0.008), (6, 5), 0.008).facing((-1, 0, 0)).move(FAR_M, 0.0, middle)
    return join(side, side.mirror("y"), bevel, bevel.mirror("y"), front)


def lander_gear() -> Solid:
    """Return the three folded legs, the feet, and the frame that holds the lander off."""
    tip, low = FAR_M - 0.10, FLOOR_M
    bars = []
    for y in (-0.34, 0.34):
        bars += [tube((-1.15, y, low - 0.02), (tip, 0.5 * y, low - 0.05), 0.018, 6)]
        bars += [tube((-1.20, y, low - 0.22), (tip, 0.5 * y, low - 0.05), 0.018, 6)]
        bars += [tube((-1.15, y, low - 0.02), (-1.20, y, low - 0.22), 0.018, 6)]
        bars += [tube((-1.20, 1.6 * y, low - 0.22), (-1.95, 1.5 * y, low - 0.20), 0.016, 6)]
        bars += [
            tube((x, 1.55 * y, low - 0.21), (x - 0.11, 0.0, low - 0.05), 0.010, 6) for x in (-1.25, -1.47, -1.69, -1.91)
        ]
    places = ((-1.95, 0.5), (-1.95, -0.5), (tip + 0.02, 0.0))
    feet = [cylinder(0.06, -0.02, 0.03, 16).move(x, y, low - 0.20) for x, y in places]
    tail = tube((tip, -0.17, low - 0.05), (tip, 0.17, low - 0.05), 0.018, 6)
    spine = [
        tube((tip, 0.0, low - 0.05), (tip, 0.0, 0.22), 0.014, 6),
        tube((tip, 0.0, 0.20), (FAR_M + 0.02, 0.0, 0.20), 0.014, 6),
    ]
    ankle = tube((tip + 0.02, 0.0, low - 0.18), (tip, 0.0, low - 0.05), 0.014, 6)
    return join(*bars, *feet, tail, *spine, ankle)

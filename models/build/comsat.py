"""A communication satellite of the geostationary ring: a tall box, two long wings and four reflectors at its sides."""

from __future__ import annotations

import math

import numpy as np

from models.build.primitives import box, cylinder, dish, frustum, ring, tiles, torus, tube, wall
from models.build.solar_wings import wing_hinges
from rso_lidar.records import Symmetry, Taxonomy
from rso_lidar.shapes import CraftModel, CraftPart, Point, Solid, join, pipe
from rso_lidar.units import DEG

SPAN_M = 36.0  # across the solar wings
PANELS, PANEL_M, PANEL_GAP_M = 5, (2.75, 2.40, 0.024), 0.06  # of each wing: along it, across it, thick
BUS_M = (2.30, 2.10, 3.40)  # north-south, east-west, towards the Earth
TOP_M, BOTTOM_M = 1.90, -1.50
REFLECTOR_M, FOCAL_LENGTH_M = 2.00, 2.20
OFFSET_M = 1.55  # from the axis of the paraboloid to the middle of the reflector
FEED_M = (1.03, 1.18, 2.05)  # the focus of the reflector in the north-east
DISH_M = 1.10  # of the two steerable antennas on the Earth deck


def comsat() -> CraftModel:
    """Return a generic communication satellite: +x north (a solar wing), +y east (two reflectors), +z to the Earth."""
    cells, substrate, yoke = _wing()
    reflectors, backs, arms, feeds = _east()
    pieces = {
        "bus": CraftPart(_bus(), "mli_gold", 1850.0),
        "radiator_north": CraftPart(_radiator(), "osr", 60.0),
        "radiator_south": CraftPart(_radiator().turn("z", 180), "osr", 60.0),
        "solar_array_north": CraftPart(cells, "solar_cell", 55.0),
        "solar_array_south": CraftPart(cells.turn("z", 180), "solar_cell", 55.0),
        "solar_substrate_north": CraftPart(substrate, "cfrp", 85.0),
        "solar_substrate_south": CraftPart(substrate.turn("z", 180), "cfrp", 85.0),
        "solar_yoke_north": CraftPart(yoke, "cfrp", 12.0),
        "solar_yoke_south": CraftPart(yoke.turn("z", 180), "cfrp", 12.0),
        "antenna_reflectors_east": CraftPart(reflectors, "white_paint", 36.0),
        "antenna_reflectors_west": CraftPart(reflectors.turn("z", 180), "white_paint", 36.0),
        "antenna_backs_east": CraftPart(backs, "cfrp", 12.0),
        "antenna_backs_west": CraftPart(backs.turn("z", 180), "cfrp", 12.0),
        "boom_reflectors_east": CraftPart(arms, "cfrp", 12.0),
        "boom_reflectors_west": CraftPart(arms.turn("z", 180), "cfrp", 12.0),
        "feeds_east": CraftPart(feeds, "aluminium", 40.0),
        "feeds_west": CraftPart(feeds.turn("z", 180), "aluminium", 40.0),
        "earth_deck": CraftPart(_earth_deck(), "mli_silver", 60.0),
        "antenna_steerable": CraftPart(_steerable(), "white_paint", 40.0),
        "antenna_omni": CraftPart(_omni(), "white_paint", 4.0),
        "adapter_ring": CraftPart(ring(0.560, 0.597, BOTTOM_M - 0.16, BOTTOM_M + 0.01, 64), "aluminium", 30.0),
        "apogee_engine": CraftPart(_apogee_engine(), "aluminium", 12.0, hollow=True),
        "thruster": CraftPart(_thrusters(), "aluminium", 20.0),
    }
    return CraftModel(
        name="comsat",
        symmetry=Symmetry(fold=2),
        what="Generic geostationary communication satellite of the 4 to 6 tonne class: box, two wings, four reflectors",
        source=(
            "No one craft. ESA ARTES, 'Eurostar E3000 Large Mechanical Platform': launch masses of 5.8 to 6.4 t, "
            "payloads up to 14 kW; arrangement (wings north and south, reflectors east and west, mirrors on the north "
            "and south sides, 1194 mm interface) common to Eurostar, A2100 and their like"
        ),
        confidence=(
            "A typical arrangement with round numbers: span, bus, reflectors and masses are guesses within what such "
            "craft have (a span of 30 to 45 m, half of the launch mass left once in orbit and half used up). Materials "
            "are guesses."
        ),
        axes=(
            "+x north, along a solar wing; +y east; +z to the Earth; solar cells face +z in this pose; origin inside "
            "the bus"
        ),
        pieces=pieces,
        taxonomy=Taxonomy(
            object_class="payload",
            subclass="communication_satellite",
            shape_family="box_wing",
            size_class="large",
            stabilisation="three_axis",
            rate_deg_s=(0.0, 0.01),
        ),
        hinges=wing_hinges(
            {"north": (1.30, 0.0, 0.0), "south": (-1.30, 0.0, 0.0)}, axis=(1.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0)
        ),
    )


def _bus() -> Solid:
    """Return the bus with its drives, equipment boxes, star trackers and the corner posts that carry reflectors."""
    body = box(BUS_M, (0.0, 0.0, 0.5 * (TOP_M + BOTTOM_M)))
    drives = [cylinder(0.13, 1.10, 1.34, 20).facing((x, 0, 0)) for x in (-1, 1)]
    boxes = [box((0.5, 0.12, 0.4), (x, side * 1.08, -1.05)) for side in (-1, 1) for x in (-0.6, 0.5)]
    trackers = [ring(0.07, 0.09, 0.0, 0.30, 20).facing((0, side, 0.6)).move(0.0, side * 1.0, 1.55) for side in (-1, 1)]
    lower = box((1.5, 1.5, 0.12), (0.0, 0.0, BOTTOM_M - 0.02))
    return join(body, *drives, *boxes, *trackers, lower)


def _radiator() -> Solid:
    """Return the mirrors of the north side, which stand over the edges of the bus, round the drive of the wing."""
    upper = tiles((1.55, 2.30, 0.03), (8, 11), 0.012).turn("y", 90).move(1.165, 0.0, 1.05)
    lower = tiles((1.20, 2.30, 0.03), (6, 11), 0.012).turn("y", 90).move(1.165, 0.0, -0.82)
    return join(upper, lower)


def _wing() -> tuple[Solid, Solid, Solid]:
    """Return the cells, panels and yoke of the north wing."""
    length, width, thickness = PANEL_M
    inner = 0.5 * SPAN_M - PANELS * length - (PANELS - 1) * PANEL_GAP_M
    places = [inner + (k + 0.5) * length + k * PANEL_GAP_M for k in range(PANELS)]
    front = 0.5 * thickness + 0.001
    cells = [tiles((length - 0.08, width - 0.08, 0.002), (5, 4), 0.014, (x, 0.0, front)) for x in places]
    panels = [box(PANEL_M, (x, 0.0, 0.0)) for x in places]
    gaps = [x + 0.5 * (length + PANEL_GAP_M) for x in places[:-1]]
    hinges = [tube((x - 0.06, y, 0.0), (x + 0.06, y, 0.0), 0.020, 6) for x in gaps for y in (-0.95, -0.3, 0.3, 0.95)]
    pads = [cylinder(0.05, -0.03, 0.0, 12).move(x + dx, y) for x in places for dx in (-0.8, 0.8) for y in (-0.6, 0.6)]
    yoke = [
        tube((1.28, 0.0, 0.0), (1.75, 0.0, 0.0), 0.055, 14),
        *(pipe([(1.70, 0.0, 0.0), (2.55, y, 0.0), (inner + 0.05, y, 0.0)], 0.032, 8) for y in (-1.05, 1.05)),
        tube((inner - 0.35, -1.05, 0.0), (inner - 0.35, 1.05, 0.0), 0.024, 8),
        cylinder(0.09, 1.28, 1.44, 16).facing((1, 0, 0)),
    ]
    return join(*cells), join(*panels, *hinges, *pads), join(*yoke)


def _bend(solid: Solid) -> Solid:
    """Return a solid drawn flat about the middle of a reflector, bent to its paraboloid and put in its place."""
    vertices = np.array(solid.vertices)
    vertices[:, 2] += (vertices[:, 0] ** 2 + (vertices[:, 1] + OFFSET_M) ** 2) / (4.0 * FOCAL_LENGTH_M)
    x, y, z = FEED_M
    return Solid(vertices, solid.facets).move(x, y + OFFSET_M, z - FOCAL_LENGTH_M)


def _middle_m() -> Point:
    x, y, z = FEED_M
    return x, y + OFFSET_M, z - FOCAL_LENGTH_M + OFFSET_M**2 / (4.0 * FOCAL_LENGTH_M)


def _east() -> tuple[Solid, Solid, Solid, Solid]:
    """Return the two east reflectors, the ribs behind them, their arms and their feeds."""
    flat = 1e9  # focal length [m] at which a dish is a flat disc
    shell = _bend(dish(REFLECTOR_M, flat, 0.010, 10, 44))
    edge = 0.5 * REFLECTOR_M
    circle = [(edge * 0.62 * math.cos(a * DEG), edge * 0.62 * math.sin(a * DEG), -0.03) for a in range(0, 361, 15)]
    spoke = [(0.12 + k * (edge - 0.18) / 6, 0.0, -0.03) for k in range(7)]

    def turn(line: list[tuple[float, float, float]], angle: float) -> list[tuple[float, float, float]]:
        cos, sin = math.cos(angle * DEG), math.sin(angle * DEG)
        return [(cos * x - sin * y, sin * x + cos * y, z) for x, y, z in line]

    half = len(circle) // 2
    hoops = [pipe(circle[: half + 1], 0.022, 6), pipe(circle[half:], 0.022, 6)]
    ribs = join(*(_bend(solid) for solid in [*hoops, *(pipe(turn(spoke, 60.0 * k), 0.022, 6) for k in range(6))]))
    x, y, z = _middle_m()
    hub = _bend(box((0.40, 0.34, 0.10), (0.0, 0.0, -0.075)))
    elbow, foot = (x - 0.10, y - 0.70, z - 0.72), (x - 0.18, 0.98, -1.15)
    arm = join(
        tube((x, y, z - 0.10), elbow, 0.050, 12),
        tube(elbow, foot, 0.050, 12),
        tube((x - 0.45, 1.0, -0.55), elbow, 0.022, 8),
        cylinder(0.08, -0.10, 0.10, 16).turn("y", 90).move(*elbow),
        box((0.30, 0.16, 0.24), (x - 0.18, 1.06, -1.15)),
    )
    fx, fy, fz = FEED_M
    horns = [
        wall([(0.03, 0.0), (0.075, 0.26)], 0.006, 16).facing((0, 1.3, -1.75)).move(fx + dx, fy + dy - 0.05, fz + 0.10)
        for dx, dy in ((-0.10, -0.06), (0.08, -0.06), (-0.18, 0.08), (-0.01, 0.08), (0.16, 0.08))
    ]
    tower = box((0.50, 0.32, 0.42), (fx - 0.06, fy - 0.26, fz + 0.02))
    leg = box((0.20, 0.12, 0.40), (fx - 0.10, fy - 0.30, fz - 0.20))
    one_side = (shell, join(ribs, hub), arm, join(*horns, tower, leg))
    doubled = [join(solid, solid.mirror("x")) for solid in one_side]
    return doubled[0], doubled[1], doubled[2], doubled[3]


def _earth_deck() -> Solid:
    """Return the deck that faces the Earth with the tower between the feeds and the receivers' boxes."""
    deck = box((2.10, 1.95, 0.05), (0.0, 0.0, TOP_M + 0.02))
    boxes = [box((0.28, 0.36, 0.20), (x, y, TOP_M + 0.12)) for x, y in ((0.85, 0.0), (-0.85, 0.0), (0.0, 0.0))]
    sensor = [cylinder(0.09, TOP_M, TOP_M + 0.24, 20).move(x, 0.32 * x) for x in (-0.45, 0.45)]
    return join(deck, *boxes, *sensor)


def _steerable() -> Solid:
    """Return the two steerable dishes on the Earth deck, each on its gimbal with a feed on four struts."""
    reflector = dish(DISH_M, 0.42, 0.010, 7, 40)
    struts = [
        tube((0.48 * math.cos(a), 0.48 * math.sin(a), 0.14), (0.07 * math.cos(a), 0.07 * math.sin(a), 0.46), 0.008, 6)
        for a in (k * 90 * DEG + 45 * DEG for k in range(4))
    ]
    feed = frustum(0.05, 0.09, 0.40, 0.54, 16)
    hub = frustum(0.12, 0.20, -0.14, 0.01, 20)
    rim = torus(0.5 * DISH_M, 0.012, 40, 5).move(z=(0.5 * DISH_M) ** 2 / (4.0 * 0.42))
    one = join(reflector, rim, feed, hub, *struts)
    gimbal = join(box((0.24, 0.24, 0.16), (0, 0, -0.18)), cylinder(0.07, -0.50, -0.10, 16))
    return join(
        *(join(one.facing((side * 0.12, 0.10, 1.0)), gimbal).move(0.0, 0.58 * side, TOP_M + 0.50) for side in (-1, 1))
    )


def _omni() -> Solid:
    """Return the two command antennas: small horns on short masts, to the Earth and away from it."""
    horn = join(tube((0, 0, 0), (0, 0, 0.30), 0.020, 8), frustum(0.03, 0.06, 0.28, 0.42, 16))
    return join(horn.move(0.85, -0.80, TOP_M), horn.turn("x", 180).move(-0.85, 0.80, BOTTOM_M))


def _apogee_engine() -> Solid:
    """Return the bell of the apogee engine inside the interface ring."""
    profile = [(0.03, 0.0), (0.07, 0.06), (0.13, 0.20), (0.17, 0.40)]
    return join(wall(profile, 0.006, 32), cylinder(0.05, -0.10, 0.01, 20)).turn("x", 180).move(z=BOTTOM_M - 0.06)


def _thrusters() -> Solid:
    """Return the attitude thrusters: pairs of bells at the lower corners and on the east and west sides."""
    bell = frustum(0.015, 0.045, 0.0, 0.10, 12)
    below = [bell.turn("x", 180).move(x, y, BOTTOM_M + 0.01) for x in (-1.0, 1.0) for y in (-0.95, -0.83, 0.83, 0.95)]
    beside = [
        bell.facing((0, side, 0)).move(x, 1.04 * side, z)
        for side in (-1, 1)
        for x in (-1.0, 1.0)
        for z in (-1.35, 1.35)
    ]
    return join(*below, *beside)

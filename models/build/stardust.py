"""Stardust as it meets its comet: dust shields in front, two parallel solar wings, the return capsule open behind."""

from __future__ import annotations

import math
from itertools import pairwise

from models.build import stardust_capsule as capsule
from models.build.primitives import ball, box, cylinder, dish, frustum, lattice, prism, ring, tiles, torus, tube, wall
from rso_lidar.records import Hinge, Taxonomy
from rso_lidar.shapes import CraftModel, CraftPart, Point, Solid, join, pipe, skin

BUS_M = (1.70, 0.66, 0.66)
ANTENNA_M = 0.6
SHEET_STEP_M = 2 * 0.0254  # between the sheets of a dust shield: two inches

BACK_M, FRONT_M = -0.70, -0.70 + BUS_M[0]
DECK_M, FLOOR_M = 0.45, 0.45 - BUS_M[2]
SIDE_M = 0.5 * BUS_M[1]
DISH_M = (-0.04, 0.0, 0.325)  # vertex of the high-gain antenna
FOCAL_LENGTH_M = 0.16
WING_Z_M = 0.46
PANEL_M = (1.52, 0.90, 0.018)
PANEL_GAP_M = 0.065
PANEL_INNER_M = 0.49  # from the middle to the near edge of a wing
SHIELD_M = (1.13, 0.37)  # across a wing's dust shield, and its height


def stardust() -> CraftModel:
    """Return Stardust at its encounter: +x forward, to the dust shields, +z the antenna and the solar cells, +y left."""
    cells, substrate = _wing()
    pieces = {
        "bus": CraftPart(_bus(), "cfrp", 120.0),
        "shield_main": CraftPart(_main_shield(), "white_paint", 22.0),
        "shield_left": CraftPart(_wing_shield(), "white_paint", 6.0),
        "shield_right": CraftPart(_wing_shield().mirror("y"), "white_paint", 6.0),
        "solar_array_left": CraftPart(cells, "solar_cell_si", 6.0),
        "solar_array_right": CraftPart(cells.mirror("y"), "solar_cell_si", 6.0),
        "solar_substrate_left": CraftPart(substrate, "cfrp", 9.0),
        "solar_substrate_right": CraftPart(substrate.mirror("y"), "cfrp", 9.0),
        "solar_struts": CraftPart(_wing_struts(), "aluminium", 8.0),
        "antenna_high_gain": CraftPart(_high_gain_antenna(), "cfrp", 3.0),
        "feed": CraftPart(_feed(), "white_paint", 1.0),
        "antenna_medium_gain": CraftPart(_medium_gain_antenna(), "aluminium", 1.5),
        "antenna_low_gain": CraftPart(_low_gain_antennas(), "white_paint", 0.8),
        "capsule": CraftPart(capsule.cover(), "white_paint", 30.0),
        "capsule_struts": CraftPart(capsule.struts(), "aluminium", 3.0),
        "heat_shield": CraftPart(capsule.heat_shield(), "ablator", 11.0),
        "collector": CraftPart(capsule.collector(), "aluminium", 2.5),
        "aerogel": CraftPart(capsule.aerogel(), "white_paint", 0.5),
        "collector_arm": CraftPart(capsule.collector_arm(), "aluminium", 2.0),
        "camera": CraftPart(_camera(), "black_paint", 8.0),
        "dust_analyser": CraftPart(_dust_analyser(), "mli_silver", 12.0),
        "dust_monitor": CraftPart(_dust_monitor(), "aluminium", 1.0),
        "star_cameras": CraftPart(_star_cameras(), "black_paint", 4.0),
        "instruments": CraftPart(_boxes(), "mli_silver", 22.2),
        "thruster": CraftPart(_thrusters(), "aluminium", 5.5),
    }
    return CraftModel(
        name="stardust",
        what="Stardust, the comet-sample return of 1999, as at its encounter: capsule open, dust collector held out",
        source=(
            "NASA press kit for the comet encounter (December 2003): main bus of 1.7 m x 0.66 m x 0.66 m, the letter "
            "H with its two parallel wings; JPL missions page: 254 kg of spacecraft and 46 kg of return capsule; "
            "University of Washington, 'Project Stardust Facts, Figures, and Timeline': capsule about 30 in across "
            "and 20 in deep; JPL, 'Cool Facts': sheets of the dust shields 2 in apart; arrangement and all "
            "other proportions from pictures of NASA's public 3D model of Stardust"
        ),
        confidence=(
            "Bus, capsule depth, masses and the step of the shields published. The capsule's 0.81 m, its 60-degree "
            "cone, the 0.6 m antenna, the 6.6 m2 of the solar array and the 132 cells of aerogel (1039 cm2) are as "
            "commonly quoted, not looked up (medium). The six panels, the shields and everything else are read off "
            "pictures of NASA's public 3D model to about 5 cm and hold no better, but that the panels have room for "
            "the quoted cells; masses are a guessed split; materials are guesses."
        ),
        axes=(
            "+x forward, to the main dust shield, along the flight past the comet; +z the boresight of the high-gain "
            "antenna and where the solar cells face; +y left; origin inside the bus"
        ),
        pieces=pieces,
        taxonomy=Taxonomy(
            object_class="payload",
            subclass="sample_return",
            shape_family="box_wing",
            size_class="medium",
            stabilisation="three_axis",
            rate_deg_s=(0.0, 0.2),
        ),
        hinges=(
            Hinge(
                name="heat_shield",
                parts=("heat_shield",),
                position_m=capsule.HINGE_M,
                axis=(0.0, 1.0, 0.0),
                travel_deg=(0.0, capsule.OPEN_DEG),
            ),
            Hinge(
                name="collector",
                parts=("collector", "aerogel", "collector_arm"),
                position_m=(-0.99, 0.0, 0.35),
                axis=(0.0, 1.0, 0.0),
                normal=(1.0, 0.0, 0.0),
                travel_deg=(-180.0, 0.0),
            ),
        ),
    )


def _bus() -> Solid:
    """Return the long box with its edges, a well in its deck for the antenna, and the brackets that carry the wings."""
    half = 0.5 * ANTENNA_M + 0.02
    back, front = DISH_M[0] - half, DISH_M[0] + half
    outer = [
        box((stop - start, BUS_M[1] - 0.02, BUS_M[2] - 0.02), (0.5 * (start + stop), 0.0, 0.5 * (DECK_M + FLOOR_M)))
        for start, stop in ((BACK_M + 0.01, back), (front, FRONT_M - 0.01))
    ]
    depth = DISH_M[2] - 0.03 - FLOOR_M
    well = box((2.0 * half + 0.02, BUS_M[1] - 0.02, depth - 0.01), (DISH_M[0], 0.0, FLOOR_M + 0.01 + 0.5 * depth))
    walls = [
        box((2.0 * half + 0.02, 0.012, 0.20), (DISH_M[0], side * (SIDE_M - 0.016), DECK_M - 0.11)) for side in (-1, 1)
    ]
    lines = [0.5 * BUS_M[1] * (k / 8 - 1.0) for k in range(17)]
    centers = [0.5 * (a + b) for a, b in pairwise(lines)]
    hole = {(i, j) for i, x in enumerate(centers) for j, y in enumerate(centers) if math.hypot(x, y) < 0.5 * ANTENNA_M}
    deck = lattice(lines, lines, hole, 0.012).move(DISH_M[0], 0.0, DECK_M - 0.017)
    edges = [
        box((BUS_M[0], 0.03, 0.03), (0.5 * (BACK_M + FRONT_M), y, z))
        for y in (0.015 - SIDE_M, SIDE_M - 0.015)
        for z in (FLOOR_M + 0.015, DECK_M - 0.015)
    ]
    brackets = []
    for near, far, foot in ((BACK_M, BACK_M + 0.14, BACK_M + 0.30), (0.88, 0.74, 0.56)):
        plan = [(near, 0.30), (near, 0.56), (far, 0.56), (foot, 0.30)]
        brackets += [skin([[(x, side * y, z) for x, y in plan] for z in (0.36, 0.44)]) for side in (-1, 1)]
    return join(*outer, well, *walls, deck, *edges, *brackets)


def _octagon(half_width: float, low: float, high: float, cut: float) -> list[Point]:
    """Return a rectangular outline (y, z) with its corners cut off.

    Parameters
    ----------
    half_width : half of its extent along y [m]
    low, high : z of its lower and upper side [m]
    cut : length cut from each side at a corner [m]
    """
    return [
        (half_width, low + cut),
        (half_width, high - cut),
        (half_width - cut, high),
        (cut - half_width, high),
        (-half_width, high - cut),
        (-half_width, low + cut),
        (cut - half_width, low),
        (half_width - cut, low),
    ]


def _upright(outline: list[Point], back: float, front: float) -> Solid:
    """Return a plate with an outline in the y-z plane.

    Parameters
    ----------
    outline : points (y, z) [m]
    back, front : x of its faces [m]
    """
    return skin([[(x, y, z) for y, z in outline] for x in (back, front)])


def _main_shield() -> Solid:
    """Return the main dust shield: a blanketed catcher as wide as the capsule, and three round sheets before it."""
    catcher = _upright(_octagon(0.57, -0.38, 0.70, 0.22), 0.87, 1.10)
    crest = _upright([(0.16, 0.66), (0.10, 0.72), (-0.10, 0.72), (-0.16, 0.66)], 0.87, 1.10)
    sheets = [
        cylinder(0.43, -0.003, 0.003, 40).facing((1, 0, 0)).move(1.10 + k * SHEET_STEP_M, 0.0, capsule.MIDDLE_Z_M)
        for k in (1, 2)
    ]
    bumper = join(cylinder(0.43, -0.006, 0.006, 40), ring(0.40, 0.435, -0.012, 0.012, 40))
    posts = [
        tube(
            (1.09, 0.36 * y, capsule.MIDDLE_Z_M + 0.36 * z),
            (1.10 + 2.4 * SHEET_STEP_M, 0.36 * y, capsule.MIDDLE_Z_M + 0.36 * z),
            0.012,
        )
        for y, z in ((0.7, 0.7), (-0.7, 0.7), (0.7, -0.7), (-0.7, -0.7), (1.0, 0.0), (-1.0, 0.0))
    ]
    front = bumper.facing((1, 0, 0)).move(1.10 + 2.4 * SHEET_STEP_M, 0.0, capsule.MIDDLE_Z_M)
    return join(catcher, crest, *sheets, *posts, front)


def _panels() -> list[Point]:
    """Return the middles of the three panels of the left wing."""
    step = PANEL_M[0] + PANEL_GAP_M
    return [(k * step, PANEL_INNER_M + 0.5 * PANEL_M[1], WING_Z_M) for k in (-1, 0, 1)]


def _wing() -> tuple[Solid, Solid]:
    """Return the cells and the substrate of the left wing: three panels in line along the bus."""
    boards = [box(PANEL_M, place) for place in _panels()]
    field = tiles((PANEL_M[0] - 0.05, PANEL_M[1] - 0.05, 0.003), (10, 7), 0.008)
    cells = [field.move(x, y, z + 0.5 * PANEL_M[2]) for x, y, z in _panels()]
    gaps = [0.5 * side * (PANEL_M[0] + PANEL_GAP_M) for side in (-1, 1)]
    hinges = []
    for x in gaps:
        for y in (PANEL_INNER_M + 0.22, PANEL_INNER_M + 0.68):
            hinges += [box((PANEL_GAP_M + 0.08, 0.05, 0.012), (x, y, WING_Z_M - 0.012))]
            hinges += [tube((x, y - 0.08, WING_Z_M - 0.012), (x, y + 0.08, WING_Z_M - 0.012), 0.014)]
    ribs = [
        box((PANEL_M[0] - 0.1, 0.02, 0.012), (x, y + dy, z - 0.012)) for x, y, z in _panels() for dy in (-0.25, 0.25)
    ]
    return join(*cells), join(*boards, *hinges, *ribs)


def _wing_shield() -> Solid:
    """Return the left wing's dust shield: sheets one behind the other in a frame, under a blanket at their back."""
    back = 1.5 * PANEL_M[0] + PANEL_GAP_M + 0.05
    width, height = SHIELD_M
    middle = 0.905
    catcher = box((0.14, width, height), (back + 0.07, middle, WING_Z_M))
    sheets = [box((0.006, width, height), (back + 0.14 + k * SHEET_STEP_M, middle, WING_Z_M)) for k in (1, 2)]
    posts = [
        tube(
            (back + 0.13, middle + y, WING_Z_M + z),
            (back + 0.14 + 2 * SHEET_STEP_M, middle + y, WING_Z_M + z),
            0.010,
            6,
        )
        for y in (-0.50, 0.0, 0.50)
        for z in (-0.15, 0.15)
    ]
    clips = [box((0.12, 0.09, 0.014), (back - 0.03, PANEL_INNER_M + 0.09 + 0.18 * k, WING_Z_M)) for k in range(5)]
    return join(catcher, *sheets, *posts, *clips)


def _wing_struts() -> Solid:
    """Return the latches between the brackets of the bus and the middle panels."""
    latches = []
    for x in (BACK_M + 0.08, 0.80):
        for side in (-1, 1):
            latches += [
                box((0.10, 0.12, 0.03), (x, side * 0.56, 0.41)),
                tube((x - 0.07, side * 0.60, 0.435), (x + 0.07, side * 0.60, 0.435), 0.02),
            ]
            latches += [box((0.03, 0.10, 0.03), (x + dx, side * 0.64, 0.44)) for dx in (-0.05, 0.05)]
    return join(*latches)


def _high_gain_antenna() -> Solid:
    """Return the fixed dish, sunk into the deck up to its rim."""
    edge = 0.5 * ANTENNA_M
    shell = dish(ANTENNA_M - 0.01, FOCAL_LENGTH_M, 0.006, 8, 48)
    rim = torus(edge - 0.008, 0.008, 48, 6).move(z=(edge - 0.008) ** 2 / (4.0 * FOCAL_LENGTH_M))
    return join(shell, rim, ring(0.09, 0.12, -0.04, 0.02, 24)).move(*DISH_M)


def _feed() -> Solid:
    """Return the feed above the dish on its tripod."""
    foot, top = 0.24, 0.30
    low = foot**2 / (4.0 * FOCAL_LENGTH_M)
    legs = [tube((foot, 0.0, low), (0.02, 0.0, top), 0.009, 6).turn("z", 60.0 + turn) for turn in (0, 120, 240)]
    head = [frustum(0.028, 0.045, top - 0.03, top + 0.05, 16), cylinder(0.03, top + 0.04, top + 0.07, 12)]
    return join(*head, *legs).move(*DISH_M)


def _medium_gain_antenna() -> Solid:
    """Return the horn beside the bus, open upward."""
    horn = wall([(0.025, 0.06), (0.028, 0.12), (0.075, 0.45), (0.085, 0.48)], 0.006, 32)
    foot = join(cylinder(0.03, 0.03, 0.10, 16), box((0.08, 0.14, 0.03), (0.0, -0.04, 0.16)))
    return join(horn, foot).move(0.35, 0.40)


def _low_gain_antennas() -> Solid:
    """Return the two low-gain antennas on arms at the sides of the floor."""
    left = [
        tube((0.30, 0.32, -0.16), (0.30, 0.46, -0.16), 0.012, 6),
        cylinder(0.035, -0.20, -0.12, 16).move(0.30, 0.47),
    ]
    right = [
        tube((-0.64, -0.32, -0.16), (-0.64, -0.58, -0.16), 0.012, 6),
        box((0.05, 0.14, 0.07), (-0.64, -0.60, -0.16)),
    ]
    return join(*left, *right)


def _camera() -> Solid:
    """Return the navigation camera beside the bus, its periscope past the shield, and the mirror at its foot."""
    top: Point = (0.62, 0.40, 0.02)
    foot: Point = (0.24, 0.40, -0.32)
    barrel = join(tube(top, foot, 0.058, 24), tube((0.30, 0.40, -0.27), (0.27, 0.40, -0.295), 0.066, 24))
    head = tube((0.20, 0.40, -0.36), (0.145, 0.40, -0.41), 0.060, 24)
    prongs = [
        tube((0.24 + dx, 0.40 + dy, -0.32 - dx), (0.17 + dx, 0.40 + dy, -0.385 - dx), 0.006, 6)
        for dx, dy in ((0.035, 0.03), (0.035, -0.03), (-0.035, 0.03), (-0.035, -0.03))
    ]
    plan = [(0.44, 0.10), (0.52, 0.22), (0.70, 0.26), (0.83, 0.16), (0.83, 0.04), (0.60, 0.02)]
    housing = skin([[(x, y, z) for x, z in plan] for y in (0.31, 0.42)])
    return join(barrel, head, *prongs, housing)


def _dust_analyser() -> Solid:
    """Return the dust analyser on the right side: its drift tube, target, and electronics."""
    body = box((0.50, 0.16, 0.34), (0.05, -0.41, 0.28))
    funnel = skin(
        [
            [(x, -0.47 + sy * y, 0.02 + sz * z) for sy, sz in ((1, 1), (-1, 1), (-1, -1), (1, -1))]
            for x, y, z in ((0.22, 0.10, 0.12), (0.42, 0.14, 0.17))
        ]
    )
    drift = tube((-0.20, -0.46, 0.02), (0.24, -0.46, 0.02), 0.065, 20)
    pipe_m = pipe([(-0.20, -0.38, 0.10), (-0.24, -0.46, 0.10), (-0.16, -0.55, 0.08)], 0.025, 8)
    return join(body, funnel, drift, pipe_m)


def _dust_monitor() -> Solid:
    """Return the dust-flux monitor's discs and its frame on the front of the main shield."""
    x = 1.10 + 2.4 * SHEET_STEP_M + 0.008
    discs = [
        cylinder(radius, -0.004, 0.010, 28).facing((1, 0, 0)).move(x, y, z)
        for radius, y, z in ((0.08, 0.10, 0.33), (0.035, -0.12, 0.33))
    ]
    frame = lattice([-0.11, -0.09, 0.09, 0.11], [-0.11, -0.09, 0.09, 0.11], [(1, 1)], 0.012)
    return join(*discs, frame.facing((1, 0, 0)).move(x, 0.10, 0.33))


def _star_cameras() -> Solid:
    """Return the two star cameras that look down to either side of the floor."""
    cameras = []
    for x, way in ((-0.02, (0.25, 0.15, -1.0)), (0.16, (-0.25, -0.15, -1.0))):
        tubular = join(cylinder(0.035, -0.02, 0.06, 16), wall([(0.036, 0.05), (0.046, 0.12)], 0.005, 20))
        cameras.append(tubular.facing(way).move(x, 0.0, FLOOR_M + 0.01))
    return join(*cameras, box((0.34, 0.20, 0.03), (0.07, 0.0, FLOOR_M - 0.005)))


def _boxes() -> Solid:
    """Return the boxes and the radiators on the sides, the deck and the floor."""
    return join(
        box((0.44, 0.03, 0.36), (-0.02, 0.325, 0.18)),
        box((0.46, 0.03, 0.36), (-0.40, -0.325, 0.12)),
        box((0.20, 0.08, 0.16), (-0.16, 0.355, 0.30)),
        box((0.22, 0.20, 0.05), (0.62, 0.05, DECK_M + 0.01)),
        box((0.12, 0.26, 0.04), (-0.54, -0.05, DECK_M + 0.01)),
        box((0.48, 0.50, 0.03), (-0.40, 0.0, FLOOR_M - 0.005)),
        ball(0.03, (0.48, -0.20, DECK_M + 0.02), 1),
        tube((0.50, 0.22, DECK_M - 0.01), (0.50, 0.22, DECK_M + 0.10), 0.02, 10),
    )


def _thrusters() -> Solid:
    """Return the four clusters of thrusters on the floor: two sizes, two of each to a cluster."""
    large, small = frustum(0.010, 0.030, 0.0, 0.08, 14), frustum(0.006, 0.016, 0.0, 0.05, 10)
    plan = [(0.11, -0.05), (0.11, 0.02), (0.06, 0.05), (-0.11, 0.05), (-0.11, -0.05)]
    bells = [large.move(x, 0.0, 0.05) for x in (-0.075, 0.025)] + [small.move(x, 0.0, 0.05) for x in (-0.025, 0.075)]
    cluster = join(prism(plan, -0.02, 0.06), *bells).turn("x", 180)
    return join(*(cluster.move(x, y, FLOOR_M - 0.02) for x in (-0.54, 0.54) for y in (-0.24, 0.24)))

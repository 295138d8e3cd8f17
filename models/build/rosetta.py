"""Rosetta with Philae still aboard: a box between two wings of five panels, and a dish on a pole beside it."""

from __future__ import annotations

import math

from models.build import rosetta_payload as payload
from models.build.primitives import ball, box, cylinder, dish, frustum, ring, tiles, torus, tube
from models.build.solar_wings import wing_hinges
from rso_lidar.records import Hinge, Taxonomy
from rso_lidar.shapes import CraftModel, CraftPart, Point, Solid, join, pipe, skin

SPAN_M = 32.0  # from wing tip to wing tip
PANELS = 5
PANEL_M = (2.736, 2.25)  # along the wing, across
WING_M = 14.0
BUS_M = (2.1, 2.0, 2.8)
ANTENNA_M = 2.2
BOOMS_M = {"lower": 1.62, "upper": 2.24}  # from hinge to probe

PANEL_GAP_M = (WING_M - PANELS * PANEL_M[0]) / (PANELS - 1)
PANEL_THICKNESS_M = 0.022
WING_ROOT_M = 0.5 * SPAN_M - WING_M
HINGE_X_M, HINGE_Z_M = -0.115, -0.19  # of the wings
LANDER_SIDE_M, DISH_SIDE_M = -1.03, 1.07  # the faces -x and +x of the bus
TOP_M = 1.4
FOCAL_LENGTH_M = 1.25
VERTEX_M = (2.95, 0.0, -1.19)  # of the dish


def rosetta() -> CraftModel:
    """Return Rosetta as it cruises: +z the instruments, +x the high-gain antenna's side, -x Philae, +y the left wing."""
    cells, substrate, yoke = _wing()
    lower, upper = _boom("lower"), _boom("upper")
    pieces = {
        "bus": CraftPart(_bus(), "black_paint", 640.0),
        "louvers": CraftPart(_louvers(), "aluminium", 25.0),
        "adapter_ring": CraftPart(_adapter(), "aluminium", 20.0),
        "solar_array_left": CraftPart(cells, "solar_cell_si", 50.0),
        "solar_array_right": CraftPart(cells.mirror("y"), "solar_cell_si", 50.0),
        "solar_substrate_left": CraftPart(substrate, "cfrp", 55.0),
        "solar_substrate_right": CraftPart(substrate.mirror("y"), "cfrp", 55.0),
        "solar_yoke_left": CraftPart(yoke, "aluminium", 12.0),
        "solar_yoke_right": CraftPart(yoke.mirror("y"), "aluminium", 12.0),
        "antenna_high_gain": CraftPart(_reflector(), "white_paint", 35.0),
        "antenna_electronics": CraftPart(_antenna_back(), "black_paint", 20.0),
        "feed": CraftPart(_feed(), "cfrp", 5.0),
        "antenna_mast": CraftPart(_antenna_mast(), "cfrp", 15.0),
        "antenna_medium_gain": CraftPart(_medium_gain_antennas(), "white_paint", 3.0),
        "antenna_low_gain": CraftPart(_low_gain_antennas(), "white_paint", 2.0),
        "antenna_consert": CraftPart(_consert(), "cfrp", 3.0),
        "boom_plasma_lower": CraftPart(lower, "cfrp", 3.5),
        "boom_plasma_upper": CraftPart(upper, "cfrp", 4.5),
        "probes": CraftPart(_probes(), "aluminium", 2.0),
        "cameras": CraftPart(payload.cameras(), "mli_silver", 35.0),
        "lens": CraftPart(payload.lenses(), "lens_glass", 1.0),
        "microwave_dish": CraftPart(payload.microwave_dish(), "aluminium", 15.0),
        "instruments": CraftPart(payload.instruments(), "mli_silver", 110.0),
        "star_trackers": CraftPart(payload.star_trackers(), "black_paint", 8.0),
        "thruster": CraftPart(_thrusters(), "aluminium", 20.0),
        "thruster_brackets": CraftPart(_thruster_brackets(), "black_paint", 24.0),
        "hold_downs": CraftPart(_hold_downs(), "aluminium", 5.0),
        "philae": CraftPart(payload.lander(), "mli_silver", 85.0),
        "philae_cells": CraftPart(payload.lander_cells(), "solar_cell_si", 3.0),
        "philae_gear": CraftPart(payload.lander_gear(), "cfrp", 12.0),
    }
    return CraftModel(
        name="rosetta",
        what="Rosetta, the comet orbiter of 2004, with the lander Philae still aboard: two wings of five solar panels",
        source=(
            "ESA, 'Rosetta: Fact Sheet' (as cited by the encyclopedia entry 'Rosetta (spacecraft)'): box of 2.8 m x "
            "2.1 m x 2.0 m, wings of 14 m, 32 m from tip to tip; the entry: dry mass 1230 kg without the lander, "
            "high-gain antenna of 2.2 m; ESA, 'The Rosetta lander': Philae weighs 100 "
            "kg; hpde.io, Langmuir probes: two spheres of 5 cm, one on each boom; arrangement and all "
            "other proportions from pictures of NASA's public 3D model of Rosetta"
        ),
        confidence=(
            "Box, span, wing length, antennas and masses published. Panels of 2.25 m x 2.736 m and booms of 1.62 m "
            "and 2.24 m are as commonly quoted, not looked up (medium); five such panels fill the 14 m. NASA's "
            "public model draws them 2.6 m across and the dish 2.0 m; the figures above are kept. Philae is a "
            "metre wide, as commonly quoted. Yokes, mast, instruments, louvers and thrusters are read off pictures "
            "of NASA's public 3D model to about 5 cm and hold no better; masses are a guessed split of the dry mass; "
            "materials are guesses, the black outer blankets taken for black paint."
        ),
        axes=(
            "+z the normal of the instrument panel, launcher ring at -z; +x towards the high-gain antenna, -x towards "
            "Philae; +y along the left solar wing; solar cells and the antenna's boresight to -z in this pose; origin "
            "in the middle of the box, to within 0.02 m"
        ),
        pieces=pieces,
        taxonomy=Taxonomy(
            object_class="payload",
            subclass="planetary_orbiter",
            shape_family="box_wing",
            size_class="large",
            stabilisation="three_axis",
            rate_deg_s=(0.0, 0.1),
        ),
        hinges=(
            *wing_hinges(
                {"left": (HINGE_X_M, 1.02, HINGE_Z_M), "right": (HINGE_X_M, -1.02, HINGE_Z_M)},
                axis=(0.0, 1.0, 0.0),
                normal=(0.0, 0.0, -1.0),
            ),
            Hinge(
                name="antenna_elevation",
                parts=("antenna_high_gain", "antenna_electronics", "feed"),
                position_m=(1.78, 0.0, -1.24),
                axis=(0.0, 1.0, 0.0),
                normal=(0.0, 0.0, -1.0),
            ),
        ),
    )


def _bus() -> Solid:
    """Return the box, the deeper ends between which the lander sits, drives, and blankets over equipment."""
    _, width, height = BUS_M
    body = box(BUS_M, (0.5 * (DISH_SIDE_M + LANDER_SIDE_M), 0.0, 0.0))
    half = 0.5 * width - 0.03
    rear = [(LANDER_SIDE_M + 0.05, -0.42), (-1.32, -0.72), (-1.32, -1.33), (LANDER_SIDE_M + 0.05, -1.38)]
    front = [(LANDER_SIDE_M + 0.05, 0.50), (-1.37, 0.78), (-1.40, 1.37), (LANDER_SIDE_M + 0.05, 1.39)]
    keels = [skin([[(x, y, z) for x, z in outline] for y in (-half, half)]) for outline in (rear, front)]
    drives = [cylinder(0.11, 0.98, 1.16, 24).facing((0, y, 0)).move(HINGE_X_M, 0.0, HINGE_Z_M) for y in (-1, 1)]
    posts = [
        box((0.05, 0.05, height - 0.02), (x, y, 0.0))
        for x in (DISH_SIDE_M - 0.015, LANDER_SIDE_M + 0.015)
        for y in (-0.5 * width + 0.015, 0.5 * width - 0.015)
    ]
    return join(body, *keels, *drives, *posts)


def _louvers() -> Solid:
    """Return the louvers on the faces of the wings: six fields of blades on each."""
    blades = join(box((0.37, 0.57, 0.02)), tiles((0.33, 0.53, 0.014), (9, 2), 0.008, (0.0, 0.0, 0.014)))
    side = blades.turn("x", -90)
    places = ((0.67, -0.90), (0.28, -0.85), (-0.71, -0.87), (0.83, 1.04), (-0.58, 1.07), (-0.98, 1.04))
    left = join(*(side.move(x, 0.5 * BUS_M[1] + 0.008, z) for x, z in places))
    return join(left, left.mirror("y"))


def _adapter() -> Solid:
    """Return the ring that stood on the launcher, at the bottom of the box, with its bolts."""
    bolts = [cylinder(0.014, -TOP_M - 0.05, -TOP_M + 0.01, 8).move(0.505).turn("z", 15.0 * k) for k in range(24)]
    return join(ring(0.44, 0.53, -TOP_M - 0.035, -TOP_M + 0.01), ring(0.44, 0.47, -TOP_M - 0.06, -TOP_M, 48), *bolts)


def _wing() -> tuple[Solid, Solid, Solid]:
    """Return the cells, the substrate and the yoke of the left wing; cells look to -z."""
    length, width = PANEL_M
    centers = [WING_ROOT_M + (k + 0.5) * length + k * PANEL_GAP_M for k in range(PANELS)]
    boards = [box((width, length, PANEL_THICKNESS_M), (HINGE_X_M, y, HINGE_Z_M)) for y in centers]
    gaps = [y + 0.5 * (length + PANEL_GAP_M) for y in centers[:-1]]
    places = [HINGE_X_M + x for x in (-0.92, -0.35, 0.35, 0.92)]
    above = HINGE_Z_M + 0.5 * PANEL_THICKNESS_M
    hinges = [tube((x, y - 0.10, above), (x, y + 0.10, above), 0.020) for y in gaps for x in places]
    pins = [
        cylinder(0.045, above - 0.002, above + 0.03, 10).move(HINGE_X_M + x, y + dy)
        for y in centers
        for x in (-0.62, 0.62)
        for dy in (-0.75, 0.75)
    ]
    field = tiles((width - 0.14, length - 0.14, 0.003), (7, 8), 0.012)
    cells = [field.move(HINGE_X_M, y, HINGE_Z_M - 0.5 * PANEL_THICKNESS_M) for y in centers]
    bar = WING_ROOT_M - 0.10
    spar = box((width, 0.12, 0.035), (HINGE_X_M, bar, HINGE_Z_M))
    arms = [
        skin(
            [
                [(HINGE_X_M + side * x + dx, y, HINGE_Z_M + dz) for dx, dz in ((-w, -h), (w, -h), (w, h), (-w, h))]
                for x, y, w, h in ((0.02, 1.12, 0.06, 0.02), (0.85, bar, 0.06, 0.018))
            ]
        )
        for side in (-1, 1)
    ]
    links = [box((0.22, 0.14, 0.03), (HINGE_X_M + x, WING_ROOT_M - 0.03, HINGE_Z_M)) for x in (-0.80, 0.80)]
    hub = cylinder(0.07, 1.10, 1.22, 16).facing((0, 1, 0)).move(HINGE_X_M, 0.0, HINGE_Z_M)
    return join(*cells), join(*boards, *hinges, *pins), join(spar, *arms, *links, hub)


def _placed(solid: Solid) -> Solid:
    """Return what was drawn about the dish's vertex, boresight +z, where the dish stands."""
    return solid.facing((0, 0, -1)).move(*VERTEX_M)


def _reflector() -> Solid:
    """Return the dish with its rim and the ribs behind it."""
    shell = dish(ANTENNA_M - 0.03, FOCAL_LENGTH_M, 0.012, 8, 56)
    edge = 0.5 * ANTENNA_M
    rim = torus(edge - 0.016, 0.016, 56, 6).move(z=(edge - 0.016) ** 2 / (4.0 * FOCAL_LENGTH_M))
    radii = [0.30 + 0.16 * k for k in range(5)]
    ribs = [
        pipe([(r, 0.0, r * r / (4.0 * FOCAL_LENGTH_M) - 0.020) for r in radii], 0.016, 4).turn("z", 22.5 + 45.0 * k)
        for k in range(8)
    ]
    return _placed(join(shell, rim, *ribs))


def _antenna_back() -> Solid:
    """Return the blanketed box of electronics behind the dish."""
    plan = [(-0.85, -0.25), (-0.10, -0.62), (0.70, -0.50), (0.70, 0.50), (-0.10, 0.62), (-0.85, 0.25)]
    flat = [[(x * w, y * w, z) for x, y in plan] for z, w in ((-0.005, 1.0), (0.10, 1.0), (0.17, 0.85))]
    return skin([[(VERTEX_M[0] + x, y, VERTEX_M[2] + z) for x, y, z in outline] for outline in flat])


def _feed() -> Solid:
    """Return the feed, and the subreflector on three pairs of struts."""
    horn = frustum(0.075, 0.05, -0.01, 0.20, 20)
    plate = frustum(0.15, 0.10, 0.62, 0.67, 24)
    cap = cylinder(0.05, 0.66, 0.71, 12)
    foot = 0.62
    struts = [
        tube((foot, 0.0, foot**2 / (4.0 * FOCAL_LENGTH_M)), (0.13, 0.05 * side, 0.64), 0.012, 6).turn("z", turn)
        for turn in (0, 120, 240)
        for side in (-1, 1)
    ]
    return _placed(join(horn, plate, cap, *struts))


def _antenna_mast() -> Solid:
    """Return the tripod on the +x face with the two-axis pointing mechanism at its top, and two launch locks."""
    top: Point = (1.68, 0.0, -1.28)
    foot = DISH_SIDE_M - 0.01
    legs = [tube((foot, y, -1.30), top, 0.040, 10) for y in (-0.88, 0.88)]
    back = [tube((foot, 0.0, -1.32), top, 0.035, 10), tube((foot, 0.0, -0.38), top, 0.030, 10)]
    gimbal = join(
        box((0.22, 0.20, 0.20), (1.78, 0.0, -1.27)),
        cylinder(0.07, -0.16, 0.16, 16).facing((0, 1, 0)).move(1.78, 0.0, -1.24),
    )
    arm = tube((1.80, 0.0, -1.24), (2.45, 0.0, -1.17), 0.055, 12)
    locks = []
    for y in (-0.62, 0.62):
        head: Point = (1.38, y, -0.42)
        feet = ((foot, 0.55 * y, -0.86), (foot, 1.35 * y, -0.40), (foot, 0.75 * y, -0.30))
        locks += [tube(place, head, 0.026, 8) for place in feet] + [ball(0.05, head, 1)]
    return join(*legs, *back, gimbal, arm, *locks)


def _medium_gain_antennas() -> Solid:
    """Return the two medium-gain antennas on the +x face: a disc of seven patches, and a small dish with its feed."""
    patches = [cylinder(0.045, 0.03, 0.045, 12).move(0.11).turn("z", 60.0 * k) for k in range(6)]
    disc = join(
        cylinder(0.18, 0.0, 0.035, 28), cylinder(0.045, 0.03, 0.045, 12), *patches, cylinder(0.06, -0.08, 0.01, 16)
    )
    feed = tube((0.19, 0.0, 0.06), (0.02, 0.0, 0.17), 0.014, 6)
    small = join(
        dish(0.38, 0.15, 0.008, 5, 28), feed, ball(0.03, (0.02, 0.0, 0.17), 1), cylinder(0.05, -0.10, 0.01, 12)
    )
    return join(
        disc.facing((1, 0, 0)).move(DISH_SIDE_M + 0.06, 0.62, 1.18),
        small.facing((1, 0, 0.2)).move(DISH_SIDE_M + 0.08, -0.72, 1.18),
    )


def _low_gain_antennas() -> Solid:
    """Return the two low-gain antennas: cones on stubs at opposite corners."""
    cone = join(cylinder(0.02, -0.05, 0.12, 10), frustum(0.05, 0.07, 0.11, 0.20, 20))
    return join(cone.move(0.95, 0.75, TOP_M), cone.facing((0, 0, -1)).move(0.85, -0.62, -TOP_M))


def _consert() -> Solid:
    """Return the sounding antenna that swings out beside the right wing: an arm with a cross at each end."""
    x, root, tip, near, far = 0.55, -0.98, -2.20, 1.42, 2.66
    arms = [tube((x, root, near), (x, tip, near), 0.018), tube((x, tip, near - 0.02), (x, tip, far), 0.020)]
    crosses = [
        tube((x - 0.45, tip - side * 0.45, z), (x + 0.45, tip + side * 0.45, z), 0.016, 6)
        for z in (near, far)
        for side in (-1, 1)
    ]
    return join(*arms, *crosses, box((0.16, 0.10, 0.16), (x, -1.00, near - 0.08)))


# Where each plasma boom is hinged [m], and which way it points.
_BOOM_ROOT = {"lower": (-1.28, 0.80, -1.34), "upper": (-1.36, 0.90, 1.15)}
_BOOM_WAY = {"lower": (-1.42, 0.98, -0.40), "upper": (-1.62, 0.36, 1.36)}


def _boom_tip(name: str) -> Point:
    """Return where the probe of a plasma boom is [m]."""
    way = _BOOM_WAY[name]
    share = BOOMS_M[name] / math.hypot(*way)
    return tuple(place + share * step for place, step in zip(_BOOM_ROOT[name], way, strict=True))


def _boom(name: str) -> Solid:
    """Return a plasma boom: a tube that thins in three steps, with its hinge."""
    root, tip = _BOOM_ROOT[name], _boom_tip(name)

    def at(share: float) -> Point:
        return tuple(a + share * (b - a) for a, b in zip(root, tip, strict=True))

    steps = [(0.0, 0.62, 0.034), (0.60, 0.82, 0.022), (0.80, 0.98, 0.010)]
    return join(*(tube(at(a), at(b), radius, 10) for a, b, radius in steps), box((0.18, 0.14, 0.14), root))


def _probes() -> Solid:
    """Return the spheres at the tips of the booms, and the bar with four electrodes along the upper boom."""
    spheres = [ball(0.025, _boom_tip(name), 2) for name in BOOMS_M]
    root, tip = _BOOM_ROOT["upper"], _boom_tip("upper")
    electrodes = []
    for share in (0.68, 0.76, 0.84, 0.92):
        x, y, z = (a + share * (b - a) for a, b in zip(root, tip, strict=True))
        electrodes += [tube((x, y - 0.01, z), (x - 0.03, y + 0.20, z - 0.03), 0.010, 6)]
    return join(*spheres, *electrodes)


_CORNERS = [(x, y, z) for x in (0.98, -1.18) for y in (-0.98, 0.98) for z in (-1.27, 0.95)]


def _thruster_brackets() -> Solid:
    """Return the blanketed feet of the thrusters at eight corners."""
    return join(*(box((0.20, 0.16, 0.22), place) for place in _CORNERS))


def _thrusters() -> Solid:
    """Return the 24 thrusters of 10 N: three bells on each foot."""
    bell = frustum(0.012, 0.045, 0.0, 0.11, 14)
    bells = []
    for x, y, z in _CORNERS:
        out_x, out_y, out_z = (math.copysign(1.0, value) for value in (x, y, z))
        bells += [
            bell.facing((0.0, out_y, 0.3 * out_z)).move(x + 0.04, y + 0.07 * out_y, z),
            bell.facing((0.0, out_y, -0.3 * out_z)).move(x - 0.05, y + 0.07 * out_y, z),
            bell.facing((0.25 * out_x, 0.3 * out_y, -1.0)).move(x, y + 0.03 * out_y, z - 0.10),
        ]
    return join(*bells)


def _hold_downs() -> Solid:
    """Return the hold-downs that kept the folded wings on the sides."""
    foot = join(box((0.06, 0.06, 0.12), (0.0, 0.05, 0.0)), box((0.10, 0.03, 0.10), (0.0, 0.12, 0.0)))
    left = [foot.move(x, 0.98, z) for x in (0.73, 0.52, -0.47, -0.70) for z in (-1.26, -0.37, 0.53)]
    side = join(*(piece for k, piece in enumerate(left) if k % 3 != 1 or k in (4, 7)))
    return join(side, side.mirror("y"))

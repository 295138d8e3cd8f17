"""Juno: a spinning hexagon with three solar wings and an antenna that looks along the spin axis."""

from __future__ import annotations

import math

from models.build.primitives import ball, box, cylinder, frustum, prism, revolve, ring, tiles, torus, tube, wall
from rso_lidar.records import Taxonomy
from rso_lidar.shapes import CraftModel, CraftPart, Point, Solid, join, pipe
from rso_lidar.units import DEG

TIP_CIRCLE_M = 20.1  # swept by the corners of the full wings
WING_WIDTH_M = 2.65
BUS_RADIUS_M = 1.75  # to the corners of the hexagon, 3.5 m across
BUS_FLAT_M = BUS_RADIUS_M * math.cos(30.0 * DEG)
ANTENNA_RADIUS_M = 1.25  # 2.5 m high-gain antenna
DECK_M, FLOOR_M = 0.15, -1.45

PANEL_THICKNESS_M = 0.03
HINGE_M = BUS_FLAT_M + 0.07
WING_END_M = math.sqrt((0.5 * TIP_CIRCLE_M) ** 2 - (0.5 * WING_WIDTH_M) ** 2)
PANEL_GAP_M = 0.06
PANEL_LENGTH_M = (WING_END_M - HINGE_M - 3 * PANEL_GAP_M) / 4
ROOT_WIDTH_M = 2.25  # the innermost panel is narrower
BOOM_REACH_M = 11.5


def juno() -> CraftModel:
    """Return Juno as it flies: +z the spin axis and the antenna's boresight, +x the wing with the magnetometer boom."""
    pieces = {
        "bus": CraftPart(_bus(), "mli_gold", 950.0),
        "vault": CraftPart(_vault(), "aluminium", 200.0),
        "louvers": CraftPart(_louvers(), "aluminium", 5.0),
        "antenna_high_gain": CraftPart(_high_gain_antenna(), "white_paint", 40.0),
        "antenna_struts": CraftPart(_antenna_struts(), "cfrp", 8.0),
        "antenna_microwave": CraftPart(_microwave_radiometer(), "white_paint", 45.0),
        "antenna_waves": CraftPart(_waves(), "aluminium", 2.0),
        "instruments": CraftPart(_instruments(), "mli_silver", 45.0),
        "boom_magnetometer": CraftPart(_magnetometer_boom(), "cfrp", 12.0),
        "magnetometer": CraftPart(_magnetometers(), "mli_silver", 6.0),
        "thruster_towers": CraftPart(_towers(), "mli_gold", 20.0),
        "thruster": CraftPart(_thrusters(), "aluminium", 6.0),
        "adapter_ring": CraftPart(ring(0.60, 0.66, FLOOR_M - 0.14, FLOOR_M + 0.01), "aluminium", 20.0),
        "main_engine": CraftPart(_main_engine(), "aluminium", 8.0),
    }
    for name, turn, panels in (("x", 0, 3), ("left", 120, 4), ("right", 240, 4)):
        pieces[f"solar_array_{name}"] = CraftPart(_cells(panels).turn("z", turn), "solar_cell", 8.0 * panels)
        pieces[f"solar_substrate_{name}"] = CraftPart(_substrate(panels).turn("z", turn), "cfrp", 12.0 * panels)
        pieces[f"solar_struts_{name}"] = CraftPart(_wing_struts().turn("z", turn), "cfrp", 3.0)
    return CraftModel(
        name="juno",
        what="Juno, the Jupiter orbiter of 2011: hexagonal bus, eleven solar panels in three wings, magnetometer boom",
        source=(
            "JPL Photojournal PIA13928: wings 2.65 m by 8.9 m; Spaceflight 101, Juno Spacecraft Information: body"
            " 3.5 m across and 3.5 m tall, 2.5 m high-gain antenna; encyclopedia entry: 20.1 m span, 4.6 m high, "
            "dry mass 1593 kg; proportions of booms and instruments compared by eye with NASA's public 3D model "
            "of Juno"
        ),
        confidence=(
            "Span, wing width, bus width and antenna diameter published. The published span (20.1 m circle) and "
            "wing length (8.9 m from the hinge) cannot both hold beside a 3.5 m bus: the span is kept and the "
            "wings are 8.4 m long. Height of the bus, instruments, struts and booms are guesses from pictures. "
            "Masses are a guessed split of the dry mass. Materials are guesses."
        ),
        axes=(
            "+z spin axis and boresight of the high-gain antenna, solar cells face +z; +x along the wing that "
            "carries the magnetometer boom; +y completes them; origin on the spin axis at the plane of the wings"
        ),
        pieces=pieces,
        taxonomy=Taxonomy(
            object_class="payload",
            subclass="planetary_orbiter",
            shape_family="box_wing",
            size_class="large",
            stabilisation="spin",
            rate_deg_s=(6.0, 30.0),
        ),
    )


def _bus() -> Solid:
    """Return the six-sided body with flat faces to the wings, decks that stand out a little, and boxes below."""
    body = _hexagon(BUS_RADIUS_M - 0.02, FLOOR_M, DECK_M)
    decks = [_hexagon(BUS_RADIUS_M, z - 0.03, z) for z in (DECK_M + 0.01, FLOOR_M + 0.02)]
    return join(body, *decks, _floor_boxes())


def _hexagon(radius: float, low: float, high: float) -> Solid:
    """Return a hexagonal prism about +z.

    Parameters
    ----------
    radius : to the corners [m]
    low, high : z of the ends [m]
    """
    corners = [(radius * math.cos(a * DEG), radius * math.sin(a * DEG)) for a in range(30, 390, 60)]
    return prism(corners, low, high)


def _floor_boxes() -> Solid:
    places = [
        ((0.30, 0.22, 0.16), (-0.95, 0.45)),
        ((0.22, 0.22, 0.24), (0.95, -0.55)),
        ((0.26, 0.16, 0.12), (0.25, 1.10)),
    ]
    return join(*(box(size, (x, y, FLOOR_M - 0.4 * size[2])) for size, (x, y) in places))


def _vault() -> Solid:
    """Return the titanium electronics vault on the top deck."""
    return box((1.0, 1.0, 0.66), (0.0, 0.0, DECK_M + 0.32))


def _louvers() -> Solid:
    """Return the louvers on the sides of the vault."""
    blades = [
        box((0.02, 0.34, 0.035), (0.515, y, DECK_M + 0.12 + 0.062 * k)).turn("z", turn)
        for turn in (0, 90, 180, 270)
        for y in (-0.22, 0.22)
        for k in range(8)
    ]
    return join(*blades)


def _high_gain_antenna() -> Solid:
    """Return the high-gain antenna under its radome: a bowl below, a hollow-sided cone above."""
    bowl = [(0.0, 0.98), (0.42, 1.00), (0.85, 1.14), (1.18, 1.34), (ANTENNA_RADIUS_M, 1.41)]
    cone = [
        (ANTENNA_RADIUS_M, 1.47),
        (1.02, 1.55),
        (0.72, 1.64),
        (0.44, 1.74),
        (0.26, 1.84),
        (0.14, 1.895),
        (0.0, 1.91),
    ]
    return revolve([*bowl, *cone], 64)


def _antenna_struts() -> Solid:
    """Return the hexapods between the deck, the vault and the antenna."""
    legs = []
    for turn in range(0, 360, 60):
        legs += [tube((0.66, side * 0.30, DECK_M), (0.80, 0.0, 1.16), 0.018, 6).turn("z", turn) for side in (-1, 1)]
    foot = torus(0.74, 0.02, 36, 6).move(z=1.10)
    return join(*legs, foot)


def _panel(number: int) -> tuple[float, float]:
    """Return where the centre of a panel lies from the spin axis, and its width [m]."""
    center = HINGE_M + number * (PANEL_LENGTH_M + PANEL_GAP_M) + 0.5 * PANEL_LENGTH_M
    return center, ROOT_WIDTH_M if number == 0 else WING_WIDTH_M


def _cells(panels: int) -> Solid:
    fields = []
    for number in range(panels):
        center, width = _panel(number)
        size = (PANEL_LENGTH_M - 0.06, width - 0.06, 0.003)
        fields.append(tiles(size, (8, 6), 0.012, (center, 0.0, 0.5 * PANEL_THICKNESS_M)))
    return join(*fields)


def _substrate(panels: int) -> Solid:
    """Return the panels of one wing without their cells, and the hinges between them."""
    boards, hinges = [], []
    for number in range(panels):
        center, width = _panel(number)
        boards.append(box((PANEL_LENGTH_M, width, PANEL_THICKNESS_M), (center, 0.0, 0.0)))
        root = center - 0.5 * PANEL_LENGTH_M
        hinges += [tube((root - 0.10, y, -0.005), (root + 0.06, y, -0.005), 0.022) for y in (-0.75, 0.75)]
    return join(*boards, *hinges)


def _wing_struts() -> Solid:
    """Return the struts that hold one wing up from the floor of the bus."""
    end = HINGE_M + PANEL_LENGTH_M + 0.5 * PANEL_GAP_M
    knee: Point = (BUS_FLAT_M + 0.95, 0.35, -0.52)
    bars = [
        tube((BUS_FLAT_M - 0.02, 0.35, -1.10), knee, 0.022),
        tube(knee, (end - 0.15, -0.75, -0.03), 0.022),
        tube(knee, (end - 0.15, 0.75, -0.03), 0.022),
        tube((end - 0.15, -0.75, -0.05), (end - 0.15, 0.75, -0.05), 0.020),
    ]
    return join(*bars, ball(0.045, knee, 1))


def _magnetometer_boom() -> Solid:
    """Return the open frame beyond the third panel of the +x wing: two beams that narrow in two stages to the tip."""
    start = _panel(2)[0] + 0.5 * PANEL_LENGTH_M + 0.05
    waist, tip = start + 1.55, BOOM_REACH_M - 0.10
    beams = []
    for side in (-1, 1):
        line = [(start, 0.82 * side, 0.0), (start + 0.45, 0.70 * side, 0.0), (waist - 0.35, 0.66 * side, 0.0)]
        line += [(waist, 0.46 * side, 0.0), (tip, 0.10 * side, 0.0)]
        beams.append(pipe(line, 0.065, 4))
        beams.append(tube((start - 0.15, 0.62 * side, 0.0), (start + 0.10, 0.62 * side, 0.0), 0.025))
    rungs = [
        tube((x, -y, 0.0), (x, y, 0.0), 0.045, 4)
        for x, y in ((start, 0.86), (waist, 0.46), (tip - 0.6, 0.19), (tip, 0.12))
    ]
    braces = [tube((waist - 0.40, 0.66 * side, 0.0), (waist + 0.02, 0.06 * side, 0.0), 0.045, 4) for side in (-1, 1)]
    return join(*beams, *rungs, *braces)


def _magnetometers() -> Solid:
    """Return the two magnetometers with their star cameras: one in the middle of the boom, one at its tip."""
    return join(
        box((0.24, 0.30, 0.10), (9.72, 0.0, -0.08)),
        tube((9.72, 0.10, -0.10), (9.72, 0.16, -0.32), 0.05, 12),
        tube((9.72, -0.10, -0.10), (9.72, -0.16, -0.32), 0.05, 12),
        box((0.20, 0.24, 0.10), (BOOM_REACH_M - 0.10, 0.0, -0.08)),
        tube((BOOM_REACH_M - 0.12, 0.08, -0.10), (BOOM_REACH_M - 0.12, 0.13, -0.30), 0.045, 12),
        tube((BOOM_REACH_M - 0.12, -0.08, -0.10), (BOOM_REACH_M - 0.12, -0.13, -0.30), 0.045, 12),
    )


def _microwave_radiometer() -> Solid:
    """Return the microwave radiometer's antennas: the largest fills the face at -x, the smaller ones share another."""
    largest = tiles((1.52, 1.52, 0.06), (5, 5), 0.05).facing((-1, 0, 0)).move(x=-BUS_FLAT_M, z=-0.66)
    frame = box((0.05, 1.60, 1.56), (-BUS_FLAT_M - 0.005, 0.0, -0.66))
    second = tiles((0.78, 0.78, 0.06), (4, 4), 0.03).facing((1, 0, 0)).move(BUS_FLAT_M, -0.38, -0.95)
    third = box((0.05, 0.72, 0.72), (BUS_FLAT_M, 0.42, -0.95))
    fourth = box((0.05, 0.40, 0.40), (BUS_FLAT_M, 0.40, -0.28))
    fifth = box((0.05, 0.28, 0.28), (BUS_FLAT_M, -0.10, -0.28))
    horn = frustum(0.05, 0.10, 0.0, 0.30, 20).facing((0.5, -0.87, 0.35)).move(0.62, -1.10, DECK_M + 0.10)
    return join(largest, frame, join(second, third, fourth, fifth).turn("z", 60), horn)


def _waves() -> Solid:
    """Return the two whips of the plasma-wave instrument below the magnetometer wing, 4.8 m from tip to tip."""
    whips = [tube((1.38, 0.15 * side, -1.46), (2.34, 2.40 * side, -2.30), 0.012, 6) for side in (-1, 1)]
    return join(*whips, box((0.16, 0.42, 0.12), (1.34, 0.0, -1.48)))


def _instruments() -> Solid:
    """Return boxes and heads of instruments on the top deck and on the sides."""
    deck = DECK_M - 0.01
    boxes = [
        box((0.40, 0.30, 0.20), (-0.75, 0.95, deck + 0.10)),
        box((0.26, 0.34, 0.16), (0.85, 0.75, deck + 0.08)),
        box((0.30, 0.22, 0.14), (-1.05, -0.55, deck + 0.07)),
        box((0.20, 0.20, 0.24), (0.10, -1.15, deck + 0.12)),
        box((0.50, 0.36, 0.34), (-0.60, -1.05, deck + 0.17)).turn("z", 8),
    ]
    heads = [
        cylinder(0.075, 0.0, 0.24, 16).facing((-0.5, -0.87, 0.1)).move(x, y, 0.40)
        for x, y in ((-0.78, -1.15), (-0.55, -1.30))
    ]
    domes = [
        join(cylinder(0.05, deck, deck + 0.16, 12).move(x, y), ball(0.11, (x, y, deck + 0.22)))
        for x, y in ((-0.10, 1.22), (1.05, -0.62))
    ]
    camera = tube((0.55, 1.30, -0.60), (0.66, 1.50, -0.62), 0.09, 16)
    return join(*boxes, *heads, *domes, camera)


def _tower(x: float, y: float, low: float, high: float) -> Solid:
    """Return a thruster tower: a square post with a box at its free end.

    Parameters
    ----------
    x, y : of the post [m]
    low, high : z of its ends [m]
    """
    return join(
        box((0.11, 0.11, high - low), (x, y, 0.5 * (low + high))),
        box((0.18, 0.18, 0.06), (x, y, low if low > -1 else high)),
    )


def _towers() -> Solid:
    """Return the four posts that hold the thrusters clear of the wings, two above and two below."""
    above = [_tower(0.0, side * 1.50, DECK_M - 0.02, 0.88) for side in (-1, 1)]
    below = [_tower(0.0, side * 1.50, -1.78, FLOOR_M + 0.02) for side in (-1, 1)]
    return join(*above, *below)


def _thrusters() -> Solid:
    """Return the twelve attitude thrusters, three bells at the end of each post."""
    bell = frustum(0.012, 0.040, 0.03, 0.13, 12)
    bells = []
    for side in (-1, 1):
        for z, up in ((0.84, 1), (-1.74, -1)):
            bells += [
                bell.facing(way).move(0.0, side * 1.50, z) for way in ((1, 0, 0), (-1, 0, 0), (0, side, 0.4 * up))
            ]
    return join(*bells)


def _main_engine() -> Solid:
    """Return the main engine's thin bell below the floor, and the hinged cover beside it."""
    bell = wall([(0.05, FLOOR_M + 0.10), (0.045, FLOOR_M), (0.12, -1.62), (0.19, -1.78), (0.235, -1.93)], 0.008)
    neck = cylinder(0.07, FLOOR_M - 0.02, FLOOR_M + 0.08, 20)
    cover = frustum(0.33, 0.30, -1.53, -1.49, 32).move(0.10, -0.98)
    return join(bell, neck, cover, tube((0.05, -0.60, -1.46), (0.08, -0.80, -1.51), 0.03))

"""TDRS of the second generation (H, I, J): a Boeing 601 bus with two springback antennas and two solar wings."""

from __future__ import annotations

import math

from models.build.primitives import ball, box, cylinder, dish, dome, frustum, lattice, ring, tiles, torus, tube
from models.build.solar_wings import wing_hinges
from rso_lidar.records import Taxonomy
from rso_lidar.shapes import CraftModel, CraftPart, Solid, join, pipe
from rso_lidar.units import DEG

SPAN_M = 20.98  # 68 ft 10 in across the solar wings
WIDTH_M = 13.23  # 43 ft 5 in across the single-access antennas
REFLECTOR_M = 4.572  # 15 ft
FOCAL_LENGTH_M = 1.60

BUS_M = (2.30, 2.30, 2.30)
BUS_TOP_M, BUS_BOTTOM_M = 1.10, -1.20
PANEL_M = (2.70, 2.30, 0.025)
PANEL_GAP_M = 0.12
VERTEX_M = (0.0, 0.5 * (WIDTH_M - REFLECTOR_M), 1.25)  # of the east reflector


def tdrs() -> CraftModel:
    """Return a second-generation TDRS as it flies: +x north (a solar wing), +y east (an antenna), +z to the Earth."""
    cells, substrate, yoke = _wing()
    pieces = {
        "bus": CraftPart(_bus(), "mli_gold", 1080.0),
        "radiator_north": CraftPart(_radiator(), "osr", 15.0),
        "radiator_south": CraftPart(_radiator().turn("z", 180), "osr", 15.0),
        "solar_array_north": CraftPart(cells, "solar_cell_si", 35.0),
        "solar_array_south": CraftPart(cells.turn("z", 180), "solar_cell_si", 35.0),
        "solar_substrate_north": CraftPart(substrate, "cfrp", 45.0),
        "solar_substrate_south": CraftPart(substrate.turn("z", 180), "cfrp", 45.0),
        "solar_yoke_north": CraftPart(yoke, "cfrp", 8.0),
        "solar_yoke_south": CraftPart(yoke.turn("z", 180), "cfrp", 8.0),
        "antenna_single_access_east": CraftPart(_reflector().move(*VERTEX_M), "cfrp", 25.0),
        "antenna_single_access_west": CraftPart(_reflector().move(*VERTEX_M).turn("z", 180), "cfrp", 25.0),
        "feed_single_access_east": CraftPart(_feed().move(*VERTEX_M), "white_paint", 20.0),
        "feed_single_access_west": CraftPart(_feed().move(*VERTEX_M).turn("z", 180), "white_paint", 20.0),
        "boom_single_access_east": CraftPart(_antenna_boom(), "cfrp", 30.0),
        "boom_single_access_west": CraftPart(_antenna_boom().turn("z", 180), "cfrp", 30.0),
        "antenna_multiple_access": CraftPart(_multiple_access(), "white_paint", 60.0),
        "antenna_space_ground": CraftPart(_space_ground_link(), "white_paint", 15.0),
        "boom_space_ground": CraftPart(_space_ground_boom(), "cfrp", 8.0),
        "boom_omni": CraftPart(tube((1.05, 0.8, 0.95), (6.15, 0.8, 4.20), 0.025), "cfrp", 5.0),
        "antenna_omni": CraftPart(_omni(), "aluminium", 3.0),
        "adapter_ring": CraftPart(_adapter(), "aluminium", 35.0),
        "thruster": CraftPart(_thrusters(), "aluminium", 8.0),
        "apogee_engine": CraftPart(_apogee_engine(), "aluminium", 10.0, hollow=True),
    }
    return CraftModel(
        name="tdrs",
        what="Tracking and Data Relay Satellite of the second generation (TDRS H, I, J), on a Boeing 601 bus",
        source=(
            "Boeing, 'Ready to Fly', media release of 4 March 2002: 68 ft 10 in (20.98 m) long, 43 ft 5 in (13.23"
            " m) wide, reflectors of 15 ft (4.57 m); TBS Satellite, TDRS 8, 9 and 10 specifications: 21 m span, "
            "1670 kg in orbit, 1500 kg dry; proportions of bus, panels and booms compared by eye with NASA's "
            "public 3D model of TDRS"
        ),
        confidence=(
            "Spans and reflector diameter published. Bus size, panel layout, focal length (f/D 0.35), the count "
            "and places of the phased array's elements, booms and feeds are guesses from pictures. Masses are "
            "split by guess so that they sum to between the published dry mass and mass in orbit. Materials are "
            "guesses."
        ),
        axes=(
            "+x north, along the solar wings; +y east, towards one single-access antenna; +z to the Earth, the "
            "boresight of the antennas in this pose; solar cells face +z; origin inside the bus"
        ),
        pieces=pieces,
        taxonomy=Taxonomy(
            object_class="payload",
            subclass="relay_satellite",
            shape_family="box_wing",
            size_class="large",
            stabilisation="three_axis",
            rate_deg_s=(0.0, 0.01),
        ),
        hinges=wing_hinges(
            {"north": (1.36, 0.0, 0.0), "south": (-1.36, 0.0, 0.0)}, axis=(1.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0)
        ),
    )


def _bus() -> Solid:
    """Return the bus box with four feet, a shoulder for each antenna boom and the drives of the solar wings."""
    body = box(BUS_M, (0.0, 0.0, 0.5 * (BUS_TOP_M + BUS_BOTTOM_M)))
    feet = [box((0.16, 0.16, 0.30), (x, y, BUS_BOTTOM_M - 0.10)) for x in (-1.05, 1.05) for y in (-1.05, 1.05)]
    shoulders = [box((0.34, 0.22, 0.30), (0.0, y, 0.30)) for y in (-1.22, 1.22)]
    drives = [cylinder(0.14, 1.10, 1.36, 16).facing((x, 0, 0)) for x in (-1, 1)]
    sensors = [box((0.18, 0.14, 0.16), (x, y, BUS_TOP_M + 0.05)) for x, y in ((1.0, -1.0), (-1.0, 1.0), (1.0, 0.3))]
    return join(body, *feet, *shoulders, *drives, *sensors)


def _radiator() -> Solid:
    """Return the north radiator: mirror panels on the bus face, above and below the drive of the wing."""
    mirrors = tiles((2.0, 0.85, 0.02), (8, 4), 0.01).turn("y", 90).turn("x", 90)
    return join(mirrors.move(1.155, 0.0, 0.55), mirrors.move(1.155, 0.0, -0.65))


def _wing() -> tuple[Solid, Solid, Solid]:
    """Return the cells, the substrate and the yoke of the north wing: an open frame, then two panels of cells."""
    length, width, thickness = PANEL_M
    inner = 0.5 * SPAN_M - 3 * length - 2 * PANEL_GAP_M
    centers = [inner + (k + 0.5) * length + k * PANEL_GAP_M for k in range(3)]

    across = [-1.15, -0.95, -0.70, -0.06, 0.06, 0.70, 0.95, 1.15]
    along = [-1.35, -1.22, -0.76, -0.62, 0.68, 0.80, 1.18, 1.35]
    windows = {(1, 2), (1, 4), *((3, row) for row in range(1, 6)), *((5, row) for row in range(2, 5))}
    frame = lattice(along, across, windows | {(1, 1), (1, 5)}, thickness).move(x=centers[0])
    panels = [box(PANEL_M, (x, 0.0, 0.0)) for x in centers[1:]]
    gaps = [inner + (k + 1) * length + (k + 0.5) * PANEL_GAP_M for k in range(2)]
    hinges = [tube((x - 0.08, y, 0.0), (x + 0.08, y, 0.0), 0.022) for x in gaps for y in (-0.95, 0.0, 0.95)]

    cells = [tiles((length - 0.08, width - 0.08, 0.003), (6, 4), 0.012, (x, 0.0, 0.5 * thickness)) for x in centers[1:]]
    corner = inner + 0.05
    yoke = [tube((1.30, 0.0, 0.0), (corner, y, 0.0), 0.035) for y in (-0.95, 0.95)] + [
        tube((1.72, -0.50, 0.0), (1.72, 0.50, 0.0), 0.025),
        cylinder(0.10, 1.30, 1.48, 16).facing((1, 0, 0)),
    ]
    return join(*cells), join(frame, *panels, *hinges), join(*yoke)


def _on_reflector(radius: float, angle_deg: float) -> tuple[float, float, float]:
    height = radius**2 / (4.0 * FOCAL_LENGTH_M)
    return radius * math.cos(angle_deg * DEG), radius * math.sin(angle_deg * DEG), height


def _reflector() -> Solid:
    """Return a springback reflector, vertex at the origin: a thin shell, a rim, and two families of curved ribs."""
    shell = dish(REFLECTOR_M - 0.04, FOCAL_LENGTH_M, 0.006, 12, 60)
    edge = 0.5 * REFLECTOR_M
    rim = torus(edge - 0.02, 0.02, 64, 6).move(z=(edge - 0.02) ** 2 / (4.0 * FOCAL_LENGTH_M))
    radii = [0.30 + k * (edge - 0.03 - 0.30) / 8 for k in range(9)]
    ribs = [
        pipe([_on_reflector(radius, start + sweep * radius / edge) for radius in radii], 0.018, 4)
        for sweep in (-75.0, 75.0)
        for start in range(0, 360, 15)
    ]
    return join(shell, rim, *ribs)


def _feed() -> Solid:
    """Return the feed of a single-access antenna: a hub, a can on short legs, and a subreflector on struts."""
    hub = cylinder(0.42, -0.06, 0.05, 32)
    can = frustum(0.17, 0.30, 0.22, 0.90, 24)
    lid = dome(0.30, 0.06, 4, 24).move(z=0.90)
    legs = [_radial_tube(0.34, 0.03, 0.17, 0.26, angle, 0.014) for angle in range(0, 360, 60)]
    struts = [_radial_tube(0.29, 0.88, 0.20, 1.30, angle, 0.010) for angle in (45, 135, 225, 315)]
    subreflector = dome(0.24, 0.07, 4, 24).turn("x", 180).move(z=1.34)
    return join(hub, can, lid, subreflector, *legs, *struts)


def _radial_tube(
    inner_m: float, low_m: float, outer_m: float, high_m: float, angle_deg: float, radius_m: float
) -> Solid:
    """Return a round bar in a plane that contains the z axis.

    Parameters
    ----------
    inner_m, low_m : radius and z of one end [m]
    outer_m, high_m : radius and z of the other end [m]
    angle_deg : azimuth of the plane [deg]
    radius_m : of the bar [m]
    """
    return tube((inner_m, 0.0, low_m), (outer_m, 0.0, high_m), radius_m, 6).turn("z", angle_deg)


def _antenna_boom() -> Solid:
    """Return the east boom: gimbal box under the reflector, main tube to the shoulder, braces, launch frame."""
    _, y, z = VERTEX_M
    gimbal = box((0.55, 0.50, 0.26), (0.0, y - 0.15, z - 0.22))
    shank = box((0.24, 0.24, 0.30), (0.0, y, z - 0.12))
    elbow, shoulder = (0.0, y - 0.30, z - 0.28), (0.0, 1.30, 0.30)
    main = tube(elbow, shoulder, 0.065, 12)
    braces = [tube((0.3 * side, y - 0.9, z - 0.42), (0.85 * side, 1.12, 0.90), 0.022) for side in (-1, 1)]
    ties = [tube((0.0, y - 0.45, z - 0.32), (0.3 * side, y - 0.9, z - 0.42), 0.022) for side in (-1, 1)]
    spreader = tube((-0.3, y - 0.9, z - 0.42), (0.3, y - 0.9, z - 0.42), 0.022)
    frame = [tube((0.80 * side, 1.19, 0.85), (0.0, 1.24, -0.80), 0.030) for side in (-1, 1)]
    knuckles = [box((0.16, 0.16, 0.22), (0.80 * side, 1.20, 0.85)) for side in (-1, 1)]
    latch = box((0.22, 0.16, 0.16), (0.0, 1.22, -0.82))
    return join(gimbal, shank, main, *braces, *ties, spreader, *frame, *knuckles, latch)


def _multiple_access() -> Solid:
    """Return the S-band phased array on the Earth face: 32 elements for reception and 15 for transmission."""
    deck = box((1.90, 1.70, 0.05), (-0.05, 0.0, BUS_TOP_M + 0.02))
    receive = [(-0.88 + 0.235 * column, -0.70 + 0.20 * row) for column in range(4) for row in range(8)]
    transmit = [(0.22 + 0.26 * column, -0.56 + 0.28 * row) for column in range(3) for row in range(5)]
    elements = [_element(0.070, 0.16).move(x, y, BUS_TOP_M + 0.04) for x, y in receive]
    elements += [_element(0.095, 0.12).move(x, y, BUS_TOP_M + 0.04) for x, y in transmit]
    return join(deck, *elements)


def _element(radius_m: float, height_m: float) -> Solid:
    """Return one cupped element of the array with its rod."""
    cup = ring(radius_m - 0.008, radius_m, 0.0, 0.5 * height_m, 12)
    return join(cup, cylinder(0.25 * radius_m, -0.005, height_m, 6))


def _space_ground_link() -> Solid:
    """Return the space-ground-link antenna: a 2 m dish on the south side with a feed on a tripod."""
    reflector = dish(2.0, 0.80, 0.02, 8, 40)
    feed = frustum(0.05, 0.09, 0.62, 0.80, 16)
    legs = [tube(_at(0.90, 0.253, angle), _at(0.06, 0.70, angle), 0.011, 6) for angle in (30, 150, 270)]
    hub = frustum(0.20, 0.30, -0.16, 0.01, 20)
    return join(reflector, feed, *legs, hub).move(-2.35, 0.55, 1.42)


def _at(radius: float, z: float, angle_deg: float) -> tuple[float, float, float]:
    """Convert cylindrical to Cartesian coordinates.

    Parameters
    ----------
    radius, z : [m]
    angle_deg : azimuth [deg]
    """
    return radius * math.cos(angle_deg * DEG), radius * math.sin(angle_deg * DEG), z


def _space_ground_boom() -> Solid:
    """Return the arm and gimbal that hold the space-ground-link antenna."""
    gimbal = box((0.34, 0.28, 0.20), (-2.30, 0.55, 1.18))
    arms = [tube((-2.20, 0.55, 1.15), (-1.10, y, 0.85), 0.028) for y in (0.15, 0.95)]
    return join(gimbal, *arms)


def _omni() -> Solid:
    """Return the omnidirectional antenna: a crescent and a whip at the end of the long boom."""
    arc = [(0.42 * math.sin(a * DEG), 0.0, 0.42 * (math.cos(a * DEG) - 1.0)) for a in range(-90, 91, 15)]
    crescent = pipe(arc, 0.035, 6).facing((5.10, 0.0, 3.25)).move(6.05, 0.8, 4.14)
    whip = tube((6.10, 0.8, 4.17), (6.42, 0.8, 4.37), 0.018, 6)
    return join(crescent, whip, ball(0.06, (6.15, 0.8, 4.20), 1))


def _adapter() -> Solid:
    """Return the launcher's interface ring below the bus."""
    return ring(0.575, 0.635, BUS_BOTTOM_M - 0.12, BUS_BOTTOM_M + 0.01)


def _apogee_engine() -> Solid:
    """Return the bell of the liquid apogee engine inside the adapter ring."""
    return frustum(0.07, 0.16, 0.0, 0.28, 24).turn("x", 180).move(z=BUS_BOTTOM_M + 0.02)


def _thrusters() -> Solid:
    """Return the attitude thrusters: pairs of small bells at the lower corners and on the east and west faces."""
    bell = frustum(0.015, 0.045, 0.0, 0.09, 12)
    below = [
        bell.turn("x", 180).move(x, y, BUS_BOTTOM_M + 0.01) for x in (-0.80, 0.80) for y in (-0.95, -0.80, 0.80, 0.95)
    ]
    beside = [bell.facing((0, y, 0)).move(x, 1.14 * y, -0.95) for x in (-0.95, 0.95) for y in (-1, 1)]
    return join(*below, *beside)

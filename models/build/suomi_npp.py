"""Suomi NPP: a tall weather satellite on a Ball BCP 2000 bus, instruments on its slanted Earth face, one long wing."""

from __future__ import annotations

from models.build.primitives import (
    ball,
    box,
    box_between,
    cylinder,
    dish,
    frustum,
    prism,
    revolve,
    ring,
    tiles,
    torus,
    tube,
    wall,
)
from rso_lidar.records import Hinge, Taxonomy
from rso_lidar.shapes import CraftModel, CraftPart, Solid, join

BUS_WIDTH_M = 1.32
EARTH_FACE_DEG = 15.0  # how far the Earth face leans over
EARTH_FACE_M = (-0.195, 0.0, 0.335)  # a point on it, the origin of what stands there

PANEL_M = (1.80, 2.40, 0.04)
PANEL_GAP_M = 0.08
PANELS = 3
WING_M = (-0.02, -0.90, -1.115)  # the middle of the wing's inner edge

CRIS_M = (0.72, 0.88, 0.47)
CERES_M = (0.60, 0.60, 0.70)


def suomi_npp() -> CraftModel:
    """Return Suomi NPP as it flies: -x the Earth face, -y the solar wing, -z the adapter ring."""
    pieces = {
        "bus": CraftPart(_bus(), "mli_silver", 930.0),
        "radiator_y": CraftPart(_radiators_beside(), "osr", 18.0),
        "radiator_zenith": CraftPart(_radiators_above(), "osr", 10.0),
        "viirs": CraftPart(_on_earth_face(_viirs()), "mli_silver", 260.0),
        "atms": CraftPart(_on_earth_face(_atms()), "mli_silver", 75.0),
        "cris": CraftPart(_on_earth_face(_cris()), "mli_gold", 87.0),
        "ceres": CraftPart(_on_earth_face(_ceres()), "mli_gold", 45.0),
        "omps": CraftPart(_on_earth_face(_omps()), "mli_silver", 60.0),
        "boxes": CraftPart(_boxes(), "mli_silver", 60.0),
        "star_trackers": CraftPart(_star_trackers(), "black_anodise", 8.0),
        "antenna_high_rate": CraftPart(_on_earth_face(_dish_at(-0.855, -0.41, 0.30, 0.25)), "white_paint", 4.0),
        "antenna_science": CraftPart(_on_earth_face(_dish_at(-0.495, -0.075, -1.14, 0.22)), "white_paint", 4.0),
        "antenna_command": CraftPart(_on_earth_face(_patch_at(-1.11, -0.765, 0.94)), "white_paint", 2.0),
        "antenna_zenith": CraftPart(_zenith_antenna(), "white_paint", 2.0),
        "boom_antennas": CraftPart(_on_earth_face(_masts()), "cfrp", 9.0),
        "solar_array": CraftPart(_cells(), "solar_cell", 45.0),
        "solar_substrate": CraftPart(_substrate(), "cfrp", 78.0),
        "solar_drive": CraftPart(_drive(), "aluminium", 35.0),
        "propulsion": CraftPart(_propulsion(), "mli_gold", 90.0),
        "adapter_ring": CraftPart(ring(0.58, 0.64, -1.76, -1.69), "aluminium", 22.0),
        "thruster": CraftPart(_thrusters(), "aluminium", 8.0),
    }
    return CraftModel(
        name="suomi_npp",
        what="Suomi NPP (2011), a polar weather satellite on a BCP 2000 bus: one solar wing, five Earth instruments",
        source=(
            "Encyclopedia entry: bus 1.3 m by 1.3 m by 4.2 m, 1400 kg dry and 464 kg of payload; NOAA, JPSS news of 30 "
            "September 2015: a wing of three panels on the sister craft; NASA Langley, CERES brochure: 60 cm by 60 cm "
            "by 70 cm, 45 kg; H. Bloom, NPOESS briefing: CrIS 70 cm by 45 cm by 47 cm, 87 kg; arrangement and all "
            "other proportions from NASA's public 3D model of Suomi NPP"
        ),
        confidence=(
            "Bus size, CERES and CrIS published. The wing, the lean of the Earth face, antennas and boxes are read off "
            "NASA's public 3D model to about 5 cm. Which box holds which instrument, which face of the wing bears the "
            "cells, the split of 1852 kg (bus and payload, tanks empty), and the materials are guesses."
        ),
        axes=(
            "-x the Earth face, which leans 15 degrees up (-x and +z); +x zenith side; -y along the solar wing; -z the "
            "adapter ring; solar cells face +z; origin inside the bus, on the axis of the adapter ring"
        ),
        pieces=pieces,
        taxonomy=Taxonomy(
            object_class="payload",
            subclass="weather_satellite",
            shape_family="box_wing",
            size_class="medium",
            stabilisation="three_axis",
            rate_deg_s=(0.0, 0.06),
        ),
        hinges=(
            Hinge(
                name="solar",
                parts=("solar_array", "solar_substrate"),
                position_m=WING_M,
                axis=(0.0, -1.0, 0.0),
                normal=(0.0, 0.0, 1.0),
            ),
        ),
    )


def _on_earth_face(solid: Solid) -> Solid:
    """Return what is drawn beside an upright Earth face (x = 0, outward -x) where the face is."""
    return solid.turn("y", EARTH_FACE_DEG).move(*EARTH_FACE_M)


def _upright(outline: list[tuple[float, float]], left_m: float, right_m: float) -> Solid:
    """Extrude a convex outline along y.

    Parameters
    ----------
    outline : points (x, z) [m], counter-clockwise with x to the right
    left_m, right_m : y of the faces [m]
    """
    return prism(outline, -right_m, -left_m).turn("x", 90)


def _bus() -> Solid:
    """Return the body with its leaning face, the narrower box below it, and seams between its panels."""
    half = 0.5 * BUS_WIDTH_M
    outline = [(-0.66, -1.40), (0.97, -1.40), (0.97, 1.97), (0.27, 2.07)]
    body = _upright(outline, -half, half)
    below = box_between((-0.66, -half, -1.70), (0.66, half, -1.38))
    seams = [box_between((0.50, -half - 0.006, z), (0.976, half + 0.006, z + 0.02)) for z in (-0.55, 0.35, 1.25)]
    return join(body, below, *seams)


def _radiators_beside() -> Solid:
    """Return the radiators on the +y side: strips of mirrors."""
    y = 0.5 * BUS_WIDTH_M + 0.006
    plates = []
    for x0, x1, z0, z1 in (
        (-0.45, 0.58, -0.86, -0.15),
        (-0.05, 0.77, 0.68, 1.24),
        (0.03, 0.53, -0.05, 0.52),
        (0.13, 0.60, 1.28, 1.90),
    ):
        field = tiles((x1 - x0, z1 - z0, 0.012), (4, 3), 0.012).turn("x", 90)
        plates.append(field.move(0.5 * (x0 + x1), y, 0.5 * (z0 + z1)))
    return join(*plates)


def _radiators_above() -> Solid:
    """Return the radiators on the zenith side."""
    plates = []
    for y, z, width, height in ((-0.15, -0.72, 0.70, 0.72), (-0.29, 0.56, 0.70, 0.72), (-0.40, -0.06, 0.30, 0.40)):
        field = tiles((height, width, 0.016), (4, 3), 0.012).turn("y", 90)
        plates.append(field.move(0.978, y, z))
    return join(*plates)


def _viirs() -> Solid:
    """Return VIIRS at the upper end of the Earth face: a box with a raised side, its cooler and its nadir door."""
    body = box_between((-0.82, -0.62, 0.78), (0.06, 0.67, 1.68))
    raised = join(
        box_between((-0.82, 0.37, 1.60), (-0.02, 0.67, 1.79)),
        box_between((-0.82, -0.62, 1.60), (-0.78, 0.67, 1.79)),
    )
    opening = box_between((-0.845, -0.30, 1.02), (-0.80, 0.25, 1.42))
    cooler = tiles((0.40, 0.45, 0.02), (6, 1), 0.03).turn("x", 90).move(-0.42, -0.625, 1.22)
    return join(body, raised, opening, cooler)


def _atms() -> Solid:
    """Return ATMS: a wide slab beside VIIRS and a block below it, with the drums of its two mirrors."""
    slab = box_between((-0.81, -0.22, 0.47), (0.04, 0.67, 0.73))
    deck = box_between((-0.83, -0.62, 0.68), (0.04, 0.67, 0.73))
    shield = box_between((-0.83, -0.62, 0.50), (-0.78, -0.20, 0.73))
    block = box_between((-0.64, 0.03, 0.17), (0.04, 0.67, 0.41))
    drums = [tube((-0.66, y, 0.29), (-0.66, y + 0.24, 0.29), 0.09, 20) for y in (0.08, 0.38)]
    return join(slab, deck, shield, block, *drums)


def _cris() -> Solid:
    """Return CrIS: a box with a scan port that looks to the Earth and a two-stage cooler at its side."""
    deep, wide, high = CRIS_M
    body = box_between((-deep, -0.21, -0.30), (0.04, -0.21 + wide, -0.30 + high))
    port = torus(0.14, 0.02, 28, 6).facing((-1, 0, 0)).move(-deep, 0.10, -0.07)
    cooler = [box_between((-0.60 + 0.16 * k, 0.66, -0.26), (-0.48 + 0.16 * k, 0.70, 0.12)) for k in range(4)]
    return join(body, port, *cooler)


def _ceres() -> Solid:
    """Return CERES: a foot, a turntable, and a yoke that carries the scanning head with its three telescopes."""
    middle, level = -0.335, -0.73
    foot = box_between((-0.28, -0.55, -0.98), (0.04, -0.12, -0.50))
    turntable = frustum(0.24, 0.20, 0.20, 0.36, 32).facing((-1, 0, 0)).move(0.0, middle, level)
    cheeks = [box_between((-0.64, y - 0.02, level - 0.14), (-0.30, y + 0.02, level + 0.14)) for y in (-0.53, -0.14)]
    head = box_between((-0.62, -0.47, level - 0.17), (-0.36, -0.20, level + 0.17))
    telescopes = [
        wall([(0.035, 0.0), (0.035, 0.11)], 0.008, 16).facing((-1, 0, 0)).move(-CERES_M[2] + 0.09, y, level + dz)
        for y, dz in ((middle - 0.07, 0.06), (middle + 0.07, 0.06), (middle, -0.08))
    ]
    rest = tube((-0.46, -0.56, level), (-0.46, -0.11, level), 0.06, 20)
    return join(foot, turntable, *cheeks, head, *telescopes, rest)


def _omps() -> Solid:
    """Return OMPS: the limb sensor, the nadir sensor below it, and their electronics."""
    limb = [
        box_between((-0.64, 0.31, -1.23), (0.04, 0.54, -0.56)),
        box_between((-0.44, 0.24, -1.23), (0.04, 0.33, -0.60)),
    ]
    slits = [box_between((-0.66, 0.36, z), (-0.62, 0.49, z + 0.03)) for z in (-1.10, -0.95, -0.80)]
    nadir = [
        box_between((-0.41, 0.15, -1.78), (0.04, 0.41, -1.32)),
        box_between((-0.41, 0.40, -1.85), (0.04, 0.60, -1.52)),
        box_between((-0.20, 0.40, -1.54), (0.04, 0.48, -1.32)),
        frustum(0.07, 0.11, 0.0, 0.07, 20).facing((-1, 0, 0)).move(-0.38, 0.28, -1.58),
    ]
    electronics = box_between((-0.44, -0.41, -1.68), (0.04, -0.16, -1.19))
    return join(*limb, *slits, *nadir, electronics)


def _boxes() -> Solid:
    """Return the boxes on the wing's side and on the zenith side."""
    half = 0.5 * BUS_WIDTH_M
    return join(
        box_between((0.03, -0.79, 0.71), (0.58, -half + 0.02, 1.30)),
        box_between((0.95, 0.06, -1.46), (1.09, 0.43, -1.05)),
        box((0.10, 0.20, 0.04), (-0.05, -half - 0.02, 0.20)),
    )


def _star_trackers() -> Solid:
    """Return the two star trackers on the zenith side, baffles splayed, each behind a shade."""
    trackers = []
    for z, up in ((1.52, 1.0), (1.24, -1.0)):
        way = (0.42, 0.62, 0.62 * up)
        baffle = wall([(0.075, 0.0), (0.075, 0.20), (0.06, 0.22), (0.07, 0.30), (0.095, 0.50)], 0.008, 24)
        optics = join(cylinder(0.08, -0.06, 0.18, 24), cylinder(0.062, 0.15, 0.26, 24))
        trackers.append(join(baffle, optics).facing(way).move(1.00, 0.20, z))
        shade = box((0.02, 0.30, 0.28)).turn("z", 45).turn("y", -40 * up).move(1.12, 0.02, z - 0.02 * up)
        trackers += [shade, tube((0.95, 0.10, z), (1.10, 0.05, z), 0.02, 6)]
    return join(*trackers)


def _dish_at(x: float, y: float, z: float, radius_m: float) -> Solid:
    """Return a shallow dish that looks away from the Earth face, with rim, feed and three legs.

    Parameters
    ----------
    x, y, z : of its vertex, from the origin of the Earth face [m]
    radius_m : of the dish [m]
    """
    focal_length = 1.6 * radius_m
    reflector = dish(2 * radius_m, focal_length, 0.008, 6, 32)
    rim = torus(radius_m - 0.005, 0.008, 32, 6).move(z=radius_m**2 / (4 * focal_length))
    reach = 1.25 * radius_m
    legs = [tube((0.92 * radius_m, 0.0, 0.03), (0.02, 0.0, reach), 0.009, 6).turn("z", a) for a in (90, 210, 330)]
    feed = frustum(0.035, 0.02, reach - 0.07, reach + 0.05, 16)
    hub = cylinder(0.06, -0.05, 0.01, 16)
    return join(reflector, rim, *legs, feed, hub).facing((-1, 0, 0)).move(x, y, z)


def _patch_at(x: float, y: float, z: float) -> Solid:
    """Return the ground plate of three short helices, for commands and telemetry, facing -x.

    Parameters
    ----------
    x, y, z : of the middle of the plate [m]
    """
    plate = cylinder(0.15, -0.01, 0.01, 28)
    cups = [ball(0.034, (0.085, 0.0, 0.02), 1).turn("z", angle) for angle in (0, 120, 240)]
    return join(plate, *cups).facing((-1, 0, 0)).move(x, y, z)


def _masts() -> Solid:
    """Return the masts of the three antennas that stand on the Earth face."""
    lines = [(-0.735, 0.94, -1.11), (-0.41, 0.30, -0.86), (-0.075, -1.14, -0.50)]
    masts = [tube((0.05, y, z), (end, y, z), 0.055, 16) for y, z, end in lines]
    foot = box_between((-0.02, -0.80, 0.82), (0.12, -0.60, 1.06))
    return join(*masts, foot)


def _zenith_antenna() -> Solid:
    """Return the antenna that looks away from the Earth, on its box."""
    return join(
        _patch_at(0.0, 0.0, 0.0).turn("z", 180).move(1.11, 0.125, -1.19),
        tube((1.05, 0.125, -1.19), (1.11, 0.125, -1.19), 0.05),
    )


def _panel_middles() -> list[float]:
    """Return the middle of each panel along y [m], from the inner one outward."""
    return [WING_M[1] - (k + 0.5) * PANEL_M[1] - k * PANEL_GAP_M for k in range(PANELS)]


def _cells() -> Solid:
    width, length, thickness = PANEL_M
    size = (width - 0.06, length - 0.06, 0.003)
    return join(*(tiles(size, (8, 14), 0.012, (WING_M[0], y, WING_M[2] + 0.5 * thickness)) for y in _panel_middles()))


def _substrate() -> Solid:
    """Return the panels without their cells, the hinges between them, and the stub at the drive."""
    x, start, z = WING_M
    boards = [box(PANEL_M, (x, y, z)) for y in _panel_middles()]
    hinges = []
    for k in range(1, PANELS):
        y = start - k * PANEL_M[1] - (k - 0.5) * PANEL_GAP_M
        for at in (x - 0.28, x + 0.28):
            hinges.append(tube((at - 0.10, y, z), (at + 0.10, y, z), 0.028, 10))
            hinges += [tube((at + dx, y - 0.08, z), (at + dx, y + 0.08, z), 0.016, 6) for dx in (-0.06, 0.06)]
    hinges.append(tube((x, start + 0.06, z), (x, start - 0.04, z), 0.10, 20))
    return join(*boards, *hinges)


def _drive() -> Solid:
    """Return the wing's drive and the box that carries it."""
    x, _, z = WING_M
    half = 0.5 * BUS_WIDTH_M
    carrier = box_between((-0.42, -0.79, -1.31), (0.38, -half + 0.02, -0.53))
    motor = revolve([(0.0, 0.78), (0.13, 0.78), (0.13, 0.83), (0.10, 0.85), (0.0, 0.85)], 28)
    return join(carrier, motor.facing((0, -1, 0)).move(x, 0.0, z))


def _propulsion() -> Solid:
    """Return the blanketed bottom with the tank's dome inside the adapter ring."""
    dome = revolve([(0.0, -1.60), (0.60, -1.60), (0.60, -1.71), (0.42, -1.80), (0.22, -1.88), (0.0, -1.91)], 40)
    return join(dome, box_between((-0.64, -0.64, -1.72), (0.64, 0.64, -1.66)))


def _thrusters() -> Solid:
    """Return the four thrusters in pairs at the bottom."""
    bell = wall([(0.012, 0.0), (0.018, 0.02), (0.035, 0.08)], 0.004, 12)
    plug = cylinder(0.014, -0.05, 0.015, 12)
    return join(*(join(bell, plug).turn("x", 180).move(x, y, -1.74) for x in (-0.55, 0.55) for y in (-0.55, 0.55)))

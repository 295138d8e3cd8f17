"""A CubeSat of three units with deployed solar wings, whips and a telescope at the front."""

from __future__ import annotations

from rso_lidar.craft import Taxonomy
from rso_lidar.shapes.model import Model, Piece
from rso_lidar.shapes.solids import Solid, box, cylinder, dome, join, ring, tiles, tube

LENGTH_M = 0.3405
SIDE_M = 0.1000
RAIL_M = 0.0085
BODY_M = (0.3265, 0.0960, 0.0960)
PANEL_M = (0.3200, 0.0820, 0.0018)
HINGE_GAP_M = 0.0030


def cubesat_3u() -> Model:
    """Return a 3U CubeSat: +x the telescope, +y left wing, solar cells to +z."""
    cells, boards, hinges = _wing()
    pieces = {
        "bus": Piece(_bus(), "black_anodise", 2.90),
        "rails": Piece(_rails(), "aluminium", 0.30),
        "body_cells": Piece(_body_cells(), "solar_cell", 0.10),
        "solar_array_left": Piece(cells, "solar_cell", 0.06),
        "solar_array_right": Piece(cells.mirrored("y"), "solar_cell", 0.06),
        "solar_substrate_left": Piece(boards, "cfrp", 0.16),
        "solar_substrate_right": Piece(boards.mirrored("y"), "cfrp", 0.16),
        "hinges": Piece(join(hinges, hinges.mirrored("y")), "aluminium", 0.02),
        "telescope": Piece(_telescope(), "black_paint", 0.40),
        "lens": Piece(_lens(), "lens_glass", 0.05),
        "antenna_uhf": Piece(_whips(), "aluminium", 0.01),
        "antenna_patch": Piece(_patches(), "white_paint", 0.05),
        "star_tracker": Piece(_star_tracker(), "black_paint", 0.10),
        "fasteners": Piece(_fasteners(), "aluminium", 0.02),
    }
    return Model(
        name="cubesat_3u",
        what="CubeSat of three units with two double-panel solar wings, four whip antennas and a telescope",
        source=(
            "CubeSat Design Specification rev. 14.1 (Cal Poly, CP-CDS-R14.1, 2022): 100.0 mm by 100.0 mm by 340.5"
            " mm over the rails, rails at least 8.5 mm wide, at most 6 kg"
        ),
        confidence=(
            "Outer size and rails are the standard's. Wings, cells, antennas and telescope are a typical "
            "arrangement, not one craft; masses and materials are guesses."
        ),
        axes=(
            "+x along the long side, towards the telescope; +y towards the left wing; +z the side of the solar "
            "cells; origin at the middle of the bus"
        ),
        pieces=pieces,
        taxonomy=Taxonomy(
            object_class="payload",
            subclass="cubesat",
            shape_family="box_wing",
            size_class="small",
            stabilisation="three_axis",
            rate_deg_s=(0.0, 1.0),
        ),
    )


def _bus() -> Solid:
    """Return the body between the rails, with a dispenser-side plate at the back."""
    plate = box((0.004, 0.080, 0.080), (-0.5 * BODY_M[0] - 0.001, 0.0, 0.0))
    return join(box(BODY_M), plate)


def _rails() -> Solid:
    """Return the four rails, full length, at the corners of the 100 mm square."""
    place = 0.5 * (SIDE_M - RAIL_M)
    rails = [box((LENGTH_M, RAIL_M, RAIL_M), (0.0, y, z)) for y in (-place, place) for z in (-place, place)]
    return join(*rails)


def _body_cells() -> Solid:
    """Return the cells on the four long sides of the body."""
    side = tiles((0.290, 0.078, 0.0010), (7, 2), 0.002, (0.0, 0.0, 0.5 * BODY_M[2]))
    return join(*(side.turned("x", turn) for turn in (0, 90, 180, 270)))


def _wing() -> tuple[Solid, Solid, Solid]:
    """Return the cells, boards and hinges of the left wing: two boards in line, level with the top of the body."""
    length, width, thickness = PANEL_M
    top = 0.5 * SIDE_M - 0.002
    centers = [0.5 * SIDE_M + HINGE_GAP_M + 0.5 * width, 0.5 * SIDE_M + 2 * HINGE_GAP_M + 1.5 * width]
    boards = [box(PANEL_M, (0.0, y, top)) for y in centers]
    cells = [
        tiles((length - 0.010, width - 0.006, 0.0008), (7, 2), 0.002, (0.0, y, top + 0.5 * thickness)) for y in centers
    ]
    edges = [0.5 * SIDE_M + 0.5 * HINGE_GAP_M, centers[1] - 0.5 * width - 0.5 * HINGE_GAP_M]
    hinges = [tube((x - 0.010, y, top), (x + 0.010, y, top), 0.0022, 8) for y in edges for x in (-0.12, 0.0, 0.12)]
    return join(*cells), join(*boards), join(*hinges)


def _telescope() -> Solid:
    """Return the baffle of the telescope at the front: a hood with vanes, proud of the front plate."""
    front = 0.5 * BODY_M[0]
    hood = ring(0.0380, 0.0400, front - 0.004, front + 0.006, 48)
    vane = ring(0.0340, 0.0385, front + 0.0005, front + 0.0015, 48)
    flange = ring(0.0395, 0.0440, front - 0.001, front + 0.002, 48)
    return join(hood, vane, flange).facing((1, 0, 0))


def _lens() -> Solid:
    """Return the front lens in its hood."""
    return dome(0.0382, 0.0015, 6, 48).moved(z=0.5 * BODY_M[0] - 0.0008).facing((1, 0, 0))


def _whips() -> Solid:
    """Return the four tape antennas that spring out of the back end, 170 mm each."""
    tape = box((0.0004, 0.0050, 0.170), (-0.160, 0.0, 0.5 * SIDE_M + 0.083))
    root = box((0.008, 0.010, 0.006), (-0.160, 0.0, 0.5 * SIDE_M - 0.001))
    return join(*(join(tape, root).turned("x", turn) for turn in (45, 135, 225, 315)))


def _patches() -> Solid:
    """Return a square S-band patch on the bottom side and a round GPS patch on the back."""
    square = box((0.060, 0.060, 0.004), (0.105, 0.0, -0.5 * BODY_M[2] - 0.0015))
    round_patch = cylinder(0.016, 0.0, 0.006, 32).facing((-1, 0, 0)).moved(x=-0.5 * BODY_M[0] - 0.002, y=0.015, z=0.012)
    return join(square, round_patch)


def _star_tracker() -> Solid:
    """Return the baffle of the star tracker on the bottom side, towards the back."""
    return ring(0.0110, 0.0125, -0.0080, 0.0010, 32).moved(-0.090, 0.0, -0.5 * BODY_M[2])


def _fasteners() -> Solid:
    """Return the heads of the screws along the rails, left and right, and the separation springs at the back."""
    head = cylinder(0.0020, 0.0, 0.0008, 8)
    places = [(x * 0.0300 - 0.150, z) for x in range(11) for z in (-0.0457, 0.0457)]
    left = join(*(head.facing((0, 1, 0)).moved(x, 0.5 * SIDE_M - 0.0002, z) for x, z in places))
    place, back = 0.5 * (SIDE_M - RAIL_M), -0.5 * LENGTH_M
    springs = [tube((back + 0.002, y, z), (back - 0.003, y, z), 0.0016) for y, z in ((place, -place), (-place, place))]
    return join(left, left.mirrored("y"), *springs)

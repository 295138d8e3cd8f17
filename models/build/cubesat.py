"""CubeSats of one, three, six and twelve units: rails, body cells, whips, a telescope, and wings from three units on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from models.build.primitives import box, cylinder, dome, ring, tiles, tube, wall
from models.build.solar_wings import wing_hinges
from rso_lidar.errors import ScenarioError
from rso_lidar.records import Hinge, Symmetry, Taxonomy, classify_size
from rso_lidar.shapes import CraftModel, CraftPart, Solid, join

RAIL_M = 0.0085
HINGE_GAP_M = 0.0030
WALL_M = 0.0018  # thickness of a board of cells


@dataclass(frozen=True)
class _Form:
    """Size of a CubeSat over its rails [m], and its equipment."""

    side_m: tuple[float, float, float]
    boards: int  # in each wing
    cells: tuple[int, int, int]  # along x, y and z
    telescope: tuple[float, float]  # scale of the telescope of the 3U, and where it is along y [m]
    masses_kg: tuple[float, float, float]  # bus, rails, telescope
    limit_kg: float

    @property
    def body_m(self) -> tuple[float, float, float]:
        """Return the size of the body between the rails [m]."""
        x, y, z = self.side_m
        return x - 0.0140, y - 0.0040, z - 0.0040


_FORMS = {
    1: _Form((0.1135, 0.1000, 0.1000), 0, (2, 2, 2), (0.5, 0.0), (0.85, 0.10, 0.08), 2.0),
    3: _Form((0.3405, 0.1000, 0.1000), 2, (7, 2, 2), (1.0, 0.0), (2.90, 0.30, 0.40), 6.0),
    6: _Form((0.3660, 0.2263, 0.1000), 3, (8, 5, 2), (1.0, 0.0520), (7.40, 0.45, 0.60), 12.0),
    12: _Form((0.3660, 0.2263, 0.2263), 2, (8, 5, 5), (2.1, 0.0), (15.0, 0.55, 2.20), 24.0),
}
_SOURCE = "CubeSat Design Specification rev. 14.1 (Cal Poly, CP-CDS-R14.1, 2022)"


def cubesat_1u() -> CraftModel:
    """Return a 1U CubeSat: +x the lens."""
    return cubesat(1)


def cubesat_3u() -> CraftModel:
    """Return a 3U CubeSat: +x the telescope, +y left wing, solar cells to +z."""
    return cubesat(3)


def cubesat_6u() -> CraftModel:
    """Return a 6U CubeSat: +x the telescope, +y left wing, solar cells to +z."""
    return cubesat(6)


def cubesat_12u() -> CraftModel:
    """Return a 12U CubeSat: +x the telescope, +y left wing, solar cells to +z."""
    return cubesat(12)


def cubesat(units: int) -> CraftModel:
    """Build a CubeSat: +x the telescope, +y the left wing where there is one, +z the side of the solar cells.

    Parameters
    ----------
    units : 1, 3, 6 or 12 units of about 10 cm

    Returns
    -------
    CraftModel
        The model; wings from three units on, hinged wings from six.

        >>> [round(1000 * side) for side in cubesat(12).parts["rails"].vertices.max(axis=0)]
        [183, 113, 113]

    Raises
    ------
    ScenarioError
        For any other number of units.
    """
    if units not in _FORMS:
        raise ScenarioError(f"cubesat: {units} units: there are CubeSats of {', '.join(map(str, _FORMS))} here")
    form = _FORMS[units]
    pieces = _pieces(form)
    sides = " mm by ".join(f"{1000 * side:.1f}" for side in form.side_m[::-1])
    corners = np.concatenate([piece.solid.vertices for piece in pieces.values()])
    return CraftModel(
        name=f"cubesat_{units}u",
        symmetry=Symmetry(fold=2) if units > 1 else Symmetry(axis=(1.0, 0.0, 0.0), fold=4),
        what=_what(units),
        source=f"{_SOURCE}: {sides} over the rails, rails at least 8.5 mm wide, at most {form.limit_kg:.0f} kg",
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
            shape_family="box_wing" if form.boards else "box",
            size_class=classify_size(float(np.ptp(corners, axis=0).max())),
            stabilisation="three_axis" if units > 1 else "tumbling",
            rate_deg_s=(0.0, 1.0) if units > 1 else (0.0, 10.0),
        ),
        hinges=_hinges(form) if units > 3 else (),
    )


def _what(units: int) -> str:
    return {
        1: "CubeSat of one unit with cells on its body, four whip antennas and a small camera",
        3: "CubeSat of three units with two double-panel solar wings, four whip antennas and a telescope",
        6: "CubeSat of six units with two triple-panel solar wings that turn, four whip antennas and a telescope",
        12: "CubeSat of twelve units with two double-panel solar wings that turn, whips, thrusters and a wide telescope",
    }[units]


def _pieces(form: _Form) -> dict[str, CraftPart]:
    """Return the parts of a CubeSat."""
    bus_kg, rails_kg, telescope_kg = form.masses_kg
    share = form.limit_kg / 6.0  # of what the 3U has
    pieces = {
        "bus": CraftPart(_bus(form), "black_anodise", bus_kg),
        "rails": CraftPart(_rails(form), "aluminium", rails_kg),
        "body_cells": CraftPart(_body_cells(form), "solar_cell", 0.10 * share),
    }
    if form.boards:
        cells, boards, hinges = _wing(form)
        turning = form.boards * _panel(form)[1] / 0.164  # area of the wings, in wings of the 3U
        pieces |= {
            "solar_array_left": CraftPart(cells, "solar_cell", 0.06 * turning),
            "solar_array_right": CraftPart(cells.mirror("y"), "solar_cell", 0.06 * turning),
            "solar_substrate_left": CraftPart(boards, "cfrp", 0.16 * turning),
            "solar_substrate_right": CraftPart(boards.mirror("y"), "cfrp", 0.16 * turning),
            "hinges": CraftPart(join(hinges, hinges.mirror("y")), "aluminium", 0.02 * turning),
        }
    pieces |= {
        "telescope": CraftPart(_telescope(form), "black_paint", telescope_kg),
        "lens": CraftPart(_lens(form), "lens_glass", telescope_kg / 8.0),
        "antenna_uhf": CraftPart(_whips(form), "aluminium", 0.01),
        "antenna_patch": CraftPart(_patches(form), "white_paint", 0.05),
    }
    if form.boards:
        pieces["star_tracker"] = CraftPart(_star_tracker(form), "black_paint", 0.10)
    pieces["fasteners"] = CraftPart(_fasteners(form), "aluminium", 0.02)
    if form.limit_kg > 9.0:  # six units (12 kg) and more
        pieces["thruster"] = CraftPart(_thrusters(form), "aluminium", 0.15 * share)
    return pieces


def _bus(form: _Form) -> Solid:
    """Return the body between the rails, with a dispenser-side plate at the back."""
    x, y, z = form.body_m
    plate = box((0.004, y - 0.016, z - 0.016), (-0.5 * x - 0.001, 0.0, 0.0))
    return join(box(form.body_m), plate)


def _rails(form: _Form) -> Solid:
    """Return the four rails, full length, at the corners of the square."""
    x, y, z = form.side_m
    across, up = 0.5 * (y - RAIL_M), 0.5 * (z - RAIL_M)
    return join(*(box((x, RAIL_M, RAIL_M), (0.0, a, b)) for a in (-across, across) for b in (-up, up)))


def _body_cells(form: _Form) -> Solid:
    """Return the cells on the four long sides of the body."""
    x, y, z = form.body_m
    nx, ny, nz = form.cells
    top = tiles((x - 0.0365, y - 0.018, 0.0010), (nx, ny), 0.002, (0.0, 0.0, 0.5 * z))
    side = tiles((x - 0.0365, z - 0.018, 0.0010), (nx, nz), 0.002, (0.0, 0.0, 0.5 * y))
    return join(top, side.turn("x", 90), top.turn("x", 180), side.turn("x", 270))


def _panel(form: _Form) -> tuple[float, float, float]:
    """Return the size of a board [m]: boards lie against the left and right sides until they unfold."""
    return form.side_m[0] - 0.0205, form.side_m[2] - 0.0180, WALL_M


def _wing(form: _Form) -> tuple[Solid, Solid, Solid]:
    """Return the cells, boards and hinges of the left wing: boards in line, level with the top of the body."""
    length, width, thickness = _panel(form)
    edge, top = 0.5 * form.side_m[1], 0.5 * form.side_m[2] - 0.002
    centers = [edge + (k + 1) * HINGE_GAP_M + (k + 0.5) * width for k in range(form.boards)]
    boards = [box((length, width, thickness), (0.0, y, top)) for y in centers]
    cells = [
        tiles(
            (length - 0.010, width - 0.006, 0.0008),
            (form.cells[0], form.cells[2]),
            0.002,
            (0.0, y, top + 0.5 * thickness),
        )
        for y in centers
    ]
    edges = [y - 0.5 * width - 0.5 * HINGE_GAP_M for y in centers]
    hinges = [tube((x - 0.010, y, top), (x + 0.010, y, top), 0.0022, 8) for y in edges for x in (-0.12, 0.0, 0.12)]
    return join(*cells), join(*boards), join(*hinges)


def _hinges(form: _Form) -> tuple[Hinge, ...]:
    """Return the hinges of the wings, each along +y through the middle of its boards."""
    y, top = 0.5 * form.side_m[1], 0.5 * form.side_m[2] - 0.002
    sides = {side: (0.0, sign * y, top) for side, sign in (("left", 1.0), ("right", -1.0))}
    return wing_hinges(sides, axis=(0.0, 1.0, 0.0), normal=(0.0, 0.0, 1.0), parts=("array", "substrate"))


def _front(form: _Form, solid: Solid) -> Solid:
    """Place a solid, drawn about +z with the front plate at z = 0, at the telescope."""
    return solid.move(z=0.5 * form.body_m[0]).facing((1, 0, 0)).move(y=form.telescope[1])


def _telescope(form: _Form) -> Solid:
    """Return the baffle of the telescope at the front: a hood with vanes that protrudes from the front plate."""
    s = form.telescope[0]
    hood = ring(0.0380 * s, 0.0400 * s, -0.004, 0.006, 48)
    vane = ring(0.0340 * s, 0.0385 * s, 0.0005, 0.0015, 48)
    flange = ring(0.0395 * s, 0.0440 * s, -0.001, 0.002, 48)
    return _front(form, join(hood, vane, flange))


def _lens(form: _Form) -> Solid:
    """Return the front lens in its hood."""
    s = form.telescope[0]
    return _front(form, dome(0.0382 * s, 0.0015, 6, 48).move(z=-0.0008))


def _whips(form: _Form) -> Solid:
    """Return the four tape antennas that spring out of the back end, 170 mm each."""
    x, _, z = form.side_m
    back = 0.01025 - 0.5 * x
    tape = box((0.0004, 0.0050, 0.170), (back, 0.0, 0.5 * z + 0.083))
    root = box((0.008, 0.010, 0.006), (back, 0.0, 0.5 * z - 0.001))
    whip = join(tape, root)
    return join(*(whip.turn("x", turn) for turn in (45, 135, 225, 315)))


def _patches(form: _Form) -> Solid:
    """Return a square S-band patch on the bottom side and a round GPS patch on the back."""
    x, _, z = form.body_m
    place = 0.5 * x - 0.05825 if x > 0.2 else 0.0
    square = box((0.060, 0.060, 0.004), (place, 0.0, -0.5 * z - 0.0015))
    round_patch = cylinder(0.016, 0.0, 0.006, 32).facing((-1, 0, 0)).move(x=-0.5 * x - 0.002, y=0.015, z=0.012)
    return join(square, round_patch)


def _star_tracker(form: _Form) -> Solid:
    """Return the baffle of the star tracker on the bottom side, towards the back."""
    x, _, z = form.body_m
    return ring(0.0110, 0.0125, -0.0080, 0.0010, 32).move(0.07325 - 0.5 * x, 0.0, -0.5 * z)


def _fasteners(form: _Form) -> Solid:
    """Return the heads of the screws along the rails, left and right, and the separation springs at the back."""
    length, y, z = form.side_m
    head = cylinder(0.0020, 0.0, 0.0008, 8)
    count = round((length - 0.0405) / 0.0300) + 1
    up = 0.5 * z - 0.0043
    places = [(0.0300 * k - 0.0150 * (count - 1), b) for k in range(count) for b in (-up, up)]
    left = join(*(head.facing((0, 1, 0)).move(x, 0.5 * y - 0.0002, b) for x, b in places))
    across, raised, back = 0.5 * (y - RAIL_M), 0.5 * (z - RAIL_M), -0.5 * length
    springs = [
        tube((back + 0.002, a, b), (back - 0.003, a, b), 0.0016) for a, b in ((across, -raised), (-across, raised))
    ]
    return join(left, left.mirror("y"), *springs)


def _thrusters(form: _Form) -> Solid:
    """Return the four nozzles of the cold-gas thruster at the back, round its plate."""
    x, y, z = form.body_m
    plate = cylinder(0.032, -0.001, 0.004, 40)
    bell = wall([(0.0018, 0.0), (0.0070, 0.010)], 0.0008, 20).move(z=0.003)
    nozzles = [bell.move(a, b) for a in (-0.016, 0.016) for b in (-0.016, 0.016)]
    return (
        join(plate, *nozzles)
        .facing((-1, 0, 0))
        .move(-0.5 * x - 0.002, -0.055 if y - z > 0.001 else 0.0, -0.045 * (z > 0.2))
    )

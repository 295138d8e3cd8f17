"""A crew capsule of the Apollo shape: a blunt cone on a heat shield, the most common form of capsules."""

from __future__ import annotations

import math

from models.build.primitives import box, cylinder, frustum, prism, revolve, ring, torus, tube, wall
from rso_lidar.records import Symmetry, Taxonomy
from rso_lidar.shapes import CraftModel, CraftPart, Solid, join, pipe
from rso_lidar.units import DEG

RADIUS_M = 0.5 * 3.912  # 12 ft 10 in across
HEIGHT_M = 3.226  # 10 ft 7 in
SHIELD_RADIUS_M = 4.694  # of the sphere that the heat shield is cut from
CORNER_RADIUS_M = 0.196
CONE_DEG = 33.0  # half angle
APEX_RADIUS_M = 0.42  # of the docking tunnel
TAN, COS, SIN = math.tan(CONE_DEG * DEG), math.cos(CONE_DEG * DEG), math.sin(CONE_DEG * DEG)

_BEND = math.asin((RADIUS_M - CORNER_RADIUS_M) / (SHIELD_RADIUS_M - CORNER_RADIUS_M))  # where sphere meets corner
_CORNER_M = RADIUS_M - CORNER_RADIUS_M, SHIELD_RADIUS_M - (SHIELD_RADIUS_M - CORNER_RADIUS_M) * math.cos(_BEND)
_FOOT_M = _CORNER_M[0] + CORNER_RADIUS_M * COS, _CORNER_M[1] + CORNER_RADIUS_M * SIN  # where the cone begins
TUNNEL_M = 2.80  # height at which the docking tunnel begins


def capsule() -> CraftModel:
    """Return the capsule with its axis along +x: docking end forward, heat shield to the rear, hatch towards +z."""
    along_z = {
        "heat_shield": CraftPart(_heat_shield(), "cfrp", 1100.0),
        "cabin": CraftPart(_cabin(), "mli_silver", 3746.0, hollow=True),
        "seams": CraftPart(_seams(), "black_anodise", 60.0),
        "hatch": CraftPart(_hatch(), "aluminium", 160.0),
        "windows": CraftPart(_windows(), "lens_glass", 60.0),
        "window_frames": CraftPart(_window_frames(), "black_paint", 60.0),
        "parachute_cover": CraftPart(_parachute_cover(), "white_paint", 350.0, hollow=True),
        "docking_ring": CraftPart(_docking_ring(), "aluminium", 60.0),
        "docking_probe": CraftPart(_docking_probe(), "aluminium", 40.0),
        "thruster": CraftPart(_thrusters(), "black_paint", 40.0),
        "umbilical": CraftPart(_umbilical(), "white_paint", 50.0),
        "handrails": CraftPart(_handrails(), "aluminium", 10.0),
        "compression_pads": CraftPart(_pads(), "aluminium", 60.0),
        "antenna": CraftPart(_antennas(), "white_paint", 10.0),
    }
    pieces = {
        name: CraftPart(piece.solid.turn("y", 90).move(x=-_CORNER_M[1]), piece.material, piece.mass_kg, piece.hollow)
        for name, piece in along_z.items()
    }
    return CraftModel(
        name="capsule",
        symmetry=Symmetry(axis=(1.0, 0.0, 0.0), fold=0),
        what="Crew capsule of the shape of the Apollo command module, without its service module, docking probe out",
        source=(
            "NASA History, Apollo 204 'Spacecraft' page: command module 10 ft 7 in high, 12 ft 10 in across, about "
            "12,800 lb at launch; NASA SP-4012 vol. 3: two hatches, five windows, ten reaction-control engines (our "
            "twelve nozzles follow pictures)"
        ),
        confidence=(
            "Height, diameter and mass published. Half angle (33 deg), radii of heat shield (4.69 m) and corner (0.20 "
            "m) as commonly quoted, not looked up. Hatch, windows, nozzles, seams and masses by part are guesses from "
            "pictures; so are the materials: silver film over the cone, a bare composite shield."
        ),
        axes=(
            "+x along the axis, towards the docking end, heat shield at -x; +z towards the side hatch; origin on the "
            "axis in the plane of the greatest diameter"
        ),
        pieces=pieces,
        taxonomy=Taxonomy(
            object_class="capsule",
            subclass="crew_capsule",
            shape_family="cone",
            size_class="medium",
            stabilisation="three_axis",
            rate_deg_s=(0.0, 5.0),
        ),
    )


def _radius(height_m: float) -> float:
    """Return the radius of the cone at a height [m]."""
    return _FOOT_M[0] - (height_m - _FOOT_M[1]) * TAN


def _on_cone(solid: Solid, height_m: float, azimuth_deg: float, proud_m: float = 0.0) -> Solid:
    """Place a solid, drawn with +z outward and +x up the slope, on the cone.

    Parameters
    ----------
    solid : to be placed
    height_m : of its origin above the foot [m]
    azimuth_deg : about the axis [deg]; 180 is the side of the hatch
    proud_m : height above the surface [m]
    """
    radius = _radius(height_m) + proud_m * COS
    tilted = solid.turn("z", 180).turn("y", 90.0 - CONE_DEG)
    return tilted.move(x=radius, z=height_m + proud_m * SIN).turn("z", azimuth_deg)


def _heat_shield() -> Solid:
    """Return the spherical shield with its rounded corner, up to where the cone begins."""
    sphere = [
        (SHIELD_RADIUS_M * math.sin(_BEND * k / 12), SHIELD_RADIUS_M * (1.0 - math.cos(_BEND * k / 12)))
        for k in range(12)
    ]
    turn = [_BEND - 0.5 * math.pi + (0.5 * math.pi - _BEND + CONE_DEG * DEG) * k / 10 for k in range(11)]
    corner = [
        (_CORNER_M[0] + CORNER_RADIUS_M * math.cos(a), _CORNER_M[1] + CORNER_RADIUS_M * math.sin(a)) for a in turn
    ]
    return revolve([(0.0, 0.0), *sphere[1:], *corner, (0.0, _FOOT_M[1])], 80)


def _cabin() -> Solid:
    """Return the cone of the cabin up to the docking tunnel."""
    bottom = _FOOT_M[1] + 0.010
    heights = [bottom + k * (TUNNEL_M - bottom) / 8 for k in range(9)]
    joint = [(0.0, bottom - 0.05), (_FOOT_M[0] - 0.03, bottom - 0.05), (_FOOT_M[0] - 0.03, bottom)]  # a groove
    return revolve([*joint, *((_radius(z) - 0.004, z) for z in heights), (0.0, TUNNEL_M)], 80)


def _parachute_cover() -> Solid:
    """Return the forward cover over parachutes and tunnel: the raised tip of the cone, with a rounded top."""
    low = 2.28
    return revolve(
        [
            (0.0, low),
            (_radius(low) + 0.012, low),
            (_radius(TUNNEL_M - 0.06) + 0.012, TUNNEL_M - 0.06),
            (_radius(TUNNEL_M) - 0.02, TUNNEL_M + 0.01),
            (APEX_RADIUS_M + 0.03, TUNNEL_M + 0.05),
            (APEX_RADIUS_M, TUNNEL_M + 0.10),
            (APEX_RADIUS_M, TUNNEL_M + 0.20),
            (0.0, TUNNEL_M + 0.20),
        ],
        64,
    )


def _seams() -> Solid:
    """Return the joints of the cone's panels: hoops, and lines down the slope."""
    hoops = [torus(_radius(z) + 0.001, 0.010, 80, 5).move(z=z) for z in (0.80, 1.35, 2.27)]
    line = box((1.80, 0.022, 0.012))
    return join(*hoops, *(_on_cone(line, 1.50, a) for a in (15, 70, 115, 150, 210, 245, 290, 345)))


def _hatch() -> Solid:
    """Return the side hatch: a plate wider below than above, with its hinges and lock."""
    plate = prism([(-0.42, -0.44), (0.42, -0.36), (0.42, 0.36), (-0.42, 0.44)], -0.10, 0.022)
    latch = box((0.10, 0.22, 0.05), (-0.22, 0.0, 0.03))
    hinges = [tube((x - 0.07, 0.46, 0.01), (x + 0.07, 0.46, 0.01), 0.022) for x in (-0.25, 0.20)]
    return _on_cone(join(plate, latch, *hinges), 1.55, 180)


_WINDOWS = (  # azimuth [deg], height [m], outline up the slope and across [m]
    (180, 1.70, ((-0.12, -0.12), (0.12, -0.12), (0.12, 0.12), (-0.12, 0.12))),
    (146, 1.85, ((-0.20, -0.14), (0.20, -0.02), (0.20, 0.12), (-0.20, 0.14))),
    (214, 1.85, ((-0.20, -0.14), (0.20, -0.12), (0.20, 0.02), (-0.20, 0.14))),
    (100, 1.55, ((-0.17, -0.17), (0.17, -0.17), (0.17, 0.17), (-0.17, 0.17))),
    (260, 1.55, ((-0.17, -0.17), (0.17, -0.17), (0.17, 0.17), (-0.17, 0.17))),
)


def _windows() -> Solid:
    """Return the five panes."""
    return join(*(_on_cone(prism(outline, -0.06, 0.034), z, a, 0.0) for a, z, outline in _WINDOWS))


def _window_frames() -> Solid:
    """Return the dark surrounds of the windows."""
    larger = [[(1.28 * x, 1.28 * y) for x, y in outline] for _, _, outline in _WINDOWS]
    return join(*(_on_cone(prism(o, -0.08, 0.028), z, a) for o, (a, z, _) in zip(larger, _WINDOWS, strict=True)))


def _docking_ring() -> Solid:
    """Return the ring at the top of the tunnel with twelve latches."""
    band = ring(APEX_RADIUS_M - 0.07, APEX_RADIUS_M + 0.015, TUNNEL_M + 0.17, TUNNEL_M + 0.26, 48)
    latch = box((0.07, 0.05, 0.08), (APEX_RADIUS_M - 0.09, 0.0, TUNNEL_M + 0.24))
    return join(band, *(latch.turn("z", 30.0 * k) for k in range(12)))


def _docking_probe() -> Solid:
    """Return the probe on its three legs; its head is the highest point."""
    head = frustum(0.055, 0.03, HEIGHT_M - 0.07, HEIGHT_M, 20)
    shaft = cylinder(0.035, TUNNEL_M + 0.10, HEIGHT_M - 0.06, 16)
    legs = [
        tube((0.34, 0.0, TUNNEL_M + 0.21), (0.03, 0.0, HEIGHT_M - 0.13), 0.014).turn("z", 120.0 * k) for k in range(3)
    ]
    return join(head, shaft, *legs)


def _thrusters() -> Solid:
    """Return the twelve nozzles: flush mouths in pairs, pitch above and below, yaw at the sides, roll between."""
    mouth = wall([(0.045, -0.05), (0.070, 0.030)], 0.010, 20)
    floor = cylinder(0.05, -0.05, -0.03, 20)
    nozzle = join(mouth, floor)
    places = [(0, 2.10), (180, 2.10), (0, 0.86), (90, 0.86), (270, 0.86), (45, 0.95)]
    return join(*(_on_cone(nozzle.move(y=y), z, a) for a, z in places for y in (-0.11, 0.11)))


def _umbilical() -> Solid:
    """Return the housing of the lines to the service module, opposite to the hatch, with its stub over the edge."""
    fairing = join(box((0.50, 0.30, 0.10)), box((0.20, 0.20, 0.05), (0.32, 0.0, 0.0)))
    stub = box((0.10, 0.26, 0.30), (RADIUS_M - 0.02, 0.0, 0.68))
    return join(_on_cone(fairing, 1.02, 0), stub)


def _handrails() -> Solid:
    """Return the bars beside the hatch and a loop round the top."""
    bar = pipe([(-0.40, 0.0, 0.0), (-0.40, 0.0, 0.07), (0.40, 0.0, 0.07), (0.40, 0.0, 0.0)], 0.013, 8)
    rails = [_on_cone(bar, z, a) for a in (160, 200) for z in (1.50,)]
    loop = [torus(0.70, 0.012, 48, 6).move(z=2.60)]
    posts = [tube((0.62, 0.0, 2.60), (0.70, 0.0, 2.60), 0.010, 6).turn("z", 60.0 * k) for k in range(6)]
    return join(*rails, *loop, *posts)


def _pads() -> Solid:
    """Return the six pads on the heat shield through which the service module carried the capsule."""
    radius = 1.50
    low = SHIELD_RADIUS_M - math.sqrt(SHIELD_RADIUS_M**2 - radius**2)
    pad = cylinder(0.085, low - 0.02, low + 0.06, 24).move(x=radius)
    return join(*(pad.turn("z", 60.0 * k + 30.0) for k in range(6)))


def _antennas() -> Solid:
    """Return four low antennas round the lower cone."""
    return join(*(_on_cone(cylinder(0.07, -0.02, 0.03, 20), 0.92, a) for a in (30, 135, 225, 330)))

"""LRO, the Lunar Reconnaissance Orbiter: a box with one clipped wing, an antenna on a long boom, an optical bench."""

from __future__ import annotations

import math

from models.build.primitives import (
    ball,
    box,
    box_between,
    cylinder,
    dish,
    dome,
    frustum,
    prism,
    revolve,
    ring,
    torus,
    tube,
    wall,
)
from rso_lidar.records import Hinge, Taxonomy
from rso_lidar.shapes import CraftModel, CraftPart, Solid, join
from rso_lidar.units import DEG

CAMERA_M = (0.26, 0.70)  # diameter and length of a narrow-angle camera
WIDE_CAMERA_M = (0.158, 0.232, 0.323)
BUS_LOW_M = (-0.64, -0.68, -1.22)
BUS_HIGH_M = (1.04, 0.69, 1.27)

PANEL_M = (2.80, 1.36, 0.03)
PANEL_GAP_M = 0.07
PANEL_CUT_M = 0.55  # corners of the outer panels, to fit into the fairing
WING_M = (1.34, 0.0, -0.97)  # the middle of the wing's inner edge
ANTENNA_M = (0.27, 3.04, -0.97)  # vertex of the high-gain antenna
ANTENNA_DIAMETER_M = 0.80


def lro() -> CraftModel:
    """Return LRO as it flies: -y to the Moon, +y the high-gain antenna, +x the solar wing, -z the adapter ring."""
    pieces = {
        "bus": CraftPart(_bus(), "mli_silver", 600.0),
        "bus_deck": CraftPart(_deck(), "mli_silver", 40.0),
        "radiator_avionics": CraftPart(_radiator(), "osr", 12.0),
        "bench": CraftPart(_bench(), "mli_gold", 45.0),
        "camera_narrow_angle": CraftPart(_narrow_cameras(), "mli_silver", 16.0),
        "camera_wide_angle": CraftPart(box(WIDE_CAMERA_M, (-1.12, -0.30, 0.11)), "black_anodise", 0.9),
        "star_trackers": CraftPart(_star_trackers(), "black_anodise", 6.0),
        "altimeter": CraftPart(_altimeter(), "mli_gold", 13.0),
        "neutron_detector": CraftPart(_neutron_detector(), "mli_gold", 26.0),
        "instruments": CraftPart(_instruments(), "mli_gold", 30.0),
        "antenna_radar": CraftPart(_radar(), "white_paint", 8.0),
        "radar_support": CraftPart(_radar_support(), "mli_silver", 20.0),
        "solar_array": CraftPart(_cells(), "solar_cell", 20.0),
        "solar_substrate": CraftPart(_substrate(), "cfrp", 42.0),
        "solar_yoke": CraftPart(_yoke(), "aluminium", 12.0),
        "solar_drive": CraftPart(_drive(), "mli_gold", 12.0),
        "antenna_high_gain": CraftPart(_high_gain(), "white_paint", 9.0),
        "antenna_gimbal": CraftPart(_gimbals(), "aluminium", 9.0),
        "boom_high_gain": CraftPart(_boom(), "cfrp", 12.0),
        "boom_omni": CraftPart(_omni_boom(), "cfrp", 4.0),
        "antenna_omni": CraftPart(_omni(), "white_paint", 1.0),
        "propulsion": CraftPart(_propulsion(), "mli_gold", 55.0),
        "adapter_ring": CraftPart(ring(0.545, 0.605, -1.35, -1.19), "aluminium", 15.0),
        "thruster": CraftPart(_thrusters(), "aluminium", 10.0),
    }
    return CraftModel(
        name="lro",
        what="Lunar Reconnaissance Orbiter (2009): one solar wing of three panels, high-gain antenna on a boom",
        source=(
            "Encyclopedia entry: 3.9 m by 2.7 m by 2.6 m at launch, dry mass 1018 kg; University of New Hampshire, "
            "CRaTER pages: 2 m by 2.6 m; LROC news 49 of 4 March 2009: narrow-angle camera 26 cm across and 70 cm "
            "long; Robinson et al. 2010, as told by CosmoQuest: wide-angle camera 15.8 cm by 23.2 cm by 32.3 cm; "
            "arrangement and all other proportions from NASA's public 3D model of LRO"
        ),
        confidence=(
            "Cameras and dry mass published. No deployed figure was found: wing, booms, antenna and the boxes on the "
            "bus are read off NASA's public 3D model to about 5 cm and hold no better. Which face of the wing bears "
            "the cells, the split of the mass, and the materials are guesses."
        ),
        axes=(
            "-y nadir, the way the cameras look; +y zenith, the boresight of the high-gain antenna in this pose; +x "
            "towards the solar wing; +z away from the adapter ring; solar cells face -z; origin inside the bus, on the "
            "axis of the adapter ring"
        ),
        pieces=pieces,
        taxonomy=Taxonomy(
            object_class="payload",
            subclass="planetary_orbiter",
            shape_family="box_wing",
            size_class="medium",
            stabilisation="three_axis",
            rate_deg_s=(0.0, 0.1),
        ),
        hinges=(
            Hinge(
                name="solar",
                parts=("solar_array", "solar_substrate", "solar_yoke"),
                position_m=(1.20, -0.16, -0.97),
                axis=(0.0, 1.0, 0.0),
                normal=(0.0, 0.0, -1.0),
                travel_deg=(-90.0, 120.0),  # the bus blocks the way up
            ),
            Hinge(
                name="high_gain",
                parts=("antenna_high_gain",),
                position_m=(ANTENNA_M[0], 2.88, ANTENNA_M[2]),
                axis=(1.0, 0.0, 0.0),
                normal=(0.0, 1.0, 0.0),
                travel_deg=(-100.0, 100.0),
            ),
        ),
    )


def _bus() -> Solid:
    """Return the body: a box with its upright edges cut, and the boxes and grapple points that stand out of it."""
    (x0, y0, z0), (x1, y1, z1) = BUS_LOW_M, BUS_HIGH_M
    cut = 0.05
    outline = [(x0, y0), (x1 - cut, y0), (x1, y0 + cut), (x1, y1 - cut), (x1 - cut, y1), (x0, y1)]
    blanket = box((0.03, 1.05, 1.70), (x1 + 0.01, 0.0, 0.12))
    grapples = [cylinder(0.035, 0.0, 0.09, 12).facing((0, 1, 0)).move(x, y1, z) for x in (0.92,) for z in (0.6, 1.1)]
    boxes = [box_between((0.62, -0.72, 0.42), (0.88, y0, 0.65)), box_between((-0.30, y1, -0.9), (-0.05, 0.72, -0.5))]
    return join(prism(outline, z0, z1 - 0.06), blanket, *grapples, *boxes)


def _deck() -> Solid:
    """Return the upper deck with its rim and the boxes on it."""
    rim = box_between((-0.62, -0.66, 1.19), (0.98, 0.67, BUS_HIGH_M[2]))
    boxes = [
        box_between((0.23, -0.04, 1.11), (0.50, 0.53, 1.38)),
        box_between((0.62, -0.18, 1.05), (0.75, 0.04, 1.33)),
        box_between((0.62, 0.53, 1.05), (0.97, 0.59, 1.33)),
        box_between((0.12, 0.60, 1.11), (0.57, 0.66, 1.29)),
    ]
    return join(rim, *boxes)


def _radiator() -> Solid:
    """Return the radiator of the electronics on the -x side, behind the bench: strips of mirrors."""
    strips = [box((0.01, 1.05, 0.20), (BUS_LOW_M[0] - 0.005, 0.0, -0.55 + 0.22 * k)) for k in range(7)]
    return join(*strips)


def _bench() -> Solid:
    """Return the optical bench on its stand-offs, clear of the bus."""
    body = join(
        box_between((-1.00, -0.40, -0.50), (-0.72, 0.20, 0.30)),
        box_between((-1.14, -0.46, 0.26), (-0.72, 0.20, 0.62)),
        box_between((-1.02, -0.64, 0.30), (-0.72, 0.18, 0.71)),
    )
    feet = [tube((-0.73, y, z), (BUS_LOW_M[0] + 0.02, y, z), 0.025) for y in (-0.38, 0.12) for z in (-0.44, 0.10, 0.55)]
    return join(body, *feet)


def _narrow_cameras() -> Solid:
    """Return the two narrow-angle cameras: an open tube that looks to -y, and the electronics behind it."""
    diameter, length = CAMERA_M
    radius = 0.5 * diameter
    profile = [(radius - 0.012, 0.0), (radius - 0.012, length)]
    cameras = []
    for x, z in ((-0.94, -0.32), (-0.87, 0.03)):
        barrel = wall(profile, 0.012, 32)
        stop = cylinder(radius - 0.006, 0.0, 0.40, 32)  # mirrors and detector close the tube deep inside
        cameras.append(join(barrel, stop).facing((0, -1, 0)).move(x, 0.22, z))
        cameras.append(box_between((-0.91, 0.20, z - 0.15), (-0.76, 0.52, z + 0.15)))
    return join(*cameras)


def _star_trackers() -> Solid:
    """Return the two star trackers: baffles that look past the zenith, away from the wing."""
    lines = [((-0.87, 0.24, 0.34), (-1.09, 0.79, 0.34)), ((-0.90, 0.07, 0.54), (-1.19, 0.41, 0.91))]
    baffles = []
    for start, end in lines:
        way = [b - a for a, b in zip(start, end, strict=True)]
        length = math.sqrt(sum(step**2 for step in way))
        baffle = wall([(0.08, 0.0), (0.08, 0.12), (0.105, 0.16), (0.105, length)], 0.008, 24)
        baffles.append(join(baffle, cylinder(0.085, -0.05, 0.10, 24)).facing(way).move(*start))
    mount = box_between((-1.06, 0.19, 0.23), (-0.72, 0.43, 0.46))
    return join(*baffles, mount)


def _altimeter() -> Solid:
    """Return the laser altimeter low on the bench's side: a box with a wide hood that looks to -y."""
    body = box_between((-0.98, -0.82, -1.10), (-0.58, -0.30, -0.64))
    hood = wall([(0.20, 0.0), (0.19, 0.44)], 0.012, 32).facing((0, -1, -0.15)).move(-0.78, -0.82, -0.87)
    bottom = cylinder(0.205, -0.02, 0.20, 32).facing((0, -1, -0.15)).move(-0.78, -0.82, -0.87)
    beam = tube((-0.88, -0.65, -1.08), (-0.95, -0.65, -1.34), 0.07, 16)
    foot = box_between((-0.98, -0.40, -1.12), (-0.60, -0.20, -0.95))
    return join(body, hood, bottom, beam, foot)


def _neutron_detector() -> Solid:
    """Return the collimated neutron detector that hangs over the edge of the upper deck, on its bracket."""
    can = revolve([(0.0, 0.84), (0.09, 0.84), (0.12, 0.90), (0.12, 1.14), (0.10, 1.14), (0.10, 1.19), (0.0, 1.19)], 20)
    bracket = box_between((-0.52, -0.86, 0.86), (-0.44, -0.62, 1.18))
    return join(can.move(-0.48, -0.89), bracket)


def _instruments() -> Solid:
    """Return the small instruments: ultraviolet spectrograph on the deck, radiometer, particle telescope."""
    spectrograph = [
        box_between((-0.37, -0.69, 1.24), (-0.12, -0.56, 1.52)),
        box_between((-0.36, -0.57, 1.10), (-0.13, -0.53, 1.47)),
        *(tube((x, -0.53, 1.46), (x, -0.16, 1.22), 0.015, 6) for x in (-0.345, -0.165)),
    ]
    radiometer = [
        box_between((-1.22, -0.50, 0.02), (-1.04, -0.42, 0.20)),
        box_between((-1.26, -0.62, 0.25), (-1.00, -0.42, 0.58)),
    ]
    telescope = [
        box_between((-0.98, 0.21, -1.16), (-0.60, 0.57, -1.05)),
        cylinder(0.05, 0.0, 0.06, 16).facing((0, 1, 0)).move(-0.80, 0.57, -1.10),
    ]
    return join(*spectrograph, *radiometer, *telescope)


# The radar's wedge, seen along -z; its antenna lies on the face that looks aslant, between the last two corners.
_WEDGE = [(0.06, -0.62), (0.17, -1.28), (0.70, -0.96), (0.72, -0.62)]


def _radar_support() -> Solid:
    return prism(_WEDGE, -1.12, 0.76)


def _radar() -> Solid:
    """Return the side-looking radar's antenna: a panel on the aslant face of its wedge, with bars of patches."""
    (x0, y0), (x1, y1) = _WEDGE[1:3]
    width = math.hypot(x1 - x0, y1 - y0)
    panel = box((width - 0.04, 0.03, 1.80), (0.0, -0.02, 0.0))
    patches = [
        box((0.5 * width - 0.05, 0.012, 0.10), (side * 0.25 * width, -0.038, -0.80 + 0.145 * k))
        for side in (-1, 1)
        for k in range(12)
    ]
    turn = math.atan2(y1 - y0, x1 - x0) / DEG
    return join(panel, *patches).turn("z", turn).move(0.5 * (x0 + x1), 0.5 * (y0 + y1), -0.18)


def _panels() -> list[tuple[float, int]]:
    """Return the middle of each panel along y [m], and which way its cut corner lies (0 for none)."""
    step = PANEL_M[1] + PANEL_GAP_M
    return [(-step, -1), (0.0, 0), (step, 1)]


def _cells() -> Solid:
    """Return the cells, in strings along the wing, with gaps; none beyond the cut corners."""
    length, width, thickness = PANEL_M
    columns, rows = 14, 6
    step_x, step_y = (length - 0.06) / columns, (width - 0.06) / rows
    cells = []
    for middle, cut in _panels():
        for i in range(columns):
            for j in range(rows):
                x, y = 0.03 + (i + 0.5) * step_x, (j - 0.5 * (rows - 1)) * step_y
                outer = (length - x - 0.5 * step_x) + (0.5 * width - cut * y - 0.5 * step_y)
                if cut == 0 or outer > PANEL_CUT_M:
                    cells.append(box((step_x - 0.012, step_y - 0.012, 0.003), (x, middle + y, -0.5 * thickness)))
    return join(*cells).move(*WING_M)


def _substrate() -> Solid:
    """Return the three panels without their cells, and the hinges between them."""
    length, width, thickness = PANEL_M
    half, cut_m = 0.5 * width, PANEL_CUT_M
    boards = []
    for middle, cut in _panels():
        far = [(length, -half), (length, half)]
        if cut > 0:
            far = [(length, -half), (length, half - cut_m), (length - cut_m, half)]
        elif cut < 0:
            far = [(length - cut_m, -half), (length, -half + cut_m), (length, half)]
        boards.append(prism([(0.0, -half), *far, (0.0, half)], -0.5 * thickness, 0.5 * thickness).move(y=middle))
    gap = half + 0.5 * PANEL_GAP_M
    hinges = [
        join(
            tube((x - 0.10, side * gap, 0.0), (x + 0.10, side * gap, 0.0), 0.028),
            *(
                tube((at, side * (gap - 0.10), 0.0), (at, side * (gap + 0.10), 0.0), 0.02)
                for at in (x - 0.06, x + 0.06)
            ),
        )
        for x in (0.55, 1.95)
        for side in (-1, 1)
    ]
    frame = [tube((x, -half - 0.2, 0.022), (x, half + 0.2, 0.022), 0.015, 6) for x in (0.35, 2.3)]
    return join(*boards, *hinges, *frame).move(*WING_M)


def _yoke() -> Solid:
    """Return the bracket between the wing's drive and its middle panel."""
    x, y, z = WING_M
    beams = [tube((1.22, -0.16 + 0.10 * side, z), (x + 0.06, y + 0.30 * side, z), 0.03) for side in (-1, 1)]
    return join(*beams, box_between((x - 0.03, -0.34, z - 0.03), (x + 0.05, 0.34, z + 0.03)))


def _drive() -> Solid:
    """Return the two drives of the wing on the +x face."""
    across = cylinder(0.09, -0.19, 0.19, 24).facing((0, 1, 0)).move(1.20, -0.16, WING_M[2])
    outward = cylinder(0.085, BUS_HIGH_M[0] - 0.02, 1.20, 24).facing((1, 0, 0)).move(0.0, -0.02, WING_M[2])
    return join(across, outward)


def _high_gain() -> Solid:
    """Return the high-gain antenna: a dish that looks to +y, its rim, back shell, and subreflector on four legs."""
    focal_length = 0.26
    depth = (0.5 * ANTENNA_DIAMETER_M) ** 2 / (4.0 * focal_length)
    reflector = dish(ANTENNA_DIAMETER_M, focal_length, 0.012, 8, 40)
    rim = torus(0.5 * ANTENNA_DIAMETER_M - 0.008, 0.010, 40, 6).move(z=depth)
    legs = [tube((0.34, 0.0, 0.11), (0.05, 0.0, 0.29), 0.008, 6).turn("z", angle) for angle in (45, 135, 225, 315)]
    feed = frustum(0.06, 0.03, 0.0, 0.12, 20)
    subreflector = join(cylinder(0.06, 0.29, 0.32, 20), dome(0.06, 0.03, 3, 20).turn("x", 180).move(z=0.29))
    hub = frustum(0.06, 0.17, -0.10, 0.035, 24)
    return join(reflector, rim, *legs, feed, subreflector, hub).facing((0, 1, 0)).move(*ANTENNA_M)


def _gimbals() -> Solid:
    """Return the two gimbals at the end of the boom, between the boom and the dish."""
    x, _, z = ANTENNA_M
    across = cylinder(0.09, -0.15, 0.15, 20).facing((1, 0, 0)).move(x - 0.05, 2.52, z)
    along = cylinder(0.09, -0.10, 0.12, 20).facing((0, 0, 1)).move(x, 2.76, z - 0.08)
    neck = tube((x, 2.40, z), (x, 2.99, z), 0.045, 12)
    arm = tube((x + 0.02, 2.88, z + 0.01), (x + 0.23, 2.88, z + 0.01), 0.05, 12)
    return join(across, along, neck, arm)


def _boom() -> Solid:
    """Return the antenna's boom from the deployment hinge on the +y face, with collars."""
    x, _, z = ANTENNA_M
    collars = [cylinder(0.075, y, y + 0.05, 16).facing((0, 1, 0)).move(x, 0.0, z) for y in (0.95, 1.60, 2.36)]
    hinge = [
        box_between((0.06, 0.68, -1.04), (0.44, 0.80, -0.88)),
        tube((0.02, 0.81, z), (0.44, 0.81, z), 0.085, 16),
        box_between((0.17, 0.80, -1.04), (0.37, 0.97, -0.90)),
    ]
    return join(tube((x, 0.92, z), (x, 2.44, z), 0.06, 16), *collars, *hinge)


def _omni_boom() -> Solid:
    """Return the rod of the low-gain antenna on the deck, with two struts."""
    rod = tube((0.60, 0.20, 1.05), (1.14, 0.20, 1.91), 0.045, 12)
    struts = [tube((0.885, y, 1.20), (0.885, top, 1.50), 0.015, 6) for y, top in ((-0.54, 0.18), (0.61, 0.22))]
    return join(rod, *struts, box_between((0.54, 0.10, 1.20), (0.74, 0.30, 1.32)))


def _omni() -> Solid:
    """Return the low-gain antenna at the end of its rod."""
    can = cylinder(0.06, 0.0, 0.17, 20).facing((0.54, 0.0, 0.86)).move(1.14, 0.20, 1.91)
    return join(can, ball(0.055, (1.225, 0.20, 2.04), 1))


def _propulsion() -> Solid:
    """Return the blanketed cone below the bus, in the middle of the adapter ring."""
    return revolve([(0.0, -1.24), (0.54, -1.24), (0.54, -1.30), (0.30, -1.47), (0.27, -1.50), (0.0, -1.42)], 40)


def _thrusters() -> Solid:
    """Return the four insertion thrusters in the middle of the cone, and the eight small ones round the ring."""
    bell = wall([(0.02, 0.0), (0.03, -0.05), (0.07, -0.16)], 0.006, 16)
    neck = cylinder(0.03, -0.03, 0.10, 12)
    large = [join(bell, neck).move(0.09 * c, 0.09 * s, -1.42) for c, s in ((1, 1), (-1, 1), (-1, -1), (1, -1))]
    nozzle = frustum(0.03, 0.012, -0.10, 0.0, 12)
    small = [nozzle.move(x, y, -1.21) for x in (-0.55, 0.85) for y in (-0.60, -0.52, 0.52, 0.60)]
    return join(*large, *small)

"""Envisat, inactive since 2012: eight tonnes and 26 m long, the reference target of debris-removal studies."""

from __future__ import annotations

import math

from models.build import envisat_payload as payload
from models.build.primitives import box, cylinder, frustum, lattice, ring, tiles, torus, tube, wall
from rso_lidar.records import Hinge, Taxonomy
from rso_lidar.shapes import CraftModel, CraftPart, Solid, join
from rso_lidar.units import DEG

LENGTH_M = 26.0  # over all, from the instruments at the far end to the tip of the wing
PANELS, PANEL_M, WING_M = 14, (1.0, 4.97, 0.022), 14.2  # each 1 m by 5 m; along the wing
CANT_DEG = 22.0  # of the wing's long side from the axis that it turns about
RADAR_M = (1.33, 9.99)  # the radar antenna, across and along
RADAR_TILT_DEG = 30.0  # of its boresight from nadir, away from the wing
SIDE_M = 2.5  # of the platform's square section
INTERFACE_RADIUS_M = 1.312  # the 2624 mm adapter of Ariane 5

SERVICE_M = (-2.60, -0.45)  # the service module, along x
BAY_M = (-4.20, -2.60)  # the payload equipment bay
CARRIER_M = (-9.50, -4.20)  # the payload carrier
DRIVE_M = (0.15, 0.0, 1.42 + payload.LIFT_M)  # of the solar wing
TIP_M = LENGTH_M + payload.END_M
WING_MIDDLE_M = (TIP_M - 0.5 * (WING_M * math.cos(CANT_DEG * DEG) + PANEL_M[2] * math.sin(CANT_DEG * DEG)), 0.0, 0.40)
WING_NORMAL = (math.sin(CANT_DEG * DEG), math.cos(CANT_DEG * DEG), 0.0)
RADAR_MIDDLE_M = (-3.35, 0.0, -1.80)


def envisat() -> CraftModel:
    """Return Envisat in its own axes: +x out of the launcher's interface, where the wing is, -y flight, -z the Earth."""
    cells, substrate, arm = _wing()
    tiles_, frame, booms = _radar()
    pieces = {
        "bus": CraftPart(_service_module(), "mli_gold", 2048.0),
        "payload_equipment_bay": CraftPart(_block(BAY_M), "mli_gold", 1320.0),
        "payload_carrier": CraftPart(_block(CARRIER_M), "mli_gold", 1898.0),
        "panel_frames": CraftPart(_frames(), "aluminium", 130.0),
        "radiator_flight": CraftPart(_radiators(), "osr", 25.0),
        "radiator_wake": CraftPart(_radiators().mirror("y"), "osr", 25.0),
        "radiator_battery": CraftPart(_battery_radiators(), "white_paint", 10.0),
        "adapter_cone": CraftPart(_adapter_cone(), "cfrp", 120.0),
        "adapter_ring": CraftPart(_adapter_ring(), "aluminium", 60.0),
        "solar_array": CraftPart(cells, "solar_cell_si", 100.0),
        "solar_substrate": CraftPart(substrate, "cfrp", 225.0),
        "solar_arm": CraftPart(arm, "cfrp", 35.0),
        "solar_drive": CraftPart(_drive(), "mli_silver", 40.0),
        "antenna_asar": CraftPart(tiles_, "white_paint", 450.0),
        "antenna_asar_frame": CraftPart(frame, "cfrp", 250.0),
        "boom_asar": CraftPart(booms, "cfrp", 30.0),
        "thruster": CraftPart(_thrusters(), "aluminium", 30.0),
        **payload.pieces(),
    }
    return CraftModel(
        name="envisat",
        what="Envisat (2002-009A), the dead Earth-observation satellite of ESA, its wing and radar antenna deployed",
        source=(
            "ESA, Envisat space segment: 26 m x 10 m x 5 m in orbit, 10.5 m long at launch, service module 2673 kg, "
            "equipment bay 1021 kg, carrier 2078 kg, instruments 2118 kg, axes; TBS Satellite, Envisat 1: wing of 14 m "
            "and 400 kg; CSA, Envisat payload: radar antenna of some 700 kg; ILRS, Envisat centre of mass (-3.86, "
            "-0.01, 0.00) m and retroreflector (-4.920, 1.350, -1.180) m; IDS: height of the DORIS antenna -1.725 m; "
            "Kucharski et al. 2014 (IEEE TGRS 52, 7651), Sommer et al. 2017 (JBIS 70, 45), Lin & Zhao 2018 (ASR 61, "
            "182): rotation periods of 121 s in 2013 to 226 s in 2017"
        ),
        confidence=(
            "Overall size, masses of the modules and the places of retroreflector and DORIS antenna are published. "
            "Square section of 2.5 m, 14 panels of 1 m x 5 m and antenna of 10 m x 1.3 m as commonly quoted, not looked "
            "up. Lengths of the modules, cant of the wing (22 deg), tilt of the radar, the shapes and places of the "
            "instruments and all details are guesses from pictures; the angle at which the wing stopped is not known. "
            "The platform stands 0.13 m off the axis of the interface, away from the Earth, and masses within a module are "
            "split by guess so that the published centre of mass comes out within 0.1 m. Materials are guesses."
        ),
        axes=(
            "+x along the platform, out of the launcher's interface and towards the wing, the orbit's normal in "
            "service; -y along the flight; -z to the Earth; origin at the middle of the interface plane"
        ),
        pieces=pieces,
        taxonomy=Taxonomy(
            object_class="payload",
            subclass="earth_observation",
            shape_family="box_wing",
            size_class="large",
            stabilisation="tumbling",
            rate_deg_s=(1.6, 3.0),
        ),
        hinges=(
            Hinge(
                name="solar_wing",
                parts=("solar_array", "solar_substrate", "solar_arm"),
                position_m=DRIVE_M,
                axis=(1.0, 0.0, 0.0),
                normal=WING_NORMAL,
            ),
        ),
    )


def _block(span_m: tuple[float, float], inset_m: float = 0.0) -> Solid:
    """Return a module of the platform from x to x [m]."""
    low, high = span_m
    side = SIDE_M - 2.0 * inset_m
    return box((high - low, side, side), (0.5 * (low + high), 0.0, 0.0)).move(z=payload.LIFT_M)


def _service_module() -> Solid:
    """Return the service module with its boxes, star trackers and the floor round the launcher's interface."""
    body = _block(SERVICE_M, 0.06)
    boxes = [box((0.9, 0.14, 0.8), (-1.5, side * 1.24, z)) for side in (-1, 1) for z in (-0.62, 0.42)] + [
        box((0.7, 0.9, 0.16), (-1.9, -0.4, 1.25)),
        box((0.5, 0.5, 0.14), (-0.9, 0.8, -1.24)),
    ]
    trackers = [
        ring(0.085, 0.105, 0.0, 0.36, 24).facing((-0.2, y, 1.0)).move(-2.30, 0.5 + 0.4 * y, 1.18)
        for y in (-0.5, 0.0, 0.5)
    ]
    return join(body, join(*boxes, *trackers).move(z=payload.LIFT_M))


def _frames() -> Solid:
    """Return the edges of the platform's panels: hoops between the bays and longerons along the corners."""
    stations = [SERVICE_M[0], BAY_M[0], *(CARRIER_M[0] + k * (CARRIER_M[1] - CARRIER_M[0]) / 4 for k in range(4))]
    outside = 0.5 * SIDE_M + 0.012
    across = [-outside, -outside + 0.07, outside - 0.07, outside]
    hoop = lattice(across, across, [(1, 1)], 0.06).turn("y", 90)
    rails = [
        box((BAY_M[1] - CARRIER_M[0], 0.07, 0.07), (0.5 * (BAY_M[1] + CARRIER_M[0]), y, z))
        for y in (-outside + 0.035, outside - 0.035)
        for z in (-outside + 0.035, outside - 0.035)
    ]
    return join(*(hoop.move(x) for x in stations), *rails).move(z=payload.LIFT_M)


def _radiators() -> Solid:
    """Return the mirrors on the flight side, one field to each bay of the carrier and the equipment bay."""
    bays = [(-3.40, 1.2), *((CARRIER_M[0] + (k + 0.5) * 1.325, 0.95) for k in range(4))]
    fields = [tiles((width, 1.5, 0.02), (5, 6), 0.012, (x, 0.0, 0.0)).turn("x", 90) for x, width in bays]
    heights = (0.3, -0.25, 0.25, -0.2, 0.3)
    return join(*(field.move(y=-0.5 * SIDE_M - 0.006, z=z) for field, z in zip(fields, heights, strict=True))).move(
        z=payload.LIFT_M
    )


def _battery_radiators() -> Solid:
    """Return the white plates on both sides of the service module."""
    return join(*(box((1.2, 0.03, 0.35), (-1.5, side * 1.20, z)) for side in (-1, 1) for z in (-0.1, 0.95))).move(
        z=payload.LIFT_M
    )


def _adapter_cone() -> Solid:
    """Return the cone between the interface and the service module."""
    profile = [(INTERFACE_RADIUS_M - 0.03, -0.04), (1.16, SERVICE_M[1] - 0.02)]
    floor = cylinder(1.17, SERVICE_M[1] - 0.02, SERVICE_M[1] + 0.03, 64)
    return join(wall(profile, 0.02, 64), floor).turn("y", 90)


def _adapter_ring() -> Solid:
    """Return the launcher's interface ring: a flange, and the step that a clamp takes hold of."""
    flange = ring(INTERFACE_RADIUS_M - 0.05, INTERFACE_RADIUS_M, -0.025, 0.0, 72)
    step = ring(INTERFACE_RADIUS_M - 0.035, INTERFACE_RADIUS_M - 0.012, -0.07, -0.02, 72)
    return join(flange, step).turn("y", 90)


def _on_wing(solid: Solid) -> Solid:
    """Return a solid drawn in the plane of the wing (x along, y across, cells to +z) put where the wing is."""
    return solid.turn("x", -90).turn("z", -CANT_DEG).move(*WING_MIDDLE_M)


def _wing_point(along_m: float, across_m: float) -> tuple[float, float, float]:
    cos, sin = math.cos(CANT_DEG * DEG), math.sin(CANT_DEG * DEG)
    x, y, z = WING_MIDDLE_M
    return x + along_m * cos, y - along_m * sin, z - across_m


def _wing() -> tuple[Solid, Solid, Solid]:
    """Return the cells, the panels with hinges and the arm of the solar wing."""
    length, width, thickness = PANEL_M
    step = (WING_M - length) / (PANELS - 1)
    places = [(k - 0.5 * (PANELS - 1)) * step for k in range(PANELS)]
    front = 0.5 * thickness + 0.001
    cells = [tiles((length - 0.06, width - 0.08, 0.002), (3, 10), 0.014, (x, 0.0, front)) for x in places]
    panels = [box(PANEL_M, (x, 0.0, 0.0)) for x in places]
    bars = [box((length - 0.02, 0.05, 0.05), (x, y, -0.5 * thickness - 0.02)) for x in places for y in (-1.3, 1.3)]
    hinges = [
        tube((x + 0.5 * step - 0.04, y, 0.0), (x + 0.5 * step + 0.04, y, 0.0), 0.016, 6)
        for x in places[:-1]
        for y in (-2.1, -0.7, 0.7, 2.1)
    ]
    root = _wing_point(-0.5 * WING_M - 0.25, 0.0)
    elbow = (1.55, 1.55, 1.40)
    yoke = [tube(root, _wing_point(-0.5 * WING_M + 0.06, y), 0.035) for y in (-1.3, 1.3)]
    arm = [
        tube(DRIVE_M, (0.45, 0.0, DRIVE_M[2]), 0.09, 16),
        tube((0.42, 0.0, DRIVE_M[2]), elbow, 0.065, 12),
        tube(elbow, root, 0.065, 12),
        cylinder(0.10, -0.12, 0.12, 16).move(*elbow),
        cylinder(0.10, -0.12, 0.12, 16).move(0.42, 0.0, DRIVE_M[2]),
    ]
    return _on_wing(join(*cells)), _on_wing(join(*panels, *bars, *hinges)), join(*arm, *yoke)


def _drive() -> Solid:
    """Return the drive of the wing in its housing on the side away from the Earth."""
    motor = cylinder(0.17, -0.45, DRIVE_M[0], 24).turn("y", 90).move(z=DRIVE_M[2])
    return join(motor, box((0.55, 0.50, 0.40), (-0.72, 0.0, DRIVE_M[2] - 0.06)))


def _radar() -> tuple[Solid, Solid, Solid]:
    """Return the tiles, the frame and the struts of the radar antenna: five panels of four tiles each."""
    across, along = RADAR_M
    panel = along / 5.0
    faces, frames = [], []
    x_lines = [-0.5 * across, -0.5 * across + 0.06, -0.04, 0.04, 0.5 * across - 0.06, 0.5 * across]
    y_lines = [-0.5 * panel + 0.012, -0.5 * panel + 0.08, -0.04, 0.04, 0.5 * panel - 0.08, 0.5 * panel - 0.012]
    windows = [(i, j) for i in (1, 3) for j in (1, 3)]
    for k in range(5):
        y = (k - 2) * panel
        # two by two tiles, each of eight double rows of radiators
        rows = [
            tiles((0.64, 0.955, 0.03), (8, 1), 0.010, (sx * 0.335, y + sy * 0.49, -0.045))
            for sx in (-1, 1)
            for sy in (-1, 1)
        ]
        faces += rows
        frames.append(lattice(x_lines, y_lines, windows, 0.10).move(y=y, z=0.03))
        frames += [box((0.60, 0.90, 0.03), (sx * 0.335, y + sy * 0.49, -0.015)) for sx in (-1, 1) for sy in (-1, 1)]
        frames += [box((0.24, 0.34, 0.09), (sx * 0.335, y + sy * 0.49, 0.04)) for sx in (-1, 1) for sy in (-1, 1)]
    frames += [
        tube((x, y - 0.06, 0.05), (x, y + 0.06, 0.05), 0.03, 8)
        for x in (-0.5, 0.5)
        for y in ((k - 1.5) * panel for k in range(4))
    ]
    tilted = [join(*group).turn("y", RADAR_TILT_DEG).move(*RADAR_MIDDLE_M) for group in (faces, frames)]
    return tilted[0], tilted[1], _radar_struts(panel)


def _radar_struts(panel_m: float) -> Solid:
    """Return the struts that hold the radar antenna below the platform."""
    x0, _, z0 = RADAR_MIDDLE_M
    cos, sin = math.cos(RADAR_TILT_DEG * DEG), math.sin(RADAR_TILT_DEG * DEG)

    def point(across: float, along: float) -> tuple[float, float, float]:
        return x0 + across * cos + 0.08 * sin, along, z0 - across * sin + 0.08 * cos

    face = payload.LIFT_M - 0.5 * SIDE_M + 0.02
    struts = [
        tube((x, y, face), point(across, near), 0.035, 10)
        for across, feet in ((0.5, (-2.75, -3.35)), (-0.5, (-3.35, -4.1)))
        for x in feet
        for y, near in ((-0.9, -0.5 * panel_m + 0.1), (0.9, 0.5 * panel_m - 0.1))
    ]
    stays = [
        tube((x0, side * 1.2, face), point(across, side * 1.45 * panel_m), 0.018, 8)
        for side in (-1, 1)
        for across in (-0.5, 0.5)
    ]
    return join(*struts, *stays)


def _thrusters() -> Solid:
    """Return the thrusters: pairs of small bells round the interface and on the sides of the service module."""
    bell = frustum(0.020, 0.055, 0.0, 0.13, 12)
    behind = [
        join(*(bell.facing((1, 0, 0)).move(-0.50, y, z + dz) for dz in (-0.08, 0.08)))
        for y, z in ((-1.10, -1.10), (1.10, -1.10), (1.10, 1.10), (-1.10, 1.10))
    ]
    beside = [bell.facing((0, side, 0)).move(x, 1.18 * side, -0.35) for side in (-1, 1) for x in (-0.70, -0.86, -2.40)]
    below = [bell.facing((0, 0, -1)).move(x, y, -1.18) for x in (-0.70, -0.86) for y in (-0.8, -0.2)]
    tank_ring = torus(0.55, 0.03, 40, 5).turn("y", 90).move(x=SERVICE_M[1] + 0.05)
    return join(*behind, *beside, *below, tank_ring).move(z=payload.LIFT_M)

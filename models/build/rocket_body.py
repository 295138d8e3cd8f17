"""A spent cryogenic upper stage of the Centaur III class, among the largest debris."""

from __future__ import annotations

import math

from models.build.primitives import ball, box, cylinder, frustum, revolve, ring, torus, tube, wall
from rso_lidar.records import Symmetry, Taxonomy
from rso_lidar.shapes import CraftModel, CraftPart, Solid, join, pipe
from rso_lidar.units import DEG

LENGTH_M = 12.68  # from the nozzle's exit to the forward ring of the stage
RADIUS_M = 1.525  # 3.05 m in diameter
NOZZLE_EXIT_RADIUS_M = 0.585  # 1.17 m exit
AREA_RATIO = 84.0
THROAT_RADIUS_M = NOZZLE_EXIT_RADIUS_M / math.sqrt(AREA_RATIO)
ENGINE_LENGTH_M = 2.29
INTERFACE_RADIUS_M = 0.597  # 1194 mm clamp-band interface

EXIT_M = -0.5 * LENGTH_M
FRONT_M = 0.5 * LENGTH_M
BARREL_AFT_M = EXIT_M + 3.75
BARREL_FRONT_M = FRONT_M - 1.00


def rocket_body() -> CraftModel:
    """Return the stage with its axis along +x: payload end forward, nozzle to the rear."""
    along_z = {
        "tank": CraftPart(_tank(), "white_paint", 1100.0, hollow=True),
        "skirt_aft": CraftPart(_aft_skirt(), "aluminium", 120.0),
        "skirt_forward": CraftPart(_forward_skirt(), "aluminium", 180.0),
        "payload_adapter": CraftPart(_payload_adapter(), "cfrp", 60.0),
        "adapter_ring": CraftPart(_adapter_ring(), "aluminium", 15.0),
        "thrust_structure": CraftPart(_thrust_structure(), "aluminium", 80.0),
        "engine": CraftPart(_engine(), "aluminium", 130.0),
        "nozzle": CraftPart(_nozzle(), "aluminium", 40.0),
        "feed_lines": CraftPart(_feed_lines(), "mli_silver", 60.0),
        "bottles": CraftPart(_bottles(), "mli_gold", 180.0, hollow=True),
        "thruster": CraftPart(_thrusters(), "aluminium", 20.0),
        "cable_tunnels": CraftPart(_tunnels(), "aluminium", 40.0),
        "avionics": CraftPart(_avionics(), "white_paint", 220.0),
        "antenna": CraftPart(_antennas(), "black_paint", 2.0),
    }
    pieces = {name: piece.turn("y", 90) for name, piece in along_z.items()}
    return CraftModel(
        name="rocket_body",
        symmetry=Symmetry(axis=(1.0, 0.0, 0.0), fold=0),
        what="Spent cryogenic upper stage of the Centaur III class (Atlas V), one engine, with its payload adapter",
        source=(
            "Encyclopedia entry 'Centaur (rocket stage)': Centaur III 12.68 m long, 3.05 m in diameter, 2247 kg "
            "empty with one engine; RL10A-4-2 figures as commonly quoted: 2.29 m long, 1.17 m exit, area ratio "
            "84; 1194 mm clamp-band interface"
        ),
        confidence=(
            "Length, diameter and empty mass published; engine figures as commonly quoted, not looked up "
            "(medium). Lengths of barrel, domes and skirts, lines, bottles, boxes and thrusters are guesses from "
            "pictures; the payload adapter (60 kg cone and 15 kg ring) stands beyond the published length. The "
            "tank's foam is taken for white paint."
        ),
        axes=(
            "+x along the axis towards the payload end, nozzle at -x; y and z across; origin half way along the stage"
        ),
        pieces=pieces,
        taxonomy=Taxonomy(
            object_class="rocket_body",
            subclass="upper_stage",
            shape_family="cylinder",
            size_class="large",
            stabilisation="tumbling",
            rate_deg_s=(0.1, 10.0),
        ),
    )


def _tank() -> Solid:
    """Return the oxygen and hydrogen tanks under foam: a barrel between two ellipsoidal ends."""
    aft = [(RADIUS_M * math.sin(a * DEG), BARREL_AFT_M - 0.95 * math.cos(a * DEG)) for a in range(0, 90, 9)]
    band = [
        (RADIUS_M + 0.012, BARREL_AFT_M + 2.05),
        (RADIUS_M + 0.012, BARREL_AFT_M + 2.20),
    ]  # over the common bulkhead
    barrel = [(RADIUS_M, BARREL_AFT_M), (RADIUS_M, BARREL_AFT_M + 2.04), *band, (RADIUS_M, BARREL_AFT_M + 2.21)]
    forward = [(RADIUS_M * math.cos(a * DEG), BARREL_FRONT_M + 0.80 * math.sin(a * DEG)) for a in range(0, 90, 9)]
    return revolve([*aft, *barrel, *forward, (0.0, BARREL_FRONT_M + 0.80)], 96)


def _ribbed_skirt(low: float, high: float, rings: int, stringers: int) -> Solid:
    """Return a thin cylinder about the tank, with frames and stringers outside.

    Parameters
    ----------
    low, high : z of its ends [m]
    rings : number of frames
    stringers : number of stringers
    """
    shell = wall([(RADIUS_M - 0.004, low), (RADIUS_M - 0.004, high)], 0.012, 72)
    frames = [torus(RADIUS_M + 0.012, 0.014, 72, 4).move(z=low + k * (high - low) / (rings - 1)) for k in range(rings)]
    bar = box((0.022, 0.022, high - low), (RADIUS_M + 0.016, 0.0, 0.5 * (low + high)))
    bars = [bar.turn("z", 360.0 * k / stringers) for k in range(stringers)]
    return join(shell, *frames, *bars)


def _aft_skirt() -> Solid:
    """Return the stub of the interstage that stays with the stage: an open ring behind the barrel."""
    return _ribbed_skirt(BARREL_AFT_M - 0.55, BARREL_AFT_M + 0.10, 3, 48)


def _forward_skirt() -> Solid:
    """Return the forward adapter: an open cylinder that carries avionics and payload."""
    return _ribbed_skirt(BARREL_FRONT_M - 0.05, FRONT_M - 0.014, 4, 48)


def _payload_adapter() -> Solid:
    """Return the truncated cone from the forward ring to the payload's clamp band, open at both ends."""
    slope = [(RADIUS_M - 0.03, FRONT_M - 0.02), (1.05, FRONT_M + 0.42), (INTERFACE_RADIUS_M - 0.025, FRONT_M + 0.80)]
    return wall(slope, 0.02, 72)


def _adapter_ring() -> Solid:
    """Return the clamp-band ring at the very front, with springs that pushed the payload off."""
    band = ring(INTERFACE_RADIUS_M - 0.035, INTERFACE_RADIUS_M, FRONT_M + 0.78, FRONT_M + 0.86, 72)
    springs = [
        cylinder(0.025, FRONT_M + 0.76, FRONT_M + 0.92, 10).move(INTERFACE_RADIUS_M - 0.07).turn("z", 45.0 + 90.0 * k)
        for k in range(4)
    ]
    arms = [
        box((0.06, 0.05, 0.03), (INTERFACE_RADIUS_M - 0.05, 0.0, FRONT_M + 0.80)).turn("z", 45.0 + 90.0 * k)
        for k in range(4)
    ]
    return join(band, *springs, *arms)


def _bell(station: float) -> float:
    """Return the inner radius of the bell [m] at `station`, 0 (throat) to 1 (exit): a parabola, steepest at the throat."""
    return THROAT_RADIUS_M + (NOZZLE_EXIT_RADIUS_M - THROAT_RADIUS_M) * (1.75 * station - 0.75 * station**2)


def _nozzle() -> Solid:
    """Return chamber, throat and bell as one thin wall, open at the exit, with hoops outside."""
    throat = EXIT_M + 1.62
    bell = [(_bell(k / 14), throat - 1.62 * k / 14) for k in range(15)]
    chamber = [(0.125, throat + 0.36), (0.125, throat + 0.16), (0.095, throat + 0.06)]
    hoops = [torus(_bell(s) + 0.012, 0.010, 48, 4).move(z=throat - 1.62 * s) for s in (0.35, 0.55, 0.75, 0.995)]
    return join(wall([*chamber, *bell], 0.012, 48), *hoops)


def _engine() -> Solid:
    """Return the injector head, gimbal, turbopumps, manifold and their lines above the nozzle."""
    head = EXIT_M + 1.98
    injector = frustum(0.16, 0.10, head - 0.04, head + 0.12, 24)
    gimbal = cylinder(0.07, head + 0.10, EXIT_M + ENGINE_LENGTH_M, 16)
    fuel_pump = cylinder(0.13, -0.25, 0.25, 20).move(0.34, 0.0, head - 0.20)
    oxidizer_pump = cylinder(0.11, -0.20, 0.20, 20).facing((0, 1, 0)).move(0.0, 0.34, head - 0.12)
    gearbox = box((0.24, 0.22, 0.20), (0.26, 0.26, head - 0.12))
    manifold = torus(0.30, 0.035, 36, 8).move(z=head - 0.78)
    around = [(0.34, 0.0, head - 0.40), (0.42, -0.12, head - 0.60), (0.36, -0.20, head - 0.78)]
    turbine = [
        (0.20, 0.20, head - 0.10),
        (-0.10, 0.34, head - 0.05),
        (-0.26, 0.10, head + 0.02),
        (-0.10, 0.0, head + 0.06),
    ]
    actuators = [
        tube((0.30 * x, 0.30 * y, head - 0.70), (0.30 * x, 0.30 * y, head + 0.75), 0.03, 10)
        for x, y in ((-1, 0), (0, -1))
    ]
    return join(
        injector,
        gimbal,
        fuel_pump,
        oxidizer_pump,
        gearbox,
        manifold,
        pipe(around, 0.035),
        pipe(turbine, 0.03),
        *actuators,
    )


def _thrust_structure() -> Solid:
    """Return the cone and struts that carry the engine's thrust to the tank."""
    top = BARREL_AFT_M - 0.72
    apex = EXIT_M + ENGINE_LENGTH_M - 0.05
    cone = frustum(0.16, 0.40, apex - 0.02, top + 0.02, 32)
    struts = [
        tube((0.16, 0.0, apex), (1.05, 0.0, BARREL_AFT_M - 0.66), 0.028).turn("z", 22.5 + 45.0 * k) for k in range(8)
    ]
    hoop = torus(1.05, 0.03, 48, 6).move(z=BARREL_AFT_M - 0.71)
    return join(cone, *struts, hoop)


def _feed_lines() -> Solid:
    """Return the hydrogen line down the outside of the tank, the oxygen line, and a vent line to the front."""
    outside = RADIUS_M + 0.09
    head = EXIT_M + 1.80
    hydrogen = [
        (RADIUS_M - 0.1, 0.0, BARREL_AFT_M + 2.70),
        (outside, 0.0, BARREL_AFT_M + 2.50),
        (outside, 0.0, BARREL_AFT_M - 0.62),
    ]
    hydrogen += [(1.40, 0.0, BARREL_AFT_M - 0.90), (0.70, 0.0, head + 0.20), (0.34, 0.0, head - 0.02)]
    oxygen = [
        (0.0, 0.75, BARREL_AFT_M - 0.70),
        (0.0, 0.72, BARREL_AFT_M - 1.00),
        (0.0, 0.40, head + 0.20),
        (0.0, 0.34, head + 0.05),
    ]
    vent = [
        (0.0, -RADIUS_M + 0.1, BARREL_FRONT_M - 1.6),
        (0.0, -outside + 0.02, BARREL_FRONT_M - 1.4),
        (0.0, -outside + 0.02, FRONT_M - 0.25),
    ]
    vent += [(0.0, -outside - 0.10, FRONT_M - 0.15)]
    clamps = [box((0.14, 0.24, 0.05), (RADIUS_M + 0.06, 0.0, BARREL_AFT_M + 0.3 + 0.5 * k)) for k in range(5)]
    return join(pipe(hydrogen, 0.075, 14), pipe(oxygen, 0.07, 14), pipe(vent, 0.04, 10), *clamps)


def _bottles() -> Solid:
    """Return the helium and hydrazine bottles round the aft end."""
    places = [(30, 0.34), (80, 0.26), (150, 0.34), (210, 0.34), (280, 0.26), (330, 0.34)]
    return join(
        *(
            ball(size, (1.12 * math.cos(a * DEG), 1.12 * math.sin(a * DEG), BARREL_AFT_M - 0.95), 3)
            for a, size in places
        )
    )


def _thrusters() -> Solid:
    """Return four pods of attitude thrusters on the aft skirt: two bells to the rear and one to each side."""
    bell = frustum(0.018, 0.050, 0.04, 0.17, 14)
    rear = [bell.facing((0, 0, -1)).move(0.0, y, -0.06) for y in (-0.09, 0.09)]
    sideways = [bell.facing((0, y, 0)).move(0.02, 0.12 * y, 0.04) for y in (-1, 1)]
    pod = join(box((0.16, 0.34, 0.20)), *rear, *sideways).move(RADIUS_M + 0.08, 0.0, BARREL_AFT_M - 0.40)
    return join(*(pod.turn("z", turn) for turn in (45, 135, 225, 315)))


def _tunnels() -> Solid:
    """Return the cable tunnels along the barrel."""
    length = BARREL_FRONT_M - BARREL_AFT_M
    middle = 0.5 * (BARREL_FRONT_M + BARREL_AFT_M)
    tunnel = box((0.07, 0.16, length), (RADIUS_M + 0.03, 0.0, middle))
    return join(*(tunnel.turn("z", turn) for turn in (110, 290)))


def _avionics() -> Solid:
    """Return the boxes round the inside and outside of the forward skirt, and the shelf that they stand on."""
    shelf = ring(0.80, RADIUS_M - 0.02, FRONT_M - 0.18, FRONT_M - 0.15, 72)
    sizes = [(0.42, 0.30, 0.22), (0.30, 0.40, 0.26), (0.36, 0.36, 0.18), (0.26, 0.26, 0.30)]
    boxes = [
        box(sizes[k % 4], (1.12, 0.0, FRONT_M - 0.24 - 0.5 * sizes[k % 4][2] + 0.08)).turn("z", 20.0 + 45.0 * k)
        for k in range(8)
    ]
    outside = [
        box((0.14, 0.34, 0.30), (RADIUS_M + 0.05, 0.0, FRONT_M - 0.60)).turn("z", turn) for turn in (20, 150, 250)
    ]
    return join(shelf, *boxes, *outside)


def _antennas() -> Solid:
    """Return the flush antennas on the forward skirt."""
    patch = box((0.03, 0.12, 0.12), (RADIUS_M + 0.03, 0.0, FRONT_M - 0.35))
    return join(*(patch.turn("z", turn) for turn in (60, 195, 320)))

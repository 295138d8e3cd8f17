"""A spent second stage of the Zenit-2 class (SL-16): nine tonnes, the heaviest debris near 850 km altitude."""

from __future__ import annotations

import math

from models.build.primitives import ball, box, cylinder, frustum, revolve, ring, torus, tube, wall
from rso_lidar.records import Symmetry, Taxonomy
from rso_lidar.shapes import CraftModel, CraftPart, Solid, join, pipe
from rso_lidar.units import DEG

LENGTH_M = 10.4  # from the main nozzle's exit to the payload ring
RADIUS_M = 1.95  # 3.9 m in diameter
NOZZLE_EXIT_RADIUS_M = 0.975
EXIT_M = -0.5 * LENGTH_M
FRONT_M = 0.5 * LENGTH_M
SKIRT_M = EXIT_M + 0.90  # the aft edge of the body
TANK_M = (EXIT_M + 2.75, FRONT_M - 2.10)  # the straight part of the oxygen tank
RING_M = FRONT_M - 1.15  # the front edge of the instrument section


def zenit_stage() -> CraftModel:
    """Return the stage with its axis along +x: payload end forward, nozzles to the rear."""
    along_z = {
        "tank": CraftPart(_tank(), "white_paint", 3000.0, hollow=True),
        "tank_aft": CraftPart(_aft_tank(), "white_paint", 1700.0, hollow=True),
        "skirt_aft": CraftPart(_aft_skirt(), "aluminium", 500.0),
        "instrument_section": CraftPart(_instrument_section(), "white_paint", 600.0),
        "avionics": CraftPart(_avionics(), "white_paint", 450.0),
        "payload_adapter": CraftPart(_payload_adapter(), "aluminium", 250.0),
        "adapter_ring": CraftPart(_adapter_ring(), "aluminium", 60.0),
        "nozzle": CraftPart(_nozzle(), "aluminium", 350.0),
        "engine": CraftPart(_engine(), "aluminium", 775.0),
        "thruster": CraftPart(_verniers(), "aluminium", 380.0),
        "separation_motors": CraftPart(_separation_motors(), "white_paint", 200.0),
        "feed_lines": CraftPart(_lines(), "mli_silver", 60.0),
        "cable_tunnels": CraftPart(_tunnels(), "aluminium", 60.0),
        "bottles": CraftPart(_bottles(), "titanium_bare", 150.0, hollow=True),
        "antenna": CraftPart(_antennas(), "black_paint", 5.0),
    }
    pieces = {name: piece.turn("y", 90) for name, piece in along_z.items()}
    return CraftModel(
        name="zenit_stage",
        symmetry=Symmetry(axis=(1.0, 0.0, 0.0), fold=4),
        what="Spent second stage of the Zenit-2 class (SL-16 R/B): one fixed nozzle, four steering chambers",
        source=(
            "Encyclopedia entry 'Zenit (launch vehicle)': two stages, 57 m by 3.9 m, one main engine RD-120 with a "
            "four-chamber steering engine RD-8 on the second; spaceweather.com, SL-16 R/B"
        ),
        confidence=(
            "Diameter and arrangement of the engines published. Length (10.4 m), empty mass (8.3 to 9 t) and the "
            "nozzle's exit of about 1.95 m as commonly quoted, not looked up. Sections, tanks, adapter, separation "
            "motors, lines and materials are guesses from pictures."
        ),
        axes="+x along the axis towards the payload end, nozzles at -x; y and z across; origin half way along the stage",
        pieces=pieces,
        taxonomy=Taxonomy(
            object_class="rocket_body",
            subclass="upper_stage",
            shape_family="cylinder",
            size_class="large",
            stabilisation="tumbling",
            rate_deg_s=(0.1, 5.0),
        ),
    )


def _round(azimuth_deg: float, radius_m: float, z: float) -> tuple[float, float, float]:
    """Convert cylindrical to Cartesian coordinates.

    Parameters
    ----------
    azimuth_deg : [deg]
    radius_m, z : [m]
    """
    return radius_m * math.cos(azimuth_deg * DEG), radius_m * math.sin(azimuth_deg * DEG), z


def _hoops(*stations_m: float) -> list[Solid]:
    return [torus(RADIUS_M, 0.022, 72, 4).move(z=z) for z in stations_m]


def _tank() -> Solid:
    """Return the oxygen tank: a barrel, flush with the outside, between two domes."""
    low, high = TANK_M
    aft = [(RADIUS_M * math.sin(a * DEG), low - 1.05 * math.cos(a * DEG)) for a in range(0, 90, 10)]
    forward = [(RADIUS_M * math.cos(a * DEG), high + 1.05 * math.sin(a * DEG)) for a in range(0, 90, 10)]
    return join(
        revolve([*aft, (RADIUS_M, low), *forward, (0.0, high + 1.05)], 72), *_hoops(low, 0.5 * (low + high), high)
    )


def _aft_tank() -> Solid:
    """Return the fuel tank: a torus-like drum that leaves room for the engine on the axis."""
    low, high = SKIRT_M + 0.30, TANK_M[0] - 0.02
    bend = 0.28
    inner = 0.78
    profile = [
        (inner + bend, low),
        (RADIUS_M - bend, low),
        (RADIUS_M - 0.08, low + 0.08),
        (RADIUS_M - 0.004, low + bend),
        (RADIUS_M - 0.004, high),
        (inner + 0.5, high),
        (inner, high - 0.4),
        (inner, low + bend),
        (inner + 0.08, low + 0.08),
    ]
    return revolve(profile, 72)


def _aft_skirt() -> Solid:
    """Return the open skirt round the engines, with stringers, frames and the feet of the truss that stood below."""
    shell = wall([(RADIUS_M - 0.014, SKIRT_M), (RADIUS_M - 0.014, SKIRT_M + 0.75)], 0.014, 72)
    bar = box((0.03, 0.03, 0.72), (RADIUS_M + 0.012, 0.0, SKIRT_M + 0.37))
    feet = box((0.12, 0.16, 0.14), (RADIUS_M - 0.05, 0.0, SKIRT_M - 0.05))
    return join(
        shell,
        *_hoops(SKIRT_M + 0.02, SKIRT_M + 0.74),
        *(bar.turn("z", 7.5 * k) for k in range(48)),
        *(feet.turn("z", 30.0 * k) for k in range(12)),
    )


def _instrument_section() -> Solid:
    """Return the cylinder in front of the oxygen tank that carries the instruments: a thin shell with stringers."""
    low, high = TANK_M[1] - 0.02, RING_M
    shell = wall([(RADIUS_M - 0.014, low), (RADIUS_M - 0.014, high)], 0.014, 72)
    bar = box((0.03, 0.03, high - low - 0.04), (RADIUS_M + 0.012, 0.0, 0.5 * (low + high)))
    hatches = [
        box((0.03, 0.50, 0.42), (RADIUS_M + 0.02, 0.0, 0.5 * (low + high))).turn("z", a)
        for a in (33.75, 153.75, 273.75)
    ]
    return join(shell, *_hoops(low + 0.03, high - 0.02), *(bar.turn("z", 7.5 * k) for k in range(48)), *hatches)


def _avionics() -> Solid:
    """Return the boxes on their shelf inside the instrument section, to be seen from the front."""
    shelf = ring(1.05, RADIUS_M - 0.02, RING_M - 0.30, RING_M - 0.26, 64)
    sizes = [(0.42, 0.34, 0.30), (0.34, 0.46, 0.22), (0.40, 0.30, 0.36), (0.30, 0.30, 0.26)]
    boxes = [
        box(sizes[k % 4], (1.55, 0.0, RING_M - 0.27 + 0.5 * sizes[k % 4][2])).turn("z", 12.0 + 36.0 * k)
        for k in range(10)
    ]
    return join(shelf, *boxes)


def _payload_adapter() -> Solid:
    """Return the open truss from the instrument section up to the payload ring: twelve pairs of struts."""
    struts = []
    for k in range(12):
        foot = _round(30.0 * k, RADIUS_M - 0.06, RING_M - 0.03)
        struts += [tube(foot, _round(30.0 * k + turn, 1.12, FRONT_M - 0.06), 0.028, 10) for turn in (-15.0, 15.0)]
    return join(*struts, torus(RADIUS_M - 0.06, 0.04, 64, 6).move(z=RING_M - 0.02))


def _adapter_ring() -> Solid:
    """Return the ring that the payload stood on, with its springs."""
    springs = [cylinder(0.03, FRONT_M - 0.10, FRONT_M, 10).move(1.03).turn("z", 20.0 + 90.0 * k) for k in range(4)]
    return join(ring(1.05, 1.16, FRONT_M - 0.10, FRONT_M - 0.02, 64), *springs)


def _bell(station: float, throat_m: float, exit_m: float) -> float:
    """Return the inner radius of a nozzle [m]: a parabola that is steepest at the throat.

    Parameters
    ----------
    station : 0 at the throat to 1 at the exit
    throat_m, exit_m : radii [m]
    """
    return throat_m + (exit_m - throat_m) * (1.7 * station - 0.7 * station**2)


def _nozzle() -> Solid:
    """Return chamber, throat and bell of the main engine as one thin wall, open at the exit, with hoops outside."""
    throat, length = EXIT_M + 2.35, 2.35
    bell = [(_bell(k / 14, 0.11, NOZZLE_EXIT_RADIUS_M - 0.012), throat - length * k / 14) for k in range(15)]
    chamber = [(0.17, throat + 0.45), (0.17, throat + 0.20), (0.13, throat + 0.08)]
    hoops = [
        torus(_bell(s, 0.11, NOZZLE_EXIT_RADIUS_M - 0.012) + 0.014, 0.014, 40, 4).move(z=throat - length * s)
        for s in (0.30, 0.50, 0.70, 0.88, 0.994)
    ]
    return join(wall([*chamber, *bell], 0.012, 48), *hoops)


def _engine() -> Solid:
    """Return pumps, head and lines of the main engine, and the frame that it hangs in."""
    head = EXIT_M + 2.78
    injector = frustum(0.24, 0.15, head - 0.05, head + 0.18, 24)
    pump = join(cylinder(0.20, -0.55, 0.25, 20), frustum(0.28, 0.20, -0.80, -0.50, 20)).move(0.50, 0.0, head - 0.25)
    line = pipe([(0.50, 0.0, head), (0.40, 0.0, head + 0.25), (0.10, 0.0, head + 0.22)], 0.08, 12)
    manifold = torus(0.42, 0.05, 36, 8).move(z=head - 1.10)
    frame = [tube(_round(45.0 * k, 0.20, head + 0.10), _round(45.0 * k, 0.86, head - 0.60), 0.035, 8) for k in range(8)]
    return join(injector, pump, line, manifold, torus(0.86, 0.04, 48, 6).move(z=head - 0.60), *frame)


def _verniers() -> Solid:
    """Return the steering engine: four chambers in gimbals at the edge of the skirt, and the line that joins them."""
    bell = [(_bell(k / 8, 0.035, 0.235), -0.62 * k / 8) for k in range(9)]
    chamber = wall([(0.07, 0.22), (0.07, 0.08), *bell], 0.008, 24)
    cap = cylinder(0.08, 0.20, 0.26, 20)
    yoke = [
        tube((0.0, -0.20, 0.10), (0.0, 0.20, 0.10), 0.03, 10),
        box((0.14, 0.10, 0.34), (0.0, 0.22, 0.22)),
        box((0.14, 0.10, 0.34), (0.0, -0.22, 0.22)),
    ]
    one = join(chamber, cap, *yoke).move(RADIUS_M - 0.42, 0.0, SKIRT_M + 0.18)
    line = torus(1.30, 0.035, 48, 5).move(z=SKIRT_M + 0.26)
    return join(*(one.turn("z", 45.0 + 90.0 * k) for k in range(4)), line)


def _separation_motors() -> Solid:
    """Return the four solid motors that pushed the stage back: slim cylinders with a nose, in boxes on the aft end."""
    motor = join(
        cylinder(0.12, -0.55, 0.45, 20), frustum(0.12, 0.03, 0.45, 0.72, 20), frustum(0.05, 0.10, -0.70, -0.54, 16)
    )
    saddle = [box((0.16, 0.22, 0.08), (-0.10, 0.0, z)) for z in (-0.35, 0.25)]
    one = join(motor, *saddle).move(RADIUS_M + 0.15, 0.0, SKIRT_M + 1.35)
    return join(*(one.turn("z", 90.0 * k) for k in range(4)))


def _lines() -> Solid:
    """Return the oxygen line outside, past the fuel tank, and two thin lines beside it."""
    low, high = SKIRT_M + 0.35, TANK_M[0] + 0.75
    outside = RADIUS_M + 0.10

    def line(azimuth: float, radius: float, sides: int) -> Solid:
        way = [(RADIUS_M - 0.08, high + 0.2), (outside, high), (outside, low + 0.2), (RADIUS_M - 0.10, low)]
        return pipe([_round(azimuth, r, z) for r, z in way], radius, sides)

    return join(line(20.0, 0.085, 14), line(27.0, 0.03, 8), line(203.0, 0.03, 8))


def _tunnels() -> Solid:
    """Return the cable tunnels along the tanks."""
    low, high = SKIRT_M + 0.80, RING_M - 0.35
    tunnel = box((0.08, 0.22, high - low), (RADIUS_M + 0.035, 0.0, 0.5 * (low + high)))
    ends = [box((0.06, 0.16, 0.14), (RADIUS_M + 0.025, 0.0, z)) for z in (low - 0.06, high + 0.06)]
    clamps = [box((0.11, 0.26, 0.05), (RADIUS_M + 0.035, 0.0, low + 0.5 + k)) for k in range(6)]
    return join(*(join(tunnel, *ends, *clamps).turn("z", a) for a in (110, 290)))


def _bottles() -> Solid:
    """Return the gas bottles over the aft dome and under the payload truss."""
    front = [ball(0.26, _round(a, 1.20, RING_M - 0.62), 2) for a in (60, 180, 300)]
    aft = [ball(0.20, _round(a, 1.45, SKIRT_M + 0.12), 2) for a in (0, 90, 180, 270)]
    return join(*front, *aft)


def _antennas() -> Solid:
    """Return the flush antennas on the instrument section."""
    patch = box((0.03, 0.16, 0.16), (RADIUS_M + 0.03, 0.0, RING_M - 0.30))
    return join(*(patch.turn("z", a) for a in (75, 195, 315)))

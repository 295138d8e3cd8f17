"""The instruments and antennas of Envisat, where pictures show them. -z the Earth, -y flight, -x the far end."""

from __future__ import annotations

import math

from models.build.primitives import ball, box, cylinder, dish, dome, frustum, ring, tube, wall
from rso_lidar.shapes import CraftPart, Solid, join, pipe
from rso_lidar.units import DEG

END_M = -10.45  # the far end of the instruments: 10.5 m long at launch
RETROREFLECTOR_M = (-4.920, 1.350, -1.180)
DORIS_TIP_M = -1.725
ALTIMETER_M = 1.2  # diameter of the altimeter's dish
FACE_M = 1.25  # half the side of the platform
LIFT_M = 0.13  # of the platform off the axis of the interface, away from the Earth
_PUBLISHED = ("antenna_doris", "retroreflector", "retroreflector_bracket")  # whose places are


def pieces() -> dict[str, CraftPart]:
    """Return the instruments and antennas by the names of their parts."""
    cubes, holder = _retroreflector()
    found = {
        "instrument_mipas": CraftPart(_mipas(), "mli_gold", 250.0),
        "instrument_sciamachy": CraftPart(_sciamachy(), "mli_silver", 170.0),
        "instrument_gomos": CraftPart(_gomos(), "mli_gold", 140.0),
        "instrument_meris": CraftPart(_meris(), "mli_silver", 165.0),
        "instrument_aatsr": CraftPart(_aatsr(), "mli_gold", 85.0),
        "baffles": CraftPart(_baffles(), "black_paint", 40.0),
        "antenna_altimeter": CraftPart(_altimeter(), "white_paint", 60.0),
        "instrument_mwr": CraftPart(_microwave_radiometer(), "mli_silver", 25.0),
        "antenna_doris": CraftPart(_doris(), "white_paint", 10.0),
        "retroreflector": CraftPart(cubes, "cube_corner", 0.5),
        "retroreflector_bracket": CraftPart(holder, "aluminium", 1.5),
        "boom_ka_band": CraftPart(_ka_band_mast(), "cfrp", 30.0),
        "antenna_ka_band": CraftPart(_ka_band(), "white_paint", 30.0),
        "antenna_x_band": CraftPart(_x_band(), "white_paint", 12.0),
        "antenna_s_band": CraftPart(_s_band(), "aluminium", 6.0),
        "cable_ducts": CraftPart(_ducts(), "aluminium", 10.0),
    }
    lift = {name: 0.0 if name in _PUBLISHED else LIFT_M for name in found}
    return {
        name: CraftPart(piece.solid.move(z=lift[name]), piece.material, piece.mass_kg) for name, piece in found.items()
    }


def _mipas() -> Solid:
    """Return the interferometer at the far end, wake side: an optics box with a long sideways baffle and cooler."""
    optics = box((0.85, 1.15, 1.40), (-9.92, 0.66, 0.50))
    cooler = box((0.50, 0.85, 0.50), (-10.00, 0.66, 1.42))
    fins = [box((0.46, 0.80, 0.012), (-10.00, 0.66, 1.70 + 0.045 * k)) for k in range(4)]
    post = box((0.30, 0.60, 0.24), (-10.00, 0.66, 1.74))
    rear = box((0.66, 0.62, 0.62), (-9.85, 1.42, 0.35))
    return join(optics, cooler, *fins, post, rear)


def _sciamachy() -> Solid:
    """Return the spectrometer at the flight side of the far end, with its radiant cooler towards deep space."""
    body = box((0.95, 0.70, 1.05), (-9.05, -1.55, 0.55))
    scanner = box((0.40, 0.45, 0.45), (-8.85, -1.70, -0.15))
    cooler = frustum(0.28, 0.42, 0.0, 0.42, 4).turn("z", 45).facing((-1, 0, 0)).move(-9.50, -1.55, 0.62)
    return join(body, scanner, cooler)


def _gomos() -> Solid:
    """Return the star-occultation spectrometer at the far end: a telescope box and a steered mirror in its hood."""
    optics = box((0.80, 0.95, 1.15), (-9.90, -0.62, 0.55))
    lower = box((0.70, 1.30, 0.55), (-9.85, -0.45, -0.35))
    hood = box((0.62, 0.70, 0.20), (-9.90, -0.55, 1.22))
    return join(optics, lower, hood)


def _meris() -> Solid:
    """Return the imaging spectrometer under the carrier: a box across the flight with a fan of five cameras."""
    body = box((1.70, 0.85, 0.62), (-7.45, -0.62, -1.58))
    hood = box((1.30, 0.45, 0.16), (-7.45, -0.62, -1.95))
    calibration = cylinder(0.17, 0.0, 0.30, 20).facing((0, -1, 0)).move(-7.45, -1.04, -1.62)
    return join(body, hood, calibration)


def _aatsr() -> Solid:
    """Return the radiometer under the far end: a drum between two black bodies, on three legs."""
    body = box((0.80, 0.85, 0.55), (-9.05, 0.42, -1.70))
    drum = cylinder(0.30, -0.52, 0.52, 28).turn("x", 90).move(-9.05, 0.42, -1.98)
    legs = [tube((x, y, -1.20), (x, y, -1.50), 0.03) for x, y in ((-9.38, 0.10), (-9.38, 0.75), (-8.72, 0.42))]
    cooler = box((0.45, 0.65, 0.40), (-9.62, 0.42, -1.62))
    return join(body, drum, *legs, cooler)


def _baffles() -> Solid:
    """Return the black mouths of the instruments: each a thin tube or hood that is open in front."""
    sideways = _hood(0.30, 0.36, 0.55, (-9.95, 1.70, 0.35), (0, 1, 0))
    along = _hood(0.28, 0.34, 0.09, (END_M + 0.09, 0.66, 0.55), (-1, 0, 0))
    gomos = _hood(0.26, 0.32, 0.07, (END_M + 0.15, -0.62, 0.60), (-1, 0, 0))
    sciamachy = [
        _hood(0.14, 0.19, 0.30, (-8.85, -1.78, -0.35), (0, -0.3, -1)),
        _hood(0.14, 0.20, 0.32, (-8.85, -1.90, -0.10), (0, -1, -0.25)),
    ]
    meris = [
        _hood(
            0.085, 0.115, 0.20, (-7.45 + 0.26 * k, -0.62, -2.00), (math.sin(14 * k * DEG), 0, -math.cos(14 * k * DEG))
        )
        for k in range(-2, 3)
    ]
    aatsr = [
        _hood(0.20, 0.26, 0.30, (-9.05, 0.52, -2.20), (0, 0.1, -1)),
        _hood(0.20, 0.27, 0.34, (-9.05, 0.00, -2.05), (0, -1.2, -1)),
    ]
    return join(sideways, along, gomos, *sciamachy, *meris, *aatsr)


def _hood(
    inner_m: float, outer_m: float, length_m: float, place_m: tuple[float, ...], direction: tuple[float, ...]
) -> Solid:
    """Return a hood that widens along a direction, closed at its narrow end.

    Parameters
    ----------
    inner_m, outer_m : radii at the closed and at the open end [m]
    length_m : of the hood [m]
    place_m : middle of the closed end [m]
    direction : from the closed to the open end
    """
    shell = wall([(inner_m, 0.0), (outer_m, length_m)], 0.012, 22)
    return join(shell, cylinder(inner_m + 0.006, -0.02, 0.012, 22)).facing(direction).move(*place_m)


def _altimeter() -> Solid:
    """Return the altimeter's dish of 1.2 m, that looks down, with its feed on a tripod."""
    reflector = dish(ALTIMETER_M, 0.43, 0.012, 7, 44)
    edge = 0.5 * ALTIMETER_M
    depth = edge**2 / (4.0 * 0.43)
    legs = [
        tube(
            ((edge - 0.03) * math.cos(a), (edge - 0.03) * math.sin(a), depth - 0.03),
            (0.05 * math.cos(a), 0.05 * math.sin(a), 0.46),
            0.011,
            6,
        )
        for a in (30 * DEG, 150 * DEG, 270 * DEG)
    ]
    feed = frustum(0.05, 0.09, 0.36, 0.52, 20)
    back = frustum(0.30, 0.18, -0.22, 0.01, 24)
    rim = ring(edge - 0.008, edge + 0.006, depth - 0.02, depth + 0.006, 44)
    return join(reflector, feed, back, rim, *legs).turn("x", 180).move(-5.75, -0.35, -FACE_M - 0.20)


def _microwave_radiometer() -> Solid:
    """Return the radiometer beside the altimeter: a small offset dish, two horns and a sky horn."""
    reflector = dish(0.62, 0.35, 0.012, 6, 32).facing((0.0, 0.55, -0.85)).move(-5.75, 0.78, -1.42)
    horns = [
        wall([(0.03, 0.0), (0.06, 0.14)], 0.006, 16).facing((0.0, -0.5, 0.85)).move(x, 1.12, -1.95)
        for x in (-5.66, -5.84)
    ]
    stand = [tube((x, 1.10, -1.20), (x, 1.14, -1.96), 0.018) for x in (-5.55, -5.95)]
    sky = wall([(0.05, 0.0), (0.11, 0.26)], 0.008, 20).facing((0, 1, 0.2)).move(-6.15, 1.24, -0.95)
    return join(
        reflector,
        *horns,
        *stand,
        tube((-5.55, 1.14, -1.96), (-5.95, 1.14, -1.96), 0.02),
        sky,
        box((0.3, 0.12, 0.3), (-6.15, 1.26, -0.95)),
    )


def _doris() -> Solid:
    """Return the antenna of the orbit beacon: a slim cone on a round plate; its tip is at the published height."""
    cone = frustum(0.08, 0.055, 0.08, -DORIS_TIP_M - FACE_M + LIFT_M - 0.02, 24)
    tip = dome(0.055, 0.02, 4, 24).move(z=-DORIS_TIP_M - FACE_M + LIFT_M - 0.02)
    plate = cylinder(0.17, -0.01, 0.08, 28)
    return join(cone, tip, plate).turn("x", 180).move(-6.75, 0.85, LIFT_M - FACE_M)


def _retroreflector() -> tuple[Solid, Solid]:
    """Return the laser retroreflector, one corner cube below and eight round it, and the cone that holds them."""
    prism = frustum(0.019, 0.019, 0.0, 0.012, 12)
    leaning = prism.facing((math.cos(50 * DEG), 0, math.sin(50 * DEG))).move(0.064, 0.0, 0.004)
    cubes = join(prism.move(z=0.034), *(leaning.turn("z", 45.0 * k) for k in range(8)))
    holder = join(frustum(0.085, 0.045, -0.03, 0.035, 16), box((0.16, 0.16, 0.02), (0.0, -0.02, -0.035)))
    placed = [solid.turn("x", 180).move(*RETROREFLECTOR_M) for solid in (cubes, holder)]
    return placed[0], placed[1]


def _ka_band_mast() -> Solid:
    """Return the mast of the relay antenna on the side away from the Earth, with its elbow and gimbal."""
    foot = box((0.34, 0.34, 0.12), (-6.60, 0.35, FACE_M + 0.05))
    mast = pipe([(-6.60, 0.35, FACE_M), (-6.60, 0.35, 2.15)], 0.055, 14)
    gimbal = box((0.26, 0.26, 0.24), (-6.60, 0.35, 2.22))
    stays = [
        tube((-6.60 + x, 0.35 + y, FACE_M), (-6.60, 0.35, 1.85), 0.014, 6)
        for x, y in ((-0.4, -0.3), (0.4, -0.3), (0.0, 0.5))
    ]
    return join(foot, mast, gimbal, *stays)


def _ka_band() -> Solid:
    """Return the relay antenna: a dish of 0.9 m with a subreflector on struts."""
    reflector = dish(0.90, 0.32, 0.010, 6, 40)
    cap = dome(0.09, 0.03, 4, 20).turn("x", 180).move(z=0.30)
    struts = [
        tube((0.40 * math.cos(a), 0.40 * math.sin(a), 0.12), (0.08 * math.cos(a), 0.08 * math.sin(a), 0.29), 0.007, 6)
        for a in (30 * DEG, 150 * DEG, 270 * DEG)
    ]
    horn = frustum(0.05, 0.03, -0.01, 0.12, 16)
    hub = frustum(0.12, 0.17, -0.12, 0.01, 20)
    return join(reflector, cap, horn, hub, *struts).facing((0.25, 0.35, 1.0)).move(-6.57, 0.39, 2.42)


def _x_band() -> Solid:
    """Return the two shaped downlink antennas under the platform."""
    shell = wall([(0.02, 0.0), (0.10, 0.02), (0.17, 0.07)], 0.008, 28)
    feed = join(tube((0, 0, 0), (0, 0, 0.20), 0.014), cylinder(0.04, 0.19, 0.22, 16))
    one = join(shell, feed, cylinder(0.05, -0.24, 0.01, 16)).turn("x", 180)
    return join(*(one.move(-4.72, y, -FACE_M - 0.22) for y in (-0.95, -0.45)))


def _s_band() -> Solid:
    """Return the two command antennas on short booms, towards the Earth and away from it."""
    boom = tube((0, 0, 0), (0, 0, 0.55), 0.016, 8)
    helix = [(0.045 * math.cos(a * 45 * DEG), 0.045 * math.sin(a * 45 * DEG), 0.55 + 0.012 * a) for a in range(17)]
    one = join(boom, pipe(helix, 0.006, 5), ball(0.025, (0, 0, 0.56), 1))
    return join(one.move(-1.0, -0.8, 1.17), one.turn("x", 180).move(-2.2, 0.6, -1.17))


def _ducts() -> Solid:
    """Return the cable ducts and bars along the side away from the Earth."""
    z = FACE_M + 0.03
    ducts = [box((4.6, 0.10, 0.06), (-6.7, y, z)) for y in (-0.75, 0.95)]
    bars = [tube((x, -0.75, z), (x, 0.95, z), 0.014, 6) for x in (-4.6, -5.6, -7.6, -8.6)]
    return join(*ducts, *bars)

"""Conditions of events on a grid of 1 s, written apart from those of the package, and their comparison with intervals."""

import numpy as np

from rso_lidar.orbit import Epochs, moon_position_m, sun_position_m

EARTH_M, SUN_M = 6378137.0, 6.957e8
EDGE_S = 0.1  # how far an edge may be from the change of sign on the grid


def between(a, b):
    cosine = np.sum(a * b, axis=1) / (np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1))
    return np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))


def disc(radius, vectors):
    return np.degrees(np.arcsin(radius / np.linalg.norm(vectors, axis=1)))


def make_oracle(own, target, start_utc, station, limits):
    """Return a function from instants [s] to whether (time,) each named expression holds."""

    def at(time_s):
        epochs = Epochs(start_utc, time_s)
        here, there = own.states(epochs), target.states(epochs)
        a, b, v = here.position_m, there.position_m, here.velocity_m_s
        line, rate = b - a, there.velocity_m_s - v
        apart = np.linalg.norm(line, axis=1)
        sun, moon = sun_position_m(epochs), moon_position_m(epochs)
        to_sun_a, to_sun_b = sun - a, sun - b
        share = np.clip(-np.sum(a * line, axis=1) / apart**2, 0.0, 1.0)
        height = np.linalg.norm(a + share[:, None] * line, axis=1)
        phase = between(to_sun_b, -line)
        normal = np.cross(a, v)
        ahead = np.cross(normal, a)
        earth_a, earth_b = disc(EARTH_M, a), disc(EARTH_M, b)
        sunlit = between(to_sun_b, -b) > earth_b
        return {
            f"range < {limits['range']}m": apart < limits["range"],
            f"slew > {limits['slew']}rad/s": np.linalg.norm(np.cross(line, rate), axis=1) / apart**2 > limits["slew"],
            "sun < 45deg": between(line, to_sun_a) < 45.0,
            "moon < 50deg": between(line, moon - a) < 50.0,
            "limb < 20deg": between(line, -a) - earth_a < 20.0,
            "phase > 75deg": phase > 75.0,
            "angle(+t) < 60deg": between(line, ahead) < 60.0,
            "visible": height > EARTH_M,
            "sunlit": sunlit,
            "lit": sunlit & (phase < 90.0),
            "umbra": between(to_sun_b, -b) < earth_b - disc(SUN_M, to_sun_b),
            "penumbra(follower)": between(to_sun_a, -a) < earth_a + disc(SUN_M, to_sun_a),
            "contact(G)": np.degrees(station.see(own, epochs).elevation_rad) > station.least_elevation_deg,
            "elevation(G, target) > 30deg": np.degrees(station.see(target, epochs).elevation_rad) > 30.0,
        }

    return at


def choose_limits(own, target, start_utc, days):
    """Choose limits of range and slew that a pair crosses often: medians over the span."""
    epochs = Epochs(start_utc, np.linspace(0.0, 86400.0 * days, 2000))
    here, there = own.states(epochs), target.states(epochs)
    line, rate = there.position_m - here.position_m, there.velocity_m_s - here.velocity_m_s
    apart = np.linalg.norm(line, axis=1)
    slew = np.linalg.norm(np.cross(line, rate), axis=1) / apart**2
    return {"range": round(float(np.quantile(apart, 0.3)), 1), "slew": float(f"{np.quantile(slew, 0.7):.3g}")}


def combine(held):
    """Return one expression of and, or, not, and whether (time,) it holds."""
    first, second = list(held)[:2]
    text = f"({first} or not umbra) and not (sun < 45deg and visible) and not {second}"
    return text, (held[first] | ~held["umbra"]) & ~(held["sun < 45deg"] & held["visible"]) & ~held[second]


def compare(spans, held, oracle, time_s):
    """Compare spans [s] with a mask on a grid; return how many spans the grid shows, and edges that it contradicts.

    Parameters
    ----------
    oracle : function from instants to a mask
    """
    mask = np.zeros(len(time_s), dtype=bool)
    for begin, end in spans:
        mask |= (time_s >= begin) & (time_s <= end)
    edges = np.array([edge for span in spans for edge in span])
    wrong = np.flatnonzero(mask != held)
    far = [k for k in wrong if not len(edges) or np.abs(edges - time_s[k]).min() > EDGE_S]
    alone = np.diff(edges, prepend=-np.inf) > EDGE_S, np.diff(edges, append=np.inf) > EDGE_S  # not of a shorter event
    inner = edges[(edges > time_s[0] + 1.0) & (edges < time_s[-1] - 1.0) & alone[0] & alone[1]] if len(edges) else edges
    moved = 0
    if len(inner):
        before, after = oracle(inner - 0.5 * EDGE_S), oracle(inner + 0.5 * EDGE_S)
        moved = int(np.sum(before == after))
    seen = int(np.sum(held[1:] & ~held[:-1]) + held[0])
    return seen, len(far), moved

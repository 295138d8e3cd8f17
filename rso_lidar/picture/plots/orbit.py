"""Orbits about the Earth: where all bodies are in inertial axes, with the Earth's lit side and the way to the Sun."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rso_lidar.errors import RecordingError
from rso_lidar.picture.selection.sequence import even_indices
from rso_lidar.picture.style.figures import (
    HAIR_PT,
    SMALL_PT,
    TEXT_PT,
    THICK_PT,
    THIN_PT,
    format_thousands,
    new_figure,
    style_axes,
)
from rso_lidar.picture.style.palette import (
    BLUE,
    DAY,
    GREEN,
    IMAGE_WHITE,
    INK,
    MARK,
    NIGHT,
    ORANGE,
    PAPER,
    PINK,
    QUIET,
    RED,
    split_rgb,
)
from rso_lidar.records import BodyState, Truth, find_shadow_spans_s
from rso_lidar.units import DEG, EARTH_GM_M3_S2, EARTH_RADIUS_M, KM

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DRAWN = 4000  # most points of a path
COLOURS = (RED, BLUE, GREEN, PINK, ORANGE)
DISC = 240  # pixels across the Earth
STEP = 2.0 * DEG  # between two points drawn
WIDEST = 1.2  # greatest turn about the Earth between two instants [rad] that is interpolated
_MOST_OF_GRAVITY = 2.0  # acceleration over the Earth's gravity, beyond which another body holds the orbit
NORTH = 25.0 * DEG  # declination of the eye


@dataclass(frozen=True, eq=False)
class _View:
    """Axes of a picture: right, up and the direction to the eye, unit vectors (3) in inertial axes."""

    right: np.ndarray
    up: np.ndarray
    eye: np.ndarray

    @staticmethod
    def along(eye: np.ndarray, up: np.ndarray) -> _View:
        """Return the view from `eye`, with `up` as near to upward as possible."""
        right = np.cross(up, eye)
        right = right / np.linalg.norm(right)
        return _View(right, np.cross(eye, right), eye)

    def project(self, vectors: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the components of vectors (…, 3) to the right, up and toward the eye."""
        x, y, z = (np.einsum("...i,i->...", vectors, axis) for axis in (self.right, self.up, self.eye))
        return x, y, z


Spans = Iterable[tuple[float, float]]


def inertial_figure(
    truth: Truth,
    title: str = "Orbits",
    names: Sequence[str] | None = None,
    *,
    shadows_s: Mapping[str, Spans] | None = None,
) -> Figure:
    """Draw the orbits of bodies in inertial axes, from a batch of epochs.

    The left view has celestial north up; the right one is from the pole of the first body's orbit. Flown paths are
    strong (black in the Earth's shadow), the rest of each osculating orbit is faint, and an arrow points to the Sun.

    Parameters
    ----------
    truth : a batch of epochs
    title : the heading
    names : bodies to draw (None: all)
    shadows_s : by body, spans [s] in which the Earth hides the Sun from it, infinite where they continue. The shadow
        of a missing body is found from the instants, good to half a step

    Returns
    -------
    Figure
    """
    names = list(truth.states) if names is None else list(names)
    states = {name: truth.states[name] for name in names if _orbits(truth.states[name])}
    if not states or not np.isfinite(truth.sun_direction).all():
        raise RecordingError("orbits: no body orbits the Earth (a local world?); draw the relative path instead")
    sun = np.atleast_2d(truth.sun_direction)[0]
    first = next(iter(states.values()))
    normal = np.cross(first.position_m[0], first.velocity_m_s[0])
    normal /= np.linalg.norm(normal)
    flat = sun - np.sum(sun * normal) * normal
    flat = flat / np.linalg.norm(flat) if np.linalg.norm(flat) > 1e-3 else _across(normal)
    eye = _choose_view(normal, sun, first.position_m[len(first.position_m) // 2])
    start, end = (float(np.atleast_1d(truth.time_s)[k]) for k in (0, -1))
    note = f"inertial axes (GCRS)   ·   {start:,.0f} to {end:,.0f} s, from the circle to the square"
    paths = [_collect_paths(name, truth, state, (shadows_s or {}).get(name)) for name, state in states.items()]
    if any(path.dark.any() for path in paths):
        coarse = "" if set(states) <= set(shadows_s or {}) else ", as the frames have it"
        note += f"   ·   black where the Earth hides the Sun{coarse}"
    figure = new_figure(12.0, 6.6, title, note)
    oblique, pole = figure.subplots(1, 2)
    _draw(oblique, paths, _View.along(eye, np.array([0.0, 0.0, 1.0])), sun)
    _draw(pole, paths, _View.along(normal, np.cross(normal, flat)), sun)
    longitude = np.arctan2(eye[1], eye[0]) / DEG % 360.0
    style_axes(oblique, f"From right ascension {longitude:.0f}°, declination {NORTH / DEG:.0f}°", "[km]", "[km]")
    style_axes(pole, "From the orbit's pole, the Sun to the right", "[km]", "[km]")
    handles, words = oblique.get_legend_handles_labels()
    oblique.legend(
        handles, words, fontsize=SMALL_PT, frameon=False, loc="lower left", labelcolor=QUIET, borderaxespad=0.0
    )
    return figure


def osculating_orbit_m(position_m: np.ndarray, velocity_m_s: np.ndarray, points: int = 361) -> np.ndarray:
    """Return points (point, 3) [m] of the two-body orbit through a state; of an open orbit, those within four periapses.

    The conic about the Earth's centre, r = p / (1 + e cos nu), with the eccentricity vector toward periapsis.

    Parameters
    ----------
    position_m, velocity_m_s : the state (3), inertial
    points : how many
    """
    momentum = np.cross(position_m, velocity_m_s)
    distance = np.linalg.norm(position_m)
    vector = np.cross(velocity_m_s, momentum) / EARTH_GM_M3_S2 - position_m / distance
    e = float(np.linalg.norm(vector))
    p = float(np.sum(momentum**2)) / EARTH_GM_M3_S2
    z = momentum / np.linalg.norm(momentum)
    x = vector / e if e > 1e-9 else position_m / distance
    y = np.cross(z, x)
    farthest = max(4.0 * p / (1.0 + e), 1.2 * float(distance))
    widest = np.pi if e < 1.0 else float(np.arccos(np.clip((p / farthest - 1.0) / e, -1.0, 1.0)))
    nu = np.linspace(-widest, widest, points)[:, None]
    orbit: np.ndarray = p / (1.0 + e * np.cos(nu)) * (np.cos(nu) * x + np.sin(nu) * y)
    return orbit


def is_about_earth(time_s: np.ndarray, position_m: np.ndarray, velocity_m_s: np.ndarray) -> bool:
    """Return whether a body is accelerated as the Earth's gravity does, apart from burns, rather than by the Moon's.

    Parameters
    ----------
    time_s : instants (time,) [s]
    position_m, velocity_m_s : states there (time, 3), inertial, about the Earth's centre
    """
    step_s = np.diff(time_s)
    if not step_s.size:
        return True
    acceleration_m_s2 = np.linalg.norm(np.diff(velocity_m_s, axis=0), axis=-1) / step_s
    expected = EARTH_GM_M3_S2 / np.sum(position_m[1:] ** 2, axis=-1)
    return bool(np.median(acceleration_m_s2 / expected) < _MOST_OF_GRAVITY)


def _orbits(state: BodyState) -> bool:
    distance = np.linalg.norm(np.atleast_2d(state.position_m), axis=-1)
    speed = np.linalg.norm(np.atleast_2d(state.velocity_m_s), axis=-1)
    return bool(np.all(distance > 0.9 * EARTH_RADIUS_M) and np.all(speed > 1.0))


def _choose_view(normal: np.ndarray, sun: np.ndarray, middle_m: np.ndarray) -> np.ndarray:
    """Choose the direction to an eye that sees the orbit open, the Earth mostly lit, and the path in front of it."""
    turn = np.arange(0.0, 360.0, 5.0) * DEG
    north = np.sin(NORTH)
    eyes = np.stack([np.cos(NORTH) * np.cos(turn), np.cos(NORTH) * np.sin(turn), np.full_like(turn, north)], axis=-1)
    openness, day, before = (
        np.einsum("ki,i->k", eyes, vector) for vector in (normal, sun, middle_m / np.linalg.norm(middle_m))
    )
    wrong = (np.abs(openness) - 0.5) ** 2 + 0.3 * (day - 0.4) ** 2 + np.maximum(0.2 - before, 0.0)
    best: np.ndarray = eyes[int(np.argmin(wrong))]
    return best


def _across(normal: np.ndarray) -> np.ndarray:
    least = np.eye(3)[int(np.argmin(np.abs(normal)))]
    across: np.ndarray = np.cross(normal, least) / np.linalg.norm(np.cross(normal, least))
    return across


@dataclass(frozen=True, eq=False)
class _OrbitPath:
    """Path of a body (point, 3) [m], which points are in shadow, and its osculating orbit at the start (point, 3) [m]."""

    name: str
    position_m: np.ndarray
    dark: np.ndarray
    orbit_m: np.ndarray


def _collect_paths(name: str, truth: Truth, state: BodyState, spans_s: Spans | None) -> _OrbitPath:
    """Return the path of a body, with points added between distant instants and at the ends of shadow.

    Parameters
    ----------
    spans_s : spans in shadow (None: from the truth)
    """
    time_s = np.atleast_1d(np.asarray(truth.time_s, dtype=float))
    position_m, velocity_m_s = np.atleast_2d(state.position_m), np.atleast_2d(state.velocity_m_s)
    if spans_s is None:
        lit = np.broadcast_to(np.asarray(truth.sunlit.get(name, 1.0), dtype=float), time_s.shape)
        spans_s = find_shadow_spans_s(time_s, lit)
    spans_s = list(spans_s)
    chosen = even_indices(time_s.size, DRAWN)
    time_s, position_m, velocity_m_s = time_s[chosen], position_m[chosen], velocity_m_s[chosen]
    whole = position_m  # of an orbit about the Moon, what was flown
    if is_about_earth(time_s, position_m, velocity_m_s):
        whole = osculating_orbit_m(position_m[0], velocity_m_s[0])
    turn = np.linalg.norm(velocity_m_s, axis=-1) / np.linalg.norm(position_m, axis=-1)  # at most [rad/s]
    swept = np.maximum(turn[1:], turn[:-1]) * np.diff(time_s)
    pieces = np.where(swept <= WIDEST, np.maximum(np.ceil(swept / STEP), 1.0), 1.0).astype(int)
    between = [np.linspace(time_s[k], time_s[k + 1], pieces[k] + 1)[1:-1] for k in np.flatnonzero(pieces > 1)]
    ends_s = [end for span in spans_s for end in span if time_s[0] < end < time_s[-1]]
    at_s = np.unique(np.concatenate([time_s, *between, ends_s]))
    dark = np.zeros(at_s.size, dtype=bool)
    for begins_s, ends in spans_s:
        dark |= (at_s >= begins_s) & (at_s <= ends)
    return _OrbitPath(name, _interpolate(at_s, time_s, position_m, velocity_m_s), dark, whole)


def _interpolate(at_s: np.ndarray, time_s: np.ndarray, position_m: np.ndarray, velocity_m_s: np.ndarray) -> np.ndarray:
    """Return positions (time, 3) [m] between instants by cubic Hermite interpolation.

    On a circle it is off by a^4 / 384 of the radius for instants that are an angle a apart: 0.5 % at 1.2 rad.
    """
    if time_s.size == 1:
        return position_m
    k = np.clip(np.searchsorted(time_s, at_s, side="right") - 1, 0, time_s.size - 2)
    step_s = (time_s[k + 1] - time_s[k])[:, None]
    s = (at_s - time_s[k])[:, None] / step_s
    from_start = position_m[k] * (1 + 2 * s) + velocity_m_s[k] * step_s * s
    from_end = position_m[k + 1] * (3 - 2 * s) - velocity_m_s[k + 1] * step_s * (1 - s)
    between: np.ndarray = from_start * (1 - s) ** 2 + from_end * s**2
    return between


def _draw(axes: Axes, paths: Sequence[_OrbitPath], view: _View, sun: np.ndarray) -> None:
    """Draw Earth, orbits and Sun in one view [km]; the Earth's disc hides what is behind it.

    Parameters
    ----------
    view : axes of the picture
    """
    _draw_earth(axes, view, sun)
    reach = EARTH_RADIUS_M
    for k, flown in enumerate(paths):
        colour = COLOURS[k % len(COLOURS)]
        wide = 3.6 if k == 0 and len(paths) > 1 else 1.6  # the second is visible on the first where they overlap
        path, whole = flown.position_m, flown.orbit_m
        _draw_path(axes, view, whole, color=colour, lw=THIN_PT, alpha=0.45)
        _draw_path(axes, view, path, color=colour, lw=wide, label=flown.name)
        for at, marker in ((0, "o"), (-1, "s")):
            right, up, depth = view.project(path[at])
            order = 6 if depth > 0 else 1.5
            axes.plot(right / KM, up / KM, marker, ms=6 + wide, mfc=PAPER, mec=colour, mew=1.3, zorder=order)
        reach = max(reach, *(float(np.abs(v).max()) for v in view.project(np.vstack([path, whole]))[:2]))
    for flown in paths:  # above the colours of all paths, which often overlap
        dark = np.where(flown.dark[:, None], flown.position_m, np.nan)
        _draw_path(axes, view, dark, color=INK, lw=THICK_PT)
    x, y, _ = (float(v) for v in view.project(sun))
    along = np.hypot(x, y)
    if along > 0.05:
        tail, head = 1.12 * reach / KM, (1.12 + 0.22 * along) * reach / KM
        start, tip = (tail * x / along, tail * y / along), (head * x / along, head * y / along)
        arrow = {"arrowstyle": "-|>", "color": MARK, "lw": THICK_PT, "shrinkA": 0, "shrinkB": 0}
        axes.annotate("", xy=tip, xytext=start, arrowprops=arrow, zorder=7)
        axes.annotate(
            "Sun", tip, xytext=(12 * x / along, 12 * y / along), textcoords="offset points", ha="center", va="center",
            fontsize=TEXT_PT, color=INK, zorder=7,
        )  # fmt: skip
    axes.set_aspect("equal", adjustable="box")
    edge = 1.55 * reach / KM
    axes.set_xlim(-edge, edge)
    axes.set_ylim(-edge, edge)
    axes.locator_params(nbins=6)
    format_thousands(axes.xaxis, axes.yaxis)


def _draw_path(axes: Axes, view: _View, points: np.ndarray, **style: object) -> None:
    """Draw a path in two parts: behind the plane through the Earth's centre below the disc, the rest above it.

    Parameters
    ----------
    view : axes of the picture
    points : (point, 3) [m]
    """
    x, y, depth = view.project(points)
    label = style.pop("label", None)
    near = depth >= -1e-3 * EARTH_RADIUS_M
    far = ~near
    far[:-1] |= ~near[1:]  # no gap between the two parts
    far[1:] |= ~near[:-1]
    for shown, order, name in ((far, 1.0, None), (near, 5.0, label)):
        right_km, up_km = np.where(shown, x, np.nan) / KM, np.where(shown, y, np.nan) / KM
        axes.plot(right_km, up_km, zorder=order, label=name, solid_capstyle="butt", **style)  # type: ignore[arg-type]


def _draw_earth(axes: Axes, view: _View, sun: np.ndarray) -> None:
    """Draw the Earth's disc with its lit side, and parallels and meridians in inertial axes every 30 degrees.

    Parameters
    ----------
    view : axes of the picture
    """
    from matplotlib.patches import Circle

    grid = (np.arange(DISC) + 0.5) / DISC * 2.0 - 1.0
    x, y = np.meshgrid(grid, grid)
    inside = x**2 + y**2 <= 1.0
    z = np.sqrt(np.maximum(1.0 - x**2 - y**2, 0.0))
    normal = x[..., None] * view.right + y[..., None] * view.up + z[..., None] * view.eye
    height = np.einsum("...i,i->...", normal, sun)  # sine of the Sun's height
    day = np.clip(0.5 + height / 0.12, 0.0, 1.0) * (0.55 + 0.45 * np.clip(height, 0.0, 1.0))
    night, lit = (np.array(split_rgb(colour)) / 255.0 for colour in (NIGHT, DAY))
    colour = night + (lit - night) * day[..., None]
    image = np.concatenate([colour, inside[..., None].astype(float)], axis=-1)
    edge = EARTH_RADIUS_M / KM
    shown = axes.imshow(image, extent=(-edge, edge, -edge, edge), origin="lower", zorder=2, interpolation="bilinear")
    disc = Circle((0, 0), edge, transform=axes.transData, fc="none", ec=QUIET, lw=THIN_PT, zorder=4)
    axes.add_patch(disc)
    shown.set_clip_path(disc)
    turn = np.linspace(0.0, 2.0 * np.pi, 181)
    rings = [
        np.stack([np.cos(lat) * np.cos(turn), np.cos(lat) * np.sin(turn), np.full_like(turn, np.sin(lat))], axis=-1)
        for lat in np.arange(-60, 61, 30) * DEG
    ]
    rings += [
        np.stack([np.cos(lon) * np.cos(turn), np.sin(lon) * np.cos(turn), np.sin(turn)], axis=-1)
        for lon in np.arange(0, 180, 30) * DEG
    ]
    for ring in rings:
        right, up, depth = view.project(ring)
        front = np.where(depth > 0, edge, np.nan)
        axes.plot(right * front, up * front, color=IMAGE_WHITE, lw=HAIR_PT, alpha=0.55, zorder=3)

"""A figure in another scheme: each colour of the light scheme is exchanged for its counterpart."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from rso_lidar.picture.style.palette import LIGHT, Scheme

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Rgba = tuple[float, float, float, float]

_PROPERTIES = (
    "color", "facecolor", "edgecolor", "markerfacecolor", "markeredgecolor", "facecolors", "edgecolors"
)  # fmt: skip
_TICK_KEYS = ("color", "labelcolor", "grid_color")


def recolour(figure: Figure, scheme: Scheme) -> None:
    """Exchange the colours of the light scheme in a figure, and matplotlib's black and white, for those of a scheme.

    Colours of images, colour maps and parts stay, as does any colour that is not of the light scheme.

    Parameters
    ----------
    figure : drawn in the light scheme; changed in place
    scheme : the light scheme changes nothing
    """
    if scheme == LIGHT:
        return
    table = _exchange_table(scheme)
    for artist in figure.findobj():
        for part in (artist, *_hidden_parts(artist)):
            _recolour_artist(part, table)
    for axes in figure.findobj(lambda artist: hasattr(artist, "get_tick_params")):
        _recolour_ticks(axes, table)


def _exchange_table(scheme: Scheme) -> dict[tuple[float, ...], Rgba]:
    """Return the colours of a scheme by those of the light one, each red, green and blue."""
    from matplotlib.colors import to_rgba

    pairs = [*zip(LIGHT.all, scheme.all, strict=True), ("#000000", scheme.ink)]
    return {_key(to_rgba(old)): to_rgba(new) for old, new in pairs}


def _key(rgba: Any) -> tuple[float, ...]:
    return tuple(round(float(value), 4) for value in rgba[:3])


def _hidden_parts(artist: Any) -> list[Any]:
    """Return the parts of a text that matplotlib does not list among its children: the arrow and the box behind it."""
    parts = [getattr(artist, "arrow_patch", None)]
    if hasattr(artist, "get_bbox_patch"):
        parts.append(artist.get_bbox_patch())
    return [part for part in parts if part is not None]


def _recolour_artist(artist: Any, table: dict[tuple[float, ...], Rgba]) -> None:
    from matplotlib.collections import Collection

    is_mapped = isinstance(artist, Collection) and artist.get_array() is not None  # its faces are of a colour map
    for name in ("edgecolor",) if is_mapped else _PROPERTIES:
        read, write = getattr(artist, f"get_{name}", None), getattr(artist, f"set_{name}", None)
        if read is not None and write is not None:
            old = read()
            new = _exchange(old, table)
            if new is not None:
                write(new)


def _exchange(colour: Any, table: dict[tuple[float, ...], Rgba]) -> Any:
    """Return the counterpart of a colour or of an array of colours (…, rgba), None where it has none."""
    from matplotlib.colors import is_color_like, to_rgba

    if isinstance(colour, str) and colour in ("auto", "none", "face", "inherit"):
        return None
    if is_color_like(colour):
        old = to_rgba(colour)
        counterpart = table.get(_key(old)) if old[3] > 0.0 else None  # nothing is seen of it
        return None if counterpart is None else (*counterpart[:3], old[3])
    if not isinstance(colour, np.ndarray) or colour.ndim != 2 or not len(colour):
        return None
    counterparts = [_exchange(tuple(row), table) for row in colour]
    if all(counterpart is None for counterpart in counterparts):
        return None
    return [
        tuple(row) if counterpart is None else counterpart
        for row, counterpart in zip(colour, counterparts, strict=True)
    ]


def _recolour_ticks(axis: Any, table: dict[tuple[float, ...], Rgba]) -> None:
    """Exchange the colours of an axis's ticks, of which matplotlib makes more when it draws."""
    for which in ("major", "minor"):
        held = axis.get_tick_params(which)
        new = {name: _exchange(held[name], table) for name in _TICK_KEYS if name in held}
        for name in ("color", "labelcolor"):  # not set: matplotlib's black
            if name not in held:
                new[name] = table[0.0, 0.0, 0.0]
        axis.set_tick_params(which=which, **{name: value for name, value in new.items() if value is not None})

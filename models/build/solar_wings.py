"""Hinges of solar wings."""

from __future__ import annotations

from collections.abc import Mapping

from rso_lidar.records import Hinge


def wing_hinges(
    places_m: Mapping[str, tuple[float, float, float]],
    axis: tuple[float, float, float],
    normal: tuple[float, float, float],
    parts: tuple[str, ...] = ("array", "substrate", "yoke"),
) -> tuple[Hinge, ...]:
    """Return a hinge for the solar wing of each side; it carries the parts ``solar_<part>_<side>``.

    Parameters
    ----------
    places_m : position of each hinge, by side
    axis : of rotation
    normal : of the cells at angle zero
    parts : names of the parts that turn
    """
    return tuple(
        Hinge(
            name=f"solar_{side}",
            parts=tuple(f"solar_{part}_{side}" for part in parts),
            position_m=place,
            axis=axis,
            normal=normal,
        )
        for side, place in places_m.items()
    )

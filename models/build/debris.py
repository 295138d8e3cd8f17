"""Four fragments of a break-up, of fixed seeds."""

from __future__ import annotations

from rso_lidar.shapes import CraftModel, fragment


def debris_plate() -> CraftModel:
    """Return a torn and bent plate, 0.6 m long: skin of a tank."""
    return fragment(3, 0.60, "plate", name="debris_plate")


def debris_shard() -> CraftModel:
    """Return a shard, 0.25 m long: a sliver of a thick fitting."""
    return fragment(2, 0.25, "shard", name="debris_shard")


def debris_panel() -> CraftModel:
    """Return a piece of a solar panel, 1.2 m long: honeycomb with some cells left."""
    return fragment(5, 1.20, "panel", name="debris_panel")


def debris_foil() -> CraftModel:
    """Return a crumpled sheet of insulation, 0.9 m long."""
    return fragment(4, 0.90, "foil", name="debris_foil")

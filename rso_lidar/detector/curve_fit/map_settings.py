"""A detector with the measured maps of its pixels."""

from __future__ import annotations

from typing import Any

from rso_lidar.detector.curve_fit.pixel_response import take_chain
from rso_lidar.detector.detection import AnyDetector
from rso_lidar.detector.settings.focal_plane import Maps
from rso_lidar.detector.stages.pixel_maps import PixelMaps

_MOST_SPREAD = 0.3  # of gains and thresholds, that settings allow


def set_maps(
    detector: AnyDetector, maps: PixelMaps, file: str | None, *, keep_threshold_spread: bool = False
) -> AnyDetector:
    """Return a detector whose pixels are those of measured maps.

    The spreads of its settings become those of the maps, for closed forms that take no maps.

    Parameters
    ----------
    detector : the full chain; another detector is refused
    maps : the measured maps
    file : name of their file; None for the spreads alone
    keep_threshold_spread : whether the spread of thresholds stays, as that of a constant that was fitted

    Returns
    -------
    AnyDetector

    Raises
    ------
    ScenarioError
        For a detector without maps of its pixels.
    """
    chain = take_chain(detector, "map")
    changes: dict[str, Any] = {"file": file}
    for key, name, most in (
        ("gain_spread_fraction", "gain_factor", _MOST_SPREAD),
        ("offset_spread_counts", "offset_counts", float("inf")),
        ("t0_spread_ns", "t0_ns", float("inf")),
    ):
        changes[key] = min(maps.spread(name), most) if name in maps.maps else 0.0
    trigger = chain.trigger
    if "threshold_factor" in maps.maps and not keep_threshold_spread:
        trigger = trigger.replace(threshold_spread_fraction=min(maps.spread("threshold_factor"), _MOST_SPREAD))
    return chain.replace(maps=(chain.maps or Maps()).replace(**changes), trigger=trigger, defects=None)

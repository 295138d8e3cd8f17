"""Separations at which the detector lists two returns of a pixel, and parts of targets whose depth is outside them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from rso_lidar.detector import describe_storage
from rso_lidar.detector.separation import OVER, listed_separations
from rso_lidar.scenario.mission.mission import Mission
from rso_lidar.scenario.preview.geometry import Preview

_OFTEN = 0.9  # probability that both are listed, from which a separation counts
_BRIGHT = 100.0  # times the threshold: a near target's light, which latches earlier and leaves less behind the latch
_MOST_EPOCHS, _MOST_CORNERS, _MOST_NAMED = 12, 20_000, 3  # enough for a depth in words, to a tenth of a metre


def separation_lines(mission: Mission) -> list[str]:
    """Return in words the separations at which the detector lists two returns of a pixel; empty where it lists only one."""
    traits = mission.lidar.detector.traits
    if traits.max_returns == 1:
        return []
    listed = [(over, _listed_m(mission, over)) for over in (OVER, _BRIGHT)]
    words = [
        f"{_span(one)} with {over * traits.threshold_photons:,.0f} photons each" if one else "" for over, one in listed
    ]
    text = "; ".join(word for word in words if word)
    if not text:
        return ["  returns   two returns of a pixel are never listed both, at any separation"]
    return [f"  returns   two of a pixel are both listed, 9 times in 10 and equally bright, {text}"]


def separation_advice(mission: Mission, seen: Preview) -> list[str]:
    """Return a warning where the stored samples of a pixel lose returns, with the parts of the targets that are affected.

    A pixel that triggers itself stores little behind its latch, so it always has one where more than the first return is
    asked for. Under a gate there is one where a part is deeper than the gate lists two returns of.
    """
    traits = mission.lidar.detector.traits
    if traits.returns == "first" and traits.max_returns == 1:
        return []
    words = describe_storage(mission.lidar.detector)
    if traits.max_returns == 1:
        return words
    listed = _listed_m(mission, OVER)
    if listed is None:
        return ["; ".join([*words, "two returns of a pixel are never both listed; shorten lidar.laser.pulse_fwhm_ns"])]
    apart = f"two returns of a pixel are both listed {_span(listed)} apart in depth"
    found, lost = zip(*(_outside(mission, seen, number, listed) for number in range(len(mission.target))), strict=True)
    if not traits.is_gated or any(lost):
        words.append("; ".join([apart, *(text for text in found if text)]))
    return ["; ".join(words)] if words else []


def _outside(mission: Mission, seen: Preview, number: int, listed: tuple[float, float]) -> tuple[str, bool]:
    """Return in words the parts of a target whose depth is outside the separations, and whether any part is too deep."""
    target = mission.target[number]
    if target.terrain is not None:
        return "", False
    deepest = {name: float(deep.max()) for name, deep in part_depths_m(mission, seen, number).items()}
    merged = {name: deep for name, deep in deepest.items() if deep < listed[0]}
    lost = {name: deep for name, deep in deepest.items() if deep > listed[1]}
    words = [f"{_named(merged)} merge" if merged else "", f"{_named(lost)} can be parted too far" if lost else ""]
    text = " and of ".join(word for word in words if word)
    return (f"the two edges of {target.name}'s {text}" if text else ""), bool(lost)


def part_depths_m(mission: Mission, seen: Preview, number: int) -> Mapping[str, np.ndarray]:
    """Return the depth [m] along the line of sight of each part of a target, at some instants of a preview (time).

    Parameters
    ----------
    mission : what is flown.
    seen : its preview.
    number : of the target.
    """
    rows = np.unique(np.linspace(0, len(seen.time_s) - 1, _MOST_EPOCHS).round().astype(int))
    near: dict[str, np.ndarray] = {}
    far: dict[str, np.ndarray] = {}
    for surface in mission.surfaces_of(number):
        place, turn = seen.truth.poses.place("lidar", surface.name)
        place, turn = np.broadcast_to(place, (len(seen.time_s), 3)), np.broadcast_to(turn, (len(seen.time_s), 3, 3))
        order = np.argsort(surface.part, kind="stable")
        every = max(3 * len(order) // _MOST_CORNERS, 1)
        kept = np.unique(
            np.append(np.flatnonzero(np.diff(surface.part[order], prepend=-1)), np.arange(0, len(order), every))
        )
        part, corners = surface.part[order[kept]], surface.corners[order[kept]].reshape(-1, 3)
        first = np.flatnonzero(np.diff(part, prepend=-1))
        range_m = np.stack([np.linalg.norm(corners @ turn[row].T + place[row], axis=1) for row in rows])
        least, most = (ufunc.reduceat(range_m, 3 * first, axis=1) for ufunc in (np.minimum, np.maximum))
        for column, index in enumerate(part[first]):
            name = surface.mesh.part_names[index]
            near[name] = np.minimum(near.get(name, np.full(len(rows), np.inf)), least[:, column])
            far[name] = np.maximum(far.get(name, np.zeros(len(rows))), most[:, column])
    return {name: far[name] - near[name] for name in near}


def _listed_m(mission: Mission, over: float) -> tuple[float, float] | None:
    lidar = mission.instrument
    if lidar.detector.traits.max_returns == 1:
        return None
    return listed_separations(lidar.detector, lidar.laser.pulse, lidar.laser.pulse_fwhm_s, over).interval_m(_OFTEN)


def _span(listed: tuple[float, float]) -> str:
    return f"{listed[0]:.1f} to {listed[1]:.1f} m"


def _named(depths: Mapping[str, float]) -> str:
    """Return the deepest parts with their depths in words, and how many there are besides."""
    names: Sequence[str] = sorted(depths, key=lambda name: -depths[name])
    text = ", ".join(f"{name} ({depths[name]:.1f} m)" for name in names[:_MOST_NAMED])
    return text + (f" and {len(names) - _MOST_NAMED} more" if len(names) > _MOST_NAMED else "")

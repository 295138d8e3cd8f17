"""Separations at which the detector lists both of two returns, and parts of targets whose depth is outside them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from rso_lidar.detector import SIGNAL_OVER_THRESHOLD, describe_storage, simulate_separations
from rso_lidar.scenario.mission.mission import Mission
from rso_lidar.scenario.preview.geometry import Preview

_LISTED_PROBABILITY = 0.9  # that both returns are listed, from which a separation counts
_BRIGHT_OVER_THRESHOLD = 100.0  # over the threshold: a near target triggers earlier in its pulse
_MOST_EPOCHS, _MOST_CORNERS, _MOST_NAMED = 12, 20_000, 3  # enough for a depth to a tenth of a metre


def describe_separations(mission: Mission) -> list[str]:
    """Describe the separations at which the detector lists both of two returns; nothing where it lists only one."""
    traits = mission.lidar.detector.traits
    if traits.max_returns == 1:
        return []
    listed = [
        (over, _find_listed_interval_m(mission, over)) for over in (SIGNAL_OVER_THRESHOLD, _BRIGHT_OVER_THRESHOLD)
    ]
    words = [
        f"{_format_interval(interval)} with {over * traits.threshold_photons:,.0f} photons each" if interval else ""
        for over, interval in listed
    ]
    text = "; ".join(word for word in words if word)
    if not text:
        return ["  returns   two returns of a pixel are never listed both, at any separation"]
    return [f"  returns   two of a pixel are both listed, 9 times in 10 and equally bright, {text}"]


def advise_on_separations(mission: Mission, preview: Preview) -> list[str]:
    """Warn where the stored samples of a pixel lose returns, and name the parts of the targets that are affected.

    A self-triggering pixel stores little behind its trigger. The warning is therefore given whenever more than the first
    return is asked for. Under a gate it is given where a part is deeper than two returns that the gate lists both.
    """
    traits = mission.lidar.detector.traits
    if traits.returns == "first" and traits.max_returns == 1:
        return []
    words = describe_storage(mission.lidar.detector)
    if traits.max_returns == 1:
        return words
    listed = _find_listed_interval_m(mission, SIGNAL_OVER_THRESHOLD)
    if listed is None:
        return ["; ".join([*words, "two returns of a pixel are never both listed; shorten lidar.laser.pulse_fwhm_ns"])]
    apart = f"two returns of a pixel are both listed {_format_interval(listed)} apart in depth"
    texts, lost = zip(
        *(_describe_affected_parts(mission, preview, number, listed) for number in range(len(mission.target))),
        strict=True,
    )
    if not traits.is_gated or any(lost):
        words.append("; ".join([apart, *(text for text in texts if text)]))
    return ["; ".join(words)] if words else []


def _describe_affected_parts(
    mission: Mission, preview: Preview, number: int, listed: tuple[float, float]
) -> tuple[str, bool]:
    """Describe the parts whose depth is outside the separations [m], and return whether any part is too deep."""
    target = mission.target[number]
    if target.terrain is not None:
        return "", False
    deepest = {name: float(deep.max()) for name, deep in measure_part_depths_m(mission, preview, number).items()}
    merged = {name: deep for name, deep in deepest.items() if deep < listed[0]}
    lost = {name: deep for name, deep in deepest.items() if deep > listed[1]}
    words = [
        f"{_name_deepest(merged)} merge" if merged else "",
        f"{_name_deepest(lost)} can be parted too far" if lost else "",
    ]
    text = " and of ".join(word for word in words if word)
    return (f"the two edges of {target.name}'s {text}" if text else ""), bool(lost)


def measure_part_depths_m(mission: Mission, preview: Preview, number: int) -> Mapping[str, np.ndarray]:
    """Measure the depth [m] of each part of a target along the line of sight, at some epochs (time) of a preview."""
    rows = np.unique(np.linspace(0, len(preview.time_s) - 1, _MOST_EPOCHS).round().astype(int))
    near: dict[str, np.ndarray] = {}
    far: dict[str, np.ndarray] = {}
    for surface in mission.surfaces_of(number):
        place, turn = preview.truth.poses.place("lidar", surface.name)
        place, turn = (
            np.broadcast_to(place, (len(preview.time_s), 3)),
            np.broadcast_to(turn, (len(preview.time_s), 3, 3)),
        )
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


def _find_listed_interval_m(mission: Mission, over: float) -> tuple[float, float] | None:
    """Return the separations [m] at which two returns with `over` times the threshold are both listed; None without any."""
    lidar = mission.instrument
    return simulate_separations(lidar.detector, lidar.laser.pulse, lidar.laser.pulse_fwhm_s, over).interval_m(
        _LISTED_PROBABILITY
    )


def _format_interval(listed: tuple[float, float]) -> str:
    return f"{listed[0]:.1f} to {listed[1]:.1f} m"


def _name_deepest(depths: Mapping[str, float]) -> str:
    """Name the deepest parts with their depths, and count the others."""
    names: Sequence[str] = sorted(depths, key=lambda name: -depths[name])
    text = ", ".join(f"{name} ({depths[name]:.1f} m)" for name in names[:_MOST_NAMED])
    return text + (f" and {len(names) - _MOST_NAMED} more" if len(names) > _MOST_NAMED else "")

"""What the second bounce adds to the light of a mission's targets: a line of the description, and a warning."""

from __future__ import annotations

from weakref import WeakKeyDictionary

from rso_lidar.scenario.mission.mission import Mission
from rso_lidar.scenario.preview.geometry import Preview
from rso_lidar.scenario.preview.second_bounce import SecondBounce, estimate_second_bounce
from rso_lidar.ties import find_first_least

_known: WeakKeyDictionary[Preview, list[tuple[str, SecondBounce]]] = WeakKeyDictionary()
_MUCH = 0.10  # of the light: what the first bounce alone may lack before a warning is given
_LITTLE = 0.001  # of the light, below which its depth means nothing


def describe_second_bounce(mission: Mission, preview: Preview) -> list[str]:
    """Describe what the second bounce adds to each target at its nearest epoch, whether it is simulated or not."""
    lines = []
    for name, bounce in _estimate(mission, preview):
        added = "adds less than 0.1 % of light"
        if bounce.share >= _LITTLE:
            spread = f" ({bounce.least:.1%} to {bounce.most:.1%} by attitude)" if bounce.most > bounce.least else ""
            added = f"adds {bounce.share:.1%} of light{spread}, {bounce.deeper_m:+.2f} m behind the first in the same pixels"
        used = "simulated" if mission.lidar.bounces > 1 else "left out: lidar.bounces = 1"
        lines.append(f"  bounces   {name}: the second bounce {added} ({used})")
    return lines


def advise_on_second_bounce(mission: Mission, preview: Preview) -> list[str]:
    """Warn where light that meets two surfaces is left out and is much."""
    if mission.lidar.bounces > 1:
        return []
    return [
        f"target {name}: light that meets two surfaces would add {bounce.share:.0%} of light, on average "
        f"{bounce.deeper_m:+.2f} m behind the rest of its pixels, and is left out; set lidar.bounces = 2"
        for name, bounce in _estimate(mission, preview)
        if bounce.share >= _MUCH
    ]


def _estimate(mission: Mission, preview: Preview) -> list[tuple[str, SecondBounce]]:
    """Estimate the second bounce of each target at its nearest epoch, by name; once for each preview."""
    if preview in _known:
        return _known[preview]
    estimates = _known[preview] = []
    for number, geometry in enumerate(preview.targets):
        row = find_first_least(geometry.range_m)
        is_near = geometry.range_m[row] < geometry.radius_m  # inside its bounds, or on a terrain
        if mission.target[number].terrain is None and not is_near:
            bounce = estimate_second_bounce(mission, preview, number, int(row))
            if bounce is not None:
                estimates.append((geometry.name, bounce))
    return estimates

"""What the second bounce adds to the light of targets, by a trial of few rays: a line of the description, and a warning."""

from __future__ import annotations

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np

from rso_lidar import optics, scene, units
from rso_lidar.records import Truth
from rso_lidar.scenario.mission.mission import Mission
from rso_lidar.scenario.preview.aspects import collect_attitudes
from rso_lidar.scenario.preview.geometry import Preview
from rso_lidar.scenario.preview.returns import cast_surfaces
from rso_lidar.ties import find_first_least

_known: WeakKeyDictionary[Preview, list[tuple[str, SecondBounce]]] = WeakKeyDictionary()
_MUCH = 0.10  # of the light: what the first bounce alone may lack before a warning is given
_LITTLE = 0.001  # of the light, below which its depth means nothing
_FINEST = 4  # rays along a pixel's side
_MOST_ATTITUDES = 8
_KEY = np.array([0x626F756E, 0x63657332], np.uint32)  # fixed, so that repeated calls give the same result


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


@dataclass(frozen=True)
class SecondBounce:
    """Light of the second bounce over that of the first, and its mean range behind it in the same pixels [m].

    `share` is the median over the attitudes, `least` and `most` are the ends.
    """

    share: float
    least: float
    most: float
    deeper_m: float


def estimate_second_bounce(mission: Mission, preview: Preview, number: int, row: int) -> SecondBounce | None:
    """Estimate the second bounce of a target near one epoch, whether the scenario asks for it or not.

    Returns
    -------
    That of up to eight attitudes of the target; None where no light returns.
    """
    truths = collect_attitudes(mission, preview, number, row, _MOST_ATTITUDES)
    first, second, late_m = np.array([_measure(mission, truth, number) for truth in truths]).T
    lit = first > 0.0
    if not lit.any():
        return None
    shares = second[lit] / first[lit]
    deeper_m = float(late_m.sum() / second.sum()) if second.any() else 0.0
    return SecondBounce(float(np.median(shares)), float(shares.min()), float(shares.max()), deeper_m)


def _measure(mission: Mission, truth: Truth, number: int) -> tuple[float, float, float]:
    """Measure the pixels that see a target directly, before the lens blurs them.

    Return photons of the first and of the second bounce, and the sum of photons times the range between the two [m].
    """
    lidar = mission.instrument.at(truth.time_s).replace(bounces=1)
    seen = cast_surfaces(lidar, mission.surfaces, truth, number, _FINEST)
    sharp = lidar.receiver.replace(psf=None)
    offset = lidar.laser.offset
    paths = scene.bounce(seen.hits, mission.surfaces, truth, _KEY, 1, laser_from_m=offset)
    once = optics.collect(seen.hits, lidar.laser, sharp)
    both = optics.collect(seen.hits, lidar.laser, sharp, bounces=paths)
    n_pixels = sharp.n_rows * sharp.n_cols
    (first, first_s), (light, light_s) = (
        (
            np.bincount(returns.pixel, returns.photons, n_pixels),
            np.bincount(returns.pixel, returns.photons * returns.delay_s, n_pixels),
        )
        for returns in (once, both)
    )
    mine = np.zeros(n_pixels, bool)
    mine[once.pixel[seen.hits.target[once.hit] == number]] = True
    mine &= first > 0.0
    second, second_s = light - first, light_s - first_s
    late_s = second_s - second * first_s / np.where(mine, first, 1.0)
    late_m = float(late_s[mine].sum()) * units.RANGE_PER_DELAY_M_S
    return float(first[mine].sum()), float(second[mine].sum()), late_m

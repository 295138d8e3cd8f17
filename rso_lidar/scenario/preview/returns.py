"""Returns of one flash from one target: its pixels and their light, cast with rays, before the detector."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from rso_lidar import optics, scene, units
from rso_lidar.detector import Empirical
from rso_lidar.detector.trial import Surroundings, Trial, trial
from rso_lidar.optics import Receiver
from rso_lidar.pose import Link, PoseTree
from rso_lidar.records import Hits, Photons, Truth

if TYPE_CHECKING:
    from rso_lidar.scenario.mission.mission import Scenario
    from rso_lidar.scenario.preview.geometry import Preview
    from rso_lidar.scenario.tables.lidar import Lidar

_MOST_RAYS = 4_000_000  # of all casts of one statement together: a large, near target then takes seconds
_MOST_ATTITUDES = 48
_SAME_ATTITUDE_RAD = 2e-3  # 0.1 deg: below this, a turn changes the light by less than the sampling does
_SAME_RANGE = 0.05  # share of the range within which a frame shows an attitude of the instant that is asked for
_BINS_PER_PULSE = 8  # returns of a pixel are merged within an eighth of the pulse (0.15 m at 8 ns)
_TRIALS, _FEWEST_TRIALS = 4000, 200
_MOST_SAMPLES = 4_000_000  # that a trial may take, so that a long gate is described in seconds
_MOST_LOADS = 6  # attitudes for which it is simulated how the pixels of the array disturb each other


@dataclass(frozen=True, eq=False)
class TargetReturns:
    """One target in one flash: the light of the whole scene, and which of its pixels see the target.

    `pixel` (pixel) are those with light of the target, rising, and `photons` (pixel) what the target sends to each.
    """

    hits: Hits
    light: Photons
    pixel: np.ndarray
    photons: np.ndarray
    number: int

    def pixel_at(self, share: float) -> int | None:
        """Return the pixel at a share (0: dimmest, 1: brightest) of the order by photons; None without light."""
        return int(self.pixel[self._at(share)]) if self.pixel.size else None

    def photons_at(self, share: float) -> float:
        """Return the photons of that pixel; 0 without light."""
        return float(self.photons[self._at(share)]) if self.pixel.size else 0.0

    def _at(self, share: float) -> int:
        return int(np.argsort(self.photons, kind="stable")[int(share * (self.pixel.size - 1) + 0.5)])

    @property
    def filled_pixels(self) -> float:
        """Return the area of the target in the image, lit or not [pixels]."""
        return float(self.hits.weight[self.hits.target == self.number].sum())

    @property
    def brightest_fill(self) -> float:
        """Return the share of its brightest pixel that the target covers; 0 without light."""
        if not self.pixel.size:
            return 0.0
        on = (self.hits.target == self.number) & (self.hits.pixel == self.pixel[self.photons.argmax()])
        return float(self.hits.weight[on].sum())


def cast_target(scenario: Scenario, truth: Truth, number: int, finest: int | None = None) -> TargetReturns:
    """Cast one flash and collect its light, in expectation: no jitter from pulse to pulse, no sunlight, no detector.

    Parameters
    ----------
    scenario : what is flown.
    truth : one epoch, with the lidar in it.
    number : of the target.
    finest : rays along a pixel's side at most (None: the receiver's own number).
    """
    lidar = scenario.instrument.at(truth.time_s)
    own = lidar.receiver.rays_per_side
    receiver = _with_rays(lidar.receiver, own if finest is None else max(min(own, finest), 1))
    rays = optics.pixel_rays(receiver, lidar.laser, scene.extent(scenario.surfaces, truth))
    hits = scene.cast(
        rays, scenario.surfaces, truth, 1, laser_from_m=lidar.laser.offset, aperture_m=receiver.aperture_m
    )
    light = optics.collect(hits, lidar.laser, receiver)
    mine = hits.target[light.hit] == number
    pixel = np.unique(light.pixel[mine])
    photons = np.bincount(light.pixel[mine], light.photons[mine], receiver.n_rows * receiver.n_cols)[pixel]
    return TargetReturns(hits, light, pixel, photons, number)


@lru_cache(maxsize=64)
def _with_rays(receiver: Receiver, per_side: int) -> Receiver:
    return receiver.replace(rays_per_pixel=per_side**2, filter_width_nm=None)


def cast_attitudes(
    scenario: Scenario, seen: Preview, number: int, row: int, most: int = _MOST_ATTITUDES
) -> list[TargetReturns]:
    """Cast a flash at one instant of a preview, once for each attitude that the target has about then.

    Attitudes are relative to the line of sight. They are taken from the instants around `row` at which the range is the same
    within 5 %. A tumbling target gives many, one that holds its attitude gives one. The place stays that of the instant, so
    that the photons are those of its range.

    Parameters
    ----------
    scenario : what is flown.
    seen : its preview.
    number : of the target.
    row : of the preview's instants.
    most : number of attitudes at most.
    """
    truths = _attitudes(scenario, seen, number, row, most)
    rays = _MOST_RAYS / len(truths) / max(_pixels_in_bounds(scenario, truths[0]), 1.0)
    return [cast_target(scenario, truth, number, math.isqrt(int(rays))) for truth in truths]


def _pixels_in_bounds(scenario: Scenario, truth: Truth) -> float:
    """Return how many pixels the bounds of all targets take of the field, at most."""
    receiver = scenario.instrument.at(truth.time_s).receiver
    seen = scene.extent(scenario.surfaces, truth)
    edge = receiver.field_edge
    sides = np.clip(seen.high, -edge, edge) - np.clip(seen.low, -edge, edge)
    return float(np.prod(np.maximum(sides, 0.0) / receiver.pixel_tangent, axis=1).sum())


def _attitudes(scenario: Scenario, seen: Preview, number: int, row: int, most: int) -> list[Truth]:
    """Return the truth of one instant, once for each attitude of the target about then."""
    name = scenario.target[number].name
    here = seen.truth.at(row)
    range_m = seen.sights[number].range_m
    if most == 1 or not range_m[row] > 0.0:
        return [here]
    off = np.flatnonzero(np.abs(range_m - range_m[row]) > _SAME_RANGE * range_m[row])
    first, last = int(off[off < row].max(initial=-1)) + 1, int(off[off > row].min(initial=len(range_m)))
    near = np.arange(first, last)
    rows = np.unique(near[np.linspace(0, len(near) - 1, most).round().astype(int)])
    turns = np.broadcast_to(seen.truth.poses.place("lidar", name)[1], (len(range_m), 3, 3))
    places = np.broadcast_to(seen.truth.poses.place("lidar", name)[0], (len(range_m), 3))
    found: list[np.ndarray] = []
    truths = []
    for at in [row, *(int(one) for one in rows if one != row)]:
        turned = turn_between(places[at], places[row]) @ turns[at]
        # The trace of a turn is 1 + 2 cos of its angle.
        if any(np.trace(one.T @ turned) > 1.0 + 2.0 * math.cos(_SAME_ATTITUDE_RAD) for one in found):
            continue
        found.append(turned)
        links = surface_links(scenario, number, seen.truth.at(at), places[row], turned)
        for surface in scenario.surfaces:
            if surface.name not in links:
                links[surface.name] = Link(here.poses.place("lidar", surface.name), np.zeros(3), np.zeros(3))
        truths.append(seen_truth(here.time_s, links))
    return truths


def surface_links(
    scenario: Scenario, number: int, there: Truth, place_m: np.ndarray, turned: np.ndarray
) -> dict[str, Link]:
    """Return lidar_from_surface of each surface of a target that is put elsewhere, with its hinges as they stand.

    Parameters
    ----------
    scenario : what is flown.
    number : of the target.
    there : the truth whose hinges count.
    place_m, turned : lidar_from_target, as translation (3) [m] and matrix (3, 3).
    """
    name = scenario.target[number].name
    lidar_from_target = Link((place_m, turned), np.zeros(3), np.zeros(3))
    return {
        surface.name: lidar_from_target * Link(there.poses.place(name, surface.name), np.zeros(3), np.zeros(3))
        for surface in scenario.surfaces_of(number)
    }


def seen_truth(time_s: float, links: dict[str, Link]) -> Truth:
    """Return a truth of the lidar and of surfaces in its axes, without bodies and without a Sun."""
    parents = dict.fromkeys(links, "lidar") | {"lidar": "inertial"}
    return Truth(time_s, PoseTree(parents, {"lidar": Link.still(), **links}), {}, np.full(3, np.nan))


def turn_between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the least rotation (3, 3) that turns the direction of `a` into that of `b`."""
    a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
    axis, cosine = np.cross(a, b), float(a @ b)
    if cosine < -1.0 + 1e-9:  # opposite: no axis is the least; the lidar sees nothing behind it in any case
        return np.eye(3)
    x, y, z = axis
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turn: np.ndarray = np.eye(3) + skew + skew @ skew / (1.0 + cosine)
    return turn


def copy_pixels(
    casts: Sequence[TargetReturns], pixels: Sequence[int | None], n: int, shift_m: np.ndarray
) -> tuple[Photons, np.ndarray]:
    """Copy the light of one pixel of each flash, in turn, to `n` pixels in a row; also return their true ranges (n) [m].

    Returns of a pixel are merged where they lie within an eighth of the pulse. The true range is that of the labels, the
    photon-weighted mean of the pixel's brightest cluster; NaN where there is no pixel.

    Parameters
    ----------
    casts : flashes, each for as many copies as the others.
    pixels : one pixel of each flash, None for a pixel without light.
    n : number of copies in all.
    shift_m : (n) range [m] by which each copy is moved, so that no phase of the clock is favoured.
    """
    merged = [_merged(one.light, pixel) for one, pixel in zip(casts, pixels, strict=True)]
    of = np.arange(n) % len(casts)
    length, clusters, true_m = (
        np.array(column)[of] for column in zip(*((len(m.photons), m.clusters, m.range_m) for m in merged), strict=True)
    )
    first = np.cumsum([0, *(len(one.photons) for one in merged)])[of]
    copy = np.repeat(np.arange(n), length)
    take = np.arange(len(copy)) + np.repeat(first - (np.cumsum(length) - length), length)
    delay_s, photons, spread_s, cells, cluster = (
        np.concatenate([getattr(one, name) for one in merged])[take]
        for name in ("delay_s", "photons", "depth_spread_s", "coherence_cells", "cluster")
    )
    pulse = casts[0].light
    made = Photons(
        shape=(1, n),
        pulse_fwhm_s=pulse.pulse_fwhm_s,
        pulse_step_s=pulse.pulse_step_s,
        late_s=0.0,
        pulse_power_per_s=pulse.pulse_power_per_s,
        pixel=copy,
        delay_s=delay_s + shift_m[copy] / units.RANGE_PER_DELAY_M_S,
        photons=photons,
        depth_spread_s=spread_s,
        coherence_cells=cells,
        hit=np.arange(len(copy)),
        cluster=cluster + (np.cumsum(clusters) - clusters)[copy],
        cluster_pixel=np.repeat(np.arange(n), clusters),
    )
    return made, true_m + shift_m


def surroundings(lidar: Lidar, casts: Sequence[TargetReturns], pixels: Sequence[int | None], n: int) -> Surroundings:
    """Estimate the effects of the flashes on the pixels of `copy_pixels`: array current, common latches, laser jitter.

    Parameters
    ----------
    lidar : the instrument that is in force.
    casts : flashes, each for as many copies as the others; the effects are computed for at most `_MOST_LOADS` of them.
    pixels : one pixel of each flash, None for a pixel without light.
    n : number of copies in all.
    """
    few = np.unique(np.linspace(0, len(casts) - 1, _MOST_LOADS).round().astype(int))
    gains, together = [], []
    for number in few.tolist():
        pixel = pixels[number]
        load = lidar.detector.array_load(casts[number].light)
        gains.append(1.0 if pixel is None else float(load.gain[pixel]))
        together.append(0.0 if pixel is None else float(load.together_fraction[pixel]))
    nearest = np.abs(np.subtract.outer(np.arange(len(casts)), few)).argmin(axis=1)
    return Surroundings(
        gain=float(np.mean(gains)),
        together_fraction=np.array(together)[nearest][np.arange(n) % len(casts)],
        energy_jitter_fraction=lidar.laser.energy_jitter_fraction,
        timing_jitter_s=lidar.laser.timing_jitter_ns * units.NS,
    )


def try_pixels(scenario: Scenario, casts: Sequence[TargetReturns], share: float, time_s: float) -> Trial:
    """Simulate up to 4000 pixels with the light of one pixel of each flash, through the whole chain; the same draws.

    Parameters
    ----------
    scenario : what is flown.
    casts : flashes.
    share : place of the pixel in the order by photons, from 0 (the dimmest) to 1 (the brightest).
    time_s : instant whose instrument counts.
    """
    lidar = scenario.instrument.at(time_s)
    detector = lidar.detector
    gate = None if isinstance(detector, Empirical) else detector.gate
    n = _TRIALS
    if gate is not None and not isinstance(detector, Empirical):  # many pulses, and many samples, take their time
        samples = gate.n_samples(detector.readout.sample_s)
        n = max(min(_TRIALS // gate.pulses, _MOST_SAMPLES // samples), _FEWEST_TRIALS)
    pixels = [one.pixel_at(share) for one in casts]
    # Copies of one flash are a multiple of the golden ratio apart, over the range of two samples of the default.
    shift_m = 0.72 * (np.modf((np.arange(n) // len(casts)) * 0.618_033_988_749_894_9)[0] - 0.5)
    photons, true_m = copy_pixels(casts, pixels, n, shift_m)
    around = surroundings(lidar, casts, pixels, n)
    return trial(detector, photons, np.random.Generator(np.random.Philox(_TRIALS)), true_m, around)


@dataclass(frozen=True, eq=False)
class _Merged:
    """The returns of one pixel, those of about the same delay merged, in `clusters` clusters from 0."""

    delay_s: np.ndarray
    photons: np.ndarray
    depth_spread_s: np.ndarray
    coherence_cells: np.ndarray
    cluster: np.ndarray
    clusters: int
    range_m: float


def _merged(light: Photons, pixel: int | None) -> _Merged:
    on = np.flatnonzero(light.pixel == (-1 if pixel is None else pixel))
    if not on.size:
        none = np.empty(0)
        return _Merged(none, none, none, none, none.astype(int), 0, math.nan)
    delay_s, photons = light.delay_s[on], light.photons[on]
    cluster = np.unique(light.cluster[on], return_inverse=True)[1]
    step = np.floor((delay_s - delay_s.min()) * (_BINS_PER_PULSE / light.pulse_fwhm_s)).astype(int)
    pairs, group = np.unique(np.stack([cluster, step]), axis=1, return_inverse=True)
    group, n = group.ravel(), pairs.shape[1]
    weight = np.where(np.bincount(group, photons, n)[group] > 0.0, photons, 1.0)
    mean_s, spread_s = (
        np.bincount(group, weight * values, n) / np.bincount(group, weight, n)
        for values in (delay_s, light.depth_spread_s[on])
    )
    early_s, late_s = np.full(n, np.inf), np.full(n, -np.inf)
    np.minimum.at(early_s, group, delay_s)
    np.maximum.at(late_s, group, delay_s)
    in_cluster = np.bincount(cluster, photons)
    best = cluster == in_cluster.argmax()
    share = photons[best] if in_cluster.max() > 0.0 else np.ones(best.sum())
    return _Merged(
        mean_s,
        np.bincount(group, photons, n),
        spread_s + late_s - early_s,
        np.bincount(group, light.coherence_cells[on], n),
        pairs[0],
        len(in_cluster),
        float(np.average(delay_s[best], weights=share)) * units.RANGE_PER_DELAY_M_S,
    )

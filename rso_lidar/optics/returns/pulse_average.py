"""The light of a frame's pulses, between which the scene moves: cast at several epochs, and averaged."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from rso_lidar.kernels import packed
from rso_lidar.optics.returns.clusters import find_clusters
from rso_lidar.records import Hits, Photons, Rays, Record, specs


def assign_pulses(pulses: int, epochs: int) -> np.ndarray:
    """Return the epoch (pulse) at which each pulse of a frame is cast: runs of pulses, equally long to one pulse.

    Parameters
    ----------
    pulses : number of pulses
    epochs : number of epochs, at most that of pulses

    Examples
    --------
    >>> assign_pulses(5, 2).tolist()
    [0, 0, 0, 1, 1]
    """
    assigned: np.ndarray = np.arange(pulses) * epochs // pulses
    return assigned


def average_pulses(
    seen: Sequence[tuple[Hits, Photons]], pulses: int, jitter: np.ndarray | None = None
) -> tuple[Hits, Photons]:
    """Average what the pulses of a frame see over the epochs at which they are cast.

    The rays of all epochs are joined, each with its weight times the share of the pulses at its epoch. So they cover the
    focal plane once, and everything that is summed over them is a mean over the pulses. The photons remember their epoch,
    because a detector sees one pulse at a time.

    Parameters
    ----------
    seen : hits of each epoch and the light that they send, in order of time
    pulses : number of pulses of the frame
    jitter : (2, pulse) energy of each pulse over their mean, and its delay beyond their mean [s]; None for none

    Returns
    -------
    hits and photons of the mean pulse: those of a single epoch without jitter as they are.
    """
    hits, photons = seen[0] if len(seen) == 1 else _average_epochs(seen, pulses)
    if jitter is not None:
        photons = replace(photons, pulse_energy_fraction=jitter[0], pulse_late_s=jitter[1])
    return hits, photons


def _average_epochs(seen: Sequence[tuple[Hits, Photons]], pulses: int) -> tuple[Hits, Photons]:
    """Average what the pulses of a frame see over several epochs.

    Parameters
    ----------
    seen, pulses : as for `average_pulses`
    """
    pulse_epoch = assign_pulses(pulses, len(seen))
    shares = np.bincount(pulse_epoch, minlength=len(seen)) / pulses
    hits, first = _join_hits([of for of, _ in seen], shares)
    return hits, _join_photons([light for _, light in seen], shares, pulse_epoch, first)


def _join_hits(hits: Sequence[Hits], shares: np.ndarray) -> tuple[Hits, list[np.ndarray]]:
    """Join the hits of all epochs, ordered by ray; return the hits, and for each epoch the new numbers of its hits.

    Parameters
    ----------
    shares : (epoch) share of the pulses
    """
    rays, ray_number = _join_rays([epoch_hits.rays for epoch_hits in hits], shares)
    ray = np.concatenate([number[epoch_hits.ray] for number, epoch_hits in zip(ray_number, hits, strict=True)])
    order = np.argsort(ray, kind="stable")
    joined = _join_arrays(hits, "hit", order)
    joined["ray"] = ray[order]
    joined["weight"] = joined["weight"] * np.repeat(shares, [len(epoch_hits.pixel) for epoch_hits in hits])[order]
    variance = _average_variance([epoch_hits.photons_variance for epoch_hits in hits], shares)
    return replace(hits[0], rays=rays, **joined, photons_variance=variance), _split_numbers(order, hits)


def _join_rays(rays: Sequence[Rays], shares: np.ndarray) -> tuple[Rays, list[np.ndarray]]:
    """Join the rays of all epochs, ordered by pixel; return them, and for each epoch the new numbers of its rays.

    Parameters
    ----------
    shares : (epoch) share of the pulses
    """
    order = np.argsort(np.concatenate([epoch_rays.pixel for epoch_rays in rays]), kind="stable")
    joined = _join_arrays(rays, "ray", order)
    joined["weight"] = joined["weight"] * np.repeat(shares, [len(epoch_rays.pixel) for epoch_rays in rays])[order]
    return replace(rays[0], **joined), _split_numbers(order, rays)


def _join_arrays(records: Sequence[Record], dim: str, order: np.ndarray) -> dict[str, Any]:
    """Join the arrays of records over one dimension, by name; an optional array that a record lacks is left out."""
    joined: dict[str, Any] = {}
    for name, spec in specs(type(records[0])).items():
        if spec.dims[0] == dim:
            values = [getattr(record, name) for record in records]
            joined[name] = None if any(value is None for value in values) else np.concatenate(values)[order]
    return joined


def _split_numbers(order: np.ndarray, of: Sequence[Hits] | Sequence[Rays]) -> list[np.ndarray]:
    """Return, for each epoch, the places to which an order puts its rows."""
    place = np.empty(len(order), np.int32)
    place[order] = np.arange(len(order), dtype=np.int32)
    return np.split(place, np.cumsum([len(record.pixel) for record in of])[:-1])


def _join_photons(
    photons: Sequence[Photons], shares: np.ndarray, pulse_epoch: np.ndarray, hit_number: Sequence[np.ndarray]
) -> Photons:
    """Join the light of all epochs, ordered by pixel and then by epoch, in clusters of their own.

    Parameters
    ----------
    shares : (epoch) share of the pulses
    pulse_epoch : (pulse) epoch of each pulse
    hit_number : (epoch) of (hit), new numbers of the hits
    """
    order = np.argsort(np.concatenate([epoch_photons.pixel for epoch_photons in photons]), kind="stable")
    counts = [len(epoch_photons.pixel) for epoch_photons in photons]
    joined = _join_arrays(photons, "return", order)
    joined["photons"] = joined["photons"] * np.repeat(shares, counts)[order]
    joined["hit"] = np.concatenate(
        [new[epoch_photons.hit] for new, epoch_photons in zip(hit_number, photons, strict=True)]
    )[order]
    joined["epoch"] = np.repeat(np.arange(len(photons), dtype=np.int32), counts)[order]
    joined["cluster"], joined["cluster_pixel"] = find_clusters(
        packed(joined["pixel"]), packed(joined["delay_s"]), packed(joined["depth_spread_s"]), photons[0].pulse_fwhm_s
    )
    return replace(
        photons[0],
        **joined,
        filled_fraction=_average([epoch_photons.filled_fraction for epoch_photons in photons], shares),
        background_photons_per_s=_average(
            [epoch_photons.background_photons_per_s for epoch_photons in photons], shares
        ),
        photons_variance=_average_variance([epoch_photons.photons_variance for epoch_photons in photons], shares),
        pulse_epoch=pulse_epoch,
    )


def _average_variance(images: Sequence[np.ndarray | None], shares: np.ndarray) -> np.ndarray | None:
    """Return the variance (row, col) of the mean over epochs; None where it is unknown.

    The errors of neighbouring epochs are alike, because the scene moves by a fraction of a pixel between them. As many
    errors as the square root of the number of epochs are taken as independent. This is assumed: for motion in depth alone it
    is too many, and for motion over several pixels too few.

    Parameters
    ----------
    images : variance (row, col) of each epoch
    shares : (epoch) share of the pulses
    """
    return _average(images, shares**2 * math.sqrt(len(shares)))


def _average(images: Sequence[np.ndarray | None], shares: np.ndarray) -> np.ndarray | None:
    """Return the mean of images (row, col), weighted; None where there are none."""
    known = [image * share for image, share in zip(images, shares, strict=True) if image is not None]
    return np.sum(known, axis=0) if known else None

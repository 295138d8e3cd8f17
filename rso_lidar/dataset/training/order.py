"""The order in which training visits frames: shuffled over all frames, or within a few shards at a time."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal, NamedTuple

import numpy as np

from rso_lidar.dataset.reading.random_access import Split
from rso_lidar.errors import DatasetError


class Visit(NamedTuple):
    """A visit of a frame: its index in the split, and the epoch."""

    frame: int
    epoch: int


class FrameSampler:
    """The order of visits of a split, new in each epoch, as the `sampler` of a data loader of PyTorch.

    Each iteration is one epoch, counted from 0. `set_epoch` continues from another epoch, such as after a restart.
    """

    def __init__(
        self,
        split: Split,
        shuffle: Literal["frames", "shards", "none"] = "frames",
        *,
        seed: int = 0,
        shards_at_once: int = 8,
    ) -> None:
        """Choose an order.

        Parameters
        ----------
        split : whose frames are visited
        shuffle : ``"frames"`` shuffles all frames. ``"shards"`` shuffles the shards, and the frames within each group of
            a few shards, for disks on which random reads are slow. ``"none"`` keeps the order

        Other Parameters
        ----------------
        seed : random seed
        shards_at_once : number of shards among which frames are mixed

        Raises
        ------
        DatasetError
            For another way to shuffle, or no shards at once.
        """
        if shuffle not in ("frames", "shards", "none"):
            raise DatasetError(f"shuffle: {shuffle!r} is none of frames, shards, none; choose one")
        if shards_at_once < 1:
            raise DatasetError(f"shards_at_once: {shards_at_once} shards hold no frames; take at least 1")
        self._sizes = np.array([record.frames for record in split.records], dtype=np.int64)
        self.shuffle, self.seed, self.shards_at_once = shuffle, seed, shards_at_once
        self.epoch = 0

    def __len__(self) -> int:
        return int(self._sizes.sum())

    def set_epoch(self, epoch: int) -> None:
        """Choose the epoch of the next iteration.

        Parameters
        ----------
        epoch : counted from 0
        """
        self.epoch = epoch

    def __iter__(self) -> Iterator[Visit]:
        epoch, self.epoch = self.epoch, self.epoch + 1
        for index in self.order(epoch).tolist():
            yield Visit(index, epoch)

    def order(self, epoch: int) -> np.ndarray:
        """Return the indices (visit) of all frames in the order of an epoch.

        Parameters
        ----------
        epoch : counted from 0
        """
        rng = np.random.Generator(np.random.Philox(np.random.SeedSequence((self.seed, epoch))))
        if self.shuffle == "none":
            return np.arange(len(self))
        if self.shuffle == "frames":
            return rng.permutation(len(self))
        starts = np.concatenate(([0], np.cumsum(self._sizes)))
        shards = rng.permutation(len(self._sizes))
        groups = []
        for first in range(0, len(shards), self.shards_at_once):
            some = shards[first : first + self.shards_at_once]
            groups.append(rng.permutation(np.concatenate([np.arange(starts[k], starts[k + 1]) for k in some])))
        return np.concatenate(groups) if groups else np.arange(0)

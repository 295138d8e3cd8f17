"""Frames of a split for a data loader: fields read at random, augmented and transformed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Protocol

import numpy as np

from rso_lidar.dataset.reading.random_access import Split
from rso_lidar.dataset.training.order import Visit
from rso_lidar.errors import DatasetError, did_you_mean


class Augmentation(Protocol):
    """A random change of one frame.

    Parameters
    ----------
    needs : names of the arrays that it reads.
    """

    needs: tuple[str, ...]

    def __call__(self, frame: dict[str, np.ndarray], rng: np.random.Generator) -> dict[str, np.ndarray]:
        """Return the changed frame; the given frame may be changed in place."""
        ...


class Transform(Protocol):
    """A fixed change of one frame, such as a crop.

    Parameters
    ----------
    needs : names of the arrays that it reads.
    makes : names of the arrays that it adds.
    """

    needs: tuple[str, ...]
    makes: tuple[str, ...]

    def __call__(self, frame: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Return the changed frame; the given frame may be changed in place."""
        ...


class FrameDataset:
    """Frames of a split as a map-style dataset of PyTorch, which needs no PyTorch itself.

    A frame is a dict of arrays. The dataset can be pickled; each process opens files of its own. Augmentations are applied
    first, in order, then transforms.

    With indices from a `FrameSampler`, the random numbers of a frame depend on (seed, epoch, index) only, whichever process
    reads the frame. A plain index has no epoch: then the random numbers differ each time.
    """

    def __init__(
        self,
        split: Split,
        fields: Sequence[str] = ("range_m", "intensity_counts", "class_id"),
        *,
        augmentations: Sequence[Augmentation] = (),
        transforms: Sequence[Transform] = (),
        seed: int = 0,
    ) -> None:
        """Make a PyTorch dataset of a split.

        Parameters
        ----------
        split : such as ``rl.dataset.open(folder).split("train")``.
        fields : names of the arrays of each frame.

        Other Parameters
        ----------------
        augmentations, transforms : changes of each frame. Arrays that only they need are read and not returned.
        seed : random seed of the augmentations.

        Raises
        ------
        DatasetError
            If the split lacks an array that is needed, or an augmentation refuses one of the fields.
        """
        self.split, self.fields, self.seed = split, tuple(fields), int(seed)
        self.augmentations, self.transforms = tuple(augmentations), tuple(transforms)
        made = {name for one in self.transforms for name in one.makes}
        changes: tuple[Augmentation | Transform, ...] = (*self.augmentations, *self.transforms)
        needed = [name for one in changes for name in one.needs]
        self._read = tuple(dict.fromkeys(name for name in (*self.fields, *needed) if name not in made))
        self._given = tuple(dict.fromkeys((*self.fields, *sorted(made))))
        for name in self._read:
            if name not in split.names:
                raise DatasetError(
                    f"{split!r}: has no array '{name}'{did_you_mean(name, split.names)} (known: {', '.join(split.names)})"
                )
        for one in self.augmentations:
            check = getattr(one, "check_fields", None)
            if check is not None:
                check(self._read)

    def __len__(self) -> int:
        return len(self.split)

    def __repr__(self) -> str:
        """Return the split and the names of the arrays."""
        return f"<FrameDataset of {self.split!r}: {', '.join(self._given)}>"

    def __getitem__(self, index: int | Visit) -> dict[str, np.ndarray]:
        """Return one frame."""
        return self.__getitems__([index])[0]

    def __getitems__(self, indices: Sequence[int | Visit]) -> list[dict[str, np.ndarray]]:
        """Return a batch of frames; a data loader of PyTorch calls this method."""
        rows = [one.frame if isinstance(one, Visit) else int(one) for one in indices]
        arrays = self.split.read(rows, self._read)
        frames = [{name: values[k] for name, values in arrays.items()} for k in range(len(rows))]
        if not self.augmentations and not self.transforms:
            return frames
        return [self._change(frame, index) for frame, index in zip(frames, indices, strict=True)]

    def _change(self, frame: dict[str, np.ndarray], index: int | Visit) -> dict[str, np.ndarray]:
        """Return a frame augmented and transformed.

        Parameters
        ----------
        frame : frame of the shard.
        index : its index, with the epoch if that is known.
        """
        if self.augmentations:
            entropy = (self.seed, index.epoch, index.frame) if isinstance(index, Visit) else None
            rng = np.random.Generator(np.random.Philox(np.random.SeedSequence(entropy)))
            for augmentation in self.augmentations:
                frame = augmentation(frame, rng)
        for transform in self.transforms:
            frame = transform(frame)
        return {name: frame[name] for name in self._given}


def stack_frames(frames: Iterable[Mapping[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """Stack frames to a batch of arrays.

    Parameters
    ----------
    frames : of one shape.

    Returns
    -------
    arrays by name, each with the frame as its first dimension.
    """
    rows = list(frames)
    return {name: np.stack([row[name] for row in rows]) for name in rows[0]}


def to_tensors(frames: Iterable[Mapping[str, np.ndarray]]) -> dict[str, Any]:
    """Stack frames to a batch of tensors, as the `collate_fn` of a data loader.

    Unsigned 16-bit counts become 32-bit integers, which PyTorch computes with.

    Parameters
    ----------
    frames : of one shape.

    Returns
    -------
    tensors by name, each with the frame as its first dimension.
    """
    import torch

    batch = stack_frames(frames)
    return {
        name: torch.from_numpy(values.astype(np.int32) if values.dtype == np.uint16 else values)
        for name, values in batch.items()
    }

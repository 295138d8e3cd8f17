"""Frames of a split for a data loader: fields read at random, augmented and transformed."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Protocol

import numpy as np

from rso_lidar.dataset.reading.random_access import Split
from rso_lidar.dataset.training.order import Visit
from rso_lidar.errors import DatasetError, did_you_mean


class Augmentation(Protocol):
    """A random change of one frame. A plain function of a frame and a random generator is one, too: see `FrameDataset`.

    Parameters
    ----------
    needs : names of the arrays that it reads
    """

    needs: tuple[str, ...]

    def __call__(self, frame: dict[str, np.ndarray], rng: np.random.Generator) -> dict[str, np.ndarray]:
        """Return the changed frame; the given frame may be changed in place."""
        ...


class Transform(Protocol):
    """A fixed change of one frame, such as a crop. A plain function of a frame is one, too: see `FrameDataset`.

    Parameters
    ----------
    needs : names of the arrays that it reads
    makes : names of the arrays that it adds
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
        augmentations: Sequence[Augmentation | Callable[..., dict[str, np.ndarray]]] = (),
        transforms: Sequence[Transform | Callable[..., dict[str, np.ndarray]]] = (),
        seed: int = 0,
    ) -> None:
        """Make a PyTorch dataset of a split.

        Parameters
        ----------
        split : such as ``rl.dataset.open(folder).split("train")``
        fields : names of the arrays of each frame

        Other Parameters
        ----------------
        augmentations, transforms : changes of each frame. Arrays that only they need are read and not returned. Plain
            functions ``augment(frame, rng)`` and ``transform(frame)``, which state neither `needs` nor `makes`, get the
            arrays of `fields`. They return the frame, and what they add to it is returned, too
        seed : random seed of the augmentations

        Raises
        ------
        DatasetError
            If the split lacks an array that is needed, an augmentation refuses one of the fields, or a change is no
            function.
        """
        self.split, self.fields, self.seed = split, tuple(fields), int(seed)
        self.augmentations = _list_changes(augmentations, "augmentations")
        self.transforms = _list_changes(transforms, "transforms")
        changes = (*self.augmentations, *self.transforms)
        produced = {name for change in changes for name in getattr(change, "makes", ())}
        # Plain functions do not state what they add.
        self._adds_any = not all(hasattr(change, "needs") for change in changes)
        needed = [name for change in changes for name in getattr(change, "needs", ())]
        self._read = tuple(dict.fromkeys(name for name in (*self.fields, *needed) if name not in produced))
        self._given = tuple(dict.fromkeys((*self.fields, *sorted(produced))))
        for name in self._read:
            if name not in split.names:
                raise DatasetError(
                    f"{split!r}: has no array '{name}'{did_you_mean(name, split.names)} (known: {', '.join(split.names)})"
                )
        for augmentation in self.augmentations:
            check = getattr(augmentation, "check_fields", None)
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
        rows = [visit.frame if isinstance(visit, Visit) else int(visit) for visit in indices]
        arrays = self.split.read(rows, self._read)
        frames = [{name: values[k] for name, values in arrays.items()} for k in range(len(rows))]
        if not self.augmentations and not self.transforms:
            return frames
        return [self._change(frame, index) for frame, index in zip(frames, indices, strict=True)]

    def _change(self, frame: dict[str, np.ndarray], index: int | Visit) -> dict[str, np.ndarray]:
        """Return a frame augmented and transformed."""
        if self.augmentations:
            entropy = (self.seed, index.epoch, index.frame) if isinstance(index, Visit) else None
            rng = np.random.Generator(np.random.Philox(np.random.SeedSequence(entropy)))
            for k, augmentation in enumerate(self.augmentations):
                frame = self._check_frame(augmentation(frame, rng), augmentation, f"augmentations[{k}]")
        for k, transform in enumerate(self.transforms):
            frame = self._check_frame(transform(frame), transform, f"transforms[{k}]")
        added = [name for name in frame if name not in self._read] if self._adds_any else []
        return {name: frame[name] for name in dict.fromkeys((*self._given, *added))}

    def _check_frame(self, frame: Any, change: Any, place: str) -> dict[str, np.ndarray]:
        """Return the frame of a change, or raise `DatasetError` if it is none, or lacks an array."""
        if not isinstance(frame, dict):
            raise DatasetError(
                f"{place}: returned {frame!r:.40}, not a frame; return the dict of arrays that it is given"
            )
        kept = [name for name in self._given if name in self._read]
        for name in (*kept, *getattr(change, "makes", ())):
            if name not in frame:
                raise DatasetError(f"{place}: returned a frame without '{name}'; return all arrays of fields and makes")
        return frame


def _list_changes(changes: Any, place: str) -> tuple[Any, ...]:
    """Return the changes of a frame, or raise `DatasetError` if one cannot be called with a frame."""
    if callable(changes) or not isinstance(changes, Iterable):
        raise DatasetError(f"{place}: is {changes!r:.60}; give a list of functions or of objects such as CropReturns()")
    listed = tuple(changes)
    for k, change in enumerate(listed):
        if isinstance(change, type):
            raise DatasetError(
                f"{place}[{k}]: is the class {change.__name__}; give an object of it, such as {change.__name__}()"
            )
        if not callable(change):
            raise DatasetError(
                f"{place}[{k}]: is {change!r:.60}, which is no function; give one that takes a frame, a dict of arrays, and "
                "returns it"
            )
        for key in ("needs", "makes"):
            names = getattr(change, key, ())
            if isinstance(names, str) or not all(isinstance(name, str) for name in names):
                raise DatasetError(f"{place}[{k}]: its {key} is {names!r:.60}; give a tuple of names of arrays")
    return listed


def stack_frames(frames: Iterable[Mapping[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """Stack frames to a batch of arrays.

    Parameters
    ----------
    frames : of one shape

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
    frames : of one shape

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

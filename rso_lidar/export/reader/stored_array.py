"""Arrays of a recording that read only the frames that are indexed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from rso_lidar.export.reader.recording_file import RecordingFile


class StoredArray:
    """One dataset of a recording, indexed like a NumPy array whose first axis is time.

    Only the frames that are indexed are read.
    """

    def __init__(self, recording: RecordingFile, path: str, dtype: Any = None) -> None:
        """Refer to a dataset.

        Parameters
        ----------
        recording : open file
        path : of the dataset
        dtype : of the values read; by default that of the file
        """
        self._recording, self._path = recording, path
        dataset = recording.handle(path)
        self.shape: tuple[int, ...] = (len(recording), *dataset.shape[1:])
        self.dtype = np.dtype(dtype or dataset.dtype)
        self.ndim = len(self.shape)

    @property
    def attrs(self) -> Mapping[str, Any]:
        """Attributes in the file, such as ``units`` and ``long_name``."""
        with self._recording.watched(self._path):
            return dict(self._recording.handle(self._path).attrs)

    def __len__(self) -> int:
        return self.shape[0]

    def __repr__(self) -> str:
        return f"<{self._path} of {self._recording.path.name}: {self.shape} {self.dtype}>"

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        if copy is False:
            raise ValueError(f"{self._path}: is read from a file, which makes a copy")
        return np.asarray(self[:], dtype=dtype)

    def __getitem__(self, key: Any) -> Any:
        keys = key if isinstance(key, tuple) else (key,)
        first, rest = (keys[0], keys[1:]) if keys else (slice(None), ())
        if isinstance(first, slice):
            wanted = range(*first.indices(len(self)))
            low, high = (min(wanted), max(wanted) + 1) if wanted else (0, 0)
            step = abs(wanted.step)
            block = self._read(slice(low, high, step))
            return block[(slice(None, None, 1 if wanted.step > 0 else -1), *rest)]
        if first is Ellipsis or first is None or np.ndim(first) > 1:
            return self._read(slice(0, len(self)))[key]
        if np.ndim(first) == 0 and not isinstance(first, bool | np.bool_):
            k = self._recording.place(first)
            return self._read(slice(k, k + 1))[(0, *rest)]
        # A list or array of frames (or a mask): read each frame once, then let numpy arrange.
        places = np.arange(len(self))[first]
        frames, inverse = np.unique(places, return_inverse=True)
        blocks = [self._read(slice(k, k + 1)) for k in frames.tolist()]
        block = np.concatenate(blocks) if blocks else self._read(slice(0, 0))
        return block[(inverse.reshape(places.shape), *rest)]

    def _read(self, frames: slice) -> np.ndarray:
        block: np.ndarray = self._recording.read(self._path, frames)
        return block.astype(self.dtype, copy=False)

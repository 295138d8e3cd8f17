"""Measured maps of one camera: what differs from pixel to pixel, read from a file of the camera (.npz)."""

from __future__ import annotations

import io
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.files import MOST_BYTES, check_regular, check_writable, read_arrays, write_atomically

MAPS_SUFFIX = ".npz"
# Names of the arrays, with the limits of their values.
MAP_LIMITS = {
    "gain_factor": (0.05, 20.0),
    "offset_counts": (-65_535.0, 65_535.0),
    "t0_ns": (-1e4, 1e4),
    "threshold_factor": (0.05, 20.0),
    "dark_current_na": (0.0, 1e6),
}
_FLAGS = ("dead", "hot")
_ERROR = "_error"  # ends the name of a map of standard errors
_PROVENANCE = "provenance"
_MOST_PIXELS = 2**24
_PLASTIC = 0.754_877_666_246_692_7  # 1/p, p³ = p + 1: the first axis of the R2 sequence (Roberts 2018)


@dataclass(frozen=True, eq=False)
class PixelMaps:
    """Measured maps of the pixels of one camera.

    Parameters
    ----------
    shape : rows and columns of the array
    maps : (row, col) by name: ``gain_factor`` and ``threshold_factor`` over the nominal values, ``offset_counts`` [counts],
        ``t0_ns`` [ns], ``dark_current_na`` before multiplication [nA]
    errors : (row, col) standard errors by the same names; NaN for a pixel whose value is not measured but nominal
    dead : (row, col) whether the pixel reports nothing
    hot : (row, col) whether its dark current is far above that of the others
    provenance : origin of the maps, as JSON text
    """

    shape: tuple[int, int]
    maps: Mapping[str, np.ndarray]
    errors: Mapping[str, np.ndarray]
    dead: np.ndarray
    hot: np.ndarray
    provenance: str = ""

    def spread(self, name: str) -> float:
        """Return the true spread of a map over the live pixels, 1 sigma: its variance less that of its errors.

        Parameters
        ----------
        name : of the map, such as ``gain_factor``
        """
        known = ~self.dead & np.isfinite(self.errors[name])
        if known.sum() < 2:
            return 0.0
        variance = float(self.maps[name][known].var() - (self.errors[name][known] ** 2).mean())
        return math.sqrt(max(variance, 0.0))

    def save(self, path: str | Path, *, overwrite: bool = False) -> Path:
        """Write the maps as NPZ.

        Parameters
        ----------
        path : of the file (.npz)
        overwrite : whether an existing file may be replaced

        Returns
        -------
        Path

        Raises
        ------
        RecordingError
            If the file exists already, or may not be written.
        """
        place = check_writable(path, (MAPS_SUFFIX,), overwrite=overwrite)
        content = self.to_bytes()
        with write_atomically(place) as draft:
            draft.write_bytes(content)
        return place

    def to_bytes(self) -> bytes:
        """Return the content of the file; the same maps give the same bytes."""
        arrays = dict(self.maps) | {f"{name}{_ERROR}": error for name, error in self.errors.items()}
        arrays |= {"dead": self.dead, "hot": self.hot, _PROVENANCE: np.array(self.provenance)}
        content = io.BytesIO()
        np.savez_compressed(content, **arrays)  # type: ignore[arg-type]
        return content.getvalue()

    def replace_drawn(self, n_pixels: int) -> dict[str, np.ndarray]:
        """Return the arrays (pixel) that take the place of drawn ones, by the names of `CameraPixels`.

        An array of another size is a bench, whose pixels take those of the camera evenly in turn.

        Parameters
        ----------
        n_pixels : number of pixels wanted
        """
        size = self.dead.size
        pixel = np.arange(n_pixels)
        if n_pixels != size:
            pixel = (np.modf(pixel * _PLASTIC)[0] * size).astype(np.int64)
        known = {
            "gain_factor": ("gain", 1.0),
            "threshold_factor": ("threshold", 1.0),
            "offset_counts": ("offset_counts", 1.0),
            "t0_ns": ("t0_s", units.NS),
            "dark_current_na": ("dark_per_s", units.NA / units.ELEMENTARY_CHARGE_C),
        }
        taken = {known[name][0]: known[name][1] * values.ravel()[pixel] for name, values in self.maps.items()}
        return taken | {"dead": self.dead.ravel()[pixel], "hot": self.hot.ravel()[pixel]}


def read_pixel_maps(file: str) -> PixelMaps:
    """Read the maps of a camera; kept until the file changes.

    Parameters
    ----------
    file : path of the file (.npz)

    Returns
    -------
    PixelMaps

    Raises
    ------
    ScenarioError
        If there is no such file, it is damaged, or an array has another shape or other values than maps have.
    """
    return _read(*stamp_maps(file))


def stamp_maps(file: str) -> tuple[str, int, int]:
    """Return path, modification time [ns] and size [byte] of a file of maps: the key of what is kept of it."""
    status = check_regular(Path(file), MOST_BYTES, ScenarioError, "file of maps")
    return file, status.st_mtime_ns, status.st_size


@lru_cache(maxsize=8)
def _read(file: str, _modified_ns: int, _size: int) -> PixelMaps:
    """Read and check the arrays of a file of maps."""
    arrays = read_arrays(Path(file), ScenarioError)
    known = [*MAP_LIMITS, *(f"{name}{_ERROR}" for name in MAP_LIMITS), *_FLAGS, _PROVENANCE]
    if unknown := [name for name in arrays if name not in known]:
        raise ScenarioError(f"{file}: holds '{unknown[0]}', which is no map (known: {', '.join(known)}); leave it out")
    provenance = str(arrays.pop(_PROVENANCE, ""))
    if "dead" not in arrays:
        raise ScenarioError(f"{file}: has no map 'dead' (row, col) of dead pixels; add it, with false for none")
    shape = arrays["dead"].shape
    for name, values in arrays.items():
        if values.ndim != 2 or values.shape != shape or not 0 < values.size <= _MOST_PIXELS:
            raise ScenarioError(f"{file}: {name}: has the shape {values.shape}, not (row, col) {shape}; write it again")
        if values.dtype.kind not in ("b" if name in _FLAGS else "fiu"):
            cure = "true or false" if name in _FLAGS else "numbers"
            raise ScenarioError(f"{file}: {name}: holds {values.dtype}; give {cure} for each pixel")
    dead = arrays["dead"]
    for name, (low, high) in MAP_LIMITS.items():
        if name in arrays and not np.all((arrays[name] >= low) & (arrays[name] <= high)):  # false for NaN too
            row, col = np.argwhere(~((arrays[name] >= low) & (arrays[name] <= high)))[0]
            raise ScenarioError(
                f"{file}: {name}: pixel ({row}, {col}) has {arrays[name][row, col]:g}, which is not between {low:g} and "
                f"{high:g}; correct it, or give a dead pixel the nominal value"
            )
    nothing = np.full(shape, np.nan)
    maps = {name: arrays[name].astype(float) for name in MAP_LIMITS if name in arrays}
    errors = {name: np.asarray(arrays.get(f"{name}{_ERROR}", nothing), dtype=float) for name in maps}
    hot = arrays.get("hot", np.zeros(shape, bool))
    for values in (*maps.values(), *errors.values(), dead, hot):
        values.setflags(write=False)
    return PixelMaps((shape[0], shape[1]), maps, errors, dead, hot, provenance)

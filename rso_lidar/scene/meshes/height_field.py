"""Height fields: terrain heights on a regular grid, as a mesh."""

import hashlib
import struct
import warnings
import zlib
from functools import lru_cache
from pathlib import Path

import numpy as np

from rso_lidar.errors import MeshError
from rso_lidar.files import read_array, read_arrays
from rso_lidar.scene.meshes.mesh import Mesh

SUFFIXES = (".npy", ".npz", ".png")
MOST_HEIGHT_CELLS = 4_000_000  # two facets each; the acceleration structure takes some 2 GB
_CURE = "crop or thin it"


def load_height_field(path: Path, cell_m: float, height_scale_m: float) -> Mesh:
    """Load the mesh of a file of heights: a .npy, a .npz of one array, or a grey .png of 8 or 16 bits.

    Rows run from north to south and columns from west to east, about the origin. x is east, y north and z up. A value
    of NaN means that the ground is absent.

    Parameters
    ----------
    path : the file
    cell_m : distance between neighbouring heights [m]
    height_scale_m : metres of height for one unit of the file

    Returns
    -------
    the mesh, in metres.

    Raises
    ------
    MeshError : the file is missing, or is not such a grid.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise MeshError(
            f"{path.name}: heights in '{path.suffix}' are not read; convert them to one of {', '.join(SUFFIXES)}"
        )
    if not path.is_file():
        raise MeshError(f"{path}: no such file of heights; check the name")
    status = path.stat()
    return _load_cached(path.resolve(), cell_m, height_scale_m, (status.st_mtime_ns, status.st_size))


@lru_cache(maxsize=8)
def _load_cached(path: Path, cell_m: float, height_scale_m: float, _stamp: tuple[int, int]) -> Mesh:
    """Load a file of heights, cached until it changes.

    Parameters
    ----------
    path, cell_m, height_scale_m : as for `load_height_field`
    """
    values = _image(path) if path.suffix.lower() == ".png" else _array(path)
    with np.errstate(over="ignore", invalid="ignore"):
        heights = height_scale_m * values
    return build_height_field(heights, cell_m, path, hashlib.sha256(path.read_bytes()).hexdigest())


def _array(path: Path) -> np.ndarray:
    """Read the numbers (row, col) of a .npy, or of a .npz that holds one array."""
    limit = 16 * MOST_HEIGHT_CELLS  # bytes, of the widest numbers
    if path.suffix.lower() == ".npz":
        arrays = list(read_arrays(path, MeshError, most_bytes=limit).values())
        if len(arrays) != 1:
            raise MeshError(f"{path.name}: contains {len(arrays)} arrays; save only the heights in it")
        values = arrays[0]
    else:
        values = read_array(path, MeshError, most_bytes=limit)
    _check_shape(path, values.shape)
    if values.dtype.kind not in "fiu":
        raise MeshError(f"{path.name}: contains {values.dtype} and not numbers; save heights as float or integer")
    return np.asarray(values, dtype=float)


def _image(path: Path) -> np.ndarray:
    """Read the grey values (row, col) of a PNG."""
    from PIL import Image

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            with Image.open(path, formats=("PNG",)) as image:
                if image.mode != "L" and not image.mode.startswith("I"):
                    raise MeshError(f"{path.name}: is of mode {image.mode}; save heights as grey, of 8 or 16 bits")
                _check_shape(path, (image.height, image.width))
                return np.asarray(image, dtype=float)
    except MeshError:
        raise
    except (OSError, ValueError, SyntaxError, EOFError, struct.error, zlib.error, Image.DecompressionBombError):
        raise MeshError(f"{path.name}: cannot be read as PNG; export it again") from None


def _check_shape(path: Path, shape: tuple[int, ...]) -> None:
    if len(shape) != 2 or min(shape) < 2:
        raise MeshError(f"{path.name}: is of shape {shape}; heights need rows and columns, two of each at least")
    if shape[0] * shape[1] > MOST_HEIGHT_CELLS:
        raise MeshError(f"{path.name}: {shape[0]} x {shape[1]} is more than {MOST_HEIGHT_CELLS:,} cells; {_CURE}")


def build_height_field(
    heights_m: np.ndarray, cell_m: float, path: Path, sha256: str, boulders: tuple[np.ndarray, np.ndarray] | None = None
) -> Mesh:
    """Build the mesh of terrain from its heights.

    Each cell is two facets that face up, divided from its north-west to its south-east corner. A cell with a NaN corner
    is left out.

    Parameters
    ----------
    heights_m : (row, col), heights [m], which become the part ``ground``
    cell_m : distance between neighbouring heights [m]
    path, sha256 : file of the heights and its checksum, which identify the mesh
    boulders : vertices [m] and facets of a second part, ``boulders``

    Returns
    -------
    the mesh, in metres.

    Raises
    ------
    MeshError
        If heights are infinite, or if no cell has four heights.
    """
    if np.isinf(heights_m).any():
        raise MeshError(f"{path.name}: has heights that are not finite; write NaN where the ground is unknown")
    rows, cols = heights_m.shape
    x = np.broadcast_to((np.arange(cols) - 0.5 * (cols - 1)) * cell_m, heights_m.shape)
    y = np.broadcast_to(((0.5 * (rows - 1) - np.arange(rows)) * cell_m)[:, None], heights_m.shape)
    vertices = np.stack([x, y, heights_m], axis=-1).reshape(-1, 3)
    corner = np.arange(rows * cols).reshape(rows, cols)
    nw, ne, sw, se = (part.ravel() for part in (corner[:-1, :-1], corner[:-1, 1:], corner[1:, :-1], corner[1:, 1:]))
    pairs = np.stack([nw, sw, se, nw, se, ne], axis=1)
    there = np.isfinite(vertices[:, 2])
    if not there.all():
        pairs = pairs[there[nw] & there[ne] & there[sw] & there[se]]
        vertices = np.where(there[:, None], vertices, 0.0)
    facets = pairs.reshape(-1, 3)
    if not len(facets):
        raise MeshError(f"{path.name}: no cell has a height at all its corners; correct the heights")
    names: tuple[str, ...] = ("ground",)
    part = np.zeros(len(facets), dtype=np.int16)
    if boulders is not None:
        part = np.concatenate([part, np.ones(len(boulders[1]), dtype=np.int16)])
        facets = np.concatenate([facets, boulders[1] + len(vertices)])
        vertices = np.concatenate([vertices, boulders[0]])
        names = ("ground", "boulders")
    number = np.arange(len(facets), dtype=np.int32)
    return Mesh(path, sha256, vertices, facets, part, names, number, len(facets), 0)

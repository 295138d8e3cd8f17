"""NumPy files (NPY and NPZ) read within bounds: no pickles, and no more memory than a limit, whatever the file declares."""

from __future__ import annotations

import math
import warnings
import zipfile
from pathlib import Path
from typing import IO

import numpy as np

from rso_lidar.errors import RsoLidarError
from rso_lidar.files.reading import MOST_BYTES, check_regular, describe_size, explain_unreadable

_PLAIN = "biufcUS"  # kinds of numbers and texts; others hold pickles, records or dates
_SUFFIX = ".npy"  # of a member of an NPZ file


def read_array(path: Path, error: type[RsoLidarError], *, most_bytes: int = MOST_BYTES) -> np.ndarray:
    """Read the array of an NPY file.

    Parameters
    ----------
    path : of the file
    error : class of the error to raise
    most_bytes : largest size of the array in memory [byte]

    Returns
    -------
    ndarray
        Of numbers or texts.

    Raises
    ------
    error
        If `check_regular` refuses the file, it is no NPY file of numbers or texts, it is damaged, or its array is too large.
    """
    check_regular(path, most_bytes + 2**16, error, "NPY file")  # 2**16: more than a header has
    try:
        with path.open("rb") as stream:
            return _read_stream(stream, str(path), error, most_bytes)
    except error:
        raise
    except Exception as problem:  # NumPy parses the header as Python, which fails in a dozen ways
        raise _make_error(path, "NPY", problem, error) from None


def read_arrays(path: Path, error: type[RsoLidarError], *, most_bytes: int = MOST_BYTES) -> dict[str, np.ndarray]:
    """Read all arrays of an NPZ file.

    Parameters
    ----------
    path : of the file
    error : class of the error to raise
    most_bytes : largest size of the file, and of all arrays together in memory [byte]

    Returns
    -------
    dict of str to ndarray
        Arrays of numbers or texts by name.

    Raises
    ------
    error
        If `check_regular` refuses the file, it is no NPZ file of numbers and texts, it is damaged, or its arrays are too
        large.
    """
    check_regular(path, most_bytes, error, "NPZ file")
    arrays: dict[str, np.ndarray] = {}
    left = most_bytes
    try:
        with zipfile.ZipFile(path) as archive:
            for name in archive.namelist():
                with archive.open(name) as stream:
                    array = _read_stream(stream, f"{path}: {name.removesuffix(_SUFFIX)}", error, left)
                arrays[name.removesuffix(_SUFFIX)] = array
                left -= array.nbytes
    except error:
        raise
    except Exception as problem:  # zipfile and zlib have a dozen errors, such as for unknown compression and encryption
        raise _make_error(path, "NPZ", problem, error) from None
    return arrays


def _read_stream(stream: IO[bytes], place: str, error: type[RsoLidarError], most_bytes: int) -> np.ndarray:
    """Read an array from a stream that ends with it.

    Parameters
    ----------
    stream : at byte 0 of the array's header
    most_bytes : largest size of the array [byte]
    """
    version = np.lib.format.read_magic(stream)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of headers that Python 2 wrote
        if version == (1, 0):
            shape, is_fortran, dtype = np.lib.format.read_array_header_1_0(stream)
        elif version == (2, 0):
            shape, is_fortran, dtype = np.lib.format.read_array_header_2_0(stream)
        else:  # 3.0 has names in Unicode, which plain numbers do not need
            raise ValueError(f"version {version[0]}.{version[1]} of the format is not read")
    if dtype.kind not in _PLAIN or dtype.hasobject:
        raise error(f"{place}: contains {dtype}, not numbers or text; save such an array")
    size = dtype.itemsize * math.prod(shape)
    if any(side < 0 for side in shape):
        raise ValueError(f"a side of {shape} is negative")
    if size > most_bytes:
        raise error(
            f"{place}: declares {'x'.join(map(str, shape))} values of {dtype}, over the {describe_size(most_bytes)} that "
            "may be read; give a smaller array"
        )
    content = stream.read(size)
    if len(content) != size or stream.read(1):  # the second reading also compares the CRC-32 of a member
        raise ValueError(f"it does not end where its header of {shape} values says")
    return np.ndarray(shape, dtype, content, order="F" if is_fortran else "C").copy()


def _make_error(path: Path, kind: str, problem: BaseException, error: type[RsoLidarError]) -> RsoLidarError:
    """Return the error about a file that is no NumPy file, or is damaged.

    Parameters
    ----------
    path, kind : the file, and what it should be, `NPY` or `NPZ`
    problem : what `numpy` or `zipfile` raised
    """
    if isinstance(problem, OSError) and problem.strerror:
        return error(explain_unreadable(path, problem))
    writer = {"NPY": "numpy.save", "NPZ": "numpy.savez"}[kind]
    reason = " ".join(str(problem).split()) or type(problem).__name__
    return error(f"{path}: is not an {kind} file of numbers, or is damaged ({reason:.120}); write it with {writer}")

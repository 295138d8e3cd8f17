"""Waveforms of Leddar PixSet, a public set of recordings of a flash lidar: pickles in ZIP files, read without running code.

A recording is a folder with a file for each kind of data. `pixell_bfc_ftrr.zip` holds the waveforms: a numbered pickle for
each flash, a dict with the tables `low` and `high`, of two gains. Each table has `data`, an int16 array (channel, sample) of
8 x 96 channels, and may have `time_base_delays` and `distance_scaling`, the range of the first sample of each channel and
the range between samples [m]. Otherwise `calibration.ID_TIMEBASE_DELAY` in the first pickle of `pixell_bfc_cfg.zip` has the
ranges of first samples, first those of `low`, then those of `high`. The converter takes 100 MHz, oversampled 8 times.

Source of these facts: the reader of the publisher, pioneer.das.api 1.1 (BSD-3-Clause), with its notebook of a recording.
"""

from __future__ import annotations

import io
import pickle
import re
import zipfile
import zlib
from collections import OrderedDict
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.evaluation.raw_waveforms.waveform_set import RawWaveforms
from rso_lidar.files import MOST_BYTES, check_regular

GAINS = ("low", "high")
_WAVEFORMS, _SETTINGS = "_ftrr.zip", "_cfg.zip"  # ends of the names of files, after that of the sensor
_SAMPLE_S = 1.0 / (8 * 100e6)  # 8 times 100 MHz: 0.18737 m, as the published notebook prints
_DARK_SAMPLES = 64  # assumed where no delay is known; in the notebook, 121 samples precede emission
_EARLY_SAMPLES = 16  # before emission, which a pulse of some 20 ns may already reach
_MOST_FILE_BYTES = 64 * 2**30  # a recording has gigabytes
# What zipfile (of a compression that it does not know), pickle and NumPy raise for a damaged file:
_DAMAGED = (ValueError, TypeError, KeyError, IndexError, AttributeError, OverflowError, NotImplementedError)


class _Function(tuple[Callable[..., Any]]):
    """A function that a pickle can call, and whose attributes it cannot set."""

    __slots__ = ()

    def __call__(self, *arguments: Any) -> Any:
        """Call the function."""
        return self[0](*arguments)


def _make_type(description: Any, *options: Any) -> np.dtype[Any]:
    """Return a type of numbers or text. Elements of another type can hold addresses that the pickle chooses."""
    kind: np.dtype[Any] = np.dtype(description, *options)
    if kind.kind not in "biufcSU":
        raise pickle.UnpicklingError(f"has an array of {kind}, which is neither numbers nor text")
    return kind


def _refuse_call(*_: Any) -> None:
    """Refuse to make an array over a buffer, as no pickle of NumPy does."""
    raise pickle.UnpicklingError("calls numpy.ndarray, which is no data")


# What a pickle may name: arrays and numbers of NumPy, in the words of its versions 1 and 2.
_ARRAY: Any = np.empty(0).__reduce__()[0]
_NUMBER: Any = np.float64(0.0).__reduce__()[0]
_BUFFER: Any = np.empty(1).__reduce_ex__(5)[0]
_ALLOWED: Mapping[tuple[str, str], Any] = {
    ("numpy", "ndarray"): _Function((_refuse_call,)),  # stands as the first argument of `_reconstruct` alone
    ("numpy", "dtype"): _Function((_make_type,)),
    ("_codecs", "encode"): _Function((lambda text, *_: text.encode("latin1"),)),  # bytes in pickles of protocol 2
    ("collections", "OrderedDict"): OrderedDict,
    **{
        (f"numpy.{core}.{module}", name): function
        for core in ("core", "_core")
        for module, name, function in (
            ("multiarray", "_reconstruct", _Function((lambda *_: _ARRAY(np.ndarray, (0,), b"b"),))),
            ("multiarray", "scalar", _NUMBER),
            ("numeric", "_frombuffer", _Function((_BUFFER,))),
        )
    },
}


class _DataUnpickler(pickle.Unpickler):
    """A reader of pickles that hold numbers, texts, arrays and containers, and nothing that runs."""

    def find_class(self, module: str, name: str) -> Any:
        """Return a class or a function by its name, if a pickle may name it."""
        if (module, name) not in _ALLOWED:
            raise pickle.UnpicklingError(f"names {module}.{name}, which is no data and could run code")
        return _ALLOWED[module, name]


def read_pixset(recording: str | Path, *, flashes: int = 20) -> Iterator[RawWaveforms]:
    """Read the waveforms of a PixSet recording.

    Parameters
    ----------
    recording : folder of a recording, or its file ``..._ftrr.zip``
    flashes : most flashes to read, evenly over the recording

    Yields
    ------
    RawWaveforms
        The low and the high gain of each flash.

    Raises
    ------
    ScenarioError
        If there are no waveforms, or a file is not as described.
    """
    path = _find_waveforms(Path(recording))
    with _open_zip(path) as archive:
        names = sorted(_list_pickles(archive), key=_read_number)
        if not names:
            raise ScenarioError(f"{path}: holds no numbered pickles; give the file of waveforms of a PixSet recording")
        first_m = None
        for k in np.unique(np.linspace(0, len(names) - 1, max(flashes, 1)).astype(int)):
            where = f"{path}: {names[k]}"
            flash = _read_pickle(archive, names[k], where)
            for gain in GAINS:
                table = flash.get(gain) if isinstance(flash, Mapping) else None
                if not isinstance(table, Mapping) or not isinstance(table.get("data"), np.ndarray):
                    raise ScenarioError(
                        f"{where}: has no array '{gain}.data'; give the waveforms (ftrr) of a recording"
                    )
                if "time_base_delays" not in table and first_m is None:
                    first_m = _read_first_ranges(path)
                yield _make_set(table, gain, first_m or {}, f"{where}: {gain}")


def _find_waveforms(recording: Path) -> Path:
    """Return the file of waveforms of a recording."""
    if recording.is_dir():
        files = sorted(recording.glob(f"*{_WAVEFORMS}"))
        if len(files) != 1:
            names = ", ".join(file.name for file in files) or "none"
            raise ScenarioError(f"{recording}: needs one file *{_WAVEFORMS}, and has {names}; name the file itself")
        return files[0]
    check_regular(recording, _MOST_FILE_BYTES, ScenarioError, "PixSet recording")
    return recording


def _open_zip(path: Path) -> zipfile.ZipFile:
    """Open a ZIP file."""
    try:
        return zipfile.ZipFile(path)
    except (OSError, zipfile.BadZipFile) as error:
        raise ScenarioError(f"{path}: is no ZIP file ({error}); download it again") from None


def _list_pickles(archive: zipfile.ZipFile) -> list[str]:
    """Return the names of the numbered pickles of an archive."""
    return [name for name in archive.namelist() if re.fullmatch(r"\d{1,12}\.pkl", name)]


def _read_number(name: str) -> int:
    """Return the number of a numbered pickle."""
    return int(name.partition(".")[0])


def _read_pickle(archive: zipfile.ZipFile, name: str, where: str) -> Any:
    """Read a pickle of an archive as data; whatever else it holds is refused."""
    try:
        if (size := archive.getinfo(name).file_size) > MOST_BYTES:
            raise ScenarioError(f"{where}: is too large ({size:,} bytes; at most {MOST_BYTES:,}); download it again")
        return _DataUnpickler(io.BytesIO(archive.read(name)), encoding="latin1").load()
    except (zipfile.BadZipFile, zlib.error, OSError, EOFError, pickle.UnpicklingError) as error:
        raise ScenarioError(f"{where}: cannot be read: {' '.join(str(error).split())}; download it again") from None
    except (MemoryError, RecursionError, *_DAMAGED) as error:
        reason = f"{type(error).__name__}: {' '.join(str(error).split())[:120]}"
        raise ScenarioError(f"{where}: is a damaged pickle ({reason}); download it again") from None


def _read_first_ranges(waveforms: Path) -> dict[str, float]:
    """Read the range of the first sample of each gain [m] from the sensor's settings, beside the waveforms.

    They are in the sensor's own order of channels, so their median stands for all; a published recording has 0.2 m between
    channels.
    """
    path = waveforms.with_name(waveforms.name.removesuffix(_WAVEFORMS) + _SETTINGS)
    if not path.is_file():
        return {}
    with _open_zip(path) as archive:
        names = sorted(_list_pickles(archive), key=_read_number)
        settings = _read_pickle(archive, names[0], f"{path}: {names[0]}") if names else {}
    try:
        delays_m = np.asarray(settings["calibration"]["ID_TIMEBASE_DELAY"], dtype=float).ravel()
        low_m, high_m = np.median(delays_m.reshape(2, -1), axis=1).tolist()
    except (KeyError, TypeError, ValueError, IndexError):  # settings without the calibration
        return {}
    return {"low": low_m, "high": high_m}


def _make_set(table: Mapping[str, Any], gain: str, first_m: Mapping[str, float], where: str) -> RawWaveforms:
    """Make the waveforms of one gain: without the copies of the first sample that fill their start."""
    data = table["data"]
    if (
        data.ndim != 2
        or data.dtype.kind not in "iuf"
        or data.shape[1] < 2 * _DARK_SAMPLES
        or not np.isfinite(data).all()
    ):
        raise ScenarioError(
            f"{where}: 'data' is {data.dtype} {data.shape}, not numbers (channel, sample) with at least "
            f"{2 * _DARK_SAMPLES} samples; download it again"
        )
    ranges = table.get("time_base_delays", first_m.get(gain, np.nan))
    step = table.get("distance_scaling", _SAMPLE_S * units.RANGE_PER_DELAY_M_S)
    try:
        sample_s = float(step) / units.RANGE_PER_DELAY_M_S
        delay_s = np.broadcast_to(np.asarray(ranges, dtype=float), len(data)) / units.RANGE_PER_DELAY_M_S
    except (TypeError, ValueError):
        raise ScenarioError(f"{where}: delays or scale are no numbers of its channels; download it again") from None
    if not 1e-11 < sample_s < 1e-6:
        raise ScenarioError(f"{where}: 'distance_scaling' is {step}, no range between samples [m]; download it again")
    fill = int(np.median((data != data[:, :1]).argmax(axis=1)))  # samples up to the first that differs
    fill = max(min(fill, _DARK_SAMPLES) - 1, 0)
    delay_s = delay_s + fill * sample_s
    known = delay_s[np.isfinite(delay_s)]
    dark = _DARK_SAMPLES - fill
    if len(known) and known.max() < 0.0:  # where delays are unknown, the publisher's reader has 0
        dark = int(np.floor(-known.max() / sample_s)) - _EARLY_SAMPLES
    return RawWaveforms(
        gain, data[:, fill:].astype(np.float32), sample_s, delay_s, min(max(dark, 0), data.shape[1] - fill)
    )

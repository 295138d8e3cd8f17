"""Records that a recording keeps on request: waveforms, images of photons, oversampled images, predictions.

All frames of a recording have arrays of one shape. Traces are therefore stored on the focal plane, with NaN in pixels
without a trace, and photons are summed in each pixel. Rays and hits have no fixed shape and cannot be recorded.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from rso_lidar.errors import RecordingError, did_you_mean
from rso_lidar.records import ArraySpec, Oversampled, Photons, PixelPrediction, Record, Waveforms, array, specs


@dataclass(frozen=True, eq=False, repr=False)
class PhotonImage(Record):
    """Sum of the `Photons` in each pixel."""

    photons: np.ndarray = array(
        "row col", "f4", "1", "expected photons on each pixel, after the optics, before the APD"
    )
    background_photons_per_s: np.ndarray | None = array(
        "row col", "f4", "s-1", "sunlight on each pixel, after the optics; None without background", optional=True
    )


RECORDS: dict[str, type[Record]] = {
    "waveforms": Waveforms,
    "photons": PhotonImage,
    "oversampled": Oversampled,
    "prediction": PixelPrediction,
}

FIELDS = {  # by group of the file: name in the file, and in the record
    "waveforms": {
        "samples": "samples_counts",
        "start": "start_s",
        "latch": "latch_s",
        "clipped": "clipped",
        "zero_crossing": "zero_crossing_s",
        "base": "base_per_s",
    },
    "photons": {"image": "photons", "background": "background_photons_per_s"},
    "oversampled": {"range": "range_m", "photons": "photons"},
    "prediction": {"detection_probability": "detection_probability", "range_sigma": "range_sigma_m"},
}
CONSTANTS = {"waveforms": ("sample_s", "baseline_counts")}  # attributes of a group: the same in all frames
_FLAG = np.dtype("u1")  # files hold true and false as 1 and 0
_DIMS = {"trace": ("row", "col")}  # a trace is stored at its pixel


def check_kept(names: Iterable[str]) -> None:
    """Check the names of intermediate records to keep.

    Parameters
    ----------
    names : such as "waveforms", the values of `keep`

    Raises
    ------
    RecordingError
        If a recording cannot keep a record of that name.
    """
    for name in names:
        if name not in RECORDS:
            guess = did_you_mean(name, RECORDS)
            raise RecordingError(f"keep: a recording cannot keep '{name}'{guess or ';'} (known: {', '.join(RECORDS)})")


def list_arrays(kept: Mapping[str, Record]) -> dict[str, ArraySpec]:
    """List the arrays that a recording makes of kept records, by path."""
    array_specs = {}
    for group, record in _select_recordable(kept).items():
        for path, name in FIELDS[group].items():
            if getattr(record, name) is not None:
                spec = specs(type(record))[name]
                dims = [placed for dim in spec.dims for placed in _DIMS.get(dim, (dim,))]
                dtype = _FLAG if spec.dtype.kind == "b" else spec.dtype
                array_specs[f"{group}/{path}"] = dataclasses.replace(spec, dims=tuple(dims), dtype=dtype)
    return array_specs


def collect_arrays(kept: Mapping[str, Record], shape: tuple[int, ...]) -> dict[str, np.ndarray]:
    """Collect the arrays of the kept records of a frame of `shape` (row, col), by path."""
    arrays: dict[str, np.ndarray] = {}
    for group, record in _select_recordable(kept).items():
        if isinstance(record, Waveforms):
            if tuple(record.shape) != tuple(shape):
                raise RecordingError(f"kept waveforms: are of {record.shape} pixels, the frame of {shape}; match them")
            if not np.all(np.isfinite(record.start_s)):
                raise RecordingError("kept waveforms: start_s is not finite; leave out pixels without a trace")
        for path, name in FIELDS[group].items():
            value = getattr(record, name)
            if value is not None:
                arrays[f"{group}/{path}"] = _spread_traces(record, value) if isinstance(record, Waveforms) else value
    return arrays


def get_constants(kept: Mapping[str, Record]) -> dict[str, dict[str, float]]:
    """Return the numbers that hold for all frames of a recording, by group and name."""
    return {
        group: {name: float(getattr(record, name)) for name in CONSTANTS[group]}
        for group, record in kept.items()
        if group in CONSTANTS
    }


def restore_record(group: str, entries: Mapping[str, np.ndarray], constants: Mapping[str, float]) -> Record:
    """Restore a kept record from its arrays in a recording.

    Parameters
    ----------
    constants : numbers that hold for all frames, by name
    """
    if group != "waveforms":
        return RECORDS[group](**entries)
    start_s = entries["start_s"]
    traced = np.isfinite(start_s)
    rows, cols = start_s.shape
    stated = specs(Waveforms)
    traces = {name: entry[traced].astype(stated[name].dtype, copy=False) for name, entry in entries.items()}
    sample_s, baseline_counts = (constants[name] for name in CONSTANTS[group])
    return Waveforms((rows, cols), sample_s, baseline_counts, np.flatnonzero(traced), **traces)


def _spread_traces(waveforms: Waveforms, values: np.ndarray) -> np.ndarray:
    """Spread the values of traces over the focal plane (row, col, …), with NaN or 0 in pixels without a trace."""
    rows, cols = waveforms.shape
    if values.dtype.kind == "b":
        values = values.astype(_FLAG)
    missing = 0 if values.dtype == _FLAG else np.nan
    image = np.full((rows * cols, *values.shape[1:]), missing, dtype=values.dtype)
    image[waveforms.pixel] = values
    return image.reshape(rows, cols, *values.shape[1:])


def _select_recordable(kept: Mapping[str, Record]) -> dict[str, Record]:
    """Return the kept records in the form that a recording takes; raise a `RecordingError` for any other record."""
    records = {}
    for group, record in kept.items():
        taken = _sum_photons(record) if isinstance(record, Photons) else record
        if not isinstance(taken, RECORDS.get(group, ())):
            raise RecordingError(f"kept {group}: cannot be recorded; keep {', '.join(RECORDS)}, or leave it out")
        records[group] = taken
    return records


def _sum_photons(photons: Photons) -> PhotonImage:
    rows, cols = photons.shape
    total = np.bincount(photons.pixel, photons.photons, minlength=rows * cols)
    return PhotonImage(total.reshape(rows, cols), photons.background_photons_per_s)

"""Output of the sensor for one flash, its intermediate signals, and the true content of each pixel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rso_lidar.records.schema import Record, array


@dataclass(frozen=True, eq=False, repr=False)
class Waveforms(Record):
    """Digitised pulses: one trace for each pixel that latched, or for all pixels under a range gate.

    Sample k of a trace was taken `start_s` + k `sample_s` [s] after emission.
    """

    shape: tuple[int, int]
    sample_s: float
    baseline_counts: float
    pixel: np.ndarray = array("trace", "i4", "1", "row * n_cols + col, ascending")
    start_s: np.ndarray = array("trace", "f8", "s", "two-way delay of the first sample since emission")
    latch_s: np.ndarray = array(
        "trace", "f8", "s", "when the signal passed the comparator's threshold, since emission; NaN under a range gate"
    )
    samples_counts: np.ndarray = array("trace sample", "f4", "count", "output of the converter, baseline included")
    clipped: np.ndarray | None = array(
        "trace sample", "?", "1", "where the converter clipped, in any of the pulses averaged", optional=True
    )
    zero_crossing_s: np.ndarray | None = array(
        "trace",
        "f8",
        "s",
        "when the bipolar pulse of a zero-crossing discriminator crossed zero, since emission; NaN where it never armed",
        optional=True,
    )
    base_per_s: np.ndarray | None = array(
        "trace",
        "f8",
        "s-1",
        "photoelectrons of dark current and background, from the pixel's mean current",
        optional=True,
    )


@dataclass(frozen=True, eq=False, repr=False)
class Taps(Record):
    """Signals between the stages of a detector, over the stretch of time that each trace of its `Waveforms` stores.

    Step k of a trace is centred at `start_s` + k `step_s` [s] after emission. Under a range gate the signals are means over
    the pulses of the frame. Noise that triggers an unlit pixel is simulated at its samples only: in between, its
    amplitude is NaN.
    """

    shape: tuple[int, int]
    step_s: float
    pixel: np.ndarray = array("trace", "i4", "1", "row * n_cols + col, ascending")
    start_s: np.ndarray = array("trace", "f8", "s", "two-way delay of the first step since emission")
    threshold_electrons: np.ndarray = array("trace", "f4", "1", "threshold of the comparator; NaN under a range gate")
    primaries: np.ndarray = array(
        "trace step", "f4", "1", "expected photoelectrons in a step: of the pulse, dark current and background"
    )
    amplitude_electrons: np.ndarray = array("trace step", "f4", "1", "output of the amplifier above its baseline")
    comparator: np.ndarray = array(
        "trace step", "i1", "1", "1 where the amplitude is at or above the threshold, 0 where below, -1 where unknown"
    )


@dataclass(frozen=True, eq=False, repr=False)
class Reading(Record):
    """The output of the sensor for one flash."""

    range_m: np.ndarray = array("row col", "f4", "m", "measured slant range, NaN where nothing was reported")
    intensity_counts: np.ndarray = array(
        "row col", "u2", "count", "fitted pulse amplitude above baseline, 0 where none"
    )
    saturated: np.ndarray = array("row col", "u1", "1", "1 where the amplitude clipped")
    return_range_m: np.ndarray | None = array(
        "row col return", "f4", "m", "measured ranges of all returns, near to far, NaN beyond the last", optional=True
    )
    return_intensity_counts: np.ndarray | None = array(
        "row col return", "u2", "count", "fitted amplitudes of all returns, 0 beyond the last", optional=True
    )
    crosstalk: np.ndarray | None = array(
        "row col", "u1", "1", "1 where the sensor takes its return for the crosstalk of neighbours", optional=True
    )
    superimposed: np.ndarray | None = array(
        "row col",
        "u1",
        "1",
        "1 where the sensor takes its return for overlapping pulses of several depths",
        optional=True,
    )


@dataclass(frozen=True, eq=False, repr=False)
class PixelPrediction(Record):
    """Expected reports of each pixel for the light of one flash, over many draws of the sensor's noise.

    A report counts if it is of the cluster that `Labels` describe. In a pixel without light the probability is 0 and the
    standard deviation NaN.
    """

    detection_probability: np.ndarray = array(
        "row col", "f4", "1", "probability that the pixel reports what is there, and not noise or another cluster"
    )
    range_sigma_m: np.ndarray = array(
        "row col", "f4", "m", "standard deviation of the range that it then reports, NaN where nothing is lit"
    )


@dataclass(frozen=True, eq=False, repr=False)
class Labels(Record):
    """True content of each pixel, as far as it is lit.

    A pixel with several clusters is labelled by its brightest cluster. Within it, part and target are those that
    return most light, and the facet is that of their brightest return. Keypoints are in the order of `Source.keypoints`.
    """

    range_m: np.ndarray = array(
        "row col", "f8", "m", "photon-weighted mean range of the brightest cluster, NaN for sky"
    )
    first_range_m: np.ndarray = array(
        "row col",
        "f8",
        "m",
        "photon-weighted mean range of the nearest cluster with at least a thousandth of the pixel's light, NaN for sky",
    )
    cluster_count: np.ndarray = array(
        "row col", "u1", "1", "clusters of returns in the pixel with at least a thousandth of its light"
    )
    target: np.ndarray = array("row col", "i2", "1", "target index of the brightest part, -1 for sky")
    part: np.ndarray = array("row col", "i2", "1", "index of the part that returns most light, -1 for sky")
    facet: np.ndarray = array(
        "row col", "i4", "1", "facet index in the source file of that part's brightest return, -1 for sky"
    )
    cos_incidence: np.ndarray = array("row col", "f4", "1", "cosine of incidence of that return, NaN for sky")
    photons: np.ndarray = array("row col", "f4", "1", "expected photons of the whole pixel")
    filled_fraction: np.ndarray = array("row col", "f4", "1", "share of the pixel's area that is on a target and lit")
    photons_sampling_error: np.ndarray | None = array(
        "row col",
        "f4",
        "1",
        "estimated rms error of the first bounce's `photons` because rays sample the pixel's area",
        optional=True,
    )
    return_range_m: np.ndarray | None = array(
        "row col return",
        "f8",
        "m",
        "photon-weighted mean range of each cluster, near to far, NaN beyond",
        optional=True,
    )
    return_photons: np.ndarray | None = array(
        "row col return", "f4", "1", "expected photons of each cluster, 0 beyond the last", optional=True
    )
    crosstalk: np.ndarray | None = array(
        "row col",
        "u1",
        "1",
        "1 where neighbours couple more than half of the light about the reported range",
        optional=True,
    )
    saturated: np.ndarray | None = array(
        "row col", "u1", "1", "1 where the expected amplitude about the reported range clips", optional=True
    )
    superimposed: np.ndarray | None = array(
        "row col",
        "u1",
        "1",
        "1 where the depths of the light about the reported range lengthen its pulse by more than a fifth",
        optional=True,
    )
    keypoint_px: np.ndarray | None = array(
        "keypoint row_col",
        "f8",
        "1",
        "row and column of each keypoint, 0 at the centre of the first pixel; NaN outside the field",
        optional=True,
    )
    keypoint_range_m: np.ndarray | None = array(
        "keypoint", "f8", "m", "distance of each keypoint from the sensor's origin", optional=True
    )
    keypoint_visibility: np.ndarray | None = array(
        "keypoint", "u1", "1", "0 outside the field, 1 hidden by a target, 2 visible", optional=True
    )

"""Waveforms as a converter gave them, of any camera."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class RawWaveforms:
    """The waveforms of one flash, one for each channel of one gain.

    Parameters
    ----------
    gain : name of the gain, such as ``high``
    samples_counts : (channel, sample) output of the converter, baseline included [counts]
    sample_s : time between samples [s]
    delay_s : (channel) two-way delay of the first sample since emission [s]
    dark_samples : number of samples at the start without light
    """

    gain: str
    samples_counts: np.ndarray
    sample_s: float
    delay_s: np.ndarray
    dark_samples: int

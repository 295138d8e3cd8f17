"""Levels of sunlight between which effects of its noise are interpolated."""

from __future__ import annotations

import numpy as np

from rso_lidar.detector.settings.gsfl import Gsfl
from rso_lidar.detector.settings.noise import noise_rms

_GROWTH_STEP = 0.113_328_685_307_003_3  # log 1.12 of noise in sunlight over that in the dark, between levels
_NO_GROWTH = 0.019_802_627_296_179_73  # log 1.02: less sunlight counts as none


def split_sunlight(gsfl: Gsfl, background_photons_per_s: np.ndarray) -> list[tuple[float, np.ndarray]]:
    """Split sunlight between levels of the noise that it makes, a factor of 1.12 apart, for linear interpolation.

    Parameters
    ----------
    background_photons_per_s : (pixel) sunlight [photons/s]

    Returns
    -------
    levels of sunlight [photons/s], each with the weights (pixel) of what is computed at it. They sum to 1 in each pixel.
    """
    amplifier, apd = gsfl.amplifier, gsfl.apd
    dark_variance = gsfl.noise_electrons**2
    shot = float(noise_rms(apd, gsfl.quantum_efficiency, 0.0, amplifier.pole_s, amplifier.integration_s)) ** 2
    if dark_variance == 0.0:  # no noise that could grow: sunlight is a few steps of its own
        dark_variance = shot * max(float(background_photons_per_s.max(initial=0.0)), 1.0) * 1e-3
    growth = 0.5 * np.log1p(background_photons_per_s * (shot / dark_variance))
    place = np.where(growth < _NO_GROWTH, 0.0, growth / _GROWTH_STEP)
    split = []
    for k in np.unique([np.floor(place), np.ceil(place)]):
        weight = np.maximum(1.0 - np.abs(place - k), 0.0)
        split.append((float(np.expm1(2.0 * k * _GROWTH_STEP) * dark_variance / shot), weight))
    return split

"""The protocol of user-defined detectors, and checks of their traits and of what their methods return."""

from __future__ import annotations

from functools import partial
from typing import Any, Protocol, runtime_checkable

import numpy as np

from rso_lidar.detector.analysis.array_load import ArrayLoad
from rso_lidar.detector.analysis.closed_form import Prediction
from rso_lidar.detector.settings.traits import DetectorTraits
from rso_lidar.errors import ScenarioError
from rso_lidar.part import GREATEST, Part, check_values, make_answer_error, name_object, read_member
from rso_lidar.records import Photons, Reading, Waveforms


@runtime_checkable
class Detector(Protocol):
    """Protocol of user-defined detectors.

    Parameters
    ----------
    traits : facts that the scenario needs: reach, threshold, number of returns.
    """

    traits: DetectorTraits

    def detect(self, photons: Photons, rng: np.random.Generator) -> tuple[Reading, Waveforms | None]:
        """Return the reading of one flash, and the stored samples; None for a detector without waveforms.

        Parameters
        ----------
        photons : light on every pixel: a return for each sub-ray that hits, and `cluster`, which groups those of one pulse.
        rng : generator of all noise.
        """
        ...


def check_traits(detector: object) -> None:
    """Check that a user-defined detector has traits, and the methods that they promise.

    Parameters
    ----------
    detector : the user's object.

    Raises
    ------
    ScenarioError : if it lacks one.
    """
    traits = read_member(detector, "traits", None, DetectorTraits, "give it a DetectorTraits")
    for promised, method in ((traits.is_gated, "with_gate_delay"), (traits.has_taps, "detect_with_taps")):
        if promised and not isinstance(detector, Part) and not callable(getattr(detector, method, None)):
            raise ScenarioError(
                f"{name_object(detector)}: its traits promise a method {method}(), which it lacks; add it, or change traits"
            )


def check_reading(detector: Any, method: str, found: object, photons: Photons) -> tuple[Reading, Waveforms | None]:
    """Check what the method of a user-defined detector returned.

    Parameters
    ----------
    detector : the user's object.
    method : its method.
    found : what the method returned.
    photons : the light that it was given.

    Returns
    -------
    the reading, and the waveforms or None.

    Raises
    ------
    ScenarioError : if that is not a reading of the array with or without waveforms.
    """
    if not isinstance(found, tuple) or len(found) != 2:
        raise make_answer_error(detector, method, found, "return (Reading, Waveforms or None)")
    reading, waveforms = found
    if not isinstance(reading, Reading) or reading.range_m.shape != photons.shape:
        raise make_answer_error(detector, method, reading, f"return a Reading of {photons.shape} pixels first")
    listed, wanted = reading.return_range_m, detector.traits.max_returns
    if wanted > 1 and (listed is None or listed.shape[-1] != wanted):
        raise make_answer_error(detector, method, reading, f"list {wanted} returns of each pixel, as the traits say")
    if waveforms is not None and not isinstance(waveforms, Waveforms):
        raise make_answer_error(detector, method, waveforms, "return Waveforms or None after the Reading")
    if any(
        np.isinf(range_m).any() or (range_m < 0.0).any() for range_m in (reading.range_m, listed) if range_m is not None
    ):
        raise ScenarioError(
            f"{name_object(detector)}: {method}() returned ranges that are negative or infinite; write NaN for no return"
        )
    return reading, waveforms


def check_prediction(detector: object, method: str, found: object, *, shape: tuple[int, ...]) -> Prediction | None:
    """Check the closed form that a user-defined detector returned, and return it.

    Parameters
    ----------
    detector, method : the object and the name of its method.
    found : what the method returned.
    shape : shape of the returns.

    Returns
    -------
    the prediction, or None without a closed form.

    Raises
    ------
    ScenarioError
        If it is not a prediction for these returns.
    """
    if found is None:
        return None
    if not isinstance(found, Prediction) or any(np.shape(values) != shape for values in vars(found).values()):
        raise make_answer_error(detector, method, found, f"return a Prediction with arrays of shape {shape}, or None")
    limits = {"probability": 1.0, "range_precision_m": np.inf, "snr": np.inf, "saturated": 1.0}
    checked = {
        name: check_values(detector, method, getattr(found, name), shape=shape, least=0.0, most=most, member=name)
        for name, most in limits.items()
    }
    return Prediction(**checked | {"saturated": checked["saturated"].astype(bool)})


def check_array_load(detector: object, method: str, found: object, *, n_pixels: int) -> ArrayLoad:
    """Check the array load that a user-defined detector returned, and return it.

    Parameters
    ----------
    detector, method : the object and the name of its method.
    found : what the method returned.
    n_pixels : number of pixels.

    Raises
    ------
    ScenarioError
        If it is not a load of these pixels.
    """
    if not isinstance(found, ArrayLoad):
        raise make_answer_error(detector, method, found, "return an ArrayLoad")
    check = partial(check_values, detector, method, shape=(n_pixels,), least=0.0)
    return ArrayLoad(
        check(found.gain, most=GREATEST, member="gain"),
        check(found.together_fraction, most=1.0, member="together_fraction"),
    )

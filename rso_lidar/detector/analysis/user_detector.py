"""User-defined detectors: their protocol, the adapter that the package uses, and checks of what their methods return."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol, runtime_checkable

import numpy as np

from rso_lidar.detector.analysis.array_load import ArrayLoad
from rso_lidar.detector.analysis.built_detector import BuiltDetector
from rso_lidar.detector.analysis.closed_form import Prediction
from rso_lidar.detector.ranging.pulse import LaserPulse
from rso_lidar.detector.settings.traits import DetectorTraits
from rso_lidar.errors import ScenarioError
from rso_lidar.part import (
    GREATEST,
    Part,
    call_member,
    check_lines,
    check_text,
    check_values,
    lock_array,
    make_answer_error,
    name_object,
    read_member,
)
from rso_lidar.records import Photons, Reading, Taps, Waveforms


@runtime_checkable
class Detector(Protocol):
    """Protocol of user-defined detectors.

    Parameters
    ----------
    traits : facts that the scenario needs: reach, threshold, number of returns
    """

    traits: DetectorTraits

    def detect(self, photons: Photons, rng: np.random.Generator) -> tuple[Reading, Waveforms | None]:
        """Return the reading of one flash, and the stored samples; None for a detector without waveforms.

        Parameters
        ----------
        photons : light on every pixel: a return for each sub-ray that hits, and `cluster`, which groups those of one pulse
        rng : generator of all noise
        """
        ...


@dataclass(frozen=True)
class BuiltUserDetector(BuiltDetector):
    """An object of a user: a method that it lacks answers by default, and the result of one that it has is checked."""

    part: Any

    def detect(
        self, photons: Photons, rng: np.random.Generator, threads: int | None
    ) -> tuple[Reading, Waveforms | None]:
        """Return what the object detects."""
        return check_reading(self.part, "detect", call_member(self.part, "detect", photons, rng), photons)

    def detect_with_taps(
        self, photons: Photons, rng: np.random.Generator, threads: int | None
    ) -> tuple[Reading, Waveforms | None, Taps | None]:
        """Return what the object detects, with its signals between the stages where it has them."""
        if not hasattr(self.part, "detect_with_taps"):
            return super().detect_with_taps(photons, rng, threads)
        own: Any = call_member(self.part, "detect_with_taps", photons, rng)
        if not isinstance(own, tuple) or len(own) != 3 or not isinstance(own[2], Taps | None):
            cure = "return (Reading, Waveforms or None, Taps or None)"
            raise make_answer_error(self.part, "detect_with_taps", own, cure)
        return *check_reading(self.part, "detect_with_taps", own[:2], photons), own[2]

    def check_noise(self) -> None:
        """Let the object refuse its noise."""
        call_member(self.part, "check_noise")

    def check_size(self, pulse_fwhm_s: float, n_pixels: int) -> None:
        """Let the object refuse its size."""
        call_member(self.part, "check_size", pulse_fwhm_s, n_pixels)

    def describe(self, n_pixels: int) -> list[str]:
        """Return the object's lines, or the default for none."""
        default = super().describe(n_pixels)
        return list(self._ask("describe", default, check_lines, n_pixels)) or default

    def advise(self, pulse_fwhm_s: float) -> list[str]:
        """Return the object's lines."""
        return list(self._ask("advise", [], check_lines, pulse_fwhm_s))

    def describe_storage(self) -> list[str]:
        """Return the object's lines."""
        return list(self._ask("describe_storage", [], check_lines))

    def describe_window(self) -> str:
        """Return the object's words."""
        return str(self._ask("describe_window", super().describe_window(), check_text))

    def list_neglected_effects(self) -> list[str]:
        """Return the object's list."""
        return list(self._ask("list_neglected_effects", [], check_lines))

    def false_alarm_probability(self, range_m: np.ndarray) -> np.ndarray:
        """Return the object's probabilities (range)."""
        check = partial(check_values, shape=np.shape(range_m), least=0.0, most=1.0)
        default = super().false_alarm_probability(range_m)
        return np.asarray(self._ask("false_alarm_probability", default, check, range_m))

    def detection_probability(self, photons: np.ndarray) -> np.ndarray | None:
        """Return the object's probabilities (return)."""
        check = partial(check_values, shape=np.shape(photons), least=0.0, most=1.0)
        known = self._ask("detection_probability", None, check, photons)
        return None if known is None else np.asarray(known)

    def predict_closed_form(
        self, pulse: LaserPulse, photons: np.ndarray, depth_s: np.ndarray, only_probability: bool
    ) -> Prediction | None:
        """Return the object's prediction."""
        pulse = pulse._replace(power_per_s=lock_array(pulse.power_per_s))
        check = partial(check_prediction, shape=photons.shape)
        prediction: Prediction | None = self._ask("predict_closed_form", None, check, pulse, photons, depth_s)
        return prediction

    def report_probability(self, photons: Photons, mine: np.ndarray) -> np.ndarray | None:
        """Return the object's probabilities (pixel)."""
        shape = (photons.shape[0] * photons.shape[1],)
        check = partial(check_values, shape=shape, least=0.0, most=1.0)
        probability: np.ndarray | None = self._ask("report_probability", None, check, photons, mine)
        return probability

    def noise_growth(self, background_photons_per_s: float) -> float:
        """Return the object's ratio."""
        check = partial(check_values, least=0.0)
        return float(self._ask("noise_growth", 1.0, check, background_photons_per_s))

    def isolate(self, gain: float) -> Any:
        """Return the object's isolated detector."""
        apart = call_member(self.part, "isolate", gain, default=self.part)
        is_part = isinstance(apart, Part) and isinstance(getattr(apart, "traits", None), DetectorTraits)
        if not is_part and not isinstance(apart, Detector):
            raise make_answer_error(self.part, "isolate", apart, "return a detector")
        return apart

    def array_load(self, photons: Photons) -> ArrayLoad:
        """Return the object's load."""
        check = partial(check_array_load, n_pixels=photons.shape[0] * photons.shape[1])
        load: ArrayLoad = self._ask("array_load", super().array_load(photons), check, photons)
        return load

    def draw_crosstalk_m(self, together_fraction: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Return the object's errors (pixel) [m]."""
        default = super().draw_crosstalk_m(together_fraction, rng)
        check = partial(check_values, shape=default.shape, least=-GREATEST, most=GREATEST)
        return np.asarray(self._ask("draw_crosstalk_m", default, check, together_fraction, rng))

    def frame_jitter_s(self) -> float:
        """Return the object's jitter [s, 1 sigma]."""
        return float(self._ask("frame_jitter_s", 0.0, partial(check_values, least=0.0, most=GREATEST)))

    def _ask(self, name: str, default: Any, check: Callable[[object, str, object], Any], *given: Any) -> Any:
        """Return the checked answer of a method of the object, which gets its arrays read-only, or the default.

        Parameters
        ----------
        check : called with the object, the name of its method and the answer; returns the answer, or raises an error
        """
        answer = call_member(self.part, name, *given, default=default)
        return answer if answer is default else check(self.part, name, answer)


def check_traits(detector: object) -> None:
    """Check that a user-defined detector has traits, and the methods that they promise.

    Parameters
    ----------
    detector : the user's object

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


def check_reading(detector: Any, method: str, answer: object, photons: Photons) -> tuple[Reading, Waveforms | None]:
    """Check what the method of a user-defined detector returned.

    Raises
    ------
    ScenarioError : if that is not a reading of the array with or without waveforms.
    """
    if not isinstance(answer, tuple) or len(answer) != 2:
        raise make_answer_error(detector, method, answer, "return (Reading, Waveforms or None)")
    reading, waveforms = answer
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


def check_prediction(detector: object, method: str, prediction: object, *, shape: tuple[int, ...]) -> Prediction | None:
    """Check the closed form that a user-defined detector returned, and return it.

    Raises
    ------
    ScenarioError
        If it is not a prediction for these returns.
    """
    if prediction is None:
        return None
    if not isinstance(prediction, Prediction) or any(np.shape(values) != shape for values in vars(prediction).values()):
        raise make_answer_error(
            detector, method, prediction, f"return a Prediction with arrays of shape {shape}, or None"
        )
    limits = {"probability": 1.0, "range_precision_m": np.inf, "snr": np.inf, "saturated": 1.0}
    checked = {
        name: check_values(detector, method, getattr(prediction, name), shape=shape, least=0.0, most=most, member=name)
        for name, most in limits.items()
    }
    return Prediction(**checked | {"saturated": checked["saturated"].astype(bool)})


def check_array_load(detector: object, method: str, load: object, *, n_pixels: int) -> ArrayLoad:
    """Check the array load that a user-defined detector returned, and return it.

    Raises
    ------
    ScenarioError
        If it is not a load of these pixels.
    """
    if not isinstance(load, ArrayLoad):
        raise make_answer_error(detector, method, load, "return an ArrayLoad")
    check = partial(check_values, detector, method, shape=(n_pixels,), least=0.0)
    return ArrayLoad(
        check(load.gain, most=GREATEST, member="gain"),
        check(load.together_fraction, most=1.0, member="together_fraction"),
    )

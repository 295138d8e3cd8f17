"""The interface of all detectors, and the functions that implement it for each kind.

`Gsfl`, `Empirical` and `GeigerArray` are data; the table `_FUNCTIONS` lists the functions of each. A Python user may give an
object that follows the protocol `Detector` in their place, as ``lidar.detector``. Every function here takes either.

- `detect` makes a reading of the light of one flash; `detect_with_taps` also returns the signals between the stages.
- ``detector.traits`` holds the facts: reach, threshold, number of returns, gate, settings in force (`DetectorTraits`).
  A gated detector has ``with_gate_delay(delay_ns)`` as well.
- `check_noise`, `check_size`, `describe`, `advise`, `describe_window`, `describe_storage` and `list_neglected_effects` serve
  the checks and the texts of a scenario.
- `false_alarm_probability`, `detection_probability`, `predict_closed_form`, `report_probability` and `noise_growth` are
  closed forms. `prediction.predict` runs a trial of pixels for a detector without one.
- `isolate`, `array_load`, `draw_crosstalk_m` and `frame_jitter_s` separate pixels from their array, for `trial.run_trial`.

A detector without noise that lists the first return of each pixel::

    class FirstPhoton:
        traits = DetectorTraits(sees_to_m=2000.0, threshold_photons=1.0)

        def detect(self, photons, rng):
            n_pixels = photons.shape[0] * photons.shape[1]
            pixel, first = np.unique(photons.pixel, return_index=True)
            range_m = np.full(n_pixels, np.nan)
            range_m[pixel] = photons.delay_s[first] * units.RANGE_PER_DELAY_M_S
            light = np.bincount(photons.pixel, photons.photons, n_pixels)  # of all returns of a pixel
            counts = np.minimum(np.rint(light), 65535)
            planes = (values.reshape(photons.shape) for values in (range_m, counts, np.zeros(n_pixels, bool)))
            return Reading(*planes), None

Such an object may also have methods named like the functions above, with the same arguments after the detector. A
function whose method is missing returns the default that its docstring states; a method with an invalid result raises
`ScenarioError`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from rso_lidar.detector.analysis import closed_form, description, limits, noise_effects, pixel_reports
from rso_lidar.detector.analysis.array_load import ArrayLoad, simulate_array_load
from rso_lidar.detector.analysis.closed_form import Prediction
from rso_lidar.detector.analysis.user_detector import Detector, check_array_load, check_prediction, check_reading
from rso_lidar.detector.chain.camera import camera_of
from rso_lidar.detector.chain.curves import detect_by_curves
from rso_lidar.detector.chain.full import run_chain
from rso_lidar.detector.geiger import photon_counter
from rso_lidar.detector.geiger.array import GeigerArray
from rso_lidar.detector.settings.empirical import Empirical
from rso_lidar.detector.settings.gsfl import Gsfl
from rso_lidar.detector.settings.laser_pulse import LaserPulse
from rso_lidar.part import (
    GREATEST,
    Seam,
    call_member,
    check_lines,
    check_text,
    check_values,
    lock_array,
    make_answer_error,
)
from rso_lidar.records import Photons, Reading, Taps, Waveforms

DescribedDetector = Annotated[Gsfl | Empirical | GeigerArray, Field(discriminator="type")]
AnyDetector = Annotated[Gsfl | Empirical | GeigerArray | Detector, Seam(DescribedDetector, Detector)]

# Functions of each described part, by the names of the functions below. Each takes the part first.
_FUNCTIONS: dict[type, dict[str, Callable[..., Any]]] = {
    Gsfl: {
        "detect": lambda gsfl, photons, rng, threads: run_chain(
            camera_of(gsfl, photons), photons, rng, threads=threads
        )[:2],
        "detect_with_taps": lambda gsfl, photons, rng, threads: run_chain(
            camera_of(gsfl, photons), photons, rng, with_taps=True, threads=threads
        ),
        "check_noise": limits.check_noise_gsfl,
        "check_size": limits.check_size_gsfl,
        "describe": description.describe_gsfl,
        "advise": description.advise_gsfl,
        "describe_storage": description.describe_storage,
        "describe_window": description.describe_window_gsfl,
        "list_neglected_effects": description.list_neglected_gsfl,
        "false_alarm_probability": noise_effects.false_alarms_of_gsfl,
        "predict_closed_form": closed_form.predict_gsfl,
        "report_probability": pixel_reports.report_probability_gsfl,
        "noise_growth": noise_effects.noise_growth_gsfl,
        "isolate": Gsfl.alone,
        "array_load": simulate_array_load,
        "draw_crosstalk_m": noise_effects.draw_crosstalk_gsfl_m,
        "frame_jitter_s": lambda gsfl: gsfl.frame_jitter_s,
    },
    Empirical: {
        "detect": lambda empirical, photons, rng, threads: (detect_by_curves(empirical, photons, rng), None),
        "describe": lambda empirical, n_pixels: description.describe_empirical(empirical),
        "false_alarm_probability": noise_effects.false_alarms_of_empirical,
        "detection_probability": Empirical.detection_probability,
        "predict_closed_form": closed_form.predict_empirical,
        "report_probability": pixel_reports.report_probability_empirical,
    },
    GeigerArray: photon_counter.FUNCTIONS,
}


def detect(
    photons: Photons, detector: AnyDetector, rng: np.random.Generator, threads: int | None = 1
) -> tuple[Reading, Waveforms | None]:
    """Detect the light of one flash.

    Parameters
    ----------
    photons : light on every pixel.
    detector : a part, or an object with the same method.
    rng : generator of all noise.
    threads : number of threads (None: one for each core). The result is the same to the bit.

    Returns
    -------
    reading, and the stored samples; None for a detector without waveforms.
    """
    described = _find_functions(detector)
    if described:
        found: tuple[Reading, Waveforms | None] = described["detect"](detector, photons, rng, threads)
        return found
    return check_reading(detector, "detect", call_member(detector, "detect", photons, rng), photons)


def detect_with_taps(
    photons: Photons, detector: AnyDetector, rng: np.random.Generator, threads: int | None = 1
) -> tuple[Reading, Waveforms | None, Taps | None]:
    """Detect the light of one flash, and also return the signals between the stages, None where they are not simulated.

    Reading and waveforms are those of `detect`.

    Parameters
    ----------
    photons : light on every pixel.
    detector : a part, or an object that may have a method of this name.
    rng : generator of all noise.
    threads : number of threads (None: one for each core). The result is the same to the bit.

    Returns
    -------
    reading, waveforms and signals between the stages; None for what is not simulated.
    """
    described = _find_functions(detector)
    if described and "detect_with_taps" in described:
        found: tuple[Reading, Waveforms | None, Taps | None]
        found = described["detect_with_taps"](detector, photons, rng, threads)
        return found
    if described or not hasattr(detector, "detect_with_taps"):
        return *detect(photons, detector, rng, threads), None
    own: Any = call_member(detector, "detect_with_taps", photons, rng)
    if not isinstance(own, tuple) or len(own) != 3 or not isinstance(own[2], Taps | None):
        raise make_answer_error(detector, "detect_with_taps", own, "return (Reading, Waveforms or None, Taps or None)")
    return *check_reading(detector, "detect_with_taps", own[:2], photons), own[2]


def check_noise(detector: AnyDetector) -> None:
    """Refuse a detector whose pixels noise alone would trigger; by default none is.

    Parameters
    ----------
    detector : the detector; `ScenarioError` where its threshold is too low.
    """
    _call(detector, "check_noise")


def check_size(detector: AnyDetector, pulse_fwhm_s: float, n_pixels: int) -> None:
    """Refuse a detector whose simulation would not fit into memory.

    Parameters
    ----------
    detector : the detector; `ScenarioError` where its axis of time is too long.
    pulse_fwhm_s : length of the laser's pulse [s].
    n_pixels : pixels of the array.
    """
    _call(detector, "check_size", pulse_fwhm_s, n_pixels)


def describe(detector: AnyDetector, n_pixels: int) -> list[str]:
    """Return a description of a detector in some lines; the last one states when it looks.

    Parameters
    ----------
    detector : the detector.
    n_pixels : number of pixels of the array.
    """
    traits = detector.traits
    line = f"detector    {type(detector).__name__}, sees {traits.sees_from_m:g} to {traits.sees_to_m:g} m"
    lines: list[str] = _call(detector, "describe", n_pixels, default=[line], check=check_lines)
    return lines or [line]


def advise(detector: AnyDetector, pulse_fwhm_s: float) -> list[str]:
    """Return what is allowed but doubtful about a detector, a line each; by default nothing.

    Parameters
    ----------
    detector : the detector.
    pulse_fwhm_s : length of the laser's pulse [s].
    """
    return list(_call(detector, "advise", pulse_fwhm_s, default=[], check=check_lines))


def describe_storage(detector: AnyDetector) -> list[str]:
    """Return what limits the choice among several returns of a pixel, a line each; by default nothing.

    Parameters
    ----------
    detector : the detector.
    """
    return list(_call(detector, "describe_storage", default=[], check=check_lines))


def describe_window(detector: AnyDetector) -> str:
    """Return in a few words when a detector looks.

    Parameters
    ----------
    detector : the detector.
    """
    traits = detector.traits
    window = f"armed {traits.sees_from_m:g} to {traits.sees_to_m:g} m"
    return str(_call(detector, "describe_window", default=window, check=check_text))


def list_neglected_effects(detector: AnyDetector) -> list[str]:
    """Return the settings that the closed form of a detector neglects; by default none.

    Parameters
    ----------
    detector : the detector.
    """
    return list(_call(detector, "list_neglected_effects", default=[], check=check_lines))


def false_alarm_probability(detector: AnyDetector, range_m: np.ndarray) -> np.ndarray:
    """Return the probability that noise in the dark is reported before light from a range arrives; by default 0.

    Parameters
    ----------
    detector : the detector.
    range_m : (range) [m].
    """
    none = np.zeros(np.shape(range_m))
    check = partial(check_values, shape=none.shape, least=0.0, most=1.0)
    return np.asarray(_call(detector, "false_alarm_probability", range_m, default=none, check=check))


def detection_probability(detector: AnyDetector, photons: np.ndarray) -> np.ndarray | None:
    """Return the probability (return) of detection; None for a detector without a closed form.

    Parameters
    ----------
    detector : the detector.
    photons : (return) expected photons.
    """
    check = partial(check_values, shape=np.shape(photons), least=0.0, most=1.0)
    found = _call(detector, "detection_probability", photons, check=check)
    return None if found is None else np.asarray(found)


def predict_closed_form(
    detector: AnyDetector,
    pulse: LaserPulse,
    photons: np.ndarray,
    depth_s: np.ndarray,
    *,
    only_probability: bool = False,
) -> Prediction | None:
    """Return the prediction of what a detector reports of returns; None for a detector without a closed form.

    Parameters
    ----------
    detector : the detector.
    pulse : the laser's pulse.
    photons, depth_s : (return) expected photons, and the time over which a surface stretches them [s].
    only_probability : whether the other members of the prediction are not needed.
    """
    photons, depth_s = (np.asarray(values, dtype=float) for values in np.broadcast_arrays(photons, depth_s))
    described = _find_functions(detector) is not None
    own = pulse if described else pulse._replace(power_per_s=lock_array(pulse.power_per_s))
    given = (own, photons, depth_s, *([only_probability] if described else []))
    check = partial(check_prediction, shape=photons.shape)
    found: Prediction | None = _call(detector, "predict_closed_form", *given, check=check)
    return found


def report_probability(detector: AnyDetector, photons: Photons, mine: np.ndarray) -> np.ndarray | None:
    """Return the probability (pixel) that a pixel reports one of some returns of a flash; None without a closed form.

    Parameters
    ----------
    detector : the detector.
    photons : light on every pixel.
    mine : (return) whether a report of this return counts.
    """
    n_pixels = photons.shape[0] * photons.shape[1]
    check = partial(check_values, shape=(n_pixels,), least=0.0, most=1.0)
    found: np.ndarray | None = _call(detector, "report_probability", photons, mine, check=check)
    return found


def noise_growth(detector: AnyDetector, background_photons_per_s: float) -> float:
    """Return the rms noise under sunlight over that in the dark, infinite without noise in the dark; by default 1.

    Parameters
    ----------
    detector : the detector.
    background_photons_per_s : sunlight on a pixel [photons/s].
    """
    check = partial(check_values, least=0.0)
    return float(_call(detector, "noise_growth", background_photons_per_s, default=1.0, check=check))


def isolate(detector: AnyDetector, gain: float = 1.0) -> AnyDetector:
    """Return a detector whose pixels do not affect each other.

    Parameters
    ----------
    detector : the detector.
    gain : gain of its APDs over their gain at rest.
    """
    apart: AnyDetector = _call(detector, "isolate", gain, default=detector)
    if not isinstance(apart, (Detector, *_FUNCTIONS)):
        raise make_answer_error(detector, "isolate", apart, "return a detector")
    return apart


def array_load(detector: AnyDetector, photons: Photons) -> ArrayLoad:
    """Return how the pixels of one flash affect each other, by simulation; by default not at all.

    Parameters
    ----------
    detector : the detector.
    photons : light on every pixel.
    """
    n_pixels = photons.shape[0] * photons.shape[1]
    none = ArrayLoad(np.ones(n_pixels), np.zeros(n_pixels))
    check = partial(check_array_load, n_pixels=n_pixels)
    load: ArrayLoad = _call(detector, "array_load", photons, default=none, check=check)
    return load


def draw_crosstalk_m(detector: AnyDetector, together_fraction: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return random range errors (pixel) [m] from other pixels that latch with each; by default none.

    Parameters
    ----------
    detector : the detector.
    together_fraction : (pixel) share of the array that latches with each.
    rng : generator of the errors.
    """
    none = np.zeros(np.shape(together_fraction))
    check = partial(check_values, shape=none.shape, least=-GREATEST, most=GREATEST)
    return np.asarray(_call(detector, "draw_crosstalk_m", together_fraction, rng, default=none, check=check))


def frame_jitter_s(detector: AnyDetector) -> float:
    """Return the jitter that all pixels of a frame share [s, 1 sigma]; by default none.

    Parameters
    ----------
    detector : the detector.
    """
    return float(_call(detector, "frame_jitter_s", default=0.0, check=partial(check_values, least=0.0, most=GREATEST)))


def _find_functions(detector: AnyDetector) -> dict[str, Callable[..., Any]] | None:
    """Return the functions of a described part; None for an object."""
    return next((functions for part, functions in _FUNCTIONS.items() if isinstance(detector, part)), None)


def _call(
    detector: AnyDetector,
    name: str,
    *given: Any,
    default: Any = None,
    check: Callable[[object, str, object], Any] = lambda _owner, _method, found: found,
) -> Any:
    """Return the result of a function of a part or of a method of an object; a default if there is neither.

    Parameters
    ----------
    detector : a part or an object.
    name : name of the function or method.
    given : its arguments after the detector; an object gets its arrays read-only.
    default : result without it.
    check : called with an object, the name of its method and the answer; returns the answer, or raises an error.
    """
    described = _find_functions(detector)
    if described is not None:
        return described[name](detector, *given) if name in described else default
    found = call_member(detector, name, *given, default=default)
    return found if found is default else check(detector, name, found)

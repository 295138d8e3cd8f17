"""The seam of the detectors: what any detector can be asked, and which module answers for the one that was given.

`Gsfl` and `Empirical` are data. A Python user may give an object of another class in their place, as
``lidar.detector``: it follows the protocol `Detector`. Every function here takes either, and nothing outside this room
asks which detector it has.

- `detect` makes a reading of the light of one flash; `detect_with_taps` also returns the signals between the stages.
- ``detector.traits`` holds the facts: reach, threshold, number of returns, gate, settings in force (`DetectorTraits`).
  A gated detector has ``with_gate_delay(delay_ns)`` as well.
- `check_size`, `describe`, `advise`, `describe_window`, `describe_storage` and `list_neglected_effects` serve the checks and
  the texts of a scenario.
- `false_alarm_probability`, `detection_probability`, `predict_closed_form` and `noise_growth` are closed forms.
  `prediction.predict` tries pixels where there is no closed form.
- `isolate`, `array_load`, `draw_crosstalk_m` and `frame_jitter_s` separate pixels from their array, for `trial.trial`.

A detector without noise that lists the first return of each pixel::

    class FirstPhoton:
        traits = DetectorTraits(sees_to_m=2000.0, threshold_photons=1.0)

        def detect(self, photons, rng):
            n_pixels = photons.shape[0] * photons.shape[1]
            pixel, first = np.unique(photons.pixel, return_index=True)
            range_m, counts = np.full(n_pixels, np.nan), np.zeros(n_pixels)
            range_m[pixel] = photons.delay_s[first] * units.RANGE_PER_DELAY_M_S
            counts[pixel] = photons.photons[first]
            planes = (values.reshape(photons.shape) for values in (range_m, counts, np.zeros(n_pixels, bool)))
            return Reading(*planes), None

Such an object may also have methods named like the functions above, with the same arguments after the detector. A
function whose method is missing returns the default that its docstring states.
"""

from __future__ import annotations

from typing import Annotated, Any, Protocol, runtime_checkable

import numpy as np
from pydantic import Field

from rso_lidar import units
from rso_lidar.detector.chain.camera import mean_false_alarms_per_s
from rso_lidar.detector.chain.curves import detect_by_curves
from rso_lidar.detector.chain.full import run_chain
from rso_lidar.detector.chain.timing import plan_time
from rso_lidar.detector.questions import closed_form, description
from rso_lidar.detector.questions.array_load import ArrayLoad, simulate_array_load
from rso_lidar.detector.questions.closed_form import LaserPulse, Prediction
from rso_lidar.detector.settings.empirical import Empirical
from rso_lidar.detector.settings.gsfl import Gsfl
from rso_lidar.detector.settings.traits import DetectorTraits
from rso_lidar.detector.stages.array_effects import draw_shift_m
from rso_lidar.errors import ScenarioError
from rso_lidar.part import Seam
from rso_lidar.records import Photons, Reading, Taps, Waveforms

_MOST_STEPS = 2**14  # of time in one trace, and ...
_MOST_GATED = 2**27  # ... in all pixels under a gate: half a gigabyte


@runtime_checkable
class Detector(Protocol):
    """A detector that a user brings as a Python object.

    Parameters
    ----------
    traits : what the scenario must know of it.
    """

    traits: DetectorTraits

    def detect(self, photons: Photons, rng: np.random.Generator) -> tuple[Reading, Waveforms | None]:
        """Return what the sensor says of one flash, and the samples it stored, None where it has none.

        Parameters
        ----------
        photons : light on every pixel.
        rng : generator of all noise.
        """
        ...


DescribedDetector = Annotated[Gsfl | Empirical, Field(discriminator="type")]
AnyDetector = Annotated[Gsfl | Empirical | Detector, Seam(DescribedDetector, Detector)]


def detect(
    photons: Photons, detector: Gsfl | Empirical | Detector, rng: np.random.Generator, threads: int | None = 1
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
    What the sensor says, and the samples that it stored to say so (None: it has no waveforms).
    """
    if isinstance(detector, Gsfl):
        return run_chain(detector, photons, rng, threads=threads)[:2]
    if isinstance(detector, Empirical):
        return detect_by_curves(detector, photons, rng), None
    return detector.detect(photons, rng)


def detect_with_taps(
    photons: Photons, detector: Gsfl | Empirical | Detector, rng: np.random.Generator, threads: int | None = 1
) -> tuple[Reading, Waveforms | None, Taps | None]:
    """Detect the light of one flash, and also return the signals between the stages, None where they are not simulated.

    Reading and waveforms are those of `detect`.

    Parameters
    ----------
    photons : light on every pixel.
    detector : a part, or an object that may have a method of this name.
    rng : generator of all noise.
    threads : number of threads (None: one for each core). The result is the same to the bit.
    """
    if isinstance(detector, Gsfl):
        return run_chain(detector, photons, rng, with_taps=True, threads=threads)
    method = getattr(detector, "detect_with_taps", None)
    if method is None:
        return *detect(photons, detector, rng), None
    found: tuple[Reading, Waveforms | None, Taps | None] = method(photons, rng)
    return found


def check_size(detector: Gsfl | Empirical | Detector, pulse_fwhm_s: float, n_pixels: int) -> None:
    """Refuse a detector whose simulation would not fit into memory.

    Parameters
    ----------
    detector : the detector.
    pulse_fwhm_s : length of the laser's pulse [s].
    n_pixels : pixels of the array.

    Raises
    ------
    ScenarioError : where the axis of time is too long.
    """
    if not isinstance(detector, Gsfl):
        _call(detector, "check_size", pulse_fwhm_s, n_pixels)
        return
    plan = plan_time(detector, pulse_fwhm_s)
    steps = plan.before + plan.watched + plan.after
    if steps > _MOST_STEPS:
        raise ScenarioError(
            f"a pulse of {pulse_fwhm_s / units.NS:.3g} ns, samples of {detector.readout.sample_ns:.3g} "
            f"ns and {detector.amplifier.bandwidth_mhz:.3g} MHz need {steps:.3g} steps of time for each pixel, "
            f"over {_MOST_STEPS:,}; bring laser.pulse_fwhm_ns, detector.readout and detector.amplifier nearer"
        )
    if detector.gate is not None:
        stored = detector.gate.n_samples(detector.readout.sample_s) * plan.steps_per_sample
        if stored * n_pixels > _MOST_GATED:
            most_ns = _MOST_GATED / n_pixels * plan.step_s / units.NS
            raise ScenarioError(
                f"detector.gate.width_ns: {detector.gate.width_ns:g} in {n_pixels:,} pixels is more than can be "
                f"stored; take up to {most_ns:.0f}, or fewer pixels"
            )


# ------------------------------------------------------------------------------------------------------- in words


def describe(detector: Gsfl | Empirical | Detector, n_pixels: int) -> list[str]:
    """Describe a detector of `n_pixels` pixels in some lines; the last one says when it looks."""
    if isinstance(detector, Gsfl):
        return description.describe_gsfl(detector, n_pixels)
    if isinstance(detector, Empirical):
        return description.describe_empirical(detector)
    traits = detector.traits
    line = f"detector    {type(detector).__name__}, sees {traits.sees_from_m:g} to {traits.sees_to_m:g} m"
    return list(_call(detector, "describe", n_pixels, default=[line]))


def advise(detector: Gsfl | Empirical | Detector, pulse_fwhm_s: float) -> list[str]:
    """List what is allowed and doubtful about a detector with a pulse of this length [s]; by default nothing."""
    if isinstance(detector, Gsfl):
        return description.advise_gsfl(detector, pulse_fwhm_s)
    return list(_call(detector, "advise", pulse_fwhm_s, default=[]))


def describe_storage(detector: Gsfl | Empirical | Detector) -> list[str]:
    """Describe what limits the choice among several returns of a pixel: nothing, or how little is stored of it."""
    if isinstance(detector, Gsfl):
        return description.describe_storage(detector)
    return list(_call(detector, "describe_storage", default=[]))


def describe_window(detector: Gsfl | Empirical | Detector) -> str:
    """Describe in a few words when a detector looks."""
    if isinstance(detector, Gsfl):
        return description.describe_window_gsfl(detector)
    traits = detector.traits
    return str(_call(detector, "describe_window", default=f"armed {traits.sees_from_m:g} to {traits.sees_to_m:g} m"))


def list_neglected_effects(detector: Gsfl | Empirical | Detector) -> list[str]:
    """List the settings of a detector that its closed form does not count; by default none."""
    if isinstance(detector, Gsfl):
        return description.list_neglected_gsfl(detector)
    return list(_call(detector, "list_neglected_effects", default=[]))


# ---------------------------------------------------------------------------------------------------- closed forms


def false_alarm_probability(detector: Gsfl | Empirical | Detector, range_m: np.ndarray) -> np.ndarray:
    """Return the probability (range) that noise in the dark is reported before light from there comes; by default 0."""
    if isinstance(detector, Gsfl) and detector.gate is not None:
        return np.full(np.shape(range_m), detector.gate.false_alarm_probability)
    if not isinstance(detector, Gsfl | Empirical):
        return np.asarray(_call(detector, "false_alarm_probability", range_m, default=np.zeros(np.shape(range_m))))
    rate = mean_false_alarms_per_s(detector) if isinstance(detector, Gsfl) else detector.false_alarms_per_s
    armed_m = np.clip(range_m, detector.armed_from_m, detector.armed_to_m) - detector.armed_from_m
    before: np.ndarray = -np.expm1(-rate * armed_m / units.RANGE_PER_DELAY_M_S)
    return before


def detection_probability(detector: Gsfl | Empirical | Detector, photons: np.ndarray) -> np.ndarray | None:
    """Return the probability (return) of detection by expected photons; None where only a trial can find it."""
    if isinstance(detector, Gsfl):
        return None
    found = _call(detector, "detection_probability", photons, default=None)
    return None if found is None else np.asarray(found)


def predict_closed_form(
    detector: Gsfl | Empirical | Detector,
    pulse: LaserPulse,
    photons: np.ndarray,
    depth_s: np.ndarray,
    *,
    only_probability: bool = False,
) -> Prediction | None:
    """Predict what a detector reports of returns; None where only a trial tells.

    Parameters
    ----------
    detector : the detector.
    pulse : the laser's pulse.
    photons, depth_s : (return) expected photons, and the time over which a surface stretches them [s].
    only_probability : the other members of the prediction are not needed.
    """
    photons, depth_s = (np.asarray(values, dtype=float) for values in np.broadcast_arrays(photons, depth_s))
    if isinstance(detector, Gsfl):
        return closed_form.predict_gsfl(detector, pulse, photons, depth_s, only_probability=only_probability)
    if isinstance(detector, Empirical):
        return closed_form.predict_empirical(detector, pulse, photons)
    found: Prediction | None = _call(detector, "predict_closed_form", pulse, photons, depth_s, default=None)
    return found


def noise_growth(detector: Gsfl | Empirical | Detector, background_photons_per_s: float) -> float:
    """Return the rms noise under sunlight over that in the dark; by default 1.

    Parameters
    ----------
    detector : the detector.
    background_photons_per_s : sunlight on a pixel [photons/s].
    """
    if isinstance(detector, Gsfl):
        dark = detector.noise_electrons
        return detector.noise_in_light(background_photons_per_s) / dark if dark > 0.0 else float("inf")
    return float(_call(detector, "noise_growth", background_photons_per_s, default=1.0))


# ------------------------------------------------------------------------------------------ a pixel and its array


def isolate(detector: Gsfl | Empirical | Detector, gain: float = 1.0) -> Gsfl | Empirical | Detector:
    """Return a detector whose pixels do nothing to each other; its APDs have `gain` times their gain at rest."""
    if isinstance(detector, Gsfl):
        return detector.alone(gain)
    apart: Detector = _call(detector, "isolate", gain, default=detector)
    return apart


def array_load(detector: Gsfl | Empirical | Detector, photons: Photons) -> ArrayLoad:
    """Simulate what the pixels of one flash do to each other; by default nothing."""
    if isinstance(detector, Gsfl):
        return simulate_array_load(detector, photons)
    n_pixels = photons.shape[0] * photons.shape[1]
    load: ArrayLoad = _call(detector, "array_load", photons, default=ArrayLoad(np.ones(n_pixels), np.zeros(n_pixels)))
    return load


def draw_crosstalk_m(
    detector: Gsfl | Empirical | Detector, together_fraction: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """Draw the range error [m] of pixels from others that latch with them; by default none.

    Parameters
    ----------
    detector : the detector.
    together_fraction : (pixel) share of the array that latches with each.
    rng : generator of the errors.
    """
    none = np.zeros(np.shape(together_fraction))
    if isinstance(detector, Gsfl):
        if detector.crosstalk is None or detector.gate is not None:
            return none
        return draw_shift_m(detector.crosstalk, together_fraction, rng)
    return np.asarray(_call(detector, "draw_crosstalk_m", together_fraction, rng, default=none))


def frame_jitter_s(detector: Gsfl | Empirical | Detector) -> float:
    """Return the jitter that all pixels of a frame share [s, 1 sigma]; by default none."""
    if isinstance(detector, Gsfl):
        return detector.frame_jitter_s
    return float(_call(detector, "frame_jitter_s", default=0.0))


def _call(detector: object, name: str, *given: Any, default: Any = None) -> Any:
    """Call a method that a detector may have, or return the default where it has none of that name."""
    method = getattr(detector, name, None)
    return default if method is None else method(*given)

"""The interface of all detectors: the functions by which the package uses a detector of any kind.

`Gsfl`, `Empirical` and `GeigerArray` are data. A Python user may give an object that follows the protocol `Detector` in
their place, as ``lidar.detector``. Every function here takes either: `build_detector` makes a `BuiltDetector` of it, a class
for each kind, whose members are these functions.

- `detect` makes a reading of the light of one flash; `detect_with_taps` also returns the signals between the stages.
- ``detector.traits`` holds the facts: reach, threshold, number of returns, gate, settings in force (`DetectorTraits`).
  A gated detector has ``with_gate_delay(delay_ns)`` as well.
- `check_noise`, `check_size`, `check_maps`, `describe`, `advise`, `describe_window`, `describe_storage` and
  `list_neglected_effects` serve the checks and the texts of a scenario.
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

from typing import Annotated

import numpy as np
from pydantic import Field

from rso_lidar.detector.analysis.array_load import ArrayLoad
from rso_lidar.detector.analysis.built_detector import BuiltDetector
from rso_lidar.detector.analysis.closed_form import Prediction
from rso_lidar.detector.analysis.empirical_detector import BuiltEmpirical
from rso_lidar.detector.analysis.gsfl_detector import BuiltGsfl
from rso_lidar.detector.analysis.user_detector import BuiltUserDetector, Detector
from rso_lidar.detector.geiger.array import GeigerArray
from rso_lidar.detector.geiger.photon_counter import BuiltGeigerArray
from rso_lidar.detector.ranging.pulse import LaserPulse
from rso_lidar.detector.settings.empirical import Empirical
from rso_lidar.detector.settings.gsfl import Gsfl
from rso_lidar.part import Seam
from rso_lidar.records import Labels, Photons, Reading, Taps, Waveforms

DescribedDetector = Annotated[Gsfl | Empirical | GeigerArray, Field(discriminator="type")]
AnyDetector = Annotated[Gsfl | Empirical | GeigerArray | Detector, Seam(DescribedDetector, Detector)]


def build_detector(detector: AnyDetector) -> BuiltDetector:
    """Return a part, or an object of a user, as the package uses it."""
    match detector:
        case Gsfl():
            return BuiltGsfl(detector)
        case Empirical():
            return BuiltEmpirical(detector)
        case GeigerArray():
            return BuiltGeigerArray(detector)
    return BuiltUserDetector(detector)


def detect(
    photons: Photons, detector: AnyDetector, rng: np.random.Generator, threads: int | None = 1
) -> tuple[Reading, Waveforms | None]:
    """Detect the light of one flash.

    Parameters
    ----------
    photons : light on every pixel
    detector : a part, or an object with the same method
    rng : generator of all noise
    threads : number of threads (None: one for each core). The result is the same to the bit

    Returns
    -------
    reading, and the stored samples; None for a detector without waveforms.
    """
    return build_detector(detector).detect(photons, rng, threads)


def detect_with_taps(
    photons: Photons, detector: AnyDetector, rng: np.random.Generator, threads: int | None = 1
) -> tuple[Reading, Waveforms | None, Taps | None]:
    """Return the reading of one flash, its waveforms and the signals between the stages; None for what is not simulated.

    Reading and waveforms are those of `detect`.

    Parameters
    ----------
    photons : light on every pixel
    detector : a part, or an object that may have a method of this name
    rng : generator of all noise
    threads : number of threads (None: one for each core). The result is the same to the bit
    """
    return build_detector(detector).detect_with_taps(photons, rng, threads)


def label_flags(detector: AnyDetector, labels: Labels, photons: Photons, reading: Reading) -> Labels:
    """Return labels with what is true of the flags of a reading; unchanged for a detector that does not flag its returns.

    Parameters
    ----------
    detector : the detector
    labels : of the flash
    photons : light on every pixel
    reading : what the detector made of it

    Returns
    -------
    Labels
        With `crosstalk`, `saturated` and `superimposed`, where the reading has flags.
    """
    return build_detector(detector).label_flags(labels, photons, reading)


def check_noise(detector: AnyDetector) -> None:
    """Refuse a detector whose pixels noise alone would trigger; by default none is.

    Parameters
    ----------
    detector : the detector; `ScenarioError` where its threshold is too low
    """
    build_detector(detector).check_noise()


def check_size(detector: AnyDetector, pulse_fwhm_s: float, n_pixels: int) -> None:
    """Refuse a detector whose simulation would not fit into memory.

    Parameters
    ----------
    detector : the detector; `ScenarioError` where its axis of time is too long
    pulse_fwhm_s : length of the laser's pulse [s]
    n_pixels : pixels of the array
    """
    build_detector(detector).check_size(pulse_fwhm_s, n_pixels)


def check_maps(detector: AnyDetector, shape: tuple[int, int]) -> None:
    """Read the measured maps of a detector and refuse those of another array; by default there are none.

    Parameters
    ----------
    detector : the detector; `ScenarioError` where its maps cannot be read, or have another shape
    shape : rows and columns of the array
    """
    build_detector(detector).check_maps(shape)


def describe(detector: AnyDetector, n_pixels: int) -> list[str]:
    """Return a description of a detector in some lines; the last one states when it looks.

    Parameters
    ----------
    detector : the detector
    n_pixels : number of pixels of the array
    """
    return build_detector(detector).describe(n_pixels)


def advise(detector: AnyDetector, pulse_fwhm_s: float) -> list[str]:
    """Return what is allowed but doubtful about a detector, a line each; by default nothing.

    Parameters
    ----------
    detector : the detector
    pulse_fwhm_s : length of the laser's pulse [s]
    """
    return build_detector(detector).advise(pulse_fwhm_s)


def describe_storage(detector: AnyDetector) -> list[str]:
    """Return what limits the choice among several returns of a pixel, a line each; by default nothing.

    Parameters
    ----------
    detector : the detector
    """
    return build_detector(detector).describe_storage()


def describe_window(detector: AnyDetector) -> str:
    """Return in a few words when a detector looks.

    Parameters
    ----------
    detector : the detector
    """
    return build_detector(detector).describe_window()


def list_neglected_effects(detector: AnyDetector) -> list[str]:
    """Return the settings that the closed form of a detector neglects; by default none.

    Parameters
    ----------
    detector : the detector
    """
    return build_detector(detector).list_neglected_effects()


def false_alarm_probability(detector: AnyDetector, range_m: np.ndarray) -> np.ndarray:
    """Return the probability that noise in the dark is reported before light from a range arrives; by default 0.

    Parameters
    ----------
    detector : the detector
    range_m : (range) [m]
    """
    return build_detector(detector).false_alarm_probability(range_m)


def detection_probability(detector: AnyDetector, photons: np.ndarray) -> np.ndarray | None:
    """Return the probability (return) of detection; None for a detector without a closed form.

    Parameters
    ----------
    detector : the detector
    photons : (return) expected photons
    """
    return build_detector(detector).detection_probability(photons)


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
    photons, depth_s : (return) expected photons, and the time over which a surface stretches them [s]
    only_probability : whether the other members of the prediction are not needed
    """
    photons, depth_s = (np.asarray(values, dtype=float) for values in np.broadcast_arrays(photons, depth_s))
    return build_detector(detector).predict_closed_form(pulse, photons, depth_s, only_probability)


def report_probability(
    detector: AnyDetector, photons: Photons, mine: np.ndarray, flashes: int = 1
) -> np.ndarray | None:
    """Return the probability (pixel) that a pixel reports one of some returns of a flash; None without a closed form.

    Parameters
    ----------
    detector : the detector
    photons : light on every pixel
    mine : (return) whether a report of this return counts
    flashes : number of flashes whose pixels `photons` lists one flash after another; the same pixels see each of them
    """
    built = build_detector(detector)
    return built.report_probability(photons, mine) if flashes == 1 else built.report_flashes(photons, mine, flashes)


def noise_growth(detector: AnyDetector, background_photons_per_s: float) -> float:
    """Return the rms noise under sunlight over that in the dark, infinite without noise in the dark; by default 1.

    Parameters
    ----------
    detector : the detector
    background_photons_per_s : sunlight on a pixel [photons/s]
    """
    return build_detector(detector).noise_growth(background_photons_per_s)


def isolate(detector: AnyDetector, gain: float = 1.0) -> AnyDetector:
    """Return a detector whose pixels do not affect each other.

    Parameters
    ----------
    detector : the detector
    gain : gain of its APDs over their gain at rest
    """
    apart: AnyDetector = build_detector(detector).isolate(gain)
    return apart


def array_load(detector: AnyDetector, photons: Photons) -> ArrayLoad:
    """Return how the pixels of one flash affect each other, by simulation; by default not at all.

    Parameters
    ----------
    detector : the detector
    photons : light on every pixel
    """
    return build_detector(detector).array_load(photons)


def draw_crosstalk_m(detector: AnyDetector, together_fraction: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return random range errors (pixel) [m] from other pixels that latch with each; by default none.

    Parameters
    ----------
    detector : the detector
    together_fraction : (pixel) share of the array that latches with each
    rng : generator of the errors
    """
    return build_detector(detector).draw_crosstalk_m(together_fraction, rng)


def frame_jitter_s(detector: AnyDetector) -> float:
    """Return the jitter that all pixels of a frame share [s, 1 sigma]; by default none.

    Parameters
    ----------
    detector : the detector
    """
    return build_detector(detector).frame_jitter_s()

"""What the package asks of a detector of any kind, and the answers of a detector without the effect asked about."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Protocol

import numpy as np

from rso_lidar.detector.analysis.array_load import ArrayLoad
from rso_lidar.detector.analysis.closed_form import Prediction
from rso_lidar.detector.ranging.pulse import LaserPulse
from rso_lidar.records import Labels, Photons, Reading, Taps, Waveforms


class BuiltDetector(Protocol):
    """A detector as the package uses it: one class for each kind, whose members are the functions of this room.

    A kind overrides what it has, and inherits the answers of a detector without the effect.
    """

    part: Any

    def detect(
        self, photons: Photons, rng: np.random.Generator, threads: int | None
    ) -> tuple[Reading, Waveforms | None]:
        """Detect the light of one flash.

        Parameters
        ----------
        photons : light on every pixel
        rng : generator of all noise
        threads : number of threads (None: one for each core)
        """
        ...

    def detect_with_taps(
        self, photons: Photons, rng: np.random.Generator, threads: int | None
    ) -> tuple[Reading, Waveforms | None, Taps | None]:
        """Detect, and also return the signals between the stages, None where they are not simulated."""
        return *self.detect(photons, rng, threads), None

    def label_flags(self, labels: Labels, photons: Photons, reading: Reading) -> Labels:
        """Return labels with the true flags of the reported returns, where the detector flags them."""
        return labels

    def check_noise(self) -> None:
        """Refuse a detector whose pixels noise alone would trigger."""
        return

    def check_size(self, pulse_fwhm_s: float, n_pixels: int) -> None:
        """Refuse a detector whose simulation would not fit into memory."""
        return

    def check_maps(self, shape: tuple[int, int]) -> None:
        """Refuse measured maps of another array than one of these rows and columns."""
        return

    def describe(self, n_pixels: int) -> list[str]:
        """Return a description in some lines; the last one states when it looks."""
        traits = self.part.traits
        return [f"detector    {type(self.part).__name__}, sees {traits.sees_from_m:g} to {traits.sees_to_m:g} m"]

    def advise(self, pulse_fwhm_s: float) -> list[str]:
        """Return what is allowed but doubtful, a line each."""
        return []

    def describe_storage(self) -> list[str]:
        """Return what limits the choice among several returns of a pixel, a line each."""
        return []

    def describe_window(self) -> str:
        """Return in a few words when the detector looks."""
        traits = self.part.traits
        return f"armed {traits.sees_from_m:g} to {traits.sees_to_m:g} m"

    def list_neglected_effects(self) -> list[str]:
        """Return the settings that the closed form neglects."""
        return []

    def false_alarm_probability(self, range_m: np.ndarray) -> np.ndarray:
        """Return the probability (range) that noise in the dark is reported before light from a range arrives."""
        return np.zeros(np.shape(range_m))

    def detection_probability(self, photons: np.ndarray) -> np.ndarray | None:
        """Return the probability (return) of detection; None without a closed form."""
        return None

    def predict_closed_form(
        self, pulse: LaserPulse, photons: np.ndarray, depth_s: np.ndarray, only_probability: bool
    ) -> Prediction | None:
        """Return the prediction of what is reported of returns; None without a closed form.

        Parameters
        ----------
        photons, depth_s : (return) expected photons, and the time over which a surface stretches them [s]
        only_probability : whether the other members of the prediction are not needed
        """
        return None

    def report_probability(self, photons: Photons, mine: np.ndarray) -> np.ndarray | None:
        """Return the probability (pixel) that a pixel reports one of some returns; None without a closed form."""
        return None

    def report_flashes(self, photons: Photons, mine: np.ndarray, flashes: int) -> np.ndarray | None:
        """Return the probability (pixel) of a report in each of several flashes on the same pixels.

        Parameters
        ----------
        photons : light on the pixels of one flash after another
        """
        n = photons.shape[0] * photons.shape[1] // flashes
        listed = [self.report_probability(*_cut_flash(photons, mine, k * n, (k + 1) * n)) for k in range(flashes)]
        known = [probability for probability in listed if probability is not None]
        return np.concatenate(known) if len(known) == flashes else None

    def noise_growth(self, background_photons_per_s: float) -> float:
        """Return the rms noise under sunlight [photons/s] over that in the dark."""
        return 1.0

    def isolate(self, gain: float) -> Any:
        """Return the part of a detector whose pixels do not affect each other, with APDs of this gain over rest."""
        return self.part

    def array_load(self, photons: Photons) -> ArrayLoad:
        """Return how the pixels of one flash affect each other."""
        n_pixels = photons.shape[0] * photons.shape[1]
        return ArrayLoad(np.ones(n_pixels), np.zeros(n_pixels))

    def draw_crosstalk_m(self, together_fraction: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Return random range errors (pixel) [m] from other pixels that latch with each."""
        return np.zeros(np.shape(together_fraction))

    def frame_jitter_s(self) -> float:
        """Return the jitter that all pixels of a frame share [s, 1 sigma]."""
        return 0.0


def _cut_flash(photons: Photons, mine: np.ndarray, begin: int, end: int) -> tuple[Photons, np.ndarray]:
    """Return the light of the pixels from `begin` up to `end`, and which of its returns count."""
    own = (photons.pixel >= begin) & (photons.pixel < end)
    first, last = np.searchsorted(photons.cluster_pixel, [begin, end])
    maps: dict[str, Any] = {
        name: None if (values := getattr(photons, name)) is None else values.ravel()[None, begin:end]
        for name in ("filled_fraction", "background_photons_per_s", "photons_variance")
    }
    fields: dict[str, Any] = maps | {
        name: getattr(photons, name)[own] for name in ("delay_s", "photons", "depth_spread_s", "coherence_cells", "hit")
    }
    cut = replace(
        photons,
        shape=(1, end - begin),
        pixel=photons.pixel[own] - begin,
        cluster=photons.cluster[own] - first,
        cluster_pixel=photons.cluster_pixel[first:last] - begin,
        epoch=None if photons.epoch is None else photons.epoch[own],
        **fields,
    )
    return cut, mine[own]


def describe_gate(length_m: float) -> str:
    """Describe in a few words a gate of this length [m]."""
    length = f"{length_m:.3g}" if length_m < 999.5 else f"{length_m:.0f}"  # 1200, not 1.2e+03
    return f"a gate of {length} m about the target"

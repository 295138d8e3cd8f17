"""The full chain as the package uses it: readings, texts, limits and closed forms."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rso_lidar import units
from rso_lidar.detector.analysis.array_load import ArrayLoad, simulate_array_load
from rso_lidar.detector.analysis.built_detector import BuiltDetector, describe_gate
from rso_lidar.detector.analysis.closed_form import Prediction, predict_gsfl
from rso_lidar.detector.analysis.false_alarms import false_trigger_fraction, nominal_false_alarms_per_s
from rso_lidar.detector.analysis.pixel_reports import report_probability_gsfl
from rso_lidar.detector.analysis.preset_constants import is_of_preset
from rso_lidar.detector.chain.camera import camera_of
from rso_lidar.detector.chain.full import run_chain
from rso_lidar.detector.chain.report_flags import label_flags
from rso_lidar.detector.chain.timing import plan_time
from rso_lidar.detector.ranging.pulse import LaserPulse
from rso_lidar.detector.settings.gsfl import Gsfl
from rso_lidar.detector.settings.presets import SOLVED_CONSTANTS
from rso_lidar.detector.stages.array_effects import draw_shift_m
from rso_lidar.detector.stages.pixel_maps import read_pixel_maps
from rso_lidar.errors import ScenarioError
from rso_lidar.records import Labels, Photons, Reading, Taps, Waveforms

_MOST_FALSE_REPORTS = 0.005  # of all pixels: 80 false triggers in a frame begin to hide a distant target
_MOST_FALSE_TRIGGERS = 1.0  # by noise while a pixel is armed: most flashes would see nothing else
_SLOPE_SCALE_V = 45.0  # a of M = a/(V_b - V): 40 to 50 V for most InGaAs APDs (data sheet C30645, C30662) ...
_SLOPE_WITHIN = 0.125  # ... so the slope M/a is known to an eighth
_MOST_STEPS = 2**14  # of time in one trace, and ...
_MOST_GATED = 2**27  # ... in all pixels under a gate: half a gigabyte
_OPTIONAL = (
    "maps",
    "defects",
    "saturation",
    "bloom",
    "droop",
    "crosstalk",
    "amplitude_crosstalk",
    "speckle",
)  # parts of a focal plane, off by default


@dataclass(frozen=True)
class BuiltGsfl(BuiltDetector):
    """The full chain."""

    part: Gsfl

    def detect(self, photons: Photons, rng: np.random.Generator, threads: int | None) -> tuple[Reading, Waveforms]:
        """Run the chain."""
        return run_chain(camera_of(self.part, photons), photons, rng, threads=threads)[:2]

    def detect_with_taps(
        self, photons: Photons, rng: np.random.Generator, threads: int | None
    ) -> tuple[Reading, Waveforms, Taps | None]:
        """Run the chain and keep the signals between the stages."""
        return run_chain(camera_of(self.part, photons), photons, rng, with_taps=True, threads=threads)

    def label_flags(self, labels: Labels, photons: Photons, reading: Reading) -> Labels:
        """Return labels with the true flags of the reported returns, where they are flagged."""
        gsfl, camera = self.part, camera_of(self.part, photons)
        if camera.processor.flagger is None:
            return labels
        rail = gsfl.saturation.rail_electrons if gsfl.saturation is not None else math.inf
        return label_flags(
            camera.processor.flagger,
            labels,
            photons,
            reading,
            electrons_per_photon=gsfl.electrons_per_photon,
            clip_electrons=gsfl.clip_electrons,
            rail_electrons=rail,
        )

    def check_noise(self) -> None:
        """Refuse a chain whose nominal pixel noise alone would trigger more than once while it is armed."""
        gsfl = self.part
        if gsfl.gate is not None:
            return
        rate = nominal_false_alarms_per_s(gsfl)
        false = rate * (gsfl.armed_to_m - gsfl.armed_from_m) / units.RANGE_PER_DELAY_M_S
        if false > _MOST_FALSE_TRIGGERS:
            raise ScenarioError(
                f"detector.trigger.threshold_electrons: {gsfl.trigger.threshold_electrons:g} is "
                f"{gsfl.threshold_over_noise:.2g} times the noise ({gsfl.noise_electrons:.0f} electrons): noise alone would "
                f"trigger a nominal pixel {rate:,.0f} times a second, {false:.3g} times while it is armed; raise the "
                "threshold, lower the noise, the dark current or the gain, or arm a shorter window (detector.armed_to_m)"
            )

    def check_size(self, pulse_fwhm_s: float, n_pixels: int) -> None:
        """Refuse a chain whose axis of time, or whose gate, would not fit into memory."""
        gsfl = self.part
        plan = plan_time(gsfl, pulse_fwhm_s)
        steps = plan.before + plan.watched + plan.after
        if steps > _MOST_STEPS:
            raise ScenarioError(
                f"a pulse of {pulse_fwhm_s / units.NS:.3g} ns, samples of {gsfl.readout.sample_ns:.3g} "
                f"ns and {gsfl.amplifier.bandwidth_mhz:.3g} MHz need {steps:.3g} steps of time for each pixel, "
                f"over {_MOST_STEPS:,}; bring laser.pulse_fwhm_ns, detector.readout and detector.amplifier nearer"
            )
        if gsfl.gate is not None:
            stored = gsfl.gate.n_samples(gsfl.readout.sample_s) * plan.steps_per_sample
            if stored * n_pixels > _MOST_GATED:
                most_ns = _MOST_GATED / n_pixels * plan.step_s / units.NS
                raise ScenarioError(
                    f"detector.gate.width_ns: {gsfl.gate.width_ns:g} in {n_pixels:,} pixels is more than can be "
                    f"stored; take up to {most_ns:.0f}, or fewer pixels"
                )

    def check_maps(self, shape: tuple[int, int]) -> None:
        """Read the measured maps, if a file of them is named, and refuse those of an array of another shape."""
        maps = self.part.maps
        if maps is None or maps.file is None:
            return
        measured = read_pixel_maps(maps.file).shape
        if measured != shape:
            raise ScenarioError(
                f"detector.maps.file: {maps.file}: is of {measured[0]} x {measured[1]} pixels, and the receiver has "
                f"{shape[0]} x {shape[1]}; set receiver.n_rows and n_cols, or take maps of this array"
            )

    def describe(self, n_pixels: int) -> list[str]:
        """Describe the chain in a few lines; the last one states when its pixels look."""
        gsfl = self.part
        apd, amplifier, readout = gsfl.apd, gsfl.amplifier, gsfl.readout
        of_preset = any(is_of_preset(gsfl, part, key) for part, key in SOLVED_CONSTANTS)
        kind = f"gsfl {gsfl.preset}" if of_preset else "gsfl, own constants"
        lines = [
            f"detector    {kind}: QE {gsfl.quantum_efficiency:.4g}, gain {apd.gain:g} (F "
            f"{apd.excess_noise_factor:.2f}), dark {apd.dark_current_na:g} nA, amplifier {amplifier.bandwidth_mhz:.4g} MHz "
            f"and {amplifier.noise_electrons:.0f} electrons, {readout.samples} samples of {readout.sample_ns:g} ns, "
            f"{gsfl.ranging.algorithm}"
        ]
        parts = [name for name in _OPTIONAL if getattr(gsfl, name) is not None]
        if readout.low_gain is not None:
            parts.append(f"two gains, {readout.low_gain.ratio:g} : 1, up to {gsfl.saturation_photons:,.0f} photons")
        if gsfl.zero_crossing is not None:
            parts.append(
                f"zero crossing of a bipolar pulse, armed at {gsfl.zero_crossing.arming_electrons:.0f} electrons"
            )
        if gsfl.returns != "first" or gsfl.max_returns > 1:
            parts.append(f"returns: {gsfl.returns} of up to {gsfl.max_returns}")
        if parts:
            lines.append(f"  with      {', '.join(parts)}")
        if gsfl.report is not None:
            lines.append(gsfl.report.describe())
        if gsfl.gate is not None:
            gate = gsfl.gate
            return [
                *lines,
                f"  gate      {gate.from_m:.1f} to {gate.to_m:.1f} m, {gate.pulses} pulse{'s' * (gate.pulses > 1)} a frame, "
                f"false alarms {gate.false_alarm_probability:g} a pixel and frame",
            ]
        false = float(self.false_alarm_probability(np.array(gsfl.armed_to_m))) * n_pixels
        return [
            *lines,
            f"  trigger   {gsfl.trigger.threshold_electrons:.0f} electrons, "
            f"{gsfl.threshold_over_noise:.1f} times the noise; "
            f"armed {gsfl.armed_from_m:g} to {gsfl.armed_to_m:g} m, {false:.2g} false triggers a frame",
        ]

    def advise(self, pulse_fwhm_s: float) -> list[str]:
        """List what is allowed and doubtful with a pulse of this length [s]."""
        gsfl = self.part
        lines = []
        low, rail = gsfl.readout.low_gain, gsfl.saturation
        if low is not None and rail is not None:
            reached = rail.rail_electrons / gsfl.readout.electrons_per_count
            if reached < gsfl.readout.full_scale_counts - gsfl.readout.baseline_counts:
                lines.append(
                    f"the amplifier clips at {rail.rail_electrons:.0f} electrons, before the first channel does, and the "
                    "second is never needed; raise lidar.detector.saturation.rail_electrons or leave out readout.low_gain"
                )
        slope_gain = None if gsfl.droop is None else gsfl.droop.slope_gain
        if gsfl.droop is not None and slope_gain is not None and abs(gsfl.apd.gain / slope_gain - 1.0) > _SLOPE_WITHIN:
            lines.append(
                f"the slope of the gain {gsfl.droop.gain_slope_per_v:g} / V belongs to a gain of {slope_gain:g}, not of "
                f"{gsfl.apd.gain:g}; set lidar.detector.droop.gain_slope_per_v to {gsfl.apd.gain / _SLOPE_SCALE_V:.2g} "
                f"(gain / {_SLOPE_SCALE_V:g} V), or lidar.detector.apd.gain to {slope_gain:g}"
            )
        if gsfl.report is not None and gsfl.report.intensity_to_counts < gsfl.full_scale_counts:
            lines.append(
                f"intensities are reported up to {gsfl.report.intensity_to_counts:g} counts and measured up to "
                f"{gsfl.full_scale_counts}; raise lidar.detector.report.intensity_quantum_counts or intensity_bits"
            )
        if gsfl.gate is not None:
            return lines
        share = float(self.false_alarm_probability(np.array(gsfl.armed_to_m)))
        if share > _MOST_FALSE_REPORTS:
            lines.append(
                f"noise triggers {share:.1%} of the pixels in every frame before they could see a target (threshold "
                f"{gsfl.threshold_over_noise:.2g} times the noise); raise lidar.detector.trigger.threshold_electrons, "
                "or arm a shorter window"
            )
        stored_ns = (gsfl.readout.samples - gsfl.readout.pretrigger_samples) * gsfl.readout.sample_ns
        pulse_ns = pulse_fwhm_s / units.NS
        if stored_ns < 1.5 * pulse_ns:
            lines.append(
                f"a pulse of {pulse_ns:.3g} ns is longer than what is stored of it, {stored_ns:.3g} ns behind the latch; "
                "store more lidar.detector.readout.samples, or shorten the pulse"
            )
        if gsfl.readout.sample_ns > pulse_ns:
            lines.append(
                f"samples {gsfl.readout.sample_ns:.3g} ns apart miss a pulse of {pulse_ns:.3g} ns; shorten "
                "lidar.detector.readout.sample_ns"
            )
        return lines

    def describe_storage(self) -> list[str]:
        """Describe, for a detector that triggers itself, how little it stores behind a latch."""
        gsfl = self.part
        if gsfl.gate is not None:
            return []
        return [
            f"a pixel that triggers itself stores {gsfl.window_m:.1f} m about the first crossing, "
            f"{gsfl.stored_behind_m:.1f} m of them behind it: the strongest, last or further returns are chosen inside "
            "that only; use lidar.detector.gate to see deeper, or fewer lidar.detector.readout.pretrigger_samples"
        ]

    def describe_window(self) -> str:
        """Describe in a few words when the pixels look."""
        gsfl = self.part
        if gsfl.gate is not None:
            return describe_gate(gsfl.gate.to_m - gsfl.gate.from_m)
        return f"armed {gsfl.sees_from_m:g} to {gsfl.sees_to_m:g} m"

    def list_neglected_effects(self) -> list[str]:
        """List the settings that the closed form does not count."""
        gsfl = self.part
        dropped = [name for name in _OPTIONAL if getattr(gsfl, name) is not None]
        if gsfl.zero_crossing is not None:
            dropped.append("zero_crossing (precision is the matched filter's)")
        if gsfl.ranging.algorithm != "matched_filter":
            dropped.append(f"{gsfl.ranging.algorithm} (precision is the matched filter's)")
        return dropped

    def false_alarm_probability(self, range_m: np.ndarray) -> np.ndarray:
        """Return the probability (range) of a false alarm before light from there comes."""
        gsfl = self.part
        if gsfl.gate is not None:
            return np.full(np.shape(range_m), gsfl.gate.false_alarm_probability)
        armed_m = np.clip(range_m, gsfl.armed_from_m, gsfl.armed_to_m) - gsfl.armed_from_m
        return false_trigger_fraction(gsfl, armed_m / units.RANGE_PER_DELAY_M_S)

    def predict_closed_form(
        self, pulse: LaserPulse, photons: np.ndarray, depth_s: np.ndarray, only_probability: bool
    ) -> Prediction:
        """Predict what the chain reports of returns."""
        return predict_gsfl(self.part, pulse, photons, depth_s, only_probability)

    def report_probability(self, photons: Photons, mine: np.ndarray) -> np.ndarray | None:
        """Return the probability (pixel) of a report of some returns; None where the closed form neglects a setting."""
        return self.report_flashes(photons, mine, 1)

    def report_flashes(self, photons: Photons, mine: np.ndarray, flashes: int) -> np.ndarray | None:
        """Return the probability (pixel) of a report in each of several flashes on the same pixels."""
        algorithm = self.part.ranging.algorithm
        neglected = [name for name in self.list_neglected_effects() if not name.startswith(algorithm)]
        return None if neglected else report_probability_gsfl(self.part, photons, mine, flashes)

    def noise_growth(self, background_photons_per_s: float) -> float:
        """Return the rms noise under sunlight [photons/s] over that in the dark."""
        dark = self.part.noise_electrons
        return self.part.noise_in_light(background_photons_per_s) / dark if dark > 0.0 else float("inf")

    def isolate(self, gain: float) -> Gsfl:
        """Return the settings without coupling between pixels."""
        return self.part.alone(gain)

    def array_load(self, photons: Photons) -> ArrayLoad:
        """Simulate what the pixels of one flash do to each other."""
        return simulate_array_load(self.part, photons)

    def draw_crosstalk_m(self, together_fraction: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Draw range errors (pixel) [m]; zero without crosstalk, or behind a gate."""
        if self.part.crosstalk is None or self.part.gate is not None:
            return np.zeros(np.shape(together_fraction))
        return draw_shift_m(self.part.crosstalk, together_fraction, rng)

    def frame_jitter_s(self) -> float:
        """Return the jitter of a whole frame [s, 1 sigma]."""
        return self.part.frame_jitter_s

"""The shipped detectors in words: their settings in some lines, what is doubtful about them, what a budget leaves out."""

from __future__ import annotations

import numpy as np

from rso_lidar import units
from rso_lidar.detector.analysis.noise_effects import false_alarms_of_gsfl
from rso_lidar.detector.settings.empirical import Empirical
from rso_lidar.detector.settings.gsfl import Gsfl

_MOST_FALSE = 0.005  # of all pixels: 80 false triggers in a frame begin to hide a distant target
_OPTIONAL = (
    "maps",
    "defects",
    "saturation",
    "bloom",
    "droop",
    "crosstalk",
    "speckle",
)  # parts of a focal plane, off by default


def describe_empirical(detector: Empirical) -> list[str]:
    """Describe the empirical detector in one line."""
    return [
        f"detector    empirical, 95 % at {detector.reference_photons:g} photons, "
        f"armed {detector.armed_from_m:g} to {detector.armed_to_m:g} m"
    ]


def describe_gsfl(gsfl: Gsfl, n_pixels: int) -> list[str]:
    """Describe the full chain in a few lines; the last one states when its `n_pixels` pixels look."""
    apd, amplifier, readout = gsfl.apd, gsfl.amplifier, gsfl.readout
    lines = [
        f"detector    gsfl {gsfl.preset}: QE {gsfl.quantum_efficiency:g}, gain {apd.gain:g} (F "
        f"{apd.excess_noise_factor:.2f}), dark {apd.dark_current_na:g} nA, amplifier {amplifier.bandwidth_mhz:g} MHz and "
        f"{amplifier.noise_electrons:.0f} electrons, {readout.samples} samples of {readout.sample_ns:g} ns, "
        f"{gsfl.ranging.algorithm}"
    ]
    parts = [name for name in _OPTIONAL if getattr(gsfl, name) is not None]
    if readout.low_gain is not None:
        parts.append(f"two gains, {readout.low_gain.ratio:g} : 1, up to {gsfl.saturation_photons:,.0f} photons")
    if gsfl.zero_crossing is not None:
        parts.append(f"zero crossing of a bipolar pulse, armed at {gsfl.zero_crossing.arming_electrons:.0f} electrons")
    if gsfl.returns != "first" or gsfl.max_returns > 1:
        parts.append(f"returns: {gsfl.returns} of up to {gsfl.max_returns}")
    if parts:
        lines.append(f"  with      {', '.join(parts)}")
    if gsfl.gate is not None:
        gate = gsfl.gate
        return [
            *lines,
            f"  gate      {gate.from_m:.1f} to {gate.to_m:.1f} m, {gate.pulses} pulse{'s' * (gate.pulses > 1)} a frame, "
            f"false alarms {gate.false_alarm_probability:g} a pixel and frame",
        ]
    false = float(false_alarms_of_gsfl(gsfl, np.array(gsfl.armed_to_m))) * n_pixels
    return [
        *lines,
        f"  trigger   {gsfl.trigger.threshold_electrons:.0f} electrons, "
        f"{gsfl.threshold_over_noise:.1f} times the noise; "
        f"armed {gsfl.armed_from_m:g} to {gsfl.armed_to_m:g} m, {false:.2g} false triggers a frame",
    ]


def advise_gsfl(gsfl: Gsfl, pulse_fwhm_s: float) -> list[str]:
    """List what is allowed and doubtful about the full chain with a pulse of this length [s]."""
    lines = []
    low, rail = gsfl.readout.low_gain, gsfl.saturation
    if low is not None and rail is not None:
        reached = rail.rail_electrons / gsfl.readout.electrons_per_count
        if reached < gsfl.readout.full_scale_counts - gsfl.readout.baseline_counts:
            lines.append(
                f"the amplifier clips at {rail.rail_electrons:.0f} electrons, before the first channel does, and the second "
                "is never needed; raise lidar.detector.saturation.rail_electrons or leave out readout.low_gain"
            )
    if gsfl.gate is not None:
        return lines
    share = float(false_alarms_of_gsfl(gsfl, np.array(gsfl.armed_to_m)))
    if share > _MOST_FALSE:
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


def describe_storage(gsfl: Gsfl) -> list[str]:
    """Describe, for a detector that triggers itself, how little it stores behind a latch."""
    if gsfl.gate is not None:
        return []
    return [
        f"a pixel that triggers itself stores {gsfl.window_m:.1f} m about the first crossing, "
        f"{gsfl.stored_behind_m:.1f} m of them behind it: the strongest, last or further returns are chosen inside "
        "that only; use lidar.detector.gate to see deeper, or fewer lidar.detector.readout.pretrigger_samples"
    ]


def describe_gate(length_m: float) -> str:
    """Describe in a few words a gate of this length [m]."""
    length = f"{length_m:.3g}" if length_m < 999.5 else f"{length_m:.0f}"  # 1200, not 1.2e+03
    return f"a gate of {length} m about the target"


def describe_window_gsfl(gsfl: Gsfl) -> str:
    """Describe in a few words when the pixels look."""
    if gsfl.gate is not None:
        return describe_gate(gsfl.gate.to_m - gsfl.gate.from_m)
    return f"armed {gsfl.sees_from_m:g} to {gsfl.sees_to_m:g} m"


def list_neglected_gsfl(gsfl: Gsfl) -> list[str]:
    """List the settings of the full chain that its closed form does not count."""
    dropped = [name for name in _OPTIONAL if getattr(gsfl, name) is not None]
    if gsfl.zero_crossing is not None:
        dropped.append("zero_crossing (precision is the matched filter's)")
    if gsfl.ranging.algorithm != "matched_filter":
        dropped.append(f"{gsfl.ranging.algorithm} (precision is the matched filter's)")
    return dropped

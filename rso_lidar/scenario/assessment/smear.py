"""How far the scene moves during a frame: the smear of frames that collect the light of several pulses."""

from __future__ import annotations

import numpy as np

from rso_lidar import motion, units
from rso_lidar.errors import suppress_warnings
from rso_lidar.scenario.mission.exposure import MOST_EPOCHS, Smear
from rso_lidar.scenario.mission.mission import Mission
from rso_lidar.scenario.preview.geometry import Preview

_RATE_S = 5e-4  # half the interval over which rates of a demand are taken: those of an ideal drive
_SMEARED = 1.0  # pixel, or length of the pulse, from which a warning is given


def measure_smear(mission: Mission, preview: Preview) -> Smear:
    """Measure how far the targets move, as the lidar sees them, in a frame at each epoch of a preview (time).

    Parameters
    ----------
    mission : whose frames have several pulses that are sent one after another
    """
    assert mission.exposure is not None
    poses = preview.truth.poses
    if mission.pan_tilt is not None and preview.pointing_lag_rad is None:  # then the preview has no rates of the PTU
        with suppress_warnings():
            asked = [
                motion.compute_demand(
                    mission.pan_tilt,
                    mission.bodies,
                    motion.truth(mission.bodies, preview.epochs.shift(late_s), **mission.world.motion_arguments),
                )
                for late_s in (0.0, _RATE_S)
            ]
        turned = np.remainder(asked[1] - asked[0] + np.pi, 2.0 * np.pi) - np.pi
        poses = motion.add_lidar(poses, mission.pan_tilt, asked[0], turned / _RATE_S, mission.lidar.mount)
    lidars = [mission.instrument.at(float(time_s)) for time_s in preview.time_s]
    smear = Smear(*np.zeros((3, len(lidars))))
    for receiver in {lidar.receiver for lidar in lidars}:
        of = np.array([lidar.receiver == receiver for lidar in lidars])
        lidar = lidars[int(np.argmax(of))]
        for moved, measurement in zip(smear, mission.exposure.measure(poses, lidar), strict=True):
            moved[of] = np.broadcast_to(measurement, moved.shape)[of]
    return smear


def describe_exposure(mission: Mission, preview: Preview) -> list[str]:
    """Describe the pulses of a frame and how far the targets move between the first and the last; nothing for one pulse.

    Parameters
    ----------
    mission : as for `measure_smear`
    """
    pulses = mission.lidar.detector.traits.pulses
    if pulses == 1:
        return []
    if mission.exposure is None:
        return [
            f"  exposure  {pulses} pulses, all sent at the frame's time: nothing moves between them (pulse_rate_hz)"
        ]
    smear = measure_smear(mission, preview)
    text = ", ".join(
        f"{float(moved.max()) / unit:.3g} {name}"
        for moved, unit, name in (
            (smear.pixels, 1.0, "pixels across"),
            (smear.depth_m, units.MM, "mm along the line of sight"),
            (smear.turn_rad, units.DEG, "° about it"),
        )
    )
    count = mission.exposure.count_epochs(smear, mission.instrument)
    return [
        f"  exposure  {pulses} pulses at {mission.lidar.laser.pulse_rate_hz:g} Hz, "
        f"{mission.exposure.length_s:.3g} s a frame, in which targets move at most {text}; "
        f"cast at {'up to ' * (count > 1)}{count} epoch{'s' * (count > 1)}"
    ]


def advise_on_exposure(mission: Mission, preview: Preview) -> list[str]:
    """Warn of pulses that see the scene in different places, or whose light comes when the next one has been sent."""
    rate_hz, traits = mission.lidar.laser.pulse_rate_hz, mission.lidar.detector.traits
    if rate_hz is None:
        return []
    if mission.exposure is None:
        return ["lidar.laser.pulse_rate_hz is not used: the detector takes one pulse a frame; leave it out"]
    lines = []
    unambiguous_m = units.RANGE_PER_DELAY_M_S / rate_hz
    if traits.sees_to_m > unambiguous_m:
        lines.append(
            f"lidar.laser.pulse_rate_hz: light from beyond {unambiguous_m:.4g} m comes after the next pulse, and the "
            f"detector looks to {traits.sees_to_m:.4g} m; it is given the right range, which a real camera would not know"
        )
    smear = measure_smear(mission, preview)
    lidar = mission.instrument
    pulse_m = lidar.laser.pulse_fwhm_s * units.RANGE_PER_DELAY_M_S
    for moved, unit, words in (
        (smear.pixels, 1.0, "pixels across the line of sight"),
        (smear.depth_m / pulse_m, 1.0 / pulse_m, "m along the line of sight"),
    ):
        at = int(np.argmax(moved))
        if moved[at] > _SMEARED:
            lines.append(
                f"targets move up to {moved[at] / unit:.3g} {words} between the first and the last pulse of a frame, "
                f"at {preview.time_s[at]:g} s; raise lidar.laser.pulse_rate_hz, or lower the pulses of the detector"
            )
    wanted = mission.exposure.count_wanted(smear, lidar)
    if wanted > MOST_EPOCHS < mission.exposure.pulses:
        lines.append(
            f"the {mission.exposure.pulses} pulses of a frame are cast at {MOST_EPOCHS} epochs, and {wanted:.0f} would be "
            "needed to show the motion without steps; raise lidar.laser.pulse_rate_hz, or lower the pulses of the detector"
        )
    return lines

"""Whether an instrument can be simulated: its files can be read, and a pixel's trace is not too long."""

from rso_lidar import units
from rso_lidar.detector import Gsfl
from rso_lidar.errors import ScenarioError
from rso_lidar.optics import read_files
from rso_lidar.scenario.tables.lidar import Lidar

_MOST_STEPS = 2**14  # of time in one trace, and ...
_MOST_GATED = 2**27  # ... in all pixels under a gate: half a gigabyte


def check_instrument(lidar: Lidar) -> None:
    """Read all files of an instrument, which must have been found, and refuse too long a trace."""
    lenses = {lidar.receiver}
    if lidar.schedule is not None and lidar.schedule.focal_length_mm is not None:
        ends = min(lidar.schedule.focal_length_mm), max(lidar.schedule.focal_length_mm)
        lenses |= {lidar.with_settings({"focal_length_mm": end}).receiver for end in ends}
    for receiver in lenses:
        read_files(lidar.laser, receiver)
    if not isinstance(lidar.detector, Gsfl):
        return
    plan = lidar.detector.plan(lidar.laser.pulse_fwhm_s)
    steps = plan.before + plan.watched + plan.after
    if steps > _MOST_STEPS:
        raise ScenarioError(
            f"a pulse of {lidar.laser.pulse_fwhm_s / units.NS:.3g} ns, samples of {lidar.detector.readout.sample_ns:.3g} "
            f"ns and {lidar.detector.amplifier.bandwidth_mhz:.3g} MHz need {steps:.3g} steps of time for each pixel, "
            f"over {_MOST_STEPS:,}; bring laser.pulse_fwhm_ns, detector.readout and detector.amplifier nearer"
        )
    if lidar.detector.gate is not None:
        n_pixels = lidar.receiver.n_rows * lidar.receiver.n_cols
        stored = lidar.detector.gate.n_samples(lidar.detector.readout.sample_s) * plan.steps_per_sample
        if stored * n_pixels > _MOST_GATED:
            most_ns = _MOST_GATED / n_pixels * plan.step_s / units.NS
            raise ScenarioError(
                f"detector.gate.width_ns: {lidar.detector.gate.width_ns:g} in {n_pixels:,} pixels is more than can be "
                f"stored; take up to {most_ns:.0f}, or fewer pixels"
            )

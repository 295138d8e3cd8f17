"""The camera: all that follows from a detector's settings, the laser's pulse and the number of pixels, worked out once."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache, partial

import numpy as np

from rso_lidar import units
from rso_lidar.detector.chain.analog import FrontEnd
from rso_lidar.detector.chain.measurement import RangeProcessor
from rso_lidar.detector.chain.report_flags import Flagger
from rso_lidar.detector.chain.timing import TimeAxis, build_axis, plan_time
from rso_lidar.detector.ranging.bipolar_pulse import crossing_lead_s
from rso_lidar.detector.ranging.gate_threshold import GateThresholds
from rso_lidar.detector.ranging.location import Locator
from rso_lidar.detector.ranging.pulse import LaserPulse, Pulse
from rso_lidar.detector.ranging.range_walk import tabulate_walk
from rso_lidar.detector.settings.focal_plane import Bloom
from rso_lidar.detector.settings.gate import Gate
from rso_lidar.detector.settings.gsfl import Gsfl
from rso_lidar.detector.settings.readout import Readout
from rso_lidar.detector.settings.zero_crossing import ZeroCrossing
from rso_lidar.detector.stages.avalanche import build_avalanche
from rso_lidar.detector.stages.false_triggers import Comparators, build_comparators
from rso_lidar.detector.stages.nonuniformity import CameraPixels, draw_pixels
from rso_lidar.detector.stages.pixel_maps import stamp_maps
from rso_lidar.detector.stages.time_axis import SamplingPlan
from rso_lidar.records import Photons


@dataclass(frozen=True, eq=False)
class FlashCamera:
    """A full detector as it looks at flashes of one pulse; None for what is off. Each stage takes one piece of it."""

    front: FrontEnd
    comparators: Comparators
    processor: RangeProcessor
    readout: Readout
    gate: Gate | None
    bloom: Bloom | None
    zero_crossing: ZeroCrossing | None
    pulse: Pulse  # of one return, behind the amplifier
    electrons_per_photon: float
    threshold_photons: float
    plan: Callable[[float], SamplingPlan]  # of time, by how long before its delay a return can latch [s]
    axis: Callable[[int], TimeAxis]  # by the number of steps of a row, kept

    def select(self, pixel: np.ndarray) -> FlashCamera:
        """Return a camera of some of the pixels, or of the same ones several times."""
        pieces = self.front.select(pixel), self.comparators.select(pixel), self.processor.select(pixel)
        return replace(self, front=pieces[0], comparators=pieces[1], processor=pieces[2])


def camera_of(gsfl: Gsfl, photons: Photons) -> FlashCamera:
    """Return the camera that meets the light of a flash."""
    return build_camera(gsfl, LaserPulse.of(photons), photons.shape[0] * photons.shape[1])


def build_camera(gsfl: Gsfl, pulse: LaserPulse, n_pixels: int) -> FlashCamera:
    """Build the camera of a detector for a pulse, or return the one that was built before.

    Cameras whose gates differ by their delay alone share all the rest, because a plan or a controller moves the gate from
    frame to frame.
    """
    if pulse.power_per_s.flags.writeable:  # what is kept must not change with a caller's array
        pulse = pulse._replace(power_per_s=pulse.power_per_s.copy())
    stamp = None if gsfl.maps is None or gsfl.maps.file is None else stamp_maps(gsfl.maps.file)
    if gsfl.gate is None:
        return _build(gsfl, pulse, n_pixels, stamp)
    at_rest = gsfl.replace(gate=gsfl.gate.replace(delay_ns=0.0))
    return replace(_build(at_rest, pulse, n_pixels, stamp), gate=gsfl.gate)


@lru_cache(maxsize=8)  # a camera of 512 x 512 pixels has 15 MB of maps
def _build(gsfl: Gsfl, pulse: LaserPulse, n_pixels: int, _maps: tuple[str, int, int] | None) -> FlashCamera:
    """Build a camera, kept until its file of maps changes: the only place where frames share what settings determine."""
    amplifier, window_m = gsfl.amplifier, (gsfl.armed_from_m, gsfl.armed_to_m)
    pixels = draw_camera_pixels(gsfl, n_pixels)
    from_s, to_s = (range_m / units.RANGE_PER_DELAY_M_S for range_m in window_m)
    shape = Pulse.after(pulse.step_s, pulse.power_per_s, amplifier.pole_s, amplifier.integration_s)

    plan = partial(plan_time, gsfl, pulse.fwhm_s)
    return FlashCamera(
        front=FrontEnd(
            pixels=pixels,
            quantum_efficiency=gsfl.quantum_efficiency,
            avalanche=build_avalanche(gsfl.apd),
            speckle=gsfl.speckle,
            droop=gsfl.droop,
            saturation=gsfl.saturation,
            amplitude_crosstalk=gsfl.amplitude_crosstalk,
            has_gain_map=gsfl.maps is not None,
            has_timing_channel=gsfl.zero_crossing is not None,
        ),
        comparators=build_comparators(gsfl.apd, amplifier, gsfl.trigger, pixels, from_s, to_s),
        processor=_build_processor(gsfl, pixels, shape),
        readout=gsfl.readout,
        gate=gsfl.gate,
        bloom=gsfl.bloom,
        zero_crossing=gsfl.zero_crossing,
        pulse=shape,
        electrons_per_photon=gsfl.electrons_per_photon,
        threshold_photons=gsfl.traits.threshold_photons,
        plan=plan,
        axis=lru_cache(maxsize=16)(partial(build_axis, gsfl, pulse, plan().step_s)),
    )


def _build_processor(gsfl: Gsfl, pixels: CameraPixels, pulse: Pulse) -> RangeProcessor:
    """Build the digital end of a camera."""
    readout, saturation, maps = gsfl.readout, gsfl.saturation, gsfl.maps
    locator = Locator.of(
        pulse,
        gsfl.ranging,
        sample_s=readout.sample_s,
        sigma_counts=gsfl.noise_counts,
        pole_s=gsfl.amplifier.pole_s,
        threshold_counts=gsfl.trigger.threshold_electrons / readout.electrons_per_count,
        recovery_s=0.0 if saturation is None else saturation.recovery_ns * units.NS,
    )
    walk = None
    if gsfl.ranging.walk_correction:  # calibrated without saturation
        walk = tabulate_walk(replace(locator, recovery_s=0.0), int(readout.clip_counts))
    gate_thresholds = None
    if gsfl.gate is not None:
        offset_counts = maps.offset_spread_counts * maps.unknown_fraction if maps else 0.0
        gate_thresholds = GateThresholds(gsfl.gate, gsfl.apd, gsfl.amplifier, readout, locator.matched, offset_counts)
    flashes = math.sqrt(gsfl.gate.pulses if gsfl.gate else 1)  # each jitters independently
    timed = gsfl.zero_crossing
    return RangeProcessor(
        pixels=pixels,
        readout=readout,
        locator=locator,
        pixel_jitter_s=gsfl.timing.pixel_jitter_ns * units.NS / flashes,
        frame_jitter_s=gsfl.frame_jitter_s,
        rail_counts=None if saturation is None else saturation.rail_electrons / readout.electrons_per_count,
        unknown_fraction=maps.unknown_fraction if maps is not None else 1.0,
        walk=walk,
        crossing_lead_s=None if timed is None else crossing_lead_s(pulse, timed.differentiator_s),
        crosstalk=None if gsfl.gate else gsfl.crosstalk,
        gate_thresholds=gate_thresholds,
        returns=gsfl.returns,
        max_returns=gsfl.max_returns,
        full_scale_counts=gsfl.full_scale_counts,
        flagger=Flagger(locator, gsfl.amplitude_crosstalk) if gsfl.has_flags else None,
    )


def draw_camera_pixels(gsfl: Gsfl, n_pixels: int) -> CameraPixels:
    """Draw the pixels of this detector's camera."""
    spread = gsfl.trigger.threshold_spread_fraction
    return draw_pixels(n_pixels, gsfl.camera_seed, gsfl.apd, spread, gsfl.maps, gsfl.defects)

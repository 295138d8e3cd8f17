"""Photons in, counts out."""

from rso_lidar.detector.analysis.array_load import ArrayLoad
from rso_lidar.detector.analysis.closed_form import Prediction
from rso_lidar.detector.analysis.user_detector import Detector, check_traits
from rso_lidar.detector.bench.pixel_prediction import predict_pixels
from rso_lidar.detector.bench.prediction import find_photons, predict
from rso_lidar.detector.bench.walk_curve import WalkCurve, simulate_walk_curve
from rso_lidar.detector.detect import (
    AnyDetector,
    DescribedDetector,
    advise,
    array_load,
    check_noise,
    check_size,
    describe,
    describe_storage,
    describe_window,
    detect,
    detect_with_taps,
    detection_probability,
    draw_crosstalk_m,
    false_alarm_probability,
    frame_jitter_s,
    isolate,
    list_neglected_effects,
    noise_growth,
    report_probability,
)
from rso_lidar.detector.geiger.array import GeigerArray
from rso_lidar.detector.ranging.pulse import LaserPulse
from rso_lidar.detector.settings.algorithm import Ranging
from rso_lidar.detector.settings.amplifier import Amplifier
from rso_lidar.detector.settings.apd import Apd
from rso_lidar.detector.settings.empirical import Empirical
from rso_lidar.detector.settings.focal_plane import Bloom, Crosstalk, Defects, Droop, Maps, Saturation, Speckle, Timing
from rso_lidar.detector.settings.gate import Gate
from rso_lidar.detector.settings.gsfl import Gsfl
from rso_lidar.detector.settings.readout import LowGain, Readout
from rso_lidar.detector.settings.traits import DetectorTraits
from rso_lidar.detector.settings.trigger import Trigger
from rso_lidar.detector.settings.zero_crossing import ZeroCrossing
from rso_lidar.public_names import limit_dir

__all__ = [
    "Amplifier",
    "AnyDetector",
    "Apd",
    "ArrayLoad",
    "Bloom",
    "Crosstalk",
    "Defects",
    "DescribedDetector",
    "Detector",
    "DetectorTraits",
    "Droop",
    "Empirical",
    "Gate",
    "GeigerArray",
    "Gsfl",
    "LaserPulse",
    "LowGain",
    "Maps",
    "Prediction",
    "Ranging",
    "Readout",
    "Saturation",
    "Speckle",
    "Timing",
    "Trigger",
    "WalkCurve",
    "ZeroCrossing",
    "advise",
    "array_load",
    "check_noise",
    "check_size",
    "check_traits",
    "describe",
    "describe_storage",
    "describe_window",
    "detect",
    "detect_with_taps",
    "detection_probability",
    "draw_crosstalk_m",
    "false_alarm_probability",
    "find_photons",
    "frame_jitter_s",
    "isolate",
    "list_neglected_effects",
    "noise_growth",
    "predict",
    "predict_pixels",
    "report_probability",
    "simulate_walk_curve",
]

__dir__ = limit_dir(__name__)

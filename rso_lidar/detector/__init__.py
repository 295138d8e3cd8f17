"""Photons in, counts out."""

from rso_lidar.detector.amplifier import Amplifier
from rso_lidar.detector.apd import Apd
from rso_lidar.detector.closed_form import LaserPulse, Prediction
from rso_lidar.detector.detect import (
    AnyDetector,
    DescribedDetector,
    Detector,
    advise,
    array_load,
    check_size,
    describe,
    describe_storage,
    describe_window,
    detect,
    detection_probability,
    draw_crosstalk_m,
    false_alarm_probability,
    frame_jitter_s,
    isolate,
    list_uncounted,
    noise_growth,
)
from rso_lidar.detector.empirical import Empirical
from rso_lidar.detector.focal_plane import Crosstalk, Defects, Droop, Maps, Saturation, Speckle, Timing
from rso_lidar.detector.gate import Gate
from rso_lidar.detector.gsfl import Gsfl
from rso_lidar.detector.load import ArrayLoad
from rso_lidar.detector.prediction import predict
from rso_lidar.detector.ranging import Ranging
from rso_lidar.detector.readout import Readout
from rso_lidar.detector.traits import DetectorTraits
from rso_lidar.detector.trigger import Trigger

__all__ = [
    "Amplifier",
    "AnyDetector",
    "Apd",
    "ArrayLoad",
    "Crosstalk",
    "Defects",
    "DescribedDetector",
    "Detector",
    "DetectorTraits",
    "Droop",
    "Empirical",
    "Gate",
    "Gsfl",
    "LaserPulse",
    "Maps",
    "Prediction",
    "Ranging",
    "Readout",
    "Saturation",
    "Speckle",
    "Timing",
    "Trigger",
    "advise",
    "array_load",
    "check_size",
    "describe",
    "describe_storage",
    "describe_window",
    "detect",
    "detection_probability",
    "draw_crosstalk_m",
    "false_alarm_probability",
    "frame_jitter_s",
    "isolate",
    "list_uncounted",
    "noise_growth",
    "predict",
]

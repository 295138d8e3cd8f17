"""Photons in, counts out."""

from typing import TYPE_CHECKING

from rso_lidar.public_names import export_lazily, limit_dir

if TYPE_CHECKING:
    from rso_lidar.detector.analysis.array_load import ArrayLoad
    from rso_lidar.detector.analysis.closed_form import Prediction
    from rso_lidar.detector.analysis.finding import at_least, estimate_k_of_n, k_of_n
    from rso_lidar.detector.analysis.preset_constants import describe_foreign_constants, list_assumed_settings
    from rso_lidar.detector.analysis.reported_light import mark_reports
    from rso_lidar.detector.analysis.threshold import solve_threshold
    from rso_lidar.detector.analysis.user_detector import Detector, check_traits
    from rso_lidar.detector.bench.camera_figures import CameraFigure, list_camera_figures
    from rso_lidar.detector.bench.light_curve import (
        DetectionPhotons,
        LightCurve,
        estimate_detection_photons,
        place_plate_m,
        simulate_light_curve,
    )
    from rso_lidar.detector.bench.long_traces import simulate_long_traces
    from rso_lidar.detector.bench.pixel_prediction import predict_pixels
    from rso_lidar.detector.bench.prediction import find_photons, find_saturation_photons, predict
    from rso_lidar.detector.bench.range_resolution import SIGNAL_OVER_THRESHOLD, simulate_separations
    from rso_lidar.detector.bench.trial import Surroundings, Trial, make_plate, make_point_returns, run_trial
    from rso_lidar.detector.bench.walk_curve import WalkCurve, simulate_walk_curve
    from rso_lidar.detector.curve_fit.constant_fit import ConstantFit, FittedConstant, FittedCurve, fit_constants
    from rso_lidar.detector.curve_fit.free_constants import get_constant
    from rso_lidar.detector.curve_fit.map_fit import FittedMap, MapFit, MapGroup, fit_maps
    from rso_lidar.detector.curve_fit.map_settings import set_maps
    from rso_lidar.detector.curve_fit.measured_curve import (
        CURVE_QUANTITIES,
        WAVEFORM_QUANTITIES,
        CurveQuantity,
        MeasuredCurve,
    )
    from rso_lidar.detector.curve_fit.measured_map import MapQuantity, MeasuredMap, PixelConstant
    from rso_lidar.detector.curve_fit.waveform_shots import MeanPulse, ShotList, merge_points, reduce_shots, shape_pulse
    from rso_lidar.detector.detection import (
        AnyDetector,
        DescribedDetector,
        advise,
        array_load,
        check_maps,
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
        label_flags,
        list_neglected_effects,
        noise_growth,
        report_probability,
    )
    from rso_lidar.detector.geiger.array import GeigerArray
    from rso_lidar.detector.ranging.pulse import LaserPulse, Pulse
    from rso_lidar.detector.settings.algorithm import Ranging
    from rso_lidar.detector.settings.amplifier import Amplifier
    from rso_lidar.detector.settings.apd import Apd
    from rso_lidar.detector.settings.data_sheet import DataSheet
    from rso_lidar.detector.settings.empirical import Empirical
    from rso_lidar.detector.settings.focal_plane import (
        AmplitudeCrosstalk,
        Bloom,
        Crosstalk,
        Defects,
        Droop,
        Maps,
        Saturation,
        Speckle,
        Timing,
    )
    from rso_lidar.detector.settings.gate import Gate
    from rso_lidar.detector.settings.gsfl import Gsfl, list_determined
    from rso_lidar.detector.settings.presets import DETECTOR_PRESETS, SOLVED_CONSTANTS
    from rso_lidar.detector.settings.readout import LowGain, Readout
    from rso_lidar.detector.settings.report import ReportWords
    from rso_lidar.detector.settings.threshold_condition import ThresholdCondition
    from rso_lidar.detector.settings.traits import DetectorTraits
    from rso_lidar.detector.settings.trigger import Trigger
    from rso_lidar.detector.settings.zero_crossing import ZeroCrossing
    from rso_lidar.detector.stages.avalanche import multiply_rows
    from rso_lidar.detector.stages.pixel_maps import MAPS_SUFFIX, PixelMaps, read_pixel_maps
else:
    __getattr__ = export_lazily(__name__)

__all__ = [
    "CURVE_QUANTITIES",
    "DETECTOR_PRESETS",
    "MAPS_SUFFIX",
    "SIGNAL_OVER_THRESHOLD",
    "SOLVED_CONSTANTS",
    "WAVEFORM_QUANTITIES",
    "Amplifier",
    "AmplitudeCrosstalk",
    "AnyDetector",
    "Apd",
    "ArrayLoad",
    "Bloom",
    "CameraFigure",
    "ConstantFit",
    "Crosstalk",
    "CurveQuantity",
    "DataSheet",
    "Defects",
    "DescribedDetector",
    "DetectionPhotons",
    "Detector",
    "DetectorTraits",
    "Droop",
    "Empirical",
    "FittedConstant",
    "FittedCurve",
    "FittedMap",
    "Gate",
    "GeigerArray",
    "Gsfl",
    "LaserPulse",
    "LightCurve",
    "LowGain",
    "MapFit",
    "MapGroup",
    "MapQuantity",
    "Maps",
    "MeanPulse",
    "MeasuredCurve",
    "MeasuredMap",
    "PixelConstant",
    "PixelMaps",
    "Prediction",
    "Pulse",
    "Ranging",
    "Readout",
    "ReportWords",
    "Saturation",
    "ShotList",
    "Speckle",
    "Surroundings",
    "ThresholdCondition",
    "Timing",
    "Trial",
    "Trigger",
    "WalkCurve",
    "ZeroCrossing",
    "advise",
    "array_load",
    "at_least",
    "check_maps",
    "check_noise",
    "check_size",
    "check_traits",
    "describe",
    "describe_foreign_constants",
    "describe_storage",
    "describe_window",
    "detect",
    "detect_with_taps",
    "detection_probability",
    "draw_crosstalk_m",
    "estimate_detection_photons",
    "estimate_k_of_n",
    "false_alarm_probability",
    "find_photons",
    "find_saturation_photons",
    "fit_constants",
    "fit_maps",
    "frame_jitter_s",
    "get_constant",
    "isolate",
    "k_of_n",
    "label_flags",
    "list_assumed_settings",
    "list_camera_figures",
    "list_determined",
    "list_neglected_effects",
    "make_plate",
    "make_point_returns",
    "mark_reports",
    "merge_points",
    "multiply_rows",
    "noise_growth",
    "place_plate_m",
    "predict",
    "predict_pixels",
    "read_pixel_maps",
    "reduce_shots",
    "report_probability",
    "run_trial",
    "set_maps",
    "shape_pulse",
    "simulate_light_curve",
    "simulate_long_traces",
    "simulate_separations",
    "simulate_walk_curve",
    "solve_threshold",
]

__dir__ = limit_dir(__name__)

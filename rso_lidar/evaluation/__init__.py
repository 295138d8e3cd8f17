"""What was measured: recordings compared, converted, tracked and fitted, maps of heights, cameras and their waveforms."""

from typing import TYPE_CHECKING

from rso_lidar.public_names import export_lazily, limit_dir

if TYPE_CHECKING:
    from rso_lidar.evaluation.camera_calibration.camera_fit import CameraFit, fit_camera
    from rso_lidar.evaluation.camera_calibration.curves_file import CurvesFile, CurveTable
    from rso_lidar.evaluation.camera_calibration.fit_report import FIT_REPORT_SUFFIXES, save_fit_report
    from rso_lidar.evaluation.conversion import (
        save,
    )
    from rso_lidar.evaluation.elevation import (
        HAZARD,
        SAFE,
        UNKNOWN,
        ElevationMap,
        MapAgreement,
        build_elevation_map,
        build_true_elevation,
        compare_maps,
        find_hazards,
    )
    from rso_lidar.evaluation.orbit_determination.recorded_fits import (
        RelativeNavigation,
        find_true_relative_state,
        fit_own_orbit,
        fit_relative_orbit,
    )
    from rso_lidar.evaluation.orbit_determination.tracking_data import fit_tracking_data, save_tracking_data
    from rso_lidar.evaluation.raw_waveforms.comparison import WaveformComparison, compare_waveforms
    from rso_lidar.evaluation.raw_waveforms.pixset import read_pixset
    from rso_lidar.evaluation.raw_waveforms.waveform_set import RawWaveforms
    from rso_lidar.evaluation.raw_waveforms.waveform_statistics import WaveformStatistics, measure_waveforms
    from rso_lidar.evaluation.recorded_runs.display import (
        ViewerChoice,
        view,
    )
    from rso_lidar.evaluation.recorded_runs.flown_scenario import (
        load_scenario,
        sample_target,
    )
    from rso_lidar.evaluation.recorded_runs.frame_comparison import (
        FrameDifference,
        compare_frames,
    )
    from rso_lidar.evaluation.track_quality.centroid_wander import MeasuredWander, measure_centroid_wander
    from rso_lidar.evaluation.track_quality.evaluation import (
        Tracking,
        tracking,
    )
else:
    __getattr__ = export_lazily(__name__)

__all__ = [
    "FIT_REPORT_SUFFIXES",
    "HAZARD",
    "SAFE",
    "UNKNOWN",
    "CameraFit",
    "CurveTable",
    "CurvesFile",
    "ElevationMap",
    "FrameDifference",
    "MapAgreement",
    "MeasuredWander",
    "RawWaveforms",
    "RelativeNavigation",
    "Tracking",
    "ViewerChoice",
    "WaveformComparison",
    "WaveformStatistics",
    "build_elevation_map",
    "build_true_elevation",
    "compare_frames",
    "compare_maps",
    "compare_waveforms",
    "find_hazards",
    "find_true_relative_state",
    "fit_camera",
    "fit_own_orbit",
    "fit_relative_orbit",
    "fit_tracking_data",
    "load_scenario",
    "measure_centroid_wander",
    "measure_waveforms",
    "read_pixset",
    "sample_target",
    "save",
    "save_fit_report",
    "save_tracking_data",
    "tracking",
    "view",
]

__dir__ = limit_dir(__name__)

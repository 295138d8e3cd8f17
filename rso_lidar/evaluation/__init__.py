"""What a recording showed: frames compared and converted, quality of tracking, fitted orbits, maps of heights."""

from typing import TYPE_CHECKING

from rso_lidar.public_names import export_lazily, limit_dir

if TYPE_CHECKING:
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
    from rso_lidar.evaluation.recorded_runs.conversion import (
        save,
    )
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
    from rso_lidar.evaluation.track_quality.evaluation import (
        Tracking,
        tracking,
    )
else:
    __getattr__ = export_lazily(__name__)

__all__ = [
    "HAZARD",
    "SAFE",
    "UNKNOWN",
    "ElevationMap",
    "FrameDifference",
    "MapAgreement",
    "RelativeNavigation",
    "Tracking",
    "ViewerChoice",
    "build_elevation_map",
    "build_true_elevation",
    "compare_frames",
    "compare_maps",
    "find_hazards",
    "find_true_relative_state",
    "fit_own_orbit",
    "fit_relative_orbit",
    "load_scenario",
    "sample_target",
    "save",
    "tracking",
    "view",
]

__dir__ = limit_dir(__name__)

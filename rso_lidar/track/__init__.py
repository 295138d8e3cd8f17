"""Reference controllers, which turn observations into commands, and trackers, which turn points into estimates."""

from typing import TYPE_CHECKING

from rso_lidar.public_names import export_lazily, limit_dir

if TYPE_CHECKING:
    from rso_lidar.track.centroid import Fix, locate_centroid, select_target_points
    from rso_lidar.track.controller import Controller, FastController
    from rso_lidar.track.kalman import Track, filter_positions, nis_bounds
    from rso_lidar.track.least_squares.estimated_orbit import EstimatedOrbit
    from rso_lidar.track.least_squares.fit_statistics import FitStatistics
    from rso_lidar.track.least_squares.gated_solution import MEASUREMENT_GATE
    from rso_lidar.track.least_squares.own_state import GnssErrors, OwnOrbitFit, fit_own_state
    from rso_lidar.track.least_squares.relative_prediction import RELATIVE_MODELS, RelativeModel
    from rso_lidar.track.least_squares.relative_state import RelativeOrbitFit, SightBias, fit_relative_state
    from rso_lidar.track.navigation.navigation_estimate import NavigationEstimate, NavigationUpdate
    from rso_lidar.track.navigation.navigation_filter import NavigationFilter
    from rso_lidar.track.navigation.navigator import Navigator
    from rso_lidar.track.pointing import Pointing, find_cluster
    from rso_lidar.track.pose.follow import FEWEST_POSE_POINTS, PoseFollower
    from rso_lidar.track.pose.icp import Alignment, align
    from rso_lidar.track.pose.pose_search import acquire
    from rso_lidar.track.pose.sampled_mesh import MeshHinge, SampledMesh, measure_visible_centroid, sample_mesh
else:
    __getattr__ = export_lazily(__name__)

__all__ = [
    "FEWEST_POSE_POINTS",
    "MEASUREMENT_GATE",
    "RELATIVE_MODELS",
    "Alignment",
    "Controller",
    "EstimatedOrbit",
    "FastController",
    "FitStatistics",
    "Fix",
    "GnssErrors",
    "MeshHinge",
    "NavigationEstimate",
    "NavigationFilter",
    "NavigationUpdate",
    "Navigator",
    "OwnOrbitFit",
    "Pointing",
    "PoseFollower",
    "RelativeModel",
    "RelativeOrbitFit",
    "SampledMesh",
    "SightBias",
    "Track",
    "acquire",
    "align",
    "filter_positions",
    "find_cluster",
    "fit_own_state",
    "fit_relative_state",
    "locate_centroid",
    "measure_visible_centroid",
    "nis_bounds",
    "sample_mesh",
    "select_target_points",
]

__dir__ = limit_dir(__name__)

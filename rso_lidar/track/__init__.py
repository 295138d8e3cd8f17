"""Reference controllers, which turn observations into commands, and trackers, which turn points into estimates."""

from typing import TYPE_CHECKING

from rso_lidar.public_names import export_lazily, limit_dir

if TYPE_CHECKING:
    from rso_lidar.track.centroid import Fix, locate_centroid
    from rso_lidar.track.controller import Controller
    from rso_lidar.track.kalman import Track, filter_positions, nis_bounds
    from rso_lidar.track.least_squares.estimated_orbit import EstimatedOrbit
    from rso_lidar.track.least_squares.fit_statistics import FitStatistics
    from rso_lidar.track.least_squares.own_state import GnssErrors, OwnOrbitFit, fit_own_state
    from rso_lidar.track.least_squares.relative_state import RelativeOrbitFit, SightBias, fit_relative_state
    from rso_lidar.track.navigation.navigation_estimate import NavigationEstimate, NavigationUpdate
    from rso_lidar.track.navigation.navigation_filter import NavigationFilter
    from rso_lidar.track.navigation.navigator import Navigator
    from rso_lidar.track.pointing import Pointing
    from rso_lidar.track.pose.follow import PoseFollower
    from rso_lidar.track.pose.icp import Alignment, align
    from rso_lidar.track.pose.pose_search import acquire
    from rso_lidar.track.pose.sampled_mesh import MeshHinge, SampledMesh, measure_visible_centroid, sample_mesh

__all__ = [
    "Alignment",
    "Controller",
    "EstimatedOrbit",
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
    "RelativeOrbitFit",
    "SampledMesh",
    "SightBias",
    "Track",
    "acquire",
    "align",
    "filter_positions",
    "fit_own_state",
    "fit_relative_state",
    "locate_centroid",
    "measure_visible_centroid",
    "nis_bounds",
    "sample_mesh",
]

__getattr__ = export_lazily(__name__)
__dir__ = limit_dir(__name__)

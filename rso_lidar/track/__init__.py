"""Reference controllers and trackers: an Observation in, a Command out; points in, an estimate out."""

from rso_lidar.track.centroid import Fix, centroid
from rso_lidar.track.controller import Controller
from rso_lidar.track.follow import PoseFollower
from rso_lidar.track.icp import Alignment, Model, acquire, align, sampled, seen_middle
from rso_lidar.track.kalman import Track, kalman, nis_bounds
from rso_lidar.track.pointing import Pointing

__all__ = [
    "Alignment",
    "Controller",
    "Fix",
    "Model",
    "Pointing",
    "PoseFollower",
    "Track",
    "acquire",
    "align",
    "centroid",
    "kalman",
    "nis_bounds",
    "sampled",
    "seen_middle",
]

"""Reference controllers and trackers: an Observation in, a Command or an estimate out."""

from rso_lidar.track.pointing import Pointing

__all__ = ["Pointing"]

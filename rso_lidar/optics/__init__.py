"""Light out, light back: the laser, the receiver, the rays between them and the photons that return."""

from rso_lidar.optics.laser import Laser
from rso_lidar.optics.radiometry import collect
from rso_lidar.optics.rays import pixel_rays
from rso_lidar.optics.receiver import Receiver

__all__ = ["Laser", "Receiver", "collect", "pixel_rays"]

"""The loop: adapters that put a `Simulation` behind an interface of others: environments of Gymnasium, and live views."""

from rso_lidar.loop.live.live_view import LiveView
from rso_lidar.public_names import limit_dir

__all__ = ["LiveView"]

__dir__ = limit_dir(__name__)

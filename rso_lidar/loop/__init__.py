"""The loop: adapters that put a `Simulation` behind an interface of others: a socket, Gymnasium, and live views."""

from rso_lidar.loop.live.live_view import LiveView
from rso_lidar.loop.live.rerun_view import RerunView
from rso_lidar.loop.service import Client, Deadlines, Delivery, FlightRecorder, Security, Server, Session
from rso_lidar.public_names import limit_dir

__all__ = [
    "Client",
    "Deadlines",
    "Delivery",
    "FlightRecorder",
    "LiveView",
    "RerunView",
    "Security",
    "Server",
    "Session",
]

__dir__ = limit_dir(__name__)

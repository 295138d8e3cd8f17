"""The loop: adapters that put a `Simulation` behind an interface of others: a socket, FMUs, Gymnasium, live views."""

from rso_lidar.loop.fmus.fmu_controller import FmuController
from rso_lidar.loop.fmus.fmu_export import write_fmu
from rso_lidar.loop.live.live_view import LiveView
from rso_lidar.loop.live.rerun_view import RerunView
from rso_lidar.loop.service import (
    Client,
    Deadlines,
    Delivery,
    FlightRecorder,
    Security,
    Server,
    Session,
    repeat_flight,
)
from rso_lidar.public_names import limit_dir

__all__ = [
    "Client",
    "Deadlines",
    "Delivery",
    "FlightRecorder",
    "FmuController",
    "LiveView",
    "RerunView",
    "Security",
    "Server",
    "Session",
    "repeat_flight",
    "write_fmu",
]

__dir__ = limit_dir(__name__)

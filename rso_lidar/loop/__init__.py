"""The loop: adapters that put a `Simulation` behind an interface of others: a socket, FMUs, Gymnasium, live views."""

from typing import TYPE_CHECKING

from rso_lidar.public_names import export_lazily, limit_dir

if TYPE_CHECKING:
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

__getattr__ = export_lazily(__name__)
__dir__ = limit_dir(__name__)

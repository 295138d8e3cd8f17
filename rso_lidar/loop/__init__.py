"""The loop: adapters that put a `Simulation` behind an interface of others: a socket, FMUs, Gymnasium, live views."""

from typing import TYPE_CHECKING

from rso_lidar.public_names import export_lazily, limit_dir

if TYPE_CHECKING:
    from rso_lidar.loop.fmus.fmu_controller import (
        FmuController,
    )
    from rso_lidar.loop.fmus.fmu_export import (
        write_fmu,
    )
    from rso_lidar.loop.live.live_view import (
        LiveView,
    )
    from rso_lidar.loop.live.queued_view import (
        QueuedView,
    )
    from rso_lidar.loop.live.rerun_view import (
        RerunView,
    )
    from rso_lidar.loop.network_address import (
        NetworkAddress,
        parse_address,
    )
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
    from rso_lidar.loop.service.endpoints import (
        import_zmq,
        read_token,
    )
else:
    __getattr__ = export_lazily(__name__)

__all__ = [
    "Client",
    "Deadlines",
    "Delivery",
    "FlightRecorder",
    "FmuController",
    "LiveView",
    "NetworkAddress",
    "QueuedView",
    "RerunView",
    "Security",
    "Server",
    "Session",
    "import_zmq",
    "parse_address",
    "read_token",
    "repeat_flight",
    "write_fmu",
]

__dir__ = limit_dir(__name__)

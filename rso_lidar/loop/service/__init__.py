"""A simulation behind a ZeroMQ socket (extra ``loop``), for flight software in a process of its own; and a client of it."""

from rso_lidar.loop.service.client import Client
from rso_lidar.loop.service.command_log import repeat_flight
from rso_lidar.loop.service.deadlines import Deadlines
from rso_lidar.loop.service.endpoints import Security
from rso_lidar.loop.service.flight_recorder import FlightRecorder
from rso_lidar.loop.service.linked_simulation import Delivery, LinkedSimulation
from rso_lidar.loop.service.server import Server
from rso_lidar.loop.service.session import Session
from rso_lidar.public_names import limit_dir

__all__ = [
    "Client",
    "Deadlines",
    "Delivery",
    "FlightRecorder",
    "LinkedSimulation",
    "Security",
    "Server",
    "Session",
    "repeat_flight",
]

__dir__ = limit_dir(__name__)

"""Multipart messages of ZeroMQ."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

# Flags of zmq.h as plain integers, and no options read between parts: pyzmq's own loops over the parts build an enumeration
# member for each, which takes 30 us of each step of a client and its server after a flash.
_DONTWAIT, _SNDMORE = 1, 2


def send_parts(socket: Any, parts: Sequence[Any]) -> None:
    """Send a message, and raise `zmq.Again` where its queue is full."""
    for part in parts[:-1]:
        socket.send(part, _DONTWAIT | _SNDMORE)
    socket.send(parts[-1], _DONTWAIT)


def receive_parts(socket: Any) -> list[Any]:
    """Return the parts of the next message as `zmq.Frame`; raise `zmq.Again` where none comes in time.

    Parameters
    ----------
    socket : of ZeroMQ, with its time limit (``RCVTIMEO``)
    """
    parts = [socket.recv(copy=False)]
    while parts[-1].more:
        parts.append(socket.recv(copy=False))
    return parts

"""Web pages that may watch a live view, told apart by the origin that a browser states (RFC 6455, sec. 10.2).

A page cannot choose or leave out that header. Programs outside a browser state none, or whatever they like.
"""

from __future__ import annotations

import re
from collections.abc import Callable

from rso_lidar.errors import ScenarioError

# Foxglove in a browser; Lichtblick and Foxglove as desktop programs, whose page is a file of theirs
VIEWER_ORIGINS = ("https://app.foxglove.dev", "file://")
_MOST_HEAD_BYTES = 16_384  # of the request that opens a connection
_DEFAULT_PORTS = {"http": ":80", "https": ":443"}  # which browsers leave out


def parse_origin(text: str) -> str:
    """Return an origin as browsers write it.

    Parameters
    ----------
    text : such as ``http://localhost:8080``

    Raises
    ------
    ScenarioError
        If it is no origin.

    >>> parse_origin("HTTP://LocalHost:80")
    'http://localhost'
    """
    match = re.fullmatch(r"([a-z][a-z0-9+.\-]*)://((?:\[[0-9a-f:.]+\]|[a-z0-9.\-]+)(?::(\d{1,5}))?)", text.lower())
    if match is None or int(match[3] or 0) > 65535:
        raise ScenarioError(f"--live-origin {text:.80}: is not an origin; write for example http://localhost:8080")
    scheme, place = match[1], match[2]
    return f"{scheme}://{place.removesuffix(_DEFAULT_PORTS.get(scheme, '/'))}"


class HandshakeCheck:
    """Limits of one connection: the request that opens it is short, and comes from no page that is not accepted.

    Parameters
    ----------
    accepts : returns whether a page of an origin may watch
    """

    refusal = b"HTTP/1.1 403 Forbidden\r\nConnection: close\r\nContent-Length: 0\r\n\r\n"

    def __init__(self, accepts: Callable[[str], bool]) -> None:
        self._accepts = accepts
        self._head: bytearray | None = bytearray()  # until it is complete

    def admits(self, data: memoryview) -> bool:
        """Read the header of the request, and return whether the server may have the next bytes.

        Parameters
        ----------
        data : from the client
        """
        if self._head is None:
            return True
        self._head += data
        end = re.search(rb"\n\r?\n", self._head)
        if (end.start() if end else len(self._head)) > _MOST_HEAD_BYTES:
            return False
        if end is None:
            return True
        fields = [line.partition(b":") for line in self._head[: end.start()].splitlines()]
        self._head = None
        origins = [value.strip() for name, _, value in fields if name.strip().lower() == b"origin"]
        return all(self._accepts(origin.decode("latin-1").lower()) for origin in origins)

    def note_answer(self) -> None:
        """Do nothing: answers change no limit."""

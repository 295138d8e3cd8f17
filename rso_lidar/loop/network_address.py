"""Addresses of servers: host and port of a text, and whether other machines can reach them."""

from __future__ import annotations

import ipaddress
import re
from typing import NamedTuple

from rso_lidar.errors import ScenarioError


class NetworkAddress(NamedTuple):
    """Host, as a numeric address, and port of a server."""

    host: str
    port: int

    @property
    def is_loopback(self) -> bool:
        """Whether only this machine can reach the address."""
        return ipaddress.ip_address(self.host).is_loopback

    @property
    def text(self) -> str:
        """Host and port as one text, with an IPv6 address in brackets."""
        return f"[{self.host}]:{self.port}" if ":" in self.host else f"{self.host}:{self.port}"


def parse_address(text: str, where: str) -> NetworkAddress:
    """Parse ``HOST:PORT``, where the host is a numeric address or ``localhost``.

    Parameters
    ----------
    text : such as ``127.0.0.1:8765`` or ``[::1]:8765``
    where : start of error messages, such as the option

    Returns
    -------
    NetworkAddress
        With ``127.0.0.1`` for ``localhost``.

    Raises
    ------
    ScenarioError
        For another text, and a port above 65535.

    >>> parse_address("localhost:8765", "--live-at").text
    '127.0.0.1:8765'
    """
    match = re.fullmatch(r"\[([^\]]+)\]:(\d+)|([^:\s]+):(\d+)", text.strip())
    if not match:
        raise ScenarioError(f"{where} {text:.80}: is not HOST:PORT; write for example 127.0.0.1:8765")
    host, port = match[1] or match[3], int(match[2] or match[4])
    if port > 65535:
        raise ScenarioError(f"{where} {text:.80}: no port is above 65535; write for example 127.0.0.1:8765")
    try:
        address = ipaddress.ip_address("127.0.0.1" if host == "localhost" else host)
    except ValueError:
        raise ScenarioError(
            f"{where} {text:.80}: the host is no numeric address; write for example 127.0.0.1:8765"
        ) from None
    return NetworkAddress(str(address), port)


def require_loopback(address: NetworkAddress, where: str, what: str) -> None:
    """Refuse an address that other machines can reach, for a server without authentication.

    Raises
    ------
    ScenarioError
        For an address that is not a loopback address.
    """
    if not address.is_loopback:
        raise ScenarioError(
            f"{where} {address.text}: {what} shows everything to whoever connects, so it opens only on this machine; give "
            f"127.0.0.1:{address.port}, and forward it with `ssh -L {address.port}:127.0.0.1:{address.port}` to another"
        )

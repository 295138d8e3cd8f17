"""Addresses of the server, and who may connect: everybody on this machine, elsewhere only with a token or CURVE keys."""

from __future__ import annotations

import hmac
import ipaddress
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rso_lidar.errors import ScenarioError
from rso_lidar.files import check_regular, read_text

_LEAST_TOKEN = 16  # characters: 64 bits as hexadecimal digits cannot be guessed over a network
_MOST_TOKEN_BYTES = 4096
_MOST_KEY_BYTES = 65_536


@dataclass(frozen=True)
class Security:
    """Who may connect to a server.

    `token` is a secret that the first request must hold; it travels in clear text. `server_key` is the file of the server's
    CURVE keys, and `client_keys` the folder of the public keys of those who may connect (files of zmq.auth).
    """

    token: str | None = None
    server_key: Path | None = None
    client_keys: Path | None = None

    def __post_init__(self) -> None:
        if self.token is not None and len(self.token) < _LEAST_TOKEN:
            raise ScenarioError(f"token: has {len(self.token)} characters; give at least {_LEAST_TOKEN} random ones")
        if (self.server_key is None) != (self.client_keys is None):
            raise ScenarioError("--curve-key and --curve-clients: need each other; give both or none")

    def accepts(self, token: str | None) -> bool:
        """Return whether a token is the right one, by a comparison in constant time.

        Parameters
        ----------
        token : of a client; None for none
        """
        if self.token is None:
            return True
        return token is not None and hmac.compare_digest(token.encode(), self.token.encode())

    def check(self, option: str, endpoint: str, *, is_stream: bool = False) -> None:
        """Check that an address may be used.

        Parameters
        ----------
        option : that gave the address, for messages
        endpoint : such as ``tcp://127.0.0.1:5571``
        is_stream : whether it is that of the stream, whose readers send no token

        Raises
        ------
        ScenarioError
            If it is not an address, or one that others reach without a secret.
        """
        if is_private(option, endpoint) or self.server_key is not None:
            return
        if self.token is not None and not is_stream:
            return
        cure = "give --curve-key and --curve-clients" + ", or --token-file" * (not is_stream)
        why = "; a stream asks for no token" * (self.token is not None)
        raise ScenarioError(f"{option} {endpoint}: can be reached from other machines{why}; {cure}, or use 127.0.0.1")


def is_private(option: str, endpoint: str) -> bool:
    """Return whether only this machine reaches an address; raise `ScenarioError` if it is not an address.

    Parameters
    ----------
    endpoint : such as ``tcp://127.0.0.1:5571`` or ``ipc://lidar``, a socket file in the working folder
    """
    if re.fullmatch(r"ipc://[^\s*@][^\s*]*", endpoint):
        return True
    match = re.fullmatch(r"tcp://(\[[0-9a-fA-F:.]+\]|[\w.\-]+|\*):(\d{1,5}|\*)", endpoint)
    if match is None or (match[2] != "*" and int(match[2]) > 65535):
        raise ScenarioError(f"{option} {endpoint:.80}: is not an address; write for example tcp://127.0.0.1:5571")
    host = match[1].strip("[]")
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False  # a name, an interface or a star


def resolve_host(zmq: Any, endpoint: str) -> str:
    """Return an address with its host as a number, and with port 0 for a free one, as the operating system takes it.

    Parameters
    ----------
    zmq : the module, whose names of hosts and interfaces count
    endpoint : such as ``tcp://eth0:5571``, ``tcp://*:*`` or ``ipc://lidar``

    Raises
    ------
    zmq.ZMQError
        If there is no such host.
    """
    if endpoint.startswith("ipc:"):
        return endpoint
    host, _, port = endpoint.rpartition(":")
    with zmq.Context() as context, context.socket(zmq.PAIR) as tried:
        tried.set(zmq.IPV6, "[" in host)
        tried.bind(f"{host}:*")
        resolved, _, _ = tried.get(zmq.LAST_ENDPOINT).rstrip(b"\0").decode().rpartition(":")
    return f"{resolved}:{0 if port == '*' else port}"


def read_token(path: Path) -> str:
    """Return the token in a file, without blanks around it.

    Parameters
    ----------
    path : of a text file with the token alone

    Raises
    ------
    ScenarioError
        If the file cannot be read, is too long, or holds no token.
    """
    token = read_text(path, _MOST_TOKEN_BYTES, ScenarioError, "token").strip()
    if not token:
        raise ScenarioError(f"{path}: holds no token; write at least {_LEAST_TOKEN} random characters into it")
    return token


def load_keys(path: Path) -> tuple[bytes, bytes]:
    """Return the public and the secret CURVE key of a file.

    Parameters
    ----------
    path : of a file of zmq.auth whose name ends in ``.key_secret``

    Raises
    ------
    ScenarioError
        If it cannot be read, or holds no secret key.
    """
    from zmq.auth import load_certificate

    check_regular(path, _MOST_KEY_BYTES, ScenarioError, "CURVE key")
    try:
        public, secret = load_certificate(path)
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or error
        raise ScenarioError(f"{path}: is no CURVE key ({why}); make one with zmq.auth.create_certificates") from None
    if secret is None:
        raise ScenarioError(f"{path}: holds no secret key; give the file that ends in .key_secret")
    return public, secret


def load_public_key(path: Path) -> bytes:
    """Return the public CURVE key of a file of zmq.auth; raise `ScenarioError` where there is none."""
    from zmq.auth import load_certificate

    check_regular(path, _MOST_KEY_BYTES, ScenarioError, "CURVE key")
    try:
        public: bytes = load_certificate(path)[0]
    except (OSError, ValueError) as error:
        raise ScenarioError(
            f"{path}: is no CURVE key ({getattr(error, 'strerror', None) or error}); give the file that ends in .key"
        ) from None
    return public


def import_zmq(what: str) -> Any:
    """Return the module zmq.

    Parameters
    ----------
    what : what needs it, the start of the error message

    Raises
    ------
    ScenarioError
        If it is not installed.
    """
    try:
        import zmq
    except ImportError:
        raise ScenarioError(f'{what}: needs ZeroMQ; install the extra: pip install "rso-lidar[loop]"') from None
    return zmq

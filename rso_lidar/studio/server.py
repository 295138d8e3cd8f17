"""The server of the studio: its address, its token, and the application that NiceGUI serves."""

from __future__ import annotations

import os
import secrets
import socket
import webbrowser
from collections.abc import Callable
from pathlib import Path

from rso_lidar.errors import RunError, ScenarioError
from rso_lidar.interruption import remove_on_signal
from rso_lidar.loop import NetworkAddress

_NAMES = frozenset({"localhost", "127.0.0.1", "::1"})


def open_studio(folder: Path, address: NetworkAddress, *, opens_browser: bool, tell: Callable[[str], None]) -> None:
    """Serve the studio until the process is interrupted.

    Parameters
    ----------
    folder : the only folder that it reads and writes
    address : to listen at; port 0 takes a free one
    opens_browser : whether to open the page in the user's browser
    tell : takes the lines for the user, among them the address with the token

    Raises
    ------
    ScenarioError
        If the extra is not installed, the folder does not exist, or the port is taken.
    """
    try:
        import nicegui  # noqa: F401
        import tomlkit  # noqa: F401
        import uvicorn
    except ImportError:
        raise ScenarioError("studio: needs NiceGUI; install it with: pip install 'rso-lidar[studio]'") from None
    from rso_lidar.studio.application import build_application
    from rso_lidar.studio.state import Workspace

    workspace = Workspace(folder)
    listening = _listen(address)
    port = int(listening.getsockname()[1])
    token = secrets.token_urlsafe(24)
    hosts = _NAMES if address.is_loopback else None
    application = build_application(workspace, token=token, hosts=hosts, port=port)
    url = f"http://{NetworkAddress(address.host, port).text}/?token={token}"
    tell(f"studio      {workspace.folder.path}")
    tell(f"address     {url}")
    if not address.is_loopback:
        tell("warning     other machines can reach it; whoever has the address with the token can change the folder")
    tell("stop        Ctrl-C; a run under way keeps its frames, and the page offers to resume it")
    config = uvicorn.Config(application, log_level="error", access_log=False, timeout_graceful_shutdown=2)
    if opens_browser:
        webbrowser.open(url)
    try:
        with remove_on_signal(workspace.close):  # the command line ends on a signal without `finally`
            uvicorn.Server(config).run(sockets=[listening])
    finally:
        workspace.close()


def _listen(address: NetworkAddress) -> socket.socket:
    """Open the socket of the server, so that an occupied port is one line."""
    family = socket.AF_INET6 if ":" in address.host else socket.AF_INET
    try:
        return socket.create_server((address.host, address.port), family=family, backlog=128)
    except OSError as problem:
        why = os.strerror(problem.errno) if problem.errno else problem
        raise RunError(f"--at {address.text}: {why}; give another port, or port 0 for a free one") from None

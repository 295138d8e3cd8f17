"""A live view for Rerun: a proxy of Rerun on the loopback that keeps the scene for viewers which join late.

The server inside Rerun's library listens on all addresses of the machine (rerun-sdk 0.41), so a process of its own serves.
"""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

from rso_lidar.errors import ScenarioError
from rso_lidar.export import list_cameras
from rso_lidar.interruption import remove_on_signal
from rso_lidar.loop.live.queued_view import QueuedView
from rso_lidar.loop.network_address import NetworkAddress, parse_address, require_loopback
from rso_lidar.picture import Scale, Shape, Thumbnail, rerun_scene
from rso_lidar.records import Frame
from rso_lidar.scenario import Scenario

RERUN_ADDRESS = "127.0.0.1:9876"  # the port of Rerun
_MEMORY = "1GB"  # for late viewers; the oldest frames leave first
_OPENS_S, _ENDS_S = 20.0, 5.0


class RerunView(QueuedView):
    """A live view for Rerun (extra ``view``): `rerun URL` shows it, at any time during the run; a context manager.

    Only this machine can connect.
    """

    def __init__(
        self, scenario: Scenario, address: str = RERUN_ADDRESS, *, shapes: Sequence[Shape] | None = None
    ) -> None:
        """Start the proxy.

        Parameters
        ----------
        scenario : that is flown, with the meshes of its targets
        address : ``HOST:PORT`` of the proxy, a loopback address; port 0 takes a free one
        shapes : meshes to show (None: those of the scenario)

        Raises
        ------
        ScenarioError
            For an address of another kind, and for one that is in use.
        RecordingError
            Where Rerun is missing, which is an extra.
        """
        asked = parse_address(address, "live view:")
        require_loopback(asked, "live view:", "the live view")
        self._rerun = rerun_scene.import_rerun("live view")
        super().__init__()
        if shapes is None:
            shapes = [Shape(surface.name, surface.corners) for surface in scenario.surfaces]
        self._shapes = tuple(shapes)
        cameras = list_cameras(Path("live view"), scenario.source.scenario) if scenario.camera else []
        self._cameras = {camera.name: camera.pinhole.matrix for camera in cameras}
        self._lasts_s = scenario.span[1]
        self._scene: rerun_scene.RerunScene | None = None
        self._stream: Any = None
        self.address = _find_free(asked)
        with ExitStack() as stack:
            environment = stack.enter_context(rerun_scene.silence_analytics())
            command = [sys.executable, "-m", "rerun", "--serve-grpc", "--bind", self.address.host]
            command += ["--port", str(self.address.port), "--server-memory-limit", _MEMORY]
            quiet = subprocess.DEVNULL
            self._proxy = subprocess.Popen(  # a group of its own, because Rerun's Python starts another program
                command, env=environment, stdin=quiet, stdout=quiet, stderr=quiet, start_new_session=True
            )
            stack.callback(self._end_proxy)
            stack.enter_context(remove_on_signal(self._signal_proxy))
            _wait_for(self.address, self._proxy)
            self._open = stack.pop_all()
        self._start()

    @property
    def url(self) -> str:
        """Address for the viewer, such as ``rerun+http://127.0.0.1:9876/proxy``."""
        return f"rerun+http://{self.address.text}/proxy"

    def _publish(self, frame: Frame) -> None:
        """Send one frame to the proxy, with the colours that suit it."""
        scale = Scale.of([Thumbnail.of(frame)])
        if self._scene is None:
            self._scene = rerun_scene.RerunScene(
                self._rerun, frame, self._lasts_s, self._shapes, scale, "range", self._cameras
            )
            self._stream = self._rerun.RecordingStream(rerun_scene.APPLICATION, send_properties=False)
            self._stream.connect_grpc(self.url, default_blueprint=self._scene.blueprint())
            self._scene.begin(self._stream)
        self._scene.scale = scale
        self._scene.add(self._stream, frame)

    def _stop(self) -> None:
        """Send what is left, and end the proxy."""
        if self._stream is not None:
            with suppress(RuntimeError, ValueError, OSError):  # the proxy may be gone
                self._stream.flush(timeout_sec=_ENDS_S)
            self._stream.disconnect()
        self._open.close()

    def _signal_proxy(self) -> None:
        """Ask the proxy and what it started to end."""
        with suppress(OSError):
            if hasattr(os, "killpg"):
                os.killpg(self._proxy.pid, signal.SIGTERM)
            else:  # Windows
                self._proxy.terminate()

    def _end_proxy(self) -> None:
        """End the proxy, and wait until nobody listens any more."""
        self._signal_proxy()
        self._proxy.wait()
        end = time.monotonic() + _ENDS_S
        while time.monotonic() < end:
            try:
                socket.create_connection((self.address.host, self.address.port), timeout=1.0).close()
            except OSError:
                return
            time.sleep(0.02)


def _find_free(address: NetworkAddress) -> NetworkAddress:
    """Return an address with a port that nobody uses, or raise `ScenarioError`."""
    family = socket.AF_INET6 if ":" in address.host else socket.AF_INET
    with socket.socket(family) as tried:
        try:
            tried.bind((address.host, address.port))
        except OSError as error:
            raise ScenarioError(
                f"live view: {address.text}: cannot be opened ({error.strerror}); choose another port"
            ) from None
        return NetworkAddress(address.host, int(tried.getsockname()[1]))


def _wait_for(address: NetworkAddress, process: subprocess.Popen[bytes]) -> None:
    """Wait until a process listens at an address, or raise `ScenarioError`."""
    end = time.monotonic() + _OPENS_S
    while process.poll() is None and time.monotonic() < end:
        with suppress(OSError), socket.create_connection((address.host, address.port), timeout=1.0):
            return
        time.sleep(0.05)
    raise ScenarioError(f"live view: {address.text}: Rerun's proxy does not start; see `rerun --help`")

"""What tests of the studio share: the studio as users start it, in a process of its own."""

import contextlib
import http.client
import os
import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

import pytest


@dataclass(frozen=True)
class Studio:
    """A studio that serves: its process, what it printed, and the address with the token."""

    process: subprocess.Popen
    folder: Path
    lines: list[str]
    url: str

    @property
    def port(self) -> int:
        return urlsplit(self.url).port

    @property
    def token(self) -> str:
        return parse_qs(urlsplit(self.url).query)["token"][0]

    @property
    def cookie(self) -> str:
        return f"rso_lidar_studio_{self.port}={self.token}"


@contextlib.contextmanager
def serve_studio(folder, *options):
    """Start `rso-lidar studio` in a folder, yield it, and end it by Ctrl-C: it must end cleanly and say nothing more."""
    pytest.importorskip("nicegui", reason="the studio needs NiceGUI, the extra studio")
    command = [sys.executable, "-m", "rso_lidar", "studio", str(folder), "--no-browser", *options]
    process = subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        encoding="utf-8",
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
    )
    try:
        lines = []
        while not lines or not lines[-1].startswith("stop"):
            line = process.stdout.readline()
            assert line, f"the studio ended at once: {process.stderr.read()}"
            lines.append(line.rstrip("\n"))
        url = next(line.split()[1] for line in lines if line.startswith("address"))
        served = Studio(process, Path(folder), lines, url)
        with contextlib.closing(http.client.HTTPConnection("127.0.0.1", served.port, timeout=60)) as connection:
            connection.request("GET", "/")  # waits until it serves; Ctrl-C before that is another end
            with connection.getresponse() as response:
                assert response.status == 403
        yield served
        assert process.poll() is None, f"the studio ended by itself: {process.stderr.read()}"
        process.send_signal(signal.SIGINT if os.name == "posix" else signal.SIGTERM)
        printed, complaints = process.communicate(timeout=60)
        assert (printed, complaints) == ("", "")
        assert os.name != "posix" or process.returncode == 0
    finally:
        process.kill()
        process.communicate()


@pytest.fixture(scope="module")
def studio(tmp_path_factory):
    """Return a studio in an empty folder, one for the tests of a module."""
    with serve_studio(tmp_path_factory.mktemp("studio")) as served:
        yield served

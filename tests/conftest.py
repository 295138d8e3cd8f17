"""What every test stands on: the folder of real data, no network, and hypothesis without surprises."""

import os
import socket
from pathlib import Path

import hypothesis
import pytest

# A slow machine is no failure; a run of CI meets the same examples each time, so that a red run can be met again.
hypothesis.settings.register_profile("ci", derandomize=True, deadline=None, print_blob=True)
hypothesis.settings.register_profile("desk", deadline=None)
hypothesis.settings.load_profile("ci" if os.environ.get("CI") else "desk")


@pytest.fixture(scope="session")
def shared() -> Path:
    """Return the folder of real data that RSO_LIDAR_SHARED names; without one the test is skipped."""
    name = os.environ.get("RSO_LIDAR_SHARED", "")
    if not name:
        pytest.skip("RSO_LIDAR_SHARED names no folder of real data")
    folder = Path(name)
    if not folder.is_dir():
        pytest.fail(f"RSO_LIDAR_SHARED names a folder that is not there: {name}", pytrace=False)
    return folder


@pytest.fixture(scope="session", autouse=True)
def no_network():
    """Refuse every connection that leaves the machine, or could: only unix sockets connect."""
    with pytest.MonkeyPatch.context() as patch:
        for name in ("connect", "connect_ex"):
            patch.setattr(socket.socket, name, _local_only(getattr(socket.socket, name)))
        patch.setattr(socket, "getaddrinfo", _no_lookup)
        yield


def _local_only(connect):
    def guarded(self, address):
        if self.family != socket.AF_UNIX:
            raise RuntimeError(f"tests have no network: connection to {address!r} refused")
        return connect(self, address)

    return guarded


def _no_lookup(host, *_, **__):
    raise RuntimeError(f"tests have no network: look-up of {host!r} refused")

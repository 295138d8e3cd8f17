"""What every test stands on: the folder of real data, no network, and hypothesis without surprises."""

import gc
import ipaddress
import os
import signal
import socket
import sys
import threading
from pathlib import Path

import hypothesis
import pytest
from _pytest.doctest import DoctestModule

from tests import limits

pytest_plugins = ["tests.ledger.recording"]

# Hundreds of tests start a process. Where the machine forbids bytecode, each process would compile the package again.
sys.dont_write_bytecode = False
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

# As `addopts` says for this session, so for those that tests start elsewhere: plugins of other packages may not fit.
os.environ["PYTEST_DISABLE_PLUGIN_AUTOLOAD"] = "1"

# Each of the test processes would start as many threads of OpenBLAS as there are cores, which then wait for each other.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# A shell ignores Ctrl-C for what it starts in the background, and processes pass that on. Tests of Ctrl-C need it.
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN and threading.current_thread() is threading.main_thread():
    signal.signal(signal.SIGINT, signal.default_int_handler)

# A slow machine is no failure; a run of CI meets the same examples each time, so that a red run can be met again.
hypothesis.settings.register_profile("ci", derandomize=True, deadline=None, print_blob=True)
hypothesis.settings.register_profile("desk", deadline=None)
hypothesis.settings.load_profile("ci" if os.environ.get("CI") else "desk")


@pytest.hookimpl(trylast=True)  # after the terminal's
def pytest_configure(config):
    limits.watch(config)
    config.pluginmanager.register(
        DoctestSearch(), "search of doctests"
    )  # for the package too, which is no folder of tests


def pytest_collection_modifyitems(items):
    """Run the longest module first, which would come late: it would keep one process busy while the others idle."""
    items.sort(key=lambda item: not item.nodeid.startswith(limits.TYPES))


@pytest.hookimpl(trylast=True)
def pytest_collection_finish():
    """Let the garbage collector skip what collection made: it lives until the end, and each full search visits it."""
    gc.freeze()


class DoctestSearch:
    """Searches modules of the package with a prompt for doctests: each test process would search 1,500 modules."""

    @pytest.hookimpl(wrapper=True)
    def pytest_collect_file(self, file_path):
        collectors = yield
        if not any(isinstance(collector, DoctestModule) for collector in collectors):
            return collectors
        if Path(__file__).parent not in file_path.parents and b">>> " in file_path.read_bytes():
            return collectors
        return [collector for collector in collectors if not isinstance(collector, DoctestModule)]


class SharedPath(type(Path())):
    """A path to real data: a test that names a file or a folder that is not there is skipped.

    trimesh knows classes of paths by the end of their names.
    """

    def __truediv__(self, name):
        path = super().__truediv__(name)
        if not path.exists():
            pytest.skip(f"{name} is not in the folder of real data; tests/real_data.md says where it is public")
        return path


@pytest.fixture(scope="session")
def shared() -> Path:
    """Return the folder of real data that RSO_LIDAR_SHARED names; without one the test is skipped."""
    name = os.environ.get("RSO_LIDAR_SHARED", "")
    if not name:
        pytest.skip("RSO_LIDAR_SHARED names no folder of real data; tests/real_data.md says where its files are public")
    folder = SharedPath(name)
    if not folder.is_dir():
        pytest.fail(f"RSO_LIDAR_SHARED names a folder that is not there: {name}", pytrace=False)
    return folder


@pytest.fixture(scope="session", autouse=True)
def no_library(tmp_path_factory):
    """Let no test see the models that whoever runs it keeps in a library of their own, nor their settings."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("RSO_LIDAR_CONFIG", str(tmp_path_factory.mktemp("settings") / "none"))
        patch.setenv("RSO_LIDAR_MODELS", str(tmp_path_factory.mktemp("library") / "none"))
        yield


@pytest.fixture(scope="session", autouse=True)
def no_waiting_for_disks():
    """Let os.fsync return at once: no test cuts the power, and thousands of small files would each wait for the disk.

    A descriptor that is not open is refused as before. Processes that a test starts wait for the disk as usual.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", os.fstat)
        yield


@pytest.fixture(scope="session", autouse=True)
def no_network():
    """Refuse every connection that leaves the machine, or could: only unix sockets and the loopback connect."""
    with pytest.MonkeyPatch.context() as patch:
        for name in ("connect", "connect_ex"):
            patch.setattr(socket.socket, name, _local_only(getattr(socket.socket, name)))
        patch.setattr(socket, "getaddrinfo", _loopback_lookup(socket.getaddrinfo))
        yield


def _is_loopback(host):
    """Return whether a host is this machine: 127.0.0.0/8 (RFC 1122, sec. 3.2.1.3), or ::1."""
    try:
        return host in ("localhost", b"127.0.0.1") or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def _local_only(connect):
    def guarded(self, address):
        if self.family != socket.AF_UNIX and not _is_loopback(address[0]):
            raise RuntimeError(f"tests have no network: connection to {address!r} refused")
        return connect(self, address)

    return guarded


def _loopback_lookup(look_up):
    def guarded(host, *given, **named):
        if not _is_loopback(host):
            raise RuntimeError(f"tests have no network: look-up of {host!r} refused")
        return look_up(host, *given, **named)

    return guarded


BENCH = """
version = 1
name    = "a plate on a bench"
seed    = 7

[world]
axes = "local"

[time]
start_utc     = 2024-09-17T12:00:00Z
duration_s    = 2
frame_rate_hz = 5

[[target]]
name     = "plate"
model    = "plate"
material = { type = "lambertian", reflectance = 0.30 }
motion   = { type = "fixed", position_m = [1000, 0, 0] }
attitude = { type = "spin", axis = [0, 0, 1], rate_deg_s = 10 }

[follower]
motion = { type = "fixed", position_m = [0, 0, 0] }

[ptu]
point    = { type = "track", at = "plate" }
response = { type = "second_order", natural_hz = 4.0, damping = 0.7 }
errors   = { jitter_deg = 0.001, encoder_noise_deg = 0.001 }

[lidar.laser]
energy_mj = 50

[lidar.receiver]
fov_deg  = 2.5
f_number = 2.8
n_rows   = 32
n_cols   = 32
rays_per_pixel = 4
"""


@pytest.fixture(scope="session")
def text() -> str:
    """Return a small scenario that needs no orbit and takes little time."""
    return BENCH


@pytest.fixture
def library(tmp_path, monkeypatch) -> Path:
    """Use a library of models that is not there yet, and return its folder."""
    folder = tmp_path / "library"
    monkeypatch.setenv("RSO_LIDAR_MODELS", str(folder))
    return folder


@pytest.fixture(scope="session")
def handmade():
    """Return the module of frames made by hand: make_frame, make_truth, approach."""
    from tests.picture import frames_for_tests

    return frames_for_tests


@pytest.fixture(scope="session")
def coming(handmade):
    """Return twelve small frames of an approach from 3 km to 300 m."""
    return handmade.approach(12, n=64, photons_at_km=60_000.0)

"""The server of the studio: where it listens, what it prints, and how it ends."""

import builtins
import os
import subprocess
import sys

import pytest

from rso_lidar.errors import RunError, ScenarioError
from rso_lidar.loop import NetworkAddress
from rso_lidar.studio import open_studio
from tests.studio.conftest import serve_studio

FREE = NetworkAddress("127.0.0.1", 0)


@pytest.fixture(scope="module")
def ended(studio, tmp_path_factory):
    """Return a second studio, open to other machines, after its end."""
    with serve_studio(tmp_path_factory.mktemp("ended"), "--at", "0.0.0.0:0") as served:
        pass
    return served


NEEDS_POSIX = pytest.mark.skipif(os.name != "posix", reason="Windows asks for leave to open a server to other machines")


def test_it_prints_folder_and_address_with_a_long_token(studio):
    assert studio.lines[0].split(maxsplit=1) == ["studio", str(studio.folder)]
    assert studio.url.startswith(f"http://127.0.0.1:{studio.port}/?token=")
    assert len(studio.token) == 32  # 192 bits
    assert not [line for line in studio.lines if line.startswith("warning")]


@pytest.mark.skipif(sys.platform != "linux", reason="other systems have one address of the loopback only")
def test_it_listens_on_one_address_only(studio):
    """Another address of this machine, which tests may not reach themselves, answers nothing."""
    program = f"import socket; socket.create_connection(('127.0.0.2', {studio.port}), 10)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert "ConnectionRefusedError" in done.stderr


@NEEDS_POSIX
def test_each_studio_has_a_token_of_its_own(studio, ended):
    assert ended.token != studio.token and ended.port != studio.port


@NEEDS_POSIX
def test_it_writes_nothing_into_its_folder(ended):
    assert not list(ended.folder.iterdir())


@NEEDS_POSIX
def test_an_address_that_others_reach_is_told_with_a_warning(ended):
    (warning,) = [line for line in ended.lines if line.startswith("warning")]
    assert "other machines can reach it" in warning and "token" in warning


def test_an_occupied_port_is_one_line(studio, tmp_path):
    taken = NetworkAddress("127.0.0.1", studio.port)
    with pytest.raises(RunError, match=f"--at 127.0.0.1:{studio.port}: Address already in use; give another port"):
        open_studio(tmp_path, taken, opens_browser=False, tell=print)


def test_a_missing_folder_is_told_before_anything_starts(tmp_path):
    said = []
    with pytest.raises(ScenarioError, match="is not a folder"):
        open_studio(tmp_path / "none", FREE, opens_browser=False, tell=said.append)
    assert said == []


@pytest.mark.parametrize("missing", ["nicegui", "tomlkit", "uvicorn"])
def test_the_extra_is_named_where_it_is_missing(missing, tmp_path, monkeypatch):
    real = builtins.__import__

    def without(name, *given, **named):
        if name == missing:
            raise ImportError(name)
        return real(name, *given, **named)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(
        ScenarioError, match=r"studio: needs NiceGUI; install it with: pip install 'rso-lidar\[studio\]'"
    ):
        open_studio(tmp_path, FREE, opens_browser=False, tell=print)

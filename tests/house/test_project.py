"""What is said twice about the project is said alike, and the network is shut while tests run."""

import re
import socket
import tomllib
from importlib.metadata import requires, version
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def names(requirements):
    return {re.match(r"[\w.-]+", line)[0].lower().replace("_", "-") for line in requirements}


def test_citation_names_this_version():
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    said = dict(re.findall(r"^(version|license|abstract): \"?(.*?)\"?$", text, re.MULTILINE))
    project = PROJECT["project"]
    assert said == {"version": project["version"], "license": project["license"], "abstract": project["description"]}


def test_installed_version_is_this_one():
    assert version("rso-lidar") == PROJECT["project"]["version"], "install again: make venv"


def test_constraints_are_names_and_versions_only():
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    pins = [line for line in lines if line and not line.startswith("#")]
    assert pins
    assert all(re.fullmatch(r"[A-Za-z][\w.-]*==[\w.]+( ; python_version [<>=]+ '3\.\d+')?", pin) for pin in pins)


def test_constraints_hold_for_all_that_is_installed():
    """Every dependency, and every dependency of one, is pinned."""
    pinned = names(
        line for line in (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines() if not line.startswith("#")
    )
    waiting = names(PROJECT["project"]["dependencies"] + PROJECT["dependency-groups"]["test"])
    needed = set()
    while waiting:
        name = waiting.pop()
        needed.add(name)
        unconditional = [line for line in requires(name) or [] if ";" not in line]
        waiting |= names(unconditional) - needed
    assert needed <= pinned


def test_make_describes_every_target():
    text = (ROOT / "Makefile").read_text(encoding="utf-8")
    phony = set(re.search(r"^\.PHONY: (.*)$", text, re.MULTILINE)[1].split())
    described = set(re.findall(r"^([a-z]+):.*## .+$", text, re.MULTILINE))
    assert phony == described


def test_no_connection_leaves_the_machine():
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as plug, pytest.raises(RuntimeError, match="no network"):
        plug.connect(("192.0.2.1", 80))
    with pytest.raises(RuntimeError, match="no network"):
        socket.create_connection(("example.org", 80))


def test_connections_inside_the_machine_go_through(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # a socket's path may be no longer than about 100 characters
    with socket.socket(socket.AF_UNIX) as server, socket.socket(socket.AF_UNIX) as client:
        server.bind("door")
        server.listen()
        client.connect("door")
        assert client.getpeername() == "door"

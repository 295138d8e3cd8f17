"""No tracked file tells where or with what it was written: no path of a machine, no address of a package registry."""

import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


def slash(*folders):
    """Return the pattern of an absolute path that begins with one of these folders."""
    return rf"(?<![\w.)\]}}$*-])/(?:{'|'.join(folders)})/"


# The patterns are put together here, so that this file passes its own test.
TRACES = {
    "a path of a machine": slash("work", "farm", "tmp", "root", "home", "Users", "opt", "mnt", "var"),
    "a drive of a machine": r"\b[A-Z]:\\\\?" + "Users",
    "an address of a package registry": "|".join(
        [
            "py" + r"pi\.org",
            "files" + r"\.python" + "hosted",
            "conda" + r"\.anaconda\.org",
            "--(?:extra-)?index" + "-url",
        ]
    ),
    "an address inside a network": r"://(?:localhost|127\.|10\.|192\.168\.|[\w.-]+\.(?:internal|local|lan)\b)",
    "a tool of a workplace": "|".join(
        ["sub" + "agent", "clau" + "de", "anthro" + "pic", "chat" + "gpt", "co" + "pilot"]
    ),
}
PATTERNS = {name: re.compile(pattern.encode(), re.IGNORECASE) for name, pattern in TRACES.items()}


def tracked():
    """Return the files that the repository holds."""
    if not (ROOT / ".git").exists():
        pytest.skip("not a checkout")
    listing = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    return [ROOT / name for name in listing.split("\0") if name and (ROOT / name).is_file()]


@pytest.mark.parametrize("trace", TRACES)
def test_no_file_shows(trace):
    files = tracked()
    assert ROOT / "pyproject.toml" in files
    shown = []
    for file in files:
        for found in PATTERNS[trace].finditer(file.read_bytes()):
            line = file.read_bytes().count(b"\n", 0, found.start()) + 1
            shown.append(f"{file.relative_to(ROOT)}:{line}: {found[0].decode(errors='replace')}")
    assert shown == []


@pytest.mark.parametrize(
    ("trace", "text"),
    [
        ("a path of a machine", "see /" + "work/notes.txt"),
        ("a path of a machine", '"/' + 'home/someone/x"'),
        ("an address of a package registry", "https://py" + "pi.org/simple"),
        ("an address inside a network", "http://" + "127.0.0.1:8080"),
        ("a tool of a workplace", "sub" + "agent"),
    ],
)
def test_a_trace_is_seen(trace, text):
    assert PATTERNS[trace].search(text.encode())


@pytest.mark.parametrize(
    "text", ["models/" + "work/part.glb", "../var/x", "$OUT/" + "tmp/x", "https://example.org/home/x"]
)
def test_an_innocent_path_is_let_through(text):
    assert not any(pattern.search(text.encode()) for pattern in PATTERNS.values())

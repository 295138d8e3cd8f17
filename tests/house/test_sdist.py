"""The source distribution holds all that is tracked, so that it demonstrates and tests itself where it is unpacked."""

import subprocess
import sys
import tarfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
ADDED = {"PKG-INFO"}  # by the build


@pytest.mark.slow
def test_sdist_holds_what_is_tracked_and_nothing_else(tmp_path):
    if not (ROOT / ".git").exists():
        pytest.skip("not a checkout: git knows what is tracked")
    command = [sys.executable, "-m", "build", "--sdist", "--no-isolation", "--outdir", str(tmp_path), str(ROOT)]
    built = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert built.returncode == 0, built.stdout + built.stderr
    (file,) = tmp_path.glob("*.tar.gz")
    with tarfile.open(file) as archive:
        held = {name.split("/", 1)[1] for name in archive.getnames() if "/" in name}
    listed = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]  # what is yet to be added, too
    known = subprocess.run(listed, cwd=ROOT, capture_output=True, text=True, check=True).stdout.split("\0")
    assert held == {name for name in known if name and (ROOT / name).is_file()} | ADDED

"""Where neither the package nor the home can be written, machine code is kept in a spare folder of the user's own."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

STAGE = """
from pathlib import Path

from rso_lidar import kernels

kernels.__file__ = str(Path(__file__).with_name("kernels.py"))  # as if the package stood in this folder


@kernels.kernel
def double(x):
    return x * 2.0
"""
ASKED = (
    "import locked_stage as some; value = some.double(1.0); known = some.double.dispatcher.stats; "
    "print(value, len(known.cache_hits), known.cache_path)"
)


@pytest.fixture
def answer(tmp_path):
    """Return a function that calls a kernel in a fresh process that can keep nothing beside the package or in its home.

    A file stands where a folder would be made, which keeps root off too.
    """
    code, home, temporary = (tmp_path / name for name in ("code", "home", "temporary"))
    for folder in (code, home, temporary):
        folder.mkdir()
    (code / "locked_stage.py").write_text(STAGE)
    (code / "__pycache__").touch()
    (home / ".cache").touch()

    def ask(**more):
        environment = {
            **os.environ,
            "HOME": str(home),
            "TMPDIR": str(temporary),
            "PYTHONDONTWRITEBYTECODE": "1",
            **more,
        }
        environment.pop("NUMBA_CACHE_DIR", None)
        environment.pop("XDG_CACHE_HOME", None)
        done = subprocess.run(
            [sys.executable, "-c", ASKED], cwd=code, env=environment, capture_output=True, text=True, timeout=300
        )
        assert done.returncode == 0, done.stderr
        value, hits, place = done.stdout.split()
        assert value == "2.0"
        return int(hits), place, done.stderr

    ask.temporary = temporary
    return ask


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="owners and modes are POSIX's")
def test_the_second_start_reads_what_the_first_compiled(answer):
    hits, place, said = answer()
    assert (hits, said) == (0, "")
    (spare,) = answer.temporary.glob("rso_lidar-cache-*")
    assert Path(place).is_relative_to(spare)
    assert spare.stat().st_mode & 0o777 == 0o700
    assert answer() == (1, place, "")


@pytest.mark.skipif(os.name != "posix", reason="owners and modes are POSIX's")
@pytest.mark.parametrize("kind", ["writable by all", "a link", "a file"])
def test_a_folder_that_others_may_write_is_refused(answer, kind, tmp_path):
    spare = answer.temporary / f"rso_lidar-cache-{os.getuid()}"
    if kind == "writable by all":
        spare.mkdir()
        spare.chmod(0o777)
    elif kind == "a link":
        (tmp_path / "elsewhere").mkdir(mode=0o700)
        spare.symlink_to(tmp_path / "elsewhere")
    else:
        spare.touch()
    done = answer()
    assert done[0] == 0 and "None" in done[1]
    assert "not a folder that only you can write to" in done[2]
    assert not spare.is_dir() or not list(spare.iterdir())


@pytest.mark.slow
def test_two_first_starts_at_once_compile_once(answer):
    import concurrent.futures

    with concurrent.futures.ThreadPoolExecutor(2) as both:
        hits = sorted(hit for hit, _, _ in both.map(lambda _: answer(), range(2)))
    assert hits == [0, 1]  # the other waits for the one that compiles, and reads what it keeps

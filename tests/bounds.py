"""The declared lower bounds, tried out: `python -m tests.bounds` installs them and flies, records, reads and exports.

Everything that the package needs, and everything that an extra adds, is installed in the oldest version that pyproject.toml
allows, into a virtual environment in a temporary folder. It needs the package index, so it is no test of the suite.
"""

import argparse
import contextlib
import os
import re
import signal
import subprocess
import sys
import tempfile
import tomllib
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
EXAMPLE = ROOT / "examples" / "tdrs_approach.toml"
CAMERA = """
[[camera]]
name = "nav"
lens = { fov_deg = 5, f_number = 4, n_rows = 32, n_cols = 32 }
"""
HEAVY = ("learn", "step", "view")  # extras of 3, 0.1 and 0.5 GB, which --heavy installs too

NEED_MORE = (".raw", ".tdm")  # a detector with words of a report, and a target that is whole in the field
FORMATS = "from rso_lidar.export.registry import FORMATS; print(*(made.suffixes[0] for made in FORMATS.values()))"

# Read by the package itself, frame by frame and as a whole, and by nothing but h5py.
READ = """
import sys, warnings
warnings.simplefilter("error")
import h5py, numpy as np, rso_lidar as rl
with rl.open(sys.argv[1]) as recording, h5py.File(sys.argv[1]) as file:
    assert len(recording) == 3, len(recording)
    assert recording[2].valid.sum() > 0, "no return in the last frame"
    assert np.array_equal(recording[2].range_m, file["range"][2], equal_nan=True)
    assert recording[1].truth.pose("lidar", "tdrs").translation[2] > 1000.0
"""


def lower_bounds(requirements: list[str]) -> list[str]:
    """Return a pin (name==version) to the lower bound of each requirement; one that states none is an error."""
    pins = []
    for requirement in requirements:
        found = re.fullmatch(r"([\w.-]+)\s*(?:>=|==)\s*([\w.]+)(?:,<[\w.]+)?", requirement)
        if found is None:
            raise SystemExit(f"pyproject.toml: '{requirement}': states no lower bound; write name>=version")
        pins.append(f"{found[1]}=={found[2]}")
    return pins


def call(*command: object) -> str:
    """Run a command in the temporary folder; what it says counts only where it fails."""
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True)
    if done.returncode != 0:
        raise SystemExit(f"{' '.join(map(str, command))}:\n{done.stdout}{done.stderr}")
    return done.stdout


def reach_index(*pip: object) -> None:
    """Download pip itself, a wheel for every platform that no index lacks: without it nothing below can be installed."""
    try:
        call(*pip, "download", "-qq", "--no-deps", "--dest", "index", "pip")
    except SystemExit as told:
        *_, why = str(told).strip().splitlines()
        raise SystemExit(
            f"the package index: cannot be reached ({why.removeprefix('ERROR: ')}): connect, or name one that answers in "
            "PIP_INDEX_URL"
        ) from None


def main() -> None:
    """Install the lower bounds, and use the package with them."""
    parser = argparse.ArgumentParser(description="Install the declared lower bounds and fly the example with them.")
    parser.add_argument("--heavy", action="store_true", help=f"with the extras {' and '.join(HEAVY)}, 4 GB more")
    left_out = () if parser.parse_args().heavy else HEAVY
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = [
        line for name, lines in project["optional-dependencies"].items() if name not in left_out for line in lines
    ]
    pins = lower_bounds([*project["dependencies"], *extras])
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # so that the folder is removed
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        Path("bounds.txt").write_text("\n".join(pins) + "\n", encoding="utf-8")
        venv.create("venv", with_pip=True)
        python = Path(folder, "venv", "Scripts" if sys.platform == "win32" else "bin", "python")
        pip = [python, "-m", "pip", "--disable-pip-version-check"]
        reach_index(*pip)
        call(*pip, "install", "-qq", "--upgrade", "pip")
        # As requirements, so that pip stops here where two bounds contradict each other; none is built from its source.
        call(*pip, "install", "-qq", "--only-binary", ":all:", "-r", "bounds.txt")
        call(*pip, "install", "-qq", "--no-deps", "--build-constraint", ROOT / "constraints.txt", ROOT)
        call(*pip, "check")
        print("installed:", ", ".join(pins), flush=True)
        os.environ |= {
            "XDG_CACHE_HOME": folder,
            "MPLCONFIGDIR": folder,
            "NUMBA_CACHE_DIR": folder,
        }  # nothing stays behind
        fly = [python, "-m", "rso_lidar"]
        mission = Path("approach.toml")
        mission.write_text(EXAMPLE.read_text(encoding="utf-8") + CAMERA, encoding="utf-8")
        call(*fly, "check", mission)
        call(*fly, "run", mission, "-o", "run.h5", "--frames", "0:3")
        call(*fly, "info", "run.h5")
        call(python, "-c", READ, "run.h5")
        call(*fly, "plot", "run.h5", "-o", "run.png")
        suffixes = [suffix for suffix in call(python, "-c", FORMATS).split() if suffix not in NEED_MORE]
        for suffix in suffixes:
            call(*fly, "export", "run.h5", "--to", f"again{suffix}")
        print(f"flown, recorded, read, drawn and exported ({', '.join(suffixes)}) with them: the lower bounds are true")


if __name__ == "__main__":
    main()

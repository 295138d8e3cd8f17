"""Bills of materials (CycloneDX), one for each extra: `python -m tests.bill_of_materials` (`make sbom`) writes to out/sbom.

Each extra is installed into an environment of its own, at the versions and hashes of constraints.txt. It needs the package
index, so it is no test of the suite.
"""

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
import tomllib
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
OUT = ROOT / "out" / "sbom"
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EXTRAS = sorted(PROJECT["optional-dependencies"])


def run(command, folder, **variables):
    """Run a command in a folder; what it prints counts only where it fails."""
    words = [str(word) for word in command]
    done = subprocess.run(words, cwd=folder, env=os.environ | variables, capture_output=True, text=True)
    if done.returncode != 0:
        raise SystemExit(f"{' '.join(map(str, command))}:\n{done.stdout}{done.stderr}")


def install(source, environment, extra=None):
    """Install the project into a new environment, at the versions of constraints.txt; return its folder of programs.

    Parameters
    ----------
    source : a wheel, or the folder of the project.
    environment : folder that is made.
    extra : name of an extra, or None.
    """
    venv.create(environment)  # without pip, so that the bill lists what is installed and no more
    bin_folder = environment / ("Scripts" if sys.platform == "win32" else "bin")
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--python", bin_folder / "python"]
    pins = ["-c", ROOT / "constraints.txt", "--build-constraint", ROOT / "constraints.txt"]
    requirement = f"{source}[{extra}]" if extra else source
    run([*pip, "install", "-qq", *pins, requirement], environment, PIP_NO_REQUIRE_HASHES="1")  # the project has none
    return bin_folder


def write_bill(python, path, extra=None):
    """Write the bill of materials of an environment, and check that it has what the project asks for.

    Parameters
    ----------
    python : interpreter of the environment.
    path : of the bill, JSON.
    extra : name of the extra that is installed, or None.

    Returns
    -------
    number of packages.
    """
    tool = [sys.executable, "-m", "cyclonedx_py", "environment", "--output-reproducible"]
    run([*tool, "--of", "JSON", "-o", path, python], path.parent)
    components = json.loads(path.read_text(encoding="utf-8"))["components"]
    names = {part["name"].lower().replace("_", "-") for part in components}
    asked = PROJECT["dependencies"] + (PROJECT["optional-dependencies"][extra] if extra else [])
    wanted = {re.match(r"[\w.-]+", line)[0].lower().replace("_", "-") for line in asked}
    if missing := wanted - names:
        raise SystemExit(f"{path}: lacks {', '.join(sorted(missing))}")
    return len(names)


def name_bill(extra=None):
    """Return the name of the file that holds the bill of this version."""
    return f"rso_lidar-{PROJECT['version']}{f'-{extra}' if extra else ''}.cdx.json"


def main():
    """Write the bills of the extras that the arguments name, or of all."""
    parser = argparse.ArgumentParser(description="Write what extras install as CycloneDX, in out/sbom.")
    parser.add_argument("extra", nargs="*", help=f"among {', '.join(EXTRAS)}; all without one")
    extras = parser.parse_args().extra or EXTRAS
    if unknown := sorted(set(extras) - set(EXTRAS)):
        parser.error(f"{', '.join(unknown)}: no such extra; choose among {', '.join(EXTRAS)}")
    OUT.mkdir(parents=True, exist_ok=True)
    for extra in extras:
        with tempfile.TemporaryDirectory(prefix="rso_lidar_sbom_") as name:
            bin_folder = install(ROOT, Path(name) / "environment", extra)
            path = OUT / name_bill(extra)
            count = write_bill(bin_folder / "python", path, extra)
        print(f"{extra}: {count} packages, {path.relative_to(ROOT)}", flush=True)


if __name__ == "__main__":
    main()

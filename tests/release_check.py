"""All that a release needs, tried out: `python -m tests.release_check` (`make release-check`); results lie in out/release.

Licences, build, metadata, README, an installation elsewhere, the shipped examples from another folder, and a bill of
materials. It needs the package index, so it is no test of the suite.
"""

import re
import shutil
import sys
import tempfile
import tomllib
from html.parser import HTMLParser
from pathlib import Path

from tests.bill_of_materials import install, name_bill, run, write_bill
from tests.bounds import call

ROOT = Path(__file__).resolve().parents[1]
OUT = ROOT / "out" / "release"
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]

# One frame of the Python twin, in a folder that holds nothing of the repository but it and what it reads.
TWIN = """
import runpy, sys
import rso_lidar as rl
assert rl.__file__.startswith(sys.prefix), rl.__file__
scenario = runpy.run_path(sys.argv[1], run_name="twin")["scenario"]
(frame,) = rl.simulate(scenario, frames=[0])
assert frame.range_m.shape == frame.valid.shape
"""


class Addresses(HTMLParser):
    """Addresses of links and pictures in a page."""

    def __init__(self):
        super().__init__()
        self.found = []

    def handle_starttag(self, tag, attrs):
        """Collect what a tag points to."""
        self.found += [value for name, value in attrs if name in ("href", "src") and value]


def find_faults(addresses, source, version, files):
    """Return the addresses that are relative, or name a file that the repository does not hold.

    Parameters
    ----------
    addresses : of links and pictures.
    source : address of the repository.
    version : whose tag links into the repository name.
    files : of the repository, and their folders.
    """
    faults = [address for address in addresses if not re.match(r"https?://|#", address)]
    for address in addresses:
        inside = re.fullmatch(rf"{re.escape(source)}/(?:blob|raw)/v{re.escape(version)}/([^#]+)(?:#.*)?", address)
        if address.startswith(f"{source}/") and (inside is None or inside[1] not in files):
            faults.append(address)
    return faults


def check_readme(wheel):
    """Render the long description of a wheel, and check its links and pictures."""
    from readme_renderer import markdown

    (metadata,) = (name for name in wheel.namelist() if name.endswith(".dist-info/METADATA"))
    text = wheel.read(metadata).decode("utf-8").split("\n\n", 1)[1]
    page = markdown.render(text)
    if page is None:
        raise SystemExit("README.md: does not render")
    (OUT / "README.html").write_text(page, encoding="utf-8")
    reader = Addresses()
    reader.feed(page)
    tracked = [Path(name) for name in call("git", "-C", ROOT, "ls-files").splitlines()]
    files = {path.as_posix() for name in tracked for path in (name, *name.parents)}
    faults = find_faults(reader.found, PROJECT["urls"]["Source"], PROJECT["version"], files)
    pictures = sum("/raw/" in address for address in reader.found)
    if faults or not pictures:
        raise SystemExit(f"README.md: {pictures} pictures; wrong addresses: {', '.join(faults) or 'none'}")
    print(f"README: rendered, {len(reader.found)} absolute addresses, {pictures} pictures", flush=True)


def fly_examples(bin_folder, folder):
    """Fly a frame of every shipped example, as TOML and as Python, with an installed package and nothing else.

    Parameters
    ----------
    bin_folder : of the environment that the package is installed in.
    folder : where the examples are written and flown.
    """
    program = [bin_folder / "python", "-I", "-m", "rso_lidar"]
    where = call(bin_folder / "python", "-I", "-c", "import rso_lidar; print(rso_lidar.__path__[0])").strip()
    examples = sorted((Path(where) / "examples").glob("*.toml"))
    assert len(examples) > 8, examples
    for example in examples:
        mine = folder / f"my_{example.name}"
        run([*program, "new", mine.stem, "--from", example.stem], folder)
        run([*program, "run", mine, "-o", mine.with_suffix(".h5"), "--frames", "0:1"], folder)
        run([bin_folder / "python", "-I", "-c", TWIN, example.with_suffix(".py")], folder)
        print(f"example: {example.stem}", flush=True)


def main():
    """Check a release; the first failure ends it with status 1."""
    import zipfile

    run([sys.executable, "-m", "reuse", "--root", ROOT, "lint"], ROOT)
    print("licences: REUSE", flush=True)

    shutil.rmtree(OUT, ignore_errors=True)
    run([sys.executable, "-m", "build", "--no-isolation", "--outdir", OUT, ROOT], ROOT)
    (wheel,), (sdist,) = OUT.glob("*.whl"), OUT.glob("*.tar.gz")
    run([sys.executable, "-m", "twine", "check", "--strict", wheel, sdist], ROOT)
    print(f"built: {wheel.name}, {sdist.name}; twine check", flush=True)
    with zipfile.ZipFile(wheel) as archive:
        check_readme(archive)

    with tempfile.TemporaryDirectory(prefix="rso_lidar_release_") as name:
        environment, folder = Path(name) / "environment", Path(name) / "elsewhere"
        folder.mkdir()
        bin_folder = install(wheel, environment)
        fly_examples(bin_folder, folder)

        bill = OUT / name_bill()
        count = write_bill(bin_folder / "python", bill)
    print(f"bill of materials: {count} packages, {bill.relative_to(ROOT)}", flush=True)


if __name__ == "__main__":
    main()

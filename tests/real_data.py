"""Bring real data that tests read to where they look: ``python -m tests.real_data [FOLDER] [--to FOLDER]``.

Files of the first folder are recognised by their SHA-256, whatever they are called; spacecraft in NASA's print units are
turned into metres. What the installed package `sgp4` holds of its verification set is taken, too. Without the first folder
the command says what is there. tests/real_data.md says where the files are public.
"""

import argparse
import functools
import hashlib
import importlib.util
import os
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rso_lidar.errors import RsoLidarError
from rso_lidar.files import write_atomically

LIST = Path(__file__).with_suffix(".toml")
DEFAULT = Path(__file__).resolve().parents[1] / "real_data"
MOST_BYTES = 100_000_000  # no file that tests read is as large
MOST_NAMES = 8  # unknown files that are named
FLATTEST_M = 1e-9  # height of a facet without area: between the flattest kept, 4.5e-9, and the highest left out, 4e-10
STL = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])  # a facet of a binary STL file
WHERE = {
    "nasa": "NASA 3D Resources, 3D printing",
    "republished": "not to be had in this form; tests/real_data.md says why",
    "sgp4": "the Python package sgp4 and its source repository; the set of Vallado et al. 2006",
    "celestrak": "CelesTrak keeps no old catalogues; public copies are named in tests/real_data.md",
}
WAVEFORMS, RECORDINGS = "*_ftrr.zip", "pixset"  # of a PixSet recording: gigabytes, of which no sum is known


class DataError(RsoLidarError):
    """A folder or a file that cannot be used, in one line."""


@dataclass(frozen=True)
class Source:
    """A file from which another is made: a mesh in print units."""

    name: str
    bytes: int
    sha256: str
    units_per_metre: int
    helper_facets: int = 0


@dataclass(frozen=True)
class DataFile:
    """A file that tests read: where it lies, how it is known, where it is public, and what it may be made from."""

    path: str
    bytes: int
    sha256: str
    where: str
    source: Source | None = None


@functools.cache
def list_files():
    """Return all files that tests read from outside the repository."""
    entries = tomllib.loads(LIST.read_text(encoding="utf-8"))["file"]
    return tuple(DataFile(**{**e, "source": Source(**e["source"]) if "source" in e else None}) for e in entries)


def sha256_of(blob):
    return hashlib.sha256(blob).hexdigest()


def in_metres(blob, source):
    """Return a binary STL file in metres from one in print units.

    The helper cube at its beginning and facets without area are left out, and normals follow from the corners.
    """
    facets = np.frombuffer(blob, STL, int.from_bytes(blob[80:84], "little"), 84)
    corners = facets["corners"][source.helper_facets :].astype(np.float64) * (1.0 / source.units_per_metre)
    sides = np.diff(corners, axis=1)
    normal = np.cross(sides[:, 0], sides[:, 1])
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    kept = np.linalg.norm(normal, axis=1) > FLATTEST_M * longest
    made = np.zeros(int(kept.sum()), STL)
    made["normal"] = normal[kept] / np.sqrt((normal[kept] ** 2).sum(axis=1))[:, None]
    made["corners"] = corners[kept]
    return bytes(80) + len(made).to_bytes(4, "little") + made.tobytes()


def read_candidate(path):
    """Return the bytes of a file that may be one of those that are known; None for all others."""
    try:
        size = path.stat().st_size
        if size > MOST_BYTES or (size not in _sizes() and path.suffix.lower() not in _text_suffixes()):
            return None
        return path.read_bytes()
    except OSError as error:
        raise DataError(f"{path}: cannot be read ({error.strerror or error}); check its rights") from None


@functools.cache
def _sizes():
    return {each.bytes for each in list_files()} | {each.source.bytes for each in list_files() if each.source}


@functools.cache
def _text_suffixes():
    return {Path(each.path).suffix.lower() for each in list_files()} - {".stl", ".glb"}


@functools.cache
def _names():
    """Return the names under which files are published, in small letters."""
    published = {each.source.name for each in list_files() if each.source}
    return {name.lower() for name in published | {Path(each.path).name for each in list_files()}}


def is_regular(path):
    """Return whether a path is a regular file that can be looked at."""
    try:
        return path.is_file()
    except OSError:
        return False


def walk(folder):
    """Yield the regular files of a folder and its subfolders, in order; links to folders are not followed."""

    def refuse(error):
        raise DataError(f"{error.filename}: cannot be read ({error.strerror}); check its rights")

    for parent, folders, names in os.walk(folder, onerror=refuse):
        folders.sort()
        yield from filter(is_regular, (Path(parent, name) for name in sorted(names)))


def recognise(folders):
    """Return what the files of folders are good for, and the files that are not known.

    Returns
    -------
    dict : from the path of a file that tests read to its bytes and the file that they come from.
    list : files of a name that is known, with other contents.
    list : all other files.
    """
    found, other, unknown = {}, [], []
    for folder in folders:
        for path in walk(folder):
            uses = _uses_of(blob) if (blob := read_candidate(path)) is not None else {}
            for target, contents in uses.items():
                found.setdefault(target, (contents, path))
            if not uses:
                (other if path.name.lower() in _names() else unknown).append(path)
    return found, other, unknown


def _uses_of(blob):
    """Return the files that tests read and that follow from the bytes of one file, by path."""
    for contents in dict.fromkeys((blob, blob.replace(b"\r\n", b"\n"))):
        digest = sha256_of(contents)
        uses = {each.path: contents for each in list_files() if each.sha256 == digest}
        for each in list_files():
            if each.source is not None and each.source.sha256 == digest:
                made = in_metres(contents, each.source)
                if sha256_of(made) != each.sha256:
                    raise DataError(
                        f"{each.path}: the mesh made from {each.source.name} is not the known one; report this"
                    )
                uses[each.path] = made
        if uses:
            return uses
    return {}


def bring(folder, place):
    """Bring the known files of a folder to a place, and return the lines of the report and whether anything is damaged."""
    package = _sgp4_folder()
    folders = [*([folder] if folder else []), *([package] if package else [])]
    if folder is None and not place.is_dir():
        folders = folders[-1:]
    found, other, unknown = recognise(folders)
    if package is not None:
        other, unknown = ([path for path in paths if package not in path.parents] for paths in (other, unknown))
    before = {each.path: _state(place / each.path, each) for each in list_files()}
    lines, missing = [], []
    for each in list_files():
        if before[each.path] == "whole":
            lines.append(f"there     {each.path}")
        elif each.path in found:
            contents, path = found[each.path]
            _write(place / each.path, contents)
            made = ", in metres" if each.source and contents[:80] == bytes(80) and path.name == each.source.name else ""
            lines.append(f"placed    {each.path}  (from {path.name}{made})")
        elif before[each.path] == "damaged":
            lines.append(
                f"damaged   {place / each.path}: is not the file that tests know; bring it again, or remove it"
            )
        else:
            missing.append(each)
    wanted = {Path(each.path).name.lower() for each in missing}
    wanted |= {each.source.name.lower() for each in missing if each.source}
    for path in other:
        if path.name.lower() in wanted:
            size = path.stat().st_size
            lines.append(
                f"damaged   {path}: {size:,} bytes, not the file of this name that tests know; download it again"
            )
        else:
            unknown.append(path)
    lines += [f"missing   {each.path}  ({WHERE[each.where]})" for each in missing]
    lines += [f"unknown   {path}" for path in unknown[:MOST_NAMES]]
    if len(unknown) > MOST_NAMES:
        lines.append(f"unknown   {len(unknown) - MOST_NAMES:,} more files")
    return lines, found


def _sgp4_folder():
    spec = importlib.util.find_spec("sgp4")
    return Path(spec.origin).parent if spec and spec.origin else None


def _state(path, known):
    if not path.exists():
        return "missing"
    try:
        whole = path.stat().st_size == known.bytes and sha256_of(path.read_bytes()) == known.sha256
    except OSError as error:
        raise DataError(f"{path}: cannot be read ({error.strerror or error}); check its rights") from None
    return "whole" if whole else "damaged"


def describe_recording(folder, place):
    """Return a line about the recording of waveforms that tests compare: where it is, or how to get it."""
    if (place / RECORDINGS).is_dir() and any((place / RECORDINGS).glob(WAVEFORMS)):
        return f"recording {place / RECORDINGS}: is compared as it is"
    for path in walk(folder) if folder is not None else ():
        if path.match(WAVEFORMS):
            return f"recording {path}: is not copied; move or link it into {place / RECORDINGS}"
    return f"recording {RECORDINGS}/{WAVEFORMS}: missing (Leddar PixSet, by a form; tests/real_data.md says which)"


def _write(path, contents):
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with write_atomically(path) as draft:
            draft.write_bytes(contents)
    except OSError as error:
        raise DataError(
            f"{path}: cannot be written ({error.strerror or error}); choose another folder with --to"
        ) from None


class OneLineParser(argparse.ArgumentParser):
    """A parser whose errors are one line."""

    def error(self, message):
        raise DataError(f"{message}; usage: python -m tests.real_data [FOLDER] [--to FOLDER]")


def main(arguments):
    for stream in (sys.stdout, sys.stderr):
        stream.reconfigure(errors="backslashreplace")  # a name may hold letters that the terminal has not
    parser = OneLineParser(prog="python -m tests.real_data", description=__doc__.partition("\n\n")[0])
    parser.add_argument("folder", nargs="?", help="folder with what you downloaded, unpacked; subfolders are searched")
    parser.add_argument("--to", default=os.environ.get("RSO_LIDAR_SHARED") or DEFAULT, help="where tests look")
    try:
        given = parser.parse_args(arguments)
        folder = None if given.folder is None else Path(given.folder)
        place = Path(given.to)
        if given.folder is not None and not given.folder.strip():
            raise DataError("FOLDER: is empty; name the folder with what you downloaded")
        if not str(given.to).strip():
            raise DataError("--to: is empty; name the folder where tests look")
        if folder is not None and folder.is_file():
            raise DataError(f"{folder}: is a file; unpack it, and name the folder")
        if folder is not None and not folder.is_dir():
            raise DataError(f"{folder}: there is no such folder; name the one with what you downloaded")
        if place.exists() and not place.is_dir():
            raise DataError(f"{place}: is not a folder; name another with --to")
        lines, found = bring(folder, place)
        lines.append(describe_recording(folder, place))
    except OSError as error:  # a name too long, or a folder that may not be entered
        print(f"real data: {error.filename}: cannot be used ({error.strerror}); name another folder", file=sys.stderr)
        return 2
    except (RsoLidarError, ValueError) as error:  # ValueError: a path with a null character
        print(f"real data: {' '.join(str(error).split())}", file=sys.stderr)
        return 2
    try:
        print(*lines, sep="\n", flush=True)
    except OSError as error:  # a closed pipe or a full disk
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # Python flushes once more at its end
        print(f"real data: the report cannot be written ({error.strerror}); the files are in {place}", file=sys.stderr)
        return 2
    whole = sum(line.startswith(("there", "placed")) for line in lines)
    print(f"{whole} of {len(list_files())} files are in {place}")
    if any(line.startswith("damaged") for line in lines):
        return 2
    package = _sgp4_folder()
    mine = [path for _, path in found.values() if package is None or package not in path.parents]
    if folder is not None and not mine and folder.resolve() != place.resolve():
        print(f"real data: {folder}: holds no file that tests read; tests/real_data.md says which", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

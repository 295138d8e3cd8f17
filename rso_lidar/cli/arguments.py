"""Arguments and options that several commands share: files, settings, frames, lengths and instants."""

import datetime
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from rso_lidar import export, units
from rso_lidar.errors import RecordingError, RsoLidarError, ScenarioError, did_you_mean
from rso_lidar.picture import DARK, LIGHT, Scheme
from rso_lidar.processes import LOCAL
from rso_lidar.scenario import Constraints, Lidar, Scenario, load_presets, parse_frames, validate_toml
from rso_lidar.user_settings import get_setting

ScenarioFile = Annotated[Path, typer.Argument(metavar="FILE", help="Scenario file (TOML).")]
RecordingFile = Annotated[Path, typer.Argument(metavar="REC", help="Recording (.h5, .nc, or .zarr).")]
RecordedFrames = Annotated[
    str | None,
    typer.Option("--frames", metavar="A:B", help="Frames A to B-1 only, by number in the scenario; A:B:C by steps."),
]
Settings = Annotated[
    list[str] | None, typer.Option("--set", metavar="PLACE=VALUE", help="Set a field, as lidar.laser.energy_mj=20.")
]
TrustFmu = Annotated[
    bool, typer.Option("--trust-fmu", help="Run the native code of FMUs that the scenario names, because you trust it.")
]
TrustCode = Annotated[
    bool, typer.Option("--trust-code", help="Run the Python code that the scenario names, because you trust it.")
]
Seed = Annotated[int | None, typer.Option("--seed", min=0, help="Seed of all noise, instead of the file's.")]
Threads = Annotated[int | None, typer.Option("--threads", min=1, max=256, help="Threads; changes no result.")]
CameraName = Annotated[
    str,
    typer.Argument(
        metavar="FILE|PRESET",
        help="Scenario file (TOML), or a camera by name.",
        autocompletion=lambda: list(load_presets()),
    ),
]
Camera = Annotated[
    str,
    typer.Option(
        "--lidar",
        metavar="PRESET|FILE",
        help="Camera by name, or a scenario file with one.",
        autocompletion=lambda: list(load_presets()),
    ),
]
Workers = Annotated[
    int | None,
    typer.Option(
        "--workers",
        min=1,
        max=256,
        help="Processes that share the work instead of threads; changes no result. Pays in minutes of work on many cores.",
    ),
]
Engine = Annotated[
    str,
    typer.Option(
        "--engine", metavar="pool|dask", help="Who does the work: processes of this machine, or a cluster of dask."
    ),
]
Scheduler = Annotated[
    str | None,
    typer.Option("--scheduler", metavar="ADDRESS|local", help="Scheduler of dask; local starts one, with --workers."),
]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace an output that exists.")]
Dark = Annotated[bool, typer.Option("--dark", help="Draw on a dark background.")]

_TABLES = (".csv", ".json", ".ics", ".toml", ".oem", ".opm", ".aem", ".bsp", ".bc", ".czml")  # outputs without pictures
_LENGTHS_M = {"m": 1.0, "km": units.KM}


def join_settings(settings: list[str] | None, seed: int | None) -> tuple[str, ...]:
    """Return the settings of a scenario, with the seed of its option as the last one."""
    return (*(settings or ()), *(() if seed is None else (f"seed={seed}",)))


def choose_scheme(dark: bool, outputs: Iterable[Path | None] | None = None) -> Scheme:
    """Return the colours of pictures for the option ``--dark``; where none of the outputs is a picture, it is an error.

    A report (.html) and a folder (no suffix) hold pictures. None: the command always draws.
    """
    if dark and outputs is not None and not any(place and place.suffix.lower() not in _TABLES for place in outputs):
        raise ScenarioError("--dark: is for pictures; end the output with .png, or leave --dark out")
    return DARK if dark or get_setting("dark_pictures") else LIGHT


@contextmanager
def name_options(*arguments: str) -> Iterator[None]:
    """Let the messages of errors name the options of a command in place of the arguments of a function.

    Parameters
    ----------
    arguments : names with which messages may begin, such as ``target_size``, the option --target-size, and ``every_s``, the
        option --every
    """
    try:
        yield
    except ScenarioError as error:
        place, colon, rest = str(error).partition(":")
        argument, space, value = place.partition(" ")
        if not colon or argument not in arguments:
            raise
        raise ScenarioError(f"--{argument.removesuffix('_s').replace('_', '-')}{space}{value}:{rest}") from None


def parse_length_m(option: str, text: str) -> float:
    """Parse a length with its unit, such as ``50km``, and return it in metres."""
    match = re.fullmatch(r"\s*([0-9.eE+-]+)\s*([A-Za-z]*)\s*", text)
    try:
        number = float(match[1]) if match else float("nan")
    except ValueError:
        number = float("nan")
    if not match or not np.isfinite(number):
        raise ScenarioError(f"{option} {text}: is not a length; write for example 50km or 500m")
    if not match[2]:
        raise ScenarioError(f"{option} {text}: has no unit; write {text.strip()}km or {text.strip()}m")
    if match[2] not in _LENGTHS_M:
        raise ScenarioError(f"{option} {text}: unknown unit '{match[2]}' (known: {', '.join(_LENGTHS_M)})")
    return number * _LENGTHS_M[match[2]]


def parse_instant(option: str, text: str) -> datetime.datetime:
    """Parse a time with its UTC offset, in a year that element sets can have."""
    try:
        at = datetime.datetime.fromisoformat(text.strip())
    except ValueError:
        raise ScenarioError(f"{option} {text}: is not a time; write for example 2026-05-07T00:00:00Z") from None
    if at.tzinfo is None:
        raise ScenarioError(f"{option} {text}: a time without an offset is ambiguous; end it with Z or +00:00")
    if not 1957 <= at.year <= 2056:
        raise ScenarioError(f"{option} {text}: element sets are of 1957 to 2056; correct the year")
    return at.astimezone(datetime.UTC)


def select_frames(read: export.Recording, frames: str | None) -> list[int]:
    """Select frames of a recording by their numbers."""
    numbers = read.frame_index[:]
    if not numbers.size:
        raise RecordingError(f"{read.path}: holds no frames yet; run the scenario again")
    wanted = parse_frames(frames)
    if wanted is None:
        return list(range(numbers.size))
    places = np.flatnonzero(np.isin(numbers, np.arange(int(numbers.max()) + 1)[wanted])).tolist()
    if not places:
        held = f"{numbers.size} from {numbers.min()} to {numbers.max()}"
        raise RecordingError(f"--frames {frames}: {read.path.name} holds none of them, but {held}")
    return list(places)


def check_settings(settings: list[str] | None, files: Iterable[str | Path | None]) -> tuple[str, ...]:
    """Return the settings of the scenarios among some files; raise `ScenarioError` where there is none to set."""
    if settings and not any(file is not None and Path(file).suffix.lower() == ".toml" for file in files):
        raise ScenarioError(f"--set {settings[0]}: changes scenarios, and none of the files is one; leave it out")
    return tuple(settings or ())


def refuse_inputs(outputs: Iterable[Path | None], inputs: Iterable[str | Path | None]) -> None:
    """Raise `RecordingError` for an output that is also an input of the command, which --overwrite would destroy."""
    read = {Path(place).resolve() for place in inputs if place is not None and Path(place).is_file()}
    for place in outputs:
        if place is not None and place.resolve() in read:
            raise RecordingError(f"{place}: is an input of this command; give another name")


def load_lidar(text: str, settings: tuple[str, ...] = ()) -> tuple[Lidar, Constraints | None]:
    """Load the camera of that name, or the camera and the constraints of a scenario file.

    Parameters
    ----------
    settings : `key=value` of fields of a scenario
    """
    loaded = load_camera(text, () if text in load_presets() else settings, option="--lidar ")
    if isinstance(loaded, Scenario):
        return loaded.instrument, loaded.constraints
    return Lidar(preset=text), None  # type: ignore[call-arg]


def load_camera(
    text: str, settings: tuple[str, ...] = (), *, trust_code: bool = False, trust_fmu: bool = False, option: str = ""
) -> Lidar | Scenario | str:
    """Load a camera by name, or a scenario.

    Parameters
    ----------
    text, settings : name of a camera or path of a scenario, and `key=value` of fields
    trust_code, trust_fmu : as for `Scenario.load`
    option : before the text in an error

    Returns
    -------
    The name of a camera without settings, else a lidar or a scenario.
    """
    if text in load_presets():
        return validate_toml(Lidar, f'[lidar]\npreset = "{text}"', text, settings, table="lidar") if settings else text
    if Path(text).suffix.lower() == ".toml" or Path(text).exists():
        return Scenario.load(text, settings, trust_code=trust_code, trust_fmu=trust_fmu)
    raise ScenarioError(
        f"{option}{text}: no camera of that name{did_you_mean(text, load_presets())} (known: {', '.join(load_presets())}; "
        "or a scenario file)"
    )


def load_instrument(
    text: str, settings: tuple[str, ...] = (), *, trust_code: bool = False, trust_fmu: bool = False
) -> Lidar:
    """Load a camera by name, or the instrument of a scenario at its start.

    Parameters
    ----------
    text, settings : name of a camera or path of a scenario, and `key=value` of fields
    trust_code, trust_fmu : as for `Scenario.load`
    """
    loaded = load_camera(text, settings, trust_code=trust_code, trust_fmu=trust_fmu)
    if isinstance(loaded, str):
        return Lidar(preset=loaded)  # type: ignore[call-arg]
    return loaded.instrument if isinstance(loaded, Scenario) else loaded


def choose_scheduler(engine: str, scheduler: str | None, error: type[RsoLidarError] = ScenarioError) -> str | None:
    """Return the scheduler that the options of a command choose; None for a pool of processes without dask."""
    if engine not in ("pool", "dask"):
        raise error(f"--engine {engine}: is not an engine{did_you_mean(engine, ('pool', 'dask'))}; take pool or dask")
    if scheduler is not None and engine != "dask":
        raise error(f"--scheduler {scheduler}: is for --engine dask; add it, or leave out --scheduler")
    return (scheduler or LOCAL) if engine == "dask" else None

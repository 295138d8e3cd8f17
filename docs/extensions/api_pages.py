"""Pages of the API: one for each room, made from the names that it exports, and one that lists the names of `rl`."""

import importlib
import inspect
from pathlib import Path
from types import ModuleType

import rso_lidar as rl
from extensions.field_tables import escape
from rso_lidar.part import Part
from rso_lidar.records import Record

ROOMS = (  # in the order in which a reader needs them
    "simulation", "scenario", "records", "export", "orbit", "rpo", "motion", "sensors", "scene", "shapes", "optics",
    "detector", "imaging", "track", "study", "mission_analysis", "evaluation", "dataset", "dataset.torch", "loop", "fmi",
    "picture", "errors", "units",
)  # fmt: skip
FIRST = {  # names with which to begin, of rooms with many
    "records": ("Frame", "Observation", "Reading", "Labels", "Truth", "Command"),
    "export": ("open", "Recording", "save"),
    "study": ("budget", "timeline", "encounters", "trade", "tracking"),
    "track": ("Controller", "Pointing", "locate_centroid", "filter_positions", "PoseFollower"),
}
KINDS = ("Functions", "Parts", "Records", "Protocols", "Classes", "Exceptions and warnings", "Constants")


def exported(module: ModuleType) -> list[str]:
    """Return the names that a module exports: `__all__`, or its public names that it defines itself."""
    if names := getattr(module, "__all__", None):
        return list(names)
    defined = (
        (name, value)
        for name, value in vars(module).items()
        if not name.startswith("_") and not inspect.ismodule(value)
    )
    return [name for name, value in defined if getattr(value, "__module__", module.__name__) == module.__name__]


def kind_of(value: object) -> str:
    """Return under which heading of a page a name stands."""
    if not inspect.isclass(value):
        return "Functions" if callable(value) and hasattr(value, "__name__") else "Constants"
    if issubclass(value, BaseException):
        return "Exceptions and warnings"
    if getattr(value, "_is_protocol", False):
        return "Protocols"
    if issubclass(value, Part):
        return "Parts"
    return "Records" if issubclass(value, Record) else "Classes"


def home_of(room: str, name: str) -> str:
    """Return the room on whose page a name is explained: that of its module, if that exports it too, else `room`."""
    value = getattr(importlib.import_module(f"rso_lidar.{room}"), name)
    home = getattr(value, "__module__", "").removeprefix("rso_lidar.").partition(".")[0]
    if inspect.ismodule(value) or home not in ROOMS:
        return room
    return home if getattr(importlib.import_module(f"rso_lidar.{home}"), name, None) is value else room


def first_line(value: object) -> str:
    """Return the first sentence of a docstring."""
    documented = inspect.getdoc(value) or ""
    return escape(" ".join(documented.split("\n\n")[0].split()))


def heading(text: str, line: str) -> list[str]:
    """Return a heading in reStructuredText."""
    return [text, line * len(text), ""]


def room_page(room: str) -> str:
    """Return the page of one room: an overview, then each name with its whole docstring."""
    module = importlib.import_module(f"rso_lidar.{room}")
    path = f"rso_lidar.{room}"
    lines = [f".. _api-{room}:", "", *heading(f"rl.{room}", "=")]
    lines += [f".. py:module:: {path}", "", inspect.getdoc(module) or "", ""]
    if first := FIRST.get(room):
        lines += ["Begin with " + ", ".join(f":py:obj:`{name} <{path}.{name}>`" for name in first) + ".", ""]
    grouped: dict[str, list[str]] = {kind: [] for kind in KINDS}
    elsewhere = {name: home for name in exported(module) if (home := home_of(room, name)) != room}
    for name in exported(module):
        value = getattr(module, name)
        if not inspect.ismodule(value):
            grouped[kind_of(value)].append(name)
    for kind, names in grouped.items():
        if not names:
            continue
        lines += heading(kind, "-")
        if kind == "Constants":
            lines += constants(module, path, names)
            continue
        lines += [".. list-table::", "   :class: api-overview", "   :widths: 30 70", ""]
        for name in names:
            place = f"rso_lidar.{elsewhere.get(name, room)}.{name}"
            lines += [f"   * - :py:obj:`{name} <{place}>`", f"     - {first_line(getattr(module, name))}"]
        lines.append("")
        directive = "autofunction" if kind == "Functions" else "autoclass"
        for name in [name for name in names if name not in elsewhere]:
            lines += [f".. {directive}:: {path}.{name}"]
            if directive == "autoclass":
                lines += ["   :members:", "   :show-inheritance:"]
            lines.append("")
    return "\n".join(lines)


def constants(module: ModuleType, path: str, names: list[str]) -> list[str]:
    """Return the constants of a room with their values."""
    lines = []
    for name in names:
        value = repr(getattr(module, name))
        lines += [
            f".. py:data:: {path}.{name}",
            f"   :value: {value}" if len(value) < 80 else "   :no-index-entry:",
            "",
        ]
    return lines


def names_page() -> str:
    """Return the page of `rl` itself: which room holds each of its names."""
    lines = [*heading("API", "="), ".. py:module:: rso_lidar", "", inspect.getdoc(rl) or "", ""]
    lines += heading("Names of rl", "-")
    lines += [".. list-table::", "   :class: api-overview", "   :widths: 30 70", ""]
    for name in rl.__all__:
        value = getattr(rl, name)
        if inspect.ismodule(value):
            continue
        room = next(
            room for room in ROOMS if getattr(importlib.import_module(f"rso_lidar.{room}"), name, None) is value
        )
        lines += [f"   * - :py:obj:`rl.{name} <rso_lidar.{room}.{name}>`", f"     - {first_line(value)}"]
    lines += ["", *heading("Rooms", "-"), ".. toctree::", "   :maxdepth: 1", ""]
    return "\n".join([*lines, *(f"   {room}" for room in ROOMS), ""])


def write_pages(app):
    """Write the pages into docs/api, where Sphinx finds them; a page that has not changed is not touched."""
    folder = Path(app.srcdir) / "api"
    folder.mkdir(exist_ok=True)
    pages = {"index": names_page()} | {room: room_page(room) for room in ROOMS}
    for name, text in pages.items():
        file = folder / f"{name}.rst"
        if not file.exists() or file.read_text(encoding="utf-8") != text:
            file.write_text(text, encoding="utf-8")


def drop_generated_modules(app):
    """Leave out of the list of sources the modules that Python makes for named tuples: they have no file."""
    sources = getattr(app.env, "_viewcode_modules", {})
    for name in [name for name in sources if name.startswith("namedtuple_")]:
        del sources[name]
    return []


def setup(app):
    """Connect the writer to Sphinx."""
    app.connect("builder-inited", write_pages, priority=100)
    app.connect("html-collect-pages", drop_generated_modules, priority=100)  # before viewcode lists them
    return {"parallel_read_safe": True, "parallel_write_safe": True}

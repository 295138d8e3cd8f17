"""Write the parts of the pages in docs/ that the package itself states: ``python docs/generate.py [PAGE.md ...]``.

A page is written by hand but for what stands between ``<!-- generated: name -->`` and ``<!-- end of name -->``. Names,
types, limits, defaults and meanings of keys come from the parts, fields and meanings of records from their statements,
and the layout of a recording from a file that is laid out in memory.
"""

from __future__ import annotations

import ast
import dataclasses
import datetime
import importlib
import re
import sys
import tomllib
import types
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, get_args, get_origin

import numpy as np

import rso_lidar as rl
from models.build.materials import MATERIALS
from models.build.measured import MEASUREMENTS, SOLAR, preset_reflectance
from rso_lidar import part, records
from rso_lidar.dataset.shards.layout import LabelledFrame, LabelledImage
from rso_lidar.dataset.specification.distributions import Law
from rso_lidar.detector.analysis.false_alarms import mean_false_alarms_per_s
from rso_lidar.evaluation import CurvesFile
from rso_lidar.export.writer import hdf5_layout
from rso_lidar.loop.service.requests import REQUESTS, CommandRequest
from rso_lidar.mission_analysis import list_materials
from rso_lidar.part import describe_type
from rso_lidar.records import PART_CLASSES
from rso_lidar.scenario import load_presets
from rso_lidar.study import Requirements, Study, Targeter
from rso_lidar.study.targeting.flight_quantities import QUANTITIES
from rso_lidar.study.trades.merits import MERITS

DOCS = Path(__file__).resolve().parent
LAWS = get_args(get_args(Law)[0])
EXAMPLE = DOCS.parent / "examples" / "tdrs_approach.toml"

ATTRIBUTES = {  # what each attribute of a recording means
    "Conventions": "the CF conventions that the file follows",
    "title": "the scenario's `name`",
    "history": "which program made the file; CF asks for it",
    "schema_version": "of this layout",
    "rso_lidar_version": "that wrote it",
    "versions": "JSON: versions of Python and of the libraries, and the `arithmetic`: numba and the packets of rays",
    "scenario": "the scenario as TOML, every default written out, element sets inline; `Scenario.loads` reads it",
    "seed": "of all noise",
    "start_utc": "ISO 8601",
    "texts_crc32": "CRC-32 of the texts that `rl.open` takes from `/` and `/truth`, for HDF5 has no checksum of texts",
    "targets": "JSON list: name, model, mesh SHA-256, parts, part classes, materials and facets; labels are places in it",
    "quaternion_order": "always `xyzw`",
    "axes": "what the axes are, in words",
    "tree": "JSON: the parent of each node of the tree of axes",
    "states": "JSON list: the bodies that have an inertial state",
    "parent": "name of the parent axes",
    "optional_datasets": "JSON list: the datasets that this recording has beside those of every recording",
}

# Parts whose numbers physics.md lists with their sources: what follows "Default:" in the description of a field.
SOURCED = (
    rl.Laser, rl.Receiver, rl.Lambertian, rl.Empirical, rl.GeigerArray, rl.Gsfl, rl.detector.Apd, rl.detector.Amplifier,
    rl.detector.Trigger, rl.detector.Readout, rl.detector.Ranging, rl.detector.Timing,
)  # fmt: skip
SAID_BY_KEY = {  # types of fields that take what pydantic has no word for
    ("Axis", "field"): "place, or list of places",
    ("Axis", "values"): "list; of several fields, lists of one value for each",
    ("Study", "frames"): 'text `"from:end:step"`, or list of whole numbers',
    ("Requirement", "frames"): 'text `"from:end:step"`, or list of whole numbers',
}


def pages(*names: str) -> dict[Path, str]:
    """Return the text that generated pages should have, by path.

    Parameters
    ----------
    names : of pages, such as ``glossary.md``; all without any.
    """
    makers: dict[str, dict[str, Callable[[], str]]] = {
        "scenario.md": {"keys": scenario_keys},
        "records.md": {"records": record_tables, "layout": file_layout},
        "physics.md": {"budget": budget, "detection": detection, "defaults": defaults},
        "instrument.md": {"constants": constants, "presets": presets},
        "sensors.md": {"presets": sensor_presets},
        "orbits.md": {"rotations": spin_presets, "flown plans": flown_plans},
        "studies.md": {"merits": merits, "study keys": study_keys},
        "requirements.md": {"requirement keys": requirement_keys},
        "targeting.md": {"targeter keys": targeter_keys, "quantities": quantities},
        "camera_fit.md": {"curve keys": curve_keys},
        "protocol.md": {"requests": request_keys},
        "datasets.md": {"arrays": shard_arrays, "arrays of cameras": image_arrays, "spec keys": dataset_keys},
        "glossary.md": {"classes": classes},
        "architecture.md": {"floors": floors, "rooms": rooms},
        "calibration.md": {"measured": measured_materials, "spectra": material_spectra},
        "models.md": {
            "part classes": part_classes,
            "symmetries": symmetries,
            "models": shipped_models,
            "sources": model_sources,
            "materials": shipped_materials,
        },
    }
    if unknown := sorted(set(names) - set(makers)):
        raise ValueError(f"'{unknown[0]}': no page of this name is generated; give {', '.join(makers)}")
    wanted = {name: makers[name] for name in names or makers}
    return {
        DOCS / name: _filled(DOCS / name, {block: make() for block, make in blocks.items()})
        for name, blocks in wanted.items()
    }


def _filled(page: Path, blocks: dict[str, str]) -> str:
    text = page.read_text(encoding="utf-8")
    for name, block in blocks.items():
        begin, end = f"<!-- generated: {name} -->", f"<!-- end of {name} -->"
        if text.count(begin) != 1 or text.count(end) != 1:
            raise SystemExit(f"{page.name}: needs exactly one '{begin}' and one '{end}' after it")
        head, _, rest = text.partition(begin)
        _, _, tail = rest.partition(end)
        text = f"{head}{begin}\n\n{block.strip()}\n\n{end}{tail}"
    return text


def _table(header: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> str:
    lines = [header, tuple("---" for _ in header), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)


def _prose(documented: Any) -> str:
    """Return a docstring as Markdown paragraphs; the lines of an example are left out."""
    paragraphs = (" ".join(block.split()) for block in (documented.__doc__ or "").split("\n\n"))
    return "\n\n".join(block.replace("``", "`") for block in paragraphs if block and not block.startswith(">>>"))


# ------------------------------------------------------------------------------------------------- scenario.md


@dataclasses.dataclass
class Section:
    """One part of a scenario: heading, level, every place in the file where it may stand, and whether others may too."""

    title: str
    level: int
    places: list[str]
    chosen: bool


def sections() -> dict[type[part.Part], Section]:
    """Return a section for each part that a scenario file can hold, in the order in which one meets them."""
    found: dict[type[part.Part], Section] = {rl.Scenario: Section("the file", 3, [], False)}
    _collect(rl.Scenario, "", 3, found)
    return found


def _collect(cls: type[part.Part], place: str, level: int, found: dict[type[part.Part], Section]) -> None:
    for name, field in cls.model_fields.items():
        allowed, origin = _parts(field.annotation), get_origin(field.annotation)
        inner = f"{place}.{name}" if place else name
        inner += ".<part>" if origin is dict else ""
        for each in allowed:
            tag = each.model_fields.get("type")
            kind = "law" if each in LAWS else name  # one law may draw many fields
            title = f"{kind}: {tag.default}" if tag else name
            section = found.setdefault(each, Section(title, level, [], len(allowed) > 1))
            section.places.append(f"[[{inner}]]" if origin is tuple else f"[{inner}]")
            _collect(each, inner, 4, found)


def _parts(annotation: Any) -> list[type[part.Part]]:
    """Return the parts that an annotation allows."""
    if isinstance(annotation, type) and not isinstance(annotation, types.GenericAlias):
        return [annotation] if issubclass(annotation, part.Part) else []
    return [cls for inner in get_args(annotation) for cls in _parts(inner)]


def scenario_keys() -> str:
    """Return a section with a table of keys for each part of a scenario."""
    return _key_tables(sections())


def _key_tables(found: dict[type[part.Part], Section]) -> str:
    lines = []
    for cls, section in found.items():
        lines += [f"{'#' * section.level} {section.title}", ""]
        if section.places:
            lines += [
                "Place in the file: " + ", ".join(dict.fromkeys(f"`{place}`" for place in section.places)) + ".",
                "",
            ]
        lines += [_prose(cls), ""]
        preset_keys = _preset_keys(cls)
        rows = [
            (
                f"`{name}`",
                _type(name, field, cls, found),
                _default(name, field, section, preset_keys),
                field.description or "",
            )
            for name, field in sorted(cls.model_fields.items(), key=lambda item: item[0] != "type")
        ]
        lines += [_table(("key", "type", "default", "meaning"), rows), ""]
    return "\n".join(lines)


def _type(name: str, field: Any, cls: type[part.Part], found: dict[type[part.Part], Section]) -> str:
    if said := SAID_BY_KEY.get((cls.__name__, name)):
        return said
    parts = _parts(field.annotation)
    if parts:
        links = ", ".join(f"[{_word(each)}](#{_anchor(found[each].title)})" for each in parts)
        origin = get_origin(field.annotation)
        if origin is dict:
            return f"table of part name = {links}"
        return f"list of tables: {links}" if origin is tuple else f"table: {links}"
    return describe_type(field.annotation, list(field.metadata))


def describe_field(cls: type[part.Part], name: str) -> str:
    """Return the type and the default of a field in words, for the page of the API."""
    field = cls.model_fields[name]
    parts = _parts(field.annotation)
    if said := SAID_BY_KEY.get((cls.__name__, name)):
        words = said.replace("`", "")
    elif parts:
        words = " or ".join(each.__name__ for each in parts)
    else:
        words = describe_type(field.annotation, list(field.metadata)).replace("`", "")
    if field.is_required():
        return words
    default = field.get_default(call_default_factory=True)
    if default is None or default in ((), {}):
        return f"{words}, optional"
    return (
        f"{words}, default {type(default).__name__}"
        if isinstance(default, part.Part)
        else f"{words}, default {default!r}"
    )


def _word(cls: type[part.Part]) -> str:
    tag = cls.model_fields.get("type")
    return f"`{tag.default}`" if tag else cls.__name__


def _anchor(title: str) -> str:
    return re.sub(r"[^a-z0-9 _-]", "", title.lower()).replace(" ", "-")


def _preset_keys(cls: type[part.Part]) -> set[str]:
    """Return the keys that the shipped presets of a part fill."""
    if "preset" not in cls.model_fields:
        return set()
    kind = cls.model_fields["type"].default if "type" in cls.model_fields else None
    presets = load_presets() if kind is None else rl.sensors.load_sensor_presets() | rl.motion.load_spin_presets()
    return {key for preset in presets.values() if preset.get("type") == kind for key in preset} - {"type"}


def _default(name: str, field: Any, section: Section, preset_keys: set[str]) -> str:
    if field.is_required() and name in preset_keys:
        return "**required**, unless `preset` has it"
    if field.is_required() or (name == "type" and section.chosen):
        return "**required**"
    default = field.get_default(call_default_factory=True)
    if default is None or default in ((), {}):
        return "none"
    if isinstance(default, part.Part):
        tag = getattr(default, "type", None)
        if tag is None:
            return "its defaults"
        table = {"type": tag} | default.model_dump(exclude_defaults=True)  # defaults of the part are in its own table
        return f"`{{ {', '.join(f'{key} = {_toml(value)}' for key, value in table.items())} }}`"
    return f"`{_toml(default)}`"


def _toml(value: Any) -> str:
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple):
        return "[" + ", ".join(_toml(inner) for inner in value) + "]"
    return f"{value:g}" if isinstance(value, float) else str(value)


# ------------------------------------------------------------------------------------------------- studies.md


def _study_sections() -> dict[type[part.Part], Section]:
    found: dict[type[part.Part], Section] = {Study: Section("the study file", 4, [], False)}
    _collect(Study, "", 4, found)
    return found


def study_keys() -> str:
    """Return a section with a table of keys for each part of a trade study."""
    return _key_tables(_study_sections())


def _requirement_sections() -> dict[type[part.Part], Section]:
    found: dict[type[part.Part], Section] = {Requirements: Section("the requirements file", 3, [], False)}
    _collect(Requirements, "", 3, found)
    return found


def requirement_keys() -> str:
    """Return a section with a table of keys for each part of a requirements file."""
    return _key_tables(_requirement_sections())


def _targeter_sections() -> dict[type[part.Part], Section]:
    found: dict[type[part.Part], Section] = {Targeter: Section("the targeter file", 3, [], False)}
    _collect(Targeter, "", 3, found)
    return found


def targeter_keys() -> str:
    """Return a section with a table of keys for each part of a targeter file."""
    return _key_tables(_targeter_sections())


def quantities() -> str:
    """Return what each quantity of a targeter is."""
    return _table(
        ("quantity", "unit", "what it is"), [(f"`{name}`", row.unit, row.meaning) for name, row in QUANTITIES.items()]
    )


def curve_keys() -> str:
    """Return a section with a table of keys for each part of a curves file."""
    found: dict[type[part.Part], Section] = {CurvesFile: Section("the curves file", 3, [], False)}
    _collect(CurvesFile, "", 3, found)
    return _key_tables(found)


def request_keys() -> str:
    """Return a section with a table of keys for each request of flight software."""
    made: dict[type[part.Part], Section] = {cls: Section(kind, 3, [], False) for kind, cls in REQUESTS.items()}
    return _key_tables(made | {CommandRequest: Section("command", 3, [], False)})


def merits() -> str:
    """Return what each figure of merit of a trade is."""
    rows = [(f"`{merit.name}`", merit.unit, merit.better, merit.needs, merit.meaning) for merit in MERITS.values()]
    return _table(("figure of merit", "unit", "better", "needs", "what it is"), rows)


# ------------------------------------------------------------------------------------------------- datasets.md


def dataset_keys() -> str:
    """Return a section with a table of keys for each part of the specification of a dataset."""
    found: dict[type[part.Part], Section] = {rl.dataset.DatasetSpec: Section("the dataset file", 3, [], False)}
    _collect(rl.dataset.DatasetSpec, "", 4, found)
    return _key_tables(found)


def shard_arrays() -> str:
    """Return the table of the arrays of a shard."""
    return _array_table(LabelledFrame, "frame")


def image_arrays() -> str:
    """Return the table of the arrays of a shard that hold images of a camera."""
    return _array_table(LabelledImage, "frame")


# -------------------------------------------------------------------------------------------------- records.md


def record_tables() -> str:
    """Return a section for each record, with a table of its arrays as they are stated, in the order of the walk."""
    lines = []
    rooms = ("truth", "light", "reading", "telemetry", "frame")
    modules = [importlib.import_module(f"{records.__name__}.{room}") for room in rooms]
    own = [value for module in modules for value in vars(module).values() if _is_own_dataclass(value, module)]
    for cls in own:
        lines += [f"### {cls.__name__}", "", _prose(cls), ""]
        arrays = records.specs(cls)
        if arrays:
            lines += [_array_table(cls), ""]
        others = [f"`{field.name}`: {field.type}" for field in dataclasses.fields(cls) if field.name not in arrays]
        if others:
            lines += [("Also " if arrays else "Fields: ") + "; ".join(others) + ".", ""]
        lines += _derived(cls)
    return "\n".join(lines)


def _array_table(cls: type, *first: str) -> str:
    """Return the table of a record's arrays, as they are stated, with further dimensions before their own."""
    rows = [
        (f"`{name}`", f"({', '.join((*first, *spec.dims))})", spec.dtype.str[1:], spec.unit, spec.meaning)
        for name, spec in records.specs(cls).items()
    ]
    return _table(("array", "dims", "dtype", "unit", "meaning"), rows)


def _is_own_dataclass(value: object, module: types.ModuleType) -> bool:
    """Return whether a value is a dataclass that a module defines itself."""
    return isinstance(value, type) and dataclasses.is_dataclass(value) and value.__module__ == module.__name__


def _derived(cls: type) -> list[str]:
    """Return rows for the properties and methods of a record, from the first lines of their docstrings."""
    rows = []
    for name, member in vars(cls).items():
        inner = getattr(member, "fget", None) or getattr(member, "func", None)
        call = isinstance(member, types.FunctionType) and not name.startswith("_")
        if (inner or call) and not name.startswith("_"):
            first = " ".join(((inner or member).__doc__ or "").split("\n\n")[0].split())
            taken = member.__code__.co_varnames[1 : member.__code__.co_argcount] if call else ()
            given = f"({', '.join(taken)})" if call else ""
            rows.append((f"`{name}{given}`", first.removeprefix("Return ").removesuffix(".")))
    return [_table(("derived", "what it is"), rows), ""] if rows else []


def file_layout() -> str:
    """Return tables of the attributes and datasets of a recording of the example, laid out in memory."""
    import h5py

    frame = next(rl.simulate(rl.Scenario.load(EXAMPLE), frames=[0], threads=1))
    with h5py.File("layout", "w", driver="core", backing_store=False, libver="v110") as file:
        hdf5_layout.lay_out(file, frame.source, frame)
        attributes = dict.fromkeys(file.attrs, "/")
        datasets: list[tuple[str, ...]] = []
        node = next(iter(frame.truth.states))

        def visit(path: str, place: Any) -> None:
            general = path.replace(f"truth/{node}", "truth/<name>")
            if general.startswith("truth/") and general.split("/")[1] not in ("<name>", "sun_direction"):
                return  # the same again for the next node
            if isinstance(place, h5py.Dataset):
                datasets.append(_dataset_row(general, place))
            else:
                attributes.update({f"{general}: {name}": f"/{general}" for name in place.attrs})

        file.visititems(visit)
        if set(ATTRIBUTES) != {key.partition(": ")[2] or key for key in attributes}:
            raise SystemExit(f"generate.py: ATTRIBUTES must be those of a recording: {', '.join(attributes)}")
    rows = [
        (f"`{where}`", f"`{name}`", ATTRIBUTES[name])
        for key, where in attributes.items()
        for name in [key.partition(": ")[2] or key]
    ]
    header = ("dataset", "dims", "dtype", "units", "_FillValue", "chunk", "long_name")
    datasets.sort(key=lambda row: (row[0].count("/"), row[0]))
    return f"{_table(('at', 'attribute', 'meaning'), rows)}\n\n{_table(header, datasets)}"


def _dataset_row(path: str, dataset: Any) -> tuple[str, ...]:
    scales = [dim[0].name.lstrip("/") for dim in dataset.dims if len(dim)] or [path]
    fill = dataset.attrs.get("_FillValue")
    grows = dataset.maxshape[0] is None
    chunk = f"{dataset.chunks[0]} frame{'s' * (dataset.chunks[0] > 1)}" if grows else "all"
    packed = ", gzip" if dataset.compression else ""
    units = dataset.attrs.get("units", "")
    units = re.sub(r"since .*", "since start_utc", units)
    said = dataset.attrs["long_name"]
    return (
        f"`/{path}`", f"({', '.join(scales)})", dataset.dtype.str[1:], units,
        "" if fill is None else f"{fill[0]}".replace("nan", "NaN"), chunk + packed, said,
    )  # fmt: skip


# -------------------------------------------------------------------------------------------------- physics.md


def budget() -> str:
    """Return what the system of Fuller et al., sec. 5, gets back by eq. 7, as printed and with the factor 4."""
    rows = []
    for transmission in (0.5, 0.6, 0.67, 0.7, 0.8, 0.9, 1.0):
        receiver = rl.Receiver(fov_deg=2.5, f_number=2.8, transmission=transmission)
        gathered = receiver.pixel_tangent**2 * receiver.aperture_area_m2 * transmission
        brdf = float(rl.Lambertian(reflectance=0.3).brdf_per_sr(np.array(1.0)))
        cells = [f"{transmission:g}"]
        for footprint in ("as_printed", "square"):
            density = float(rl.Laser(footprint=footprint).density(np.array(0.0), np.array(0.0)))
            photons_m2 = density * gathered * brdf
            cells += [f"{photons_m2 / 3000.0**2:,.0f}", f"{(photons_m2 / 1000.0) ** 0.5 / 1e3:.2f} km"]
        rows.append((cells[0], cells[1], cells[3], cells[2], cells[4]))
    header = (
        "η",
        "photons at 3 km, as printed",
        "photons at 3 km, with the 4",
        "1000 photons at, as printed",
        "with the 4",
    )
    return _table(header, rows)


def detection() -> str:
    """Return detection, range noise and counts of the empirical detector over photons."""
    detector, fwhm_s = rl.Empirical(), rl.Laser().pulse_fwhm_s
    rows = []
    for photons in (300, 500, 700, 800, 900, 1000, 1200, 3000, 10_000, 100_000):
        n = np.array(float(photons))
        found, noise_m = float(detector.detection_probability(n)), float(detector.range_noise_m(n, fwhm_s))
        rows.append((f"{photons:,}", f"{found:.3f}", f"{noise_m * 100:.1f} cm", f"{float(detector.counts(n)):,.0f}"))
    return _table(("photons", "P(detect)", "range noise", "counts"), rows)


# ------------------------------------------------------------------------------------------------ orbits.md


def flown_plans() -> str:
    """Return how far plans end off under real forces: blindly, and corrected with less and more knowledge."""
    rows = []
    for name, plan, height_km, eccentricity in _flown_cases():
        chief = rl.Kepler(
            epoch_utc=datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC), semi_major_axis_km=6378.137 + height_km,
            eccentricity=eccentricity, inclination_deg=51.6 if height_km < 3e4 else 0.05, raan_deg=40.0,
            argument_of_perigee_deg=15.0, true_anomaly_deg=30.0,
        )  # fmt: skip
        duration_s = plan.plan(chief.epoch_utc, chief).duration_s
        times_s = [one.time_s for one in plan.plan(chief.epoch_utc, chief).impulses]
        arcs_s = list(pairwise(times_s)) or [(0.0, duration_s)]
        often: dict[str, Any] = {"at_s": tuple(begin_s + 0.4 * (end_s - begin_s) for begin_s, end_s in arcs_s)}
        if (
            plan.plan(chief.epoch_utc, chief).continuous_delta_v_m_s > 0.0
        ):  # a path held by thrust, led back again and again
            often = {"every_s": duration_s / 20.0}
        ways = (
            None,
            rl.rpo.TwoImpulseGuidance(model="clohessy_wiltshire", **often),
            rl.rpo.TwoImpulseGuidance(forces=rl.orbit.Forces(), **often),
            rl.rpo.TwoImpulseGuidance(**often),
        )
        misses = []
        for guidance in ways:
            flown = rl.rpo.Flown(plan=plan, forces=_REAL, guidance=guidance).fly(chief.epoch_utc, chief)
            misses.append(_two_digits(float(np.linalg.norm(flown.find_miss_m()))))
        rows.append((name, f"{height_km:,.0f} km, {eccentricity:g}", *misses))
    header = (
        "plan",
        "height, eccentricity",
        "off the plan at its end",
        "corrected, by Clohessy–Wiltshire",
        "corrected, with J2 known",
        "corrected, with all forces known",
    )
    return _table(header, rows)


def _two_digits(length_m: float) -> str:
    """Format a length with two digits."""
    if length_m < 1e-3:
        return "below 1 mm"
    return f"{float(f'{length_m:.2g}'):,g} m"


_REAL = rl.orbit.Forces(
    zonal_degree=6,
    drag=rl.orbit.Drag(area_m2=4.0, mass_kg=200.0),
    radiation_pressure=rl.orbit.RadiationPressure(area_m2=4.0, mass_kg=200.0),
    sun=True,
    moon=True,
)


def _flown_cases() -> list[tuple[str, Any, float, float]]:
    """Return plans with their names, and height [km] and eccentricity of the body that they approach."""
    way: dict[str, Any] = {"relative_to": "body", "from_m": (0.0, -5000.0, 0.0), "to_m": (0.0, -300.0, 0.0)}
    waypoints = ((0.0, -3000.0, 0.0), (-200.0, -1500.0, 100.0), (0.0, -500.0, 0.0))
    return [
        ("hop of 4.7 km in 45 min", rl.rpo.Hop(duration_s=2700.0, **way), 500.0, 0.001),
        ("hop of 4.7 km in a revolution", rl.rpo.Hop(duration_s=5677.0, **way), 500.0, 0.001),
        ("hop of 4.7 km in 45 min", rl.rpo.Hop(duration_s=2700.0, **way), 2000.0, 0.1),
        ("hop of 4.7 km in 11 h", rl.rpo.Hop(duration_s=39_600.0, **way), 35_786.0, 0.0005),
        ("hop of 4.7 km in a revolution", rl.rpo.Hop(duration_s=86_164.0, **way), 35_786.0, 0.0005),
        ("Lambert, 4.7 km in 45 min", rl.rpo.Lambert(duration_s=2700.0, **way), 500.0, 0.001),
        (
            "two arcs through waypoints, 2.5 km in 50 min",
            rl.rpo.Waypoints(relative_to="body", positions_m=waypoints, times_s=(0.0, 1500.0, 3000.0)),
            500.0,
            0.001,
        ),
        ("circumnavigation, 100 m by 200 m", rl.rpo.Circumnavigation(relative_to="body", radial_m=100.0), 500.0, 0.001),
        (
            "V-bar approach, held, 900 m in 50 min",
            rl.rpo.VBarApproach(relative_to="body", from_m=-1000.0, to_m=-100.0, duration_s=3000.0),
            500.0,
            0.001,
        ),
        (
            "forced circle of 100 m in 30 min",
            rl.rpo.ForcedCircumnavigation(relative_to="body", radius_m=100.0, period_s=1800.0),
            500.0,
            0.001,
        ),
    ]


def defaults() -> str:
    """Return every number that a scenario may leave out of the instrument, and where it comes from."""
    rows = []
    for cls in SOURCED:
        for key, field in cls.model_fields.items():
            if key == "type" or not _is_a_value(field):
                continue
            _, found, source = (field.description or "").partition("Default: ")
            if not found:
                raise SystemExit(
                    f"{cls.__name__}.{key}: its description must say 'Default: ' and where the default is from"
                )
            rows.append((f"`{cls.__name__}.{key}`", f"`{_toml(field.default)}`", re.sub(r"(?<!et al)\.$", "", source)))
    return _table(("default", "value", "where it comes from"), rows)


# ------------------------------------------------------------------------------------------------ instrument.md


def constants() -> str:
    """Return the solved constants of the detector's presets, and what follows from them."""
    rows = []
    laser = rl.Laser(pulse_fwhm_ns=8.0)  # of the calibration
    pulse = rl.detector.LaserPulse(*laser.pulse, laser.pulse_fwhm_s)
    for preset in ("noise_limited", "offset_limited"):
        detector = rl.Gsfl(preset=preset)
        rows.append(
            (
                f"`{preset}`",
                f"{detector.amplifier.noise_electrons:,.0f}",
                f"{detector.noise_electrons:,.0f}",
                f"{detector.trigger.threshold_electrons:,.0f}",
                *(f"{photons:,.0f}" for photons in rl.detector.find_photons(detector, pulse, np.array([0.5, 0.95]))),
                f"{detector.threshold_over_noise:.1f}",
                _rate(mean_false_alarms_per_s(detector)),
            )
        )
    header = (
        "preset",
        "amplifier noise [electrons]",
        "with dark current [electrons]",
        "threshold [electrons]",
        "detected at 50 % [photons]",
        "detected at 95 % [photons]",
        "threshold / noise",
        "false alarms [1/s]",
    )
    return _table(header, rows)


def _rate(per_s: float) -> str:
    return f"{per_s:.1f}" if per_s > 0.05 else "below 0.05" if per_s > 0.0 else "none"


def presets() -> str:
    """Return the shipped cameras by name, with what in them is sourced and what assumed."""
    rows = [(f"`{name}`", " ".join(table["what"].split())) for name, table in load_presets().items()]
    return _table(("`[lidar] preset`", "what it is"), rows)


def spin_presets() -> str:
    """Return the rotations of real objects by name, with what in them is sourced and what assumed."""
    shipped = rl.motion.load_spin_presets()
    rows = [
        (f"`{name}`", f"{table['rate_deg_s']:g}", " ".join(table["what"].split())) for name, table in shipped.items()
    ]
    return _table(("`preset`", "deg/s", "what it is"), rows)


def sensor_presets() -> str:
    """Return the shipped sensors by name, with what in them is sourced and what assumed."""
    shipped = rl.sensors.load_sensor_presets()
    rows = [(f"`{name}`", f"`{table['type']}`", " ".join(table["what"].split())) for name, table in shipped.items()]
    return _table(("`preset`", "`type`", "what it is"), rows)


def part_classes() -> str:
    """Return the table of common part classes, with the number of shipped models that have parts of each."""
    rows = ["| number | class | meaning | models |", "| ---: | --- | --- | ---: |"]
    for number, (name, meaning) in enumerate(PART_CLASSES.items()):
        count = sum(name in entry.part_classes.values() for entry in rl.scene.library.models().values())
        rows.append(f"| {number} | `{name}` | {meaning} | {count} |")
    return "\n".join(rows)


def symmetries() -> str:
    """Return the symmetries of the shipped models, and how far their meshes are from them."""
    rows = []
    for name, entry in rl.scene.library.models().items():
        if entry.symmetry is not None:
            found = rl.scene.measure_symmetry(entry.mesh, entry.symmetry)
            lengths = (found.mean_m, found.most_m, found.nearly_all_m, found.limit_m)
            rows.append((f"`{name}`", entry.symmetry.in_words, *(f"{100.0 * length:.1f}" for length in lengths)))
    return _table(("model", "symmetry", "mean [cm]", "90 % within [cm]", "99 % within [cm]", "limit [cm]"), rows)


def shipped_models() -> str:
    """Return the models by class: what each is, its place in the taxonomy, size, facets and how it turns."""
    rows = []
    for name, entry in rl.scene.library.models().items():
        of = entry.taxonomy
        low, high = of.rate_deg_s
        turns = of.stabilisation.replace("_", " ") + (f", {low:g} to {high:g}" if high else "")
        size = " × ".join(f"{side:.3g}" for side in entry.size_m)
        rows.append(
            (
                f"`{name}`",
                entry.what,
                f"{of.object_class}, {of.shape_family}, {of.size_class}",
                size,
                turns,
                f"{entry.facets:,}",
            )
        )
    return _table(("model", "what it is", "class, shape, size class", "size [m]", "turns [deg/s]", "facets"), rows)


def measured_materials() -> str:
    """Return measured reflectances of materials, and how far the presets are from them."""
    lines = ["| preset | light | measured | preset | difference | what was measured | source |"]
    lines += ["| --- | --- | ---: | ---: | ---: | --- | --- |"]
    for one in MEASUREMENTS:
        light = "solar" if one.wavelength_nm == SOLAR else f"{one.wavelength_nm:.0f} nm"
        preset = preset_reflectance(MATERIALS[one.material], one.wavelength_nm)
        values = f"{one.reflectance:.2f} ± {one.uncertainty:.2g} | {preset:.2f} | {preset - one.reflectance:+.2f}"
        lines.append(f"| `{one.material}` | {light} | {values} | {one.sample} | {one.source} |")
    return "\n".join(lines)


def material_spectra() -> str:
    """Return the reflectances of the presets below 1064 nm, and where they come from."""
    bands_nm = (460.0, 535.0, 575.0, 625.0, 850.0, 1064.0)
    rows = []
    for name, table in MATERIALS.items():
        if (below := table.get("below_1064_nm")) and not name.endswith("_crinkled"):
            shares = (f"{preset_reflectance(table, nm):.2g}" for nm in bands_nm)
            rows.append((f"`{name}`", *shares, below["confidence"], below["source"]))
    return _table(("preset", *(f"{nm:.0f} nm" for nm in bands_nm), "confidence", "source"), rows)


def shipped_materials() -> str:
    """Return the materials: what each is, its kind of BRDF, reflectance, and how well that is known."""
    rows = [
        (
            f"`{line.name}`",
            line.what,
            line.kind,
            *(f"{share:.3g}" for share in line.reflectance.values()),
            line.confidence,
        )
        for line in list_materials()
    ]
    return _table(
        ("material", "what it is", "BRDF", *(f"{nm:g} nm" for nm in list_materials()[0].reflectance), "confidence"),
        rows,
    )


def model_sources() -> str:
    """Return where the figures of each model come from, what of it is a guess, and its axes."""
    told = []
    for name, entry in rl.scene.library.models().items():
        hinges = "; ".join(f"`{hinge.name}` turns {', '.join(f'`{p}`' for p in hinge.parts)}" for hinge in entry.hinges)
        told.append(
            f"- **`{name}`**. Axes: {entry.axes}. Estimated mass {entry.mass_kg:,.4g} kg. "
            + (f"Hinges: {hinges}. " if hinges else "")
            + f"*Source:* {entry.source.removesuffix('.')}. *Confidence:* {entry.confidence.removesuffix('.')}."
        )
    return "\n".join(told)


# ------------------------------------------------------------------------------------------------- glossary.md


def classes() -> str:
    """Return every public class of the package with the first line of its docstring."""
    package = DOCS.parent / "rso_lidar"
    rows = []
    for file in package.rglob("*.py"):
        module = ".".join(file.relative_to(package).with_suffix("").parts).removesuffix(".__init__")
        for node in ast.parse(file.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                first = (ast.get_docstring(node) or "").partition("\n")[0].replace("``", "`")
                rows.append((f"`{node.name}`", f"`{module}`", first))
    return _table(("class", "module of `rso_lidar`", "what it is"), sorted(rows, key=lambda row: row[0].lower()))


# ----------------------------------------------------------------------------------------------- architecture.md


def _layers() -> dict[str, list[list[str]]]:
    """Return by package the names on each floor, top first, as the import contracts in pyproject.toml state them."""
    text = (DOCS.parent / "pyproject.toml").read_text(encoding="utf-8")
    contracts = tomllib.loads(text)["tool"]["importlinter"]["contracts"]
    return {
        contract["containers"][0]: [
            [name for name in layer.split(" | ") if not name.startswith("(")]  # a room that is not built yet
            for layer in contract["layers"]
        ]
        for contract in contracts
        if contract["type"] == "layers"
    }


def _idea(dotted: str) -> tuple[str, str]:
    """Return the name of a module or of a folder of modules, and the first line of its docstring."""
    place = DOCS.parent.joinpath(*dotted.split("."))
    file = place / "__init__.py" if place.is_dir() else place.with_suffix(".py")
    first = (ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or "").partition("\n")[0]
    return f"`{place.name}/`" if place.is_dir() else f"`{place.name}`", first.replace("``", "`")


def _floor_rows(package: str, layers: list[list[str]]) -> list[tuple[str, ...]]:
    return [
        (str(number) if name == layer[0] else "", *_idea(f"{package}.{name}"))
        for number, layer in zip(range(len(layers), 0, -1), layers, strict=True)
        for name in layer
    ]


def floors() -> str:
    """Return every room and module of the package, floor by floor."""
    return _table(("floor", "room or module", "idea"), _floor_rows("rso_lidar", _layers()["rso_lidar"]))


def rooms() -> str:
    """Return what each room holds, in its order of imports where a contract states one."""
    layers = _layers()
    blocks = []
    for room in (name for layer in layers["rso_lidar"] for name in layer):
        folder, package = DOCS.parent / "rso_lidar" / room, f"rso_lidar.{room}"
        if not folder.is_dir() or room == "cli":
            continue
        if package in layers:
            table = _table(("floor", "part", "idea"), _floor_rows(package, layers[package]))
        else:
            names = sorted(file.stem for file in folder.glob("*.py") if file.stem != "__init__")
            table = _table(("part", "idea"), [_idea(f"{package}.{name}") for name in names])
        blocks.append(f"### {room}\n\n{_idea(package)[1]}\n\n{table}")
    return "\n\n".join(blocks)


def _is_a_value(field: Any) -> bool:
    """Return whether a field has a default of its own: neither nothing nor a part, which has a table of its own."""
    return not field.is_required() and field.default is not None and not isinstance(field.default, part.Part)


def main() -> None:
    """Write the pages that the arguments name anew, or all."""
    try:
        made = pages(*sys.argv[1:])
    except ValueError as error:
        sys.stderr.write(f"generate.py: {error}\n")
        sys.exit(2)
    for page, text in made.items():
        page.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()

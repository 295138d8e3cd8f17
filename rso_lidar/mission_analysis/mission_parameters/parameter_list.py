"""The parameters of a mission, listed from its parts: keys of the scenario, and figures derived from them.

Meaning and unit of a key are those of its `Field(description)`, and those of a derived figure are those of the docstring
of its property. Nothing is stated again here.
"""

from __future__ import annotations

import datetime
import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from rso_lidar.detector import DETECTOR_PRESETS, SOLVED_CONSTANTS, find_photons, list_camera_figures
from rso_lidar.errors import RsoLidarError, suppress_warnings
from rso_lidar.part import Part, name_object
from rso_lidar.scenario import Scenario, load_presets, require_scenario
from rso_lidar.sensors import load_sensor_presets

_BRACKETS = re.compile(r"\[([^\[\]]+)\]")
_COUNTED = ("pixels", "photons", "electrons", "counts", "bits")  # units that are words, and ends of names
_DETECTOR_FIGURES = {  # of a data sheet, which need the laser beside the detector
    "responsivity_a_per_w": "Responsivity at unit gain",
    "nep_w_per_sqrt_hz": "Noise-equivalent power in the dark",
    "noise_equivalent_photons": "Noise-equivalent photons in the dark",
    "false_alarms_per_s": "Rate at which noise triggers an armed pixel in the dark, mean over the camera's pixels",
    "false_alarms_per_frame": "Expected false alarms of a frame in the dark",
}
_NUMBERS = ("float", "int")


@dataclass(frozen=True)
class MissionParameter:
    """One parameter of a mission.

    `path` is the place of a key, as `--set` takes it, or that of a derived figure. `value` is a number, a text, a truth
    value, an instant, a tuple of them, or None where an optional key is left out. `default` is None for a required key
    too. `source` states where the value comes from: the scenario, a preset, a calibration, the default with its source, or
    the derivation.
    """

    path: str
    value: Any
    unit: str
    meaning: str
    default: Any
    source: str
    is_derived: bool = False

    @property
    def is_number(self) -> bool:
        """Whether the value is a single number."""
        return isinstance(self.value, int | float) and not isinstance(self.value, bool)


def iterate_parameters(scenario: Scenario) -> Iterator[MissionParameter]:
    """Yield the parameters of a scenario, part by part: its keys in the order of the scenario page, then derived figures.

    Parameters
    ----------
    scenario : the scenario. Derived figures of parts that read files use the files that it names

    Raises
    ------
    ScenarioError
        For another object.
    """
    require_scenario(scenario, "parameters")
    resolved: dict[str, Any] = {"lidar": scenario.instrument, "ptu": scenario.pan_tilt}
    resolved |= {"follower": scenario.bodies[-1]}
    resolved |= {f"target.{body.name}": body for body in scenario.bodies[:-1]}
    with suppress_warnings():
        unstated = frozenset(f"lidar.detector.{name}" for name in scenario.lidar.unstated_settings)
        origins = _Origins(resolved, _list_preset_values(scenario), unstated)
        yield from _iterate_part(scenario, "", origins, is_given=True)


@dataclass(frozen=True)
class _Origins:
    """Origins of values: parts by place with the files that they name found, and origin and value of presets by place.

    `unstated` are the places of settings that a preset file has from defaults of the package.
    """

    resolved: Mapping[str, Any]
    presets: Mapping[str, tuple[str, Any]]
    unstated: frozenset[str]


def _list_preset_values(scenario: Scenario) -> dict[str, tuple[str, Any]]:
    """List what presets of a lidar, of its detector and of sensors set, and a calibration: origin and value by place."""
    preset_values: dict[str, tuple[str, Any]] = {}
    detector_preset = getattr(scenario.lidar.detector, "preset", None)
    if detector_preset in DETECTOR_PRESETS:
        values = DETECTOR_PRESETS[detector_preset]
        for part, key in SOLVED_CONSTANTS:
            preset_values[f"lidar.detector.{part}.{key}"] = (f"preset {detector_preset}", values[key])
    if scenario.lidar.preset is not None:
        tables: list[tuple[str, Any]] = [("lidar", load_presets()[scenario.lidar.preset])]
        while tables:
            place, table = tables.pop()
            for key, value in table.items():
                if isinstance(value, Mapping):
                    tables.append((f"{place}.{key}", value))
                else:
                    preset_values[f"{place}.{key}"] = (f"preset {scenario.lidar.preset}", value)
    for sensor in scenario.sensor:
        preset = getattr(sensor, "preset", None) or ""
        for key, value in load_sensor_presets().get(preset, {}).items():
            preset_values[f"sensor.{sensor.name}.{key}"] = (f"preset {preset}", value)
    calibration = scenario.lidar.calibration
    for constant in calibration.constants if calibration else ():
        preset_values[f"lidar.detector.{constant.name}"] = (f"calibration {calibration.name}", constant.value)  # type: ignore[union-attr]
    return preset_values


def _iterate_part(part: Part, path: str, origins: _Origins, *, is_given: bool) -> Iterator[MissionParameter]:
    """Yield the parameters of a part and of the parts in it."""
    for name, field in type(part).model_fields.items():
        place, value = f"{path}.{name}".lstrip("."), getattr(part, name)
        given = is_given and name in part.model_fields_set and place not in origins.unstated
        inner = list(_list_inner(value))
        for step, inner_part in inner:
            yield from _iterate_part(inner_part, f"{place}{step}", origins, is_given=given)
        if inner:
            continue
        said, _, source = (field.description or "").partition("Default: ")
        default = None if field.is_required() else field.get_default(call_default_factory=True)
        if given:
            preset, expected = origins.presets.get(place, ("", None))
            origin = preset if preset and _plain(expected) == _plain(value) else "scenario"
        else:
            origin = f"default: {source.rstrip('.')}" if source else "default"
        yield MissionParameter(
            path=place,
            value=_plain(value),
            unit=_find_unit(name, said) if _is_numeric(value, field.annotation) else "",
            meaning=_drop_units(said),
            default=_plain(default),
            source=origin,
        )
    twin = _find_twin(part, path, origins.resolved)
    for name, meaning in _list_derived(type(part)):
        value = _try_property(twin, name)
        if value is not None:
            place, (unit, said) = f"{path}.{name}".lstrip("."), split_unit(name, meaning)
            yield MissionParameter(place, value, unit, said, None, "derived", is_derived=True)
    if path == "lidar":
        yield from _list_detection(twin)


def _list_detection(lidar: Any) -> Iterator[MissionParameter]:
    """Yield what follows from detector and laser together: false alarms of a pixel, and the light that it detects."""
    place, n_pixels = "lidar.detector", lidar.receiver.n_rows * lidar.receiver.n_cols
    for figure in list_camera_figures(lidar.detector, lidar.pulse, lidar.laser.wavelength_m, n_pixels):
        if figure.name in _DETECTOR_FIGURES and not hasattr(lidar.detector, figure.name):
            meaning = f"{_DETECTOR_FIGURES[figure.name]}{f': {figure.formula}' if figure.formula else ''}"
            path, unit = f"{place}.{figure.name}", figure.unit or "1"
            yield MissionParameter(path, figure.value, unit, meaning, None, "derived", is_derived=True)
    percents = (50, 95)
    photons = find_photons(lidar.detector, lidar.pulse, np.array(percents) / 100.0)
    for percent, count in zip(percents, photons if photons is not None else (), strict=False):
        if math.isfinite(count):
            path = f"{place}.photons_at_{percent}_percent"
            meaning = f"Photons of a return of the laser's pulse that is detected in {percent} % of flashes"
            yield MissionParameter(path, float(count), "photons", meaning, None, "derived", is_derived=True)


def _list_inner(value: Any) -> Iterator[tuple[str, Part]]:
    """Yield the parts in a value with the step that leads to each: its name or number."""
    if isinstance(value, Part):
        yield "", value
    elif isinstance(value, Mapping):
        yield from ((f".{key}", inner) for key, inner in value.items() if isinstance(inner, Part))
    elif isinstance(value, tuple):
        for k, inner in enumerate(value):
            if isinstance(inner, Part):
                yield f".{getattr(inner, 'name', k)}", inner


def _find_twin(part: Part, path: str, resolved: Mapping[str, Any]) -> Any:
    """Return the part of a place in which files have been found, or the part itself."""
    for start, twin in resolved.items():
        if path == start or path.startswith(f"{start}."):
            for step in path.removeprefix(start).split("."):
                twin = getattr(twin, step, None) if step else twin
            return twin if type(twin) is type(part) else part
    return part


def _list_derived(cls: type[Part]) -> list[tuple[str, str]]:
    """List the names of the numeric properties of a part with the first line of their docstrings."""
    meanings: dict[str, str] = {}
    for base in reversed(cls.__mro__):
        if not (issubclass(base, Part) and base is not Part):
            continue
        for name, member in tuple(vars(base).items()):
            function = member.fget if isinstance(member, property) else getattr(member, "func", None)
            if name.startswith("_") or not isinstance(member, property | cached_property) or function is None:
                continue
            answer = function.__annotations__.get("return")
            if (answer if isinstance(answer, str) else getattr(answer, "__name__", "")) in _NUMBERS:
                meanings[name] = (function.__doc__ or "").strip().partition("\n")[0].replace("``", "`")
    return list(meanings.items())


def _try_property(part: Any, name: str) -> float | int | None:
    """Return a derived figure; None where the part has no finite one, such as a limit that does not exist."""
    try:
        value = getattr(part, name)
    except RsoLidarError:
        return None
    return value if isinstance(value, int | float) and math.isfinite(value) else None


def _is_numeric(value: Any, annotation: Any) -> bool:
    if value is None:
        return re.search(r"\b(float|int)\b", repr(annotation)) is not None
    first = value
    while isinstance(first, tuple) and first:
        first = first[0]
    return isinstance(first, int | float) and not isinstance(first, bool)


def split_unit(name: str, description: str) -> tuple[str, str]:
    """Split the description of a number into its unit and its meaning, without the unit in brackets.

    Parameters
    ----------
    name : of the key or property, which gives the unit where the description does not, as ``rate_photons`` does
    description : such as ``Energy of a pulse [mJ].``

    Returns
    -------
    unit : such as ``mJ``; ``1`` for none.
    meaning : such as ``Energy of a pulse.``

    >>> split_unit("energy_mj", "Energy of a pulse [mJ].")
    ('mJ', 'Energy of a pulse.')
    """
    return _find_unit(name, description), _drop_units(description)


def _find_unit(name: str, text: str) -> str:
    """Return the unit of a number: that in brackets in its meaning, or that which its name says; 1 for none."""
    for unit_text in _BRACKETS.findall(text):
        if unit := _read_unit(unit_text):
            return unit
    over, per, under = name.rpartition("_per_")
    if per and over.rpartition("_")[2] in _COUNTED and under in [word.removesuffix("s") for word in _COUNTED]:
        return f"{over.rpartition('_')[2]}/{under}"
    last = name.rpartition("_")[2]
    return last if last in _COUNTED else "1"


def _read_unit(bracketed: str) -> str:
    """Return the unit that a text in brackets begins with; empty for other brackets, such as a list of numbers."""
    unit = bracketed.partition(",")[0].strip()
    return unit.replace("2", "²") if re.match(r"1/|1$|\D", unit) else ""


def _drop_units(text: str) -> str:
    """Return a meaning without its units in brackets, which have a column of their own."""
    return re.sub(r" +([,.;:])", r"\1", " ".join(_BRACKETS.sub(_keep_other, text).split()))


def _keep_other(match: re.Match[str]) -> str:
    """Return what replaces brackets in a meaning: nothing for a unit, which has a column of its own."""
    if not _read_unit(match[1]):
        return match[0]
    _, comma, more = match[1].partition(",")
    return f"({more.strip()})" if comma else ""


def _plain(value: Any) -> Any:
    """Return a value as numbers, texts, truth values, instants, tuples and tables of them."""
    if value is None or isinstance(value, str | int | float | datetime.datetime):
        return value
    if isinstance(value, list | tuple):
        return tuple(_plain(item) for item in value)
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, Part):
        return _plain(value.model_dump(exclude_none=True))
    return name_object(value)

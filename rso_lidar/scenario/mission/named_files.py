"""Files that the parts of a scenario name."""

from collections.abc import Callable, Iterator
from typing import Any

from rso_lidar.fmi import FmuModel
from rso_lidar.motion import find_dynamics_file
from rso_lidar.part import Part
from rso_lidar.scene import is_mesh_path


def find_named_files(part: Any, file: Callable[[str], Any]) -> Any:
    """Replace the files that a part and all parts in it name by their paths.

    Fields that name files are `file`, `…_file`, and `dynamics` of the form ``file.py:name``. `file` returns the path of a
    name.
    """
    changes: dict[str, Any] = {}
    if not isinstance(part, Part):  # an object of the user's own finds its files itself
        return part
    for name in type(part).model_fields:
        value = getattr(part, name)
        if isinstance(value, str) and (name == "file" or name.endswith("_file")):
            changes[name] = str(file(value))
        elif name == "dynamics" and (place := find_dynamics_file(value)) is not None:
            changes[name] = f"{file(place)}:{value.rpartition(':')[2]}"
        elif isinstance(value, Part):
            new_value = find_named_files(value, file)
            if new_value is not value:
                changes[name] = new_value
        elif isinstance(value, tuple) and any(isinstance(entry, Part) for entry in value):
            new_value = tuple(find_named_files(entry, file) if isinstance(entry, Part) else entry for entry in value)
            if any(new is not old for new, old in zip(new_value, value, strict=True)):
                changes[name] = new_value
    return part.replace(**changes) if changes else part


def list_dynamics(part: Any) -> list[str]:
    """List the Python functions that a part and all parts in it name as `dynamics`.

    Parameters
    ----------
    part : of a scenario; an object of a user names none

    Returns
    -------
    list of str
        Such as ``file.py:name`` or ``package.module:name``.
    """
    named = (getattr(inner, "dynamics", None) for inner in _iterate_parts(part))
    return [dynamics for dynamics in named if isinstance(dynamics, str)]


def list_fmus(part: Any) -> list[str]:
    """List the FMUs that a part and all parts in it name."""
    return [inner.file for inner in _iterate_parts(part) if isinstance(inner, FmuModel)]


def _iterate_parts(part: Any) -> Iterator[Part]:
    """Yield a part and all parts in it, depth first; none of an object of a user."""
    if isinstance(part, Part):
        yield part
        for name in type(part).model_fields:
            value = getattr(part, name)
            for inner in value if isinstance(value, tuple) else (value,):
                yield from _iterate_parts(inner)


def list_named_code(scenario: Any) -> list[str]:
    """List the Python functions and FMUs that the bodies and the PTU of a scenario name.

    Parameters
    ----------
    scenario : the scenario

    Returns
    -------
    list of str
        Functions as in `list_dynamics`, and files of FMUs.
    """
    bodies = (*scenario.target, scenario.follower)
    parts = [part for body in bodies for part in (body.motion, body.attitude)]
    return [name for part in (*parts, scenario.ptu) for name in (*list_dynamics(part), *list_fmus(part))]


def list_named_files(part: Any) -> list[str]:
    """List the files that a part and all parts in it name, in the order of their fields.

    Parameters
    ----------
    part : such as a scenario, or an object of a user, which finds its files itself

    Returns
    -------
    list of str
        Names as the part gives them.
    """
    names: list[str] = []
    find_named_files(part, lambda name: names.append(name) or name)  # type: ignore[func-returns-value]
    return names


def iterate_named_files(tables: Any, place: str = "") -> Iterator[tuple[str, str]]:
    """Yield the place and the name of each file that the tables of a text name, meshes included, before they fill parts.

    Parameters
    ----------
    tables : tables or lists, as TOML gives them
    place : of the tables, as a dotted key

    Yields
    ------
    tuple of str
        Place such as ``target[0].motion.file``, and name as the text gives it.
    """
    for key, value in tables.items() if isinstance(tables, dict) else enumerate(tables):
        here = f"{place}[{key}]" if isinstance(key, int) else f"{place}.{key}".lstrip(".")
        if isinstance(value, dict | list):
            yield from iterate_named_files(value, here)
        elif isinstance(value, str):
            word = str(key)
            if word == "file" or word.endswith("_file") or (word == "model" and is_mesh_path(value)):
                yield here, value

"""The files that parts name: found, and listed."""

from collections.abc import Callable
from typing import Any

from rso_lidar.motion.dynamics.function import file_of
from rso_lidar.part import Part


def with_files(part: Part, file: Callable[[str], Any]) -> Any:
    """Return a part whose fields that name files hold found paths, down through all parts it holds.

    They are `file`, `…_file`, and `dynamics` of the form ``file.py:name``.
    """
    changes: dict[str, Any] = {}
    for name in type(part).model_fields:
        value = getattr(part, name)
        if isinstance(value, str) and (name == "file" or name.endswith("_file")):
            changes[name] = str(file(value))
        elif name == "dynamics" and (place := file_of(value)) is not None:
            changes[name] = f"{file(place)}:{value.rpartition(':')[2]}"
        elif isinstance(value, Part):
            found = with_files(value, file)
            if found is not value:
                changes[name] = found
        elif isinstance(value, tuple) and any(isinstance(entry, Part) for entry in value):
            found = tuple(with_files(entry, file) if isinstance(entry, Part) else entry for entry in value)
            if any(new is not old for new, old in zip(found, value, strict=True)):
                changes[name] = found
    return part.replace(**changes) if changes else part


def dynamics_of(part: Part) -> list[str]:
    """Return the Python functions that a part and all parts it holds name as text in `dynamics`."""
    found: list[str] = []
    for name in type(part).model_fields:
        value = getattr(part, name)
        if name == "dynamics" and isinstance(value, str):
            found.append(value)
        for inner in value if isinstance(value, tuple) else (value,):
            if isinstance(inner, Part):
                found += dynamics_of(inner)
    return found


def files_of(part: Part) -> list[str]:
    """Return the files that a part and all parts it holds name, in the order of their fields."""
    found: list[str] = []
    with_files(part, lambda name: found.append(name) or name)  # type: ignore[func-returns-value]
    return found

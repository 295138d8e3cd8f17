"""From a TOML file to a validated scenario, and the one line that a bad one gets."""

import re
import tomllib
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError

from rso_lidar.errors import FieldError, ScenarioError, SettingError
from rso_lidar.part import Part, explain

AnyPart = TypeVar("AnyPart", bound=Part)


def read_toml(path: Path) -> str:
    """Return the text of a scenario file, or raise `ScenarioError` for one that cannot be read."""
    if path.is_dir():
        raise ScenarioError(f"{path}: is a folder; give a scenario file (.toml)")
    try:
        return path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise ScenarioError(f"{path}: no such file; check the name") from None
    except UnicodeDecodeError:
        raise ScenarioError(f"{path}: is not UTF-8 text; save the scenario as UTF-8 TOML") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise ScenarioError(f"{path}: cannot be read ({reason}); check its name and permissions") from None


def validated(
    part: type[AnyPart], text: str, where: str, settings: tuple[str, ...] = (), *, table: str = ""
) -> AnyPart:
    """Build the part that a TOML text fills, some of its fields set anew.

    Parameters
    ----------
    part : class of the part.
    text : TOML.
    where : what messages begin with, such as the file's name.
    settings : ``place=value`` texts.
    table : name of the only table of the text, where that, not the whole text, fills the part.
    """
    try:
        tree = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ScenarioError(f"{where}: not valid TOML: {error}; mend that line") from None
    except (RecursionError, ValueError, TypeError, AttributeError) as error:
        raise ScenarioError(f"{where}: not readable as TOML ({error}); give the text of a scenario") from None
    for setting in settings:
        _apply(tree, setting)
        if table and set(tree) != {table}:
            raise SettingError(f"--set {setting}: {where} has only the table {table}; set a field of that")
    if table:
        tree, where = tree[table], f"{where}: {table}"
    try:
        return part.model_validate(tree)
    except ValidationError as error:
        problems = [(one["loc"], one["type"]) for one in error.errors(include_url=False)]
        raise FieldError(f"{where}: {explain(error, part, tree)}", problems) from None


def _apply(tree: dict[str, Any], setting: str) -> None:
    """Set one field of a TOML tree: ``lidar.laser.energy_mj=20``, ``target.0.model=juno``, ``target.tdrs.model=juno``."""
    place, equals, text = setting.partition("=")
    steps = [step.strip() for step in re.sub(r"\[(\w+)\]", r".\1", place).split(".")]
    if not equals or not all(steps):
        raise SettingError(f"--set {setting}: is not place=value; write for example lidar.laser.energy_mj=20")
    try:
        value = tomllib.loads(f"value = {text}")["value"]
    except (tomllib.TOMLDecodeError, RecursionError, ValueError):
        value = text.strip()  # a bare word is a text
    here: Any = tree
    for step in steps[:-1]:
        here = _descend(here, step, setting)
    if isinstance(here, list):
        here[_position(here, steps[-1], setting)] = value
    else:
        here[steps[-1]] = value


def _descend(here: Any, step: str, setting: str) -> Any:
    inner = here[_position(here, step, setting)] if isinstance(here, list) else here.setdefault(step, {})
    if not isinstance(inner, dict | list):
        raise SettingError(f"--set {setting}: '{step}' holds a value, not a table; shorten the place")
    return inner


def _position(entries: list[Any], step: str, setting: str) -> int:
    """Return which entry of a list is meant, by number or by name."""
    names = [entry.get("name") if isinstance(entry, dict) else None for entry in entries]
    if step in names:
        return names.index(step)
    if step.isascii() and step.isdigit() and int(step) < len(entries):
        return int(step)
    known = ", ".join(str(name) for name in names if name)
    raise SettingError(f"--set {setting}: no entry '{step}' among {len(entries)} ({known}); give a name or a number")

"""From a TOML file to a validated scenario, and the one line that a bad one gets."""

import re
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError

from rso_lidar.errors import FieldError, ScenarioError, SettingError
from rso_lidar.files import read_text
from rso_lidar.part import Part, explain
from rso_lidar.toml_text import DEEPEST, MOST_BYTES, parse_toml

AnyPart = TypeVar("AnyPart", bound=Part)


def read_toml(path: Path) -> str:
    """Return the text of a scenario file, or raise `ScenarioError` for one that cannot be read."""
    return read_text(path, MOST_BYTES, ScenarioError, "scenario file (.toml)")


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
    tree = parse_toml(text, where, ScenarioError)
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
        raise SettingError(f"--set {setting:.80}: is not place=value; write for example lidar.laser.energy_mj=20")
    if len(steps) > DEEPEST:
        raise SettingError(f"--set {setting:.80}: has over {DEEPEST} steps; no table lies so deep")
    try:
        value = parse_toml(f"value = {text}", "--set", SettingError)["value"]
    except SettingError:
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

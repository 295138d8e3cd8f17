"""Validation of a TOML text, with one line of explanation for a bad one."""

import re
from pathlib import Path
from typing import Any, ClassVar, Self, TypeVar

from pydantic import PrivateAttr, ValidationError

from rso_lidar.errors import FieldError, ScenarioError, SettingError
from rso_lidar.files import convert_path, read_text
from rso_lidar.part import DEEPEST_TOML, MOST_TOML_BYTES, Part, explain, parse_toml
from rso_lidar.shipped import find

AnyPart = TypeVar("AnyPart", bound=Part)


class FilePart(Part):
    """A part that fills a TOML file of its own, beside a scenario that it names."""

    _folder: Path = PrivateAttr(default=Path())
    _where: str = PrivateAttr(default="")
    _KIND: ClassVar[str]

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Return the part in a TOML file; relative paths in it start in the file's folder.

        Parameters
        ----------
        path : of the file; a relative one is looked up in the working folder, then among the shipped data

        Raises
        ------
        ScenarioError
            For a file that cannot be read, and for content that is not valid.
        """
        path = convert_path(path, ScenarioError)
        path = find(path) or path
        return cls.loads(read_toml(path), folder=path.parent, where=path.name)

    @classmethod
    def loads(cls, text: str, *, folder: Path | None = None, where: str | None = None) -> Self:
        """Return the part in a TOML text.

        Parameters
        ----------
        text : the TOML
        folder : start of relative paths (None: the working folder)
        where : name of the text in error messages (None: the kind of the part)

        Raises
        ------
        ScenarioError
            For a text that is not valid.
        """
        part = validate_toml(cls, text, where or cls._KIND)
        part._folder, part._where = folder or Path(), where or cls._KIND
        return part

    def replace(self, **changes: Any) -> Self:
        """Return a copy with some fields changed, validated like a new part."""
        changed = super().replace(**changes)
        changed._folder, changed._where = self._folder, self._where
        return changed

    @property
    def folder(self) -> Path:
        """Folder in which relative paths start."""
        return self._folder

    @property
    def where(self) -> str:
        """Name of the file in error messages."""
        return self._where or self._KIND


def read_toml(path: Path) -> str:
    """Read the text of a TOML file.

    Parameters
    ----------
    path : of the file; one that is not there is looked up among the shipped data

    Returns
    -------
    str

    Raises
    ------
    ScenarioError
        If it cannot be read, is too long, or is not UTF-8.
    """
    return read_text(find(path) or path, MOST_TOML_BYTES, ScenarioError, "scenario file (.toml)")


def validate_toml(
    part: type[AnyPart],
    text: str,
    where: str,
    settings: tuple[str, ...] = (),
    *,
    table: str = "",
    folder: Path | None = None,
) -> AnyPart:
    """Build a part from a TOML text, with some fields changed.

    Parameters
    ----------
    part : class of the part
    text : TOML
    where : start of error messages, such as the file's name
    settings : changes as ``place=value``
    table : name of the table that fills the part, where it is the only one of the text; empty for the whole text
    folder : start of the path of a preset file (None: the working folder)

    Returns
    -------
    part
        An instance of that class.

    Raises
    ------
    ScenarioError
        For a text that is not TOML, a setting that names no field, and values that the part refuses.
    """
    tree = parse_toml(text, where, ScenarioError)
    for setting in settings:
        apply_setting(tree, setting)
        if table and set(tree) != {table}:
            raise SettingError(f"--set {setting}: {where} has only the table {table}; set a field of that")
    if table:
        tree, where = tree[table], f"{where}: {table}"
    return validate_tables(part, tree, where, folder)


def validate_tables(part: type[AnyPart], tree: dict[str, Any], where: str, folder: Path | None = None) -> AnyPart:
    """Build a part from the tables of a TOML text.

    Parameters
    ----------
    part : class of the part
    tree : tables by key, as TOML gives them
    where : start of error messages
    folder : start of the path of a preset file (None: the working folder)

    Returns
    -------
    part
        An instance of that class.

    Raises
    ------
    ScenarioError
        For values that the part refuses; a `FieldError` with their places.
    """
    try:
        return part.model_validate(tree, context={"folder": folder})
    except ValidationError as error:
        problems = [(detail["loc"], detail["type"]) for detail in error.errors(include_url=False)]
        raise FieldError(f"{where}: {explain(error, part, tree)}", problems) from None


def apply_setting(tree: dict[str, Any], setting: str) -> None:
    """Set one field of a TOML tree by a text of the form ``place=value``.

    Parameters
    ----------
    tree : tables by key, changed in place
    setting : such as ``lidar.laser.energy_mj=20``, ``target.0.model=juno`` or ``target.tdrs.model=juno``. The value is TOML;
        a bare word is a text

    Raises
    ------
    SettingError
        For a setting that is not ``place=value``, or leads nowhere.
    """
    place, equals, text = setting.partition("=")
    if not equals or not place.strip():
        raise SettingError(f"--set {setting:.80}: is not place=value; write for example lidar.laser.energy_mj=20")
    try:
        value = parse_toml(f"value = {text}", "--set", SettingError)["value"]
    except SettingError:
        value = text.strip()  # a bare word is a text
    set_field(tree, place, value, f"--set {setting}")


def set_field(tree: dict[str, Any], place: str, value: Any, where: str) -> None:
    """Set one field of a TOML tree.

    Parameters
    ----------
    tree : tables by key, changed in place
    place : dotted key, such as ``target.tdrs.model`` or ``target[0].model``
    value : as TOML gives it
    where : start of error messages

    Raises
    ------
    SettingError
        For a place that leads nowhere.
    """
    steps = _split_place(place)
    if not all(steps):
        raise SettingError(f"{where:.90}: is not place=value; write for example lidar.laser.energy_mj=20")
    if len(steps) > DEEPEST_TOML:
        raise SettingError(f"{where:.90}: has over {DEEPEST_TOML} steps; no table lies so deep")
    here: Any = tree
    for step in steps[:-1]:
        here = _descend_to(here, step, where)
    if isinstance(here, list):
        here[_find_entry(here, steps[-1], where)] = value
    else:
        here[steps[-1]] = value


def get_field(tree: dict[str, Any], place: str, where: str) -> Any:
    """Return one field of a TOML tree, or None where there is none.

    Parameters
    ----------
    tree : tables by key
    place, where : as in `set_field`

    Raises
    ------
    SettingError
        For an entry that a list does not have.
    """
    here: Any = tree
    for step in _split_place(place):
        if isinstance(here, list):
            here = here[_find_entry(here, step, where)]
        else:
            here = here.get(step) if isinstance(here, dict) else None
    return here


def _split_place(place: str) -> list[str]:
    return [step.strip() for step in re.sub(r"\[(\w+)\]", r".\1", place).split(".")]


def _descend_to(here: Any, step: str, where: str) -> Any:
    """Return the table or list inside a TOML tree that one step of a key leads to."""
    inner = here[_find_entry(here, step, where)] if isinstance(here, list) else here.setdefault(step, {})
    if not isinstance(inner, dict | list):
        raise SettingError(f"{where}: '{step}' is a value, not a table; shorten the key")
    return inner


def _find_entry(entries: list[Any], step: str, where: str) -> int:
    """Return the index of an entry of a list."""
    names = [entry.get("name") if isinstance(entry, dict) else None for entry in entries]
    if step in names:
        return names.index(step)
    if step.isascii() and step.isdigit() and int(step) < len(entries):
        return int(step)
    known = ", ".join(str(name) for name in names if name)
    raise SettingError(f"{where}: no entry '{step}' among {len(entries)} ({known}); give a name or a number")

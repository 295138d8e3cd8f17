"""The user's own settings: one file of theirs and the environment, which wins over it. Nothing else reads either."""

from __future__ import annotations

import functools
import os
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from rso_lidar.errors import ScenarioError, did_you_mean

__all__ = [
    "NO_FOLDERS",
    "USER_SETTINGS",
    "check_setting",
    "find_setting",
    "format_settings",
    "get_setting",
    "is_trusted",
    "parse_words",
    "read_settings",
    "settings_path",
]

NO_FOLDERS = "none"  # of a list in the environment
_FOLDER_VARIABLE = "RSO_LIDAR_CONFIG"
_MOST_BYTES = 65_536  # some thousand folders
_SWITCHES = {"true": True, "yes": True, "on": True, "1": True, "false": False, "no": False, "off": False, "0": False}


class UserSetting(NamedTuple):
    """One setting of a user.

    Parameters
    ----------
    variable : variable of the environment that wins over the file
    kind : ``folder``, ``folders`` or ``switch``
    description : what it does
    default : what holds where neither the file nor the environment says anything, in words
    """

    variable: str
    kind: str
    description: str
    default: str


USER_SETTINGS: Mapping[str, UserSetting] = {
    "models_folder": UserSetting(
        "RSO_LIDAR_MODELS",
        "folder",
        "Folder of your own models (`rso-lidar models add`).",
        "the platform's data folder",
    ),
    "machine_code_folder": UserSetting(
        "NUMBA_CACHE_DIR", "folder", "Folder that keeps compiled machine code.", "the package, or the platform's cache"
    ),
    "dark_pictures": UserSetting(
        "RSO_LIDAR_DARK", "switch", "Draw all pictures on a dark background, as --dark does.", "false"
    ),
    "trust_code": UserSetting(
        "RSO_LIDAR_TRUST_CODE", "folders", "Folders whose scenarios may run the Python code that they name.", "none"
    ),
    "trust_fmu": UserSetting(
        "RSO_LIDAR_TRUST_FMU", "folders", "Folders whose scenarios may run the native code of their FMUs.", "none"
    ),
}


def settings_path() -> Path:
    """Return the path of the settings file, in the folder that RSO_LIDAR_CONFIG names, else the platform's.

    Returns
    -------
    Path
        The file need not exist.
    """
    if folder := os.environ.get(_FOLDER_VARIABLE):
        return Path(folder).expanduser() / "config.toml"
    from platformdirs import user_config_path

    return user_config_path("rso_lidar", appauthor=False) / "config.toml"


def read_settings() -> Mapping[str, Any]:
    """Read the settings file.

    Returns
    -------
    Mapping of str to str, bool or list of str
        What the file sets, by key; empty where there is no file.

    Raises
    ------
    ScenarioError
        If the file cannot be read, is not TOML, or has a key or value that is none.
    """
    path = settings_path()
    try:
        status = path.stat()
    except OSError:
        return {}
    return _read(path, (status.st_mtime_ns, status.st_size, status.st_ino))


@functools.lru_cache(maxsize=4)
def _read(path: Path, stamp: tuple[int, int, int]) -> Mapping[str, Any]:
    cure = "correct it, or delete the file"
    if not path.is_file() or stamp[1] > _MOST_BYTES:
        raise ScenarioError(f"{path}: is not a file of at most {_MOST_BYTES:,} bytes; move it away")
    try:
        tables = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise ScenarioError(f"{path}: is not TOML ({error}); {cure}") from None
    except OSError as error:
        raise ScenarioError(f"{path}: cannot be read ({error.strerror}); {cure}") from None
    return {key: check_setting(key, value, where=f"{path}: ") for key, value in tables.items()}


def check_setting(key: str, value: Any, *, where: str = "") -> Any:
    """Check the value of a setting.

    Parameters
    ----------
    key, value : as in the file
    where : what stands before the key in an error

    Returns
    -------
    str, bool or list of str
        The value.

    Raises
    ------
    ScenarioError
        If there is no such setting, or the value is not of its kind. Folders are written from the root or from ~: a
        relative one would mean another folder in each place that a command starts in.
    """
    if key not in USER_SETTINGS:
        guess = did_you_mean(key, USER_SETTINGS)
        raise ScenarioError(f"{where}{key}: no setting of that name{guess} (known: {', '.join(USER_SETTINGS)})")
    kind = USER_SETTINGS[key].kind
    if kind == "switch":
        if not isinstance(value, bool):
            raise ScenarioError(f"{where}{key}: must be true or false; correct it")
        return value
    is_list = kind == "folders"
    if is_list != isinstance(value, list) or not all(isinstance(text, str) for text in (value if is_list else [value])):
        what = 'a list of folders, as ["~/missions"]' if is_list else 'a folder, as "~/models"'
        raise ScenarioError(f"{where}{key}: must be {what}; correct it")
    for text in value if is_list else [value]:
        folder = _expand(text)
        if not folder.is_absolute():
            raise ScenarioError(f"{where}{key}: '{text}' is relative; write it from the root, or from ~")
        if is_list and folder == Path(folder.anchor):
            raise ScenarioError(f"{where}{key}: '{text}' holds all files of the machine; name a folder of your own")
    return value


def parse_words(key: str, words: Sequence[str]) -> Any:
    """Convert the words of a command, or of a variable of the environment, to the value of a setting.

    Parameters
    ----------
    key : of the setting
    words : folders, or one word such as ``true``

    Returns
    -------
    str, bool or list of str
        The checked value, whose folders are absolute.

    Raises
    ------
    ScenarioError
        As `check_setting` does, and for more words than the setting takes.
    """
    kind = USER_SETTINGS[key].kind if key in USER_SETTINGS else "folder"
    if kind != "folders" and len(words) > 1:
        raise ScenarioError(f"{key}: takes one value, not {len(words)}; quote a path with spaces")
    if kind == "switch":
        return check_setting(key, _SWITCHES.get(words[0].lower(), words[0]))
    if any(not word.strip("\0") or "\0" in word for word in words):
        raise ScenarioError(f"{key}: an empty text is no folder; name one, or take `rso-lidar config unset {key}`")
    folders = [str(Path(os.path.abspath(_expand(word)))) for word in words]  # noqa: PTH100 - keeps links as named
    return check_setting(key, folders if kind == "folders" else folders[0])


def find_setting(key: str) -> tuple[Any, str]:
    """Find the value of a setting and who gives it.

    Parameters
    ----------
    key : of the setting

    Returns
    -------
    value : str, bool, list of str or None
        None where nobody gives one.
    source : str
        The variable of the environment, ``config.toml``, or empty.

    Raises
    ------
    ScenarioError
        As `read_settings` does, and for a variable whose value is none.
    """
    setting = USER_SETTINGS[key]
    text = os.environ.get(setting.variable)
    if text:
        is_list = setting.kind == "folders"
        words = [word for word in text.split(os.pathsep) if word and text != NO_FOLDERS] if is_list else [text]
        try:
            return parse_words(key, words), setting.variable
        except ScenarioError as error:
            raise ScenarioError(f"{setting.variable}: {str(error).removeprefix(f'{key}: ')}") from None
    values = read_settings()
    return (values[key], "config.toml") if key in values else (None, "")


def get_setting(key: str) -> Any:
    """Return the value of a setting.

    Parameters
    ----------
    key : of the setting

    Returns
    -------
    Path, tuple of Path, bool or None
        None where nobody gives one.

    Raises
    ------
    ScenarioError
        As `find_setting` does.
    """
    value, _ = find_setting(key)
    if isinstance(value, str):
        return _expand(value)
    return tuple(map(_expand, value)) if isinstance(value, list) else value


def is_trusted(key: str, file: Path) -> bool:
    """Return whether a file lies in a folder that the user trusts, links resolved.

    Parameters
    ----------
    key : ``trust_code`` or ``trust_fmu``
    file : a scenario that names code

    Returns
    -------
    bool

    Raises
    ------
    ScenarioError
        As `find_setting` does.
    """
    folders = get_setting(key) or ()
    return any(file.resolve().is_relative_to(folder.resolve()) for folder in folders)


def format_settings(values: Mapping[str, Any]) -> str:
    """Format settings as the text of their file, with what each does as a comment.

    Parameters
    ----------
    values : by key

    Returns
    -------
    str
        TOML.
    """
    import tomli_w

    lines = [
        "# Settings of rso-lidar. `rso-lidar config set` and `unset` write this file anew, with these comments only."
    ]
    for key, setting in USER_SETTINGS.items():
        if key in values:
            lines += ["", f"# {setting.description}", tomli_w.dumps({key: values[key]}).rstrip()]
    return "\n".join(lines) + "\n"


def _expand(text: str) -> Path:
    try:
        return Path(text).expanduser()
    except RuntimeError:  # ~name of nobody, which stays relative and is refused as such
        return Path(text)

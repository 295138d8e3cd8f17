"""`rso-lidar config`: the user's own settings, and the folders whose scenarios may run code."""

import os
import stat
from pathlib import Path
from typing import Annotated, Any

import typer

from rso_lidar.cli.default_command import default_to
from rso_lidar.cli.terminal import echo
from rso_lidar.errors import ScenarioError
from rso_lidar.files import write_text
from rso_lidar.user_settings import (
    USER_SETTINGS,
    check_setting,
    find_setting,
    format_settings,
    parse_words,
    read_settings,
    settings_path,
)

app = typer.Typer(cls=default_to("show"), rich_markup_mode=None, pretty_exceptions_enable=False)

SettingKey = Annotated[
    str, typer.Argument(metavar="KEY", help="Name of the setting.", autocompletion=lambda: list(USER_SETTINGS))
]


@app.callback(invoke_without_command=True)
def config(context: typer.Context) -> None:
    """Show and set your own settings, and whose code you trust."""
    if context.invoked_subcommand is None:
        show()


@app.command("show")
def show(
    key: Annotated[
        str | None,
        typer.Argument(
            metavar="KEY",
            help="Print the value of this setting alone, a folder a line.",
            autocompletion=lambda: list(USER_SETTINGS),
        ),
    ] = None,
) -> None:
    """Show all settings, with who gives each: your file, or a variable of the environment, which wins over it."""
    if key is not None:
        value, _ = find_setting(_check_key(key))
        for text in [] if value is None else _list_texts(value):
            echo(text)
        return
    settings = {name: find_setting(name) for name in USER_SETTINGS}  # whole, or one error
    for name, setting in USER_SETTINGS.items():
        value, source = settings[name]
        texts = _list_texts(value) or ["none"] if source else [setting.default]
        echo(f"{name:<21}{texts[0]}  ({source or 'default'})")
        for text in texts[1:]:
            echo(f"{'':21}{text}")
        echo(f"{'':21}{setting.description} Variable: {setting.variable}")
    echo(f"\nfile: {_describe_file(settings_path())}")


@app.command("set")
def set_value(
    key: SettingKey,
    values: Annotated[list[str], typer.Argument(metavar="VALUE...", help="Folder, or true or false; several folders.")],
    add: Annotated[bool, typer.Option("--add", help="Add folders to those that are there.")] = False,
) -> None:
    """Set a setting in your file, which is made where there is none. Folders are kept with their whole path."""
    value = parse_words(_check_key(key), values)
    kind = USER_SETTINGS[key].kind
    if add and kind != "folders":
        raise ScenarioError(f"--add: is for lists of folders, and {key} has one value; leave it out")
    for folder in [value] if kind == "folder" else value if kind == "folders" else []:
        _check_folder(key, Path(folder), is_trusted=kind == "folders")
    kept = dict(read_settings())
    if kind == "folders":
        value = list(dict.fromkeys([*(kept.get(key, []) if add else []), *value]))
    _write(kept | {key: value})
    for text in _list_texts(value):
        echo(f"{key} = {text}")
    echo(str(settings_path()))
    if os.environ.get(variable := USER_SETTINGS[key].variable):
        echo(f"{variable} is set in this shell and wins over the file; unset it there", err=True)


@app.command("unset")
def unset(
    key: SettingKey,
    values: Annotated[
        list[str] | None, typer.Argument(metavar="[FOLDER]...", help="Of a list: remove these folders only.")
    ] = None,
) -> None:
    """Remove a setting from your file, or single folders from a list of them."""
    kept = dict(read_settings())
    if _check_key(key) not in kept:
        raise ScenarioError(f"{key}: is not set in {settings_path()}; nothing to remove")
    if values:
        if USER_SETTINGS[key].kind != "folders":
            raise ScenarioError(f"{key}: has one value; leave out '{values[0]}'")
        folders = {str(Path(text).expanduser()): text for text in kept[key]}
        if unknown := set(removed := parse_words(key, values)) - set(folders):
            raise ScenarioError(f"{key}: does not hold {min(unknown)}; it holds {', '.join(kept[key]) or 'none'}")
        kept[key] = [text for folder, text in folders.items() if folder not in removed]
    if not values or not kept[key]:
        del kept[key]
    _write(kept)
    echo(f"{key} = {', '.join(kept[key])}" if key in kept else f"{key} is unset")


@app.command("where")
def where() -> None:
    """Print the path of your settings file, also where there is none yet. RSO_LIDAR_CONFIG names another folder."""
    echo(str(settings_path()))


def _check_key(key: str) -> str:
    """Return the name of a setting; an unknown one is an error."""
    if key not in USER_SETTINGS:
        check_setting(key, None)
    return key


def _check_folder(key: str, folder: Path, *, is_trusted: bool) -> None:
    """Raise `ScenarioError` for a file in place of a folder, and for a trusted folder that is missing or open to all."""
    if folder.exists() and not folder.is_dir():
        raise ScenarioError(f"{key}: {folder} is a file; name its folder")
    if not is_trusted:
        return
    if not folder.is_dir():
        raise ScenarioError(f"{key}: {folder} is not there; make it first, or correct the name")
    if os.name == "posix" and folder.stat().st_mode & stat.S_IWOTH:
        raise ScenarioError(f"{key}: everybody may write in {folder}; name a folder that only you can write in")


def _write(values: dict[str, Any]) -> None:
    """Write the settings file, and its folder where there is none; a link to it stays a link."""
    path = settings_path().resolve()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        cure = "make it yourself, or let RSO_LIDAR_CONFIG name another"
        raise ScenarioError(f"{path.parent}: cannot be made ({error.strerror or error}); {cure}") from None
    write_text(path, format_settings(values), overwrite=True)


def _list_texts(value: Any) -> list[str]:
    if isinstance(value, list):
        return value
    return [str(value).lower() if isinstance(value, bool) else str(value)]


def _describe_file(path: Path) -> str:
    return f"{path}" if path.is_file() else f"{path} (not there; `rso-lidar config set` makes it)"

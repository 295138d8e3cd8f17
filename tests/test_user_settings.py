"""Settings of a user's own: the environment wins over the file, and a value that is none is an error with its place."""

import os
from pathlib import Path

import pytest

from rso_lidar.errors import ScenarioError
from rso_lidar.user_settings import (
    USER_SETTINGS,
    find_setting,
    format_settings,
    get_setting,
    is_trusted,
    read_settings,
    settings_path,
)


@pytest.fixture
def write_file(tmp_path, monkeypatch):
    monkeypatch.setenv("RSO_LIDAR_CONFIG", str(tmp_path / "settings"))
    for setting in USER_SETTINGS.values():
        monkeypatch.delenv(setting.variable, raising=False)

    def write(text):
        settings_path().parent.mkdir(exist_ok=True)
        settings_path().write_text(text)

    return write


def test_without_a_file_nothing_is_set(write_file):
    assert read_settings() == {}
    assert {find_setting(key) for key in USER_SETTINGS} == {(None, "")}


def test_the_environment_wins_over_the_file(write_file, monkeypatch):
    write_file('models_folder = "~/models"\ndark_pictures = true\n')
    assert get_setting("models_folder") == Path.home() / "models"
    monkeypatch.setenv("RSO_LIDAR_MODELS", "elsewhere")
    monkeypatch.setenv("RSO_LIDAR_DARK", "off")
    assert find_setting("models_folder") == (str(Path.cwd() / "elsewhere"), "RSO_LIDAR_MODELS")
    assert get_setting("dark_pictures") is False
    monkeypatch.setenv("RSO_LIDAR_DARK", "maybe")
    with pytest.raises(ScenarioError, match=r"^RSO_LIDAR_DARK: must be true or false"):
        get_setting("dark_pictures")


def test_a_file_edited_in_this_process_is_read_again(write_file):
    write_file("dark_pictures = true\n")
    assert get_setting("dark_pictures") is True
    write_file("dark_pictures = false\n")
    assert get_setting("dark_pictures") is False


def test_what_is_written_is_read_back_with_any_name_of_a_folder(write_file):
    values = {"trust_fmu": ['/a b/"c"\\d', "/\u00e9\n"], "dark_pictures": False, "models_folder": "~/x"}
    write_file(format_settings(values))
    assert read_settings() == values


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("trust_code = ", "is not TOML .*; correct it, or delete the file"),
        ("trust_codes = []", "trust_codes: no setting of that name; did you mean 'trust_code'"),
        ('trust_code = "/x"', "trust_code: must be a list of folders"),
        ('trust_code = ["x"]', "trust_code: 'x' is relative"),
        ('trust_code = ["~nobody-of-this-name/x"]', "is relative"),
        ('trust_code = ["/"]', "trust_code: '/' holds all files"),
        ("dark_pictures = 1", "dark_pictures: must be true or false"),
        ("models_folder = 3", "models_folder: must be a folder"),
    ],
)
def test_a_broken_file_is_an_error_that_names_the_file_and_the_cure(write_file, text, reason):
    write_file(text)
    with pytest.raises(ScenarioError, match=f"config.toml: .*{reason}") as error:
        read_settings()
    assert "\n" not in str(error.value)


def test_trust_follows_links_to_where_a_file_really_is(write_file, tmp_path, monkeypatch):
    for name in ("mine", "mine_too", "others"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "a.toml").touch()
    (tmp_path / "mine" / "theirs.toml").symlink_to(tmp_path / "others" / "a.toml")
    (tmp_path / "link").symlink_to(tmp_path / "mine_too")
    monkeypatch.setenv("RSO_LIDAR_TRUST_CODE", os.pathsep.join([str(tmp_path / "mine"), str(tmp_path / "link")]))
    trusted = {
        name: is_trusted("trust_code", tmp_path / name)
        for name in ("mine/a.toml", "mine/../others/a.toml", "mine/theirs.toml", "mine_too/a.toml")
    }
    assert list(trusted.values()) == [True, False, False, True]
    assert not is_trusted("trust_fmu", tmp_path / "mine" / "a.toml")


def test_the_environment_can_trust_none(write_file, tmp_path, monkeypatch):
    write_file(format_settings({"trust_code": [str(tmp_path)]}))
    assert is_trusted("trust_code", tmp_path / "a.toml")
    monkeypatch.setenv("RSO_LIDAR_TRUST_CODE", "none")
    assert not is_trusted("trust_code", tmp_path / "a.toml")

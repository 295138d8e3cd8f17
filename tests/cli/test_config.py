"""`rso-lidar config`: shows, sets and removes settings, and refuses in one line what would not be well."""

import pytest

from rso_lidar.user_settings import read_settings, settings_path
from tests.cli.test_trust_code import folder  # noqa: F401 - a fixture


@pytest.fixture(autouse=True)
def settings(tmp_path, monkeypatch):
    monkeypatch.setenv("RSO_LIDAR_CONFIG", str(tmp_path / "settings"))
    monkeypatch.delenv("RSO_LIDAR_MODELS")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_settings_are_set_shown_and_removed(rso_lidar, settings):
    (settings / "a").mkdir()
    (settings / "b").mkdir()
    assert rso_lidar("config", "where") == (0, f"{settings_path()}\n", [])
    assert rso_lidar("config", "set", "trust_code", "a")[0] == 0
    assert rso_lidar("config", "set", "trust_code", "b", "--add")[0] == 0
    assert rso_lidar("config", "set", "models_folder", "mine")[0] == 0
    _, shown, _ = rso_lidar("config")
    assert f"models_folder        {settings / 'mine'}  (config.toml)" in shown
    assert "dark_pictures        false  (default)" in shown
    assert rso_lidar("config", "trust_code")[1] == f"{settings / 'a'}\n{settings / 'b'}\n"
    assert rso_lidar("config", "unset", "trust_code", "a")[0] == 0
    assert read_settings() == {"models_folder": str(settings / "mine"), "trust_code": [str(settings / "b")]}
    assert rso_lidar("config", "unset", "trust_code")[:2] == (0, "trust_code is unset\n")
    assert list(read_settings()) == ["models_folder"]


def test_a_variable_that_hides_the_file_is_named(rso_lidar, monkeypatch):
    monkeypatch.setenv("RSO_LIDAR_DARK", "true")
    status, _, errors = rso_lidar("config", "set", "dark_pictures", "no")
    assert status == 0 and errors == ["RSO_LIDAR_DARK is set in this shell and wins over the file; unset it there"]
    assert "dark_pictures        true  (RSO_LIDAR_DARK)" in rso_lidar("config")[1]


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (("set", "dark", "true"), "dark: no setting of that name"),
        (("set", "dark_pictures", "maybe"), "must be true or false"),
        (("set", "dark_pictures", "true", "--add"), "--add: is for lists of folders"),
        (("set", "models_folder", "a", "b"), "takes one value, not 2"),
        (("set", "models_folder", "file"), "is a file; name its folder"),
        (("set", "trust_code", ""), "an empty text is no folder"),
        (("set", "trust_code", "nowhere"), "is not there; make it first"),
        (("set", "trust_code", "open"), "everybody may write in"),
        (("unset", "trust_code"), "is not set in"),
    ],
    ids=lambda value: "-".join(value) if isinstance(value, tuple) else "",
)
def test_what_would_not_be_well_is_refused_in_one_line(rso_lidar, settings, words, reason):
    (settings / "file").touch()
    (settings / "open").mkdir()
    (settings / "open").chmod(0o777)
    status, printed, errors = rso_lidar("config", *words)
    assert (status, printed, len(errors)) == (2, "", 1)
    assert reason in errors[0] and not settings_path().exists()


def test_a_broken_file_stops_every_command_but_where(rso_lidar):
    settings_path().parent.mkdir()
    settings_path().write_text("dark_pictures = ")
    for words in (("models",), ("config",), ("config", "set", "dark_pictures", "true")):
        status, printed, errors = rso_lidar(*words)
        assert (status, printed, len(errors)) == (2, "", 1)
        assert str(settings_path()) in errors[0] and "correct it, or delete the file" in errors[0]
    assert settings_path().read_text() == "dark_pictures = "
    assert rso_lidar("config", "where")[0] == 0


@pytest.mark.parametrize(
    "words", [("run", "a.toml", "-o", "made.h5", "--frames", "0:1"), ("dataset", "check", "dataset.toml")], ids="-".join
)
def test_code_of_a_trusted_folder_runs_without_the_option(folder, rso_lidar, words):  # noqa: F811 - as pytest names it
    assert rso_lidar("config", "set", "trust_fmu", folder)[0] == 0
    assert rso_lidar(*words)[0] == 2
    assert rso_lidar("config", "set", "trust_code", folder)[0] == 0
    status, _, errors = rso_lidar(*words)
    assert status == 0, errors
    assert (folder / "ran").exists()


def test_pictures_are_dark_where_the_settings_say_so(rso_lidar, settings):
    from matplotlib.image import imread

    def draw(name):
        assert rso_lidar("models", "plate", "-o", name)[0] == 0
        return imread(settings / name)[0, 0, :3].mean()

    assert draw("light.png") > 0.9
    rso_lidar("config", "set", "dark_pictures", "true")
    assert draw("dark.png") < 0.2

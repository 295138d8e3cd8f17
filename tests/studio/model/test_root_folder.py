"""Names inside the one folder of the studio, and all that leads out of it."""

import os

import pytest

from rso_lidar.errors import ScenarioError
from rso_lidar.studio.model.root_folder import Folder

TOML = (".toml",)


@pytest.fixture
def folder(tmp_path):
    """Return a folder with a file and a subfolder, beside another folder with a file that nobody may reach."""
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "secret.toml").write_text("secret", encoding="utf-8")
    (tmp_path / "work" / "sub").mkdir(parents=True)
    (tmp_path / "work" / "a.toml").write_text("a", encoding="utf-8")
    return Folder(tmp_path / "work")


def link(folder, name, target):
    try:
        (folder.path / name).symlink_to(target)
    except OSError:
        pytest.skip("this account of Windows may not make symbolic links")


@pytest.mark.parametrize("name", ["a.toml", "new.toml", "sub/new.toml", "no_such/new.toml", "näher 2.toml"])
def test_names_inside_are_taken(folder, name):
    assert folder.resolve(name, TOML) == folder.path / name


@pytest.mark.parametrize(
    "name",
    [
        "",
        "../other/secret.toml",
        "sub/../../other/secret.toml",
        "sub/../a.toml",
        "/etc/secret.toml",
        "//etc/secret.toml",
        "~/secret.toml",
        "~root/secret.toml",
        "C:secret.toml",
        "C:/secret.toml",
        "\\\\host\\share\\secret.toml",
        "..\\other\\secret.toml",
        "a.toml:stream.toml",  # of Windows
        ".hidden.toml",
        ".git/config.toml",
        "sub/.hidden.toml",
        "./a.toml",  # a second spelling of a.toml
        "sub//new.toml",
        "a\0.toml",
        "a\n.toml",
        "a\x1b[31m.toml",
        "\u202elmot.a.toml",  # written from right to left
        "\ud800.toml",
        "a" * 300 + ".toml",
        "é" * 150 + ".toml",  # 150 letters, 300 bytes
    ],
)
def test_names_that_lead_elsewhere_or_hide_are_refused(folder, name):
    with pytest.raises(ScenarioError, match=r"is not a file name inside the folder; give one such as approach\.toml"):
        folder.resolve(name, TOML)


@pytest.mark.parametrize("name", ["a.h5", "a", "a.toml.py", "a.TOML", "a.toml/x", "toml"])
def test_other_suffixes_are_refused(folder, name):
    with pytest.raises(ScenarioError, match=r"must end with \.toml"):
        folder.resolve(name, TOML)
    with pytest.raises(ScenarioError, match=r"must end with \.toml or \.csv"):
        folder.resolve(name, (".toml", ".csv"))


def test_links_that_lead_outside_are_refused_and_listed_nowhere(folder):
    outside = folder.path.parent / "other"
    link(folder, "file.toml", outside / "secret.toml")
    link(folder, "relative.toml", "../other/secret.toml")
    link(folder, "dangling.toml", outside / "new.toml")
    link(folder, "door", outside)
    link(folder, "chain.toml", "file.toml")
    for name in ("file.toml", "relative.toml", "dangling.toml", "door/secret.toml", "door/new.toml", "chain.toml"):
        with pytest.raises(ScenarioError, match="leads outside the folder work; copy the file into it"):
            folder.resolve(name, TOML)
    assert folder.list_files(TOML) == ["a.toml"]


def test_a_folder_beside_with_the_same_start_is_outside(folder):
    beside = folder.path.parent / "work_of_others"
    beside.mkdir()
    link(folder, "x.toml", beside / "x.toml")
    with pytest.raises(ScenarioError, match="leads outside"):
        folder.resolve("x.toml", TOML)


def test_loops_of_links_are_refused(folder):
    link(folder, "loop.toml", "loop.toml")
    link(folder, "one.toml", "two.toml")
    link(folder, "two.toml", "one.toml")
    link(folder, "round", ".")
    for name in ("loop.toml", "one.toml"):
        with pytest.raises(ScenarioError, match="leads outside"):
            folder.resolve(name, TOML)
    assert "loop.toml" not in folder.list_files(TOML)


def test_links_inside_are_followed(folder):
    link(folder, "same.toml", "a.toml")
    assert folder.resolve("same.toml", TOML).read_text(encoding="utf-8") == "a"
    assert folder.list_files(TOML) == ["a.toml", "same.toml"]


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes on this system")
def test_only_files_are_listed(folder):
    os.mkfifo(folder.path / "pipe.toml")
    (folder.path / "folder.toml").mkdir()
    (folder.path / ".hidden.toml").write_text("", encoding="utf-8")
    (folder.path / "sub" / "b.toml").write_text("", encoding="utf-8")
    (folder.path / "sub" / "c.h5").write_text("", encoding="utf-8")
    assert folder.list_files(TOML) == ["a.toml", "sub/b.toml"]


def test_long_lists_end(folder):
    for count in range(510):
        (folder.path / f"f{count:03d}.toml").write_text("", encoding="utf-8")
    found = folder.list_files(TOML)
    assert len(found) == 500 and found[:2] == ["a.toml", "f000.toml"]


def test_the_folder_must_exist(tmp_path):
    (tmp_path / "file").write_text("", encoding="utf-8")
    for name in ("none", "file"):
        with pytest.raises(ScenarioError, match="is not a folder; make it first, or name another"):
            Folder(tmp_path / name)


def test_a_folder_may_itself_be_a_link(folder):
    link(folder, "../entry", folder.path)
    entered = Folder(folder.path.parent / "entry")
    assert entered.resolve("a.toml", TOML).read_text(encoding="utf-8") == "a"

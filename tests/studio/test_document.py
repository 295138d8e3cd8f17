"""A document: its file, its draft, its history, the files of other programs, and edits that keep comments."""

import errno
import tomllib
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

import pytest

pytest.importorskip("tomlkit", reason="documents need tomlkit, of the extra studio")

from rso_lidar.errors import RsoLidarError, ScenarioError
from rso_lidar.shipped import shipped
from rso_lidar.studio import document as module
from rso_lidar.studio.document import UNSAVED, Document, EditConflictError, list_documents
from rso_lidar.studio.model import editable_toml
from rso_lidar.studio.model.root_folder import Folder

FIRST, SECOND = 'name = "first"  # a comment\n', 'name = "second"\n'
APPROACH = shipped("examples/tdrs_approach.toml").read_text(encoding="utf-8")


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "a.toml").write_text(FIRST, encoding="utf-8")
    return Folder(tmp_path)


@pytest.fixture
def document(folder):
    return Document.open(folder, "a.toml")


def read(document, name="a.toml"):
    return (document.folder.path / name).read_bytes().decode()


def write(document, text, name="a.toml"):
    (document.folder.path / name).write_bytes(text.encode())


def list_comments(text):
    """List the comments of a text whose strings hold no number sign."""
    return [line.partition("#")[2].strip() for line in text.splitlines() if "#" in line]


def test_opened_text_is_that_of_the_file(document):
    assert (document.text, document.title, document.notice) == (FIRST, "a.toml", "")
    assert not (document.is_changed or document.can_undo or document.can_redo or document.changed_on_disk())


def test_saved_text_is_in_the_file_to_the_byte(document):
    text = 'name = "ü"\r\n# Windows\r\n\tseed = 1'
    document.set_text(text)
    assert document.is_changed
    document.save()
    assert read(document) == text
    assert not document.is_changed
    assert not document.changed_on_disk()


def test_a_mark_at_the_start_of_a_file_is_no_part_of_the_text(folder):
    (folder.path / "a.toml").write_bytes(b"\xef\xbb\xbf" + FIRST.encode())
    assert Document.open(folder, "a.toml").text == FIRST


@pytest.mark.parametrize("content", [b"\xff\xfe\x00", None], ids=["no_text", "missing"])
def test_files_that_cannot_be_read_are_refused_with_their_name(folder, content):
    (folder.path / "a.toml").unlink()
    if content:
        (folder.path / "a.toml").write_bytes(content)
    with pytest.raises(RsoLidarError, match=r"a\.toml"):
        Document.open(folder, "a.toml")


def test_saving_without_a_name_asks_for_one(folder):
    with pytest.raises(ScenarioError, match="Save as"):
        Document(folder, FIRST).save()


def test_save_as_gives_the_name_and_removes_the_draft_without_one(folder):
    made = Document(folder, "")
    made.set_text(SECOND)
    made.keep_draft()
    assert list_documents(folder) == ["a.toml", UNSAVED]
    made.save_as("sub.toml")
    assert (made.name, made.is_changed, read(made, "sub.toml")) == ("sub.toml", False, SECOND)
    assert list_documents(folder) == ["a.toml", "sub.toml"]


def test_save_as_leaves_the_first_file_as_it_was(document):
    document.set_text(SECOND)
    document.save_as("b.toml")
    assert (read(document), read(document, "b.toml")) == (FIRST, SECOND)
    document.set_text(FIRST)
    document.save()
    assert read(document, "b.toml") == FIRST


def test_save_as_takes_no_name_that_is_there_unless_told(document):
    write(document, SECOND, "b.toml")
    with pytest.raises(EditConflictError, match=r"b\.toml: exists already"):
        document.save_as("b.toml")
    assert (document.name, read(document, "b.toml")) == ("a.toml", SECOND)
    document.save_as("b.toml", overwrite=True)
    assert (document.name, read(document, "b.toml")) == ("b.toml", FIRST)


@pytest.mark.parametrize("name", ["../b.toml", "/b.toml", "b.txt", ".b.toml", "", "a\n.toml"])
def test_save_as_stays_inside_the_folder(document, name):
    with pytest.raises(ScenarioError):
        document.save_as(name)
    assert document.name == "a.toml"


def test_a_file_that_others_changed_is_not_written_over_unless_told(document):
    document.set_text('name = "mine"\n')
    write(document, SECOND)
    assert document.changed_on_disk()
    with pytest.raises(EditConflictError, match=r"a\.toml: was changed on disk"):
        document.save()
    assert read(document) == SECOND
    assert document.is_changed
    document.save(overwrite=True)
    assert read(document) == 'name = "mine"\n'
    assert not document.changed_on_disk()


def test_save_as_under_its_own_name_does_not_write_over_the_change_of_others(document):
    document.set_text('name = "mine"\n')
    write(document, SECOND)
    with pytest.raises(EditConflictError):
        document.save_as("a.toml")
    assert read(document) == SECOND


def test_a_file_that_others_removed_is_a_conflict_and_comes_back_by_overwriting(document):
    (document.folder.path / "a.toml").unlink()
    assert document.changed_on_disk()
    with pytest.raises(EditConflictError):
        document.save()
    document.save(overwrite=True)
    assert read(document) == FIRST


def test_a_file_written_again_with_the_same_text_is_no_change(document):
    write(document, FIRST)
    assert not document.changed_on_disk()
    document.set_text(SECOND)
    document.save()
    assert read(document) == SECOND


def test_reload_takes_the_file_and_undo_brings_the_edits_back(document):
    document.set_text('name = "mine"\n')
    document.keep_draft()
    write(document, SECOND)
    document.reload()
    assert (document.text, document.is_changed, document.changed_on_disk()) == (SECOND, False, False)
    assert list(document.folder.path.glob(".*")) == []
    document.undo()
    assert document.text == 'name = "mine"\n'
    document.save()
    assert read(document) == 'name = "mine"\n'


def test_reload_of_a_file_that_is_gone_keeps_the_text(document):
    document.set_text(SECOND)
    (document.folder.path / "a.toml").unlink()
    with pytest.raises(RsoLidarError, match=r"a\.toml"):
        document.reload()
    assert document.text == SECOND and document.is_changed
    document.keep_draft()
    assert Document.open(document.folder, "a.toml").text == SECOND
    document.save()
    assert read(document) == SECOND


def test_a_draft_is_kept_and_the_next_session_restores_it(document):
    document.set_text(SECOND)
    document.keep_draft()
    assert read(document) == FIRST
    again = Document.open(document.folder, "a.toml")
    assert (again.text, again.is_changed) == (SECOND, True)
    assert "restored" in again.notice
    again.undo()
    assert again.text == FIRST
    again.keep_draft()
    assert Document.open(document.folder, "a.toml").notice == ""


def test_many_tabs_keep_one_draft(document):
    with ThreadPoolExecutor(8) as threads:
        for number in range(40):
            document.set_text(document.text + f"# {number}\n")
            for kept in [threads.submit(document.keep_draft) for _ in range(8)]:
                kept.result()
    assert read(document, ".a.toml.draft").endswith(document.text)


def test_a_draft_is_restored_where_its_file_was_changed_and_saving_then_is_a_conflict(document):
    document.set_text('name = "mine"\n')
    document.keep_draft()
    write(document, SECOND)
    again = Document.open(document.folder, "a.toml")
    assert again.text == 'name = "mine"\n'
    with pytest.raises(EditConflictError):
        again.save()
    again.reload()
    assert again.text == SECOND


@pytest.mark.parametrize("deed", ["save", "reload", "save_as"])
def test_a_draft_is_dropped(document, deed):
    document.set_text(SECOND)
    document.keep_draft()
    assert len(list(document.folder.path.glob(".*.draft"))) == 1
    getattr(document, deed)(*(("b.toml",) if deed == "save_as" else ()))
    assert list(document.folder.path.glob(".*")) == []
    document.keep_draft()
    assert list(document.folder.path.glob(".*")) == []
    assert Document.open(document.folder, "a.toml").notice == ""


def test_a_draft_of_a_text_without_a_file_is_listed_and_opened(folder):
    made = Document(folder, FIRST)
    made.set_text(SECOND)
    made.keep_draft()
    again = Document.open(folder, UNSAVED)
    assert again.text == SECOND
    again.save()
    assert read(again, UNSAVED) == SECOND
    assert list(folder.path.glob(".*")) == []


def test_a_draft_is_written_only_when_the_text_has_changed(document, monkeypatch):
    document.set_text(SECOND)
    document.keep_draft()
    written = []
    monkeypatch.setattr(module, "_write", lambda path, text: written.append(path))
    document.keep_draft()
    assert written == []


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EACCES, errno.EROFS])
def test_a_disk_that_takes_nothing_loses_nothing(document, monkeypatch, code):
    @contextmanager
    def fail(place):
        raise OSError(code, "the disk takes nothing", str(place))
        yield place

    document.set_text(SECOND)
    with monkeypatch.context() as broken:
        broken.setattr(module, "write_atomically", fail)
        for deed in (document.save, document.keep_draft):
            with pytest.raises((OSError, RsoLidarError), match="takes nothing"):
                deed()
        with pytest.raises((OSError, RsoLidarError)):
            document.save_as("b.toml")
    assert (document.text, document.is_changed, document.name, read(document)) == (SECOND, True, "a.toml", FIRST)
    document.keep_draft()
    assert Document.open(document.folder, "a.toml").text == SECOND
    document.save()
    assert read(document) == SECOND


def test_a_file_in_place_of_the_folder_is_refused_in_one_line(document):
    write(document, "no folder", "sub")
    with pytest.raises(RsoLidarError) as caught:
        document.save_as("sub/b.toml")
    assert "\n" not in str(caught.value)
    assert document.name == "a.toml"


def test_half_a_character_is_refused_and_kept(document):
    document.set_text('name = "\ud83d"\n')
    with pytest.raises(ScenarioError, match="half a character"):
        document.save()
    assert read(document) == FIRST


def test_undo_and_redo_walk_through_the_texts(document):
    texts = [FIRST, *(f'name = "{k}"\n' for k in range(4))]
    for k, text in enumerate(texts[1:]):
        document.set_text(text, f"place {k}")
    for text in reversed(texts[:-1]):
        document.undo()
        assert document.text == text
    document.undo()
    assert not document.can_undo
    for text in texts[1:]:
        document.redo()
        assert document.text == text
    document.redo()
    assert not document.can_redo


def test_an_edit_after_undo_drops_what_was_undone(document):
    document.set_text(SECOND)
    document.undo()
    document.set_text('name = "third"\n')
    assert not document.can_redo
    document.undo()
    assert document.text == FIRST


def test_typing_is_one_step_and_a_pause_begins_another(document, monkeypatch):
    now = [100.0]
    monkeypatch.setattr(editable_toml.time, "monotonic", lambda: now[0])
    for text in ("n", "na", "nam"):
        document.set_text(text)
        now[0] += 0.2
    now[0] += 5.0
    document.set_text("name")
    document.undo()
    assert document.text == "nam"
    document.undo()
    assert document.text == FIRST


def test_an_edit_fast_after_undo_can_be_undone_by_itself(document, monkeypatch):
    monkeypatch.setattr(editable_toml.time, "monotonic", lambda: 100.0)
    document.set_text("one")
    document.undo()
    document.set_text("two")
    document.undo()
    assert document.text == FIRST


def test_the_history_is_bounded(document):
    for k in range(1000):
        document.set_text(f"seed = {k}\n", f"place {k}")
    steps = 0
    while document.can_undo:
        document.undo()
        steps += 1
    assert 100 <= steps <= 300


def test_listeners_hear_of_each_change_once(document):
    heard = []
    document.listeners.add(lambda: heard.append(document.text))
    document.set_text(SECOND)
    document.set_text(SECOND)
    document.undo()
    document.redo()
    document.save()
    assert heard == [SECOND, FIRST, SECOND, SECOND]


# ------------------------------------------------------------------------------------------------ edits of forms


@pytest.mark.parametrize(
    ("place", "value"),
    [
        ("name", 'a "quoted" ü'),
        ("seed", 7),
        ("time.duration_s", 12.5),
        ("target[0].model", "aqua"),
        ("target[0].material.reflectance", 0.5),
        ("target[0].attitude.axis", [1, 0, 0]),
        ("target[0].attitude", {"type": "rtn"}),
        ("target[0].center_of_mass_m", [0.5, 0, 0]),
        ("follower.motion.position_m", [0, -500.5, 0]),
        ("ptu.mount.euler_zyx_deg", [1, 2, 3]),
        ("lidar.laser.energy_mj", 40),
        ("lidar.detector.speckle", {"model": "gamma"}),
        ("lidar.detector.speckle.cells", 3),
        ("world.earthshine", False),
        ("constraints.keep_out_m", {"tdrs": 100}),
    ],
)
def test_a_change_is_at_its_place_and_all_comments_stay(folder, place, value):
    made = Document(folder, APPROACH)
    made.set(place, value)
    assert made.get(place) == value
    assert type(made.get(place)) is type(value)
    assert [one for one in list_comments(APPROACH) if one not in list_comments(made.text)] == []
    made.undo()
    assert made.text == APPROACH


def test_a_changed_number_changes_its_line_only(folder):
    made = Document(folder, APPROACH)
    made.set("lidar.laser.energy_mj", 40)
    before, after = APPROACH.splitlines(), made.text.splitlines()
    assert len(before) == len(after)
    assert [(a, b) for a, b in zip(before, after, strict=True) if a != b] == [
        ("energy_mj      = 50", "energy_mj      = 40")
    ]


@pytest.mark.parametrize(
    "place", ["seed", "target[0].material", "target[0].attitude.rate_deg_s", "lidar.laser.energy_mj"]
)
def test_removed_keys_are_gone_and_other_lines_stay(folder, place):
    made = Document(folder, APPROACH)
    made.remove(place)
    assert made.get(place) is None
    other = [line for line in APPROACH.splitlines() if line not in made.text.splitlines()]
    assert len(other) == 1
    tomllib.loads(made.text)


def test_removed_tables_are_gone_with_their_header(folder):
    made = Document(folder, APPROACH)
    made.remove("ptu")
    assert "ptu" not in made.tables()
    assert "[ptu]" not in made.text
    assert made.tables() == {key: value for key, value in tomllib.loads(APPROACH).items() if key != "ptu"}


def test_removing_what_is_not_there_changes_nothing(folder):
    made = Document(folder, APPROACH)
    made.remove("no_such.place[3].at_all")
    assert made.text == APPROACH
    assert not made.can_undo


def test_entries_are_added_at_the_end_and_removed_by_number(folder):
    made = Document(folder, APPROACH)
    made.add_entry("target", {"name": "second", "model": "aqua", "motion": {"type": "tle", "file": "tle/aqua.tle"}})
    made.add_entry("sensor", {"type": "gyro", "name": "gyro"})
    made.add_entry("sensor", {"type": "gnss", "name": "gnss"})
    assert [one["name"] for one in made.get("target")] == ["tdrs", "second"]
    assert [one["name"] for one in made.get("sensor")] == ["gyro", "gnss"]
    assert made.text.count("[[target]]") == made.text.count("[[sensor]]") == 2
    assert set(list_comments(APPROACH)) <= set(list_comments(made.text))
    made.remove("sensor[0]")
    assert [one["name"] for one in made.get("sensor")] == ["gnss"]
    made.remove("sensor[0]")
    assert made.get("sensor") is None
    made.remove("target[1]")
    assert made.tables() == tomllib.loads(APPROACH)
    assert set(list_comments(APPROACH)) <= set(list_comments(made.text))


def test_a_form_fills_an_empty_text(folder):
    made = Document(folder, "")
    made.set("version", 1)
    made.set("time.duration_s", 5)
    made.add_entry("target", {"name": "one"})
    made.set("target[0].motion", {"type": "fixed", "position_m": [1, 2, 3]})
    made.set("lidar.laser.energy_mj", 5)
    assert made.tables() == {
        "version": 1,
        "time": {"duration_s": 5},
        "target": [{"name": "one", "motion": {"type": "fixed", "position_m": [1, 2, 3]}}],
        "lidar": {"laser": {"energy_mj": 5}},
    }


def test_instants_stay_instants(folder):
    made = Document(folder, APPROACH)
    made.set("time.start_utc", made.get("time.start_utc").replace(hour=13))
    assert "start_utc     = 2024-09-17T13:00:00Z" in made.text


def test_forms_refuse_a_text_that_is_not_toml_and_show_the_last_that_was(folder):
    made = Document(folder, APPROACH)
    made.tables()
    made.set_text(APPROACH + "\n[broken")
    assert not made.is_toml
    assert made.get("lidar.laser.energy_mj") == 50
    with pytest.raises(ScenarioError, match="not valid TOML"):
        made.set("seed", 3)
    made.undo()
    assert made.is_toml


@pytest.mark.parametrize("place", ["name.deeper", "target[7].name", "seed[0]", "target.name"])
def test_places_that_cannot_be_are_refused_and_nothing_changes(folder, place):
    made = Document(folder, APPROACH)
    with pytest.raises(ScenarioError):
        made.set(place, 1)
    assert made.text == APPROACH


def test_a_hidden_file_and_another_ending_are_not_listed(folder):
    for name in (".hidden.toml", "b.txt", ".b.toml.draft2"):
        (folder.path / name).write_text("", encoding="utf-8")
    assert list_documents(folder) == ["a.toml"]


def test_line_ends_of_the_file_are_kept(folder):
    place = folder.path / "crlf.toml"
    place.write_bytes(FIRST.replace("\n", "\r\n").encode())
    document = Document.open(folder, "crlf.toml")
    assert document.text == FIRST
    assert not document.is_changed
    document.set_text(SECOND)
    document.save()
    assert place.read_bytes() == SECOND.replace("\n", "\r\n").encode()
    assert not document.changed_on_disk()


def test_a_damaged_draft_is_ignored_with_a_word(folder):
    (folder.path / "a.toml").write_text(FIRST, encoding="utf-8")
    (folder.path / ".a.toml.draft").write_bytes(b"# draft of none\n\xff\xfe")
    document = Document.open(folder, "a.toml")
    assert document.text == FIRST
    assert "draft of the last session cannot be read and is ignored" in document.notice


def test_a_text_that_could_not_be_read_again_is_not_written(folder):
    (folder.path / "a.toml").write_text(FIRST, encoding="utf-8")
    document = Document.open(folder, "a.toml")
    document.set_text("# " + "x" * 9_000_000)
    with pytest.raises(ScenarioError, match=r"a\.toml: not written: 9,000,002 bytes"):
        document.save()
    assert (folder.path / "a.toml").read_text(encoding="utf-8") == FIRST

"""The workspace: one document for each file, however it is named, and a draft for each text without a file."""

import pytest

from rso_lidar.studio.state import Workspace

TEXT = "version = 1\n"


@pytest.fixture
def workspace(tmp_path):
    (tmp_path / "a.toml").write_text(TEXT, encoding="utf-8")
    return Workspace(tmp_path)


def test_links_to_one_file_are_one_document(workspace):
    (workspace.folder.path / "b.toml").symlink_to("a.toml")
    assert workspace.open_document("b.toml") is workspace.open_document("a.toml")


def test_texts_without_a_file_have_drafts_of_their_own(workspace):
    first, second = (workspace.new_document(f"# {word}\n") for word in ("one", "two"))
    for document in (first, second):
        document.set_text(document.text + TEXT)
    workspace.close()
    drafts = {path.name: path.read_text(encoding="utf-8") for path in workspace.folder.path.glob(".*.draft")}
    assert sorted(drafts) == [".unsaved.toml.draft", ".unsaved_2.toml.draft"]
    assert drafts[".unsaved.toml.draft"].endswith("# one\n" + TEXT)
    assert drafts[".unsaved_2.toml.draft"].endswith("# two\n" + TEXT)
    assert Workspace(workspace.folder.path).new_document("").text == ""


def test_closing_keeps_unsaved_edits(workspace):
    workspace.open_document("a.toml").set_text(TEXT + "# more\n")
    workspace.close()
    again = Workspace(workspace.folder.path).open_document("a.toml")
    assert again.text == TEXT + "# more\n"
    assert "unsaved edits" in again.notice

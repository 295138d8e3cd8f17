"""The workspace: one document for each file, however it is named, and a draft for each text without a file."""

import asyncio

import pytest

from rso_lidar.studio.document import list_documents
from rso_lidar.studio.state import BrowserTab, Workspace

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


def test_a_draft_of_an_open_text_is_that_document(workspace):
    document = workspace.new_document("# one\n")
    document.set_text("# two\n")
    document.keep_draft()
    assert workspace.open_document(document.address) is document


def test_a_tab_that_shows_another_document_keeps_a_draft_of_this_one(workspace):
    async def edit_and_leave():
        document = workspace.new_document("")
        tab = BrowserTab(workspace, document)
        document.set_text("# typed\n")
        tab.show(workspace.open_document("a.toml"))
        await asyncio.sleep(0)

    asyncio.run(edit_and_leave())
    assert "unsaved.toml" in list_documents(workspace.folder)
    assert Workspace(workspace.folder.path).open_document("unsaved.toml").text == "# typed\n"


@pytest.mark.parametrize("wanted", ["", "none.toml", "../a.toml", "b.toml"])
def test_the_first_document_is_the_wanted_one_where_it_can_be_read(workspace, wanted):
    (workspace.folder.path / "b.toml").write_text(TEXT, encoding="utf-8")
    assert workspace.first_document(wanted).name == ("b.toml" if wanted == "b.toml" else "a.toml")

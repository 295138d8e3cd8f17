"""Extensions of the site: links that leave the pages, tables of fields, pages of the API, and the check of all links.

The site itself is built by `make site`, which runs every script of the gallery; a warning there is an error.
"""

import importlib
import inspect
import sys
from pathlib import Path

import pytest

import rso_lidar as rl

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module", autouse=True)
def extensions():
    """Let the extensions be imported as Sphinx imports them."""
    sys.path.insert(0, str(ROOT / "docs"))
    yield
    sys.path.remove(str(ROOT / "docs"))


def load(name):
    return importlib.import_module(f"extensions.{name}")


@pytest.fixture
def files(tmp_path):
    """Return the links of a small repository."""
    docs = tmp_path / "docs"
    (docs / "tutorial").mkdir(parents=True)
    (tmp_path / "examples").mkdir()
    (docs / "orbits.md").write_text("# Orbits\n")
    (docs / "tutorial" / "1_first.py").write_text("")
    (tmp_path / "README.md").write_text("# Readme\n")
    (tmp_path / "CONTRIBUTING.md").write_text("[rules](docs/orbits.md#a) and [data](examples)\n")
    (tmp_path / "examples" / "flyby.toml").write_text("version = 1\n")
    (tmp_path / "examples" / "flyby.png").write_bytes(b"")
    return load("repository_files").Files(docs)


@pytest.mark.parametrize(
    ("link", "in_site"),
    [
        ("orbits.md#drag", "../orbits.md#drag"),
        ("../README.md", "../index.md"),
        ("../README.md#limits", "../index.md#limits"),
        ("../examples/flyby.toml", "../files/examples/flyby.toml.md"),
        ("../examples", "../files/examples.md"),
        ("../CONTRIBUTING.md#set-up", "../files/CONTRIBUTING.md#set-up"),
        ("../examples/flyby.png", "../../examples/flyby.png"),
        ("tutorial", "../auto_tutorial/index.rst"),
        ("tutorial/1_first.py", "../auto_tutorial/1_first.rst"),
        ("https://example.org/a.md", "https://example.org/a.md"),
        ("#here", "#here"),
        ("nowhere.md", "nowhere.md"),  # left alone, so that Sphinx warns
    ],
)
def test_links_lead_to_pages_of_the_site(files, link, in_site):
    assert files.rewrite(f"see [it]({link})", files.docs, "sub/page") == f"see [it]({in_site})"


@pytest.mark.parametrize(
    ("link", "in_site"),
    [
        ("[orbits.md](orbits.md#drag)", "[](../orbits.md#drag)"),  # MyST fills in the title of the section
        ("[`orbits.md`](orbits.md)", "[](../orbits.md)"),
        ("[drag](orbits.md#drag)", "[drag](../orbits.md#drag)"),
        ("[flyby.toml](../examples/flyby.toml)", "[flyby.toml](../files/examples/flyby.toml.md)"),
        ("[a.md](https://example.org/a.md)", "[a.md](https://example.org/a.md)"),
    ],
)
def test_links_named_after_a_page_show_its_title(files, link, in_site):
    assert files.rewrite(link, files.docs, "sub/page") == in_site


def test_links_in_code_stay(files):
    block = "```md\n[a](../README.md)\n```"
    assert files.rewrite(block, files.docs, "page") == block


def test_a_linked_page_brings_what_it_links_to(files):
    files.rewrite("[how](../CONTRIBUTING.md)", files.docs, "page")
    assert set(files.pages) == {"files/CONTRIBUTING", "files/examples", "files/examples/flyby.toml"}
    assert "(../orbits.md#a)" in files.pages["files/CONTRIBUTING"]
    assert (
        "```{literalinclude} ../../../examples/flyby.toml\n:language: toml" in files.pages["files/examples/flyby.toml"]
    )


PAGE = '<html><body id="top"><a href="{href}">x</a><img src="{src}"></body></html>'


@pytest.mark.parametrize(
    ("href", "src", "faults"),
    [
        ("#top", "p.png", []),
        ("a.html#top", "p.png", []),
        ("https://example.org", "data:image/png;base64,AAAA", []),
        ("gone.html", "p.png", ["a.html: gone.html does not exist"]),
        ("a.html#gone", "p.png", ["a.html: a.html#gone: the page has no such anchor"]),
        ("#top", "https://example.org/p.png",
         ["a.html: loads https://example.org/p.png from another host; ship the file with the site"]),
        ("#top", "//example.org/p.png",
         ["a.html: loads //example.org/p.png from another host; ship the file with the site"]),
    ],
)  # fmt: skip
def test_broken_links_of_a_built_site_are_found(tmp_path, href, src, faults):
    (tmp_path / "a.html").write_text(PAGE.format(href=href, src=src))
    (tmp_path / "p.png").write_bytes(b"")
    assert load("offline_links").find_faults(tmp_path) == faults


def test_every_name_of_rl_is_on_a_page_of_the_api():
    pages = load("api_pages")
    names = pages.names_page()
    shown = {name for name in rl.__all__ if f"`rl.{name} <" in names}
    rooms = {name for name in rl.__all__ if name in pages.ROOMS}
    assert shown | rooms == set(rl.__all__)
    for room in pages.ROOMS:
        page = pages.room_page(room)
        module = importlib.import_module(f"rso_lidar.{room}")
        names = [name for name in pages.exported(module) if not inspect.ismodule(getattr(module, name))]
        assert [name for name in names if f"rso_lidar.{pages.home_of(room, name)}.{name}" not in page] == []


def test_fields_of_parts_and_records_have_their_meaning():
    tables = load("field_tables")
    laser = tables.part_parameters(rl.Laser)
    place = laser.index("energy_mj : number > 0, default 50.0")
    assert laser[place + 1].startswith("    Energy of one pulse")
    reading = tables.record_attributes(rl.records.Reading)
    assert "range_m : (row, col) float32, [m]" in reading


def test_text_of_a_parameter_stands_below_its_name():
    tables = load("field_tables")
    docstring = ["Parameters", "----------", "a : width [m], or", "    none.", "b : of it."]
    assert tables.separate_names(docstring) == [
        *docstring[:2],
        "a",
        "    width [m], or",
        "    none.",
        "b",
        "    of it.",
    ]
    assert tables.separate_names(["Returns", "-------", "State : it"]) == ["Returns", "-------", "State : it"]
    assert tables.escape("|x| of `|y|`") == r"\|x\| of `|y|`"


def test_every_command_is_on_the_page_of_commands():
    from rso_lidar.cli.app import COMMANDS

    page = load("command_pages").commands_page()
    assert [name for name in COMMANDS if f"\n### {name}\n" not in page] == []
    assert "| `--trust-fmu` |" in page
    assert "\n#### dataset make\n" in page

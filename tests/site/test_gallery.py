"""The gallery: a page for each example, scripts that notebooks can be made of, and the scraper of their pictures.

The scripts run when the site is built (`make site`), where a warning is an error. These tests check what is quick.
"""

import ast
import importlib
import re
import sys
from pathlib import Path

import pytest

jupytext = pytest.importorskip("jupytext", reason="the group `site` is not installed")
pytest.importorskip("sphinx_gallery", reason="the group `site` is not installed")
from sphinx_gallery.py_source_parser import split_code_and_text_blocks  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]
GALLERY = ROOT / "docs" / "gallery"
EXAMPLES = ROOT / "examples"
SCRIPTS = sorted(GALLERY.rglob("*.py"))
PAGES = {script: script.read_text(encoding="utf-8") for script in SCRIPTS}
SECTIONS = sorted(path for path in GALLERY.iterdir() if path.is_dir())


@pytest.fixture
def scraper(monkeypatch):
    """Import the scraper as Sphinx does."""
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    yield importlib.import_module("extensions.figure_scraper")
    sys.modules.pop("extensions.figure_scraper", None)


def list_pages_that_name(text, section):
    return [script for script in (GALLERY / section).glob("*.py") if text in PAGES[script]]


def test_each_example_is_flown_on_a_page_of_its_name():
    missing = [
        path.name
        for path in sorted(EXAMPLES.glob("*.toml"))
        if not any(
            script.stem == path.stem and f'"examples/{path.name}"' in PAGES[script]
            for script in (*GALLERY.glob("missions/*.py"), *GALLERY.glob("instrument/*.py"))
        )
    ]
    assert not missing


def test_each_study_has_a_page():
    names = [path.stem for path in EXAMPLES.glob("studies/*.py")] + ["trade_lens"]
    missing = [name for name in names if not list_pages_that_name(f"examples/studies/{name}.", "studies")]
    assert not missing


def test_each_own_part_is_the_one_of_its_example():
    """Classes on a page and in `examples/seams` are the same code."""
    different = []
    for path in sorted(EXAMPLES.glob("seams/*.py")):
        classes = {
            node.name: ast.dump(node)
            for node in ast.parse(path.read_text(encoding="utf-8")).body
            if isinstance(node, ast.ClassDef)
        }
        shown = {node.name: ast.dump(node) for node in ast.parse(PAGES[GALLERY / "own_parts" / path.name]).body
                 if isinstance(node, ast.ClassDef)}  # fmt: skip
        different += [f"{path.name}: {name}" for name, code in classes.items() if shown.get(name) != code]
    assert not different


def test_each_bridge_and_client_is_described():
    page = PAGES[GALLERY / "connect" / "ros_cfs_basilisk.py"]
    assert [
        folder.name for folder in sorted(EXAMPLES.glob("bridges/*")) if f"examples/bridges/{folder.name}" not in page
    ] == []
    assert "examples/flight_software" in PAGES[GALLERY / "connect" / "flight_software.py"]


def test_each_section_has_a_header_and_each_question_is_in_its_index():
    assert [section.name for section in SECTIONS if not (section / "GALLERY_HEADER.rst").is_file()] == []
    index = (GALLERY / "how_do_i" / "GALLERY_HEADER.rst").read_text(encoding="utf-8")
    listed = set(re.findall(r"<([^>]+)>", index))
    assert listed == {f"/auto_gallery/how_do_i/{script.stem}" for script in GALLERY.glob("how_do_i/*.py")}


def test_each_question_of_the_index_is_the_title_of_its_page():
    index = (GALLERY / "how_do_i" / "GALLERY_HEADER.rst").read_text(encoding="utf-8")
    listed = re.findall(r":doc:`([^<`]+) <([^>]+)>`", index)
    assert listed
    different = [
        (title, target)
        for title, target in listed
        if find_title(PAGES[GALLERY / "how_do_i" / f"{target.rsplit('/', 1)[1]}.py"]) != title
    ]
    assert not different


def find_title(code):
    return ast.get_docstring(ast.parse(code)).splitlines()[0]


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: f"{script.parent.name}/{script.stem}")
def test_script_is_a_notebook_with_a_title_and_needs_no_path_of_a_machine(script):
    code = PAGES[script]
    compile(code, str(script), "exec")
    title, line = ast.get_docstring(ast.parse(code)).splitlines()[:2]
    assert line == "=" * len(title)
    kinds = [block.type for block in split_code_and_text_blocks(str(script))[1]]  # cells of the notebook on the site
    assert kinds[0] == "text"
    assert kinds.count("code") >= 1
    cells = jupytext.reads(code, fmt="py:percent").cells
    assert len(cells) == 1 + code.count("\n# %%")
    for cell in cells:
        compile(cell.source, str(script), "exec")
    absolute = re.findall(r"""["'](?:~|[A-Z]:|/(?:Users|home|mnt|opt|root|usr|var)/)[^"']*["']""", code)
    assert not absolute
    assert "__file__" not in code  # a notebook has none


def test_links_of_scripts_lead_to_pages_that_exist():
    broken = []
    for script, code in PAGES.items():
        for target in re.findall(r":doc:`(?:[^`<]+<)?(/[^`>]+)>?`", code):
            place = ROOT / "docs" / f"{target[1:]}.md"
            if target.startswith("/auto_gallery/"):
                place = GALLERY / f"{target.removeprefix('/auto_gallery/')}.py"
            if not place.is_file():
                broken.append(f"{script.parent.name}/{script.name}: {target}")
    assert not broken


def scrape(scraper, folder, code, value):
    paths = (folder / f"{number}.png" for number in range(1, 10))
    variables = {"example_globals": {"___": value}, "image_path_iterator": paths}
    return scraper.scrape_last_value(("code", code, 1), variables, {"src_dir": str(folder)})


def test_scraper_saves_a_figure_that_pyplot_does_not_know(scraper, tmp_path):
    from matplotlib.figure import Figure
    from PIL import Image

    rst = scrape(scraper, tmp_path, "a = 1\nfigure", Figure(figsize=(2, 1)))
    assert "1.png" in rst
    with Image.open(tmp_path / "1.png") as saved:
        assert saved.size == (2 * scraper.DPI, scraper.DPI)


def test_scraper_keeps_the_pictures_of_an_animation(scraper, tmp_path):
    from PIL import Image

    first, second = Image.new("L", (4, 4), 0), Image.new("L", (4, 4), 255)
    first.save(tmp_path / "film.gif", save_all=True, append_images=[second])
    with Image.open(tmp_path / "film.gif") as film:
        rst = scrape(scraper, tmp_path, "film", [film, second])
    assert "1.gif" in rst
    assert "2.png" in rst
    with Image.open(tmp_path / "1.gif") as saved:
        assert saved.n_frames == 2


@pytest.mark.parametrize(
    ("code", "value"),
    [("figure = draw()", "figure"), ("print(1)", None), ("", None), ("[]", []), ("x", ["no picture"])],
)
def test_scraper_saves_nothing_where_a_cell_ends_without_a_picture(scraper, tmp_path, code, value):
    from matplotlib.figure import Figure

    value = Figure() if value == "figure" else value  # of an earlier cell
    assert scrape(scraper, tmp_path, code, value) == ""
    assert list(tmp_path.iterdir()) == []


def test_temporary_folder_of_a_script_is_removed_before_the_next(scraper, monkeypatch):
    import tempfile

    monkeypatch.setattr(tempfile, "tempdir", None)
    scraper.use_temporary_folder({}, "first")
    left = Path(tempfile.mkdtemp())
    scraper.use_temporary_folder({}, "second")
    assert not left.exists()
    assert Path(tempfile.gettempdir()).is_dir()
    monkeypatch.setattr(tempfile, "tempdir", None)
    scraper._folder.cleanup()

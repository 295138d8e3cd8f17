"""The pages are what the generator makes, their links lead somewhere, their code runs, and the picture is one."""

import io
import re
import runpy
import shutil
import struct
import tomllib
import zlib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageSequence

import rso_lidar as rl
from rso_lidar.dataset.drawing.plan import make_plan as make_dataset_plan
from rso_lidar.study import Study
from rso_lidar.study.trades.plan import make_trade_plan

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PAGES = [*sorted(ROOT.glob("*.md")), *sorted(DOCS.glob("*.md"))]
WRITTEN = [page for page in PAGES if not page.name.startswith("validation")]  # those are reports of a run
LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")
NAMES = [page.relative_to(ROOT).as_posix() for page in WRITTEN]


def fenced(text, language):
    """Return the blocks of a page in one language."""
    return re.findall(rf"^```{language}\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)


LONG = {
    "datasets.md",
    "dispersion.md",
    "exports.md",
    "requirements.md",
    "studies.md",
    "tracking.md",
}  # their code takes seconds
WITH_CODE = [
    pytest.param(page, marks=pytest.mark.slow if page.name in LONG else ())
    for page in sorted(DOCS.glob("*.md"))
    if fenced(page.read_text(encoding="utf-8"), "python")
]


def prose(text):
    """Return a page without its fenced blocks and its code in line."""
    return re.sub(r"`[^`\n]+`", "", re.sub(r"^```.*?^```$", "", text, flags=re.DOTALL | re.MULTILINE))


def anchors(text):
    """Return where one can jump in a page, as GitHub names headings."""
    titles = re.findall(r"^#+ (.+)$", re.sub(r"^```.*?^```$", "", text, flags=re.DOTALL | re.MULTILINE), re.MULTILINE)
    return {re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-") for title in titles}


def broken_links(page, text):
    """Return the relative links of a page that lead nowhere."""
    broken = []
    for link in LINK.findall(prose(text)):
        if re.match(r"[a-z]+:", link):
            continue
        path, _, anchor = link.partition("#")
        target = (page.parent / path).resolve() if path else page
        if not target.exists() or (anchor and anchor not in anchors(target.read_text(encoding="utf-8"))):
            broken.append(link)
    return broken


@pytest.fixture(scope="module")
def generator():
    """Return what docs/generate.py defines; nothing is written."""
    return runpy.run_path(str(DOCS / "generate.py"), run_name="generator")


GENERATED = (
    "architecture.md", "calibration.md", "camera_fit.md", "datasets.md", "glossary.md", "scenario.md", "records.md",
    "physics.md", "instrument.md", "models.md", "protocol.md", "sensors.md", "requirements.md", "studies.md", "targeting.md",
    pytest.param("orbits.md", marks=pytest.mark.slow),  # it flies forty plans
)  # fmt: skip


@pytest.mark.parametrize("name", GENERATED)
def test_generated_page_is_up_to_date(generator, name):
    ((page, text),) = generator["pages"](name).items()
    assert text == page.read_text(encoding="utf-8"), f"{name} is stale: run python docs/generate.py"


def test_every_page_with_generated_parts_is_checked():
    pages = {page.name for page in DOCS.glob("*.md") if "<!-- generated: " in page.read_text(encoding="utf-8")}
    assert pages == {name if isinstance(name, str) else name.values[0] for name in GENERATED}


def test_every_part_of_a_scenario_has_its_table(generator):
    from rso_lidar.part import Part

    page = (DOCS / "scenario.md").read_text(encoding="utf-8")
    rooms = (rl, rl.detector, rl.motion, rl.optics, rl.orbit, rl.rpo, rl.scene, rl.study)
    values = [getattr(room, name) for room in rooms for name in room.__all__]
    exported = {value for value in values if isinstance(value, type) and issubclass(value, Part)}
    told = set(generator["sections"]())
    of_studies = set(generator["_study_sections"]())  # in studies.md
    of_studies |= set(generator["_requirement_sections"]())  # in requirements.md
    of_studies |= set(generator["_targeter_sections"]())  # in targeting.md
    bases = {
        rl.motion.Body,
        rl.motion.HingeAxes,
        rl.rpo.RelativeMotion,
        rl.rpo.RtnMotion,
        rl.rpo.ProximityOperation,
    }  # extended by others
    assert len(exported) > 80
    assert exported - told - of_studies == bases
    for part in told:
        for key in part.model_fields:
            assert f"| `{key}` |" in page


def test_the_page_on_training_names_each_array_of_a_dataset():
    listed = (DOCS / "datasets.md").read_text(encoding="utf-8").split("<!-- generated: arrays -->")[1]
    arrays = set(re.findall(r"^\| `(\w+)` \|", listed.split("<!-- end of arrays -->")[0], re.MULTILINE))
    named = set(re.findall(r"`(\w+)`", (DOCS / "training_data.md").read_text(encoding="utf-8")))
    assert len(arrays) > 30
    assert not arrays - named


def test_links_lead_somewhere():
    broken = {page.name: broken_links(page, page.read_text(encoding="utf-8")) for page in WRITTEN}
    assert not {page: links for page, links in broken.items() if links}


def test_modules_that_pages_name_exist():
    """Also those that are named from a room, such as `stages/sampling.py` on the page of the instrument."""
    files = [file.relative_to(ROOT).as_posix() for file in ROOT.glob("[!.]*/**/*.py")]
    named = {page.name: set(re.findall(r"`((?:\w+/)+\w+\.py)`", page.read_text(encoding="utf-8"))) for page in WRITTEN}
    assert len(set().union(*named.values())) > 20
    astray = {page: [name for name in names if not any(f"/{file}".endswith(f"/{name}") for file in files)]
              for page, names in named.items()}  # fmt: skip
    assert not {page: names for page, names in astray.items() if names}


def test_a_broken_link_is_seen():
    page = DOCS / "README.md"
    assert broken_links(page, "[a](nowhere.md) [b](physics.md#nothing) [c](physics.md) [d](#e)\n# E\n") == [
        "nowhere.md",
        "physics.md#nothing",
        "#e",
    ]


@pytest.mark.parametrize("page", WITH_CODE, ids=lambda page: page.name)
def test_code_of_the_pages_runs(page, tmp_path, monkeypatch):
    blocks = fenced(page.read_text(encoding="utf-8"), "python")
    shutil.copytree(ROOT / "examples", tmp_path / "examples", ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.chdir(tmp_path)
    namespace = {"__name__": "page"}
    for block in blocks:
        exec(compile(block, page.name, "exec"), namespace)
    for value in namespace.values():
        if callable(getattr(value, "close", None)):
            value.close()


@pytest.mark.parametrize("page", WRITTEN, ids=NAMES)
def test_scenarios_of_the_pages_fly(page):
    for block in fenced(page.read_text(encoding="utf-8"), "toml"):
        if "version" not in (said := tomllib.loads(block)):
            continue
        if "merits" in said:
            make_trade_plan(Study.loads(block, folder=ROOT))
            continue
        if "classes" in said:
            make_dataset_plan(rl.dataset.DatasetSpec.loads(block, folder=ROOT / "examples" / "datasets"))
            continue
        frame = next(rl.simulate(rl.Scenario.loads(block), threads=1))
        assert frame.valid.any()


def test_readme_begins_as_it_should():
    lines = (ROOT / "README.md").read_text(encoding="utf-8").splitlines()
    assert lines[0].startswith("# rso_lidar")
    assert "lidar" in lines[0].removeprefix("# rso_lidar").lower()
    assert "```python" in lines[:4]
    assert "```" not in lines[4]
    assert lines[4].strip(), "line 5 is code"
    first_picture = next(k for k, line in enumerate(lines) if line.startswith("!["))
    assert first_picture < 20
    text = "\n".join(lines)
    assert "make demo" in text
    assert "make test" in text


PICTURES = sorted((DOCS / "pictures").glob("*.png"))
FILM = DOCS / "pictures" / "approach.gif"


def test_every_picture_is_shown_and_every_figure_drawn():
    figures = set(runpy.run_path(str(DOCS / "figures.py"), run_name="figures")["FIGURES"])
    light = {file.stem for file in PICTURES if not file.stem.endswith("_dark")}
    assert light == figures | {
        "tdrs_approach",
        "growth",
        "architecture",
        "studio_build",
        "studio_see",
        "studio_camera",
        "studio_run",
    }
    assert {file.stem for file in PICTURES} - light == {f"{name}_dark" for name in light - {"tdrs_approach"}}
    told = "".join(
        (DOCS / page).read_text(encoding="utf-8")
        for page in (
            "physics.md",
            "instrument.md",
            "orbits.md",
            "studies.md",
            "models.md",
            "calibration.md",
            "camera.md",
            "sensors.md",
            "axes.md",
            "pictures.md",
            "dispersion.md",
            "camera_fit.md",
            "events.md",
        )
    )
    assert {name for name in figures if f"](pictures/{name}.png)" in told} == figures


@pytest.mark.parametrize("file", PICTURES, ids=lambda file: file.name)
def test_picture_is_a_png_and_small(file):
    content = file.read_bytes()
    assert len(content) < 150_000
    assert content[:8] == b"\x89PNG\r\n\x1a\n"
    stream, kinds = io.BytesIO(content[8:]), []
    while header := stream.read(8):
        size, kind = struct.unpack(">I4s", header)
        body = stream.read(size)
        assert struct.unpack(">I", stream.read(4))[0] == zlib.crc32(kind + body)
        kinds.append(kind)
    assert kinds[0] == b"IHDR"
    assert kinds[-1] == b"IEND"
    width, height = struct.unpack(">II", content[16:24])
    assert width >= 1000
    assert height >= 500


def test_film_is_one_that_every_page_can_show():
    assert FILM.stat().st_size < 1_500_000
    with Image.open(FILM) as film:
        assert film.size == (800, 332)
        assert film.info["loop"] == 0  # for ever
        assert film.n_frames > 60
        shown_ms = 0
        for frame in ImageSequence.Iterator(film):
            shown_ms += frame.info["duration"]
        assert 5_000 < shown_ms < 20_000
        film.seek(0)
        first = np.asarray(film.convert("RGB"), float)
        film.seek(film.n_frames - 1)
        assert np.abs(np.asarray(film.convert("RGB"), float) - first).mean() > 5.0  # the satellite has grown


def test_every_file_of_pictures_is_checked():
    assert {file.name for file in (DOCS / "pictures").iterdir()} == {file.name for file in PICTURES} | {FILM.name}

"""The report of a trade: one file, whole by itself, that says what was asked and what came out."""

import base64
import io
import re
from dataclasses import replace
from html.parser import HTMLParser

import pytest

from rso_lidar.errors import ScenarioError
from rso_lidar.study import trade
from rso_lidar.study.trades.report import _write_command, write_report
from tests.conftest import BENCH
from tests.study.trades.trade_for_tests import STUDY, folder_with

NASTY = "<script>alert(1)</script> & \"co\" 'x'"


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    study = STUDY.replace("Energy and beam", NASTY.replace('"', '\\"')).replace("[5, 20]", "[5, 20, -5]")
    bench = BENCH.replace("a plate on a bench", "a plate <b>")
    return trade(folder_with(tmp_path_factory.mktemp("report"), bench, f"{study}\n[report]\npictures = 3\n"))


@pytest.fixture(scope="module")
def page(made):
    return write_report(made)


class Reader(HTMLParser):
    """Reads a page, and keeps what it is made of."""

    void = ("meta", "img", "br", "wbr")

    def __init__(self, page):
        super().__init__()
        self.open, self.tags, self.attributes, self.text = [], [], [], []
        self.feed(page)

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        self.attributes += attributes
        if tag not in self.void:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text.append(data)


def test_it_is_well_formed_and_needs_nothing_else(page):
    read = Reader(page)
    assert read.open == []
    assert not {"script", "link", "iframe", "object"} & set(read.tags)
    linked = [value for name, value in read.attributes if name in ("src", "href", "srcset", "style", "onload")]
    assert linked and all(value.startswith("data:image/png;base64,") for value in linked)
    assert "url(" not in page and "@import" not in page
    assert NASTY in "".join(read.text)  # shown as it was written, and not run


def test_pictures_are_pictures(page):
    from PIL import Image

    coded = re.findall(r'src="data:image/png;base64,([^"]+)"', page)
    assert len(coded) == 2 + 2 + 1 + 3  # effects and maps of two merits, one against the other, and three frames
    for text in coded:
        with Image.open(io.BytesIO(base64.b64decode(text))) as picture:
            assert picture.width >= 500 and picture.height >= 200
            low, high = picture.convert("L").getextrema()
            assert high - low > 100  # not blank


def test_it_says_what_came_out(page, made):
    text = " ".join("".join(Reader(page).text).split())
    assert "9 points (grid), target plate; 3 of 9 could not be flown." in text
    assert "Time in field [s] is 2 at all points." in text
    assert "energy_mj: should be greater than 0, not -5" in text
    assert "Frames" in text and "Detection fraction: the best" in text and "the worst" in text
    assert "--set lidar.laser.energy_mj=5 --set lidar.laser.divergence_deg=1 " in text
    assert "numpy" in text and "sampling 0; scenario 7" in text
    for merit in made.study.merits:
        assert merit in text


def test_the_command_under_a_picture_finds_the_scenario_from_the_working_folder(made, monkeypatch):
    folder = made.plan.folder
    for here, path in ((folder.parent, f"{folder.name}/bench.toml"), (folder, "bench.toml")):
        monkeypatch.chdir(here)
        assert _write_command(made, 0, 2).startswith(f"rso-lidar run {path} --set lidar.laser.energy_mj=5 ")


def test_files_by_suffix(made, page, tmp_path, monkeypatch):
    monkeypatch.setattr("rso_lidar.study.trades.report.write_report", lambda *_: page)
    assert made.save(tmp_path / "x.html").read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    assert made.save(tmp_path / "x.csv").read_text(encoding="utf-8").startswith("row,seed,lidar.laser.energy_mj,")
    with pytest.raises(ScenarioError, match=r"not written as '\.htm'; did you mean '\.html'"):
        made.save(tmp_path / "x.htm")


def test_without_pictures_nothing_is_flown_again(made, monkeypatch):
    plain = made.study.replace(report={"pictures": 0})
    monkeypatch.setattr("rso_lidar.study.trades.report.simulate", lambda *_, **__: pytest.fail("a frame was flashed"))
    monkeypatch.setattr("rso_lidar.study.trades.report._draw_plots", lambda *_: [])
    assert "<h2>Frames</h2>" not in write_report(replace(made, study=plain))

"""The search of the site: what its index holds, and whether questions of readers lead to the section that answers them.

The last test asks the built site in a browser: `make site` first, as `make check` does. It is skipped without one.
"""

import json
import re
import tomllib
from pathlib import Path
from urllib.parse import quote, unquote

import pytest
from docutils import nodes
from docutils.frontend import get_default_settings
from docutils.parsers.rst import Parser
from docutils.utils import new_document

from tests.studio.browser.conftest import chromium  # noqa: F401 (a fixture)

ROOT = Path(__file__).resolve().parents[2]
SITE = ROOT / "out" / "site"
WORDS = tomllib.loads((ROOT / "docs" / "search.toml").read_text(encoding="utf-8"))
FIRST = 5  # results that a reader looks at
WANTED = 24  # of 26 questions
LISTED = f"""document.querySelectorAll("ul.search li").length >= {FIRST}
    || /finished|did not match/.test(document.querySelector(".search-summary")?.innerText)"""

PAGE = """
Orbits
======

Where a body is.

.. raw:: html

   <!-- generated: keys -->

Drag
----

The air slows the body; frame_rate_hz is not a key of drag.

.. raw:: html

   <!-- end of keys -->

Light
-----

The air again.
"""


@pytest.fixture
def index(monkeypatch):
    """Return the index of one small page."""
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    from extensions.section_search import SectionIndex

    page = new_document("page", get_default_settings(Parser()))
    Parser().parse(PAGE, page)
    assert page.next_node(nodes.section)
    index = SectionIndex({"density": "air"})
    index.add_page("orbits", page)
    script = index.script()
    return json.loads(script[script.index("(") + 1 : script.rindex(")")])


def test_each_section_holds_its_own_words(index):
    assert [section[1:3] for section in index["sections"]] == [
        ["orbits", "Orbits"],
        ["drag", "Orbits > Drag"],
        ["light", "Orbits > Light"],
    ]
    assert index["counts"]["air"] == [1, 1, 2, 1]
    assert index["counts"]["bodi"] == [0, 1, 1, 1]  # the stem of `body`
    assert index["counts"]["rate"] == [1, 1]  # names of keys count as their words


def test_titles_weigh_more_than_text(index):
    assert index["titles"]["drag"] == [1]
    assert index["counts"]["drag"] == [1, 3]  # once in the text, and twice for the title
    assert index["counts"]["orbit"] == [0, 2, 1, 2, 2, 2]  # the sections below have the title above as context


def test_what_is_generated_ranks_below_prose(index):
    weights = [section[5] for section in index["sections"]]
    assert weights[0] == weights[2] == 1.0
    assert weights[1] < 1.0


def test_synonyms_are_looked_for_by_their_stems(index):
    assert index["synonyms"] == {"densiti": ["air"]}


def headings(page):
    """Return the anchors of the headings of a page in Markdown, as docutils makes them."""
    prose = re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
    return {nodes.make_id(title) for title in re.findall(r"^#+ (.+)$", prose, re.MULTILINE)}


def test_every_answer_exists():
    wrong = []
    for question in WORDS["question"]:
        for answer in question["answers"]:
            page, _, section = answer.partition("#")
            page = re.sub("^auto_(gallery|tutorial)", r"\1", page)
            places = [ROOT / "docs" / f"{page}{suffix}" for suffix in (".md", ".py")]
            places.append(ROOT / f"{page.removeprefix('files/')}.md")
            file = next((place for place in places if place.exists()), None)
            if file is None or (section and section not in headings(file)):
                wrong.append(answer)
    assert len(WORDS["question"]) == 26
    assert wrong == []


def answers_question(question, results):
    """Return whether one of the results is a place that answers the question."""
    pages = {result.partition("#")[0] for result in results}
    return any(answer in (results if "#" in answer else pages) for answer in question["answers"])


def test_questions_of_readers_are_answered_by_the_first_results(chromium):  # noqa: F811
    if not (SITE / "search.html").exists():
        pytest.skip("needs the built site: make site")
    page = chromium.new_page()
    missed = []
    for question in WORDS["question"]:
        page.goto(f"{SITE.as_uri()}/search.html?q={quote(question['text'])}")
        page.wait_for_function(LISTED)
        links = page.eval_on_selector_all("ul.search li > a", "links => links.map(link => link.getAttribute('href'))")
        results = [unquote(link).replace(".html", "") for link in links[:FIRST]]
        if not answers_question(question, results):
            missed.append((question["text"], results))
    page.close()
    assert len(missed) <= len(WORDS["question"]) - WANTED, missed

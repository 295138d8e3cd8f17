"""The pages have one title, headings without gaps, code that can be highlighted, pictures in words, and short sentences."""

import re
from pathlib import Path

import pytest
from pygments.lexers import get_lexer_by_name
from pygments.util import ClassNotFound

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("docs", "examples", "tests", "benchmarks")
MADE = {
    line.strip("/") for line in (ROOT / ".gitignore").read_text(encoding="utf-8").splitlines() if line.endswith("/")
}


def is_made(page):
    """Return whether a page is in a folder that a build makes, such as those of the site."""
    return any(folder.relative_to(ROOT).as_posix() in MADE for folder in page.parents if folder.is_relative_to(ROOT))


FOUND = {*ROOT.glob("*.md"), *(page for folder in FOLDERS for page in (ROOT / folder).rglob("*.md"))}
PAGES = sorted(page for page in FOUND if not is_made(page))
# Not made of sentences by hand: the report of a run, a text of others, and lists of features.
OTHERS = {"docs/validation.md", "docs/validation_cases.md", "CODE_OF_CONDUCT.md", "CHANGELOG.md", "README.md"}
LISTS = {"README.md", "docs/README.md", "CODE_OF_CONDUCT.md"}  # begin with a list, code or a heading on purpose
WORDS = 30  # docs are read aloud: 25 words are the aim, and more than 30 cannot be followed
FENCE = re.compile(r"^(`{3,})(\S*).*?^\1$", re.DOTALL | re.MULTILINE)
ABBREVIATIONS = re.compile(
    r"\b(e\.g|i\.e|eqs?|secs?|al|cf|vs|no|figs?|pp?|ch|vol|rev|Rev|ed|alg|Adv|Appl|Eng|Geophys|Opt|Proc|Res|Sci|Spectrosc|Trans)"
    r"\.(?=\s)"
)
VAGUE = {"here", "this", "this page", "link", "click here", "page"}


def names(pages):
    return [page.relative_to(ROOT).as_posix() for page in pages]


def read(page):
    """Return a page without the header that is meant for Sphinx."""
    return re.sub(r"\A---\n.*?^---\n", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)


def without_code(text):
    return FENCE.sub("\n", re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL))


def headings(text):
    """Return the level of each heading of a page, in order."""
    return [len(marks) for marks in re.findall(r"^(#+) ", without_code(text), re.MULTILINE)]


def faults_of_headings(text):
    levels = headings(text)
    faults = [] if levels[:1] == [1] and levels.count(1) == 1 else ["not one title, at the top"]
    gaps = [place for place, level in enumerate(levels) if place and level > levels[place - 1] + 1]
    return faults + [f"heading {place + 1} skips a level" for place in gaps]


def languages(text):
    return [language for _, language in FENCE.findall(text)]


def is_known(language):
    if re.fullmatch(r"\{[\w:-]+\}", language):  # a directive of MyST
        return True
    try:
        get_lexer_by_name(language)
    except ClassNotFound:
        return False
    return True


def sentences(text):
    """Return the sentences of a page that are written by hand, with code, links and abbreviations as one word each."""
    text = re.sub(r"<!-- (generated|measured|scores).*?<!-- end of .*?-->", "\n\n", text, flags=re.DOTALL)
    text = re.split(r"^## References$", without_code(text), flags=re.MULTILINE)[0]
    text = re.sub(r"^\s*(#|\||:::).*$", "\n", text, flags=re.MULTILINE)
    text = re.sub(r"^\s*([-*+]|\d+\.)\s+", "\n\n", text, flags=re.MULTILINE)
    found = []
    for block in re.split(r"\n\s*\n", text):
        line = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", " ".join(block.split()))
        line = ABBREVIATIONS.sub(r"\1", re.sub(r"`[^`]*`", "CODE", line))
        found += re.split(r"(?<=[.!?])[*_)\"]*\s+(?=[A-Z0-9*_(\[\"])", line)
    return [sentence for sentence in found if sentence]


def too_long(text):
    return [sentence for sentence in sentences(text) if len(sentence.split()) > WORDS]


def links_in_words(text):
    """Return whether it is a picture, and the words, of each link of a page."""
    return [(mark == "!", words) for mark, words in re.findall(r"(!?)\[([^\[\]]*)\]\([^)\s]+\)", without_code(text))]


def faults_of_links(text):
    links = links_in_words(text)
    pictures = [f"a picture without a description: {words!r}" for is_picture, words in links
                if is_picture and len(words.split()) < 4]  # fmt: skip
    return pictures + [f"a link that does not say where it leads: {words!r}" for is_picture, words in links
                       if not is_picture and words.lower() in VAGUE]  # fmt: skip


def test_pages_are_found():
    assert {"README.md", "docs/orbits.md", "examples/studies/tumbling.md"} < set(names(PAGES))


def test_each_page_has_one_title_and_no_gap_between_headings():
    faults = {name: faults_of_headings(read(page)) for name, page in zip(names(PAGES), PAGES, strict=True)}
    assert not {name: found for name, found in faults.items() if found}


def test_each_page_begins_with_a_paragraph():
    begun = {name: re.search(r"^# .*\n\n(.*)", read(page), re.MULTILINE)
             for name, page in zip(names(PAGES), PAGES, strict=True) if name not in LISTS}  # fmt: skip
    assert not {
        name for name, first in begun.items() if not first or first[1].startswith(("#", "|", "`", "!", "- ", "<"))
    }


def test_code_has_a_language_that_can_be_highlighted():
    unknown = {name: [language for language in languages(read(page)) if not is_known(language)]
               for name, page in zip(names(PAGES), PAGES, strict=True)}  # fmt: skip
    assert not {name: found for name, found in unknown.items() if found}


def test_pictures_and_links_are_in_words():
    faults = {name: faults_of_links(read(page)) for name, page in zip(names(PAGES), PAGES, strict=True)}
    assert not {name: found for name, found in faults.items() if found}


def test_sentences_are_short():
    long = {name: too_long(read(page)) for name, page in zip(names(PAGES), PAGES, strict=True) if name not in OTHERS}
    assert not {name: found for name, found in long.items() if found}


@pytest.mark.parametrize(
    ("text", "faults"),
    [
        ("# A\n\n## B\n\n### C\n", 0),
        ("# A\n\n### C\n", 1),
        ("# A\n\n# B\n", 1),
        ("Words.\n", 1),
        ("# A\n\n```sh\n# a comment\n```\n", 0),
    ],
)
def test_faults_of_headings_are_seen(text, faults):
    assert len(faults_of_headings(text)) == faults


def test_faults_of_words_are_seen():
    assert faults_of_links("[here](a.md) ![](b.png) ![four words of text](c.png) [the orbit](d.md)") == [
        "a picture without a description: ''",
        "a link that does not say where it leads: 'here'",
    ]
    assert [is_known(language) for language in languages("```\na\n```\n\n```toml\nb = 1\n```\n")] == [False, True]
    words = " ".join(["word"] * 20)
    assert not too_long(f"{words}. Then {words}.\n\n- {words}\n- {words}\n")
    assert too_long(f"{words} (Fuller et al., eq. 7) {words}.")
    assert too_long(f"# Title\n\n{words}\n{words}\n")
    assert not too_long(f"<!-- generated: a -->\n{words} {words}\n<!-- end of a -->\n\n| {words} {words} |\n")

"""The search of the site, by section: an index of every section's words, and the script that ranks sections by it.

Sphinx's own full-text search knows which pages have a word, but neither in which section nor how often, and lists pages of
equal score by the alphabet. Here each section is a document of its own, ranked by BM25 (Robertson and Zaragoza 2009,
Foundations and Trends in Information Retrieval 3(4)). Words, stems and the page of results remain those of Sphinx. What is
generated, such as tables of keys, ranks below prose. Like Sphinx's, the index is a script, so that it works from a folder.
"""

import json
import re
import tomllib
from collections import Counter
from pathlib import Path

from docutils import nodes
from sphinx.search import SearchEnglish

SCRIPT = "section_search.js"  # in docs/static
INDEX = "section_index.js"  # in _static of the site
# Weights of pages in the ranking, by how their names begin. 1 is prose.
WEIGHTS = {"api/": 0.4, "files/": 0.4, "files/CONTRIBUTING": 1.0, "files/CHANGELOG": 0.2, "validation_cases": 0.1}
GENERATED_WEIGHT = 0.4  # of what docs/generate.py writes
TITLE_COUNT = 2  # a word of the title, or of the titles above it, counts as so many words of the text
# Words of questions, beside Sphinx's list, that say nothing of the subject.
IGNORED = frozenset({"get", "need", "use", "want"})
MARK = re.compile("<!-- (generated:|end of) .*-->")  # of docs/generate.py
SKIPPED = (nodes.comment, nodes.raw, nodes.title, nodes.section)


class SectionIndex:
    """The words of all sections.

    Parameters
    ----------
    synonyms : words by the word that a reader may type in their place.
    """

    def __init__(self, synonyms: dict[str, str]) -> None:
        self.language = SearchEnglish({})
        self.pages: list[str] = []
        self.sections: list[tuple[int, str, str, int, int, float]] = []
        self.counts: dict[str, list[int]] = {}  # by stem: section and count, in turn
        self.titles: dict[str, list[int]] = {}  # by stem: the sections with it in their title
        self.synonyms = {self.stems(word)[0]: self.stems(words) for word, words in synonyms.items()}

    def stems(self, text: str) -> list[str]:
        """Return the stems of the words of a text; names such as `frame_rate_hz` count as their words."""
        words = (word.lower() for word in re.findall(r"[^\W_]+", text))
        return [self.language.stem(word) for word in words if self.language.word_filter(word) and word not in IGNORED]

    def add_page(self, name: str, page: nodes.document) -> None:
        """Add the sections of a page."""
        matches = [prefix for prefix in WEIGHTS if name.startswith(prefix)]
        weight = WEIGHTS[max(matches, key=len)] if matches else 1.0
        self.pages.append(name)
        generated = False
        for node in page.findall():
            if isinstance(node, nodes.raw) and (mark := MARK.fullmatch(node.astext().strip())):
                generated = mark[1] == "generated:"
            elif isinstance(node, nodes.section):
                self._add_section(node, weight * (GENERATED_WEIGHT if generated else 1.0))

    def _add_section(self, section: nodes.section, weight: float) -> None:
        title, above = section.next_node(nodes.title).astext(), []
        place = section.parent
        while isinstance(place, nodes.section):
            above.append(place.next_node(nodes.title).astext())
            place = place.parent
        own, context = set(self.stems(title)), set(self.stems(" ".join(above)))
        words = Counter(self.stems(" ".join(_texts(section))))
        length = words.total()
        words.update(dict.fromkeys(own | context, TITLE_COUNT))
        number = len(self.sections)
        full_title = f"{above[-1]} > {title}" if above else title  # as Sphinx names it
        self.sections.append((len(self.pages) - 1, section["ids"][0], full_title, length, len(own), weight))
        for stem, count in words.items():
            self.counts.setdefault(stem, []).extend((number, count))
        for stem in own:
            self.titles.setdefault(stem, []).append(number)

    def script(self) -> str:
        """Return the index as a script that hands it to the search."""
        index = {
            "pages": self.pages,
            "sections": self.sections,
            "counts": self.counts,
            "titles": self.titles,
            "synonyms": self.synonyms,
            "ignored": sorted(self.language.stem(word) for word in IGNORED),
        }
        return f"SectionSearch.setIndex({json.dumps(index, ensure_ascii=False, separators=(',', ':'))})\n"


def _texts(section: nodes.Element) -> list[str]:
    """Return the texts of a section without those of its title and of the sections in it."""
    texts = []
    for child in section.children:
        if isinstance(child, nodes.Text):
            texts.append(child.astext())
        elif not isinstance(child, SKIPPED):
            texts += _texts(child)
    return texts


def write_index(app, error):
    """Write the index once the pages are written."""
    if error is not None or app.builder.format != "html":
        return
    words = tomllib.loads((Path(app.srcdir) / "search.toml").read_text(encoding="utf-8"))
    index = SectionIndex(words["synonyms"])
    for name in sorted(app.env.found_docs):
        index.add_page(name, app.env.get_doctree(name))
    (Path(app.outdir) / "_static" / INDEX).write_text(index.script(), encoding="utf-8")


def load_scripts(app, pagename, _template, _context, _page):
    """Load both scripts where the search is; they run after Sphinx's own, whose search of texts they replace."""
    if pagename == "search":
        for file in (SCRIPT, INDEX):
            app.add_js_file(file, loading_method="defer")


def setup(app):
    """Connect both to Sphinx."""
    app.connect("html-page-context", load_scripts)
    app.connect("build-finished", write_index)
    return {"parallel_read_safe": True, "parallel_write_safe": True}

"""Check of the built site: every link leads to a page and an anchor that exist, and nothing is loaded from another host."""

from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

from sphinx.util import logging

LOADED = {("script", "src"), ("img", "src"), ("link", "href"), ("iframe", "src"), ("source", "src"), ("video", "src")}
NOT_LOADED = {"canonical", "search", "index", "next", "prev", "author", "contents"}  # what a `link` only names
SHOWN = 20  # bad links that are listed


class Page(HTMLParser):
    """The anchors of one page of HTML, its links, and what it loads."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.anchors: set[str] = set()
        self.links: list[str] = []
        self.loaded: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        """Note what one tag names and where it leads."""
        values = dict(attrs)
        self.anchors |= {values[key] for key in ("id", "name") if values.get(key)}
        if tag == "a" and values.get("href"):
            self.links.append(values["href"])
        for name, key in LOADED:
            if tag == name and values.get(key) and not (tag == "link" and values.get("rel") in NOT_LOADED):
                self.loaded.append(values[key])


def find_faults(folder: Path) -> list[str]:
    """Return a line for each broken link and for each file that a page loads from another host.

    Parameters
    ----------
    folder : of the built site.
    """
    pages = {
        file: Page(file.read_text(encoding="utf-8"))
        for file in sorted(folder.rglob("*.html"))
        if "_static" not in file.parts
    }  # templates of the theme
    faults = []
    for file, page in pages.items():
        where = file.relative_to(folder).as_posix()
        for address in (*page.links, *page.loaded):
            parts = urlsplit(address)
            if parts.scheme or parts.netloc:
                if address in page.loaded and parts.scheme != "data":
                    faults.append(f"{where}: loads {address} from another host; ship the file with the site")
                continue
            target = (file.parent / unquote(parts.path)).resolve() if parts.path else file
            target = target / "index.html" if target.is_dir() else target
            if not target.exists():
                faults.append(f"{where}: {address} does not exist")
            elif parts.fragment and target in pages and unquote(parts.fragment) not in pages[target].anchors:
                faults.append(f"{where}: {address}: the page has no such anchor")
    return faults


def check(app, error):
    """Warn of each fault once the site is written; `make site` turns warnings into a failure."""
    if error is None and app.builder.format == "html":
        faults = find_faults(Path(app.outdir).resolve())
        log = logging.getLogger(__name__)
        for fault in faults[:SHOWN]:
            log.warning(fault)
        if len(faults) > SHOWN:
            log.warning("and %d more broken links", len(faults) - SHOWN)


def setup(app):
    """Connect the check to the end of a build."""
    app.connect("build-finished", check)
    return {"parallel_read_safe": True, "parallel_write_safe": True}

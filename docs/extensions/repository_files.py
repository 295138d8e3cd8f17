"""Files of the repository that pages link to, as pages of the site, so that every link works offline.

A link such as ``../examples/tdrs_approach.toml`` works in the repository. In the site it leads to a page of its own, under
``files/``: Markdown is shown as a page, a folder as a list of its files, and any other text with line numbers.
"""

import os
import re
from pathlib import Path, PurePosixPath

ADDRESS = re.compile(r"(\]\()(?![a-z]+:|#|/)([^)\s#]+)((?:#[^)\s]*)?\))")
NAMED = re.compile(
    r"\[`?[\w/.-]+\.md`?(\]\((?![a-z]+:|#|/)[^)\s#]+\.md(?:#[^)\s]*)?\))"
)  # a link whose text is a file's name
FENCE = re.compile(r"^(```.*?^```$)", re.DOTALL | re.MULTILINE)
LANGUAGES = {
    ".py": "python",
    ".toml": "toml",
    ".md": "markdown",
    ".m": "matlab",
    ".c": "c",
    ".rs": "rust",
    ".json": "json",
    ".sh": "sh",
}
PICTURES = (".png", ".gif", ".svg")  # Sphinx copies them itself
HOME = {"README.md": "index", "docs/README.md": "index"}  # pages of the repository that the landing page replaces
# Folders of scripts that the site runs, and of what it makes.
SCRIPTS = {"docs/tutorial": "auto_tutorial", "docs/gallery": "auto_gallery"}
MADE = ("docs/api", "docs/files", "docs/auto_tutorial", "docs/auto_gallery")
# Pages of the repository that the contents of the site list.
LISTED_PAGES = ("ARCHITECTURE.md", "CHANGELOG.md", "CODE_OF_CONDUCT.md", "CONTRIBUTING.md", "SECURITY.md")
LISTED = 200  # files of a folder that its page lists


class Files:
    """The pages under ``files/``: made for each file that a page links to, and for those that these link to.

    Parameters
    ----------
    docs : folder of the pages.
    """

    def __init__(self, docs: Path) -> None:
        self.docs, self.root = docs, docs.parent
        self.pages: dict[str, str] = {}  # text by the name of a page

    def rewrite(self, text: str, place: Path, page: str) -> str:
        """Return a page whose links out of docs/ lead to pages of the site, and show titles in place of files' names.

        Parameters
        ----------
        text : Markdown.
        place : folder to which its links are relative.
        page : name under which it stands in the site.
        """
        up = "../" * page.count("/")

        def replace(found: re.Match[str]) -> str:
            target = Path(os.path.normpath(place / found[2]))
            if not target.exists() or not target.is_relative_to(self.root):
                return found[0]
            inside = target.relative_to(self.root).as_posix()
            if inside in HOME:
                return f"{found[1]}{up}{HOME[inside]}.md{found[3]}"
            if target.is_relative_to(self.docs) and target.is_file() and target.suffix != ".py":
                return f"{found[1]}{up}{target.relative_to(self.docs).as_posix()}{found[3]}"
            for scripts, made in SCRIPTS.items():
                if inside == scripts:
                    return f"{found[1]}{up}{made}/index.rst{found[3]}"
                if PurePosixPath(inside).is_relative_to(scripts) and target.suffix == ".py":
                    return f"{found[1]}{up}{made}/{PurePosixPath(inside).relative_to(scripts).with_suffix('.rst')})"
            if target.suffix in PICTURES:
                return f"{found[1]}{up}../{inside}{found[3]}"
            return f"{found[1]}{up}{self.add(target)}.md{found[3] if target.suffix == '.md' else ')'}"

        blocks = FENCE.split(text)
        blocks[::2] = [ADDRESS.sub(replace, NAMED.sub(r"[\1", block)) for block in blocks[::2]]
        return "".join(blocks)

    def add(self, target: Path) -> str:
        """Add the page of a file or folder, and return its name."""
        inside = target.relative_to(self.root)
        page = f"files/{(inside.with_suffix('') if inside.suffix == '.md' else inside).as_posix()}"
        if page in self.pages:
            return page
        self.pages[page] = ""  # begun: a page may link to itself
        if target.is_dir():
            text = self._folder(target, page)
        elif target.suffix == ".md":
            text = self.rewrite(target.read_text(encoding="utf-8"), target.parent, page)
        else:
            file = "../" * (page.count("/") + 1) + inside.as_posix()
            options = f":language: {LANGUAGES.get(target.suffix, 'text')}\n:linenos:"
            text = f"# {inside.as_posix()}\n\n```{{literalinclude}} {file}\n{options}\n```\n"
        self.pages[page] = f"---\norphan: true\n---\n\n{text}"
        return page

    def _folder(self, folder: Path, page: str) -> str:
        hidden = ("__pycache__", ".")
        inside = [file for file in sorted(folder.iterdir()) if not file.name.startswith(hidden)][:LISTED]
        texts = [file for file in inside if file.is_dir() or file.suffix in LANGUAGES]
        up = "../" * page.count("/")
        rows = [f"- [{file.name}{'/' * file.is_dir()}]({up}{self.add(file)}.md)" for file in texts]
        return "\n".join([f"# {folder.relative_to(self.root).as_posix()}/", "", *rows, ""])


def pages_of(docs: Path) -> list[Path]:
    """Return the Markdown of docs/ that is written by hand, in a stable order."""
    made = tuple(docs.parent / folder for folder in MADE)
    return [page for page in sorted(docs.rglob("*.md")) if not any(page.is_relative_to(folder) for folder in made)]


def write_files(app):
    """Write a page for each file that pages link to; one that has not changed is not touched."""
    docs = Path(app.srcdir)
    files = Files(docs)
    for page in pages_of(docs):
        files.rewrite(page.read_text(encoding="utf-8"), page.parent, page.relative_to(docs).as_posix())
    for name in LISTED_PAGES:
        files.add(docs.parent / name)
    for name, text in files.pages.items():
        file = docs / f"{name}.md"
        file.parent.mkdir(parents=True, exist_ok=True)
        if not file.exists() or file.read_text(encoding="utf-8") != text:
            file.write_text(text, encoding="utf-8")
    names = {(docs / f"{name}.md").resolve() for name in files.pages}
    for stale in (docs / "files").rglob("*.md"):  # of an earlier build
        if stale.resolve() not in names:
            stale.unlink()


def rewrite_source(app, docname, source):
    """Rewrite the links of a page as Sphinx reads it."""
    docs = Path(app.srcdir)
    file = docs / f"{docname}.md"
    if file.exists() and not docname.startswith("files/"):
        source[0] = Files(docs).rewrite(source[0], file.parent, docname)


def setup(app):
    """Connect both to Sphinx."""
    app.connect("builder-inited", write_files, priority=100)
    app.connect("source-read", rewrite_source)
    return {"parallel_read_safe": True, "parallel_write_safe": True}

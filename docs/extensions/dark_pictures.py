"""Pictures with a dark twin: the site shows `name.png` on its light theme, and `name_dark.png` on its dark theme."""

from pathlib import Path

from docutils import nodes
from sphinx.transforms import SphinxTransform


class DarkPictures(SphinxTransform):
    """Add the dark twin of each picture behind it; the theme hides one of the two."""

    default_priority = 100  # before Sphinx collects the pictures of a page

    def apply(self, **_):
        """Add the twins of one page."""
        folder = Path(self.env.doc2path(self.env.docname)).parent
        for picture in list(self.document.findall(nodes.image)):
            file = Path(picture["uri"])
            twin = file.with_name(f"{file.stem}_dark{file.suffix}")
            if "://" in picture["uri"] or not (folder / twin).exists():
                continue
            dark = picture.deepcopy()
            dark["uri"] = twin.as_posix()
            picture["classes"].append("only-light")
            dark["classes"].append("only-dark")
            picture.parent.insert(picture.parent.index(picture) + 1, dark)


def setup(app):
    """Register the transform."""
    app.add_transform(DarkPictures)
    return {"parallel_read_safe": True, "parallel_write_safe": True}

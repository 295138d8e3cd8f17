"""The long description of the package: README.md with absolute links, because an index shows it without the repository."""

import re
from pathlib import Path

from hatchling.metadata.plugin.interface import MetadataHookInterface

ADDRESS = r"\((?![a-z]+:|#)([^)\s]+)\)"
PICTURE = re.compile(r"(!\[[^\]]*\])" + ADDRESS)
LINK = re.compile(r"((?<!!)\[(?:[^\[\]]|\[[^\]]*\])*\])" + ADDRESS)  # a picture may be the text of a link


def make_links_absolute(text, source, version):
    """Return a Markdown text whose links and pictures point into the tagged repository.

    Parameters
    ----------
    text : Markdown with links relative to the top folder of the repository.
    source : address of the repository.
    version : of the package; its tag is ``v<version>``.
    """
    parts = re.split(r"^(```.*?^```$)", text, flags=re.DOTALL | re.MULTILINE)  # links in code are code
    for index in range(0, len(parts), 2):
        for pattern, kind in ((PICTURE, "raw"), (LINK, "blob")):
            parts[index] = pattern.sub(rf"\1({source}/{kind}/v{version}/\2)", parts[index])
    return "".join(parts)


class LongDescription(MetadataHookInterface):
    """Metadata hook of hatchling that fills the dynamic field `readme`."""

    def update(self, metadata):
        """Fill `readme`.

        Parameters
        ----------
        metadata : table `[project]`, which is changed.
        """
        text = (Path(self.root) / "README.md").read_text(encoding="utf-8")
        text = make_links_absolute(text, metadata["urls"]["Source"], metadata["version"])
        metadata["readme"] = {"content-type": "text/markdown", "text": text}

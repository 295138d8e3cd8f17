"""Licence, creators and web address of a dataset: stated once, and kept when its files are written again."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rso_lidar.errors import DatasetError

CROISSANT = "croissant.json"
SPDX = "https://spdx.org/licenses/"


@dataclass(frozen=True)
class Attribution:
    """Licence (an SPDX identifier), creators and web address of a dataset; None or empty where nobody stated them."""

    licence: str | None = None
    creators: tuple[str, ...] = ()
    url: str | None = None

    def __post_init__(self) -> None:
        if self.licence is not None and not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9.+-]*", self.licence):
            raise DatasetError(f"licence {self.licence!r:.60}: is no SPDX identifier; write for example CC-BY-4.0")
        if self.url is not None and not re.fullmatch(r"https?://[^\s\"<>]+", self.url):
            raise DatasetError(f"url {self.url!r:.60}: is no web address; write for example https://example.org/set")
        if not all(name.strip() and name.isprintable() for name in self.creators):
            raise DatasetError("creator: an empty name, or one with control characters; write the name in one line")


def read_attribution(folder: Path) -> Attribution:
    """Read the licence, creators and web address that an earlier publication of a dataset stated.

    Returns
    -------
    Attribution
        Empty if there is no earlier publication, or its file cannot be read.
    """
    try:
        description: dict[str, Any] = json.loads((folder / CROISSANT).read_text(encoding="utf-8"))
        return Attribution(
            licence=description["license"].removeprefix(SPDX).removesuffix(".html")
            if "license" in description
            else None,
            creators=tuple(creator["name"] for creator in description.get("creator", [])),
            url=description.get("url"),
        )
    except (OSError, ValueError, TypeError, KeyError, AttributeError, RecursionError):
        return Attribution()

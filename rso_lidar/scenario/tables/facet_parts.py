"""Parts of a user's mesh, given by a table of its facets or by the materials of its file."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Literal, Self

from pydantic import Field, model_validator

from rso_lidar.errors import add_place
from rso_lidar.part import Part, Text
from rso_lidar.scene import Mesh, group_facets


class FacetParts(Part):
    """Which facet belongs to what part, for a mesh whose file does not name its parts, or names others.

    Facets have the numbers that they have in the mesh's file, from 0, counted over its parts in order: the label `facet`.
    A .csv has the columns facet and part, where a facet is a number or a span such as 10-19. A .npy holds an integer for
    each facet, -1 for none, and the parts have the integers as names. Facets that the table leaves out keep the parts of
    the file. A part whose name is a common part class, or that of a part of a shipped model, has its class.
    """

    file: Text | None = Field(
        default=None,
        description="Path of a .csv file (facet, part), or of a .npy file with one integer for each facet. Not with `by`.",
    )
    by: Literal["material"] | None = Field(
        default=None,
        description="`material`: each material of the file is a part: `usemtl` of OBJ, or a material of glTF.",
    )

    @model_validator(mode="after")
    def _one(self) -> Self:
        if (self.file is None) == (self.by is None):
            raise ValueError('give file, a table of facets, or by = "material"; one of the two')
        return self


def apply_facet_parts(mesh: Mesh, facet_parts: FacetParts, file: Callable[[str], Path]) -> Mesh:
    """Return a mesh with the parts that a table or its own file gives."""
    with add_place("facet_parts"):
        if facet_parts.file is None:
            return _group_once(mesh, None, None)
        path = file(facet_parts.file)
        status = path.stat() if path.is_file() else None
        return _group_once(mesh, path, None if status is None else (status.st_mtime_ns, status.st_size))


@lru_cache(maxsize=16)
def _group_once(mesh: Mesh, table: Path | None, _stamp: tuple[int, int] | None) -> Mesh:
    return group_facets(mesh, table)

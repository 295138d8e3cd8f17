"""A model of the user's own library, as a recording states it."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from rso_lidar.errors import MeshError
from rso_lidar.part import Part, Positive, Text, Whole
from rso_lidar.scene import ModelEntry


class LibraryModel(Part):
    """A model of the user's own library, as it was when the scenario was recorded.

    Recordings carry this table. A scenario is refused where the library's model of that name has changed since. Materials,
    part classes, keypoints, centre of mass, taxonomy and hinges are not part of this table, because the recorded target
    itself gives them.
    """

    sha256: Text = Field(description="SHA-256 of the mesh file.")
    scale: Positive = Field(default=1.0, description="Metres per unit of the file.")
    mesh_axes: Literal["z_up", "y_up"] = Field(
        default="z_up",
        description=(
            "Axes of the file. `z_up`: coordinates apply as they are. `y_up`: the library turns the file's y upward."
        ),
    )
    left_out: tuple[tuple[Whole, Whole], ...] = Field(
        default=(),
        description="First and last index of each run of facets in the file that do not belong to the craft.",
    )
    facet_parts_sha256: Text | None = Field(
        default=None, description="SHA-256 of the table of the parts of facets, where the library has one."
    )

    def check(self, entry: ModelEntry) -> None:
        """Raise `MeshError` where the catalogue's model of that name has changed."""
        if not entry.own:
            raise MeshError(
                f"model '{entry.name}': was one of the user's own library, and a shipped one has that name now; "
                "add it under another name, and say that in model"
            )
        now = describe_library_model(entry)
        changed = [key for key in type(self).model_fields if getattr(now, key) != getattr(self, key)]
        if changed:
            what = ", ".join(
                f"{key} {_shorten(getattr(self, key))}, now {_shorten(getattr(now, key))}" for key in changed
            )
            raise MeshError(
                f"model '{entry.name}': has changed since the recording ({what}); "
                "add it to your library as it was (`rso-lidar models add --overwrite`)"
            )


def describe_library_model(entry: ModelEntry) -> LibraryModel:
    """Describe a model of the user's library."""
    axes: Literal["z_up", "y_up"] = "y_up" if entry.mesh_axes == "y_up" else "z_up"
    return LibraryModel(
        sha256=entry.sha256,
        scale=entry.scale,
        mesh_axes=axes,
        left_out=entry.left_out,
        facet_parts_sha256=entry.facet_parts_sha256,
    )


def _shorten(value: object) -> str:
    if isinstance(value, tuple):
        return " and ".join(f"{first} to {last}" for first, last in value) or "nothing"
    text = f"{value:.9g}" if isinstance(value, float) else str(value)
    return text if len(text) <= 24 else f"{text[:12]}..."

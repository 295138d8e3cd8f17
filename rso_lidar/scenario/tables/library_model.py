"""What a user's own library makes of a mesh file, as a recording carries it: flown again only where it still does."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from rso_lidar.errors import MeshError
from rso_lidar.part import Part, Positive, Text, Whole
from rso_lidar.scene.library.catalogue import ModelEntry


class OfLibrary(Part):
    """What the user's own library makes of the model's file, as it was when the scenario was written out.

    Recordings carry it. Where the library makes another mesh of that name by now, the scenario is refused; all else that
    the library knows of the model (materials, centre of mass, taxonomy, hinges) stands in the target itself.
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

    def check(self, entry: ModelEntry) -> None:
        """Raise `MeshError` where the catalogue makes another mesh of that name."""
        if not entry.own:
            raise MeshError(
                f"model '{entry.name}': was one of the user's own library, and a shipped one has that name now; "
                "add it under another name, and say that in model"
            )
        now = of_library(entry)
        changed = [key for key in type(self).model_fields if getattr(now, key) != getattr(self, key)]
        if changed:
            what = ", ".join(f"{key} {_short(getattr(self, key))}, now {_short(getattr(now, key))}" for key in changed)
            raise MeshError(
                f"model '{entry.name}': is no longer what was flown ({what}); "
                "add it to your library as it was (`rso-lidar models add --overwrite`)"
            )


def of_library(entry: ModelEntry) -> OfLibrary:
    """Return what the user's library makes of the file of one of its models."""
    axes: Literal["z_up", "y_up"] = "y_up" if entry.mesh_axes == "y_up" else "z_up"
    return OfLibrary(sha256=entry.sha256, scale=entry.scale, mesh_axes=axes, left_out=entry.left_out)


def _short(value: object) -> str:
    if isinstance(value, tuple):
        return " and ".join(f"{first} to {last}" for first, last in value) or "nothing"
    text = f"{value:.9g}" if isinstance(value, float) else str(value)
    return text if len(text) <= 24 else f"{text[:12]}..."

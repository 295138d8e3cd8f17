"""A model as its builder describes it: named parts, each a closed solid of one material with an estimated mass."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from rso_lidar.records import Hinge, PartClass, Symmetry, Taxonomy
from rso_lidar.shapes.part_classes import classify_parts
from rso_lidar.shapes.solids import Solid


@dataclass(frozen=True)
class CraftPart:
    """Named part of a craft.

    `mass_kg` is an estimate, uniform over the volume, or over the surface of a `hollow` part.
    """

    solid: Solid
    material: str
    mass_kg: float
    hollow: bool = False

    def turn(self, axis: str, angle_deg: float) -> CraftPart:
        """Return the part turned about an axis of the model.

        Parameters
        ----------
        axis : "x", "y" or "z"
        angle_deg : right-handed angle [deg]
        """
        return replace(self, solid=self.solid.turn(axis, angle_deg))


@dataclass(frozen=True)
class CraftModel:
    """Model of a craft: its parts, its hinges, and its entries in the index."""

    name: str
    what: str
    source: str
    confidence: str
    axes: str
    pieces: Mapping[str, CraftPart]
    taxonomy: Taxonomy
    hinges: tuple[Hinge, ...] = ()
    symmetry: Symmetry | None = None

    @property
    def parts(self) -> dict[str, Solid]:
        """Solids (vertices [m], facets) by part name."""
        return {name: piece.solid for name, piece in self.pieces.items()}

    @property
    def materials(self) -> dict[str, str]:
        """Names of the materials by part name."""
        return {name: piece.material for name, piece in self.pieces.items()}

    @property
    def part_classes(self) -> dict[str, PartClass]:
        """Common part classes by part name."""
        return classify_parts(self.pieces)

    @property
    def facet_count(self) -> int:
        """Number of facets of all parts."""
        return sum(len(solid.facets) for solid in self.parts.values())

    @property
    def size_m(self) -> np.ndarray:
        """Extents along x, y, z [m]."""
        vertices = np.concatenate([solid.vertices for solid in self.parts.values()])
        return np.asarray(vertices.max(axis=0) - vertices.min(axis=0))

    @property
    def mass_kg(self) -> float:
        """Estimated mass [kg]."""
        return sum(piece.mass_kg for piece in self.pieces.values())

    @property
    def center_of_mass_m(self) -> np.ndarray:
        """Estimated centre of mass in the axes of the model [m]."""
        return _moments(self)[0]

    @property
    def inertia_kg_m2(self) -> np.ndarray:
        """Estimated inertia tensor (3, 3) about the centre of mass, in the axes of the model [kg m2]."""
        return _moments(self)[1]


def _moments(model: CraftModel) -> tuple[np.ndarray, np.ndarray]:
    """Return centre of mass and inertia from exact integrals over tetrahedra (solid) or triangles (hollow).

    Let a, b, c be the corners of a triangle and s = a + b + c. The second moment S of the tetrahedron between the
    triangle and the origin is V/20 (aa' + bb' + cc' + ss'). That of the triangle alone is A/12 (aa' + bb' + cc' +
    ss'). The inertia is tr(S) 1 - S.
    """
    first, second = np.zeros(3), np.zeros((3, 3))
    for piece in model.pieces.values():
        a, b, c = (piece.solid.vertices[piece.solid.facets[:, k]] for k in range(3))
        s = a + b + c
        if piece.hollow:
            weight = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2.0
            arm, divisor = s / 3.0, 12.0
        else:
            weight = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6.0
            arm, divisor = s / 4.0, 20.0
        weight = weight * (piece.mass_kg / weight.sum())
        first += weight @ arm
        second += sum(np.einsum("i,ij,ik->jk", weight, corner, corner) for corner in (a, b, c, s)) / divisor
    center = first / model.mass_kg
    second -= model.mass_kg * np.outer(center, center)
    return center, np.trace(second) * np.eye(3) - second

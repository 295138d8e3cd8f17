"""The bodies of a scenario: targets, and the follower that carries the lidar."""

from functools import cached_property
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, Strict, model_validator

from rso_lidar.errors import MeshError, ScenarioError
from rso_lidar.motion import RESERVED_AXES, Body, HingeAxes
from rso_lidar.part import Positive, Text, Vector
from rso_lidar.records import Keypoint, PartClass, Symmetry, Taxonomy
from rso_lidar.scenario.tables.facet_materials import FacetMaterials
from rso_lidar.scenario.tables.facet_parts import FacetParts
from rso_lidar.scenario.tables.fragment import Fragment, name_fragment
from rso_lidar.scenario.tables.joints import Joint, ModelPlacement, complete_joint
from rso_lidar.scenario.tables.library_model import LibraryModel
from rso_lidar.scenario.tables.terrain import Terrain, name_terrain
from rso_lidar.scene import AnyMaterial, is_mesh_path, model

Colour = Annotated[str, Strict(), Field(pattern=r"^#[0-9A-Fa-f]{6}$")]


class Target(Body):
    """A body with a surface.

    `model` is a name of the catalogue, or, with a suffix or a slash, the path of a mesh. `terrain` replaces it by ground of
    heights, from a file or generated from a random seed, and `fragment` by debris of a random seed. Materials are chosen in
    this order: `facet_materials`, `color_materials`, `part_materials`, `material`, and those of the catalogue model or of
    the fragment. Another mesh defaults to the Lambertian 0.30 of Fuller et al. The body's origin is `center_of_mass_m`, in
    the mesh's own axes after scaling.
    """

    model: Text | None = Field(
        default=None,
        description=(
            "Name in the catalogue or in your own library (`rso-lidar models`), or the path of an STL, OBJ, PLY, GLB, "
            "glTF or OFF file. Give exactly one of this, `terrain` and `fragment`."
        ),
    )
    terrain: Terrain | None = Field(default=None, description="Terrain in place of `model`.")
    fragment: Fragment | None = Field(default=None, description="Fragment of a break-up in place of `model`.")
    scale: Positive | None = Field(default=None, description="Metres per unit of the file; not together with `size_m`.")
    size_m: Positive | None = Field(
        default=None, description="Longest side of the mesh's bounding box, to which the mesh is scaled [m]."
    )
    mesh_axes: Literal["z_up", "y_up"] = Field(
        default="z_up",
        description="Axes of the file. `z_up`: coordinates apply as they are. `y_up`: the file's y becomes body z.",
    )
    material: AnyMaterial | None = Field(
        default=None,
        description=(
            "Material of all parts: a table, or a name of the catalogue such as `mli_gold`. If omitted, a catalogue "
            "model keeps its own; another mesh is Lambertian with reflectance 0.30."
        ),
    )
    part_materials: dict[Text, AnyMaterial] = Field(
        default_factory=dict,
        description="Materials of named parts, as tables or catalogue names; they override `material`.",
    )
    part_classes: dict[Text, PartClass] = Field(
        default_factory=dict,
        description=(
            "Common part classes of named parts, such as `solar_array`; they override the catalogue's. By default, parts "
            "of a mesh named by its path are `other`, and those of `facet_parts` have the class of their name."
        ),
    )
    facet_parts: FacetParts | None = Field(
        default=None,
        description=(
            "Parts of a mesh named by its path, by a table of its facets or by the materials of its file. If omitted, "
            "those that the file names."
        ),
    )
    color_materials: dict[Colour, AnyMaterial] = Field(
        default_factory=dict,
        description=(
            "Materials of the facets that have a given colour, such as `#a29225`, in a GLB or PLY file; they override "
            "the other materials."
        ),
    )
    facet_materials: FacetMaterials | None = Field(
        default=None, description="Materials of the facets that a file lists; they override the other materials."
    )
    smooth_parts: tuple[Text, ...] = Field(
        default=(),
        description=(
            "Names of parts that are curved in reality. Their normals are interpolated over the facets for the BRDF."
        ),
    )
    center_of_mass_m: Vector | None = Field(
        default=None,
        description=(
            "Origin of the body axes, in mesh axes after scaling [m]. If omitted, the catalogue's, or the mesh's "
            "origin with a warning."
        ),
    )
    keypoint: tuple[Keypoint, ...] | None = Field(
        default=None,
        description="Named points on the target, whose places in images are labelled. If omitted, those of the catalogue.",
    )
    keypoint_file: Text | None = Field(
        default=None,
        description=(
            "Path of a .csv file of keypoints (name, x, y, z, part), in the unit and axes of the mesh file, for a mesh that "
            "`model` names by its path; not together with `keypoint`."
        ),
    )
    joint: tuple[Joint, ...] = Field(default=(), description="Hinges that turn some of the target's parts.")
    taxonomy: Taxonomy | None = Field(
        default=None,
        description="Class of the target, for labels and for drawing datasets. If omitted, the catalogue's, or none.",
    )
    symmetry: Symmetry | None = Field(
        default=None,
        description=(
            "Rotations after which the target looks the same to a lidar, in mesh axes after scaling. If omitted, that of "
            "the catalogue if all hinges are at zero, or none. It changes labels only."
        ),
    )
    library: LibraryModel | None = Field(
        default=None,
        description="Record of a model of your own library, written into recordings. Do not set it in a scenario.",
    )

    @model_validator(mode="after")
    def _allowed(self) -> Self:
        if self.name in RESERVED_AXES:
            raise ValueError(f"name: '{self.name}' is reserved ({', '.join(RESERVED_AXES)}); choose another")
        given = sum(shape is not None for shape in (self.model, self.terrain, self.fragment))
        if given != 1:
            both = ", not both" if given else ""
            raise ValueError(f"give model, or terrain for ground of heights, or fragment for debris{both}")
        if self.model is None and (self.scale, self.size_m, self.mesh_axes) != (None, None, "z_up"):
            kind = "terrain" if self.terrain else "fragment"
            raise ValueError(f"scale, size_m and mesh_axes are for a mesh; {kind} says its size itself, and z is up")
        if self.facet_parts is not None and (self.model is None or not self.is_path):
            raise ValueError(
                "facet_parts is for a mesh that model names by its path; a model of your own library gets parts by "
                "`rso-lidar models add --facet-parts`"
            )
        if self.library is not None and self.is_path:
            raise ValueError("library is for a model of your own library, by its name; leave it out")
        if self.scale is not None and self.size_m is not None:
            raise ValueError("give scale or size_m, not both")
        if self.keypoint is not None and self.keypoint_file is not None:
            raise ValueError("give keypoint or keypoint_file, not both")
        if self.keypoint_file is not None and (self.model is None or not self.is_path):
            raise ValueError(
                "keypoint_file is for a mesh that model names by its path; give keypoint in body axes instead"
            )
        names = [joint.name for joint in self.joint]
        if len(set(names)) < len(names):
            raise ValueError(f"joint: two have the same name ({', '.join(names)}); rename one")
        try:
            _ = self.joints
        except (ScenarioError, MeshError) as error:
            raise ValueError(str(error)) from None
        return self

    @cached_property
    def joints(self) -> tuple[HingeAxes, ...]:
        """Hinges in body axes; fields that a joint leaves out come from its model."""
        if not self.joint or self.is_path or self.library is not None:
            return tuple(complete_joint(joint, self.shape) for joint in self.joint)  # a recording gives all fields
        entry = model(self.shape)
        scale = self.scale or (self.size_m / max(entry.size_m) if self.size_m else 1.0)
        center = self.center_of_mass_m
        center_m = np.array(center if center is not None else [scale * x for x in entry.center_of_mass_m])
        placement = ModelPlacement(scale, center_m, self.mesh_axes)
        declared = {hinge.name: hinge for hinge in entry.hinges}
        return tuple(complete_joint(joint, self.shape, declared, placement) for joint in self.joint)

    @property
    def is_path(self) -> bool:
        """Whether the shape is a file, terrain or a fragment, and no model of the catalogue."""
        return self.model is None or is_mesh_path(self.model)

    @property
    def shape(self) -> str:
        """`model`, or the file of terrain, or the kind and the random seed of generated ground or of a fragment."""
        if self.fragment is not None:
            return name_fragment(self.fragment)
        return self.model or (name_terrain(self.terrain) if self.terrain else "")


class Follower(Body):
    """The spacecraft that carries the lidar."""

    name: Literal["follower"] = Field(default="follower", description="Always `follower`; it may be omitted.")

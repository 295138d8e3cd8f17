"""The parts of a scenario that join rooms: time, world, target, follower."""

from functools import cached_property
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, Strict, model_validator

from rso_lidar.craft import Taxonomy
from rso_lidar.errors import MeshError, ScenarioError
from rso_lidar.motion import Body
from rso_lidar.motion.body import RESERVED
from rso_lidar.motion.joint import HingeAxes
from rso_lidar.part import Direction, Instant, Part, Positive, Text, Vector
from rso_lidar.scenario.tables.facet_materials import FacetMaterials
from rso_lidar.scenario.tables.hinges import Joint, joints_of
from rso_lidar.scenario.tables.library_model import OfLibrary
from rso_lidar.scenario.tables.terrain import Terrain, in_words
from rso_lidar.scene import Material

Colour = Annotated[str, Strict(), Field(pattern=r"^#[0-9A-Fa-f]{6}$")]
_MOST_FRAMES = 5_000_000


class Time(Part):
    """When frames are taken: round(duration_s * frame_rate_hz) of them, at k / frame_rate_hz after `start_utc`."""

    start_utc: Instant = Field(
        description="Start of the scenario, such as `2024-09-17T12:00:00Z`; a time without an offset is an error."
    )
    duration_s: Positive = Field(description="Duration of the scenario [s].")
    frame_rate_hz: Positive = Field(
        description="Laser flashes per second [Hz]: round(duration × rate) frames at times k / rate, the end excluded."
    )

    @model_validator(mode="after")
    def _some_frames(self) -> Self:
        frames = self.duration_s * self.frame_rate_hz
        if frames < 0.5 or round(frames) < 1:
            raise ValueError(
                f"duration_s * frame_rate_hz is {frames:.3g}, which makes no frame; give a longer duration or a higher rate"
            )
        if frames > _MOST_FRAMES:
            raise ValueError(f"duration_s * frame_rate_hz is {frames:.3g} frames, over {_MOST_FRAMES:,}; split the run")
        return self

    @property
    def n_frames(self) -> int:
        """Return how many frames the scenario has."""
        return round(self.duration_s * self.frame_rate_hz)

    def seconds(self, frames: np.ndarray) -> np.ndarray:
        """Return the instants [s since start_utc] of frames by number."""
        return np.asarray(frames, dtype=float) / self.frame_rate_hz


class World(Part):
    """What the root axes are: ``inertial`` is GCRS about the Earth, ``local`` a bench or terrain without an Earth.

    A local world has a Sun only where `sun_direction`, from the origin toward it in root axes, says so; nothing eclipses it.
    """

    axes: Literal["inertial", "local"] = Field(
        default="inertial",
        description=(
            "Root axes. `inertial`: GCRS about the Earth. `local`: a bench without an Earth, where orbits are refused."
        ),
    )
    sun_direction: Direction | None = Field(
        default=None,
        description=(
            "Direction to the Sun in `local` axes; if omitted, there is no Sun. In `inertial` axes the date "
            "determines it."
        ),
    )

    @model_validator(mode="after")
    def _one_sun(self) -> Self:
        if self.sun_direction is not None and self.axes != "local":
            raise ValueError('sun_direction is for axes = "local"; in inertial axes the date says where the Sun is')
        return self


class Target(Body):
    """A body with a surface.

    `model` is a name of the catalogue, or, with a suffix or a slash, the path of a mesh; `terrain`, in its place, is ground
    of heights, from a file or made by seed. `scale` turns a mesh's unit into metres, or `size_m` sets its longest side.
    Without `material` a catalogue model keeps its own, another mesh is the seed's Lambertian 0.30; `part_materials`
    overrides by part, `color_materials` by the colour that the file gives a facet, and `facet_materials` by facet.
    `smooth_parts` are curved: normals are interpolated over their facets. `center_of_mass_m` is the body's origin in the
    mesh's own axes, after scaling. Each `joint` turns some parts about a hinge; a hinge that the model declares needs no
    more than its name and an angle. `taxonomy` is where the target belongs; a catalogue model brings its own.
    `library` is what a recording says of a model of the user's own library; who writes a scenario leaves it out.
    """

    model: Text | None = Field(
        default=None,
        description=(
            "Name in the catalogue or in your own library (`rso-lidar models`), or the path of an STL, OBJ, PLY, GLB, "
            "glTF or OFF file. Give exactly one of this and `terrain`."
        ),
    )
    terrain: Terrain | None = Field(default=None, description="Terrain in place of `model`.")
    scale: Positive | None = Field(default=None, description="Metres per unit of the file; not together with `size_m`.")
    size_m: Positive | None = Field(
        default=None, description="Longest side of the mesh's bounding box, to which the mesh is scaled [m]."
    )
    mesh_axes: Literal["z_up", "y_up"] = Field(
        default="z_up",
        description="Axes of the file. `z_up`: coordinates apply as they are. `y_up`: the file's y becomes body z.",
    )
    material: Material | None = Field(
        default=None,
        description=(
            "Material of all parts: a table, or a name of the catalogue such as `mli_gold`. If omitted, a catalogue "
            "model keeps its own; another mesh is Lambertian with reflectance 0.30."
        ),
    )
    part_materials: dict[Text, Material] = Field(
        default_factory=dict,
        description="Materials of named parts, as tables or catalogue names; they override `material`.",
    )
    color_materials: dict[Colour, Material] = Field(
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
    joint: tuple[Joint, ...] = Field(default=(), description="Hinges that turn some of the target's parts.")
    taxonomy: Taxonomy | None = Field(
        default=None,
        description="Class of the target, for labels and for drawing datasets. If omitted, the catalogue's, or none.",
    )
    library: OfLibrary | None = Field(
        default=None,
        description="Record of a model of your own library, written into recordings. Do not set it in a scenario.",
    )

    @model_validator(mode="after")
    def _allowed(self) -> Self:
        if self.name in RESERVED:
            raise ValueError(f"name: '{self.name}' is reserved ({', '.join(RESERVED)}); choose another")
        if (self.model is None) == (self.terrain is None):
            both = "" if self.model is None else ", not both"
            raise ValueError(f"give model, or terrain for ground of heights{both}")
        if self.terrain is not None and (self.scale, self.size_m, self.mesh_axes) != (None, None, "z_up"):
            raise ValueError("scale, size_m and mesh_axes are for a mesh; terrain says its size itself, and z is up")
        if self.library is not None and self.is_path:
            raise ValueError("library is for a model of your own library, by its name; leave it out")
        if self.scale is not None and self.size_m is not None:
            raise ValueError("give scale or size_m, not both")
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
        """Return the hinges of the body, those of its model completed."""
        return joints_of(self)

    @property
    def is_path(self) -> bool:
        """Return whether the shape comes from a file, or is made, rather than from the catalogue."""
        return self.terrain is not None or any(sign in self.shape for sign in "/\\.")

    @property
    def shape(self) -> str:
        """Return `model`, or what stands in its place for terrain: the file, or how it is made and of which seed."""
        return self.model or (in_words(self.terrain) if self.terrain else "")


class Follower(Body):
    """The spacecraft that carries the lidar."""

    name: Literal["follower"] = Field(default="follower", description="Always `follower`; it may be omitted.")

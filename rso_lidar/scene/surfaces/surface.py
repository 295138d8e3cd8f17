"""Surfaces: a target's mesh in body axes, with the material of every facet."""

import hashlib
from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from threading import Lock
from typing import Any
from weakref import WeakValueDictionary

import numpy as np

from rso_lidar.errors import MeshError, add_place
from rso_lidar.scene.embree.engine import Engine, Scene
from rso_lidar.scene.embree.ray_by_ray import build_embreex
from rso_lidar.scene.materials.phong import Lambertian
from rso_lidar.scene.materials.scatterer import Material, Scatterer, complete
from rso_lidar.scene.meshes.mesh import FARTHEST_M, Mesh, body_from_mesh
from rso_lidar.scene.surfaces.shading import average_corner_normals, interpolate_normals

_scenes: OrderedDict[str, Any] = OrderedDict()
_held: WeakValueDictionary[str, Scene] = WeakValueDictionary()
_scenes_lock = Lock()
ANGLES = 1024  # of incidence at which `Surface.brdf_table` holds the BRDF, every 0.09 degrees
_SCENES_KEPT = 64  # targets of a scenario or a study; beyond that the least recently used are built again


@dataclass(frozen=True, eq=False)
class Surface:
    """The facets of one target in its body axes, in metres about the centre of mass. Facets are two-sided.

    Attributes
    ----------
    name : axes that the surface is in: the target's, or those of a hinge, such as ``tdrs.array``
    mesh : parts and facets
    vertices : (vertex, xyz) f8 [m], which replace the mesh's own
    materials : one for each part, then those of single facets
    smooth : numbers of the parts that are curved, whose normals are interpolated over the facets
    target : number of the target (None: the position among all surfaces)
    material_of : (facet), index of the material of each facet (None: that of its part)
    """

    name: str
    mesh: Mesh
    vertices: np.ndarray
    materials: tuple[Scatterer, ...]
    smooth: tuple[int, ...] = ()
    target: int | None = None
    material_of: np.ndarray | None = None

    @property
    def body(self) -> str:
        """Name of the target."""
        return self.name.partition(".")[0]

    @property
    def facets(self) -> np.ndarray:
        """Vertex indices (facet, 3)."""
        return self.mesh.facets

    @property
    def part(self) -> np.ndarray:
        """Part of each facet (facet)."""
        return self.mesh.part

    @property
    def finish(self) -> np.ndarray:
        """Index of the material of each facet (facet)."""
        return self.part if self.material_of is None else self.material_of

    @cached_property
    def corners(self) -> np.ndarray:
        """Corners (facet, 3, xyz) f8 [m]."""
        corners: np.ndarray = self.vertices[self.facets]
        return corners

    @cached_property
    def planes(self) -> np.ndarray:
        """Planes of the facets (4, facet) f8: unit normal x, y, z by winding, and n · p [m].

        Winding is mixed in many meshes, so the normal may point inward.
        """
        corners = self.corners
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        offset = np.einsum("fi,fi->f", normal, corners.mean(axis=1))
        return np.ascontiguousarray(np.column_stack([normal, offset]).T)

    @property
    def areas_m2(self) -> np.ndarray:
        """Areas (facet) [m²]."""
        corners = self.corners
        double = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        areas: np.ndarray = 0.5 * np.linalg.norm(double, axis=1)
        return areas

    @property
    def area_m2(self) -> float:
        """Area of all facets [m²], one side of each."""
        return float(self.areas_m2.sum())

    @cached_property
    def sphere(self) -> tuple[np.ndarray, float]:
        """Centre (xyz) and radius [m] of a sphere that holds the surface."""
        used = self.corners.reshape(-1, 3)
        centre = 0.5 * (used.min(axis=0) + used.max(axis=0))
        return centre, float(np.linalg.norm(used - centre, axis=1).max())

    @cached_property
    def radius_m(self) -> float:
        """Distance [m] of the farthest point from the body's origin."""
        return float(np.linalg.norm(self.corners.reshape(-1, 3), axis=1).max())

    @cached_property
    def outline(self) -> np.ndarray:
        """Points (point, xyz) of the convex hull, which bounds the projection of the surface."""
        from scipy.spatial import ConvexHull, QhullError

        used = np.unique(self.vertices[np.unique(self.facets)], axis=0)
        try:
            return used[ConvexHull(used).vertices] if len(used) > 64 else used
        except QhullError:  # a flat sheet has no hull in space
            low, high = used.min(axis=0), used.max(axis=0)
            return np.array(np.meshgrid(*zip(low, high, strict=True))).reshape(3, -1).T

    @cached_property
    def content(self) -> str:
        """Hash of the geometry, the key of its acceleration structure."""
        return hashlib.sha256(self.corners.astype(np.float32).tobytes()).hexdigest()

    @property
    def embree(self) -> Any:
        """Acceleration structure in embreex of this surface in body axes, built once for each geometry."""
        with _scenes_lock:
            if self.content not in _scenes:
                _scenes[self.content] = build_embreex(self.corners)
                while len(_scenes) > _SCENES_KEPT:
                    _scenes.popitem(last=False)
            _scenes.move_to_end(self.content)
            return _scenes[self.content]

    def scene(self, engine: Engine) -> Scene:
        """Return the acceleration structure of this surface in body axes, built once for each geometry.

        Parameters
        ----------
        engine : embree, or its substitute that casts ray by ray
        """
        key = f"{self.content} {engine.width}"
        with _scenes_lock:
            scene = _held.get(key)
            _scenes[key] = _held[key] = scene = scene or engine.build(self.corners)
            _scenes.move_to_end(key)
            while len(_scenes) > _SCENES_KEPT:
                _scenes.popitem(last=False)  # a cast in progress keeps its own reference
            return scene

    @cached_property
    def lambertian_per_sr(self) -> np.ndarray:
        """BRDF [1/sr] of each facet (facet) whose material looks the same from everywhere, NaN of others."""
        brdf: np.ndarray = np.array([material.lambertian_per_sr for material in self.materials])[self.finish]
        return brdf

    @cached_property
    def brdf_table(self) -> np.ndarray:
        """BRDF [1/sr] of each material toward the light (material, angle), at even angles of incidence from 0 to 90°.

        It is good enough to tell bright facets from dim ones, and is not used for light.
        """
        cosine = np.cos(np.linspace(0.0, 0.5 * np.pi, ANGLES))
        table = np.stack([material.brdf_per_sr(cosine) for material in self.materials])
        table.flags.writeable = False
        return table

    @cached_property
    def is_lambertian(self) -> bool:
        """Whether all facets look the same from everywhere."""
        return not np.isnan(self.lambertian_per_sr).any()

    def brdf_per_sr(
        self,
        facet: np.ndarray,
        cos_in: np.ndarray,
        cos_out: np.ndarray | None = None,
        cos_phase: np.ndarray | None = None,
    ) -> np.ndarray:
        """Return the BRDF [1/sr] of hits.

        Parameters
        ----------
        facet : (hit), number of the facet
        cos_in, cos_out, cos_phase : as in `Scatterer.brdf_per_sr`
        """
        if all(material == self.materials[0] for material in self.materials):
            return self.materials[0].brdf_per_sr(cos_in, cos_out, cos_phase)
        return self.evaluate_by_material(
            facet,
            lambda material, of: material.brdf_per_sr(
                cos_in[of], None if cos_out is None else cos_out[of], None if cos_phase is None else cos_phase[of]
            ),
        )

    def evaluate_by_material(
        self, facet: np.ndarray, evaluate: Callable[[Scatterer, np.ndarray], np.ndarray]
    ) -> np.ndarray:
        """Evaluate a function of hits, material by material.

        Parameters
        ----------
        facet : (hit) numbers of the facets that are hit
        evaluate : called with a material and the numbers of its hits (n,), returns one value for each (n,)

        Returns
        -------
        (hit) f8.
        """
        finish = self.finish[facet]
        answer = np.empty(len(facet))
        for number, material in enumerate(self.materials):
            of_it = np.flatnonzero(finish == number)
            if len(of_it):
                answer[of_it] = evaluate(material, of_it)
        return answer

    @cached_property
    def is_smooth(self) -> np.ndarray:
        """Whether each facet belongs to a smooth part (facet)."""
        return np.isin(self.part, self.smooth)

    @cached_property
    def crinkled(self) -> dict[int, Scatterer]:
        """Materials made of tilted cells, by index."""
        return {number: material for number, material in enumerate(self.materials) if material.rms_slope > 0.0}

    @cached_property
    def is_retro(self) -> np.ndarray:
        """Whether each facet is a retro-reflector (facet)."""
        is_retro: np.ndarray = np.array([material.is_retro for material in self.materials])[self.finish]
        return is_retro

    @property
    def has_own_normals(self) -> bool:
        """Whether the BRDF gets a normal other than the facet's somewhere."""
        return bool(self.smooth or self.crinkled)

    @cached_property
    def _corner_normals(self) -> tuple[np.ndarray, np.ndarray]:
        """Position of each facet among the smooth ones (facet), and their unit normals (smooth, corner, xyz)."""
        number = np.cumsum(self.is_smooth) - 1
        on = np.flatnonzero(self.is_smooth)
        return number, average_corner_normals(self.corners[on], self.planes[:3, on].T, self.part[on])

    def shading_normals(self, facet: np.ndarray, point: np.ndarray) -> np.ndarray:
        """Return the unit normals (hit, xyz) at points (hit, xyz) [m] of the facets numbered `facet` (hit), in body axes.

        On smooth parts they are interpolated between the corners. Elsewhere they are the facet's own.

        Parameters
        ----------
        facet : (hit) numbers of the facets
        point : (hit, xyz) points on them in body axes [m]
        """
        normal = np.stack([self.planes[axis][facet] for axis in range(3)], axis=1)
        curved = np.flatnonzero(self.is_smooth[facet])
        if len(curved):
            number, normals = self._corner_normals
            of = facet[curved]
            normal[curved] = interpolate_normals(self.corners[of], normals[number[of]], point[curved])
        return normal


def build_surface(
    name: str,
    mesh: Mesh,
    *,
    scale: float = 1.0,
    mesh_axes: str = "z_up",
    center_of_mass_m: tuple[float, float, float] = (0.0, 0.0, 0.0),
    material: Material | None = None,
    part_materials: Mapping[str, Material] | None = None,
    smooth_parts: Sequence[str] = (),
    wavelength_m: float | None = None,
) -> Surface:
    """Build the surface of a target: scale its mesh to metres, move it to body axes, and give it materials.

    Parameters
    ----------
    name : name of the target
    mesh : its mesh

    Other Parameters
    ----------------
    scale : metres in one unit of the mesh
    mesh_axes : "z_up", or "y_up" for a file whose y is body z
    center_of_mass_m : origin of the body axes in the mesh's axes, after scaling [m]
    material : material of all parts; None is Lambertian 0.30
    part_materials : materials of single parts by name, which override `material`
    smooth_parts : names of the curved parts, whose normals are interpolated
    wavelength_m : wavelength [m] at which materials are evaluated; None for materials that need none

    Returns
    -------
    the surface, in body axes and metres.

    Raises
    ------
    ScenarioError : a part is named that the mesh does not have.
    MeshError : the scaled mesh is too large.
    """
    overrides = dict(part_materials or {})
    for key, named in (("part_materials", overrides), ("smooth_parts", smooth_parts)):
        mesh.check_parts(key, named)
    vertices = body_from_mesh(mesh.vertices * scale - np.asarray(center_of_mass_m), mesh_axes)
    if not float(np.abs(vertices).max()) < FARTHEST_M:
        raise MeshError(
            f"{mesh.path.name} reaches beyond {FARTHEST_M:g} m as scaled; correct scale, size_m or center_of_mass_m"
        )
    default = material or Lambertian()
    materials = []
    for part in mesh.part_names:
        with add_place(f"part_materials.{part}" if part in overrides else "material"):
            chosen = complete(overrides.get(part, default))
            materials.append(chosen if wavelength_m is None else chosen.at(wavelength_m))
    smooth = tuple(number for number, part in enumerate(mesh.part_names) if part in set(smooth_parts))
    return Surface(name, mesh, vertices, tuple(materials), smooth)

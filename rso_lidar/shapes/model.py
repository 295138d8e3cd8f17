"""A model as its builder describes it: named parts, each a closed solid of one material with an estimated mass."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from rso_lidar.errors import ScenarioError
from rso_lidar.records import Hinge, PartClass, Symmetry, Taxonomy
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
        return _classify_parts(self.pieces)

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


# Common part class of every part that the builders make, by the part's name; a name has one class in all models.
_PARTS: dict[PartClass, str] = {
    "bus": """
        bus bus_deck vault payload_equipment_bay payload_carrier panel_frames earth_deck rails fasteners boxes propulsion
        instrument_section avionics cabin hatch windows window_frames seams handrails radar_support
        """,
    "solar_array": """
        solar_array solar_array_north solar_array_south solar_array_left solar_array_right solar_array_x
        solar_substrate solar_substrate_north solar_substrate_south solar_substrate_left solar_substrate_right
        solar_substrate_x body_cells philae_cells
        """,
    "antenna": """
        antenna antenna_single_access_east antenna_single_access_west feed_single_access_east feed_single_access_west
        antenna_multiple_access antenna_space_ground antenna_omni antenna_high_gain antenna_medium_gain antenna_low_gain
        antenna_struts antenna_electronics antenna_microwave antenna_waves antenna_consert antenna_radar antenna_high_rate
        antenna_science antenna_command antenna_zenith antenna_asar antenna_asar_frame antenna_altimeter antenna_doris
        antenna_ka_band antenna_x_band antenna_s_band antenna_reflectors_east antenna_reflectors_west
        antenna_backs_east antenna_backs_west antenna_steerable antenna_uhf antenna_patch feed feeds_east feeds_west
        """,
    "boom": """
        boom_single_access_east boom_single_access_west boom_space_ground boom_omni boom_magnetometer boom_plasma_lower
        boom_plasma_upper boom_high_gain boom_antennas boom_asar boom_ka_band boom_reflectors_east boom_reflectors_west
        antenna_mast solar_yoke solar_yoke_north solar_yoke_south solar_yoke_left solar_yoke_right solar_arm
        solar_struts solar_struts_x solar_struts_left solar_struts_right capsule_struts collector_arm
        """,
    "radiator": """
        radiator_north radiator_south radiator_left radiator_right radiator_avionics radiator_y radiator_zenith
        radiator_flight radiator_wake radiator_battery louvers
        """,
    "shield": "shield_main shield_left shield_right heat_shield parachute_cover foil",
    "instrument": """
        instruments instrument_bench bench instrument_mipas instrument_sciamachy instrument_gomos instrument_meris
        instrument_aatsr instrument_mwr viirs atms cris ceres omps baffles magnetometer probes camera camera_left
        camera_right cameras camera_narrow_angle camera_wide_angle telescope lens spectrometer gamma_detector
        neutron_detector altimeter microwave_dish dust_analyser dust_monitor star_tracker star_trackers star_cameras
        collector aerogel capsule philae philae_gear
        """,
    "engine": "apogee_engine main_engine engine nozzle thrust_structure",
    "thruster": "thruster thruster_ion thruster_mounts thruster_towers thruster_brackets separation_motors",
    "tank": "tank tank_aft bottles",
    "adapter": """
        adapter_ring adapter_cone payload_adapter skirt_aft skirt_forward docking_ring docking_probe compression_pads
        """,
    "mechanism": "hinges solar_drive antenna_gimbal thruster_gimbals hold_downs",
    "line": "feed_lines pressurant_lines cable_tunnels cable_ducts umbilical",
    "marker": "retroreflector retroreflector_bracket",
    "fragment": "fragment skin stiffener shard",
    "other": "plate sphere",
}
_CLASSES: dict[str, PartClass] = {part: kind for kind, parts in _PARTS.items() for part in parts.split()}


def _classify_parts(parts: Iterable[str]) -> dict[str, PartClass]:
    """Return the common class of each part of a builder, by the part's name.

    >>> _classify_parts(["tank", "nozzle"])
    {'tank': 'tank', 'nozzle': 'engine'}
    """
    classes = {}
    for part in parts:
        if part not in _CLASSES:
            raise ScenarioError(f"part '{part}': has no common part class; add it to rso_lidar/shapes/model.py")
        classes[part] = _CLASSES[part]
    return classes

"""Sunlight and air on the facets of a target: its table of loads, and the body that flies by it."""

from __future__ import annotations

import hashlib
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np

from rso_lidar import units
from rso_lidar.errors import ScenarioError, suppress_warnings
from rso_lidar.motion import Body, HingeAxes, PrescribedAttitude
from rso_lidar.orbit import FacetModel, Finish
from rso_lidar.records import FacetTable
from rso_lidar.scenario.mission.target_surfaces import build_whole_surface, name_part_materials
from rso_lidar.scenario.tables.target import Target
from rso_lidar.scene import (
    ASSUMED_FINISH,
    SOLAR_FINISHES,
    FacetLoads,
    GasLaw,
    Hinged,
    Mesh,
    split_at_hinges,
    tabulate_loads,
)
from rso_lidar.shipped import find

_TABLES_KEPT = 32
_tables: OrderedDict[tuple[str, ...], FacetTable] = OrderedDict()
_lock = Lock()


@dataclass(frozen=True)
class TargetFacets:
    """The facets of a target as sunlight and air meet them; a call returns their table, which is computed once.

    Two are equal if target, model and the hash of the mesh are.
    """

    key: tuple[str, ...]
    target: Target = field(compare=False)
    model: FacetModel = field(compare=False)
    loads: FacetLoads = field(compare=False)

    def __call__(self) -> FacetTable:
        """Return the table of loads in body axes."""
        with _lock:
            if self.key not in _tables:
                _tables[self.key] = tabulate_loads(self.loads, self.model.step_deg)
                while len(_tables) > _TABLES_KEPT:
                    _tables.popitem(last=False)
            _tables.move_to_end(self.key)
            return _tables[self.key]


def facet_forces(target: Target, model: FacetModel | None = None, folder: Path | str | None = None) -> FacetTable:
    """Tabulate sunlight and air on the facets of a target, over all directions.

    Light and molecules that one facet throws onto another are left out. The catalogue's solar absorptances apply, or
    those of `model`; many are assumed (docs/physics.md).

    Parameters
    ----------
    target : with its mesh, materials and hinges
    model : finishes and law of the air; None for the defaults
    folder : where a relative path of a mesh starts; None for the working folder

    Returns
    -------
    FacetTable
        Its `find_light_load` and `find_air_load` give force over pressure [m2] and torque over pressure [m3] of any
        direction, in body axes about the target's origin. The force per newton of dynamic pressure is -C_D A.

    Raises
    ------
    ScenarioError
        If the mesh is not found, a part is unknown, or a hinge turns in a way that no table over directions can hold.

    Examples
    --------
    >>> import rso_lidar as rl
    >>> plate = rl.Target(name="plate", model="plate", motion=rl.Fixed(position_m=(0, 0, 0)))
    >>> black = rl.orbit.FacetModel(finish=rl.orbit.Finish(absorbed=1.0), step_deg=30.0, points=512)
    >>> force_m2, _ = rl.facet_forces(plate, black).find_light_load([1.0, 0.0, 0.0])
    >>> print(round(float(-force_m2[0]), 1))  # 4 m x 4 m that faces the Sun
    16.0
    """
    if not isinstance(target, Target):
        raise ScenarioError(f"facet_forces: needs a Target, not {target!r:.60}; take one of scenario.target")

    def file(name: str) -> Path:
        path = find(name, None if folder is None else Path(folder))
        if path is None:
            raise ScenarioError(f"target {target.name}: no file '{name}'; check the name, or give its folder")
        return path

    return find_facets(target, model or FacetModel(), file)()


def find_facets(
    target: Target, model: FacetModel, file: Callable[[str], Path], wavelength_m: float = 1064.0 * units.NM
) -> TargetFacets:
    """Find the facets of a target as sunlight and air meet them.

    Parameters
    ----------
    target : the target
    model : finishes and law of the air
    file : finds a mesh that the scenario names
    wavelength_m : at which materials exist [m]; it has no other effect

    Returns
    -------
    TargetFacets

    Raises
    ------
    ScenarioError
        If a part is unknown, or a hinge turns in a way that no table over directions can hold.
    """
    with suppress_warnings():  # given where the surfaces of the scenario are built
        whole = build_whole_surface(target, file, wavelength_m)
    for joint in target.joints:
        _check_hinge(joint, model)
    hinged = [Hinged(target.joint_axes(joint), joint.parts, joint.position_m) for joint in target.joints]
    surfaces = split_at_hinges(whole, hinged)
    finishes = _list_finishes(target, model, whole.mesh)
    # What is absorbed and given off again at once by Lambert's law pushes as diffuse light does.
    diffuse = np.array([finish.diffuse + model.reradiated * finish.absorbed for finish in finishes])
    gas = GasLaw(model.speed_ratio, model.wall_temperature_ratio, model.accommodation)

    def place(direction: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
        poses = [(np.zeros(3), np.eye(3))]
        for joint in target.joints:
            link = joint.link(np.zeros(1), direction[None], np.zeros((1, 3)))
            poses.append((np.array(joint.position_m), np.asarray(link.matrix)[0]))
        return poses

    specular = np.array([finish.specular for finish in finishes])
    loads = FacetLoads(surfaces, specular, diffuse, gas, place if target.joints else None, model.points)
    shown = model.model_dump_json(exclude={"mass_kg", "sunlight", "drag"})
    hinges = str([joint.model_dump_json() for joint in target.joints])
    parts = hashlib.sha256(whole.part.tobytes()).hexdigest()
    key = whole.content, parts, shown, hinges, str([tuple(finish) for finish in finishes])
    return TargetFacets(key, target, model, loads)


def _check_hinge(joint: HingeAxes, model: FacetModel) -> None:
    if not joint.angle.turns:
        return
    if not joint.angle.follows_sun:
        raise ScenarioError(
            f"joint {joint.name}: turns with time, which a table of facets over directions cannot hold; fix its angle, or "
            "let it follow the Sun with drag = false"
        )
    if model.drag:
        raise ScenarioError(
            f"joint {joint.name}: follows the Sun, so drag does not depend on the flow alone; set drag = false in facets, "
            "or fix the angle"
        )


def _list_finishes(target: Target, model: FacetModel, mesh: Mesh) -> list[Finish]:
    """List the finish of each part of a target's mesh."""
    mesh.check_parts("facets.part_finishes", model.part_finishes)
    named = name_part_materials(target, mesh)
    finishes = []
    for part in mesh.part_names:
        known = SOLAR_FINISHES.get(named.get(part, ""), ASSUMED_FINISH)
        general = model.finish or Finish(absorbed=known.absorbed, specular=known.specular)
        finishes.append(model.part_finishes.get(part, general))
    return finishes


def bind_facets(body: Body, file: Callable[[str], Path], wavelength_m: float) -> dict[str, Any]:
    """Return the motion and attitude of a target on whose facets sunlight or air acts, with what they need of its mesh.

    Parameters
    ----------
    wavelength_m : of the laser [m]
    """
    changes: dict[str, Any] = {}
    if isinstance(body, Target):
        for place in ("motion", "attitude"):
            part = getattr(body, place)
            model = getattr(part, "facet_model", None)
            if isinstance(model, FacetModel):
                facets = find_facets(body, model, file, wavelength_m)
                along = (PrescribedAttitude(body.attitude),) if place == "motion" else ()
                changes[place] = part.with_table(facets, *along)
    return changes

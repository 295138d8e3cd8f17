"""Inputs of a link budget, checked: camera, ranges, materials, angles and target; and what the budget omits."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from rso_lidar import sampling, units
from rso_lidar.detector import AnyDetector, describe_window, list_neglected_effects
from rso_lidar.errors import MeshError, ScenarioError, did_you_mean, suppress_warnings
from rso_lidar.files import MOST_BYTES, read_text
from rso_lidar.optics import Laser, Receiver
from rso_lidar.scenario import Lidar, Scenario, list_run_attitudes, load_presets, move_target, preview_mission
from rso_lidar.scene import Lambertian, Material, Scatterer, TableBrdf, complete, find_material, load_materials

_RANGES = 121
_SPAN = 50.0  # default of the greatest range over the least
_FARTHEST_M = 1e9
GATED_TO_M = 50_000.0  # a gate may lie anywhere; a choice
# Silhouettes: attitudes of a run, cells along a side, and the distance in radii, where perspective changes half a per cent.
_ATTITUDES, _CELLS, _AWAY = 24, 160, 200.0


def select_camera(camera: Lidar | Scenario | str) -> tuple[Lidar, Scenario | None, str]:
    """Return the camera, the scenario that it belongs to, and its name."""
    if isinstance(camera, Scenario):
        return camera.instrument.at(0.0), camera, camera.name
    if isinstance(camera, Lidar):
        return camera.at(0.0), None, camera.preset or "a camera"
    if not isinstance(camera, str):
        raise ScenarioError(f"budget: needs a lidar, a scenario or the name of a camera, not {camera!r:.60}")
    if camera in load_presets():
        return Lidar(preset=camera), None, camera  # type: ignore[call-arg]
    known = ", ".join(load_presets())
    raise ScenarioError(f"{camera}: no camera of that name{did_you_mean(camera, load_presets())} (known: {known})")


def check_positive(what: str, value: Any) -> float:
    """Return a number, or raise `ScenarioError` where it is not finite and above 0."""
    if not isinstance(value, Real) or isinstance(value, bool) or not 0.0 < float(value) < math.inf:
        raise ScenarioError(f"{what}: {value}: is not a size; give a finite number above 0")
    return float(value)


def check_angles_deg(what: str, given: Sequence[float] | float, least: float, most: float) -> tuple[float, ...]:
    """Return distinct angles [deg], or raise `ScenarioError` for those outside the limits."""
    values = tuple(dict.fromkeys(float(value) for value in np.atleast_1d(np.asarray(given, dtype=float))))
    if not values:
        raise ScenarioError(f"{what}: is empty; give at least one angle")
    for value in values:
        if not least <= value <= most:
            raise ScenarioError(f"{what}: {value:g}: is outside {least:g} to {most:g} deg; give an angle within")
    return values


def check_probability(value: float) -> float:
    """Return a probability, or raise `ScenarioError` where it is not between 0 and 1."""
    if not 0.0 < float(value) < 1.0:
        raise ScenarioError(f"probability: {value:g}: is never or always reached; give a number between 0 and 1")
    return float(value)


def choose_ranges_m(given: Any, detector: AnyDetector) -> np.ndarray:
    """Return ascending ranges [m]: those given, or 121 in equal ratios between the nearest and the farthest."""
    if given is None:
        traits = detector.traits
        far = GATED_TO_M if traits.is_gated else min(traits.sees_to_m, _FARTHEST_M)
        near = far / _SPAN
        if not traits.is_gated:
            near = max(near, traits.sees_from_m)
        elif traits.sees_to_m < near:
            near = traits.sees_to_m / _SPAN  # a camera whose gate is that near may see no farther
        return np.geomspace(near, far, _RANGES)
    values = np.asarray(given, dtype=float).ravel()
    if (
        len(values) < 2
        or not np.all(np.isfinite(values))
        or not np.all(values > 0.0)
        or not np.all(np.diff(values) > 0.0)
    ):
        shown = ", ".join(f"{value:g}" for value in values[:4])
        raise ScenarioError(f"range_m: {shown}: not two ranges; give a near and a farther one, above 0")
    if values[-1] > _FARTHEST_M:
        raise ScenarioError(f"range_m: {values[-1]:g}: is beyond {_FARTHEST_M:g} m; give a nearer one")
    return np.geomspace(values[0], values[1], _RANGES) if len(values) == 2 else values


@dataclass(frozen=True)
class BudgetTarget:
    """The target of a budget: its name in words, its sides [m], its silhouette [m²], and the square inside that.

    `square_m` is the side of that square. It is None where no target was asked for: pixels are then counted on a square of
    one metre, and the target need not fill a pixel.
    """

    words: str
    sides_m: tuple[float, ...]
    area_m2: float
    square_m: float | None


def choose_target(given: Sequence[float] | float | None, scenario: Scenario | None) -> BudgetTarget:
    """Choose the target of a budget: a square or a box as given, or the scenario's first target as the lidar sees it.

    One side is that of a square that faces the lidar. The mean silhouette of a convex body is a quarter of its
    surface (Cauchy 1841). The square inside that of a box is about as wide as its middle side. A scenario's target is
    cast in the attitudes of the run, which gives the mean silhouette and the median of the squares.
    """
    if given is None and scenario is not None and scenario.target:
        with suppress_warnings():
            areas_m2, squares_m = _cast_silhouettes(scenario, 0)
        corners = scenario.corners_of(0).reshape(-1, 3)
        sides = tuple(float(side) for side in corners.max(axis=0) - corners.min(axis=0))
        name = scenario.target[0].name
        if not areas_m2.size:  # the lidar is always at the target's origin
            return BudgetTarget(f"target: {name}", sides, max(sides) ** 2, None)
        area_m2, square_m = float(areas_m2.mean()), float(np.median(squares_m))
        return BudgetTarget(f"target: {name}, {area_m2:.3g} m² in silhouette", sides, area_m2, square_m)
    sides = tuple(check_positive("target_m", side) for side in np.atleast_1d(1.0 if given is None else given).tolist())
    if len(sides) == 1:
        what = (
            f"pixels counted on a square of {sides[0]:g} m" if given is None else f"target: a square of {sides[0]:g} m"
        )
        return BudgetTarget(what, sides, sides[0] ** 2, None if given is None else sides[0])
    if len(sides) != 3:
        raise ScenarioError(f"target_m: {len(sides)} sides; give one (a square) or three (a box)")
    a, b, c = sides
    box = f"target: a box of {' x '.join(f'{side:.4g}' for side in sides)} m, tumbling"
    return BudgetTarget(box, sides, 0.5 * (a * b + b * c + c * a), sorted(sides)[1])


def _cast_silhouettes(scenario: Scenario, number: int) -> tuple[np.ndarray, np.ndarray]:
    """Cast rays at a target to find its silhouettes as the lidar sees them over a run.

    Returns
    -------
    area_m2 : (attitude) area of the silhouette [m²].
    square_m : (attitude) side of the largest square inside the silhouette, its sides along rows and columns [m].
    """
    from scipy.ndimage import distance_transform_cdt

    preview = preview_mission(scenario)
    geometry, surfaces = preview.targets[number], scenario.surfaces_of(number)
    away_m = _AWAY * geometry.radius_m
    fov_deg = 2.04 * float(np.arctan(1.0 / _AWAY)) / units.DEG
    receiver = Receiver(
        fov_deg=fov_deg, f_number=2.8, n_rows=_CELLS, n_cols=_CELLS, rays_per_pixel=1, min_rays_per_target=0
    )
    laser = Laser(divergence_deg=2.0 * fov_deg)
    ahead_m = np.array([0.0, 0.0, away_m])
    areas, squares = [], []
    most = min(_ATTITUDES, int(np.count_nonzero(geometry.range_m > 0.0)))
    for row, turned in dict(list_run_attitudes(preview, geometry.name, most)).items():
        truth = move_target(scenario, number, preview.truth.at(row), ahead_m, turned)
        hits = sampling.cast_pixels(receiver, laser, surfaces, truth, 1)
        covered = np.zeros((_CELLS + 2, _CELLS + 2), dtype=bool)  # with a border of sky
        covered[1 + hits.pixel // _CELLS, 1 + hits.pixel % _CELLS] = True
        cell_m = away_m * receiver.pixel_tangent
        areas.append(float(hits.weight.sum()) * cell_m**2)
        squares.append(max(2.0 * float(distance_transform_cdt(covered, "chessboard").max()) - 1.0, 0.0) * cell_m)
    return np.array(areas), np.array(squares)


def choose_materials(
    given: Sequence[str | float | Material] | None, scenario: Scenario | None, wavelength_m: float
) -> list[tuple[str, Scatterer]]:
    """Choose the materials of a budget, each with a name.

    Parameters
    ----------
    given : names, reflectances, tables or materials (None: dimmest and brightest of the scenario's first target)
    scenario : the scenario of the camera, if any
    wavelength_m : of the laser [m]
    """
    if given is not None:
        if isinstance(given, str | float | int | Material):
            given = [given]
        named = dict(_find_material(choice, wavelength_m) for choice in given)
        if not named:
            raise ScenarioError("materials: none given; name one, or leave them out")
        return list(named.items())
    if scenario is None or not scenario.target:
        return [("lambertian 0.3", Lambertian())]
    materials = {material for surface in scenario.surfaces_of(0) for material in surface.materials}
    materials = {
        material for material in materials if not material.is_retro
    } or materials  # retro-reflectors are far smaller than a pixel
    facing = sorted(materials, key=lambda material: float(material.mean_brdf_per_sr(np.array(1.0))))
    ends = dict.fromkeys([facing[0], facing[-1]])
    return [(_name_material(material, wavelength_m), material) for material in ends]


def _find_material(given: str | float | Material, wavelength_m: float) -> tuple[str, Scatterer]:
    if isinstance(given, Material):
        whole = complete(given)
        return _name_material(whole, wavelength_m), whole.at(wavelength_m)
    if isinstance(given, str):
        if given in load_materials():
            return given, find_material(given, wavelength_m)
        if Path(given).suffix.lower() == ".csv":
            return Path(given).stem, _read_brdf_table(Path(given))
        if not _is_number(given):
            guess = did_you_mean(given, load_materials())
            known = ", ".join(load_materials())
            raise MeshError(
                f"material: no '{given}'{guess} (known: {known}; or a reflectance such as 0.3, or a table .csv)"
            )
        given = float(given)
    if not 0.0 <= given <= 1.0:
        raise ScenarioError(f"material: {given:g}: is not a reflectance; give 0 to 1, or a name")
    return f"lambertian {given:g}", Lambertian(reflectance=float(given))


def _read_brdf_table(file: Path) -> TableBrdf:
    """Read a BRDF table with the columns incidence_deg and brdf_per_sr; a heading is allowed."""
    text = read_text(file, MOST_BYTES, ScenarioError, "table (incidence_deg, brdf_per_sr)")
    try:
        rows = [row for row in csv.reader(text.splitlines()) if row]
    except csv.Error:
        raise ScenarioError(f"{file}: is not a CSV file; give columns incidence_deg, brdf_per_sr") from None
    try:
        columns = [
            (float(angle), float(other)) for angle, other in rows[1 if rows and not _is_number(rows[0][0]) else 0 :]
        ]
        degrees, values = zip(*columns, strict=True)
        return TableBrdf(incidence_deg=degrees, measured_per_sr=values)
    except ValidationError as error:
        reason = error.errors()[0]["msg"].removeprefix("Value error, ")
        raise ScenarioError(f"{file}: {reason}; columns are incidence_deg, brdf_per_sr") from None
    except ScenarioError as error:
        raise ScenarioError(f"{file}: {error}") from None
    except ValueError:
        raise ScenarioError(
            f"{file}: is not a table of two columns of numbers; give incidence_deg, brdf_per_sr"
        ) from None


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _name_material(material: Scatterer, wavelength_m: float) -> str:
    """Return the catalogue's name of a material, or its type and reflectance."""
    for name in load_materials():
        if find_material(name, wavelength_m) == material and name != "lambertian_30":
            return name
    reflectance = getattr(material, "reflectance", None)
    kind = str(getattr(material, "type", material.summarize()))
    return kind if reflectance is None else f"{kind} {reflectance:g}"


def has_retros(scenario: Scenario | None) -> bool:
    """Return whether the first target has retro-reflectors, which `choose_materials` omits by default."""
    seen = scenario.surfaces_of(0) if scenario is not None and scenario.target else []
    return len({material.is_retro for surface in seen for material in surface.materials}) > 1


def describe_omissions(lidar: Lidar, false_alarms: float, *, retros: bool) -> tuple[str, ...]:
    """Describe the false alarms, and the effects of camera and target that the closed form omits.

    Parameters
    ----------
    retros : whether retro-reflectors of the target are omitted
    """
    laser, receiver = lidar.laser, lidar.receiver
    dropped = ["retro-reflectors of the target"] * retros
    dropped += [name for name in ("psf", "distortion") if getattr(receiver, name) is not None]
    if receiver.filter_width_nm is not None:
        dropped.append("sunlight")
    if laser.energy_jitter_fraction:
        dropped.append("energy jitter")
    dropped += list_neglected_effects(lidar.detector)
    lines = [f"{describe_window(lidar.detector)}: {false_alarms:.2g} false alarms a frame in the dark"]
    return (*lines, f"not counted: {', '.join(dropped)}") if dropped else tuple(lines)

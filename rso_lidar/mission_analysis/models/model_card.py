"""The card of a model: views from four sides, materials, and the light that it returns."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rso_lidar import optics, sampling, units
from rso_lidar.mission_analysis.models.model_card_figure import CardView, model_card_figure
from rso_lidar.motion import Fixed
from rso_lidar.picture import LIGHT, Scheme, save_figure
from rso_lidar.pose import Link, PoseTree
from rso_lidar.records import OTHER, Truth
from rso_lidar.scenario import FacetParts, Lidar, Target, build_whole_surface, find_part_classes, find_taxonomy
from rso_lidar.scene import Surface, format_span, load_materials, model, render_portrait, viewer_axes
from rso_lidar.units import format_count

if TYPE_CHECKING:
    from scipy.spatial.transform import RigidTransform

_Direction = tuple[float, float, float]
# Views: direction in body axes from which the model is seen, and the axis that points up in the picture.
SIDES: dict[str, tuple[_Direction, _Direction]] = {
    "from +x": ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    "from +y": ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
    "from +z": ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0)),
    "oblique": ((1.0, 0.8, 0.7), (0.0, 0.0, 1.0)),
}
CAMERA = "gsfl_1064"
WAVELENGTHS_NM = (1064.0, 1570.0)  # of its laser, with the energy unchanged
RANGE_M = 1000.0
_RAYS_PER_PIXEL = 1600
_CELLS = 640  # along a side of each picture
_LISTED = 8  # runs of facets without a class that are written out
_GREY = (0.62, 0.62, 0.62)


@dataclass(frozen=True)
class SideReturn:
    """Light that one flash of the camera of Fuller et al. returns from a side: in all, and in the brightest pixel."""

    wavelength_nm: float
    side: str
    photons: float
    brightest_photons: float
    pixels: int


@dataclass(frozen=True)
class PartBounds:
    """A part with its class, material, facets, area, and its bounding box: corners (xyz) [m] in body axes."""

    name: str
    part_class: str
    material: str
    facets: int
    area_m2: float
    low_m: tuple[float, ...]
    high_m: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class ModelCard:
    """A model of the catalogue or a file: `what` and `lines` describe it, `returns` is its light from `RANGE_M`."""

    name: str
    what: str
    parts: tuple[PartBounds, ...]
    lines: tuple[str, ...]
    views: tuple[CardView, ...]
    returns: tuple[SideReturn, ...]
    unassigned: tuple[tuple[int, int], ...] = ()  # first and last facet of each run whose part has no class

    def figure(self) -> Any:
        """Return a matplotlib Figure: four views by part, four by material, and tables."""
        return model_card_figure(self.name, self.views, self.lines, self.light_table())

    def light_table(self) -> list[list[str]]:
        """Return the photons of each side, in all and in the brightest pixel, as rows of cells with the heads first.

        The body's middle is on the boresight, where four pixels meet. A body smaller than a pixel illuminates all four.
        """
        if not self.returns:
            return []
        heads = [f"photons at {RANGE_M / units.KM:g} km, {CAMERA}"]
        heads += [word for nm in WAVELENGTHS_NM for word in (f"{nm:g} nm, in all", "brightest pixel")]
        rows = [heads]
        for side in dict.fromkeys(echo.side for echo in self.returns):
            of = [echo for echo in self.returns if echo.side == side]
            rows.append(
                [side, *(f"{_format_photons(v)}" for echo in of for v in (echo.photons, echo.brightest_photons))]
            )
        return rows

    def describe_unassigned(self) -> str:
        """Describe in a line the facets whose parts have no common class."""
        without = [part for part in self.parts if part.part_class == OTHER]
        if not without:
            return "Every facet belongs to a part with a class."
        share = sum(part.area_m2 for part in without) / sum(part.area_m2 for part in self.parts)
        spans = [format_span(*run) for run in self.unassigned]
        runs = ", ".join(spans[:_LISTED]) + (f" and {len(spans) - _LISTED:,} runs more" if len(spans) > _LISTED else "")
        facets = format_count(sum(part.facets for part in without), "facet")
        return f"Without a class ({OTHER}): {facets}, {share:.1%} of the area: {runs}"

    def save(self, path: str | Path, scheme: Scheme = LIGHT) -> Path:
        """Draw the page.

        Parameters
        ----------
        path : of the picture, .png, .pdf or .svg; an existing file is replaced
        scheme : `LIGHT` or `DARK`

        Returns
        -------
        Path

        Raises
        ------
        RecordingError
            For another suffix, or a path that cannot be written.
        """
        return save_figure(self.figure(), path, scheme=scheme)


def make_model_card(
    name: str, file: Callable[[str], Path] = Path, *, facet_parts: FacetParts | None = None, returns: bool = True
) -> ModelCard:
    """Make the card of a model of the catalogue, or of a mesh file.

    Parameters
    ----------
    name : of the model; with a suffix or a slash, the path of a mesh
    file : finds a mesh file by its name
    facet_parts : parts of a mesh by a table of its facets, or by the materials of its file
    returns : whether to simulate the light that the model returns

    Returns
    -------
    ModelCard
        Size, parts and materials; views of its sides; and the light of each side at 1 km.

    Raises
    ------
    MeshError
        For a model that is not in the catalogue, and a mesh or a table that cannot be read.
    ScenarioError
        If `facet_parts` is given for a model of the catalogue.
    """
    target = Target(name="model", model=name, motion=Fixed(position_m=(0.0, 0.0, 0.0)))
    if target.is_path:
        target = target.replace(center_of_mass_m=(0.0, 0.0, 0.0))
    if facet_parts is not None:
        target = target.replace(facet_parts=facet_parts)
    surface = build_whole_surface(target, file, WAVELENGTHS_NM[0] * units.NM)
    seen = tuple(_simulate_side(target, file, nm, side) for nm in WAVELENGTHS_NM for side in SIDES) if returns else ()
    words, colours = _list_finishes(target, surface)
    classes = find_part_classes(target, surface.mesh)
    class_names = tuple(dict.fromkeys(classes))
    parts = surface.part
    of_class = np.array([class_names.index(kind) for kind in classes])[parts]
    finish = surface.finish
    side_m = 1.04 * max(_view_width_m(surface, *sight) for sight in SIDES.values())
    views = []
    for side, (toward, up) in SIDES.items():
        picture = render_portrait(surface, toward, up, side_m=side_m, cells=_CELLS)
        on = np.maximum(picture.facet, 0)
        views.append(
            CardView(
                side=side,
                part=np.where(picture.covered, parts[on], -1),
                part_class=np.where(picture.covered, of_class[on], -1),
                material=np.where(picture.covered, finish[on], -1),
                cosine=picture.cosine,
                cell_m=picture.cell_m,
                part_names=surface.mesh.part_names,
                class_names=class_names,
                material_names=words,
                material_rgb=colours,
            )
        )
    bounds, areas_m2 = [], np.bincount(parts, surface.areas_m2, len(words))
    for number, (part, kind, word) in enumerate(zip(surface.mesh.part_names, classes, words, strict=True)):
        corners = surface.corners[parts == number]
        if len(corners):
            low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
            area = float(areas_m2[number])
            bounds.append(PartBounds(part, kind, word, len(corners), area, tuple(low), tuple(high)))
    what = f"a mesh of {surface.mesh.path.name}" if target.is_path else model(name).what
    without = np.sort(surface.mesh.source_facet[np.array([kind == OTHER for kind in classes])[parts]])
    lines = tuple(_describe_model(target, surface))
    return ModelCard(name, what, tuple(bounds), lines, tuple(views), seen, _list_runs(without))


def _list_runs(numbers: np.ndarray) -> tuple[tuple[int, int], ...]:
    """Return first and last of each run of consecutive numbers, which rise.

    >>> _list_runs(np.array([3, 4, 5, 9]))
    ((3, 5), (9, 9))
    """
    if not len(numbers):
        return ()
    first = np.flatnonzero(np.diff(numbers, prepend=numbers[0] - 2) != 1)
    last = np.append(first[1:], len(numbers)) - 1
    return tuple(zip(numbers[first].tolist(), numbers[last].tolist(), strict=True))


def _view_width_m(surface: Surface, toward: _Direction, up: _Direction) -> float:
    """Return the width [m] of a square view that contains the surface, centred on its bounding sphere."""
    from_middle = surface.corners.reshape(-1, 3) - surface.sphere[0]
    right, down, _ = viewer_axes(toward, up)
    return 2.0 * max(float(np.abs(from_middle @ axis).max()) for axis in (right, down))


def _list_finishes(target: Target, surface: Surface) -> tuple[tuple[str, ...], tuple[tuple[float, float, float], ...]]:
    """Return names and colours of the surface's materials."""
    if target.is_path:
        types = tuple(str(getattr(material, "type", "own")) for material in surface.materials)
        return types, (_GREY,) * len(types)
    named = model(target.shape).parts
    words = tuple(named.get(part, "") for part in surface.mesh.part_names)
    table = load_materials()
    return words, tuple(tuple(table[word]["display_rgb"]) if word in table else _GREY for word in words)


def _simulate_side(target: Target, file: Callable[[str], Path], wavelength_nm: float, side: str) -> SideReturn:
    """Simulate the light that one side of a model returns in one flash."""
    lidar = Lidar(preset=CAMERA).at(0.0)  # type: ignore[call-arg]
    # Sides of a model lie along rows of pixels, where only a fine grid is right.
    receiver = lidar.receiver.replace(rays_per_pixel=_RAYS_PER_PIXEL)
    lidar = lidar.replace(laser=lidar.laser.replace(wavelength_nm=wavelength_nm), receiver=receiver)
    surface = build_whole_surface(target, file, lidar.laser.wavelength_m)
    links = {"lidar": Link.still(), target.name: Link.still(_lidar_from_body(*SIDES[side], RANGE_M))}
    poses = PoseTree({"lidar": "inertial", target.name: "lidar"}, links)
    truth = Truth(0.0, poses, {}, np.full(3, np.nan))
    hits = sampling.cast_pixels(lidar.receiver, lidar.laser, [surface], truth)
    light = optics.collect(hits, lidar.laser, lidar.receiver)
    of_pixel = np.bincount(light.pixel, light.photons, 1)
    return SideReturn(
        wavelength_nm, side, float(of_pixel.sum()), float(of_pixel.max()), int(np.count_nonzero(of_pixel))
    )


def _lidar_from_body(toward: _Direction, up: _Direction, range_m: float) -> RigidTransform:
    """Return lidar_from_body of a body on the boresight, seen from `toward`, with `up` up (xyz, body axes)."""
    from scipy.spatial.transform import RigidTransform, Rotation

    turn = Rotation.from_matrix(viewer_axes(toward, up))
    return RigidTransform.from_components(np.array([0.0, 0.0, range_m]), turn)


def _format_photons(photons: float) -> str:
    """Format a number of photons in three digits, with commas.

    >>> _format_photons(2_796_000.0), _format_photons(281.7), _format_photons(0.01234)
    ('2,800,000', '282', '0.0123')
    """
    rounded = float(f"{photons:.3g}")
    return f"{rounded:,.0f}" if rounded >= 100.0 else f"{rounded:g}"


def _describe_model(target: Target, surface: Surface) -> list[str]:
    sides = surface.mesh.size_m
    kind = find_taxonomy(target)
    lines = [kind.in_words] if kind else []
    lines.append(
        f"{' × '.join(f'{side:.4g}' for side in sides)} m, {surface.mesh.source_facets:,} facets, "
        f"{surface.area_m2:,.4g} m² of surface"
    )
    if not target.is_path:
        entry = model(target.shape)
        if entry.mass_kg is not None and entry.inertia_kg_m2 is not None:  # a user's own model has neither
            inertia = ", ".join(_format_four(moment) for moment in np.linalg.eigvalsh(np.array(entry.inertia_kg_m2)))
            lines.append(f"{_format_four(entry.mass_kg)} kg, principal inertia {inertia} kg m² (estimated)")
        if entry.hinges:
            lines.append("hinges: " + ", ".join(hinge.name for hinge in entry.hinges))
    return lines


def _format_four(value: float) -> str:
    """Format a number to four significant digits, without an exponent.

    >>> [_format_four(value) for value in (13_328.6, 8211.0, 0.00123456)]
    ['13,330', '8,211', '0.001235']
    """
    return f"{float(f'{value:.4g}'):,.12g}"

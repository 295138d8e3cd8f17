"""Choosers: models with their pictures, materials, element sets and cameras, taken into the field that asks for them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import fastapi
from nicegui import run, ui

from rso_lidar.imaging import Band
from rso_lidar.mission_analysis import list_materials
from rso_lidar.orbit import Omm, Tle
from rso_lidar.part import Part
from rso_lidar.scenario import Lidar, Target, find_examples, load_presets
from rso_lidar.scene import Lambertian, models
from rso_lidar.shipped import shipped
from rso_lidar.studio.model.mesh_sizes import list_mesh_sizes, list_mesh_targets
from rso_lidar.studio.model.model_portrait import draw_example_portrait, draw_portrait
from rso_lidar.studio.model.search import read_pasted_set, search_sets
from rso_lidar.studio.model.text_assessment import check_file
from rso_lidar.studio.pages.elements import ask, draw_button, draw_list, draw_table, mark, open_dialog, tell_errors
from rso_lidar.studio.state import BrowserTab

_MOST_ROWS, _WIDE = 60, "w-[900px]"
_KEPT = {"cache-control": "max-age=3600"}  # header of pictures
_BANDS = {"grey": "visible light", "nir": "near infrared", "rgb": "red, green and blue"}  # as `bands` names them
_LONG_TABLE = "wrap-cells virtual-scroll style='max-height: 50vh'"


@dataclass(frozen=True)
class Chooser:
    """A dialog that fills a table: the words on its button, and the function that opens it for a place."""

    title: str
    open: Callable[[BrowserTab, str], Any]


def find_chooser(cls: type[Part], key: str) -> Chooser | None:
    """Return the chooser for a field of a part, or, with an empty key, for the whole table; None if there is none."""
    return _CHOOSERS.get((cls, key))


def add_routes(application: fastapi.FastAPI) -> None:
    """Add the routes of the pictures of models and examples."""

    @application.get("/studio/models/{name}.png")
    def send_portrait(name: str) -> fastapi.Response:
        if name not in models():
            return fastapi.Response("no such model", 404, media_type="text/plain")
        return fastapi.Response(draw_portrait(name), media_type="image/png", headers=_KEPT)

    @application.get("/studio/examples/{name}.png")
    def send_example(name: str) -> fastapi.Response:
        png = draw_example_portrait(name) if name == "empty" or name in find_examples() else None
        if png is None:
            return fastapi.Response("no such example", 404, media_type="text/plain")
        return fastapi.Response(png, media_type="image/png", headers=_KEPT)


def _set(tab: BrowserTab, changes: Mapping[str, Any], dialog: ui.dialog) -> None:
    """Set values of the document, and close the dialog.

    Parameters
    ----------
    changes : values by their places; None removes one
    """
    with tell_errors():
        for place, value in changes.items():
            tab.document.remove(place) if value is None else tab.document.set(place, value)
        if not dialog.is_deleted:  # the page may have been drawn again, with the changed document
            dialog.close()


def _choose_model(tab: BrowserTab, place: str) -> None:
    with open_dialog("Models", _WIDE) as dialog:
        wanted = ui.input("Search").props("dense outlined autofocus clearable").classes("w-full")
        grid = ui.element("div").classes("studio-gallery")

        def draw() -> None:
            words = (wanted.value or "").lower()
            grid.clear()
            with grid:
                for entry in models().values():
                    if words in f"{entry.name} {entry.what}".lower():
                        draw_tile(entry)

        def draw_tile(entry: Any) -> None:
            with mark(ui.card(), f"model-{entry.name}", "tabindex=0 role=button") as tile:
                tile.classes("p-2 gap-1 cursor-pointer").tooltip(entry.what).props["aria-label"] = entry.name
                ui.image(f"/studio/models/{entry.name}.png").classes("w-full").props(
                    f'alt="The model {entry.name}" loading=lazy ratio=1 no-spinner'
                )
                ui.label(entry.name).classes("font-medium")
                size = " × ".join(f"{length:.3g}" for length in entry.size_m)
                ui.label(f"{size} m; {entry.licence}").classes("text-xs opacity-80")
            for event in ("click", "keydown.enter", "keydown.space"):
                tile.on(event, partial(_set, tab, {f"{place}.model": entry.name}, dialog))

        wanted.on_value_change(draw)
        draw()


def _choose_material(tab: BrowserTab, place: str) -> None:
    columns = {"name": "Name", "kind": "BRDF", "nm1064": "1064 nm", "nm1570": "1570 nm", "what": "What"}
    rows = [
        {"name": material.name, "kind": material.kind, "what": material.what,
         "nm1064": material.reflectance[1064.0], "nm1570": material.reflectance[1570.0]}
        for material in list_materials()
    ]  # fmt: skip
    with open_dialog("Materials", _WIDE) as dialog:
        ui.label("Total reflectance at the wavelengths of the lasers").classes("text-sm")
        table = draw_table(columns, lambda chosen: _set(tab, {place: chosen[0]["name"]}, dialog) if chosen else None)
        table.props(_LONG_TABLE).rows = rows


def _choose_elements(tab: BrowserTab, place: str) -> None:
    motions: dict[str, Tle | Omm] = {}
    folder = tab.workspace.folder
    files = [f"tle/{path.name}" for path in sorted(shipped("tle").glob("*.tle"))]
    files = folder.list_files((".tle", ".txt", ".3le", ".json", ".csv", ".xml", ".kvn", ".omm")) + files

    def take(motion: Tle | Omm | None) -> None:
        if motion is not None:
            _set(tab, {place: {"type": motion.type, **motion.model_dump(exclude_defaults=True)}}, dialog)

    def find() -> dict[str, Tle | Omm]:
        return search_sets(check_file(file.value, folder, "catalogue"), wanted.value or "", _MOST_ROWS)

    async def take_pasted() -> None:
        with tell_errors():
            take(await run.io_bound(read_pasted_set, pasted.value or ""))

    async def search() -> None:
        with tell_errors():
            motions.clear()
            motions.update(await run.io_bound(find) or {})
        table.rows = [{"name": name} for name in motions]

    with open_dialog("Element sets", _WIDE) as dialog:
        pasted = ui.textarea("Paste two lines, or an OMM").classes("w-full font-mono").props("outlined dense rows=3")
        draw_button("Take this set", take_pasted)
        with ui.row(wrap=False).classes("w-full items-center"):
            file = ui.select(files, value=files[0], label="Catalogue").classes("w-1/3").props("dense")
            wanted = ui.input("Name or number").classes("grow").props("dense").on("keydown.enter", search)
            draw_button("Search", search)
        table = draw_table({"name": "Object"}, lambda chosen: take(motions.get(chosen[0]["name"])) if chosen else None)
        table.props(f"{_LONG_TABLE} no-data-label='Nothing searched yet'")


def _choose_camera(tab: BrowserTab, place: str) -> None:
    async def take(name: str) -> None:
        own = [key for key in ("laser", "receiver", "detector") if tab.document.get(f"{place}.{key}") is not None]
        question = f"The file has its own {', '.join(own)}, whose values hold instead of the camera's."
        answer = await ask(question, {"remove": "Remove them", "keep": "Keep them"}) if own else "keep"
        if answer:
            removed = own if answer == "remove" else []
            _set(tab, {**{f"{place}.{key}": None for key in removed}, f"{place}.preset": name}, dialog)

    with open_dialog("Cameras", _WIDE) as dialog:
        presets = load_presets().items()
        draw_list(((name, str(table.get("what", "")), partial(take, name)) for name, table in presets), "camera")


def _choose_bands(tab: BrowserTab, place: str) -> None:
    with open_dialog("Bands") as dialog:
        draw_list(((name, what, partial(_set, tab, {place: name}, dialog)) for name, what in _BANDS.items()), "bands")


async def choose_unit(tab: BrowserTab, place: str, name: str = "") -> None:
    """Open the dialog that puts a mesh on a target, in the unit that the user knows it to be in.

    Parameters
    ----------
    place : of the target; empty for the one that has the mesh, or else the first
    name : of the mesh file; empty for the one that the target has
    """
    name = name or str(tab.document.get(f"{place}.model") or "")
    with tell_errors():
        sizes = await run.io_bound(list_mesh_sizes, name, tab.workspace.folder)
        targets = list_mesh_targets(tab.document.tables(), name)
        if not sizes or not targets:
            return
        with open_dialog(f"Unit of {name}") as dialog:
            ui.label("How large is it? The target gets the mesh, and a scale.").classes("text-sm")
            chosen = ui.select(targets, value=place or next(iter(targets)), label="Target").classes("w-full")
            mark(chosen, "unit-target", "dense")

            def take(metres: float) -> None:
                values = {"model": name, "size_m": None, "scale": metres}
                _set(tab, {f"{chosen.value}.{key}": value for key, value in values.items()}, dialog)

            draw_list(((unit, size, partial(take, metres)) for unit, size, metres in sizes), "unit")


_CHOOSERS: dict[tuple[type[Part], str], Chooser] = {
    (Target, "model"): Chooser("Gallery", _choose_model),
    (Target, "scale"): Chooser("Units", choose_unit),
    (Band, ""): Chooser("By name", _choose_bands),
    (Tle, ""): Chooser("Element sets", _choose_elements),
    (Lidar, "preset"): Chooser("Cameras", _choose_camera),
    (Lambertian, ""): Chooser("Catalogue", _choose_material),
}

"""Choosers: models with their pictures, materials, element sets and cameras, taken into the field that asks for them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import fastapi
from nicegui import run, ui

from rso_lidar.errors import RsoLidarError
from rso_lidar.orbit import Tle
from rso_lidar.part import Part
from rso_lidar.scenario import Lidar, Target
from rso_lidar.scenario.tables.presets import load_presets
from rso_lidar.scene import Lambertian
from rso_lidar.scene.library.model_index import models
from rso_lidar.shipped import shipped
from rso_lidar.studio.documents.tle_search import check_lines, search_sets
from rso_lidar.studio.preview.gallery import draw_portrait
from rso_lidar.studio.state import BrowserTab
from rso_lidar.study.material_list import list_materials

_MOST_ROWS = 60


@dataclass(frozen=True)
class Chooser:
    """A dialog that fills a table: the words on its button, and the function that opens it for a place."""

    title: str
    open: Callable[[BrowserTab, str], Any]


def find_chooser(cls: type[Part], key: str) -> Chooser | None:
    """Return the chooser for a field of a part, or, with an empty key, for the whole table; None if there is none.

    Parameters
    ----------
    cls : the part.
    key : name of the field.
    """
    return _CHOOSERS.get((cls, key))


def add_routes(application: fastapi.FastAPI) -> None:
    """Add the route of the models' pictures."""

    @application.get("/studio/models/{name}.png")
    def send_portrait(name: str) -> fastapi.Response:
        if name not in models():
            return fastapi.Response("no such model", 404, media_type="text/plain")
        return fastapi.Response(draw_portrait(name), media_type="image/png", headers={"cache-control": "max-age=3600"})


def _set(tab: BrowserTab, changes: Mapping[str, Any], dialog: ui.dialog) -> None:
    """Set and remove (None) values of the document, and close the dialog.

    Parameters
    ----------
    tab : whose document it changes.
    changes : values by their places.
    dialog : which is closed if that is possible.
    """
    try:
        for place, value in changes.items():
            if value is None:
                tab.document.remove(place)
            else:
                tab.document.set(place, value)
    except RsoLidarError as error:
        ui.notify(str(error), type="negative", multi_line=True)
        return
    if not dialog.is_deleted:  # the page may have been drawn again, with the changed document
        dialog.close()


def _open_dialog(title: str) -> tuple[ui.dialog, ui.card]:
    dialog = ui.dialog().props(f'aria-label="{title}"')
    dialog.on("hide", dialog.delete)
    with dialog, ui.card().classes("w-[900px] max-w-full") as card:
        ui.label(title).classes("text-lg font-medium")
    dialog.open()
    return dialog, card


def _choose_model(tab: BrowserTab, place: str) -> None:
    dialog, card = _open_dialog("Models")
    with card:
        wanted = ui.input("Search").props("dense outlined autofocus clearable").classes("w-full")
        grid = ui.element("div").classes("studio-gallery")

        def draw() -> None:
            words = (wanted.value or "").lower()
            grid.clear()
            with grid:
                for one in models().values():
                    if words in f"{one.name} {one.what}".lower():
                        with (
                            ui.card()
                            .classes("p-2 gap-1 cursor-pointer")
                            .props(
                                f'tabindex=0 role=button aria-label="{one.name}" data-test="model-{one.name}"'
                            ) as tile
                        ):
                            ui.image(f"/studio/models/{one.name}.png").classes("w-full").props(
                                f'alt="The model {one.name}" loading=lazy ratio=1 no-spinner'
                            )
                            ui.label(one.name).classes("font-medium")
                            size = " × ".join(f"{length:.3g}" for length in one.size_m)
                            ui.label(f"{size} m; {one.licence}").classes("text-xs opacity-80")
                            tile.tooltip(one.what)
                            for event in ("click", "keydown.enter"):
                                tile.on(event, lambda name=one.name: _set(tab, {f"{place}.model": name}, dialog))

        wanted.on_value_change(draw)
        draw()


def _choose_material(tab: BrowserTab, place: str) -> None:
    dialog, card = _open_dialog("Materials")
    columns = [
        {"name": key, "field": key, "label": label, "align": "left", "sortable": True}
        for key, label in (
            ("name", "Name"),
            ("kind", "BRDF"),
            ("nm1064", "1064 nm"),
            ("nm1570", "1570 nm"),
            ("what", "What"),
        )
    ]
    rows = [
        {
            "name": one.name,
            "kind": one.kind,
            "nm1064": one.reflectance[0],
            "nm1570": one.reflectance[1],
            "what": one.what,
        }
        for one in list_materials()
    ]
    with card:
        ui.label("Total reflectance at the wavelengths of the lasers; docs/materials say how sure it is.").classes(
            "text-sm"
        )
        ui.table(
            columns=columns, rows=rows, row_key="name", selection="single",
            on_select=lambda event: _set(tab, {place: event.selection[0]["name"]}, dialog) if event.selection else None,
        ).classes("w-full").props("dense wrap-cells virtual-scroll style='max-height: 60vh'")  # fmt: skip


def _choose_elements(tab: BrowserTab, place: str) -> None:
    dialog, card = _open_dialog("Element sets")
    found: dict[str, tuple[str, ...]] = {}
    files = [f"tle/{path.name}" for path in sorted(shipped("tle").glob("*.tle"))]
    files = [*tab.workspace.folder.list_files((".tle", ".txt", ".3le")), *files]

    async def take_lines() -> None:
        try:
            lines = await run.io_bound(check_lines, pasted.value or "") or ()
        except RsoLidarError as error:
            problem.set_text(str(error))
            return
        _set(tab, {place: {"type": "tle", "lines": list(lines)}}, dialog)

    async def search() -> None:
        problem.set_text("")
        try:
            made = await run.io_bound(search_sets, file.value, tab.workspace.folder, wanted.value or "", _MOST_ROWS)
        except RsoLidarError as error:
            problem.set_text(str(error))
            return
        found.clear()
        found.update(made or {})
        table.rows = [{"name": name} for name in found]

    with card:
        pasted = ui.textarea("Paste two or three lines").classes("w-full font-mono").props("outlined dense rows=3")
        ui.button("Take these lines", on_click=take_lines).props("outline dense no-caps")
        with ui.row(wrap=False).classes("w-full items-center"):
            file = (
                ui.select(files, value=files[0] if files else None, label="Catalogue").classes("w-1/3").props("dense")
            )
            wanted = ui.input("Name or number").classes("grow").props("dense").on("keydown.enter", search)
            ui.button("Search", on_click=search).props("outline dense no-caps")
        problem = ui.label().classes("text-negative").props('role="alert"')
        table = ui.table(
            columns=[{"name": "name", "field": "name", "label": "Object", "align": "left"}], rows=[], row_key="name",
            selection="single", on_select=lambda event: _set(
                tab, {place: {"type": "tle", "lines": list(found.get(event.selection[0]["name"], ()))}}, dialog
            ) if event.selection else None,
        ).classes("w-full").props("dense virtual-scroll style='max-height: 40vh'")  # fmt: skip


def _choose_camera(tab: BrowserTab, place: str) -> None:
    dialog, card = _open_dialog("Cameras")
    with card, ui.list().props("separator").classes("w-full"):
        for name, table in load_presets().items():
            with ui.item(on_click=lambda name=name: _set(tab, {f"{place}.preset": name}, dialog)), ui.item_section():
                ui.item_label(name)
                ui.item_label(str(table.get("what", ""))).props("caption")


_CHOOSERS: dict[tuple[type[Part], str], Chooser] = {
    (Target, "model"): Chooser("Gallery", _choose_model),
    (Tle, ""): Chooser("Element sets", _choose_elements),
    (Lidar, "preset"): Chooser("Cameras", _choose_camera),
    (Lambertian, ""): Chooser("Catalogue", _choose_material),
}

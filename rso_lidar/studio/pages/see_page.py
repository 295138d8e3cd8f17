"""The page See: a time slider over the frames of the document, views in space, images, pixels, clouds and figures."""

from __future__ import annotations

import asyncio
import secrets
import time
from collections.abc import Callable, Collection
from functools import partial
from typing import Any, TypeVar

import fastapi
import nicegui.elements.scene  # noqa: F401 - registers the module with three.js
import numpy as np
from nicegui import events, run, ui
from nicegui.element import Element

from rso_lidar.errors import RsoLidarError
from rso_lidar.mission_analysis import report_pixel
from rso_lidar.picture import DARK, LIGHT, Scheme, choose_window
from rso_lidar.records import Frame
from rso_lidar.studio.model.companion_image import list_bands
from rso_lidar.studio.model.flight import PreviewFlight
from rso_lidar.studio.model.flight_scenes import VIEWS, mark_sight
from rso_lidar.studio.model.frame_image import draw_image, find_pixel, outline_pixel
from rso_lidar.studio.model.scenario_figures import SCENARIO_FIGURES, CursorAxis, draw_figure
from rso_lidar.studio.model.space_scene import draw_cloud
from rso_lidar.studio.model.text_assessment import describe
from rso_lidar.studio.model.waveform_chart import make_waveform_chart
from rso_lidar.studio.pages.camera_panel import CameraPanel
from rso_lidar.studio.pages.elements import Slider, draw_button, draw_icon_button, draw_skeleton, draw_splitter, mark
from rso_lidar.studio.state import BrowserTab, Workspace

T = TypeVar("T")
_EVERY_S = 0.2  # between two frames shown
_MOST_MODELS = 64  # meshes that are held, of all tabs
_FIRST = "Working. The first start compiles the kernels, once for each installation: 15 to 25 s."
_OPEN_PICTURE = "(event) => window.open(event.currentTarget.querySelector('img').src)"
_shelves: dict[str, dict[str, tuple[bytes, str]]] = {}  # what each tab shows, by its secret key: bytes and their type
_models: dict[str, bytes] = {}  # models of surfaces by the hash of their bytes


def add_routes(application: fastapi.FastAPI, workspace: Workspace) -> None:
    """Add the binary routes of frames, point clouds and meshes."""

    @application.get("/studio/see/{key}/{name}")
    def read(key: str, name: str) -> fastapi.Response:
        held = (_models[name], "application/octet-stream") if name in _models else _shelves.get(key, {}).get(name)
        if held is None:
            raise fastapi.HTTPException(404)
        return fastapi.Response(held[0], media_type=held[1], headers={"cache-control": "no-store"})


def draw(tab: BrowserTab) -> None:
    """Draw the page for one tab of the browser."""
    SeePage(tab)


def _run(client: Any, script: str) -> None:
    client.run_javascript(script)  # what it returns is not awaited


class SeePage:
    """The page of one tab: the flight that it shows, the row of its slider, and its elements."""

    def __init__(self, tab: BrowserTab) -> None:
        """Draw the page, and show the document's flight when the page is visible."""
        self.tab, self.key, self.shelf = tab, secrets.token_urlsafe(16), dict[str, tuple[bytes, str]]()
        _shelves[self.key] = self.shelf
        self.flight: PreviewFlight | None = None
        self.flown: Any = None  # assessment that the flight is of
        self.frame: Frame | None = None
        self.scheme, self.pixel = LIGHT, (-1, -1)  # no pixel is chosen yet
        self.drawn: dict[str, Scheme] = {}  # figures that are up to date, with their colours
        self.frame_of: Any = None  # flight, row and intermediate products of the frame
        self.axis: CursorAxis | None = None  # of the timeline
        self.version, self.busy, self.again, self.whole, self.of = 0, False, False, False, tab.document
        frame, *pixel = (int(n) if n.isdecimal() and len(n) < 7 else -1 for n in self._recall_numbers())
        self.opens_at = max(frame, 0)  # row that is shown first
        self.first_pixel = (pixel[0], pixel[1])
        panel = ui.context.slot.parent
        self.panels: Any = panel.parent_slot.parent if panel.parent_slot else None
        if isinstance(self.panels, ui.tab_panels):
            self.panels.on_value_change(self.request)
        self._draw_bars()
        splitter = draw_splitter("space", 44, (20, 75), "%").classes("studio-see")
        self.parts.append(splitter)
        with splitter.before, ui.column().classes("w-full gap-1 h-full pr-2 studio-space"):
            names = {name: name.capitalize() for name in VIEWS}
            self.view = ui.toggle(names, value=self._recall("view", VIEWS, "target"), on_change=self.request)
            mark(self.view, "view", 'dense no-caps aria-label="View in space"')
            self.space = SpaceView("View in space", f"/studio/see/{self.key}/").classes("w-full grow")
            mark(self.space, "space")
            self.waiting = [draw_skeleton("grow")]
            self.space.set_visibility(False)
        with splitter.after, ui.column().classes("w-full gap-0 h-full pl-2 studio-right"):
            self._draw_right()
        self.timer = ui.timer(_EVERY_S, self._play, active=False)
        client, is_dark = ui.context.client, "document.body.classList.contains('body--dark')"
        tell = f"emitEvent('studio_dark', {is_dark})"
        watch = f"new MutationObserver(() => {tell}).observe(document.body, {{attributeFilter: ['class']}}); {tell}"
        client.on_delete(lambda: _shelves.pop(self.key, None))
        client.on_connect(lambda: _run(client, watch))
        ui.on("studio_dark", self._set_dark)
        tab.assessed.subscribe(self.request)
        tab.end_chosen.subscribe(self._go_to_end)

    def _recall(self, key: str, names: Collection[str], usual: str) -> str:
        """Return what was selected before a reload, or what is usual."""
        kept = self.tab.selection.get(key, "")
        return kept if kept in names else usual

    def _recall_numbers(self) -> list[str]:
        """Return the row of the frame, and the row and column of the pixel, that were selected before a reload."""
        pixel = self.tab.selection.get("pixel", "").split(",")
        return [self.tab.selection.get("frame", ""), *(pixel if len(pixel) == 2 else ("", ""))]

    def _draw_bars(self) -> None:
        with mark(ui.row().classes("w-full items-center gap-2"), "problem") as self.problem:
            self.problem_text = ui.label().classes("grow").props("role=alert")
            draw_button("Show in Build", self._go_to_build)
        self.problem.set_visibility(False)
        with ui.row(wrap=False).classes("w-full items-center gap-1") as bar:
            draw_icon_button("skip_previous", "Previous frame", partial(self._step, -1))
            draw_icon_button("skip_next", "Next frame", partial(self._step, 1))
            self.play = draw_icon_button("play_arrow", "Play", self._toggle_play)
            self.slider = Slider(min=0, max=1, step=1, value=0, on_change=self.request).classes("grow mx-2")
            mark(self.slider, "time", "aria-label=Time")
            self.slider.on("keydown.home", partial(self._step, -(10**9))).on("keydown.end", partial(self._step, 10**9))
            when = ui.label().classes("text-sm tabular-nums text-right whitespace-nowrap studio-when")
            self.when = mark(when, "when")
        self.parts: list[Any] = [bar]
        with ui.row().classes("w-full items-center gap-2 studio-note"):
            self.spinner = ui.spinner(size="sm")
            self.note = mark(ui.label().classes("text-sm"), "note", "role=status")
        self.spinner.set_visibility(False)

    def _draw_right(self) -> None:
        names = {
            "image": "Image",
            "camera": "Camera",
            "cloud": "Point cloud",
            **{k: k.capitalize() for k in SCENARIO_FIGURES},
            "text": "Text",
        }
        with ui.tabs(on_change=self.request).props("dense no-caps align=left inline-label") as self.tabs:
            for name, label in names.items():
                tab = mark(ui.tab(name, label=label), f"show-{name}")
                if name == "camera":
                    self.camera_tab = tab
        self.camera_tab.set_visibility(False)
        self.pictures, self.skeletons = dict[str, ui.interactive_image](), dict[str, Any]()
        with ui.tab_panels(self.tabs, value=self._recall("figure", names, "image")).classes("w-full grow"):
            with ui.tab_panel("image").classes("gap-1 p-1"):
                self._draw_image_panel()
            with ui.tab_panel("camera").classes("gap-1 p-1"):
                self.camera = CameraPanel(self.request, self.tab.selection.get("camera", ""))
            with ui.tab_panel("cloud").classes("h-full gap-1"):
                with ui.row():
                    colours, ask = ["range", "intensity", "part", "probability"], self.request
                    self.colour = ui.select(colours, value="range", label="Colour", on_change=ask).props("dense")
                    self.cloud_axes = ui.select(["lidar"], value="lidar", label="Axes", on_change=ask).props("dense")
                self.cloud = SpaceView("Point cloud", f"/studio/see/{self.key}/").classes("w-full studio-cloud")
                self.cloud.on("pick", self._pick)
            for name in SCENARIO_FIGURES:
                with ui.tab_panel(name).classes("p-1 gap-1").props("tabindex=0"):  # long ones scroll
                    self.skeletons[name] = draw_skeleton("studio-cloud")
                    is_timeline = name == "timeline"
                    picture = ui.interactive_image(on_mouse=self._choose_time if is_timeline else None, sanitize=False)
                    mark(picture.classes("w-full"), f"figure-{name}", f'role=img aria-label="{name} of the scenario"')
                    if is_timeline:
                        picture.classes("cursor-crosshair")
                    else:
                        picture.classes("cursor-pointer").on("click", js_handler=_OPEN_PICTURE)
                    hint = "A click goes to that time" if is_timeline else "A click opens it alone"
                    with picture:
                        ui.tooltip(hint).props('anchor="top middle" self="top middle" delay=500')
                    self.pictures[name] = picture
            with ui.tab_panel("text"):
                self.text = ui.label().classes("studio-description")

    def _draw_image_panel(self) -> None:
        self.waiting.append(draw_skeleton("studio-cloud"))
        image = ui.interactive_image(on_mouse=self._click, sanitize=False).classes("w-full cursor-crosshair")
        self.image = mark(image, "image", 'role=img aria-label="Range and intensity of the frame"')
        with ui.row(wrap=False).classes("w-full gap-2 items-start"):
            with ui.column().classes("gap-1 studio-pixel"):
                with ui.row(wrap=False).classes("gap-2"):
                    self.row = ui.number("Row", min=0, precision=0, value=0, on_change=self._choose).props("dense")
                    self.col = ui.number("Column", min=0, precision=0, value=0, on_change=self._choose).props("dense")
                    ui.switch("Whole field", on_change=self._set_whole).props("dense").classes("text-xs")
                self.numbers = mark(ui.grid(columns="auto auto").classes("text-xs gap-x-3 gap-y-0"), "numbers")
            self.chart = mark(ui.echart({}, renderer="svg").classes("grow studio-waveform"), "waveform", "role=img")
            self.chart.props('aria-label="Waveform of the pixel"')

    def _go_to_build(self) -> None:
        self.tab.page_chosen.emit("build")
        if self.tab.assessment and self.tab.assessment.place:
            self.tab.field_chosen.emit(self.tab.assessment.place)

    def _set_dark(self, event: events.GenericEventArguments) -> None:
        scheme = DARK if event.args else LIGHT
        if scheme != self.scheme:
            self.scheme = scheme
            self.request()

    def _set_whole(self, event: events.ValueChangeEventArguments) -> None:
        self.whole = bool(event.value)
        self.request()

    def _step(self, step: int) -> None:
        """Move the slider by a number of frames, at most to its ends."""
        last = len(self.flight.numbers) - 1 if self.flight else 0
        self.slider.value = min(max(int(self.slider.value) + step, 0), last)

    def _go_to_end(self) -> None:
        """Show the last frame, or show it first where nothing is shown yet."""
        self.opens_at = 10**9 if self.flight is None or self.tab.document is not self.of else 0
        self._step(10**9)

    def _choose_time(self, event: events.MouseEventArguments) -> None:
        """Move the slider to the frame at the time that was clicked at."""
        if self.axis and self.flight:
            self.slider.value = self.flight.find_row(self.axis.find_time_s(event.image_x))

    def _toggle_play(self) -> None:
        self.timer.active = not self.timer.active
        self.play.props(f"icon={'pause' if self.timer.active else 'play_arrow'}")
        self.play.props(f'aria-label="{"Pause" if self.timer.active else "Play"}"')

    def _play(self) -> None:
        if not self.busy and self.flight:
            self.slider.value = (int(self.slider.value) + 1) % len(self.flight.numbers)

    def _click(self, event: events.MouseEventArguments) -> None:
        if self.frame is None:
            return
        pixel = find_pixel(choose_window(self.frame, whole=self.whole), event.image_x, event.image_y)
        if pixel:
            self.row.value, self.col.value = pixel

    def _pick(self, event: events.GenericEventArguments) -> None:
        """Choose the pixel of the return that was clicked at."""
        if self.frame is not None:
            pixels = np.argwhere(self.frame.valid)
            self.row.value, self.col.value = pixels[min(max(int(event.args), 0), len(pixels) - 1)].tolist()

    def _choose(self) -> None:
        if self.frame is not None:
            asked = (int(self.row.value or 0), int(self.col.value or 0))
            row, col = (min(max(k, 0), n - 1) for k, n in zip(asked, self.frame.valid.shape, strict=True))
            if (row, col) != self.pixel:
                self.pixel = row, col
                self.tab.select("pixel", f"{row},{col}")
                self.request()

    def request(self, *_: Any) -> None:
        """Show the present choices soon; while others are shown, only the latest request is kept."""
        if isinstance(self.panels, ui.tab_panels) and self.panels.value != "see":
            return
        self.again = True
        if not self.busy:
            self.busy = True
            asyncio.get_running_loop().create_task(self._refresh())

    async def _refresh(self) -> None:
        try:
            while self.again and self.key in _shelves:
                self.again, begun = False, time.monotonic()
                self.spinner.set_visibility(True)
                await self._fly()
                if self.flight:
                    await self._show(self.flight, int(self.slider.value))
                await asyncio.sleep(max(0.0, _EVERY_S - (time.monotonic() - begun)))
        except RsoLidarError as error:
            self._complain(str(error))
        finally:
            self.busy = False
            self.spinner.set_visibility(False)

    def _complain(self, text: str, *, is_error: bool = True) -> None:
        self.problem_text.text = text
        self.problem_text.classes(replace="grow text-negative" if is_error else "grow studio-empty")
        self.problem.set_visibility(bool(text))
        for part in self.parts:  # nothing can be seen yet
            part.set_visibility(not text or self.flight is not None)
        self.note.text = "Below: the last version that could be flown." if text and self.flight else ""
        for element in (self.space, self.image, self.cloud, self.camera.image):
            element.classes("studio-old") if text else element.classes(remove="studio-old")

    async def _fly(self) -> None:
        assessment = self.tab.assessment
        if assessment is None or assessment is self.flown:
            return
        self.flown = assessment
        if assessment.scenario is None or not assessment.is_ready:
            is_error = bool(assessment.problem) and not assessment.is_blank
            self._complain(assessment.problem or assessment.refusal, is_error=is_error)
            return
        self.note.text = _FIRST if self.flight is None else "Working."
        flight = await self._work(PreviewFlight.of, assessment.text, assessment.scenario)
        _models.update(await self._work(lambda: dict(flight.models.values())))
        for name in list(_models)[:-_MOST_MODELS]:
            del _models[name]
        if self.tab.document is not self.of:
            self.of = self.tab.document
            self.space.run_method("forget")
        last = len(flight.numbers) - 1
        self.slider.props(f"max={max(last, 0)}")
        self.flight, self.slider.value = flight, min(self.opens_at or int(self.slider.value), last)
        self.opens_at = 0
        self.cloud_axes.set_options(["lidar", *flight.targets])
        self._offer_cameras(flight)
        self.view.set_options({k: k.capitalize() for k in VIEWS if k != "orbit" or not flight.scenario.is_local})
        self.text.text, self.pixel, self.axis = "", self.first_pixel, None
        self.row.value, self.col.value = (max(k, 0) for k in self.pixel)
        self.first_pixel = (-1, -1)
        for name, picture in self.pictures.items():
            picture.set_source("")
            picture.content = ""
            self.skeletons[name].set_visibility(True)
        self.shelf.clear()
        self.drawn.clear()
        self._complain("")

    def _offer_cameras(self, flight: PreviewFlight) -> None:
        """Offer the cameras of a flight, and hide their tab where there are none."""
        cameras = list_bands(flight.scenario.source.scenario) if flight.scenario.camera else {}
        self.camera.offer(cameras)
        self.camera_tab.set_visibility(bool(cameras))
        if not cameras and self.tabs.value == "camera":
            self.tabs.value = "image"

    async def _work(self, action: Callable[..., T], *arguments: Any) -> T:
        """Return the result of work done in a thread; cancel the task where the studio is ending or the tab has closed."""
        result = await run.io_bound(action, *arguments)
        if result is None or self.key not in _shelves:
            raise asyncio.CancelledError
        return result

    def _put(self, name: str, content: bytes, kind: str) -> str:
        """Keep what the browser is to fetch, and return its address."""
        self.version += 1
        self.shelf[name] = (content, kind)
        return f"/studio/see/{self.key}/{name}?v={self.version}"

    async def _show(self, flight: PreviewFlight, row: int) -> None:
        """Make and show what is visible of a row."""
        shown, view = self.tabs.value or "image", self.view.value or "target"
        cameras = (self.camera.camera,) if shown == "camera" and self.camera.camera else ()
        self.when.text = flight.describe_moment(row)
        for key, value in (("view", view), ("figure", shown), ("frame", str(row)), ("camera", self.camera.camera)):
            if value:
                self.tab.select(key, value)
        if self.frame is None:  # the first one may take long; the view in space does not
            await self._show_space(flight, row, view)
            self.note.text = self.note.text or _FIRST
        keep: tuple[str, ...] = ("waveforms", "taps") if shown == "image" else ()
        if shown == "cloud" and self.colour.value == "probability":
            keep = ("prediction",)
        if self.frame is None or self.frame_of[:2] != (flight, row) or not {*keep, *cameras} <= {*self.frame_of[2]}:
            self.frame = await self._work(flight.frame, row, keep, cameras)
            self.frame_of = flight, row, keep + cameras
        frame = self.frame
        rows, cols = frame.valid.shape
        if not (0 <= self.pixel[0] < rows and 0 <= self.pixel[1] < cols):  # the brightest
            self.pixel = self.row.value, self.col.value = divmod(int(frame.intensity_counts.argmax()), cols)
        await self._show_space(flight, row, view)
        if shown in SCENARIO_FIGURES:
            await self._show_figure(flight, row, shown)
        elif shown == "text" and not self.text.text:
            self.note.text = "Describing."
            self.text.text = await self._work(describe, flight.scenario)
        elif shown == "cloud":
            colour, axes = self.colour.value, self.cloud_axes.value
            cloud_bytes = await self._work(draw_cloud, frame, self.scheme, colour, axes, self.pixel)
            self.cloud.show(self._put("cloud", cloud_bytes, "application/octet-stream"))
        elif shown == "image":
            await self._show_image(flight, row, frame)
        elif cameras:
            png = await self._work(self.camera.draw, frame, cameras[0], self.scheme)
            self.camera.show(frame, self._put("camera", png, "image/png"))
        self.note.text = self.note.text if self.problem.visible else ""

    async def _show_space(self, flight: PreviewFlight, row: int, view: str) -> None:
        """Show a view in space, with the line of sight of the chosen pixel where its frame is known."""
        scene = await self._work(VIEWS[view], flight, row)
        frame = self.frame if self.frame_of and self.frame_of[:2] == (flight, row) else None
        if view != "orbit" and frame is not None and frame.valid[self.pixel]:
            words = "row {}, column {}".format(*self.pixel)
            mark_sight(scene, flight, row, frame.points_m[self.pixel], words)
        self.space.show(self._put("space", await self._work(scene.pack), "application/octet-stream"))
        self.space.set_visibility(True)
        self.waiting[0].set_visibility(False)

    async def _show_figure(self, flight: PreviewFlight, row: int, name: str) -> None:
        """Show a figure of the scenario, and on the timeline the time of the row."""
        picture = self.pictures[name]
        if self.drawn.get(name) != self.scheme:
            self.note.text, self.drawn[name] = "Drawing.", self.scheme
            png, axis = await self._work(draw_figure, name, flight.scenario, self.scheme)
            self.axis = axis or self.axis
            picture.set_source(self._put(name, png, "image/png"))
            self.skeletons[name].set_visibility(False)
        if name == "timeline" and self.axis:
            picture.content = self.axis.draw_cursor(flight.truth(row).time_s, self.scheme.mark)

    async def _show_image(self, flight: PreviewFlight, row: int, frame: Frame) -> None:
        """Show range and intensity of a frame, and the report of the chosen pixel.

        Parameters
        ----------
        flight, row, frame : the flight, and the frame of a row
        """
        png = await self._work(lambda: draw_image(frame, self.scheme, whole=self.whole))
        self.image.set_source(self._put("image", png, "image/png"))
        self.waiting[1].set_visibility(False)
        report = await self._work(report_pixel, frame, flight.moments[row].lidar, self.pixel)
        self.image.content = outline_pixel(choose_window(frame, whole=self.whole), *self.pixel)
        self.numbers.clear()
        with self.numbers:
            for name, value in report.numbers:
                ui.label(name).classes("opacity-80 whitespace-nowrap")
                ui.label(value).classes("tabular-nums")
        self.chart.options.clear()
        self.chart.options.update(make_waveform_chart(report.curves, report.instants_ns, report.note, self.scheme))
        self.chart.update()


class SpaceView(Element, component="space_view.js"):
    """A view of the scene at an address; it changes when the address does."""

    def __init__(self, label: str, models: str) -> None:
        """Make an empty view; `label` names it to screen readers, and `models` begins the addresses of meshes."""
        super().__init__()
        self._props["label"], self._props["models"], self._props["url"] = label, models, ""

    def show(self, url: str) -> None:
        """Show the scene at an address."""
        self._props["url"] = url
        self.update()

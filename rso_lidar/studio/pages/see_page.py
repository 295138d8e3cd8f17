"""The page See: a time slider over the frames of the document, views in space, images, pixels, clouds and figures."""

from __future__ import annotations

import asyncio
import secrets
import time
from collections.abc import Callable
from typing import Any, TypeVar

import fastapi
from nicegui import events, run, ui

from rso_lidar.errors import RsoLidarError
from rso_lidar.orbit.epochs import format_utc
from rso_lidar.picture import DARK, LIGHT
from rso_lidar.picture.frames.frame_image import choose_window, draw_image, find_pixel, mark_pixel
from rso_lidar.picture.viewers.space_scene import draw_cloud
from rso_lidar.records import Frame
from rso_lidar.studio.documents.assessment import describe
from rso_lidar.studio.pages.space_view import SpaceView
from rso_lidar.studio.preview.figures import FIGURES, draw_figure
from rso_lidar.studio.preview.flight import PreviewFlight
from rso_lidar.studio.preview.views import VIEWS
from rso_lidar.studio.state import BrowserTab, Workspace
from rso_lidar.study.pixel_summary import PixelReport, report_pixel

T = TypeVar("T")
_EVERY_S = 0.2  # between two frames shown
_MOST_MODELS = 64  # meshes that are held, of all tabs
_FIRST = "Working. The first start compiles the kernels, once for each installation: 15 to 25 s."
_shelves: dict[str, dict[str, tuple[bytes, str]]] = {}  # what each tab shows, by its secret key: bytes and their type
_models: dict[str, bytes] = {}  # meshes by the hash of their geometry


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
        self.drawn: set[tuple[str, Any]] = set()  # figures that are up to date, with their colours
        self.version, self.busy, self.again, self.whole = 0, False, False, False
        panel = ui.context.slot.parent
        self.panels: Any = panel.parent_slot.parent if panel.parent_slot else None
        if isinstance(self.panels, ui.tab_panels):
            self.panels.on_value_change(self.request)
        self._draw_bars()
        with (
            ui.row()
            .classes("w-full no-wrap gap-2 items-stretch")
            .style("height: calc(100vh - 124px); min-height: 480px")
        ):
            with ui.column().classes("gap-1 h-full").style("width: 44%"):
                self.view = ui.toggle(
                    {name: name.capitalize() for name in VIEWS}, value="target", on_change=self.request
                )
                self.view.props('dense no-caps data-test="view" aria-label="View in space"').mark("view")
                self.space = SpaceView("View in space", f"/studio/see/{self.key}/").classes("w-full grow")
                self.space.props('data-test="space"')
            with ui.column().classes("gap-0 h-full").style("width: 56%"):
                self._draw_right()
        self.timer = ui.timer(_EVERY_S, self._play, active=False)
        client = ui.context.client
        client.on_delete(lambda: _shelves.pop(self.key, None))
        ui.on("studio_dark", self._set_dark)
        look = "emitEvent('studio_dark', document.body.classList.contains('body--dark'))"
        watch = f"new MutationObserver(() => {look}).observe(document.body, {{attributeFilter: ['class']}}); {look}"

        def watch_colours() -> None:
            client.run_javascript(watch)

        client.on_connect(watch_colours)
        tab.assessed.subscribe(self.request)

    def _draw_bars(self) -> None:
        with ui.row().classes("w-full items-center gap-2").mark("problem") as self.problem:
            self.problem_text = ui.label().classes("text-negative grow")
            ui.button("Show in Build", on_click=self._go_to_build).props("dense outline no-caps")
        self.problem.set_visibility(False)
        with ui.row().classes("w-full no-wrap items-center gap-1"):
            for icon, label, step in (("skip_previous", "Previous frame", -1), ("skip_next", "Next frame", 1)):
                ui.button(icon=icon, on_click=lambda step=step: self._step(step)).props(
                    f'flat round dense aria-label="{label}"'
                ).mark(label)
            self.play = ui.button(icon="play_arrow", on_click=self._toggle_play).props(
                'flat round dense aria-label="Play"'
            )
            self.slider = ui.slider(min=0, max=1, step=1, value=0, on_change=self.request).classes("grow mx-2")
            self.slider.props('aria-label="Time" data-test="time"').mark("time")
            self.when = (
                ui.label()
                .classes("text-sm tabular-nums text-right whitespace-nowrap")
                .style("min-width: 450px")
                .mark("when")
            )
        with ui.row().classes("w-full items-center gap-2").style("height: 22px; margin: -12px 0"):
            self.spinner = ui.spinner(size="sm")
            self.note = ui.label().classes("text-sm").props('role="status"').mark("note")
        self.spinner.set_visibility(False)

    def _draw_right(self) -> None:
        names = {
            "image": "Image",
            "cloud": "Point cloud",
            **{name: name.capitalize() for name in FIGURES},
            "text": "Text",
        }
        with ui.tabs(on_change=self.request).props("dense no-caps align=left inline-label") as self.tabs:
            for name, label in names.items():
                ui.tab(name, label=label)
        with ui.tab_panels(self.tabs, value="image").classes("w-full grow"):
            with ui.tab_panel("image").classes("gap-1 p-1"):
                self.image = ui.interactive_image(on_mouse=self._click, sanitize=False).classes(
                    "w-full cursor-crosshair"
                )
                self.image.props('role="img" data-test="image" aria-label="Range and intensity of the frame"').mark(
                    "image"
                )
                with ui.row().classes("w-full no-wrap gap-2 items-start"):
                    with ui.column().classes("gap-1").style("width: 235px"):
                        with ui.row().classes("no-wrap gap-2"):
                            self.row = ui.number("Row", min=0, precision=0, value=0, on_change=self._choose)
                            self.col = ui.number("Column", min=0, precision=0, value=0, on_change=self._choose)
                            for field in (self.row, self.col):
                                field.props("dense").style("width: 62px")
                            ui.switch("Whole field", on_change=self._set_whole).props("dense").classes("text-xs")
                        self.numbers = ui.grid(columns="auto auto").classes("text-xs gap-x-3 gap-y-0").mark("numbers")
                    self.chart = ui.echart({}, renderer="svg").classes("grow").style("height: 235px; min-width: 300px")
                    self.chart.props('data-test="waveform" role="img" aria-label="Waveform of the pixel"')
            with ui.tab_panel("cloud").classes("h-full gap-1"):
                with ui.row():
                    choices = ["range", "intensity", "part", "probability"]
                    self.colour = ui.select(choices, value="range", label="Colour", on_change=self.request).props(
                        "dense"
                    )
                    self.cloud_axes = ui.select(["lidar"], value="lidar", label="Axes", on_change=self.request).props(
                        "dense"
                    )
                self.cloud = (
                    SpaceView("Point cloud", f"/studio/see/{self.key}/").classes("w-full").style("height: 440px")
                )
            self.pictures: dict[str, ui.image] = {}
            for name in FIGURES:
                with ui.tab_panel(name):
                    self.pictures[name] = ui.image().props(f'alt="{name} of the scenario" fit=contain no-transition')
            with ui.tab_panel("text"):
                self.text = ui.label().classes("text-xs").style("white-space: pre-wrap; font-family: monospace")

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
        last = len(self.flight.numbers) - 1 if self.flight else 0
        self.slider.value = min(max(int(self.slider.value) + step, 0), last)

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
        found = find_pixel(choose_window(self.frame, whole=self.whole), event.image_x, event.image_y)
        if found:
            self.row.value, self.col.value = found

    def _choose(self) -> None:
        if self.frame is not None:
            last = (size - 1 for size in self.frame.valid.shape)
            asked = (int(self.row.value or 0), int(self.col.value or 0))
            pixel = tuple(min(max(k, 0), end) for k, end in zip(asked, last, strict=True))
            if pixel != self.pixel:
                self.pixel = pixel[0], pixel[1]
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

    def _complain(self, text: str) -> None:
        self.problem_text.text = text
        self.problem.set_visibility(bool(text))
        self.note.text = "Below: the last version that could be flown." if text and self.flight else ""
        for element in (self.space, self.image, self.cloud):
            element.style(f"opacity: {0.45 if text else 1}")

    async def _fly(self) -> None:
        made = self.tab.assessment
        if made is None or made is self.flown:
            return
        self.flown = made
        if made.scenario is None or made.refusal:
            self._complain(made.problem or made.refusal)
            return
        self.note.text = _FIRST if self.flight is None else "Working."
        flight = await self._work(PreviewFlight.of, made.text, made.scenario)
        models = await self._work(lambda: {name: one.tobytes() for name, one in flight.surfaces.items()})
        _models.update(models)
        for name in list(_models)[:-_MOST_MODELS]:
            del _models[name]
        self.flight, self.slider.value = flight, min(int(self.slider.value), len(flight.numbers) - 1)
        self.slider.props(f"max={max(len(flight.numbers) - 1, 0)}")
        self.cloud_axes.set_options(["lidar", *flight.targets])
        self.view.set_options({k: k.capitalize() for k in VIEWS if k != "orbit" or not flight.scenario.is_local})
        self.text.text, self.pixel = "", (-1, -1)
        for picture in self.pictures.values():
            picture.set_source("")
        self.shelf.clear()
        self.drawn.clear()
        self._complain("")

    async def _work(self, deed: Callable[..., T], *arguments: Any) -> T:
        """Return the result of work done in a thread; cancel the task where the studio is ending or the tab has closed."""
        made = await run.io_bound(deed, *arguments)
        if made is None or self.key not in _shelves:
            raise asyncio.CancelledError
        return made

    def _put(self, name: str, content: bytes, kind: str) -> str:
        """Keep what the browser is to fetch, and return its address.

        Parameters
        ----------
        name, content, kind : name, bytes and media type.
        """
        self.version += 1
        self.shelf[name] = (content, kind)
        return f"/studio/see/{self.key}/{name}?v={self.version}"

    async def _show(self, flight: PreviewFlight, row: int) -> None:
        """Make and show what is visible of a row."""
        shown, scheme, view = self.tabs.value or "image", self.scheme, self.view.value or "target"
        scene = await self._work(lambda: VIEWS[view](flight, row, scheme).pack())
        self.space.show(self._put("space", scene, "application/octet-stream"))
        seconds, truth_range = flight.truth(row).time_s, flight.range_m(row)
        far = f"range {truth_range:,.2f} m" if flight.targets else "no target"
        utc = format_utc(flight.scenario.time.start_utc, seconds)
        self.when.text = f"frame {flight.numbers[row]}  ·  {seconds:,.3f} s  ·  {utc}  ·  {far}"
        if shown in FIGURES:
            if (shown, scheme) not in self.drawn:
                self.note.text = "Drawing."
                self.drawn.add((shown, scheme))
                self.pictures[shown].set_source(
                    self._put(shown, await self._work(draw_figure, shown, flight.scenario, scheme), "image/png")
                )
        elif shown == "text" and not self.text.text:
            self.note.text = "Describing."
            self.text.text = await self._work(describe, flight.scenario)
        elif shown in ("image", "cloud"):
            keep = (
                ("waveforms", "taps")
                if shown == "image"
                else ("prediction",)
                if self.colour.value == "probability"
                else ()
            )
            self.frame = frame = await self._work(flight.frame, row, keep)
            if shown == "cloud":
                colour, axes = self.colour.value, self.cloud_axes.value
                made = await self._work(draw_cloud, frame, scheme, colour, axes)
                self.cloud.show(self._put("cloud", made, "application/octet-stream"))
            else:
                await self._show_image(flight, row, frame)
        self.note.text = self.note.text if self.problem.visible else ""

    async def _show_image(self, flight: PreviewFlight, row: int, frame: Frame) -> None:
        """Show range and intensity of a frame, and the report of the chosen pixel.

        Parameters
        ----------
        flight, row, frame : the flight, and the frame of a row.
        """
        png = await self._work(lambda: draw_image(frame, self.scheme, whole=self.whole))
        self.image.set_source(self._put("image", png, "image/png"))
        if self.pixel[0] < 0 or any(
            k >= n for k, n in zip(self.pixel, frame.valid.shape, strict=True)
        ):  # the brightest
            row_of, col_of = divmod(int(frame.intensity_counts.argmax()), frame.valid.shape[1])
            self.pixel = self.row.value, self.col.value = row_of, col_of
        report = await self._work(report_pixel, frame, flight.moments[row].lidar, self.pixel)
        boxes = mark_pixel(choose_window(frame, whole=self.whole), *self.pixel)
        self.image.content = "".join(
            f'<rect x="{x}" y="{y}" width="{side}" height="{side}" fill="none" stroke="#ff7a18" stroke-width="3"/>'
            for x, y, side in boxes
        )
        self.numbers.clear()
        with self.numbers:
            for name, value in report.numbers:
                ui.label(name).classes("opacity-80 whitespace-nowrap")
                ui.label(value).classes("tabular-nums")
        self.chart.options.clear()
        self.chart.options.update(_chart_options(report, self.scheme))
        self.chart.update()


def _chart_options(report: PixelReport, scheme: Any) -> dict[str, Any]:
    """Return the options of the chart of a waveform."""
    words = {"color": scheme.quiet}
    title = {"text": report.note, "textStyle": {**words, "fontSize": 12, "fontWeight": "normal"}}
    if not report.curves:
        return {"title": title}
    axis = {
        "nameLocation": "middle",
        "scale": True,
        "axisLabel": words,
        "nameTextStyle": words,
        "splitLine": {"show": False},
    }
    # Along their lines on different sides: truth and report are often within a nanosecond.
    sides = {"truth": "insideEndBottom", "reported": "insideEndTop", "trigger": "insideStartTop"}
    marks = [
        {"xAxis": at, "label": {"formatter": name, "position": sides[name], **words}}
        for name, at in report.instants_ns.items()
    ]
    series = []
    for k, (name, curve) in enumerate(report.curves.items()):
        one = {"name": name, "type": "line", "data": curve.round(4).tolist(), "showSymbol": name == "samples"}
        one |= {"color": scheme.lines[k % 6], "yAxisIndex": int(name.startswith("light")), "animation": False}
        one["lineStyle"] = {"width": 1.4, "type": "dashed" if name in ("threshold", "reported pulse") else "solid"}
        if name == "samples":
            one["markLine"] = {"symbol": "none", "animation": False, "data": marks, "lineStyle": {"color": scheme.mark}}
        series.append(one)
    start, end = report.curves["samples"][[0, -1], 0]
    return {
        "grid": {"left": 60, "right": 55, "top": 48, "bottom": 38},
        "legend": {"textStyle": {**words, "fontSize": 11}, "top": 0, "itemWidth": 16, "itemGap": 8},
        "tooltip": {"trigger": "axis"},
        "xAxis": {**axis, "type": "value", "name": "time since emission [ns]", "nameGap": 24, "min": start, "max": end},
        "yAxis": [
            {**axis, "name": "counts", "nameGap": 44},
            {**axis, "name": "photoelectrons per step", "nameGap": 38},
        ],
        "series": series,
    }

"""The viewer of recordings: one slider over the frames of one or two, followed while they are written."""

from __future__ import annotations

import base64
from collections.abc import Callable
from functools import partial
from typing import Any

from nicegui import events, run, ui

from rso_lidar.export import Recording
from rso_lidar.picture import DARK, LIGHT, Scheme
from rso_lidar.studio.model.frame_drawing import DrawnFrame, draw_recorded_frame
from rso_lidar.studio.model.frame_image import IMAGE_SIZE
from rso_lidar.studio.model.recording_list import open_recording
from rso_lidar.studio.model.root_folder import Folder
from rso_lidar.studio.pages.elements import Slider, mark, tell_errors

_PLAY_S = 0.15


class FrameViewer:
    """Range and intensity of the frames of a recording, complete or being written, and of another compared with it."""

    def __init__(self, folder: Folder) -> None:
        self._folder = folder
        self._recording: Recording | None = None
        self._other: Recording | None = None
        self.name, self.is_following = "", False
        self._scheme, self._wanted = LIGHT, -1
        self._shown: Any = None
        self._names: list[str] = []
        self._is_drawing = False
        self._title = ui.label("Frames").classes("text-base font-medium")
        self._empty = ui.label("The frames of a recording appear here. Choose one in the list, or start a run.")
        self._empty.classes("studio-empty")
        with ui.row(wrap=False).classes("w-full items-center gap-2 max-w-[1000px]") as player:
            self._play = ui.switch("Play").props("dense")
            self._newest = ui.switch("Newest", on_change=lambda event: self._set(len(self)) if event.value else None)
            self._slider = Slider(min=0, max=0, step=1, value=0, on_change=lambda event: self._request(event.value))
            mark(self._slider.classes("grow mx-3"), "slider", 'aria-label="Frame"')
            self._slider.on("keydown.home", lambda: self._set(1)).on("keydown.end", lambda: self._set(len(self)))
        with ui.row(wrap=False).classes("w-full items-center gap-3 max-w-[1000px]") as choices:
            self._against = ui.select({None: "nothing"}, value=None, label="Compare with", on_change=self._compare)
            mark(self._against.classes("w-64"), "compare", "dense outlined")
            self._camera = ui.select({"": "lidar"}, value="", label="Image of", on_change=self._change_camera)
            mark(self._camera.classes("w-40"), "shown", "dense outlined")
            self._marks = ui.switch("Truth and centroid", on_change=lambda: self._request(self._slider.value))
            mark(self._marks, "marks", "dense")
        self._controls = (player, choices)
        self._show_controls()
        self._words = mark(ui.column().classes("text-sm gap-0"), "words")
        self._images: dict[str, Any] = {}
        with ui.element("div").classes("w-full studio-frames"):
            for title, name in (("A", "A"), ("B", "B"), ("B − A", "difference")):
                with ui.column().classes("gap-1") as cell:
                    ui.label(f"Recording {title}" if name == title else title).classes("text-sm font-medium")
                    image = ui.interactive_image(
                        size=IMAGE_SIZE, on_mouse=partial(self._point, title), events=["mousemove"], sanitize=False
                    ).classes("w-full")
                self._images[title] = mark(image, f"frame-{name}", "role=img")
                image.set_visibility(False)
                cell.bind_visibility_from(image)
        self._pixel = mark(ui.label().classes("text-sm tabular-nums"), "pixel")
        self._describe_point: Callable[[str, float, float], str] | None = None
        ui.on("studio_dark", lambda event: self._set_scheme(DARK if event.args else LIGHT))
        ui.timer(_PLAY_S, self._advance)

    def _show_controls(self) -> None:
        for row in self._controls:
            row.set_visibility(self._recording is not None)
        self._empty.set_visibility(self._recording is None)

    def __len__(self) -> int:
        return len(self._recording) if self._recording is not None else 0

    async def open(self, name: str) -> None:
        """Show a recording of the folder."""
        self.name, self._shown = name, None
        self.offer(self._names)
        await self._read()
        await self._request(min(int(self._slider.value), max(len(self) - 1, 0)))

    def offer(self, names: list[str]) -> None:
        """Offer recordings to compare with."""
        self._names = names
        options: dict[str | None, str] = {None: "nothing", **{name: name for name in names if name != self.name}}
        if options != self._against.options:
            self._against.set_options(options, value=self._against.value if self._against.value in options else None)

    async def refresh(self) -> None:
        """Read new frames of a recording that is being written."""
        if self.name and self.is_following:
            await self._read()
            if self._newest.value:
                self._set(len(self))
            elif self._shown is None:
                await self._request(self._slider.value)

    async def _read(self) -> None:
        """Open the file that holds the frames now; a file that grows is opened again."""
        name = self.name
        recording_state = await self._open(name)
        if recording_state is None or name != self.name:
            self.is_following &= name != self.name  # what cannot be read is not read again each second
            return
        before, (self._recording, self.is_following) = self._recording, recording_state
        if before is not None and not self._is_drawing:
            before.close()
        self._show_controls()
        self._title.set_text(f"{name}: {self._recording.source.title}, {len(self):,} frames")
        self._slider.props(f"max={max(len(self) - 1, 0)}")
        cameras = {"": "lidar"} | {name: name for name in self._recording.camera}
        if cameras != self._camera.options:
            self._camera.set_options(cameras, value=self._camera.value if self._camera.value in cameras else "")
        self._camera.set_visibility(len(cameras) > 1)

    async def _open(self, name: str) -> tuple[Recording, bool] | None:
        """Open a recording and say whether it is being written; or show why that is not possible, and return None."""
        with tell_errors():
            return await run.io_bound(open_recording, self._folder, name)
        return None

    async def _compare(self, event: Any) -> None:
        """Open the recording to compare with."""
        self._other = (await self._open(event.value) or (None,))[0] if event.value else None
        await self._request(self._slider.value)

    async def _change_camera(self) -> None:
        """Show the image of another camera, or of the lidar, whose true origin and centroid can be marked."""
        self._marks.set_visibility(not self._camera.value)
        await self._request(self._slider.value)

    def _point(self, title: str, event: events.MouseEventArguments) -> None:
        text = self._describe_point(title, event.image_x, event.image_y) if self._describe_point else ""
        if text != self._pixel.text:
            self._pixel.text = text

    def _set_scheme(self, scheme: Scheme) -> Any:
        self._scheme = scheme
        return self._request(self._slider.value)

    def _set(self, count: int) -> None:
        self._slider.set_value(max(count - 1, 0))

    def _advance(self) -> None:
        if self._play.value and len(self) and not self._is_drawing:
            self._slider.set_value((int(self._slider.value) + 1) % len(self))

    async def _request(self, k: float) -> None:
        """Draw a frame; while one is drawn, only the last request is kept."""
        self._wanted = int(k)
        if self._is_drawing:
            return
        self._is_drawing = True
        try:
            while self._recording is not None and self._wanted < len(self):
                marked, camera = bool(self._marks.value), str(self._camera.value or "")
                asked = (self._wanted, self._recording, self._other, marked, self._scheme, camera)
                if asked == self._shown:
                    return
                drawn = await run.io_bound(draw_recorded_frame, *asked)
                if drawn is None:
                    return
                self._shown = asked
                self._show(drawn)
        finally:
            self._is_drawing = False

    def _show(self, drawn: DrawnFrame) -> None:
        self._describe_point, self._pixel.text = drawn.describe_point, ""
        self._words.clear()
        with self._words:
            for line in drawn.lines:
                ui.label(line)
        for title, image in self._images.items():
            png = drawn.images.get(title)
            image.set_visibility(png is not None)
            if png is not None:
                image.content = drawn.marks if title == "A" else ""
                what = f"Camera {self._camera.value}" if self._camera.value else "Range and intensity"
                image.props["aria-label"] = f"{what}, {title}: {drawn.lines[0]}"
                image.set_source(f"data:image/png;base64,{base64.b64encode(png).decode()}")

"""The viewer of recordings: one slider over the frames, followed while they are written."""

from __future__ import annotations

import base64

from nicegui import run, ui

from rso_lidar.errors import RsoLidarError
from rso_lidar.export.reader.recording import Recording
from rso_lidar.export.reader.status import read_status
from rso_lidar.studio.folder import RECORDINGS, Folder
from rso_lidar.studio.preview.images import draw_image

_PLAY_S = 0.2


class FrameViewer:
    """Range and intensity of the frames of one recording, complete or being written."""

    def __init__(self, folder: Folder) -> None:
        self._folder = folder
        self._recording: Recording | None = None
        self.name, self.is_following = "", False
        self._wanted = self._shown = -1
        self._is_drawing = False
        self._title = ui.label("Choose a recording in the list").classes("text-base font-medium")
        self._image = ui.element("img").classes("w-full max-w-[1000px]").props('alt="" data-test="frame"').mark("frame")
        self._image.set_visibility(False)
        with ui.row(wrap=False).classes("w-full items-center gap-2 max-w-[1000px]"):
            self._play = ui.switch("Play")
            self._newest = ui.switch("Newest", on_change=lambda event: self._set(len(self)) if event.value else None)
            self._slider = ui.slider(min=0, max=0, step=1, value=0, on_change=lambda event: self._request(event.value))
            self._slider.props('aria-label="Frame" data-test="slider"').classes("grow").mark("slider")
        self._words = ui.label().classes("text-sm")
        ui.timer(_PLAY_S, self._advance)

    def __len__(self) -> int:
        return len(self._recording) if self._recording is not None else 0

    async def open(self, name: str) -> None:
        """Show a recording of the folder."""
        self.name, self._shown = name, -1
        await self._read()
        await self._request(min(int(self._slider.value), max(len(self) - 1, 0)))

    async def refresh(self) -> None:
        """Read new frames of a recording that is being written."""
        if self.name and self.is_following:
            await self._read()
            if self._newest.value:
                self._set(len(self))

    async def _read(self) -> None:
        """Open the file that holds the frames now; a file that grows is opened again."""

        def read(name: str) -> tuple[Recording, bool] | str:
            try:
                status = read_status(self._folder.resolve(name, RECORDINGS))
                return Recording(status.file), status.running
            except RsoLidarError as error:
                return str(error)

        name = self.name
        found = await run.io_bound(read, name)
        if found is None or name != self.name:
            return
        if isinstance(found, str):
            self._words.set_text(found)
            return
        self._recording, self.is_following = found
        self._title.set_text(f"{name}: {self._recording.source.title}, {len(self):,} frames")
        self._slider.props(f"max={max(len(self) - 1, 0)}")

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
            while self._recording is not None and self._wanted != self._shown and self._wanted < len(self):
                recording, wanted = self._recording, self._wanted
                drawn = await run.io_bound(_draw, recording, wanted)
                if drawn is None:
                    return
                if recording is not self._recording and wanted != self._wanted:
                    continue
                png, words = drawn
                self._shown = wanted
                self._words.set_text(words)
                if png:
                    self._image.props["src"] = f"data:image/png;base64,{base64.b64encode(png).decode()}"
                    self._image.props["alt"] = f"Range and intensity: {words}"
                    self._image.set_visibility(True)
                    self._image.update()
        finally:
            self._is_drawing = False


def _draw(recording: Recording, k: int) -> tuple[bytes, str]:
    try:
        frame = recording[k]
        return draw_image(frame), f"frame {frame.index}, {frame.time_s:,.3f} s, {int(frame.valid.sum()):,} returns"
    except RsoLidarError as error:
        return b"", str(error)
